/* A rank's cells and values in the form that all modules below the session read: the caller's own arrays, with
 * inline accessors that handle each array's element type and stride. No data is copied.
 *
 * The code that makes a grid has validated it (indices in range, types known, coordinates finite); the accessors
 * check nothing. They return all geometry in double: other modules convert to float32 only after subtracting an
 * origin. */
#ifndef BASE_GRID_H
#define BASE_GRID_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>

enum {
    GRID_NO_TYPE = 0,
    GRID_TRIANGLE = 5,
    GRID_POLYGON = 7,
    GRID_QUAD = 9,
    GRID_TET = 10,
    GRID_HEX = 12,
    GRID_WEDGE = 13,
    GRID_PYRAMID = 14,
    GRID_POLYHEDRON = 42,
    /* maximum number of vertices of a cell, except polyhedra and polygons, which may have any number */
    GRID_MAX_CELL_VERTICES = 8
};

/* Converts the flat index n of a vertex or a cell of a lattice (its number) to three indices along the axes. The index
 * along an axis is n % outer / stride, where outer is the next larger stride. Each stride is larger than the distance
 * that the smaller strides cover, so that each triple of indices has a unique flat index. Flat indices to which no
 * triple belongs are padding in the caller's arrays. */
typedef struct grid_numbering {
    int64_t stride[3];
    double inverse_stride[3]; /* 1 / the stride of each axis; 0 along an axis with a single index */
    double outer[3];          /* the next larger stride; 0 along the axis of the largest stride */
    double inverse_outer[3];  /* 1 / outer; 0 along the axis of the largest stride */
} grid_numbering;

/* Returns the index along an axis that belongs to the flat index n. It is computed from quotients (n + 1/2) / stride,
 * which are rounded down. A quotient is at least 1/2 / stride away from the next integer. Its two rounding errors
 * change it by at most n / stride * 2^-52, and therefore by less than this distance if n < 2^51. */
static inline int64_t grid_index_along(const grid_numbering *of, int axis, int64_t n)
{
    const double whole = (double)n, outer = (double)(int64_t)((whole + 0.5) * of->inverse_outer[axis]);
    return (int64_t)((whole - outer * of->outer[axis] + 0.5) * of->inverse_stride[axis]);
}

/* Coordinates along one axis of a uniform or rectilinear lattice. */
typedef struct grid_axis {
    const double *axis_coordinates; /* coordinates, by index along the axis */
    int64_t count;                  /* number of coordinates along the axis */
    const grid_numbering *vertices; /* numbering of the lattice's vertices */
    int axis;
} grid_axis;

/* Returns the coordinate of the vertex with the flat index n. If n is padding, returns the last coordinate of the axis,
 * because loops over all flat indices include padding. */
static inline double grid_axis_coordinate(const grid_axis *axis, int64_t n)
{
    const int64_t index = grid_index_along(axis->vertices, axis->axis, n);
    return axis->axis_coordinates[index < axis->count ? index : axis->count - 1];
}

/* Element types that are read one element at a time by memcpy(), at any address. Only values of fields and axes may
 * have these types; other arrays with such elements are copied before a grid is made. */
typedef enum grid_unusual_type {
    GRID_USUAL_TYPE = 0, /* the array is aligned, and of type double, float, int64 or int32 */
    GRID_UNUSUAL_FLOAT32,
    GRID_UNUSUAL_FLOAT64,
    GRID_UNUSUAL_INT32,
    GRID_UNUSUAL_INT64,
    GRID_UNUSUAL_UINT8,
    GRID_UNUSUAL_INT8,
    GRID_UNUSUAL_INT16,
    GRID_UNUSUAL_UINT16,
    GRID_UNUSUAL_UINT32,
    GRID_UNUSUAL_UINT64
} grid_unusual_type;

/* A strided array. */
typedef struct grid_array {
    const char *data;
    int64_t stride; /* distance between elements in bytes; if it is 0, all elements are read from the first one */
    bool is_wide;   /* elements have 8 bytes (double or int64); otherwise 4 bytes (float or int32) */
    /* set if elements must not be read as float or double, because they are integers or can only be read by memcpy()
     * (unusual_type) */
    bool is_integer;
    unsigned char unusual_type; /* one of the values of grid_unusual_type */
    int64_t base; /* in an array of indices or offsets, the index base, which is subtracted from each element */
    /* number of entries that the caller gives of an array of offsets without its last entry; 0: the array is
     * complete */
    int64_t implied_end_count;
    int64_t implied_end; /* offset that the omitted last entry would have, counted from 0 */
    /* if not NULL, coordinates are computed from this axis by vertex number, and there is no data */
    const grid_axis *axis;
} grid_array;

