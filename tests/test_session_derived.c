/* Checks derived fields: gradients of linear functions are exact on every cell type; expressions are compared with C
 * arithmetic; errors for curved functions decrease with the square of the cell size; results are bit-identical for any
 * partition; unchanged fields are not recomputed; and errors are reported on all ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session.h"
#include "session_scalars.h"
#include "test_effort.h"
#include "test_session_fixture.h"

enum { SIDE = 3, MOST_TEXT = 1 << 14 };

/* A scene that requests the derived field by a condition that never holds, so that the field is computed but the image
 * is never drawn. */
#define SCENE(fields, name)                                                                                            \
    "fields: {" fields "}\nimages:\n  - name: a\n    size: [8, 6]\n    when: {field: " name ", above: 1e30}\n"         \
    "    layers: [{isosurface: {field: " name ", values: [0.1]}}]\n    outputs: [{path: a.png}]\n"

/* ---- input ----------------------------------------------------------------------------------------------------- */

typedef void vector_function(const double position[3], double out[3]);

/* A field of 3 components, stored with a stride of 4 numbers that are floats or doubles. The test owns the array. */
typedef struct vector_field {
    void *values;
    insitu_field field;
} vector_field;

static void compute_value_position(const test_mesh *mesh, insitu_centring centring, int64_t at, double place[3])
{
    if (centring == INSITU_VERTEX) {
        memcpy(place, mesh->coordinates + 3 * at, 3 * sizeof *place);
        return;
    }
    int64_t count = 0;
    place[0] = place[1] = place[2] = 0;
    for (int64_t i = mesh->offsets[at]; i < mesh->offsets[at + 1]; i++, count++)
        for (int a = 0; a < 3; a++) place[a] += mesh->coordinates[3 * mesh->connectivity[i] + a];
    for (int a = 0; a < 3; a++) place[a] /= (double)count;
}

static void make_vector(const test_mesh *mesh, vector_function *f, insitu_centring centring, bool is_wide,
                        const char *name, vector_field *out)
{
    const int64_t count = centring == INSITU_VERTEX ? mesh->vertex_count : mesh->cell_count;
    const int64_t size = is_wide ? 8 : 4;
    out->values = calloc((size_t)(4 * count + 1), (size_t)size);
    assert_non_null(out->values);
    for (int64_t i = 0; i < count; i++) {
        double place[3], value[3];
        compute_value_position(mesh, centring, i, place);
        f(place, value);
        for (int a = 0; a < 3; a++)
            if (is_wide)
                ((double *)out->values)[4 * i + a] = value[a];
            else
                ((float *)out->values)[4 * i + a] = (float)value[a];
    }
    insitu_field_defaults(&out->field);
    out->field.name = name;
    out->field.count = count;
    out->field.component_count = 3;
    out->field.centring = centring;
    out->field.values = (insitu_array){out->values, is_wide ? INSITU_FLOAT64 : INSITU_FLOAT32, 4 * size};
    out->field.component_stride_bytes = size;
}

static insitu_session *open_session_with_velocity(MPI_Comm comm, const char *scene, const session_input *in,
                                                  const vector_field *u)
{
    insitu_session *session = NULL;
    insitu_status status = insitu_create_from_text(comm, scene, &session);
    if (status) fprintf(stderr, "%s\n", insitu_error(NULL));
    assert_int_equal(status, INSITU_OK);
    assert_int_equal(submit_input(session, in), INSITU_OK);
    if (u) assert_int_equal(insitu_set_field(session, "m", &u->field), INSITU_OK);
    return session;
}

static insitu_session *open_stepped(MPI_Comm comm, const char *scene, const session_input *in, const vector_field *u)
{
    insitu_session *session = open_session_with_velocity(comm, scene, in, u);
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    assert_int_equal(status, INSITU_OK);
    return session;
}

static const session_field *find_derived_field(const insitu_session *session, const char *mesh_name, const char *name)
{
    const session_mesh *mesh = session_find_mesh(&session->meshes, mesh_name);
    const int index = session_find_field(mesh, name);
    assert_true(index >= 0 && mesh->fields[index].is_derived && mesh->fields[index].copy);
    return &mesh->fields[index];
}

static double get_derived_value(const insitu_session *session, const char *name, int component, int64_t at)
{
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    find_derived_field(session, "m", name);
    const grid_field values = session_get_caller_values(mesh, session_find_field(mesh, name), component);
    return grid_field_value(&values, at);
}

/* ---- linear functions ------------------------------------------------------------------------------------------- */

static const double slopes[3][3] = {{0.3, -1.1, 0.7}, {0.9, 0.2, -0.4}, {-0.6, 0.5, 1.3}};

static void compute_linear_velocity(const double p[3], double out[3])
{
    for (int c = 0; c < 3; c++) out[c] = slopes[c][0] * p[0] + slopes[c][1] * p[1] + slopes[c][2] * p[2] + 2 - c;
}

/* Returns det(M - x). The middle root is found by bisection between the positions at which its derivative is 0. */
static double compute_shifted_determinant(const double m[3][3], double x)
{
    const double a = m[0][0] - x, b = m[1][1] - x, c = m[2][2] - x;
    return a * (b * c - m[1][2] * m[2][1]) - m[0][1] * (m[1][0] * c - m[1][2] * m[2][0]) +
           m[0][2] * (m[1][0] * m[2][1] - b * m[2][0]);
}

