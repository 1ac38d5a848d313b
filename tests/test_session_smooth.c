/* Checks normals from gradients at vertices. They are compared with gradients that this file computes at every vertex
 * in double and draws as three fields that colour the surface, and with the exact gradient if the field is linear.
 * Pictures must be bit-identical for any partition. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "render.h"
#include "session.h"
#include "test_session_fixture.h"

enum { SIDE = 4, WIDTH = 56, HEIGHT = 48, PIXELS = WIDTH * HEIGHT, MAX_ENDS = 512 };
enum { NX, NY, NZ, VALUE, LAYER, SURFACE, CHANNELS };

#define SCENE(layer)                                                                                                   \
    "images:\n  - name: a\n    size: [56, 48]\n    camera: {position: [3, 2.2, 4], focal: [0, 0, 0], angle: 40}\n"     \
    "    layers:\n" layer "    outputs: [{path: a.exr, data: true}]\n"
#define SMOOTH(more) "      - isosurface: {field: f, values: [0.1, 0.6], normals: vertex" more "}\n"
#define PLAIN "      - isosurface: {field: f, values: [0.1, 0.6]}\n"
#define COLOURED(field) "      - isosurface: {field: f, values: [0.1, 0.6], colour_by: {field: " field "}}\n"

/* ---- gradients at vertices, by Gaussian elimination ------------------------------------------------------------ */

static void *allocate_zeroed(int64_t count, size_t size)
{
    void *out = calloc((size_t)count, size);
    assert_non_null(out);
    return out;
}

typedef struct gradients {
    double (*sum)[4]; /* sum of the weighted gradients, and (last number) sum of the weights */
    double *component[3];
} gradients;

/* Solves a 3 × 3 system by Gaussian elimination, in place. The last column of x is the right-hand side, and becomes the
 * solution. Returns false if the system is singular. */
static bool solve_by_gaussian_elimination(double x[3][4], double *determinant)
{
    *determinant = 1;
    for (int c = 0; c < 3; c++) {
        int pivot = c;
        for (int r = c + 1; r < 3; r++)
            if (fabs(x[r][c]) > fabs(x[pivot][c])) pivot = r;
        if (x[pivot][c] == 0) return false;
        for (int k = 0; k < 4; k++) {
            const double swap = x[c][k];
            x[c][k] = x[pivot][k];
            x[pivot][k] = swap;
        }
        *determinant *= x[c][c];
        for (int r = 0; r < 3; r++)
            for (int k = 3; k >= c && r != c; k--) x[r][k] -= x[r][c] / x[c][c] * x[c][k];
    }
    for (int c = 0; c < 3; c++) x[c][3] /= x[c][c];
    return true;
}

/* Adds the gradient in one corner of a cell, with its weight. The corner and the other ends of its three edges are
 * given by position and value. */
static void add_corner(gradients *g, int64_t vertex, const double corner[4], const double ends[3][4])
{
    double x[3][4], determinant, squares = 0;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 4; k++) x[i][k] = ends[i][k] - corner[k];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) squares += x[i][k] * x[i][k];
    if (!solve_by_gaussian_elimination(x, &determinant)) return;
    const double weight = fabs(determinant) / pow(squares, 2);
    for (int k = 0; k < 3; k++) g->sum[vertex][k] += weight * x[k][3];
    g->sum[vertex][3] += weight;
}

static void get_vertex_and_value(const test_mesh *mesh, int64_t vertex, double out[4])
{
    memcpy(out, mesh->coordinates + 3 * vertex, 3 * sizeof *out);
    out[3] = mesh->values[vertex];
}

static void add_corner_gradient(gradients *g, const test_mesh *mesh, const int64_t *cell, int corner, int a, int b,
                                int c)
{
    double at[4], ends[3][4];
    get_vertex_and_value(mesh, cell[corner], at);
    get_vertex_and_value(mesh, cell[a], ends[0]);
    get_vertex_and_value(mesh, cell[b], ends[1]);
    get_vertex_and_value(mesh, cell[c], ends[2]);
    add_corner(g, cell[corner], at, (const double(*)[4])ends);
}

