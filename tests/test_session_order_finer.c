/* Checks the key `finer_pieces`: cells of higher order are split into linear pieces that are finer than the nodes. On
 * straight cells with the squared distance from the origin as field, the isosurface is a sphere, and the error of
 * pictures falls by a factor of four if pieces are twice as fine. In bent cells a linear field has a plane as
 * isosurface, which every ray must meet exactly once: there are no gaps. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_effort.h"
#include "test_mesh_order.h"
#include "test_session_fixture.h"

enum { WIDTH = 96, HEIGHT = 72, PIXELS = WIDTH * HEIGHT };

#define EYE 5.0
#define VIEW_HEIGHT 2.6
#define IMAGE(name, layer)                                                                                             \
    "  - name: " name "\n    size: [96, 72]\n    background: [0, 0, 0, 0]\n"                                           \
    "    camera: {position: [0, 0, 5], focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2.6}\n"      \
    "    layers:\n      - " layer "\n    outputs: [{path: " name ".exr, data: true}]\n"
#define FINER(pieces) "finer_pieces: " pieces "\nimages:\n"
#define SPHERE IMAGE("a", "isosurface: {field: f, values: [0.5]}")
#define ALL                                                                                                            \
    IMAGE("a", "isosurface: {field: f, values: [0.1, 0.4], opacity: 0.6}")                                             \
    IMAGE("b", "slice: {field: f, planes: [{normal: [1, 2, 3]}]}")                                                     \
    IMAGE("c", "surface: {threshold: {field: f, from: -0.9}, colour_by: {field: f}, edges: {}}")                       \
    IMAGE("d", "volume: {field: f}")                                                                                   \
    IMAGE("e", "volume: {field: f}") "    sampling: {reproducible: true}\n"

/* ---- drawing ----------------------------------------------------------------------------------------------------- */

static drawn draw_mesh(const char *scene, const order_mesh *mesh)
{
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, scene, &mesh->mesh, &mesh->field);
    drawn out = step_and_take_pictures(session, 0);
    insitu_destroy(&session);
    return out;
}

/* ---- the sphere -------------------------------------------------------------------------------------------------- */

static void compute_pixel_position(int pixel, double out[2])
{
    out[0] = (pixel % WIDTH + 0.5 - WIDTH / 2.0) * VIEW_HEIGHT / HEIGHT;
    out[1] = (HEIGHT / 2.0 - pixel / WIDTH - 0.5) * VIEW_HEIGHT / HEIGHT;
}

/* Returns the root mean square of the errors of hits, measured as differences of depth from the sphere within a radius
 * of 0.6; infinity if a ray has no hit there. */
static double measure_sphere_error(const caught_picture *picture)
{
    double sum = 0;
    int count = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        double at[2];
        compute_pixel_position(pixel, at);
        const double square = at[0] * at[0] + at[1] * at[1];
        if (square > 0.36) continue;
        sum += pow((double)picture->depth[pixel] - (EYE - sqrt(0.5 - square)), 2);
        count++;
    }
    return sqrt(sum / count);
}

/* Returns the largest distance between a hit's unit normal and that of the sphere. */
static double measure_normal_error(const caught_picture *picture)
{
    double worst = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        double at[3], square = 0;
        compute_pixel_position(pixel, at);
        if (at[0] * at[0] + at[1] * at[1] > 0.25) continue;
        at[2] = EYE - (double)picture->depth[pixel];
        for (int a = 0; a < 3; a++)
            square += pow((double)picture->data[a * PIXELS + pixel] - at[a] / sqrt(order_sphere_field(at)), 2);
        worst = fmax(worst, sqrt(square));
    }
    return worst;
}

static double draw_sphere(const char *scene, const order_mesh *mesh, double *normals)
{
    drawn pictures = draw_mesh(scene, mesh);
    double errors[2] = {0, 0};
    if (own_rank == 0) errors[0] = measure_sphere_error(&pictures.pictures[0]);
    if (own_rank == 0) errors[1] = measure_normal_error(&pictures.pictures[0]);
    MPI_Bcast(errors, 2, MPI_DOUBLE, 0, MPI_COMM_WORLD);
    free_picture_set(&pictures);
    *normals = errors[1];
    return errors[0];
}

/* Draws with 1, 2 and 4 pieces between nodes. The error of linear pieces follows from second differences, which fall by
 * four if pieces are twice as fine. The measured factor varies a little, because the position of pieces relative to the
 * surface changes. The tolerance of normals is derived in test_session_order_normals.c. */
