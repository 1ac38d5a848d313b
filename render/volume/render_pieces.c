/* Divides the values of a transfer function into pieces. The cuts between pieces are the values of all control points
 * of the opacity, and of all entries of the colour table that do not lie on a line with their neighbours. Opacity and
 * colour are linear between the cuts, exactly as documented.
 *
 * A ramp is the opacity between two neighbouring control points. If it is linear along a logarithmic scale, it is not
 * linear in the value. It is then divided into pieces whose extinction has a relative error of at most e. The effect on
 * a pixel does not grow with the path through the medium: a pixel is C = int T s c dt + T_end B, with the transmittance
 * T up to the depth t, the extinction s, the colour c, and the background B behind the transmittance T_end. A change ds
 * of s changes C by dC = int T ds (c - b) dt, where b is the light from behind t. With |ds| <= e s that is at most e R
 * int T s dt = e R (1 - T_end), where R is the contrast of colours. If the ramp rises from an opacity of 0, the
 * relative error of a piece from the value v to (1 + h) v is h / 2; farther up, at a distance g from the ramp's begin
 * along the logarithmic scale, it is h^2 / (8 g). So sqrt(g / 2 e) pieces suffice, and halving makes at most twice as
 * many. Over 12 decades that is 105 pieces for e = 1.25e-3, and 370 for 1e-4. */
#include "render_pieces.h"
#include "kernel_bound.h"
#include "kernel_types.h"
#include "render.h"
#include "render_scale.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "insitu/status.h"
#include "memory.h"

/* A value far outside every domain. It is finite so that 0 times it is 0. */
static const kernel_real endless = (kernel_real)0x1p100;
/* Relative rounding error that is added to bounds; also the least tolerance of colours. */
static const double rounding = 1e-7;

static int compare_cuts(const void *left, const void *right)
{
    const kernel_real a = *(const kernel_real *)left, b = *(const kernel_real *)right;
    return (a > b) - (a < b);
}

/* Returns a channel of the colour at a position in the colour table, counted in entries. */
static double colour_at(const render_transfer *t, double place, int channel)
{
    const int last = t->colour_count - 1;
    const int i = place >= last ? last - 1 : place > 0 ? (int)place : 0;
    const double low = (double)t->colours[3 * i + channel], high = (double)t->colours[3 * i + 3 + channel];
    return low + (place - i) * (high - low);
}

/* Returns whether the table's entries between `from` and `to` lie on the line between these two, within the tolerance.
 */
static bool are_colours_on_line(const render_transfer *t, int from, int to, double tolerance)
{
    for (int c = 0; c < 3; c++) {
        const double start = (double)t->colours[3 * from + c];
        const double slope = ((double)t->colours[3 * to + c] - start) / (to - from);
        for (int i = from + 1; i < to; i++)
            if (fabs(start + slope * (i - from) - (double)t->colours[3 * i + c]) > tolerance) return false;
    }
    return true;
}

/* Returns the index of the farthest entry behind entry i up to which all entries lie on a line within the tolerance.
 * The search takes quadratic time, so lines are limited to FARTHEST entries. */
static int find_farthest_entry_on_line(const render_transfer *t, int i, double tolerance)
{
    enum { FARTHEST = 256 };
    int next = i + 1;
    if (t->scale != RENDER_LINEAR) return next;
    while (next + 1 < t->colour_count && next - i < FARTHEST && are_colours_on_line(t, i, next + 1, tolerance)) next++;
    return next;
}

/* An entry of the colour table at which the function is cut, and its position in the transfer function's domain. */
typedef struct kept_entry {
    int index;
    double place;
} kept_entry;

/* ---- opacities that are linear along a nonlinear scale of values ---- */

/* Error bound of the extinction of ramps, relative to the extinction, if the job allows no error. */
static const double exact_share = 1e-4;

/* A ramp is the opacity between two neighbouring points of the transfer function, with the indices `ramp` and ramp + 1.
 * A part of it lies between the positions low and high, which are shares of the ramp along the scale, from 0 to 1. */

static double ramp_opacity(const render_transfer *t, int ramp, double share)
{
    const double low = (double)t->opacities[ramp], high = (double)t->opacities[ramp + 1];
    return low + share * (high - low);
}

