/* The state of a search for candidates (kernel_candidates.h), and functions that compute the pixels in which a cell may
 * be visible. Cells are tested SIMD_WIDTH at a time, one per lane (kernel_candidate_surfaces.h, kernel_candidates.h).
 * Cells whose numbers are NaN, or too large or too small for float32, are tested one by one, and their pixels are those
 * of the bounding box of their vertices. On the way to the candidates a cell is in several lists: in `queued` while its
 * connectivity is being prefetched, in `pending` while its vertices are, and in `crossed` if an isovalue crosses it. */
#ifndef RENDER_KERNEL_FINDER_H
#define RENDER_KERNEL_FINDER_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_cell.h"
#include "kernel_cell_values.h"
#include "kernel_shapes.h"
#include "kernel_tile.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "render.h"
#include "simd.h"

/* A list of up to SIMD_WIDTH cells of one type, one per lane. */
typedef struct kernel_cells {
    int type, vertices; /* cell type (grid.h), and number of vertices of each cell */
    int count;
    /* index in the layer of the isovalue that crosses all cells of the list; used only by the lists in
     * kernel_finder.crossed */
    int value;
    uint32_t cell[SIMD_WIDTH];
    int32_t vertex[8][SIMD_WIDTH];
} kernel_cells;

/* Empties the list and sets its type. Callers append to cell[] and vertex[] themselves. */
static inline void kernel_cells_begin(kernel_cells *c, int type)
{
    c->type = type;
    c->vertices = grid_type_vertex_count(type);
    c->count = c->value = 0;
}

/* Fills the unused lanes, from `count` on, with copies of the first cell. */
SIMD_INLINE void kernel_cells_pad_lanes(kernel_cells *c)
{
    for (int n = c->count; n < SIMD_WIDTH; n++) {
        c->cell[n] = c->cell[0];
        for (int i = 0; i < c->vertices; i++) c->vertex[i][n] = c->vertex[i][0];
    }
}

/* Returns, per lane, the index in the mesh of the cell's vertex i. */
SIMD_INLINE vi kernel_cells_load_vertex_indices(const kernel_cells *c, int i)
{
    vi vertex;
    memcpy(&vertex, c->vertex[i], sizeof vertex);
    return vertex;
}

/* The state of a search for candidates: in one subtree, or, if tiles traverse the trees themselves, in all trees for
 * one tile. */
typedef struct kernel_finder {
    const kernel_frame *frame;
    const kernel_surface *surface;   /* the surface layer that is searched; NULL if a volume is searched */
    const kernel_transfer *transfer; /* transfer function of the volume, used if surface is NULL */
    const render_field *field;
    const kernel_visible_values *visible_values;
    kernel_candidate_list *list;
    bool (*grow)(kernel_candidate_list *list);
    int part;
    /* value of kernel_candidate.source for candidates of the layer's first isovalue, or of the volume */
    uint32_t source;
    kernel_planes planes;
    float t_near; /* ray parameter t at the eye's plane */
    /* column_scale, row_scale: number of pixels per unit of slope (per scaled unit if the camera is orthographic);
     * column_0, row_0: column and row, as real numbers, of the ray along the camera's axis */
    float column_scale, row_scale, column_0, row_0;
    int first[2], last[2]; /* first and last column ([0]) and row ([1]) of the pixels to which candidates are clipped */
    kernel_level eye[3];   /* the eye's position in world coordinates */
    kernel_cell cell;
    uint32_t queued[SIMD_WIDTH]; /* cells of leaves whose connectivity is being prefetched */
    int queued_count;
    /* per type (kernel_lane_type_index()), cells whose vertices are being prefetched */
    kernel_cells pending[KERNEL_LANE_TYPES];
    /* per type with quadrilateral faces, cells that an isovalue crosses; they are processed when all lanes are full */
    kernel_cells crossed[KERNEL_CURVED_TYPES];
    kernel_arrays arrays;
} kernel_finder;

