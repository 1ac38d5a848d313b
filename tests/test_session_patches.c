/* Checks values on boundary faces. A vertex of faces that have values must get a value that is bitwise equal to the
 * mean over these faces, which a brute-force search over the whole mesh computes: for any partition of the cells, and
 * for each method of listing the faces. Linear fields must be exact at the vertices for which the header guarantees
 * it. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session.h"
#include "session_cell_faces.h"
#include "test_mesh_make.h"
#include "test_owned_faces.h"
#include "test_session_fixture.h"

enum { SIDE = 4, PATCHES = 2 };

static const char plain_scene[] =
    "images:\n  - name: a\n    size: [40, 30]\n    layers: [{isosurface: {field: c, values: [8]}}]\n"
    "    outputs: [{path: a.exr}]\n";
static const char corner_scene[] = "images:\n  - name: a\n    size: [40, 30]\n    layers:\n"
                                   "      - isosurface: {field: c, values: [8]}\n"
                                   "      - slice: {field: g, planes: [{normal: [1, 0, 0]}]}\n"
                                   "    outputs: [{path: a.exr}]\n";

static test_mesh whole;
static int *owners;

/* ---- expected means --------------------------------------------------------------------------------------------- */

/* Returns a pseudorandom number. The numbers differ by many orders of magnitude, so that sums depend on the order of
 * their terms. */
static double make_scattered_number(double at, uint64_t seed)
{
    uint64_t bits;
    memcpy(&bits, &at, sizeof bits);
    return test_uniform(bits, seed) * pow(10, floor(6 * test_uniform(bits, seed + 1)) - 3);
}

static double compute_cell_value(int64_t cell)
{
    return cell % 17 == 3 ? NAN : make_scattered_number((double)cell, 5);
}

typedef struct boundary_face {
    double centre[3];
    int patch; /* axis perpendicular to the face's wall; walls at z = 1 and z = -1 have no values */
} boundary_face;

/* Returns whether a face is on a wall, and stores its centre and wall. Walls are at 1 and -1, and vertices on them are
 * not moved, so that sums of their coordinates are exact. */
static bool is_on_wall(const double (*points)[3], int64_t count, boundary_face *out)
{
    int wall = -1;
    for (int axis = 0; axis < 3; axis++) {
        bool is_wall = fabs(points[0][axis]) == 1;
        double sum = 0;
        for (int64_t i = 0; i < count; i++) {
            is_wall = is_wall && points[i][axis] == points[0][axis];
            sum += points[i][axis];
        }
        out->centre[axis] = sum / (double)count;
        if (is_wall) wall = axis;
    }
    out->patch = wall;
    return wall >= 0;
}

static double compute_face_value(const boundary_face *face)
{
    const double value = make_scattered_number(face->centre[0] + 8 * face->centre[1] + 64 * face->centre[2], 9);
    if (value < 0.002) return NAN;
    return face->patch == 1 ? (double)(float)value : value; /* patch 1 is given as float32 */
}

static int read_loop(const grid *g, const session_face_loop *loop, double points[8][3])
{
    for (int64_t i = 0; i < loop->size; i++) grid_read_vertex_position(g, session_face_vertex(loop, i), points[i]);
    return (int)loop->size;
}

static bool is_among(const double (*points)[3], int count, const double position[3])
{
    for (int i = 0; i < count; i++)
        if (memcmp(points[i], position, sizeof points[i]) == 0) return true;
    return false;
}

/* Returns the mean of the values on boundary faces around a vertex or, if there are none, of the values of the cells
 * around it. Each cell of the whole mesh has its own faces, so that an interior face is visited twice. */
