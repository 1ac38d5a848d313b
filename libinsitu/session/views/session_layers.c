/* Converts layers to the renderer's form. A part is a mesh of this rank that has a tree with cells. Each layer has one
 * field per part. If a part does not have the field of a layer, the part's ranges are NULL, and the renderer skips the
 * part. If a part has the field of a surface but not the field that colours the surface, the values of the colouring
 * field are NaN. */
#include "session_layers.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_contours.h"
#include "session_distances.h"
#include "session_outer_mesh.h"
#include "session_ranges.h"
#include "session_scalars.h"
#include "session_shells.h"
#include "session_smooth.h"
#include "session_thresholds.h"

static bool has_non_empty_bvh_to_draw(const session_mesh *mesh)
{
    return mesh && mesh->is_needed && mesh->has_tree && mesh->tree.node_count > 0;
}

static int count_surfaces(const scene_image *image)
{
    int count = image->isosurface_count + image->surface_count;
    for (int i = 0; i < image->slice_count; i++) count += image->slices[i].plane_count;
    return count;
}

static bool allocate_layers(const session_layer_basis *basis, const scene_image *image, session_layers *out)
{
    const session_meshes *meshes = basis->meshes;
    const int shells = basis->has_shells ? image->isosurface_count : 0;
    const size_t surfaces = (size_t)count_surfaces(image) + (size_t)shells, volumes = (size_t)image->volume_count;
    for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);)
        out->part_count += has_non_empty_bvh_to_draw(walk.part);
    const size_t fields = (size_t)out->part_count * (3 * surfaces + volumes);
    out->surface_count = (int)surfaces;
    out->first_outer = image->isosurface_count + shells;
    out->parts = base_calloc((size_t)out->part_count, sizeof *out->parts);
    out->surfaces = base_calloc(surfaces, sizeof *out->surfaces);
    out->volumes = base_calloc(volumes, sizeof *out->volumes);
    out->transfers = base_calloc(surfaces + volumes, sizeof *out->transfers);
    if (out->transfers) out->transfer_count = (int)(surfaces + volumes);
    out->fields = base_calloc(fields, sizeof *out->fields);
    out->field_count = (int64_t)fields;
    out->gathered_values = base_calloc(fields, sizeof *out->gathered_values);
    out->gradients = base_calloc((size_t)out->part_count * (size_t)out->surface_count, sizeof *out->gradients);
    out->distances = base_calloc(surfaces, sizeof *out->distances);
    out->contours = base_calloc(surfaces, sizeof *out->contours);
    out->ranges = base_calloc(fields, sizeof *out->ranges);
    return out->parts && out->surfaces && out->volumes && out->transfers && out->fields && out->gathered_values &&
           out->gradients && out->distances && out->contours && out->ranges;
}

void session_layers_free(session_layers *layers)
{
    for (int i = 0; i < layers->transfer_count; i++) session_transfer_free(&layers->transfers[i]);
    base_free(layers->parts);
    base_free(layers->surfaces);
    base_free(layers->volumes);
    base_free(layers->transfers);
    base_free(layers->fields);
    for (int64_t i = 0; i < layers->field_count && layers->gathered_values; i++) base_free(layers->gathered_values[i]);
    base_free(layers->gathered_values);
    base_free(layers->gradients);
    base_free(layers->distances);
    base_free(layers->contours);
    base_free(layers->ranges);
    *layers = (session_layers){0};
}

static void set_meshes_of_parts(const session_meshes *meshes, session_layers *layers)
{
    int part = 0;
    for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) {
        const session_mesh *mesh = walk.part;
        if (has_non_empty_bvh_to_draw(mesh))
            layers->parts[part++] = (render_part){&mesh->cells, &mesh->tree, walk.outer ? walk.outer->loops : NULL};
    }
}

static const double no_number = NAN;

/* Returns a field with the value NaN at all vertices. */
static grid_field make_field_of_nan_values(void)
{
    return (grid_field){.values = {.data = (const char *)&no_number, .stride = 0, .is_wide = true},
                        .component_count = 1};
}

