/* Rank 0's writer: a thread that encodes and writes pictures while the simulation goes on.
 *
 * Pictures wait for it in a queue, at most 128 MiB of them or one: a step that draws more waits until there is room.
 * They are written in turn, and the next step collects the results when it begins. Where the scene asks for it, or
 * where no thread can be started, pictures are written before the step is over.
 *
 * The thread calls no MPI, takes none of the process's signals, and leaves the image library loaded when it ends. A
 * process that ends without insitu_destroy() waits for it too: in MPI_Finalize(), and as it exits. Pictures that wait
 * when a process is killed are lost; no file is ever half a picture (image_output.h). */
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

/* The thread touches these between lock and unlock, but for the files at hand. */
typedef struct session_writer {
    pthread_mutex_t mutex;
    pthread_cond_t has_changed; /* the queue, or is_ending */
    pthread_t thread;
    bool is_running, is_refused;        /* a thread was started; a thread could not be started */
    bool is_ending, is_loaded;          /* the thread is to end; the image library was loaded, or cannot be */
    struct session_files *first, *last; /* the queue; the thread is at the first */
    struct session_files *done, *last_done;
    int64_t written;                                    /* by the thread, whose it is */
    int waiting;                                        /* pictures in the queue */
    int64_t waiting_bytes;                              /* bytes of all that is in the queue */
    session_picture free_memory[SESSION_FREE_PICTURES]; /* for pictures that come */
    base_error failure;                                 /* the first that no step has told yet; the caller's thread's */
    int failures;                                       /* how many there were */
    double loading_ms;                                  /* what insitu_create() took, for the next report */
    struct session_writer *next;                        /* the next of the process's writers */
} session_writer;

/* Nothing is started yet. Local. */
void session_writer_create(session_writer *writer);

/* Load the image library and start the thread, if the scene has pictures and these were not done. Where the scene has
 * its pictures written in the step, no thread is started. Returns the milliseconds that the library took. Local. */
double session_writer_begin(session_writer *writer, const scene *scene);

/* Tells whether session_writer_begin() has started the thread, or will start it for this scene. Local. */
bool session_writer_is_behind(const session_writer *writer, const scene *scene);

/* An error of handing a picture over, for the next step to tell. Local. */
void session_writer_note(session_writer *writer, int64_t cycle, const base_error *error);

/* Memory of at least so many bytes for a picture, undefined; waits for room in the queue. NULL pixels: there is no
 * memory, though all that waited is written. Local. */
session_picture session_writer_reserve(session_writer *writer, size_t bytes);

/* Give memory back. Local. */
void session_writer_release(session_writer *writer, session_picture *memory);

/* Write the files by the thread, or at once where there is none; then what went wrong is in error. files is the
 * writer's from here on. Local. */
void session_writer_give(session_writer *writer, struct session_files *files, base_error *error);

/* Take what the thread has written: its time goes to the report, errors to the writer's failure. Local. */
void session_writer_collect(session_writer *writer, session_report *report);

/* The first failure, and how many more there were; none is left to tell. Local. */
base_error session_writer_failure(session_writer *writer);

/* Wait until all is written. Local. */
void session_writer_drain(session_writer *writer);

/* Bytes of pictures that wait or are kept for those to come, and how many wait. Local. */
int64_t session_writer_bytes(session_writer *writer, int *waiting);

/* Free the memory that is kept. Local. */
void session_writer_drop_memory(session_writer *writer);

/* Wait until all is written and end the thread. Results that were not collected are lost. Local. */
void session_writer_end(session_writer *writer);

#endif
