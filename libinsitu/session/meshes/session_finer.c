#include "session_finer.h"

#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_derivatives.h"
#include "session_interpolation.h"
#include "session_piece_set.h"
#include "session_region.h"
#include "session_rows.h"
#include "session_split.h"
#include "session_topology.h"

/* Indices in session_finer.counts, whose elements are summed over all ranks. Element p below LOBATTO: number of parts
 * of the mesh in which p is the highest order of a cell. The elements named here are numbers of cells: hexes and quads
 * of order 3 and more with Gauss-Lobatto nodes, and with equispaced nodes; pyramids of an order above
 * INTERPOLATION_MOST_PYRAMID; serendipity cells; shells. */
enum { LOBATTO = NODES_MOST_ORDER + 1, EQUISPACED, PYRAMIDS, SERENDIPITY, SHELLS };
_Static_assert((int)SHELLS < (int)SESSION_FINER_COUNTS, "each count has a place");

/* ---- interpolation in all cells of a mesh ------------------------------------------------------------------------ */

typedef struct finer_work {
    session_rows rows; /* access to the nodes of each of the caller's cells */
    const session_finer *finer;
    /* used while finer lattices are made: one byte per cell, nonzero if the cell is refined; NULL: all cells are
     * refined */
    const unsigned char *marks;
    /* for each kind of cell (type and number of nodes): the interpolation for refined cells (index 0), and that for all
     * other cells, which have one part between two nodes (index 1) */
    session_interpolation kinds[ROWS_MOST_KINDS][2];
    int64_t node_count; /* number of nodes of all finer lattices */
} finer_work;

static void free_finer_work(finer_work *w)
{
    for (int i = 0; i < w->rows.kind_count; i++)
        for (int n = 0; n < 2; n++) session_drop_interpolation(&w->kinds[i][n]);
}

static bool create_finer_work(const session_finer *finer, const unsigned char *marks, finer_work *w)
{
    *w = (finer_work){.rows = session_describe_caller_rows(&finer->nodal), .finer = finer, .marks = marks};
    session_list_cell_kinds(&w->rows);
    bool is_made = true;
    for (int i = 0; i < w->rows.kind_count && is_made; i++)
        for (int n = 0; n < 2 && is_made; n++)
            is_made = session_make_interpolation(&w->rows.kinds[i].nodes, finer->nodal.vertex_order,
                                                 n ? 1 : finer->parts, finer->is_lobatto, &w->kinds[i][n]);
    return is_made;
}

/* Returns whether a cell has been refined, by its number of nodes in the finer lattices. count: number of nodes of a
 * refined cell of the same type and order. */
static bool is_refined(const session_finer *finer, int count, int64_t cell)
{
    return !finer->offsets || finer->offsets[cell + 1] - finer->offsets[cell] == count;
}

static const session_interpolation *find_interpolation(const finer_work *w, int64_t cell)
{
    const session_interpolation *kind = w->kinds[session_find_kind_of_cell(&w->rows, cell)];
    if (w->marks) return &kind[!w->marks[cell]];
    return &kind[w->finer->fine.cell_count > 0 && !is_refined(w->finer, kind[0].fine.count, cell)];
}

static int64_t find_first_node(const finer_work *w, int64_t cell)
{
    return w->finer->offsets ? w->finer->offsets[cell] : cell * w->kinds[0][0].fine.count;
}

/* Returns the number of doubles that interpolate_cell() needs as its buffer. */
static size_t find_buffer_size(const finer_work *w, int components)
{
    size_t most = 0;
    for (int i = 0; i < w->rows.kind_count; i++) {
        const size_t own = (size_t)w->kinds[i][0].of.count * (size_t)components;
        const size_t all = own + session_interpolation_work_size(&w->kinds[i][0], components);
        most = all > most ? all : most;
    }
    return most;
}