static void check_sphere(const char *name, const order_mesh *mesh)
{
    static const char *const scenes[] = {FINER("1") SPHERE, FINER("2") SPHERE, FINER("4") SPHERE};
    double errors[3], normals[3];
    for (int i = 0; i < 3; i++) errors[i] = draw_sphere(scenes[i], mesh, &normals[i]);
    if (own_rank == 0)
        printf("%s: off by %.2g, %.2g, %.2g, normals by %.2g\n", name, errors[0], errors[1], errors[2], normals[2]);
    everywhere(errors[0] / errors[1] > 3.4 && errors[1] / errors[2] > 3.4 && errors[0] / errors[2] > 13);
    /* normals in pyramids are not checked, because they are those of the linear pieces */
    everywhere(strstr(name, "pyramid") || (normals[1] < 2e-5 && normals[2] < 2e-5));
}

static void error_falls_with_the_square(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh mesh;
        if (order_kinds[k].order == 1) continue;
        order_mesh_create(&order_kinds[k], 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
        check_sphere(order_kinds[k].name, &mesh);
        order_mesh_free(&mesh);
    }
}

static const order_kind hex_4 = {"hex 4", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 4};
static const order_kind hex_20 = {"hex 20", INSITU_QUADRATIC_HEX, INSITU_ORDER_VTK, 2};

/* Checks that nodes at Gauss-Lobatto points are recognised. If they were taken as equispaced, the surface would be
 * wrong for any number of pieces. */
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
    check_sphere("hex 4, Gauss-Lobatto", &mesh);
    order_mesh_free(&mesh);
}

/* A field that exceeds its values at nodes: nodes are at -1, 0 and 1, where the field is at most -0.25, but between 0
 * and 1 it reaches 0. */
static double compute_ridge_field(const double p[3])
{
    return -(p[0] - 0.5) * (p[0] - 0.5);
}

