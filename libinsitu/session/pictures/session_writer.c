/* Implements the writer and its thread. The caller's thread loads the image library before the writing thread is
 * started. Loading takes 0.1 s, or 1 s from a cold disk, and holds the loader's lock, which is needed to start any
 * thread. If the writing thread loaded the library during the first step, all ranks would therefore wait until it is
 * loaded.
 *
 * Some library that OpenImageIO uses creates threads and static objects when it is loaded. When the process exits,
 * these are destroyed in the reverse order of their creation. Therefore the function that waits for pictures at exit
 * is registered again after the library is loaded, and again after the first pictures are written, because writing
 * creates more such objects. The function then runs before their destructors, and no picture is being written while
 * these objects are destroyed. */
#include "session_writer.h"

#include <mpi.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "memory.h"
#include "session_deep.h"
#include "session_files.h"
#include "session_image.h"

static const int64_t most_waiting_bytes = (int64_t)128 << 20, most_free_bytes = (int64_t)64 << 20;

/* ---- waiting for pictures before the process ends ---------------------------------------------------------------- */

static pthread_mutex_t all_mutex = PTHREAD_MUTEX_INITIALIZER;
static session_writer *all_writers;
static pid_t process; /* id of the process that started the writing thread; after a fork, the child process does not
                       * have this thread and must not wait for it */

static void wait_for_thread(session_writer *w)
{
    pthread_mutex_lock(&w->mutex);
    while (w->first) pthread_cond_wait(&w->has_changed, &w->mutex);
    pthread_mutex_unlock(&w->mutex);
}

static void wait_for_all_writers(void)
{
    if (getpid() != process) return;
    pthread_mutex_lock(&all_mutex);
    for (session_writer *w = all_writers; w; w = w->next)
        if (!pthread_equal(w->thread, pthread_self())) wait_for_thread(w);
    pthread_mutex_unlock(&all_mutex);
}

/* Waits until all pictures are written. This is called by MPI_Finalize(), which begins by deleting the attributes of
 * MPI_COMM_SELF (MPI-3.1, 8.7.1). */
static int wait_in_finalize(MPI_Comm comm, int key, void *value, void *state)
{
    (void)comm, (void)key, (void)value, (void)state;
    wait_for_all_writers();
    return MPI_SUCCESS;
}

static void register_wait_at_process_end(void)
{
    int key = MPI_KEYVAL_INVALID;
    process = getpid();
    atexit(wait_for_all_writers);
    if (MPI_Comm_create_keyval(MPI_COMM_NULL_COPY_FN, wait_in_finalize, &key, NULL) == MPI_SUCCESS)
        MPI_Comm_set_attr(MPI_COMM_SELF, key, NULL);
}

static void add_to_all_writers(session_writer *w)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, register_wait_at_process_end);
    pthread_mutex_lock(&all_mutex);
    w->next = all_writers;
    all_writers = w;
    pthread_mutex_unlock(&all_mutex);
}

static void remove_from_all_writers(session_writer *w)
{
    pthread_mutex_lock(&all_mutex);
    for (session_writer **at = &all_writers; *at; at = &(*at)->next)
        if (*at == w) {
            *at = w->next;
            break;
        }
    pthread_mutex_unlock(&all_mutex);
}

/* ---- reuse of the memory of pictures ----------------------------------------------------------------------------- */

/* Returns the size in bytes of the unused blocks that are kept for future pictures. The caller must hold w->mutex. */
static int64_t count_kept_bytes(const session_writer *w)
{
    int64_t bytes = 0;
    for (int i = 0; i < SESSION_FREE_PICTURES; i++) bytes += (int64_t)w->free_memory[i].bytes;
    return bytes;
}

/* Keeps the block *memory for future pictures, or frees it if enough blocks are kept. Blocks are kept because
 * allocating new pages takes as long as filling them. The caller must hold w->mutex. */
