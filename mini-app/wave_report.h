/* A line per step and a summary, on rank 0's stdout. */
#ifndef WAVE_REPORT_H
#define WAVE_REPORT_H

#include <insitu/insitu.h>

#include "wave_options.h"
#include "wave_solver.h"

typedef struct wave_report {
    MPI_Comm comm;
    int rank;
    double memory_before;            /* bytes resident before libinsitu was opened, on this rank */
    double simulation_ms, insitu_ms; /* so far, the slowest rank of each step */
    double bytes_peak, bytes_grown;  /* the most so far, of any rank */
} wave_report;

/* Collective; prints what is about to run. */
void wave_report_begin(MPI_Comm comm, const wave_options *options, const wave_mesh *mesh, const wave_solver *solver,
                       wave_report *report);

/* One step: the worst of all ranks in each column. Collective. */
void wave_report_step(wave_report *report, int64_t cycle, double time, double simulation_ms, double insitu_ms,
                      const insitu_report *insitu);

/* Collective. images < 0: there was no session. */
void wave_report_end(const wave_report *report, const wave_options *options, const wave_solver *solver, int images);

#endif
