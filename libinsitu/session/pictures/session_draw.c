/* Draws all due images one after the other, frame by frame, and frees the memory of each image before the next image
 * begins.
 *
 * If an error, such as lack of memory, may occur on only some ranks, all ranks agree on a status before the next
 * collective call. An image that fails is skipped, and the next one is drawn; the step returns the first error. */
#include "session_draw.h"

#include <string.h>

#include "comp_edges.h"
#include "memory.h"
#include "region.h"
#include "session_agree.h"
#include "session_channels.h"
#include "session_decorations.h"
#include "session_deep.h"
#include "session_files.h"
#include "session_frame.h"
#include "session_image.h"
#include "session_layers.h"
#include "session_lines.h"
#include "session_shells.h"
#include "session_view.h"

/* Maximum number of fragments that a rank stores at once for pixels in which cells overlap. They take 64 MiB. */
enum { overlap_fragments = 1 << 21 };

/* The pictures on rank 0: the current frame, and the sum of the frames if there are several. On other ranks, only the
 * sizes of the pictures are set. */
typedef struct canvas {
    image frame;
    /* block that holds the pixels of `frame`; the writer becomes its owner when the picture is passed to it */
    session_picture memory;
    float *depth; /* depth of the first frame, which is kept here while further frames are drawn without depth */
    /* Used if only pixels at edges, which differ visibly from a neighbour, are drawn several times. samples: the
     * current frame, of which only the pixels at edges are drawn; edges: indices of these edge_count pixels in the
     * picture; edge_sums: sums of their colours over the frames. */
    image samples;
    int64_t edge_count, *edges;
    double *edge_sums;
    double *frame_sum; /* sum of the frames; NULL: there is only one frame */
    session_channels channels;
    deep_image deep;
    /* decorations of the picture; NULL: there are no decorations, and the frame includes the background */
    session_decorations *decorations;
} canvas;

static void canvas_free(canvas *c, session_writer *writer)
{
    if (c->memory.pixels) session_writer_release(writer, &c->memory);
    base_free(c->frame_sum);
    base_free(c->samples.rgba);
    base_free(c->edges);
    base_free(c->edge_sums);
    session_free_channels(&c->channels);
    session_free_deep_image(&c->deep);
    session_free_decorations(c->decorations);
}

static bool needs_depth(const session_drawing *d, const scene_image *image)
{
    if (d->kept->is_enabled) return true;
    for (int i = 0; i < image->output_count; i++)
        if (image->outputs[i].format == SCENE_EXR) return true;
    return false;
}

static bool needs_frames_only_at_edges(const scene_image *image)
{
    return image->antialias > 1 && image->volume_count == 0;
}

/* Warns if the step has been delayed because pictures are written slowly. */
static void warn_of_slow_writing(session_report *report, double seconds)
{
    static const double noticed = 0.1;
    static const session_warning warning = {WARNING_WRITER, NULL, NULL, 1};
    session_warn_locally(
        report, &warning, seconds > noticed,
        "the last step waited %.2g s for earlier pictures to be written: the disk, or the compression of so many "
        "pixels, is slower than the run; draw less often, or write elsewhere",
        seconds);
}

static void reserve_frame(const session_drawing *d, size_t bytes, canvas *c)
{
    const double start = MPI_Wtime();
    c->memory = session_writer_reserve(d->writer, bytes);
    c->frame.rgba = c->memory.pixels;
    const double seconds = MPI_Wtime() - start; /* time spent waiting for space in the queue */
    d->report->public_report.write_ms += 1e3 * seconds;
    warn_of_slow_writing(d->report, seconds);
}

static insitu_status canvas_create(const session_drawing *d, const scene_image *image, canvas *out, base_error *error)
{
    const size_t pixels = (size_t)image->width * (size_t)image->height;
    const size_t bytes = pixels * (needs_depth(d, image) ? 5 : 4) * sizeof(float);
    const bool is_summed = image->frames > 1 && !needs_frames_only_at_edges(image);
    out->frame.width = out->samples.width = image->width;
    out->frame.height = out->samples.height = image->height;
    if (d->team->rank != 0) return INSITU_OK;
    reserve_frame(d, bytes, out);
    if (needs_depth(d, image) && out->frame.rgba) out->frame.depth = out->frame.rgba + 4 * pixels;
    if (is_summed) out->frame_sum = base_calloc(pixels * 4, sizeof *out->frame_sum);
    if (!out->frame.rgba || (is_summed && !out->frame_sum))
        return session_fail_for_memory(error, (int64_t)(bytes + (is_summed ? pixels * 4 * sizeof *out->frame_sum : 0)),
                                       "a picture");
    return session_needs_deep_samples(image) ? session_create_deep_image(&out->deep, image, error) : INSITU_OK;
}

