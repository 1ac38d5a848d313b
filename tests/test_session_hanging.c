/* Checks cell values on cubes of which some are refined and then given as ghosts beside the smaller cubes that cover
 * them. An isosurface must be continuous at hanging nodes, whether all cells are one mesh or each level of refinement
 * is a mesh of its own. The field is the distance from the centre, so that the isosurface is a sphere, known in closed
 * form; a ray through a gap would hit the sphere's back, or nothing. In either form the picture must be bit-identical
 * on any number of ranks. Also checks which meshes the library treats as one. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session.h"
#include "test_session_fixture.h"

enum { SIZE = 200, PIXELS = SIZE * SIZE, SIDE = 8, LEVELS = 3, CUTS = 4, LINE = SIDE * CUTS * CUTS + 1 };

/* An orthographic view along z from z = 5; a pixel is 1/100 wide. */
static const char scene_text[] =
    "images:\n  - name: a\n    size: [200, 200]\n    background: [0, 0, 0, 0]\n    camera: {position: [0, 0, 5], "
    "focal: [0, 0, 0], up: [0, 1, 0], projection: orthographic, height: 2}\n    layers:\n"
    "      - isosurface: {field: f, values: [0.72]}\n    outputs: [{path: a.exr}]\n";

typedef enum amr_shape {
    PLAIN,
    TURNED,
    BENT,
    /* as TURNED; if each level is a mesh, coordinates of the same vertex differ in their last bits between levels */
    ROUGH,
    SHAPES
} amr_shape;

typedef struct amr {
    int cuts; /* number of parts of a refined cell along each axis */
    amr_shape shape;
    insitu_cell_type type; /* hexes, or the type into which a cube is divided */
    bool is_by_level;      /* whether each level is a mesh of its own */
    int rank, ranks;       /* rank: the rank whose cells are made; ranks: number of ranks */
} amr;

/* The arrays of one mesh on one rank. */
typedef struct part {
    insitu_cell_type type;
    int64_t vertex_count, cell_count;
    int64_t *vertices; /* index in this part of each vertex of the finest lattice; -1: not made yet */
    double *coordinates, *values;
    int64_t *connectivity;
    unsigned char *ghosts;
} part;

static void part_create(part *p, insitu_cell_type type)
{
    const size_t most = 200000;
    *p = (part){.type = type, .vertices = malloc((size_t)LINE * LINE * LINE * sizeof(int64_t))};
    p->coordinates = malloc(3 * most * sizeof(double));
    p->values = malloc(most * sizeof(double));
    p->connectivity = malloc(8 * most * sizeof(int64_t));
    p->ghosts = malloc(most);
    assert_true(p->vertices && p->coordinates && p->values && p->connectivity && p->ghosts);
    memset(p->vertices, 0xff, (size_t)LINE * LINE * LINE * sizeof(int64_t));
}

static void part_free(part *p)
{
    free(p->vertices);
    free(p->coordinates);
    free(p->values);
    free(p->connectivity);
    free(p->ghosts);
}

static void compute_vertex_position(const amr *a, int level, const double at[3], double out[3])
{
    memcpy(out, at, 3 * sizeof *out);
    if (a->shape == TURNED || a->shape == ROUGH) { /* rotates the cube, so that no coordinate is exact */
        out[0] = 0.8 * at[0] - 0.6 * at[1];
        out[1] = 0.48 * at[0] + 0.64 * at[1] - 0.6 * at[2];
        out[2] = 0.36 * at[0] + 0.48 * at[1] + 0.8 * at[2];
    }
    for (int axis = 0; axis < 3 && a->shape == ROUGH; axis++) out[axis] *= 1 + level * 0x1p-52;
    if (a->shape == BENT) { /* a map that is bilinear in every cube, so that hanging vertices lie on its quads */
        out[0] += 0.2 * at[1] * at[2];
        out[1] += 0.1 * at[0] * at[2];
    }
}

