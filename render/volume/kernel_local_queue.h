/* Stores the cells of a volume in a tile, with a queue for each cell type, for arrays of any layout. When a queue is
 * full, its first SIMD_WIDTH cells, one per lane, are transformed and processed together: they are the current vector
 * of cells (kernel_tile_cells.h). Terms:
 *     candidate    a cell that a search over the whole picture has found for the tile (kernel_types.h)
 *     blocks       mask of those of the tile's 16 blocks (4 × 4 pixels each) in which a cell may be visible
 *     box          the rectangle of the tile's pixels in which a cell may be visible: first and last column, first and
 *                  last row, 4 bits each from bit 0 on
 *     window       interval of depths; a tile's windows are processed one after the other, from the nearest on
 *     pair         a ray and the lane that holds its cell; pairs are processed one per lane */
#ifndef RENDER_KERNEL_LOCAL_QUEUE_H
#define RENDER_KERNEL_LOCAL_QUEUE_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_arrays.h"
#include "kernel_cell.h"
#include "kernel_visible_values.h"
#include "kernel_local.h"
#include "kernel_map.h"
#include "kernel_tet_blocks.h"
#include "kernel_transformed_curved.h"
#include "kernel_transformed_tets.h"
#include "kernel_tile.h"
#include "kernel_tile_trace.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "simd.h"

enum {
    /* prefetch distance in cells: a cell's vertex indices are read, and its vertices prefetched, when that many further
     * cells have been queued */
    KERNEL_LOCAL_AHEAD = 8,
    KERNEL_LOCAL_ROOM = SIMD_WIDTH + 2 * KERNEL_LOCAL_AHEAD
};

/* A queue of cells of one type. When it is full, its first SIMD_WIDTH cells are processed together. */
typedef struct kernel_local_queue {
    /* number of queued cells; number of those, at the begin of the queue, whose vertex indices have been read into
     * `vertex` */
    int count, indexed_count;
    uint32_t cell[KERNEL_LOCAL_ROOM]; /* index of the cell in the mesh part */
    uint16_t blocks[KERNEL_LOCAL_ROOM], box[KERNEL_LOCAL_ROOM];
    int32_t vertex[8][KERNEL_LOCAL_ROOM];
} kernel_local_queue;

enum { KERNEL_SORT_ENDS = 48 };

/* The pairs of a ray and a tet that may meet, for the tets of the current vector. They are processed SIMD_WIDTH pairs
 * at a time (kernel_tet_pairs_next()). First come the pairs of small tets, which are listed in kernel_tile_cells.rays.
 * Then each larger tet is paired with all rays of one packet after the other. */
typedef struct kernel_tet_pairs {
    int next;                    /* index of the first listed pair that has not been processed */
    unsigned large;              /* mask of the lanes whose larger tets have not been paired yet */
    uint16_t blocks[SIMD_WIDTH]; /* for each larger tet, the blocks in which it may be visible */
    int lane;                    /* lane of the current larger tet */
    unsigned left;               /* mask of the current larger tet's blocks that have not been paired yet */
    int packet; /* index of the packet whose rays are being processed; -1 while listed pairs are processed */
} kernel_tet_pairs;

/* The cells of a volume in the tile: candidates, queued cells of a mesh part, and the cells that are being processed.
 */
typedef struct kernel_tile_cells {
    /* The tile's candidates, if the trees have been traversed in advance for the whole picture; otherwise not used. The
     * first open_count items overlap the last window in depth; `next` is the first item that begins behind all windows
     * so far. Only the first `sorted` items are sorted by their least depth; the others are sorted when a window needs
     * them, which saves work in tiles that soon become dark. `ends` are the partition points of the unfinished
     * quicksort, the nearest one last: no item in front of such an index is farther than any item behind it. */
    kernel_tile_candidate *items;
    int count, open_count, next;
    int sorted, end_count, ends[KERNEL_SORT_ENDS];
    const struct kernel_volume_method *method; /* samples or segments */
    bool has_curved_lanes;                     /* set if hexes, wedges and pyramids are processed in lanes */
    int volume, part;     /* volume and mesh part of the queued cells; part: -1 if there is none yet */
    kernel_arrays arrays; /* the arrays of the volume's field on the mesh part */
    kernel_local_queue queues[KERNEL_LANE_TYPES];
    kernel_cell cell;                  /* the cell that packets are tracing */
    kernel_map map;                    /* inverse map of `cell` */
    const kernel_map *cell_map;        /* points to `map`; NULL if the field of `cell` is constant */
    kernel_transformed_tets tets;      /* the vector of tets that is being processed */
    kernel_block_rays block_rays;      /* the rays of the tile's blocks */
    kernel_tet_pairs tet_pairs;        /* pairs of a ray and one of `tets` */
    const kernel_local_queue *current; /* queue from which the cells in `curved` come */
    /* the current vector of hexes, wedges or pyramids in tile space; affine edge functions are not set */
    kernel_transformed_curved curved;
    kernel_local_cells maps; /* the maps of the cells in `curved` */
    /* per lane: first and last column, first and last row of the tile's pixels in which the lane's cell may be visible
     * (kernel_local_compute_pixel_bounds()) */
    int32_t pixel_ends[4][SIMD_WIDTH];
    int alone; /* the lane whose cell is also stored in `cell` (kernel_tile_set_current_cell()); -1: none */
    kernel_pixel_list rays; /* pairs of a pixel, in a cell's box, and the lane of that cell */
} kernel_tile_cells;

