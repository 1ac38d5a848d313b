/* This rank's parts of the meshes: the caller's data, data derived from it, and the trees over it. */
#ifndef SESSION_MESH_H
#define SESSION_MESH_H

#include "error.h"
#include "grid.h"
#include "insitu/insitu.h"
#include "mmbvh.h"

typedef struct session_field {
    insitu_field given; /* name is a copy of ours, the values are borrowed */
    grid_array values;  /* or of the first component, if each is an array of its own: */
    grid_array *apart;
    int64_t component_stride;
    base_error problem;          /* what was wrong with the last insitu_set_field(), */
    bool is_problem_of_contents; /* or with its values, found by this step's check */
    bool has_index;
    bool is_copy_stale; /* the values or the index have changed since the copy was made */
    bool is_wanted;     /* needed by statistics of this step; fields of images have scalars */
    bool is_filled;     /* given.fill was called in this step; its values are valid unless it failed: */
    base_error fill_problem;
    bool is_derived;          /* the session makes it of other fields, in copy (plan/session_derived.h) */
    bool is_source;           /* a derived field that this step needs is made of it */
    uint64_t made_of;         /* hash of the inputs of a derived field's values; 0: no values yet */
    int64_t version;          /* incremented at each known change of the values */
    insitu_patch *patches;    /* given.patches, a table of ours */
    insitu_array *components; /* given.components, a table of ours */
    char *copy;               /* NULL until made; packed tuples, components interleaved */
    int64_t copy_bytes;
} session_field;

/* The cells over which an extent is taken. All are drawn and have only finite values. */
typedef enum session_extent_kind {
    SESSION_SEEN,     /* all of them */
    SESSION_POSITIVE, /* for the minimum, only cells all of whose values are positive */
    SESSION_SOLID,    /* without shells */
    SESSION_EXTENTS
} session_extent_kind;

/* low > high: there are no values. */
typedef struct session_extremes {
    bool is_known;
    double low, high;
} session_extremes;

/* A plane that cuts meshes. */
typedef struct session_plane {
    double normal[3]; /* unit normal */
    double point[3];  /* a point on the plane */
    /* the point is at `offset` along the normal from the middle of the data's bounds, and moves with them */
    bool is_central;
    /* share: additional shift along the normal, as a fraction (-1 .. 1) of half the data's extent */
    double offset, share;
} session_plane;

/* A scalar that a layer uses: a component or the magnitude of a field, as given or recentred to vertices; or the
 * vertices' signed distances from a plane. */
typedef struct session_scalar {
    int field;     /* index of the field in the mesh; -1: distances */
    int component; /* as grid_field.component */
    bool is_recentred;
    uint64_t joined;    /* scene_field.joined of recentred values */
    int64_t made;       /* how often their values were made */
    uint64_t of_places; /* the session_joint.places that they were made of */
    bool is_used;       /* an image of this step uses it */
    bool wants_ranges;  /* an image of this step needs its trees' ranges; colours need none */
    bool needs_all;     /* an image of this step may need any cell */
    /* unless needs_all: intervals of the values that this step's images show; cells that meet one are candidates */
    int interval_count;
    mmbvh_interval *intervals;
    session_plane plane;       /* the plane that distances are from */
    float *distances;          /* at vertices, a declared copy; NULL until computed */
    double *vertex_values;     /* cell values recentred to vertices, reported as a copy; NULL until computed */
    grid_field own;            /* the cells' own values, where recentred ones are in use */
    int32_t *gradient_entries; /* each vertex's entry in gradients, or -1; NULL until computed. A declared copy, for
                                  smooth normals of the last step that drew some */
    float (*gradients)[3];
    int64_t gradient_count;
    bool are_values_stale; /* recentred values must be computed again */
    bool is_suspect;       /* the values were set anew and may have changed */
    bool has_checksum;
    uint64_t checksum;
    uint64_t sample;     /* checksum of a few of the values */
    int64_t version;     /* number of changes of the values that checksums have found */
    bool has_own_ranges; /* ranges are in the tree's nodes, else in pairs */
    float *pairs;        /* NULL until computed */
    bool are_ranges_stale;
    int64_t unusable;
    session_extremes extremes[SESSION_EXTENTS];
} session_scalar;

