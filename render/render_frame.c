/* One frame: tiles dealt to threads. They are small (16 × 16 pixels) and handed out a few at a time, because a
 * picture's middle costs far more than its border. */
#include <omp.h>
#include <string.h>
#include <time.h>

#include "memory.h"
#include "render_fragments.h"
#include "render_isa.h"
#include "render_polyhedra.h"
#include "render_prepare.h"
#include "render_shown.h"

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* What most tiles make at most: beyond that they leave their piece. */
enum { TILE_FRAGMENTS = KERNEL_TILE * KERNEL_TILE };

static void trace_tiles(const kernel_frame *frame, kernel_thread *thread, fragment_writer *writer)
{
    const kernel_table *kernels = render_kernels();
    const int columns = (frame->job->camera.width + KERNEL_TILE - 1) / KERNEL_TILE;
    const int rows = (frame->job->camera.height + KERNEL_TILE - 1) / KERNEL_TILE;
#pragma omp for schedule(dynamic, 4)
    for (int tile = 0; tile < columns * rows; tile++) {
        if (thread->out_of_memory) continue;
        if (thread->polyhedra) polyhedra_reset(thread->polyhedra);
        fragment_writer_advance(writer, TILE_FRAGMENTS);
        kernels->trace_tile(frame, thread, tile % columns * KERNEL_TILE, tile / columns * KERNEL_TILE);
    }
}

/* Threads' states; false where memory ran out. */
static bool begin_threads(const kernel_frame *frame, fragment_writer *writers, kernel_thread *states, int threads)
{
    const size_t cache_bytes = render_kernels()->cache_bytes;
    bool has_polyhedra = false, has_memory = true;
    for (int i = 0; i < frame->job->part_count; i++)
        has_polyhedra = has_polyhedra || grid_has_faces(frame->job->parts[i].cells);
#pragma omp parallel num_threads(threads) reduction(&& : has_memory)
    {
        /* By the thread that will use it: first touch. */
        const int me = omp_get_thread_num();
        states[me] = (kernel_thread){.cache = base_calloc(1, cache_bytes),
                                     .out = &writers[me].list,
                                     .reserve = fragment_reserve,
                                     .polyhedra = has_polyhedra ? polyhedra_create() : NULL,
                                     .find_polyhedron = polyhedra_find,
                                     .polyhedron_scratch = polyhedra_scratch,
                                     .now = now};
        has_memory = states[me].cache && (!has_polyhedra || states[me].polyhedra);
    }
    return has_memory;
}

static bool end_threads(kernel_thread *states, int threads, render_statistics *statistics)
{
    bool has_memory = true;
    double surface = 0, volume = 0;
    for (int i = 0; i < threads; i++) {
        polyhedra_free(states[i].polyhedra);
        base_free(states[i].cache);
        has_memory = has_memory && !states[i].out_of_memory;
        surface = fmax(surface, states[i].surface_seconds);
        volume = fmax(volume, states[i].volume_seconds);
        statistics->map_failures += states[i].map_failures;
    }
    statistics->surface_ms += 1e3 * surface;
    statistics->volume_ms += 1e3 * volume;
    return has_memory;
}

static bool trace_frame(kernel_frame *frame, fragment_writer *writers, int threads, render_statistics *statistics)
{
    const render_job *job = frame->job;
    const int64_t pixels = (int64_t)job->camera.width * job->camera.height;
    kernel_thread *states = base_calloc((size_t)threads, sizeof *states);
    if (!states) return false;
    bool has_memory = begin_threads(frame, writers, states, threads);
    *statistics = (render_statistics){.rays = job->pixels ? pixel_set_count(job->pixels, pixels) : pixels};
    if (has_memory && frame->is_binned) {
        const double start = now();
        render_shown_find(frame, states, threads);
        statistics->surface_ms = 1e3 * (now() - start);
    }
    if (has_memory) {
#pragma omp parallel num_threads(threads)
        trace_tiles(frame, &states[omp_get_thread_num()], &writers[omp_get_thread_num()]);
    }
    render_shown_free(frame);
    has_memory = end_threads(states, threads, statistics) && has_memory;
    base_free(states);
    return has_memory;
}

/* One at every other pixel, where most of them are traced: memory that is not written to is none. */
static int64_t expected_fragments(const render_job *job)
{
    return job->pixels ? 0 : (int64_t)job->camera.width * job->camera.height / 2;
}

insitu_status render_frame(const render_job *job, fragment_list *out, render_statistics *statistics, base_error *error)
{
    kernel_frame frame;
    render_statistics unwanted;
    insitu_status status = render_prepare(job, &frame, error);
    if (status != INSITU_OK) return status;
    const int threads = job->threads > 0 ? job->threads : omp_get_max_threads();
    const int64_t first = out->count;
    fragment_pieces pieces;
    fragment_writer *writers = base_calloc((size_t)threads, sizeof *writers);
    bool has_memory = writers && fragment_pieces_begin(&pieces, out, expected_fragments(job));
    if (has_memory) {
        for (int i = 0; i < threads; i++) writers[i] = (fragment_writer){.pieces = &pieces, .piece = -1};
        has_memory = trace_frame(&frame, writers, threads, statistics ? statistics : &unwanted);
        has_memory = fragment_pieces_end(&pieces, writers, threads) && has_memory;
    }
    base_free(writers);
    if (!has_memory) {
        out->count = first;
        status = base_fail(error, INSITU_ERROR_MEMORY, "no memory for the fragments and cells of %d x %d pixels",
                           job->camera.width, job->camera.height);
    }
    render_unprepare(&frame);
    return status;
}
