/* Writes report.json into each database of the scene. The file contains the state of a run for programs that observe
 * the run, such as insitu-view: the cycle, time and error of the most recent step, the scene's state with the error of
 * its most recent edit, the scene's parameters, and the most recent warnings (docs/live.md).
 *
 * Rank 0 composes the text at the end of a step that has warnings or errors, or has drawn pictures. The writing thread
 * writes the file after the step's pictures. Before the first picture of a database is written, its folder does not
 * exist, and the file is not written to it. */
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
    bool is_new;   /* set if warnings or errors were added since the last text was made */
    int64_t count; /* number of warnings so far; the last SESSION_NEWS_LINES are kept */
    /* text of warning i, at index i % SESSION_NEWS_LINES; NULL: there was no memory for the text */
    char *lines[SESSION_NEWS_LINES];
    int64_t cycles[SESSION_NEWS_LINES]; /* cycle in which the warning at this index was added */
    /* error of the most recent step that has failed or has drawn pictures; empty if that step had no error */
    base_error error;
} session_news;

/* The scene file's state, as written into report.json. */
typedef struct session_news_scene {
    const scene *scene;
    const char *path; /* path of the file as given by the caller */
    /* state of the file when it was last read, whether it was accepted or not; NULL: there is no file */
    const struct stat *stamp;
    const char *pieces;  /* insitu_report.pieces; NULL: the report has no such text */
    const char *refusal; /* reason why the most recent edit of the scene was refused; NULL: it was accepted */
} session_news_scene;

/* Stores a step's error and its warnings. Must be called before the step's warnings include the error of a refused
 * scene file. Local. */
void session_record_step_messages(session_news *news, const session_report *report, const base_error *error);

/* Returns the text of report.json, allocated by base_alloc(). Returns NULL if memory runs out; is_new then remains set.
 * Local. */
char *session_compose_report_json(session_news *news, const session_news_scene *source, const insitu_report *report);

/* Writes report.json into the databases whose folders exist. Returns the first error. Local. */
insitu_status session_write_report_json(const scene *scene, const char *text, base_error *error);

void session_news_free(session_news *news);

#endif
