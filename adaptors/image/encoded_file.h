/* Encodes pictures with OpenImageIO. Flat pictures are encoded in memory, because OpenImageIO's PNG writer does not
 * report a full disk. Deep files can only be written to a path. Here this must be the path of a file in memory, because
 * OpenEXR's writer of deep files does not report write errors when the file is closed. */
#ifndef ADAPTORS_ENCODED_FILE_H
#define ADAPTORS_ENCODED_FILE_H

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

/* An encoder that uses only the caller's thread. Every member may throw std::bad_alloc or io_error (picture_file.h). */
class encoded_file
{
  public:
    /* Encodes into bytes; the extension of name selects the format. */
    encoded_file(const char *name, const OIIO::ImageSpec &spec, std::vector<unsigned char> &bytes);
    /* Encodes into a file at the path. OpenImageIO 2.4 cannot write deep images to memory. */
    encoded_file(const char *name, const OIIO::ImageSpec &spec, const std::string &path);
    OIIO::ImageOutput &output() { return *output_; }
    [[noreturn]] void fail(); /* throws an exception with the output's error message */
    void finish();

  private:
    void open(const char *name, const OIIO::ImageSpec &spec, const std::string &path);

    std::unique_ptr<OIIO::Filesystem::IOVecOutput> memory_;
    std::unique_ptr<OIIO::ImageOutput> output_;
};

enum { EXR_ZIP_ROWS = 16, EXR_ZIPS_ROWS = 1 };

/* Checks an EXR file, flat or deep, from which OpenEXR may silently drop rows if its compressor runs out of memory.
 * Throws std::bad_alloc if a block of block_rows rows is missing. */
void check_exr_rows(const unsigned char *file, std::size_t size, int height, int block_rows);

#endif