/* Begins a volume with empty queues. */
SIMD_INLINE void kernel_tile_cells_begin_volume(kernel_tile_cells *cells, int volume)
{
    cells->volume = volume;
    cells->part = -1;
    for (int i = 0; i < KERNEL_LANE_TYPES; i++) cells->queues[i].count = cells->queues[i].indexed_count = 0;
}

/* Makes the mesh part with index `part` the one whose cells are queued from now on. The queues must be empty. */
SIMD_INLINE void kernel_tile_cells_set_part(const kernel_tile_trace *t, kernel_tile_cells *cells, int part)
{
    cells->part = part;
    kernel_arrays_begin(&cells->arrays, t->frame->job->parts[part].cells,
                        &t->frame->job->volumes[cells->volume].field.fields[part]);
}

/* ---- cells ---- */

/* Reads the field at the vertices of the current vector's cells (`count` per cell), and converts it to the transfer
 * function's domain, clamped to [-1e18, 1e18]. Returns the lanes whose cells are drawn, have only finite values, and
 * have visible values. */
SIMD_INLINE vm kernel_local_read_values(const kernel_transfer *t, const kernel_tile_cells *cells, int count,
                                        vf values[8])
{
    const kernel_arrays *p = &cells->arrays;
    vf plain[8], odd = vf_set(0);
    vm finite = vm_from_bits(kernel_arrays_drawn_lanes(p, cells->current->cell, (1u << SIMD_WIDTH) - 1));
    for (int i = 0; i < count; i++) {
        vi vertex;
        memcpy(&vertex, p->is_by_cell ? (const void *)cells->current->cell : cells->curved.vertex[i], sizeof vertex);
        kernel_f64 all[2];
        kernel_numbers_gather(&p->values, vertex, all);
        for (int half = 0; half < 2; half++) {
            const kernel_f64 v = all[half];
            kernel_f64_store_half_of_vector(&odd, half, v - v);
            kernel_f64_store_half_of_vector(&plain[i], half, kernel_f64_clamp(v, 3e38));
            kernel_f64_store_half_of_vector(&values[i], half, kernel_f64_clamp((v - t->low) * t->inverse_width, 1e18));
        }
        finite = vm_and(finite, vf_eq(odd, odd));
    }
    return vm_and(finite, kernel_visible_values_overlap_cells(&t->visible_values, plain, count));
}

/* Computes the first and last column and row of the tile's pixels in which each lane's cell may be visible (ends).
 * places: x, y and z of the cells' vertices in tile space. The margin of 1/100 pixel exceeds the rounding errors of
 * projected vertices whose distance from the plane of the eye is at least 1/1000 of the scene's distance; a cell with a
 * nearer vertex gets all pixels. */
