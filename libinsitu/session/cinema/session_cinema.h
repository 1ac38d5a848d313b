/* Cinema databases of Spec D: folders of pictures, each with three files that the session writes.
 *
 * data.csv is the table: a line of column names, then a line per picture, its parameters first and its file last.
 * data.js has the same lines as a script, because a page that was opened from a disk may load a script but not read a
 * file. index.html is a page that shows the pictures by these lines.
 *
 * A table is kept in memory and written as a whole at the end of each step that adds a line: into a new file that then
 * replaces the old one, so that a run that is killed leaves a complete file. A line has about 60 bytes and a picture
 * about 100,000: writing all lines again costs as much as the step's pictures only after thousands of steps. A new
 * session keeps the lines of cycles before its own first one. */
#ifndef SESSION_CINEMA_H
#define SESSION_CINEMA_H

#include <stdbool.h>

#include "error.h"
#include "file.h"
#include "scene.h"

typedef struct session_table {
    const scene_database *database; /* borrowed from the scene */
    char *text;                     /* the complete lines of data.csv */
    size_t size, capacity;
    bool is_begun;      /* text contains the folder's earlier lines */
    bool is_open;       /* text holds a line of this step */
    bool is_changed;    /* changed since the files were written */
    bool has_page;      /* this session has written index.html */
    int64_t last_cycle; /* cycle of its last line */
} session_table;

/* The databases' tables, on rank 0. */
typedef struct session_cinema {
    bool has_begun;
    int64_t first_cycle; /* the first cycle of the session, or since the scene was edited */
    int count;
    session_table *tables; /* one per database of the scene; none before the first picture */
} session_cinema;

/* Records the cycle of the first step (of the session, or since the scene was edited). Local. */
void session_begin_cinema(session_cinema *cinema, int64_t cycle);

/* Adds a line for a picture that was written for an output with a database. If a step goes back in the run, lines from
 * its cycle on are dropped. Local. */
insitu_status session_note_picture(session_cinema *cinema, const scene *scene, const scene_image *image,
                                   const scene_output *output, const scene_moment *moment, base_error *error);

/* Writes all tables that have changed, even if some fail. Returns the first error; the next call tries the failed ones
 * again. Local. */
insitu_status session_write_cinema(session_cinema *cinema, base_error *error);

void session_cinema_free(session_cinema *cinema);

/* Returns the path of a file of the database, from base_alloc(); NULL if there is no memory. */
char *session_database_file(const scene_database *database, const char *file);

/* Records that the file could not be `what`: "read" or "written". */
insitu_status session_fail_database(const scene_database *database, const char *file, const char *what,
                                    const file_failure *failure, base_error *error);

/* index.html, from session_cinema_page.html. */
extern const unsigned char session_cinema_page[];
extern const size_t session_cinema_page_size;

#endif
