/* Each block of a refined mesh has a box: the range of its cells' indices in its level of refinement. Each rank sends
 * the boxes of its blocks to all ranks near them. A rank is near a block if the bounding box of all its own blocks
 * intersects the block's box; boxes are compared in units of cells of the coarsest level. Boxes are sorted into bins by
 * their centres, so that the work depends only on the number of blocks and on the number of blocks that cover each
 * block. The boxes are kept, because session_drop_faces_between_levels() uses them later. */
#include "session_covers.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_bins.h"
#include "session_cell_faces.h"
#include "session_conform.h"
#include "session_exchange.h"
#include "session_hash.h"
#include "session_homes.h"
#include "session_lattice.h"
#include "session_topology.h"

enum { BOX_WORDS = sizeof(session_level_box) / sizeof(uint64_t) };

/* Boxes sorted into bins by their centres, in units of cells of the coarsest level. */
typedef struct box_bins {
    int64_t count;
    int64_t *boxes;       /* for each box in the bins, its index in the array of boxes that was passed to bin_boxes() */
    double (*centres)[3]; /* centre of each box */
    double largest_half_width; /* half of the largest side length of all boxes */
    session_bins bins;
} box_bins;

typedef struct cover_search {
    const session_team *team;
    int64_t count;            /* number of boxes */
    session_level_box *boxes; /* the boxes of this rank, followed by the received ones */
    box_bins finer_bins;      /* bins of those boxes that may cover cells */
} cover_search;

static void bins_free(box_bins *bins)
{
    base_free(bins->boxes);
    base_free(bins->centres);
    session_bins_free(&bins->bins);
}

static void search_free(cover_search *s)
{
    base_free(s->boxes);
    bins_free(&s->finer_bins);
}

/* ---- boxes of refined blocks ------------------------------------------------------------------------------------- */

static session_level_box make_level_box(const session_mesh *mesh, int rank)
{
    const insitu_lattice *l = mesh->given.lattice;
    const grid_lattice *cells = &mesh->lattice.cells;
    session_level_box out = {SESSION_HASH_BEGIN, mesh->block, rank, {0, 0, 0}, {1, 1, 1}, {1, 1, 1}};
    session_hash_text(&out.mesh, mesh->name);
    for (int axis = 0; axis < 3; axis++) {
        /* a two-dimensional block consists of quads, which have the same index along the axis that has no cells */
        if (!l->cells[axis]) continue;
        out.lower[axis] = l->first[axis] + cells->drawn_first[axis];
        out.upper[axis] = l->first[axis] + cells->drawn_end[axis];
        out.refinement[axis] = l->refinement[axis];
    }
    return out;
}

static bool is_coarsest(const session_level_box *box)
{
    return box->refinement[0] == 1 && box->refinement[1] == 1 && box->refinement[2] == 1;
}

/* Returns whether box a belongs to a finer level than b: it is finer along some axis and not coarser along any. */
static bool is_finer(const session_level_box *a, const session_level_box *b)
{
    bool is_any = false;
    for (int axis = 0; axis < 3; axis++) {
        if (a->refinement[axis] < b->refinement[axis]) return false;
        is_any = is_any || a->refinement[axis] > b->refinement[axis];
    }
    return is_any;
}

static void find_box_bounds(const session_level_box *box, double lower[3], double upper[3])
{
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = (double)box->lower[axis] / (double)box->refinement[axis];
        upper[axis] = (double)box->upper[axis] / (double)box->refinement[axis];
    }
}

static bool is_refined_block(const session_mesh *mesh)
{
    return mesh->is_given && session_has_refinement_level(&mesh->given) && mesh->cells.lattice;
}

/* Computes the common box of this rank: the bounding box of its refined blocks, in units of cells of the coarsest
 * level. It is extended by one such cell, which is far more than rounding requires. */
