/* Medians with their spread, and the one form in which benchmarks print: a line of CSV a measure. */
#ifndef BENCH_STATS_H
#define BENCH_STATS_H

#include <stdint.h>

typedef struct bench_stats {
    int count;
    double median, low, high;
} bench_stats;

/* Sorts values. All zero for none. */
bench_stats bench_stats_of(double *values, int count);

/* Seconds on a clock that only rises. */
double bench_seconds(void);

/* What a line's first columns say. */
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

/* Times of several acts that are run in turns, so that whatever else the machine does falls on all of them alike. */
enum { BENCH_MAX_RUNS = 100 };

typedef struct bench_series {
    int count;
    double seconds[BENCH_MAX_RUNS];
} bench_series;

/* Wait until the threads of the last act have stopped looking for work, and begin. */
double bench_begin(void);

/* Keep a time; of the first, the warm-up with number 0, nothing. */
void bench_keep(double seconds, int number, bench_series *series);

/* Keep what has passed since began, and return it. */
double bench_end(double began, int number, bench_series *series);

/* Milliseconds. Sorts. */
void bench_print_series(const bench_subject *subject, const char *measure, bench_series *series);

#endif