/* Returns the value, in the transfer function's domain, at a position on the ramp. */
static double ramp_value(const render_transfer *t, int ramp, double share)
{
    const double low = render_scaled(t->scale, t->threshold, t->opacity_values[ramp]);
    const double high = render_scaled(t->scale, t->threshold, t->opacity_values[ramp + 1]);
    return render_domain_of(t, render_unscaled(t->scale, t->threshold, low + share * (high - low)));
}

/* Returns whether the relative error of the extinction exceeds the tolerance if the part of the ramp becomes one piece.
 * The relative error is largest at an end of the part with opacity 0, but the tested position nearest to that end is
 * 1/32 of the part away from it; the factor 1.1 covers the difference. */
static bool is_ramp_part_nonlinear(const render_transfer *t, int ramp, double low, double high, double tolerance)
{
    enum { PLACES = 32 };
    const double x0 = ramp_value(t, ramp, low), x1 = ramp_value(t, ramp, high);
    const double a0 = ramp_opacity(t, ramp, low), a1 = ramp_opacity(t, ramp, high);
    for (int i = 1; i < PLACES; i++) {
        const double share = low + (high - low) * i / PLACES;
        const double chord = a0 + (ramp_value(t, ramp, share) - x0) / (x1 - x0) * (a1 - a0);
        const double truth = kernel_extinction_of(ramp_opacity(t, ramp, share));
        if (1.1 * fabs(kernel_extinction_of(chord) - truth) > tolerance * truth) return true;
    }
    return false;
}

/* Stores the values, in the domain, at which a part of a ramp must be cut, unless cuts is NULL. Returns their number. A
 * part is not cut if float32 cannot distinguish its middle from its ends. */
static int find_ramp_cuts(const render_transfer *t, int ramp, double low, double high, double tolerance,
                          kernel_real *cuts)
{
    const double middle = 0.5 * (low + high), at = ramp_value(t, ramp, middle);
    const float rounded = (float)at;
    if (!((float)ramp_value(t, ramp, low) < rounded && rounded < (float)ramp_value(t, ramp, high))) return 0;
    if (!is_ramp_part_nonlinear(t, ramp, low, high, tolerance)) return 0;
    int count = find_ramp_cuts(t, ramp, low, middle, tolerance, cuts);
    if (cuts) cuts[count] = (kernel_real)at;
    count++;
    return count + find_ramp_cuts(t, ramp, middle, high, tolerance, cuts ? cuts + count : NULL);
}

/* Stores the values at which all ramps must be cut, unless cuts is NULL. Returns their number. */
static int find_cuts_of_all_ramps(const render_transfer *t, double tolerance, kernel_real *cuts)
{
    const double share = tolerance > rounding ? tolerance : exact_share;
    int count = 0;
    for (int i = 0; i + 1 < t->opacity_count && t->scale != RENDER_LINEAR; i++) {
        if (t->opacities[i] == t->opacities[i + 1]) continue;
        count += find_ramp_cuts(t, i, 0, 1, share, cuts ? cuts + count : NULL);
    }
    return count;
}

/* ---- pieces ---- */

/* Stores the values of all cuts in the transfer function's domain, sorted and without duplicates, and the entries of
 * the colour table among them. Returns the number of cuts. */
static int collect_cuts(const render_transfer *t, double tolerance, kernel_real *cuts, kept_entry *entries)
{
    int count = find_cuts_of_all_ramps(t, tolerance, cuts), kept = 0;
    for (int i = 0; i < t->colour_count - 1; i = find_farthest_entry_on_line(t, i, tolerance))
        entries[kept++] = (kept_entry){i, render_entry_position(t, i)};
    entries[kept++] = (kept_entry){t->colour_count - 1, render_entry_position(t, t->colour_count - 1)};
    for (int i = 0; i < kept; i++) cuts[count++] = (kernel_real)entries[i].place;
    for (int i = 0; i < t->opacity_count; i++) cuts[count++] = (kernel_real)render_domain_of(t, t->opacity_values[i]);
    qsort(cuts, (size_t)count, sizeof *cuts, compare_cuts);
    int unique = 1;
    for (int i = 1; i < count; i++)
        if (cuts[i] > cuts[unique - 1]) cuts[unique++] = cuts[i];
    return unique;
}

