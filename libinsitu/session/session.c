/* A session's life. What can fail on one rank alone at its birth ends in agreement, so that a session is born on all
 * ranks or on none. */
#include "session.h"

#include "memory.h"
#include "session_agree.h"
#include "session_guard.h"

/* What insitu_error(NULL) tells: there is no session to ask after a failed insitu_create(). */
static _Thread_local base_error thread_error;

const char *insitu_error(const insitu_session *session)
{
    return session ? session->error.message : thread_error.message;
}

const insitu_report *insitu_last_report(const insitu_session *session)
{
    return session ? &session->report : NULL;
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

static bool is_mpi_running(void)
{
    int is_initialized = 0, is_finalized = 0;
    MPI_Initialized(&is_initialized);
    if (is_initialized) MPI_Finalized(&is_finalized);
    return is_initialized && !is_finalized;
}

static insitu_status duplicate(MPI_Comm comm, MPI_Comm *out, base_error *error)
{
    const insitu_status status = session_mpi(error, MPI_Comm_dup(comm, out), "MPI_Comm_dup");
    if (status) return status;
    return session_mpi(error, MPI_Comm_set_errhandler(*out, MPI_ERRORS_RETURN), "MPI_Comm_set_errhandler");
}

static void free_session(insitu_session *session)
{
    for (int i = 0; i < session->mesh_count; i++) session_mesh_free(session->meshes[i]);
    base_free(session->meshes);
    session_catalogue_free(&session->catalogue);
    mmbvh_free(&session->parent);
    scene_free(&session->scene);
    base_free(session->scene_path);
    base_free(session->scene_warning);
    session_drop_picture(session);
    session_text_free(&session->copied_why);
    session_text_free(&session->left_out);
    session_text_free(&session->warnings);
    base_free(session->told);
    base_free(session);
}

static void free_communicators(MPI_Comm comm, MPI_Comm comp_comm)
{
    if (comp_comm != MPI_COMM_NULL) MPI_Comm_free(&comp_comm);
    if (comm != MPI_COMM_NULL) MPI_Comm_free(&comm);
}

/* On all ranks or on none. own and comp are freed by the caller where this fails. */
static insitu_status create(MPI_Comm own, MPI_Comm comp, const char *scene_file, insitu_session **out,
                            base_error *error)
{
    insitu_session *session = base_calloc(1, sizeof *session);
    if (!session) session_no_memory(error, (int64_t)sizeof *session, "the session");
    if (!out) base_fail(error, INSITU_ERROR_ARGUMENT, "insitu_create: no place for the session");
    insitu_status status = session_agree(own, error);
    if (status) goto fail;
    session->comm = own;
    session->comp_comm = comp;
    MPI_Comm_rank(own, &session->rank);
    MPI_Comm_size(own, &session->ranks);
    session->node_ranks = session_node_ranks(own);
    session->scale = 1;
    session->report.copied_why = session->report.left_out = session->report.warnings = "";
    status = session_load_scene(session, scene_file, error);
    if (status) goto fail;
    *out = session;
    return INSITU_OK;
fail:
    if (session) free_session(session);
    return status;
}

/* The communicators are the session's, or freed. */
static insitu_status create_duplicated(MPI_Comm comm, const char *scene_file, insitu_session **out, base_error *error)
{
    MPI_Comm own = MPI_COMM_NULL, comp = MPI_COMM_NULL;
    insitu_status status = duplicate(comm, &own, error);
    if (status == INSITU_OK) status = duplicate(own, &comp, error);
    if (status == INSITU_OK) status = create(own, comp, scene_file, out, error);
    if (status != INSITU_OK) free_communicators(own, comp);
    return status;
}

insitu_status insitu_create(MPI_Comm comm, const char *scene_file, insitu_session **out)
{
    base_error *error = &thread_error;
    *error = (base_error){0};
    if (out) *out = NULL;
    if (!is_mpi_running()) return base_fail(error, INSITU_ERROR_MPI, "insitu_create: MPI is not running");
    if (comm == MPI_COMM_NULL)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "insitu_create: the communicator is MPI_COMM_NULL");
    int is_inter = 0;
    MPI_Comm_test_inter(comm, &is_inter);
    if (is_inter)
        return base_fail(error, INSITU_ERROR_ARGUMENT, "insitu_create: an inter-communicator is not supported");
    session_guard guard;
    session_guard_begin(&guard);
    const insitu_status status = create_duplicated(comm, scene_file, out, error);
    session_guard_end(&guard);
    return status;
}

insitu_status insitu_destroy(insitu_session **session)
{
    if (!session || !*session) return INSITU_OK;
    thread_error = (base_error){0};
    if (is_mpi_running()) free_communicators((*session)->comm, (*session)->comp_comm);
    free_session(*session);
    *session = NULL;
    return INSITU_OK;
}
