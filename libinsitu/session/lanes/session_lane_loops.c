/* Defines the loops over cells (session_lanes.h) for one instruction set, in the table SESSION_LANES_TABLE. This file
 * is compiled once per instruction set (CMakeLists.txt).
 *
 * A block of cells is processed in two passes. The first reads vertices and computes bounds and volumes, the second
 * computes sizes from the volumes. In a single pass a tet would take 5.8 ns instead of 4.0, because each cube root
 * depends on a volume, and the core's out-of-order window is too small to overlap this work with that on other cells.
 * Instead of volumes and sizes, multiples of them are computed: sums over corners, and the cube roots of these sums.
 * The divisions follow once, at the end. Numbers are loaded one by one, since gather instructions take 1.6 times as
 * long. */
#include <stdbool.h>

#include "session_corners.h"
#include "session_lane_vectors.h"
#include "session_lanes.h"

enum {
    BLOCK_CELLS = 512,          /* number of cells of a block; their volumes fit into the first-level cache */
    PARTS = LANES / LANE_WIDTH, /* number of vectors that together hold one number for each of LANES cells */
    AHEAD = 512 /* prefetch distance in entries of the connectivity, because the hardware prefetches too late */
};

/* Addresses and strides of the mesh's arrays. They are constant during one call of a lane_run function. */
typedef struct lane_source {
    const char *connectivity, *ghosts;
    /* for each axis, the address of the coordinate of a vertex with index 0; if indices begin at 1, this address is
     * outside of the array */
    uintptr_t axis_data[3];
    int64_t connectivity_stride, ghosts_stride, stride;
    int64_t least_index, greatest_index; /* smallest and largest valid vertex index in the connectivity */
    int type, count;                     /* type of the cells, and number of vertices of each cell */
    int ghosts_bytes;                    /* size of a ghost flag in bytes */
    /* wide_index: indices have 8 bytes instead of 4; wide_number: coordinates have 8 bytes instead of 4 */
    bool wide_index, wide_number;
} lane_source;

/* Positions of the vertices of LANE_WIDTH cells: floats are stored in `narrow`, doubles in `wide`. */
typedef struct lane_points {
    floats narrow[GRID_MAX_CELL_VERTICES][3];
    doubles wide[GRID_MAX_CELL_VERTICES][3];
} lane_points;

/* Bounds of vertex positions. The float members are used if coordinates are floats, otherwise the double members. */
typedef struct lane_bounds {
    floats narrow_lower[3], narrow_upper[3];
    doubles lower[3], upper[3];
} lane_bounds;

/* Results of one call of a lane_run function. Each lane of the vectors contains the results over the cells that this
 * lane has processed. */
typedef struct lane_sizes {
    doubles sums[PARTS];   /* sums of the cube roots of (absolute volume × volume factor) */
    doubles least;         /* smallest (absolute volume × volume factor); see cell_corners.volume_factor */
    words inverted_counts; /* negated number of cells with a negative volume */
} lane_sizes;

LANE_INLINE lane_bounds make_empty_bounds(void)
{
    lane_bounds b;
    for (int axis = 0; axis < 3; axis++) {
        b.narrow_lower[axis] = floats_set((float)INFINITY);
        b.narrow_upper[axis] = floats_set(-(float)INFINITY);
        b.lower[axis] = doubles_set((double)INFINITY);
        b.upper[axis] = doubles_set(-(double)INFINITY);
    }
    return b;
}

LANE_INLINE lane_sizes make_zero_size_sums(void)
{
    lane_sizes s = {.least = doubles_set((double)INFINITY)};
    for (int part = 0; part < PARTS; part++) s.sums[part] = doubles_set(0);
    return s;
}

LANE_INLINE lane_source describe_input_arrays(const lane_cells *cells, const int type, const bool wide_index,
                                              const bool wide_number)
{
    const grid *g = cells->g;
    lane_source s = {.connectivity = g->connectivity.data + cells->first_entry * g->connectivity.stride,
                     .connectivity_stride = g->connectivity.stride,
                     .stride = g->coordinates[0].stride,
                     .least_index = g->connectivity.base,
                     .greatest_index = g->vertex_count - 1,
                     .type = type,
                     .count = grid_type_vertex_count(type),
                     .wide_index = wide_index,
                     .wide_number = wide_number};
    if (g->ghosts) s.ghosts = g->ghosts + cells->first * g->ghosts_stride;
    s.ghosts_stride = g->ghosts_stride;
    s.ghosts_bytes = g->ghosts_bytes;
    for (int axis = 0; axis < 3; axis++)
        s.axis_data[axis] = (uintptr_t)g->coordinates[axis].data - (uintptr_t)(s.least_index * s.stride);
    return s;
}

