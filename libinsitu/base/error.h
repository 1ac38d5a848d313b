/* A room reports an error as a status and one message. The function that finds the error fills them in, and they are
 * passed up unchanged. */
#ifndef BASE_ERROR_H
#define BASE_ERROR_H

#include <stddef.h>

#include "insitu/status.h"

typedef struct base_error {
    insitu_status status;
    char message[1024]; /* "" while status is INSITU_OK */
} base_error;

/* Make control characters of text visible, ESC as "\\x1b", so that a name in a message cannot act on a terminal or
 * begin a line. text has room for capacity bytes; what does not fit is cut off. */
void base_escape(char *text, size_t capacity);

/* Record status and a printf-style message, its control characters escaped, and return status. error may be NULL. The
 * first error stays: a later one does not overwrite it. */
insitu_status base_fail(base_error *error, insitu_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
