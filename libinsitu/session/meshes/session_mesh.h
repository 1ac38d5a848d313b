/* This rank's parts of the meshes: the caller's data, data derived from it, and the trees over it. Terms that the
 * session's code uses:
 * - part: one rank's part of a mesh; if the rank has several blocks of the mesh, each block is a part;
 * - piece: one of the linear cells into which a cell of higher order is split (session_split.h);
 * - caller's cell: a cell as the caller gave it, before it is split into pieces;
 * - row: list of the nodes of one of the caller's cells in the connectivity (session_rows.h);
 * - finer lattice: additional nodes of a cell of higher order, at which its polynomial is evaluated (session_finer.h);
 * - recentred values: cell or corner values that were averaged to the vertices (session_recentre.h);
 * - mirror image: copy of a part with mirrored coordinates, which the scene draws in addition (session_mirror.h);
 * - shell: a triangle, quad or polygon that is drawn; a shell has no volume;
 * - drawn cell: a cell that is not a ghost;
 * - outer surface: the faces that belong to only one of the cells selected by a threshold (session_outer below);
 * - mesh group: the meshes across which values are averaged at equal vertices (session_catalogue.h);
 * - tree: bounding volume hierarchy over the drawn cells. */
#ifndef SESSION_MESH_H
#define SESSION_MESH_H

#include "error.h"
#include "grid.h"
#include "insitu/insitu.h"
#include "mmbvh.h"

typedef struct session_field {
    insitu_field given; /* the name is a copy owned by the session; the values belong to the caller */
    /* array of all components or, if each component has its own array (component_arrays), of the first component */
    grid_array values;
    grid_array *component_arrays; /* array of each component; NULL: all components are in `values` */
    int64_t component_stride;     /* distance in bytes between the components of a tuple in `values` */
    base_error problem;           /* error of the last insitu_set_field(), or an error of the values */
    bool is_problem_of_contents;  /* set if `problem` is an invalid value that the check in this step has found */
    bool has_index;     /* set if an index array gives the tuple of each vertex or cell (insitu_field.index) */
    bool is_copy_stale; /* set if the values or the index have changed since `copy` was made */
    /* set if statistics of this step need the field; fields shown by images have scalars instead */
    bool is_in_statistics;
    /* set if given.fill was called in this step; the values are valid unless fill_problem holds an error */
    bool is_filled;
    base_error fill_problem;
    /* set if the session computes the field from other fields, in `copy` (plan/session_derived.h) */
    bool is_derived;
    bool is_source;       /* set if this step computes a derived field from this field */
    bool is_displacement; /* set if the scene displaces the mesh's vertices by this field */
    /* hash of the inputs from which a derived field was computed; 0: there are no values yet */
    uint64_t inputs_hash;
    int64_t version;          /* number of times that the values are known to have changed */
    int64_t source_version;   /* on a mirror image: `version` that the field of the source mesh had when the values were
                                 copied from it */
    bool has_borrowed_copy;   /* on a mirror image: set if `copy` is owned by the same field of the source mesh */
    insitu_patch *patches;    /* copy of the table given.patches, owned by the session */
    insitu_array *components; /* copy of the table given.components, owned by the session */
    char *copy;               /* packed tuples with interleaved components; NULL: there is no copy yet */
    int64_t copy_bytes;       /* size of `copy` in bytes */
} session_field;

/* The sets of cells over which a minimum and maximum are computed. All of these cells are drawn and have only finite
 * values. */
typedef enum session_extent_kind {
    SESSION_SEEN, /* all drawn cells that have only finite values */
    /* the same cells as SESSION_SEEN for the maximum; for the minimum, only those of them all of whose values are
     * positive */
    SESSION_POSITIVE,
    SESSION_SOLID, /* as SESSION_SEEN, but without shells */
    SESSION_EXTENTS
} session_extent_kind;

/* Minimum and maximum of a scalar's values over a set of cells; low > high means that the set has no values. */
typedef struct session_extremes {
    bool is_known; /* set if low and high are up to date */
    double low, high;
    /* number of drawn cells that are not in the set because they have a value that is not finite; a cell that is split
     * into pieces is counted once for each piece */
    int64_t unusable_count;
} session_extremes;

/* A plane that cuts meshes. */
typedef struct session_plane {
    double normal[3]; /* unit normal of the plane */
    double point[3];  /* a point on the plane */
    /* true: the point is not fixed, but at the distance `offset` along the normal from the centre of the data's
     * bounds */
    bool is_central;
    double offset; /* distance along the normal from the centre of the data's bounds to the point */
    /* additional shift along the normal, as a fraction (-1 .. 1) of half the data's extent */
    double extent_fraction;
} session_plane;

