/* Makes the plan of a step: trees, recentred values and ranges are computed only if an image of this step uses them.
 * All ranks have the same catalogue, and only the catalogue determines whether an image can be drawn. Therefore all
 * ranks make the same plan without communication. */
#include "session_plan.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_shorthand.h"
#include "session_agree.h"
#include "session_candidates.h"
#include "session_derived.h"
#include "session_events.h"
#include "session_filled.h"
#include "session_indexed.h"
#include "session_recentre.h"
#include "session_scalars.h"
#include "session_shells.h"

/* ---- images that can be drawn ------------------------------------------------------------------------------- */

enum { NAMES_SIZE = 700 };

/* Lists the names of the fields that exist, for a message. */
static void write_field_names(const session_catalogue *catalogue, char names[NAMES_SIZE])
{
    size_t size = 0;
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        for (int f = 0; f < mesh->field_count && size < NAMES_SIZE; f++)
            size += (size_t)snprintf(names + size, NAMES_SIZE - size, "%s\"%s\" (mesh \"%s\")", size ? ", " : "",
                                     mesh->fields[f].name, mesh->name);
    }
    if (size == 0) snprintf(names, NAMES_SIZE, "none");
}

static void write_mesh_names(const session_catalogue *catalogue, char names[NAMES_SIZE])
{
    size_t size = 0;
    for (int m = 0; m < catalogue->mesh_count && size < NAMES_SIZE; m++)
        size +=
            (size_t)snprintf(names + size, NAMES_SIZE - size, "%s\"%s\"", size ? ", " : "", catalogue->meshes[m].name);
    if (size == 0) snprintf(names, NAMES_SIZE, "none");
}

/* Copies the fault, an error that was found when a mesh or field was checked, to *error and returns its status. Returns
 * INSITU_OK if there is no fault (NULL). */
static insitu_status copy_fault(const base_error *fault, base_error *error)
{
    if (!fault) return INSITU_OK;
    *error = *fault;
    return error->status;
}

/* Returns the fault of a mesh on which the layer is drawn; NULL if there is none. A faulty mesh is reported before a
 * missing field, because the mesh may be the one that has the field. */
static const base_error *find_fault_of_drawn_mesh(const session_plan_basis *basis, const scene_field *field)
{
    for (int m = 0; m < basis->catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &basis->catalogue->meshes[m];
        if (mesh->fault && scene_field_selects_mesh(field, mesh->name)) return mesh->fault;
    }
    return NULL;
}

static bool is_field_on_any_mesh(const session_catalogue *catalogue, const char *name)
{
    for (int m = 0; m < catalogue->mesh_count; m++)
        if (session_catalogue_find_field(&catalogue->meshes[m], name)) return true;
    return false;
}

/* Writes "did you mean" and the most similar field name to `words`, or "" if no name is similar. */
static void write_suggestion(const session_catalogue *catalogue, const char *name, char words[300])
{
    const char *candidates[256];
    int count = 0;
    for (int m = 0; m < catalogue->mesh_count; m++)
        for (int f = 0; f < catalogue->meshes[m].field_count && count < 256; f++)
            candidates[count++] = catalogue->meshes[m].fields[f].name;
    const char *meant = scene_find_most_similar_word(name, candidates, count);
    words[0] = '\0';
    if (meant) snprintf(words, 300, " (did you mean %.255s?)", meant);
}

/* Stores the error that a derived field exists on no mesh, and names the input that no mesh has. Returns the error's
 * status; INSITU_OK if the field is not a derived one. */
static insitu_status fail_for_missing_input(const session_plan_basis *basis, const scene_field *field,
                                            base_error *error)
{
    char names[NAMES_SIZE], meant[300];
    const int number = scene_find_derived(basis->scene, field->name);
    const scene_derived *derived = number < 0 ? NULL : &basis->scene->derived[number];
    if (!derived) return INSITU_OK;
    for (int k = 0; k < derived->input_count; k++) {
        const scene_field *input = &derived->inputs[k];
        if (is_field_on_any_mesh(basis->catalogue, input->name)) continue;
        if (copy_fault(find_fault_of_drawn_mesh(basis, input), error) || fail_for_missing_input(basis, input, error))
            return error->status;
        write_field_names(basis->catalogue, names);
        write_suggestion(basis->catalogue, input->name, meant);
        return base_fail(error, INSITU_ERROR_FIELD,
                         "%s:%d: fields.%s: no mesh has the field \"%s\"%s, of which it is made; there are: %s",
                         basis->scene_path, derived->line, derived->name, input->name, meant, names);
    }
    write_field_names(basis->catalogue, names);
    return base_fail(error, INSITU_ERROR_FIELD,
                     "%s:%d: fields.%s: no mesh has all the fields that it is made of; there are: %s",
                     basis->scene_path, derived->line, derived->name, names);
}

