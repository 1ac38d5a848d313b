/* Checks concave polygons, as shells and as faces of polyhedra, in the layer `surface`. Coverage, depth, value,
 * shading, edges and clips are compared with closed forms. With any distribution of cells the picture is bit-identical
 * to that of one rank. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colour_map.h"
#include "session.h"
#include "test_session_fixture.h"

enum { SIZE = 240, PIXELS = SIZE * SIZE, TILES = 9, MOST_CORNERS = 64, MOST_ENTRIES = 512 };

/* A pixel is 1/100 wide; the camera looks along z from z = 5. */
#define IMAGE(more, layer)                                                                                             \
    "images:\n  - name: a\n    size: [240, 240]\n    background: [0, 0, 0, 0]\n    camera: {position: [0, 0, 5], "     \
    "focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2.4}\n" more                                   \
    "    layers:\n      - surface: {" layer "}\n    outputs: [{path: a.exr}]\n"
#define UNLIT "material: {ambient: 1, diffuse: 0, specular: 0}"
#define BY_FIELD "colour_by: {field: f, map: grey, range: [-2, 2]}, " UNLIT

static void compute_pixel_position(int pixel, double out[2])
{
    out[0] = (pixel % SIZE + 0.5) / 100 - 1.2;
    out[1] = 1.2 - (pixel / SIZE + 0.5) / 100;
}

/* ---- shells --------------------------------------------------------------------------------------------------- */

typedef struct tile {
    unsigned char type;
    int count;
    double corners[MOST_CORNERS][2];
} tile;

static void add_corner(tile *t, double x, double y)
{
    t->corners[t->count][0] = x;
    t->corners[t->count++][1] = y;
}

static void make_comb(tile *t)
{
    for (int i = 0; i < 6; i++) {
        add_corner(t, i / 6., 0.3);
        add_corner(t, (i + 0.5) / 6, 1 - 0.05 * (i % 3));
    }
    add_corner(t, 1, 0.3);
    for (int i = 6; i >= 0; i--) add_corner(t, i / 6., 0); /* collinear corners */
}

static void make_star(tile *t)
{
    for (int i = 0; i < 40; i++) {
        const double angle = 2 * acos(-1) * i / 40, radius = i % 2 ? 0.5 : 0.15 + 0.1 * test_uniform((uint64_t)i, 3);
        add_corner(t, 0.5 + radius * cos(angle), 0.5 + radius * sin(angle));
    }
}

/* Makes polygons in the unit square: convex ones, concave ones, one with a hole that a double edge (bridge) connects to
 * its outline, and ones with repeated corners. */
static void make_tiles(tile tiles[TILES])
{
    static const double u[8][2] = {{0, 0}, {1, 0}, {1, 1}, {0.67, 1}, {0.67, 0.33}, {0.33, 0.33}, {0.33, 1}, {0, 1}};
    static const double dart[4][2] = {{0, 0}, {1, 0.1}, {0.25, 0.3}, {0.1, 1}};
    static const double ring[10][2] = {{0, 0},       {1, 0},       {1, 1},       {0, 1},       {0, 0},
                                       {0.25, 0.25}, {0.25, 0.75}, {0.75, 0.75}, {0.75, 0.25}, {0.25, 0.25}};
    static const double untidy[11][2] = {{0, 0},     {0.5, 0},   {1, 0},   {1, 0}, {1, 0.5}, {0.75, 0.5},
                                         {0.5, 0.5}, {0.5, 0.5}, {0.5, 1}, {0, 1}, {0, 0.5}};
    static const double convex[5][2] = {{0.5, 0}, {1, 0.4}, {0.8, 1}, {0.2, 1}, {0, 0.4}};
    memset(tiles, 0, TILES * sizeof *tiles);
    for (int i = 0; i < TILES; i++) tiles[i].type = INSITU_POLYGON;
    tiles[1].type = INSITU_QUAD;
    for (int i = 0; i < 8; i++) add_corner(&tiles[0], u[i][0], u[i][1]);
    for (int i = 0; i < 4; i++) add_corner(&tiles[1], dart[i][0], dart[i][1]);
    for (int i = 0; i < 4; i++) add_corner(&tiles[2], dart[(i + 1) % 4][1], dart[(i + 1) % 4][0]);
    make_comb(&tiles[3]);
    for (int i = 0; i < 10; i++) add_corner(&tiles[4], ring[i][0], ring[i][1]);
    for (int i = 0; i < 11; i++) add_corner(&tiles[5], untidy[i][0], untidy[i][1]);
    make_star(&tiles[6]);
    for (int i = 0; i < 5; i++) add_corner(&tiles[7], convex[i][0], convex[i][1]);
    for (int i = 7; i >= 0; i--) add_corner(&tiles[8], u[i][1], 1 - u[i][0]);
    for (int i = 0; i < TILES; i++)
        for (int k = 0; k < tiles[i].count; k++) {
            tiles[i].corners[k][0] = 0.7 * tiles[i].corners[k][0] + 0.75 * (i % 3) - 1.1;
            tiles[i].corners[k][1] = 0.7 * tiles[i].corners[k][1] + 0.75 * (i / 3) - 1.1;
        }
}

