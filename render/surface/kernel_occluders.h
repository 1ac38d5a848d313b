/* Occluders: the cells that an isovalue of this rank's opaque surfaces crosses, by which rays from hits may be blocked.
 * Once a frame they are put into trees of their own, whose nodes have as many children as a vector has lanes. A ray
 * goes down alone and tests all children of a node, or all pieces of a leaf, at once. So rays need nothing in common,
 * and a ray ends at the first root that is found on it.
 *
 *     tets              their pieces of the surface as triangles, which a ray meets or not
 *     other cells       a box, and two planes that the surface lies between: most rays pass beside
 *     hexes             the faces and the values there then decide, a ray and its hex a lane
 *                       (kernel_occlusion_hexes.h)
 *     rays in doubt     are traced in the cell, as primary rays are (kernel_occlusion.h)
 *
 * Everything is in tree space in float32, moved to the ray's origin and sheared along its largest axis (Woop, Benthin
 * and Wald 2013). A triangle's vertices lie on edges of the mesh and are computed from the edge alone; an edge function
 * is the same number with the other sign in both triangles of an edge, and 0 counts for both: nothing slips through
 * between two. In tree space a place rounds by 6e-8 at most where coordinates are below 1: so do vertices, and the
 * ray's origin, which the lift of 4e-6 (render_light.h) outweighs.
 *
 * A box test may let a ray in that misses the box, but never the reverse. Everything else depends on the ray and the
 * cell alone. So answers do not depend on the trees, on the order in them, or on which rank holds a cell. */
#ifndef RENDER_KERNEL_OCCLUDERS_H
#define RENDER_KERNEL_OCCLUDERS_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "kernel_types.h"
#include "mmbvh.h"
#include "simd.h"

/* Rows of a leaf, each of as many floats as there are lanes. */
enum {
    KERNEL_TRIANGLE_CORNERS = 0, /* x, y, z of three */
    KERNEL_TRIANGLE_REACH = 9,
    KERNEL_TRIANGLE_ROWS,
    KERNEL_SLAB_LOWER = 0, /* the cell's box */
    KERNEL_SLAB_UPPER = 3,
    KERNEL_SLAB_GRADIENT = 6, /* L = gradient . place + level; where the surface is, |L| is no more than thickness */
    KERNEL_SLAB_LEVEL = 9,
    KERNEL_SLAB_THICKNESS,
    KERNEL_SLAB_BLUR, /* what L rounds by, times the size of places */
    KERNEL_SLAB_REACH,
    KERNEL_SLAB_ROWS
};

/* A hex's record: 8 vertices with their values less the isovalue, corners and turned as in kernel_placed_curved. */
enum { KERNEL_CURVED_RECORD_QUADS = 32, KERNEL_CURVED_RECORD_TURNED = 38, KERNEL_CURVED_RECORD_WORDS = 40 };

/* A cell with one of its isovalues. */
typedef struct kernel_occluder {
    int32_t surface, value, part; /* among the frame's opaque surfaces; of the surface's */
    uint32_t cell;
    int32_t record; /* among hexes; -1: it has none */
} kernel_occluder;

/* Nodes have as many children as there are lanes, lanes without one an empty box. */
typedef struct kernel_occluder_tree {
    int32_t node_count, leaf_count; /* 0: nothing is in it */
    float *boxes;                   /* node_count × 6 rows: lower, upper */
    int32_t *children;              /* node_count × lanes: a node, or ~leaf */
    float *leaves;                  /* rows of all leaves */
    int32_t *sources;               /* leaves × lanes: of a triangle its surface, of a slab its occluder; -1: none */
    float size;                     /* no coordinate is larger */
} kernel_occluder_tree;

typedef struct kernel_occluders {
    int width; /* lanes of the kernels that go down the trees */
    kernel_occluder_tree triangles, slabs;
    kernel_occluder *cells;
    float *hexes; /* records */
} kernel_occluders;

/* A ray in tree space. */
typedef struct kernel_straight {
    float origin[3], direction[3]; /* unit length */
    float far;
    bool is_open;
} kernel_straight;

