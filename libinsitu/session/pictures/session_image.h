/* Writing pictures without linking an image library. */
#ifndef SESSION_IMAGE_H
#define SESSION_IMAGE_H

#include "error.h"
#include "insitu/image_output.h"

/* Write by libinsitu_image, which the first call of the process loads; an error where it is not to be had, and the next
 * call tries again. Local. Thread-safe. */
insitu_status session_write_image(const insitu_image *image, insitu_image_format format, const char *path,
                                  base_error *error);

#endif
