/* Checks the key `surface_error`: cells of higher order are split into linear pieces, whose number follows from an
 * allowed error in pixels. On straight cells with the squared distance from the origin as field, the isosurface is a
 * sphere. No hit may be farther from the sphere than the error bound that the report states; rays that pass inside the
 * sphere by more than the bound must have hits, and rays that miss it by more must have none. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_effort.h"
#include "test_mesh_order.h"
#include "test_session_fixture.h"

enum { WIDTH = 384, HEIGHT = 288, PIXELS = WIDTH * HEIGHT };

#define EYE 5.0
#define VIEW_HEIGHT 2.6
#define PIXEL (VIEW_HEIGHT / HEIGHT)
#define FRONT "{position: [0, 0, 5], focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2.6}"
#define IMAGE(name, size, camera, layer)                                                                               \
    "  - name: " name "\n    size: " size "\n    background: [0, 0, 0, 0]\n    camera: " camera                        \
    "\n    layers:\n      - " layer "\n    outputs: [{path: \"" name ".exr\", data: true}]\n"
#define SMALL(layer) IMAGE("a", "[96, 72]", FRONT, layer)
#define ISO(value) "isosurface: {field: f, values: [" value "]}"
#define SPHERE IMAGE("a", "[384, 288]", FRONT, ISO("0.5"))
#define ALL                                                                                                            \
    IMAGE("a", "[96, 72]", FRONT, "isosurface: {field: f, values: [0.1, 0.4], opacity: 0.6}")                          \
    IMAGE("b", "[96, 72]", "automatic", "slice: {field: f, planes: [{normal: [1, 2, 3]}]}")                            \
    IMAGE("c{view}", "[96, 72]", "{orbit: {views: 2}}", ISO("0.2"))
#define WITHIN(error) "surface_error: " error "\nimages:\n"
#define FINER(pieces) "finer_pieces: " pieces "\nimages:\n"

static bool is_measured(const order_kind *kind)
{
    return kind->order > 1;
}

static bool has_other_layout(const order_kind *kind)
{
    return strstr(kind->name, "gmsh") || strstr(kind->name, "exodus") || strstr(kind->name, "old");
}

static const order_kind hex_27 = {"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
static const order_kind hex_20 = {"hex 20", INSITU_QUADRATIC_HEX, INSITU_ORDER_VTK, 2};
static const order_kind hex_4 = {"hex 4", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 4};

/* ---- drawing ----------------------------------------------------------------------------------------------------- */

/* The pictures of a step, and what its report states: text about pieces, and warnings. */
typedef struct drawn_report {
    drawn pictures;
    char pieces[512], warnings[2048];
    int count;    /* number of pieces between two nodes */
    double bound; /* bound of the error in pixels; infinite if the report states none */
} drawn_report;

static drawn_report step_and_report(insitu_session *session, int cycle)
{
    drawn_report out = {.pictures = step_and_take_pictures(session, cycle), .bound = INFINITY};
    const insitu_report *report = insitu_last_report(session);
    snprintf(out.pieces, sizeof out.pieces, "%s", report->pieces);
    snprintf(out.warnings, sizeof out.warnings, "%s", report->warnings);
    sscanf(out.pieces, "mesh \"m\": %d piece", &out.count);
    const char *bound = strstr(out.pieces, "within ");
    if (bound) sscanf(bound, "within %lf", &out.bound);
    return out;
}

static drawn_report draw_and_report(MPI_Comm comm, const char *scene, const order_mesh *mesh)
{
    insitu_session *session = open_session_with_mesh(comm, scene, &mesh->mesh, &mesh->field);
    drawn_report out = step_and_report(session, 0);
    insitu_destroy(&session);
    return out;
}

/* Draws the mesh; returns only the report, without pictures. */
static drawn_report draw_and_report_pieces(const char *scene, const order_mesh *mesh)
{
    drawn_report out = draw_and_report(MPI_COMM_WORLD, scene, mesh);
    free_picture_set(&out.pictures);
    return out;
}

