/* A mirror image has the fields of its source mesh, with the same arrays. Therefore the mirror image has the same
 * colours as the source, also if components of vectors are shown. For a field with a fill function, the image takes the
 * values that the function has already computed for the source. Derived fields have the values of the source's derived
 * fields. */
#include "session_mirrors.h"

#include <math.h>

#include "memory.h"
#include "session_agree.h"
#include "session_field_input.h"
#include "session_mirror.h"
#include "session_scalars.h"
#include "session_warped.h"

enum { ALL_AXES = 7 };

/* ---- fields ------------------------------------------------------------------------------------------------------ */

/* The fill function of a mirror image's field. It returns the values, or the error, of the call of the source's fill
 * function in this step. If that function has not been called, *field is not changed. */
static insitu_status copy_source_values(void *of_image, insitu_field *field)
{
    session_mesh *image = of_image;
    const int index = session_find_field(image, field->name), at = session_find_field(image->source, field->name);
    if (index < 0 || at < 0) return INSITU_ERROR_INTERNAL;
    const session_field *from = &image->source->fields[at];
    if (from->fill_problem.status || !from->is_filled) return from->fill_problem.status;
    const insitu_field *given = &from->given;
    field->count = given->count;
    field->values = given->values;
    field->component_stride_bytes = given->component_stride_bytes;
    field->components = given->components;
    field->index = given->index;
    field->corner_row = given->corner_row;
    field->patch_count = given->patch_count;
    field->patches = given->patches;
    field->changed = image->fields[index].source_version == from->version ? INSITU_CHANGED_NOTHING : INSITU_CHANGED_ALL;
    image->fields[index].source_version = from->version;
    return INSITU_OK;
}

/* Returns a description of the source's field with which it is set on the image. */
static insitu_field describe_field(session_mesh *image, const session_field *from)
{
    insitu_field out = from->given;
    out.changed = INSITU_CHANGED_ALL;
    if (!out.fill) return out;
    insitu_field_defaults(&out);
    out.name = from->given.name;
    out.component_count = from->given.component_count;
    out.centring = from->given.centring;
    out.fill = copy_source_values;
    out.fill_data = image;
    return out;
}

/* Sets a field of the source mesh on its mirror image, unless the image already has the field's current values. */
static insitu_status set_field_on_mirror_image(session_meshes *meshes, session_mesh *image, const session_field *from,
                                               base_error *error)
{
    const int at = session_find_field(image, from->given.name);
    const bool is_new = at < 0;
    if (from->is_derived) {
        session_field *added = is_new ? session_add_field(image, from->given.name) : NULL;
        if (!is_new) return INSITU_OK;
        if (!added) return session_fail_for_memory(error, 100, "the fields of a mirrored mesh");
        added->given.component_count = from->given.component_count;
        added->given.centring = from->given.centring;
        added->is_derived = true;
        return INSITU_OK;
    }
    if (from->problem.status || (!from->values.data && !from->given.fill && from->given.count)) return INSITU_OK;
    if (!is_new && (from->given.fill || image->fields[at].source_version == from->version)) return INSITU_OK;
    const insitu_field given = describe_field(image, from);
    const insitu_status status = session_set_part_field(meshes, image, &given, error);
    if (!status && !given.fill) image->fields[session_find_field(image, given.name)].source_version = from->version;
    return status;
}

static void set_fields_on_mirror_image(session_meshes *meshes, session_mesh *image, base_error *error)
{
    for (int f = 0; f < image->source->field_count && !error->status; f++)
        set_field_on_mirror_image(meshes, image, &image->source->fields[f], error);
}

static void borrow_derived_field_of_source(session_mesh *image, const char *name)
{
    const int index = session_find_field(image, name), at = session_find_field(image->source, name);
    if (index < 0 || at < 0) return;
    session_field *to = &image->fields[index];
    const session_field *from = &image->source->fields[at];
    const bool is_same = to->has_borrowed_copy && to->copy == from->copy && to->source_version == from->version;
    if (is_same || !from->is_derived || !from->copy) return;
    session_drop_copy(to);
    to->copy = from->copy;
    to->has_borrowed_copy = true;
    to->values = from->values;
    to->component_stride = from->component_stride;
    to->source_version = from->version;
    to->is_copy_stale = false;
    session_mark_scalars_stale(image, index);
    for (int i = 0; i < image->scalar_count; i++)
        if (image->scalars[i].field == index)
            image->scalars[i].original_values = session_get_caller_values(image, index, image->scalars[i].component);
}

