/* Messages without MPI: whole numbers and blocks of any contents come back bit for bit; routes lead every fragment from
 * every rank to its owner, and every pixel to rank 0, for more ranks than any machine at hand has. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "comp_block.h"
#include "comp_cost.h"
#include "comp_gather.h"
#include "comp_route.h"
#include "comp_schedule.h"
#include "comp_words.h"
#include "memory.h"

static uint64_t state = 1;

static uint32_t next_random(void)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(state >> 32);
}

/* Numbers of all lengths, 0 and the greatest of each length among them. */
static uint32_t random_word(void)
{
    const uint32_t bytes = next_random() % 4, top = 0xffffffffu >> 8 * bytes;
    return next_random() % 8 == 0 ? top : next_random() & top;
}

static void words_come_back(void **context)
{
    (void)context;
    for (size_t count = 0; count < 300; count++) {
        uint32_t words[304], back[304];
        unsigned char bytes[2048], plain[2048];
        for (size_t i = 0; i < count; i++) words[i] = random_word();
        unsigned char *const end = comp_words_write(words, count, bytes);
        unsigned char *const plain_end = comp_words_write_plain(words, count, plain);
        const size_t length = (size_t)(end - bytes);
        assert_true(length <= comp_words_bound(count) && length == (size_t)(plain_end - plain));
        assert_memory_equal(bytes, plain, length);
        assert_ptr_equal(comp_words_read(bytes, count, back), end);
        assert_memory_equal(back, words, count * sizeof *words);
        assert_ptr_equal(comp_words_read_plain(bytes, count, back), end);
        assert_memory_equal(back, words, count * sizeof *words);
    }
}

/* Ways to fill a word of a record. */
enum filling { ANY_BITS, SMOOTH, CONSTANT, AS_BEFORE, NOT_A_NUMBER, FILLING_COUNT };

static uint32_t bits_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static uint32_t filled(enum filling how, int i, int k, uint32_t before)
{
    const uint32_t nans[] = {0x7fc00001u, 0xffc12345u, 0x7f800000u, 0xff800000u, 0x80000000u};
    switch (how) {
    case SMOOTH: return bits_of(1 + 0.1f * (float)k + sinf(0.01f * (float)i));
    case CONSTANT: return bits_of(0.25f);
    case AS_BEFORE: return before;
    case NOT_A_NUMBER: return nans[next_random() % 5];
    default: return next_random();
    }
}

/* Indices that go on, leap, and fall back, as layers of windows do. */
static void fill_block(comp_block *block, int count)
{
    enum filling how[COMP_RECORD_WORDS];
    uint32_t index = next_random() % 1000;
    block->count = count;
    for (int k = 0; k < COMP_RECORD_WORDS; k++) how[k] = (enum filling)(next_random() % FILLING_COUNT);
    for (int i = 0; i < count; i++) {
        const uint32_t leap = next_random() % 40;
        index = leap == 0 ? next_random() : leap == 1 ? index - next_random() % 70 : index + 1;
        block->records[i][0] = index;
        for (int k = 1; k < COMP_RECORD_WORDS; k++)
            block->records[i][k] = filled(how[k], i, k, block->records[i][k - 1]);
    }
}

typedef struct run_check {
    const comp_block *block;
    int at;
} run_check;

static void check_run(void *of, uint32_t index, uint32_t length)
{
    run_check *check = of;
    for (uint32_t j = 0; j < length; j++) assert_int_equal(check->block->records[check->at++][0], index + j);
}

