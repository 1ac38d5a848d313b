/* Checks cells of higher order, which the library splits into pieces: linear cells between the cell's nodes. A linear
 * field on straight cells has a plane as isosurface, for all kinds of cells, so that every ray that meets the plane
 * inside the cube must have a hit in closed form, and no other ray may have one. Hexes of higher order must give
 * pictures that are bit-identical to those of linear hexes between their nodes. For a quadratic field the error must
 * fall by a factor of four if nodes are twice as dense. Ghosts, cell values, thresholds and counts must refer to the
 * caller's cells, not to pieces. All pictures must be the same on any ranks. */
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
#define CAMERA                                                                                                         \
    "    camera: {position: [0, 0, 5], focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2.6}\n"
#define IMAGE(name, layer)                                                                                             \
    "  - name: " name "\n    size: [96, 72]\n    background: [0, 0, 0, 0]\n" CAMERA "    layers:\n      - " layer      \
    "\n    outputs: [{path: " name ".exr}]\n"

/* A key of the scene: cells have exactly one piece between neighbouring nodes. */
#define BETWEEN_NODES "finer_pieces: 1\n"

static const char plane_scene[] = "images:\n" IMAGE("a", "isosurface: {field: f, values: [0.1]}")
    IMAGE("b", "slice: {field: f, planes: [{normal: [0.3, 0.2, 1], point: [0, 0, 0.1]}]}")
        IMAGE("c", "surface: {colour_by: {field: f, map: grey, range: [-3, 3]}}");
static const char sphere_scene[] = BETWEEN_NODES "images:\n" IMAGE("a", "isosurface: {field: f, values: [0.5]}");
#define ALL(normals)                                                                                                   \
    "images:\n" IMAGE("a", "isosurface: {field: f, values: [0.1, 0.4], opacity: 0.6, normals: " normals "}")           \
        IMAGE("b", "slice: {field: f, planes: [{normal: [1, 2, 3]}]}")                                                 \
            IMAGE("c", "surface: {threshold: {field: f, from: -0.9}, colour_by: {field: f}}")                          \
                IMAGE("d", "volume: {field: f}")
static const char all_scene[] = ALL("gradient");
/* A scene in which cells of higher order are drawn exactly as the linear cells between their nodes: with one piece
 * between nodes, and with normals that do not use the cells' polynomials. */
static const char linear_scene[] = BETWEEN_NODES ALL("differences");
static const char cell_scene[] =
    "images:\n" IMAGE("a", "surface: {threshold: {field: c, from: 0.5}, colour_by: {field: c}}")
        IMAGE("b", "volume: {field: c}") IMAGE("c", "isosurface: {field: f, values: [0.1]}");

/* ---- drawing ---------------------------------------------------------------------------------------------------- */

static bool step_succeeds(insitu_session *session, int cycle)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, cycle, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    return status == INSITU_OK;
}

/* Draws the mesh in a new session. more: a second field, or NULL. */
static drawn draw_mesh(MPI_Comm comm, const char *scene, const order_mesh *mesh, const insitu_field *more,
                       insitu_report *report)
{
    insitu_session *session = open_session_with_mesh(comm, scene, &mesh->mesh, &mesh->field);
    if (more) assert_int_equal(insitu_set_field(session, "m", more), INSITU_OK);
    const bool is_well = step_succeeds(session, 0);
    if (report) *report = *insitu_last_report(session);
    assert_true(is_well);
    const drawn out = take_caught_pictures();
    insitu_destroy(&session);
    return out;
}

/* The allowed error of depths: they are up to 6, in float, and result from a few float operations. */
static const double rounding = 1e-5;

/* Returns whether the first pictures have the same hits, up to the rounding of positions. Positions are relative to the
 * centre of the drawn cells, which changes if some cells are ghosts. */
static bool are_same_depths(const drawn *a, const drawn *b)
{
    bool is_same = true;
    for (int i = 0; own_rank == 0 && i < PIXELS; i++) {
        const double left = (double)a->pictures[0].depth[i], right = (double)b->pictures[0].depth[i];
        is_same = is_same && (left == right || fabs(left - right) < rounding);
    }
    return is_same;
}