/* A scalar that a layer uses: a component or the magnitude of a field, as given or recentred to vertices; or the
 * vertices' signed distances from a plane. */
typedef struct session_scalar {
    int field;         /* index of the field in the mesh; -1: the scalar is the signed distance from a plane */
    int component;     /* index of the component, or -1 for the magnitude (grid_field.component) */
    bool is_recentred; /* set if cell or corner values are averaged to vertices */
    /* if the values are recentred: hash that identifies the meshes across which they are averaged
     * (session_mesh_group.name) */
    uint64_t mesh_group_name;
    int64_t computed_count;  /* number of times that the values have been computed */
    uint64_t positions_hash; /* session_mesh_group.positions_hash at the time when the values were computed */
    bool is_used;            /* set if an image of this step uses the scalar */
    /* set if an image of this step needs the minimum and maximum of the scalar in each node of the tree; scalars that
     * only give colours do not need them */
    bool needs_ranges;
    bool needs_all_cells; /* set if an image of this step may show any cell, whatever its values are */
    /* Intervals of values that this step's images show; not used if needs_all_cells is set. Images need only cells
     * whose range of values intersects an interval. */
    int interval_count;
    mmbvh_interval *intervals;
    session_plane plane; /* the plane from which the vertices' distances are computed, if field is -1 */
    /* signed distance of each vertex from the plane; NULL: not computed yet. insitu_report lists them as a copy */
    float *distances;
    /* cell values recentred to vertices; NULL: not computed yet. insitu_report lists them as a copy */
    double *vertex_values;
    /* if the values are recentred, the cell or corner values from which they are computed */
    grid_field original_values;
    /* index of each vertex in `gradients`, or -1; NULL: not computed yet. The gradients are those of the last step that
     * drew smooth normals. insitu_report lists them as a copy */
    int32_t *gradient_indices;
    float (*gradients)[3];    /* gradient at each vertex that has an index */
    int64_t gradient_count;   /* number of gradients */
    bool are_values_stale;    /* set if recentred values must be computed again */
    bool may_have_changed;    /* set if the caller has set the field again, so that the values may have changed */
    bool has_checksum;        /* set if the checksums below have been computed */
    uint64_t checksum;        /* checksum of all values when they were last compared */
    uint64_t sample_checksum; /* checksum of a few of the values, to detect changes that the caller does not declare */
    int64_t version;          /* number of times that a checksum has shown that the values have changed */
    /* set if the minimum and maximum of each node of the tree are stored in the tree itself, and not in node_ranges */
    bool has_own_ranges;
    /* two numbers per node of the bounding volume hierarchy: minimum and maximum of the values in the node; NULL: not
     * computed yet */
    float *node_ranges;
    /* set if the minimum and maximum of the tree's nodes were computed for earlier values */
    bool are_ranges_stale;
    /* number of drawn cells that have a value that is not finite; a cell that is split into pieces is counted once for
     * each piece */
    int64_t unusable_count;
    session_extremes extremes[SESSION_EXTENTS];
} session_scalar;

/* A face of a cell. face: index among the cell's faces (session_cell_faces.h). */
typedef struct session_face {
    int64_t cell;
    int64_t face;
} session_face;

struct session_mesh;

/* The cells whose values of a scalar lie within bounds. If the field is at vertices, the values of all vertices of the
 * cell must lie within them. */
typedef struct session_threshold {
    bool is_given; /* false: there is no threshold, and all cells are selected */
    int field;     /* index of the field in the mesh; -1: the mesh does not have it, so that no cell is selected */
    int component; /* index of the component, or -1 for the magnitude (grid_field.component) */
    double low, high;
} session_threshold;

/* The outer surface of a mesh or of its cells that a threshold selects: the faces that belong to only one of these
 * cells, over all ranks. It includes a mesh of tets and pyramids that is built on these faces (session_outer_mesh.h).
 * insitu_report lists it as a copy. */
typedef struct session_outer {
    session_threshold threshold;
    /* session_scalar.version of the values to which the threshold was applied, if there is a threshold */
    int64_t version;
    bool is_needed;       /* set if an image of this step needs the outer surface */
    bool are_faces_known; /* set if `faces` is up to date for the current cells */
    int64_t face_count;
    session_face *faces; /* outer faces, sorted by cell */
    /* the mesh built on the faces, which has the name of the whole mesh; NULL: not built yet */
    struct session_mesh *mesh;
    double *coordinates; /* three coordinates for each vertex of the mesh that is built on the outer faces */
    int64_t *connectivity, *offsets;
    unsigned char *types;
    int64_t *loops; /* outlines of polygons for edge lines, in the format of render_part.loops */
    /* vertex_origins: for each vertex of the outer mesh, the index of the vertex of the whole mesh that gives its
     * values; cell_origins: the same for cells */
    int64_t *vertex_origins, *cell_origins;
    int64_t bytes; /* size of all arrays of the outer surface in bytes */
} session_outer;

