/* Sessions under test: a rank's part of a known mesh as a caller would hand it over, scene files, and pictures caught
 * before they are written (this defines session_write_image() in place of the library's).
 *
 * Verdicts are reduced before they are asserted, so that a failing rank does not leave the others waiting. */
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

/* Every rank was told the same, and it holds all of the count words (NULL ones are passed over). */
#define reported_everywhere(session, status, expected, ...)                                                            \
    assert_reported((session), (status), (expected), (const char *const[]){__VA_ARGS__, NULL}, __FILE__, __LINE__)
void assert_reported(const insitu_session *session, insitu_status status, insitu_status expected,
                     const char *const *words, const char *file, int line);

/* Returns the values' sum, rounded once, divided by their number; NAN if there are none. Recentring leaves out less
 * than 2^-85 of the largest of 100 values, so that it has the same bits unless a sum is that near to a tie. */
double mean_of(const double *values, int count);

/* Goes into a folder of this name and the count of ranks, within the folder for scene files: each count's files are
 * apart. */
bool enter_folder(const char *name);

/* Reads rank 0's file into size bytes of text, which is empty on other ranks and where there is no file. */
void read_file(const char *path, size_t size, char *text);

/* Rank 0 writes the file. */
void put_file(const char *path, const char *text);

/* Runs the tests, an array, between MPI_Init and MPI_Finalize; argv[1] is a folder for scene files. begin and end,
 * unless NULL, are called before and after them, with the ranks and the folder set. Returns what main returns. */
#define run_session_tests(argc, argv, tests, begin, end)                                                               \
    run_session_group((argc), (argv), (tests), sizeof(tests) / sizeof((tests)[0]), (begin), (end))
int run_session_group(int argc, char **argv, const struct CMUnitTest *tests, size_t count, CMFixtureFunction begin,
                      CMFixtureFunction end);

/* Rank 0 writes a scene file, which all then know by this name. */
const char *write_scene(const char *text);

insitu_session *open_session(MPI_Comm comm, const char *scene);

/* Opens a session on the text of a scene, and sets mesh "m" with its field. */
insitu_session *open_mesh(MPI_Comm comm, const char *text, const insitu_mesh *mesh, const insitu_field *field);

/* A rank's part of a mesh, and its description; the arrays are the test_mesh's, which tests may spoil. */
typedef struct session_input {
    test_mesh part;
    insitu_mesh mesh;
    insitu_field field; /* "f", at vertices */
    test_mesh_kind kind;
    int side, rank, count;
    test_partition_kind distributed;
} session_input;

/* Describes a part as it is: with types, offsets, ghosts and faces. */
void describe_part(const test_mesh *part, insitu_mesh *mesh);

/* Hexes or any kind, side^3 cubes, dealt to count ranks; the part of rank. */
void input_create(session_input *in, test_mesh_kind kind, int side, test_partition_kind distributed, int rank,
                  int count);
/* Describe the part again, after it was spoilt. */
void input_describe(session_input *in);
/* Restores the input as it was created. */
void input_renew(session_input *in);
void input_free(session_input *in);

/* This rank's cells of the whole; with ghosts: all cells, of which the others' are ghosts. */
void extract_own_cells(const test_mesh *whole, test_partition_kind distributed, int side, bool with_ghosts,
                       test_mesh *out);

/* Set the mesh "m" and its field; the first status that is not OK. */
insitu_status submit(insitu_session *session, const session_input *in);

/* The step is well on every rank, and its one picture is drawn. */
void step_is_good(insitu_session *session, int cycle);

typedef void corrupt_function(session_input *in);

/* A thing that a user gets wrong. */
typedef struct corrupted_case {
    const char *name;
    corrupt_function *corrupt;
    insitu_status status;
    bool at_once;         /* the set call fails too */
    const char *words[2]; /* of the message */
} corrupted_case;

