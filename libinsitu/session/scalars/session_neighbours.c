#include "session_neighbours.h"

#include <string.h>

#include "session_discontinuous.h"

static double read_caller_coordinate(const session_mesh *mesh, int axis, int64_t vertex)
{
    const grid_array coordinates =
        mesh->cells.lattice ? mesh->cells.coordinates[axis] : session_coordinates(&mesh->given, axis);
    return grid_read_number(&coordinates, vertex);
}

/* Returns the axes along which a vertex of a mirror image differs in position from its source's vertex, one bit each. A
 * vertex in a mirror plane has the same position in both. */
static uint64_t find_mirrored_axes(const session_mesh *mesh, int64_t vertex)
{
    uint64_t axes = 0;
    for (int axis = 0; axis < 3; axis++) {
        if (!(mesh->mirror_axes >> axis & 1)) continue;
        const double own = read_caller_coordinate(mesh, axis, vertex),
                     other = read_caller_coordinate(mesh->source, axis, vertex);
        axes |= (uint64_t)(own < other || own > other) << axis;
    }
    return axes;
}

static session_key make_key_of_id(const session_mesh *mesh, int64_t vertex)
{
    const grid_array ids = session_grid_array(&mesh->given.vertex_ids);
    return (session_key){{(uint64_t)grid_read_index(&ids, vertex), find_mirrored_axes(mesh, vertex), 0}};
}

static session_key make_key_of_position(const grid_array coordinates[3], int64_t vertex)
{
    session_key key;
    for (int axis = 0; axis < 3; axis++) {
        const double unsigned_zero = grid_read_number(&coordinates[axis], vertex) + 0.0;
        memcpy(&key.words[axis], &unsigned_zero, sizeof unsigned_zero);
    }
    return key;
}

session_key session_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id)
{
    if (by_id)
        return make_key_of_id(mesh, mesh->discontinuous.is_made ? session_vertex_of_corner(mesh, vertex) : vertex);
    return make_key_of_position(mesh->cells.coordinates, vertex);
}

session_key session_caller_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id)
{
    if (by_id) return make_key_of_id(mesh, vertex);
    if (mesh->cells.lattice) return make_key_of_position(mesh->cells.coordinates, vertex);
    grid_array coordinates[3];
    for (int axis = 0; axis < 3; axis++) coordinates[axis] = session_coordinates(&mesh->given, axis);
    return make_key_of_position(coordinates, vertex);
}