/* The cells into which a cube is divided. places: the cube's corners at each cell's vertices; bits 0, 1 and 2 of a
 * corner are its coordinates x, y and z. Diagonals of a cube's squares coincide with those of the smaller cubes'
 * squares that cover them. */
typedef struct cutting {
    int cells, corners;
    int places[6][8];
} cutting;

static const cutting *get_cutting(insitu_cell_type type)
{
    static const cutting tets = {
        6, 4, {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7}, {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}}};
    static const cutting wedges = {2, 6, {{0, 1, 3, 4, 5, 7}, {0, 3, 2, 4, 7, 6}}};
    static const cutting hexes = {1, 8, {{0, 1, 3, 2, 4, 5, 7, 6}}};
    return type == INSITU_TET ? &tets : type == INSITU_WEDGE ? &wedges : &hexes;
}

/* Returns the index in part p of the vertex at a position of the finest lattice; adds the vertex if necessary. */
static int64_t find_or_add_vertex(const amr *a, part *p, int level, const int at[3])
{
    const int64_t index = at[0] + LINE * (at[1] + LINE * (int64_t)at[2]);
    if (p->vertices[index] < 0) {
        double flat[3];
        for (int axis = 0; axis < 3; axis++) flat[axis] = 2.0 * at[axis] / (SIDE * a->cuts * a->cuts) - 1;
        compute_vertex_position(a, level, flat, p->coordinates + 3 * p->vertex_count);
        p->vertices[index] = p->vertex_count++;
    }
    return p->vertices[index];
}

static void add_cube(const amr *a, part *p, int level, const int at[3], int width, bool is_ghost)
{
    const cutting *cut = get_cutting(a->type);
    for (int cell = 0; cell < cut->cells; cell++, p->cell_count++) {
        double middle[3] = {0, 0, 0};
        for (int i = 0; i < cut->corners; i++) {
            const int corner = cut->places[cell][i];
            const int64_t vertex =
                find_or_add_vertex(a, p, level,
                                   (const int[]){at[0] + (corner & 1) * width, at[1] + (corner >> 1 & 1) * width,
                                                 at[2] + (corner >> 2) * width});
            for (int axis = 0; axis < 3; axis++) middle[axis] += p->coordinates[3 * vertex + axis] / cut->corners;
            p->connectivity[cut->corners * p->cell_count + i] = vertex;
        }
        p->values[p->cell_count] =
            is_ghost ? -7 : sqrt(middle[0] * middle[0] + middle[1] * middle[1] + middle[2] * middle[2]);
        p->ghosts[p->cell_count] = is_ghost;
    }
}

/* Returns whether a cube is refined. About half of the cubes of level 0 are, in contiguous regions; of their smaller
 * cubes a part is refined once more, if cuts is 2. */
static bool is_refined(const amr *a, int level, const int at[3], int width)
{
    double middle[3];
    for (int axis = 0; axis < 3; axis++) middle[axis] = (2.0 * at[axis] + width) / (SIDE * a->cuts * a->cuts) - 1;
    if (level == 0) return middle[0] + 0.4 * middle[1] > 0.1 || (middle[1] < -0.5 && middle[2] > 0.25);
    return level == 1 && a->cuts == 2 && middle[0] + 0.4 * middle[1] > 0.6;
}

static void add_refined_cubes(const amr *a, part *parts, int level, const int at[3], int width)
{
    const bool is_cut = is_refined(a, level, at, width);
    const uint64_t name = (uint64_t)(at[0] + LINE * (at[1] + LINE * at[2])) * LEVELS + (uint64_t)level;
    const int owner = (int)(test_uniform(name, 8) * a->ranks);
    if (owner == a->rank) add_cube(a, &parts[a->is_by_level ? level : 0], level, at, width, is_cut);
    for (int i = 0; is_cut && i < a->cuts * a->cuts * a->cuts; i++) {
        const int w = width / a->cuts;
        const int within[3] = {at[0] + i % a->cuts * w, at[1] + i / a->cuts % a->cuts * w,
                               at[2] + i / (a->cuts * a->cuts) * w};
        add_refined_cubes(a, parts, level + 1, within, w);
    }
}

