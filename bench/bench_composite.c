/* Measures only compositing: the time of the slowest rank, bytes, messages and peak memory of each schedule, and of
 * IceT's strategies on the same pictures, in turns. An MPI program; prints CSV.
 *
 *     mpirun -n 8 bench_composite [--runs N] [--size N] [--width W] [--height H] [--random]
 *
 * The mesh is that of the other benchmarks. It is divided into blocks of the cube, one per rank, or its cells are
 * distributed at random. */
#include <math.h>
#include <mpi.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include "bench_icet.h"
#include "bench_scene.h"
#include "comp.h"
#include "memory.h"

typedef struct options {
    int runs, size, width, height;
    bool is_random;
} options;

static int own_rank, rank_count;
static const float background[4] = {0, 0, 0, 0};

/* Computes the numbers of blocks along the axes, as equal as the number of ranks allows. */
static void count_blocks(int blocks[3])
{
    int left = rank_count;
    for (int axis = 0; axis < 3; axis++) {
        int side = (int)floor(pow(left, 1.0 / (3 - axis)) + 1e-9);
        while (left % side) side--;
        blocks[axis] = side;
        left /= side;
    }
}

/* Orders the ranks' blocks from front to back; the eye is beyond the last block along every axis. */
static void sort_blocks_by_depth(int *order)
{
    for (int i = 0; i < rank_count; i++) order[i] = rank_count - 1 - i;
}

static void distribute_cells(const test_mesh *mesh, const options *o, int *owners)
{
    int blocks[3];
    count_blocks(blocks);
    if (o->is_random) test_partition_cells(mesh, TEST_RANDOM, o->size, rank_count, owners);
    for (int64_t c = 0; c < mesh->cell_count && !o->is_random; c++) {
        int block[3];
        for (int axis = 0; axis < 3; axis++) {
            double sum = 0;
            for (int k = 0; k < 8; k++) sum += mesh->coordinates[3 * mesh->connectivity[8 * c + k] + axis];
            const int at = (int)((sum / 8 + 1) / 2 * blocks[axis]);
            block[axis] = at < blocks[axis] ? at : blocks[axis] - 1;
        }
        owners[c] = (block[2] * blocks[1] + block[1]) * blocks[0] + block[0];
    }
}

static void make_scene(const options *o, bench_scene *s)
{
    test_mesh whole, part;
    bench_scene_create(s, "bench_composite", TEST_HEXES, 1);
    bench_scene_make_mesh(TEST_HEXES, o->size, &whole);
    int *owners = malloc((size_t)whole.cell_count * sizeof *owners);
    if (!owners) abort();
    distribute_cells(&whole, o, owners);
    test_mesh_extract_part(&whole, owners, own_rank, &part);
    test_view_free(&s->view);
    test_view_create(&part, (test_layout){0}, &s->view);
    s->view.cells.ghosts = NULL;
    s->job.is_alone = false;
    free(owners);
    test_mesh_free(&whole);
    test_mesh_free(&part);
    bench_scene_resize(s, o->width, o->height);
    bench_scene_build(s);
}

/* ---- one rank's picture for IceT ----------------------------------------------------------------------------- */

static int compare_pixels(const void *a, const void *b)
{
    const uint32_t of_a = ((const fragment *)a)->pixel, of_b = ((const fragment *)b)->pixel;
    return (of_a > of_b) - (of_a < of_b);
}

static void find_viewport(const float *rgba, int width, int height, int viewport[4])
{
    int low[2] = {width, height}, high[2] = {-1, -1};
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            if (rgba[4 * ((int64_t)y * width + x) + 3] == 0) continue;
            const int at[2] = {x, y};
            for (int i = 0; i < 2; i++) {
                if (at[i] < low[i]) low[i] = at[i];
                if (at[i] > high[i]) high[i] = at[i];
            }
        }
    for (int i = 0; i < 2; i++) {
        viewport[i] = high[i] < 0 ? 0 : low[i];
        viewport[2 + i] = high[i] < 0 ? 0 : high[i] - low[i] + 1;
    }
}

