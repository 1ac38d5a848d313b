/* Divides transfer functions into the pieces by which segments are integrated. */
#ifndef RENDER_RENDER_PIECES_H
#define RENDER_RENDER_PIECES_H

#include "error.h"
#include "insitu/status.h"
#include "kernel_types.h"
#include "render.h"

/* Builds the pieces. Colours may deviate from the table's by `tolerance` if that saves pieces; at 0 they deviate only
 * by rounding. The caller must free the pieces with render_pieces_free(). */
insitu_status render_pieces_build(kernel_pieces *out, const render_transfer *t, double tolerance, base_error *error);
/* Adds the bounds that decide how intervals in hexes, wedges and pyramids, and segments that are mixed with other
 * volumes, are divided (kernel_local_budget.h, kernel_segment_list.h). */
insitu_status render_variations_build(kernel_pieces *pieces, const render_transfer *t, base_error *error);
/* Adds the table of sums for preintegration. max_error: error allowed in the light of a ray whose length in the cells
 * is at most `reach` unit distances. */
insitu_status render_preintegral_build(kernel_pieces *pieces, const render_transfer *t, double max_error, double reach,
                                       base_error *error);
void render_pieces_free(kernel_pieces *pieces);

#endif
