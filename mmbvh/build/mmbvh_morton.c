/* The bits of a code are assigned to axes by repeatedly halving the bounding box across its longest side. The nodes are
 * therefore as close to cubes as possible for any shape of the mesh. Bits are interleaved by table lookups, seven bits
 * at a time. */
#include "mmbvh_morton.h"

#include <omp.h>
#include <string.h>

#include "memory.h"
#include "region.h"

enum {
    CODE_BITS_MAX = 3 * MORTON_AXIS_BITS,
    /* maximum number of bits of a radix sort digit; a core's cache has space for the write position of each value of
     * the digit */
    DIGIT_BITS = 11,
    DIGITS = 1 << DIGIT_BITS,
    /* number of chunks per thread; there are several, so that other threads can take chunks of a delayed one */
    SORT_CHUNKS = 4,
    SORT_CHUNKS_MAX = 64,
    /* a group of keys with equal digits is sorted by all threads together if it has more than 1/SORT_LARGE of all
     * keys */
    SORT_LARGE = 16,
    SORT_LARGE_MIN = 16384,
    SORT_INSERTED = 24, /* groups with at most this many keys are sorted by insertion */
    /* sort_serial() chooses digits of so many bits that, if keys are spread evenly, about 2^SORT_LEFT_BITS keys have
     * each value of the digit */
    SORT_LEFT_BITS = 2
};

static int count_significant_bits(uint64_t x)
{
    return x ? 64 - __builtin_clzll(x) : 0;
}

/* Assigns each bit of the code to an axis, the highest bit first, and counts the bits of each axis. */
static void choose_axes(const double lower[3], const double upper[3], int code_bits, int axes[], int counts[3])
{
    double sides[3];
    for (int axis = 0; axis < 3; axis++) {
        sides[axis] = upper[axis] - lower[axis];
        counts[axis] = 0;
    }
    for (int bit = 0; bit < code_bits; bit++) {
        int longest = -1;
        for (int axis = 0; axis < 3; axis++) {
            if (counts[axis] == MORTON_AXIS_BITS) continue;
            if (longest < 0 || sides[axis] > sides[longest]) longest = axis;
        }
        axes[bit] = longest;
        counts[longest]++;
        sides[longest] *= 0.5;
    }
}

void morton_coder_init(morton_coder *coder, const double lower[3], const double upper[3], int64_t index_count)
{
    int axes[CODE_BITS_MAX], counts[3];
    memset(coder, 0, sizeof *coder);
    coder->index_bits = count_significant_bits((uint64_t)index_count);
    coder->code_bits = 64 - coder->index_bits < CODE_BITS_MAX ? 64 - coder->index_bits : CODE_BITS_MAX;
    choose_axes(lower, upper, coder->code_bits, axes, counts);
    int left[3];
    for (int axis = 0; axis < 3; axis++) {
        const double side = upper[axis] - lower[axis], steps = (double)(1 << counts[axis]);
        coder->origin[axis] = lower[axis];
        coder->factor[axis] = side > 0 && side < INFINITY ? steps / side : 0;
        coder->last_step[axis] = steps - 1;
        left[axis] = counts[axis];
    }
    for (int bit = 0; bit < coder->code_bits; bit++) {
        const int axis = axes[bit], place = --left[axis];
        const uint64_t mask = UINT64_C(1) << (coder->index_bits + coder->code_bits - 1 - bit);
        uint64_t *part = coder->parts[axis][place / MORTON_PART_BITS];
        for (int i = 0; i < 1 << MORTON_PART_BITS; i++) {
            if (i >> place % MORTON_PART_BITS & 1) part[i] |= mask;
        }
    }
}

static inline uint64_t encode_morton_steps(const morton_coder *coder, const int32_t steps[])
{
    uint64_t code = 0;
    for (int axis = 0; axis < 3; axis++) {
        for (int part = 0; part < MORTON_PARTS; part++) {
            const int bits = steps[axis] >> part * MORTON_PART_BITS & ((1 << MORTON_PART_BITS) - 1);
            code |= coder->parts[axis][part][bits];
        }
    }
    return code;
}

/* Returns the Morton code of a box whose centre is given in the source's coordinates. */
static inline uint64_t encode_box_centre(const bounds_source *source, const morton_coder *coder, const double centre[3])
{
    int32_t steps[3];
    for (int axis = 0; axis < 3; axis++) {
        const double x = (centre[axis] - source->origin[axis]) * source->scale;
        const double place = (x - coder->origin[axis]) * coder->factor[axis];
        steps[axis] = (int32_t)(place > 0 ? place < coder->last_step[axis] ? place : coder->last_step[axis] : 0);
    }
    return encode_morton_steps(coder, steps);
}

