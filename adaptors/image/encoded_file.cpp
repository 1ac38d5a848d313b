#include "encoded_file.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <new>
#include <string>

#include "picture_file.h"

namespace
{

/* Throws an exception for an error message of a library: std::bad_alloc if the message mentions memory, otherwise
 * io_error with the message. The libraries report a lack of memory only by the text of their messages. */
[[noreturn]] void fail_with(std::string what)
{
    for (const char *words : {"memory", "bad_alloc"})
        if (what.find(words) != std::string::npos) throw std::bad_alloc();
    std::replace(what.begin(), what.end(), '\n', ' ');
    throw io_error(what);
}

/* The contents of a file. */
struct file_bytes {
    const unsigned char *at;
    std::size_t size;
};

/* Reads a little-endian number of this many bytes. */
std::uint64_t read_number_at(const file_bytes &file, std::size_t at, int bytes)
{
    std::uint64_t number = 0;
    for (int i = bytes; i-- > 0;) number = number << 8 | file.at[at + static_cast<std::size_t>(i)];
    return number;
}

/* Checks an EXR file. Its attributes (name, type, size and value each) are followed by a table with the file position
 * of each block of rows; the position of a missing block is 0. The files written here have one part, and therefore one
 * list of attributes. */
bool has_all_rows(const file_bytes &file, int height, int block_rows)
{
    enum { VERSION = 4, VERSION_END = 8, SIZE_BYTES = 4, PLACE_BYTES = 8, HAS_PARTS = 0x1000 };
    std::size_t at = VERSION_END;
    if (file.size < VERSION_END) return false;
    while (at < file.size && file.at[at]) {
        for (int text = 0; text < 2; text++) {
            while (at < file.size && file.at[at]) at++;
            at++;
        }
        if (at + SIZE_BYTES > file.size) return false;
        at += SIZE_BYTES + static_cast<std::size_t>(read_number_at(file, at, SIZE_BYTES));
    }
    at += read_number_at(file, VERSION, SIZE_BYTES) & HAS_PARTS ? 2 : 1;
    for (int row = 0; row < height; row += block_rows, at += PLACE_BYTES)
        if (at + PLACE_BYTES > file.size || !read_number_at(file, at, PLACE_BYTES)) return false;
    return true;
}

} // namespace

encoded_file::encoded_file(const char *name, const OIIO::ImageSpec &spec, std::vector<unsigned char> &bytes)
    : memory_(std::make_unique<OIIO::Filesystem::IOVecOutput>(bytes))
{
    open(name, spec, name);
}

encoded_file::encoded_file(const char *name, const OIIO::ImageSpec &spec, const std::string &path)
{
    open(name, spec, path);
}

void encoded_file::open(const char *name, const OIIO::ImageSpec &spec, const std::string &path)
{
    OIIO::attribute("threads", 1);
    OIIO::attribute("exr_threads", -1); /* so that OpenEXR uses only the caller's thread */
    output_ = OIIO::ImageOutput::create(name, memory_.get());
    if (!output_) fail_with(OIIO::geterror());
    output_->threads(1);
    if (!output_->open(path, spec)) fail();
}

void encoded_file::fail()
{
    fail_with(output_->geterror());
}

void encoded_file::finish()
{
    if (!output_->close() || output_->has_error()) fail();
}

void check_exr_rows(const unsigned char *file, std::size_t size, int height, int block_rows)
{
    if (!has_all_rows({file, size}, height, block_rows)) throw std::bad_alloc();
}
