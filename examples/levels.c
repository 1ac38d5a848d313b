/* Three levels of refinement, each a box of uniform cells. Run it with: mpirun -n 2 levels levels.yaml */
#include <insitu/insitu.h>
#include <math.h>
#include <stdio.h>

enum { BOXES = 6, MOST = 24 * 32 * 32 };
/* A level's spacing is 1 / (4 * refinement); first and cells count cells of the level, in the domain [0, 4]^3. */
static const struct {
    int refinement, first[3], cells[3];
} boxes[BOXES] = {{1, {0, 0, 0}, {8, 16, 16}},    {1, {8, 0, 0}, {8, 16, 16}},     {2, {8, 10, 10}, {8, 12, 12}},
                  {2, {16, 10, 10}, {8, 12, 12}}, {8, {40, 48, 48}, {24, 32, 32}}, {8, {64, 48, 48}, {24, 32, 32}}};
static float values[BOXES][MOST];

static double pulse(double x, double y, double z, double time)
{
    const double r = sqrt((x - 2) * (x - 2) + (y - 2) * (y - 2) + (z - 2) * (z - 2));
    return exp(-r) * (1 + 0.25 * cos(9 * r - time) * cos(4 * x) * cos(4 * y));
}

static void set_box(insitu_session *session, int b, double time)
{
    const int r = boxes[b].refinement, *n = boxes[b].cells, *first = boxes[b].first;
    const double h = 0.25 / r;
    insitu_lattice lattice = {.spacing = {h, h, h},
                              .refinement = {r, r, r}}; /* the origin of all levels is {0, 0, 0} */
    insitu_mesh mesh;
    insitu_field field;
    insitu_mesh_defaults(&mesh);
    insitu_field_defaults(&field);
    for (int a = 0; a < 3; a++) lattice.cells[a] = n[a], lattice.first[a] = first[a];
    mesh.lattice = &lattice;
    mesh.vertex_count = (n[0] + 1) * (n[1] + 1) * (n[2] + 1);
    mesh.cell_count = field.count = n[0] * n[1] * n[2];
    mesh.changed =
        INSITU_CHANGED_NOTHING; /* changes of the description, such as another `first`, are detected nevertheless */
    for (int i = 0; i < field.count; i++) {
        const int x = first[0] + i % n[0], y = first[1] + i / n[0] % n[1], z = first[2] + i / n[0] / n[1];
        values[b][i] = (float)pulse((x + 0.5) * h, (y + 0.5) * h, (z + 0.5) * h, time);
    }
    field.name = "height";
    field.centring = INSITU_CELL;
    field.values = (insitu_array){.data = values[b], .type = INSITU_FLOAT32};
    insitu_set_block(session, "amr", b, &mesh);
    insitu_set_block_field(session, "amr", b, &field);
}

int main(int argc, char **argv)
{
    int rank, ranks;
    insitu_session *session = NULL;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &ranks);
    insitu_status status = insitu_create(MPI_COMM_WORLD, argc > 1 ? argv[1] : "scene.yaml", &session);
    for (int cycle = 0; cycle < 2 && !status; cycle++) {
        for (int b = rank; b < BOXES; b += ranks) set_box(session, b, cycle);
        status = insitu_step(session, cycle, cycle);
    }
    if (status && rank == 0) fprintf(stderr, "%s\n", insitu_error(session));
    insitu_destroy(&session);
    return MPI_Finalize() || status;
}
