/* Inline code that packs and unpacks the rows of sheets. It is compiled once per instruction set. */
#ifndef COMP_COMP_SHEET_ROWS_H
#define COMP_COMP_SHEET_ROWS_H

#include "comp_lanes.h"
#include "comp_sheet_loops.h"

/* The methods of storing a word. WORD_LINEAR predicts each value by linear extrapolation from the two rows above, and
 * WORD_CONSTANT as equal to the row above. WORD_UNIFORM stores one value for all pixels. WORD_REPEATED stores nothing,
 * because the word equals the preceding word. */
enum word_kind { WORD_LINEAR, WORD_CONSTANT, WORD_UNIFORM, WORD_REPEATED };

/* Returns the nearest lane below `lane` whose bit in the mask `known` is set. If there is none, returns the lowest lane
 * whose bit is set. */
static uint8_t find_nearest_lane(unsigned known, int lane)
{
    const unsigned left = known & ((1u << lane) - 1);
    return (uint8_t)(left ? 31 - __builtin_clz(left) : __builtin_ctz(known));
}

/* Sets plan->fresh, for each row, to the lanes that have a pixel in this row but none in the rows above, and
 * plan->source to the lanes from whose values those of the fresh lanes are predicted. */
static void find_lanes_without_predecessor(sheet_plan *plan)
{
    unsigned known = plan->mask[0];
    plan->fresh[0] = 0;
    for (int i = 1; i < plan->rows; i++) {
        plan->fresh[i] = (uint16_t)(plan->mask[i] & ~known);
        for (unsigned left = plan->fresh[i]; left; left &= left - 1) {
            const int lane = __builtin_ctz(left);
            plan->source[i][lane] = find_nearest_lane(known, lane);
        }
        known |= plan->mask[i];
    }
}

static void make_plan(const uint16_t masks[COMP_ROWS], sheet_plan *plan)
{
    plan->rows = plan->count = 0;
    for (int r = 0; r < COMP_ROWS; r++) {
        const int i = plan->rows;
        plan->row[i] = (uint8_t)r;
        plan->mask[i] = masks[r];
        plan->number[i] = (uint8_t)__builtin_popcount(masks[r]);
        plan->count += plan->number[i];
        plan->rows += masks[r] != 0;
    }
    plan->is_sparse = 2 * plan->count < plan->rows * COMP_LANES;
    if (plan->rows && !plan->is_sparse) find_lanes_without_predecessor(plan);
}

/* The state of the prediction for each lane. last: the value of the nearest row above that has a pixel in the lane;
 * slope: the difference between `last` and the value before it. */
typedef struct prediction {
    lanes last, slope;
} prediction;

ROWS_INLINE void predict_lanes_without_predecessor(const sheet_plan *plan, int i, prediction *f)
{
    for (unsigned left = plan->fresh[i]; left; left &= left - 1) {
        const int lane = __builtin_ctz(left);
        f->last[lane] = f->last[plan->source[i][lane]];
        f->slope[lane] = 0;
    }
}

/* Zigzag encoding: maps signed integers near 0 to small unsigned ones. */
ROWS_INLINE lanes zigzag_encode(lanes value)
{
    return value << 1 ^ (lanes)((signed_lanes)value >> 31);
}

ROWS_INLINE lanes zigzag_decode(lanes value)
{
    return value >> 1 ^ -(value & 1);
}

/* Updates the prediction with the values of a row. In fresh lanes, which have no value in an earlier row, the slope
 * stays 0. */
ROWS_INLINE void update_prediction(prediction *f, lanes values, unsigned mask, unsigned fresh)
{
    const lanes step = values - f->last;
    if (mask == 0xffff && !fresh) {
        f->slope = step;
        f->last = values;
        return;
    }
    f->slope = select_lanes(mask_lanes(mask & ~fresh), step, f->slope);
    f->last = select_lanes(mask_lanes(mask), values, f->last);
}

ROWS_INLINE void start_prediction(prediction *f, lanes values)
{
    f->last = values;
    f->slope = (lanes){0};
}

/* ---- packing residuals by their number of nibbles --------------------------------------------------------------- */

static inline unsigned count_nibbles(uint32_t greatest)
{
    return greatest ? (35 - (unsigned)__builtin_clz(greatest)) / 4 : 0;
}

/* Returns the number of bytes of `count` residuals with `nibbles` nibbles each. A residual is stored in up to three
 * arrays: its 2-byte part, its 1-byte part and its half-byte part. A part exists if its bit (4, 2 or 1) is set in
 * `nibbles`. Residuals of 8 nibbles are stored as they are. In the array of half bytes, lanes i and i + 8 share a
 * byte. */
