/* Text files whose numbers have a decimal point, whatever locale the simulation has set. */
#ifndef BASE_TEXT_FILE_H
#define BASE_TEXT_FILE_H

#include <locale.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/* From begin to end, the calling thread writes and reads numbers as C's locale does. begin returns false where memory
 * runs out; then end is not called. */
typedef struct c_numbers {
    locale_t own, before;
} c_numbers;
bool c_numbers_begin(c_numbers *numbers);
void c_numbers_end(c_numbers *numbers);

typedef void text_writer(FILE *file, const void *what);

/* Replace a file: the text goes to a new one beside it, which then takes its place, so that no reader ever sees a part.
 * False with errno where that cannot be done; the old file is then as it was. */
bool text_file_replace(const char *path, text_writer *write, const void *what);

/* Make the folders of a path that are missing. False with errno where that cannot be done. */
bool text_file_make_folders(const char *path);

/* The whole file as text, from base_alloc(). False with errno where that cannot be done; *text is then NULL. */
bool text_file_read(const char *path, char **text);

/* Keeps only the lines that begin with a whole number below number: they move to the beginning of text. Returns how
 * many bytes they are. A torn last line, without an end, is dropped. */
size_t text_keep_below(char *text, long long number);

/* Open a file to read it. NULL with errno where that cannot be done; a pipe does not make the caller wait. */
FILE *text_file_open(const char *path);

#endif
