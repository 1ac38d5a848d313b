/* Finds the blocks of a tile in which a body may be visible. A body is the box of a tree's node, or the convex hull of
 * points of a cell. A tile of 16 × 16 pixels has 4 × 4 blocks of 4 × 4 pixels, for every instruction set; a block has
 * one or more packets:
 *
 *     border     0     1     2     3     4
 *          0     +-----+-----+-----+-----+
 *                |     |     |     |     |      Five borders lie between columns of pixels and five between rows, half
 *          1     +-----+-----+-----+-----+      a pixel from the rays. Each is a plane; with a perspective camera it
 *                |     |     |     |     |      passes through the eye. A convex body that lies on both sides of a
 *          2     +-----+-----+-----+-----+      border may touch the columns on both sides. The masks of columns and
 *                                               of rows together give a mask of blocks.
 *
 * Each plane is one lane of a vector, which holds a point's signed distance from the plane. Two more lanes hold the
 * point's depth and its distance along the direction of the tile's middle ray. So the least and the greatest of each of
 * these numbers in a body are computed at once; they are called the body's extent in the lane. Planes through the eye
 * give correct masks only for bodies in front of the eye. Rays begin in the eye's plane, so they do not meet bodies
 * behind it. A body that intersects the eye's plane lies on both sides of the borders of all blocks in which it may be
 * visible, so these blocks are in the mask. Extents are widened by more than all rounding errors, so no block is
 * missing in a mask. Masks only select the rays that are tested with a body; they never change the result. */
#ifndef RENDER_KERNEL_TILE_H
#define RENDER_KERNEL_TILE_H

#include <math.h>
#include <string.h>

#include "kernel_types.h"
#include "mmbvh.h"
#include "render.h"
#include "simd.h"

static inline void kernel_tile_setup(kernel_tile *tile, const kernel_frame *f, int x0, int y0)
{
    tile->x0 = x0;
    tile->y0 = y0;
    tile->depth_shift = f->depth_shift;
    tile->centre_x = kernel_column_slope(f, x0 + 0.5 * (KERNEL_TILE - 1));
    tile->centre_y = kernel_row_slope(f, y0 + 0.5 * (KERNEL_TILE - 1));
    const bool flat = f->job->camera.is_orthographic;
    tile->shear_x = flat ? 0 : (float)tile->centre_x;
    tile->shear_y = flat ? 0 : (float)tile->centre_y;
    const double widest = fmax(fabs(f->slope_dx), fabs(f->slope_dy)) * (flat ? f->job->space.scale : 1);
    tile->radius = (float)(0.5 * KERNEL_TILE * widest);
}

/* Let d be the slope (perspective) or the offset (orthographic) of a ray minus that of the ray through the tile's
 * centre. Returns the factor by which d must be multiplied to get the ray's origin, at Z = 0, in tile space. */
static inline double kernel_slope_to_origin(const kernel_frame *f)
{
    return f->job->camera.is_orthographic ? f->job->space.scale : f->depth_shift;
}

static inline void kernel_tile_compute_rays(kernel_tile *tile, const kernel_frame *f)
{
    const bool flat = f->job->camera.is_orthographic;
    const double reach = kernel_slope_to_origin(f);
    for (int i = 0; i < KERNEL_TILE; i++) {
        const double dx = kernel_column_slope(f, tile->x0 + i) - tile->centre_x;
        const double dy = kernel_row_slope(f, tile->y0 + i) - tile->centre_y;
        tile->origin_x[i] = (float)(dx * reach);
        tile->origin_y[i] = (float)(dy * reach);
        tile->slope_x[i] = flat ? 0 : (float)dx;
        tile->slope_y[i] = flat ? 0 : (float)dy;
    }
}

enum {
    KERNEL_BLOCKS_ACROSS = KERNEL_TILE / KERNEL_BLOCK,
    KERNEL_BLOCKS = KERNEL_BLOCKS_ACROSS * KERNEL_BLOCKS_ACROSS,
    KERNEL_BLOCK_PACKETS = KERNEL_BLOCK * KERNEL_BLOCK / SIMD_WIDTH,
    KERNEL_TILE_PACKETS = KERNEL_BLOCKS * KERNEL_BLOCK_PACKETS,
    KERNEL_ALL_BLOCKS = (1 << KERNEL_BLOCKS) - 1,
    /* Lanes of the vectors: the 5 planes that bound the 4 columns of blocks, the 5 planes that bound the 4 rows, the
     * depth t, and the distance along the direction of the tile's middle ray. */
    KERNEL_ROWS_LANE = KERNEL_BLOCKS_ACROSS + 1,
    KERNEL_DEPTH_LANE = 2 * KERNEL_ROWS_LANE,
    KERNEL_ALONG_LANE,
    KERNEL_LANES = SIMD_WIDTH == 4 ? 12 : 16,
    KERNEL_LANE_VECTORS = KERNEL_LANES / SIMD_WIDTH
};