static void add_cell_gradients(gradients *g, const test_mesh *mesh, int type, const int64_t *cell)
{
    /* maps a hex's vertex to its corner of the unit cube, as three bits, and back */
    static const int around[8] = {0, 1, 3, 2, 4, 5, 7, 6};
    for (int i = 0; i < 8 && type == INSITU_HEX; i++)
        add_corner_gradient(g, mesh, cell, i, around[around[i] ^ 1], around[around[i] ^ 2], around[around[i] ^ 4]);
    for (int i = 0; i < 4 && type == INSITU_TET; i++)
        add_corner_gradient(g, mesh, cell, i, (i + 1) % 4, (i + 2) % 4, (i + 3) % 4);
    for (int i = 0; i < 6 && type == INSITU_WEDGE; i++)
        add_corner_gradient(g, mesh, cell, i, i / 3 * 3 + (i + 1) % 3, i / 3 * 3 + (i + 2) % 3, (i + 3) % 6);
    for (int i = 0; i < 4 && type == INSITU_PYRAMID; i++) {
        add_corner_gradient(g, mesh, cell, i, (i + 1) % 4, (i + 3) % 4, 4);
        add_corner_gradient(g, mesh, cell, 4, i, (i + 1) % 4, (i + 2) % 4);
    }
}

/* Adds the gradients of a polyhedron, which is divided into tets. Its centre is the mean of its vertices, each counted
 * once. */
static void add_polyhedron(gradients *g, const test_mesh *mesh, const int64_t *faces, int64_t face_count)
{
    int64_t known[MAX_ENDS];
    int count = 0;
    double centre[4] = {0};
    for (int64_t f = 0; f < face_count; f++)
        for (int64_t i = mesh->face_offsets[faces[f]]; i < mesh->face_offsets[faces[f] + 1]; i++) {
            const int64_t vertex = mesh->face_connectivity[i];
            int at = 0;
            while (at < count && known[at] != vertex) at++;
            if (at == count) known[count++] = vertex;
        }
    for (int i = 0; i < count; i++) {
        double node[4];
        get_vertex_and_value(mesh, known[i], node);
        for (int k = 0; k < 4; k++) centre[k] += node[k] / count;
    }
    for (int64_t f = 0; f < face_count; f++) {
        const int64_t first = mesh->face_offsets[faces[f]], corners = mesh->face_offsets[faces[f] + 1] - first;
        for (int64_t i = 0; i < corners; i++) {
            double at[4], ends[3][4];
            get_vertex_and_value(mesh, mesh->face_connectivity[first + i], at);
            get_vertex_and_value(mesh, mesh->face_connectivity[first + (i + 1) % corners], ends[0]);
            get_vertex_and_value(mesh, mesh->face_connectivity[first + (i + corners - 1) % corners], ends[1]);
            memcpy(ends[2], centre, sizeof centre);
            add_corner(g, mesh->face_connectivity[first + i], at, (const double(*)[4])ends);
        }
    }
}

static void solve_gradients(const test_mesh *mesh, gradients *g)
{
    g->sum = allocate_zeroed(mesh->vertex_count, sizeof *g->sum);
    for (int k = 0; k < 3; k++) g->component[k] = allocate_zeroed(mesh->vertex_count, sizeof *g->component[k]);
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        const int64_t *const entries = mesh->connectivity + mesh->offsets[cell];
        if (mesh->types[cell] == INSITU_POLYHEDRON)
            add_polyhedron(g, mesh, entries, mesh->offsets[cell + 1] - mesh->offsets[cell]);
        else
            add_cell_gradients(g, mesh, mesh->types[cell], entries);
    }
    for (int64_t v = 0; v < mesh->vertex_count; v++)
        for (int k = 0; k < 3; k++) g->component[k][v] = g->sum[v][k] / g->sum[v][3];
}

static void gradients_free(gradients *g)
{
    free(g->sum);
    for (int k = 0; k < 3; k++) free(g->component[k]);
}

/* ---- pictures -------------------------------------------------------------------------------------------------- */

/* Draws the scene. If g is not NULL, the mesh, which is then the whole mesh, also gets the fields "gx", "gy" and
 * "gz". */