void session_lend_derived_values_to_mirrors(const session_meshes *meshes, const char *name)
{
    for (int i = 0; i < meshes->count; i++)
        if (meshes->items[i]->source && meshes->items[i]->is_given)
            borrow_derived_field_of_source(meshes->items[i], name);
}

/* ---- mirror images ----------------------------------------------------------------------------------------------- */

static void update_mirror_image(const scene_mirror *mirror, session_meshes *meshes, session_mesh *source, int axes,
                                int threads, base_error *error)
{
    const bool is_drawn = mirror && source->is_given && (axes & ~mirror->axes) == 0;
    session_mesh *image = session_find_mirror_image(meshes, source, axes);
    if (!is_drawn) {
        if (image) session_remove_mirror_image(meshes, image);
        return;
    }
    image = session_mirror_mesh(meshes, source, axes, mirror->planes, threads, error);
    if (image) set_fields_on_mirror_image(meshes, image, error);
}

/* The catalogue, which lists the meshes and fields of all ranks, does not change, because mirror images have the names
 * of their source meshes and fields. */
void session_update_mirrors(const scene *scene, session_meshes *meshes, int threads, base_error *error)
{
    const bool are_names_changed = meshes->are_names_changed;
    for (int i = 0; i < meshes->count; i++) {
        session_mesh *source = meshes->items[i];
        const scene_mirror *mirror = source->source ? NULL : scene_find_mirror(scene, source->name);
        for (int axes = 1; axes <= ALL_AXES && !source->source; axes++)
            update_mirror_image(mirror, meshes, source, axes, threads, error);
    }
    meshes->are_names_changed = are_names_changed;
}

/* ---- warnings ---------------------------------------------------------------------------------------------------- */

/* Number of elements of a mirror's bounds. These are the bounds, over all ranks, of the meshes to which the mirror
 * applies: three minima and then three negated maxima. */
enum { ENDS = 6 };

static void find_bounds_of_mirrored_meshes(const scene_mirror *mirror, const scene *scene, const session_meshes *meshes,
                                           double ends[ENDS])
{
    for (int i = 0; i < ENDS; i++) ends[i] = INFINITY;
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        if (mesh->source || !mesh->is_given || !mesh->drawn_count || scene_find_mirror(scene, mesh->name) != mirror)
            continue;
        for (int axis = 0; axis < 3; axis++) {
            ends[axis] = fmin(ends[axis], mesh->lower[axis]);
            ends[3 + axis] = fmin(ends[3 + axis], -mesh->upper[axis]);
        }
    }
}

static void warn_of_mirror(const scene_mirror *mirror, const double ends[ENDS], const session_catalogue *catalogue,
                           session_report *report)
{
    session_warn_of_absent_mesh(mirror->mesh, mirror->line, SESSION_MIRROR, catalogue, report);
    for (int axis = 0; axis < 3; axis++) {
        const double plane = mirror->planes[axis], below = plane - ends[axis], above = -ends[3 + axis] - plane;
        /* if cells lie on the other side of the plane only because of rounding, no warning is given */
        const bool is_cut = mirror->axes >> axis & 1 && fmin(below, above) > 1e-6 * fmax(below, above);
        session_warn(
            report, &(session_warning){WARNING_MIRROR, NULL, mirror->mesh, axis}, is_cut,
            "meshes.%s (line %d of the scene): the mesh lies on both sides of its mirror plane %c = %.9g, from "
            "%.9g to %.9g: the mirror image overlaps it",
            mirror->mesh, mirror->line, "xyz"[axis], plane, ends[axis], -ends[3 + axis]);
    }
}

insitu_status session_check_mirrors(const scene *scene, const session_meshes *meshes,
                                    const session_catalogue *catalogue, const session_team *team,
                                    session_report *report, base_error *error)
{
    const int count = scene->mirror_count;
    if (!count) return INSITU_OK;
    double *ends = base_alloc((size_t)count * ENDS * sizeof *ends);
    if (!ends) session_fail_for_memory(error, count * ENDS * 8, "bounds of mirrored meshes");
    insitu_status status = session_agree(team->comm, error);
    for (int i = 0; i < count && !status; i++)
        find_bounds_of_mirrored_meshes(&scene->mirrors[i], scene, meshes, ends + i * ENDS);
    if (!status)
        status = session_check_mpi(
            error, MPI_Allreduce(MPI_IN_PLACE, ends, count * ENDS, MPI_DOUBLE, MPI_MIN, team->comm), "MPI_Allreduce");
    for (int i = 0; i < count && !status; i++) warn_of_mirror(&scene->mirrors[i], ends + i * ENDS, catalogue, report);
    base_free(ends);
    return status;
}
