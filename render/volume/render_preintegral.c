/* Integrates a transfer function over its values, for the table of kernel_preintegral.h: over each bin (a small range
 * of values) in double, piece by piece (kernel_types.h). */
#include <math.h>
#include <string.h>

#include "error.h"
#include "insitu/status.h"
#include "kernel_types.h"
#include "memory.h"
#include "render.h"
#include "render_pieces.h"
#include "render_scale.h"

enum { LEAST_BINS = 1024, MOST_BINS = 32768, CHANNELS = 4, COLOUR_LEVELS = 1023 };

/* Upper bound of the integrals over all bins, in the integer units in which they are stored, so that differences fit in
 * 32 bits. */
static const double most_units = 0x1p30;
static const double steepest = 1e6; /* upper limit of extinctions; same value as KERNEL_OPAQUE in kernel_integral.h */
static const double absorbed_share = 0.15, length_share = 0.05;

/* Returns the number of bins for the allowed error of a ray's light (max_error). Only segments whose end values differ
 * by more than some distance are looked up in the table. This distance grows with the square of a bin's width and falls
 * with the allowed error, so that narrower bins let more segments be looked up. At 1e-2 the table has 196 KB, so that
 * it fits into a core's second-level cache beside a tile's rays. */
static int choose_bin_count(double max_error)
{
    int count = LEAST_BINS;
    while (count < MOST_BINS && count < 400 / sqrt(max_error)) count *= 2;
    return count;
}

/* sum: the integrals over a bin of the extinction, and of the extinction times each channel of the colour, before they
 * are rounded to integers; the other members are ranges within the bin. */
typedef struct bin_sums {
    double sum[CHANNELS], low, high; /* minimum and maximum of the extinction in the bin */
    double colour_low[3], colour_high[3];
} bin_sums;

static double entry_of(const kernel_real *p, int entry)
{
    return (double)p[entry];
}

static double within(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}

/* Returns 1 - opacity at the value x in the piece p. */
static double get_transparency_at(const kernel_real *p, double x)
{
    const double along = (x - entry_of(p, KERNEL_PIECE_LOW)) * entry_of(p, KERNEL_PIECE_INVERSE);
    const double low = entry_of(p, KERNEL_PIECE_CLEAR), high = entry_of(p, KERNEL_PIECE_CLEAR_HIGH);
    return within(low + along * (high - low), 0, 1);
}

static double lesser(double a, double b)
{
    return a < b ? a : b;
}

static double greater(double a, double b)
{
    return a > b ? a : b;
}

static double extinction_of(double clear)
{
    return lesser(-log(greater(clear, 1e-300)), steepest);
}

static double extinction_at(const kernel_real *p, double x)
{
    return extinction_of(get_transparency_at(p, x));
}

/* Returns the extinction for `clear`, which is 1 - opacity. last: the previous argument and result, kept because
 * neighbouring bins share an end, and the function is constant in many bins. */
static double get_cached_extinction(double last[2], double clear)
{
    if (clear != last[0]) {
        last[0] = clear;
        last[1] = extinction_of(clear);
    }
    return last[1];
}

static double colour_at(const kernel_real *p, double x, int c)
{
    return entry_of(p, KERNEL_PIECE_COLOUR + c) +
           (x - entry_of(p, KERNEL_PIECE_LOW)) * entry_of(p, KERNEL_PIECE_COLOUR_SLOPE + c);
}

/* Adds the integrals between two values of a piece to `sum`, by Gauss's rule with three nodes. Ranges on which 1 -
 * opacity changes much are halved repeatedly, as towards an opacity of 1. If both ends have the same opacity, it is
 * constant between them. */
static void integrate(const kernel_real *p, double from, double to, int depth, double last[2], double sum[CHANNELS])
{
    static const double node[3] = {0.1127016653792583, 0.5, 0.8872983346207417};
    static const double weight[3] = {5.0 / 18, 8.0 / 18, 5.0 / 18};
    const double a = get_transparency_at(p, from), b = get_transparency_at(p, to), middle = 0.5 * (from + to);
    if (depth < 40 && fabs(a - b) > 0.25 * greater(a, b)) {
        integrate(p, from, middle, depth + 1, last, sum);
        integrate(p, middle, to, depth + 1, last, sum);
        return;
    }
    for (int i = 0; i < 3; i++) {
        const double x = from + node[i] * (to - from);
        const double s = (a == b ? get_cached_extinction(last, a) : extinction_at(p, x)) * weight[i] * (to - from);
        sum[0] += s;
        for (int c = 0; c < 3; c++) sum[1 + c] += s * colour_at(p, x, c);
    }
}

/* Widens the bin's ranges of extinction and colour so that they include those at the value x of the piece p. */
static void widen(bin_sums *bin, const kernel_real *p, double x, double last[2])
{
    const double extinction = get_cached_extinction(last, get_transparency_at(p, x));
    bin->low = lesser(extinction, bin->low);
    bin->high = greater(extinction, bin->high);
    for (int c = 0; c < 3; c++) {
        const double colour = colour_at(p, x, c);
        bin->colour_low[c] = lesser(colour, bin->colour_low[c]);
        bin->colour_high[c] = greater(colour, bin->colour_high[c]);
    }
}

