/* Implements insitu_image_write() with OpenImageIO. Only this adaptor depends on image formats.
 *
 * libinsitu loads this library by dlopen() in the simulation's process. No exception leaves it, no threads are started,
 * and errors are returned as messages. */
#include "insitu/image_output.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <exception>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include "decorate.h"
#include "deep_exr.h"
#include "encoded_file.h"
#include "memory_reserve.h"
#include "picture_file.h"

namespace
{

std::size_t pixel_count(const insitu_image &image)
{
    return static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height);
}

double srgb_from_linear(double linear)
{
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

/* Returns the integer that best represents a value in [0, 1] if the largest integer of the type `code` represents 1.
 * NaN becomes 0. */
template <typename code> code quantize_to_code(double value)
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

/* Converts linear values from 0 to 1 to sRGB codes by table lookup instead of computing a power each time. A bin of the
 * table is narrower than the range of linear values of any code (1/4096 compared with 1 / (255 * 12.92) = 1/3295), so
 * that a bin contains at most two codes. */
class srgb_codes
{
  public:
    srgb_codes()
    {
        for (int code = 1; code < CODES; code++)
            begin_[static_cast<std::size_t>(code)] = find_smallest_value_of_code(code);
        begin_[CODES] = std::numeric_limits<double>::infinity();
        for (int bin = 0; bin <= BINS; bin++)
            first_[static_cast<std::size_t>(bin)] =
                quantize_to_code<std::uint8_t>(srgb_from_linear(static_cast<double>(bin) / BINS));
    }

    std::uint8_t operator()(double linear) const
    {
        if (!(linear > 0)) return 0;
        if (!(linear < 1)) return CODES - 1;
        const std::size_t code = first_[static_cast<std::size_t>(linear * BINS)];
        return static_cast<std::uint8_t>(code + (linear >= begin_[code + 1]));
    }

  private:
    static constexpr int CODES = 256, BINS = 4096;

    /* Returns the smallest linear value that becomes this sRGB code, found by bisection down to adjacent doubles. */
    static double find_smallest_value_of_code(int code)
    {
        double below = 0, least = 1;
        for (double middle = 0.5; below < middle && middle < least; middle = below + (least - below) / 2)
            (quantize_to_code<std::uint8_t>(srgb_from_linear(middle)) < code ? below : least) = middle;
        return least;
    }

    std::array<double, CODES + 1> begin_{}; /* smallest linear value of each sRGB code */
    std::array<std::uint8_t, BINS + 1> first_{};
};

template <typename code> code quantize_to_srgb_code(double linear)
{
    return quantize_to_code<code>(srgb_from_linear(linear));
}

template <> std::uint8_t quantize_to_srgb_code(double linear)
{
    static const srgb_codes codes;
    return codes(linear);
}

template <typename code> void encode_pixel(const float *pixel, std::size_t channels, code *out)
{
    const double alpha = pixel[3];
    for (std::size_t c = 0; c < 3; c++) {
        const double straight = alpha > 0 ? (alpha < 1 ? pixel[c] / alpha : pixel[c]) : 0;
        out[c] = quantize_to_srgb_code<code>(straight);
    }
    if (channels == 4) out[3] = quantize_to_code<code>(alpha);
}

/* Converts all pixels to sRGB codes that are not premultiplied, with alpha if channels is 4. A pixel that equals the
 * previous one, as is frequent in the background, gets a copy of that pixel's codes. */
template <typename code> std::vector<code> encode(const insitu_image &image, std::size_t channels)
{
    std::vector<code> codes(pixel_count(image) * channels);
    for (std::size_t i = 0; i < pixel_count(image); i++) {
        const float *pixel = image.rgba + 4 * i;
        code *out = &codes[channels * i];
        //  NOLINTNEXTLINE(bugprone-suspicious-memory-comparison): bitwise equality is intended
        if (i > 0 && std::memcmp(pixel, pixel - 4, 4 * sizeof *pixel) == 0)
            std::copy_n(out - channels, channels, out);
        else
            encode_pixel(pixel, channels, out);
    }
    return codes;
}

std::size_t exr_channels(const insitu_image &image)
{
    return 4 + (image.depth ? 1 : 0) + static_cast<std::size_t>(image.channel_count);
}

std::vector<float> interleave_channels(const insitu_image &image)
{
    const std::size_t count = exr_channels(image);
    std::vector<float> all(pixel_count(image) * count);
    for (std::size_t i = 0; i < pixel_count(image); i++) {
        float *pixel = std::copy_n(image.rgba + 4 * i, 4, &all[count * i]);
        if (image.depth) *pixel++ = image.depth[i];
        for (int c = 0; c < image.channel_count; c++)
            *pixel++ = image.channels[c].values[i * static_cast<std::size_t>(image.channels[c].stride)];
    }
    return all;
}

struct layout {
    int channels;
    OIIO::TypeDesc type;
    const char *file_name; /* a name whose extension selects OpenImageIO's format */
    OIIO::ImageSpec (*describe)(const insitu_image &, const layout &);
};

/* Optimizes PNG for speed, because the simulation may have to wait for the compression: the filter is the difference to
 * the pixel on the left (PNG_FILTER_SUB) and the compression level is the lowest. Compared with libpng's defaults this
 * takes a tenth to a quarter of the time, for files that are 28 to 48 % larger. */
OIIO::ImageSpec describe_png(const insitu_image &image, const layout &l)
{
    OIIO::ImageSpec spec(image.width, image.height, l.channels, l.type);
    spec.attribute("png:compressionLevel", 1);
    spec.attribute("png:filter", 0x10);
    spec.attribute("oiio:ColorSpace", "sRGB");
    spec.attribute("oiio:UnassociatedAlpha", 1); /* the pixel values are not premultiplied by alpha */
    return spec;
}

OIIO::ImageSpec describe_exr(const insitu_image &image, const layout &l)
{
    OIIO::ImageSpec spec(image.width, image.height, l.channels, l.type);
    spec.channelnames = {"R", "G", "B", "A"};
    if (image.depth) spec.channelnames.emplace_back("Z");
    for (int c = 0; c < image.channel_count; c++) spec.channelnames.emplace_back(image.channels[c].name);
    spec.alpha_channel = 3;
    spec.z_channel = image.depth ? 4 : -1;
    spec.attribute("oiio:ColorSpace", "Linear");
    spec.attribute("compression", "zip:1"); /* takes 0.64 of the time of zlib's default level, and 1.08 of the bytes */
    return spec;
}

/* Encodes the file in memory, because OpenImageIO's PNG writer does not report a full disk. */
void encode_file(const char *name, const OIIO::ImageSpec &spec, const void *pixels, std::vector<unsigned char> &bytes)
{
    encoded_file file(name, spec, bytes);
    if (!file.output().write_image(spec.format, pixels)) file.fail();
    file.finish();
}

/* The buffer of the encoded file is allocated before the reserve. The whole reserve (memory_reserve.h) is therefore
 * available to OpenImageIO and the libraries that it uses: for tables that they create with the first picture, for a
 * few rows, and for compressors. */
void write_pixels(const insitu_image &image, const layout &l, const void *pixels, const std::string &path)
{
    enum { ROWS = 128, TABLES = 16 << 20, ADDED = 1 << 20 };
    const std::size_t row =
        static_cast<std::size_t>(image.width) * static_cast<std::size_t>(l.channels) * l.type.size();
    const std::size_t raw = row * static_cast<std::size_t>(image.height);
    std::vector<unsigned char> bytes;
    /* the largest file is that of random data, which do not compress: it takes the raw size and the format's headers */
    bytes.reserve(raw + raw / 8 + ADDED);
    const memory_reserve reserve(TABLES + ROWS * row);
    encode_file(l.file_name, l.describe(image, l), pixels, bytes);
    if (l.describe == describe_exr) check_exr_rows(bytes.data(), bytes.size(), image.height, EXR_ZIP_ROWS);
    write_picture_file(path, bytes.data(), bytes.size());
}

template <typename code> void write_png(const insitu_image &image, OIIO::TypeDesc type, const std::string &path)
{
    const int channels = is_opaque(image) ? 3 : 4;
    const std::vector<code> codes = encode<code>(image, static_cast<std::size_t>(channels));
    write_pixels(image, {channels, type, "picture.png", describe_png}, codes.data(), path);
}

void write_exr(const insitu_image &image, const std::string &path)
{
    const std::size_t count = exr_channels(image);
    const layout l{static_cast<int>(count), OIIO::TypeDesc(OIIO::TypeDesc::FLOAT), "picture.exr", describe_exr};
    const std::vector<float> all = count > 4 ? interleave_channels(image) : std::vector<float>();
    write_pixels(image, l, count > 4 ? all.data() : image.rgba, path);
}

void write_undecorated(const insitu_image &image, insitu_image_format format, const std::string &path)
{
    switch (format) {
    case INSITU_PNG8: write_png<std::uint8_t>(image, OIIO::TypeDesc::UINT8, path); break;
    case INSITU_PNG16: write_png<std::uint16_t>(image, OIIO::TypeDesc::UINT16, path); break;
    case INSITU_EXR: write_exr(image, path); break;
    case INSITU_DEEP_EXR: write_deep_exr(image.width, image.height, *image.deep, path); break;
    }
}

void write(const insitu_image &image, insitu_image_format format, const std::string &path)
{
    insitu_image finished = image;
    std::vector<float> rgba;
    if (image.decorations && format != INSITU_DEEP_EXR) {
        rgba.assign(image.rgba, image.rgba + 4 * pixel_count(image));
        decorate(image, rgba);
        finished.rgba = rgba.data();
    }
    write_undecorated(finished, format, path);
}

void copy_into_montage(const insitu_image &image, const insitu_place &at)
{
    std::vector<float> rgba(image.rgba, image.rgba + 4 * pixel_count(image));
    const std::size_t row = 4 * static_cast<std::size_t>(image.width);
    if (image.decorations) decorate(image, rgba);
    for (int y = 0; y < image.height; y++) {
        const std::size_t to =
            static_cast<std::size_t>(at.y + y) * static_cast<std::size_t>(at.width) + static_cast<std::size_t>(at.x);
        std::copy_n(rgba.data() + static_cast<std::size_t>(y) * row, row, at.rgba + 4 * to);
    }
}

insitu_status fail(insitu_status status, const char *path, const char *what, char *message, std::size_t size)
{
    if (message && size) std::snprintf(message, size, "%s: cannot be written: %s", path ? path : "(no path)", what);
    return status;
}

} // namespace

