/* The scene's words to the renderer's numbers. All of it is arithmetic on what ranks share, so nothing is exchanged. */
#include "session_view.h"

#include <float.h>

#include "colour_map.h"

static double length(const double v[3])
{
    return hypot(hypot(v[0], v[1]), v[2]);
}

/* Distance from which a sphere just fits into the narrower of the two angles of view. */
static double fitting_distance(double radius, double angle_degrees, int width, int height)
{
    double half = 0.5 * angle_degrees * 3.14159265358979323846 / 180;
    if (width < height) half = atan(tan(half) * width / height);
    return radius / sin(half);
}

/* up, or an axis that is not along the view where up is. */
static void choose_up(const double direction[3], const double up[3], double out[3])
{
    const double cross[3] = {direction[1] * up[2] - direction[2] * up[1], direction[2] * up[0] - direction[0] * up[2],
                             direction[0] * up[1] - direction[1] * up[0]};
    for (int axis = 0; axis < 3; axis++) out[axis] = up[axis];
    if (length(cross) > 1e-6 * length(direction) * length(up)) return;
    int least = 0;
    for (int axis = 1; axis < 3; axis++)
        if (fabs(direction[axis]) < fabs(direction[least])) least = axis;
    for (int axis = 0; axis < 3; axis++) out[axis] = axis == least;
}

static bool automatic_camera(const session_extent *extent, const scene_image *image, render_camera *out)
{
    const scene_camera *c = &image->camera;
    double focal[3], eye[3], up[3];
    const double radius = extent->half_diagonal > 0 ? extent->half_diagonal : 1;
    const double distance = fitting_distance(radius, c->angle, image->width, image->height) / c->zoom;
    for (int axis = 0; axis < 3; axis++) {
        focal[axis] = 0.5 * extent->lower[axis] + 0.5 * extent->upper[axis];
        eye[axis] = focal[axis] + c->direction[axis] / length(c->direction) * distance;
    }
    choose_up(c->direction, c->up, up);
    return render_camera_look_at(out, eye, focal, up, c->angle, image->width, image->height);
}

static insitu_status make_camera(const insitu_session *session, const scene_image *image, render_camera *out,
                                 base_error *error)
{
    const scene_camera *c = &image->camera;
    const bool is_made =
        c->is_automatic ? automatic_camera(&session->extent, image, out)
                        : render_camera_look_at(out, c->eye, c->focal, c->up, c->angle, image->width, image->height);
    if (is_made) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_SCENE,
                     "%s:%d: image \"%s\": its camera stands at its focal point or looks along its up direction",
                     session->scene_path, image->line, image->name);
}

static void make_lights(const scene_image *image, const render_camera *camera, render_light *lights)
{
    for (int i = 0; i < image->light_count; i++) {
        const scene_light *light = &image->lights[i];
        const double *d = light->direction;
        for (int axis = 0; axis < 3; axis++) {
            lights[i].colour[axis] = light->colour[axis];
            lights[i].direction[axis] =
                light->in_world ? d[axis]
                                : d[0] * camera->right[axis] + d[1] * camera->up[axis] - d[2] * camera->forward[axis];
        }
    }
}

/* Cells of no volume have no size: then a hundredth of the diagonal takes its place. */
static double sample_distance(const session_extent *extent, const scene_image *image)
{
    if (image->step > 0) return image->step;
    const double cell = extent->cell_size > 0 ? extent->cell_size : extent->half_diagonal / 50;
    return cell > 0 ? image->step_cells * cell : 1;
}

insitu_status session_make_view(const insitu_session *session, const scene_image *image, session_view *out,
                                base_error *error)
{
    *out = (session_view){0};
    const insitu_status status = make_camera(session, image, &out->camera, error);
    if (status) return status;
    out->space.scale = session->scale;
    for (int axis = 0; axis < 3; axis++) {
        out->space.origin[axis] = session->origin[axis];
        out->space.depth_origin += (session->origin[axis] - out->camera.eye[axis]) * out->camera.forward[axis];
    }
    make_lights(image, &out->camera, out->lights);
    out->step = sample_distance(&session->extent, image);
    return INSITU_OK;
}

/* ---- time ---------------------------------------------------------------------------------------------------- */

/* What a sample takes on one thread: 27 to 240 ns as measured, on all types of cells, where there are many rays and
 * few. */
