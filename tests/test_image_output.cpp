/* Tests the image library, which is loaded by the dynamic loader as libinsitu loads it. Reads files by OpenImageIO and
 * compares them with the pixels. If the format uses the sRGB curve, the expected value is computed by the curve in
 * double. */
#include <OpenImageIO/deepdata.h>
#include <OpenImageIO/imagebuf.h>
#include <OpenImageIO/imagebufalgo.h>
#include <OpenImageIO/imageio.h>

#include <cmath>
#include <csetjmp>
#include <csignal>
#include <cstdarg>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <string>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>
#include <vector>

/* Included last, because cmocka defines macros with short names such as fail(). */
extern "C" {
#include <cmocka.h>

#include "session_image.h"
}

namespace fs = std::filesystem;

namespace
{

fs::path folder; /* folder of this run; empty at the start */

struct picture {
    int width, height;
    std::vector<float> rgba, depth;
    insitu_image make_view(bool with_depth) const
    {
        return {width, height, rgba.data(), with_depth ? depth.data() : nullptr, nullptr, 0, nullptr, nullptr};
    }
};

std::uint32_t hash_number(std::uint32_t x)
{
    x = (x ^ (x >> 16)) * 0x7feb352dU;
    x = (x ^ (x >> 15)) * 0x846ca68bU;
    return x ^ (x >> 16);
}

float make_number(std::size_t i)
{
    return static_cast<float>(hash_number(static_cast<std::uint32_t>(i)) >> 8) / 16777216.0F;
}

/* Makes premultiplied colours, with any alpha or opaque. Some are slightly outside [0, 1], as highlights are. */
picture make_picture(int width, int height, bool opaque)
{
    const std::size_t count = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    picture p{width, height, std::vector<float>(4 * count), std::vector<float>(count)};
    for (std::size_t i = 0; i < count; i++) {
        const float alpha = opaque ? 1 : i % 7 == 0 ? 0 : i % 7 == 1 ? 1 : make_number(5 * i);
        for (std::size_t c = 0; c < 3; c++) p.rgba[4 * i + c] = alpha * (1.1F * make_number(5 * i + 1 + c) - 0.05F);
        p.rgba[4 * i + 3] = alpha;
        p.depth[i] = i % 3 == 0 ? std::numeric_limits<float>::infinity() : 1e3F * make_number(5 * i + 4);
    }
    return p;
}

insitu_status write_image(const insitu_image &image, insitu_image_format format, const fs::path &path,
                          base_error &error)
{
    error = base_error{};
    return session_write_image(&image, format, path.c_str(), &error);
}

void write_valid_image(const insitu_image &image, insitu_image_format format, const fs::path &path)
{
    base_error error;
    if (write_image(image, format, path, error) != INSITU_OK) fail_msg("%s", error.message);
}

template <typename number_type>
std::vector<number_type> read_back(const fs::path &path, OIIO::TypeDesc type, OIIO::ImageSpec &spec)
{
    OIIO::ImageSpec straight;
    straight.attribute("oiio:UnassociatedAlpha", 1);
    const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path.string(), &straight);
    if (!input) fail_msg("%s", OIIO::geterror().c_str());
    spec = input->spec();
    assert_true(spec.format == type);
    std::vector<number_type> values(static_cast<std::size_t>(spec.image_pixels()) *
                                    static_cast<std::size_t>(spec.nchannels));
    assert_true(input->read_image(0, 0, 0, spec.nchannels, type, values.data()));
    input->close();
    return values;
}

double compute_exact_code(double linear, double largest)
{
    const double l = std::fmin(1, std::fmax(0, linear));
    return largest * (l <= 0.0031308 ? 12.92 * l : 1.055 * std::pow(l, 1 / 2.4) - 0.055);
}