static void compute_pixel_position(int pixel, double out[2])
{
    const double size = VIEW_HEIGHT / HEIGHT;
    out[0] = (pixel % WIDTH + 0.5 - WIDTH / 2.0) * size;
    out[1] = (HEIGHT / 2.0 - pixel / WIDTH - 0.5) * size;
}

/* ---- planes ----------------------------------------------------------------------------------------------------- */

static double compute_linear_field(const double p[3])
{
    return p[2] + 0.3 * p[0] + 0.2 * p[1];
}

/* Counts pixels whose depth is wrong: a hit is missing, is unexpected, or is at a wrong depth. is_face: the face z = 1
 * of the cube is drawn instead of the plane. */
static int count_wrong_pixels(const caught_picture *picture, bool is_face)
{
    int wrong = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        double at[2];
        compute_pixel_position(pixel, at);
        const bool is_in = fabs(at[0]) < 1 && fabs(at[1]) < 1;
        const double z = is_face ? 1 : 0.1 - 0.3 * at[0] - 0.2 * at[1], depth = (double)picture->depth[pixel];
        wrong += is_in ? !(fabs(depth - (EYE - z)) < rounding) : isfinite(depth);
    }
    return wrong;
}

static void planes_have_no_gap(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh part, whole;
        insitu_report report;
        order_mesh_create(&order_kinds[k], 2, 0, compute_linear_field, own_rank, rank_count, &part);
        drawn all = draw_mesh(MPI_COMM_WORLD, plane_scene, &part, NULL, &report);
        everywhere(report.cells == part.cell_count && report.cells_inverted == 0 && report.cells_flat == 0);
        order_mesh_create(&order_kinds[k], 2, 0, compute_linear_field, 0, 1, &whole);
        drawn alone = draw_mesh(MPI_COMM_SELF, plane_scene, &whole, NULL, NULL);
        int wrong[3] = {0};
        bool is_same = true;
        for (int i = 0; own_rank == 0 && i < 3; i++) {
            wrong[i] = count_wrong_pixels(&all.pictures[i], i == 2);
            is_same = is_same && are_same_pictures(&all.pictures[i], &alone.pictures[i]);
        }
        if (wrong[0] || wrong[1] || wrong[2])
            fprintf(stderr, "%s: %d, %d, %d pixels are wrong\n", order_kinds[k].name, wrong[0], wrong[1], wrong[2]);
        everywhere(!wrong[0] && !wrong[1] && !wrong[2]);
        everywhere(is_same);
        free_picture_set(&all);
        free_picture_set(&alone);
        order_mesh_free(&part);
        order_mesh_free(&whole);
    }
}

/* ---- the order of the error -------------------------------------------------------------------------------------- */

/* Returns the largest error of depths of the sphere, over rays within 0.4 of the axis, where the sphere faces the
 * eye. */
static double measure_sphere_error(const order_kind *kind, int side, double bend)
{
    order_mesh mesh;
    order_mesh_create(kind, side, bend, order_sphere_field, own_rank, rank_count, &mesh);
    drawn d = draw_mesh(MPI_COMM_WORLD, sphere_scene, &mesh, NULL, NULL);
    double worst = 0;
    for (int pixel = 0; own_rank == 0 && pixel < PIXELS; pixel++) {
        double at[2];
        compute_pixel_position(pixel, at);
        const double square = at[0] * at[0] + at[1] * at[1];
        if (square > 0.16) continue;
        const double error = fabs((double)d.pictures[0].depth[pixel] - (EYE - sqrt(0.5 - square)));
        worst = error > worst || !isfinite(error) ? error : worst;
    }
    MPI_Bcast(&worst, 1, MPI_DOUBLE, 0, MPI_COMM_WORLD);
    free_picture_set(&d);
    order_mesh_free(&mesh);
    return worst;
}

/* Checks that the error falls by about 4. The error of the interpolant is a constant times the square of the spacing of
 * nodes, plus terms of higher order; the constant hardly changes between cells of this size. Rays sample the positions
 * of the largest errors, so that the ratio of the two maxima is near 4. */
