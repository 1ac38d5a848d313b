/* Checks statistics of meshes with cells of higher order, which are integrals of the cells' polynomials. They must
 * equal closed forms in cells that are bent by a polynomial map, and must not depend on the linear pieces that are
 * drawn, on cameras or on ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_effort.h"
#include "test_mesh_order.h"
#include "test_session_fixture.h"

enum { MOST = 1 << 16 };
enum { CELLS = 2, VOLUME, LEAST, MOST_VALUE, MEAN, DEVIATION, LOW, HIGH, FIRST_BIN };

#define PICTURE(camera)                                                                                                \
    "images:\n  - name: a\n    size: [48, 36]\n" camera "    layers: [{isosurface: {field: f, values: [0.1]}}]\n"      \
    "    outputs: [{path: a.png}]\n"
#define FAR PICTURE("    camera: {position: [0, 0, 50], focal: [0, 0, 0], up: [0, 1, 0]}\n")
#define NEAR PICTURE("    camera: {position: [0, 0, 3], focal: [0, 0, 0], up: [0, 1, 0]}\n")
#define OF_F "statistics: [{field: f, path: s.csv}]\n"
#define BINS "statistics: [{field: f, path: s.csv, histogram: {bins: 7}}]\n"

static const order_kind hex_20 = {"hex 20", INSITU_QUADRATIC_HEX, INSITU_ORDER_VTK, 2};
static const order_kind hex_27 = {"hex 27", INSITU_TRIQUADRATIC_HEX, INSITU_ORDER_VTK, 2};
static const order_kind tet_10 = {"tet 10", INSITU_QUADRATIC_TET, INSITU_ORDER_VTK, 2};

/* Writes the statistics of one step, and reads them on rank 0. */
static void write_and_read_statistics(const char *scene, const insitu_mesh *mesh, const insitu_field *field,
                                      char text[MOST])
{
    if (own_rank == 0) remove("s.csv");
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, scene, mesh, field);
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    everywhere(status == INSITU_OK);
    insitu_destroy(&session);
    discard_pictures();
    read_file("s.csv", MOST, text);
}

/* Returns whether a number in the table is the expected one, up to the nine digits that are written. */
static bool is_nearly_equal(const char *text, int column, double expected)
{
    const double number = read_last_number(text, column);
    if (own_rank || fabs(number - expected) <= 1e-8 * fmax(1, fabs(expected))) return true;
    fprintf(stderr, "column %d: %.9g, expected %.9g\n", column, number, expected);
    return false;
}

/* Returns whether a kind of cells is not tested by default. Every third kind is tested, among them tets, hexes, wedges
 * and pyramids. */
static bool is_left_out(int kind)
{
    return !test_is_long_run() && kind % 3 != 1;
}

static bool is_same(const char *a, const char *b)
{
    if (own_rank || (a[0] && strcmp(a, b) == 0)) return true;
    fprintf(stderr, "%s is not %s", a, b);
    return false;
}

/* ---- closed forms ------------------------------------------------------------------------------------------------ */

/* Maps the cube to x + b x^2 + b y^2, y + b z^2, z + b x^2. Every cell of order 2 represents this map exactly. The
 * determinant of its Jacobian matrix is 1 + 2 b x + 8 b^3 x y z. */
static void bend_position(double b, double place[3])
{
    const double x = place[0], y = place[1], z = place[2];
    place[0] = x + b * (x * x + y * y);
    place[1] = y + b * z * z;
    place[2] = z + b * x * x;
}

/* The field x + y z at a position before the map. Over the cube from -1 to 1, weighted by the determinant, its mean is
 * 2 b / 3, and the mean of its square is 4/9 + 16 b^3 / 27. */
static double compute_bent_field(const double p[3])
{
    return p[0] + p[1] * p[2];
}

static void bend_mesh(double b, order_mesh *mesh)
{
    for (int64_t v = 0; v < mesh->vertex_count; v++) bend_position(b, mesh->coordinates + 3 * v);
}

