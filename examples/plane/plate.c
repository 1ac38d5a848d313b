/* A two-dimensional simulation: heat on squares of quads, one per rank, side by side. Run it with:
 * mpirun -n 2 plate plate.yaml */
#include <insitu/insitu.h>

#include <stdio.h>

enum { N = 32, VERTICES = (N + 1) * (N + 1), CELLS = N * N };

static double xy[VERTICES][2], heat[VERTICES];
static int quads[CELLS][4];

static void make_mesh(int rank)
{
    for (int v = 0; v < VERTICES; v++) {
        const int column = v % (N + 1), row = v / (N + 1);
        xy[v][0] = rank + column / (double)N;
        xy[v][1] = row / (double)N;
    }
    for (int c = 0; c < CELLS; c++) {
        const int first = c % N + c / N * (N + 1), around[4] = {0, 1, N + 2, N + 1};
        for (int n = 0; n < 4; n++) quads[c][n] = first + around[n];
    }
}

static void advance(double time)
{
    for (int v = 0; v < VERTICES; v++) {
        const double x = xy[v][0] - (0.5 + time), y = xy[v][1] - 0.4;
        heat[v] = 1 / (1 + 12 * (x * x + y * y));
    }
}

int main(int argc, char **argv)
{
    int rank;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    make_mesh(rank);

    insitu_session *session = NULL;
    if (insitu_create(MPI_COMM_WORLD, argc > 1 ? argv[1] : "plate.yaml", &session) != INSITU_OK) {
        if (rank == 0) fprintf(stderr, "no pictures: %s\n", insitu_error(NULL));
        MPI_Finalize();
        return 1;
    }
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = VERTICES;
    for (int axis = 0; axis < 2; axis++) /* x and y of each vertex; z is not given, and is 0 */
        mesh.coordinates[axis] = (insitu_array){&xy[0][axis], INSITU_FLOAT64, sizeof xy[0]};
    mesh.cell_count = CELLS;
    mesh.cell_type = INSITU_QUAD;
    mesh.connectivity_count = CELLS * 4;
    mesh.connectivity = (insitu_array){.data = quads, .type = INSITU_INT32};
    insitu_set_mesh(session, "plate", &mesh);

    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "heat";
    field.count = VERTICES;
    field.values = (insitu_array){.data = heat, .type = INSITU_FLOAT64};
    for (int cycle = 0; cycle < 3; cycle++) {
        advance(0.5 * cycle);
        insitu_set_field(session, "plate", &field);
        if (insitu_step(session, cycle, 0.5 * cycle) != INSITU_OK && rank == 0)
            fprintf(stderr, "cycle %d: %s\n", cycle, insitu_error(session));
        if (rank == 0) fputs(insitu_last_report(session)->warnings, stderr);
    }
    if (insitu_destroy(&session) != INSITU_OK && rank == 0) fprintf(stderr, "%s\n", insitu_error(NULL));
    MPI_Finalize();
    return 0;
}