static double find_middle_eigenvalue(const double m[3][3])
{
    const double trace = m[0][0] + m[1][1] + m[2][2];
    const double second = m[0][0] * m[1][1] + m[0][0] * m[2][2] + m[1][1] * m[2][2] - m[0][1] * m[1][0] -
                          m[0][2] * m[2][0] - m[1][2] * m[2][1];
    const double half = sqrt(trace * trace / 9 - second / 3);
    double low = trace / 3 - half, high = trace / 3 + half; /* the determinant increases between low and high */
    for (int i = 0; i < 200; i++) {
        const double middle = 0.5 * (low + high);
        if (compute_shifted_determinant(m, middle) < 0)
            low = middle;
        else
            high = middle;
    }
    return low;
}

typedef struct expected_value {
    const char *name;
    int component;
    double value;
} expected_value;

/* Computes the Q criterion, lambda2 and the strain rate directly from the symmetric part S and the antisymmetric part W
 * of the velocity gradient. */
static void compute_tensor_invariants(double *q, double *lambda2, double *strain)
{
    double s[3][3], w[3][3], m[3][3] = {{0}}, of_s = 0, of_w = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            s[i][k] = (slopes[i][k] + slopes[k][i]) / 2;
            w[i][k] = (slopes[i][k] - slopes[k][i]) / 2;
            of_s += s[i][k] * s[i][k];
            of_w += w[i][k] * w[i][k];
        }
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++) m[i][k] += s[i][j] * s[j][k] + w[i][j] * w[j][k];
    *q = (of_w - of_s) / 2;
    *strain = sqrt(2 * of_s);
    *lambda2 = find_middle_eigenvalue((const double(*)[3])m);
}

#define ALL_KINDS                                                                                                      \
    "g: {gradient: u.y}, gm: {gradient: u.y, component: magnitude}, gz: {gradient: u.y, component: z}, d: "            \
    "{divergence: u}, w: {vorticity: u}, wm: {vorticity: u, component: magnitude}, wx: {vorticity: u, component: 0}, " \
    "q: {q_criterion: u}, l: {lambda2: u}, s: {strain_rate: [u.x, u.y, u.z]}, all: \"g.x + mag(g) + gm + gz + d + "    \
    "w.x + wm + wx + q + l + s\""

static double find_largest_linear_error(const insitu_session *session, const test_mesh *mesh)
{
    double q, lambda2, strain, worst = 0;
    compute_tensor_invariants(&q, &lambda2, &strain);
    const double w[3] = {slopes[2][1] - slopes[1][2], slopes[0][2] - slopes[2][0], slopes[1][0] - slopes[0][1]};
    const double wm = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), *g = slopes[1];
    const double gm = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]), d = slopes[0][0] + slopes[1][1] + slopes[2][2];
    const expected_value expected[] = {
        {"g", 0, g[0]},
        {"g", 1, g[1]},
        {"g", 2, g[2]},
        {"gm", 0, gm},
        {"gz", 0, g[2]},
        {"d", 0, d},
        {"w", 0, w[0]},
        {"w", 1, w[1]},
        {"w", 2, w[2]},
        {"wm", 0, wm},
        {"wx", 0, w[0]},
        {"q", 0, q},
        {"l", 0, lambda2},
        {"s", 0, strain},
        {"all", 0, g[0] + 2 * gm + g[2] + d + 2 * w[0] + wm + q + lambda2 + strain},
    };
    for (size_t i = 0; i < sizeof expected / sizeof *expected; i++)
        for (int64_t v = 0; v < mesh->vertex_count; v++) {
            const double found = get_derived_value(session, expected[i].name, expected[i].component, v);
            worst = test_larger_error(worst, fabs(found - expected[i].value));
        }
    return worst;
}

/* Checks linear velocities. With doubles only rounding errors remain: 1e-15 over the shortest edge, at most 1e-10 for a
 * sliver. Results in float are off by the last bit of a value near 1, divided by an edge of 0.2: 6e-8 * 2 / 0.2. */
static void linear_velocities_are_exact(void **state)
{
    (void)state;
    for (int kind = 0; kind < 2 * TEST_KIND_COUNT; kind++) {
        session_input in = {0};
        if (kind == TEST_KIND_COUNT + TEST_POLYHEDRA) continue; /* these cells are polyhedra already */
        test_mesh_make_lattice((test_mesh_kind)(kind % TEST_KIND_COUNT), SIDE, 0.2, test_wave_field, &in.part);
        if (kind >= TEST_KIND_COUNT) test_mesh_to_polyhedra(&in.part, kind == TEST_KIND_COUNT + TEST_MIXED ? 0.5 : 1);
        input_describe(&in);
        in.mesh.keep_polyhedra = 1;
        for (int is_wide = 0; is_wide < 2; is_wide++) {
            vector_field u;
            make_vector(&in.part, compute_linear_velocity, INSITU_VERTEX, is_wide, "u", &u);
            insitu_session *session = open_stepped(MPI_COMM_SELF, SCENE(ALL_KINDS, "all"), &in, &u);
            const double worst = find_largest_linear_error(session, &in.part);
            if (!(worst < (is_wide ? 1e-9 : 1e-5)))
                fprintf(stderr, "%s%s, %d bytes: %g\n", test_mesh_kind_name((test_mesh_kind)(kind % TEST_KIND_COUNT)),
                        kind >= TEST_KIND_COUNT ? " as polyhedra" : "", is_wide ? 8 : 4, worst);
            everywhere(worst < (is_wide ? 1e-9 : 1e-5));
            insitu_destroy(&session);
            free(u.values);
        }
        input_free(&in);
    }
}

/* ---- expressions ------------------------------------------------------------------------------------------------ */