/* Stores a part's field for a layer at index `at` of the array of fields and, if needs_ranges is set, the field's
 * ranges. scalar: NULL if the part lacks the field. */
static void set_field_of_part(session_layers *layers, ptrdiff_t at, const session_mesh *mesh,
                              const session_scalar *scalar, bool needs_ranges)
{
    layers->fields[at] = scalar ? session_get_scalar_values(mesh, scalar) : make_field_of_nan_values();
    if (scalar && needs_ranges) layers->ranges[at] = session_get_scalar_ranges(mesh, scalar);
}

/* Stores the fields of all parts for a layer in section `slot` of the array of fields; a section consists of part_count
 * fields. If plane is not NULL, the distances from the plane replace the field's values. */
static render_field set_fields_of_parts(const session_meshes *meshes, session_layers *layers, int slot,
                                        const scene_field *field, const scene_plane *plane, bool needs_ranges)
{
    const ptrdiff_t first = (ptrdiff_t)slot * layers->part_count;
    const render_field out = {layers->fields + first, layers->ranges + first};
    ptrdiff_t at = first;
    for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) {
        const session_mesh *mesh = walk.part;
        if (!has_non_empty_bvh_to_draw(mesh)) continue;
        const session_scalar *scalar = session_find_scalar(mesh, field);
        if (scalar && plane) scalar = session_find_distance_scalar(mesh, plane);
        set_field_of_part(layers, at++, mesh, scalar, needs_ranges);
    }
    return out;
}

/* Stores the gradients at vertices, for those parts that have the field. index: index of the isosurface layer. */
static const render_vertex_gradients *
set_vertex_gradients_of_parts(const session_meshes *meshes, session_layers *layers, int index, const scene_field *field)
{
    render_vertex_gradients *const out = layers->gradients + (ptrdiff_t)index * layers->part_count;
    int at = 0;
    for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) {
        const session_mesh *mesh = walk.part;
        if (!has_non_empty_bvh_to_draw(mesh)) continue;
        const session_scalar *scalar = session_find_scalar(mesh, field);
        if (scalar) out[at] = (render_vertex_gradients){scalar->gradient_indices, (const float(*)[3])scalar->gradients};
        at++;
    }
    return out;
}

static void warn_of_log_scale_without_values(const session_layer_basis *basis, const scene_field *field, bool is_true)
{
    const session_warning warning = {WARNING_SCALE, basis->image->name, field->name, 0};
    session_warn(basis->report, &warning, is_true,
                 "image \"%s\": the field \"%s\" has no value above 0, but scale: log shows only such values: all of "
                 "it lies below the range",
                 basis->image->name, field->name);
}

static void warn_of_narrow_value_range(const session_layer_basis *basis, const scene_field *field, double low,
                                       double high)
{
    const session_warning warning = {WARNING_NARROW, basis->image->name, field->name, 0};
    session_warn(
        basis->report, &warning, session_is_range_too_narrow(low, high),
        "image \"%s\": the values of the field \"%s\" between %.17g and %.17g, the range of its colours, are too "
        "near to one another to be told apart; the colours may show rounding, or one value",
        basis->image->name, field->name, low, high);
}

/* Computes the transfer function of a colour map for a field. volume: the volume whose opacity the function includes;
 * NULL for a surface. If the map's range covers all steps of the run, it is extended by the values of this step.
 * Collective. */
static insitu_status make_transfer_function_of_field(const session_layer_basis *basis, const scene_field *field,
                                                     const scene_colour_map *map, const scene_volume *volume,
                                                     session_transfer *out, base_error *error)
{
    double low = map->range.low, high = map->range.high;
    insitu_status status = INSITU_OK;
    if (!map->range.is_fixed) status = session_find_range(basis->meshes, basis->team, field, map, &low, &high, error);
    if (status) return status;
    if (!map->range.is_fixed && map->scale == SCENE_LOG) warn_of_log_scale_without_values(basis, field, !(high > 0));
    if (!map->range.is_fixed && map->range.source == SCENE_RANGE_RUN)
        session_widen_run_range(basis->run_ranges, map, &low, &high);
    warn_of_narrow_value_range(basis, field, low, high);
    if (!session_make_transfer(basis->half_diagonal, map, low, high, volume, out))
        session_fail_for_memory(error, map->count * 3 * (int64_t)sizeof *map->colours, "the colours of a volume");
    return INSITU_OK; /* if only this rank lacks memory, the next phase passes *error to all ranks */
}