/* Arrays of cells and faces that are owned by the session and read instead of the caller's (session_topology.h). They
 * are kept until the cells that the session reads change. insitu_report lists them as copies. */
typedef struct session_topology {
    /* set if the arrays below match the caller's current cells, even if all of the caller's arrays can be read and
     * nothing had to be computed */
    bool is_made;
    /* set if the member `connectivity` below is read instead of the caller's, while the offsets and types are the
     * caller's */
    bool has_own_order;
    bool has_own_cells; /* set if the cells below are read instead of the caller's cells */
    /* offsets and connectivity of the cells that are read; `offsets` has no data if all cells have the type
     * cell_type */
    grid_array offsets, connectivity;
    unsigned char *cell_types; /* type of each cell; NULL: all cells have the type cell_type */
    int cell_type;
    bool has_own_faces; /* set if the faces below are read instead of the caller's faces */
    /* offsets and vertices of the faces of polyhedra; empty if there are no polyhedra */
    grid_array face_offsets, face_connectivity;
    /* number of entries of the arrays that are read, whether these are the caller's or the session's */
    int64_t connectivity_count, face_connectivity_count;
    int64_t cell_bytes, face_bytes;
    int64_t polyhedron_count; /* number of polyhedra that the caller gave */
    int64_t recognised_count; /* number of the caller's polyhedra that are read as tets, hexes, wedges or pyramids */
    /* Cells of higher order are read as several linear cells, called pieces (session_split.h); the pieces of a cell are
     * consecutive. */
    bool is_split;               /* true: cells are split into pieces; false: the members below are empty */
    bool depends_on_coordinates; /* set if the pieces depend on the coordinates */
    int64_t cell_count;          /* total number of pieces of all cells */
    uint32_t *parents;           /* for each piece, the index of the caller's cell from which it was cut */
    /* for each of the caller's cells, the index of its first piece; a final entry has the number of pieces */
    int64_t *first_pieces;
    unsigned char *ghosts; /* one byte per piece, nonzero if the caller's cell is a ghost; NULL: there are no ghosts */
} session_topology;

/* Vertices of a discontinuous mesh (session_discontinuous.h): each corner of each cell has a vertex of its own, which
 * is read in place of the vertices that cells share. insitu_report lists them as a copy. The index of a corner is its
 * position in the caller's connectivity, where unused entries are not counted. */
typedef struct session_discontinuous {
    bool is_active; /* set if the mesh is discontinuous; otherwise all other members are empty */
    bool is_made;   /* set if the coordinates are up to date */
    /* Set if cells are split into pieces. `shared_connectivity` is then the caller's connectivity, and each of its
     * entries is a corner. */
    bool are_corners_entries;
    int64_t corner_count;
    /* connectivity of the mesh with shared vertices, before each corner got a vertex of its own */
    grid_array shared_connectivity;
    /* connectivity of the discontinuous mesh: for each entry of the connectivity that is read, the index of its corner,
     * which is also the index of the corner's own vertex. If cells are not split, this is a permutation that is its own
     * inverse. */
    grid_array corners;
    grid_array coordinates[3];
    int64_t bytes;
} session_discontinuous;

/* Bounds and numbers of the drawn cells of a mesh, and the sum of their sizes; each member is described at the member
 * of session_mesh with the same name. */
typedef struct session_sizes {
    double lower[3], upper[3];
    int64_t drawn_count, flat_count;
    double size_sum;
} session_sizes;

/* Number of cells in each of several classes. Shells are cells that are drawn and have no volume. */
typedef struct session_counts {
    int64_t drawn_count, ghost_count, inverted_count, flat_count, shell_count;
} session_counts;

/* A set of linear pieces of cells of higher order. Only the pieces in the set are made and drawn. */
typedef struct session_piece_set {
    /* for each cell, the index of its first word in `bits`; a final entry marks the end. If a cell has no words, all of
     * its pieces are made. NULL: all pieces of all cells are made */
    int64_t *first_words;
    /* one bit per piece of a cell, set if the piece is made; the pieces are in the order of the pattern
     * (session_pattern.h) by which cells of this type and order are split */
    uint64_t *bits;
} session_piece_set;

enum { SESSION_FINER_COUNTS = 64 };

