/* Finds layers that show nothing. Trees contain the ranges of their cells' values, rounded outward to float32. A layer
 * that shows no value within these ranges may be empty. The exact range of all cells' values is computed only for such
 * layers, because all values must be read for it. */
#include "session_empty_layers.h"

#include <math.h>

#include "memory.h"
#include "render.h"
#include "session_agree.h"
#include "session_lines.h"
#include "session_scalars.h"
#include "session_thresholds.h"
#include "session_transfer.h"
#include "session_unusable.h"

/* The minimum and the negated maximum of a range, so that one reduction by minimum computes both ends. */
typedef struct field_range {
    double low, negated_high;
} field_range;

static const field_range no_range = {INFINITY, INFINITY};

/* A layer of the plan that may be empty. Exactly one of `isosurface`, `volume` and `surface` is set. */
typedef struct planned_layer {
    const scene_image *image;
    const scene_isosurface *isosurface;
    const scene_volume *volume;
    const scene_surface *surface; /* an outer surface with a threshold */
    /* session_warning.number of the layer's warning, which distinguishes it from the warnings of the image's other
     * layers; for an isosurface, that of its first isovalue, to which the index of another isovalue is added */
    int number;
    /* range of the layer's values. In the first reduction the range of a surface is [0, 0] if some cell is within the
     * threshold, and otherwise empty (low > high). */
    field_range range;
    bool is_empty; /* for a surface: set after the first reduction if no cell is within its threshold */
    /* set if the layer shows nothing according to the trees, and no warning has been reported yet */
    bool is_unreported;
} planned_layer;

/* ---- list of layers that may be empty ---------------------------------------------------------------------------- */

/* Number of layers that are processed together. Their data is on the stack. */
enum { BATCH = 128 };

/* Consecutive layers of the plan that are processed together. The layers of the plan are numbered from 0 in the order
 * in which list_layers() visits them. */
typedef struct layer_batch {
    int first, next; /* first: number of the first layer in the batch; next: number of the layer that is visited next */
    int count;       /* number of layers in the batch */
    planned_layer layers[BATCH];
} layer_batch;

static void list_layer(layer_batch *batch, planned_layer layer)
{
    const int at = batch->next++ - batch->first;
    if (at >= 0 && at < BATCH) batch->layers[batch->count++] = layer;
}

static void list_isosurfaces(const scene_image *image, layer_batch *batch)
{
    for (int n = 0, values = 0; n < image->isosurface_count; n++) {
        const int number = values + image->variant.isovalue;
        list_layer(batch, (planned_layer){.image = image, .isosurface = &image->isosurfaces[n], .number = number});
        values += image->isosurfaces[n].value_count;
    }
}

static void list_volumes(const scene_image *image, layer_batch *batch)
{
    for (int n = 0; n < image->volume_count; n++) {
        const int number = image->variant.field * RENDER_MAX_VOLUMES + n;
        list_layer(batch, (planned_layer){.image = image, .volume = &image->volumes[n], .number = number});
    }
}

static void list_thresholds(const scene_image *image, layer_batch *batch)
{
    for (int n = 0; n < image->surface_count; n++)
        if (image->surfaces[n].threshold.is_given)
            list_layer(batch, (planned_layer){.image = image, .surface = &image->surfaces[n], .number = n});
}

/* Lists the layers of the batch, and returns the number of all layers. Each layer is listed once, although several
 * pictures may share it. All views of an image share all layers. The pictures of a sweep over fields share isosurfaces,
 * those of a sweep over isovalues share volumes, and those of a sweep over planes share both. All pictures of an image
 * share thresholds. */
static int list_layers(const session_plan *plan, layer_batch *batch)
{
    for (int i = 0; i < plan->image_count; i++) {
        const scene_image *image = plan->images[i];
        if (image->variant.view > 0) continue;
        if (image->variant.plane == 0 && image->variant.field == 0) list_isosurfaces(image, batch);
        if (image->variant.plane == 0 && image->variant.isovalue == 0) list_volumes(image, batch);
        if (scene_is_first_variant(image)) list_thresholds(image, batch);
    }
    return batch->next;
}

