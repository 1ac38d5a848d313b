/* Threads put the crossed cells of the subtrees dealt to them into chunks of their own, which then are joined to
 * records in one piece: gathers reach them by index. */
#include "render_kept.h"

#include <omp.h>
#include <string.h>

#include "memory.h"
#include "render_isa.h"
#include "render_subtrees.h"

enum {
    CHUNK = 1 << 16,      /* floats: 256 KiB */
    MOST_FLOATS = 1 << 24 /* of all that is kept: 64 MiB */
};

/* A layer's isovalues in a part's field; records NULL: they are not kept. */
typedef struct kept_cells {
    const grid *cells;
    grid_field field;
    int value_count;
    double values[RENDER_MAX_ISOVALUES];
    kernel_kept kept;
} kept_cells;

struct render_kept {
    int count;
    kept_cells *items;
    int64_t floats;
};

render_kept *render_kept_create(void)
{
    return base_calloc(1, sizeof(render_kept));
}

void render_kept_clear(render_kept *kept)
{
    for (int i = 0; i < kept->count; i++) base_free((void *)kept->items[i].kept.records);
    base_free(kept->items);
    *kept = (render_kept){0};
}

void render_kept_free(render_kept *kept)
{
    if (kept) render_kept_clear(kept);
    base_free(kept);
}

int64_t render_kept_bytes(const render_kept *kept)
{
    return kept->floats * (int64_t)sizeof(float);
}

/* ---- filling -------------------------------------------------------------------------------------------------- */

static bool grow(kernel_keeper *keeper)
{
    int64_t left;
#pragma omp atomic capture
    left = *keeper->left -= CHUNK;
    kernel_kept_chunk *chunk = left < 0 ? NULL : base_alloc(sizeof *chunk + CHUNK * sizeof *chunk->records);
    keeper->is_refused = !chunk;
    if (!chunk) return false;
    if (keeper->chunk) keeper->chunk->floats = keeper->at - keeper->chunk->records;
    chunk->before = keeper->chunk;
    keeper->chunk = chunk;
    keeper->at = chunk->records;
    keeper->end = keeper->at + CHUNK;
    return true;
}

/* Returns how many floats it has. */
static int64_t end_keeper(kernel_keeper *keeper)
{
    int64_t floats = 0;
    if (keeper->chunk) keeper->chunk->floats = keeper->at - keeper->chunk->records;
    for (const kernel_kept_chunk *c = keeper->chunk; c; c = c->before) floats += c->floats;
    return floats;
}

/* to: NULL where they are not wanted. */
static void move_chunks(kernel_keeper *keeper, float *to)
{
    while (keeper->chunk) {
        kernel_kept_chunk *chunk = keeper->chunk;
        keeper->chunk = chunk->before;
        if (to) {
            memcpy(to, chunk->records, (size_t)chunk->floats * sizeof *to);
            to += chunk->floats;
        }
        base_free(chunk);
    }
}

/* The threads' keepers, into one piece. */
typedef struct filling {
    render_subtrees subtrees;
    kernel_keeper *keepers; /* one a thread */
    int64_t left, floats;
    float *records;
    bool is_refused;
} filling;

static void fill(filling *f, const kernel_frame *frame, kernel_thread *thread_of, int threads)
{
    const kernel_table *kernels = render_kernels();
#pragma omp parallel num_threads(threads)
    {
        const int me = omp_get_thread_num();
        kernel_keeper *keeper = &f->keepers[me];
#pragma omp for schedule(dynamic, 1)
        for (int64_t i = 0; i < f->subtrees.count; i++)
            if (!keeper->is_refused)
                kernels->keep_crossed(frame, &thread_of[me], &f->subtrees.items[i], keeper, grow);
        const int64_t own = end_keeper(keeper);
        int64_t first;
#pragma omp atomic capture
        {
            first = f->floats;
            f->floats += own;
        }
#pragma omp critical
        f->is_refused = f->is_refused || keeper->is_refused;
#pragma omp barrier
#pragma omp single
        if (!f->is_refused) f->records = base_alloc((size_t)f->floats * sizeof *f->records);
        move_chunks(keeper, f->records ? f->records + first : NULL);
    }
}

static bool is_usual(const kernel_frame *frame, const kernel_surface *surface)
{
    const double scale = frame->job->space.scale;
    bool is_so = scale > 1e-20 && scale < 1e20;
    for (int a = 0; a < 3; a++) is_so = is_so && fabs(frame->job->camera.eye[a]) * scale < (double)KERNEL_KEPT_PLACE;
    for (int i = 0; i < surface->layer->value_count; i++)
        is_so = is_so && fabs(surface->layer->values[i]) < (double)KERNEL_KEPT_VALUE;
    return is_so;
}