static void surfaces_between_nodes_are_drawn(void **state)
{
    (void)state;
    const char *scenes[] = {FINER("1") IMAGE("a", "isosurface: {field: f, values: [-0.06]}"),
                            FINER("8") IMAGE("a", "isosurface: {field: f, values: [-0.06]}")};
    const order_kind kind = {"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
    for (int i = 0; i < 2; i++) {
        order_mesh mesh;
        int hits = 0;
        order_mesh_create(&kind, 1, 0, compute_ridge_field, own_rank, rank_count, &mesh);
        for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.values[v] -= 0.05 * mesh.coordinates[3 * v + 2];
        drawn pictures = draw_mesh(scenes[i], &mesh);
        for (int pixel = 0; pixel < PIXELS && own_rank == 0; pixel++)
            hits += isfinite((double)pictures.pictures[0].depth[pixel]);
        everywhere(own_rank || (i == 0 ? hits == 0 : hits > 0));
        free_picture_set(&pictures);
        order_mesh_free(&mesh);
    }
}

/* ---- no gaps ----------------------------------------------------------------------------------------------------- */

/* An orthographic view of the cube. From the front, some rays are within faces and along edges of straight pieces,
 * which are 1/8 wide if 4 pieces are between two nodes of quadratic cells. In the oblique view rays cross faces and
 * edges. */
typedef struct gap_view {
    int size; /* width and height of the picture in pixels */
    double pixel, forward[3], right[3], above[3];
} gap_view;

static gap_view make_view(bool is_oblique)
{
    const int half =
        /* number of pixels between the middle of the picture, which is a pixel's centre, and a face of the cube */
        test_case_count(32, 128);
    gap_view out = {2 * half + 9, 1. / half, {0, 0, -1}, {1, 0, 0}, {0, 1, 0}};
    if (!is_oblique) return out;
    const double length = hypot(3, 12);
    memcpy(out.forward, (const double[]){-3. / 13, -4. / 13, -12. / 13}, sizeof out.forward);
    memcpy(out.right, (const double[]){12 / length, 0, -3 / length}, sizeof out.right);
    for (int a = 0; a < 3; a++) {
        const int b = (a + 1) % 3, c = (a + 2) % 3;
        out.above[a] = out.right[b] * out.forward[c] - out.right[c] * out.forward[b];
    }
    return out;
}

/* The plane's position is such that no ray meets an edge of a straight piece at the plane. On such a ray the intervals
 * of several tets can begin or end within the rounding error of the hit (test_chords.c), so that the hit is found in
 * each of them. */
#define HEIGHT_OF_PLANE 0.1037
#define HALF_PLANE "isosurface: {field: f, values: [0.1037], opacity: 0.5}"
#define HALF_SLICE "slice: {field: f, planes: [{normal: [0.3, 0.2, 1], point: [0, 0, 0.1037]}], opacity: 0.5}"
#define HALF_SURFACE "surface: {colour: [1, 1, 1], opacity: 0.5}"
#define MEDIUM "volume: {field: f, opacity: [[0, 0.5], [1, 0.5]], unit_distance: 1}"

/* Draws one picture of each layer, with 4 pieces between two nodes. */
static drawn draw_layers(const gap_view *view, const char *const *layers, int count, const order_mesh *mesh)
{
    char scene[4096];
    const double *f = view->forward;
    int at = snprintf(scene, sizeof scene, FINER("4"));
    for (int i = 0; i < count; i++)
        at += snprintf(scene + at, sizeof scene - (size_t)at,
                       "  - name: a%d\n    size: [%d, %d]\n    background: [0, 0, 0, 0]\n"
                       "    camera: {position: [%.17g, %.17g, %.17g], focal: [0, 0, 0], up: [0, 1, 0],\n"
                       "      projection: orthographic, height: %.17g}\n"
                       "    layers:\n      - %s\n    outputs: [{path: a%d.exr}]\n",
                       i, view->size, view->size, -EYE * f[0], -EYE * f[1], -EYE * f[2], view->size * view->pixel,
                       layers[i], i);
    return draw_mesh(scene, mesh);
}

/* The part of a ray that is inside a cube. */
typedef struct cube_chord {
    double base[3], length; /* base: the intersection of the ray with the plane through the origin that faces the eye */
} cube_chord;

static cube_chord find_chord(const gap_view *view, int pixel, double half)
{
    const double x = (pixel % view->size + 0.5 - view->size / 2.0) * view->pixel;
    const double y = (view->size / 2.0 - pixel / view->size - 0.5) * view->pixel;
    cube_chord out;
    double in = -INFINITY, end = INFINITY;
    for (int a = 0; a < 3; a++) {
        const double slope = view->forward[a], b = out.base[a] = x * view->right[a] + y * view->above[a];
        if (slope == 0 && fabs(b) >= half) end = -INFINITY;
        if (slope == 0) continue;
        in = fmax(in, fmin((-half - b) / slope, (half - b) / slope));
        end = fmin(end, fmax((-half - b) / slope, (half - b) / slope));
    }
    out.length = fmax(end - in, 0);
    return out;
}

/* rays: number of rays; left_out: number of rays at the border of the cube, which are not checked; wrong: number of
 * wrong rays. */
typedef struct gap_tally {
    int64_t rays, left_out, wrong;
    double worst; /* largest difference between the depth of a volume and the length of the ray in the cube */
} gap_tally;

/* Width of the border in which rays are not checked. Positions are floats up to 1, rounded by 3e-8 each, so that the
 * position of the cube's border is uncertain. */
static const double border = 1e-6;

/* Checks that a ray which meets the plane inside the cube loses half of its light, once. */
static void check_plane(const gap_view *view, const caught_picture *picture, int pixel, gap_tally *t)
{
    const cube_chord chord = find_chord(view, pixel, 1);
    const double *f = view->forward, *b = chord.base;
    const double s = (HEIGHT_OF_PLANE - 0.3 * b[0] - 0.2 * b[1] - b[2]) / (0.3 * f[0] + 0.2 * f[1] + f[2]);
    double most = 0;
    for (int a = 0; a < 3; a++) most = fmax(most, fabs(b[a] + s * f[a]));
    const bool is_at_border = fabs(most - 1) < border;
    t->rays++;
    t->left_out += is_at_border;
    t->wrong += !is_at_border && picture->rgba[4 * pixel + 3] != (most < 1 ? 0.5f : 0);
}

/* Checks that the cube's surface halves the light of a ray that meets the cube twice. */
static void check_surface(const gap_view *view, const caught_picture *picture, int pixel, gap_tally *t)
{
    const bool is_in = find_chord(view, pixel, 1 - border).length > 0;
    const bool is_at_border = is_in != (find_chord(view, pixel, 1 + border).length > 0);
    t->rays++;
    t->left_out += is_at_border;
    t->wrong += !is_at_border && picture->rgba[4 * pixel + 3] != (is_in ? 0.75f : 0);
}

/* Checks the medium: a ray of length L in it loses 1 - 2^-L of its light. The product over at most 100 pieces is
 * rounded by 6e-8 twice for each piece, and the lengths by as much. Together this is 1.8e-5 of the remaining light, or
 * a length of 2.6e-5. */
static void check_medium(const gap_view *view, const caught_picture *picture, int pixel, gap_tally *t)
{
    const double most = find_chord(view, pixel, 1 + border).length, least = find_chord(view, pixel, 1 - border).length;
    const double left = 1 - (double)picture->rgba[4 * pixel + 3], depth = -log2(left);
    const double off = fmax(fmax(least - depth, depth - most), 0);
    t->rays++;
    t->worst = fmax(t->worst, off);
    t->wrong += !(off < 2.6e-5);
}

typedef void check_pixel(const gap_view *view, const caught_picture *picture, int pixel, gap_tally *t);

/* Checks all layers in two groups: for isosurfaces and slices alone, only the pieces that they cross are made; beside
 * surfaces and volumes all pieces are made. */
static void check_gaps(const char *name, const order_mesh *mesh, gap_tally tallies[3])
{
    static const char *const layers[] = {HALF_PLANE, HALF_SLICE, HALF_PLANE, HALF_SLICE, HALF_SURFACE, MEDIUM};
    static check_pixel *const checks[] = {check_plane, check_plane,   check_plane,
                                          check_plane, check_surface, check_medium};
    for (int is_oblique = 0; is_oblique < 2; is_oblique++) {
        const gap_view view = make_view(is_oblique);
        drawn all[2] = {draw_layers(&view, layers, 2, mesh), draw_layers(&view, layers + 2, 4, mesh)};
        for (int i = 0; i < 6 && own_rank == 0; i++) {
            const caught_picture *picture = i < 2 ? &all[0].pictures[i] : &all[1].pictures[i - 2];
            gap_tally *t = &tallies[i < 4 ? 0 : i - 3];
            const int64_t before = t->wrong;
            for (int pixel = 0; pixel < view.size * view.size; pixel++) checks[i](&view, picture, pixel, t);
            if (t->wrong > before)
                fprintf(stderr, "%s, %s: %lld rays of \"%s\" are wrong\n", name, is_oblique ? "oblique" : "front",
                        (long long)(t->wrong - before), layers[i]);
        }
        free_picture_set(&all[0]);
        free_picture_set(&all[1]);
    }
}

/* Adds the cells in those columns of cubes along z whose number is odd (parity 1) or even (parity 0). */
static void add_cells_of_columns(const order_mesh *of, int cells_of_cube, int parity, order_mesh *out,
                                 unsigned char *types, int64_t *offsets)
{
    for (int64_t cell = 0; cell < of->cell_count; cell++) {
        const int64_t cube = (cell * rank_count + own_rank) / cells_of_cube;
        if ((cube % 2 + cube / 2 % 2) % 2 != parity) continue;
        for (int n = 0; n < of->nodes; n++)
            out->connectivity[offsets[out->cell_count] + n] =
                out->vertex_count + of->connectivity[cell * of->nodes + n];
        types[out->cell_count++] = (unsigned char)of->mesh.cell_type;
        offsets[out->cell_count] = offsets[out->cell_count - 1] + of->nodes;
    }
    memcpy(out->coordinates + 3 * out->vertex_count, of->coordinates, (size_t)of->vertex_count * 3 * sizeof(double));
    memcpy(out->values + out->vertex_count, of->values, (size_t)of->vertex_count * sizeof(double));
    out->vertex_count += of->vertex_count;
}

/* Checks a mesh in which columns of hexes of 27 nodes and of wedges of 18 nodes alternate. */
static void check_mixed_gaps(double bend, gap_tally tallies[3])
{
    enum { MOST = 64 };
    const order_kind hex = {"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
    const order_kind wedge = {"wedge 18", INSITU_BIQUADRATIC_WEDGE, INSITU_ORDER_VTK, 2};
    order_mesh hexes, wedges, out;
    unsigned char types[MOST];
    int64_t offsets[MOST + 1] = {0};
    order_mesh_create(&hex, 2, bend, order_plane_field, own_rank, rank_count, &hexes);
    order_mesh_create(&wedge, 2, bend, order_plane_field, own_rank, rank_count, &wedges);
    out = (order_mesh){.mesh = hexes.mesh, .field = hexes.field};
    out.coordinates = malloc((size_t)(hexes.vertex_count + wedges.vertex_count + 1) * 3 * sizeof(double));
    out.values = malloc((size_t)(hexes.vertex_count + wedges.vertex_count + 1) * sizeof(double));
    out.connectivity = malloc(MOST * 27 * sizeof *out.connectivity);
    add_cells_of_columns(&hexes, 1, 0, &out, types, offsets);
    add_cells_of_columns(&wedges, 2, 1, &out, types, offsets);
    insitu_mesh_interleaved(&out.mesh, out.coordinates, INSITU_FLOAT64);
    out.mesh.vertex_count = out.field.count = out.vertex_count;
    out.mesh.cell_count = out.cell_count;
    out.mesh.cell_types = (insitu_array){types, INSITU_UINT8, 0};
    out.mesh.offsets = (insitu_array){offsets, INSITU_INT64, 0};
    out.mesh.connectivity = (insitu_array){out.connectivity, INSITU_INT64, 0};
    out.mesh.connectivity_count = offsets[out.cell_count];
    out.field.values = (insitu_array){out.values, INSITU_FLOAT64, 0};
    check_gaps("hex 27 and wedge 18", &out, tallies);
    order_mesh_free(&hexes);
    order_mesh_free(&wedges);
    order_mesh_free(&out);
}

static bool is_default_gap_kind(const char *name)
{
    static const char *const names[] = {"tet 10", "hex 20", "hex 27", "wedge 18", "pyramid 13"};
    bool is_one = false;
    for (int i = 0; i < 5; i++) is_one = is_one || strcmp(name, names[i]) == 0;
    return is_one;
}

/* Checks that every ray crosses the plane, the cube's surface and all of the medium exactly once: between pieces there
 * are no gaps, and no piece is crossed twice. */
static void rays_cross_pieces_once(void **state)
{
    (void)state;
    gap_tally all[3] = {{0}};
    for (int bent = 0; bent < 2; bent++) {
        for (int k = 0; k < order_kind_count; k++) {
            order_mesh mesh;
            if (!test_is_long_run() && !is_default_gap_kind(order_kinds[k].name)) continue;
            order_mesh_create(&order_kinds[k], 2, bent * 0.07, order_plane_field, own_rank, rank_count, &mesh);
            check_gaps(order_kinds[k].name, &mesh, all);
            order_mesh_free(&mesh);
        }
        check_mixed_gaps(bent * 0.07, all);
    }
    if (own_rank == 0)
        printf("%lld rays of planes, %lld of surfaces and %lld of volumes, of which %lld, %lld and 0 at the border are "
               "left "
               "out: %lld, %lld and %lld wrong; the depth of volumes is off by %.2g at most\n",
               (long long)all[0].rays, (long long)all[1].rays, (long long)all[2].rays, (long long)all[0].left_out,
               (long long)all[1].left_out, (long long)all[0].wrong, (long long)all[1].wrong, (long long)all[2].wrong,
               all[2].worst);
    everywhere(all[0].wrong == 0 && all[1].wrong == 0 && all[2].wrong == 0);
    everywhere(30 * all[0].left_out <= all[0].rays && 30 * all[1].left_out <= all[1].rays);
}

/* ---- other inputs ------------------------------------------------------------------------------------------------ */

static void linear_meshes_are_not_affected(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_HEXES, 5, TEST_RANDOM, own_rank, rank_count);
    caught_picture plain = draw_scene(MPI_COMM_WORLD, write_scene("images:\n" SPHERE), &in);
    caught_picture finer = draw_scene(MPI_COMM_WORLD, write_scene(FINER("4") SPHERE), &in);
    everywhere(own_rank || are_same_pictures(&plain, &finer));
    free_caught(&plain);
    free_caught(&finer);
    input_free(&in);
}

/* Checks that vertex ids, an index of values, and a value at each corner of each cell do not change the pictures if
 * they give the same values. */
static void other_descriptions_draw_the_same(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0.07, order_wave_field, own_rank, rank_count, &mesh);
    const int64_t entries = mesh.cell_count * mesh.nodes;
    int64_t *ids = malloc(((size_t)mesh.vertex_count + 1) * sizeof *ids);
    double *corners = malloc(((size_t)entries + 1) * sizeof *corners);
    for (int64_t v = 0; v < mesh.vertex_count; v++) ids[v] = v;
    for (int64_t i = 0; i < entries; i++) corners[i] = mesh.values[mesh.connectivity[i]];
    drawn plain = draw_mesh(FINER("2") ALL, &mesh);
    for (int other = 0; other < 3; other++) {
        order_mesh changed = mesh;
        const insitu_array list = {ids, INSITU_INT64, 0};
        if (other == 0) changed.mesh.vertex_ids = list;
        if (other == 1) changed.field.index = list;
        if (other == 2) changed.field.centring = INSITU_CORNER;
        if (other == 2) changed.field.count = entries;
        if (other == 2) changed.field.values = (insitu_array){corners, INSITU_FLOAT64, 0};
        drawn pictures = draw_mesh(FINER("2") ALL, &changed);
        everywhere(own_rank || are_same_picture_sets(&plain, &pictures));
        free_picture_set(&pictures);
    }
    free_picture_set(&plain);
    order_mesh_free(&mesh);
    free(ids);
    free(corners);
}

