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

/* Only MPI's C bindings are used, because the old C++ bindings would require linking one more library. These macros
 * have no effect if mpi.h was included before. */
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
    INSITU_UINT8 = 5,
    INSITU_INT8 = 6,
    INSITU_INT16 = 7,
    INSITU_UINT16 = 8,
    INSITU_UINT32 = 9,
    INSITU_UINT64 = 10
} insitu_type;

/* A borrowed array: the caller's memory, read only, never written or kept beyond what insitu_set_mesh() says.
 *
 * "Any integers" are all integer types of insitu_type. Coordinates, arrays of any integers and values of fields may
 * also lie at any address and have any stride, as in packed records; other arrays and their strides are aligned to
 * their element type. Values are always read where they are. So are other arrays that are aligned: coordinates that are
 * float32 or float64, and indices, offsets and numbers of 4 or 8 bytes, unsigned ones as if they were signed: they must
 * be below 2^31 or 2^63, but uint32 may be larger where there are 2^31 vertices or faces. Others are copied once for
 * each topology or geometry, counted in bytes_copied: coordinates that are integers as float64, integers of 1 or 2
 * bytes as int32, arrays that are not aligned in their own type. */
typedef struct insitu_array {
    const void *data;     /* first element; NULL: the array is not given */
    insitu_type type;     /* type of one element */
    int64_t stride_bytes; /* from one element to the next; 0: packed, the size of the type. A negative one reads
                             backwards from data. A stride by which the elements would span more than 2^48 bytes is an
                             error. */
} insitu_array;

/* Cell types by VTK's ids, vertices in VTK's order, unless the mesh's vertex_order says otherwise. */
typedef enum insitu_cell_type {
    INSITU_TET = 10,        /* 4 vertices */
    INSITU_HEX = 12,        /* 8 vertices: the lower quad in cyclic order, then the upper quad above it */
    INSITU_WEDGE = 13,      /* 6 vertices: one triangle, then the other; in either orientation */
    INSITU_PYRAMID = 14,    /* 5 vertices: the quad in cyclic order, then the apex */
    INSITU_POLYHEDRON = 42, /* any number of faces of any number of vertices, convex or not: see insitu_mesh */
    /* Shells: cells of two dimensions, alone or among others. Layers of outer surfaces show them; a shell that lies on
     * the face of another cell is shown instead of that face. An isosurface on a mesh of shells alone is its contour
     * lines; beside cells with a volume isosurfaces pass shells over, and volumes and slices always do. Statistics
     * weigh them by their area where a field is on shells alone, and else pass them over. When cell values are averaged
     * at a vertex (insitu_centring), those of shells count too. */
    INSITU_TRIANGLE = 5, /* 3 vertices */
    INSITU_POLYGON = 7,  /* 3 vertices or more around it; offsets tell how many. It is drawn as triangles, which
                            cover it once, convex or not; it should be flat. */
    INSITU_QUAD = 9      /* 4 vertices around it; may be warped; a concave quad is two triangles */
} insitu_cell_type;

/* The order of a cell's vertices in connectivity. Cell types that an order does not mention are in VTK's order.
 * Mirrored cells are drawn correctly in any order. */
typedef enum insitu_vertex_order {
    INSITU_ORDER_VTK = 0,           /* as described at insitu_cell_type; also in CGNS, Exodus II, Gmsh, libMesh, MFEM */
    INSITU_ORDER_LEXICOGRAPHIC = 1, /* quads, hexes and bases of pyramids by x first, then y, then z: a quad is VTK's 0
                                       1 3 2. deal.II, dolfinx, DUNE and p4est have it. */
    /* hexes are VTK's 0 3 2 1 4 5 6 7 and wedges VTK's 0 2 1 3 4 5: their two ends have opposite orientations. PETSc's
     * DMPlex uses it. */
    INSITU_ORDER_DMPLEX = 2
} insitu_vertex_order;

/* The parts of a mesh or a field that have changed since it was last set. The safe default is everything. Changes that
 * are visible in the description count even if they are not named here: other counts or another cell_type make another
 * mesh (ALL); arrays at other addresses, of other types or strides are read again, as TOPOLOGY (but fields are kept),
 * GEOMETRY (vertex_ids too) or VALUES. Only the caller can tell whether the same arrays have new contents, and must
 * name such changes. */
