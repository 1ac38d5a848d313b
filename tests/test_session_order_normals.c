/* Checks that normals of isosurfaces in cells of higher order are gradients of the cells' polynomial. On straight cells
 * with the squared distance from the origin as field they are those of a sphere. Pictures must be bit-identical on any
 * number of ranks. */
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
#define SCENE(layer)                                                                                                   \
    "images:\n  - name: a\n    size: [96, 72]\n    background: [0, 0, 0, 0]\n"                                         \
    "    camera: {position: [0, 0, 5], focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2.6}\n"      \
    "    layers:\n      - " layer "\n    outputs: [{path: a.exr, data: true}]\n"

static const char sphere_scene[] = SCENE("isosurface: {field: f, values: [0.5]}");

static caught_picture draw_mesh(MPI_Comm comm, const char *scene, const order_mesh *mesh)
{
    insitu_session *session = open_session_with_mesh(comm, scene, &mesh->mesh, &mesh->field);
    discard_pictures();
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
    insitu_destroy(&session);
    return pop_caught_picture();
}

static bool is_of_order_two(const order_kind *kind)
{
    return kind->order > 1 && !strstr(kind->name, "pyramid");
}

/* Returns the largest distance between a hit's unit normal and the normalised gradient of the field at the hit, over
 * pixels within 0.5 of the axis, where the sphere faces the eye; infinity if such a pixel has no hit. */
static double find_largest_normal_error(const caught_picture *picture)
{
    double worst = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const double size = VIEW_HEIGHT / HEIGHT, depth = (double)picture->depth[pixel];
        const double at[3] = {(pixel % WIDTH + 0.5 - WIDTH / 2.0) * size, (HEIGHT / 2.0 - pixel / WIDTH - 0.5) * size,
                              EYE - depth};
        if (at[0] * at[0] + at[1] * at[1] > 0.25) continue;
        if (!isfinite(depth)) return INFINITY;
        double square = 0;
        for (int a = 0; a < 3; a++)
            square += pow((double)picture->data[a * PIXELS + pixel] - at[a] / sqrt(order_sphere_field(at)), 2);
        worst = fmax(worst, sqrt(square));
    }
    return worst;
}

static double measure_sphere_normal_error(const order_kind *kind, int side, double bend, const char *scene)
{
    order_mesh mesh;
    order_mesh_create(kind, side, bend, order_sphere_field, own_rank, rank_count, &mesh);
    caught_picture picture = draw_mesh(MPI_COMM_WORLD, scene, &mesh);
    double worst = own_rank ? 0 : find_largest_normal_error(&picture);
    MPI_Bcast(&worst, 1, MPI_DOUBLE, 0, MPI_COMM_WORLD);
    free_caught(&picture);
    order_mesh_free(&mesh);
    return worst;
}

/* Checks normals of a sphere. The gradient is linear, so that pieces interpolate it exactly. Depths are floats up to 5
 * with errors of 1e-6, and so are positions; divided by the radius of 0.7 this is the error of normals. */
static void normals_of_a_sphere_are_exact(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        if (!is_of_order_two(&order_kinds[k])) continue;
        const double error = measure_sphere_normal_error(&order_kinds[k], 2, 0, sphere_scene);
        if (own_rank == 0) printf("%s: normals are off by %.2g\n", order_kinds[k].name, error);
        everywhere(error < 2e-5);
    }
}

/* Checks that errors of normals in bent cells are of second order, as are those of gradients at nodes and of the
 * interpolation between them: if the distance between nodes is a quarter, the error falls by 16. On such coarse meshes
 * the factor is still between 16 and 4, the factor of normals that are constant on each piece. */
static void normals_in_bent_cells_are_of_second_order(void **state)
{
    (void)state;
    if (rank_count > 1 && !test_is_long_run()) return;
    for (int k = 0; k < order_kind_count; k++) {
        const order_kind *kind = &order_kinds[k];
        const bool is_permuted = kind->layout != INSITU_ORDER_VTK && kind->layout != INSITU_ORDER_LEXICOGRAPHIC;
        if (!is_of_order_two(kind) || kind->order == 4 || is_permuted) continue;
        const int side = kind->order == 3 ? 3 : 6;
        const double coarse = measure_sphere_normal_error(kind, side, 0.08, sphere_scene);
        const double fine = measure_sphere_normal_error(kind, 4 * side, 0.08, sphere_scene);
        if (own_rank == 0) printf("%s, bent: %.2g, %.2g: %.2f\n", kind->name, coarse, fine, coarse / fine);
        everywhere(fine < 2e-3 && coarse / fine > 8);
    }
}