static session_box find_bounding_box_of_rank(const session_meshes *meshes)
{
    session_box out = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int i = 0; i < meshes->count; i++) {
        double lower[3], upper[3];
        if (!is_refined_block(meshes->items[i])) continue;
        const session_level_box box = make_level_box(meshes->items[i], 0);
        find_box_bounds(&box, lower, upper);
        for (int axis = 0; axis < 3; axis++) {
            out.lower[axis] = fmin(out.lower[axis], lower[axis] - 1);
            out.upper[axis] = fmax(out.upper[axis], upper[axis] + 1);
        }
    }
    return out;
}

static bool list_own_boxes(const session_meshes *meshes, cover_search *s)
{
    s->boxes = base_alloc((size_t)(meshes->count + 1) * sizeof *s->boxes);
    for (int i = 0; i < meshes->count && s->boxes; i++) {
        if (!is_refined_block(meshes->items[i])) continue;
        s->boxes[s->count++] = make_level_box(meshes->items[i], s->team->rank);
    }
    return s->boxes != NULL;
}

/* ---- exchange of boxes between ranks ----------------------------------------------------------------------------- */

static bool intersects_box(const session_level_box *box, const session_box *common)
{
    double lower[3], upper[3];
    find_box_bounds(box, lower, upper);
    for (int axis = 0; axis < 3; axis++)
        if (!(lower[axis] <= common->upper[axis] && common->lower[axis] <= upper[axis])) return false;
    return true;
}

/* For each other rank, packs the boxes of this rank's blocks that intersect the common box of the other rank
 * (find_bounding_box_of_rank()). If mail->words is NULL, the words are only counted. */
static void pack_or_count_boxes(const cover_search *s, const session_box *commons, session_mail *mail)
{
    mail->total = 0;
    for (int rank = 0; rank < s->team->ranks; rank++) {
        const int64_t first = mail->total;
        for (int64_t i = 0; i < s->count && rank != s->team->rank; i++) {
            if (!intersects_box(&s->boxes[i], &commons[rank])) continue;
            if (mail->words) memcpy(mail->words + mail->total, &s->boxes[i], sizeof s->boxes[i]);
            mail->total += BOX_WORDS;
        }
        mail->counts[rank] = mail->total - first;
    }
}

static bool pack_boxes(const cover_search *s, const session_box *commons, session_mail *mail)
{
    mail->counts = base_calloc((size_t)s->team->ranks, sizeof *mail->counts);
    if (!mail->counts) return false;
    pack_or_count_boxes(s, commons, mail);
    mail->words = base_alloc((size_t)mail->total * sizeof *mail->words);
    if (mail->words) pack_or_count_boxes(s, commons, mail);
    return mail->words != NULL;
}

static bool receive_boxes(cover_search *s, const session_mail *in)
{
    const int64_t count = in->total / BOX_WORDS;
    session_level_box *boxes = base_realloc(s->boxes, (size_t)(s->count + count + 1) * sizeof *boxes);
    if (!boxes) return false;
    s->boxes = boxes;
    if (count) memcpy(boxes + s->count, in->words, (size_t)count * sizeof *boxes);
    s->count += count;
    return true;
}

static insitu_status exchange_boxes(cover_search *s, const session_meshes *meshes, base_error *error)
{
    session_mail out = {0}, in = {0};
    const session_box own = find_bounding_box_of_rank(meshes);
    session_box *commons = base_alloc((size_t)s->team->ranks * sizeof *commons);
    if (!commons) session_fail_for_memory(error, s->team->ranks * (int64_t)sizeof *commons, "boxes of blocks");
    insitu_status status = session_agree(s->team->comm, error);
    if (!status)
        status = session_check_mpi(
            error, MPI_Allgather(&own, sizeof own, MPI_BYTE, commons, sizeof own, MPI_BYTE, s->team->comm),
            "MPI_Allgather");
    if (!status && !pack_boxes(s, commons, &out))
        session_fail_for_memory(error, s->count * (int64_t)sizeof *s->boxes, "boxes of blocks");
    if (!status) status = session_mail_exchange(s->team->comm, &out, &in, error);
    if (!status && !receive_boxes(s, &in)) session_fail_for_memory(error, in.total * 8, "boxes of blocks");
    session_mail_free(&out);
    session_mail_free(&in);
    base_free(commons);
    return status;
}

