/* Checks the contents and the routes of messages, without MPI. Sheets (blocks of pixels as they are sent) with any
 * contents are decoded bitwise. Routes lead every fragment from every rank to its owner, and every pixel to rank 0, for
 * more ranks than any available machine has. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "comp_cost.h"
#include "comp_gather.h"
#include "comp_route.h"
#include "comp_sheet.h"
#include "comp_sheet_loops.h"
#include "fragment_order.h"
#include "memory.h"

static uint64_t state = 1;

static uint32_t draw_random(void)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(state >> 32);
}

/* Which values one of a fragment's 32-bit words has in the pixels of a sheet. AS_BEFORE: in each pixel, the value of
 * the preceding word. */
enum filling { ANY_BITS, SMOOTH, CONSTANT, AS_BEFORE, NOT_A_NUMBER, FILLING_COUNT };

static uint32_t get_float_bits(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static uint32_t make_filled_value(enum filling how, int i, int k, uint32_t before)
{
    const uint32_t nans[] = {0x7fc00001u, 0xffc12345u, 0x7f800000u, 0xff800000u, 0x80000000u};
    switch (how) {
    case SMOOTH: return get_float_bits(1 + 0.1f * (float)k + sinf(0.01f * (float)i));
    case CONSTANT: return get_float_bits(0.25f);
    case AS_BEFORE: return before;
    case NOT_A_NUMBER: return nans[draw_random() % 5];
    default: return draw_random();
    }
}

/* Sets the masks of covered pixels to full rows, rows with gaps, or mixtures with empty rows. */
static void fill_masks(comp_sheet *sheet)
{
    const uint32_t how = draw_random() % 4;
    for (int r = 0; r < COMP_ROWS; r++) {
        const uint32_t bits = draw_random();
        const uint32_t some[] = {0xffff, bits & (bits >> 16), bits % 3 ? 0xffff : bits, bits % 3 ? 0 : bits};
        sheet->masks[r] = (uint16_t)some[how];
    }
    if (draw_random() % 64 == 0) memset(sheet->masks, 0, sizeof sheet->masks);
}

static void fill_sheet(comp_sheet *sheet)
{
    comp_sheet_begin(sheet, draw_random());
    fill_masks(sheet);
    sheet->is_opaque = draw_random() % 2;
    for (int w = 0; w < COMP_WORDS; w++) {
        const enum filling how = (enum filling)(draw_random() % FILLING_COUNT);
        for (int k = 0; k < COMP_STRIP_PIXELS; k++)
            sheet->words[w][k] = make_filled_value(how, k, w + 1, w ? sheet->words[w - 1][k] : 0);
    }
}

/* Returns the number of 32-bit words that differ among the first `words` of each pixel. Any difference of masks counts
 * as one word. */
static int count_differences(const comp_sheet *a, const comp_sheet *b, int words)
{
    int count = memcmp(a->masks, b->masks, sizeof a->masks) != 0;
    for (uint32_t k = 0; k < COMP_STRIP_PIXELS; k++)
        for (int w = 0; w < words && comp_sheet_has(a, k); w++) count += a->words[w][k] != b->words[w][k];
    return count;
}

typedef struct sheet_pair {
    comp_sheet *sheet, *back;
    unsigned char *bytes;
} sheet_pair;

static sheet_pair make_pair(void)
{
    const sheet_pair p = {base_calloc(1, sizeof *p.sheet), base_calloc(1, sizeof *p.back),
                          base_alloc(comp_sheet_max_bytes(COMP_STRIP_PIXELS, COMP_WORDS))};
    assert_true(p.sheet && p.back && p.bytes);
    return p;
}

static void free_pair(sheet_pair *p)
{
    base_free(p->sheet);
    base_free(p->back);
    base_free(p->bytes);
}

/* Checks that sheets with any contents are decoded bitwise by each instruction set, whichever instruction set encoded
 * them, and that all instruction sets encode to the same bytes. */
static void encoded_sheets_decode_unchanged(void **context)
{
    (void)context;
    sheet_pair p = make_pair();
    static unsigned char plain[1 << 15];
    for (int trial = 0; trial < 3000; trial++) {
        const int words = trial % 2 ? COMP_WORDS : COMP_PIXEL_WORDS;
        fill_sheet(p.sheet);
        const int count = comp_sheet_count_pixels(p.sheet);
        const size_t length = (size_t)(comp_sheet_write_by(CPU_PLAIN, p.sheet, words, plain) - plain);
        for (cpu_isa isa = CPU_PLAIN; isa <= cpu_best_isa(); isa++) {
            comp_sheet_head head;
            const unsigned char *const end = comp_sheet_write_by(isa, p.sheet, words, p.bytes);
            assert_true((size_t)(end - p.bytes) == length &&
                        length + COMP_SHEET_SLACK <= comp_sheet_max_bytes(count, words));
            assert_memory_equal(p.bytes, plain, length);
            assert_ptr_equal(comp_sheet_read_by(isa, p.bytes, words, p.back), end);
            assert_int_equal(count_differences(p.sheet, p.back, words), 0);
            assert_true(p.back->strip == p.sheet->strip && p.back->is_opaque == p.sheet->is_opaque);
            assert_ptr_equal(comp_sheet_read_head(p.bytes, &head), end);
            assert_true(head.count == count && !memcmp(p.back->masks, p.sheet->masks, sizeof p.back->masks));
        }
    }
    free_pair(&p);
}

/* Checks columns of depths of a plane that are exact in float32. Only the first two rows have residuals, so that little
 * is sent besides half a byte for each row and word. */
static void plane_depths_compress_to_half_bytes(void **context)
{
    (void)context;
    sheet_pair p = make_pair();
    comp_sheet_begin(p.sheet, 0);
    memset(p.sheet->masks, 0xff, sizeof p.sheet->masks);
    for (uint32_t k = 0; k < COMP_STRIP_PIXELS; k++)
        for (int w = 0; w < COMP_WORDS; w++)
            p.sheet->words[w][k] =
                get_float_bits(1 + (float)(w + 1) * 0x1p-12f * (float)(k / COMP_LANES + 2 * k % COMP_LANES));
    const int64_t length = comp_sheet_write(p.sheet, COMP_WORDS, p.bytes) - p.bytes;
    /* The header; for each word its first value, half a byte for each row, and two rows with at most four bytes for
     * each pixel. */
    assert_true(length <= COMP_SHEET_HEAD + COMP_WORDS * (4 + COMP_ROWS / 2 + 2 * 4 * COMP_LANES));
    free_pair(&p);
}

/* Checks the merge of sheets of opaque hits, some of them at equal depths: the nearest hit by the merge rule is
 * kept. */
static void nearest_hits_are_kept_by_merge(void **context)
{
    (void)context;
    sheet_pair p = make_pair();
    for (int trial = 0; trial < 300; trial++) {
        uint16_t left[COMP_ROWS];
        comp_sheet expected;
        comp_sheet *const both[2] = {p.sheet, p.back};
        for (int i = 0; i < 2; i++) {
            comp_sheet_begin(both[i], 7);
            for (uint32_t k = 0; k < COMP_STRIP_PIXELS; k++) {
                fragment f = {.t_in = (float)(draw_random() % 4), .kind = FRAGMENT_SURFACE + draw_random() % 2};
                if (draw_random() % 16 == 0) f.t_in = NAN;
                f.colour[0] = (float)(draw_random() % 3);
                if (draw_random() % 3) comp_sheet_put(both[i], k, &f);
            }
        }
        expected = *p.sheet;
        for (uint32_t k = 0; k < COMP_STRIP_PIXELS; k++) {
            if (!comp_sheet_has(p.back, k)) continue;
            const fragment a = comp_sheet_get(p.sheet, k, 0), b = comp_sheet_get(p.back, k, 0);
            if (!comp_sheet_has(p.sheet, k) || fragment_compare(&b, &a) < 0) comp_sheet_put(&expected, k, &b);
        }
        comp_sheet_join(p.sheet, p.back, left);
        assert_int_equal(count_differences(&expected, p.sheet, COMP_WORDS), 0);
        for (int r = 0; r < COMP_ROWS; r++) assert_int_equal(left[r], 0);
    }
    free_pair(&p);
}

/* Fills a sheet with fragments without NaN or infinity, because blending NaN or infinity gives bits that depend on the
 * compiler. */
static void fill_numbers(comp_sheet *sheet)
{
    comp_sheet_begin(sheet, 0);
    fill_masks(sheet);
    sheet->is_opaque = draw_random() % 2;
    for (uint32_t k = 0; k < COMP_STRIP_PIXELS; k++) {
        const bool is_hit = sheet->is_opaque || draw_random() % 2;
        fragment f = {.t_in = (float)(draw_random() % 4), .kind = is_hit ? FRAGMENT_SURFACE : FRAGMENT_VOLUME};
        f.t_out = f.t_in;
        f.transmittance = sheet->is_opaque ? 0 : (float)(draw_random() % 1001) * 1e-3f;
        for (int c = 0; c < 3; c++) f.colour[c] = (float)(draw_random() % 1001) * 1e-3f;
        for (int w = 0; w < COMP_WORDS; w++) memcpy(&sheet->words[w][k], (const char *)&f + 4 * (w + 1), 4);
    }
}

enum { WIDE = 40, HIGH = 50 };

/* Stores a picture strip by strip with the given loops: all colours, then all depths. The rightmost and lowest strips
 * extend beyond the picture and are cut off. Every second strip has no depths. */
static void store_picture_with_loops(const comp_sheet_loops *loops, const comp_sheet *pixels, const float background[4],
                                     int ranks, float *stored)
{
    const comp_grid grid = comp_make_grid(WIDE, HIGH, ranks);
    memset(stored, 0x55, 5 * WIDE * HIGH * sizeof *stored);
    for (uint32_t strip = 0; strip < grid.strips; strip++) {
        const comp_area area = comp_find_strip_area(&grid, strip);
        float *const depths = strip % 2 ? stored + 4 * WIDE * HIGH : NULL;
        image out = {.width = WIDE, .height = HIGH, .rgba = stored, .depth = depths};
        loops->store(pixels, &area, background, &out);
    }
}

/* Checks that joining, blending and storing are bit-identical for all instruction sets. */
static void sheet_merge_loops_agree(void **context)
{
    (void)context;
    static const float background[4] = {0.1f, 0.2f, 0.3f, 0.75f};
    static comp_sheet first, other, expected, joined, pixels, plain_pixels;
    static float stored[5 * WIDE * HIGH] __attribute__((aligned(64))),
        plain_stored[5 * WIDE * HIGH] __attribute__((aligned(64)));
    const comp_sheet_loops *const plain = comp_sheet_loops_of(CPU_PLAIN);
    for (int trial = 0; trial < 300; trial++) {
        const int ranks = trial % 3 ? 1 + trial % 16 : 1; /* grids for more ranks have shorter strips */
        uint16_t plain_left[COMP_ROWS], left[COMP_ROWS];
        fill_numbers(&first);
        fill_numbers(&other);
        expected = first;
        plain->join(&expected, &other, plain_left);
        plain->finish(&expected, background, &plain_pixels);
        store_picture_with_loops(plain, &plain_pixels, background, ranks, plain_stored);
        for (cpu_isa isa = CPU_PLAIN; isa <= cpu_best_isa(); isa++) {
            const comp_sheet_loops *const loops = comp_sheet_loops_of(isa);
            joined = first;
            loops->join(&joined, &other, left);
            assert_memory_equal(left, plain_left, sizeof left);
            assert_true(joined.is_opaque == expected.is_opaque);
            assert_int_equal(count_differences(&expected, &joined, COMP_WORDS), 0);
            loops->finish(&joined, background, &pixels);
            assert_int_equal(count_differences(&plain_pixels, &pixels, COMP_PIXEL_WORDS), 0);
            store_picture_with_loops(loops, &pixels, background, ranks, stored);
            assert_memory_equal(stored, plain_stored, sizeof stored);
        }
    }
}

/* ---- routes -------------------------------------------------------------------------------------------------- */

/* Returns the position in the route that holds the owner's fragments after the round. */
static int find_next_position(const comp_route *route, int round, int place, int owner)
{
    const int stride = comp_route_stride(route, round);
    return comp_route_partner(route, round, stride, place, comp_route_digit(route, round, stride, owner));
}

static void check_route_to_owner(const comp_route *route, int from, int owner)
{
    int at = from < route->owners ? from : from - route->owners;
    for (int round = 0; round < route->round_count; round++) {
        const int to = find_next_position(route, round, at, owner), stride = comp_route_stride(route, round);
        assert_in_range(to, 0, route->owners - 1);
        /* The sender must be a partner of the receiver. */
        assert_int_equal(comp_route_partner(route, round, stride, to, comp_route_digit(route, round, stride, at)), at);
        at = to;
    }
    assert_int_equal(at, owner);
}

static void check_route(comp_schedule schedule, int ranks, comp_nodes nodes, int radix)
{
    const comp_route route = comp_make_route(schedule, ranks, nodes, radix);
    int64_t product = 1;
    for (int i = 0; i < route.round_count; i++) product *= route.radix[i];
    assert_int_equal(product, route.owners);
    assert_true(route.owners <= ranks && 2 * route.owners > ranks - (ranks == 1));
    const int step = ranks / 97 + 1;
    for (int r = 0; r < ranks; r += step) {
        assert_int_equal(comp_find_rank_at_place(&route, comp_find_place_of_rank(&route, r)), r);
        for (int o = 0; o < route.owners; o += step)
            check_route_to_owner(&route, comp_find_place_of_rank(&route, r), o);
        check_route_to_owner(&route, comp_find_place_of_rank(&route, r), route.owners - 1);
    }
    assert_int_equal(comp_find_place_of_rank(&route, 0), 0);
}

static void routes_deliver_to_owners(void **context)
{
    (void)context;
    const int many[] = {1000, 1024, 3989, 4000, 97336, 99991, 100000};
    for (int i = 1; i < 140 + 7; i++) {
        const int ranks = i < 140 ? i : many[i - 140];
        for (comp_schedule s = COMP_DIRECT; s < COMP_SCHEDULE_COUNT; s++)
            for (int node = 1; node <= 64; node = node < 8 ? node + 1 : 2 * node)
                for (int cyclic = 0; cyclic < 2 && ranks % node == 0; cyclic++)
                    check_route(s, ranks, (comp_nodes){node, cyclic}, 4 + node % 5);
    }
}

static void check_gather(int ranks, comp_nodes nodes, comp_schedule schedule)
{
    const comp_route route = comp_make_route(schedule, ranks, nodes, 8);
    int *children = calloc((size_t)route.owners, sizeof *children);
    assert_non_null(children);
    for (int place = 1; place < route.owners; place++) {
        const int parent = comp_gather_parent(&route, place);
        assert_in_range(parent, 0, place - 1); /* every path towards the root ends at position 0 */
        children[parent]++;
    }
    for (int place = 0; place < route.owners; place++) {
        assert_int_equal(comp_count_gather_children(&route, place), children[place]);
        assert_true(children[place] < nodes.ranks + COMP_GATHER_FAN);
    }
    free(children);
}

static void gather_uses_a_tree(void **context)
{
    (void)context;
    const int counts[] = {1, 2, 3, 5, 7, 64, 65, 66, 128, 4096, 4160, 97336, 100000};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        for (int node = 1; node <= 128; node *= 2)
            for (comp_schedule s = COMP_DIRECT; s < COMP_SCHEDULE_COUNT && counts[i] % node == 0; s++)
                check_gather(counts[i], (comp_nodes){node, false}, s);
}

/* Checks that the chosen route costs no more than any schedule's route and that ranks send directly if there are few.
 * With up to 100,000 ranks, each with its share of a picture, no rank may send more than a few hundred messages. */
static void cheapest_route_is_chosen(void **context)
{
    (void)context;
    const int counts[] = {2, 3, 5, 7, 8, 16, 32, 64, 127, 1000, 4000, 32768, 97336, 100000};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        const int ranks = counts[i], node = ranks % 8 == 0 && ranks > 8 ? 8 : 1;
        const comp_load load = {(int64_t)(4e6 / pow(ranks, 2.0 / 3)), 11, 256};
        const comp_route best = comp_find_fastest_route(ranks, (comp_nodes){node, false}, &load, &comp_default_machine);
        const comp_cost cost = comp_estimate_cost(&best, &load, &comp_default_machine);
        for (comp_schedule s = COMP_DIRECT; s < COMP_SCHEDULE_COUNT; s++) {
            const comp_route other = comp_make_route(s, ranks, (comp_nodes){node, false}, 8);
            assert_true(cost.seconds <= comp_estimate_cost(&other, &load, &comp_default_machine).seconds);
        }
        if (ranks <= 8) assert_int_equal(best.schedule, COMP_DIRECT);
        assert_true(cost.messages < 300);
    }
}

/* Compares the cost of one round of direct sends among eight ranks with the cost model, term by term. */
static void route_costs_match_the_model(void **context)
{
    (void)context;
    const comp_machine machine = {1, 10, 100, 0, 0, 0};
    const comp_load load = {800, 2, 512};
    const comp_route route = comp_make_route(COMP_DIRECT, 8, (comp_nodes){1, false}, 0);
    const comp_cost cost = comp_estimate_cost(&route, &load, &machine);
    assert_true(cost.messages == 7 && cost.bytes == 1400);
    assert_true(cost.seconds == 1 + 2 * 10 * 7 + 100 * 1400);
    assert_int_equal(comp_count_route_messages(&route, 3), 7);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(encoded_sheets_decode_unchanged), cmocka_unit_test(plane_depths_compress_to_half_bytes),
        cmocka_unit_test(nearest_hits_are_kept_by_merge),  cmocka_unit_test(sheet_merge_loops_agree),
        cmocka_unit_test(routes_deliver_to_owners),        cmocka_unit_test(gather_uses_a_tree),
        cmocka_unit_test(cheapest_route_is_chosen),        cmocka_unit_test(route_costs_match_the_model),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
