/* Checks that the intervals of a ray in the cells of a mesh add up to the ray's chord (chord_hull.h), and that every
 * end of an interval inside the hull is bitwise shared by exactly two intervals: no gap, no overlap.
 *
 * Meshes are exact and jittered lattices of every cell type, and linear pieces of straight and bent cells of higher
 * order. The hull of all meshes is the cube [-1, 1]^3. Rays are random, aimed at vertices, edges and faces, along edges
 * and faces, and along the lattice.
 *
 * Every ray is traced twice. First it is traced as a single ray: all edge functions are computed from projected
 * vertices, as for the differences that yield normals. Then it is traced as one ray of a tile: edge functions are
 * evaluated as affine functions in the image plane, as in frames, unless these are too inaccurate. The tile is as wide
 * as the distance between its rays: a thousandth of a cell to several cells. chord_hull.h derives the tolerances of the
 * sum and of the ends. */
#include "chord_aim.h"
#include "chord_hull.h"
#include "cpu.h"
#include "memory.h"
#include "render_isa.h"
#include "render_polyhedra.h"
#include "render_prepare.h"
#include "test_effort.h"
#include "test_mesh_honeycomb.h"
#include "test_mesh_refined.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { SIDE = 4 };

static const double length_allowed = 1e-6;

/* The longest overlap of two intervals of a ray that is allowed. Two faces that meet at a vertex are each rounded to
 * float32, by a few times 6e-8. If a concave cell has several intervals near the vertex, the interval of one cell may
 * reach into the next cell's interval, or end before it, by this rounding. */
static const double doubled_allowed = 5e-7;

static int64_t rays_wanted;

static const chord_table *get_kernel_table(void)
{
#if defined(__x86_64__)
    if (strcmp(render_isa(), "avx512") == 0) return &chord_table_avx512;
    if (strcmp(render_isa(), "avx2") == 0) return &chord_table_avx2;
    if (strcmp(render_isa(), "sse4.2") == 0) return &chord_table_sse42;
#endif
    return &chord_table_plain;
}

/* ---- meshes ---- */

typedef enum chord_mesh {
    MESH_TETS,
    MESH_HEXES,
    MESH_WEDGES,
    MESH_PYRAMIDS,
    MESH_POLYHEDRA, /* concave polyhedra with triangular faces */
    MESH_MIXED,
    MESH_QUAD_POLYHEDRA, /* hexes stored as polyhedra */
    MESH_BESIDE,         /* the mixed mesh in which every second cell is stored as a polyhedron */
    MESH_HONEYCOMB,      /* hexagonal prisms */
    /* linear pieces of cells of higher order: the first refined_kind; the meshes of the other kinds follow */
    MESH_REFINED,
    MESH_COUNT = MESH_REFINED + REFINED_MIXED + 1
} chord_mesh;

static const char *mesh_name(chord_mesh mesh)
{
    static const char *const names[MESH_COUNT] = {"tets",
                                                  "hexes",
                                                  "wedges",
                                                  "pyramids",
                                                  "polyhedra",
                                                  "mixed",
                                                  "hexes as polyhedra",
                                                  "mixed and polyhedra",
                                                  "honeycomb",
                                                  "pieces of tets of 10 nodes",
                                                  "pieces of hexes of 20 nodes",
                                                  "pieces of hexes of 27 nodes",
                                                  "pieces of wedges of 18 nodes",
                                                  "pieces of hexes of 27 and wedges of 18 nodes"};
    return names[mesh];
}

static void make_mesh(chord_mesh kind, double jitter, test_mesh *out)
{
    static const test_mesh_kind bases[MESH_COUNT] = {TEST_TETS,      TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS,
                                                     TEST_POLYHEDRA, TEST_MIXED, TEST_HEXES,  TEST_MIXED};
    if (kind == MESH_HONEYCOMB) {
        test_mesh_make_honeycomb(SIDE, jitter / 2, test_linear_field, out);
        return;
    }
    if (kind >= MESH_REFINED) {
        test_mesh_make_refined((refined_kind)(kind - MESH_REFINED), SIDE / 2, jitter / 2, test_linear_field, out);
        return;
    }
    test_mesh_make_lattice(bases[kind], SIDE, jitter, test_linear_field, out);
    if (kind == MESH_QUAD_POLYHEDRA) test_mesh_to_polyhedra(out, 1);
    if (kind == MESH_BESIDE) test_mesh_to_polyhedra(out, 0.5);
}

