/* Checks compositing on several ranks. However a set of fragments is distributed over the ranks, the picture on rank 0
 * must be bit-identical to the serial merge of all fragments, and a failure on one rank must be reported on all ranks.
 * Every rank generates the whole set and keeps its own fragments. Results are reduced over the ranks before they are
 * asserted, so that a failing rank does not leave the others waiting. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "comp.h"
#include "comp_cost.h"
#include "memory.h"
#include "test_effort.h"

typedef enum distribution {
    distribute_random,
    distribute_checkerboard,
    distribute_blocks,
    distribute_all_to_first,
    distribute_all_to_last
} distribution;

static MPI_Comm comm;
static comp_group group;
static int own_rank, rank_count;
static const float background[4] = {0.125f, 0.25f, 0.5f, 0.75f};

static uint32_t hash_number(uint32_t x)
{
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

static float hash_to_unit_interval(uint32_t x)
{
    return (float)(hash_number(x) >> 8) * 0x1p-24f;
}

static void assert_everywhere(bool well, const char *what)
{
    int mine = well, all = 0;
    if (!well) fprintf(stderr, "rank %d of %d: not so: %s\n", own_rank, rank_count, what);
    assert_int_equal(MPI_Allreduce(&mine, &all, 1, MPI_INT, MPI_LAND, comm), MPI_SUCCESS);
    assert_true(all);
}

/* Makes fragment i. Depths are integers below 50, so that ties occur. Most pixels of a large image have no fragment or
 * a few. */
static fragment make_fragment(uint32_t i, uint32_t seed, uint32_t pixel_count)
{
    const uint32_t key = hash_number(seed) + 16 * i;
    fragment f = {.pixel = hash_number(key) % pixel_count,
                  .t_in = floorf(50 * hash_to_unit_interval(key + 1)),
                  .transmittance = hash_to_unit_interval(key + 2)};
    f.kind = hash_number(key + 3) % 3 == 0 ? FRAGMENT_SURFACE + hash_number(key + 4) % 2 : FRAGMENT_VOLUME;
    f.t_out = f.kind == FRAGMENT_VOLUME ? f.t_in + 1 : f.t_in;
    for (uint32_t c = 0; c < 3; c++) f.colour[c] = (1 - f.transmittance) * hash_to_unit_interval(key + 5 + c);
    return f;
}

/* Makes fragment i. Depending on the seed, all, half or none of the fragments are hits of an opaque surface; the others
 * are those of make_fragment(). */
static fragment make_some_fragment(uint32_t i, uint32_t seed, uint32_t pixel_count)
{
    fragment f = make_fragment(i, seed, pixel_count);
    if (seed % 3 == 0 || (seed % 3 == 1 && i % 2)) return f;
    if (f.kind < FRAGMENT_SURFACE) f.kind += FRAGMENT_SURFACE;
    f.t_out = f.t_in;
    f.transmittance = 0;
    return f;
}

static int get_fragment_owner(distribution how, uint32_t i, const fragment *f, int width, uint32_t count)
{
    const uint32_t x = f->pixel % (uint32_t)width, y = f->pixel / (uint32_t)width, ranks = (uint32_t)rank_count;
    switch (how) {
    case distribute_checkerboard: return (int)((x / 4 + y / 4 + (uint32_t)f->t_in) % ranks);
    case distribute_blocks: return (int)((uint64_t)i * ranks / count);
    case distribute_all_to_first: return 0;
    case distribute_all_to_last: return rank_count - 1;
    case distribute_random: break;
    }
    return (int)(hash_number(i + 77) % ranks);
}

static int compare_pixels(const void *a, const void *b)
{
    const uint32_t of_a = ((const fragment *)a)->pixel, of_b = ((const fragment *)b)->pixel;
    return (of_a > of_b) - (of_a < of_b);
}

static void merge_serially(fragment *all, int64_t count, image *out)
{
    const int64_t pixels = (int64_t)out->width * out->height;
    if (count) qsort(all, (size_t)count, sizeof *all, compare_pixels);
    int64_t i = 0;
    for (int64_t p = 0; p < pixels; p++) {
        const int64_t first = i;
        while (i < count && all[i].pixel == p) i++;
        comp_merge_pixel(all ? all + first : NULL, i - first, background, out->rgba + 4 * p, out->depth + p);
    }
}

