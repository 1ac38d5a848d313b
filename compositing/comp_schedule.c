/* Runs keep the pixels of one packet of rays on one owner: 64 pixels are a few packets wide. Where a rank would have
 * fewer than a thousand runs they shrink, so that the visible part of the image is shared evenly: a rank's share is the
 * number of its runs there.
 *
 * Rounds are turned because a rank would otherwise own columns of the picture where the width is a multiple of a round,
 * or a round of the width, and an object in the middle would fall to a few ranks. */
#include "comp_schedule.h"

#include "comp.h"

enum { longest_run_shift = 6, least_runs = 1024 };

comp_layout comp_layout_of(uint32_t pixel_count, int ranks)
{
    comp_layout layout = {pixel_count, (uint32_t)ranks, longest_run_shift, 0, 1};
    if (ranks > 1) layout.inverse = UINT64_MAX / layout.ranks + 1;
    while (layout.run_shift > 0 && pixel_count >> layout.run_shift < (uint64_t)layout.ranks * least_runs)
        layout.run_shift--;
    return layout;
}

uint32_t comp_layout_owned(const comp_layout *layout, int rank)
{
    const uint32_t run = 1u << layout->run_shift, ranks = layout->ranks;
    const uint32_t runs = (uint32_t)(((uint64_t)layout->pixel_count + run - 1) >> layout->run_shift);
    const uint32_t rounds = runs / ranks, left = runs % ranks;
    /* The rank's run in the last round, if that were whole. */
    const uint32_t own = ((uint32_t)rank + ranks - comp_layout_turn(layout, rounds)) % ranks;
    const uint64_t pixels = ((uint64_t)rounds + (own < left)) * run;
    const bool has_last = runs && comp_layout_owner(layout, layout->pixel_count - 1) == (uint32_t)rank;
    return (uint32_t)(pixels - (has_last ? (uint64_t)runs * run - layout->pixel_count : 0));
}

int comp_owner(uint32_t pixel, uint32_t pixel_count, int ranks)
{
    const comp_layout layout = comp_layout_of(pixel_count, ranks);
    return (int)comp_layout_owner(&layout, pixel);
}