static void make_parts(const amr *a, part *parts)
{
    const int width = a->cuts * a->cuts;
    for (int level = 0; level < (a->is_by_level ? LEVELS : 1); level++) part_create(&parts[level], a->type);
    for (int i = 0; i < SIDE * SIDE * SIDE; i++)
        add_refined_cubes(a, parts, 0,
                          (const int[]){i % SIDE * width, i / SIDE % SIDE * width, i / (SIDE * SIDE) * width}, width);
}

static void set_part(insitu_session *session, const char *name, const part *p)
{
    const int corners = get_cutting(p->type)->corners;
    insitu_mesh mesh;
    insitu_field field;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = p->vertex_count;
    insitu_mesh_interleaved(&mesh, p->coordinates, INSITU_FLOAT64);
    mesh.cell_count = p->cell_count;
    mesh.cell_type = p->type;
    mesh.connectivity_count = corners * p->cell_count;
    mesh.connectivity = (insitu_array){p->connectivity, INSITU_INT64, 0};
    mesh.ghosts = (insitu_array){p->ghosts, INSITU_UINT8, 0};
    insitu_field_defaults(&field);
    field.name = "f";
    field.centring = INSITU_CELL;
    field.count = p->cell_count;
    field.values = (insitu_array){p->values, INSITU_FLOAT64, 0};
    assert_int_equal(insitu_set_mesh(session, name, &mesh), INSITU_OK);
    assert_int_equal(insitu_set_field(session, name, &field), INSITU_OK);
}

static caught_picture step_and_take_picture(insitu_session *session)
{
    discard_pictures();
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    assert_int_equal(status, INSITU_OK);
    return pop_caught_picture();
}

static caught_picture draw_amr(MPI_Comm comm, const char *scene, const amr *a)
{
    static const char *const names[LEVELS] = {"m/0", "m/1", "m/2"};
    part parts[LEVELS];
    insitu_session *session = open_session(comm, scene);
    make_parts(a, parts);
    for (int level = 0; level < (a->is_by_level ? LEVELS : 1); level++) set_part(session, names[level], &parts[level]);
    const caught_picture picture = step_and_take_picture(session);
    insitu_destroy(&session);
    for (int level = 0; level < (a->is_by_level ? LEVELS : 1); level++) part_free(&parts[level]);
    return picture;
}

static void check_surface_continues(int cuts, amr_shape shape, insitu_cell_type type)
{
    const char *scene = write_scene(scene_text);
    const amr whole = {cuts, shape, type, shape == ROUGH, 0, 1};
    caught_picture alone = {0};
    if (own_rank == 0) alone = draw_amr(MPI_COMM_SELF, scene, &whole);
    for (int by_level = shape == ROUGH || rank_count == 1; by_level < 2; by_level++) {
        const amr own = {cuts, shape, type, by_level, own_rank, rank_count};
        caught_picture ours = draw_amr(MPI_COMM_WORLD, scene, &own);
        bool is_well = true;
        if (own_rank == 0) {
            const int slits = count_gap_pixels(&alone), parted = count_gap_pixels(&ours);
            is_well = slits == 0 && parted == 0 && are_same_pictures(&ours, &alone);
            if (!is_well)
                fprintf(stderr, "%d to 1, shape %d, type %d%s: %d pixels torn, %d on ranks; %s\n", cuts, (int)shape,
                        (int)type, by_level ? ", a mesh a level" : "", slits, parted,
                        are_same_pictures(&ours, &alone) ? "the same" : "another picture");
        }
        everywhere(is_well);
        free_caught(&ours);
    }
    free_caught(&alone);
}

static void cell_values_continue_across_hanging_nodes(void **state)
{
    (void)state;
    for (amr_shape shape = PLAIN; shape < SHAPES; shape++) check_surface_continues(2, shape, INSITU_HEX);
    check_surface_continues(4, TURNED, INSITU_HEX);
    check_surface_continues(4, BENT, INSITU_HEX);
}

