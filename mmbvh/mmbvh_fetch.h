/* Fast access to cells. The accessors of grid.h check the element type of an array at every element. Here the types are
 * constant parameters of inlined functions, so that they are checked only one time in a pass over the cells. */
#ifndef MMBVH_FETCH_H
#define MMBVH_FETCH_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "mmbvh_vec4.h"

#define MMBVH_INLINE static inline __attribute__((always_inline))

/* The five cases of how a cell's vertices are found: all cells are tets, all are hexes, all have the same other type,
 * cells have different types, or the cells form a lattice (a structured grid). */
typedef enum fetch_shape {
    FETCH_TETS,
    FETCH_HEXES,
    FETCH_UNIFORM,
    FETCH_BY_CELL,
    FETCH_LATTICE,
    FETCH_SHAPES
} fetch_shape;

static inline fetch_shape fetch_grid_shape(const grid *g)
{
    if (g->lattice) return FETCH_LATTICE;
    if (g->cell_types || g->offsets.data) return FETCH_BY_CELL;
    if (g->cell_type == GRID_TET) return FETCH_TETS;
    return g->cell_type == GRID_HEX ? FETCH_HEXES : FETCH_UNIFORM;
}

MMBVH_INLINE int64_t fetch_index(const grid_array *a, int64_t i, const bool wide)
{
    const char *p = a->data + i * a->stride;
    return (wide ? *(const int64_t *)(const void *)p : (int64_t) * (const int32_t *)(const void *)p) - a->base;
}

/* Reads an element of an array of floats or doubles. */
MMBVH_INLINE double fetch_number(const grid_array *a, int64_t i, const bool wide)
{
    const char *p = a->data + i * a->stride;
    return wide ? *(const double *)(const void *)p : (double)*(const float *)(const void *)p;
}

MMBVH_INLINE int fetch_vertex_count(const grid *g, int64_t cell, const fetch_shape shape)
{
    if (shape == FETCH_TETS) return 4;
    if (shape == FETCH_HEXES) return 8;
    if (shape == FETCH_LATTICE) return g->cell_type == GRID_HEX ? 8 : 4;
    return grid_type_vertex_count(shape == FETCH_BY_CELL ? grid_cell_type(g, cell) : g->cell_type);
}

/* Returns the index of a cell's first entry in the connectivity. A lattice has no connectivity; for a lattice, returns
 * the index of the cell's first vertex. */
MMBVH_INLINE int64_t fetch_first_entry(const grid *g, int64_t cell, int count, const fetch_shape shape)
{
    if (shape == FETCH_LATTICE) return grid_lattice_first_vertex(g->lattice, cell);
    return shape == FETCH_BY_CELL && g->offsets.data ? grid_read_index(&g->offsets, cell) : cell * count;
}

/* Returns the index of the cell's vertex i. `first` is the result of fetch_first_entry() for the cell. */
MMBVH_INLINE int64_t fetch_vertex(const grid *g, int64_t first, int i, const fetch_shape shape, const bool wide_index)
{
    return shape == FETCH_LATTICE ? first + g->lattice->corner_offsets[i]
                                  : fetch_index(&g->connectivity, first + i, wide_index);
}

/* Prefetches the connectivity of a cell whose first entry is `first`. A lattice has no connectivity. */
MMBVH_INLINE void prefetch_connectivity(const grid *g, int64_t first, const fetch_shape shape)
{
    if (shape != FETCH_LATTICE) __builtin_prefetch(g->connectivity.data + first * g->connectivity.stride);
}

/* Prefetches the connectivity of a later cell, in a pass over the cells in the mesh's order. The hardware prefetcher is
 * too late, although the accesses are regular. */
MMBVH_INLINE void prefetch_later_cell(const grid *g, int64_t cell, const fetch_shape shape)
{
    enum { AHEAD = 512 }; /* prefetch distance in entries of the connectivity */
    if (shape == FETCH_LATTICE) return;
    prefetch_connectivity(g, fetch_first_entry(g, cell, fetch_vertex_count(g, cell, shape), shape) + AHEAD, shape);
}

