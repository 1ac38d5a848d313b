/* The global bounds, and the origin and scale of float32 coordinates. They are the same on every rank. */
#ifndef SESSION_SPACE_H
#define SESSION_SPACE_H

#include <mpi.h>

#include "session_mesh.h"

/* The bounds of the drawn cells of all ranks, and quantities derived from them. */
typedef struct session_extent {
    double lower[3], upper[3]; /* bounds of the drawn cells; both 0 if there are no cells */
    double half_diagonal;      /* half the diagonal of the bounds */
    int64_t cell_count;        /* number of drawn cells on all ranks */
    int64_t solid_count;       /* number of drawn cells that have a volume */
    /* mean of the cube roots of the volumes of the cells that have a volume; 0 if there are none */
    double cell_size;
    int rank_count; /* number of ranks with at least one drawn cell */
} session_extent;

/* Returns the axis along which the data is flat (the last such axis, if there are several), or -1 if the data is not
 * flat. The data is flat along an axis if no cell has a volume and the bounds' extent along the axis is at most 1e-6 of
 * their largest extent. This fraction of the extent is about 16 times the rounding error of a float32 coordinate, and
 * 1/30 of a pixel in the widest picture. Local; the result is the same on every rank. */
int session_flat_axis(const session_extent *extent);

typedef struct session_space {
    /* has_extent: set if the member `extent` has been computed; has_origin: set if `origin` and `scale` have been
     * chosen */
    bool has_extent, has_origin;
    session_extent extent;
    double lower[3], upper[3]; /* bounds for which the origin and the scale were chosen */
    double origin[3], scale;   /* the renderer's coordinates are (position - origin) * scale */
} session_space;

/* Computes the global bounds of checked meshes, then the origin and the scale. If the origin or the scale changes, all
 * trees are dropped. Collective. */
insitu_status session_update_space(session_space *space, session_meshes *meshes, MPI_Comm comm, base_error *error);

/* Computes the global bounds, numbers of cells and mean size of cells that would result if no mesh had finer lattices
 * (session_finer.h). Collective. */
insitu_status session_find_nodal_extent(const session_meshes *meshes, MPI_Comm comm, session_extent *out,
                                        base_error *error);

#endif
