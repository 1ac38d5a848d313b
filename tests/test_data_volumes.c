/* Checks max_error on the real grids of INSITU_TEST_DATA. Each grid is drawn by segments with max_error 1e-2, 1e-3 and
 * 1e-4, with two transfer functions, and compared, in linear light, with the adaptive integral in double over all
 * cells. The usual run draws each grid with one of the two functions alternately; grids with known pixels (see below)
 * are drawn with both.
 *
 * test_data_volumes [pixels [name]]: `pixels` is the number of pixels of a picture that are compared; 0 means all. Half
 * of them are the pixels in which the pictures with different max_error differ most, because errors are largest there.
 * The other half is chosen at random among pixels that are not empty. Pixels that were wrong in the past are added.
 * Returns 77 if INSITU_TEST_DATA is not set.
 *
 * Cells that a ray cannot meet, by the bounds of their projections, are hidden for the reference, so that brute force
 * need not test half a million cells. */
#include <mpi.h>

#include "colour_map.h"
#include "comp.h"
#include "memory.h"
#include "reference_integral.h"
#include "session_frame.h"
#include "test_data_mesh.h"
#include "test_effort.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { WIDTH = 72, HEIGHT = 54, PIXELS = WIDTH * HEIGHT, ERRORS = 3, MAX_FRAGMENTS = 1 << 22 };

static const double errors[ERRORS] = {1e-2, 1e-3, 1e-4};

typedef struct data_set {
    const char *file, *field;
    double low, high;
    double eye[3], focal[3], up[3];
} data_set;

/* The grids, fields and ranges that the data's README lists. */
static const data_set sets[] = {
    {"bluntfin_hex",
     "Density",
     0.4,
     3.5,
     {22.6672452, 17.0931239, 27.1046469},
     {3.27322817, 4.16377926, 2.86212564},
     {0, 1, 0}},
    {"bluntfin_tet",
     "Density",
     0.4,
     3.5,
     {22.6672452, 17.0931239, 27.1046469},
     {3.27322817, 4.16377926, 2.86212564},
     {0, 1, 0}},
    {"post_hex",
     "VelocityMagnitude",
     0,
     1.4,
     {27.2353818, -27.2288028, 31.9081323},
     {0.00657892227, 0, 2.41026258},
     {0, 0, 1}},
    {"post_tet",
     "VelocityMagnitude",
     0,
     1.4,
     {27.2353818, -27.2288028, 31.9081323},
     {0.00657892227, 0, 2.41026258},
     {0, 0, 1}},
    {"disk_out_ref", "Temp", 293, 913, {21.3754114, 14.2502743, 26.7992642}, {0, 0, 0.0799999237}, {0, 0, 1}},
    {"can_0", "EQPS_pt", -1, 1, {11.9284083, 11.5006146, 5.19059499}, {-1.10507655, 2.81162468, -7.1}, {0, 1, 0}},
    {"can_1",
     "EQPS_pt",
     0,
     1.9,
     {11.9284083, 11.5006146, 5.19059499},
     {-1.10507655, 2.81162468, -11.1012611},
     {0, 1, 0}},
    {"can_2",
     "EQPS_pt",
     0,
     2.7,
     {12.6805494, 11.5344615, 3.6886744},
     {-2.83946896, 1.18778265, -15.7113485},
     {0, 1, 0}},
    {"carotid", "scalars", 100, 400, {216.537206, 156.691471, 121.796508}, {137.5, 104, 23}, {0, 1, 0}},
    {"kitchen", "c15", 0, 0.3, {10.8842889, -6.71911107, 6.1745259}, {3.505, 2.505, 1.255}, {0, 0, 1}},
    {"hexa",
     "scalars",
     0.75,
     17.3,
     {2.01636396, 1.50366297, 2.40088971},
     {0.478260994, 0.478260994, 0.478260994},
     {0, 1, 0}},
    {"notch_stress",
     "Nodal Stress-normed",
     0,
     8000000,
     {0.409310848, 0.301173018, 0.423621697},
     {0.2, 0.05, 0.005},
     {0, 1, 0}},
    {"cylinder_linear",
     "vel_norm",
     0,
     1,
     {0.0479802406, 0.143940722, 0.0787881444},
     {0, -8.67361738e-19, 0.05},
     {1, 0, 0}},
    {"cylinder_quadratic",
     "velocity_norm",
     0,
     1,
     {0.0479802406, 0.143940722, 0.0787881444},
     {0, -8.67361738e-19, 0.05},
     {1, 0, 0}},
    {"mesh_fs8_wedge", "synthetic", -2, 1.8, {14.2187613, -15.8616313, 13.0923689}, {6, 1.75, 3.69949889}, {0, 0, 1}},
    {"pentahexa", "synthetic", -1, 1.6, {2.78792625, 1.8586175, 3.48490782}, {0, 0, 0}, {0, 1, 0}},
    {"mixed_lattice", "f", -1.5, 1.5, {3.08739134, 2.05826089, 3.85923918}, {0, 0, 0}, {0, 1, 0}},
    {"poly_voronoi", "f", -1.5, 1.5, {3.08739134, 2.05826089, 3.85923918}, {0, 0, 0}, {0, 1, 0}},
    {"tiny_QuadraticTetra", "DistanceToCenter", 0.3, 1.74, {4.85923918, 3.57282612, 5.82404897}, {1, 1, 1}, {0, 1, 0}},
    {"tiny_QuadraticWedge", "DistanceToCenter", 0.3, 1.74, {4.85923918, 3.57282612, 5.82404897}, {1, 1, 1}, {0, 1, 0}},
};

