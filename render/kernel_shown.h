/* Isosurfaces by one traversal a frame: the trees are gone down once for the whole picture, and each cell that the
 * surface crosses is fetched and placed once, to find the pixels that it may show in; the cells are then binned
 * by tile (render_shown.c; sort-middle, in the terms of Molnar et al. 1994), and tiles trace them from the nearest on,
 * blocks that know of something nearer left out:
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

#include "kernel_tile_surface.h"

/* Tets, one a lane. */
typedef struct kernel_tets {
    int count;
    uint32_t cell[SIMD_WIDTH];
    int64_t vertices[SIMD_WIDTH][GRID_MAX_CELL_VERTICES];
} kernel_tets;

/* One subtree's search. */
typedef struct kernel_finder {
    const kernel_frame *frame;
    const kernel_surface *surface;
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
    int coming_count;
} kernel_finder;

static inline void kernel_finder_begin(kernel_finder *s, const kernel_frame *f, const kernel_subtree *subtree)
{
    kernel_borders borders;
    s->frame = f;
    s->surface = &f->surfaces[subtree->surface];
    s->part = subtree->part;
    s->source = (uint32_t)subtree->part * RENDER_MAX_ISOVALUES;
    while (f->isovalues[s->source % RENDER_MAX_ISOVALUES].surface != subtree->surface) s->source++;
    s->coming_count = s->tets.count = 0;
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

/* The blocks of the pixels between, of so many pixels: false where there are none. A part in 1e5 of the cell and its
 * place, and a hundredth of a pixel, are more than rays are off by when they hit by a rounding; blur is what places may
 * be off by. */
SIMD_INLINE bool kernel_block_range(kernel_extent e, float zero, float blur, int pixels, uint16_t *first,
                                    uint16_t *last)
{
    const float pad = 0.01f + 3e-5f * (fmaxf(fabsf(e.low), fabsf(e.high)) + fabsf(zero)) + blur;
    const float low = fmaxf(ceilf(e.low + zero - pad), 0);
    const float high = fminf(floorf(e.high + zero + pad), (float)(pixels - 1));
    if (!(low <= high)) return false;
    *first = (uint16_t)((int)low / KERNEL_BLOCK);
    *last = (uint16_t)((int)high / KERNEL_BLOCK);
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
    if (!(out->near > -INFINITY)) out->near = -INFINITY; /* not a number */
    if (!camera->is_orthographic && !(depth.low - s->t_near > 0.01f * size)) {
        out->x0 = out->y0 = 0;
        out->x1 = (uint16_t)((camera->width - 1) / KERNEL_BLOCK);
        out->y1 = (uint16_t)((camera->height - 1) / KERNEL_BLOCK);
        return true;
    }
    const float blur = 2e-6f * (camera->is_orthographic ? size + 1 : 1);
    return kernel_block_range(columns, s->column_0, blur * fabsf(s->column_scale), camera->width, &out->x0, &out->x1) &&
           kernel_block_range(rows, s->row_0, blur * fabsf(s->row_scale), camera->height, &out->y0, &out->y1);
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
            low[a] = fminf(low[a], place[a]);
            high[a] = fmaxf(high[a], place[a]);
        }
    }
    o.count = 8;
    for (int i = 0; i < 8; i++)
        for (int a = 0; a < 3; a++) o.point[a][i] = i >> a & 1 ? high[a] : low[a];
    for (int a = 0; a < 3; a++) o.size[a] = fmaxf(fabsf(low[a]), fabsf(high[a]));
    if (kernel_outline_shown(s, &o, &shown)) kernel_add_shown(s, &shown);
}

SIMD_INLINE void kernel_find_cell(kernel_finder *s)
{
    const render_surface_layer *layer = s->surface->layer;
    kernel_cell *c = &s->cell;
    for (int value = 0; value < layer->value_count; value++) {
        kernel_outline o;
        kernel_shown shown = {.cell = c->index, .source = s->source + (uint32_t)value};
        if (!kernel_cell_straddles(c, layer->values[value])) continue;
        if (!c->is_placed) kernel_cell_move(c, s->frame, &s->picture, s->frame->job->parts[s->part].cells);
        kernel_cell_relative(c, layer->values[value]);
        if (c->type == GRID_TET) {
            if (!kernel_tet_outline(c, &o)) continue;
        } else {
            kernel_vertex_outline(c, &o);
            if (!kernel_slab_outline(c, &o)) continue;
        }
        if (kernel_outline_shown(s, &o, &shown)) kernel_add_shown(s, &shown);
    }
}

/* ---- tets, as many at once as there are lanes ----
 *
 * In float32 from the eye on: positions err by 4 roundings of their distance from it, and so do X, Y and depth; all of
 * it is within the pads of kernel_block_range(), which take this of the picture's scale too. */

