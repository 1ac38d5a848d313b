/* Sessions under test: a rank's part of a known mesh as a caller passes it, scene files, and pictures intercepted
 * before they are written (the fixture defines session_write_image() in place of the library's). Results are reduced
 * before they are asserted, so that a failing rank does not leave the others waiting. */
#ifndef TEST_SESSION_FIXTURE_H
#define TEST_SESSION_FIXTURE_H

#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "insitu/image_output.h"
#include "insitu/insitu.h"
#include "test_meshes.h"

extern int own_rank, rank_count;

#define everywhere(condition) assert_everywhere((condition), #condition, __FILE__, __LINE__)
void assert_everywhere(bool is_well, const char *what, const char *file, int line);

/* Checks that every rank has the expected status and the same message, and that the message contains all the given
 * words (NULL words are skipped). */
#define check_reported_everywhere(session, status, expected, ...)                                                      \
    assert_reported((session), (status), (expected), (const char *const[]){__VA_ARGS__, NULL}, __FILE__, __LINE__)
void assert_reported(const insitu_session *session, insitu_status status, insitu_status expected,
                     const char *const *words, const char *file, int line);

/* Returns the values' sum, rounded once, divided by their number; NAN if there are none. The compensated sum is off by
 * less than 2^-85 of the largest of 100 values, so that the result has the bits of the exact sum unless that is this
 * close to a tie. */
double compute_mean(const double *values, int count);

/* Changes to a directory named by `name` and the number of ranks, inside the directory for scene files, so that each
 * number of ranks has its own files. */
bool enter_test_folder(const char *name);

/* Reads rank 0's file into size bytes of text, which is empty on other ranks and if there is no file. */
void read_file(const char *path, size_t size, char *text);

/* Writes the file on rank 0. */
void write_text_file(const char *path, const char *text);

/* Runs an array of tests between MPI_Init and MPI_Finalize; argv[1] is a directory for scene files. begin and end,
 * unless NULL, are called before and after the tests, when the ranks and the directory are set. Returns main's
 * result. */
#define run_session_tests(argc, argv, tests, begin, end)                                                               \
    run_session_group((argc), (argv), (tests), sizeof(tests) / sizeof((tests)[0]), (begin), (end))
int run_session_group(int argc, char **argv, const struct CMUnitTest *tests, size_t count, CMFixtureFunction begin,
                      CMFixtureFunction end);

/* Writes a scene file on rank 0; returns its name on all ranks. */
const char *write_scene(const char *text);

insitu_session *open_session(MPI_Comm comm, const char *scene);

/* Opens a session with the text of a scene, and sets mesh "m" with its field. */
insitu_session *open_session_with_mesh(MPI_Comm comm, const char *text, const insitu_mesh *mesh,
                                       const insitu_field *field);

/* A rank's part of a mesh, and its description; the arrays belong to the test_mesh, and tests may corrupt them. */
typedef struct session_input {
    test_mesh part;
    insitu_mesh mesh;
    insitu_field field; /* the field "f" at vertices */
    test_mesh_kind kind;
    int side, rank, count;
    test_partition_kind distributed;
} session_input;

/* Describes a part with types, offsets, ghosts and faces. */
void describe_part(const test_mesh *part, insitu_mesh *mesh);

/* Creates the part of one rank of a mesh of hexes or any other kind: side^3 cubes, distributed over count ranks. */
void input_create(session_input *in, test_mesh_kind kind, int side, test_partition_kind distributed, int rank,
                  int count);
/* Describes the part again after it was corrupted. */
void input_describe(session_input *in);
/* Restores the input to its state after input_create(). */
void input_restore(session_input *in);
void input_free(session_input *in);

/* Makes the mesh of this rank's cells; with ghosts: of all cells, of which those of other ranks are ghosts. */
void extract_own_cells(const test_mesh *whole, test_partition_kind distributed, int side, bool with_ghosts,
                       test_mesh *out);

/* Sets the mesh "m" and its field; returns the first status that is not OK. */
insitu_status submit_input(insitu_session *session, const session_input *in);

/* Checks that a step succeeds on every rank and draws its one picture. */
void check_step_succeeds(insitu_session *session, int cycle);

typedef void corrupt_function(session_input *in);

/* An error that a user makes. */
typedef struct corrupted_case {
    const char *name;
    corrupt_function *corrupt;
    insitu_status status;
    bool at_once;         /* the set call fails too */
    const char *words[2]; /* texts of the message */
} corrupted_case;