static void add_frame_to_sum(canvas *c, int threads)
{
    if (!c->frame_sum) return;
    const int64_t count = (int64_t)c->frame.width * c->frame.height * 4;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t i = 0; i < count; i++) c->frame_sum[i] += (double)c->frame.rgba[i];
        region_leave();
    }
}

/* Allocates memory for the pixels at edges, and for frames that contain only these pixels. Returns false if memory runs
 * out. */
static bool canvas_allocate_edge_pixels(canvas *c, const unsigned char *pixels)
{
    const int64_t count = (int64_t)c->frame.width * c->frame.height, edges = pixel_set_count(pixels, count);
    c->samples.rgba = base_alloc((size_t)count * 4 * sizeof *c->samples.rgba);
    c->edges = base_alloc((size_t)edges * sizeof *c->edges);
    c->edge_sums = base_calloc((size_t)edges * 4, sizeof *c->edge_sums);
    if (!c->samples.rgba || !c->edges || !c->edge_sums) return false;
    for (int64_t p = 0; p < count; p++)
        if (pixel_set_has(pixels, p)) c->edges[c->edge_count++] = p;
    return true;
}

static void add_frame_to_edge_sums(canvas *c, int threads)
{
    if (!c->edge_count) return;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t i = 0; i < c->edge_count; i++)
            for (int k = 0; k < 4; k++) c->edge_sums[4 * i + k] += (double)c->samples.rgba[4 * c->edges[i] + k];
        region_leave();
    }
}

static void average_edges(canvas *c, int frames, int threads)
{
    if (!c->edge_count) return;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t i = 0; i < c->edge_count; i++)
            for (int k = 0; k < 4; k++) c->frame.rgba[4 * c->edges[i] + k] = (float)(c->edge_sums[4 * i + k] / frames);
        region_leave();
    }
}

static void average_frames(canvas *c, int frames, int threads)
{
    const int64_t count = (int64_t)c->frame.width * c->frame.height * 4;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t i = 0; i < count; i++) c->frame.rgba[i] = (float)(c->frame_sum[i] / frames);
        region_leave();
    }
}

/* Converts depths from the ray parameter t to distances along the camera's axis. Infinite depths are kept. */
static void convert_depths(canvas *c, const render_space *space, int threads)
{
    const int64_t count = (int64_t)c->frame.width * c->frame.height;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t i = 0; i < count; i++)
            c->frame.depth[i] = (float)((double)c->frame.depth[i] / space->scale + space->depth_origin);
        region_leave();
    }
}

static void canvas_finish(canvas *c, int frames, const render_space *space, int threads)
{
    if (c->frame_sum) average_frames(c, frames, threads);
    average_edges(c, frames, threads);
    if (c->frame.depth) convert_depths(c, space, threads);
    session_convert_deep_depths(&c->deep, space, threads);
}

/* ---- drawing the frames of an image ------------------------------------------------------------------------------ */

static render_job make_job(const session_drawing *d, const scene_image *image, const session_view *view,
                           const session_layers *layers)
{
    const bool is_occluded = layers->surface_count > 0 && (view->occlusion.lights || view->occlusion.samples);
    return (render_job){.camera = view->camera,
                        .space = view->space,
                        .paint = is_occluded ? RENDER_UNLIT : RENDER_LIGHT,
                        .occlusion = &view->occlusion,
                        .parts = layers->parts,
                        .part_count = layers->part_count,
                        .parent = layers->part_count > 1 ? d->parent : NULL,
                        .surfaces = layers->surfaces,
                        .surface_count = layers->surface_count,
                        .clip_count = view->clip_count,
                        .clips = view->clips,
                        .volume_clips = image->volume_count ? image->volumes[0].clips : 0,
                        .volumes = layers->volumes,
                        .volume_count = image->volume_count,
                        .lights = view->lights,
                        .light_count = image->light_count,
                        .integration = image->method == SCENE_SEGMENTS ? RENDER_SEGMENTS : RENDER_SAMPLES,
                        .max_error = image->max_error,
                        .extent = 2 * d->space->extent.half_diagonal,
                        .step = view->step,
                        .sample_group = RENDER_MAX_GROUP,
                        .jitter = image->jitter,
                        .reproducible = image->is_reproducible,
                        .is_alone = d->space->extent.rank_count <= 1,
                        .threads = d->team->threads};
}

