/* A simulation on several uniform blocks per rank. Each block has ghost layers. Run it with:
 * mpirun -n 2 blocks blocks.yaml */
#include <insitu/insitu.h>

#include <math.h>
#include <stdio.h>

enum { BLOCKS = 8, N = 16, GHOSTS = 2, WIDE = N + 2 * GHOSTS }; /* 2 x 2 x 2 blocks with N x N x N cells each */

static double density[BLOCKS][WIDE][WIDE][WIDE]; /* indices: block, k, j, i; the ghost layers are included */

static double compute_coordinate(int index, int block_index)
{
    return (index - GHOSTS + 0.5 + N * block_index) / N - 1; /* coordinate of the cell's centre, from -1 to 1 */
}

static void advance(int block, double time)
{
    for (int k = 0; k < WIDE; k++)
        for (int j = 0; j < WIDE; j++)
            for (int i = 0; i < WIDE; i++) {
                const double x = compute_coordinate(i, block % 2), y = compute_coordinate(j, block / 2 % 2),
                             z = compute_coordinate(k, block / 4);
                density[block][k][j][i] = 1 / (1 + 4 * (x * x + y * y + z * z) + 2 * cos(5 * x - time) * cos(5 * y));
            }
}

static void set_block(insitu_session *session, int block)
{
    insitu_lattice lattice = {
        .cells = {WIDE, WIDE, WIDE},
        .interior_first = {GHOSTS, GHOSTS, GHOSTS}, /* ghost layers are not drawn */
        .interior_end = {GHOSTS + N, GHOSTS + N, GHOSTS + N},
        .origin = {-1, -1, -1}, /* origin of the whole lattice, which is the same for all blocks and ranks */
        .spacing = {1.0 / N, 1.0 / N, 1.0 / N},
        .first = {N * (block % 2) - GHOSTS, N * (block / 2 % 2) - GHOSTS, N * (block / 4) - GHOSTS}};
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = (WIDE + 1) * (WIDE + 1) * (WIDE + 1);
    mesh.cell_count = WIDE * WIDE * WIDE;
    mesh.lattice = &lattice; /* the description of the lattice is copied */
    mesh.changed = INSITU_CHANGED_NOTHING;

    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "density";
    field.centring = INSITU_CELL;
    field.count = mesh.cell_count;
    field.values =
        (insitu_array){.data = density[block], .type = INSITU_FLOAT64}; /* the values are borrowed, not copied */

    char name[16];
    snprintf(name, sizeof name, "block%d",
             block); /* each block is a separate mesh; layers without `mesh` draw all meshes */
    insitu_set_mesh(session, name, &mesh);
    insitu_set_field(session, name, &field);
}

int main(int argc, char **argv)
{
    int rank, ranks;
    insitu_session *session = NULL;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    if (insitu_create(MPI_COMM_WORLD, argc > 1 ? argv[1] : "scene.yaml", &session) != INSITU_OK) {
        if (rank == 0) fprintf(stderr, "no pictures: %s\n", insitu_error(NULL));
        MPI_Abort(MPI_COMM_WORLD, 1);
    }
    for (int cycle = 0; cycle < 2; cycle++) {
        for (int block = rank; block < BLOCKS; block += ranks) {
            advance(block, cycle);
            set_block(session, block);
        }
        if (insitu_step(session, cycle, cycle) != INSITU_OK && rank == 0)
            fprintf(stderr, "%s\n", insitu_error(session));
    }
    if (insitu_destroy(&session) != INSITU_OK && rank == 0) fprintf(stderr, "%s\n", insitu_error(NULL));
    MPI_Finalize();
    return 0;
}
