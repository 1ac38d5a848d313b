/* The cells whose isosurfaces or volume may show, binned by tile of the picture (kernel_candidates.h). */
#ifndef RENDER_RENDER_CANDIDATES_H
#define RENDER_RENDER_CANDIDATES_H

#include "kernel_types.h"

/* Are there so many of the surfaces' cells a pixel that tiles had better go down the trees themselves? */
bool render_surfaces_are_small(const kernel_frame *frame);

/* Fills frame->candidates, which render_candidates_free() frees; thread_of has a state for each thread. It stays NULL,
 * and tiles go down the trees themselves, where more cells show than pay or memory runs out. */
void render_candidates_find(kernel_frame *frame, kernel_thread *thread_of, int threads);
/* As above, for the only volume's cells: fills frame->volume_candidates. */
void render_candidates_find_volume(kernel_frame *frame, kernel_thread *thread_of, int threads);
/* Gathers the cells of the tile whose upper left pixel is (x0, y0) in thread->bin and volume_bin, for the kernels.
 * False: no memory. */
bool render_candidates_gather(const kernel_frame *frame, kernel_thread *thread, int x0, int y0);
/* Sets frame->cover, from the bounds of all trees. */
void render_trees_cover(kernel_frame *frame);
void render_candidates_free(kernel_frame *frame);

#endif
