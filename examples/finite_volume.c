/* The simulation of six_calls.c with the data structures of a finite volume code. There is no list of cells, but a list
 * of faces, each with the cell that owns it and the neighbour on its other side; inner faces are listed first. The
 * pictures are bitwise equal to those of six_calls.c. */
#include <insitu/insitu.h>

#include <math.h>
#include <stdio.h>

enum { NX = 12, NY = 24, NZ = 24, POINTS = (NX + 1) * (NY + 1) * (NZ + 1), CELLS = NX * NY * NZ };
enum { FACES = (NX + 1) * NY * NZ + NX * (NY + 1) * NZ + NX * NY * (NZ + 1) };

static double points[POINTS][3], pressure[POINTS];
static int face_points[FACES][4], face_offsets[FACES + 1], owner[FACES], neighbour[FACES], inner_faces;

static int point_index(const int at[3])
{
    return at[0] + (NX + 1) * (at[1] + (NY + 1) * at[2]);
}

/* Stores the face at the lower end of a cell along an axis, which lies between this cell and the previous one. */
static void add_face(int face, const int cell[3], int axis)
{
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (int n = 0; n < 4; n++) {
        int corner[3] = {cell[0], cell[1], cell[2]};
        corner[u] += n == 1 || n == 2;
        corner[v] += n / 2;
        face_points[face][n] = point_index(corner);
    }
    face_offsets[face + 1] = 4 * (face + 1);
}

/* Stores all inner faces, or all faces on the boundary; returns the total number of faces stored so far. */
static int add_faces(int count, int are_inner)
{
    static const int sizes[3] = {NX, NY, NZ}, steps[3] = {1, NX, NX * NY};
    for (int c = 0; c < (NX + 1) * (NY + 1) * (NZ + 1) * 3; c++) {
        const int axis = c % 3, i = c / 3;
        const int cell[3] = {i % (NX + 1), i / (NX + 1) % (NY + 1), i / (NX + 1) / (NY + 1)};
        const int here = cell[0] + NX * (cell[1] + NY * cell[2]), is_inner = cell[axis] % sizes[axis] != 0;
        if (cell[(axis + 1) % 3] == sizes[(axis + 1) % 3] || cell[(axis + 2) % 3] == sizes[(axis + 2) % 3]) continue;
        if (is_inner != are_inner) continue;
        add_face(count, cell, axis);
        owner[count] = cell[axis] > 0 ? here - steps[axis] : here;
        if (is_inner) neighbour[count] = here;
        count++;
    }
    return count;
}

static void set_mesh(insitu_session *session)
{
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = POINTS;
    insitu_mesh_interleaved(&mesh, points, INSITU_FLOAT64);
    mesh.cell_count = CELLS;
    mesh.cell_type = INSITU_POLYHEDRON;
    mesh.face_count = FACES;
    mesh.face_offsets = (insitu_array){.data = face_offsets, .type = INSITU_INT32};
    mesh.face_connectivity_count = face_offsets[FACES];
    mesh.face_connectivity = (insitu_array){.data = face_points, .type = INSITU_INT32};
    mesh.owner = (insitu_array){.data = owner, .type = INSITU_INT32};
    mesh.neighbour_count = inner_faces; /* the remaining faces are on the boundary */
    mesh.neighbour = (insitu_array){.data = neighbour, .type = INSITU_INT32};
    insitu_set_mesh(session, "slab", &mesh); /* borrowed, not copied */
}

static void make_mesh(int rank)
{
    for (int k = 0; k <= NZ; k++)
        for (int j = 0; j <= NY; j++)
            for (int i = 0; i <= NX; i++) {
                double *p = points[point_index((const int[]){i, j, k})];
                p[0] = i + rank * NX, p[1] = j, p[2] = k;
            }
    inner_faces = add_faces(0, 1);
    add_faces(inner_faces, 0);
}

static void advance(double time)
{
    for (int v = 0; v < POINTS; v++)
        pressure[v] = cos(0.6 * hypot(hypot(points[v][0] - 12, points[v][1] - 12), points[v][2] - 12) - time);
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
    field.count = POINTS;
    field.values = (insitu_array){.data = pressure, .type = INSITU_FLOAT64};
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
