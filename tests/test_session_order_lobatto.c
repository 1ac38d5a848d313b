/* Checks spectral elements as simulation codes pass them: bent hexes of order 4 and 7 with nodes at Gauss-Lobatto
 * points, without shared nodes or connectivity, dealt to ranks at random. With the default settings of a scene, no hit
 * may be farther from the isosurface of the cells' polynomials than the error bound that the report states, and no ray
 * may continue beyond this surface by more than the bound.
 *
 * The polynomials are evaluated in double, as sums over all nodes of a cell. The reference coordinates of a point on a
 * ray are found by Newton's method, which starts from the inverse of the map that bends the mesh. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_effort.h"
#include "test_mesh_order.h"
#include "test_session_fixture.h"

enum {
    SIZE = 480,
    PIXELS = SIZE * SIZE,
    MOST_ORDER = 7,
    MOST_NODES = (MOST_ORDER + 1) * (MOST_ORDER + 1) * (MOST_ORDER + 1)
};

#define PIXEL (3.2 / SIZE)
#define BEND 0.12
#define EYE_DISTANCE 5.0
#define ISOVALUE 0.1

/* An orthographic view of the origin from an oblique direction. */
static const char scene[] =
    "images:\n  - name: a\n    size: [480, 480]\n    background: [0, 0, 0, 0]\n"
    "    camera: {position: [2, 3, 3.4641016151377544], focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, "
    "height: 3.2}\n"
    "    layers: [isosurface: {field: f, values: [0.1]}]\n    outputs: [{path: a.exr, data: true}]\n";

static double evaluate_field(const double p[3])
{
    return p[2] + 0.4 * sin(2.8 * p[0] + 0.4) * cos(2.5 * p[1]) + 0.2 * p[0] * p[1] * p[2];
}

/* ---- the mesh ---------------------------------------------------------------------------------------------------- */

typedef struct lobatto_mesh {
    int order, side;
    double points[MOST_ORDER + 1];  /* Gauss-Lobatto points, in the interval from 0 to 1 */
    double scales[MOST_ORDER + 1];  /* factors that normalise the Lagrange polynomials of these points */
    double (*nodes)[MOST_NODES][4]; /* position and value of each node of each cell of the whole mesh */
    insitu_mesh mesh;
    insitu_field field;
    double *coordinates, *values; /* nodes and values of this rank's cells */
} lobatto_mesh;

/* Computes the Legendre polynomial of order p and its first two derivatives. */
static void evaluate_legendre(int p, double x, double out[3])
{
    double before = 1, at = x;
    for (int n = 2; n <= p; n++) {
        const double next = ((2 * n - 1) * x * at - (n - 1) * before) / n;
        before = at;
        at = next;
    }
    out[0] = at;
    out[1] = p * (x * at - before) / (x * x - 1);
    out[2] = (2 * x * out[1] - p * (p + 1) * at) / (1 - x * x);
}

/* Finds the Gauss-Lobatto points. The inner points are the zeros of the derivative of the Legendre polynomial; Newton's
 * method starts from Chebyshev points. */
static void compute_lobatto_points(lobatto_mesh *m)
{
    const int p = m->order;
    for (int i = 0; i <= p; i++) {
        double x = -cos(M_PI * i / p), of[3];
        for (int turn = 0; turn < 50 && i > 0 && i < p; turn++) {
            evaluate_legendre(p, x, of);
            x -= of[1] / of[2];
        }
        m->points[i] = i == 0 ? 0 : i == p ? 1 : 0.5 + 0.5 * x;
    }
    for (int i = 0; i <= p; i++) {
        m->scales[i] = 1;
        for (int j = 0; j <= p; j++)
            if (j != i) m->scales[i] /= m->points[i] - m->points[j];
    }
}

static void bend_position(const double point[3], double out[3])
{
    for (int axis = 0; axis < 3; axis++) out[axis] = order_mesh_move_coordinate(BEND, point, axis);
}