template <typename code>
void check_png(const picture &p, insitu_image_format format, OIIO::TypeDesc type, std::size_t channels)
{
    const fs::path path = folder / "png" / "round_trip.png";
    write_valid_image(p.make_view(true), format, path);
    OIIO::ImageSpec spec;
    const std::vector<code> codes = read_back<code>(path, type, spec);
    assert_int_equal(spec.width, p.width);
    assert_int_equal(spec.height, p.height);
    assert_int_equal(spec.nchannels, channels);
    const double largest = std::numeric_limits<code>::max();
    const double half =
        /* rounding to the nearest code; the double arithmetic of the library and of the test is far more accurate */
        0.5 + 1e-9 * largest;
    for (std::size_t i = 0; i < p.depth.size(); i++) {
        const double alpha = p.rgba[4 * i + 3];
        for (std::size_t c = 0; c < 3; c++) {
            const double straight = alpha > 0 ? p.rgba[4 * i + c] / alpha : 0;
            assert_true(std::fabs(codes[channels * i + c] - compute_exact_code(straight, largest)) <= half);
        }
        if (channels == 4) assert_true(std::fabs(codes[4 * i + 3] - alpha * largest) <= half);
    }
}

const int sizes[][2] = {{1, 1}, {1, 7}, {13, 1}, {17, 11}, {64, 33}};

void png8_is_within_half_a_code(void **)
{
    for (const auto &size : sizes) {
        check_png<std::uint8_t>(make_picture(size[0], size[1], true), INSITU_PNG8, OIIO::TypeDesc::UINT8, 3);
        check_png<std::uint8_t>(make_picture(size[0], size[1], false), INSITU_PNG8, OIIO::TypeDesc::UINT8, 4);
    }
}

/* Checks the floats at which the code changes and their neighbours on both sides, and a ramp from 0 to 1. */
void png8_is_exact_where_codes_change(void **)
{
    std::vector<float> values;
    for (int code = 0; code < 255; code++) {
        const double coded = (code + 0.5) / 255;
        const double linear = coded <= 0.04045 ? coded / 12.92 : std::pow((coded + 0.055) / 1.055, 2.4);
        float value = std::nextafter(std::nextafter(static_cast<float>(linear), 0.F), 0.F);
        for (int i = 0; i < 5; i++, value = std::nextafter(value, 1.F)) values.push_back(value);
    }
    for (int i = 0; i <= 20000; i++) values.push_back(static_cast<float>(i) / 20000.F);
    while (values.size() % 3 != 0) values.push_back(1);
    picture p{static_cast<int>(values.size() / 3), 1, {}, std::vector<float>(values.size() / 3)};
    for (std::size_t i = 0; i < values.size(); i++) {
        p.rgba.push_back(values[i]);
        if (i % 3 == 2) p.rgba.push_back(1);
    }
    check_png<std::uint8_t>(p, INSITU_PNG8, OIIO::TypeDesc::UINT8, 3);
}

void png16_is_within_half_a_code(void **)
{
    for (const auto &size : sizes) {
        check_png<std::uint16_t>(make_picture(size[0], size[1], true), INSITU_PNG16, OIIO::TypeDesc::UINT16, 3);
        check_png<std::uint16_t>(make_picture(size[0], size[1], false), INSITU_PNG16, OIIO::TypeDesc::UINT16, 4);
    }
}

void nan_pixels_are_black_in_png(void **)
{
    const float nan = std::numeric_limits<float>::quiet_NaN(), infinity = std::numeric_limits<float>::infinity();
    const picture p{2, 1, {nan, infinity, -infinity, 1, nan, nan, nan, nan}, {0, 0}};
    write_valid_image(p.make_view(false), INSITU_PNG8, folder / "nan.png");
    OIIO::ImageSpec spec;
    const auto codes = read_back<std::uint8_t>(folder / "nan.png", OIIO::TypeDesc::UINT8, spec);
    assert_int_equal(codes.size(), 8);
    const std::uint8_t expected[8] = {0, 255, 0, 255, 0, 0, 0, 0};
    assert_memory_equal(codes.data(), expected, 8);
}

