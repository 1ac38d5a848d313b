/* Which rank owns a pixel, in plain arithmetic without MPI and memory, so that tests can try any number of ranks.
 *
 * Pixels are cut into runs of 2^run_shift consecutive ones, and runs go round the ranks: in each round every rank has
 * one, and rounds begin at different ranks. An owner counts its pixels from 0, run after run: the owned index. */
#ifndef COMP_COMP_SCHEDULE_H
#define COMP_COMP_SCHEDULE_H

#include <stdbool.h>
#include <stdint.h>

typedef struct comp_layout {
    uint32_t pixel_count;
    uint32_t ranks; /* >= 1 */
    uint32_t run_shift;
    uint64_t inverse; /* 2^64 / ranks, rounded up, 0 for one rank: the high word of its product with a 32-bit number is
                         that divided by ranks */
    int threads; /* that work on an owner's pixels; 1 from comp_layout_of() */
} comp_layout;

comp_layout comp_layout_of(uint32_t pixel_count, int ranks);

/* The round of a run. */
static inline uint32_t comp_layout_round(const comp_layout *layout, uint32_t run)
{
    return layout->inverse ? (uint32_t)((unsigned __int128)run * layout->inverse >> 64) : run;
}

/* The rank at which a round begins: multiples of the golden ratio, whose fractional parts are spread evenly (Knuth, The
 * Art of Computer Programming 3, 6.4). */
static inline uint32_t comp_layout_turn(const comp_layout *layout, uint32_t round)
{
    return (uint32_t)((uint64_t)(round * 2654435769u) * layout->ranks >> 32);
}

static inline uint32_t comp_layout_owner(const comp_layout *layout, uint32_t pixel)
{
    const uint32_t run = pixel >> layout->run_shift, round = comp_layout_round(layout, run);
    const uint64_t owner = (uint64_t)(run - round * layout->ranks) + comp_layout_turn(layout, round);
    return (uint32_t)(owner < layout->ranks ? owner : owner - layout->ranks);
}

/* The pixel's owned index on its owner: 0 .. comp_layout_owned(owner) - 1, rising with the pixel. */
static inline uint32_t comp_layout_index(const comp_layout *layout, uint32_t pixel)
{
    const uint32_t within = pixel & ((1u << layout->run_shift) - 1);
    return (comp_layout_round(layout, pixel >> layout->run_shift) << layout->run_shift) + within;
}

/* The owner's pixel with the owned index. */
static inline uint32_t comp_layout_pixel(const comp_layout *layout, uint32_t owner, uint32_t index)
{
    const uint32_t round = index >> layout->run_shift, turn = comp_layout_turn(layout, round);
    const uint32_t run = owner >= turn ? owner - turn : owner + layout->ranks - turn;
    return ((round * layout->ranks + run) << layout->run_shift) + (index & ((1u << layout->run_shift) - 1));
}

/* Counts the pixels that rank owns. */
uint32_t comp_layout_owned(const comp_layout *layout, int rank);

#endif
