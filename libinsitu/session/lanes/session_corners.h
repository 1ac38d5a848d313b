/* Defines constants for the vectorized computation of cells' volumes and sizes: the corners from which a volume is
 * computed, and the first approximation of its cube root. The cube root of a cell's volume is called the cell's size.
 */
#ifndef SESSION_CORNERS_H
#define SESSION_CORNERS_H

#include "grid.h"

/* The corners of a type of cell, each with its three neighbours in right-handed order. The volume of a cell is computed
 * as follows: for each listed corner, take six times the volume of the tet that it forms with its neighbours, add these
 * up, and divide by volume_factor. The result is exact if opposite edges are parallel; otherwise it is a mean over the
 * ways to divide the cell into tets. */
typedef struct cell_corners {
    const signed char (*corners)[4];
    int count; /* number of corners in the list */
    /* divisor in the formula above: the sum over the listed corners, of six times the volumes of the tets, for a cell
     * of volume 1 */
    double volume_factor;
} cell_corners;

/* Constants of the first approximation of a double's cube root. Its upper 32 bits are a third of the upper 32 bits of
 * the double, plus an offset. Its relative error is at most 0.033, because the bits of a double, as an integer,
 * approximate its base-2 logarithm to within 0.09. Each step of Halley's method roughly cubes the relative error, to
 * 2.1e-5 after one step and 6.5e-15 after two. The offset is two thirds of the upper 32 bits of 1.0, less a correction
 * for the mantissa. */
enum { CUBE_ROOT_THIRD = 0x55555556, CUBE_ROOT_OFFSET = 0x2a9f7893, CUBE_ROOT_STEPS = 2 };

static inline __attribute__((always_inline)) cell_corners get_corners_of_cell_type(int type)
{
    static const signed char tet[][4] = {{0, 1, 2, 3}};
    static const signed char hex[][4] = {{0, 1, 3, 4}, {1, 2, 0, 5}, {2, 3, 1, 6}, {3, 0, 2, 7},
                                         {4, 7, 5, 0}, {5, 4, 6, 1}, {6, 5, 7, 2}, {7, 6, 4, 3}};
    static const signed char wedge[][4] = {{0, 1, 2, 3}, {1, 2, 0, 4}, {2, 0, 1, 5},
                                           {3, 5, 4, 0}, {4, 3, 5, 1}, {5, 4, 3, 2}};
    static const signed char pyramid[][4] = {{0, 1, 3, 4}, {1, 2, 0, 4}, {2, 3, 1, 4}, {3, 0, 2, 4}};
    if (type == GRID_TET) return (cell_corners){tet, 1, 6};
    if (type == GRID_HEX) return (cell_corners){hex, 8, 8};
    return type == GRID_WEDGE ? (cell_corners){wedge, 6, 12} : (cell_corners){pyramid, 4, 12};
}

#endif
