/* Writes pictures with the image library libinsitu_image. The library is loaded at run time, so that the session is not
 * linked to it. */
#ifndef SESSION_IMAGE_H
#define SESSION_IMAGE_H

#include <stdbool.h>

#include "error.h"
#include "insitu/image_output.h"

/* Writes a picture with libinsitu_image. The first call in the process loads this library. If loading fails, an error
 * is returned, and the next call tries again. Local. Thread-safe. */
insitu_status session_write_image(const insitu_image *image, insitu_image_format format, const char *path,
                                  base_error *error);

/* Draws the picture `image` with its decorations into its place in a larger picture (image_output.h). Local.
 * Thread-safe. */
insitu_status session_place_image(const insitu_image *image, const insitu_place *place, base_error *error);

/* Loads the image library before the first picture is written. Errors are ignored, because writing the picture will
 * return the same error. Returns the time taken in milliseconds; 0 if the library was already loaded. Local.
 * Thread-safe. */
double session_load_image_library(void);

/* Finds the reasons why a picture's texts cannot be drawn (image_output.h). Only the size and the decorations of the
 * picture are read. If the library cannot be loaded or memory runs out, no reasons are found, because writing the
 * picture will fail anyway. Local. Thread-safe. */
void session_find_text_faults(const insitu_image *image, insitu_word_faults *out);

/* Set if pictures may be written by a separate thread (session_writer.h). Tests that replace session_image.c
 * set it to false. */
extern bool session_writes_behind;

#endif
