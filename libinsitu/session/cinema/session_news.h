/* report.json in each database of the scene: the state of a run, for a program that watches it from outside, such as
 * insitu-view. It holds the last step's cycle, time and error, the scene's state with the error of its last edit, the
 * scene's parameters, and the last warnings. docs/live.md describes it.
 *
 * Rank 0 composes the text at the end of a step that has warnings or errors, or has drawn pictures; the writer thread
 * writes it after the step's pictures. A database without a folder, as before its first picture, gets none. */
#ifndef SESSION_NEWS_H
#define SESSION_NEWS_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/stat.h>

#include "error.h"
#include "scene.h"
#include "session_report.h"

enum { SESSION_NEWS_LINES = 64 };

/* The warnings and the error that report.json shows, on rank 0. */
typedef struct session_news {
    bool is_new;                     /* since the last text was made */
    int64_t count;                   /* number of warnings so far; the last SESSION_NEWS_LINES are kept */
    char *lines[SESSION_NEWS_LINES]; /* warning i is at i % SESSION_NEWS_LINES; NULL: there was no memory for it */
    int64_t cycles[SESSION_NEWS_LINES];
    base_error error; /* the error of the last step that failed or drew; empty if it drew */
} session_news;

/* The scene file, as shown in report.json. */
typedef struct session_news_scene {
    const scene *scene;
    const char *path;         /* as the caller gave it */
    const struct stat *stamp; /* the file's state when it was last read, accepted or not; NULL: there is no file */
    const char *refusal;      /* why the last edit was not taken; NULL: it was */
} session_news_scene;

/* Records a step's error and its warnings; must be called before the refusal of the scene file is added to them.
 * Local. */
void session_note_news(session_news *news, const session_report *report, const base_error *error);

/* Returns the text of report.json, from base_alloc(). Returns NULL if there is no memory; is_new then stays set.
 * Local. */
char *session_make_news(session_news *news, const session_news_scene *source, const insitu_report *report);

/* Writes report.json into the databases that have folders. Returns the first error. Local. */
insitu_status session_write_news(const scene *scene, const char *text, base_error *error);

void session_news_free(session_news *news);

#endif