static bool has_moments(const char *text, double mean, double of_square)
{
    return is_nearly_equal(text, VOLUME, 8) && is_nearly_equal(text, MEAN, mean) &&
           is_nearly_equal(text, DEVIATION, sqrt(of_square - mean * mean));
}

static void bent_cells_have_the_moments_of_their_polynomials(void **state)
{
    (void)state;
    static char text[MOST];
    for (int k = 0; k < order_kind_count; k++)
        for (int way = 0; way < 2; way++) {
            const double b = way ? 0.2 : 0;
            order_mesh mesh;
            if (order_kinds[k].order == 1) continue;
            order_mesh_create(&order_kinds[k], 2, 0, compute_bent_field, own_rank, rank_count, &mesh);
            bend_mesh(b, &mesh);
            write_and_read_statistics(OF_F FAR, &mesh.mesh, &mesh.field, text);
            const bool is_good = has_moments(text, 2 * b / 3, 4. / 9 + 16 * b * b * b / 27);
            if (!is_good) fprintf(stderr, "%s\n", order_kinds[k].name);
            everywhere(is_good && is_nearly_equal(text, LEAST, -2) && is_nearly_equal(text, MOST_VALUE, 2));
            order_mesh_free(&mesh);
        }
}

/* Checks cell values, which are 1 in cells at x > 0: the volume of these cells is 4 (1 + b). */
static void cell_values_have_the_volumes_of_bent_cells(void **state)
{
    (void)state;
    static char text[MOST];
    const double b = 0.2;
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0, compute_bent_field, own_rank, rank_count, &mesh);
    double *values = calloc((size_t)mesh.cell_count + 1, sizeof *values);
    for (int64_t cell = 0; cell < mesh.cell_count; cell++)
        values[cell] = mesh.coordinates[3 * mesh.connectivity[cell * mesh.nodes + 1]] > 0;
    bend_mesh(b, &mesh);
    insitu_field field = mesh.field;
    field.values.data = values;
    field.count = mesh.cell_count;
    field.centring = INSITU_CELL;
    write_and_read_statistics(OF_F FAR, &mesh.mesh, &field, text);
    everywhere(has_moments(text, (1 + b) / 2, (1 + b) / 2));
    free(values);
    order_mesh_free(&mesh);
}

/* Checks values at corners. In each cube of side 1 the value is three times the cube's number plus a term with slope 1
 * along x, whose variance is 1/12. The numbers 0 to 7 have the variance 63/12. */
static void corner_values_count_per_cell(void **state)
{
    (void)state;
    static char text[MOST];
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0, compute_bent_field, own_rank, rank_count, &mesh);
    const int64_t entries = mesh.cell_count * mesh.nodes;
    double *values = calloc((size_t)entries + 1, sizeof *values);
    for (int64_t i = 0; i < entries; i++) {
        const int64_t cell = i / mesh.nodes * rank_count + own_rank;
        values[i] = 3 * (double)cell + mesh.coordinates[3 * mesh.connectivity[i]] + (cell % 2 ? -0.5 : 0.5);
    }
    insitu_field field = mesh.field;
    field.values.data = values;
    field.count = entries;
    field.centring = INSITU_CORNER;
    for (int way = 0; way < 2; way++) {
        write_and_read_statistics(way ? OF_F "finer_pieces: 3\n" FAR : OF_F FAR, &mesh.mesh, &field, text);
        everywhere(has_moments(text, 10.5, 10.5 * 10.5 + 9 * 63. / 12 + 1. / 12));
    }
    free(values);
    order_mesh_free(&mesh);
}

/* ---- Gauss-Lobatto points ---------------------------------------------------------------------------------------- */