enum {
    INSITU_CHANGED_NOTHING = 0,
    INSITU_CHANGED_TOPOLOGY = 1, /* cells, their types and faces, ghost flags; the tree is built again */
    INSITU_CHANGED_GEOMETRY = 2, /* coordinates; the tree's bounds are refitted */
    INSITU_CHANGED_VALUES = 4,   /* a field's values; the tree's ranges are refitted if values did change */
    INSITU_CHANGED_ALL = 7
};

/* A structured block: its cells are found by three indices i, j, k instead of connectivity. Vertex and cell arrays are
 * read as they are, in C's or Fortran's order, padded or with ghost layers. Cells are hexes, or quads where one of
 * cells is 0. The coordinates are either uniform (spacing), rectilinear (axes) or given for each vertex in the mesh's
 * coordinates, which are not given otherwise. docs/structured.md has examples. */
typedef struct insitu_lattice {
    /* number of cells along i, j and k, at least 1 each; one of them 0: quads. All 0 on a rank without cells. */
    int64_t cells[3];
    /* How far, in vertices, the vertices' arrays are from one vertex to the next along i, j and k, at least 1 each: the
     * vertex i, j, k has the number i * vertex_strides[0] + j * vertex_strides[1] + k * vertex_strides[2]. Each larger
     * stride spans all that the smaller ones reach, so that no two vertices have one number. All 0: packed with i
     * fastest, as in Fortran's x(i, j, k) and C's x[k][j][i]. */
    int64_t vertex_strides[3];
    int64_t cell_strides[3]; /* same as vertex_strides, in cells, for the cells' arrays */
    /* Ghost layers: the cells with indices from interior_first to interior_end - 1 are drawn, those outside of it count
     * as ghosts. All 0: all cells are drawn. */
    int64_t interior_first[3], interior_end[3];
    /* Uniform: vertex n along an axis is at origin + spacing * (first + n), in double. first is the place of the
     * block's first vertex in the whole lattice, so that blocks of one lattice have the same origin and spacing and
     * their common vertices the same coordinates, to the bit. That is how vertices of several blocks and ranks are
     * found to be one. spacing is not 0 along the axes that have cells; all 0: the lattice is not uniform. first is at
     * most 2^53 in size. */
    double origin[3], spacing[3];
    int64_t first[3];
    /* Rectilinear: cells[a] + 1 coordinates along each axis, float32, float64 or any integers; not given where the
     * lattice is uniform. A lattice of quads may lack those of the axis without cells; its coordinate is 0 then. */
    insitu_array axes[3];
    /* Levels of refinement: how many of the block's cells make one of the coarsest level along each axis, as 1, 2 or 8;
     * at most 2^20, and not read along an axis without cells. All 0: the mesh has no levels. first then says where the
     * block's first cell is among all that its level may have; it is at most 2^40 in size. A cell over which the inner
     * cells of a finer block of the mesh lie, on any rank, is not drawn; finer blocks begin and end at borders of
     * coarser cells. A vertex that lies on a coarser cell's face or edge gets the value that is interpolated there,
     * also where values are given at vertices. */
    int64_t refinement[3];
} insitu_lattice;

/* One rank's part of a mesh. All arrays are borrowed until the next insitu_step() returns or the mesh is set again
 * under the same name, whichever is later. They must stay valid that long, and a step reads the values that they hold
 * when it is called. Fill with insitu_mesh_defaults() first. */