/* Returns whether the elements of an array follow each other without gaps. The stride is then the size of an element,
 * which is a constant in specialized code. */
static inline bool fetch_is_contiguous(const grid_array *a)
{
    return a->stride == (a->is_wide ? (int64_t)sizeof(double) : (int64_t)sizeof(float));
}

/* Computes the addresses of the values at a cell's vertices. The last address is repeated until there are eight. */
MMBVH_INLINE void fetch_value_addresses(const grid *g, const grid_array *values, int64_t cell, const fetch_shape shape,
                                        const bool wide_index, const int64_t stride,
                                        const char *out[GRID_MAX_CELL_VERTICES])
{
    const int count = fetch_vertex_count(g, cell, shape);
    const int64_t first = fetch_first_entry(g, cell, count, shape);
    out[0] = values->data + fetch_vertex(g, first, 0, shape, wide_index) * stride;
    for (int i = 1; i < GRID_MAX_CELL_VERTICES; i++)
        out[i] = i < count ? values->data + fetch_vertex(g, first, i, shape, wide_index) * stride : out[i - 1];
}

/* Reads a cell's values from an array of floats. Returns whether all values are finite. */
MMBVH_INLINE bool fetch_cell_floats(const grid *g, const grid_array *values, int64_t cell, const fetch_shape shape,
                                    const bool wide_index, const bool is_packed, vec4 out[2])
{
    const char *at[GRID_MAX_CELL_VERTICES];
    float v[GRID_MAX_CELL_VERTICES];
    fetch_value_addresses(g, values, cell, shape, wide_index, is_packed ? (int64_t)sizeof *v : values->stride, at);
    for (int i = 0; i < GRID_MAX_CELL_VERTICES; i++) v[i] = *(const float *)(const void *)at[i];
    out[0] = (vec4){v[0], v[1], v[2], v[3]};
    out[1] = shape == FETCH_TETS ? out[0] : (vec4){v[4], v[5], v[6], v[7]};
    const vec4 nonfinite = (out[0] - out[0]) + (out[1] - out[1]); /* 0 if all values are finite, otherwise NaN */
    return vec4_all((ivec4)(nonfinite == vec4_set1(0)));
}

/* Lane-wise minima and maxima of the values of a cell or leaf; fetch_combine_lanes() computes the range from them. */
typedef struct fetch_lane_range {
    vec2 low, high;
} fetch_lane_range;

/* Reads a cell's values from an array of doubles, and computes their lane-wise minima and maxima. Returns whether all
 * values are finite. */
MMBVH_INLINE bool fetch_cell_doubles(const grid *g, const grid_array *values, int64_t cell, const fetch_shape shape,
                                     const bool wide_index, const bool is_packed, fetch_lane_range *out)
{
    const char *at[GRID_MAX_CELL_VERTICES];
    double v[GRID_MAX_CELL_VERTICES];
    fetch_value_addresses(g, values, cell, shape, wide_index, is_packed ? (int64_t)sizeof *v : values->stride, at);
    for (int i = 0; i < GRID_MAX_CELL_VERTICES; i++) v[i] = *(const double *)(const void *)at[i];
    const vec2 a = {v[0], v[1]}, b = {v[2], v[3]};
    vec2 nonfinite = (a - a) + (b - b); /* 0 if all values are finite, otherwise NaN */
    *out = (fetch_lane_range){vec2_min(a, b), vec2_max(a, b)};
    if (shape != FETCH_TETS) {
        const vec2 c = {v[4], v[5]}, d = {v[6], v[7]};
        nonfinite += (c - c) + (d - d);
        out->low = vec2_min(vec2_min(c, d), out->low);
        out->high = vec2_max(vec2_max(c, d), out->high);
    }
    return nonfinite[0] + nonfinite[1] == 0;
}

/* The range of a cell's values. is_finite is true if all values are finite. */
typedef struct fetch_range {
    double low, high;
    bool is_finite;
} fetch_range;

