/* A replacement of the image library that writes pixels without a format, for tests that compare the pictures of many
 * runs: loading OpenImageIO takes longer than such a run. The file contains the picture's floats, then its depths if
 * there are any. */
#include <stdio.h>

#include "insitu/image_output.h"

insitu_status insitu_image_write(const insitu_image *image, insitu_image_format format, const char *path, char *message,
                                 size_t size)
{
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    FILE *file = fopen(path, "wb");
    (void)format;
    bool is_written = file && fwrite(image->rgba, 4 * sizeof(float), pixels, file) == pixels;
    if (is_written && image->depth) is_written = fwrite(image->depth, sizeof(float), pixels, file) == pixels;
    if (file && fclose(file)) is_written = false;
    snprintf(message, size, "%s%s", is_written ? "" : path, is_written ? "" : ": cannot be written");
    return is_written ? INSITU_OK : INSITU_ERROR_IO;
}
