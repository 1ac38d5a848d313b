/* Samples are passed to OpenImageIO in bands of rows, to avoid a second copy of the whole picture. */
#include "deep_exr.h"

#include <OpenImageIO/deepdata.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstring>
#include <new>
#include <sys/mman.h>
#include <unistd.h>

#include "encoded_file.h"
#include "memory_reserve.h"
#include "picture_file.h"

namespace
{

enum { CHANNELS = 6, BAND_ROWS = 16 };

/* A band of consecutive rows of an image, beginning at row y. */
struct band {
    int y, rows;
    std::size_t first, pixels;
};

band make_band(int width, int height, int y)
{
    const int rows = std::min<int>(BAND_ROWS, height - y);
    const auto columns = static_cast<std::size_t>(width);
    return {y, rows, static_cast<std::size_t>(y) * columns, static_cast<std::size_t>(rows) * columns};
}

std::size_t sample_count(const insitu_deep &deep, std::size_t first, std::size_t pixels)
{
    std::size_t count = 0;
    for (std::size_t i = first; i < first + pixels; i++) count += deep.counts[i];
    return count;
}

/* Describes the file to OpenImageIO. Deep EXR files allow only compression methods that compress each row separately.
 * The compression level is the same as for flat files. */
OIIO::ImageSpec describe(int width, int height)
{
    OIIO::ImageSpec spec(width, height, CHANNELS, OIIO::TypeDesc::FLOAT);
    spec.channelnames = {"R", "G", "B", "A", "Z", "ZBack"};
    spec.alpha_channel = 3;
    spec.z_channel = 4;
    spec.deep = true;
    spec.attribute("oiio:ColorSpace", "Linear");
    spec.attribute("compression", "zips:1");
    return spec;
}

/* Copies the samples of the band. Their channels are in the order of describe(). */
void fill(const insitu_deep &deep, const band &b, OIIO::DeepData &data)
{
    static_assert(sizeof(insitu_deep_sample) == CHANNELS * sizeof(float), "samples have no gaps");
    for (std::size_t i = 0; i < b.pixels; i++)
        data.set_samples(static_cast<std::int64_t>(i), static_cast<int>(deep.counts[b.first + i]));
    for (std::size_t i = 0; i < b.pixels; i++) {
        const std::size_t count = deep.counts[b.first + i];
        if (count == 0) continue;
        void *const to = data.data_ptr(static_cast<std::int64_t>(i), 0, 0);
        if (!to) throw std::bad_alloc();
        std::memcpy(to, deep.samples + deep.first[b.first + i], count * sizeof(insitu_deep_sample));
    }
}

/* An unnamed file in memory, for libraries that require a path. */
class memory_file
{
  public:
    memory_file() : descriptor_(memfd_create("insitu", MFD_CLOEXEC))
    {
        if (descriptor_ < 0) fail();
    }
    memory_file(const memory_file &) = delete;
    memory_file &operator=(const memory_file &) = delete;
    ~memory_file()
    {
        if (bytes_ != MAP_FAILED) munmap(bytes_, size_);
        close(descriptor_);
    }
    std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }
    /* Returns the bytes written so far; the pointer is valid until the file is destroyed. */
    const unsigned char *bytes()
    {
        const off_t end = lseek(descriptor_, 0, SEEK_END);
        if (end <= 0) throw std::bad_alloc();
        size_ = static_cast<std::size_t>(end);
        bytes_ = mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor_, 0);
        if (bytes_ == MAP_FAILED) fail();
        return static_cast<const unsigned char *>(bytes_);
    }
    std::size_t size() const { return size_; }

  private:
    [[noreturn]] static void fail()
    {
        if (errno == ENOMEM) throw std::bad_alloc();
        throw io_error(std::strerror(errno));
    }

    int descriptor_;
    void *bytes_ = MAP_FAILED;
    std::size_t size_ = 0;
};

void encode(int width, int height, const insitu_deep &deep, const std::string &path)
{
    const OIIO::ImageSpec spec = describe(width, height);
    encoded_file file("picture.exr", spec, path);
    for (int y = 0; y < height; y += BAND_ROWS) {
        const band b = make_band(width, height, y);
        OIIO::DeepData data;
        data.init(static_cast<std::int64_t>(b.pixels), CHANNELS, spec.format, spec.channelnames);
        fill(deep, b, data);
        if (!file.output().write_deep_scanlines(y, y + b.rows, 0, data)) file.fail();
    }
    file.finish();
}

/* Returns the largest number of bytes that OpenImageIO needs to store and compress a band. */
std::size_t compute_largest_band_size(int width, int height, const insitu_deep &deep)
{
    std::size_t most = 0;
    for (int y = 0; y < height; y += BAND_ROWS) {
        const band b = make_band(width, height, y);
        const std::size_t samples = sample_count(deep, b.first, b.pixels);
        most = std::max(most, 3 * samples * sizeof(insitu_deep_sample) + b.pixels * 2 * CHANNELS * sizeof(void *));
    }
    return most;
}

} // namespace

void write_deep_exr(int width, int height, const insitu_deep &deep, const std::string &path)
{
    enum { TABLES = 16 << 20, ROW_TABLES = 256 };
    memory_file file;
    const memory_reserve reserve(TABLES + static_cast<std::size_t>(height) * ROW_TABLES +
                                 compute_largest_band_size(width, height, deep));
    encode(width, height, deep, file.path());
    const unsigned char *const bytes = file.bytes();
    check_exr_rows(bytes, file.size(), height, EXR_ZIPS_ROWS);
    write_picture_file(path, bytes, file.size());
}
