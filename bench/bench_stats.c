/* Prints long CSV, one measure per line, so that further programs and measures need no new columns. */
#include "bench_stats.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

bench_stats bench_compute_stats(double *values, int count)
{
    if (!count) return (bench_stats){0};
    qsort(values, (size_t)count, sizeof *values, compare_doubles);
    const double median = 0.5 * (values[(count - 1) / 2] + values[count / 2]);
    return (bench_stats){count, median, values[0], values[count - 1]};
}

static clockid_t used_clock = CLOCK_MONOTONIC;

void bench_use_processor_time(void)
{
    used_clock = CLOCK_PROCESS_CPUTIME_ID;
}

double bench_read_clock(void)
{
    struct timespec t;
    clock_gettime(used_clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void bench_print_head(void)
{
    printf("program,isa,threads,mesh,n,cells,measure,unit,count,median,min,max\n");
}

void bench_print(const bench_subject *s, const char *measure, const char *unit, bench_stats stats)
{
    printf("%s,%s,%d,%s,%d,%lld,%s,%s,%d,%.6g,%.6g,%.6g\n", s->program, s->isa, s->threads, s->mesh, s->n,
           (long long)s->cells, measure, unit, stats.count, stats.median, stats.low, stats.high);
    fflush(stdout);
}

void bench_print_number(const bench_subject *subject, const char *measure, const char *unit, double number)
{
    bench_print(subject, measure, unit, (bench_stats){1, number, number, number});
}

double bench_start_timer(void)
{
    const struct timespec pause = {.tv_nsec = 20 * 1000 * 1000};
    nanosleep(&pause, NULL);
    return bench_read_clock();
}

double bench_stop_timer(double began, int number, bench_series *series)
{
    const double seconds = bench_read_clock() - began;
    bench_add_sample(seconds, number, series);
    return seconds;
}

void bench_add_sample(double seconds, int number, bench_series *series)
{
    if (number > 0 && series->count < BENCH_MAX_RUNS) series->seconds[series->count++] = seconds;
}

void bench_print_series(const bench_subject *subject, const char *measure, bench_series *series)
{
    for (int i = 0; i < series->count; i++) series->seconds[i] *= 1e3;
    bench_print(subject, measure, used_clock == CLOCK_MONOTONIC ? "ms" : "cpu ms",
                bench_compute_stats(series->seconds, series->count));
}