static double compute_expected_mean(const grid *all, const double position[3])
{
    double cells[256], faces[256];
    int cell_count = 0, face_count = 0;
    for (int64_t cell = 0; cell < all->cell_count; cell++) {
        const session_cell_faces of_cell = session_faces_of_cell(all, cell);
        bool is_at = false;
        for (int64_t f = 0; f < of_cell.count; f++) {
            const session_face_loop loop = session_find_face_loop(&of_cell, f);
            double points[8][3];
            boundary_face face;
            const int count = read_loop(all, &loop, points);
            if (!is_among((const double(*)[3])points, count, position)) continue;
            is_at = true;
            if (!is_on_wall((const double(*)[3])points, count, &face) || face.patch >= PATCHES) continue;
            if (isfinite(compute_face_value(&face))) faces[face_count++] = compute_face_value(&face);
        }
        if (is_at && isfinite(compute_cell_value(cell))) cells[cell_count++] = compute_cell_value(cell);
    }
    return face_count ? compute_mean(faces, face_count) : compute_mean(cells, cell_count);
}

/* ---- input ----------------------------------------------------------------------------------------------------- */

/* How a patch lists its faces. BY_NUMBERS and BY_RANGES require faces that have numbers: those of a mesh with owners
 * (FORM_* of test_owned_faces.h) or of polyhedra. */
typedef enum telling { BY_VERTICES, BY_NUMBERS, BY_RANGES } telling;

enum { MOST_FACES = 8 * 6 * SIDE * SIDE, RUBBISH = 1000000 };

typedef struct part_input {
    test_mesh part;
    owned faces;
    insitu_mesh mesh;
    insitu_field field;
    double *values; /* values of cells */
    insitu_patch patches[MOST_FACES];
    double wide[PATCHES][2 * MOST_FACES]; /* only every second element is used, so that the array has a stride */
    float narrow[PATCHES][MOST_FACES];
    int64_t vertices[PATCHES][8 * MOST_FACES], offsets[PATCHES][MOST_FACES + 1], numbers[PATCHES][MOST_FACES];
    int64_t counts[PATCHES];
} part_input;

static part_input input;

static void add_value(part_input *in, int patch, double value)
{
    const int64_t at = in->counts[patch]++;
    in->wide[patch][2 * at] = value;
    in->wide[patch][2 * at + 1] = NAN;
    in->narrow[patch][at] = (float)value;
}

/* Lists the boundary faces of all cells. Faces of ghost cells get wrong values, so that a mean differs if they are
 * used. */
static void list_boundary_faces_by_cells(part_input *in, const grid *g)
{
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        const session_cell_faces of_cell = session_faces_of_cell(g, cell);
        for (int64_t f = 0; f < of_cell.count; f++) {
            const session_face_loop loop = session_find_face_loop(&of_cell, f);
            double points[8][3];
            boundary_face face;
            const int count = read_loop(g, &loop, points);
            if (!is_on_wall((const double(*)[3])points, count, &face) || face.patch >= PATCHES) continue;
            const int64_t at = in->counts[face.patch];
            int64_t *vertices = in->vertices[face.patch], *offsets = in->offsets[face.patch];
            for (int i = 0; i < count; i++) vertices[offsets[at] + i] = session_face_vertex(&loop, i);
            offsets[at + 1] = offsets[at] + count;
            if (g->connectivity.data && of_cell.table == NULL)
                in->numbers[face.patch][at] = grid_read_index(&g->connectivity, of_cell.first + f);
            add_value(in, face.patch, grid_is_ghost(g, cell) ? RUBBISH : compute_face_value(&face));
        }
    }
}

/* Lists the boundary faces in the numbering of make_owned_faces(). */
static void list_boundary_faces_by_owner(part_input *in)
{
    for (int64_t f = in->faces.inner; f < in->part.face_count; f++) {
        const int64_t first = in->faces.offsets[f], count = in->faces.offsets[f + 1] - first;
        double points[8][3];
        boundary_face face;
        for (int64_t i = 0; i < count; i++)
            memcpy(points[i], in->part.coordinates + 3 * in->faces.vertices[first + i], sizeof points[i]);
        if (!is_on_wall((const double(*)[3])points, count, &face) || face.patch >= PATCHES) continue;
        in->numbers[face.patch][in->counts[face.patch]] = f;
        add_value(in, face.patch, in->part.ghosts[in->faces.owner[f]] ? RUBBISH : compute_face_value(&face));
    }
}

