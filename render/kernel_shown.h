/* Isosurfaces by one traversal a frame: the trees are gone down once for the whole picture, and each cell that the
 * surface crosses, or that shows in the volume, is fetched and placed once, to find the pixels that it may show in; the
 * cells are then binned by tile (render_shown.c; sort-middle, in the terms of Molnar et al. 1994), and tiles trace them
 * from the nearest on, blocks that know of something nearer left out (kernel_tile_shown.h, kernel_batch.h; of the
 * volume kernel_tile_cells.h):
 *
 *     nodes --- ranges, picture's planes ---> cells --- outlines' boxes ---> tiles --- nearest first ---> blocks
 *
 * A tile's own traversal (kernel_tile_surface.h) looks at the same nodes as its neighbours and places the same cells,
 * most of which lie beside it. It is better where surfaces hide more cells than they show, for it sees none of what is
 * behind them: frames go back to it where too many cells show.
 *
 * Boxes are of the outline projected (kernel_outline.h), widened by pads that are more than all rounding. Rays test
 * what boxes hold, so that the picture is that of any traversal, to the last bit. */
#ifndef RENDER_KERNEL_SHOWN_H
#define RENDER_KERNEL_SHOWN_H

#include "kernel_plain.h"
#include "kernel_tile_surface.h"
#include "kernel_volume.h"

/* Tets, one a lane. */
typedef struct kernel_tets {
    int count;
    uint32_t cell[SIMD_WIDTH];
    int64_t vertices[SIMD_WIDTH][GRID_MAX_CELL_VERTICES];
    int32_t plain[8][SIMD_WIDTH]; /* the vertices of a plain mesh, instead; or of hexes */
} kernel_tets;

/* Hexes of a plain mesh that the isovalue under way crosses (kernel_shown_hexes.h). */
typedef struct kernel_crossed_hexes {
    int count, value;
    uint32_t cell[SIMD_WIDTH];
    int32_t vertex[8][SIMD_WIDTH];
} kernel_crossed_hexes;

/* One subtree's search. */
typedef struct kernel_finder {
    const kernel_frame *frame;
    const kernel_surface *surface;   /* NULL: */
    const kernel_transfer *transfer; /* the volume's */
    const render_field *field;
    const kernel_interest *interest;
    kernel_shown_list *list;
    bool (*grow)(kernel_shown_list *list);
    int part;
    uint32_t source;     /* of the layer's first isovalue */
    kernel_tile picture; /* all of it as one tile, about the axis of view */
    kernel_planes planes;
    float t_near, column_scale, row_scale, column_0, row_0;
    kernel_cell cell;
    uint32_t coming[SIMD_WIDTH]; /* cells whose connectivity is on its way from memory; */
    kernel_tets tets;            /* tets whose vertices are */
    kernel_crossed_hexes hexes;
    kernel_plain plain;
    int coming_count;
} kernel_finder;

/* The least float that is not below x. */
SIMD_INLINE float kernel_not_below(double x)
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

static inline void kernel_finder_begin(kernel_finder *s, const kernel_frame *f, const kernel_subtree *subtree)
{
    kernel_borders borders;
    s->frame = f;
    s->part = subtree->part;
    s->source = (uint32_t)subtree->part;
    s->surface = NULL;
    s->transfer = &f->volumes[0];
    if (subtree->surface >= 0) {
        s->surface = &f->surfaces[subtree->surface];
        s->source *= RENDER_MAX_ISOVALUES;
        while (f->isovalues[s->source % RENDER_MAX_ISOVALUES].surface != subtree->surface) s->source++;
    }
    s->field = s->surface ? &s->surface->layer->field : &f->job->volumes[0].field;
    s->interest = s->surface ? &s->surface->interest : &s->transfer->interest;
    s->coming_count = s->tets.count = s->hexes.count = 0;
    kernel_plain_begin(&s->plain, f, f->job->parts[s->part].cells, &s->field->fields[s->part]);
    s->plain.is_hexes = s->plain.is_hexes && s->surface;
    memset(&s->picture, 0, sizeof s->picture);
    s->picture.depth_shift = f->depth_shift;
    kernel_picture_borders(&borders, f);
    kernel_tree_planes(&s->planes, f, &borders);
    const double unit = f->job->camera.is_orthographic ? f->job->space.scale : 1;
    s->t_near = (float)-f->depth_shift;
    s->column_scale = (float)(1 / (f->slope_dx * unit));
    s->row_scale = (float)(1 / (f->slope_dy * unit));
    s->column_0 = (float)(-f->slope_x0 / f->slope_dx);
    s->row_0 = (float)(-f->slope_y0 / f->slope_dy);
}

