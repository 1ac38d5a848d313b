/* The rule of merging (comp_merge.c), for those who want a pixel's stretches and not its colour. */
#ifndef COMP_COMP_MERGE_H
#define COMP_COMP_MERGE_H

#include "fragment.h"

typedef void comp_stretch_taker(void *state, const fragment *stretch);

/* Hands over what comp_merge_pixel() blends over each other, front to back: of stretches that overlap their mixtures
 * between cuts, of samples of one place what they are together. Nothing behind what is opaque. sorted: a pixel's
 * fragments as comp_merge_pixel() left them, and as they are left again. Local. */
void comp_merge_cut(fragment *sorted, int64_t count, comp_stretch_taker *take, void *state);

/* The same of fragments that comp_merge_folded_pixel() blends: a stretch each. */
void comp_merge_folded_cut(const fragment *sorted, int64_t count, comp_stretch_taker *take, void *state);

#endif