/* Checks cells with triangular faces, in shapes whose faces are plane: in the bent shape, hanging vertices would not
 * lie on the flat triangles. */
static void cell_values_continue_across_triangles(void **state)
{
    (void)state;
    check_surface_continues(2, TURNED, INSITU_TET);
    check_surface_continues(4, PLAIN, INSITU_WEDGE);
}

/* ---- which meshes are one -------------------------------------------------------------------------------------- */

/* A box with the given number of hexes along each axis, which are dealt to the ranks in turn. All cells have the value
 * `value`, except that the lowest layer along z has `rest`. */
typedef struct box {
    double lower[3], upper[3];
    int counts[3];
    double value, rest;
} box;

static void make_box(const box *b, int rank, int ranks, part *p)
{
    const int lines[3] = {b->counts[0] + 1, b->counts[1] + 1, b->counts[2] + 1};
    part_create(p, INSITU_HEX);
    for (int i = 0; i < lines[0] * lines[1] * lines[2]; i++, p->vertex_count++) {
        const int at[3] = {i % lines[0], i / lines[0] % lines[1], i / lines[0] / lines[1]};
        for (int axis = 0; axis < 3; axis++)
            p->coordinates[3 * i + axis] =
                b->lower[axis] + (b->upper[axis] - b->lower[axis]) * at[axis] / b->counts[axis];
    }
    for (int i = 0; i < b->counts[0] * b->counts[1] * b->counts[2]; i++) {
        const int at[3] = {i % b->counts[0], i / b->counts[0] % b->counts[1], i / b->counts[0] / b->counts[1]};
        if (i % ranks != rank) continue;
        for (int corner = 0; corner < 8; corner++) {
            const int bits = get_cutting(INSITU_HEX)->places[0][corner];
            p->connectivity[8 * p->cell_count + corner] =
                at[0] + (bits & 1) + lines[0] * (at[1] + (bits >> 1 & 1) + (int64_t)lines[1] * (at[2] + (bits >> 2)));
        }
        p->values[p->cell_count] = at[2] ? b->rest : b->value;
        p->ghosts[p->cell_count++] = 0;
    }
}

/* Draws the boxes, each as a mesh. Only the first `givers` ranks pass their part of the second mesh. */
static caught_picture draw_boxes(const char *layers, const box *boxes, int count, int givers)
{
    static const char *const names[] = {"a", "b"};
    char text[900];
    snprintf(text, sizeof text, "%.*s%s    outputs: [{path: a.exr}]\n",
             (int)(strstr(scene_text, "      - iso") - scene_text), scene_text, layers);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
    part parts[2];
    for (int i = 0; i < count; i++) {
        make_box(&boxes[i], own_rank, rank_count, &parts[i]);
        if (i == 0 || own_rank < givers) set_part(session, names[i], &parts[i]);
    }
    const caught_picture picture = step_and_take_picture(session);
    insitu_destroy(&session);
    for (int i = 0; i < count; i++) part_free(&parts[i]);
    return picture;
}

/* Checks two adjacent meshes, each with one value. If one layer shows both, the field increases continuously from one
 * value to the other, so that an isosurface lies between them. If each mesh has its own layer, there is no value
 * between, and no isosurface. */
static void layer_of_two_meshes_is_continuous(void **state)
{
    static const box boxes[] = {{{-1, -1, -1}, {1, 1, 0}, {2, 2, 2}, 0, 0}, {{-1, -1, 0}, {1, 1, 1}, {2, 2, 2}, 1, 1}};
    (void)state;
    caught_picture one = draw_boxes("      - isosurface: {field: f, values: [0.25]}\n", boxes, 2, rank_count);
    caught_picture apart = draw_boxes("      - isosurface: {field: f, mesh: a, values: [0.25]}\n"
                                      "      - isosurface: {field: f, mesh: b, values: [0.25]}\n",
                                      boxes, 2, rank_count);
    caught_picture both = draw_boxes("      - isosurface: {field: f, mesh: [a, b], values: [0.25]}\n"
                                     "      - isosurface: {field: f, mesh: b, values: [0.25]}\n",
                                     boxes, 2, rank_count);
    everywhere(own_rank != 0 || count_visible_pixels(&one) == PIXELS);
    everywhere(count_visible_pixels(&apart) == 0);
    everywhere(own_rank != 0 || are_same_pictures(&one, &both));
    free_caught(&one);
    free_caught(&apart);
    free_caught(&both);
}