/* Least and largest. */
typedef struct kernel_extent {
    float low, high;
} kernel_extent;

SIMD_INLINE kernel_extent kernel_extent_of(const kernel_outline *o, vf scale, const float *of, const float *by)
{
    vf low = vf_set(INFINITY), high = vf_set(-INFINITY);
    for (int i = 0; i < o->count; i += SIMD_WIDTH) {
        const vf at = by ? vf_load(of + i) * scale / vf_load(by + i) : vf_load(of + i) * scale;
        low = vf_min(low, at);
        high = vf_max(high, at);
    }
    return (kernel_extent){vf_reduce_min(low), vf_reduce_max(high)};
}

/* Whole vectors of points: the last ones are the first again. */
SIMD_INLINE void kernel_outline_fill(kernel_outline *o)
{
    for (int a = 0; a < 3; a++)
        for (int i = o->count; i % SIMD_WIDTH; i++) o->point[a][i] = o->point[a][0];
}

/* The pixels between, of so many: false where there are none. A part in 1e5 of the cell and its place, and a hundredth
 * of a pixel, are more than rays are off by when they hit by a rounding; blur is what places may be off by. */
SIMD_INLINE bool kernel_extent_range(kernel_extent e, float zero, float blur, int pixels, uint16_t *first,
                                     uint16_t *last)
{
    const float pad = 0.01f + 3e-5f * (simd_max(fabsf(e.low), fabsf(e.high)) + fabsf(zero)) + blur;
    const float low = simd_max(ceilf(e.low + zero - pad), 0);
    const float high = simd_min(floorf(e.high + zero + pad), (float)(pixels - 1));
    if (!(low <= high)) return false;
    *first = (uint16_t)low;
    *last = (uint16_t)high;
    return true;
}

/* Of a cell whose surface has these depths and columns and rows, relative to the axis of view, size the largest depth
 * of anything in it. Where some of it is near the eye's plane or behind it, it may be anywhere. */
SIMD_INLINE bool kernel_extents_shown(const kernel_finder *s, kernel_extent depth, float size, kernel_extent columns,
                                      kernel_extent rows, kernel_shown *out)
{
    const render_camera *camera = &s->frame->job->camera;
    const float pad = KERNEL_OUTLINE_PAD * size;
    if (depth.high + pad < s->t_near) return false;
    out->near = depth.low - pad;
    out->far = depth.high + pad;
    if (!(out->near > -INFINITY)) out->near = -INFINITY; /* not a number */
    if (!(out->far < INFINITY)) out->far = INFINITY;
    if (!camera->is_orthographic && !(depth.low - s->t_near > 0.01f * size)) {
        out->x0 = out->y0 = 0;
        out->x1 = (uint16_t)(camera->width - 1);
        out->y1 = (uint16_t)(camera->height - 1);
        return true;
    }
    const float blur = 2e-6f * (camera->is_orthographic ? size + 1 : 1);
    return kernel_extent_range(columns, s->column_0, blur * fabsf(s->column_scale), camera->width, &out->x0,
                               &out->x1) &&
           kernel_extent_range(rows, s->row_0, blur * fabsf(s->row_scale), camera->height, &out->y0, &out->y1);
}

SIMD_INLINE bool kernel_outline_shown(const kernel_finder *s, kernel_outline *o, kernel_shown *out)
{
    kernel_outline_fill(o);
    const kernel_extent depth = kernel_extent_of(o, vf_set(1), o->point[2], NULL);
    for (int i = 0; i < o->count; i += SIMD_WIDTH) vf_store(o->point[2] + i, vf_load(o->point[2] + i) - s->t_near);
    const float *by = s->frame->job->camera.is_orthographic ? NULL : o->point[2];
    const kernel_extent columns = kernel_extent_of(o, vf_set(s->column_scale), o->point[0], by);
    const kernel_extent rows = kernel_extent_of(o, vf_set(s->row_scale), o->point[1], by);
    return kernel_extents_shown(s, depth, o->size[2] + fabsf(s->t_near), columns, rows, out);
}

/* ---- hexes: kernel_slab_outline() with a pair of vertices a lane ---- */

enum { KERNEL_HEX_PAIRS = 32 }; /* 28 of them */

/* A hex's vertices by lane. */
SIMD_INLINE vf kernel_eight_pick(const float v[16], vi index)
{
    if (SIMD_WIDTH >= 8) return vf_permute(vf_load(v), index);
    return vf_gather(v, index);
}

