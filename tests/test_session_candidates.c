/* Checks trees over candidates only, which are the cells that can be visible. Their pictures must be bit-identical to
 * those of full trees, which contain all cells, whatever changes during a run. Also checks the automatic choice between
 * partial and full trees. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session.h"
#include "test_effort.h"
#include "test_session_fixture.h"

#define IMAGE(layers)                                                                                                  \
    "images:\n  - name: a\n    size: [40, 30]\n    background: [0, 0, 0, 1]\n    layers:\n" layers                     \
    "    outputs:\n      - path: a_{cycle}.exr\n"
#define SURFACE "      - isosurface: {field: f, values: [0.1]}\n"
#define SURFACES "      - isosurface: {field: f, values: [-0.8, 0.4], opacity: 0.5}\n"
#define VOLUME "      - volume: {field: f, range: [-1, 1], opacity: [[0.6, 0], [0.7, 0.5], [0.8, 0]]}\n"
#define STEPPED "      - volume: {field: f, range: [-1, 1], opacity: [[0.6, 0], [0.6, 0.5], [0.7, 0.5], [0.7, 0]]}\n"
#define OWN_RANGE "      - volume: {field: f, opacity: [[0, 0.5], [1, 0.5]]}\n"
#define PEAKS "      - isosurface: {field: f, values: [1.2]}\n"
#define TROUGHS "      - isosurface: {field: f, values: [-1]}\n"
#define DIFFERENCES "      - isosurface: {field: f, values: [0.1], normals: differences}\n"

static const test_mesh_kind kinds[] = {TEST_TETS, TEST_MIXED, TEST_POLYHEDRA};

/* Opens a session that builds the given kind of tree. The kind is not in the scene file, because sessions of several
 * kinds read the same file, and reload it after a change. */
static insitu_session *open_tree(scene_tree tree, const char *scene)
{
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    session->scene_file.scene.tree = tree;
    return session;
}

/* Makes a step of both sessions, in which meshes are already set, and checks that their pictures are bit-identical. */
static void step_and_compare(insitu_session *full, insitu_session *other, int64_t cycle)
{
    discard_pictures();
    check_reported_everywhere(full, insitu_step(full, cycle, 0), INSITU_OK, "");
    check_reported_everywhere(other, insitu_step(other, cycle, 0), INSITU_OK, "");
    if (own_rank == 0) {
        const caught_picture *a = &caught[0], *b = &caught[1];
        const size_t pixels = (size_t)a->width * (size_t)a->height;
        assert_int_equal(caught_count, 2);
        assert_memory_equal(a->rgba, b->rgba, pixels * 4 * sizeof(float));
        assert_memory_equal(a->depth, b->depth, pixels * sizeof(float));
        float sum = 0;
        for (size_t i = 0; i < 4 * pixels; i++) sum += i % 4 < 3 ? a->rgba[i] : 0;
        assert_true(sum > 1);
    }
    everywhere(insitu_last_report(full)->cells_unusable == insitu_last_report(other)->cells_unusable);
}

static void submit_and_compare(insitu_session *full, insitu_session *other, const session_input *in, int64_t cycle)
{
    everywhere(submit_input(full, in) == INSITU_OK && submit_input(other, in) == INSITU_OK);
    step_and_compare(full, other, cycle);
}