static caught_picture draw_with_gradients(MPI_Comm comm, const char *scene, const session_input *in, const gradients *g)
{
    static const char *const names[] = {"gx", "gy", "gz"};
    insitu_session *session = NULL;
    discard_pictures();
    insitu_status status = insitu_create_from_text(comm, scene, &session);
    if (!status) status = submit_input(session, in);
    for (int k = 0; k < 3 && g && !status; k++) {
        insitu_field field;
        insitu_field_defaults(&field);
        field.name = names[k];
        field.count = in->part.vertex_count;
        field.values = (insitu_array){g->component[k], INSITU_FLOAT64, 0};
        status = insitu_set_field(session, "m", &field);
    }
    if (!status) status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    assert_int_equal(status, INSITU_OK);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

/* ---- meshes ---------------------------------------------------------------------------------------------------- */

static double compute_swirl_field(const double p[3])
{
    return sin(2.1 * p[0] + 0.3) * cos(1.7 * p[1]) + 0.4 * p[2] * p[2] - 0.3 * p[0] * p[2] + 0.2 * p[1];
}

/* A mesh of each kind, and lattices of hexes and of mixed cells that are converted to polyhedra, all or in part. */
typedef struct mesh_case {
    const char *name;
    test_mesh_kind kind;
    double as_polyhedra; /* fraction of the cells that are converted */
} mesh_case;

static const mesh_case cases[] = {
    {"tets", TEST_TETS, 0},
    {"hexes", TEST_HEXES, 0},
    {"wedges", TEST_WEDGES, 0},
    {"pyramids", TEST_PYRAMIDS, 0},
    {"mixed", TEST_MIXED, 0},
    {"hexes as polyhedra", TEST_HEXES, 1},
    {"mixed, half of them polyhedra", TEST_MIXED, 0.5},
    {"polyhedra", TEST_POLYHEDRA, 0}, /* some are concave; must be last, because its tolerance differs */
};
enum { CASES = sizeof cases / sizeof *cases };

static void describe_input(session_input *in)
{
    input_describe(in);
    in->mesh.keep_polyhedra = 1;
}

static void whole_create(const mesh_case *c, test_function *f, session_input *whole)
{
    *whole = (session_input){0};
    test_mesh_make_lattice(c->kind, SIDE, 0.2, f, &whole->part);
    if (c->as_polyhedra > 0) test_mesh_to_polyhedra(&whole->part, c->as_polyhedra);
    describe_input(whole);
}

/* ---- normals --------------------------------------------------------------------------------------------------- */

/* Returns the largest sine of the angle between the drawn and the expected normal, over all pixels that show a surface.
 * The expected normal is `gradient` or, if it is NULL, the values of the three pictures. *pixels: number of these
 * pixels; *far: number of those in which the sine exceeds 3e-4. */
static double find_largest_angle(const caught_picture *picture, const caught_picture *expected, const double *gradient,
                                 int *pixels, int *far)
{
    double worst = 0;
    *pixels = *far = 0;
    for (int i = 0; i < PIXELS; i++) {
        double n[3], g[3], cross = 0, length = 0;
        if (picture->data[LAYER * PIXELS + i] < 0) continue;
        ++*pixels;
        for (int k = 0; k < 3; k++) {
            n[k] = (double)picture->data[(NX + k) * PIXELS + i];
            g[k] = gradient ? gradient[k] : (double)expected[k].data[VALUE * PIXELS + i];
            length += g[k] * g[k];
        }
        for (int k = 0; k < 3; k++) {
            const double c = n[(k + 1) % 3] * g[(k + 2) % 3] - n[(k + 2) % 3] * g[(k + 1) % 3];
            cross += c * c;
        }
        worst = test_larger_error(worst, sqrt(cross / length));
        *far += !(sqrt(cross / length) <= 3e-4);
    }
    return worst;
}

/* Compares normals with gradients drawn as fields. Components of gradients are between -3 and 3, and gradients are at
 * least 0.3 long on these surfaces. Each component, drawn as a field, has an error of some units of 6e-8 × 3, and the
 * position's error of 1.5e-5 (test_session_surfaces.c) times the component's own slope, at most 6. Together this is
 * 9e-5, or 3e-4 of a gradient's length. Polyhedra interpolate fields differently in two cases. Near quads the field is
 * bilinear, as in an adjacent hex. If tets of a polyhedron overlap, the field is the sum over the overlapping tets, but
 * the normal is that of one tet. Therefore only nine of ten pixels must be right for the case of polyhedra with
 * triangular faces, some of which are concave. */
static void normals_are_the_interpolated_gradients(void **state)
{
    static const char *const scenes[] = {SCENE(COLOURED("gx")), SCENE(COLOURED("gy")), SCENE(COLOURED("gz"))};
    (void)state;
    for (int c = 0; c < CASES && own_rank == 0; c++) {
        session_input whole;
        gradients g;
        caught_picture expected[3];
        int pixels, far;
        if (cases[c].as_polyhedra > 0) continue;
        whole_create(&cases[c], compute_swirl_field, &whole);
        solve_gradients(&whole.part, &g);
        caught_picture smooth = draw_with_gradients(MPI_COMM_SELF, SCENE(SMOOTH("")), &whole, NULL);
        for (int k = 0; k < 3; k++) expected[k] = draw_with_gradients(MPI_COMM_SELF, scenes[k], &whole, &g);
        const double worst = find_largest_angle(&smooth, expected, NULL, &pixels, &far);
        printf("%s: %d pixels, normals within %.2g of the interpolated gradients, %d beyond 3e-4\n", cases[c].name,
               pixels, worst, far);
        assert_true(pixels > 300 && far <= (cases[c].kind == TEST_POLYHEDRA ? pixels / 10 : 0));
        free_caught(&smooth);
        for (int k = 0; k < 3; k++) free_caught(&expected[k]);
        gradients_free(&g);
        input_free(&whole);
    }
}

/* Checks a linear field. The lattice's coordinates are doubles, so that each gradient is accurate to some units of
 * 1e-16 divided by a corner's determinant. The remaining error is the rounding of gradients, coordinates and normals to
 * float32, some units of 6e-8. */
static void a_linear_field_has_its_gradient(void **state)
{
    static const double gradient[3] = {0.3, -0.7, 0.5};
    (void)state;
    for (int c = 0; c < CASES && own_rank == 0; c++) {
        session_input whole;
        int pixels, far;
        whole_create(&cases[c], test_linear_field, &whole);
        caught_picture smooth = draw_with_gradients(MPI_COMM_SELF, SCENE(SMOOTH("")), &whole, NULL);
        const double worst = find_largest_angle(&smooth, NULL, gradient, &pixels, &far);
        if (!(worst < 1e-6)) fprintf(stderr, "%s: off by %g\n", cases[c].name, worst);
        assert_true(pixels > 300 && worst < 1e-6);
        free_caught(&smooth);
        input_free(&whole);
    }
}

/* ---- convergence ----------------------------------------------------------------------------------------------- */

static void compute_swirl_gradient(const double p[3], double out[3])
{
    out[0] = 2.1 * cos(2.1 * p[0] + 0.3) * cos(1.7 * p[1]) - 0.3 * p[2];
    out[1] = -1.7 * sin(2.1 * p[0] + 0.3) * sin(1.7 * p[1]) + 0.2;
    out[2] = 0.8 * p[2] - 0.3 * p[0];
}

/* Returns the mean angle in degrees between the drawn normals and the gradient of the function. */
static double measure_mean_angle(test_mesh_kind kind, int side, const char *scene)
{
    render_camera camera;
    session_input whole = {0};
    double sum = 0;
    int count = 0;
    render_camera_look_at(&camera, (const double[]){3, 2.2, 4}, (const double[]){0, 0, 0}, (const double[]){0, 1, 0},
                          40, WIDTH, HEIGHT);
    test_mesh_make_lattice(kind, side, 0.2, compute_swirl_field, &whole.part);
    describe_input(&whole);
    caught_picture picture = draw_with_gradients(MPI_COMM_SELF, scene, &whole, NULL);
    for (int i = 0; i < PIXELS; i++) {
        double base[3], direction[3], place[3], g[3], dot = 0, length = 0;
        if (picture.data[LAYER * PIXELS + i] < 0) continue;
        render_camera_ray(&camera, i % WIDTH, i / WIDTH, base, direction);
        for (int k = 0; k < 3; k++) place[k] = base[k] + (double)picture.depth[i] * direction[k];
        compute_swirl_gradient(place, g);
        for (int k = 0; k < 3; k++) {
            dot += g[k] * (double)picture.data[(NX + k) * PIXELS + i];
            length += g[k] * g[k];
        }
        sum += acos(fmin(1, fabs(dot) / sqrt(length))) * 180 / M_PI;
        count++;
    }
    free_caught(&picture);
    input_free(&whole);
    return sum / count;
}

/* Checks the order of errors. Gradients in cells have errors of first order in the cells' size. At vertices the errors
 * of first order cancel, except at the boundary and because of the jitter. Therefore the errors at vertices must be
 * smaller than those in cells, and must be more than halved if the cells' size is halved. */
static void smooth_normals_are_nearer_to_the_exact_gradient(void **state)
{
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_HEXES, TEST_POLYHEDRA};
    static const char *const names[] = {"gradient", "vertex"};
    static const char *const scenes[] = {SCENE(PLAIN), SCENE(SMOOTH(""))};
    (void)state;
    for (int k = 0; k < 3 && own_rank == 0; k++) {
        double off[2][2];
        for (int n = 0; n < 2; n++) {
            for (int fine = 0; fine < 2; fine++) off[n][fine] = measure_mean_angle(kinds[k], fine ? 24 : 12, scenes[n]);
            printf("%s: normals by %s are off by %.3f degrees on 12^3 cubes, %.3f on 24^3\n",
                   test_mesh_kind_name(kinds[k]), names[n], off[n][0], off[n][1]);
        }
        assert_true(off[1][0] < off[0][0] && off[1][1] < off[0][1] && off[1][1] < 0.5 * off[1][0]);
    }
}