/* Corrupts the input on the last rank only. Checks that at every step all ranks get the same message, with the rank and
 * the words of the case, that no picture is drawn, and that after the input is restored the next step draws. */
void check_fault_is_reported(insitu_session *session, session_input *in, const corrupted_case *c);

/* A scene with one small picture of "f", for the error cases; check_all_faults_are_reported() checks each case in a
 * session of this scene. */
extern const char error_scene[];
void check_all_faults_are_reported(session_input *in, const corrupted_case *cases, size_t count);

/* A picture intercepted on rank 0 since the last discard_pictures(). */
typedef struct caught_picture {
    int width, height;
    float *rgba, *depth; /* depth is NULL if none was given */
    int channel_count;
    float *data;                 /* the channels one after the other; NULL if there are none */
    insitu_deep_sample *samples; /* samples of a deep picture, pixel by pixel; else NULL */
    int64_t *first;              /* index of each pixel's first sample; pixels + 1 elements */
    char path[256];
    char bars[400]; /* colour bars of the decorations: for each a line with the label, a colon and its ticks */
    int64_t held;   /* bytes that the library had allocated when the picture was written */
} caught_picture;

enum { MAX_CAUGHT = 64 };
extern caught_picture caught[MAX_CAUGHT];
extern int caught_count;
void discard_pictures(void);
void free_caught(caught_picture *picture);

/* Returns the first picture that this rank has intercepted, which the caller must free, and frees the others. The
 * result is empty if there is none: only rank 0 of a session writes pictures. */
caught_picture pop_caught_picture(void);

/* Opens a session, passes the input, and makes a step, which must succeed. */
insitu_session *open_session_and_draw(MPI_Comm comm, const char *scene, const session_input *in);

/* Passes the input, makes a step, which must succeed, returns its picture, and destroys the session. */
caught_picture submit_and_draw(insitu_session **session, const session_input *in);

/* Opens a session of the scene file and draws one picture as submit_and_draw() does. */
caught_picture draw_scene(MPI_Comm comm, const char *scene, const session_input *in);

/* Returns whether everything that was intercepted has the same bits, except for the path. */
bool are_same_pictures(const caught_picture *a, const caught_picture *b);

/* All pictures of a step. */
enum { MOST_DRAWN = 8 };
typedef struct drawn {
    int count;
    caught_picture pictures[MOST_DRAWN];
} drawn;

/* Returns the pictures intercepted on rank 0, which the caller then owns; on other ranks none. */
drawn take_caught_pictures(void);
void free_picture_set(drawn *d);
/* Returns whether all pictures have the same bits, and reports the first that does not. */
bool are_same_picture_sets(const drawn *a, const drawn *b);
/* Makes a step, which must succeed on all ranks, and returns its pictures. */
drawn step_and_take_pictures(insitu_session *session, int cycle);

/* Returns the number in this column, counted from 0, of the last line of a table whose columns are separated by commas;
 * NAN if there is none. */
double read_last_number(const char *text, int column);

/* Returns the largest difference of a colour or the opacity; infinite if the pictures have different sizes. */
double largest_colour_difference(const caught_picture *a, const caught_picture *b);

/* Paths that contain this text cannot be written; NULL: all paths can be written. */
extern const char *unwritable;

/* A picture put into a larger one since the last forget_pictures(), with its colour bars, and the rectangles that other
 * pictures will cover. */
typedef struct placed_picture {
    int x, y, width, height, of_width;
    int covered_count;
    insitu_rectangle covered[4];
    double size;     /* size of the text, in pixels; 0 without decorations */
    float colour[3]; /* colour of the text */
    char bars[200];
} placed_picture;

extern placed_picture placed[MAX_CAUGHT];
extern int placed_count;

/* The thread that writes pictures calls this before each picture, if it is not NULL and session_writes_behind
 * (session_image.h) is set. If session_writes_behind is not set, pictures are written before a step ends. */
extern void (*before_writing)(void);

/* How often the library requested the image library to be loaded, by which thread, and how long the fixture reports
 * that loading took. */
typedef struct library_loading {
    int count;
    pthread_t by;
    double ms;
} library_loading;

extern library_loading library_loaded;

/* The faults that the image library reports for the text of every picture. */
extern insitu_word_faults word_faults;

#endif
