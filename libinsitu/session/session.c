/* Defines the public calls except insitu_step(): they create and destroy a session, and store the caller's input. Each
 * phase of the creation that may fail on only some ranks ends with an agreement of all ranks, so that a session is
 * created on all ranks or on none. */
#include "session.h"

#include "comp.h"
#include "memory.h"
#include "session_agree.h"
#include "session_guard.h"
#include "session_field_input.h"
#include "session_mesh_input.h"

/* The message that insitu_error(NULL) returns after a failed insitu_create(), because there is no session that could
 * hold the message. */
static _Thread_local base_error thread_error;

/* Report that insitu_last_report() returns while a fill function (the caller's function that computes a field's values)
 * is running, since the step's report is incomplete then. */
static const insitu_report no_report = {.schedule = "", .copied_why = "", .left_out = "", .warnings = "", .pieces = ""};

/* Returns whether a public call is refused because the caller makes it inside a fill function. In this case the error
 * is recorded in the session. The cast removes const, because recording the error is the only change of the session. */
static bool refuse_call_in_fill(const insitu_session *session, const char *call)
{
    return session_refuse_call_in_fill(&((insitu_session *)(uintptr_t)session)->meshes, call);
}

const char *insitu_error(const insitu_session *session)
{
    if (!session) return thread_error.message;
    return session->meshes.filling.mesh ? session->meshes.filling.refused_error.message : session->error.message;
}

const insitu_report *insitu_last_report(const insitu_session *session)
{
    if (!session) return NULL;
    return refuse_call_in_fill(session, "insitu_last_report") ? &no_report : &session->report.public_report;
}

const char *insitu_status_name(insitu_status status)
{
    switch (status) {
    case INSITU_OK: return "INSITU_OK";
    case INSITU_ERROR_ARGUMENT: return "INSITU_ERROR_ARGUMENT";
    case INSITU_ERROR_SCENE: return "INSITU_ERROR_SCENE";
    case INSITU_ERROR_MESH: return "INSITU_ERROR_MESH";
    case INSITU_ERROR_FIELD: return "INSITU_ERROR_FIELD";
    case INSITU_ERROR_IO: return "INSITU_ERROR_IO";
    case INSITU_ERROR_MEMORY: return "INSITU_ERROR_MEMORY";
    case INSITU_ERROR_MPI: return "INSITU_ERROR_MPI";
    case INSITU_ERROR_INTERNAL: return "INSITU_ERROR_INTERNAL";
    }
    return "unknown status";
}

static void free_session(insitu_session *session)
{
    session_writer_end(&session->writer); /* the writer uses the scene, and must end before the scene is freed */
    session_meshes_free(&session->meshes);
    session_catalogue_free(&session->catalogue);
    session_trees_free(&session->trees);
    session_scene_file_free(&session->scene_file);
    session_free_kept_pictures(&session->kept_pictures);
    session_run_ranges_free(&session->run_ranges);
    session_cinema_free(&session->cinema);
    session_montages_free(&session->montages);
    session_news_free(&session->news);
    session_overwrites_free(&session->overwrites);
    session_report_free(&session->report);
    comp_claims_free(session->team.claims);
    base_free(session);
}

/* Creates a session, on all ranks or on none. If this fails, the caller frees the team's communicators. */
static insitu_status create_session(const session_team *team, const session_scene_source *source, insitu_session **out,
                                    base_error *error)
{
    insitu_session *session = base_calloc(1, sizeof *session);
    if (session) {
        session_writer_create(&session->writer);
        session->team = *team;
        session->team.claims = comp_claims_create(team->ranks);
    }
    if (!session) session_fail_for_memory(error, (int64_t)sizeof *session, "the session");
    if (session && !session->team.claims)
        base_fail(error, INSITU_ERROR_MEMORY, "%s: no memory for the owners of blocks of %d ranks", source->call,
                  team->ranks);
    if (!out) base_fail(error, INSITU_ERROR_ARGUMENT, "%s: no place for the session", source->call);
    insitu_status status = session_agree(team->comm, error);
    if (status) goto fail;
    session_team_find_node_layout(&session->team);
    session->space.scale = 1;
    session_report_create(&session->report);
    status = session_load_scene(&session->scene_file, &session->team, source, error);
    if (status) goto fail;
    if (team->rank == 0)
        session->writer.loading_ms = session_writer_begin(&session->writer, &session->scene_file.scene);
    *out = session;
    return INSITU_OK;
fail:
    if (session) free_session(session);
    return status;
}

static insitu_status open_session(MPI_Comm comm, const session_scene_source *source, insitu_session **out)
{
    base_error *error = &thread_error;
    *error = (base_error){0};
    if (out) *out = NULL;
    if (session_require_mpi(source->call, error)) return error->status;
    if (comm == MPI_COMM_NULL)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "%s: the communicator is MPI_COMM_NULL", source->call);
    int is_inter = 0;
    MPI_Comm_test_inter(comm, &is_inter);
    if (is_inter)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "%s: an inter-communicator is not supported", source->call);
    session_guard guard;
    session_guard_save_settings(&guard);
    session_team team;
    insitu_status status = session_team_create(comm, &team, error);
    if (!status) status = create_session(&team, source, out, error);
    if (status) session_team_free(&team);
    session_guard_restore_settings(&guard);
    return status;
}

