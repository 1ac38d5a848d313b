/* The lattice (structured grid) that the uniform blocks of a mesh have in common on all ranks. Conduit nodes state the
 * position of each block in floating point. However, equal vertices of different blocks are recognized by bitwise equal
 * coordinates, so that all blocks must compute their coordinates from one origin (insitu_lattice). Conduit nodes state
 * levels of refinement only as numbers, so that the refinement ratios must be computed from the spacings of all
 * blocks. */
#ifndef BLUEPRINT_LATTICE_H
#define BLUEPRINT_LATTICE_H

#include "blueprint_mesh.h"

/* A uniform block as its node describes it. */
typedef struct uniform_block {
    insitu_lattice lattice;
    bool exists;               /* false if the mesh is not uniform */
    bool has_first, has_level; /* as in blueprint_mesh (blueprint_mesh.h) */
} uniform_block;

typedef struct common_lattice {
    double origin[3];              /* smallest origin of the blocks with the coarsest spacing, for each axis */
    double coarsest[3], finest[3]; /* absolute values of the spacing; 0: no block has cells along this axis */
} common_lattice;

typedef struct named_lattice {
    uint64_t mesh; /* hash of the mesh's name */
    common_lattice common;
} named_lattice;

typedef struct named_lattices {
    named_lattice *items;
    int count;
} named_lattices;

/* Returns the mesh as a uniform block that has not been placed on a common lattice yet. */
uniform_block describe_uniform_block(const blueprint_mesh *mesh);

/* Extends the mesh's common lattice by a block; adds the mesh if it is not in the list. Returns false if memory runs
 * out. */
bool named_lattices_add(named_lattices *list, uint64_t mesh, const uniform_block *block);

const common_lattice *named_lattices_find(const named_lattices *list, uint64_t mesh);
bool named_lattices_are_same(const named_lattices *a, const named_lattices *b);
void named_lattices_free(named_lattices *list);

/* Combines the lists of all ranks: *out receives the meshes of this rank's list, each with the lattice that contains
 * the blocks of all ranks. Returns false on all ranks if memory runs out on one, or if MPI returns an error.
 * Collective. */
bool named_lattices_agree(MPI_Comm comm, const named_lattices *own, named_lattices *out);

/* Returns the block's description on the common lattice. If the block does not fit this lattice, the description is
 * returned unchanged. *is_level is set to false if the block needs a refinement ratio that could not be computed. */
insitu_lattice uniform_block_place(const uniform_block *block, const common_lattice *common, bool *is_level);

#endif