static void compute_swirl_velocity(const double p[3], double out[3])
{
    out[0] = sin(3 * p[2]) + cos(2 * p[1]) + 0.2;
    out[1] = sin(2 * p[0]) + 1.5 * cos(3 * p[2]);
    out[2] = sin(2 * p[1]) + cos(1.3 * p[0]) - 0.4;
}

#define EXPRESSIONS                                                                                                    \
    "a: \"sqrt(u.x^2 + u.y^2) / (2 + abs(u.z))\", b: \"-u.x^2 + -2 * (u.y - 3e-1) ^ -1 + mag(u)\", "                   \
    "c: \"min(u.x, u.2) + max(u.y, 0.5) * exp(-u.z) - pow(2, u.x)\", "                                                 \
    "d: \"log(3 + u.x) + log10(3 + u.y) + sin(u.z) * cos(u.x) + tan(u.y / 4) + 2^3^0.5 + 7 - 2 - 1\", "                \
    "e: {magnitude: u}, h: {field: u, component: y}, all: a + b + c + d + e + h"

static void compute_expected_expressions(const double u[3], double out[6])
{
    const double length = sqrt(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    out[0] = sqrt(u[0] * u[0] + u[1] * u[1]) / (2 + fabs(u[2]));
    out[1] = -(u[0] * u[0]) - 2 / (u[1] - 0.3) + length;
    out[2] = fmin(u[0], u[2]) + fmax(u[1], 0.5) * exp(-u[2]) - pow(2, u[0]);
    out[3] = log(3 + u[0]) + log10(3 + u[1]) + sin(u[2]) * cos(u[0]) + tan(u[1] / 4) + pow(2, pow(3, 0.5)) + 4;
    out[4] = length;
    out[5] = u[1];
}

static void expressions_match_c_arithmetic(void **state)
{
    (void)state;
    static const char *const names[] = {"a", "b", "c", "d", "e", "h", "all"};
    session_input in = {0};
    input_create(&in, TEST_HEXES, SIDE, TEST_BLOCK, 0, 1);
    for (insitu_centring centring = INSITU_VERTEX; centring <= INSITU_CELL; centring++) {
        vector_field u;
        make_vector(&in.part, compute_swirl_velocity, centring, true, "u", &u);
        insitu_session *session = open_stepped(MPI_COMM_SELF, SCENE(EXPRESSIONS, "all"), &in, &u);
        double worst = 0;
        for (int64_t i = 0; i < u.field.count; i++) {
            double expected[7] = {0};
            compute_expected_expressions((const double *)u.values + 4 * i, expected);
            for (int k = 0; k < 6; k++) expected[6] += expected[k];
            for (int k = 0; k < 7; k++)
                worst = test_larger_error(worst, fabs(get_derived_value(session, names[k], 0, i) - expected[k]) /
                                                     fmax(1, fabs(expected[k])));
        }
        everywhere(worst < 1e-13);
        assert_int_equal(find_derived_field(session, "m", "all")->given.centring, centring);
        insitu_destroy(&session);
        free(u.values);
    }
    input_free(&in);
}

/* ---- partitions -------------------------------------------------------------------------------------------------- */

static int64_t find_vertex(const test_mesh *whole, const double place[3])
{
    for (int64_t v = 0; v < whole->vertex_count; v++)
        if (memcmp(whole->coordinates + 3 * v, place, 3 * sizeof *place) == 0) return v;
    return -1;
}

/* Marks the vertices of all cells that are not ghosts. No other vertex needs a value. */
static bool *mark_used_vertices(const insitu_session *session, const char *mesh)
{
    const grid *g = &session_find_mesh(&session->meshes, mesh)->cells;
    bool *used = calloc((size_t)g->vertex_count + 1, sizeof *used);
    assert_non_null(used);
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        grid_walk walk = grid_walk_cell(g, cell);
        int64_t vertex;
        while (!grid_is_ghost(g, cell) && grid_walk_next(&walk, &vertex)) used[vertex] = true;
    }
    return used;
}

static bool check_same_bits(const insitu_session *parts, const char *mesh, const insitu_session *alone,
                            const test_mesh *part, const test_mesh *whole, const char *name)
{
    const session_field *a = find_derived_field(parts, mesh, name), *b = find_derived_field(alone, "m", name);
    const int64_t size = a->values.stride;
    bool *used = mark_used_vertices(parts, mesh), is_same = a->values.stride == b->values.stride;
    for (int64_t v = 0; v < part->vertex_count && is_same; v++) {
        if (!used[v]) continue;
        const int64_t there = find_vertex(whole, part->coordinates + 3 * v);
        is_same = there >= 0 && memcmp(a->copy + v * size, b->copy + there * size, (size_t)size) == 0;
    }
    free(used);
    if (!is_same) fprintf(stderr, "rank %d of %d: %s differs\n", own_rank, rank_count, name);
    return is_same;
}

#define PARTITION_SCENE                                                                                                \
    SCENE("q: {q_criterion: u}, w: {vorticity: u}, l: {lambda2: u}, mixed: q + w.z + l + c.x", "mixed")

/* Checks that the results do not depend on the number of threads and ranks, the numbering of vertices and cells, the
 * order of a cell's vertices, and ghost cells. */
