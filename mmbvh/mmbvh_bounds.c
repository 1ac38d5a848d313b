/* Computes the bounds of cells from their vertices, for the builders. */
#include "mmbvh_bounds.h"

#include "region.h"

#include <omp.h>

#define DEFINE_READ(name, shape, wide_index, wide_number)                                                              \
    static void name(const bounds_source *source, const uint32_t *cells, int count, fetch_box *boxes)                  \
    {                                                                                                                  \
        for (int i = 0; i < count; i++) {                                                                              \
            fetch_box_empty(&boxes[i]);                                                                                \
            extend_box_by_cells(&boxes[i], source->g, cells + i, 1, shape, wide_index, wide_number);                   \
        }                                                                                                              \
    }
FETCH_INSTANCES(DEFINE_READ, read)

MMBVH_INLINE void read_float_boxes(const grid *g, const uint32_t *cells, int count, fetch_float_box *float_boxes,
                                   const fetch_shape shape, const bool wide_index, const bool is_packed)
{
    for (int i = 0; i < count; i++) {
        fetch_float_box float_box = fetch_float_box_empty();
        prefetch_later_cell(g, cells[i], shape);
        extend_float_box(&float_box, g, cells[i], shape, wide_index, is_packed);
        float_boxes[i] = float_box;
    }
}

#define DEFINE_READ_FLOAT_BOXES(name, shape, wide_index, wide_number)                                                  \
    static void name(const bounds_source *source, const uint32_t *cells, int count, fetch_float_box *float_boxes)      \
    {                                                                                                                  \
        if (fetch_is_contiguous(&source->g->coordinates[0])) {                                                         \
            read_float_boxes(source->g, cells, count, float_boxes, shape, wide_index, true);                           \
        } else {                                                                                                       \
            read_float_boxes(source->g, cells, count, float_boxes, shape, wide_index, false);                          \
        }                                                                                                              \
    }
FETCH_FLOAT_INSTANCES(DEFINE_READ_FLOAT_BOXES, read_float_boxes)

MMBVH_INLINE void prefetch_cells(const grid *g, const uint32_t *cells, int cell_count, const fetch_shape shape)
{
    for (int k = 0; k < cell_count; k++) {
        const int64_t first = fetch_first_entry(g, cells[k], fetch_vertex_count(g, cells[k], shape), shape);
        prefetch_connectivity(g, first, shape);
    }
}

#define DEFINE_EXTEND(name, shape, wide_index, wide_number)                                                            \
    static void name(const bounds_source *source, const uint32_t *cells, int count, const uint32_t *later,             \
                     fetch_box *box)                                                                                   \
    {                                                                                                                  \
        if (later) prefetch_cells(source->g, later, count, shape);                                                     \
        extend_box_by_cells(box, source->g, cells, count, shape, wide_index, wide_number);                             \
    }
FETCH_INSTANCES(DEFINE_EXTEND, extend)

static void read_any(const bounds_source *source, const uint32_t *cells, int count, fetch_box *boxes)
{
    for (int i = 0; i < count; i++) {
        fetch_box_empty(&boxes[i]);
        extend_box_by_any_cell(&boxes[i], source->g, cells[i]);
    }
}

static void extend_by_any_cells(const bounds_source *source, const uint32_t *cells, int count, const uint32_t *later,
                                fetch_box *box)
{
    (void)later;
    for (int i = 0; i < count; i++) extend_box_by_any_cell(box, source->g, cells[i]);
}

static void read_given_boxes(const bounds_source *source, const uint32_t *cells, int count, fetch_box *boxes)
{
    for (int i = 0; i < count; i++) {
        for (int axis = 0; axis < 3; axis++) {
            boxes[i].lower[axis] = (double)source->lower[3 * (int64_t)cells[i] + axis];
            boxes[i].upper[axis] = (double)source->upper[3 * (int64_t)cells[i] + axis];
        }
    }
}

static void extend_by_given_boxes(const bounds_source *source, const uint32_t *cells, int count, const uint32_t *later,
                                  fetch_box *box)
{
    (void)later;
    for (int i = 0; i < count; i++) {
        fetch_box given;
        read_given_boxes(source, cells + i, 1, &given);
        unite_boxes(box, &given);
    }
}