/* Checks a fine mesh that overlaps a coarse mesh at a common wall. The fine vertices on the wall lie on faces of coarse
 * cells, but these faces have the same orientation as the fine cells' faces, so that the vertices are not hanging. No
 * vertex of one mesh has the position of a vertex of the other. */
static void vertices_on_a_shared_boundary_are_not_hanging(void **state)
{
    static const box boxes[] = {{{-0.7, -0.7, 0}, {0.7, 0.7, 0.6}, {5, 5, 3}, 1, 0},
                                {{-1, -1, 0}, {1, 1, 1}, {2, 2, 2}, 0, 0}};
    (void)state;
    caught_picture alone = draw_boxes("      - isosurface: {field: f, values: [0.75]}\n", boxes, 1, 0);
    caught_picture both = draw_boxes("      - isosurface: {field: f, values: [0.75]}\n", boxes, 2, rank_count);
    everywhere(own_rank != 0 || count_visible_pixels(&alone) > PIXELS / 3);
    everywhere(own_rank != 0 || are_same_pictures(&alone, &both));
    free_caught(&alone);
    free_caught(&both);
}

/* Checks that the values of one mesh, and the last rank's part of it, can appear and disappear: the means of the other
 * mesh must equal those of a new session. */
static void means_include_values_of_the_adjacent_mesh(void **state)
{
    static const char layers[] = "      - isosurface: {field: f, values: [0.25]}\n";
    static const box low = {{-1, -1, -1}, {1, 1, 0}, {2, 2, 2}, 0, 0}, high = {{-1, -1, 0}, {1, 1, 1}, {2, 2, 2}, 1, 1},
                     higher = {{-1, -1, 0}, {1, 1, 1}, {2, 2, 2}, 2, 2};
    (void)state;
    caught_picture expected[] = {draw_boxes(layers, (const box[]){low, high}, 2, rank_count),
                                 draw_boxes(layers, (const box[]){low, higher}, 2, rank_count),
                                 draw_boxes(layers, (const box[]){low, higher}, 2, rank_count - 1)};
    char text[900];
    snprintf(text, sizeof text, "%.*s%s    outputs: [{path: a.exr}]\n",
             (int)(strstr(scene_text, "      - iso") - scene_text), scene_text, layers);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
    part a, b;
    make_box(&low, own_rank, rank_count, &a);
    make_box(&high, own_rank, rank_count, &b);
    set_part(session, "a", &a);
    for (int step = 0; step < 3; step++) {
        for (int64_t i = 0; i < b.cell_count; i++) b.values[i] = step ? 2 : 1;
        if (step < 2) set_part(session, "b", &b);
        if (step == 2 && own_rank == rank_count - 1) assert_int_equal(insitu_set_mesh(session, "b", NULL), INSITU_OK);
        caught_picture picture = step_and_take_picture(session);
        everywhere(own_rank != 0 || are_same_pictures(&expected[step], &picture));
        free_caught(&picture);
    }
    insitu_destroy(&session);
    for (int step = 0; step < 3; step++) free_caught(&expected[step]);
    part_free(&a);
    part_free(&b);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(cell_values_continue_across_hanging_nodes),
                                       cmocka_unit_test(cell_values_continue_across_triangles),
                                       cmocka_unit_test(layer_of_two_meshes_is_continuous),
                                       cmocka_unit_test(vertices_on_a_shared_boundary_are_not_hanging),
                                       cmocka_unit_test(means_include_values_of_the_adjacent_mesh)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