/* The jitter as a fraction of a cube's side. With a jitter up to 0.2 all cells are valid. At 0.3, quads pass through
 * neighbouring faces, and cells really overlap (docs/development/hard-cases.md). */
static const double jitter_wanted = 0.2;

/* ---- a ray ---- */

/* Counts and largest errors over the rays of a test. Lengths are in units of the hull's side. */
typedef struct tally {
    int64_t rays, met, ray_intervals;
    int64_t slanted, touching; /* a ray counts in at most one of them */
    int64_t unpaired;          /* rays that have an unshared end at a depth that is not allowed */
    int64_t off;
    /* doubled: number of rays on which intervals overlap by rounding; gaps: number of rays with gaps between
     * intervals */
    int64_t doubled, gaps;
    double worst_length;  /* largest error of length among rays that are neither slanted nor touching */
    double worst_slanted; /* largest error of length among slanted rays, as a fraction of the change by hull_shift */
    /* largest length, over all rays, outside the range between the chords of the shrunk and the swollen hull */
    double worst_bracketed;
    double worst_doubled; /* the longest overlap of two intervals */
    double worst_gap;
} tally;

static int compare_intervals(const void *left, const void *right)
{
    const chord_interval *a = left, *b = right;
    if (a->t_in != b->t_in) return a->t_in < b->t_in ? -1 : 1;
    return (a->t_out > b->t_out) - (a->t_out < b->t_out);
}

static int compare_floats(const void *left, const void *right)
{
    const float a = *(const float *)left, b = *(const float *)right;
    return (a > b) - (a < b);
}

/* Finds the sorted ends that are not shared by two intervals. Returns their number. */
static int find_unshared_ends(const chord_interval *ray_intervals, int count, float lone[2 * CHORD_MAX_INTERVALS])
{
    float ends[2 * CHORD_MAX_INTERVALS];
    int alone = 0;
    for (int i = 0; i < count; i++) {
        ends[2 * i] = ray_intervals[i].t_in;
        ends[2 * i + 1] = ray_intervals[i].t_out;
    }
    qsort(ends, 2 * (size_t)count, sizeof *ends, compare_floats);
    for (int i = 0; i < 2 * count;)
        if (i + 1 < 2 * count && ends[i] == ends[i + 1])
            i += 2;
        else
            lone[alone++] = ends[i++];
    return alone;
}

/* Clips intervals at the depth `near`, since what is behind the eye's plane does not count. Returns the number of
 * remaining intervals. */
static int clip_intervals(chord_interval *ray_intervals, int count, float near)
{
    int left = 0;
    for (int i = 0; i < count; i++)
        if (ray_intervals[i].t_out > near)
            ray_intervals[left++] = (chord_interval){fmaxf(ray_intervals[i].t_in, near), ray_intervals[i].t_out};
    return left;
}

static double compute_depth(const render_job *job, float t)
{
    return (double)t / job->space.scale + job->space.depth_origin;
}

/* Returns whether all unshared ends are at depths that the bounds of chord_hull.h allow. */
static bool are_unshared_ends_allowed(const render_job *job, const chord_ray *r, const chord_interval *ray_intervals,
                                      int count)
{
    float lone[2 * CHORD_MAX_INTERVALS];
    const int alone = find_unshared_ends(ray_intervals, count, lone);
    if (!chord_is_touching(r) && alone != 0 && alone != 2) return false;
    for (int i = 0; i < alone; i++) {
        const double depth = compute_depth(job, lone[i]);
        if (chord_is_within(r, depth, depth) || chord_is_beyond(r, depth)) return false;
    }
    return true;
}

/* Records the longest overlap and the longest gap of the sorted intervals. On rays that run within the hull's surface,
 * only gaps inside the shrunk hull count. */
