// A simulation that draws itself: the slab of hexahedra of six_calls.c, in C++.
#include <insitu/insitu.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <vector>

static constexpr int nx = 12, ny = 24, nz = 24;
static int vertex(int i, int j, int k)
{
    return i + (nx + 1) * (j + (ny + 1) * k);
}

int main(int argc, char **argv)
{
    int rank;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);

    std::vector<std::array<double, 3>> xyz;
    for (int k = 0; k <= nz; k++)
        for (int j = 0; j <= ny; j++)
            for (int i = 0; i <= nx; i++) xyz.push_back({double(i + rank * nx), double(j), double(k)});
    std::vector<std::array<int, 8>> hexes(nx * ny * nz);
    for (int c = 0; c < nx * ny * nz; c++)
        for (int n = 0; n < 8; n++) /* VTK's order: the lower quad in cyclic order, then the upper quad */
            hexes[c][n] = vertex(c % nx + (n % 4 == 1 || n % 4 == 2), c / nx % ny + n % 4 / 2, c / nx / ny + n / 4);
    std::vector<double> pressure(xyz.size());
    insitu_session *session = nullptr;
    if (insitu_create(MPI_COMM_WORLD, argc > 1 ? argv[1] : "scene.yaml", &session) != INSITU_OK) {
        std::fprintf(stderr, "no pictures: %s\n", insitu_error(nullptr));
    } else {
        insitu_mesh mesh;
        insitu_mesh_defaults(&mesh);
        mesh.vertex_count = int64_t(xyz.size());
        insitu_mesh_interleaved(&mesh, xyz.data(), INSITU_FLOAT64);
        mesh.cell_count = int64_t(hexes.size());
        mesh.cell_type = INSITU_HEX;
        mesh.connectivity_count = 8 * mesh.cell_count;
        mesh.connectivity = {hexes.data(), INSITU_INT32, 0};
        insitu_set_mesh(session, "slab", &mesh); // borrowed, not copied
        insitu_field field;
        insitu_field_defaults(&field);
        field.name = "pressure";
        field.count = mesh.vertex_count;
        field.values = {pressure.data(), INSITU_FLOAT64, 0};
        for (int cycle = 0; cycle < 4; cycle++) {
            for (std::size_t v = 0; v < xyz.size(); v++) {
                const double radius = std::hypot(std::hypot(xyz[v][0] - 12, xyz[v][1] - 12), xyz[v][2] - 12);
                pressure[v] = std::cos(0.6 * radius - 0.5 * cycle);
            }
            insitu_set_field(session, "slab", &field); /* the array is the same and has new values */
            if (insitu_step(session, cycle, 0.5 * cycle) != INSITU_OK)
                std::fprintf(stderr, "%s\n", insitu_error(session));
        }
    }
    if (insitu_destroy(&session) != INSITU_OK) std::fprintf(stderr, "%s\n", insitu_error(nullptr));
    return MPI_Finalize();
}