/* Returns the position of the value x (in the domain) on the ramp from opacity point i to the next one, along the
 * scale, as a share from 0 to 1. */
static double get_position_on_ramp(const render_transfer *t, int i, double x)
{
    double low, inverse_width;
    render_transfer_domain(t, &low, &inverse_width);
    const double from = render_scaled(t->scale, t->threshold, t->opacity_values[i]);
    const double to = render_scaled(t->scale, t->threshold, t->opacity_values[i + 1]);
    const double at = render_scaled(t->scale, t->threshold, low + x / inverse_width);
    return fmin(fmax((at - from) / (to - from), 0), 1);
}

/* Returns the opacity at the value x on the ramp that contains the value `middle`; values in the domain. */
static double get_opacity_on_ramp(const render_transfer *t, double middle, double x)
{
    int i = 0;
    while (i < t->opacity_count && render_domain_of(t, t->opacity_values[i]) <= middle) i++;
    if (i == 0) return (double)t->opacities[0];
    if (i == t->opacity_count) return (double)t->opacities[i - 1];
    const double rise = (double)t->opacities[i] - (double)t->opacities[i - 1];
    const double a = (double)t->opacities[i - 1] + get_position_on_ramp(t, i - 1, x) * rise;
    return a < 0 ? 0 : a > 1 ? 1 : a;
}

/* Sets the piece's colours at its begin x, and their slopes. middle: a value inside of the piece. */
static void set_colours(const render_transfer *t, const kept_entry *entries, double middle, double x,
                        kernel_real piece[KERNEL_PIECE_ENTRIES])
{
    const int last = t->colour_count - 1;
    int k = 0;
    while (entries[k + 1].index < last && entries[k + 1].place <= middle) k++;
    const double begin = entries[k].place, end = entries[k + 1].place;
    const bool is_before = k == 0 && middle < begin, is_behind = entries[k + 1].index == last && middle > end;
    for (int c = 0; c < 3; c++) {
        const double low = colour_at(t, entries[k].index, c), high = colour_at(t, entries[k + 1].index, c);
        const double slope = is_before || is_behind ? 0 : (high - low) / (end - begin);
        const double colour = is_before ? low : is_behind ? high : low + (x - begin) * slope;
        piece[KERNEL_PIECE_COLOUR + c] = (kernel_real)colour;
        piece[KERNEL_PIECE_COLOUR_SLOPE + c] = (kernel_real)slope;
    }
}

/* Width of a ramp in the transfer function's domain below which the rounding of its ends and of values to float32
 * (3e-8) becomes visible. */
static const double narrow_width = 0.01;

static bool is_ramp_narrow(const render_transfer *t, int i)
{
    const double width = render_domain_of(t, t->opacity_values[i + 1]) - render_domain_of(t, t->opacity_values[i]);
    return 0 < width && width < narrow_width && t->opacities[i] != t->opacities[i + 1];
}

/* Returns the value of a cut in double: the exact value if one opacity point lies there, at which a narrow ramp begins
 * or ends. Otherwise, and if several points coincide there (a step), returns the rounded value `cut`. */
static double exact_cut_value(const render_transfer *t, kernel_real cut)
{
    double out = (double)cut;
    int count = 0;
    for (int i = 0; i < t->opacity_count; i++) {
        const double at = render_domain_of(t, t->opacity_values[i]);
        if ((kernel_real)at != cut) continue;
        count++;
        if ((i > 0 && is_ramp_narrow(t, i - 1)) || (i + 1 < t->opacity_count && is_ramp_narrow(t, i))) out = at;
    }
    return count == 1 ? out : (double)cut;
}