static void interpolate_cell(const finer_work *w, const session_node_values *values, int64_t cell, double *buffer,
                             double *out)
{
    const session_interpolation *of = find_interpolation(w, cell);
    const int64_t first = session_find_first_entry_of_cell(&w->rows, cell);
    const int size = values->component_count;
    double corners[8][3];
    for (int c = 0; c < grid_type_vertex_count(of->of.type); c++)
        grid_read_vertex_position(&w->rows.cells, session_row_vertex(&w->rows, first + of->corners[c]), corners[c]);
    for (int n = 0; n < of->of.count; n++)
        values->read(values->of,
                     values->is_by_entry ? session_row_entry(&w->rows, cell, n)
                                         : session_row_vertex(&w->rows, first + n),
                     buffer + n * size);
    session_interpolate(of, (const double(*)[3])corners, size, buffer, buffer + of->of.count * size,
                        out + find_first_node(w, cell) * size);
}

static bool interpolate_cells(const finer_work *w, const session_node_values *values, int threads, double *out)
{
    const int64_t cells = w->rows.cells.cell_count;
    bool is_lacking = false;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, w->node_count)) reduction(|| : is_lacking)
    {
        region_enter();
        double *buffer = base_alloc((find_buffer_size(w, values->component_count) + 1) * sizeof *buffer);
        is_lacking = !buffer;
#pragma omp for schedule(static)
        for (int64_t cell = 0; cell < cells; cell++)
            if (buffer) interpolate_cell(w, values, cell, buffer, out);
        base_free(buffer);
        region_leave();
    }
    return !is_lacking;
}

insitu_status session_interpolate_values(const session_mesh *mesh, const session_node_values *values, int threads,
                                         double *out, base_error *error)
{
    finer_work *w = base_alloc(sizeof *w);
    bool is_made = w && create_finer_work(&mesh->finer, NULL, w);
    if (is_made) w->node_count = mesh->finer.fine.vertex_count;
    is_made = is_made && interpolate_cells(w, values, threads, out);
    if (w) free_finer_work(w);
    base_free(w);
    if (is_made) return INSITU_OK;
    return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory for the interpolation in cells", mesh->label);
}

/* ---- making the finer lattices of a mesh ------------------------------------------------------------------------- */

static void read_vertex(const void *of, int64_t position, double *tuple)
{
    grid_read_vertex_position(of, position, tuple);
}

/* Computes the number of nodes of the finer lattices. Unless all cells are refined and of one kind, also stores the
 * index of each cell's first node and each cell's type. */
static bool number_nodes(finer_work *w, session_finer *finer)
{
    const int64_t cells = w->rows.cells.cell_count;
    if (w->rows.kind_count == 1 && !w->marks) {
        w->node_count = cells * w->kinds[0][0].fine.count;
        return true;
    }
    finer->offsets = base_alloc(((size_t)cells + 1) * sizeof *finer->offsets);
    finer->types = base_alloc((size_t)cells + 1);
    if (!finer->offsets || !finer->types) return false;
    for (int64_t cell = 0; cell < cells; cell++) {
        const session_nodes *fine = &find_interpolation(w, cell)->fine;
        finer->offsets[cell] = w->node_count;
        finer->types[cell] = (unsigned char)session_lagrange_type(fine->type);
        w->node_count += fine->count;
    }
    finer->offsets[cells] = w->node_count;
    finer->bytes += cells * (int64_t)(sizeof *finer->offsets + 1);
    return true;
}

/* Describes the finer cells by an insitu_mesh, as if the caller had passed them. */
static void describe_finer_cells(const finer_work *w, session_finer *finer)
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
        fine->order = w->kinds[0][0].fine.order;
        fine->cell_type = (insitu_cell_type)session_lagrange_type(w->kinds[0][0].fine.type);
    }
}

static bool make_cells(session_finer *finer, const unsigned char *marks, int threads)
{
    finer_work *w = base_alloc(sizeof *w);
    bool is_made = w && create_finer_work(finer, marks, w) && number_nodes(w, finer);
    if (is_made) {
        const session_node_values positions = {&w->rows.cells, false, 3, read_vertex};
        const size_t bytes = 3 * (size_t)w->node_count * sizeof *finer->coordinates;
        finer->coordinates = base_alloc(bytes);
        finer->bytes += (int64_t)bytes;
        is_made = finer->coordinates && interpolate_cells(w, &positions, threads, finer->coordinates);
    }
    if (is_made) describe_finer_cells(w, finer);
    if (w) free_finer_work(w);
    base_free(w);
    return is_made;
}

