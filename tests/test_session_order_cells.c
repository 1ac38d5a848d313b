/* Checks that layers and reports refer to the caller's cells of higher order, not to the linear pieces into which the
 * library splits them: lines along edges, counts of cells, and means of cell values at nodes. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_effort.h"
#include "test_mesh_order.h"
#include "test_session_fixture.h"

enum { SIDE = 240, PIXELS = SIDE * SIDE };

/* A pixel is 1/100 wide; the camera looks along z from z = 5. pieces: number of linear pieces between two nodes of a
 * cell. */
#define PICTURE(pieces, layer, more)                                                                                   \
    "finer_pieces: " pieces "\nimages:\n  - name: a\n    size: [240, 240]\n    background: [0, 0, 0, 0]\n"             \
    "    camera: {position: [0, 0, 5], focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2.4}\n"      \
    "    layers:\n      - " layer "\n    outputs: [{path: a.exr" more "}]\n"
#define IMAGE(layer) PICTURE("1", layer, "")
#define NUMBERED(layer) PICTURE("1", layer, ", data: true")
#define FINER_LINED(pieces, width)                                                                                     \
    PICTURE(pieces,                                                                                                    \
            "surface: {colour: [1, 1, 1], edges: {width: " width                                                       \
            ", colour: [0, 0, 0]}, material: {ambient: 1, diffuse: 0, specular: 0}}",                                  \
            "")
#define LINED(width) FINER_LINED("1", width)

/* Opens a session, which the caller must destroy, and makes a step with the mesh. more: a second field, or NULL. */
static insitu_session *open_session_and_step(const char *scene, const order_mesh *mesh, const insitu_field *more)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    everywhere(insitu_set_mesh(session, "m", &mesh->mesh) == INSITU_OK &&
               insitu_set_field(session, "m", &mesh->field) == INSITU_OK &&
               (!more || insitu_set_field(session, "m", more) == INSITU_OK));
    check_step_succeeds(session, 0);
    return session;
}

static caught_picture draw_picture(const char *scene, const order_mesh *mesh, const insitu_field *more)
{
    insitu_session *session = open_session_and_step(scene, mesh, more);
    insitu_destroy(&session);
    return pop_caught_picture();
}

static insitu_field describe_cell_field(const char *name, insitu_centring centring, const double *values, int64_t count)
{
    insitu_field out;
    insitu_field_defaults(&out);
    out.name = name;
    out.centring = centring;
    out.values = (insitu_array){values, INSITU_FLOAT64, 0};
    out.count = count;
    return out;
}

/* ---- edges ------------------------------------------------------------------------------------------------------- */

static void compute_pixel_position(int pixel, double out[2])
{
    out[0] = (pixel % SIDE + 0.5) / 100 - 1.2;
    out[1] = 1.2 - (pixel / SIDE + 0.5) / 100;
}

/* Returns the squared distance from a point to a segment. */
static double compute_squared_segment_distance(const double at[2], const double a[2], const double b[2])
{
    const double e[2] = {b[0] - a[0], b[1] - a[1]}, d[2] = {at[0] - a[0], at[1] - a[1]};
    const double s = fmin(fmax((d[0] * e[0] + d[1] * e[1]) / (e[0] * e[0] + e[1] * e[1]), 0), 1);
    return pow(d[0] - s * e[0], 2) + pow(d[1] - s * e[1], 2);
}

/* The edges of eight cubes on the face z = 1 of the cube that they fill, as segments between nodes or finer pieces,
 * with the diagonals of tets and wedges there. */
typedef struct edge_list {
    int count;
    double ends[512][2][2];
} edge_list;

/* order: order of the cells; parts: number of linear pieces between two nodes; bend: how far nodes are moved. */
typedef struct edge_form {
    int order, parts;
    double bend;
} edge_form;

/* Computes the point at parameter `at` (0 to 1) of a curved edge: of the polynomial through the edge's nodes, which are
 * equispaced before they are moved. */
