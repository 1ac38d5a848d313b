/* A library with the image library's name that a test puts into the working directory: a session that loads it by
 * mistake fails to write its picture. */
#include <stdio.h>

#include "insitu/image_output.h"

insitu_status insitu_image_write(const insitu_image *image, insitu_image_format format, const char *path, char *message,
                                 size_t size)
{
    (void)image, (void)format, (void)path;
    snprintf(message, size, "libinsitu_image was taken from the working directory");
    return INSITU_ERROR_INTERNAL;
}