static void keep_or_free_memory(session_writer *w, session_picture *memory)
{
    for (int i = 0; i < SESSION_FREE_PICTURES; i++)
        if (!w->free_memory[i].pixels && count_kept_bytes(w) + (int64_t)memory->bytes <= most_free_bytes) {
            w->free_memory[i] = *memory;
            *memory = (session_picture){0};
        }
    session_drop_picture(memory);
}

/* Moves a kept block of at least `bytes` bytes to *memory. If all kept blocks are smaller, *memory stays empty, and one
 * of the kept blocks is freed. The caller must hold w->mutex. */
static void reuse_memory(session_writer *w, size_t bytes, session_picture *memory)
{
    int small = -1;
    for (int i = 0; i < SESSION_FREE_PICTURES && !memory->pixels; i++) {
        if (w->free_memory[i].bytes < bytes) {
            if (w->free_memory[i].pixels) small = i;
            continue;
        }
        *memory = w->free_memory[i];
        w->free_memory[i] = (session_picture){0};
    }
    if (!memory->pixels && small >= 0) session_drop_picture(&w->free_memory[small]);
}

session_picture session_writer_reserve(session_writer *w, size_t bytes)
{
    session_picture out = {0};
    pthread_mutex_lock(&w->mutex);
    while (w->first && w->queued_bytes + (int64_t)bytes > most_waiting_bytes)
        pthread_cond_wait(&w->has_changed, &w->mutex);
    for (;;) {
        reuse_memory(w, bytes, &out);
        if (out.pixels || session_reserve_picture(&out, bytes) || !w->first) break;
        pthread_cond_wait(&w->has_changed, &w->mutex);
    }
    pthread_mutex_unlock(&w->mutex);
    return out;
}

void session_writer_release(session_writer *w, session_picture *memory)
{
    pthread_mutex_lock(&w->mutex);
    keep_or_free_memory(w, memory);
    pthread_mutex_unlock(&w->mutex);
}

void session_writer_drop_memory(session_writer *w)
{
    pthread_mutex_lock(&w->mutex);
    for (int i = 0; i < SESSION_FREE_PICTURES; i++) session_drop_picture(&w->free_memory[i]);
    pthread_mutex_unlock(&w->mutex);
}

int64_t session_writer_count_bytes(session_writer *w, int *waiting)
{
    pthread_mutex_lock(&w->mutex);
    const int64_t bytes = w->queued_bytes + count_kept_bytes(w);
    *waiting = w->queued_count;
    pthread_mutex_unlock(&w->mutex);
    return bytes;
}

/* ---- the writing thread ------------------------------------------------------------------------------------------ */

/* Appends `files` to the linked list whose first and last element are *first and *last. The caller must hold the
 * writer's mutex. */
static void append_files(session_files **first, session_files **last, session_files *files)
{
    files->next = NULL;
    if (*first)
        (*last)->next = files;
    else
        *first = files;
    *last = files;
}

/* Moves the first element of the queue to the list of written files. The caller must hold w->mutex. */
static void move_first_files_to_finished_list(session_writer *w)
{
    session_files *files = w->first;
    w->first = files->next;
    w->queued_count -= files->has_picture;
    w->queued_bytes -= session_files_bytes(files);
    keep_or_free_memory(w, &files->memory);
    session_free_channels(&files->channels);
    session_free_deep_image(&files->deep);
    append_files(&w->finished, &w->last_finished, files);
    pthread_cond_broadcast(&w->has_changed);
}

static void *run_writer(void *of_writer)
{
    enum { FIRST_PICTURES = 16 };
    session_writer *w = of_writer;
    pthread_mutex_lock(&w->mutex);
    for (;;) {
        while (!w->first && !w->is_ending) pthread_cond_wait(&w->has_changed, &w->mutex);
        if (!w->first) break;
        pthread_mutex_unlock(&w->mutex);
        session_write_files(w->first);
        if (w->written_count++ < FIRST_PICTURES) atexit(wait_for_all_writers);
        pthread_mutex_lock(&w->mutex);
        move_first_files_to_finished_list(w);
    }
    pthread_mutex_unlock(&w->mutex);
    return NULL;
}

