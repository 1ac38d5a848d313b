/* Interpolates between two colours, and fills tables of colours through given points. */
#ifndef RENDER_COLOUR_SPACE_H
#define RENDER_COLOUR_SPACE_H

#include <stdbool.h>

/* The space in which colours are interpolated: sRGB; hue, saturation and value of sRGB (the hue's path does not cross
 * 0); CIELAB (D65); or Moreland's Msh, the polar form of CIELAB, in which the path between two saturated colours of
 * different hues leads through a neutral colour that is lighter than both. COLOUR_STEP: not interpolated; the colour
 * between two points is that of the second point. */
typedef enum colour_space { COLOUR_RGB, COLOUR_HSV, COLOUR_LAB, COLOUR_DIVERGING, COLOUR_STEP } colour_space;

/* Interpolates between the sRGB colours a and b (components in [0, 1]). share: weight of b, from 0 to 1. The result is
 * linear light in [0, 1]. */
void colour_between(colour_space space, const double a[3], const double b[3], double share, float linear[3]);

/* Converts one sRGB component to linear light, in double. */
double colour_linear_from_srgb_double(double srgb);

typedef struct colour_point {
    double at;      /* position of the colour; positions of a list increase or stay equal */
    double srgb[3]; /* sRGB components in [0, 1] */
} colour_point;

/* Returns how many entries an evenly spaced table through the points (2 or more) should have. If the points are evenly
 * spaced, it is 256 or a few more, so that each point is an entry. Otherwise it is 1025; a step, given by two points at
 * one position, is then spread over the distance between two entries. */
int colour_choose_table_size(const colour_point *points, int count);
/* Fills a table of `entries` evenly spaced colours (3 floats each, linear light) that are interpolated between the
 * points. Its first entry has the colour of the first point, its last entry that of the last point. */
void colour_fill_table(const colour_point *points, int count, colour_space space, float *table, int entries);

#endif
