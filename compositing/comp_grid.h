/* The picture in strips of 16 × 32 pixels, row by row, and in blocks of strips. A strip is what is packed and merged at
 * once; of a block one rank owns all. Plain arithmetic without MPI and memory. */
#ifndef COMP_COMP_GRID_H
#define COMP_COMP_GRID_H

#include <stdint.h>

enum {
    COMP_LANES = 16,
    COMP_ROWS = 32,
    COMP_STRIP_PIXELS = COMP_LANES * COMP_ROWS,
    COMP_MOST_BLOCKS = 2048 /* so that votes for all of them are a small message, whatever the picture */
};

typedef struct comp_grid {
    uint32_t width, height;
    uint32_t across, strips;   /* strips beside each other, and all */
    uint32_t shift_x, shift_y; /* a block is 2^shift_x × 2^shift_y strips */
    uint32_t blocks_across, blocks;
    uint64_t inverse; /* 2^64 / width, rounded up, 0 for width 1: the high word of its product with a pixel is
                         that divided by width */
    int threads;
} comp_grid;

/* width × height is at least 1 and at most UINT32_MAX. threads become 1. */
comp_grid comp_grid_of(uint32_t width, uint32_t height);

static inline uint32_t comp_grid_block(const comp_grid *grid, uint32_t strip)
{
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
    return y / COMP_ROWS * grid->across + x / COMP_LANES;
}

/* The pixel's number in its strip, row by row. */
static inline uint32_t comp_grid_at(const comp_grid *grid, uint32_t pixel)
{
    const uint32_t y = comp_grid_y(grid, pixel), x = pixel - y * grid->width;
    return y % COMP_ROWS * COMP_LANES + x % COMP_LANES;
}

/* The strip's part of the picture. */
typedef struct comp_area {
    uint32_t x, y, width, height;
} comp_area;

static inline comp_area comp_grid_area(const comp_grid *grid, uint32_t strip)
{
    const uint32_t x = strip % grid->across * COMP_LANES, y = strip / grid->across * COMP_ROWS;
    const uint32_t right = grid->width - x, below = grid->height - y;
    return (comp_area){x, y, right < COMP_LANES ? right : COMP_LANES, below < COMP_ROWS ? below : COMP_ROWS};
}

/* The pixel of the picture that has this number in the strip. */
static inline uint32_t comp_grid_pixel(const comp_grid *grid, uint32_t strip, uint32_t at)
{
    const uint32_t x = strip % grid->across * COMP_LANES, y = strip / grid->across * COMP_ROWS;
    return (y + at / COMP_LANES) * grid->width + x + at % COMP_LANES;
}

/* ---- who owns a block ---------------------------------------------------------------------------------------- */

/* A rank's vote to own a block in which it has so many fragments; the owner is the rank of the greatest vote. 0: it has
 * no fragments. */
int32_t comp_vote(uint32_t block, int rank, int64_t fragments);

/* The rank whose vote it is. */
static inline int comp_vote_rank(int32_t vote)
{
    return vote & 0xfffff;
}

/* Moves blocks from ranks that own more than their share to others that own any, until none has more than its share.
 * votes are the greatest of each block, 0 where nobody has fragments; the same on all ranks, before and after. Ranks that
 * own nothing stay so: where one has nearly all fragments, most need not travel. */
void comp_votes_level(int32_t *votes, uint32_t blocks);

#endif
