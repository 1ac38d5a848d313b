/* Hands the wave's arrays to libinsitu, and tells what it did. Read this part of the mini-app for an example. */
#ifndef WAVE_PICTURES_H
#define WAVE_PICTURES_H

#include <insitu/insitu.h>

#include "wave_options.h"
#include "wave_solver.h"

enum { WAVE_MESSAGES_MAX = 64 };

typedef struct wave_pictures {
    insitu_session *session; /* NULL: none wanted, or it could not be opened */
    const wave_options *options;
    const wave_mesh *mesh;
    const wave_solver *solver;
    int rank;
    uint8_t *ghosts;   /* one a cell, where they are handed over */
    bool handed_over;  /* the mesh has been handed over once */
    int images;        /* drawn so far */
    int message_count; /* errors and warnings shown so far, by hash */
    uint64_t messages[WAVE_MESSAGES_MAX];
} wave_pictures;

/* Open a session. Without one the simulation runs all the same, and the reason has been shown. Collective. */
void wave_pictures_open(const wave_options *options, const wave_mesh *mesh, const wave_solver *solver, MPI_Comm comm,
                        wave_pictures *pictures);

/* Take the source's strength and period from the scene's parameters; 1 and 0 (one pulse) where it has none. Local. */
void wave_pictures_steer(wave_pictures *pictures, wave_source *source);

/* Hand the arrays over and draw the images that are due. Returns this rank's report, all zero without a session.
 * Collective. */
insitu_report wave_pictures_step(wave_pictures *pictures, int64_t cycle, double time);

/* Collective. */
void wave_pictures_close(wave_pictures *pictures);

#endif
