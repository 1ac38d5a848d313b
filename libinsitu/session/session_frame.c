/* A frame, and the second look at its pixels where cells overlap.
 *
 * Fragments that overlap cannot be sorted into a picture, and the ranks that made them have thrown away what it would
 * take: where each sample stood. So these pixels, which compositing finds and tells all ranks, are traced once more
 * with every sample on its own (render.h), composited beside the picture, and take their place in it. In a mesh whose
 * cells overlap here and there that is a few pixels more. Two meshes that fill the same space may make a thousand
 * fragments in each of a million pixels: they are drawn in turns, so many pixels at once as all ranks together hold the
 * fragments of. Segments of several volumes are drawn so on all pixels from the first. */
#include "session_frame.h"

#include <string.h>

#include "comp_tiles.h"
#include "memory.h"
#include "session_agree.h"

typedef struct frame_target {
    MPI_Comm comm, comp_comm;
    const float *background;
    session_frame *frame;
} frame_target;

static void add_to_frame(const frame_target *t, const render_statistics *rendered, int64_t fragments,
                         double composite_ms)
{
    t->frame->rays += rendered->rays;
    t->frame->map_failures += rendered->map_failures;
    t->frame->fragments += fragments;
    t->frame->surface_ms += rendered->surface_ms;
    t->frame->volume_ms += rendered->volume_ms;
    t->frame->composite_ms += composite_ms;
}

/* One rank with something to trace: composited as it is traced (comp_tiles.h). */
static insitu_status draw_alone(const frame_target *t, const render_job *job, image *out, comp_overlaps *overlaps,
                                base_error *error)
{
    render_statistics rendered = {0};
    comp_statistics composited = {0};
    comp_tiles tiles;
    if (comp_tiles_begin(&tiles, t->background, job->threads, overlaps != NULL, out, error) == INSITU_OK) {
        render_frame_tiles(job, comp_tiles_take, &tiles, &rendered, error);
        comp_tiles_end(&tiles, overlaps, &composited);
    }
    add_to_frame(t, &rendered, composited.sent_fragments, composited.merge_ms);
    return session_agree(t->comm, error);
}

static insitu_status draw(const frame_target *t, const render_job *job, image *out, comp_overlaps *overlaps,
                          base_error *error)
{
    int ranks = 1;
    MPI_Comm_size(t->comm, &ranks);
    if (ranks == 1 && job->part_count > 0) return draw_alone(t, job, out, overlaps, error);
    fragment_list fragments = {0};
    render_statistics rendered = {0};
    comp_statistics composited = {0};
    if (job->part_count > 0) render_frame(job, &fragments, &rendered, error);
    const double start = MPI_Wtime();
    insitu_status status = session_agree(t->comm, error);
    if (status == INSITU_OK && overlaps)
        status = comp_composite_overlaps(t->comp_comm, &fragments, t->background, job->threads, out, overlaps,
                                         &composited, error);
    else if (status == INSITU_OK)
        status = comp_composite(t->comp_comm, &fragments, t->background, job->threads, out, &composited, error);
    if (status) status = session_agree_as_is(t->comm, error); /* compositing agrees on the status alone */
    base_free(fragments.items);
    add_to_frame(t, &rendered, composited.sent_fragments, 1e3 * (MPI_Wtime() - start));
    return status;
}

/* ---- overlaps ------------------------------------------------------------------------------------------------ */

/* Fragments that a ray may have: of samples, by the scene's extent, which is near 1 in scaled units, and at most
 * sqrt(3) times that; of segments by experience. */
static int64_t turn_pixels(const render_job *job, int64_t fragment_limit)
{
    enum { SEGMENTS = 500, CUT_BY_SURFACES = 5000 };
    const bool is_sampled = job->integration == RENDER_SAMPLES;
    const double ray = is_sampled           ? 2 / (job->step * job->space.scale)
                       : job->surface_count ? CUT_BY_SURFACES
                                            : SEGMENTS;
    const double pixels = (double)fragment_limit / (job->volume_count * ray + 1);
    return pixels > 1 ? (int64_t)pixels : 1;
}

/* The k-th pixel of an image in bands of rows, each taken column by column, so that the pixels of a turn are
 * neighbours, as rays of a packet are. */
static int64_t banded_pixel(const image *out, int64_t k)
{
    enum { BAND = 16 };
    const int64_t top = k / ((int64_t)BAND * out->width) * BAND, within = k - top * out->width;
    const int64_t rows = out->height - top < BAND ? out->height - top : BAND;
    return (top + within % rows) * out->width + within / rows;
}

