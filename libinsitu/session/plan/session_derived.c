#include "session_derived.h"

#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_events.h"

bool session_uses_gradient_of_vector_field(const scene_derived *derived)
{
    return derived->kind != SCENE_EXPRESSION && derived->kind != SCENE_GRADIENT_OF && derived->input_count == 1;
}

/* ---- sets of derived fields that are needed ---------------------------------------------------------------------- */

static uint64_t find_derived_field_bit(const scene *scene, const scene_field *field)
{
    const int derived = scene_find_derived(scene, field->name);
    return derived < 0 ? 0 : (uint64_t)1 << derived;
}

/* Adds to the set of needed derived fields all derived fields on which they depend. A derived field depends only on
 * those before it in the scene's list. */
static uint64_t add_required_field_bits(const scene *scene, uint64_t needed)
{
    for (int i = scene->derived_count - 1; i >= 0; i--)
        for (int k = 0; k < scene->derived[i].input_count && needed >> i & 1; k++)
            if (scene->derived[i].derived_indices[k] >= 0)
                needed |= (uint64_t)1 << scene->derived[i].derived_indices[k];
    return needed;
}

static uint64_t find_derived_fields_of_image(const scene *scene, const scene_image *image)
{
    scene_field_walk walk = {.image = image};
    uint64_t bits = 0;
    for (const scene_field *field; (field = scene_find_next_field_of_layers(&walk)) != NULL;)
        bits |= find_derived_field_bit(scene, field);
    return bits;
}

uint64_t session_find_derived_fields_of_plan(const scene *scene, const session_plan *plan)
{
    uint64_t bits = 0;
    for (int i = 0; i < plan->image_count && scene->derived_count; i++)
        if (plan->images[i]->variant.view == 0) bits |= find_derived_fields_of_image(scene, plan->images[i]);
    return add_required_field_bits(scene, bits);
}

uint64_t session_find_derived_fields_of_events(const scene *scene, int64_t cycle, bool images)
{
    uint64_t bits = 0;
    for (int i = 0; i < scene->statistics_count; i++)
        if (session_are_statistics_due(&scene->statistics[i], cycle))
            bits |= find_derived_field_bit(scene, &scene->statistics[i].field);
    for (int i = 0; i < scene->image_count && images; i++)
        if (scene->images[i].condition.is_given)
            bits |= find_derived_field_bit(scene, &scene->images[i].condition.field);
    return add_required_field_bits(scene, bits);
}

/* Mirror images are included: they take the derived values of their sources, but averages of input values at vertices
 * include their cells. */
void session_mark_source_fields(const scene *scene, uint64_t needed, const session_meshes *meshes)
{
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        for (int f = 0; f < mesh->field_count; f++) mesh->fields[f].is_source = false;
        for (int i = 0; i < scene->derived_count; i++) {
            if (!(needed >> i & 1) || session_find_field(mesh, scene->derived[i].name) < 0) continue;
            for (int k = 0; k < scene->derived[i].input_count; k++) {
                const int source = session_find_field(mesh, scene->derived[i].inputs[k].name);
                if (source >= 0) mesh->fields[source].is_source = true;
            }
        }
    }
}

/* ---- errors in the inputs of a derived field on a mesh ----------------------------------------------------------- */

/* A derived field on a mesh, for checks and messages. */
typedef struct derived_on_mesh {
    const char *scene_path;
    const scene_derived *derived;
    /* first_mesh: start of the catalogue's array of meshes, which contains `mesh` */
    const session_catalogue_mesh *mesh, *first_mesh;
} derived_on_mesh;

/* Begins a message with the derived field's position in the scene, such as "scene.yaml:3: fields.q.vorticity". */
#define AT "%s:%d: fields.%.200s%s%s: "
#define OF(at)                                                                                                         \
    (at)->scene_path, (at)->derived->line, (at)->derived->name, *(at)->derived->key ? "." : "", (at)->derived->key

