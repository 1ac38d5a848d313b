/* Checks that every partition of a mesh gives the same picture, for all combinations of
 *
 *     ranks (of mpiexec) x block, Morton, random, checkerboard, a rank without cells x 0 to 2 layers of ghost cells
 *     x hexes, tets, polyhedra, mixed cells x the images below
 *
 * Each part has its own order of cells' vertices and faces. Rank 0 draws the whole mesh by itself and compares the
 * pictures. Surfaces must be bit-identical in depth and colour, and so must volumes with the reproducible option,
 * including faint ones. Other volumes must agree to 1e-6, which compositing guarantees. For each image the test reports
 * how many pictures are bit-identical and the largest difference. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "test_effort.h"
#include "test_session_fixture.h"

enum { WIDTH = 60, HEIGHT = 45, PIXELS = WIDTH * HEIGHT, MOST_LAYERS = 2 };

/* ---- images --------------------------------------------------------------------------------------------------- */

typedef enum promise { TO_THE_BIT, TO_A_MILLIONTH } promise;

typedef struct image_case {
    const char *name;
    promise promise;
    const char *layers, *sampling;
    const char *more; /* additional lines of the image, or NULL */
} image_case;

#define CLEAR "      - isosurface: {field: f, values: [-0.2, 0.3], opacity: 0.4}\n"
#define VOLUME "      - volume: {field: f, opacity: [[0, 0.1], [0.4, 0.3], [0.4, 0.9], [1, 0.2]]}\n"
#define DIFFER "      - isosurface: {field: f, values: [0.1], normals: differences}\n"
#define FAR                                                                                                            \
    "      - isosurface: {field: f, values: [-0.4, 0.4], normals: differences, difference: 2.5, opacity: 0.4,\n"       \
    "                     colour_by: {field: c, range: [-1, 1]}}\n"
#define OTHER "      - volume: {field: f, map: plasma, opacity: [[0, 0.4], [1, 0]]}\n"
#define INNER "      - surface: {threshold: {field: c, from: 0}, opacity: 0.4, colour_by: {field: f, range: [-1, 1]}}\n"
#define SOLID "      - surface: {threshold: {field: c, from: 0}}\n"
#define WITHIN "    camera: {position: [0.11, 0.07, 0.23], focal: [1, 0.3, 0.1], angle: 90}\n"
#define LIT "    shadows: true\n    ambient_occlusion: {samples: 8}\n"

static const image_case listed[] = {
    {"gradient", TO_THE_BIT, "      - isosurface: {field: f, values: [0.1]}\n", "", NULL},
    {"vertex normals", TO_THE_BIT, "      - isosurface: {field: f, values: [0.1], normals: vertex}\n", "", NULL},
    {"differences", TO_THE_BIT, DIFFER, "", NULL},
    {"differences, several layers", TO_THE_BIT, FAR DIFFER, "", NULL},
    {"differences, light", TO_THE_BIT, FAR DIFFER, "",
     "    shadows: true\n    ambient_occlusion: {samples: 4, radius: 0.5}\n"},
    {"differences, reproducible volume", TO_THE_BIT, VOLUME FAR DIFFER, "max_error: 0.01, reproducible: true", NULL},
    {"two transparent", TO_THE_BIT, CLEAR, "", NULL},
    {"coloured by cells", TO_THE_BIT,
     "      - isosurface: {field: f, values: [0.1], colour_by: {field: c, range: [-1, 1]}}\n", "", NULL},
    {"lit", TO_THE_BIT, "      - isosurface: {field: f, values: [0.1], normals: vertex}\n" LIT, "", NULL},
    {"lit, slice, transparent", TO_THE_BIT,
     "      - isosurface: {field: f, values: [0.1]}\n"
     "      - slice: {field: f, planes: [{normal: [0.2, 1, 0.1], point: [0, 0.1, 0]}], material: {ambient: 0.2, "
     "diffuse: 0.8}}\n" CLEAR LIT,
     "", NULL},
    {"samples", TO_A_MILLIONTH, VOLUME, "method: samples", NULL},
    {"segments", TO_A_MILLIONTH, VOLUME, "method: segments", NULL},
    {"max_error", TO_A_MILLIONTH, VOLUME, "max_error: 0.01", NULL},
    {"volume, surfaces", TO_A_MILLIONTH, VOLUME CLEAR, "max_error: 0.01", NULL},
    {"samples, surfaces", TO_A_MILLIONTH, VOLUME CLEAR, "method: samples", NULL},
    {"volume, faces inside", TO_A_MILLIONTH, VOLUME INNER, "max_error: 0.01", WITHIN},
    {"volume, opaque faces inside", TO_A_MILLIONTH, VOLUME SOLID, "max_error: 0.01", WITHIN},
    {"two volumes", TO_A_MILLIONTH, VOLUME OTHER, "method: samples", NULL},
    {"samples, reproducible", TO_THE_BIT, VOLUME, "method: samples, reproducible: true", NULL},
    {"segments, reproducible", TO_THE_BIT, VOLUME, "method: segments, reproducible: true", NULL},
    {"max_error, reproducible", TO_THE_BIT, VOLUME, "max_error: 0.01, reproducible: true", NULL},
    {"max_error 1e-3, reproducible", TO_THE_BIT, VOLUME, "max_error: 0.001, reproducible: true", NULL},
    {"volume, surfaces, reproducible", TO_THE_BIT, VOLUME CLEAR, "max_error: 0.01, reproducible: true", NULL},
    {"samples, surfaces, reproducible", TO_THE_BIT, VOLUME CLEAR, "method: samples, reproducible: true", NULL},
    {"segments, faces inside, reproducible", TO_THE_BIT, VOLUME INNER, "method: segments, reproducible: true", WITHIN},
    {"volume, faces inside, reproducible", TO_THE_BIT, VOLUME INNER, "max_error: 0.01, reproducible: true", WITHIN},
    {"samples, faces inside, reproducible", TO_THE_BIT, VOLUME INNER, "method: samples, reproducible: true", WITHIN},
    {"volume, opaque faces inside, reproducible", TO_THE_BIT, VOLUME SOLID, "max_error: 0.01, reproducible: true",
     WITHIN},
    {"two volumes, reproducible", TO_THE_BIT, VOLUME OTHER, "method: samples, reproducible: true", NULL},
    {"two volumes, max_error, reproducible", TO_THE_BIT, VOLUME OTHER, "max_error: 0.01, reproducible: true", NULL},
};
enum { LISTED = sizeof listed / sizeof *listed, MOST_FAINT = 20, MOST_CASES = LISTED + MOST_FAINT };

