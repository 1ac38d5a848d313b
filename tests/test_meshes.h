/* Meshes whose answers are known: jittered lattices of every cell kind, single cells good and bad, and what tests
 * do to them: mirror, renumber, cut into the parts of ranks. Shared by the tests and the benchmarks; knows grids only.
 *
 * A test_mesh is double and int64 throughout and owns its arrays; a test_view shows it as a grid in a chosen layout.
 * All numbers come from a fixed hash, so that every machine has the same mesh. Running out of memory ends the process.
 */
#ifndef TEST_MESHES_H
#define TEST_MESHES_H

#include <math.h>

#include "grid.h"

typedef double test_function(const double position[3]);

typedef struct test_mesh {
    int64_t vertex_count, cell_count, connectivity_count;
    double *coordinates;                         /* vertex_count × 3 */
    double *values;                              /* vertex_count */
    int64_t *offsets;                            /* cell_count + 1 */
    int64_t *connectivity;                       /* vertices; of polyhedra faces */
    int64_t face_count, face_connectivity_count; /* 0 where there are no polyhedra */
    int64_t *face_offsets;                       /* face_count + 1; NULL as well */
    int64_t *face_connectivity;
    unsigned char *types;  /* cell_count, VTK's ids */
    unsigned char *ghosts; /* cell_count, 0 at first */
} test_mesh;

typedef enum test_mesh_kind {
    TEST_TETS,      /* six conforming tets a cube, about its main diagonal */
    TEST_HEXES,     /* with warped faces, where jittered */
    TEST_WEDGES,    /* two a cube */
    TEST_PYRAMIDS,  /* six a cube, about its centre */
    TEST_POLYHEDRA, /* one to six tets of the tets' lattice grown together: concave, and not all star-shaped */
    TEST_MIXED, /* all four others, conforming: every second cube a hex, wedges or tets, those between of pyramids and
                   tets */
    TEST_KIND_COUNT
} test_mesh_kind;

const char *test_mesh_kind_name(test_mesh_kind kind);

/* The cube [-1, 1]^3 as n^3 cubes. Inner vertices are moved by up to jitter of a cube's side along each axis, by a hash
 * of the vertex's lattice index. */
void test_mesh_lattice(test_mesh_kind kind, int n, double jitter, test_function *f, test_mesh *out);

typedef enum test_cell_shape {
    TEST_UNIT_TET,
    TEST_UNIT_HEX,
    TEST_UNIT_WEDGE,
    TEST_UNIT_PYRAMID,
    TEST_SLIVER_TET,     /* 1e-4 thick */
    TEST_WARPED_HEX,     /* no face plane */
    TEST_TWISTED_HEX,    /* the upper quad turned by 50 degrees */
    TEST_HEX_AS_WEDGE,   /* two pairs of equal vertices */
    TEST_HEX_AS_PYRAMID, /* the upper quad one vertex */
    TEST_FLAT_TET,       /* zero volume */
    TEST_FLAT_HEX,       /* zero volume */
    TEST_POINT_HEX,      /* all vertices equal */
    TEST_SHAPE_COUNT
} test_cell_shape;

const char *test_cell_shape_name(test_cell_shape shape);

void test_mesh_single(test_cell_shape shape, test_function *f, test_mesh *out);

typedef enum test_polyhedron_shape {
    TEST_L_PRISM,     /* the base a hexagon with a corner cut out */
    TEST_U_PRISM,     /* not star-shaped, and the centre outside; a ray may enter twice */
    TEST_SPIKES,      /* an octahedron with a spike on every face: concave, star-shaped */
    TEST_BENT_SPIKES, /* the spikes bent over: not star-shaped */
    TEST_CAVITY,      /* a cube with a cube cut out of its inside */
    TEST_POLYHEDRON_COUNT
} test_polyhedron_shape;

const char *test_polyhedron_name(test_polyhedron_shape shape);

void test_mesh_polyhedron(test_polyhedron_shape shape, test_function *f, test_mesh *out);

/* Make cells of the four types into polyhedra with the same vertices and faces, shared between them: a share of them
 * chosen by a hash, 1 for all. */
void test_mesh_to_polyhedra(test_mesh *mesh, double share);

void test_mesh_set_values(test_mesh *mesh, test_function *f);
void test_mesh_free(test_mesh *mesh);

/* Round coordinates and values to float32, so that layouts of both widths say the same. */
void test_mesh_round(test_mesh *mesh);

/* Turn every cell (or, with every_second, a half chosen by hash) into its mirror image's vertex order: left-handed. */
void test_mesh_mirror(test_mesh *mesh, bool every_second);

/* Another order of the cells and of the vertices. The same geometry and field. */
void test_mesh_shuffle(test_mesh *mesh, uint64_t seed);

/* Reorders each cell's vertices by a random symmetry of its kind (rotations and mirrors); faces begin at another vertex
 * and run the other way, and a polyhedron's faces are in another order. Geometry and field stay the same. */
void test_mesh_reorder_vertices(test_mesh *mesh, uint64_t seed);

/* position * scale + offset. */
void test_mesh_transform(test_mesh *mesh, double scale, const double offset[3]);

typedef enum test_partition_kind {
    TEST_BLOCK,
    TEST_RANDOM,
    TEST_CHECKERBOARD,
    TEST_PARTITION_COUNT
} test_partition_kind;

const char *test_partition_kind_name(test_partition_kind kind);

/* owners (cell_count) gets each cell's rank: slabs along x, a hash of the cell, or cubes of side 2 / n in turn. */
void test_partition(const test_mesh *mesh, test_partition_kind kind, int n, int ranks, int *owners);

/* The cells of one rank with vertices of its own numbering. */
void test_mesh_part(const test_mesh *mesh, const int *owners, int rank, test_mesh *out);

typedef struct test_layout {
    bool wide_coordinates, wide_indices, wide_values; /* 8-byte elements */
    bool is_interleaved;                              /* coordinates xyzxyz..., values with a NaN after each */
    bool with_types;                                  /* types and offsets given although all cells are of one kind */
} test_layout;

typedef struct test_view {
    grid cells;
    grid_field field;
    void *storage[8];
} test_view;

/* Copies: the mesh may be freed. */
void test_view_create(const test_mesh *mesh, test_layout layout, test_view *out);
void test_view_free(test_view *view);

/* sin 6x cos 6y + sin 6y cos 6z + sin 6z cos 6x */
double test_wave(const double position[3]);
/* 0.3 x - 0.7 y + 0.5 z + 0.1, exact on every cell */
double test_linear(const double position[3]);

/* The larger error. What is not a number counts as infinite, so that no later one hides it. */
static inline double test_worse(double worst, double off)
{
    return off <= worst ? worst : off == off ? off : (double)INFINITY;
}

/* A uniform number in [0, 1) of an index and a seed. */
double test_uniform(uint64_t index, uint64_t seed);
/* As above, in [low, high). */
double test_uniform_in(uint64_t index, uint64_t seed, double low, double high);

#endif
