/* Tests whether rays from hits, towards lights or into the hemisphere above a surface, are blocked. Terms:
 *     occluder          cell of this rank that an isovalue of an opaque surface crosses; its surface may block rays
 *     reach             distance from a ray's hit within which a cell does not block the ray: the member `contact` of
 *                       the cell's layer (render.h), times the size of the cell
 *     blocked           a ray is blocked if it crosses the opaque surface in a cell at least `reach` from its hit, and
 *                       before its end
 *     open              not known to be blocked
 *     slab              space between two parallel planes that contains the surface in a cell: |L| <= thickness, where
 *                       L is a linear function fitted to the field minus the isovalue (render_occluders.c)
 *     record            a hex's vertices, values and faces, stored in advance; from them a ray's crossings of the faces
 *                       are computed
 *     undecided pair    a ray and a cell for which neither slab nor record decides; the ray is traced in the cell
 *
 * Once per frame occluders are put into trees of their own, whose nodes have as many children as a vector has lanes.
 * Each ray traverses a tree on its own, and tests all children of a node, or all triangles or slabs of a leaf, at once.
 * So rays need not be coherent, and the traversal ends as soon as the ray is known to be blocked. The surface in a cell
 * is tested as follows:
 *     tets               are stored as the one or two triangles of the surface in the tet, which block a ray that
 *                        crosses them
 *     other cells        are stored as a bounding box and a slab; most rays miss one of the two
 *     hexes              are also stored as records; for a ray that meets the box and the slab, the values at the two
 *                        faces that it crosses decide in most cases, one ray-hex pair per lane
 *                        (kernel_occlusion_hexes.h)
 *     undecided pairs    are traced: the ray is intersected with the cell like a primary ray (kernel_occlusion.h)
 * Positions are in tree space (scaled units) in float32. For the test of triangles they are translated to the ray's
 * origin and sheared along the axis of its largest component (Woop, Benthin and Wald 2013). A triangle's vertices lie
 * on edges of the mesh and are computed from the edge alone. The edge functions of an edge in its two triangles differ
 * only in their sign, and 0 counts as inside for both, so that no ray passes between two triangles. In tree space,
 * positions below 1 are rounded by at most 6e-8: the vertices, and the ray's origin. The distance of 4e-6 by which
 * origins are lifted off the surface (render_light.h) is much larger.
 *
 * A box test may accept a ray that misses the box, but never the reverse. Everything else depends on the ray and the
 * cell alone. So results do not depend on the trees, on the order in which they are traversed, or on which rank holds a
 * cell. */
#ifndef RENDER_KERNEL_OCCLUDERS_H
#define RENDER_KERNEL_OCCLUDERS_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "kernel_types.h"
#include "mmbvh.h"
#include "simd.h"

/* Indices of the rows of floats that a leaf consists of. A row has one float per lane, and each lane has one triangle
 * or one slab. Leaves of triangles have the first set of rows, leaves of slabs the second. */
enum {
    KERNEL_TRIANGLE_CORNERS = 0, /* x, y, z of the three corners */
    KERNEL_TRIANGLE_REACH = 9,   /* reach: distance from a ray's hit within which the cell does not block it */
    KERNEL_TRIANGLE_ROWS,
    KERNEL_SLAB_LOWER = 0, /* bounding box of the cell: lower and upper corner */
    KERNEL_SLAB_UPPER = 3,
    /* coefficients of the linear function L = gradient . position + level that defines a slab; on the surface |L| is at
     * most `thickness` */
    KERNEL_SLAB_GRADIENT = 6,
    KERNEL_SLAB_LEVEL = 9,
    KERNEL_SLAB_THICKNESS,
    KERNEL_SLAB_ERROR, /* bound of L's rounding error, divided by the largest magnitude of positions */
    KERNEL_SLAB_REACH, /* reach: distance from a ray's hit within which the cell does not block it */
    KERNEL_SLAB_ROWS
};

/* A hex's record consists of floats: per vertex x, y, z (tree space) and the field minus the isovalue; then, from
 * KERNEL_CURVED_RECORD_QUADS on, the corners of its six faces, packed as in kernel_transformed_curved. It has
 * KERNEL_CURVED_RECORD_WORDS floats. */
enum { KERNEL_CURVED_RECORD_QUADS = 32, KERNEL_CURVED_RECORD_WORDS = 40 };

/* An occluder: a cell that an opaque isosurface crosses, and the isovalue. */
typedef struct kernel_occluder {
    /* indices: of the surface among the frame's surfaces, of the isovalue in the surface's layer, and of the mesh
     * part */
    int32_t surface, value, part;
    uint32_t cell;
    int32_t record; /* index of the cell's record in kernel_occluders.hexes; -1 if it has none */
} kernel_occluder;