/* Frees all data that was computed from the previous cells and nodes of a mesh. It must be called after mesh->given has
 * been replaced by a description with other nodes. */
static void drop_node_data(session_meshes *meshes, session_mesh *mesh)
{
    session_drop_cell_data(meshes, mesh);
    session_select_grid_arrays(mesh);
    for (int i = 0; i < mesh->field_count; i++) session_drop_copy(&mesh->fields[i]);
}

void session_free_finer_lattices_of_mesh(session_meshes *meshes, session_mesh *mesh)
{
    if (!mesh->finer.parts) return;
    mesh->given = mesh->finer.nodal;
    session_drop_finer_lattices(&mesh->finer);
    drop_node_data(meshes, mesh);
}

void session_free_finer_lattices(session_meshes *meshes)
{
    for (int i = 0; i < meshes->count; i++) {
        session_free_finer_lattices_of_mesh(meshes, meshes->items[i]);
        meshes->items[i]->given.vertex_ids = meshes->items[i]->original.vertex_ids;
    }
}

/* Returns whether the existing finer lattices have exactly the refined cells and the linear pieces that `marks`
 * selects. marks: NULL selects all cells and pieces. */
static bool has_same_refined_cells(const session_finer *finer, const session_cell_marks *marks)
{
    static const session_piece_set all = {NULL, NULL};
    session_rows rows = session_describe_caller_rows(&finer->nodal);
    int counts[ROWS_MOST_KINDS];
    bool is_same = true;
    session_list_cell_kinds(&rows);
    for (int i = 0; i < rows.kind_count; i++) {
        const session_nodes *of = &rows.kinds[i].nodes;
        counts[i] = session_describe_complete_nodes(of->type, finer->parts * of->order).count;
    }
    for (int64_t cell = 0; is_same && cell < finer->nodal.cell_count; cell++)
        is_same =
            (!marks || marks->cells[cell]) == is_refined(finer, counts[session_find_kind_of_cell(&rows, cell)], cell);
    return is_same && session_is_same_piece_set(&finer->pieces, marks ? &marks->pieces : &all, finer->nodal.cell_count);
}

/* Makes finer lattices in a part of a mesh according to the choice and the marks. Returns whether the cells that the
 * session reads have changed. */
static bool make_finer_mesh(session_meshes *meshes, session_mesh *mesh, const session_finer_choice *choice,
                            session_cell_marks *marks, int threads, base_error *error)
{
    const session_finer *old = &mesh->finer;
    session_finer made = {.is_counted = true,
                          .parts = choice->parts > 1 || choice->is_completed ? choice->parts : 0,
                          .is_lobatto = choice->is_lobatto,
                          .sizes = old->parts ? old->sizes : session_get_bounds_and_counts(mesh),
                          .given_counts = mesh->given_counts};
    memcpy(made.counts, old->counts, sizeof made.counts);
    if (old->parts == made.parts &&
        (!made.parts || (old->is_lobatto == made.is_lobatto && has_same_refined_cells(old, marks))))
        return false;
    unsigned char *outer_faces = mesh->finer.outer_faces;
    mesh->finer.outer_faces = NULL;
    session_free_finer_lattices_of_mesh(meshes, mesh);
    mesh->finer.outer_faces = outer_faces;
    if (!made.parts || !session_has_higher_order(&mesh->given)) return true;
    made.nodal = mesh->given;
    if (!make_cells(&made, marks ? marks->cells : NULL, threads)) {
        const int64_t bytes = made.bytes;
        session_drop_finer_lattices(&made);
        session_fail_for_memory(error, bytes, "finer lattices of nodes in cells of higher order");
        return true;
    }
    mesh->finer.outer_faces = NULL;
    session_drop_finer_lattices(&mesh->finer);
    made.outer_faces = outer_faces;
    if (marks) {
        made.pieces = marks->pieces;
        made.bytes += session_piece_set_bytes(&made.pieces, made.nodal.cell_count);
        marks->pieces = (session_piece_set){0};
    }
    mesh->finer = made;
    mesh->given = made.fine;
    drop_node_data(meshes, mesh);
    return true;
}