MMBVH_INLINE fetch_range fetch_combine_lanes(const fetch_lane_range *v, bool is_finite)
{
    return (fetch_range){v->low[0] < v->low[1] ? v->low[0] : v->low[1],
                         v->high[0] > v->high[1] ? v->high[0] : v->high[1], is_finite};
}

/* How values or coordinates at vertices are read: as floats, as doubles, or by the accessors of grid.h, which also
 * handle integers, magnitudes and lattices. */
typedef enum fetch_numbers { FETCH_FLOATS, FETCH_DOUBLES, FETCH_ANY_NUMBERS } fetch_numbers;

static inline fetch_numbers fetch_field_numbers(const grid_field *field)
{
    if (field->component < 0 || field->values.is_integer) return FETCH_ANY_NUMBERS;
    return field->values.is_wide ? FETCH_DOUBLES : FETCH_FLOATS;
}

/* Computes the range of the values at the vertices of a cell of any type. */
MMBVH_INLINE fetch_range fetch_vertex_range(const grid *g, const grid_field *field, int64_t cell,
                                            const fetch_numbers numbers)
{
    const int64_t offset = numbers == FETCH_ANY_NUMBERS ? 0 : field->component * field->component_stride;
    const grid_array values = {.data = field->values.data + offset, .stride = field->values.stride};
    double low = INFINITY, high = -INFINITY, nonfinite = 0; /* nonfinite: 0 while all values are finite, then NaN */
    grid_walk walk = grid_walk_cell(g, cell);
    do {
        for (int64_t entry = walk.next; entry < walk.end; entry++) {
            const int64_t vertex = grid_walk_vertex(&walk, entry);
            const double v = numbers == FETCH_ANY_NUMBERS ? grid_field_value(field, vertex)
                                                          : fetch_number(&values, vertex, numbers == FETCH_DOUBLES);
            low = v < low ? v : low;
            high = v > high ? v : high;
            nonfinite += v - v;
        }
    } while (grid_walk_next_face(&walk));
    return (fetch_range){low, high, nonfinite == 0};
}

/* Computes the range of the values of a cell of any type, for any field. */
static inline fetch_range fetch_any_cell_range(const grid *g, const grid_field *field, int64_t cell)
{
    if (field->is_cell_centred) {
        const double v = grid_field_value(field, cell);
        return (fetch_range){v, v, isfinite(v)};
    }
    const fetch_numbers numbers = fetch_field_numbers(field);
    fetch_range range = numbers == FETCH_FLOATS    ? fetch_vertex_range(g, field, cell, FETCH_FLOATS)
                        : numbers == FETCH_DOUBLES ? fetch_vertex_range(g, field, cell, FETCH_DOUBLES)
                                                   : fetch_vertex_range(g, field, cell, FETCH_ANY_NUMBERS);
    range.is_finite = range.is_finite && grid_has_finite_cell_value(field, cell);
    return range;
}

/* A bounding box in double precision, in the coordinates of the grid or of the tree. */
typedef struct fetch_box {
    double lower[3];
    double upper[3];
} fetch_box;

MMBVH_INLINE void fetch_box_empty(fetch_box *box)
{
    for (int axis = 0; axis < 3; axis++) {
        box->lower[axis] = INFINITY;
        box->upper[axis] = -INFINITY;
    }
}

MMBVH_INLINE void unite_boxes(fetch_box *to, const fetch_box *box)
{
    for (int axis = 0; axis < 3; axis++) {
        to->lower[axis] = box->lower[axis] < to->lower[axis] ? box->lower[axis] : to->lower[axis];
        to->upper[axis] = box->upper[axis] > to->upper[axis] ? box->upper[axis] : to->upper[axis];
    }
}

/* A bounding box in float, in lanes 0 to 2. */
typedef struct fetch_float_box {
    vec4 lower, upper;
} fetch_float_box;

static inline fetch_float_box fetch_float_box_empty(void)
{
    return (fetch_float_box){vec4_set1(INFINITY), vec4_set1(-INFINITY)};
}

