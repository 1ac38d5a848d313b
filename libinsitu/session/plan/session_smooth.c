/* Computes smooth normals that are continuous across the borders between ranks. They are interpolated from gradients at
 * the vertices of the cells that an isosurface crosses; these gradients are means over the cells of all ranks
 * (session_vertex_sums.h). */
#include "session_smooth.h"

#include <string.h>

#include "memory.h"
#include "render.h"
#include "session_agree.h"
#include "session_hanging.h"
#include "session_scalars.h"
#include "session_twins.h"
#include "session_vertex_sums.h"

/* A field on a mesh, or on a mesh group, that needs gradients at vertices. */
typedef struct smooth_item {
    const session_catalogue_mesh *mesh;
    const session_catalogue_field *field;
    const scene_field *scene_field; /* the field as described in the first layer that shows it */
    /* name of the group of meshes over which cell values are averaged to vertices (session_find_group_name_of_mesh());
     * 0 if the values are not averaged */
    uint64_t mesh_group_name;
    int component;
    int value_count;
    mmbvh_interval *values; /* intervals that contain the isovalues of all layers that show the field */
} smooth_item;

typedef struct smooth_items {
    int count;
    smooth_item *items;
} smooth_items;

/* This rank's data while the gradients of one field are computed. */
typedef struct smooth_work {
    /* the mesh group over which the values are averaged, and this rank's parts of its meshes; NULL: the values are not
     * averaged, and vertices are compared bitwise */
    session_mesh_group *mesh_group;
    session_mesh_group_parts list;
    session_scalar **scalars; /* scalar of each part */
    mmbvh_selection *crossed; /* for each part, the cells that the isosurface crosses */
    session_vertex_sums sums;
} smooth_work;

/* ---- fields with smooth normals ------------------------------------------------------------------------------ */

static smooth_item *find_or_add_field(smooth_items *items, const smooth_item *like)
{
    for (int i = 0; i < items->count; i++) {
        smooth_item *item = &items->items[i];
        if (item->mesh == like->mesh && item->field == like->field && item->component == like->component &&
            item->mesh_group_name == like->mesh_group_name)
            return item;
    }
    smooth_item *more = base_realloc(items->items, (size_t)(items->count + 1) * sizeof *more);
    if (!more) return NULL;
    items->items = more;
    more[items->count] = *like;
    return &more[items->count++];
}

bool session_has_smooth_normals(const scene_isosurface *layer, const session_catalogue *catalogue)
{
    bool has_polynomials = false;
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        if (!mesh->has_higher_order || !scene_field_selects_mesh(&layer->field, mesh->name)) continue;
        const session_catalogue_field *field = session_catalogue_find_field(mesh, layer->field.name);
        has_polynomials = has_polynomials || (field && field->centring != INSITU_CELL);
    }
    return layer->normals == SCENE_VERTEX || (layer->normals == SCENE_GRADIENT && has_polynomials);
}

bool session_has_curved_faces(const session_catalogue *catalogue)
{
    for (int m = 0; m < catalogue->mesh_count; m++)
        if (catalogue->meshes[m].has_bent_cells) return true;
    return false;
}

/* Adds the field of a layer with smooth normals to the list of fields that need gradients, if the layer is drawn on the
 * mesh. */
static bool add_field_of_layer(smooth_items *items, const session_catalogue_mesh *mesh, const scene_isosurface *layer)
{
    const session_catalogue_field *field = session_catalogue_find_field(mesh, layer->field.name);
    if (!field || !scene_field_selects_mesh(&layer->field, mesh->name)) return true;
    const int component = session_resolve_component(&layer->field, field->component_count);
    const bool is_recentred = session_is_recentred(&layer->field, field->centring, mesh->is_refined);
    const uint64_t mesh_group_name =
        is_recentred ? session_find_group_name_of_mesh(mesh, layer->field.mesh_group_name) : 0;
    smooth_item *item =
        find_or_add_field(items, &(smooth_item){mesh, field, &layer->field, mesh_group_name, component, 0, NULL});
    if (!item) return false;
    const size_t count = (size_t)item->value_count + (size_t)layer->value_count;
    mmbvh_interval *values = base_realloc(item->values, count * sizeof *values);
    if (!values) return false;
    item->values = values;
    for (int i = 0; i < layer->value_count; i++)
        values[item->value_count++] = render_isovalue_interval(layer->values[i]);
    return true;
}

/* Lists the fields that need gradients, in the same order on all ranks. */
static bool list_fields_with_smooth_normals(const session_plan *plan, const session_catalogue *catalogue,
                                            smooth_items *out)
{
    bool is_listed = true;
    for (int m = 0; m < catalogue->mesh_count; m++)
        for (int i = 0; i < plan->image_count; i++) {
            const scene_image *image = plan->images[i];
            /* views of an orbit share the layers of their first view, so that only the first view is listed */
            if (image->variant.view > 0) continue;
            for (int n = 0; n < image->isosurface_count && is_listed; n++)
                is_listed = !session_has_smooth_normals(&image->isosurfaces[n], catalogue) ||
                            add_field_of_layer(out, &catalogue->meshes[m], &image->isosurfaces[n]);
        }
    return is_listed;
}