static void compute_edge_point(const edge_form *form, const double from[2], const double to[2], double at,
                               double out[2])
{
    out[0] = out[1] = 0;
    for (int node = 0; node <= form->order; node++) {
        const double s = (double)node / form->order;
        const double point[3] = {from[0] + s * (to[0] - from[0]), from[1] + s * (to[1] - from[1]), 1};
        double weight = 1;
        for (int other = 0; other <= form->order; other++)
            if (other != node) weight *= (form->order * at - other) / (node - other);
        for (int axis = 0; axis < 2; axis++) out[axis] += weight * order_mesh_move_coordinate(form->bend, point, axis);
    }
}

static void add_edge(edge_list *list, const double from[2], const double to[2], const edge_form *form)
{
    const int count = form->order * form->parts;
    for (int i = 0; i < count; i++, list->count++)
        for (int end = 0; end < 2; end++)
            compute_edge_point(form, from, to, (double)(i + end) / count, list->ends[list->count][end]);
}

static bool has_diagonals(const order_kind *kind)
{
    return strstr(kind->name, "tet") || strstr(kind->name, "wedge");
}

static void list_edges(const order_kind *kind, double bend, int parts, edge_list *out)
{
    const edge_form form = {kind->order, parts, bend};
    out->count = 0;
    for (int i = -1; i <= 1; i++)
        for (int j = -1; j < 1; j++) {
            add_edge(out, (const double[]){i, j}, (const double[]){i, j + 1}, &form);
            add_edge(out, (const double[]){j, i}, (const double[]){j + 1, i}, &form);
            if (i < 1 && has_diagonals(kind))
                add_edge(out, (const double[]){i, j}, (const double[]){i + 1, j + 1}, &form);
        }
}

/* Counts the pixels that are not as dark as the lines that cover them make them. fade: opacity of all lines. The
 * library computes positions in float, with errors of less than a thousandth of a pixel here. The usual run checks
 * every seventh pixel: some of each line between two nodes. */
static int count_wrong_pixels(const caught_picture *picture, const edge_list *edges, double width, double fade)
{
    int wrong = 0;
    for (int pixel = 0; pixel < PIXELS; pixel += test_case_count(7, 1)) {
        double at[2], nearest = INFINITY;
        compute_pixel_position(pixel, at);
        if (fabs(at[0]) > 1 || fabs(at[1]) > 1) continue;
        for (int i = 0; i < edges->count; i++)
            nearest = fmin(nearest, compute_squared_segment_distance(at, edges->ends[i][0], edges->ends[i][1]));
        const double covered = fmin(fmax(0.5 * (width + 1) - 100 * sqrt(nearest), 0), 1);
        wrong += !(fabs((double)picture->rgba[4 * pixel] - (1 - fade * covered)) < 1e-3);
    }
    return wrong;
}

static void check_edges(const order_kind *kind, double bend, int parts, const char *scene, double width, double fade)
{
    order_mesh mesh;
    edge_list edges;
    order_mesh_create(kind, 2, bend, order_wave_field, own_rank, rank_count, &mesh);
    list_edges(kind, bend, parts, &edges);
    caught_picture picture = draw_picture(scene, &mesh, NULL);
    const int wrong = own_rank ? 0 : count_wrong_pixels(&picture, &edges, width, fade);
    if (wrong)
        fprintf(stderr, "%s, bend %g, %d pieces, width %g: %d pixels are wrong\n", kind->name, bend, parts, width,
                wrong);
    everywhere(wrong == 0);
    free_caught(&picture);
    order_mesh_free(&mesh);
}

/* Checks lines: they run only along edges of the caller's cells, through the nodes of these edges or along finer pieces
 * between them. How far lines fade follows from the length of a cell's edge: 100 pixels or, for diagonals, 141. */
static void edges_are_those_of_the_callers_cells(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        const double length = has_diagonals(&order_kinds[k]) ? 100 * sqrt(2) : 100;
        check_edges(&order_kinds[k], 0, 1, LINED("3"), 3, 1);
        check_edges(&order_kinds[k], 0.1, 1, LINED("3"), 3, 1);
        check_edges(&order_kinds[k], 0, 1, LINED("20"), 20, fmin(0.25 * (length / 20 - 2), 1));
        if (!strstr(order_kinds[k].name, "pyramid")) check_edges(&order_kinds[k], 0.1, 4, FINER_LINED("4", "3"), 3, 1);
    }
}

