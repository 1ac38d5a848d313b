/* Properties of the cell types. Hexes, wedges and pyramids are called curved in the names of functions, because their
 * quadrilateral faces may be warped. No other file of render/ compares cell types: other files call the functions
 * below, and use tables that are indexed by kernel_shape_number() (kernel_shapes.h). */
#ifndef RENDER_KERNEL_CELL_TYPES_H
#define RENDER_KERNEL_CELL_TYPES_H

#include <stdbool.h>

#include "grid.h"

/* Returns true for tets: positions and the field are linear in the cell, and all faces are triangles. */
static inline bool kernel_is_linear(int type)
{
    return type == GRID_TET;
}

/* Returns true for polyhedra: each cell has its own list of faces (kernel_polyhedron.h). */
static inline bool kernel_has_own_faces(int type)
{
    return type == GRID_POLYHEDRON;
}

/* Returns true for pyramids, whose map contains a quotient that is singular at the apex (kernel_map.h). */
static inline bool kernel_has_apex(int type)
{
    return type == GRID_PYRAMID;
}

/* The types with quadrilateral faces, in the order in which all tables of these types have them. */
enum { KERNEL_CURVED_TYPES = 3 };
static const int kernel_curved_types[KERNEL_CURVED_TYPES] = {GRID_HEX, GRID_WEDGE, GRID_PYRAMID};

/* The types whose cells can be processed SIMD_WIDTH at a time, one per lane: those with quadrilateral faces, and
 * tets. */
enum { KERNEL_LANE_TYPES = KERNEL_CURVED_TYPES + 1 };
static const int kernel_lane_types[KERNEL_LANE_TYPES] = {GRID_HEX, GRID_WEDGE, GRID_PYRAMID, GRID_TET};

/* Indices of hexes, wedges and pyramids in kernel_curved_types. */
enum { KERNEL_SHAPE_HEX, KERNEL_SHAPE_WEDGE, KERNEL_SHAPE_PYRAMID };

/* Returns the index in kernel_curved_types of a type with quadrilateral faces. */
static inline int kernel_shape_number(int type)
{
    return type == GRID_HEX ? KERNEL_SHAPE_HEX : type == GRID_WEDGE ? KERNEL_SHAPE_WEDGE : KERNEL_SHAPE_PYRAMID;
}

/* Returns the position of a cell type in the list kernel_lane_types. */
static inline int kernel_lane_type_index(int type)
{
    return kernel_is_linear(type) ? KERNEL_CURVED_TYPES : kernel_shape_number(type);
}

/* Returns true for hexes: the reference domain is a box, and all faces are quads. */
static inline bool kernel_is_box(int type)
{
    return type == kernel_curved_types[KERNEL_SHAPE_HEX];
}

/* Returns true for wedges: the reference domain is a prism. */
static inline bool kernel_is_prism(int type)
{
    return type == kernel_curved_types[KERNEL_SHAPE_WEDGE];
}

/* Returns whether cells of a type with quadrilateral faces also have triangular faces. */
static inline bool kernel_has_triangles(int type)
{
    return !kernel_is_box(type);
}

/* Returns whether the type is a hex, wedge or pyramid: all its cells have quadrilateral faces. */
static inline bool kernel_has_quads(int type)
{
    return type == kernel_curved_types[kernel_shape_number(type)];
}

/* Expands to the first expression if the type is a hex, to the second if it is a wedge, and to the third if it is a
 * pyramid. */
#define KERNEL_BY_SHAPE(type, hex, wedge, pyramid)                                                                     \
    (kernel_shape_number(type) == KERNEL_SHAPE_HEX     ? (hex)                                                         \
     : kernel_shape_number(type) == KERNEL_SHAPE_WEDGE ? (wedge)                                                       \
                                                       : (pyramid))

#endif