static void items_free(smooth_items *items)
{
    for (int i = 0; i < items->count; i++) base_free(items->items[i].values);
    base_free(items->items);
}

bool session_plan_has_smooth_normals(const session_plan *plan, const session_catalogue *catalogue)
{
    for (int i = 0; i < plan->image_count; i++)
        for (int n = 0; n < plan->images[i]->isosurface_count; n++)
            if (session_has_smooth_normals(&plan->images[i]->isosurfaces[n], catalogue)) return true;
    return false;
}

/* ---- vertices of crossed cells ------------------------------------------------------------------------------- */

/* Sets part->key_indices[v] to 0 for each vertex v of the cells in `crossed`, which an isosurface crosses, and to -1
 * for all other vertices. Returns the number of marked vertices. */
static int64_t mark_crossed_vertices(const mmbvh_selection *crossed, session_sum_part *part)
{
    const grid *g = &part->mesh->cells;
    int64_t count = 0, vertex;
    for (int64_t v = 0; v < g->vertex_count; v++) part->key_indices[v] = -1;
    for (int64_t i = 0; i < crossed->count; i++) {
        grid_walk walk = grid_walk_cell(g, crossed->cells[i]);
        while (grid_walk_next(&walk, &vertex)) {
            count += part->key_indices[vertex] < 0;
            part->key_indices[vertex] = 0;
        }
    }
    return count;
}

/* Creates the set of keys of this rank's vertices, sums->keys, from the vertices that have been marked (key_indices 0).
 * A key identifies a vertex on all ranks. most: upper bound of the number of keys. */
static bool add_own_keys(const smooth_item *item, int64_t most, session_vertex_sums *sums)
{
    if (most > INT32_MAX || !session_keys_create(&sums->keys, most)) return false;
    for (int i = 0; i < sums->part_count; i++) {
        const session_sum_part *part = &sums->parts[i];
        for (int64_t v = 0; v < part->mesh->cells.vertex_count; v++)
            if (part->key_indices[v] == 0) {
                const session_key key = session_merged_vertex_key(part->mesh, part->border, v, item->mesh->has_ids);
                session_keys_add(&sums->keys, &key);
            }
    }
    sums->own_count = sums->keys.count;
    return true;
}

static insitu_status find_keys_of_crossed_cells(const smooth_item *item, int threads, smooth_work *work,
                                                base_error *error)
{
    session_vertex_sums *sums = &work->sums;
    const mmbvh_options options = {.threads = threads};
    int64_t most = 0;
    for (int i = 0; i < sums->part_count; i++) {
        session_sum_part *part = &sums->parts[i];
        const mmbvh_query query = {part->fields, item->value_count, item->values};
        const int64_t vertices = part->mesh->cells.vertex_count;
        int64_t unusable;
        part->key_indices = base_alloc((size_t)(vertices ? vertices : 1) * sizeof *part->key_indices);
        if (!part->key_indices) return session_fail_for_memory(error, vertices * 4, "gradients at vertices");
        if (mmbvh_select(&part->mesh->cells, &query, 1, &options, &work->crossed[i], &unusable, error))
            return error->status;
        most += mark_crossed_vertices(&work->crossed[i], part);
    }
    if (!add_own_keys(item, most, sums)) session_fail_for_memory(error, most * 40, "gradients at vertices");
    return error->status;
}

/* Allocates and fills this rank's data for a field that needs gradients. */
static insitu_status create_gradient_work(const smooth_item *item, const session_meshes *meshes, int threads,
                                          smooth_work *work, base_error *error)
{
    const session_parts parts = session_find_parts(meshes, item->mesh->name);
    const size_t capacity = (size_t)parts.count + 1;
    session_vertex_sums *sums = &work->sums;
    int at = 0;
    sums->parts = base_calloc(capacity, sizeof *sums->parts);
    work->scalars = base_calloc(capacity, sizeof *work->scalars);
    work->crossed = base_calloc(capacity, sizeof *work->crossed);
    if (!sums->parts || !work->scalars || !work->crossed)
        return session_fail_for_memory(error, parts.count * 100LL, "gradients at vertices");
    for (int i = 0; i < parts.count; i++) {
        session_mesh *part = parts.items[i];
        session_scalar *scalar = part->is_given ? session_find_scalar(part, item->scene_field) : NULL;
        if (!scalar) continue;
        work->scalars[sums->part_count] = scalar;
        sums->parts[sums->part_count].mesh = part;
        if (work->mesh_group)
            sums->parts[sums->part_count].border =
                session_find_border_of_part(work->mesh_group, &work->list, part, &at);
        sums->parts[sums->part_count++].fields[0] = session_get_scalar_values(part, scalar);
    }
    return find_keys_of_crossed_cells(item, threads, work, error);
}

/* Finds the mesh group over which the values are averaged, and its vertices that are equal except for rounding.
 * Collective; all ranks return the same status. */