SIMD_INLINE void kernel_local_compute_pixel_bounds(const kernel_tile_trace *t, int count, const vf places[3][8],
                                                   int32_t ends[4][SIMD_WIDTH])
{
    const bool flat = t->frame->job->camera.is_orthographic;
    const kernel_tile *tile = &t->tile;
    const float *rays[2] = {flat ? tile->origin_x : tile->slope_x, flat ? tile->origin_y : tile->slope_y};
    const float shift = (float)t->frame->depth_shift, pad = 0.01f;
    vf low[2] = {vf_set(INFINITY), vf_set(INFINITY)}, high[2] = {vf_set(-INFINITY), vf_set(-INFINITY)};
    vm anywhere = vm_none();
    for (int n = 0; n < count; n++) {
        vf depth = vf_set(1);
        if (!flat) depth = places[2][n] + shift;
        anywhere = vm_or(anywhere, vm_not(vf_lt(vf_set(flat ? 0 : 1e-3f * fabsf(shift)), depth)));
        for (int a = 0; a < 2; a++) {
            const vf at = (places[a][n] / depth - rays[a][0]) * (1 / (rays[a][1] - rays[a][0]));
            low[a] = vf_min(at, low[a]);
            high[a] = vf_max(at, high[a]);
        }
    }
    for (int a = 0; a < 2; a++) {
        const vf first = vf_clamp(-vf_floor(pad - low[a]), vf_set(0), vf_set(KERNEL_TILE));
        const vf last = vf_clamp(vf_floor(high[a] + pad), vf_set(-1), vf_set(KERNEL_TILE - 1));
        const vi from = vi_from_vf(vf_select(anywhere, vf_set(0), first));
        const vi to = vi_from_vf(vf_select(anywhere, vf_set(KERNEL_TILE - 1), last));
        memcpy(ends[2 * a], &from, sizeof from);
        memcpy(ends[2 * a + 1], &to, sizeof to);
    }
}

/* Clips the box of the cell in the given lane to the columns and rows in which the cell may be visible. Returns false
 * if the box becomes empty. */
SIMD_INLINE bool kernel_local_clip_box(int32_t ends[4][SIMD_WIDTH], int lane, unsigned *box)
{
    int end[4];
    for (int a = 0; a < 2; a++) {
        const int from = (int)(*box >> 8 * a & 15), to = (int)(*box >> (8 * a + 4) & 15);
        end[2 * a] = from > ends[2 * a][lane] ? from : ends[2 * a][lane];
        end[2 * a + 1] = to < ends[2 * a + 1][lane] ? to : ends[2 * a + 1][lane];
    }
    if (end[0] > end[1] || end[2] > end[3]) return false;
    *box = (unsigned)(end[0] | end[1] << 4 | end[2] << 8 | end[3] << 12);
    return true;
}

/* Reads the vertices of the current vector's cells, sorts them, transforms them into tile space, and computes the
 * cells' maps. Returns a mask of the cells that may be visible. *lanes: mask of those that can be processed in lanes:
 * no edge has length zero, and the bend of the map (kernel_local.h) is less than most_bent. */
SIMD_INLINE unsigned kernel_local_transform_cells_of_type(const kernel_tile_trace *t, kernel_tile_cells *cells,
                                                          float most_bent, unsigned *lanes, int type)
{
    const int count = grid_type_vertex_count(type);
    kernel_transformed_curved *h = &cells->curved;
    int32_t vertices[8][SIMD_WIDTH];
    vf places[3][8], values[8];
    for (int i = 0; i < count; i++) memcpy(vertices[i], cells->current->vertex[i], sizeof vertices[i]);
    const vm collapsed = kernel_transform_curved_vertices(h, &cells->arrays, t->frame, &t->tile, vertices, type);
    const vm shows = kernel_local_read_values(&t->frame->volumes[cells->volume], cells, count, values);
    for (int i = 0; i < count; i++) {
        for (int a = 0; a < 3; a++) places[a][i] = vf_load(h->at[a][i]);
        vf_store(h->at[3][i], values[i]);
    }
    kernel_local_compute_pixel_bounds(t, count, (const vf(*)[8])places, cells->pixel_ends);
    const vm smooth = kernel_local_compute_maps(type, (const vf(*)[8])places, values, most_bent, &cells->maps);
    *lanes = vm_bits(vm_andnot(vm_and(shows, smooth), collapsed));
    return vm_bits(shows);
}

static __attribute__((noinline)) unsigned kernel_local_transform_cells(const kernel_tile_trace *t,
                                                                       kernel_tile_cells *cells, float most_bent,
                                                                       unsigned *lanes, int type)
{
    return KERNEL_OF_TYPE(type, kernel_local_transform_cells_of_type, t, cells, most_bent, lanes);
}

/* Reads the vertex indices of the queue's cells up to index `end` (excluded), unless they have been read before. */
SIMD_INLINE void kernel_local_read_indices(const kernel_arrays *p, kernel_local_queue *q, int end, int type)
{
    for (; q->indexed_count < end; q->indexed_count++)
        kernel_arrays_read_vertex_indices(p, q->cell[q->indexed_count], grid_type_vertex_count(type),
                                          q->vertex[0] + q->indexed_count, KERNEL_LOCAL_ROOM);
}

