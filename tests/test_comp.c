/* Compositing without MPI: the rule of merging against a reference in double and closed forms, the owners' arithmetic
 * for many more ranks than a machine has, and the sort that both rest on. */
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
#include "comp_bucket.h"
#include "comp_schedule.h"
#include "comp_tiles.h"
#include "memory.h"

enum { most_fragments = 200 };

static const float black[4] = {0, 0, 0, 0};
static const float blue[4] = {0.125f, 0.25f, 0.5f, 0.75f};
static const double half_ulp = 0x1p-24; /* of a float in [0.5, 1) */

static uint64_t state;

static uint32_t next_random(void)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(state >> 32);
}

static float next_unit(void)
{
    return (float)(next_random() >> 8) * 0x1p-24f;
}

static fragment random_fragment(void)
{
    fragment f = {.t_in = next_unit(), .transmittance = next_unit()};
    f.t_out = f.t_in + next_unit();
    for (int c = 0; c < 3; c++) f.colour[c] = next_unit() * (1 - f.transmittance);
    f.kind = next_random() % 4 == 0 ? FRAGMENT_SURFACE + next_random() % 3 : FRAGMENT_VOLUME;
    return f;
}

static void shuffle(fragment *items, int count)
{
    for (int i = count - 1; i > 0; i--) {
        const int j = (int)(next_random() % (uint32_t)(i + 1));
        const fragment moved = items[i];
        items[i] = items[j];
        items[j] = moved;
    }
}

static int by_depth(const void *a, const void *b)
{
    const float of_a = ((const fragment *)a)->t_in, of_b = ((const fragment *)b)->t_in;
    return (of_a > of_b) - (of_a < of_b);
}

/* Each step of the blend rounds a product and a sum of colour and a product of transmittance, all at most 1: three
 * half units a step, and three for the background. */
static double tolerance(int count)
{
    return 3.0 * (count + 1) * half_ulp;
}

static void reference(const fragment *items, int count, const float background[4], double rgba[4])
{
    fragment sorted[most_fragments];
    memcpy(sorted, items, (size_t)count * sizeof *items);
    qsort(sorted, (size_t)count, sizeof *sorted, by_depth);
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
            items[i] = random_fragment();
            items[i].t_in = (float)(i * 37 % 101) + 0.5f * next_unit(); /* all distinct: 101 is prime */
            items[i].t_out = items[i].t_in + (items[i].kind < FRAGMENT_SURFACE ? 0.4f : 0);
            if (items[i].kind >= FRAGMENT_SURFACE) nearest = fminf(nearest, items[i].t_in);
        }
        reference(items, count, blue, expected);
        comp_merge_pixel(items, count, blue, rgba, &depth);
        for (int c = 0; c < 4; c++) assert_true(fabs((double)rgba[c] - expected[c]) <= tolerance(count));
        assert_true(depth == nearest);
    }
}