static void verify_neighbours(const render_job *job, const chord_ray *r, const chord_interval *ray_intervals, int count,
                              tally *t)
{
    double doubled = 0, gap = 0;
    for (int i = 1, last = 0; i < count; i++) {
        const chord_interval *before = &ray_intervals[last], *now = &ray_intervals[i];
        doubled = fmax(doubled, fmin((double)before->t_out, (double)now->t_out) - (double)now->t_in);
        if (!chord_is_touching(r) ||
            chord_is_within(r, compute_depth(job, before->t_out), compute_depth(job, now->t_in)))
            gap = fmax(gap, (double)now->t_in - (double)before->t_out);
        if (now->t_out > before->t_out) last = i;
    }
    t->doubled += doubled > 0;
    t->gaps += gap > 0;
    t->worst_doubled = fmax(t->worst_doubled, doubled * r->line.length);
    t->worst_gap = fmax(t->worst_gap, gap * r->line.length);
}

static void verify_length(const chord_ray *r, double sum, tally *t)
{
    const double spread = r->most - r->least, off = fabs(sum - r->length);
    const double bracketed = fmax(r->least - sum, sum - r->most);
    const bool is_slanted = chord_is_slanted(r), is_plain = !is_slanted && !chord_is_touching(r);
    t->slanted += is_slanted;
    t->touching += chord_is_touching(r);
    t->worst_bracketed = fmax(t->worst_bracketed, bracketed);
    if (is_slanted) t->worst_slanted = fmax(t->worst_slanted, off / spread);
    if (is_plain) t->worst_length = fmax(t->worst_length, off);
    if (bracketed <= length_allowed && (!is_plain || off <= length_allowed)) return;
    if (t->off++ < 3)
        fprintf(stderr, "a ray with %.9g in cells, chord %.9g, of the shrunk and swollen hull %.9g and %.9g\n", sum,
                r->length, r->least, r->most);
}

static void verify_ray(const render_job *job, const chord_rays *rays, int ray, chord_interval *ray_intervals, int count,
                       tally *t)
{
    const chord_ray r = chord_compute_hull_ray(job, rays, ray);
    double sum = 0;
    assert_true(count <= CHORD_MAX_INTERVALS);
    count = clip_intervals(ray_intervals, count, (float)(-job->space.depth_origin * job->space.scale));
    qsort(ray_intervals, (size_t)count, sizeof *ray_intervals, compare_intervals);
    t->rays++;
    t->met += count > 0;
    t->ray_intervals += count;
    for (int i = 0; i < count; i++)
        sum += ((double)ray_intervals[i].t_out - (double)ray_intervals[i].t_in) * r.line.length;
    verify_neighbours(job, &r, ray_intervals, count, t);
    verify_length(&r, sum, t);
    if (are_unshared_ends_allowed(job, &r, ray_intervals, count)) return;
    if (t->unpaired++ < 3)
        fprintf(stderr, "ray %.17g %.17g: ends of one interval alone; chord %.9g, %.9g to %.9g\n", rays->x[ray],
                rays->y[ray], r.length, r.least, r.most);
}

/* ---- a mesh ---- */

static kernel_thread open_thread(void)
{
    kernel_thread thread = {.cells = base_calloc(1, get_kernel_table()->cells_bytes), .polyhedra = polyhedra_create()};
    assert_non_null(thread.cells);
    assert_non_null(thread.polyhedra);
    return thread;
}

static void trace_rays(const render_job *job, kernel_thread *thread, chord_rays *rays)
{
    kernel_frame frame;
    base_error error = {0};
    assert_int_equal(render_prepare(job, &frame, &error), INSITU_OK);
    polyhedra_reset(thread->polyhedra);
    get_kernel_table()->trace(&frame, thread, rays);
    assert_false(thread->out_of_memory);
    render_free_prepared_frame(&frame);
}

/* Traces rays through a mesh. tallies[0] counts rays that are traced as single rays, tallies[1] the same rays traced as
 * rays of one tile. */