static void out_of_range_index_is_reported(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0, order_wave_field, own_rank, rank_count, &mesh);
    int64_t *index = malloc((size_t)mesh.vertex_count * sizeof *index);
    for (int64_t v = 0; v < mesh.vertex_count; v++) index[v] = v;
    index[3] = mesh.vertex_count;
    mesh.field.index = (insitu_array){index, INSITU_INT64, 0};
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, FINER("2") SPHERE, &mesh.mesh, &mesh.field);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_FIELD, "field \"f\"",
                              "the index of vertex 3");
    insitu_destroy(&session);
    order_mesh_free(&mesh);
    free(index);
}

static void cells_are_counted_as_the_caller_gave_them(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0.05, order_wave_field, own_rank, rank_count, &mesh);
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, FINER("3") SPHERE, &mesh.mesh, &mesh.field);
    drawn pictures = step_and_take_pictures(session, 0);
    const insitu_report *report = insitu_last_report(session);
    everywhere(report->cells == mesh.cell_count && report->cells_inverted == 0 && report->cells_flat == 0);
    everywhere(mesh.cell_count == 0 || strstr(report->copied_why, "with 3 pieces between two nodes") != NULL);
    free_picture_set(&pictures);
    insitu_destroy(&session);
    order_mesh_free(&mesh);
}

