/* Finds which of a tile's blocks a tet's outline meets, one block per lane. The outline's bounding box
 * (kernel_points_placement()) also covers blocks beside its slanted edges; with it alone, two of five packets would be
 * traced for nothing.
 *
 * An edge function is affine over the tile (kernel_cell.h), so that over a block it is its value at the block's middle,
 * plus or minus its slopes times half of the extent of the block's rays. If in a block no face can have its three edge
 * functions' signs as on a ray that crosses it, no ray of the block crosses the tet. */
#ifndef RENDER_KERNEL_TILE_BLOCKS_H
#define RENDER_KERNEL_TILE_BLOCKS_H

#include <math.h>

#include "kernel_cell.h"
#include "kernel_shapes.h"
#include "kernel_tile.h"
#include "kernel_types.h"
#include "simd.h"

enum { KERNEL_BLOCK_VECTORS = KERNEL_BLOCKS / SIMD_WIDTH };

/* The (u, v) at the middle of each block, and half of their extent in a block. */
typedef struct kernel_block_rays {
    vf u[KERNEL_BLOCK_VECTORS], v[KERNEL_BLOCK_VECTORS];
    float half_u, half_v;
} kernel_block_rays;

/* Sets up the blocks of a tile whose rays are set. The half extents are those of the widest block, plus a thousandth
 * for all rounding. */
static inline void kernel_block_rays_setup(kernel_block_rays *r, const kernel_frame *f, const kernel_tile *tile)
{
    const bool flat = f->job->camera.is_orthographic;
    const float *u = flat ? tile->origin_x : tile->slope_x, *v = flat ? tile->origin_y : tile->slope_y;
    float middle[2][KERNEL_BLOCKS];
    r->half_u = r->half_v = 0;
    for (int b = 0; b < KERNEL_BLOCKS; b++) {
        const int column = b % KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK, row = b / KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK;
        const float *first_u = u + column, *first_v = v + row;
        middle[0][b] = 0.5f * (first_u[0] + first_u[KERNEL_BLOCK - 1]);
        middle[1][b] = 0.5f * (first_v[0] + first_v[KERNEL_BLOCK - 1]);
        r->half_u = fmaxf(r->half_u, 0.5005f * fabsf(first_u[KERNEL_BLOCK - 1] - first_u[0]));
        r->half_v = fmaxf(r->half_v, 0.5005f * fabsf(first_v[KERNEL_BLOCK - 1] - first_v[0]));
    }
    for (int n = 0; n < KERNEL_BLOCK_VECTORS; n++) {
        r->u[n] = vf_load(middle[0] + n * SIMD_WIDTH);
        r->v[n] = vf_load(middle[1] + n * SIMD_WIDTH);
    }
}

/* Returns the blocks that may have a ray inside the tet, whose edge functions must be set. The middle's edge function
 * errs by at most as much as a ray's; for rays on which the sign is uncertain, or is computed from projected vertices,
 * it is decided within the same bound: twice the bound is more than both together. If a number is NaN, the block counts
 * as met. */
SIMD_INLINE unsigned kernel_tet_blocks(const kernel_block_rays *r, const kernel_cell *c)
{
    unsigned blocks = 0;
    for (int i = 0; i < KERNEL_BLOCK_VECTORS; i++) {
        vm above[KERNEL_TET_EDGES], below[KERNEL_TET_EDGES], met = vm_none();
        for (int n = 0; n < KERNEL_TET_EDGES; n++) {
            const kernel_line *l = &c->lines[n];
            const float reach = fabsf(l->cu) * r->half_u + fabsf(l->cv) * r->half_v + 2 * l->bound;
            const vf e = vf_muladd(vf_set(l->cv), r->v[i], vf_muladd(vf_set(l->cu), r->u[i], vf_set(l->c)));
            above[n] = vm_not(vf_lt(e, vf_set(-reach)));
            below[n] = vm_not(vf_lt(vf_set(reach), e));
        }
        for (int n = 0; n < 4; n++) { /* a ray that lies on the same side of all three edges of a face crosses it */
            const signed char *edge = kernel_tet_face[n] + 3;
            met = vm_or(met, vm_and(vm_and(above[edge[0]], above[edge[1]]), below[edge[2]]));
            met = vm_or(met, vm_and(vm_and(below[edge[0]], below[edge[1]]), above[edge[2]]));
        }
        blocks |= vm_bits(met) << i * SIMD_WIDTH;
    }
    return blocks;
}

#endif
