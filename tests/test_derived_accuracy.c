/* Compares quantities derived from gradients of an ABC flow, away from the border, with closed forms and with VTK's
 * gradient filter. Grids are hexes and tets, regular and jittered. Q is interpolated as in a slice. With
 * INSITU_TEST_WHOLE the test includes the finest grids and also measures time. */
#include <math.h>
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <cmocka.h>

#include "insitu/insitu.h"
#include "session.h"
#include "session_scalars.h"
#include "test_derived_vtk.h"
#include "test_effort.h"
#include "test_meshes.h"

static const double a = 1.7320508075688772, b = 1.4142135623730951, c = 1, k = 3.14159265358979324;

static void evaluate_velocity(const double p[3], double u[3])
{
    u[0] = a * sin(k * p[2]) + c * cos(k * p[1]);
    u[1] = b * sin(k * p[0]) + a * cos(k * p[2]);
    u[2] = c * sin(k * p[1]) + b * cos(k * p[0]);
}

static double compute_exact_q_criterion(const double p[3])
{
    const double xy = -k * c * sin(k * p[1]), xz = k * a * cos(k * p[2]), yx = k * b * cos(k * p[0]);
    const double yz = -k * a * sin(k * p[2]), zx = -k * b * sin(k * p[0]), zy = k * c * cos(k * p[1]);
    return -(xy * yx + xz * zx + yz * zy);
}

typedef struct sample_sums {
    double ours, vtks, square, curl, divergence, of_curl;
    int64_t count;
} sample_sums;

/* Adds the errors at a point. The exact curl of the flow is k times the velocity. */
static void add_sample_to_sums(const double p[3], const double values[6], sample_sums *sums)
{
    double u[3];
    const double q = compute_exact_q_criterion(p);
    evaluate_velocity(p, u);
    sums->ours += (values[0] - q) * (values[0] - q);
    sums->vtks += (values[1] - q) * (values[1] - q);
    sums->square += q * q;
    sums->divergence += values[5] * values[5];
    for (int i = 0; i < 3; i++) {
        sums->curl += (values[2 + i] - k * u[i]) * (values[2 + i] - k * u[i]);
        sums->of_curl += k * k * u[i] * u[i];
    }
    sums->count++;
}

/* Computes interpolation weights of a hex's or a tet's corners at one of eight inner points. */
static void find_weights(int corners, int place, double weights[8])
{
    static const int bits[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    double sum = 0;
    for (int i = 0; i < corners; i++) {
        weights[i] = 1;
        if (corners == 4) weights[i] = 0.1 + test_uniform((uint64_t)(4 * place + i), 7);
        for (int axis = 0; axis < 3 && corners == 8; axis++)
            weights[i] *= (bits[i] >> axis & 1) == (place >> axis & 1) ? 0.8 : 0.2;
        sum += weights[i];
    }
    for (int i = 0; i < corners; i++) weights[i] /= sum;
}

/* Sums the errors at eight points in each cell away from the border. nodes: the six numbers at each vertex that
 * add_sample_to_sums() compares. */
static sample_sums compare_with_exact(const test_mesh *mesh, const double (*nodes)[6])
{
    sample_sums sums = {0};
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        const int64_t *vertices = mesh->connectivity + mesh->offsets[cell];
        const int corners = (int)(mesh->offsets[cell + 1] - mesh->offsets[cell]);
        for (int place = 0; place < 8; place++) {
            double weights[8], p[3] = {0}, values[6] = {0};
            find_weights(corners, place, weights);
            for (int i = 0; i < corners; i++) {
                for (int axis = 0; axis < 3; axis++) p[axis] += weights[i] * mesh->coordinates[3 * vertices[i] + axis];
                for (int n = 0; n < 6; n++) values[n] += weights[i] * nodes[vertices[i]][n];
            }
            if (fabs(p[0]) < 0.5 && fabs(p[1]) < 0.5 && fabs(p[2]) < 0.5) add_sample_to_sums(p, values, &sums);
        }
    }
    return sums;
}

