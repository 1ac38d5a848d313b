/* Computes sums of fractions in fixed point, which are the same for any order of summation, and histograms of such
 * sums. A fraction is multiplied by 2^52 and rounded to an integer. This integer is divided by 2^28. A sum consists of
 * two words: the sum of the quotients (rounded down), and the sum of the remainders. Therefore 2^34 fractions can be
 * added without overflow. */
#ifndef SESSION_FIXED_SUMS_H
#define SESSION_FIXED_SUMS_H

#include <math.h>
#include <stdint.h>

enum { FIXED_LOW_BITS = 28, SESSION_MAX_BINS = 256 };

static inline void add_fixed_point(int64_t sum[2], double fraction)
{
    const int64_t whole = llrint(fraction * 0x1p52);
    sum[0] += whole >> FIXED_LOW_BITS;
    sum[1] += whole & ((1 << FIXED_LOW_BITS) - 1);
}

static inline double sum_from_fixed_point(const int64_t sum[2])
{
    return ((double)sum[0] * (1 << FIXED_LOW_BITS) + (double)sum[1]) * 0x1p-52;
}

/* Returns a value's position in the range, 0 at low and 1 at high; 0 if the range has no width. The computation does
 * not overflow. */
static inline double position_in_range(double value, double low, double high)
{
    return high > low ? (0.5 * value - 0.5 * low) / (0.5 * high - 0.5 * low) : 0;
}

/* Returns the value's position in the range, 0 at low and 1 at high, limited to 0 .. 1. */
static inline double clamped_position_in_range(double value, double low, double high)
{
    return fmin(fmax(position_in_range(value, low, high), 0), 1);
}

/* The bins of a histogram, which have equal widths. */
typedef struct session_bins {
    int count; /* at most SESSION_MAX_BINS */
    double low, high;
} session_bins;

/* Returns the bin of a value; values outside the range of the bins belong to the first or the last bin. */
static inline int find_nearest_bin(const session_bins *bins, double value)
{
    return (int)fmin(clamped_position_in_range(value, bins->low, bins->high) * bins->count, bins->count - 1);
}

/* Returns the bin of a value, or -1 if the value is outside the range of the bins. */
static inline int find_bin(const session_bins *bins, double value)
{
    return value < bins->low || value > bins->high ? -1 : find_nearest_bin(bins, value);
}

#endif
