/* What the cells of each type have. No other file of render/ compares types: others look at properties here, and at
 * tables by kernel_shape_number() (kernel_shapes.h). */
#ifndef RENDER_KERNEL_CELL_TYPES_H
#define RENDER_KERNEL_CELL_TYPES_H

#include <stdbool.h>

#include "grid.h"

/* Tets: places and the field are linear in the cell, and its faces are triangles. */
static inline bool kernel_is_linear(int type)
{
    return type == GRID_TET;
}

/* Polyhedra: each cell has faces of its own (kernel_polyhedron.h). */
static inline bool kernel_has_own_faces(int type)
{
    return type == GRID_POLYHEDRON;
}

/* Pyramids: the map has a quotient (kernel_map.h). */
static inline bool kernel_has_apex(int type)
{
    return type == GRID_PYRAMID;
}

/* The types whose cells have quads, in the order of all tables of these. */
enum { KERNEL_CURVED_TYPES = 3 };
static const int kernel_curved_types[KERNEL_CURVED_TYPES] = {GRID_HEX, GRID_WEDGE, GRID_PYRAMID};

/* The types that are looked for in lanes: these, and tets. */
enum { KERNEL_LANE_TYPES = KERNEL_CURVED_TYPES + 1 };
static const int kernel_lane_types[KERNEL_LANE_TYPES] = {GRID_HEX, GRID_WEDGE, GRID_PYRAMID, GRID_TET};

/* The numbers of types in such tables, for switches. */
enum { KERNEL_SHAPE_HEX, KERNEL_SHAPE_WEDGE, KERNEL_SHAPE_PYRAMID };

/* The row of a type whose cells have quads in these tables. */
static inline int kernel_shape_number(int type)
{
    return type == GRID_HEX ? KERNEL_SHAPE_HEX : type == GRID_WEDGE ? KERNEL_SHAPE_WEDGE : KERNEL_SHAPE_PYRAMID;
}

/* Hexes: the domain is a box, and all faces are quads. */
static inline bool kernel_is_box(int type)
{
    return type == kernel_curved_types[KERNEL_SHAPE_HEX];
}

/* Wedges: the domain is a prism. */
static inline bool kernel_is_prism(int type)
{
    return type == kernel_curved_types[KERNEL_SHAPE_WEDGE];
}

/* Has a cell with quads triangles as well? */
static inline bool kernel_has_triangles(int type)
{
    return !kernel_is_box(type);
}

/* Are there quads among the faces of all of the type's cells? */
static inline bool kernel_has_quads(int type)
{
    return type == kernel_curved_types[kernel_shape_number(type)];
}

/* Chooses what is for hexes, wedges or pyramids. */
#define KERNEL_BY_SHAPE(type, hex, wedge, pyramid)                                                                     \
    (kernel_shape_number(type) == KERNEL_SHAPE_HEX     ? (hex)                                                         \
     : kernel_shape_number(type) == KERNEL_SHAPE_WEDGE ? (wedge)                                                       \
                                                       : (pyramid))

#endif