/* Computes the entries of the piece between two cuts. */
static void set_piece(const render_transfer *t, const kept_entry *entries, kernel_real low, kernel_real high,
                      kernel_real piece[KERNEL_PIECE_ENTRIES])
{
    const double begin = exact_cut_value(t, low), end = exact_cut_value(t, high), middle = 0.5 * (begin + end);
    piece[KERNEL_PIECE_LOW] = low;
    piece[KERNEL_PIECE_HIGH] = high;
    piece[KERNEL_PIECE_LOW_REST] = (kernel_real)(begin - (double)low);
    piece[KERNEL_PIECE_HIGH_REST] = (kernel_real)(end - (double)high);
    const double at_low = get_opacity_on_ramp(t, middle, begin), at_high = get_opacity_on_ramp(t, middle, end);
    piece[KERNEL_PIECE_OPACITY] = (kernel_real)at_low;
    piece[KERNEL_PIECE_OPACITY_HIGH] = (kernel_real)at_high;
    piece[KERNEL_PIECE_CLEAR] = (kernel_real)(1 - at_low);
    piece[KERNEL_PIECE_CLEAR_HIGH] = (kernel_real)(1 - at_high);
    piece[KERNEL_PIECE_SLOPE] = (kernel_real)((at_high - at_low) / (end - begin));
    piece[KERNEL_PIECE_INVERSE] = 1 / ((high - low) + (piece[KERNEL_PIECE_HIGH_REST] - piece[KERNEL_PIECE_LOW_REST]));
    set_colours(t, entries, middle, begin, piece);
}

/* ---- search table of pieces; steps of the opacity ---- */

/* Fills the table by which the piece of a value is found. */
static void fill_search_table_of_pieces(kernel_pieces *out)
{
    int piece = 0;
    for (int i = 0; i < KERNEL_PIECE_BINS; i++) {
        const kernel_real x = out->bin_low + (kernel_real)i / out->bin_inverse;
        while (piece + 1 < out->count && out->pieces[piece][KERNEL_PIECE_HIGH] <= x) piece++;
        out->bin_first[i] = (kernel_real)piece;
    }
}

/* Stores the values of the steps of the opacity. If several points have the same value, the opacity just below it is
 * the first point's, and that just above it the last one's. */
static void fill_steps(kernel_pieces *out, const render_transfer *t)
{
    int last;
    for (int i = 0; i < t->opacity_count; i = last + 1) {
        const double at = render_domain_of(t, t->opacity_values[i]);
        last = i;
        while (last + 1 < t->opacity_count &&
               (kernel_real)render_domain_of(t, t->opacity_values[last + 1]) == (kernel_real)at)
            last++;
        if (t->opacities[i] != t->opacities[last]) out->steps[out->step_count++] = at;
    }
}

/* Computes the range of all colours of the table, extended to include 0 and 1. */
static void find_colour_range(const render_transfer *t, float *low, float *high)
{
    *low = 0, *high = 1;
    for (int i = 0; i < 3 * t->colour_count; i++) {
        *low = fminf(*low, t->colours[i]);
        *high = fmaxf(*high, t->colours[i]);
    }
}

/* ---- bounds of the effect of field errors on light ----
 *
 * A field error d changes the light by T d g per unit distance, where T is the transmittance, s the extinction, c a
 * channel of the colour, primes are derivatives by the value, and g = s' (c - b) + s c'. The light b from behind lies
 * in the range of light (find_colour_range()). g is linear in b, so that over a range of values its variation is
 * largest if b is the minimum or the maximum. For the alpha channel, g = s'. So there are seven kinds of g: alpha, and
 * three channels with two b each. */
enum { VARIATION_KINDS = 7 };

/* Over a range of values: the minimum and maximum of each kind of g (VARIATION_KINDS), and the maximum of the
 * extinction. */
typedef struct value_variation {
    double low[VARIATION_KINDS], high[VARIATION_KINDS];
    double extinction;
} value_variation;

static void widen_variation(value_variation *variation, int kind, double low, double high)
{
    variation->low[kind] = fmin(variation->low[kind], fmax(low, -1e30));
    variation->high[kind] = fmax(variation->high[kind], fmin(high, 1e30));
}

/* Widens the ranges of a so that they include those of b. Comparisons are used because fmin() and fmax() are function
 * calls, of which a frame would need 200,000. */
static void unite_variations(value_variation *a, const value_variation *b)
{
    for (int kind = 0; kind < VARIATION_KINDS; kind++) {
        a->low[kind] = b->low[kind] < a->low[kind] ? b->low[kind] : a->low[kind];
        a->high[kind] = b->high[kind] > a->high[kind] ? b->high[kind] : a->high[kind];
    }
    a->extinction = b->extinction > a->extinction ? b->extinction : a->extinction;
}

/* Widens the ranges of g (the change of light per unit of field error, defined above) and of the extinction so that
 * they include those between the values `from` and `to` of the piece p. behind: the minimum and maximum of the light
 * from behind. */
