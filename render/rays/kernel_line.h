/* The edge function of a cell's edge, for all rays of a tile.
 *
 * In the plane of the ray with parameters u, v (its slopes, or its origin where the camera is orthographic) a vertex
 * placed at X, Y, Z in tile space is at x = X - u D, y = Y - v D, where D is its depth from the eye, or 1 where the
 * camera is orthographic. The edge function is then affine in u and v, for the products u v cancel:
 *
 *     e = xa yb - xb ya = (Xa Yb - Xb Ya) + u (Db Ya - Da Yb) + v (Da Xb - Db Xa)
 *
 * Its coefficients are computed once a cell and tile, from the edge's two vertices in the order of coordinates, so that
 * all cells of the edge have the same bits; a packet then needs two multiply-adds. On rays where that leaves the sign
 * in doubt, which depends on the edge and the ray alone, e is computed from the projected vertices instead, by
 * vf_diff_of_products(), to its exact sign.
 *
 * The bound of doubt. Let r = 2^-24, W the most of |u| and |v| over the tile, reach the eye's distance from the origin
 * of depth (0 where orthographic), M = |Z| + reach >= |D| (1 where orthographic), N = 2 max(|X|, |Y|) + 5 W M; so
 * |x|, |y| <= N / 2, |c| <= Na Nb / 2 and |cu| W, |cv| W <= Na Nb / 5.
 * - The affine form errs by r of each coefficient, of u and of v, and, if nothing is fused, of two products and two
 *   sums: by at most r (3 |c| + 5 |cu| W + 4 |cv| W) <= 3.3 r Na Nb.
 * - The projection, (X - origin) - slope Z, errs by r of the origin, of the first difference, twice of slope Z (the
 *   slope and the product), and of x: by at most r (2 |X| + 3 W M) <= r N. What has the exact sign is therefore the
 * edge function of vertices that are off by r N: by at most 4 r Na Nb / 2. The sum is 5.3 r Na Nb; 6 leaves room for
 * products of errors and for the bound's own roundings.
 *
 * Weights. Signs are exact, sizes are not: where a triangle is crossed, its depth and value are means of its vertices'
 * weighed by the opposite edges' functions, of sum A (twice the triangle's area as the ray sees it). An error d of one
 * of these moves the depth t by d |z - t| / A, z being its vertex's, and so all three by no more than D S / A, where D
 * is the sum of their d, and S the triangle's extent in depth; and the place across the ray by as much with the extent
 * across. By the count above d is at most r (3 |c| + 4 |cu| W + 3 |cv| W): what rounds u and v moves the ray, for all
 * triangles alike. So where A is at least D S / KERNEL_WEIGHT_ERROR, the weights' roundings move the crossing by no
 * more than KERNEL_WEIGHT_ERROR along the ray: 4 r with all of them at their worst, where t itself is rounded by up to
 * r / 2. The extents across count for a quarter: there a crossing may move by 4 times as much, as that changes the
 * value alone. On rays where A is less (the triangle is seen edge on, or the tile is wide beside it) all three edges
 * are projected: what errs then is where the vertices are, by r N as above, for all their triangles alike, and the
 * weights are exact to some r of each. Which it is depends on the triangle and the ray alone. (An edge in doubt has
 * been projected in any case: on a ray that crosses the triangle its e is off by no more than r N times the edges
 * beside it, which is what moved vertices do.) */
#ifndef RENDER_KERNEL_LINE_H
#define RENDER_KERNEL_LINE_H

#include <math.h>
#include <string.h>

#include "kernel_packet.h"
#include "kernel_types.h"
#include "simd.h"

/* c + cu u + cv v; its sign is sure where it is beyond +-bound. */
typedef struct kernel_line {
    float c, cu, cv, bound;
} kernel_line;

/* A vertex in tile space. */
typedef struct kernel_spot {
    float x, y, z;
} kernel_spot;

/* N above. */
SIMD_INLINE float kernel_spot_size(const kernel_frame *f, const kernel_tile *tile, kernel_spot a)
{
    const float depth = f->job->camera.is_orthographic ? 1 : fabsf(a.z) + fabsf((float)f->depth_shift);
    const float x = fabsf(a.x), y = fabsf(a.y);
    return 2 * (x > y ? x : y) + 5 * tile->radius * depth;
}

