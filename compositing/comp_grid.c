/* A rank packs and sends what others own, and a finished pixel goes to rank 0 from wherever it is. So the owner of a
 * block is best a rank that has much of it: what is its own it need not send. Were it always the rank that has most,
 * one with a little more everywhere would own all. So the owner is drawn by lot, each rank's chance in proportion to
 * the fourth power of its number of fragments. A rank of three quarters has 0.99 of the chances against one of a
 * quarter; among ranks that have much the same, each owns its share.
 *
 * The lot falls on the greatest 4 ln n - ln -ln u, u a random number of the block and the rank (Gumbel's trick): it
 * takes one maximum over all ranks. */
#include "comp_grid.h"

#include <math.h>
#include <stdbool.h>

static void count_blocks(comp_grid *g)
{
    const uint32_t down = ((g->height - 1) >> g->row_shift) + 1;
    g->strips = g->across * down;
    g->blocks_across = ((g->across - 1) >> g->shift_x) + 1;
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

/* Undoes merge_blocks(), or divides strips. */
static void divide_blocks(comp_grid *g)
{
    if (g->shift_x > g->shift_y)
        g->shift_x--;
    else if (g->shift_y > 0)
        g->shift_y--;
    else
        g->row_shift--;
}

/* Blocks are nearly square, and the smallest that are few enough; but for many ranks the largest that are many enough.
 * A block of one row of a strip is not divided. */
comp_grid comp_grid_of(uint32_t width, uint32_t height, int ranks)
{
    comp_grid g = {.width = width, .height = height, .row_shift = 5, .threads = 1};
    const int counted = ranks < COMP_EVEN_RANKS ? ranks : COMP_EVEN_RANKS;
    const uint32_t wanted = counted > 1 ? COMP_RANK_BLOCKS * (uint32_t)counted : 0;
    g.across = (width - 1) / COMP_LANES + 1;
    g.inverse = width > 1 ? UINT64_MAX / width + 1 : 0;
    for (count_blocks(&g); g.blocks > COMP_FEW_BLOCKS; count_blocks(&g)) merge_blocks(&g);
    for (; g.blocks < wanted && (g.shift_x || g.row_shift); count_blocks(&g)) divide_blocks(&g);
    return g;
}

static uint32_t hash(uint32_t x)
{
    x = (x ^ (x >> 16)) * 0x7feb352du;
    x = (x ^ (x >> 15)) * 0x846ca68bu;
    return x ^ (x >> 16);
}

int32_t comp_vote(uint32_t block, int rank, int64_t fragments)
{
    if (fragments <= 0) return 0;
    const uint32_t drawn = hash(hash(block + 1) + (uint32_t)rank);
    const float u = ((float)(drawn >> 8) + 0.5f) * 0x1p-24f; /* between 0 and 1, which it may reach by rounding */
    const float chance = 4 * logf((float)fragments) - logf(-logf(u < 1 ? u : 0x1.fffffep-1f));
    const int steps = (int)(16 * (chance + 3)); /* 0 .. 1800 */
    return (int32_t)((uint32_t)(1 + (steps > 0 ? steps : 0)) << 20 | ((uint32_t)rank & 0xfffff));
}

/* Counts what each rank owns; returns what it would own if all owners had the same, rounded up. */
static uint64_t find_share(const comp_claim *claims, uint32_t blocks, uint64_t *loads, int ranks)
{
    uint64_t owners = 0, all = 0;
    for (int r = 0; r < ranks; r++) loads[r] = 0;
    for (uint32_t b = 0; b < blocks; b++) {
        if (!claims[b].vote) continue;
        uint64_t *const load = &loads[comp_vote_rank(claims[b].vote)];
        owners += *load == 0;
        *load += claims[b].fragments;
        all += claims[b].fragments;
    }
    return owners ? (all + owners - 1) / owners : 0;
}

/* The blocks are gone through in their order, and the owners who take some as well, so that most blocks stay near by.
 * A rank gives a block if it is then nearer to its share. One takes it for the same reason; where there is none, one
 * that is farther beyond its share then, by an eighth of the block, and so on; at last any that has less than its
 * share. Such a rank exists while another has more. As nobody gives its last block, each owner is met among the blocks.
 */
typedef struct takers {
    const comp_claim *claims;
    uint32_t blocks, next;
    uint64_t beyond; /* eighths of a block */
    const uint64_t *loads;
    uint64_t share;
} takers;

static int find_taker(takers *t, uint64_t fragments)
{
    for (;; t->next++) {
        if (t->next == t->blocks) {
            t->next = 0;
            t->beyond += t->beyond < 8;
        }
        const int32_t vote = t->claims[t->next].vote;
        if (!vote) continue;
        const int rank = comp_vote_rank(vote);
        const uint64_t load = t->loads[rank];
        if (load < t->share && 8 * load + (8 - t->beyond) * fragments <= 8 * t->share) return rank;
    }
}

void comp_claims_level(comp_claim *claims, uint32_t blocks, uint64_t *loads, int ranks)
{
    takers t = {claims, blocks, 0, 4, loads, find_share(claims, blocks, loads, ranks)};
    for (uint32_t b = 0; b < blocks; b++) {
        if (!claims[b].vote) continue;
        const uint64_t fragments = claims[b].fragments;
        uint64_t *const load = &loads[comp_vote_rank(claims[b].vote)];
        if (2 * *load < 2 * t.share + fragments || *load == fragments) continue;
        const int taker = find_taker(&t, fragments);
        *load -= fragments;
        loads[taker] += fragments;
        claims[b].vote = comp_vote_of(claims[b].vote, taker);
    }
}
