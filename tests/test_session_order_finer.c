/* Pieces finer than the nodes (`finer_pieces`). On straight cells that contain the squared distance from the origin the
 * surface is a sphere, to which pictures come nearer by four as pieces are twice as fine. In bent cells a linear field
 * is a plane, which every ray meets: there are no gaps. All pictures are the same on any ranks. */
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

enum { VOLUME = 3 };

static drawn draw(MPI_Comm comm, const char *scene, const order_mesh *mesh)
{
    insitu_session *session = open_mesh(comm, scene, &mesh->mesh, &mesh->field);
    drawn out = step_drawn(session, 0);
    insitu_destroy(&session);
    return out;
}

/* ---- the sphere -------------------------------------------------------------------------------------------------- */

static void pixel_place(int pixel, double out[2])
{
    out[0] = (pixel % WIDTH + 0.5 - WIDTH / 2.0) * VIEW_HEIGHT / HEIGHT;
    out[1] = (HEIGHT / 2.0 - pixel / WIDTH - 0.5) * VIEW_HEIGHT / HEIGHT;
}

/* The root of the mean square of the hits' distances from the sphere, as differences of depth within a radius of 0.6;
 * infinite if a ray has no hit. */
static double sphere_error(const caught_picture *picture)
{
    double sum = 0;
    int count = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        double at[2];
        pixel_place(pixel, at);
        const double square = at[0] * at[0] + at[1] * at[1];
        if (square > 0.36) continue;
        sum += pow((double)picture->depth[pixel] - (EYE - sqrt(0.5 - square)), 2);
        count++;
    }
    return sqrt(sum / count);
}

/* The largest distance between a hit's unit normal and the sphere's. */
static double normal_error(const caught_picture *picture)
{
    double worst = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        double at[3], square = 0;
        pixel_place(pixel, at);
        if (at[0] * at[0] + at[1] * at[1] > 0.25) continue;
        at[2] = EYE - (double)picture->depth[pixel];
        for (int a = 0; a < 3; a++)
            square += pow((double)picture->data[a * PIXELS + pixel] - at[a] / sqrt(order_sphere(at)), 2);
        worst = fmax(worst, sqrt(square));
    }
    return worst;
}

static double draw_sphere(const char *scene, const order_mesh *mesh, double *normals)
{
    drawn pictures = draw(MPI_COMM_WORLD, scene, mesh);
    double errors[2] = {0, 0};
    if (own_rank == 0) errors[0] = sphere_error(&pictures.pictures[0]);
    if (own_rank == 0) errors[1] = normal_error(&pictures.pictures[0]);
    MPI_Bcast(errors, 2, MPI_DOUBLE, 0, MPI_COMM_WORLD);
    free_drawn(&pictures);
    *normals = errors[1];
    return errors[0];
}

/* Draws with 1, 2 and 4 pieces between nodes. The error of linear pieces is that of their second differences, which
 * fall by four; the factor varies by some, as pieces lie otherwise to the surface. Normals are those of
 * test_session_order_normals.c. */
static void check_sphere(const char *name, const order_mesh *mesh)
{
    static const char *const scenes[] = {FINER("1") SPHERE, FINER("2") SPHERE, FINER("4") SPHERE};
    double errors[3], normals[3];
    for (int i = 0; i < 3; i++) errors[i] = draw_sphere(scenes[i], mesh, &normals[i]);
    if (own_rank == 0)
        printf("%s: off by %.2g, %.2g, %.2g, normals by %.2g\n", name, errors[0], errors[1], errors[2], normals[2]);
    everywhere(errors[0] / errors[1] > 3.4 && errors[1] / errors[2] > 3.4 && errors[0] / errors[2] > 13);
    /* normals in pyramids are those of their pieces */
    everywhere(strstr(name, "pyramid") || (normals[1] < 2e-5 && normals[2] < 2e-5));
}

static void error_falls_with_the_square(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh mesh;
        if (order_kinds[k].order == 1) continue;
        order_mesh_create(&order_kinds[k], 2, 0, order_sphere, own_rank, rank_count, &mesh);
        check_sphere(order_kinds[k].name, &mesh);
        order_mesh_free(&mesh);
    }
}