void exr_has_channels_of_other_numbers(void **)
{
    const picture p = make_picture(17, 11, false);
    const fs::path path = folder / "exr" / "channels.exr";
    const insitu_channel channels[] = {{"N.X", p.rgba.data() + 1, 4}, {"value", p.depth.data(), 1}};
    insitu_image image = p.make_view(true);
    image.channel_count = 2;
    image.channels = channels;
    write_valid_image(image, INSITU_EXR, path);
    OIIO::ImageSpec spec;
    const std::vector<float> values = read_back<float>(path, OIIO::TypeDesc::FLOAT, spec);
    assert_int_equal(spec.nchannels, 7);
    const auto place_of = [&spec](const char *name) {
        const int place = spec.channelindex(name);
        assert_true(place >= 0);
        return static_cast<std::size_t>(place);
    };
    const std::size_t x = place_of("N.X"), value = place_of("value"), z = place_of("Z"), green = place_of("G");
    for (std::size_t i = 0; i < p.depth.size(); i++) {
        const float *pixel = &values[7 * i];
        assert_true(pixel[x] == p.rgba[4 * i + 1] && pixel[green] == p.rgba[4 * i + 1]);
        assert_true(pixel[value] == p.depth[i] && pixel[z] == p.depth[i]);
    }
    write_valid_image(image, INSITU_PNG8, folder / "png" / "channels.png"); /* PNG ignores the additional channels */
}

void exr_is_bitwise(void **)
{
    for (const auto &size : sizes) {
        for (const std::size_t channels : {std::size_t{4}, std::size_t{5}}) {
            const picture p = make_picture(size[0], size[1], false);
            const fs::path path = folder / "deep" / "er" / "round_trip.exr";
            write_valid_image(p.make_view(channels == 5), INSITU_EXR, path);
            OIIO::ImageSpec spec;
            const std::vector<float> values = read_back<float>(path, OIIO::TypeDesc::FLOAT, spec);
            assert_int_equal(spec.nchannels, channels);
            const std::vector<std::string> names = {"R", "G", "B", "A", "Z"};
            for (std::size_t c = 0; c < channels; c++)
                assert_string_equal(spec.channelnames[c].c_str(), names[c].c_str());
            for (std::size_t i = 0; i < p.depth.size(); i++) {
                assert_memory_equal(&values[channels * i], &p.rgba[4 * i], 4 * sizeof(float));
                if (channels == 5) assert_memory_equal(&values[5 * i + 4], &p.depth[i], sizeof(float));
            }
        }
    }
}

/* A picture with any number of samples in each pixel, and none in the first. */
struct deep_picture {
    int width, height;
    std::vector<insitu_deep_sample> samples;
    std::vector<std::int64_t> first;
    std::vector<std::uint32_t> counts;
};

deep_picture make_deep_picture(int width, int height)
{
    deep_picture p{width, height, {}, {}, {}};
    for (std::size_t i = 0; i < static_cast<std::size_t>(width) * static_cast<std::size_t>(height); i++) {
        const auto count = static_cast<std::uint32_t>(i % 5 == 0 ? 0 : hash_number(static_cast<std::uint32_t>(i)) % 12);
        p.first.push_back(static_cast<std::int64_t>(p.samples.size()));
        p.counts.push_back(count);
        for (std::size_t n = 0; n < count; n++) {
            insitu_deep_sample sample = {};
            sample.rgba[3] = make_number(7 * i + n);
            for (std::size_t c = 0; c < 3; c++) sample.rgba[c] = sample.rgba[3] * make_number(11 * i + 3 * n + c);
            sample.z = static_cast<float>(n) + 1;
            sample.z_back = n % 2 ? sample.z : sample.z + 0.75F;
            p.samples.push_back(sample);
        }
        p.samples.push_back({}); /* gaps between the samples of different pixels are allowed */
    }
    return p;
}

