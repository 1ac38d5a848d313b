/* The cells whose isosurfaces or volume may show, binned by tile of the picture (kernel_shown.h). */
#ifndef RENDER_RENDER_SHOWN_H
#define RENDER_RENDER_SHOWN_H

#include "kernel_types.h"

/* Fill frame->shown, which render_shown_free() frees; thread_of is one state a thread. Where more cells show than pay it
 * stays NULL, and tiles go down the trees themselves. That is no way out where memory runs out, of which false tells:
 * cells are met in another order there, and a volume's picture may differ within max_error. */
bool render_shown_find(kernel_frame *frame, kernel_thread *thread_of, int threads);
/* The same of the only volume's cells, as frame->volume_shown. */
bool render_shown_find_volume(kernel_frame *frame, kernel_thread *thread_of, int threads);
void render_shown_free(kernel_frame *frame);

#endif
