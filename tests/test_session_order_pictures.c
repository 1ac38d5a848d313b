/* Compares pictures of quadratic tets, drawn with the default settings of a scene, with the isosurfaces of the cells'
 * polynomials. At most 1 pixel in 1000 may be missed, and the median of the distances along rays may be at most 0.1
 * pixel.
 *
 * In straight cells the field along a ray is a quadratic polynomial, whose first root in each cell is computed. Bent
 * cells are divided into small tets, 24 between two nodes: their hits are first guesses for Newton's method, which
 * finds the hits of the polynomials. Cells from files in INSITU_TEST_DATA are not tested if this variable is not
 * set. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_data_cells.h"
#include "test_mesh_order.h"
#include "test_session_fixture.h"

enum { WIDTH = 480, HEIGHT = 360, PIXELS = WIDTH * HEIGHT, NODES = 10, SMALL = 24 };

/* Cells, an isovalue, and an orthographic camera. */
typedef struct subject {
    const char *name;
    data_cells cells;
    double isovalue;
    double eye[3], focal[3], up[3], height; /* height: height of the picture in scene units */
    /* unit vectors of the camera */
    double right[3], above[3], forward[3];
} subject;

/* ---- vectors ----------------------------------------------------------------------------------------------------- */

static void make_unit(double a[3])
{
    const double length = sqrt(dot_product(a, a));
    for (int x = 0; x < 3; x++) a[x] /= length;
}

/* Solves a system of three linear equations by Cramer's rule. Returns false if it has no unique solution. */
static bool solve_linear_system(const double columns[3][3], const double right[3], double out[3])
{
    double product[3];
    cross_product(columns[1], columns[2], product);
    const double determinant = dot_product(columns[0], product);
    for (int i = 0; i < 3; i++) {
        cross_product(columns[(i + 1) % 3], columns[(i + 2) % 3], product);
        out[i] = dot_product(right, product) / determinant;
    }
    return determinant != 0;
}

static void place_camera(subject *s)
{
    for (int x = 0; x < 3; x++) s->forward[x] = s->focal[x] - s->eye[x];
    make_unit(s->forward);
    cross_product(s->forward, s->up, s->right);
    make_unit(s->right);
    cross_product(s->right, s->forward, s->above);
}

/* Transforms a position to camera coordinates: pixels from the left, pixels from the top, and depth in scene units. */
static void transform_to_camera(const subject *s, const double place[3], double out[3])
{
    double to[3];
    for (int x = 0; x < 3; x++) to[x] = place[x] - s->eye[x];
    out[0] = WIDTH / 2.0 + dot_product(to, s->right) * HEIGHT / s->height;
    out[1] = HEIGHT / 2.0 - dot_product(to, s->above) * HEIGHT / s->height;
    out[2] = dot_product(to, s->forward);
}

/* ---- polynomials ------------------------------------------------------------------------------------------------- */

