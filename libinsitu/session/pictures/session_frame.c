/* Draws a frame, and draws the pixels in which cells overlap a second time.
 *
 * Fragments that overlap cannot be sorted by depth, and the positions of their samples are no longer known when
 * compositing finds the overlap. Therefore compositing sends the set of pixels with overlaps to all ranks. These pixels
 * are traced again with every sample as a separate fragment (render.h), composited into a second picture, and copied
 * into the first. A mesh with a few overlapping cells causes only a few such pixels. Two meshes that fill the same
 * space may cause a thousand fragments in each of a million pixels. Such pixels are drawn in several passes, called
 * turns. The number of pixels of a turn is estimated so that no rank has more fragments than it may store. If segments
 * of several volumes are drawn, all pixels are drawn in turns, and the first pass is omitted. */
#include "session_frame.h"

#include <math.h>
#include <string.h>

#include "comp_tiles.h"
#include "memory.h"
#include "render_differences.h"
#include "render_light.h"
#include "session_agree.h"
#include "session_differences.h"
#include "session_light.h"

static void add_to_frame(session_frame *frame, const render_statistics *rendered, int64_t fragments,
                         double composite_ms)
{
    frame->rays += rendered->rays;
    frame->map_failures += rendered->map_failures;
    frame->fragments += fragments;
    frame->surface_ms += rendered->surface_ms;
    frame->volume_ms += rendered->volume_ms;
    frame->composite_ms += composite_ms;
}

/* Draws a frame if there is only one rank. The fragments of a tile of pixels are composited as soon as the tile's rays
 * have been traced (comp_tiles.h). */
static insitu_status draw_frame_on_single_rank(const session_frame_target *t, const render_job *job, image *out,
                                               session_frame *frame, comp_overlaps *overlaps, base_error *error)
{
    render_statistics rendered = {0};
    comp_statistics composited = {0};
    comp_tiles tiles;
    if (!error->status &&
        comp_tiles_begin(&tiles, t->background, job->threads, overlaps != NULL, out, error) == INSITU_OK) {
        render_frame_tiles(job, comp_tiles_blend, &tiles, &rendered, error);
        comp_tiles_end(&tiles, overlaps, &composited);
    }
    add_to_frame(frame, &rendered, composited.sent_fragments, composited.merge_ms);
    return session_agree(t->comm, error);
}

/* Traces the job's rays in this rank's cells. If normals are computed by central differences, the ranks exchange
 * samples of the field, and the returned status is the same on all ranks. Other errors of this rank are stored in
 * *error and not returned. */
static insitu_status trace_fragments(const session_frame_target *t, const render_job *job, fragment_list *fragments,
                                     render_statistics *rendered, base_error *error)
{
    int ranks = 1;
    MPI_Comm_size(t->comm, &ranks);
    render_pending_list waiting = {0};
    double ranges[RENDER_MAX_ISOVALUES][2] = {{0}};
    render_job traced = *job;
    traced.waiting = ranks > 1 && render_has_differences(job) ? &waiting : NULL;
    traced.waiting_ranges = ranges;
    if (job->part_count > 0 && !error->status) render_frame(&traced, fragments, rendered, error);
    if (!traced.waiting) return INSITU_OK;
    return session_light_hits_by_differences(t->comm, &traced, fragments, &rendered->surface_ms, error);
}

/* Computes the lighting of the fragments. The occluders, by which rays to lights may be blocked, are built once per
 * frame and used by all of its turns (passes over some of the pixels): the jobs of the turns differ only in the set of
 * their pixels. */
static insitu_status light_fragments(const session_frame_target *t, const render_job *job, fragment_list *fragments,
                                     session_frame *frame, render_statistics *rendered, base_error *error)
{
    const insitu_status status = session_agree(t->comm, error);
    if (status) return status;
    return session_light_fragments(t->comm, job, &frame->occluders, fragments, &rendered->surface_ms, error);
}