static void place_nodes(const lobatto_mesh *m, int cell)
{
    const int n = m->order + 1, cube[3] = {cell % m->side, cell / m->side % m->side, cell / m->side / m->side};
    for (int node = 0; node < n * n * n; node++) {
        const int at[3] = {node % n, node / n % n, node / n / n};
        double point[3];
        for (int a = 0; a < 3; a++) point[a] = -1 + 2 * (cube[a] + m->points[at[a]]) / m->side;
        bend_position(point, m->nodes[cell][node]);
        m->nodes[cell][node][3] = evaluate_field(m->nodes[cell][node]);
    }
}

static bool is_own_cell(int cell)
{
    return (int)(test_uniform((uint64_t)cell, 17) * rank_count) == own_rank;
}

static void make_mesh(int order, int side, lobatto_mesh *m)
{
    const int count = side * side * side, nodes = (order + 1) * (order + 1) * (order + 1);
    *m = (lobatto_mesh){.order = order, .side = side};
    compute_lobatto_points(m);
    m->nodes = malloc((size_t)count * sizeof *m->nodes);
    m->coordinates = malloc((size_t)(count * nodes) * 3 * sizeof(double));
    m->values = malloc((size_t)(count * nodes) * sizeof(double));
    insitu_mesh_defaults(&m->mesh);
    insitu_field_defaults(&m->field);
    for (int cell = 0; cell < count; cell++) {
        place_nodes(m, cell);
        for (int node = 0; node < nodes && is_own_cell(cell); node++, m->mesh.vertex_count++) {
            memcpy(m->coordinates + 3 * m->mesh.vertex_count, m->nodes[cell][node], 3 * sizeof(double));
            m->values[m->mesh.vertex_count] = m->nodes[cell][node][3];
        }
        m->mesh.cell_count += is_own_cell(cell);
    }
    insitu_mesh_interleaved(&m->mesh, m->coordinates, INSITU_FLOAT64);
    m->mesh.cell_type = INSITU_LAGRANGE_HEX;
    m->mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    m->mesh.order = order;
    m->field.name = "f";
    m->field.values = (insitu_array){m->values, INSITU_FLOAT64, 0};
    m->field.count = m->mesh.vertex_count;
}

static void free_mesh(lobatto_mesh *m)
{
    free(m->nodes);
    free(m->coordinates);
    free(m->values);
}

/* ---- the polynomials --------------------------------------------------------------------------------------------- */

/* Position and field at a point of a cell, and their derivatives along the three reference axes. */
typedef struct cell_values {
    double value[4], slopes[3][4];
} cell_values;

/* Computes the values and the derivatives of the Lagrange polynomials at x. */
static void compute_lagrange_weights(const lobatto_mesh *m, double x, double weights[MOST_ORDER + 1],
                                     double derived[MOST_ORDER + 1])
{
    for (int i = 0; i <= m->order; i++) {
        weights[i] = m->scales[i];
        derived[i] = 0;
        for (int j = 0; j <= m->order; j++) {
            if (j == i) continue;
            derived[i] = derived[i] * (x - m->points[j]) + weights[i];
            weights[i] *= x - m->points[j];
        }
    }
}

static void evaluate_cell(const lobatto_mesh *m, int cell, const double at[3], cell_values *out)
{
    const int n = m->order + 1;
    const double(*node)[4] = (const double(*)[4])m->nodes[cell];
    double w[3][MOST_ORDER + 1], d[3][MOST_ORDER + 1];
    for (int a = 0; a < 3; a++) compute_lagrange_weights(m, at[a], w[a], d[a]);
    memset(out, 0, sizeof *out);
    for (int k = 0; k < n; k++) {
        double plane[3][4] = {{0}}; /* sums over two axes: of values, and of derivatives along either axis */
        for (int j = 0; j < n; j++) {
            double row[2][4] = {{0}};
            for (int i = 0; i < n; i++, node++)
                for (int f = 0; f < 4; f++) {
                    row[0][f] += w[0][i] * (*node)[f];
                    row[1][f] += d[0][i] * (*node)[f];
                }
            for (int f = 0; f < 4; f++) {
                plane[0][f] += w[1][j] * row[0][f];
                plane[1][f] += w[1][j] * row[1][f];
                plane[2][f] += d[1][j] * row[0][f];
            }
        }
        for (int f = 0; f < 4; f++) {
            out->value[f] += w[2][k] * plane[0][f];
            out->slopes[0][f] += w[2][k] * plane[1][f];
            out->slopes[1][f] += w[2][k] * plane[2][f];
            out->slopes[2][f] += d[2][k] * plane[0][f];
        }
    }
}