static insitu_array make_patch_values(const part_input *in, int patch, int64_t first)
{
    if (patch == 1) return (insitu_array){in->narrow[patch] + first, INSITU_FLOAT32, 0};
    return (insitu_array){in->wide[patch] + 2 * first, INSITU_FLOAT64, 2 * sizeof(double)};
}

static void add_patch(part_input *in, insitu_patch patch)
{
    in->patches[in->field.patch_count++] = patch;
    in->field.patches = in->patches;
}

static void describe_patches(part_input *in, telling how)
{
    const int base = in->mesh.index_base;
    in->field.patch_count = 0;
    for (int p = 0; p < PATCHES; p++) {
        const int64_t count = in->counts[p];
        insitu_patch patch = {.count = count, .values = make_patch_values(in, p, 0)};
        for (int64_t i = 0; i < count; i++) in->numbers[p][i] += base;
        patch.faces = (insitu_array){in->numbers[p], INSITU_INT64, 0};
        if (how == BY_VERTICES) {
            patch.faces.data = NULL;
            patch.connectivity_count = in->offsets[p][count];
            patch.connectivity = (insitu_array){in->vertices[p], INSITU_INT64, 0};
            if (in->mesh.cell_types.data) patch.offsets = (insitu_array){in->offsets[p], INSITU_INT64, 0};
        }
        if (how != BY_RANGES) add_patch(in, patch);
        for (int64_t i = 0; i < count && how == BY_RANGES; i++)
            add_patch(
                in, (insitu_patch){.count = 1, .first_face = in->numbers[p][i], .values = make_patch_values(in, p, i)});
    }
}

static void describe_input(part_input *in)
{
    describe_part(&in->part, &in->mesh);
    insitu_field_defaults(&in->field);
    in->field.name = "c";
    in->field.centring = INSITU_CELL;
    in->field.count = in->part.cell_count;
    in->field.values = (insitu_array){in->values, INSITU_FLOAT64, 0};
}

/* Creates the part of a rank or, if with_ghosts is set, the whole mesh, in which cells of other ranks are ghosts with
 * wrong values. */
static void part_create(part_input *in, int rank, bool with_ghosts)
{
    int *all = test_calloc((size_t)whole.cell_count, sizeof *all);
    memset(in, 0, sizeof *in);
    test_mesh_extract_part(&whole, with_ghosts ? all : owners, with_ghosts ? 0 : rank, &in->part);
    test_free(all);
    in->values = test_calloc((size_t)in->part.cell_count + 1, sizeof *in->values);
    for (int64_t cell = 0, at = 0; cell < whole.cell_count; cell++) {
        if (!with_ghosts && owners[cell] != rank) continue;
        in->part.ghosts[at] = owners[cell] != rank;
        in->values[at++] = owners[cell] != rank ? RUBBISH : compute_cell_value(cell);
    }
    describe_input(in);
}

static void part_free(part_input *in)
{
    test_mesh_free(&in->part);
    test_free(in->values);
    if (in->faces.owner) free_owned_faces(&in->faces);
}

/* ---- checks --------------------------------------------------------------------------------------------------------
 */

static const session_scalar *get_vertex_means(const session_mesh *mesh)
{
    for (int i = 0; mesh && i < mesh->scalar_count; i++)
        if (mesh->scalars[i].vertex_values) return &mesh->scalars[i];
    return NULL;
}

