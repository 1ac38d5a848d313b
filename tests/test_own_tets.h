/* Compares isosurfaces of polyhedra with those of the same field on the tets on which it is linear. */
#ifndef TEST_OWN_TETS_H
#define TEST_OWN_TETS_H

#include "test_meshes.h"

/* Makes the tets on the canonical triangles of a mesh's polyhedra, with the cells' centres as new vertices. The tets of
 * a cell that is not star-shaped overlap: such a cell becomes a ghost without tets. Returns the number of these
 * cells. */
int64_t test_mesh_split_polyhedra(test_mesh *mesh, test_mesh *out);

typedef struct own_tets_tally {
    int64_t pixels;  /* pixels that show the tets' surface */
    int64_t missing; /* of these, pixels in which the polyhedra's surface is missing or more than 1e-3 cells off */
    int64_t added;   /* pixels with a surface of the polyhedra but none of the tets */
    int64_t in_band; /* excluded: rays for which rounding may decide */
    int64_t ghosts;  /* cells that are not star-shaped */
} own_tets_tally;

/* Draws both meshes, which fill [-1, 1]^3, by robust roots at the isovalue, and compares each pixel; cell_size is that
 * of fixture_create(). */
own_tets_tally compare_with_split_tets(test_mesh *polyhedra, double cell_size, double value, int width, int height);

#endif