/* Inverts the Jacobian matrix of the position: dual[a][x] is the derivative of the reference coordinate a along axis x
 * of space. */
static void invert_jacobian(const cell_values *of, double dual[3][3])
{
    double determinant = 0;
    for (int a = 0; a < 3; a++)
        for (int x = 0; x < 3; x++) {
            const double *b = of->slopes[(a + 1) % 3], *c = of->slopes[(a + 2) % 3];
            dual[a][x] = b[(x + 1) % 3] * c[(x + 2) % 3] - b[(x + 2) % 3] * c[(x + 1) % 3];
        }
    for (int x = 0; x < 3; x++) determinant += of->slopes[0][x] * dual[0][x];
    for (int a = 0; a < 3; a++)
        for (int x = 0; x < 3; x++) dual[a][x] /= determinant;
}

/* A point in a cell. */
typedef struct cell_point {
    int cell;
    double at[3];
    cell_values of;
    /* gradient: in space; distance: distance from the isosurface to first order, with the sign of field - isovalue */
    double gradient[3], distance;
} cell_point;

static void compute_derivatives(cell_point *p)
{
    double dual[3][3], square = 0;
    invert_jacobian(&p->of, dual);
    for (int x = 0; x < 3; x++) {
        p->gradient[x] = 0;
        for (int a = 0; a < 3; a++) p->gradient[x] += p->of.slopes[a][3] * dual[a][x];
        square += p->gradient[x] * p->gradient[x];
    }
    p->distance = (p->of.value[3] - ISOVALUE) / sqrt(square);
}

/* Finds the reference coordinates of a position in p->cell by Newton's method, which starts from p->at. */
static void find_in_cell(const lobatto_mesh *m, const double position[3], cell_point *p)
{
    for (int turn = 0; turn < 20; turn++) {
        double dual[3][3], rest = 0;
        evaluate_cell(m, p->cell, p->at, &p->of);
        invert_jacobian(&p->of, dual);
        for (int x = 0; x < 3; x++) rest = fmax(rest, fabs(position[x] - p->of.value[x]));
        if (rest < 1e-10) break;
        for (int a = 0; a < 3; a++)
            for (int x = 0; x < 3; x++) p->at[a] += dual[a][x] * (position[x] - p->of.value[x]);
    }
    compute_derivatives(p);
}

/* Computes the point that the exact bend, made of sines, moves to a position. The polynomials approximate this bend, so
 * the point is a first guess for them. */
static void unbend_position(const double position[3], double out[3])
{
    memcpy(out, position, 3 * sizeof *out);
    for (int turn = 0; turn < 12; turn++) {
        double moved[3];
        bend_position(out, moved);
        for (int a = 0; a < 3; a++) out[a] += position[a] - moved[a];
    }
}

/* Finds the cell that contains a position, and its reference coordinates. Returns false if it is outside the mesh. */
static bool find_point(const lobatto_mesh *m, const double position[3], cell_point *p)
{
    double point[3];
    int cube[3];
    unbend_position(position, point);
    for (int turn = 0; turn < 3; turn++) {
        bool is_in = true;
        for (int a = 0; a < 3; a++) {
            if (turn == 0) cube[a] = (int)fmin(fmax(floor((point[a] + 1) * m->side / 2), 0), m->side - 1);
            p->at[a] = (point[a] + 1) * m->side / 2 - cube[a];
        }
        p->cell = cube[0] + m->side * (cube[1] + m->side * cube[2]);
        find_in_cell(m, position, p);
        for (int a = 0; a < 3; a++) { /* the polynomials' faces differ slightly from those of the exact bend */
            const int step = p->at[a] < -1e-9 ? -1 : p->at[a] > 1 + 1e-9 ? 1 : 0;
            if (cube[a] + step < 0 || cube[a] + step >= m->side) return false;
            cube[a] += step;
            is_in = is_in && step == 0;
        }
        if (is_in) return true;
    }
    return true;
}

