/* The report of a step while it is written: its numbers, its lists of texts, and the warnings already reported.
 *
 * A warning tells the user that something is drawn as requested but probably not as intended. All warnings are the same
 * on every rank: most are derived from data that all ranks share, the others are sent to all (session_lines.h). A
 * warning is reported in the first step in which its condition holds, and again if the condition has not held in
 * between, or if the scene was edited. */
#ifndef SESSION_REPORT_H
#define SESSION_REPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "insitu/insitu.h"

/* Lines of text. A line for which there is no memory is dropped. */
typedef struct session_text {
    char *data;
    size_t size, capacity;
} session_text;

typedef struct session_report {
    insitu_report numbers; /* its texts are set at the end of a step */
    session_text copied_why, left_out, warnings;
    session_text own; /* this rank's warnings until session_share_lines() gathers those of all ranks */
    int told_count;
    uint64_t *told;        /* hashes of warnings that were reported and still hold */
    uint64_t unusable_key; /* session_unusable_key() when its warnings were reported; 0: there were none */
} session_report;

/* Adds a line. */
void session_text_add(session_text *text, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Appends bytes unchanged, and a NUL behind them. Returns false if there is no memory; the text is then unchanged. */
bool session_text_append(session_text *text, const char *bytes, size_t count);

/* Initializes all texts as empty, without memory to free. Local. */
void session_report_create(session_report *report);

/* Clears numbers and lists for a new step. Local. */
void session_report_begin(session_report *report, int64_t cycle, double time);

/* Passes the lists to the caller. Local. */
void session_report_end(session_report *report);

void session_report_free(session_report *report);

typedef enum session_warning_kind {
    WARNING_ORDER,       /* cells' vertices are not in VTK's order, judged by their volumes */
    WARNING_ISOVALUE,    /* an isovalue lies outside of its field */
    WARNING_TRANSPARENT, /* a volume shows no value of its field */
    WARNING_THRESHOLD,   /* no cell is within a threshold */
    WARNING_PLANE,       /* a plane lies outside of the meshes that it is drawn on */
    WARNING_UNUSABLE,    /* values of cells are not finite */
    WARNING_CLIP,        /* clips remove all of a layer */
    WARNING_NO_CELLS,    /* no mesh has cells to draw */
    WARNING_APART,       /* a layer is on several meshes, and one has vertex ids */
    WARNING_NO_LINES,    /* a mesh without the field of a layer's contour lines */
    WARNING_SHELLS,      /* a layer for cells with volume is on shells alone */
    WARNING_SAMPLES,     /* several volumes are sampled by default, to no error */
    WARNING_SCALE,       /* a field has no value that its logarithmic scale can show */
    WARNING_NARROW,      /* values are too close to each other for the colours of their range */
    WARNING_REPLACED,    /* a picture overwrites an earlier one */
    WARNING_VIEW,        /* a camera sees no cell */
    WARNING_GREY,        /* a surface lacks the field that colours it */
    WARNING_OVERLAP,     /* cells overlap in some pixels */
    WARNING_WORDS,       /* a text of a picture cannot be drawn as written */
    WARNING_UNSAID,      /* values have changed although the caller declared them unchanged */
    WARNING_OUTPUTS,     /* an image has no outputs */
    WARNING_PARAMETER,   /* a parameter of the scene is not used */
    WARNING_WRITER,      /* rank 0 has no thread that writes pictures */
    WARNING_THREADS,     /* fewer threads than the scene or OpenMP requests */
    WARNING_ISA          /* INSITU_ISA in this rank's environment is ignored */
} session_warning_kind;

/* The subject of a warning. Two warnings are the same if all members are equal. */
typedef struct session_warning {
    session_warning_kind kind;
    const char *image, *mesh; /* NULL: the warning is about none */
    int number;
} session_warning;

/* Adds the warning if its condition holds and it has not been reported yet. session_warn(): for conditions that are the
 * same on every rank; session_warn_own(): for one rank's, which session_share_lines() sends to all. Local. */
void session_warn_own(session_report *report, const session_warning *warning, bool holds, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
void session_warn(session_report *report, const session_warning *warning, bool holds, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Returns whether the warning was reported and its condition has held since. Local. */
bool session_is_warned(const session_report *report, const session_warning *warning);

/* Clears the list of reported warnings. Local. */
void session_forget_warnings(session_report *report);

#endif
