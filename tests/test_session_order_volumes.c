/* Checks volumes of cells of higher order, whose number of linear pieces is chosen to keep the error within max_error,
 * against integrals along each pixel's ray in double. The field has closed forms: the squared distance from the origin,
 * which straight cells represent exactly, and the interpolant of a product of waves in cubes, which is the product of
 * the interpolated waves. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_effort.h"
#include "test_mesh_order.h"
#include "test_session_fixture.h"

enum { WIDTH = 160, HEIGHT = 120, PIXELS = WIDTH * HEIGHT, STEPS = 400 };
#define VIEW_HEIGHT 2.6

/* A volume's transfer function: red, green and blue at equal distances in its range, and opacities per length of
 * 0.5. */
typedef struct transfer {
    const char *name, *text;
    int count;
    double low, high, positions[4], opacities[4];
} transfer;

static const transfer transfers[] = {
    {"ramp", "[[0, 0], [1, 0.8]]", 2, 0, 2.5, {0, 1}, {0, 0.8}},
    {"colours", "[[0, 0.3], [1, 0.3]]", 2, 0, 2.5, {0, 1}, {0.3, 0.3}},
    {"step", "[[0, 0], [0.5, 0], [0.55, 0.9], [1, 0.9]]", 4, 0, 2.5, {0, 0.5, 0.55, 1}, {0, 0, 0.9, 0.9}},
    {"dense outside", "[[0, 0.99], [0.3, 0.9], [1, 0]]", 3, 0, 2.5, {0, 0.3, 1}, {0.99, 0.9, 0}},
};

/* ---- integrals --------------------------------------------------------------------------------------------------- */

typedef double field_function(const double point[3], int order, int side);

static double compute_squared_distance(const double point[3], int order, int side)
{
    (void)order;
    (void)side;
    return order_sphere_field(point);
}

static double compute_wave_product(const double p[3])
{
    return 1.25 + sin(4 * p[0]) * cos(3 * p[1]) + 0.2 * p[2];
}

/* Interpolates sin(frequency x + phase) between the equispaced nodes of `side` cells in [-1, 1]. */
static double interpolate_wave(double frequency, double phase, double x, int order, int side)
{
    const double along = fmin(fmax((x + 1) / 2 * side, 0), side - 1e-12), cell = floor(along);
    const double at = (along - cell) * order;
    double sum = 0;
    for (int n = 0; n <= order; n++) {
        double weight = sin(frequency * (2 * (cell + (double)n / order) / side - 1) + phase);
        for (int m = 0; m <= order; m++)
            if (m != n) weight *= (at - m) / (n - m);
        sum += weight;
    }
    return sum;
}

static double compute_interpolated_wave_product(const double p[3], int order, int side)
{
    const double quarter = 1.57079632679489662;
    return 1.25 + 0.2 * p[2] +
           interpolate_wave(4, 0, p[0], order, side) * interpolate_wave(3, quarter, p[1], order, side);
}

/* Converts to linear light. Colours of a list are interpolated in sRGB before (docs/colour.md). */
static double convert_srgb_to_linear(double v)
{
    return v <= 0.04045 ? v / 12.92 : pow((v + 0.055) / 1.055, 2.4);
}

static double interpolate_opacity(const transfer *of, double position)
{
    int i = 0;
    while (i < of->count && of->positions[i] <= position) i++;
    if (i == 0 || i == of->count) return of->opacities[i ? i - 1 : 0];
    const double share = (position - of->positions[i - 1]) / (of->positions[i] - of->positions[i - 1]);
    return of->opacities[i - 1] + share * (of->opacities[i] - of->opacities[i - 1]);
}

/* Integrates along the ray of a pixel, from the front of the cube to its back, by the midpoint rule. With 400 steps of
 * length 0.005, results differ by less than 2e-4 from those with 4000 steps. */
static void integrate_ray(const transfer *of, field_function *field, int order, int side, int pixel, double light[3])
{
    const double size = VIEW_HEIGHT / HEIGHT;
    double point[3] = {(pixel % WIDTH + 0.5 - WIDTH / 2.0) * size, (HEIGHT / 2.0 - pixel / WIDTH - 0.5) * size, 0};
    double transmittance = 1;
    for (int c = 0; c < 3; c++) light[c] = 0;
    if (fabs(point[0]) > 1 || fabs(point[1]) > 1) return;
    for (int step = 0; step < STEPS; step++) {
        point[2] = 1 - (step + 0.5) * 2 / STEPS;
        const double position = (field(point, order, side) - of->low) / (of->high - of->low);
        const double through = pow(1 - interpolate_opacity(of, position), 2.0 / STEPS / 0.5);
        const double along = 2 * fmin(fmax(position, 0), 1);
        const double colour[3] = {fmax(0, 1 - along), 1 - fabs(along - 1), fmax(0, along - 1)};
        for (int c = 0; c < 3; c++) light[c] += transmittance * (1 - through) * convert_srgb_to_linear(colour[c]);
        transmittance *= through;
    }
}

