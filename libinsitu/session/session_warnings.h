/* Warnings of what is drawn as asked, but hardly as meant. All are the same on every rank: they are made of what ranks
 * share. A warning is told in the first step that it is true of, and again when it has ceased to be true in between, or
 * the scene was edited. */
#ifndef SESSION_WARNINGS_H
#define SESSION_WARNINGS_H

#include "session.h"

typedef enum session_warning_kind {
    WARNING_GREY /* a surface without the field that colours it */
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

/* Whether it was told when it last held, and holds still for all that is known. Local. */
bool session_is_warned(const insitu_session *session, const session_warning *warning);

/* Forget what was told. Local. */
void session_forget_warnings(insitu_session *session);

#endif