/* The listed images; from index LISTED on, volumes with random faint opacities. */
static image_case cases[MOST_CASES];
static int case_count;

/* Returns a volume layer with opacities from 1e-9 to 1e-3 per cell at five random values. The transmittance of most
 * segments rounds to 1, but their emission is visible. */
static const char *make_faint_layer(int which)
{
    static char texts[MOST_FAINT][256];
    char *text = texts[which];
    const uint64_t of = 100 + (uint64_t)which;
    size_t size = (size_t)snprintf(text, sizeof *texts, "      - volume: {field: f, opacity: [");
    for (int knot = 0; knot < 5; knot++) {
        const double inner = 0.25 * (knot + test_uniform_between(of, (uint64_t)knot, -0.3, 0.3));
        const double at = knot == 0 ? 0 : knot == 4 ? 1 : inner;
        size += (size_t)snprintf(text + size, sizeof *texts - size, "%s[%.3f, %.3g]", knot ? ", " : "", at,
                                 pow(10, test_uniform_between(of, 10 + (uint64_t)knot, -9, -3)));
    }
    snprintf(text + size, sizeof *texts - size, "]}\n");
    return text;
}

static void make_cases(void)
{
    static const char *const samplings[] = {
        "method: samples, reproducible: true", "method: segments, reproducible: true",
        "max_error: 0.01, reproducible: true", "max_error: 1e-4, reproducible: true"};
    static const char *const names[] = {"faint, samples", "faint, segments", "faint, max_error",
                                        "faint, max_error 1e-4"};
    memcpy(cases, listed, sizeof listed);
    case_count = LISTED + test_case_count(4, MOST_FAINT);
    for (int i = 0; i + LISTED < case_count; i++)
        cases[LISTED + i] = (image_case){names[i % 4], TO_THE_BIT, make_faint_layer(i), samplings[i % 4], NULL};
}

static const char *write_scene_of_all_cases(void)
{
    static char text[32768];
    size_t size = 0;
    make_cases();
    size += (size_t)snprintf(text, sizeof text, "images:\n");
    for (int i = 0; i < case_count; i++)
        size += (size_t)snprintf(text + size, sizeof text - size,
                                 "  - name: i%d\n    size: [%d, %d]\n    layers:\n%s    sampling: {%s}\n%s"
                                 "    outputs: [{path: i%d.exr}]\n",
                                 i, WIDTH, HEIGHT, cases[i].layers, cases[i].sampling,
                                 cases[i].more ? cases[i].more : "", i);
    assert_true(size < sizeof text);
    return write_scene(text);
}