/* Makes the first SIMD_WIDTH cells of the queue the current vector, and reads their vertex indices. Returns a mask of
 * the lanes that have a cell. The other lanes get copies of the first cell. */
SIMD_INLINE unsigned kernel_local_begin_vector(kernel_tile_cells *cells, kernel_local_queue *q, int type)
{
    const int count = q->count < SIMD_WIDTH ? q->count : SIMD_WIDTH;
    kernel_local_read_indices(&cells->arrays, q, count, type);
    for (int n = count; n < SIMD_WIDTH; n++) {
        q->cell[n] = q->cell[0];
        for (int i = 0; i < grid_type_vertex_count(type); i++) q->vertex[i][n] = q->vertex[i][0];
    }
    cells->current = q;
    cells->alone = -1;
    return (1u << count) - 1;
}

/* Removes the first SIMD_WIDTH cells from the queue and moves the rest to its begin. */
SIMD_INLINE void kernel_local_queue_remove_vector(kernel_local_queue *q)
{
    enum { LEFT = KERNEL_LOCAL_ROOM - SIMD_WIDTH };
    q->count = q->count > SIMD_WIDTH ? q->count - SIMD_WIDTH : 0;
    q->indexed_count = q->indexed_count > SIMD_WIDTH ? q->indexed_count - SIMD_WIDTH : 0;
    if (!q->count) return;
    memmove(q->cell, q->cell + SIMD_WIDTH, LEFT * sizeof *q->cell);
    memmove(q->blocks, q->blocks + SIMD_WIDTH, LEFT * sizeof *q->blocks);
    memmove(q->box, q->box + SIMD_WIDTH, LEFT * sizeof *q->box);
    for (int i = 0; i < 8; i++) memmove(q->vertex[i], q->vertex[i] + SIMD_WIDTH, LEFT * sizeof *q->vertex[i]);
}

/* Appends a cell, whose vertex indices must have been prefetched, to the queue. Returns whether the queue is full. */
SIMD_INLINE bool kernel_local_push(const kernel_arrays *p, kernel_local_queue *q, uint32_t cell, unsigned blocks,
                                   unsigned box, int type)
{
    const int n = q->count++;
    q->cell[n] = cell;
    q->blocks[n] = (uint16_t)blocks;
    q->box[n] = (uint16_t)box;
    kernel_local_read_indices(p, q, q->count - KERNEL_LOCAL_AHEAD, type);
    return q->count == KERNEL_LOCAL_ROOM;
}

/* ---- intervals of rays in cells ---- */

/* Computes the interval of depths, relative to `depth`, in which each ray may be inside its cell: it is between the
 * three pairs of planes that bound the cell (kernel_local_cells.low and high). */
SIMD_INLINE void kernel_local_intersect_slabs(const kernel_local_cells *cells, const kernel_lane_rays *rays, vf depth,
                                              vf *near, vf *far)
{
    const vf d[2] = {
        (rays->rays.origin_x + rays->rays.slope_x * depth) - kernel_gather_lane(cells->origin[0], rays->lane),
        (rays->rays.origin_y + rays->rays.slope_y * depth) - kernel_gather_lane(cells->origin[1], rays->lane)};
    *near = vf_set(-INFINITY);
    *far = vf_set(INFINITY);
    for (int i = 0; i < 3; i++) {
        vf row[3];
        for (int a = 0; a < 3; a++) row[a] = kernel_gather_lane(cells->inverse[i][a], rays->lane);
        const vf offset = kernel_gather_lane(cells->offset[i], rays->lane);
        const vf at = vf_muladd(row[0], d[0], vf_muladd(row[1], d[1], offset));
        const vf inverse = 1.0f / vf_muladd(row[0], rays->rays.slope_x, vf_muladd(row[1], rays->rays.slope_y, row[2]));
        const vf low = (kernel_gather_lane(cells->low[i], rays->lane) - at) * inverse;
        const vf high = (kernel_gather_lane(cells->high[i], rays->lane) - at) * inverse;
        /* A ray parallel to a pair of planes may give NaN here; max() and min() then keep the bounds of the other
         * pairs. */
        *near = vf_max(vf_min(low, high), *near);
        *far = vf_min(vf_max(low, high), *far);
    }
}

#endif