/* Sorts errors, and returns the largest of the best 99.9 % of them. */
static double find_largest(double *errors, int count)
{
    qsort(errors, (size_t)count, sizeof *errors, compare_doubles);
    return errors[(int64_t)count * 999 / 1000];
}

static double compute_largest_component(const float *rgba, const double light[3])
{
    double largest = 0;
    for (int c = 0; c < 3; c++) largest = fmax(largest, fabs(light[c] - (double)rgba[c]));
    return largest;
}

/* Computes, on rank 0, the largest error of a colour component of each picture in the best 99.9 % of the pixels. The
 * usual run integrates every third pixel. */
static void find_errors(caught_picture *const pictures[2], const transfer *of, field_function *field, int order,
                        int side, double out[2])
{
    static double errors[2][PIXELS];
    int count = 0;
    out[0] = out[1] = 0;
    if (own_rank != 0) return;
    for (int pixel = 0; pixel < PIXELS; pixel += test_case_count(3, 1), count++) {
        double light[3];
        integrate_ray(of, field, order, side, pixel, light);
        for (int i = 0; i < 2; i++)
            errors[i][count] = compute_largest_component(pictures[i]->rgba + 4 * (ptrdiff_t)pixel, light);
    }
    for (int i = 0; i < 2; i++) out[i] = find_largest(errors[i], count);
}

static double find_difference(const caught_picture *a, const caught_picture *b)
{
    static double errors[PIXELS];
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        errors[pixel] = 0;
        for (int c = 0; c < 3; c++)
            errors[pixel] = fmax(errors[pixel], fabs((double)(a->rgba[4 * pixel + c] - b->rgba[4 * pixel + c])));
    }
    return find_largest(errors, PIXELS);
}

/* ---- drawing ----------------------------------------------------------------------------------------------------- */

typedef struct drawn_volume {
    drawn pictures;
    int count; /* number of pieces between two nodes */
    double estimate;
} drawn_volume;

static drawn_volume draw_volume(MPI_Comm comm, const transfer *of, const char *pieces, const char *max_error,
                                const order_mesh *mesh)
{
    char scene[2048];
    snprintf(
        scene, sizeof scene,
        "%simages:\n  - name: a\n    size: [%d, %d]\n    background: [0, 0, 0, 0]\n"
        "    camera: {position: [0, 0, 5], focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: %g}\n"
        "    layers:\n      - volume: {field: f, range: [%g, %g], map: {colours: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}, "
        "opacity: %s, unit_distance: 0.5}\n"
        "    sampling: {max_error: %s}\n    outputs: [{path: a.exr, data: true}]\n",
        pieces, WIDTH, HEIGHT, VIEW_HEIGHT, of->low, of->high, of->text, max_error);
    insitu_session *session = open_session_with_mesh(comm, scene, &mesh->mesh, &mesh->field);
    drawn_volume out = {.pictures = step_and_take_pictures(session, 0)};
    const char *report = insitu_last_report(session)->pieces, *estimate = strstr(report, "pixels of volumes within ");
    sscanf(report, "mesh \"m\": %d piece", &out.count);
    if (estimate) sscanf(estimate, "pixels of volumes within %lf", &out.estimate);
    insitu_destroy(&session);
    return out;
}

typedef struct volume_case {
    order_kind kind;
    int side;
    order_function *values;
    field_function *field;
    bool is_usual; /* false: only drawn by the long test; true: by default drawn with every second transfer function */
} volume_case;

