/* The news of a run, for a program that watches it from outside, such as insitu-view: report.json in each database of
 * the scene. It holds the last step's cycle, time and error, the scene's state with the error of its last edit, the
 * scene's parameters, and the last warnings. docs/live.md describes it.
 *
 * Rank 0 makes the text at the end of a step that has news or has drawn pictures; the writer puts it in place after the
 * step's pictures. A database without a folder, as before its first picture, gets none. */
#ifndef SESSION_NEWS_H
#define SESSION_NEWS_H

#include <stdbool.h>
#include <stdint.h>
#include <sys/stat.h>

#include "error.h"
#include "scene.h"
#include "session_report.h"

enum { SESSION_NEWS_LINES = 64 };

/* Rank 0's. */
typedef struct session_news {
    bool is_new;                     /* since the last text was made */
    int64_t count;                   /* number of warnings so far; the last SESSION_NEWS_LINES are kept */
    char *lines[SESSION_NEWS_LINES]; /* warning i is at i % SESSION_NEWS_LINES; NULL: there was no memory for it */
    int64_t cycles[SESSION_NEWS_LINES];
    base_error error; /* the error of the last step that failed or drew; empty if it drew */
} session_news;

/* The scene file, as the news tell of it. */
typedef struct session_news_scene {
    const scene *scene;
    const char *path;         /* as the caller gave it */
    const struct stat *stamp; /* the file's state when it was last read, accepted or not; NULL: there is no file */
    const char *refusal;      /* why the last edit was not taken; NULL: it was */
} session_news_scene;

/* Note the warnings of a step before the refusal of the scene file is added to them, and its error. Local. */
void session_note_news(session_news *news, const session_report *report, const base_error *error);

/* The text of report.json, from base_alloc(). NULL: no memory, and the news stay new. Local. */
char *session_make_news(session_news *news, const session_news_scene *source, const insitu_report *report);

/* Write report.json into the databases that have folders. Returns the first error. Local. */
insitu_status session_write_news(const scene *scene, const char *text, base_error *error);

void session_news_free(session_news *news);

#endif