static insitu_status fail_for_missing_field(const session_plan_basis *basis, const scene_field *field,
                                            base_error *error)
{
    char names[NAMES_SIZE], meant[300];
    if (copy_fault(find_fault_of_drawn_mesh(basis, field), error)) return error->status;
    if (fail_for_missing_input(basis, field, error)) return error->status;
    write_field_names(basis->catalogue, names);
    write_suggestion(basis->catalogue, field->name, meant);
    return base_fail(error, INSITU_ERROR_FIELD, "%s:%d: no mesh has the field \"%s\"%s; there are: %s",
                     basis->scene_path, field->line, field->name, meant, names);
}

/* Checks that a mesh that the scene names for a layer exists, and that it has the layer's field. The second check is
 * omitted if no rank has cells of the mesh. */
static insitu_status check_named_mesh(const session_plan_basis *basis, const scene_field *field, const char *name,
                                      base_error *error)
{
    char names[NAMES_SIZE];
    bool is_there = false, is_drawable = false;
    for (int m = 0; m < basis->catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &basis->catalogue->meshes[m];
        if (!scene_name_selects_mesh(name, mesh->name)) continue;
        if (copy_fault(mesh->fault, error)) return error->status;
        is_there = true;
        is_drawable =
            is_drawable || !field->name || mesh->first_rank < 0 || session_catalogue_find_field(mesh, field->name);
    }
    if (is_drawable) return INSITU_OK;
    if (is_there) {
        write_field_names(basis->catalogue, names);
        return base_fail(error, INSITU_ERROR_FIELD, "%s:%d: mesh \"%s\" does not have the field \"%s\"; there are: %s",
                         basis->scene_path, field->meshes_line, name, field->name, names);
    }
    write_mesh_names(basis->catalogue, names);
    return base_fail(error, INSITU_ERROR_MESH, "%s:%d: there is no mesh \"%s\"; there are: %s", basis->scene_path,
                     field->meshes_line, name, names);
}

static insitu_status check_field_on_mesh(const session_plan_basis *basis, const scene_field *field,
                                         const session_catalogue_mesh *mesh, const session_catalogue_field *found,
                                         base_error *error)
{
    if (copy_fault(mesh->fault, error) || copy_fault(found->fault, error)) return error->status;
    if (found->differing_rank >= 0)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "rank %d: mesh \"%s\": field \"%s\" has another centring or number of components than on "
                         "rank %d",
                         found->differing_rank, mesh->name, field->name, found->first_rank);
    if (found->lacking_rank >= 0)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "rank %d: mesh \"%s\": field \"%s\" is not set, other ranks have it (%s:%d asks for it)",
                         found->lacking_rank, mesh->name, field->name, basis->scene_path, field->line);
    if (field->component >= found->component_count)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "%s:%d: component %d of field \"%s\" is asked for; on mesh \"%s\" it has components 0 to %d",
                         basis->scene_path, field->line, field->component, field->name, mesh->name,
                         found->component_count - 1);
    return INSITU_OK;
}

/* Returns the mesh's field if the layer is drawn on the mesh, else NULL. */
static const session_catalogue_field *find_drawn_field(const session_catalogue_mesh *mesh, const scene_field *field)
{
    return scene_field_selects_mesh(field, mesh->name) ? session_catalogue_find_field(mesh, field->name) : NULL;
}

/* Checks that some mesh has the field, and that the field has no fault on the meshes on which the layer is drawn.
 * layer: the field whose list of meshes (scene_field.meshes) selects these meshes. */
static insitu_status check_field(const session_plan_basis *basis, const scene_field *field, const scene_field *layer,
                                 base_error *error)
{
    bool is_there = false;
    insitu_status status = INSITU_OK;
    for (int m = 0; m < basis->catalogue->mesh_count && !status; m++) {
        const session_catalogue_mesh *mesh = &basis->catalogue->meshes[m];
        const session_catalogue_field *shown =
            scene_field_selects_mesh(layer, mesh->name) ? session_catalogue_find_field(mesh, field->name) : NULL;
        is_there = is_there || session_catalogue_find_field(mesh, field->name);
        if (shown) status = check_field_on_mesh(basis, field, mesh, shown, error);
    }
    return is_there || status ? status : fail_for_missing_field(basis, field, error);
}