/* Spoilt on the last rank alone, at every step all ranks are told the same, with the rank and the words in it, and no
 * picture is drawn; once the input is renewed the next step draws. */
void corrupted_is_reported_on_all_ranks(insitu_session *session, session_input *in, const corrupted_case *c);

/* A scene of one small picture of "f", to which that is told; and each of the cases in a session of it. */
extern const char error_scene[];
void all_are_reported(session_input *in, const corrupted_case *cases, size_t count);

/* Pictures caught on rank 0 since the last discard_pictures(). */
typedef struct caught_picture {
    int width, height;
    float *rgba, *depth; /* depth NULL where none was given */
    int channel_count;
    float *data;                 /* the channels one after the other; NULL where there are none */
    insitu_deep_sample *samples; /* of a deep picture, pixel by pixel; else NULL */
    int64_t *first;              /* pixels + 1: of samples */
    char path[256];
    char bars[400]; /* of decorations: a line each, the label, a colon and its ticks */
    int64_t held;   /* bytes that the library held when it was written */
} caught_picture;

enum { MAX_CAUGHT = 64 };
extern caught_picture caught[MAX_CAUGHT];
extern int caught_count;
void discard_pictures(void);
void free_caught(caught_picture *picture);

/* Returns the first picture that this rank has caught, which the caller must free, and frees the others. Empty if the
 * rank has caught none: pictures are written by rank 0 of a session. */
caught_picture pop_caught_picture(void);

/* Opens a session, hands the input over, and takes a step, which is to be well. */
insitu_session *open_drawn(MPI_Comm comm, const char *scene, const session_input *in);

/* Hands the input over, takes a step, which is to be well, and its picture, and destroys the session. */
caught_picture draw_once(insitu_session **session, const session_input *in);

/* As above, with a session of the scene file. */
caught_picture draw_scene(MPI_Comm comm, const char *scene, const session_input *in);

/* Tells whether all that was caught has the same bits but the path. */
bool same_pictures(const caught_picture *a, const caught_picture *b);

/* All pictures of a step. */
enum { MOST_DRAWN = 8 };
typedef struct drawn {
    int count;
    caught_picture pictures[MOST_DRAWN];
} drawn;

/* The pictures caught on rank 0, from now on the caller's; on other ranks none. */
drawn take_drawn(void);
void free_drawn(drawn *d);
/* Returns whether all pictures have the same bits, and reports the first that does not. */
bool same_drawn(const drawn *a, const drawn *b);
/* Takes a step, which must succeed on all ranks, and its pictures. */
drawn step_drawn(insitu_session *session, int cycle);

/* Returns the number in this column, counted from 0, of the last line of a table whose columns are parted by commas;
 * NAN if there is none. */
double last_number(const char *text, int column);

/* The largest difference of a colour's or the opacity's; infinite if the pictures have other sizes. */
double colour_difference(const caught_picture *a, const caught_picture *b);

/* Paths with this in them cannot be written. NULL: all can. */
extern const char *unwritable;

/* What was put into places of larger pictures since the last forget_pictures(), with its colour bars, and the parts
 * that others will cover. */
typedef struct placed_picture {
    int x, y, width, height, of_width;
    int covered_count;
    insitu_rectangle covered[4];
    double size;     /* of words, in pixels; 0 without decorations */
    float colour[3]; /* of words */
    char bars[200];
} placed_picture;

extern placed_picture placed[MAX_CAUGHT];
extern int placed_count;

/* Pictures are written before a step is over, unless session_writes_behind (session_image.h) is set. Then the writing
 * thread first calls this, if it is not NULL. */
extern void (*before_writing)(void);

/* How often the image library was to be loaded, by which thread, and how long that is said to have taken. */
typedef struct library_loading {
    int count;
    pthread_t by;
    double ms;
} library_loading;

extern library_loading library_loaded;

/* What the image library finds wrong with the words of every picture. */
extern insitu_word_faults word_faults;

#endif
