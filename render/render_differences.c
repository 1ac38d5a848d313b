/* Finds the ranks whose samples a hit needs, samples the field around hits, and lights hits. CHUNK_HITS is the number
 * of hits that a thread processes at once, so that cells fetched for one hit are cached for its neighbours. SORTED_HITS
 * is the number of hits that are sorted at once. */
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
#include "render_thread.h"

enum { CHUNK_HITS = 512, SORTED_HITS = 8192 };

bool render_has_differences(const render_job *job)
{
    for (int i = 0; i < job->surface_count; i++)
        if (job->surfaces[i].normal == RENDER_DIFFERENCES) return job->paint != RENDER_VALUES;
    return false;
}

void render_compute_field_ranges(const render_job *job, double ranges[RENDER_MAX_ISOVALUES][2])
{
    for (int i = 0; i < job->surface_count; i++) render_surface_range(job, i, ranges[i]);
}

/* ---- which ranks' cells a hit's normal needs -------------------------------------------------------------------- */

static bool is_by_differences(const render_surface_layer *layer)
{
    return layer->normal == RENDER_DIFFERENCES;
}

render_box render_differences_box(const render_job *job)
{
    return hit_box(job, is_by_differences);
}

/* Margin by which boxes are extended, in scaled units, in which the size of a scene is about 1. It is larger than the
 * rounding errors of sample points and of float32 boxes. */
static const double box_margin = 1e-5;

/* The six sample points are the ends of three line segments, one along each axis, that are centred at the hit and 2 *
 * reach long. The function tests whether one of these line segments meets the box. */
bool render_difference_points_meet_box(const render_job *job, const render_pending_hit *hit, const render_box *box)
{
    const uint32_t width = (uint32_t)job->camera.width;
    const double z = (double)hit->t / job->space.scale + job->space.depth_origin;
    const double reach = (double)hit->reach / job->space.scale, margin = box_margin / job->space.scale;
    double base[3], direction[3];
    /* beside: number of axes along which the hit is outside the box; beyond: number of axes along which all six sample
     * points are outside the box */
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

/* ---- sorting hits by tile and block ---------------------------------------------------------------------------- */

/* Returns a number by which hits are sorted: by tile, block, isovalue and pixel in the block. Its last bits are the
 * index of the hit among those that are sorted together. */
static uint64_t sort_key(const render_camera *camera, const render_pending_hit *hit, uint64_t index)
{
    const uint32_t x = hit->pixel % (uint32_t)camera->width, y = hit->pixel / (uint32_t)camera->width;
    const uint64_t tile = (uint64_t)(y / KERNEL_TILE) << 16 | x / KERNEL_TILE;
    const uint32_t block = y % KERNEL_TILE / KERNEL_BLOCK * KERNEL_BLOCK + x % KERNEL_TILE / KERNEL_BLOCK;
    const uint32_t within = y % KERNEL_BLOCK * KERNEL_BLOCK + x % KERNEL_BLOCK;
    const uint64_t block_value = (tile * 16 + block) * RENDER_MAX_ISOVALUES + (hit->kind - FRAGMENT_SURFACE);
    return (block_value * 16 + within) * SORTED_HITS + index;
}

static int compare_keys(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

static void sort_hits(const render_camera *camera, render_pending_list *list, int64_t first, int64_t count,
                      uint64_t *keys, render_pending_list *scratch)
{
    for (int64_t i = 0; i < count; i++) keys[i] = sort_key(camera, &list->items[first + i], (uint64_t)i);
    memcpy(scratch->items, list->items + first, (size_t)count * sizeof *scratch->items);
    memcpy(scratch->shadings, list->shadings + first, (size_t)count * sizeof *scratch->shadings);
    qsort(keys, (size_t)count, sizeof *keys, compare_keys);
    for (int64_t i = 0; i < count; i++) {
        const uint64_t from = keys[i] % SORTED_HITS;
        list->items[first + i] = scratch->items[from];
        memcpy(list->shadings[first + i], scratch->shadings[from], sizeof *list->shadings);
    }
}

bool render_differences_sort(const render_job *job, render_pending_list *list)
{
    const int64_t most = list->count < SORTED_HITS ? list->count : SORTED_HITS;
    uint64_t *keys = base_alloc((size_t)(most + 1) * sizeof *keys);
    render_pending_list scratch = {.items = base_alloc((size_t)(most + 1) * sizeof *scratch.items),
                                   .shadings = base_alloc((size_t)(most + 1) * sizeof *scratch.shadings)};
    const bool has_memory = keys && scratch.items && scratch.shadings;
    for (int64_t first = 0; first < list->count && has_memory; first += most) {
        const int64_t left = list->count - first;
        sort_hits(&job->camera, list, first, left < most ? left : most, keys, &scratch);
    }
    base_free(keys);
    base_free(scratch.items);
    base_free(scratch.shadings);
    return has_memory;
}

/* ---- sampling the field around hits, and lighting hits --------------------------------------------------------- */

/* Processes `count` pending hits in parallel, CHUNK_HITS at a time. If `out` is NULL, the field is sampled around the
 * hits and stored in `samples`. Otherwise the hits are lit: samples and shadings are read, and the fragments are stored
 * in `out`. */
static insitu_status sample_or_light_pending_hits(const render_job *job, const render_pending_hit *hits,
                                                  float (*shadings)[2][3], render_difference_samples *samples,
                                                  fragment *out, int64_t count, base_error *error)
{
    const kernel_table *kernels = render_kernels();
    kernel_frame frame;
    render_job surfaces;
    bool has_memory = true;
    insitu_status status = render_prepare_surfaces(job, &surfaces, &frame, error);
    if (status != INSITU_OK) return status;
#pragma omp parallel num_threads(job->threads > 0 ? job->threads : omp_get_max_threads()) reduction(&& : has_memory)
    {
        region_enter();
        kernel_thread thread = {0};
        has_memory = render_thread_begin(&frame, kernels, &thread);
#pragma omp for schedule(dynamic, 1) nowait
        for (int64_t at = 0; at < count; at += CHUNK_HITS) {
            const int64_t chunk = count - at < CHUNK_HITS ? count - at : CHUNK_HITS;
            if (has_memory && out)
                kernels->light_pending(&frame, &thread, hits + at, shadings + at, samples + at, out + at, chunk);
            else if (has_memory)
                kernels->sample_pending(&frame, &thread, hits + at, samples + at, chunk);
        }
        render_thread_end(&thread);
        region_leave();
    }
    render_free_prepared_frame(&frame);
    if (!has_memory)
        status = base_fail(error, INSITU_ERROR_MEMORY, "no memory for normals of %lld hits", (long long)count);
    return status;
}

insitu_status render_sample_pending_hits(const render_job *job, const render_pending_hit *hits,
                                         render_difference_samples *out, int64_t count, base_error *error)
{
    if (count && !job->part_count) memset(out, 0, (size_t)count * sizeof *out);
    if (!count || !job->part_count) return INSITU_OK;
    return sample_or_light_pending_hits(job, hits, NULL, out, NULL, count, error);
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
                                        render_difference_samples *samples, int64_t first, int64_t count, fragment *out,
                                        base_error *error)
{
    if (!count) return INSITU_OK;
    return sample_or_light_pending_hits(job, list->items + first, list->shadings + first, samples, out, count, error);
}