/* Checks that offsets and types do not change the pictures, whether all types are the same, or every second cell is
 * declared as a hex of 27 nodes. */
static void mixed_cells_draw_the_same(void **state)
{
    (void)state;
    const order_kind kind = {"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
    order_mesh mesh;
    order_mesh_create(&kind, 2, 0.07, order_wave_field, own_rank, rank_count, &mesh);
    drawn plain = draw_mesh(FINER("3") ALL, &mesh);
    int64_t offsets[65];
    unsigned char types[64];
    for (int64_t cell = 0; cell < mesh.cell_count; cell++)
        types[cell] = (unsigned char)(cell % 2 ? INSITU_LAGRANGE_HEX : INSITU_TRIQUADRATIC_HEX);
    for (int64_t cell = 0; cell <= mesh.cell_count; cell++) offsets[cell] = cell * mesh.nodes;
    mesh.mesh.offsets = (insitu_array){offsets, INSITU_INT64, 0};
    mesh.mesh.cell_types = (insitu_array){types, INSITU_UINT8, 0};
    drawn mixed = draw_mesh(FINER("3") ALL, &mesh);
    everywhere(own_rank || are_same_picture_sets(&plain, &mixed));
    free_picture_set(&plain);
    free_picture_set(&mixed);
    order_mesh_free(&mesh);
}

/* Declares every second hex of 27 nodes as a linear hex with the same corners. */
static void make_linear_cells(order_mesh *mesh, int64_t *offsets, unsigned char *types)
{
    int64_t count = 0;
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        const int64_t first = cell * mesh->nodes, nodes = cell % 2 ? 8 : mesh->nodes;
        types[cell] = (unsigned char)(cell % 2 ? INSITU_HEX : INSITU_TRIQUADRATIC_HEX);
        offsets[cell] = count;
        memmove(mesh->connectivity + count, mesh->connectivity + first, (size_t)nodes * sizeof *mesh->connectivity);
        count += nodes;
    }
    offsets[mesh->cell_count] = count;
    mesh->mesh.connectivity_count = count;
    mesh->mesh.offsets = (insitu_array){offsets, INSITU_INT64, 0};
    mesh->mesh.cell_types = (insitu_array){types, INSITU_UINT8, 0};
}

