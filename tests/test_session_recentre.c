/* Checks the averaging of cell values at vertices. For any partition of the cells, with vertices matched by coordinates
 * or by ids, the mean must be bitwise equal to that of a search over the whole mesh, and the picture of the partitioned
 * mesh must be that of the whole mesh. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session.h"
#include "test_session_fixture.h"

enum { SIDE = 4 };

static const char surface_scene[] = "images:\n"
                                    "  - name: a\n"
                                    "    size: [40, 30]\n"
                                    "    layers:\n"
                                    "      - isosurface: {field: c, values: [8]}\n"
                                    "    outputs:\n"
                                    "      - path: a.exr\n";

static const char mixed_scene[] = "images:\n"
                                  "  - name: a\n"
                                  "    size: [40, 30]\n"
                                  "    layers:\n"
                                  "      - isosurface:\n"
                                  "          field: c\n"
                                  "          values: [4, 12]\n"
                                  "          opacity: 0.5\n"
                                  "          colour_by: {field: c}\n"
                                  "      - volume:\n"
                                  "          field: c\n"
                                  "          opacity: [[0, 0.4], [1, 0.1]]\n"
                                  "    outputs:\n"
                                  "      - path: a.exr\n";

/* A scene with an isosurface of c that is coloured by `field`, and a volume of `field`; field is c (at cells) or v (at
 * vertices). */
#define SMOOTH(field, how, method)                                                                                     \
    "images:\n  - name: a\n    size: [40, 30]\n    layers:\n"                                                          \
    "      - isosurface: {field: c, values: [8], colour_by: {field: " field how "}, opacity: 0.5}\n"                   \
    "      - volume: {field: " field how ", opacity: [[0, 0.4], [1, 0.1]]}\n"                                          \
    "    sampling: {method: " method "}\n    outputs: [{path: a.exr}]\n"
#define AT_VERTICES ", interpolate: vertex"

static test_mesh whole;
static int *owners;

/* Returns the value of a cell of the whole mesh. Values differ by many orders of magnitude, so that a sum depends on
 * the order of its terms. */
static double compute_cell_value(int64_t cell)
{
    const double u = test_uniform((uint64_t)cell, 5);
    return cell % 17 == 3 ? NAN : u * pow(10, floor(6 * test_uniform((uint64_t)cell, 6)) - 3);
}

/* Returns the mean over all cells that have a vertex at this position. */
static double compute_expected_mean(const double position[3])
{
    double values[256];
    int count = 0;
    for (int64_t cell = 0; cell < whole.cell_count; cell++) {
        bool is_at = false;
        for (int64_t i = whole.offsets[cell]; i < whole.offsets[cell + 1]; i++) {
            const double *p = whole.coordinates + 3 * whole.connectivity[i];
            is_at = is_at || (p[0] == position[0] && p[1] == position[1] && p[2] == position[2]);
        }
        if (is_at && isfinite(compute_cell_value(cell))) values[count++] = compute_cell_value(cell);
    }
    return compute_mean(values, count);
}

typedef struct part_input {
    test_mesh part;
    double *values; /* values of cells */
    int64_t *ids;   /* ids of vertices */
    insitu_mesh mesh;
    insitu_field field;
} part_input;

static int64_t find_whole_vertex(const double position[3])
{
    for (int64_t v = 0; v < whole.vertex_count; v++)
        if (memcmp(whole.coordinates + 3 * v, position, 3 * sizeof(double)) == 0) return v;
    return -1;
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
    test_mesh_extract_part(&whole, with_ghosts ? all : owners, with_ghosts ? 0 : rank, &in->part);
    test_free(all);
    in->values = test_calloc((size_t)in->part.cell_count + 1, sizeof *in->values);
    in->ids = test_calloc((size_t)in->part.vertex_count + 1, sizeof *in->ids);
    for (int64_t cell = 0, at = 0; cell < whole.cell_count; cell++) {
        if (!with_ghosts && owners[cell] != rank) continue;
        const bool is_ghost = owners[cell] != rank;
        in->part.ghosts[at] = is_ghost;
        in->values[at++] = is_ghost ? 1e6 : compute_cell_value(cell);
    }
    for (int64_t v = 0; v < in->part.vertex_count; v++)
        in->ids[v] = 7 * find_whole_vertex(in->part.coordinates + 3 * v) - 100;
    describe_input(in);
}

static void part_free(part_input *in)
{
    test_mesh_free(&in->part);
    test_free(in->values);
    test_free(in->ids);
}