/* A ray that must be traced in a cell. */
typedef struct kernel_doubt {
    int32_t ray, occluder;
} kernel_doubt;

typedef struct kernel_straights {
    int count;
    kernel_straight *rays;
    int64_t doubt_count, capacity;
    kernel_doubt *doubts; /* in the order of rays */
    bool (*grow)(struct kernel_straights *rays);
} kernel_straights;

/* ---- a ray, ready to go down ---- */

typedef struct kernel_plumb {
    const kernel_straight *ray;
    /* Planes are met at plane * inverse + shift; boxes are widened by what that rounds by. */
    vf inverse[3], near_shift[3], far_shift[3];
    int near_row[3], far_row[3];
    int kx, ky, kz; /* kz: the direction's largest axis */
    float shear_x, shear_y, stretch;
    float size; /* for places: for what slabs round by */
} kernel_plumb;

SIMD_INLINE void kernel_plumb_axes(const kernel_straight *ray, kernel_plumb *p)
{
    const float x = fabsf(ray->direction[0]), y = fabsf(ray->direction[1]), z = fabsf(ray->direction[2]);
    p->kz = x > y ? (x > z ? 0 : 2) : y > z ? 1 : 2;
    p->kx = (p->kz + 1) % 3;
    p->ky = (p->kz + 2) % 3;
    p->stretch = 1 / ray->direction[p->kz];
    p->shear_x = ray->direction[p->kx] * p->stretch;
    p->shear_y = ray->direction[p->ky] * p->stretch;
}

/* Two products and a difference round by at most 3 units of the positions' size, the inverse by one more. */
SIMD_INLINE void kernel_plumb_begin(const kernel_straight *ray, float tree_size, kernel_plumb *p)
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
    kernel_plumb_axes(ray, p);
}

/* Returns the boxes, given in six rows, that the ray meets, and the distances between which it is in them. */
SIMD_INLINE vm kernel_plumb_boxes(const kernel_plumb *p, const float *rows, vf *low, vf *high)
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

/* Returns the leaf's triangles that the ray meets, and where. */
SIMD_INLINE vm kernel_plumb_triangles(const kernel_plumb *p, const float *rows, vf *t)
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

/* L on the ray is level + rise t. */
SIMD_INLINE void kernel_plumb_level(const kernel_plumb *p, const float *rows, vf *level, vf *rise, vf *thickness)
{
    *level = vf_load(rows + KERNEL_SLAB_LEVEL * SIMD_WIDTH);
    *rise = vf_set(0);
    for (int a = 0; a < 3; a++) {
        const vf g = vf_load(rows + (ptrdiff_t)(KERNEL_SLAB_GRADIENT + a) * SIMD_WIDTH);
        *level += g * p->ray->origin[a];
        *rise += g * p->ray->direction[a];
    }
    *thickness =
        vf_load(rows + KERNEL_SLAB_BLUR * SIMD_WIDTH) * p->size + vf_load(rows + KERNEL_SLAB_THICKNESS * SIMD_WIDTH);
}

/* Returns the leaf's cells in which the ray may meet the surface. */
SIMD_INLINE vm kernel_plumb_slabs(const kernel_plumb *p, const float *rows, vf *level, vf *rise, vf *thickness)
{
    vf low, high;
    const vm met = kernel_plumb_boxes(p, rows, &low, &high);
    *level = *rise = *thickness = vf_set(0);
    if (!vm_any(met)) return met;
    low = vf_max(0.9999f * vf_load(rows + KERNEL_SLAB_REACH * SIMD_WIDTH), low);
    kernel_plumb_level(p, rows, level, rise, thickness);
    const vf first = *level + *rise * low, last = *level + *rise * high;
    /* A ray without an end leaves the box before, so that high is a number. */
    const vm beside = vm_or(vf_lt(*thickness, vf_min(first, last)), vf_lt(vf_max(first, last), -*thickness));
    return vm_andnot(vm_and(met, vf_le(low, high)), beside);
}

#endif