insitu_status write_deep(const deep_picture &p, const fs::path &path, base_error &error)
{
    const insitu_deep deep = {p.samples.data(), p.first.data(), p.counts.data()};
    insitu_image image = {};
    image.width = p.width;
    image.height = p.height;
    image.deep = &deep;
    return write_image(image, INSITU_DEEP_EXR, path, error);
}

void check_deep_pixel(const deep_picture &p, const OIIO::DeepData &data, std::size_t i)
{
    assert_int_equal(data.samples(static_cast<std::int64_t>(i)), p.counts[i]);
    for (std::uint32_t n = 0; n < p.counts[i]; n++) {
        const insitu_deep_sample &sample = p.samples[static_cast<std::size_t>(p.first[i]) + n];
        const float expected[6] = {sample.rgba[0], sample.rgba[1], sample.rgba[2],
                                   sample.rgba[3], sample.z,       sample.z_back};
        for (int c = 0; c < 6; c++) {
            static const char *const names[6] = {"R", "G", "B", "A", "Z", "ZBack"};
            int channel = 0;
            while (channel < 6 && data.channelname(channel) != names[c]) channel++;
            assert_true(channel < 6);
            assert_true(data.deep_value(static_cast<std::int64_t>(i), channel, static_cast<int>(n)) == expected[c]);
        }
    }
}

void deep_exr_is_bitwise(void **)
{
    for (const auto &size : sizes) {
        const deep_picture p = make_deep_picture(size[0], size[1]);
        const fs::path path = folder / "deep" / "samples.exr";
        base_error error;
        if (write_deep(p, path, error) != INSITU_OK) fail_msg("%s", error.message);
        const std::unique_ptr<OIIO::ImageInput> input = OIIO::ImageInput::open(path.string());
        if (!input) fail_msg("%s", OIIO::geterror().c_str());
        const OIIO::ImageSpec &spec = input->spec();
        assert_true(spec.deep && spec.width == p.width && spec.height == p.height && spec.nchannels == 6);
        assert_true(spec.format == OIIO::TypeDesc::FLOAT);
        OIIO::DeepData data;
        assert_true(input->read_native_deep_image(0, 0, data));
        for (std::size_t i = 0; i < p.counts.size(); i++) check_deep_pixel(p, data, i);
    }
}

/* Compares a flattened pixel with compositing front to back in double: the sum of each sample's colour times the
 * transmittance of the samples in front of it. */
void check_flat_pixel(const deep_picture &p, std::size_t i, const float *flat)
{
    double expected[4] = {0, 0, 0, 0};
    for (std::uint32_t n = 0; n < p.counts[i]; n++) {
        const insitu_deep_sample &sample = p.samples[static_cast<std::size_t>(p.first[i]) + n];
        const double through = 1 - expected[3];
        for (std::size_t c = 0; c < 4; c++) expected[c] += through * static_cast<double>(sample.rgba[c]);
    }
    /* Each sample is rounded three times, with numbers of at most 1, and its transmittance one time. */
    const double bound = 4 * std::ldexp(1.0, -24) * p.counts[i];
    for (std::size_t c = 0; c < 4; c++) assert_true(std::fabs(static_cast<double>(flat[c]) - expected[c]) <= bound);
}

/* Checks that the function by which oiiotool --flatten works flattens the deep file to the expected picture. */
void deep_exr_is_flattened_by_openimageio(void **)
{
    const deep_picture p = make_deep_picture(64, 33);
    base_error error;
    if (write_deep(p, folder / "flatten.exr", error) != INSITU_OK) fail_msg("%s", error.message);
    const OIIO::ImageBuf flat = OIIO::ImageBufAlgo::flatten(OIIO::ImageBuf((folder / "flatten.exr").string()));
    if (flat.has_error()) fail_msg("%s", flat.geterror().c_str());
    for (std::size_t i = 0; i < p.counts.size(); i++) {
        float pixel[6];
        flat.getpixel(static_cast<int>(i % 64), static_cast<int>(i / 64), pixel);
        check_flat_pixel(p, i, pixel);
    }
}