static bool are_means_right(const insitu_session *session, const part_input *in)
{
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    const double *means = mesh && mesh->scalar_count == 1 ? mesh->scalars[0].vertex_values : NULL;
    if (!means) return false;
    for (int64_t v = 0; v < in->part.vertex_count; v++) {
        bool is_drawn = false;
        for (int64_t cell = 0; cell < in->part.cell_count; cell++)
            for (int64_t i = in->part.offsets[cell]; i < in->part.offsets[cell + 1]; i++)
                is_drawn = is_drawn || (in->part.connectivity[i] == v && !in->part.ghosts[cell]);
        const double expected = is_drawn ? compute_expected_mean(in->part.coordinates + 3 * v) : NAN;
        if (isnan(expected) && isnan(means[v])) continue;
        if (memcmp(&expected, &means[v], sizeof expected) != 0) {
            fprintf(stderr, "vertex %lld: %.17g, expected %.17g\n", (long long)v, means[v], expected);
            return false;
        }
    }
    return true;
}

static insitu_status draw_step(insitu_session *session, const part_input *in, int cycle)
{
    discard_pictures();
    insitu_status status = INSITU_OK;
    if (in) status = insitu_set_mesh(session, "m", &in->mesh);
    if (in && !status) status = insitu_set_field(session, "m", &in->field);
    const insitu_status stepped = insitu_step(session, cycle, 0);
    if (stepped) fprintf(stderr, "rank %d: %s\n", own_rank, insitu_error(session));
    return status ? status : stepped;
}

/* How vertices are matched: by coordinates, by ids of various widths and signs, or by coordinates in a mesh with ghost
 * cells. */
typedef enum variant { BY_COORDINATES, BY_IDS, WITH_GHOSTS, VARIANT_COUNT } variant;

static void means_equal_a_search_over_all_cells(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(surface_scene));
    for (int distributed = 0; distributed < TEST_PARTITION_COUNT; distributed++) {
        test_partition_cells(&whole, (test_partition_kind)distributed, SIDE, rank_count, owners);
        for (int v = 0; v < VARIANT_COUNT; v++) {
            part_input in;
            part_create(&in, own_rank, v == WITH_GHOSTS);
            if (v == BY_IDS) in.mesh.vertex_ids = (insitu_array){in.ids, INSITU_INT64, 0};
            everywhere(draw_step(session, &in, v) == INSITU_OK);
            everywhere(are_means_right(session, &in));
            const insitu_report *report = insitu_last_report(session);
            everywhere(report->bytes_copied == in.part.vertex_count * (int64_t)sizeof(double));
            everywhere(strstr(report->copied_why, "field \"c\" recentred") != NULL);
            everywhere(insitu_set_mesh(session, "m", NULL) == INSITU_OK);
            part_free(&in);
        }
    }
    insitu_destroy(&session);
}

/* Checks that vertices with equal coordinates within a rank are treated as one vertex, like those on two ranks. */
static void duplicated_vertices_are_merged(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(surface_scene));
    test_partition_cells(&whole, TEST_RANDOM, SIDE, rank_count, owners);
    part_input in;
    part_create(&in, own_rank, false);
    const int64_t count = in.part.connectivity_count;
    double *coordinates = calloc((size_t)count * 3 + 1, sizeof *coordinates);
    for (int64_t i = 0; i < count; i++) {
        memcpy(coordinates + 3 * i, in.part.coordinates + 3 * in.part.connectivity[i], 3 * sizeof *coordinates);
        for (int axis = 0; axis < 3; axis++) /* 0 and -0 are equal coordinates */
            if (coordinates[3 * i + axis] == 0 && i % 2) coordinates[3 * i + axis] = -0.0;
        in.part.connectivity[i] = i;
    }
    free(in.part.coordinates);
    in.part.coordinates = coordinates;
    in.part.vertex_count = count;
    describe_input(&in);
    everywhere(draw_step(session, &in, 0) == INSITU_OK);
    everywhere(are_means_right(session, &in));
    insitu_destroy(&session);
    part_free(&in);
}

/* Checks two adjacent hexes whose common face has separate but equal vertices. When the second hex moves away, the
 * groups of equal vertices must be found anew. */
