/* Checks compositing without MPI: the rule that merges the fragments of a pixel, against a reference in double and
 * closed forms; the owners of blocks, for more ranks than a machine has; and the division of the picture into strips
 * and blocks. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <cmocka.h>
#include <omp.h>

#include "comp.h"
#include "comp_grid.h"
#include "comp_route.h"
#include "comp_strips.h"
#include "comp_tiles.h"
#include "memory.h"

enum { most_fragments = 200 };

static const float black[4] = {0, 0, 0, 0};
static const float blue[4] = {0.125f, 0.25f, 0.5f, 0.75f};
static const double half_ulp = 0x1p-24; /* half a unit in the last place of a float in [0.5, 1) */

static uint64_t state;

static uint32_t draw_random(void)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(state >> 32);
}

static float draw_unit_number(void)
{
    return (float)(draw_random() >> 8) * 0x1p-24f;
}

static fragment make_random_fragment(void)
{
    fragment f = {.t_in = draw_unit_number(), .transmittance = draw_unit_number()};
    f.t_out = f.t_in + draw_unit_number();
    for (int c = 0; c < 3; c++) f.colour[c] = draw_unit_number() * (1 - f.transmittance);
    f.kind = draw_random() % 4 == 0 ? FRAGMENT_SURFACE + draw_random() % 3 : FRAGMENT_VOLUME;
    return f;
}

static void shuffle_fragments(fragment *items, int count)
{
    for (int i = count - 1; i > 0; i--) {
        const int j = (int)(draw_random() % (uint32_t)(i + 1));
        const fragment moved = items[i];
        items[i] = items[j];
        items[j] = moved;
    }
}

static int compare_depths(const void *a, const void *b)
{
    const float of_a = ((const fragment *)a)->t_in, of_b = ((const fragment *)b)->t_in;
    return (of_a > of_b) - (of_a < of_b);
}

/* Returns the tolerance for blending `count` fragments. Each step of the blend rounds a product and a sum of colour and
 * a product of transmittance, all at most 1. That makes three half units in the last place for each step and three for
 * the background. */
static double compute_tolerance(int count)
{
    return 3.0 * (count + 1) * half_ulp;
}

static void blend_in_double(const fragment *items, int count, const float background[4], double rgba[4])
{
    fragment sorted[most_fragments];
    memcpy(sorted, items, (size_t)count * sizeof *items);
    qsort(sorted, (size_t)count, sizeof *sorted, compare_depths);
    double t = 1;
    rgba[0] = rgba[1] = rgba[2] = 0;
    for (int i = 0; i < count; i++) {
        for (int c = 0; c < 3; c++) rgba[c] += t * (double)sorted[i].colour[c];
        t *= (double)sorted[i].transmittance;
    }
    for (int c = 0; c < 3; c++) rgba[c] += t * (double)background[c];
    rgba[3] = 1 - t + t * (double)background[3];
}

static void merge_without_fragments_is_background(void **context)
{
    (void)context;
    float rgba[4], depth;
    comp_merge_pixel(NULL, 0, blue, rgba, &depth);
    assert_memory_equal(rgba, blue, sizeof rgba);
    assert_true(isinf(depth) && depth > 0);
}

static void merge_matches_double_reference(void **context)
{
    (void)context;
    state = 1;
    for (int trial = 0; trial < 2000; trial++) {
        fragment items[most_fragments];
        const int count = trial % 100;
        float rgba[4], depth, nearest = INFINITY;
        double expected[4];
        for (int i = 0; i < count; i++) {
            items[i] = make_random_fragment();
            /* all depths are distinct, since 101 is prime */
            items[i].t_in = (float)(i * 37 % 101) + 0.5f * draw_unit_number();
            items[i].t_out = items[i].t_in + (items[i].kind < FRAGMENT_SURFACE ? 0.4f : 0);
            if (items[i].kind >= FRAGMENT_SURFACE) nearest = fminf(nearest, items[i].t_in);
        }
        blend_in_double(items, count, blue, expected);
        comp_merge_pixel(items, count, blue, rgba, &depth);
        for (int c = 0; c < 4; c++) assert_true(fabs((double)rgba[c] - expected[c]) <= compute_tolerance(count));
        assert_true(depth == nearest);
    }
}

static void transmittance_of_equal_slabs_is_a_power(void **context)
{
    (void)context;
    for (int count = 1; count <= most_fragments; count++) {
        fragment items[most_fragments];
        float rgba[4], depth;
        for (int i = 0; i < count; i++) {
            const float q = 0.96875f; /* 1 - q is exact in float */
            const float t = (float)((i * 7) % count);
            items[i] = (fragment){.t_in = t, .t_out = t + 1, .colour = {1 - q, 0, (1 - q) / 2}, .transmittance = q};
        }
        comp_merge_pixel(items, count, black, rgba, &depth);
        const double alpha = 1 - pow(0.96875, count);
        assert_true(fabs((double)rgba[0] - alpha) <= compute_tolerance(count));
        assert_true(rgba[1] == 0);
        assert_true(fabs((double)rgba[2] - alpha / 2) <= compute_tolerance(count));
        assert_true(fabs((double)rgba[3] - alpha) <= compute_tolerance(count));
        assert_true(isinf(depth));
    }
}

static void opaque_surface_hides_what_is_behind(void **context)
{
    (void)context;
    state = 2;
    for (int trial = 0; trial < 500; trial++) {
        fragment all[most_fragments], seen[most_fragments];
        const fragment wall = {
            .t_in = 0.5f, .t_out = 0.5f, .colour = {0.25f, 0.5f, 1}, .kind = FRAGMENT_SURFACE, .transmittance = 0};
        int seen_count = 0;
        const int count = 1 + trial % 60;
        all[0] = seen[seen_count++] = wall;
        for (int i = 1; i < count; i++) {
            all[i] = make_random_fragment();
            if (all[i].t_in == 0.5f) all[i].t_in = 0.75f;
            if (all[i].t_in < 0.5f) seen[seen_count++] = all[i];
        }
        float rgba[4], depth, seen_rgba[4], seen_depth;
        comp_merge_pixel(all, count, blue, rgba, &depth);
        comp_merge_pixel(seen, seen_count, black, seen_rgba, &seen_depth);
        assert_memory_equal(rgba, seen_rgba, sizeof rgba);
        assert_true(rgba[3] == 1);
        assert_true(depth == seen_depth && depth <= 0.5f);
    }
}

