/* Transfer functions, cut into the pieces by which segments are integrated. */
#ifndef RENDER_RENDER_PIECES_H
#define RENDER_RENDER_PIECES_H

#include "error.h"
#include "insitu/status.h"
#include "kernel_types.h"
#include "render.h"

/* Builds the pieces. Colours may deviate from the table's by `tolerance` if that saves pieces; 0 allows only rounding.
 * The caller frees them with render_pieces_free(). */
insitu_status render_pieces_build(kernel_pieces *out, const render_transfer *t, double tolerance, base_error *error);
/* Adds the bounds by which segments of hexes, wedges and pyramids are cut in lanes (kernel_local_segments.h). */
insitu_status render_swings_build(kernel_pieces *pieces, const render_transfer *t, base_error *error);
/* Adds the sums for an error of max_error in the light of a ray whose length in the cells is at most `reach`, in unit
 * distances. */
insitu_status render_preintegral_build(kernel_pieces *pieces, const render_transfer *t, double max_error, double reach,
                                       base_error *error);
void render_pieces_free(kernel_pieces *pieces);

#endif