static void means_follow_separated_cells(void **context)
{
    (void)context;
    static const double values[2] = {1, 3};
    static const int connectivity[16] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    double places[16][3];
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(surface_scene));
    insitu_mesh given;
    insitu_field field;
    insitu_mesh_defaults(&given);
    insitu_field_defaults(&field);
    given.vertex_count = 16;
    given.cell_count = 2;
    given.cell_type = INSITU_HEX;
    given.connectivity_count = 16;
    given.connectivity = (insitu_array){connectivity, INSITU_INT32, 0};
    insitu_mesh_interleaved(&given, places, INSITU_FLOAT64);
    field.name = "c";
    field.centring = INSITU_CELL;
    field.count = 2;
    field.values = (insitu_array){values, INSITU_FLOAT64, 0};
    for (int step = 0; step < 2; step++) {
        for (int v = 0; v < 16; v++) {
            places[v][0] = 10 * own_rank + (v % 4 == 1 || v % 4 == 2) + (v >= 8 ? 1 + step : 0);
            places[v][1] = v % 4 / 2;
            places[v][2] = v % 8 / 4;
        }
        given.changed = step ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_ALL;
        everywhere(insitu_set_mesh(session, "m", &given) == INSITU_OK);
        everywhere(insitu_set_field(session, "m", &field) == INSITU_OK);
        everywhere(insitu_step(session, step, 0) == INSITU_OK);
        const double *means = session_find_mesh(&session->meshes, "m")->scalars[0].vertex_values;
        bool is_right = true;
        for (int v = 0; v < 16; v++) {
            const bool is_between = step == 0 && places[v][0] == 10 * own_rank + 1;
            is_right = is_right && means[v] == (is_between ? 2 : values[v / 8]);
        }
        everywhere(is_right);
    }
    insitu_destroy(&session);
}

static void means_follow_values_that_changed_on_one_rank(void **context)
{
    (void)context;
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(surface_scene));
    test_partition_cells(&whole, TEST_CHECKERBOARD, SIDE, rank_count, owners);
    part_input in;
    part_create(&in, own_rank, false);
    double *right = test_calloc((size_t)in.part.cell_count + 1, sizeof *right);
    memcpy(right, in.values, (size_t)in.part.cell_count * sizeof *right);
    for (int64_t cell = 0; cell < in.part.cell_count && own_rank == 0; cell++) in.values[cell] = 3;
    everywhere(draw_step(session, &in, 0) == INSITU_OK);
    memcpy(in.values, right, (size_t)in.part.cell_count * sizeof *right);
    in.mesh.changed = INSITU_CHANGED_NOTHING;
    in.field.changed = own_rank == 0 ? INSITU_CHANGED_VALUES : INSITU_CHANGED_NOTHING;
    everywhere(draw_step(session, &in, 1) == INSITU_OK);
    everywhere(are_means_right(session, &in));
    in.field.changed = INSITU_CHANGED_NOTHING;
    everywhere(draw_step(session, &in, 2) == INSITU_OK);
    everywhere(insitu_last_report(session)->refit_ms == 0);
    insitu_destroy(&session);
    part_free(&in);
    test_free(right);
}

/* Compares the picture of all ranks with the one that rank 0 draws from the whole mesh. Pictures that show only
 * surfaces are bit-identical. If a volume is behind transparent surfaces, pictures agree up to the rounding of the over
 * operator (1e-6, as in all tests). */
static void compare_with_single_rank(const char *scene, double bound)
{
    for (int distributed = 0; distributed < TEST_PARTITION_COUNT; distributed++) {
        part_input in, all;
        caught_picture alone = {0};
        const char *name = write_scene(scene);
        for (int64_t cell = 0; cell < whole.cell_count; cell++) owners[cell] = 0;
        part_create(&all, 0, false);
        if (own_rank == 0) {
            insitu_session *session = open_session(MPI_COMM_SELF, name);
            draw_step(session, &all, 0);
            if (caught_count == 1) alone = caught[0];
            caught_count = 0;
            insitu_destroy(&session);
        }
        test_partition_cells(&whole, (test_partition_kind)distributed, SIDE, rank_count, owners);
        part_create(&in, own_rank, false);
        insitu_session *session = open_session(MPI_COMM_WORLD, name);
        everywhere(draw_step(session, in.part.cell_count ? &in : NULL, 0) == INSITU_OK);
        insitu_destroy(&session);
        bool is_same = own_rank != 0 || (caught_count == 1 && alone.rgba && alone.depth);
        double worst = 0;
        int covered = 0;
        for (int i = 0; is_same && own_rank == 0 && i < 40 * 30; i++) {
            is_same = memcmp(&alone.depth[i], &caught[0].depth[i], sizeof(float)) == 0;
            covered += isfinite(alone.depth[i]);
            for (int c = 0; c < 4; c++)
                worst = test_larger_error(worst, fabs((double)(alone.rgba[4 * i + c] - caught[0].rgba[4 * i + c])));
        }
        everywhere(is_same);
        everywhere(worst <= bound);
        everywhere(own_rank != 0 || covered > 100);
        free(alone.rgba);
        free(alone.depth);
        part_free(&in);
        part_free(&all);
    }
}

