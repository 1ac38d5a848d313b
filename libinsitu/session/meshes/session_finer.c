#include "session_finer.h"

#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_derivatives.h"
#include "session_interpolation.h"
#include "session_region.h"
#include "session_rows.h"
#include "session_split.h"
#include "session_topology.h"

/* What the ranks count of a mesh, in session_finer.counts: the parts whose highest order is each one; and cells. */
enum { LOBATTO = NODES_MOST_ORDER + 1, EQUISPACED, PYRAMIDS };
_Static_assert(PYRAMIDS + 1 == SESSION_FINER_COUNTS, "each count has a place");

/* ---- all cells of a mesh ----------------------------------------------------------------------------------------- */

typedef struct finer_work {
    session_rows rows; /* rows of the caller's cells */
    const session_finer *finer;
    session_interpolation kinds[ROWS_MOST_KINDS];
    int64_t node_count; /* number of nodes of all finer lattices */
} finer_work;

static void end_work(finer_work *w)
{
    for (int i = 0; i < w->rows.kind_count; i++) session_drop_interpolation(&w->kinds[i]);
}

static bool begin_work(const session_finer *finer, finer_work *w)
{
    *w = (finer_work){.rows = session_given_rows(&finer->nodal), .finer = finer};
    session_list_kinds(&w->rows);
    bool is_made = true;
    for (int i = 0; i < w->rows.kind_count && is_made; i++)
        is_made = session_make_interpolation(&w->rows.kinds[i].nodes, finer->nodal.vertex_order, finer->parts,
                                             finer->is_lobatto, &w->kinds[i]);
    return is_made;
}

static int64_t find_first_node(const finer_work *w, int64_t cell)
{
    return w->finer->offsets ? w->finer->offsets[cell] : cell * w->kinds[0].fine.count;
}

/* Returns the number of doubles that the values of a cell need while they are computed. */
static size_t find_room(const finer_work *w, int components)
{
    size_t most = 0;
    for (int i = 0; i < w->rows.kind_count; i++) {
        const size_t own = (size_t)w->kinds[i].of.count * (size_t)components;
        const size_t all = own + session_interpolation_room(&w->kinds[i], components);
        most = all > most ? all : most;
    }
    return most;
}

static void interpolate_cell(const finer_work *w, const session_node_values *values, int64_t cell, double *room,
                             double *out)
{
    const session_interpolation *of = &w->kinds[session_kind_of(&w->rows, cell)];
    const int64_t first = session_row_first(&w->rows, cell);
    const int size = values->component_count;
    double corners[8][3];
    for (int c = 0; c < grid_type_vertices(of->of.type); c++)
        grid_vertex(&w->rows.cells, session_row_vertex(&w->rows, first + of->corners[c]), corners[c]);
    for (int n = 0; n < of->of.count; n++)
        values->read(values->of,
                     values->is_by_entry ? session_row_entry(&w->rows, cell, n)
                                         : session_row_vertex(&w->rows, first + n),
                     room + n * size);
    session_interpolate(of, (const double(*)[3])corners, size, room, room + of->of.count * size,
                        out + find_first_node(w, cell) * size);
}

static bool interpolate_cells(const finer_work *w, const session_node_values *values, int threads, double *out)
{
    const int64_t cells = w->rows.cells.cell_count;
    bool is_lacking = false;
#pragma omp parallel num_threads(session_region_threads(threads, w->node_count)) reduction(|| : is_lacking)
    {
        region_enter();
        double *room = base_alloc((find_room(w, values->component_count) + 1) * sizeof *room);
        is_lacking = !room;
#pragma omp for schedule(static)
        for (int64_t cell = 0; cell < cells; cell++)
            if (room) interpolate_cell(w, values, cell, room, out);
        base_free(room);
        region_leave();
    }
    return !is_lacking;
}

insitu_status session_interpolate_values(const session_mesh *mesh, const session_node_values *values, int threads,
                                         double *out, base_error *error)
{
    finer_work *w = base_alloc(sizeof *w);
    bool is_made = w && begin_work(&mesh->finer, w);
    if (is_made) w->node_count = mesh->finer.fine.vertex_count;
    is_made = is_made && interpolate_cells(w, values, threads, out);
    if (w) end_work(w);
    base_free(w);
    if (is_made) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for the interpolation in cells", mesh->label);
}

/* ---- the finer mesh ---------------------------------------------------------------------------------------------- */

static void read_vertex(const void *of, int64_t position, double *tuple)
{
    grid_vertex(of, position, tuple);
}

/* Finds where the nodes of each cell begin, and the cells' types if they differ. */
static bool number_nodes(finer_work *w, session_finer *finer)
{
    const int64_t cells = w->rows.cells.cell_count;
    if (w->rows.kind_count == 1) {
        w->node_count = cells * w->kinds[0].fine.count;
        return true;
    }
    finer->offsets = base_alloc(((size_t)cells + 1) * sizeof *finer->offsets);
    finer->types = base_alloc((size_t)cells + 1);
    if (!finer->offsets || !finer->types) return false;
    for (int64_t cell = 0; cell < cells; cell++) {
        const session_nodes *fine = &w->kinds[session_kind_of(&w->rows, cell)].fine;
        finer->offsets[cell] = w->node_count;
        finer->types[cell] = (unsigned char)session_lagrange_type(fine->type);
        w->node_count += fine->count;
    }
    finer->offsets[cells] = w->node_count;
    finer->bytes += cells * (int64_t)(sizeof *finer->offsets + 1);
    return true;
}