/* Makes eight cubes of order 4 or 7, dealt to the ranks, that share no nodes. The values at nodes are x^power. */
static void make_lobatto_mesh(int p, int power, double b, order_mesh *out)
{
    static const double of4[5] = {-1, -0.654653670707977144, 0, 0.654653670707977144, 1};
    static const double half7[4] = {0.209299217902478869, 0.591700181433142302, 0.871740148509606615, 1};
    const int size = p + 1;
    *out = (order_mesh){.nodes = size * size * size};
    out->coordinates = calloc((size_t)(24 * out->nodes), sizeof(double));
    out->values = calloc((size_t)(8 * out->nodes), sizeof(double));
    for (int cell = own_rank; cell < 8; cell += rank_count, out->cell_count++)
        for (int n = 0; n < out->nodes; n++, out->vertex_count++) {
            const int at[3] = {n % size, n / size % size, n / size / size};
            double *place = out->coordinates + 3 * out->vertex_count;
            for (int a = 0; a < 3; a++) {
                const double on = p == 4 ? of4[at[a]] : at[a] < 4 ? -half7[3 - at[a]] : half7[at[a] - 4];
                place[a] = (cell >> a & 1) - 0.5 + 0.5 * on;
            }
            out->values[out->vertex_count] = pow(place[0], power);
            bend_position(b, place);
        }
    insitu_mesh_defaults(&out->mesh);
    insitu_mesh_interleaved(&out->mesh, out->coordinates, INSITU_FLOAT64);
    out->mesh.vertex_count = out->vertex_count;
    out->mesh.cell_count = out->cell_count;
    out->mesh.cell_type = INSITU_LAGRANGE_HEX;
    out->mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    out->mesh.order = p;
    insitu_field_defaults(&out->field);
    out->field.name = "f";
    out->field.values = (insitu_array){out->values, INSITU_FLOAT64, 0};
    out->field.count = out->vertex_count;
}

static void nodes_at_lobatto_points_are_recognised(void **state)
{
    (void)state;
    static char text[MOST], finer[MOST];
    for (int way = 0; way < 4; way++) {
        const int p = way % 2 ? 7 : 4, power = way % 2 ? 6 : 4;
        order_mesh mesh;
        make_lobatto_mesh(p, power, way / 2 ? 0.2 : 0, &mesh);
        write_and_read_statistics(OF_F "finer_pieces: 1\n" FAR, &mesh.mesh, &mesh.field, text);
        everywhere(has_moments(text, 1. / (power + 1), 1. / (2 * power + 1)));
        write_and_read_statistics(OF_F "finer_pieces: 2\n" FAR, &mesh.mesh, &mesh.field, finer);
        everywhere(is_same(text, finer));
        order_mesh_free(&mesh);
    }
}

/* ---- pieces, cameras and ranks ----------------------------------------------------------------------------------- */

static void numbers_do_not_depend_on_pieces_and_cameras(void **state)
{
    (void)state;
    static const char *const scenes[] = {BINS "finer_pieces: 1\n" FAR,
                                         BINS "finer_pieces: 2\n" FAR,
                                         BINS "finer_pieces: 4\n" NEAR,
                                         BINS FAR,
                                         BINS NEAR,
                                         BINS "surface_error: 0.05\n" NEAR};
    static char text[MOST], first[MOST];
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh mesh;
        if (is_left_out(k)) continue;
        order_mesh_create(&order_kinds[k], 3, 0.05, order_wave_field, own_rank, rank_count, &mesh);
        write_and_read_statistics(scenes[0], &mesh.mesh, &mesh.field, first);
        for (size_t i = 1; i < sizeof scenes / sizeof *scenes; i++) {
            write_and_read_statistics(scenes[i], &mesh.mesh, &mesh.field, text);
            everywhere(is_same(first, text));
        }
        double sum = 0;
        for (int bin = 0; bin < 7; bin++) sum += read_last_number(first, FIRST_BIN + bin);
        everywhere(own_rank || fabs(sum - 1) < 1e-8);
        order_mesh_free(&mesh);
    }
}