static void blocks_come_back(void **context)
{
    (void)context;
    comp_block *block = base_alloc(sizeof *block), *back = base_alloc(sizeof *back);
    unsigned char *bytes = base_alloc(comp_block_bound(COMP_BLOCK_RECORDS));
    assert_true(block && back && bytes);
    for (int trial = 0; trial < 3000; trial++) {
        const int count = trial % 7 == 0 ? COMP_BLOCK_RECORDS : 1 + (int)(next_random() % COMP_BLOCK_RECORDS);
        fill_block(block, count);
        memset(bytes, 0xa5, comp_block_bound(COMP_BLOCK_RECORDS));
        unsigned char *const end = comp_block_write(block, bytes);
        assert_true((size_t)(end - bytes) + COMP_WORDS_SLACK <= comp_block_bound(count));
        assert_ptr_equal(comp_block_read(bytes, back), end);
        assert_int_equal(back->count, count);
        assert_memory_equal(back->records, block->records, (size_t)count * sizeof *block->records);
        run_check check = {block, 0};
        assert_ptr_equal(comp_block_runs(bytes, check_run, &check), end);
        assert_int_equal(check.at, count);
    }
    base_free(block);
    base_free(back);
    base_free(bytes);
}

/* A row of a plane's depths, exact in float32, has no remains but its first two: its words are a byte each. */
static void straight_lines_are_a_byte_a_word(void **context)
{
    (void)context;
    comp_block *block = base_alloc(sizeof *block);
    unsigned char *bytes = base_alloc(comp_block_bound(COMP_BLOCK_RECORDS));
    assert_true(block && bytes);
    block->count = 1 << COMP_RUN_SHIFT;
    for (int i = 0; i < block->count; i++) {
        block->records[i][0] = (uint32_t)i;
        for (int k = 1; k < COMP_RECORD_WORDS; k++)
            block->records[i][k] = bits_of(1 + (float)k * 0x1p-10f * (float)(i + k));
    }
    const int64_t length = comp_block_write(block, bytes) - bytes;
    const int64_t words = (COMP_RECORD_WORDS - 1) * block->count;
    /* Bytes and lengths of all, 3 more bytes of the first and the second of each word at most, the head, and a run. */
    assert_true(length <= words + words / 4 + 6 * (COMP_RECORD_WORDS - 1) + COMP_BLOCK_HEAD + 2);
    base_free(block);
    base_free(bytes);
}

/* ---- routes -------------------------------------------------------------------------------------------------- */

/* The place of a fragment for the owner after the round. */
static int carried(const comp_route *route, int round, int place, int owner)
{
    const int stride = comp_route_stride(route, round);
    return comp_route_partner(route, round, stride, place, comp_route_digit(route, round, stride, owner));
}

static void check_way(const comp_route *route, int from, int owner)
{
    int at = from < route->owners ? from : from - route->owners;
    for (int round = 0; round < route->round_count; round++) {
        const int to = carried(route, round, at, owner), stride = comp_route_stride(route, round);
        assert_in_range(to, 0, route->owners - 1);
        /* Whoever it comes from is a partner of whom it goes to. */
        assert_int_equal(comp_route_partner(route, round, stride, to, comp_route_digit(route, round, stride, at)), at);
        at = to;
    }
    assert_int_equal(at, owner);
}

static void check_route(comp_schedule schedule, int ranks, comp_nodes nodes, int radix)
{
    const comp_route route = comp_route_of(schedule, ranks, nodes, radix);
    int64_t product = 1;
    for (int i = 0; i < route.round_count; i++) product *= route.radix[i];
    assert_int_equal(product, route.owners);
    assert_true(route.owners <= ranks && 2 * route.owners > ranks - (ranks == 1));
    const int step = ranks / 97 + 1;
    for (int r = 0; r < ranks; r += step) {
        assert_int_equal(comp_route_rank(&route, comp_route_place(&route, r)), r);
        for (int o = 0; o < route.owners; o += step) check_way(&route, comp_route_place(&route, r), o);
        check_way(&route, comp_route_place(&route, r), route.owners - 1);
    }
    assert_int_equal(comp_route_place(&route, 0), 0);
}

static void routes_lead_to_owners(void **context)
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
    const comp_route route = comp_route_of(schedule, ranks, nodes, 8);
    int *children = calloc((size_t)route.owners, sizeof *children);
    assert_non_null(children);
    for (int place = 1; place < route.owners; place++) {
        const int parent = comp_gather_parent(&route, place);
        assert_in_range(parent, 0, place - 1); /* so that every way ends at 0 */
        children[parent]++;
    }
    for (int place = 0; place < route.owners; place++) {
        assert_int_equal(comp_gather_children(&route, place), children[place]);
        assert_true(children[place] < nodes.ranks + COMP_GATHER_FAN);
    }
    free(children);
}

