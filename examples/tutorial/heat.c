/* Two hot spots that rotate around each other, on a box of hexahedra per rank. */
#include <insitu/insitu.h>

#include <math.h>
#include <stdio.h>

enum { N = 20, SIDE = N + 1, VERTICES = SIDE * SIDE * SIDE, CELLS = N * N * N };

static double xyz[VERTICES][3], heat[VERTICES];
static int hexes[CELLS][8];

static double spot(const double *p, double x, double y)
{
    return exp(-8 * ((p[0] - x) * (p[0] - x) + (p[1] - y) * (p[1] - y) + (p[2] - 0.5) * (p[2] - 0.5)));
}

int main(int argc, char **argv)
{
    int rank, ranks;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);

    for (int v = 0; v < VERTICES; v++) { /* each rank has a slab of a cube of side 1 */
        xyz[v][0] = (rank + v % SIDE / (double)N) / ranks;
        xyz[v][1] = v / SIDE % SIDE / (double)N;
        xyz[v][2] = v / SIDE / SIDE / (double)N;
    }
    for (int c = 0; c < CELLS; c++) {
        const int low = c % N + SIDE * (c / N % N + SIDE * (c / N / N)), high = low + SIDE * SIDE;
        const int corners[8] = {low,  low + 1,  low + 1 + SIDE,  low + SIDE, /* the lower quad in cyclic order */
                                high, high + 1, high + 1 + SIDE, high + SIDE};
        for (int i = 0; i < 8; i++) hexes[c][i] = corners[i];
    }

    insitu_session *session = NULL;
    if (insitu_create(MPI_COMM_WORLD, "heat.yaml", &session) != INSITU_OK) {
        fprintf(stderr, "%s\n", insitu_error(NULL));
        MPI_Abort(MPI_COMM_WORLD, 1);
    }

    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = VERTICES;
    insitu_mesh_interleaved(&mesh, xyz, INSITU_FLOAT64);
    mesh.cell_count = CELLS;
    mesh.cell_type = INSITU_HEX;
    mesh.connectivity_count = CELLS * 8;
    mesh.connectivity = (insitu_array){.data = hexes, .type = INSITU_INT32};
    insitu_set_mesh(session, "box", &mesh);

    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "heat";
    field.count = VERTICES;
    field.values = (insitu_array){.data = heat, .type = INSITU_FLOAT64};

    for (int cycle = 0; cycle < 10; cycle++) {
        const double time = 0.3 * cycle, x = 0.25 * cos(time), y = 0.25 * sin(time);
        for (int v = 0; v < VERTICES; v++) heat[v] = spot(xyz[v], 0.5 + x, 0.5 + y) + spot(xyz[v], 0.5 - x, 0.5 - y);
        insitu_set_field(session, "box", &field);
        if (insitu_step(session, cycle, time) != INSITU_OK && rank == 0)
            fprintf(stderr, "%s\n", insitu_error(session));
        else if (rank == 0 && *insitu_last_report(session)->warnings)
            fprintf(stderr, "%s\n", insitu_last_report(session)->warnings);
    }

    if (insitu_destroy(&session) != INSITU_OK && rank == 0) fprintf(stderr, "%s\n", insitu_error(NULL));
    MPI_Finalize();
    return 0;
}