/* ---- on any partition ------------------------------------------------------------------------------------------ */

/* Makes this rank's part, or, if with_ghosts is set, the whole mesh, in which cells of other ranks are ghosts. The
 * cells are listed in an order of this rank's own. */
static void part_create(const test_mesh *whole, test_partition_kind distributed, bool with_ghosts, session_input *out)
{
    int *owners = allocate_zeroed(whole->cell_count, sizeof *owners);
    int *all = allocate_zeroed(whole->cell_count, sizeof *all);
    *out = (session_input){0};
    test_partition_cells(whole, distributed, SIDE, rank_count, owners);
    test_mesh_extract_part(whole, with_ghosts ? all : owners, with_ghosts ? 0 : own_rank, &out->part);
    for (int64_t cell = 0; cell < out->part.cell_count && with_ghosts; cell++)
        out->part.ghosts[cell] = owners[cell] != own_rank;
    if (!with_ghosts) test_mesh_reorder_vertices(&out->part, 77 + (uint64_t)own_rank);
    free(owners);
    free(all);
    describe_input(out);
}

/* Checks that all ranks together draw the picture that rank 0 draws from the whole mesh. On other ranks `whole` is not
 * used. */
static void check_same_as_rank_0_alone(const char *name, const char *scene, const session_input *whole,
                                       const session_input *part)
{
    caught_picture ours = draw_with_gradients(MPI_COMM_WORLD, scene, part, NULL), alone = {0};
    bool is_well = true;
    if (own_rank == 0) {
        alone = draw_with_gradients(MPI_COMM_SELF, scene, whole, NULL);
        is_well = are_same_pictures(&ours, &alone);
        if (!is_well) fprintf(stderr, "%s: not the same on %d ranks\n", name, rank_count);
    }
    everywhere(is_well);
    free_caught(&ours);
    free_caught(&alone);
}