static const order_kind hex_4 = {"hex 4", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 4};
static const order_kind hex_20 = {"hex 20", INSITU_QUADRATIC_HEX, INSITU_ORDER_VTK, 2};

/* Taken as equispaced, these nodes would give a surface that no number of pieces mends. */
static void lobatto_points_are_recognised(void **state)
{
    (void)state;
    const double of4[5] = {0, 0.5 - 0.5 * sqrt(3. / 7), 0.5, 0.5 + 0.5 * sqrt(3. / 7), 1};
    order_mesh mesh;
    order_mesh_create(&hex_4, 2, 0, order_sphere, own_rank, rank_count, &mesh);
    for (int64_t i = 0; i < 3 * mesh.vertex_count; i++) {
        const int at = (int)lround((mesh.coordinates[i] + 1) * 4);
        mesh.coordinates[i] = at / 4 - 1 + of4[at % 4];
    }
    for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.values[v] = order_sphere(mesh.coordinates + 3 * v);
    check_sphere("hex 4, Gauss-Lobatto", &mesh);
    order_mesh_free(&mesh);
}

/* The nodes of a cube are at -1, 0 and 1. The field is -0.25 at two of them and 0 between these, up to 0.05. */
static double ridge(const double p[3])
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
        order_mesh_create(&kind, 1, 0, ridge, own_rank, rank_count, &mesh);
        for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.values[v] -= 0.05 * mesh.coordinates[3 * v + 2];
        drawn pictures = draw(MPI_COMM_WORLD, scenes[i], &mesh);
        for (int pixel = 0; pixel < PIXELS && own_rank == 0; pixel++)
            hits += isfinite((double)pictures.pictures[0].depth[pixel]);
        everywhere(own_rank || (i == 0 ? hits == 0 : hits > 0));
        free_drawn(&pictures);
        order_mesh_free(&mesh);
    }
}

/* ---- no gaps ----------------------------------------------------------------------------------------------------- */

/* Depths are floats of up to 5, and so are places. */
static void every_ray_meets_a_plane(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh mesh;

        order_mesh_create(&order_kinds[k], 2, 0.07, order_plane, own_rank, rank_count, &mesh);
        drawn pictures = draw(MPI_COMM_WORLD, FINER("3") IMAGE("a", "isosurface: {field: f, values: [0.1]}"), &mesh);
        int wrong = 0;
        for (int pixel = 0; pixel < PIXELS && own_rank == 0; pixel++) {
            double at[2];
            pixel_place(pixel, at);
            if (fabs(at[0]) > 0.85 || fabs(at[1]) > 0.85) continue;
            const double depth = EYE - (0.1 - 0.3 * at[0] - 0.2 * at[1]);
            wrong += !(fabs((double)pictures.pictures[0].depth[pixel] - depth) < 1e-5);
        }
        if (wrong) fprintf(stderr, "%s: %d rays do not meet the plane\n", order_kinds[k].name, wrong);
        everywhere(wrong == 0);
        free_drawn(&pictures);
        order_mesh_free(&mesh);
    }
}

/* Surfaces and reproducible volumes have the same bits. Other volumes are blended in float, each rank's part first. */
static void pictures_are_the_same_on_any_ranks(void **state)
{
    (void)state;
    bool are_all_same = true;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh part, whole;
        order_mesh_create(&order_kinds[k], 2, 0.07, order_wavy, own_rank, rank_count, &part);
        order_mesh_create(&order_kinds[k], 2, 0.07, order_wavy, 0, 1, &whole);
        drawn all = draw(MPI_COMM_WORLD, FINER("3") ALL, &part), alone = draw(MPI_COMM_SELF, FINER("3") ALL, &whole);
        for (int i = 0; i < all.count && own_rank == 0; i++) {
            const caught_picture *one = &all.pictures[i], *other = &alone.pictures[i];
            const bool is_same = i == VOLUME ? colour_difference(one, other) <= 1e-6 : same_pictures(one, other);
            if (!is_same) fprintf(stderr, "%s: picture %d depends on ranks\n", order_kinds[k].name, i);
            are_all_same = are_all_same && is_same;
        }
        free_drawn(&all);
        free_drawn(&alone);
        order_mesh_free(&part);
        order_mesh_free(&whole);
    }
    everywhere(are_all_same);
}

