/* Reads a mesh part's coordinates, values and connectivity for one cell per lane, from arrays of any layout and meshes
 * of one or several cell types. Arrays of float32 or float64 that are small enough are read by gather instructions,
 * others number by number. float32 numbers are compared with each other, and with an isovalue, in float32; other
 * numbers are compared in double. Both comparisons are exact. For all other computations numbers are converted to
 * double. Meshes whose vertex or cell indices do not fit in 32 bits cannot be read in lanes. */
#ifndef RENDER_KERNEL_ARRAYS_H
#define RENDER_KERNEL_ARRAYS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

/* One coordinate of a mesh part's vertices, or one component of its field, as an array that is read by vertex or cell
 * index. */
typedef struct kernel_numbers {
    /* address of the first number; NULL if gather instructions cannot read the array, because it is too large, or
     * neither float32 nor float64 */
    const float *data;
    int32_t stride;   /* distance between consecutive numbers, in units of four bytes */
    bool is_wide;     /* set if the numbers are float64, not float32 */
    grid_array array; /* the array; its numbers are read one by one if data is NULL */
    /* if not NULL and `data` is NULL, numbers are read by grid_field_value() of this field instead of from `array` */
    const grid_field *field;
} kernel_numbers;

SIMD_INLINE bool kernel_numbers_are_narrow(const kernel_numbers *c)
{
    return __builtin_expect(c->data && !c->is_wide, 1);
}

typedef struct kernel_arrays {
    bool has_lanes;            /* set if indices fit in 32 bits, so that cells can be read in lanes */
    bool is_narrow;            /* set if the coordinates and the field are float32 and can be read by gathers */
    bool has_narrow_positions; /* set if the coordinates are float32 and can be read by gathers */
    const grid *cells;         /* the mesh part's cells */
    int type;                  /* type of all cells, or GRID_NO_TYPE if the mesh has several types */
    /* cell-centred field from which the vertex values were averaged, or NULL; cells in which it is not finite are not
     * drawn */
    const grid_field *source_cells;
    bool is_by_cell; /* set if values belong to cells, not to vertices */
    kernel_numbers coordinates[3], values;
    /* Address and stride in bytes of the four arrays whose entries are prefetched for a vertex: the three coordinates
     * and the field. If the field is cell-centred, the first coordinate takes its place. */
    struct {
        const char *data;
        int64_t stride;
    } prefetched[4];
} kernel_arrays;

static inline kernel_numbers kernel_numbers_describe_array(const grid_array *a, int64_t count)
{
    const int64_t stride = a->stride / (int64_t)sizeof(float);
    const bool is_gathered = !a->is_integer && a->stride % (int64_t)sizeof(float) == 0 && stride > 0 &&
                             stride < INT32_MAX / 2 && count <= INT32_MAX / stride;
    kernel_numbers c = {.array = *a, .is_wide = a->is_wide, .stride = (int32_t)stride};
    c.data = is_gathered ? (const float *)(const void *)a->data : NULL;
    return c;
}

/* Returns whether the mesh's vertex and cell indices fit in the 32 bits of a lane. */
SIMD_INLINE bool kernel_arrays_have_small_indices(const grid *g)
{
    return g->vertex_count < INT32_MAX && g->cell_count < INT32_MAX;
}

static inline void kernel_arrays_begin(kernel_arrays *p, const grid *g, const grid_field *field)
{
    const int64_t count = field->is_cell_centred ? g->cell_count : g->vertex_count;
    grid_array values = field->values;
    memset(p, 0, sizeof *p);
    p->cells = g;
    p->type = g->cell_types ? GRID_NO_TYPE : g->cell_type;
    p->has_lanes = kernel_arrays_have_small_indices(g);
    p->source_cells = field->source_cells;
    p->is_by_cell = field->is_cell_centred;
    if (field->component >= 0) values.data += field->component * field->component_stride;
    p->values = kernel_numbers_describe_array(&values, count);
    if (field->component < 0) p->values.data = NULL;
    p->values.field = field;
    p->has_narrow_positions = true;
    for (int a = 0; a < 3; a++) {
        const grid_array *c = &g->coordinates[a];
        p->coordinates[a] = kernel_numbers_describe_array(c, g->vertex_count);
        p->has_narrow_positions = p->has_narrow_positions && kernel_numbers_are_narrow(&p->coordinates[a]);
        p->prefetched[a].data = c->data;
        p->prefetched[a].stride = c->stride;
    }
    p->is_narrow = p->has_narrow_positions && kernel_numbers_are_narrow(&p->values);
    p->prefetched[3].data = p->is_by_cell ? p->prefetched[0].data : values.data;
    p->prefetched[3].stride = p->is_by_cell ? p->prefetched[0].stride : values.stride;
}