/* Maps the centre of a box of floats, in the source's coordinates, to integer coordinates in the grid of the Morton
 * code. */
typedef struct sum_mapping {
    /* integer coordinate of a centre on each axis: (centre - origin) * factor, rounded down and clamped to 0 ..
     * last_step */
    vec4 origin, factor, last_step;
} sum_mapping;

static sum_mapping sum_mapping_make(const bounds_source *source, const morton_coder *coder)
{
    sum_mapping m = {.factor = {0}};
    for (int axis = 0; axis < 3; axis++) {
        m.origin[axis] = (float)(source->origin[axis] + coder->origin[axis] / source->scale);
        m.factor[axis] = (float)(source->scale * coder->factor[axis]);
        m.last_step[axis] = (float)coder->last_step[axis];
    }
    return m;
}

/* Returns the Morton code of a box of floats. NaN is mapped to the integer coordinate 0. */
static inline uint64_t encode_float_box(const sum_mapping *m, const morton_coder *coder,
                                        const fetch_float_box *float_box)
{
    const vec4 place = ((float_box->lower + float_box->upper) * 0.5f - m->origin) * m->factor;
    _Alignas(16) int32_t steps[4];
    *(ivec4 *)(void *)steps = vec4_truncate(vec4_min(vec4_max(place, (vec4){0}), m->last_step));
    return encode_morton_steps(coder, steps);
}

static int list_block_cells(const morton_coder *coder, const uint64_t *keys, int64_t count,
                            uint32_t cells[BOUNDS_BLOCK])
{
    const uint64_t mask = (UINT64_C(1) << coder->index_bits) - 1;
    const int n = (int)(count < BOUNDS_BLOCK ? count : BOUNDS_BLOCK);
    for (int i = 0; i < n; i++) cells[i] = (uint32_t)(keys[i] & mask);
    return n;
}

static fetch_box make_float_box_keys(const bounds_source *source, const morton_coder *coder, uint64_t *keys,
                                     int64_t count)
{
    uint32_t cells[BOUNDS_BLOCK];
    fetch_float_box float_boxes[BOUNDS_BLOCK], all = fetch_float_box_empty();
    const sum_mapping m = sum_mapping_make(source, coder);
    for (int64_t begin = 0; begin < count; begin += BOUNDS_BLOCK) {
        const int n = list_block_cells(coder, keys + begin, count - begin, cells);
        source->read_float_boxes(source, cells, n, float_boxes);
        for (int i = 0; i < n; i++) {
            unite_float_boxes(&all, &float_boxes[i]);
            keys[begin + i] = encode_float_box(&m, coder, &float_boxes[i]) | cells[i];
        }
    }
    return fetch_float_box_widen(&all);
}

static fetch_box make_box_keys(const bounds_source *source, const morton_coder *coder, uint64_t *keys, int64_t count)
{
    uint32_t cells[BOUNDS_BLOCK];
    fetch_box boxes[BOUNDS_BLOCK], all;
    fetch_box_empty(&all);
    for (int64_t begin = 0; begin < count; begin += BOUNDS_BLOCK) {
        const int n = list_block_cells(coder, keys + begin, count - begin, cells);
        source->read(source, cells, n, boxes);
        for (int i = 0; i < n; i++) {
            double centre[3];
            for (int axis = 0; axis < 3; axis++) centre[axis] = 0.5 * (boxes[i].lower[axis] + boxes[i].upper[axis]);
            unite_boxes(&all, &boxes[i]);
            keys[begin + i] = encode_box_centre(source, coder, centre) | cells[i];
        }
    }
    return all;
}

void morton_make_keys(const bounds_source *source, const morton_coder *coder, uint64_t *keys, int64_t count,
                      fetch_box *exact)
{
    const fetch_box all = source->read_float_boxes ? make_float_box_keys(source, coder, keys, count)
                                                   : make_box_keys(source, coder, keys, count);
    unite_boxes(exact, &all);
}

/* ---- sorting ---------------------------------------------------------------------------------------------------- */

/* The counts of a radix sort that begins with the highest digit: how many keys have each value of this digit. The sort
 * first moves the keys to one group per value of the digit. Neighbouring cells mostly have neighbouring indices, so
 * that consecutive keys go to few groups. A group usually fits in a core's cache, in which it is then sorted
 * completely. */
