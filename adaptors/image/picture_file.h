/* A picture's file: it appears whole or not at all.
 *
 * What is written goes to a temporary file in the picture's own folder, which then takes the picture's name at once.
 * The temporary file is one that nobody else can have made: of a random name, opened where there was nothing before. It
 * is locked for as long as its writer lives, and so those that killed runs left are told from those being written. */
#ifndef ADAPTORS_PICTURE_FILE_H
#define ADAPTORS_PICTURE_FILE_H

#include <cstddef>
#include <stdexcept>
#include <string>

struct io_error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

/* Write size bytes to path; missing folders are made. Throws io_error, and then what path named before is untouched. */
void write_picture_file(const std::string &path, const unsigned char *bytes, std::size_t size);

#endif
