/* The meshes and fields of all ranks. */
#ifndef SESSION_CATALOGUE_H
#define SESSION_CATALOGUE_H

#include "session_homes.h"
#include "session_mesh.h"
#include "session_team.h"

/* A field of a mesh over all ranks; the same on every rank. */
typedef struct session_catalogue_field {
    char *name;
    int component_count;
    insitu_centring centring;
    int first_rank;    /* that has it */
    int last_rank;     /* that has it together with cells; -1: none */
    int odd_rank;      /* -1, or one that has it with another centring or count of components */
    int lacking_rank;  /* -1, or one that has cells of the mesh but not the field */
    int derived;       /* which of the scene's derived fields it is; -1: the caller's */
    base_error *fault; /* what is wrong with it on some rank, the lowest; NULL: nothing */
} session_catalogue_field;

/* A vertex that hangs on a face: its value is the sum of those of the face's corners, times weights. */
typedef struct session_hanging_vertex {
    int64_t group;      /* the group of the vertices that are this one (session_hanging.h) */
    int64_t corners[4]; /* groups, or places among the values that come from other ranks */
    double weights[4];
    bool is_received;
} session_hanging_vertex;

/* A vertex that is the same as others but for rounding, and the least of their places. */
typedef struct session_twin {
    int64_t vertex;
    double place[3];
} session_twin;

/* What vertices may hang on, and which may, of this rank's part of a mesh; kept while vertices move. */
typedef struct session_border {
    uint64_t cells; /* session_catalogue_mesh.cells that it is of; 0: not known */
    int64_t face_count, vertex_count;
    session_face *faces; /* that one cell alone has, over all ranks */
    int64_t *vertices;   /* vertices of faces that this rank has once */
    int64_t twin_count;  /* found again where vertices move: session_hanging.twins */
    session_twin *twins; /* in the order of vertices */
} session_border;

/* This rank's hanging vertices of the meshes of a joint, and what it sends to others for theirs. */
typedef struct session_hanging {
    uint64_t places;         /* session_joint.places that it is of; 0: not known */
    session_border *borders; /* one for each mesh; NULL: none are known */
    uint64_t twins;          /* version of the vertex places for which the twins of borders were found */
    int64_t count, total;    /* on this rank, on all */
    session_hanging_vertex *vertices;
    int64_t *sent_counts, *sent_groups; /* to each rank; whose values, rank by rank */
    int64_t sent_total;
} session_hanging;

typedef struct session_catalogue_mesh {
    char *name;
    int first_rank;        /* that has cells of it; -1: none */
    bool has_ids;          /* all of these give vertex ids */
    bool has_shells_alone; /* the cells that are drawn, of all ranks; found by session_check_vertex_order() */
    base_error *fault;     /* likewise: then the step does without the mesh, but knows the names of its fields */
    int field_count;
    session_catalogue_field *fields;
    uint64_t apart;         /* session_joint.name of this mesh alone, if it has ids; else 0 */
    uint64_t cells, places; /* hashes of when cells and coordinates were last new on each rank; 0: not known */
    session_homes homes;    /* this rank's view of the parts; known where it has been asked for at these places */
} session_catalogue_mesh;

/* Meshes whose vertices, where they are the same, have one mean of cell values: those that have a layer's field, and no
 * vertex ids. A mesh with ids is a joint of its own. */
typedef struct session_joint {
    uint64_t name; /* scene_field.joined, or session_catalogue_mesh.apart */
    int count;
    session_catalogue_mesh **meshes; /* by name */
    bool by_id;                      /* the joint is one mesh, whose vertices are the same by global ids */
    uint64_t places;                 /* the places of all its meshes */
    session_homes own_homes;         /* used by a joint of several meshes */
    const session_homes *homes;
    session_hanging hanging;
} session_joint;

typedef struct session_catalogue {
    bool is_known;        /* by a step before this one */
    bool has_faults;      /* anywhere in it */
    bool are_derived;     /* the derived fields of the present scene are in it */
    bool are_joined;      /* joints are those of the present scene */
    bool are_parts_known; /* the meshes' cells and places are the present ones */
    base_error *fault;    /* a fault whose cause is not known, with which no image can be drawn */
    int mesh_count, joint_count;
    session_catalogue_mesh *meshes;
    session_joint **joints;
} session_catalogue;

/* is_shared: all ranks have the same names, by session_names_hash(), and nothing is wrong with any mesh or field.
 * Meshes with a fault are put aside. Collective. */
insitu_status session_update_catalogue(session_catalogue *catalogue, session_meshes *meshes, const session_team *team,
                                       bool is_shared, base_error *error);
void session_catalogue_free(session_catalogue *catalogue);

/* Finds the homes of all meshes and joints where they are not known. half_diagonal: of the scene. Collective, agreed.
 */
insitu_status session_update_homes(session_catalogue *catalogue, const session_meshes *meshes, double half_diagonal,
                                   const session_team *team, base_error *error);
/* Call this on all ranks where cells have changed on any: then update finds of which meshes. Local. */
void session_forget_homes(session_catalogue *catalogue);

/* The name of the joint that the mesh is in where the layer's meshes are joined. */
static inline uint64_t session_joint_name(const session_catalogue_mesh *mesh, uint64_t joined)
{
    return mesh->apart ? mesh->apart : joined;
}

/* The joint of this name; NULL: there is none. */
session_joint *session_find_joint(const session_catalogue *catalogue, uint64_t name);
void session_drop_joints(session_catalogue *catalogue);
/* Frees what is known of vertices, and if with_borders that of faces too. count: of meshes. */
void session_hanging_free(session_hanging *hanging, int count, bool with_borders);

/* A hash of this rank's names: equal on two ranks when their tables say the same. Local. */
uint64_t session_names_hash(const session_meshes *meshes);

/* Adds a field that all ranks with cells of the mesh have; there is none of the name. NULL where memory ran out. */
session_catalogue_field *session_catalogue_add(session_catalogue_mesh *mesh, const char *name, int component_count,
                                               insitu_centring centring, int derived);
/* Removes the derived fields. */
void session_catalogue_drop_derived(session_catalogue *catalogue);

/* NULL: no rank has the field. Local. */
const session_catalogue_field *session_catalogue_find(const session_catalogue_mesh *mesh, const char *name);

#endif
