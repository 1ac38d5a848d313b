/* Checks the triangulation of polygons (polygon.h). Each point inside a polygon, by its winding number, must be in
 * exactly one triangle, and no point outside in any. The triangles must not depend on the first corner or on the
 * direction of the list of corners, must equal those of the reference, and must form a fan if the polygon is convex.
 * The polygons are random simple ones, combs, spirals, polygons with a hole at the end of a bridge, with collinear or
 * repeated corners, and polygons bent out of their plane. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "polygon.h"
#include "reference_polygon.h"
#include "test_meshes.h"

enum { MOST = REFERENCE_MAX_CORNERS };

typedef struct polygon {
    int count;
    double plane[MOST][2], corners[MOST][3];
} polygon;

static void add_vertex(polygon *p, double x, double y)
{
    p->plane[p->count][0] = x;
    p->plane[p->count++][1] = y;
}

/* ---- polygons ------------------------------------------------------------------------------------------------- */

/* Makes a star-shaped polygon around the origin with spikes. */
static void make_star(uint64_t seed, int count, polygon *p)
{
    for (int i = 0; i < count; i++) {
        const double angle = 2 * acos(-1) * (i + 0.4 * test_uniform((uint64_t)i, seed)) / count;
        const double radius = test_uniform_between((uint64_t)i, seed + 1, 0.1, 1);
        add_vertex(p, radius * cos(angle), radius * sin(angle));
    }
}

static void make_comb(int teeth, polygon *p)
{
    for (int i = 0; i < teeth; i++) {
        add_vertex(p, i, 0);
        add_vertex(p, i + 0.3, 3 + 0.1 * (i % 3));
        add_vertex(p, i + 0.6, 0);
    }
    add_vertex(p, teeth, 0);
    add_vertex(p, teeth, -1);
    for (int i = teeth - 1; i >= 0; i--) add_vertex(p, i, -1); /* adds collinear corners */
}

static void make_spiral(int turns, polygon *p)
{
    const int steps = 12 * turns;
    for (int side = 0; side < 2; side++)
        for (int i = 0; i <= steps; i++) {
            const int k = side ? steps - i : i;
            const double angle = acos(-1) / 6 * k, radius = 1 + 0.1 * k - 0.6 * side;
            add_vertex(p, radius * cos(angle), radius * sin(angle));
        }
}

/* Makes a square with a square hole. The list of corners passes along a bridge to the hole and back. */
static void make_bridge(polygon *p)
{
    static const double at[10][2] = {{0, 0}, {4, 0}, {4, 4}, {0, 4}, {0, 0}, {1, 1}, {1, 3}, {3, 3}, {3, 1}, {1, 1}};
    for (int i = 0; i < 10; i++) add_vertex(p, at[i][0], at[i][1]);
}

/* Makes an L-shaped polygon in which some corners are repeated two or three times and some lie in the middle of
 * edges. */
static void make_irregular_polygon(polygon *p)
{
    static const double at[14][2] = {{0, 0}, {1, 0}, {2, 0}, {2, 0}, {2, 1}, {1.5, 1}, {1, 1},
                                     {1, 1}, {1, 1}, {1, 2}, {0, 2}, {0, 1}, {0, 0.5}, {0, 0.25}};
    for (int i = 0; i < 14; i++) add_vertex(p, at[i][0], at[i][1]);
}

/* Makes the polygon with the index `which`: a U, a dart (a quad with one concave corner), then the polygons of the
 * functions above. */
static void make_polygon(int which, polygon *p)
{
    static const double u[8][2] = {{0, 0}, {3, 0}, {3, 3}, {2, 3}, {2, 1}, {1, 1}, {1, 3}, {0, 3}};
    static const double dart[4][2] = {{0, 0}, {2, 0.1}, {0.5, 0.5}, {0.1, 2}};
    p->count = 0;
    if (which == 0)
        for (int i = 0; i < 8; i++) add_vertex(p, u[i][0], u[i][1]);
    else if (which <= 4)
        for (int i = 0; i < 4; i++)
            add_vertex(p, dart[(i + which) % 4][0], dart[(i + which) % 4][1] * (which % 2 ? 1 : -1));
    else if (which == 5)
        make_comb(60, p);
    else if (which == 6)
        make_spiral(3, p);
    else if (which == 7)
        make_bridge(p);
    else if (which == 8)
        make_irregular_polygon(p);
    else
        make_star((uint64_t)which, which % 5 == 0 ? 5 + which : 4 + which % 7, p);
}

