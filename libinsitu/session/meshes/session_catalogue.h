/* The meshes and fields of all ranks. */
#ifndef SESSION_CATALOGUE_H
#define SESSION_CATALOGUE_H

#include "session_homes.h"
#include "session_keys.h"
#include "session_mesh.h"
#include "session_team.h"

/* A field of a mesh over all ranks; the same on every rank. */
typedef struct session_catalogue_field {
    char *name;
    int component_count;
    insitu_centring centring;
    int first_rank;    /* first rank that has it */
    int last_rank;     /* last rank that has it together with cells; -1: none */
    int odd_rank;      /* a rank that has it with another centring or number of components, or -1 */
    int lacking_rank;  /* a rank that has cells of the mesh but not the field, or -1 */
    int derived;       /* index among the scene's derived fields; -1: the caller's field */
    base_error *fault; /* the fault on the lowest rank on which the field is faulty; NULL: none */
} session_catalogue_field;

/* A vertex that hangs on a face: its value is the weighted sum of the values at the face's corners. */
typedef struct session_hanging_vertex {
    int64_t group;      /* the group of equal vertices to which it belongs (session_hanging.h) */
    int64_t corners[4]; /* groups, or indices among the values received from other ranks */
    double weights[4];
    bool is_received;
} session_hanging_vertex;

/* A vertex that is equal to others up to rounding, and the least position of these. */
typedef struct session_twin {
    int64_t vertex;
    double place[3];
} session_twin;

/* The outer faces of one of this rank's parts of a mesh, on which vertices may hang, and the vertices that may hang;
 * kept while vertices move. */
typedef struct session_border {
    uint64_t cells; /* value of session_catalogue_mesh.cells for which it was computed; 0: unknown */
    int64_t face_count, vertex_count;
    session_face *faces; /* faces that only one cell has, over all ranks */
    int64_t *vertices;   /* vertices of faces that this rank has once */
    int64_t twin_count;  /* updated if vertices move: session_hanging.twins */
    session_twin *twins; /* sorted by vertex */
} session_border;

/* This rank's hanging vertices in the meshes of a joint, and the values that it sends to other ranks for theirs. */
typedef struct session_hanging {
    uint64_t places; /* session_joint.places that it is of; 0: not known */
    int border_count;
    session_border *borders; /* one per part; NULL: none are known */
    uint64_t twins;          /* version of the vertex places for which the twins of borders were found */
    int64_t count, total;    /* on this rank, on all */
    session_hanging_vertex *vertices;
    int64_t *sent_counts, *sent_groups; /* per rank, the number of values sent; their groups, in the order of ranks */
    int64_t sent_total;
} session_hanging;

/* Groups of equal vertices of a joint's meshes on this rank (plan/session_vertex_groups.h). They are kept while the
 * meshes stay as they are. */
typedef struct session_vertex_groups {
    uint64_t places;    /* session_joint.places that they are of; 0: not known */
    int64_t *firsts;    /* per part, the number of its first vertex, and at the end the number of vertices */
    int64_t *of_vertex; /* group of each vertex; -1: it belongs to no drawn cell */
    int64_t count;
    int64_t *starts;        /* count + 1: number of corners of drawn cells in the groups before */
    session_key_table keys; /* of the groups; empty unless a mesh has patches, whose vertices are found by key */
    /* The groups in other ranks' boxes, sorted by their home; none if there is one rank. */
    int64_t shared_count;
    int64_t *shared;
    session_key *shared_keys;
    int64_t *shared_counts; /* per rank, the number of groups whose home it is */
} session_vertex_groups;

typedef struct session_catalogue_mesh {
    char *name;
    int first_rank;        /* first rank that has cells of it; -1: none */
    bool has_ids;          /* all ranks with cells give vertex ids */
    bool is_refined;       /* some block, on any rank, has a level of refinement */
    bool has_shells_alone; /* all drawn cells, over all ranks, are shells; set by session_check_vertex_order() */
    base_error *fault;     /* likewise a fault: the step then ignores the mesh, but its fields' names are kept */
    int field_count;
    session_catalogue_field *fields;
    uint64_t apart;         /* session_joint.name of a joint with only this mesh if it has ids; else 0 */
    uint64_t cells, places; /* hashes of the stamps of cells and of coordinates over the ranks; 0: unknown */
    session_homes homes;    /* this rank's view of the parts; up to date if it was requested for these places */
} session_catalogue_mesh;