static void make_picture(const fragment_list *list, bool is_surface, int width, int height, bench_icet_picture *out)
{
    const int64_t pixels = (int64_t)width * height;
    fragment *sorted = malloc((size_t)list->count * sizeof *sorted + 1);
    float *rgba = calloc((size_t)pixels * 4, sizeof *rgba), *depth = malloc((size_t)pixels * sizeof *depth);
    if (!sorted || !rgba || !depth) abort();
    if (list->count) memcpy(sorted, list->items, (size_t)list->count * sizeof *sorted);
    qsort(sorted, (size_t)list->count, sizeof *sorted, compare_pixels);
    for (int64_t p = 0; p < pixels; p++) depth[p] = 1;
    for (int64_t i = 0, next; i < list->count; i = next) {
        for (next = i + 1; next < list->count && sorted[next].pixel == sorted[i].pixel;) next++;
        const int64_t x = sorted[i].pixel % (uint32_t)width,
                      y = height - 1 - (int64_t)(sorted[i].pixel / (uint32_t)width);
        float t;
        comp_merge_pixel(sorted + i, next - i, background, rgba + 4 * (y * width + x), &t);
        depth[y * width + x] = isfinite(t) ? 0.25f + 0.2f * t : 1;
    }
    free(sorted);
    if (!is_surface) {
        free(depth);
        depth = NULL;
    }
    *out = (bench_icet_picture){.width = width, .height = height, .rgba = rgba, .depth = depth};
    find_viewport(rgba, width, height, out->viewport);
}

/* ---- measuring ----------------------------------------------------------------------------------------------- */

/* The measurements of one compositing method. */
typedef struct measure {
    char name[32];
    bench_series series, cpu; /* series: time of the slowest rank; cpu: CPU time of all ranks, including waiting */
    /* bytes, messages: sums over all ranks; peak: largest peak memory of a rank, in bytes */
    double bytes, messages, peak;
    bool can;
} measure;

typedef struct bench {
    const options *options;
    bench_scene *scene;
    comp_group group;
    image out;
    bench_icet *icet;
    bench_icet_picture picture;
    measure measures[COMP_SCHEDULE_COUNT + BENCH_ICET_STRATEGIES];
} bench;

static double reduce_over_ranks(double mine, MPI_Op op)
{
    double all = 0;
    MPI_Allreduce(&mine, &all, 1, MPI_DOUBLE, op, MPI_COMM_WORLD);
    return all;
}

static double read_cpu_seconds(void)
{
    struct rusage used;
    getrusage(RUSAGE_SELF, &used);
    return (double)(used.ru_utime.tv_sec + used.ru_stime.tv_sec) +
           1e-6 * (double)(used.ru_utime.tv_usec + used.ru_stime.tv_usec);
}

typedef struct stopwatch {
    double began, cpu_began;
} stopwatch;

static stopwatch start_stopwatch(void)
{
    MPI_Barrier(MPI_COMM_WORLD);
    return (stopwatch){bench_read_clock(), read_cpu_seconds()};
}

static void stop_stopwatch(const stopwatch *watch, int number, measure *m)
{
    const double seconds = bench_read_clock() - watch->began, cpu = read_cpu_seconds() - watch->cpu_began;
    bench_add_sample(reduce_over_ranks(seconds, MPI_MAX), number, &m->series);
    bench_add_sample(reduce_over_ranks(cpu, MPI_SUM), number, &m->cpu);
}

static void run_library(bench *b, comp_schedule schedule, int number, measure *m)
{
    const fragment_list *have = &b->scene->fragments;
    const size_t bytes = (size_t)have->count * sizeof(fragment);
    fragment_list list = {base_alloc(bytes), have->count, have->count};
    comp_statistics statistics;
    base_error error = {0};
    if (have->count) memcpy(list.items, have->items, bytes);
    b->group.schedule = schedule;
    /* All ranks are on one node, which the automatic choice detects. Fixed schedules assume nodes of four ranks if the
     * number of ranks is a multiple of four. */
    b->group.nodes = (comp_nodes){schedule != COMP_AUTOMATIC && rank_count % 4 == 0 ? 4 : 1, false};
    base_memory_reset_peak();
    const int64_t held = base_memory_held();
    const stopwatch watch = start_stopwatch();
    if (comp_composite(&b->group, &list, background, 0, &b->out, &statistics, &error)) abort();
    stop_stopwatch(&watch, number, m);
    m->can = true;
    m->bytes = reduce_over_ranks((double)statistics.sent_bytes, MPI_SUM);
    m->messages = reduce_over_ranks((double)statistics.sent_messages, MPI_SUM);
    m->peak = reduce_over_ranks((double)(base_memory_peak() - held + (int64_t)bytes), MPI_MAX);
    snprintf(m->name, sizeof m->name, "%s", comp_schedule_name(schedule));
}

static void run_icet(bench *b, int strategy, int number, measure *m)
{
    const float *rgba;
    const stopwatch watch = start_stopwatch();
    const double bytes = bench_icet_composite(b->icet, strategy, &b->picture, &rgba);
    stop_stopwatch(&watch, number, m);
    m->can = reduce_over_ranks(bytes, MPI_MIN) >= 0;
    m->bytes = reduce_over_ranks(bytes, MPI_SUM);
    snprintf(m->name, sizeof m->name, "IceT %s", bench_icet_strategy(strategy));
}

