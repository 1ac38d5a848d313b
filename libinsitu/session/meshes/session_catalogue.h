/* The catalogue: a list of the meshes and fields of all ranks, which is the same on every rank. A part is one rank's
 * part of a mesh, or one block of it (session_mesh.h). The key of a vertex identifies the vertex on all ranks: it is
 * its global id or the bits of its coordinates (session_keys.h). */
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
    int first_rank;     /* lowest rank that has the field */
    int last_rank;      /* highest rank that has both the field and cells of the mesh; -1: there is none */
    int differing_rank; /* a rank on which the field has another centring or number of components; -1: there is none */
    int lacking_rank;   /* a rank that has cells of the mesh but not the field; -1: there is none */
    int derived_index;  /* index among the scene's derived fields; -1: the field is the caller's */
    base_error *fault;  /* error of the field on the lowest rank on which it has an error; NULL: there is none */
} session_catalogue_field;

/* A hanging vertex: a vertex that lies on a face of a coarser cell without being a corner of this face. Its value is
 * the weighted sum of the values at the face's corners. */
typedef struct session_hanging_vertex {
    /* index, in session_vertex_groups, of the group of equal vertices that contains the hanging vertex */
    int64_t group;
    /* one entry for each corner of the coarser cell's face: the index of the corner's group of equal vertices or, if
     * is_received is set, the index of the corner's value among the values received from other ranks */
    int64_t corners[4];
    double weights[4]; /* weight of the value at each corner; the weights sum to 1 */
    bool is_received; /* set if `corners` are indices of values received from other ranks, not of groups of this rank */
} session_hanging_vertex;

/* A vertex that coincides with other vertices except for rounding, and the position that represents all of these
 * vertices. */
typedef struct session_twin {
    int64_t vertex;     /* index of the vertex in its part of the mesh */
    double position[3]; /* lexicographically smallest position of the vertex and all vertices that coincide with it */
} session_twin;

/* The outer faces of a part of a mesh on this rank, and the vertices that may hang on outer faces. The data is kept if
 * only coordinates change. */
typedef struct session_border {
    /* session_catalogue_mesh.cells_hash at the time when the border was computed; 0: not computed yet */
    uint64_t cells_hash;
    int64_t face_count, vertex_count;
    session_face *faces; /* faces that belong to only one cell of the whole mesh, on all ranks */
    /* indices of the vertices of all faces that belong to only one cell of this rank; other vertices cannot be hanging
     * vertices */
    int64_t *vertices;
    /* number of entries of `twins`, which are computed again if vertices move (session_hanging.twins_version) */
    int64_t twin_count;
    session_twin *twins; /* twins of the border's vertices, sorted by vertex */
} session_border;

/* This rank's hanging vertices in the meshes of a mesh group, and the values that this rank sends to other ranks for
 * their hanging vertices. */
typedef struct session_hanging {
    /* session_mesh_group.positions_hash at the time when this struct was computed; 0: not computed yet */
    uint64_t positions_hash;
    int border_count;
    session_border *borders; /* outer faces of each of this rank's parts of the meshes; NULL: not computed yet */
    uint64_t twins_version;  /* version of the vertex coordinates for which the twins of the borders were found */
    int64_t count, total;    /* number of hanging vertices on this rank (count), and on all ranks together (total) */
    session_hanging_vertex *vertices; /* the hanging vertices; `count` entries */
    /* sent_counts: number of values that are sent to each rank; sent_groups: indices of the groups of equal vertices
     * whose values are sent, sorted by the rank that receives them */
    int64_t *sent_counts, *sent_groups;
    int64_t sent_total; /* number of values sent to all ranks together */
} session_hanging;

/* Groups of equal vertices of a mesh group's meshes on this rank (plan/session_vertex_groups.h). They are reused as
 * long as the meshes do not change. */