static void verify_mesh(chord_mesh kind, double jitter, chord_aim aim, int64_t count, tally tallies[2])
{
    static const double value[1] = {0};
    static chord_rays rays;
    test_mesh mesh;
    render_fixture f;
    uint64_t counter = (uint64_t)aim << 40 | (uint64_t)kind << 34 | (uint64_t)(jitter > 0) << 33;
    kernel_thread thread = open_thread();
    make_mesh(kind, jitter, &mesh);
    fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 2.0 / SIDE, 1,
                   (const double[]){0, 0, 0});
    fixture_add_surface(&f, value, 1, 1);
    for (const int64_t end = tallies[0].rays + count; tallies[0].rays < end;) {
        render_camera *c = &f.job.camera;
        chord_aim_rays(&mesh, SIDE, aim, &counter, c, &rays);
        const double depth = -(c->forward[0] * c->eye[0] + c->forward[1] * c->eye[1] + c->forward[2] * c->eye[2]);
        f.job.space.depth_origin = fmax(depth, 0);
        for (int by_tile = 0; by_tile < 2; by_tile++) {
            rays.is_pencil = by_tile;
            trace_rays(&f.job, &thread, &rays);
            for (int i = 0; i < rays.count; i++)
                verify_ray(&f.job, &rays, i, rays.ray_intervals[i], rays.interval_count[i], &tallies[by_tile]);
        }
    }
    fixture_free(&f);
    test_mesh_free(&mesh);
    polyhedra_free(thread.polyhedra);
    base_free(thread.cells);
}

static void print_tally(const char *what, const char *mesh, int by_tile, const tally *t)
{
    printf("%s%s%s, %s: %lld rays, %lld cells; off by %.2g of the side at most; %lld slanted, off by %.2g of the "
           "shift's share at most, %lld touching; %.2g beyond the shrunk and swollen hull's; overlaps by rounding on "
           "%lld, %.2g at most, gaps on %lld, %.2g at most; %lld wrong lengths, %lld with ends alone\n",
           what, *mesh ? ", " : "", mesh, by_tile ? "by tile" : "alone", (long long)t->rays,
           (long long)t->ray_intervals, t->worst_length, (long long)t->slanted, t->worst_slanted,
           (long long)t->touching, t->worst_bracketed, (long long)t->doubled, t->worst_doubled, (long long)t->gaps,
           t->worst_gap, (long long)t->off, (long long)t->unpaired);
}

static void add_tally(tally *sum, const tally *t)
{
    sum->rays += t->rays;
    sum->met += t->met;
    sum->ray_intervals += t->ray_intervals;
    sum->slanted += t->slanted;
    sum->touching += t->touching;
    sum->unpaired += t->unpaired;
    sum->off += t->off;
    sum->doubled += t->doubled;
    sum->gaps += t->gaps;
    sum->worst_length = fmax(sum->worst_length, t->worst_length);
    sum->worst_slanted = fmax(sum->worst_slanted, t->worst_slanted);
    sum->worst_bracketed = fmax(sum->worst_bracketed, t->worst_bracketed);
    sum->worst_doubled = fmax(sum->worst_doubled, t->worst_doubled);
    sum->worst_gap = fmax(sum->worst_gap, t->worst_gap);
}

/* Checks that few rays are slanted and few run within the hull's surface, for each aim. A bound is the measured
 * fraction plus about a tenth of it, plus the rays of one camera in case there are few rays. The fractions are not
 * small, because a fifth of all edges and faces belong to the hull, and rays come to them and to their vertices from
 * any direction. */
static void assert_few_at_the_surface(chord_aim aim, const tally *t)
{
    static const double slanted_most[CHORD_AIM_COUNT] = {
        [CHORD_RANDOM] = 0.015,      [CHORD_TO_VERTICES] = 0.05,   [CHORD_TO_EDGES] = 0.04,
        [CHORD_TO_FACES] = 0.03,     [CHORD_ALONG_EDGES] = 0.03,   [CHORD_ALONG_FACES] = 0.025,
        [CHORD_AXIS_ALIGNED] = 5e-4, [CHORD_FROM_INSIDE] = 0.0025,
    };
    static const double touching_most[CHORD_AIM_COUNT] = {
        [CHORD_ALONG_EDGES] = 0.17, [CHORD_ALONG_FACES] = 0.09, [CHORD_AXIS_ALIGNED] = 0.055};
    const double rays = (double)t->rays, touching = fmax(touching_most[aim], 1e-4) * rays;
    if ((double)t->touching > touching + CHORD_MAX_RAYS ||
        (double)t->slanted > slanted_most[aim] * rays + CHORD_MAX_RAYS)
        fail_msg("%d slanted and %d touching of %d rays", (int)t->slanted, (int)t->touching, (int)t->rays);
}

