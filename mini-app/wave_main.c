/* The mini-app reads the options, creates the mesh and the solver, and alternates between time steps of the wave and in
 * situ pictures. Errors that may occur on a single rank (lack of memory) are agreed on before the next collective call,
 * so that all ranks stop together. */
#include <stdio.h>

#include "wave_mesh_create.h"
#include "wave_pictures.h"
#include "wave_report.h"

static int read_options(int argc, char **argv, int rank, wave_options *options)
{
    char message[256] = "";
    if (!wave_options_parse(argc, argv, options, message, sizeof message)) {
        if (rank == 0) fprintf(stderr, "insitu-wave: %s\n", message);
        return 1;
    }
    if (options->help && rank == 0) fputs(wave_options_help(), stdout);
    return 0;
}

static wave_setup make_setup(const wave_options *options, const wave_lattice *lattice)
{
    wave_setup setup = {.real_bytes = options->real_bytes,
                        .is_soa = options->is_soa,
                        .reflecting = options->reflecting,
                        .order = options->order,
                        .vertices = options->at_vertices,
                        .swell = options->moving ? options->swell : 0,
                        .medium = wave_medium_make_layered(lattice)};
    setup.source = wave_source_make_default(lattice, &setup.medium);
    return setup;
}

static void run_simulation(const wave_options *options, const wave_mesh *mesh, wave_solver *solver, MPI_Comm comm)
{
    wave_report report;
    wave_pictures pictures;
    wave_solver_start(solver);
    wave_report_begin(comm, options, mesh, solver, &report);
    wave_pictures_open(options, mesh, solver, comm, &pictures);
    for (int step = 1; step <= options->steps; ++step) {
        double begin = MPI_Wtime();
        wave_pictures_update_source(&pictures, &solver->setup.source);
        wave_solver_step(solver);
        double between = MPI_Wtime();
        insitu_report insitu = wave_pictures_step(&pictures, step, solver->time);
        double end = MPI_Wtime();
        wave_report_step(&report, step, solver->time, 1e3 * (between - begin), 1e3 * (end - between), &insitu);
    }
    wave_report_end(&report, options, solver, pictures.session ? pictures.images : -1);
    wave_pictures_close(&pictures);
}

static int create_mesh_and_run(const wave_options *options, MPI_Comm comm, int rank)
{
    int ranks;
    MPI_Comm_size(comm, &ranks);
    wave_lattice lattice = wave_lattice_make(options->size, options->cells, options->jitter);
    wave_partition partition = wave_partition_make(&lattice, options->partition, ranks);
    wave_setup setup = make_setup(options, &lattice);
    wave_mesh mesh = {0};
    wave_solver solver = {0};
    int ok = wave_mesh_create(&partition, rank, options->index_bytes, &mesh) &&
             wave_solver_create(&setup, &mesh, comm, &solver);
    MPI_Allreduce(MPI_IN_PLACE, &ok, 1, MPI_INT, MPI_MIN, comm);
    if (ok) {
        run_simulation(options, &mesh, &solver, comm);
    } else if (rank == 0) {
        fprintf(stderr, "insitu-wave: a rank ran out of memory, or of 32-bit numbers for its cells\n");
    }
    wave_solver_free(&solver);
    wave_mesh_free(&mesh);
    return !ok;
}

int main(int argc, char **argv)
{
    int rank, status;
    wave_options options;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    status = read_options(argc, argv, rank, &options);
    if (status == 0 && !options.help) status = create_mesh_and_run(&options, MPI_COMM_WORLD, rank);
    MPI_Finalize();
    return status;
}