typedef struct insitu_mesh {
    int64_t vertex_count;        /* >= 0 */
    insitu_array coordinates[3]; /* x, y, z: float32, float64 or any integers, vertex_count each; drawn cells' are at
                                    most 1e100 in size. Interleaved xyz is three arrays of stride 3 elements: see
                                    insitu_mesh_interleaved(). Meshes of triangles, quads and polygons may go without
                                    z (no data in coordinates[2]): then it is 0 everywhere. */
    insitu_array vertex_ids;     /* optional, int32 or int64, vertex_count: ids unique over all ranks, by which the
                                    vertices that ranks share are matched. Without them, vertices of bitwise equal
                                    coordinates match. */
    int64_t cell_count;          /* >= 0; at most 4294967294 */
    insitu_cell_type cell_type;  /* type of all cells, where cell_types is not given */
    insitu_array cell_types;     /* optional, any integers, cell_count: VTK's ids, for mixed cells; or numbers of the
                                    code's own: see cell_type_map */
    int64_t connectivity_count;  /* elements in connectivity */
    insitu_array connectivity;   /* any integers, connectivity_count: the cells' vertex indices from index_base, one
                                    cell after the other */
    insitu_array offsets;        /* any integers, cell_count + 1: where each cell begins in connectivity; the last
                                    entry is connectivity_count, and is missing where open_offsets is 1. Not needed
                                    where all cells are of one type that is neither INSITU_POLYHEDRON nor
                                    INSITU_POLYGON. */
    /* Faces, needed where there are polyhedra. A polyhedron's entries in connectivity are the indices of its faces,
     * counted from index_base, at least 4, in any order; two polyhedra that share a face name the same one. The faces
     * of a cell must make a closed surface: exactly two of them meet along every edge, once each. (An edge from a
     * vertex to itself does not count, so a face may repeat a vertex in succession, or be a single vertex.) A face may
     * run either way round. Faces are not copied, except as said at insitu_array, owner, face_lists and keep_polyhedra;
     * a frame holds only the polyhedra it works on, about 200 bytes a vertex of each, 16 MiB a thread at most. */
    int64_t face_count;
    insitu_array face_offsets;       /* any integers, face_count + 1: where each face begins in face_connectivity; the
                                        last entry is missing where open_offsets is 1 */
    int64_t face_connectivity_count; /* elements in face_connectivity */
    insitu_array face_connectivity;  /* any integers, face_connectivity_count: the faces' vertex indices from
                                        index_base, at least 3 a face, around it from any vertex in either direction */
    insitu_array ghosts;             /* optional, any integers, cell_count: cells with a nonzero flag are not drawn.
                                        Flags of 2 bytes, and those that are not aligned, are copied, 1 byte each. */
    unsigned changed;                /* INSITU_CHANGED_* bits of TOPOLOGY and GEOMETRY; ALL by default */
    int index_base;                  /* 0 by default, or 1, as Fortran counts: the index of the first vertex, face, cell
                                        and element in connectivity, offsets, face_offsets, face_connectivity,
                                        face_lists, owner and neighbour */
    /* Finite-volume codes may give the two cells of each face (docs/finite_volume.md) instead of connectivity, offsets
     * and cell_types, which are not given then; cell_type is INSITU_POLYHEDRON. The faces' vertices stay where they
     * are. Once for each topology the library lists the faces of each cell, in the order of their numbers: 4 bytes a
     * cell and up to 8 a face (twice that where there are more than 2^31 of them), counted in bytes_copied. */
    insitu_array owner;      /* int32 or int64, face_count: the cell on one side of each face. Where index_base is 1 it
                                may be 0, as in CGNS: then the neighbour is the face's only cell. */
    int64_t neighbour_count; /* elements in neighbour; at most face_count */
    insitu_array neighbour;  /* int32 or int64, neighbour_count: the cell on the other side of each face, never the
                                owner. Faces on the boundary, and those to cells of other ranks, have -1 here (or 0
                                where index_base is 1), or come last, beyond neighbour_count. */
    /* Each face may have a list of vertices of its own instead of face_offsets and face_connectivity, which are not
     * given then. The lists are copied into one array, once for each topology, and held as long as polyhedra are drawn
     * from them: 4 bytes a face and 4 for each of its vertices, counted in bytes_copied. */
    insitu_array face_sizes; /* int32 or int64, face_count: number of vertices of each face */
    insitu_array face_lists; /* face_count pointers, each to face_sizes vertex indices, packed, of the type given here:
                                int32 or int64. stride_bytes is from pointer to pointer; 0: packed */
    /* A polyhedron whose faces make a tet, hex, wedge or pyramid is drawn as that type, whichever way its faces run,
     * unless this is 1. The report counts them in cells_recognised. The picture differs only inside such cells: the
     * field is trilinear in a hex, but linear on tets about its centre in a polyhedron. Faces of four vertices are
     * bilinear patches in both, so no seam is left beside other polyhedra. Set 1 for hexes that are folded or have a
     * corner pushed in. Memory, counted in bytes_copied: 32 bytes a hex, 4 a face of each polyhedron that stays one,
     * and, unless all cells are of one type, 5 a cell; twice that beyond 2^31 vertices or faces. */
    int keep_polyhedra; /* 0 by default, or 1 */
    /* The order of each cell's vertices in connectivity; it does not concern polyhedra and polygons. Cells whose order
     * differs from VTK's, and cells in rows, are copied once for each topology: 4 bytes for each entry of connectivity
     * that cells use (8 where there are more than 2^31 vertices), counted in bytes_copied. */
    insitu_vertex_order vertex_order; /* INSITU_ORDER_VTK by default */
    int64_t connectivity_row; /* for cells of one type without offsets: entries of connectivity from the first vertex of
                                 a cell to that of the next, at least as many as its vertices; 0: one cell after the
                                 other. So cells of higher order can be given whose vertices are the first nodes of each
                                 row. connectivity_count counts the other nodes too, but those of the last cell may be
                                 missing. */
    /* Optional, instead of connectivity, offsets, cell_types and faces, which are not given then; cell_type is not
     * read. vertex_count and cell_count are the lengths of the vertices' and the cells' arrays, padding included. The
     * description is copied, the axes are borrowed. Nothing is held for each cell or vertex. */
    const insitu_lattice *lattice;
    /* Codes that hold the faces of the boundary in a list of their own, as code_saturne does, give it beside owner and
     * neighbour. Its faces are numbered on from face_count, in patches too. Both lists are copied into one, once for
     * each topology, and held as long as polyhedra are drawn from them, as at face_lists. Not with face_lists. */
    int64_t boundary_face_count;              /* 0 by default */
    insitu_array boundary_face_offsets;       /* int32 or int64, boundary_face_count + 1, as face_offsets, but in: */
    int64_t boundary_face_connectivity_count; /* elements in boundary_face_connectivity */
    insitu_array boundary_face_connectivity;  /* int32 or int64: the faces' vertex indices from index_base */
    insitu_array boundary_owner; /* int32 or int64, boundary_face_count: the only cell of each face; -1 (or 0 where
                                    index_base is 1): none, and the face is passed over */
    int64_t halo_cell_count;     /* 0 by default. Cells of a halo that owner and neighbour may name: the numbers of the
                                    halo follow those of the mesh's cells. They count as no cell, so that a face
                                    between a cell and the halo is on the boundary of this rank's part. */
    int open_offsets; /* 0 by default; 1: offsets and face_offsets have no last entry, as in Conduit's Blueprint. The
                         last cell ends with connectivity, the last face with face_connectivity. */
    /* Optional: the cell types of the code's own numbers in cell_types, type n being cell_type_map[n]; 0 where n is no
     * type. The table is copied by the call. The types are copied too, 1 byte a cell. */
    int cell_type_map_count;
    const int *cell_type_map;
} insitu_mesh;