/* Returns the distance of a position from the isosurface of a cell. The point of the isosurface is found by steps along
 * the gradient. */
static double compute_distance_from_surface(const lobatto_mesh *m, const double position[3], const cell_point *from)
{
    cell_point p = *from;
    for (int turn = 0; turn < 20 && fabs(p.distance) > 1e-10; turn++) {
        double dual[3][3], square = 0;
        invert_jacobian(&p.of, dual);
        for (int x = 0; x < 3; x++) square += p.gradient[x] * p.gradient[x];
        for (int a = 0; a < 3; a++)
            for (int x = 0; x < 3; x++) p.at[a] -= dual[a][x] * p.gradient[x] * p.distance / sqrt(square);
        evaluate_cell(m, p.cell, p.at, &p.of);
        compute_derivatives(&p);
    }
    double square = 0;
    for (int x = 0; x < 3; x++) square += pow(p.of.value[x] - position[x], 2);
    return sqrt(square);
}

/* ---- rays -------------------------------------------------------------------------------------------------------- */

/* Unit vectors of the camera: forward is (-2, -3, -sqrt(12)) / 5, and right is perpendicular to it and to the y
 * axis. */
static const double right[3] = {0.8660254037844386, 0, -0.5};
static const double above[3] = {-0.29999999999999999, 0.80000000000000004, -0.51961524227066314};
static const double forward[3] = {-0.40000000000000002, -0.59999999999999998, -0.69282032302755092};

static void compute_point_on_ray(int pixel, double depth, double out[3])
{
    const double x = (pixel % SIZE + 0.5 - SIZE / 2.0) * PIXEL, y = (SIZE / 2.0 - pixel / SIZE - 0.5) * PIXEL;
    for (int a = 0; a < 3; a++) out[a] = x * right[a] + y * above[a] + (depth - EYE_DISTANCE) * forward[a];
}

/* Computes the depths at which a ray enters and leaves the cube, which is the mesh because its outer faces are flat.
 * Returns false if the ray misses the cube. */
static bool find_cube_interval(int pixel, double *in, double *out)
{
    double base[3];
    compute_point_on_ray(pixel, 0, base);
    *in = -INFINITY;
    *out = INFINITY;
    for (int a = 0; a < 3; a++) {
        const double one = (-1 - base[a]) / forward[a], other = (1 - base[a]) / forward[a];
        *in = fmax(*in, fmin(one, other));
        *out = fmin(*out, fmax(one, other));
    }
    return *out > *in;
}

/* Results over rays. Distances are in pixels. */
typedef struct ray_tally {
    int64_t rays, hits, wrong;
    double farthest; /* largest distance of a hit from the isosurface */
    double deepest;  /* largest distance beyond the isosurface of a point on a ray before its hit */
} ray_tally;

/* Follows a ray up to its hit, or to its end if it has none, and measures how far it continues on the other side of the
 * isosurface, which must not be more than the bound. */
static void follow_ray(const lobatto_mesh *m, int pixel, double from, double to, double bound, ray_tally *t)
{
    const int steps = (int)ceil((to - from) / (0.5 * PIXEL));
    /* side of the isosurface on which the ray is at its first point that is farther away than the bound */
    double side = 0;
    for (int n = 1; n < steps; n++) {
        double position[3];
        cell_point p;
        compute_point_on_ray(pixel, from + (to - from) * n / steps, position);
        if (!find_point(m, position, &p)) continue;
        const double distance = p.distance / PIXEL;
        if (side == 0 && fabs(distance) > bound) side = copysign(1, distance);
        t->deepest = fmax(t->deepest, -side * distance);
    }
}

