#include "session_filled.h"

#include "session_field_input.h"
#include "session_scalars.h"

static bool are_values_needed(const session_mesh *mesh, int index, bool of_images)
{
    bool is_used = mesh->fields[index].is_source || (!of_images && mesh->fields[index].is_in_statistics);
    for (int i = 0; i < mesh->scalar_count && of_images; i++)
        is_used = is_used || (mesh->scalars[i].is_used && mesh->scalars[i].field == index);
    return is_used;
}

static insitu_status call_fill_function(session_meshes *meshes, const session_mesh *mesh, const insitu_field *given,
                                        insitu_field *out, base_error *error)
{
    *out = *given;
    out->changed = INSITU_CHANGED_ALL;
    meshes->filling = (session_filling){.mesh = mesh->label, .field = given->name};
    const insitu_status status = given->fill(given->fill_data, out);
    meshes->filling.mesh = NULL;
    if (meshes->filling.refused_error.status) {
        *error = meshes->filling.refused_error;
        return error->status;
    }
    if (status == INSITU_OK) return status;
    return base_fail(error, INSITU_ERROR_FIELD, "mesh \"%s\": field \"%s\": its fill returned %d (%s)", mesh->label,
                     given->name, (int)status, insitu_status_name(status));
}

/* A fill function is called at most once per step. If this call has failed, further calls of session_fill_field() in
 * the same step return its error. */
insitu_status session_fill_field(session_meshes *meshes, session_mesh *mesh, int index, base_error *error)
{
    session_field *field = &mesh->fields[index];
    insitu_field filled;
    if (!field->given.fill) return INSITU_OK;
    *error = field->fill_problem;
    if (field->is_filled) return error->status;
    field->is_filled = true;
    insitu_status status = call_fill_function(meshes, mesh, &field->given, &filled, error);
    if (!status) status = session_store_filled_field(mesh, index, &filled, error);
    for (int i = 0; i < mesh->scalar_count && !status; i++)
        if (mesh->scalars[i].field == index)
            mesh->scalars[i].original_values = session_get_caller_values(mesh, index, mesh->scalars[i].component);
    field->fill_problem = *error;
    return status;
}

static void fill_field_on_part(session_meshes *meshes, session_mesh *part, const char *name, bool of_images,
                               base_error *error)
{
    base_error own = {0};
    const int index = part->is_given ? session_find_field(part, name) : -1;
    if (index < 0 || !part->fields[index].given.fill || !are_values_needed(part, index, of_images)) return;
    if (session_fill_field(meshes, part, index, &own)) session_store_problem(&part->fields[index], &own, error);
}

insitu_status session_fill_fields(session_meshes *meshes, const session_catalogue *catalogue, bool of_images,
                                  base_error *error)
{
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_catalogue_mesh *all = &catalogue->meshes[m];
        const session_parts parts = session_find_parts(meshes, all->name);
        for (int f = 0; f < all->field_count; f++)
            for (int i = 0; i < parts.count; i++)
                fill_field_on_part(meshes, parts.items[i], all->fields[f].name, of_images, error);
    }
    return error->status;
}

void session_release_filled_arrays(const session_meshes *meshes)
{
    for (int m = 0; m < meshes->count; m++)
        for (int f = 0; f < meshes->items[m]->field_count; f++) {
            session_field *field = &meshes->items[m]->fields[f];
            field->is_in_statistics = field->is_source = false;
            if (field->is_problem_of_contents) field->problem = (base_error){0};
            field->is_problem_of_contents = false;
            if (!field->given.fill) continue;
            field->is_filled = false;
            field->fill_problem = (base_error){0};
            field->given.values.data = field->given.index.data = NULL;
            field->values.data = NULL;
            field->given.patch_count = 0;
            /* the field owns these tables of the previous step; the fill function must not take them for the caller's
             * tables */
            field->given.patches = NULL;
            field->given.components = NULL;
        }
}
