/* Converts an image's slices from the file: their planes, and the field that colours them. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"

static const scene_material no_light = {.ambient = 1, .shininess = 1};

/* Scales a vector to unit length. It is first divided by its largest component, because the squares of very large or
 * very small numbers may overflow or underflow. */
static bool normalize_vector(const double in[3], double out[3])
{
    const double largest = fmax(fabs(in[0]), fmax(fabs(in[1]), fabs(in[2])));
    if (!(largest > 0)) return false;
    const double x = in[0] / largest, y = in[1] / largest, z = in[2] / largest;
    const double length = sqrt(x * x + y * y + z * z);
    out[0] = x / length;
    out[1] = y / length;
    out[2] = z / length;
    return true;
}

insitu_status scene_convert_plane(const scene_document *d, const char *path, int index, const scene_file_plane *in,
                                  scene_plane *out)
{
    char key[32];
    snprintf(key, sizeof key, "planes[%d].normal", index);
    if (!normalize_vector(in->normal, out->normal))
        return scene_fail_at_key(d, path, key, "[0, 0, 0] has no direction, expected a vector of any length but 0");
    out->has_point = in->point != NULL;
    if (in->point) memcpy(out->point, in->point, sizeof out->point);
    out->offset = in->offset ? *in->offset : 0;
    return INSITU_OK;
}

int scene_count_planes(const scene_file_slice *in)
{
    int count = 0;
    for (int i = 0; i < in->planes_count; i++) {
        const scene_file_plane *plane = &in->planes[i];
        count += plane->offsets ? plane->offsets_count : plane->count ? *plane->count : 1;
    }
    return count;
}

static insitu_status check_position_keys_of_plane(const scene_document *d, const char *path, int index,
                                                  const scene_file_plane *in)
{
    char plane[SCENE_PATH_SIZE];
    snprintf(plane, sizeof plane, "%s.planes[%d]", path, index);
    if (in->offsets && in->offset)
        return scene_fail_at_key(d, plane, "offsets", "given beside offset, expected one of the two");
    if (in->count && (in->offset || in->offsets || in->point))
        return scene_fail_at_key(d, plane, "count", "given beside %s, expected one of the two",
                                 in->point    ? "point"
                                 : in->offset ? "offset"
                                              : "offsets");
    return INSITU_OK;
}

/* Adds the planes that one entry of the slice's list describes; an entry may describe several. */
static insitu_status add_slice_planes(const scene_document *d, const char *path, int index, const scene_file_plane *in,
                                      scene_slice *out)
{
    scene_plane plane = {.extent_fraction = 0};
    insitu_status status = check_position_keys_of_plane(d, path, index, in);
    if (!status) status = scene_convert_plane(d, path, index, in, &plane);
    const int count = in->offsets ? in->offsets_count : in->count ? *in->count : 1;
    for (int i = 0; i < count && !status; i++) {
        if (in->offsets) plane.offset = in->offsets[i];
        if (in->count) plane.extent_fraction = (2.0 * i + 1) / count - 1;
        out->planes[out->plane_count++] = plane;
    }
    return status;
}

static insitu_status convert_planes(const scene_document *d, const char *path, const scene_file_slice *in,
                                    scene_slice *out)
{
    insitu_status status = INSITU_OK;
    out->planes = base_calloc((size_t)scene_count_planes(in), sizeof *out->planes);
    if (!out->planes) return scene_fail_for_memory(d);
    for (int i = 0; i < in->planes_count && !status; i++) status = add_slice_planes(d, path, i, &in->planes[i], out);
    return status;
}

insitu_status scene_convert_slice(const scene_document *d, const char *path, const scene_file_slice *in, int height,
                                  scene_slice *out)
{
    out->opacity = in->opacity ? (float)*in->opacity : 1;
    out->material = in->material ? scene_convert_material(in->material) : no_light;
    out->field.at_vertices = out->field.joins_corners = in->interpolate && *in->interpolate == SCENE_BY_VERTEX;
    insitu_status status = scene_convert_field(d, path, path, in->field, in->component, &out->field);
    if (status == INSITU_OK) status = scene_convert_colour_map(d, path, &in->colours, &out->colour_map);
    if (status == INSITU_OK) status = convert_planes(d, path, in, out);
    if (status == INSITU_OK) status = scene_convert_lines(d, path, in->lines, &out->field, height, &out->lines);
    return status;
}
