/* The tables are made from little on first use. viridis and inferno (van der Walt and Smith's) go through their key
 * colours by monotone cubics in sRGB, which keeps lightness rising between keys as it rises at them; cool_to_warm
 * is Moreland's formula in Msh, the polar form of CIELAB, whose middle stays neutral without a visible edge. */
#include "colour_map.h"

#include <math.h>
#include <pthread.h>
#include <string.h>

enum { table_size = 256, viridis_keys = 20, inferno_keys = 10, max_keys = 20 };

typedef float colour_table[table_size][3];

static colour_table viridis, inferno, cool_to_warm, grey;

static const unsigned viridis_colours[viridis_keys] = {
    0x440154, 0x481568, 0x482677, 0x453781, 0x3f4788, 0x39558c, 0x32648e, 0x2d718e, 0x287d8e, 0x238a8d,
    0x1f968b, 0x20a386, 0x29af7f, 0x3cbc75, 0x56c667, 0x74d055, 0x94d840, 0xb8de29, 0xdce318, 0xfde725};

static const unsigned inferno_colours[inferno_keys] = {0x000004, 0x1b0c42, 0x4b0c6b, 0x781c6d, 0xa52c60,
                                                       0xcf4446, 0xed6925, 0xfb9a06, 0xf7d03c, 0xfcffa4};

static double linear_from_srgb(double s)
{
    return s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
}

static double srgb_from_linear(double l)
{
    return l <= 0.0031308 ? 12.92 * l : 1.055 * pow(l, 1 / 2.4) - 0.055;
}

float colour_linear_from_srgb(float srgb)
{
    return (float)linear_from_srgb(srgb);
}

float colour_srgb_from_linear(float linear)
{
    return (float)srgb_from_linear(linear);
}

/* Fritsch and Carlson's slopes in Brodlie's form, unit spacing: zero at an extremum, else the harmonic mean. */
static void monotone_slopes(const double *y, int count, double *slopes)
{
    slopes[0] = y[1] - y[0];
    slopes[count - 1] = y[count - 1] - y[count - 2];
    for (int i = 1; i < count - 1; i++) {
        const double before = y[i] - y[i - 1], after = y[i + 1] - y[i];
        slopes[i] = before * after > 0 ? 2 * before * after / (before + after) : 0;
    }
}

static double hermite(const double *y, const double *slopes, int count, double x)
{
    const int i = x >= count - 1 ? count - 2 : (int)x;
    const double t = x - i, u = 1 - t;
    return u * u * ((1 + 2 * t) * y[i] + t * slopes[i]) + t * t * ((1 + 2 * u) * y[i + 1] - u * slopes[i + 1]);
}

static void fill_from_keys(colour_table table, const unsigned *colours, int count)
{
    for (int channel = 0; channel < 3; channel++) {
        double keys[max_keys], slopes[max_keys];
        for (int i = 0; i < count; i++) keys[i] = (colours[i] >> (16 - 8 * channel) & 255) / 255.0;
        monotone_slopes(keys, count, slopes);
        for (int i = 0; i < table_size; i++) {
            const double x = (double)i * (count - 1) / (table_size - 1);
            table[i][channel] = (float)linear_from_srgb(hermite(keys, slopes, count, x));
        }
    }
}

/* sRGB's primaries and white D65: linear RGB to XYZ over the white point, and its inverse. */
static const double xyz_from_rgb[3][3] = {
    {0.4124564, 0.3575761, 0.1804375}, {0.2126729, 0.7151522, 0.0721750}, {0.0193339, 0.1191920, 0.9503041}};
static const double rgb_from_xyz[3][3] = {
    {3.2404542, -1.5371385, -0.4985314}, {-0.9692660, 1.8760108, 0.0415560}, {0.0556434, -0.2040259, 1.0572252}};
static const double white_xyz[3] = {0.95047, 1.0, 1.08883};

static double lab_curve(double t)
{
    return t > 216.0 / 24389 ? cbrt(t) : (24389.0 / 27 * t + 16) / 116;
}