static inline size_t packed_bytes(unsigned nibbles, int count)
{
    const int pairs = count < COMP_LANES / 2 ? count : COMP_LANES / 2;
    if (nibbles == 8) return 4 * (size_t)count;
    return (nibbles & 4) / 2 * (size_t)count + (nibbles & 2) / 2 * (size_t)count + (nibbles & 1) * (size_t)pairs;
}

/* Packs the first `count` residuals; the other lanes must be 0. */
ROWS_INLINE unsigned char *pack_residuals(lanes residuals, unsigned nibbles, int count, unsigned char *out)
{
    if (nibbles == 8) {
        memcpy(out, &residuals, sizeof residuals);
        return out + 4 * (size_t)count;
    }
    const int pairs = count < COMP_LANES / 2 ? count : COMP_LANES / 2;
    const two_byte_lanes twos = __builtin_convertvector(residuals, two_byte_lanes);
    const lanes behind_twos = residuals >> (nibbles & 4) * 4;
    const byte_lanes ones = __builtin_convertvector(behind_twos, byte_lanes);
    const byte_lanes half = __builtin_convertvector(behind_twos >> (nibbles & 2) * 4, byte_lanes);
    uint64_t low, high;
    memcpy(&low, &half, sizeof low);
    memcpy(&high, (const unsigned char *)&half + sizeof low, sizeof high);
    low |= high << 4; /* the shift and OR pack two half bytes into one byte; lanes from `count` on are 0, so that
                         the OR leaves the other half byte unchanged */
    memcpy(out, &twos, sizeof twos);
    out += (nibbles & 4) / 2 * (size_t)count;
    memcpy(out, &ones, sizeof ones);
    out += (nibbles & 2) / 2 * (size_t)count;
    memcpy(out, &low, sizeof low);
    return out + (nibbles & 1) * (size_t)pairs;
}

/* Unpacks `count` residuals; the other lanes are undefined. */
ROWS_INLINE const unsigned char *unpack_residuals(const unsigned char *in, unsigned nibbles, int count,
                                                  lanes *residuals)
{
    if (nibbles == 8) {
        memcpy(residuals, in, sizeof *residuals);
        return in + 4 * (size_t)count;
    }
    const int pairs = count < COMP_LANES / 2 ? count : COMP_LANES / 2;
    const unsigned behind_twos = (nibbles & 4) * 4, behind_ones = behind_twos + (nibbles & 2) * 4;
    two_byte_lanes twos;
    byte_lanes ones, half;
    uint64_t pair[2];
    memcpy(&twos, in, sizeof twos);
    in += (nibbles & 4) / 2 * (size_t)count;
    memcpy(&ones, in, sizeof ones);
    in += (nibbles & 2) / 2 * (size_t)count;
    memcpy(&pair[0], in, sizeof pair[0]);
    pair[1] = pair[0] >> 4 & 0x0f0f0f0f0f0f0f0fu;
    pair[0] &= 0x0f0f0f0f0f0f0f0fu;
    memcpy(&half, pair, sizeof half);
    *residuals = (__builtin_convertvector(twos, lanes) & (nibbles & 4 ? 0xffffu : 0)) |
                 (__builtin_convertvector(ones, lanes) & (nibbles & 2 ? 0xffu : 0)) << behind_twos |
                 (__builtin_convertvector(half, lanes) & (nibbles & 1 ? 15u : 0)) << behind_ones;
    return in + (nibbles & 1) * (size_t)pairs;
}

/* Moves the lanes whose bits are set in the mask to the front, without changing their order, and sets the lanes behind
 * them to 0. */
ROWS_INLINE lanes compress_lanes(lanes from, unsigned mask)
{
#if defined(__AVX512F__)
    return (lanes)_mm512_maskz_compress_epi32((__mmask16)mask, (__m512i)from);
#endif
    uint32_t gapped[COMP_LANES], compact[COMP_LANES] = {0};
    store_lanes(gapped, from);
    for (int n = 0; mask; mask &= mask - 1) compact[n++] = gapped[__builtin_ctz(mask)];
    return load_lanes(compact);
}

ROWS_INLINE lanes expand_lanes(lanes from, unsigned mask)
{
#if defined(__AVX512F__)
    return (lanes)_mm512_maskz_expand_epi32((__mmask16)mask, (__m512i)from);
#endif
    uint32_t gapped[COMP_LANES] = {0}, compact[COMP_LANES];
    store_lanes(compact, from);
    for (int n = 0; mask; mask &= mask - 1) gapped[__builtin_ctz(mask)] = compact[n++];
    return load_lanes(gapped);
}

/* compress_row() stores the values of a row whose bits are set in the mask, without gaps. expand_row() reverses this:
 * it moves such values back to the positions of the mask's bits. Both may read all 16 values of their input and write
 * all 16 values of their output. */
