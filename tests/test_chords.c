/* A ray's intervals in the cells of a mesh add up to its chord of the mesh's hull, and every end within the hull is the
 * end of exactly two intervals, to the bit: no gap, no double. On exact and on jittered lattices of every cell type,
 * the hull of all of them being the cube [-1, 1]^3, for rays at random, to and along vertices, edges and faces, and
 * along the lattice. Every ray is traced twice: set up alone, its edge functions all projected (as differences for
 * normals have it), and as one of a tile, its edge functions by lines where these are good enough (as frames have it).
 * The tile is as wide as its rays are apart: a thousandth of a cell to several cells.
 *
 * Lengths are in sides of the hull, 1 in the kernels' scaled units, and may be off by 1e-6. A ray that grazes the hull
 * has no chord to that accuracy in float32:
 * positions are rounded by half a unit of 1 (6e-8) and so is the ray, and the chord is that of a hull whose planes lie
 * up to 2.4e-7 off, a rounding on either side. Where that changes the chord by more than 1e-6, what it changes is
 * allowed as well; such a ray may also enter and leave the hull more than once. */
#include "chord_aim.h"
#include "cpu.h"
#include "memory.h"
#include "render_isa.h"
#include "render_prepare.h"
#include "test_mesh_honeycomb.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { SIDE = 4 };

static const double hull_shift = 1.2e-7, length_allowed = 1e-6;

/* Two faces that meet at a vertex are each placed to float32, 6e-8 times a few: so far may one cell's interval reach
 * into the next one's. */
static const double doubled_allowed = 5e-7;

static int64_t rays_wanted = 1000000;

static const chord_table *kernels(void)
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
    MESH_POLYHEDRA, /* concave, of triangles */
    MESH_MIXED,
    MESH_QUAD_POLYHEDRA, /* the hexes as polyhedra */
    MESH_BESIDE,         /* of the mixed mesh every second cell a polyhedron */
    MESH_HONEYCOMB,      /* hexagonal prisms */
    MESH_COUNT
} chord_mesh;

static const char *mesh_name(chord_mesh mesh)
{
    static const char *const names[MESH_COUNT] = {
        "tets",     "hexes", "wedges", "pyramids", "polyhedra", "mixed", "hexes as polyhedra", "mixed and polyhedra",
        "honeycomb"};
    return names[mesh];
}

static void make_mesh(chord_mesh kind, double jitter, test_mesh *out)
{
    static const test_mesh_kind bases[MESH_COUNT] = {TEST_TETS,      TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS,
                                                     TEST_POLYHEDRA, TEST_MIXED, TEST_HEXES,  TEST_MIXED};
    if (kind == MESH_HONEYCOMB) {
        test_mesh_honeycomb(SIDE, jitter / 2, test_linear, out);
        return;
    }
    test_mesh_lattice(bases[kind], SIDE, jitter, test_linear, out);
    if (kind == MESH_QUAD_POLYHEDRA) test_mesh_to_polyhedra(out, 1);
    if (kind == MESH_BESIDE) test_mesh_to_polyhedra(out, 0.5);
}

/* Of a cube's side. Cells are whole up to here; at 0.3 quads stand through the faces beside them, and cells overlap in
 * truth (docs/hard-cases.md). */
static const double jitter_wanted = 0.2;

/* ---- a ray ---- */

/* What rays were, over a test. Lengths are in sides of the hull. */
typedef struct tally {
    int64_t rays, met, spans;
    int64_t grazing;  /* whose chord is not known to length_allowed */
    int64_t unpaired; /* with an end that is not exactly two intervals' */
    int64_t off;
    int64_t doubled;      /* on which intervals overlap by rounding */
    double worst_length;  /* of rays that do not graze */
    double worst_doubled; /* the longest overlap */
} tally;

typedef struct line {
    double base[3], direction[3], length; /* of the direction */
} line;

static line ray_line(const render_camera *c, double x, double y)
{
    line l;
    for (int a = 0; a < 3; a++) {
        const double sideways = x * c->right[a] + y * c->up[a];
        l.base[a] = c->eye[a] + (c->is_orthographic ? sideways : 0);
        l.direction[a] = c->forward[a] + (c->is_orthographic ? 0 : sideways);
    }
    l.length =
        sqrt(l.direction[0] * l.direction[0] + l.direction[1] * l.direction[1] + l.direction[2] * l.direction[2]);
    return l;
}