/* A set of meshes over which equal vertices have one mean of cell values: the meshes that have a layer's field, and no
 * vertex ids. A mesh with ids is a joint by itself. */
typedef struct session_joint {
    uint64_t name; /* scene_field.joined, or session_catalogue_mesh.apart */
    int count;
    session_catalogue_mesh **meshes; /* sorted by name */
    bool by_id;                      /* the joint is one mesh, whose vertices are equal if their global ids are */
    uint64_t places;                 /* hash of the positions of all its meshes */
    session_homes own_homes;         /* used by a joint of several meshes */
    const session_homes *homes;
    session_vertex_groups groups;
    session_hanging hanging;
} session_joint;

typedef struct session_catalogue {
    bool is_known;        /* known from an earlier step */
    bool has_faults;      /* some mesh or field has a fault */
    bool are_derived;     /* contains the derived fields of the current scene */
    bool are_joined;      /* joints are those of the current scene */
    bool are_parts_known; /* the meshes' hashes of cells and places are up to date */
    base_error *fault;    /* a fault with unknown cause, with which no image can be drawn */
    int mesh_count, joint_count;
    session_catalogue_mesh *meshes;
    session_joint **joints;
} session_catalogue;

/* Updates the catalogue. is_shared: all ranks have the same names, by session_names_hash(), and no mesh or field has a
 * fault. Meshes with a fault are put aside. Collective. */
insitu_status session_update_catalogue(session_catalogue *catalogue, session_meshes *meshes, const session_team *team,
                                       bool is_shared, base_error *error);
void session_catalogue_free(session_catalogue *catalogue);

/* Updates the homes of all meshes and joints that are out of date. half_diagonal: of the scene. Collective, agreed. */
insitu_status session_update_homes(session_catalogue *catalogue, const session_meshes *meshes, double half_diagonal,
                                   const session_team *team, base_error *error);
/* Call this on all ranks if cells have changed on any; session_update_homes() then finds which meshes changed.
 * Local. */
void session_forget_homes(session_catalogue *catalogue);

/* Returns the name of the joint to which the mesh belongs if the layer's meshes are joined. */
static inline uint64_t session_joint_name(const session_catalogue_mesh *mesh, uint64_t joined)
{
    return mesh->apart ? mesh->apart : joined;
}

/* Returns the joint of this name; NULL if there is none. */
session_joint *session_find_joint(const session_catalogue *catalogue, uint64_t name);
void session_drop_joints(session_catalogue *catalogue);
/* Frees the data of vertices, and if with_borders also that of faces. */
void session_hanging_free(session_hanging *hanging, bool with_borders);

/* This rank's parts of the meshes of a joint, sorted by mesh. */
typedef struct session_joint_parts {
    int count;
    const session_mesh **items;
    int *firsts; /* the joint's count + 1 entries: the first part of each mesh */
} session_joint_parts;

/* Returns false if memory runs out; then there is nothing to free. */
bool session_list_joint_parts(const session_joint *joint, const session_meshes *meshes, session_joint_parts *out);
void session_joint_parts_free(session_joint_parts *parts);

void session_vertex_groups_free(session_vertex_groups *groups);

/* Returns a hash of this rank's names, which is equal on two ranks if their tables are. Local. */
uint64_t session_names_hash(const session_meshes *meshes);

/* Adds a field that all ranks with cells of the mesh have; its name must be new. Returns NULL if memory ran out. */
session_catalogue_field *session_catalogue_add(session_catalogue_mesh *mesh, const char *name, int component_count,
                                               insitu_centring centring, int derived);
/* Removes the derived fields. */
void session_catalogue_drop_derived(session_catalogue *catalogue);

/* Returns the field; NULL if no rank has it. Local. */
const session_catalogue_field *session_catalogue_find(const session_catalogue_mesh *mesh, const char *name);

#endif
