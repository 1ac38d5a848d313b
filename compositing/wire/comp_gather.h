/* Sends the finished pixels of all owners to rank 0. */
#ifndef COMP_COMP_GATHER_H
#define COMP_COMP_GATHER_H

#include "comp_grid.h"
#include "comp_messages.h"
#include "image.h"

/* Maximum number of children of a place in the gather tree, along which owners send their pixels to rank 0. The nodes
 * of this tree are places, which number the ranks so that those of a compute node are consecutive (comp_route.h).
 * Within a compute node, every place sends to the first place of this compute node. The first places of all compute
 * nodes form a heap, in which each has up to COMP_GATHER_FAN children. Without information about compute nodes, each
 * rank is treated as a compute node. */
enum { COMP_GATHER_FAN = 64 };

/* comp_gather_parent() returns the place to which the given place (>= 1) sends; comp_count_gather_children() returns
 * the number of places that send to the given place. */
int comp_gather_parent(const comp_route *route, int place);
int comp_count_gather_children(const comp_route *route, int place);

/* The picture in which rank 0 stores pixels, with its grid and background. */
typedef struct comp_canvas {
    const comp_grid *grid;
    const float *background; /* colour of the background: linear premultiplied RGBA */
    image *out;
} comp_canvas;

/* Rank 0 stores the pixels received from other ranks in the canvas, in which its own pixels are stored already.
 * `finished` are this rank's messages to its parent; the function frees them. `status` is this rank's status before the
 * call; if it is an error, the rank sends no pixels of its own. Allocates nothing. Returns this rank's own status.
 * Collective. */
insitu_status comp_gather(comp_transport *transport, const comp_route *route, const comp_canvas *canvas,
                          comp_messages *finished, insitu_status status, base_error *error);

#endif
