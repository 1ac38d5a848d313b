/* Reads an orbit: one or several circles of views around the data. Each view is an automatic camera with its own
 * direction. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "scene_convert.h"
#include "vector3.h"

/* Finds the directions perpendicular to the axis at phi = 0 and 90 degrees. If a is the coordinate axis nearest to the
 * orbit's axis, the first direction is as close as possible to the coordinate axis that follows a (x -> y -> z -> x).
 * For an axis along z, phi is the longitude of spherical coordinates. */
static void compute_perpendicular_directions(const double axis[3], double first[3], double second[3])
{
    int nearest = 0;
    for (int a = 1; a < 3; a++)
        if (fabs(axis[a]) > fabs(axis[nearest])) nearest = a;
    for (int a = 0; a < 3; a++) first[a] = a == (nearest + 1) % 3;
    const double along = vector3_dot(first, axis);
    for (int a = 0; a < 3; a++) first[a] -= along * axis[a];
    const double length = sqrt(vector3_dot(first, first));
    for (int a = 0; a < 3; a++) first[a] /= length;
    for (int a = 0; a < 3; a++)
        second[a] = axis[(a + 1) % 3] * first[(a + 2) % 3] - axis[(a + 2) % 3] * first[(a + 1) % 3];
}

void scene_set_orbit_view(scene_camera *camera, int view)
{
    static const double degree = 3.14159265358979323846 / 180;
    const scene_orbit *o = &camera->orbit;
    double first[3], second[3];
    compute_perpendicular_directions(o->axis, first, second);
    camera->phi = o->start + 360.0 * (view % o->view_count) / o->view_count;
    camera->theta = o->elevations[view / o->view_count];
    const double phi = camera->phi * degree, theta = camera->theta * degree;
    for (int a = 0; a < 3; a++)
        camera->direction[a] = cos(theta) * (cos(phi) * first[a] + sin(phi) * second[a]) + sin(theta) * o->axis[a];
}

static int count_elevations_of_orbit(const scene_document *d, const char *path, char elevation[SCENE_PATH_SIZE])
{
    snprintf(elevation, SCENE_PATH_SIZE, "%s.orbit.elevation", path);
    const int count = scene_get_list_length_at_path(d, elevation);
    return count ? count : 1;
}

int scene_count_orbit_views(const scene_document *d, const char *path, const scene_file_camera *in)
{
    char elevation[SCENE_PATH_SIZE];
    return in && in->orbit ? in->orbit->views * count_elevations_of_orbit(d, path, elevation) : 1;
}

static void convert_elevations(const scene_document *d, const char *path, scene_orbit *out)
{
    char elevation[SCENE_PATH_SIZE], item[SCENE_PATH_SIZE + 16];
    out->circle_count = count_elevations_of_orbit(d, path, elevation);
    out->elevations[0] = 30;
    if (scene_get_node_type_at_path(d, elevation) == SCENE_SCALAR)
        out->elevations[0] = scene_get_number_at_path(d, elevation);
    if (scene_get_node_type_at_path(d, elevation) != SCENE_LIST) return;
    for (int i = 0; i < out->circle_count; i++) {
        snprintf(item, sizeof item, "%s[%d]", elevation, i);
        out->elevations[i] = scene_get_number_at_path(d, item);
    }
}

/* Returns an error if the camera has keys that its orbit replaces. */
static insitu_status fail_for_keys_replaced_by_orbit(const scene_document *d, const char *path,
                                                     const scene_file_camera *in)
{
    static const char words[] = "given beside orbit, expected one of the two";
    if (in->position) return scene_fail_at_key(d, path, "position", words);
    if (in->focal) return scene_fail_at_key(d, path, "focal", words);
    if (in->path) return scene_fail_at_key(d, path, "path", words);
    if (in->up) return scene_fail_at_key(d, path, "up", "given beside orbit, expected the orbit's axis alone");
    if (in->automatic && in->automatic->direction)
        return scene_fail_at_key(d, path, "automatic.direction", "given beside orbit, expected fit and zoom alone");
    return INSITU_OK;
}

insitu_status scene_convert_orbit(const scene_document *d, const char *path, const scene_file_camera *in,
                                  scene_camera *out)
{
    static const double upwards[3] = {0, 1, 0};
    scene_orbit *orbit = &out->orbit;
    const insitu_status status = fail_for_keys_replaced_by_orbit(d, path, in);
    if (status) return status;
    orbit->view_count = in->orbit->views;
    orbit->start = in->orbit->start ? *in->orbit->start : 0;
    memcpy(orbit->axis, in->orbit->axis ? in->orbit->axis : upwards, sizeof orbit->axis);
    if (!scene_normalize_vector(orbit->axis))
        return scene_fail_at_key(d, path, "orbit.axis", "has length 0, expected a direction");
    convert_elevations(d, path, orbit);
    memcpy(out->up, orbit->axis, sizeof out->up);
    scene_set_orbit_view(out, 0);
    return INSITU_OK;
}