/* The next pixels of a set, at most so many; returns where to go on. */
static int64_t take_pixels(const image *out, const unsigned char *from, int64_t first, int64_t most,
                           unsigned char *taken)
{
    const int64_t end = (int64_t)out->width * out->height;
    memset(taken, 0, pixel_set_bytes(end));
    for (; first < end && most > 0; first++) {
        const int64_t pixel = banded_pixel(out, first);
        if (!pixel_set_has(from, pixel)) continue;
        pixel_set_add(taken, pixel);
        most--;
    }
    return first;
}

static void copy_pixels(const unsigned char *pixels, const image *from, image *to)
{
    const int64_t count = (int64_t)to->width * to->height;
    for (int64_t p = 0; p < count; p++) {
        if (!pixel_set_has(pixels, p)) continue;
        memcpy(to->rgba + 4 * p, from->rgba + 4 * p, 4 * sizeof *to->rgba);
        if (to->depth) to->depth[p] = from->depth[p];
    }
}

static insitu_status redraw(const frame_target *t, const render_job *job, int64_t fragment_limit,
                            const comp_overlaps *overlaps, unsigned char *turn, image *beside, image *out,
                            base_error *error)
{
    const int64_t most = turn_pixels(job, fragment_limit);
    const bool is_sampled = job->integration == RENDER_SAMPLES;
    int64_t doubled = 0;
    render_job again = *job;
    again.pixels = turn;
    again.separate_samples = true;
    for (int64_t left = overlaps->count, at = 0; left > 0; left -= most) {
        comp_overlaps found = {0};
        at = take_pixels(out, overlaps->pixels, at, most, turn);
        const insitu_status status = draw(t, &again, beside, is_sampled ? &found : NULL, error);
        doubled += found.count;
        base_free(found.pixels);
        if (status) return status;
        if (beside->rgba) copy_pixels(turn, beside, out);
    }
    if (doubled) t->frame->overlaps = overlaps->count;
    return INSITU_OK;
}

/* Rank 0 makes a second picture, all a set of pixels. */
static insitu_status draw_overlaps(const frame_target *t, const render_job *job, int64_t fragment_limit,
                                   const comp_overlaps *overlaps, image *out, base_error *error)
{
    const int64_t pixels = (int64_t)out->width * out->height;
    image beside = {.width = out->width, .height = out->height};
    unsigned char *turn = base_alloc(pixel_set_bytes(pixels));
    int rank = 0;
    MPI_Comm_rank(t->comm, &rank);
    if (rank == 0) {
        beside.rgba = base_alloc((size_t)pixels * 4 * sizeof *beside.rgba);
        if (out->depth) beside.depth = base_alloc((size_t)pixels * sizeof *beside.depth);
    }
    if (!turn || (rank == 0 && (!beside.rgba || (out->depth && !beside.depth))))
        base_fail(error, INSITU_ERROR_MEMORY, "no memory for %lld pixels in which cells overlap",
                  (long long)overlaps->count);
    insitu_status status = session_agree(t->comm, error);
    if (!status) status = redraw(t, job, fragment_limit, overlaps, turn, &beside, out, error);
    base_free(turn);
    base_free(beside.rgba);
    base_free(beside.depth);
    return status;
}

/* Segments of several volumes are at one place on every pixel: there is no first picture to put right. */
static bool is_mixed_throughout(const render_job *job)
{
    return job->integration == RENDER_SEGMENTS && job->volume_count > 1;
}

static insitu_status take_all(const frame_target *t, const image *out, comp_overlaps *all, base_error *error)
{
    all->count = (int64_t)out->width * out->height;
    all->pixels = base_calloc(pixel_set_bytes(all->count), 1);
    for (int64_t p = 0; p < all->count && all->pixels; p++) pixel_set_add(all->pixels, p);
    if (!all->pixels)
        base_fail(error, INSITU_ERROR_MEMORY, "no memory for a set of %lld pixels", (long long)all->count);
    return session_agree(t->comm, error);
}

insitu_status session_draw_frame(MPI_Comm comm, MPI_Comm comp_comm, const render_job *job, const float background[4],
                                 int64_t fragment_limit, image *out, session_frame *frame, base_error *error)
{
    *frame = (session_frame){0};
    const frame_target t = {comm, comp_comm, background, frame};
    comp_overlaps overlaps = {0};
    insitu_status status = INSITU_OK;
    if (is_mixed_throughout(job)) {
        status = take_all(&t, out, &overlaps, error);
    } else {
        status = draw(&t, job, out, job->volume_count ? &overlaps : NULL, error);
        /* Separate samples tell whether any has two owners but by rounding of their common face: see redraw(). */
        frame->overlaps = job->integration == RENDER_SAMPLES ? 0 : overlaps.count;
    }
    if (!status && overlaps.count) status = draw_overlaps(&t, job, fragment_limit, &overlaps, out, error);
    base_free(overlaps.pixels);
    return status;
}