/* ---- meshes and partitions ------------------------------------------------------------------------------------ */

typedef enum distribution { BLOCK, MORTON, RANDOM, CHECKERBOARD, RANK_EMPTY, DEALINGS } distribution;

static const char *const distribution_names[DEALINGS] = {"block", "Morton", "random", "checkerboard", "a rank empty"};

static const test_mesh_kind kinds[] = {TEST_HEXES, TEST_TETS, TEST_POLYHEDRA, TEST_MIXED};
enum { KINDS = sizeof kinds / sizeof *kinds };

/* Calls visit for each vertex of the cell. A vertex that several faces of a polyhedron share is visited several
 * times. */
static void visit_cell_vertices(const test_mesh *mesh, int64_t cell, void (*visit)(void *state, int64_t vertex),
                                void *state)
{
    for (int64_t i = mesh->offsets[cell]; i < mesh->offsets[cell + 1]; i++) {
        const int64_t entry = mesh->connectivity[i];
        if (mesh->types[cell] != GRID_POLYHEDRON) {
            visit(state, entry);
            continue;
        }
        for (int64_t j = mesh->face_offsets[entry]; j < mesh->face_offsets[entry + 1]; j++)
            visit(state, mesh->face_connectivity[j]);
    }
}

typedef struct mean_place {
    const test_mesh *mesh;
    double sum[3];
    int count;
} mean_place;

static void add_vertex_position(void *state, int64_t vertex)
{
    mean_place *mean = state;
    for (int a = 0; a < 3; a++) mean->sum[a] += mean->mesh->coordinates[3 * vertex + a];
    mean->count++;
}

static uint64_t compute_morton_code(const test_mesh *mesh, int64_t cell)
{
    mean_place mean = {.mesh = mesh};
    uint64_t code = 0;
    visit_cell_vertices(mesh, cell, add_vertex_position, &mean);
    for (int bit = 9; bit >= 0; bit--)
        for (int a = 0; a < 3; a++) {
            const double part = (mean.sum[a] / mean.count + 1) / 2;
            code = code << 1 | ((uint64_t)(fmin(fmax(part, 0), 0.9999) * 1024) >> bit & 1);
        }
    return code << 32 | (uint64_t)cell;
}

static int compare_codes(const void *a, const void *b)
{
    const uint64_t first = *(const uint64_t *)a, second = *(const uint64_t *)b;
    return (first > second) - (first < second);
}

static void distribute_morton(const test_mesh *mesh, int *owners)
{
    const size_t cells = (size_t)mesh->cell_count;
    uint64_t *codes = calloc(cells, sizeof *codes);
    assert_non_null(codes);
    for (size_t i = 0; i < cells; i++) codes[i] = compute_morton_code(mesh, (int64_t)i);
    qsort(codes, cells, sizeof *codes, compare_codes);
    for (size_t i = 0; i < cells; i++)
        owners[codes[i] & 0xffffffffu] = (int)((uint64_t)i * (uint64_t)rank_count / cells);
    free(codes);
}

static void distribute_cells(const test_mesh *mesh, distribution how, int side, int *owners)
{
    static const test_partition_kind known[] = {TEST_BLOCK, TEST_BLOCK, TEST_RANDOM, TEST_CHECKERBOARD, TEST_RANDOM};
    const int empty = rank_count / 2;
    const bool has_empty = how == RANK_EMPTY && rank_count > 1;
    test_partition_cells(mesh, known[how], side, has_empty ? rank_count - 1 : rank_count, owners);
    if (how == MORTON) distribute_morton(mesh, owners);
    for (int64_t i = 0; has_empty && i < mesh->cell_count; i++) owners[i] += owners[i] >= empty;
}

typedef struct vertex_set {
    unsigned char *has;
    bool found;
} vertex_set;

static void add_vertex(void *state, int64_t vertex)
{
    ((vertex_set *)state)->has[vertex] = 1;
}

static void find_vertex(void *state, int64_t vertex)
{
    vertex_set *set = state;
    set->found = set->found || set->has[vertex];
}

/* Selects the cells that share a vertex with cells that are already selected. */
static void add_neighbour_layer(const test_mesh *mesh, unsigned char *taken)
{
    vertex_set set = {.has = calloc((size_t)mesh->vertex_count, 1)};
    assert_non_null(set.has);
    for (int64_t i = 0; i < mesh->cell_count; i++)
        if (taken[i]) visit_cell_vertices(mesh, i, add_vertex, &set);
    for (int64_t i = 0; i < mesh->cell_count; i++) {
        set.found = false;
        visit_cell_vertices(mesh, i, find_vertex, &set);
        if (set.found) taken[i] = 1;
    }
    free(set.has);
}

