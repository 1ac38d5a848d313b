/* Chooses the owners of blocks. A rank must pack and send the fragments of blocks that other ranks own, while each
 * finished pixel is sent to rank 0 regardless of its owner. The best owner of a block is therefore a rank with many
 * fragments in it, because these need not be sent. If the rank with the most fragments always became the owner, a rank
 * with slightly more fragments in every block would own all blocks. The owner is therefore chosen at random, with a
 * probability proportional to the fourth power of the rank's number of fragments. A rank with three quarters of the
 * fragments has a probability of 0.99 against a rank with one quarter; ranks with similar numbers own about the same
 * number of blocks.
 *
 * The random choice takes one maximum over all ranks (the Gumbel trick): the owner is the rank with the largest 4 ln n
 * - ln(-ln u), where n is its number of fragments, and u a random number between 0 and 1 that depends on the block and
 * the rank. */
#include "comp_grid.h"

#include <math.h>
#include <stdbool.h>

static void count_blocks(comp_grid *g)
{
    const uint32_t down = ((g->height - 1) >> g->row_shift) + 1;
    g->strips = g->strips_per_row * down;
    g->blocks_across = ((g->strips_per_row - 1) >> g->shift_x) + 1;
    g->blocks = g->blocks_across * (((down - 1) >> g->shift_y) + 1);
}

static void merge_blocks(comp_grid *g)
{
    const bool are_beside = g->blocks_across > 1, are_below = g->blocks > g->blocks_across;
    if (are_beside && (g->shift_x <= g->shift_y || !are_below))
        g->shift_x++;
    else
        g->shift_y++;
}

/* Halves the blocks: reverses merge_blocks(), or halves the number of rows of a strip if a block is a single strip. */
static void divide_blocks(comp_grid *g)
{
    if (g->shift_x > g->shift_y)
        g->shift_x--;
    else if (g->shift_y > 0)
        g->shift_y--;
    else
        g->row_shift--;
}

/* Divides the picture into blocks that are nearly square, and as small as possible without exceeding COMP_TARGET_BLOCKS
 * blocks. If there are many ranks, blocks are divided further, until there are enough for every rank or a block is one
 * row of a strip. */
comp_grid comp_make_grid(uint32_t width, uint32_t height, int ranks)
{
    comp_grid g = {.width = width, .height = height, .row_shift = 5, .threads = 1};
    const int counted = ranks < COMP_COUNTED_RANKS_MAX ? ranks : COMP_COUNTED_RANKS_MAX;
    const uint32_t wanted = counted > 1 ? COMP_BLOCKS_PER_RANK * (uint32_t)counted : 0;
    g.strips_per_row = (width - 1) / COMP_LANES + 1;
    g.inverse = width > 1 ? UINT64_MAX / width + 1 : 0;
    for (count_blocks(&g); g.blocks > COMP_TARGET_BLOCKS; count_blocks(&g)) merge_blocks(&g);
    for (; g.blocks < wanted && (g.shift_x || g.row_shift); count_blocks(&g)) divide_blocks(&g);
    return g;
}

static uint32_t hash_word(uint32_t x)
{
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

int32_t comp_claim_priority(uint32_t block, int rank, int64_t fragments)
{
    if (fragments <= 0) return 0;
    const uint32_t drawn = hash_word(hash_word(block + 1) + (uint32_t)rank);
    /* random number between 0 and 1; it may be rounded to 1 */
    const float u = ((float)(drawn >> 8) + 0.5f) * 0x1p-24f;
    const float chance = 4 * logf((float)fragments) - logf(-logf(u < 1 ? u : 0x1.fffffep-1f));
    /* the priority as an integer from 0 to about 1800, in units of 1/16 */
    const int steps = (int)(16 * (chance + 3));
    return (int32_t)((uint32_t)(1 + (steps > 0 ? steps : 0)) << 20 | ((uint32_t)rank & 0xfffff));
}

/* Stores in loads[r] the number of fragments in the blocks that rank r owns. Returns the mean of these numbers over the
 * ranks that own blocks, rounded up. */
static uint64_t compute_mean_owner_load(const comp_claim *claims, uint32_t blocks, uint64_t *loads, int ranks)
{
    uint64_t owners = 0, all = 0;
    for (int r = 0; r < ranks; r++) loads[r] = 0;
    for (uint32_t b = 0; b < blocks; b++) {
        if (!claims[b].priority) continue;
        uint64_t *const load = &loads[comp_priority_rank(claims[b].priority)];
        owners += *load == 0;
        *load += claims[b].fragments;
        all += claims[b].fragments;
    }
    return owners ? (all + owners - 1) / owners : 0;
}

/* The state of a pass that moves blocks from ranks with more fragments than the equal share (the mean) to ranks with
 * fewer. Blocks and the ranks that receive them are visited in the same order, so that most blocks stay near their
 * neighbours. A block is moved to a rank if the excess of that rank over the equal share is afterwards at most
 * allowed_excess eighths of the block's fragments. If no rank satisfies this condition, allowed_excess is increased by
 * one, until any rank below the share may receive the block. As long as one rank is above the share, another rank is
 * below it. No rank loses its last block, so that only ranks that own blocks can receive further ones. */
typedef struct owner_search {
    const comp_claim *claims;
    uint32_t blocks, next;   /* number of blocks, and index of the claim whose rank is considered next */
    uint64_t allowed_excess; /* allowed excess over the equal share, in eighths of a block's fragments */
    const uint64_t *loads;   /* number of fragments that each rank owns so far */
    uint64_t equal_share;    /* number of fragments per owner if all own the same number, rounded up */
} owner_search;

static int find_new_owner(owner_search *t, uint64_t fragments)
{
    for (;; t->next++) {
        if (t->next == t->blocks) {
            t->next = 0;
            t->allowed_excess += t->allowed_excess < 8;
        }
        const int32_t priority = t->claims[t->next].priority;
        if (!priority) continue;
        const int rank = comp_priority_rank(priority);
        const uint64_t load = t->loads[rank];
        if (load < t->equal_share && 8 * load + (8 - t->allowed_excess) * fragments <= 8 * t->equal_share) return rank;
    }
}

void comp_claims_balance(comp_claim *claims, uint32_t blocks, uint64_t *loads, int ranks)
{
    owner_search t = {claims, blocks, 0, 4, loads, compute_mean_owner_load(claims, blocks, loads, ranks)};
    for (uint32_t b = 0; b < blocks; b++) {
        if (!claims[b].priority) continue;
        const uint64_t fragments = claims[b].fragments;
        uint64_t *const load = &loads[comp_priority_rank(claims[b].priority)];
        if (2 * *load < 2 * t.equal_share + fragments || *load == fragments) continue;
        const int new_owner = find_new_owner(&t, fragments);
        *load -= fragments;
        loads[new_owner] += fragments;
        claims[b].priority = comp_priority_with_rank(claims[b].priority, new_owner);
    }
}