/* Describes the finer cells as a caller would. */
static void describe_cells(const finer_work *w, session_finer *finer)
{
    insitu_mesh *fine = &finer->fine;
    *fine = finer->nodal;
    fine->vertex_count = w->node_count;
    for (int axis = 0; axis < 3; axis++)
        fine->coordinates[axis] =
            (insitu_array){finer->coordinates + axis, INSITU_FLOAT64, 3 * (int64_t)sizeof(double)};
    fine->vertex_ids = fine->connectivity = fine->offsets = fine->cell_types = (insitu_array){0};
    fine->connectivity_count = fine->connectivity_row = 0;
    fine->index_base = fine->open_offsets = fine->order = 0;
    fine->vertex_order = INSITU_ORDER_LEXICOGRAPHIC;
    if (finer->offsets) {
        fine->connectivity_count = w->node_count;
        fine->offsets = (insitu_array){finer->offsets, INSITU_INT64, 0};
        fine->cell_types = (insitu_array){finer->types, INSITU_UINT8, 0};
    } else {
        fine->order = w->kinds[0].fine.order;
        fine->cell_type = (insitu_cell_type)session_lagrange_type(w->kinds[0].fine.type);
    }
}

static bool make_cells(session_finer *finer, int threads)
{
    finer_work *w = base_alloc(sizeof *w);
    bool is_made = w && begin_work(finer, w) && number_nodes(w, finer);
    if (is_made) {
        const session_node_values places = {&w->rows.cells, false, 3, read_vertex};
        const size_t bytes = 3 * (size_t)w->node_count * sizeof *finer->coordinates;
        finer->coordinates = base_alloc(bytes);
        finer->bytes += (int64_t)bytes;
        is_made = finer->coordinates && interpolate_cells(w, &places, threads, finer->coordinates);
    }
    if (is_made) describe_cells(w, finer);
    if (w) end_work(w);
    base_free(w);
    return is_made;
}

/* Frees what was computed for the nodes that were read so far. */
static void drop_node_data(session_meshes *meshes, session_mesh *mesh)
{
    session_drop_cell_data(meshes, mesh);
    session_read_topology(mesh);
    for (int i = 0; i < mesh->field_count; i++) session_drop_copy(&mesh->fields[i]);
}

static void end_finer_mesh(session_meshes *meshes, session_mesh *mesh)
{
    if (!mesh->finer.parts) return;
    mesh->given = mesh->finer.nodal;
    session_drop_finer(&mesh->finer);
    drop_node_data(meshes, mesh);
}

void session_end_finer(session_meshes *meshes)
{
    for (int i = 0; i < meshes->count; i++) {
        end_finer_mesh(meshes, meshes->items[i]);
        meshes->items[i]->given.vertex_ids = meshes->items[i]->original.vertex_ids;
    }
}

/* What the ranks have agreed on for a mesh. */
typedef struct finer_choice {
    int parts; /* 0: cells are not read as finer ones */
    bool is_lobatto;
} finer_choice;

static void make_finer_mesh(session_meshes *meshes, session_mesh *mesh, const finer_choice *choice, int threads,
                            base_error *error)
{
    session_finer made = mesh->finer;
    if (made.parts == choice->parts && (!made.parts || made.is_lobatto == choice->is_lobatto)) return;
    made = (session_finer){.is_counted = true, .parts = choice->parts, .is_lobatto = choice->is_lobatto};
    memcpy(made.counts, mesh->finer.counts, sizeof made.counts);
    end_finer_mesh(meshes, mesh);
    if (!made.parts || !session_has_higher_order(&mesh->given)) return;
    made.nodal = mesh->given;
    if (!make_cells(&made, threads)) {
        const int64_t bytes = made.bytes;
        session_drop_finer(&made);
        session_fail_for_memory(error, bytes, "finer lattices of nodes in cells of higher order");
        return;
    }
    session_drop_finer(&mesh->finer);
    mesh->finer = made;
    mesh->given = made.fine;
    drop_node_data(meshes, mesh);
}

/* ---- choices ----------------------------------------------------------------------------------------------------- */

void session_drop_ids(const session_meshes *meshes)
{
    for (int i = 0; i < meshes->count; i++) {
        insitu_mesh *given = &meshes->items[i]->given;
        if (given->vertex_ids.data && session_has_higher_order(given)) given->vertex_ids = (insitu_array){0};
    }
}

