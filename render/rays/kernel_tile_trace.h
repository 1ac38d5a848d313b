/* The state of the tile that a thread is tracing: the tile's rays, the depth in each block behind which everything is
 * hidden, and the traversal of a tree for all rays of the tile. A block's packets are set up when the first cell is
 * found that may be visible in the block. The last part defines lists of rays, in which each ray has a cell of its own,
 * so that the pixels of several small cells are processed in one vector. */
#ifndef RENDER_KERNEL_TILE_TRACE_H
#define RENDER_KERNEL_TILE_TRACE_H

#include <math.h>
#include <string.h>

#include "kernel_hits.h"
#include "kernel_visible_values.h"
#include "kernel_packet.h"
#include "kernel_tile.h"
#include "kernel_types.h"
#include "mmbvh.h"
#include "render.h"
#include "simd.h"

typedef struct kernel_tile_trace {
    const kernel_frame *frame;
    kernel_thread *thread;
    kernel_tile tile;
    kernel_planes tree_planes, tile_planes;
    unsigned traced_blocks; /* mask of the blocks that contain pixels to trace */
    unsigned begun;         /* mask of the blocks whose packets have been set up */
    /* The clips of volumes may divide each ray into several intervals (kernel_clip.h). This is the index of the
     * interval in which volumes are being traced. */
    int clip_interval;
    /* least depth t that is being traced: that of the eye's plane or, while volumes are traced in several ranges of
     * depths (windows), the least t of the current window */
    float t_near;
    vf far[KERNEL_BLOCKS / SIMD_WIDTH]; /* for each block the largest t_far of its rays, one block per lane */
    /* t_far of each pixel, row by row; kept only if the tile traverses the trees for surfaces */
    float pixel_far[KERNEL_TILE_PIXELS];
    /* The following members describe the surface layer that is being traced. */
    const kernel_surface *surface;
    int layer;
    struct kernel_tile_search *search;          /* state of the tile's search for cells in trees */
    kernel_packet packets[KERNEL_TILE_PACKETS]; /* packets of all blocks, block by block */
    kernel_hits hits[KERNEL_TILE_PACKETS];
} kernel_tile_trace;

/* Returns a mask of the blocks in which a cell at the depth `near` may be visible: those with at least one ray that has
 * no nearer hit. */
SIMD_INLINE unsigned kernel_blocks_not_hidden_at(const kernel_tile_trace *t, float near)
{
    unsigned bits = 0;
    for (int v = 0; v < KERNEL_BLOCKS / SIMD_WIDTH; v++)
        bits |= vm_bits(vf_le(vf_set(near), t->far[v])) << v * SIMD_WIDTH;
    return bits;
}

SIMD_INLINE void kernel_block_set_up_packets(kernel_tile_trace *t, int block)
{
    if (t->begun >> block & 1) return;
    if (!t->begun) kernel_tile_compute_rays(&t->tile, t->frame);
    t->begun |= 1u << block;
    const int x = t->tile.x0 + block % KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK;
    const int y = t->tile.y0 + block / KERNEL_BLOCKS_ACROSS * KERNEL_BLOCK;
    const int across = KERNEL_BLOCK / KERNEL_PACKET_COLUMNS;
    for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
        const int i = block * KERNEL_BLOCK_PACKETS + n;
        kernel_packet_begin(&t->packets[i], t->frame, &t->tile, t->thread, x + n % across * KERNEL_PACKET_COLUMNS,
                            y + n / across * KERNEL_PACKET_ROWS);
        kernel_hits_begin(&t->hits[i]);
        t->packets[i].hits = &t->hits[i];
    }
}

/* Returns the largest t_far of the block's active rays. */
SIMD_INLINE float kernel_block_far(const kernel_tile_trace *t, int block)
{
    vf far = vf_set(-INFINITY);
    for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
        const kernel_packet *p = &t->packets[block * KERNEL_BLOCK_PACKETS + n];
        far = vf_max(far, vf_select(p->active, p->t_far, vf_set(-INFINITY)));
    }
    return vf_reduce_max(far);
}