/* ---- outer faces ------------------------------------------------------------------------------------------------- */

/* Moves nodes along z by h = 0.3 x^2 + 0.2 x y, so that the face z = 1 of the cube becomes z = 1 + h. */
static void bend_top_face(order_mesh *mesh)
{
    for (int64_t v = 0; v < mesh->vertex_count; v++) {
        double *p = mesh->coordinates + 3 * v;
        p[2] += 0.3 * p[0] * p[0] + 0.2 * p[0] * p[1];
    }
}

/* Returns the largest distance between a unit normal in the picture and that of the curved face; infinity if the face
 * has a gap. */
static double find_largest_face_normal_error(const caught_picture *picture)
{
    double worst = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const double x = (pixel % WIDTH + 0.5 - WIDTH / 2.0) * VIEW_HEIGHT / HEIGHT;
        const double y = (HEIGHT / 2.0 - pixel / WIDTH - 0.5) * VIEW_HEIGHT / HEIGHT;
        const double normal[3] = {-0.6 * x - 0.2 * y, -0.2 * x, 1};
        double square = 0;
        if (fabs(x) > 1 || fabs(y) > 1) continue;
        if (!isfinite((double)picture->depth[pixel])) return INFINITY;
        for (int a = 0; a < 3; a++)
            square += pow((double)picture->data[a * PIXELS + pixel] -
                              normal[a] / sqrt(1 + normal[0] * normal[0] + normal[1] * normal[1]),
                          2);
        worst = fmax(worst, sqrt(square));
    }
    return worst;
}

/* Checks normals of curved outer faces. They are linear over each cell's face, so that any number of pieces
 * interpolates them exactly, up to rounding to float. Normals of flat pieces would have errors of 0.05 and more. */
static void normals_of_curved_faces_are_exact(void **state)
{
    (void)state;
    static const char *const pieces[] = {"", "finer_pieces: 1\n"};
    for (int k = 0; k < order_kind_count; k++)
        for (int i = 0; i < 2; i++) {
            order_mesh mesh;
            char scene[1024];
            if (!is_of_order_two(&order_kinds[k])) continue;
            order_mesh_create(&order_kinds[k], 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
            bend_top_face(&mesh);
            snprintf(scene, sizeof scene, "%s%s", pieces[i], SCENE("surface: {}"));
            caught_picture picture = draw_mesh(MPI_COMM_WORLD, scene, &mesh);
            const double worst = own_rank ? 0 : find_largest_face_normal_error(&picture);
            if (worst > 2e-6) printf("%s, \"%s\": normals are off by %.2g\n", order_kinds[k].name, scene, worst);
            everywhere(worst <= 2e-6);
            free_caught(&picture);
            order_mesh_free(&mesh);
        }
}

enum { POLYGONS = 40, CORNERS = 12 };

/* Makes polygons around the points of a grid in the plane z = 0. Their corners are alternately above and below the
 * plane, so that the polygons are too bent to be split into triangles with a common apex (session_outer_mesh.h). Rank 0
 * has all of them. */
static void make_zigzag_polygons(double positions[][3], int64_t *connectivity, int64_t *offsets, insitu_mesh *mesh)
{
    const int count = own_rank == 0 ? POLYGONS : 0;
    for (int n = 0; n < count * CORNERS; n++) {
        const int polygon = n / CORNERS, corner = n % CORNERS;
        const double angle = 6.28318530717958648 * corner / CORNERS;
        positions[n][0] = -1.05 + 0.3 * (polygon % 8) + 0.13 * cos(angle);
        positions[n][1] = -0.6 + 0.3 * (polygon / 8) + 0.13 * sin(angle);
        positions[n][2] = corner % 2 ? 0.1 : -0.1;
        connectivity[n] = n;
    }
    for (int polygon = 0; polygon <= count; polygon++) offsets[polygon] = (int64_t)polygon * CORNERS;
    insitu_mesh_defaults(mesh);
    insitu_mesh_interleaved(mesh, positions, INSITU_FLOAT64);
    mesh->vertex_count = mesh->connectivity_count = (int64_t)count * CORNERS;
    mesh->cell_count = count;
    mesh->cell_type = INSITU_POLYGON;
    mesh->connectivity = (insitu_array){connectivity, INSITU_INT64, 0};
    mesh->offsets = (insitu_array){offsets, INSITU_INT64, 0};
}

/* Draws the polygons. If `curved` is not NULL, also sets this mesh, which must be outside the picture. */
static caught_picture draw_polygons(const insitu_mesh *polygons, const insitu_mesh *curved)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(SCENE("surface: {}")));
    everywhere(insitu_set_mesh(session, "polygons", polygons) == INSITU_OK);
    if (curved) everywhere(insitu_set_mesh(session, "curved", curved) == INSITU_OK);
    discard_pictures();
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    insitu_destroy(&session);
    return pop_caught_picture();
}