static image make_image(int width, int height)
{
    const size_t pixels = (size_t)width * (size_t)height;
    image made = {width, height, base_alloc(16 * pixels), base_alloc(4 * pixels), NULL, false};
    assert_true(made.rgba && made.depth);
    memset(made.rgba, 0xa5, 16 * pixels);
    memset(made.depth, 0xa5, 4 * pixels);
    return made;
}

static void free_image(image *old)
{
    base_free(old->rgba);
    base_free(old->depth);
}

static bool are_same_images(const image *a, const image *b)
{
    const size_t pixels = (size_t)a->width * (size_t)a->height;
    return memcmp(a->rgba, b->rgba, 16 * pixels) == 0 && memcmp(a->depth, b->depth, 4 * pixels) == 0;
}

typedef struct setting {
    fragment_list own;
    image expected, out; /* with pixels on rank 0 only */
    int64_t count;       /* number of fragments on all ranks */
} setting;

/* Makes fragment i of the set of all ranks. */
typedef fragment fragment_maker(uint32_t i, uint32_t seed, uint32_t pixel_count);

static setting make_setting_from_fragments(fragment_maker *make, int width, int height, uint32_t count,
                                           distribution how, uint32_t seed)
{
    setting s = {.count = count, .out = {.width = width, .height = height}};
    if (own_rank == 0) s.out = make_image(width, height);
    if (own_rank == 0) s.expected = make_image(width, height);
    fragment *all = count ? base_alloc(count * sizeof *all) : NULL;
    s.own.items = count ? base_alloc(count * sizeof *all) : NULL;
    assert_true(!count || (all && s.own.items));
    for (uint32_t i = 0; i < count; i++) {
        all[i] = make(i, seed, (uint32_t)width * (uint32_t)height);
        if (get_fragment_owner(how, i, &all[i], width, count) == own_rank) s.own.items[s.own.count++] = all[i];
    }
    s.own.capacity = count;
    if (own_rank == 0) merge_serially(all, count, &s.expected);
    base_free(all);
    return s;
}

static setting make_setting(int width, int height, uint32_t count, distribution how, uint32_t seed)
{
    return make_setting_from_fragments(make_fragment, width, height, count, how, seed);
}

static void free_setting(setting *s)
{
    base_free(s->own.items);
    free_image(&s->expected);
    free_image(&s->out);
}

/* Selects a schedule, dense or sparse rounds, and nodes by the bits of `turn`. Nodes are simulated: a node has any
 * number of ranks that divides the number of all ranks. */
static void set_schedule(uint32_t turn)
{
    group.schedule = (comp_schedule)(COMP_DIRECT + turn % (COMP_SCHEDULE_COUNT - 1));
    group.nodes = (comp_nodes){1, false};
    group.max_dense_ranks = turn / 4 % 2; /* with 1, no round is dense, so all are sparse */
    for (int n = 2; n < rank_count && turn / 8 % 2; n++)
        if (rank_count % n == 0) group.nodes = (comp_nodes){n, turn / 16 % 2};
}

/* Returns the number of bytes allocated for the list. */
static int64_t get_allocated_bytes(const fragment_list *list)
{
    return list->items ? list->capacity * (int64_t)sizeof *list->items : 0;
}

static void check_compositing(int width, int height, uint32_t count, distribution how, uint32_t seed)
{
    setting s = make_setting_from_fragments(make_some_fragment, width, height, count, how, seed);
    comp_statistics statistics;
    base_error error = {INSITU_OK, ""};
    const int64_t own_count = s.own.count;
    const int64_t held = base_memory_held() - get_allocated_bytes(&s.own);
    const insitu_status status = comp_composite(&group, &s.own, background, 0, &s.out, &statistics, &error);
    assert_everywhere(status == INSITU_OK && error.message[0] == '\0', "composite succeeds");
    assert_everywhere(own_rank != 0 || are_same_images(&s.out, &s.expected), "the image is the serial merge");
    assert_everywhere(base_memory_held() == held, "nothing is left allocated");
    assert_everywhere(statistics.sent_fragments == own_count, "fragments are counted");
    assert_everywhere(rank_count > 1 || statistics.sent_bytes == 0, "one rank sends nothing");
    free_setting(&s);
}