/* Known pixels: they were wrong in the past and are always compared. They show pentahexa: prisms whose base has
 * collapsed to one vertex and whose faces have either orientation. */
typedef struct known_pixel {
    const char *file;
    int x, y;
} known_pixel;

static const known_pixel known[] = {{"pentahexa", 34, 24}, {"pentahexa", 35, 27}};

enum { KNOWN = sizeof known / sizeof known[0] };

/* The two opacity functions: the default of a scene, and shells, which are steep ramps of low opacity as users draw
 * them. */
typedef struct opacity_shape {
    const char *name, *map;
    int count;
    double at[8];
    float opacities[8];
} opacity_shape;

static const opacity_shape shapes[] = {
    {"ramp", "viridis", 2, {0, 1}, {0, 0.9f}},
    {"shells", "cool_to_warm", 8, {0.1, 0.15, 0.2, 0.4, 0.45, 0.5, 0.8, 1}, {0, 0.5f, 0, 0, 0.8f, 0, 0, 0.95f}},
};

static int pixel_count;
static const char *only;

/* ---- a grid under test ------------------------------------------------------------------------------------------ */

typedef struct subject {
    render_fixture f;
    double diagonal;
    double opacity_values[8];
    unsigned char *ghosts; /* ghost flags of the grid's cells, one byte each */
    int rectangle_count;
    /* for each cell the rectangle of pixels whose rays may meet it: first and last x, first and last y */
    int (*rectangles)[4];
    /* for each pixel, whether its ray may meet a folded cell, which has no unique value at a point */
    unsigned char *folded;
} subject;

static void compute_bounds(const test_mesh *mesh, double lower[3], double upper[3])
{
    for (int axis = 0; axis < 3; axis++) lower[axis] = upper[axis] = mesh->coordinates[axis];
    for (int64_t v = 0; v < mesh->vertex_count; v++)
        for (int axis = 0; axis < 3; axis++) {
            lower[axis] = fmin(lower[axis], mesh->coordinates[3 * v + axis]);
            upper[axis] = fmax(upper[axis], mesh->coordinates[3 * v + axis]);
        }
}

