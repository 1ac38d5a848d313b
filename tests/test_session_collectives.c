/* Counts the library's collective MPI calls in a step, each of which synchronizes all ranks. */
#include <mpi.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "session_image.h"
#include "test_session_fixture.h"

enum { MOST_IDLE = 1 };

static int calls;

/* Replacements of MPI functions: the linker resolves the library's calls to these counters, which call the PMPI
 * functions. */
int MPI_Allreduce(const void *send, void *receive, int count, MPI_Datatype type, MPI_Op op, MPI_Comm comm)
{
    calls++;
    return PMPI_Allreduce(send, receive, count, type, op, comm);
}

int MPI_Bcast(void *buffer, int count, MPI_Datatype type, int root, MPI_Comm comm)
{
    calls++;
    return PMPI_Bcast(buffer, count, type, root, comm);
}

int MPI_Allgather(const void *send, int count, MPI_Datatype type, void *receive, int receive_count,
                  MPI_Datatype receive_type, MPI_Comm comm)
{
    calls++;
    return PMPI_Allgather(send, count, type, receive, receive_count, receive_type, comm);
}

int MPI_Gather(const void *send, int count, MPI_Datatype type, void *receive, int receive_count,
               MPI_Datatype receive_type, int root, MPI_Comm comm)
{
    calls++;
    return PMPI_Gather(send, count, type, receive, receive_count, receive_type, root, comm);
}

int MPI_Alltoall(const void *send, int count, MPI_Datatype type, void *receive, int receive_count,
                 MPI_Datatype receive_type, MPI_Comm comm)
{
    calls++;
    return PMPI_Alltoall(send, count, type, receive, receive_count, receive_type, comm);
}

int MPI_Barrier(MPI_Comm comm)
{
    calls++;
    return PMPI_Barrier(comm);
}

int MPI_Ibarrier(MPI_Comm comm, MPI_Request *request)
{
    calls++;
    return PMPI_Ibarrier(comm, request);
}

int MPI_Iallreduce(const void *send, void *receive, int count, MPI_Datatype type, MPI_Op op, MPI_Comm comm,
                   MPI_Request *request)
{
    calls++;
    return PMPI_Iallreduce(send, receive, count, type, op, comm, request);
}

int MPI_Alltoallv(const void *send, const int counts[], const int places[], MPI_Datatype type, void *receive,
                  const int receive_counts[], const int receive_places[], MPI_Datatype receive_type, MPI_Comm comm)
{
    calls++;
    return PMPI_Alltoallv(send, counts, places, type, receive, receive_counts, receive_places, receive_type, comm);
}

typedef struct counted_scene {
    const char *name, *layer;
    int most; /* maximum number of calls of a step that draws */
} counted_scene;

static const counted_scene scenes[] = {
    {"isosurface", "      - isosurface: {field: f, values: [0.1]}\n", 6},
    {"transparent isosurfaces", "      - isosurface: {field: f, values: [-0.2, 0.1], opacity: 0.5}\n", 6},
    {"volume",
     "      - volume: {field: f, map: viridis, range: [-1, 1], opacity: [[0, 0], [1, 0.5]], unit_distance: 1}\n", 6},
    /* One more call than for an isosurface: it finds out how the plane intersects the cells. */
    {"slice", "      - slice: {field: f, range: [-1, 1], planes: [{normal: [1, 2, 3]}]}\n", 7},
    /* Two more calls than for an isosurface: one for the plane, one for the extremes of the values. Percentiles take
     * eight more: one for the plane, one that finds out whether cells with a volume count, and one for each of six
     * digits. */
    {"slice by its extremes", "      - slice: {field: f, planes: [{normal: [1, 2, 3]}]}\n", 8},
    {"slice by percentiles", "      - slice: {field: f, range: {percentile: [2, 98]}, planes: [{normal: [1, 2, 3]}]}\n",
     14},
    /* Two more calls: which faces are stale; whether there is memory for their values. */
    {"outer surface", "      - surface: {colour_by: {field: f, range: [-1, 1]}}\n", 8},
    /* Three more calls: which values are stale; sending values to the ranks that compute means; sending the means
     * back. */
    {"isosurface of a cell field", "      - isosurface: {field: c, values: [0.1]}\n", 9},
    /* Four more calls: what the layers need; sending vertices to neighbours; the largest gradient; sending the sums
     * back. */
    {"vertex normals", "      - isosurface: {field: f, values: [0.1], normals: vertex}\n", 10},
    /* Four more calls: ranges of values; bounding boxes; sending hits to neighbours; sending samples back. */
    {"differences", "      - isosurface: {field: f, values: [0.1], normals: differences}\n", 10},
};

