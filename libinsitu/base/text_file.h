/* Writes text files whose numbers have a decimal point, independent of the locale that the simulation has set. */
#ifndef BASE_TEXT_FILE_H
#define BASE_TEXT_FILE_H

#include <locale.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "file.h"

/* Between c_locale_enter() and c_locale_leave(), the calling thread writes and reads numbers in the C locale.
 * c_locale_enter() returns false if memory runs out; then c_locale_leave() must not be called. */
typedef struct c_locale {
    locale_t number_locale, previous_locale;
} c_locale;
bool c_locale_enter(c_locale *numbers);
void c_locale_leave(c_locale *numbers);

typedef void text_writer(FILE *file, const void *what);

/* Replaces a file as file_replace() does; its text is the output of write(), with numbers in the C locale. */
bool text_file_replace(const char *path, text_writer *write, const void *what, file_failure *failure);

/* Appends the output of write() to a file, like file_append(), with numbers in the C locale. */
bool text_file_append(const char *path, text_writer *write, const void *what, file_failure *failure);

/* Removes all lines except those that begin with a whole number below `number`, and moves these to the begin of the
 * text. Returns the number of bytes that they take. An incomplete last line is removed. */
size_t text_keep_below(char *text, long long number);

#endif