static void include_variation_of_piece(value_variation *variation, const kernel_real *p, double from, double to,
                                       const double behind[2])
{
    kernel_bound b = {.extinction_low = 1e30f};
    const bool falls = p[KERNEL_PIECE_SLOPE] < 0;
    double steepness[2];
    kernel_bound_widen(&b, p, from, to);
    kernel_bound_piece_extinction_slope(p, from, to, steepness);
    /* Minimum and maximum of the slope of the extinction, with its sign. */
    const double fall = falls ? -steepness[1] : steepness[0], rise = falls ? -steepness[0] : steepness[1];
    const double least = (double)b.extinction_low, most = (double)b.extinction_high;
    variation->extinction = fmax(most, variation->extinction);
    widen_variation(variation, 0, fall, rise);
    for (int kind = 1; kind < VARIATION_KINDS; kind++) {
        const int channel = (kind - 1) / 2;
        const double slope = (double)p[KERNEL_PIECE_COLOUR_SLOPE + channel];
        const double first = (double)p[KERNEL_PIECE_COLOUR + channel] - behind[kind % 2];
        const double c0 = first + (from - (double)p[KERNEL_PIECE_LOW]) * slope, c1 = c0 + (to - from) * slope;
        const double corners[4] = {fall * c0, fall * c1, rise * c0, rise * c1};
        const double low = fmin(fmin(corners[0], corners[1]), fmin(corners[2], corners[3]));
        const double high = fmax(fmax(corners[0], corners[1]), fmax(corners[2], corners[3]));
        widen_variation(variation, kind, low + fmin(least * slope, most * slope),
                        high + fmax(least * slope, most * slope));
    }
}

/* Computes the ranges of g (the change of light per unit of field error, defined above) and of the extinction over a
 * bin of values, and a little beyond its ends; the first and the last bin include all values beyond the table. piece:
 * index of a piece, in front of which no piece reaches the bin. Returns the index of the first piece that reaches the
 * bin, from which the search for the next bin's pieces begins. */
static int compute_variation_of_bin(const kernel_pieces *t, int bin, int piece, const double behind[2],
                                    value_variation *variation)
{
    const double width = 1 / (double)t->variation_inverse, begin = (double)t->bin_low + (bin - 1e-3) * width;
    const double low = bin > 0 ? begin : -(double)endless;
    const double high = bin + 1 < KERNEL_VARIATION_BINS ? begin + 1.002 * width : (double)endless;
    variation->extinction = 0;
    for (int kind = 0; kind < VARIATION_KINDS; kind++)
        variation->low[kind] = INFINITY, variation->high[kind] = -INFINITY;
    while (piece + 1 < t->count && (double)t->pieces[piece][KERNEL_PIECE_HIGH] < low) piece++;
    for (int i = piece; i < t->count && (double)t->pieces[i][KERNEL_PIECE_LOW] <= high; i++) {
        const double from = fmax(low, (double)t->pieces[i][KERNEL_PIECE_LOW]);
        const double to = fmin(high, (double)t->pieces[i][KERNEL_PIECE_HIGH]);
        include_variation_of_piece(variation, t->pieces[i], from, to, behind);
    }
    return piece;
}

/* Computes the bounds over a range of values (KERNEL_LIGHT_VARIATION etc.), for the table of bounds, from the ranges of
 * g and of the extinction over these values. */
static void compute_light_bounds_from_variation(const value_variation *s, double contrast,
                                                float out[KERNEL_LIGHT_ENTRIES])
{
    double variation = 0, cost = 0;
    for (int kind = 0; kind < VARIATION_KINDS; kind++) {
        variation = fmax(variation, s->high[kind] - s->low[kind]);
        cost = fmax(cost, fmax(-s->low[kind], s->high[kind]));
    }
    out[KERNEL_LIGHT_VARIATION] = (float)fmin(variation * (1 + rounding), 1e30);
    out[KERNEL_LIGHT_COST] = (float)fmin(cost * (1 + rounding), 1e30);
    out[KERNEL_LIGHT_EXTINCTION] = (float)s->extinction;
    out[KERNEL_LIGHT_STEEPNESS] = (float)fmin(fmax(-s->low[0], s->high[0]) * contrast, 1e30);
}

