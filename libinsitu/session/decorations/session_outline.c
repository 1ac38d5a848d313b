#include "session_outline.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"

void session_free_outline(session_outline *outline)
{
    base_free(outline->boxes);
    *outline = (session_outline){0};
}

/* Number of values of a box's bounds: x, y, z of the lower corner, then the negated x, y, z of the upper corner. With
 * this sign, a reduction by minimum computes the union of boxes. */

enum { ENDS = 6 };

static void extend_bounds_by_mesh(const session_mesh *mesh, double ends[ENDS])
{
    if (!mesh->is_given || mesh->drawn_count == 0) return;
    for (int axis = 0; axis < 3; axis++) {
        ends[axis] = fmin(ends[axis], mesh->lower[axis]);
        ends[3 + axis] = fmin(ends[3 + axis], -mesh->upper[axis]);
    }
}

/* Adds each of the `count` boxes to the outline, unless it is empty. */
static void append_non_empty_boxes(const double *ends, int count, session_outline *out)
{
    for (int i = 0; i < count; i++, ends += ENDS) {
        if (!(ends[0] <= -ends[3])) continue;
        session_box *box = &out->boxes[out->count++];
        for (int axis = 0; axis < 3; axis++) {
            box->lower[axis] = ends[axis];
            box->upper[axis] = -ends[3 + axis];
        }
    }
}

/* Computes the bounding boxes of this rank's cells: one box for each mesh of the catalogue if by_mesh is set, and
 * otherwise one box for all meshes. */
static void compute_local_outline_bounds(const session_catalogue *catalogue, const session_meshes *meshes, bool by_mesh,
                                         double *ends)
{
    for (int i = 0; i < (by_mesh ? catalogue->mesh_count : 1) * ENDS; i++) ends[i] = INFINITY;
    for (int i = 0; i < catalogue->mesh_count; i++) {
        const session_parts parts = session_find_parts(meshes, catalogue->meshes[i].name);
        for (int n = 0; n < parts.count; n++)
            extend_bounds_by_mesh(parts.items[n], ends + (by_mesh ? i * (ptrdiff_t)ENDS : 0));
    }
}

static insitu_status collect_bounds_on_rank_0(const session_catalogue *catalogue, const session_meshes *meshes,
                                              bool by_mesh, int boxes, const session_team *team, double *all,
                                              base_error *error)
{
    double own[ENDS];
    if (!by_mesh) {
        compute_local_outline_bounds(catalogue, meshes, false, own);
        return session_check_mpi(error, MPI_Gather(own, ENDS, MPI_DOUBLE, all, ENDS, MPI_DOUBLE, 0, team->comm),
                                 "MPI_Gather");
    }
    compute_local_outline_bounds(catalogue, meshes, true, all);
    return session_check_mpi(error, MPI_Allreduce(MPI_IN_PLACE, all, ENDS * boxes, MPI_DOUBLE, MPI_MIN, team->comm),
                             "MPI_Allreduce");
}

/* ---- boxes of all meshes or ranks ------------------------------------------------------------------------------ */

/* Allocates the boxes. Called on rank 0 only. */
static bool allocate_boxes(session_outline *out, int count)
{
    out->boxes = base_alloc((size_t)count * sizeof *out->boxes);
    return out->boxes != NULL;
}

static insitu_status collect_outline_boxes(bool by_mesh, const session_catalogue *catalogue,
                                           const session_meshes *meshes, const session_team *team, session_outline *out,
                                           base_error *error)
{
    const int boxes = by_mesh ? catalogue->mesh_count : team->ranks;
    double *ends = base_alloc((size_t)boxes * ENDS * sizeof *ends);
    if (!ends || (team->rank == 0 && !allocate_boxes(out, boxes)))
        session_fail_for_memory(error, boxes * (int64_t)(ENDS * sizeof *ends), "boxes of an outline");
    insitu_status status = session_agree(team->comm, error);
    if (!status) status = collect_bounds_on_rank_0(catalogue, meshes, by_mesh, boxes, team, ends, error);
    if (!status && team->rank == 0) append_non_empty_boxes(ends, boxes, out);
    base_free(ends);
    if (status) session_free_outline(out);
    return status;
}

insitu_status session_find_outline(const scene_decorations *decorations, const session_catalogue *catalogue,
                                   const session_meshes *meshes, const session_extent *extent, const session_team *team,
                                   session_outline *out, base_error *error)
{
    *out = (session_outline){0};
    if (!decorations->is_given || decorations->outline == SCENE_NO_BOX || extent->cell_count == 0) return INSITU_OK;
    if (decorations->outline != SCENE_BOX_OF_DATA)
        return collect_outline_boxes(decorations->outline == SCENE_BOXES_OF_MESHES, catalogue, meshes, team, out,
                                     error);
    if (team->rank == 0 && !allocate_boxes(out, 1))
        session_fail_for_memory(error, (int64_t)sizeof *out->boxes, "an outline");
    const insitu_status status = session_agree(team->comm, error);
    if (status || team->rank != 0) return status;
    memcpy(out->boxes[0].lower, extent->lower, sizeof extent->lower);
    memcpy(out->boxes[0].upper, extent->upper, sizeof extent->upper);
    out->count = 1;
    return INSITU_OK;
}
