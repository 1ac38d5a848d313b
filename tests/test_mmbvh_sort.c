/* Compares the order of sorted Morton keys with that of qsort(), for various distributions of keys. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "memory.h"
#include "mmbvh_morton.h"

enum { COUNT = 300000 /* large enough that several digits have more keys than one thread sorts by itself */ };

static uint64_t draw_random(uint64_t *state)
{
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    return *state;
}

static int compare_keys(const void *a, const void *b)
{
    uint64_t x, y;
    memcpy(&x, a, sizeof x);
    memcpy(&y, b, sizeof y);
    return (x > y) - (x < y);
}

/* Makes a Morton code with at most the given number of bits, since a mesh may use any range of codes. */
typedef uint64_t code_maker(uint64_t random, int64_t i, int bits);

static uint64_t make_uniform_code(uint64_t random, int64_t i, int bits)
{
    (void)i;
    return random & ((UINT64_C(1) << bits) - 1);
}

/* Makes codes of a mesh that is refined towards a corner: half of the cells are in one half of the box, half of these
 * in a quarter, and so on. */
static uint64_t make_refined_code(uint64_t random, int64_t i, int bits)
{
    return make_uniform_code(random, i, bits) >> (random >> 58) % (unsigned)bits;
}

/* Makes codes that use only the lower half of the bits, except for one code. */
static uint64_t make_outlier_code(uint64_t random, int64_t i, int bits)
{
    return i ? make_uniform_code(random, i, bits) >> bits / 2 : (UINT64_C(1) << bits) - 1;
}

static uint64_t make_equal_code(uint64_t random, int64_t i, int bits)
{
    (void)random;
    (void)i;
    return bits ? 1 : 0;
}

static uint64_t make_descending_code(uint64_t random, int64_t i, int bits)
{
    (void)random;
    return ((UINT64_C(1) << bits) - 1) - (uint64_t)i;
}

static void check_sorted(code_maker *make, int64_t count, int threads)
{
    const double lower[3] = {0, 0, 0}, upper[3] = {1, 1, 1};
    morton_coder coder;
    morton_coder_init(&coder, lower, upper, COUNT);
    const size_t bytes = (size_t)count * sizeof(uint64_t);
    uint64_t *keys = malloc(bytes), *other = malloc(bytes), *right = malloc(bytes), state = 88172645463325252u;
    assert_true(keys && other && right);
    for (int64_t i = 0; i < count; i++) {
        const uint64_t code = make(draw_random(&state), i, coder.code_bits);
        keys[i] = right[i] = code << coder.index_bits | (uint64_t)i;
    }
    qsort(right, (size_t)count, sizeof *right, compare_keys);
    assert_true(morton_sort(&coder, keys, other, count, threads));
    assert_memory_equal(keys, right, bytes);
    free(keys);
    free(other);
    free(right);
}

static void sorted_keys_ascend(void **state)
{
    static code_maker *const makers[] = {make_uniform_code, make_refined_code, make_outlier_code, make_equal_code,
                                         make_descending_code};
    static const int64_t counts[] = {1, 2, 24, 25, 1000, 16384, 16385, COUNT};
    (void)state;
    for (size_t maker = 0; maker < sizeof makers / sizeof *makers; maker++) {
        for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
            for (int threads = 1; threads <= 3; threads++) check_sorted(makers[maker], counts[i], threads);
        }
    }
}

static void failed_allocation_is_reported(void **state)
{
    static uint64_t keys[20000], other[20000];
    const double lower[3] = {0, 0, 0}, upper[3] = {1, 1, 1};
    morton_coder coder;
    (void)state;
    morton_coder_init(&coder, lower, upper, COUNT);
    base_memory_fail_nth(1);
    assert_false(morton_sort(&coder, keys, other, 20000, 1));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sorted_keys_ascend),
        cmocka_unit_test(failed_allocation_is_reported),
    };
    return cmocka_run_group_tests_name("mmbvh_sort", tests, NULL, NULL);
}