/* The length of the ray, from the eye's plane on, in the hull of this half side, in sides of the hull. */
static double hull_chord(const line *l, double half)
{
    double low = 0, high = (double)INFINITY;
    for (int a = 0; a < 3; a++) {
        if (l->direction[a] == 0) {
            if (!(fabs(l->base[a]) < half)) return 0;
            continue;
        }
        const double t1 = (-half - l->base[a]) / l->direction[a], t2 = (half - l->base[a]) / l->direction[a];
        low = fmax(low, fmin(t1, t2));
        high = fmin(high, fmax(t1, t2));
    }
    return low < high ? (high - low) * l->length / 2 : 0;
}

static int compare_spans(const void *left, const void *right)
{
    const chord_span *a = left, *b = right;
    if (a->t_in != b->t_in) return a->t_in < b->t_in ? -1 : 1;
    return (a->t_out > b->t_out) - (a->t_out < b->t_out);
}

static int compare_floats(const void *left, const void *right)
{
    const float a = *(const float *)left, b = *(const float *)right;
    return (a > b) - (a < b);
}

/* Is every end that of two intervals, but one where the ray enters the hull and one where it leaves? These too may be
 * one, where the ray touches the hull: the intervals' lengths tell whether it does. */
static bool is_paired(const chord_span *spans, int count)
{
    float ends[2 * CHORD_MAX_SPANS];
    for (int i = 0; i < count; i++) {
        ends[2 * i] = spans[i].t_in;
        ends[2 * i + 1] = spans[i].t_out;
    }
    qsort(ends, 2 * (size_t)count, sizeof *ends, compare_floats);
    int alone = 0;
    for (int i = 0; i < 2 * count;)
        if (i + 1 < 2 * count && ends[i] == ends[i + 1])
            i += 2;
        else
            alone++, i++;
    return alone == 0 || alone == 2;
}

/* From near on: what lies behind the eye's plane does not count. Returns how many are left. */
static int clip_spans(chord_span *spans, int count, float near)
{
    int left = 0;
    for (int i = 0; i < count; i++)
        if (spans[i].t_out > near) spans[left++] = (chord_span){fmaxf(spans[i].t_in, near), spans[i].t_out};
    return left;
}

static void judge_ray(const render_job *job, double x, double y, chord_span *spans, int count, tally *t)
{
    const line l = ray_line(&job->camera, x, y);
    const double chord = hull_chord(&l, 1);
    const double spread = hull_chord(&l, 1 + 2 * hull_shift) - hull_chord(&l, 1 - 2 * hull_shift);
    const bool grazes = spread > length_allowed;
    double sum = 0, reached = -(double)INFINITY;
    assert_true(count <= CHORD_MAX_SPANS);
    count = clip_spans(spans, count, (float)(-job->space.depth_origin * job->space.scale));
    qsort(spans, (size_t)count, sizeof *spans, compare_spans);
    t->rays++;
    t->grazing += grazes;
    t->met += count > 0;
    t->spans += count;
    double doubled = 0;
    for (int i = 0; i < count; i++) {
        sum += ((double)spans[i].t_out - (double)spans[i].t_in) * l.length;
        doubled = fmax(doubled, fmin(reached, (double)spans[i].t_out) - (double)spans[i].t_in);
        reached = fmax(reached, (double)spans[i].t_out);
    }
    t->doubled += doubled > 0;
    t->worst_doubled = fmax(t->worst_doubled, doubled * l.length);
    if (!grazes) t->worst_length = fmax(t->worst_length, fabs(sum - chord));
    if (!(fabs(sum - chord) <= length_allowed + (grazes ? spread : 0))) {
        if (t->off++ < 3)
            fprintf(stderr, "ray %.17g %.17g: %d cells, %.9g in them, chord %.9g, grazing %.2g, doubled %.2g\n", x, y,
                    count, sum, chord, spread, doubled);
    }
    if (!grazes && !is_paired(spans, count)) {
        if (t->unpaired++ < 3)
            fprintf(stderr, "ray %.17g %.17g: an end of one interval alone; chord %.9g, grazing %.2g\n", x, y, chord,
                    spread);
    }
}

/* ---- a mesh ---- */

static kernel_thread open_thread(void)
{
    kernel_thread thread = {.cache = base_calloc(1, kernels()->cache_bytes),
                            .polyhedra = polyhedra_create(),
                            .find_polyhedron = polyhedra_find,
                            .polyhedron_scratch = polyhedra_scratch};
    assert_non_null(thread.cache);
    assert_non_null(thread.polyhedra);
    return thread;
}