typedef struct shells {
    int vertex_count, cell_count;
    double coordinates[MOST_ENTRIES][3], values[MOST_ENTRIES];
    int connectivity[MOST_ENTRIES], offsets[TILES + 1];
    unsigned char types[TILES];
} shells;

/* Makes the rank's polygons, on the plane z = 0.3 x + 0.2 y. The corner with which each polygon begins depends on the
 * rank. */
static void make_shells(const tile tiles[TILES], int rank, int ranks, shells *out)
{
    *out = (shells){0};
    for (int i = 0; i < TILES; i++) {
        const tile *t = &tiles[i];
        if (i % ranks != rank) continue;
        out->types[out->cell_count] = t->type;
        for (int k = 0; k < t->count; k++) {
            const double *from = t->corners[(k + rank) % t->count];
            double *place = out->coordinates[out->vertex_count];
            place[0] = from[0];
            place[1] = from[1];
            place[2] = 0.3 * from[0] + 0.2 * from[1];
            out->values[out->vertex_count] = test_linear_field(place);
            out->connectivity[out->vertex_count] = out->vertex_count;
            out->vertex_count++;
        }
        out->offsets[++out->cell_count] = out->vertex_count;
    }
}

static caught_picture draw_shells(MPI_Comm comm, const char *scene, const shells *s)
{
    insitu_session *session = open_session(comm, scene);
    insitu_mesh mesh;
    insitu_field field;
    discard_pictures();
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = s->vertex_count;
    insitu_mesh_interleaved(&mesh, s->coordinates, INSITU_FLOAT64);
    mesh.cell_count = s->cell_count;
    mesh.connectivity_count = s->vertex_count;
    mesh.connectivity = (insitu_array){s->connectivity, INSITU_INT32, 0};
    mesh.cell_types = (insitu_array){s->types, INSITU_UINT8, 0};
    mesh.offsets = (insitu_array){s->offsets, INSITU_INT32, 0};
    insitu_field_defaults(&field);
    field.name = "f";
    field.count = s->vertex_count;
    field.values = (insitu_array){s->values, INSITU_FLOAT64, 0};
    assert_int_equal(insitu_set_mesh(session, "m", &mesh), INSITU_OK);
    assert_int_equal(insitu_set_field(session, "m", &field), INSITU_OK);
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    assert_int_equal(status, INSITU_OK);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

/* ---- the expected pictures ------------------------------------------------------------------------------------ */

/* Returns how often the polygon's outline winds around the point; lowers *distance to the point's distance from the
 * outline. */
static int compute_winding_number(const tile *t, const double at[2], double *distance)
{
    int turns = 0;
    for (int i = 0; i < t->count; i++) {
        const double *a = t->corners[i], *b = t->corners[(i + 1) % t->count];
        const double x = b[0] - a[0], y = b[1] - a[1], square = x * x + y * y;
        const double along = square > 0 ? ((at[0] - a[0]) * x + (at[1] - a[1]) * y) / square : 0;
        const double s = fmin(fmax(along, 0), 1);
        *distance = fmin(*distance, hypot(a[0] + s * x - at[0], a[1] + s * y - at[1]));
        if ((a[1] <= at[1]) == (b[1] <= at[1])) continue;
        if ((x * (at[1] - a[1]) - (at[0] - a[0]) * y > 0) == (y > 0)) turns += y > 0 ? 1 : -1;
    }
    return turns;
}

typedef struct truth {
    bool is_hit;
    double margin; /* distance from the nearest edge */
    double depth, value;
} truth;

static truth compute_expected_pixel(const tile tiles[TILES], int pixel)
{
    truth out = {.margin = INFINITY};
    double at[3];
    compute_pixel_position(pixel, at);
    at[2] = 0.3 * at[0] + 0.2 * at[1];
    for (int i = 0; i < TILES; i++) out.is_hit = compute_winding_number(&tiles[i], at, &out.margin) != 0 || out.is_hit;
    out.depth = 5 - at[2];
    out.value = test_linear_field(at);
    return out;
}

typedef bool verify_function(const truth *t, const double at[2], const float *rgba, float depth);

/* Checks depths and colours. The tolerances are derived in test_session_surfaces.c. */
static bool has_exact_depth_and_colour(const truth *t, const double at[2], const float *rgba, float depth)
{
    (void)at;
    if (t->margin < 1e-5) return true;
    const double grey = (double)colour_linear_from_srgb((float)((t->value + 2) / 4));
    if (!t->is_hit) return rgba[3] == 0;
    return rgba[3] == 1 && fabs((double)depth - t->depth) < 1.5e-5 && fabs((double)rgba[0] - grey) < 1e-4;
}

/* Checks shading: a plane seen along one direction has the same brightness everywhere, except for a few units in the
 * last place due to the rounding of normals. */
static bool is_lit(const truth *t, const double at[2], const float *rgba, float depth)
{
    static float first;
    (void)at;
    (void)depth;
    if (t->margin < 1e-5 || !t->is_hit) return true;
    if (first == 0) first = rgba[0];
    return rgba[0] > 0.1f && fabsf(rgba[0] - first) < 1e-5f;
}

/* Checks black lines that are three pixels wide on the polygons' edges: inside polygons all other pixels must be
 * white. */
static bool has_lines_on_edges(const truth *t, const double at[2], const float *rgba, float depth)
{
    (void)at;
    (void)depth;
    if (!t->is_hit || t->margin < 1e-5) return true;
    if (t->margin < 0.008) return rgba[0] < 0.3f;
    return t->margin < 0.022 || rgba[0] == 1;
}

static bool is_clipped(const truth *t, const double at[2], const float *rgba, float depth)
{
    const double side = at[0] + 0.5 * at[1];
    if (fabs(side) < 1e-5) return true;
    const truth cut = {t->is_hit && side < 0, t->margin, t->depth, t->value};
    return has_exact_depth_and_colour(&cut, at, rgba, depth);
}

static bool is_correct(const tile tiles[TILES], const caught_picture *picture, verify_function *verify,
                       const char *what)
{
    int hits = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const truth t = compute_expected_pixel(tiles, pixel);
        const float *rgba = picture->rgba + 4 * (ptrdiff_t)pixel;
        double at[2];
        compute_pixel_position(pixel, at);
        hits += rgba[3] > 0;
        if (verify(&t, at, rgba, picture->depth[pixel])) continue;
        fprintf(stderr, "%s: (%g, %g): opacity %g, grey %g, depth %g; hit %d, %g from an edge, depth %g\n", what, at[0],
                at[1], (double)rgba[3], (double)rgba[0], (double)picture->depth[pixel], t.is_hit, t.margin, t.depth);
        return false;
    }
    return hits > PIXELS / 10;
}