static void derived_fields_do_not_depend_on_the_partition(void **state)
{
    (void)state;
    static const char *const names[] = {"q", "w", "l", "mixed"};
    static const char scene[] = "threads: 1\n" PARTITION_SCENE, two_threads[] = "threads: 2\n" PARTITION_SCENE;
    for (int kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (test_partition_kind distributed = TEST_BLOCK; distributed <= TEST_RANDOM; distributed++) {
            session_input whole = {0}, in = {0};
            vector_field u, c, whole_u, whole_c;
            test_mesh_make_lattice((test_mesh_kind)kind, SIDE, 0.2, test_wave_field, &whole.part);
            input_describe(&whole);
            extract_own_cells(&whole.part, distributed, SIDE, kind == TEST_HEXES, &in.part);
            if (kind != TEST_POLYHEDRA) test_mesh_reorder_vertices(&in.part, (uint64_t)own_rank + 3);
            input_describe(&in);
            make_vector(&in.part, compute_swirl_velocity, INSITU_VERTEX, kind % 2 == 0, "u", &u);
            make_vector(&whole.part, compute_swirl_velocity, INSITU_VERTEX, kind % 2 == 0, "u", &whole_u);
            make_vector(&in.part, compute_linear_velocity, INSITU_VERTEX, true, "c", &c);
            make_vector(&whole.part, compute_linear_velocity, INSITU_VERTEX, true, "c", &whole_c);
            insitu_session *parts = open_session_with_velocity(MPI_COMM_WORLD, scene, &in, &u);
            assert_int_equal(insitu_set_field(parts, "m", &c.field), INSITU_OK);
            insitu_session *alone = open_session_with_velocity(MPI_COMM_SELF, two_threads, &whole, &whole_u);
            assert_int_equal(insitu_set_field(alone, "m", &whole_c.field), INSITU_OK);
            everywhere(insitu_step(parts, 0, 0) == INSITU_OK);
            everywhere(insitu_step(alone, 0, 0) == INSITU_OK);
            for (size_t i = 0; i < sizeof names / sizeof *names; i++)
                everywhere(check_same_bits(parts, "m", alone, &in.part, &whole.part, names[i]));
            insitu_destroy(&parts);
            insitu_destroy(&alone);
            free(u.values);
            free(c.values);
            free(whole_u.values);
            free(whole_c.values);
            input_free(&in);
            input_free(&whole);
        }
}

/* ---- several meshes ---------------------------------------------------------------------------------------------- */

/* Checks that two parts of a mesh, given as blocks on any ranks, have the same derived fields as the whole mesh:
 * gradients at the border of a block use the cells on both sides. */
static void derived_fields_have_no_seam_between_blocks(void **state)
{
    (void)state;
    static const char *const meshes[] = {"m", "n"};
    const char *const scene = SCENE("q: {q_criterion: u}", "q");
    for (test_partition_kind distributed = TEST_BLOCK; distributed <= TEST_RANDOM; distributed++) {
        session_input whole = {0}, parts[2] = {0};
        vector_field whole_u, u[2];
        test_mesh_make_lattice(TEST_MIXED, SIDE, 0.2, test_wave_field, &whole.part);
        input_describe(&whole);
        make_vector(&whole.part, compute_swirl_velocity, INSITU_VERTEX, true, "u", &whole_u);
        insitu_session *alone = open_stepped(MPI_COMM_SELF, scene, &whole, &whole_u), *session = NULL;
        int *owners = calloc((size_t)whole.part.cell_count, sizeof *owners);
        assert_non_null(owners);
        test_partition_cells(&whole.part, distributed, SIDE, 2 * rank_count, owners);
        assert_int_equal(insitu_create_from_text(MPI_COMM_WORLD, scene, &session), INSITU_OK);
        for (int i = 0; i < 2; i++) {
            test_mesh_extract_part(&whole.part, owners, 2 * own_rank + i, &parts[i].part);
            input_describe(&parts[i]);
            make_vector(&parts[i].part, compute_swirl_velocity, INSITU_VERTEX, true, "u", &u[i]);
            assert_int_equal(insitu_set_mesh(session, meshes[i], &parts[i].mesh), INSITU_OK);
            assert_int_equal(insitu_set_field(session, meshes[i], &u[i].field), INSITU_OK);
        }
        everywhere(insitu_step(session, 0, 0) == INSITU_OK);
        for (int i = 0; i < 2; i++) {
            everywhere(check_same_bits(session, meshes[i], alone, &parts[i].part, &whole.part, "q"));
            free(u[i].values);
        }
        insitu_destroy(&session);
        insitu_destroy(&alone);
        free(whole_u.values);
        free(owners);
        input_free(&whole);
        for (int i = 0; i < 2; i++) input_free(&parts[i]);
    }
}

/* Returns the largest difference of a derived field on one mesh in two sessions. */
static double compare_derived(const insitu_session *a, const insitu_session *b, const char *mesh, const char *name)
{
    const session_mesh *of_a = session_find_mesh(&a->meshes, mesh), *of_b = session_find_mesh(&b->meshes, mesh);
    const grid_field x = session_get_caller_values(of_a, session_find_field(of_a, name), 0);
    const grid_field y = session_get_caller_values(of_b, session_find_field(of_b, name), 0);
    double worst = 0;
    for (int64_t v = 0; v < of_a->cells.vertex_count; v++)
        worst = test_larger_error(worst, fabs(grid_field_value(&x, v) - grid_field_value(&y, v)));
    return worst;
}

/* Checks that gradients use the cells on both sides of the border between two meshes even if the positions of common
 * vertices differ in their last bits. */
static void gradients_merge_vertices_of_meshes_that_differ_in_last_bits(void **state)
{
    (void)state;
    static const char *const meshes[] = {"m", "n"};
    session_input halves[2] = {{.side = 0}};
    vector_field u[2];
    insitu_session *sessions[2];
    for (int i = 0; i < 2; i++) {
        input_create(&halves[i], TEST_MIXED, SIDE, TEST_BLOCK, 2 * own_rank + i, 2 * rank_count);
        make_vector(&halves[i].part, compute_swirl_velocity, INSITU_VERTEX, true, "u", &u[i]);
    }
    for (int moved = 0; moved < 2; moved++) {
        for (int64_t i = 0; i < 3 * halves[1].part.vertex_count && moved; i++)
            halves[1].part.coordinates[i] *= 1 + 0x1p-50;
        assert_int_equal(insitu_create_from_text(MPI_COMM_WORLD, SCENE("q: {q_criterion: u}", "q"), &sessions[moved]),
                         INSITU_OK);
        for (int i = 0; i < 2; i++) {
            assert_int_equal(insitu_set_mesh(sessions[moved], meshes[i], &halves[i].mesh), INSITU_OK);
            assert_int_equal(insitu_set_field(sessions[moved], meshes[i], &u[i].field), INSITU_OK);
        }
        everywhere(insitu_step(sessions[moved], 0, 0) == INSITU_OK);
    }
    for (int i = 0; i < 2; i++) everywhere(compare_derived(sessions[0], sessions[1], meshes[i], "q") < 1e-9);
    for (int i = 0; i < 2; i++) {
        insitu_destroy(&sessions[i]);
        free(u[i].values);
        input_free(&halves[i]);
    }
}

/* Ways in which the second half of the cells loses the field, so that the gradients on the first half change. */
typedef enum loss { BLOCK_REMOVED, RANK_REMOVED, MESH_REMOVED, FIELD_REMOVED, LOSSES } loss;

/* Sets one half of this rank's cells, as a block of the mesh "m" or as a mesh of its own. u: NULL for no field. */
static void set_half(insitu_session *session, loss kind, int half, const session_input *in, const vector_field *u)
{
    const bool is_block = kind == BLOCK_REMOVED || kind == RANK_REMOVED;
    const char *name = half ? "n" : "m";
    if (is_block)
        assert_int_equal(insitu_set_block(session, "m", half, &in->mesh), INSITU_OK);
    else
        assert_int_equal(insitu_set_mesh(session, name, &in->mesh), INSITU_OK);
    if (!u) return;
    if (is_block)
        assert_int_equal(insitu_set_block_field(session, "m", half, &u->field), INSITU_OK);
    else
        assert_int_equal(insitu_set_field(session, name, &u->field), INSITU_OK);
}

static void remove_second_half(insitu_session *session, loss kind, const session_input *in)
{
    if (kind == BLOCK_REMOVED) assert_int_equal(insitu_set_block(session, "m", 1, NULL), INSITU_OK);
    if (kind == RANK_REMOVED && own_rank == rank_count - 1)
        assert_int_equal(insitu_set_mesh(session, "m", NULL), INSITU_OK);
    if (kind == MESH_REMOVED) assert_int_equal(insitu_set_mesh(session, "n", NULL), INSITU_OK);
    if (kind == FIELD_REMOVED) set_half(session, kind, 1, in, NULL);
}

/* Sets what is left after remove_second_half() in a session that has never had more. */
static void set_remaining(insitu_session *session, loss kind, const session_input halves[2], const vector_field u[2])
{
    const bool has_second = kind == RANK_REMOVED || kind == FIELD_REMOVED;
    if (kind == RANK_REMOVED && own_rank == rank_count - 1) return;
    set_half(session, kind, 0, &halves[0], &u[0]);
    if (has_second) set_half(session, kind, 1, &halves[1], kind == FIELD_REMOVED ? NULL : &u[1]);
}

/* Returns whether this rank's parts of the mesh "m" have bit-identical values of a derived field in two sessions. */
static bool have_same_derived_values(const insitu_session *a, const insitu_session *b, const char *name)
{
    const session_parts x = session_find_parts(&a->meshes, "m"), y = session_find_parts(&b->meshes, "m");
    bool are_same = x.count == y.count;
    for (int i = 0; i < x.count && are_same; i++) {
        const session_field *of_a = &x.items[i]->fields[session_find_field(x.items[i], name)];
        const session_field *of_b = &y.items[i]->fields[session_find_field(y.items[i], name)];
        are_same =
            of_a->copy_bytes == of_b->copy_bytes && memcmp(of_a->copy, of_b->copy, (size_t)of_a->copy_bytes) == 0;
    }
    return are_same;
}

/* Checks that gradients at shared vertices are computed again if cells on their other side are removed, on this rank or
 * another, or if these cells' mesh loses the field. They must be those of a new session without these cells. */
static void gradients_forget_removed_neighbours(void **state)
{
    (void)state;
    const char *const scene = SCENE("q: {q_criterion: u}", "q");
    session_input halves[2] = {{.side = 0}};
    vector_field u[2];
    for (int i = 0; i < 2; i++) {
        input_create(&halves[i], TEST_MIXED, SIDE, TEST_RANDOM, 2 * own_rank + i, 2 * rank_count);
        make_vector(&halves[i].part, compute_swirl_velocity, INSITU_VERTEX, true, "u", &u[i]);
    }
    for (loss kind = 0; kind < LOSSES; kind++) {
        insitu_session *old = NULL, *new = NULL;
        if (kind == RANK_REMOVED && rank_count == 1) continue; /* no cells would be left */
        assert_int_equal(insitu_create_from_text(MPI_COMM_WORLD, scene, &old), INSITU_OK);
        assert_int_equal(insitu_create_from_text(MPI_COMM_WORLD, scene, &new), INSITU_OK);
        for (int i = 0; i < 2; i++) set_half(old, kind, i, &halves[i], &u[i]);
        everywhere(insitu_step(old, 0, 0) == INSITU_OK);
        remove_second_half(old, kind, &halves[1]);
        set_remaining(new, kind, halves, u);
        everywhere(insitu_step(old, 1, 0) == INSITU_OK && insitu_step(new, 1, 0) == INSITU_OK);
        everywhere(have_same_derived_values(old, new, "q"));
        insitu_destroy(&old);
        insitu_destroy(&new);
    }
    for (int i = 0; i < 2; i++) {
        free(u[i].values);
        input_free(&halves[i]);
    }
}

/* ---- shells, cells and corners ----------------------------------------------------------------------------------- */

enum { SHEET = 4 };

/* Checks a sheet on the plane z = 0.3 x + 0.2 y that consists of quads and, in every second square, of triangles. The
 * gradients must be those of the function in space without the component normal to the sheet. */
static void gradients_of_shells_are_tangential(void **state)
{
    (void)state;
    enum { ROW = SHEET + 1 };
    double coordinates[ROW * ROW * 3], u[ROW * ROW * 3];
    int offsets[2 * SHEET * SHEET + 1] = {0}, connectivity[6 * SHEET * SHEET], cells = 0, entries = 0;
    unsigned char types[2 * SHEET * SHEET];
    for (int v = 0; v < ROW * ROW; v++) {
        double *p = coordinates + 3 * (ptrdiff_t)v;
        p[0] = 0.2 * (v % ROW) + 0.05 * test_uniform((uint64_t)v, 3);
        p[1] = 0.3 * (double)(v / ROW) + 0.05 * test_uniform((uint64_t)v, 4);
        p[2] = 0.3 * p[0] + 0.2 * p[1];
        compute_linear_velocity(p, u + 3 * (ptrdiff_t)v);
    }
    for (int i = 0; i < SHEET * SHEET; i++) {
        const int at = i / SHEET * ROW + i % SHEET, quad[4] = {at, at + 1, at + ROW + 1, at + ROW};
        const int triangles[6] = {at, at + 1, at + ROW + 1, at, at + ROW + 1, at + ROW};
        for (int part = 0; part <= i % 2; part++) {
            const int count = i % 2 ? 3 : 4;
            memcpy(connectivity + entries, i % 2 ? triangles + 3 * (ptrdiff_t)part : quad,
                   (size_t)count * sizeof *quad);
            types[cells] = i % 2 ? INSITU_TRIANGLE : INSITU_QUAD;
            offsets[++cells] = entries += count;
        }
    }
    insitu_session *session = NULL;
    insitu_mesh mesh;
    insitu_field field;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = ROW * ROW;
    insitu_mesh_interleaved(&mesh, coordinates, INSITU_FLOAT64);
    mesh.cell_count = cells;
    mesh.connectivity_count = entries;
    mesh.connectivity = (insitu_array){connectivity, INSITU_INT32, 0};
    mesh.offsets = (insitu_array){offsets, INSITU_INT32, 0};
    mesh.cell_types = (insitu_array){types, INSITU_UINT8, 0};
    insitu_field_defaults(&field);
    field.name = "u";
    field.component_count = 3;
    field.count = ROW * ROW;
    field.values = (insitu_array){u, INSITU_FLOAT64, 0};
    static const char scene[] = "fields: {g: {gradient: u.z}}\nimages: [{name: a, size: [8, 6], layers: [{surface: "
                                "{colour_by: {field: g}}}], outputs: [{path: a.png}]}]\n";
    assert_int_equal(insitu_create_from_text(MPI_COMM_SELF, scene, &session), INSITU_OK);
    assert_int_equal(insitu_set_mesh(session, "m", &mesh), INSITU_OK);
    assert_int_equal(insitu_set_field(session, "m", &field), INSITU_OK);
    assert_int_equal(insitu_step(session, 0, 0), INSITU_OK);
    const double normal[3] = {-0.3, -0.2, 1}, square = 1.13, *g = slopes[2];
    const double across = (g[0] * normal[0] + g[1] * normal[1] + g[2] * normal[2]) / square;
    double worst = 0;
    for (int v = 0; v < ROW * ROW; v++)
        for (int k = 0; k < 3; k++)
            worst = test_larger_error(worst, fabs(get_derived_value(session, "g", k, v) - (g[k] - across * normal[k])));
    everywhere(worst < 1e-12);
    insitu_destroy(&session);
}

/* Checks velocities at cells and at corners. Velocities at cells are first averaged at the vertices, which is exact for
 * linear functions in a lattice except at its border. Velocities at corners give exact results everywhere. */
static void velocities_at_cells_and_corners_are_supported(void **state)
{
    (void)state;
    enum { LONG = 6 };
    for (int is_of_corners = 0; is_of_corners < 2; is_of_corners++) {
        session_input in = {0};
        vector_field u;
        double worst = 0;
        int64_t count = 0;
        test_mesh_make_lattice(TEST_HEXES, LONG, 0, test_wave_field, &in.part);
        input_describe(&in);
        make_vector(&in.part, compute_linear_velocity, INSITU_CELL, true, "u", &u);
        if (is_of_corners) {
            double *values = calloc((size_t)in.part.connectivity_count * 4, sizeof *values);
            assert_non_null(values);
            for (int64_t i = 0; i < in.part.connectivity_count; i++)
                compute_linear_velocity(in.part.coordinates + 3 * in.part.connectivity[i], values + 4 * i);
            free(u.values);
            u.values = values;
            u.field.values.data = values;
            u.field.count = in.part.connectivity_count;
            u.field.centring = INSITU_CORNER;
        }
        insitu_session *session = open_stepped(MPI_COMM_SELF, SCENE("w: {vorticity: u}, a: \"w.y + f\"", "a"), &in, &u);
        const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
        for (int64_t v = 0; v < session_vertex_count(mesh); v++) {
            double p[3];
            grid_read_vertex_position(&mesh->cells, v, p);
            if (!is_of_corners && fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2]))) > 0.5) continue;
            count++;
            worst =
                test_larger_error(worst, fabs(get_derived_value(session, "w", 1, v) - (slopes[0][2] - slopes[2][0])));
            worst = test_larger_error(worst, fabs(get_derived_value(session, "a", 0, v) -
                                                  (slopes[0][2] - slopes[2][0] + test_wave_field(p))));
        }
        everywhere(worst < 1e-12 && count >= 27);
        insitu_destroy(&session);
        free(u.values);
        input_free(&in);
    }
}