/* One plane per lane: the signed distance of a position from the plane is normal · position + offset. size: absolute
 * values of the normal's components; error: upper bound of the rounding error of the distance at positions near the
 * scene. */
typedef struct kernel_planes {
    vf normal[3][KERNEL_LANE_VECTORS], size[3][KERNEL_LANE_VECTORS];
    vf offset[KERNEL_LANE_VECTORS], error[KERNEL_LANE_VECTORS];
} kernel_planes;

/* Computes the slopes (perspective) or offsets (orthographic) of the five borders of columns (x) and of rows (y) of the
 * tile's blocks. If tile is NULL, block 0 stands for the whole picture: the borders 0 are its left and upper border,
 * all others its right and lower border. A body that may be visible in the picture then gets the mask of block 0. */
static inline void kernel_compute_block_borders(const kernel_frame *f, const kernel_tile *tile,
                                                double x[KERNEL_BLOCKS_ACROSS + 1], double y[KERNEL_BLOCKS_ACROSS + 1])
{
    for (int n = 0; n <= KERNEL_BLOCKS_ACROSS; n++) {
        x[n] = kernel_column_slope(f, tile ? tile->x0 + n * KERNEL_BLOCK - 0.5 : n ? f->job->camera.width - 0.5 : -0.5);
        y[n] = kernel_row_slope(f, tile ? tile->y0 + n * KERNEL_BLOCK - 0.5 : n ? f->job->camera.height - 0.5 : -0.5);
    }
}

/* Computes, in double, normals and offsets of the planes of the block borders, and those of the two lanes for depths
 * (KERNEL_DEPTH_LANE, KERNEL_ALONG_LANE). axes: components of the normals along the camera's right, up and forward
 * axes; offset: the planes' offsets for positions relative to the eye. The positive side of a border's plane is that of
 * greater columns or rows. */
static inline void kernel_planes_from_eye(const kernel_frame *f, const kernel_tile *tile, double axes[3][KERNEL_LANES],
                                          double offset[KERNEL_LANES])
{
    const bool flat = f->job->camera.is_orthographic;
    const double scale = f->job->space.scale;
    double x[KERNEL_BLOCKS_ACROSS + 1], y[KERNEL_BLOCKS_ACROSS + 1];
    kernel_compute_block_borders(f, tile, x, y);
    memset(axes, 0, 3 * sizeof *axes);
    memset(offset, 0, KERNEL_LANES * sizeof *offset);
    for (int n = 0; n <= KERNEL_BLOCKS_ACROSS; n++) {
        const int row = KERNEL_ROWS_LANE + n;
        axes[0][n] = 1;
        axes[1][row] = -1;
        axes[2][n] = flat ? 0 : -x[n];
        axes[2][row] = flat ? 0 : y[n];
        offset[n] = flat ? -x[n] * scale : 0;
        offset[row] = flat ? y[n] * scale : 0;
    }
    axes[2][KERNEL_DEPTH_LANE] = axes[2][KERNEL_ALONG_LANE] = 1;
    offset[KERNEL_DEPTH_LANE] = -f->depth_shift;
    axes[0][KERNEL_ALONG_LANE] = flat || !tile ? 0 : tile->centre_x;
    axes[1][KERNEL_ALONG_LANE] = flat || !tile ? 0 : tile->centre_y;
}

/* Loads the planes from arrays of their normals, offsets and error bounds, with one entry per lane. */
static inline void kernel_planes_load(kernel_planes *q, float (*const normal)[KERNEL_LANES], const float *offset,
                                      const float *error)
{
    for (int v = 0; v < KERNEL_LANE_VECTORS; v++) {
        for (int a = 0; a < 3; a++) {
            q->normal[a][v] = vf_load(normal[a] + v * SIMD_WIDTH);
            q->size[a][v] = vf_abs(q->normal[a][v]);
        }
        q->offset[v] = vf_load(offset + v * SIMD_WIDTH);
        q->error[v] = vf_load(error + v * SIMD_WIDTH);
    }
}

