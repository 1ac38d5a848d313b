/* The wave on one rank's part of the mesh: its arrays, its time step, its sums over all ranks. */
#ifndef WAVE_SOLVER_H
#define WAVE_SOLVER_H

#include "wave_halo.h"
#include "wave_kernel.h"

typedef struct wave_setup {
    int real_bytes;  /* 4 or 8: of all values, computed on and handed over */
    bool apart;      /* components in arrays of their own (SoA), else interleaved (AoS) */
    bool reflecting; /* walls are rigid, else they absorb */
    int order;       /* 1 or 2 */
    bool vertices;   /* keep the state at vertices, which order 2 needs anyway */
    double swell;    /* vertices are drawn displaced by the wave, exaggerated by this; 0: they rest */
    double courant;  /* share of the time step that the smallest cell allows; 0: 0.9 */
    wave_medium medium;
    wave_source source; /* amplitude 0: none */
} wave_setup;

typedef struct wave_solver {
    wave_setup setup;
    const wave_mesh *mesh; /* borrowed */
    const wave_kernel *kernel;
    MPI_Comm comm; /* borrowed */
    wave_grid grid;
    wave_halo halo;
    void *around_weights, *faces, *inverse_volume; /* the grid's, owned */
    uint8_t *layers;
    void *speed;       /* real, cells: speed of sound */
    double *volume;    /* own cells */
    int32_t fed_count; /* own cells within the source */
    int32_t *fed;
    double *fed_rate; /* pressure that a unit of the source's rate adds to each per unit time */
    double time_step, time;
} wave_solver;

/* Sums over all ranks. */
typedef struct wave_totals {
    double volume;
    double mass;   /* sum of V p / K: the injected volume */
    double energy; /* sum of V (p^2 / 2K + rho u^2 / 2) */
    double peak;   /* greatest |p| */
} wave_totals;

/* Makes the local arrays. False where memory ran out: ranks must agree on that before the next collective call. Local.
 */
bool wave_solver_create(const wave_setup *setup, const wave_mesh *mesh, MPI_Comm comm, wave_solver *solver);
void wave_solver_free(wave_solver *solver);

/* Set or get pressure and velocity of an own cell, the former before wave_solver_start(). Local. */
void wave_solver_set(wave_solver *solver, int32_t cell, const double state[4]);
void wave_solver_get(const wave_solver *solver, int32_t cell, double state[4]);
void wave_solver_centroid(const wave_solver *solver, int32_t cell, double xyz[3]);

/* Agree on the time step and bring halo and vertices up to the state that was set. Collective. */
void wave_solver_start(wave_solver *solver);

/* One time step. Afterwards all cells, and the vertices of own cells, are up to date. Collective. */
void wave_solver_step(wave_solver *solver);

/* Collective. */
wave_totals wave_solver_totals(const wave_solver *solver);

#endif
