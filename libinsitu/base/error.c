#include "error.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

/* Returns the size in bytes of the control character at the start of the text, or 0 if the text starts with another
 * character. Control characters are those of ASCII, and U+0080 to U+009F in UTF-8. */
static size_t count_control_bytes(const unsigned char *text)
{
    if (text[0] < ' ' || text[0] == 0x7f) return 1;
    return text[0] == 0xc2 && text[1] >= 0x80 && text[1] < 0xa0 ? 2 : 0;
}

static bool has_control_character(const char *text)
{
    for (; *text; text++)
        if (count_control_bytes((const unsigned char *)text)) return true;
    return false;
}

void base_escape(char *text, size_t capacity)
{
    if (!has_control_character(text)) return;
    char escaped[2048];
    const size_t space = capacity < sizeof escaped ? capacity : sizeof escaped;
    size_t size = 0;
    const unsigned char *c = (const unsigned char *)text;
    while (*c && size + 1 < space) {
        const size_t bytes = count_control_bytes(c);
        if (bytes == 0)
            escaped[size++] = (char)*c++;
        else
            size += (size_t)snprintf(escaped + size, space - size, "\\x%02x", bytes == 1 ? c[0] : c[1]);
        c += bytes;
    }
    size = size < space ? size : space - 1;
    memcpy(text, escaped, size);
    text[size] = '\0';
}

insitu_status base_fail(base_error *error, insitu_status status, const char *format, ...)
{
    if (error && error->status == INSITU_OK) {
        va_list arguments;
        va_start(arguments, format);
        vsnprintf(error->message, sizeof error->message, format, arguments);
        va_end(arguments);
        base_escape(error->message, sizeof error->message);
        error->status = status;
    }
    return status;
}