static const volume_case cases[] = {
    {{"tet 2", INSITU_QUADRATIC_TET, INSITU_ORDER_VTK, 2}, 2, order_sphere_field, compute_squared_distance, false},
    {{"tet 2", INSITU_QUADRATIC_TET, INSITU_ORDER_VTK, 2}, 6, order_sphere_field, compute_squared_distance, true},
    {{"wedge 18", INSITU_BIQUADRATIC_WEDGE, INSITU_ORDER_VTK, 2},
     3,
     order_sphere_field,
     compute_squared_distance,
     false},
    {{"hex 20", INSITU_QUADRATIC_HEX, INSITU_ORDER_VTK, 2}, 3, order_sphere_field, compute_squared_distance, true},
    {{"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2},
     4,
     compute_wave_product,
     compute_interpolated_wave_product,
     false},
    {{"hex 4", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 4},
     2,
     compute_wave_product,
     compute_interpolated_wave_product,
     false},
};

/* Checks that the error is within max_error, that the estimated error is the same on any number of ranks, and that 1
 * piece would not suffice. */
static void check_case(const volume_case *of, const transfer *with)
{
    order_mesh mesh, whole;
    order_mesh_create(&of->kind, of->side, 0, of->values, own_rank, rank_count, &mesh);
    order_mesh_create(&of->kind, of->side, 0, of->values, 0, 1, &whole);
    drawn_volume chosen = draw_volume(MPI_COMM_WORLD, with, "", "0.01", &mesh);
    drawn_volume alone = draw_volume(MPI_COMM_SELF, with, "", "0.01", &whole);
    drawn_volume one = draw_volume(MPI_COMM_WORLD, with, "finer_pieces: 1\n", "0.01", &mesh);
    caught_picture *const compared[2] = {&chosen.pictures.pictures[0], &one.pictures.pictures[0]};
    double errors[2];
    find_errors(compared, with, of->field, of->kind.order, of->side, errors);
    if (own_rank == 0)
        printf("%s, side %d, %s: %d pieces, off by %.2g, estimate %.2g; with 1 piece by %.2g, estimate %.2g\n",
               of->kind.name, of->side, with->name, chosen.count, errors[0], chosen.estimate, errors[1],
               chosen.estimate * chosen.count * chosen.count);
    everywhere(chosen.count == alone.count && chosen.estimate == alone.estimate);
    everywhere(own_rank || (errors[0] <= 0.01 && errors[1] > 0.01));
    free_picture_set(&chosen.pictures);
    free_picture_set(&alone.pictures);
    free_picture_set(&one.pictures);
    order_mesh_free(&mesh);
    order_mesh_free(&whole);
}

static void volumes_are_within_max_error(void **state)
{
    (void)state;
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++)
        for (size_t t = 0; t < sizeof transfers / sizeof *transfers; t++)
            if (test_is_long_run() || (cases[k].is_usual && (k / 2 + t) % 2 == 0)) check_case(&cases[k], &transfers[t]);
}

/* Checks bent cells, for which there is no closed form: the reference is drawn with 8 pieces, whose error is a small
 * fraction of the error with the chosen number of pieces. */
static void volumes_of_bent_cells_are_within_max_error(void **state)
{
    (void)state;
    for (int k = 0; k < (test_is_long_run() ? 3 : 1); k++) {
        const order_kind *kind = &cases[k == 0 ? 4 : k == 1 ? 0 : 2].kind;
        order_mesh mesh;
        double most = 0;
        order_mesh_create(kind, 3, 0.1, order_wave_field, own_rank, rank_count, &mesh);
        drawn_volume chosen = draw_volume(MPI_COMM_WORLD, &transfers[0], "", "0.01", &mesh);
        drawn_volume finest = draw_volume(MPI_COMM_WORLD, &transfers[0], "finer_pieces: 8\n", "0.01", &mesh);
        if (own_rank == 0) most = find_difference(&chosen.pictures.pictures[0], &finest.pictures.pictures[0]);
        if (own_rank == 0)
            printf("bent %s: %d pieces, off by %.2g, estimate %.2g\n", kind->name, chosen.count, most, chosen.estimate);
        everywhere(chosen.count > 1 && chosen.count < 8 && most <= 0.01);
        free_picture_set(&chosen.pictures);
        free_picture_set(&finest.pictures);
        order_mesh_free(&mesh);
    }
}

/* Checks that one piece is chosen for straight cells with a linear field. */
static void exact_volumes_have_one_piece(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&cases[1].kind, 2, 0, order_plane_field, own_rank, rank_count, &mesh);
    drawn_volume plain = draw_volume(MPI_COMM_WORLD, &transfers[0], "", "0.0001", &mesh);
    everywhere(plain.count == 1 && plain.estimate < 1e-6);
    free_picture_set(&plain.pictures);
    order_mesh_free(&mesh);
}

static int enter_test_group_folder(void **state)
{
    (void)state;
    return enter_test_folder("order_volumes") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(volumes_are_within_max_error),
        cmocka_unit_test(volumes_of_bent_cells_are_within_max_error),
        cmocka_unit_test(exact_volumes_have_one_piece),
    };
    return run_session_tests(argc, argv, tests, enter_test_group_folder, NULL);
}
