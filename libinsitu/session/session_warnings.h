/* Warnings of what is drawn as asked, but hardly as meant. All but WARNING_ISA are the same on every rank: they are
 * made of what ranks share. A warning is told in the first step that it is true of, and again when it has ceased to be
 * true in between, or the scene was edited. */
#ifndef SESSION_WARNINGS_H
#define SESSION_WARNINGS_H

#include "session_plan.h"
#include "session_view.h"

typedef enum session_warning_kind {
    WARNING_ORDER,    /* of vertices, as far as volumes tell */
    WARNING_ISOVALUE, /* outside of its field */
    WARNING_VIEW,     /* of nothing */
    WARNING_GREY,     /* a surface without the field that colours it */
    WARNING_OVERLAP,
    WARNING_ISA /* of this rank's environment */
} session_warning_kind;

/* What a warning is about: two warnings are one if all of this is the same. */
typedef struct session_warning {
    session_warning_kind kind;
    const char *image, *mesh; /* NULL: of none */
    int number;
} session_warning;

/* Tell it where it holds and has not been told. Local. */
void session_warn(insitu_session *session, const session_warning *warning, bool holds, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Whether it was told and has held since. Local. */
bool session_is_warned(const insitu_session *session, const session_warning *warning);

/* Of meshes whose cells have no volume, are left-handed, or cross themselves, most of them. Collective. */
insitu_status session_warn_of_cells(insitu_session *session, base_error *error);

/* Of isovalues outside of their fields. After the trees were made. Collective. */
insitu_status session_warn_of_isovalues(insitu_session *session, const session_plan *plan, base_error *error);

/* Of a camera that has no cells in view. Local. */
void session_warn_of_view(insitu_session *session, const scene_image *image, const session_view *view);

/* Forget what was told. Local. */
void session_forget_warnings(insitu_session *session);

#endif
