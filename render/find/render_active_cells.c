/* Threads put the crossed cells of the subtrees dealt to them into blocks of one array, and the gaps that their last
 * blocks leave are closed from its end: gathers reach records by index. The array has room for all cells, or for as
 * many as may be kept: memory that is not written to is none. */
#include "render_active_cells.h"
#include "kernel_types.h"
#include "render.h"
#include "render_kernels.h"
#include "render_subtrees.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "grid.h"
#include "memory.h"
#include "mmbvh.h"

enum {
    BLOCK = 1 << 14,      /* floats: 64 KiB */
    MOST_FLOATS = 1 << 24 /* of all that is kept: 64 MiB */
};

/* The records of a layer's isovalues in a part's field; records is NULL where they are not kept. */
typedef struct kept_cells {
    const grid *cells;
    const mmbvh *tree;
    double scale; /* the space's, at which its numbers were found usual */
    grid_field field;
    int value_count;
    double values[RENDER_MAX_ISOVALUES];
    kernel_active active;
} kept_cells;

struct render_active_cells {
    int count;
    kept_cells *items;
    int64_t floats;
};

render_active_cells *render_active_cells_create(void)
{
    return base_calloc(1, sizeof(render_active_cells));
}

void render_active_cells_clear(render_active_cells *active)
{
    for (int i = 0; i < active->count; i++) base_free((void *)active->items[i].active.records);
    base_free(active->items);
    *active = (render_active_cells){0};
}

void render_active_cells_free(render_active_cells *active)
{
    if (active) render_active_cells_clear(active);
    base_free(active);
}

int64_t render_active_cells_bytes(const render_active_cells *active)
{
    return active->floats * (int64_t)sizeof(float);
}

/* ---- filling -------------------------------------------------------------------------------------------------- */

/* An array of records, which threads take block by block. */
typedef struct kernel_room {
    float *floats;
    int64_t blocks, taken;
} kernel_room;

static bool grow(kernel_active_writer *writer)
{
    int64_t block;
#pragma omp atomic capture
    block = writer->of->taken++;
    writer->is_refused = block >= writer->of->blocks;
    if (writer->is_refused) return false;
    writer->at = writer->of->floats + block * BLOCK;
    writer->end = writer->at + BLOCK;
    return true;
}

static int by_place(const void *a, const void *b)
{
    const float *x = ((const kernel_active_writer *)a)->at, *y = ((const kernel_active_writer *)b)->at;
    return (x > y) - (x < y);
}

/* Fills the rest of threads' last blocks with records from the end. Returns how many floats there are. */
static int64_t close_gaps(const kernel_room *room, kernel_active_writer *writers, int threads)
{
    float *top = room->floats + room->taken * BLOCK;
    int low = 0, high = threads;
    qsort(writers, (size_t)threads, sizeof *writers, by_place);
    while (low < threads && !writers[low].at) low++;
    while (low < high) {
        const kernel_active_writer *last = &writers[high - 1];
        kernel_active_writer *gap = &writers[low];
        if (last->end == top) {
            top = last->at;
            high--;
            continue;
        }
        const ptrdiff_t after = top - last->end, wanted = gap->end - gap->at, moved = wanted < after ? wanted : after;
        top -= moved;
        memcpy(gap->at, top, (size_t)moved * sizeof *top);
        gap->at += moved;
        if (gap->at == gap->end) low++;
    }
    return top - room->floats;
}

static void fill(kernel_room *room, const render_subtrees *subtrees, kernel_active_writer *writers,
                 const kernel_frame *frame, kernel_thread *thread_of, int threads)
{
    const kernel_table *kernels = render_kernels();
#pragma omp parallel num_threads(threads)
    {
        const int me = omp_get_thread_num();
        kernel_active_writer *writer = &writers[me];
        writer->of = room;
#pragma omp for schedule(dynamic, 1)
        for (int64_t i = 0; i < subtrees->count; i++)
            if (!writer->is_refused) kernels->write_active(frame, &thread_of[me], &subtrees->items[i], writer, grow);
    }
}