ROWS_INLINE void compress_row(const uint32_t *row, unsigned mask, uint32_t *to)
{
#if defined(__AVX512F__)
    store_lanes(to, compress_lanes(load_lanes(row), mask));
#else
    for (; mask; mask &= mask - 1) *to++ = row[__builtin_ctz(mask)];
#endif
}

ROWS_INLINE void expand_row(const uint32_t *from, unsigned mask, uint32_t *row)
{
#if defined(__AVX512F__)
    store_lanes(row, expand_lanes(load_lanes(from), mask));
#else
    for (; mask; mask &= mask - 1) row[__builtin_ctz(mask)] = *from++;
#endif
}

static void compress_sheet(const comp_sheet *sheet, const sheet_plan *plan, int words, comp_sheet *compact)
{
    for (int w = 0; w < words; w++) {
        uint32_t gathered[COMP_STRIP_PIXELS + COMP_LANES], *to = gathered;
        for (int i = 0; i < plan->rows; i++) {
            compress_row(&sheet->words[w][plan->row[i] * COMP_LANES], plan->mask[i], to);
            to += plan->number[i];
        }
        memcpy(compact->words[w], gathered, (size_t)plan->count * sizeof *gathered);
    }
}

static void expand_sheet(const comp_sheet *compact, const sheet_plan *plan, int words, comp_sheet *sheet)
{
    for (int w = 0; w < words; w++) {
        const uint32_t *from = compact->words[w];
        for (int i = 0; i < plan->rows; i++) {
            expand_row(from, plan->mask[i], &sheet->words[w][plan->row[i] * COMP_LANES]);
            from += plan->number[i];
        }
    }
}

/* ---- packing sheets --------------------------------------------------------------------------------------------- */

/* The residuals of a word, and their number of nibbles, for each prediction (WORD_LINEAR or WORD_CONSTANT) and each
 * row. */
typedef struct word_residuals {
    lanes rows[2][COMP_ROWS];
    uint8_t nibbles[2][COMP_ROWS];
} word_residuals;

/* Returns the residuals of the first row. Each value of this row is predicted from its left neighbour. */
ROWS_INLINE lanes compute_first_row_residuals(lanes values, unsigned mask)
{
    uint32_t own[COMP_LANES + 1];
    const lanes compact = mask == 0xffff ? values : compress_lanes(values, mask);
    own[0] = compact[0];
    store_lanes(own + 1, compact);
    return zigzag_encode(compact - load_lanes(own)) & mask_lanes((1u << __builtin_popcount(mask)) - 1);
}

/* Computes the residuals of both predictions; returns the one that takes fewer bytes. */
ROWS_INLINE enum word_kind choose_word_prediction(const uint32_t *words, const sheet_plan *plan, word_residuals *out)
{
    prediction f;
    size_t bytes[2] = {0, 0};
    for (int i = 0; i < plan->rows; i++) {
        const lanes values = load_lanes(words + plan->row[i] * COMP_LANES);
        const unsigned mask = plan->mask[i];
        lanes above, line;
        if (i) {
            if (plan->fresh[i]) predict_lanes_without_predecessor(plan, i, &f);
            above = zigzag_encode(values - f.last);
            line = zigzag_encode(values - f.last - f.slope);
            if (mask != 0xffff) above = compress_lanes(above, mask);
            if (mask != 0xffff) line = compress_lanes(line, mask);
            update_prediction(&f, values, mask, plan->fresh[i]);
        } else {
            above = line = compute_first_row_residuals(values, mask);
            start_prediction(&f, values);
        }
        out->rows[WORD_CONSTANT][i] = above;
        out->rows[WORD_LINEAR][i] = line;
        for (int predictor = 0; predictor < 2; predictor++) {
            out->nibbles[predictor][i] = (uint8_t)count_nibbles(or_all_lanes(out->rows[predictor][i]));
            bytes[predictor] += packed_bytes(out->nibbles[predictor][i], plan->number[i]);
        }
    }
    return bytes[WORD_CONSTANT] < bytes[WORD_LINEAR] ? WORD_CONSTANT : WORD_LINEAR;
}

ROWS_INLINE unsigned char *write_word(const uint32_t *words, const sheet_plan *plan, enum word_kind *kind,
                                      unsigned char *out)
{
    word_residuals residuals;
    *kind = choose_word_prediction(words, plan, &residuals);
    const uint8_t *nibbles = residuals.nibbles[*kind];
    for (int i = 0; i < plan->rows; i += 2)
        *out++ = (unsigned char)(nibbles[i] | (i + 1 < plan->rows ? nibbles[i + 1] : 0) << 4);
    for (int i = 0; i < plan->rows; i++)
        out = pack_residuals(residuals.rows[*kind][i], nibbles[i], plan->number[i], out);
    return out;
}

