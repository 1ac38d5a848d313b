/* Defines the writer of rank 0: a thread that encodes and writes pictures while the simulation continues.
 *
 * Pictures are put into a queue. It holds at most 128 MiB, or a single larger picture. A step that draws more waits
 * until there is space. Pictures are written in order, and the next step collects the results when it begins. If the
 * scene requests it, or no thread can be started, pictures are written before the step ends.
 *
 * The thread does not call MPI, receives none of the process's signals, and does not unload the image library when
 * it ends. A process that ends without insitu_destroy() waits for the thread in MPI_Finalize() or at exit. If a
 * process is killed, queued pictures are lost, but no file is ever incomplete (image_output.h). */
#ifndef SESSION_WRITER_H
#define SESSION_WRITER_H

#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>

#include "error.h"
#include "scene.h"
#include "session_picture.h"
#include "session_report.h"

enum { SESSION_FREE_PICTURES = 4 };

/* The writer's state. The thread accesses this state only while it holds the mutex, except for the queue's first
 * element, whose files it is writing. */
typedef struct session_writer {
    pthread_mutex_t mutex;
    pthread_cond_t has_changed; /* condition that signals a change of the queue or of is_ending */
    pthread_t thread;
    bool is_running, is_refused; /* is_running: the thread was started; is_refused: starting it has failed */
    /* is_ending: the thread must end; is_loaded: the image library was loaded, or loading it has failed */
    bool is_ending, is_loaded;
    struct session_files *first, *last;                 /* the queue; the thread is writing its first element */
    struct session_files *finished, *last_finished;     /* list of written files, which the caller's thread collects */
    int64_t written_count;                              /* number of pictures written; used by the thread only */
    int queued_count;                                   /* number of pictures in the queue */
    int64_t queued_bytes;                               /* size of all data in the queue */
    session_picture free_memory[SESSION_FREE_PICTURES]; /* unused blocks of memory that are kept for future pictures */
    base_error failure; /* first error that no step has returned yet; used by the caller's thread only */
    int failure_count;  /* number of errors since `failure` was stored, including that one */
    /* time in milliseconds that loading the image library took in insitu_create(), for the next report */
    double loading_ms;
    struct session_writer *next; /* next writer of this process */
} session_writer;

/* Initializes the writer. No thread is started. Local. */
void session_writer_create(session_writer *writer);

/* Loads the image library and starts the thread if the scene has pictures, unless this has already been done. No thread
 * is started if the scene requests that pictures are written during the step. Returns the time in milliseconds that
 * loading took. Local. */
double session_writer_begin(session_writer *writer, const scene *scene);

/* Returns whether pictures are written by the thread after the step: session_writer_begin() has started the thread, or
 * will start it for this scene. Local. */
bool session_writer_writes_after_step(const session_writer *writer, const scene *scene);

/* Records an error that occurred when a picture was passed to the writer. The next step returns it. Local. */
void session_writer_record_error(session_writer *writer, int64_t cycle, const base_error *error);

/* Returns uninitialized memory of at least `bytes` bytes for a picture. Blocks until the queue has space. The member
 * pixels of the result is NULL if memory runs out even after all queued files have been written. Local. */
session_picture session_writer_reserve(session_writer *writer, size_t bytes);

/* Returns memory that is no longer used to the writer. Local. */
void session_writer_release(session_writer *writer, session_picture *memory);

/* Passes files to the writer. The writer then owns them. The thread writes them later; if there is no thread, they are
 * written immediately, and an error is stored in *error. Local. */
void session_writer_queue(session_writer *writer, struct session_files *files, base_error *error);

/* Collects the results of the thread: adds the time that the thread has used to the report, and its errors to the
 * writer's `failure`. Local. */
void session_writer_collect_results(session_writer *writer, session_report *report);

/* Returns the first error that no step has returned yet, with the number of further errors in its message, and clears
 * all of them. Local. */
base_error session_writer_take_failure(session_writer *writer);

/* Blocks until all files are written. Local. */
void session_writer_drain(session_writer *writer);

/* Returns the size in bytes of queued pictures and of kept memory. *waiting receives the number of queued pictures.
 * Local. */
int64_t session_writer_count_bytes(session_writer *writer, int *waiting);

/* Frees the memory that is kept for future pictures. Local. */
void session_writer_drop_memory(session_writer *writer);

/* Blocks until all files are written, and ends the thread. Results that have not been collected are lost. Local. */
void session_writer_end(session_writer *writer);

#endif