/* Updates, after new hits, the block's largest t_far in t->far and the t_far of its pixels in t->pixel_far. */
SIMD_INLINE void kernel_block_update_far(kernel_tile_trace *t, int block)
{
    t->far[block / SIMD_WIDTH][block % SIMD_WIDTH] = kernel_block_far(t, block);
    if (t->frame->candidates) return;
    float *to =
        t->pixel_far + (block / KERNEL_BLOCKS_ACROSS * KERNEL_TILE + block % KERNEL_BLOCKS_ACROSS) * KERNEL_BLOCK;
    for (int n = 0; n < KERNEL_BLOCK_PACKETS; n++) {
        const kernel_packet *p = &t->packets[block * KERNEL_BLOCK_PACKETS + n];
        const int across = KERNEL_BLOCK / KERNEL_PACKET_COLUMNS;
        float far[SIMD_WIDTH];
        vf_store(far, vf_select(p->active, p->t_far, vf_set(-INFINITY)));
        for (int y = 0; y < KERNEL_PACKET_ROWS; y++)
            memcpy(to + (n / across * KERNEL_PACKET_ROWS + y) * KERNEL_TILE + n % across * KERNEL_PACKET_COLUMNS,
                   far + y * KERNEL_PACKET_COLUMNS, KERNEL_PACKET_COLUMNS * sizeof *far);
    }
}

/* Returns whether a cell at the depth `near` may be visible in a box of pixels, that is, whether at least one of these
 * pixels has no nearer hit. box: first and last column, first and last row in the tile, 4 bits each, from bit 0 on. */
SIMD_INLINE bool kernel_box_has_pixel_not_hidden_at(const kernel_tile_trace *t, unsigned box, float near)
{
    const unsigned columns = (2u << (box >> 4 & 15)) - (1u << (box & 15));
    for (unsigned y = box >> 8 & 15; y <= box >> 12; y++) {
        unsigned beyond = 0;
        for (int v = 0; v < KERNEL_TILE / SIMD_WIDTH; v++)
            beyond |= vm_bits(vf_le(vf_set(near), vf_load(t->pixel_far + y * KERNEL_TILE + v * SIMD_WIDTH)))
                      << v * SIMD_WIDTH;
        if (beyond & columns) return true;
    }
    return false;
}

/* Returns those of the given blocks in which a cell may be visible: it overlaps the block in the picture, and not all
 * rays of the block have nearer hits. places: x, y and z of the cell's `count` vertices in tile space. */
SIMD_INLINE unsigned kernel_tile_visible_blocks(const kernel_tile_trace *t, const float *const places[3], int count,
                                                unsigned blocks)
{
    const kernel_placement placement = kernel_points_placement(&t->tile_planes, places, count);
    if (placement.far < t->t_near) return 0;
    return blocks & placement.blocks & kernel_blocks_not_hidden_at(t, placement.near);
}

/* Returns the largest t_far of all rays in blocks that are traced. */
SIMD_INLINE float kernel_tile_far(const kernel_tile_trace *t)
{
    const unsigned lanes = (1u << SIMD_WIDTH) - 1;
    vf far = vf_set(-INFINITY);
    for (int v = 0; v < KERNEL_BLOCKS / SIMD_WIDTH; v++) {
        const vm wanted = vm_from_bits(t->traced_blocks >> v * SIMD_WIDTH & lanes);
        far = vf_max(far, vf_select(wanted, t->far[v], vf_set(-INFINITY)));
    }
    return vf_reduce_max(far);
}

SIMD_INLINE void kernel_tile_begin(kernel_tile_trace *t, const kernel_frame *f, kernel_thread *thread, int x0, int y0,
                                   unsigned wanted)
{
    t->frame = f;
    t->thread = thread;
    t->traced_blocks = wanted;
    t->begun = 0;
    t->t_near = (float)-f->depth_shift;
    for (int v = 0; v < KERNEL_BLOCKS / SIMD_WIDTH; v++) t->far[v] = vf_set(INFINITY);
    kernel_tile_setup(&t->tile, f, x0, y0);
    if (!f->needs_planes) return;
    for (int i = 0; i < KERNEL_TILE_PIXELS; i++) {
        const int column = i % KERNEL_TILE / KERNEL_BLOCK, row = i / KERNEL_TILE / KERNEL_BLOCK;
        t->pixel_far[i] = wanted >> (row * KERNEL_BLOCKS_ACROSS + column) & 1 ? INFINITY : -INFINITY;
    }
    kernel_compute_planes_for_tree_boxes(&t->tree_planes, f, &t->tile);
    kernel_compute_planes_for_cells(&t->tile_planes, f, &t->tile);
}

/* A node on the stack of a tile that traverses a tree. There are two traversals. In the traversal by blocks, `place` is
 * a mask of the blocks in which the node may be visible; when the node is taken from the stack, the blocks in which
 * nearer hits hide it are removed from the mask. In the traversal by pixels (kernel_tile_surface.h), `place` is the box
 * of the pixels in which the node may be visible. */