static void surface_is_before_volume_at_equal_depth(void **context)
{
    (void)context;
    const fragment wall = {.t_in = 2, .t_out = 2, .colour = {1, 0, 0}, .kind = FRAGMENT_SURFACE};
    const fragment fog = {.t_in = 2, .t_out = 3, .colour = {0, 0.5f, 0}, .transmittance = 0.5f};
    for (int order = 0; order < 2; order++) {
        fragment items[2] = {order ? wall : fog, order ? fog : wall};
        float rgba[4], depth;
        comp_merge_pixel(items, 2, blue, rgba, &depth);
        const float red[4] = {1, 0, 0, 1};
        assert_memory_equal(rgba, red, sizeof rgba);
        assert_true(depth == 2);
    }
}

static void depth_is_that_of_surface_behind_opaque_fog(void **context)
{
    (void)context;
    fragment items[] = {{.t_in = 1, .t_out = 2, .colour = {0.5f, 0.5f, 0.5f}, .transmittance = 0},
                        {.t_in = 9, .t_out = 9, .transmittance = 0.5f, .kind = FRAGMENT_SURFACE + 1},
                        {.t_in = 4, .t_out = 4, .transmittance = 0.5f, .kind = FRAGMENT_SURFACE + 2}};
    float rgba[4], depth;
    comp_merge_pixel(items, 3, blue, rgba, &depth);
    assert_true(depth == 4);
    assert_true(rgba[0] == 0.5f && rgba[3] == 1);
}

static fragment blend_over(const fragment *front, const fragment *back)
{
    fragment both = {.t_in = front->t_in, .t_out = back->t_out};
    for (int c = 0; c < 3; c++) both.colour[c] = front->colour[c] + front->transmittance * back->colour[c];
    both.transmittance = front->transmittance * back->transmittance;
    return both;
}

static void joining_adjacent_segments_changes_only_rounding(void **context)
{
    (void)context;
    state = 3;
    for (int trial = 0; trial < 500; trial++) {
        fragment fine[most_fragments], coarse[most_fragments];
        const int count = 2 + trial % 50;
        int joined = 0;
        for (int i = 0; i < count; i++) {
            fine[i] = make_random_fragment();
            fine[i].kind = FRAGMENT_VOLUME;
            fine[i].t_in = (float)i;
            fine[i].t_out = (float)i + 1;
            if (joined > 0 && draw_random() % 2)
                coarse[joined - 1] = blend_over(&coarse[joined - 1], &fine[i]);
            else
                coarse[joined++] = fine[i];
        }
        float rgba[4], depth, joined_rgba[4];
        comp_merge_pixel(fine, count, blue, rgba, &depth);
        comp_merge_pixel(coarse, joined, blue, joined_rgba, &depth);
        for (int c = 0; c < 4; c++)
            assert_true(fabs((double)rgba[c] - (double)joined_rgba[c]) <= 2 * compute_tolerance(count));
    }
}

/* Returns a fragment that often ties with others: equal depths, zeros of both signs, fragments that differ in one
 * member only, and equal fragments. */
static fragment make_tied_fragment(void)
{
    fragment f = make_random_fragment();
    f.t_in = (float)(draw_random() % 3);
    if (f.t_in == 0 && draw_random() % 2) f.t_in = -0.0f;
    f.t_out = (float)(3 + draw_random() % 2);
    if (draw_random() % 2) f.transmittance = 0.5f;
    if (draw_random() % 2) f.colour[0] = f.colour[1] = f.colour[2] = 0.25f;
    return f;
}

static void permutations_give_the_same_bits(void **context)
{
    (void)context;
    state = 4;
    for (int trial = 0; trial < 300; trial++) {
        fragment items[most_fragments], sorted[most_fragments];
        const int count = 2 + trial % (most_fragments - 1);
        float rgba[4], depth, again_rgba[4], again_depth;
        for (int i = 0; i < count; i++) items[i] = make_tied_fragment();
        if (count > 3) items[count - 1] = items[0];
        comp_merge_pixel(items, count, blue, rgba, &depth);
        memcpy(sorted, items, (size_t)count * sizeof *items);
        for (int again = 0; again < 10; again++) {
            shuffle_fragments(items, count);
            comp_merge_pixel(items, count, blue, again_rgba, &again_depth);
            assert_memory_equal(rgba, again_rgba, sizeof rgba);
            assert_memory_equal(&depth, &again_depth, sizeof depth);
            assert_memory_equal(sorted, items, (size_t)count * sizeof *items);
        }
    }
}

/* ---- owners of blocks ---------------------------------------------------------------------------------------- */

/* Checks that every pixel has exactly one position in exactly one strip, that strips lie inside the picture, that the
 * number of blocks is bounded, and that every strip belongs to a block. */
static void check_grid(uint32_t width, uint32_t height, int ranks)
{
    const comp_grid grid = comp_make_grid(width, height, ranks);
    const uint32_t every = grid.strips / 5000000 + 1; /* only a sample is checked if there are many strips */
    uint64_t area = 0;
    assert_true(grid.blocks >= 1 && grid.blocks <= comp_max_blocks(ranks));
    assert_true(ranks == 1 ||
                grid.blocks >= COMP_BLOCKS_PER_RANK *
                                   (uint32_t)(ranks < COMP_COUNTED_RANKS_MAX ? ranks : COMP_COUNTED_RANKS_MAX) ||
                (grid.row_shift == 0 && grid.blocks == grid.strips));
    for (uint64_t s64 = 0; s64 < grid.strips; s64 += every) {
        const uint32_t s = (uint32_t)s64;
        const comp_area strip = comp_find_strip_area(&grid, s);
        assert_true(strip.width >= 1 && strip.height >= 1);
        assert_true(strip.x + strip.width <= width && strip.y + strip.height <= height);
        assert_true(comp_find_block_of_strip(&grid, s) < grid.blocks);
        area += (uint64_t)strip.width * strip.height;
    }
    assert_true(every > 1 || area == (uint64_t)width * height);
    for (int trial = 0; trial < 2000; trial++) {
        const uint32_t last = (uint32_t)((uint64_t)width * height - 1);
        const uint32_t pixel = trial == 0 ? last : draw_random() % (last + (last < UINT32_MAX));
        const uint32_t strip = comp_find_strip_of_pixel(&grid, pixel), at = comp_grid_index_in_strip(&grid, pixel);
        const comp_area its = comp_find_strip_area(&grid, strip);
        assert_int_equal(comp_find_row_of_pixel(&grid, pixel), pixel / width);
        assert_true(strip < grid.strips && at < COMP_STRIP_PIXELS);
        assert_true(at % COMP_LANES < its.width && at / COMP_LANES < its.height);
        assert_int_equal(comp_find_pixel_of_strip(&grid, strip, at), pixel);
    }
}

