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

#endif
