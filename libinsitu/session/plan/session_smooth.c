/* Computes smooth normals without a seam: gradients at the vertices of the cells that an isosurface crosses, over all
 * ranks (session_vertex_sums.h). */
#include "session_smooth.h"

#include <string.h>

#include "memory.h"
#include "render.h"
#include "session_agree.h"
#include "session_neighbours.h"
#include "session_scalars.h"
#include "session_vertex_sums.h"

/* One field of one mesh. */
typedef struct smooth_item {
    const session_catalogue_mesh *mesh;
    const session_catalogue_field *field;
    const scene_field *scene_field; /* field of the first layer that shows it */
    uint64_t joined;                /* session_joint_name() if values are recentred */
    int component;
    int value_count;
    mmbvh_interval *values; /* isovalues of all layers that show it */
} smooth_item;

typedef struct smooth_items {
    int count;
    smooth_item *items;
} smooth_items;

/* This rank's work on an item. */
typedef struct smooth_work {
    session_scalar *scalar; /* NULL: this rank has no part of it */
    session_vertex_sums sums;
} smooth_work;

/* ---- fields with smooth normals ------------------------------------------------------------------------------ */

static smooth_item *find_item(smooth_items *items, const smooth_item *like)
{
    for (int i = 0; i < items->count; i++) {
        smooth_item *item = &items->items[i];
        if (item->mesh == like->mesh && item->field == like->field && item->component == like->component &&
            item->joined == like->joined)
            return item;
    }
    smooth_item *more = base_realloc(items->items, (size_t)(items->count + 1) * sizeof *more);
    if (!more) return NULL;
    items->items = more;
    more[items->count] = *like;
    return &more[items->count++];
}

static bool add_layer(smooth_items *items, const session_catalogue_mesh *mesh, const scene_isosurface *layer)
{
    const session_catalogue_field *field = session_catalogue_find(mesh, layer->field.name);
    if (layer->normals != SCENE_VERTEX || !field || !scene_field_is_on(&layer->field, mesh->name)) return true;
    const int component = session_resolve_component(&layer->field, field->component_count);
    const bool is_recentred = session_is_recentred(&layer->field, field->centring);
    const uint64_t joined = is_recentred ? session_joint_name(mesh, layer->field.joined) : 0;
    smooth_item *item = find_item(items, &(smooth_item){mesh, field, &layer->field, joined, component, 0, NULL});
    if (!item) return false;
    const size_t count = (size_t)item->value_count + (size_t)layer->value_count;
    mmbvh_interval *values = base_realloc(item->values, count * sizeof *values);
    if (!values) return false;
    item->values = values;
    for (int i = 0; i < layer->value_count; i++)
        values[item->value_count++] = render_isovalue_interval(layer->values[i]);
    return true;
}

/* Lists the items, in the same order on all ranks. */
static bool list_items(const session_plan *plan, const session_catalogue *catalogue, smooth_items *out)
{
    bool is_listed = true;
    for (int m = 0; m < catalogue->mesh_count; m++)
        for (int i = 0; i < plan->image_count; i++) {
            const scene_image *image = plan->images[i];
            if (image->variant.view > 0) continue; /* its layers are those of view 0 */
            for (int n = 0; n < image->isosurface_count && is_listed; n++)
                is_listed = add_layer(out, &catalogue->meshes[m], &image->isosurfaces[n]);
        }
    return is_listed;
}

static void items_free(smooth_items *items)
{
    for (int i = 0; i < items->count; i++) base_free(items->items[i].values);
    base_free(items->items);
}

bool session_is_smooth(const session_plan *plan)
{
    for (int i = 0; i < plan->image_count; i++)
        for (int n = 0; n < plan->images[i]->isosurface_count; n++)
            if (plan->images[i]->isosurfaces[n].normals == SCENE_VERTEX) return true;
    return false;
}

/* ---- vertices of crossed cells ------------------------------------------------------------------------------- */

/* Adds the keys of the crossed cells' vertices. */
static bool add_own_keys(const smooth_item *item, const mmbvh_selection *crossed, session_vertex_sums *sums)
{
    const session_sum_part *part = sums->parts;
    const grid *g = &part->mesh->cells;
    int64_t most = 0, vertex;
    for (int64_t v = 0; v < g->vertex_count; v++) part->entries[v] = -1;
    for (int64_t i = 0; i < crossed->count; i++) {
        grid_walk walk = grid_walk_cell(g, crossed->cells[i]);
        while (grid_walk_next(&walk, &vertex)) {
            most += part->entries[vertex] < 0;
            part->entries[vertex] = 0;
        }
    }
    if (most > INT32_MAX || !session_keys_create(&sums->keys, most)) return false;
    for (int64_t v = 0; v < g->vertex_count; v++)
        if (part->entries[v] == 0) {
            const session_key key = session_vertex_key(part->mesh, v, item->mesh->has_ids);
            session_keys_add(&sums->keys, &key);
        }
    sums->own_count = sums->keys.count;
    return true;
}

