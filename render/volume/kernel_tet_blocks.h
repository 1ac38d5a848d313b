/* Determines which of a tile's blocks a tet's outline overlaps, for all blocks at once: each lane is a block. The box
 * of the tet's pixels overlaps more blocks, because the tet's edges are slanted; two of five packets would be traced in
 * vain.
 *
 * An edge function is affine over the tile's rays (kernel_cell.h). On any ray of a block it therefore differs from its
 * value at the block's middle by no more than its slopes times half of the block's width and height. A ray can cross a
 * face only if the signs of the face's three edge functions allow it (kernel_rays_inside_triangle()). A block in which
 * no face can have such signs has no ray that crosses the tet. */
#ifndef RENDER_KERNEL_TET_BLOCKS_H
#define RENDER_KERNEL_TET_BLOCKS_H

#include <math.h>

#include "kernel_shapes.h"
#include "kernel_tile.h"
#include "kernel_transformed_tets.h"
#include "kernel_types.h"
#include "simd.h"

enum { KERNEL_BLOCK_VECTORS = KERNEL_BLOCKS / SIMD_WIDTH };

/* The parameters (u, v) of the rays through the middles of the tile's blocks, and half of the largest width and height
 * of a block in these parameters. */
typedef struct kernel_block_rays {
    vf u[KERNEL_BLOCK_VECTORS], v[KERNEL_BLOCK_VECTORS];
    float half_u, half_v;
} kernel_block_rays;

/* Computes the blocks' rays from those of the tile. The half widths and heights are enlarged by a factor of 1.001, so
 * that rounding excludes no ray of a block. */
static inline void kernel_block_rays_begin(kernel_block_rays *r, const kernel_frame *f, const kernel_tile *tile)
{
    const bool flat = f->job->camera.is_orthographic;
    const float *u = flat ? tile->origin_x : tile->slope_x, *v = flat ? tile->origin_y : tile->slope_y;
    float middle[2][KERNEL_BLOCKS];
    r->half_u = r->half_v = 0;
    for (int b = 0; b < KERNEL_BLOCKS; b++) {
        const float *first_u = u + b % KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK;
        const float *first_v = v + b / KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK;
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

/* Returns the blocks in which rays may cross the tet in the given lane. The edge function at a block's middle has a
 * rounding error of at most tets->bound of the edge. The edge function on a ray has a rounding error of at most the
 * same bound, whether it is computed from the line's coefficients or from projected vertices; hence twice the bound is
 * added. Comparisons with NaN keep the block. */
SIMD_INLINE unsigned kernel_tet_blocks(const kernel_block_rays *r, const kernel_transformed_tets *tets, int lane)
{
    unsigned blocks = 0;
    for (int i = 0; i < KERNEL_BLOCK_VECTORS; i++) {
        vm may_be_positive[KERNEL_TET_EDGES], may_be_negative[KERNEL_TET_EDGES], met = vm_none();
        for (int n = 0; n < KERNEL_TET_EDGES; n++) {
            const float c = tets->c[n][lane], cu = tets->cu[n][lane], cv = tets->cv[n][lane];
            const float reach = fabsf(cu) * r->half_u + fabsf(cv) * r->half_v + 2 * tets->bound[n][lane];
            const vf e = vf_muladd(vf_set(cv), r->v[i], vf_muladd(vf_set(cu), r->u[i], vf_set(c)));
            may_be_positive[n] = vm_not(vf_lt(e, vf_set(-reach)));
            may_be_negative[n] = vm_not(vf_lt(vf_set(reach), e));
        }
        for (int n = 0; n < 4; n++) {
            const signed char *edge = kernel_tet_face[n] + 3;
            const vm *up = may_be_positive, *down = may_be_negative;
            met = vm_or(met, vm_and(vm_and(up[edge[0]], up[edge[1]]), down[edge[2]]));
            met = vm_or(met, vm_and(vm_and(down[edge[0]], down[edge[1]]), up[edge[2]]));
        }
        blocks |= vm_bits(met) << i * SIMD_WIDTH;
    }
    return blocks;
}

#endif