static insitu_status fail_for_component_count(const derived_on_mesh *at, const scene_field *input,
                                              const session_catalogue_field *found, base_error *error)
{
    const char *name = input->name;
    if (at->derived->kind == SCENE_EXPRESSION)
        return base_fail(error, INSITU_ERROR_FIELD,
                         AT "field \"%s\" has %d components on mesh \"%s\", expected one of them, as %s.x, or mag(%s)",
                         OF(at), name, found->component_count, at->mesh->name, name, name);
    return base_fail(error, INSITU_ERROR_FIELD,
                     AT "field \"%s\" has %d components on mesh \"%s\", expected a scalar, as %s.x, or a derived field "
                        "that is mag(%s)",
                     OF(at), name, found->component_count, at->mesh->name, name, name);
}

/* Checks that an input that is a vector has the same number of components on at->mesh as on the meshes before it in the
 * catalogue. */
static insitu_status check_equal_components_on_meshes(const derived_on_mesh *at, const scene_field *input,
                                                      const session_catalogue_field *found, base_error *error)
{
    for (const session_catalogue_mesh *other = at->first_mesh; other < at->mesh; other++) {
        const session_catalogue_field *there = session_catalogue_find_field(other, input->name);
        if (!there || there->fault || there->component_count == found->component_count) continue;
        return base_fail(error, INSITU_ERROR_FIELD,
                         AT "field \"%s\" has %d components on mesh \"%s\" and %d on mesh \"%s\", expected as many",
                         OF(at), input->name, there->component_count, other->name, found->component_count,
                         at->mesh->name);
    }
    return INSITU_OK;
}

static insitu_status check_components(const derived_on_mesh *at, const scene_field *input,
                                      const session_catalogue_field *found, base_error *error)
{
    const int count = found->component_count;
    if (session_uses_gradient_of_vector_field(at->derived)) {
        if (count == 2 || count == 3) return check_equal_components_on_meshes(at, input, found, error);
        return base_fail(error, INSITU_ERROR_FIELD,
                         AT "field \"%s\" has %d component%s on mesh \"%s\", expected a vector of 2 or 3, or a list of "
                            "2 or 3 scalars, as [u, v, w]",
                         OF(at), input->name, count, count == 1 ? "" : "s", at->mesh->name);
    }
    if (input->component == SCENE_COMPONENT_ONLY && count > 1) return fail_for_component_count(at, input, found, error);
    if (input->component < count) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_FIELD,
                     AT "component %d of field \"%s\" is asked for; on mesh \"%s\" it has %d, expected 0 to %d", OF(at),
                     input->component, input->name, at->mesh->name, count, count - 1);
}

static insitu_status check_input(const derived_on_mesh *at, const scene_field *input,
                                 const session_catalogue_field *found, base_error *error)
{
    if (found->fault) {
        *error = *found->fault;
        return error->status;
    }
    if (found->differing_rank >= 0)
        return base_fail(error, INSITU_ERROR_FIELD,
                         AT "rank %d: mesh \"%s\": field \"%s\" has another centring or number of components than on "
                            "rank %d",
                         OF(at), found->differing_rank, at->mesh->name, input->name, found->first_rank);
    if (found->lacking_rank >= 0)
        return base_fail(error, INSITU_ERROR_FIELD,
                         AT "rank %d: mesh \"%s\": field \"%s\" is not set, other ranks have it", OF(at),
                         found->lacking_rank, at->mesh->name, input->name);
    return check_components(at, input, found, error);
}

/* ---- derived fields in the catalogue --------------------------------------------------------------------------- */

static bool store_fault(session_catalogue_field *field, const base_error *error)
{
    if (field->fault) return true;
    field->fault = base_calloc(1, sizeof *field->fault);
    if (field->fault) *field->fault = *error;
    return field->fault != NULL;
}