static insitu_status find_own_keys(const smooth_item *item, int threads, session_vertex_sums *sums, base_error *error)
{
    session_sum_part *part = sums->parts;
    const mmbvh_wish wish = {part->fields, item->value_count, item->values};
    const mmbvh_options options = {.threads = threads};
    const int64_t vertices = part->mesh->cells.vertex_count;
    mmbvh_selection crossed;
    int64_t unusable;
    part->entries = base_alloc((size_t)(vertices ? vertices : 1) * sizeof *part->entries);
    if (!part->entries) return session_no_memory(error, vertices * 4, "gradients at vertices");
    if (mmbvh_select(&part->mesh->cells, &wish, 1, &options, &crossed, &unusable, error)) return error->status;
    if (!add_own_keys(item, &crossed, sums)) session_no_memory(error, vertices * 40, "gradients at vertices");
    mmbvh_selection_free(&crossed);
    return error->status;
}

/* Begins this rank's share of the item. */
static insitu_status begin_work(const smooth_item *item, const session_meshes *meshes, int threads, smooth_work *work,
                                base_error *error)
{
    session_mesh *mesh = session_find_mesh(meshes, item->mesh->name);
    session_vertex_sums *sums = &work->sums;
    *work = (smooth_work){.sums = {.by_id = item->mesh->has_ids, .field_count = 1}};
    sums->parts = base_calloc(1, sizeof *sums->parts);
    if (!sums->parts || !session_keys_create(&sums->keys, 0))
        return session_no_memory(error, 64, "gradients at vertices");
    sums->part_count = 1;
    work->scalar = mesh && mesh->is_given ? session_find_scalar(mesh, item->scene_field) : NULL;
    if (!work->scalar) return INSITU_OK;
    session_keys_free(&sums->keys);
    sums->parts->mesh = mesh;
    sums->parts->fields[0] = session_scalar_field(mesh, work->scalar);
    return find_own_keys(item, threads, sums, error);
}

/* ---- one item ------------------------------------------------------------------------------------------------ */

/* Stores the gradients. Vertices whose sums only other ranks need get no gradient here. The length of a gradient does
 * not matter, so it is scaled to near that of the scene, so that no unit of the values makes it too small for a
 * float. */
static insitu_status end_work(smooth_work *work, base_error *error)
{
    session_scalar *scalar = work->scalar;
    session_sum_part *part = work->sums.parts;
    const int64_t count = work->sums.own_count, words = session_sum_words(1);
    const session_gradient_bounds bounds = {1, work->sums.bounds.sharpness};
    session_drop_gradients(scalar);
    scalar->gradients = base_alloc((size_t)(count ? count : 1) * sizeof *scalar->gradients);
    if (!scalar->gradients) return session_no_memory(error, count * 12, "gradients at vertices");
    for (int64_t i = 0; i < count; i++) {
        double gradient[1][3];
        session_mean_gradients(work->sums.sums + i * words, 1, &bounds, 1, gradient);
        for (int a = 0; a < 3; a++)
            scalar->gradients[i][a] = gradient[0][a] == gradient[0][a] ? (float)gradient[0][a] : 0;
    }
    for (int64_t v = 0; v < part->mesh->cells.vertex_count; v++)
        if (part->entries[v] >= count) part->entries[v] = -1;
    scalar->gradient_count = count;
    scalar->gradient_entries = part->entries;
    part->entries = NULL;
    return INSITU_OK;
}

static insitu_status smooth(const smooth_item *item, const session_meshes *meshes, const session_team *team,
                            const session_extent *extent, base_error *error)
{
    smooth_work work = {0};
    if (!error->status) begin_work(item, meshes, team->threads, &work, error);
    const insitu_status status = session_find_sums(&item->mesh->homes, team, extent, &work.sums, error);
    if (!status && !error->status && work.scalar) end_work(&work, error);
    session_vertex_sums_free(&work.sums);
    return status;
}

insitu_status session_smooth(const session_plan *plan, const session_catalogue *catalogue, const session_meshes *meshes,
                             const session_team *team, const session_extent *extent, base_error *error)
{
    smooth_items items = {0};
    if (!session_is_smooth(plan)) return INSITU_OK;
    if (!list_items(plan, catalogue, &items)) session_no_memory(error, 64, "the plan of gradients at vertices");
    insitu_status status = session_agree(team->comm, error);
    for (int i = 0; i < items.count && !status; i++) status = smooth(&items.items[i], meshes, team, extent, error);
    items_free(&items);
    return status;
}