static void add_frame_to_report(insitu_report *report, const session_frame *frame)
{
    report->rays += frame->rays;
    report->map_failures += frame->map_failures;
    report->surface_ms += frame->surface_ms;
    report->volume_ms += frame->volume_ms;
    report->fragments += frame->fragments;
    report->composite_ms += frame->composite_ms;
    report->turns += frame->turns;
    report->bytes_sent += frame->sent_bytes;
    if (frame->schedule != COMP_AUTOMATIC) report->schedule = comp_schedule_name(frame->schedule);
}

static void warn_of_overlaps(session_report *report, const scene_image *image, int64_t pixels)
{
    const session_warning warning = {WARNING_OVERLAP, image->name, NULL, 0};
    session_warn(report, &warning, pixels > 0,
                 "image \"%s\": %lld pixels where cells overlap, so that each adds its own volume (are ghost cells "
                 "flagged?), or where a surface of another mesh lies within cells",
                 image->name, (long long)pixels);
}

/* The input and results of drawing the frames of an image. */
typedef struct frames_basis {
    const session_drawing *drawing;
    session_frame_target target;
    canvas *canvas;
    int64_t overlap_count; /* maximum over the frames of the number of pixels in which cells overlap */
    deep_image *deep;      /* deep picture that the next frame fills; NULL: no deep picture is requested, or a frame has
                              filled it already */
} frames_basis;

static insitu_status draw_frame(frames_basis *b, const render_job *job, image *out, base_error *error)
{
    session_frame frame;
    out->deep = b->deep;
    const insitu_status status = session_draw_frame(&b->target, job, out, &frame, error);
    out->deep = b->deep = NULL;
    add_frame_to_report(&b->drawing->report->public_report, &frame);
    if (!status && frame.overlaps > b->overlap_count) b->overlap_count = frame.overlaps;
    return status;
}

/* Finds the pixels at edges (which differ visibly from a neighbour) in rank 0's picture, and sends the set of these
 * pixels to all ranks. The caller must free *pixels. */
static insitu_status find_and_broadcast_edge_pixels(frames_basis *b, unsigned char **pixels, base_error *error)
{
    canvas *c = b->canvas;
    const session_team *team = b->drawing->team;
    const size_t bytes = pixel_set_bytes((int64_t)c->frame.width * c->frame.height);
    *pixels = base_calloc(bytes, 1);
    bool has_memory = *pixels != NULL;
    if (has_memory && team->rank == 0)
        has_memory = comp_find_edges(&c->frame, team->threads, *pixels) && canvas_allocate_edge_pixels(c, *pixels);
    if (!has_memory) session_fail_for_memory(error, (int64_t)bytes, "the pixels at edges");
    const insitu_status status = session_agree(team->comm, error);
    if (status) return status;
    return session_check_mpi(error, MPI_Bcast(*pixels, (int)bytes, MPI_BYTE, 0, team->comm), "MPI_Bcast");
}

/* Draws the image's frames for antialiasing; the position in the pixel through which rays pass differs from frame to
 * frame. If only pixels at edges are drawn, job->pixels is the set of these pixels. */
static insitu_status draw_antialiasing_frames(frames_basis *b, const scene_image *image, render_job *job,
                                              base_error *error)
{
    canvas *c = b->canvas;
    insitu_status status = INSITU_OK;
    for (job->frame = 0; job->frame < image->frames && !status; job->frame++) {
        render_camera_sample(image->antialias, job->frame % image->antialias, job->camera.offset);
        status = draw_frame(b, job, job->pixels ? &c->samples : &c->frame, error);
        if (status) break;
        add_frame_to_sum(c, b->drawing->team->threads);
        add_frame_to_edge_sums(c, b->drawing->team->threads);
    }
    return status;
}

/* Draws all frames of an image. If the image is antialiased and has no volumes, one frame is drawn with rays through
 * the pixels' centres, and then several frames of only the pixels at edges. If it is antialiased, has volumes, and
 * needs depth, a frame with rays through the pixels' centres is drawn first, and only its depth is used. */