static inline void kernel_finder_begin(kernel_finder *s, const kernel_frame *f, const kernel_subtree *subtree)
{
    s->frame = f;
    for (int a = 0; a < 2; a++) {
        s->first[a] = 0;
        s->last[a] = (a ? f->job->camera.height : f->job->camera.width) - 1;
    }
    s->part = subtree->part;
    s->source = (uint32_t)subtree->part;
    s->surface = NULL;
    s->transfer = &f->volumes[0];
    if (subtree->surface >= 0) {
        s->surface = &f->surfaces[subtree->surface];
        s->source *= RENDER_MAX_ISOVALUES;
        while (f->isovalue_surface[s->source % RENDER_MAX_ISOVALUES] != subtree->surface) s->source++;
    }
    s->field = s->surface ? &s->surface->layer->field : &f->job->volumes[0].field;
    s->visible_values = s->surface ? &s->surface->visible_values : &s->transfer->visible_values;
    s->queued_count = 0;
    for (int i = 0; i < KERNEL_LANE_TYPES; i++) {
        const int type = kernel_lane_types[i];
        kernel_cells_begin(&s->pending[i], type);
        if (!kernel_is_linear(type)) kernel_cells_begin(&s->crossed[i], type);
    }
    kernel_arrays_begin(&s->arrays, f->job->parts[s->part].cells, &s->field->fields[s->part]);
    kernel_compute_planes_for_tree_boxes(&s->planes, f, NULL);
    const double unit = f->job->camera.is_orthographic ? f->job->space.scale : 1;
    s->t_near = (float)-f->depth_shift;
    for (int a = 0; a < 3; a++) s->eye[a] = kernel_make_level(f->job->camera.eye[a]);
    s->column_scale = (float)(1 / (f->slope_dx * unit));
    s->row_scale = (float)(1 / (f->slope_dy * unit));
    s->column_0 = (float)(-f->slope_x0 / f->slope_dx);
    s->row_0 = (float)(-f->slope_y0 / f->slope_dy);
}

/* ---- cells in lanes ---- */

/* Bounds of the part of each lane's cell that may be visible. near, far: depths from the eye's plane, in scaled units;
 * left, right, top, bottom: columns and rows of pixels, as real numbers, counted from the ray along the camera's
 * axis. */
typedef struct kernel_view_bounds {
    vf near, far, left, right, top, bottom;
} kernel_view_bounds;

/* Reads one vertex per lane and computes its position relative to the eye, in scaled units along the world axes. */
SIMD_INLINE void kernel_finder_read_vertex_positions(const kernel_finder *s, vi vertex, vf out[3])
{
    const render_job *job = s->frame->job;
    for (int a = 0; a < 3; a++) {
        const kernel_numbers *c = &s->arrays.coordinates[a];
        kernel_raw_numbers world;
        kernel_numbers_gather_raw(c, vertex, &world);
        out[a] = kernel_subtract_level_from_raw(c, &world, &s->eye[a]) * (float)job->space.scale;
    }
}

/* Returns those of the lanes in `fitting` in which no coordinate is NaN or too large for computations in float32. The
 * cells of all other lanes are tested one by one. */
SIMD_INLINE vm kernel_keep_lanes_in_float_range(vm fitting, const vf place[3])
{
    for (int a = 0; a < 3; a++) fitting = vm_and(fitting, vf_lt(vf_abs(place[a]), vf_set(1e15f)));
    return fitting;
}

/* Rotates positions relative to the eye into the camera's axes: right, up and forward. */
SIMD_INLINE void kernel_rotate_to_camera(const kernel_finder *s, const vf place[3], vf at[3])
{
    const render_camera *camera = &s->frame->job->camera;
    const double *axes[3] = {camera->right, camera->up, camera->forward};
    for (int a = 0; a < 3; a++)
        at[a] = (place[0] * (float)axes[a][0] + place[1] * (float)axes[a][1]) + place[2] * (float)axes[a][2];
}

