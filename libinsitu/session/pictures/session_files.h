/* A drawn picture with all data needed to write its files, so that the step that drew it may be over. */
#ifndef SESSION_FILES_H
#define SESSION_FILES_H

#include <stdbool.h>

#include "error.h"
#include "image.h"
#include "scene.h"
#include "session_channels.h"
#include "session_cinema.h"
#include "session_decorations.h"
#include "session_montage.h"
#include "session_picture.h"
#include "session_report.h"

/* A picture to write, on rank 0. */
typedef struct session_files {
    struct session_files *next; /* next in one of the writer's lists (session_writer.h) */
    const scene *scene;         /* the image's scene; it must exist until this is written */
    session_cinema *cinema;
    session_montages *montages;
    bool has_picture; /* else this is news, or else the tables of databases and pictures side by side, which are written
                         after a step's pictures */
    char *news;       /* owned: report.json's text (session_news.h); NULL: there are none */
    scene_image image; /* its camera is that of the step, its lists are the scene's */
    scene_moment moment;
    image frame;
    session_picture memory; /* memory of the frame */
    session_channels channels;
    deep_image deep;                  /* without counts if there is none */
    session_decorations *decorations; /* NULL: none, and the frame contains its background */
    base_error error;                 /* the first reason why a file could not be written */
    double ms;                        /* duration of writing */
} session_files;

/* Returns the size of the files' data in bytes. */
int64_t session_files_bytes(const session_files *files);

/* Writes all files, even if some fail. Local; may be called on any thread, for one set of files at a time. */
void session_write_files(session_files *files);

/* Frees the files, and the frame's memory; NULL is allowed. */
void session_files_free(session_files *files);

#endif