static insitu_status draw_all_frames(frames_basis *b, const scene_image *image, render_job *job, base_error *error)
{
    canvas *c = b->canvas;
    unsigned char *pixels = NULL;
    if (image->antialias == 1 || !(needs_frames_only_at_edges(image) || needs_depth(b->drawing, image)))
        return draw_antialiasing_frames(b, image, job, error);
    insitu_status status = draw_frame(b, job, &c->frame, error);
    if (!status && needs_frames_only_at_edges(image)) status = find_and_broadcast_edge_pixels(b, &pixels, error);
    job->pixels = pixels;
    c->depth = c->frame.depth;
    c->frame.depth = NULL;
    if (!status) status = draw_antialiasing_frames(b, image, job, error);
    c->frame.depth = c->depth;
    base_free(pixels);
    return status;
}

static insitu_status draw_frames(const session_drawing *d, const scene_image *image, const session_view *view,
                                 const session_layers *layers, canvas *canvas, base_error *error)
{
    /* if there are decorations, lines of the outline may lie between the background and the data, so that frames are
     * drawn without a background */
    static const float no_background[4] = {0, 0, 0, 0};
    const float *background = image->decorations.is_given ? no_background : image->background;
    const comp_nodes nodes = {d->team->ranks_per_node, d->team->is_round_robin};
    _Static_assert((int)SCENE_SCHEDULE_BINARY == (int)COMP_BINARY, "a scene's schedules are those of compositing");
    const comp_group compositing = {d->team->compositing_comm, nodes, (comp_schedule)d->scene->schedule, 0,
                                    d->team->claims};
    frames_basis basis = {d,
                          {d->team->comm, compositing, background, overlap_fragments},
                          canvas,
                          0,
                          session_needs_deep_samples(image) ? &canvas->deep : NULL};
    render_job job = make_job(d, image, view, layers);
    const insitu_status status = draw_all_frames(&basis, image, &job, error);
    if (status) return status;
    warn_of_overlaps(d->report, image, basis.overlap_count);
    canvas_finish(canvas, image->frames, &view->space, d->team->threads);
    if (!session_needs_channels(image)) return INSITU_OK;
    session_frame taken;
    const insitu_status drawn =
        session_draw_channels(&basis.target, d->team, image, &job, &canvas->channels, &taken, error);
    add_frame_to_report(&d->report->public_report, &taken);
    return drawn;
}

/* ---- passing pictures to the writer ------------------------------------------------------------------------------ */

static scene_placeholder_values make_placeholder_values(const session_drawing *d, const scene_image *image)
{
    return scene_make_placeholder_values(image, d->cycle, d->report->public_report.time);
}

/* Compares the picture's colour bars with those of the first picture that this step has drawn for the same montage. */
static void compare_colour_bars_in_montage(const session_drawing *d, const scene_image *image,
                                           const session_decorations *decorations)
{
    for (int i = 0; i < image->output_count && decorations && d->shared_bars; i++) {
        const scene_output *output = &image->outputs[i];
        if (!output->shares_bars) continue;
        session_shared_bars *bars = &d->shared_bars[output->montage];
        if (!bars->path) *bars = (session_shared_bars){output->path, decorations->bars_hash, false};
        bars->has_other_bars = bars->has_other_bars || bars->hash != decorations->bars_hash;
    }
}

static void warn_of_different_colour_bars(const session_drawing *d)
{
    for (int i = 0; i < d->scene->montage_count && d->shared_bars; i++) {
        const session_shared_bars *bars = &d->shared_bars[i];
        if (!bars->path) continue;
        session_warn_locally(
            d->report, &(session_warning){WARNING_BARS, bars->path, NULL, 0}, bars->has_other_bars,
            "%s: the pictures in it have different colour bars and cannot share them: each has its own", bars->path);
    }
}

/* Passes the picture to the writer. The writer then owns the picture's memory. Called on rank 0 only. */
static void queue_picture(const session_drawing *d, const scene_image *image, canvas *c, base_error *error)
{
    session_files *files = base_calloc(1, sizeof *files);
    if (!files) {
        session_fail_for_memory(error, (int64_t)sizeof *files, "a picture that is to be written");
        return;
    }
    files->scene = d->scene;
    files->cinema = d->cinema;
    files->montages = d->montages;
    files->has_picture = true;
    files->image = *image;
    files->moment = make_placeholder_values(d, image);
    files->frame = c->frame;
    files->memory = c->memory;
    files->channels = c->channels;
    files->deep = c->deep;
    files->decorations = c->decorations;
    compare_colour_bars_in_montage(d, image, c->decorations);
    c->memory = (session_picture){0};
    c->channels = (session_channels){0};
    c->deep = (deep_image){0};
    c->decorations = NULL;
    session_writer_queue(d->writer, files, error);
}

