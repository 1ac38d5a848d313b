#include "session_outer_cells.h"

#include "memory.h"
#include "session_agree.h"
#include "session_homes.h"
#include "session_outer_faces.h"

/* Returns whether the cells of this part are split into linear pieces. Only such parts are searched for cells with
 * outer faces. */
static bool is_split(const session_mesh *part)
{
    return part->is_given && part->topology.is_split;
}

/* Lists the parts whose cells are split into linear pieces, with new memory for their outer faces. Returns the number
 * of these parts. */
static int list_split_parts(const session_parts *parts, session_face_part *out, base_error *error)
{
    int count = 0;
    for (int i = 0; i < parts->count; i++) {
        session_mesh *part = parts->items[i];
        if (!is_split(part)) continue;
        base_free(part->finer.outer_faces);
        part->finer.outer_faces = base_calloc((size_t)part->given.cell_count + 1, 1);
        if (!part->finer.outer_faces) session_fail_for_memory(error, part->given.cell_count, "outer faces of cells");
        out[count++] = (session_face_part){.mesh = part, .masks = part->finer.outer_faces};
    }
    return count;
}

static insitu_status find_faces_of_split_parts(const session_parts *parts, const session_team *team, base_error *error)
{
    session_homes homes = {.is_computed = false};
    int count = 0;
    session_face_part *of = base_calloc((size_t)parts->count + 1, sizeof *of);
    if (!of) session_fail_for_memory(error, parts->count * (int64_t)sizeof *of, "outer faces of cells");
    if (of) count = list_split_parts(parts, of, error);
    insitu_status status = session_agree(team->comm, error);
    /* the coordinates of a corner have the same bits on all ranks that have it, so that the ranks' boxes need not be
     * extended */
    if (!status)
        status = session_compute_home_ranks(&homes, (const session_mesh *const *)parts->items, parts->count, false, 0,
                                            team, error);
    if (!status) status = session_find_outer_faces(of, count, &homes, team, error);
    session_homes_free(&homes);
    base_free(of);
    return status;
}

void session_forget_outer_cells(const session_meshes *meshes)
{
    for (int i = 0; i < meshes->count; i++) {
        base_free(meshes->items[i]->finer.outer_faces);
        meshes->items[i]->finer.outer_faces = NULL;
    }
}

insitu_status session_find_outer_cells(const session_parts *parts, const session_team *team, base_error *error)
{
    int is_any_unknown = false;
    for (int i = 0; i < parts->count; i++)
        is_any_unknown = is_any_unknown || (is_split(parts->items[i]) && !parts->items[i]->finer.outer_faces);
    const insitu_status status = session_check_mpi(
        error, MPI_Allreduce(MPI_IN_PLACE, &is_any_unknown, 1, MPI_INT, MPI_MAX, team->comm), "MPI_Allreduce");
    return status || !is_any_unknown ? status : find_faces_of_split_parts(parts, team, error);
}