/* Checks that the common face of two neighbours is not an outer face if their orders differ. The surface is
 * transparent, so that each further face on a ray would change the opacity by 0.25 at least. The cells are straight, so
 * that colours differ only by rounding errors of normals. */
static void faces_between_orders_are_not_outer(void **state)
{
    (void)state;
#define CLEAR IMAGE("a", "surface: {colour: [1, 1, 1], opacity: 0.5}")
    const order_kind kind = {"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
    order_mesh mesh;
    int64_t offsets[65];
    unsigned char types[64];
    for (int pieces = 1; pieces <= 2; pieces++) {
        const char *scene = pieces == 1 ? FINER("1") CLEAR : FINER("2") CLEAR;
        order_mesh_create(&kind, 2, 0, order_wave_field, own_rank, rank_count, &mesh);
        drawn plain = draw_mesh(scene, &mesh);
        make_linear_cells(&mesh, offsets, types);
        drawn mixed = draw_mesh(scene, &mesh);
        everywhere(own_rank || largest_colour_difference(&plain.pictures[0], &mixed.pictures[0]) <= 1e-4);
        free_picture_set(&plain);
        free_picture_set(&mixed);
        order_mesh_free(&mesh);
    }
}

/* ---- cells that are not shown ------------------------------------------------------------------------------------ */

/* Images that need few cells: a small sphere in the middle, and a plane through a corner. */
#define FEW                                                                                                            \
    IMAGE("a", "isosurface: {field: f, values: [0.05]}")                                                               \
    IMAGE("b", "slice: {field: f, planes: [{point: [0.8, 0.9, 0.9], normal: [1, 2, 3]}]}")

/* One more image, for which all cells must be refined. */
#define WHOLE IMAGE("z", "volume: {field: f}")

static drawn draw_and_count_bytes(const char *scene, const order_mesh *mesh, int64_t *bytes)
{
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, scene, &mesh->mesh, &mesh->field);
    drawn out = step_and_take_pictures(session, 0);
    *bytes = insitu_last_report(session)->bytes_copied;
    MPI_Allreduce(MPI_IN_PLACE, bytes, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    insitu_destroy(&session);
    return out;
}

/* Checks that cells in which nothing is drawn are not refined. The scene with only the isosurface and the slice is
 * compared with the same scene and a volume, for which all cells are refined. Hit positions must be bit-identical.
 * Normals may differ where a refined and an unrefined cell share a node, because the mean gradient at that node does
 * not include that of the unrefined cell. */
static void other_cells_are_not_refined(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        const order_kind *kind = &order_kinds[k];
        order_mesh mesh;
        int64_t bytes[2];
        if (kind->order == 1 || kind->order > 3) continue;
        order_mesh_create(kind, 4, 0.05, order_sphere_field, own_rank, rank_count, &mesh);
        drawn few = draw_and_count_bytes(FINER("4") FEW, &mesh, &bytes[0]);
        drawn all = draw_and_count_bytes(FINER("4") FEW WHOLE, &mesh, &bytes[1]);
        bool are_same = true;
        int hits[2] = {0, 0};
        for (int i = 0; i < 2 && own_rank == 0; i++)
            for (int pixel = 0; pixel < PIXELS; pixel++) {
                const float a = few.pictures[i].depth[pixel], b = all.pictures[i].depth[pixel];
                are_same = are_same && memcmp(&a, &b, sizeof a) == 0;
                hits[i] += isfinite((double)a);
            }
        if (own_rank == 0)
            printf("%s: %.1f instead of %.1f MiB; %d and %d hits\n", kind->name, (double)bytes[0] / 1048576,
                   (double)bytes[1] / 1048576, hits[0], hits[1]);
        everywhere(own_rank || (are_same && hits[0] > 20 && hits[1] > 20));
        everywhere(bytes[0] < bytes[1] / 3);
        free_picture_set(&few);
        free_picture_set(&all);
        order_mesh_free(&mesh);
    }
}

