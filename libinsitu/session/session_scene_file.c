/* Reads the scene. Rank 0 reads the file, or the caller gives rank 0 the text. All ranks parse the same text, so that
 * all have the same scene without exchanging its structs. If the file is edited while the simulation runs, the next
 * step reads it again. If the edited text cannot be parsed, the old scene is kept, and reports contain a warning until
 * the file is corrected. */
#include "session_scene_file.h"

#include <string.h>

#include "file.h"
#include "memory.h"
#include "session_agree.h"

enum { MAX_SCENE_BYTES = 1 << 22 };

typedef struct scene_file_text {
    char *data;
    int64_t size;
    bool has_stamp;
    struct stat stamp;
} scene_file_text;

static insitu_status read_file(const char *path, scene_file_text *text, base_error *error)
{
    file_content content;
    file_failure failure;
    const bool is_read = file_read(path, MAX_SCENE_BYTES, &content, &failure);
    text->has_stamp = content.stamp.st_mode != 0;
    text->stamp = content.stamp;
    if (!is_read)
        return base_fail(error, failure.is_out_of_memory ? INSITU_ERROR_MEMORY : INSITU_ERROR_SCENE,
                         "%s: cannot be read: %s", path, failure.reason);
    text->data = content.text;
    text->size = (int64_t)content.size;
    return INSITU_OK;
}

/* Reads into memory a file that the scene names. */
static insitu_status read_attachment(const char *path, char **text, int64_t *size, base_error *error)
{
    scene_file_text file = {0};
    const insitu_status status = read_file(path, &file, error);
    if (status) return status;
    *text = file.data;
    *size = file.size;
    return INSITU_OK;
}

/* Sends rank 0's bytes to all ranks; *data is allocated on the other ranks. Collective. */
static insitu_status broadcast_bytes(const session_team *team, char **data, int64_t *size, base_error *error)
{
    insitu_status status = session_check_mpi(error, MPI_Bcast(size, 1, MPI_INT64_T, 0, team->comm), "MPI_Bcast");
    if (status) return status;
    if (team->rank != 0) {
        *data = base_alloc((size_t)*size + 1);
        if (!*data) session_fail_for_memory(error, *size, "scene text");
    }
    status = session_agree(team->comm, error);
    if (status) return status;
    return session_check_mpi(error, MPI_Bcast(*data, (int)*size, MPI_CHAR, 0, team->comm), "MPI_Bcast");
}

/* Sends the files that rank 0's scene names to all ranks. Collective. */
static insitu_status broadcast_attachments(const session_team *team, scene_attachments *files, base_error *error)
{
    int count = files->count;
    insitu_status status = session_check_mpi(error, MPI_Bcast(&count, 1, MPI_INT, 0, team->comm), "MPI_Bcast");
    if (status || count == 0) return status;
    if (team->rank != 0) {
        files->items = base_calloc((size_t)count, sizeof *files->items);
        if (files->items)
            files->count = count;
        else
            session_fail_for_memory(error, count * (int64_t)sizeof *files->items, "files of the scene");
    }
    status = session_agree(team->comm, error);
    for (int i = 0; i < count && !status; i++) {
        scene_attachment *file = &files->items[i];
        int64_t length = team->rank == 0 ? (int64_t)strlen(file->path) + 1 : 0;
        status = broadcast_bytes(team, &file->path, &length, error);
        if (!status) status = broadcast_bytes(team, &file->text, &file->size, error);
    }
    return status;
}

/* Parses the scene on all ranks. Rank 0 parses first and reads the files that the scene names. It then sends the text
 * and the files to the other ranks, and they parse these. */
static insitu_status parse_scene_on_all_ranks(const char *path, const session_team *team, scene_file_text *text,
                                              scene *out, base_error *error)
{
    scene parsed = {0};
    scene_attachments files = {.read = read_attachment};
    if (team->rank == 0) scene_parse(text->data, (size_t)text->size, path, &files, &parsed, error);
    files.read = NULL;
    insitu_status status = session_agree_without_rank(team->comm, error);
    if (!status) status = broadcast_bytes(team, &text->data, &text->size, error);
    if (!status) status = broadcast_attachments(team, &files, error);
    if (!status && team->rank != 0) scene_parse(text->data, (size_t)text->size, path, &files, &parsed, error);
    if (!status) status = session_agree_without_rank(team->comm, error);
    scene_attachments_free(&files);
    if (status == INSITU_OK)
        *out = parsed;
    else
        scene_free(&parsed);
    return status;
}

