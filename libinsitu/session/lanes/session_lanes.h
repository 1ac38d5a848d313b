/* Cells of one type in lanes, eight at once, for the check of a mesh: whether their indices are in range, their bounds,
 * volumes and sizes. It depends only on grids.
 *
 * The loops (session_lane_loops.c) are compiled once per instruction set. Sums have the same bits for all of them: each
 * of eight lanes has its own sum, and no multiply-add is fused. */
#ifndef SESSION_LANES_H
#define SESSION_LANES_H

#include "cpu.h"
#include "grid.h"

enum { LANES = 8 };

/* Consecutive cells, whose vertices are contiguous in the connectivity. */
typedef struct lane_cells {
    const grid *g; /* coordinates are all floats or all doubles, with one stride */
    int type;      /* tet, hex, wedge or pyramid */
    int64_t first, count;
    int64_t entry; /* index of the first cell's first vertex in the connectivity */
} lane_cells;

typedef struct lane_sums {
    double lower[3], upper[3];
    double least; /* least absolute volume */
    double sizes; /* sum of the cube roots of volumes */
    int64_t inverted;
} lane_sums;

/* Sums up the first cells, a multiple of eight, and returns their number. *alone: number of following cells that must
 * be checked one by one, because one of them is unusual: an index out of range, a ghost, a volume without a usual root
 * (also if a coordinate is not finite, as each is a factor of the volume), or because fewer than eight are left. Bounds
 * may then include vertices of those cells, unless they are ghosts. */
typedef int64_t lane_run(const lane_cells *cells, lane_sums *sums, int64_t *alone);

/* Returns the run for the type and the grid's layout; NULL if cells are of another type. */
lane_run *session_lanes_of(cpu_isa isa, const grid *g, int type);

/* ---- for session_lanes.c ------------------------------------------------------------------------------------- */

enum { LANE_TETS, LANE_HEXES, LANE_WEDGES, LANE_PYRAMIDS, LANE_TYPES };

typedef struct lane_loops {
    lane_run *runs[LANE_TYPES][2][2]; /* by whether indices have 8 bytes and whether coordinates have 8 bytes */
} lane_loops;

extern const lane_loops session_lanes_plain, session_lanes_avx2, session_lanes_avx512;

#endif
