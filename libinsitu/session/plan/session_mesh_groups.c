#include "session_mesh_groups.h"

#include "memory.h"
#include "session_agree.h"
#include "session_hash.h"
#include "session_scalars.h"

/* The purpose for which meshes are grouped. Either the values of a layer's field or the gradients of a derived field
 * are averaged over the group. */
typedef struct group_purpose {
    const scene_field *field; /* field of a layer; NULL if the meshes are those of a derived field */
    int derived_index;        /* index of the derived field; -1: none */
} group_purpose;

static bool is_group_member(const session_catalogue_mesh *mesh, const group_purpose *purpose)
{
    const scene_field *field = purpose->field;
    if (!field) {
        for (int f = 0; f < mesh->field_count; f++)
            if (mesh->fields[f].derived_index == purpose->derived_index) return true;
        return false;
    }
    const session_catalogue_field *found =
        scene_field_selects_mesh(field, mesh->name) ? session_catalogue_find_field(mesh, field->name) : NULL;
    return found && session_is_recentred(field, found->centring, mesh->is_refined);
}

/* Adds a mesh group without meshes, with space for `count` meshes. Returns NULL if memory runs out. */
static session_mesh_group *add_mesh_group(session_catalogue *catalogue, uint64_t name, int count)
{
    session_mesh_group **mesh_groups =
        base_realloc(catalogue->mesh_groups, (size_t)(catalogue->mesh_group_count + 1) * sizeof *mesh_groups);
    if (!mesh_groups) return NULL;
    catalogue->mesh_groups = mesh_groups;
    session_mesh_group *mesh_group = base_calloc(1, sizeof *mesh_group);
    if (mesh_group) mesh_group->meshes = base_calloc((size_t)count, sizeof *mesh_group->meshes);
    if (!mesh_group || !mesh_group->meshes) {
        base_free(mesh_group);
        return NULL;
    }
    mesh_group->name = name;
    return mesh_groups[catalogue->mesh_group_count++] = mesh_group;
}

static bool add_group_of_one_mesh(session_catalogue *catalogue, session_catalogue_mesh *mesh)
{
    if (session_find_mesh_group(catalogue, mesh->single_group_name)) return true;
    session_mesh_group *mesh_group = add_mesh_group(catalogue, mesh->single_group_name, 1);
    if (!mesh_group) return false;
    mesh_group->meshes[mesh_group->count++] = mesh;
    mesh_group->by_id = true;
    return true;
}

/* Forms the mesh group for a purpose, unless it exists already: all meshes without global ids to which the purpose
 * applies. Computes the group's name, a hash of the names of its meshes; the name is 0 if there are no such meshes.
 * Each mesh with ids forms a group by itself. Returns false if memory runs out. */
static bool group_meshes(session_catalogue *catalogue, const group_purpose *purpose, uint64_t *mesh_group_name)
{
    uint64_t hash = SESSION_HASH_BEGIN;
    bool is_done = true;
    int count = 0;
    *mesh_group_name = 0;
    for (int m = 0; m < catalogue->mesh_count && is_done; m++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[m];
        if (!is_group_member(mesh, purpose)) continue;
        if (mesh->single_group_name) {
            is_done = add_group_of_one_mesh(catalogue, mesh);
            continue;
        }
        session_hash_text(&hash, mesh->name);
        count++;
    }
    if (!count || !is_done) return is_done;
    *mesh_group_name = hash | 1;
    if (session_find_mesh_group(catalogue, *mesh_group_name)) return true;
    session_mesh_group *mesh_group = add_mesh_group(catalogue, *mesh_group_name, count);
    for (int m = 0; m < catalogue->mesh_count && mesh_group; m++)
        if (!catalogue->meshes[m].single_group_name && is_group_member(&catalogue->meshes[m], purpose))
            mesh_group->meshes[mesh_group->count++] = &catalogue->meshes[m];
    return mesh_group != NULL;
}

static bool group_meshes_of_field(session_catalogue *catalogue, scene_field *field)
{
    const group_purpose purpose = {field, -1};
    field->mesh_group_name = 0;
    return !field->name || group_meshes(catalogue, &purpose, &field->mesh_group_name);
}

static bool group_meshes_of_derived(session_catalogue *catalogue, scene *scene, int number)
{
    scene_derived *derived = &scene->derived[number];
    const group_purpose purpose = {NULL, number};
    bool is_done = group_meshes(catalogue, &purpose, &derived->mesh_group_name);
    for (int k = 0; k < derived->input_count && is_done; k++)
        is_done = group_meshes_of_field(catalogue, &derived->inputs[k]);
    return is_done;
}

/* Computes the name of the group that each mesh with global ids forms by itself, and stores it in the mesh and its
 * parts. Also stores in each part whether any block of its mesh is refined. */
static void name_groups_of_single_meshes(session_catalogue *catalogue, const session_meshes *meshes)
{
    for (int m = 0; m < catalogue->mesh_count; m++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[m];
        const session_parts parts = session_find_parts(meshes, mesh->name);
        uint64_t hash = SESSION_HASH_BEGIN;
        session_hash_text(&hash, mesh->name);
        mesh->single_group_name = mesh->has_ids ? hash | 1 : 0;
        for (int i = 0; i < parts.count; i++) {
            parts.items[i]->single_group_name = mesh->single_group_name;
            parts.items[i]->is_refined = mesh->is_refined;
        }
    }
}

static bool group_meshes_of_image(session_catalogue *catalogue, const scene_image *image)
{
    scene_field_walk walk = {.image = image};
    bool is_done = true;
    for (scene_field *field; is_done && (field = scene_find_next_field_of_layers(&walk)) != NULL;)
        is_done = walk.role == SCENE_THRESHOLD || group_meshes_of_field(catalogue, field);
    return is_done;
}

static void drop_scalars_without_group(const session_catalogue *catalogue, session_meshes *meshes)
{
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        for (int i = mesh->scalar_count - 1; i >= 0; i--)
            if (mesh->scalars[i].is_recentred && !session_find_mesh_group(catalogue, mesh->scalars[i].mesh_group_name))
                session_drop_scalar(mesh, i);
    }
}

void session_group_meshes(scene *scene, session_catalogue *catalogue, session_meshes *meshes, base_error *error)
{
    bool is_done = true;
    if (catalogue->are_meshes_grouped) return;
    session_drop_mesh_groups(catalogue);
    name_groups_of_single_meshes(catalogue, meshes);
    for (int i = 0; i < scene->image_count && is_done; i++)
        if (scene->images[i].variant.view == 0) is_done = group_meshes_of_image(catalogue, &scene->images[i]);
    for (int i = 0; i < scene->derived_count && is_done; i++) is_done = group_meshes_of_derived(catalogue, scene, i);
    if (is_done)
        drop_scalars_without_group(catalogue, meshes);
    else
        session_fail_for_memory(error, (int64_t)sizeof(session_mesh_group), "meshes that have one field");
    catalogue->are_meshes_grouped = is_done;
}
