/* Rank 0's writer: a thread that encodes and writes pictures while the simulation continues.
 *
 * Pictures are put into a queue, at most 128 MiB of them or one: a step that draws more blocks until there is space.
 * They are written in order, and the next step collects the results when it begins. If the scene says so, or no thread
 * can be started, pictures are written before the step is over.
 *
 * The thread does not call MPI, receives none of the process's signals, and leaves the image library loaded when it
 * ends. A process that ends without insitu_destroy() also waits for it: in MPI_Finalize(), and as it exits. Queued
 * pictures are lost if a process is killed; no file is ever incomplete (image_output.h). */
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

/* State of the writer. The thread accesses it only with the mutex held, except for the files that it is writing. */
typedef struct session_writer {
    pthread_mutex_t mutex;
    pthread_cond_t has_changed; /* signals a change of the queue or of is_ending */
    pthread_t thread;
    bool is_running, is_refused;        /* a thread was started; a thread could not be started */
    bool is_ending, is_loaded;          /* the thread must end; the image library was loaded, or cannot be */
    struct session_files *first, *last; /* the queue; the thread is writing the first */
    struct session_files *done, *last_done;
    int64_t written;                                    /* counter of the thread; only the thread uses it */
    int waiting;                                        /* number of pictures in the queue */
    int64_t waiting_bytes;                              /* size of everything in the queue */
    session_picture free_memory[SESSION_FREE_PICTURES]; /* for future pictures */
    base_error failure;          /* first failure that no step has returned yet; used by the caller's thread only */
    int failures;                /* number of failures */
    double loading_ms;           /* duration of loading in insitu_create(), for the next report */
    struct session_writer *next; /* next of the process's writers */
} session_writer;

/* Initializes the writer, without starting anything. Local. */
void session_writer_create(session_writer *writer);

/* Loads the image library and starts the thread if the scene has pictures, unless that has been done. If the scene has
 * its pictures written in the step, no thread is started. Returns the duration of loading in milliseconds. Local. */
double session_writer_begin(session_writer *writer, const scene *scene);

/* Returns whether session_writer_begin() has started the thread, or will start it for this scene. Local. */
bool session_writer_is_behind(const session_writer *writer, const scene *scene);

/* Records an error of passing a picture, which the next step returns. Local. */
void session_writer_note(session_writer *writer, int64_t cycle, const base_error *error);

/* Returns memory of at least `bytes` bytes for a picture, uninitialized. Blocks until the queue has space. pixels is
 * NULL if there is no memory even after everything queued is written. Local. */
session_picture session_writer_reserve(session_writer *writer, size_t bytes);

/* Returns memory to the writer. Local. */
void session_writer_release(session_writer *writer, session_picture *memory);

/* Writes the files by the thread, or immediately if there is none; errors of the latter are stored in *error. The
 * writer becomes the owner of files. Local. */
void session_writer_give(session_writer *writer, struct session_files *files, base_error *error);

/* Collects the results of the thread: its duration is added to the report, errors to the writer's failure. Local. */
void session_writer_collect(session_writer *writer, session_report *report);

/* Returns the first failure, with the number of further ones, and clears them. Local. */
base_error session_writer_failure(session_writer *writer);

/* Blocks until all files are written. Local. */
void session_writer_drain(session_writer *writer);

/* Returns the size of queued pictures and of kept memory; *waiting: number of queued pictures. Local. */
int64_t session_writer_bytes(session_writer *writer, int *waiting);

/* Frees the memory that is kept. Local. */
void session_writer_drop_memory(session_writer *writer);

/* Blocks until all files are written, and ends the thread. Results that were not collected are lost. Local. */
void session_writer_end(session_writer *writer);

#endif