static bool are_means_right(const insitu_session *session)
{
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    const session_scalar *scalar = get_vertex_means(mesh);
    test_view view;
    bool is_right = scalar != NULL;
    test_view_create(&whole, (test_layout){true, true, true, false, true}, &view);
    unsigned char *is_drawn = test_calloc(mesh ? (size_t)mesh->cells.vertex_count + 1 : 1, 1);
    for (int64_t cell = 0; mesh && cell < mesh->cells.cell_count; cell++) {
        grid_walk walk = grid_walk_cell(&mesh->cells, cell);
        int64_t vertex;
        while (!grid_is_ghost(&mesh->cells, cell) && grid_walk_next(&walk, &vertex)) is_drawn[vertex] = 1;
    }
    for (int64_t v = 0; is_right && v < mesh->cells.vertex_count; v++) {
        double position[3];
        grid_read_vertex_position(&mesh->cells, v, position);
        const double expected = is_drawn[v] ? compute_expected_mean(&view.cells, position) : NAN,
                     found = scalar->vertex_values[v];
        if ((isnan(expected) && isnan(found)) || memcmp(&expected, &found, sizeof found) == 0) continue;
        fprintf(stderr, "vertex %lld at %g %g %g: %.17g, expected %.17g\n", (long long)v, position[0], position[1],
                position[2], found, expected);
        is_right = false;
    }
    test_free(is_drawn);
    test_view_free(&view);
    return is_right;
}

static insitu_status draw_step(insitu_session *session, const part_input *in, int cycle)
{
    discard_pictures();
    insitu_status status = insitu_set_mesh(session, "m", &in->mesh);
    if (!status) status = insitu_set_field(session, "m", &in->field);
    if (status) fprintf(stderr, "rank %d: %s\n", own_rank, insitu_error(session));
    const insitu_status stepped = insitu_step(session, cycle, 0);
    if (stepped) fprintf(stderr, "rank %d: %s\n", own_rank, insitu_error(session));
    return status ? status : stepped;
}

static void make_part_lists(part_input *in)
{
    test_view view;
    test_view_create(&in->part, (test_layout){true, true, true, false, true}, &view);
    view.cells.ghosts = (const char *)in->part.ghosts;
    view.cells.ghosts_stride = view.cells.ghosts_bytes = 1;
    list_boundary_faces_by_cells(in, &view.cells);
    test_view_free(&view);
}

/* Makes the whole mesh. If `polyhedra` is set, all cells become polyhedra. */
static void make_whole_mesh(test_mesh_kind kind, bool polyhedra)
{
    test_mesh_make_lattice(kind, SIDE, 0.2, test_wave_field, &whole);
    if (polyhedra && kind != TEST_POLYHEDRA) test_mesh_to_polyhedra(&whole, 1);
    owners = test_calloc((size_t)whole.cell_count, sizeof *owners);
}

static void free_whole_mesh(void)
{
    test_free(owners);
    test_mesh_free(&whole);
}

static void check_cells(test_mesh_kind kind, bool polyhedra, telling how)
{
    make_whole_mesh(kind, polyhedra);
    for (int variant = 0; variant < 2 * TEST_PARTITION_COUNT; variant++) {
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
        test_partition_cells(&whole, (test_partition_kind)(variant / 2), SIDE, rank_count, owners);
        part_create(&input, own_rank, variant % 2);
        make_part_lists(&input);
        describe_patches(&input, how);
        everywhere(draw_step(session, &input, 0) == INSITU_OK);
        everywhere(are_means_right(session));
        insitu_destroy(&session);
        part_free(&input);
    }
    free_whole_mesh();
}

static void typed_cells_accept_patches_by_vertices(void **state)
{
    (void)state;
    check_cells(TEST_HEXES, false, BY_VERTICES);
    check_cells(TEST_MIXED, false, BY_VERTICES);
}

static void polyhedra_accept_patches_by_numbers_and_vertices(void **state)
{
    (void)state;
    check_cells(TEST_POLYHEDRA, false, BY_NUMBERS);
    check_cells(TEST_MIXED, true, BY_RANGES);
    check_cells(TEST_HEXES, true, BY_VERTICES);
}

