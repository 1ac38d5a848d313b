/* The report of a step while it is written: its numbers, its lists of words, and which warnings were told.
 *
 * A warning says that something is drawn as asked but hardly as meant. All are the same on every rank:
 * most are found from what ranks share, the others are shared (session_lines.h). A warning is told in the first step in
 * which it holds. It is told again if it has not held in between, or if the scene was edited. */
#ifndef SESSION_REPORT_H
#define SESSION_REPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "insitu/insitu.h"

/* Lines of text, which grow. A line that memory cannot hold is left out. */
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

/* Add a line. */
void session_text_add(session_text *text, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Add bytes as they are, and a NUL behind them. False: no memory, and the text stays as it was. */
bool session_text_append(session_text *text, const char *bytes, size_t count);

/* All texts empty; nothing to free yet. Local. */
void session_report_create(session_report *report);

/* Empty numbers and lists for a new step. Local. */
void session_report_begin(session_report *report, int64_t cycle, double time);

/* Hand the lists to the caller. Local. */
void session_report_end(session_report *report);

void session_report_free(session_report *report);

typedef enum session_warning_kind {
    WARNING_ORDER,       /* the vertices of cells are in another order than VTK's, as far as volumes tell */
    WARNING_ISOVALUE,    /* an isovalue lies outside of its field */
    WARNING_TRANSPARENT, /* a volume shows no value of its field */
    WARNING_THRESHOLD,   /* no cell is within a threshold */
    WARNING_PLANE,       /* a plane lies outside of the meshes that it is drawn on */
    WARNING_UNUSABLE,    /* values of cells are not finite */
    WARNING_CLIP,        /* clips leave nothing of a layer */
    WARNING_NO_CELLS,    /* no mesh has cells to draw */
    WARNING_APART,       /* a layer is on several meshes, and one has vertex ids */
    WARNING_NO_LINES,    /* a mesh without the field of a layer's contour lines */
    WARNING_SHELLS,      /* a layer for cells with volume is on shells alone */
    WARNING_SAMPLES,     /* several volumes are sampled by default, to no error */
    WARNING_SCALE,       /* a field has no value that its logarithmic scale can show */
    WARNING_NARROW,      /* values are too near to one another for the colours of their range */
    WARNING_REPLACED,    /* a picture takes the place of an earlier one */
    WARNING_VIEW,        /* a camera sees no cell */
    WARNING_GREY,        /* a surface does not have the field that colours it */
    WARNING_OVERLAP,     /* cells overlap in some pixels */
    WARNING_WORDS,       /* words of a picture are not drawn as they are written */
    WARNING_UNSAID,      /* values have changed though they were said not to have */
    WARNING_OUTPUTS,     /* an image goes nowhere */
    WARNING_PARAMETER,   /* a parameter of the scene is not read */
    WARNING_WRITER,      /* rank 0 has no thread to write pictures */
    WARNING_THREADS,     /* fewer threads than the scene or OpenMP asks for */
    WARNING_ISA          /* INSITU_ISA of this rank's environment is not taken */
} session_warning_kind;

/* The subject of a warning. Two warnings are the same if all of this is. */
typedef struct session_warning {
    session_warning_kind kind;
    const char *image, *mesh; /* NULL: the warning is about none */
    int number;
} session_warning;

/* Tell a warning where it holds and has not been told; on every rank alike, or, of what one rank alone knows, by
 * session_warn_own(): then all ranks tell it once the ranks share such lines. Local. */
void session_warn_own(session_report *report, const session_warning *warning, bool holds, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
void session_warn(session_report *report, const session_warning *warning, bool holds, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Tells whether the warning was told and has held since. Local. */
bool session_is_warned(const session_report *report, const session_warning *warning);

/* Forget which warnings were told. Local. */
void session_forget_warnings(session_report *report);

#endif