/* A field has one value at each vertex, one in each cell, or one at each corner of each cell. Volumes and colours show
 * cell values as they are, unless the scene says `interpolate: vertex`; then, and always for isosurfaces, each vertex
 * gets the mean of its cells' values, over all ranks and without ghosts. Vertices of several meshes at one place are
 * one there, if one layer shows the field on these meshes and they have no vertex ids; a vertex that hangs on a larger
 * cell's triangle or quad gets that face's value. So do vertices with values of their own on a mesh with levels of
 * refinement (insitu_lattice). A vertex on the boundary gets the mean of the
 * boundary's own values instead, where the field has some (insitu_patch).
 *
 * Corner fields may differ from cell to cell at a shared vertex, as in discontinuous Galerkin methods. They have one
 * value for each entry of connectivity that is a vertex of a cell, in the order of the caller's connectivity (see
 * corner_row). Each cell shows its own values, so that an isosurface may have a step between two cells. Where the scene
 * says `interpolate: vertex`, each vertex gets the mean of its corners' values, over all ranks and without ghosts.
 * Polyhedra have faces in connectivity and so no corners: a corner field on a mesh with polyhedra is an error.
 *
 * As long as the scene names a corner field of a mesh, all that is drawn of the mesh is torn: each corner is a vertex
 * of its own. This takes 12 or 24 bytes a corner for coordinates, 4 for indices (8 where there are more than 2^31), and
 * a tuple a corner for each drawn field at vertices, all counted in bytes_copied. Values at corners are read where they
 * are. */
typedef enum insitu_centring { INSITU_VERTEX = 0, INSITU_CELL = 1, INSITU_CORNER = 2 } insitu_centring;

