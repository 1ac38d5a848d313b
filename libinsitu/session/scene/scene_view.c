/* Reads the camera and the lights of an image. */
#include "scene_convert.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "colour_map.h"
#include "memory.h"

static void copy_vector(double to[3], const double *from)
{
    memcpy(to, from, 3 * sizeof *to);
}

static insitu_status convert_up_direction(const scene_document *d, const char *path, const double *given,
                                          scene_camera *out)
{
    static const double along_y[3] = {0, 1, 0}, along_z[3] = {0, 0, 1};
    if (!given) {
        copy_vector(out->up, scene_are_vectors_parallel(along_y, out->direction) ? along_z : along_y);
        return INSITU_OK;
    }
    copy_vector(out->up, given);
    if (!scene_normalize_vector(out->up)) return scene_fail_at_key(d, path, "up", "has length 0, expected a direction");
    if (scene_are_vectors_parallel(out->up, out->direction)) {
        return scene_fail_at_key(d, path, "up", "[%g, %g, %g] is parallel to the view, expected a direction across it",
                                 given[0], given[1], given[2]);
    }
    return INSITU_OK;
}

static insitu_status convert_explicit_camera_position(const scene_document *d, const char *path,
                                                      const scene_file_camera *in, scene_camera *out)
{
    if (in->automatic) {
        return scene_fail_at_key(d, path, "automatic", "given beside %s, expected one of the two",
                                 in->position ? "position" : "focal");
    }
    if (!in->position) return scene_fail_at_key(d, path, "position", "missing, expected beside focal");
    if (!in->focal) return scene_fail_at_key(d, path, "focal", "missing, expected beside position");
    out->is_automatic = false;
    copy_vector(out->eye, in->position);
    copy_vector(out->focal, in->focal);
    for (int i = 0; i < 3; i++) out->direction[i] = out->eye[i] - out->focal[i];
    for (int i = 0; i < 3; i++) {
        if (!isfinite(out->direction[i])) {
            return scene_fail_at_key(d, path, "position", "too far from focal, expected a finite distance");
        }
    }
    if (scene_normalize_vector(out->direction)) return INSITU_OK;
    return scene_fail_at_key(d, path, "focal", "[%g, %g, %g] is the position too, expected another point",
                             out->focal[0], out->focal[1], out->focal[2]);
}

static insitu_status convert_camera_bounds(const scene_document *d, const char *path, const double (*in)[3],
                                           scene_camera *out)
{
    if (!in) return INSITU_OK;
    out->has_bounds = true;
    copy_vector(out->lower, in[0]);
    copy_vector(out->upper, in[1]);
    for (int a = 0; a < 3; a++)
        if (!(out->lower[a] <= out->upper[a]))
            return scene_fail_at_key(d, path, "automatic.bounds",
                                     "goes from %g to %g along %c, expected the first corner to be the lower one",
                                     out->lower[a], out->upper[a], "xyz"[a]);
    return INSITU_OK;
}

static insitu_status convert_automatic_camera(const scene_document *d, const char *path, const scene_file_automatic *in,
                                              scene_camera *out)
{
    out->has_direction = in && in->direction;
    out->has_fit = in && in->fit;
    if (out->has_direction) copy_vector(out->direction, in->direction);
    if (in && in->zoom) out->zoom = *in->zoom;
    out->fits_box = in && in->fit && *in->fit == SCENE_FIT_BOX;
    if (scene_normalize_vector(out->direction))
        return convert_camera_bounds(d, path, in ? (const double(*)[3])in->bounds : NULL, out);
    return scene_fail_at_key(d, path, "automatic.direction", "has length 0, expected a direction");
}

/* Converts the camera's position and up direction. */
static insitu_status convert_camera_position(const scene_document *d, const char *path, const scene_file_camera *in,
                                             scene_camera *out)
{
    const bool is_explicit = (in->position || in->focal) && !in->path && !in->orbit;
    insitu_status status = INSITU_OK;
    if (is_explicit)
        status = convert_explicit_camera_position(d, path, in, out);
    else if (!in->path)
        status = convert_automatic_camera(d, path, in->automatic, out);
    if (!status && in->orbit) return scene_convert_orbit(d, path, in, out);
    if (!status && in->path) return scene_convert_path(d, path, in, out);
    return status ? status : convert_up_direction(d, path, in->up, out);
}