typedef struct kernel_slab_ends {
    vm any;
    vf low[3], high[3]; /* depth; columns and rows, relative to the axis of view */
} kernel_slab_ends;

SIMD_INLINE void kernel_slab_add(const kernel_finder *s, kernel_slab_ends *e, vm points, const vf at[3])
{
    vf by = at[2] - s->t_near;
    if (s->frame->job->camera.is_orthographic) by = vf_set(1);
    const vf places[3] = {at[2], at[0] * s->column_scale / by, at[1] * s->row_scale / by};
    e->any = vm_or(e->any, points);
    for (int a = 0; a < 3; a++) {
        e->low[a] = vf_select(points, vf_min(e->low[a], places[a]), e->low[a]);
        e->high[a] = vf_select(points, vf_max(e->high[a], places[a]), e->high[a]);
    }
}

/* L at the vertices, and the slab's thickness. */
SIMD_INLINE bool kernel_slab_shown(const kernel_finder *s, const kernel_cell *c, const float values[16],
                                   float thickness, kernel_shown *out)
{
    static const int32_t from[KERNEL_HEX_PAIRS] = {1, 2, 2, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 5, 6,
                                                   6, 6, 6, 6, 6, 7, 7, 7, 7, 7, 7, 7, 0, 0, 0, 0};
    static const int32_t to[KERNEL_HEX_PAIRS] = {0, 0, 1, 0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 4, 0,
                                                 1, 2, 3, 4, 5, 0, 1, 2, 3, 4, 5, 6, 0, 0, 0, 0};
    static const int32_t own[16] = {0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7};
    float place[3][16] = {{0}};
    kernel_slab_ends ends = {.any = vm_none()};
    memcpy(place[0], c->x, sizeof c->x);
    memcpy(place[1], c->y, sizeof c->y);
    memcpy(place[2], c->z, sizeof c->z);
    for (int a = 0; a < 3; a++) ends.low[a] = vf_set(INFINITY), ends.high[a] = vf_set(-INFINITY);
    for (int n = 0; n < 8; n += SIMD_WIDTH) {
        vi i;
        vf at[3];
        memcpy(&i, own + n, sizeof i);
        for (int a = 0; a < 3; a++) at[a] = kernel_eight_pick(place[a], i);
        kernel_slab_add(s, &ends, vf_le(vf_abs(kernel_eight_pick(values, i)), vf_set(thickness)), at);
    }
    for (int n = 0; n < KERNEL_HEX_PAIRS; n += SIMD_WIDTH) {
        vi i, j;
        vf begin[3], edge[3];
        memcpy(&i, from + n, sizeof i);
        memcpy(&j, to + n, sizeof j);
        const vf v = kernel_eight_pick(values, i), w = kernel_eight_pick(values, j), inverse = 1.0f / (w - v);
        for (int a = 0; a < 3; a++) {
            begin[a] = kernel_eight_pick(place[a], i);
            edge[a] = kernel_eight_pick(place[a], j) - begin[a];
        }
        for (int side = -1; side <= 1; side += 2) {
            const vf level = vf_set((float)side * thickness), along = (level - v) * inverse;
            const vf at[3] = {begin[0] + along * edge[0], begin[1] + along * edge[1], begin[2] + along * edge[2]};
            kernel_slab_add(s, &ends, vm_xor(vf_lt(v, level), vf_lt(w, level)), at);
        }
    }
    if (!vm_any(ends.any)) return false;
    kernel_extent extents[3];
    for (int a = 0; a < 3; a++) extents[a] = (kernel_extent){vf_reduce_min(ends.low[a]), vf_reduce_max(ends.high[a])};
    return kernel_extents_shown(s, extents[0], kernel_largest(c->z, 8) + fabsf(s->t_near), extents[1], extents[2], out);
}

SIMD_INLINE void kernel_add_shown(kernel_finder *s, const kernel_shown *shown)
{
    kernel_shown_list *list = s->list;
    if (list->count == list->capacity && !s->grow(list)) return;
    list->items[list->count++] = *shown;
}

