/* Writes image databases in the format Cinema, Spec D. A database is a folder of pictures. The session writes three
 * more files to the folder.
 *
 * data.csv is the table: a line of column names, then one line per picture, with its parameters in the first columns
 * and its file in the final column. data.js contains the same lines as a script, because a browser lets a page that was
 * opened from a disk load scripts, but not read other files. index.html is a page that shows the pictures listed in
 * data.js.
 *
 * A table is kept in memory and written as a whole at the end of each step that adds a line. It is written to a new
 * file that then replaces the old one, so that the file is complete even if the run is killed. A line has about 60
 * bytes and a picture about 100,000, so that for the first thousands of steps, writing all lines takes less time
 * than writing the step's pictures. A new session keeps the lines of cycles before its own first cycle. */
#ifndef SESSION_CINEMA_H
#define SESSION_CINEMA_H

#include <stdbool.h>

#include "error.h"
#include "file.h"
#include "scene.h"

typedef struct session_table {
    const scene_database *database; /* the database, owned by the scene */
    char *text;                     /* the lines of data.csv that are complete */
    size_t size, capacity;
    bool has_earlier_lines; /* true: `text` includes the lines that the folder's file had before this session */
    bool has_lines_of_step; /* set if `text` contains a line of this step */
    bool is_changed;        /* set if the table has changed since the files were written */
    bool has_page;          /* set if this session has written index.html */
    int64_t last_cycle;     /* cycle of the table's last line */
} session_table;

/* The tables of all databases, on rank 0. */
typedef struct session_cinema {
    bool has_begun;      /* set if first_cycle is valid */
    int64_t first_cycle; /* first cycle of the session, or first cycle since the scene was edited */
    int count;
    session_table *tables; /* one table per database of the scene; NULL before the first picture */
} session_cinema;

/* Stores the first cycle: that of the session's first step, or of the first step after the scene was edited. Local. */
void session_store_first_cinema_cycle(session_cinema *cinema, int64_t cycle);

/* Adds a line for a picture that was written for an output with a database. If the picture's cycle is not later than
 * that of the table's final line, the run has gone back, and the lines of this cycle and of later cycles are removed
 * first. Local. */
insitu_status session_record_picture(session_cinema *cinema, const scene *scene, const scene_image *image,
                                     const scene_output *output, const scene_placeholder_values *moment,
                                     base_error *error);

/* Writes all tables that have changed, even if some fail. Returns the first error. Tables that failed are written again
 * by the next call. Local. */
insitu_status session_write_cinema(session_cinema *cinema, base_error *error);

void session_cinema_free(session_cinema *cinema);

/* Returns the path of a file of the database. It is allocated by base_alloc(); NULL if memory runs out. */
char *session_make_database_path(const scene_database *database, const char *file);

/* Stores an error with the message that the file could not be read or written, and returns its status; `what` is "read"
 * or "written". */
insitu_status session_fail_for_database_file(const scene_database *database, const char *file, const char *what,
                                             const file_failure *failure, base_error *error);

/* content of index.html, which is generated from session_cinema_page.html */
extern const unsigned char session_cinema_page[];
extern const size_t session_cinema_page_size;

#endif
