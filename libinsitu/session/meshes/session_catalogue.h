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
    base_error *fault; /* what is wrong with it on some rank, the lowest; NULL: nothing */
} session_catalogue_field;

/* A vertex that hangs on a quad: its value is the sum of those of the quad's corners, times weights. */
typedef struct session_hanging_vertex {
    int64_t group;      /* of the vertices that are this one (session_hanging.h) */
    int64_t corners[4]; /* groups, or places among the values that come from other ranks */
    double weights[4];
    bool is_received;
} session_hanging_vertex;

/* This rank's hanging vertices of a mesh, and what it sends to others for theirs. */
typedef struct session_hanging {
    bool is_known;
    int64_t count, total; /* on this rank, on all */
    session_hanging_vertex *vertices;
    int64_t *sent_counts, *sent_groups; /* to each rank; whose values, rank by rank */
    int64_t sent_total;
} session_hanging;

void session_hanging_free(session_hanging *hanging);

typedef struct session_catalogue_mesh {
    char *name;
    int first_rank;        /* that has cells of it; -1: none */
    bool has_ids;          /* all of these give vertex ids */
    bool has_shells_alone; /* the cells that are drawn, of all ranks; found by session_check_vertex_order() */
    base_error *fault;     /* likewise: then the step does without the mesh, but knows the names of its fields */
    int field_count;
    session_catalogue_field *fields;
    session_homes homes;      /* this rank's view of the parts; known where it has been asked for since cells changed */
    session_hanging *hanging; /* the same; NULL until homes are known */
} session_catalogue_mesh;

typedef struct session_catalogue {
    bool is_known;     /* by a step before this one */
    bool has_faults;   /* anywhere in it */
    base_error *fault; /* of which it is not known what is wrong with it: no image can be drawn */
    int mesh_count;
    session_catalogue_mesh *meshes;
} session_catalogue;

/* is_shared: all ranks have the same names, by session_names_hash(), and nothing is wrong with any mesh or field.
 * Meshes with a fault are put aside. Collective. */
insitu_status session_update_catalogue(session_catalogue *catalogue, session_meshes *meshes, const session_team *team,
                                       bool is_shared, base_error *error);
void session_catalogue_free(session_catalogue *catalogue);

/* Finds the homes of all meshes where they are not known. half_diagonal: of the scene. Collective, agreed. */
insitu_status session_update_homes(session_catalogue *catalogue, const session_meshes *meshes, double half_diagonal,
                                   const session_team *team, base_error *error);
/* Call this on all ranks where cells have changed on any. Local. */
void session_forget_homes(session_catalogue *catalogue);

/* A hash of this rank's names: equal on two ranks when their tables say the same. Local. */
uint64_t session_names_hash(const session_meshes *meshes);

/* NULL: no rank has the field. Local. */
const session_catalogue_field *session_catalogue_find(const session_catalogue_mesh *mesh, const char *name);

#endif
