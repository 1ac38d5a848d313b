/* Writes text files whose numbers have a decimal point, independent of the locale that the simulation has set. */
#ifndef BASE_TEXT_FILE_H
#define BASE_TEXT_FILE_H

#include <locale.h>
#include <stdbool.h>
#include <stddef.h>

#include "file.h"

/* Between c_locale_enter() and c_locale_leave(), the calling thread writes and reads numbers in the C locale.
 * c_locale_enter() returns false if memory runs out; then c_locale_leave() must not be called. */
typedef struct c_locale {
    locale_t number_locale, previous_locale;
} c_locale;
bool c_locale_enter(c_locale *numbers);
void c_locale_leave(c_locale *numbers);

/* A text that is being written in memory. It must be initialized with {0}. open_memstream() is not used, because it
 * silently drops text if memory runs out. */
typedef struct text_output {
    char *bytes; /* the text and a NUL, allocated by base_alloc(); NULL: nothing has been added */
    size_t size, capacity;
    bool is_incomplete; /* set if memory ran out; nothing more is added then */
} text_output;

void text_add(text_output *out, const char *bytes, size_t count);
void text_print(text_output *out, const char *format, ...) __attribute__((format(printf, 2, 3)));

typedef void text_writer(text_output *out, const void *what);

/* Writes the text that write() produces to a file, with numbers in the C locale. An existing file is replaced as by
 * file_replace(). */
bool text_file_replace(const char *path, text_writer *write, const void *what, file_failure *failure);

/* Appends the text that write() produces to a file as file_append() does. Numbers are written in the C locale. */
bool text_file_append(const char *path, text_writer *write, const void *what, file_failure *failure);

/* Keeps only the lines that start with an integer below `number`, and moves them to the start of the text. Returns the
 * number of bytes of the kept lines. If the text ends without a newline, its last line is incomplete and is removed. */
size_t text_keep_lines_below(char *text, long long number);

#endif