/* A structured grid (lattice). It has no connectivity: three indices determine a cell. */
typedef struct grid_lattice {
    int64_t cells[3]; /* number of cells along each axis; 0 along one axis: the cells are quads */
    grid_numbering vertex_numbering, cell_numbering;
    /* flat index of each vertex of a cell minus that of the cell's first vertex, in VTK's order */
    int64_t corner_offsets[8];
    int64_t drawn_first[3], drawn_end[3]; /* index range of the cells that are not in ghost layers */
    int64_t cell_count;                   /* number of cells, without padding */
    bool has_ghosts;                      /* set if some flat indices of cells are padding or belong to ghost layers */
    /* coordinates along the axes; they have no data if coordinates are given by vertex */
    grid_axis axes[3];
} grid_lattice;

typedef struct grid {
    int64_t vertex_count;
    int64_t cell_count;
    grid_array coordinates[3];
    grid_array connectivity; /* vertex indices of the cells; for a polyhedron indices of its faces */
    /* index of each cell's first entry in connectivity. It has no data if all cells have the type cell_type, and
     * always has data if there are polyhedra. */
    grid_array offsets;
    const char *cell_types; /* type of each cell; NULL: all cells have the type cell_type */
    int64_t cell_types_stride;
    int cell_types_bytes; /* size of an element of cell_types in bytes: 1, 4 or 8 */
    int cell_type;
    const char *ghosts; /* a flag per cell, nonzero for ghost cells; NULL: there are none */
    int64_t ghosts_stride;
    const grid_lattice *lattice; /* if not NULL, replaces connectivity, offsets and cell_types */
    /* a bit per cell, set if trees omit the cell because it has no volume, as shells and degenerate cells; NULL: no
     * cell is omitted for this reason */
    const uint64_t *flat;
    /* The faces of polyhedra. Two cells can share a face. face_count is 0 if there are no polyhedra. */
    int64_t face_count;
    grid_array face_offsets;      /* index of each face's first entry in face_connectivity; face_count + 1 entries */
    grid_array face_connectivity; /* vertex indices of the faces, in cyclic order */
    int ghosts_bytes;             /* size of a flag in ghosts in bytes: 1, 4 or 8 */
} grid;

/* One component, or the magnitude, of a field at vertices or in cells. */
typedef struct grid_field {
    grid_array values; /* tuples of components; the stride is the distance from tuple to tuple */
    int64_t component_stride;
    /* for a magnitude whose components are in separate arrays, these arrays; NULL: all components are in `values` */
    const grid_array *component_arrays;
    int component_count;
    int component; /* index of the component, or -1 for the magnitude */
    bool is_cell_centred;
    /* If the values at vertices were computed from cell values: these cell values. A cell whose own value is not finite
     * is treated as a cell without values. NULL: the values were not computed from cells. */
    const struct grid_field *source_cells;
} grid_field;

#define GRID_READ_UNUSUAL(type)                                                                                        \
    {                                                                                                                  \
        type value;                                                                                                    \
        memcpy(&value, p, sizeof value);                                                                               \
        return (double)value;                                                                                          \
    }

static inline double grid_read_unusual_number(int unusual_type, const char *p)
{
    switch (unusual_type) {
    case GRID_UNUSUAL_FLOAT32: GRID_READ_UNUSUAL(float)
    case GRID_UNUSUAL_FLOAT64: GRID_READ_UNUSUAL(double)
    case GRID_UNUSUAL_INT32: GRID_READ_UNUSUAL(int32_t)
    case GRID_UNUSUAL_INT64: GRID_READ_UNUSUAL(int64_t)
    case GRID_UNUSUAL_UINT8: GRID_READ_UNUSUAL(uint8_t)
    case GRID_UNUSUAL_INT8: GRID_READ_UNUSUAL(int8_t)
    case GRID_UNUSUAL_INT16: GRID_READ_UNUSUAL(int16_t)
    case GRID_UNUSUAL_UINT16: GRID_READ_UNUSUAL(uint16_t)
    case GRID_UNUSUAL_UINT32: GRID_READ_UNUSUAL(uint32_t)
    case GRID_UNUSUAL_UINT64: GRID_READ_UNUSUAL(uint64_t)
    default: return 0;
    }
}

