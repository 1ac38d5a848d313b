/* Computes the ranges of the values of the cells of a lattice (structured grid), one row at a time. Neighbouring cells
 * of a row share half of their vertices, and the values of a row of vertices are contiguous in memory. */
#ifndef MMBVH_ROWS_H
#define MMBVH_ROWS_H

#include "grid.h"

enum { ROWS_CELLS = 64 };

/* The ranges of neighbouring cells of one row. */
typedef struct rows_ranges {
    int64_t first, count;
    float low[ROWS_CELLS], high[ROWS_CELLS]; /* range of each cell's values, rounded to the nearest float */
    unsigned char is_finite[ROWS_CELLS]; /* 1 if all values of the cell are finite, otherwise 0; entries from `count` to
                                            the next multiple of 8 are 0 */
} rows_ranges;

/* Returns whether rows_compute_cell_ranges() can read the grid and field: cells with consecutive indices must be
 * neighbours along an axis of a lattice, and the values must be floats or doubles at vertices. */
bool rows_can_read(const grid *g, const grid_field *field);

/* Searches the cells with indices from `from` to `end` - 1 for the first drawn cell. Computes the ranges of this cell
 * and of the drawn cells that follow it in its row, at most ROWS_CELLS cells in all. Cells in the padding and in ghost
 * layers are skipped, but ghost flags are not checked. Returns false if there are no such cells. */
bool rows_compute_cell_ranges(const grid *g, const grid_field *field, int64_t from, int64_t end, rows_ranges *out);

/* Computes the range of the values at all vertices, rounded to the nearest float. Returns false if the values are not
 * contiguous in memory, or one of them is not finite. */
bool rows_compute_total_range(const grid *g, const grid_field *field, float *low, float *high);

#endif