static void gathering_is_a_tree(void **context)
{
    (void)context;
    const int counts[] = {1, 2, 3, 5, 7, 64, 65, 66, 128, 4096, 4160, 97336, 100000};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        for (int node = 1; node <= 128; node *= 2)
            for (comp_schedule s = COMP_DIRECT; s < COMP_SCHEDULE_COUNT && counts[i] % node == 0; s++)
                check_gather(counts[i], (comp_nodes){node, false}, s);
}

/* The chosen route is no dearer than any schedule; few ranks send directly; and with up to 100,000 ranks, each with its
 * share of a picture, none sends more than a few hundred messages. */
static void the_cheapest_route_is_chosen(void **context)
{
    (void)context;
    const int counts[] = {2, 3, 5, 7, 8, 16, 32, 64, 127, 1000, 4000, 32768, 97336, 100000};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        const int ranks = counts[i], node = ranks % 8 == 0 && ranks > 8 ? 8 : 1;
        const comp_load load = {(int64_t)(4e6 / pow(ranks, 2.0 / 3)), 11};
        const comp_route best = comp_cheapest_route(ranks, (comp_nodes){node, false}, &load, &comp_usual_machine);
        const comp_cost cost = comp_cost_of(&best, &load, &comp_usual_machine);
        for (comp_schedule s = COMP_DIRECT; s < COMP_SCHEDULE_COUNT; s++) {
            const comp_route other = comp_route_of(s, ranks, (comp_nodes){node, false}, 8);
            assert_true(cost.seconds <= comp_cost_of(&other, &load, &comp_usual_machine).seconds);
        }
        if (ranks <= 8) assert_int_equal(best.schedule, COMP_DIRECT);
        assert_true(cost.messages < 300);
    }
}

/* A round of direct send among eight costs what the model says, term by term. */
static void costs_are_those_of_the_model(void **context)
{
    (void)context;
    const comp_machine machine = {1, 10, 100, 0, 0, 0};
    const comp_load load = {800, 2};
    const comp_route route = comp_route_of(COMP_DIRECT, 8, (comp_nodes){1, false}, 0);
    const comp_cost cost = comp_cost_of(&route, &load, &machine);
    assert_true(cost.messages == 7 && cost.bytes == 1400);
    assert_true(cost.seconds == 1 + 2 * 10 * 7 + 100 * 1400);
    assert_int_equal(comp_route_messages(&route, 3), 7);
}

/* Owned index and pixel are one to one, for any number of ranks: the division by a product is a division. */
static void indices_and_pixels_are_one_to_one(void **context)
{
    (void)context;
    const int counts[] = {1, 2, 3, 5, 7, 16, 63, 64, 65, 1000, 97336, 100000};
    const uint32_t pixels[] = {1, 63, 64, 65, 1920 * 1080, 4294967295u};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++)
        for (size_t k = 0; k < sizeof pixels / sizeof *pixels; k++) {
            const comp_layout layout = comp_layout_of(pixels[k], counts[i]);
            for (int trial = 0; trial < 2000; trial++) {
                const uint32_t pixel = trial == 0 ? pixels[k] - 1 : next_random() % pixels[k];
                const uint32_t run = pixel >> layout.run_shift, owner = comp_layout_owner(&layout, pixel);
                assert_int_equal(comp_layout_round(&layout, run), run / (uint32_t)counts[i]);
                assert_int_equal(comp_layout_pixel(&layout, owner, comp_layout_index(&layout, pixel)), pixel);
            }
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(words_come_back),
        cmocka_unit_test(blocks_come_back),
        cmocka_unit_test(straight_lines_are_a_byte_a_word),
        cmocka_unit_test(routes_lead_to_owners),
        cmocka_unit_test(gathering_is_a_tree),
        cmocka_unit_test(the_cheapest_route_is_chosen),
        cmocka_unit_test(costs_are_those_of_the_model),
        cmocka_unit_test(indices_and_pixels_are_one_to_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