static void strips_share_all_pixels(void **context)
{
    (void)context;
    const uint32_t sizes[][2] = {{1, 1},         {1, 7},         {16, 32},         {17, 33},
                                 {640, 480},     {1021, 769},    {1920, 1080},     {7680, 4320},
                                 {32768, 32768}, {65535, 65537}, {4294967295u, 1}, {1, 4294967295u}};
    state = 4;
    static const int ranks[] = {1, 2, 32, 33, 1000, 100000};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        for (size_t n = 0; n < sizeof ranks / sizeof *ranks; n++) check_grid(sizes[i][0], sizes[i][1], ranks[n]);
}

/* Returns the rank that wins the block, given the number of fragments that each rank has in it. */
static int find_block_winner(uint32_t block, const int64_t *fragments, int ranks)
{
    int32_t greatest = 0;
    for (int r = 0; r < ranks; r++) {
        const int32_t priority = comp_claim_priority(block, r, fragments[r]);
        assert_true(fragments[r] ? comp_priority_rank(priority) == r && priority > 0 : priority == 0);
        if (priority > greatest) greatest = priority;
    }
    return comp_priority_rank(greatest);
}

/* Checks that the probability p of a rank to win a block is proportional to the fourth power of its number of
 * fragments. In n draws a rank must win pn times, with a tolerance of five standard deviations sqrt(n p (1 - p)),
 * exceeded in one case of a million, plus p n / 16, because priorities are rounded to 1/16 of p. */
static void owner_probability_follows_fragment_count(void **context)
{
    (void)context;
    enum { DRAWS = 20000, RANKS = 5 };
    static const int64_t cases[][RANKS] = {
        {1, 1, 0, 0, 0}, {7, 7, 7, 7, 7}, {300, 100, 0, 200, 250}, {2000000000, 1500000000, 1, 0, 0}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        int won[RANKS] = {0};
        double all = 0;
        for (int r = 0; r < RANKS; r++) all += pow((double)cases[i][r], 4);
        for (uint32_t block = 0; block < DRAWS; block++) won[find_block_winner(block, cases[i], RANKS)]++;
        for (int r = 0; r < RANKS; r++) {
            const double p = pow((double)cases[i][r], 4) / all;
            assert_true(fabs(won[r] - p * DRAWS) <= 5 * sqrt(DRAWS * p * (1 - p)) + DRAWS * p * (1 - p) / 16);
        }
    }
}

/* The covered part of a row of a shape: lower <= |x| < upper. Pictures have height 1 and are centred at 0. */
typedef struct interval {
    double lower, upper;
} interval;

static double compute_circle_half_width(double radius, double y)
{
    return fabs(y) < radius ? sqrt(radius * radius - y * y) : 0;
}

static interval compute_disc_interval(double y)
{
    return (interval){0, compute_circle_half_width(0.3, y)};
}
static interval compute_ring_interval(double y)
{
    return (interval){compute_circle_half_width(0.35, y), compute_circle_half_width(0.45, y)};
}
static interval compute_column_interval(double y)
{
    (void)y;
    return (interval){0, 0.15};
}
static interval compute_band_interval(double y)
{
    return (interval){0, fabs(y) < 0.15 ? 100 : 0};
}

typedef interval span_function(double y);

enum { MOST_RANKS = 1000 };

static comp_claim claims[2 * COMP_BLOCKS_PER_RANK * MOST_RANKS];

static void claim_span(const comp_grid *grid, uint32_t y, double from, double to)
{
    const uint32_t begin = (uint32_t)fmin(fmax(ceil(from), 0), grid->width);
    const uint32_t end = (uint32_t)fmin(fmax(ceil(to), 0), grid->width);
    for (uint32_t x = begin, next; x < end; x = next) {
        next = x / COMP_LANES * COMP_LANES + COMP_LANES < end ? x / COMP_LANES * COMP_LANES + COMP_LANES : end;
        claims[comp_find_block_of_strip(grid, comp_find_strip_of_pixel(grid, y * grid->width + x))].fragments +=
            next - x;
    }
}

/* Sets the claims of a shape: one fragment in each covered pixel and no priorities. Returns the number of covered
 * pixels. */
static int64_t set_claims_of_shape(const comp_grid *grid, span_function *span_of)
{
    int64_t covered = 0;
    memset(claims, 0, grid->blocks * sizeof *claims);
    for (uint32_t y = 0; y < grid->height; y++) {
        const interval s = span_of((y + 0.5) / grid->height - 0.5);
        const double middle = 0.5 * grid->width - 0.5, lower = s.lower * grid->height, upper = s.upper * grid->height;
        if (lower > 0) {
            claim_span(grid, y, middle - upper, middle - lower);
            claim_span(grid, y, middle + lower, middle + upper);
        } else {
            claim_span(grid, y, middle - upper, middle + upper);
        }
    }
    for (uint32_t b = 0; b < grid->blocks; b++) covered += claims[b].fragments;
    return covered;
}

/* Balances the claims, whose priorities must be set. Checks that no fragment is lost, that a rank which won no
 * fragments before owns none afterwards, and that no rank owns more than the mean over the owners plus the fragments of
 * the fullest block. Returns the largest number of fragments of a rank divided by the mean over all ranks. */
static double check_levels(uint32_t blocks, int ranks)
{
    static uint64_t won[MOST_RANKS], owned[MOST_RANKS], loads[MOST_RANKS];
    uint64_t all = 0, fullest = 0, busiest = 0;
    int owners = 0;
    memset(won, 0, sizeof won);
    memset(owned, 0, sizeof owned);
    for (uint32_t b = 0; b < blocks; b++) {
        if (!claims[b].priority) continue;
        won[comp_priority_rank(claims[b].priority)] += claims[b].fragments;
        all += claims[b].fragments;
        fullest = claims[b].fragments > fullest ? claims[b].fragments : fullest;
    }
    comp_claims_balance(claims, blocks, loads, ranks);
    for (uint32_t b = 0; b < blocks; b++)
        if (claims[b].priority) owned[comp_priority_rank(claims[b].priority)] += claims[b].fragments;
    for (int r = 0; r < ranks; r++) {
        assert_true(owned[r] == loads[r] && !owned[r] == !won[r]);
        owners += owned[r] > 0;
        busiest = owned[r] > busiest ? owned[r] : busiest;
        all -= owned[r];
    }
    assert_true(all == 0);
    for (int r = 0; r < ranks; r++) all += owned[r];
    assert_true(busiest * (uint64_t)owners <= all + fullest * (uint64_t)owners);
    return all ? (double)busiest * ranks / (double)all : 1;
}