/* A cell field's values on faces of the boundary, as finite-volume codes hold them for each patch.
 *
 * Where cell values are averaged at the vertices, a vertex with such faces gets the mean of their values, over all
 * patches and ranks, instead of the mean of its cells: so a wall at which the flow rests is drawn at rest. At an edge
 * where two patches meet, the faces of both count. The mean has the same bits on any partition. In the middle of a flat
 * wall of equal faces it is exact, up to rounding, for a field that is linear in space; at edges and corners of the
 * domain no mean is exact, for they lie beyond all faces' centres. Values that are not finite and faces of ghost cells
 * do not count. Pictures that show cell values as they are do not use patches.
 *
 * A patch has faces between a cell and the outside. Do not give faces between ranks, nor others that are coupled in
 * pairs, which have cells on both sides. Faces are named in one of three ways: by first_face, faces or connectivity. A
 * face that two cells of this rank share, that no cell has, or that is given twice is an error, which the step that
 * needs the values returns on all ranks. The two sides of a baffle or a crack may have the same vertices: such a face,
 * named by its vertices, is given once for each of its two cells, and for both where one rank has both. */
typedef struct insitu_patch {
    int64_t count;      /* faces, and tuples of values */
    int64_t first_face; /* where neither faces nor connectivity is given: the patch has the mesh's faces from this
                           number on, counted from index_base */
    insitu_array faces; /* int32 or int64, count: the faces' numbers in face_offsets or face_lists, from index_base */
    /* The faces' vertices: for meshes without given faces, as those of hexes, but allowed with any. */
    int64_t connectivity_count; /* elements in connectivity */
    insitu_array connectivity;  /* int32 or int64, connectivity_count: vertex indices from index_base, around each face
                                   in either direction, as many as the cell's face has, counting repeated ones */
    insitu_array offsets; /* int32 or int64, count + 1, from index_base: where each face begins in connectivity. Not
                             needed where all faces have the same number of vertices, connectivity_count / count. */
    insitu_array values;  /* float32, float64, int32 or int64, count tuples of the field's component_count. stride_bytes
                             is from tuple to tuple; 0: component_count elements */
    int64_t component_stride_bytes; /* from one component to the next, as stride_bytes; 0: packed, interleaved */
} insitu_patch;

struct insitu_field;

/* Gives the values of a field in the steps that need them. field is as it was set; fill adds values and what belongs to
 * them (count, component_stride_bytes or components, index, corner_row, patches, changed), but leaves name, centring
 * and component_count. insitu_step() calls it on its caller's thread, at most once a step, and only if a picture, a
 * statistic or a condition of this step needs the field. The arrays are borrowed until the step has returned. All ranks
 * call the fills of their fields in the same order, by the names of meshes and then of fields: where all ranks set the
 * field with a fill, it may communicate, on a communicator of the caller's. It must not call the session: each such
 * call but insitu_error() is refused (the functions that return a status return INSITU_ERROR_ARGUMENT,
 * insitu_last_report() an empty report, and insitu_last_pictures() none) and is an error of the step. So is a status
 * other than INSITU_OK. The step returns it on all ranks; the other fills are still called. */
typedef insitu_status insitu_fill(void *fill_data, struct insitu_field *field);

/* One rank's part of a field. It is borrowed in the same way as a mesh. Call insitu_field_defaults() first. */
typedef struct insitu_field {
    const char *name;               /* copied; the name by which scenes ask for it */
    insitu_centring centring;       /* vertex by default */
    int64_t count;                  /* tuples: the mesh's vertex_count or cell_count, or the number of its cells'
                                       corners; any number where index is given */
    int component_count;            /* >= 1; 1 by default. The scene picks one, or the magnitude. */
    int64_t component_stride_bytes; /* from one component to the next, as stride_bytes; 0: packed, interleaved */
    insitu_array values;            /* float32, float64 or any integers. stride_bytes is from tuple to tuple; 0:
                                       component_count elements */
    unsigned changed;               /* INSITU_CHANGED_VALUES or NOTHING; ALL by default */
    /* Optional, int32 or int64, vertex_count, cell_count or the number of corners: the tuple of values that each
     * vertex, cell or corner has, counted from the mesh's index_base. It serves vectors of degrees of freedom and
     * arrays with halos. When a step first needs such a field, and again when its values have changed, it is copied in
     * the order of the vertices, cells or corners: one tuple each, counted in bytes_copied. Entries out of range are
     * errors then. A rank without vertices, cells or corners may have NULL data here; a type alone says that the index
     * is given. */
    insitu_array index;
    /* For corner fields on cells of one type without offsets: how many tuples of values (or entries of index, where
     * that is given) lie from the first corner of a cell to that of the next, at least as many as its vertices. Further
     * ones, such as degrees of freedom within edges, faces and cells, are passed over. Values in such rows are copied,
     * as by index. 0: one cell after the other, as many tuples as a cell has vertices. Cells with offsets have
     * connectivity_count corners, in the places of connectivity's entries, and 0 here. */
    int64_t corner_row;
    /* Optional, instead of values, which are not given then: the function that provides the values when a step needs
     * them. Each call counts as a change of the values, unless it sets changed to INSITU_CHANGED_NOTHING. */
    insitu_fill *fill;
    void *fill_data; /* passed to fill unchanged */
    /* Optional, for cell fields: the values on the boundary. The table is copied, its arrays are borrowed. */
    int patch_count;
    const insitu_patch *patches;
    /* Optional, instead of values and component_stride_bytes, which are not given then: component_count arrays, one a
     * component, each of any place, type and stride, as values; packed where stride_bytes is 0. The table is copied,
     * its arrays are borrowed. */
    const insitu_array *components;
} insitu_field;