/* ---- what changes ------------------------------------------------------------------------------------------------ */

static int64_t get_field_version(const insitu_session *session, const char *name)
{
    return find_derived_field(session, "m", name)->version;
}

static void set_field_and_step(insitu_session *session, vector_field *u, unsigned changed, int cycle)
{
    u->field.changed = changed;
    assert_int_equal(insitu_set_field(session, "m", &u->field), INSITU_OK);
    everywhere(insitu_step(session, cycle, 0) == INSITU_OK);
}

static void unchanged_derived_fields_are_not_recomputed(void **state)
{
    (void)state;
    session_input in = {0};
    vector_field u;
    input_create(&in, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, rank_count);
    make_vector(&in.part, compute_linear_velocity, INSITU_VERTEX, true, "u", &u);
    insitu_session *session =
        open_stepped(MPI_COMM_WORLD, SCENE("d: {divergence: u}, x: u.x + 0, e: d + x", "e"), &in, &u);
    const double trace = slopes[0][0] + slopes[1][1] + slopes[2][2];
    const int64_t of_d = get_field_version(session, "d"), of_x = get_field_version(session, "x"),
                  of_e = get_field_version(session, "e");
    set_field_and_step(session, &u, INSITU_CHANGED_NOTHING, 1);
    everywhere(get_field_version(session, "d") == of_d && get_field_version(session, "x") == of_x &&
               get_field_version(session, "e") == of_e);
    for (int64_t i = 0; i < 4 * u.field.count; i++) ((double *)u.values)[i] *= 2;
    set_field_and_step(session, &u, INSITU_CHANGED_VALUES, 2);
    everywhere(get_field_version(session, "d") > of_d && get_field_version(session, "e") > of_e);
    everywhere(in.part.cell_count == 0 || fabs(get_derived_value(session, "d", 0, 0) - 2 * trace) < 1e-9);
    /* In a mesh twice as long the slopes are half as large. A field that depends only on values is not recomputed. */
    const int64_t before = get_field_version(session, "x");
    for (int64_t i = 0; i < 3 * in.part.vertex_count; i++) in.part.coordinates[i] *= 2;
    in.mesh.changed = INSITU_CHANGED_GEOMETRY;
    assert_int_equal(insitu_set_mesh(session, "m", &in.mesh), INSITU_OK);
    set_field_and_step(session, &u, INSITU_CHANGED_NOTHING, 3);
    everywhere(get_field_version(session, "x") == before);
    everywhere(in.part.cell_count == 0 || fabs(get_derived_value(session, "d", 0, 0) - trace) < 1e-9);
    insitu_destroy(&session);
    free(u.values);
    input_free(&in);
}