static void trace(const render_job *job, kernel_thread *thread, chord_rays *rays)
{
    kernel_frame frame;
    base_error error = {0};
    assert_int_equal(render_prepare(job, &frame, &error), INSITU_OK);
    polyhedra_reset(thread->polyhedra);
    kernels()->trace(&frame, thread, rays);
    assert_false(thread->out_of_memory);
    render_unprepare(&frame);
}

/* The first tally is of rays that are set up alone, the second of the same rays as those of one tile. */
static void judge_mesh(chord_mesh kind, double jitter, chord_aim aim, int64_t count, tally tallies[2])
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
            trace(&f.job, &thread, &rays);
            for (int i = 0; i < rays.count; i++)
                judge_ray(&f.job, rays.x[i], rays.y[i], rays.spans[i], rays.span_count[i], &tallies[by_tile]);
        }
    }
    fixture_free(&f);
    test_mesh_free(&mesh);
    polyhedra_free(thread.polyhedra);
    base_free(thread.cache);
}

static void tell(const char *what, const char *mesh, int by_tile, const tally *t)
{
    printf("%s%s%s, %s: %lld rays, %lld cells; off by %.2g of the side at most, %lld graze the hull; overlaps by "
           "rounding on "
           "%lld, %.2g at most; %lld wrong lengths, %lld with ends alone\n",
           what, *mesh ? ", " : "", mesh, by_tile ? "by tile" : "alone", (long long)t->rays, (long long)t->spans,
           t->worst_length, (long long)t->grazing, (long long)t->doubled, t->worst_doubled, (long long)t->off,
           (long long)t->unpaired);
}

static void add_tally(tally *sum, const tally *t)
{
    sum->rays += t->rays;
    sum->met += t->met;
    sum->spans += t->spans;
    sum->grazing += t->grazing;
    sum->unpaired += t->unpaired;
    sum->off += t->off;
    sum->doubled += t->doubled;
    sum->worst_length = fmax(sum->worst_length, t->worst_length);
    sum->worst_doubled = fmax(sum->worst_doubled, t->worst_doubled);
}

static void judge(chord_aim aim, const char *what)
{
    const int64_t share = rays_wanted / (CHORD_AIM_COUNT * MESH_COUNT * 2) + 1;
    tally all[2] = {{.rays = 0}};
    for (chord_mesh mesh = 0; mesh < MESH_COUNT; mesh++)
        for (int jittered = 0; jittered < 2; jittered++) {
            tally t[2] = {{.rays = 0}};
            judge_mesh(mesh, jittered ? jitter_wanted : 0, aim, share, t);
            for (int by_tile = 0; by_tile < 2; by_tile++) {
                if (t[by_tile].off || t[by_tile].unpaired || getenv("INSITU_TEST_VERBOSE"))
                    tell(what, mesh_name(mesh), by_tile, &t[by_tile]);
                assert_true(3 * t[by_tile].met > t[by_tile].rays);
                add_tally(&all[by_tile], &t[by_tile]);
            }
        }
    for (int by_tile = 0; by_tile < 2; by_tile++) tell(what, "", by_tile, &all[by_tile]);
    for (int by_tile = 0; by_tile < 2; by_tile++) {
        assert_int_equal(all[by_tile].off, 0);
        assert_int_equal(all[by_tile].unpaired, 0);
        assert_true(all[by_tile].worst_doubled <= doubled_allowed);
    }
}

static void random_rays_add_up_to_their_chords(void **state)
{
    (void)state;
    judge(CHORD_RANDOM, "random");
}

static void rays_through_vertices_add_up_to_their_chords(void **state)
{
    (void)state;
    judge(CHORD_TO_VERTICES, "through vertices");
}

static void rays_through_edges_add_up_to_their_chords(void **state)
{
    (void)state;
    judge(CHORD_TO_EDGES, "through edges");
}

static void rays_through_faces_add_up_to_their_chords(void **state)
{
    (void)state;
    judge(CHORD_TO_FACES, "through faces");
}

static void rays_along_edges_add_up_to_their_chords(void **state)
{
    (void)state;
    judge(CHORD_ALONG_EDGES, "along edges");
}

static void rays_along_faces_add_up_to_their_chords(void **state)
{
    (void)state;
    judge(CHORD_ALONG_FACES, "along faces");
}

static void axis_aligned_rays_add_up_to_their_chords(void **state)
{
    (void)state;
    judge(CHORD_AXIS_ALIGNED, "axis-aligned");
}

static void rays_from_inside_add_up_to_their_chords(void **state)
{
    (void)state;
    judge(CHORD_FROM_INSIDE, "from inside");
}

/* The argument is the number of rays. */
int main(int argc, char **argv)
{
    if (argc > 1) rays_wanted = atoll(argv[1]);
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
