/* A tile under way: its rays, and what its blocks know. Packets are set up when the first cell comes to their block. */
#ifndef RENDER_KERNEL_TILE_TRACE_H
#define RENDER_KERNEL_TILE_TRACE_H

#include <math.h>

#include "kernel_hits.h"
#include "kernel_packet.h"
#include "kernel_tile.h"
#include "kernel_types.h"
#include "simd.h"

typedef struct kernel_tile_trace {
    const kernel_frame *frame;
    kernel_thread *thread;
    kernel_tile tile;
    kernel_planes tree_planes, tile_planes;
    unsigned wanted; /* blocks that have pixels to trace */
    unsigned begun;  /* blocks whose packets are set up */
    int turn;        /* of volumes (kernel_clip.h) */
    float t_near;
    vf far[KERNEL_BLOCKS / SIMD_WIDTH]; /* each block's farthest t_far */
    /* of the surface under way */
    const kernel_surface *surface;
    int layer;
    struct kernel_cell *cell;
    struct kernel_poly *poly;
    kernel_packet packets[KERNEL_TILE_PACKETS]; /* block by block */
    kernel_hits hits[KERNEL_TILE_PACKETS];
} kernel_tile_trace;

/* Blocks that know of nothing before the depth. */
SIMD_INLINE unsigned kernel_blocks_beyond(const kernel_tile_trace *t, float near)
{
    unsigned bits = 0;
    for (int v = 0; v < KERNEL_BLOCKS / SIMD_WIDTH; v++)
        bits |= vm_bits(vf_le(vf_set(near), t->far[v])) << v * SIMD_WIDTH;
    return bits;
}

SIMD_INLINE void kernel_block_begin(kernel_tile_trace *t, int block)
{
    if (t->begun >> block & 1) return;
    if (!t->begun) kernel_tile_rays(&t->tile, t->frame);
    t->begun |= 1u << block;
    const int x = t->tile.x0 + block % KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK;
    const int y = t->tile.y0 + block / KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK;
    const int across = KERNEL_BLOCK / KERNEL_PACKET_COLUMNS;
    for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
        const int i = block * KERNEL_BLOCK_PACKETS + n;
        kernel_packet_begin(&t->packets[i], t->frame, &t->tile, t->thread, x + n % across * KERNEL_PACKET_COLUMNS,
                            y + n / across * KERNEL_PACKET_ROWS);
        if (t->frame->needs_packets) kernel_packet_complete(&t->packets[i]);
        kernel_hits_begin(&t->hits[i]);
    }
}

/* The farthest of what the block's rays know. */
SIMD_INLINE float kernel_block_far(const kernel_tile_trace *t, int block)
{
    vf far = vf_set(-INFINITY);
    for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
        const kernel_packet *p = &t->packets[block * KERNEL_BLOCK_PACKETS + n];
        far = vf_max(far, vf_select(p->active, p->t_far, vf_set(-INFINITY)));
    }
    return vf_reduce_max(far);
}

/* Blocks in which a body of this outline may show. */
SIMD_INLINE unsigned kernel_tile_keep(const kernel_tile_trace *t, const kernel_outline *outline, unsigned blocks)
{
    const kernel_placement placement = kernel_outline_placement(&t->tile_planes, outline);
    if (placement.far < t->t_near) return 0;
    return blocks & placement.blocks & kernel_blocks_beyond(t, placement.near);
}

/* The farthest that a block knows of. */
SIMD_INLINE float kernel_tile_far(const kernel_tile_trace *t)
{
    const unsigned lanes = (1u << SIMD_WIDTH) - 1;
    vf far = vf_set(-INFINITY);
    for (int v = 0; v < KERNEL_BLOCKS / SIMD_WIDTH; v++) {
        const vm wanted = vm_from_bits(t->wanted >> v * SIMD_WIDTH & lanes);
        far = vf_max(far, vf_select(wanted, t->far[v], vf_set(-INFINITY)));
    }
    return vf_reduce_max(far);
}

SIMD_INLINE void kernel_tile_begin(kernel_tile_trace *t, const kernel_frame *f, kernel_thread *thread, int x0, int y0,
                                   unsigned wanted)
{
    t->frame = f;
    t->thread = thread;
    t->wanted = wanted;
    t->begun = 0;
    t->t_near = (float)-f->depth_shift;
    for (int v = 0; v < KERNEL_BLOCKS / SIMD_WIDTH; v++) t->far[v] = vf_set(INFINITY);
    kernel_tile_setup(&t->tile, f, x0, y0);
    if (!f->needs_planes) return;
    kernel_borders borders;
    kernel_tile_borders(&borders, f, &t->tile);
    kernel_tree_planes(&t->tree_planes, f, &borders);
    kernel_tile_planes(&t->tile_planes, f, &t->tile);
}

#endif
