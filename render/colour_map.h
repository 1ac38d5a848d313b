/* Provides the built-in colour maps by name. */
#ifndef RENDER_COLOUR_MAP_H
#define RENDER_COLOUR_MAP_H

/* Lists every built-in colour map: X(suffix of its constant COLOUR_MAP_..., name in scenes). */
#define COLOUR_MAPS(X)                                                                                                 \
    X(VIRIDIS, "viridis")                                                                                              \
    X(PLASMA, "plasma")                                                                                                \
    X(INFERNO, "inferno")                                                                                              \
    X(MAGMA, "magma")                                                                                                  \
    X(CIVIDIS, "cividis")                                                                                              \
    X(TURBO, "turbo")                                                                                                  \
    X(BATLOW, "batlow")                                                                                                \
    X(GREY, "grey")                                                                                                    \
    X(GREYS, "greys")                                                                                                  \
    X(BLUES, "blues")                                                                                                  \
    X(GREENS, "greens")                                                                                                \
    X(ORANGES, "oranges")                                                                                              \
    X(PURPLES, "purples")                                                                                              \
    X(REDS, "reds")                                                                                                    \
    X(YELLOW_GREEN_BLUE, "yellow_green_blue")                                                                          \
    X(YELLOW_ORANGE_RED, "yellow_orange_red")                                                                          \
    X(COOL_TO_WARM, "cool_to_warm")                                                                                    \
    X(RED_BLUE, "red_blue")                                                                                            \
    X(RED_YELLOW_BLUE, "red_yellow_blue")                                                                              \
    X(RED_YELLOW_GREEN, "red_yellow_green")                                                                            \
    X(SPECTRAL, "spectral")                                                                                            \
    X(BROWN_TEAL, "brown_teal")                                                                                        \
    X(ORANGE_PURPLE, "orange_purple")                                                                                  \
    X(PURPLE_GREEN, "purple_green")

#define COLOUR_MAP_CONSTANT(word, name) COLOUR_MAP_##word,
typedef enum colour_map { COLOUR_MAPS(COLOUR_MAP_CONSTANT) COLOUR_MAP_COUNT } colour_map;

/* Returns the table of the colour map, which must not be freed, or NULL if there is no map of this name. The table has
 * *colour_count entries, evenly spaced, of 3 floats: red, green and blue in linear light. */
const float *colour_map_table(const char *name, int *colour_count);

/* Converts one sRGB component in [0, 1] to linear light. */
float colour_linear_from_srgb(float srgb);

#endif