/* Computes the planes against which the boxes of tree nodes are tested, in the coordinates of the trees (tree space of
 * kernel_types.h). The planes are those of the tile's block borders, or of the whole picture if tile is NULL. Normals
 * are rounded before the offsets are computed, so that the planes still pass through the eye. The remaining error is a
 * rotation of the planes about the eye by the rounding of the normals. */
static inline void kernel_compute_planes_for_tree_boxes(kernel_planes *q, const kernel_frame *f,
                                                        const kernel_tile *tile)
{
    const render_camera *c = &f->job->camera;
    const render_space *s = &f->job->space;
    double axes[3][KERNEL_LANES], exact[KERNEL_LANES], size = 0;
    float normal[3][KERNEL_LANES], offset[KERNEL_LANES], error[KERNEL_LANES];
    kernel_planes_from_eye(f, tile, axes, exact);
    for (int i = 0; i < KERNEL_LANES; i++) error[i] = 0;
    for (int a = 0; a < 3; a++) {
        const double eye = (c->eye[a] - s->origin[a]) * s->scale;
        size = fabs(eye) > size ? fabs(eye) : size;
        for (int i = 0; i < KERNEL_LANES; i++) {
            normal[a][i] = (float)(axes[0][i] * c->right[a] + axes[1][i] * c->up[a] + axes[2][i] * c->forward[a]);
            exact[i] -= (double)normal[a][i] * eye;
            error[i] += fabsf(normal[a][i]);
        }
    }
    /* Upper bound of the rounding error of a distance, counted in roundings; one rounding is a relative error of 6e-8.
     * Positions near the scene and the eye have magnitudes of at most size + 1. The sum of three products errs by at
     * most 4 roundings of this magnitude times the 1-norm of the normal. The centre and the half widths of a box add 1
     * rounding, and the normal and the offset 1 more. The bound below has 16 roundings. */
    for (int i = 0; i < KERNEL_LANES; i++) {
        offset[i] = (float)exact[i];
        error[i] = 16 * 6e-8f * (error[i] * ((float)size + 2) + fabsf(offset[i]));
    }
    kernel_planes_load(q, normal, offset, error);
}

/* Computes the planes against which the vertices of cells are tested, in tile space (kernel_types.h). The signed
 * distance of a position from the plane of a border between columns is X - slope * Z - origin, where slope and origin
 * are those of the border. For borders between rows it is slope * Z + origin - Y. The lane of the distance along the
 * tile's middle ray is not used. */
static inline void kernel_compute_planes_for_cells(kernel_planes *q, const kernel_frame *f, const kernel_tile *tile)
{
    const bool flat = f->job->camera.is_orthographic;
    const double reach = kernel_slope_to_origin(f);
    float normal[3][KERNEL_LANES] = {{0}}, offset[KERNEL_LANES] = {0}, error[KERNEL_LANES];
    double columns[KERNEL_BLOCKS_ACROSS + 1], rows[KERNEL_BLOCKS_ACROSS + 1];
    kernel_compute_block_borders(f, tile, columns, rows);
    for (int n = 0; n <= KERNEL_BLOCKS_ACROSS; n++) {
        const double x = columns[n] - tile->centre_x, y = rows[n] - tile->centre_y;
        const int row = KERNEL_ROWS_LANE + n;
        normal[0][n] = 1;
        normal[1][row] = -1;
        normal[2][n] = flat ? 0 : (float)-x;
        normal[2][row] = flat ? 0 : (float)y;
        offset[n] = (float)(-x * reach);
        offset[row] = (float)(y * reach);
    }
    normal[2][KERNEL_DEPTH_LANE] = 1;
    for (int i = 0; i < KERNEL_LANES; i++) error[i] = fabsf(offset[i]);
    kernel_planes_load(q, normal, offset, error);
}

/* Where a body (the box of a tree's node, or a cell) lies relative to the planes of a tile's block borders. */
typedef struct kernel_placement {
    /* Masks of planes, one bit per lane. below: planes for which part of the body has a distance <= 0; above: those for
     * which part has a distance >= 0. The bit of a plane that cuts the body is set in both. */
    unsigned below, above;
    unsigned blocks; /* mask of the blocks in which the body may be visible */
    /* near, far: the body's least and greatest depth; along: position of a box's middle along the direction of the
     * tile's middle ray, by which child nodes are sorted */
    float near, far, along;
} kernel_placement;

