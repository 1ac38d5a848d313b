/* The bounds, the origin and the scale are computed from results of MPI reductions, so that they are the same on every
 * rank and for every partition. A new origin or scale requires new trees. Therefore the old origin and scale are kept
 * while the bounds change little, even if the mesh moves slightly in every step. */
#include "session_space.h"

#include "session_agree.h"

/* Rounds the mean size of cells to 13 bits, with a relative error of at most 1.6e-4. The sampling distance is derived
 * from the mean size. The sum of sizes over all cells has an error of about 1e-12, which depends on the order of cells,
 * of their vertices and of ranks; rounding hides it, unless the mean lies at a threshold of rounding. Remainders of at
 * least 0.382 (2 minus the golden ratio) are rounded up: this threshold is far from all fractions of small integers,
 * and the means of regular and refined lattices are such fractions. The usual threshold, one half, is such a fraction
 * too. */
static double round_cell_size(double size)
{
    enum { BITS = 13 };
    int exponent;
    const double mantissa = frexp(size, &exponent);
    return ldexp(floor(ldexp(mantissa, BITS) + 0.61803398874989485), exponent - BITS);
}

static double half_diagonal(const double lower[3], const double upper[3])
{
    double half[3];
    for (int axis = 0; axis < 3; axis++) half[axis] = 0.5 * upper[axis] - 0.5 * lower[axis];
    return hypot(hypot(half[0], half[1]), half[2]);
}

/* Computes the global bounds, counts and mean cell size. Bounds are computed from the caller's nodes, because bounds of
 * finer lattices would depend on which cells images show. If by_nodes is set, cells are also counted and measured as if
 * meshes had no finer lattices. */
static insitu_status reduce_extent(const session_meshes *meshes, bool by_nodes, MPI_Comm comm, session_extent *out,
                                   base_error *error)
{
    double mine[6], all[6];
    int64_t counts[3] = {0, 0, 0}, totals[3] = {0, 0, 0};
    double sizes = 0, all_sizes = 0;
    for (int i = 0; i < 6; i++) mine[i] = INFINITY;
    for (int i = 0; i < meshes->count; i++) {
        const session_mesh *mesh = meshes->items[i];
        const session_sizes own = session_get_bounds_and_counts(mesh),
                            *nodal = mesh->finer.parts ? &mesh->finer.sizes : &own;
        const session_sizes of = by_nodes ? *nodal : own;
        if (of.drawn_count == 0) continue;
        for (int axis = 0; axis < 3; axis++) {
            mine[axis] = fmin(mine[axis], nodal->lower[axis]);
            mine[3 + axis] = fmin(mine[3 + axis], -nodal->upper[axis]);
        }
        counts[0] += of.drawn_count;
        counts[2] += of.drawn_count - of.flat_count;
        sizes += of.size_sum;
    }
    counts[1] = counts[0] > 0;
    insitu_status status =
        session_check_mpi(error, MPI_Allreduce(mine, all, 6, MPI_DOUBLE, MPI_MIN, comm), "MPI_Allreduce");
    if (!status)
        status =
            session_check_mpi(error, MPI_Allreduce(counts, totals, 3, MPI_INT64_T, MPI_SUM, comm), "MPI_Allreduce");
    if (!status)
        status =
            session_check_mpi(error, MPI_Allreduce(&sizes, &all_sizes, 1, MPI_DOUBLE, MPI_SUM, comm), "MPI_Allreduce");
    if (status) return status;
    *out = (session_extent){.cell_count = totals[0], .solid_count = totals[2], .rank_count = (int)totals[1]};
    /* The mean is computed over cells with a volume, because samples are not taken in flat cells. */
    if (totals[2] > 0) out->cell_size = round_cell_size(all_sizes / (double)totals[2]);
    for (int axis = 0; axis < 3 && totals[0] > 0; axis++) {
        out->lower[axis] = all[axis];
        out->upper[axis] = -all[3 + axis];
    }
    out->half_diagonal = half_diagonal(out->lower, out->upper);
    return INSITU_OK;
}

int session_flat_axis(const session_extent *extent)
{
    int flat = -1;
    double widest = 0;
    for (int axis = 0; axis < 3; axis++) widest = fmax(widest, extent->upper[axis] - extent->lower[axis]);
    for (int axis = 0; axis < 3 && widest > 0 && extent->solid_count == 0; axis++)
        if (extent->upper[axis] - extent->lower[axis] <= 1e-6 * widest) flat = axis;
    return flat;
}

/* Returns whether the old origin and scale can be kept: the centre of the new bounds is inside the old bounds, and the
 * new bounds' size is at most 4 times and at least 1/8 of the old one. */
static bool is_space_valid(const session_space *space)
{
    if (!space->has_origin) return false;
    const double old_half = half_diagonal(space->lower, space->upper);
    const session_extent *e = &space->extent;
    if (e->half_diagonal > 4 * old_half || e->half_diagonal < old_half / 8) return false;
    for (int axis = 0; axis < 3; axis++) {
        const double centre = 0.5 * e->lower[axis] + 0.5 * e->upper[axis];
        if (centre < space->lower[axis] || centre > space->upper[axis]) return false;
    }
    return true;
}

static void choose_origin(session_space *space)
{
    const session_extent *e = &space->extent;
    for (int axis = 0; axis < 3; axis++) {
        space->origin[axis] = 0.5 * e->lower[axis] + 0.5 * e->upper[axis];
        space->lower[axis] = e->lower[axis];
        space->upper[axis] = e->upper[axis];
    }
    int exponent = 0; /* half_diagonal = m 2^exponent, with m in [0.5, 1) */
    if (e->half_diagonal > 0 && frexp(e->half_diagonal, &exponent) == 0.5) exponent--;
    space->scale = ldexp(1.0, exponent < -1000 ? 1000 : -exponent);
    space->has_origin = true;
}

insitu_status session_update_space(session_space *space, session_meshes *meshes, MPI_Comm comm, base_error *error)
{
    session_extent extent;
    const insitu_status status = reduce_extent(meshes, false, comm, &extent, error);
    if (status) return status;
    space->extent = extent;
    space->has_extent = true;
    if (!is_space_valid(space)) {
        choose_origin(space);
        for (session_part_walk walk = {.meshes = meshes}; session_next_part(&walk);) session_drop_tree(walk.part);
    }
    meshes->are_cells_changed = false;
    return INSITU_OK;
}

insitu_status session_find_nodal_extent(const session_meshes *meshes, MPI_Comm comm, session_extent *out,
                                        base_error *error)
{
    return reduce_extent(meshes, true, comm, out, error);
}
