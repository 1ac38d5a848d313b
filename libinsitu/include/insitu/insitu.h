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
 * "Any integers" are all integer types of insitu_type. Coordinates, arrays of any integers and values of fields may lie
 * at any address and have any stride, as in packed records. Other arrays and their strides must be aligned to their
 * element type.
 *
 * Values of fields are always read in place. Three kinds of arrays are copied once for each topology or geometry, and
 * counted in bytes_copied: coordinates that are integers become float64, integers of 1 or 2 bytes become int32, and
 * arrays that are not aligned keep their type. All other arrays are read in place. Unsigned integers of 4 or 8 bytes
 * are then read as signed ones, so they must be below 2^31 or 2^63. Only if a mesh has 2^31 or more vertices or faces,
 * uint32 indices may be larger. */
typedef struct insitu_array {
    const void *data; /* first element; NULL: there is no array */
    insitu_type type; /* type of one element */
    /* distance from one element to the next in bytes; 0: the elements are packed, so that the distance is the size of
     * the type. If it is negative, the elements are read backwards from data. A stride with which the elements span
     * more than 2^48 bytes is an error. */
    int64_t stride_bytes;
} insitu_array;

/* Cell types by VTK's ids, vertices in VTK's order, unless the mesh's vertex_order says otherwise. */
typedef enum insitu_cell_type {
    INSITU_TET = 10,        /* 4 vertices */
    INSITU_HEX = 12,        /* 8 vertices: the lower quad in cyclic order, then the upper quad above it */
    INSITU_WEDGE = 13,      /* 6 vertices: one triangle, then the other; in either orientation */
    INSITU_PYRAMID = 14,    /* 5 vertices: the quad in cyclic order, then the apex */
    INSITU_POLYHEDRON = 42, /* any number of faces of any number of vertices, convex or not: see insitu_mesh */
    /* Shells: cells of two dimensions, alone or among others. Layers of outer surfaces show them; a shell that lies on
     * the face of another cell is shown instead of that face. An isosurface on a mesh that contains only shells is
     * drawn as its contour lines. If there are also cells with a volume, isosurfaces ignore shells; volumes and slices
     * always ignore them. Statistics weight shells by their area if the field is only on shells, and otherwise ignore
     * them. If cell values are averaged at a vertex (insitu_centring), the values of shells are included. */
    INSITU_TRIANGLE = 5, /* 3 vertices */
    /* at least 3 vertices in order around the polygon; their number is given by offsets. The polygon is drawn as
     * triangles that cover it exactly once, whether it is convex or not; it should be flat. */
    INSITU_POLYGON = 7,
    INSITU_QUAD =
        9, /* 4 vertices in order around the quad, which may be warped; a concave quad is drawn as two triangles */
    /* Cells of higher order. Their vertices, at corners and between them, are called nodes here. Each cell is divided
     * into linear cells between its nodes, called pieces, at whatever positions the nodes have. The error decreases
     * with the square of the distance between nodes (docs/high_order.md). Nodes and values at nodes are not copied; the
     * list of pieces is made once per topology. Counts of cells in the report, ghost flags, cell values, thresholds and
     * lines along edges refer to the caller's cells and not to pieces. */
    INSITU_QUADRATIC_TRIANGLE = 22, /* 6 nodes */
    INSITU_QUADRATIC_QUAD = 23,     /* 8 nodes */
    INSITU_QUADRATIC_TET = 24,      /* 10 nodes */
    INSITU_QUADRATIC_HEX = 25,      /* 20 nodes */
    INSITU_QUADRATIC_WEDGE = 26,    /* 15 nodes */
    INSITU_QUADRATIC_PYRAMID = 27,  /* 13 nodes */
    INSITU_BIQUADRATIC_QUAD = 28,   /* 9 nodes */
    INSITU_TRIQUADRATIC_HEX = 29,   /* 27 nodes */
    INSITU_BIQUADRATIC_WEDGE = 32,  /* 18 nodes */
    /* Cells with all nodes of an order p from 1 to 32 (insitu_mesh.order). Nodes may be equispaced, Gauss-Lobatto
     * points or others, but those of a face or an edge must lie on that face or edge. */
    INSITU_LAGRANGE_TRIANGLE = 69, /* (p + 1)(p + 2) / 2 nodes */
    INSITU_LAGRANGE_QUAD = 70,     /* (p + 1)^2 */
    INSITU_LAGRANGE_TET = 71,      /* (p + 1)(p + 2)(p + 3) / 6 */
    INSITU_LAGRANGE_HEX = 72,      /* (p + 1)^3 */
    INSITU_LAGRANGE_WEDGE = 73,    /* (p + 1)^2 (p + 2) / 2 */
    INSITU_LAGRANGE_PYRAMID =
        74 /* (p + 1)(p + 2)(2 p + 3) / 6; more than 14 nodes are allowed only in lexicographic order */
} insitu_cell_type;

/* The order of a cell's vertices in connectivity. Cell types that an order does not mention are in VTK's order.
 * Mirrored cells are drawn correctly in any order. */