/* Nodes of a finer lattice in cells of higher order, at which their polynomials are evaluated (session_finer.h).
 * insitu_report lists them as a copy. */
typedef struct session_finer {
    bool is_counted; /* set if `counts` were computed for the current cells */
    /* numbers of the mesh's cells of higher order by order and class; the first enumeration in session_finer.c says
     * what each element is */
    int64_t counts[SESSION_FINER_COUNTS];
    int parts; /* number of parts into which each segment between two nodes of an edge is divided; 0: the mesh has no
                  finer lattices, and session_mesh.given is the caller's mesh */
    /* bounds, sum of sizes and numbers of cells that the mesh would have if cells were split only between their own
     * nodes */
    session_sizes sizes;
    session_counts given_counts;
    session_piece_set pieces; /* the pieces of refined cells that are made */
    /* for each of the caller's cells, a bit mask in which bit f is set if session_shape.faces[f] is an outer face
     * (session_outer_cells.h); NULL: not computed */
    unsigned char *outer_faces;
    bool is_lobatto; /* true: nodes of hexes and quads are treated as Gauss-Lobatto points */
    /* the caller's description of the mesh, in which copies replace the arrays that cannot be read in place */
    insitu_mesh nodal;
    /* description of the finer cells as a mesh, a copy of session_mesh.given: each cell has its own nodes, which are in
     * lexicographic order */
    insitu_mesh fine;
    double *coordinates; /* three coordinates for each node of the finer lattices */
    int64_t *offsets;    /* offsets of the finer cells; NULL if all cells have the same type and order */
    unsigned char *types;
    int64_t bytes;
} session_finer;

/* A structured block of cells. */
typedef struct session_lattice {
    insitu_lattice given; /* copy of the caller's description; session_mesh.given.lattice points to it, or is NULL if
                             the mesh is not structured */
    grid_lattice cells;
    /* coordinates along the axes of a uniform or rectilinear lattice. insitu_report lists them as a copy */
    double *axis_coordinates[3];
    int64_t bytes; /* size of the coordinates along all axes in bytes */
} session_lattice;

/* Coordinates that are read in place of the caller's, because the scene draws the mesh with moved vertices
 * (session_warp.h). insitu_report lists them as a copy. */
typedef struct session_warp {
    bool is_applied;             /* set if the moved coordinates are read */
    bool is_stale;               /* set if the caller's coordinates may have changed since they were moved */
    uint64_t key;                /* hash of the displacements by which the coordinates were moved */
    char *coordinate_memory;     /* memory of the moved coordinates (session_own_coordinates.h) */
    insitu_array coordinates[3]; /* the moved coordinates; an axis has no data if its coordinates are the caller's */
    insitu_array unmoved[3];     /* the coordinates that session_mesh.given had before the vertices were moved */
    /* the caller's lattice without its coordinates along the axes, because moved coordinates are given by vertex */
    insitu_lattice lattice;
    int64_t bytes;
    base_error problem; /* the reason why the vertices could not be moved; the check of the mesh returns it */
} session_warp;

/* Coordinates of a mirror image of a mesh (session_mirror.h). insitu_report lists them as a copy. */
typedef struct session_mirrored {
    /* for each axis along which the source mesh is mirrored, the coordinate of the mirror plane */
    double planes[3];
    char *coordinate_memory;     /* memory of the mirrored coordinates (session_own_coordinates.h) */
    insitu_array coordinates[3]; /* the mirrored coordinates; an axis has no data if its coordinates are those of the
                                    source mesh */
    double *axes[3];             /* coordinates along a lattice's axes, owned; NULL: coordinates are given by vertex */
    insitu_lattice lattice;      /* lattice in the mirror image's description */
    int64_t bytes;
    /* the values that cells_stamp and coordinates_stamp of the source mesh had when the mirror image was made or
     * updated last */
    int64_t cells_stamp, coordinates_stamp;
} session_mirrored;

enum { SESSION_CONFORMED = 9 };

/* Copies of arrays whose type cannot be read in place (session_conform.h). insitu_report lists them. */
typedef struct session_conformed {
    char *copies[SESSION_CONFORMED]; /* NULL: the array is read in place */
    /* copy of the caller's map, with type_count entries: types[number] is the cell type for which the caller uses this
     * number; NULL: the caller uses the library's numbers */
    unsigned char *types;
    int type_count;
    int64_t bytes;
} session_conformed;

/* The cells of a refined block without its ghost layers, as a box of cell indices at the block's level of refinement.
 * It is sent to other ranks as 64-bit words. */
typedef struct session_level_box {
    uint64_t mesh; /* hash of the mesh's name */
    int64_t block, rank;
    int64_t lower[3], upper[3], refinement[3];
} session_level_box;

