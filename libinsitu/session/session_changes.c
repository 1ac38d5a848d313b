/* Finds out by one reduction what has changed on any rank. The reduction is a maximum over a few integers. From the
 * result every rank determines:
 *
 *     - whether all ranks are at the same cycle (maximum and minimum), and the lowest rank with an error
 *     - whether cells, coordinates, levels of refinement or names have changed on any rank
 *     - whether all ranks have the same names of meshes and fields
 *     - whether any rank needs more threads, and the lowest instruction set
 *     - whether any field has a fill function, and the lowest rank that has a warning for all ranks
 *     - from rank 0: the time, whether the scene file was edited, whether pictures could not be written, and whether
 *       pictures are written during the step
 *
 * Afterwards all ranks make the same decisions without further messages. */
#include "session_changes.h"

#include <string.h>

#include "render_isa.h"
#include "session_agree.h"
#include "session_lines.h"

enum change_word {
    CYCLE_HIGH,
    /* complement of the lowest cycle; entries named _LOW are complements or negated numbers, because the reduction is a
     * maximum */
    CYCLE_LOW,
    FAILED, /* number of ranks minus the lowest failing rank; 0: no rank has failed */
    CELLS_CHANGED,
    LEVELS_CHANGED,
    NAMES_CHANGED,
    NAMES_HIGH,
    NAMES_LOW,
    SCENE_CHANGED,
    THREADS_LACKING,
    UNWRITTEN,
    FILLED,
    WRITES_AT_ONCE,
    ISA_LOW, /* lowest instruction set and the lowest rank that has it, packed into one word and negated */
    ISA_HIGH,
    REPORTING_RANK, /* lowest rank with warnings for all ranks (session_encode_rank_with_warnings()) */
    ROOT_TIME,      /* bit pattern of the time on rank 0 */
    CHANGE_WORDS
};

/* Larger than any rank number. A rank r and a number n are packed into one word as n * rank_limit + r. */
static const int64_t rank_limit = (int64_t)1 << 32;

static int64_t reinterpret_double_as_integer(double value)
{
    int64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static double reinterpret_integer_as_double(int64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static bool has_field_with_fill_function(const session_meshes *meshes)
{
    for (int m = 0; m < meshes->count; m++)
        for (int f = 0; f < meshes->items[m]->field_count; f++)
            if (meshes->items[m]->fields[f].given.fill) return true;
    return false;
}

static void pack_changes(const insitu_session *session, int64_t cycle, double time, int64_t words[CHANGE_WORDS])
{
    const session_team *team = &session->team;
    const session_meshes *meshes = &session->meshes;
    const session_scene_file *file = &session->scene_file;
    const int64_t names = (int64_t)(session_hash_mesh_table(meshes) >> 1);
    words[CYCLE_HIGH] = cycle;
    /* the complement decreases as the cycle increases, like a negative number, but cannot overflow */
    words[CYCLE_LOW] = ~cycle;
    words[FAILED] = session_find_pending_error(meshes) ? team->ranks - team->rank : 0;
    words[CELLS_CHANGED] = meshes->are_cells_changed || !session->space.has_extent;
    words[LEVELS_CHANGED] = meshes->are_levels_changed;
    words[NAMES_CHANGED] = meshes->are_names_changed || !session->catalogue.is_known;
    words[NAMES_HIGH] = names;
    words[NAMES_LOW] = ~names;
    words[SCENE_CHANGED] = session_is_scene_edited(file, team->rank);
    words[THREADS_LACKING] = session_needs_thread_trial(&session->threads, file->scene.threads, team->cores);
    words[UNWRITTEN] = session->writer.failure_count;
    words[FILLED] = has_field_with_fill_function(meshes);
    words[WRITES_AT_ONCE] = team->rank == 0 && !session_writer_writes_after_step(&session->writer, &file->scene);
    words[ISA_LOW] = -(render_isa_level() * rank_limit + team->rank);
    words[ISA_HIGH] = render_isa_level();
    words[REPORTING_RANK] = session_encode_rank_with_warnings(&session->report, team);
    words[ROOT_TIME] = team->rank == 0 ? reinterpret_double_as_integer(time) : INT64_MIN;
}

insitu_status session_reduce_changes_over_ranks(const insitu_session *session, int64_t cycle, double time,
                                                session_changes *out, base_error *error)
{
    int64_t mine[CHANGE_WORDS], all[CHANGE_WORDS];
    pack_changes(session, cycle, time, mine);
    const insitu_status status = session_check_mpi(
        error, MPI_Allreduce(mine, all, CHANGE_WORDS, MPI_INT64_T, MPI_MAX, session->team.comm), "MPI_Allreduce");
    if (status) return status;
    *out = (session_changes){.cycle = all[CYCLE_HIGH],
                             .lowest_cycle = ~all[CYCLE_LOW],
                             .time = reinterpret_integer_as_double(all[ROOT_TIME]),
                             .failed_rank = all[FAILED] ? session->team.ranks - (int)all[FAILED] : -1,
                             .is_scene_changed = all[SCENE_CHANGED],
                             .are_cells_changed = all[CELLS_CHANGED],
                             .are_levels_changed = all[LEVELS_CHANGED],
                             .are_names_changed = all[NAMES_CHANGED],
                             .are_names_shared = all[NAMES_HIGH] == ~all[NAMES_LOW],
                             .needs_more_threads = all[THREADS_LACKING],
                             .has_unwritten_pictures = all[UNWRITTEN],
                             .is_filled = all[FILLED],
                             .writes_behind = !all[WRITES_AT_ONCE] && !all[SCENE_CHANGED],
                             .isa_level = (int)(-all[ISA_LOW] / rank_limit),
                             .isa_rank = (int)(-all[ISA_LOW] % rank_limit),
                             .isa_best = (int)all[ISA_HIGH],
                             .reporting_rank =
                                 session_decode_rank_with_warnings((int)all[REPORTING_RANK], &session->team)};
    return INSITU_OK;
}

static void broadcast_pending_error(int root, const session_meshes *meshes, const session_team *team,
                                    base_error *shared)
{
    const base_error *mine = session_find_pending_error(meshes);
    if (team->rank == root && mine) base_fail(shared, mine->status, "rank %d: %.900s", root, mine->message);
    session_broadcast_error(team->comm, root, shared);
}

insitu_status session_check_errors_and_cycle(const session_changes *changes, const session_meshes *meshes,
                                             const session_team *team, base_error *refused, base_error *error)
{
    if (changes->failed_rank >= 0) broadcast_pending_error(changes->failed_rank, meshes, team, refused);
    if (changes->cycle == changes->lowest_cycle) return INSITU_OK;
    if (refused->status) *error = *refused;
    return base_fail(error, INSITU_ERROR_MPI, "ranks disagree on the cycle: %lld on one, %lld on another",
                     (long long)changes->lowest_cycle, (long long)changes->cycle);
}