typedef enum insitu_vertex_order {
    /* the order described at insitu_cell_type; also used by CGNS, Exodus II, Gmsh, libMesh, MFEM for linear cells.
     * Nodes of higher order are in the order of VTK 9.1 and later. */
    INSITU_ORDER_VTK = 0,
    /* vertices of quads, hexes and bases of pyramids are sorted by x first, then y, then z: a quad lists VTK's vertices
     * 0 1 3 2. deal.II, dolfinx, DUNE and p4est use this order. The nodes of cells of higher order are stored as in
     * spectral element codes: row by row, parallel to the first edge and starting at the first corner, and the rows
     * layer by layer. */
    INSITU_ORDER_LEXICOGRAPHIC = 1,
    /* hexes list VTK's vertices 0 3 2 1 4 5 6 7, and wedges VTK's 0 2 1 3 4 5, so that their two ends have opposite
     * orientations. PETSc's DMPlex uses it. It is defined for linear cells only. */
    INSITU_ORDER_DMPLEX = 2,
    /* The next orders differ from INSITU_ORDER_VTK only in the nodes of cells of higher order. */
    INSITU_ORDER_VTK_BEFORE_9_1 = 3, /* the vertical edges at corners 2 and 3 of Lagrange hexes are swapped */
    INSITU_ORDER_GMSH = 4,           /* Gmsh's order of nodes; for cells up to order 2 */
    INSITU_ORDER_EXODUS = 5 /* Exodus II's order of nodes, for cells up to order 2: nodes of vertical edges precede
                               those of the top's edges */
} insitu_vertex_order;

/* The parts of a mesh or a field that have changed since it was last set. The default, everything, is always safe. Some
 * changes are detected even if the caller does not name them. If counts or cell_type differ from the last call, the
 * mesh is treated as a new one (ALL). If an array has another address, type or stride, it is read again: an array that
 * describes cells as if TOPOLOGY were named (but fields are kept), coordinates and vertex_ids as if GEOMETRY were
 * named, and values as if VALUES were named. New contents of the same arrays are not detected, so that the caller must
 * name these changes. */
enum {
    INSITU_CHANGED_NOTHING = 0,
    INSITU_CHANGED_TOPOLOGY = 1, /* the cells, their types and faces, or ghost flags; the bounding volume hierarchy (the
                                    tree) is built again */
    INSITU_CHANGED_GEOMETRY = 2, /* the coordinates; the tree's bounds are refitted */
    /* a field's values; the ranges of values in the tree's nodes are computed again if the values have actually
     * changed */
    INSITU_CHANGED_VALUES = 4,
    INSITU_CHANGED_ALL = 7
};

/* A structured block. Its cells are found by three indices i, j, k instead of by connectivity. Vertex and cell arrays
 * are read in place, in C's or Fortran's order, padded or with ghost layers. Cells are hexes, or quads if one of
 * `cells` is 0. The coordinates are either uniform (spacing), rectilinear (axes) or given for each vertex. Only in the
 * last case are the mesh's coordinates given. docs/structured.md has examples. */
typedef struct insitu_lattice {
    /* number of cells along i, j and k, at least 1 each; if one of them is 0, the cells are quads. All are 0 on a rank
     * without cells. */
    int64_t cells[3];
    /* Distances, in vertices, from one vertex to the next along i, j and k in the vertices' arrays, at least 1 each:
     * the vertex i, j, k has the index i * vertex_strides[0] + j * vertex_strides[1] + k * vertex_strides[2]. Each
     * stride must be larger than the distance that the smaller ones cover, so that no two vertices have the same
     * index. All 0: the arrays are packed, and i varies fastest, as in Fortran's x(i, j, k) and C's x[k][j][i]. */
    int64_t vertex_strides[3];
    int64_t cell_strides[3]; /* distances, in cells, from one cell to the next along i, j and k in the cells' arrays;
                                rules as for vertex_strides */
    /* Ghost layers: the cells with indices from interior_first to interior_end - 1 are drawn, and those outside of this
     * range are ghosts. All 0: all cells are drawn. */
    int64_t interior_first[3], interior_end[3];
    /* Uniform coordinates: vertex n along an axis is at origin + spacing * (first + n), computed in double. first is
     * the index of the block's first vertex in the whole lattice, so that blocks of one lattice have the same origin
     * and spacing, and the coordinates of their common vertices are bitwise equal. This is how equal vertices of
     * several blocks and ranks are recognized. spacing must not be 0 along the axes that have cells. If all of spacing
     * is 0, the lattice is not uniform. The magnitude of first is at most 2^53. */
    double origin[3], spacing[3];
    int64_t first[3];
    /* Rectilinear coordinates: cells[a] + 1 coordinates along each axis a, float32, float64 or any integers; not given
     * if the lattice is uniform. In a lattice of quads, the array of the axis without cells may be missing; the
     * coordinate is then 0. */
    insitu_array axes[3];
    /* Levels of refinement: the number of the block's cells that make one cell of the coarsest level along each axis,
     * such as 1, 2 or 8. It is at most 2^20, and is not read along an axis without cells. All 0: the mesh has no
     * levels. If levels are given, first is the index of the block's first cell along each axis, counted in cells of
     * the block's level; its magnitude is at most 2^40. A cell is not drawn if the interior of a finer block of the
     * mesh, on any rank, covers it. Finer blocks must end at borders of the coarser cells that no other block covers.
     * If blocks of two levels touch, one number should be a multiple of the other along each axis; otherwise surfaces
     * have slits there. A vertex within a face or an edge of a coarser cell gets the value that is interpolated on that
     * face or edge, even if values are given at vertices. */
    int64_t refinement[3];
} insitu_lattice;