/* Checks that an edited scene computes its own derived fields, even if the previous scene had fields of the same
 * names. */
static void edited_scene_computes_its_own_derived_fields(void **state)
{
    (void)state;
    session_input in = {0};
    vector_field u;
    input_create(&in, TEST_TETS, SIDE, TEST_BLOCK, own_rank, rank_count);
    make_vector(&in.part, compute_linear_velocity, INSITU_VERTEX, true, "u", &u);
    insitu_session *session =
        open_session(MPI_COMM_WORLD, write_scene(SCENE("a: u.x + 0, b: {gradient: a}, c: b.y + f", "c")));
    assert_int_equal(submit_input(session, &in), INSITU_OK);
    set_field_and_step(session, &u, INSITU_CHANGED_ALL, 0);
    everywhere(in.part.cell_count == 0 || fabs(get_derived_value(session, "b", 1, 0) - slopes[0][1]) < 1e-9);
    write_scene(SCENE("longer: u.z + 0, a: {gradient: longer, component: y}, c: a - longer", "c"));
    set_field_and_step(session, &u, INSITU_CHANGED_NOTHING, 1);
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    everywhere(session_find_field(mesh, "b") < 0);
    everywhere(in.part.cell_count == 0 || fabs(get_derived_value(session, "a", 0, 0) - slopes[2][1]) < 1e-9);
    insitu_destroy(&session);
    free(u.values);
    input_free(&in);
}