/* Returns whether, on rank 0, the pictures equal those that are drawn with a fixed number of pieces. */
static bool is_drawn_as(const drawn_report *of, int count, const char *images, const order_mesh *mesh)
{
    char scene[4096];
    snprintf(scene, sizeof scene, "finer_pieces: %d\nimages:\n%s", count, images);
    drawn_report fixed = draw_and_report(MPI_COMM_WORLD, scene, mesh);
    const bool is_same = own_rank != 0 || are_same_picture_sets(&of->pictures, &fixed.pictures);
    free_picture_set(&fixed.pictures);
    return is_same;
}

/* ---- the sphere -------------------------------------------------------------------------------------------------- */

/* How the hits of a picture compare with the sphere. Distances are in pixels. */
typedef struct sphere_hits {
    double farthest; /* largest distance of a hit from the sphere */
    /* missed: number of rays without a hit that pass inside the sphere by more than the bound; beyond: number of rays
     * with a hit that pass outside it by more than the bound */
    int missed, beyond;
} sphere_hits;

static sphere_hits measure_sphere_hits(const caught_picture *picture, double bound)
{
    sphere_hits out = {0, 0, 0};
    const double radius = sqrt(0.5);
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const double x = (pixel % WIDTH + 0.5 - WIDTH / 2.0) * PIXEL, y = (HEIGHT / 2.0 - pixel / WIDTH - 0.5) * PIXEL;
        const double depth = (double)picture->depth[pixel], place[3] = {x, y, EYE - depth}, off = hypot(x, y);
        if (isfinite(depth)) out.farthest = fmax(out.farthest, fabs(sqrt(order_sphere_field(place)) - radius) / PIXEL);
        out.missed += !isfinite(depth) && off < radius - bound * PIXEL;
        out.beyond += isfinite(depth) && off > radius + bound * PIXEL;
    }
    return out;
}

/* Compares the hits with the sphere. Another 1e-4 of a pixel is allowed because depths are floats up to 5, rounded by
 * 2.4e-7, which is 3e-5 of a pixel. */
static void check_sphere(const char *name, const order_mesh *mesh, double allowed)
{
    char scene[1024];
    snprintf(scene, sizeof scene, "surface_error: %g\nimages:\n%s", allowed, SPHERE);
    drawn_report of = draw_and_report(MPI_COMM_WORLD, scene, mesh);
    const double bound = of.bound + 1e-4;
    sphere_hits hits = {0, 0, 0};
    if (own_rank == 0) hits = measure_sphere_hits(&of.pictures.pictures[0], bound);
    if (own_rank == 0) printf("%s: %s; the farthest hit by %.3f\n", name, of.pieces, hits.farthest);
    everywhere(of.bound <= allowed && of.count > 1 && strstr(of.pieces, ", of which 0 have no bound") != NULL);
    everywhere(hits.farthest <= bound && hits.missed == 0 && hits.beyond == 0);
    free_picture_set(&of.pictures);
}

static void spheres_are_within_the_stated_error(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh mesh;
        if (!is_measured(&order_kinds[k]) || (!test_is_long_run() && has_other_layout(&order_kinds[k]))) continue;
        order_mesh_create(&order_kinds[k], order_kinds[k].order > 2 ? 2 : 4, 0, order_sphere_field, own_rank,
                          rank_count, &mesh);
        check_sphere(order_kinds[k].name, &mesh, 0.5);
        order_mesh_free(&mesh);
    }
}

