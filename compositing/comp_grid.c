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
#include <stddef.h>

/* Blocks are the smallest that are few enough, and nearly square. */
comp_grid comp_grid_of(uint32_t width, uint32_t height)
{
    comp_grid g = {.width = width, .height = height, .threads = 1};
    const uint32_t across = (width - 1) / COMP_LANES + 1, down = (height - 1) / COMP_ROWS + 1;
    g.across = across;
    g.strips = across * down;
    g.inverse = width > 1 ? UINT64_MAX / width + 1 : 0;
    for (;;) {
        g.blocks_across = ((across - 1) >> g.shift_x) + 1;
        const uint64_t blocks = (uint64_t)g.blocks_across * (((down - 1) >> g.shift_y) + 1);
        g.blocks = (uint32_t)blocks;
        if (blocks <= COMP_MOST_BLOCKS) return g;
        if (g.shift_x <= g.shift_y)
            g.shift_x++;
        else
            g.shift_y++;
    }
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

/* How many blocks each rank owns that owns any, in a table by the rank's hash. */
typedef struct ownership {
    int rank;
    uint32_t blocks;
} ownership;

enum { SLOTS = 2 * COMP_MOST_BLOCKS };

static ownership *find_ownership(ownership *all, int rank)
{
    uint32_t slot = hash((uint32_t)rank + 1) % SLOTS;
    while (all[slot].rank >= 0 && all[slot].rank != rank) slot = (slot + 1) % SLOTS;
    all[slot].rank = rank;
    return &all[slot];
}

/* Returns how many blocks the busiest rank need own. */
static uint32_t find_share(const int32_t *votes, uint32_t blocks, ownership *all)
{
    uint32_t owners = 0, owned = 0;
    for (int i = 0; i < SLOTS; i++) all[i] = (ownership){-1, 0};
    for (uint32_t b = 0; b < blocks; b++) {
        if (!votes[b]) continue;
        ownership *own = find_ownership(all, comp_vote_rank(votes[b]));
        owners += own->blocks++ == 0;
        owned++;
    }
    return owners ? (owned + owners - 1) / owners : 0;
}

void comp_votes_level(int32_t *votes, uint32_t blocks)
{
    ownership all[SLOTS];
    const uint32_t share = find_share(votes, blocks, all);
    int next = 0;
    for (uint32_t b = blocks; b-- > 0;) {
        ownership *own = votes[b] ? find_ownership(all, comp_vote_rank(votes[b])) : NULL;
        if (!own || own->blocks <= share) continue;
        while (all[next].rank < 0 || all[next].blocks >= share) next++;
        own->blocks--;
        all[next].blocks++;
        votes[b] = (int32_t)((uint32_t)votes[b] & ~0xfffffu) | all[next].rank;
    }
}