/* ---- indices and positions of vertices ----------------------------------------------------------------------- */

static __attribute__((noinline)) void pack_indices(const char *from, int64_t stride, int count, int64_t size, char *out)
{
    for (int i = 0; i < count; i++) memcpy(out + i * size, from + i * stride, (size_t)size);
}

/* Returns a pointer to the vertex indices of LANES cells, without gaps. If they are contiguous in the connectivity, the
 * result points into it, and otherwise to `buffer`, into which they are copied. */
LANE_INLINE const char *load_indices(const lane_source *s, int64_t cell, int64_t buffer[LANES * GRID_MAX_CELL_VERTICES])
{
    const char *from = s->connectivity + cell * s->count * s->connectivity_stride;
    const int64_t size = s->wide_index ? (int64_t)sizeof(int64_t) : (int64_t)sizeof(int32_t);
    for (int64_t at = 0; at < LANES * s->count * s->connectivity_stride; at += 64)
        __builtin_prefetch(from + AHEAD * s->connectivity_stride + at);
    if (s->connectivity_stride == size) return from;
    pack_indices(from, s->connectivity_stride, LANES * s->count, size, (char *)buffer);
    return (const char *)buffer;
}

LANE_INLINE int64_t read_index(const lane_source *s, const char *indices, int i)
{
    return s->wide_index ? ((const int64_t *)(const void *)indices)[i] : ((const int32_t *)(const void *)indices)[i];
}

/* Returns whether all indices are valid. An index, counted from 0, is valid if neither the index nor (last - index) is
 * negative. The sign bits of all these numbers are combined in `signs`. */
LANE_INLINE bool are_valid_wide_indices(const int64_t *indices, int count, int64_t base, int64_t last)
{
    int64_t signs = last;
    for (int i = 0; i < count; i++) {
        const int64_t index = (int64_t)((uint64_t)indices[i] - (uint64_t)base);
        signs |= indices[i] | index | (last - (index & INT64_MAX));
    }
    return signs >= 0;
}

LANE_INLINE bool are_valid_narrow_indices(const uint32_t *indices, int count, int64_t base, int64_t last)
{
    const uint32_t narrow_base = (uint32_t)base, narrow_last = last < INT32_MAX ? (uint32_t)last : INT32_MAX;
    uint32_t signs = narrow_last;
    for (int i = 0; i < count; i++) {
        const uint32_t index = indices[i] - narrow_base;
        signs |= indices[i] | index | (narrow_last - index);
    }
    return !(signs >> 31);
}

LANE_INLINE bool are_valid_indices(const lane_source *s, const char *indices)
{
    return s->wide_index ? are_valid_wide_indices((const int64_t *)(const void *)indices, LANES * s->count,
                                                  s->least_index, s->greatest_index)
                         : are_valid_narrow_indices((const uint32_t *)(const void *)indices, LANES * s->count,
                                                    s->least_index, s->greatest_index);
}

LANE_INLINE bool has_ghost_in_lanes(const lane_source *s, int64_t cell)
{
    char any = 0;
    for (int lane = 0; lane < LANES; lane++)
        for (int i = 0; i < s->ghosts_bytes; i++) any = (char)(any | s->ghosts[(cell + lane) * s->ghosts_stride + i]);
    return any != 0;
}

#if LANE_WIDTH == 8
#define EACH_LANE(OF) OF(0), OF(1), OF(2), OF(3), OF(4), OF(5), OF(6), OF(7)
#else
#define EACH_LANE(OF) OF(0), OF(1), OF(2), OF(3)
#endif

LANE_INLINE floats gather_floats(uintptr_t data, const int64_t *at)
{
#define FLOAT_AT(lane) *(const float *)(data + (uintptr_t)at[lane])
    return (floats){EACH_LANE(FLOAT_AT)};
#undef FLOAT_AT
}

LANE_INLINE doubles gather_doubles(uintptr_t data, const int64_t *at)
{
#define DOUBLE_AT(lane) *(const double *)(data + (uintptr_t)at[lane])
    return (doubles){EACH_LANE(DOUBLE_AT)};
#undef DOUBLE_AT
}

LANE_INLINE void gather_points(const lane_source *s, const char *indices, int first_lane, lane_points *out)
{
    for (int i = 0; i < s->count; i++) {
        int64_t at[LANE_WIDTH];
#pragma GCC unroll 8
        for (int lane = 0; lane < LANE_WIDTH; lane++)
            at[lane] = read_index(s, indices, (first_lane + lane) * s->count + i) * s->stride;
#pragma GCC unroll 3
        for (int axis = 0; axis < 3; axis++) {
            if (s->wide_number)
                out->wide[i][axis] = gather_doubles(s->axis_data[axis], at);
            else
                out->narrow[i][axis] = gather_floats(s->axis_data[axis], at);
        }
    }
}