typedef struct kernel_tile_node {
    /* index of the node; or, in traversals by pixels, index of a leaf's first cell or of an inner node's left child */
    int64_t ref;
    float near;
    uint16_t place; /* mask of blocks, or box of pixels */
    uint16_t count; /* number of cells of a leaf, 0 for an inner node; not used in traversals by blocks */
} kernel_tile_node;

typedef void kernel_tile_visit(kernel_tile_trace *t, int part, const uint32_t *cells, int count, unsigned blocks);

/* Returns the placement of a node's box. The member `blocks` of the result is a mask of those of the given blocks in
 * which the node may be visible; it is 0 if the node contains no visible value or ends before the depth t->t_near.
 * visible_values: NULL if all values are visible. */
SIMD_INLINE kernel_placement kernel_tile_classify_node(const kernel_tile_trace *t, const mmbvh *tree,
                                                       const mmbvh_ranges *ranges,
                                                       const kernel_visible_values *visible_values, int64_t node,
                                                       unsigned blocks)
{
    kernel_placement placement = {0};
    if (visible_values && !kernel_node_is_visible(visible_values, ranges, node)) return placement;
    placement = kernel_box_placement(&t->tree_planes, tree, node);
    placement.blocks &= placement.far < t->t_near ? 0 : blocks;
    if (placement.blocks) {
        /* Prefetches the data that the traversal reads next: the cells of a leaf, or the children of an inner node. */
        const int64_t ref = mmbvh_node_ref(tree, node);
        if (mmbvh_node_count(tree, node)) {
            __builtin_prefetch(tree->cells + ref);
        } else {
            mmbvh_prefetch_node(tree, ref);
            if (visible_values) __builtin_prefetch(ranges->low + ref * ranges->stride);
        }
    }
    return placement;
}

SIMD_INLINE void kernel_tile_traverse(kernel_tile_trace *t, const mmbvh *tree, const mmbvh_ranges *ranges,
                                      const kernel_visible_values *visible_values, unsigned blocks, int part,
                                      kernel_tile_visit *visit)
{
    kernel_tile_node stack[MMBVH_MAX_DEPTH + 1];
    int top = 0;
    if (!tree->node_count) return;
    const kernel_placement root = kernel_tile_classify_node(t, tree, ranges, visible_values, 0, blocks);
    if (root.blocks) stack[top++] = (kernel_tile_node){0, root.near, (uint16_t)root.blocks, 0};
    while (top) {
        const kernel_tile_node e = stack[--top];
        blocks = e.place & kernel_blocks_not_hidden_at(t, e.near);
        if (!blocks) continue;
        const int count = mmbvh_node_count(tree, e.ref);
        const int64_t ref = mmbvh_node_ref(tree, e.ref);
        if (count) {
            visit(t, part, tree->cells + ref, count, blocks);
            continue;
        }
        const kernel_placement left = kernel_tile_classify_node(t, tree, ranges, visible_values, ref, blocks);
        const kernel_placement right = kernel_tile_classify_node(t, tree, ranges, visible_values, ref + 1, blocks);
        const kernel_tile_node nodes[2] = {{ref, left.near, (uint16_t)left.blocks, 0},
                                           {ref + 1, right.near, (uint16_t)right.blocks, 0}};
        const int far = left.along < right.along;
        if (nodes[far].place) stack[top++] = nodes[far];
        if (nodes[!far].place) stack[top++] = nodes[!far];
    }
}

/* ---- lists of rays of several cells ---- */

enum { KERNEL_LIST_PIXELS = 512, KERNEL_LIST_ROOM = KERNEL_LIST_PIXELS + KERNEL_TILE_PIXELS + SIMD_WIDTH };

/* A list of rays, each with its pixel in the tile (16 * row + column) and the lane that holds its cell. */
typedef struct kernel_pixel_list {
    int count;
    uint8_t pixel[KERNEL_LIST_ROOM], lane[KERNEL_LIST_ROOM];
} kernel_pixel_list;

SIMD_INLINE int kernel_count_pixels_in_box(unsigned box)
{
    const int columns = (int)(box >> 4 & 15) - (int)(box & 15) + 1;
    return columns * ((int)(box >> 12) - (int)(box >> 8 & 15) + 1);
}

