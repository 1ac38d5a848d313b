/* Named colour maps as tables of linear RGB. */
#ifndef RENDER_COLOUR_MAP_H
#define RENDER_COLOUR_MAP_H

/* The table (colour_count × 3 floats, linear light, static) of "viridis", "inferno", "cool_to_warm" or "grey", or NULL.
 */
const float *colour_map_table(const char *name, int *colour_count);

/* One sRGB component in [0, 1] to linear light, and back. */
float colour_linear_from_srgb(float srgb);
float colour_srgb_from_linear(float linear);

#endif