LANE_INLINE doubles get_coordinates_as_doubles(const lane_source *s, const lane_points *points, int vertex, int axis)
{
    return s->wide_number ? points->wide[vertex][axis] : doubles_from_floats(points->narrow[vertex][axis]);
}

/* Returns, per lane, the cell's volume multiplied by cell_corners.volume_factor, as a sum over its corners. */
LANE_INLINE doubles sum_corner_volumes(const lane_source *s, const lane_points *points)
{
    const cell_corners of = get_corners_of_cell_type(s->type);
    doubles sum = doubles_set(0);
#pragma GCC unroll 8
    for (int i = 0; i < of.count; i++) {
        const signed char *corner = of.corners[i];
        doubles edge[3][3];
        for (int k = 0; k < 3; k++)
            for (int axis = 0; axis < 3; axis++)
                edge[k][axis] = get_coordinates_as_doubles(s, points, corner[k + 1], axis) -
                                get_coordinates_as_doubles(s, points, corner[0], axis);
        const doubles *u = edge[0], *v = edge[1], *w = edge[2];
        sum += u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) +
               u[2] * (v[0] * w[1] - v[1] * w[0]);
    }
    return sum;
}

LANE_INLINE void extend_bounds_by_vertices(const lane_source *s, const lane_points *points, lane_bounds *b)
{
    for (int i = 0; i < s->count; i++)
        for (int axis = 0; axis < 3; axis++) {
            if (s->wide_number) {
                b->lower[axis] = doubles_min(points->wide[i][axis], b->lower[axis]);
                b->upper[axis] = doubles_max(points->wide[i][axis], b->upper[axis]);
            } else {
                b->narrow_lower[axis] = floats_min(points->narrow[i][axis], b->narrow_lower[axis]);
                b->narrow_upper[axis] = floats_max(points->narrow[i][axis], b->narrow_upper[axis]);
            }
        }
}

/* Computes the volumes (times cell_corners.volume_factor) and the bounds of cells [begin, end), LANES at a time. Stops
 * before a group of LANES cells that contains a ghost or an invalid index, or if fewer than LANES cells are left.
 * Returns the cell at which it stopped. */
LANE_INLINE int64_t compute_cell_volumes_and_bounds(const lane_source *s, int64_t begin, int64_t end,
                                                    lane_bounds *bounds, double *volumes)
{
    lane_bounds b = *bounds;
    int64_t cell = begin;
    for (; cell + LANES <= end; cell += LANES) {
        int64_t buffer[LANES * GRID_MAX_CELL_VERTICES];
        const char *const indices = load_indices(s, cell, buffer);
        if (!are_valid_indices(s, indices) || (s->ghosts && has_ghost_in_lanes(s, cell))) break;
#pragma GCC unroll 2
        for (int part = 0; part < PARTS; part++) {
            lane_points points;
            gather_points(s, indices, part * LANE_WIDTH, &points);
            doubles_store(volumes, sum_corner_volumes(s, &points));
            extend_bounds_by_vertices(s, &points, &b);
            volumes += LANE_WIDTH;
        }
    }
    *bounds = b;
    return cell;
}

/* ---- sizes of cells (cube roots of volumes) ------------------------------------------------------------------ */

LANE_INLINE doubles compute_cube_roots(doubles x)
{
    doubles y = (doubles)((((((bits)x >> 32) * CUBE_ROOT_THIRD) >> 32) + CUBE_ROOT_OFFSET) << 32);
    for (int step = 0; step < CUBE_ROOT_STEPS; step++) {
        const doubles cube = y * y * y;
        y *= (cube + 2 * x) / (2 * cube + x);
    }
    return y;
}

/* Computes the sizes of cells from `count` volumes, and adds them to the sums; count must be a multiple of LANES. If a
 * volume is 0, too small, too large or NaN, returns false and leaves the sums unchanged. */
LANE_INLINE bool add_cell_sizes_to_sums(const double *volumes, int64_t count, lane_sizes *sizes)
{
    lane_sizes s = *sizes;
    words unusual = {0};
    for (int64_t i = 0; i < count; i += LANES) {
#pragma GCC unroll 2
        for (int part = 0; part < PARTS; part++) {
            const doubles volume = doubles_load(volumes + i + part * LANE_WIDTH), size = doubles_magnitude(volume);
            unusual |= ~((words)(size > 1e-280) & (words)(size < 1e280));
            s.least = doubles_min(size, s.least);
            s.inverted_counts += (words)(volume < 0); /* the comparison results in -1 if the volume is negative */
            s.sums[part] += compute_cube_roots(size);
        }
    }
    if (words_any(unusual)) return false;
    *sizes = s;
    return true;
}

