/* A picture's file: it appears whole or not at all.
 *
 * Bytes go to a temporary file in the picture's own folder, which is then renamed to the picture. Nobody else can have
 * made the temporary file: it has a random name and is opened only if there was none. It is locked as long as its
 * writer lives, and so files that killed runs left are told from those being written. */
#ifndef ADAPTORS_PICTURE_FILE_H
#define ADAPTORS_PICTURE_FILE_H

#include <cstddef>
#include <stdexcept>
#include <string>

struct io_error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/* Write size bytes to path; missing folders are made. If it throws io_error, a file that path named before is
 * untouched. */
void write_picture_file(const std::string &path, const unsigned char *bytes, std::size_t size);

#endif
