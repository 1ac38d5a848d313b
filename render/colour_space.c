#include "colour_space.h"

#include <math.h>
#include <stddef.h>

double colour_linear_from_srgb_double(double srgb)
{
    return srgb <= 0.04045 ? srgb / 12.92 : pow((srgb + 0.055) / 1.055, 2.4);
}

static double mix(double a, double b, double share)
{
    return a + share * (b - a);
}

/* ---- CIELAB ---------------------------------------------------------------------------------------------------- */

/* Matrices from linear RGB, with sRGB's primaries and white point D65, to XYZ and back; and the XYZ of that white
 * point. */
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

static void lab_from_srgb(const double srgb[3], double lab[3])
{
    double f[3];
    for (int row = 0; row < 3; row++) {
        double sum = 0;
        for (int c = 0; c < 3; c++) sum += xyz_from_rgb[row][c] * colour_linear_from_srgb_double(srgb[c]);
        f[row] = lab_curve(sum / white_xyz[row]);
    }
    lab[0] = 116 * f[1] - 16;
    lab[1] = 500 * (f[0] - f[1]);
    lab[2] = 200 * (f[1] - f[2]);
}

static void linear_from_lab(const double lab[3], float rgb[3])
{
    const double fy = (lab[0] + 16) / 116;
    const double f[3] = {fy + lab[1] / 500, fy, fy - lab[2] / 200};
    double xyz[3];
    for (int i = 0; i < 3; i++) xyz[i] = white_xyz[i] * lab_curve_inverse(f[i]);
    for (int i = 0; i < 3; i++) {
        const double l = rgb_from_xyz[i][0] * xyz[0] + rgb_from_xyz[i][1] * xyz[1] + rgb_from_xyz[i][2] * xyz[2];
        rgb[i] = (float)fmin(1, fmax(0, l));
    }
}

static void interpolate_lab(const double a[3], const double b[3], double share, float linear[3])
{
    double from[3], to[3];
    lab_from_srgb(a, from);
    lab_from_srgb(b, to);
    for (int c = 0; c < 3; c++) from[c] = mix(from[c], to[c], share);
    linear_from_lab(from, linear);
}

/* ---- Moreland's diverging interpolation ------------------------------------------------------------------------ */

/* A colour in Msh, the polar form of CIELAB. m: distance from black; s: angle from the axis of greys; h: angle of the
 * hue; angles in radians. */
typedef struct msh {
    double m, s, h;
} msh;

static const double pi = 3.14159265358979323846, grey_angle = 0.05;

static msh msh_from_srgb(const double srgb[3])
{
    double lab[3];
    lab_from_srgb(srgb, lab);
    const double m = sqrt(lab[0] * lab[0] + lab[1] * lab[1] + lab[2] * lab[2]);
    if (!(m > 0)) return (msh){0, 0, 0};
    return (msh){m, acos(lab[0] / m), atan2(lab[2], lab[1])};
}

static void linear_from_msh(msh colour, float linear[3])
{
    const double lab[3] = {colour.m * cos(colour.s), colour.m * sin(colour.s) * cos(colour.h),
                           colour.m * sin(colour.s) * sin(colour.h)};
    linear_from_lab(lab, linear);
}

/* Returns the hue that a neutral colour at distance m from black gets at the end of a path from a saturated colour. A
 * neutral colour has no hue of its own; this one avoids a visible change of hue along the path (Moreland 2009). */
static double neutral_hue(msh end, double m)
{
    if (end.m >= m - 0.1) return end.h;
    const double spin = end.s * sqrt(m * m - end.m * end.m) / (end.m * sin(end.s));
    return end.h > -pi / 3 ? end.h + spin : end.h - spin;
}

static msh mix_msh(msh a, msh b, double share)
{
    return (msh){mix(a.m, b.m, share), mix(a.s, b.s, share), mix(a.h, b.h, share)};
}