/* ---- counts of cells of higher order ----------------------------------------------------------------------------- */

void session_drop_vertex_ids(const session_meshes *meshes)
{
    for (int i = 0; i < meshes->count; i++) {
        insitu_mesh *given = &meshes->items[i]->given;
        if (meshes->items[i]->topology.is_split) given->vertex_ids = (insitu_array){0};
    }
}

static void count_spacings(const session_polynomials *of, int64_t counts[SESSION_FINER_COUNTS], double (*positions)[3],
                           int64_t cells[ROWS_MOST_KINDS])
{
    for (int64_t cell = 0; cell < of->cell_count; cell++) {
        const int kind = session_find_kind_of_cell(&of->rows, cell);
        const session_nodes *nodes = &of->rows.kinds[kind].nodes;
        const int64_t first = session_find_first_entry_of_cell(&of->rows, cell);
        cells[kind]++;
        if (!session_may_have_lobatto_nodes(nodes)) continue;
        for (int n = 0; n < nodes->count; n++)
            grid_read_vertex_position(&of->rows.cells, session_row_vertex(&of->rows, first + n), positions[n]);
        counts[session_find_derivatives_of_cell(of, cell, positions[0], 3) == &of->kinds[2 * kind] ? EQUISPACED
                                                                                                   : LOBATTO]++;
    }
}

/* Counts the cells of a part, which must not have finer lattices, and stores the counts in mesh->finer. Returns false
 * if memory runs out. */
static bool count_higher_order_cells_of_part(session_mesh *mesh)
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
    double(*positions)[3] = base_alloc((size_t)nodes * sizeof *positions);
    is_made = is_made && positions;
    if (is_made) count_spacings(&polynomials, counts, positions, cells);
    for (int i = 0; i < polynomials.rows.kind_count; i++) {
        const session_nodes *of = &polynomials.rows.kinds[i].nodes;
        counts[PYRAMIDS] += of->type == GRID_PYRAMID && of->order > INTERPOLATION_MOST_PYRAMID ? cells[i] : 0;
        counts[SERENDIPITY] += of->is_complete ? 0 : cells[i];
        counts[SHELLS] += grid_is_shell_type(of->type) ? cells[i] : 0;
    }
    if (is_made) counts[order]++;
    base_free(positions);
    session_polynomials_free(&polynomials);
    mesh->finer.is_counted = is_made;
    return is_made;
}

static bool sum_higher_order_cell_counts(const session_meshes *meshes, const char *name,
                                         int64_t sums[SESSION_FINER_COUNTS])
{
    const session_parts parts = session_find_parts(meshes, name);
    bool is_made = true;
    for (int i = 0; i < parts.count; i++) {
        session_mesh *part = parts.items[i];
        if (!part->is_given || !part->topology.is_split) continue;
        is_made = is_made && (part->finer.is_counted || count_higher_order_cells_of_part(part));
        for (int n = 0; n < SESSION_FINER_COUNTS; n++) sums[n] += part->finer.counts[n];
    }
    return is_made;
}

int session_find_max_edge_parts(const session_finer_choice *choice)
{
    const int most = choice->order ? NODES_MOST_ORDER / choice->order : FINER_MOST_PARTS;
    return most < FINER_MOST_PARTS ? most : FINER_MOST_PARTS;
}

static session_finer_choice make_choice(const int64_t sums[SESSION_FINER_COUNTS])
{
    session_finer_choice out = {.order = NODES_MOST_ORDER,
                                .excluded_count = sums[PYRAMIDS],
                                .serendipity_count = sums[SERENDIPITY],
                                .shell_count = sums[SHELLS],
                                .is_lobatto = sums[LOBATTO] > sums[EQUISPACED],
                                .parts = 1};
    while (out.order > 0 && !sums[out.order]) out.order--;
    return out;
}