static void lobatto_points_are_recognised(void **state)
{
    (void)state;
    const double of4[5] = {0, 0.5 - 0.5 * sqrt(3. / 7), 0.5, 0.5 + 0.5 * sqrt(3. / 7), 1};
    order_mesh mesh;
    order_mesh_create(&hex_4, 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
    for (int64_t i = 0; i < 3 * mesh.vertex_count; i++) {
        const int at = (int)lround((mesh.coordinates[i] + 1) * 4);
        mesh.coordinates[i] = at / 4 - 1 + of4[at % 4];
    }
    for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.values[v] = order_sphere_field(mesh.coordinates + 3 * v);
    check_sphere("hex 4, Gauss-Lobatto", &mesh, 0.5);
    order_mesh_free(&mesh);
}

/* ---- bent cells -------------------------------------------------------------------------------------------------- */

/* Values of the polynomials of a hex of order 2 at one point: position and field, and their derivatives along the three
 * reference axes. */
typedef struct hex_values {
    double value[4], slopes[3][4];
} hex_values;

static hex_values evaluate_hex(const order_mesh *mesh, int64_t cell, const double at[3])
{
    hex_values out = {{0}, {{0}}};
    double weights[3][3], derived[3][3];
    for (int a = 0; a < 3; a++) {
        const double x = at[a];
        memcpy(weights[a], (const double[]){(2 * x - 1) * (x - 1), 4 * x * (1 - x), x * (2 * x - 1)}, 3 * sizeof x);
        memcpy(derived[a], (const double[]){4 * x - 3, 4 - 8 * x, 4 * x - 1}, 3 * sizeof x);
    }
    for (int n = 0; n < 27; n++) {
        const int i[3] = {n % 3, n / 3 % 3, n / 9};
        const int64_t vertex = mesh->connectivity[27 * cell + n];
        for (int f = 0; f < 4; f++) {
            const double node = f < 3 ? mesh->coordinates[3 * vertex + f] : mesh->values[vertex];
            out.value[f] += weights[0][i[0]] * weights[1][i[1]] * weights[2][i[2]] * node;
            out.slopes[0][f] += derived[0][i[0]] * weights[1][i[1]] * weights[2][i[2]] * node;
            out.slopes[1][f] += weights[0][i[0]] * derived[1][i[1]] * weights[2][i[2]] * node;
            out.slopes[2][f] += weights[0][i[0]] * weights[1][i[1]] * derived[2][i[2]] * node;
        }
    }
    return out;
}

/* Computes the step in reference coordinates that moves the position by `shift` in space, to first order. */
static void solve_for_shift(const hex_values *of, const double shift[3], double out[3])
{
    double dual[3][3], determinant = 0;
    for (int a = 0; a < 3; a++)
        for (int x = 0; x < 3; x++) {
            const double *b = of->slopes[(a + 1) % 3], *c = of->slopes[(a + 2) % 3];
            dual[a][x] = b[(x + 1) % 3] * c[(x + 2) % 3] - b[(x + 2) % 3] * c[(x + 1) % 3];
        }
    for (int x = 0; x < 3; x++) determinant += of->slopes[0][x] * dual[0][x];
    for (int a = 0; a < 3; a++)
        out[a] = (dual[a][0] * shift[0] + dual[a][1] * shift[1] + dual[a][2] * shift[2]) / determinant;
}

/* Finds the reference coordinates of a position by Newton's method. Returns false if the position is neither in the
 * cell nor near it. */
static bool find_in_cell(const order_mesh *mesh, int64_t cell, const double place[3], double at[3])
{
    for (int a = 0; a < 3; a++) at[a] = 0.5;
    for (int turn = 0; turn < 30; turn++) {
        const hex_values of = evaluate_hex(mesh, cell, at);
        double shift[3], way[3];
        for (int x = 0; x < 3; x++) shift[x] = place[x] - of.value[x];
        solve_for_shift(&of, shift, way);
        for (int a = 0; a < 3; a++) at[a] += way[a];
    }
    bool is_in = true;
    for (int a = 0; a < 3; a++) is_in = is_in && at[a] > -0.05 && at[a] < 1.05;
    return is_in;
}

/* Returns the distance in pixels of a position from the isosurface of the polynomial, along the gradient. */
static double compute_distance_from_isosurface(const order_mesh *mesh, double isovalue, const double place[3])
{
    double nearest = INFINITY;
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        double at[3];
        if (!find_in_cell(mesh, cell, place, at)) continue;
        hex_values of = evaluate_hex(mesh, cell, at);
        for (int turn = 0; turn < 30; turn++, of = evaluate_hex(mesh, cell, at)) {
            double gradient[3] = {0}, shift[3], way[3], square = 0;
            /* the step in reference coordinates for a unit step along each axis of space, and the change of the field
             * over it */
            for (int x = 0; x < 3; x++) {
                const double unit[3] = {x == 0, x == 1, x == 2};
                solve_for_shift(&of, unit, way);
                for (int a = 0; a < 3; a++) gradient[x] += of.slopes[a][3] * way[a];
            }
            for (int x = 0; x < 3; x++) square += gradient[x] * gradient[x];
            for (int x = 0; x < 3; x++) shift[x] = gradient[x] * (isovalue - of.value[3]) / square;
            solve_for_shift(&of, shift, way);
            for (int a = 0; a < 3; a++) at[a] += way[a];
        }
        const double d[3] = {of.value[0] - place[0], of.value[1] - place[1], of.value[2] - place[2]};
        if (fabs(of.value[3] - isovalue) < 1e-9) nearest = fmin(nearest, sqrt(order_sphere_field(d)) / PIXEL);
    }
    return nearest;
}

