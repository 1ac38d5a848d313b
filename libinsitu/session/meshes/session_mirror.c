/* Whenever its source mesh has changed, a mirror image is set again in the same way as a mesh that the caller sets. It
 * reads the source's arrays, which belong to the caller or are copies owned by the source; only its mirrored
 * coordinates are stored with the image. */
#include "session_mirror.h"

#include <float.h>
#include <math.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_conform.h"
#include "session_lattice.h"
#include "session_mesh_input.h"
#include "session_own_coordinates.h"
#include "session_region.h"

static bool is_mirrored(const session_mesh *image, int axis)
{
    return image->mirror_axes >> axis & 1;
}

/* The mirror plane, and the coordinates of vertices in it, are often decimal numbers or computed from them, each of
 * which is rounded in another way. For example, 0.3 as a float32 number differs from 0.3, and so does 3 * 0.1. A
 * coordinate that differs from the plane by rounding only is its own image, to the bit. Otherwise the vertex and its
 * image would be two vertices, with a wall between them. */

/* Returns the largest difference due to rounding between two results of a few operations on numbers of this type, none
 * of which exceeds `largest`. Each operation, and each decimal number, is rounded by at most half of the type's
 * epsilon. The plane and the coordinate together can have eight of them. */
static double find_rounding(insitu_type type, double largest)
{
    return 4 * (type == INSITU_FLOAT32 ? (double)FLT_EPSILON : DBL_EPSILON) * fabs(largest);
}

static double mirror_coordinate(double coordinate, double plane, double rounding)
{
    return fabs(coordinate - plane) <= rounding ? coordinate : 2 * plane - coordinate;
}

/* ---- coordinates by vertex --------------------------------------------------------------------------------------- */

/* Returns a bit mask of the axes along which the mirror image stores its own coordinates: bit i stands for axis i.
 * These are the mirrored axes, or all axes if the source's coordinates are interleaved or strided. */
static int find_axes_with_own_coordinates(const session_mesh *image)
{
    enum { IN_PLANE = 3, ALL = 7 };
    const insitu_mesh *given = session_get_mesh_of_caller_nodes(image->source);
    bool are_packed = true;
    for (int axis = 0; axis < 3; axis++) {
        const insitu_array *array = &given->coordinates[axis];
        are_packed = are_packed &&
                     (!array->data || !array->stride_bytes || array->stride_bytes == session_type_size(array->type));
    }
    return are_packed ? image->mirror_axes : image->mirror_axes | (given->coordinates[2].data ? ALL : IN_PLANE);
}

/* Copies coordinates along an axis without changing their type, and mirrors them if the axis is mirrored. */
static void mirror_coordinates_along_axis(const session_mesh *image, int axis, int threads)
{
    const grid_array from = session_coordinates(session_get_mesh_of_caller_nodes(image->source), axis);
    const double plane = image->mirrored.planes[axis];
    const insitu_array *to = &image->mirrored.coordinates[axis];
    const int64_t count = session_get_mesh_of_caller_nodes(image->source)->vertex_count;
    const bool is_copied = !is_mirrored(image, axis);
    const double rounding = find_rounding(to->type, plane);
#pragma omp parallel num_threads(session_choose_loop_threads(threads, count))
    {
        region_enter();
#pragma omp for schedule(static) nowait
        for (int64_t v = 0; v < count; v++) {
            const double coordinate = grid_read_number(&from, v);
            session_store_coordinate(to, v, is_copied ? coordinate : mirror_coordinate(coordinate, plane, rounding));
        }
        region_leave();
    }
}

/* Mirrors the coordinates of the source's vertices. Returns false if memory runs out. */
static bool mirror_vertices(session_mesh *image, int threads)
{
    const insitu_mesh *given = session_get_mesh_of_caller_nodes(image->source);
    session_mirrored *m = &image->mirrored;
    const int axes = find_axes_with_own_coordinates(image);
    insitu_type types[3];
    bool is_new = false;
    for (int axis = 0; axis < 3; axis++)
        types[axis] = given->coordinates[given->coordinates[axis].data ? axis : 0].type;
    if (!session_reserve_coordinates(&m->coordinate_memory, m->coordinates, given->vertex_count, axes, types, &m->bytes,
                                     &is_new))
        return false;
    for (int axis = 0; axis < 3; axis++)
        if (axes >> axis & 1) mirror_coordinates_along_axis(image, axis, threads);
    return true;
}

/* ---- coordinates along a lattice's axes -------------------------------------------------------------------------- */

/* Mirrors coordinates along an axis of a lattice. A uniform lattice computes them from numbers that may be much larger
 * than the result, for example as -10 + 103 * 0.1. */
static void mirror_axis_coordinates(const insitu_lattice *given, int axis, double plane, double *coordinates)
{
    const insitu_array *along = &given->axes[axis];
    for (int64_t n = 0; n <= given->cells[axis]; n++) {
        const double steps = (double)(given->first[axis] + n),
                     largest = along->data ? plane : fabs(given->origin[axis]) + fabs(given->spacing[axis] * steps);
        const insitu_type type = along->data ? along->type : INSITU_FLOAT64;
        coordinates[n] = mirror_coordinate(coordinates[n], plane, find_rounding(type, largest));
    }
}

