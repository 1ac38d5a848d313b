/* Sends the finished pixels of all owners to rank 0. */
#ifndef COMP_COMP_GATHER_H
#define COMP_COMP_GATHER_H

#include "comp_grid.h"
#include "comp_mail.h"
#include "image.h"

/* Owners send up a tree of places: within a node to its first place, among nodes in a heap of COMP_GATHER_FAN children
 * each. A route that knows no nodes takes each rank for one. */
enum { COMP_GATHER_FAN = 64 };

/* The place to which a place >= 1 sends, and how many places send to one. */
int comp_gather_parent(const comp_route *route, int place);
int comp_gather_children(const comp_route *route, int place);

/* What rank 0 stores pixels in, and around them. */
typedef struct comp_canvas {
    const comp_grid *grid;
    const float *background; /* 4 */
    image *out;
} comp_canvas;

/* Collective. Rank 0 stores what the others send on the canvas; its own pixels are there already. finished are a rank's
 * messages to its parent, which are freed. status is this rank's so far; if it is an error, the rank sends no pixels of
 * its own. Allocates nothing. Returns this rank's own status. */
insitu_status comp_gather(comp_mailroom *room, const comp_route *route, const comp_canvas *canvas,
                          comp_messages *finished, insitu_status status, base_error *error);

#endif