static bool is_same_file_state(const struct stat *a, const struct stat *b)
{
    return a->st_ino == b->st_ino && a->st_dev == b->st_dev && a->st_size == b->st_size &&
           a->st_mtim.tv_sec == b->st_mtim.tv_sec && a->st_mtim.tv_nsec == b->st_mtim.tv_nsec;
}

/* Copies the caller's text as if it had been read from a file. A text that is longer than the limit for scenes is
 * truncated here; parsing then refuses it. */
static insitu_status copy_given_scene_text(const char *given, scene_file_text *text, base_error *error)
{
    text->size = (int64_t)strnlen(given, MAX_SCENE_BYTES);
    text->data = base_alloc((size_t)text->size + 1);
    if (!text->data) return session_fail_for_memory(error, text->size, "scene text");
    memcpy(text->data, given, (size_t)text->size);
    return INSITU_OK;
}

/* Reads the scene, sends it to all ranks and parses it. given: the scene's text, or NULL to read the file. If memory
 * runs out, the file is treated as not read, so that the next step tries again. */
static insitu_status read_and_parse_scene(session_scene_file *file, const session_team *team, const char *given,
                                          scene *out, base_error *error)
{
    scene_file_text text = {0};
    if (team->rank == 0) {
        if (given)
            copy_given_scene_text(given, &text, error);
        else
            read_file(file->path, &text, error);
    }
    insitu_status status = session_agree_without_rank(team->comm, error);
    if (status == INSITU_OK) status = parse_scene_on_all_ranks(file->path, team, &text, out, error);
    if (team->rank == 0 && text.has_stamp && status != INSITU_ERROR_MEMORY) {
        file->stamp = text.stamp;
        file->has_stamp = true;
    }
    base_free(text.data);
    return status;
}

static insitu_status broadcast_path(session_scene_file *file, const session_team *team,
                                    const session_scene_source *source, base_error *error)
{
    const char *path = source->text ? SESSION_SCENE_TEXT : source->path;
    int64_t size = 0;
    if (team->rank == 0) {
        if (!path)
            base_fail(error, INSITU_ERROR_ARGUMENT, "%s: no scene is given", source->call);
        else if (!(file->path = base_strdup(path)))
            session_fail_for_memory(error, (int64_t)strlen(path), "the scene file's name");
        else
            size = (int64_t)strlen(path) + 1;
    }
    const insitu_status status = session_agree(team->comm, error);
    if (status) return status;
    return broadcast_bytes(team, &file->path, &size, error);
}

insitu_status session_load_scene(session_scene_file *file, const session_team *team, const session_scene_source *source,
                                 base_error *error)
{
    file->is_text = source->text;
    const insitu_status status = broadcast_path(file, team, source, error);
    return status ? status : read_and_parse_scene(file, team, source->text, &file->scene, error);
}

bool session_is_scene_edited(const session_scene_file *file, int rank)
{
    struct stat now;
    /* if an editor has removed the file for a moment, a later step reads it */
    if (rank != 0 || file->is_text || stat(file->path, &now) != 0) return false;
    return !file->has_stamp || !is_same_file_state(&now, &file->stamp);
}

bool session_reload_scene(session_scene_file *file, const session_team *team)
{
    scene edited = {0};
    base_error error = {0};
    base_free(file->warning);
    file->warning = NULL;
    if (read_and_parse_scene(file, team, NULL, &edited, &error) != INSITU_OK) {
        file->warning = base_strdup(error.message);
        return false;
    }
    scene_free(&file->scene);
    file->scene = edited;
    return true;
}

void session_scene_file_free(session_scene_file *file)
{
    scene_free(&file->scene);
    base_free(file->path);
    base_free(file->warning);
}