/* Computes the integrals and ranges of the bin between two values. first: index of the piece that contains `begin`.
 * Returns the index of the piece that contains `end`. */
static int fill_bin(const kernel_pieces *pieces, int first, double begin, double end, double last[2], bin_sums *bin)
{
    *bin = (bin_sums){.low = INFINITY,
                      .high = -INFINITY,
                      .colour_low = {INFINITY, INFINITY, INFINITY},
                      .colour_high = {-INFINITY, -INFINITY, -INFINITY}};
    for (int i = first;; i++) {
        const kernel_real *p = pieces->pieces[i];
        const double from = greater(begin, entry_of(p, KERNEL_PIECE_LOW)),
                     to = lesser(end, entry_of(p, KERNEL_PIECE_HIGH));
        if (from < to) {
            widen(bin, p, from, last);
            integrate(p, from, to, 0, last, bin->sum);
            widen(bin, p, to, last);
        }
        if (i + 1 == pieces->count || entry_of(p, KERNEL_PIECE_HIGH) >= end) return i;
    }
}

/* Computes the integrals and ranges of all bins. Below the first and above the last cut between its pieces the transfer
 * function is constant; each of these two infinite ranges is represented by one bin. low: value at which the other bins
 * begin; count: their number. */
static void compute_integrals_of_bins(const kernel_pieces *pieces, double low, double width, int count, bin_sums *bins)
{
    /* The last argument and result of get_cached_extinction(). -1 is never an argument, so that the cache is empty at
     * first. */
    double last[2] = {-1, 0};
    int piece = 0;
    for (int i = 0; i < count + 2; i++)
        piece = fill_bin(pieces, piece, low + (i - 1) * width, low + i * width, last, &bins[i]);
    /* The first and the last bin are computed again, each from the outermost piece only: because its border is rounded,
     * a bin may include a part of the neighbouring piece. */
    for (int end = 0; end < 2; end++) {
        const kernel_real *p = pieces->pieces[end ? pieces->count - 1 : 0];
        const double x = end ? low + (count + 0.5) * width : low - 0.5 * width;
        bin_sums *bin = &bins[end ? count + 1 : 0];
        memset(bin->sum, 0, sizeof bin->sum);
        integrate(p, x - 0.5 * width, x + 0.5 * width, 0, last, bin->sum);
        bin->low = bin->high = extinction_at(p, x);
        for (int c = 0; c < 3; c++) bin->colour_low[c] = bin->colour_high[c] = colour_at(p, x, c);
    }
}

/* Returns the colour at the middle of the bin's range, 10 bits per channel. */
static int32_t pack_colour(const bin_sums *bin, double contrast)
{
    int32_t packed = 0;
    for (int c = 0; c < 3; c++) {
        const double middle = 0.5 * (bin->colour_low[c] + bin->colour_high[c]) / contrast;
        packed |= (int32_t)(within(middle, 0, 1) * COLOUR_LEVELS + 0.5) << (10 * c);
    }
    return packed;
}

/* Returns the largest change of a colour channel within the bin. */
static double colour_change(const bin_sums *bin)
{
    double change = 0;
    for (int c = 0; c < 3; c++) change = greater(bin->colour_high[c] - bin->colour_low[c], change);
    return change;
}

/* Stores the integrals as integers, and the bins' error bounds. Returns the maximum deviation of a colour within a bin
 * from the colour at its middle. */
static double store_bin_integrals(kernel_preintegral *out, const bin_sums *bins, double width, double contrast)
{
    double total[2] = {0, 0}, before[CHANNELS] = {0}, change = 0;
    for (int i = 0; i < out->bin_count + 2; i++) {
        total[0] += bins[i].sum[0];
        total[1] += fmax(bins[i].sum[1], fmax(bins[i].sum[2], bins[i].sum[3]));
    }
    const double units[2] = {fmax(total[0], 1e-30) / most_units, fmax(total[1], 1e-30) / most_units};
    for (int i = 0; i < out->bin_count + 2; i++) {
        const bin_sums *bin = &bins[i];
        kernel_preint_entry *e = &out->entries[i];
        for (int n = 0; n < CHANNELS; n++) {
            const int32_t begin = (int32_t)(before[n] / units[n > 0]);
            before[n] += bin->sum[n];
            e->before[n] = begin;
            e->own[n] = (float)((int32_t)(before[n] / units[n > 0]) - begin);
        }
        e->colour = pack_colour(bin, contrast);
        /* a bin without extinction has no rounding error, because its integrals are exactly 0 */
        const double rounding = 2 * (units[0] * contrast + units[1]) / width;
        e->table_error = (float)fmin((bin->high - bin->low) * 2 * contrast + bin->high * colour_change(bin) +
                                         (bin->high > 0 ? rounding : 0),
                                     1e30);
        change = fmax(change, colour_change(bin));
    }
    out->depth_unit = (float)(units[0] / width);
    out->light_unit = (float)(units[1] / width);
    return 0.5 * change;
}