/* Returns the number of pieces that all ranks make. */
static int64_t count_pieces(const char *scene, const order_mesh *mesh)
{
    long long count = 0;
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, scene, &mesh->mesh, &mesh->field);
    drawn pictures = step_and_take_pictures(session, 0);
    const char *end = strstr(insitu_last_report(session)->copied_why, " linear pieces of its cells");
    while (end && end > insitu_last_report(session)->copied_why && end[-1] >= '0' && end[-1] <= '9') end--;
    if (end) sscanf(end, "%lld", &count);
    free_picture_set(&pictures);
    insitu_destroy(&session);
    int64_t all = count;
    MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    return all;
}

/* Checks that only the pieces that a surface crosses are made. The sphere and the plane cross all 8 cubes. With 8
 * pieces between two nodes, a cube has 4096 hexes, of which a plane crosses some 400; 27 more are made at the nodes.
 * With twice as many pieces between nodes there would be 8 times as many hexes. */
static void pieces_that_nothing_crosses_are_not_made(void **state)
{
    (void)state;
#define BOTH                                                                                                           \
    IMAGE("a", "isosurface: {field: f, values: [0.5]}")                                                                \
    IMAGE("b", "slice: {field: f, planes: [{normal: [1, 2, 3]}]}")
    order_mesh mesh;
    order_mesh_create(&(order_kind){"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2}, 2, 0.05,
                      order_sphere_field, own_rank, rank_count, &mesh);
    const int64_t four = count_pieces(FINER("4") BOTH, &mesh), eight = count_pieces(FINER("8") BOTH, &mesh);
    const int64_t all = count_pieces(FINER("8") BOTH WHOLE, &mesh);
    if (own_rank == 0)
        printf("%lld pieces, twice as fine %lld, all %lld\n", (long long)four, (long long)eight, (long long)all);
    everywhere(all == 8 * 4096 && eight < all / 4 && eight < 5 * four);
    order_mesh_free(&mesh);
}

/* An outer surface shows only pieces on outer faces. With a volume, all pieces of all cells are made, and the surface
 * has the same picture, including the normals of bent faces, the colours and the edges. */
static void surfaces_are_made_of_pieces_on_outer_faces(void **state)
{
    (void)state;
#define SURFACE                                                                                                        \
    IMAGE("a", "surface: {colour_by: {field: f, range: [0, 1]}, edges: {}}")                                           \
    IMAGE("b", "isosurface: {field: f, values: [0.05]}")
    for (int k = 0; k < order_kind_count; k++) {
        const order_kind *kind = &order_kinds[k];
        order_mesh mesh;
        if (kind->order == 1 || kind->order > 3) continue;
        order_mesh_create(kind, 4, 0.05, order_sphere_field, own_rank, rank_count, &mesh);
        drawn outer = draw_mesh(FINER("4") SURFACE, &mesh), all = draw_mesh(FINER("4") SURFACE WHOLE, &mesh);
        everywhere(own_rank || are_same_pictures(&outer.pictures[0], &all.pictures[0]));
        const int64_t few = count_pieces(FINER("4") SURFACE, &mesh), every = count_pieces(FINER("4") WHOLE, &mesh);
        if (own_rank == 0) printf("%s: %lld of %lld pieces\n", kind->name, (long long)few, (long long)every);
        everywhere(few > 0 && few < every / 2);
        free_picture_set(&outer);
        free_picture_set(&all);
        order_mesh_free(&mesh);
    }
}

/* ---- changes ----------------------------------------------------------------------------------------------------- */

enum { VALUES, NODES, SCENE, COARSE, CHANGES };

/* Checks that after a change the session draws the same pictures as a new session. */
static void check_change(int change)
{
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0.05, order_wave_field, own_rank, rank_count, &mesh);
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, FINER("2") ALL, &mesh.mesh, &mesh.field);
    drawn first = step_and_take_pictures(session, 0);
    const char *scene = change == SCENE ? FINER("3") ALL : change == COARSE ? FINER("1") ALL : FINER("2") ALL;
    for (int64_t v = 0; v < mesh.vertex_count && change == VALUES; v++) mesh.values[v] *= 0.9;
    for (int64_t i = 0; i < 3 * mesh.vertex_count && change == NODES; i++) mesh.coordinates[i] *= 0.8;
    if (change == NODES) mesh.mesh.changed = INSITU_CHANGED_GEOMETRY;
    if (change == NODES) assert_int_equal(insitu_set_mesh(session, "m", &mesh.mesh), INSITU_OK);
    if (change == VALUES) assert_int_equal(insitu_set_field(session, "m", &mesh.field), INSITU_OK);
    if (change >= SCENE) write_scene(scene);
    drawn pictures = step_and_take_pictures(session, 1), fresh = draw_mesh(scene, &mesh);
    if (own_rank == 0 && !are_same_picture_sets(&pictures, &fresh)) fprintf(stderr, "change %d is not drawn\n", change);
    everywhere(own_rank || (are_same_picture_sets(&pictures, &fresh) && !are_same_picture_sets(&pictures, &first)));
    free_picture_set(&first);
    free_picture_set(&pictures);
    free_picture_set(&fresh);
    insitu_destroy(&session);
    order_mesh_free(&mesh);
}