static void error_falls_by_a_factor_of_four(void **state)
{
    (void)state;
    /* By default this runs on one rank only: other cases compare the pictures of several ranks with those of one. */
    if (rank_count > 1 && !test_is_long_run()) return;
    for (int k = 0; k < order_kind_count; k++)
        for (int is_bent = 0; is_bent < 2; is_bent++) {
            if (order_kinds[k].order == 4) continue; /* the finer mesh would take too long */
            const int side = order_kinds[k].order == 1 ? 6 : order_kinds[k].order == 3 ? 2 : 3;
            const double coarse = measure_sphere_error(&order_kinds[k], side, is_bent ? 0.08 : 0);
            const double fine = measure_sphere_error(&order_kinds[k], 2 * side, is_bent ? 0.08 : 0);
            if (own_rank == 0)
                printf("%s%s: error %.2g, with nodes twice as dense %.2g: %.2f\n", order_kinds[k].name,
                       is_bent ? ", bent" : "", coarse, fine, coarse / fine);
            everywhere(coarse / fine > 3.2 && coarse / fine < 5.5);
        }
}

/* ---- hexes are the linear ones between their nodes --------------------------------------------------------------- */

/* Returns the mesh with vertices that no two cells share, and without connectivity. The cells have order p. */
static order_mesh duplicate_nodes_per_cell(const order_mesh *of, int p)
{
    order_mesh out = *of;
    const int64_t count = of->cell_count * of->nodes;
    out.coordinates = malloc((size_t)(3 * count) * sizeof(double));
    out.values = malloc((size_t)count * sizeof(double));
    for (int64_t i = 0; i < count; i++) {
        memcpy(out.coordinates + 3 * i, of->coordinates + 3 * of->connectivity[i], 3 * sizeof(double));
        out.values[i] = of->values[of->connectivity[i]];
    }
    insitu_mesh_interleaved(&out.mesh, out.coordinates, INSITU_FLOAT64);
    out.mesh.connectivity = (insitu_array){0};
    out.mesh.connectivity_count = 0;
    out.mesh.vertex_count = out.vertex_count = out.field.count = count;
    out.mesh.order = p;
    out.field.values = (insitu_array){out.values, INSITU_FLOAT64, 0};
    return out;
}

/* Checks hexes of higher order against linear hexes between their nodes: pictures are bit-identical, also of volumes,
 * because samples are blended in the order of cell numbers, which are the same in both meshes. Also checks that cells
 * without connectivity draw the same as cells with it. */
static void hexes_match_linear_hexes_between_nodes(void **state)
{
    (void)state;
    for (int p = 1; p <= 4; p++) {
        const order_kind kind = {"hex", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, p};
        order_mesh mesh;
        order_mesh_create(&kind, 2, 0.1, order_wave_field, own_rank, rank_count, &mesh);
        order_mesh cut = order_mesh_make_linear_hexes(&mesh, p), own = duplicate_nodes_per_cell(&mesh, p);
        /* Picture 2 is not compared: its threshold shows the caller's cells as a whole, but each of the linear hexes
         * separately. */
        drawn high = draw_mesh(MPI_COMM_WORLD, linear_scene, &mesh, NULL, NULL);
        drawn low = draw_mesh(MPI_COMM_WORLD, linear_scene, &cut, NULL, NULL);
        drawn listed = draw_mesh(MPI_COMM_WORLD, all_scene, &mesh, NULL, NULL);
        drawn implied = draw_mesh(MPI_COMM_WORLD, all_scene, &own, NULL, NULL);
        bool is_same = true;
        for (int i = 0; own_rank == 0 && i < high.count; i++)
            is_same = is_same && (i == 2 || are_same_pictures(&high.pictures[i], &low.pictures[i]));
        everywhere(is_same);
        everywhere(are_same_picture_sets(&listed, &implied));
        free_picture_set(&listed);
        free_picture_set(&high);
        free_picture_set(&low);
        free_picture_set(&implied);
        free(cut.connectivity);
        free(own.coordinates);
        free(own.values);
        order_mesh_free(&mesh);
    }
}