/* A face of a cell, by its index among the cell's faces (session_cell_faces.h). */
typedef struct session_face {
    int64_t cell;
    int64_t face;
} session_face;

struct session_mesh;

/* The cells whose values of a scalar lie within bounds; for a field at vertices, all vertices' values. */
typedef struct session_threshold {
    bool is_given; /* else all cells */
    int field;     /* index of the field in the mesh; -1: the mesh does not have it, so that no cell is within */
    int component; /* as grid_field.component */
    double low, high;
} session_threshold;

/* The faces of a mesh that only one cell has, among the cells of a threshold over all ranks, and a mesh of tets and
 * pyramids on them; a declared copy (session_outer_mesh.h). */
typedef struct session_outer {
    session_threshold threshold;
    int64_t version; /* the version of the values that the threshold has tested, if there is one */
    bool is_wanted;  /* an image of this step needs it */
    bool are_faces_known;
    int64_t face_count;
    session_face *faces;       /* in the order of the cells */
    struct session_mesh *mesh; /* NULL until made; its name is the mesh's */
    double *coordinates;       /* the mesh's vertices × 3 */
    int64_t *connectivity, *offsets;
    unsigned char *types;
    int64_t *loops; /* as render_part.loops */
    /* per vertex and per cell of the outer mesh: that of the whole mesh whose values it has */
    int64_t *vertex_origins, *cell_origins;
    int64_t bytes;
} session_outer;

/* Arrays owned by the session that are read in place of the caller's (session_topology.h). They are computed once per
 * topology, and are declared copies. */
typedef struct session_topology {
    bool is_made;                     /* up to date for the current cells, even if there was nothing to compute */
    bool has_own_order;               /* `connectivity` is read, with the caller's offsets and types */
    bool has_own_cells;               /* the next members are read, else the caller's cells */
    grid_array offsets, connectivity; /* no offsets: all cells have type cell_type */
    unsigned char *cell_types;        /* NULL: all cells have type cell_type */
    int cell_type;
    bool has_own_faces;                         /* the next members are read, else the caller's faces */
    grid_array face_offsets, face_connectivity; /* no data: there are no polyhedra */
    /* lengths of the arrays that are read, the caller's or these */
    int64_t connectivity_count, face_connectivity_count;
    int64_t cell_bytes, face_bytes;
    int64_t polyhedron_count; /* number of polyhedra that the caller gave */
    int64_t recognised_count; /* number of these that are read as tets, hexes, wedges or pyramids */
} session_topology;

/* Separate vertices for each corner of each cell, read in place of the vertices that cells share (session_torn.h). A
 * declared copy. Corners are numbered as in the caller's connectivity, without the unused ends of rows. */
typedef struct session_torn {
    bool is_torn; /* if false, all else is empty */
    bool is_made; /* from the current coordinates */
    int64_t corner_count;
    grid_array shared;  /* the connectivity that is torn */
    grid_array corners; /* the corner of each entry of shared; the map is its own inverse */
    grid_array coordinates[3];
    int64_t bytes;
} session_torn;

/* A structured block. */
typedef struct session_lattice {
    insitu_lattice given; /* given.lattice of the mesh points to it, unless that is NULL */
    grid_lattice cells;
    double *places[3]; /* coordinates along the axes, of uniform and rectilinear ones: a declared copy */
    int64_t bytes;     /* size of places in bytes */
} session_lattice;

enum { SESSION_CONFORMED = 9 };

/* Arrays that are read from copies in other types (session_conform.h), declared ones. */
typedef struct session_conformed {
    char *copies[SESSION_CONFORMED]; /* NULL: read where they are */
    unsigned char *types;            /* of the code's own numbers for them; NULL: it has none */
    int type_count;
    int64_t bytes;
} session_conformed;

/* The cells of a block with a level of refinement, without ghost layers, as indices of its level. It is sent to other
 * ranks as words. */