/* Describes an error of a block with a level of refinement: a finer block covers only part of one of its cells. */
typedef struct session_misfit {
    bool exists; /* set if a finer block covers only part of a cell; the other members then describe this block */
    int axis;    /* axis along which the finer block ends within the cell */
    /* session_mesh.block of the finer block, and its refinement along the axis */
    int64_t block, refinement;
    int rank; /* rank that has the finer block */
} session_misfit;

/* Value of session_mesh.block for a mesh that does not consist of blocks; blocks are numbered from 0. */
#define SESSION_WHOLE INT64_MIN

/* One rank's part of a mesh, or one block of it. Blocks of one mesh have the same name. */
typedef struct session_mesh {
    char *name;
    int64_t block; /* the block's number, or SESSION_WHOLE */
    /* For a mirror image: the caller's part that is mirrored; NULL: this part is the caller's. A mesh that the scene
     * mirrors has its mirror images as further parts, in addition to the caller's own parts. Statistics, counts and
     * errors ignore mirror images. */
    struct session_mesh *source;
    int mirror_axes; /* bit i is set if this mirror image is mirrored along axis i; 0: this part is the caller's */
    session_mirrored mirrored;
    char *label;          /* name for messages: "m", or "m[17]" for block 17 */
    insitu_mesh original; /* the caller's description */
    /* The description that is read. It equals `original`, except that arrays that cannot be read in place are replaced
     * by copies, and that coordinates may have been moved. If the mesh has finer lattices, it describes the cells of
     * these lattices. */
    insitu_mesh given;
    session_conformed conformed;
    session_topology topology;
    session_discontinuous discontinuous;
    session_finer finer;
    session_lattice lattice;
    session_warp warp;
    /* One byte per cell, read in place of `ghosts`: set for ghosts and for cells that finer blocks cover
     * (outer/session_covers.h). NULL: `ghosts` is read. insitu_report lists it as a copy. */
    unsigned char *covered;
    session_misfit misfit;
    grid cells;         /* the cells in the form that all code of the session reads */
    bool is_given;      /* false after an insitu_set_mesh() that failed; `problem` then holds the error */
    base_error problem; /* error of the last insitu_set_mesh(), or an error of the arrays' contents */
    /* set if `problem` is an error of the arrays' contents that the check in this step has found */
    bool is_problem_of_contents;
    int field_count;
    session_field *fields;

    /* cells_stamp: value of session_meshes.stamp at the last change of the cells; coordinates_stamp: its value at the
     * last change of the coordinates */
    int64_t cells_stamp, coordinates_stamp;
    bool is_check_stale;       /* set if cells or coordinates have changed since the mesh was last checked */
    bool is_topology_stale;    /* set if cells have changed since the tree was built */
    bool is_geometry_stale;    /* set if coordinates have changed since the tree was built or refitted */
    double lower[3], upper[3]; /* bounds of the drawn cells; lower > upper: there are none */
    /* Counts of the cells in `cells`, which may be pieces of the caller's cells. Shells are drawn cells that have no
     * volume because of their type. */
    int64_t drawn_count, flat_count, shell_count;
    session_counts given_counts; /* counts of the caller's cells */
    /* true if all drawn cells of the mesh are shells, on all ranks (session_catalogue_mesh.has_shells_alone) */
    bool has_shells_alone;
    /* sum of the cube roots of the volumes of the drawn cells, from which the mean size of cells is computed */
    double size_sum;
    uint64_t *flat_cells; /* one bit per cell, set if the cell is flat (grid.flat); NULL: no cell is flat */

    /* hash that identifies the mesh group of this mesh alone (session_catalogue_mesh.single_group_name) */
    uint64_t single_group_name;
    /* set if a block of the mesh, on any rank, has a level of refinement (session_catalogue_mesh.is_refined) */
    bool is_refined;
    bool is_needed; /* set if an image of this step draws the mesh */
    bool has_tree;  /* set if `tree` has been built */
    mmbvh tree;     /* tree over the drawn cells, or over some of them (is_partial) */
    /* Set if the tree contains only candidates: the cells that the current images can show according to their values
     * (plan/session_candidates.h). A partial tree can be used until candidates_key, values, cells or coordinates
     * change. A tree over all drawn cells is called full. */
    bool is_partial;
    /* set if the tree contains all drawn cells, but the bounds of its nodes were refitted only for the candidates */
    bool are_bounds_partial;
    double built_surface;    /* half the surface area of the mesh's bounds when the tree was built */
    uint64_t candidates_key; /* hash that identifies the candidates of the current images and values */
    /* number of steps that have used the tree over all drawn cells since it was built; 0: no such tree was built yet */
    int full_tree_steps;
    /* time in seconds that partial trees have taken since the cells last changed, minus the estimated time in which a
     * full tree would have been refitted instead. A full tree is built as soon as this difference exceeds the estimated
     * time of building it. */
    double partial_tree_seconds;
    int scalar_count;
    session_scalar *scalars;

    int outer_count; /* number of outer surfaces: one per threshold, and one without a threshold */
    session_outer **outers;
} session_mesh;