/* The report of the last step on this rank, unless stated otherwise. Times are wall-clock milliseconds. */
typedef struct insitu_report {
    int64_t cycle;
    double time;
    int images;        /* number of images drawn in this step; 0 if none was due */
    double total_ms;   /* time of the whole insitu_step() */
    double prepare_ms; /* agreement among ranks, validation, bounds, recentring */
    double build_ms;   /* construction of trees */
    double refit_ms;   /* refitting of trees */
    double surface_ms; /* tracing of isosurfaces */
    double volume_ms;  /* tracing of volumes */
    /* exchange, merging and gathering of fragments, including waiting; on a single rank, the time of its slowest
     * thread */
    double composite_ms;
    double write_ms;        /* on rank 0: pictures written in the step, or given to the thread that writes them, with
                               the wait for room there; loading the image library, if a scene that was edited has the
                               first pictures */
    double background_ms;   /* on rank 0: time that the writing thread took for pictures that it finished since the last
                               step; in the first step also what insitu_create() took to load the image library */
    int pictures_waiting;   /* on rank 0: pictures that the writing thread had not yet written when the step ended */
    int turns;              /* in which pixels were drawn where cells or several volumes overlap; in each, all ranks
                               wait for each other. The same on every rank */
    int64_t cells;          /* number of cells, including ghosts */
    int64_t cells_ghost;    /* not drawn, because they are flagged as ghosts */
    int64_t cells_unusable; /* not drawn: the cell's own field value or that of a vertex is not finite */
    /* left-handed, by the sign of the sum of the corner volumes; drawn correctly nevertheless */
    int64_t cells_inverted;
    int64_t cells_flat;  /* without volume, not drawn: the absolute corner volumes sum to no more than rounding, 1.4e-14
                            of the cell's box; a polyhedron is flat if all its vertices are in a plane */
    int64_t cells_shell; /* triangles, quads and polygons, which layers of outer surfaces show */
    int64_t cells_recognised; /* polyhedra drawn as the tets, hexes, wedges or pyramids that their faces make */
    int64_t rays;             /* primary rays traced */
    int64_t fragments;        /* fragments sent to pixel owners, this rank included */
    int64_t bytes_sent;       /* sent by this rank to others for pictures: fragments and finished pixels, passed-on ones
                                 included; rays of shadows do not count */
    int64_t map_failures;     /* inverse maps that did not converge, where linear interpolation was used instead */
    int64_t bytes_borrowed;   /* size of the caller's arrays in use */
    int64_t bytes_copied;     /* size of copies of the caller's data; copied_why has the reasons */
    int64_t bytes_trees;      /* size of all trees held */
    int64_t bytes_pictures;   /* on rank 0: of pictures that wait to be written (at most 128 MiB, or one picture), and
                                 of memory kept for later ones (at most 64 MiB) */
    int64_t bytes_peak;       /* most bytes the library held at once in this step */
    const char *schedule;     /* the way on which the last frame's fragments were sent, named as in the scene: "direct",
                                 "nodes", "radix" or "binary"; "" where none was sent */
    const char *copied_why;   /* "" or a list of what was copied and why; valid until the next step */
    const char *left_out;     /* "" or a list of what the scene does not need and was left out; valid as long */
    const char *warnings; /* "" or one warning a line; valid as long. A warning is given when it begins to be true, and
                             again if it has ceased to be in between. One is given at every step: that an edit of the
                             scene file is broken. All are the same on every rank. */
} insitu_report;