static void interpolate_msh(const double a[3], const double b[3], double share, float linear[3])
{
    msh ends[2] = {msh_from_srgb(a), msh_from_srgb(b)};
    const bool is_grey[2] = {ends[0].s < grey_angle, ends[1].s < grey_angle};
    const double turn = fabs(ends[0].h - ends[1].h), angle = turn > pi ? 2 * pi - turn : turn;
    if (!is_grey[0] && !is_grey[1] && angle > pi / 3) {
        const double middle = fmax(88, fmax(ends[0].m, ends[1].m));
        const msh end = ends[share > 0.5], neutral = {middle, 0, neutral_hue(end, middle)};
        linear_from_msh(mix_msh(neutral, end, fabs(2 * share - 1)), linear);
        return;
    }
    for (int i = 0; i < 2; i++)
        if (is_grey[i] && !is_grey[!i]) ends[i].h = neutral_hue(ends[!i], ends[i].m);
    linear_from_msh(mix_msh(ends[0], ends[1], share), linear);
}

/* ---- hue, saturation, value ------------------------------------------------------------------------------------ */

static void hsv_from_srgb(const double srgb[3], double hsv[3])
{
    const double most = fmax(srgb[0], fmax(srgb[1], srgb[2])), spread = most - fmin(srgb[0], fmin(srgb[1], srgb[2]));
    hsv[0] = 0;
    hsv[1] = most > 0 ? spread / most : 0;
    hsv[2] = most;
    if (!(spread > 0)) return;
    const double turn = srgb[0] == most   ? (srgb[1] - srgb[2]) / spread
                        : srgb[1] == most ? 2 + (srgb[2] - srgb[0]) / spread
                                          : 4 + (srgb[0] - srgb[1]) / spread;
    hsv[0] = turn < 0 ? turn + 6 : turn;
}

static void interpolate_hsv(const double a[3], const double b[3], double share, float linear[3])
{
    double from[3], to[3];
    hsv_from_srgb(a, from);
    hsv_from_srgb(b, to);
    for (int c = 0; c < 3; c++) from[c] = mix(from[c], to[c], share);
    for (int c = 0; c < 3; c++) {
        const double turn = fmod(from[0] + (c == 0 ? 5 : c == 1 ? 3 : 1), 6);
        const double off = fmax(0, fmin(1, fmin(turn, 4 - turn)));
        linear[c] = (float)colour_linear_from_srgb_double(from[2] * (1 - from[1] * off));
    }
}

/* ---- colours and tables ---------------------------------------------------------------------------------------- */

static void interpolate_srgb(const double a[3], const double b[3], double share, float linear[3])
{
    for (int c = 0; c < 3; c++) linear[c] = (float)colour_linear_from_srgb_double(mix(a[c], b[c], share));
}

void colour_between(colour_space space, const double a[3], const double b[3], double share, float linear[3])
{
    switch (space) {
    case COLOUR_RGB: interpolate_srgb(a, b, share, linear); break;
    case COLOUR_HSV: interpolate_hsv(a, b, share, linear); break;
    case COLOUR_LAB: interpolate_lab(a, b, share, linear); break;
    case COLOUR_STEP: interpolate_srgb(a, b, share > 0, linear); break;
    case COLOUR_DIVERGING: interpolate_msh(a, b, share, linear); break;
    }
}

int colour_choose_table_size(const colour_point *points, int count)
{
    enum { EVEN = 256, UNEVEN = 1025 };
    const double low = points[0].at, width = points[count - 1].at - low;
    for (int i = 1; i < count; i++)
        if (!(fabs(points[i].at - low - width * i / (count - 1)) <= 1e-5 * width / count)) return UNEVEN;
    return (EVEN - 1 + count - 2) / (count - 1) * (count - 1) + 1;
}

void colour_fill_table(const colour_point *points, int count, colour_space space, float *table, int entries)
{
    const double low = points[0].at, width = points[count - 1].at - low;
    int i = 0;
    for (int entry = 0; entry < entries; entry++) {
        const double x = low + width * entry / (entries - 1);
        while (i < count - 2 && x >= points[i + 1].at) i++;
        const double step = points[i + 1].at - points[i].at, share = step > 0 ? (x - points[i].at) / step : 1;
        colour_between(space, points[i].srgb, points[i + 1].srgb, fmin(fmax(share, 0), 1), table + 3 * (size_t)entry);
    }
}