/* A part of the mesh with one field at vertices and one in cells. */
typedef struct input {
    session_input vertices;
    double *cell_values;
    insitu_field cells;
} input;

static void describe_fields(input *in, const int *origin)
{
    const int64_t cells = in->vertices.part.cell_count;
    input_describe(&in->vertices);
    in->cell_values = calloc((size_t)cells + 1, sizeof *in->cell_values);
    assert_non_null(in->cell_values);
    for (int64_t i = 0; i < cells; i++) in->cell_values[i] = test_uniform_between((uint64_t)origin[i], 9, -1, 1);
    in->cells = in->vertices.field;
    in->cells.name = "c";
    in->cells.centring = INSITU_CELL;
    in->cells.count = cells;
    in->cells.values.data = in->cell_values;
}

static void free_input(input *in)
{
    input_free(&in->vertices);
    free(in->cell_values);
}

static void extract_rank_cells(const test_mesh *mesh, const int *owners, int layers, input *out)
{
    const size_t cells = (size_t)mesh->cell_count;
    unsigned char *taken = calloc(cells, 1);
    int *of_part = calloc(cells, sizeof *of_part), *origin = calloc(cells, sizeof *origin);
    assert_true(taken && of_part && origin);
    for (size_t i = 0; i < cells; i++) taken[i] = owners[i] == own_rank;
    for (int layer = 0; layer < layers; layer++) add_neighbour_layer(mesh, taken);
    int count = 0;
    for (size_t i = 0; i < cells; i++) {
        of_part[i] = taken[i] ? 0 : 1;
        if (taken[i]) origin[count++] = (int)i;
    }
    *out = (input){0};
    test_mesh_extract_part(mesh, of_part, 0, &out->vertices.part);
    for (int i = 0; i < count; i++) out->vertices.part.ghosts[i] = owners[origin[i]] != own_rank;
    test_mesh_reorder_vertices(&out->vertices.part, 11 + (uint64_t)own_rank);
    describe_fields(out, origin);
    free(taken);
    free(of_part);
    free(origin);
}

static void make_whole_input(const test_mesh *mesh, input *out)
{
    int *owners = calloc((size_t)mesh->cell_count, sizeof *owners), *origin = calloc((size_t)mesh->cell_count, 4);
    assert_true(owners && origin);
    for (int i = 0; i < (int)mesh->cell_count; i++) origin[i] = i;
    *out = (input){0};
    test_mesh_extract_part(mesh, owners, 0, &out->vertices.part);
    describe_fields(out, origin);
    free(owners);
    free(origin);
}

/* ---- pictures ------------------------------------------------------------------------------------------------- */

static void submit_and_step(insitu_session *session, const input *in, int cycle)
{
    discard_pictures();
    insitu_status status = submit_input(session, &in->vertices);
    if (!status) status = insitu_set_field(session, "m", &in->cells);
    if (!status) status = insitu_step(session, cycle, 0);
    if (status) fprintf(stderr, "rank %d: %s\n", own_rank, insitu_error(session));
    everywhere(status == INSITU_OK);
}

/* Sums over all pictures of an image. same: number of bit-identical pictures; worst: largest difference of a colour. */
typedef struct tally {
    int pictures, same, depths; /* depths: number of pixels whose depth differs */
    double worst;
    int64_t codes[2]; /* number of 8-bit channels of a PNG that differ by one, and by more */
} tally;

static tally tallies[MOST_CASES];

static int encode_channel(const float *rgba, int channel)
{
    const double alpha = (double)rgba[3], linear = alpha > 0 ? (double)rgba[channel] / alpha : 0;
    if (channel == 3) return (int)(fmin(fmax(alpha, 0), 1) * 255 + 0.5);
    const double l = fmin(fmax(linear, 0), 1);
    return (int)(255 * (l <= 0.0031308 ? 12.92 * l : 1.055 * pow(l, 1 / 2.4) - 0.055) + 0.5);
}