static insitu_status check_layer_field(const session_plan_basis *basis, const scene_field *field, base_error *error)
{
    insitu_status status = check_field(basis, field, field, error);
    for (int i = 0; i < field->mesh_count && !status; i++)
        status = check_named_mesh(basis, field, field->meshes[i], error);
    return status;
}

static const char *describe_missing_colour(const scene_colour_map *map)
{
    return map->has_nan ? "of the colour nan" : "grey";
}

/* Warns of meshes on which an isosurface is drawn without its colours, because they lack the field that colours it. */
static void warn_of_grey_isosurface(const session_catalogue *catalogue, const scene_image *image,
                                    const scene_isosurface *layer, session_report *report)
{
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        const bool is_grey = mesh->first_rank >= 0 && find_drawn_field(mesh, &layer->field) &&
                             !session_catalogue_find_field(mesh, layer->colour_by.name);
        const session_warning warning = {WARNING_GREY, image->name, mesh->name, layer->colour_by.line};
        session_warn(report, &warning, is_grey,
                     "image \"%s\": mesh \"%s\" does not have the field \"%s\": its isosurface of \"%s\" is %s",
                     image->name, mesh->name, layer->colour_by.name, layer->field.name,
                     describe_missing_colour(&layer->colour_map));
    }
}

/* Checks the field of a layer's contour lines on the meshes on which the layer is drawn. on: the field whose list of
 * meshes selects these meshes. */
static insitu_status check_field_of_contour_lines(const session_plan_basis *basis, const scene_lines *lines,
                                                  const scene_field *on, base_error *error)
{
    return lines->is_given ? check_field(basis, &lines->field, on, error) : INSITU_OK;
}

static insitu_status check_surface(const session_plan_basis *basis, const scene_surface *layer, base_error *error)
{
    insitu_status status = copy_fault(find_fault_of_drawn_mesh(basis, &layer->meshes_field), error);
    for (int i = 0; i < layer->meshes_field.mesh_count && !status; i++)
        status = check_named_mesh(basis, &layer->meshes_field, layer->meshes_field.meshes[i], error);
    if (!status && layer->threshold.is_given)
        status = check_field(basis, &layer->threshold.field, &layer->meshes_field, error);
    if (!status) status = check_field_of_contour_lines(basis, &layer->lines, &layer->meshes_field, error);
    return status || !layer->has_colour_by ? status
                                           : check_field(basis, &layer->colour_by, &layer->meshes_field, error);
}

static insitu_status check_image(const session_plan_basis *basis, const scene_image *image, base_error *error)
{
    insitu_status status = copy_fault(basis->catalogue->fault, error);
    for (int i = 0; i < image->isosurface_count && !status; i++) {
        const scene_isosurface *layer = &image->isosurfaces[i];
        status = check_layer_field(basis, &layer->field, error);
        if (!status && layer->has_colour_by) status = check_field(basis, &layer->colour_by, &layer->field, error);
        if (!status) status = check_field_of_contour_lines(basis, &layer->lines, &layer->field, error);
    }
    for (int i = 0; i < image->volume_count && !status; i++)
        status = check_layer_field(basis, &image->volumes[i].field, error);
    for (int i = 0; i < image->slice_count && !status; i++) {
        status = check_layer_field(basis, &image->slices[i].field, error);
        if (!status)
            status = check_field_of_contour_lines(basis, &image->slices[i].lines, &image->slices[i].field, error);
    }
    for (int i = 0; i < image->surface_count && !status; i++) status = check_surface(basis, &image->surfaces[i], error);
    return status;
}

/* ---- cell fields that must be averaged to vertices --------------------------------------------------------------- */