static void set_transfer(subject *s, const data_set *set, const opacity_shape *shape)
{
    render_transfer *t = &s->f.transfer;
    for (int i = 0; i < shape->count; i++) s->opacity_values[i] = set->low + shape->at[i] * (set->high - set->low);
    *t = (render_transfer){.low = set->low,
                           .high = set->high,
                           .opacity_count = shape->count,
                           .opacity_values = s->opacity_values,
                           .opacities = shape->opacities,
                           .unit_distance = s->diagonal / 20};
    t->colours = colour_map_table(shape->map, &t->colour_count);
}

/* Computes the rectangle of pixels whose rays may meet the cell: the bounds of the cell's projection, widened by a
 * pixel on each side. */
static void project_cell_bounds(const render_camera *c, const grid *g, int64_t cell, int out[4])
{
    const double per_slope = 0.5 * c->height / c->half_height;
    double low[2] = {1e9, 1e9}, high[2] = {-1e9, -1e9};
    grid_walk walk = grid_walk_cell(g, cell);
    int64_t vertex;
    while (grid_walk_next(&walk, &vertex)) {
        double world[3], p[3] = {0, 0, 0};
        grid_read_vertex_position(g, vertex, world);
        for (int i = 0; i < 3; i++) {
            const double d = world[i] - c->eye[i];
            p[0] += d * c->right[i];
            p[1] -= d * c->up[i];
            p[2] += d * c->forward[i];
        }
        for (int axis = 0; axis < 2; axis++) {
            const double middle = 0.5 * (axis ? c->height : c->width) - 0.5;
            const double at = middle + per_slope * p[axis] / p[2];
            low[axis] = p[2] > 0 ? fmin(low[axis], at) : -1e9;
            high[axis] = p[2] > 0 ? fmax(high[axis], at) : 1e9;
        }
    }
    for (int axis = 0; axis < 2; axis++) {
        out[2 * axis] = (int)fmax(floor(low[axis]) - 1, 0);
        out[2 * axis + 1] = (int)fmin(ceil(high[axis]) + 1, (axis ? c->height : c->width) - 1);
    }
}

/* Each corner followed by its three neighbours. They are in right-handed order if the cell is right-handed. */
static const signed char hex_corners[8][4] = {{0, 1, 3, 4}, {1, 2, 0, 5}, {2, 3, 1, 6}, {3, 0, 2, 7},
                                              {4, 7, 5, 0}, {5, 4, 6, 1}, {6, 5, 7, 2}, {7, 6, 4, 3}};
static const signed char wedge_corners[6][4] = {{0, 1, 2, 3}, {1, 2, 0, 4}, {2, 0, 1, 5},
                                                {3, 5, 4, 0}, {4, 3, 5, 1}, {5, 4, 3, 2}};
static const signed char pyramid_corners[4][4] = {{0, 1, 3, 4}, {1, 2, 0, 4}, {2, 3, 1, 4}, {3, 0, 2, 4}};

static double corner_volume(double p[][3], const signed char corner[4])
{
    double e[3][3];
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 3; axis++) e[i][axis] = p[corner[i + 1]][axis] - p[corner[0]][axis];
    return e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) + e[0][1] * (e[1][2] * e[2][0] - e[1][0] * e[2][2]) +
           e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0]);
}

/* Returns whether the cell is inverted at some corners but not at all. The cell's map is then not one-to-one, and the
 * solver decides which of several values the field has at a point, so there is no reference to compare with. */
static bool is_folded(const grid *g, int64_t cell)
{
    const int type = grid_cell_type(g, cell);
    const signed char(*corners)[4] = type == GRID_HEX     ? hex_corners
                                     : type == GRID_WEDGE ? wedge_corners
                                                          : pyramid_corners;
    const int count = type == GRID_HEX ? 8 : type == GRID_WEDGE ? 6 : type == GRID_PYRAMID ? 4 : 0;
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    double p[GRID_MAX_CELL_VERTICES][3];
    bool is_right = false, is_left = false;
    const int vertex_count = grid_cell_vertices(g, cell, vertices);
    for (int i = 0; i < vertex_count; i++) grid_read_vertex_position(g, vertices[i], p[i]);
    for (int i = 0; i < count; i++) {
        const double volume = corner_volume(p, corners[i]);
        is_right = is_right || volume > 0;
        is_left = is_left || volume < 0;
    }
    return is_right && is_left;
}

