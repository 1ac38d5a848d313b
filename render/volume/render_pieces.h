/* Divides transfer functions into pieces, by which segments are integrated (kernel_integral.h): ranges of values on
 * which opacity and colour are linear. */
#ifndef RENDER_RENDER_PIECES_H
#define RENDER_RENDER_PIECES_H

#include "error.h"
#include "insitu/status.h"
#include "kernel_types.h"
#include "render.h"

/* Computes the pieces of a transfer function. Colours may deviate from those of the table by `tolerance` if that saves
 * pieces; at 0 they deviate only by rounding. The caller must free the pieces with render_pieces_free(). */
insitu_status render_pieces_build(kernel_pieces *out, const render_transfer *t, double tolerance, base_error *error);
/* Adds the table of bounds of the effect of field errors on light (kernel_pieces.variations). From these bounds it is
 * computed into how many segments a ray's interval in a hex, wedge or pyramid is divided (kernel_local_budget.h), and
 * into how many parts a segment that compositing mixes with other volumes (kernel_segment_list.h). */
insitu_status render_variations_build(kernel_pieces *pieces, const render_transfer *t, base_error *error);
/* Adds the table of integrals over the values (kernel_preintegral.h). max_error: error allowed in the light of a ray
 * whose length in the cells is at most `reach` unit distances. */
insitu_status render_preintegral_build(kernel_pieces *pieces, const render_transfer *t, double max_error, double reach,
                                       base_error *error);
void render_pieces_free(kernel_pieces *pieces);

#endif