static insitu_status trace_and_composite_frame(const session_frame_target *t, const render_job *job, image *out,
                                               session_frame *frame, comp_overlaps *overlaps, base_error *error)
{
    int ranks = 1;
    MPI_Comm_size(t->comm, &ranks);
    const bool is_unlit = job->paint == RENDER_UNLIT;
    if (ranks == 1 && job->part_count > 0 && !out->deep && !is_unlit)
        return draw_frame_on_single_rank(t, job, out, frame, overlaps, error);
    fragment_list fragments = {0};
    render_statistics rendered = {0};
    comp_statistics composited = {0};
    insitu_status status = trace_fragments(t, job, &fragments, &rendered, error);
    if (!status && is_unlit) status = light_fragments(t, job, &fragments, frame, &rendered, error);
    if (status) {
        base_free(fragments.items);
        return status;
    }
    const double start = MPI_Wtime();
    status = overlaps
                 ? comp_composite_overlaps(&t->compositing, &fragments, t->background, job->threads, out, overlaps,
                                           &composited, error)
                 : comp_composite(&t->compositing, &fragments, t->background, job->threads, out, &composited, error);
    if (status && !composited.has_failed) *error = (base_error){0};
    /* all ranks have the same status here, but messages may differ, so that ranks agree on one message */
    if (status) status = session_agree(t->comm, error);
    base_free(fragments.items);
    add_to_frame(frame, &rendered, composited.sent_fragments, 1e3 * (MPI_Wtime() - start));
    frame->sent_bytes += composited.sent_bytes;
    if (ranks > 1) frame->schedule = composited.schedule;
    return status;
}

/* ---- drawing pixels in which cells overlap ----------------------------------------------------------------------- */

/* Estimates the number of pixels that produce fragment_limit fragments. The number of samples per pixel is estimated as
 * 2 divided by the distance between samples, because a ray is about 1, and at most sqrt(3), long within the scene in
 * scaled units. The number of segments per pixel is an empirical value. */
static int64_t estimate_pixels_per_pass(const render_job *job, int64_t fragment_limit)
{
    enum { SEGMENTS = 500, CUT_BY_SURFACES = 5000 };
    const bool is_sampled = job->integration == RENDER_SAMPLES;
    const double ray = is_sampled           ? 2 / (job->step * job->space.scale)
                       : job->surface_count ? CUT_BY_SURFACES
                                            : SEGMENTS;
    const double pixels = (double)fragment_limit / (job->volume_count * ray + 1);
    return pixels > 1 ? (int64_t)pixels : 1;
}

/* Computes the number of pixels of the next turn from the number of fragments that the busiest rank had in the previous
 * turn. The growth is limited, since the few pixels of a turn may not be representative. Collective; the result is the
 * same on all ranks. */
static insitu_status update_pixels_per_pass(const session_frame_target *t, int64_t fragments, int64_t *pixels,
                                            base_error *error)
{
    enum { MOST_GROWTH = 8 };
    int64_t most = 0;
    const int code = MPI_Allreduce(&fragments, &most, 1, MPI_INT64_T, MPI_MAX, t->comm);
    if (code != MPI_SUCCESS) return session_check_mpi(error, code, "MPI_Allreduce");
    const double growth = (double)t->fragment_limit / (double)(most > 0 ? most : 1);
    *pixels = (int64_t)((double)*pixels * fmin(growth, MOST_GROWTH));
    if (*pixels < 1) *pixels = 1;
    return INSITU_OK;
}

/* The order in which a picture's pixels are drawn in turns. Pixels are ordered by squares of SQUARE × SQUARE, so that
 * the rays of a packet are neighbours. Squares that follow each other in the order are far apart in the picture: their
 * indices differ by about the number of squares divided by the golden ratio. Each turn therefore contains about the
 * same fraction of the pixels in dense regions. */
typedef struct turn_order {
    int width, height, squares_per_row; /* size of the picture in pixels, and number of squares in a row of squares */
    /* squares: number of squares. stride: difference, modulo `squares`, between the indices of squares that follow each
     * other in the order. `squares` and `stride` have no common divisor, so that each square is visited once. */
    int64_t squares, stride;
} turn_order;

enum { SQUARE = 16 };