/* Extends the bounds in the given lanes so that they contain the point. */
SIMD_INLINE void kernel_view_bounds_add(const kernel_finder *s, kernel_view_bounds *e, const vf point[3], vm lanes)
{
    const vf most = vf_set(INFINITY);
    vf inverse = vf_set(1);
    if (!s->frame->job->camera.is_orthographic) inverse = 1.0f / point[2];
    const vf x = (point[0] * inverse) * s->column_scale, y = (point[1] * inverse) * s->row_scale;
    e->near = vf_min(e->near, vf_select(lanes, point[2], most));
    e->far = vf_max(e->far, vf_select(lanes, point[2], -most));
    e->left = vf_min(e->left, vf_select(lanes, x, most));
    e->right = vf_max(e->right, vf_select(lanes, x, -most));
    e->top = vf_min(e->top, vf_select(lanes, y, most));
    e->bottom = vf_max(e->bottom, vf_select(lanes, y, -most));
}

SIMD_INLINE kernel_view_bounds kernel_view_bounds_empty(void)
{
    const vf most = vf_set(INFINITY);
    return (kernel_view_bounds){most, -most, most, -most, most, -most};
}

/* Computes the first and the last column (or row) of pixels between each lane's bounds low and high, clipped to the
 * range from ends[0] to ends[1]. zero: the column (or row) from which `low` and `high` are counted; error_bound: upper
 * bound of the errors of `low` and `high`, in pixels. The range is widened by error_bound, by 1/100 pixel and by 3e-5
 * of the magnitudes of low, high and zero, so that rays that hit the cell only by rounding are included. Returns the
 * lanes that contain a pixel. */
SIMD_INLINE vm kernel_pixel_range(vf low, vf high, float zero, float error_bound, const int ends[2], vf *first,
                                  vf *last)
{
    const vf pad = (0.01f + error_bound + 3e-5f * fabsf(zero)) + 3e-5f * vf_max(vf_abs(low), vf_abs(high));
    *first = vf_max(-vf_floor(pad - (low + zero)), vf_set((float)ends[0]));
    *last = vf_min(vf_floor((high + zero) + pad), vf_set((float)ends[1]));
    return vf_le(*first, *last);
}

/* Adds the cells of the given lanes (a bit mask) to the candidates, unless they are outside the picture or behind the
 * eye's plane. e: bounds of each lane's cell. A cell that extends to near the eye's plane or behind it may be visible
 * anywhere, so its candidate covers the whole picture. */
static void kernel_add_candidates_of_lanes(kernel_finder *s, const kernel_view_bounds *e, unsigned lanes,
                                           const uint32_t *cells, uint32_t source)
{
    const render_camera *camera = &s->frame->job->camera;
    const bool flat = camera->is_orthographic;
    kernel_candidate_list *list = s->list;
    vf first[2], last[2];
    float near[SIMD_WIDTH], far[SIMD_WIDTH];
    int32_t ends[4][SIMD_WIDTH];
    const vf size = vf_abs(e->far) + fabsf(s->t_near), pad = KERNEL_OUTLINE_PAD * size;
    /* the largest error bound of a lane, used for all lanes */
    const float error_bound = 2e-6f * (flat ? vf_reduce_max(vf_select(vm_from_bits(lanes), size, vf_set(0))) + 1 : 1);
    const int columns[2] = {s->first[0], s->last[0]}, rows[2] = {s->first[1], s->last[1]};
    vm candidates = kernel_pixel_range(e->left, e->right, s->column_0, error_bound * fabsf(s->column_scale), columns,
                                       &first[0], &last[0]);
    candidates = vm_and(candidates, kernel_pixel_range(e->top, e->bottom, s->row_0, error_bound * fabsf(s->row_scale),
                                                       rows, &first[1], &last[1]));
    const vm anywhere = flat ? vm_none() : vm_not(vf_lt(0.01f * size, e->near));
    const vm behind = vf_lt((e->far + s->t_near) + pad, vf_set(s->t_near));
    lanes &= vm_bits(vm_andnot(vm_or(candidates, anywhere), behind));
    for (int a = 0; a < 2; a++) {
        const vi from = vi_from_vf(vf_select(anywhere, vf_set((float)s->first[a]), first[a]));
        const vi to = vi_from_vf(vf_select(anywhere, vf_set((float)s->last[a]), last[a]));
        memcpy(ends[2 * a], &from, sizeof from);
        memcpy(ends[2 * a + 1], &to, sizeof to);
    }
    vf_store(near, vf_max((e->near + s->t_near) - pad, vf_set(-INFINITY))); /* vf_max() replaces a NaN depth by -inf */
    vf_store(far, -vf_max(-((e->far + s->t_near) + pad), vf_set(-INFINITY)));
    if (list->capacity - list->count < SIMD_WIDTH && !s->grow(list)) return;
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        list->items[list->count++] = (kernel_candidate){.cell = cells[n],
                                                        .source = source,
                                                        .near = near[n],
                                                        .far = far[n],
                                                        .x0 = (uint16_t)ends[0][n],
                                                        .x1 = (uint16_t)ends[1][n],
                                                        .y0 = (uint16_t)ends[2][n],
                                                        .y1 = (uint16_t)ends[3][n]};
    }
}