/* Checks bent cells. The distance is that from the nearest surface of any cell, because a position on the border of two
 * cells may be nearer to the surface of the other cell, which continues there. */
static void bent_cells_are_within_the_stated_error(void **state)
{
    (void)state;
    const order_kind kind = {"hex 2", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 2};
    order_mesh part, whole;
    order_mesh_create(&kind, 3, 0.1, order_wave_field, own_rank, rank_count, &part);
    order_mesh_create(&kind, 3, 0.1, order_wave_field, 0, 1, &whole);
    drawn_report of = draw_and_report(MPI_COMM_WORLD, WITHIN("0.5") IMAGE("a", "[384, 288]", FRONT, ISO("0.2")), &part);
    double farthest = 0;
    int hits = 0;
    for (int pixel = 0; pixel < PIXELS && own_rank == 0; pixel += test_case_count(7, 1)) {
        const double depth = (double)of.pictures.pictures[0].depth[pixel];
        if (!isfinite(depth)) continue;
        const double place[3] = {(pixel % WIDTH + 0.5 - WIDTH / 2.0) * PIXEL,
                                 (HEIGHT / 2.0 - pixel / WIDTH - 0.5) * PIXEL, EYE - depth};
        farthest = fmax(farthest, compute_distance_from_isosurface(&whole, 0.2, place));
        hits++;
    }
    if (own_rank == 0) printf("bent hexes: %s; the farthest of %d hits by %.3f\n", of.pieces, hits, farthest);
    everywhere(of.count > 1 && of.bound <= 0.5);
    everywhere(own_rank || (hits > 1000 && farthest <= of.bound + 1e-4));
    free_picture_set(&of.pictures);
    order_mesh_free(&part);
    order_mesh_free(&whole);
}

/* ---- the number of pieces ---------------------------------------------------------------------------------------- */

/* Checks the number of pieces. It is larger near the camera, where a pixel covers less of the surface, and about twice
 * as large for a quarter of the error. It is 1 if no camera sees the isosurface, or if no cell has it. */
static void pieces_follow_the_error_and_the_camera(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&hex_27, 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
    const char *near = "{position: [0, 0, 2.5], focal: [0, 0, 0], up: [0, 1, 0]}";
    const char *far = "{position: [0, 0, 10], focal: [0, 0, 0], up: [0, 1, 0]}";
    char scene[2][1024];
    for (int i = 0; i < 2; i++)
        snprintf(scene[i], sizeof scene[i], WITHIN("1") IMAGE("a", "[96, 72]", "%s", ISO("0.5")), i ? far : near);
    const drawn_report coarse = draw_and_report_pieces(WITHIN("2") SMALL(ISO("0.5")), &mesh),
                       fine = draw_and_report_pieces(WITHIN("0.5") SMALL(ISO("0.5")), &mesh);
    const drawn_report from_near = draw_and_report_pieces(scene[0], &mesh),
                       from_far = draw_and_report_pieces(scene[1], &mesh);
    if (own_rank == 0)
        printf("%d and %d pieces by the error, %d and %d by the camera\n", coarse.count, fine.count, from_far.count,
               from_near.count);
    everywhere(fine.count > coarse.count && fine.count <= 2 * coarse.count);
    everywhere(from_near.count > from_far.count && from_near.bound <= 1 && from_far.bound <= 1);
    const char *away = "{position: [0, 0, 5], focal: [0, 0, 9], up: [0, 1, 0]}";
    snprintf(scene[0], sizeof scene[0], WITHIN("0.4") IMAGE("a", "[96, 72]", "%s", ISO("0.5")), away);
    everywhere(draw_and_report_pieces(scene[0], &mesh).count == 1); /* no camera sees the isosurface */
    everywhere(draw_and_report_pieces(WITHIN("0.4") SMALL(ISO("9")), &mesh).count == 1); /* no cell has the isovalue */
    everywhere(draw_and_report_pieces(FINER("3") SMALL(ISO("0.5")), &mesh).pieces[0] == '\0');
    order_mesh_free(&mesh);
}

