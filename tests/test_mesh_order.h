/* Cells of higher order in a cube of cubes, straight or bent, with their nodes in any order that the header names. The
 * places of nodes come from lists of the corners that they are between, or from loops, not from the library. */
#ifndef TEST_MESH_ORDER_H
#define TEST_MESH_ORDER_H

#include <stdint.h>

#include "insitu/insitu.h"

/* A kind of cell in an order of its nodes. */
typedef struct order_kind {
    const char *name;
    insitu_cell_type type;
    insitu_vertex_order layout;
    int order;
} order_kind;

extern const order_kind order_kinds[];
extern const int order_kind_count;

/* A rank's cells, with all vertices of the whole mesh that its cells use or not. */
typedef struct order_mesh {
    int nodes; /* of each cell */
    int64_t vertex_count, cell_count;
    double *coordinates; /* vertices x 3 */
    double *values;      /* of vertices */
    int64_t *connectivity;
    insitu_mesh mesh;
    insitu_field field; /* "f" at vertices */
} order_mesh;

typedef double order_function(const double point[3]);

/* The squared distance from the origin, a wave, and a plane that is not along the axes. */
double order_sphere_field(const double point[3]);
double order_wave_field(const double point[3]);
double order_plane_field(const double point[3]);

/* side^3 cubes of [-1, 1]^3, of the kind's cells; those of the rank, dealt one by one to so many ranks. bend: how far
 * vertices inside and on the faces of the cube are moved. */
void order_mesh_create(const order_kind *kind, int side, double bend, order_function *value, int rank, int ranks,
                       order_mesh *out);

/* Returns the coordinate of a point of the cube after the vertices have been moved. */
double order_mesh_make_moved(double bend, const double point[3], int axis);

/* Returns the linear hexes between the nodes of lexicographic hexes of order p, with connectivity of its own, which the
 * caller frees; the rest is the mesh's. */
order_mesh order_mesh_make_linear_hexes(const order_mesh *of, int p);
void order_mesh_free(order_mesh *mesh);

#endif