/* Returns the index of the section (set_fields_of_parts()) for the contour lines of a surface. */
static int get_slot_of_contour_field(const session_layers *layers, const scene_image *image, int surface)
{
    return 2 * layers->surface_count + image->volume_count + surface;
}

/* Computes the contour lines of a surface. The transfer function of its colours must have been computed before.
 * Collective. */
static insitu_status compute_contour_lines_of_surface(const session_layer_basis *basis, const scene_lines *in,
                                                      render_field field, int surface, session_layers *layers,
                                                      base_error *error)
{
    session_contours *out = &layers->contours[surface];
    if (!in->is_given) return INSITU_OK;
    const render_transfer *colours = in->is_of_colours ? &layers->transfers[surface].transfer : NULL;
    const insitu_status status = session_compute_contour_lines(basis->meshes, basis->team, in, colours, out, error);
    out->lines.field = field;
    if (in->is_alone && layers->surfaces[surface].colour_map) out->lines.colours = NULL;
    if (out->lines.count) layers->surfaces[surface].lines = &out->lines;
    return status;
}

/* Sets the field of the contour lines of an isosurface or of a slice's plane, and computes the lines. The field
 * is read from the meshes' cells, while that of an outer surface is a copy (set_field_of_outer_faces()). Collective. */
static insitu_status set_contour_field_and_make_lines(const session_layer_basis *basis, const scene_lines *in,
                                                      int surface, session_layers *layers, base_error *error)
{
    if (!in->is_given) return INSITU_OK;
    const int slot = get_slot_of_contour_field(layers, basis->image, surface);
    const render_field field = set_fields_of_parts(basis->meshes, layers, slot, &in->field, NULL, false);
    return compute_contour_lines_of_surface(basis, in, field, surface, layers, error);
}

/* Hits of occlusion rays that are nearer than this fraction of a cell are ignored, because they are on the same surface
 * as the ray's origin: an isosurface is curved within a cell, has an edge between two cells, and extends outward at the
 * faces of polyhedra. A smaller fraction would leave dark spots on the facets of polyhedra; a larger one would remove
 * the shading of hollows (docs/development/decisions/surface.md). */
#define OCCLUSION_CONTACT 0.2F

static insitu_status fill_isosurface_layer(const session_layer_basis *basis, const scene_isosurface *layer, int index,
                                           session_layers *layers, base_error *error)
{
    const bool is_smooth = session_has_smooth_normals(layer, basis->catalogue);
    render_surface_layer *out = &layers->surfaces[index];
    const scene_material *m = &layer->material;
    *out = (render_surface_layer){.field =
                                      set_fields_of_parts(basis->meshes, layers, 2 * index, &layer->field, NULL, true),
                                  .value_count = layer->value_count,
                                  .values = layer->values,
                                  .colours = layer->colours,
                                  .opacity = layer->opacity,
                                  .material = {m->ambient, m->diffuse, m->specular, m->shininess},
                                  .normal = is_smooth                             ? RENDER_VERTEX
                                            : layer->normals == SCENE_DIFFERENCES ? RENDER_DIFFERENCES
                                                                                  : RENDER_GRADIENT,
                                  .difference = layer->difference,
                                  .contact = OCCLUSION_CONTACT,
                                  .clips = layer->clips};
    if (is_smooth) out->gradients = set_vertex_gradients_of_parts(basis->meshes, layers, index, &layer->field);
    insitu_status status = INSITU_OK;
    if (layer->has_colour_by) {
        out->colour_field = set_fields_of_parts(basis->meshes, layers, 2 * index + 1, &layer->colour_by, NULL, false);
        out->colour_map = &layers->transfers[index].transfer;
        status = make_transfer_function_of_field(basis, &layer->colour_by, &layer->colour_map, NULL,
                                                 &layers->transfers[index], error);
    }
    return status ? status : set_contour_field_and_make_lines(basis, &layer->lines, index, layers, error);
}