/* Checks that if all ranks have the same fragments, each rank owns the mean to a tenth. Pictures are 1000 to 4096
 * pixels wide, at least an eighth of each is covered, and there are up to a thousand ranks. Any rank may then win a
 * block. A block has at least 16 pixels: if there are fewer than ten blocks per rank on average, no rank owns more than
 * the mean plus one block (check_levels()). */
static void equal_fragments_of_all_ranks_are_balanced_over_owners(void **context)
{
    (void)context;
    static span_function *const shapes[] = {compute_disc_interval, compute_ring_interval, compute_column_interval,
                                            compute_band_interval};
    static const uint32_t widths[] = {1000, 1023, 1024, 1025, 1280, 1531, 1920, 2048, 2560, 3000, 3840, 4093, 4096};
    static const int ranks[] = {1,  2,   3,   5,   7,   8,   13,  16,  31,  32,  33,  61,  64,
                                97, 100, 127, 128, 199, 256, 257, 401, 512, 600, 729, 997, MOST_RANKS};
    enum { ENOUGH = 10 * COMP_LANES };
    int uneven = 0;
    state = 17;
    for (size_t w = 0; w < sizeof widths / sizeof *widths; w++)
        for (int square = 0; square < 2; square++)
            for (size_t n = 0; n < sizeof ranks / sizeof *ranks; n++) {
                const uint32_t width = widths[w], height = square ? width : width * 9 / 16;
                const comp_grid grid = comp_make_grid(width, height, ranks[n]);
                for (size_t k = 0; k < sizeof shapes / sizeof *shapes; k++) {
                    const int64_t covered = set_claims_of_shape(&grid, shapes[k]);
                    for (uint32_t b = 0; b < grid.blocks; b++)
                        claims[b].priority =
                            comp_claim_priority(b, (int)(draw_random() % (uint32_t)ranks[n]), claims[b].fragments);
                    const double skew = check_levels(grid.blocks, ranks[n]);
                    if (skew <= 1.1 || covered < ENOUGH * (int64_t)ranks[n]) continue;
                    fprintf(stderr, "%u x %u, %d ranks, shape %d: %g\n", width, height, ranks[n], (int)k, skew);
                    uneven++;
                }
            }
    assert_int_equal(uneven, 0);
}

/* Distributes a block's `count` fragments. Even ranks have fragments in all blocks; odd ranks have none in half of the
 * blocks. */
static void distribute_fragments(uint32_t block, int64_t count, int ranks, int64_t *have)
{
    for (int r = 0; r < ranks; r++) have[r] = r % 2 && (block >> 5) % 2 ? 0 : count;
}

/* Checks that the numbers of fragments that ranks own differ by at most a tenth if the ranks draw different parts of
 * the picture. Priorities of the ranks decide which blocks they win. */
static void different_fragments_of_ranks_are_balanced_over_owners(void **context)
{
    (void)context;
    static const int ranks[] = {2, 3, 16, 64, 100, 509};
    for (size_t n = 0; n < sizeof ranks / sizeof *ranks; n++) {
        const comp_grid grid = comp_make_grid(1280, 720, ranks[n]);
        set_claims_of_shape(&grid, compute_disc_interval);
        for (uint32_t b = 0; b < grid.blocks; b++) {
            int64_t have[MOST_RANKS];
            distribute_fragments(b, claims[b].fragments, ranks[n], have);
            const comp_claim seen = claims[b];
            claims[b] = (comp_claim){0, 0};
            for (int r = 0; r < ranks[n]; r++)
                comp_claim_add(&(comp_claim){comp_claim_priority(b, r, have[r]), (uint32_t)have[r]}, &claims[b]);
            assert_true(!claims[b].priority == !seen.fragments &&
                        (!seen.fragments || claims[b].fragments % seen.fragments == 0));
        }
        assert_true(check_levels(grid.blocks, ranks[n]) <= 1.1);
    }
}

/* Sets random priorities, assigns the winning ranks to their positions in the route, and checks that each position owns
 * the mean number of fragments to a tenth. */
static void check_balance_on_route(const comp_route *route)
{
    const comp_grid grid = comp_make_grid(1920, 1080, route->ranks);
    set_claims_of_shape(&grid, compute_disc_interval);
    for (uint32_t b = 0; b < grid.blocks; b++)
        claims[b].priority = comp_claim_priority(b, (int)(draw_random() % (uint32_t)route->ranks), claims[b].fragments);
    comp_convert_claims_to_places(route, claims, grid.blocks);
    for (uint32_t b = 0; b < grid.blocks; b++) assert_true(comp_priority_rank(claims[b].priority) < route->owners);
    assert_true(check_levels(grid.blocks, route->owners) <= 1.1);
}

/* Checks the balance of fragments on routes that have fewer owners than ranks. A position that stands for two ranks
 * wins more blocks than the others. */
static void fragments_are_balanced_with_fewer_owners_than_ranks(void **context)
{
    (void)context;
    static const int ranks[][2] = {{3, 1},
                                   {5, 1},
                                   {7, 1},
                                   {12, 4},
                                   /* ranks: number of ranks, and number of ranks per node */
                                   {33, 3},
                                   {100, 4},
                                   {191, 1},
                                   {996, 12}};
    int folded = 0;
    state = 23;
    for (size_t n = 0; n < sizeof ranks / sizeof *ranks; n++)
        for (comp_schedule s = COMP_DIRECT; s < COMP_SCHEDULE_COUNT; s++)
            for (int is_cyclic = 0; is_cyclic < 2; is_cyclic++) {
                const comp_route route = comp_make_route(s, ranks[n][0], (comp_nodes){ranks[n][1], is_cyclic}, 8);
                folded += route.owners < route.ranks;
                check_balance_on_route(&route);
            }
    assert_true(folded >= 20);
}

/* Returns the rank that wins block b of `blocks` blocks, by one of six unfair rules. */
static int get_unfair_winner(int how, uint32_t b, uint32_t blocks, int ranks)
{
    const uint32_t count = (uint32_t)ranks;
    switch (how) {
    /* rank 0 has almost all blocks, the others one each */
    case 0: return (int)(b < count ? b : 0);
    case 1:
        return (int)(b < count ? 0 : b % count); /* rank 0 has the first `count` blocks */
    /* each rank has consecutive blocks, the first ranks have the most */
    case 2: return (int)((uint64_t)b * b / blocks * count / blocks);
    case 3: return (int)(draw_random() % (1 + draw_random() % count)); /* low ranks often win, high ranks rarely */
    case 4: return ranks - 1;                                          /* the last rank has all blocks */
    default: return (int)(draw_random() % count);
    }
}