/* One rank's part of a mesh. All arrays are borrowed until the next insitu_step() returns or the mesh is set again
 * under the same name, whichever is later. They must stay valid that long, and a step reads the values that they hold
 * when it is called. Call insitu_mesh_defaults() before setting members. */
typedef struct insitu_mesh {
    int64_t vertex_count; /* number of vertices, >= 0 */
    /* x, y, z: float32, float64 or any integers, vertex_count each; the coordinates of drawn cells have magnitudes of
     * at most 1e100. Interleaved x y z are described as three arrays with a stride of 3 elements: see
     * insitu_mesh_interleaved(). For meshes of triangles, quads and polygons, coordinates[2] may be without data; z is
     * then 0 everywhere. */
    insitu_array coordinates[3];
    /* optional, int32 or int64, vertex_count: ids that identify equal vertices of different ranks, and differ for all
     * other vertices. Without ids, vertices with bitwise equal coordinates are equal. */
    insitu_array vertex_ids;
    int64_t cell_count;         /* number of cells, >= 0, at most 4294967294 */
    insitu_cell_type cell_type; /* type of all cells if cell_types is not given */
    /* optional, any integers, cell_count: the type of each cell, for meshes with several types. The entries are VTK's
     * ids, or the simulation's own numbers (see cell_type_map). */
    insitu_array cell_types;
    int64_t connectivity_count; /* number of elements in connectivity */
    /* any integers, connectivity_count: the vertex indices of the cells, counted from index_base, one cell after the
     * other */
    insitu_array connectivity;
    /* any integers, cell_count + 1: the index in connectivity at which each cell begins; the last entry is
     * connectivity_count, and is missing if open_offsets is 1. Not needed if all cells have one type that is neither
     * INSITU_POLYHEDRON nor INSITU_POLYGON. */
    insitu_array offsets;
    /* Faces, which are needed if there are polyhedra. A polyhedron's entries in connectivity are the indices of its
     * faces, counted from index_base, at least 4, in any order. Two polyhedra that share a face refer to the same one.
     * The faces of a cell must form a closed surface: every edge belongs to exactly two of the faces, once to each.
     * (Edges from a vertex to itself are ignored, so that a face may list a vertex several times in succession, or
     * consist of a single vertex.) A face may have either direction. Faces are not copied, except as described at
     * insitu_array, owner, face_lists and keep_polyhedra. While pictures are drawn, each thread stores only the
     * polyhedra that its rays currently cross: about 200 bytes per vertex, and at most 16 MiB per thread. */
    int64_t face_count;
    /* any integers, face_count + 1: the index in face_connectivity at which each face begins; the last entry is missing
     * if open_offsets is 1 */
    insitu_array face_offsets;
    int64_t face_connectivity_count; /* number of elements in face_connectivity */
    /* any integers, face_connectivity_count: the vertex indices of the faces, counted from index_base, at least 3 per
     * face, in order around the face, beginning at any vertex and in either direction */
    insitu_array face_connectivity;
    insitu_array ghosts; /* optional, any integers, cell_count: cells with a nonzero flag are not drawn.
                            Flags of 2 bytes, and those that are not aligned, are copied, 1 byte each. */
    /* the arrays that have changed: a combination of the bits INSITU_CHANGED_TOPOLOGY and INSITU_CHANGED_GEOMETRY;
     * INSITU_CHANGED_ALL by default */
    unsigned changed;
    /* 0 by default, or 1 as in Fortran: the number from which all indices in connectivity, offsets, face_offsets,
     * face_connectivity, face_lists, owner and neighbour are counted */
    int index_base;
    /* Finite-volume codes may give the two cells of each face (docs/finite_volume.md) instead of connectivity, offsets
     * and cell_types, which must then not be given; cell_type is INSITU_POLYHEDRON. The faces' vertices are read in
     * place. Once for each topology the library makes a list of the faces of each cell, in ascending order of face
     * indices. It takes 4 bytes per cell and up to 8 per face (twice that if there are more than 2^31 faces), counted
     * in bytes_copied. */
    /* int32 or int64, face_count: the cell on one side of each face. If index_base is 1, an owner may be 0, as in CGNS;
     * then the neighbour is the only cell of the face. */
    insitu_array owner;
    int64_t neighbour_count; /* number of elements in neighbour; at most face_count */
    /* int32 or int64, neighbour_count: the cell on the other side of each face, which must differ from the owner. For
     * faces on the boundary or between ranks, the neighbour is -1 (or 0 if index_base is 1). These faces may also be
     * numbered last, from neighbour_count on, and have no entry here. */
    insitu_array neighbour;
    /* Each face may have its own list of vertices instead of face_offsets and face_connectivity, which must then not be
     * given. The lists are copied into one array, once for each topology, which is kept as long as polyhedra are drawn
     * from it: 4 bytes per face and 4 for each of its vertices, counted in bytes_copied. */
    insitu_array face_sizes; /* int32 or int64, face_count: number of vertices of each face */
    /* face_count pointers. Each points to the packed vertex indices of one face, as many as its face_sizes. type is the
     * type of the indices: int32 or int64. stride_bytes is the distance from pointer to pointer; 0: packed */
    insitu_array face_lists;
    /* If keep_polyhedra is 0, a polyhedron whose faces form a tet, hex, wedge or pyramid is drawn as a cell of that
     * type, whatever direction its faces have. The report counts these cells in cells_recognised. The picture differs
     * only inside such cells: the field is trilinear in a hex, but linear on tets about its centre in a polyhedron.
     * Faces with four vertices are bilinear patches in both, so that there is no gap to other polyhedra. Set
     * keep_polyhedra to 1 for hexes that are folded or have a corner pushed in. Memory, counted in bytes_copied: 32
     * bytes per hex, 4 per face of each cell that is drawn as a polyhedron, and, unless all cells have one type, 5 per
     * cell; twice that if there are more than 2^31 vertices or faces. */
    int keep_polyhedra; /* 0 by default, or 1 */
    /* The order of each cell's vertices in connectivity; it does not apply to polyhedra and polygons. Cells whose order
     * differs from VTK's, and cells with a connectivity_row, are copied once for each topology: 4 bytes for each entry
     * of connectivity that cells use (8 if there are more than 2^31 vertices), counted in bytes_copied. */
    insitu_vertex_order vertex_order; /* INSITU_ORDER_VTK by default */
    /* for cells of one type without offsets: the number of entries of connectivity from the first vertex of a cell to
     * that of the next, at least the number of its vertices; 0: the cells are packed. If the number is larger, the
     * further entries of each cell, such as the other nodes of a cell of higher order, are ignored. connectivity_count
     * includes them, but they may be missing for the last cell. */
    int64_t connectivity_row;
    /* Optional, instead of connectivity, offsets, cell_types and faces, which must then not be given; cell_type is not
     * read. vertex_count and cell_count are the lengths of the vertices' and the cells' arrays, including padding. The
     * description is copied, the axes are borrowed. Nothing is stored per cell or vertex. */
    const insitu_lattice *lattice;
    /* Codes that store the faces of the boundary in a separate list, such as code_saturne, may give it in addition to
     * owner and neighbour. Its faces have the indices from face_count on, also in patches. Both lists are copied into
     * one, once for each topology, which is kept as long as polyhedra are drawn from it, as described at face_lists.
     * Not allowed with face_lists. */
    int64_t boundary_face_count; /* 0 by default */
    /* int32 or int64, boundary_face_count + 1: the index in boundary_face_connectivity at which each of these faces
     * begins */
    insitu_array boundary_face_offsets;
    int64_t boundary_face_connectivity_count; /* number of elements in boundary_face_connectivity */
    /* int32 or int64: the vertex indices of these faces, counted from index_base */
    insitu_array boundary_face_connectivity;
    /* int32 or int64, boundary_face_count: the only cell of each face; -1 (or 0 if index_base is 1): the face has no
     * cell and is ignored */
    insitu_array boundary_owner;
    /* 0 by default. Number of halo cells to which owner and neighbour may refer; their indices follow those of the
     * mesh's cells. Halo cells are not drawn: a face between a cell and a halo cell is on the boundary of this rank's
     * part of the mesh. */
    int64_t halo_cell_count;
    /* 0 by default; 1: offsets and face_offsets lack their last entry, as in Conduit's Blueprint. The last cell ends at
     * the end of connectivity, the last face at the end of face_connectivity. */
    int open_offsets;
    /* Optional: the meaning of the simulation's own numbers in cell_types. The number n stands for the type
     * cell_type_map[n]; an entry of 0 means that no cell has this number. The table is copied by the call. The types
     * are also copied, with 1 byte per cell. */
    int cell_type_map_count;
    const int *cell_type_map;
    /* The order of all cells if cell_type is one of INSITU_LAGRANGE_*. 0, the default: the order follows from the
     * number of nodes per cell, given by offsets, connectivity_row or connectivity_count / cell_count. If order is
     * given, connectivity may be absent. In this case the vertices are the nodes of one cell after the other, and
     * vertex_count is cell_count times the nodes of a cell, as in spectral element codes that store shared nodes once
     * per cell. Vertices that stand for the same node must have bitwise equal coordinates. */
    int order;
} insitu_mesh;