static void project_cells(subject *s)
{
    const grid *g = &s->f.views[0].cells;
    s->rectangle_count = (int)g->cell_count;
    s->rectangles = malloc((size_t)g->cell_count * sizeof *s->rectangles);
    s->folded = malloc(PIXELS);
    memset(s->folded, 0, PIXELS);
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        int *r = s->rectangles[cell];
        project_cell_bounds(&s->f.job.camera, g, cell, r);
        if (!is_folded(g, cell)) continue;
        for (int y = r[2]; y <= r[3]; y++)
            for (int x = r[0]; x <= r[1]; x++) s->folded[y * WIDTH + x] = 1;
    }
}

static bool subject_create(subject *s, const data_set *set, const opacity_shape *shape)
{
    char path[4096];
    test_mesh mesh;
    double lower[3], upper[3], centre[3], half = 0;
    snprintf(path, sizeof path, "%s/%s.vtu", getenv("INSITU_TEST_DATA"), set->file);
    if (!test_data_mesh(path, set->field, &mesh)) return false;
    compute_bounds(&mesh, lower, upper);
    for (int axis = 0; axis < 3; axis++) {
        centre[axis] = 0.5 * (lower[axis] + upper[axis]);
        half = fmax(half, 0.5 * (upper[axis] - lower[axis]));
    }
    s->diagonal = hypot(hypot(upper[0] - lower[0], upper[1] - lower[1]), upper[2] - lower[2]);
    fixture_create(&s->f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true, .with_types = true},
                   s->diagonal / 100, half, centre);
    test_mesh_free(&mesh);
    render_job *job = &s->f.job;
    assert_true(render_camera_look_at(&job->camera, set->eye, set->focal, set->up, 40, WIDTH, HEIGHT));
    job->space.depth_origin = 0;
    for (int axis = 0; axis < 3; axis++)
        job->space.depth_origin += job->camera.forward[axis] * (centre[axis] - job->camera.eye[axis]);
    fixture_set_volume(&s->f, 1);
    set_transfer(s, set, shape);
    job->integration = RENDER_SEGMENTS;
    job->extent = s->diagonal;
    s->ghosts = s->f.views[0].storage[5];
    assert_ptr_equal(s->ghosts, s->f.views[0].cells.ghosts);
    project_cells(s);
    return true;
}

static void subject_free(subject *s)
{
    fixture_free(&s->f);
    free(s->rectangles);
    free(s->folded);
}

/* Hides, by ghost flags, the cells that the pixel's ray cannot meet. If of_folded is set, also hides all cells that are
 * not folded. */
static void hide_others(subject *s, int pixel, bool of_folded)
{
    const int x = pixel % WIDTH, y = pixel / WIDTH;
    for (int i = 0; i < s->rectangle_count; i++) {
        const int *r = s->rectangles[i];
        s->ghosts[i] = x < r[0] || x > r[1] || y < r[2] || y > r[3];
        if (of_folded && !s->ghosts[i]) s->ghosts[i] = !is_folded(&s->f.views[0].cells, i);
    }
}

static void compute_reference_pixel(subject *s, int pixel, bool of_folded, double rgba[4])
{
    hide_others(s, pixel, of_folded);
    reference_integral *scene = reference_integral_create(&s->f.job, 1e-9);
    reference_integral_trace(scene, pixel % WIDTH, pixel / WIDTH, fixture_background, NULL, 0, rgba);
    reference_integral_free(scene);
}

/* Returns whether the ray meets a folded cell, or a face whose patch is folded at the ray. To find out whether the ray
 * meets a folded cell, only folded cells are drawn, as a fog of constant density. */