static bool add_recentrings(const session_catalogue *catalogue, session_plan *plan, const scene_field *field)
{
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        const session_catalogue_field *shown = find_drawn_field(mesh, field);
        const bool is_shown_recentred = shown && session_is_recentred(field, shown->centring, mesh->is_refined);
        session_mesh_group *mesh_group =
            is_shown_recentred
                ? session_find_mesh_group(catalogue, session_find_group_name_of_mesh(mesh, field->mesh_group_name))
                : NULL;
        if (!mesh_group) continue;
        const session_recentring item = {mesh_group, field->name,
                                         session_resolve_component(field, shown->component_count)};
        if (!session_add_recentring(&plan->recentrings, &plan->recentring_count, &item)) return false;
    }
    return true;
}

static bool plan_recentrings(const session_catalogue *catalogue, session_plan *plan)
{
    bool is_planned = true;
    for (int i = 0; i < plan->image_count; i++) {
        /* views of an orbit share the layers of their first view, so that only the first view is checked */
        if (plan->images[i]->variant.view > 0) continue;
        scene_field_walk walk = {.image = plan->images[i]};
        for (const scene_field *field; is_planned && (field = scene_find_next_field_of_layers(&walk)) != NULL;)
            is_planned = walk.role == SCENE_THRESHOLD || add_recentrings(catalogue, plan, field);
    }
    plan->stale = base_calloc((size_t)plan->recentring_count + 1, sizeof *plan->stale);
    return is_planned && plan->stale;
}

/* ---- images that are due ----------------------------------------------------------------------------------------- */

/* Returns how many multiples of `interval` are not larger than `time`. A multiple that exceeds `time` only by rounding
 * is counted too, because ten steps of 0.1 add up to slightly less than 1. */
static double count_elapsed_intervals(double time, double interval)
{
    const double count = time / interval;
    return floor(count + 1e-9 * fmax(1, fabs(count)));
}

bool session_is_image_due(const scene_image *image, const session_moment *m)
{
    if (image->time_interval > 0)
        return m->is_first || count_elapsed_intervals(m->time, image->time_interval) !=
                                  count_elapsed_intervals(m->last_time, image->time_interval);
    return image->cycle_interval <= 1 || m->cycle % image->cycle_interval == 0;
}

/* Returns whether any rank has cells, or any mesh has a fault. Otherwise a picture shows only its background, so that
 * missing fields are no error. */
static bool has_cells_or_faults(const session_plan_basis *basis)
{
    return basis->extent->cell_count > 0 || basis->catalogue->has_faults;
}

session_valid_events session_check_event_fields(const session_plan_basis *basis, bool images, base_error *error)
{
    const scene *scene = basis->scene;
    session_valid_events valid = {UINT64_MAX, UINT64_MAX};
    if (!has_cells_or_faults(basis)) return valid;
    for (int i = 0; i < scene->statistics_count; i++) {
        base_error own = {.status = INSITU_OK};
        if (!session_are_statistics_due(&scene->statistics[i], basis->moment->cycle)) continue;
        if (check_layer_field(basis, &scene->statistics[i].field, &own)) valid.statistics &= ~(UINT64_C(1) << i);
        if (!error->status) *error = own;
    }
    for (int i = 0; i < scene->image_count && images; i++) {
        const scene_image *image = &scene->images[i];
        base_error own = {.status = INSITU_OK};
        if (!image->condition.is_given || !scene_is_first_variant(image)) continue;
        if (check_layer_field(basis, &image->condition.field, &own))
            valid.images &= ~(UINT64_C(1) << image->variant.source);
        if (!error->status) *error = own;
    }
    return valid;
}

int session_count_due_images(const scene *scene, const session_moment *moment)
{
    int count = 0;
    for (int i = 0; i < scene->image_count; i++) count += session_is_image_due(&scene->images[i], moment);
    return count;
}

static void warn_of_grey_surface(const session_catalogue *catalogue, const scene_image *image,
                                 const scene_surface *layer, session_report *report)
{
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        const bool is_grey = mesh->first_rank >= 0 && scene_field_selects_mesh(&layer->meshes_field, mesh->name) &&
                             !session_catalogue_find_field(mesh, layer->colour_by.name);
        const session_warning warning = {WARNING_GREY, image->name, mesh->name, layer->colour_by.line};
        session_warn(report, &warning, is_grey,
                     "image \"%s\": mesh \"%s\" does not have the field \"%s\": its outer surface is %s", image->name,
                     mesh->name, layer->colour_by.name, describe_missing_colour(&layer->colour_map));
    }
}

/* Warns of meshes on which a layer is drawn but which lack the field of the layer's contour lines. on: the field of
 * which the layer is made; it selects the meshes on which the layer is drawn. An outer surface is made of no field:
 * on->name is then NULL, and only on->meshes selects meshes. */