/* A tree whose nodes have one child per lane. Lanes without a child have an empty box. */
typedef struct kernel_occluder_tree {
    int32_t node_count, leaf_count; /* number of nodes and number of leaves; both are 0 if the tree is empty */
    /* bounding boxes of the nodes' children: per node 6 rows of one float per lane (x, y, z of the lower corner, then
     * of the upper) */
    float *boxes;
    int32_t *children; /* per node and lane: the index of a child node, or ~index of a leaf */
    /* the rows of all leaves, leaf after leaf: KERNEL_TRIANGLE_ROWS or KERNEL_SLAB_ROWS rows of one float per lane
     * each */
    float *leaves;
    /* per leaf and lane: index of the triangle's surface in the frame, or index of the slab's cell in
     * kernel_occluders.cells; -1 if the lane is empty */
    int32_t *sources;
    float size; /* upper bound of the magnitude of all coordinates */
} kernel_occluder_tree;

typedef struct kernel_occluders {
    int width; /* number of lanes of the kernels that traverse the trees */
    kernel_occluder_tree triangles, slabs;
    kernel_occluder *cells; /* the cells that contain the slabs; slabs refer to them by sources[] */
    /* for each hex with a record, KERNEL_CURVED_RECORD_WORDS floats: vertices, values and faces */
    float *hexes;
} kernel_occluders;

/* A ray from a hit, in tree space. It ends at the distance `far` from its origin, in scaled units. is_open: set until
 * something is found that blocks it. */
typedef struct kernel_secondary_ray {
    float origin[3], direction[3]; /* the direction has unit length */
    float far;
    bool is_open;
    /* hit: index of the ray's hit among the hits that a thread traces together; number: index of the ray in the
     * hemisphere or, for a ray to a light, RENDER_MAX_SAMPLES plus the light's index */
    int16_t hit, number;
} kernel_secondary_ray;

/* A ray and a cell in which it must be traced, because simpler tests have not decided whether the cell blocks it. ray:
 * index in kernel_secondary_rays.rays; occluder: index in kernel_occluders.cells. */
typedef struct kernel_undecided_pair {
    int32_t ray, occluder;
} kernel_undecided_pair;

typedef struct kernel_secondary_rays {
    int count;
    kernel_secondary_ray *rays;
    int64_t undecided_count, capacity;
    /* undecided pairs: slab and record do not decide whether the cell blocks the ray */
    kernel_undecided_pair *undecided;
} kernel_secondary_rays;

/* Enlarges the list of undecided pairs; returns false if memory ran out. */
bool render_grow_undecided(kernel_secondary_rays *s);

/* ---- a ray, prepared for traversal ---- */

typedef struct kernel_prepared_ray {
    const kernel_secondary_ray *ray;
    /* Per axis: the ray meets the plane with the coordinate x on this axis at the distance x * inverse + shift along
     * the ray. The shifts for a box's near and far planes differ, so that boxes are extended by more than the rounding
     * error. */
    vf inverse[3], near_shift[3], far_shift[3];
    /* Offsets, in floats, into the six rows of a node's boxes. near_row: per axis, offset of the row with those planes
     * of the boxes that the ray meets first; far_row: offset of the row with the opposite planes. */
    int near_row[3], far_row[3];
    int kx, ky, kz; /* kz: the axis with the direction's largest component; kx, ky: the next two axes in cyclic order */
    /* with d the ray's direction: d[kx] / d[kz], d[ky] / d[kz] and 1 / d[kz] */
    float shear_x, shear_y, stretch;
    /* upper bound of the magnitude of positions, to which the rounding errors of the slabs' linear functions are
     * proportional */
    float size;
} kernel_prepared_ray;

SIMD_INLINE void kernel_prepared_ray_set_axes(const kernel_secondary_ray *ray, kernel_prepared_ray *p)
{
    const float x = fabsf(ray->direction[0]), y = fabsf(ray->direction[1]), z = fabsf(ray->direction[2]);
    p->kz = x > y ? (x > z ? 0 : 2) : y > z ? 1 : 2;
    p->kx = (p->kz + 1) % 3;
    p->ky = (p->kz + 2) % 3;
    p->stretch = 1 / ray->direction[p->kz];
    p->shear_x = ray->direction[p->kx] * p->stretch;
    p->shear_y = ray->direction[p->ky] * p->stretch;
}

/* Prepares a ray for the traversal of a tree whose coordinates have magnitudes of at most tree_size. The computed
 * distance to a plane (two products and a difference) has an error of at most 3 rounding units (6e-8) of the positions'
 * magnitude, and the rounding of `inverse` adds one. Boxes are extended by 16 such units. */
SIMD_INLINE void kernel_prepared_ray_begin(const kernel_secondary_ray *ray, float tree_size, kernel_prepared_ray *p)
{
    float size = tree_size;
    p->ray = ray;
    for (int a = 0; a < 3; a++) size = simd_max(size, fabsf(ray->origin[a]));
    p->size = 4 * size;
    for (int a = 0; a < 3; a++) {
        const float d = ray->direction[a], least = d < 0 ? -1e-12f : 1e-12f;
        const float inverse = 1 / (fabsf(d) < 1e-12f ? least : d), shift = ray->origin[a] * inverse;
        const float pad = 16 * 6e-8f * size * fabsf(inverse);
        p->inverse[a] = vf_set(inverse);
        p->near_shift[a] = vf_set(-(shift + pad));
        p->far_shift[a] = vf_set(-(shift - pad));
        p->near_row[a] = (inverse < 0 ? 3 + a : a) * SIMD_WIDTH;
        p->far_row[a] = (inverse < 0 ? a : 3 + a) * SIMD_WIDTH;
    }
    kernel_prepared_ray_set_axes(ray, p);
}

