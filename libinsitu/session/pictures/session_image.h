/* Writing pictures without linking an image library. */
#ifndef SESSION_IMAGE_H
#define SESSION_IMAGE_H

#include <stdbool.h>

#include "error.h"
#include "insitu/image_output.h"

/* Writes an image by libinsitu_image, which the process's first call loads. If loading fails it is an error, and the
 * next call tries again. Local. Thread-safe. */
insitu_status session_write_image(const insitu_image *image, insitu_image_format format, const char *path,
                                  base_error *error);

/* Put the image with its decorations into its place in a larger picture (image_output.h). Local. Thread-safe. */
insitu_status session_place_image(const insitu_image *image, const insitu_place *place, base_error *error);

/* Load the library ahead of the first picture, whose write reports an error. Returns the milliseconds that it took, 0
 * where it was there. Local. Thread-safe. */
double session_load_image_library(void);

/* Finds the reasons why a picture's texts cannot be drawn (image_output.h); only the size and the decorations are read.
 * Finds none if the library cannot be loaded or memory runs out, as writing the picture then fails. Local.
 * Thread-safe. */
void session_check_words(const insitu_image *image, insitu_word_faults *out);

/* Whether pictures may be written by a separate thread (session_writer.h). Tests that replace this file set it to
 * false. */
extern bool session_writes_behind;

#endif