static void warn_of_missing_contour_lines(const session_catalogue *catalogue, const scene_image *image,
                                          const scene_field *on, const scene_lines *lines, session_report *report)
{
    for (int m = 0; m < catalogue->mesh_count && lines->is_given && !lines->is_of_colours; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        const bool is_on = on->name ? find_drawn_field(mesh, on) != NULL : scene_field_selects_mesh(on, mesh->name);
        const session_warning warning = {WARNING_NO_LINES, image->name, mesh->name, lines->field.line};
        session_warn(report, &warning,
                     mesh->first_rank >= 0 && is_on && !session_catalogue_find_field(mesh, lines->field.name),
                     "image \"%s\": mesh \"%s\" does not have the field \"%s\": a layer has no lines on it",
                     image->name, mesh->name, lines->field.name);
    }
}

/* Warns of a layer whose meshes contain only shells. */
static void warn_of_shells(const session_catalogue *catalogue, const scene_image *image, const char *layer,
                           const scene_field *field, session_report *report)
{
    const char *name = NULL;
    bool is_empty = true;
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        if (mesh->first_rank < 0 || !find_drawn_field(mesh, field)) continue;
        is_empty = is_empty && mesh->has_shells_alone;
        if (!name) name = mesh->name;
    }
    const session_warning warning = {WARNING_SHELLS, image->name, field->name, field->line};
    session_warn(report, &warning, name && is_empty,
                 "image \"%s\": the %s of \"%s\" shows nothing: the cells that have the field, as on mesh \"%s\", are "
                 "triangles, quads and polygons, which a layer surface: {colour_by: {field: %s}} draws",
                 image->name, layer, field->name, name ? name : "", field->name);
}

/* Warns of a mesh with global vertex ids if a layer averages values at the vertices of this and other meshes, because
 * vertices of this mesh are not matched with those of other meshes. */
static void warn_of_ungrouped_mesh(const session_catalogue *catalogue, const scene_image *image, const char *layer,
                                   const scene_field *field, session_report *report)
{
    const char *name = NULL;
    int count = 0;
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *mesh = &catalogue->meshes[m];
        const session_catalogue_field *shown = mesh->first_rank >= 0 ? find_drawn_field(mesh, field) : NULL;
        if (!shown || !session_is_recentred(field, shown->centring, mesh->is_refined)) continue;
        if (mesh->single_group_name && !name) name = mesh->name;
        count++;
    }
    const session_warning warning = {WARNING_APART, image->name, field->name, field->line};
    session_warn(report, &warning, name && count > 1,
                 "image \"%s\": the %s of \"%s\" may have a step where mesh \"%s\" meets others: its vertices are "
                 "matched by their ids, among themselves alone; without vertex_ids those of all meshes are matched",
                 image->name, layer, field->name, name ? name : "");
}

static void warn_of_shells_and_ungrouped_meshes(const session_catalogue *catalogue, const scene_image *image,
                                                session_report *report)
{
    scene_field_walk walk = {.image = image};
    for (const scene_field *field; (field = scene_find_next_field_of_layers(&walk)) != NULL;) {
        const char *layer = scene_get_layer_word(walk.kind);
        if (walk.role == SCENE_SHOWN && walk.kind != SCENE_ISOSURFACE)
            warn_of_shells(catalogue, image, layer, field, report);
        if (walk.role == SCENE_SHOWN) warn_of_ungrouped_mesh(catalogue, image, layer, field, report);
    }
}

static void warn_of_grey_layers(const session_catalogue *catalogue, const scene_image *image, session_report *report)
{
    for (int i = 0; i < image->isosurface_count; i++)
        if (image->isosurfaces[i].has_colour_by)
            warn_of_grey_isosurface(catalogue, image, &image->isosurfaces[i], report);
    for (int i = 0; i < image->surface_count; i++)
        if (image->surfaces[i].has_colour_by) warn_of_grey_surface(catalogue, image, &image->surfaces[i], report);
    for (int i = 0; i < image->isosurface_count; i++)
        warn_of_missing_contour_lines(catalogue, image, &image->isosurfaces[i].field, &image->isosurfaces[i].lines,
                                      report);
    for (int i = 0; i < image->surface_count; i++)
        warn_of_missing_contour_lines(catalogue, image, &image->surfaces[i].meshes_field, &image->surfaces[i].lines,
                                      report);
    for (int i = 0; i < image->slice_count; i++)
        warn_of_missing_contour_lines(catalogue, image, &image->slices[i].field, &image->slices[i].lines, report);
}

