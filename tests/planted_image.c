/* A library of the image library's name, planted in the working directory: a session that loads it gets no picture. */
#include <stdio.h>

#include "insitu/image_output.h"

insitu_status insitu_image_write(const insitu_image *image, insitu_image_format format, const char *path, char *message,
                                 size_t size)
{
    (void)image, (void)format, (void)path;
    snprintf(message, size, "libinsitu_image was taken from the working directory");
    return INSITU_ERROR_INTERNAL;
}