static const char *write_counted_scene(const counted_scene *s)
{
    char text[600];
    snprintf(text, sizeof text,
             "images:\n  - name: a\n    size: [64, 48]\n    every: 2\n"
             "    camera: {position: [3, 2.2, 4], focal: [0, 0, 0], angle: 40}\n"
             "    layers:\n%s    outputs: [{path: a.exr}]\n",
             s->layer);
    return write_scene(text);
}

/* Counts the collective calls of the third and the fourth step, in which everything about the unchanged mesh is already
 * known. The thread that writes pictures makes no MPI calls. */
static void count_steps(const counted_scene *s)
{
    session_input in;
    input_create(&in, TEST_HEXES, 6, TEST_BLOCK, own_rank, rank_count);
    insitu_session *session = open_session(MPI_COMM_WORLD, write_counted_scene(s));
    insitu_field cells = in.field;
    double *values = calloc((size_t)in.part.cell_count + 1, sizeof *values);
    assert_non_null(values);
    for (int64_t i = 0; i < in.part.cell_count; i++) values[i] = test_uniform_between((uint64_t)i, 4, -1, 1);
    cells.name = "c", cells.centring = INSITU_CELL, cells.count = in.part.cell_count, cells.values.data = values;
    everywhere(submit_input(session, &in) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &cells) == INSITU_OK);
    for (int cycle = 0; cycle < 2; cycle++) everywhere(insitu_step(session, cycle, cycle) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &in.field) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", &cells) == INSITU_OK);
    calls = 0;
    const insitu_status drawn = insitu_step(session, 2, 2);
    const int of_drawn = calls;
    calls = 0;
    const insitu_status idle = insitu_step(session, 3, 3);
    const int of_idle = calls;
    if (own_rank == 0) printf("%s: %d of a drawn step, %d of an idle one\n", s->name, of_drawn, of_idle);
    everywhere(drawn == INSITU_OK && idle == INSITU_OK);
    everywhere(insitu_last_report(session)->images == 0);
    everywhere(of_drawn > 2 && of_drawn <= s->most);
    everywhere(of_idle <= MOST_IDLE);
    everywhere(insitu_destroy(&session) == INSITU_OK);
    input_free(&in);
    free(values);
    discard_pictures();
}

static void step_makes_few_collective_calls(void **state)
{
    (void)state;
    session_writes_behind = true;
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) count_steps(&scenes[i]);
    session_writes_behind = false;
}

/* Checks that pictures are bit-identical for every communication schedule of fragments, and that the report states the
 * schedule and the number of bytes it sends. */
static void schedules_change_no_bit_and_are_reported(void **context)
{
    static const char *const names[] = {"auto", "direct", "nodes", "radix", "binary"};
    enum { BYTES = 64 * 48 * 4 * sizeof(float) };
    static char first[BYTES];
    session_input in;
    (void)context;
    input_create(&in, TEST_MIXED, 6, TEST_RANDOM, own_rank, rank_count);
    for (int i = 0; i < 5; i++) {
        char text[900];
        snprintf(text, sizeof text, "schedule: %s\n%s", names[i],
                 "images:\n  - name: a\n    size: [64, 48]\n    layers:\n"
                 "      - isosurface: {field: f, values: [-0.2, 0.1], opacity: 0.5}\n"
                 "    outputs: [{path: a.exr}]\n");
        insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(text));
        everywhere(submit_input(session, &in) == INSITU_OK);
        check_reported_everywhere(session, insitu_step(session, 0, 0), INSITU_OK, "");
        const insitu_report *report = insitu_last_report(session);
        int64_t sent = 0;
        MPI_Allreduce(&report->bytes_sent, &sent, 1, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
        everywhere((sent > 0) == (rank_count > 1));
        everywhere(rank_count == 1 ? !*report->schedule
                   : i == 0        ? *report->schedule != 0
                                   : !strcmp(report->schedule, names[i]));
        if (own_rank == 0 && i == 0) memcpy(first, caught[0].rgba, BYTES);
        everywhere(own_rank != 0 || memcmp(first, caught[0].rgba, BYTES) == 0);
        discard_pictures();
        insitu_destroy(&session);
    }
    input_free(&in);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(step_makes_few_collective_calls),
                                       cmocka_unit_test(schedules_change_no_bit_and_are_reported)};
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