/* ---- errors ------------------------------------------------------------------------------------------------------ */

typedef struct wrong_case {
    const char *fields, *words[3];
} wrong_case;

static const wrong_case wrong[] = {
    {"q: {q_criterion: f}",
     {"fields.q.q_criterion", "field \"f\" has 1 component on mesh \"m\"", "expected a vector of 2 or 3"}},
    {"q: {vorticity: uu}", {"fields.q: no mesh has the field \"uu\"", "there are", "\"u\" (mesh \"m\")"}},
    {"q: {divergence: velocty}", {"fields.q: no mesh has the field \"velocty\"", "(did you mean velocity?)", ""}},
    {"p: a + 1, a: 2 * nosuch, q: p / 2", {"fields.a: no mesh has the field \"nosuch\"", "of which it is made", ""}},
    {"q: u + 1", {"fields.q: ", "field \"u\" has 3 components on mesh \"m\"", "as u.x, or mag(u)"}},
    {"q: u.3 + 1", {"fields.q: ", "component 3 of field \"u\"", "expected 0 to 2"}},
    {"q: {gradient: u}", {"fields.q.gradient: ", "field \"u\" has 3 components", "expected a scalar, as u.x"}},
    {"q: {lambda2: [f, u, f]}", {"fields.q.lambda2: ", "field \"u\" has 3 components", "expected a scalar, as u.x"}},
    {"q: {field: u, component: 7}", {"fields.q.field: ", "component 7 of field \"u\"", "expected 0 to 2"}},
    {"w: {vorticity: u}, q: w.4 * 2", {"fields.q: ", "component 4 of field \"w\"", "expected 0 to 2"}},
    {"u: f + 1, q: f / 2", {"", "", ""}},
};