static int64_t greatest_common_divisor(int64_t a, int64_t b)
{
    while (b) {
        const int64_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

static turn_order make_pixel_order(const image *out)
{
    turn_order order = {out->width, out->height, (out->width + SQUARE - 1) / SQUARE, 0, 0};
    order.squares = (int64_t)order.squares_per_row * ((out->height + SQUARE - 1) / SQUARE);
    order.stride = (int64_t)(0.618 * (double)order.squares) + 1;
    while (greatest_common_divisor(order.stride, order.squares) > 1) order.stride++;
    return order;
}

/* Returns the k-th pixel of the order, or -1 if it is outside of the picture. */
static int64_t find_pixel_in_order(const turn_order *order, int64_t k)
{
    const int64_t square = k / (SQUARE * SQUARE) % order->squares * order->stride % order->squares;
    const int64_t x = square % order->squares_per_row * SQUARE + k % SQUARE;
    const int64_t y = square / order->squares_per_row * SQUARE + k / SQUARE % SQUARE;
    return x < order->width && y < order->height ? y * order->width + x : -1;
}

/* Stores in `taken` the next pixels of the set `from`, at most `most`, starting at position `first` of the turn order.
 * Returns the position at which the next turn continues. */
static int64_t select_pixels_of_pass(const image *out, const unsigned char *from, int64_t first, int64_t most,
                                     unsigned char *taken)
{
    const turn_order order = make_pixel_order(out);
    const int64_t end = order.squares * SQUARE * SQUARE;
    memset(taken, 0, pixel_set_bytes((int64_t)out->width * out->height));
    for (; first < end && most > 0; first++) {
        const int64_t pixel = find_pixel_in_order(&order, first);
        if (pixel < 0 || !pixel_set_has(from, pixel)) continue;
        pixel_set_add(taken, pixel);
        most--;
    }
    return first;
}

static void copy_selected_pixels(const unsigned char *pixels, const image *from, image *to)
{
    const int64_t count = (int64_t)to->width * to->height;
    for (int64_t p = 0; p < count; p++) {
        if (!pixel_set_has(pixels, p)) continue;
        memcpy(to->rgba + 4 * p, from->rgba + 4 * p, 4 * sizeof *to->rgba);
        if (to->depth) to->depth[p] = from->depth[p];
    }
}

/* Removes the samples of the pixels in the set `pixels` from the deep picture on rank 0, because these pixels are drawn
 * again. */
static void remove_deep_samples(const unsigned char *pixels, const image *out)
{
    const int64_t count = (int64_t)out->width * out->height;
    for (int64_t p = 0; p < count; p++)
        if (pixel_set_has(pixels, p)) out->deep->counts[p] = 0;
}

/* A second picture on rank 0, into which the pixels of a turn (a pass over some of the pixels) are drawn. */
typedef struct second_picture {
    image picture;
    unsigned char *turn_pixels; /* set of pixels that the turn draws; on every rank */
} second_picture;

static insitu_status second_picture_create(const session_frame_target *t, const comp_overlaps *overlaps,
                                           const image *first, second_picture *out, base_error *error)
{
    const int64_t pixels = (int64_t)first->width * first->height;
    image *second = &out->picture;
    int rank = 0;
    *out = (second_picture){.picture = {.width = first->width, .height = first->height, .deep = first->deep}};
    out->turn_pixels = base_alloc(pixel_set_bytes(pixels));
    MPI_Comm_rank(t->comm, &rank);
    if (rank == 0) {
        second->rgba = base_alloc((size_t)pixels * 4 * sizeof *second->rgba);
        if (first->depth) second->depth = base_alloc((size_t)pixels * sizeof *second->depth);
    }
    if (!out->turn_pixels || (rank == 0 && (!second->rgba || (first->depth && !second->depth))))
        base_fail(error, INSITU_ERROR_MEMORY, "no memory for %lld pixels in which cells overlap",
                  (long long)overlaps->count);
    return session_agree(t->comm, error);
}

static void second_picture_free(second_picture *second)
{
    base_free(second->turn_pixels);
    base_free(second->picture.rgba);
    base_free(second->picture.depth);
}

static insitu_status redraw_overlaps(const session_frame_target *t, const render_job *job,
                                     const comp_overlaps *overlaps, second_picture *second, image *out,
                                     session_frame *frame, base_error *error)
{
    const bool is_sampled = job->integration == RENDER_SAMPLES;
    int64_t doubled = 0, most = estimate_pixels_per_pass(job, t->fragment_limit);
    render_job again = *job;
    again.pixels = second->turn_pixels;
    again.separate_samples = true;
    again.reproducible = false;
    for (int64_t left = overlaps->count, at = 0; left > 0;) {
        const int64_t before = frame->fragments;
        comp_overlaps found = {0};
        at = select_pixels_of_pass(out, overlaps->pixels, at, most, second->turn_pixels);
        if (out->deep && out->deep->counts) remove_deep_samples(second->turn_pixels, out);
        insitu_status status =
            trace_and_composite_frame(t, &again, &second->picture, frame, is_sampled ? &found : NULL, error);
        doubled += found.count;
        base_free(found.pixels);
        if (status) return status;
        if (second->picture.rgba) copy_selected_pixels(second->turn_pixels, &second->picture, out);
        frame->turns++;
        left -= most;
        if (left > 0) status = update_pixels_per_pass(t, frame->fragments - before, &most, error);
        if (status) return status;
    }
    if (doubled) frame->overlaps = overlaps->count;
    return INSITU_OK;
}

static insitu_status redraw_overlaps_in_second_picture(const session_frame_target *t, const render_job *job,
                                                       const comp_overlaps *overlaps, image *out, session_frame *frame,
                                                       base_error *error)
{
    second_picture second;
    insitu_status status = second_picture_create(t, overlaps, out, &second, error);
    if (!status) status = redraw_overlaps(t, job, overlaps, &second, out, frame, error);
    second_picture_free(&second);
    return status;
}

/* Returns whether all pixels must be drawn with separate fragments. This is the case for segments of several volumes,
 * which overlap in every pixel. It is also the case for samples of several volumes if pictures must be reproducible:
 * whether a rank or compositing blends such samples affects their rounding, and therefore compositing must blend them
 * all. */
static bool needs_separate_fragments_everywhere(const render_job *job)
{
    return (job->integration == RENDER_SEGMENTS || job->reproducible) && job->volume_count > 1;
}

static insitu_status mark_all_pixels(const session_frame_target *t, const image *out, comp_overlaps *all,
                                     base_error *error)
{
    all->count = (int64_t)out->width * out->height;
    all->pixels = base_calloc(pixel_set_bytes(all->count), 1);
    for (int64_t p = 0; p < all->count && all->pixels; p++) pixel_set_add(all->pixels, p);
    if (!all->pixels)
        base_fail(error, INSITU_ERROR_MEMORY, "no memory for a set of %lld pixels", (long long)all->count);
    return session_agree(t->comm, error);
}

insitu_status session_draw_frame(const session_frame_target *t, const render_job *job, image *out, session_frame *frame,
                                 base_error *error)
{
    comp_overlaps overlaps = {0};
    insitu_status status = INSITU_OK;
    *frame = (session_frame){0};
    if (needs_separate_fragments_everywhere(job)) {
        status = mark_all_pixels(t, out, &overlaps, error);
    } else {
        out->is_folded = job->reproducible && job->volume_count > 0;
        status = trace_and_composite_frame(t, job, out, frame, job->volume_count ? &overlaps : NULL, error);
        out->is_folded = false;
        /* the count includes pixels in which, because of rounding, a sample at the common face of two cells is in both
         * cells; redraw_overlaps() therefore sets frame->overlaps after drawing each sample as a separate fragment */
        frame->overlaps = job->integration == RENDER_SAMPLES ? 0 : overlaps.count;
    }
    if (!status && overlaps.count) status = redraw_overlaps_in_second_picture(t, job, &overlaps, out, frame, error);
    base_free(overlaps.pixels);
    render_occluders_free(frame->occluders);
    frame->occluders = NULL;
    return status;
}