/* ---- the caller's cells ------------------------------------------------------------------------------------------ */

/* Checks a threshold on cell values and ghosts. Every third cell has the value 0, all others have 1. The threshold must
 * leave the same cells as flagging the cells of value 0 as ghosts. */
static void cell_values_match_the_callers_cells(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh mesh;
        insitu_report report;
        order_mesh_create(&order_kinds[k], 2, 0.05, order_wave_field, own_rank, rank_count, &mesh);
        double *values = malloc((size_t)(mesh.cell_count + 1) * sizeof *values);
        unsigned char *ghosts = malloc((size_t)mesh.cell_count + 1);
        int64_t ghost_count = 0;
        for (int64_t cell = 0; cell < mesh.cell_count; cell++) {
            ghosts[cell] = cell % 3 == 1;
            ghost_count += ghosts[cell];
            values[cell] = 1 - ghosts[cell];
        }
        insitu_field c = mesh.field;
        c.name = "c";
        c.centring = INSITU_CELL;
        c.count = mesh.cell_count;
        c.values = (insitu_array){values, INSITU_FLOAT64, 0};
        drawn threshold = draw_mesh(MPI_COMM_WORLD, cell_scene, &mesh, &c, NULL);
        mesh.mesh.ghosts = (insitu_array){ghosts, INSITU_UINT8, 0};
        drawn hidden = draw_mesh(MPI_COMM_WORLD, cell_scene, &mesh, &c, &report);
        everywhere(report.cells == mesh.cell_count && report.cells_ghost == ghost_count);
        /* only depths are compared, because the range of colours differs: it excludes ghosts */
        everywhere(are_same_depths(&threshold, &hidden));
        free_picture_set(&threshold);
        free_picture_set(&hidden);
        free(values);
        free(ghosts);
        order_mesh_free(&mesh);
    }
}

/* Checks that a threshold on a field at vertices shows the caller's cells as a whole, namely those whose nodes are all
 * within it: the depths equal those with all other cells flagged as ghosts. */
static void thresholds_show_whole_cells(void **state)
{
    (void)state;
    /* by default, the surface without a threshold has more pieces, because only cells with outer faces are refined */
#define TWO_PIECES "finer_pieces: 2\nimages:\n"
    const char *scene = TWO_PIECES IMAGE("a", "surface: {threshold: {field: f, from: -0.3}, colour_by: {field: f}}");
    const char *plain = TWO_PIECES IMAGE("a", "surface: {colour_by: {field: f}}");
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh mesh;
        order_mesh_create(&order_kinds[k], 2, 0.05, order_wave_field, own_rank, rank_count, &mesh);
        unsigned char *ghosts = calloc((size_t)mesh.cell_count + 1, 1);
        for (int64_t i = 0; i < mesh.cell_count * mesh.nodes; i++)
            ghosts[i / mesh.nodes] |= mesh.values[mesh.connectivity[i]] < -0.3;
        drawn threshold = draw_mesh(MPI_COMM_WORLD, scene, &mesh, NULL, NULL);
        mesh.mesh.ghosts = (insitu_array){ghosts, INSITU_UINT8, 0};
        drawn hidden = draw_mesh(MPI_COMM_WORLD, plain, &mesh, NULL, NULL);
        everywhere(are_same_depths(&threshold, &hidden));
        free_picture_set(&threshold);
        free_picture_set(&hidden);
        free(ghosts);
        order_mesh_free(&mesh);
    }
}

/* ---- corners ----------------------------------------------------------------------------------------------------- */

