/* Inline code that joins sheets, blends their fragments over the background and stores them in the picture. It is
 * compiled once per instruction set. */
#ifndef COMP_COMP_SHEET_BLEND_H
#define COMP_COMP_SHEET_BLEND_H

#include <math.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

#include "comp_lanes.h"
#include "comp_sheet_loops.h"
#include "fragment_order.h"

/* Indices of words (comp_sheet.words): WORD_T_IN to WORD_KIND in a fragment, WORD_DEPTH and WORD_RGBA in a finished
 * pixel. */
enum { WORD_T_IN = 0, WORD_COLOUR = 2, WORD_TRANSMITTANCE = 5, WORD_KIND = 6, WORD_DEPTH = 0, WORD_RGBA = 1 };

/* ---- joining two sheets ----------------------------------------------------------------------------------------- */

/* Returns the lanes in the mask `both` in which the fragment of `other` is nearer than the fragment of `all`. Fragments
 * whose t_in are equal or NaN are compared by fragment_compare(). */
ROWS_INLINE lanes find_nearer_lanes(const comp_sheet *all, const comp_sheet *other, int at, unsigned both)
{
    const float_lanes old = (float_lanes)load_lanes(&all->words[WORD_T_IN][at]);
    const float_lanes new = (float_lanes)load_lanes(&other->words[WORD_T_IN][at]);
    const lanes is_in_both = mask_lanes(both), nearer = (lanes)(new < old) & is_in_both;
    const lanes undecided = is_in_both & ~nearer & ~(lanes)(old < new);
    if (!or_all_lanes(undecided)) return nearer;
    uint32_t decided[COMP_LANES];
    store_lanes(decided, nearer);
    for (int l = 0; l < COMP_LANES; l++) {
        if (!undecided[l]) continue;
        const fragment a = comp_sheet_get(other, (uint32_t)(at + l), 0), b = comp_sheet_get(all, (uint32_t)(at + l), 0);
        decided[l] = fragment_compare(&a, &b) < 0 ? 0xffffffffu : 0;
    }
    return load_lanes(decided);
}

static void join_sheets(comp_sheet *all, const comp_sheet *other, uint16_t left[COMP_ROWS])
{
    const bool are_opaque = all->is_opaque && other->is_opaque;
    for (int r = 0; r < COMP_ROWS; r++) {
        const int at = r * COMP_LANES;
        const unsigned both = all->masks[r] & other->masks[r];
        left[r] = (uint16_t)(are_opaque ? 0 : both);
        if (!other->masks[r]) continue;
        lanes taken = mask_lanes(other->masks[r] & ~both);
        if (both && are_opaque) taken |= find_nearer_lanes(all, other, at, both);
        for (int w = 0; w < COMP_WORDS; w++)
            store_lanes(&all->words[w][at],
                        select_lanes(taken, load_lanes(&other->words[w][at]), load_lanes(&all->words[w][at])));
        all->masks[r] = (uint16_t)(all->masks[r] | other->masks[r]);
    }
    all->is_opaque = are_opaque;
}

/* ---- blending over the background ------------------------------------------------------------------------------- */

static void finish_pixels(const comp_sheet *fragments, const float background[4], comp_sheet *pixels)
{
    const float_lanes zero = {0};
    float infinity = INFINITY;
    uint32_t infinity_bits;
    memcpy(&infinity_bits, &infinity, sizeof infinity_bits);
    memcpy(pixels->masks, fragments->masks, sizeof pixels->masks);
    pixels->strip = fragments->strip;
    pixels->is_opaque = false;
    for (int r = 0; r < COMP_ROWS; r++) {
        if (!fragments->masks[r]) continue;
        const int at = r * COMP_LANES;
        const float_lanes transmittance = (float_lanes)load_lanes(&fragments->words[WORD_TRANSMITTANCE][at]);
        for (int c = 0; c < 3; c++) {
            const float_lanes colour = (float_lanes)load_lanes(&fragments->words[WORD_COLOUR + c][at]);
            store_lanes(&pixels->words[WORD_RGBA + c][at], (lanes)(zero + colour + transmittance * background[c]));
        }
        store_lanes(&pixels->words[WORD_RGBA + 3][at], (lanes)(1 - transmittance + transmittance * background[3]));
        const lanes is_hit = (lanes)(load_lanes(&fragments->words[WORD_KIND][at]) >= FRAGMENT_SURFACE);
        store_lanes(&pixels->words[WORD_DEPTH][at],
                    select_lanes(is_hit, load_lanes(&fragments->words[WORD_T_IN][at]), (lanes){0} + infinity_bits));
    }
}

