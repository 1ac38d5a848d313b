/* Computes the renderer's camera, lights, clips and sampling distance from an image of the scene. All ranks have the
 * same input, so that no communication is needed. */
#include "session_view.h"

#include <math.h>
#include <string.h>

#include "session_camera.h"
#include "session_clips.h"
#include "vector3.h"

static insitu_status make_camera(const session_extent *extent, const char *scene_path, const scene_image *image,
                                 render_camera *out, base_error *error)
{
    if (session_make_camera(extent, image, out)) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_SCENE,
                     "%s:%d: image \"%s\": its camera stands at its focal point or looks along its up direction",
                     scene_path, image->line, image->name);
}

static void make_lights(const scene_image *image, const render_camera *camera, render_light *lights)
{
    for (int i = 0; i < image->light_count; i++) {
        const scene_light *light = &image->lights[i];
        const double *d = light->direction;
        for (int axis = 0; axis < 3; axis++) {
            lights[i].colour[axis] = light->colour[axis];
            lights[i].direction[axis] = light->is_in_world ? d[axis]
                                                           : d[0] * camera->right[axis] + d[1] * camera->up[axis] -
                                                                 d[2] * camera->forward[axis];
        }
    }
}

/* Smallest default sampling distance, as a fraction of half the diagonal of the bounds: there are at most about 500,000
 * samples across the scene, even if cells with an extreme aspect ratio are smaller. */
static const double finest_step = 4e-6;

/* Returns the distance between samples in scene units. If no cell has a volume, a hundredth of the diagonal is used
 * instead of the size of cells. */
static double compute_sample_distance(const session_extent *extent, const scene_image *image)
{
    if (image->step > 0) return image->step;
    const double cell = extent->cell_size > 0 ? extent->cell_size : extent->half_diagonal / 50;
    const double step = cell > 0 ? image->step_cells * cell : 1;
    return image->step_cells < SCENE_STEP_CELLS ? step : fmax(step, finest_step * extent->half_diagonal);
}

/* Returns the radius of ambient occlusion, which by default is a tenth of the diagonal. If the diagonal is 0, the
 * radius has no effect. */
static double get_ambient_occlusion_radius(const session_extent *extent, const scene_image *image)
{
    if (image->occlusion_radius > 0) return image->occlusion_radius;
    return extent->half_diagonal > 0 ? extent->half_diagonal / 5 : 1;
}

static void set_rendering_parameters(const session_space *space, const scene_image *image, session_view *out)
{
    out->space.scale = space->scale;
    for (int axis = 0; axis < 3; axis++) {
        out->space.origin[axis] = space->origin[axis];
        out->space.depth_origin += (space->origin[axis] - out->camera.eye[axis]) * out->camera.forward[axis];
    }
    make_lights(image, &out->camera, out->lights);
    out->occlusion.lights = image->shadows;
    out->occlusion.samples = image->occlusion_samples;
    out->occlusion.radius = get_ambient_occlusion_radius(&space->extent, image);
    out->step = compute_sample_distance(&space->extent, image);
}

/* ---- time that samples take ---------------------------------------------------------------------------------- */

/* Estimated time in seconds that a sample takes on one thread. Measured times were 27 to 240 ns, over all types of
 * cells and for many and few rays. */
static const double sample_seconds = 1e-7;

/* Returns the length of the part of a pixel's ray that lies within the bounds. */
static double compute_ray_length_in_bounds(const session_extent *e, const render_camera *camera, int x, int y)
{
    double base[3], direction[3], begin = 0, end = INFINITY;
    render_camera_ray(camera, x, y, base, direction);
    for (int axis = 0; axis < 3; axis++) {
        const double a = (e->lower[axis] - base[axis]) / direction[axis];
        const double b = (e->upper[axis] - base[axis]) / direction[axis];
        /* if the ray is parallel to the faces, a and b are infinite with the correct signs, or NaN, which fmin() and
         * fmax() ignore */
        begin = fmax(begin, fmin(a, b));
        end = fmin(end, fmax(a, b));
    }
    return end > begin ? (end - begin) * vector3_length(direction) : 0;
}

/* Estimates the number of samples that all ranks compute, under the assumption that cells fill the bounds and no sample
 * is hidden. */
static double estimate_total_sample_count(const session_extent *e, const scene_image *image, const session_view *view)
{
    enum { PROBES = 16 };
    const render_camera *camera = &view->camera;
    double sum = 0;
    for (int i = 0; i < PROBES * PROBES; i++) {
        const int column = i % PROBES, row = i / PROBES;
        const int x = (int)((column + 0.5) * camera->width / PROBES);
        const int y = (int)((row + 0.5) * camera->height / PROBES);
        sum += compute_ray_length_in_bounds(e, camera, x, y);
    }
    const double rays = (double)image->width * image->height * image->frames;
    return sum / (PROBES * PROBES) / view->step * rays * image->volume_count;
}