/* ---- other inputs ------------------------------------------------------------------------------------------------ */

static void linear_meshes_are_not_affected(void **state)
{
    (void)state;
    session_input in;
    input_create(&in, TEST_HEXES, 5, TEST_RANDOM, own_rank, rank_count);
    caught_picture plain = draw_scene(MPI_COMM_WORLD, write_scene("images:\n" SPHERE), &in);
    caught_picture finer = draw_scene(MPI_COMM_WORLD, write_scene(FINER("4") SPHERE), &in);
    everywhere(own_rank || same_pictures(&plain, &finer));
    free_caught(&plain);
    free_caught(&finer);
    input_free(&in);
}

/* Vertex ids, an index, and a value at each corner of each cell change nothing if they say the same. */
static void other_descriptions_draw_the_same(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0.07, order_wavy, own_rank, rank_count, &mesh);
    const int64_t entries = mesh.cell_count * mesh.nodes;
    int64_t *ids = malloc(((size_t)mesh.vertex_count + 1) * sizeof *ids);
    double *corners = malloc(((size_t)entries + 1) * sizeof *corners);
    for (int64_t v = 0; v < mesh.vertex_count; v++) ids[v] = v;
    for (int64_t i = 0; i < entries; i++) corners[i] = mesh.values[mesh.connectivity[i]];
    drawn plain = draw(MPI_COMM_WORLD, FINER("2") ALL, &mesh);
    for (int other = 0; other < 3; other++) {
        order_mesh changed = mesh;
        const insitu_array list = {ids, INSITU_INT64, 0};
        if (other == 0) changed.mesh.vertex_ids = list;
        if (other == 1) changed.field.index = list;
        if (other == 2) changed.field.centring = INSITU_CORNER;
        if (other == 2) changed.field.count = entries;
        if (other == 2) changed.field.values = (insitu_array){corners, INSITU_FLOAT64, 0};
        drawn pictures = draw(MPI_COMM_WORLD, FINER("2") ALL, &changed);
        everywhere(own_rank || same_drawn(&plain, &pictures));
        free_drawn(&pictures);
    }
    free_drawn(&plain);
    order_mesh_free(&mesh);
    free(ids);
    free(corners);
}

static void an_index_out_of_range_is_told(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0, order_wavy, own_rank, rank_count, &mesh);
    int64_t *index = malloc((size_t)mesh.vertex_count * sizeof *index);
    for (int64_t v = 0; v < mesh.vertex_count; v++) index[v] = v;
    index[3] = mesh.vertex_count;
    mesh.field.index = (insitu_array){index, INSITU_INT64, 0};
    insitu_session *session = open_mesh(MPI_COMM_WORLD, FINER("2") SPHERE, &mesh.mesh, &mesh.field);
    reported_everywhere(session, insitu_step(session, 0, 0), INSITU_ERROR_FIELD, "field \"f\"",
                        "the index of vertex 3");
    insitu_destroy(&session);
    order_mesh_free(&mesh);
    free(index);
}

/* Cells of several types and orders, in one mesh with offsets: those of the second mesh follow those of the first. */
static void cells_are_counted_as_the_caller_gave_them(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0.05, order_wavy, own_rank, rank_count, &mesh);
    insitu_session *session = open_mesh(MPI_COMM_WORLD, FINER("3") SPHERE, &mesh.mesh, &mesh.field);
    drawn pictures = step_drawn(session, 0);
    const insitu_report *report = insitu_last_report(session);
    everywhere(report->cells == mesh.cell_count && report->cells_inverted == 0 && report->cells_flat == 0);
    everywhere(mesh.cell_count == 0 || strstr(report->copied_why, "with 3 pieces between two nodes") != NULL);
    free_drawn(&pictures);
    insitu_destroy(&session);
    order_mesh_free(&mesh);
}

