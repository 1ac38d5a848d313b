/* The plan: nothing is built, recentred or ranged but what an image of this step names. Whether an image can be drawn
 * is read off the catalogue, which all ranks share, so all come to the same answer without asking. */
#include "session_plan.h"

#include <stdio.h>

#include "memory.h"
#include "session_agree.h"
#include "session_shown.h"
#include "session_warnings.h"

static int resolve_component(const scene_field *field, int component_count)
{
    if (field->component != SCENE_COMPONENT_DEFAULT) return field->component;
    return component_count == 1 ? 0 : -1;
}

/* ---- can the image be drawn? --------------------------------------------------------------------------------- */

enum { NAMES_SIZE = 700 };

/* What there is, for a message. */
static void list_fields(const insitu_session *session, char names[NAMES_SIZE])
{
    size_t size = 0;
    for (int m = 0; m < session->catalogue.mesh_count; m++) {
        const session_catalogue_mesh *mesh = &session->catalogue.meshes[m];
        for (int f = 0; f < mesh->field_count && size < NAMES_SIZE; f++)
            size += (size_t)snprintf(names + size, NAMES_SIZE - size, "%s\"%s\" (mesh \"%s\")", size ? ", " : "",
                                     mesh->fields[f].name, mesh->name);
    }
    if (size == 0) snprintf(names, NAMES_SIZE, "none");
}

static void list_meshes(const insitu_session *session, char names[NAMES_SIZE])
{
    size_t size = 0;
    for (int m = 0; m < session->catalogue.mesh_count && size < NAMES_SIZE; m++)
        size += (size_t)snprintf(names + size, NAMES_SIZE - size, "%s\"%s\"", size ? ", " : "",
                                 session->catalogue.meshes[m].name);
    if (size == 0) snprintf(names, NAMES_SIZE, "none");
}

static insitu_status refuse_missing(const insitu_session *session, const scene_field *field, base_error *error)
{
    char names[NAMES_SIZE];
    list_fields(session, names);
    return base_fail(error, INSITU_ERROR_FIELD, "%s:%d: no mesh has the field \"%s\"; there are: %s",
                     session->scene_path, field->line, field->name, names);
}

/* A mesh that the layer names is there, and has the field, unless it has no cells anywhere. */
static insitu_status check_named_mesh(const insitu_session *session, const scene_field *field, const char *name,
                                      base_error *error)
{
    char names[NAMES_SIZE];
    bool is_there = false, is_well = false;
    for (int m = 0; m < session->catalogue.mesh_count; m++) {
        const session_catalogue_mesh *mesh = &session->catalogue.meshes[m];
        if (!scene_name_stands_for(name, mesh->name)) continue;
        is_there = true;
        is_well = is_well || mesh->first_rank < 0 || session_catalogue_find(mesh, field->name);
    }
    if (is_well) return INSITU_OK;
    if (is_there) {
        list_fields(session, names);
        return base_fail(error, INSITU_ERROR_FIELD, "%s:%d: mesh \"%s\" does not have the field \"%s\"; there are: %s",
                         session->scene_path, field->meshes_line, name, field->name, names);
    }
    list_meshes(session, names);
    return base_fail(error, INSITU_ERROR_MESH, "%s:%d: there is no mesh \"%s\"; there are: %s", session->scene_path,
                     field->meshes_line, name, names);
}

static insitu_status check_on_mesh(const insitu_session *session, const scene_field *field,
                                   const session_catalogue_mesh *mesh, const session_catalogue_field *found,
                                   base_error *error)
{
    if (found->odd_rank >= 0)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "rank %d: mesh \"%s\": field \"%s\" has another centring or number of components than on "
                         "rank %d",
                         found->odd_rank, mesh->name, field->name, found->first_rank);
    if (found->lacking_rank >= 0)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "rank %d: mesh \"%s\": field \"%s\" is not set, other ranks have it (%s:%d asks for it)",
                         found->lacking_rank, mesh->name, field->name, session->scene_path, field->line);
    if (field->component >= found->component_count)
        return base_fail(error, INSITU_ERROR_FIELD,
                         "%s:%d: component %d of field \"%s\" is asked for; on mesh \"%s\" it has components 0 to %d",
                         session->scene_path, field->line, field->component, field->name, mesh->name,
                         found->component_count - 1);
    return INSITU_OK;
}