/* Computes out->bend_square and out->bend, which limit the deviation of colours from chords (kernel_preintegral.h), for
 * colour tables whose entries are unevenly spaced in the domain. The limits hold even if the largest change of slope
 * occurred at entries with the smallest spacing. The changes of slope towards the constant colours beyond the ends
 * count too, because the ends need not be at 0 and 1. */
static void compute_uneven_colour_bends(kernel_preintegral *out, const render_transfer *t)
{
    double bend = 0, closest = 1;
    for (int c = 0; c < 3; c++) {
        double slope = 0;
        for (int i = 0; i < t->colour_count; i++) {
            const bool is_last = i == t->colour_count - 1;
            const double width = is_last ? 1 : render_entry_position(t, i + 1) - render_entry_position(t, i);
            const double change = is_last ? 0 : (double)t->colours[3 * i + 3 + c] - (double)t->colours[3 * i + c];
            bend = fmax(bend, fabs(change / width - slope));
            closest = fmin(closest, width);
            slope = change / width;
        }
    }
    out->bend_square = (float)fmin(bend / (6 * closest), 1e30);
    out->bend = (float)fmin(bend / 4, 1e30);
}

/* Computes the members of *out that limit the deviation of colours from chords (kernel_preintegral.h), from the changes
 * of the colours' slopes at the table's entries. */
static void compute_colour_bends(kernel_preintegral *out, const render_transfer *t)
{
    const int last = t->colour_count - 1;
    if (t->scale != RENDER_LINEAR) {
        compute_uneven_colour_bends(out, t);
        return;
    }
    double inner = 0, ends = 0;
    for (int c = 0; c < 3; c++)
        for (int i = 0; i < last; i++) {
            const double slope = ((double)t->colours[3 * i + 3 + c] - (double)t->colours[3 * i + c]) * last;
            if (i == 0 || i == last - 1) ends = fmax(ends, fabs(slope));
            if (i == last - 1) continue;
            const double next = ((double)t->colours[3 * i + 6 + c] - (double)t->colours[3 * i + 3 + c]) * last;
            inner = fmax(inner, fabs(next - slope));
        }
    out->bend_square = (float)(inner * last / 6);
    out->bend = (float)(inner / 4);
    out->bend_at_ends = (float)(ends / 2);
}

static bool has_negative_colours(const render_transfer *t)
{
    for (int i = 0; i < 3 * t->colour_count; i++)
        if (t->colours[i] < 0) return true;
    return false;
}

static void fill(kernel_preintegral *out, const kernel_pieces *exact, const render_transfer *t, double max_error,
                 double reach, bin_sums *bins)
{
    const double contrast = (double)exact->contrast, range = KERNEL_PIECE_BINS / (double)exact->bin_inverse;
    const double low = (double)exact->bin_low, width = range / out->bin_count;
    out->low = (float)low;
    out->inverse = (float)(1 / width);
    compute_integrals_of_bins(exact, low, width, out->bin_count, bins);
    const double change = store_bin_integrals(out, bins, width, contrast);
    compute_colour_bends(out, t);
    out->contrast = (float)contrast;
    out->colour_unit = (float)(contrast / COLOUR_LEVELS);
    out->colour_error = (float)(change + contrast / COLOUR_LEVELS);
    out->allowed_absorbed = (float)(absorbed_share * max_error);
    out->allowed_length = (float)(length_share * max_error / reach);
}

insitu_status render_preintegral_build(kernel_pieces *pieces, const render_transfer *t, double max_error, double reach,
                                       base_error *error)
{
    kernel_pieces exact;
    if (has_negative_colours(t)) return INSITU_OK;
    /* with a nonlinear scale pieces cannot be exact; the tolerance then limits their extinction's relative error */
    const double tolerance = t->scale == RENDER_LINEAR ? 0 : max_error / 8;
    const insitu_status status = render_pieces_build(&exact, t, tolerance, error);
    if (status != INSITU_OK) return status;
    const int count = choose_bin_count(max_error);
    bin_sums *bins = base_calloc((size_t)count + 2, sizeof *bins);
    pieces->preintegral = base_calloc(1, sizeof *pieces->preintegral);
    if (pieces->preintegral) {
        pieces->preintegral->bin_count = count;
        pieces->preintegral->entries = base_calloc((size_t)count + 2, sizeof *pieces->preintegral->entries);
    }
    const bool has_room = bins && pieces->preintegral && pieces->preintegral->entries;
    if (has_room) fill(pieces->preintegral, &exact, t, max_error, reach, bins);
    base_free(bins);
    render_pieces_free(&exact);
    if (has_room) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "no memory for the sums of a transfer function");
}