static inline int64_t grid_element_bytes(const grid_array *a)
{
    switch (a->unusual_type) {
    case GRID_UNUSUAL_UINT8:
    case GRID_UNUSUAL_INT8: return 1;
    case GRID_UNUSUAL_INT16:
    case GRID_UNUSUAL_UINT16: return 2;
    default: return a->is_wide ? 8 : 4;
    }
}

/* Reads an element of the array as a double. element: the address of the element. The array must have data, and not
 * coordinates that are computed from an axis. */
static inline double grid_read_element_number(const grid_array *a, const char *element)
{
    if (!a->is_integer)
        return a->is_wide ? *(const double *)(const void *)element : (double)*(const float *)(const void *)element;
    if (a->unusual_type) return grid_read_unusual_number(a->unusual_type, element);
    return a->is_wide ? (double)*(const int64_t *)(const void *)element
                      : (double)*(const int32_t *)(const void *)element;
}

static inline double grid_read_number(const grid_array *a, int64_t i)
{
    return a->axis ? grid_axis_coordinate(a->axis, i) : grid_read_element_number(a, a->data + i * a->stride);
}

static inline int64_t grid_read_index(const grid_array *a, int64_t i)
{
    const char *p = a->data + i * a->stride;
    const int64_t index = a->is_wide ? *(const int64_t *)(const void *)p : (int64_t) * (const int32_t *)(const void *)p;
    /* the subtraction is unsigned, so that it is well defined for any index */
    return (int64_t)((uint64_t)index - (uint64_t)a->base);
}

/* Returns the end of the entries of cell i or face i: the index of its last entry plus 1. offsets: the index of the
 * first entry of each cell or face. */
static inline int64_t grid_offset_end(const grid_array *offsets, int64_t i)
{
    return i + 1 == offsets->implied_end_count ? offsets->implied_end : grid_read_index(offsets, i + 1);
}

/* Returns the number of vertices of a cell type; 0 for unknown types, and for polyhedra and polygons, because their
 * number of vertices varies. */
static inline int grid_type_vertex_count(int cell_type)
{
    switch (cell_type) {
    case GRID_TET: return 4;
    case GRID_HEX: return 8;
    case GRID_WEDGE: return 6;
    case GRID_PYRAMID: return 5;
    case GRID_TRIANGLE: return 3;
    case GRID_QUAD: return 4;
    default: return 0;
    }
}

/* Returns whether cells of the type are two-dimensional. Such cells (shells) have no volume, and outer surfaces show
 * them. */
static inline bool grid_is_shell_type(int cell_type)
{
    return cell_type == GRID_TRIANGLE || cell_type == GRID_QUAD || cell_type == GRID_POLYGON;
}

static inline int grid_cell_type(const grid *g, int64_t cell)
{
    if (!g->cell_types) return g->cell_type;
    const char *p = g->cell_types + cell * g->cell_types_stride;
    if (g->cell_types_bytes == 1) return *(const unsigned char *)p;
    if (g->cell_types_bytes == 4) return (int)*(const int32_t *)(const void *)p;
    const int64_t type = *(const int64_t *)(const void *)p;
    return type == (int)type ? (int)type : GRID_NO_TYPE;
}

/* Returns the axis along which the flat indices of cells are consecutive, or -1 if there is none. */
static inline int grid_lattice_row_axis(const grid_lattice *l)
{
    for (int axis = 0; axis < 3; axis++)
        if (l->cell_numbering.stride[axis] == 1) return axis;
    return -1;
}

/* Returns the flat index of a cell's first vertex. */
static inline int64_t grid_lattice_first_vertex(const grid_lattice *l, int64_t cell)
{
    int64_t first = 0;
    for (int axis = 0; axis < 3; axis++)
        first += grid_index_along(&l->cell_numbering, axis, cell) * l->vertex_numbering.stride[axis];
    return first;
}

/* Returns whether the flat index is that of a cell; otherwise it is padding. */
static inline bool grid_lattice_is_cell(const grid_lattice *l, int64_t cell)
{
    int64_t number = 0;
    for (int axis = 0; axis < 3; axis++) {
        const int64_t index = grid_index_along(&l->cell_numbering, axis, cell);
        if (index >= (l->cells[axis] ? l->cells[axis] : 1)) return false;
        number += index * l->cell_numbering.stride[axis];
    }
    return number == cell;
}

