/* CHUNK_HITS: number of hits that a thread processes at once, so that cells fetched for one hit are cached for its
 * neighbours. SORTED_HITS: number of hits that are sorted at once. */
#include "render_differences.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "kernel_types.h"
#include "memory.h"
#include "mmbvh.h"
#include "region.h"
#include "render_hits.h"
#include "render_kernels.h"
#include "render_prepare.h"

enum { CHUNK_HITS = 512, SORTED_HITS = 8192 };

bool render_has_differences(const render_job *job)
{
    for (int i = 0; i < job->surface_count; i++)
        if (job->surfaces[i].normal == RENDER_DIFFERENCES) return job->paint != RENDER_VALUES;
    return false;
}

void render_differences_ranges(const render_job *job, double ranges[RENDER_MAX_ISOVALUES][2])
{
    for (int i = 0; i < job->surface_count; i++) render_surface_range(job, i, ranges[i]);
}

/* ---- selection of ranks ----------------------------------------------------------------------------------------- */

static bool is_by_differences(const render_surface_layer *layer)
{
    return layer->normal == RENDER_DIFFERENCES;
}

render_box render_differences_box(const render_job *job)
{
    return hit_box(job, is_by_differences);
}

/* Margin by which boxes are extended, in scaled units, in which the size of a scene is about 1. It is larger than the
 * errors of points and of float32 boxes. */
static const double box_margin = 1e-5;

/* The six sample points are the ends of three segments, one along each axis, that are centred at the hit and 2 * reach
 * long. The function tests whether one of the segments meets the box. */
bool render_differences_meet(const render_job *job, const render_pending_hit *hit, const render_box *box)
{
    const uint32_t width = (uint32_t)job->camera.width;
    const double z = (double)hit->t / job->space.scale + job->space.depth_origin;
    const double reach = (double)hit->reach / job->space.scale, margin = box_margin / job->space.scale;
    double base[3], direction[3];
    /* beside: number of axes along which the hit is outside the box; beyond: number of axes along which all sample
     * points are. */
    int beside = 0, beyond = 0;
    render_camera_ray(&job->camera, (int)(hit->pixel % width), (int)(hit->pixel / width), base, direction);
    for (int a = 0; a < 3; a++) {
        const double at = base[a] + z * direction[a];
        const double out = fmax(box->lower[a] - margin - at, at - box->upper[a] - margin);
        beside += !(out <= 0);
        beyond += !(out <= reach);
    }
    return beside <= 1 && beyond == 0;
}

/* ---- order ----------------------------------------------------------------------------------------------------- */

typedef struct hit_location {
    uint64_t tile;         /* 256 times the number of the tile, plus the number of the block in the tile */
    uint32_t kind, within; /* kind of the hit, and number of its pixel in the block */
    int64_t index;         /* index of the hit among those that are sorted together */
} hit_location;

static int compare_locations(const void *a, const void *b)
{
    const hit_location *x = a, *y = b;
    if (x->tile != y->tile) return x->tile < y->tile ? -1 : 1;
    if (x->kind != y->kind) return x->kind < y->kind ? -1 : 1;
    if (x->within != y->within) return x->within < y->within ? -1 : 1;
    return (x->index > y->index) - (x->index < y->index);
}

static hit_location place_of(const render_camera *camera, const render_pending_hit *hit, int64_t index)
{
    const uint32_t x = hit->pixel % (uint32_t)camera->width, y = hit->pixel / (uint32_t)camera->width;
    const uint64_t tile = (uint64_t)(y / KERNEL_TILE) << 16 | x / KERNEL_TILE;
    const uint32_t block = y % KERNEL_TILE / KERNEL_BLOCK * KERNEL_BLOCK + x % KERNEL_TILE / KERNEL_BLOCK;
    return (hit_location){tile << 8 | block, hit->kind, y % KERNEL_BLOCK * KERNEL_BLOCK + x % KERNEL_BLOCK, index};
}

static void sort_hits(const render_camera *camera, render_pending_list *list, int64_t first, int64_t count,
                      hit_location *places, render_pending_list *scratch)
{
    for (int64_t i = 0; i < count; i++) places[i] = place_of(camera, &list->items[first + i], i);
    memcpy(scratch->items, list->items + first, (size_t)count * sizeof *scratch->items);
    memcpy(scratch->shadings, list->shadings + first, (size_t)count * sizeof *scratch->shadings);
    qsort(places, (size_t)count, sizeof *places, compare_locations);
    for (int64_t i = 0; i < count; i++) {
        list->items[first + i] = scratch->items[places[i].index];
        memcpy(list->shadings[first + i], scratch->shadings[places[i].index], sizeof *list->shadings);
    }
}

