/* Meshes with known properties, for tests and benchmarks: jittered lattices of every kind of cell and single cells,
 * valid and degenerate. Functions mirror, renumber and transform them and extract the parts of ranks. They depend only
 * on grid.h.
 *
 * A test_mesh uses double and int64 for all numbers and owns its arrays. A test_view presents it as a grid in a chosen
 * layout. All random numbers are computed by a fixed hash, so that every machine has the same meshes. The process ends
 * if memory runs out. */
#ifndef TEST_MESHES_H
#define TEST_MESHES_H

#include <math.h>

#include "grid.h"

typedef double test_function(const double position[3]);

typedef struct test_mesh {
    int64_t vertex_count, cell_count, connectivity_count;
    double *coordinates;                         /* vertex_count × 3 elements */
    double *values;                              /* vertex_count elements */
    int64_t *offsets;                            /* cell_count + 1 elements */
    int64_t *connectivity;                       /* vertices of each cell; for polyhedra its faces */
    int64_t face_count, face_connectivity_count; /* 0 if there are no polyhedra */
    int64_t *face_offsets;                       /* face_count + 1 elements; NULL if there are no polyhedra */
    int64_t *face_connectivity;
    unsigned char *types;  /* cell_count elements: VTK's numbers of cell types */
    unsigned char *ghosts; /* cell_count elements, initially 0 */
} test_mesh;

typedef enum test_mesh_kind {
    TEST_TETS,      /* six tets per cube, around its main diagonal; conforming */
    TEST_HEXES,     /* faces are warped if the lattice is jittered */
    TEST_WEDGES,    /* two wedges per cube */
    TEST_PYRAMIDS,  /* six pyramids per cube, around its centre */
    TEST_POLYHEDRA, /* each joins one to six tets of the tet lattice; concave, some are not star-shaped */
    /* hexes, wedges, pyramids and tets, conforming: every second cube is a hex, wedges or tets; the other cubes consist
     * of pyramids and tets */
    TEST_MIXED,
    TEST_KIND_COUNT
} test_mesh_kind;

const char *test_mesh_kind_name(test_mesh_kind kind);

/* Divides the cube [-1, 1]^3 into n^3 cubes. Inner vertices are moved along each axis by up to jitter of a cube's side,
 * by a hash of the vertex's lattice index. Values are those of f. */
void test_mesh_make_lattice(test_mesh_kind kind, int n, double jitter, test_function *f, test_mesh *out);

typedef enum test_cell_shape {
    TEST_UNIT_TET,
    TEST_UNIT_HEX,
    TEST_UNIT_WEDGE,
    TEST_UNIT_PYRAMID,
    TEST_SLIVER_TET,     /* thickness 1e-4 */
    TEST_WARPED_HEX,     /* no face is plane */
    TEST_TWISTED_HEX,    /* the upper quad is rotated by 50 degrees */
    TEST_HEX_AS_WEDGE,   /* two pairs of equal vertices */
    TEST_HEX_AS_PYRAMID, /* the upper quad is a single vertex */
    TEST_FLAT_TET,       /* zero volume */
    TEST_FLAT_HEX,       /* zero volume */
    TEST_POINT_HEX,      /* all vertices equal */
    TEST_SHAPE_COUNT
} test_cell_shape;

const char *test_cell_shape_name(test_cell_shape shape);

void test_mesh_make_single_cell(test_cell_shape shape, test_function *f, test_mesh *out);

typedef enum test_polyhedron_shape {
    TEST_L_PRISM,     /* the base is a hexagon with a concave corner */
    TEST_U_PRISM,     /* not star-shaped, and its centre is outside; a ray may enter it twice */
    TEST_SPIKES,      /* an octahedron with a spike on every face; concave but star-shaped */
    TEST_BENT_SPIKES, /* spikes are bent over; not star-shaped */
    TEST_CAVITY,      /* a cube with a cubic cavity inside */
    TEST_POLYHEDRON_COUNT
} test_polyhedron_shape;

const char *test_polyhedron_name(test_polyhedron_shape shape);

void test_mesh_make_polyhedron(test_polyhedron_shape shape, test_function *f, test_mesh *out);

/* Stores cells of the four types as polyhedra with the same vertices and faces. Neighbours share faces. share: fraction
 * of cells that become polyhedra, chosen by a hash; 1 means all cells. */
void test_mesh_to_polyhedra(test_mesh *mesh, double share);

void test_mesh_set_values(test_mesh *mesh, test_function *f);
void test_mesh_free(test_mesh *mesh);

/* Rounds coordinates and values to float32, so that they are the same in layouts of both widths. */
void test_mesh_round_to_float(test_mesh *mesh);

/* Reorders the vertices of each cell to those of the cell's mirror image, which makes the cell left-handed. With
 * every_second, half of the cells, chosen by a hash, are reordered. */
void test_mesh_mirror_cells(test_mesh *mesh, bool every_second);

/* Changes the order of the cells and of the vertices but neither geometry nor field. */
void test_mesh_shuffle_cells(test_mesh *mesh, uint64_t seed);

/* Reorders each cell's vertices by a random symmetry of its type (rotations and mirror images). A face begins at
 * another vertex and may have the opposite orientation, and a polyhedron's faces are in another order. Geometry and
 * field do not change. */
void test_mesh_reorder_vertices(test_mesh *mesh, uint64_t seed);

/* Replaces each position by position * scale + offset. */
void test_mesh_transform(test_mesh *mesh, double scale, const double offset[3]);

typedef enum test_partition_kind {
    TEST_BLOCK,
    TEST_RANDOM,
    TEST_CHECKERBOARD,
    TEST_PARTITION_COUNT
} test_partition_kind;

const char *test_partition_kind_name(test_partition_kind kind);

/* Assigns each cell to a rank: TEST_BLOCK: slabs along x; TEST_RANDOM: by a hash of the cell; TEST_CHECKERBOARD: cubes
 * of side 2 / n in turn. owners has cell_count elements. */
void test_partition_cells(const test_mesh *mesh, test_partition_kind kind, int n, int ranks, int *owners);

/* Makes a mesh of the cells of one rank. Its vertices are numbered anew. */
void test_mesh_extract_part(const test_mesh *mesh, const int *owners, int rank, test_mesh *out);

typedef struct test_layout {
    bool wide_coordinates, wide_indices, wide_values; /* whether elements have 8 bytes instead of 4 */
    /* whether coordinates are stored as xyzxyz... and a NaN follows each value */
    bool is_interleaved;
    /* whether types and offsets are stored although all cells have the same type */
    bool with_types;
} test_layout;

typedef struct test_view {
    grid cells;
    grid_field field;
    void *storage[8];
} test_view;

/* Creates a view with its own copy of the arrays, so that the mesh may be freed. */
void test_view_create(const test_mesh *mesh, test_layout layout, test_view *out);
void test_view_free(test_view *view);

/* Returns sin 6x cos 6y + sin 6y cos 6z + sin 6z cos 6x. */
double test_wave_field(const double position[3]);
/* Returns 0.3 x - 0.7 y + 0.5 z + 0.1. Every cell represents this field exactly. */
double test_linear_field(const double position[3]);

/* Returns the larger of two errors. NaN counts as infinite, so that a later error does not replace it. */
static inline double test_larger_error(double worst, double off)
{
    return off <= worst ? worst : off == off ? off : (double)INFINITY;
}

/* Returns a uniform number in [0, 1) for an index and a seed. */
double test_uniform(uint64_t index, uint64_t seed);
/* Returns a uniform number in [low, high) for an index and a seed. */
double test_uniform_between(uint64_t index, uint64_t seed, double low, double high);

#endif
