/* The step: one small reduction always, and the phases in their order where a picture is due.
 *
 * The reduction is a maximum over a few integers. It tells every rank whether all are at the same cycle (maximum and
 * minimum), the lowest rank that has an error to tell of, whether cells, coordinates or names changed anywhere, whether
 * all tables of names are alike, whether any wants more threads, the lowest of the instruction sets, and, from rank 0,
 * the time and whether the scene file was edited. After it, ranks decide alike without another word. */
#include <string.h>

#include "cpu.h"
#include "render_isa.h"
#include "session.h"
#include "session_agree.h"
#include "session_draw.h"
#include "session_guard.h"
#include "session_team.h"
#include "session_warnings.h"

enum step_word {
    CYCLE_HIGH,
    CYCLE_LOW, /* negated, as is all that is called low */
    FAILED,    /* ranks - lowest failing rank; 0: none */
    CELLS_CHANGED,
    NAMES_CHANGED,
    NAMES_HIGH,
    NAMES_LOW,
    SCENE_CHANGED,
    TEAM_GROWS,
    ISA_LOW,
    ROOT_TIME, /* the bits of rank 0's */
    STEP_WORDS
};

typedef struct step_message {
    int64_t words[STEP_WORDS];
} step_message;

static int64_t bits_of(double value)
{
    int64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static double double_of(int64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static insitu_status exchange_message(insitu_session *session, int64_t cycle, double time, step_message *out,
                                      base_error *error)
{
    step_message mine = {{0}};
    const int64_t names = (int64_t)(session_table_hash(session) >> 1);
    mine.words[CYCLE_HIGH] = cycle;
    mine.words[CYCLE_LOW] = ~cycle; /* as a negation, without overflow */
    mine.words[FAILED] = session_pending_error(session) ? session->ranks - session->rank : 0;
    mine.words[CELLS_CHANGED] = session->is_changed || !session->has_extent;
    mine.words[NAMES_CHANGED] = session->is_table_changed || !session->has_catalogue;
    mine.words[NAMES_HIGH] = names;
    mine.words[NAMES_LOW] = ~names;
    mine.words[SCENE_CHANGED] = session_scene_file_changed(session);
    mine.words[TEAM_GROWS] = session_team_grows(session);
    mine.words[ISA_LOW] = -render_isa_level();
    mine.words[ROOT_TIME] = session->rank == 0 ? bits_of(time) : INT64_MIN;
    return session_mpi(error, MPI_Allreduce(mine.words, out->words, STEP_WORDS, MPI_INT64_T, MPI_MAX, session->comm),
                       "MPI_Allreduce");
}

static insitu_status tell_pending_error(insitu_session *session, int root, base_error *error)
{
    base_error told = {0};
    const base_error *mine = session_pending_error(session);
    if (session->rank == root && mine) base_fail(&told, mine->status, "rank %d: %.900s", root, mine->message);
    session->pending = (base_error){0};
    const insitu_status status = session_share_error(session->comm, root, &told);
    *error = told;
    return status;
}

static bool is_due(const scene_image *image, int64_t cycle)
{
    return image->every <= 1 || cycle % image->every == 0;
}

static int due_count(const scene *scene, int64_t cycle)
{
    int count = 0;
    for (int i = 0; i < scene->image_count; i++) count += is_due(&scene->images[i], cycle);
    return count;
}

static insitu_status draw_due(insitu_session *session, const step_message *message, base_error *error)
{
    const double start = MPI_Wtime();
    const int64_t cycle = message->words[CYCLE_HIGH];
    const bool are_names_alike = message->words[NAMES_HIGH] == ~message->words[NAMES_LOW];
    insitu_status status = INSITU_OK;
    if (message->words[CELLS_CHANGED]) status = session_update_extent(session, error);
    if (!status && message->words[NAMES_CHANGED]) status = session_update_catalogue(session, are_names_alike, error);
    if (!status && (message->words[CELLS_CHANGED] || message->words[NAMES_CHANGED]))
        status = session_warn_of_cells(session, error);
    session->report.prepare_ms = 1e3 * (MPI_Wtime() - start);
    if (status) return status;
    const scene_image *due[due_count(&session->scene, cycle)];
    int count = 0;
    for (int i = 0; i < session->scene.image_count; i++)
        if (is_due(&session->scene.images[i], cycle)) due[count++] = &session->scene.images[i];
    return session_draw_images(session, due, count, cycle, error);
}

/* The kernels that every rank has: two sets differ in roundings, and at a face between their cells volumes would
 * overlap. */
static void take_common_kernels(insitu_session *session, int level)
{
    render_isa_limit(level);
    if (level < render_isa_level())
        session_text_add(&session->warnings, "kernels are %s, the best that all ranks have, where %s ones would do",
                         cpu_isa_name((cpu_isa)level), cpu_isa_name((cpu_isa)render_isa_level()));
}

static insitu_status draw_by_team(insitu_session *session, const step_message *message, const session_guard *guard,
                                  base_error *error)
{
    const bool is_new = message->words[TEAM_GROWS] || message->words[SCENE_CHANGED];
    insitu_status status = is_new ? session_team_probe(session, error) : INSITU_OK;
    if (status) return status;
    take_common_kernels(session, (int)-message->words[ISA_LOW]);
    session->threads = session_team_threads(session);
    session_guard_begin_team(guard, session->threads);
    if (is_new) status = session_team_check(session, error);
    if (!status) status = draw_due(session, message, error);
    session_guard_end_team(session->threads);
    return status;
}

static insitu_status step(insitu_session *session, int64_t cycle, double time, const session_guard *guard,
                          base_error *error)
{
    step_message message;
    const insitu_status status = exchange_message(session, cycle, time, &message, error);
    if (status) return status;
    const int64_t high = message.words[CYCLE_HIGH], low = ~message.words[CYCLE_LOW];
    session->report.time = double_of(message.words[ROOT_TIME]);
    if (message.words[SCENE_CHANGED]) session_reload_scene(session);
    if (message.words[FAILED]) return tell_pending_error(session, session->ranks - (int)message.words[FAILED], error);
    if (high != low)
        return base_fail(error, INSITU_ERROR_MPI, "ranks disagree on the cycle: %lld on one, %lld on another",
                         (long long)low, (long long)high);
    return due_count(&session->scene, high) ? draw_by_team(session, &message, guard, error) : INSITU_OK;
}

insitu_status insitu_step(insitu_session *session, int64_t cycle, double time)
{
    if (!session) return INSITU_ERROR_ARGUMENT;
    session_guard guard;
    session_guard_begin(&guard);
    const double start = MPI_Wtime();
    session->error = (base_error){0};
    session_begin_report(session, cycle, time);
    const insitu_status status = step(session, cycle, time, &guard, &session->error);
    session_end_report(session);
    session->report.total_ms = 1e3 * (MPI_Wtime() - start);
    session_guard_end(&guard);
    return status;
}