/* ---- outer surfaces ------------------------------------------------------------------------------------------ */

/* Returns whether the layer shows the iterator's current part. A surface layer shows only meshes of outer faces that
 * were made for the layer's meshes and threshold. */
static bool is_part_shown_by_surface_layer(const session_part_walk *walk, const scene_surface *layer)
{
    return walk->outer && session_is_surface_on_mesh(layer, walk->whole) &&
           session_find_outer_surface(walk->whole, &layer->threshold) == walk->outer;
}

static render_field set_scalar_of_outer_face_meshes(const session_meshes *meshes, session_layers *layers, int slot,
                                                    const scene_surface *layer)
{
    const ptrdiff_t first = (ptrdiff_t)slot * layers->part_count;
    ptrdiff_t at = first;
    for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) {
        const session_mesh *mesh = walk.part;
        if (!has_non_empty_bvh_to_draw(mesh)) continue;
        layers->fields[at] = make_field_of_nan_values();
        if (is_part_shown_by_surface_layer(&walk, layer)) {
            layers->fields[at] = session_get_scalar_values(mesh, &mesh->scalars[0]);
            layers->ranges[at] = session_get_scalar_ranges(mesh, &mesh->scalars[0]);
        }
        at++;
    }
    return (render_field){layers->fields + first, layers->ranges + first};
}

/* Stores the normals at the vertices of the outer faces, for the layer with this index. */
static const render_vertex_gradients *set_vertex_normals_of_outer_faces(const session_meshes *meshes,
                                                                        session_layers *layers, int surface,
                                                                        const scene_surface *layer)
{
    render_vertex_gradients *const out = layers->gradients + (ptrdiff_t)surface * layers->part_count;
    int at = 0;
    for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) {
        if (!has_non_empty_bvh_to_draw(walk.part)) continue;
        const session_scalar *scalar = &walk.part->scalars[0];
        if (is_part_shown_by_surface_layer(&walk, layer))
            out[at] = (render_vertex_gradients){scalar->gradient_indices, (const float(*)[3])scalar->gradients};
        at++;
    }
    return out;
}

static bool copy_values_to_outer_faces(const session_mesh *whole, const session_outer *outer,
                                       const session_scalar *scalar, double **values, grid_field *out)
{
    const grid_field field = session_get_scalar_values(whole, scalar);
    *values = session_gather_outer_values(outer, &field);
    *out = (grid_field){.values = {.data = (const char *)*values, .stride = (int64_t)sizeof **values, .is_wide = true},
                        .component_stride = (int64_t)sizeof **values,
                        .component_count = 1,
                        .is_cell_centred = field.is_cell_centred};
    return *values != NULL;
}

/* Stores the values at the outer faces as the layer's field. These values are gathered from those of the whole mesh.
 * Returns false if memory runs out. */
static bool set_field_of_outer_faces(const session_meshes *meshes, session_layers *layers, int slot,
                                     const scene_surface *layer, const scene_field *field, render_field *out)
{
    ptrdiff_t at = (ptrdiff_t)slot * layers->part_count;
    *out = (render_field){layers->fields + at, layers->ranges + at};
    for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) {
        if (!has_non_empty_bvh_to_draw(walk.part)) continue;
        const session_scalar *scalar =
            is_part_shown_by_surface_layer(&walk, layer) ? session_find_scalar(walk.whole, field) : NULL;
        layers->fields[at] = make_field_of_nan_values();
        if (scalar && !copy_values_to_outer_faces(walk.whole, walk.outer, scalar, &layers->gathered_values[at],
                                                  &layers->fields[at]))
            return false;
        at++;
    }
    return true;
}

/* Returns the material of a layer. Flat data is drawn like a map: if the scene sets no light and no material, the
 * material is unlit, so that the picture's colours are exactly those of the colour bar. */
static const scene_material *choose_outer_surface_material(const session_layer_basis *basis, const scene_surface *layer)
{
    static const scene_material bare = {.ambient = 1};
    return basis->is_flat && !layer->has_material && !basis->image->has_lights ? &bare : &layer->material;
}