/* The mesh's field where the layer shows it there, else NULL. */
static const session_catalogue_field *find_shown(const session_catalogue_mesh *mesh, const scene_field *field)
{
    return scene_field_is_on(field, mesh->name) ? session_catalogue_find(mesh, field->name) : NULL;
}

/* Some mesh has the field; and on those that the layer shows it on it is sound. */
static insitu_status check_field(const insitu_session *session, const scene_field *field, base_error *error)
{
    bool is_there = false;
    insitu_status status = INSITU_OK;
    for (int m = 0; m < session->catalogue.mesh_count && !status; m++) {
        const session_catalogue_mesh *mesh = &session->catalogue.meshes[m];
        const session_catalogue_field *shown = find_shown(mesh, field);
        is_there = is_there || session_catalogue_find(mesh, field->name);
        if (shown) status = check_on_mesh(session, field, mesh, shown, error);
    }
    return is_there || status ? status : refuse_missing(session, field, error);
}

static insitu_status check_layer_field(const insitu_session *session, const scene_field *field, base_error *error)
{
    insitu_status status = check_field(session, field, error);
    for (int i = 0; i < field->mesh_count && !status; i++)
        status = check_named_mesh(session, field, field->meshes[i], error);
    return status;
}

/* Meshes that have the surface but not what colours it. */
static void warn_of_grey(insitu_session *session, const scene_image *image, const scene_isosurface *layer)
{
    for (int m = 0; m < session->catalogue.mesh_count; m++) {
        const session_catalogue_mesh *mesh = &session->catalogue.meshes[m];
        const bool is_grey = mesh->first_rank >= 0 && find_shown(mesh, &layer->field) &&
                             !session_catalogue_find(mesh, layer->colour_by.name);
        const session_warning warning = {WARNING_GREY, image->name, mesh->name, layer->colour_by.line};
        session_warn(session, &warning, is_grey,
                     "image \"%s\": mesh \"%s\" does not have the field \"%s\": its isosurface of \"%s\" is grey",
                     image->name, mesh->name, layer->colour_by.name, layer->field.name);
    }
}

static insitu_status check_image(const insitu_session *session, const scene_image *image, base_error *error)
{
    int values = 0;
    insitu_status status = INSITU_OK;
    for (int i = 0; i < image->isosurface_count && !status; i++) {
        const scene_isosurface *layer = &image->isosurfaces[i];
        values += layer->value_count;
        status = check_layer_field(session, &layer->field, error);
        if (!status && layer->has_colour_by) status = check_field(session, &layer->colour_by, error);
    }
    for (int i = 0; i < image->volume_count && !status; i++)
        status = check_layer_field(session, &image->volumes[i].field, error);
    if (!status && (values > RENDER_MAX_ISOVALUES || image->volume_count > RENDER_MAX_VOLUMES))
        status = base_fail(error, INSITU_ERROR_SCENE,
                           "%s:%d: image \"%s\" has %d isovalues and %d volumes, at most %d and %d are supported",
                           session->scene_path, image->line, image->name, values, image->volume_count,
                           RENDER_MAX_ISOVALUES, RENDER_MAX_VOLUMES);
    return status;
}

/* ---- what it needs of this rank ------------------------------------------------------------------------------ */

static session_scalar *find_scalar(const session_mesh *mesh, int field, int component, bool is_recentred)
{
    for (int i = 0; i < mesh->scalar_count; i++) {
        session_scalar *scalar = &mesh->scalars[i];
        if (scalar->field == field && scalar->component == component && scalar->is_recentred == is_recentred)
            return scalar;
    }
    return NULL;
}