/* The caller's fill function that is running (session_filled.h). */
typedef struct session_filling {
    /* names of the mesh and the field that the running fill function fills; NULL: no fill function is running */
    const char *mesh, *field;
    /* error of the first call to this session that the fill function made; such calls are refused */
    base_error refused_error;
} session_filling;

/* All meshes of this rank. */
typedef struct session_meshes {
    int count, capacity;
    session_mesh **items; /* sorted by name, then by block */
    /* set if cells or coordinates have changed since the global bounds were last computed (session_space.h) */
    bool are_cells_changed;
    /* set if names, vertex ids or levels of refinement have changed since the catalogue (session_catalogue.h) was last
     * updated */
    bool are_names_changed;
    /* set if blocks with levels of refinement have changed since covered cells were computed */
    bool are_levels_changed;
    int64_t level_box_count; /* number of entries in level_boxes: the refined blocks of this rank, and refined blocks of
                                other ranks near them */
    session_level_box *level_boxes;
    int64_t stamp; /* incremented by each change of cells or coordinates */
    /* set if the most recent step that drew an image had warped or mirrored meshes; the same on all ranks */
    bool are_transformed;
    /* error of an insitu_set_*() call that belongs to no stored mesh; it is kept for one step */
    base_error pending_error;
    /* names of the mesh and the field to which pending_error belongs; NULL: to no particular mesh or field */
    char *pending_mesh, *pending_field;
    /* number of meshes that this step ignores; they are stored in `items` behind the first `count` meshes */
    int excluded_count;
    session_filling filling;
} session_meshes;

/* Returns the size of an element of this type in bytes. */
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

/* Returns whether the address and the stride of an array are multiples of its element size. */
bool session_is_aligned(const insitu_array *array);

/* Converts the caller's description of an array into a grid_array, through which meshes are read. Indices in the array
 * are read unchanged, as if they counted from 0. */
grid_array session_grid_array(const insitu_array *array);

/* Returns the vertices' coordinates along an axis. If z is not given, returns an array all of whose elements are 0. */
grid_array session_coordinates(const insitu_mesh *mesh, int axis);

/* Returns an array of indices as a grid_array, which subtracts the mesh's index_base from each index that is read. */
grid_array session_index_array(const insitu_mesh *mesh, const insitu_array *array);

/* Returns an array of offsets as a grid_array, for `count` cells or faces that have `entries` entries in total. The
 * caller may omit the last offset. */
grid_array session_offset_array(const insitu_mesh *mesh, const insitu_array *array, int64_t count, int64_t entries);

/* Returns the grid that reads the cells from the caller's arrays, without the session's changes. */
grid session_caller_grid(const insitu_mesh *mesh);

/* Allocates count + 1 indices, all 0, of 4 bytes if `largest` fits into them, and otherwise of 8 bytes. Returns false
 * if memory runs out; the error then names the mesh and `what`, the purpose of the indices. */
bool session_allocate_indices(const session_mesh *mesh, const char *what, int64_t count, int64_t largest,
                              grid_array *out, base_error *error);

static inline void session_store_index(const grid_array *array, int64_t i, int64_t value)
{
    char *p = (char *)(uintptr_t)array->data + i * array->stride;
    if (array->is_wide)
        *(int64_t *)(void *)p = value;
    else
        *(int32_t *)(void *)p = (int32_t)value;
}

/* Frees an array owned by the session. */
void session_drop_array(grid_array *array);

/* This rank's parts of a mesh: the mesh itself, or the mesh's blocks on this rank. */
typedef struct session_parts {
    int count; /* 0: this rank has no mesh of this name */
    session_mesh **items;
} session_parts;

/* Returns the description of a mesh in which cells of higher order have the caller's nodes, even if the session reads
 * finer lattices instead. */
static inline const insitu_mesh *session_get_mesh_of_caller_nodes(const session_mesh *mesh)
{
    return mesh->finer.parts ? &mesh->finer.nodal : &mesh->given;
}

/* Returns this rank's parts of the mesh with this name. */
session_parts session_find_parts(const session_meshes *meshes, const char *name);
/* Returns the parts that have the same name as the part at index `first`, which must be the first part with this
 * name. */