/* Makes the line of the edge from a to b, a before b in the order; sizes as above. */
SIMD_INLINE kernel_line kernel_line_between(const kernel_frame *f, kernel_spot a, kernel_spot b, float size_a,
                                            float size_b)
{
    const bool flat = f->job->camera.is_orthographic;
    const double da = flat ? 1 : (double)a.z + f->depth_shift, db = flat ? 1 : (double)b.z + f->depth_shift;
    const double ax = (double)a.x, ay = (double)a.y, bx = (double)b.x, by = (double)b.y;
    return (kernel_line){(float)(ax * by - bx * ay), (float)(db * ay - da * by), (float)(da * bx - db * ax),
                         6 * 6e-8f * (size_a * size_b)};
}

/* ---- how good weights are ---- */

/* Along the ray, in t: two of them in a ray's chord leave half of the 1e-6 that it may be off by (tests/test_chords.c).
 */
#define KERNEL_WEIGHT_ERROR 2.4e-7f

/* By how much an edge's function may err, d above, and its extent, the distances across for a quarter. */
typedef struct kernel_blur {
    float error, extent;
} kernel_blur;

SIMD_INLINE kernel_blur kernel_line_blur(const kernel_line *l, float radius, kernel_spot a, kernel_spot b)
{
    const float x = fabsf(a.x - b.x), y = fabsf(a.y - b.y), z = fabsf(a.z - b.z);
    return (kernel_blur){6e-8f * (3 * fabsf(l->c) + radius * (4 * fabsf(l->cu) + 3 * fabsf(l->cv))),
                         z + 0.25f * (x + y)};
}

/* The least A that is good enough, of a triangle whose edges' errors and extents have these sums: along an axis the
 * edges are together twice as long as the triangle. */
SIMD_INLINE float kernel_least_weight(float errors, float extents)
{
    return errors * extents * (0.5f / KERNEL_WEIGHT_ERROR);
}

/* The larger of both. */
SIMD_INLINE kernel_blur kernel_blur_more(kernel_blur a, kernel_blur b)
{
    return (kernel_blur){a.error < b.error ? b.error : a.error, a.extent < b.extent ? b.extent : a.extent};
}

/* No less than that of any triangle whose edges have no more than most each. */
SIMD_INLINE float kernel_blur_least(kernel_blur most)
{
    return 1.0001f * kernel_least_weight(3 * most.error, 3 * most.extent);
}

/* ---- four edges at once: the same operations, and so the same bits ---- */

typedef float kernel_four __attribute__((vector_size(16)));

SIMD_INLINE kernel_four kernel_four_load(const float *p)
{
    kernel_four v;
    memcpy(&v, p, sizeof v);
    return v;
}

/* Lanes of a vector, and of the three of a place. */
#define KERNEL_PICKED(v, i, j, k, l) __builtin_shufflevector(v, v, i, j, k, l)
#define KERNEL_PICK(at, i, j, k, l)                                                                                    \
    (kernel_spots)                                                                                                     \
    {                                                                                                                  \
        KERNEL_PICKED(at[0], i, j, k, l), KERNEL_PICKED(at[1], i, j, k, l), KERNEL_PICKED(at[2], i, j, k, l)           \
    }

typedef struct kernel_spots {
    kernel_four x, y, z;
} kernel_spots;

typedef double kernel_doubles __attribute__((vector_size(32)));

SIMD_INLINE kernel_four kernel_four_abs(kernel_four v)
{
    typedef int32_t kernel_four_bits __attribute__((vector_size(16)));
    return (kernel_four)((kernel_four_bits)v & 0x7fffffff);
}