/* Returns the number of fragments in block b by one of six rules: equal in all blocks; 1 except in one block; random; 0
 * in most blocks; near the largest number that the counter holds; none. */
static uint32_t get_unfair_fragment_count(int how, uint32_t b, uint32_t blocks)
{
    switch (how) {
    case 0: return 512;
    case 1: return b == blocks / 2 ? 1000000 : 1;
    case 2: return 1 + draw_random() % 100000;
    case 3: return draw_random() % 10 ? 0 : 1 + draw_random() % 512;
    case 4: return UINT32_MAX - draw_random() % 2;
    default: return 0; /* no rank has any fragments */
    }
}

/* Checks that check_levels() holds for any winners and any numbers of fragments. */
static void uneven_shares_are_balanced(void **context)
{
    (void)context;
    static const int ranks[] = {1, 2, 3, 7, 16, 61, 128, MOST_RANKS};
    state = 19;
    for (size_t n = 0; n < sizeof ranks / sizeof *ranks; n++)
        for (int winners = 0; winners < 6; winners++)
            for (int fragments = 0; fragments < 6; fragments++)
                for (uint32_t blocks = 1; blocks <= COMP_BLOCKS_PER_RANK * MOST_RANKS; blocks *= 11) {
                    for (uint32_t b = 0; b < blocks; b++) {
                        claims[b].fragments = get_unfair_fragment_count(fragments, b, blocks);
                        claims[b].priority = comp_claim_priority(b, get_unfair_winner(winners, b, blocks, ranks[n]),
                                                                 claims[b].fragments);
                    }
                    check_levels(blocks, ranks[n]);
                }
}

/* Checks that the sum of claims does not depend on their order, even if there are more fragments than the counter
 * holds. */
static void claims_add_in_any_order(void **context)
{
    (void)context;
    const comp_claim three[3] = {{5, 7}, {9, UINT32_MAX - 1}, {0, 0}};
    for (int first = 0; first < 3; first++) {
        comp_claim sum = three[first];
        comp_claim_add(&three[(first + 1) % 3], &sum);
        comp_claim_add(&three[(first + 2) % 3], &sum);
        assert_true(sum.priority == 9 && sum.fragments == UINT32_MAX);
    }
}

/* ---- strips -------------------------------------------------------------------------------------------------- */

/* The fragments that were unpacked from received sheets. A sheet is a message unit: at most one fragment for each pixel
 * of a strip. */
typedef struct received_sheets {
    const comp_grid *grid;
    fragment *items;
    int64_t count, sheets;
} received_sheets;

static bool store_sheet(void *state_of, const comp_sheet *sheet, int count)
{
    received_sheets *h = state_of;
    assert_int_equal(comp_sheet_count_pixels(sheet), count);
    for (uint32_t k = 0; k < COMP_STRIP_PIXELS; k++)
        if (comp_sheet_has(sheet, k))
            h->items[h->count++] = comp_sheet_get(sheet, k, comp_find_pixel_of_strip(h->grid, sheet->strip, k));
    h->sheets++;
    return true;
}

static int compare_all_bits(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(fragment));
}

/* Checks that all fragments of a list are sent in sheets of their strips, for any number of threads. A strip needs as
 * many sheets as its fullest pixel has fragments. */
static void sheets_contain_all_fragments(void **context)
{
    (void)context;
    enum { COUNT = 40000 };
    static fragment items[COUNT], back[COUNT];
    comp_layers *layers = base_calloc(1, sizeof *layers);
    assert_non_null(layers);
    state = 11;
    for (int threads = 1; threads <= 4; threads += 3)
        for (int spread = 1; spread <= 1000; spread *= 10) {
            comp_grid grid = comp_make_grid(101, 67, threads); /* the grid for four ranks has shorter strips */
            comp_strips strips;
            received_sheets h = {&grid, back, 0, 0};
            grid.threads = threads;
            for (int i = 0; i < COUNT; i++) {
                items[i] = make_random_fragment();
                items[i].pixel =
                    spread == 1 ? (uint32_t)i * 7 % (101 * 67) : draw_random() % (101 * 67) / (uint32_t)spread;
            }
            assert_int_equal(comp_strips_make(&grid, &(fragment_list){items, COUNT, COUNT}, &strips, NULL), INSITU_OK);
            for (uint32_t s = 0; s < grid.strips; s++) {
                const int64_t before = h.count;
                assert_true(comp_strips_pass_sheets(&strips, s, layers, store_sheet, &h));
                assert_int_equal(h.count - before, comp_strips_count_fragments(&strips, s));
            }
            assert_int_equal(h.count, COUNT);
            qsort(items, COUNT, sizeof *items, compare_all_bits);
            qsort(back, COUNT, sizeof *back, compare_all_bits);
            assert_memory_equal(items, back, sizeof items);
            comp_strips_free(&strips);
        }
    comp_layers_free(layers);
    base_free(layers);
}

static void pixels_outside_the_image_are_detected(void **context)
{
    (void)context;
    const comp_grid grid = comp_make_grid(10, 10, 1);
    fragment items[3] = {{.pixel = 99}, {.pixel = 0}, {.pixel = 100}};
    comp_strips strips;
    for (int count = 0; count <= 3; count++) {
        base_error error = {INSITU_OK, ""};
        const insitu_status status = comp_strips_make(&grid, &(fragment_list){items, count, 3}, &strips, &error);
        assert_int_equal(status, count < 3 ? INSITU_OK : INSITU_ERROR_INTERNAL);
        if (!status) comp_strips_free(&strips);
    }
}

/* Checks samples of several volumes at the same depth. Together, in any order, they absorb all light that does not pass
 * every one of them, and each contributes colour in proportion to its own absorption. */
static void samples_at_one_depth_share_absorption(void **context)
{
    (void)context;
    state = 9;
    for (int count = 1; count <= 20; count++) {
        fragment items[20];
        double colour[3] = {0, 0, 0}, through = 1, weight = 0;
        float rgba[4], depth;
        for (int i = 0; i < count; i++) {
            items[i] = make_random_fragment();
            items[i].kind = FRAGMENT_VOLUME;
            items[i].t_in = items[i].t_out = 3;
            for (int c = 0; c < 3; c++) colour[c] += (double)items[i].colour[c];
            through *= (double)items[i].transmittance;
            weight += 1 - (double)items[i].transmittance;
        }
        comp_merge_pixel(items, count, black, rgba, &depth);
        const double share = weight > 0 ? (1 - through) / weight : 1;
        for (int c = 0; c < 3; c++) assert_true(fabs((double)rgba[c] - colour[c] * share) <= compute_tolerance(1));
        assert_true(fabs((double)rgba[3] - (1 - through)) <= compute_tolerance(1));
    }
}

