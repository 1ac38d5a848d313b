#include "bench_apart.h"

#include <signal.h>
#include <stdio.h>
#include <sys/wait.h>
#include <unistd.h>

/* Draws in the child process and writes the result to the pipe `to`. */
static void draw_and_send(const bench_vtk_request *request, float *rgba, size_t bytes, int seconds, int to)
{
    bench_vtk_result result = {0};
    alarm((unsigned)seconds);
    if (!freopen("/dev/null", "w", stderr)) _exit(1);
    if (!bench_vtk_draw(request, &result, rgba)) _exit(2);
    if (write(to, &result, sizeof result) != (ssize_t)sizeof result) _exit(3);
    for (size_t sent = 0; sent < bytes;) {
        const ssize_t now = write(to, (char *)rgba + sent, bytes - sent);
        if (now <= 0) _exit(3);
        sent += (size_t)now;
    }
    _exit(0);
}

static bool receive_block(int from, void *block, size_t bytes)
{
    for (size_t got = 0; got < bytes;) {
        const ssize_t now = read(from, (char *)block + got, bytes - got);
        if (now <= 0) return false;
        got += (size_t)now;
    }
    return true;
}

const char *bench_draw_in_child_process(const bench_vtk_request *request, int seconds, bench_vtk_result *result,
                                        float *rgba)
{
    const size_t bytes = 4 * (size_t)request->pixel_count * sizeof *rgba;
    int ends[2], status;
    fflush(stdout);
    if (pipe(ends)) return "no pipe";
    const pid_t child = fork();
    if (child < 0) return "no process";
    if (child == 0) draw_and_send(request, rgba, bytes, seconds, ends[1]);
    close(ends[1]);
    const bool is_whole = receive_block(ends[0], result, sizeof *result) && receive_block(ends[0], rgba, bytes);
    close(ends[0]);
    waitpid(child, &status, 0);
    if (WIFSIGNALED(status)) return WTERMSIG(status) == SIGALRM ? "too slow" : "crashed";
    return is_whole && WEXITSTATUS(status) == 0 ? "ok" : "not drawn";
}
