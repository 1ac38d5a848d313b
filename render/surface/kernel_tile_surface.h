/* Isosurfaces of a whole tile in one traversal: the tree is gone down once for all its blocks, with a mask of those
 * that a node may meet before what they already know to be nearer. A leaf's cells are fetched and placed once a tile,
 * narrowed down to the blocks that their surface may show in (kernel_outline.h), and given to these blocks' packets,
 * which are set up when the first cell comes to them. A tile without a surface costs its nodes alone. */
#ifndef RENDER_KERNEL_TILE_SURFACE_H
#define RENDER_KERNEL_TILE_SURFACE_H

#include "kernel_outline.h"
#include "kernel_surface.h"
#include "kernel_tile_blocks.h"

typedef struct kernel_tile_trace {
    const kernel_frame *frame;
    kernel_thread *thread;
    kernel_tile tile;
    kernel_planes tree_planes, tile_planes;
    kernel_block_rays block_rays; /* for volumes */
    unsigned wanted;              /* blocks that have pixels to trace */
    unsigned begun;               /* blocks whose packets are set up */
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

SIMD_INLINE void kernel_blocks_meet(kernel_tile_trace *t, unsigned blocks, int part, uint32_t index,
                                    const kernel_cell *cell, int value)
{
    for (; blocks; blocks &= blocks - 1) kernel_block_meet(t, __builtin_ctz(blocks), part, index, cell, value);
}

/* Of a moved cell with its values, before blocks meet it. */
SIMD_INLINE void kernel_tile_ready(kernel_tile_trace *t, int part)
{
    kernel_cell_order(&t->cell);
    kernel_cell_lines(&t->cell, t->frame, &t->tile);
    if (t->surface->layer->colour_map) kernel_cell_colours(&t->cell, t->surface, part);
}

/* Blocks in which a body of this outline may show. */
SIMD_INLINE unsigned kernel_tile_keep(const kernel_tile_trace *t, const kernel_outline *outline, unsigned blocks)
{
    const kernel_lie lie = kernel_outline_lie(&t->tile_planes, outline);
    if (lie.far < t->t_near) return 0;
    return blocks & lie.blocks & kernel_blocks_beyond(t, lie.near);
}

/* Blocks in which the cell's surface may show. */
SIMD_INLINE unsigned kernel_tile_narrow(const kernel_tile_trace *t, const kernel_cell *c, unsigned blocks)
{
    kernel_outline outline;
    if (c->type != GRID_TET)
        kernel_vertex_outline(c, &outline);
    else if (!kernel_tet_outline(c, &outline))
        return 0;
    blocks = kernel_tile_keep(t, &outline, blocks);
    if (!blocks || c->type == GRID_TET) return blocks;
    return kernel_slab_outline(c, &outline) ? kernel_tile_keep(t, &outline, blocks) : 0;
}

/* Most cells are not ordered, for they turn out to lie beside the tile. */
SIMD_INLINE void kernel_tile_cell(kernel_tile_trace *t, int part, unsigned blocks)
{
    const render_surface_layer *layer = t->surface->layer;
    kernel_cell *c = &t->cell;
    bool is_ordered = false;
    for (int value = 0; value < layer->value_count; value++) {
        if (!kernel_cell_straddles(c, layer->values[value])) continue;
        if (!c->is_placed) kernel_cell_move(c, t->frame, &t->tile, t->frame->job->parts[part].cells);
        kernel_cell_relative(c, layer->values[value]);
        t->poly.is_set_up = false;
        const unsigned left = kernel_tile_narrow(t, c, blocks);
        if (left && !is_ordered) {
            is_ordered = true;
            kernel_tile_ready(t, part);
        }
        kernel_blocks_meet(t, left, part, c->index, c, value);
    }
}

SIMD_INLINE void kernel_prefetch_vertex(const grid *g, const grid_field *field, int64_t v)
{
    __builtin_prefetch(field->values.data + v * field->values.stride);
    for (int a = 0; a < 3; a++) __builtin_prefetch(g->coordinates[a].data + v * g->coordinates[a].stride);
}

/* Of cells of one type: others are not foreseen. */
SIMD_INLINE void kernel_tile_prefetch_indices(const grid *g, uint32_t cell)
{
    const int vertices = grid_type_vertices(g->cell_type);
    if (!g->offsets.data && vertices)
        __builtin_prefetch(g->connectivity.data + (int64_t)cell * vertices * g->connectivity.stride);
}

SIMD_INLINE void kernel_tile_prefetch_vertices(const grid *g, const grid_field *field, uint32_t cell)
{
    const int vertices = g->offsets.data ? 0 : grid_type_vertices(g->cell_type);
    for (int i = 0; i < vertices; i++)
        kernel_prefetch_vertex(g, field, grid_array_index(&g->connectivity, (int64_t)cell * vertices + i));
}

/* All that the cells are made of is on its way from memory before the first of it is looked at. */
SIMD_INLINE void kernel_tile_prefetch(const grid *g, const grid_field *field, const uint32_t *cells, int count)
{
    for (int n = 0; n < count; n++) kernel_tile_prefetch_indices(g, cells[n]);
    for (int n = 0; n < count; n++) kernel_tile_prefetch_vertices(g, field, cells[n]);
}

static void kernel_tile_leaf(kernel_tile_trace *t, int part, const uint32_t *cells, int count, unsigned blocks)
{
    const render_surface_layer *layer = t->surface->layer;
    const grid *g = t->frame->job->parts[part].cells;
    kernel_cell *c = &t->cell;
    kernel_tile_prefetch(g, &layer->field.fields[part], cells, count);
    for (int n = 0; n < count; n++) {
        kernel_cell_fetch(c, g, &layer->field.fields[part], cells[n]);
        if (c->type == GRID_POLYHEDRON) {
            kernel_blocks_meet(t, blocks, part, cells[n], NULL, 0);
            continue;
        }
        if (c->is_finite) kernel_tile_cell(t, part, blocks);
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
    if (lie.blocks) {
        /* What comes next of it, if it is an inner node or a leaf. */
        const int64_t ref = mmbvh_node_ref(tree, node);
        if (mmbvh_node_count(tree, node))
            __builtin_prefetch(tree->cells + ref);
        else if (interest)
            __builtin_prefetch(ranges->low + ref * ranges->stride);
    }
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

SIMD_INLINE void kernel_tile_surfaces(kernel_tile_trace *t)
{
    for (t->layer = 0; t->layer < t->frame->surface_count; t->layer++) {
        t->surface = &t->frame->surfaces[t->layer];
        kernel_tile_surface(t);
    }
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