/* Is all that the tiles ask of the layer's cells in records? (kernel_tile_shown.h) */
static bool can_keep(const kernel_frame *frame, int surface, int part)
{
    const kernel_surface *s = &frame->surfaces[surface];
    const grid *cells = frame->job->parts[part].cells;
    if (surface >= frame->opaque_count || s->layer->colour_map || s->layer->normal == RENDER_DIFFERENCES) return false;
    if (!s->layer->field.ranges[part].low || !frame->job->parts[part].tree->node_count) return false;
    return cells->cell_type == GRID_TET || (cells->cell_type == GRID_HEX && s->layer->root == RENDER_ROBUST);
}

static kernel_kept keep(const render_kept *kept, const kernel_frame *frame, int surface, int part,
                        kernel_thread *thread_of, int threads)
{
    filling f = {.left = MOST_FLOATS - kept->floats, .keepers = base_calloc((size_t)threads, sizeof *f.keepers)};
    kernel_kept out = {0};
    if (f.keepers && render_subtrees_begin(&f.subtrees, 1)) {
        for (int t = 0; t < threads; t++) f.keepers[t].left = &f.left;
        render_subtrees_add(&f.subtrees, frame, surface, part);
        fill(&f, frame, thread_of, threads);
    }
    if (f.records) {
        out.vertices = frame->job->parts[part].cells->cell_type == GRID_HEX ? 8 : 4;
        out.records = f.records;
        out.count = f.floats / (out.vertices * KERNEL_KEPT_FLOATS);
    }
    base_free(f.keepers);
    base_free(f.subtrees.items);
    return out;
}

/* ---- what there is -------------------------------------------------------------------------------------------- */

static bool is_of(const kept_cells *k, const grid *cells, const grid_field *field, const render_surface_layer *layer)
{
    return k->cells == cells && k->field.values.data == field->values.data &&
           k->field.values.stride == field->values.stride && k->field.component == field->component &&
           k->field.component_stride == field->component_stride && k->value_count == layer->value_count &&
           !memcmp(k->values, layer->values, (size_t)layer->value_count * sizeof *layer->values);
}

/* A place for the layer's cells on the part; NULL where there is no memory. */
static kept_cells *place(render_kept *kept, const grid *cells, const grid_field *field,
                         const render_surface_layer *layer)
{
    kept_cells *items = base_realloc(kept->items, (size_t)(kept->count + 1) * sizeof *items);
    if (!items) return NULL;
    kept->items = items;
    items[kept->count] = (kept_cells){.cells = cells, .field = *field, .value_count = layer->value_count};
    memcpy(items[kept->count].values, layer->values, (size_t)layer->value_count * sizeof *layer->values);
    return &items[kept->count++];
}

static kernel_kept find(render_kept *kept, const kernel_frame *frame, int surface, int part, kernel_thread *thread_of,
                        int threads)
{
    const render_surface_layer *layer = frame->surfaces[surface].layer;
    const grid *cells = frame->job->parts[part].cells;
    const grid_field *field = &layer->field.fields[part];
    for (int i = 0; i < kept->count; i++)
        if (is_of(&kept->items[i], cells, field, layer)) return kept->items[i].kept;
    kept_cells *item = place(kept, cells, field, layer);
    if (!item) return (kernel_kept){0};
    item->kept = keep(kept, frame, surface, part, thread_of, threads);
    kept->floats += item->kept.count * item->kept.vertices * KERNEL_KEPT_FLOATS;
    return item->kept;
}

void render_kept_begin(kernel_frame *frame, kernel_thread *thread_of, int threads)
{
    const render_job *job = frame->job;
    if (!job->kept) return;
    kernel_kept *kept = base_calloc((size_t)(frame->surface_count * job->part_count), sizeof *kept);
    for (int surface = 0; kept && surface < frame->surface_count; surface++)
        for (int part = 0; part < job->part_count; part++)
            if (is_usual(frame, &frame->surfaces[surface]) && can_keep(frame, surface, part))
                kept[surface * job->part_count + part] = find(job->kept, frame, surface, part, thread_of, threads);
    frame->kept = kept;
}

void render_kept_end(kernel_frame *frame)
{
    base_free((void *)frame->kept);
    frame->kept = NULL;
}