static void kernel_find_polyhedron(kernel_finder *s, uint32_t index)
{
    const grid *g = s->frame->job->parts[s->part].cells;
    kernel_outline o = {0};
    kernel_shown shown = {.cell = index, .source = s->source};
    /* The corners of the vertices' box. */
    float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    grid_walk walk = grid_walk_cell(g, index);
    int64_t vertex;
    while (grid_walk_next(&walk, &vertex)) {
        double world[3];
        float place[3];
        grid_vertex(g, vertex, world);
        kernel_place_in(s->frame, &s->picture, world, &place[0], &place[1], &place[2]);
        for (int a = 0; a < 3; a++) {
            low[a] = simd_min(place[a], low[a]);
            high[a] = simd_max(place[a], high[a]);
        }
    }
    o.count = 8;
    for (int i = 0; i < 8; i++)
        for (int a = 0; a < 3; a++) o.point[a][i] = i >> a & 1 ? high[a] : low[a];
    for (int a = 0; a < 3; a++) o.size[a] = simd_max(fabsf(low[a]), fabsf(high[a]));
    if (kernel_outline_shown(s, &o, &shown)) kernel_add_shown(s, &shown);
}

/* One isovalue of the fetched cell. */
static void kernel_find_value(kernel_finder *s, int value)
{
    const render_surface_layer *layer = s->surface->layer;
    kernel_cell *c = &s->cell;
    kernel_outline o;
    kernel_shown shown = {.cell = c->index, .source = s->source + (uint32_t)value};
    float at[16] = {0}, thickness;
    if (!kernel_cell_straddles(c, layer->values[value])) return;
    if (!c->is_placed) kernel_cell_move(c, s->frame, &s->picture, s->frame->job->parts[s->part].cells);
    kernel_cell_relative(c, layer->values[value]);
    if (c->type == GRID_TET) {
        if (!kernel_tet_outline(c, &o)) return;
    } else if (c->type == GRID_HEX && kernel_linear_part(c, at, &thickness)) {
        if (kernel_slab_shown(s, c, at, thickness, &shown)) kernel_add_shown(s, &shown);
        return;
    } else {
        kernel_vertex_outline(c, &o);
        if (!kernel_slab_outline(c, &o)) return;
    }
    if (kernel_outline_shown(s, &o, &shown)) kernel_add_shown(s, &shown);
}

/* All of the fetched cell, in the volume. */
static void kernel_find_volume(kernel_finder *s)
{
    kernel_cell *c = &s->cell;
    kernel_outline o;
    kernel_shown shown = {.cell = c->index, .source = s->source};
    if (!kernel_cell_shows(c, s->transfer)) return;
    kernel_cell_move(c, s->frame, &s->picture, s->frame->job->parts[s->part].cells);
    kernel_vertex_outline(c, &o);
    if (kernel_outline_shown(s, &o, &shown)) kernel_add_shown(s, &shown);
}

/* What of the fetched cell shows. */
static void kernel_find_cell(kernel_finder *s)
{
    if (!s->cell.is_finite) return;
    if (!s->surface) {
        kernel_find_volume(s);
        return;
    }
    for (int value = 0; value < s->surface->layer->value_count; value++) kernel_find_value(s, value);
}

/* ---- tets, as many at once as there are lanes ----
 *
 * In float32 from the eye on: positions err by 8 roundings of their distance from it, and so do X, Y and depth; all of
 * it is within the pads of kernel_pixel_range(), which take this of the picture's scale too. */

/* Where the surface of one isovalue is in each: ends over the edges that it crosses. */
typedef struct kernel_tet_ends {
    vf near, far, left, right, top, bottom;
} kernel_tet_ends;

typedef struct kernel_tet_lanes {
    vf f[4], at[3][4]; /* values less the isovalue; from the eye, in the space's scale */
    vm negative[4];
} kernel_tet_lanes;

/* The vertices along the camera's axes. */
SIMD_INLINE void kernel_tet_lanes_turn(const kernel_finder *s, const kernel_tet_lanes *l, vf at[4][3])
{
    const render_camera *camera = &s->frame->job->camera;
    const double *axes[3] = {camera->right, camera->up, camera->forward};
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < 3; a++)
            at[i][a] =
                (l->at[0][i] * (float)axes[a][0] + l->at[1][i] * (float)axes[a][1]) + l->at[2][i] * (float)axes[a][2];
}

/* Ends that take in the point, in the lanes that are meant. */
SIMD_INLINE void kernel_tet_ends_add(const kernel_finder *s, kernel_tet_ends *e, const vf point[3], vm lanes)
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

SIMD_INLINE kernel_tet_ends kernel_tet_no_ends(void)
{
    const vf most = vf_set(INFINITY);
    return (kernel_tet_ends){most, -most, most, -most, most, -most};
}