static void owner_meshes_accept_patches_by_numbers_and_ranges(void **state)
{
    (void)state;
    for (int variant = 0; variant < 2 * FORM_COUNT * 2; variant++) {
        const int base = variant / 4 == FORM_WIDE ? 0 : variant / 2 % 2;
        make_whole_mesh(variant % 4 == 3 ? TEST_POLYHEDRA : TEST_MIXED, true);
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
        test_partition_cells(&whole, TEST_RANDOM, SIDE, rank_count, owners);
        part_create(&input, own_rank, variant == 5);
        input.faces = make_owned_faces(&input.part, base);
        describe_owned_faces(&input.faces, (form)(variant / 4), base, &input.mesh);
        list_boundary_faces_by_owner(&input);
        describe_patches(&input, variant % 2 ? BY_NUMBERS : BY_RANGES);
        everywhere(draw_step(session, &input, 0) == INSITU_OK);
        everywhere(are_means_right(session));
        insitu_destroy(&session);
        part_free(&input);
        free_whole_mesh();
    }
}

static void meshes_with_corner_fields_accept_patches(void **state)
{
    (void)state;
    make_whole_mesh(TEST_HEXES, false);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(corner_scene));
    test_partition_cells(&whole, TEST_CHECKERBOARD, SIDE, rank_count, owners);
    part_create(&input, own_rank, false);
    make_part_lists(&input);
    describe_patches(&input, BY_VERTICES);
    insitu_field g;
    insitu_field_defaults(&g);
    double *corners = test_calloc((size_t)input.part.connectivity_count + 1, sizeof *corners);
    g.name = "g";
    g.centring = INSITU_CORNER;
    g.count = input.part.connectivity_count;
    g.values = (insitu_array){corners, INSITU_FLOAT64, 0};
    everywhere(insitu_set_mesh(session, "m", &input.mesh) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &input.field) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &g) == INSITU_OK);
    everywhere(insitu_step(session, 0, 0) == INSITU_OK);
    everywhere(are_means_right(session));
    insitu_destroy(&session);
    test_free(corners);
    part_free(&input);
    free_whole_mesh();
}

static insitu_status fill_patch_field(void *data, insitu_field *field)
{
    const insitu_field *given = data;
    field->count = given->count;
    field->values = given->values;
    field->patch_count = given->patch_count;
    field->patches = given->patches;
    return INSITU_OK;
}

/* Checks that means are recomputed if only the values on the boundary change, and if a fill function gives the
 * field. */
static void means_follow_values_on_the_boundary(void **state)
{
    (void)state;
    make_whole_mesh(TEST_MIXED, false);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    test_partition_cells(&whole, TEST_RANDOM, SIDE, rank_count, owners);
    part_create(&input, own_rank, false);
    make_part_lists(&input);
    describe_patches(&input, BY_VERTICES);
    const insitu_array right = input.patches[0].values;
    const double *other = test_calloc((size_t)input.counts[0] + 1, sizeof *other);
    input.patches[0].values = (insitu_array){other, INSITU_FLOAT64, 0};
    everywhere(draw_step(session, &input, 0) == INSITU_OK);
    everywhere(own_rank != 0 || rank_count > 1 || !are_means_right(session));
    input.patches[0].values = right;
    input.mesh.changed = input.field.changed = INSITU_CHANGED_NOTHING;
    everywhere(draw_step(session, &input, 1) == INSITU_OK);
    everywhere(are_means_right(session));
    insitu_field filled = input.field, given = input.field;
    filled.values.data = NULL;
    filled.patch_count = 0;
    filled.fill = fill_patch_field;
    filled.fill_data = &given;
    for (int cycle = 2; cycle < 4; cycle++) {
        everywhere(insitu_set_field(session, "m", &filled) == INSITU_OK);
        everywhere(insitu_step(session, cycle, 0) == INSITU_OK);
        everywhere(are_means_right(session));
    }
    insitu_destroy(&session);
    test_free((void *)(uintptr_t)other);
    part_free(&input);
    free_whole_mesh();
}

