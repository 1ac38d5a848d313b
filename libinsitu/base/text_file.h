/* Text files whose numbers have a decimal point, whatever locale the simulation has set. */
#ifndef BASE_TEXT_FILE_H
#define BASE_TEXT_FILE_H

#include <locale.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "file.h"

/* From begin to end, the calling thread writes and reads numbers as C's locale does. begin returns false where memory
 * runs out; then end is not called. */
typedef struct c_numbers {
    locale_t own, before;
} c_numbers;
bool c_numbers_begin(c_numbers *numbers);
void c_numbers_end(c_numbers *numbers);

typedef void text_writer(FILE *file, const void *what);

/* Write a file anew, as file_replace(); its text is what write() writes, numbers as in C's locale. */
bool text_file_replace(const char *path, text_writer *write, const void *what, file_failure *failure);

/* Append to a file, as file_append(). */
bool text_file_append(const char *path, text_writer *write, const void *what, file_failure *failure);

/* Keeps only the lines that begin with a whole number below number: they move to the beginning of text. Returns how
 * many bytes they are. A torn last line, without an end, is dropped. */
size_t text_keep_below(char *text, long long number);

#endif