typedef struct digit_counts {
    int64_t chunk_digits[SORT_CHUNKS_MAX][DIGITS]; /* number of keys of each chunk with each value of the digit */
} digit_counts;

typedef struct sorting {
    int64_t large; /* groups of keys with more keys than this are sorted by all threads together */
    int chunks, threads;
    digit_counts *counts; /* count of the keys for each chunk and each value of the digit */
} sorting;

static inline int extract_digit(uint64_t key, int shift)
{
    return (int)(key >> shift & (DIGITS - 1));
}

static void count_digits(const sorting *s, const uint64_t *keys, int64_t count, int shift)
{
#pragma omp parallel num_threads(s->threads)
    {
        region_enter();
#pragma omp for schedule(dynamic) nowait
        for (int chunk = 0; chunk < s->chunks; chunk++) {
            int64_t *of = s->counts->chunk_digits[chunk];
            memset(of, 0, sizeof s->counts->chunk_digits[chunk]);
            const int64_t end = count * (chunk + 1) / s->chunks;
            for (int64_t i = count * chunk / s->chunks; i < end; i++) of[extract_digit(keys[i], shift)]++;
        }
        region_leave();
    }
}

/* Replaces the counts of keys in s->counts by the positions to which each chunk's keys are moved, digit by digit.
 * starts[d] receives the position of the first key with digit d. */
static void compute_starts_of_digits(const sorting *s, int64_t starts[DIGITS + 1])
{
    int64_t sum = 0;
    for (int digit = 0; digit < DIGITS; digit++) {
        starts[digit] = sum;
        for (int chunk = 0; chunk < s->chunks; chunk++) {
            const int64_t count = s->counts->chunk_digits[chunk][digit];
            s->counts->chunk_digits[chunk][digit] = sum;
            sum += count;
        }
    }
    starts[DIGITS] = sum;
}

static void move_keys_by_digit(const sorting *s, const uint64_t *from, uint64_t *to, int64_t count, int shift)
{
#pragma omp parallel num_threads(s->threads)
    {
        region_enter();
#pragma omp for schedule(dynamic) nowait
        for (int chunk = 0; chunk < s->chunks; chunk++) {
            int64_t *places = s->counts->chunk_digits[chunk];
            const int64_t end = count * (chunk + 1) / s->chunks;
            for (int64_t i = count * chunk / s->chunks; i < end; i++)
                to[places[extract_digit(from[i], shift)]++] = from[i];
        }
        region_leave();
    }
}

static void insertion_sort(uint64_t *keys, int64_t count)
{
    for (int64_t i = 1; i < count; i++) {
        const uint64_t key = keys[i];
        int64_t place = i;
        for (; place > 0 && keys[place - 1] > key; place--) keys[place] = keys[place - 1];
        keys[place] = key;
    }
}

/* Sorts the keys in `from` on one thread; the result is in `other` if to_other is set, and otherwise in `from`. The
 * number of bits of a digit is chosen so that only a few keys have the same value of the digit. All keys must be
 * different. */
static void sort_serial(uint64_t *from, uint64_t *other, int64_t count, bool to_other)
{
    if (count <= SORT_INSERTED) {
        insertion_sort(from, count);
        if (to_other) memcpy(other, from, (size_t)count * sizeof *from);
        return;
    }
    uint64_t differing = 0;
    for (int64_t i = 1; i < count; i++) differing |= from[i] ^ from[0];
    const int top = count_significant_bits(differing),
              wanted = count_significant_bits((uint64_t)count) - SORT_LEFT_BITS;
    const int bits = wanted < DIGIT_BITS ? wanted : DIGIT_BITS, shift = top > bits ? top - bits : 0;
    const uint64_t mask = (UINT64_C(1) << bits) - 1;
    uint32_t ends[DIGITS];
    memset(ends, 0, sizeof *ends << bits);
    for (int64_t i = 0; i < count; i++) ends[from[i] >> shift & mask]++;
    uint32_t sum = 0;
    for (uint64_t digit = 0; digit <= mask; digit++) {
        const uint32_t of = ends[digit];
        ends[digit] = sum;
        sum += of;
    }
    for (int64_t i = 0; i < count; i++) other[ends[from[i] >> shift & mask]++] = from[i];
    for (uint64_t digit = 0, begin = 0; digit <= mask; begin = ends[digit++]) {
        sort_serial(other + begin, from + begin, ends[digit] - (int64_t)begin, !to_other);
    }
}

/* Sorts the keys in `from` on all threads; the result is in `other` if to_other is set, and otherwise in `from`. Only
 * the lowest `top` bits of the keys may differ. All keys must be different. */