session_parts session_find_parts_from_index(const session_meshes *meshes, int first);
/* Returns the block with this number of the mesh with this name, or NULL if there is none. */
session_mesh *session_find_block(const session_meshes *meshes, const char *name, int64_t block);
/* Returns the mesh with this name that is not given as blocks, or NULL if there is none. */
static inline session_mesh *session_find_mesh(const session_meshes *meshes, const char *name)
{
    return session_find_block(meshes, name, SESSION_WHOLE);
}
/* Returns the index of the mesh's field with this name, or -1 if there is none. */
int session_find_field(const session_mesh *mesh, const char *name);

/* Adds a field without values. Its name is copied and must not exist yet. Returns NULL if memory runs out. */
session_field *session_add_field(session_mesh *mesh, const char *name);

/* Adds an empty mesh or block, which must not exist yet. Returns NULL if memory runs out. */
session_mesh *session_add_mesh(session_meshes *meshes, const char *name, int64_t block, base_error *error);
/* Adds an empty mirror image of the part `source`; a mirror image along the same axes must not exist yet. Returns NULL
 * if memory runs out. */
session_mesh *session_add_mirror_image(session_meshes *meshes, session_mesh *source, int mirror_axes,
                                       base_error *error);
/* Returns the mirror image of the part `source` along these axes, or NULL if there is none. */
session_mesh *session_find_mirror_image(const session_meshes *meshes, const session_mesh *source, int mirror_axes);
void session_remove_mirror_image(session_meshes *meshes, session_mesh *image);
/* Removes a block or, in session_remove_mesh(), a mesh with all its blocks. Mirror images are removed too. Does nothing
 * if the block or mesh does not exist. */
void session_remove_block(session_meshes *meshes, const char *name, int64_t block);
void session_remove_mesh(session_meshes *meshes, const char *name);

/* Frees the scalars of the mesh, which depend on the values of its fields. */
void session_drop_scalars(session_mesh *mesh);
/* Frees one scalar. The scalars after it move down by one index. */
void session_drop_scalar(session_mesh *mesh, int number);
void session_drop_gradients(session_scalar *scalar);
void session_drop_tree(session_mesh *mesh);
void session_drop_topology(session_topology *topology);
void session_drop_discontinuous(session_discontinuous *discontinuous);
void session_drop_piece_set(session_piece_set *set);
void session_drop_finer_lattices(session_finer *finer);
void session_drop_axes(session_lattice *lattice);
void session_drop_converted_arrays(session_conformed *conformed);
void session_drop_fields(session_mesh *mesh);
void session_drop_copy(session_field *field);
/* Frees the session's copies of the tables insitu_field.patches and insitu_field.components. */
void session_drop_field_tables(session_field *field);
/* Frees the data that depends on a mesh's cells, because the cells have changed. Fields are kept. */
void session_drop_cell_data(session_meshes *meshes, session_mesh *mesh);
/* Marks the coordinates of a mesh's vertices as changed. The cells' connectivity must be unchanged. */
void session_mark_moved(session_meshes *meshes, session_mesh *mesh);
/* Frees the moved coordinates, which must not be in use any more. */
void session_drop_moved_coordinates(session_mesh *mesh);
void session_drop_mirrored(session_mirrored *mirrored);
/* Removes the derived fields, and with them all scalars and thresholds, which refer to fields by index. */
void session_drop_derived_fields(session_mesh *mesh);
/* Frees the mesh that is built on the outer faces and, if with_faces, the list of these faces. The threshold is
 * kept. */
void session_drop_outer_surface(session_outer *outer, bool with_faces);
/* Frees the data of all outer surfaces of a mesh. are_cells_new: also frees the lists of outer faces, and removes the
 * outer surfaces with their thresholds. */
void session_drop_outer_surfaces(session_mesh *mesh, bool are_cells_new);
/* Frees all data of the mesh, including its fields; its names and its place in the table remain. */
void session_drop_contents(session_mesh *mesh);
/* Frees all data of a mesh whose description is wrong, except the names of its fields: images that show these fields
 * still refer to the mesh. */
void session_drop_data_of_invalid_mesh(session_mesh *mesh);
void session_meshes_free(session_meshes *meshes);

/* Iterator over the meshes of this rank that pictures may show: the caller's meshes, then the meshes built on their
 * outer faces.
 *
 *     for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) use(walk.part); */
