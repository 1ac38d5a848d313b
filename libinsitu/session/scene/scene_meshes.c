/* Reads the key `meshes`, which describes how meshes are drawn: warped, mirrored, or both. */
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"

static const char *const axis_names[3] = {"x", "y", "z"};

/* Writes the path of an entry of the mapping `meshes`. The path contains the entry's name if the name has no special
 * characters, and otherwise the entry's index. */
static void write_path_of_mesh_entry(const char *name, int index, char path[SCENE_PATH_SIZE])
{
    if (scene_is_valid_path_name(name))
        snprintf(path, SCENE_PATH_SIZE, "meshes.%s", name);
    else
        snprintf(path, SCENE_PATH_SIZE, "meshes[%d]", index);
}

static insitu_status convert_warp(const scene_document *d, const char *path, const scene_file_mesh *in, scene *s)
{
    char field_path[SCENE_PATH_SIZE + 16];
    snprintf(field_path, sizeof field_path, "%s.warp.field", path);
    scene_warp *warp = &s->warps[s->warp_count++];
    *warp = (scene_warp){.mesh = base_strdup(in->name),
                         .field = base_strdup(in->warp->field),
                         .scale = in->warp->scale ? *in->warp->scale : 1,
                         .line = scene_get_line_number_at_path(d, path),
                         .field_line = scene_get_line_number_at_path(d, field_path)};
    return warp->mesh && warp->field ? INSITU_OK : scene_fail_for_memory(d);
}

/* Reads a mirror for which the scene gives only axes. Its mirror planes are at the coordinate 0. */
static insitu_status read_mirror_axes(const scene_document *d, const char *path, scene_mirror *out)
{
    const char *texts[3];
    const int count = scene_list_texts_at_path(d, path, texts, 3);
    for (int i = 0; i < count; i++) {
        const int bit = 1 << (texts[i][0] - 'x');
        if (out->axes & bit) return scene_fail_at_key(d, path, "", "%s is given twice, expected it once", texts[i]);
        out->axes |= bit;
    }
    return INSITU_OK;
}

static insitu_status read_mirror_planes(const scene_document *d, const char *path, scene_mirror *out)
{
    for (int axis = 0; axis < 3; axis++) {
        char plane_path[SCENE_PATH_SIZE + 24];
        snprintf(plane_path, sizeof plane_path, "%s.%s", path, axis_names[axis]);
        if (scene_get_node_type_at_path(d, plane_path) == SCENE_NOTHING) continue;
        out->axes |= 1 << axis;
        out->planes[axis] = scene_get_number_at_path(d, plane_path);
    }
    if (out->axes) return INSITU_OK;
    return scene_fail_at_key(d, path, "", "holds nothing, expected x, y or z with the coordinate of a plane");
}

static insitu_status convert_mirror(const scene_document *d, const char *path, const scene_file_mesh *in, scene *s)
{
    char mirror_path[SCENE_PATH_SIZE + 16];
    snprintf(mirror_path, sizeof mirror_path, "%s.mirror", path);
    scene_mirror *mirror = &s->mirrors[s->mirror_count++];
    *mirror = (scene_mirror){.mesh = base_strdup(in->name), .line = scene_get_line_number_at_path(d, path)};
    if (!mirror->mesh) return scene_fail_for_memory(d);
    if (scene_get_node_type_at_path(d, mirror_path) == SCENE_MAPPING) return read_mirror_planes(d, mirror_path, mirror);
    return read_mirror_axes(d, mirror_path, mirror);
}

static insitu_status convert_transforms_of_mesh(const scene_document *d, const scene_file *in, int index, scene *s)
{
    const scene_file_mesh *mesh = &in->meshes[index];
    char path[SCENE_PATH_SIZE], mirror_path[SCENE_PATH_SIZE + 16];
    insitu_status status = INSITU_OK;
    write_path_of_mesh_entry(mesh->name, index, path);
    for (int i = 0; i < index; i++)
        if (strcmp(in->meshes[i].name, mesh->name) == 0)
            return scene_fail_at_key(d, path, "", "the name is given twice, expected it once");
    snprintf(mirror_path, sizeof mirror_path, "%s.mirror", path);
    const bool is_mirrored = scene_get_node_type_at_path(d, mirror_path) != SCENE_NOTHING;
    if (!mesh->warp && !is_mirrored) return scene_fail_at_key(d, path, "", "holds nothing, expected warp or mirror");
    if (mesh->warp) status = convert_warp(d, path, mesh, s);
    return status || !is_mirrored ? status : convert_mirror(d, path, mesh, s);
}

insitu_status scene_convert_mesh_transforms(const scene_document *d, const scene_file *in, scene *out)
{
    insitu_status status = INSITU_OK;
    if (in->meshes_count == 0) return INSITU_OK;
    out->warps = base_calloc((size_t)in->meshes_count, sizeof *out->warps);
    out->mirrors = base_calloc((size_t)in->meshes_count, sizeof *out->mirrors);
    if (!out->warps || !out->mirrors) return scene_fail_for_memory(d);
    for (int i = 0; i < in->meshes_count && !status; i++) status = convert_transforms_of_mesh(d, in, i, out);
    return status;
}

void scene_free_mesh_transforms(scene *s)
{
    for (int i = 0; i < s->warp_count; i++) {
        base_free(s->warps[i].mesh);
        base_free(s->warps[i].field);
    }
    for (int i = 0; i < s->mirror_count; i++) base_free(s->mirrors[i].mesh);
    base_free(s->warps);
    base_free(s->mirrors);
}