static void merge_of_equal_slabs_is_a_power(void **context)
{
    (void)context;
    for (int count = 1; count <= most_fragments; count++) {
        fragment items[most_fragments];
        float rgba[4], depth;
        for (int i = 0; i < count; i++) {
            const float q = 0.96875f; /* so that 1 - q is exact */
            const float t = (float)((i * 7) % count);
            items[i] = (fragment){.t_in = t, .t_out = t + 1, .colour = {1 - q, 0, (1 - q) / 2}, .transmittance = q};
        }
        comp_merge_pixel(items, count, black, rgba, &depth);
        const double alpha = 1 - pow(0.96875, count);
        assert_true(fabs((double)rgba[0] - alpha) <= tolerance(count));
        assert_true(rgba[1] == 0);
        assert_true(fabs((double)rgba[2] - alpha / 2) <= tolerance(count));
        assert_true(fabs((double)rgba[3] - alpha) <= tolerance(count));
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
            all[i] = random_fragment();
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

static void depth_is_of_the_surface_though_fog_is_opaque(void **context)
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

static fragment over(const fragment *front, const fragment *back)
{
    fragment both = {.t_in = front->t_in, .t_out = back->t_out};
    for (int c = 0; c < 3; c++) both.colour[c] = front->colour[c] + front->transmittance * back->colour[c];
    both.transmittance = front->transmittance * back->transmittance;
    return both;
}

static void joining_neighbours_changes_rounding_alone(void **context)
{
    (void)context;
    state = 3;
    for (int trial = 0; trial < 500; trial++) {
        fragment fine[most_fragments], coarse[most_fragments];
        const int count = 2 + trial % 50;
        int joined = 0;
        for (int i = 0; i < count; i++) {
            fine[i] = random_fragment();
            fine[i].kind = FRAGMENT_VOLUME;
            fine[i].t_in = (float)i;
            fine[i].t_out = (float)i + 1;
            if (joined > 0 && next_random() % 2)
                coarse[joined - 1] = over(&coarse[joined - 1], &fine[i]);
            else
                coarse[joined++] = fine[i];
        }
        float rgba[4], depth, joined_rgba[4];
        comp_merge_pixel(fine, count, blue, rgba, &depth);
        comp_merge_pixel(coarse, joined, blue, joined_rgba, &depth);
        for (int c = 0; c < 4; c++) assert_true(fabs((double)rgba[c] - (double)joined_rgba[c]) <= 2 * tolerance(count));
    }
}

/* Ties of every kind: equal depths, both zeros, equal fragments but for one field, equal fragments. */
static fragment tied_fragment(void)
{
    fragment f = random_fragment();
    f.t_in = (float)(next_random() % 3);
    if (f.t_in == 0 && next_random() % 2) f.t_in = -0.0f;
    f.t_out = (float)(3 + next_random() % 2);
    if (next_random() % 2) f.transmittance = 0.5f;
    if (next_random() % 2) f.colour[0] = f.colour[1] = f.colour[2] = 0.25f;
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
        for (int i = 0; i < count; i++) items[i] = tied_fragment();
        if (count > 3) items[count - 1] = items[0];
        comp_merge_pixel(items, count, blue, rgba, &depth);
        memcpy(sorted, items, (size_t)count * sizeof *items);
        for (int again = 0; again < 10; again++) {
            shuffle(items, count);
            comp_merge_pixel(items, count, blue, again_rgba, &again_depth);
            assert_memory_equal(rgba, again_rgba, sizeof rgba);
            assert_memory_equal(&depth, &again_depth, sizeof depth);
            assert_memory_equal(sorted, items, (size_t)count * sizeof *items);
        }
    }
}

static void check_layout(uint32_t pixel_count, int ranks)
{
    const comp_layout layout = comp_layout_of(pixel_count, ranks);
    const uint32_t run = 1u << layout.run_shift;
    uint32_t *owned = calloc((size_t)ranks, sizeof *owned);
    assert_non_null(owned);
    for (uint32_t pixel = 0; pixel < pixel_count; pixel++) {
        const int owner = comp_owner(pixel, pixel_count, ranks);
        assert_in_range(owner, 0, ranks - 1);
        assert_int_equal(comp_layout_index(&layout, pixel), owned[owner]);
        owned[owner]++;
    }
    uint32_t least = UINT32_MAX, most = 0;
    for (int rank = 0; rank < ranks; rank++) {
        assert_int_equal(comp_layout_owned(&layout, rank), owned[rank]);
        if (owned[rank] < least) least = owned[rank];
        if (owned[rank] > most) most = owned[rank];
    }
    assert_true(run <= 64);
    assert_true(most - least <= run);
    if (pixel_count >= (uint32_t)ranks) assert_true(least > 0);
    free(owned);
}

static void owners_share_all_pixels_evenly(void **context)
{
    (void)context;
    const int ranks[] = {1, 2, 3, 4, 7, 64, 1000, 4096, 65537, 100000};
    const uint32_t pixels[] = {1, 2, 63, 64, 65, 333, 640 * 480, 1021 * 769};
    for (size_t r = 0; r < sizeof ranks / sizeof *ranks; r++)
        for (size_t p = 0; p < sizeof pixels / sizeof *pixels; p++) check_layout(pixels[p], ranks[r]);
}

/* Tells whether a place of the picture is covered. */
typedef bool seen_function(double x, double y);

static bool is_in_disc(double x, double y)
{
    return hypot(x, y) < 0.3;
}
static bool is_in_ring(double x, double y)
{
    return fabs(hypot(x, y) - 0.4) < 0.05;
}
static bool is_in_column(double x, double y)
{
    (void)y;
    return fabs(x) < 0.15;
}
static bool is_in_band(double x, double y)
{
    (void)x;
    return fabs(y) < 0.15;
}

/* Most of what one rank owns of it, over the mean. */
static double skew_of(int width, int height, int ranks, seen_function *is_seen)
{
    const comp_layout layout = comp_layout_of((uint32_t)width * (uint32_t)height, ranks);
    int64_t *owned = calloc((size_t)ranks, sizeof *owned), most = 0, all = 0;
    assert_non_null(owned);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++) {
            if (!is_seen((x + 0.5 - 0.5 * width) / height, (y + 0.5) / height - 0.5)) continue;
            const int64_t here = ++owned[comp_layout_owner(&layout, (uint32_t)(y * width + x))];
            most = here > most ? here : most;
            all++;
        }
    free(owned);
    return (double)most * ranks / (double)all;
}

