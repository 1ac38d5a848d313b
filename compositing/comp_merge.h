/* The rule of merging (comp_merge.c), giving a pixel's stretches instead of its colour. */
#ifndef COMP_COMP_MERGE_H
#define COMP_COMP_MERGE_H

#include "fragment.h"

typedef void comp_stretch_taker(void *state, const fragment *stretch);

/* Hands over the stretches that comp_merge_pixel() blends over each other, front to back: for overlapping stretches
 * their mixtures between cuts, for samples of one place their sum, and nothing behind an opaque one. sorted are a
 * pixel's fragments as comp_merge_pixel() left them; they are left so again. Local. */
void comp_merge_cut(fragment *sorted, int64_t count, comp_stretch_taker *take, void *state);

/* The same for comp_merge_folded_pixel(), which blends one fragment for each folded stretch. */
void comp_merge_folded_cut(const fragment *sorted, int64_t count, comp_stretch_taker *take, void *state);

#endif