/* Corners between which each node lies; equal for a node at a corner. */
static const int ends[NODES][2] = {{0, 0}, {1, 1}, {2, 2}, {3, 3}, {0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};

/* Computes the polynomials of a cell at barycentric coordinates. nodes: position in camera coordinates and value of
 * each node. */
static void evaluate_cell(const double nodes[NODES][4], const double at[4], double out[4])
{
    for (int f = 0; f < 4; f++) out[f] = 0;
    for (int n = 0; n < NODES; n++) {
        const double a = at[ends[n][0]], b = at[ends[n][1]];
        const double weight = n < 4 ? a * (2 * a - 1) : 4 * a * b;
        for (int f = 0; f < 4; f++) out[f] += weight * nodes[n][f];
    }
}

/* Computes the derivatives of the polynomials along the directions from corner 0 to the other corners. */
static void compute_derivatives(const double nodes[NODES][4], const double at[4], double out[3][4])
{
    double of[4][4] = {{0}};
    for (int n = 0; n < NODES; n++) {
        const int a = ends[n][0], b = ends[n][1];
        for (int f = 0; f < 4; f++) {
            of[a][f] += (n < 4 ? 4 * at[a] - 1 : 4 * at[b]) * nodes[n][f];
            if (n >= 4) of[b][f] += 4 * at[a] * nodes[n][f];
        }
    }
    for (int i = 0; i < 3; i++)
        for (int f = 0; f < 4; f++) out[i][f] = of[i + 1][f] - of[0][f];
}

static void read_cell(const subject *s, int64_t cell, double nodes[NODES][4])
{
    for (int n = 0; n < NODES; n++) {
        const int64_t vertex = s->cells.connectivity[cell * NODES + n];
        transform_to_camera(s, s->cells.coordinates + 3 * vertex, nodes[n]);
        nodes[n][3] = s->cells.values[vertex];
    }
}

static bool is_straight(const double nodes[NODES][4])
{
    bool is_all = true;
    for (int n = 4; n < NODES; n++)
        for (int x = 0; x < 3; x++) {
            const double a = nodes[ends[n][0]][x], b = nodes[ends[n][1]][x];
            is_all = is_all && fabs(nodes[n][x] - 0.5 * (a + b)) <= 1e-9 * (fabs(a) + fabs(b));
        }
    return is_all;
}

/* ---- true hits --------------------------------------------------------------------------------------------------- */

/* A function that for_each_pixel() calls for all pixels whose centres are inside the bounding rectangle of the given
 * positions. */
typedef void pixel_function(const subject *s, const double nodes[NODES][4], const double guess[4], int pixel,
                            double *depths);

static void for_each_pixel(const subject *s, const double nodes[NODES][4], const double (*places)[4], int count,
                           const double guess[4], pixel_function *visit, double *depths)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int n = 0; n < count; n++)
        for (int x = 0; x < 2; x++) {
            low[x] = fmin(low[x], places[n][x]);
            high[x] = fmax(high[x], places[n][x]);
        }
    for (int j = (int)fmax(0, floor(low[1] - 0.5)); j < HEIGHT && j + 0.5 <= high[1] + 1; j++)
        for (int i = (int)fmax(0, floor(low[0] - 0.5)); i < WIDTH && i + 0.5 <= high[0] + 1; i++)
            visit(s, nodes, guess, j * WIDTH + i, depths);
}

/* Finds the first root between 0 and 1 of a quadratic polynomial, which is given by its values at 0, 1/2 and 1; returns
 * INFINITY if there is none. A root is found despite rounding if all nodes of a face have the isovalue. */
static double find_first_root(double left, double middle, double right)
{
    const double a = 2 * (left + right - 2 * middle), b = 4 * middle - 3 * left - right, c = left;
    const double inner = b * b - 4 * a * c;
    double first = INFINITY;
    if (inner < 0) return first;
    const double q = -0.5 * (b + copysign(sqrt(inner), b));
    const double roots[2] = {q / a, c / q};
    for (int i = 0; i < 2; i++)
        if (roots[i] >= -1e-6 && roots[i] <= 1 + 1e-6) first = fmin(first, roots[i]);
    return first;
}

static void intersect_straight_cell(const subject *s, const double nodes[NODES][4], const double guess[4], int pixel,
                                    double *depths)
{
    double columns[3][3], to[3], start[4], slope[4] = {0}, enter = -INFINITY, leave = INFINITY, values[3];
    (void)guess;
    for (int c = 0; c < 3; c++)
        for (int x = 0; x < 3; x++) columns[c][x] = nodes[c + 1][x] - nodes[0][x];
    for (int x = 0; x < 3; x++) to[x] = -nodes[0][x];
    to[0] += pixel % WIDTH + 0.5;
    to[1] += pixel / WIDTH + 0.5;
    if (!solve_linear_system((const double(*)[3])columns, to, start + 1)) return;
    solve_linear_system((const double(*)[3])columns, (const double[]){0, 0, 1}, slope + 1);
    start[0] = 1 - start[1] - start[2] - start[3];
    slope[0] = -slope[1] - slope[2] - slope[3];
    for (int c = 0; c < 4; c++) {
        const double border = -start[c] / slope[c];
        if (slope[c] > 0) enter = fmax(enter, border);
        if (slope[c] < 0) leave = fmin(leave, border);
        if (slope[c] == 0 && start[c] < 0) return;
    }
    if (!(enter < leave)) return;
    for (int n = 0; n < 3; n++) {
        double at[4], out[4];
        for (int c = 0; c < 4; c++) at[c] = start[c] + (enter + 0.5 * n * (leave - enter)) * slope[c];
        evaluate_cell(nodes, at, out);
        values[n] = out[3] - s->isovalue;
    }
    depths[pixel] = fmin(depths[pixel], enter + (leave - enter) * find_first_root(values[0], values[1], values[2]));
}