/* covered cells ------------------------------------------------------------------------------------------------ */

/* Sorts boxes into bins. Unless with_coarsest is set, the boxes of the coarsest level are left out, because they cover
 * no cells. Returns false if memory runs out. */
static bool bin_boxes(const session_level_box *boxes, int64_t count, bool with_coarsest, box_bins *out)
{
    out->boxes = base_alloc((size_t)(count + 1) * sizeof *out->boxes);
    out->centres = base_alloc((size_t)(count + 1) * sizeof *out->centres);
    if (!out->boxes || !out->centres) return false;
    for (int64_t i = 0; i < count; i++) {
        double lower[3], upper[3];
        if (!with_coarsest && is_coarsest(&boxes[i])) continue;
        find_box_bounds(&boxes[i], lower, upper);
        for (int axis = 0; axis < 3; axis++) {
            out->centres[out->count][axis] = 0.5 * (lower[axis] + upper[axis]);
            out->largest_half_width = fmax(out->largest_half_width, 0.5 * (upper[axis] - lower[axis]));
        }
        out->boxes[out->count++] = i;
    }
    return session_bins_create(&out->bins, out->centres[0], (int64_t)sizeof *out->centres, out->count);
}

/* Returns a / b, rounded down. */
static int64_t floor_quotient(int64_t a, int64_t b)
{
    const int64_t q = a / b;
    return a % b < 0 ? q - 1 : q;
}

/* The cells of a coarse box that a fine box overlaps, as index ranges of the coarse level. */
typedef struct overlap {
    int64_t lower[3], upper[3]; /* index range of the cells that the fine box covers completely or in part */
    /* along each axis, the part of that range in which the fine box covers cells completely */
    int64_t whole_lower[3], whole_upper[3];
    /* an axis along which the fine box covers some cells only in part; -1: there is none */
    int cut_axis;
} overlap;

/* Computes the overlap of a coarse box with a fine one. Returns false if they have no cell in common. */
static bool find_overlap(const session_level_box *coarse, const session_level_box *fine, overlap *out)
{
    out->cut_axis = -1;
    for (int axis = 0; axis < 3; axis++) {
        const int64_t of = fine->refinement[axis], by = coarse->refinement[axis];
        /* Ends of the fine box, in a unit in which all lengths are integers: a cell of the coarse box has the length
         * `of`, a cell of the fine box the length `by`, and a cell of the coarsest level their product. */
        const int64_t begin = fine->lower[axis] * by, end = fine->upper[axis] * by;
        const int64_t first = coarse->lower[axis], last = coarse->upper[axis];
        const int64_t lower = floor_quotient(begin, of), upper = -floor_quotient(-end, of);
        out->lower[axis] = lower < first ? first : lower;
        out->upper[axis] = upper > last ? last : upper;
        if (out->lower[axis] >= out->upper[axis]) return false;
        const int64_t whole_lower = -floor_quotient(-begin, of), whole_upper = floor_quotient(end, of);
        out->whole_lower[axis] = whole_lower < first ? first : whole_lower;
        out->whole_upper[axis] = whole_upper > last ? last : whole_upper;
        if (out->whole_lower[axis] > out->lower[axis] || out->whole_upper[axis] < out->upper[axis])
            out->cut_axis = axis;
    }
    return true;
}

/* Bits of the bytes in the array of covered cells. IS_HIDDEN: a finer block covers the whole cell, or the caller marks
 * it as a ghost. IS_CUT: a finer block covers only part of the cell; report_partly_covered_cells() removes this bit. */
enum { IS_HIDDEN = 1, IS_CUT = 2 };

/* Iterates over the rows of the cells in an overlap. A row contains the cells with the same indices j and k. */
typedef struct row_walk {
    const session_mesh *mesh;
    const overlap *cells;
    int64_t j, k;
    int64_t first; /* index of the row's first cell in the mesh's list of cells */
    bool is_whole; /* true if the fine box covers the cells of the row completely along the axes of j and k */
} row_walk;