static void sort_parallel(const sorting *s, uint64_t *from, uint64_t *other, int64_t count, int top, bool to_other)
{
    int64_t starts[DIGITS + 1];
    const int shift = top > DIGIT_BITS ? top - DIGIT_BITS : 0;
    count_digits(s, from, count, shift);
    compute_starts_of_digits(s, starts);
    move_keys_by_digit(s, from, other, count, shift);
#pragma omp parallel num_threads(s->threads)
    {
        region_enter();
#pragma omp for schedule(dynamic, 8) nowait
        for (int digit = 0; digit < DIGITS; digit++) {
            const int64_t begin = starts[digit], size = starts[digit + 1] - begin;
            if (size <= s->large) sort_serial(other + begin, from + begin, size, !to_other);
        }
        region_leave();
    }
    for (int digit = 0; digit < DIGITS; digit++) {
        const int64_t begin = starts[digit], size = starts[digit + 1] - begin;
        if (size > s->large) sort_parallel(s, other + begin, from + begin, size, shift, !to_other);
    }
}

bool morton_sort(const morton_coder *coder, uint64_t *keys, uint64_t *other, int64_t count, int threads)
{
    if (count <= SORT_LARGE_MIN) {
        sort_serial(keys, other, count, false);
        return true;
    }
    sorting s = {.threads = threads};
    s.chunks = SORT_CHUNKS * threads < SORT_CHUNKS_MAX ? SORT_CHUNKS * threads : SORT_CHUNKS_MAX;
    s.large = count / SORT_LARGE > SORT_LARGE_MIN ? count / SORT_LARGE : SORT_LARGE_MIN;
    s.counts = base_alloc((size_t)s.chunks * sizeof s.counts->chunk_digits[0]);
    if (!s.counts) return false;
    sort_parallel(&s, keys, other, count, coder->index_bits + coder->code_bits, false);
    base_free(s.counts);
    return true;
}

/* ---- the tree --------------------------------------------------------------------------------------------------- */

/* Returns the number of keys in which the highest bit that differs between the keys is 0. There must be at least two
 * keys, in ascending order. */
static int64_t find_split(const uint64_t *keys, int64_t count)
{
    const int bit = count_significant_bits(keys[0] ^ keys[count - 1]) - 1;
    const uint64_t border = keys[count - 1] >> bit << bit;
    int64_t low = 0, high = count - 1; /* invariant: the highest differing bit is 0 in keys[low] and 1 in keys[high] */
    while (high - low > 1) {
        const int64_t middle = low + (high - low) / 2;
        if (keys[middle] < border) {
            low = middle;
        } else {
            high = middle;
        }
    }
    return high;
}

static topology_link build_subtree(topology_scratch *scratch, const uint64_t *keys, int64_t first, int64_t count)
{
    if (count <= MMBVH_MAX_LEAF) return topology_leaf(first, count);
    const int64_t left_count = find_split(keys + first, count), pair = topology_new_pair(scratch);
    const topology_link left = build_subtree(scratch, keys, first, left_count);
    const topology_link right = build_subtree(scratch, keys, first + left_count, count - left_count);
    scratch->links[pair] = left;
    scratch->links[pair + 1] = right;
    return topology_inner(pair);
}

static void build_top(topology_build *build, topology *t, const uint64_t *keys)
{
    if (atomic_load(&build->failed)) return;
    if (t->count <= TOPOLOGY_SUBTREE_CELLS) {
        topology_scratch *scratch = &build->scratch[omp_get_thread_num()];
        scratch->count = 0;
        const topology_link root = build_subtree(scratch, keys + t->first, 0, t->count);
        topology_copy_links(build, t, scratch, root);
        return;
    }
    const int64_t left_count = find_split(keys + t->first, t->count);
    for (int side = 0; side < 2; side++) {
        const int64_t begin = side ? left_count : 0, end = side ? t->count : left_count;
        topology *child = t->children[side] = topology_new(build, t->first + begin, end - begin);
        if (!child) return;
#pragma omp task default(none) firstprivate(build, child, keys)
        build_top(build, child, keys);
    }
}

topology *morton_build(topology_build *build, const uint64_t *keys, int64_t count)
{
    topology *root = topology_new(build, 0, count);
    if (!root) return NULL;
#pragma omp parallel num_threads(build->threads)
    {
        region_enter();
#pragma omp single
        build_top(build, root, keys);
        region_leave();
    }
    if (!atomic_load(&build->failed)) return root;
    topology_free(root);
    return NULL;
}
