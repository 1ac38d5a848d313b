#include "text_file.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"

bool c_locale_enter(c_locale *numbers)
{
    numbers->number_locale = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
    if (numbers->number_locale) numbers->previous_locale = uselocale(numbers->number_locale);
    return numbers->number_locale != (locale_t)0;
}

void c_locale_leave(c_locale *numbers)
{
    uselocale(numbers->previous_locale);
    freelocale(numbers->number_locale);
}

/* ---- texts in memory ------------------------------------------------------------------------------------------- */

/* Ensures that there is space for `more` further bytes and a NUL. Returns false if memory has run out. */
static bool reserve_bytes(text_output *out, size_t more)
{
    if (out->is_incomplete) return false;
    if (out->size + more < out->capacity) return true;
    const size_t capacity = 2 * (out->size + more) + 256;
    char *bytes = base_realloc(out->bytes, capacity);
    out->is_incomplete = !bytes;
    if (!bytes) return false;
    out->bytes = bytes;
    out->capacity = capacity;
    return true;
}

void text_add(text_output *out, const char *bytes, size_t count)
{
    if (!reserve_bytes(out, count)) return;
    memcpy(out->bytes + out->size, bytes, count);
    out->size += count;
    out->bytes[out->size] = '\0';
}

void text_print(text_output *out, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(NULL, 0, format, arguments);
    va_end(arguments);
    out->is_incomplete = out->is_incomplete || length < 0;
    if (!reserve_bytes(out, length < 0 ? 0 : (size_t)length)) return;
    va_start(arguments, format);
    vsnprintf(out->bytes + out->size, (size_t)length + 1, format, arguments);
    va_end(arguments);
    out->size += (size_t)length;
}

/* ---- files ------------------------------------------------------------------------------------------------------ */

typedef bool file_writer(const char *path, const char *bytes, size_t size, file_failure *failure);

static bool write_text_to_file(const char *path, text_writer *write, const void *what, file_writer *put,
                               file_failure *failure)
{
    c_locale numbers;
    text_output out = {.is_incomplete = !c_locale_enter(&numbers)};
    if (!out.is_incomplete) {
        write(&out, what);
        c_locale_leave(&numbers);
    }
    *failure = (file_failure){.is_out_of_memory = true, .reason = "cannot allocate memory"};
    const bool is_put = !out.is_incomplete && put(path, out.bytes ? out.bytes : "", out.size, failure);
    base_free(out.bytes);
    return is_put;
}

bool text_file_replace(const char *path, text_writer *write, const void *what, file_failure *failure)
{
    return write_text_to_file(path, write, what, file_replace, failure);
}

bool text_file_append(const char *path, text_writer *write, const void *what, file_failure *failure)
{
    return write_text_to_file(path, write, what, file_append, failure);
}

size_t text_keep_lines_below(char *text, long long number)
{
    size_t kept = 0;
    for (char *line = text, *end; (end = strchr(line, '\n')) != NULL; line = end + 1) {
        const size_t size = (size_t)(end + 1 - line);
        if (strtoll(line, NULL, 10) >= number) continue;
        memmove(text + kept, line, size);
        kept += size;
    }
    return kept;
}