/* Finds the hit of a bent cell by Newton's method from a nearby guess. A hit outside the cell is ignored, because it
 * belongs to another cell. */
static void intersect_by_newton(const subject *s, const double nodes[NODES][4], const double guess[4], int pixel,
                                double *depths)
{
    double at[4], out[4], slopes[3][4], way[3], rest = INFINITY;
    memcpy(at, guess, sizeof at);
    for (int turn = 0; turn < 12; turn++) {
        evaluate_cell(nodes, at, out);
        compute_derivatives(nodes, at, slopes);
        const double wanted[3] = {pixel % WIDTH + 0.5 - out[0], pixel / WIDTH + 0.5 - out[1], s->isovalue - out[3]};
        double columns[3][3];
        for (int c = 0; c < 3; c++)
            memcpy(columns[c], (const double[]){slopes[c][0], slopes[c][1], slopes[c][3]}, sizeof columns[c]);
        if (!solve_linear_system((const double(*)[3])columns, wanted, way)) return;
        rest = fabs(wanted[0]) + fabs(wanted[1]);
        for (int c = 0; c < 3; c++) at[c + 1] += way[c];
        at[0] = 1 - at[1] - at[2] - at[3];
        if (!(fmin(fmin(at[0], at[1]), fmin(at[2], at[3])) > -0.1)) return;
        /* A cell is a few hundred pixels wide, so `rest`, of the point before, is below 1e-10. */
        if (fabs(way[0]) + fabs(way[1]) + fabs(way[2]) < 1e-13) break;
    }
    if (rest < 1e-9 && fmin(fmin(at[0], at[1]), fmin(at[2], at[3])) > -1e-9)
        depths[pixel] = fmin(depths[pixel], out[2]);
}

/* Number of small boxes along each reference coordinate; boxes outside the cell are not searched. */
enum { BOXES = 2 * SMALL };
typedef double value_lattice[BOXES + 1][BOXES + 1][BOXES + 1];

static void compute_box_corner(const int at[3], double out[4])
{
    for (int c = 0; c < 3; c++) out[c + 1] = (double)at[c] / BOXES;
    out[0] = 1 - out[1] - out[2] - out[3];
}

/* Searches for hits in a small box, half of which may be outside the cell. */
static void intersect_box(const subject *s, const double nodes[NODES][4], value_lattice values, const int first[3],
                          double *depths)
{
    double places[8][4], middle[4], low = INFINITY, high = -INFINITY;
    for (int n = 0; n < 8; n++) {
        const double value = values[first[0] + (n & 1)][first[1] + (n >> 1 & 1)][first[2] + (n >> 2)];
        low = fmin(low, value);
        high = fmax(high, value);
    }
    const double more = 0.1 * (high - low);
    if (low - more > s->isovalue || high + more < s->isovalue) return;
    for (int n = 0; n < 8; n++) {
        double at[4];
        compute_box_corner((const int[]){first[0] + (n & 1), first[1] + (n >> 1 & 1), first[2] + (n >> 2)}, at);
        evaluate_cell(nodes, at, places[n]);
    }
    compute_box_corner(first, middle);
    for (int c = 1; c < 4; c++) middle[c] += 0.5 / BOXES;
    middle[0] = 1 - middle[1] - middle[2] - middle[3];
    for_each_pixel(s, nodes, (const double(*)[4])places, 8, middle, intersect_by_newton, depths);
}