/* Returns whether the flat index is that of a cell outside the ghost layers. */
static inline bool grid_lattice_is_drawn(const grid_lattice *l, int64_t cell)
{
    for (int axis = 0; axis < 3; axis++) {
        const int64_t index = grid_index_along(&l->cell_numbering, axis, cell);
        if (index < l->drawn_first[axis] || index >= l->drawn_end[axis]) return false;
    }
    return grid_lattice_is_cell(l, cell);
}

/* Stores the cell's vertex indices in VTK's order and returns their number. For polyhedra and polygons it stores
 * nothing and returns 0: use grid_walk for these. */
static inline int grid_cell_vertices(const grid *g, int64_t cell, int64_t vertices[GRID_MAX_CELL_VERTICES])
{
    const int count = grid_type_vertex_count(grid_cell_type(g, cell));
    if (g->lattice) {
        const int64_t base = grid_lattice_first_vertex(g->lattice, cell);
        for (int i = 0; i < count; i++) vertices[i] = base + g->lattice->corner_offsets[i];
        return count;
    }
    const int64_t first = g->offsets.data ? grid_read_index(&g->offsets, cell) : cell * count;
    for (int i = 0; i < count; i++) vertices[i] = grid_read_index(&g->connectivity, first + i);
    return count;
}

/* Returns whether the grid may contain polyhedra. */
static inline bool grid_may_have_polyhedra(const grid *g)
{
    return g->face_offsets.data != 0;
}

/* Returns the range of a polyhedron's faces: the entries [*first, *end) of connectivity. */
static inline void grid_cell_faces(const grid *g, int64_t cell, int64_t *first, int64_t *end)
{
    *first = grid_read_index(&g->offsets, cell);
    *end = grid_offset_end(&g->offsets, cell);
}

/* Returns the range of a face's vertices: the entries [*first, *end) of face_connectivity. */
static inline void grid_face_vertices(const grid *g, int64_t face, int64_t *first, int64_t *end)
{
    *first = grid_read_index(&g->face_offsets, face);
    *end = grid_offset_end(&g->face_offsets, face);
}

/* Iterates over the vertices of a cell of any type. A vertex of a polyhedron is returned once for each face that
 * contains it. */
typedef struct grid_walk {
    const grid *cells;
    const grid_array *vertices; /* the vertex indices: connectivity, or for a polyhedron face_connectivity */
    /* for a lattice: differences between the flat indices of the cell's vertices and that of its first one; else
     * NULL */
    const int64_t *corner_offsets;
    int64_t base;      /* for a lattice: flat index of the cell's first vertex */
    int64_t next, end; /* positions, in `vertices` or in corner_offsets, of the next entry to visit and of the end */
    /* for a polyhedron: positions, in connectivity, of the next face to visit and of the end; for other cells, both are
     * equal */
    int64_t face_next, face_end;
} grid_walk;

static inline grid_walk grid_walk_cell(const grid *g, int64_t cell)
{
    grid_walk w = {.cells = g, .vertices = &g->connectivity};
    const int type = grid_cell_type(g, cell), count = grid_type_vertex_count(type);
    if (type == GRID_POLYHEDRON) {
        w.vertices = &g->face_connectivity;
        grid_cell_faces(g, cell, &w.face_next, &w.face_end);
        return w;
    }
    if (g->lattice) {
        w.corner_offsets = g->lattice->corner_offsets;
        w.base = grid_lattice_first_vertex(g->lattice, cell);
        w.end = count;
        return w;
    }
    w.next = g->offsets.data ? grid_read_index(&g->offsets, cell) : cell * count;
    w.end = type == GRID_POLYGON ? grid_offset_end(&g->offsets, cell) : w.next + count;
    return w;
}

/* Continues with the entries of a polyhedron's next face. Returns false after the last face, and for other cells. */
static inline bool grid_walk_next_face(grid_walk *w)
{
    if (w->face_next == w->face_end) return false;
    const int64_t face = grid_read_index(&w->cells->connectivity, w->face_next++);
    grid_face_vertices(w->cells, face, &w->next, &w->end);
    return true;
}