typedef struct session_part_walk {
    const session_meshes *meshes;
    session_mesh *part;
    session_mesh *whole;  /* the mesh whose outer faces the part contains; NULL: the part is a mesh of the caller */
    session_outer *outer; /* the outer surface that the part belongs to; NULL: the part is a mesh of the caller */
    /* State of the iterator. mesh_index: index of the caller's mesh that is visited next; whole_index: index of the
     * mesh whose outer surfaces are visited; outer_index: index of the outer surface that is visited next. */
    int mesh_index, whole_index, outer_index;
} session_part_walk;

/* Advances to the next part. Returns false after the last one. */
bool session_next_part(session_part_walk *walk);

/* Returns the caller's part: for a mirror image the part that is mirrored, otherwise the part itself. */
static inline const session_mesh *session_find_source_part(const session_mesh *mesh)
{
    return mesh->source ? mesh->source : mesh;
}

/* Returns the number of cells that the caller gave. For a lattice, session_mesh.cells may have more cells, as
 * padding. */
static inline int64_t session_cell_count(const session_mesh *mesh)
{
    return mesh->cells.lattice ? mesh->lattice.cells.cell_count : mesh->given.cell_count;
}

static inline session_sizes session_get_bounds_and_counts(const session_mesh *mesh)
{
    const double *low = mesh->lower, *high = mesh->upper;
    return (session_sizes){
        {low[0], low[1], low[2]}, {high[0], high[1], high[2]}, mesh->drawn_count, mesh->flat_count, mesh->size_sum};
}

/* Returns the caller's cell that contains a cell of `cells`: that cell itself, unless cells are split into pieces. */
static inline int64_t session_caller_cell(const session_mesh *mesh, int64_t cell)
{
    return mesh->topology.is_split ? (int64_t)mesh->topology.parents[cell] : cell;
}

/* Returns the index, in session_mesh.cells, of the first piece of one of the caller's cells; if cells are not split,
 * this is the cell itself. The pieces of a cell are consecutive, and end before the first piece of the caller's next
 * cell. */
static inline int64_t session_first_piece(const session_mesh *mesh, int64_t cell)
{
    return mesh->topology.is_split ? mesh->topology.first_pieces[cell] : cell;
}

/* Returns the number of the caller's cells if they are split into pieces, and otherwise the number of cells in
 * session_mesh.cells. */
static inline int64_t session_count_whole_cells(const session_mesh *mesh)
{
    return mesh->topology.is_split ? mesh->given.cell_count : mesh->cells.cell_count;
}

/* Returns the number of vertices at which scalars have values. */
static inline int64_t session_vertex_count(const session_mesh *mesh)
{
    return mesh->discontinuous.is_active ? mesh->discontinuous.corner_count : mesh->cells.vertex_count;
}

/* Returns the first error of an insitu_set_*() call that no step has reported yet; NULL: there is none. */
const base_error *session_find_pending_error(const session_meshes *meshes);

/* Stores an error of an insitu_set_*() call that cannot be stored with a mesh. field: NULL if the error does not belong
 * to a single field. */
void session_store_pending(session_meshes *meshes, const base_error *error, const char *mesh, const char *field);
void session_drop_pending(session_meshes *meshes);

/* Stores an error of a field's values with the field for the rest of the step. Also copies the error to *first unless
 * *first already holds an error. */
void session_store_problem(session_field *field, const base_error *problem, base_error *first);

/* Removes a mesh from the first `count` items for the rest of the step, so that this rank acts as if it had no part of
 * the mesh. */
void session_exclude_mesh(session_meshes *meshes, session_mesh *mesh);
/* Undoes session_exclude_mesh() for all meshes that were excluded in the step. */
void session_restore_excluded(session_meshes *meshes);

/* Refuses a public call of the library that the caller's fill function makes, because the call would change data that
 * the step reads. call: name of the called function. Returns whether the call was refused; the error is stored in
 * filling.refused_error, and the step fails with it. Local. */
bool session_refuse_call_in_fill(session_meshes *meshes, const char *call);

/* Returns whether cells are described by the owners of their faces. */
static inline bool session_has_face_owners(const insitu_mesh *mesh)
{
    return mesh->owner.data || mesh->boundary_owner.data;
}

/* Returns whether the mesh is a block with cells and with a level of refinement. */
static inline bool session_has_refinement_level(const insitu_mesh *mesh)
{
    const insitu_lattice *l = mesh->lattice;
    return l && mesh->cell_count > 0 && (l->refinement[0] || l->refinement[1] || l->refinement[2]);
}

/* Returns the number of faces that the caller gave, including those of the separate list of boundary faces. The latter
 * have the highest indices. */
static inline int64_t session_face_count(const insitu_mesh *mesh)
{
    return mesh->face_count + mesh->boundary_face_count;
}

#endif