static double lab_curve_inverse(double f)
{
    return f > 6.0 / 29 ? f * f * f : (116 * f - 16) * 27 / 24389;
}

/* m: distance from black, s: angle from the grey axis, h: hue. */
typedef struct msh {
    double m, s, h;
} msh;

static msh msh_from_srgb(unsigned colour)
{
    double f[3];
    for (int row = 0; row < 3; row++) {
        double sum = 0;
        for (int c = 0; c < 3; c++)
            sum += xyz_from_rgb[row][c] * linear_from_srgb((colour >> (16 - 8 * c) & 255) / 255.0);
        f[row] = lab_curve(sum / white_xyz[row]);
    }
    const double lightness = 116 * f[1] - 16, a = 500 * (f[0] - f[1]), b = 200 * (f[1] - f[2]);
    const double m = sqrt(lightness * lightness + a * a + b * b);
    return (msh){m, acos(lightness / m), atan2(b, a)};
}

static void linear_from_msh(msh colour, float rgb[3])
{
    const double lightness = colour.m * cos(colour.s);
    const double a = colour.m * sin(colour.s) * cos(colour.h), b = colour.m * sin(colour.s) * sin(colour.h);
    const double fy = (lightness + 16) / 116;
    const double f[3] = {fy + a / 500, fy, fy - b / 200};
    double xyz[3];
    for (int i = 0; i < 3; i++) xyz[i] = white_xyz[i] * lab_curve_inverse(f[i]);
    for (int i = 0; i < 3; i++) {
        const double l = rgb_from_xyz[i][0] * xyz[0] + rgb_from_xyz[i][1] * xyz[1] + rgb_from_xyz[i][2] * xyz[2];
        rgb[i] = (float)fmin(1, fmax(0, l));
    }
}

/* The hue that the neutral middle takes on the side of a saturated end, so that the way there does not turn in hue. */
static double middle_hue(msh end, double middle_m)
{
    const double spin = end.s * sqrt(middle_m * middle_m - end.m * end.m) / (end.m * sin(end.s));
    return end.h > -acos(-1.0) / 3 ? end.h + spin : end.h - spin;
}

static void fill_diverging(colour_table table, unsigned low, unsigned high)
{
    const double middle_m = 88; /* above both ends' */
    const msh ends[2] = {msh_from_srgb(low), msh_from_srgb(high)};
    for (int i = 0; i < table_size; i++) {
        const double x = (double)i / (table_size - 1);
        const msh end = ends[x > 0.5];
        const double t = fabs(2 * x - 1); /* 1 at the end, 0 in the middle */
        const double hue = middle_hue(end, middle_m);
        linear_from_msh((msh){middle_m + t * (end.m - middle_m), t * end.s, hue + t * (end.h - hue)}, table[i]);
    }
}

static void fill_tables(void)
{
    fill_from_keys(viridis, viridis_colours, viridis_keys);
    fill_from_keys(inferno, inferno_colours, inferno_keys);
    fill_diverging(cool_to_warm, 0x3b4cc0, 0xb40426);
    for (int i = 0; i < table_size; i++) {
        for (int c = 0; c < 3; c++) grey[i][c] = (float)linear_from_srgb((double)i / (table_size - 1));
    }
}

const float *colour_map_table(const char *name, int *colour_count)
{
    static const struct {
        const char *name;
        const float *table;
    } maps[] = {{"viridis", viridis[0]}, {"inferno", inferno[0]}, {"cool_to_warm", cool_to_warm[0]}, {"grey", grey[0]}};
    static pthread_once_t once = PTHREAD_ONCE_INIT;

    pthread_once(&once, fill_tables);
    for (size_t i = 0; i < sizeof maps / sizeof *maps; i++) {
        if (strcmp(name, maps[i].name) == 0) {
            *colour_count = table_size;
            return maps[i].table;
        }
    }
    return NULL;
}