static const scene_field *find_layer_field(const planned_layer *layer)
{
    if (layer->isosurface) return &layer->isosurface->field;
    return layer->volume ? &layer->volume->field : &layer->surface->threshold.field;
}

/* ---- ranges of the values of layers ------------------------------------------------------------------------------ */

static void widen_range(double low, double high, field_range *range)
{
    range->low = fmin(range->low, low);
    range->negated_high = fmin(range->negated_high, -high);
}

/* Widens *range so that it contains the range of values that is stored in the root of the mesh's tree. The root's range
 * contains all values of the mesh that images can show. */
static void widen_range_by_tree_root(const session_mesh *mesh, const session_scalar *scalar, field_range *range)
{
    if (!mesh->is_needed || !mesh->has_tree || mesh->tree.node_count == 0) return;
    const mmbvh_ranges root = session_get_scalar_ranges(mesh, scalar);
    widen_range((double)*(const float *)(const void *)root.low, (double)*(const float *)(const void *)root.high, range);
}

/* Widens *range so that it contains the scalar's values in those cells of the mesh that belong to the set `kind`. The
 * minimum and maximum of these values are computed here unless they are known already. */
static void widen_range_by_cell_values(const session_mesh *mesh, session_scalar *scalar, int threads,
                                       session_extent_kind kind, field_range *range)
{
    double low, high;
    session_find_scalar_extent(mesh, scalar, threads, kind, &low, &high);
    widen_range(low, high, range);
}

static void mark_range_if_faces_exist(const session_mesh *mesh, const scene_surface *surface, field_range *range)
{
    const session_outer *outer = scene_field_selects_mesh(&surface->meshes_field, mesh->name)
                                     ? session_find_outer_surface(mesh, &surface->threshold)
                                     : NULL;
    if (outer && outer->face_count > 0) widen_range(0, 0, range);
}

static field_range find_layer_range_on_rank(const session_meshes *meshes, const planned_layer *layer, int threads,
                                            bool of_all_cells)
{
    field_range range = no_range;
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        if (!mesh->is_given) continue;
        session_scalar *scalar = session_find_scalar(mesh, find_layer_field(layer));
        if (layer->surface && !of_all_cells)
            mark_range_if_faces_exist(mesh, layer->surface, &range);
        else if (scalar && layer->isosurface && mesh->has_shells_alone)
            /* trees do not contain shells, so that the shells' values must be read */
            widen_range_by_cell_values(mesh, scalar, threads, SESSION_SEEN, &range);
        else if (scalar && of_all_cells)
            widen_range_by_cell_values(mesh, scalar, threads, SESSION_SOLID, &range);
        else if (scalar)
            widen_range_by_tree_root(mesh, scalar, &range);
    }
    return range;
}

/* Further values that are reduced in the same call as the layers' ranges. */
typedef struct reduced_extras {
    /* set if the set of fields that have cells with values that are not finite differs, on some rank, from that at the
     * last report (session_hash_unusable_fields()) */
    bool has_other_cells;
    int reporting_word; /* session_encode_rank_with_warnings() of this rank; after the reduction, the maximum over all
                           ranks */
} reduced_extras;

/* Reduces the layers' ranges, earlier errors and *extras over all ranks in one call. of_all_cells: the ranges are
 * computed from the values of all cells, instead of from the trees. The ranges are undefined after an error.
 * Collective. */