/* ---- vertex indices of cells ---- */

SIMD_INLINE int kernel_arrays_type(const kernel_arrays *p, uint32_t cell)
{
    return p->type != GRID_NO_TYPE ? p->type : grid_cell_type(p->cells, cell);
}

/* Returns the index, in the connectivity array, of the cell's first entry; for a structured grid (grid_lattice), which
 * has no such array, the index of the cell's first vertex. vertices: number of vertices of each cell, used if the mesh
 * has no offsets. */
SIMD_INLINE int64_t kernel_arrays_find_connectivity_entry(const grid *g, uint32_t cell, int vertices)
{
    if (__builtin_expect(g->lattice != NULL, 0)) return grid_lattice_first_vertex(g->lattice, cell);
    return g->offsets.data ? grid_read_index(&g->offsets, cell) : (int64_t)cell * vertices;
}

/* Stores the vertex indices of a cell of a structured grid, that of the cell's vertex i in out[i * out_stride]. */
static inline void kernel_lattice_indices(const grid_lattice *l, uint32_t cell, int vertices, int32_t *out,
                                          int out_stride)
{
    const int64_t first = grid_lattice_first_vertex(l, cell);
    for (int i = 0; i < vertices; i++) out[i * out_stride] = (int32_t)(first + l->corner_offsets[i]);
}

/* Stores a cell's vertex indices, that of vertex i in out[i * out_stride], and prefetches the coordinates and values of
 * these vertices. */
SIMD_INLINE void kernel_arrays_read_vertex_indices(const kernel_arrays *p, uint32_t cell, int vertices, int32_t *out,
                                                   int out_stride)
{
    const grid_array c = p->cells->connectivity;
    if (__builtin_expect(p->cells->lattice != NULL, 0)) {
        kernel_lattice_indices(p->cells->lattice, cell, vertices, out, out_stride);
    } else {
        const char *at = c.data + kernel_arrays_find_connectivity_entry(p->cells, cell, vertices) * c.stride;
        for (int i = 0; i < vertices; i++, at += c.stride) {
            const int64_t index = c.is_wide ? *(const int64_t *)(const void *)at : *(const int32_t *)(const void *)at;
            out[i * out_stride] = (int32_t)(index - c.base);
        }
    }
    for (int i = 0; i < vertices; i++)
        for (int k = 0; k < 4; k++)
            __builtin_prefetch(p->prefetched[k].data + out[i * out_stride] * p->prefetched[k].stride);
}

/* Calls kernel_arrays_read_vertex_indices() for cells of any type. For tets and hexes the number of vertices is passed
 * as a constant, so that loops over vertices have constant lengths. */
SIMD_INLINE void kernel_arrays_read_indices_of_any_type(const kernel_arrays *p, uint32_t cell, int vertices,
                                                        int32_t *out, int out_stride)
{
    if (vertices == 4)
        kernel_arrays_read_vertex_indices(p, cell, 4, out, out_stride);
    else if (vertices == 8)
        kernel_arrays_read_vertex_indices(p, cell, 8, out, out_stride);
    else
        kernel_arrays_read_vertex_indices(p, cell, vertices, out, out_stride);
}

/* Returns those of the given lanes (a bit mask) whose cells are drawn: those with a finite value in source_cells, or
 * all if there is no such field. */
SIMD_INLINE unsigned kernel_arrays_drawn_lanes(const kernel_arrays *p, const uint32_t *cells, unsigned lanes)
{
    for (unsigned left = p->source_cells ? lanes : 0; left; left &= left - 1)
        if (!isfinite(grid_field_value(p->source_cells, cells[__builtin_ctz(left)]))) lanes &= ~(left & -left);
    return lanes;
}

/* ---- coordinates and values ---- */

/* Computes one coordinate of vertices of a uniform or rectilinear grid, one vertex per lane. The index along the axis
 * is computed from the vertex index as in grid_index_along(). */