static void any_partition_has_the_same_bits(void **state)
{
    (void)state;
    for (int c = 0; c < CASES; c++)
        for (test_partition_kind distributed = 0; distributed < TEST_PARTITION_COUNT; distributed++) {
            session_input whole, part;
            whole_create(&cases[c], compute_swirl_field, &whole);
            part_create(&whole.part, distributed, false, &part);
            check_same_as_rank_0_alone(cases[c].name, SCENE(SMOOTH("")), &whole, &part);
            check_same_as_rank_0_alone(cases[c].name, SCENE(SMOOTH(", opacity: 0.4")), &whole, &part);
            input_free(&part);
            part_create(&whole.part, distributed, true, &part);
            check_same_as_rank_0_alone(cases[c].name, SCENE(SMOOTH("")), &whole, &part);
            input_free(&part);
            input_free(&whole);
        }
}

/* Joins the tets of both halves without merging vertices with equal coordinates. */
static void concatenate_halves(const test_mesh halves[2], test_mesh *out)
{
    *out = (test_mesh){.vertex_count = halves[0].vertex_count + halves[1].vertex_count,
                       .cell_count = halves[0].cell_count + halves[1].cell_count,
                       .connectivity_count = halves[0].connectivity_count + halves[1].connectivity_count};
    out->coordinates = allocate_zeroed(out->vertex_count * 3, sizeof *out->coordinates);
    out->values = allocate_zeroed(out->vertex_count, sizeof *out->values);
    out->connectivity = allocate_zeroed(out->connectivity_count, sizeof *out->connectivity);
    out->offsets = allocate_zeroed(out->cell_count + 1, sizeof *out->offsets);
    out->types = allocate_zeroed(out->cell_count, 1);
    out->ghosts = allocate_zeroed(out->cell_count, 1);
    for (int i = 0; i < 2; i++) {
        const test_mesh *half = &halves[i];
        const int64_t first = i ? halves[0].vertex_count : 0, at = i ? halves[0].connectivity_count : 0;
        memcpy(out->coordinates + 3 * first, half->coordinates, (size_t)half->vertex_count * 3 * sizeof(double));
        memcpy(out->values + first, half->values, (size_t)half->vertex_count * sizeof(double));
        for (int64_t n = 0; n < half->connectivity_count; n++)
            out->connectivity[at + n] = half->connectivity[n] + first;
    }
    for (int64_t cell = 0; cell < out->cell_count; cell++) out->types[cell] = INSITU_TET;
    for (int64_t cell = 0; cell <= out->cell_count; cell++) out->offsets[cell] = 4 * cell;
}