/* An open session: its scene, its meshes and fields, and the state that is kept from step to step. */
typedef struct insitu_session insitu_session;

/* A picture in memory as the last step drew it: with its background, without decorations. */
typedef struct insitu_picture {
    const char *image; /* name of the image in the scene */
    int width;         /* pixels */
    int height;
    const float *rgba; /* height x width x 4, row-major, the top row first: linear light, premultiplied by opacity */
    /* height x width: distance along the camera's axis from the eye to the nearest surface, opaque or transparent, as
     * in EXR files; infinite if there is no surface, as with volumes only */
    const float *depth;
} insitu_picture;

/* Sets the defaults: nothing is given, and everything has changed. Local. */
INSITU_API void insitu_mesh_defaults(insitu_mesh *mesh);
INSITU_API void insitu_field_defaults(insitu_field *field);

/* Sets mesh->coordinates for interleaved x y z (row-major, vertices × 3), packed. type is INSITU_FLOAT32 or
 * INSITU_FLOAT64. Local. */
INSITU_API void insitu_mesh_interleaved(insitu_mesh *mesh, const void *xyz, insitu_type type);

/* Opens a session. Collective over comm, which is duplicated; its error handler is not changed. scene_file, a regular
 * file, is read on rank 0 only, and read again when it changes on disk. On an error *out is NULL on every rank, and
 * insitu_error(NULL) returns the message. MPI must be initialized; MPI_THREAD_SINGLE or FUNNELED suffices. */
INSITU_API insitu_status insitu_create(MPI_Comm comm, const char *scene_file, insitu_session **out);

/* Opens a session with a scene given as text: YAML as in a scene file, zero-terminated. Collective, and in all other
 * respects the same as insitu_create(). Only rank 0's text is used; the other ranks may pass NULL. The text need not
 * remain valid after the call. Messages refer to it as "scene text:line". The paths of files in it are relative to rank
 * 0's working directory. */
INSITU_API insitu_status insitu_create_from_text(MPI_Comm comm, const char *scene_text, insitu_session **out);

/* Same as insitu_create(), or insitu_create_from_text() if is_text is not 0, for a Fortran communicator. The Fortran
 * module calls it (docs/fortran.md). Collective. */
INSITU_API insitu_status insitu_create_fortran(MPI_Fint comm, const char *scene, int is_text, insitu_session **out);

/* Hand over this rank's part of the mesh called name, as borrowed arrays. Local. Ranks that have no part of the mesh
 * need not call it. Meshes of different names are drawn together; a layer of the scene is drawn on those that have its
 * field, or that it names. A mesh with INSITU_CHANGED_TOPOLOGY, or of other counts, drops the fields set on it before.
 * NULL for mesh takes the mesh away. A mesh that is not set again is taken as unchanged.
 *
 * This call checks counts, types and strides. A step checks the arrays' contents when it first needs them: every cell's
 * vertex indices and type, and the coordinates that cells without a ghost flag use. An error found then is returned on
 * every rank by that insitu_step() and by each later one that draws, until the mesh is set right or taken away; an
 * error of this call is returned so from the very next insitu_step() on. */
INSITU_API insitu_status insitu_set_mesh(insitu_session *session, const char *name, const insitu_mesh *mesh);

/* Hand over this rank's part of a field on the mesh called mesh, which must be set. Local. A field that is not set
 * again is taken as unchanged. Values that are NaN or infinite are no error: cells that have one are counted in the
 * report and not drawn. */
INSITU_API insitu_status insitu_set_field(insitu_session *session, const char *mesh, const insitu_field *field);

/* Hand over one of the blocks that this rank's part of a mesh consists of, by a number of the rank's own choice from 0
 * on: each block is a lattice or a list of cells, with arrays of its own. Other ranks may have other blocks, or none.
 * All blocks of a mesh are drawn as one: their vertices are the same where vertex_ids or, without them, the bits of the
 * coordinates are, and no wall is drawn between them. They have the same fields, but for blocks without cells, each set
 * by insitu_set_block_field(). NULL for block takes the block away; insitu_set_mesh() replaces or takes away all of
 * them. In all else these are as insitu_set_mesh() and insitu_set_field(); messages call block 17 of mesh "m" "m[17]".
 * Local. */