/* A field has one value at each vertex, one in each cell, or one at each corner of each cell. Volumes and colours show
 * cell values unchanged, unless the scene sets `interpolate: vertex`. In that case, and always for isosurfaces, each
 * vertex gets the mean of its cells' values, over all ranks and without ghosts. Vertices of several meshes at the same
 * position are treated as one vertex if one layer shows the field on these meshes and they have no vertex ids. A vertex
 * that hangs on a triangle or quad of a larger cell, or on an edge of a larger cell that is a triangle or quad, gets
 * the value that is interpolated there. On a mesh with levels of refinement (insitu_lattice), hanging vertices get this
 * value even if the field has values at vertices, but statistics, conditions and thresholds use the given values. If
 * the field has values on the boundary (insitu_patch), a vertex there gets the mean of these values instead.
 *
 * Corner fields may differ from cell to cell at a shared vertex, as in discontinuous Galerkin methods. A corner field
 * has one value for each vertex of each cell, in the order of the caller's connectivity (see corner_row). Each cell
 * shows its own values, so that an isosurface may have a step between two cells. If the scene sets `interpolate:
 * vertex`, each vertex gets the mean of its corners' values, over all ranks and without ghosts. The connectivity of
 * polyhedra contains faces and no corners, so that a corner field on a mesh with polyhedra is an error.
 *
 * If the scene uses a corner field of a mesh, the mesh is drawn with each corner as a separate vertex. This takes 12 or
 * 24 bytes per corner for coordinates, 4 for indices (8 if there are more than 2^31), and one tuple per corner for each
 * drawn field at vertices, all counted in bytes_copied. Values at corners are read in place. */