typedef struct session_level_box {
    uint64_t mesh; /* hash of its name */
    int64_t block, rank;
    int64_t lower[3], upper[3], refinement[3];
} session_level_box;

/* A finer block that covers part of a cell of this block. */
typedef struct session_misfit {
    bool is_any;
    int axis;                  /* along which it ends within the cell */
    int64_t block, refinement; /* the finer block's number on its rank, and its refinement along the axis */
    int rank;
} session_misfit;

/* Block number of a mesh that is not given as blocks, whose numbers start at 0. */
#define SESSION_WHOLE INT64_MIN

/* One rank's part of a mesh, or one block of it. Blocks of one mesh have the same name. */
typedef struct session_mesh {
    char *name;
    int64_t block;        /* SESSION_WHOLE, or the block's number */
    char *label;          /* name for messages: "m", or "m[17]" for block 17 */
    insitu_mesh original; /* the caller's description, */
    insitu_mesh given;    /* with copies for the arrays that cannot be read in place */
    session_conformed conformed;
    session_topology topology;
    session_torn torn;
    session_lattice lattice;
    unsigned char *covered; /* NULL, or a byte a cell read in place of ghosts: those, and the cells that finer blocks
                               cover (outer/session_covers.h); a declared copy */
    session_misfit misfit;
    grid cells;
    bool is_given;               /* false after an insitu_set_mesh() that failed: problem says why */
    base_error problem;          /* what was wrong with the last insitu_set_mesh(), */
    bool is_problem_of_contents; /* or with the arrays' contents, found by the step's check */
    int field_count;
    session_field *fields;

    int64_t cells_stamp, places_stamp; /* session_meshes.stamp when cells and coordinates last changed */
    bool is_check_stale;
    bool is_topology_stale;    /* the tree belongs to other cells */
    bool is_geometry_stale;    /* the tree belongs to other coordinates */
    double lower[3], upper[3]; /* bounds of the drawn cells; lower > upper: there are none */
    int64_t drawn_count, ghost_count, inverted_count, flat_count, shell_count; /* shells are drawn and flat */
    bool has_shells_alone; /* as session_catalogue_mesh.has_shells_alone: on all ranks */
    double size_sum;       /* the sum of the cube roots of drawn cells' volumes */
    uint64_t *flat;        /* NULL: no cell is flat; else as in cells */

    uint64_t apart;  /* session_catalogue_mesh.apart */
    bool is_refined; /* session_catalogue_mesh.is_refined */
    bool is_needed;  /* an image of this step draws it */
    bool has_tree;
    mmbvh tree;
    bool is_partial;         /* the tree contains only the candidates of candidates_key, as long as nothing changes */
    bool are_bounds_partial; /* the full tree's bounds are those of the candidates, likewise */
    double built_surface;    /* half the surface of the mesh's bounds when the tree was built */
    uint64_t candidates_key;
    /* number of steps that the current full tree, or the last one, has been used; 0: there was none yet */
    int full_tree_steps;
    double rent; /* seconds spent on partial trees since the cells last changed, beyond the cost of a full tree */
    int scalar_count;
    session_scalar *scalars;

    int outer_count; /* one per threshold, and one without a threshold */
    session_outer **outers;
} session_mesh;

/* The fill function of the caller that is running (session_filled.h). */
typedef struct session_filling {
    const char *mesh, *field; /* NULL: none is running */
    base_error refused;       /* error of the first session call that the fill function made */
} session_filling;

/* All meshes of this rank. */
typedef struct session_meshes {
    int count, capacity;
    session_mesh **items;               /* sorted by name, then by block */
    bool are_cells_changed;             /* cells or coordinates have changed since the last agreed extent */
    bool are_names_changed;             /* names have changed since the last agreed catalogue */
    bool are_levels_changed;            /* blocks with levels of refinement have changed since covered cells were found */
    int64_t level_box_count;            /* number of refined blocks near this rank's, including its own */
    session_level_box *level_boxes;
    int64_t stamp;                      /* incremented by each change of cells or coordinates */
    base_error pending;                 /* error of a set call for which there was no mesh to keep it; for one step */
    char *pending_mesh, *pending_field; /* its mesh and field; NULL: any */
    int aside_count;                    /* number of meshes that this step ignores, stored in items behind count */
    session_filling filling;
} session_meshes;

