/* Writes deep EXR files. */
#ifndef ADAPTORS_DEEP_EXR_H
#define ADAPTORS_DEEP_EXR_H

#include <string>

#include "insitu/image_output.h"

/* Writes the image's samples to path as write_picture_file() does. Throws std::bad_alloc or io_error. */
void write_deep_exr(int width, int height, const insitu_deep &deep, const std::string &path);

#endif