/* Checks that each error is reported by the step on all ranks, with its line in the scene, and that an image with other
 * fields is still drawn. */
static void wrong_input_is_reported_on_all_ranks(void **state)
{
    (void)state;
    session_input in = {0};
    vector_field u, velocity;
    input_create(&in, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, rank_count);
    make_vector(&in.part, compute_swirl_velocity, INSITU_VERTEX, true, "u", &u);
    make_vector(&in.part, compute_swirl_velocity, INSITU_VERTEX, true, "velocity", &velocity);
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        char scene[1000];
        const bool is_right = !*wrong[i].words[0];
        snprintf(scene, sizeof scene,
                 "fields: {%s}\nimages:\n  - {name: a, size: [8, 6], layers: [{slice: {field: q}}], outputs: [{path: "
                 "a.png}]}\n  - {name: b, size: [8, 6], layers: [{slice: {field: f}}], outputs: [{path: b.png}]}\n",
                 wrong[i].fields);
        insitu_session *session = open_session_with_velocity(MPI_COMM_WORLD, scene, &in, &u);
        assert_int_equal(insitu_set_field(session, "m", &velocity.field), INSITU_OK);
        for (int cycle = 0; cycle < 2; cycle++) {
            discard_pictures();
            const insitu_status status = insitu_step(session, cycle, 0);
            if (is_right)
                everywhere(status == INSITU_OK);
            else
                check_reported_everywhere(session, status, INSITU_ERROR_FIELD, ":1: ", wrong[i].words[0],
                                          wrong[i].words[1], wrong[i].words[2]);
            everywhere(own_rank != 0 || caught_count == (is_right ? 2 : 1));
        }
        insitu_destroy(&session);
    }
    free(u.values);
    free(velocity.values);
    input_free(&in);
}

/* Checks a derived field with the name of a field that the simulation sets, a misspelt name of a derived field, and a
 * field whose number of components differs on one rank. */
static void name_conflicts_are_reported_on_all_ranks(void **state)
{
    (void)state;
    session_input in = {0};
    vector_field u;
    input_create(&in, TEST_HEXES, SIDE, TEST_BLOCK, own_rank, rank_count);
    make_vector(&in.part, compute_swirl_velocity, INSITU_VERTEX, true, "u", &u);
    insitu_session *session = open_session_with_velocity(MPI_COMM_WORLD, SCENE("f: u.x + 1", "f"), &in, &u);
    insitu_status status = insitu_step(session, 0, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_FIELD,
                              ":1: fields.f: mesh \"m\" has a field of this name already", "expected another name");
    insitu_destroy(&session);
    session = open_session_with_velocity(MPI_COMM_WORLD, SCENE("speed: mag(u)", "sped"), &in, &u);
    status = insitu_step(session, 0, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_FIELD,
                              "no mesh has the field \"sped\" (did you mean speed?)", "there are: ");
    insitu_destroy(&session);
    /* The simulation sets the field only after the first step. */
    session = open_stepped(MPI_COMM_WORLD, SCENE("late: u.x + 1", "late"), &in, &u);
    insitu_field late = in.field;
    late.name = "late";
    assert_int_equal(insitu_set_field(session, "m", &late), INSITU_OK);
    status = insitu_step(session, 1, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_FIELD,
                              "fields.late: mesh \"m\" has a field of this name already");
    insitu_destroy(&session);
    if (rank_count > 1) {
        session = open_session_with_velocity(MPI_COMM_WORLD, SCENE("q: {q_criterion: u}", "q"), &in, NULL);
        if (own_rank == rank_count - 1) u.field.component_count = 2;
        assert_int_equal(insitu_set_field(session, "m", &u.field), INSITU_OK);
        status = insitu_step(session, 0, 0);
        check_reported_everywhere(session, status, INSITU_ERROR_FIELD, "fields.q.q_criterion: rank ", "field \"u\"",
                                  "another centring or number of components");
        insitu_destroy(&session);
    }
    free(u.values);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(linear_velocities_are_exact),
        cmocka_unit_test(expressions_match_c_arithmetic),
        cmocka_unit_test(derived_fields_do_not_depend_on_the_partition),
        cmocka_unit_test(derived_fields_have_no_seam_between_blocks),
        cmocka_unit_test(gradients_merge_vertices_of_meshes_that_differ_in_last_bits),
        cmocka_unit_test(gradients_forget_removed_neighbours),
        cmocka_unit_test(gradients_of_shells_are_tangential),
        cmocka_unit_test(velocities_at_cells_and_corners_are_supported),
        cmocka_unit_test(unchanged_derived_fields_are_not_recomputed),
        cmocka_unit_test(edited_scene_computes_its_own_derived_fields),
        cmocka_unit_test(wrong_input_is_reported_on_all_ranks),
        cmocka_unit_test(name_conflicts_are_reported_on_all_ranks),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
