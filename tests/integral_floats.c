/* Computes the integral in float with the scalar kernels. */
#include <stdlib.h>

#include "integral_double.h"
#include "kernel_integral.h"
#include "kernel_types.h"
#include "render_pieces.h"

void integrate_in_float(const render_transfer *t, double length, double v_in, double v_out, double out[4])
{
    kernel_pieces pieces;
    base_error error = {0};
    if (render_pieces_build(&pieces, t, 0, &error) != INSITU_OK) abort();
    kernel_light light = kernel_light_none();
    const kernel_unit_segment run =
        kernel_unit_segment_of(vf_set((float)length), vf_set((float)v_in), vf_set((float)v_out));
    kernel_integrate_segments(&pieces, vm_all_lanes(), &run, &light);
    for (int c = 0; c < 3; c++) out[c] = (double)light.colour[c][0];
    out[3] = (double)light.transmittance[0];
    render_pieces_free(&pieces);
}

void integral_compute_variations(const render_transfer *t, int count, const double (*ranges)[2], double (*out)[4])
{
    kernel_pieces pieces;
    base_error error = {0};
    if (render_pieces_build(&pieces, t, 0, &error) != INSITU_OK) abort();
    if (render_variations_build(&pieces, t, &error) != INSITU_OK) abort();
    for (int i = 0; i < count; i++) {
        const vf low = vf_set((float)ranges[i][0]), high = vf_set((float)ranges[i][1]);
        vf found[KERNEL_LIGHT_ENTRIES];
        kernel_look_up_light_error_bounds(&pieces, low, high, found);
        for (int n = 0; n < KERNEL_LIGHT_ENTRIES; n++) out[i][n] = (double)found[n][0];
    }
    render_pieces_free(&pieces);
}
