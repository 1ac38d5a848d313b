/* Sorts points into cubic bins, so that the points near a box are found quickly. N points are divided into sqrt(N) / 2
 * bins, but at least 1 and at most 128, along the longest side of their bounding box. Therefore, below this limit, bins
 * that intersect a surface of evenly spaced points contain a few points each. */
#ifndef SESSION_BINS_H
#define SESSION_BINS_H

#include <stdbool.h>
#include <stdint.h>

typedef struct session_bins {
    double lower[3], bins_per_length; /* lower corner of the bins, and the number of bins per unit of length */
    int64_t counts[3];                /* number of bins along each axis */
    int64_t *starts, *items; /* items: indices of the points, sorted by bin; those of bin b are items[starts[b]] ..
                                items[starts[b + 1] - 1] */
} session_bins;

/* Sorts `count` points into bins. The coordinates x, y, z of the first point are at `positions`; those of consecutive
 * points are `stride` bytes apart. Returns false if memory runs out. */
bool session_bins_create(session_bins *bins, const double *positions, int64_t stride, int64_t count);
void session_bins_free(session_bins *bins);

/* Iterator over the points near a box. It visits all points inside the box, and some outside.
 *
 *     session_bin_walk walk = session_begin_bin_walk(&bins, lower, upper, margin);
 *     while (session_next_point_in_bins(&walk, &point)) ... */
typedef struct session_bin_walk {
    const session_bins *bins;
    int64_t first_bin[3], last_bin[3]; /* range of bins that the box touches, along each axis */
    /* indices of the first bin of the row that is visited; rows of bins extend along the first axis */
    int64_t bin[3];
    /* range, in session_bins.items, of the points of the current row that have not been visited */
    int64_t next, end;
} session_bin_walk;

session_bin_walk session_begin_bin_walk(const session_bins *bins, const double lower[3], const double upper[3],
                                        double margin);
bool session_next_point_in_bins(session_bin_walk *walk, int64_t *point);

#endif