static void kernel_axis_coordinates(const grid_axis *axis, vi vertex, kernel_f64 out[2])
{
    const grid_numbering *of = axis->vertices;
    const double outer = of->outer[axis->axis], inverse_outer = of->inverse_outer[axis->axis];
    const double inverse_stride = of->inverse_stride[axis->axis];
    double places[SIMD_WIDTH];
    int32_t at[SIMD_WIDTH];
    memcpy(at, &vertex, sizeof vertex);
    for (int n = 0; n < SIMD_WIDTH; n++) {
        const double number = (double)at[n];
        const double above = (double)(int32_t)((number + 0.5) * inverse_outer);
        at[n] = (int32_t)((number - above * outer + 0.5) * inverse_stride);
    }
    for (int n = 0; n < SIMD_WIDTH; n++) places[n] = axis->axis_coordinates[at[n]];
    memcpy(out, places, sizeof places);
}

static __attribute__((noinline)) void kernel_numbers_gather_scalar(const kernel_numbers *c, vi index, kernel_f64 out[2])
{
    double v[SIMD_WIDTH];
    int32_t at[SIMD_WIDTH];
    if (c->array.axis) {
        kernel_axis_coordinates(c->array.axis, index, out);
        return;
    }
    memcpy(at, &index, sizeof index);
    for (int n = 0; n < SIMD_WIDTH; n++)
        v[n] = c->field ? grid_field_value(c->field, at[n]) : grid_read_number(&c->array, at[n]);
    memcpy(out, v, sizeof v);
}

/* One number per lane, in the precision of its array: in `narrow` if the array is float32 and gathered, which saves
 * operations, otherwise in `wide`. */
typedef struct kernel_raw_numbers {
    vf narrow;
    kernel_f64 wide[2];
} kernel_raw_numbers;

SIMD_INLINE void kernel_numbers_gather_raw(const kernel_numbers *c, vi index, kernel_raw_numbers *out)
{
    if (kernel_numbers_are_narrow(c)) {
        out->narrow = vf_gather(c->data, index * c->stride);
    } else if (c->data) {
        for (int half = 0; half < 2; half++) out->wide[half] = vd_gather(c->data, index * c->stride, half);
    } else {
        kernel_numbers_gather_scalar(c, index, out->wide);
    }
}

/* Converts numbers to double. is_narrow: whether they are stored as float32. */
SIMD_INLINE void kernel_raw_widen(bool is_narrow, const kernel_raw_numbers *v, kernel_f64 out[2])
{
    if (is_narrow)
        kernel_halves_widen(v->narrow, out);
    else
        memcpy(out, v->wide, sizeof v->wide);
}

SIMD_INLINE void kernel_numbers_gather(const kernel_numbers *c, vi index, kernel_f64 out[2])
{
    kernel_raw_numbers raw;
    kernel_numbers_gather_raw(c, index, &raw);
    kernel_raw_widen(kernel_numbers_are_narrow(c), &raw, out);
}

/* Returns a < b per lane. is_narrow: whether both are stored as float32. */
SIMD_INLINE vm kernel_raw_lt(bool is_narrow, const kernel_raw_numbers *a, const kernel_raw_numbers *b)
{
    return is_narrow ? vf_lt(a->narrow, b->narrow) : vd_lt(a->wide, b->wide);
}

SIMD_INLINE vm kernel_raw_eq(bool is_narrow, const kernel_raw_numbers *a, const kernel_raw_numbers *b)
{
    return is_narrow ? vf_eq(a->narrow, b->narrow) : vd_eq(a->wide, b->wide);
}

SIMD_INLINE void kernel_raw_swap(bool is_narrow, vm lanes, kernel_raw_numbers *a, kernel_raw_numbers *b)
{
    const kernel_raw_numbers was = *a, other = *b;
    if (is_narrow) {
        a->narrow = vf_select(lanes, other.narrow, was.narrow);
        b->narrow = vf_select(lanes, was.narrow, other.narrow);
    } else {
        vd_select(lanes, other.wide, was.wide, a->wide);
        vd_select(lanes, was.wide, other.wide, b->wide);
    }
}

/* Returns the lanes in which position a is before b in the lexicographic order of coordinates. */
SIMD_INLINE vm kernel_is_raw_position_before(bool is_narrow, const kernel_raw_numbers a[3],
                                             const kernel_raw_numbers b[3])
{
    vm before = kernel_raw_lt(is_narrow, &a[2], &b[2]);
    for (int axis = 1; axis >= 0; axis--)
        before = vm_or(kernel_raw_lt(is_narrow, &a[axis], &b[axis]),
                       vm_and(kernel_raw_eq(is_narrow, &a[axis], &b[axis]), before));
    return before;
}