insitu_status insitu_create(MPI_Comm comm, const char *scene_file, insitu_session **out)
{
    return open_session(comm, &(session_scene_source){"insitu_create", scene_file, NULL}, out);
}

insitu_status insitu_create_from_text(MPI_Comm comm, const char *scene_text, insitu_session **out)
{
    return open_session(comm, &(session_scene_source){"insitu_create_from_text", NULL, scene_text}, out);
}

insitu_status insitu_create_fortran(MPI_Fint comm, const char *scene, int is_text, insitu_session **out)
{
    const MPI_Comm of_c = session_is_mpi_running() ? MPI_Comm_f2c(comm) : MPI_COMM_NULL;
    return is_text ? insitu_create_from_text(of_c, scene, out) : insitu_create(of_c, scene, out);
}

/* Stores the error of a failed call, and returns its status. A successful call does not clear the message of an earlier
 * failed call; the next step clears it. */
static insitu_status store_error_in_session(insitu_session *session, const base_error *error)
{
    if (error->status) session->error = *error;
    return error->status;
}

insitu_status insitu_set_mesh(insitu_session *session, const char *mesh_name, const insitu_mesh *mesh)
{
    base_error error = {.status = INSITU_OK};
    if (!session || refuse_call_in_fill(session, "insitu_set_mesh")) return INSITU_ERROR_ARGUMENT;
    session_set_mesh(&session->meshes, mesh_name, SESSION_WHOLE, mesh, &error);
    return store_error_in_session(session, &error);
}

insitu_status insitu_set_field(insitu_session *session, const char *mesh_name, const insitu_field *field)
{
    base_error error = {.status = INSITU_OK};
    if (!session || refuse_call_in_fill(session, "insitu_set_field")) return INSITU_ERROR_ARGUMENT;
    session_set_field(&session->meshes, mesh_name, SESSION_WHOLE, field, &error);
    return store_error_in_session(session, &error);
}

insitu_status insitu_set_block(insitu_session *session, const char *mesh_name, int64_t number, const insitu_mesh *block)
{
    base_error error = {.status = INSITU_OK};
    if (!session || refuse_call_in_fill(session, "insitu_set_block")) return INSITU_ERROR_ARGUMENT;
    session_set_mesh(&session->meshes, mesh_name, number, block, &error);
    return store_error_in_session(session, &error);
}

insitu_status insitu_set_block_field(insitu_session *session, const char *mesh_name, int64_t block,
                                     const insitu_field *field)
{
    base_error error = {.status = INSITU_OK};
    if (!session || refuse_call_in_fill(session, "insitu_set_block_field")) return INSITU_ERROR_ARGUMENT;
    session_set_field(&session->meshes, mesh_name, block, field, &error);
    return store_error_in_session(session, &error);
}

insitu_status insitu_parameter(insitu_session *session, const char *name, double *value)
{
    base_error error = {.status = INSITU_OK};
    if (!session || refuse_call_in_fill(session, "insitu_parameter")) return INSITU_ERROR_ARGUMENT;
    session_read_parameter(&session->scene_file, &session->requested_parameters, name, value, &error);
    return store_error_in_session(session, &error);
}

insitu_status insitu_keep_pictures(insitu_session *session, int keep)
{
    base_error error = {.status = INSITU_OK};
    if (!session || refuse_call_in_fill(session, "insitu_keep_pictures")) return INSITU_ERROR_ARGUMENT;
    if (session_require_mpi("insitu_keep_pictures", &error)) return store_error_in_session(session, &error);
    session_free_kept_pictures(&session->kept_pictures);
    int is_on = keep != 0;
    if (session_check_mpi(&error, MPI_Bcast(&is_on, 1, MPI_INT, 0, session->team.comm), "MPI_Bcast") == INSITU_OK)
        session->kept_pictures.is_enabled = is_on;
    return store_error_in_session(session, &error);
}

const insitu_picture *insitu_last_pictures(const insitu_session *session, int *count)
{
    const int kept =
        session && !refuse_call_in_fill(session, "insitu_last_pictures") ? session->kept_pictures.count : 0;
    if (count) *count = kept;
    return kept ? session->kept_pictures.items : NULL;
}

insitu_status insitu_destroy(insitu_session **session)
{
    if (!session || !*session) return INSITU_OK;
    insitu_session *s = *session;
    thread_error = (base_error){0};
    if (refuse_call_in_fill(s, "insitu_destroy")) {
        thread_error = s->meshes.filling.refused_error;
        return INSITU_ERROR_ARGUMENT;
    }
    session_writer_drain(&s->writer);
    session_writer_collect_results(&s->writer, &s->report);
    if (s->writer.failure_count) thread_error = session_writer_take_failure(&s->writer);
    if (session_is_mpi_running()) {
        session_broadcast_error(s->team.comm, 0, &thread_error);
        session_team_free(&s->team);
    }
    free_session(s);
    *session = NULL;
    return thread_error.status;
}
