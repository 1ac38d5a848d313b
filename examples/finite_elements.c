/* The simulation of six_calls.c with the data structures of a finite element code. Each cell is a hexahedron of order 2
 * whose row of connectivity has 27 nodes, beginning with the corners in lexicographic order. The degrees of freedom are
 * in a vector in another order. The pictures are bitwise equal to those of six_calls.c, because only the corners are
 * drawn. */
#include <insitu/insitu.h>

#include <math.h>
#include <stdio.h>

enum { NX = 12, NY = 24, NZ = 24, CELLS = NX * NY * NZ };
enum { SIDE_X = 2 * NX + 1, SIDE_Y = 2 * NY + 1, SIDE_Z = 2 * NZ + 1, NODES = SIDE_X * SIDE_Y * SIDE_Z };
enum { NODES_PER_CELL = 27, GHOST_DOFS = 100, DOFS = GHOST_DOFS + NODES };

static double nodes[NODES][3], solution[DOFS];
static int cell_nodes[CELLS][NODES_PER_CELL], dof_of_node[NODES];

static int node_index(int i, int j, int k)
{
    return i + SIDE_X * (j + SIDE_Y * k);
}

/* Lists the cell's 3 x 3 x 3 nodes: first the eight corners, then all others; in each group x varies fastest. */
static void add_cell(int cell)
{
    const int i = cell % NX, j = cell / NX % NY, k = cell / NX / NY;
    int corners = 0, others = 8;
    for (int n = 0; n < NODES_PER_CELL; n++) {
        const int x = n % 3, y = n / 3 % 3, z = n / 9;
        const int place = x == 1 || y == 1 || z == 1 ? others++ : corners++;
        cell_nodes[cell][place] = node_index(2 * i + x, 2 * j + y, 2 * k + z);
    }
}

static void make_mesh(int rank)
{
    for (int n = 0; n < NODES; n++) {
        const int layer = n / SIDE_X / SIDE_Y;
        nodes[n][0] = 0.5 * (n % SIDE_X) + rank * NX;
        nodes[n][1] = 0.5 * (n / SIDE_X % SIDE_Y);
        nodes[n][2] = 0.5 * layer;
        dof_of_node[n] = GHOST_DOFS + (int)(7919LL * n % NODES); /* scattered numbers, as in a solver */
    }
    for (int c = 0; c < CELLS; c++) add_cell(c);
}

static void advance(double time)
{
    for (int n = 0; n < NODES; n++)
        solution[dof_of_node[n]] = cos(0.6 * hypot(hypot(nodes[n][0] - 12, nodes[n][1] - 12), nodes[n][2] - 12) - time);
}

static void set_mesh(insitu_session *session)
{
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = NODES;
    insitu_mesh_interleaved(&mesh, nodes, INSITU_FLOAT64);
    mesh.cell_count = CELLS;
    mesh.cell_type = INSITU_HEX;
    mesh.connectivity_count = CELLS * NODES_PER_CELL;
    mesh.connectivity = (insitu_array){.data = cell_nodes, .type = INSITU_INT32};
    mesh.connectivity_row = NODES_PER_CELL; /* distance between the first corners of consecutive cells */
    mesh.vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    insitu_set_mesh(session, "slab", &mesh);
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
    set_mesh(session);

    insitu_field field;
    insitu_field_defaults(&field);
    field.name = "pressure";
    field.count = DOFS; /* the complete vector, including ghosts */
    field.values = (insitu_array){.data = solution, .type = INSITU_FLOAT64};
    field.index = (insitu_array){.data = dof_of_node, .type = INSITU_INT32}; /* one entry per vertex of the mesh */
    for (int cycle = 0; cycle < 4; cycle++) {
        advance(0.5 * cycle);
        insitu_set_field(session, "slab", &field);
        if (insitu_step(session, cycle, 0.5 * cycle) != INSITU_OK && rank == 0)
            fprintf(stderr, "cycle %d: %s\n", cycle, insitu_error(session));
    }

    if (insitu_destroy(&session) != INSITU_OK && rank == 0) fprintf(stderr, "%s\n", insitu_error(NULL));
    MPI_Finalize();
    return 0;
}