static void intersect_all_boxes(const subject *s, const double nodes[NODES][4], value_lattice values, double *depths)
{
    for (int n = 0; n < (BOXES + 1) * (BOXES + 1) * (BOXES + 1); n++) {
        const int at[3] = {n % (BOXES + 1), n / (BOXES + 1) % (BOXES + 1), n / (BOXES + 1) / (BOXES + 1)};
        double place[4], out[4];
        if (at[0] + at[1] + at[2] > BOXES + 2) continue;
        compute_box_corner(at, place);
        evaluate_cell(nodes, place, out);
        values[at[0]][at[1]][at[2]] = out[3];
    }
    for (int k = 0; k < BOXES; k++)
        for (int j = 0; j + k < BOXES; j++)
            for (int i = 0; i + j + k < BOXES; i++) intersect_box(s, nodes, values, (const int[]){i, j, k}, depths);
}

static double *compute_exact_depths(const subject *s)
{
    double *depths = malloc(PIXELS * sizeof *depths);
    value_lattice *values = malloc(sizeof *values);
    for (int pixel = 0; pixel < PIXELS; pixel++) depths[pixel] = INFINITY;
    for (int64_t cell = 0; cell < s->cells.cell_count; cell++) {
        double nodes[NODES][4];
        read_cell(s, cell, nodes);
        if (is_straight((const double(*)[4])nodes)) {
            for_each_pixel(s, (const double(*)[4])nodes, (const double(*)[4])nodes, NODES, NULL,
                           intersect_straight_cell, depths);
            continue;
        }
        intersect_all_boxes(s, (const double(*)[4])nodes, *values, depths);
    }
    free(values);
    return depths;
}

/* ---- pictures ---------------------------------------------------------------------------------------------------- */

static void draw_part(const subject *s, const char *pieces, caught_picture *out, char report[512])
{
    const data_cells *c = &s->cells;
    char scene[1024];
    int64_t *own = malloc((size_t)(c->cell_count * NODES + 1) * sizeof *own), count = 0;
    for (int64_t cell = own_rank; cell < c->cell_count; cell += rank_count)
        memcpy(own + NODES * count++, c->connectivity + NODES * cell, NODES * sizeof *own);
    insitu_mesh mesh;
    insitu_field field;
    insitu_mesh_defaults(&mesh);
    insitu_field_defaults(&field);
    mesh.vertex_count = field.count = c->vertex_count;
    for (int x = 0; x < 3; x++)
        mesh.coordinates[x] = (insitu_array){c->coordinates + x, INSITU_FLOAT64, 3 * sizeof(double)};
    mesh.cell_count = count;
    mesh.cell_type = INSITU_QUADRATIC_TET;
    mesh.connectivity = (insitu_array){own, INSITU_INT64, 0};
    mesh.connectivity_count = NODES * count;
    field.name = "f";
    field.values = (insitu_array){c->values, INSITU_FLOAT64, 0};
    snprintf(scene, sizeof scene,
             "%simages:\n  - name: a\n    size: [%d, %d]\n    background: [0, 0, 0, 0]\n"
             "    camera: {position: [%.17g, %.17g, %.17g], focal: [%.17g, %.17g, %.17g], up: [%.17g, %.17g, %.17g],\n"
             "      projection: orthographic, height: %.17g}\n"
             "    layers: [isosurface: {field: f, values: [%.17g]}]\n    outputs: [{path: a.exr, data: true}]\n",
             pieces, WIDTH, HEIGHT, s->eye[0], s->eye[1], s->eye[2], s->focal[0], s->focal[1], s->focal[2], s->up[0],
             s->up[1], s->up[2], s->height, s->isovalue);
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, scene, &mesh, &field);
    check_step_succeeds(session, 0);
    snprintf(report, 512, "%s", insitu_last_report(session)->pieces);
    insitu_destroy(&session);
    *out = pop_caught_picture();
    free(own);
}