bounds_source bounds_source_make(const grid *g, const float *lower, const float *upper, int64_t count,
                                 const double origin[3], double scale)
{
    static bounds_read *const reads[FETCH_SHAPES][2][2] = FETCH_TABLE(read);
    static bounds_read_float_boxes *const reads_float_boxes[FETCH_SHAPES][2] = FETCH_FLOAT_TABLE(read_float_boxes);
    static bounds_extend *const extends[FETCH_SHAPES][2][2] = FETCH_TABLE(extend);
    bounds_source s = {.g = g, .scale = scale, .lower = lower, .upper = upper, .box_count = count};
    s.read = g ? read_any : read_given_boxes;
    s.extend = g ? extend_by_any_cells : extend_by_given_boxes;
    for (int axis = 0; axis < 3; axis++) s.origin[axis] = origin[axis];
    if (!g || !fetch_can_read_boxes(g)) return s;
    s.read = reads[fetch_grid_shape(g)][g->connectivity.is_wide][g->coordinates[0].is_wide];
    if (!g->coordinates[0].is_wide)
        s.read_float_boxes = reads_float_boxes[fetch_grid_shape(g)][g->connectivity.is_wide];
    s.extend = extends[fetch_grid_shape(g)][g->connectivity.is_wide][g->coordinates[0].is_wide];
    return s;
}

/* Computes the smallest and largest finite value of an array of any type. */
static void compute_array_range_any_type(const grid_array *a, int64_t count, int threads, double *least, double *most)
{
    double low = INFINITY, high = -INFINITY;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) reduction(min : low) reduction(max : high) nowait
        for (int64_t i = 0; i < count; i++) {
            const double x = grid_read_number(a, i);
            const bool usable = x - x == 0;
            low = usable && x < low ? x : low;
            high = usable && x > high ? x : high;
        }
        region_leave();
    }
    *least = low;
    *most = high;
}

static inline float load_float(const char *p)
{
    return *(const float *)(const void *)p;
}

/* Computes the smallest and largest value of an array of floats, four at a time. NaN is ignored. */
MMBVH_INLINE void compute_array_range_floats(const char *data, const int64_t stride, int64_t count, float *least,
                                             float *most)
{
    enum { LANES = 4 };
    vec4 low = vec4_set1(INFINITY), high = vec4_set1(-INFINITY);
    const char *p = data;
    for (int64_t i = 0; i + LANES <= count; i += LANES, p += LANES * stride) {
        const vec4 x = {load_float(p), load_float(p + stride), load_float(p + 2 * stride), load_float(p + 3 * stride)};
        low = vec4_min(x, low);
        high = vec4_max(x, high);
    }
    for (int64_t i = count / LANES * LANES; i < count; i++, p += stride) {
        const vec4 x = vec4_set1(load_float(p));
        low = vec4_min(x, low);
        high = vec4_max(x, high);
    }
    for (int lane = 0; lane < LANES; lane++) {
        *least = low[lane] < *least ? low[lane] : *least;
        *most = high[lane] > *most ? high[lane] : *most;
    }
}

static void compute_array_range(const grid_array *a, int64_t count, int threads, double *least, double *most)
{
    enum { BLOCK = 65536 };
    float low = INFINITY, high = -INFINITY;
    if (a->axis) {
        const grid_array places = {
            .data = (const char *)a->axis->axis_coordinates, .stride = sizeof(double), .is_wide = true};
        compute_array_range_any_type(&places, a->axis->count, 1, least, most);
        return;
    }
    if (a->is_wide || a->is_integer) {
        compute_array_range_any_type(a, count, threads, least, most);
        return;
    }
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(dynamic) reduction(min : low) reduction(max : high) nowait
        for (int64_t begin = 0; begin < count; begin += BLOCK) {
            const int64_t n = count - begin < BLOCK ? count - begin : BLOCK;
            const char *data = a->data + begin * a->stride;
            if (a->stride == sizeof(float)) {
                compute_array_range_floats(data, sizeof(float), n, &low, &high);
            } else {
                compute_array_range_floats(data, a->stride, n, &low, &high);
            }
        }
        region_leave();
    }
    *least = (double)low;
    *most = (double)high;
    if (!(low > -INFINITY && high < INFINITY)) compute_array_range_any_type(a, count, threads, least, most);
}

fetch_box bounds_estimate(const bounds_source *source, int threads)
{
    fetch_box box;
    const int64_t size = (int64_t)sizeof(float);
    for (int axis = 0; axis < 3; axis++) {
        if (source->g) {
            const grid_array *a = &source->g->coordinates[axis];
            compute_array_range(a, source->g->vertex_count, threads, &box.lower[axis], &box.upper[axis]);
        } else {
            double unused;
            const grid_array lower = {.data = (const char *)(source->lower + axis), .stride = 3 * size};
            const grid_array upper = {.data = (const char *)(source->upper + axis), .stride = 3 * size};
            compute_array_range(&lower, source->box_count, 1, &box.lower[axis], &unused);
            compute_array_range(&upper, source->box_count, 1, &unused, &box.upper[axis]);
        }
    }
    bounds_transform(source, &box);
    return box;
}

