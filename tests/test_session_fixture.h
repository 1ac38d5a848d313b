/* The fixture of tests that call a session: a rank's part of a known mesh, as a caller passes it (session_input); scene
 * files; and caught pictures, which are intercepted before they are written because the fixture defines
 * session_write_image() in place of the library's function. Conditions are reduced over all ranks before they are
 * asserted, so that a failing rank does not leave the others waiting. */
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
 * texts (NULL texts are skipped). */
#define check_reported_everywhere(session, status, expected, ...)                                                      \
    assert_reported((session), (status), (expected), (const char *const[]){__VA_ARGS__, NULL}, __FILE__, __LINE__)
void assert_reported(const insitu_session *session, insitu_status status, insitu_status expected,
                     const char *const *words, const char *file, int line);

/* Returns the sum of the values, rounded once, divided by their number; NAN if there are none. The compensated sum has
 * an error of less than 2^-85 of the largest of 100 values. The result is therefore bitwise equal to that of the exact
 * sum unless the exact sum is this close to the middle between two doubles. */
double compute_mean(const double *values, int count);

double dot_product(const double a[3], const double b[3]);
void cross_product(const double a[3], const double b[3], double out[3]);

/* Compares two doubles, for qsort(). */
int compare_doubles(const void *a, const void *b);

/* Changes to the directory `name`, followed by the number of ranks, in the directory for scene files, so that runs on
 * different numbers of ranks have separate files. */
bool enter_test_folder(const char *name);

/* Reads a file on rank 0 into `size` bytes of text. The text is empty on other ranks, and if there is no file. */
void read_file(const char *path, size_t size, char *text);

/* Writes the file on rank 0. */
void write_text_file(const char *path, const char *text);

/* Runs an array of tests between MPI_Init and MPI_Finalize; argv[1] is a directory for scene files. begin, unless NULL,
 * is called before the tests, after own_rank, rank_count and the directory are set; end, unless NULL, is called after
 * the tests. Returns the result of main(). */
#define run_session_tests(argc, argv, tests, begin, end)                                                               \
    run_session_group((argc), (argv), (tests), sizeof(tests) / sizeof((tests)[0]), (begin), (end))
int run_session_group(int argc, char **argv, const struct CMUnitTest *tests, size_t count, CMFixtureFunction begin,
                      CMFixtureFunction end);

/* Writes a scene file on rank 0; returns its name on all ranks. All ranks must call it. */
const char *write_scene(const char *text);

insitu_session *open_session(MPI_Comm comm, const char *scene);

/* Opens a session with a scene of this text, and sets the mesh "m" and its field. */
insitu_session *open_session_with_mesh(MPI_Comm comm, const char *text, const insitu_mesh *mesh,
                                       const insitu_field *field);

/* A rank's part of a mesh, with its descriptions for the library. The arrays belong to the test_mesh; tests may corrupt
 * them. */
typedef struct session_input {
    test_mesh part;
    insitu_mesh mesh;
    insitu_field field; /* the field "f" at vertices */
    test_mesh_kind kind;
    int side, rank, count;
    test_partition_kind distributed;
} session_input;

/* Describes a part by types, offsets, ghost flags and faces, which point into the part. */
void describe_part(const test_mesh *part, insitu_mesh *mesh);

/* Creates the part of one rank of a mesh of the given kind. The mesh has side^3 cubes of cells, distributed over
 * `count` ranks. */
void input_create(session_input *in, test_mesh_kind kind, int side, test_partition_kind distributed, int rank,
                  int count);
/* Describes the part anew, after tests have changed its arrays or the description. */
void input_describe(session_input *in);
/* Restores the input to its state after input_create(). */
void input_restore(session_input *in);
void input_free(session_input *in);

/* Makes the mesh of this rank's cells. If with_ghosts is set, it also contains the cells of all other ranks, as
 * ghosts. */
void extract_own_cells(const test_mesh *whole, test_partition_kind distributed, int side, bool with_ghosts,
                       test_mesh *out);

/* Sets the mesh "m" and its field; returns the first status that is not OK. */
insitu_status submit_input(insitu_session *session, const session_input *in);

/* Checks that a step succeeds on every rank, and that it draws exactly one picture. */
void check_step_succeeds(insitu_session *session, int cycle);

typedef void corrupt_function(session_input *in);

/* An error of a user that the library must report. */
typedef struct corrupted_case {
    const char *name;
    corrupt_function *corrupt;
    insitu_status status;
    bool at_once;         /* whether the call that sets the mesh or the field fails, not only the step */
    const char *words[2]; /* texts that the message contains; may be NULL */
} corrupted_case;

/* Corrupts the input on the last rank only. Checks that at every step all ranks get the same message, which contains
 * that rank and the words of the case, and that no picture is drawn. Then restores the input and checks that the next
 * step draws. */