static void composite_equals_serial_merge(void **context)
{
    (void)context;
    const int sizes[][2] = {{1, 1}, {1, 7}, {65, 3}, {101, 67}, {257, 131}};
    const uint32_t counts[] = {0, 1, 2, 50, 3000, 60000};
    /* the largest count is skipped if there are many ranks, since each rank generates all fragments */
    const size_t count_end = sizeof counts / sizeof *counts - (rank_count > 8);
    uint32_t seed = 1;
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++)
        for (size_t c = 0; c < count_end; c++)
            for (distribution how = distribute_random; how <= distribute_all_to_last; how++) {
                set_schedule(seed);
                check_compositing(sizes[s][0], sizes[s][1], counts[c], how, seed++);
            }
    for (uint32_t turn = 0; turn < 32; turn++) {
        set_schedule(turn);
        check_compositing(101, 67, 20000, distribute_random, seed++);
    }
}

/* Sorts the fragments by pixel and marks the pixels in which two fragments overlap, by testing every pair. No fragment
 * is opaque here. */
static void find_overlaps(fragment *all, uint32_t count, unsigned char *pixels)
{
    uint32_t first = 0;
    qsort(all, count, sizeof *all, compare_pixels);
    for (uint32_t i = 0; i < count; i++) {
        if (all[i].pixel != all[first].pixel) first = i;
        for (uint32_t j = first; j < count && all[j].pixel == all[i].pixel; j++) {
            const fragment *a = &all[i], *b = &all[j];
            if (i == j || a->kind >= FRAGMENT_SURFACE) continue;
            const bool is_behind = b->kind < FRAGMENT_SURFACE ? b->t_in >= a->t_in : b->t_in > a->t_in;
            if (is_behind && b->t_in <= a->t_out) pixel_set_add(pixels, a->pixel);
        }
    }
}

static void check_overlaps(int width, int height, uint32_t count, distribution how, uint32_t seed)
{
    const int64_t pixel_count = (int64_t)width * height, held = base_memory_held();
    fragment *all = base_alloc(count * sizeof *all);
    unsigned char *expected = base_calloc(pixel_set_bytes(pixel_count), 1);
    assert_true(all && expected);
    for (uint32_t i = 0; i < count; i++) {
        all[i] = make_fragment(i, seed, (uint32_t)pixel_count);
        assert_true(all[i].transmittance > 0);
    }
    find_overlaps(all, count, expected);
    const int64_t wanted = pixel_set_count(expected, pixel_count);
    setting s = make_setting(width, height, count, how, seed);
    set_schedule(seed);
    comp_overlaps found;
    const insitu_status status =
        comp_composite_overlaps(&group, &s.own, background, 0, &s.out, &found, NULL, &(base_error){0});
    assert_everywhere(status == INSITU_OK && found.count == wanted, "all overlaps are found");
    assert_everywhere(wanted ? !memcmp(found.pixels, expected, pixel_set_bytes(pixel_count)) : !found.pixels,
                      "all ranks know the pixels");
    assert_everywhere(own_rank != 0 || are_same_images(&s.out, &s.expected), "the image is the serial merge");
    free_setting(&s);
    base_free(found.pixels);
    base_free(all);
    base_free(expected);
    assert_everywhere(base_memory_held() == held, "nothing is left allocated");
}

static void overlaps_are_reported_on_all_ranks(void **context)
{
    (void)context;
    const int sizes[][2] = {{1, 1}, {1, 7}, {65, 3}, {101, 67}};
    const uint32_t counts[] = {0, 1, 2, 50, 1500};
    uint32_t seed = 5001;
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++)
        for (size_t c = 0; c < sizeof counts / sizeof *counts; c++)
            for (distribution how = distribute_random; how <= distribute_all_to_last; how++)
                check_overlaps(sizes[s][0], sizes[s][1], counts[c], how, seed++);
}

/* Checks images with more strips than blocks. If there are few fragments, an owner has strips in which no rank has a
 * fragment. */
static void large_image_equals_serial_merge(void **context)
{
    (void)context;
    check_compositing(601, 401 * rank_count, 40000, distribute_random, 1001);
    check_compositing(1921, 1081, 1500, distribute_random, 1002);
    check_compositing(5003, 3, 700, distribute_blocks, 1003);
}

/* Returns the fragment of a smooth curved surface at a pixel. Each rank has such fragments in whole rows, as in a tile
 * of a picture. */
