/* Processes cells of one type with vector instructions, eight cells at a time, when a mesh is checked. It tests whether
 * the cells' vertex indices are in range, and computes the bounds, volumes and sizes of the cells. This module depends
 * only on grids.
 *
 * The loops (session_lane_loops.c) are compiled once per instruction set. Sums are bit-identical for all instruction
 * sets: there is one sum for each of the eight lanes, and fused multiply-add instructions are not used. */
#ifndef SESSION_LANES_H
#define SESSION_LANES_H

#include "cpu.h"
#include "grid.h"

enum { LANES = 8 };

/* Cells with consecutive indices, whose vertices are contiguous in the connectivity. */
typedef struct lane_cells {
    const grid *g;        /* the grid; its coordinates are all floats or all doubles, and have one stride */
    int type;             /* type of the cells: tet, hex, wedge or pyramid */
    int64_t first, count; /* index of the first cell, and number of cells */
    int64_t first_entry;  /* index of the first cell's first entry in the connectivity */
} lane_cells;

typedef struct lane_sums {
    double lower[3], upper[3]; /* bounds of the vertices */
    double least;              /* smallest absolute volume of the cells */
    double size_sum;           /* sum of the cube roots of the absolute volumes */
    int64_t inverted_count;    /* number of cells with a negative volume */
} lane_sums;

/* Processes cells from the first one on, until a cell needs a check that this function cannot do, and stores the sums
 * over the processed cells. Returns their number, a multiple of eight. *scalar_count receives the number of cells after
 * these, at most eight, that the caller must check one by one: one of them has an index out of range, is a ghost, or
 * has a volume whose cube root cannot be computed here (also if a coordinate is not finite), or fewer than eight cells
 * are left. The stored bounds may include vertices of the cells to check, unless they are ghosts. */
typedef int64_t lane_run(const lane_cells *cells, lane_sums *sums, int64_t *scalar_count);

/* Returns the function for cells of this type, and for the element sizes of the grid's arrays of indices and
 * coordinates; NULL if there is none for the type. */
lane_run *session_get_cell_loop_for_type(cpu_isa isa, const grid *g, int type);

/* ---- tables of functions, for session_lanes.c ---------------------------------------------------------------- */

enum { LANE_TETS, LANE_HEXES, LANE_WEDGES, LANE_PYRAMIDS, LANE_TYPES };

typedef struct lane_loops {
    /* indexed by the type of cells, by whether indices have 8 bytes, and by whether coordinates have 8 bytes */
    lane_run *runs[LANE_TYPES][2][2];
} lane_loops;

extern const lane_loops session_lanes_plain, session_lanes_avx2, session_lanes_avx512;

#endif