SIMD_INLINE void kernel_tet_lanes_ends(const kernel_finder *s, const kernel_tet_lanes *l, kernel_tet_ends *e)
{
    vf at[4][3];
    kernel_tet_lanes_turn(s, l, at);
    *e = kernel_tet_no_ends();
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int i = kernel_tet_edge[n][0], j = kernel_tet_edge[n][1];
        const vm crossed = vm_xor(l->negative[i], l->negative[j]);
        const vf along = vf_max(l->f[i] / (l->f[i] - l->f[j]), vf_set(0)); /* not 0 / 0 */
        vf point[3];
        for (int a = 0; a < 3; a++) point[a] = at[i][a] + along * (at[j][a] - at[i][a]);
        kernel_tet_ends_add(s, e, point, crossed);
    }
}

/* kernel_extent_range() lane by lane: the first and last pixels. Returns the lanes that have any. */
SIMD_INLINE vm kernel_pixel_range(vf low, vf high, float zero, float blur, int pixels, vf *first, vf *last)
{
    const vf pad = (0.01f + blur + 3e-5f * fabsf(zero)) + 3e-5f * vf_max(vf_abs(low), vf_abs(high));
    *first = vf_max(-vf_floor(pad - (low + zero)), vf_set(0));
    *last = vf_min(vf_floor((high + zero) + pad), vf_set((float)(pixels - 1)));
    return vf_le(*first, *last);
}

/* kernel_extents_shown() lane by lane, of so many lanes those whose bits are set. */
static void kernel_add_lanes(kernel_finder *s, const kernel_tet_ends *e, unsigned lanes, const uint32_t *cells,
                             uint32_t source)
{
    const render_camera *camera = &s->frame->job->camera;
    const bool flat = camera->is_orthographic;
    kernel_shown_list *list = s->list;
    vf first[2], last[2];
    float near[SIMD_WIDTH], far[SIMD_WIDTH];
    int32_t ends[4][SIMD_WIDTH];
    const vf size = vf_abs(e->far) + fabsf(s->t_near), pad = KERNEL_OUTLINE_PAD * size;
    /* The largest blur of any lane stands for all. */
    const float blur = 2e-6f * (flat ? vf_reduce_max(vf_select(vm_from_bits(lanes), size, vf_set(0))) + 1 : 1);
    vm shown = kernel_pixel_range(e->left, e->right, s->column_0, blur * fabsf(s->column_scale), camera->width,
                                  &first[0], &last[0]);
    shown = vm_and(shown, kernel_pixel_range(e->top, e->bottom, s->row_0, blur * fabsf(s->row_scale), camera->height,
                                             &first[1], &last[1]));
    const vm anywhere = flat ? vm_none() : vm_not(vf_lt(0.01f * size, e->near));
    const vm behind = vf_lt((e->far + s->t_near) + pad, vf_set(s->t_near));
    lanes &= vm_bits(vm_andnot(vm_or(shown, anywhere), behind));
    const int most[2] = {camera->width - 1, camera->height - 1};
    for (int a = 0; a < 2; a++) {
        const vi from = vi_from_vf(vf_select(anywhere, vf_set(0), first[a]));
        const vi to = vi_from_vf(vf_select(anywhere, vf_set((float)most[a]), last[a]));
        memcpy(ends[2 * a], &from, sizeof from);
        memcpy(ends[2 * a + 1], &to, sizeof to);
    }
    vf_store(near, vf_max((e->near + s->t_near) - pad, vf_set(-INFINITY))); /* not a number: that */
    vf_store(far, -vf_max(-((e->far + s->t_near) + pad), vf_set(-INFINITY)));
    if (list->capacity - list->count < SIMD_WIDTH && !s->grow(list)) return;
    for (; lanes; lanes &= lanes - 1) {
        const int n = __builtin_ctz(lanes);
        list->items[list->count++] = (kernel_shown){.cell = cells[n],
                                                    .source = source,
                                                    .near = near[n],
                                                    .far = far[n],
                                                    .x0 = (uint16_t)ends[0][n],
                                                    .x1 = (uint16_t)ends[1][n],
                                                    .y0 = (uint16_t)ends[2][n],
                                                    .y1 = (uint16_t)ends[3][n]};
    }
}

/* Tets of a plain mesh. v < value is v < the least float not below it. The differences' signs are right but where they
 * vanish in float32, and then along an edge that is as good as a point. */