static fragment make_smooth_fragment(uint32_t pixel, int width)
{
    const float x = (float)(pixel % (uint32_t)width) / 500, y = (float)(pixel / (uint32_t)width) / 500;
    fragment f = {.pixel = pixel, .t_in = 1 + 0.3f * x * x + 0.1f * y, .kind = FRAGMENT_SURFACE};
    f.t_out = f.t_in;
    for (int c = 0; c < 3; c++) f.colour[c] = 0.5f + 0.3f * x * (float)(c + 1) - 0.2f * y * y;
    return f;
}

/* Checks the size of messages. A hit takes 32 bytes in memory and a finished pixel 24 bytes. For a smooth surface, only
 * the depth and three colours are sent, each in one or two bytes plus two bits: at most 9 bytes together, plus the
 * headers of messages and blocks. */
static void smooth_surfaces_compress_to_a_third(void **context)
{
    (void)context;
    enum { WIDTH = 512, HEIGHT = 256, MOST_BYTES = 9 };
    setting s = {.out = {.width = WIDTH, .height = HEIGHT}};
    if (own_rank == 0) s.out = make_image(WIDTH, HEIGHT);
    s.own = (fragment_list){base_alloc(WIDTH * HEIGHT * sizeof(fragment)), 0, WIDTH * HEIGHT};
    for (uint32_t p = 0; p < WIDTH * HEIGHT; p++)
        if ((int)(p / WIDTH * (uint32_t)rank_count / HEIGHT) == own_rank)
            s.own.items[s.own.count++] = make_smooth_fragment(p, WIDTH);
    comp_statistics statistics;
    assert_everywhere(comp_composite(&group, &s.own, background, 0, &s.out, &statistics, NULL) == INSITU_OK,
                      "composite succeeds");
    int64_t own[2] = {statistics.sent_bytes, statistics.sent_messages}, all[2];
    MPI_Allreduce(own, all, 2, MPI_INT64_T, MPI_SUM, comm);
    /* number of pixels sent to their owners; as many finished pixels are sent to rank 0 */
    const double travelled = (double)WIDTH * HEIGHT * (rank_count - 1) / rank_count;
    assert_everywhere(rank_count == 1 ? all[0] == 0
                                      : (double)all[0] < 2 * MOST_BYTES * travelled + 64.0 * (double)all[1],
                      "smooth surfaces travel in few bytes");
    base_free(s.own.items);
    if (own_rank == 0) free_image(&s.out);
}

/* Compares the predicted number of messages of each schedule with the number of messages sent. Without fragments, a
 * rank sends one message to each partner in each round, and each owner except rank 0 sends one message up the gather
 * tree. */
static void messages_match_the_predicted_count(void **context)
{
    (void)context;
    for (uint32_t turn = 0; turn < 32; turn++) {
        comp_statistics statistics;
        set_schedule(turn);
        if (group.max_dense_ranks) continue;
        setting s = make_setting(16, 16, 0, distribute_random, 1);
        assert_everywhere(comp_composite(&group, &s.own, background, 0, &s.out, &statistics, NULL) == INSITU_OK,
                          "all is well");
        const comp_route route = comp_make_route(group.schedule, rank_count, group.nodes, 8);
        const int place = comp_find_place_of_rank(&route, own_rank);
        const int64_t up = place > 0 && place < route.owners;
        assert_everywhere(statistics.sent_messages == comp_count_route_messages(&route, place) * (rank_count > 1) + up,
                          "messages are as counted");
        free_setting(&s);
    }
    set_schedule(0);
}

/* Makes the n-th allocation of the rank `victim` fail while it composites a copy of the list. Checks that the status is
 * the same on all ranks and that the error has a message. Returns whether the picture was drawn. */
static bool composite_without_allocation(setting *s, int victim, int64_t n)
{
    const int64_t held = base_memory_held();
    base_error error = {INSITU_OK, ""};
    fragment_list list = {base_alloc((size_t)s->own.count * sizeof(fragment)), s->own.count, s->own.count};
    if (list.count) memcpy(list.items, s->own.items, (size_t)list.count * sizeof *list.items);
    if (own_rank == victim) base_memory_fail_nth(n);
    const insitu_status status = comp_composite(&group, &list, background, 0, &s->out, NULL, &error);
    base_memory_fail_nth(0);
    int lowest = 0, highest = 0, mine = (int)status;
    MPI_Allreduce(&mine, &lowest, 1, MPI_INT, MPI_MIN, comm);
    MPI_Allreduce(&mine, &highest, 1, MPI_INT, MPI_MAX, comm);
    assert_everywhere(lowest == highest, "all ranks return the same status");
    assert_everywhere(status == INSITU_OK || status == INSITU_ERROR_MEMORY, "the status is of memory");
    assert_everywhere((status == INSITU_OK) == (error.message[0] == '\0'), "an error has a message");
    assert_everywhere(base_memory_held() == held, "nothing is left allocated");
    return status == INSITU_OK;
}

