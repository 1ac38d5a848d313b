/* Checks ranks on nodes with different CPUs: each rank may use another instruction set, and the picture must be that of
 * the lowest instruction set of all ranks. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "render_isa.h"
#include "test_session_fixture.h"

enum { WIDTH = 60, HEIGHT = 45 };

static const char *const layers[] = {
    "isosurface: {field: f, values: [0.1, -0.6]}",
    "volume: {field: f, opacity: [[0, 0.2], [1, 0.9]]}\n    sampling: {method: samples}",
    "volume: {field: f, opacity: [[0, 0.2], [1, 0.9]]}\n    sampling: {method: segments}",
    "volume: {field: f, opacity: [[0, 0.2], [1, 0.9]]}\n    sampling: {max_error: 0.01}",
};

static const char *write_layer_scene(const char *layer)
{
    char text[1024];
    snprintf(text, sizeof text,
             "images:\n  - name: a\n    size: [%d, %d]\n    layers:\n      - %s\n"
             "    outputs:\n      - path: a_{cycle}.exr\n",
             WIDTH, HEIGHT, layer);
    return write_scene(text);
}

/* Returns the picture of the whole mesh that rank 0 draws in a session of its own. */
static caught_picture draw_alone(const char *scene, test_mesh_kind kind)
{
    caught_picture picture = {0};
    bool is_drawn = own_rank != 0;
    if (own_rank == 0) {
        session_input whole;
        input_create(&whole, kind, 5, TEST_BLOCK, 0, 1);
        insitu_session *session = open_session(MPI_COMM_SELF, scene);
        discard_pictures();
        is_drawn =
            submit_input(session, &whole) == INSITU_OK && insitu_step(session, 0, 0) == INSITU_OK && caught_count == 1;
        picture = caught[0];
        caught_count = 0;
        insitu_destroy(&session);
        input_free(&whole);
    }
    everywhere(is_drawn);
    return picture;
}

static void check_mixed_isas(test_mesh_kind kind, int layer)
{
    const char *scene = write_layer_scene(layers[layer]);
    caught_picture alone = draw_alone(scene, kind);
    session_input part;
    input_create(&part, kind, 5, TEST_RANDOM, own_rank, rank_count);
    insitu_session *session = open_session(MPI_COMM_WORLD, scene);
    everywhere(submit_input(session, &part) == INSITU_OK);
    check_step_succeeds(session, 0);
    const char *warnings = insitu_last_report(session)->warnings;
    everywhere(!strstr(warnings, "overlap"));
    everywhere(strstr(warnings, "kernels are plain, the best that all ranks have: rank 0 has no better") != NULL);
    everywhere(strstr(warnings, "rank 1: INSITU_ISA=none is none of avx512, ") != NULL);
    const bool is_same = own_rank != 0 || (!memcmp(alone.rgba, caught[0].rgba, sizeof(float) * 4 * WIDTH * HEIGHT) &&
                                           !memcmp(alone.depth, caught[0].depth, sizeof(float) * WIDTH * HEIGHT));
    everywhere(is_same || layer > 0);
    everywhere(own_rank != 0 || largest_colour_difference(&alone, &caught[0]) <= 1e-6);
    insitu_destroy(&session);
    input_free(&part);
    free(alone.rgba);
    free(alone.depth);
}

static void ranks_of_mixed_instruction_sets_use_the_lowest(void **context)
{
    (void)context;
    for (int kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int layer = 0; layer < (int)(sizeof layers / sizeof layers[0]); layer++)
            check_mixed_isas((test_mesh_kind)kind, layer);
}

static int set_up_test_group(void **state)
{
    (void)state;
    /* "none" is not the name of a set, so that the best set is used, and a warning is given on all ranks */
    static const char *const sets[] = {"plain", "none", "sse4.2"};
    setenv("INSITU_ISA", sets[own_rank % 3], 1); /* before the library first reads the variable */
    return 0;
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ranks_of_mixed_instruction_sets_use_the_lowest),
    };
    return run_session_tests(argc, argv, tests, set_up_test_group, NULL);
}
