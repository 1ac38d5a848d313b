/* Occluders are the cells that an isovalue of this rank's opaque surfaces crosses, which may block rays from hits.
 *
 * Once per frame they are put into trees of their own, whose nodes have as many children as a vector has lanes. A ray
 * traverses a tree alone and tests all children of a node, or all pieces of a leaf, at once. So rays need not be
 * coherent, and the traversal ends as soon as the ray is known to be blocked.
 *     tets              their pieces of the surface are stored as triangles, which a ray meets or not
 *     other cells       a box, and two planes between which the surface lies: most rays pass outside
 *     hexes             the faces and the values there decide next, one ray-hex pair per lane
 *                       (kernel_occlusion_hexes.h)
 *     undecided rays    are traced in the cell like primary rays (kernel_occlusion.h)
 * Everything is in tree space in float32, translated to the ray's origin and sheared along its largest axis (Woop,
 * Benthin and Wald 2013). A triangle's vertices lie on edges of the mesh and are computed from the edge alone. An edge
 * function is the same number with the other sign in both triangles of an edge, and 0 counts as inside for both: so no
 * ray passes between two triangles. In tree space positions below 1 are rounded by at most 6e-8: so are vertices, and
 * the ray's origin; the lift of 4e-6 (render_light.h) is much larger.
 *
 * A box test may accept a ray that misses the box, but never the reverse. Everything else depends on the ray and the
 * cell alone. So results do not depend on the trees, on their order, or on which rank holds a cell. */
#ifndef RENDER_KERNEL_OCCLUDERS_H
#define RENDER_KERNEL_OCCLUDERS_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#include "kernel_types.h"
#include "mmbvh.h"
#include "simd.h"

/* Indices of the rows of floats that a leaf consists of. A row has one float per lane. Triangles and slabs have
 * different rows. */
enum {
    KERNEL_TRIANGLE_CORNERS = 0, /* x, y, z of the three corners */
    KERNEL_TRIANGLE_REACH = 9,   /* distance from a ray's hit within which the cell does not block the ray */
    KERNEL_TRIANGLE_ROWS,
    KERNEL_SLAB_LOWER = 0, /* bounding box of the cell: lower and upper corner */
    KERNEL_SLAB_UPPER = 3,
    /* coefficients of the linear function L = gradient . position + level that defines a slab; on the surface |L| is at
     * most `thickness` */
    KERNEL_SLAB_GRADIENT = 6,
    KERNEL_SLAB_LEVEL = 9,
    KERNEL_SLAB_THICKNESS,
    KERNEL_SLAB_ERROR, /* rounding error of the slab's linear function L, divided by the size of positions */
    KERNEL_SLAB_REACH, /* distance from a ray's hit within which the cell does not block the ray */
    KERNEL_SLAB_ROWS
};

/* A hex's record: 8 vertices with their values less the isovalue, and the corners of its faces as in
 * kernel_transformed_curved. */
enum { KERNEL_CURVED_RECORD_QUADS = 32, KERNEL_CURVED_RECORD_WORDS = 40 };

/* A cell that an opaque isosurface crosses, together with the isovalue. */
typedef struct kernel_occluder {
    /* index of the surface in the frame, of the isovalue in the surface's layer, and of the mesh part */
    int32_t surface, value, part;
    uint32_t cell;
    int32_t record; /* index of the cell's record among those of hexes; -1 if it has none */
} kernel_occluder;

/* A tree whose nodes have one child per lane. Lanes without a child have an empty box. */
typedef struct kernel_occluder_tree {
    int32_t node_count, leaf_count; /* numbers of nodes and leaves; 0 if the tree is empty */
    float *boxes;                   /* boxes of the nodes' children: per node 6 rows of lanes, lower and upper corner */
    int32_t *children;              /* per node and lane: the index of a child node, or ~index of a leaf */
    float *leaves;                  /* the rows of all leaves */
    /* per leaf and lane: a triangle's surface or a slab's occluder; -1 if the lane is empty */
    int32_t *sources;
    float size; /* upper bound of the magnitude of all coordinates */
} kernel_occluder_tree;

typedef struct kernel_occluders {
    int width; /* number of lanes of the kernels that traverse the trees */
    kernel_occluder_tree triangles, slabs;
    kernel_occluder *cells;
    float *hexes; /* records of hexes (KERNEL_CURVED_RECORD_WORDS floats each) */
} kernel_occluders;