typedef struct session_vertex_groups {
    /* session_mesh_group.positions_hash at the time when the groups were computed; 0: not computed yet */
    uint64_t positions_hash;
    /* for each part of a mesh, the index of its first vertex in group_of_vertex; a final entry is the number of
     * vertices of all parts */
    int64_t *first_vertices;
    /* for each vertex of all parts, the index of its group of equal vertices; -1: the vertex belongs to no drawn
     * cell */
    int64_t *group_of_vertex;
    int64_t count; /* number of groups */
    /* prefix sums of the numbers of cell corners in groups: for each group, the number of corners of drawn cells whose
     * vertices belong to groups before it; count + 1 entries */
    int64_t *corner_starts;
    /* Hash table of the groups' keys: a vertex's global id, or the bits of its coordinates. It is used only for the
     * caller's values on boundary faces (insitu_patch): if the mesh is discontinuous, the groups of such a face's
     * vertices are found by their keys. Empty if no mesh has such values. */
    session_key_table keys;
    /* Groups whose positions lie in other ranks' bounding boxes, sorted by the ranks that combine their values (home
     * ranks, session_homes.h). There are none if there is only one rank. */
    int64_t shared_count;     /* number of groups whose positions lie in other ranks' boxes */
    int64_t *shared_groups;   /* index of each shared group */
    session_key *shared_keys; /* for each shared group, the key by which its home rank identifies it */
    int64_t *shared_counts;   /* for each rank, the number of shared groups whose home rank it is */
} session_vertex_groups;

typedef struct session_catalogue_mesh {
    char *name;
    int first_rank;  /* lowest rank that has cells of the mesh; -1: there is none */
    bool has_ids;    /* set if all ranks that have cells give global vertex ids */
    bool is_refined; /* set if a block of the mesh, on any rank, has a level of refinement */
    /* set if all drawn cells, over all ranks, are shells (triangles, quads or polygons); computed by
     * session_check_vertex_order() */
    bool has_shells_alone;
    /* set if cells, on any rank, are of higher order; computed by session_check_vertex_order() */
    bool has_higher_order;
    /* set if cells of higher order, on any rank, are bent (session_straight.h); computed by
     * session_check_vertex_order() */
    bool has_bent_cells;
    /* error of the mesh; NULL: there is none. The step ignores a mesh with an error, but the catalogue keeps the names
     * of its fields */
    base_error *fault;
    int field_count;
    session_catalogue_field *fields;
    /* if the mesh has vertex ids: the hash that identifies the mesh group of this mesh alone (session_mesh_group.name);
     * otherwise 0 */
    uint64_t single_group_name;
    /* sums over all ranks of hashes of session_mesh.cells_stamp (cells_hash) and of session_mesh.coordinates_stamp
     * (positions_hash), which show when cells and coordinates last changed; 0: not computed yet */
    uint64_t cells_hash, positions_hash;
    /* the home ranks (session_homes.h) of vertices and faces of this mesh; valid if computed for the current
     * positions_hash */
    session_homes homes;
} session_catalogue_mesh;

/* A set of meshes across which cell values are averaged at equal vertices. It consists of all meshes without vertex ids
 * that have the field that one layer of an image shows. A mesh with vertex ids is a mesh group by itself, because ids
 * are unique only within one mesh. */
typedef struct session_mesh_group {
    /* hash that identifies the mesh group: scene_field.mesh_group_name, or session_catalogue_mesh.single_group_name */
    uint64_t name;
    int count;                       /* number of meshes in the mesh group */
    session_catalogue_mesh **meshes; /* the meshes of the mesh group, sorted by name; owned by the catalogue */
    /* set if the mesh group is a single mesh with global vertex ids; vertices are then equal if their ids are equal */
    bool by_id;
    /* hash of the positions_hash of all meshes of the mesh group; it changes if coordinates of any of these meshes
     * change; 0: not computed yet */
    uint64_t positions_hash;
    /* home ranks of vertices and faces, if the mesh group has several meshes; for a single mesh,
     * session_catalogue_mesh.homes is used instead */
    session_homes own_homes;
    const session_homes *homes; /* points to own_homes, or to the homes of the single mesh */
    session_vertex_groups groups;
    session_hanging hanging;
} session_mesh_group;

typedef struct session_catalogue {
    bool is_known;           /* set if the catalogue has been computed since the session began */
    bool has_faults;         /* set if some mesh or field has an error */
    bool are_derived;        /* set if the catalogue contains the derived fields of the current scene */
    bool are_meshes_grouped; /* set if mesh_groups contains the mesh groups of the current scene */
    bool are_hashes_known;   /* set if cells_hash and positions_hash of all meshes are up to date */
    /* an error that belongs to no known mesh, or lack of memory on some rank, because of which no image can be drawn;
     * NULL: there is no such error */
    base_error *fault;
    int mesh_count, mesh_group_count;
    session_catalogue_mesh *meshes;
    session_mesh_group **mesh_groups;
} session_catalogue;

