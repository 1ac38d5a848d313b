/* Isosurfaces of a whole tile in one traversal: the tree is gone down once for all its blocks, with a mask of those
 * that a node may meet before what they already know to be nearer. A leaf's cells are fetched and placed once a tile,
 * narrowed down to the blocks that their surface may show in (kernel_outline.h), and given to these blocks' packets,
 * which are set up when the first cell comes to them. A tile without a surface costs its nodes alone. */
#ifndef RENDER_KERNEL_TILE_SURFACE_H
#define RENDER_KERNEL_TILE_SURFACE_H

#include "kernel_outline.h"
#include "kernel_surface.h"

typedef struct kernel_tile_trace {
    const kernel_frame *frame;
    kernel_thread *thread;
    kernel_tile tile;
    kernel_planes tree_planes, tile_planes;
    unsigned wanted; /* blocks that have pixels to trace */
    unsigned begun;  /* blocks whose packets are set up */
    float t_near;
    vf far[KERNEL_BLOCKS / SIMD_WIDTH]; /* each block's farthest t_far */
    /* of the surface under way */
    const kernel_surface *surface;
    int layer;
    kernel_cell cell;
    kernel_poly poly;
    kernel_packet packets[KERNEL_TILE_PACKETS]; /* block by block */
    kernel_hits hits[KERNEL_TILE_PACKETS];
} kernel_tile_trace;

typedef struct kernel_tile_entry {
    int64_t node;
    float near;
    unsigned blocks;
} kernel_tile_entry;

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

/* cell: NULL for a polyhedron, all of whose surfaces are meant. */
SIMD_INLINE void kernel_block_meet(kernel_tile_trace *t, int block, int part, uint32_t index, const kernel_cell *cell,
                                   int value)
{
    bool is_nearer = false;
    kernel_block_begin(t, block);
    for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
        const int i = block * KERNEL_BLOCK_PACKETS + n;
        kernel_packet *p = &t->packets[i];
        kernel_surface_state state = {.surface = t->surface,
                                      .layer = t->layer,
                                      .hits = &t->hits[i],
                                      .is_opaque = t->layer < t->frame->opaque_count};
        p->is_nearer = false;
        if (cell)
            kernel_cell_surface(p, &state, cell, &t->poly, value, p->active);
        else
            kernel_polyhedron_surfaces(p, &state, part, index, p->active);
        is_nearer = is_nearer || p->is_nearer;
    }
    if (is_nearer) t->far[block / SIMD_WIDTH][block % SIMD_WIDTH] = kernel_block_far(t, block);
}

SIMD_INLINE void kernel_tile_value(kernel_tile_trace *t, int part, int value, unsigned blocks)
{
    kernel_cell *c = &t->cell;
    kernel_outline outline;
    kernel_surface_prepare(t->frame, &t->tile, t->surface, part, value, c, &t->poly);
    if (c->type != GRID_TET)
        kernel_vertex_outline(c, &outline);
    else if (!kernel_tet_outline(c, &outline))
        return;
    const kernel_lie lie = kernel_outline_lie(&t->tile_planes, &outline);
    if (lie.far < t->t_near) return;
    blocks &= lie.blocks & kernel_blocks_beyond(t, lie.near);
    for (; blocks; blocks &= blocks - 1) kernel_block_meet(t, __builtin_ctz(blocks), part, c->index, c, value);
}

static void kernel_tile_leaf(kernel_tile_trace *t, int part, const uint32_t *cells, int count, unsigned blocks)
{
    const render_surface_layer *layer = t->surface->layer;
    kernel_cell *c = &t->cell;
    for (int n = 0; n < count; n++) {
        kernel_cell_fetch(c, t->frame->job->parts[part].cells, &layer->field.fields[part], cells[n]);
        if (c->type == GRID_POLYHEDRON) {
            for (unsigned left = blocks; left; left &= left - 1)
                kernel_block_meet(t, __builtin_ctz(left), part, cells[n], NULL, 0);
            continue;
        }
        if (!c->is_finite) continue;
        for (int value = 0; value < layer->value_count; value++)
            if (kernel_cell_straddles(c, layer->values[value])) kernel_tile_value(t, part, value, blocks);
    }
}

typedef void kernel_tile_visit(kernel_tile_trace *t, int part, const uint32_t *cells, int count, unsigned blocks);

/* Where the node may be met, of blocks: none where it does not show. interest NULL: everything shows. */
SIMD_INLINE kernel_lie kernel_tile_look(const kernel_tile_trace *t, const mmbvh *tree, const mmbvh_ranges *ranges,
                                        const kernel_interest *interest, int64_t node, unsigned blocks)
{
    kernel_lie lie = {0};
    if (interest && !kernel_node_shows(interest, ranges, node)) return lie;
    lie = kernel_box_lie(&t->tree_planes, tree, node);
    lie.blocks &= lie.far < t->t_near ? 0 : blocks;
    return lie;
}

SIMD_INLINE void kernel_tile_traverse(kernel_tile_trace *t, const mmbvh *tree, const mmbvh_ranges *ranges,
                                      const kernel_interest *interest, unsigned blocks, int part,
                                      kernel_tile_visit *visit)
{
    kernel_tile_entry stack[MMBVH_MAX_DEPTH + 1];
    int top = 0;
    if (!tree->node_count) return;
    const kernel_lie root = kernel_tile_look(t, tree, ranges, interest, 0, blocks);
    if (root.blocks) stack[top++] = (kernel_tile_entry){0, root.near, root.blocks};
    while (top) {
        const kernel_tile_entry e = stack[--top];
        blocks = e.blocks & kernel_blocks_beyond(t, e.near);
        if (!blocks) continue;
        const int count = mmbvh_node_count(tree, e.node);
        const int64_t ref = mmbvh_node_ref(tree, e.node);
        if (count) {
            visit(t, part, tree->cells + ref, count, blocks);
            continue;
        }
        const kernel_lie left = kernel_tile_look(t, tree, ranges, interest, ref, blocks);
        const kernel_lie right = kernel_tile_look(t, tree, ranges, interest, ref + 1, blocks);
        const kernel_tile_entry entries[2] = {{ref, left.near, left.blocks}, {ref + 1, right.near, right.blocks}};
        const int far = left.along < right.along;
        if (entries[far].blocks) stack[top++] = entries[far];
        if (entries[!far].blocks) stack[top++] = entries[!far];
    }
}

static void kernel_tile_parts(kernel_tile_trace *t, int unused, const uint32_t *parts, int count, unsigned blocks)
{
    const render_field *field = &t->surface->layer->field;
    (void)unused;
    for (int n = 0; n < count; n++) {
        const int part = (int)parts[n];
        if (field->ranges[part].low)
            kernel_tile_traverse(t, t->frame->job->parts[part].tree, &field->ranges[part], &t->surface->interest,
                                 blocks, part, kernel_tile_leaf);
    }
}

/* Of all parts; opaque hits stand in the packets afterwards. */
SIMD_INLINE void kernel_tile_surface(kernel_tile_trace *t)
{
    const render_job *job = t->frame->job;
    if (job->parent) {
        kernel_tile_traverse(t, job->parent, NULL, NULL, t->wanted, 0, kernel_tile_parts);
        return;
    }
    for (uint32_t part = 0; part < (uint32_t)job->part_count; part++) kernel_tile_parts(t, 0, &part, 1, t->wanted);
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
    kernel_tree_planes(&t->tree_planes, f, &t->tile);
    kernel_tile_planes(&t->tile_planes, f, &t->tile);
}

#endif
