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

/* What the ranks count of a mesh, in session_finer.counts: the blocks whose highest order is each one; cells; and by
 * the number of parts, bytes, and the blocks that have them. */
enum {
    LOBATTO = NODES_MOST_ORDER + 1,
    EQUISPACED,
    PYRAMIDS,
    SERENDIPITY,
    BYTES,
    COMPONENT_BYTES = BYTES + FINER_MOST_PARTS + 1,
    BLOCKS = COMPONENT_BYTES + FINER_MOST_PARTS + 1
};
_Static_assert(BLOCKS + FINER_MOST_PARTS + 1 == SESSION_FINER_COUNTS, "each count has a place");

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

static void make_finer_mesh(session_meshes *meshes, session_mesh *mesh, const session_finer_choice *choice, int threads,
                            base_error *error)
{
    session_finer made = mesh->finer;
    const int parts = choice->parts > 1 ? choice->parts : 0;
    const session_sizes sizes = made.parts ? made.sizes : session_sizes_of(mesh);
    if (made.parts == parts && (!made.parts || made.is_lobatto == choice->is_lobatto)) return;
    made = (session_finer){.is_counted = true, .parts = parts, .is_lobatto = choice->is_lobatto, .sizes = sizes};
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

static void count_spacings(const session_polynomials *of, int64_t counts[SESSION_FINER_COUNTS], double (*places)[3],
                           int64_t cells[ROWS_MOST_KINDS])
{
    for (int64_t cell = 0; cell < of->cell_count; cell++) {
        const int kind = session_kind_of(&of->rows, cell);
        const session_nodes *nodes = &of->rows.kinds[kind].nodes;
        const int64_t first = session_row_first(&of->rows, cell);
        cells[kind]++;
        if (!session_has_two_spacings(nodes)) continue;
        for (int n = 0; n < nodes->count; n++)
            grid_vertex(&of->rows.cells, session_row_vertex(&of->rows, first + n), places[n]);
        counts[session_derivatives_of(of, cell, places[0], 3) == &of->kinds[2 * kind] ? EQUISPACED : LOBATTO]++;
    }
}

/* Adds what finer lattices take in so many cells: vertices and parents of pieces of 4 bytes, and nodes. */
static void count_bytes(const session_nodes *nodes, int64_t cells, int64_t counts[SESSION_FINER_COUNTS])
{
    const bool is_flat = nodes->type == GRID_TRIANGLE || nodes->type == GRID_QUAD;
    counts[PYRAMIDS] += nodes->type == GRID_PYRAMID ? cells : 0;
    counts[SERENDIPITY] += nodes->is_complete ? 0 : cells;
    for (int parts = 2; parts <= FINER_MOST_PARTS; parts++) {
        const int64_t m = parts * nodes->order, pieces = is_flat ? m * m : m * m * m;
        const int64_t fine = session_complete_nodes(nodes->type, (int)m).count;
        counts[BYTES + parts] += cells * (pieces * 4 * (grid_type_vertices(nodes->type) + 1) + fine * 24);
        counts[COMPONENT_BYTES + parts] += cells * fine * 8;
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
    int64_t cells[ROWS_MOST_KINDS] = {0};
    double(*places)[3] = base_alloc((size_t)nodes * sizeof *places);
    is_made = is_made && places;
    if (is_made) count_spacings(&polynomials, counts, places, cells);
    for (int i = 0; i < polynomials.rows.kind_count; i++)
        count_bytes(&polynomials.rows.kinds[i].nodes, cells[i], counts);
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
        sums[BLOCKS + part->finer.parts]++;
    }
    return is_made;
}

int session_most_parts(const session_finer_choice *choice)
{
    const int most = choice->order ? NODES_MOST_ORDER / choice->order : FINER_MOST_PARTS;
    return most < FINER_MOST_PARTS ? most : FINER_MOST_PARTS;
}

static session_finer_choice make_choice(const int64_t sums[SESSION_FINER_COUNTS])
{
    session_finer_choice out = {.order = NODES_MOST_ORDER,
                                .pyramid_count = sums[PYRAMIDS],
                                .serendipity_count = sums[SERENDIPITY],
                                .is_lobatto = sums[LOBATTO] > sums[EQUISPACED],
                                .parts = 1};
    while (out.order > 0 && !sums[out.order]) out.order--;
    memcpy(out.bytes, sums + BYTES, sizeof out.bytes);
    memcpy(out.bytes_per_component, sums + COMPONENT_BYTES, sizeof out.bytes_per_component);
    memcpy(out.blocks, sums + BLOCKS, sizeof out.blocks);
    return out;
}

insitu_status session_count_finer(session_meshes *meshes, const session_catalogue *catalogue, MPI_Comm comm,
                                  session_finer_choice *choices, base_error *error)
{
    const int words = catalogue->mesh_count * SESSION_FINER_COUNTS;
    int64_t *sums = base_calloc((size_t)words + 1, sizeof *sums);
    bool is_made = sums != NULL;
    for (int m = 0; m < catalogue->mesh_count && is_made; m++)
        is_made = sum_counts(meshes, catalogue->meshes[m].name, sums + m * SESSION_FINER_COUNTS);
    if (!is_made) session_fail_for_memory(error, words * (int64_t)sizeof *sums, "counts of cells of higher order");
    insitu_status status = session_agree(comm, error);
    if (!status)
        status = session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, sums, words, MPI_INT64_T, MPI_SUM, comm),
                                   "MPI_Allreduce");
    for (int m = 0; m < catalogue->mesh_count && !status; m++)
        choices[m] = make_choice(sums + m * SESSION_FINER_COUNTS);
    base_free(sums);
    return status;
}

/* Returns whether some block has another number of parts than the chosen one. */
static bool is_new_choice(const session_finer_choice *choice)
{
    bool is_new = false;
    for (int parts = 0; parts <= FINER_MOST_PARTS; parts++)
        is_new = is_new || (choice->blocks[parts] && parts != (choice->parts > 1 ? choice->parts : 0));
    return is_new;
}

insitu_status session_make_finer(session_meshes *meshes, const session_catalogue *catalogue,
                                 const session_finer_choice *choices, const session_team *team, bool *are_changed,
                                 base_error *error)
{
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_parts of = session_find_parts(meshes, catalogue->meshes[m].name);
        *are_changed = *are_changed || is_new_choice(&choices[m]);
        for (int i = 0; i < of.count && !error->status; i++)
            if (of.items[i]->is_given && of.items[i]->topology.is_split)
                make_finer_mesh(meshes, of.items[i], &choices[m], team->threads, error);
    }
    return session_agree(team->comm, error);
}