/* Returns the vertex of an entry between w->next and w->end. */
static inline int64_t grid_walk_vertex(const grid_walk *w, int64_t entry)
{
    return w->corner_offsets ? w->base + w->corner_offsets[entry] : grid_read_index(w->vertices, entry);
}

/* Stores the next vertex; returns false after the last one. */
static inline bool grid_walk_next(grid_walk *w, int64_t *vertex)
{
    while (w->next == w->end)
        if (!grid_walk_next_face(w)) return false;
    *vertex = grid_walk_vertex(w, w->next++);
    return true;
}

static inline void grid_read_vertex_position(const grid *g, int64_t vertex, double position[3])
{
    for (int axis = 0; axis < 3; axis++) position[axis] = grid_read_number(&g->coordinates[axis], vertex);
}

/* Returns whether the flag of a cell is nonzero. The grid must have flags. */
static inline bool grid_is_flagged_as_ghost(const grid *g, int64_t cell)
{
    const char *p = g->ghosts + cell * g->ghosts_stride;
    if (g->ghosts_bytes == 1) return *p != 0;
    return g->ghosts_bytes == 4 ? *(const int32_t *)(const void *)p != 0 : *(const int64_t *)(const void *)p != 0;
}

static inline bool grid_is_ghost(const grid *g, int64_t cell)
{
    if (g->ghosts && grid_is_flagged_as_ghost(g, cell)) return true;
    return g->lattice && g->lattice->has_ghosts && !grid_lattice_is_drawn(g->lattice, cell);
}

/* Returns whether some cells may be ghosts. */
static inline bool grid_has_ghosts(const grid *g)
{
    return g->ghosts || (g->lattice && g->lattice->has_ghosts);
}

static inline bool grid_is_flat(const grid *g, int64_t cell)
{
    return g->flat && (g->flat[cell / 64] >> (cell % 64) & 1);
}

static inline bool grid_is_shell(const grid *g, int64_t cell)
{
    return grid_is_flat(g, cell) && grid_is_shell_type(grid_cell_type(g, cell));
}

/* Returns whether the cell is neither a ghost nor omitted because it has no volume (grid.flat). Trees contain only such
 * cells. */
static inline bool grid_is_drawn(const grid *g, int64_t cell)
{
    return !grid_is_ghost(g, cell) && !grid_is_flat(g, cell);
}

/* Returns whether pictures may show the cell: it is not a ghost, and it has a volume or is a shell. */
static inline bool grid_can_be_shown(const grid *g, int64_t cell)
{
    return !grid_is_ghost(g, cell) && (!grid_is_flat(g, cell) || grid_is_shell(g, cell));
}

/* Returns one component of the field as an array over all tuples. */
static inline grid_array grid_field_component(const grid_field *f, int component)
{
    grid_array a = f->component_arrays ? f->component_arrays[component] : f->values;
    if (!f->component_arrays) a.data += component * f->component_stride;
    return a;
}

/* Returns one component of tuple i. The array's description is not copied, because copying it takes longer than reading
 * the value. */
static inline double grid_field_component_value(const grid_field *f, int component, int64_t i)
{
    if (f->component_arrays) return grid_read_number(&f->component_arrays[component], i);
    return grid_read_element_number(&f->values,
                                    f->values.data + component * f->component_stride + i * f->values.stride);
}

static inline double grid_field_value(const grid_field *f, int64_t i)
{
    if (f->component >= 0) return grid_field_component_value(f, f->component, i);
    double sum = 0;
    for (int c = 0; c < f->component_count; c++) {
        const double v = grid_field_component_value(f, c, i);
        sum += v * v;
    }
    return sqrt(sum);
}

/* Returns whether the cell's own value is finite, if values at vertices were computed from cell values; otherwise
 * returns true. */
static inline bool grid_has_finite_cell_value(const grid_field *f, int64_t cell)
{
    return !f->source_cells || isfinite(grid_field_value(f->source_cells, cell));
}

/* Reads the values at the cell's vertices, or stores the cell's own value `count` times. Returns false if a value is
 * NaN or infinite: such a cell is not drawn. */
static inline bool grid_cell_values(const grid_field *f, int64_t cell, const int64_t *vertices, int count,
                                    double *values)
{
    bool finite = grid_has_finite_cell_value(f, cell);
    for (int i = 0; i < count; i++) {
        values[i] = grid_field_value(f, f->is_cell_centred ? cell : vertices[i]);
        finite = finite && isfinite(values[i]);
    }
    return finite;
}

#endif