/* ---- loops over all cells of one type ------------------------------------------------------------------------ */

LANE_INLINE void reduce_bounds_over_lanes(const lane_bounds *b, lane_sums *out)
{
    for (int axis = 0; axis < 3; axis++) {
        const doubles lower = doubles_min(doubles_from_floats(b->narrow_lower[axis]), b->lower[axis]);
        const doubles upper = doubles_max(doubles_from_floats(b->narrow_upper[axis]), b->upper[axis]);
        out->lower[axis] = (double)INFINITY;
        out->upper[axis] = -(double)INFINITY;
        for (int lane = 0; lane < LANE_WIDTH; lane++) {
            out->lower[axis] = lower[lane] < out->lower[axis] ? lower[lane] : out->lower[axis];
            out->upper[axis] = upper[lane] > out->upper[axis] ? upper[lane] : out->upper[axis];
        }
    }
}

LANE_INLINE void reduce_cell_sizes_over_lanes(const lane_sizes *s, double volume_factor, double root_of_factor,
                                              lane_sums *out)
{
    double sum = 0, least = (double)INFINITY;
    out->inverted_count = 0;
    for (int part = 0; part < PARTS; part++)
        for (int lane = 0; lane < LANE_WIDTH; lane++) sum += s->sums[part][lane];
    for (int lane = 0; lane < LANE_WIDTH; lane++) {
        least = s->least[lane] < least ? s->least[lane] : least;
        out->inverted_count -= s->inverted_counts[lane];
    }
    out->least = least / volume_factor;
    out->size_sum = sum / root_of_factor;
}

LANE_INLINE int64_t compute_bounds_and_size_sums(const lane_cells *cells, lane_sums *sums, int64_t *scalar_count,
                                                 const int type, const bool wide_index, const bool wide_number)
{
    _Alignas(64) double volumes[BLOCK_CELLS];
    const lane_source s = describe_input_arrays(cells, type, wide_index, wide_number);
    const double volume_factor = get_corners_of_cell_type(type).volume_factor;
    lane_bounds bounds = make_empty_bounds();
    lane_sizes sizes = make_zero_size_sums();
    int64_t cell = 0;
    *scalar_count = 0;
    while (cell < cells->count && !*scalar_count) {
        const int64_t end = cell + BLOCK_CELLS < cells->count ? cell + BLOCK_CELLS : cells->count;
        const int64_t next = compute_cell_volumes_and_bounds(&s, cell, end, &bounds, volumes);
        if (!add_cell_sizes_to_sums(volumes, next - cell, &sizes)) {
            for (const double *good = volumes; add_cell_sizes_to_sums(good, LANES, &sizes); good += LANES)
                cell += LANES;
            *scalar_count = LANES;
            break;
        }
        cell = next;
        if (cell < end) *scalar_count = end - cell < LANES ? end - cell : LANES;
    }
    reduce_bounds_over_lanes(&bounds, sums);
    reduce_cell_sizes_over_lanes(&sizes, volume_factor, cbrt(volume_factor), sums);
    return cell;
}

#define DEFINE_RUN(name, type, wide_index, wide_number)                                                                \
    static int64_t name(const lane_cells *cells, lane_sums *sums, int64_t *scalar_count)                               \
    {                                                                                                                  \
        return compute_bounds_and_size_sums(cells, sums, scalar_count, type, wide_index, wide_number);                 \
    }

#define DEFINE_RUNS(name, type)                                                                                        \
    DEFINE_RUN(name##_44, type, false, false)                                                                          \
    DEFINE_RUN(name##_48, type, false, true)                                                                           \
    DEFINE_RUN(name##_84, type, true, false)                                                                           \
    DEFINE_RUN(name##_88, type, true, true)

DEFINE_RUNS(run_tets, GRID_TET)
DEFINE_RUNS(run_hexes, GRID_HEX)
DEFINE_RUNS(run_wedges, GRID_WEDGE)
DEFINE_RUNS(run_pyramids, GRID_PYRAMID)

#define RUNS_OF(name)                                                                                                  \
    {                                                                                                                  \
        {name##_44, name##_48},                                                                                        \
        {                                                                                                              \
            name##_84, name##_88                                                                                       \
        }                                                                                                              \
    }

const lane_loops SESSION_LANES_TABLE = {.runs = {[LANE_TETS] = RUNS_OF(run_tets),
                                                 [LANE_HEXES] = RUNS_OF(run_hexes),
                                                 [LANE_WEDGES] = RUNS_OF(run_wedges),
                                                 [LANE_PYRAMIDS] = RUNS_OF(run_pyramids)}};
