/* Whole steps of a session through the public interface alone, as a simulation would take them: the bench mesh on one
 * rank, with the same kind of change at every step. insitu_step() is timed from its call to the finished picture on
 * rank 0. The picture is not written: session_write_image() is defined here in place of the library's. */
#ifndef BENCH_SESSION_H
#define BENCH_SESSION_H

#include <stdio.h>

#include "bench_scene.h"
#include "insitu/insitu.h"

/* The change from the step before. */
typedef enum bench_change {
    BENCH_NEW_VALUES,
    BENCH_MOVED_VERTICES,
    BENCH_NEW_MESH, /* with all fields on it */
    BENCH_CHANGE_COUNT
} bench_change;

const char *bench_change_name(bench_change change);

typedef enum bench_picture {
    BENCH_ISOSURFACE,
    BENCH_ISOSURFACES,
    BENCH_VOLUME,
    BENCH_SMOOTH,      /* the isosurface by normals: vertex */
    BENCH_DIFFERENCES, /* by normals: differences */
    BENCH_SLICE,       /* by the plane through the origin with the normal bench_plane */
    BENCH_SURFACE,     /* the outer one, coloured by the field */
    BENCH_CLIPPED,     /* the same, cut by the plane */
    BENCH_EDGES,       /* the outer surface with the cells' edges */
    BENCH_ANTIALIASED, /* the outer surface by 4 samples a pixel */
    BENCH_Q_CRITERION, /* a slice of the Q criterion of a velocity, of 8 × 8 pixels: the criterion takes the time */
    BENCH_VORTICES,    /* an isosurface of the Q criterion */
    BENCH_LINED_SLICE, /* the slice, outer surface and isosurface with contour lines of the field */
    BENCH_LINED_SURFACE,
    BENCH_LINED_ISOSURFACE,
    BENCH_WARPED,   /* the outer surface of the mesh moved by the velocity, which is new at each step */
    BENCH_MIRRORED, /* of the mesh and its image in a side of the cube */
    BENCH_PLANES,   /* BENCH_PLANE_COUNT slices */
    BENCH_MONTAGE,  /* a slice, an outer surface, a clipped one and an isosurface side by side, a quarter as large */
    BENCH_PICTURE_COUNT
} bench_picture;

enum { BENCH_LINE_COUNT = 10, BENCH_PLANE_COUNT = 16, BENCH_VIEWS = 4 };

extern const double bench_plane[3];

/* The range of the colours, the value of the Q criterion, the scale of the displacements, and where the mirror is. */
extern const double bench_range[2], bench_vortex, bench_warp, bench_mirror;

const char *bench_picture_name(bench_picture picture);

/* Parts of a step, from the report. */
enum { BENCH_PARTS = 5 };

typedef struct bench_session {
    const bench_scene *scene;
    bench_picture picture;
    bench_change change;
    insitu_session *session;
    insitu_mesh mesh;
    insitu_field field;
    float *coordinates[2][3], *values[2]; /* [0] the scene's own */
    float *velocities[2];                 /* vertices × 3; NULL: the picture needs none */
    int place, phase;                     /* which of them are set */
    int64_t cycle;
    bench_series whole, parts[BENCH_PARTS];
    int64_t bytes_trees, bytes_peak;
} bench_session;

/* Opens a session with the scene that write() writes to the file; `of` is passed on. Errors end the process. */
insitu_session *bench_open_session(const bench_scene *scene, void (*write)(const void *of, FILE *file), const void *of);

/* Ends the process with the session's message if the status is an error. */
void bench_must(const bench_scene *scene, insitu_session *session, insitu_status status);

/* Writes the line of a scene file with the benchmarks' camera. */
void bench_write_camera(FILE *file);

/* The scene is borrowed; MPI is initialized. Some steps are taken, so that the session knows what changes and what does
 * not. */
void bench_session_create(bench_session *session, const bench_scene *scene, bench_picture picture, bench_change change);
void bench_session_free(bench_session *session);

/* Changes the mesh or field and steps; number 0 is the warm-up. */
void bench_session_step(bench_session *session, int number);

/* The arrays that are set now. */
const float *const *bench_session_coordinates(const bench_session *session);
const float *bench_session_values(const bench_session *session);
const float *bench_session_velocities(const bench_session *session);

/* Prints the times, as "isosurface new values", and those of the parts. */
void bench_session_print(bench_session *session);

/* Draws the arrays that are set now once more, in a session of its own, and returns the depths, width × height,
 * infinity where nothing is; the caller frees them. */
float *bench_session_depths(const bench_session *session);

#endif
