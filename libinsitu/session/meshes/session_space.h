/* Where everything lies: global bounds, and the origin and scale of float32 numbers; the same on every rank. */
#ifndef SESSION_SPACE_H
#define SESSION_SPACE_H

#include <mpi.h>

#include "session_mesh.h"

/* Global bounds of the drawn cells and what follows from them. */
typedef struct session_extent {
    double lower[3], upper[3]; /* both 0 where there are no cells */
    double half_diagonal;
    int64_t cell_count;  /* drawn ones */
    int64_t solid_count; /* cells that have a volume */
    double cell_size;    /* mean cube root of the volumes of solid cells; 0 if there are none */
    int rank_count;      /* ranks that have some */
} session_extent;

/* The axis that flat data is flat along, the last of several; -1 if the data is not flat: if it has cells with a
 * volume, or if it is more than 1e-6 as wide along each axis as along the widest. That is some sixteen roundings of
 * float32, and a thirtieth of a pixel of the widest picture. Local; the same on every rank. */
int session_flat_axis(const session_extent *extent);

typedef struct session_space {
    bool has_extent, has_origin; /* by a step before this one */
    session_extent extent;
    double lower[3], upper[3]; /* bounds for which origin and scale were chosen */
    double origin[3], scale;
} session_space;

/* Global bounds of checked meshes, then origin and scale; where these are new, trees are dropped. Collective. */
insitu_status session_update_space(session_space *space, session_meshes *meshes, MPI_Comm comm, base_error *error);

#endif
