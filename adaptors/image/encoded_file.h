/* A picture's file as OpenImageIO makes it, in memory: its PNG writer does not notice a full disk, and OpenEXR's writer of
 * files in parts, as deep ones are, says nothing of what it cannot write as it closes one. */
#ifndef ADAPTORS_ENCODED_FILE_H
#define ADAPTORS_ENCODED_FILE_H

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cstddef>
#include <memory>
#include <string>
#include <vector>

/* By no thread but the caller's. Every call may throw: std::bad_alloc, or io_error (picture_file.h). */
class encoded_file
{
  public:
    /* name: by whose ending the format is known. */
    encoded_file(const char *name, const OIIO::ImageSpec &spec, std::vector<unsigned char> &bytes);
    /* To a file of that path: OpenImageIO 2.4 knows no other place for deep images. */
    encoded_file(const char *name, const OIIO::ImageSpec &spec, const std::string &path);
    OIIO::ImageOutput &output()
    {
        return *output_;
    }
    [[noreturn]] void fail(); /* with what the output says */
    void finish();

  private:
    void open(const char *name, const OIIO::ImageSpec &spec, const std::string &path);

    std::unique_ptr<OIIO::Filesystem::IOVecOutput> memory_;
    std::unique_ptr<OIIO::ImageOutput> output_;
};

enum { EXR_ZIP_ROWS = 16, EXR_ZIPS_ROWS = 1 };

/* OpenEXR may lose rows that its compressor has no memory for, and say nothing. Throws std::bad_alloc where a block of
 * so many rows, flat or deep, is not in the file. */
void check_exr_rows(const unsigned char *file, std::size_t size, int height, int block_rows);

#endif