static insitu_status reduce_ranges(const session_meshes *meshes, const session_team *team, layer_batch *batch,
                                   bool of_all_cells, reduced_extras *extras, base_error *error)
{
    double lows[2 * BATCH + 3];
    const int last = 2 * batch->count;
    lows[last] = error->status ? -1 : 0;
    lows[last + 1] = extras->has_other_cells ? -1 : 0;
    lows[last + 2] = -extras->reporting_word;
    for (int i = 0; i < batch->count && !error->status; i++) {
        planned_layer *layer = &batch->layers[i];
        if (!of_all_cells || layer->is_unreported)
            layer->range = find_layer_range_on_rank(meshes, layer, team->threads, of_all_cells);
    }
    for (int i = 0; i < batch->count; i++) {
        lows[2 * i] = batch->layers[i].range.low;
        lows[2 * i + 1] = batch->layers[i].range.negated_high;
    }
    const int code = MPI_Allreduce(MPI_IN_PLACE, lows, last + 3, MPI_DOUBLE, MPI_MIN, team->comm);
    const insitu_status status = code == MPI_SUCCESS && lows[last] < 0
                                     ? session_agree(team->comm, error)
                                     : session_check_mpi(error, code, "MPI_Allreduce");
    for (int i = 0; i < batch->count; i++) batch->layers[i].range = (field_range){lows[2 * i], lows[2 * i + 1]};
    *extras = (reduced_extras){lows[last + 1] < 0, (int)-lows[last + 2]};
    return status;
}

/* ---- tests whether layers are empty ------------------------------------------------------------------------------ */

/* Returns the identity of the layer's warning. isovalue_index: index of the isovalue in the layer; 0 for other layers.
 * In a sweep over isovalues each layer has one isovalue; the warning's number then contains the isovalue's index in the
 * scene file's list (list_isosurfaces()). */
static session_warning make_layer_warning(const planned_layer *layer, int isovalue_index)
{
    const session_warning_kind kind = layer->isosurface ? WARNING_ISOVALUE
                                      : layer->volume   ? WARNING_TRANSPARENT
                                                        : WARNING_THRESHOLD;
    return (session_warning){kind, layer->image->name, NULL, layer->number + isovalue_index};
}

/* Returns whether no cell crosses an isovalue. A crossing belongs to the cell whose values reach the isovalue from
 * below, so that no cell crosses an isovalue that equals the minimum of all values. */
static bool is_isovalue_outside_range(double value, const field_range *range)
{
    return value <= range->low || value > -range->negated_high;
}

static bool is_volume_transparent(const scene_volume *volume, const field_range *range)
{
    mmbvh_interval intervals[RENDER_MAX_INTERVALS];
    const int count = session_find_visible_intervals(volume, intervals);
    for (int i = 0; i < count; i++)
        if ((double)intervals[i].high >= range->low && (double)intervals[i].low <= -range->negated_high) return false;
    return true;
}

/* Returns a range that was read from trees, with its minimum raised to just below the next larger float32. The true
 * minimum may be as large as this, because trees store it rounded down to float32. */
static field_range raise_tree_minimum(const field_range *range)
{
    const double low = range->low < INFINITY ? (double)nextafterf((float)range->low, INFINITY) : INFINITY;
    return (field_range){range->low < low ? nextafter(low, -INFINITY) : low, range->negated_high};
}

static int count_values(const planned_layer *layer)
{
    return layer->isosurface ? layer->isosurface->value_count : 1;
}

/* Returns whether the layer shows no value of the range. For an isosurface, only the isovalue with this index is
 * tested. */
static bool is_layer_empty(const planned_layer *layer, int isovalue_index, const field_range *range)
{
    if (layer->isosurface) return is_isovalue_outside_range(layer->isosurface->values[isovalue_index], range);
    return layer->volume ? is_volume_transparent(layer->volume, range) : layer->is_empty;
}

static bool find_unreported_layers(const session_report *report, layer_batch *batch)
{
    bool is_any = false;
    for (int i = 0; i < batch->count; i++) {
        planned_layer *layer = &batch->layers[i];
        layer->is_empty = layer->range.low > -layer->range.negated_high;
        layer->range = raise_tree_minimum(&layer->range);
        for (int v = 0; v < count_values(layer); v++) {
            const session_warning warning = make_layer_warning(layer, v);
            if (is_layer_empty(layer, v, &layer->range) && !session_has_reported_warning(report, &warning))
                layer->is_unreported = true;
        }
        is_any = is_any || layer->is_unreported;
    }
    return is_any;
}

