/* The face between the library and whatever writes its pictures. libinsitu itself knows no image format: on rank 0,
 * when the first picture is due, it loads libinsitu_image (adaptors/image, on OpenImageIO) and calls
 * insitu_image_write(). So other ranks never load an image library. */
#ifndef INSITU_IMAGE_OUTPUT_H
#define INSITU_IMAGE_OUTPUT_H

#include <stddef.h>

#include "insitu/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum insitu_image_format {
    INSITU_PNG8 = 0,  /* sRGB, 8 bits a channel, straight alpha; no alpha channel where all is opaque */
    INSITU_PNG16 = 1, /* the same with 16 bits */
    INSITU_EXR = 2    /* linear premultiplied float RGBA, and the channel Z where depth is given */
} insitu_image_format;

typedef struct insitu_image {
    int width, height;
    const float *rgba;  /* row-major, height × width × 4, top row first, linear, premultiplied */
    const float *depth; /* NULL, or row-major, height × width: of the nearest surface, of any opacity and whatever
                           volume is in front, the distance from the eye along the camera's axis (not along the pixel's
                           ray) in scene units; +infinity where there is none */
} insitu_image;

/* Write to a temporary file beside path and rename, so that path is never half a picture; missing folders are made. The
 * temporary file is named ".insitu-", 16 random digits and ".part", and is locked while it is written; the first
 * picture that a process writes to a folder removes those that killed runs of the same user left there. A pipe, device
 * or directory of the picture's name is an error. On an error message (size bytes) says what, with the path. Local. */
typedef insitu_status insitu_image_write_function(const insitu_image *image, insitu_image_format format,
                                                  const char *path, char *message, size_t size);

INSITU_API insitu_image_write_function insitu_image_write;

#ifdef __cplusplus
}
#endif

#endif
