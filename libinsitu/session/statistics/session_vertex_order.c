#include "session_vertex_order.h"

#include "memory.h"
#include "session_agree.h"
#include "session_tally.h"

enum cell_sum { DRAWN, FLAT, INVERTED, LOOKED_AT, CROSSED, CELL_SUMS };

static void sum_cells(const session_meshes *meshes, const char *name, int64_t sums[CELL_SUMS])
{
    const session_mesh *mesh = session_find_mesh(meshes, name);
    if (!mesh || !mesh->is_given) return;
    sums[DRAWN] = mesh->drawn_count - mesh->shell_count;
    sums[FLAT] = mesh->flat_count - mesh->shell_count;
    sums[INVERTED] = mesh->inverted_count;
    tally_crossed(mesh, &sums[LOOKED_AT], &sums[CROSSED]);
}

static void warn_of_order(session_report *report, const char *mesh, const int64_t sums[CELL_SUMS])
{
    const long long drawn = sums[DRAWN], flat = sums[FLAT], inverted = sums[INVERTED];
    const bool are_crossed = 2 * sums[CROSSED] > sums[LOOKED_AT];
    const bool are_flat = !are_crossed && 2 * flat > drawn;
    const bool are_inverted = !are_crossed && 2 * inverted > drawn;
    session_warn(
        report, &(session_warning){WARNING_ORDER, NULL, mesh, 0}, are_crossed,
        "mesh \"%s\": the vertices of its hexes or pyramids seem to be in lexicographic order: their quads cross "
        "themselves, so that little of the cells is seen; VTK's order goes around each quad; set "
        "vertex_order of the mesh to INSITU_ORDER_LEXICOGRAPHIC, or, where it is that already, to INSITU_ORDER_VTK",
        mesh);
    session_warn(report, &(session_warning){WARNING_ORDER, NULL, mesh, 1}, are_flat,
                 "mesh \"%s\": %lld of %lld cells have no volume and are not seen: check the order of their vertices, "
                 "which must be VTK's, and the coordinates",
                 mesh, flat, drawn);
    session_warn(
        report, &(session_warning){WARNING_ORDER, NULL, mesh, 2}, are_inverted,
        "mesh \"%s\": %lld of %lld cells are left-handed, which is drawn right if that is all: check the order "
        "of their vertices, which must be VTK's, and the axes",
        mesh, inverted, drawn);
}

insitu_status session_check_vertex_order(const session_meshes *meshes, const session_catalogue *catalogue,
                                         MPI_Comm comm, session_report *report, base_error *error)
{
    const size_t words = (size_t)catalogue->mesh_count * CELL_SUMS;
    int64_t *sums = base_calloc(words, sizeof *sums);
    if (!sums) session_no_memory(error, (int64_t)(words * sizeof *sums), "counts of cells");
    insitu_status status = session_agree(comm, error);
    for (int m = 0; m < catalogue->mesh_count && !status; m++)
        sum_cells(meshes, catalogue->meshes[m].name, sums + m * CELL_SUMS);
    if (!status)
        status = session_mpi(error, MPI_Allreduce(MPI_IN_PLACE, sums, (int)words, MPI_INT64_T, MPI_SUM, comm),
                             "MPI_Allreduce");
    for (int m = 0; m < catalogue->mesh_count && !status; m++)
        warn_of_order(report, catalogue->meshes[m].name, sums + m * CELL_SUMS);
    base_free(sums);
    return status;
}