static bool is_usual(const kernel_frame *frame, const kernel_surface *surface)
{
    const double scale = frame->job->space.scale;
    bool is_tets = scale > 1e-20 && scale < 1e20;
    for (int a = 0; a < 3; a++) {
        const double eye = fabs(frame->job->camera.eye[a]);
        is_tets = is_tets && eye * scale < (double)KERNEL_ACTIVE_PLACE && eye < 1e15;
    }
    for (int i = 0; i < surface->layer->value_count; i++)
        is_tets = is_tets && fabs(surface->layer->values[i]) < (double)KERNEL_ACTIVE_VALUE;
    return is_tets;
}

/* Finds a point of the tree's box, given by its shares, along the camera's axes from the eye. */
static void place_in_box(const kernel_frame *frame, const mmbvh *tree, const double share[3], double at[3])
{
    const render_camera *camera = &frame->job->camera;
    const double *axes[3] = {camera->right, camera->up, camera->forward};
    float low[4], high[4];
    mmbvh_node_box(tree, 0, low, high);
    at[0] = at[1] = at[2] = 0;
    for (int a = 0; a < 3; a++) {
        const double scaled = (double)low[a] + share[a] * ((double)high[a] - (double)low[a]);
        const double from_eye = tree->origin[a] + scaled / tree->scale - camera->eye[a];
        for (int axis = 0; axis < 3; axis++) at[axis] += from_eye * axes[axis][a];
    }
}

static bool is_in_picture(const kernel_frame *frame, const double at[3])
{
    const render_camera *camera = &frame->job->camera;
    const double depth = camera->is_orthographic ? 1 : at[2];
    const double column = (at[0] / depth - frame->slope_x0) / frame->slope_dx;
    const double row = (at[1] / depth - frame->slope_y0) / frame->slope_dy;
    return column >= -0.5 && column < camera->width - 0.5 && row >= -0.5 && row < camera->height - 0.5;
}

/* Do three quarters of the part's box lie in the picture, and all of it in front of the eye? For other
 * parts the tree is faster than to go through all active cells, let alone to keep them. */
static bool is_in_view(const kernel_frame *frame, const mmbvh *tree)
{
    enum { SIDE = 4, POINTS = SIDE * SIDE * SIDE };
    int inside = 0;
    double at[3];
    for (int n = 0; n < 8; n++) {
        place_in_box(frame, tree, (const double[3]){n & 1, n >> 1 & 1, n >> 2}, at);
        if (!(at[2] > 0)) return false;
    }
    for (int n = 0; n < POINTS; n++) {
        const int i[3] = {n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE};
        place_in_box(frame, tree, (const double[3]){(i[0] + 0.5) / SIDE, (i[1] + 0.5) / SIDE, (i[2] + 0.5) / SIDE}, at);
        inside += is_in_picture(frame, at);
    }
    return inside >= POINTS * 3 / 4;
}

/* Tells whether records hold all that tiles ask of the layer's cells (render_kernels.c). */
static bool can_keep(const kernel_frame *frame, int surface, int part)
{
    const kernel_surface *s = &frame->surfaces[surface];
    const grid *cells = frame->job->parts[part].cells;
    if (surface >= frame->opaque_count || s->layer->colour_map || s->layer->normal != RENDER_GRADIENT) return false;
    if (!s->layer->field.ranges[part].low || !frame->job->parts[part].tree->node_count) return false;
    if (!is_in_view(frame, frame->job->parts[part].tree)) return false;
    return cells->cell_type == GRID_TET || (cells->cell_type == GRID_HEX && s->layer->root == RENDER_ROBUST);
}