typedef enum insitu_centring { INSITU_VERTEX = 0, INSITU_CELL = 1, INSITU_CORNER = 2 } insitu_centring;

/* The values of a cell field on faces of the boundary, which finite-volume codes store for each patch.
 *
 * When cell values are averaged at the vertices, a vertex of such faces gets the mean of the faces' values, over all
 * patches and ranks, instead of the mean of its cells. So a velocity of zero at a wall is drawn as zero. At an edge
 * between two patches, the faces of both patches are averaged. The mean has the same bits for any partition. In the
 * middle of a flat wall of equal faces it is exact, up to rounding, for a field that is linear in space; at edges and
 * corners of the domain no mean is exact, because they lie beyond the centres of all faces. Values that are not finite
 * and faces of ghost cells do not count. Pictures that show cell values unchanged do not use patches.
 *
 * A patch contains faces between a cell and the outside. Faces between ranks, and others that are coupled in pairs,
 * must not be given, because they have cells on both sides. Faces are given in one of three ways: by first_face,
 * faces or connectivity. It is an error if a face belongs to two cells of this rank or to none, or is given twice.
 * The error is returned on all ranks by the step that needs the values. The two sides of a baffle or a crack may
 * have the same vertices: such a face, if given by its vertices, is given once for each of its two cells, and twice
 * if one rank has both. */
typedef struct insitu_patch {
    int64_t count; /* number of faces, and of tuples of values */
    /* used if neither faces nor connectivity is given: index of the patch's first face among the faces of the mesh,
     * counted from index_base. The patch then consists of `count` consecutive faces. */
    int64_t first_face;
    /* int32 or int64, count: the index of each face in face_offsets or face_lists, counted from index_base */
    insitu_array faces;
    /* The vertices of the faces. They are needed for meshes that are not described by faces, such as those of hexes,
     * and allowed for all others. */
    int64_t connectivity_count; /* number of elements in connectivity */
    /* int32 or int64, connectivity_count: vertex indices counted from index_base, in order around each face in either
     * direction. If the cell's own list of a face repeats a vertex, the patch must repeat it too. */
    insitu_array connectivity;
    /* int32 or int64, count + 1, counted from index_base: the index in connectivity at which each face begins. Not
     * needed if all faces have the same number of vertices, connectivity_count / count. */
    insitu_array offsets;
    /* float32, float64, int32 or int64, count tuples of the field's component_count. stride_bytes is the distance from
     * tuple to tuple; 0: component_count elements */
    insitu_array values;
    int64_t component_stride_bytes; /* distance from one component to the next in bytes; 0: packed, interleaved */
} insitu_patch;

struct insitu_field;

/* Computes the values of a field in the steps that need them. *field contains the members that the caller has set; the
 * function adds values and the members that describe them (count, component_stride_bytes or components, index,
 * corner_row, patches, changed), but must not change name, centring and component_count. insitu_step() calls it on its
 * caller's thread, at most once per step, and only if a picture, a statistic or a condition of this step needs the
 * field. The arrays are borrowed until the step has returned. All ranks call the fill functions in the same order.
 * First come fields by which the scene warps meshes, sorted by the names of their meshes; then all other fields, sorted
 * by the name of the mesh and then of the field. Therefore a fill function that is set on all ranks may communicate, on
 * the caller's own communicator. It must not call the session. Each call of the session except insitu_error() is
 * refused and makes the step fail. Refused functions return INSITU_ERROR_ARGUMENT; insitu_last_report() returns an
 * empty report, and insitu_last_pictures() returns no pictures. A status other than INSITU_OK is also an error of the
 * step. The step returns it on all ranks; the other fill functions are still called. */
