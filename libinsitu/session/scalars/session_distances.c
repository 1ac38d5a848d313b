#include "session_distances.h"

#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_region.h"
#include "session_scalars.h"

/* ---- planes of slices ---------------------------------------------------------------------------------------- */

static void offset_point(const double from[3], const double normal[3], double offset, double out[3])
{
    for (int axis = 0; axis < 3; axis++) out[axis] = from[axis] + offset * normal[axis];
}

void session_find_plane_point(const scene_plane *plane, const session_extent *extent, double point[3])
{
    double middle[3], half = 0; /* `middle` is the centre of the bounds, and `half` is half of the extent of the
                                   bounds along the normal */
    for (int axis = 0; axis < 3; axis++) {
        middle[axis] = 0.5 * extent->lower[axis] + 0.5 * extent->upper[axis];
        half += fabs(plane->normal[axis]) * (0.5 * extent->upper[axis] - 0.5 * extent->lower[axis]);
    }
    offset_point(plane->has_point ? plane->point : middle, plane->normal, plane->offset + plane->extent_fraction * half,
                 point);
}

static session_plane convert_plane(const scene_plane *in)
{
    session_plane out = {.is_central = !in->has_point, .offset = in->offset, .extent_fraction = in->extent_fraction};
    memcpy(out.normal, in->normal, sizeof out.normal);
    offset_point(in->point, in->normal, in->offset, out.point);
    return out;
}

static bool are_equal_vectors(const double a[3], const double b[3])
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

static bool is_same_plane(const session_plane *a, const session_plane *b)
{
    if (a->is_central != b->is_central || !are_equal_vectors(a->normal, b->normal)) return false;
    return a->is_central ? a->offset == b->offset && a->extent_fraction == b->extent_fraction
                         : are_equal_vectors(a->point, b->point);
}

session_scalar *session_find_distance_scalar(const session_mesh *mesh, const scene_plane *plane)
{
    const session_plane given = convert_plane(plane);
    for (int i = 0; i < mesh->scalar_count; i++) {
        session_scalar *scalar = &mesh->scalars[i];
        if (session_is_distance(scalar) && is_same_plane(&scalar->plane, &given)) return scalar;
    }
    return NULL;
}

static session_scalar *add_distance(session_mesh *mesh, const scene_plane *plane)
{
    session_scalar *scalar = session_add_scalar(mesh);
    if (!scalar) return NULL;
    scalar->field = -1;
    scalar->plane = convert_plane(plane);
    scalar->may_have_changed = false;
    return scalar;
}

/* Updates the point of a plane that is defined relative to the centre of the data, if the data's bounds have
 * changed. */
static void recentre_plane(session_scalar *scalar, const scene_plane *plane, const session_extent *extent)
{
    double point[3];
    session_find_plane_point(plane, extent, point);
    if (are_equal_vectors(point, scalar->plane.point)) return;
    memcpy(scalar->plane.point, point, sizeof point);
    scalar->are_values_stale = true;
}

bool session_mark_distance(session_mesh *mesh, const scene_plane *plane, const session_extent *extent,
                           session_scalar **marked)
{
    session_scalar *scalar = session_find_distance_scalar(mesh, plane);
    if (!scalar) scalar = add_distance(mesh, plane);
    *marked = scalar;
    if (!scalar) return false;
    recentre_plane(scalar, plane, extent);
    scalar->is_used = scalar->needs_ranges = true;
    mesh->is_needed = true;
    return true;
}

/* ---- distances of vertices from planes ----------------------------------------------------------------------- */

static void compute_distances(const session_mesh *mesh, const session_plane *plane, int threads, float *out)
{
    const double *n = plane->normal, *p = plane->point;
#pragma omp parallel num_threads(session_choose_loop_threads(threads, mesh->cells.vertex_count))
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t v = 0; v < mesh->cells.vertex_count; v++) {
            double at[3];
            grid_read_vertex_position(&mesh->cells, v, at);
            out[v] = (float)(n[0] * (at[0] - p[0]) + n[1] * (at[1] - p[1]) + n[2] * (at[2] - p[2]));
        }
        region_leave();
    }
}

static bool update_distance(const session_mesh *mesh, session_scalar *scalar, int threads)
{
    if (!scalar->distances)
        scalar->distances = base_alloc((size_t)mesh->cells.vertex_count * sizeof *scalar->distances);
    if (!scalar->distances) return false;
    compute_distances(mesh, &scalar->plane, threads, scalar->distances);
    scalar->are_values_stale = false;
    scalar->are_ranges_stale = true;
    session_clear_extents(scalar);
    return true;
}

void session_update_distances(const session_meshes *meshes, const session_team *team, base_error *error)
{
    for (int i = 0; i < meshes->count && !error->status; i++) {
        const session_mesh *mesh = meshes->items[i];
        for (int k = 0; k < mesh->scalar_count && mesh->is_given && !error->status; k++) {
            session_scalar *scalar = &mesh->scalars[k];
            if (!session_is_distance(scalar) || !scalar->is_used || !scalar->are_values_stale) continue;
            if (!update_distance(mesh, scalar, team->threads))
                session_fail_for_memory(error, mesh->cells.vertex_count * (int64_t)sizeof(float),
                                        "distances from a plane");
        }
    }
}

/* Returns the distance at which the isosurface is drawn that represents the slice, usually 0. A cell contributes to an
 * isosurface only if one of its values is below the isovalue, so that the isosurface of the smallest distance is empty.
 * If the smallest distance is between 0 and the tolerance, the isovalue is therefore this distance plus a tenth of the
 * tolerance. This shift is large enough for float32, but not visible. */
double session_choose_slice_isovalue(double low, double high, double half_diagonal)
{
    const double tolerance = SESSION_BORDER_SHARE * half_diagonal;
    if (!(low < high)) return 0;
    if (low >= 0 && low <= tolerance) return low + 0.1 * tolerance;
    return high < 0 && high >= -tolerance ? high : 0;
}