static void verify_aim(chord_aim aim, const char *what)
{
    const int64_t share = rays_wanted / (CHORD_AIM_COUNT * MESH_COUNT * 2) + 1;
    tally all[2] = {{.rays = 0}};
    for (chord_mesh mesh = 0; mesh < MESH_COUNT; mesh++)
        for (int jittered = 0; jittered < 2; jittered++) {
            tally t[2] = {{.rays = 0}};
            verify_mesh(mesh, jittered ? jitter_wanted : 0, aim, share, t);
            for (int by_tile = 0; by_tile < 2; by_tile++) {
                if (t[by_tile].off || t[by_tile].unpaired || getenv("INSITU_TEST_VERBOSE"))
                    print_tally(what, mesh_name(mesh), by_tile, &t[by_tile]);
                assert_true(3 * t[by_tile].met > t[by_tile].rays);
                add_tally(&all[by_tile], &t[by_tile]);
            }
        }
    for (int by_tile = 0; by_tile < 2; by_tile++) print_tally(what, "", by_tile, &all[by_tile]);
    for (int by_tile = 0; by_tile < 2; by_tile++) {
        assert_int_equal(all[by_tile].off, 0);
        assert_int_equal(all[by_tile].unpaired, 0);
        assert_true(all[by_tile].worst_doubled <= doubled_allowed);
        assert_true(all[by_tile].worst_gap <= doubled_allowed);
        assert_few_at_the_surface(aim, &all[by_tile]);
    }
}

static void random_rays_add_up_to_their_chords(void **state)
{
    (void)state;
    verify_aim(CHORD_RANDOM, "random");
}

static void rays_through_vertices_add_up_to_their_chords(void **state)
{
    (void)state;
    verify_aim(CHORD_TO_VERTICES, "through vertices");
}

static void rays_through_edges_add_up_to_their_chords(void **state)
{
    (void)state;
    verify_aim(CHORD_TO_EDGES, "through edges");
}

static void rays_through_faces_add_up_to_their_chords(void **state)
{
    (void)state;
    verify_aim(CHORD_TO_FACES, "through faces");
}

static void rays_along_edges_add_up_to_their_chords(void **state)
{
    (void)state;
    verify_aim(CHORD_ALONG_EDGES, "along edges");
}

static void rays_along_faces_add_up_to_their_chords(void **state)
{
    (void)state;
    verify_aim(CHORD_ALONG_FACES, "along faces");
}

static void axis_aligned_rays_add_up_to_their_chords(void **state)
{
    (void)state;
    verify_aim(CHORD_AXIS_ALIGNED, "axis-aligned");
}

static void rays_from_inside_add_up_to_their_chords(void **state)
{
    (void)state;
    verify_aim(CHORD_FROM_INSIDE, "from inside");
}

/* The command's argument is the number of rays to trace. */
int main(int argc, char **argv)
{
    if (fixture_isa_is_unavailable()) return 77;
    rays_wanted = argc > 1 ? atoll(argv[1]) : test_case_count(150000, 300000);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_rays_add_up_to_their_chords),
        cmocka_unit_test(rays_through_vertices_add_up_to_their_chords),
        cmocka_unit_test(rays_through_edges_add_up_to_their_chords),
        cmocka_unit_test(rays_through_faces_add_up_to_their_chords),
        cmocka_unit_test(rays_along_edges_add_up_to_their_chords),
        cmocka_unit_test(rays_along_faces_add_up_to_their_chords),
        cmocka_unit_test(axis_aligned_rays_add_up_to_their_chords),
        cmocka_unit_test(rays_from_inside_add_up_to_their_chords),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
