#include "session_joints.h"

#include "memory.h"
#include "session_agree.h"
#include "session_hash.h"
#include "session_scalars.h"

/* The purpose for which meshes are joined: either a layer's field, or the gradients of a derived field. */
typedef struct join_wish {
    const scene_field *field; /* field of a layer; NULL if `derived` is set */
    int derived_index;
} join_wish;

static bool is_joint_member(const session_catalogue_mesh *mesh, const join_wish *wish)
{
    const scene_field *field = wish->field;
    if (!field) {
        for (int f = 0; f < mesh->field_count; f++)
            if (mesh->fields[f].derived_index == wish->derived_index) return true;
        return false;
    }
    const session_catalogue_field *found =
        scene_field_is_on(field, mesh->name) ? session_catalogue_find(mesh, field->name) : NULL;
    return found && session_is_recentred(field, found->centring, mesh->is_refined);
}

/* Adds a joint without meshes, with space for `count` of them. Returns NULL if memory runs out. */
static session_joint *add_joint(session_catalogue *catalogue, uint64_t name, int count)
{
    session_joint **joints = base_realloc(catalogue->joints, (size_t)(catalogue->joint_count + 1) * sizeof *joints);
    if (!joints) return NULL;
    catalogue->joints = joints;
    session_joint *joint = base_calloc(1, sizeof *joint);
    if (joint) joint->meshes = base_calloc((size_t)count, sizeof *joint->meshes);
    if (!joint || !joint->meshes) {
        base_free(joint);
        return NULL;
    }
    joint->name = name;
    return joints[catalogue->joint_count++] = joint;
}

static bool add_joint_of_one(session_catalogue *catalogue, session_catalogue_mesh *mesh)
{
    if (session_find_joint(catalogue, mesh->single_joint_name)) return true;
    session_joint *joint = add_joint(catalogue, mesh->single_joint_name, 1);
    if (!joint) return false;
    joint->meshes[joint->count++] = mesh;
    joint->by_id = true;
    return true;
}

/* Computes the name of the joint that consists of all requested meshes without global ids, and adds the joint if it is
 * new. */
static bool join_meshes(session_catalogue *catalogue, const join_wish *wish, uint64_t *joined)
{
    uint64_t hash = SESSION_HASH_BEGIN;
    bool is_done = true;
    int count = 0;
    *joined = 0;
    for (int m = 0; m < catalogue->mesh_count && is_done; m++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[m];
        if (!is_joint_member(mesh, wish)) continue;
        if (mesh->single_joint_name) {
            is_done = add_joint_of_one(catalogue, mesh);
            continue;
        }
        session_hash_text(&hash, mesh->name);
        count++;
    }
    if (!count || !is_done) return is_done;
    *joined = hash | 1;
    if (session_find_joint(catalogue, *joined)) return true;
    session_joint *joint = add_joint(catalogue, *joined, count);
    for (int m = 0; m < catalogue->mesh_count && joint; m++)
        if (!catalogue->meshes[m].single_joint_name && is_joint_member(&catalogue->meshes[m], wish))
            joint->meshes[joint->count++] = &catalogue->meshes[m];
    return joint != NULL;
}

static bool join_field(session_catalogue *catalogue, scene_field *field)
{
    const join_wish wish = {field, -1};
    field->joint_name = 0;
    return !field->name || join_meshes(catalogue, &wish, &field->joint_name);
}

static bool join_derived(session_catalogue *catalogue, scene *scene, int number)
{
    scene_derived *derived = &scene->derived[number];
    const join_wish wish = {NULL, number};
    bool is_done = join_meshes(catalogue, &wish, &derived->joint_name);
    for (int k = 0; k < derived->input_count && is_done; k++) is_done = join_field(catalogue, &derived->inputs[k]);
    return is_done;
}

/* Adds each mesh with global ids as a joint by itself. Stores in each part whether any block of its mesh is refined. */
static void add_joints_of_one(session_catalogue *catalogue, const session_meshes *meshes)
{
    for (int m = 0; m < catalogue->mesh_count; m++) {
        session_catalogue_mesh *mesh = &catalogue->meshes[m];
        const session_parts parts = session_find_parts(meshes, mesh->name);
        uint64_t hash = SESSION_HASH_BEGIN;
        session_hash_text(&hash, mesh->name);
        mesh->single_joint_name = mesh->has_ids ? hash | 1 : 0;
        for (int i = 0; i < parts.count; i++) {
            parts.items[i]->single_joint_name = mesh->single_joint_name;
            parts.items[i]->is_refined = mesh->is_refined;
        }
    }
}

static bool join_image(session_catalogue *catalogue, const scene_image *image)
{
    scene_field_walk walk = {.image = image};
    bool is_done = true;
    for (scene_field *field; is_done && (field = scene_next_field(&walk)) != NULL;)
        is_done = walk.role == SCENE_THRESHOLD || join_field(catalogue, field);
    return is_done;
}

static void drop_other_scalars(const session_catalogue *catalogue, session_meshes *meshes)
{
    for (int m = 0; m < meshes->count; m++) {
        session_mesh *mesh = meshes->items[m];
        for (int i = mesh->scalar_count - 1; i >= 0; i--)
            if (mesh->scalars[i].is_recentred && !session_find_joint(catalogue, mesh->scalars[i].joint_name))
                session_drop_scalar(mesh, i);
    }
}

void session_join_meshes(scene *scene, session_catalogue *catalogue, session_meshes *meshes, base_error *error)
{
    bool is_done = true;
    if (catalogue->are_joined) return;
    session_drop_joints(catalogue);
    add_joints_of_one(catalogue, meshes);
    for (int i = 0; i < scene->image_count && is_done; i++)
        if (scene->images[i].variant.view == 0) is_done = join_image(catalogue, &scene->images[i]);
    for (int i = 0; i < scene->derived_count && is_done; i++) is_done = join_derived(catalogue, scene, i);
    if (is_done)
        drop_other_scalars(catalogue, meshes);
    else
        session_fail_for_memory(error, (int64_t)sizeof(session_joint), "meshes that have one field");
    catalogue->are_joined = is_done;
}
