/* Checks hanging nodes, at which a face of a large cell coincides with four or sixteen faces of smaller cells. The
 * cells on both sides compute depths from their own vertices, and rounding leaves gaps and overlaps between them. These
 * must not be visible: no pixel is reported as one in which cells overlap, no ray passes between the cells, and the
 * picture is the same on any number of ranks. Results are reduced over the ranks before they are asserted, so that a
 * failing rank does not leave the others waiting. */
#include "memory.h"
#include "reference_integral.h"
#include "session_frame.h"
#include "test_mesh_hanging.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { WIDTH = 67, HEIGHT = 51, PIXELS = WIDTH * HEIGHT, SIDE = 4, MANY = 1 << 22 };

static int my_rank, rank_count;

typedef struct drawing {
    const char *name;
    double max_error; /* 0: the volume is drawn by samples, or only surfaces are drawn */
    float opacity;    /* opacity of the surfaces; 0: there are no surfaces */
    bool has_volume;
    int value_count; /* number of surfaces; 0: there are no surfaces */
} drawing;

static const drawing volumes[] = {
    {"samples", 0, 0, true, 0},
    {"max_error 0.1", 1e-1, 0, true, 0},
    {"max_error 0.01", 1e-2, 0, true, 0},
    {"max_error 0.0001", 1e-4, 0, true, 0},
    {"max_error 0.01, transparent surfaces", 1e-2, 0.4f, true, 2},
};
enum { VOLUME_COUNT = sizeof volumes / sizeof volumes[0] };

/* ---- pictures ------------------------------------------------------------------------------------------------ */

static const double surface_values[2] = {0.05, 0.3};

static void set_up_frame(render_fixture *f, const test_mesh *mesh, const drawing *d, fixture_camera camera)
{
    fixture_create(f, mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 2.0 / SIDE, 1,
                   (const double[]){0, 0, 0});
    fixture_set_camera(f, camera, WIDTH, HEIGHT);
    if (d->value_count) fixture_add_surface(f, surface_values, d->value_count, d->opacity);
    if (d->has_volume) fixture_set_volume(f, 0.3);
    f->job.integration = d->max_error > 0 ? RENDER_SEGMENTS : RENDER_SAMPLES;
    f->job.max_error = d->max_error;
    f->job.extent = 2 * sqrt(3);
}

static int64_t draw_mesh(render_fixture *f, MPI_Comm comm, bool is_alone, image *out)
{
    session_frame frame;
    base_error error = {0};
    *out = (image){WIDTH, HEIGHT, malloc(4 * PIXELS * sizeof(float)), malloc(PIXELS * sizeof(float)), NULL, false};
    f->job.is_alone = is_alone;
    int ranks = 1;
    MPI_Comm_size(comm, &ranks);
    const comp_group group = {comm, {1, false}, COMP_AUTOMATIC, 0, comp_claims_create(ranks)};
    const session_frame_target target = {comm, group, fixture_background, MANY};
    if (session_draw_frame(&target, &f->job, out, &frame, &error)) fail_msg("session_draw_frame: %s", error.message);
    comp_claims_free(group.claims);
    return frame.overlaps;
}

static void free_image(image *picture)
{
    free(picture->rgba);
    free(picture->depth);
}

static int64_t draw_whole(const test_mesh *mesh, const drawing *d, fixture_camera camera, image *out)
{
    render_fixture f;
    set_up_frame(&f, mesh, d, camera);
    const int64_t overlaps = draw_mesh(&f, MPI_COMM_SELF, true, out);
    fixture_free(&f);
    return overlaps;
}

/* Draws as a session does: every rank draws its part of the mesh. */
static int64_t draw_distributed(const test_mesh *mesh, test_partition_kind partition, const drawing *d,
                                fixture_camera camera, image *out)
{
    render_fixture f;
    test_mesh share;
    int *owners = malloc((size_t)mesh->cell_count * sizeof *owners);
    test_partition_cells(mesh, partition, SIDE, rank_count, owners);
    test_mesh_extract_part(mesh, owners, my_rank, &share);
    set_up_frame(&f, &share, d, camera);
    const int64_t overlaps = draw_mesh(&f, MPI_COMM_WORLD, rank_count == 1, out);
    fixture_free(&f);
    test_mesh_free(&share);
    free(owners);
    return overlaps;
}

static void assert_everywhere(bool is_well)
{
    int mine = is_well, all = 0;
    MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_LAND, MPI_COMM_WORLD);
    assert_true(all);
}

static double find_largest_image_difference(const image *a, const image *b)
{
    double worst = 0;
    for (int i = 0; i < 4 * PIXELS; i++)
        worst = test_larger_error(worst, fabs((double)a->rgba[i] - (double)b->rgba[i]));
    return worst;
}

