/* Checks the boxes of an outline: around all data, around each mesh over all ranks, and around the cells of each rank.
 * Each rank has two moved copies of one cube. If there are three or more ranks, rank 1 has no cells. */
#include <string.h>

#include "session.h"
#include "session_outline.h"
#include "test_session_fixture.h"

enum { SIDE = 2 };

static const char text[] = "images:\n  - name: a\n    size: [16, 12]\n    layers: [{surface: {}}]\n"
                           "    decorations: {outline: ranks}\n    outputs: [{path: a.png}]\n";

static bool is_empty(int rank)
{
    return rank_count >= 3 && rank == 1;
}

/* Sets a mesh of a cube of size 2. A rank's "far" cube is moved by 10 along x and by 4 × rank along y; its "near" cube
 * is moved by 4 × rank along z. */
static void set_cube_mesh(insitu_session *session, const char *name, bool is_far, session_input *in)
{
    input_create(in, TEST_HEXES, SIDE, TEST_BLOCK, 0, 1);
    for (int64_t v = 0; v < in->part.vertex_count; v++) {
        in->part.coordinates[3 * v] += is_far ? 10 : 0;
        in->part.coordinates[3 * v + (is_far ? 1 : 2)] += 4 * own_rank;
    }
    input_describe(in);
    if (is_empty(own_rank)) in->mesh.cell_count = in->mesh.connectivity_count = 0;
    everywhere(insitu_set_mesh(session, name, &in->mesh) == INSITU_OK);
}

static bool is_expected_box(const session_box *box, double x0, double y0, double z0, double x1, double y1, double z1)
{
    const double lower[3] = {x0, y0, z0}, upper[3] = {x1, y1, z1};
    return memcmp(box->lower, lower, sizeof lower) == 0 && memcmp(box->upper, upper, sizeof upper) == 0;
}

static session_outline find_outline(const insitu_session *session, scene_boxes of)
{
    session_outline out;
    base_error error = {.status = INSITU_OK};
    const scene_decorations decorations = {.is_given = true, .outline = of};
    everywhere(session_find_outline(&decorations, &session->catalogue, &session->meshes, &session->space.extent,
                                    &session->team, &out, &error) == INSITU_OK);
    everywhere(own_rank == 0 || out.count == 0);
    return out;
}

static void outlines_enclose_the_requested_meshes(void **state)
{
    (void)state;
    session_input near = {0}, far = {0};
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
    const double reach = 4 * (rank_count - 1) + 1;
    set_cube_mesh(session, "near", false, &near);
    set_cube_mesh(session, "far", true, &far);
    check_step_succeeds(session, 0);
    session_outline of_data = find_outline(session, SCENE_BOX_OF_DATA),
                    of_meshes = find_outline(session, SCENE_BOXES_OF_MESHES);
    session_outline of_ranks = find_outline(session, SCENE_BOXES_OF_RANKS), none = find_outline(session, SCENE_NO_BOX);
    bool is_well = none.count == 0;
    if (own_rank == 0) {
        is_well = is_well && of_data.count == 1 && is_expected_box(of_data.boxes, -1, -1, -1, 11, reach, reach);
        is_well = is_well && of_meshes.count == 2;
        for (int i = 0; i < 2 && is_well; i++)
            is_well = is_expected_box(&of_meshes.boxes[i], -1, -1, -1, 1, 1, reach) ||
                      is_expected_box(&of_meshes.boxes[i], 9, -1, -1, 11, reach, 1);
        is_well = is_well && of_ranks.count == (rank_count >= 3 ? rank_count - 1 : rank_count);
        for (int rank = 0, box = 0; rank < rank_count && is_well; rank++)
            if (!is_empty(rank))
                is_well = is_expected_box(&of_ranks.boxes[box++], -1, -1, -1, 11, 4 * rank + 1, 4 * rank + 1);
    }
    everywhere(is_well);
    session_free_outline(&of_data);
    session_free_outline(&of_meshes);
    session_free_outline(&of_ranks);
    insitu_destroy(&session);
    input_free(&near);
    input_free(&far);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(outlines_enclose_the_requested_meshes)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