void check_fault_is_reported(insitu_session *session, session_input *in, const corrupted_case *c);

/* A scene with one small picture of "f". check_all_faults_are_reported() checks all cases in one session of this
 * scene. */
extern const char error_scene[];
void check_all_faults_are_reported(session_input *in, const corrupted_case *cases, size_t count);

/* A picture intercepted on rank 0 since the last discard_pictures(). */
typedef struct caught_picture {
    int width, height;
    float *rgba, *depth; /* depth is NULL if the image has none */
    int channel_count;
    float *data; /* data channels, each with all its pixels, one channel after another; NULL if there are none */
    /* samples of a deep picture, in the order of pixels; NULL if the picture is not deep */
    insitu_deep_sample *samples;
    /* index of each pixel's first sample, with the number of samples as the last of its pixels + 1 elements */
    int64_t *first;
    char path[256];
    char bars[400]; /* colour bars of the decorations, one line for each: its label, a colon, and its ticks */
    int64_t held;   /* number of bytes that the library had allocated when the picture was written */
} caught_picture;

enum { MAX_CAUGHT = 64 };
extern caught_picture caught[MAX_CAUGHT];
extern int caught_count;
void discard_pictures(void);
void free_caught(caught_picture *picture);

/* Returns the first picture that was caught on this rank, which the caller must free, and frees all others. The result
 * is empty if there is none, as on all ranks but rank 0, because only rank 0 of a session writes pictures. */
caught_picture pop_caught_picture(void);

/* Opens a session, passes the input, and makes a step, which must succeed on all ranks of the session. */
insitu_session *open_session_and_draw(MPI_Comm comm, const char *scene, const session_input *in);

/* Passes the input, makes a step, which must succeed, and destroys the session. Returns the step's picture. */
caught_picture submit_and_draw(insitu_session **session, const session_input *in);

/* Opens a session of the scene file and draws one picture, as submit_and_draw() does. */
caught_picture draw_scene(MPI_Comm comm, const char *scene, const session_input *in);

/* Returns whether two pictures are bitwise equal in all members except for the path. */
bool are_same_pictures(const caught_picture *a, const caught_picture *b);

/* Counts the pixels that are not transparent; 0 on ranks without the picture. */
int count_visible_pixels(const caught_picture *picture);

/* Counts the pixels of a picture of [-1, 1]^2 from 5 in front in which the front of a sphere of radius 0.72 is not
 * visible. Inside a cell the surface is at most half the diagonal of the largest cell, 0.22, away from the sphere.
 * Within a radius of 0.6 in the picture the sphere's front and back are at least 0.8 apart. */
int count_gap_pixels(const caught_picture *picture);

/* All pictures that a step draws. */
enum { MOST_DRAWN = 8 };
typedef struct drawn {
    int count;
    caught_picture pictures[MOST_DRAWN];
} drawn;

/* Returns the pictures caught on rank 0, which then belong to the caller; returns none on other ranks. */
drawn take_caught_pictures(void);
void free_picture_set(drawn *d);
/* Returns whether all pictures of two steps are bit-identical; prints the first that is not. */
bool are_same_picture_sets(const drawn *a, const drawn *b);
/* Makes a step, which must succeed on all ranks; returns its pictures. */
drawn step_and_take_pictures(insitu_session *session, int cycle);

/* Returns the number in a column, counted from 0, of the last line of a table with comma-separated columns; NAN if
 * there is none. */
double read_last_number(const char *text, int column);

/* Returns the largest difference of a colour component or of the opacity; infinity if the pictures have different
 * sizes. */
double largest_colour_difference(const caught_picture *a, const caught_picture *b);

/* If not NULL, writing any path that contains this text fails. */
extern const char *unwritable;

/* A picture that was placed into a larger picture since the last discard_pictures(), with its colour bars and with the
 * rectangles that other pictures will cover. */
typedef struct placed_picture {
    int x, y, width, height, of_width;
    int covered_count;
    insitu_rectangle covered[4];
    double size;     /* height of the text, in pixels; 0 without decorations */
    float colour[3]; /* colour of the text */
    char bars[200];
} placed_picture;

extern placed_picture placed[MAX_CAUGHT];
extern int placed_count;

/* If not NULL, called before each picture by the thread that writes pictures in the background, which exists only if
 * session_writes_behind (session_image.h) is set. If it is not set, pictures are written before a step ends. */
extern void (*before_writing)(void);

/* count: how often the library requested the image library to be loaded; by: the thread that requested it; ms: the
 * loading time that the fixture reports to the library. */
typedef struct library_loading {
    int count;
    pthread_t by;
    double ms;
} library_loading;

extern library_loading library_loaded;

/* The faults that the image library reports for the text of every picture. */
extern insitu_word_faults word_faults;

#endif
