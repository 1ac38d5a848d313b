/* Medians with their spread, and the one form in which benchmarks print: a line of CSV a measure. */
#ifndef BENCH_STATS_H
#define BENCH_STATS_H

#include <stdint.h>

typedef struct bench_stats {
    int count;
    double median, low, high;
} bench_stats;

/* Sorts values and computes their statistics, all zero for none. */
bench_stats bench_stats_of(double *values, int count);

/* Seconds on a clock that only rises. */
double bench_seconds(void);

/* Makes times those of the processor in this process, on all threads, from now on; series are printed as "cpu ms". They
 * change less than times of a clock if the machine has other work. */
void bench_use_processor_time(void);

/* The first columns of a line. */
typedef struct bench_subject {
    const char *program, *isa, *mesh;
    int threads, n;
    int64_t cells;
} bench_subject;

/* The CSV's head line, and a line of it; to stdout. Numbers have 6 digits. */
void bench_print_head(void);
void bench_print(const bench_subject *subject, const char *measure, const char *unit, bench_stats stats);

/* A measure that is one number. */
void bench_print_number(const bench_subject *subject, const char *measure, const char *unit, double number);

/* Times of several acts that are run in turns, so that other work of the machine disturbs all of them alike. */
enum { BENCH_MAX_RUNS = 100 };

typedef struct bench_series {
    int count;
    double seconds[BENCH_MAX_RUNS];
} bench_series;

/* Waits until the threads of the last act have stopped looking for work, and begins. */
double bench_begin(void);

/* Keeps a time, unless number is 0, the warm-up. */
void bench_add_sample(double seconds, int number, bench_series *series);

/* Keeps the time since began, and returns it. */
double bench_end(double began, int number, bench_series *series);

/* Prints milliseconds, as "ms" or "cpu ms". Sorts the series. */
void bench_print_series(const bench_subject *subject, const char *measure, bench_series *series);

#endif
