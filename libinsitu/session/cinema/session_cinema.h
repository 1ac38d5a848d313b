/* Cinema databases of Spec D: folders of pictures, each with three files that the session writes.
 *
 * data.csv is the table: a line of column names, then a line a picture, parameters first and its file last. data.js is
 * the same lines as a script, because a page that was opened from a disk may load a script but read no file; and
 * index.html is a page that shows the pictures by them.
 *
 * A table is kept in memory and written anew, all of it, at the end of each step that adds a line: into a new file that
 * then takes the old one's place, so that a run which is killed leaves a whole one. A line is some 60 bytes where a
 * picture is some 100,000: writing all lines again costs as much as the step's pictures after thousands of steps.
 * A session that begins takes over the lines of cycles before its own first one. */
#ifndef SESSION_CINEMA_H
#define SESSION_CINEMA_H

#include <stdbool.h>

#include "error.h"
#include "file.h"
#include "scene.h"

typedef struct session_table {
    const scene_database *database; /* the scene's */
    char *text;                     /* the whole lines of data.csv */
    size_t size, capacity;
    bool is_begun;      /* text has the folder's earlier lines */
    bool is_open;       /* a line of this step is in it */
    bool is_changed;    /* since the files were written */
    bool has_page;      /* this session has written index.html */
    int64_t last_cycle; /* the cycle of its last line */
} session_table;

/* Rank 0's. */
typedef struct session_cinema {
    bool has_begun;
    int64_t first_cycle; /* the first cycle of the session, or of the scene since it was edited */
    int count;
    session_table *tables; /* one a database of the scene; none before the first picture */
} session_cinema;

/* Say which cycle a step is of. Local. */
void session_begin_cinema(session_cinema *cinema, int64_t cycle);

/* Note a picture that was written for an output with a database. Where a step goes back in the run, lines from its
 * cycle on are dropped. Local. */
insitu_status session_note_picture(session_cinema *cinema, const scene *scene, const scene_image *image,
                                   const scene_output *output, const scene_moment *moment, base_error *error);

/* Write all tables that have changed, though some fail. Returns the first error; the next call tries the failed ones
 * again. Local. */
insitu_status session_write_cinema(session_cinema *cinema, base_error *error);

void session_cinema_free(session_cinema *cinema);

/* The path of a file of the database, from base_alloc(); NULL: no memory. */
char *session_database_file(const scene_database *database, const char *file);

/* Record that the file could not be `what`: "read" or "written". */
insitu_status session_fail_database(const scene_database *database, const char *file, const char *what,
                                    const file_failure *failure, base_error *error);

/* index.html, from session_cinema_page.html. */
extern const unsigned char session_cinema_page[];
extern const size_t session_cinema_page_size;

#endif