static bool check_image_and_warn(const session_plan_basis *basis, const scene_image *image, session_report *report,
                                 base_error *refusal)
{
    if (!has_cells_or_faults(basis)) return true;
    if (check_image(basis, image, refusal) != INSITU_OK) return false;
    warn_of_grey_layers(basis->catalogue, image, report);
    warn_of_shells_and_ungrouped_meshes(basis->catalogue, image, report);
    return true;
}

void session_plan_free(session_plan *plan)
{
    base_free(plan->images);
    base_free(plan->recentrings);
    base_free(plan->stale);
    *plan = (session_plan){0};
}

/* Returns whether an image has no outputs and pictures are not kept in memory, so that the image would be lost. Warns
 * in this case. */
static bool lacks_outputs(const session_plan_basis *basis, const scene_image *image, session_report *report)
{
    const bool is_lacking = image->output_count == 0 && !basis->keeps_pictures;
    session_warn(
        report, &(session_warning){WARNING_OUTPUTS, image->name, NULL, 0}, is_lacking,
        "image \"%s\": it has no outputs, and pictures are not kept in memory (insitu_keep_pictures): it is not "
        "drawn; outputs: \"%s_{cycle:06}.png\" would write them",
        image->name, image->name);
    return is_lacking;
}

/* Selects the images that are due and can be drawn. The views of an orbit have the same layers, so that the layers are
 * checked, and warned of, only for the first view. */
static void select_images(const session_plan_basis *basis, session_report *report, session_plan *plan)
{
    bool is_drawable = false;
    for (int i = 0; i < basis->scene->image_count; i++) {
        const scene_image *image = &basis->scene->images[i];
        if (!(basis->allowed_images >> image->variant.source & 1) || !session_is_image_due(image, basis->moment))
            continue;
        if (image->variant.view == 0) is_drawable = check_image_and_warn(basis, image, report, &plan->refusal);
        if (!is_drawable || lacks_outputs(basis, image, report)) continue;
        plan->images[plan->image_count++] = image;
        if (image->variant.view > 0) continue;
        plan->slice_count += image->slice_count;
        plan->surface_count += image->surface_count;
        if (session_has_shells(basis->catalogue)) plan->surface_count += image->isosurface_count;
    }
}

static void warn_of_no_cells(const session_plan_basis *basis, bool are_images_due, session_report *report)
{
    session_warn(report, &(session_warning){WARNING_NO_CELLS, NULL, NULL, 0},
                 are_images_due && !has_cells_or_faults(basis), "pictures show their background alone: %s",
                 basis->catalogue->mesh_count ? "no mesh has cells on any rank but ghosts" : "no rank has set a mesh");
}

insitu_status session_make_plan(const session_plan_basis *basis, session_meshes *meshes, const session_team *team,
                                session_report *report, session_plan *out, base_error *error)
{
    const size_t due = (size_t)session_count_due_images(basis->scene, basis->moment);
    const session_extent *extent = basis->extent;
    session_plan plan = {.images = base_calloc(due, sizeof *plan.images), .cell_count = extent->cell_count};
    if (plan.images) select_images(basis, report, &plan);
    warn_of_no_cells(basis, plan.image_count > 0, report);
    const bool is_whole = plan.images && plan_recentrings(basis->catalogue, &plan) &&
                          session_mark_needed_data(meshes, plan.images, plan.image_count, extent);
    if (is_whole)
        session_mark_source_fields(basis->scene, session_find_derived_fields_of_plan(basis->scene, &plan), meshes);
    if (!is_whole) session_fail_for_memory(error, (int64_t)(due * sizeof *plan.images), "the plan of the images");
    insitu_status status =
        /* fill functions may be collective, so that all ranks must agree on the status before they are called */
        basis->is_filled ? session_agree(team->comm, error) : INSITU_OK;
    if (!status) {
        if (is_whole) session_fill_fields(meshes, basis->catalogue, true, error);
        if (is_whole) session_copy_used_fields(meshes, team->threads, error);
        status = session_agree(team->comm, error);
    }
    if (status)
        session_plan_free(&plan);
    else
        *out = plan;
    return status;
}