static insitu_status fill_outer_surface_layer(const session_layer_basis *basis, const scene_surface *layer, int surface,
                                              session_layers *layers, base_error *error)
{
    const bool is_curved = session_has_curved_faces(basis->catalogue);
    const scene_material *m = choose_outer_surface_material(basis, layer);
    render_surface_layer *out = &layers->surfaces[surface];
    *out = (render_surface_layer){.field = set_scalar_of_outer_face_meshes(basis->meshes, layers, 2 * surface, layer),
                                  .value_count = 1,
                                  .values = &layers->distances[surface],
                                  .colours = layer->colour,
                                  .opacity = layer->opacity,
                                  .material = {m->ambient, m->diffuse, m->specular, m->shininess},
                                  .normal = is_curved ? RENDER_VERTEX : RENDER_GRADIENT,
                                  .edge_width = layer->edge_width,
                                  .is_of_faces = true,
                                  .clips = layer->clips};
    memcpy(out->edge_colour, layer->edge_colour, sizeof out->edge_colour);
    if (is_curved) out->gradients = set_vertex_normals_of_outer_faces(basis->meshes, layers, surface, layer);
    if (layer->has_colour_by) {
        out->colour_map = &layers->transfers[surface].transfer;
        if (!set_field_of_outer_faces(basis->meshes, layers, 2 * surface + 1, layer, &layer->colour_by,
                                      &out->colour_field))
            session_fail_for_memory(error, 1 << 10, "values at outer faces");
    }
    render_field field = {NULL, NULL};
    const int slot = get_slot_of_contour_field(layers, basis->image, surface);
    if (layer->lines.is_given &&
        !set_field_of_outer_faces(basis->meshes, layers, slot, layer, &layer->lines.field, &field))
        session_fail_for_memory(error, 1 << 10, "values at outer faces");
    if (!layer->has_colour_by && !layer->lines.is_given) return INSITU_OK;
    insitu_status status = session_agree(basis->team->comm, error);
    if (!status && layer->has_colour_by)
        status = make_transfer_function_of_field(basis, &layer->colour_by, &layer->colour_map, NULL,
                                                 &layers->transfers[surface], error);
    return status ? status : compute_contour_lines_of_surface(basis, &layer->lines, field, surface, layers, error);
}

/* ---- slices -------------------------------------------------------------------------------------------------- */

static void warn_of_plane_outside_cells(const session_layer_basis *basis, const scene_image *image, int surface,
                                        double low, double high)
{
    const session_warning warning = {WARNING_PLANE, image->name, NULL, surface + image->variant.plane};
    const double reach = SESSION_BORDER_SHARE * basis->half_diagonal;
    session_warn(basis->report, &warning, low <= high && (low > reach || high < -reach),
                 "image \"%s\": a plane of its slices meets no cell: cells are %g to %g from it, along its normal",
                 image->name, low, high);
}

/* Computes the renderer's surface layer for one plane of a slice. surface: the plane's index among the surfaces. */
static insitu_status fill_layer_of_slice_plane(const session_layer_basis *basis, const scene_image *image,
                                               const scene_slice *layer, const scene_plane *plane, int surface,
                                               session_layers *layers, base_error *error)
{
    const scene_material *m = &layer->material;
    session_transfer *transfer = &layers->transfers[surface];
    double low, high;
    const session_range_subject distances = {&layer->field, plane, false};
    insitu_status status = session_find_extremes(basis->meshes, basis->team, &distances, &low, &high, error);
    if (!status)
        status = make_transfer_function_of_field(basis, &layer->field, &layer->colour_map, NULL, transfer, error);
    if (status) return status;
    layers->distances[surface] = session_choose_slice_isovalue(low, high, basis->half_diagonal);
    warn_of_plane_outside_cells(basis, image, surface, low, high);
    layers->surfaces[surface] = (render_surface_layer){
        .field = set_fields_of_parts(basis->meshes, layers, 2 * surface, &layer->field, plane, true),
        .value_count = 1,
        .values = &layers->distances[surface],
        .colour_field = set_fields_of_parts(basis->meshes, layers, 2 * surface + 1, &layer->field, NULL, false),
        .colour_map = &transfer->transfer,
        .opacity = layer->opacity,
        .material = {m->ambient, m->diffuse, m->specular, m->shininess},
        .normal = RENDER_GRADIENT,
        .clips = layer->clips};
    return set_contour_field_and_make_lines(basis, &layer->lines, surface, layers, error);
}