static void count_spacings(const session_polynomials *of, int64_t counts[SESSION_FINER_COUNTS], double (*places)[3])
{
    for (int64_t cell = 0; cell < of->cell_count; cell++) {
        const int kind = session_kind_of(&of->rows, cell);
        const session_nodes *nodes = &of->rows.kinds[kind].nodes;
        const int64_t first = session_row_first(&of->rows, cell);
        counts[PYRAMIDS] += nodes->type == GRID_PYRAMID;
        if (!session_has_two_spacings(nodes)) continue;
        for (int n = 0; n < nodes->count; n++)
            grid_vertex(&of->rows.cells, session_row_vertex(&of->rows, first + n), places[n]);
        counts[session_derivatives_of(of, cell, places[0], 3) == &of->kinds[2 * kind] ? EQUISPACED : LOBATTO]++;
    }
}

/* Counts the cells of a mesh that is read as the caller gave it. */
static bool count_mesh(session_mesh *mesh)
{
    session_polynomials polynomials;
    int64_t *counts = mesh->finer.counts;
    memset(counts, 0, sizeof mesh->finer.counts);
    bool is_made = session_polynomials_create(mesh, &polynomials);
    int order = 1, nodes = 1;
    for (int i = 0; i < polynomials.rows.kind_count; i++) {
        const session_nodes *of = &polynomials.rows.kinds[i].nodes;
        order = of->order > order ? of->order : order;
        nodes = of->count > nodes ? of->count : nodes;
    }
    double(*places)[3] = base_alloc((size_t)nodes * sizeof *places);
    is_made = is_made && places;
    if (is_made) count_spacings(&polynomials, counts, places);
    if (is_made) counts[order]++;
    base_free(places);
    session_polynomials_free(&polynomials);
    mesh->finer.is_counted = is_made;
    return is_made;
}

static bool sum_counts(const session_meshes *meshes, const char *name, int64_t sums[SESSION_FINER_COUNTS])
{
    const session_parts parts = session_find_parts(meshes, name);
    bool is_made = true;
    for (int i = 0; i < parts.count; i++) {
        session_mesh *part = parts.items[i];
        if (!part->is_given || !part->topology.is_split) continue;
        is_made = is_made && (part->finer.is_counted || count_mesh(part));
        for (int n = 0; n < SESSION_FINER_COUNTS; n++) sums[n] += part->finer.counts[n];
    }
    return is_made;
}

static finer_choice choose(const char *mesh, const int64_t sums[SESSION_FINER_COUNTS], int parts,
                           session_report *report)
{
    int order = NODES_MOST_ORDER;
    while (order > 1 && !sums[order]) order--;
    const int most = NODES_MOST_ORDER / order, chosen = parts < most ? parts : most;
    const bool has_pyramids = sums[PYRAMIDS] > 0;
    session_warn(report, &(session_warning){WARNING_FINER, NULL, mesh, 0}, has_pyramids,
                 "mesh \"%s\": %lld of its cells are pyramids, whose polynomials are not known: finer_pieces has no "
                 "effect on it, and its cells are split at their own nodes",
                 mesh, (long long)sums[PYRAMIDS]);
    session_warn(report, &(session_warning){WARNING_FINER, NULL, mesh, 1}, !has_pyramids && chosen < parts,
                 "mesh \"%s\": it has cells of order %d, and so finer_pieces is %d on it instead of %d: at most %d "
                 "pieces along an edge of a cell are supported",
                 mesh, order, chosen, parts, NODES_MOST_ORDER);
    return (finer_choice){has_pyramids || chosen < 2 ? 0 : chosen, sums[LOBATTO] > sums[EQUISPACED]};
}

insitu_status session_make_finer(session_meshes *meshes, const session_catalogue *catalogue, int parts,
                                 const session_team *team, session_report *report, bool *is_any, base_error *error)
{
    const int words = catalogue->mesh_count * SESSION_FINER_COUNTS;
    int64_t *sums = base_calloc((size_t)words + 1, sizeof *sums);
    bool is_made = sums != NULL;
    for (int m = 0; m < catalogue->mesh_count && is_made; m++)
        is_made = sum_counts(meshes, catalogue->meshes[m].name, sums + m * SESSION_FINER_COUNTS);
    if (!is_made) session_fail_for_memory(error, words * (int64_t)sizeof *sums, "counts of cells of higher order");
    insitu_status status = session_agree(team->comm, error);
    if (!status)
        status = session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, sums, words, MPI_INT64_T, MPI_SUM, team->comm),
                                   "MPI_Allreduce");
    for (int m = 0; m < catalogue->mesh_count && !status; m++) {
        const char *name = catalogue->meshes[m].name;
        const finer_choice choice = choose(name, sums + m * SESSION_FINER_COUNTS, parts, report);
        const session_parts of = session_find_parts(meshes, name);
        for (int order = 0; order <= NODES_MOST_ORDER; order++)
            *is_any = *is_any || sums[m * SESSION_FINER_COUNTS + order];
        for (int i = 0; i < of.count && !error->status; i++)
            if (of.items[i]->is_given && of.items[i]->topology.is_split)
                make_finer_mesh(meshes, of.items[i], &choice, team->threads, error);
    }
    base_free(sums);
    return status ? status : session_agree(team->comm, error);
}