/* kernel_line_between() of edges from a to b, and kernel_line_blur(). */
SIMD_INLINE void kernel_four_lines(const kernel_frame *f, float radius, kernel_spots a, kernel_spots b,
                                   kernel_four size_a, kernel_four size_b, kernel_line lines[4], kernel_four *errors,
                                   kernel_four *extents)
{
    const bool flat = f->job->camera.is_orthographic;
    const kernel_doubles ax = __builtin_convertvector(a.x, kernel_doubles),
                         ay = __builtin_convertvector(a.y, kernel_doubles);
    const kernel_doubles bx = __builtin_convertvector(b.x, kernel_doubles),
                         by = __builtin_convertvector(b.y, kernel_doubles);
    kernel_doubles da = __builtin_convertvector(a.z, kernel_doubles) + f->depth_shift;
    kernel_doubles db = __builtin_convertvector(b.z, kernel_doubles) + f->depth_shift;
    if (flat) da = db = (kernel_doubles){1, 1, 1, 1};
    const kernel_four c = __builtin_convertvector(ax * by - bx * ay, kernel_four);
    const kernel_four cu = __builtin_convertvector(db * ay - da * by, kernel_four);
    const kernel_four cv = __builtin_convertvector(da * bx - db * ax, kernel_four);
    const kernel_four bound = 6 * 6e-8f * (size_a * size_b);
    for (int n = 0; n < 4; n++) lines[n] = (kernel_line){c[n], cu[n], cv[n], bound[n]};
    const kernel_four x = kernel_four_abs(a.x - b.x), y = kernel_four_abs(a.y - b.y), z = kernel_four_abs(a.z - b.z);
    *errors = 6e-8f * (3 * kernel_four_abs(c) + radius * (4 * kernel_four_abs(cu) + 3 * kernel_four_abs(cv)));
    *extents = z + 0.25f * (x + y);
}

SIMD_INLINE kernel_line kernel_line_of(const kernel_packet *p, kernel_spot a, kernel_spot b)
{
    return kernel_line_between(p->frame, a, b, kernel_spot_size(p->frame, p->tile, a),
                               kernel_spot_size(p->frame, p->tile, b));
}

SIMD_INLINE vf kernel_project_x(const kernel_packet *p, kernel_spot a)
{
    return (vf_set(a.x) - p->origin_x) - p->slope_x * a.z;
}

SIMD_INLINE vf kernel_project_y(const kernel_packet *p, kernel_spot a)
{
    return (vf_set(a.y) - p->origin_y) - p->slope_y * a.z;
}

/* Below this the products' errors may be too small for float32. */
#define KERNEL_EDGE_LEAST 1e-30f

/* e of rays on which it is all but zero: its sign is taken in double, where products of float32 are exact; its size, as
 * little beside that of any other edge, need not be known, but that not all weights may be zero. Where e is zero the
 * tie is decided as kernel_cell.h has it, and the sign of the zero says how. */
static __attribute__((noinline, cold)) vf kernel_edge_tied(vf ax, vf ay, vf bx, vf by, vf e)
{
    for (int lane = 0; lane < SIMD_WIDTH; lane++) {
        const double x0 = (double)ax[lane], y0 = (double)ay[lane], x1 = (double)bx[lane], y1 = (double)by[lane];
        const double exact = x0 * y1 - x1 * y0;
        if (!(fabsf(e[lane]) <= KERNEL_EDGE_LEAST)) continue;
        if (exact == 0)
            e[lane] = y1 < y0 || (y0 == y1 && x0 < x1) ? 0.0f : -0.0f;
        else
            e[lane] = exact > 0 ? KERNEL_EDGE_LEAST : -KERNEL_EDGE_LEAST;
    }
    return e;
}

/* Returns the edge function, with the exact sign for the projected points. */
SIMD_INLINE vf kernel_edge_between(vf ax, vf ay, vf bx, vf by)
{
    const vf e = vf_diff_of_products(ax, by, bx, ay);
    const vm tie = vf_le(vf_abs(e), vf_set(KERNEL_EDGE_LEAST));
    return __builtin_expect(vm_any(tie), 0) ? kernel_edge_tied(ax, ay, bx, by, e) : e;
}

SIMD_INLINE vf kernel_edge_projected(const kernel_packet *p, kernel_spot a, kernel_spot b)
{
    return kernel_edge_between(kernel_project_x(p, a), kernel_project_y(p, a), kernel_project_x(p, b),
                               kernel_project_y(p, b));
}