/* Returns the number of cells in the trees of all ranks. */
static int64_t count_tree_cells(const insitu_session *session)
{
    int64_t own = session->meshes.count ? session->meshes.items[0]->tree.cell_count : 0, all = 0;
    MPI_Allreduce(&own, &all, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    return all;
}

static void shift_values(session_input *in, double by)
{
    for (int64_t i = 0; i < in->part.vertex_count; i++) in->part.values[i] += by;
}

/* Compares trees of the given kind with full trees: for new values, moved vertices, a NaN, new cells, and a step
 * without any change. */
static void compare_trees(scene_tree tree, const char *images, test_mesh_kind kind)
{
    const char *scene = write_scene(images);
    insitu_session *full = open_tree(SCENE_TREE_FULL, scene), *other = open_tree(tree, scene);
    session_input in;
    input_create(&in, kind, 6, TEST_CHECKERBOARD, own_rank, rank_count);
    submit_and_compare(full, other, &in, 0);
    in.mesh.changed = INSITU_CHANGED_NOTHING;
    shift_values(&in, 0.15);
    submit_and_compare(full, other, &in, 1);
    in.field.changed = INSITU_CHANGED_NOTHING;
    submit_and_compare(full, other, &in, 2);
    in.mesh.changed = INSITU_CHANGED_GEOMETRY;
    for (int64_t i = 0; i < in.part.vertex_count; i++) in.part.coordinates[3 * i] *= 1.125;
    submit_and_compare(full, other, &in, 3);
    in.mesh.changed = INSITU_CHANGED_NOTHING;
    in.field.changed = INSITU_CHANGED_VALUES;
    if (in.part.vertex_count) in.part.values[in.part.vertex_count / 2] = NAN;
    submit_and_compare(full, other, &in, 4);
    input_free(&in);
    input_create(&in, kind, 5, TEST_RANDOM, own_rank, rank_count);
    submit_and_compare(full, other, &in, 5);
    input_free(&in);
    insitu_destroy(&full);
    insitu_destroy(&other);
}

static void partial_trees_draw_same_picture_as_full_trees(void **context)
{
    static const char *const images[] = {IMAGE(SURFACE),         IMAGE(SURFACES),  IMAGE(VOLUME),     IMAGE(STEPPED),
                                         IMAGE(SURFACE STEPPED), IMAGE(OWN_RANGE), IMAGE(DIFFERENCES)};
    (void)context;
    for (size_t i = 0; i < sizeof images / sizeof images[0]; i++)
        for (size_t kind = 0; kind < sizeof kinds / sizeof kinds[0]; kind++) {
            if (!test_is_long_run() && (i + kind) % 2) continue;
            compare_trees(SCENE_TREE_PARTIAL, images[i], kinds[kind]);
            if (kind == 0) compare_trees(SCENE_TREE_AUTO, images[i], kinds[kind]);
        }
}

/* Checks that partial trees contain the visible cells only: those whose values overlap an interval of width 0.1. The
 * report must state how many cells are left out. */
static void partial_trees_contain_the_visible_cells(void **context)
{
    (void)context;
    session_input in;
    input_create(&in, TEST_TETS, 6, TEST_BLOCK, own_rank, rank_count);
    int64_t straddling = 0, all = 0;
    for (int64_t cell = 0; cell < in.part.cell_count; cell++) {
        double low = INFINITY, high = -INFINITY;
        for (int64_t i = in.part.offsets[cell]; i < in.part.offsets[cell + 1]; i++) {
            low = fmin(low, in.part.values[in.part.connectivity[i]]);
            high = fmax(high, in.part.values[in.part.connectivity[i]]);
        }
        straddling += low <= 0.1 && high >= 0.1;
    }
    MPI_Allreduce(&straddling, &all, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    insitu_session *session = open_tree(SCENE_TREE_PARTIAL, write_scene(IMAGE(SURFACE)));
    everywhere(submit_input(session, &in) == INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_OK, "");
    everywhere(count_tree_cells(session) == all);
    everywhere(in.part.cell_count == 0 || strstr(insitu_last_report(session)->left_out, "show nothing in this step"));
    discard_pictures();
    insitu_destroy(&session);
    input_free(&in);
}

/* Checks the automatic choice of trees. As long as the cells change at every step, trees are partial. When cells stop
 * changing, the accumulated extra cost of partial trees reaches the cost of a full tree, which is then built and
 * kept. */
static void static_cells_get_a_full_tree(void **context)
{
    (void)context;
    session_input in;
    input_create(&in, TEST_TETS, 10, TEST_BLOCK, own_rank, rank_count);
    int64_t cells = in.part.cell_count, all = 0;
    MPI_Allreduce(&cells, &all, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    insitu_session *session = open_tree(SCENE_TREE_AUTO, write_scene(IMAGE(PEAKS)));
    int64_t cycle = 0;
    for (; cycle < 3; cycle++) {
        everywhere(submit_input(session, &in) == INSITU_OK);
        check_reported_everywhere(session, insitu_step(session, cycle, 0), INSITU_OK, "");
        everywhere(count_tree_cells(session) < all);
    }
    in.mesh.changed = INSITU_CHANGED_NOTHING;
    while (count_tree_cells(session) < all && cycle < 1000) {
        shift_values(&in, 1e-6);
        everywhere(submit_input(session, &in) == INSITU_OK);
        check_reported_everywhere(session, insitu_step(session, cycle++, 0), INSITU_OK, "");
        discard_pictures();
    }
    everywhere(count_tree_cells(session) == all);
    shift_values(&in, 1e-6);
    everywhere(submit_input(session, &in) == INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, cycle, 0), INSITU_OK, "");
    everywhere(insitu_last_report(session)->build_ms == 0 &&
               (insitu_last_report(session)->refit_ms > 0 || in.part.cell_count == 0));
    discard_pictures();
    insitu_destroy(&session);
    input_free(&in);
}

/* Checks that full trees are built if nearly all cells are visible, since a partial tree would save nothing. */
static void full_trees_are_built_if_most_cells_are_visible(void **context)
{
    (void)context;
    session_input in;
    input_create(&in, TEST_HEXES, 6, TEST_BLOCK, own_rank, rank_count);
    int64_t cells = in.part.cell_count, all = 0;
    MPI_Allreduce(&cells, &all, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    insitu_session *session =
        open_tree(SCENE_TREE_AUTO,
                  write_scene(IMAGE("      - volume: {field: f, range: [-4, 4], opacity: [[0, 0.1], [1, 0.5]]}\n")));
    everywhere(submit_input(session, &in) == INSITU_OK);
    check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_OK, "");
    everywhere(count_tree_cells(session) == all && !session->meshes.items[0]->is_partial);
    discard_pictures();
    insitu_destroy(&session);
    input_free(&in);
}

/* Returns the cost of traversing the tree. The cost is higher if the tree is built along a space-filling curve than if
 * it is built by the surface area heuristic. */
static double compute_tree_cost(const insitu_session *session)
{
    return mmbvh_cost(&session->meshes.items[0]->tree, &(mmbvh_options){.threads = 1});
}

/* Checks the fast building of trees that are used for one step only. The mesh is submitted to two sessions in each
 * step. To the session `still` it is declared unchanged, so that this session keeps its first tree, built by the
 * surface area heuristic. The session `moving` rebuilds its tree in each step in which the mesh is declared as changed:
 * along a space-filling curve from the second step on, but by the heuristic after a tree was kept for a step. Pictures
 * of both sessions must be bit-identical. */
static void trees_of_one_step_are_built_fast(void **context)
{
    (void)context;
    session_input in;
    const char *scene = write_scene(IMAGE(SURFACE));
    input_create(&in, TEST_TETS, 10, TEST_BLOCK, own_rank, rank_count);
    insitu_session *still = open_tree(SCENE_TREE_FULL, scene), *moving = open_tree(SCENE_TREE_FULL, scene);
    static const bool is_anew[] = {true, true, true, false, true}, is_fast[] = {false, true, true, true, false};
    for (int step = 0; step < 5; step++) {
        in.mesh.changed = step ? INSITU_CHANGED_NOTHING : INSITU_CHANGED_ALL;
        everywhere(submit_input(still, &in) == INSITU_OK);
        in.mesh.changed = is_anew[step] ? INSITU_CHANGED_ALL : INSITU_CHANGED_NOTHING;
        everywhere(submit_input(moving, &in) == INSITU_OK);
        step_and_compare(still, moving, step);
        everywhere(in.part.cell_count < 100 ||
                   (compute_tree_cost(moving) != compute_tree_cost(still)) == is_fast[step]);
    }
    insitu_destroy(&still);
    insitu_destroy(&moving);
    input_free(&in);
}

static void move_vertices_periodically(session_input *in, double by)
{
    for (int64_t i = 0; i < in->part.vertex_count; i++) {
        double *p = in->part.coordinates + 3 * i;
        p[0] += by * sin(3 * p[1]);
        p[2] += by * sin(2 * p[0] + 1);
    }
}

/* Compares moving meshes with a second session that rebuilds its trees at each step. First the vertices move while the
 * cells stay, with or without new values; then only values change, which can make cells visible whose bounds were not
 * refitted. Images a and b are due alternately from cycle 2 on. */
static void compare_moving_meshes(const char *images, test_mesh_kind kind)
{
    static const struct {
        double sway, change;
        bool is_partial; /* whether refits may skip nodes, so that some bounds are out of date */
    } steps[] = {{0, 0, false},      {0.05, 0, true}, {0.05, 0, true}, {0.05, 0.1, true},
                 {0, 0.3, false},    {0, 0.2, false}, {-0.1, 0, true}, {0, 0, true},
                 {0.05, -0.2, true}, {0, 0, true},    {0, 0.1, false}};
    const char *scene = write_scene(images);
    insitu_session *anew = open_tree(SCENE_TREE_FULL, scene), *kept = open_tree(SCENE_TREE_FULL, scene);
    session_input in;
    bool was_partial = false;
    input_create(&in, kind, 9, TEST_BLOCK, own_rank, rank_count);
    for (int i = 0; i < (int)(sizeof steps / sizeof steps[0]); i++) {
        move_vertices_periodically(&in, steps[i].sway);
        shift_values(&in, steps[i].change);
        in.mesh.changed = INSITU_CHANGED_ALL;
        in.field.changed = INSITU_CHANGED_VALUES;
        everywhere(submit_input(anew, &in) == INSITU_OK);
        if (i) in.mesh.changed = steps[i].sway != 0 ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_NOTHING;
        everywhere(submit_input(kept, &in) == INSITU_OK);
        step_and_compare(anew, kept, 3 * i + 2 + i % 2);
        was_partial = was_partial || kept->meshes.items[0]->are_bounds_partial;
        everywhere(!kept->meshes.items[0]->are_bounds_partial || steps[i].is_partial);
    }
    everywhere(was_partial || in.part.cell_count < 1000);
    insitu_destroy(&anew);
    insitu_destroy(&kept);
    input_free(&in);
}

static void moving_vertices_draw_same_picture_as_new_trees(void **context)
{
    static const char *const images[] = {IMAGE(SURFACE), IMAGE(SURFACES VOLUME), IMAGE(STEPPED)};
    (void)context;
    for (size_t i = 0; i < sizeof images / sizeof images[0]; i++)
        for (size_t kind = 0; kind < sizeof kinds / sizeof kinds[0]; kind++)
            if (test_is_long_run() || (i + kind) % 3 == 0) compare_moving_meshes(images[i], kinds[kind]);
}

/* Checks that bounds refitted for one image are not used for another. Two images with different layers of the mesh are
 * due alternately, so that the visible cells differ from step to step although values stay. The mesh drifts upwards,
 * and the camera of b looks at the position of b's surface at cycle 9: with the bounds from a step that drew only a,
 * the surface would be below the picture. */
#define CAMERA "    camera: {position: [2.3, 0, 0.56], focal: [0, 0, 0.56], up: [0, 0, 1], angle: 1.7}\n"
static void bounds_of_one_image_are_not_used_for_another(void **context)
{
    const char *scene = write_scene("images:\n"
                                    "  - name: a\n    size: [40, 30]\n    every: 2\n    layers:\n" TROUGHS
                                    "    outputs:\n      - path: a_{cycle}.exr\n"
                                    "  - name: b\n    size: [40, 30]\n    every: 3\n" CAMERA "    layers:\n" PEAKS
                                    "    background: [0, 0, 0, 1]\n    outputs:\n      - path: b_{cycle}.exr\n");
    static const int cycles[] = {2, 3, 4, 9};
    session_input in;
    (void)context;
    insitu_session *anew = open_tree(SCENE_TREE_FULL, scene), *kept = open_tree(SCENE_TREE_FULL, scene);
    input_create(&in, TEST_TETS, 13, TEST_BLOCK, own_rank, rank_count);
    for (int64_t i = 0; i < in.part.vertex_count; i++) in.part.values[i] = 4 * in.part.coordinates[3 * i + 2];
    for (int i = 0; i < 4; i++) {
        const bool is_moved = i == 1 || i == 2;
        for (int64_t v = 0; v < in.part.vertex_count; v++) in.part.coordinates[3 * v + 2] += is_moved ? 0.12 : 0;
        in.mesh.changed = INSITU_CHANGED_ALL;
        everywhere(submit_input(anew, &in) == INSITU_OK);
        if (i) in.mesh.changed = is_moved ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_NOTHING;
        everywhere(submit_input(kept, &in) == INSITU_OK);
        if (i != 1)
            step_and_compare(anew, kept, cycles[i]);
        else
            everywhere(insitu_step(anew, 3, 0) == INSITU_OK && insitu_step(kept, 3, 0) == INSITU_OK);
    }
    insitu_destroy(&anew);
    insitu_destroy(&kept);
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(partial_trees_draw_same_picture_as_full_trees),
                                       cmocka_unit_test(trees_of_one_step_are_built_fast),
                                       cmocka_unit_test(partial_trees_contain_the_visible_cells),
                                       cmocka_unit_test(static_cells_get_a_full_tree),
                                       cmocka_unit_test(full_trees_are_built_if_most_cells_are_visible),
                                       cmocka_unit_test(moving_vertices_draw_same_picture_as_new_trees),
                                       cmocka_unit_test(bounds_of_one_image_are_not_used_for_another)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