SIMD_INLINE void kernel_plain_value(kernel_finder *s, const vf v[4], kernel_tet_lanes *l, int value)
{
    const double isovalue = s->surface->layer->values[value];
    const float middle = (float)isovalue, rest = (float)(isovalue - (double)middle);
    const vf least = vf_set(kernel_not_below(isovalue));
    vf size = vf_set(0);
    vm usual = vm_all_lanes(), negative = vm_none(), positive = vm_none();
    for (int i = 0; i < 4; i++) {
        l->f[i] = (v[i] - middle) - rest;
        l->negative[i] = vf_lt(v[i], least);
        negative = vm_or(negative, l->negative[i]);
        positive = vm_or(positive, vf_le(least, v[i]));
        size = vf_max(vf_abs(l->f[i]), size);
        usual = vm_and(usual, vf_lt(vf_abs(l->f[i]), vf_set(1e30f)));
        for (int a = 0; a < 3; a++) usual = vm_and(usual, vf_lt(vf_abs(l->at[a][i]), vf_set(1e15f)));
    }
    usual = vm_and(usual, vf_lt(vf_set(1e-30f), size));
    const unsigned all = (1u << s->tets.count) - 1, crossed = vm_bits(vm_and(negative, positive)) & all;
    /* Of no usual size, or not numbers: one by one. */
    const unsigned good = crossed & vm_bits(usual);
    if (good) {
        kernel_tet_ends e;
        kernel_tet_lanes_ends(s, l, &e);
        kernel_add_lanes(s, &e, good, s->tets.cell, s->source + (uint32_t)value);
    }
    for (unsigned odd = crossed & ~good; odd; odd &= odd - 1) {
        kernel_cell_fetch(&s->cell, s->frame->job->parts[s->part].cells, &s->field->fields[s->part],
                          s->tets.cell[__builtin_ctz(odd)]);
        if (s->cell.is_finite) kernel_find_value(s, value);
    }
}

/* The same of all that shows of them in the volume. */
SIMD_INLINE void kernel_plain_volume(kernel_finder *s, const vf v[4], const kernel_tet_lanes *l)
{
    vm usual = vm_all_lanes();
    for (int i = 0; i < 4; i++) {
        usual = vm_and(usual, vf_lt(vf_abs(v[i]), vf_set(1e30f)));
        for (int a = 0; a < 3; a++) usual = vm_and(usual, vf_lt(vf_abs(l->at[a][i]), vf_set(1e15f)));
    }
    const vm shows = kernel_interest_meets_values(s->interest, v);
    const unsigned all = (1u << s->tets.count) - 1, good = all & vm_bits(vm_and(usual, shows));
    if (good) {
        kernel_tet_ends e = kernel_tet_no_ends();
        vf at[4][3];
        kernel_tet_lanes_turn(s, l, at);
        for (int i = 0; i < 4; i++) kernel_tet_ends_add(s, &e, at[i], vm_all_lanes());
        kernel_add_lanes(s, &e, good, s->tets.cell, s->source);
    }
    for (unsigned odd = all & ~vm_bits(usual); odd; odd &= odd - 1) {
        kernel_cell_fetch(&s->cell, s->frame->job->parts[s->part].cells, &s->field->fields[s->part],
                          s->tets.cell[__builtin_ctz(odd)]);
        kernel_find_cell(s);
    }
}

static void kernel_find_plain_tets(kernel_finder *s)
{
    const kernel_plain *p = &s->plain;
    kernel_tets *t = &s->tets;
    kernel_tet_lanes l;
    vf v[4];
    if (!t->count) return;
    for (int n = t->count; n < SIMD_WIDTH; n++)
        for (int i = 0; i < 4; i++) t->plain[i][n] = t->plain[i][0];
    for (int i = 0; i < 4; i++) {
        vi vertex;
        memcpy(&vertex, t->plain[i], sizeof vertex);
        v[i] = vf_gather(p->values, vertex * p->value_stride);
        vertex *= p->stride;
        for (int a = 0; a < 3; a++)
            l.at[a][i] = ((vf_gather(p->coordinates[a], vertex) - p->eye[a][0]) - p->eye[a][1]) * p->scale;
    }
    if (!s->surface) kernel_plain_volume(s, v, &l);
    for (int value = 0; s->surface && value < s->surface->layer->value_count; value++)
        kernel_plain_value(s, v, &l, value);
    t->count = 0;
}