/* -1 where the layer does not show the field on the mesh. */
static int find_field(const session_mesh *mesh, const scene_field *field)
{
    return scene_field_is_on(field, mesh->name) ? session_find_field(mesh, field->name) : -1;
}

session_scalar *session_find_scalar(const session_mesh *mesh, const scene_field *field)
{
    const int index = find_field(mesh, field);
    if (index < 0) return NULL;
    const insitu_field *given = &mesh->fields[index].given;
    return find_scalar(mesh, index, resolve_component(field, given->component_count),
                       field->at_vertices && given->centring == INSITU_CELL);
}

/* As the caller gave it. */
static grid_field given_field(const session_mesh *mesh, const session_scalar *scalar)
{
    const session_field *field = &mesh->fields[scalar->field];
    return (grid_field){.values = field->values,
                        .component_stride = field->component_stride,
                        .component_count = field->given.component_count,
                        .component = scalar->component,
                        .is_cell_centred = field->given.centring == INSITU_CELL};
}

grid_field session_scalar_field(const session_mesh *mesh, const session_scalar *scalar)
{
    if (!scalar->is_recentred) return given_field(mesh, scalar);
    return (grid_field){.values = {(const char *)scalar->vertex_values, (int64_t)sizeof(double), true, false},
                        .component_stride = (int64_t)sizeof(double),
                        .component_count = 1,
                        .own = &scalar->own};
}

static bool add_scalar(session_mesh *mesh, int field, int component, bool is_recentred)
{
    session_scalar *scalars = base_realloc(mesh->scalars, (size_t)(mesh->scalar_count + 1) * sizeof *scalars);
    if (!scalars) return false;
    mesh->scalars = scalars;
    scalars[mesh->scalar_count++] = (session_scalar){.field = field,
                                                     .component = component,
                                                     .is_recentred = is_recentred,
                                                     .are_values_stale = true,
                                                     .is_suspect = true,
                                                     .are_ranges_stale = true};
    return true;
}

/* *marked: NULL where the mesh does not have the field. */
static bool mark_scalar(session_mesh *mesh, const scene_field *field, bool wants_ranges, session_scalar **marked)
{
    const int index = find_field(mesh, field);
    *marked = NULL;
    if (index < 0) return true;
    const insitu_field *given = &mesh->fields[index].given;
    session_scalar *scalar = session_find_scalar(mesh, field);
    if (!scalar) {
        if (!add_scalar(mesh, index, resolve_component(field, given->component_count),
                        field->at_vertices && given->centring == INSITU_CELL))
            return false;
        scalar = &mesh->scalars[mesh->scalar_count - 1];
    }
    scalar->is_used = true;
    scalar->own = given_field(mesh, scalar);
    scalar->wants_ranges = scalar->wants_ranges || wants_ranges;
    mesh->is_needed = mesh->is_needed || wants_ranges;
    *marked = scalar;
    return true;
}

static bool mark_surface(session_mesh *mesh, const scene_isosurface *layer)
{
    session_scalar *scalar;
    if (!mark_scalar(mesh, &layer->field, true, &scalar)) return false;
    if (!scalar) return true;
    if (!session_shown_surface(scalar, layer)) return false;
    return !layer->has_colour_by || mark_scalar(mesh, &layer->colour_by, false, &scalar);
}

static bool mark_volume(const insitu_session *session, session_mesh *mesh, const scene_volume *layer)
{
    session_scalar *scalar;
    if (!mark_scalar(mesh, &layer->field, true, &scalar)) return false;
    return !scalar || session_shown_volume(session, scalar, layer);
}

static bool mark_image(const insitu_session *session, session_mesh *mesh, const scene_image *image)
{
    bool is_marked = true;
    for (int i = 0; i < image->isosurface_count && is_marked; i++)
        is_marked = mark_surface(mesh, &image->isosurfaces[i]);
    for (int i = 0; i < image->volume_count && is_marked; i++)
        is_marked = mark_volume(session, mesh, &image->volumes[i]);
    return is_marked;
}