/* Offsets and types, of which all are the same or each second cell is a hex of 27 nodes by its type, draw the same. */
static void mixed_cells_draw_the_same(void **state)
{
    (void)state;
    const order_kind kind = {"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
    order_mesh mesh;
    order_mesh_create(&kind, 2, 0.07, order_wavy, own_rank, rank_count, &mesh);
    drawn plain = draw(MPI_COMM_WORLD, FINER("3") ALL, &mesh);
    int64_t offsets[65];
    unsigned char types[64];
    for (int64_t cell = 0; cell < mesh.cell_count; cell++)
        types[cell] = (unsigned char)(cell % 2 ? INSITU_LAGRANGE_HEX : INSITU_TRIQUADRATIC_HEX);
    for (int64_t cell = 0; cell <= mesh.cell_count; cell++) offsets[cell] = cell * mesh.nodes;
    mesh.mesh.offsets = (insitu_array){offsets, INSITU_INT64, 0};
    mesh.mesh.cell_types = (insitu_array){types, INSITU_UINT8, 0};
    drawn mixed = draw(MPI_COMM_WORLD, FINER("3") ALL, &mesh);
    everywhere(own_rank || same_drawn(&plain, &mixed));
    free_drawn(&plain);
    free_drawn(&mixed);
    order_mesh_free(&mesh);
}

/* ---- cells that are not shown ------------------------------------------------------------------------------------ */

/* A small sphere in the middle, and a plane through a corner. */
#define FEW                                                                                                            \
    IMAGE("a", "isosurface: {field: f, values: [0.05]}")                                                               \
    IMAGE("b", "slice: {field: f, planes: [{point: [0.8, 0.9, 0.9], normal: [1, 2, 3]}]}")

static drawn draw_few(const char *scene, const order_mesh *mesh, int64_t *bytes)
{
    insitu_session *session = open_mesh(MPI_COMM_WORLD, scene, &mesh->mesh, &mesh->field);
    drawn out = step_drawn(session, 0);
    *bytes = insitu_last_report(session)->bytes_copied;
    MPI_Allreduce(MPI_IN_PLACE, bytes, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    insitu_destroy(&session);
    return out;
}

/* Statistics are sums over all pieces, so that with them all cells are refined. Rays hit the same places to the bit.
 * Where a cell that is not refined has a common node with one that is, its gradient is not part of the mean there, so
 * that normals differ. */
static void other_cells_are_not_refined(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        const order_kind *kind = &order_kinds[k];
        order_mesh mesh;
        int64_t bytes[2];
        if (kind->order == 1 || kind->order > 3) continue;
        order_mesh_create(kind, 4, 0.05, order_sphere, own_rank, rank_count, &mesh);
        drawn few = draw_few(FINER("4") FEW, &mesh, &bytes[0]);
        drawn all = draw_few("statistics: [{field: f, path: few.csv}]\n" FINER("4") FEW, &mesh, &bytes[1]);
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
        free_drawn(&few);
        free_drawn(&all);
        order_mesh_free(&mesh);
    }
}

/* Returns the number of pieces on all ranks. */
static int64_t count_pieces(const char *scene, const order_mesh *mesh)
{
    long long count = 0;
    insitu_session *session = open_mesh(MPI_COMM_WORLD, scene, &mesh->mesh, &mesh->field);
    drawn pictures = step_drawn(session, 0);
    const char *end = strstr(insitu_last_report(session)->copied_why, " linear pieces of its cells");
    while (end && end > insitu_last_report(session)->copied_why && end[-1] >= '0' && end[-1] <= '9') end--;
    if (end) sscanf(end, "%lld", &count);
    free_drawn(&pictures);
    insitu_destroy(&session);
    int64_t all = count;
    MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    return all;
}

/* The sphere and the plane cross all 8 cubes. With 8 pieces between two nodes each of the cubes has 4096 hexes, of
 * which a plane crosses some 400, and 27 are at nodes. With twice as many pieces there would be 8 times as many. */
static void pieces_that_nothing_crosses_are_not_made(void **state)
{
    (void)state;
#define BOTH                                                                                                           \
    IMAGE("a", "isosurface: {field: f, values: [0.5]}")                                                                \
    IMAGE("b", "slice: {field: f, planes: [{normal: [1, 2, 3]}]}")
    order_mesh mesh;
    order_mesh_create(&(order_kind){"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2}, 2, 0.05, order_sphere,
                      own_rank, rank_count, &mesh);
    const int64_t four = count_pieces(FINER("4") BOTH, &mesh), eight = count_pieces(FINER("8") BOTH, &mesh);
    const int64_t all = count_pieces("statistics: [{field: f, path: few.csv}]\n" FINER("8") BOTH, &mesh);
    if (own_rank == 0)
        printf("%lld pieces, twice as fine %lld, all %lld\n", (long long)four, (long long)eight, (long long)all);
    everywhere(all == 8 * 4096 && eight < all / 4 && eight < 5 * four);
    order_mesh_free(&mesh);
}

/* ---- changes ----------------------------------------------------------------------------------------------------- */

enum { VALUES, NODES, SCENE, COARSE, CHANGES };

/* After a change the session draws what a new one does. */
static void check_change(int change)
{
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0.05, order_wavy, own_rank, rank_count, &mesh);
    insitu_session *session = open_mesh(MPI_COMM_WORLD, FINER("2") ALL, &mesh.mesh, &mesh.field);
    drawn first = step_drawn(session, 0);
    const char *scene = change == SCENE ? FINER("3") ALL : change == COARSE ? FINER("1") ALL : FINER("2") ALL;
    for (int64_t v = 0; v < mesh.vertex_count && change == VALUES; v++) mesh.values[v] *= 0.9;
    for (int64_t i = 0; i < 3 * mesh.vertex_count && change == NODES; i++) mesh.coordinates[i] *= 0.8;
    if (change == NODES) mesh.mesh.changed = INSITU_CHANGED_GEOMETRY;
    if (change == NODES) assert_int_equal(insitu_set_mesh(session, "m", &mesh.mesh), INSITU_OK);
    if (change == VALUES) assert_int_equal(insitu_set_field(session, "m", &mesh.field), INSITU_OK);
    if (change >= SCENE) write_scene(scene);
    drawn pictures = step_drawn(session, 1), fresh = draw(MPI_COMM_WORLD, scene, &mesh);
    if (own_rank == 0 && !same_drawn(&pictures, &fresh)) fprintf(stderr, "change %d is not drawn\n", change);
    everywhere(own_rank || (same_drawn(&pictures, &fresh) && !same_drawn(&pictures, &first)));
    free_drawn(&first);
    free_drawn(&pictures);
    free_drawn(&fresh);
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
    order_mesh_create(kind, 2, 0, order_sphere, own_rank, rank_count, &mesh);
    insitu_session *session = open_mesh(MPI_COMM_WORLD, scene, &mesh.mesh, &mesh.field);
    drawn pictures = step_drawn(session, 0);
    everywhere(strstr(insitu_last_report(session)->warnings, words) != NULL);
    insitu_destroy(&session);
    drawn expected = draw(MPI_COMM_WORLD, as, &mesh);
    everywhere(own_rank || same_drawn(&pictures, &expected));
    free_drawn(&pictures);
    free_drawn(&expected);
    order_mesh_free(&mesh);
}

static void limits_are_told(void **state)
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
        cmocka_unit_test(every_ray_meets_a_plane),
        cmocka_unit_test(pictures_are_the_same_on_any_ranks),
        cmocka_unit_test(linear_meshes_are_not_affected),
        cmocka_unit_test(other_descriptions_draw_the_same),
        cmocka_unit_test(an_index_out_of_range_is_told),
        cmocka_unit_test(cells_are_counted_as_the_caller_gave_them),
        cmocka_unit_test(mixed_cells_draw_the_same),
        cmocka_unit_test(other_cells_are_not_refined),
        cmocka_unit_test(pieces_that_nothing_crosses_are_not_made),
        cmocka_unit_test(changes_are_drawn),
        cmocka_unit_test(limits_are_told),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
