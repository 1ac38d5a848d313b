/* The scene file: rank 0 reads it and everyone parses the same text, so that all ranks come to the same scene without a
 * word about its structure. A file edited while the simulation runs is taken at the next step; an edit that does not
 * parse leaves the old scene in place and a warning in the reports until it is mended. */
#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <unistd.h>

#include "memory.h"
#include "session.h"
#include "session_agree.h"
#include "session_warnings.h"

enum { MAX_SCENE_BYTES = 1 << 22 };

typedef struct scene_file_text {
    char *data;
    int64_t size;
    bool has_stamp;
    struct stat stamp;
} scene_file_text;

static const char *kind_of(mode_t mode)
{
    if (S_ISDIR(mode)) return "a directory";
    if (S_ISFIFO(mode)) return "a named pipe (FIFO)";
    if (S_ISSOCK(mode)) return "a socket";
    return "a device";
}

/* Waits for nobody: what is not a regular file is refused before it is read. */
static insitu_status read_regular(int file, const char *path, scene_file_text *text, base_error *error)
{
    if (fstat(file, &text->stamp) != 0) return base_fail(error, INSITU_ERROR_SCENE, "%s: %s", path, strerror(errno));
    text->has_stamp = true;
    if (!S_ISREG(text->stamp.st_mode))
        return base_fail(error, INSITU_ERROR_SCENE, "%s: is %s, expected a regular file", path,
                         kind_of(text->stamp.st_mode));
    text->data = base_alloc(MAX_SCENE_BYTES);
    if (!text->data) return session_no_memory(error, MAX_SCENE_BYTES, "scene text");
    while (text->size < MAX_SCENE_BYTES) {
        const ssize_t more = read(file, text->data + text->size, (size_t)(MAX_SCENE_BYTES - text->size));
        if (more < 0 && errno == EINTR) continue;
        if (more < 0) return base_fail(error, INSITU_ERROR_SCENE, "%s: %s", path, strerror(errno));
        if (more == 0) return INSITU_OK;
        text->size += more;
    }
    return base_fail(error, INSITU_ERROR_SCENE, "%s: is no scene: larger than %d bytes", path, MAX_SCENE_BYTES);
}

static insitu_status read_file(const char *path, scene_file_text *text, base_error *error)
{
    const int file = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);
    if (file < 0) return base_fail(error, INSITU_ERROR_SCENE, "%s: cannot be read: %s", path, strerror(errno));
    const insitu_status status = read_regular(file, path, text, error);
    close(file);
    return status;
}

/* Rank 0's bytes to all; *data is allocated on the others. Collective. */
static insitu_status share_bytes(insitu_session *session, char **data, int64_t *size, base_error *error)
{
    insitu_status status = session_mpi(error, MPI_Bcast(size, 1, MPI_INT64_T, 0, session->comm), "MPI_Bcast");
    if (status) return status;
    if (session->rank != 0) {
        *data = base_alloc((size_t)*size + 1);
        if (!*data) session_no_memory(error, *size, "scene text");
    }
    status = session_agree(session->comm, error);
    if (status) return status;
    return session_mpi(error, MPI_Bcast(*data, (int)*size, MPI_CHAR, 0, session->comm), "MPI_Bcast");
}

static insitu_status parse_shared(insitu_session *session, scene_file_text *text, scene *out, base_error *error)
{
    insitu_status status = share_bytes(session, &text->data, &text->size, error);
    if (status) return status;
    scene parsed = {0};
    scene_parse(text->data, (size_t)text->size, session->scene_path, &parsed, error);
    status = session_agree_as_is(session->comm, error);
    if (status == INSITU_OK)
        *out = parsed;
    else
        scene_free(&parsed);
    return status;
}

static bool is_same_file(const struct stat *a, const struct stat *b)
{
    return a->st_ino == b->st_ino && a->st_dev == b->st_dev && a->st_size == b->st_size &&
           a->st_mtim.tv_sec == b->st_mtim.tv_sec && a->st_mtim.tv_nsec == b->st_mtim.tv_nsec;
}

/* Read, share and parse. Where memory ran out the file counts as unread, and the next step tries again. */
static insitu_status read_scene(insitu_session *session, scene *out, base_error *error)
{
    scene_file_text text = {0};
    if (session->rank == 0) read_file(session->scene_path, &text, error);
    insitu_status status = session_agree_as_is(session->comm, error);
    if (status == INSITU_OK) status = parse_shared(session, &text, out, error);
    if (session->rank == 0 && text.has_stamp && status != INSITU_ERROR_MEMORY) {
        session->stamp = text.stamp;
        session->has_stamp = true;
    }
    base_free(text.data);
    return status;
}

static insitu_status share_path(insitu_session *session, const char *path, base_error *error)
{
    int64_t size = 0;
    if (session->rank == 0) {
        if (!path)
            base_fail(error, INSITU_ERROR_ARGUMENT, "insitu_create: no scene file is given");
        else if (!(session->scene_path = base_strdup(path)))
            session_no_memory(error, (int64_t)strlen(path), "the scene file's name");
        else
            size = (int64_t)strlen(path) + 1;
    }
    const insitu_status status = session_agree(session->comm, error);
    if (status) return status;
    return share_bytes(session, &session->scene_path, &size, error);
}

insitu_status session_load_scene(insitu_session *session, const char *path, base_error *error)
{
    const insitu_status status = share_path(session, path, error);
    return status ? status : read_scene(session, &session->scene, error);
}

bool session_scene_file_changed(const insitu_session *session)
{
    struct stat now;
    /* An editor may have taken the file away for a moment: it is back at a later step. */
    if (session->rank != 0 || stat(session->scene_path, &now) != 0) return false;
    return !session->has_stamp || !is_same_file(&now, &session->stamp);
}

void session_reload_scene(insitu_session *session)
{
    scene edited = {0};
    base_error error = {0};
    base_free(session->scene_warning);
    session->scene_warning = NULL;
    if (read_scene(session, &edited, &error) != INSITU_OK) {
        session->scene_warning = base_strdup(error.message);
        return;
    }
    scene_free(&session->scene);
    session->scene = edited;
    session_drop_picture(session);
    session_forget_warnings(session);
    for (int i = 0; i < session->mesh_count; i++) session_drop_scalars(session->meshes[i]);
}