static void print_measurement(const bench *b, const char *layer, measure *m)
{
    const bench_stats time = bench_compute_stats(m->series.seconds, m->series.count);
    const bench_stats cpu = bench_compute_stats(m->cpu.seconds, m->cpu.count);
    if (own_rank || !m->can) return;
    printf("%s,%s,%d,%s,%.2f,%.2f,%.2f,%.2f,%.3f,%.0f,%.2f\n", layer, b->options->is_random ? "random" : "block",
           rank_count, m->name, 1e3 * time.median, 1e3 * time.low, 1e3 * time.high, 1e3 * cpu.median, 1e-6 * m->bytes,
           m->messages, 1e-6 * m->peak);
    fflush(stdout);
}

static void measure_layer(bench *b, const char *layer, bool is_surface)
{
    const bool has_peer = b->icet && !(b->options->is_random && !is_surface);
    bench_scene_frame(b->scene);
    make_picture(&b->scene->fragments, is_surface, b->options->width, b->options->height, &b->picture);
    int *order = malloc((size_t)rank_count * sizeof *order);
    if (!order) abort();
    sort_blocks_by_depth(order);
    b->picture.order = order;
    memset(b->measures, 0, sizeof b->measures);
    for (int run = 0; run <= b->options->runs; run++) {
        for (int s = COMP_AUTOMATIC; s < COMP_SCHEDULE_COUNT; s++)
            run_library(b, (comp_schedule)s, run, &b->measures[s]);
        for (int s = 0; s < BENCH_ICET_STRATEGIES && has_peer; s++)
            run_icet(b, s, run, &b->measures[COMP_SCHEDULE_COUNT + s]);
    }
    for (int i = 0; i < COMP_SCHEDULE_COUNT + BENCH_ICET_STRATEGIES; i++) print_measurement(b, layer, &b->measures[i]);
    free((void *)(uintptr_t)b->picture.rgba);
    free((void *)(uintptr_t)b->picture.depth);
    free(order);
}

static bool read_options(int argc, char **argv, options *o)
{
    *o = (options){5, 48, BENCH_WIDTH, BENCH_HEIGHT, false};
    const struct {
        const char *name;
        int *value;
    } numbers[] = {{"--runs", &o->runs}, {"--size", &o->size}, {"--width", &o->width}, {"--height", &o->height}};
    for (int i = 1; i < argc; i++) {
        bool is_known = strcmp(argv[i], "--random") == 0;
        o->is_random = o->is_random || is_known;
        for (size_t k = 0; k < sizeof numbers / sizeof *numbers && !is_known; k++) {
            is_known = strcmp(argv[i], numbers[k].name) == 0 && i + 1 < argc;
            if (is_known) *numbers[k].value = atoi(argv[++i]);
        }
        if (!is_known) return false;
    }
    return o->runs > 0 && o->runs < BENCH_MAX_RUNS && o->size > 0 && o->width > 0 && o->height > 0;
}

int main(int argc, char **argv)
{
    options o;
    bench_scene scene;
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &own_rank);
    MPI_Comm_size(MPI_COMM_WORLD, &rank_count);
    if (!read_options(argc, argv, &o)) {
        if (own_rank == 0) fputs("bench_composite [--runs N] [--size N] [--width W] [--height H] [--random]\n", stderr);
        MPI_Finalize();
        return 1;
    }
    make_scene(&o, &scene);
    bench b = {.options = &o, .scene = &scene, .out = {.width = o.width, .height = o.height}};
    const size_t pixels = (size_t)o.width * (size_t)o.height;
    b.group = (comp_group){MPI_COMM_WORLD, {1, false}, COMP_AUTOMATIC, 0, comp_claims_create(rank_count)};
    if (!b.group.claims) abort();
    b.out.rgba = own_rank == 0 ? base_alloc(pixels * 4 * sizeof(float)) : NULL;
    b.out.depth = own_rank == 0 ? base_alloc(pixels * sizeof(float)) : NULL;
    b.icet = bench_icet_create(MPI_COMM_WORLD);
    if (own_rank == 0) puts("layer,partition,ranks,way,median ms,least,greatest,CPU ms,MB,messages,peak MB");
    bench_scene_show_surfaces(&scene, 1);
    measure_layer(&b, "isosurface", true);
    bench_scene_show_volume(&scene);
    measure_layer(&b, "volume", false);
    bench_icet_free(b.icet);
    comp_claims_free(b.group.claims);
    base_free(b.out.rgba);
    base_free(b.out.depth);
    bench_scene_free(&scene);
    MPI_Finalize();
    return 0;
}