/* Checks a mesh in which hexes of 8, 20 and 27 nodes alternate: all have lines along their edges, and the isosurface of
 * a linear field has its exact normal in all cells. */
static void cells_of_several_orders_share_a_mesh(void **state)
{
    (void)state;
    static const struct {
        unsigned char type;
        int nodes;
    } kinds[3] = {{INSITU_HEX, 8}, {INSITU_QUADRATIC_HEX, 20}, {INSITU_TRIQUADRATIC_HEX, 27}};
    const order_kind kind = {"hex", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
    order_mesh mesh;
    edge_list edges;
    unsigned char types[8];
    int64_t offsets[9] = {0}, wrong = 0;
    order_mesh_create(&kind, 2, 0, order_plane_field, own_rank, rank_count, &mesh);
    for (int64_t cell = 0; cell < mesh.cell_count; cell++) {
        const int at = (int)(cell * rank_count + own_rank) % 3;
        types[cell] = kinds[at].type;
        offsets[cell + 1] = offsets[cell] + kinds[at].nodes;
        memmove(mesh.connectivity + offsets[cell], mesh.connectivity + cell * 27,
                (size_t)kinds[at].nodes * sizeof *mesh.connectivity);
    }
    mesh.mesh.cell_types = (insitu_array){types, INSITU_UINT8, 0};
    mesh.mesh.offsets = (insitu_array){offsets, INSITU_INT64, 0};
    mesh.mesh.connectivity_count = offsets[mesh.cell_count];
    list_edges(&kind, 0, 1, &edges);
    caught_picture lined = draw_picture(LINED("3"), &mesh, NULL);
    everywhere(own_rank || count_wrong_pixels(&lined, &edges, 3, 1) == 0);
    caught_picture flat = draw_picture(NUMBERED("isosurface: {field: f, values: [0.1]}"), &mesh, NULL);
    const double length = sqrt(1 + 0.3 * 0.3 + 0.2 * 0.2), normal[3] = {0.3 / length, 0.2 / length, 1 / length};
    for (int pixel = 0; own_rank == 0 && pixel < PIXELS; pixel++)
        for (int a = 0; a < 3 && isfinite(flat.depth[pixel]); a++)
            wrong += !(fabs((double)flat.data[a * PIXELS + pixel] - normal[a]) < 1e-5);
    everywhere(wrong == 0);
    free_caught(&lined);
    free_caught(&flat);
    order_mesh_free(&mesh);
}

/* ---- shells ------------------------------------------------------------------------------------------------------ */

/* Checks four quads in the plane z = 1: quads of (p + 1)^2 nodes in rows, or of eight nodes in VTK's order. */
static void shells_have_edges_of_their_own(void **state)
{
    (void)state;
    static const signed char at8[8][2] = {{0, 0}, {2, 0}, {2, 2}, {0, 2}, {1, 0}, {2, 1}, {1, 2}, {0, 1}};
    for (int p = 1; p <= 4; p++)
        for (int is_loose = 0; is_loose < (p == 2 ? 2 : 1); is_loose++) {
            const int nodes = is_loose ? 8 : (p + 1) * (p + 1);
            double coordinates[4 * 25 * 3], values[100] = {0};
            order_mesh mesh = {.nodes = nodes};
            for (int cell = own_rank; cell < 4; cell += rank_count)
                for (int n = 0; n < nodes; n++) {
                    const double u = is_loose ? at8[n][0] / 2. : (double)(n % (p + 1)) / p;
                    const double v = is_loose ? at8[n][1] / 2. : (double)(n / (p + 1)) / p;
                    const double point[3] = {cell % 2 - 1 + u, cell / 2 - 1 + v, 1};
                    for (int axis = 0; axis < 3; axis++)
                        coordinates[3 * mesh.vertex_count + axis] = order_mesh_move_coordinate(0.1, point, axis);
                    mesh.vertex_count++;
                }
            int32_t connectivity[100];
            for (int i = 0; i < 100; i++) connectivity[i] = i;
            insitu_mesh_defaults(&mesh.mesh);
            insitu_mesh_interleaved(&mesh.mesh, coordinates, INSITU_FLOAT64);
            mesh.mesh.vertex_count = mesh.mesh.connectivity_count = mesh.vertex_count;
            mesh.mesh.cell_count = mesh.vertex_count / nodes;
            mesh.mesh.cell_type = is_loose ? INSITU_QUADRATIC_QUAD : INSITU_LAGRANGE_QUAD;
            mesh.mesh.vertex_order = is_loose ? INSITU_ORDER_VTK : INSITU_ORDER_LEXICOGRAPHIC;
            mesh.mesh.connectivity = (insitu_array){connectivity, INSITU_INT32, 0};
            mesh.mesh.order = is_loose ? 0 : p;
            mesh.field = describe_cell_field("f", INSITU_VERTEX, values, mesh.vertex_count);
            const order_kind kind = {"quad", mesh.mesh.cell_type, mesh.mesh.vertex_order, p};
            edge_list edges;
            list_edges(&kind, 0.1, 1, &edges);
            caught_picture picture = draw_picture(LINED("3"), &mesh, NULL);
            everywhere(own_rank || count_wrong_pixels(&picture, &edges, 3, 1) == 0);
            free_caught(&picture);
        }
}

/* ---- counts ------------------------------------------------------------------------------------------------------ */

static bool has_node(const order_mesh *mesh, int64_t cell, int64_t vertex)
{
    bool has = false;
    for (int n = 0; n < mesh->nodes; n++) has = has || mesh->connectivity[cell * mesh->nodes + n] == vertex;
    return has;
}

/* Checks the count of cells that cannot be drawn because of a NaN at one node. The node is next to the origin on the
 * edge along x, which several cells share. */
static void cells_that_cannot_be_shown_count_once(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh mesh;
        int64_t expected = 0;
        order_mesh_create(&order_kinds[k], 2, 0, order_wave_field, own_rank, rank_count, &mesh);
        for (int64_t v = 0; v < mesh.vertex_count; v++) {
            const double *at = mesh.coordinates + 3 * v;
            if (fabs(at[0] - 1. / order_kinds[k].order) + fabs(at[1]) + fabs(at[2]) > 1e-9) continue;
            mesh.values[v] = NAN;
            for (int64_t cell = 0; cell < mesh.cell_count; cell++) expected += has_node(&mesh, cell, v);
        }
        insitu_session *session = open_session_and_step(IMAGE("isosurface: {field: f, values: [0.1]}"), &mesh, NULL);
        everywhere(insitu_last_report(session)->cells_unusable == expected);
        char words[64];
        int64_t all = expected;
        MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
        snprintf(words, sizeof words, ": %lld cells are not drawn", (long long)all);
        everywhere(own_rank || (all > 0 && strstr(insitu_last_report(session)->warnings, words)));
        insitu_destroy(&session);
        discard_pictures();
        order_mesh_free(&mesh);
    }
}

