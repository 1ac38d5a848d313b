/* Computes medians with their spread, and prints the CSV of the benchmarks, one measure per line. */
#ifndef BENCH_STATS_H
#define BENCH_STATS_H

#include <stdint.h>

typedef struct bench_stats {
    int count;
    double median, low, high;
} bench_stats;

/* Sorts the values and computes their statistics. All statistics are 0 if count is 0. */
bench_stats bench_compute_stats(double *values, int count);

/* Returns the seconds of a monotonic clock. */
double bench_read_clock(void);

/* From now on, measures the CPU time of all threads of this process instead of wall-clock time; series are printed as
 * "cpu ms". CPU times vary less than wall-clock times if the machine has other work. */
void bench_use_processor_time(void);

/* The first columns of a line of the CSV. */
typedef struct bench_subject {
    const char *program, *isa, *mesh;
    int threads, n;
    int64_t cells;
} bench_subject;

/* bench_print_head() prints the head line of the CSV to stdout, and bench_print() prints one of its other lines.
 * Numbers have 6 digits. */
void bench_print_head(void);
void bench_print(const bench_subject *subject, const char *measure, const char *unit, bench_stats stats);

/* Prints a measure that consists of one number. */
void bench_print_number(const bench_subject *subject, const char *measure, const char *unit, double number);

/* Largest number of times in a series. */
enum { BENCH_MAX_RUNS = 100 };

/* The times of one operation. Operations that are compared are run in turns, so that other work of the machine affects
 * all of them equally. */
typedef struct bench_series {
    int count;
    double seconds[BENCH_MAX_RUNS];
} bench_series;

/* Waits until the threads of the previous operation have stopped spinning, and returns the starting time. */
double bench_start_timer(void);

/* Adds a time to the series, unless number is 0 (the warm-up run). */
void bench_add_sample(double seconds, int number, bench_series *series);

/* Adds the time since `began` to the series, and returns it. */
double bench_stop_timer(double began, int number, bench_series *series);

/* Sorts the series and prints its times in milliseconds, as "ms" or "cpu ms". */
void bench_print_series(const bench_subject *subject, const char *measure, bench_series *series);

#endif