/* A ray from a hit, in tree space. It ends at the distance `far`, and is open until something blocks it. */
typedef struct kernel_secondary_ray {
    float origin[3], direction[3]; /* the direction has unit length */
    float far;
    bool is_open;
    /* hit: index of the ray's hit in its chunk; number: index of the ray in the hemisphere or, for a ray to a light,
     * RENDER_MAX_SAMPLES plus the light's index */
    int16_t hit, number;
} kernel_secondary_ray;

/* A ray that the trees cannot decide for a cell, so that it must be traced in that cell. */
typedef struct kernel_undecided_pair {
    int32_t ray, occluder;
} kernel_undecided_pair;

typedef struct kernel_secondary_rays {
    int count;
    kernel_secondary_ray *rays;
    int64_t undecided_count, capacity;
    kernel_undecided_pair *undecided; /* undecided ray-cell pairs, sorted by ray */
} kernel_secondary_rays;

/* Grows the list of undecided pairs; returns false if memory runs out. */
bool render_grow_undecided(kernel_secondary_rays *s);

/* ---- a ray, prepared for traversal ---- */

typedef struct kernel_prepared_ray {
    const kernel_secondary_ray *ray;
    /* The ray meets an axis-aligned plane at the distance plane * inverse + shift. The shifts for near and far planes
     * differ so that boxes are extended by more than the rounding error. */
    vf inverse[3], near_shift[3], far_shift[3];
    /* for each axis, offset in a node's rows of boxes of the plane that the ray meets first, and of the other one */
    int near_row[3], far_row[3];
    int kx, ky, kz; /* kz is the axis with the largest component of the direction; kx and ky follow it cyclically */
    /* with d the ray's direction: d[kx] / d[kz], d[ky] / d[kz] and 1 / d[kz] */
    float shear_x, shear_y, stretch;
    float size; /* size of positions, from which the rounding error of the slabs' linear functions is computed */
} kernel_prepared_ray;

SIMD_INLINE void kernel_prepared_ray_axes(const kernel_secondary_ray *ray, kernel_prepared_ray *p)
{
    const float x = fabsf(ray->direction[0]), y = fabsf(ray->direction[1]), z = fabsf(ray->direction[2]);
    p->kz = x > y ? (x > z ? 0 : 2) : y > z ? 1 : 2;
    p->kx = (p->kz + 1) % 3;
    p->ky = (p->kz + 2) % 3;
    p->stretch = 1 / ray->direction[p->kz];
    p->shear_x = ray->direction[p->kx] * p->stretch;
    p->shear_y = ray->direction[p->ky] * p->stretch;
}

/* Prepares a ray for a tree. The computed distance to a plane (two products and a difference) has an error of at most 3
 * rounding units (6e-8) of the positions' size, and the rounding of `inverse` adds one; boxes are extended by more than
 * that. */
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
    kernel_prepared_ray_axes(ray, p);
}

/* Returns the boxes, given in six rows, that the ray meets; stores the distances at which it enters and leaves them. */
SIMD_INLINE vm kernel_prepared_ray_boxes(const kernel_prepared_ray *p, const float *rows, vf *low, vf *high)
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

/* Returns the triangles of a leaf that the ray meets, and stores the distances of the crossings in *t. */
SIMD_INLINE vm kernel_prepared_ray_triangles(const kernel_prepared_ray *p, const float *rows, vf *t)
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

/* Computes the linear function L of each slab along the ray, as level + rise * t, and the slab's thickness including
 * rounding. */
SIMD_INLINE void kernel_prepared_ray_level(const kernel_prepared_ray *p, const float *rows, vf *level, vf *rise,
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

/* Returns the cells of a leaf in which the ray may meet the surface: it meets the cell's box, and the slab within the
 * box. */
SIMD_INLINE vm kernel_prepared_ray_slabs(const kernel_prepared_ray *p, const float *rows, vf *level, vf *rise,
                                         vf *thickness)
{
    vf low, high;
    const vm met = kernel_prepared_ray_boxes(p, rows, &low, &high);
    *level = *rise = *thickness = vf_set(0);
    if (!vm_any(met)) return met;
    low = vf_max(0.9999f * vf_load(rows + KERNEL_SLAB_REACH * SIMD_WIDTH), low);
    kernel_prepared_ray_level(p, rows, level, rise, thickness);
    const vf first = *level + *rise * low, last = *level + *rise * high;
    /* A ray without an end leaves the box at a finite distance, so `high` is finite. */
    const vm beside = vm_or(vf_lt(*thickness, vf_min(first, last)), vf_lt(vf_max(first, last), -*thickness));
    return vm_andnot(vm_and(met, vf_le(low, high)), beside);
}

#endif
