/* Transfer functions cut into the pieces that segments are integrated by. */
#ifndef RENDER_RENDER_PIECES_H
#define RENDER_RENDER_PIECES_H

#include "error.h"
#include "insitu/status.h"
#include "kernel_types.h"
#include "render.h"

/* Colours may be off the table's by tolerance where that saves pieces; 0 means by rounding alone. The caller frees it
 * with render_pieces_free(). */
insitu_status render_pieces_build(kernel_pieces *out, const render_transfer *t, double tolerance, base_error *error);
/* Adds what segments of hexes, wedges and pyramids in lanes are cut by (kernel_local_segments.h). */
insitu_status render_swings_build(kernel_pieces *pieces, const render_transfer *t, base_error *error);
/* Sums for an error of max_error in the light of a ray that goes no farther than reach in the cells, in unit distances.
 */
insitu_status render_preintegral_build(kernel_pieces *pieces, const render_transfer *t, double max_error, double reach,
                                       base_error *error);
void render_pieces_free(kernel_pieces *pieces);

#endif