static bool compare_pictures(const caught_picture *a, const caught_picture *b, const image_case *c, tally *t)
{
    double worst = 0;
    int depths = 0;
    for (int i = 0; i < 4 * PIXELS; i++) {
        const int off = abs(encode_channel(a->rgba + i / 4 * 4, i % 4) - encode_channel(b->rgba + i / 4 * 4, i % 4));
        if (off) t->codes[off > 1]++;
        worst = test_larger_error(worst, fabs((double)a->rgba[i] - (double)b->rgba[i]));
    }
    for (int p = 0; p < PIXELS; p++) depths += memcmp(a->depth + p, b->depth + p, sizeof(float)) != 0;
    const bool is_same = !depths && !memcmp(a->rgba, b->rgba, 4 * PIXELS * sizeof(float));
    t->pictures++;
    t->same += is_same;
    t->depths += depths;
    t->worst = test_larger_error(t->worst, worst);
    return is_same || (c->promise == TO_A_MILLIONTH && !depths && worst <= 1e-6);
}

static bool are_same_pictures_within_tolerance(const caught_picture *whole, const char *what)
{
    bool are_well = caught_count == case_count;
    for (int i = 0; i < caught_count; i++) {
        const double before = tallies[i].worst;
        tallies[i].worst = 0;
        if (!compare_pictures(&whole[i], &caught[i], &cases[i], &tallies[i])) {
            fprintf(stderr, "%d ranks, %s, %s: off by %g\n", rank_count, what, cases[i].name, tallies[i].worst);
            are_well = false;
        }
        tallies[i].worst = test_larger_error(before, tallies[i].worst);
    }
    return are_well;
}

/* ---- the matrix ----------------------------------------------------------------------------------------------- */

static bool is_case_selected(int kind, int how, int layers)
{
    return test_is_long_run() || (kind + how + layers) % 6 == 0;
}

static bool verify_mesh(insitu_session *session, int kind, int side, const test_mesh *mesh, const caught_picture *whole)
{
    static int cycle;
    bool are_well = true;
    int *owners = calloc((size_t)mesh->cell_count, sizeof *owners);
    assert_non_null(owners);
    for (int how = 0; how < DEALINGS; how++)
        for (int layers = 0; layers <= MOST_LAYERS; layers++) {
            char what[96];
            input part;
            if (!is_case_selected(kind, how, layers)) continue;
            snprintf(what, sizeof what, "%s, %s, %d ghost layers", test_mesh_kind_name(kinds[kind]),
                     distribution_names[how], layers);
            distribute_cells(mesh, (distribution)how, side, owners);
            extract_rank_cells(mesh, owners, layers, &part);
            submit_and_step(session, &part, cycle++);
            if (own_rank == 0) are_well = are_same_pictures_within_tolerance(whole, what) && are_well;
            free_input(&part);
        }
    free(owners);
    return are_well;
}

/* Draws the pictures of the whole mesh on this rank, without the others. */
static void draw_whole(const char *scene, const test_mesh *mesh, caught_picture *out)
{
    static int cycle;
    input whole;
    make_whole_input(mesh, &whole);
    insitu_session *session = open_session(MPI_COMM_SELF, scene);
    discard_pictures();
    assert_int_equal(submit_input(session, &whole.vertices), INSITU_OK);
    assert_int_equal(insitu_set_field(session, "m", &whole.cells), INSITU_OK);
    assert_int_equal(insitu_step(session, cycle++, 0), INSITU_OK);
    assert_int_equal(caught_count, case_count);
    memcpy(out, caught, (size_t)case_count * sizeof *caught);
    caught_count = 0;
    insitu_destroy(&session);
    free_input(&whole);
}

static void pictures_do_not_depend_on_the_partition(void **state)
{
    (void)state;
    const int side = test_case_count(3, 4);
    const char *scene = write_scene_of_all_cases();
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    bool are_well = true;
    for (int kind = 0; kind < KINDS; kind++) {
        test_mesh mesh;
        caught_picture whole[MOST_CASES] = {{0}};
        test_mesh_make_lattice(kinds[kind], side, 0.2, test_wave_field, &mesh);
        if (own_rank == 0) draw_whole(scene, &mesh, whole);
        are_well = verify_mesh(session, kind, side, &mesh, whole) && are_well;
        for (int i = 0; i < case_count && own_rank == 0; i++) free_caught(&whole[i]);
        test_mesh_free(&mesh);
    }
    insitu_destroy(&session);
    for (int i = 0; i < case_count && own_rank == 0; i++)
        printf(
            "%d ranks, %s: %d of %d to the bit, %d depths differ, off by %.2g; PNG channels off by one: %lld, by more: "
            "%lld\n",
            rank_count, cases[i].name, tallies[i].same, tallies[i].pictures, tallies[i].depths, tallies[i].worst,
            (long long)tallies[i].codes[0], (long long)tallies[i].codes[1]);
    everywhere(are_well);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(pictures_do_not_depend_on_the_partition)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