INSITU_API insitu_status insitu_set_block(insitu_session *session, const char *mesh, int64_t number,
                                          const insitu_mesh *block);
INSITU_API insitu_status insitu_set_block_field(insitu_session *session, const char *mesh, int64_t number,
                                                const insitu_field *field);

/* Draw the images that are due at this cycle and time. Collective. Where nothing is due it costs one small reduction.
 * An error on any rank is returned on every rank, with the rank and the place in the message. Images that need
 * neither the mesh nor the field that is wrong are drawn all the same, by the cameras and ranges that the other meshes
 * give, and the session stays usable: the simulation goes on.
 *
 * Pictures are written by a thread of rank 0 while the simulation goes on, unless the scene says `writing: step`. A
 * picture that could not be written is an error of the next step that has no other error. The thread calls no MPI.
 *
 * A step that draws works on OpenMP threads: as many as the scene asks for, but no more than there are cores and than
 * can be started. Within a parallel region of the caller's it works on the calling thread alone. That thread needs 320
 * kB of stack below this call, the others 256 kB below OpenMP's own; less is an error, which says what to set. On all
 * these threads the caller's floating-point traps and rounding modes are off meanwhile, here and in insitu_create(). */
INSITU_API insitu_status insitu_step(insitu_session *session, int64_t cycle, double time);

/* Returns the report of the last step. Local. Valid until the next step; all zero before the first; NULL for a NULL
 * session. */
INSITU_API const insitu_report *insitu_last_report(const insitu_session *session);

/* Read a parameter of the scene (`parameters: {inflow: 2.5}`) into *value. Local, without communication: all ranks have
 * the same scene. Parameters are there as soon as the session is; an edit of the scene file changes them in the
 * insitu_step() that reads it, on all ranks, so that between two steps a parameter is one number. An edit that is not
 * taken leaves them as they were. A name that the scene does not have, as where it has no parameters, is
 * INSITU_ERROR_ARGUMENT and leaves *value as it is: set it to a default before. From the second step on, a parameter of
 * the scene that rank 0 has never asked for is a warning in the report. */
INSITU_API insitu_status insitu_parameter(insitu_session *session, const char *name, double *value);

/* Sets whether rank 0 keeps each step's pictures in memory (keep is not 0), in addition to the files of the scene: 20
 * bytes per pixel of every image drawn in a step. Images without outputs are only drawn while this is on. Off at first.
 * Collective; only rank 0's keep is used. */
INSITU_API insitu_status insitu_keep_pictures(insitu_session *session, int keep);

/* Returns the pictures that the last step drew, *count of them, in the order of the scene. The pictures of one image
 * are sorted by the fields and isovalues of its sweep and then by the views of its orbit; all have the image's name. An
 * image that could not be drawn is left out; one whose file could not be written is included. The session owns the
 * pictures, and they are valid until the next step, insitu_keep_pictures() or insitu_destroy(). Returns NULL and sets
 * *count to 0 if there are none: on ranks other than 0, if nothing was due, or if pictures are not kept. Local. */
INSITU_API const insitu_picture *insitu_last_pictures(const insitu_session *session, int *count);

/* Returns the message of the most recent failed call on the session since the last insitu_step(), that step included;
 * "" if none failed. The failure of a step can therefore be read until the next step, even if other calls succeed in
 * between. Local. Valid until the next call on the session. For NULL it returns the message of this thread's most
 * recent insitu_create(), insitu_create_from_text() or insitu_destroy() that failed. */
INSITU_API const char *insitu_error(const insitu_session *session);

/* Closes a session and sets *session to NULL. Collective. session may be NULL or point to NULL. Waiting pictures are
 * written first; a picture that could not be written is an error, if no step has returned it, and the session is closed
 * nevertheless. If a run ends without this call, its pictures are written in MPI_Finalize() or as the process exits,
 * and their errors are lost. */
INSITU_API insitu_status insitu_destroy(insitu_session **session);

/* Returns the name of a status, such as "INSITU_ERROR_MESH". Local. */
INSITU_API const char *insitu_status_name(insitu_status status);

#ifdef __cplusplus
}
#endif

#endif