static inline int64_t session_type_size(insitu_type type)
{
    switch (type) {
    case INSITU_FLOAT32:
    case INSITU_INT32:
    case INSITU_UINT32: return 4;
    case INSITU_FLOAT64:
    case INSITU_INT64:
    case INSITU_UINT64: return 8;
    case INSITU_INT16:
    case INSITU_UINT16: return 2;
    case INSITU_INT8:
    case INSITU_UINT8: return 1;
    }
    return 0;
}

/* Tells whether the place and the stride of an array are multiples of its elements' size. */
bool session_is_aligned(const insitu_array *array);

/* An array as the rooms below read it; its indices count from 0. */
grid_array session_grid_array(const insitu_array *array);

/* Returns the vertices' coordinates along an axis; if z is not given, a single 0 for all vertices. */
grid_array session_coordinates(const insitu_mesh *mesh, int axis);

/* As above, for an array whose indices count from the mesh's index_base. */
grid_array session_index_array(const insitu_mesh *mesh, const insitu_array *array);

/* As above, for offsets of so many cells or faces into so many entries, whose last one may be missing. */
grid_array session_offset_array(const insitu_mesh *mesh, const insitu_array *array, int64_t count, int64_t entries);

/* Allocates count + 1 indices, all 0, of 4 bytes where largest fits into them, else of 8. Returns false where memory
 * runs out; the error then names the mesh and what the indices are of. */
bool session_make_indices(const session_mesh *mesh, const char *what, int64_t count, int64_t largest, grid_array *out,
                          base_error *error);

static inline void session_put_index(const grid_array *array, int64_t i, int64_t value)
{
    char *p = (char *)(uintptr_t)array->data + i * array->stride;
    if (array->is_wide)
        *(int64_t *)(void *)p = value;
    else
        *(int32_t *)(void *)p = (int32_t)value;
}

/* Frees an array owned by the session. */
void session_drop_array(grid_array *array);

/* This rank's parts of a mesh: the mesh itself, or its blocks. */
typedef struct session_parts {
    int count; /* 0: there is none of this name */
    session_mesh **items;
} session_parts;

session_parts session_find_parts(const session_meshes *meshes, const char *name);
/* Returns the parts from this index on that have the name of the first. */
session_parts session_parts_at(const session_meshes *meshes, int first);
/* Returns the block; NULL if there is none of this name and number. */
session_mesh *session_find_block(const session_meshes *meshes, const char *name, int64_t block);
/* The same of a mesh that is not given as blocks. */
static inline session_mesh *session_find_mesh(const session_meshes *meshes, const char *name)
{
    return session_find_block(meshes, name, SESSION_WHOLE);
}
int session_find_field(const session_mesh *mesh, const char *name); /* index, or -1 */

/* Adds a field without values; its name must be new and is copied. Returns NULL if memory runs out. */
session_field *session_add_field(session_mesh *mesh, const char *name);

/* Adds an empty mesh or block, which must be new. Returns NULL if memory runs out. */
session_mesh *session_add_mesh(session_meshes *meshes, const char *name, int64_t block, base_error *error);
/* Remove a block, or a mesh with all its blocks, if there is such a one. */
void session_remove_block(session_meshes *meshes, const char *name, int64_t block);
void session_remove_mesh(session_meshes *meshes, const char *name);