static const session_mesh *get_session_mesh(const insitu_session *session)
{
    return session_find_mesh(&session->meshes, "m");
}

static double get_vertex_value(const insitu_session *session, const char *name, int component, int64_t vertex)
{
    const grid_field values = session_get_caller_values(get_session_mesh(session),
                                                        session_find_field(get_session_mesh(session), name), component);
    return grid_field_value(&values, vertex);
}

static insitu_field describe_velocity(const test_mesh *mesh, const float *velocity)
{
    insitu_field u;
    insitu_field_defaults(&u);
    u.name = "u";
    u.component_count = 3;
    u.count = mesh->vertex_count;
    u.values = (insitu_array){velocity, INSITU_FLOAT32, 0};
    return u;
}

static insitu_session *open_session_with_mesh_and_velocity(const test_mesh *mesh, const float *velocity,
                                                           const char *scene)
{
    insitu_session *session = NULL;
    insitu_mesh given;
    const insitu_field u = describe_velocity(mesh, velocity);
    assert_int_equal(insitu_create_from_text(MPI_COMM_SELF, scene, &session), INSITU_OK);
    insitu_mesh_defaults(&given);
    given.vertex_count = mesh->vertex_count;
    insitu_mesh_interleaved(&given, mesh->coordinates, INSITU_FLOAT64);
    given.cell_count = mesh->cell_count;
    given.cell_type = (insitu_cell_type)mesh->types[0];
    given.connectivity_count = mesh->connectivity_count;
    given.connectivity = (insitu_array){mesh->connectivity, INSITU_INT64, 0};
    assert_int_equal(insitu_set_mesh(session, "m", &given), INSITU_OK);
    assert_int_equal(insitu_set_field(session, "m", &u), INSITU_OK);
    return session;
}

static float *make_velocity(const test_mesh *mesh)
{
    float *velocity = calloc((size_t)mesh->vertex_count * 3, sizeof *velocity);
    assert_non_null(velocity);
    for (int64_t v = 0; v < mesh->vertex_count; v++) {
        double u[3];
        evaluate_velocity(mesh->coordinates + 3 * v, u);
        for (int i = 0; i < 3; i++) velocity[3 * v + i] = (float)u[i];
    }
    return velocity;
}

/* Relative errors. ours: of the library's Q; vtks: of VTK's Q; curl: of the vorticity; divergence: divergence divided
 * by the magnitude of the vorticity. */
typedef struct grid_errors {
    double ours, vtks, curl, divergence;
} grid_errors;

static grid_errors measure_errors(test_mesh_kind kind, int n, double jitter)
{
    test_mesh mesh;
    test_mesh_make_lattice(kind, n, jitter, test_linear_field, &mesh);
    float *velocity = make_velocity(&mesh);
    double *q = calloc((size_t)mesh.vertex_count, sizeof *q),
           (*nodes)[6] = calloc((size_t)mesh.vertex_count, sizeof *nodes);
    assert_true(q && nodes);
    test_vtk_compute_q_criterion(mesh.vertex_count, mesh.coordinates, mesh.cell_count, mesh.types[0], mesh.connectivity,
                                 velocity, 1, q);
    insitu_session *session = open_session_with_mesh_and_velocity(
        &mesh, velocity,
        "fields: {q: {q_criterion: u}, w: {vorticity: u}, d: {divergence: u}, all: q + w.x + d}\nimages: [{name: "
        "a, when: {field: all, above: 1e30}, layers: [{slice: {field: q}}]}]\n");
    assert_int_equal(insitu_step(session, 0, 0), INSITU_OK);
    for (int64_t v = 0; v < mesh.vertex_count; v++) {
        nodes[v][0] = get_vertex_value(session, "q", 0, v);
        nodes[v][1] = q[v];
        for (int i = 0; i < 3; i++) nodes[v][2 + i] = get_vertex_value(session, "w", i, v);
        nodes[v][5] = get_vertex_value(session, "d", 0, v);
    }
    const sample_sums sums = compare_with_exact(&mesh, (const double(*)[6])nodes);
    insitu_destroy(&session);
    free(velocity);
    free(q);
    free(nodes);
    test_mesh_free(&mesh);
    return (grid_errors){sqrt(sums.ours / sums.square), sqrt(sums.vtks / sums.square), sqrt(sums.curl / sums.of_curl),
                         sqrt(sums.divergence / sums.of_curl)};
}

