/* Ways between two colours, and tables of colours that go from point to point. */
#ifndef RENDER_COLOUR_SPACE_H
#define RENDER_COLOUR_SPACE_H

#include <stdbool.h>

/* In what colours are mixed: sRGB; hue, saturation and value (of sRGB, hues not across 0); CIELAB (D65); or Moreland's
 * Msh, the polar form of CIELAB, in which the way between two saturated colours of different hues leads through a
 * neutral one that is lighter than both. COLOUR_STEP: not mixed, that of the
 * point behind. */
typedef enum colour_space { COLOUR_RGB, COLOUR_HSV, COLOUR_LAB, COLOUR_DIVERGING, COLOUR_STEP } colour_space;

/* The colour at `share` of the way from a to b, both sRGB in [0, 1], in linear light, in [0, 1]. */
void colour_between(colour_space space, const double a[3], const double b[3], double share, float linear[3]);

/* Turns one sRGB component into linear light, in double. */
double colour_linear_of(double srgb);

typedef struct colour_point {
    double at;      /* never falling */
    double srgb[3]; /* in [0, 1] */
} colour_point;

/* Returns how many entries an even table through the points (2 or more) should have: 256 or a few more where points are
 * even, so that each is an entry; else 1025, between two of which a step of two points at one place is drawn out. */
int colour_points_entries(const colour_point *points, int count);
/* Fills the table (entries × 3, linear light), from the first point to the last. */
void colour_points_fill(const colour_point *points, int count, colour_space space, float *table, int entries);

#endif