/* Returns how a word is stored. The result is WORD_UNIFORM if all pixels have the first pixel's value, and
 * WORD_REPEATED if the word equals the preceding word in all pixels. Otherwise it is WORD_LINEAR, although the caller
 * may then choose WORD_CONSTANT instead, if it takes fewer bytes. */
ROWS_INLINE enum word_kind choose_word_kind(const comp_sheet *sheet, const sheet_plan *plan, int word, uint32_t first)
{
    const uint32_t *own = sheet->words[word], *before = sheet->words[word ? word - 1 : 0];
    lanes others = {0}, next = {0};
    for (int i = 0; i < plan->rows; i++) {
        const lanes values = load_lanes(own + plan->row[i] * COMP_LANES), is_there = mask_lanes(plan->mask[i]);
        others |= (values ^ first) & is_there;
        next |= (values ^ load_lanes(before + plan->row[i] * COMP_LANES)) & is_there;
    }
    if (!or_all_lanes(others)) return WORD_UNIFORM;
    return word && !or_all_lanes(next) ? WORD_REPEATED : WORD_LINEAR;
}

static unsigned char *write_words(const comp_sheet *sheet, const sheet_plan *plan, int words, uint32_t *kinds,
                                  unsigned char *out)
{
    const int first = plan->row[0] * COMP_LANES + __builtin_ctz(plan->mask[0]);
    *kinds = 0;
    for (int w = 0; w < words; w++) {
        enum word_kind kind = choose_word_kind(sheet, plan, w, sheet->words[w][first]);
        if (kind != WORD_REPEATED) {
            memcpy(out, &sheet->words[w][first], sizeof(uint32_t));
            out += sizeof(uint32_t);
        }
        if (kind == WORD_LINEAR) out = write_word(sheet->words[w], plan, &kind, out);
        *kinds |= (uint32_t)kind << 2 * w;
    }
    return out;
}

/* ---- unpacking sheets ------------------------------------------------------------------------------------------- */

ROWS_INLINE lanes read_first(lanes residuals, unsigned mask, uint32_t value)
{
    uint32_t steps[COMP_LANES];
    const int count = __builtin_popcount(mask);
    store_lanes(steps, zigzag_decode(residuals));
    for (int n = 0; n < count; n++) steps[n] = value += steps[n];
    return mask == 0xffff ? load_lanes(steps) : expand_lanes(load_lanes(steps), mask);
}

ROWS_INLINE const unsigned char *read_word(const unsigned char *in, const sheet_plan *plan, bool has_slope,
                                           uint32_t value, uint32_t *words)
{
    prediction f;
    const unsigned char *const nibbles = in;
    const uint32_t slopes = has_slope ? 0xffffffffu : 0;
    in += (plan->rows + 1) / 2;
    for (int i = 0; i < plan->rows; i++) {
        const unsigned mask = plan->mask[i];
        lanes residuals, values;
        in = unpack_residuals(in, nibbles[i / 2] >> (i & 1) * 4 & 15, plan->number[i], &residuals);
        if (i) {
            if (mask != 0xffff) residuals = expand_lanes(residuals, mask);
            if (plan->fresh[i]) predict_lanes_without_predecessor(plan, i, &f);
            values = f.last + (f.slope & slopes) + zigzag_decode(residuals);
            update_prediction(&f, values, mask, plan->fresh[i]);
        } else {
            values = read_first(residuals, mask, value);
            start_prediction(&f, values);
        }
        store_lanes(words + plan->row[i] * COMP_LANES, values);
    }
    return in;
}

ROWS_INLINE void fill_sheet_word(const sheet_plan *plan, uint32_t value, uint32_t *words)
{
    const lanes values = (lanes){0} + value;
    for (int i = 0; i < plan->rows; i++) store_lanes(words + plan->row[i] * COMP_LANES, values);
}

static const unsigned char *read_words(const unsigned char *in, const sheet_plan *plan, uint32_t kinds, int words,
                                       comp_sheet *out)
{
    for (int w = 0; w < words; w++) {
        const enum word_kind kind = (enum word_kind)(kinds >> 2 * w & 3);
        uint32_t value;
        if (kind == WORD_REPEATED) {
            memcpy(out->words[w], out->words[w - 1], sizeof out->words[w]);
            continue;
        }
        memcpy(&value, in, sizeof value);
        in += sizeof value;
        if (kind == WORD_UNIFORM)
            fill_sheet_word(plan, value, out->words[w]);
        else
            in = read_word(in, plan, kind == WORD_LINEAR, value, out->words[w]);
    }
    return in;
}

#endif
