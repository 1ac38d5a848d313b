#include "session_candidates.h"

#include <string.h>

#include "memory.h"
#include "render.h"
#include "session_distances.h"
#include "session_hash.h"
#include "session_scalars.h"
#include "session_shells.h"
#include "session_thresholds.h"
#include "session_transfer.h"

_Static_assert((int)SCENE_MAX_SURFACES == (int)RENDER_MAX_ISOVALUES &&
                   (int)SCENE_MAX_VOLUMES == (int)RENDER_MAX_VOLUMES,
               "a scene may have as many surfaces and volumes as can be drawn");

/* ---- visible values -------------------------------------------------------------------------------------------- */

/* Returns whether the scalar's list of visible intervals already contains the interval. This happens if a scene sweeps
 * over fields, because the images of the sweep share their isosurfaces. */
static bool scalar_has_interval(const session_scalar *scalar, const mmbvh_interval *interval)
{
    for (int i = 0; i < scalar->interval_count; i++)
        if (scalar->intervals[i].low == interval->low && scalar->intervals[i].high == interval->high) return true;
    return false;
}

static bool add_intervals(session_scalar *scalar, const mmbvh_interval *more, int count)
{
    if (count == 1 && scalar_has_interval(scalar, more)) return true;
    const size_t sum = (size_t)scalar->interval_count + (size_t)count;
    mmbvh_interval *intervals = base_realloc(scalar->intervals, (sum ? sum : 1) * sizeof *intervals);
    if (!intervals) return false;
    scalar->intervals = intervals;
    memcpy(intervals + scalar->interval_count, more, (size_t)count * sizeof *more);
    scalar->interval_count += count;
    return true;
}

static bool add_isovalue_intervals(session_scalar *scalar, const scene_isosurface *layer)
{
    /* Normals by central differences also need values in neighbours of the cells that the isosurface crosses, so all
     * cells are kept as candidates. */
    if (layer->normals == SCENE_DIFFERENCES) scalar->needs_all_cells = true;
    bool is_added = true;
    for (int i = 0; i < layer->value_count && is_added; i++) {
        const mmbvh_interval interval = render_isovalue_interval(layer->values[i]);
        is_added = add_intervals(scalar, &interval, 1);
    }
    return is_added;
}

static bool add_visible_intervals(session_scalar *scalar, const scene_volume *layer)
{
    mmbvh_interval intervals[RENDER_MAX_INTERVALS];
    const int count = session_find_visible_intervals(layer, intervals);
    /* If the colour range is computed from the data, it is not known yet, because it requires a reduction over all
     * ranks. The visible values are then unknown too, and all cells are kept as candidates. */
    if (!layer->colour_map.range.is_fixed) scalar->needs_all_cells = true;
    return scalar->needs_all_cells || add_intervals(scalar, intervals, count);
}

static bool mark_data_needed_by_volume(session_mesh *mesh, const scene_volume *layer)
{
    session_scalar *scalar;
    if (!session_mark_scalar(mesh, &layer->field, true, &scalar)) return false;
    return !scalar || add_visible_intervals(scalar, layer);
}

/* A slice is drawn as an isosurface of the vertices' distances from a plane, with an isovalue near 0
 * (session_choose_slice_isovalue()). Marks the scalar of these distances as used, and adds an interval that contains
 * the isovalue. */
static bool mark_distance_from_plane(session_mesh *mesh, const scene_plane *plane, const session_extent *extent)
{
    const float reach = (float)(2 * SESSION_BORDER_SHARE * extent->half_diagonal);
    session_scalar *scalar;
    return session_mark_distance(mesh, plane, extent, &scalar) &&
           add_intervals(scalar, &(mmbvh_interval){-reach, reach}, 1);
}

static bool mark_data_needed_by_slice(session_mesh *mesh, const scene_slice *layer, const session_extent *extent)
{
    session_scalar *colour, *lines;
    bool is_marked = session_mark_scalar(mesh, &layer->field, false, &colour);
    if (colour && layer->lines.is_given)
        is_marked = is_marked && session_mark_scalar(mesh, &layer->lines.field, false, &lines);
    for (int i = 0; i < layer->plane_count && is_marked && colour; i++)
        is_marked = mark_distance_from_plane(mesh, &layer->planes[i], extent);
    return is_marked;
}

static bool mark_data_needed_by_outer_surface(session_mesh *mesh, const scene_surface *layer)
{
    session_scalar *scalar;
    if (!session_is_surface_on_mesh(layer, mesh)) return true;
    if (!session_mark_outer_surface_needed(mesh, &layer->threshold)) return false;
    if (layer->lines.is_given && !session_mark_scalar(mesh, &layer->lines.field, false, &scalar)) return false;
    return !layer->has_colour_by || session_mark_scalar(mesh, &layer->colour_by, false, &scalar);
}