/* Reads the coordinates of one vertex per lane. is_narrow: whether all three arrays are float32 and can be read by
 * gathers (has_narrow_positions). */
SIMD_INLINE void kernel_arrays_positions(const kernel_arrays *p, bool is_narrow, vi vertex, kernel_raw_numbers out[3])
{
    for (int a = 0; a < 3; a++) {
        if (is_narrow)
            out[a].narrow = vf_gather(p->coordinates[a].data, vertex * p->coordinates[a].stride);
        else
            kernel_numbers_gather(&p->coordinates[a], vertex, out[a].wide);
    }
}

/* ---- cells of uniform and rectilinear grids ---- */

SIMD_INLINE bool kernel_arrays_have_axes(const kernel_arrays *p)
{
    return p->coordinates[0].array.axis != NULL;
}

/* Reads the coordinates of hexes of a uniform or rectilinear grid, one hex per lane. first: index of each hex's first
 * vertex. cells[0] gets the coordinates of this vertex, cells[1] those of the vertex opposite to it in the hex, by axis
 * and half of the lanes. These are 6 numbers per hex instead of 24. */
static __attribute__((noinline)) void kernel_lattice_cells_read(const kernel_arrays *p, const int32_t first[SIMD_WIDTH],
                                                                kernel_f64 cells[2][3][2])
{
    for (int axis = 0; axis < 3; axis++) {
        const grid_axis *along = p->coordinates[axis].array.axis;
        double ends[2][SIMD_WIDTH];
        for (int n = 0; n < SIMD_WIDTH; n++) {
            const double *at = along->axis_coordinates + grid_index_along(along->vertices, axis, first[n]);
            ends[0][n] = at[0];
            ends[1][n] = at[1];
        }
        for (int end = 0; end < 2; end++) memcpy(&cells[end][axis], ends[end], sizeof ends[end]);
    }
}

/* ---- comparisons with an isovalue ---- */

/* A number, for example an isovalue, that is compared with the numbers of an array or subtracted from them. value: this
 * number in double; middle + rest: the same number as a sum of two float32; least: the smallest float32 that is not
 * below it. */
typedef struct kernel_level {
    double value;
    float middle, rest, least;
} kernel_level;

/* Returns the smallest float32 that is not below x. */
SIMD_INLINE float kernel_smallest_float_not_below(double x)
{
    float f = (float)x;
    int32_t bits;
    if (!((double)f < x)) return f;
    if (f == 0) return 1e-45f;
    memcpy(&bits, &f, sizeof bits);
    bits += f > 0 ? 1 : -1;
    memcpy(&f, &bits, sizeof f);
    return f;
}

SIMD_INLINE kernel_level kernel_make_level(double value)
{
    const float middle = (float)value;
    return (kernel_level){value, middle, (float)(value - (double)middle), kernel_smallest_float_not_below(value)};
}

/* Returns the lanes in which the number v, which was read from the array c, is below `level`. The comparison is
 * exact. */
SIMD_INLINE vm kernel_is_raw_number_below(const kernel_numbers *c, const kernel_raw_numbers *v,
                                          const kernel_level *level)
{
    const kernel_f64 half = (kernel_f64){0} + level->value, value[2] = {half, half};
    return kernel_numbers_are_narrow(c) ? vf_lt(v->narrow, vf_set(level->least)) : vd_lt(v->wide, value);
}

/* Returns the number v, which was read from the array c, minus `level`, rounded to float32. */
SIMD_INLINE vf kernel_subtract_level_from_raw(const kernel_numbers *c, const kernel_raw_numbers *v,
                                              const kernel_level *level)
{
    vf out;
    if (kernel_numbers_are_narrow(c)) return (v->narrow - level->middle) - level->rest;
    for (int half = 0; half < 2; half++) kernel_f64_store_half_of_vector(&out, half, v->wide[half] - level->value);
    return out;
}

/* Reads the field at one vertex per lane. If the field is cell-centred, its value in the lane's cell is read
 * instead. */
SIMD_INLINE void kernel_arrays_values(const kernel_arrays *p, vi vertex, const uint32_t *cells, kernel_raw_numbers *out)
{
    if (__builtin_expect(p->is_by_cell, 0)) memcpy(&vertex, cells, sizeof vertex);
    kernel_numbers_gather_raw(&p->values, vertex, out);
}

#endif