/* How a picture differs from the exact one. */
typedef struct difference {
    int hits, missed; /* hits: number of exact hits; missed: number of pixels with a hit in only one of the pictures */
    double median, most; /* median and 99.9th percentile of the distances along rays, in pixels */
} difference;

static difference compare_picture(const subject *s, const float *drawn, const double *depths)
{
    difference out = {0, 0, 0, 0};
    double *distances = malloc(PIXELS * sizeof *distances);
    int count = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        const bool is_drawn = isfinite((double)drawn[pixel]), is_true = isfinite(depths[pixel]);
        out.hits += is_true;
        out.missed += is_drawn != is_true;
        if (is_drawn && is_true) distances[count++] = fabs((double)drawn[pixel] - depths[pixel]) * HEIGHT / s->height;
    }
    qsort(distances, (size_t)count, sizeof *distances, compare_doubles);
    if (count > 0) out.median = distances[count / 2];
    if (count > 0) out.most = distances[count - 1 - count / 1000];
    free(distances);
    return out;
}

/* Draws a subject with these keys of the scene, and compares the picture with the true one. */
static difference draw_and_compare(const subject *s, const char *keys, const double *depths)
{
    caught_picture picture;
    difference out = {0, 0, 0, 0};
    char report[512];
    draw_part(s, keys, &picture, report);
    if (own_rank == 0) out = compare_picture(s, picture.depth, depths);
    if (own_rank == 0)
        printf("%s: %d hits, %d missed; median %.4f pixels, 1 in 1000 above %.3f; %s\n", s->name, out.hits, out.missed,
               out.median, out.most, report);
    free_caught(&picture);
    return out;
}

static bool is_within_bars(const difference *d)
{
    return d->missed <= 0.001 * d->hits && d->median <= 0.1;
}

/* The pictures by default are within the bars, those of pieces between nodes are not. Missed pixels are counted in the
 * pictures of all isovalues together, because there may be few hits in one of them. */
static void check_subject(subject *s, int count, const double *isovalues)
{
    static const char *const keys[] = {"", "finer_pieces: 1\n"};
    difference all[2] = {{0, 0, 0, 0}};
    place_camera(s);
    for (int n = 0; n < count; n++) {
        s->isovalue = isovalues[n];
        double *depths = own_rank == 0 ? compute_exact_depths(s) : NULL;
        for (int i = 0; i < 2; i++) {
            const difference own = draw_and_compare(s, keys[i], depths);
            all[i].hits += own.hits;
            all[i].missed += own.missed;
            all[i].median = fmax(all[i].median, own.median);
        }
        free(depths);
    }
    everywhere(own_rank || (all[0].hits > 1000 && is_within_bars(&all[0]) && !is_within_bars(&all[1])));
}

static void straight_tets_match_their_polynomials(void **state)
{
    (void)state;
    char path[1024];
    subject s = {.name = "cylinder_quadratic",
                 .eye = {0.0479802406, 0.143940722, 0.0787881444},
                 .focal = {0, 0, 0.05},
                 .up = {1, 0, 0},
                 .height = 0.09};
    const char *folder = getenv("INSITU_TEST_DATA");
    if (!folder) skip();
    snprintf(path, sizeof path, "%s/cylinder_quadratic.vtu", folder);
    everywhere(data_cells_read_file(path, "velocity_norm", &s.cells) && s.cells.nodes == NODES);
    check_subject(&s, 1, (const double[]){0.5});
    free(s.cells.coordinates);
    free(s.cells.values);
    free(s.cells.connectivity);
}

static double compute_wave_field_value(const double p[3])
{
    return p[0] * p[0] + 0.6 * p[1] * p[1] - 0.5 * p[2] + 0.3 * sin(2 * p[1] + p[2]);
}

