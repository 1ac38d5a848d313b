/* Compares isosurfaces of polyhedra with those of the tets of which each polyhedron consists: the tets between the
 * triangles of its faces and its centre. The field is linear on each tet. */
#ifndef TEST_OWN_TETS_H
#define TEST_OWN_TETS_H

#include "test_meshes.h"

/* Makes a mesh of the tets of all polyhedra of a mesh. The cells' centres become new vertices. If a cell is not
 * star-shaped, its tets overlap: the cell becomes a ghost and has no tets. Returns the number of these cells. */
int64_t test_mesh_split_polyhedra(test_mesh *mesh, test_mesh *out);

typedef struct own_tets_tally {
    int64_t pixels; /* number of pixels that show the surface of the tets */
    /* number of these pixels in which the surface of the polyhedra is missing or more than 1e-3 cells off */
    int64_t missing;
    int64_t added;   /* number of pixels with a surface of the polyhedra but none of the tets */
    int64_t in_band; /* number of pixels excluded because their result may depend on rounding */
    int64_t ghosts;  /* number of cells that are not star-shaped */
} own_tets_tally;

/* Draws the isosurface in both meshes, which fill [-1, 1]^3, and compares each pixel. cell_size: size of a cell, as in
 * fixture_create(). */
own_tets_tally compare_with_split_tets(test_mesh *polyhedra, double cell_size, double value, int width, int height);

#endif