/* A homogeneous medium. */
typedef struct medium {
    double begin, end, extinction, colour[3];
} medium;

static fragment make_fragment(const medium *m)
{
    const double clear = exp(-m->extinction * (m->end - m->begin));
    fragment f = {.t_in = (float)m->begin, .t_out = (float)m->end, .transmittance = (float)clear};
    for (int c = 0; c < 3; c++) f.colour[c] = (float)(m->colour[c] * (1 - clear));
    return f;
}

/* Integrates all media together. Steps end at multiples of 1/8, at which all media begin and end. A surface is at depth
 * 4. */
static void mix_media(const medium *media, int count, const fragment *surface, double rgba[4])
{
    double through = 1;
    rgba[0] = rgba[1] = rgba[2] = 0;
    for (int i = 0; i < 64; i++) {
        double depth = 0, colour[3] = {0, 0, 0};
        for (int c = 0; c < 3 && i == 32; c++) rgba[c] += through * (double)surface->colour[c];
        if (i == 32) through *= (double)surface->transmittance;
        for (int k = 0; k < count; k++) {
            if (media[k].begin > i / 8.0 || media[k].end < (i + 1) / 8.0) continue;
            depth += media[k].extinction / 8;
            for (int c = 0; c < 3; c++) colour[c] += media[k].extinction / 8 * media[k].colour[c];
        }
        for (int c = 0; c < 3 && depth > 0; c++) rgba[c] += through * colour[c] / depth * -expm1(-depth);
        through *= exp(-depth);
    }
    rgba[3] = 1 - through;
}

/* Checks that overlapping volume fragments are mixed. Rounding T and C to float makes an error of 3e-8. The optical
 * depth of a medium is at most 2, so its error is up to e^2 times as large: 3e-7 for each medium. */
static void overlapping_segments_are_mixed(void **context)
{
    (void)context;
    state = 12;
    for (int trial = 0; trial < 500; trial++) {
        medium media[12];
        fragment items[13];
        double expected[4];
        float rgba[4], depth;
        const int count = 1 + trial % 12;
        for (int k = 0; k < count; k++) {
            const double begin = (double)(draw_random() % 60) / 8, most = 8 - begin;
            media[k] = (medium){begin, begin + fmin(most, (double)(1 + draw_random() % 30) / 8), 0, {0, 0, 0}};
            media[k].extinction = 2 * (double)draw_unit_number() / (media[k].end - begin);
            for (int c = 0; c < 3; c++) media[k].colour[c] = (double)draw_unit_number();
            items[k] = make_fragment(&media[k]);
        }
        items[count] = (fragment){.t_in = 4, .t_out = 4, .colour = {0.25f, 0, 0.125f}, .transmittance = 0.5f};
        items[count].kind = FRAGMENT_SURFACE;
        mix_media(media, count, &items[count], expected);
        comp_merge_pixel(items, count + 1, black, rgba, &depth);
        for (int c = 0; c < 4; c++) assert_true(fabs((double)rgba[c] - expected[c]) <= 3e-7 * (count + 1));
        assert_true(depth == 4);
    }
}

/* Checks a ray through a fine and a coarse mesh: one long interval overlaps many short ones in a row. The time must be
 * proportional to the number of intervals; a quadratic algorithm would take minutes. All short intervals mix the same
 * two media, so the result equals one medium whose extinction is the sum. The sum over so many intervals has an error
 * below 1e-9, rounding to float one below 3e-7. */
static void many_short_segments_within_a_long_one_merge_fast(void **context)
{
    (void)context;
    enum { SHORT = 200000 };
    const float clear = 0.99999f;
    fragment *items = calloc(SHORT + 1, sizeof *items);
    for (int i = 0; i < SHORT; i++) {
        fragment *f = &items[(int64_t)i * 7919 % SHORT]; /* in shuffled order */
        *f = (fragment){.t_in = (float)i, .t_out = (float)(i + 1), .transmittance = clear};
        f->colour[0] = 1 - clear;
    }
    items[SHORT] = (fragment){.t_in = 0, .t_out = SHORT, .colour = {0, 0.5f, 0}, .transmittance = 0.5f};
    float rgba[4], depth;
    const clock_t start = clock();
    comp_merge_pixel(items, SHORT + 1, black, rgba, &depth);
    const double seconds = (double)(clock() - start) / CLOCKS_PER_SEC;
    const double red = -log((double)clear) * SHORT, green = -log(0.5), all = red + green, light = -expm1(-all) / all;
    assert_true(fabs((double)rgba[0] - red * light) < 3e-7 && fabs((double)rgba[1] - green * light) < 3e-7);
    assert_true(fabs((double)rgba[3] + expm1(-all)) < 3e-7);
    for (int i = 0; i < SHORT; i++) assert_true(items[i].t_in <= items[i + 1].t_in);
    assert_true(comp_pixel_overlaps(items, SHORT + 1));
    assert_true(seconds < 2);
    free(items);
}

/* Checks that a sample at the common face of two cells counts one time. If rounding gives it to both cells, the
 * fragment of the cell behind is kept, in either order. */
static void samples_of_neighbours_count_once(void **context)
{
    (void)context;
    const fragment ahead = {0, 1, 1, {0.5f, 0, 0}, 0.5f, FRAGMENT_VOLUME + FRAGMENT_LATE};
    const fragment behind = {0, 1, 1, {0, 0.25f, 0}, 0.75f, FRAGMENT_VOLUME + FRAGMENT_EARLY};
    for (int turn = 0; turn < 2; turn++) {
        fragment items[2] = {turn ? ahead : behind, turn ? behind : ahead};
        float rgba[4], depth;
        comp_merge_pixel(items, 2, black, rgba, &depth);
        assert_true(rgba[0] == 0 && rgba[1] == 0.25f && rgba[3] == 0.25f);
    }
}

static bool are_overlapping(const fragment *given, int count)
{
    fragment items[4];
    float rgba[4], depth;
    memcpy(items, given, (size_t)count * sizeof *items);
    comp_merge_pixel(items, count, black, rgba, &depth);
    return comp_pixel_overlaps(items, count);
}