static void pieces_are_drawn_as_a_fixed_number(void **state)
{
    (void)state;
    static const order_kind *const kinds[] = {&hex_27, &hex_20};
    for (int k = 0; k < 2; k++) {
        order_mesh mesh;
        order_mesh_create(kinds[k], 2, 0.05, order_wave_field, own_rank, rank_count, &mesh);
        drawn_report of = draw_and_report(MPI_COMM_WORLD, WITHIN("0.7") ALL, &mesh);
        everywhere(of.count > 1 && is_drawn_as(&of, of.count, ALL, &mesh));
        free_picture_set(&of.pictures);
        order_mesh_free(&mesh);
    }
}

/* A field that is at most -0.06 at nodes, but up to 0.05 larger between them. */
static double compute_ridge_field(const double p[3])
{
    return -(p[0] - 0.5) * (p[0] - 0.5) - 0.05 * p[2];
}

static void surfaces_between_nodes_are_found(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&hex_27, 1, 0, compute_ridge_field, own_rank, rank_count, &mesh);
    drawn_report of = draw_and_report(MPI_COMM_WORLD, WITHIN("0.25") SMALL(ISO("-0.01")), &mesh);
    int hits = 0;
    for (int pixel = 0; pixel < 96 * 72 && own_rank == 0; pixel++)
        hits += isfinite((double)of.pictures.pictures[0].depth[pixel]);
    everywhere(of.count > 2 && (own_rank || hits > 0));
    free_picture_set(&of.pictures);
    order_mesh_free(&mesh);
}

/* ---- other inputs ------------------------------------------------------------------------------------------------ */

static insitu_status fill_values(void *data, insitu_field *field)
{
    field->values = *(const insitu_array *)data;
    return INSITU_OK;
}

/* Checks that the numbers of pieces and the pictures are the same if the same values are given at corners, by an index,
 * or by a fill function. */
static void other_descriptions_have_the_same_pieces(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0.05, order_wave_field, own_rank, rank_count, &mesh);
    const int64_t entries = mesh.cell_count * mesh.nodes;
    int64_t *index = malloc(((size_t)mesh.vertex_count + 1) * sizeof *index);
    double *corners = malloc(((size_t)entries + 1) * sizeof *corners);
    for (int64_t v = 0; v < mesh.vertex_count; v++) index[v] = v;
    for (int64_t i = 0; i < entries; i++) corners[i] = mesh.values[mesh.connectivity[i]];
    const insitu_array values = mesh.field.values;
    drawn_report plain = draw_and_report(MPI_COMM_WORLD, WITHIN("1") ALL, &mesh);
    for (int other = 0; other < 3; other++) {
        order_mesh changed = mesh;
        if (other == 0) changed.field.index = (insitu_array){index, INSITU_INT64, 0};
        if (other == 1) changed.field.centring = INSITU_CORNER;
        if (other == 1) changed.field.count = entries;
        if (other == 1) changed.field.values = (insitu_array){corners, INSITU_FLOAT64, 0};
        if (other == 2) changed.field.values = (insitu_array){0};
        if (other == 2) changed.field.fill = fill_values;
        if (other == 2) changed.field.fill_data = (void *)&values;
        drawn_report of = draw_and_report(MPI_COMM_WORLD, WITHIN("1") ALL, &changed);
        if (strcmp(of.pieces, plain.pieces)) fprintf(stderr, "description %d: %s\n", other, of.pieces);
        everywhere(strcmp(of.pieces, plain.pieces) == 0 && plain.count > 1);
        everywhere(own_rank || are_same_picture_sets(&of.pictures, &plain.pictures));
        free_picture_set(&of.pictures);
    }
    free_picture_set(&plain.pictures);
    order_mesh_free(&mesh);
    free(index);
    free(corners);
}

static void fields_without_an_error_bound_are_reported(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&hex_27, 2, 0.05, order_wave_field, own_rank, rank_count, &mesh);
    const drawn_report of = draw_and_report_pieces(
        "surface_error: 0.5\nfields: {g: 2 * f}\nimages:\n" SMALL("isosurface: {field: g, values: [0.1]}"), &mesh);
    everywhere(strstr(of.warnings, "surface_error does not hold for the isosurface of \"g\" on mesh \"m\"") != NULL);
    /* the positions of the surface are bounded nevertheless */
    everywhere(of.bound <= 0.5 && !strstr(of.pieces, "cells"));
    const drawn_report plain = draw_and_report_pieces(WITHIN("0.5") SMALL(ISO("0.1")), &mesh);
    everywhere(!strstr(plain.warnings, "surface_error"));
    order_mesh_free(&mesh);
}

