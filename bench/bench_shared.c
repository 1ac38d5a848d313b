/* Measures steps with new values while another process uses a core: the cost of a step for a simulation if one of its
 * cores has other work. Steps on one thread and on all threads, with and without the other process, are measured in
 * turns; a turn's time is the mean of some steps. Prints CSV. */
#define _GNU_SOURCE 1
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <mpi.h>

#include "bench_command.h"
#include "bench_session.h"

enum { STEPS = 10 };

static pid_t spinner;

/* Starts a child process that spins. It is stopped except during measurements, and ends with this process. */
static void start_spinner(void)
{
    spinner = fork();
    if (spinner < 0) {
        perror("fork");
        exit(1);
    }
    if (spinner > 0) {
        kill(spinner, SIGSTOP);
        return;
    }
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    for (volatile unsigned turn = 0;; turn++) continue;
}

static const char *const places[2] = {"alone", "beside a spinning process"};

/* Measures the mean time of STEPS steps, and adds it to series[place]. The spinning process runs if place is 1. */
static void measure_once(bench_session *session, int place, int number, bench_series series[2])
{
    double sum = 0;
    if (place) kill(spinner, SIGCONT);
    session->whole.count = 0;
    for (int step = 0; step <= STEPS; step++) bench_session_step(session, step);
    if (place) kill(spinner, SIGSTOP);
    for (int i = 0; i < session->whole.count; i++) sum += session->whole.seconds[i];
    bench_add_sample(sum / session->whole.count, number, &series[place]);
}

static void print_series(const bench_subject *subject, bench_picture picture, bench_series series[2])
{
    char measure[96];
    for (int place = 0; place < 2; place++) {
        snprintf(measure, sizeof measure, "%s new values %s", bench_picture_name(picture), places[place]);
        bench_print_series(subject, measure, &series[place]);
    }
}

static void measure_picture(bench_scene *scene, bench_picture picture, int runs)
{
    const int all = scene->subject.threads;
    bench_session sessions[2];
    bench_series series[2][2] = {0};
    for (int k = 0; k < 2; k++) {
        scene->subject.threads = k ? all : 1;
        bench_session_create(&sessions[k], scene, picture, BENCH_NEW_VALUES);
    }
    for (int number = 0; number <= runs; number++)
        for (int k = 0; k < 2; k++)
            for (int place = 0; place < 2; place++) measure_once(&sessions[k], place, number, series[k]);
    for (int k = 0; k < 2; k++) {
        scene->subject.threads = k ? all : 1;
        print_series(&scene->subject, picture, series[k]);
        bench_session_free(&sessions[k]);
    }
}

static void measure_mesh(const bench_command *command, test_mesh_kind kind, int n)
{
    static const bench_picture pictures[] = {BENCH_ISOSURFACE, BENCH_VOLUME};
    bench_scene scene;
    bench_scene_create(&scene, "bench_shared", kind, n);
    bench_scene_resize(&scene, BENCH_WIDTH / command->shrink, BENCH_HEIGHT / command->shrink);
    for (size_t i = 0; i < sizeof pictures / sizeof *pictures; i++) measure_picture(&scene, pictures[i], command->runs);
    bench_scene_free(&scene);
}

int main(int argc, char **argv)
{
    start_spinner();
    MPI_Init(&argc, &argv);
    const int status = bench_measure_meshes(
        argc, argv,
        "Measures steps of new values for each MESH (tets or hexes) of N^3 cubes, alone and beside a\n"
        "process that spins, on one thread and on all.",
        TEST_HEXES, measure_mesh);
    MPI_Finalize();
    kill(spinner, SIGKILL);
    return status;
}