/* Checks derived fields: their values are those at the cells' nodes, however many pieces are drawn. */
static void numbers_of_derived_fields_do_not_depend_on_pieces(void **state)
{
    (void)state;
#define DERIVED(name) "fields: {g: f * f + 1, d: {gradient: f}}\nstatistics: [{field: " name ", path: s.csv}]\n"
    static const char *const scenes[][3] = {
        {DERIVED("g") "finer_pieces: 1\n" FAR, DERIVED("g") "finer_pieces: 3\n" FAR, DERIVED("g") NEAR},
        {DERIVED("d") "finer_pieces: 1\n" FAR, DERIVED("d") "finer_pieces: 3\n" FAR, DERIVED("d") NEAR}};
    static const order_kind *const kinds[] = {&hex_27, &tet_10, &hex_20};
    static char text[MOST], first[MOST];
    for (int k = 0; k < 6; k++) {
        order_mesh mesh;
        order_mesh_create(kinds[k / 2], 3, 0.05, order_wave_field, own_rank, rank_count, &mesh);
        write_and_read_statistics(scenes[k % 2][0], &mesh.mesh, &mesh.field, first);
        for (int i = 1; i < 3; i++) {
            write_and_read_statistics(scenes[k % 2][i], &mesh.mesh, &mesh.field, text);
            bool is_good = true;
            for (int column = CELLS; column <= DEVIATION; column++)
                is_good = is_nearly_equal(text, column, read_last_number(first, column)) && is_good;
            everywhere(is_good);
        }
        order_mesh_free(&mesh);
    }
}

static void numbers_are_the_same_on_any_ranks(void **state)
{
    (void)state;
    static char text[MOST], all[MOST];
    for (int k = 0; k < order_kind_count; k++) {
        order_mesh part, whole;
        if (is_left_out(k)) continue;
        order_mesh_create(&order_kinds[k], 3, 0.05, order_wave_field, own_rank, rank_count, &part);
        order_mesh_create(&order_kinds[k], 3, 0.05, order_wave_field, own_rank ? MOST : 0, own_rank ? 2 * MOST : 1,
                          &whole);
        write_and_read_statistics(BINS NEAR, &part.mesh, &part.field, text);
        write_and_read_statistics(BINS NEAR, &whole.mesh, &whole.field, all);
        everywhere(is_same(text, all));
        order_mesh_free(&part);
        order_mesh_free(&whole);
    }
}

/* Makes a mesh of both orders from rows of 27 nodes: cells whose number is no multiple of `quadratic` become the linear
 * hexes of their corners. offsets, types and connectivity are memory for all cells. */
static void mix_types(const order_mesh *mesh, int quadratic, int ranks, int64_t *offsets, unsigned char *types,
                      int64_t *connectivity, insitu_mesh *out)
{
    int64_t at = 0;
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        const int64_t number = ranks > 1 ? cell * ranks + own_rank : cell;
        const bool is_linear = number % quadratic != 0;
        offsets[cell] = at;
        types[cell] = is_linear ? INSITU_HEX : INSITU_TRIQUADRATIC_HEX;
        for (int n = 0; n < (is_linear ? 8 : 27); n++) connectivity[at++] = mesh->connectivity[cell * mesh->nodes + n];
    }
    offsets[mesh->cell_count] = at;
    *out = mesh->mesh;
    out->connectivity.data = connectivity;
    out->connectivity_count = at;
    out->offsets = (insitu_array){offsets, INSITU_INT64, 0};
    out->cell_types = (insitu_array){types, INSITU_UINT8, 0};
}

/* Checks that linear cells in a mesh with cells of higher order have the same statistics as in a mesh of linear cells
 * only, which most ranks' parts are. */
static void linear_cells_count_as_in_linear_meshes(void **state)
{
    (void)state;
    static const char *const scenes[] = {BINS FAR, BINS "finer_pieces: 3\n" FAR};
    static char text[MOST], all[MOST];
    static int64_t offsets[28], connectivity[27 * 27];
    static unsigned char types[28];
    for (int i = 0; i < 2; i++) {
        order_mesh part, whole;
        insitu_mesh mesh;
        order_mesh_create(&hex_27, 3, 0.05, order_wave_field, own_rank, rank_count, &part);
        order_mesh_create(&hex_27, 3, 0.05, order_wave_field, own_rank ? MOST : 0, own_rank ? 2 * MOST : 1, &whole);
        mix_types(&part, 5 * rank_count, rank_count, offsets, types, connectivity, &mesh);
        write_and_read_statistics(scenes[i], &mesh, &part.field, text);
        mix_types(&whole, 5 * rank_count, 1, offsets, types, connectivity, &mesh);
        write_and_read_statistics(scenes[i], &mesh, &whole.field, all);
        everywhere(is_same(text, all));
        order_mesh_free(&part);
        order_mesh_free(&whole);
    }
}

