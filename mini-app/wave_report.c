/* Each column of the printed table shows the maximum over all ranks. The times in a line may therefore belong to
 * different ranks, and need not add up to the total. */
#include "wave_report.h"

#include <stdio.h>
#include <string.h>
#include <unistd.h>

static double read_resident_bytes(void)
{
    long total = 0, resident = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (!file) return 0;
    if (fscanf(file, "%ld %ld", &total, &resident) != 2) resident = 0;
    fclose(file);
    return (double)resident * (double)sysconf(_SC_PAGESIZE);
}

void wave_report_begin(MPI_Comm comm, const wave_options *options, const wave_mesh *mesh, const wave_solver *solver,
                       wave_report *report)
{
    int ranks;
    long long cells[3] = {mesh->own_cells, mesh->own_cells, -(long long)mesh->own_cells}, sum;
    *report = (wave_report){.comm = comm};
    MPI_Comm_rank(comm, &report->rank);
    MPI_Comm_size(comm, &ranks);
    MPI_Reduce(cells, &sum, 1, MPI_LONG_LONG, MPI_SUM, 0, comm);
    MPI_Reduce(report->rank ? cells : MPI_IN_PLACE, cells, 3, MPI_LONG_LONG, MPI_MAX, 0, comm);
    report->memory_before = read_resident_bytes();
    if (report->rank != 0) return;
    printf("insitu-wave: %lld cells (%d x %d x %d cubes) on %d ranks (%lld to %lld each), %d steps of %.3g\n", sum,
           options->size[0], options->size[1], options->size[2], ranks, -cells[2], cells[0], options->steps,
           solver->time_step);
    printf("times in ms and memory in MB, of the slowest and the largest rank\n");
    printf("%7s %8s %9s %9s |%8s %8s %8s %8s %8s %9s %8s |%7s %8s\n", "step", "time", "simulate", "insitu", "prepare",
           "build", "refit", "surface", "volume", "composite", "write", "peak", "grown");
    fflush(stdout);
}

void wave_report_step(wave_report *report, int64_t cycle, double time, double simulation_ms, double insitu_ms,
                      const insitu_report *insitu)
{
    double v[] = {simulation_ms,
                  insitu_ms,
                  insitu->prepare_ms,
                  insitu->build_ms,
                  insitu->refit_ms,
                  insitu->surface_ms,
                  insitu->volume_ms,
                  insitu->composite_ms,
                  insitu->write_ms,
                  (double)insitu->bytes_peak,
                  read_resident_bytes() - report->memory_before};
    enum { COUNT = sizeof v / sizeof *v };
    MPI_Reduce(report->rank ? v : MPI_IN_PLACE, v, COUNT, MPI_DOUBLE, MPI_MAX, 0, report->comm);
    if (report->rank != 0) return;
    report->simulation_ms += v[0];
    report->insitu_ms += v[1];
    report->bytes_peak = v[9] > report->bytes_peak ? v[9] : report->bytes_peak;
    report->bytes_grown = v[10] > report->bytes_grown ? v[10] : report->bytes_grown;
    printf("%7lld %8.4f %9.1f %9.1f |%8.1f %8.1f %8.1f %8.1f %8.1f %9.1f %8.1f |%7.1f %8.1f\n", (long long)cycle, time,
           v[0], v[1], v[2], v[3], v[4], v[5], v[6], v[7], v[8], v[9] * 1e-6, v[10] * 1e-6);
    fflush(stdout);
}

/* Shortens the text to the YAML scalar at its beginning, without quotes. The scalar ends at the closing quote, or
 * before a comma, a blank, a closing bracket, or a closing brace that was not opened in the scalar ("{cycle}" contains
 * both braces). */
static void cut_text_after_scalar(char *text)
{
    char quote = *text == '"' || *text == '\'' ? *text : 0;
    int open = 0;
    if (quote) memmove(text, text + 1, strlen(text));
    for (; *text; ++text) {
        if (quote ? *text == quote : strchr(" \t\r\n,]", *text) != NULL) break;
        open += *text == '{';
        if (!quote && *text == '}' && --open < 0) break;
    }
    *text = 0;
}

/* Prints the output paths and databases as they are written in the scene, because libinsitu's public functions do not
 * return them. A camera's path is a list and is not printed. */
static void print_paths(const char *scene)
{
    char line[1024];
    FILE *file = fopen(scene, "r");
    if (!file) return;
    while (fgets(line, sizeof line, file)) {
        char *cinema = strstr(line, "cinema:"), *comment = strchr(line, '#');
        char *path = cinema ? cinema : strstr(line, "path:");
        if (!path || (comment && comment < path)) continue;
        path = strchr(path, ':') + 1;
        path += strspn(path, " \t\r\n");
        if (*path == '[' || *path == 0) continue;
        cut_text_after_scalar(path);
        printf("  %s\n", path);
    }
    fclose(file);
}

void wave_report_end(const wave_report *report, const wave_options *options, const wave_solver *solver, int images)
{
    wave_totals totals = wave_solver_compute_totals(solver);
    if (report->rank != 0) return;
    double all = report->simulation_ms + report->insitu_ms;
    printf("simulated in %.2f s, in situ %.2f s (%.0f %% of both); energy %.4g, peak pressure %.3g\n",
           1e-3 * report->simulation_ms, 1e-3 * report->insitu_ms, all > 0 ? 100 * report->insitu_ms / all : 0,
           totals.energy, totals.peak);
    if (!options->scene) return;
    printf("extra memory of a rank: %.1f MB at the peak by the library's count, %.1f MB grown by the process's\n",
           1e-6 * report->bytes_peak, 1e-6 * report->bytes_grown);
    if (images < 0) {
        printf("no pictures: see the message above\n");
    } else {
        printf("%d pictures drawn, with these names in %s:\n", images, options->scene);
        print_paths(options->scene);
    }
    fflush(stdout);
}
