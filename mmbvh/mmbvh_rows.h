/* Ranges of a lattice's cells, a row at a time: neighbours in a row share half of their vertices, and the values of a
 * row of vertices follow each other in memory. */
#ifndef MMBVH_ROWS_H
#define MMBVH_ROWS_H

#include "grid.h"

enum { ROWS_CELLS = 64 };

/* Cells side by side. */
typedef struct rows_ranges {
    int64_t first, count;
    float low[ROWS_CELLS], high[ROWS_CELLS]; /* rounded to float as a cast does */
    unsigned char is_finite[ROWS_CELLS];     /* 1: all values of the cell are; 0 beyond count, in its last eight */
} rows_ranges;

/* Tells whether rows_read() serves: cells follow each other along an axis of a lattice, with floats or doubles at their
 * vertices. */
bool rows_fit(const grid *g, const grid_field *field);

/* Reads the next cells of one row, from the given number on and before end, that are neither padding nor of ghost
 * layers. Flags of ghosts are not looked at. Returns false where there are none. */
bool rows_read(const grid *g, const grid_field *field, int64_t from, int64_t end, rows_ranges *out);

/* Finds the range of the values at all vertices, rounded to float as a cast does. Returns false if they do not follow
 * each other in memory, or some is not finite. */
bool rows_extent(const grid *g, const grid_field *field, float *low, float *high);

#endif