static bool mark_meshes(insitu_session *session, const session_plan *plan)
{
    for (int m = 0; m < session->mesh_count; m++) {
        session_mesh *mesh = session->meshes[m];
        mesh->is_needed = false;
        for (int i = 0; i < mesh->scalar_count; i++) {
            mesh->scalars[i].is_used = mesh->scalars[i].wants_ranges = false;
            session_shown_clear(&mesh->scalars[i]);
        }
        for (int i = 0; i < plan->image_count && mesh->is_given; i++)
            if (!mark_image(session, mesh, plan->images[i])) return false;
    }
    return true;
}

/* ---- what is to be recentred --------------------------------------------------------------------------------- */

static bool add_recentring(session_plan *plan, session_recentring item)
{
    for (int i = 0; i < plan->recentring_count; i++) {
        const session_recentring *other = &plan->recentrings[i];
        if (other->mesh == item.mesh && other->field == item.field && other->component == item.component) return true;
    }
    session_recentring *items =
        base_realloc(plan->recentrings, (size_t)(plan->recentring_count + 1) * sizeof *plan->recentrings);
    if (!items) return false;
    plan->recentrings = items;
    items[plan->recentring_count++] = item;
    return true;
}

static bool add_recentrings(const insitu_session *session, session_plan *plan, const scene_field *field)
{
    if (!field->at_vertices) return true;
    for (int m = 0; m < session->catalogue.mesh_count; m++) {
        const session_catalogue_mesh *mesh = &session->catalogue.meshes[m];
        const session_catalogue_field *shown = find_shown(mesh, field);
        if (!shown || !shown->is_cell_centred) continue;
        const session_recentring item = {mesh, shown->name, resolve_component(field, shown->component_count)};
        if (!add_recentring(plan, item)) return false;
    }
    return true;
}

static bool plan_recentrings(const insitu_session *session, session_plan *plan)
{
    bool is_planned = true;
    for (int i = 0; i < plan->image_count; i++) {
        const scene_image *image = plan->images[i];
        for (int s = 0; s < image->isosurface_count && is_planned; s++)
            is_planned = add_recentrings(session, plan, &image->isosurfaces[s].field) &&
                         (!image->isosurfaces[s].has_colour_by ||
                          add_recentrings(session, plan, &image->isosurfaces[s].colour_by));
        for (int v = 0; v < image->volume_count && is_planned; v++)
            is_planned = add_recentrings(session, plan, &image->volumes[v].field);
    }
    return is_planned;
}

/* ---- the whole ----------------------------------------------------------------------------------------------- */

/* Without cells anywhere no field can be asked of anyone: the picture is its background. */
static bool can_be_drawn(insitu_session *session, const scene_image *image, base_error *refusal)
{
    if (session->extent.cell_count == 0) return true;
    if (check_image(session, image, refusal) != INSITU_OK) return false;
    for (int i = 0; i < image->isosurface_count; i++)
        if (image->isosurfaces[i].has_colour_by) warn_of_grey(session, image, &image->isosurfaces[i]);
    return true;
}

void session_plan_free(session_plan *plan)
{
    base_free(plan->images);
    base_free(plan->recentrings);
    *plan = (session_plan){0};
}

insitu_status session_make_plan(insitu_session *session, const scene_image *const *due, int count, session_plan *out,
                                base_error *refusal, base_error *error)
{
    session_plan plan = {.images = base_calloc((size_t)count, sizeof *plan.images)};
    bool is_whole = plan.images != NULL;
    for (int i = 0; i < count && is_whole; i++)
        if (can_be_drawn(session, due[i], refusal)) plan.images[plan.image_count++] = due[i];
    is_whole = is_whole && plan_recentrings(session, &plan) && mark_meshes(session, &plan);
    if (!is_whole) session_no_memory(error, count * (int64_t)sizeof *plan.images, "the plan of the images");
    const insitu_status status = session_agree(session->comm, error);
    if (status)
        session_plan_free(&plan);
    else
        *out = plan;
    return status;
}