enum { POLYGONS = 300 };

/* Moves the polygon into space by a rotation that depends on `which`, and its corners off the plane by up to `bend`. */
static void embed_in_space(int which, double bend, polygon *p)
{
    const double a = 0.7 * which, b = 1.1 * which;
    for (int i = 0; i < p->count; i++) {
        const double x = p->plane[i][0], y = p->plane[i][1];
        const double z = bend * sin(3 * x + 2 * y); /* equal for corners at the same position */
        const double u = cos(a) * x - sin(a) * z, w = sin(a) * x + cos(a) * z;
        p->corners[i][0] = which == 0 ? x : 10 + u;
        p->corners[i][1] = which == 0 ? y : cos(b) * y - sin(b) * w;
        p->corners[i][2] = which == 0 ? z : sin(b) * y + cos(b) * w;
    }
}

/* ---- triangles ------------------------------------------------------------------------------------------------ */

typedef struct cut {
    int count;
    int triangles[MOST][3];
} cut;

static void cut_polygon(const polygon *p, cut *out)
{
    void *room = malloc(polygon_work_bytes(p->count));
    assert_non_null(room);
    polygon_triangulate((const double(*)[3])p->corners, p->count, room, out->triangles);
    out->count = p->count - 2;
    free(room);
}

static double compute_triangle_area(const polygon *p, const int *t)
{
    const double *a = p->plane[t[0]], *b = p->plane[t[1]], *c = p->plane[t[2]];
    return ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])) / 2;
}

static double compute_polygon_area(const polygon *p)
{
    double sum = 0;
    for (int i = 1; i + 1 < p->count; i++) sum += compute_triangle_area(p, (const int[]){0, i, i + 1});
    return sum;
}

/* Returns the winding number of the loop around the point. */
static int compute_winding_number(const double (*loop)[2], const int *numbers, int count, const double at[2])
{
    int turns = 0;
    for (int i = 0; i < count; i++) {
        const double *a = loop[numbers ? numbers[i] : i],
                     *b = loop[numbers ? numbers[(i + 1) % count] : (i + 1) % count];
        if ((a[1] <= at[1]) == (b[1] <= at[1])) continue;
        const double side = (b[0] - a[0]) * (at[1] - a[1]) - (at[0] - a[0]) * (b[1] - a[1]);
        if ((side > 0) == (b[1] > a[1])) turns += b[1] > a[1] ? 1 : -1;
    }
    return turns;
}

/* Checks that random points are covered by as many triangles as their winding number states. No random point is on an
 * edge. */
static void assert_covered_once(const polygon *p, const cut *c, int which)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < p->count; i++)
        for (int axis = 0; axis < 2; axis++) {
            low[axis] = fmin(low[axis], p->plane[i][axis]);
            high[axis] = fmax(high[axis], p->plane[i][axis]);
        }
    for (uint64_t k = 0; k < 400; k++) {
        const double at[2] = {test_uniform_between(k, 3, low[0], high[0]), test_uniform_between(k, 4, low[1], high[1])};
        const int expected = compute_winding_number((const double(*)[2])p->plane, NULL, p->count, at);
        int sum = 0, most = 0;
        for (int i = 0; i < c->count; i++) {
            const int turns = compute_winding_number((const double(*)[2])p->plane, c->triangles[i], 3, at);
            sum += turns;
            most += abs(turns);
        }
        if (sum == expected && most == abs(expected)) continue;
        print_error("polygon %d: (%g, %g) is in %d triangles, %d around\n", which, at[0], at[1], most, sum);
        fail();
    }
}

static void polygons_are_covered_once(void **state)
{
    (void)state;
    for (int which = 0; which < POLYGONS; which++)
        for (int bent = 0; bent < 2; bent++) {
            static polygon p;
            static cut c;
            double sum = 0;
            make_polygon(which, &p);
            embed_in_space(which, 0.1 * bent, &p);
            cut_polygon(&p, &c);
            for (int i = 0; i < c.count; i++) sum += compute_triangle_area(&p, c.triangles[i]);
            /* tolerance: roundings of numbers of at most 60 */
            assert_true(fabs(sum - compute_polygon_area(&p)) <= 1e-12 * p.count);
            /* Bent polygons are triangulated along another normal than the plane's. Along the plane's normal, a thin
             * triangle may be reversed. */
            if (!bent) assert_covered_once(&p, &c, which);
        }
}