static inline void unite_float_boxes(fetch_float_box *to, const fetch_float_box *float_box)
{
    to->lower = vec4_min(float_box->lower, to->lower);
    to->upper = vec4_max(float_box->upper, to->upper);
}

static inline fetch_box fetch_float_box_widen(const fetch_float_box *float_box)
{
    fetch_box box;
    for (int axis = 0; axis < 3; axis++) {
        box.lower[axis] = (double)float_box->lower[axis];
        box.upper[axis] = (double)float_box->upper[axis];
    }
    return box;
}

/* Extends the box by a cell whose coordinates are floats. */
MMBVH_INLINE void extend_float_box(fetch_float_box *float_box, const grid *g, int64_t cell, const fetch_shape shape,
                                   const bool wide_index, const bool is_packed)
{
    const char *const x = g->coordinates[0].data, *const y = g->coordinates[1].data, *const z = g->coordinates[2].data;
    const int64_t stride = is_packed ? (int64_t)sizeof(float) : g->coordinates[0].stride;
    const int count = fetch_vertex_count(g, cell, shape);
    const int64_t first = fetch_first_entry(g, cell, count, shape);
    for (int i = 0; i < count; i++) {
        const int64_t at = fetch_vertex(g, first, i, shape, wide_index) * stride;
        const vec4 p = {*(const float *)(const void *)(x + at), *(const float *)(const void *)(y + at),
                        *(const float *)(const void *)(z + at), 0};
        float_box->lower = vec4_min(p, float_box->lower);
        float_box->upper = vec4_max(p, float_box->upper);
    }
}

/* Extends the box by a cell whose coordinates are doubles. */
MMBVH_INLINE void extend_box(fetch_box *box, const grid *g, int64_t cell, const fetch_shape shape,
                             const bool wide_index)
{
    const int count = fetch_vertex_count(g, cell, shape);
    const int64_t first = fetch_first_entry(g, cell, count, shape);
    for (int i = 0; i < count; i++) {
        const int64_t vertex = fetch_vertex(g, first, i, shape, wide_index);
        const char *at = g->coordinates[0].data + vertex * g->coordinates[0].stride;
        for (int axis = 0; axis < 3; axis++) {
            const int64_t offset = g->coordinates[axis].data - g->coordinates[0].data;
            const double x = *(const double *)(const void *)(at + offset);
            box->lower[axis] = x < box->lower[axis] ? x : box->lower[axis];
            box->upper[axis] = x > box->upper[axis] ? x : box->upper[axis];
        }
    }
}

/* Extends the box by cell_count cells. Floats are compared as floats; only the result is converted to double. Two boxes
 * of floats are extended alternately, because each comparison depends on the previous one with the same box. */
MMBVH_INLINE void extend_box_by_cells(fetch_box *box, const grid *g, const uint32_t *cells, int cell_count,
                                      const fetch_shape shape, const bool wide_index, const bool wide_number)
{
    if (wide_number) {
        fetch_box all = *box;
        for (int k = 0; k < cell_count; k++) extend_box(&all, g, cells[k], shape, wide_index);
        *box = all;
        return;
    }
    fetch_float_box even = fetch_float_box_empty(), odd = even;
    for (int64_t k = 0; k < cell_count / 2; k++) {
        extend_float_box(&even, g, cells[2 * k], shape, wide_index, false);
        extend_float_box(&odd, g, cells[2 * k + 1], shape, wide_index, false);
    }
    if (cell_count & 1) extend_float_box(&even, g, cells[cell_count - 1], shape, wide_index, false);
    unite_float_boxes(&even, &odd);
    const fetch_box floats = fetch_float_box_widen(&even);
    unite_boxes(box, &floats);
}

/* Transforms a box to the tree's coordinates and rounds it outward. Because rounding is monotonic, this gives the same
 * box as rounding each vertex. */
MMBVH_INLINE void round_box_outward(const fetch_box *box, const double origin[3], double scale, float *lower,
                                    float *upper)
{
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = round_down((box->lower[axis] - origin[axis]) * scale);
        upper[axis] = round_up((box->upper[axis] - origin[axis]) * scale);
    }
}