typedef insitu_status insitu_fill(void *fill_data, struct insitu_field *field);

/* One rank's part of a field. It is borrowed in the same way as a mesh. Call insitu_field_defaults() first. */
typedef struct insitu_field {
    const char *name;         /* the name by which scenes refer to the field; it is copied */
    insitu_centring centring; /* INSITU_VERTEX by default */
    /* number of tuples of values: the mesh's vertex_count or cell_count, or, for corner fields, the number of its
     * cells' corners. If index is given, any number is allowed. */
    int64_t count;
    /* number of components, >= 1; 1 by default. The scene selects one of them, or the magnitude. */
    int component_count;
    int64_t component_stride_bytes; /* distance from one component to the next in bytes; 0: packed, interleaved */
    /* float32, float64 or any integers. stride_bytes is the distance from tuple to tuple; 0: component_count
     * elements */
    insitu_array values;
    unsigned changed; /* INSITU_CHANGED_VALUES or INSITU_CHANGED_NOTHING; INSITU_CHANGED_ALL by default */
    /* Optional, int32 or int64, one element for each vertex, cell or corner of the mesh: the index of its tuple of
     * values, counted from the mesh's index_base. It allows vectors of degrees of freedom and arrays with halos. When a
     * step first needs such a field, and again when its values have changed, it is copied into the order of the
     * vertices, cells or corners, one tuple each, counted in bytes_copied. Entries out of range are then errors. A rank
     * without vertices, cells or corners may have NULL data here; a type alone states that the index is given. */
    insitu_array index;
    /* For corner fields on cells of one type without offsets: the number of tuples of values (or entries of index, if
     * that is given) from the first corner of a cell to that of the next, at least the number of its vertices. Further
     * tuples of a cell, such as degrees of freedom within edges, faces and cells, are ignored. Values with a corner_row
     * are copied in the same way as values with an index. 0: the tuples are packed, and each cell has as many as it has
     * vertices. Cells with offsets have connectivity_count corners, at the positions of connectivity's entries, and
     * must have 0 here. */
    int64_t corner_row;
    /* Optional, instead of values, which must then not be given: the function that computes the values when a step
     * needs them. Each call counts as a change of the values, unless it sets changed to INSITU_CHANGED_NOTHING. */
    insitu_fill *fill;
    void *fill_data; /* argument that is passed to fill unchanged */
    /* Optional, for cell fields: the values on the boundary. The table is copied, its arrays are borrowed. */
    int patch_count;
    const insitu_patch *patches;
    /* Optional, instead of values and component_stride_bytes, which must then not be given: component_count arrays, one
     * per component. Each array may have any address, type and stride that is allowed for values; its elements are
     * packed if stride_bytes is 0. The table is copied, its arrays are borrowed. */
    const insitu_array *components;
} insitu_field;

/* The report of the last step. Members are values of this rank, unless stated otherwise. Times are wall-clock
 * milliseconds. */