/* Passes a picture to the writer of rank 0. If pictures are written after the step, the only possible error is that
 * rank 0 lacks memory; the next step reports it together with the errors of the writing thread. ranges: the image's
 * colour ranges over the run, which are written too; NULL: the image has none. */
static insitu_status pass_picture_to_writer(const session_drawing *d, const scene_image *image, canvas *c,
                                            session_image_ranges *ranges, base_error *error)
{
    const double start = MPI_Wtime();
    const bool is_told_later = d->writes_behind && !d->kept->is_enabled && !ranges;
    base_error later = {.status = INSITU_OK};
    if (d->team->rank == 0) {
        queue_picture(d, image, c, is_told_later ? &later : error);
        session_writer_record_error(d->writer, d->cycle, &later);
        if (ranges) session_write_run_ranges(ranges, error);
        d->report->public_report.write_ms += 1e3 * (MPI_Wtime() - start);
    }
    return is_told_later ? INSITU_OK : session_agree(d->team->comm, error);
}

/* ---- drawing one or all images ----------------------------------------------------------------------------------- */

/* Finds the areas of the image's picture that insets will cover. Insets are drawn over a montage that contains the
 * picture. If several of the image's files are montages with insets, the areas are those of the first such file.
 * Returns the number of areas. */
static int find_areas_under_insets_of_image(const scene *scene, const scene_image *image,
                                            insitu_rectangle covered[SCENE_ANCHORS])
{
    int count = 0;
    for (int i = 0; i < image->output_count && !count; i++) {
        const scene_output *output = &image->outputs[i];
        if (output->montage < 0 || output->is_inset) continue;
        count = session_find_areas_under_insets(&scene->montages[output->montage],
                                                output->first_panel + image->variant.view, covered);
    }
    return count;
}

/* Warns on rank 0 of texts that cannot be drawn as they are written. Their layout is computed here only so that the
 * warnings are reported in this step; the writing thread computes the layout a second time. */
static void warn_of_undrawable_text(const session_drawing *d, const scene_image *image,
                                    const session_decorations *decorations)
{
    insitu_word_faults faults;
    insitu_rectangle covered[SCENE_ANCHORS];
    insitu_decorations in_file = decorations->decorations;
    in_file.covered = covered;
    in_file.covered_count = find_areas_under_insets_of_image(d->scene, image, covered);
    session_find_text_faults(&(insitu_image){.width = image->width, .height = image->height, .decorations = &in_file},
                             &faults);
    const char *const texts[] = {faults.font, faults.letters, faults.room};
    for (int i = 0; i < 3; i++)
        session_warn_locally(d->report, &(session_warning){WARNING_WORDS, image->name, NULL, i}, *texts[i] != '\0',
                             "image \"%s\": %.900s", image->name, texts[i]);
}

/* Computes the decorations of an image. Collective if the outline consists of boxes per mesh or per rank. An error that
 * occurs only on rank 0 is passed to all ranks in the next phase. */
static insitu_status make_image_decorations(const session_drawing *d, const scene_image *image,
                                            const session_view *view, const session_layers *layers, canvas *out,
                                            base_error *error)
{
    session_outline outline;
    const scene_placeholder_values moment = make_placeholder_values(d, image);
    const insitu_status status =
        session_find_outline(&image->decorations, d->catalogue, d->meshes, &d->space->extent, d->team, &outline, error);
    if (status) return status;
    if (image->decorations.is_given && d->team->rank == 0 && !error->status) {
        out->decorations = session_make_decorations(
            image, &(session_decoration_basis){&moment, &d->space->extent, view, layers, &outline, d->catalogue});
        if (!out->decorations) session_fail_for_memory(error, (int64_t)sizeof *out->decorations, "decorations");
        if (out->decorations && scene_draws_text(image)) warn_of_undrawable_text(d, image, out->decorations);
    }
    session_free_outline(&outline);
    return INSITU_OK;
}

/* Draws an image. An error that occurs only on some ranks, such as lack of memory, is stored in *error; the next phase,
 * which computes the layers or the first frame, passes it to all ranks. */
