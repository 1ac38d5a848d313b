#include "comp_block.h"

#include <stdbool.h>
#include <string.h>

#include "comp_words.h"

enum word_kind { WORD_CODED, WORD_SAME, WORD_AS_BEFORE };
enum { MOST_RUN_BYTES = 6 }; /* of one record: 5 for the gap, 1 for the length */

_Static_assert(COMP_BLOCK_RECORDS *(MOST_RUN_BYTES + 5 * (COMP_RECORD_WORDS - 1)) < 1 << 16, "bytes fit in 16 bits");

typedef uint32_t quad __attribute__((vector_size(16)));
typedef int32_t signed_quad __attribute__((vector_size(16)));

/* The eight words of a record. */
typedef struct pair {
    quad low, high;
} pair;

static inline pair load(const uint32_t *words)
{
    pair p;
    memcpy(&p, words, sizeof p);
    return p;
}

static inline void store(uint32_t *words, pair p)
{
    memcpy(words, &p, sizeof p);
}

/* Maps values near 0, of either sign, to small ones. */
static inline quad folded(quad value)
{
    return value << 1 ^ (quad)((signed_quad)value >> 31);
}

static inline quad unfolded(quad value)
{
    return value >> 1 ^ -(value & 1);
}

static inline uint32_t fold(uint32_t value)
{
    return value << 1 ^ (0 - (value >> 31));
}

static inline uint32_t unfold(uint32_t value)
{
    return value >> 1 ^ (0 - (value & 1));
}

size_t comp_block_bound(int records)
{
    return COMP_BLOCK_HEAD + (size_t)records * MOST_RUN_BYTES +
           (COMP_RECORD_WORDS - 1) * (comp_words_bound((size_t)records) + sizeof(uint32_t)) + COMP_WORDS_SLACK;
}

/* ---- runs ---------------------------------------------------------------------------------------------------- */

static unsigned char *write_number(uint32_t number, unsigned char *out)
{
    for (; number > 127; number >>= 7) *out++ = (unsigned char)(number | 128);
    *out++ = (unsigned char)number;
    return out;
}

static inline const unsigned char *read_number(const unsigned char *in, uint32_t *number)
{
    uint32_t value = *in & 127;
    for (unsigned shift = 7; *in++ & 128; shift += 7) value |= (uint32_t)(*in & 127) << shift;
    *number = value;
    return in;
}

/* Counts the records, from the first on, that make a run. */
static int run_length(const comp_block *block, int first)
{
    const uint32_t begin = block->records[first][0], most = (1u << COMP_RUN_SHIFT) - begin % (1u << COMP_RUN_SHIFT);
    const uint32_t left = (uint32_t)(block->count - first), end = most < left ? most : left;
    uint32_t length = 1;
    while (length < end && block->records[first + (int)length][0] == begin + length) length++;
    return (int)length;
}

/* ---- kinds of words ------------------------------------------------------------------------------------------ */

/* Bits in which any record's word differs from the first record's, and from its own next word. */
typedef struct differences {
    pair from_first, from_next;
} differences;

static inline void find_differences(const uint32_t *record, const pair *own, const pair *first, differences *d)
{
    const pair next = load(record + 1); /* its last word is the next record's first, whose difference is not used */
    d->from_first.low |= own->low ^ first->low;
    d->from_first.high |= own->high ^ first->high;
    d->from_next.low |= own->low ^ next.low;
    d->from_next.high |= own->high ^ next.high;
}

static void find_kinds(const differences *d, unsigned char kinds[COMP_RECORD_WORDS])
{
    uint32_t others[COMP_RECORD_WORDS], next[COMP_RECORD_WORDS];
    store(others, d->from_first);
    store(next, d->from_next);
    for (int k = 1; k < COMP_RECORD_WORDS; k++)
        kinds[k] = !others[k] ? WORD_SAME : k > 1 && !next[k - 1] ? WORD_AS_BEFORE : WORD_CODED;
}

static void write_head(const comp_block *block, size_t bytes, size_t run_bytes, const unsigned char *kinds,
                       unsigned char *out)
{
    unsigned all = 0;
    for (unsigned k = 1; k < COMP_RECORD_WORDS; k++) all |= (unsigned)kinds[k] << 2 * k;
    const uint16_t head[4] = {(uint16_t)bytes, (uint16_t)block->count, (uint16_t)run_bytes, (uint16_t)all};
    memcpy(out, head, sizeof head);
}

/* ---- values -------------------------------------------------------------------------------------------------- */

/* Computes the run's remains: the first record is predicted from the one before the run (*last), the second from the
 * first, and each other from a straight line through the two before it. */
static void foretell(comp_block *block, int first, int length, const pair *origin, pair *last, differences *d)
{
    pair slope = {{0}, {0}};
    for (int i = first; i < first + length; i++) {
        const pair own = load(block->records[i]);
        const pair step = {own.low - last->low, own.high - last->high};
        store(block->remains[i], (pair){folded(step.low - slope.low), folded(step.high - slope.high)});
        find_differences(block->records[i], &own, origin, d);
        slope = step;
        if (i == first) slope = (pair){{0}, {0}};
        *last = own;
    }
}

/* Writes each run as its signed gap to the end of the one before, and its length less one; computes all remains. */
static unsigned char *write_runs(comp_block *block, unsigned char *out, differences *d)
{
    const pair origin = load(block->records[0]);
    pair last = {{0}, {0}};
    uint32_t end = 0;
    for (int i = 0, length; i < block->count; i += length) {
        length = run_length(block, i);
        out = write_number(fold(block->records[i][0] - end), out);
        out = write_number((uint32_t)(length - 1), out);
        end = block->records[i][0] + (uint32_t)length;
        foretell(block, i, length, &origin, &last, d);
    }
    return out;
}