/* ---- cells that are tested one by one ---- */

/* Extends the bounds in all lanes so that they contain a vertex of the mesh; all lanes stand for one cell. */
SIMD_INLINE void kernel_view_bounds_add_vertex(const kernel_finder *s, int64_t vertex, kernel_view_bounds *e)
{
    const double *eye = s->frame->job->camera.eye;
    double world[3];
    vf at[3];
    grid_read_vertex_position(s->arrays.cells, vertex, world);
    for (int a = 0; a < 3; a++) {
        const double *axis = s->frame->scaled_axes[a];
        at[a] = vf_set(
            (float)(axis[0] * (world[0] - eye[0]) + axis[1] * (world[1] - eye[1]) + axis[2] * (world[2] - eye[2])));
    }
    kernel_view_bounds_add(s, e, at, vm_all_lanes());
}

/* Adds a polyhedron to the candidates, with the pixels of the bounding box of its vertices. */
static void kernel_add_polyhedron_candidate(kernel_finder *s, uint32_t index)
{
    kernel_view_bounds e = kernel_view_bounds_empty();
    grid_walk walk = grid_walk_cell(s->arrays.cells, index);
    int64_t vertex;
    while (grid_walk_next(&walk, &vertex)) kernel_view_bounds_add_vertex(s, vertex, &e);
    kernel_add_candidates_of_lanes(s, &e, 1, &index, s->source);
}

/* Adds the fetched cell c to the candidates, with the pixels of the bounding box of its vertices. */
static __attribute__((noinline)) void kernel_add_cell_candidate(kernel_finder *s, const kernel_cell *c, uint32_t source)
{
    kernel_view_bounds e = kernel_view_bounds_empty();
    for (int i = 0; i < c->count; i++) kernel_view_bounds_add_vertex(s, c->vertices[i], &e);
    kernel_add_candidates_of_lanes(s, &e, 1, &c->index, source);
}

/* Adds the fetched cell c to the candidates if it is crossed by the layer's isovalue with the index `value`. */
SIMD_INLINE void kernel_add_cell_if_crossed(kernel_finder *s, const kernel_cell *c, int value)
{
    if (c->is_finite && kernel_values_straddle(c->values, c->count, s->surface->layer->values[value]))
        kernel_add_cell_candidate(s, c, s->source + (uint32_t)value);
}

/* Adds the fetched cell s->cell to the candidates if its values are visible in the volume. */
SIMD_INLINE void kernel_add_cell_if_visible(kernel_finder *s)
{
    if (s->cell.is_finite && kernel_cell_is_visible(&s->cell, s->transfer))
        kernel_add_cell_candidate(s, &s->cell, s->source);
}

#endif