/* Makes every allocation of compositing fail one time and checks the error; if no allocation fails, the picture must be
 * right. With up to 8 ranks, each allocation fails on rank 0 and on the last rank, and the ranks between them take
 * turns. With more ranks, every fifth rank is tested at every fourth allocation. */
static void failed_allocation_is_an_error_on_all(void **context)
{
    (void)context;
    const bool is_many = rank_count > 8;
    for (int victim = 0, turn = 0; victim < rank_count; victim += is_many ? 5 : 1, turn++) {
        const bool is_end = victim == 0 || victim == rank_count - 1;
        const int stride = test_is_long_run() || (is_end && !is_many) ? 1 : is_many ? 4 : rank_count - 2;
        set_schedule((uint32_t)victim + 8 + 4 * (uint32_t)(victim / 4 % 2));
        setting s = make_setting(65, 33, 3000, distribute_random, 21);
        int64_t n = 1 + turn % stride;
        while (!composite_without_allocation(&s, victim, n)) n += stride;
        assert_everywhere(n > 1 + turn % stride, "some allocation could fail");
        assert_everywhere(own_rank != 0 || are_same_images(&s.out, &s.expected), "the image is right afterwards");
        free_setting(&s);
    }
    set_schedule(0);
}

static void pixel_beyond_the_image_is_an_error_on_all(void **context)
{
    (void)context;
    setting s = make_setting(8, 8, 100, distribute_random, 33);
    if (own_rank == rank_count - 1) {
        s.own.count = 1;
        s.own.items[0].pixel = 64;
    }
    base_error error = {INSITU_OK, ""};
    const insitu_status status = comp_composite(&group, &s.own, background, 0, &s.out, NULL, &error);
    assert_everywhere(status == INSITU_ERROR_INTERNAL, "a stray pixel is refused");
    char name[32];
    snprintf(name, sizeof name, "rank %d", rank_count - 1);
    assert_everywhere(own_rank == rank_count - 1 || strstr(error.message, name), "the message names the rank");
    free_setting(&s);
}

static void empty_image_is_rejected(void **context)
{
    (void)context;
    image none = {.height = 4}, huge = {.width = 65536, .height = 65536};
    fragment_list items = {NULL, 0, 0};
    assert_everywhere(comp_composite(&group, &items, background, 0, &none, NULL, NULL) == INSITU_ERROR_ARGUMENT,
                      "0 x 4");
    assert_everywhere(comp_composite(&group, &items, background, 0, &huge, NULL, NULL) == INSITU_ERROR_ARGUMENT,
                      "2^32");
}

int main(int argc, char **argv)
{
    MPI_Init(&argc, &argv);
    MPI_Comm_dup(MPI_COMM_WORLD, &comm);
    MPI_Comm_set_errhandler(comm, MPI_ERRORS_RETURN);
    MPI_Comm_rank(comm, &own_rank);
    MPI_Comm_size(comm, &rank_count);
    group = (comp_group){comm, {1, false}, COMP_DIRECT, 0, comp_claims_create(rank_count)};
    if (!group.claims) MPI_Abort(comm, 1);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(composite_equals_serial_merge),
        cmocka_unit_test(overlaps_are_reported_on_all_ranks),
        cmocka_unit_test(large_image_equals_serial_merge),
        cmocka_unit_test(smooth_surfaces_compress_to_a_third),
        cmocka_unit_test(messages_match_the_predicted_count),
        cmocka_unit_test(failed_allocation_is_an_error_on_all),
        cmocka_unit_test(pixel_beyond_the_image_is_an_error_on_all),
        cmocka_unit_test(empty_image_is_rejected),
    };
    const int failed = cmocka_run_group_tests(tests, NULL, NULL);
    comp_claims_free(group.claims);
    MPI_Comm_free(&comm);
    MPI_Finalize();
    return failed;
}