std::size_t count_files(const fs::path &in)
{
    std::size_t count = 0;
    for ([[maybe_unused]] const auto &entry : fs::recursive_directory_iterator(in)) count++;
    return count;
}

void writing_does_not_change_the_picture(void **)
{
    const fs::path in = folder / "alone";
    const picture first = make_picture(20, 10, true), second = make_picture(5, 4, true);
    write_valid_image(first.make_view(false), INSITU_PNG8, in / "a.png");
    write_valid_image(second.make_view(false), INSITU_PNG8, in / "a.png");
    assert_int_equal(count_files(in), 1);
    OIIO::ImageSpec spec;
    read_back<std::uint8_t>(in / "a.png", OIIO::TypeDesc::UINT8, spec);
    assert_int_equal(spec.width, 5);
}

/* Checks paths that cannot be written. No case depends on permissions, because root may write anywhere. */
void unwritable_paths_are_reported(void **)
{
    const fs::path in = folder / "unwritable";
    fs::create_directories(in / "taken.png" / "below");
    const picture p = make_picture(3, 2, true);
    write_valid_image(p.make_view(false), INSITU_PNG8, in / "file.png");
    const std::size_t before = count_files(in);
    const struct {
        fs::path path;
        const char *why;
    } cases[] = {{in / "file.png" / "a.png", "Not a directory"},
                 {in / "file.png" / "b" / "a.png", "Not a directory"},
                 {"/proc/a.png", ""},
                 {"/proc/b/a.png", ""},
                 {in / "taken.png", "irectory"},
                 {in / (std::string(300, 'a') + ".png"), "name too long"}};
    for (const auto &c : cases) {
        for (const auto format : {INSITU_PNG8, INSITU_PNG16, INSITU_EXR}) {
            base_error error;
            assert_int_equal(write_image(p.make_view(true), format, c.path, error), INSITU_ERROR_IO);
            const std::string start = c.path.string() + ": cannot be written: ";
            if (std::strncmp(error.message, start.c_str(), start.size()) != 0 || !std::strstr(error.message, c.why)) {
                fail_msg("%s", error.message);
            }
        }
    }
    assert_int_equal(count_files(in), before);
}

/* Checks a full disk. It is simulated by a limit of 4 KiB for files of this process. */
void full_disk_is_reported_and_leaves_the_old_picture(void **)
{
    const fs::path in = folder / "full";
    const picture small = make_picture(2, 2, true), large = make_picture(200, 200, false);
    for (const auto format : {INSITU_PNG8, INSITU_PNG16, INSITU_EXR}) {
        const fs::path path = in / "a";
        write_valid_image(small.make_view(true), format, path);
        const std::uintmax_t size = fs::file_size(path);
        rlimit before;
        getrlimit(RLIMIT_FSIZE, &before);
        const rlimit small_limit = {4096, before.rlim_max};
        const auto handler = std::signal(SIGXFSZ, SIG_IGN);
        setrlimit(RLIMIT_FSIZE, &small_limit);
        base_error error;
        const insitu_status status = write_image(large.make_view(true), format, path, error);
        setrlimit(RLIMIT_FSIZE, &before);
        std::signal(SIGXFSZ, handler);
        assert_int_equal(status, INSITU_ERROR_IO);
        assert_non_null(std::strstr(error.message, "File too large"));
        assert_true(fs::file_size(path) == size);
        assert_int_equal(count_files(in), 1);
    }
}

/* Counts the files in a folder except the picture. */
std::size_t count_others(const fs::path &in, const std::string &name)
{
    std::size_t count = 0;
    for (const auto &entry : fs::directory_iterator(in)) count += entry.path().filename() != name;
    return count;
}

/* Checks the longest legal file name. The temporary file must not be named by the picture's name plus a suffix, which
 * would be too long; an earlier version did so. */