static void overlaps_are_found_only_before_a_volume_ends(void **context)
{
    (void)context;
    enum { V = FRAGMENT_VOLUME, S = FRAGMENT_SURFACE, EARLY = FRAGMENT_EARLY, LATE = FRAGMENT_LATE };
    const struct {
        int count;
        fragment items[3];
        bool overlap;
    } cases[] = {
        {0, {{0}}, false},
        {1, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f, .kind = V}}, false},
        {2, {{.t_in = 2, .t_out = 3, .transmittance = 0.5f}, {.t_in = 0, .t_out = 1, .transmittance = 0.5f}}, false},
        {2, {{.t_in = 1, .t_out = 3, .transmittance = 0.5f}, {.t_in = 0, .t_out = 1, .transmittance = 0.5f}}, true},
        {2, {{.t_in = 1, .t_out = 1, .transmittance = 0.5f}, {.t_in = 1, .t_out = 1, .transmittance = 1}}, true},
        /* inside a long interval and behind a short one */
        {3,
         {{.t_in = 0, .t_out = 9, .transmittance = 0.5f},
          {.t_in = 1, .t_out = 2, .transmittance = 0.5f},
          {.t_in = 4, .t_out = 5, .transmittance = 0.5f}},
         true},
        /* a surface in front of a volume, inside it, at its end and behind it; two surfaces at the same depth */
        {2, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f}, {1, 1, 1, {0}, 0.5f, S}}, false},
        {2, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f}, {0, 1.5f, 1.5f, {0}, 0.5f, S}}, true},
        {2, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f}, {0, 2, 2, {0}, 0, S}}, true},
        {2, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f}, {0, 3, 3, {0}, 0, S}}, false},
        /* a surface at the depth at which a volume begins, within rounding; it still overlaps a volume that begins in
         * front of it */
        {2, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f}, {0, 1.000003f, 1.000003f, {0}, 0.5f, S}}, false},
        {2, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f}, {0, 1.00001f, 1.00001f, {0}, 0.5f, S}}, true},
        {2, {{.t_in = 8, .t_out = 9, .transmittance = 0.5f}, {0, 8.00002f, 8.00002f, {0}, 0.5f, S}}, false},
        {3,
         {{.t_in = 1, .t_out = 1.0000005f, .transmittance = 0.5f},
          {0, 1.000001f, 1.000001f, {0}, 0.5f, S},
          {.t_in = 0, .t_out = 1.000002f, .transmittance = 0.5f}},
         true},
        {3,
         {{0, 1, 1, {0}, 0.5f, S},
          {.t_in = 0, .t_out = 0.9f, .transmittance = 0.5f},
          {.t_in = 0.999999f, .t_out = 2, .transmittance = 0.5f}},
         false},
        {2, {{0, 1, 1, {0}, 0.5f, S}, {0, 1, 1, {0}, 0.5f, S + 1}}, false},
        /* fragments behind an opaque one are invisible, so they do not overlap */
        {3,
         {{0, 1, 1, {0}, 0, S},
          {.t_in = 2, .t_out = 4, .transmittance = 0.5f},
          {.t_in = 3, .t_out = 5, .transmittance = 0.5f}},
         false},
        /* an overlap shorter than the rounding of depths */
        {2,
         {{.t_in = 0, .t_out = 2, .transmittance = 0.5f}, {.t_in = 1, .t_out = 0.99f, .transmittance = 0.5f}},
         false},
        /* samples of two cells whose common face is rounded to two depths; samples of two cells at the same position;
         * samples at the depth of another volume's samples */
        {2, {{0, 1, 1, {0}, 0.5f, V + LATE}, {0, 1, 1, {0}, 0.5f, V + EARLY}}, false},
        {2, {{0, 1, 1, {0}, 0.5f, V + LATE}, {0, 1, 1, {0}, 0.5f, V}}, true},
        {2, {{0, 1, 1, {0}, 0.5f, V + LATE}, {0, 1, 1, {0}, 0.5f, V + LATE}}, true},
        {3, {{0, 1, 1, {0}, 0.5f, V + EARLY}, {0, 1, 1, {0}, 0.5f, V + EARLY}, {0, 1, 1, {0}, 0.5f, V + LATE}}, true},
        {2, {{0, 1, 1, {0}, 0.5f, V}, {0, 1, 1, {0}, 0.5f, V + FRAGMENT_LAYER}}, false},
        {2, {{0, 1, 1, {0}, 0.5f, V + LATE}, {0, 1, 1, {0}, 0.5f, V + FRAGMENT_LAYER + EARLY}}, false},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        if (are_overlapping(cases[i].items, cases[i].count) != cases[i].overlap) fail_msg("case %d", (int)i);
}

/* ---- tiles --------------------------------------------------------------------------------------------------- */

enum { LARGEST_TILE = 20 };

/* The fragments of a picture. A pixel has none, one or many, in any order within its tile. */
typedef struct tiled {
    image picture;
    fragment *items; /* grouped by tile */
    int64_t starts[64];
    pixel_area areas[64];
    int tile_count;
} tiled;

static int64_t draw_count(int most)
{
    return draw_random() % 3 ? (int64_t)(draw_random() % (uint32_t)(most + 1)) : 0;
}

/* Returns a volume fragment whose depths are rounded, so that it may overlap other fragments or be a sample at the same
 * depth. */
static fragment make_crowded_fragment(uint32_t pixel)
{
    fragment f = make_random_fragment();
    f.pixel = pixel;
    f.t_in = floorf(f.t_in * 16) / 16;
    f.t_out = f.kind >= FRAGMENT_SURFACE || draw_random() % 2 ? f.t_in : f.t_out;
    return f;
}

static void make_tiled(tiled *t, int width, int height, int tile, int most)
{
    int64_t count = 0;
    *t = (tiled){.picture = {.width = width, .height = height}};
    t->picture.rgba = malloc((size_t)width * (size_t)height * 4 * sizeof(float));
    t->picture.depth = malloc((size_t)width * (size_t)height * sizeof(float));
    t->items = malloc((size_t)width * (size_t)height * (size_t)(most + 1) * sizeof *t->items);
    for (int y = 0; y < height; y += tile)
        for (int x = 0; x < width; x += tile) {
            const pixel_area area = {x, y, width - x < tile ? width - x : tile, height - y < tile ? height - y : tile};
            const int64_t first = count;
            for (int k = 0; k < area.width * area.height; k++)
                for (int64_t left = draw_count(most); left > 0; left--)
                    t->items[count++] =
                        make_crowded_fragment((uint32_t)((y + k / area.width) * width + x + k % area.width));
            shuffle_fragments(t->items + first, (int)(count - first));
            t->starts[t->tile_count] = first;
            t->areas[t->tile_count++] = area;
        }
    t->starts[t->tile_count] = count;
}

