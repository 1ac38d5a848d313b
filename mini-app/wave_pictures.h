/* Passes the wave's arrays to libinsitu and prints its messages. This part of the mini-app is an example for other
 * codes. */
#ifndef WAVE_PICTURES_H
#define WAVE_PICTURES_H

#include <insitu/insitu.h>

#include "wave_options.h"
#include "wave_solver.h"

enum { WAVE_MESSAGES_MAX = 64 };

typedef struct wave_pictures {
    insitu_session *session; /* NULL if no pictures are drawn, or if the session could not be opened */
    const wave_options *options;
    const wave_mesh *mesh;
    const wave_solver *solver;
    int rank;
    uint8_t *ghosts;   /* one ghost flag per cell; NULL unless halo cells are passed */
    bool is_mesh_set;  /* true if the mesh has been set on the session */
    int images;        /* number of images drawn so far */
    int message_count; /* number of errors and warnings printed so far; `messages` contains their hashes */
    uint64_t messages[WAVE_MESSAGES_MAX];
} wave_pictures;

/* Opens a session. If it cannot be opened, prints the reason; the simulation then runs without pictures. Collective. */
void wave_pictures_open(const wave_options *options, const wave_mesh *mesh, const wave_solver *solver, MPI_Comm comm,
                        wave_pictures *pictures);

/* Sets the source's strength and period from the scene's parameters, or to 1 and 0 (a single pulse) if the scene has
 * none. Local. */
void wave_pictures_update_source(wave_pictures *pictures, wave_source *source);

/* Passes the arrays and draws the images that are due. Returns this rank's report; without a session, all its members
 * are 0. Collective. */
insitu_report wave_pictures_step(wave_pictures *pictures, int64_t cycle, double time);

/* Closes the session. Collective. */
void wave_pictures_close(wave_pictures *pictures);

#endif
