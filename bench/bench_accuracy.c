/* Measures the time and the error of isosurfaces and volumes at every setting that trades time for error. VTK's volume
 * mappers are measured on the same meshes, cameras and transfer functions. Prints CSV, with one row for each
 * setting. */
#include <stdio.h>

#include <getopt.h>
#include <omp.h>

#include "accuracy_rows.h"
#include "bench_stats.h"
#include "bench_vtk.h"

static const accuracy_effort whole = {512, 32, 5, 1, 64, 128, 60, false}, large = {1024, 64, 5, 2, 0, 128, 60, true},
                             quick = {256, 16, 3, 0.2, 8, 64, 30, false}, smoke = {64, 8, 1, 0, 4, 16, 20, false};

void accuracy_print_head(void)
{
    printf("program,isa,threads,mesh,cells,size,layer,method,setting,status,build,first,frame,frame_min,frame_max,runs,"
           "pixels,rms,max,wrong,residual\n");
}

/* Prints a row. Times are in milliseconds. */
void accuracy_print_row(const accuracy_context *context, accuracy_row *row)
{
    const accuracy_error *e = &row->error;
    const bench_stats frame = bench_compute_stats(row->frames, row->runs);
    printf("bench_accuracy,%s,%d,%s,%lld,%d,%s,%s,%s,%s,%.5g,%.5g,%.5g,%.5g,%.5g,%d,%d,%.5g,%.5g,%d,%.5g\n",
           render_isa(), omp_get_max_threads(), context->subject->name, (long long)context->subject->mesh.cell_count,
           context->effort->size, row->layer, row->method, row->setting, row->status, 1e3 * context->build,
           1e3 * row->first, 1e3 * frame.median, 1e3 * frame.low, 1e3 * frame.high, frame.count, e->pixels, e->rms,
           e->max, e->wrong, e->residual);
    fflush(stdout);
}

static bool measure_subject(const char *name, const accuracy_effort *effort, bool with_peers)
{
    accuracy_subject subject;
    accuracy_context context = {.effort = effort, .subject = &subject};
    if (!accuracy_subject_create(name, effort->size, &subject)) {
        fprintf(stderr, "bench_accuracy: no mesh \"%s\"\n", name);
        return false;
    }
    accuracy_measure_build(&context);
    accuracy_reference *truth = accuracy_reference_create(&subject, effort->block);
    context.truth = truth;
    accuracy_measure_surface_rows(&context);
    accuracy_measure_volume_rows(&context);
    if (with_peers) accuracy_measure_peer_rows(&context);
    accuracy_reference_free(truth);
    accuracy_subject_free(&subject);
    return true;
}

static int print_usage(int status)
{
    fprintf(
        status ? stderr : stdout,
        "Usage: bench_accuracy [--large | --quick | --smoke] [--no-head] [--no-peers] MESH ...\n\n"
        "Draws each MESH at every setting that trades speed for error and prints CSV.\n"
        "  MESH        a lattice of N^3 cubes (tets:31, hexes:31, polyhedra:16 ...), or one of the real grids in the\n"
        "              folder INSITU_TEST_DATA: bluntfin_hex, bluntfin_tet, post_hex, post_tet, mixed_lattice\n"
        "  --quick     small pictures, few runs\n"
        "  --smoke     tiny pictures, one run: does it work?\n"
        "  --no-peers  without VTK's mappers, which need an X server (xvfb-run)\n\n"
        "OMP_NUM_THREADS sets the threads, INSITU_ISA the instruction set.\n");
    return status;
}

int main(int argc, char **argv)
{
    enum { HELP = 1, LARGE, QUICK, SMOKE, NO_HEAD, NO_PEERS };
    static const struct option list[] = {{"help", no_argument, NULL, HELP},
                                         {"large", no_argument, NULL, LARGE},
                                         {"quick", no_argument, NULL, QUICK},
                                         {"smoke", no_argument, NULL, SMOKE},
                                         {"no-head", no_argument, NULL, NO_HEAD},
                                         {"no-peers", no_argument, NULL, NO_PEERS},
                                         {0}};
    const accuracy_effort *effort = &whole;
    bool with_peers = bench_vtk_is_available(), with_head = true;
    for (int found; (found = getopt_long(argc, argv, "", list, NULL)) != -1;) {
        if (found == HELP) return print_usage(0);
        if (found == LARGE)
            effort = &large;
        else if (found == QUICK)
            effort = &quick;
        else if (found == SMOKE)
            effort = &smoke;
        else if (found == NO_HEAD)
            with_head = false;
        else if (found == NO_PEERS)
            with_peers = false;
        else
            return print_usage(2); /* getopt_long() has printed the reason */
    }
    if (optind == argc) return print_usage(2);
    if (with_head) accuracy_print_head();
    for (; optind < argc; optind++)
        if (!measure_subject(argv[optind], effort, with_peers)) return 1;
    return 0;
}