#define WITH_LAYER(layer) SMALL(ISO("0.1")) IMAGE("b", "[96, 72]", FRONT, layer)
#define WITH_SURFACE WITH_LAYER("surface: {colour_by: {field: f}}")
#define WITH_THRESHOLD WITH_LAYER("surface: {threshold: {field: f, from: -9}, colour_by: {field: f}}")

#define LARGE(layer) IMAGE("a", "[640, 480]", FRONT, layer)

/* Without either key, the error is at most 0.25 pixels, and less if an isosurface has few pixels. It may be larger if
 * all cells are refined, because the error of surfaces then requires at most 2 pieces. Nothing that the scene does not
 * request causes a warning. */
static void defaults_are_within_a_quarter_of_a_pixel(void **state)
{
    (void)state;
    order_mesh mesh, fine;
    order_mesh_create(&hex_27, 2, 0.05, order_wave_field, own_rank, rank_count, &mesh);
    order_mesh_create(&hex_27, 4, 0.05, order_wave_field, own_rank, rank_count, &fine);
    const drawn_report large = draw_and_report_pieces("images:\n" LARGE(ISO("0.1")), &fine),
                       large_asked = draw_and_report_pieces(WITHIN("0.25") LARGE(ISO("0.1")), &fine);
    everywhere(large.count > 2 && large.bound <= 0.25 && strcmp(large.pieces, large_asked.pieces) == 0);
    const drawn_report asked = draw_and_report_pieces(WITHIN("0.25") SMALL(ISO("0.1")), &mesh);
    drawn_report of = draw_and_report(MPI_COMM_WORLD, "images:\n" SMALL(ISO("0.1")), &mesh);
    everywhere(asked.count > 1 && of.count > asked.count && of.bound < 0.25);
    const drawn_report outer = draw_and_report_pieces("images:\n" WITH_SURFACE, &mesh),
                       all = draw_and_report_pieces("images:\n" WITH_THRESHOLD, &mesh),
                       all_asked = draw_and_report_pieces(WITHIN("0.25") WITH_THRESHOLD, &mesh);
    everywhere(outer.bound <= 0.25 && all.count == 2 && all.bound > 0.25 && all_asked.count == asked.count);
    static const char *const counting[] = {"statistics: [{field: f, path: f.csv}]\nimages:\n" SMALL(ISO("0.1")),
                                           "images:\n" SMALL(ISO("0.1")) "    when: {field: f, above: 0}\n"};
    for (int i = 0; i < 2; i++) {
        drawn_report counted = draw_and_report(MPI_COMM_WORLD, counting[i], &mesh);
        everywhere(strcmp(counted.pieces, of.pieces) == 0);
        everywhere(own_rank || are_same_picture_sets(&counted.pictures, &of.pictures));
        free_picture_set(&counted.pictures);
    }
    free_picture_set(&of.pictures);
    const drawn_report derived =
        draw_and_report_pieces("fields: {g: 2 * f}\nimages:\n" SMALL("isosurface: {field: g, values: [0.1]}"), &mesh);
    everywhere(!all.warnings[0] && !derived.warnings[0]);
    order_mesh_free(&mesh);
    order_mesh_free(&fine);
}

/* Checks that straight hexes of 20 nodes are drawn as hexes of 27 nodes with the same polynomials. There is one piece
 * between two nodes, because no isosurface needs more. The field has no terms that 20 nodes do not determine. */
static void serendipity_cells_are_completed(void **state)
{
    (void)state;
    const char *scene = "images:\n" SMALL("surface: {colour_by: {field: f}}");
    order_mesh few, many;
    order_mesh_create(&hex_20, 2, 0, order_sphere_field, own_rank, rank_count, &few);
    order_mesh_create(&hex_27, 2, 0, order_sphere_field, own_rank, rank_count, &many);
    drawn_report of = draw_and_report(MPI_COMM_WORLD, scene, &few),
                 like = draw_and_report(MPI_COMM_WORLD, scene, &many);
    everywhere(of.count == 1 && of.bound == 0 && strcmp(of.pieces, like.pieces) == 0);
    everywhere(own_rank || largest_colour_difference(&of.pictures.pictures[0], &like.pictures.pictures[0]) <= 1e-6);
    free_picture_set(&of.pictures);
    free_picture_set(&like.pictures);
    order_mesh_free(&few);
    order_mesh_free(&many);
}