/* ---- meshes -------------------------------------------------------------------------------------------------- */

typedef struct hanging_case {
    test_mesh_kind kind;
    int side;
    test_hanging_shape shape;
    bool is_polyhedral; /* whether the cells are stored as polyhedra, by their faces */
} hanging_case;

static const hanging_case cases[] = {
    {TEST_HEXES, 2, TEST_HANGING_DYADIC, false},  {TEST_HEXES, 4, TEST_HANGING_DYADIC, false},
    {TEST_HEXES, 2, TEST_HANGING_ROTATED, false}, {TEST_HEXES, 4, TEST_HANGING_ROTATED, false},
    {TEST_HEXES, 2, TEST_HANGING_CURVED, false},  {TEST_HEXES, 4, TEST_HANGING_CURVED, false},
    {TEST_HEXES, 2, TEST_HANGING_ROTATED, true},  {TEST_WEDGES, 2, TEST_HANGING_ROTATED, false},
    {TEST_TETS, 2, TEST_HANGING_ROTATED, false},  {TEST_TETS, 4, TEST_HANGING_DYADIC, false},
};
enum { CASE_COUNT = sizeof cases / sizeof cases[0] };

static void make_mesh(const hanging_case *c, test_function *f, test_mesh *out)
{
    test_mesh_make_hanging(c->kind, SIDE, c->side, c->shape, f, out);
    if (c->is_polyhedral) test_mesh_to_polyhedra(out, 1);
}

static void name_case(const hanging_case *c, char *name, size_t size)
{
    snprintf(name, size, "%s%s 1:%d, %s", test_mesh_kind_name(c->kind), c->is_polyhedral ? " as polyhedra" : "",
             c->side, test_hanging_shape_name(c->shape));
}

/* ---- volumes ------------------------------------------------------------------------------------------------- */

/* Compares the picture with the adaptive integral. In double, rounding leaves no visible gap. Rays in the plane of a
 * face, such as those along x, must be left out, because the integral does not decide on which side of the face they
 * are. */
static bool matches_integral(const test_mesh *mesh, const drawing *d, fixture_camera camera, const image *drawn,
                             const char *what)
{
    render_fixture f;
    set_up_frame(&f, mesh, d, camera);
    reference_integral *scene = reference_integral_create(&f.job, 1e-8);
    double worst = 0;
    for (int p = 0; p < PIXELS; p += 29) {
        double rgba[4];
        reference_integral_trace(scene, p % WIDTH, p / WIDTH, fixture_background, NULL, 0, rgba);
        for (int c = 0; c < 4; c++) worst = test_larger_error(worst, fabs((double)drawn->rgba[4 * p + c] - rgba[c]));
    }
    reference_integral_free(scene);
    fixture_free(&f);
    if (worst > d->max_error) fprintf(stderr, "%s, %s: off by %g\n", what, d->name, worst);
    return worst <= d->max_error;
}

/* Compares the pictures that all ranks draw together and that rank 0 draws from the whole mesh. The tolerance is 1e-6,
 * because "over" rounds differently if fragments are grouped differently. */
static bool is_one_picture(const test_mesh *mesh, test_partition_kind partition, const drawing *d,
                           fixture_camera camera, const char *what)
{
    image ours, whole;
    bool good = true;
    const int64_t overlaps = draw_distributed(mesh, partition, d, camera, &ours);
    if (my_rank == 0) {
        const int64_t alone = draw_whole(mesh, d, camera, &whole);
        const double off = find_largest_image_difference(&whole, &ours);
        good = !overlaps && !alone && off <= 1e-6;
        if (!good || getenv("INSITU_TEST_VERBOSE"))
            fprintf(stderr, "%s, %d ranks, %s, %s, %s: %d pixels overlap, %d alone; colour differs by %g\n", what,
                    rank_count, test_partition_kind_name(partition), d->name, fixture_camera_name(camera),
                    (int)overlaps, (int)alone, off);
        if (rank_count == 1 && camera != CAMERA_ALONG_X && d->max_error > 0 && !d->value_count)
            good = matches_integral(mesh, d, camera, &whole, what) && good;
        free_image(&whole);
    }
    free_image(&ours);
    return good;
}

static void hanging_nodes_do_not_count_as_overlaps(void **state)
{
    (void)state;
    bool good = true;
    for (int i = 0; i < CASE_COUNT; i++) {
        test_mesh mesh;
        char what[80];
        name_case(&cases[i], what, sizeof what);
        make_mesh(&cases[i], test_wave_field, &mesh);
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
            const drawing *d = &volumes[(i + (int)camera) % VOLUME_COUNT];
            const test_partition_kind partition = (i / VOLUME_COUNT + (int)camera) % 2 ? TEST_BLOCK : TEST_RANDOM;
            good = is_one_picture(&mesh, partition, d, camera, what) && good;
        }
        test_mesh_free(&mesh);
    }
    assert_everywhere(good);
}

