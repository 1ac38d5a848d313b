/* Interpolates the position of a moving camera by cubic curves through its points, one curve per coordinate.
 *
 * The slope at a point is the weighted harmonic mean of the slopes to its neighbours (Fritsch and Butland's method),
 * and 0 at the ends and at extrema of the coordinate. The curve therefore has a continuous slope, and stays between
 * the values of two neighbouring points, for any spacing of the times. A spline would be smoother still, but would
 * overshoot if a short interval of time follows a long one, so that the camera might move through the data. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"

/* ---- interpolation between points -------------------------------------------------------------------------------- */

/* Number of values of a camera point that are interpolated: eye, focal point and up direction with three coordinates
 * each, and the angle of view. */
enum { NUMBERS_OF_POINT = 10 };

static void pack_camera_point(const scene_camera_point *p, double out[NUMBERS_OF_POINT])
{
    memcpy(out, p->eye, sizeof p->eye);
    memcpy(out + 3, p->focal, sizeof p->focal);
    memcpy(out + 6, p->up, sizeof p->up);
    out[9] = p->angle;
}

/* Times and values of four successive points of a camera's path; the value between the second and the third point is
 * interpolated. has_first, has_last: whether the first and the last of the four points exist. */
typedef struct cubic_points {
    double times[4], values[4];
    bool has_first, has_last;
} cubic_points;

/* Returns the slope of the curve at point i, which is 1 or 2. */
static double compute_slope_at_point(const cubic_points *p, int i)
{
    const double before = p->times[i] - p->times[i - 1], after = p->times[i + 1] - p->times[i];
    const double down = (p->values[i] - p->values[i - 1]) / before, up = (p->values[i + 1] - p->values[i]) / after;
    if (!(down * up > 0)) return 0;
    const double w = 2 * after + before, v = after + 2 * before;
    return (w + v) / (w / down + v / up);
}

/* Returns the interpolated value between the second point (share is 0) and the third point (share is 1). The result is
 * clamped, so that rounding does not take it beyond the values of these points. */
static double interpolate_cubic(const cubic_points *p, double share)
{
    const double h = p->times[2] - p->times[1], a = p->values[1], b = p->values[2], t = share;
    const double from = p->has_first ? h * compute_slope_at_point(p, 1) : 0,
                 to = p->has_last ? h * compute_slope_at_point(p, 2) : 0;
    const double value = a + (b - a) * t * t * (3 - 2 * t) + t * (1 - t) * ((1 - t) * from - t * to);
    return fmax(fmin(a, b), fmin(fmax(a, b), value));
}

static void set_camera_to_point(const scene_camera_point *p, scene_camera *out)
{
    memcpy(out->eye, p->eye, sizeof out->eye);
    memcpy(out->focal, p->focal, sizeof out->focal);
    memcpy(out->up, p->up, sizeof out->up);
    out->angle = p->angle;
}

/* Interpolates the camera between its points i and i + 1. at: the time or cycle for which the camera is computed. */
static void interpolate_camera(const scene_camera *camera, int i, double at, scene_camera *out)
{
    double numbers[4][NUMBERS_OF_POINT], found[NUMBERS_OF_POINT];
    cubic_points p = {.has_first = i > 0, .has_last = i + 2 < camera->point_count};
    for (int k = 0; k < 4; k++) {
        const int n = i - 1 + k < 0 ? 0 : i - 1 + k < camera->point_count ? i - 1 + k : camera->point_count - 1;
        pack_camera_point(&camera->points[n], numbers[k]);
        p.times[k] = camera->points[n].at;
    }
    const double share = (at - p.times[1]) / (p.times[2] - p.times[1]);
    for (int n = 0; n < NUMBERS_OF_POINT; n++) {
        for (int k = 0; k < 4; k++) p.values[k] = numbers[k][n];
        found[n] = interpolate_cubic(&p, share);
    }
    memcpy(out->eye, found, sizeof out->eye);
    memcpy(out->focal, found + 3, sizeof out->focal);
    memcpy(out->up, found + 6, sizeof out->up);
    out->angle = found[9];
}

