/* Takes whole steps of a session as a simulation does, through the public interface only. The mesh is that of the
 * benchmarks, on one rank, and the same kind of data changes at every step. insitu_step() is timed from its call to the
 * finished picture on rank 0. The picture is not written: this module defines session_write_image() in place of the
 * library's. */
#ifndef BENCH_SESSION_H
#define BENCH_SESSION_H

#include <stdio.h>

#include "bench_scene.h"
#include "insitu/insitu.h"

/* The data that change from step to step. */
typedef enum bench_change {
    BENCH_NEW_VALUES,
    BENCH_MOVED_VERTICES,
    BENCH_NEW_MESH, /* a new mesh with new fields */
    BENCH_CHANGE_COUNT
} bench_change;

const char *bench_change_name(bench_change change);

typedef enum bench_picture {
    BENCH_ISOSURFACE,
    BENCH_ISOSURFACES,
    BENCH_VOLUME,
    BENCH_SMOOTH,      /* the isosurface with `normals: vertex` */
    BENCH_DIFFERENCES, /* the isosurface with `normals: differences` */
    BENCH_SLICE,       /* the plane through the origin with the normal bench_plane */
    BENCH_SURFACE,     /* the outer surface, coloured by the field */
    BENCH_CLIPPED,     /* the outer surface, cut by the plane of the slice */
    BENCH_EDGES,       /* the outer surface with the edges of cells */
    BENCH_ANTIALIASED, /* the outer surface with 4 samples per pixel */
    BENCH_Q_CRITERION, /* slice of a velocity's Q criterion; 8 × 8 pixels, so computing it takes most time */
    BENCH_VORTICES,    /* an isosurface of the Q criterion */
    BENCH_LINED_SLICE, /* the slice, outer surface and isosurface, each with contour lines of the field */
    BENCH_LINED_SURFACE,
    BENCH_LINED_ISOSURFACE,
    BENCH_WARPED,   /* the outer surface of the mesh displaced by the velocity, which changes at each step */
    BENCH_MIRRORED, /* the outer surface of the mesh and its mirror image in a side of the cube */
    BENCH_PLANES,   /* BENCH_PLANE_COUNT slices */
    BENCH_MONTAGE,  /* slice, outer surface, clipped surface and isosurface, side by side at half width and height */
    BENCH_PICTURE_COUNT
} bench_picture;

enum { BENCH_LINE_COUNT = 10, BENCH_PLANE_COUNT = 16, BENCH_VIEWS = 4 };

extern const double bench_plane[3];

/* bench_range: range of the colours; bench_vortex: isovalue of the Q criterion; bench_warp: scale of the displacements;
 * bench_mirror: x coordinate of the mirror plane */
extern const double bench_range[2], bench_vortex, bench_warp, bench_mirror;

const char *bench_picture_name(bench_picture picture);

/* Number of parts of a step in the report. */
enum { BENCH_PARTS = 5 };

typedef struct bench_session {
    const bench_scene *scene;
    bench_picture picture;
    bench_change change;
    insitu_session *session;
    insitu_mesh mesh;
    insitu_field field;
    float *coordinates[2][3], *values[2]; /* two states; [0] is that of the scene */
    float *velocities[2];                 /* vertices × 3; NULL if the picture needs none */
    /* place: index of the current coordinates; phase: index of the current values and velocities */
    int place, phase;
    int64_t cycle;
    bench_series whole, parts[BENCH_PARTS];
    int64_t bytes_trees, bytes_peak;
} bench_session;

/* Opens a session with the scene file that write() writes; `of` is its first argument. Errors end the process. */
insitu_session *bench_open_session(const bench_scene *scene, void (*write)(const void *of, FILE *file), const void *of);

/* If the status is an error, prints the session's message and ends the process. */
void bench_require_success(const bench_scene *scene, insitu_session *session, insitu_status status);

/* Writes the line of a scene file with the benchmarks' camera. */
void bench_write_camera(FILE *file);

/* Creates a session and takes the warm-up steps, in which the session detects what changes and what does not. The scene
 * is borrowed, and MPI must be initialized. */
void bench_session_create(bench_session *session, const bench_scene *scene, bench_picture picture, bench_change change);
void bench_session_free(bench_session *session);

/* Changes the mesh or field and takes a step. Step number 0 is a warm-up; its time is dropped. */
void bench_session_step(bench_session *session, int number);

/* The following functions return the arrays that are currently set. */
const float *const *bench_session_coordinates(const bench_session *session);
const float *bench_session_values(const bench_session *session);
const float *bench_session_velocities(const bench_session *session);

/* Prints the times of the steps as a measure such as "isosurface new values", and the times of the parts of a step. */
void bench_session_print(bench_session *session);

/* Draws the current arrays in a separate session. Returns the depths, width × height, infinity in empty pixels; the
 * caller frees them. */
float *bench_session_draw_depths(const bench_session *session);

#endif
