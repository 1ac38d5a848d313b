/* The picture in strips of 16 × 32 pixels, row by row, and in blocks of strips. A strip is what is packed and merged at
 * once; of a block one rank owns all. Many ranks need many blocks to share a picture evenly: for them strips have fewer
 * rows. Plain arithmetic without MPI and memory. */
#ifndef COMP_COMP_GRID_H
#define COMP_COMP_GRID_H

#include <stdint.h>

enum {
    COMP_LANES = 16,
    COMP_ROWS = 32, /* most rows of a strip */
    COMP_STRIP_PIXELS = COMP_LANES * COMP_ROWS,
    COMP_FEW_BLOCKS = 2048, /* so that claims to all of them are a small message, whatever the picture; unless */
    COMP_RANK_BLOCKS = 60,  /* a rank has fewer than these, on average, */
    COMP_EVEN_RANKS = 1024  /* more ranks than this do not get more blocks */
};

typedef struct comp_grid {
    uint32_t width, height;
    uint32_t row_shift;        /* a strip has 2^row_shift rows */
    uint32_t across, strips;   /* strips beside each other, and all */
    uint32_t shift_x, shift_y; /* a block is 2^shift_x × 2^shift_y strips */
    uint32_t blocks_across, blocks;
    uint64_t inverse; /* 2^64 / width, rounded up, 0 for width 1: the high word of its product with a pixel is
                         that divided by width */
    int threads;
} comp_grid;

/* The grid of a picture that so many ranks share. width × height is at least 1 and at most UINT32_MAX. threads become
 * 1. */
comp_grid comp_grid_of(uint32_t width, uint32_t height, int ranks);

/* The most blocks that a picture has for so many ranks. */
static inline uint32_t comp_most_blocks(int ranks)
{
    const uint32_t few = COMP_FEW_BLOCKS, counted = (uint32_t)(ranks < COMP_EVEN_RANKS ? ranks : COMP_EVEN_RANKS);
    return 2 * counted * COMP_RANK_BLOCKS > few ? 2 * counted * COMP_RANK_BLOCKS : few;
}

/* The pixels of a block that is not cut by the picture's border. */
static inline uint32_t comp_grid_block_pixels(const comp_grid *grid)
{
    return (uint32_t)COMP_LANES << (grid->shift_x + grid->shift_y + grid->row_shift);
}

static inline uint32_t comp_grid_block(const comp_grid *grid, uint32_t strip)
{
    if (grid->blocks == grid->strips) return strip;
    const uint32_t y = strip / grid->across, x = strip - y * grid->across;
    return (y >> grid->shift_y) * grid->blocks_across + (x >> grid->shift_x);
}

static inline uint32_t comp_grid_y(const comp_grid *grid, uint32_t pixel)
{
    return grid->inverse ? (uint32_t)((unsigned __int128)pixel * grid->inverse >> 64) : pixel;
}

static inline uint32_t comp_grid_strip(const comp_grid *grid, uint32_t pixel)
{
    const uint32_t y = comp_grid_y(grid, pixel), x = pixel - y * grid->width;
    return (y >> grid->row_shift) * grid->across + x / COMP_LANES;
}

/* The pixel's number in its strip, row by row. */
static inline uint32_t comp_grid_at(const comp_grid *grid, uint32_t pixel)
{
    const uint32_t y = comp_grid_y(grid, pixel), x = pixel - y * grid->width;
    return (y & ((1u << grid->row_shift) - 1)) * COMP_LANES + x % COMP_LANES;
}

/* The strip's part of the picture. */
typedef struct comp_area {
    uint32_t x, y, width, height;
} comp_area;

static inline comp_area comp_grid_area(const comp_grid *grid, uint32_t strip)
{
    const uint32_t x = strip % grid->across * COMP_LANES, y = strip / grid->across << grid->row_shift;
    const uint32_t right = grid->width - x, below = grid->height - y, rows = 1u << grid->row_shift;
    return (comp_area){x, y, right < COMP_LANES ? right : COMP_LANES, below < rows ? below : rows};
}

/* The pixel of the picture that has this number in the strip. */
static inline uint32_t comp_grid_pixel(const comp_grid *grid, uint32_t strip, uint32_t at)
{
    const uint32_t x = strip % grid->across * COMP_LANES, y = strip / grid->across << grid->row_shift;
    return (y + at / COMP_LANES) * grid->width + x + at % COMP_LANES;
}

/* ---- who owns a block ---------------------------------------------------------------------------------------- */

/* What ranks claim of a block. The claim of all is the greatest vote, and the sum of the fragments. */
typedef struct comp_claim {
    int32_t vote;       /* the owner is the rank of the greatest; 0: it has no fragments */
    uint32_t fragments; /* UINT32_MAX: that many or more */
} comp_claim;

/* A rank's vote to own a block in which it has so many fragments. */
int32_t comp_vote(uint32_t block, int rank, int64_t fragments);

/* The rank whose vote it is. */
static inline int comp_vote_rank(int32_t vote)
{
    return vote & 0xfffff;
}

/* The same vote for another rank. */
static inline int32_t comp_vote_of(int32_t vote, int rank)
{
    return (int32_t)(((uint32_t)vote & ~0xfffffu) | ((uint32_t)rank & 0xfffff));
}

/* Makes a claim that of both. */
static inline void comp_claim_add(const comp_claim *claim, comp_claim *sum)
{
    const uint32_t fragments = sum->fragments + claim->fragments;
    sum->fragments = fragments < claim->fragments ? UINT32_MAX : fragments;
    sum->vote = sum->vote > claim->vote ? sum->vote : claim->vote;
}

/* Moves blocks from ranks that own more fragments than their share to others that own any, until none has more than the
 * mean of these ranks and those of one block, the fullest. claims are those of all ranks; the same on all ranks, before
 * and after. loads has room for each rank, and gets the fragments that it owns. Ranks that own nothing stay so: where
 * one has nearly all fragments, most need not travel. */
void comp_claims_level(comp_claim *claims, uint32_t blocks, uint64_t *loads, int ranks);

#endif