/* Sets the bits of one vector of planes in the masks `below` and `above` of the placement. vector: index of the vector;
 * low, high: the body's least and greatest signed distance from each plane. If the vector has the lane of depths,
 * `near` and `far` are set too. */
SIMD_INLINE void kernel_placement_set_sides_of_planes(kernel_placement *placement, int vector, vf low, vf high)
{
    placement->below |= vm_bits(vf_le(low, vf_set(0))) << vector * SIMD_WIDTH;
    placement->above |= vm_bits(vf_le(vf_set(0), high)) << vector * SIMD_WIDTH;
    if (vector != KERNEL_DEPTH_LANE / SIMD_WIDTH) return;
    placement->near = low[KERNEL_DEPTH_LANE % SIMD_WIDTH];
    placement->far = high[KERNEL_DEPTH_LANE % SIMD_WIDTH];
}

/* Sets placement->blocks to the mask of the blocks that the body may overlap. For each of a block's four borders, some
 * part of the body must be on the block's side of the border. */
SIMD_INLINE void kernel_placement_find_blocks(kernel_placement *placement)
{
    const unsigned inner = placement->above & placement->below >> 1;
    placement->blocks = kernel_mask_blocks_in_columns_and_rows(inner & 15, inner >> KERNEL_ROWS_LANE & 15);
}

/* Computes the least and the greatest signed distance of a node's box from each plane, and from these the blocks in
 * which the box may be visible. */
SIMD_INLINE kernel_placement kernel_box_placement(const kernel_planes *q, const mmbvh *tree, int64_t node)
{
    float lower[4], upper[4];
    kernel_placement placement = {0};
    mmbvh_node_box(tree, node, lower, upper);
    const float middle[3] = {0.5f * (lower[0] + upper[0]), 0.5f * (lower[1] + upper[1]), 0.5f * (lower[2] + upper[2])};
    const float half[3] = {0.5f * (upper[0] - lower[0]), 0.5f * (upper[1] - lower[1]), 0.5f * (upper[2] - lower[2])};
    for (int v = 0; v < KERNEL_LANE_VECTORS; v++) {
        const vf at =
            (q->normal[0][v] * middle[0] + q->normal[1][v] * middle[1]) + (q->normal[2][v] * middle[2] + q->offset[v]);
        const vf reach = (q->size[0][v] * half[0] + q->size[1][v] * half[1]) + (q->size[2][v] * half[2] + q->error[v]);
        kernel_placement_set_sides_of_planes(&placement, v, at - reach, at + reach);
        if (v == KERNEL_ALONG_LANE / SIMD_WIDTH) placement.along = at[KERNEL_ALONG_LANE % SIMD_WIDTH];
    }
    kernel_placement_find_blocks(&placement);
    return placement;
}

/* Margin by which the range of a cell's distances from a plane is widened, relative to the magnitude of the terms of a
 * distance. It is larger than all rounding errors, so that the blocks also contain rays that hit the cell only because
 * of rounding. */
#define KERNEL_OUTLINE_PAD 1e-5f

/* Computes the least and the greatest signed distance of points from each plane, and from these the blocks in which the
 * points' convex hull may be visible. places: x, y and z of the points in tile space. */
SIMD_INLINE kernel_placement kernel_points_placement(const kernel_planes *q, const float *const places[3], int count)
{
    kernel_placement placement = {0};
    float most[3] = {0, 0, 0};
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < count; i++) most[a] = fabsf(places[a][i]) > most[a] ? fabsf(places[a][i]) : most[a];
    for (int v = 0; v < KERNEL_LANE_VECTORS; v++) {
        vf low = vf_set(INFINITY), high = vf_set(-INFINITY);
        for (int i = 0; i < count; i++) {
            const vf at = (q->normal[0][v] * places[0][i] + q->normal[1][v] * places[1][i]) +
                          (q->normal[2][v] * places[2][i] + q->offset[v]);
            low = vf_min(low, at);
            high = vf_max(high, at);
        }
        const vf size = (q->size[0][v] * most[0] + q->size[1][v] * most[1]) + (q->size[2][v] * most[2] + q->error[v]);
        kernel_placement_set_sides_of_planes(&placement, v, low - size * KERNEL_OUTLINE_PAD,
                                             high + size * KERNEL_OUTLINE_PAD);
    }
    kernel_placement_find_blocks(&placement);
    return placement;
}

#endif
