/* The volume of a polyhedron. */
#ifndef SESSION_POLYHEDRON_H
#define SESSION_POLYHEDRON_H

#include "grid.h"

/* The volume: exact for cells that are star-shaped from their vertices' mean, else somewhat more; however faces are
 * listed the same but for rounding. Flat, of volume 0: in one plane, but for rounding. */
double session_polyhedron_volume(const grid *g, int64_t cell, bool *is_flat);

#endif