/* ---- storing pixels in the picture ------------------------------------------------------------------------------ */

/* The addresses of a row of the picture. */
typedef struct picture_row {
    float *rgba, *depth; /* addresses of the row's first pixel; depth may be NULL */
    bool is_aligned;
} picture_row;

ROWS_INLINE void store_quad(float *to, quad value, bool is_aligned)
{
#if defined(__SSE2__)
    if (is_aligned) {
        _mm_stream_ps(to, (__m128)value);
        return;
    }
#endif
    (void)is_aligned;
    memcpy(to, &value, sizeof value);
}

/* Transposes four pixels from one vector per channel to RGBA, and stores them. If is_aligned is set, the stores bypass
 * the caches, because the picture is larger than the caches. */
ROWS_INLINE void store_four_pixels(const quad in[4], float *rgba, bool is_aligned)
{
    const quad a = __builtin_shufflevector(in[0], in[1], 0, 4, 1, 5),
               b = __builtin_shufflevector(in[0], in[1], 2, 6, 3, 7);
    const quad c = __builtin_shufflevector(in[2], in[3], 0, 4, 1, 5),
               d = __builtin_shufflevector(in[2], in[3], 2, 6, 3, 7);
    store_quad(rgba, __builtin_shufflevector(a, c, 0, 1, 4, 5), is_aligned);
    store_quad(rgba + 4, __builtin_shufflevector(a, c, 2, 3, 6, 7), is_aligned);
    store_quad(rgba + 8, __builtin_shufflevector(b, d, 0, 1, 4, 5), is_aligned);
    store_quad(rgba + 12, __builtin_shufflevector(b, d, 2, 3, 6, 7), is_aligned);
}

ROWS_INLINE void store_row(const lanes values[5], const picture_row *to)
{
    quad parts[5][4];
    memcpy(parts, values, sizeof parts);
    for (int q = 0; q < 4; q++) {
        const quad channels[4] = {parts[1][q], parts[2][q], parts[3][q], parts[4][q]};
        store_four_pixels(channels, to->rgba + 16 * q, to->is_aligned);
        if (to->depth) store_quad(to->depth + 4 * q, parts[0][q], to->is_aligned);
    }
}

/* Stores the pixels of a strip's row that is cut off by the picture's right edge, and therefore has fewer than 16
 * pixels. */
static inline void store_cut_row(const lanes values[5], uint32_t width, const picture_row *to)
{
    float words[COMP_PIXEL_WORDS][COMP_LANES];
    memcpy(words, values, sizeof words);
    for (uint32_t l = 0; l < width; l++) {
        for (int c = 0; c < 4; c++) to->rgba[4 * l + (uint32_t)c] = words[1 + c][l];
        if (to->depth) to->depth[l] = words[0][l];
    }
}

static void store_pixels(const comp_sheet *pixels, const comp_area *area, const float background[4], image *out)
{
    const float empty[5] = {INFINITY, background[0], background[1], background[2], background[3]};
    uint32_t bits[5];
    memcpy(bits, empty, sizeof bits);
    for (uint32_t r = 0; r < area->height; r++) {
        const size_t first = (size_t)(area->y + r) * (size_t)out->width + area->x;
        picture_row to = {out->rgba + 4 * first, out->depth ? out->depth + first : NULL, false};
        to.is_aligned = ((uintptr_t)to.rgba | (uintptr_t)to.depth) % sizeof(quad) == 0;
        const lanes is_there = mask_lanes(pixels->masks[r]);
        lanes values[5];
        for (int w = 0; w < COMP_PIXEL_WORDS; w++)
            values[w] = select_lanes(is_there, load_lanes(&pixels->words[w][r * COMP_LANES]), (lanes){0} + bits[w]);
        if (area->width == COMP_LANES)
            store_row(values, &to);
        else
            store_cut_row(values, area->width, &to);
    }
#if defined(__SSE2__)
    _mm_sfence();
#endif
}

#endif
