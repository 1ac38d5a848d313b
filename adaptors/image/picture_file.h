/* Writes a picture's file atomically: it appears complete or not at all.
 *
 * The bytes are written to a temporary file in the picture's folder, and the temporary file is then renamed. The
 * temporary file cannot belong to another process, because it has a random name and is created exclusively. It is
 * locked while its writer runs, so that temporary files of killed runs can be distinguished from those being
 * written. */
#ifndef ADAPTORS_PICTURE_FILE_H
#define ADAPTORS_PICTURE_FILE_H

#include <cstddef>
#include <stdexcept>
#include <string>

struct io_error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/* Writes size bytes to path, and creates missing folders. If it throws io_error, an existing file of that path does not
 * change. */
void write_picture_file(const std::string &path, const unsigned char *bytes, std::size_t size);

#endif