static const double sample_seconds = 1e-7;

/* The length of the pixel's ray within the bounds. */
static double chord_of_bounds(const session_extent *e, const render_camera *camera, int x, int y)
{
    double base[3], direction[3], begin = 0, end = INFINITY;
    render_camera_ray(camera, x, y, base, direction);
    for (int axis = 0; axis < 3; axis++) {
        const double a = (e->lower[axis] - base[axis]) / direction[axis];
        const double b = (e->upper[axis] - base[axis]) / direction[axis];
        begin = fmax(begin, fmin(a, b)); /* parallel to the faces: infinities of the right signs, or NaN, passed over */
        end = fmin(end, fmax(a, b));
    }
    return end > begin ? (end - begin) * length(direction) : 0;
}

/* Of all rays, on all ranks, as if the bounds were full of cells and nothing hid a sample. */
static double estimate_samples(const session_extent *e, const scene_image *image, const session_view *view)
{
    enum { PROBES = 16 };
    const render_camera *camera = &view->camera;
    double sum = 0;
    for (int i = 0; i < PROBES * PROBES; i++) {
        const int x = (int)((i % PROBES + 0.5) * camera->width / PROBES);
        const int y = (int)((i / PROBES + 0.5) * camera->height / PROBES);
        sum += chord_of_bounds(e, camera, x, y);
    }
    const double rays = (double)image->width * image->height * image->frames;
    return sum / (PROBES * PROBES) / view->step * rays * image->volume_count;
}

insitu_status session_check_time(const insitu_session *session, const scene_image *image, const session_view *view,
                                 base_error *error)
{
    const session_extent *e = &session->extent;
    if (image->volume_count == 0 || image->method != SCENE_SAMPLES || e->rank_count == 0) return INSITU_OK;
    const double samples = estimate_samples(e, image, view);
    const double seconds = samples * sample_seconds / ((double)session->threads * e->rank_count);
    if (!(seconds > image->max_seconds)) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_SCENE,
                     "%s:%d: image \"%s\" would take some %.1e samples at a step of %g, about %.2g s on %d ranks of %d "
                     "threads; its max_seconds is %g: expected a larger step, or more of that",
                     session->scene_path, image->line, image->name, samples, view->step, seconds, e->rank_count,
                     session->threads, image->max_seconds);
}

/* ---- transfer functions -------------------------------------------------------------------------------------- */

static const char *map_name(scene_colour_map map)
{
    switch (map) {
    case SCENE_VIRIDIS: return "viridis";
    case SCENE_INFERNO: return "inferno";
    case SCENE_COOL_TO_WARM: return "cool_to_warm";
    case SCENE_GREY: return "grey";
    }
    return "viridis";
}

/* A constant field has its value in the middle of a range that float32 numbers can tell from nothing. */
static void widen(double *low, double *high)
{
    if (*low > *high) {
        *low = 0;
        *high = 1;
    }
    const double least = fmax(1e-6 * fmax(fabs(*low), fabs(*high)), FLT_MIN);
    if (*high - *low >= least) return;
    const double middle = 0.5 * *low + 0.5 * *high;
    *low = middle - 0.5 * least;
    *high = middle + 0.5 * least;
}

insitu_status session_make_transfer(const insitu_session *session, scene_colour_map map, double low, double high,
                                    const scene_volume *volume, session_transfer *out, base_error *error)
{
    render_transfer *t = &out->transfer;
    *out = (session_transfer){0};
    widen(&low, &high);
    t->low = low;
    t->high = high;
    t->colours = colour_map_table(map_name(map), &t->colour_count);
    if (!t->colours) return base_fail(error, INSITU_ERROR_INTERNAL, "no colour map is called %s", map_name(map));
    t->unit_distance = 1;
    if (!volume) return INSITU_OK;
    t->opacity_count = volume->opacity_count;
    for (int i = 0; i < volume->opacity_count; i++) {
        out->opacity_values[i] = low + volume->opacity[i].at * (high - low);
        out->opacities[i] = volume->opacity[i].opacity;
    }
    t->opacity_values = out->opacity_values;
    t->opacities = out->opacities;
    t->unit_distance = volume->unit_distance > 0 ? volume->unit_distance : session->extent.half_diagonal / 10;
    if (!(t->unit_distance > 0)) t->unit_distance = 1;
    return INSITU_OK;
}