/* Builds the catalogue from the tables of all ranks. is_shared: all ranks have the same meshes and fields (equal
 * session_hash_mesh_table()), and no mesh or field has an error; the tables are then not exchanged. Meshes with an
 * error are excluded from the step. Collective. */
insitu_status session_update_catalogue(session_catalogue *catalogue, session_meshes *meshes, const session_team *team,
                                       bool is_shared, base_error *error);
void session_catalogue_free(session_catalogue *catalogue);

/* Computes the home ranks (session_homes.h) of meshes and mesh groups again if their cells or positions have changed.
 * half_diagonal: half of the diagonal of the scene's bounds. Collective; all ranks return the same status. */
insitu_status session_update_home_ranks(session_catalogue *catalogue, const session_meshes *meshes,
                                        double half_diagonal, const session_team *team, base_error *error);
/* Marks the home ranks as unknown. This must be called on all ranks if cells have changed on any rank;
 * session_update_home_ranks() then finds out which meshes have changed. Local. */
void session_invalidate_homes(session_catalogue *catalogue);

/* Returns whether some mesh has cells of higher order on any rank. */
static inline bool session_catalogue_has_higher_order(const session_catalogue *catalogue)
{
    bool is_any = false;
    for (int m = 0; m < catalogue->mesh_count; m++) is_any = is_any || catalogue->meshes[m].has_higher_order;
    return is_any;
}

/* Returns the hash that identifies the mesh group over which values on this mesh are averaged
 * (session_mesh_group.name). If the mesh has vertex ids, it is that of the group of this mesh alone; otherwise it is
 * mesh_group_name, the hash stored in the layer's field. */
static inline uint64_t session_find_group_name_of_mesh(const session_catalogue_mesh *mesh, uint64_t mesh_group_name)
{
    return mesh->single_group_name ? mesh->single_group_name : mesh_group_name;
}

/* Returns the mesh group whose member `name`, a hash, has this value; NULL if there is none. */
session_mesh_group *session_find_mesh_group(const session_catalogue *catalogue, uint64_t name);
void session_drop_mesh_groups(session_catalogue *catalogue);
/* Frees the data of the hanging vertices and, if with_borders is set, the lists of outer faces (session_border). */
void session_hanging_free(session_hanging *hanging, bool with_borders);

/* This rank's parts of the meshes of a mesh group, sorted by mesh. */
typedef struct session_mesh_group_parts {
    int count;                  /* number of this rank's parts */
    const session_mesh **items; /* the parts, owned by session_meshes */
    /* for each mesh of the group, index of its first part in `items`; a final entry is `count` */
    int *first_parts;
} session_mesh_group_parts;

/* Lists this rank's parts of the mesh group's meshes. Returns false if memory runs out; then nothing needs to be
 * freed. */
bool session_list_mesh_group_parts(const session_mesh_group *mesh_group, const session_meshes *meshes,
                                   session_mesh_group_parts *out);
void session_mesh_group_parts_free(session_mesh_group_parts *parts);

void session_vertex_groups_free(session_vertex_groups *groups);

/* Returns a hash of this rank's table of meshes and fields, a text with their names and properties
 * (session_catalogue.c). Two ranks with equal tables have equal hashes. Local. */
uint64_t session_hash_mesh_table(const session_meshes *meshes);

/* Adds a field that all ranks with cells of the mesh have. Its name must not exist yet. derived: index of the field
 * among the scene's derived fields. Returns NULL if memory runs out. */
session_catalogue_field *session_catalogue_add_field(session_catalogue_mesh *mesh, const char *name,
                                                     int component_count, insitu_centring centring, int derived);
/* Removes the derived fields from the catalogue. */
void session_catalogue_drop_derived(session_catalogue *catalogue);

/* Returns the catalogue's entry for the field, or NULL if no rank has it. Local. */
const session_catalogue_field *session_catalogue_find_field(const session_catalogue_mesh *mesh, const char *name);

#endif