static bool is_pixel_without_reference(subject *s, int pixel)
{
    double rgba[4];
    reference_ray ray;
    if (s->folded[pixel]) {
        static const float fog = 0.5f;
        const render_transfer transfer = s->f.transfer;
        s->f.transfer.opacity_count = 1;
        s->f.transfer.opacities = &fog;
        compute_reference_pixel(s, pixel, true, rgba);
        s->f.transfer = transfer;
        if (fabs(rgba[3] - (double)fixture_background[3]) > 1e-7) return true;
    }
    hide_others(s, pixel, false);
    reference_scene *scene = reference_create(&s->f.job);
    reference_trace(scene, pixel % WIDTH, pixel / WIDTH, fixture_background, &ray);
    reference_free(scene);
    return ray.ambiguous || ray.map_failed;
}

/* ---- pictures and pixels ------------------------------------------------------------------------------------- */

typedef struct picture {
    float rgba[4 * PIXELS], depth[PIXELS];
    session_frame frame;
} picture;

static void draw_subject(subject *s, double max_error, picture *out)
{
    base_error error = {0};
    image target = {WIDTH, HEIGHT, out->rgba, out->depth, NULL, false};
    memset(s->ghosts, 0, (size_t)s->rectangle_count);
    s->f.job.max_error = max_error;
    const comp_group group = {MPI_COMM_SELF, {1, false}, COMP_AUTOMATIC, 0, comp_claims_create(1)};
    const session_frame_target where = {MPI_COMM_SELF, group, fixture_background, MAX_FRAGMENTS};
    if (session_draw_frame(&where, &s->f.job, &target, &out->frame, &error) != INSITU_OK)
        fail_msg("session_draw_frame: %s", error.message);
    comp_claims_free(group.claims);
}

static double compute_pixel_difference(const picture *a, const picture *b, int pixel)
{
    double most = 0;
    for (int c = 4 * pixel; c < 4 * pixel + 4; c++) most = fmax(most, fabs((double)a->rgba[c] - (double)b->rgba[c]));
    return most;
}

static const picture *ordered_by;

static int compare_pixels(const void *left, const void *right)
{
    const int a = *(const int *)left, b = *(const int *)right;
    const double at_a = compute_pixel_difference(&ordered_by[0], &ordered_by[ERRORS - 1], a);
    const double at_b = compute_pixel_difference(&ordered_by[0], &ordered_by[ERRORS - 1], b);
    return at_a != at_b ? (at_a > at_b ? -1 : 1) : a - b;
}

/* Chooses the pixels to compare. Returns their number. */
static int choose_pixels(const data_set *set, const picture *pictures, int pixels[PIXELS + KNOWN])
{
    int shown = 0;
    for (int p = 0; p < PIXELS; p++)
        if (pictures[ERRORS - 1].rgba[4 * p + 3] > fixture_background[3] + 1e-3f) pixels[shown++] = p;
    if (pixel_count == 0 || pixel_count >= shown) return shown;
    ordered_by = pictures;
    qsort(pixels, (size_t)shown, sizeof *pixels, compare_pixels);
    for (int i = pixel_count / 2; i < pixel_count; i++) {
        const int other = i + (int)(test_uniform((uint64_t)i, 77) * (shown - i)), kept = pixels[i];
        pixels[i] = pixels[other];
        pixels[other] = kept;
    }
    int count = pixel_count;
    for (int i = 0; i < KNOWN; i++)
        if (strcmp(known[i].file, set->file) == 0) pixels[count++] = known[i].y * WIDTH + known[i].x;
    return count;
}

/* ---- the test ------------------------------------------------------------------------------------------------ */

/* Returns the largest allowed number of pixels without a reference. Only the crushed can has folded cells, and at most
 * a seventh of all its pixels show them (63 of 612, and 58 of 459). In a sample of pixels, however, all of the half in
 * which pictures differ most may show folded cells. */
