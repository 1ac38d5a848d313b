/* Reads the warps of meshes. */
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"

/* Writes the path of the entry, by its name if that is plain. */
static void write_path(const char *name, int index, char path[SCENE_PATH_SIZE])
{
    if (scene_is_plain_name(name))
        snprintf(path, SCENE_PATH_SIZE, "meshes.%s", name);
    else
        snprintf(path, SCENE_PATH_SIZE, "meshes[%d]", index);
}

static insitu_status convert_warp(const scene_document *d, int index, const scene_file_mesh *in, scene *s)
{
    char path[SCENE_PATH_SIZE], field_path[SCENE_PATH_SIZE + 16];
    write_path(in->name, index, path);
    for (int i = 0; i < s->warp_count; i++)
        if (strcmp(s->warps[i].mesh, in->name) == 0)
            return scene_fail_at_key(d, path, "", "the name is given twice, expected it once");
    snprintf(field_path, sizeof field_path, "%s.warp.field", path);
    scene_warp *warp = &s->warps[s->warp_count++];
    *warp = (scene_warp){.mesh = base_strdup(in->name),
                         .field = base_strdup(in->warp->field),
                         .scale = in->warp->scale ? *in->warp->scale : 1,
                         .line = scene_document_line(d, path),
                         .field_line = scene_document_line(d, field_path)};
    return warp->mesh && warp->field ? INSITU_OK : scene_fail_for_memory(d);
}

insitu_status scene_convert_warps(const scene_document *d, const scene_file *in, scene *out)
{
    insitu_status status = INSITU_OK;
    if (in->meshes_count == 0) return INSITU_OK;
    out->warps = base_calloc((size_t)in->meshes_count, sizeof *out->warps);
    if (!out->warps) return scene_fail_for_memory(d);
    for (int i = 0; i < in->meshes_count && !status; i++) status = convert_warp(d, i, &in->meshes[i], out);
    return status;
}

void scene_free_warps(scene *s)
{
    for (int i = 0; i < s->warp_count; i++) {
        base_free(s->warps[i].mesh);
        base_free(s->warps[i].field);
    }
    base_free(s->warps);
}
