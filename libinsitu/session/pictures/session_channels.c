#include "session_channels.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "region.h"
#include "session_agree.h"

bool session_needs_channels(const scene_image *image)
{
    for (int i = 0; i < image->output_count; i++)
        if (image->outputs[i].has_data) return true;
    return false;
}

void session_free_channels(session_channels *channels)
{
    base_free(channels->normals);
    base_free(channels->values);
    *channels = (session_channels){0};
}

/* ---- frames in which all surfaces are opaque --------------------------------------------------------------------- */

static void add_frame_statistics(session_frame *sum, const session_frame *frame)
{
    sum->rays += frame->rays;
    sum->map_failures += frame->map_failures;
    sum->fragments += frame->fragments;
    sum->surface_ms += frame->surface_ms;
    sum->composite_ms += frame->composite_ms;
    sum->turns += frame->turns;
    sum->sent_bytes += frame->sent_bytes;
    sum->schedule = frame->schedule;
}

static insitu_status draw_surface_channels(const session_frame_target *target, const render_job *job,
                                           render_paint paint, float *rgba, session_frame *taken, base_error *error)
{
    static const float nothing[4] = {0, 0, 0, 0};
    const session_frame_target bare = {target->comm, target->compositing, nothing, target->fragment_limit};
    image out = {.width = job->camera.width, .height = job->camera.height, .rgba = rgba};
    render_job numbers = *job;
    session_frame frame = {0};
    numbers.paint = paint;
    const insitu_status status = session_draw_frame(&bare, &numbers, &out, &frame, error);
    add_frame_statistics(taken, &frame);
    return status;
}

/* Returns a copy of the job without volumes, in which all surfaces are opaque and a ray is traced through the centre of
 * every pixel. `surfaces` is a buffer for the copied surfaces. */
static render_job make_opaque_job(const render_job *job, render_surface_layer *surfaces)
{
    render_job out = *job;
    for (int i = 0; i < job->surface_count; i++) {
        surfaces[i] = job->surfaces[i];
        surfaces[i].opacity = 1;
    }
    out.surfaces = surfaces;
    out.volume_count = out.frame = 0;
    out.camera.offset[0] = out.camera.offset[1] = 0;
    out.pixels = NULL;
    return out;
}

/* ---- indices of the layer and of the surface at each pixel ------------------------------------------------------- */

/* Position in the scene of each surface of the job: the index of its layer in the image's list of layers, and the index
 * of the surface within this layer (such as the index of its isovalue). */
typedef struct surface_numbers {
    int count;
    float layer[RENDER_MAX_ISOVALUES], surface[RENDER_MAX_ISOVALUES];
} surface_numbers;

static void append_surface_indices_of_layer(surface_numbers *n, int layer, int surfaces)
{
    for (int i = 0; i < surfaces && n->count < RENDER_MAX_ISOVALUES; i++) {
        n->layer[n->count] = (float)layer;
        n->surface[n->count++] = (float)i;
    }
}

/* Lists, for all surfaces of the image in the order of the job, the index of the layer and the index within the
 * layer. If has_shells is set, each isosurface layer also has contour lines on shells, which are one more surface
 * of the job. */
static surface_numbers list_surface_indices(const scene_image *image, bool has_shells)
{
    surface_numbers out = {0};
    for (int i = 0; i < image->isosurface_count; i++)
        append_surface_indices_of_layer(&out, image->isosurfaces[i].number, image->isosurfaces[i].value_count);
    for (int i = 0; i < image->isosurface_count && has_shells; i++)
        append_surface_indices_of_layer(&out, image->isosurfaces[i].number, 1);
    for (int i = 0; i < image->surface_count; i++) append_surface_indices_of_layer(&out, image->surfaces[i].number, 1);
    for (int i = 0; i < image->slice_count; i++)
        append_surface_indices_of_layer(&out, image->slices[i].number, image->slices[i].plane_count);
    return out;
}

/* Converts the data of each pixel from (value, index of the surface in the job, 0, opacity) to (value, index of the
 * layer, index of the surface within the layer, opacity). */
static void convert_surface_indices(const scene_image *image, bool has_shells, float *values, int threads)
{
    const surface_numbers numbers = list_surface_indices(image, has_shells);
    const int64_t pixels = (int64_t)image->width * image->height;
#pragma omp parallel num_threads(threads)
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t p = 0; p < pixels; p++) {
            float *pixel = values + 4 * p;
            const int number = (int)pixel[1];
            if (pixel[3] > 0 && number >= 0 && number < numbers.count) {
                pixel[1] = numbers.layer[number];
                pixel[2] = numbers.surface[number];
            } else {
                pixel[0] = NAN;
                pixel[1] = pixel[2] = -1;
            }
        }
        region_leave();
    }
}

static void fill_channel_items(session_channels *c)
{
    const insitu_channel items[SESSION_CHANNELS] = {{"N.X", c->normals, 4},      {"N.Y", c->normals + 1, 4},
                                                    {"N.Z", c->normals + 2, 4},  {"value", c->values, 4},
                                                    {"layer", c->values + 1, 4}, {"surface", c->values + 2, 4}};
    memcpy(c->items, items, sizeof items);
}

/* ---- drawing all channels ---------------------------------------------------------------------------------------- */

insitu_status session_draw_channels(const session_frame_target *target, const session_team *team,
                                    const scene_image *image, const render_job *job, session_channels *out,
                                    session_frame *taken, base_error *error)
{
    const size_t bytes = (size_t)image->width * (size_t)image->height * 4 * sizeof(float);
    render_surface_layer *surfaces = base_alloc((size_t)job->surface_count * sizeof *surfaces);
    bool has_memory = surfaces != NULL;
    *taken = (session_frame){0};
    if (team->rank == 0) {
        out->normals = base_alloc(bytes);
        out->values = base_alloc(bytes);
        has_memory = has_memory && out->normals && out->values;
    }
    if (!has_memory) session_fail_for_memory(error, 2 * (int64_t)bytes, "the data of a picture");
    insitu_status status = session_agree(team->comm, error);
    if (!status) {
        const render_job opaque = make_opaque_job(job, surfaces);
        status = draw_surface_channels(target, &opaque, RENDER_NORMALS, out->normals, taken, error);
        if (!status) status = draw_surface_channels(target, &opaque, RENDER_VALUES, out->values, taken, error);
    }
    base_free(surfaces);
    if (!status && team->rank == 0) {
        int surfaces_given = image->isosurface_count + image->surface_count;
        for (int i = 0; i < image->slice_count; i++) surfaces_given += image->slices[i].plane_count;
        convert_surface_indices(image, job->surface_count > surfaces_given, out->values, team->threads);
        fill_channel_items(out);
    }
    return status;
}
