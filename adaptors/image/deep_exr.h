/* Deep EXR files. */
#ifndef ADAPTORS_DEEP_EXR_H
#define ADAPTORS_DEEP_EXR_H

#include <string>

#include "insitu/image_output.h"

/* Write a file of the image's samples to path, as write_picture_file() does. Throws. */
void write_deep_exr(int width, int height, const insitu_deep &deep, const std::string &path);

#endif