/* Checks linear cells in a session that also has curved faces, so that faces of linear cells have normals at vertices
 * too. The picture must be that without curved faces, up to the rounding of normals to float, also for polygons whose
 * triangles each have an apex of their own. */
static void faces_of_linear_cells_keep_their_normals(void **state)
{
    (void)state;
    static const order_kind hex_27 = {"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
    static double positions[POLYGONS * CORNERS][3];
    static int64_t connectivity[POLYGONS * CORNERS], offsets[POLYGONS + 1];
    insitu_mesh polygons;
    order_mesh curved;
    int hits = 0;
    double worst = 0;
    make_zigzag_polygons(positions, connectivity, offsets, &polygons);
    order_mesh_create(&hex_27, 2, 0, order_sphere_field, own_rank, rank_count, &curved);
    for (int64_t v = 0; v < curved.vertex_count; v++) curved.coordinates[3 * v] += 50;
    caught_picture alone = draw_polygons(&polygons, NULL), beside = draw_polygons(&polygons, &curved.mesh);
    for (int pixel = 0; pixel < PIXELS && own_rank == 0; pixel++) {
        const bool is_hit = isfinite((double)alone.depth[pixel]);
        if (is_hit != isfinite((double)beside.depth[pixel])) worst = INFINITY;
        for (int a = 0; a < 3 && is_hit; a++)
            worst = fmax(worst, fabs((double)(alone.data[a * PIXELS + pixel] - beside.data[a * PIXELS + pixel])));
        hits += is_hit;
    }
    if (own_rank == 0) printf("%d pixels of polygons, normals differ by %.2g\n", hits, worst);
    everywhere(own_rank || (hits > 1000 && worst < 2e-6));
    free_caught(&alone);
    free_caught(&beside);
    order_mesh_free(&curved);
}

/* ---- derived gradients ------------------------------------------------------------------------------------------- */

/* Checks a derived gradient: the derivative of the squared distance along z is 2 z at all nodes, so that the isosurface
 * 0.3 is the plane z = 0.15. */
static void derived_gradients_are_exact(void **state)
{
    (void)state;
    const char *scene = "fields: {g: {gradient: f}}\n" SCENE("isosurface: {field: g, component: z, values: [0.3]}");
    for (int k = 0; k < order_kind_count; k++) {
        if (!is_of_order_two(&order_kinds[k])) continue;
        order_mesh mesh;
        order_mesh_create(&order_kinds[k], 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
        caught_picture picture = draw_mesh(MPI_COMM_WORLD, scene, &mesh);
        int wrong = 0;
        for (int pixel = 0; own_rank == 0 && pixel < PIXELS; pixel++) {
            const double x = (pixel % WIDTH + 0.5 - WIDTH / 2.0) * VIEW_HEIGHT / HEIGHT;
            const double y = (HEIGHT / 2.0 - pixel / WIDTH - 0.5) * VIEW_HEIGHT / HEIGHT;
            wrong += fabs(x) < 1 && fabs(y) < 1 && !(fabs((double)picture.depth[pixel] - (EYE - 0.15)) < 1e-5);
        }
        everywhere(wrong == 0);
        free_caught(&picture);
        order_mesh_free(&mesh);
    }
}

/* ---- Gauss-Lobatto points ---------------------------------------------------------------------------------------- */

/* Moves the nodes of cubes of order 4, two of which are along each axis, to Gauss-Lobatto points. */
static void move_nodes_to_lobatto_points(order_mesh *mesh)
{
    const double of4[5] = {0, 0.5 - 0.5 * sqrt(3. / 7), 0.5, 0.5 + 0.5 * sqrt(3. / 7), 1};
    for (int64_t i = 0; i < 3 * mesh->vertex_count; i++) {
        const int at = (int)lround((mesh->coordinates[i] + 1) * 4);
        mesh->coordinates[i] = at / 4 - 1 + of4[at % 4];
    }
    for (int64_t v = 0; v < mesh->vertex_count; v++) mesh->values[v] = order_sphere_field(mesh->coordinates + 3 * v);
}

static void normals_between_lobatto_points_are_exact(void **state)
{
    (void)state;
    const order_kind kind = {"hex", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 4};
    order_mesh mesh;
    order_mesh_create(&kind, 2, 0, order_sphere_field, own_rank, rank_count, &mesh);
    move_nodes_to_lobatto_points(&mesh);
    caught_picture picture = draw_mesh(MPI_COMM_WORLD, sphere_scene, &mesh);
    everywhere(own_rank || find_largest_normal_error(&picture) < 2e-5);
    free_caught(&picture);
    order_mesh_free(&mesh);
}

/* ---- partitions and choices -------------------------------------------------------------------------------------- */

static void normals_are_the_same_on_any_ranks(void **state)
{
    (void)state;
    const char *scene = SCENE("isosurface: {field: f, values: [0.1, 0.4], opacity: 0.6}");
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh part, whole;
        order_mesh_create(&order_kinds[k], 2, 0.07, order_wave_field, own_rank, rank_count, &part);
        order_mesh_create(&order_kinds[k], 2, 0.07, order_wave_field, 0, 1, &whole);
        caught_picture all = draw_mesh(MPI_COMM_WORLD, scene, &part);
        caught_picture alone = draw_mesh(MPI_COMM_SELF, scene, &whole);
        everywhere(own_rank || are_same_pictures(&all, &alone));
        free_caught(&all);
        free_caught(&alone);
        order_mesh_free(&part);
        order_mesh_free(&whole);
    }
}

/* Checks that the default normals are those of the setting `normals: vertex`. */
static void vertex_normals_are_the_default(void **state)
{
    (void)state;
    const order_kind kind = {"hex", INSITU_QUADRATIC_HEX, INSITU_ORDER_VTK, 2};
    order_mesh mesh;
    order_mesh_create(&kind, 2, 0.07, order_wave_field, own_rank, rank_count, &mesh);
    caught_picture plain = draw_mesh(MPI_COMM_WORLD, SCENE("isosurface: {field: f, values: [0.1]}"), &mesh);
    caught_picture asked =
        draw_mesh(MPI_COMM_WORLD, SCENE("isosurface: {field: f, values: [0.1], normals: vertex}"), &mesh);
    everywhere(own_rank || are_same_pictures(&plain, &asked));
    free_caught(&plain);
    free_caught(&asked);
    order_mesh_free(&mesh);
}

/* ---- lost values ------------------------------------------------------------------------------------------------- */

/* Checks a cell of which some values are not finite. Its other pieces are drawn, with normals from differences along
 * their edges. On the border of the cube these differences are one-sided: the gradient along z is 1.5 there instead of
 * 2, which is an error of at most 0.21 on the surface for a gradient of length 1.41. Without such normals the errors
 * would be up to 0.7. */
static void pieces_adjacent_to_missing_values_have_normals(void **state)
{
    (void)state;
    const order_kind kind = {"hex", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, 4};
    order_mesh mesh;
    order_mesh_create(&kind, 1, 0, order_sphere_field, own_rank, rank_count, &mesh);
    for (int64_t v = 0; v < mesh.vertex_count; v++)
        if (mesh.coordinates[3 * v] > 0.9 && mesh.coordinates[3 * v + 1] > 0.9) mesh.values[v] = NAN;
    caught_picture picture = draw_mesh(MPI_COMM_WORLD, sphere_scene, &mesh);
    const double error = own_rank ? 0 : find_largest_normal_error(&picture);
    if (own_rank == 0) printf("beside lost values normals are off by %.2g\n", error);
    everywhere(error < 0.15);
    free_caught(&picture);
    order_mesh_free(&mesh);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(normals_of_a_sphere_are_exact),
        cmocka_unit_test(normals_in_bent_cells_are_of_second_order),
        cmocka_unit_test(normals_of_curved_faces_are_exact),
        cmocka_unit_test(faces_of_linear_cells_keep_their_normals),
        cmocka_unit_test(derived_gradients_are_exact),
        cmocka_unit_test(normals_between_lobatto_points_are_exact),
        cmocka_unit_test(normals_are_the_same_on_any_ranks),
        cmocka_unit_test(vertex_normals_are_the_default),
        cmocka_unit_test(pieces_adjacent_to_missing_values_have_normals),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
