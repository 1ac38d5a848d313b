/* Finds meshes in which the caller's order of vertices is not the one that vertex_order declares. The corner volume of
 * a cell's corner is the signed volume that the edges at this corner span; for a quad it is an area. If vertices are
 * read in a wrong order, the corner volumes of a cell have both signs, while in a correct or mirrored cell they all
 * have the same sign. (Their sum is not useful, because it may have any sign or be 0.) Therefore two numbers are
 * counted: the cells with both signs and, for each possible value of vertex_order, the cells whose corner volumes would
 * have a single sign if they were read in that order. */
#include "session_vertex_order.h"

#include "memory.h"
#include "session_agree.h"
#include "session_cell_order.h"
#include "session_straight.h"
#include "session_tally.h"
#include "session_topology.h"

enum { ORDERS = 3, SAMPLES = 256 /* SAMPLES: approximate number of cells of a mesh that a rank samples */ };

/* The types of cells whose vertex orders differ. Each type is judged separately, so that an error in hexes is found
 * even if few of the cells are hexes. */
enum { JUDGED = 4 };
static const int judged[JUDGED] = {GRID_HEX, GRID_WEDGE, GRID_PYRAMID, GRID_QUAD};

/* Indices of the counts for one type of cell: the cells that were sampled, the cells whose corner volumes have both
 * signs, and, for each possible vertex order, the cells whose corner volumes would all have the same sign. */
enum type_sum { SAMPLED, BOTH_SIGNS, FITTING, TYPE_SUMS = FITTING + ORDERS };

/* Indices of the counts for one mesh: drawn cells that are not shells, those of them that have no volume, left-handed
 * cells, shells, parts with cells of higher order, parts with bent cells (cells of higher order that differ in shape
 * from the linear cell with the same corners), and then TYPE_SUMS counts for each type of cell. */
enum cell_sum { DRAWN, FLAT, INVERTED, SHELLS, SPLIT, BENT, OF_TYPES, CELL_SUMS = OF_TYPES + JUDGED * TYPE_SUMS };

/* Returns whether all corner volumes of the cell would have the same sign if `order` were the mesh's vertex_order. */
static bool fits_order(const session_mesh *mesh, int64_t cell, int type, insitu_vertex_order order)
{
    const signed char *read = session_vertex_permutation(mesh->given.vertex_order, type);
    const signed char *other = session_vertex_permutation(order, type);
    double points[GRID_MAX_CELL_VERTICES][3];
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    const int count = grid_cell_vertices(&mesh->cells, cell, vertices);
    for (int i = 0; i < count; i++) {
        /* position of the vertex in the cell's part of the caller's connectivity */
        const int given = other ? other[i] : i;
        grid_read_vertex_position(&mesh->cells, vertices[read ? read[given] : given], points[i]);
    }
    return !tally_has_corners_of_both_signs(type, points);
}

/* Returns the counts for cells of this cell's type. Returns NULL if the cell is not counted, because its type has only
 * one vertex order, because it is a ghost, or because the caller gave it as a polyhedron, whose faces determine the
 * order. */
static int64_t *get_counts_of_cell_type(const session_mesh *mesh, int64_t cell, int64_t sums[CELL_SUMS])
{
    const int type = grid_cell_type(&mesh->cells, cell);
    int at = 0;
    while (at < JUDGED && judged[at] != type) at++;
    if (at == JUDGED || grid_is_ghost(&mesh->cells, cell) || session_caller_type(mesh, cell) != type) return NULL;
    return sums + OF_TYPES + at * TYPE_SUMS;
}

/* Adds the counts of a sample of the part's cells. part_count: number of this rank's parts of the mesh, among which the
 * samples are divided; each part gets at least one sample. */
static void count_fitting_orders(const session_mesh *mesh, int part_count, int64_t sums[CELL_SUMS])
{
    const int64_t samples = (SAMPLES + part_count - 1) / part_count, step = mesh->cells.cell_count / samples + 1;
    for (int64_t cell = 0; cell < mesh->cells.cell_count; cell += step) {
        const int type = grid_cell_type(&mesh->cells, cell);
        int64_t *of_type = get_counts_of_cell_type(mesh, cell, sums);
        if (!of_type) continue;
        of_type[SAMPLED]++;
        of_type[BOTH_SIGNS] += !fits_order(mesh, cell, type, mesh->given.vertex_order);
        for (int order = 0; order < ORDERS; order++)
            of_type[FITTING + order] += fits_order(mesh, cell, type, (insitu_vertex_order)order);
    }
}

static void count_cells_of_mesh(const session_meshes *meshes, const char *name, int threads, int64_t sums[CELL_SUMS])
{
    const session_parts parts = session_find_parts(meshes, name);
    for (int i = 0; i < parts.count; i++) {
        const session_mesh *part = parts.items[i];
        if (!part->is_given || part->source) continue;
        sums[DRAWN] += part->given_counts.drawn_count - part->given_counts.shell_count;
        sums[FLAT] += part->given_counts.flat_count - part->given_counts.shell_count;
        /* the axes of a lattice may form a left-handed system, so that inverted cells are not counted */
        sums[INVERTED] += part->cells.lattice ? 0 : part->given_counts.inverted_count;
        sums[SHELLS] += part->given_counts.shell_count;
        sums[SPLIT] += part->topology.is_split;
        sums[BENT] += part->topology.is_split && session_has_bent_cells(part, threads);
        if (!part->topology.is_split)
            count_fitting_orders(part, parts.count, sums); /* pieces of split cells are always in VTK's order */
    }
}

