#include "session_homes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "session_mesh.h"
#include "session_team.h"

enum { MOST_SAMPLES = 1024 };

/* The data that each rank sends to all other ranks so that they can find homes. */
typedef struct rank_part {
    session_box box;
    int64_t first_id; /* first global id of the range of ids whose home is the rank that sends this struct */
    /* nonzero if first_id is set, because the rank has vertices with global ids; 0 otherwise */
    int64_t has_ids;
} rank_part;

void session_homes_free(session_homes *homes)
{
    base_free(homes->near_ranks);
    base_free(homes->boxes);
    base_free(homes->first_ids);
    base_free(homes->owners);
    *homes = (session_homes){0};
}

static int compare_ids(const void *a, const void *b)
{
    const int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

/* Returns this rank's proposal for the first id of a range of ids: with P ranks, rank r returns the (r + 1/2) / P
 * quantile of its own ids, estimated from an evenly spaced sample of them. The estimate need not be exact, because all
 * ranks use the same result. */
static int64_t sample_quantile(const session_mesh *mesh, const session_team *team)
{
    const grid_array ids = session_grid_array(&mesh->given.vertex_ids);
    const int64_t vertices = mesh->given.vertex_count, count = vertices < MOST_SAMPLES ? vertices : MOST_SAMPLES;
    int64_t samples[MOST_SAMPLES];
    for (int64_t i = 0; i < count; i++) samples[i] = grid_read_index(&ids, i * vertices / count);
    qsort(samples, (size_t)count, sizeof *samples, compare_ids);
    return samples[(int64_t)((team->rank + 0.5) / team->ranks * (double)count)];
}

static void extend_box_and_ids_by_part(rank_part *part, const session_mesh *mesh, bool by_id, double margin,
                                       const session_team *team)
{
    if (!mesh || !mesh->is_given || !mesh->drawn_count) return;
    for (int axis = 0; axis < 3; axis++) {
        part->box.lower[axis] = fmin(part->box.lower[axis], mesh->lower[axis] - margin);
        part->box.upper[axis] = fmax(part->box.upper[axis], mesh->upper[axis] + margin);
    }
    part->has_ids = by_id && mesh->given.vertex_count > 0;
    if (part->has_ids) part->first_id = sample_quantile(mesh, team);
}

static bool do_boxes_intersect(const session_box *a, const session_box *b)
{
    for (int axis = 0; axis < 3; axis++)
        if (!(a->lower[axis] <= b->upper[axis] && b->lower[axis] <= a->upper[axis])) return false;
    return true;
}

bool session_is_in_box(const session_box *box, const double point[3])
{
    for (int axis = 0; axis < 3; axis++)
        if (!(box->lower[axis] <= point[axis] && point[axis] <= box->upper[axis])) return false;
    return true;
}

static bool store_near_ranks(session_homes *homes, const rank_part *parts, int ranks)
{
    const session_box *own = &parts[homes->rank].box;
    for (int rank = 0; rank < ranks; rank++) homes->near_count += do_boxes_intersect(&parts[rank].box, own);
    homes->near_ranks = base_alloc((size_t)(homes->near_count + 1) * sizeof *homes->near_ranks);
    homes->boxes = base_alloc((size_t)(homes->near_count + 1) * sizeof *homes->boxes);
    if (!homes->near_ranks || !homes->boxes) return false;
    for (int rank = 0, at = 0; rank < ranks; rank++) {
        if (!do_boxes_intersect(&parts[rank].box, own)) continue;
        homes->near_ranks[at] = rank;
        homes->boxes[at++] = parts[rank].box;
    }
    return true;
}

typedef struct id_share {
    int64_t first_id;
    int owner;
} id_share;

static int compare_shares(const void *a, const void *b)
{
    const id_share *x = a, *y = b;
    if (x->first_id != y->first_id) return x->first_id < y->first_id ? -1 : 1;
    return (x->owner > y->owner) - (x->owner < y->owner);
}

static bool assign_id_ranges(session_homes *homes, const rank_part *parts, int ranks)
{
    id_share *shares = base_alloc((size_t)ranks * sizeof *shares);
    homes->first_ids = base_alloc((size_t)ranks * sizeof *homes->first_ids);
    homes->owners = base_alloc((size_t)ranks * sizeof *homes->owners);
    const bool has_memory = shares && homes->first_ids && homes->owners;
    for (int rank = 0; rank < ranks && has_memory; rank++)
        if (parts[rank].has_ids) shares[homes->share_count++] = (id_share){parts[rank].first_id, rank};
    if (has_memory) qsort(shares, (size_t)homes->share_count, sizeof *shares, compare_shares);
    for (int i = 0; i < homes->share_count; i++) {
        homes->first_ids[i] = shares[i].first_id;
        homes->owners[i] = shares[i].owner;
    }
    base_free(shares);
    return has_memory;
}

insitu_status session_compute_home_ranks(session_homes *homes, const session_mesh *const *meshes, int count, bool by_id,
                                         double half_diagonal, const session_team *team, base_error *error)
{
    session_homes found = {.is_computed = true, .by_id = by_id, .rank = team->rank};
    rank_part own = {{{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}}, 0, 0};
    for (int i = 0; i < count; i++) extend_box_and_ids_by_part(&own, meshes[i], by_id, 2e-5 * half_diagonal, team);
    rank_part *parts = base_alloc((size_t)team->ranks * sizeof *parts);
    if (!parts) session_fail_for_memory(error, team->ranks * (int64_t)sizeof *parts, "boxes of ranks");
    insitu_status status = session_agree(team->comm, error);
    if (!status)
        status = session_check_mpi(
            error, MPI_Allgather(&own, sizeof own, MPI_BYTE, parts, sizeof own, MPI_BYTE, team->comm), "MPI_Allgather");
    if (!status &&
        (!store_near_ranks(&found, parts, team->ranks) || (by_id && !assign_id_ranges(&found, parts, team->ranks))))
        session_fail_for_memory(error, team->ranks * (int64_t)sizeof *parts, "boxes of ranks");
    base_free(parts);
    if (!status) status = session_agree(team->comm, error);
    if (status) {
        session_homes_free(&found);
        return status;
    }
    session_homes_free(homes);
    *homes = found;
    return INSITU_OK;
}

bool session_is_in_other_box(const session_homes *homes, const double point[3])
{
    for (int i = 0; i < homes->near_count; i++)
        if (homes->near_ranks[i] != homes->rank && session_is_in_box(&homes->boxes[i], point)) return true;
    return false;
}

static int find_home_of_id(const session_homes *homes, int64_t id)
{
    int low = 0, high = homes->share_count;
    while (high - low > 1) {
        const int middle = low + (high - low) / 2;
        if (homes->first_ids[middle] <= id)
            low = middle;
        else
            high = middle;
    }
    return homes->owners[low];
}

static bool are_in_box(const session_box *box, const double (*points)[3], int count)
{
    for (int i = 0; i < count; i++)
        if (!session_is_in_box(box, points[i])) return false;
    return true;
}

int session_find_home_rank(const session_homes *homes, const double (*points)[3], int count, uint64_t hash, int64_t id)
{
    int among = 0;
    if (homes->by_id) return find_home_of_id(homes, id);
    for (int i = 0; i < homes->near_count; i++) among += are_in_box(&homes->boxes[i], points, count);
    int left = among ? (int)(hash % (uint64_t)among) : 0;
    for (int i = 0; i < homes->near_count; i++)
        if (are_in_box(&homes->boxes[i], points, count) && left-- == 0) return homes->near_ranks[i];
    return homes->rank;
}