static insitu_status check_sampling_time(const session_extent *e, const char *scene_path, const scene_image *image,
                                         const session_view *view, int threads, base_error *error)
{
    if (image->volume_count == 0 || image->method != SCENE_SAMPLES || e->rank_count == 0) return INSITU_OK;
    const double samples = estimate_total_sample_count(e, image, view);
    const double seconds = samples * sample_seconds / ((double)threads * e->rank_count);
    if (!(seconds > image->max_seconds)) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_SCENE,
                     "%s:%d: image \"%s\" would take some %.1e samples at a step of %g, about %.2g s on %d ranks of %d "
                     "threads; its max_seconds is %g: expected a larger step or max_seconds",
                     scene_path, image->line, image->name, samples, view->step, seconds, e->rank_count, threads,
                     image->max_seconds);
}

/* ---- views without data -------------------------------------------------------------------------------------- */

/* The corners of the bounds, projected into the picture. */
typedef struct corner_bounds {
    /* bounds of the corners in front of the eye; the borders of the picture are at -1 and 1 */
    double low[2], high[2];
    int behind_count; /* number of corners behind the eye */
    bool is_beside;   /* set if all corners are outside of the picture, beyond the same border */
} corner_bounds;

static corner_bounds project_corners_of_bounds(const session_extent *e, const render_camera *c)
{
    corner_bounds b = {{INFINITY, INFINITY}, {-INFINITY, -INFINITY}, 0, false};
    int beyond[4] = {0, 0, 0, 0};
    const double half[2] = {c->half_height * c->width / c->height, c->half_height};
    for (int corner = 0; corner < 8; corner++) {
        double offset[3];
        for (int a = 0; a < 3; a++) offset[a] = (corner >> a & 1 ? e->upper[a] : e->lower[a]) - c->eye[a];
        const double z = vector3_dot(offset, c->forward);
        const double place[2] = {vector3_dot(offset, c->right), vector3_dot(offset, c->up)};
        b.behind_count += z <= 0;
        for (int a = 0; a < 2; a++) {
            const double border = half[a] * (c->is_orthographic ? 1 : z);
            beyond[2 * a] += place[a] < -border;
            beyond[2 * a + 1] += place[a] > border;
            if (z > 0) b.low[a] = fmin(b.low[a], place[a] / border);
            if (z > 0) b.high[a] = fmax(b.high[a], place[a] / border);
        }
    }
    for (int side = 0; side < 4; side++) b.is_beside = b.is_beside || beyond[side] == 8;
    return b;
}

/* Returns the reason why the camera can see no data; NULL if some data may be in view. */
static const char *describe_why_data_is_out_of_view(const session_extent *e, const render_camera *c)
{
    const corner_bounds b = project_corners_of_bounds(e, c);
    if (b.behind_count == 8) return "they are behind it";
    if (b.is_beside) return "they are beside the picture";
    const bool is_small =
        b.behind_count == 0 && (b.high[0] - b.low[0]) * c->width < 2 && (b.high[1] - b.low[1]) * c->height < 2;
    return is_small ? "together they are smaller than a pixel" : NULL;
}

static void warn_if_data_is_out_of_view(const session_extent *e, const scene_image *image, const session_view *view,
                                        session_report *report)
{
    const char *why = e->cell_count ? describe_why_data_is_out_of_view(e, &view->camera) : NULL;
    const session_warning warning = {WARNING_VIEW, image->name, NULL, image->variant.view};
    session_warn(report, &warning, why != NULL,
                 "image \"%s\": its camera does not see the cells, which lie between (%g, %g, %g) and (%g, %g, %g): %s",
                 image->name, e->lower[0], e->lower[1], e->lower[2], e->upper[0], e->upper[1], e->upper[2],
                 why ? why : "");
}

/* ---- cameras, lights and clips together ---------------------------------------------------------------------- */

insitu_status session_make_view(const session_space *space, const char *scene_path, const scene_image *image,
                                const session_team *team, session_report *report, session_view *out, base_error *error)
{
    *out = (session_view){0};
    const insitu_status status = make_camera(&space->extent, scene_path, image, &out->camera, error);
    if (status) return status;
    set_rendering_parameters(space, image, out);
    out->clip_count = image->clip_count;
    session_make_clips(&space->extent, image, out->clips);
    session_warn_of_layers_clipped_away(&space->extent, image, out->clips, report);
    if (check_sampling_time(&space->extent, scene_path, image, out, team->threads, error) == INSITU_OK)
        warn_if_data_is_out_of_view(&space->extent, image, out, report);
    return INSITU_OK;
}
