#include "blueprint_lattice.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Two positions are treated as equal if they differ by at most this fraction of the spacing, and two spacings or ratios
 * of spacings if their relative difference is at most this number. Rounding errors are far smaller, unless the spacing
 * is close to the precision of the coordinates. */
static const double tolerance = 1e-6;

/* Largest values that insitu_lattice allows for blocks with levels of refinement. */
static const double largest_first = 1099511627776, largest_refinement = 1048576;

uniform_block describe_uniform_block(const blueprint_mesh *mesh)
{
    const insitu_lattice *l = &mesh->lattice;
    uniform_block out = {.has_first = mesh->has_first, .has_level = mesh->has_level};
    for (int axis = 0; axis < 3; axis++) out.exists = out.exists || l->spacing[axis] != 0;
    out.exists = out.exists && mesh->mesh.lattice;
    if (out.exists) out.lattice = *l;
    return out;
}

/* ---- common origin and spacings of blocks ----------------------------------------------------------------------- */

static bool is_same_spacing(double a, double b)
{
    return fabs(a - b) <= tolerance * a;
}

static void merge_lattices_along_axis(common_lattice *into, const common_lattice *from, int axis)
{
    if (from->coarsest[axis] == 0) return;
    const bool is_first = into->coarsest[axis] == 0;
    const bool is_same = !is_first && is_same_spacing(into->coarsest[axis], from->coarsest[axis]);
    if (is_same) {
        into->origin[axis] = fmin(into->origin[axis], from->origin[axis]);
        into->coarsest[axis] = fmax(into->coarsest[axis], from->coarsest[axis]);
    } else if (from->coarsest[axis] > into->coarsest[axis]) {
        into->origin[axis] = from->origin[axis];
        into->coarsest[axis] = from->coarsest[axis];
    }
    if (is_first || from->finest[axis] < into->finest[axis]) into->finest[axis] = from->finest[axis];
}

static void merge(common_lattice *into, const common_lattice *from)
{
    for (int axis = 0; axis < 3; axis++) merge_lattices_along_axis(into, from, axis);
}

static common_lattice make_lattice_of_block(const uniform_block *block)
{
    common_lattice out = {.origin = {0}};
    for (int axis = 0; axis < 3; axis++) {
        if (!block->lattice.cells[axis]) continue;
        out.origin[axis] = block->lattice.origin[axis];
        out.coarsest[axis] = out.finest[axis] = fabs(block->lattice.spacing[axis]);
    }
    return out;
}

/* ---- lists of common lattices, one per mesh --------------------------------------------------------------------- */

/* Finds the item of a mesh. The blocks of a mesh are added one after the other, so the search begins with the last item
 * of the list. */
static named_lattice *find_item(const named_lattices *list, uint64_t mesh)
{
    for (int i = list->count - 1; i >= 0; i--)
        if (list->items[i].mesh == mesh) return &list->items[i];
    return NULL;
}

bool named_lattices_add(named_lattices *list, uint64_t mesh, const uniform_block *block)
{
    const common_lattice own = make_lattice_of_block(block);
    named_lattice *item = find_item(list, mesh);
    if (!item) {
        named_lattice *items = realloc(list->items, (size_t)(list->count + 1) * sizeof *items);
        if (!items) return false;
        list->items = items;
        item = &items[list->count++];
        *item = (named_lattice){.mesh = mesh};
    }
    merge(&item->common, &own);
    return true;
}

const common_lattice *named_lattices_find(const named_lattices *list, uint64_t mesh)
{
    const named_lattice *item = find_item(list, mesh);
    return item ? &item->common : NULL;
}

bool named_lattices_are_same(const named_lattices *a, const named_lattices *b)
{
    return a->count == b->count && (!a->count || memcmp(a->items, b->items, (size_t)a->count * sizeof *a->items) == 0);
}

void named_lattices_free(named_lattices *list)
{
    free(list->items);
    *list = (named_lattices){NULL, 0};
}

/* The buffers with which a rank receives the lattices of all ranks. */
typedef struct lattice_exchange {
    MPI_Comm comm;
    int ranks;
    /* for each rank: bytes: size of its items in bytes; starts: offset of its first item in bytes */
    int *bytes, *starts;
    named_lattice *all;
} lattice_exchange;

/* Returns whether the condition is true on all ranks. */
static bool is_true_everywhere(MPI_Comm comm, bool condition)
{
    int all = condition;
    return !MPI_Allreduce(MPI_IN_PLACE, &all, 1, MPI_INT, MPI_MIN, comm) && all;
}

