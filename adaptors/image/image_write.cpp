/* insitu_image_write() by OpenImageIO: the one place that knows image formats.
 *
 * A picture appears whole or not at all: it is written under a temporary name in its own folder, which rename() then
 * swaps in at once even on most network file systems. libinsitu loads this file by dlopen() inside someone's run, so
 * nothing may be thrown out of it, it starts no threads, and what goes wrong is said in a message. */
#include "insitu/image_output.h"

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>

#include <cerrno>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <unistd.h>
#include <vector>

namespace
{

namespace fs = std::filesystem;

struct io_error : std::runtime_error {
    using std::runtime_error::runtime_error;
};

std::size_t pixel_count(const insitu_image &image)
{
    return static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
}

double srgb_from_linear(double linear)
{
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

/* The nearest code of [0, 1]; NaN is 0. */
template <typename code> code code_of(double value)
{
    const double largest = static_cast<double>(static_cast<code>(~code{0}));
    if (!(value > 0)) return 0;
    return static_cast<code>(value < 1 ? value * largest + 0.5 : largest);
}

bool is_opaque(const insitu_image &image)
{
    for (std::size_t i = 0; i < pixel_count(image); i++) {
        if (!(image.rgba[4 * i + 3] >= 1)) return false;
    }
    return true;
}

/* Straight sRGB codes, with the alpha channel where channels is 4. */
template <typename code> std::vector<code> encode(const insitu_image &image, std::size_t channels)
{
    std::vector<code> codes(pixel_count(image) * channels);
    for (std::size_t i = 0; i < pixel_count(image); i++) {
        const float *pixel = image.rgba + 4 * i;
        const double alpha = pixel[3];
        for (std::size_t c = 0; c < 3; c++) {
            const double straight = alpha > 0 ? (alpha < 1 ? pixel[c] / alpha : pixel[c]) : 0;
            codes[channels * i + c] = code_of<code>(srgb_from_linear(straight));
        }
        if (channels == 4) codes[channels * i + 3] = code_of<code>(alpha);
    }
    return codes;
}

std::vector<float> with_depth(const insitu_image &image)
{
    std::vector<float> all(pixel_count(image) * 5);
    for (std::size_t i = 0; i < pixel_count(image); i++) {
        std::memcpy(&all[5 * i], image.rgba + 4 * i, 4 * sizeof(float));
        all[5 * i + 4] = image.depth[i];
    }
    return all;
}

/* A file of the temporary name that is gone again unless keep() renames it. */
class temporary_file
{
  public:
    temporary_file(const fs::path &target, const char *ending)
        : target_(target), path_(target.parent_path() /
                                 ("." + target.filename().string() + "." + std::to_string(getpid()) + ".part" + ending))
    {
    }
    temporary_file(const temporary_file &) = delete;
    temporary_file &operator=(const temporary_file &) = delete;
    ~temporary_file()
    {
        std::error_code ignored;
        if (!is_kept_) fs::remove(path_, ignored);
    }
    const fs::path &path() const { return path_; }
    void keep()
    {
        std::error_code code;
        fs::rename(path_, target_, code);
        if (code) throw io_error(code.message());
        is_kept_ = true;
    }

  private:
    fs::path target_, path_;
    bool is_kept_ = false;
};

/* The file as OpenImageIO makes it, in memory: its PNG writer does not notice a full disk. */
std::vector<unsigned char> encode_file(const fs::path &path, const OIIO::ImageSpec &spec, const void *pixels)
{
    std::vector<unsigned char> bytes;
    OIIO::Filesystem::IOVecOutput memory(bytes);
    const std::unique_ptr<OIIO::ImageOutput> output = OIIO::ImageOutput::create(path.string(), &memory);
    if (!output) throw io_error(OIIO::geterror());
    output->threads(1);
    if (!output->open(path.string(), spec)) throw io_error(output->geterror());
    if (!output->write_image(spec.format, pixels)) throw io_error(output->geterror());
    if (!output->close()) throw io_error(output->geterror());
    return bytes;
}

void write_pixels(const fs::path &path, const OIIO::ImageSpec &spec, const void *pixels)
{
    const std::vector<unsigned char> bytes = encode_file(path, spec, pixels);
    std::FILE *file = std::fopen(path.c_str(), "wb");
    if (!file) throw io_error(std::strerror(errno));
    errno = 0;
    const bool is_written = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
    const int write_error = errno;
    const bool is_closed = std::fclose(file) == 0;
    if (!is_written || !is_closed) throw io_error(std::strerror(is_written ? errno : write_error));
}

template <typename code> void write_png(const insitu_image &image, const fs::path &path, OIIO::TypeDesc type)
{
    const int channels = is_opaque(image) ? 3 : 4;
    OIIO::ImageSpec spec(image.width, image.height, channels, type);
    spec.attribute("oiio:ColorSpace", "sRGB");
    spec.attribute("oiio:UnassociatedAlpha", 1); /* the codes are straight already */
    write_pixels(path, spec, encode<code>(image, static_cast<std::size_t>(channels)).data());
}

void write_exr(const insitu_image &image, const fs::path &path)
{
    OIIO::ImageSpec spec(image.width, image.height, image.depth ? 5 : 4, OIIO::TypeDesc::FLOAT);
    spec.channelnames = {"R", "G", "B", "A"};
    if (image.depth) spec.channelnames.push_back("Z");
    spec.alpha_channel = 3;
    spec.z_channel = image.depth ? 4 : -1;
    spec.attribute("oiio:ColorSpace", "Linear");
    spec.attribute("compression", "zip");
    if (image.depth) {
        write_pixels(path, spec, with_depth(image).data());
    } else {
        write_pixels(path, spec, image.rgba);
    }
}

void write(const insitu_image &image, insitu_image_format format, const fs::path &target)
{
    OIIO::attribute("threads", 1);
    OIIO::attribute("exr_threads", -1); /* none but the caller's */
    if (target.has_parent_path()) {
        std::error_code code;
        fs::create_directories(target.parent_path(), code);
        if (code) throw io_error("its folder cannot be made: " + code.message());
    }
    temporary_file file(target, format == INSITU_EXR ? ".exr" : ".png");
    switch (format) {
    case INSITU_PNG8: write_png<std::uint8_t>(image, file.path(), OIIO::TypeDesc::UINT8); break;
    case INSITU_PNG16: write_png<std::uint16_t>(image, file.path(), OIIO::TypeDesc::UINT16); break;
    case INSITU_EXR: write_exr(image, file.path()); break;
    }
    file.keep();
}

insitu_status fail(insitu_status status, const char *path, const char *what, char *message, std::size_t size)
{
    if (message && size) std::snprintf(message, size, "%s: cannot be written: %s", path ? path : "(no path)", what);
    return status;
}

} // namespace

extern "C" insitu_status insitu_image_write(const insitu_image *image, insitu_image_format format, const char *path,
                                            char *message, size_t size)
{
    const bool is_known = format == INSITU_PNG8 || format == INSITU_PNG16 || format == INSITU_EXR;
    if (!image || !path || !*path || !image->rgba || image->width < 1 || image->height < 1 || !is_known) {
        return fail(INSITU_ERROR_ARGUMENT, path, "no image, no path, no pixels or an unknown format", message, size);
    }
    try {
        write(*image, format, path);
        return INSITU_OK;
    } catch (const std::bad_alloc &) {
        return fail(INSITU_ERROR_MEMORY, path, "no memory", message, size);
    } catch (const std::exception &e) {
        return fail(INSITU_ERROR_IO, path, e.what(), message, size);
    } catch (...) {
        return fail(INSITU_ERROR_IO, path, "unknown error", message, size);
    }
}