/* Tested for widths that rounds of runs divide and for others. In the smaller pictures a thousand ranks have a hundred
 * covered pixels each, which cannot be shared as evenly: there the bound is 1.2. */
static void owners_share_what_is_seen(void **context)
{
    (void)context;
    static seen_function *const shapes[] = {is_in_disc, is_in_ring, is_in_column, is_in_band};
    const int sizes[][2] = {{1000, 1000}, {1024, 1024}, {1280, 720}, {1920, 1080}, {2048, 1024}, {4096, 2304}};
    const int ranks[] = {2, 3, 16, 64, 100, 256, 1000};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++)
        for (size_t r = 0; r < sizeof ranks / sizeof *ranks; r++)
            for (size_t k = 0; k < sizeof shapes / sizeof *shapes; k++) {
                const double skew = skew_of(sizes[s][0], sizes[s][1], ranks[r], shapes[k]);
                const double most = ranks[r] == 1000 && sizes[s][1] < 2000 ? 1.2 : 1.1;
                if (skew > most)
                    fprintf(stderr, "%d x %d, %d ranks, shape %d: %g\n", sizes[s][0], sizes[s][1], ranks[r], (int)k,
                            skew);
                assert_true(skew <= most);
            }
}

static void owners_of_the_largest_image_add_up(void **context)
{
    (void)context;
    const int ranks[] = {1, 2, 3, 7, 99999, 100000};
    for (size_t r = 0; r < sizeof ranks / sizeof *ranks; r++) {
        const comp_layout layout = comp_layout_of(UINT32_MAX, ranks[r]);
        uint64_t sum = 0;
        for (int rank = 0; rank < ranks[r]; rank++) sum += comp_layout_owned(&layout, rank);
        assert_true(sum == UINT32_MAX);
        const uint32_t last = UINT32_MAX - 1;
        const int owner = comp_owner(last, UINT32_MAX, ranks[r]);
        assert_true(comp_layout_index(&layout, last) == comp_layout_owned(&layout, owner) - 1);
    }
}

/* Fragments of the pixels of one owner, or of all with owner -1, numbered in t_out. */
static int fill_pixels(fragment *items, int count, const comp_layout *layout, int owner)
{
    int filled = 0;
    while (filled < count) {
        const uint32_t pixel = next_random() % layout->pixel_count;
        if (owner >= 0 && (int)comp_layout_owner(layout, pixel) != owner) continue;
        items[filled] = (fragment){.pixel = pixel, .t_in = (float)pixel, .t_out = (float)filled};
        filled++;
    }
    return filled;
}

static void check_same_set(const fragment *items, int count)
{
    char *met = calloc((size_t)count, 1);
    assert_non_null(met);
    for (int i = 0; i < count; i++) {
        const int number = (int)items[i].t_out;
        assert_false(met[number]);
        met[number] = 1;
        assert_true((uint32_t)items[i].t_in == items[i].pixel);
    }
    free(met);
}

static void bucket_by_owner_keeps_the_set(void **context)
{
    (void)context;
    enum { count = 5000 };
    static fragment items[count];
    state = 5;
    for (int ranks = 1; ranks < 20; ranks++) {
        const comp_layout layout = comp_layout_of(10007, ranks);
        int64_t starts[21];
        fill_pixels(items, count, &layout, -1);
        comp_bucket_by_owner(&layout, items, count, starts);
        assert_int_equal(starts[0], 0);
        assert_int_equal(starts[ranks], count);
        for (int rank = 0; rank < ranks; rank++)
            for (int64_t i = starts[rank]; i < starts[rank + 1]; i++)
                assert_int_equal(comp_layout_owner(&layout, items[i].pixel), rank);
        check_same_set(items, count);
    }
}