static row_walk walk_rows(const session_mesh *mesh, const overlap *cells)
{
    return (row_walk){mesh, cells, cells->lower[1] - 1, cells->lower[2], 0, true};
}

static bool next_row(row_walk *w)
{
    const overlap *cells = w->cells;
    const insitu_lattice *l = w->mesh->given.lattice;
    const int64_t *strides = w->mesh->lattice.cells.cell_numbering.stride;
    if (++w->j == cells->upper[1]) {
        w->j = cells->lower[1];
        w->k++;
    }
    const int64_t at[3] = {cells->lower[0], w->j, w->k};
    w->first = 0;
    for (int axis = 0; axis < 3; axis++) w->first += (at[axis] - (l->cells[axis] ? l->first[axis] : 0)) * strides[axis];
    w->is_whole = w->j >= cells->whole_lower[1] && w->j < cells->whole_upper[1] && w->k >= cells->whole_lower[2] &&
                  w->k < cells->whole_upper[2];
    return w->k < cells->upper[2];
}

static void mark_cells(const session_mesh *mesh, const overlap *cells, unsigned char *covered)
{
    const int64_t stride = mesh->lattice.cells.cell_numbering.stride[0];
    for (row_walk row = walk_rows(mesh, cells); next_row(&row);)
        for (int64_t i = cells->lower[0]; i < cells->upper[0]; i++) {
            const bool is_whole = row.is_whole && i >= cells->whole_lower[0] && i < cells->whole_upper[0];
            covered[row.first + (i - cells->lower[0]) * stride] |= is_whole ? IS_HIDDEN : IS_CUT;
        }
}

/* Returns whether some cell of the overlap is covered only in part, that is, has the bit IS_CUT without IS_HIDDEN. */
static bool has_partly_covered_cell(const session_mesh *mesh, const overlap *cells, const unsigned char *covered)
{
    const int64_t stride = mesh->lattice.cells.cell_numbering.stride[0];
    for (row_walk row = walk_rows(mesh, cells); next_row(&row);)
        for (int64_t i = 0; i < cells->upper[0] - cells->lower[0]; i++)
            if (covered[row.first + i * stride] == IS_CUT) return true;
    return false;
}

/* Iterates over the boxes of finer blocks that overlap a block; `fine` is the current box, and `cells` its overlap with
 * the block. */
typedef struct finer_walk {
    const cover_search *search;
    session_level_box box; /* box of the block */
    session_bin_walk bins;
    const session_level_box *fine;
    overlap cells;
} finer_walk;

static finer_walk walk_finer(const cover_search *s, const session_mesh *mesh)
{
    finer_walk w = {.search = s, .box = make_level_box(mesh, s->team->rank)};
    double lower[3], upper[3];
    find_box_bounds(&w.box, lower, upper);
    w.bins = session_begin_bin_walk(&s->finer_bins.bins, lower, upper, s->finer_bins.largest_half_width);
    return w;
}

static bool next_finer(finer_walk *w)
{
    int64_t near;
    while (session_next_point_in_bins(&w->bins, &near)) {
        w->fine = &w->search->boxes[w->search->finer_bins.boxes[near]];
        if (w->fine->mesh == w->box.mesh && is_finer(w->fine, &w->box) && find_overlap(&w->box, w->fine, &w->cells))
            return true;
    }
    return false;
}

/* Finds the cells of the block that finer blocks cover. *out receives an array with one byte per cell, which contains
 * the bits IS_HIDDEN and IS_CUT, or NULL if no finer block overlaps the block. *has_cuts receives whether a finer block
 * covers only part of some cell. Returns false if memory runs out. */
static bool find_covered_cells(const cover_search *s, const session_mesh *mesh, unsigned char **out, bool *has_cuts)
{
    *out = NULL;
    *has_cuts = false;
    for (finer_walk w = walk_finer(s, mesh); next_finer(&w);) {
        if (!*out) *out = base_calloc((size_t)mesh->given.cell_count + 1, 1);
        if (!*out) return false;
        *has_cuts = *has_cuts || w.cells.cut_axis >= 0;
        mark_cells(mesh, &w.cells, *out);
    }
    return true;
}

