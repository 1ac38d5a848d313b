/* Meshes of higher-order cells: a cube of smaller cubes, straight or bent, with nodes in any order that the public
 * header names. The test computes node positions by itself, not by the library: from lists of the corners between which
 * each node is, or by loops over lexicographic nodes. */
#ifndef TEST_MESH_ORDER_H
#define TEST_MESH_ORDER_H

#include <stdint.h>

#include "insitu/insitu.h"

/* A cell type with an order of its nodes. */
typedef struct order_kind {
    const char *name;
    insitu_cell_type type;
    insitu_vertex_order layout;
    int order;
} order_kind;

extern const order_kind order_kinds[];
extern const int order_kind_count;

/* The cells of one rank and the vertices that they use. */
typedef struct order_mesh {
    int nodes; /* number of nodes of each cell */
    int64_t vertex_count, cell_count;
    double *coordinates; /* vertices x 3 */
    double *values;      /* one value for each vertex */
    int64_t *connectivity;
    insitu_mesh mesh;
    insitu_field field; /* "f" at vertices */
} order_mesh;

typedef double order_function(const double point[3]);

/* Fields: the squared distance from the origin, a wave, and a linear field that is not aligned with an axis. */
double order_sphere_field(const double point[3]);
double order_wave_field(const double point[3]);
double order_plane_field(const double point[3]);

/* Divides the cube [-1, 1]^3 into side^3 cubes with cells of the given kind. Cells are assigned to the ranks in turn,
 * and the mesh has those of `rank`. bend: distance by which vertices inside and on the faces of the cube are moved. */
void order_mesh_create(const order_kind *kind, int side, double bend, order_function *value, int rank, int ranks,
                       order_mesh *out);

/* Returns the coordinate along an axis to which order_mesh_create() moves a point of the cube. */
double order_mesh_move_coordinate(double bend, const double point[3], int axis);

/* Returns the mesh of linear hexes between the nodes of lexicographic hexes of order p. The caller frees its
 * connectivity; all other arrays belong to the original mesh. */
order_mesh order_mesh_make_linear_hexes(const order_mesh *of, int p);
void order_mesh_free(order_mesh *mesh);

#endif
