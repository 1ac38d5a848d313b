/* Stores a packet's hits on surfaces: the nearest opaque hit of each ray, and its crossings of transparent surfaces. */
#ifndef RENDER_KERNEL_HITS_H
#define RENDER_KERNEL_HITS_H

#include <math.h>

#include "simd.h"

/* Maximum number of crossings of transparent surfaces that are stored per ray. Volume fragments are split at these
 * crossings. */
enum { KERNEL_MAX_CUTS = 32 };

typedef struct kernel_hits {
    vm found;
    /* A vector of any length parallel to the field's gradient at the hit, in camera axes. If normals are interpolated
     * from vertices (RENDER_VERTEX), this member holds the hit's reference coordinates in its cell instead, until the
     * normal is computed at the end of the tile. */
    vf normal[3];
    /* The cell that each ray has hit: index of the mesh part, and of the cell in the part; set only if normals are
     * interpolated from vertices (RENDER_VERTEX). If `part` is -1, the cell is not needed, because the hit's normal has
     * been computed or there is no hit. */
    vi part, cell;
    vf colour[3]; /* colour of each hit before lighting */
    /* distance from the hit, in scaled units, at which the field is sampled for central differences; set only if
     * normals come from differences */
    vf reach;
    vf kind;
    /* number of entries of `cut` in use: the largest number of crossings that a ray has; 0 if the frame has no
     * volumes */
    int cut_count;
    /* Depths t at which the rays cross transparent surfaces. cut[n] has, for each ray, the n-th crossing that was found
     * (n = 0, 1, ...), or +inf if the ray has no further crossing. The crossings of a ray are not sorted by depth. */
    vf cut[KERNEL_MAX_CUTS];
    vm overflowed; /* rays with more than KERNEL_MAX_CUTS crossings; the excess crossings are not stored */
} kernel_hits;

static inline void kernel_hits_begin(kernel_hits *hits)
{
    hits->found = hits->overflowed = vm_none();
    hits->cut_count = 0;
    hits->kind = hits->reach = vf_set(0);
    hits->part = hits->cell = vi_set(-1);
    for (int a = 0; a < 3; a++) hits->normal[a] = hits->colour[a] = vf_set(0);
}

/* Adds a crossing at t to the ray in lane `ray`. Each ray fills its own lane from cut[0] on, whatever the other rays of
 * the packet do. So the depths at which a ray's fragments are split do not depend on the other rays. */
static inline void kernel_hits_add_crossing(kernel_hits *hits, int ray, float t)
{
    int n = 0;
    while (n < hits->cut_count && hits->cut[n][ray] < INFINITY) n++;
    if (n == KERNEL_MAX_CUTS) {
        vm_set_lane(&hits->overflowed, ray);
        return;
    }
    if (n == hits->cut_count) hits->cut[hits->cut_count++] = vf_set(INFINITY);
    hits->cut[n][ray] = t;
}

#endif
