/* One frame: tiles dealt to threads, each with a list of its own, the lists joined at the end. Tiles are small (8 × 8
 * pixels) and handed out a few at a time, because a picture's middle costs far more than its border. */
#include <omp.h>
#include <string.h>
#include <time.h>

#include "memory.h"
#include "render_isa.h"
#include "render_polyhedra.h"
#include "render_prepare.h"

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static bool reserve(fragment_list *list, int64_t more)
{
    const int64_t needed = list->count + more;
    if (needed <= list->capacity) return true;
    const int64_t grown = list->capacity + list->capacity / 2 + 1024;
    const int64_t capacity = grown > needed ? grown : needed;
    fragment *items = base_realloc(list->items, (size_t)capacity * sizeof *items);
    if (!items) return false;
    list->items = items;
    list->capacity = capacity;
    return true;
}

static void trace_tiles(const kernel_frame *frame, kernel_thread *thread)
{
    const kernel_table *kernels = render_kernels();
    const int columns = (frame->job->camera.width + KERNEL_TILE - 1) / KERNEL_TILE;
    const int rows = (frame->job->camera.height + KERNEL_TILE - 1) / KERNEL_TILE;
#pragma omp for schedule(dynamic, 4)
    for (int tile = 0; tile < columns * rows; tile++) {
        if (thread->out_of_memory) continue;
        if (thread->polyhedra) polyhedra_reset(thread->polyhedra);
        kernels->trace_tile(frame, thread, tile % columns * KERNEL_TILE, tile / columns * KERNEL_TILE);
    }
}

static bool join_lists(fragment_list *out, fragment_list *lists, int count)
{
    int64_t total = 0;
    for (int i = 0; i < count; i++) total += lists[i].count;
    if (out->count == 0 && count == 1) {
        base_free(out->items);
        *out = lists[0];
        memset(&lists[0], 0, sizeof lists[0]);
        return true;
    }
    if (!reserve(out, total)) return false;
    for (int i = 0; i < count; i++) {
        if (lists[i].count)
            memcpy(out->items + out->count, lists[i].items, (size_t)lists[i].count * sizeof *out->items);
        out->count += lists[i].count;
    }
    return true;
}

static insitu_status trace_frame(const kernel_frame *frame, fragment_list *lists, int threads, fragment_list *out,
                                 render_statistics *statistics, base_error *error)
{
    const size_t cache_bytes = render_kernels()->cache_bytes;
    bool has_polyhedra = false;
    for (int i = 0; i < frame->job->part_count; i++)
        has_polyhedra = has_polyhedra || grid_has_faces(frame->job->parts[i].cells);
    int failed = 0;
    int64_t failures = 0;
    double surface = 0, volume = 0;
#pragma omp parallel num_threads(threads) reduction(+ : failed, failures) reduction(max : surface, volume)
    {
        fragment_list *list = &lists[omp_get_thread_num()];
        kernel_thread thread = {.cache = base_calloc(1, cache_bytes),
                                .out = list,
                                .reserve = reserve,
                                .polyhedra = has_polyhedra ? polyhedra_create() : NULL,
                                .find_polyhedron = polyhedra_find,
                                .polyhedron_scratch = polyhedra_scratch,
                                .now = now};
        thread.out_of_memory = !thread.cache || (has_polyhedra && !thread.polyhedra);
        trace_tiles(frame, &thread);
        polyhedra_free(thread.polyhedra);
        base_free(thread.cache);
        failed += thread.out_of_memory;
        failures += thread.map_failures;
        surface = thread.surface_seconds;
        volume = thread.volume_seconds;
    }
    if (failed || !join_lists(out, lists, threads))
        return base_fail(error, INSITU_ERROR_MEMORY, "no memory for the fragments and cells of %d x %d pixels",
                         frame->job->camera.width, frame->job->camera.height);
    if (statistics) {
        const int64_t pixels = (int64_t)frame->job->camera.width * frame->job->camera.height;
        statistics->rays = frame->job->pixels ? pixel_set_count(frame->job->pixels, pixels) : pixels;
        statistics->map_failures = failures;
        statistics->surface_ms = 1e3 * surface;
        statistics->volume_ms = 1e3 * volume;
    }
    return INSITU_OK;
}

insitu_status render_frame(const render_job *job, fragment_list *out, render_statistics *statistics, base_error *error)
{
    kernel_frame frame;
    insitu_status status = render_prepare(job, &frame, error);
    if (status != INSITU_OK) return status;
    const int threads = job->threads > 0 ? job->threads : omp_get_max_threads();
    fragment_list *lists = base_calloc((size_t)threads, sizeof *lists);
    if (lists)
        status = trace_frame(&frame, lists, threads, out, statistics, error);
    else
        status = base_fail(error, INSITU_ERROR_MEMORY, "no memory for %d threads", threads);
    for (int i = 0; lists && i < threads; i++) base_free(lists[i].items);
    base_free(lists);
    render_unprepare(&frame);
    return status;
}