static kernel_active keep(const render_active_cells *active, const kernel_frame *frame, int surface, int part,
                          kernel_thread *thread_of, int threads)
{
    const bool is_hexes = frame->job->parts[part].cells->cell_type == GRID_HEX;
    const int64_t size = (is_hexes ? 8 : 4) * KERNEL_ACTIVE_FLOATS, cells = frame->job->parts[part].tree->cell_count;
    const int64_t most = (MOST_FLOATS - active->floats) / BLOCK, all = (cells * size + BLOCK - 1) / BLOCK + threads;
    kernel_room room = {.blocks = most < all ? most : all};
    kernel_active_writer *writers = base_calloc((size_t)threads, sizeof *writers);
    render_subtrees subtrees = {0};
    int64_t floats = 0;
    bool is_refused = true;
    room.floats = base_reserve((size_t)(room.blocks * BLOCK) * sizeof *room.floats);
    if (writers && room.floats && render_subtrees_begin(&subtrees, 1)) {
        is_refused = false;
        render_subtrees_add(&subtrees, frame, surface, part);
        fill(&room, &subtrees, writers, frame, thread_of, threads);
        for (int t = 0; t < threads; t++) is_refused = is_refused || writers[t].is_refused;
        if (!is_refused) floats = close_gaps(&room, writers, threads);
    }
    base_free(writers);
    base_free(subtrees.items);
    if (is_refused)
        base_free(room.floats);
    else
        base_use(room.floats, (size_t)floats * sizeof *room.floats);
    return is_refused ? (kernel_active){0}
                      : (kernel_active){room.floats, floats / size, (int)size / KERNEL_ACTIVE_FLOATS};
}

/* ---- what there is -------------------------------------------------------------------------------------------- */

static bool is_same_field(const grid_field *a, const grid_field *b)
{
    return a->values.data == b->values.data && a->values.stride == b->values.stride &&
           a->values.is_wide == b->values.is_wide && a->values.is_integer == b->values.is_integer &&
           a->component == b->component && a->component_stride == b->component_stride &&
           a->is_cell_centred == b->is_cell_centred;
}

static bool is_of(const kept_cells *k, const kernel_frame *frame, int surface, int part)
{
    const render_part *p = &frame->job->parts[part];
    const render_surface_layer *layer = frame->surfaces[surface].layer;
    return k->cells == p->cells && k->tree == p->tree && k->scale == frame->job->space.scale &&
           is_same_field(&k->field, &layer->field.fields[part]) && k->value_count == layer->value_count &&
           !memcmp(k->values, layer->values, (size_t)layer->value_count * sizeof *layer->values);
}

/* Returns a place for the layer's cells on the part; NULL where there is no memory. */
static kept_cells *place(render_active_cells *active, const kernel_frame *frame, int surface, int part)
{
    const render_part *p = &frame->job->parts[part];
    const render_surface_layer *layer = frame->surfaces[surface].layer;
    kept_cells *items = base_realloc(active->items, (size_t)(active->count + 1) * sizeof *items);
    if (!items) return NULL;
    active->items = items;
    kept_cells *item = &items[active->count++];
    *item = (kept_cells){.cells = p->cells,
                         .tree = p->tree,
                         .scale = frame->job->space.scale,
                         .field = layer->field.fields[part],
                         .value_count = layer->value_count};
    memcpy(item->values, layer->values, (size_t)layer->value_count * sizeof *layer->values);
    return item;
}

static kernel_active find(render_active_cells *active, const kernel_frame *frame, int surface, int part,
                          kernel_thread *thread_of, int threads)
{
    for (int i = 0; i < active->count; i++)
        if (is_of(&active->items[i], frame, surface, part)) return active->items[i].active;
    kept_cells *item = place(active, frame, surface, part);
    if (!item) return (kernel_active){0};
    item->active = keep(active, frame, surface, part, thread_of, threads);
    active->floats += item->active.count * item->active.vertices * KERNEL_ACTIVE_FLOATS;
    return item->active;
}

void render_active_cells_begin(kernel_frame *frame, kernel_thread *thread_of, int threads)
{
    const render_job *job = frame->job;
    if (!job->active) return;
    kernel_active *active = base_calloc((size_t)frame->surface_count * (size_t)job->part_count, sizeof *active);
    for (int surface = 0; active && surface < frame->surface_count; surface++)
        for (int part = 0; part < job->part_count; part++)
            if (is_usual(frame, &frame->surfaces[surface]) && can_keep(frame, surface, part))
                active[surface * job->part_count + part] = find(job->active, frame, surface, part, thread_of, threads);
    frame->active = active;
}

void render_active_cells_end(kernel_frame *frame)
{
    base_free((void *)frame->active);
    frame->active = NULL;
}