/* Where the surface of one isovalue is in each: ends over the edges that it crosses. */
typedef struct kernel_tet_ends {
    vf near, far, left, right, top, bottom;
} kernel_tet_ends;

typedef struct kernel_tet_lanes {
    float f[4][SIMD_WIDTH], at[3][4][SIMD_WIDTH];
    uint32_t cell[SIMD_WIDTH];
    int count;
} kernel_tet_lanes;

SIMD_INLINE void kernel_tet_lanes_ends(const kernel_finder *s, const kernel_tet_lanes *l, kernel_tet_ends *e)
{
    const render_camera *camera = &s->frame->job->camera;
    const double *axes[3] = {camera->right, camera->up, camera->forward};
    const vf most = vf_set(INFINITY);
    vf f[4], at[4][3];
    for (int i = 0; i < 4; i++) {
        const vf d[3] = {vf_load(l->at[0][i]), vf_load(l->at[1][i]), vf_load(l->at[2][i])};
        f[i] = vf_load(l->f[i]);
        for (int a = 0; a < 3; a++)
            at[i][a] = (d[0] * (float)axes[a][0] + d[1] * (float)axes[a][1]) + d[2] * (float)axes[a][2];
    }
    *e = (kernel_tet_ends){most, -most, most, -most, most, -most};
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int i = kernel_tet_edge[n][0], j = kernel_tet_edge[n][1];
        const vm crossed = vm_xor(vf_lt(f[i], vf_set(0)), vf_lt(f[j], vf_set(0)));
        const vf along = f[i] / (f[i] - f[j]);
        vf point[3];
        for (int a = 0; a < 3; a++) point[a] = at[i][a] + along * (at[j][a] - at[i][a]);
        vf inverse = vf_set(1);
        if (!camera->is_orthographic) inverse = 1.0f / point[2];
        const vf x = (point[0] * inverse) * s->column_scale, y = (point[1] * inverse) * s->row_scale;
        e->near = vf_min(e->near, vf_select(crossed, point[2], most));
        e->far = vf_max(e->far, vf_select(crossed, point[2], -most));
        e->left = vf_min(e->left, vf_select(crossed, x, most));
        e->right = vf_max(e->right, vf_select(crossed, x, -most));
        e->top = vf_min(e->top, vf_select(crossed, y, most));
        e->bottom = vf_max(e->bottom, vf_select(crossed, y, -most));
    }
}

static void kernel_find_tet_lanes(kernel_finder *s, const kernel_tet_lanes *l, uint32_t source)
{
    kernel_tet_ends e;
    float ends[6][SIMD_WIDTH];
    kernel_tet_lanes_ends(s, l, &e);
    vf_store(ends[0], e.near);
    vf_store(ends[1], e.far);
    vf_store(ends[2], e.left);
    vf_store(ends[3], e.right);
    vf_store(ends[4], e.top);
    vf_store(ends[5], e.bottom);
    for (int n = 0; n < l->count; n++) {
        kernel_shown shown = {.cell = l->cell[n], .source = source};
        const kernel_extent depth = {ends[0][n] + s->t_near, ends[1][n] + s->t_near};
        const kernel_extent columns = {ends[2][n], ends[3][n]}, rows = {ends[4][n], ends[5][n]};
        if (kernel_extents_shown(s, depth, fabsf(ends[1][n]) + fabsf(s->t_near), columns, rows, &shown))
            kernel_add_shown(s, &shown);
    }
}

/* Those of the tets that the layer's isovalues cross. */
static void kernel_find_tets(kernel_finder *s)
{
    const render_surface_layer *layer = s->surface->layer;
    const grid_field *field = &layer->field.fields[s->part];
    const grid *g = s->frame->job->parts[s->part].cells;
    const double *eye = s->frame->job->camera.eye, scale = s->frame->job->space.scale;
    kernel_cell *c = &s->cell;
    for (int value = 0; value < layer->value_count; value++) {
        kernel_tet_lanes lanes;
        lanes.count = 0;
        for (int n = 0; n < s->tets.count; n++) {
            c->count = 4;
            if (!grid_cell_values(field, s->tets.cell[n], s->tets.vertices[n], 4, c->values)) continue;
            if (!kernel_cell_straddles(c, layer->values[value])) continue;
            kernel_cell_relative(c, layer->values[value]);
            for (int i = 0; i < 4; i++) {
                double world[3];
                grid_vertex(g, s->tets.vertices[n][i], world);
                for (int a = 0; a < 3; a++) lanes.at[a][i][lanes.count] = (float)((world[a] - eye[a]) * scale);
                lanes.f[i][lanes.count] = c->f[i];
            }
            lanes.cell[lanes.count++] = s->tets.cell[n];
        }
        for (int n = lanes.count; lanes.count && n < SIMD_WIDTH; n++)
            for (int i = 0; i < 4; i++) {
                lanes.f[i][n] = lanes.f[i][0];
                for (int a = 0; a < 3; a++) lanes.at[a][i][n] = lanes.at[a][i][0];
            }
        if (lanes.count) kernel_find_tet_lanes(s, &lanes, s->source + (uint32_t)value);
    }
    s->tets.count = 0;
}