static bool mark_data_needed_by_isosurface(session_mesh *mesh, const scene_isosurface *layer, int height)
{
    session_scalar *scalar;
    if (!session_mark_scalar(mesh, &layer->field, true, &scalar)) return false;
    if (!scalar) return true;
    if (mesh->has_shells_alone) {
        const scene_surface shells = session_make_shell_layer(layer, height);
        return mark_data_needed_by_outer_surface(mesh, &shells);
    }
    if (!add_isovalue_intervals(scalar, layer)) return false;
    if (layer->lines.is_given && !session_mark_scalar(mesh, &layer->lines.field, false, &scalar)) return false;
    return !layer->has_colour_by || session_mark_scalar(mesh, &layer->colour_by, false, &scalar);
}

/* Marks the scalars of the mesh that the image needs. Returns false if memory runs out. */
static bool mark_data_needed_by_image(session_mesh *mesh, const scene_image *image, const session_extent *extent)
{
    bool is_marked = true;
    for (int i = 0; i < image->isosurface_count && is_marked; i++)
        is_marked = mark_data_needed_by_isosurface(mesh, &image->isosurfaces[i], image->height);
    for (int i = 0; i < image->volume_count && is_marked; i++)
        is_marked = mark_data_needed_by_volume(mesh, &image->volumes[i]);
    for (int i = 0; i < image->surface_count && is_marked; i++)
        is_marked = mark_data_needed_by_outer_surface(mesh, &image->surfaces[i]);
    for (int i = 0; i < image->slice_count && is_marked; i++)
        is_marked = mark_data_needed_by_slice(mesh, &image->slices[i], extent);
    return is_marked;
}

bool session_mark_needed_data(session_meshes *meshes, const scene_image *const *images, int count,
                              const session_extent *extent)
{
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        mesh->is_needed = false;
        for (int i = 0; i < mesh->outer_count; i++) {
            mesh->outers[i]->is_needed = false;
            if (mesh->outers[i]->mesh) mesh->outers[i]->mesh->is_needed = false;
        }
        for (int i = 0; i < mesh->scalar_count; i++) {
            mesh->scalars[i].is_used = mesh->scalars[i].needs_ranges = false;
            mesh->scalars[i].needs_all_cells = false;
            mesh->scalars[i].interval_count = 0;
        }
        for (int i = 0; i < count && mesh->is_given; i++)
            if (images[i]->variant.view == 0 && !mark_data_needed_by_image(mesh, images[i], extent)) return false;
        session_drop_unused_outer_surfaces(mesh);
    }
    return true;
}

/* ---- cells with visible values ---------------------------------------------------------------------------------- */

bool session_hash_candidate_queries(const session_mesh *mesh, uint64_t *key)
{
    *key = SESSION_HASH_BEGIN;
    for (int i = 0; i < mesh->scalar_count; i++) {
        const session_scalar *s = &mesh->scalars[i];
        if (!s->needs_ranges) continue;
        if (s->needs_all_cells) return false;
        const int names[4] = {s->field, s->component, s->is_recentred, s->interval_count};
        session_hash_bytes(key, names, sizeof names);
        session_hash_bytes(key, &s->mesh_group_name, sizeof s->mesh_group_name);
        session_hash_bytes(key, s->plane.normal, sizeof s->plane.normal);
        session_hash_bytes(key, s->plane.point, sizeof s->plane.point);
        session_hash_bytes(key, s->intervals, (size_t)s->interval_count * sizeof *s->intervals);
    }
    return true;
}

insitu_status session_select_candidates(session_mesh *mesh, int threads, mmbvh_selection *out, base_error *error)
{
    const size_t most = (size_t)mesh->scalar_count;
    grid_field *fields = base_calloc(most, sizeof *fields);
    mmbvh_query *queries = base_calloc(most, sizeof *queries);
    int64_t *unusable = base_calloc(most, sizeof *unusable);
    insitu_status status = INSITU_ERROR_MEMORY;
    if (fields && queries && unusable) {
        int count = 0;
        for (int i = 0; i < mesh->scalar_count; i++) {
            const session_scalar *s = &mesh->scalars[i];
            if (!s->needs_ranges) continue;
            fields[count] = session_get_scalar_values(mesh, s);
            queries[count] = (mmbvh_query){&fields[count], s->interval_count, s->intervals};
            count++;
        }
        const mmbvh_options options = {.threads = threads};
        status = mmbvh_select(&mesh->cells, queries, count, &options, out, unusable, error);
        for (int i = 0, query = 0; i < mesh->scalar_count && !status; i++)
            if (mesh->scalars[i].needs_ranges) mesh->scalars[i].unusable_count = unusable[query++];
    } else {
        base_fail(error, status, "mesh \"%s\": no memory to plan its tree", mesh->label);
    }
    base_free(fields);
    base_free(queries);
    base_free(unusable);
    return status;
}