/* Fills the table of bounds over ranges of values (kernel_pieces.variations). Its rows are classes of the widths of
 * ranges, its columns the bins in which ranges begin. A range of the class `width` that begins anywhere in bin `first`
 * ends in bin `wanted` or in front of it. */
static void fill_variations(kernel_pieces *out, const double behind[2])
{
    value_variation bins[KERNEL_VARIATION_BINS];
    for (int i = 0, piece = 0; i < KERNEL_VARIATION_BINS; i++)
        piece = compute_variation_of_bin(out, i, piece, behind, &bins[i]);
    for (int first = 0; first < KERNEL_VARIATION_BINS; first++) {
        value_variation all = bins[first];
        for (int width = 0, last = first; width < KERNEL_VARIATION_WIDTHS; width++) {
            const int wanted = first + (int)ceil(ldexp(1 + 0.25 * (width % 4 + 1), width / 4)) - 1;
            for (; last < wanted && last + 1 < KERNEL_VARIATION_BINS; last++) unite_variations(&all, &bins[last + 1]);
            compute_light_bounds_from_variation(&all, behind[1] - behind[0],
                                                out->variations[width * KERNEL_VARIATION_BINS + first]);
        }
    }
}

static void fill(kernel_pieces *out, const render_transfer *t, double tolerance, kernel_real *cuts, kept_entry *entries)
{
    const int count = collect_cuts(t, tolerance > rounding ? tolerance : rounding, cuts, entries);
    float low, high;
    out->count = count + 1;
    set_piece(t, entries, -endless, cuts[0], out->pieces[0]);
    for (int i = 0; i + 1 < count; i++) set_piece(t, entries, cuts[i], cuts[i + 1], out->pieces[i + 1]);
    set_piece(t, entries, cuts[count - 1], endless, out->pieces[count]);
    out->bin_low = cuts[0];
    out->bin_inverse = KERNEL_PIECE_BINS / (cuts[count - 1] - cuts[0]);
    fill_search_table_of_pieces(out);
    find_colour_range(t, &low, &high);
    out->contrast = high - low;
    fill_steps(out, t);
    for (int i = 0; i + 1 < t->opacity_count; i++) out->has_rests = out->has_rests || is_ramp_narrow(t, i);
}

insitu_status render_pieces_build(kernel_pieces *out, const render_transfer *t, double tolerance, base_error *error)
{
    const size_t bends = (size_t)find_cuts_of_all_ramps(t, tolerance, NULL);
    const size_t most = (size_t)t->colour_count + (size_t)t->opacity_count + bends;
    memset(out, 0, sizeof *out);
    kernel_real *cuts = base_calloc(most, sizeof *cuts);
    kept_entry *entries = base_calloc((size_t)t->colour_count, sizeof *entries);
    out->pieces = base_calloc(most + 1, sizeof *out->pieces);
    const bool has_room = cuts && entries && out->pieces;
    if (has_room) fill(out, t, tolerance, cuts, entries);
    base_free(cuts);
    base_free(entries);
    if (has_room) return INSITU_OK;
    render_pieces_free(out);
    return base_fail(error, INSITU_ERROR_MEMORY, "no memory for a transfer function of %d colours", t->colour_count);
}

insitu_status render_variations_build(kernel_pieces *pieces, const render_transfer *t, base_error *error)
{
    float low, high;
    find_colour_range(t, &low, &high);
    pieces->variations = base_calloc(KERNEL_VARIATION_WIDTHS * KERNEL_VARIATION_BINS, sizeof *pieces->variations);
    if (!pieces->variations)
        return base_fail(error, INSITU_ERROR_MEMORY, "no memory for the bounds of a transfer function");
    pieces->variation_inverse = (float)((double)pieces->bin_inverse * KERNEL_VARIATION_BINS / KERNEL_PIECE_BINS);
    fill_variations(pieces, (const double[]){(double)low, (double)high});
    return INSITU_OK;
}

void render_pieces_free(kernel_pieces *pieces)
{
    if (pieces->preintegral) base_free(pieces->preintegral->entries);
    base_free(pieces->preintegral);
    base_free(pieces->pieces);
    base_free(pieces->variations);
    pieces->preintegral = NULL;
    pieces->pieces = NULL;
    pieces->variations = NULL;
}
