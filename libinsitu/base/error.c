#include "error.h"

#include <stdarg.h>
#include <stdio.h>

insitu_status base_fail(base_error *error, insitu_status status, const char *format, ...)
{
    if (error && error->status == INSITU_OK) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(error->message, sizeof error->message, format, arguments);
        va_end(arguments);
        error->status = status;
    }
    return status;
}