/* Transforms a box of floats to the tree's coordinates and rounds it outward. The results are bit-identical to those of
 * round_box_outward() for the same box in double. Lane 3 of the input is ignored. */
MMBVH_INLINE void round_float_box_outward(const fetch_float_box *float_box, const double origin[3], double scale,
                                          vec4 *lower, vec4 *upper)
{
    const double from[4] = {origin[0], origin[1], origin[2], 0};
    *lower = vec4_xyz(vec4_transform_down(float_box->lower, from, scale));
    *upper = vec4_xyz(0.0f - vec4_transform_down(float_box->upper, from, -scale));
}

/* Returns FETCH_FLOATS if the coordinates of all three axes are floats, FETCH_DOUBLES if all are doubles, and otherwise
 * FETCH_ANY_NUMBERS. */
static inline fetch_numbers fetch_coordinate_numbers(const grid *g)
{
    const grid_array *c = g->coordinates;
    if (c[0].axis || c[0].is_integer || c[1].is_integer || c[2].is_integer) return FETCH_ANY_NUMBERS;
    if (c[0].is_wide != c[1].is_wide || c[0].is_wide != c[2].is_wide) return FETCH_ANY_NUMBERS;
    return c[0].is_wide ? FETCH_DOUBLES : FETCH_FLOATS;
}

/* Returns whether extend_box_by_cells() can read the grid: all coordinates are floats, or all are doubles, they have
 * the same stride, and no cell is a polyhedron. */
static inline bool fetch_can_read_boxes(const grid *g)
{
    const grid_array *c = g->coordinates;
    const bool is_alike = c[0].stride == c[1].stride && c[0].stride == c[2].stride;
    return is_alike && !grid_may_have_polyhedra(g) && fetch_coordinate_numbers(g) != FETCH_ANY_NUMBERS;
}

/* Extends the box by a cell of a uniform or rectilinear lattice. Comparisons suffice because the lattice's coordinates
 * are finite; they take half as long as the function calls fmin() and fmax(). */
static inline void extend_box_by_lattice_cell(fetch_box *box, const grid_lattice *l, int64_t cell)
{
    for (int axis = 0; axis < 3; axis++) {
        const double *at = l->axes[axis].axis_coordinates + grid_index_along(&l->cell_numbering, axis, cell);
        const double a = at[0], b = at[l->cells[axis] > 0], low = a < b ? a : b, high = a < b ? b : a;
        box->lower[axis] = low < box->lower[axis] ? low : box->lower[axis];
        box->upper[axis] = high > box->upper[axis] ? high : box->upper[axis];
    }
}

/* Extends the box by the vertices of a cell of any type. */
MMBVH_INLINE void extend_box_by_vertices(fetch_box *box, const grid *g, int64_t cell, const fetch_numbers numbers)
{
    fetch_box all = *box; /* local, so that bounds stay in registers */
    grid_walk walk = grid_walk_cell(g, cell);
    do {
        for (int64_t entry = walk.next; entry < walk.end; entry++) {
            const int64_t vertex = grid_walk_vertex(&walk, entry);
            for (int axis = 0; axis < 3; axis++) {
                const grid_array *c = &g->coordinates[axis];
                const double x = numbers == FETCH_ANY_NUMBERS ? grid_read_number(c, vertex)
                                                              : fetch_number(c, vertex, numbers == FETCH_DOUBLES);
                all.lower[axis] = x < all.lower[axis] ? x : all.lower[axis];
                all.upper[axis] = x > all.upper[axis] ? x : all.upper[axis];
            }
        }
    } while (grid_walk_next_face(&walk));
    *box = all;
}