static __attribute__((noinline, cold)) vf kernel_edge_doubted(const kernel_packet *p, kernel_spot a, kernel_spot b,
                                                              vm doubt, vf e)
{
    return vf_select(doubt, kernel_edge_projected(p, a, b), e);
}

SIMD_INLINE vf kernel_line_at(const kernel_packet *p, const kernel_line *l)
{
    return vf_muladd(vf_set(l->cv), p->v, vf_muladd(vf_set(l->cu), p->u, vf_set(l->c)));
}

/* The edge function of the edge from a to b, a before b in the order, whose line is l: of the side where it is positive
 * the sign bit is clear, ties decided. */
SIMD_INLINE vf kernel_edge(const kernel_packet *p, const kernel_line *l, kernel_spot a, kernel_spot b)
{
    if (!p->is_pencil) return kernel_edge_projected(p, a, b);
    const vf e = kernel_line_at(p, l);
    const vm doubt = vm_not(vf_lt(vf_set(l->bound), vf_abs(e)));
    return __builtin_expect(vm_any(doubt), 0) ? kernel_edge_doubted(p, a, b, doubt, e) : e;
}

/* The triangle i, j, k (in the order) with its three edges: who crosses it. */
SIMD_INLINE vm kernel_inside(vm rays, vf ij, vf jk, vf ik)
{
    const vi a = vi_from_bits(ij), b = vi_from_bits(jk), c = vi_from_bits(ik);
    return vm_and(rays, vm_sign(~(a ^ b) & (a ^ c)));
}

/* Sums the depths or values of a crossed triangle's vertices, weighted by their opposite edges and not yet divided by
 * the sum of the weights. A sum has the sign that all its terms have. */
SIMD_INLINE vf kernel_weigh_value(vf ij, vf jk, vf ik, float i, float j, float k)
{
    return vf_muladd(ij, vf_set(k), vf_muladd(-ik, vf_set(j), jk * i));
}

SIMD_INLINE vf kernel_weight(vf ij, vf jk, vf ik)
{
    return (jk - ik) + ij;
}

SIMD_INLINE kernel_blur kernel_edge_blur(const kernel_packet *p, kernel_spot a, kernel_spot b)
{
    const kernel_line l = kernel_line_of(p, a, b);
    return kernel_line_blur(&l, p->tile->radius, a, b);
}

/* kernel_least_weight() of the triangle i, j, k in the order. */
static __attribute__((noinline, cold)) float kernel_triangle_least(const kernel_packet *p, kernel_spot i, kernel_spot j,
                                                                   kernel_spot k)
{
    const kernel_blur ij = kernel_edge_blur(p, i, j), jk = kernel_edge_blur(p, j, k), ik = kernel_edge_blur(p, i, k);
    return kernel_least_weight((ij.error + jk.error) + ik.error, (ij.extent + jk.extent) + ik.extent);
}

/* Returns the rays whose weights of a triangle that they cross are not good enough. */
SIMD_INLINE vm kernel_weak(vm hit, vf weight, float least)
{
    return vm_and(hit, vf_lt(vf_abs(weight), vf_set(least)));
}

/* The triangle's edge functions, projected on these rays. */
static __attribute__((noinline, cold)) void kernel_triangle_mend(const kernel_packet *p, const kernel_spot ijk[3],
                                                                 vm weak, vf *ij, vf *jk, vf *ik)
{
    const vf ax = kernel_project_x(p, ijk[0]), ay = kernel_project_y(p, ijk[0]);
    const vf bx = kernel_project_x(p, ijk[1]), by = kernel_project_y(p, ijk[1]);
    const vf cx = kernel_project_x(p, ijk[2]), cy = kernel_project_y(p, ijk[2]);
    *ij = vf_select(weak, kernel_edge_between(ax, ay, bx, by), *ij);
    *jk = vf_select(weak, kernel_edge_between(bx, by, cx, cy), *jk);
    *ik = vf_select(weak, kernel_edge_between(ax, ay, cx, cy), *ik);
}

#endif