/* ---- a linear field ---------------------------------------------------------------------------------------------- */

/* Checks a linear field. Its mean over faces is its value at the mean of the faces' centres. For a vertex inside a wall
 * this position is the vertex; for a vertex at an edge it is h / 4 away from both walls, and at a corner h / 3 from all
 * three walls. Four values of size 2 and their sum have errors of a few roundings of 2.2e-16 × 2. */
static void linear_fields_are_exact_amid_walls(void **state)
{
    (void)state;
    const double h = 2.0 / SIDE, shifts[4] = {0, 0, h / 4, h / 3};
    test_mesh_make_lattice(TEST_HEXES, SIDE, 0, test_linear_field, &whole);
    owners = test_calloc((size_t)whole.cell_count, sizeof *owners);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(plain_scene));
    test_partition_cells(&whole, TEST_RANDOM, SIDE, rank_count, owners);
    part_create(&input, own_rank, false);
    test_view view;
    test_view_create(&input.part, (test_layout){true, true, true, false, true}, &view);
    for (int64_t cell = 0; cell < input.part.cell_count; cell++) {
        const session_cell_faces of_cell = session_faces_of_cell(&view.cells, cell);
        for (int64_t f = 0; f < of_cell.count; f++) {
            const session_face_loop loop = session_find_face_loop(&of_cell, f);
            double points[8][3];
            boundary_face face;
            const int count = read_loop(&view.cells, &loop, points);
            if (!is_on_wall((const double(*)[3])points, count, &face)) continue;
            const int64_t at = input.counts[0];
            for (int i = 0; i < 4; i++) input.vertices[0][4 * at + i] = session_face_vertex(&loop, i);
            add_value(&input, 0, test_linear_field(face.centre));
        }
    }
    test_view_free(&view);
    add_patch(&input, (insitu_patch){.count = input.counts[0],
                                     .connectivity_count = 4 * input.counts[0],
                                     .connectivity = {input.vertices[0], INSITU_INT64, 0},
                                     .values = make_patch_values(&input, 0, 0)});
    everywhere(draw_step(session, &input, 0) == INSITU_OK);
    const session_scalar *scalar = get_vertex_means(session_find_mesh(&session->meshes, "m"));
    bool is_right = scalar != NULL;
    int amid = 0, edges = 0;
    for (int64_t v = 0; is_right && v < input.part.vertex_count; v++) {
        double place[3];
        int walls = 0;
        for (int axis = 0; axis < 3; axis++) walls += fabs(input.part.coordinates[3 * v + axis]) == 1;
        if (walls == 0) continue;
        for (int axis = 0; axis < 3; axis++) {
            place[axis] = input.part.coordinates[3 * v + axis];
            if (fabs(place[axis]) == 1) place[axis] *= 1 - shifts[walls];
        }
        amid += walls == 1;
        edges += walls > 1;
        is_right = fabs(scalar->vertex_values[v] - test_linear_field(place)) <= 4e-15;
        if (!is_right)
            fprintf(stderr, "%d walls: %.17g, not %.17g\n", walls, scalar->vertex_values[v], test_linear_field(place));
    }
    everywhere(is_right);
    everywhere(amid > 0 && edges > 0);
    insitu_destroy(&session);
    part_free(&input);
    free_whole_mesh();
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(typed_cells_accept_patches_by_vertices),
        cmocka_unit_test(polyhedra_accept_patches_by_numbers_and_vertices),
        cmocka_unit_test(owner_meshes_accept_patches_by_numbers_and_ranges),
        cmocka_unit_test(meshes_with_corner_fields_accept_patches),
        cmocka_unit_test(means_follow_values_on_the_boundary),
        cmocka_unit_test(linear_fields_are_exact_amid_walls),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
