/* Divides the picture into strips of 16 × 32 pixels, row by row, and groups strips into blocks. A strip is the unit of
 * packing and merging; a block is the unit of ownership. If there are many ranks, strips have fewer rows, so that there
 * are enough blocks to share the picture evenly. The functions are plain arithmetic without MPI or allocation. */
#ifndef COMP_COMP_GRID_H
#define COMP_COMP_GRID_H

#include <stdint.h>

enum {
    COMP_LANES = 16,
    COMP_ROWS = 32, /* maximum number of rows of a strip */
    COMP_STRIP_PIXELS = COMP_LANES * COMP_ROWS,
    COMP_TARGET_BLOCKS = 2048,    /* target number of blocks; few enough that a message with the claims to all blocks
                                     is small */
    COMP_BLOCKS_PER_RANK = 60,    /* minimum number of blocks, divided by the number of ranks */
    COMP_COUNTED_RANKS_MAX = 1024 /* the number of blocks grows with the number of ranks up to this number of ranks */
};

typedef struct comp_grid {
    uint32_t width, height;
    uint32_t row_shift;              /* a strip has 2^row_shift rows of pixels */
    uint32_t strips_per_row, strips; /* number of strips per row of strips, and in total */
    uint32_t shift_x, shift_y;       /* a block has 2^shift_x × 2^shift_y strips */
    uint32_t blocks_across, blocks;
    /* 2^64 / width, rounded up; 0 for width 1. The high 64 bits of inverse * pixel are pixel / width */
    uint64_t inverse;
    int threads;
} comp_grid;

/* Returns the grid of a picture for this number of ranks. width × height must be at least 1 and at most UINT32_MAX. The
 * grid's number of threads is set to 1. */
comp_grid comp_make_grid(uint32_t width, uint32_t height, int ranks);

/* Returns the maximum number of blocks of a picture for this number of ranks. */
static inline uint32_t comp_max_blocks(int ranks)
{
    const uint32_t few = COMP_TARGET_BLOCKS,
                   counted = (uint32_t)(ranks < COMP_COUNTED_RANKS_MAX ? ranks : COMP_COUNTED_RANKS_MAX);
    return 2 * counted * COMP_BLOCKS_PER_RANK > few ? 2 * counted * COMP_BLOCKS_PER_RANK : few;
}

/* Returns the number of pixels of a block that lies entirely in the picture. */
static inline uint32_t comp_grid_block_pixels(const comp_grid *grid)
{
    return (uint32_t)COMP_LANES << (grid->shift_x + grid->shift_y + grid->row_shift);
}

static inline uint32_t comp_find_block_of_strip(const comp_grid *grid, uint32_t strip)
{
    if (grid->blocks == grid->strips) return strip;
    const uint32_t y = strip / grid->strips_per_row, x = strip - y * grid->strips_per_row;
    return (y >> grid->shift_y) * grid->blocks_across + (x >> grid->shift_x);
}

static inline uint32_t comp_find_row_of_pixel(const comp_grid *grid, uint32_t pixel)
{
    return grid->inverse ? (uint32_t)((unsigned __int128)pixel * grid->inverse >> 64) : pixel;
}

static inline uint32_t comp_find_strip_of_pixel(const comp_grid *grid, uint32_t pixel)
{
    const uint32_t y = comp_find_row_of_pixel(grid, pixel), x = pixel - y * grid->width;
    return (y >> grid->row_shift) * grid->strips_per_row + x / COMP_LANES;
}

/* Returns the pixel's index in its strip; pixels of a strip are numbered row by row. */
static inline uint32_t comp_grid_index_in_strip(const comp_grid *grid, uint32_t pixel)
{
    const uint32_t y = comp_find_row_of_pixel(grid, pixel), x = pixel - y * grid->width;
    return (y & ((1u << grid->row_shift) - 1)) * COMP_LANES + x % COMP_LANES;
}

/* The rectangle of the picture that a strip covers, in pixels. */
typedef struct comp_area {
    uint32_t x, y, width, height;
} comp_area;

static inline comp_area comp_find_strip_area(const comp_grid *grid, uint32_t strip)
{
    const uint32_t x = strip % grid->strips_per_row * COMP_LANES, y = strip / grid->strips_per_row << grid->row_shift;
    const uint32_t right = grid->width - x, below = grid->height - y, rows = 1u << grid->row_shift;
    return (comp_area){x, y, right < COMP_LANES ? right : COMP_LANES, below < rows ? below : rows};
}

/* Returns the pixel of the picture that has this index in the strip. */
static inline uint32_t comp_find_pixel_of_strip(const comp_grid *grid, uint32_t strip, uint32_t index_in_strip)
{
    const uint32_t x = strip % grid->strips_per_row * COMP_LANES, y = strip / grid->strips_per_row << grid->row_shift;
    return (y + index_in_strip / COMP_LANES) * grid->width + x + index_in_strip % COMP_LANES;
}

/* ---- owners of blocks ------------------------------------------------------------------------------------------- */

/* A rank's claim to own a block. Claims of several ranks are combined by comp_claim_add(): the combined claim has the
 * largest of their priorities, which contains the rank that will be the owner, and the sum of their numbers of
 * fragments. */
typedef struct comp_claim {
    int32_t priority;   /* the rank with the largest priority is the owner; 0: the block has no fragments */
    uint32_t fragments; /* number of fragments in the block, at most UINT32_MAX */
} comp_claim;

/* Returns a rank's priority to own a block in which it has this number of fragments. */
int32_t comp_claim_priority(uint32_t block, int rank, int64_t fragments);

/* Returns the rank that is encoded in the priority. */
static inline int comp_priority_rank(int32_t priority)
{
    return priority & 0xfffff;
}

/* Returns the priority with the rank that is encoded in it replaced by `rank`. */
static inline int32_t comp_priority_with_rank(int32_t priority, int rank)
{
    return (int32_t)(((uint32_t)priority & ~0xfffffu) | ((uint32_t)rank & 0xfffff));
}

/* Adds a claim to *sum, the combined claim of other ranks. */
static inline void comp_claim_add(const comp_claim *claim, comp_claim *sum)
{
    const uint32_t fragments = sum->fragments + claim->fragments;
    sum->fragments = fragments < claim->fragments ? UINT32_MAX : fragments;
    sum->priority = sum->priority > claim->priority ? sum->priority : claim->priority;
}

/* Balances the number of fragments per owner: moves blocks from ranks with more than the mean to other owners of
 * blocks, until no rank exceeds the mean by more than the number of fragments in the block with most fragments. The
 * claims must be the combined claims of all ranks, which are the same on every rank; the changed claims are then also
 * the same on every rank. loads has one entry per rank and receives the number of fragments that the rank owns. A rank
 * without blocks does not receive any: if one rank has nearly all fragments, it keeps them, so that most of them need
 * not be sent. */
void comp_claims_balance(comp_claim *claims, uint32_t blocks, uint64_t *loads, int ranks);

#endif