/* Returns a mask of the boxes that the ray meets, one box per lane. rows: six rows of one float per lane, x, y, z of
 * the boxes' lower corners and of their upper corners. *low and *high become the distances along the ray at which it
 * enters and leaves the boxes. */
SIMD_INLINE vm kernel_prepared_ray_intersect_boxes(const kernel_prepared_ray *p, const float *rows, vf *low, vf *high)
{
    *low = vf_set(0);
    *high = vf_set(p->ray->far);
    for (int a = 0; a < 3; a++) {
        *low = vf_max(vf_muladd(vf_load(rows + p->near_row[a]), p->inverse[a], p->near_shift[a]), *low);
        *high = vf_min(vf_muladd(vf_load(rows + p->far_row[a]), p->inverse[a], p->far_shift[a]), *high);
    }
    return vf_le(*low, *high);
}

/* ---- triangles ---- */

/* Returns a mask of a leaf's triangles, one per lane, that the ray crosses before its end and not closer to its origin
 * than the triangle's reach (KERNEL_TRIANGLE_REACH). Stores the distances of the crossings in *t. */
SIMD_INLINE vm kernel_prepared_ray_intersect_triangles(const kernel_prepared_ray *p, const float *rows, vf *t)
{
    const float *o = p->ray->origin;
    vf x[3], y[3], z[3];
    for (int i = 0; i < 3; i++) {
        const float *corner = rows + (ptrdiff_t)(KERNEL_TRIANGLE_CORNERS + 3 * i) * SIMD_WIDTH;
        z[i] = vf_load(corner + p->kz * SIMD_WIDTH) - o[p->kz];
        x[i] = (vf_load(corner + p->kx * SIMD_WIDTH) - o[p->kx]) - z[i] * p->shear_x;
        y[i] = (vf_load(corner + p->ky * SIMD_WIDTH) - o[p->ky]) - z[i] * p->shear_y;
    }
    const vf u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
    const vf least = vf_min(vf_min(u, v), w), most = vf_max(vf_max(u, v), w), zero = vf_set(0);
    const vm inside = vm_or(vf_le(zero, least), vf_le(most, zero));
    *t = zero;
    if (!vm_any(inside)) return inside;
    *t = ((u * z[0] + v * z[1]) + w * z[2]) * p->stretch / ((u + v) + w);
    const vf reach = vf_load(rows + KERNEL_TRIANGLE_REACH * SIMD_WIDTH);
    return vm_and(inside, vm_and(vf_le(reach, *t), vf_lt(*t, vf_set(p->ray->far))));
}

/* ---- slabs ---- */

/* Computes, for each slab of a leaf, its linear function L along the ray, which is level + rise * t at the distance t,
 * and the slab's thickness, enlarged by the bound of L's rounding error. */
SIMD_INLINE void kernel_compute_slab_functions(const kernel_prepared_ray *p, const float *rows, vf *level, vf *rise,
                                               vf *thickness)
{
    *level = vf_load(rows + KERNEL_SLAB_LEVEL * SIMD_WIDTH);
    *rise = vf_set(0);
    for (int a = 0; a < 3; a++) {
        const vf g = vf_load(rows + (ptrdiff_t)(KERNEL_SLAB_GRADIENT + a) * SIMD_WIDTH);
        *level += g * p->ray->origin[a];
        *rise += g * p->ray->direction[a];
    }
    *thickness =
        vf_load(rows + KERNEL_SLAB_ERROR * SIMD_WIDTH) * p->size + vf_load(rows + KERNEL_SLAB_THICKNESS * SIMD_WIDTH);
}

/* Returns the slabs of a leaf in whose cells the ray may cross the surface: the ray meets the cell's box and, within
 * the box and farther away than the reach, the slab. level, rise, thickness: as in kernel_compute_slab_functions(). */
SIMD_INLINE vm kernel_prepared_ray_intersect_slabs(const kernel_prepared_ray *p, const float *rows, vf *level, vf *rise,
                                                   vf *thickness)
{
    vf low, high;
    const vm met = kernel_prepared_ray_intersect_boxes(p, rows, &low, &high);
    *level = *rise = *thickness = vf_set(0);
    if (!vm_any(met)) return met;
    low = vf_max(0.9999f * vf_load(rows + KERNEL_SLAB_REACH * SIMD_WIDTH), low);
    kernel_compute_slab_functions(p, rows, level, rise, thickness);
    const vf first = *level + *rise * low, last = *level + *rise * high;
    /* Even for a ray without an end `high` is finite, because the ray leaves the box at a finite distance. */
    const vm beside = vm_or(vf_lt(*thickness, vf_min(first, last)), vf_lt(vf_max(first, last), -*thickness));
    return vm_andnot(vm_and(met, vf_le(low, high)), beside);
}

#endif