static inline void extend_box_by_any_cell(fetch_box *box, const grid *g, int64_t cell)
{
    const fetch_numbers numbers = fetch_coordinate_numbers(g);
    if (g->coordinates[0].axis)
        extend_box_by_lattice_cell(box, g->lattice, cell);
    else if (numbers == FETCH_FLOATS)
        extend_box_by_vertices(box, g, cell, FETCH_FLOATS);
    else if (numbers == FETCH_DOUBLES)
        extend_box_by_vertices(box, g, cell, FETCH_DOUBLES);
    else
        extend_box_by_vertices(box, g, cell, FETCH_ANY_NUMBERS);
}

/* Instantiates a function for each cell shape and element type. DEFINE(name, shape, wide_index, wide_number) must
 * define one instance, and FETCH_TABLE(prefix) is the table of all instances, indexed by
 * [shape][wide_index][wide_number]. */
#define FETCH_INSTANCES(DEFINE, prefix)                                                                                \
    FETCH_EACH_SHAPE(FETCH_SHAPE_INSTANCES, DEFINE, prefix)                                                            \
    DEFINE(prefix##_lattice_4, FETCH_LATTICE, false, false)                                                            \
    DEFINE(prefix##_lattice_8, FETCH_LATTICE, false, true)

#define FETCH_EACH_SHAPE(INSTANCES, DEFINE, prefix)                                                                    \
    INSTANCES(DEFINE, prefix##_tets, FETCH_TETS)                                                                       \
    INSTANCES(DEFINE, prefix##_hexes, FETCH_HEXES)                                                                     \
    INSTANCES(DEFINE, prefix##_uniform, FETCH_UNIFORM)                                                                 \
    INSTANCES(DEFINE, prefix##_by_cell, FETCH_BY_CELL)

#define FETCH_SHAPE_INSTANCES(DEFINE, prefix, shape)                                                                   \
    FETCH_FLOAT_SHAPE_INSTANCES(DEFINE, prefix, shape)                                                                 \
    DEFINE(prefix##_48, shape, false, true)                                                                            \
    DEFINE(prefix##_88, shape, true, true)

/* clang-format off */
#define FETCH_TABLE(prefix)                                                                                            \
    {                                                                                                                  \
        {{prefix##_tets_44, prefix##_tets_48}, {prefix##_tets_84, prefix##_tets_88}},                                  \
        {{prefix##_hexes_44, prefix##_hexes_48}, {prefix##_hexes_84, prefix##_hexes_88}},                              \
        {{prefix##_uniform_44, prefix##_uniform_48}, {prefix##_uniform_84, prefix##_uniform_88}},                      \
        {{prefix##_by_cell_44, prefix##_by_cell_48}, {prefix##_by_cell_84, prefix##_by_cell_88}},                      \
        {{prefix##_lattice_4, prefix##_lattice_8}, {prefix##_lattice_4, prefix##_lattice_8}},                          \
    }
/* clang-format on */

/* Instantiates a function for each cell shape and index type, for coordinates or values that are floats. The table of
 * the instances is FETCH_FLOAT_TABLE(prefix), indexed by [shape][wide_index]. */
#define FETCH_FLOAT_INSTANCES(DEFINE, prefix)                                                                          \
    FETCH_EACH_SHAPE(FETCH_FLOAT_SHAPE_INSTANCES, DEFINE, prefix)                                                      \
    DEFINE(prefix##_lattice_4, FETCH_LATTICE, false, false)

#define FETCH_FLOAT_SHAPE_INSTANCES(DEFINE, prefix, shape)                                                             \
    DEFINE(prefix##_44, shape, false, false)                                                                           \
    DEFINE(prefix##_84, shape, true, false)

/* clang-format off */
#define FETCH_FLOAT_TABLE(prefix)                                                                                      \
    {                                                                                                                  \
        {prefix##_tets_44, prefix##_tets_84},                                                                          \
        {prefix##_hexes_44, prefix##_hexes_84},                                                                        \
        {prefix##_uniform_44, prefix##_uniform_84},                                                                    \
        {prefix##_by_cell_44, prefix##_by_cell_84},                                                                    \
        {prefix##_lattice_4, prefix##_lattice_4},                                                                      \
    }
/* clang-format on */

#endif