static void pixels_beyond_the_image_are_seen(void **context)
{
    (void)context;
    const comp_layout layout = comp_layout_of(100, 2);
    const fragment items[3] = {{.pixel = 99}, {.pixel = 0}, {.pixel = 100}};
    assert_true(comp_bucket_fits(&layout, items, 0));
    assert_true(comp_bucket_fits(&layout, items, 2));
    assert_false(comp_bucket_fits(&layout, items, 3));
}

static void bucket_by_slice_sorts_by_owned_index(void **context)
{
    (void)context;
    enum { count = 20000, shift = 10, most_slices = 64 };
    static fragment items[count];
    state = 6;
    for (int ranks = 1; ranks <= 3; ranks++) {
        const comp_layout layout = comp_layout_of(60013, ranks);
        const int owner = ranks - 1;
        const int64_t slices = ((comp_layout_owned(&layout, owner) - 1) >> shift) + 1;
        int64_t starts[most_slices + 1];
        fill_pixels(items, count, &layout, owner);
        comp_bucket_by_slice(&layout, shift, items, count, starts, slices);
        assert_int_equal(starts[0], 0);
        assert_int_equal(starts[slices], count);
        for (int64_t s = 0; s < slices; s++)
            for (int64_t i = starts[s]; i < starts[s + 1]; i++)
                assert_int_equal(comp_layout_index(&layout, items[i].pixel) >> shift, s);
        check_same_set(items, count);
    }
}

/* In any order, samples together absorb all light that does not pass every one of them, each in proportion to its own
 * absorption. */
static void samples_of_one_place_share_what_they_absorb(void **context)
{
    (void)context;
    state = 9;
    for (int count = 1; count <= 20; count++) {
        fragment items[20];
        double colour[3] = {0, 0, 0}, through = 1, weight = 0;
        float rgba[4], depth;
        for (int i = 0; i < count; i++) {
            items[i] = random_fragment();
            items[i].kind = FRAGMENT_VOLUME;
            items[i].t_in = items[i].t_out = 3;
            for (int c = 0; c < 3; c++) colour[c] += (double)items[i].colour[c];
            through *= (double)items[i].transmittance;
            weight += 1 - (double)items[i].transmittance;
        }
        comp_merge_pixel(items, count, black, rgba, &depth);
        const double share = weight > 0 ? (1 - through) / weight : 1;
        for (int c = 0; c < 3; c++) assert_true(fabs((double)rgba[c] - colour[c] * share) <= tolerance(1));
        assert_true(fabs((double)rgba[3] - (1 - through)) <= tolerance(1));
    }
}

/* A medium that is the same throughout. */
typedef struct medium {
    double begin, end, extinction, colour[3];
} medium;

static fragment fragment_of(const medium *m)
{
    const double clear = exp(-m->extinction * (m->end - m->begin));
    fragment f = {.t_in = (float)m->begin, .t_out = (float)m->end, .transmittance = (float)clear};
    for (int c = 0; c < 3; c++) f.colour[c] = (float)(m->colour[c] * (1 - clear));
    return f;
}

/* All media together, in small steps between whole eighths, where all begin and end; a surface at 4. */
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

/* Rounding T and C to float errs by 3e-8, and so the depth, at most 2 for a medium, by up to e^2 times that: 3e-7 a
 * medium. */
static void stretches_that_overlap_are_mixed(void **context)
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
            const double begin = (double)(next_random() % 60) / 8, most = 8 - begin;
            media[k] = (medium){begin, begin + fmin(most, (double)(1 + next_random() % 30) / 8), 0, {0, 0, 0}};
            media[k].extinction = 2 * (double)next_unit() / (media[k].end - begin);
            for (int c = 0; c < 3; c++) media[k].colour[c] = (double)next_unit();
            items[k] = fragment_of(&media[k]);
        }
        items[count] = (fragment){.t_in = 4, .t_out = 4, .colour = {0.25f, 0, 0.125f}, .transmittance = 0.5f};
        items[count].kind = FRAGMENT_SURFACE;
        mix_media(media, count, &items[count], expected);
        comp_merge_pixel(items, count + 1, black, rgba, &depth);
        for (int c = 0; c < 4; c++) assert_true(fabs((double)rgba[c] - expected[c]) <= 3e-7 * (count + 1));
        assert_true(depth == 4);
    }
}

