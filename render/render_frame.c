/* Draws a frame: tiles are distributed among threads. Tiles are small (16 × 16 pixels), and a thread gets only a few of
 * them at a time, because tiles in the middle of a picture cost far more than tiles at its border. */
#include <math.h>
#include <omp.h>
#include <string.h>
#include <time.h>

#include "error.h"
#include "fragment.h"
#include "insitu/status.h"
#include "kernel_types.h"
#include "memory.h"
#include "pixel_set.h"
#include "region.h"
#include "render.h"
#include "render_candidates.h"
#include "render_fold.h"
#include "render_kernels.h"
#include "render_polyhedra.h"
#include "render_prepare.h"
#include "render_thread.h"

double render_read_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static pixel_area area_of_tile(const render_camera *camera, int column, int row)
{
    const int x = column * KERNEL_TILE, y = row * KERNEL_TILE;
    return (pixel_area){x, y, camera->width - x < KERNEL_TILE ? camera->width - x : KERNEL_TILE,
                        camera->height - y < KERNEL_TILE ? camera->height - y : KERNEL_TILE};
}

static void trace_tiles(const kernel_table *kernels, const kernel_frame *frame, kernel_thread *thread,
                        fragment_callback *take, void *state)
{
    const render_camera *camera = &frame->job->camera;
    const int columns = (camera->width + KERNEL_TILE - 1) / KERNEL_TILE;
    const int rows = (camera->height + KERNEL_TILE - 1) / KERNEL_TILE;
    const int number = omp_get_thread_num();
    fragment_list *own = &thread->out;
    const bool folds = frame->job->reproducible && frame->job->volume_count && !frame->job->separate_samples;
    render_folding fold = {.job = frame->job, .has_segments = frame->has_segments};
#pragma omp for schedule(dynamic, KERNEL_TILES_PER_TASK) nowait
    for (int tile = 0; tile < columns * rows; tile++) {
        if (!render_thread_begin(frame, kernels, thread)) continue;
        if (thread->polyhedra) polyhedra_reset(thread->polyhedra);
        const pixel_area area = area_of_tile(camera, tile % columns, tile / columns);
        thread->out_of_memory = thread->out_of_memory || !render_candidates_gather(frame, thread, area.x, area.y);
        kernels->trace_tile(frame, thread, area.x, area.y);
        if (folds) thread->out_of_memory = thread->out_of_memory || !render_fold(&fold, &area, own);
        if (thread->out_of_memory) continue;
        thread->out_of_memory = !take(state, number, &area, own->items, own->count);
        own->count = 0;
    }
    render_folding_free(&fold);
}

/* ---- lists of hits that need samples of other ranks ------------------------------------------------------------ */

static bool grow_list(render_pending_list *list, int64_t capacity)
{
    render_pending_hit *items = base_realloc(list->items, (size_t)capacity * sizeof *items);
    if (items) list->items = items;
    float(*shadings)[2][3] = base_realloc(list->shadings, (size_t)capacity * sizeof *shadings);
    if (shadings) list->shadings = shadings;
    if (!items || !shadings) return false;
    list->capacity = capacity;
    return true;
}

bool render_grow_pending(render_pending_list *list)
{
    return grow_list(list, list->capacity + list->capacity / 2 + 1024);
}

static bool append_pending(render_pending_list *to, const render_pending_list *from)
{
    const int64_t count = to->count + from->count;
    if (!from->count) return true;
    if (count > to->capacity && !grow_list(to, count)) return false;
    memcpy(to->items + to->count, from->items, (size_t)from->count * sizeof *to->items);
    memcpy(to->shadings + to->count, from->shadings, (size_t)from->count * sizeof *to->shadings);
    to->count = count;
    return true;
}

/* Removes the placeholder fragments of pending hits (RENDER_PENDING_TRANSMITTANCE) from the list, from index `first`
 * on. */
static void drop_placeholders(fragment_list *list, int64_t first)
{
    fragment *to = list->items + first;
    for (int64_t i = first; i < list->count; i++)
        if (list->items[i].kind < FRAGMENT_SURFACE || list->items[i].transmittance != RENDER_PENDING_TRANSMITTANCE)
            *to++ = list->items[i];
    list->count = to - list->items;
}

/* ---- tracing with several threads ------------------------------------------------------------------------------ */

bool render_reserve_fragments(fragment_list *list, int64_t more)
{
    const int64_t needed = list->count + more, grown = list->capacity + list->capacity / 2 + 1024;
    if (needed <= list->capacity) return true;
    const int64_t capacity = grown > needed ? grown : needed;
    fragment *items = base_realloc(list->items, (size_t)capacity * sizeof *items);
    if (!items) return false;
    list->items = items;
    list->capacity = capacity;
    return true;
}

static bool free_threads_and_sum_statistics(const render_job *job, kernel_thread *states, int threads,
                                            render_statistics *statistics)
{
    bool has_memory = true;
    double surface = 0, volume = 0;
    for (int i = 0; i < threads; i++) {
        has_memory = has_memory && !states[i].out_of_memory;
        if (has_memory && job->waiting) has_memory = append_pending(job->waiting, &states[i].waiting);
        render_thread_end(&states[i]);
        surface = fmax(surface, states[i].surface_seconds);
        volume = fmax(volume, states[i].volume_seconds);
        statistics->map_failures += states[i].map_failures;
        statistics->volume_cells += states[i].volume_cells;
    }
    statistics->surface_ms += 1e3 * surface;
    statistics->volume_ms += 1e3 * volume;
    return has_memory;
}