/* Checks the reported number of cells that show nothing. The isosurface is a plane that cuts off a corner of the cube;
 * cells of which no piece meets it are not in the tree. The number is reported only if the library builds a tree
 * without them. */
static void cells_that_show_nothing_count_once(void **state)
{
    (void)state;
    int reported = 0;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh mesh;
        order_mesh_create(&order_kinds[k], 2, 0, order_plane_field, own_rank, rank_count, &mesh);
        long long left = 0, of = 0, expected = mesh.cell_count;
        for (int64_t cell = 0; cell < mesh.cell_count; cell++) {
            double low = INFINITY, high = -INFINITY;
            for (int n = 0; n < mesh.nodes; n++) {
                low = fmin(low, mesh.values[mesh.connectivity[cell * mesh.nodes + n]]);
                high = fmax(high, mesh.values[mesh.connectivity[cell * mesh.nodes + n]]);
            }
            expected -= low <= 1.4 && 1.4 <= high;
        }
        insitu_session *session = open_session_and_step(IMAGE("isosurface: {field: f, values: [1.4]}"), &mesh, NULL);
        const char *text = strstr(insitu_last_report(session)->left_out, "mesh \"m\": ");
        const bool is_reported = text && sscanf(text, "mesh \"m\": %lld of %lld cells show nothing", &left, &of) == 2;
        everywhere(!is_reported || (left == expected && of == mesh.cell_count));
        reported += is_reported;
        insitu_destroy(&session);
        discard_pictures();
        order_mesh_free(&mesh);
    }
    everywhere(reported >= order_kind_count / 2);
}