/* Tets of any other mesh, one by one until they are in lanes. */
static void kernel_find_any_tets(kernel_finder *s)
{
    if (!s->tets.count) return;
    const render_surface_layer *layer = s->surface->layer;
    const grid_field *field = &layer->field.fields[s->part];
    const grid *g = s->frame->job->parts[s->part].cells;
    const double *eye = s->frame->job->camera.eye, scale = s->frame->job->space.scale;
    kernel_cell *c = &s->cell;
    for (int value = 0; value < layer->value_count; value++) {
        float f[4][SIMD_WIDTH] = {{0}}, at[3][4][SIMD_WIDTH] = {{{0}}};
        uint32_t cells[SIMD_WIDTH];
        int count = 0;
        for (int n = 0; n < s->tets.count; n++) {
            c->count = 4;
            if (!grid_cell_values(field, s->tets.cell[n], s->tets.vertices[n], 4, c->values)) continue;
            if (!kernel_cell_straddles(c, layer->values[value])) continue;
            kernel_cell_relative(c, layer->values[value]);
            for (int i = 0; i < 4; i++) {
                double world[3];
                grid_vertex(g, s->tets.vertices[n][i], world);
                for (int a = 0; a < 3; a++) at[a][i][count] = (float)((world[a] - eye[a]) * scale);
                f[i][count] = c->f[i];
            }
            cells[count++] = s->tets.cell[n];
        }
        if (!count) continue;
        kernel_tet_lanes l;
        kernel_tet_ends e;
        for (int i = 0; i < 4; i++) {
            l.f[i] = vf_load(f[i]);
            l.negative[i] = vf_lt(l.f[i], vf_set(0));
            for (int a = 0; a < 3; a++) l.at[a][i] = vf_load(at[a][i]);
        }
        kernel_tet_lanes_ends(s, &l, &e);
        kernel_add_lanes(s, &e, (1u << count) - 1, cells, s->source + (uint32_t)value);
    }
    s->tets.count = 0;
}

/* kernel_shown_hexes.h */
static void kernel_find_plain_hexes(kernel_finder *s);
static void kernel_find_crossed_hexes(kernel_finder *s);

static void kernel_find_tets(kernel_finder *s)
{
    if (s->plain.is_hexes)
        kernel_find_plain_hexes(s);
    else if (s->plain.is_so)
        kernel_find_plain_tets(s);
    else
        kernel_find_any_tets(s);
}

/* ---- leaves ---- */

/* Their vertices are on their way. */
static void kernel_find_coming_plain(kernel_finder *s)
{
    const kernel_plain *p = &s->plain;
    const int count = p->is_hexes ? 8 : 4;
    for (int n = 0; n < s->coming_count; n++) {
        const int32_t *vertices = p->connectivity + count * (int64_t)s->coming[n];
        s->tets.cell[n] = s->coming[n];
        for (int i = 0; i < count; i++) {
            s->tets.plain[i][n] = vertices[i];
            kernel_plain_prefetch(p, vertices[i]);
        }
    }
    s->tets.count = s->coming_count;
    s->coming_count = 0;
}

/* Cells whose connectivity has come: tets wait for their vertices, others are done with. */
static void kernel_find_coming(kernel_finder *s)
{
    if (s->plain.is_so || s->plain.is_hexes) {
        kernel_find_coming_plain(s);
        return;
    }
    const grid *g = s->frame->job->parts[s->part].cells;
    const grid_field *field = &s->field->fields[s->part];
    if (!s->surface || g->cell_type != GRID_TET)
        for (int n = 0; n < s->coming_count; n++) kernel_tile_prefetch_vertices(g, field, s->coming[n]);
    for (int n = 0; n < s->coming_count; n++) {
        const uint32_t cell = s->coming[n];
        if (s->surface && grid_cell_type(g, cell) == GRID_TET) {
            int64_t *vertices = s->tets.vertices[s->tets.count];
            s->tets.cell[s->tets.count++] = cell;
            grid_cell_vertices(g, cell, vertices);
            for (int i = 0; i < 4; i++) kernel_prefetch_vertex(g, field, vertices[i]);
            continue;
        }
        kernel_cell_fetch(&s->cell, g, field, cell);
        if (s->cell.type == GRID_POLYHEDRON)
            kernel_find_polyhedron(s, cell);
        else
            kernel_find_cell(s);
    }
    s->coming_count = 0;
}

static void kernel_find_leaf(kernel_finder *s, const uint32_t *cells, int count)
{
    const grid *g = s->frame->job->parts[s->part].cells;
    const int vertices = g->offsets.data ? 0 : grid_type_vertices(g->cell_type);
    for (int n = 0; n < count; n++) {
        if (s->coming_count == SIMD_WIDTH) {
            kernel_find_tets(s);
            kernel_find_coming(s);
        }
        s->coming[s->coming_count++] = cells[n];
        if (vertices) __builtin_prefetch(g->connectivity.data + (int64_t)cells[n] * vertices * g->connectivity.stride);
    }
}

static void kernel_find_rest(kernel_finder *s)
{
    kernel_find_tets(s);
    kernel_find_coming(s);
    kernel_find_tets(s);
    kernel_find_crossed_hexes(s);
}