static void free_tiled(tiled *t)
{
    free(t->picture.rgba);
    free(t->picture.depth);
    free(t->items);
}

/* Merges the fragments of one pixel by the merge rule. Returns whether they overlap. */
static bool merge_pixel(const tiled *t, uint32_t pixel, float rgba[4], float *depth)
{
    fragment own[most_fragments];
    int count = 0;
    for (int64_t i = 0; i < t->starts[t->tile_count]; i++)
        if (t->items[i].pixel == pixel) own[count++] = t->items[i];
    comp_merge_pixel(own, count, blue, rgba, depth);
    return comp_pixel_overlaps(own, count);
}

static void check_tiled(const tiled *t, const comp_overlaps *overlaps, bool finds_overlaps)
{
    int64_t count = 0;
    for (int pixel = 0; pixel < t->picture.width * t->picture.height; pixel++) {
        float rgba[4], depth;
        const bool overlap = merge_pixel(t, (uint32_t)pixel, rgba, &depth) && finds_overlaps;
        assert_memory_equal(rgba, t->picture.rgba + 4 * pixel, sizeof rgba);
        if (t->picture.depth) assert_memory_equal(&depth, t->picture.depth + pixel, sizeof depth);
        assert_int_equal(overlap, overlaps->count && pixel_set_has(overlaps->pixels, pixel));
        count += overlap;
    }
    assert_int_equal(count, overlaps->count);
    assert_int_equal(count > 0, overlaps->pixels != NULL);
}

static void tiles_are_merged_bitwise(void **context)
{
    (void)context;
    state = 7;
    for (int trial = 0; trial < 60; trial++) {
        const int64_t held = base_memory_held();
        const bool finds_overlaps = trial % 2;
        tiled t;
        comp_tiles tiles;
        comp_overlaps overlaps;
        comp_statistics statistics;
        base_error error = {0};
        make_tiled(&t, 1 + (int)(draw_random() % 50), 1 + (int)(draw_random() % 40), trial % 7 == 3 ? LARGEST_TILE : 16,
                   trial % 10 ? trial % 5 : 30);
        if (trial % 3 == 0) free(t.picture.depth), t.picture.depth = NULL;
        assert_int_equal(comp_tiles_begin(&tiles, blue, 3, finds_overlaps, &t.picture, &error), INSITU_OK);
#pragma omp parallel for num_threads(3) schedule(dynamic, 1)
        for (int i = 0; i < t.tile_count; i++) {
            fragment given[LARGEST_TILE * LARGEST_TILE * 31];
            const int64_t count = t.starts[i + 1] - t.starts[i];
            if (count) memcpy(given, t.items + t.starts[i], (size_t)count * sizeof *given);
            if (!comp_tiles_blend(&tiles, omp_get_thread_num(), &t.areas[i], given, count)) abort();
        }
        comp_tiles_end(&tiles, &overlaps, &statistics);
        assert_int_equal(statistics.sent_fragments, t.starts[t.tile_count]);
        check_tiled(&t, &overlaps, finds_overlaps);
        base_free(overlaps.pixels);
        assert_int_equal(base_memory_held(), held);
        free_tiled(&t);
    }
}

static insitu_status merge_tiles(tiled *t, comp_overlaps *overlaps)
{
    comp_tiles tiles;
    comp_statistics statistics;
    base_error error = {0};
    insitu_status status = comp_tiles_begin(&tiles, blue, 1, true, &t->picture, &error);
    if (status != INSITU_OK) return status;
    for (int i = 0; i < t->tile_count && status == INSITU_OK; i++)
        if (!comp_tiles_blend(&tiles, 0, &t->areas[i], t->items + t->starts[i], t->starts[i + 1] - t->starts[i]))
            status = INSITU_ERROR_MEMORY;
    comp_tiles_end(&tiles, overlaps, &statistics);
    return status;
}

static void tiles_without_memory_are_refused(void **context)
{
    (void)context;
    state = 8;
    const int64_t held = base_memory_held();
    tiled t;
    int failures = 0;
    make_tiled(&t, 40, 20, 16, 5);
    for (int n = 1;; n++) {
        comp_overlaps overlaps = {0};
        base_memory_fail_nth(n);
        const insitu_status status = merge_tiles(&t, &overlaps);
        base_memory_fail_nth(0);
        if (status == INSITU_OK) check_tiled(&t, &overlaps, true);
        base_free(overlaps.pixels);
        assert_int_equal(base_memory_held(), held);
        if (status == INSITU_OK) break;
        assert_int_equal(status, INSITU_ERROR_MEMORY);
        failures++;
    }
    assert_true(failures > 4);
    free_tiled(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(merge_without_fragments_is_background),
        cmocka_unit_test(merge_matches_double_reference),
        cmocka_unit_test(transmittance_of_equal_slabs_is_a_power),
        cmocka_unit_test(opaque_surface_hides_what_is_behind),
        cmocka_unit_test(surface_is_before_volume_at_equal_depth),
        cmocka_unit_test(depth_is_that_of_surface_behind_opaque_fog),
        cmocka_unit_test(joining_adjacent_segments_changes_only_rounding),
        cmocka_unit_test(permutations_give_the_same_bits),
        cmocka_unit_test(samples_at_one_depth_share_absorption),
        cmocka_unit_test(overlapping_segments_are_mixed),
        cmocka_unit_test(many_short_segments_within_a_long_one_merge_fast),
        cmocka_unit_test(samples_of_neighbours_count_once),
        cmocka_unit_test(overlaps_are_found_only_before_a_volume_ends),
        cmocka_unit_test(strips_share_all_pixels),
        cmocka_unit_test(owner_probability_follows_fragment_count),
        cmocka_unit_test(claims_add_in_any_order),
        cmocka_unit_test(equal_fragments_of_all_ranks_are_balanced_over_owners),
        cmocka_unit_test(different_fragments_of_ranks_are_balanced_over_owners),
        cmocka_unit_test(fragments_are_balanced_with_fewer_owners_than_ranks),
        cmocka_unit_test(uneven_shares_are_balanced),
        cmocka_unit_test(sheets_contain_all_fragments),
        cmocka_unit_test(pixels_outside_the_image_are_detected),
        cmocka_unit_test(tiles_are_merged_bitwise),
        cmocka_unit_test(tiles_without_memory_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