static bool gather_lattice_counts(lattice_exchange *x, const named_lattices *own, int *total)
{
    const int bytes = own->count * (int)sizeof *own->items;
    *total = 0;
    if (!is_true_everywhere(x->comm, x->bytes && x->starts)) return false;
    if (MPI_Allgather(&bytes, 1, MPI_INT, x->bytes, 1, MPI_INT, x->comm)) return false;
    for (int rank = 0; rank < x->ranks; rank++) {
        x->starts[rank] = *total;
        *total += x->bytes[rank];
    }
    return true;
}

/* Lists the meshes of `own` in *out, each with the common lattice of the blocks of all ranks. `all` contains the items
 * of all ranks, in the order of the ranks. */
static void merge_lattices_of_ranks(const named_lattices *own, const named_lattice *all, int count, named_lattices *out)
{
    for (int i = 0; i < own->count; i++) out->items[i] = (named_lattice){.mesh = own->items[i].mesh};
    out->count = own->count;
    for (int i = 0; i < count; i++) {
        named_lattice *item = find_item(out, all[i].mesh);
        if (item) merge(&item->common, &all[i].common);
    }
}

bool named_lattices_agree(MPI_Comm comm, const named_lattices *own, named_lattices *out)
{
    lattice_exchange x = {.comm = comm};
    int total = 0;
    *out = (named_lattices){NULL, 0};
    if (MPI_Comm_size(comm, &x.ranks)) return false;
    x.bytes = malloc((size_t)x.ranks * sizeof *x.bytes);
    x.starts = malloc((size_t)x.ranks * sizeof *x.starts);
    bool is_done = gather_lattice_counts(&x, own, &total);
    if (is_done) {
        x.all = malloc((size_t)total + 1);
        out->items = malloc((size_t)own->count * sizeof *out->items + 1);
        is_done = is_true_everywhere(comm, x.all && out->items) &&
                  !MPI_Allgatherv(own->items, own->count * (int)sizeof *own->items, MPI_BYTE, x.all, x.bytes, x.starts,
                                  MPI_BYTE, comm);
    }
    if (is_done)
        merge_lattices_of_ranks(own, x.all, total / (int)sizeof *x.all, out);
    else
        named_lattices_free(out);
    free(x.bytes);
    free(x.starts);
    free(x.all);
    return is_done;
}

/* ---- position of a block in the common lattice ------------------------------------------------------------------ */

/* Moves the block's origin along an axis to the common origin, and its first index accordingly. If a block states its
 * first index, its origin must already equal the common origin, except for rounding. Returns false if the block's
 * vertices are not vertices of the common lattice. */
static bool move_axis_to_common_origin(const uniform_block *block, const common_lattice *common, int axis,
                                       insitu_lattice *out)
{
    const double spacing = block->lattice.spacing[axis];
    const double shift = (block->lattice.origin[axis] - common->origin[axis]) / spacing, whole = nearbyint(shift);
    if (!(fabs(shift - whole) <= tolerance) || !(fabs(whole) < largest_first)) return false;
    if (block->has_first && whole != 0) return false;
    out->origin[axis] = common->origin[axis];
    out->first[axis] = block->lattice.first[axis] + (int64_t)whole;
    return true;
}

/* Computes how many cells of the block, along an axis, are as long as one cell of the coarsest level. Returns false if
 * it is not an integer. */
static bool compute_axis_refinement(double coarsest, double spacing, int64_t *out)
{
    const double ratio = coarsest / fabs(spacing), whole = nearbyint(ratio);
    if (!(whole <= largest_refinement)) return false;
    *out = (int64_t)whole;
    return is_same_spacing(whole, ratio);
}

insitu_lattice uniform_block_place(const uniform_block *block, const common_lattice *common, bool *is_level)
{
    insitu_lattice out = block->lattice;
    bool has_levels = false;
    *is_level = true;
    for (int axis = 0; axis < 3 && common; axis++) {
        if (!block->lattice.cells[axis]) continue;
        *is_level = move_axis_to_common_origin(block, common, axis, &out) && *is_level;
        *is_level =
            compute_axis_refinement(common->coarsest[axis], block->lattice.spacing[axis], &out.refinement[axis]) &&
            *is_level;
        has_levels = has_levels || !is_same_spacing(common->coarsest[axis], common->finest[axis]);
    }
    if (!block->has_level || !has_levels || !*is_level) memset(out.refinement, 0, sizeof out.refinement);
    *is_level = *is_level || !block->has_level || !has_levels;
    return out;
}