static insitu_status draw_image(const session_drawing *d, const scene_image *image, base_error *error)
{
    const session_extent *extent = &d->space->extent;
    session_layer_basis basis = {.meshes = d->meshes,
                                 .catalogue = d->catalogue,
                                 .team = d->team,
                                 .half_diagonal = extent->half_diagonal,
                                 .is_flat = session_flat_axis(extent) >= 0,
                                 .has_shells = session_has_shells(d->catalogue),
                                 .report = d->report,
                                 .image = image};
    session_view view;
    session_layers layers = {0};
    canvas canvas = {0};
    insitu_status status = session_make_view(d->space, d->scene_path, image, d->team, d->report, &view, error);
    if (!status) status = session_find_or_read_run_ranges(d->run_ranges, image, d->team, &basis.run_ranges, error);
    if (status) return status;
    if (!error->status) canvas_create(d, image, &canvas, error);
    status = session_make_layers(&basis, image, &layers, error);
    if (!status) status = make_image_decorations(d, image, &view, &layers, &canvas, error);
    if (!status) status = draw_frames(d, image, &view, &layers, &canvas, error);
    if (!status) {
        if (d->kept->is_enabled && d->team->rank == 0) session_keep_picture(d->kept, image, &canvas.frame, error);
        status = pass_picture_to_writer(d, image, &canvas, basis.run_ranges, error);
        d->report->public_report.images++;
    }
    session_layers_free(&layers);
    canvas_free(&canvas, d->writer);
    return status;
}

/* Writes the montages and the tables of databases on rank 0. The tables contain lines for all pictures of the step.
 * Collective. */
static void queue_montages_and_tables(const session_drawing *d, base_error *first)
{
    base_error reason = {.status = INSITU_OK};
    if (d->scene->database_count == 0 && d->scene->montage_count == 0) return;
    if (d->team->rank == 0) {
        const double start = MPI_Wtime();
        session_files *files = base_calloc(1, sizeof *files);
        if (files) {
            files->scene = d->scene;
            files->cinema = d->cinema;
            files->montages = d->montages;
            files->moment.cycle = d->cycle;
            session_writer_queue(d->writer, files, &reason);
        } else
            session_fail_for_memory(&reason, (int64_t)sizeof *files, "the tables of databases");
        d->report->public_report.write_ms += 1e3 * (MPI_Wtime() - start);
    }
    session_agree_without_rank(d->team->comm, &reason);
    if (!first->status) *first = reason;
}

static bool has_shared_bars(const scene *scene)
{
    bool is_any = false;
    for (int i = 0; i < scene->montage_count; i++) is_any = is_any || scene->montages[i].shares_bars;
    return is_any;
}

insitu_status session_draw_images(const session_drawing *drawing, const session_plan *plan, uint64_t *drawn,
                                  base_error *error)
{
    base_error first = plan->refusal;
    session_drawing own = *drawing;
    const session_drawing *d = &own;
    const bool are_bars_shared = has_shared_bars(d->scene);
    /* if memory runs out here, the comparison of colour bars is skipped, and only its warning is lost */
    own.shared_bars = are_bars_shared && d->team->rank == 0
                          ? base_calloc((size_t)d->scene->montage_count, sizeof *own.shared_bars)
                          : NULL;
    /* if pictures are written during the step, rank 0 may have warnings for all ranks */
    bool has_lines = !d->writes_behind || are_bars_shared;
    for (int i = 0; i < plan->image_count; i++) {
        base_error reason = {0};
        has_lines = has_lines || scene_draws_text(plan->images[i]);
        /* a copy of the image, in which the camera is that of this step; the copy's lists belong to the scene */
        scene_image placed = *plan->images[i];
        placed.camera = scene_compute_camera_at_time(&placed.camera, d->cycle, d->report->public_report.time);
        if (draw_image(d, &placed, &reason) == INSITU_OK) {
            *drawn |= (uint64_t)1 << placed.variant.source;
            session_record_written_files(d->overwrites, d->scene, (int)(plan->images[i] - d->scene->images), d->cycle,
                                         d->report->public_report.time, d->report);
        }
        if (first.status == INSITU_OK) first = reason;
    }
    warn_of_different_colour_bars(d);
    base_free(own.shared_bars);
    if (has_lines) session_broadcast_warnings(d->report, 0, d->team, &first);
    queue_montages_and_tables(d, &first);
    if (first.status) *error = first;
    return error->status;
}