scene_camera scene_compute_camera_at_time(const scene_camera *camera, int64_t cycle, double time)
{
    scene_camera out = *camera;
    if (camera->point_count == 0) return out;
    const double at = camera->is_by_cycle ? (double)cycle : time;
    const scene_camera_point *points = camera->points;
    int i = 0;
    while (i < camera->point_count - 1 && at >= points[i + 1].at) i++;
    if (i == camera->point_count - 1 || !(at > points[0].at))
        set_camera_to_point(&points[i], &out);
    else
        interpolate_camera(camera, i, at, &out);
    return out;
}

/* ---- reading the points ------------------------------------------------------------------------------------------ */

static insitu_status convert_time_of_camera_point(const scene_document *d, const char *path, const scene_file_point *in,
                                                  const scene_camera *camera, scene_camera_point *out)
{
    const scene_camera_point *before = out > camera->points ? out - 1 : NULL;
    const char *key = camera->is_by_cycle ? "cycle" : "time";
    if (in->time && in->cycle) return scene_fail_at_key(d, path, "cycle", "given beside time, expected one of the two");
    if (!in->time && !in->cycle)
        return scene_fail_at_key(d, path, "", "has no time and no cycle, expected one of the two");
    if (camera->is_by_cycle != !in->time)
        return scene_fail_at_key(d, path, in->time ? "time" : "cycle",
                                 "given where the first place has a %s, expected a %s", key, key);
    out->at = in->time ? *in->time : *in->cycle;
    if (before && !(out->at > before->at))
        return scene_fail_at_key(d, path, key, "%.12g comes after %.12g, expected places in the order of time", out->at,
                                 before->at);
    return INSITU_OK;
}

static insitu_status convert_camera_point(const scene_document *d, const char *path, const scene_file_point *in,
                                          const scene_camera *camera, scene_camera_point *out)
{
    double view[3];
    memcpy(out->eye, in->position, sizeof out->eye);
    memcpy(out->focal, in->focal, sizeof out->focal);
    memcpy(out->up, in->up ? in->up : camera->up, sizeof out->up);
    out->angle = in->angle ? *in->angle : camera->angle;
    for (int i = 0; i < 3; i++) view[i] = out->eye[i] - out->focal[i];
    if (!scene_normalize_vector(view))
        return scene_fail_at_key(d, path, "focal", "[%g, %g, %g] is the position too, expected another point",
                                 out->focal[0], out->focal[1], out->focal[2]);
    if (!scene_normalize_vector(out->up)) return scene_fail_at_key(d, path, "up", "has length 0, expected a direction");
    if (scene_are_vectors_parallel(out->up, view))
        return scene_fail_at_key(d, path, "up", "[%g, %g, %g] is parallel to the view, expected a direction across it",
                                 out->up[0], out->up[1], out->up[2]);
    return convert_time_of_camera_point(d, path, in, camera, out);
}

insitu_status scene_convert_path(const scene_document *d, const char *path, const scene_file_camera *in,
                                 scene_camera *out)
{
    static const double upwards[3] = {0, 1, 0};
    static const char words[] = "given beside path, expected one of the two";
    if (in->position) return scene_fail_at_key(d, path, "position", words);
    if (in->focal) return scene_fail_at_key(d, path, "focal", words);
    if (in->automatic) return scene_fail_at_key(d, path, "automatic", words);
    out->points = base_calloc((size_t)in->path_count, sizeof *out->points);
    if (!out->points) return scene_fail_for_memory(d);
    out->is_automatic = false;
    out->is_by_cycle = !in->path[0].time;
    memcpy(out->up, in->up ? in->up : upwards, sizeof out->up);
    insitu_status status = INSITU_OK;
    for (int i = 0; i < in->path_count && !status; i++) {
        char point[SCENE_PATH_SIZE];
        snprintf(point, sizeof point, "%s.path[%d]", path, i);
        status = convert_camera_point(d, point, &in->path[i], out, &out->points[i]);
    }
    out->point_count = in->path_count;
    return status;
}