/* ---- triangles that must be equal -------------------------------------------------------------------------------- */

static int compare_triangles(const void *a, const void *b)
{
    return memcmp(a, b, 9 * sizeof(double));
}

/* Lists the coordinates of the triangles, sorted within each triangle and then among triangles. Triangles without area
 * are skipped, because they depend on which of several corners at the same position is used. */
static int list_sorted_triangles(const polygon *p, const cut *c, double (*out)[9])
{
    int count = 0;
    for (int i = 0; i < c->count; i++) {
        if (fabs(compute_triangle_area(p, c->triangles[i])) < 1e-12) continue;
        double *t = out[count++];
        for (int k = 0; k < 3; k++) memcpy(t + 3 * k, p->corners[c->triangles[i][k]], 3 * sizeof *t);
        qsort(t, 3, 3 * sizeof *t, compare_triangles);
    }
    qsort(out, (size_t)count, sizeof *out, compare_triangles);
    return count;
}

static void triangulation_depends_on_positions_only(void **state)
{
    static const double bends[3] = {0, 0.1, 2}; /* with 2, many polygons cross themselves along their normals */
    (void)state;
    for (int which = 0; which < POLYGONS; which++)
        for (int bent = 0; bent < 3; bent++) {
            static polygon p, other;
            static cut c;
            static double own[MOST][9], found[MOST][9];
            make_polygon(which, &p);
            embed_in_space(which, bends[bent], &p);
            cut_polygon(&p, &c);
            const int count = list_sorted_triangles(&p, &c, own);
            c.count = reference_polygon_triangulate((const double(*)[3])p.corners, p.count, c.triangles);
            assert_int_equal(list_sorted_triangles(&p, &c, found), count);
            assert_memory_equal(own, found, (size_t)count * sizeof *own);
            for (int turn = 0; turn < 6; turn++) {
                const int start = (int)(test_uniform((uint64_t)(6 * which + turn), 5) * p.count);
                other.count = p.count;
                for (int i = 0; i < p.count; i++) {
                    const int from = (start + (turn % 2 ? p.count - i : i)) % p.count;
                    memcpy(other.corners[i], p.corners[from], sizeof p.corners[from]);
                    memcpy(other.plane[i], p.plane[from], sizeof p.plane[from]);
                }
                cut_polygon(&other, &c);
                assert_int_equal(list_sorted_triangles(&other, &c, found), count);
                assert_memory_equal(own, found, (size_t)count * sizeof *own);
            }
        }
}

/* Checks closed random walks on a lattice, whose corners often coincide, so that edges of one corner may lead into
 * another corner at the same position. */
static void self_touching_polygons_match_the_reference(void **state)
{
    (void)state;
    for (uint64_t seed = 0; seed < 3000; seed++) {
        static polygon p;
        static cut c;
        static double own[MOST][9], found[MOST][9];
        p.count = 0;
        for (uint64_t i = 0; i < 6 + seed % 9; i++)
            add_vertex(&p, floor(test_uniform_between(2 * i, seed, 0, 4)),
                       floor(test_uniform_between(2 * i + 1, seed, 0, 3)));
        embed_in_space(0, 0, &p);
        cut_polygon(&p, &c);
        const int count = list_sorted_triangles(&p, &c, own);
        c.count = reference_polygon_triangulate((const double(*)[3])p.corners, p.count, c.triangles);
        assert_int_equal(list_sorted_triangles(&p, &c, found), count);
        assert_memory_equal(own, found, (size_t)count * sizeof *own);
    }
}

static void convex_polygons_are_fans(void **state)
{
    (void)state;
    for (int count = 3; count < 40; count++) {
        static polygon p;
        static cut c;
        int least = 0;
        p.count = 0;
        for (int i = 0; i < count; i++) add_vertex(&p, cos(0.1 + 6.28318 * i / count), sin(0.1 + 6.28318 * i / count));
        embed_in_space(count, 0.1, &p);
        for (int i = 1; i < count; i++)
            if (p.corners[i][0] < p.corners[least][0]) least = i;
        cut_polygon(&p, &c);
        for (int i = 0; i < c.count; i++)
            assert_true(c.triangles[i][0] == least || c.triangles[i][1] == least || c.triangles[i][2] == least);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(polygons_are_covered_once), cmocka_unit_test(triangulation_depends_on_positions_only),
        cmocka_unit_test(self_touching_polygons_match_the_reference), cmocka_unit_test(convex_polygons_are_fans)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
