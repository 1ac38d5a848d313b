#include "text_file.h"

#include <stdlib.h>
#include <string.h>

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

/* Calls write() with a stream into memory, with numbers in the C locale. The caller must free *text with free(). */
static bool print(text_writer *write, const void *what, char **text, size_t *size)
{
    c_locale numbers;
    *text = NULL;
    if (!c_locale_enter(&numbers)) return false;
    FILE *stream = open_memstream(text, size);
    if (stream) write(stream, what);
    const bool is_written = stream && !ferror(stream);
    const bool is_closed = stream && fclose(stream) == 0;
    c_locale_leave(&numbers);
    if (is_written && is_closed) return true;
    free(*text);
    *text = NULL;
    return false;
}

typedef bool file_writer(const char *path, const char *bytes, size_t size, file_failure *failure);

static bool print_to(const char *path, text_writer *write, const void *what, file_writer *put, file_failure *failure)
{
    char *text;
    size_t size;
    if (!print(write, what, &text, &size)) {
        *failure = (file_failure){.is_out_of_memory = true, .reason = "cannot allocate memory"};
        return false;
    }
    const bool is_put = put(path, text, size, failure);
    free(text);
    return is_put;
}

bool text_file_replace(const char *path, text_writer *write, const void *what, file_failure *failure)
{
    return print_to(path, write, what, file_replace, failure);
}

bool text_file_append(const char *path, text_writer *write, const void *what, file_failure *failure)
{
    return print_to(path, write, what, file_append, failure);
}

size_t text_keep_below(char *text, long long number)
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
