/* Finds the cells whose isosurfaces or volume may be visible, and bins them by tile of the picture
 * (kernel_candidates.h). */
#ifndef RENDER_RENDER_CANDIDATES_H
#define RENDER_RENDER_CANDIDATES_H

#include "kernel_types.h"

/* Returns whether tiles should traverse the trees themselves: whether all surfaces are opaque and their cells are so
 * small that there are several per pixel. */
bool render_surfaces_are_small(const kernel_frame *frame);

/* Finds the candidates of all surfaces and stores them in frame->candidates, which render_candidates_free() frees.
 * thread_of: one state per thread. If too many cells are visible, or memory runs out, frame->candidates stays NULL, and
 * tiles traverse the trees themselves. */
void render_candidates_find(kernel_frame *frame, kernel_thread *thread_of, int threads);
/* Finds the candidates of the frame's only volume and stores them in frame->volume_candidates. If the cells are too
 * small or too many, or memory runs out, frame->volume_candidates stays NULL, and tiles traverse the tree
 * themselves. */
void render_candidates_find_volume(kernel_frame *frame, kernel_thread *thread_of, int threads);
/* Collects the candidates of the tile whose upper left pixel is (x0, y0) from the bins of all threads: those of
 * surfaces in thread->bin, those of the volume in thread->volume_bin. Returns false if there is no memory. */
bool render_candidates_gather(const kernel_frame *frame, kernel_thread *thread, int x0, int y0);
/* Sets frame->cover to a rectangle of pixels outside which no tree's bounding box is visible. */
void render_compute_tree_cover(kernel_frame *frame);
void render_candidates_free(kernel_frame *frame);

#endif