static void q_criterion_is_as_accurate_as_vtks(void **state)
{
    (void)state;
    for (test_mesh_kind kind = TEST_TETS; kind <= TEST_HEXES; kind++)
        for (int jittered = 0; jittered < 2; jittered++) {
            double before = 0;
            for (int n = 8; n <= test_case_count(16, 32); n *= 2) {
                const grid_errors e = measure_errors(kind, n, jittered ? 0.2 : 0);
                fprintf(
                    stderr,
                    "%s%s, n = %2d: Q %.4f, VTK's %.4f, ratio %.3f, of order %.2f; vorticity %.4f, divergence %.4f\n",
                    test_mesh_kind_name(kind), jittered ? ", jittered" : "", n, e.ours, e.vtks, e.ours / e.vtks,
                    before > 0 ? log2(before / e.ours) : 0, e.curl, e.divergence);
                before = e.ours;
                assert_true(e.ours <= 1.02 * e.vtks);
            }
        }
}

/* Returns the time that a step with new velocities takes to compute Q at all vertices for a slice. It is the minimum
 * over several steps. */
static double measure_q_criterion_time(const test_mesh *mesh, const float *velocity)
{
    static const char scene[] = "threads: 1\nfields: {q: {q_criterion: u}}\nimages: [{name: a, size: [8, 8], layers: "
                                "[{slice: {field: q, range: [0, 1]}}], outputs: [{path: /dev/null/a.png}]}]\n";
    double least = INFINITY;
    insitu_session *session = open_session_with_mesh_and_velocity(mesh, velocity, scene);
    for (int run = 0; run < 5; run++) {
        insitu_field u = describe_velocity(mesh, velocity);
        assert_int_equal(insitu_set_field(session, "m", &u), INSITU_OK);
        insitu_step(session, run, 0);
        least = fmin(least, insitu_last_report(session)->prepare_ms / 1e3);
    }
    insitu_destroy(&session);
    return least;
}

/* Compares the library's time with VTK's. The bounds are the library's own targets. Both run on one thread, not at the
 * same time. */
static void q_criterion_takes_less_time_than_vtks(void **state)
{
    (void)state;
    if (!test_is_long_run()) skip();
    for (test_mesh_kind kind = TEST_TETS; kind <= TEST_HEXES; kind++) {
        test_mesh mesh;
        test_mesh_make_lattice(kind, 48, 0.2, test_linear_field, &mesh);
        float *velocity = make_velocity(&mesh);
        double *q = calloc((size_t)mesh.vertex_count, sizeof *q);
        assert_non_null(q);
        const double vtks = test_vtk_compute_q_criterion(mesh.vertex_count, mesh.coordinates, mesh.cell_count,
                                                         mesh.types[0], mesh.connectivity, velocity, 5, q);
        const double ours = measure_q_criterion_time(&mesh, velocity);
        fprintf(stderr, "%s: Q of %lld vertices in %.1f ms, VTK in %.1f ms, ratio %.3f\n", test_mesh_kind_name(kind),
                (long long)mesh.vertex_count, 1e3 * ours, 1e3 * vtks, ours / vtks);
        assert_true(ours <= (kind == TEST_TETS ? 0.5 : 0.4) * vtks);
        free(velocity);
        free(q);
        test_mesh_free(&mesh);
    }
}

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(q_criterion_is_as_accurate_as_vtks),
        cmocka_unit_test(q_criterion_takes_less_time_than_vtks),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    MPI_Finalize();
    return failed;
}