static bool are_same_pictures_but_edges(const caught_picture *a, const caught_picture *b, const char *what)
{
    if (are_same_pictures(a, b)) return true;
    for (int pixel = 0, reported = 0; pixel < PIXELS && reported < 5; pixel++) {
        double at[2];
        compute_pixel_position(pixel, at);
        if (memcmp(a->rgba + 4 * (ptrdiff_t)pixel, b->rgba + 4 * (ptrdiff_t)pixel, 4 * sizeof(float)) == 0 &&
            a->depth[pixel] == b->depth[pixel])
            continue;
        reported++;
        fprintf(stderr, "%s: (%g, %g): %.9g, %.9g on ranks, %.9g, %.9g on one\n", what, at[0], at[1],
                (double)a->rgba[4 * pixel], (double)a->depth[pixel], (double)b->rgba[4 * pixel],
                (double)b->depth[pixel]);
    }
    return false;
}

static void concave_shells_match_their_outline(void **state)
{
    (void)state;
    static const struct {
        const char *what, *scene;
        verify_function *verify;
    } cases[] = {
        {"values", IMAGE("", BY_FIELD), has_exact_depth_and_colour},
        {"light", IMAGE("", "colour: [1, 1, 1]"), is_lit},
        {"edges", IMAGE("", "colour: [1, 1, 1], edges: {width: 3, colour: [0, 0, 0]}, " UNLIT), has_lines_on_edges},
        {"clip", IMAGE("    clip: {planes: [{point: [0, 0, 0], normal: [1, 0.5, 0]}]}\n", BY_FIELD), is_clipped},
    };
    static tile tiles[TILES];
    static shells whole, part;
    make_tiles(tiles);
    make_shells(tiles, 0, 1, &whole);
    make_shells(tiles, own_rank, rank_count, &part);
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *scene = write_scene(cases[i].scene);
        caught_picture ours = draw_shells(MPI_COMM_WORLD, scene, &part), alone = {0};
        bool is_good = true;
        if (own_rank == 0) {
            alone = draw_shells(MPI_COMM_SELF, scene, &whole);
            is_good = is_correct(tiles, &alone, cases[i].verify, cases[i].what) &&
                      are_same_pictures_but_edges(&ours, &alone, cases[i].what);
        }
        everywhere(is_good);
        free_caught(&ours);
        free_caught(&alone);
    }
}