static bool mirror_lattice(session_mesh *image)
{
    const insitu_lattice *given = image->source->given.lattice;
    session_mirrored *m = &image->mirrored;
    for (int axis = 0; axis < 3; axis++) {
        const int64_t count = given->cells[axis] + 1;
        if (!m->axes[axis]) m->axes[axis] = base_alloc((size_t)count * sizeof *m->axes[axis]);
        double *coordinates = m->axes[axis];
        if (!coordinates) return false;
        session_fill_axis_coordinates(given, axis, coordinates);
        if (is_mirrored(image, axis)) mirror_axis_coordinates(given, axis, m->planes[axis], coordinates);
        m->bytes += count * (int64_t)sizeof *coordinates;
    }
    return true;
}

/* ---- the mirror image -------------------------------------------------------------------------------------------- */

/* Describes the image's lattice. The description has no levels of refinement, because the image shares the source's
 * flags of covered cells. */
static void describe_lattice(session_mesh *image, insitu_mesh *out)
{
    session_mirrored *m = &image->mirrored;
    m->lattice = *image->source->given.lattice;
    for (int axis = 0; axis < 3; axis++) {
        m->lattice.origin[axis] = m->lattice.spacing[axis] = 0;
        m->lattice.first[axis] = m->lattice.refinement[axis] = 0;
        m->lattice.axes[axis] = (insitu_array){m->axes[axis], INSITU_FLOAT64, 0};
    }
    out->lattice = &m->lattice;
}

static insitu_mesh describe_image(session_mesh *image, unsigned changed)
{
    const session_mesh *source = image->source;
    insitu_mesh out = *session_get_mesh_of_caller_nodes(source);
    out.changed = changed;
    for (int axis = 0; axis < 3; axis++)
        if (image->mirrored.coordinates[axis].data) out.coordinates[axis] = image->mirrored.coordinates[axis];
    if (out.lattice) describe_lattice(image, &out);
    if (source->covered) out.ghosts = (insitu_array){source->covered, INSITU_UINT8, 0};
    return out;
}

/* Returns the INSITU_CHANGED_* bits of the changes of the source mesh since the mirror image was made. */
static unsigned find_changes(const session_mesh *image, const double planes[3])
{
    const session_mirrored *m = &image->mirrored;
    if (!image->is_given || m->cells_stamp != image->source->cells_stamp) return INSITU_CHANGED_ALL;
    bool is_moved = m->coordinates_stamp != image->source->coordinates_stamp;
    for (int axis = 0; axis < 3; axis++)
        is_moved = is_moved ||
                   (is_mirrored(image, axis) && (m->planes[axis] < planes[axis] || m->planes[axis] > planes[axis]));
    return is_moved ? INSITU_CHANGED_GEOMETRY : INSITU_CHANGED_NOTHING;
}

/* Mirrors the coordinates. Their memory is reused as long as the cells do not change. Returns false if memory runs
 * out. */
static bool mirror_coordinates(session_mesh *image, const double planes[3], unsigned changed, int threads)
{
    const session_mesh *source = image->source;
    const bool has_axes = session_has_axis_coordinates(session_get_mesh_of_caller_nodes(source));
    session_mirrored *m = &image->mirrored;
    if (changed & INSITU_CHANGED_TOPOLOGY || has_axes != (m->axes[0] != NULL)) session_drop_mirrored(m);
    m->bytes = 0;
    m->cells_stamp = source->cells_stamp;
    m->coordinates_stamp = source->coordinates_stamp;
    memcpy(m->planes, planes, sizeof m->planes);
    return has_axes ? mirror_lattice(image) : mirror_vertices(image, threads);
}

session_mesh *session_mirror_mesh(session_meshes *meshes, session_mesh *source, int mirror_axes, const double planes[3],
                                  int threads, base_error *error)
{
    session_mesh *image = session_find_mirror_image(meshes, source, mirror_axes);
    if (!image) image = session_add_mirror_image(meshes, source, mirror_axes, error);
    if (!image) return NULL;
    const unsigned changed = find_changes(image, planes);
    if (changed == INSITU_CHANGED_NOTHING) return image;
    base_error problem = {.status = INSITU_OK};
    if (source->is_check_stale) session_convert_arrays(source, threads);
    if (!mirror_coordinates(image, planes, changed, threads))
        session_fail_for_memory(&problem, session_get_mesh_of_caller_nodes(source)->vertex_count * 24,
                                "coordinates of a mirrored mesh");
    if (!problem.status) {
        const insitu_mesh description = describe_image(image, changed);
        session_store_mesh(meshes, image, &description, &problem);
    }
    if (!problem.status) return image;
    *error = problem;
    session_remove_mirror_image(meshes, image);
    return NULL;
}