static void changes_are_drawn(void **state)
{
    (void)state;
    for (int change = 0; change < CHANGES; change++) check_change(change);
}

/* ---- limits ------------------------------------------------------------------------------------------------------ */

static void check_warning(const order_kind *kind, const char *scene, const char *as, const char *words)
{
    order_mesh mesh;
    order_mesh_create(kind, 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, scene, &mesh.mesh, &mesh.field);
    drawn pictures = step_and_take_pictures(session, 0);
    everywhere(strstr(insitu_last_report(session)->warnings, words) != NULL);
    insitu_destroy(&session);
    drawn expected = draw_mesh(as, &mesh);
    everywhere(own_rank || are_same_picture_sets(&pictures, &expected));
    free_picture_set(&pictures);
    free_picture_set(&expected);
    order_mesh_free(&mesh);
}

static void exceeded_limits_are_reported(void **state)
{
    (void)state;
    const order_kind pyramid = {"pyramid 7", INSITU_LAGRANGE_PYRAMID, INSITU_ORDER_LEXICOGRAPHIC, 7};
    const order_kind hex_5 = {"hex 5", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 5};
    check_warning(&pyramid, FINER("2") SPHERE, "images:\n" SPHERE, "of its cells are pyramids of an order above 6");
    check_warning(&hex_5, FINER("8") SPHERE, FINER("6") SPHERE, "finer_pieces is 6 on it instead of 8");
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(error_falls_with_the_square),
        cmocka_unit_test(lobatto_points_are_recognised),
        cmocka_unit_test(surfaces_between_nodes_are_drawn),
        cmocka_unit_test(rays_cross_pieces_once),
        cmocka_unit_test(linear_meshes_are_not_affected),
        cmocka_unit_test(other_descriptions_draw_the_same),
        cmocka_unit_test(out_of_range_index_is_reported),
        cmocka_unit_test(cells_are_counted_as_the_caller_gave_them),
        cmocka_unit_test(mixed_cells_draw_the_same),
        cmocka_unit_test(faces_between_orders_are_not_outer),
        cmocka_unit_test(other_cells_are_not_refined),
        cmocka_unit_test(pieces_that_nothing_crosses_are_not_made),
        cmocka_unit_test(surfaces_are_made_of_pieces_on_outer_faces),
        cmocka_unit_test(changes_are_drawn),
        cmocka_unit_test(exceeded_limits_are_reported),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