/* Describes a finer block in mesh->misfit if it covers some cell only in part. This is an error unless another block
 * covers the whole cell. For example, a block that is two levels finer is allowed to begin within a cell if a block of
 * the level in between covers the cell. Then sets all bytes of `covered` to 0 or 1. */
static void report_partly_covered_cells(const cover_search *s, session_mesh *mesh, unsigned char *covered)
{
    for (finer_walk w = walk_finer(s, mesh); next_finer(&w) && !mesh->misfit.exists;) {
        const int axis = w.cells.cut_axis;
        if (axis >= 0 && has_partly_covered_cell(mesh, &w.cells, covered))
            mesh->misfit = (session_misfit){true, axis, w.fine->block, w.fine->refinement[axis], (int)w.fine->rank};
    }
    for (int64_t cell = 0; cell < mesh->given.cell_count; cell++) covered[cell] = covered[cell] != 0;
}

/* Sets the bit IS_HIDDEN in `covered` also for cells that the caller flags as ghosts. If the caller's flags must be
 * read from a converted copy, the copy is filled here, because the session otherwise fills copies only later. */
static void add_caller_ghosts(session_mesh *mesh, int threads, unsigned char *covered)
{
    const insitu_array *ghosts = &mesh->given.ghosts;
    if (!ghosts->data) return;
    session_convert_arrays(mesh, threads);
    const grid_array flags = session_grid_array(ghosts);
    const grid g = {
        .ghosts = flags.data, .ghosts_stride = flags.stride, .ghosts_bytes = (int)session_type_size(ghosts->type)};
    for (int64_t cell = 0; cell < mesh->given.cell_count; cell++)
        if (grid_is_flagged_as_ghost(&g, cell)) covered[cell] |= IS_HIDDEN;
}

static bool update_covered_cells_of_block(const cover_search *s, session_meshes *meshes, session_mesh *mesh)
{
    unsigned char *covered;
    bool has_cuts;
    mesh->misfit = (session_misfit){.exists = false};
    if (!find_covered_cells(s, mesh, &covered, &has_cuts)) return false;
    if (covered) add_caller_ghosts(mesh, s->team->threads, covered);
    if (has_cuts) report_partly_covered_cells(s, mesh, covered);
    const bool is_same =
        !covered == !mesh->covered && (!covered || memcmp(covered, mesh->covered, (size_t)mesh->given.cell_count) == 0);
    if (is_same) {
        /* the old array is kept, because mirror images point to it until the block's cells change */
        base_free(covered);
    } else {
        session_drop_cell_data(meshes, mesh);
        base_free(mesh->covered);
        mesh->covered = covered;
    }
    session_select_grid_arrays(mesh);
    if (mesh->misfit.exists) mesh->is_check_stale = true;
    return true;
}

insitu_status session_update_covered_cells(session_meshes *meshes, const session_team *team, base_error *error)
{
    cover_search s = {.team = team};
    if (!list_own_boxes(meshes, &s))
        session_fail_for_memory(error, meshes->count * (int64_t)sizeof *s.boxes, "boxes of blocks");
    insitu_status status = exchange_boxes(&s, meshes, error);
    bool is_done = !status && !error->status && bin_boxes(s.boxes, s.count, false, &s.finer_bins);
    for (int i = 0; i < meshes->count && is_done; i++)
        if (is_refined_block(meshes->items[i])) is_done = update_covered_cells_of_block(&s, meshes, meshes->items[i]);
    if (!status && !error->status && !is_done)
        session_fail_for_memory(error, s.count * 100, "cells that finer blocks cover");
    if (is_done) {
        base_free(meshes->level_boxes);
        meshes->level_boxes = s.boxes;
        meshes->level_box_count = s.count;
        s.boxes = NULL;
    }
    search_free(&s);
    if (!status) status = session_agree(team->comm, error);
    if (!status) meshes->are_levels_changed = false;
    return status;
}