/* Free the data that depends on the fields' values, on the cells, or all data of the mesh. */
void session_drop_scalars(session_mesh *mesh);
/* Frees one scalar; those after it move up. */
void session_drop_scalar(session_mesh *mesh, int number);
void session_drop_gradients(session_scalar *scalar);
void session_drop_tree(session_mesh *mesh);
void session_drop_topology(session_topology *topology);
void session_drop_torn(session_torn *torn);
void session_drop_axes(session_lattice *lattice);
void session_drop_conformed(session_conformed *conformed);
void session_drop_fields(session_mesh *mesh);
void session_drop_copy(session_field *field);
/* Frees the copies of the caller's tables: patches and components. */
void session_drop_field_tables(session_field *field);
/* Frees what depends on the cells after these have changed; fields stay. */
void session_renew_cells(session_meshes *meshes, session_mesh *mesh);
/* Removes the derived fields, and with them all scalars and thresholds, which go by the numbers of fields. */
void session_drop_derived(session_mesh *mesh);
/* Frees the mesh of outer faces, and if with_faces also the faces; its threshold stays. */
void session_drop_outer(session_outer *outer, bool with_faces);
/* Drops all outer surfaces of a mesh; if cells are new, thresholds too. */
void session_drop_outers(session_mesh *mesh, bool are_cells_new);
void session_drop_contents(session_mesh *mesh);
/* Drops all data of a mesh whose description is wrong, except the names of its fields: images that show these fields
 * need the mesh. */
void session_refuse_mesh(session_mesh *mesh);
void session_meshes_free(session_meshes *meshes);

/* Visits the meshes that may become parts of a picture: the caller's meshes, then the meshes of their outer faces.
 *
 *     for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) use(walk.part);
 */
typedef struct session_part_walk {
    const session_meshes *meshes;
    session_mesh *part;
    session_mesh *whole;  /* the mesh to which the part's outer faces belong; NULL: the part is a mesh itself */
    session_outer *outer; /* these faces, or NULL */
    int mesh_at, whole_at, outer_at;
} session_part_walk;

/* Returns false after the last part. */
bool session_next_part(session_part_walk *walk);

/* Returns the number of cells that the caller gave; a lattice's array of cells may have padding. */
static inline int64_t session_cell_count(const session_mesh *mesh)
{
    return mesh->cells.lattice ? mesh->lattice.cells.cell_count : mesh->given.cell_count;
}

/* Returns the number of vertices at which scalars have values. */
static inline int64_t session_vertex_count(const session_mesh *mesh)
{
    return mesh->torn.is_torn ? mesh->torn.corner_count : mesh->cells.vertex_count;
}

/* Returns the first error of a set call that has not been returned by a step yet, or NULL. */
const base_error *session_pending_error(const session_meshes *meshes);

/* Stores an error of a set call for which there is no mesh to keep it. field: NULL if the error does not belong to a
 * single field. */
void session_keep_pending(session_meshes *meshes, const base_error *error, const char *mesh, const char *field);
void session_drop_pending(session_meshes *meshes);

/* Stores an error in a field's values for the rest of the step; copies it to *first if that holds no error yet. */
void session_keep_problem(session_field *field, const base_error *problem, base_error *first);

/* Removes a mesh from the list for the rest of a step, as if this rank had no part of it. */
void session_put_aside(session_meshes *meshes, session_mesh *mesh);
/* Returns the meshes that were put aside to the list. */
void session_take_back(session_meshes *meshes);

/* Refuses a public call if it is made inside a fill function, as it would change data that the step reads. Returns
 * whether it was refused; the error is stored in filling.refused, and the step fails with it. Local. */
bool session_refuse_in_fill(session_meshes *meshes, const char *call);

/* Returns whether cells are described by the owners of their faces. */
static inline bool session_has_owners(const insitu_mesh *mesh)
{
    return mesh->owner.data || mesh->boundary_owner.data;
}

/* Returns whether the mesh is a block with a level of refinement. */
static inline bool session_has_levels(const insitu_mesh *mesh)
{
    const insitu_lattice *l = mesh->lattice;
    return l && mesh->cell_count > 0 && (l->refinement[0] || l->refinement[1] || l->refinement[2]);
}

/* Returns the number of given faces. Those of the separate list for the boundary come after the others. */
static inline int64_t session_face_count(const insitu_mesh *mesh)
{
    return mesh->face_count + mesh->boundary_face_count;
}

#endif