/* Appends a ray for each pixel of the box, row by row. lane: the lane that holds the rays' cell. */
SIMD_INLINE void kernel_pixel_list_add_box(kernel_pixel_list *rays, unsigned box, int lane)
{
    static const uint8_t ramp[KERNEL_TILE] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    typedef uint8_t kernel_row_bytes __attribute__((vector_size(KERNEL_TILE)));
    const int columns = (int)(box >> 4 & 15) - (int)(box & 15) + 1;
    const kernel_row_bytes lanes = (kernel_row_bytes){0} + (uint8_t)lane;
    kernel_row_bytes row;
    memcpy(&row, ramp, sizeof row);
    row += (uint8_t)((box & 15) | (box >> 8 & 15) << 4);
    for (unsigned y = box >> 8 & 15; y <= box >> 12; y++, row += KERNEL_TILE) {
        memcpy(rays->pixel + rays->count, &row, sizeof row);
        memcpy(rays->lane + rays->count, &lanes, sizeof lanes);
        rays->count += columns;
    }
}

/* Appends the rays of all pixels of the given blocks, packet by packet. lane: the lane that holds the rays' cell. */
SIMD_INLINE void kernel_pixel_list_add_blocks(kernel_pixel_list *rays, unsigned blocks, int lane)
{
    /* the pixels of the tile's first block (16 * row + column), in the order of packets and lanes
     * (kernel_pixel_position()); quads: for vectors of 4 lanes, rows: for all others */
    static const uint8_t quads[16] = {0, 1, 16, 17, 2, 3, 18, 19, 32, 33, 48, 49, 34, 35, 50, 51};
    static const uint8_t rows[16] = {0, 1, 2, 3, 16, 17, 18, 19, 32, 33, 34, 35, 48, 49, 50, 51};
    typedef uint8_t kernel_block_bytes __attribute__((vector_size(KERNEL_BLOCK * KERNEL_BLOCK)));
    const kernel_block_bytes lanes = (kernel_block_bytes){0} + (uint8_t)lane;
    for (; blocks; blocks &= blocks - 1, rays->count += KERNEL_BLOCK * KERNEL_BLOCK) {
        const int block = __builtin_ctz(blocks);
        kernel_block_bytes pixels;
        memcpy(&pixels, SIMD_WIDTH == 4 ? quads : rows, sizeof pixels);
        pixels +=
            (uint8_t)(KERNEL_BLOCK * (KERNEL_TILE * (block / KERNEL_BLOCKS_ACROSS) + block % KERNEL_BLOCKS_ACROSS));
        memcpy(rays->pixel + rays->count, &pixels, sizeof pixels);
        memcpy(rays->lane + rays->count, &lanes, sizeof lanes);
    }
}

/* Stores SIMD_WIDTH copies of the last ray behind the end of the list. So a whole vector can be read from any index of
 * the list, and the packets of all rays in the vector have been set up. */
SIMD_INLINE void kernel_pixel_list_pad(kernel_pixel_list *rays)
{
    const int last = rays->count - 1;
    memset(rays->pixel + rays->count, last < 0 ? 0 : rays->pixel[last], SIMD_WIDTH);
    memset(rays->lane + rays->count, last < 0 ? 0 : rays->lane[last], SIMD_WIDTH);
}

SIMD_INLINE vi kernel_load_bytes(const uint8_t *bytes)
{
    typedef uint8_t kernel_byte_lanes __attribute__((vector_size(SIMD_WIDTH)));
    kernel_byte_lanes lanes;
    memcpy(&lanes, bytes, sizeof lanes);
    return __builtin_convertvector(lanes, vi);
}

/* Returns the position of a pixel among the tile's packets: the index of its packet times SIMD_WIDTH, plus its lane in
 * the packet. */
SIMD_INLINE vi kernel_pixel_position(vi column, vi row)
{
    const vi block = (row & ~3) + (column >> 2);
    const vi within = SIMD_WIDTH == 4 ? ((row & 2) << 2) + ((column & 2) << 1) + ((row & 1) << 1) + (column & 1)
                                      : ((row & 3) << 2) + (column & 3);
    return block * (KERNEL_BLOCK * KERNEL_BLOCK) + within;
}

/* Gathers a member of the tile's packets that has 32 bits per lane, for one ray per lane. at: positions of the rays
 * among the tile's packets (kernel_pixel_position()); of_first: address of the member in the first packet. */
SIMD_INLINE vf kernel_gather_packet_member(const void *of_first, vi at)
{
    const int stride = (int)(sizeof(kernel_packet) / sizeof(float));
    return vf_gather((const float *)of_first, at / SIMD_WIDTH * stride + (at & (SIMD_WIDTH - 1)));
}

