/* Prints a line per step and a summary to rank 0's stdout. */
#ifndef WAVE_REPORT_H
#define WAVE_REPORT_H

#include <insitu/insitu.h>

#include "wave_options.h"
#include "wave_solver.h"

typedef struct wave_report {
    MPI_Comm comm;
    int rank;
    double memory_before; /* this rank's resident memory in bytes before libinsitu was opened */
    double simulation_ms,
        insitu_ms; /* sums of the times of all steps so far; the time of a step is that of its slowest rank */
    /* Maxima over all ranks and steps so far, in bytes. bytes_peak: peak of the memory that libinsitu has allocated
     * (insitu_report.bytes_peak); bytes_grown: resident memory of the process minus memory_before. */
    double bytes_peak, bytes_grown;
} wave_report;

/* Prints how many cells, ranks and steps the run has, and the head of the table of steps. Collective. */
void wave_report_begin(MPI_Comm comm, const wave_options *options, const wave_mesh *mesh, const wave_solver *solver,
                       wave_report *report);

/* Prints the line of one step, with the maximum over all ranks in each column. Collective. */
void wave_report_step(wave_report *report, int64_t cycle, double time, double simulation_ms, double insitu_ms,
                      const insitu_report *insitu);

/* Prints the summary. images < 0 means that there was no session. Collective. */
void wave_report_end(const wave_report *report, const wave_options *options, const wave_solver *solver, int images);

#endif
