/* libinsitu: pictures of a running simulation, from its own unstructured cells.
 *
 * Six calls: create a session from a scene file, hand over the mesh and the fields (borrowed, not copied), step,
 * step, ..., destroy. Every function returns an insitu_status; none aborts, exits or prints to stdout.
 *
 *     insitu_session *s = NULL;
 *     insitu_create(MPI_COMM_WORLD, "scene.yaml", &s);
 *     insitu_set_mesh(s, "domain", &mesh);
 *     insitu_set_field(s, "domain", &pressure);
 *     insitu_step(s, cycle, time);
 *     insitu_destroy(&s);
 *
 * Collective functions must be called by every rank of the communicator, in the same order. Local functions may
 * be called by any rank at any time. One session is used by one thread at a time.
 */
#ifndef INSITU_INSITU_H
#define INSITU_INSITU_H

/* MPI's C bindings suffice: the C++ ones of old would want a library of their own. This is too late where mpi.h was
 * included before. */
#ifndef OMPI_SKIP_MPICXX
#define OMPI_SKIP_MPICXX 1
#endif
#ifndef MPICH_SKIP_MPICXX
#define MPICH_SKIP_MPICXX 1
#endif
#include <mpi.h>
#include <stdint.h>

#include "insitu/status.h"

#ifdef __cplusplus
extern "C" {
#endif

#define INSITU_VERSION_MAJOR 0
#define INSITU_VERSION_MINOR 1
#define INSITU_VERSION_PATCH 0

/* The element type of a borrowed array. */
typedef enum insitu_type {
    INSITU_FLOAT32 = 1,
    INSITU_FLOAT64 = 2,
    INSITU_INT32 = 3,
    INSITU_INT64 = 4,
    INSITU_UINT8 = 5
} insitu_type;

/* A borrowed array: the caller's memory, read only, never written or kept beyond what insitu_set_mesh() says. */
typedef struct insitu_array {
    const void *data;     /* first element; NULL: the array is not given. Aligned to its element type. */
    insitu_type type;     /* of one element */
    int64_t stride_bytes; /* from one element to the next; 0: packed, the size of the type. Any multiple of the size. */
} insitu_array;

/* Cell types by VTK's ids, vertices in VTK's order, unless the mesh's vertex_order says otherwise. */
typedef enum insitu_cell_type {
    INSITU_TET = 10,        /* 4 vertices */
    INSITU_HEX = 12,        /* 8 vertices: the lower quad around, then the upper quad above it */
    INSITU_WEDGE = 13,      /* 6 vertices: one triangle, then the other; either winding */
    INSITU_PYRAMID = 14,    /* 5 vertices: the quad around, then the apex */
    INSITU_POLYHEDRON = 42, /* any number of faces of any number of vertices, convex or not: see insitu_mesh */
    /* Shells: cells of two dimensions, alone or among others. Layers of outer surfaces show them, one that lies on the
     * face of another cell in place of that face; isosurfaces, volumes, slices and statistics pass them over. Their
     * cells' values count like others at the vertices they share (insitu_centring). */
    INSITU_TRIANGLE = 5, /* 3 vertices */
    INSITU_POLYGON = 7,  /* 3 vertices or more, around it, told by offsets; best flat: drawn as triangles from the
                            vertex that is least by x, then y, then z */
    INSITU_QUAD = 9      /* 4 vertices around it; may be warped */
} insitu_cell_type;

/* In which order the vertices of a cell stand in connectivity. Types that are not named stand as in VTK in all of them.
 * Cells that are mirrored are drawn right in any of them. */
typedef enum insitu_vertex_order {
    INSITU_ORDER_VTK = 0,           /* as said at insitu_cell_type; also that of CGNS, Exodus II, Gmsh, libMesh, MFEM */
    INSITU_ORDER_LEXICOGRAPHIC = 1, /* quads, hexes and bases of pyramids by x first, then y, then z: a quad is VTK's 0
                                       1 3 2. That of deal.II, dolfinx, DUNE and p4est. */
    INSITU_ORDER_DMPLEX = 2         /* hexes are VTK's 0 3 2 1 4 5 6 7 and wedges VTK's 0 2 1 3 4 5: their two ends run
                                       opposite ways. That of PETSc's DMPlex. */
} insitu_vertex_order;

/* The parts of a mesh or a field that differ from the last time it was set. The safe default is everything. Whatever is
 * said, what the description alone tells counts too: other counts or another cell_type are another mesh (ALL); arrays
 * at other addresses, of other types or strides are looked at again, as TOPOLOGY (but fields stay), GEOMETRY
 * (vertex_ids too) or VALUES. What was written into the same arrays only the caller knows. */
enum {
    INSITU_CHANGED_NOTHING = 0,
    INSITU_CHANGED_TOPOLOGY = 1, /* cells, their types and faces, ghost flags: the tree is built again */
    INSITU_CHANGED_GEOMETRY = 2, /* coordinates: the tree's bounds are refitted */
    INSITU_CHANGED_VALUES = 4,   /* a field's values: the tree's ranges are refitted, if they did change */
    INSITU_CHANGED_ALL = 7
};

/* One rank's part of a mesh. All arrays are borrowed until the next insitu_step() returns or the mesh is set
 * again under the same name, whichever is later: they must stay valid while a step may read them, and a step
 * reads the values they hold then. Fill with insitu_mesh_defaults() first. */
typedef struct insitu_mesh {
    int64_t vertex_count;        /* >= 0 */
    insitu_array coordinates[3]; /* x, y, z: float32 or float64, vertex_count each; of drawn cells at most 1e100 in
                                    size. Interleaved xyz is three arrays of stride 3 elements: see
                                    insitu_mesh_interleaved(). */
    insitu_array vertex_ids;     /* optional, int32 or int64: ids unique over all ranks, to match the vertices that
                                    ranks share; not given: vertices match by bitwise equal coordinates */
    int64_t cell_count;          /* >= 0; at most 4294967294 */
    insitu_cell_type cell_type;  /* of every cell, where cell_types is not given */
    insitu_array cell_types;     /* optional, uint8, int32 or int64, cell_count: VTK's ids, for mixed cells */
    int64_t connectivity_count;  /* elements in connectivity */
    insitu_array connectivity;   /* int32 or int64, connectivity_count: the cells' vertex indices from index_base,
                                    one cell after the other */
    insitu_array offsets;        /* int32 or int64, cell_count + 1: where each cell begins in connectivity, the last
                                    is connectivity_count. Not needed where all cells are of one type that is
                                    neither INSITU_POLYHEDRON nor INSITU_POLYGON. */
    /* Faces of polyhedra: given where there are any. A polyhedron's entries in connectivity are its faces' indices from
     * index_base, at least 4, in any order; a face between two polyhedra is the same one in both. The faces of a cell
     * must make a closed surface: along every edge two of them meet, once each (an edge from a vertex to itself is
     * none, so a face may repeat a vertex beside itself, or be one vertex). Which way round a face runs is nothing. No
     * copy of them is kept but what is said at owner, face_lists and keep_polyhedra: a frame holds those under way
     * alone, about 200 bytes a vertex of each, 16 MiB a thread at most. */
    int64_t face_count;
    insitu_array face_offsets;       /* int32 or int64, face_count + 1: where each face begins in face_connectivity */
    int64_t face_connectivity_count; /* elements in face_connectivity */
    insitu_array face_connectivity;  /* int32 or int64, face_connectivity_count: the faces' vertex indices from
                                        index_base, at least 3 a face, around it in either direction, beginning
                                        anywhere */
    insitu_array ghosts;             /* optional, uint8, cell_count: cells with a nonzero flag are not drawn */
    unsigned changed;                /* INSITU_CHANGED_* bits of TOPOLOGY and GEOMETRY; ALL by default */
    int index_base;                  /* 0 by default, or 1, as Fortran counts: what the first vertex, face, cell and
                                        element are called in connectivity, offsets, face_offsets, face_connectivity,
                                        face_lists, owner and neighbour */
    /* Instead of connectivity, offsets and cell_types (not given then), cell_type being INSITU_POLYHEDRON: each face's
     * cells, as codes of finite volumes have them (docs/finite_volume.md). The faces' vertices stay where they are; the
     * library makes, once for each topology, the faces of each cell, in the order of their numbers: 4 bytes a cell and
     * up to 8 a face (twice that where there are more than 2^31 of them), in bytes_copied. */
    insitu_array owner;      /* int32 or int64, face_count: the cell on one side of each face. Where index_base is 1 it
                                may be 0 beside a neighbour, as in CGNS: the neighbour is the face's only cell. */
    int64_t neighbour_count; /* elements in neighbour; at most face_count */
    insitu_array neighbour;  /* int32 or int64, neighbour_count: the cell on the other side of each face, another than
                                the owner. Faces on the boundary have -1, or 0 where index_base is 1, or are the last
                                ones, beyond neighbour_count; so have those to cells of other ranks. */
    /* Instead of face_offsets and face_connectivity (not given then): a list of vertices for each face. They are copied
     * into one array, once for each topology, and held as long as polyhedra are drawn by them: 4 bytes a face and 4 a
     * vertex of each, in bytes_copied. */
    insitu_array face_sizes; /* int32 or int64, face_count: how many vertices each face has */
    insitu_array face_lists; /* face_count pointers, each to so many vertex indices, packed, of the type given here:
                                int32 or int64. stride_bytes is from pointer to pointer; 0: packed */
    /* A polyhedron whose faces make a tet, hex, wedge or pyramid is drawn as that, whichever way its faces run; 1
     * leaves it as it is. Told in cells_recognised. What is seen differs inside of such cells alone: the field is
     * trilinear in a hex, and linear on tets about its centre in the polyhedron. Faces of four vertices are bilinear
     * patches in both, warped or not, so that no seam is left beside true polyhedra. A hex that is folded, or of which
     * a corner is pushed in, is better left. Held, in bytes_copied: 32 bytes a hex, 4 a face of each polyhedron that
     * stays, and, unless all cells are of one type, 5 a cell; twice as much where there are more than 2^31 vertices or
     * faces. */
    int keep_polyhedra; /* 0 by default, or 1 */
    /* How connectivity has the vertices of cells; polyhedra and polygons are as they are. Cells in another order than
     * VTK's that are not the same in both, and cells in rows, are copied, once for each topology: 4 bytes for each
     * entry of connectivity that cells use (8 where there are more than 2^31 vertices), in bytes_copied. */
    insitu_vertex_order vertex_order; /* INSITU_ORDER_VTK by default */
    int64_t connectivity_row; /* of cells of one type without offsets: entries of connectivity from the first vertex of
                                 a cell to that of the next, at least as many as its vertices. So the vertices are taken
                                 from the nodes of higher order, where they are the first of each row.
                                 connectivity_count counts the others too; it may end with the last cell's vertices. 0:
                                 one cell after the other. */
} insitu_mesh;

/* Whether a field has one value a vertex, one a cell, or one at each corner of each cell. Of cells, volumes and colours
 * show each value as it is, unless the scene says `interpolate: vertex`; then, and for isosurfaces, a vertex gets the
 * mean of its cells on all ranks, ghosts left out. On the boundary it gets the mean of the boundary's own values
 * instead, where the field has such (insitu_patch).
 *
 * Corners are for fields that differ from cell to cell at the vertex they share, as those of discontinuous Galerkin
 * methods: there is one for each entry of connectivity that is a vertex of a cell, in the order of the caller's
 * connectivity (see corner_row). They are drawn torn: each cell shows its own values, so that an isosurface may have a
 * step between two cells. Where the scene says `interpolate: vertex`, each vertex gets the mean of its corners on all
 * ranks, ghosts left out. Polyhedra, whose connectivity has faces, have no corners: a mesh with any is an error.
 *
 * A mesh is torn as long as the scene names a corner field of it, for all that is drawn of it: each corner is a vertex
 * of its own then. In bytes_copied: coordinates, 12 or 24 bytes a corner, and 4 bytes a corner of indices (8 where
 * there are more than 2^31); fields at vertices that are drawn, a tuple a corner. Values at corners are read where
 * they are. */
typedef enum insitu_centring { INSITU_VERTEX = 0, INSITU_CELL = 1, INSITU_CORNER = 2 } insitu_centring;

/* Values that a field of cells has on faces of the boundary, as codes of finite volumes hold them for each patch.
 *
 * Where cells' values are taken to the vertices, a vertex of such a face gets the mean of the values of all its faces
 * that have one, of all patches and on all ranks, in place of the mean of its cells: so a wall at which the flow rests
 * is drawn at rest. Along an edge where patches meet both count, by their faces there. The same bits on any partition.
 * Amid a flat wall of equal faces a field that is linear in space is exact, up to rounding; at edges and corners of the
 * domain no mean is, for they lie beyond all faces' centres. Values that are not finite and faces of ghost cells do not
 * count. Pictures that show cells' values as they are do not use patches.
 *
 * The faces are those between a cell and the outside. Faces between ranks, and others that are coupled in pairs, have
 * cells on both sides and are left out. Faces are told in one of three ways; a face that two cells of this rank share,
 * that no cell has, or that is given twice is an error, told on all ranks by the step that needs the values. Faces told
 * by their vertices may be given once for each of two cells, as the two sides of a baffle or a crack are, and then must
 * be given for both, where one rank has both. */
typedef struct insitu_patch {
    int64_t count;      /* faces, and tuples of values */
    int64_t first_face; /* where neither of the next two is given: the faces of the mesh that follow one another from
                           this one on; its first face is index_base */
    insitu_array faces; /* int32 or int64, count: the faces' numbers in face_offsets or face_lists, from index_base */
    /* For meshes whose cells have no faces given, as hexes, but of use with any: the faces' vertices. */
    int64_t connectivity_count; /* elements in connectivity */
    insitu_array connectivity;  /* int32 or int64, connectivity_count: vertex indices from index_base, around each face
                                   in either direction, as many as the cell's face has, repeated ones too */
    insitu_array offsets; /* int32 or int64, count + 1, from index_base: where each face begins in connectivity. Not
                             needed where all have as many vertices: connectivity_count / count. */
    insitu_array values;  /* float32, float64, int32 or int64, count tuples of the field's component_count. stride_bytes
                             is from tuple to tuple; 0: component_count elements */
    int64_t component_stride_bytes; /* from one component to the next; 0: packed, interleaved */
} insitu_patch;

struct insitu_field;

/* Gives the values of a field in the steps that need them: field is as it was set, to be completed by values, and what
 * belongs to them (count, component_stride_bytes, index, corner_row, patches, changed); its name, centring and
 * component_count stay. Called within insitu_step(), by the thread that called that, at most once a step, where a
 * picture, a statistic or a condition of this step needs the field; never elsewhere. The arrays are borrowed until the
 * step has returned. All ranks call the fills of their fields in the same order, by the names of meshes and then of
 * fields: where all ranks set the field with a fill, it may communicate, on a communicator of the caller's; it must
 * not call the session. Any other status than INSITU_OK is an error of the step, told on all ranks; the other fills
 * are called all the same. */
typedef insitu_status insitu_fill(void *fill_data, struct insitu_field *field);

/* One rank's part of a field. Borrowed as a mesh is. Fill with insitu_field_defaults() first. */
typedef struct insitu_field {
    const char *name;               /* copied; the name by which scenes ask for it */
    insitu_centring centring;       /* vertex by default */
    int64_t count;                  /* tuples: the mesh's vertex_count or cell_count, or the number of its cells'
                                       corners; any number where index is given */
    int component_count;            /* >= 1; 1 by default. The scene picks one, or the magnitude. */
    int64_t component_stride_bytes; /* from one component to the next; 0: packed, interleaved */
    insitu_array values;            /* float32, float64, int32 or int64. stride_bytes is from tuple to tuple; 0:
                                       component_count elements */
    unsigned changed;               /* INSITU_CHANGED_VALUES or NOTHING; ALL by default */
    /* Optional, int32 or int64, vertex_count, cell_count or the number of corners: which tuple of values each vertex,
     * cell or corner has, from the mesh's index_base on, as in vectors of degrees of freedom and arrays with halos.
     * Fields that the scene asks for are copied in the order of the vertices, cells or corners when a step first needs
     * them, and again when their values changed: one tuple each, in bytes_copied. Entries of index out of range are
     * told then. Where there are no vertices, cells or corners its data may be NULL; its type tells that it is
     * given. */
    insitu_array index;
    /* Of corners, where cells are of one type without offsets: tuples of values, or entries of index where that is
     * given, from the first corner of a cell to that of the next, at least as many as its vertices; further ones, those
     * of degrees of freedom within edges, faces and cells, are passed over. Values in such rows are copied, as by
     * index. 0: one cell after the other, as many as a cell has vertices. Cells with offsets have their corners where
     * connectivity has its entries: connectivity_count of them, and 0 here. */
    int64_t corner_row;
    /* Optional, instead of values, which are not given then: what makes them, when a step needs them. Each call may
     * give other values, unless it sets changed to INSITU_CHANGED_NOTHING. */
    insitu_fill *fill;
    void *fill_data; /* handed to fill as it is */
    /* Optional, of cells: the field's values on the boundary. The table is copied, its arrays are borrowed. */
    int patch_count;
    const insitu_patch *patches;
} insitu_field;

/* Report of the last step, of this rank unless said otherwise. Times are wall-clock milliseconds. */
typedef struct insitu_report {
    int64_t cycle;
    double time;
    int images;             /* drawn in this step; 0 when none was due */
    double total_ms;        /* the whole insitu_step() */
    double prepare_ms;      /* agreeing, validating, bounds, recentring */
    double build_ms;        /* trees built */
    double refit_ms;        /* trees refitted */
    double surface_ms;      /* isosurfaces traced */
    double volume_ms;       /* volumes traced */
    double composite_ms;    /* fragments exchanged, merged and gathered, waiting included; alone: the slowest
                               thread's */
    double write_ms;        /* on rank 0: pictures written in the step, or given to the thread that writes them, waiting
                               until there is room included */
    double background_ms;   /* on rank 0: that thread's, for pictures that it finished since the last step */
    int pictures_waiting;   /* on rank 0: given to it and not yet written when the step ended */
    int64_t cells;          /* handed over, ghosts included */
    int64_t cells_ghost;    /* not drawn: flagged as ghosts */
    int64_t cells_unusable; /* not drawn: a field value, its own or a vertex's, that is not finite */
    int64_t cells_inverted; /* drawn right all the same: left-handed, by the sign of the corner volumes' sum */
    int64_t cells_flat; /* of no volume, not drawn: the corner volumes, each without its sign, sum to nothing beside the
                           cell's box (at most 1.4e-14, rounding); polyhedra where all of one is in a plane. */
    int64_t cells_shell;      /* triangles, quads and polygons, which layers of outer surfaces show */
    int64_t cells_recognised; /* polyhedra drawn as the tets, hexes, wedges or pyramids that their faces make */
    int64_t rays;             /* primary rays traced */
    int64_t fragments;        /* sent to pixel owners, own ones included */
    int64_t bytes_sent;       /* by this rank to others, for pictures: fragments and finished pixels, what it passed on
                                 included; not the rays of shadows */
    int64_t map_failures;     /* inverse maps that did not converge and fell back to linear interpolation */
    int64_t bytes_borrowed;   /* of the caller's arrays in use */
    int64_t bytes_copied;     /* of the caller's data held in copies, with reasons in copied_why */
    int64_t bytes_trees;      /* of all trees held */
    int64_t bytes_pictures;   /* on rank 0: of pictures that wait to be written, at most 128 MiB or one, and kept for
                                 those to come, at most 64 MiB */
    int64_t bytes_peak;       /* most bytes the library held at once in this step */
    const char *schedule;   /* "" where none was sent, else by which ranks fragments went, as the scene's key names it:
                               "direct", "nodes", "radix" or "binary"; of the last frame */
    const char *copied_why; /* "" or a list of what was copied and why; valid until the next step */
    const char *left_out;   /* "" or a list of what the scene does not need and was not computed; as above */
    const char *warnings; /* "" or one warning a line; as above. Told where it begins to be true, and again when it has
                             ceased to be in between; but the scene file's broken edit, and counts of this rank's
                             cells with values that are not finite, at every step. Others than these are the same on
                             every rank. */
} insitu_report;

/* An open session: its scene, what was handed over, and what is kept from step to step. */
typedef struct insitu_session insitu_session;

/* A picture in memory, as the last step drew it: without decorations, its background behind it. */
typedef struct insitu_picture {
    const char *image; /* its name in the scene */
    int width;         /* pixels */
    int height;
    const float *rgba;  /* height x width x 4, row-major, the top row first: linear light, premultiplied by opacity */
    const float *depth; /* height x width: distance along the camera's axis from the eye to the nearest opaque surface,
                           as in EXR files; infinite where there is none */
} insitu_picture;

/* Fill in defaults: nothing given, everything changed. Local. */
INSITU_API void insitu_mesh_defaults(insitu_mesh *mesh);
INSITU_API void insitu_field_defaults(insitu_field *field);

/* Set mesh->coordinates for interleaved x y z (row-major, vertices × 3), packed. type is INSITU_FLOAT32 or
 * INSITU_FLOAT64. Local. */
INSITU_API void insitu_mesh_interleaved(insitu_mesh *mesh, const void *xyz, insitu_type type);

/* Open a session. Collective over comm, which is duplicated; its error handler is left alone. scene_file, a regular
 * file, is read on rank 0 only, and read again when it changes on disk. On an error *out is NULL on every rank, and the
 * message is insitu_error(NULL). MPI must be initialized; MPI_THREAD_SINGLE or FUNNELED suffices. */
INSITU_API insitu_status insitu_create(MPI_Comm comm, const char *scene_file, insitu_session **out);

/* Open a session by a scene given as text: YAML, as a scene file has it, ended by a zero. Collective, and as
 * insitu_create() in all else. Rank 0's text counts, the others may give NULL; it is not needed when the call has
 * returned. Messages call it "scene text:line". Files that it names are relative to rank 0's working directory. */
INSITU_API insitu_status insitu_create_from_text(MPI_Comm comm, const char *scene_text, insitu_session **out);

/* insitu_create(), or insitu_create_from_text() where is_text is not 0, by a communicator as Fortran has it: what the
 * Fortran module calls (docs/fortran.md). Collective. */
INSITU_API insitu_status insitu_create_fortran(MPI_Fint comm, const char *scene, int is_text, insitu_session **out);

/* Hand over this rank's part of the mesh called name: borrowed arrays. Local. Ranks that have no part of it need not
 * call it; meshes of different names are drawn together, a layer of the scene on those that have its field, or that it
 * names. A mesh with INSITU_CHANGED_TOPOLOGY, or of other counts, drops the fields set on it before. NULL for mesh
 * takes it away. A mesh that is not set again is taken as unchanged.
 *
 * What can be seen at once (counts, types, strides) is checked here; the arrays' contents when a step first needs
 * them: every cell's vertex indices and type, and the coordinates that cells without a ghost flag use. Either way the
 * next insitu_step() that draws returns the error on every rank, and so does each one after it until the mesh is set
 * right or taken away; a set call that failed is told by the very next insitu_step(). */
INSITU_API insitu_status insitu_set_mesh(insitu_session *session, const char *name, const insitu_mesh *mesh);

/* Hand over this rank's part of a field on the mesh called mesh, which must be set. Local. A field that is not set
 * again is taken as unchanged. Values that are NaN or infinite are no error: cells that have one are not drawn, and
 * counted in the report. */
INSITU_API insitu_status insitu_set_field(insitu_session *session, const char *mesh, const insitu_field *field);

/* Draw what is due at this cycle and time. Collective. Where nothing is due it costs one small reduction. An error
 * on any rank is returned on every rank, with the rank and the place in the message; images that could be drawn
 * are drawn, and the session stays usable: the simulation goes on.
 *
 * Pictures are written by a thread of rank 0 while the simulation goes on, unless the scene says `writing: step`. One
 * that could not be written is an error of the next step that has nothing else to tell. The thread calls no MPI.
 *
 * A step that draws works on threads of OpenMP's, as many as the scene asks for, there are cores for, and can be
 * started; within a parallel region of the caller's, on the calling thread alone. That one needs 320 kB of stack, the
 * others 256 kB (OMP_STACKSIZE); less is an error. Traps and rounding modes of the caller's are off meanwhile, on all
 * of them, here and in insitu_create(). */
INSITU_API insitu_status insitu_step(insitu_session *session, int64_t cycle, double time);

/* The report of the last step. Local. Valid until the next step; all zero before the first; NULL for a NULL session. */
INSITU_API const insitu_report *insitu_last_report(const insitu_session *session);

/* From now on keep (keep is not 0), or no longer keep, each step's pictures in memory on rank 0: 20 bytes a pixel of
 * every image drawn in a step, beside the files that the scene asks for. Off at first. Collective; rank 0's keep
 * counts. */
INSITU_API insitu_status insitu_keep_pictures(insitu_session *session, int keep);

/* The pictures that the last step drew, *count of them, in the order of the scene, and those of one image by the fields
 * and isovalues of its sweep and then the views of its orbit; all of them have the image's name. An image that could
 * not be drawn is left out, one whose file could not be written is there. The session owns them, and they are valid
 * until the next step, insitu_keep_pictures() or insitu_destroy(). NULL and 0 where there are none: on other ranks than
 * 0, where nothing was due, or where they are not kept. Local. */
INSITU_API const insitu_picture *insitu_last_pictures(const insitu_session *session, int *count);

/* The message of the last call on the session that failed, "" if none did. Local. Valid until the next call on the
 * session. NULL: the message of the last insitu_create(), insitu_create_from_text() or insitu_destroy() of this
 * thread that failed. */
INSITU_API const char *insitu_error(const insitu_session *session);

/* Close a session and set *session to NULL. Collective. NULL, or a pointer to NULL, is fine. Pictures that wait are
 * written first; one that could not be is an error, if no step has told it, and the session is closed all the same. A
 * run that ends without it has its pictures written in MPI_Finalize(), or as the process exits; it is told nothing. */
INSITU_API insitu_status insitu_destroy(insitu_session **session);

/* The name of a status, as in "INSITU_ERROR_MESH". Local. */
INSITU_API const char *insitu_status_name(insitu_status status);

#ifdef __cplusplus
}
#endif

#endif
