/* Computes the wave on one rank's part of the mesh: its arrays, its time step, and its sums over all ranks. */
#ifndef WAVE_SOLVER_H
#define WAVE_SOLVER_H

#include "wave_halo.h"
#include "wave_kernel.h"

typedef struct wave_setup {
    int real_bytes;  /* size in bytes of a floating-point number in all arrays, those that are computed and those that
                        are drawn: 4 or 8 */
    bool is_soa;     /* components are in separate arrays (SoA); otherwise interleaved (AoS) */
    bool reflecting; /* true if walls are rigid, false if they absorb */
    int order;       /* order of the scheme: 1 or 2 */
    bool vertices;   /* true if the state at vertices is computed even in the first-order scheme */
    double swell;    /* exaggeration of the displacement of drawn vertices; 0 if they do not move */
    double courant;  /* time step as a fraction of the largest stable one; 0 means 0.9 */
    wave_medium medium;
    wave_source source; /* source of the wave; an amplitude of 0 means that there is no source */
} wave_setup;

typedef struct wave_solver {
    wave_setup setup;
    const wave_mesh *mesh; /* mesh, borrowed from the caller */
    const wave_kernel *kernel;
    MPI_Comm comm; /* communicator, borrowed from the caller */
    wave_grid grid;
    wave_halo halo;
    void *vertex_cell_weights, *faces,
        *inverse_volume; /* arrays that the solver owns and whose addresses it has stored in `grid` */
    uint8_t *layers;
    void *speed;               /* real; speed of sound in each cell */
    double *volume;            /* volume of each own cell */
    int32_t source_cell_count; /* number of own cells within the source's ball */
    int32_t *source_cells;
    double *source_rates; /* for each cell of source_cells: change of pressure per unit time for a source rate of 1 */
    double time_step, time;
} wave_solver;

/* Sums, and the maximum of the pressure, over the cells of all ranks. */
typedef struct wave_totals {
    double volume;
    double mass;   /* sum of V p / K: the injected volume */
    double energy; /* sum of V (p^2 / 2K + rho u^2 / 2) */
    double peak;   /* maximum of the pressure |p| */
} wave_totals;

/* Creates the local arrays. Returns false if memory ran out; ranks must agree on this before the next collective call.
 * Local. */
bool wave_solver_create(const wave_setup *setup, const wave_mesh *mesh, MPI_Comm comm, wave_solver *solver);
void wave_solver_free(wave_solver *solver);

/* wave_solver_set() sets, and wave_solver_get() returns, the pressure and velocity of an own cell. Values may be set
 * only before wave_solver_start(). Local. */
void wave_solver_set(wave_solver *solver, int32_t cell, const double state[4]);
void wave_solver_get(const wave_solver *solver, int32_t cell, double state[4]);
void wave_solver_compute_centroid(const wave_solver *solver, int32_t cell, double xyz[3]);

/* Agrees with all ranks on the time step, and updates halo cells and vertices to the state that was set. Collective. */
void wave_solver_start(wave_solver *solver);

/* Performs one time step. Afterwards all cells, and the vertices of own cells, are up to date. Collective. */
void wave_solver_step(wave_solver *solver);

/* Computes the totals of the current state. Collective. */
wave_totals wave_solver_compute_totals(const wave_solver *solver);

#endif