/* ---- polyhedra ------------------------------------------------------------------------------------------------ */

/* Checks upright prisms from z = -0.4 to z = 0.45 whose top is shifted by 0.1 along y. The visible top must have the
 * outline of its polygon, and nothing may be nearer than the top. */
static void tops_of_concave_prisms_match_their_outline(void **state)
{
    (void)state;
    const char *scene = write_scene(IMAGE("", BY_FIELD));
    for (int shape = TEST_L_PRISM; shape <= TEST_U_PRISM; shape++)
        for (uint64_t turn = 0; turn < 4; turn++) {
            session_input in = {0};
            tile top = {0};
            test_mesh_make_polyhedron((test_polyhedron_shape)shape, test_linear_field, &in.part);
            const int around = (int)in.part.vertex_count / 2;
            for (int i = 0; i < around; i++)
                add_corner(&top, in.part.coordinates[3 * (around + i)], in.part.coordinates[3 * (around + i) + 1]);
            if (turn) test_mesh_reorder_vertices(&in.part, turn);
            input_describe(&in);
            bool is_good = true;
            if (own_rank == 0) {
                insitu_session *session = open_session_and_draw(MPI_COMM_SELF, scene, &in);
                caught_picture picture = pop_caught_picture();
                for (int pixel = 0; pixel < PIXELS && is_good; pixel++) {
                    double at[3] = {0, 0, 0.45}, margin = INFINITY;
                    compute_pixel_position(pixel, at);
                    const bool is_top = compute_winding_number(&top, at, &margin) != 0;
                    const float *rgba = picture.rgba + 4 * (ptrdiff_t)pixel;
                    const double depth = (double)picture.depth[pixel];
                    const double grey = (double)colour_linear_from_srgb((float)((test_linear_field(at) + 2) / 4));
                    if (margin < 1e-3) continue;
                    is_good = is_top
                                  ? rgba[3] == 1 && fabs(depth - 4.55) < 1.5e-5 && fabs((double)rgba[0] - grey) < 1e-4
                                  : rgba[3] == 0 || depth > 4.5502;
                    if (!is_good)
                        fprintf(stderr, "shape %d, turn %d: (%g, %g): depth %g, opacity %g\n", shape, (int)turn, at[0],
                                at[1], depth, (double)rgba[3]);
                }
                free_caught(&picture);
                insitu_destroy(&session);
            }
            everywhere(is_good);
            input_free(&in);
        }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(concave_shells_match_their_outline),
                                       cmocka_unit_test(tops_of_concave_prisms_match_their_outline)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