static bool trace_frame(kernel_frame *frame, fragment_callback *take, void *state, int threads,
                        render_statistics *statistics)
{
    const render_job *job = frame->job;
    const kernel_table *kernels = render_kernels();
    const int64_t pixels = (int64_t)job->camera.width * job->camera.height;
    kernel_thread *states = base_calloc((size_t)threads, sizeof *states);
    if (!states) return false;
    *statistics = (render_statistics){.rays = job->pixels ? pixel_set_count(job->pixels, pixels) : pixels};
    if (frame->is_binned && !render_surfaces_are_small(frame)) {
        const double start = render_read_clock();
        render_candidates_find(frame, states, threads);
        statistics->surface_ms = 1e3 * (render_read_clock() - start);
    }
    if (frame->bins_volume) {
        const double start = render_read_clock();
        render_candidates_find_volume(frame, states, threads);
        statistics->volume_ms = 1e3 * (render_read_clock() - start);
    }
    frame->needs_planes = (job->surface_count && !frame->candidates) || job->volume_count;
    if (frame->needs_planes) render_compute_tree_cover(frame);
#pragma omp parallel num_threads(threads)
    {
        region_enter();
        trace_tiles(kernels, frame, &states[omp_get_thread_num()], take, state);
        region_leave();
    }
    render_candidates_free(frame);
    const bool has_memory = free_threads_and_sum_statistics(job, states, threads, statistics);
    base_free(states);
    return has_memory;
}

/* ---- fragments of all tiles in one list ---------------------------------------------------------------------- */

static bool append_fragments(fragment_list *to, const fragment *items, int64_t count)
{
    if (!count) return true;
    if (!render_reserve_fragments(to, count)) return false;
    memcpy(to->items + to->count, items, (size_t)count * sizeof *items);
    to->count += count;
    return true;
}

/* Appends a tile's fragments to lists[0], which all threads share. The order of the tiles in it differs from run to
 * run. Once that list has no space for a tile, the fragments of that tile and of all later ones are stored in the list
 * of the thread that traced them, lists[1 + thread]. lists[0].count is the total number of fragments of all tiles in
 * all lists. */
static bool append_tile(void *lists, int thread, const pixel_area *area, fragment *items, int64_t count)
{
    fragment_list *shared = lists, *own = shared + 1 + thread;
    int64_t end;
    (void)area;
#pragma omp atomic capture
    end = shared->count += count;
    if (end > shared->capacity) return append_fragments(own, items, count);
    if (count) memcpy(shared->items + end - count, items, (size_t)count * sizeof *items);
    return true;
}

/* Traces a frame and appends its fragments to `out`. Space is reserved at once for half as many fragments as there are
 * pixels; memory that is reserved but never written costs nothing. If only a set of pixels is traced, no memory is
 * reserved. */
static bool trace_to_list(kernel_frame *frame, int threads, fragment_list *out, render_statistics *statistics)
{
    const render_job *job = frame->job;
    const int64_t first = out->count, expected = job->pixels ? 0 : (int64_t)job->camera.width * job->camera.height / 2;
    fragment_list *lists = base_calloc((size_t)threads + 1, sizeof *lists);
    bool is_well = lists && render_reserve_fragments(out, expected);
    if (is_well) {
        lists[0] = *out;
        is_well = trace_frame(frame, append_tile, lists, threads, statistics);
        *out = lists[0];
    }
    for (int i = 1; lists && i <= threads; i++) out->count -= lists[i].count;
    for (int i = 1; lists && i <= threads; i++) {
        is_well = is_well && append_fragments(out, lists[i].items, lists[i].count);
        base_free(lists[i].items);
    }
    base_free(lists);
    if (is_well && job->waiting) drop_placeholders(out, first);
    return is_well;
}

/* Draws a frame. If out is not NULL, the fragments are appended to it; otherwise they are passed to take() tile by
 * tile. */
static insitu_status draw(const render_job *job, fragment_list *out, fragment_callback *take, void *state,
                          render_statistics *statistics, base_error *error)
{
    kernel_frame frame;
    render_statistics unwanted;
    insitu_status status = render_prepare(job, &frame, error);
    if (status != INSITU_OK) return status;
    if (!statistics) statistics = &unwanted;
    const int threads = job->threads > 0 ? job->threads : omp_get_max_threads();
    if (!(out ? trace_to_list(&frame, threads, out, statistics)
              : trace_frame(&frame, take, state, threads, statistics)))
        status = base_fail(error, INSITU_ERROR_MEMORY, "no memory for the fragments and cells of %d x %d pixels",
                           job->camera.width, job->camera.height);
    render_free_prepared_frame(&frame);
    return status;
}

insitu_status render_frame(const render_job *job, fragment_list *out, render_statistics *statistics, base_error *error)
{
    const int64_t first = out->count;
    const insitu_status status = draw(job, out, NULL, NULL, statistics, error);
    if (status != INSITU_OK) out->count = first;
    return status;
}

insitu_status render_frame_tiles(const render_job *job, fragment_callback *take, void *state,
                                 render_statistics *statistics, base_error *error)
{
    return draw(job, NULL, take, state, statistics, error);
}