insitu_status session_count_higher_order_cells(session_meshes *meshes, const session_catalogue *catalogue,
                                               MPI_Comm comm, session_finer_choice *choices, base_error *error)
{
    const int words = catalogue->mesh_count * SESSION_FINER_COUNTS;
    int64_t *sums = base_calloc((size_t)words + 1, sizeof *sums);
    bool is_made = sums != NULL;
    for (int m = 0; m < catalogue->mesh_count && is_made; m++)
        is_made = sum_higher_order_cell_counts(meshes, catalogue->meshes[m].name, sums + m * SESSION_FINER_COUNTS);
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

/* ---- marks of refined cells, and memory of finer lattices -------------------------------------------------------- */

bool session_allocate_cell_marks(session_finer_choice *choice, const session_parts *parts)
{
    choice->marks = base_calloc((size_t)parts->count + 1, sizeof *choice->marks);
    bool is_made = choice->marks;
    if (is_made) choice->mark_count = parts->count;
    for (int i = 0; i < parts->count && is_made; i++) {
        choice->marks[i].cells = base_calloc((size_t)parts->items[i]->given.cell_count + 1, 1);
        is_made = choice->marks[i].cells;
    }
    return is_made;
}

void session_free_choices(session_finer_choice *choices, int count)
{
    for (int m = 0; choices && m < count; m++) {
        for (int i = 0; i < choices[m].mark_count; i++) {
            base_free(choices[m].marks[i].cells);
            session_drop_piece_set(&choices[m].marks[i].pieces);
        }
        base_free(choices[m].marks);
    }
    base_free(choices);
}

/* Adds to *out the number of bytes of the finer lattices of `cells` cells in which each edge between two nodes is cut
 * into `parts` parts. out->own: 24 bytes for the coordinates of each node, 4 for each vertex of a piece, and 4 for each
 * piece to store the index of its cell; out->per_component: 8 bytes for the value at each node. */
static void add_finer_lattice_bytes(const session_nodes *nodes, int parts, int64_t cells, session_finer_bytes *out)
{
    const int64_t m = parts * nodes->order, pieces = grid_is_shell_type(nodes->type) ? m * m : m * m * m;
    const int64_t fine = session_describe_complete_nodes(nodes->type, (int)m).count;
    out->own += cells * (pieces * 4 * (grid_type_vertex_count(nodes->type) + 1) + fine * 24);
    out->per_component += cells * fine * 8;
}

void session_count_finer_bytes(const session_mesh *mesh, const unsigned char *marks,
                               session_finer_bytes out[FINER_MOST_PARTS + 1])
{
    const insitu_mesh *nodal = mesh->finer.parts ? &mesh->finer.nodal : &mesh->given;
    session_rows rows = session_describe_caller_rows(nodal);
    int64_t counts[ROWS_MOST_KINDS][2] = {{0}};
    session_list_cell_kinds(&rows);
    for (int64_t cell = 0; cell < nodal->cell_count; cell++)
        counts[session_find_kind_of_cell(&rows, cell)][marks && !marks[cell]]++;
    for (int i = 0; i < rows.kind_count; i++)
        for (int parts = 2; parts <= FINER_MOST_PARTS; parts++) {
            add_finer_lattice_bytes(&rows.kinds[i].nodes, parts, counts[i][0], &out[parts]);
            add_finer_lattice_bytes(&rows.kinds[i].nodes, 1, counts[i][1], &out[parts]);
        }
}

insitu_status session_make_finer_lattices(session_meshes *meshes, const session_catalogue *catalogue,
                                          session_finer_choice *choices, const session_team *team, bool *are_changed,
                                          base_error *error)
{
    int mine = 0, any = 0;
    for (int m = 0; m < catalogue->mesh_count; m++) {
        const session_parts of = session_find_parts(meshes, catalogue->meshes[m].name);
        for (int i = 0; i < of.count && !error->status; i++) {
            session_cell_marks *marks = choices[m].parts > 1 ? session_get_marks_of_part(&choices[m], i) : NULL;
            if (of.items[i]->is_given && of.items[i]->topology.is_split)
                mine |= make_finer_mesh(meshes, of.items[i], &choices[m], marks, team->threads, error);
        }
    }
    insitu_status status = session_agree(team->comm, error);
    if (!status)
        status = session_check_mpi(error, MPI_Allreduce(&mine, &any, 1, MPI_INT, MPI_MAX, team->comm), "MPI_Allreduce");
    *are_changed = *are_changed || any;
    return status;
}
