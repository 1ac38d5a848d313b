#include "session_neighbours.h"

#include <string.h>

#include "session_agree.h"
#include "session_topology.h"
#include "session_torn.h"

static session_key key_of_id(const session_mesh *mesh, int64_t vertex)
{
    const grid_array ids = session_grid_array(&mesh->given.vertex_ids);
    return (session_key){{(uint64_t)grid_array_index(&ids, vertex), 0, 0}};
}

static session_key key_of_position(const grid_array coordinates[3], int64_t vertex)
{
    session_key key;
    for (int axis = 0; axis < 3; axis++) {
        const double unsigned_zero = grid_array_number(&coordinates[axis], vertex) + 0.0;
        memcpy(&key.words[axis], &unsigned_zero, sizeof unsigned_zero);
    }
    return key;
}

session_key session_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id)
{
    if (by_id) return key_of_id(mesh, mesh->torn.is_made ? session_torn_origin(&mesh->torn, vertex) : vertex);
    return key_of_position(mesh->cells.coordinates, vertex);
}

session_key session_given_vertex_key(const session_mesh *mesh, int64_t vertex, bool by_id)
{
    if (by_id) return key_of_id(mesh, vertex);
    grid_array coordinates[3];
    for (int axis = 0; axis < 3; axis++) coordinates[axis] = session_grid_array(&mesh->given.coordinates[axis]);
    return key_of_position(coordinates, vertex);
}

static bool do_boxes_meet(const session_box *a, const session_box *b)
{
    for (int axis = 0; axis < 3; axis++)
        if (!(a->lower[axis] <= b->upper[axis] && b->lower[axis] <= a->upper[axis])) return false;
    return true;
}

insitu_status session_gather_boxes(const session_team *team, const session_mesh *mesh, double margin,
                                   session_box *boxes, int *count, base_error *error)
{
    session_box mine = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
    for (int axis = 0; axis < 3 && mesh && mesh->drawn_count; axis++) {
        mine.lower[axis] = mesh->lower[axis] - margin;
        mine.upper[axis] = mesh->upper[axis] + margin;
    }
    const insitu_status status =
        session_mpi(error, MPI_Allgather(&mine, 6, MPI_DOUBLE, boxes, 6, MPI_DOUBLE, team->comm), "MPI_Allgather");
    *count = 0;
    for (int rank = 0; rank < team->ranks && !status; rank++)
        if (rank != team->rank && do_boxes_meet(&boxes[rank], &mine)) boxes[(*count)++] = boxes[rank];
    return status;
}

bool session_is_in_boxes(const session_mesh *mesh, int64_t vertex, const session_box *boxes, int count)
{
    session_box point;
    grid_vertex(&mesh->cells, vertex, point.lower);
    memcpy(point.upper, point.lower, sizeof point.upper);
    for (int i = 0; i < count; i++)
        if (do_boxes_meet(&boxes[i], &point)) return true;
    return false;
}