static void surfaces_do_not_depend_on_the_partition(void **context)
{
    (void)context;
    compare_with_single_rank(surface_scene, 0);
}

static void volumes_do_not_depend_on_the_partition(void **context)
{
    (void)context;
    compare_with_single_rank(mixed_scene, 1e-6);
}

static void smooth_volumes_do_not_depend_on_the_partition(void **context)
{
    (void)context;
    compare_with_single_rank(SMOOTH("c", AT_VERTICES, "samples"), 1e-6);
    compare_with_single_rank(SMOOTH("c", AT_VERTICES, "segments"), 1e-6);
}

/* Draws a scene with two fields: c has the cells' values, and v the means at vertices that a search over all cells has
 * found. Returns the picture on rank 0. */
static caught_picture draw_smooth(const char *scene, const part_input *in, const double *means)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(scene));
    insitu_field v;
    insitu_field_defaults(&v);
    v.name = "v";
    v.count = in->part.vertex_count;
    v.values = (insitu_array){means, INSITU_FLOAT64, 0};
    everywhere(insitu_set_mesh(session, "m", &in->mesh) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &in->field) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &v) == INSITU_OK);
    everywhere(draw_step(session, NULL, 0) == INSITU_OK);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

/* Checks that `interpolate: vertex` draws a cell field by the means at vertices, and that the default draws cell
 * values. Cells without a finite value of their own are ghosts here, because the vertex field v, with which the picture
 * is compared, cannot exclude them. */
static void smooth_layers_match_vertex_means(void **context)
{
    (void)context;
    static const char *const scenes[2][4] = {
        {SMOOTH("c", AT_VERTICES, "samples"), SMOOTH("v", "", "samples"), SMOOTH("c", "", "samples"),
         SMOOTH("c", ", interpolate: cell", "samples")},
        {SMOOTH("c", AT_VERTICES, "segments"), SMOOTH("v", AT_VERTICES, "segments"), SMOOTH("c", "", "segments"),
         SMOOTH("c", ", interpolate: cell", "segments")},
    };
    part_input in;
    test_partition_cells(&whole, TEST_RANDOM, SIDE, rank_count, owners);
    part_create(&in, own_rank, false);
    for (int64_t cell = 0; cell < in.part.cell_count; cell++)
        if (!isfinite(in.values[cell])) in.part.ghosts[cell] = 1;
    double *means = test_calloc((size_t)in.part.vertex_count + 1, sizeof *means);
    for (int64_t v = 0; v < in.part.vertex_count; v++) means[v] = compute_expected_mean(in.part.coordinates + 3 * v);
    for (int method = 0; method < 2; method++) {
        caught_picture pictures[4];
        for (int i = 0; i < 4; i++) pictures[i] = draw_smooth(scenes[method][i], &in, means);
        everywhere(are_same_pictures(&pictures[0], &pictures[1]));
        everywhere(are_same_pictures(&pictures[2], &pictures[3]));
        everywhere(own_rank != 0 || !are_same_pictures(&pictures[0], &pictures[2]));
        for (int i = 0; i < 4; i++) free(pictures[i].rgba), free(pictures[i].depth);
    }
    part_free(&in);
    test_free(means);
}

static int set_up_test_group(void **state)
{
    (void)state;
    test_mesh_make_lattice(TEST_MIXED, SIDE, 0.2, test_wave_field, &whole);
    owners = calloc((size_t)whole.cell_count, sizeof *owners);
    return 0;
}

static int tear_down_test_group(void **state)
{
    (void)state;
    free(owners);
    test_mesh_free(&whole);
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(means_equal_a_search_over_all_cells),
        cmocka_unit_test(means_follow_separated_cells),
        cmocka_unit_test(duplicated_vertices_are_merged),
        cmocka_unit_test(means_follow_values_that_changed_on_one_rank),
        cmocka_unit_test(surfaces_do_not_depend_on_the_partition),
        cmocka_unit_test(volumes_do_not_depend_on_the_partition),
        cmocka_unit_test(smooth_volumes_do_not_depend_on_the_partition),
        cmocka_unit_test(smooth_layers_match_vertex_means),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, tear_down_test_group);
}