insitu_status scene_convert_camera(const scene_document *d, const char *path, const scene_file_camera *in,
                                   scene_camera *out)
{
    static const scene_file_camera none;
    *out = (scene_camera){.is_automatic = true, .direction = {1, 0.8, 1.2}, .angle = 40, .zoom = 1};
    if (!in) in = &none;
    if (in->angle) out->angle = *in->angle;
    out->has_up = in->up != NULL;
    insitu_status status = convert_camera_position(d, path, in, out);
    out->has_projection = in->projection != NULL;
    out->is_orthographic = in->projection && *in->projection == SCENE_ORTHOGRAPHIC;
    out->height = in->height ? *in->height : 0;
    if (status == INSITU_OK && in->height && !out->is_orthographic)
        status = scene_fail_at_key(d, path, "height", "given without projection: orthographic, expected beside that");
    return status;
}

static insitu_status convert_light(const scene_document *d, const char *path, const scene_file_light *in,
                                   scene_light *out)
{
    const double intensity = in->intensity ? *in->intensity : 1;
    copy_vector(out->direction, in->direction);
    out->is_in_world = in->in && *in->in == SCENE_FRAME_WORLD;
    for (int i = 0; i < 3; i++) {
        const float linear = in->colour ? colour_linear_from_srgb((float)in->colour[i]) : 1;
        out->colour[i] = (float)intensity * linear;
    }
    return scene_normalize_vector(out->direction)
               ? INSITU_OK
               : scene_fail_at_key(d, path, "direction", "has length 0, expected a direction");
}

/* Sets the default lights: a key light and a fill light. The fill light brightens surfaces that the key light does not
 * reach, but is too weak to make shapes look flat. */
static void set_default_lights(scene_light lights[2])
{
    lights[0] = (scene_light){.direction = {0.5, 0.7, 1}, .colour = {1, 1, 1}};
    lights[1] = (scene_light){.direction = {-0.8, 0.1, 0.6}, .colour = {0.35F, 0.35F, 0.35F}};
    scene_normalize_vector(lights[0].direction);
    scene_normalize_vector(lights[1].direction);
}

insitu_status scene_convert_lights(const scene_document *d, const char *path, const scene_file_image *in,
                                   scene_image *out)
{
    const int count = in->lights ? in->lights_count : 2;
    out->lights = base_calloc((size_t)count, sizeof *out->lights);
    if (!out->lights) return scene_fail_for_memory(d);
    out->light_count = count;
    out->has_lights = in->lights != NULL;
    if (!in->lights) {
        set_default_lights(out->lights);
        return INSITU_OK;
    }
    insitu_status status = INSITU_OK;
    for (int i = 0; i < count && status == INSITU_OK; i++) {
        char light_path[SCENE_PATH_SIZE];
        snprintf(light_path, sizeof light_path, "%s.lights[%d]", path, i);
        status = convert_light(d, light_path, &in->lights[i], &out->lights[i]);
    }
    return status;
}

insitu_status scene_convert_shadows(const scene_document *d, const char *path, const scene_file_image *in,
                                    scene_image *out)
{
    const scene_file_occlusion *occlusion = in->ambient_occlusion;
    const bool has_shadows = in->shadows && *in->shadows;
    out->shadows = has_shadows ? (1U << out->light_count) - 1 : 0;
    for (int i = 0; i < in->lights_count; i++) {
        if (in->lights[i].shadows && !in->shadows) {
            char light_path[SCENE_PATH_SIZE];
            snprintf(light_path, sizeof light_path, "%s.lights[%d]", path, i);
            return scene_fail_at_key(d, light_path, "shadows",
                                     "given without shadows of the image, expected beside these");
        }
        if (in->lights[i].shadows && !*in->lights[i].shadows) out->shadows &= ~(1U << i);
    }
    if (!occlusion) return INSITU_OK;
    out->occlusion_samples = occlusion->samples ? *occlusion->samples : 16;
    out->occlusion_radius = occlusion->radius ? *occlusion->radius : 0;
    return INSITU_OK;
}