/* Checks a mesh with a crack, on one rank: the cells on the two sides of a plane have separate vertices there, with
 * equal coordinates. */
static void duplicated_vertices_are_merged(void **state)
{
    session_input whole, cracked = {0};
    test_mesh halves[2];
    (void)state;
    if (own_rank > 0) return;
    whole_create(&cases[0], compute_swirl_field, &whole);
    int *owners = allocate_zeroed(whole.part.cell_count, sizeof *owners);
    test_partition_cells(&whole.part, TEST_BLOCK, SIDE, 2, owners);
    for (int i = 0; i < 2; i++) test_mesh_extract_part(&whole.part, owners, i, &halves[i]);
    concatenate_halves(halves, &cracked.part);
    describe_input(&cracked);
    caught_picture one = draw_with_gradients(MPI_COMM_SELF, SCENE(SMOOTH("")), &whole, NULL);
    caught_picture two = draw_with_gradients(MPI_COMM_SELF, SCENE(SMOOTH("")), &cracked, NULL);
    assert_true(cracked.part.vertex_count > whole.part.vertex_count && are_same_pictures(&one, &two));
    free_caught(&one);
    free_caught(&two);
    for (int i = 0; i < 2; i++) test_mesh_free(&halves[i]);
    free(owners);
    input_free(&cracked);
    input_free(&whole);
}

/* Checks that cells with a value that is not finite are not drawn, and do not contribute to the gradients at their
 * vertices. */
static void unusable_cells_contribute_no_gradient(void **state)
{
    (void)state;
    session_input whole, part;
    whole_create(&cases[4], compute_swirl_field, &whole);
    whole.part.values[whole.part.vertex_count / 2] = NAN;
    whole.part.values[whole.part.vertex_count / 3] = INFINITY;
    part_create(&whole.part, TEST_RANDOM, false, &part);
    check_same_as_rank_0_alone("values that are not finite", SCENE(SMOOTH("")), &whole, &part);
    if (own_rank == 0) {
        caught_picture picture = draw_with_gradients(MPI_COMM_SELF, SCENE(SMOOTH("")), &whole, NULL);
        for (int i = 0; i < 3 * PIXELS; i++) assert_true(isfinite(picture.data[i]));
        free_caught(&picture);
    }
    input_free(&part);
    input_free(&whole);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(normals_are_the_interpolated_gradients),
        cmocka_unit_test(a_linear_field_has_its_gradient),
        cmocka_unit_test(smooth_normals_are_nearer_to_the_exact_gradient),
        cmocka_unit_test(any_partition_has_the_same_bits),
        cmocka_unit_test(duplicated_vertices_are_merged),
        cmocka_unit_test(unusable_cells_contribute_no_gradient),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
