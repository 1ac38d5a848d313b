/* Sends the finished pixels of all owners to rank 0. */
#ifndef COMP_COMP_GATHER_H
#define COMP_COMP_GATHER_H

#include "comp_grid.h"
#include "comp_messages.h"
#include "image.h"

/* Owners send up a tree of places. Within a node every place sends to the node's first place; these form a heap with
 * COMP_GATHER_FAN children per node. Without information about nodes each rank counts as a node. */
enum { COMP_GATHER_FAN = 64 };

/* Return the place to which a place >= 1 sends, and the number of places that send to a place. */
int comp_gather_parent(const comp_route *route, int place);
int comp_gather_children(const comp_route *route, int place);

/* The picture in which rank 0 stores pixels, with its grid and background. */
typedef struct comp_canvas {
    const comp_grid *grid;
    const float *background; /* colour of the background: linear premultiplied RGBA */
    image *out;
} comp_canvas;

/* Rank 0 stores the pixels received from other ranks in the canvas, which contains its own pixels already. `finished`
 * are this rank's messages to its parent; they are freed. `status` is this rank's status before the call; if it is an
 * error, the rank sends no pixels of its own. Allocates nothing. Returns this rank's own status. Collective. */
insitu_status comp_gather(comp_transport *transport, const comp_route *route, const comp_canvas *canvas,
                          comp_messages *finished, insitu_status status, base_error *error);

#endif