/* ---- warnings -------------------------------------------------------------------------------------------------- */

static void warn_of_empty_isosurface(session_report *report, const planned_layer *layer, int isovalue_index, bool holds)
{
    const session_warning warning = make_layer_warning(layer, isovalue_index);
    const double low = layer->range.low, high = -layer->range.negated_high,
                 at = layer->isosurface->values[isovalue_index];
    session_warn(report, &warning, holds,
                 "image \"%s\": the isosurface of \"%s\" at %g is empty: the field goes from %g to %g%s",
                 layer->image->name, layer->isosurface->field.name, at, low, high,
                 at == low ? ", and a surface at its least value has nothing below it" : "");
}

static void warn_of_empty_volume(session_report *report, const planned_layer *layer, bool holds)
{
    const session_warning warning = make_layer_warning(layer, 0);
    session_warn(report, &warning, holds,
                 "image \"%s\": the volume of \"%s\" shows nothing: the field goes from %g to %g, where its opacity is "
                 "0; check its range and opacity",
                 layer->image->name, layer->volume->field.name, layer->range.low, -layer->range.negated_high);
}

static void warn_of_threshold(session_report *report, const planned_layer *layer, bool holds)
{
    const session_warning warning = make_layer_warning(layer, 0);
    const scene_threshold *threshold = &layer->surface->threshold;
    session_warn(report, &warning, holds,
                 "image \"%s\": a surface is empty: no cell is within its threshold, from %g to %g of \"%s\", which "
                 "goes from %g to %g",
                 layer->image->name, threshold->low, threshold->high, threshold->field.name, layer->range.low,
                 -layer->range.negated_high);
}

/* Warns of an empty layer. If no cell has a value of the field, no warning is added here, because another warning
 * explains this. */
static void warn_of_layer(session_report *report, const planned_layer *layer)
{
    const bool has_values = layer->range.low <= -layer->range.negated_high || !layer->is_unreported;
    for (int v = 0; v < count_values(layer); v++) {
        const bool holds = has_values && is_layer_empty(layer, v, &layer->range);
        if (layer->isosurface) warn_of_empty_isosurface(report, layer, v, holds);
        if (layer->volume) warn_of_empty_volume(report, layer, holds);
        if (layer->surface) warn_of_threshold(report, layer, holds);
    }
}

insitu_status session_warn_of_empty_layers(const session_plan *plan, const session_catalogue *catalogue,
                                           const session_meshes *meshes, const session_team *team,
                                           session_report *report, base_error *error)
{
    const int count = plan->cell_count ? list_layers(plan, &(layer_batch){.first = 0}) : 0;
    reduced_extras extras = {false, session_encode_rank_with_warnings(report, team)};
    if (plan->cell_count && !error->status)
        extras.has_other_cells = session_hash_unusable_fields(plan, meshes, team->threads) != report->unusable_key;
    insitu_status status = INSITU_OK;
    for (int first = 0; (first == 0 || first < count) && !status; first += BATCH) {
        layer_batch batch = {.first = first};
        if (count) list_layers(plan, &batch);
        status = reduce_ranges(meshes, team, &batch, false, &extras, error);
        if (!status && find_unreported_layers(report, &batch))
            status = reduce_ranges(meshes, team, &batch, true, &extras, error);
        for (int i = 0; i < batch.count && !status; i++) warn_of_layer(report, &batch.layers[i]);
    }
    if (!status && extras.reporting_word)
        status = session_broadcast_warnings(report, session_decode_rank_with_warnings(extras.reporting_word, team),
                                            team, error);
    if (!status && extras.has_other_cells)
        status = session_warn_of_unusable_cells(plan, catalogue, meshes, team, report, error);
    return status;
}