/* ---- shells ------------------------------------------------------------------------------------------------------ */

static double compute_shell_height(double x, double y)
{
    return 0.3 * x * x + 0.2 * x * y - 0.2 * y * y;
}

/* Integrates 1, x^2 and x^4 over the graph of compute_shell_height() by the midpoint rule on n x n squares and on half
 * as many along each axis. Combining the two eliminates the leading error; the remaining one is of the order 1 / n^4,
 * and below 1e-9. */
static void integrate_graph(double out[3])
{
    double sums[2][3] = {{0}};
    for (int way = 0; way < 2; way++) {
        const int n = way ? 800 : 400;
        for (int i = 0; i < n * n; i++) {
            const double x = -1 + 2 * (i % n + 0.5) / n, y = -1 + 2 * (i / n + 0.5) / n; /* NOLINT */
            const double slopes[2] = {0.6 * x + 0.2 * y, 0.2 * x - 0.4 * y};
            const double area = 4. / n / n * sqrt(1 + slopes[0] * slopes[0] + slopes[1] * slopes[1]);
            sums[way][0] += area;
            sums[way][1] += area * x * x;
            sums[way][2] += area * x * x * x * x;
        }
    }
    for (int i = 0; i < 3; i++) out[i] = (4 * sums[1][i] - sums[0][i]) / 3;
}

/* Checks four quads of 9 nodes or eight triangles of 6 nodes, dealt to the ranks, on the graph of a polynomial of order
 * 2. */
static void bent_shells_have_their_areas(void **state)
{
    (void)state;
    static char text[MOST], finer[MOST];
    static const signed char quad[9][2] = {{0, 0}, {2, 0}, {2, 2}, {0, 2}, {1, 0}, {2, 1}, {1, 2}, {0, 1}, {1, 1}};
    static const signed char triangles[2][6][2] = {{{0, 0}, {2, 0}, {2, 2}, {1, 0}, {2, 1}, {1, 1}},
                                                   {{0, 0}, {2, 2}, {0, 2}, {1, 1}, {1, 2}, {0, 1}}};
    double coordinates[25][3], values[25], expected[3];
    integrate_graph(expected);
    for (int v = 0; v < 25; v++) {
        const double x = -1 + 0.5 * (v % 5), y = -1 + 0.5 * (v / 5); /* NOLINT */
        memcpy(coordinates[v], (const double[3]){x, y, compute_shell_height(x, y)}, sizeof coordinates[v]);
        values[v] = x * x;
    }
    for (int of = 0; of < 2; of++) {
        const int nodes = of ? 6 : 9, cells = of ? 8 : 4;
        int64_t connectivity[48], entries = 0;
        for (int cell = own_rank; cell < cells; cell += rank_count)
            for (int n = 0; n < nodes; n++) {
                const int square = of ? cell / 2 : cell;
                const signed char *at = of ? triangles[cell % 2][n] : quad[n];
                connectivity[entries++] = 2 * (square % 2) + at[0] + 5 * (2 * (square / 2) + at[1]);
            }
        insitu_mesh mesh;
        insitu_field field;
        insitu_mesh_defaults(&mesh);
        insitu_mesh_interleaved(&mesh, coordinates, INSITU_FLOAT64);
        mesh.vertex_count = 25;
        mesh.cell_type = of ? INSITU_QUADRATIC_TRIANGLE : INSITU_BIQUADRATIC_QUAD;
        mesh.cell_count = entries / nodes;
        mesh.connectivity = (insitu_array){connectivity, INSITU_INT64, 0};
        mesh.connectivity_count = entries;
        insitu_field_defaults(&field);
        field.name = "f";
        field.values = (insitu_array){values, INSITU_FLOAT64, 0};
        field.count = 25;
        write_and_read_statistics(OF_F "finer_pieces: 1\n" NEAR, &mesh, &field, text);
        const double mean = expected[1] / expected[0];
        everywhere(own_rank || strstr(text, ",area,"));
        everywhere(is_nearly_equal(text, VOLUME, expected[0]) && is_nearly_equal(text, MEAN, mean) &&
                   is_nearly_equal(text, DEVIATION, sqrt(expected[2] / expected[0] - mean * mean)));
        write_and_read_statistics(OF_F "finer_pieces: 4\n" NEAR, &mesh, &field, finer);
        everywhere(is_same(text, finer));
    }
}