typedef struct insitu_report {
    int64_t cycle;
    double time;
    int images;      /* number of images drawn in this step; 0 if none was due */
    double total_ms; /* time of the whole insitu_step() */
    double
        prepare_ms;  /* time for agreement among ranks, validation, bounds, and averaging of cell values at vertices */
    double build_ms; /* time for the construction of trees (bounding volume hierarchies) */
    double refit_ms; /* time for refitting of trees */
    double surface_ms; /* time for tracing of isosurfaces */
    double volume_ms;  /* time for tracing of volumes */
    /* time for exchange, merging and gathering of fragments, including waiting; on a single rank, the time of its
     * slowest thread */
    double composite_ms;
    /* on rank 0: time for writing the step's pictures, or for passing them to the thread that writes them, including
     * the wait for space in its queue. If an edit of the scene requests the run's first pictures, the time includes
     * loading the image library. */
    double write_ms;
    /* on rank 0: time that the writing thread took for the pictures that it finished since the last step. In the first
     * step it includes the time that insitu_create() took to load the image library. */
    double background_ms;
    /* on rank 0: number of pictures that the writing thread had not yet written when the step ended */
    int pictures_waiting;
    /* number of times that pixels were traced again, because several cells or volumes overlap in them. In each of these
     * turns, all ranks wait for each other. The same on every rank */
    int turns;
    int64_t cells;       /* number of cells, including ghosts; mirror images that the scene shows are not counted */
    int64_t cells_ghost; /* number of cells that are not drawn because they are flagged as ghosts */
    /* number of cells that are not drawn because a value of the field in the cell or at its vertices is not finite. For
     * cells of higher order, only the pieces with such values are not drawn. */
    int64_t cells_unusable;
    /* number of left-handed cells: the signed volumes that the edges at a cell's corners span (its corner volumes) have
     * a negative sum; these cells are drawn correctly nevertheless */
    int64_t cells_inverted;
    /* number of cells without volume, which are not drawn. A cell counts if the sum of its absolute corner volumes is
     * at most 1.4e-14 of the volume of its bounding box, which is rounding; a polyhedron counts if all its vertices are
     * in a plane. */
    int64_t cells_flat;
    int64_t cells_shell; /* number of triangles, quads and polygons; layers of outer surfaces show them */
    /* number of polyhedra that are drawn as the tets, hexes, wedges or pyramids that their faces form */
    int64_t cells_recognised;
    int64_t rays;      /* number of primary rays that were traced */
    int64_t fragments; /* number of fragments sent to pixel owners, including those to this rank itself */
    /* bytes sent by this rank to others for pictures: fragments and finished pixels, including those that it passes on;
     * rays of shadows do not count */
    int64_t bytes_sent;
    /* number of points in cells for which the iteration to reference coordinates did not converge; linear interpolation
     * was used there */
    int64_t map_failures;
    int64_t bytes_borrowed; /* size in bytes of the caller's arrays in use */
    int64_t bytes_copied;   /* size in bytes of copies of the caller's data; copied_why has the reasons */
    int64_t bytes_trees;    /* size in bytes of all trees */
    /* on rank 0: bytes of pictures that wait to be written (at most 128 MiB, or one picture), plus bytes of memory that
     * is kept for later pictures (at most 64 MiB) */
    int64_t bytes_pictures;
    int64_t bytes_peak; /* largest number of bytes that the library had allocated at once in this step */
    /* method by which the last frame's fragments were sent, named as in the scene: "direct", "nodes", "radix" or
     * "binary"; "" if none was sent */
    const char *schedule;
    const char *copied_why; /* "" or a list of what was copied and why; valid until the next step */
    /* "" or a list of data that was left out because the scene does not need it; valid until the next step */
    const char *left_out;
    /* "" or warnings, one per line; valid until the next step. A warning is reported when its condition becomes true,
     * and again only after the condition has been false. The warning that an edit of the scene file is invalid is
     * reported at every step. The warnings are the same on every rank. */
    const char *warnings;
    /* "" or one line for each mesh with cells of higher order that an image shows: the number of pieces between two
     * neighbouring nodes, and the bound of the pieces' error. It is "" if the scene has finer_pieces. The same on every
     * rank; valid until the next step */
    const char *pieces;
} insitu_report;

/* An open session: its scene, its meshes and fields, and the state that is kept from step to step. */
typedef struct insitu_session insitu_session;

/* A picture in memory as the last step drew it: with its background, without decorations. */
typedef struct insitu_picture {
    const char *image; /* name of the image in the scene */
    int width;         /* width and height in pixels */
    int height;
    const float *rgba; /* height x width x 4, row-major, the top row first: linear light, premultiplied by opacity */
    /* height x width: distance along the camera's axis from the eye to the nearest surface, opaque or transparent, as
     * in EXR files; infinite if the pixel shows no surface, even if it shows volumes */
    const float *depth;
} insitu_picture;

/* Sets the defaults: no arrays are given, and `changed` is INSITU_CHANGED_ALL. Local. */
INSITU_API void insitu_mesh_defaults(insitu_mesh *mesh);
INSITU_API void insitu_field_defaults(insitu_field *field);

/* Sets mesh->coordinates for interleaved x y z (row-major, vertices × 3), packed. type is INSITU_FLOAT32 or
 * INSITU_FLOAT64. Local. */
INSITU_API void insitu_mesh_interleaved(insitu_mesh *mesh, const void *xyz, insitu_type type);

/* Opens a session. Collective over comm, which is duplicated; its error handler is not changed. scene_file must be a
 * regular file. Only rank 0 reads it, and reads it again when it changes on disk. On an error *out is NULL on every
 * rank, and insitu_error(NULL) returns the message. MPI must be initialized; MPI_THREAD_SINGLE or FUNNELED suffices. */
INSITU_API insitu_status insitu_create(MPI_Comm comm, const char *scene_file, insitu_session **out);

/* Opens a session with a scene given as text: YAML as in a scene file, zero-terminated. Collective, and in all other
 * respects the same as insitu_create(). Only rank 0's text is used; the other ranks may pass NULL. The text need not
 * remain valid after the call. Messages refer to it as "scene text:line". The paths of files in it are relative to rank
 * 0's working directory. */
INSITU_API insitu_status insitu_create_from_text(MPI_Comm comm, const char *scene_text, insitu_session **out);

/* Same as insitu_create(), or insitu_create_from_text() if is_text is not 0, for a Fortran communicator. The Fortran
 * module calls it (docs/fortran.md). Collective. */
INSITU_API insitu_status insitu_create_fortran(MPI_Fint comm, const char *scene, int is_text, insitu_session **out);