extern "C" insitu_status insitu_image_check_words(const insitu_image *image, insitu_word_faults *out)
{
    if (!image || !out || !image->decorations || image->width < 1 || image->height < 1) return INSITU_ERROR_ARGUMENT;
    try {
        find_text_faults(*image, *out);
        return INSITU_OK;
    } catch (...) {
        *out = {};
        return INSITU_ERROR_MEMORY;
    }
}

extern "C" insitu_status insitu_image_place(const insitu_image *image, const insitu_place *at, char *message,
                                            size_t size)
{
    const bool is_in = image && image->rgba && at && at->rgba && image->width > 0 && image->height > 0 && at->x >= 0 &&
                       at->y >= 0 && at->width - at->x >= image->width;
    if (message && size) std::snprintf(message, size, "%s", is_in ? "" : "no image, or no place for it");
    if (!is_in) return INSITU_ERROR_ARGUMENT;
    try {
        copy_into_montage(*image, *at);
        return INSITU_OK;
    } catch (...) {
        if (message && size) std::snprintf(message, size, "no memory for a picture beside others");
        return INSITU_ERROR_MEMORY;
    }
}

extern "C" insitu_status insitu_image_write(const insitu_image *image, insitu_image_format format, const char *path,
                                            char *message, size_t size)
{
    const bool is_flat = format == INSITU_PNG8 || format == INSITU_PNG16 || format == INSITU_EXR;
    const bool has_pixels = image && (is_flat ? image->rgba != nullptr : format == INSITU_DEEP_EXR && image->deep);
    if (!path || !*path || !has_pixels || image->width < 1 || image->height < 1) {
        return fail(INSITU_ERROR_ARGUMENT, path, "no image, no path, no pixels or an unknown format", message, size);
    }
    try {
        write(*image, format, path);
        if (message && size) *message = '\0';
        return INSITU_OK;
    } catch (const std::bad_alloc &) {
        return fail(INSITU_ERROR_MEMORY, path, "no memory", message, size);
    } catch (const std::exception &e) {
        return fail(INSITU_ERROR_IO, path, e.what(), message, size);
    } catch (...) {
        return fail(INSITU_ERROR_IO, path, "unknown error", message, size);
    }
}
