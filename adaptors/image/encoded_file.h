/* Makes a picture's file by OpenImageIO, in memory because its PNG writer does not notice a full disk. OpenEXR's writer
 * of deep files does not report what it cannot write when it closes one. */
#ifndef ADAPTORS_ENCODED_FILE_H
#define ADAPTORS_ENCODED_FILE_H

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

/* Uses the caller's thread only. Every call may throw std::bad_alloc, or io_error (picture_file.h). */
class encoded_file
{
  public:
    /* The ending of name selects the format. */
    encoded_file(const char *name, const OIIO::ImageSpec &spec, std::vector<unsigned char> &bytes);
    /* Writes to a file of that path: OpenImageIO 2.4 knows no other place for deep images. */
    encoded_file(const char *name, const OIIO::ImageSpec &spec, const std::string &path);
    OIIO::ImageOutput &output()
    {
        return *output_;
    }
    [[noreturn]] void fail(); /* throws the output's message */
    void finish();

  private:
    void open(const char *name, const OIIO::ImageSpec &spec, const std::string &path);

    std::unique_ptr<OIIO::Filesystem::IOVecOutput> memory_;
    std::unique_ptr<OIIO::ImageOutput> output_;
};

enum { EXR_ZIP_ROWS = 16, EXR_ZIPS_ROWS = 1 };

/* OpenEXR may silently lose rows that its compressor has no memory for. Throws std::bad_alloc where a block of
 * block_rows rows, flat or deep, is missing in the file. */
void check_exr_rows(const unsigned char *file, std::size_t size, int height, int block_rows);

#endif