/* Passes this rank's part of the mesh with this name to the session, as borrowed arrays. Local. Ranks that have no part
 * of the mesh need not call it. Meshes with different names are drawn together; a layer of the scene is drawn on the
 * meshes that it names, or on all meshes that have its field. If mesh->changed contains INSITU_CHANGED_TOPOLOGY, or
 * counts differ from the last call, the fields that were set on it are removed. If mesh is NULL, the mesh is removed. A
 * mesh that is not set again is assumed to be unchanged.
 *
 * This call checks counts, types and strides. A step checks the arrays' contents when it first needs them: every
 * cell's vertex indices and type, and the coordinates that cells without a ghost flag use. An error found then is
 * returned on every rank by that insitu_step() and by each later one that draws, until the mesh is set correctly or
 * removed. If this call itself fails, the steps from the next insitu_step() on return its error in the same way. */
INSITU_API insitu_status insitu_set_mesh(insitu_session *session, const char *name, const insitu_mesh *mesh);

/* Passes this rank's part of a field to the session. The mesh must have been set. Local. A field that is not set again
 * is assumed to be unchanged. Values that are NaN or infinite are not an error: cells that have such values are counted
 * in the report and not drawn. */
INSITU_API insitu_status insitu_set_field(insitu_session *session, const char *mesh, const insitu_field *field);

/* Passes one block of a mesh to the session, if this rank's part of the mesh consists of several blocks. Each rank
 * numbers its blocks itself, from 0 on. Each block is a lattice or a list of cells, with its own arrays. Ranks may have
 * different numbers of blocks, or none. All blocks of a mesh are drawn as one mesh: vertices are equal if vertex_ids
 * or, without these, the bits of the coordinates are equal, and no wall is drawn between blocks. Except for blocks
 * without cells, they must have the same fields, each of which is set by insitu_set_block_field(). If block is NULL,
 * the block is removed; insitu_set_mesh() replaces or removes all of them. In all other respects these functions are
 * the same as insitu_set_mesh() and insitu_set_field(); in messages block 17 of mesh "m" is called "m[17]". Local. */
INSITU_API insitu_status insitu_set_block(insitu_session *session, const char *mesh, int64_t number,
                                          const insitu_mesh *block);
INSITU_API insitu_status insitu_set_block_field(insitu_session *session, const char *mesh, int64_t number,
                                                const insitu_field *field);

/* Draws the images that are due at this cycle and time. Collective. If nothing is due, it costs one small reduction. An
 * error on any rank is returned on every rank, with the rank and the location in the message. Images that need neither
 * the mesh nor the field with the error are drawn nevertheless, with the cameras and ranges that result from the other
 * meshes. The session remains usable, so that the simulation can continue.
 *
 * Pictures are written by a thread of rank 0 while the simulation continues, unless the scene sets `writing: step`. A
 * picture that could not be written is an error of the next step that has no other error. The thread does not call MPI.
 *
 * A step that draws uses OpenMP threads: as many as the scene requests, but no more than the number of cores and the
 * number of threads that can be started. Within a parallel region of the caller it uses only the calling thread.
 * The calling thread needs 320 kB of free stack at this call. Each other thread needs 256 kB in addition to the stack
 * that OpenMP uses. If a stack is smaller, the step fails, and the message names the setting to change. During this
 * call and insitu_create(), the caller's floating-point traps and rounding modes are disabled on all these threads. */
INSITU_API insitu_status insitu_step(insitu_session *session, int64_t cycle, double time);

/* Returns the report of the last step. It is valid until the next step, and all zero before the first one. Returns NULL
 * if session is NULL. Local. */
INSITU_API const insitu_report *insitu_last_report(const insitu_session *session);

/* Reads a parameter of the scene (`parameters: {inflow: 2.5}`) into *value. Local and without communication, since all
 * ranks have the same scene. Parameters exist as soon as the session does. An edit of the scene file changes them in
 * the insitu_step() that reads it, on all ranks, so that a parameter does not change between two steps. An edit that is
 * refused does not change them. If the scene does not have the name, or has no parameters at all, INSITU_ERROR_ARGUMENT
 * is returned and *value is not changed, so that it can be set to a default before. From the second step on, a
 * parameter of the scene that rank 0 has never read causes a warning in the report. */
INSITU_API insitu_status insitu_parameter(insitu_session *session, const char *name, double *value);

/* Sets whether rank 0 keeps each step's pictures in memory (keep is not 0), in addition to the files of the scene: 20
 * bytes per pixel of every image drawn in a step. Images without outputs are only drawn while pictures are kept. By
 * default pictures are not kept. Collective; only rank 0's keep is used. */
INSITU_API insitu_status insitu_keep_pictures(insitu_session *session, int keep);

/* Returns the pictures that the last step drew, in the order of the scene, and sets *count to their number. The
 * pictures of one image are sorted by the fields and isovalues of its sweep and then by the views of its orbit; all
 * have the image's name. An image that could not be drawn is left out; one whose file could not be written is included.
 * The session owns the pictures, and they are valid until the next step, insitu_keep_pictures() or insitu_destroy().
 * Returns NULL and sets *count to 0 if there are none: on ranks other than 0, if nothing was due, or if pictures are
 * not kept. Local. */
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