static inline void transpose(const quad in[4], quad out[4])
{
    const quad a = __builtin_shufflevector(in[0], in[1], 0, 4, 1, 5);
    const quad b = __builtin_shufflevector(in[0], in[1], 2, 6, 3, 7);
    const quad c = __builtin_shufflevector(in[2], in[3], 0, 4, 1, 5);
    const quad d = __builtin_shufflevector(in[2], in[3], 2, 6, 3, 7);
    out[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
    out[1] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
    out[2] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
    out[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
}

/* Works on groups of four; beyond the last record it writes to scratch. */
static void to_columns(comp_block *block)
{
    for (int i = 0; i < block->count; i += 4)
        for (int half = 0; half < COMP_RECORD_WORDS; half += 4) {
            quad rows[4], columns[4];
            for (int k = 0; k < 4; k++) memcpy(&rows[k], &block->remains[i + k][half], sizeof *rows);
            transpose(rows, columns);
            for (int k = 0; k < 4; k++) memcpy(&block->columns[half + k][i], &columns[k], sizeof *columns);
        }
}

static void from_columns(comp_block *block)
{
    for (int i = 0; i < block->count; i += 4)
        for (int half = 0; half < COMP_RECORD_WORDS; half += 4) {
            quad rows[4], columns[4];
            for (int k = 0; k < 4; k++) memcpy(&columns[k], &block->columns[half + k][i], sizeof *columns);
            transpose(columns, rows);
            for (int k = 0; k < 4; k++) memcpy(&block->remains[i + k][half], &rows[k], sizeof *rows);
        }
}

static unsigned char *write_words(comp_block *block, const unsigned char *kinds, unsigned char *out)
{
    for (int k = 1; k < COMP_RECORD_WORDS; k++) {
        if (kinds[k] != WORD_SAME) continue;
        memcpy(out, &block->records[0][k], sizeof(uint32_t));
        out += sizeof(uint32_t);
    }
    to_columns(block);
    for (int k = 1; k < COMP_RECORD_WORDS; k++)
        if (kinds[k] == WORD_CODED) out = comp_words_write(block->columns[k], (size_t)block->count, out);
    return out;
}

unsigned char *comp_block_write(comp_block *block, unsigned char *out)
{
    unsigned char kinds[COMP_RECORD_WORDS], *const runs = out + COMP_BLOCK_HEAD;
    differences d = {{{0}, {0}}, {{0}, {0}}};
    unsigned char *const end = write_runs(block, runs, &d);
    find_kinds(&d, kinds);
    unsigned char *const words_end = write_words(block, kinds, end);
    write_head(block, (size_t)(words_end - out), (size_t)(end - runs), kinds, out);
    return words_end;
}

/* ---- reading ------------------------------------------------------------------------------------------------- */

/* Reads the remains of all words; *same gets the words that are the same in all records, 0 elsewhere. */
static void read_words(const unsigned char *in, unsigned kinds, comp_block *block, pair *same)
{
    uint32_t words[COMP_RECORD_WORDS] = {0};
    for (int k = 1; k < COMP_RECORD_WORDS; k++) {
        if ((kinds >> 2 * k & 3) != WORD_SAME) continue;
        memcpy(&words[k], in, sizeof(uint32_t));
        in += sizeof(uint32_t);
    }
    *same = load(words);
    for (int k = 1; k < COMP_RECORD_WORDS; k++)
        if ((kinds >> 2 * k & 3) == WORD_CODED)
            in = comp_words_read(in, (size_t)block->count, block->columns[k]);
        else
            memset(block->columns[k], 0, (size_t)block->count * sizeof *block->columns[k]);
    from_columns(block);
}

static void add_up(comp_block *block, const unsigned char *runs, const unsigned char *end, pair last)
{
    uint32_t index = 0;
    for (int i = 0; runs < end;) {
        uint32_t gap, length;
        runs = read_number(read_number(runs, &gap), &length);
        index += unfold(gap);
        pair slope = {{0}, {0}};
        for (uint32_t j = 0; j <= length; j++, i++) {
            const pair left = load(block->remains[i]);
            slope.low += unfolded(left.low);
            slope.high += unfolded(left.high);
            last.low += slope.low;
            last.high += slope.high;
            store(block->records[i], last);
            block->records[i][0] = index++;
            if (j == 0) slope = (pair){{0}, {0}};
        }
    }
}

/* Serves t_out of hits, and two of three channels of grey. */
static void copy_from_before(comp_block *block, unsigned kinds)
{
    for (int k = 2; k < COMP_RECORD_WORDS; k++)
        if ((kinds >> 2 * k & 3) == WORD_AS_BEFORE)
            for (int i = 0; i < block->count; i++) block->records[i][k] = block->records[i][k - 1];
}

const unsigned char *comp_block_runs(const unsigned char *in, comp_run_taker *take, void *state)
{
    uint16_t head[4];
    uint32_t index = 0;
    memcpy(head, in, sizeof head);
    for (const unsigned char *at = in + COMP_BLOCK_HEAD, *end = at + head[2]; at < end;) {
        uint32_t gap, length;
        at = read_number(read_number(at, &gap), &length);
        index += unfold(gap);
        take(state, index, length + 1);
        index += length + 1;
    }
    return in + head[0];
}

const unsigned char *comp_block_read(const unsigned char *in, comp_block *block)
{
    uint16_t head[4];
    pair same;
    memcpy(head, in, sizeof head);
    block->count = head[1];
    const unsigned char *const runs = in + COMP_BLOCK_HEAD, *const words = runs + head[2];
    read_words(words, head[3], block, &same);
    add_up(block, runs, words, same);
    copy_from_before(block, head[3]);
    return in + head[0];
}