/* ---- faces between levels of refinement -------------------------------------------------------------------------- */

/* Computes the centre of the cell on the other side of a face, under the assumption that this cell has the same size as
 * the face's cell. The result is in units of cells of the coarsest level. */
static void find_neighbour_centre(const session_mesh *mesh, const session_level_box *box, const session_face *face,
                                  double out[3])
{
    const grid_lattice *l = &mesh->lattice.cells;
    const insitu_lattice *given = mesh->given.lattice;
    const session_cell_faces faces = session_faces_of_cell(&mesh->cells, face->cell);
    const session_face_loop loop = session_find_face_loop(&faces, face->face);
    for (int axis = 0; axis < 3; axis++) {
        const int64_t index = grid_index_along(&l->cell_numbering, axis, face->cell);
        int64_t least = INT64_MAX, most = 0;
        for (int64_t i = 0; i < loop.size; i++) {
            const int64_t at = grid_index_along(&l->vertex_numbering, axis, session_face_vertex(&loop, i));
            least = at < least ? at : least;
            most = at > most ? at : most;
        }
        const double beyond = least < most ? 0 : least > index ? 1 : -1;
        out[axis] = given->cells[axis]
                        ? ((double)(given->first[axis] + index) + 0.5 + beyond) / (double)box->refinement[axis]
                        : 0.5;
    }
}

/* Returns the finest box of the mesh that contains the position `at`, or NULL if there is none. mesh: hash of the
 * mesh's name. */
static const session_level_box *find_finest(const session_meshes *meshes, const box_bins *bins, uint64_t mesh,
                                            const double at[3])
{
    const session_level_box *finest = NULL;
    session_bin_walk walk = session_begin_bin_walk(&bins->bins, at, at, bins->largest_half_width);
    int64_t near;
    while (session_next_point_in_bins(&walk, &near)) {
        const session_level_box *box = &meshes->level_boxes[bins->boxes[near]];
        double lower[3], upper[3];
        bool is_in = box->mesh == mesh && (!finest || is_finer(box, finest));
        find_box_bounds(box, lower, upper);
        for (int axis = 0; axis < 3; axis++) is_in = is_in && lower[axis] < at[axis] && at[axis] < upper[axis];
        if (is_in) finest = box;
    }
    return finest;
}

/* Removes the outer faces of a block that have a block of another level on their other side. */
static void drop_inner_faces(const session_meshes *meshes, const box_bins *bins, const session_mesh *mesh,
                             session_outer *outer)
{
    const session_level_box own = make_level_box(mesh, 0);
    int64_t kept = 0;
    for (int64_t i = 0; i < outer->face_count; i++) {
        double at[3];
        find_neighbour_centre(mesh, &own, &outer->faces[i], at);
        const session_level_box *beside = find_finest(meshes, bins, own.mesh, at);
        if (!beside || memcmp(beside->refinement, own.refinement, sizeof own.refinement) == 0)
            outer->faces[kept++] = outer->faces[i];
    }
    outer->face_count = kept;
}

insitu_status session_drop_faces_between_levels(const session_meshes *meshes, const session_face_part *parts, int count,
                                                base_error *error)
{
    box_bins bins = {.count = 0};
    bool has_levels = false;
    for (int i = 0; i < count; i++)
        has_levels = has_levels || is_refined_block(session_find_source_part(parts[i].mesh));
    if (has_levels && !bin_boxes(meshes->level_boxes, meshes->level_box_count, true, &bins))
        session_fail_for_memory(error, meshes->level_box_count * 32, "faces between levels");
    for (int i = 0; i < count && has_levels && !error->status; i++) {
        /* the cells and faces of a mirror image are numbered as those of its source */
        const session_mesh *mesh = session_find_source_part(parts[i].mesh);
        if (is_refined_block(mesh) && !session_is_quad_lattice(mesh->given.lattice) &&
            !parts[i].outer->threshold.is_given)
            drop_inner_faces(meshes, &bins, mesh, parts[i].outer);
    }
    bins_free(&bins);
    return error->status;
}
