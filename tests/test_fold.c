/* Checks that folding (blending adjacent fragments of a ray into one before they are sent) gives bit-identical results
 * however samples or segments are distributed over ranks, and however many of them each rank folds. Checks that the
 * result equals the "over" operator in double. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "comp.h"
#include "fragment_fold.h"

enum { MOST = 400, RANKS = 7 };

static uint32_t state_of_chance;

static double draw_random_number(void)
{
    state_of_chance = state_of_chance * 1664525u + 1013904223u;
    return (double)(state_of_chance >> 8) / 16777216.0;
}

/* A ray of adjacent segments. Their lengths are between a millionth and a tenth of the scene's. Some segments are left
 * out, and some are surfaces instead. */
typedef struct ray {
    fragment items[MOST];
    int owners[MOST];
    int64_t count;
} ray;

static void make_ray(ray *r, double density, double gap, double surface)
{
    float t = (float)(-1.5 + draw_random_number());
    r->count = 0;
    while (t < 1.5f && r->count < MOST) {
        const float end = t + (float)pow(10, -6 + 5 * draw_random_number());
        const bool is_surface = draw_random_number() < surface;
        const float clear = (float)exp(-density * draw_random_number() * (is_surface ? 1 : (double)(end - t)));
        if (draw_random_number() >= gap) {
            fragment *f = &r->items[r->count++];
            *f = (fragment){.t_in = t, .t_out = is_surface ? t : end, .transmittance = clear};
            f->kind = is_surface ? FRAGMENT_SURFACE : FRAGMENT_VOLUME;
            for (int c = 0; c < 3; c++) f->colour[c] = (1 - clear) * (float)draw_random_number();
        }
        /* the next surface begins at another depth, so that the order of the two is defined */
        t = is_surface ? nextafterf(t, 2) : end;
    }
}

/* Distributes fragments over the ranks in runs of consecutive fragments. change: probability that a run ends at a
 * fragment. */
static void distribute_fragments(ray *r, double change)
{
    int owner = 0;
    for (int64_t i = 0; i < r->count; i++) {
        if (draw_random_number() < change) owner = (int)(draw_random_number() * RANKS);
        r->owners[i] = owner;
    }
}

/* Computes the fragments that a rank sends. Each run of adjacent segments of the rank between surfaces is folded: one
 * fragment results for each node of the tree over depth whose segments all belong to the run. */
static int64_t fold_for_rank(const ray *r, int rank, fragment *out)
{
    int64_t count = 0;
    for (int64_t i = 0, n; i < r->count; i += n) {
        n = 1;
        if (r->owners[i] != rank) continue;
        if (r->items[i].kind >= FRAGMENT_SURFACE) {
            out[count++] = r->items[i];
            continue;
        }
        while (i + n < r->count && r->owners[i + n] == rank && r->items[i + n].kind == FRAGMENT_VOLUME &&
               r->items[i + n].t_in == r->items[i + n - 1].t_out)
            n++;
        for (int64_t k = i, m; k < i + n; k += m) {
            const int32_t interval_number = fragment_interval_number(r->items[k].t_in);
            for (m = 1; k + m < i + n && fragment_interval_number(r->items[k + m].t_in) == interval_number;) m++;
            count += fragment_fold_between(r->items + k, m, r->items[i].t_in, r->items[i + n - 1].t_out, out + count);
        }
    }
    return count;
}

static const float background[4] = {0.1f, 0.2f, 0.3f, 1};

static void merge_folded_fragments(const ray *r, float rgba[4], int64_t *sent)
{
    fragment items[MOST];
    float depth;
    *sent = 0;
    for (int rank = 0; rank < RANKS; rank++) *sent += fold_for_rank(r, rank, items + *sent);
    comp_merge_folded_pixel(items, *sent, background, rgba, &depth);
}

static void blend_in_double(const ray *r, double rgba[4])
{
    double through = 1;
    memset(rgba, 0, 4 * sizeof *rgba);
    for (int64_t i = 0; i < r->count; i++) {
        for (int c = 0; c < 3; c++) rgba[c] += through * (double)r->items[i].colour[c];
        through *= (double)r->items[i].transmittance;
    }
    for (int c = 0; c < 3; c++) rgba[c] += through * (double)background[c];
    rgba[3] = 1 - through + through * (double)background[3];
}

/* Compares the result with blending in double. A fragment adds a product and a sum of colours and a product of
 * transmittances. The latter affects all fragments behind it. That makes three roundings by 2^-24 of values of at most
 * 1 for each fragment. Dark segments may be left out, so the tolerance also includes FRAGMENT_DARK. */
static void verify_pixel(const ray *r, const float rgba[4])
{
    double expected[4];
    blend_in_double(r, expected);
    for (int c = 0; c < 4; c++) {
        const double off = fabs((double)rgba[c] - expected[c]);
        const double bound = ldexp((double)(3 * r->count + 3), -24) + (double)FRAGMENT_DARK;
        if (off > bound) fail_msg("channel %d of %lld fragments: off by %g", c, (long long)r->count, off);
    }
}

static void folded_result_does_not_depend_on_distribution(void **state)
{
    static ray r;
    int64_t whole = 0, parts = 0;
    (void)state;
    for (int n = 0; n < 3000; n++) {
        float alone[4], shared[4];
        int64_t sent;
        make_ray(&r, n % 3 ? 2 : 200, n % 2 ? 0.05 : 0, n % 5 ? 0 : 0.1);
        memset(r.owners, 0, sizeof r.owners);
        merge_folded_fragments(&r, alone, &sent);
        whole += sent;
        verify_pixel(&r, alone);
        for (int distributed = 0; distributed < 4; distributed++) {
            distribute_fragments(&r, distributed == 0 ? 1 : 0.3 / (1 + 3 * distributed));
            merge_folded_fragments(&r, shared, &sent);
            parts += sent;
            assert_memory_equal(alone, shared, sizeof alone);
        }
    }
    printf("fragments of a ray: %.1f alone, %.1f on %d ranks\n", (double)whole / 3000, (double)parts / 12000, RANKS);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(folded_result_does_not_depend_on_distribution)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