/* ---- surfaces ------------------------------------------------------------------------------------------------ */

/* Computes the depth at which the ray of a pixel meets the plane on which test_linear_field() has the given value.
 * Returns whether this point is well inside the mesh: within the ball of radius 0.5, which all shapes contain. */
static bool intersects_plane(const render_camera *camera, int p, double value, double *depth)
{
    double base[3], direction[3], end[3], distance = 0;
    render_camera_ray(camera, p % WIDTH, p / WIDTH, base, direction);
    const double at_base = test_linear_field(base);
    for (int a = 0; a < 3; a++) end[a] = base[a] + direction[a];
    const double slope = test_linear_field(end) - at_base;
    *depth = (value - at_base) / slope;
    for (int a = 0; a < 3; a++) {
        const double x = base[a] + *depth * direction[a];
        distance += x * x;
    }
    return *depth > 0 && distance < 0.25;
}

/* Checks that the isosurface of a linear field is a plane without holes. */
static bool has_plane_without_holes(const hanging_case *c, fixture_camera camera)
{
    static const drawing plane = {"plane", 0, 1, false, 1};
    test_mesh mesh;
    image drawn;
    render_fixture f;
    int holes = 0, met = 0;
    double worst = 0, depth;
    char what[80];
    name_case(c, what, sizeof what);
    make_mesh(c, test_linear_field, &mesh);
    draw_distributed(&mesh, TEST_RANDOM, &plane, camera, &drawn);
    set_up_frame(&f, &mesh, &plane, camera);
    for (int p = 0; p < PIXELS && my_rank == 0; p++) {
        if (!intersects_plane(&f.job.camera, p, surface_values[0], &depth)) continue;
        met++;
        if (!(drawn.depth[p] < INFINITY))
            holes++;
        else
            worst = test_larger_error(worst, fabs(fixture_compute_scene_depth(&f, drawn.depth[p]) - depth));
    }
    const bool good = my_rank != 0 || (met > 30 && !holes && worst < 1e-5);
    if (!good)
        fprintf(stderr, "%s, %d ranks, %s: background in %d of %d pixels of the plane, depth off by %g\n", what,
                rank_count, fixture_camera_name(camera), holes, met, worst);
    fixture_free(&f);
    free_image(&drawn);
    test_mesh_free(&mesh);
    return good;
}

static void surfaces_continue_across_hanging_nodes(void **state)
{
    (void)state;
    bool good = true;
    for (int i = 0; i < CASE_COUNT; i++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++)
            if (camera != CAMERA_INSIDE) good = has_plane_without_holes(&cases[i], camera) && good;
    assert_everywhere(good);
}

/* ---- hanging nodes off the coarse face --------------------------------------------------------------------------- */

/* Checks refinement that moves hanging nodes off the coarse face, so that cells do overlap. Any number of ranks must
 * detect the overlap. Pictures agree only to max_error, because whether an overlap that is almost transparent is
 * detected depends on the partition. */
static void nodes_off_the_coarse_face_count_as_overlaps(void **state)
{
    (void)state;
    bool good = true;
    for (int v = 0; v < 3; v++) {
        test_mesh mesh;
        image ours, whole;
        test_mesh_make_hanging(TEST_HEXES, SIDE, 2, TEST_HANGING_ROUND, test_wave_field, &mesh);
        const int64_t overlaps = draw_distributed(&mesh, TEST_RANDOM, &volumes[v], CAMERA_OUTSIDE, &ours);
        if (my_rank == 0) {
            const double bound = volumes[v].max_error > 0 ? volumes[v].max_error : 1e-6;
            const int64_t alone = draw_whole(&mesh, &volumes[v], CAMERA_OUTSIDE, &whole);
            const double off = find_largest_image_difference(&whole, &ours);
            good = good && overlaps > 50 && alone > 50 && off <= bound;
            if (!good)
                fprintf(stderr, "%s, %d ranks: %d pixels overlap, %d alone; colour differs by %g\n", volumes[v].name,
                        rank_count, (int)overlaps, (int)alone, off);
            free_image(&whole);
        }
        free_image(&ours);
        test_mesh_free(&mesh);
    }
    assert_everywhere(good);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hanging_nodes_do_not_count_as_overlaps),
        cmocka_unit_test(surfaces_continue_across_hanging_nodes),
        cmocka_unit_test(nodes_off_the_coarse_face_count_as_overlaps),
    };
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &my_rank);
    MPI_Comm_size(MPI_COMM_WORLD, &rank_count);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    MPI_Finalize();
    return failed;
}
