/* Why runs, and why this long: a run keeps the pixels that one packet of rays made on one owner, so that messages
 * stay few, and going round keeps an object in the middle of the image from falling to a few ranks. 64 pixels are
 * some packets wide. With more ranks than runs of 64 the runs shrink, so that no rank idles while another owns two. */
#include "comp_schedule.h"

#include "comp.h"

enum { longest_run_shift = 6 };

comp_layout comp_layout_of(uint32_t pixel_count, int ranks)
{
    comp_layout layout = {pixel_count, (uint32_t)ranks, longest_run_shift, 1};
    while (layout.run_shift > 0 && pixel_count >> layout.run_shift < layout.ranks) layout.run_shift--;
    return layout;
}

uint32_t comp_layout_owned(const comp_layout *layout, int rank)
{
    const uint64_t run = (uint64_t)1 << layout->run_shift;
    const uint64_t runs = (layout->pixel_count + run - 1) >> layout->run_shift;
    if ((uint64_t)rank >= runs) return 0;
    const uint64_t own_runs = (runs - 1 - (uint64_t)rank) / layout->ranks + 1;
    const uint64_t missing = (runs - 1) % layout->ranks == (uint64_t)rank ? runs * run - layout->pixel_count : 0;
    return (uint32_t)(own_runs * run - missing);
}

int comp_owner(uint32_t pixel, uint32_t pixel_count, int ranks)
{
    const comp_layout layout = comp_layout_of(pixel_count, ranks);
    return (int)comp_layout_owner(&layout, pixel);
}
