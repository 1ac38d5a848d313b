/* A drawn picture on its way to its files: all that writing needs, so that the step which drew it may be over. */
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

/* Rank 0's. */
typedef struct session_files {
    struct session_files *next; /* in a list of the writer's (session_writer.h) */
    const scene *scene;         /* the image's scene: it stays until this is written */
    session_cinema *cinema;
    session_montages *montages;
    bool has_picture; /* else this is news, or else the tables of databases and pictures side by side, which are written
                         after a step's pictures */
    char *news;       /* owned: report.json's text (session_news.h); NULL: there are none */
    scene_image image; /* its camera is that of the step, its lists are the scene's */
    scene_moment moment;
    image frame;
    session_picture memory; /* holds the frame */
    session_channels channels;
    deep_image deep;                  /* without counts: there is none */
    session_decorations *decorations; /* NULL: none, and the frame has its background */
    base_error error;                 /* the first reason why a file could not be written */
    double ms;                        /* that writing took */
} session_files;

/* Bytes that it holds. */
int64_t session_files_bytes(const session_files *files);

/* Write them all, though some fail. Local; on any thread, one set of files after the other. */
void session_write_files(session_files *files);

/* files may be NULL. The frame's memory is freed too. */
void session_files_free(session_files *files);

#endif