/* A ray through a fine and a coarse mesh has one long stretch over many short ones in a row. The time must be
 * proportional to their number: a quadratic rule would take minutes. All cuts mix the same two media, so the whole is
 * one medium of their sum; sums of so many err by less than 1e-9, the floats by less than 3e-7. */
static void many_short_stretches_under_a_long_one_take_no_time(void **context)
{
    (void)context;
    enum { SHORT = 200000 };
    const float clear = 0.99999f;
    fragment *items = calloc(SHORT + 1, sizeof *items);
    for (int i = 0; i < SHORT; i++) {
        fragment *f = &items[(int64_t)i * 7919 % SHORT]; /* in no order */
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

/* If rounding gives a sample to two neighbours, the one behind counts, in any order of the two. */
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

static bool do_overlap(const fragment *given, int count)
{
    fragment items[4];
    float rgba[4], depth;
    memcpy(items, given, (size_t)count * sizeof *items);
    comp_merge_pixel(items, count, black, rgba, &depth);
    return comp_pixel_overlaps(items, count);
}

static void overlaps_are_where_a_volume_has_not_ended(void **context)
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
        /* within a long one, behind a short one */
        {3,
         {{.t_in = 0, .t_out = 9, .transmittance = 0.5f},
          {.t_in = 1, .t_out = 2, .transmittance = 0.5f},
          {.t_in = 4, .t_out = 5, .transmittance = 0.5f}},
         true},
        /* surfaces: in front of, within, at the last sample of, behind a volume; two in one place */
        {2, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f}, {1, 1, 1, {0}, 0.5f, S}}, false},
        {2, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f}, {0, 1.5f, 1.5f, {0}, 0.5f, S}}, true},
        {2, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f}, {0, 2, 2, {0}, 0, S}}, true},
        {2, {{.t_in = 1, .t_out = 2, .transmittance = 0.5f}, {0, 3, 3, {0}, 0, S}}, false},
        /* where a volume begins, within rounding; but that is no excuse for another that began in front */
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
        /* fragments behind an opaque one do not show */
        {3,
         {{0, 1, 1, {0}, 0, S},
          {.t_in = 2, .t_out = 4, .transmittance = 0.5f},
          {.t_in = 3, .t_out = 5, .transmittance = 0.5f}},
         false},
        /* shorter than rounding */
        {2,
         {{.t_in = 0, .t_out = 2, .transmittance = 0.5f}, {.t_in = 1, .t_out = 0.99f, .transmittance = 0.5f}},
         false},
        /* samples of cells whose common face is in two places; of cells in one place; beside those of another volume */
        {2, {{0, 1, 1, {0}, 0.5f, V + LATE}, {0, 1, 1, {0}, 0.5f, V + EARLY}}, false},
        {2, {{0, 1, 1, {0}, 0.5f, V + LATE}, {0, 1, 1, {0}, 0.5f, V}}, true},
        {2, {{0, 1, 1, {0}, 0.5f, V + LATE}, {0, 1, 1, {0}, 0.5f, V + LATE}}, true},
        {3, {{0, 1, 1, {0}, 0.5f, V + EARLY}, {0, 1, 1, {0}, 0.5f, V + EARLY}, {0, 1, 1, {0}, 0.5f, V + LATE}}, true},
        {2, {{0, 1, 1, {0}, 0.5f, V}, {0, 1, 1, {0}, 0.5f, V + FRAGMENT_LAYER}}, false},
        {2, {{0, 1, 1, {0}, 0.5f, V + LATE}, {0, 1, 1, {0}, 0.5f, V + FRAGMENT_LAYER + EARLY}}, false},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        if (do_overlap(cases[i].items, cases[i].count) != cases[i].overlap) fail_msg("case %d", (int)i);
}

/* ---- tiles --------------------------------------------------------------------------------------------------- */

enum { LARGEST_TILE = 20 };