static void linear_meshes_are_not_affected(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_HEXES, 5, TEST_RANDOM, own_rank, rank_count);
    caught_picture plain = draw_scene(MPI_COMM_WORLD, write_scene("images:\n" SMALL(ISO("0.5"))), &in);
    caught_picture other = draw_scene(MPI_COMM_WORLD, write_scene(WITHIN("0.1") SMALL(ISO("0.5"))), &in);
    everywhere(own_rank || are_same_pictures(&plain, &other));
    free_caught(&plain);
    free_caught(&other);
    input_free(&in);
}

static void piece_count_is_in_the_database(void **state)
{
    (void)state;
    static const char news[] = "pieces.cdb/report.json";
    static char text[8192];
    order_mesh mesh;
    order_mesh_create(&hex_27, 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
    drawn_report of =
        draw_and_report(MPI_COMM_WORLD,
                        WITHIN("1") "  - name: a\n    size: [96, 72]\n    camera: " FRONT
                                    "\n    layers: [" ISO("0.5") "]\n    outputs: [{cinema: pieces.cdb}]\n",
                        &mesh);
    read_file(news, sizeof text, text);
    const char *at = strstr(text, "\"pieces\": \"mesh \\\"m\\\": ");
    int count = 0;
    if (at) sscanf(at, "\"pieces\": \"mesh \\\"m\\\": %d pieces", &count);
    everywhere(own_rank || (count > 1 && count == of.count));
    free_picture_set(&of.pictures);
    order_mesh_free(&mesh);
}

/* ---- changes ----------------------------------------------------------------------------------------------------- */

enum { VALUES, NODES, TIGHTER, FIXED, NONE, CHANGES };

/* Checks that after a change the session makes as many pieces as a new session, and draws the same pictures. */
static void check_change(int change)
{
    static const char *const scenes[CHANGES] = {WITHIN("1") ALL, WITHIN("1") ALL, WITHIN("0.3") ALL, FINER("2") ALL,
                                                "images:\n" ALL};
    order_mesh mesh;
    order_mesh_create(&hex_27, 2, 0.05, order_wave_field, own_rank, rank_count, &mesh);
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, WITHIN("1") ALL, &mesh.mesh, &mesh.field);
    drawn_report first = step_and_report(session, 0);
    for (int64_t v = 0; v < mesh.vertex_count && change == VALUES; v++)
        mesh.values[v] = order_plane_field(mesh.coordinates + 3 * v);
    for (int64_t i = 0; i < 3 * mesh.vertex_count && change == NODES; i++) mesh.coordinates[i] *= 0.3;
    if (change == NODES) mesh.mesh.changed = INSITU_CHANGED_GEOMETRY;
    if (change == NODES) assert_int_equal(insitu_set_mesh(session, "m", &mesh.mesh), INSITU_OK);
    if (change == VALUES) assert_int_equal(insitu_set_field(session, "m", &mesh.field), INSITU_OK);
    if (change >= TIGHTER) write_scene(scenes[change]);
    drawn_report then = step_and_report(session, 1), fresh = draw_and_report(MPI_COMM_WORLD, scenes[change], &mesh);
    if (own_rank == 0) printf("change %d: %s; then %s\n", change, first.pieces, then.pieces);
    everywhere(strcmp(then.pieces, fresh.pieces) == 0 && (then.count != first.count || change == NODES));
    everywhere(own_rank || are_same_picture_sets(&then.pictures, &fresh.pictures));
    free_picture_set(&first.pictures);
    free_picture_set(&then.pictures);
    free_picture_set(&fresh.pictures);
    insitu_destroy(&session);
    order_mesh_free(&mesh);
}

static void changes_are_drawn(void **state)
{
    (void)state;
    for (int change = 0; change < CHANGES; change++) check_change(change);
}

/* ---- limits ------------------------------------------------------------------------------------------------------ */