/* A node is looked at beside others, each of which has what it needs on its way from memory while they wait. */
enum { KERNEL_FRONT = 16, KERNEL_FRONT_ROOM = KERNEL_FRONT * MMBVH_MAX_DEPTH };

/* Nodes, as 2 nodes + 1 where it lies in the picture. */
typedef struct kernel_front {
    int count;
    int64_t entries[KERNEL_FRONT];
} kernel_front;

/* May it show in the picture? Children of one that lies in it need not be asked. */
SIMD_INLINE bool kernel_node_in_picture(const kernel_finder *s, const mmbvh *tree, int64_t node, bool *is_inside)
{
    kernel_lie lie = {0};
    if (*is_inside) return true;
    const kernel_sides sides = kernel_box_sides(&s->planes, tree, node, &lie);
    const unsigned outside =
        (sides.below & (1u | 1u << KERNEL_ROWS_LANE)) | (sides.above & (2u | 2u << KERNEL_ROWS_LANE));
    *is_inside = !outside && lie.near >= s->t_near;
    return kernel_blocks_of(sides) && !(lie.far < s->t_near);
}

/* Those of the entries whose values and whose boxes show. About half of them do by their values, which no branch
 * foresees. */
SIMD_INLINE void kernel_front_choose(const kernel_finder *s, const mmbvh *tree, const mmbvh_ranges *ranges,
                                     kernel_front *front, const int64_t *entries, int count)
{
    int64_t shown[KERNEL_FRONT];
    int left = 0;
    for (int n = 0; n < count; n++) {
        shown[left] = entries[n];
        left += kernel_node_shows(s->interest, ranges, entries[n] >> 1);
    }
    front->count = 0;
    for (int n = 0; n < left; n++) {
        bool is_inside = shown[n] & 1;
        if (kernel_node_in_picture(s, tree, shown[n] >> 1, &is_inside))
            front->entries[front->count++] = shown[n] | is_inside;
    }
}

/* The leaves among them, whose cells are asked for, and the inner nodes' left children, likewise. */
SIMD_INLINE void kernel_front_open(const mmbvh *tree, const mmbvh_ranges *ranges, const kernel_front *front,
                                   kernel_front *leaves, kernel_front *children)
{
    leaves->count = children->count = 0;
    for (int n = 0; n < front->count; n++) {
        const int64_t node = front->entries[n] >> 1, ref = mmbvh_node_ref(tree, node);
        const bool is_leaf = mmbvh_node_count(tree, node);
        const char *next = ranges->low + ref * ranges->stride;
        leaves->entries[leaves->count] = node;
        leaves->count += is_leaf;
        children->entries[children->count] = 2 * ref | (front->entries[n] & 1);
        children->count += !is_leaf;
        __builtin_prefetch(is_leaf ? (const char *)(tree->cells + ref) : next);
        __builtin_prefetch(is_leaf ? (const char *)(tree->cells + ref + MMBVH_MAX_LEAF) : next + ranges->stride);
    }
}

/* Depth first, from the left, KERNEL_FRONT nodes at once: about in the order in which leaves lie in memory. One node at
 * once needs no more room than the tree is deep. */
static void kernel_find_shown(kernel_finder *s, int64_t root)
{
    const mmbvh *tree = s->frame->job->parts[s->part].tree;
    const mmbvh_ranges *ranges = &s->field->ranges[s->part];
    int64_t stack[KERNEL_FRONT_ROOM + 2 * KERNEL_FRONT];
    int top = 0;
    stack[top++] = 2 * root;
    while (top && !s->list->is_full) {
        kernel_front front, leaves, children;
        const int most = top < KERNEL_FRONT_ROOM - MMBVH_MAX_DEPTH ? KERNEL_FRONT : 1;
        const int count = top < most ? top : most;
        int64_t next[KERNEL_FRONT];
        for (int n = 0; n < count; n++) next[n] = stack[--top];
        kernel_front_choose(s, tree, ranges, &front, next, count);
        kernel_front_open(tree, ranges, &front, &leaves, &children);
        for (int n = 0; n < leaves.count; n++) {
            const int64_t leaf = leaves.entries[n];
            kernel_find_leaf(s, tree->cells + mmbvh_node_ref(tree, leaf), mmbvh_node_count(tree, leaf));
        }
        while (children.count) {
            const int64_t left = children.entries[--children.count];
            stack[top++] = left + 2;
            stack[top++] = left;
        }
    }
    kernel_find_rest(s);
}

#endif