bool render_differences_sort(const render_job *job, render_pending_list *list)
{
    const int64_t most = list->count < SORTED_HITS ? list->count : SORTED_HITS;
    hit_location *places = base_alloc((size_t)(most + 1) * sizeof *places);
    render_pending_list scratch = {.items = base_alloc((size_t)(most + 1) * sizeof *scratch.items),
                                   .shadings = base_alloc((size_t)(most + 1) * sizeof *scratch.shadings)};
    const bool has_memory = places && scratch.items && scratch.shadings;
    for (int64_t first = 0; first < list->count && has_memory; first += most) {
        const int64_t left = list->count - first;
        sort_hits(&job->camera, list, first, left < most ? left : most, places, &scratch);
    }
    base_free(places);
    base_free(scratch.items);
    base_free(scratch.shadings);
    return has_memory;
}

/* ---- samples and light ----------------------------------------------------------------------------------------- */

/* The work of all threads: sampling around hits, or lighting them, chunk by chunk. */
typedef struct chunk_work {
    kernel_frame frame;
    const kernel_table *kernels;
    int threads;
    const render_pending_hit *hits;          /* hits around which samples are taken */
    render_difference_samples *samples;      /* the samples that are taken */
    const render_pending_list *list;         /* hits to be lit; NULL if samples are to be taken */
    const render_difference_samples *merged; /* samples of all ranks around the hits in `list` */
    fragment *out;
} chunk_work;

static void process_chunk(chunk_work *work, kernel_thread *thread, int64_t first, int64_t count)
{
    if (work->list)
        work->kernels->light_pending(&work->frame, thread, work->list, work->merged, first, count, work->out);
    else
        work->kernels->sample_pending(&work->frame, thread, work->hits + first, work->samples + first, count);
}

static insitu_status process_chunks(const render_job *job, chunk_work *work, int64_t first, int64_t count,
                                    base_error *error)
{
    work->kernels = render_kernels();
    work->threads = job->threads > 0 ? job->threads : omp_get_max_threads();
    render_job surfaces = *job;
    bool has_memory = true;
    surfaces.volume_count = 0;
    surfaces.separate_samples = surfaces.reproducible = false;
    insitu_status status = render_prepare(&surfaces, &work->frame, error);
    if (status != INSITU_OK) return status;
#pragma omp parallel num_threads(work->threads) reduction(&& : has_memory)
    {
        region_enter();
        kernel_thread thread = {0};
        has_memory = render_thread_begin(work->kernels, &thread);
#pragma omp for schedule(dynamic, 1) nowait
        for (int64_t at = first; at < first + count; at += CHUNK_HITS) {
            const int64_t left = first + count - at;
            if (thread.memory) process_chunk(work, &thread, at, left < CHUNK_HITS ? left : CHUNK_HITS);
        }
        base_free(thread.memory);
        region_leave();
    }
    render_unprepare(&work->frame);
    if (!has_memory)
        status = base_fail(error, INSITU_ERROR_MEMORY, "no memory for normals of %lld hits", (long long)count);
    return status;
}

insitu_status render_sample_pending_hits(const render_job *job, const render_pending_hit *hits,
                                         render_difference_samples *out, int64_t count, base_error *error)
{
    chunk_work work = {.hits = hits, .samples = out};
    if (count && !job->part_count) memset(out, 0, (size_t)count * sizeof *out);
    if (!count || !job->part_count) return INSITU_OK;
    return process_chunks(job, &work, 0, count, error);
}

void render_differences_merge(render_difference_samples *into, const render_difference_samples *other)
{
    for (int k = 0; k < RENDER_DIFFERENCE_SAMPLES; k++) {
        const uint32_t bit = 1u << k;
        if (!(other->found & bit) || (into->found & bit && into->values[k] <= other->values[k])) continue;
        into->values[k] = other->values[k];
        into->found |= bit;
    }
}

insitu_status render_light_pending_hits(const render_job *job, const render_pending_list *list,
                                        const render_difference_samples *samples, int64_t first, int64_t count,
                                        fragment *out, base_error *error)
{
    /* the pointers are advanced to hit `first`, so that index 0 belongs to the same hit in the list, in `samples` and
     * in `out` */
    const render_pending_list some = {list->items + first, list->shadings + first, count, count};
    chunk_work work = {.list = &some, .merged = samples, .out = out};
    return count ? process_chunks(job, &work, 0, count, error) : INSITU_OK;
}