/* SIMD_WIDTH rays, one per lane. Each ray is intersected with a cell of its own. */
typedef struct kernel_lane_rays {
    /* lane: the lane that holds the ray's cell in the vectors of cells; at: position of the ray's pixel among the
     * tile's packets (kernel_pixel_position()) */
    vi lane, at;
    kernel_rays rays;
    /* Lanes that have a ray. This member, u and v are set only by kernel_lane_rays_begin() and
     * kernel_lane_rays_of_packet(). */
    vm active;
    vf u, v; /* slope of the ray or, if the camera is orthographic, its origin */
    vf far;  /* t of the ray's nearest hit so far (kernel_packet.t_far); set only when surfaces are traced */
} kernel_lane_rays;

/* Sets the members lane, at and rays for the rays through the given pixels of the tile (16 * row + column). lane: the
 * lane that holds each ray's cell. */
SIMD_INLINE void kernel_lane_rays_through_pixels(kernel_lane_rays *out, const kernel_tile *tile, vi pixel, vi lane)
{
    const vi column = pixel & (KERNEL_TILE - 1), row = pixel >> 4 & (KERNEL_TILE - 1);
    out->lane = lane & (SIMD_WIDTH - 1);
    out->at = kernel_pixel_position(column, row);
    out->rays = (kernel_rays){kernel_gather_from_tile_row_or_column(tile->origin_x, column),
                              kernel_gather_from_tile_row_or_column(tile->origin_y, row),
                              kernel_gather_from_tile_row_or_column(tile->slope_x, column),
                              kernel_gather_from_tile_row_or_column(tile->slope_y, row)};
}

/* Loads up to SIMD_WIDTH rays of the list, from index `first` on. Lanes behind the end of the list are inactive. */
SIMD_INLINE void kernel_lane_rays_begin(kernel_lane_rays *out, const kernel_tile_trace *t,
                                        const kernel_pixel_list *rays, int first)
{
    const bool flat = t->frame->job->camera.is_orthographic;
    const int left = rays->count - first;
    out->active = left < SIMD_WIDTH ? vm_from_bits((1u << left) - 1) : vm_all_lanes();
    kernel_lane_rays_through_pixels(out, &t->tile, kernel_load_bytes(rays->pixel + first),
                                    kernel_load_bytes(rays->lane + first));
    out->u = flat ? out->rays.origin_x : out->rays.slope_x;
    out->v = flat ? out->rays.origin_y : out->rays.slope_y;
}

/* Returns the depths at which the rays begin. They differ only if the frame has clips that apply to all layers
 * (kernel_frame.common_clips). */
SIMD_INLINE vf kernel_lane_rays_get_begin_depths(const kernel_tile_trace *t, const kernel_lane_rays *r)
{
    if (__builtin_expect(t->frame->common_clips == 0, 1)) return vf_set(t->t_near);
    return kernel_gather_packet_member(&t->packets[0].t_near, r->at);
}

SIMD_INLINE void kernel_lane_rays_set_far(kernel_lane_rays *r, const kernel_tile_trace *t)
{
    r->far = kernel_gather_packet_member(&t->packets[0].t_far, r->at);
}

/* Returns the index, among the tile's packets, of the packet that contains a pixel. pixel: 16 * row + column. */
SIMD_INLINE int kernel_packet_of_pixel(int pixel)
{
    const int column = pixel & (KERNEL_TILE - 1), row = pixel >> 4;
    const int block = (row & ~3) + (column >> 2);
    const int within = SIMD_WIDTH == 4 ? (row & 2) + (column >> 1 & 1) : (row & 3) * KERNEL_BLOCK / SIMD_WIDTH;
    return block * KERNEL_BLOCK_PACKETS + within;
}

/* Returns, for each ray of a packet, its position among the rays of the tile's packets (kernel_pixel_position()). */
SIMD_INLINE vi kernel_list_positions_in_packet(int packet)
{
    return packet * SIMD_WIDTH + vi_lanes();
}

/* Sets *out to the rays of a packet, all of which are intersected with the cell in the given lane. packet: index of the
 * packet in the tile. */
SIMD_INLINE void kernel_lane_rays_of_packet(kernel_lane_rays *out, const kernel_tile_trace *t, int packet, int lane)
{
    const kernel_packet *p = &t->packets[packet];
    out->at = kernel_list_positions_in_packet(packet);
    out->lane = vi_set(lane);
    out->rays = kernel_packet_rays(p);
    out->active = p->active;
    out->u = p->u;
    out->v = p->v;
    out->far = p->t_far;
}

static inline void kernel_tile_set_layer(kernel_tile_trace *t, int layer)
{
    t->layer = layer;
    t->surface = &t->frame->surfaces[layer];
}

SIMD_INLINE bool kernel_tile_layer_is_opaque(const kernel_tile_trace *t)
{
    return t->layer < t->frame->opaque_count;
}

#endif