/* Checks that a field with a value at each node of each cell draws the same as a mesh whose cells share no vertices. */
static void corner_fields_are_discontinuous_between_cells(void **state)
{
    (void)state;
    for (int p = 2; p <= 3; p++)
        for (int has_offsets = 0; has_offsets < 2; has_offsets++) {
            const order_kind kind = {"hex", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, p};
            order_mesh mesh;
            order_mesh_create(&kind, 2, 0.1, order_wave_field, own_rank, rank_count, &mesh);
            order_mesh own = duplicate_nodes_per_cell(&mesh, p);
            int64_t *offsets = malloc((size_t)(mesh.cell_count + 1) * sizeof *offsets);
            for (int64_t cell = 0; cell <= mesh.cell_count; cell++) offsets[cell] = cell * mesh.nodes;
            for (int64_t i = 0; i < own.vertex_count; i++) own.values[i] += 0.1 * sin((double)(i / mesh.nodes));
            if (has_offsets) mesh.mesh.offsets = (insitu_array){offsets, INSITU_INT64, 0};
            mesh.field = own.field;
            mesh.field.centring = INSITU_CORNER;
            drawn discontinuous = draw_mesh(MPI_COMM_WORLD, all_scene, &mesh, NULL, NULL);
            drawn doubled = draw_mesh(MPI_COMM_WORLD, all_scene, &own, NULL, NULL);
            everywhere(are_same_picture_sets(&discontinuous, &doubled));
            free_picture_set(&discontinuous);
            free_picture_set(&doubled);
            free(offsets);
            free(own.coordinates);
            free(own.values);
            order_mesh_free(&mesh);
        }
}

/* ---- nodes that move --------------------------------------------------------------------------------------------- */

/* Rotates the mesh about z by about a radian, which changes the order of nodes along each coordinate. */
static void rotate_nodes(order_mesh *mesh)
{
    for (int64_t i = 0; i < mesh->vertex_count; i++) {
        double *p = mesh->coordinates + 3 * i;
        const double x = p[0], y = p[1];
        p[0] = 0.6 * x - 0.8 * y;
        p[1] = 0.8 * x + 0.6 * y;
    }
}

/* Draws the kind's cells, and then the rotated cells, for which the caller declares `changed`. Positions stay relative
 * to the origin of the first step, so that pictures can be compared bit for bit. */
static drawn draw_rotated(const order_kind *kind, unsigned changed)
{
    order_mesh mesh;
    order_mesh_create(kind, 2, 0, order_wave_field, own_rank, rank_count, &mesh);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(all_scene));
    assert_int_equal(insitu_set_mesh(session, "m", &mesh.mesh), INSITU_OK);
    assert_int_equal(insitu_set_field(session, "m", &mesh.field), INSITU_OK);
    everywhere(step_succeeds(session, 0));
    rotate_nodes(&mesh);
    mesh.mesh.changed = changed;
    assert_int_equal(insitu_set_mesh(session, "m", &mesh.mesh), INSITU_OK);
    if (changed == INSITU_CHANGED_ALL) assert_int_equal(insitu_set_field(session, "m", &mesh.field), INSITU_OK);
    everywhere(step_succeeds(session, 1));
    const drawn out = take_caught_pictures();
    insitu_destroy(&session);
    order_mesh_free(&mesh);
    return out;
}

/* Checks moving nodes. Serendipity cells are split anew when their nodes move; all other cells keep their pieces.
 * Surfaces must be bit-identical to those of a mesh that is declared as new. */
static void moved_nodes_draw_same_picture_as_new_mesh(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        drawn moved = draw_rotated(&order_kinds[k], INSITU_CHANGED_GEOMETRY);
        drawn anew = draw_rotated(&order_kinds[k], INSITU_CHANGED_ALL);
        bool is_same = moved.count == anew.count;
        for (int i = 0; own_rank == 0 && i < 3; i++)
            is_same = is_same && are_same_pictures(&moved.pictures[i], &anew.pictures[i]);
        everywhere(is_same);
        free_picture_set(&moved);
        free_picture_set(&anew);
    }
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(planes_have_no_gap),
        cmocka_unit_test(error_falls_by_a_factor_of_four),
        cmocka_unit_test(hexes_match_linear_hexes_between_nodes),
        cmocka_unit_test(cell_values_match_the_callers_cells),
        cmocka_unit_test(thresholds_show_whole_cells),
        cmocka_unit_test(corner_fields_are_discontinuous_between_cells),
        cmocka_unit_test(moved_nodes_draw_same_picture_as_new_mesh),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
