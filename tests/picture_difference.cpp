/* picture_difference BEFORE AFTER: compares the pixels of two picture files bitwise, but not the files' compression and
 * time stamps. Prints the number of pixels that differ and their largest difference. Returns 1 if any pixel differs. */
#include <OpenImageIO/imageio.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

namespace
{

struct picture {
    OIIO::ImageSpec spec;
    std::vector<float> pixels;
};

bool read_picture(const std::string &path, picture &out)
{
    auto file = OIIO::ImageInput::open(path);
    if (!file) {
        std::fprintf(stderr, "%s: %s\n", path.c_str(), OIIO::geterror().c_str());
        return false;
    }
    out.spec = file->spec();
    out.pixels.resize(static_cast<size_t>(out.spec.image_pixels()) * static_cast<size_t>(out.spec.nchannels));
    return file->read_image(0, 0, 0, out.spec.nchannels, OIIO::TypeDesc::FLOAT, out.pixels.data());
}

} // namespace

int main(int argc, char **argv)
{
    picture before, after;
    if (argc != 3 || !read_picture(argv[1], before) || !read_picture(argv[2], after)) return 2;
    const OIIO::ImageSpec &a = before.spec, &b = after.spec;
    if (a.width != b.width || a.height != b.height || a.channelnames != b.channelnames) {
        std::printf("other sizes or channels\n");
        return 1;
    }
    const auto channels = static_cast<size_t>(a.nchannels);
    size_t different = 0;
    double most = 0;
    for (size_t i = 0; i < before.pixels.size(); i += channels) {
        if (!std::memcmp(&before.pixels[i], &after.pixels[i], channels * sizeof(float))) continue;
        different++;
        for (size_t c = i; c < i + channels; c++) {
            const double by = std::fabs(static_cast<double>(before.pixels[c]) - static_cast<double>(after.pixels[c]));
            /* the comparison is false for NaN, if a depth is infinite in one of the pictures */
            if (by > most) most = by;
        }
    }
    if (different) std::printf("%zu pixels, by %.3g at most\n", different, most);
    return different > 0;
}