static void statistics_count_cells_once(void **state)
{
    (void)state;
    const char *scene = "statistics:\n  - {field: f, path: cells.csv}\n" IMAGE("isosurface: {field: f, values: [0.1]}");
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh mesh;
        char text[4096];
        order_mesh_create(&order_kinds[k], 2, 0, order_wave_field, own_rank, rank_count, &mesh);
        int64_t cells = mesh.cell_count;
        MPI_Allreduce(MPI_IN_PLACE, &cells, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
        if (!own_rank) remove("cells.csv");
        insitu_session *session = open_session_and_step(scene, &mesh, NULL);
        insitu_destroy(&session);
        discard_pictures();
        read_file("cells.csv", sizeof text, text);
        long long counted = -1;
        double volume = 0;
        const char *line = strchr(text, '\n');
        const bool is_read = line && sscanf(line, " %*d,%*f,%lld,%lf", &counted, &volume) == 2;
        everywhere(own_rank || (is_read && counted == cells && fabs(volume - 8) < 1e-9));
        order_mesh_free(&mesh);
    }
}

/* ---- means at nodes ---------------------------------------------------------------------------------------------- */

static double compute_cell_value(int64_t cell)
{
    return sin(1.7 * (double)cell);
}

/* Returns, for each vertex of the whole mesh, the mean value of all cells that have the vertex; each cell counts
 * once. */
static double *compute_vertex_means(const order_mesh *whole)
{
    enum { MOST = 64 };
    double *values = malloc((size_t)whole->vertex_count * MOST * sizeof *values);
    double *means = malloc((size_t)whole->vertex_count * sizeof *means);
    int *counts = calloc((size_t)whole->vertex_count, sizeof *counts);
    for (int64_t i = 0; i < whole->cell_count * whole->nodes; i++) {
        const int64_t v = whole->connectivity[i];
        if (counts[v] < MOST) values[v * MOST + counts[v]++] = compute_cell_value(i / whole->nodes);
    }
    for (int64_t v = 0; v < whole->vertex_count; v++) means[v] = compute_mean(values + v * MOST, counts[v]);
    free(values);
    free(counts);
    return means;
}

/* Returns the means at the part's vertices. Each vertex is looked up in the whole mesh by bitwise equal coordinates. */
static double *find_means_of_part(const order_mesh *part, const order_mesh *whole, const double *means)
{
    double *out = malloc((size_t)(part->vertex_count + 1) * sizeof *out);
    for (int64_t v = 0; v < part->vertex_count; v++) {
        int64_t at = 0;
        while (memcmp(part->coordinates + 3 * v, whole->coordinates + 3 * at, 3 * sizeof(double)) != 0) at++;
        out[v] = means[at];
    }
    return out;
}

static bool are_same_depths(const caught_picture *a, const caught_picture *b)
{
    return own_rank || memcmp(a->depth, b->depth, PIXELS * sizeof *a->depth) == 0;
}