item_grid item_grid_make(const double lower[3], const double upper[3])
{
    item_grid grid = {.is_finest = true};
    bool has_extent[3];
    double longest = 0;
    for (int axis = 0; axis < 3; axis++) {
        const double extent = upper[axis] - lower[axis], far = fmax(fabs(lower[axis]), fabs(upper[axis]));
        has_extent[axis] = extent > 0 && extent < INFINITY;
        longest = has_extent[axis] && extent > longest ? extent : longest;
        grid.origin[axis] = lower[axis];
        /* The grid is the finest useful one if its steps are below the precision of the nodes' bounds. The bounds are
         * floats. */
        if (extent > far * 0x1p-22) grid.is_finest = false;
    }
    grid.step = longest / ITEM_TOP;
    for (int axis = 0; axis < 3; axis++)
        grid.inverse_step[axis] = has_extent[axis] && grid.step > 0 ? 1 / grid.step : 0;
    return grid;
}

static int list_block_cells(const item *items, int64_t count, uint32_t cells[BOUNDS_BLOCK])
{
    const int n = (int)(count < BOUNDS_BLOCK ? count : BOUNDS_BLOCK);
    for (int i = 0; i < n; i++) cells[i] = item_index(items[i]);
    return n;
}

/* Maps floats in the source's coordinates to grid steps. The origin is rounded to float, so that the difference from a
 * nearby coordinate is exact; the difference from a distant one has a relative error of at most 2^-24. */
typedef struct float_mapping {
    vec4 origin;
    vec4 factor;
} float_mapping;

static float_mapping float_mapping_make(const bounds_source *source, const item_grid *grid)
{
    float_mapping m = {.factor = {0}};
    for (int axis = 0; axis < 3; axis++) {
        m.origin[axis] = (float)(source->origin[axis] + grid->origin[axis] / source->scale);
        m.factor[axis] = (float)(source->scale * grid->inverse_step[axis]);
    }
    return m;
}

/* Rounds a position to the nearest step of the grid. NaN becomes 0. */
static inline ivec4 round_to_steps(const float_mapping *m, vec4 x)
{
    const vec4 steps = (x - m->origin) * m->factor + 0.5f;
    return vec4_truncate(vec4_min(vec4_max(steps, (vec4){0}), vec4_set1(ITEM_TOP)));
}

static inline item item_of_float_box(const float_mapping *m, const fetch_float_box *float_box, uint32_t index)
{
    const lanes box = lanes_pack(ITEM_TOP - round_to_steps(m, float_box->lower), round_to_steps(m, float_box->upper));
    return (box & (lanes){-1, -1, -1, 0, -1, -1, -1, 0}) | item_of_index(index);
}

static void quantize_float_boxes(const bounds_source *source, const item_grid *grid, item *items, int64_t count,
                                 item_set *set, fetch_float_box *exact)
{
    uint32_t cells[BOUNDS_BLOCK];
    fetch_float_box float_boxes[BOUNDS_BLOCK];
    const float_mapping m = float_mapping_make(source, grid);
    for (int64_t begin = 0; begin < count; begin += BOUNDS_BLOCK) {
        const int n = list_block_cells(items + begin, count - begin, cells);
        source->read_float_boxes(source, cells, n, float_boxes);
        for (int i = 0; i < n; i++) {
            unite_float_boxes(exact, &float_boxes[i]);
            items[begin + i] = item_of_float_box(&m, &float_boxes[i], cells[i]);
            item_set_add(set, items[begin + i]);
        }
    }
}

static void quantize_boxes(const bounds_source *source, const item_grid *grid, item *items, int64_t count,
                           item_set *set, fetch_box *exact)
{
    uint32_t cells[BOUNDS_BLOCK];
    fetch_box boxes[BOUNDS_BLOCK];
    for (int64_t begin = 0; begin < count; begin += BOUNDS_BLOCK) {
        const int n = list_block_cells(items + begin, count - begin, cells);
        source->read(source, cells, n, boxes);
        for (int i = 0; i < n; i++) {
            unite_boxes(exact, &boxes[i]);
            bounds_transform(source, &boxes[i]);
            items[begin + i] = item_make(grid, boxes[i].lower, boxes[i].upper, cells[i]);
            item_set_add(set, items[begin + i]);
        }
    }
}

void bounds_fill_items(const bounds_source *source, const item_grid *grid, item *items, int64_t count, item_set *set,
                       fetch_box *exact)
{
    item_set own = item_set_empty();
    fetch_box box;
    fetch_box_empty(&box);
    if (source->read_float_boxes) {
        fetch_float_box float_box = fetch_float_box_empty();
        quantize_float_boxes(source, grid, items, count, &own, &float_box);
        box = fetch_float_box_widen(&float_box);
    } else {
        quantize_boxes(source, grid, items, count, &own, &box);
    }
    item_set_merge(set, &own);
    if (exact) unite_boxes(exact, &box);
}
