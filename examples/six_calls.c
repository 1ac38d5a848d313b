/* A simulation that draws itself. Its "mesh" is a slab of hexahedra per rank, and its "physics" is one formula. */
#include <insitu/insitu.h>

#include <math.h>
#include <stdio.h>

enum { NX = 12, NY = 24, NZ = 24, VERTICES = (NX + 1) * (NY + 1) * (NZ + 1), CELLS = NX * NY * NZ };

static double xyz[VERTICES][3], pressure[VERTICES];
static int hexes[CELLS][8];

static int vertex(int i, int j, int k)
{
    return i + (NX + 1) * (j + (NY + 1) * k);
}

static void make_mesh(int rank)
{
    for (int k = 0; k <= NZ; k++)
        for (int j = 0; j <= NY; j++)
            for (int i = 0; i <= NX; i++) {
                double *p = xyz[vertex(i, j, k)];
                p[0] = i + rank * NX, p[1] = j, p[2] = k;
            }
    for (int c = 0; c < CELLS; c++) {
        const int i = c % NX, j = c / NX % NY, k = c / NX / NY;
        for (int n = 0; n < 8; n++) /* VTK's order: the lower quad in cyclic order, then the upper quad */
            hexes[c][n] = vertex(i + (n % 4 == 1 || n % 4 == 2), j + n % 4 / 2, k + n / 4);
    }
}

static void advance(double time)
{
    for (int v = 0; v < VERTICES; v++)
        pressure[v] = cos(0.6 * hypot(hypot(xyz[v][0] - 12, xyz[v][1] - 12), xyz[v][2] - 12) - time);
}

int main(int argc, char **argv)
{
    int rank;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    make_mesh(rank);

    insitu_session *session = NULL;
    if (insitu_create(MPI_COMM_WORLD, argc > 1 ? argv[1] : "scene.yaml", &session) != INSITU_OK) {
        if (rank == 0) fprintf(stderr, "no pictures: %s\n", insitu_error(NULL));
        MPI_Finalize();
        return 1;
    }

    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = VERTICES;
    insitu_mesh_interleaved(&mesh, xyz, INSITU_FLOAT64);
    mesh.cell_count = CELLS;
    mesh.cell_type = INSITU_HEX;
    mesh.connectivity_count = CELLS * 8;
    mesh.connectivity = (insitu_array){.data = hexes, .type = INSITU_INT32};
    insitu_set_mesh(session, "slab", &mesh); /* borrowed, not copied */

    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "pressure";
    field.count = VERTICES;
    field.values = (insitu_array){.data = pressure, .type = INSITU_FLOAT64};

    for (int cycle = 0; cycle < 4; cycle++) {
        advance(0.5 * cycle);
        insitu_set_field(session, "slab", &field); /* the array is the same and has new values */
        if (insitu_step(session, cycle, 0.5 * cycle) != INSITU_OK && rank == 0)
            fprintf(stderr, "cycle %d: %s\n", cycle, insitu_error(session)); /* the simulation continues */
    }

    if (insitu_destroy(&session) != INSITU_OK && rank == 0) fprintf(stderr, "%s\n", insitu_error(NULL));
    MPI_Finalize();
    return 0;
}
