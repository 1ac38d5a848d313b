/* Cells of one type in lanes, eight at once, for the check of a mesh: whether their indices are in range, their bounds,
 * volumes and sizes. Knows grids alone.
 *
 * The loops (session_lane_loops.c) are compiled once an instruction set. Sums are the same to the bit for all of them:
 * each of eight lanes has its own, and nothing is fused. */
#ifndef SESSION_LANES_H
#define SESSION_LANES_H

#include "cpu.h"
#include "grid.h"

enum { LANES = 8 };

/* Cells side by side, whose vertices follow each other in the connectivity. */
typedef struct lane_cells {
    const grid *g; /* coordinates all of floats or all of doubles, of one stride */
    int type;      /* tet, hex, wedge or pyramid */
    int64_t first, count;
    int64_t entry; /* the first cell's first vertex in the connectivity */
} lane_cells;

typedef struct lane_sums {
    double lower[3], upper[3];
    double least; /* volume without its sign */
    double sizes; /* cube roots of volumes */
    int64_t inverted;
} lane_sums;

/* Adds up the first so many cells, a multiple of eight, and returns how many. *alone tells how many of those next are
 * to be looked at one by one, because something is unusual about one of them: an index out of range, a ghost, a volume
 * that has no usual root (as where a coordinate is not finite: each is in a product of it, and what is not finite
 * stays so) or that there are less than eight. Bounds may then hold vertices of those cells, unless they are ghosts. */
typedef int64_t lane_run(const lane_cells *cells, lane_sums *sums, int64_t *alone);

/* The run for the type and the grid's layout. NULL: cells are of another type. */
lane_run *session_lanes_of(cpu_isa isa, const grid *g, int type);

/* ---- for session_lanes.c ------------------------------------------------------------------------------------- */

enum { LANE_TETS, LANE_HEXES, LANE_WEDGES, LANE_PYRAMIDS, LANE_TYPES };

typedef struct lane_loops {
    lane_run *runs[LANE_TYPES][2][2]; /* by whether indices and whether coordinates are of 8 bytes */
} lane_loops;

extern const lane_loops session_lanes_plain, session_lanes_avx2, session_lanes_avx512;

#endif
