/* Represents an error as a status and one message. The function that finds the error fills them in, and its callers
 * return them unchanged. */
#ifndef BASE_ERROR_H
#define BASE_ERROR_H

#include <stddef.h>

#include "insitu/status.h"

typedef struct base_error {
    insitu_status status;
    char message[1024]; /* message of the error; "" if status is INSITU_OK */
} base_error;

/* Makes the control characters of a text visible: ESC, for example, becomes "\\x1b". A name in a message can then
 * neither control a terminal nor begin a new line. The memory at text has capacity bytes; text that does not fit is cut
 * off. */
void base_escape(char *text, size_t capacity);

/* Records status and a printf-style message with its control characters escaped, and returns status. error may be NULL.
 * The first error remains: a later error does not overwrite it. */
insitu_status base_fail(base_error *error, insitu_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