/* Bends a block by a quarter of a circle, so that the edges of its cells are curved. */
static void bend_vertices(order_mesh *mesh)
{
    for (int64_t v = 0; v < mesh->vertex_count; v++) {
        double *at = mesh->coordinates + 3 * v;
        const double radius = 1.5 + 0.5 * at[0], angle = 0.7853981633974483 * at[1];
        at[0] = radius * cos(angle) - 1.5;
        at[1] = radius * sin(angle);
    }
}

static void check_bent_block(const char *name, const order_mesh *mesh, double height, int count,
                             const double *isovalues)
{
    subject s = {.name = name,
                 .cells = {INSITU_QUADRATIC_TET, NODES, mesh->vertex_count, mesh->cell_count, mesh->coordinates,
                           mesh->values, mesh->connectivity},
                 .eye = {4, 2, 3},
                 .focal = {-0.1, 0, 0},
                 .up = {0, 0, 1},
                 .height = height};
    check_subject(&s, count, isovalues);
}

static const order_kind tet_10 = {"tet 2", INSITU_QUADRATIC_TET, INSITU_ORDER_VTK, 2};

static void bent_tets_match_their_polynomials(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&tet_10, 4, 0, compute_wave_field_value, 0, 1, &mesh);
    bend_vertices(&mesh);
    check_bent_block("bent block", &mesh, 3.4, 1, (const double[]){0.4});
    order_mesh_free(&mesh);
}

/* ---- a bracket with a hole --------------------------------------------------------------------------------------- */

/* Removes the cells of a block in whose middle |y| and |z| are below 1/2. */
static void cut_hole(order_mesh *mesh)
{
    int64_t count = 0;
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        const int64_t *nodes = mesh->connectivity + NODES * cell;
        double middle[3] = {0};
        for (int n = 0; n < 4; n++)
            for (int x = 0; x < 3; x++) middle[x] += 0.25 * mesh->coordinates[3 * nodes[n] + x];
        if (fmax(fabs(middle[1]), fabs(middle[2])) > 0.5)
            memmove(mesh->connectivity + NODES * count++, nodes, NODES * sizeof *nodes);
    }
    mesh->cell_count = count;
}

/* Moves the vertices towards the middle line such that the hole becomes round and the outside stays square. */
static void round_hole(order_mesh *mesh)
{
    for (int64_t v = 0; v < mesh->vertex_count; v++) {
        double *at = mesh->coordinates + 3 * v;
        const double side = fmax(fabs(at[1]), fabs(at[2])), share = 2 * (1 - side);
        if (side < 0.5) continue;
        const double factor = 1 - share + share * side / hypot(at[1], at[2]);
        at[1] *= factor;
        at[2] *= factor;
    }
}

/* Like the stress in a plate with a hole that is pulled and bent: it is high at two sides of the hole, and falls fast
 * from there. So its isosurfaces are small, and have long borders for their size. */
static double compute_stress(const double p[3])
{
    const double square = fmax(0.25, p[1] * p[1] + p[2] * p[2]);
    return (0.25 / square) * (1 + 1.5 * (p[2] * p[2] - p[1] * p[1]) / square) * exp(-0.5 * p[0] * p[0]) + 0.3 * p[0];
}

static void brackets_match_their_polynomials(void **state)
{
    (void)state;
    order_mesh mesh;
    order_mesh_create(&tet_10, 4, 0, compute_wave_field_value, 0, 1, &mesh);
    cut_hole(&mesh);
    round_hole(&mesh);
    for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.values[v] = compute_stress(mesh.coordinates + 3 * v);
    bend_vertices(&mesh);
    check_bent_block("bracket with a hole", &mesh, 5, 2, (const double[]){0, 1.1});
    order_mesh_free(&mesh);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(straight_tets_match_their_polynomials),
        cmocka_unit_test(bent_tets_match_their_polynomials),
        cmocka_unit_test(brackets_match_their_polynomials),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