/* A picture's fragments, some pixels with none, one or many, in any order within a tile. */
typedef struct tiled {
    image picture;
    fragment *items; /* tile by tile */
    int64_t starts[64];
    pixel_area areas[64];
    int tile_count;
} tiled;

static int64_t next_count(int most)
{
    return next_random() % 3 ? (int64_t)(next_random() % (uint32_t)(most + 1)) : 0;
}

/* Volumes may overlap, and be samples of one place. */
static fragment crowded_fragment(uint32_t pixel)
{
    fragment f = random_fragment();
    f.pixel = pixel;
    f.t_in = floorf(f.t_in * 16) / 16;
    f.t_out = f.kind >= FRAGMENT_SURFACE || next_random() % 2 ? f.t_in : f.t_out;
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
                for (int64_t left = next_count(most); left > 0; left--)
                    t->items[count++] = crowded_fragment((uint32_t)((y + k / area.width) * width + x + k % area.width));
            shuffle(t->items + first, (int)(count - first));
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

/* Pixel by pixel, by the rule; returns whether the fragments overlap. */
static bool merge_one(const tiled *t, uint32_t pixel, float rgba[4], float *depth)
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
        const bool overlap = merge_one(t, (uint32_t)pixel, rgba, &depth) && finds_overlaps;
        assert_memory_equal(rgba, t->picture.rgba + 4 * pixel, sizeof rgba);
        if (t->picture.depth) assert_memory_equal(&depth, t->picture.depth + pixel, sizeof depth);
        assert_int_equal(overlap, overlaps->count && pixel_set_has(overlaps->pixels, pixel));
        count += overlap;
    }
    assert_int_equal(count, overlaps->count);
    assert_int_equal(count > 0, overlaps->pixels != NULL);
}

static void tiles_are_merged_to_the_bit(void **context)
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
        make_tiled(&t, 1 + (int)(next_random() % 50), 1 + (int)(next_random() % 40), trial % 7 == 3 ? LARGEST_TILE : 16,
                   trial % 10 ? trial % 5 : 30);
        if (trial % 3 == 0) free(t.picture.depth), t.picture.depth = NULL;
        assert_int_equal(comp_tiles_begin(&tiles, blue, 3, finds_overlaps, &t.picture, &error), INSITU_OK);
#pragma omp parallel for num_threads(3) schedule(dynamic, 1)
        for (int i = 0; i < t.tile_count; i++) {
            fragment given[LARGEST_TILE * LARGEST_TILE * 31];
            const int64_t count = t.starts[i + 1] - t.starts[i];
            if (count) memcpy(given, t.items + t.starts[i], (size_t)count * sizeof *given);
            if (!comp_tiles_take(&tiles, omp_get_thread_num(), &t.areas[i], given, count)) abort();
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
        if (!comp_tiles_take(&tiles, 0, &t->areas[i], t->items + t->starts[i], t->starts[i + 1] - t->starts[i]))
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
        cmocka_unit_test(merge_of_equal_slabs_is_a_power),
        cmocka_unit_test(opaque_surface_hides_what_is_behind),
        cmocka_unit_test(surface_is_before_volume_at_equal_depth),
        cmocka_unit_test(depth_is_of_the_surface_though_fog_is_opaque),
        cmocka_unit_test(joining_neighbours_changes_rounding_alone),
        cmocka_unit_test(permutations_give_the_same_bits),
        cmocka_unit_test(samples_of_one_place_share_what_they_absorb),
        cmocka_unit_test(stretches_that_overlap_are_mixed),
        cmocka_unit_test(many_short_stretches_under_a_long_one_take_no_time),
        cmocka_unit_test(samples_of_neighbours_count_once),
        cmocka_unit_test(overlaps_are_where_a_volume_has_not_ended),
        cmocka_unit_test(owners_share_all_pixels_evenly),
        cmocka_unit_test(owners_share_what_is_seen),
        cmocka_unit_test(owners_of_the_largest_image_add_up),
        cmocka_unit_test(bucket_by_owner_keeps_the_set),
        cmocka_unit_test(pixels_beyond_the_image_are_seen),
        cmocka_unit_test(bucket_by_slice_sorts_by_owned_index),
        cmocka_unit_test(tiles_are_merged_to_the_bit),
        cmocka_unit_test(tiles_without_memory_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