void longest_legal_name_is_written(void **)
{
    const fs::path in = folder / "long";
    const picture p = make_picture(3, 2, true);
    for (const std::size_t length : {std::size_t{244}, std::size_t{255}}) {
        const fs::path path = in / (std::string(length - 4, 'a') + ".png");
        write_valid_image(p.make_view(false), INSITU_PNG8, path);
        assert_true(fs::is_regular_file(path));
    }
    assert_int_equal(count_files(in), 2);
}

/* Checks an attack: someone with write access to the folder plants a link that has the name which temporary files had
 * in earlier versions. */
void writing_does_not_follow_planted_links(void **)
{
    const fs::path in = folder / "planted", victim = folder / "victim";
    fs::create_directories(in);
    std::ofstream(victim) << "precious";
    fs::create_symlink(fs::absolute(victim), in / (".a.png." + std::to_string(getpid()) + ".part.png"));
    write_valid_image(make_picture(3, 2, true).make_view(false), INSITU_PNG8, in / "a.png");
    std::string found;
    std::ifstream(victim) >> found;
    assert_string_equal(found.c_str(), "precious");
    assert_true(fs::is_regular_file(fs::symlink_status(in / "a.png")));
    assert_int_equal(count_others(in, "a.png"), 1);
}

/* Checks that only the temporary file left by a killed run is removed. The folder also contains files with temporary
 * names (one that is still being written, a link and a pipe) and files with other names; all of these must stay. */
void files_of_killed_runs_are_removed(void **)
{
    const fs::path in = folder / "left";
    const std::string left = ".insitu-0123456789abcdef.part", held = ".insitu-fedcba9876543210.part";
    const std::string link = ".insitu-00000000000000ff.part", pipe = ".insitu-00000000000000fe.part";
    const std::string others[] = {".insitu-0123456789abcdef.part2", ".insitu-0123456789ABCDEF.part", "a.part"};
    fs::create_directories(in);
    for (const std::string &name : {left, held, others[0], others[1], others[2]}) std::ofstream(in / name) << "half";
    fs::create_symlink(fs::absolute(in / others[2]), in / link);
    assert_int_equal(mkfifo((in / pipe).c_str(), 0600), 0);
    const int writer = open((in / held).c_str(), O_RDWR);
    assert_int_equal(flock(writer, LOCK_EX), 0);
    write_valid_image(make_picture(3, 2, true).make_view(false), INSITU_PNG8, in / "a.png");
    assert_false(fs::exists(in / left));
    for (const std::string &name : {held, others[0], others[1], others[2]}) assert_true(fs::exists(in / name));
    assert_true(fs::is_symlink(fs::symlink_status(in / link)) && fs::is_fifo(in / pipe));
    close(writer);
}

void pipe_at_the_picture_path_is_reported(void **)
{
    const fs::path in = folder / "pipe";
    fs::create_directories(in);
    assert_int_equal(mkfifo((in / "a.png").c_str(), 0600), 0);
    base_error error;
    assert_int_equal(write_image(make_picture(3, 2, true).make_view(false), INSITU_PNG8, in / "a.png", error),
                     INSITU_ERROR_IO);
    assert_non_null(std::strstr(error.message, "a.png: cannot be written: there is a named pipe"));
    assert_true(fs::is_fifo(in / "a.png"));
    assert_int_equal(count_files(in), 1);
}

/* Checks a picture that is written into a region of a larger picture: it is blended over its background, as in its own
 * file, and pixels around it do not change. It is refused if it extends beyond the columns of the larger picture. */