/* Returns whether, for some type, most sampled cells have corner volumes of both signs. */
static bool has_any_type_mixed_signs(const int64_t sums[CELL_SUMS])
{
    bool is_any = false;
    for (const int64_t *t = sums + OF_TYPES; t < sums + CELL_SUMS; t += TYPE_SUMS)
        is_any = is_any || 2 * t[BOTH_SIGNS] > t[SAMPLED];
    return is_any;
}

/* Returns the order with which the corner volumes of most sampled cells have a single sign. Returns -1 if there is no
 * order with which this holds for at least half of the sampled cells of each type. */
static int find_fitting_order(const int64_t sums[CELL_SUMS])
{
    int best = -1;
    int64_t most = -1;
    for (int order = 0; order < ORDERS; order++) {
        int64_t fitting = 0;
        bool fits_each = true;
        for (const int64_t *t = sums + OF_TYPES; t < sums + CELL_SUMS; t += TYPE_SUMS) {
            fitting += t[FITTING + order];
            fits_each = fits_each && 2 * t[FITTING + order] >= t[SAMPLED];
        }
        if (!fits_each || fitting <= most) continue;
        best = order;
        most = fitting;
    }
    return best;
}

/* Warns if most sampled cells of some type have corner volumes of both signs. The warning names the vertex order with
 * which most cells have a single sign, if there is one. Returns whether a warning was due. */
static bool warn_of_mixed_corner_signs(session_report *report, const char *mesh, const int64_t sums[CELL_SUMS])
{
    static const char *const words[] = {"VTK's order", "lexicographic order", "DMPlex's order"};
    static const char *const names[] = {"INSITU_ORDER_VTK", "INSITU_ORDER_LEXICOGRAPHIC", "INSITU_ORDER_DMPLEX"};
    const session_warning warning = {WARNING_ORDER, NULL, mesh, 0};
    const bool are_turned = has_any_type_mixed_signs(sums);
    const int order = find_fitting_order(sums);
    if (order >= 0)
        session_warn(
            report, &warning, are_turned,
            "mesh \"%s\": the vertices of its cells seem to be in %s: as they are read, most of a type are "
            "turned inside out at some of their corners, so that little of them is seen; set vertex_order of the "
            "mesh to %s",
            mesh, words[order], names[order]);
    else
        session_warn(
            report, &warning, are_turned,
            "mesh \"%s\": most of its cells of a type are turned inside out at some of their corners, so that "
            "little of them is seen, and no vertex_order would mend that: check the order of their vertices, and the "
            "coordinates",
            mesh);
    return are_turned;
}

static void warn_of_order(session_report *report, const char *mesh, const int64_t sums[CELL_SUMS])
{
    const long long drawn = sums[DRAWN], flat = sums[FLAT], inverted = sums[INVERTED];
    const bool are_turned = warn_of_mixed_corner_signs(report, mesh, sums);
    const bool are_flat = !are_turned && 2 * flat > drawn;
    const bool are_inverted = !are_turned && 2 * inverted > drawn;
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

insitu_status session_check_vertex_order(const session_meshes *meshes, session_catalogue *catalogue,
                                         const session_team *team, session_report *report, base_error *error)
{
    const size_t words = (size_t)catalogue->mesh_count * CELL_SUMS;
    int64_t *sums = base_calloc(words, sizeof *sums);
    if (!sums) session_fail_for_memory(error, (int64_t)(words * sizeof *sums), "counts of cells");
    insitu_status status = session_agree(team->comm, error);
    for (int m = 0; m < catalogue->mesh_count && !status; m++)
        count_cells_of_mesh(meshes, catalogue->meshes[m].name, team->threads, sums + m * CELL_SUMS);
    if (!status)
        status = session_check_mpi(
            error, MPI_Allreduce(MPI_IN_PLACE, sums, (int)words, MPI_INT64_T, MPI_SUM, team->comm), "MPI_Allreduce");
    for (int m = 0; m < catalogue->mesh_count && !status; m++) {
        const int64_t *of_mesh = sums + m * CELL_SUMS;
        const session_parts parts = session_find_parts(meshes, catalogue->meshes[m].name);
        const bool has_shells_alone = of_mesh[DRAWN] == 0 && of_mesh[SHELLS] > 0;
        catalogue->meshes[m].has_shells_alone = has_shells_alone;
        catalogue->meshes[m].has_higher_order = of_mesh[SPLIT] > 0;
        catalogue->meshes[m].has_bent_cells = of_mesh[BENT] > 0;
        for (int i = 0; i < parts.count; i++) parts.items[i]->has_shells_alone = has_shells_alone;
        warn_of_order(report, catalogue->meshes[m].name, of_mesh);
    }
    base_free(sums);
    return status;
}