static bool add_derived_field_to_mesh(const char *scene_path, const scene *scene, int number,
                                      const session_catalogue *catalogue, session_catalogue_mesh *mesh)
{
    const scene_derived *derived = &scene->derived[number];
    const derived_on_mesh at = {scene_path, derived, mesh, catalogue->meshes};
    bool is_of_cells = derived->kind == SCENE_EXPRESSION;
    base_error error = {.status = INSITU_OK};
    for (int k = 0; k < derived->input_count; k++) {
        const session_catalogue_field *found = session_catalogue_find_field(mesh, derived->inputs[k].name);
        if (!found) return true;
        is_of_cells = is_of_cells && found->centring == INSITU_CELL;
        if (!error.status) check_input(&at, &derived->inputs[k], found, &error);
    }
    session_catalogue_field *field = NULL;
    for (int f = 0; f < mesh->field_count; f++)
        if (strcmp(mesh->fields[f].name, derived->name) == 0) field = &mesh->fields[f];
    if (field)
        base_fail(&error, INSITU_ERROR_FIELD,
                  AT "mesh \"%s\" has a field of this name already, expected another name for the derived one", OF(&at),
                  mesh->name);
    const bool is_vector = (derived->kind == SCENE_GRADIENT_OF || derived->kind == SCENE_VORTICITY) &&
                           derived->component == SCENE_COMPONENT_DEFAULT;
    if (!field)
        field = session_catalogue_add_field(mesh, derived->name, is_vector ? 3 : 1,
                                            is_of_cells ? INSITU_CELL : INSITU_VERTEX, number);
    return field && (!error.status || store_fault(field, &error));
}

static bool add_derived_to_catalogue(const scene *scene, const char *scene_path, session_catalogue *catalogue)
{
    session_catalogue_drop_derived(catalogue);
    for (int m = 0; m < catalogue->mesh_count; m++)
        for (int i = 0; i < scene->derived_count; i++)
            if (!add_derived_field_to_mesh(scene_path, scene, i, catalogue, &catalogue->meshes[m])) return false;
    return true;
}

/* ---- derived fields of this rank's meshes ---------------------------------------------------------------------- */

static bool is_derived_without_fault(const session_catalogue_field *field)
{
    return field->derived_index >= 0 && !field->fault;
}

static bool has_current_derived_fields(const session_catalogue_mesh *all, const session_mesh *mesh)
{
    int expected = 0, found = 0;
    for (int f = 0; f < mesh->field_count; f++) found += mesh->fields[f].is_derived;
    for (int f = 0; f < all->field_count; f++) {
        const session_catalogue_field *field = &all->fields[f];
        if (!is_derived_without_fault(field)) continue;
        const int at = session_find_field(mesh, field->name);
        if (at < 0 || !mesh->fields[at].is_derived || mesh->fields[at].given.centring != field->centring ||
            mesh->fields[at].given.component_count != field->component_count)
            return false;
        expected++;
    }
    return found == expected;
}

static bool add_derived_to_mesh(const session_catalogue_mesh *all, session_mesh *mesh)
{
    if (has_current_derived_fields(all, mesh)) return true;
    session_drop_derived_fields(mesh);
    for (int f = 0; f < all->field_count; f++) {
        const session_catalogue_field *field = &all->fields[f];
        if (!is_derived_without_fault(field)) continue;
        session_field *own = session_add_field(mesh, field->name);
        if (!own) return false;
        own->given.component_count = field->component_count;
        own->given.centring = field->centring;
        own->is_derived = true;
    }
    return true;
}

insitu_status session_add_derived_fields(const scene *scene, const char *scene_path, session_catalogue *catalogue,
                                         session_meshes *meshes, const session_team *team, base_error *error)
{
    if (catalogue->are_derived) return INSITU_OK;
    bool is_done = add_derived_to_catalogue(scene, scene_path, catalogue);
    for (int m = 0; m < catalogue->mesh_count && is_done; m++) {
        const session_parts parts = session_find_parts(meshes, catalogue->meshes[m].name);
        for (int i = 0; i < parts.count && is_done; i++)
            if (parts.items[i]->is_given) is_done = add_derived_to_mesh(&catalogue->meshes[m], parts.items[i]);
    }
    catalogue->are_meshes_grouped = catalogue->are_meshes_grouped && scene->derived_count == 0;
    if (!is_done) session_fail_for_memory(error, scene->derived_count * 100LL, "the names of derived fields");
    const insitu_status status = scene->derived_count ? session_agree(team->comm, error) : INSITU_OK;
    catalogue->are_derived = !status;
    return status;
}
