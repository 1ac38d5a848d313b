/* A library that has the name of the image library and that a test copies into the working directory. A session that
 * loads it by mistake fails to write its picture. */
#include <stdio.h>

#include "insitu/image_output.h"

insitu_status insitu_image_write(const insitu_image *image, insitu_image_format format, const char *path, char *message,
                                 size_t size)
{
    (void)image, (void)format, (void)path;
    snprintf(message, size, "libinsitu_image was taken from the working directory");
    return INSITU_ERROR_INTERNAL;
}