/* ---- histograms, percentiles, and cells that do not count -------------------------------------------------------- */

/* Checks that a bin has the volume of the quadrature points whose values are in it. Along x there are two cells with 4
 * points each, and two of these points are in each bin. */
static void bins_have_the_volumes_of_the_points_in_them(void **state)
{
    (void)state;
    static char text[MOST];
    order_mesh mesh;
    order_mesh_create(&hex_27, 2, 0, order_plane_field, own_rank, rank_count, &mesh);
    for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.values[v] = mesh.coordinates[3 * v];
    write_and_read_statistics("statistics: [{field: f, path: s.csv, histogram: {bins: 4}}]\n" FAR, &mesh.mesh,
                              &mesh.field, text);
    for (int bin = 0; bin < 4; bin++) everywhere(is_nearly_equal(text, FIRST_BIN + bin, 0.25));
    /* values above 0.5 are in no bin */
    write_and_read_statistics("statistics: [{field: f, path: s.csv, histogram: {bins: 3, range: [-1, 0.5]}}]\n" FAR,
                              &mesh.mesh, &mesh.field, text);
    for (int bin = 0; bin < 3; bin++) everywhere(is_nearly_equal(text, FIRST_BIN + bin, 0.25));
    order_mesh_free(&mesh);
}

/* Computes two percentiles of the cells' middle values; a cell's middle is half way between the least and the greatest
 * value at its nodes. */
static void find_percentiles(const order_mesh *whole, const int percents[2], double out[2])
{
    double middles[27];
    for (int64_t cell = 0; cell < whole->cell_count; cell++) {
        double low = INFINITY, high = -INFINITY;
        for (int n = 0; n < whole->nodes; n++) {
            const double value = whole->values[whole->connectivity[cell * whole->nodes + n]];
            low = fmin(low, value);
            high = fmax(high, value);
        }
        middles[cell] = 0.5 * low + 0.5 * high;
    }
    qsort(middles, 27, sizeof *middles, compare_doubles);
    for (int i = 0; i < 2; i++) out[i] = middles[(int)ceil(percents[i] / 100. * 27) - 1];
}

static drawn draw_slice(const char *pieces, const char *range, const order_mesh *mesh)
{
    char scene[1024];
    snprintf(scene, sizeof scene,
             "finer_pieces: %s\nimages:\n  - name: a\n    size: [48, 36]\n    layers: [{slice: {field: f, range: %s, "
             "planes: [{normal: [1, 2, 3]}]}}]\n    outputs: [{path: a.png}]\n",
             pieces, range);
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, scene, &mesh->mesh, &mesh->field);
    drawn out = step_and_take_pictures(session, 0);
    insitu_destroy(&session);
    return out;
}

/* Checks that a slice coloured between two percentiles equals the slice coloured between the values of these
 * percentiles, however many pieces are drawn. */
static void percentiles_count_the_callers_cells(void **state)
{
    (void)state;
    static const char *const pieces[] = {"1", "3"};
    const int percents[2] = {20, 70};
    for (int i = 0; i < 4; i++) {
        const order_kind *kind = i / 2 ? &hex_20 : &hex_27;
        order_mesh part, whole;
        double values[2];
        char range[64];
        order_mesh_create(kind, 3, 0.05, order_wave_field, own_rank, rank_count, &part);
        order_mesh_create(kind, 3, 0.05, order_wave_field, 0, 1, &whole);
        find_percentiles(&whole, percents, values);
        snprintf(range, sizeof range, "[%.17g, %.17g]", values[0], values[1]);
        drawn by_values = draw_slice(pieces[i % 2], range, &part);
        drawn by_percentiles = draw_slice(pieces[i % 2], "{percentile: [20, 70]}", &part);
        everywhere(own_rank || are_same_picture_sets(&by_values, &by_percentiles));
        free_picture_set(&by_values);
        free_picture_set(&by_percentiles);
        order_mesh_free(&part);
        order_mesh_free(&whole);
    }
}