/* ---- leaves ---- */

/* Cells whose connectivity has come: tets wait for their vertices, others are done with. */
static void kernel_find_coming(kernel_finder *s)
{
    const grid *g = s->frame->job->parts[s->part].cells;
    const grid_field *field = &s->surface->layer->field.fields[s->part];
    for (int n = 0; n < s->coming_count; n++) {
        const uint32_t cell = s->coming[n];
        if (grid_cell_type(g, cell) == GRID_TET) {
            int64_t *vertices = s->tets.vertices[s->tets.count];
            s->tets.cell[s->tets.count++] = cell;
            grid_cell_vertices(g, cell, vertices);
            for (int i = 0; i < 4; i++) kernel_prefetch_vertex(g, field, vertices[i]);
            continue;
        }
        kernel_cell_fetch(&s->cell, g, field, cell);
        if (s->cell.type == GRID_POLYHEDRON)
            kernel_find_polyhedron(s, cell);
        else if (s->cell.is_finite)
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
}

/* Depth first, the left child first: in the order in which leaves lie in memory. */
static void kernel_find_shown(kernel_finder *s, int64_t root)
{
    const mmbvh *tree = s->frame->job->parts[s->part].tree;
    const mmbvh_ranges *ranges = &s->surface->layer->field.ranges[s->part];
    int64_t stack[MMBVH_MAX_DEPTH + 1];
    int top = 0;
    stack[top++] = root;
    while (top && !s->list->is_full) {
        const int64_t node = stack[--top];
        if (!kernel_node_shows(&s->surface->interest, ranges, node)) continue;
        const kernel_lie lie = kernel_box_lie(&s->planes, tree, node);
        if (!lie.blocks || lie.far < s->t_near) continue;
        const int count = mmbvh_node_count(tree, node);
        const int64_t ref = mmbvh_node_ref(tree, node);
        if (count) {
            kernel_find_leaf(s, tree->cells + ref, count);
            continue;
        }
        __builtin_prefetch(ranges->low + ref * ranges->stride);
        stack[top++] = ref + 1;
        stack[top++] = ref;
    }
    kernel_find_rest(s);
}

/* ---- a tile's ---- */

/* A tile's cells by depth, sorted no further than they are asked for: quicksort, the nearer part first, down to pieces
 * of a few, sorted by insertion. */
enum { KERNEL_PIECE = 8, KERNEL_PIECES = 32 };

typedef struct kernel_by_depth {
    kernel_tile_shown *items;
    int begin;                    /* of what has not been handed out */
    int ends[KERNEL_PIECES], top; /* of the parts, the nearest last */
} kernel_by_depth;

/* Items before the returned index are no farther than those from it on; neither part is empty. */
static inline int kernel_part_by_depth(kernel_tile_shown *items, int begin, int end)
{
    const float a = items[begin].near, b = items[begin + (end - begin) / 2].near, c = items[end - 1].near;
    const float pivot = fmaxf(fminf(a, b), fminf(fmaxf(a, b), c));
    int i = begin - 1, j = end;
    for (;;) {
        do i++;
        while (items[i].near < pivot);
        do j--;
        while (pivot < items[j].near);
        if (i >= j) return j + 1 < end ? j + 1 : j;
        const kernel_tile_shown moved = items[i];
        items[i] = items[j];
        items[j] = moved;
    }
}

static inline void kernel_insert_by_depth(kernel_tile_shown *items, int begin, int end)
{
    for (int i = begin + 1; i < end; i++) {
        const kernel_tile_shown moved = items[i];
        int j = i;
        for (; j > begin && moved.near < items[j - 1].near; j--) items[j] = items[j - 1];
        items[j] = moved;
    }
}

/* The next nearest ones: from *first on, as many as returned. 0: there are no more. */
static inline int kernel_next_by_depth(kernel_by_depth *q, const kernel_tile_shown **first)
{
    while (q->top && q->ends[q->top - 1] == q->begin) q->top--;
    if (!q->top) return 0;
    while (q->ends[q->top - 1] - q->begin > KERNEL_PIECE && q->top < KERNEL_PIECES) {
        const int middle = kernel_part_by_depth(q->items, q->begin, q->ends[q->top - 1]);
        q->ends[q->top++] = middle;
    }
    const int end = q->ends[--q->top], count = end - q->begin;
    if (count <= KERNEL_PIECE) kernel_insert_by_depth(q->items, q->begin, end);
    *first = q->items + q->begin;
    q->begin = end;
    return count;
}

/* The farthest that a block knows of. */
SIMD_INLINE float kernel_tile_far(const kernel_tile_trace *t)
{
    float far = -INFINITY;
    for (unsigned left = t->wanted; left; left &= left - 1) {
        const int block = __builtin_ctz(left);
        far = fmaxf(far, t->far[block / SIMD_WIDTH][block % SIMD_WIDTH]);
    }
    return far;
}

static void kernel_tile_meet(kernel_tile_trace *t, const kernel_tile_shown *shown, int part, int value, unsigned blocks)
{
    const render_surface_layer *layer = t->surface->layer;
    const grid *g = t->frame->job->parts[part].cells;
    kernel_cell *c = &t->cell;
    kernel_cell_fetch(c, g, &layer->field.fields[part], shown->cell);
    if (c->type == GRID_POLYHEDRON) {
        kernel_blocks_meet(t, blocks, part, shown->cell, NULL, 0);
        return;
    }
    kernel_cell_move(c, t->frame, &t->tile, g);
    kernel_cell_relative(c, layer->values[value]);
    kernel_tile_ready(t, part);
    t->poly.is_set_up = false;
    kernel_blocks_meet(t, blocks, part, c->index, c, value);
}

/* Set the layer of the tile by the source; returns the isovalue's number in it. */
SIMD_INLINE int kernel_tile_source(kernel_tile_trace *t, uint32_t source, int *part)
{
    const kernel_isovalue *isovalue = &t->frame->isovalues[source % RENDER_MAX_ISOVALUES];
    *part = (int)(source / RENDER_MAX_ISOVALUES);
    t->layer = isovalue->surface;
    t->surface = &t->frame->surfaces[isovalue->surface];
    return isovalue->value;
}

SIMD_INLINE void kernel_tile_prefetch_shown(kernel_tile_trace *t, const kernel_tile_shown *items, int count)
{
    for (int n = 0; n < count; n++) {
        int part;
        if (!(items[n].blocks & kernel_blocks_beyond(t, items[n].near))) continue;
        kernel_tile_source(t, items[n].source, &part);
        kernel_tile_prefetch(t->frame->job->parts[part].cells, &t->surface->layer->field.fields[part], &items[n].cell,
                             1);
    }
}

/* The tile's opaque surfaces, or the transparent ones, for which those must be known. */
SIMD_INLINE void kernel_tile_trace_shown(kernel_tile_trace *t, kernel_tile_shown *items, int count, bool transparent)
{
    kernel_by_depth queue = {.items = items, .ends = {count}, .top = 1};
    const kernel_tile_shown *next;
    float far = kernel_tile_far(t);
    for (int left; (left = kernel_next_by_depth(&queue, &next)) != 0; far = kernel_tile_far(t)) {
        if (left <= KERNEL_PIECE) {
            if (next->near > far) return;
            kernel_tile_prefetch_shown(t, next, left);
        }
        for (; left; left--, next++) {
            int part;
            const int value = kernel_tile_source(t, next->source, &part);
            if ((t->layer >= t->frame->opaque_count) != transparent) continue;
            const unsigned blocks = next->blocks & t->wanted & kernel_blocks_beyond(t, next->near);
            if (blocks) kernel_tile_meet(t, next, part, value, blocks);
        }
    }
}

/* The tile's cells; returns how many they are. */
SIMD_INLINE int kernel_shown_in_tile(const kernel_frame *f, int x0, int y0, kernel_tile_shown **items)
{
    const int columns = (f->job->camera.width + KERNEL_TILE - 1) / KERNEL_TILE;
    const uint32_t *starts = f->shown_starts + (y0 / KERNEL_TILE * columns + x0 / KERNEL_TILE);
    *items = f->shown + starts[0];
    return (int)(starts[1] - starts[0]);
}

SIMD_INLINE void kernel_tile_surfaces_shown(kernel_tile_trace *t)
{
    const kernel_frame *f = t->frame;
    kernel_tile_shown *items;
    const int count = kernel_shown_in_tile(f, t->tile.x0, t->tile.y0, &items);
    if (!count) return;
    if (f->opaque_count) kernel_tile_trace_shown(t, items, count, false);
    if (f->opaque_count < f->surface_count) kernel_tile_trace_shown(t, items, count, true);
}

#endif
