/* A drawn picture with all data that is needed to write its files. The files may be written after the end of the step
 * that has drawn the picture. */
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

/* An element of the writer's queue: usually a picture that is to be written. Used on rank 0 only. */
typedef struct session_files {
    struct session_files *next; /* next element in a list of the writer (session_writer.h) */
    const scene *scene;         /* the scene of the image; it must exist until the files are written */
    session_cinema *cinema;
    session_montages *montages;
    /* true: the element is a picture. Otherwise it is report.json if `news` is not NULL, or else a request to write the
     * montages and the tables of databases, which comes after all pictures of a step */
    bool has_picture;
    char *news;        /* text of report.json, owned by this struct (session_news.h); NULL: it is not written */
    scene_image image; /* copy of the image with the camera of the step; its lists belong to the scene */
    scene_placeholder_values moment;
    image frame;
    session_picture memory; /* block that holds the pixels of `frame`; owned by this struct */
    session_channels channels;
    deep_image deep;                  /* samples of a deep picture; its member `counts` is NULL if there is none */
    session_decorations *decorations; /* NULL: there are no decorations, and the frame contains its background */
    base_error error;                 /* the first error of writing a file */
    double ms;                        /* time in milliseconds that writing has taken */
} session_files;

/* Returns the size of the files' data in bytes. */
int64_t session_files_bytes(const session_files *files);

/* Writes all files, even if some fail. Local. May be called on any thread, but not twice at the same time for the same
 * files. */
void session_write_files(session_files *files);

/* Frees the files and the memory of the frame. files may be NULL. */
void session_files_free(session_files *files);

#endif
