/* Text files whose numbers have a point, whatever locale the simulation has set. */
#ifndef BASE_TEXT_FILE_H
#define BASE_TEXT_FILE_H

#include <locale.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/* The calling thread's numbers are C's from begin to end. begin: false where memory runs out; then there is no end. */
typedef struct c_numbers {
    locale_t own, before;
} c_numbers;
bool c_numbers_begin(c_numbers *numbers);
void c_numbers_end(c_numbers *numbers);

typedef void text_writer(FILE *file, const void *what);

/* Write a file anew: into a new one beside it, which then takes its place, so that no reader ever sees a part of it.
 * False with errno where that cannot be done; the old file is then as it was. */
bool text_file_replace(const char *path, text_writer *write, const void *what);

/* Make the folders of a path that are missing. False with errno where that cannot be done. */
bool text_file_make_folders(const char *path);

/* The whole file as text, from base_alloc(). False with errno where that cannot be done; *text is then NULL. */
bool text_file_read(const char *path, char **text);

/* Of lines that begin with a whole number, those of numbers below this move to the text's beginning; returns how many
 * bytes they are. A last line without an end, torn, goes. */
size_t text_keep_below(char *text, long long number);

/* Open a file to read it. NULL with errno where that cannot be done; a pipe does not make the caller wait. */
FILE *text_file_open(const char *path);

#endif