static void check_ray(const lobatto_mesh *m, int pixel, double depth, double bound, ray_tally *t)
{
    double in, out, position[3];
    cell_point p;
    if (!find_cube_interval(pixel, &in, &out)) {
        t->wrong += isfinite(depth);
        return;
    }
    t->rays++;
    t->hits += isfinite(depth);
    follow_ray(m, pixel, in, fmin(out, depth), bound, t);
    if (!isfinite(depth)) return;
    compute_point_on_ray(pixel, depth, position);
    find_point(m, position, &p);
    t->farthest = fmax(t->farthest, compute_distance_from_surface(m, position, &p) / PIXEL);
}

/* Checks rays of rank 0's picture; each rank checks a part of them. */
static ray_tally check_rays(const lobatto_mesh *m, const caught_picture *picture, double bound)
{
    ray_tally t = {0};
    float *depth = malloc(PIXELS * sizeof *depth);
    if (own_rank == 0) memcpy(depth, picture->depth, PIXELS * sizeof *depth);
    MPI_Bcast(depth, PIXELS, MPI_FLOAT, 0, MPI_COMM_WORLD);
    const int step = test_case_count(97, 1);
    for (int n = own_rank; n * step < PIXELS; n += rank_count)
        check_ray(m, n * step, (double)depth[n * step], bound, &t);
    MPI_Allreduce(MPI_IN_PLACE, &t.rays, 3, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    MPI_Allreduce(MPI_IN_PLACE, &t.farthest, 2, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
    free(depth);
    return t;
}

/* Error of depths in pixels: they are floats up to 7, rounded by 2.4e-7, which is 3.6e-5 of a pixel. The library's
 * positions are relative to the middle of the mesh, and have the same precision. */
#define ROUNDING 1e-4

static void check_order(int order, int side)
{
    lobatto_mesh m;
    char pieces[512];
    double bound = INFINITY;
    int count = 0;
    make_mesh(order, side, &m);
    insitu_session *session = open_session_with_mesh(MPI_COMM_WORLD, scene, &m.mesh, &m.field);
    check_step_succeeds(session, 0);
    snprintf(pieces, sizeof pieces, "%s", insitu_last_report(session)->pieces);
    insitu_destroy(&session);
    caught_picture picture = pop_caught_picture();
    const char *words = strstr(pieces, "within ");
    sscanf(pieces, "mesh \"m\": %d piece", &count);
    if (words) sscanf(words, "within %lf", &bound);
    const ray_tally t = check_rays(&m, &picture, bound);
    if (own_rank == 0)
        printf(
            "order %d: %s; %lld rays, %lld hits: the farthest by %.4f pixels, %.2f of the bound; rays are beyond the "
            "surface by %.4f at most\n",
            order, pieces, (long long)t.rays, (long long)t.hits, t.farthest, t.farthest / bound, t.deepest);
    everywhere(count > 1 && bound <= 0.25 && strstr(pieces, ", of which 0 have no bound") != NULL);
    everywhere(t.wrong == 0 && t.rays > test_case_count(1000, 100000) && t.hits > t.rays / 3);
    everywhere(t.farthest <= bound + ROUNDING && t.deepest <= bound + ROUNDING);
    free_caught(&picture);
    free_mesh(&m);
}

static void hits_of_order_4_are_within_the_bound(void **state)
{
    (void)state;
    check_order(4, 3);
}

static void hits_of_order_7_are_within_the_bound(void **state)
{
    (void)state;
    check_order(7, 3);
}

static int enter_test_group_folder(void **state)
{
    (void)state;
    return enter_test_folder("order_lobatto") ? 0 : 1;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hits_of_order_4_are_within_the_bound),
        cmocka_unit_test(hits_of_order_7_are_within_the_bound),
    };
    return run_session_tests(argc, argv, tests, enter_test_group_folder, NULL);
}