/* Checks that a cell with a value that is not finite at one node does not count: the other cells have 7 of the 8 units
 * of volume. */
static void cells_with_missing_values_do_not_count(void **state)
{
    (void)state;
    static char text[MOST];
    static const char *const scenes[] = {OF_F "finer_pieces: 1\n" FAR, OF_F "finer_pieces: 2\n" FAR};
    for (int i = 0; i < 2; i++) {
        order_mesh mesh;
        order_mesh_create(&hex_27, 2, 0, order_plane_field, own_rank, rank_count, &mesh);
        for (int64_t v = 0; v < mesh.vertex_count; v++) {
            const double *at = mesh.coordinates + 3 * v;
            if (fabs(at[0] + 0.5) + fabs(at[1] + 0.5) + fabs(at[2] + 0.5) < 1e-9) mesh.values[v] = NAN;
        }
        write_and_read_statistics(scenes[i], &mesh.mesh, &mesh.field, text);
        everywhere(is_nearly_equal(text, CELLS, 7) && is_nearly_equal(text, VOLUME, 7));
        order_mesh_free(&mesh);
    }
}

/* Checks mirrored cells, which are inverted: their volumes are positive, and their statistics are those of the cells
 * before mirroring. */
static void inverted_cells_have_exact_volumes(void **state)
{
    (void)state;
    static char text[MOST], mirrored[MOST];
    order_mesh mesh;
    order_mesh_create(&tet_10, 2, 0.05, order_wave_field, own_rank, rank_count, &mesh);
    write_and_read_statistics(OF_F FAR, &mesh.mesh, &mesh.field, text);
    for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.coordinates[3 * v] *= -1;
    write_and_read_statistics(OF_F FAR, &mesh.mesh, &mesh.field, mirrored);
    everywhere(is_same(text, mirrored));
    order_mesh_free(&mesh);
}

/* Checks values whose squares overflow: their deviation must not. */
static void large_values_do_not_overflow(void **state)
{
    (void)state;
    static char text[MOST];
    order_mesh mesh;
    order_mesh_create(&hex_20, 2, 0, compute_bent_field, own_rank, rank_count, &mesh);
    for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.values[v] *= 0x1p1000;
    write_and_read_statistics(OF_F FAR, &mesh.mesh, &mesh.field, text);
    everywhere(own_rank || fabs(read_last_number(text, DEVIATION) * 0x1p-1000 - 2. / 3) < 1e-8);
    order_mesh_free(&mesh);
}

static int set_up_test_group(void **state)
{
    (void)state;
    return enter_test_folder("order_statistics") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bent_cells_have_the_moments_of_their_polynomials),
        cmocka_unit_test(cell_values_have_the_volumes_of_bent_cells),
        cmocka_unit_test(corner_values_count_per_cell),
        cmocka_unit_test(nodes_at_lobatto_points_are_recognised),
        cmocka_unit_test(numbers_do_not_depend_on_pieces_and_cameras),
        cmocka_unit_test(numbers_of_derived_fields_do_not_depend_on_pieces),
        cmocka_unit_test(numbers_are_the_same_on_any_ranks),
        cmocka_unit_test(linear_cells_count_as_in_linear_meshes),
        cmocka_unit_test(bent_shells_have_their_areas),
        cmocka_unit_test(bins_have_the_volumes_of_the_points_in_them),
        cmocka_unit_test(percentiles_count_the_callers_cells),
        cmocka_unit_test(cells_with_missing_values_do_not_count),
        cmocka_unit_test(inverted_cells_have_exact_volumes),
        cmocka_unit_test(large_values_do_not_overflow),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, NULL);
}
