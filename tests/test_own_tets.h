/* Isosurfaces of polyhedra against the same field on the tets that it is linear on. */
#ifndef TEST_OWN_TETS_H
#define TEST_OWN_TETS_H

#include "test_meshes.h"

/* Makes the tets on the canonical triangles of a mesh's polyhedra, with the cells' centres as new vertices. The tets of
 * a cell that is not star-shaped overlap: it becomes a ghost without tets. Returns how many such cells there are. */
int64_t test_own_tets(test_mesh *mesh, test_mesh *out);

typedef struct own_tets_tally {
    int64_t pixels;  /* that show the tets' surface */
    int64_t missing; /* of these, where the polyhedra's is not there, or more than 1e-3 cells off, */
    int64_t added;   /* or where there is one and none of the tets, */
    int64_t in_band; /* left out: rays of which rounding may decide */
    int64_t ghosts;  /* cells that are not star-shaped */
} own_tets_tally;

/* Draw both meshes, which fill [-1, 1]^3, by robust roots at the isovalue, and compare each pixel; cell_size as
 * fixture_create() has it. */
own_tets_tally own_tets_compare(test_mesh *polyhedra, double cell_size, double value, int width, int height);

#endif