/* Returns the memory, in MiB, of n pieces between two nodes in 8 hexes of order 2. Each hex has (2 n)^3 pieces of 36
 * bytes, and (2 n + 1)^3 nodes of 24 bytes with a value of 8 bytes. */
static double compute_piece_mebibytes(int n)
{
    return 8 * (36 * pow(2 * n, 3) + 32 * pow(2 * n + 1, 3)) / 1048576;
}

static void memory_is_limited(void **state)
{
    (void)state;
    order_mesh mesh;
    char scene[1024], words[200];
    order_mesh_create(&hex_27, 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
    const drawn_report free_told = draw_and_report_pieces(WITHIN("0.3") SMALL(ISO("0.5")), &mesh);
    everywhere(free_told.count > 2 && !strstr(free_told.warnings, "finer_memory"));
    for (int fixed = 0; fixed < 2; fixed++) {
        const int wanted = fixed ? 5 : free_told.count;
        snprintf(scene, sizeof scene, "%s\nfiner_memory: %.9g\nimages:\n" SMALL(ISO("0.5")),
                 fixed ? "finer_pieces: 5" : "surface_error: 0.3", compute_piece_mebibytes(2) * 1.000001);
        drawn_report of = draw_and_report(MPI_COMM_WORLD, scene, &mesh);
        snprintf(words, sizeof words,
                 "2 instead of %d pieces between two nodes: all finer pieces would take %.1f MiB on all ranks", wanted,
                 compute_piece_mebibytes(wanted));
        everywhere(strstr(of.warnings, words) != NULL && is_drawn_as(&of, 2, SMALL(ISO("0.5")), &mesh));
        everywhere(fixed || (of.count == 2 && of.bound > 0.3));
        free_picture_set(&of.pictures);
    }
    snprintf(scene, sizeof scene, "finer_pieces: 2\nfiner_memory: %.9g\nimages:\n" SMALL(ISO("0.5")),
             compute_piece_mebibytes(2) * 0.999999);
    everywhere(strstr(draw_and_report_pieces(scene, &mesh).warnings, "1 instead of 2 pieces between two nodes") !=
               NULL);
    order_mesh_free(&mesh);
}

static void unmet_error_bound_is_reported(void **state)
{
    (void)state;
    const order_kind pyramid = {"pyramid 7", INSITU_LAGRANGE_PYRAMID, INSITU_ORDER_LEXICOGRAPHIC, 7};
    order_mesh mesh;
    order_mesh_create(&hex_27, 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
    const drawn_report of = draw_and_report_pieces(WITHIN("0.01") SMALL(ISO("0.5")), &mesh);
    everywhere(of.count == 12 && of.bound > 0.01 && strstr(of.warnings, "12 pieces between two nodes are the most"));
    order_mesh_free(&mesh);
    order_mesh_create(&pyramid, 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
    const drawn_report pyramids = draw_and_report_pieces(WITHIN("0.01") SMALL(ISO("0.5")), &mesh);
    everywhere(strstr(pyramids.warnings, "surface_error has no effect on it") != NULL);
    order_mesh_free(&mesh);
}

static int enter_test_group_folder(void **state)
{
    (void)state;
    return enter_test_folder("order_error") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spheres_are_within_the_stated_error),
        cmocka_unit_test(lobatto_points_are_recognised),
        cmocka_unit_test(bent_cells_are_within_the_stated_error),
        cmocka_unit_test(pieces_follow_the_error_and_the_camera),
        cmocka_unit_test(pieces_are_drawn_as_a_fixed_number),
        cmocka_unit_test(surfaces_between_nodes_are_found),
        cmocka_unit_test(other_descriptions_have_the_same_pieces),
        cmocka_unit_test(fields_without_an_error_bound_are_reported),
        cmocka_unit_test(defaults_are_within_a_quarter_of_a_pixel),
        cmocka_unit_test(serendipity_cells_are_completed),
        cmocka_unit_test(linear_meshes_are_not_affected),
        cmocka_unit_test(piece_count_is_in_the_database),
        cmocka_unit_test(changes_are_drawn),
        cmocka_unit_test(memory_is_limited),
        cmocka_unit_test(unmet_error_bound_is_reported),
    };
    return run_session_tests(argc, argv, tests, enter_test_group_folder, NULL);
}
