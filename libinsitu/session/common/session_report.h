/* The report of a step while it is written. It contains the numbers and texts of insitu_report, and a list of the
 * warnings already reported.
 *
 * A warning informs the user that something is drawn as requested but probably not as intended. All warnings are the
 * same on every rank: most are derived from data that all ranks share, the others are sent to all ranks
 * (session_lines.h). A warning is reported in the first step in which its condition holds. It is reported again only
 * if the condition has been false in a step since then, or if the scene has been edited. */
#ifndef SESSION_REPORT_H
#define SESSION_REPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "insitu/insitu.h"

/* Lines of text. A line is dropped if there is no memory for it. */
typedef struct session_text {
    char *data;
    size_t size, capacity;
} session_text;

typedef struct session_report {
    insitu_report public_report; /* the report that the caller reads; its texts are set at the end of a step */
    /* the texts to which the members of public_report with the same names point after session_report_end() */
    session_text copied_why, left_out, warnings, pieces;
    /* warnings that only this rank has found; session_broadcast_warnings() sends those of one rank to all ranks */
    session_text own_warnings;
    /* reported_count: number of warnings in `reported`; reported_capacity: number of warnings for which it has space */
    int reported_count, reported_capacity;
    uint64_t *reported; /* hashes of warnings that were reported and whose condition still holds, in ascending order */
    /* result of session_hash_unusable_fields() when warnings of cells with values that are not finite were last
     * reported; 0: there were none */
    uint64_t unusable_key;
} session_report;

/* Adds a line of formatted text. */
void session_text_add(session_text *text, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Initializes all texts as empty. No memory is allocated. Local. */
void session_report_create(session_report *report);

/* Clears all counts, times and texts of the report for a new step. The list of reported warnings is kept. Local. */
void session_report_begin(session_report *report, int64_t cycle, double time);

/* Sets the texts and the peak of memory in the report that the caller reads. Local. */
void session_report_end(session_report *report);

void session_report_free(session_report *report);

typedef enum session_warning_kind {
    WARNING_ORDER,  /* the cells' volumes suggest that their vertices are not in VTK's order */
    WARNING_PIECES, /* an isosurface of linear pieces may differ from that of the polynomials by more than surface_error
                     */
    WARNING_FINER,  /* cells of higher order are split into fewer linear pieces than the scene requests */
    WARNING_ISOVALUE,    /* an isovalue lies outside the range of its field */
    WARNING_TRANSPARENT, /* a volume layer is transparent for all values of its field */
    WARNING_THRESHOLD,   /* no cell is within a threshold */
    WARNING_PLANE,       /* a plane lies outside the meshes on which it is drawn */
    WARNING_UNUSABLE,    /* values of cells are not finite */
    WARNING_UNCOLOURED,  /* values of cells by which surfaces are coloured are not finite */
    WARNING_UNCOUNTED,   /* no cell counts in statistics */
    WARNING_CLIP,        /* clips remove all of a layer */
    WARNING_NO_CELLS,    /* no mesh contains cells that can be drawn */
    /* a layer averages values over several meshes, but the vertices of one mesh have global ids and are not matched
     * with those of the others */
    WARNING_APART,
    WARNING_NO_LINES, /* a mesh does not have the field of a layer's contour lines */
    WARNING_SHELLS,   /* a layer that needs cells with volume is drawn on a mesh that has only shells */
    WARNING_SAMPLES,  /* several volumes are sampled at the default distance, without an error bound */
    WARNING_SCALE,    /* a field has no value that its logarithmic scale can show */
    /* a field's colour range is so narrow, compared with its values, that the rounding of float32 may be visible */
    WARNING_NARROW,
    WARNING_REPLACED,  /* a picture overwrites an earlier one */
    WARNING_VIEW,      /* a camera sees no cell */
    WARNING_GREY,      /* a mesh does not have the field that colours its surface */
    WARNING_OVERLAP,   /* cells overlap in some pixels */
    WARNING_WORDS,     /* a text of a picture cannot be drawn as written */
    WARNING_BARS,      /* pictures that should share their colour bars have different ones */
    WARNING_UNSAID,    /* values have changed although the caller declared them unchanged */
    WARNING_OUTPUTS,   /* an image has no outputs */
    WARNING_PARAMETER, /* a parameter of the scene is not used */
    WARNING_MESH,      /* no mesh has a name that the scene gives at `meshes` */
    WARNING_WARP,      /* gradients are computed from the displaced vertices of a warped mesh */
    WARNING_MIRROR,    /* a mesh lies on both sides of its mirror plane */
    WARNING_WRITER,    /* rank 0 has no thread that writes pictures */
    WARNING_THREADS,   /* the scene or OpenMP requests more threads than can be started */
    WARNING_ISA        /* INSITU_ISA in this rank's environment is ignored */
} session_warning_kind;

/* The subject of a warning. Two warnings are the same if all members are equal. */
typedef struct session_warning {
    session_warning_kind kind;
    const char *image, *mesh; /* NULL: the warning does not refer to an image, or to a mesh */
    int number; /* distinguishes warnings of the same kind, image and mesh, such as those of several isovalues */
} session_warning;

/* Adds the warning if its condition holds and it has not been reported yet. session_warn() is for conditions that are
 * the same on every rank. session_warn_locally() is for conditions that may differ between ranks;
 * session_broadcast_warnings() sends these warnings to all ranks. Local. */
void session_warn_locally(session_report *report, const session_warning *warning, bool holds, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
void session_warn(session_report *report, const session_warning *warning, bool holds, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Returns whether the warning has been reported and its condition has held in every step since. Local. */
bool session_has_reported_warning(const session_report *report, const session_warning *warning);

/* Clears the list of reported warnings. Local. */
void session_clear_reported_warnings(session_report *report);

#endif