static insitu_status fill_layers_of_slice_planes(const session_layer_basis *basis, const scene_image *image,
                                                 session_layers *layers, base_error *error)
{
    int surface = layers->first_outer + image->surface_count;
    insitu_status status = INSITU_OK;
    for (int i = 0; i < image->slice_count; i++)
        for (int p = 0; p < image->slices[i].plane_count && !status; p++)
            status = fill_layer_of_slice_plane(basis, image, &image->slices[i], &image->slices[i].planes[p], surface++,
                                               layers, error);
    return status;
}

static insitu_status fill_volume_layer(const session_layer_basis *basis, const scene_image *image, int index,
                                       session_layers *layers, base_error *error)
{
    const scene_volume *layer = &image->volumes[index];
    session_transfer *transfer = &layers->transfers[layers->surface_count + index];
    layers->volumes[index] =
        (render_volume_layer){.field = set_fields_of_parts(basis->meshes, layers, 2 * layers->surface_count + index,
                                                           &layer->field, NULL, true),
                              .transfer = &transfer->transfer};
    return make_transfer_function_of_field(basis, &layer->field, &layer->colour_map, layer, transfer, error);
}

/* Warns that several volumes are sampled without an error bound. By default, a single volume is integrated over the
 * segments of each ray, with an error bound. Several volumes are not, because blending their segments takes longer. */
static void warn_of_sampling_without_error_bound(const session_layer_basis *basis, const scene_image *image)
{
    const session_warning warning = {WARNING_SAMPLES, image->name, NULL, 0};
    session_warn(basis->report, &warning, image->has_default_samples,
                 "image \"%s\": its %d volumes are sampled half a cell apart, to no known error, and coarse cells may "
                 "show it; sampling: {max_error: 0.01} bounds the error and takes 4 to 12 times as long, sampling: "
                 "{step_cells: 0.5} asks for samples and silences this",
                 image->name, image->volume_count);
}

insitu_status session_make_layers(const session_layer_basis *basis, const scene_image *image, session_layers *out,
                                  base_error *error)
{
    session_layers layers = {0};
    if (!error->status && !allocate_layers(basis, image, &layers))
        session_fail_for_memory(error, 1 << 10, "an image's layers");
    /* an error about a limit of the scene is the same on all ranks, so that its message names no rank */
    insitu_status status = error->status == INSITU_ERROR_SCENE ? session_agree_without_rank(basis->team->comm, error)
                                                               : session_agree(basis->team->comm, error);
    warn_of_sampling_without_error_bound(basis, image);
    if (!status) set_meshes_of_parts(basis->meshes, &layers);
    for (int i = 0; i < image->isosurface_count && !status; i++)
        status = fill_isosurface_layer(basis, &image->isosurfaces[i], i, &layers, error);
    for (int i = image->isosurface_count; i < layers.first_outer && !status; i++) {
        const scene_isosurface *isosurface = &image->isosurfaces[i - image->isosurface_count];
        const scene_surface shells = session_make_shell_layer(isosurface, image->height);
        status = fill_outer_surface_layer(basis, &shells, i, &layers, error);
        /* the layer must not refer to `shells`, which does not exist any more when the layer is drawn */
        layers.surfaces[i].colours = isosurface->colours;
    }
    for (int i = 0; i < image->surface_count && !status; i++)
        status = fill_outer_surface_layer(basis, &image->surfaces[i], layers.first_outer + i, &layers, error);
    if (!status) status = fill_layers_of_slice_planes(basis, image, &layers, error);
    for (int i = 0; i < image->volume_count && !status; i++)
        status = fill_volume_layer(basis, image, i, &layers, error);
    if (status)
        session_layers_free(&layers);
    else
        *out = layers;
    return status;
}