static insitu_status find_twins_of_field(const smooth_item *item, const session_catalogue *catalogue,
                                         const session_meshes *meshes, const session_team *team, smooth_work *work,
                                         base_error *error)
{
    work->mesh_group = session_find_mesh_group(catalogue, item->mesh_group_name);
    if (!work->mesh_group) return INSITU_OK;
    if (!session_list_mesh_group_parts(work->mesh_group, meshes, &work->list))
        session_fail_for_memory(error, meshes->count * 8LL, "gradients at vertices");
    if (!session_merges_close_vertices(work->mesh_group)) return INSITU_OK;
    return session_update_borders(work->mesh_group, &work->list, team, error);
}

static void free_gradient_work(smooth_work *work)
{
    for (int i = 0; i < work->sums.part_count && work->crossed; i++) mmbvh_selection_free(&work->crossed[i]);
    base_free(work->crossed);
    base_free(work->scalars);
    session_mesh_group_parts_free(&work->list);
    session_vertex_sums_free(&work->sums);
}

/* ---- gradients of one field -------------------------------------------------------------------------------------- */

/* Gives consecutive indices, from 0, to those vertices of the part whose gradients this rank needs. On entry,
 * key_indices[vertex] is the index of the vertex's sum of gradients, or -1; sums from own_count on are needed only by
 * other ranks. On return, key_indices[vertex] is the vertex's new index or -1, and sum_of[n] is the index of the sum of
 * the vertex with the new index n. Returns the number of indices. */
static int64_t number_vertices_with_gradients(session_sum_part *part, int64_t own_count, int32_t *sum_of)
{
    int64_t count = 0;
    for (int64_t v = 0; v < part->mesh->cells.vertex_count; v++) {
        const int32_t entry = part->key_indices[v];
        part->key_indices[v] = -1;
        if (entry < 0 || entry >= own_count) continue;
        sum_of[count] = entry;
        part->key_indices[v] = (int32_t)count++;
    }
    return count;
}

/* Stores the gradients of a part's vertices as floats. They are computed in units that do not depend on the unit of the
 * values, so that they fit into a float; only their direction matters. */
static bool store_gradients(const session_vertex_sums *sums, session_sum_part *part, session_scalar *scalar)
{
    const int64_t vertices = part->mesh->cells.vertex_count, words = session_count_sum_words(1);
    const session_gradient_bounds bounds = {1, sums->bounds.largest_inverse_square};
    session_drop_gradients(scalar);
    int32_t *sum_of = base_alloc((size_t)(vertices + 1) * sizeof *sum_of);
    const int64_t count = sum_of ? number_vertices_with_gradients(part, sums->own_count, sum_of) : 0;
    scalar->gradients = base_alloc((size_t)(count + 1) * sizeof *scalar->gradients);
    for (int64_t i = 0; i < count && scalar->gradients; i++) {
        double gradient[1][3];
        session_compute_mean_gradients(sums->sums + sum_of[i] * words, 1, &bounds, 1, gradient);
        for (int a = 0; a < 3; a++)
            scalar->gradients[i][a] = gradient[0][a] == gradient[0][a] ? (float)gradient[0][a] : 0;
    }
    const bool is_done = sum_of && scalar->gradients;
    base_free(sum_of);
    if (!is_done) return false;
    scalar->gradient_count = count;
    scalar->gradient_indices = part->key_indices;
    part->key_indices = NULL;
    return true;
}

static insitu_status compute_gradients_of_field(const smooth_item *item, const session_catalogue *catalogue,
                                                const session_meshes *meshes, const session_team *team,
                                                const session_extent *extent, base_error *error)
{
    smooth_work work = {.sums = {.by_id = item->mesh->has_ids, .field_count = 1}};
    insitu_status status = find_twins_of_field(item, catalogue, meshes, team, &work, error);
    if (!status && !error->status) create_gradient_work(item, meshes, team->threads, &work, error);
    if (!status) status = session_compute_vertex_sums(&item->mesh->homes, team, extent, &work.sums, error);
    for (int i = 0; i < work.sums.part_count && !status && !error->status; i++)
        if (!store_gradients(&work.sums, &work.sums.parts[i], work.scalars[i]))
            session_fail_for_memory(error, work.sums.own_count * 12, "gradients at vertices");
    free_gradient_work(&work);
    return status;
}

insitu_status session_find_smooth_gradients(const session_plan *plan, const session_catalogue *catalogue,
                                            const session_meshes *meshes, const session_team *team,
                                            const session_extent *extent, base_error *error)
{
    smooth_items items = {0};
    if (!session_plan_has_smooth_normals(plan, catalogue)) return INSITU_OK;
    if (!list_fields_with_smooth_normals(plan, catalogue, &items))
        session_fail_for_memory(error, 64, "the plan of gradients at vertices");
    insitu_status status = session_agree(team->comm, error);
    for (int i = 0; i < items.count && !status; i++)
        status = compute_gradients_of_field(&items.items[i], catalogue, meshes, team, extent, error);
    items_free(&items);
    return status;
}