/* Checks that a cell's value counts once at each of the cell's nodes, whether it is given once or at each corner. */
static void cell_values_count_once(void **state)
{
    (void)state;
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh part, whole;
        order_mesh_create(&order_kinds[k], 2, 0.05, order_wave_field, own_rank, rank_count, &part);
        order_mesh_create(&order_kinds[k], 2, 0.05, order_wave_field, 0, 1, &whole);
        const int64_t corners = part.cell_count * part.nodes;
        double *means = compute_vertex_means(&whole), *at_vertices = find_means_of_part(&part, &whole, means);
        double *of_cells = malloc((size_t)(part.cell_count + 1) * sizeof *of_cells);
        double *at_corners = malloc((size_t)(corners + 1) * sizeof *at_corners);
        for (int64_t cell = 0; cell < part.cell_count; cell++)
            of_cells[cell] = compute_cell_value(cell * rank_count + own_rank);
        for (int64_t i = 0; i < corners; i++) at_corners[i] = of_cells[i / part.nodes];
        const insitu_field v = describe_cell_field("v", INSITU_VERTEX, at_vertices, part.vertex_count);
        const insitu_field c = describe_cell_field("c", INSITU_CELL, of_cells, part.cell_count);
        const insitu_field d = describe_cell_field("d", INSITU_CORNER, at_corners, corners);
        caught_picture truth = draw_picture(IMAGE("isosurface: {field: v, values: [0.1]}"), &part, &v);
        caught_picture cells = draw_picture(IMAGE("isosurface: {field: c, values: [0.1]}"), &part, &c);
        caught_picture averaged =
            draw_picture(IMAGE("isosurface: {field: d, values: [0.1], interpolate: vertex}"), &part, &d);
        everywhere(are_same_depths(&truth, &cells));
        everywhere(are_same_depths(&truth, &averaged));
        free_caught(&truth);
        free_caught(&cells);
        free_caught(&averaged);
        free(means);
        free(at_vertices);
        free(of_cells);
        free(at_corners);
        order_mesh_free(&part);
        order_mesh_free(&whole);
    }
}

/* Checks normals of isosurfaces of means. The means are not values of a cell's polynomial, so normals are those of the
 * linear pieces: the picture equals that of linear hexes between the nodes, with the means as values at vertices. */
static void normals_of_cell_means_match_those_of_pieces(void **state)
{
    (void)state;
    for (int p = 2; p <= 3; p++) {
        const order_kind kind = {"hex", INSITU_LAGRANGE_HEX, INSITU_ORDER_LEXICOGRAPHIC, p};
        order_mesh part, whole;
        order_mesh_create(&kind, 2, 0.05, order_wave_field, own_rank, rank_count, &part);
        order_mesh_create(&kind, 2, 0.05, order_wave_field, 0, 1, &whole);
        order_mesh cut = order_mesh_make_linear_hexes(&part, p);
        double *means = compute_vertex_means(&whole), *at_vertices = find_means_of_part(&part, &whole, means);
        double *of_cells = malloc((size_t)(part.cell_count + 1) * sizeof *of_cells);
        for (int64_t cell = 0; cell < part.cell_count; cell++)
            of_cells[cell] = compute_cell_value(cell * rank_count + own_rank);
        const insitu_field v = describe_cell_field("v", INSITU_VERTEX, at_vertices, part.vertex_count);
        const insitu_field c = describe_cell_field("c", INSITU_CELL, of_cells, part.cell_count);
        static const char *const scenes[2][2] = {
            {IMAGE("isosurface: {field: v, values: [0.1]}"), IMAGE("isosurface: {field: c, values: [0.1]}")},
            {IMAGE("isosurface: {field: v, values: [0.1], normals: vertex}"),
             IMAGE("isosurface: {field: c, values: [0.1], normals: vertex}")}};
        for (int i = 0; i < 2; i++) {
            caught_picture truth = draw_picture(scenes[i][0], &cut, &v), cells = draw_picture(scenes[i][1], &part, &c);
            everywhere(own_rank || are_same_pictures(&truth, &cells));
            free_caught(&truth);
            free_caught(&cells);
        }
        free(cut.connectivity);
        free(means);
        free(at_vertices);
        free(of_cells);
        order_mesh_free(&part);
        order_mesh_free(&whole);
    }
}

static int set_up_test_group(void **state)
{
    (void)state;
    return enter_test_folder("order_cells") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(edges_are_those_of_the_callers_cells),
        cmocka_unit_test(cells_of_several_orders_share_a_mesh),
        cmocka_unit_test(shells_have_edges_of_their_own),
        cmocka_unit_test(cells_that_cannot_be_shown_count_once),
        cmocka_unit_test(cells_that_show_nothing_count_once),
        cmocka_unit_test(statistics_count_cells_once),
        cmocka_unit_test(cell_values_count_once),
        cmocka_unit_test(normals_of_cell_means_match_those_of_pieces),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, NULL);
}