void images_are_written_into_regions_of_a_picture(void **)
{
    const int width = 7, height = 5, larger = 20, rows = 9, left = 4, top = 3;
    const std::vector<float> own(static_cast<std::size_t>(4 * width * height), 0.25F);
    insitu_decorations d{};
    d.background[0] = d.background[1] = d.background[2] = 0.5F;
    d.background[3] = 1;
    d.size = 0.05;
    const insitu_image image{width, height, own.data(), nullptr, &d, 0, nullptr, nullptr};
    std::vector<float> all(static_cast<std::size_t>(4 * larger * rows), 0.125F);
    const insitu_place place{all.data(), larger, left, top};
    base_error error{};
    assert_int_equal(session_place_image(&image, &place, &error), INSITU_OK);
    for (int y = 0; y < rows; y++)
        for (int x = 0; x < larger; x++)
            for (int c = 0; c < 4; c++) {
                const bool is_in = x >= left && x < left + width && y >= top && y < top + height;
                const float is = all[static_cast<std::size_t>(4 * (y * larger + x) + c)];
                assert_true(std::fabs(is - (!is_in ? 0.125F : c == 3 ? 1 : 0.25F + 0.75F * 0.5F)) < 1e-6F);
            }
    const insitu_place beside{all.data(), larger, larger - width + 1, 0};
    assert_int_equal(session_place_image(&image, &beside, &error), INSITU_ERROR_ARGUMENT);
    assert_string_equal(error.message, "no image, or no place for it");
}

void invalid_arguments_are_rejected(void **)
{
    const picture p = make_picture(3, 2, true);
    insitu_image no_pixels = p.make_view(false), no_width = p.make_view(false);
    no_pixels.rgba = nullptr;
    no_width.width = 0;
    base_error error;
    assert_int_equal(write_image(no_pixels, INSITU_PNG8, folder / "n.png", error), INSITU_ERROR_ARGUMENT);
    assert_int_equal(write_image(no_width, INSITU_PNG8, folder / "n.png", error), INSITU_ERROR_ARGUMENT);
    insitu_image_format unknown = INSITU_PNG8;
    const int number_of_none = 7;
    static_assert(sizeof unknown == sizeof number_of_none, "an enum is an int");
    std::memcpy(&unknown, &number_of_none, sizeof unknown); /* an invalid number, which C callers may pass by mistake */
    assert_int_equal(write_image(p.make_view(false), unknown, folder / "n.png", error), INSITU_ERROR_ARGUMENT);
    assert_int_equal(write_image(p.make_view(false), INSITU_PNG8, "", error), INSITU_ERROR_ARGUMENT);
    assert_int_equal(write_image(p.make_view(false), INSITU_DEEP_EXR, folder / "n.exr", error), INSITU_ERROR_ARGUMENT);
    assert_false(fs::exists(folder / "n.png"));
}

} // namespace

int main(int argument_count, char **arguments)
{
    folder = argument_count > 1 ? arguments[1] : "test_image_output_files";
    fs::remove_all(folder);
    const CMUnitTest tests[] = {
        cmocka_unit_test(png8_is_within_half_a_code),
        cmocka_unit_test(png8_is_exact_where_codes_change),
        cmocka_unit_test(png16_is_within_half_a_code),
        cmocka_unit_test(nan_pixels_are_black_in_png),
        cmocka_unit_test(exr_is_bitwise),
        cmocka_unit_test(exr_has_channels_of_other_numbers),
        cmocka_unit_test(deep_exr_is_bitwise),
        cmocka_unit_test(deep_exr_is_flattened_by_openimageio),
        cmocka_unit_test(writing_does_not_change_the_picture),
        cmocka_unit_test(unwritable_paths_are_reported),
        cmocka_unit_test(full_disk_is_reported_and_leaves_the_old_picture),
        cmocka_unit_test(longest_legal_name_is_written),
        cmocka_unit_test(writing_does_not_follow_planted_links),
        cmocka_unit_test(files_of_killed_runs_are_removed),
        cmocka_unit_test(pipe_at_the_picture_path_is_reported),
        cmocka_unit_test(images_are_written_into_regions_of_a_picture),
        cmocka_unit_test(invalid_arguments_are_rejected),
    };
    const int failures = cmocka_run_group_tests(tests, nullptr, nullptr);
    fs::remove_all(folder);
    return failures;
}