void session_writer_create(session_writer *w)
{
    *w = (session_writer){0};
    pthread_mutex_init(&w->mutex, NULL);
    pthread_cond_init(&w->has_changed, NULL);
}

bool session_writer_writes_after_step(const session_writer *w, const scene *scene)
{
    return scene->writing == SCENE_WRITE_BEHIND && (w->is_running || (session_writes_behind && !w->is_refused));
}

static void start_thread(session_writer *w)
{
    sigset_t all, before;
    atexit(wait_for_all_writers);
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before);
    w->is_running = pthread_create(&w->thread, NULL, run_writer, w) == 0;
    w->is_refused = !w->is_running;
    pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (w->is_running) add_to_all_writers(w);
}

double session_writer_begin(session_writer *w, const scene *scene)
{
    if (scene->image_count == 0) return 0;
    const double ms = w->is_loaded ? 0 : session_load_image_library();
    w->is_loaded = true;
    if (!w->is_running && session_writer_writes_after_step(w, scene)) start_thread(w);
    return ms;
}

/* ---- queueing pictures and collecting results -------------------------------------------------------------------- */

void session_writer_queue(session_writer *w, session_files *files, base_error *error)
{
    const bool is_behind = w->is_running && files->scene->writing == SCENE_WRITE_BEHIND;
    if (is_behind) {
        pthread_mutex_lock(&w->mutex);
        append_files(&w->first, &w->last, files);
        w->queued_count += files->has_picture;
        w->queued_bytes += session_files_bytes(files);
        pthread_cond_broadcast(&w->has_changed);
        pthread_mutex_unlock(&w->mutex);
        return;
    }
    session_write_files(files);
    if (files->error.status && !error->status) *error = files->error;
    session_writer_release(w, &files->memory);
    session_files_free(files);
}

void session_writer_record_error(session_writer *w, int64_t cycle, const base_error *error)
{
    if (!error->status || w->failure_count++) return;
    base_fail(&w->failure, error->status, "cycle %lld: %.1000s", (long long)cycle, error->message);
}

static void collect_files(session_writer *w, const session_files *files, session_report *report)
{
    report->public_report.background_ms += files->ms;
    session_writer_record_error(w, files->moment.cycle, &files->error);
}

void session_writer_collect_results(session_writer *w, session_report *report)
{
    static const session_warning warning = {WARNING_WRITER, NULL, NULL, 0};
    pthread_mutex_lock(&w->mutex);
    session_files *files = w->finished;
    w->finished = w->last_finished = NULL;
    pthread_mutex_unlock(&w->mutex);
    report->public_report.background_ms += w->loading_ms;
    w->loading_ms = 0;
    while (files) {
        session_files *next = files->next;
        collect_files(w, files, report);
        session_files_free(files);
        files = next;
    }
    session_warn_locally(report, &warning, w->is_refused,
                         "pictures are written in the step: no thread can be started for it");
}

base_error session_writer_take_failure(session_writer *w)
{
    base_error out = w->failure;
    const size_t size = strlen(out.message);
    if (w->failure_count > 1)
        snprintf(out.message + size, sizeof out.message - size, " (and %d more like it)", w->failure_count - 1);
    w->failure = (base_error){0};
    w->failure_count = 0;
    return out;
}

void session_writer_drain(session_writer *w)
{
    if (w->is_running) wait_for_thread(w);
}

void session_writer_end(session_writer *w)
{
    if (w->is_running) {
        remove_from_all_writers(w);
        pthread_mutex_lock(&w->mutex);
        w->is_ending = true;
        pthread_cond_broadcast(&w->has_changed);
        pthread_mutex_unlock(&w->mutex);
        pthread_join(w->thread, NULL);
        w->is_running = false;
    }
    while (w->finished) {
        session_files *next = w->finished->next;
        session_files_free(w->finished);
        w->finished = next;
    }
    session_writer_drop_memory(w);
    pthread_cond_destroy(&w->has_changed);
    pthread_mutex_destroy(&w->mutex);
}