static int get_most_unreferenced_pixels(const data_set *set, int count)
{
    if (strcmp(set->file, "can_2") != 0) return 0;
    return pixel_count == 0 ? count / 7 : count * 3 / 4;
}

/* Returns whether the picture is empty: before the impact (can_0) the field is 0 in all cells, and the opacity function
 * `shells` is 0 at this value. */
static bool is_picture_empty(const data_set *set, const opacity_shape *shape)
{
    return strcmp(set->file, "can_0") == 0 && strcmp(shape->name, "shells") == 0;
}

static int check_picture(const data_set *set, const opacity_shape *shape)
{
    subject s = {0};
    picture *pictures = malloc(ERRORS * sizeof *pictures);
    int *pixels = malloc((PIXELS + KNOWN) * sizeof *pixels), broken = 0, folded = 0;
    double worst[ERRORS] = {0};
    int worst_at[ERRORS] = {0};
    assert_true(subject_create(&s, set, shape));
    for (int e = 0; e < ERRORS; e++) draw_subject(&s, errors[e], &pictures[e]);
    const int count = choose_pixels(set, pictures, pixels);
    for (int i = 0; i < count; i++) {
        double truth[4];
        if (is_pixel_without_reference(&s, pixels[i])) {
            folded++;
            continue;
        }
        compute_reference_pixel(&s, pixels[i], false, truth);
        for (int e = 0; e < ERRORS; e++)
            for (int c = 0; c < 4; c++) {
                const double off = fabs((double)pictures[e].rgba[4 * pixels[i] + c] - truth[c]);
                if (off <= worst[e]) continue;
                worst[e] = test_larger_error(worst[e], off);
                worst_at[e] = pixels[i];
            }
    }
    fprintf(stderr, "%-20s %-6s %4d pixels, %lld overlap, %d folded:", set->file, shape->name, count,
            (long long)pictures[0].frame.overlaps, folded);
    for (int e = 0; e < ERRORS; e++) {
        const bool is_kept = worst[e] <= errors[e];
        fprintf(stderr, "  %g: %.2g at (%d, %d)%s %.0f ms", errors[e], worst[e], worst_at[e] % WIDTH,
                worst_at[e] / WIDTH, is_kept ? "" : " BROKEN", pictures[e].frame.volume_ms);
        broken += !is_kept;
    }
    fprintf(stderr, "\n");
    if (folded > get_most_unreferenced_pixels(set, count)) fail_msg("%d of %d pixels have no truth", folded, count);
    if (count == 0 && !is_picture_empty(set, shape)) fail_msg("nothing to compare");
    subject_free(&s);
    free(pictures);
    free(pixels);
    return broken;
}

static bool is_case_selected(size_t set, size_t shape)
{
    if (only) return strcmp(only, sets[set].file) == 0;
    for (int i = 0; i < KNOWN; i++)
        if (strcmp(known[i].file, sets[set].file) == 0) return true;
    return test_is_long_run() || (set + shape) % 4 == 1;
}

static void max_error_is_kept_on_real_grids(void **state)
{
    int broken = 0;
    (void)state;
    for (size_t i = 0; i < sizeof sets / sizeof sets[0]; i++)
        for (size_t k = 0; k < sizeof shapes / sizeof shapes[0]; k++)
            if (is_case_selected(i, k)) broken += check_picture(&sets[i], &shapes[k]);
    assert_int_equal(broken, 0);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(max_error_is_kept_on_real_grids)};
    const char *folder = getenv("INSITU_TEST_DATA");
    if (!folder || !folder[0]) {
        print_message("skipped: INSITU_TEST_DATA is not set\n");
        return 77;
    }
    pixel_count = argc > 1 ? atoi(argv[1]) : 16;
    only = argc > 2 ? argv[2] : NULL;
    MPI_Init(&argc, &argv);
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    MPI_Finalize();
    return failed;
}
