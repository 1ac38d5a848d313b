/* A transfer function as pieces on which opacity and colour are linear (render_pieces.c), and bounds of its slopes. */
#ifndef RENDER_KERNEL_PIECES_H
#define RENDER_KERNEL_PIECES_H

#include "render.h"

/* KERNEL_BLACK: what is behind so little light is left out of a segment. KERNEL_SHORT: kernel_integral.h. */
#if defined(KERNEL_REAL_IS_DOUBLE)
typedef double kernel_real;
#define KERNEL_BLACK 1e-16
#define KERNEL_SHORT 1e-12
#else
typedef float kernel_real;
#define KERNEL_BLACK 1e-8f
#define KERNEL_SHORT 2e-6f
#endif

enum { KERNEL_PIECE_BINS = 256, KERNEL_BOUND_BINS = 64 };

/* Opacity and colour at a value x of the piece: entry[..] + (x - low) * slope. What opacity leaves, 1 - opacity, has
 * entries of its own: near an opacity of 1 the difference would be all rounding. Where a function is constant to either
 * side, the pieces' ends are at -+2^100, so that INVERSE times the width is 1. */
enum {
    KERNEL_PIECE_LOW,
    KERNEL_PIECE_HIGH,
    KERNEL_PIECE_LOW_REST, /* what the ends lost to their rounding: 0 unless has_rests */
    KERNEL_PIECE_HIGH_REST,
    KERNEL_PIECE_OPACITY,
    KERNEL_PIECE_OPACITY_HIGH, /* at the upper end */
    KERNEL_PIECE_CLEAR,        /* 1 - opacity */
    KERNEL_PIECE_CLEAR_HIGH,
    KERNEL_PIECE_INVERSE, /* 1 / (high - low) */
    KERNEL_PIECE_SLOPE,   /* of the opacity */
    KERNEL_PIECE_COLOUR,
    KERNEL_PIECE_COLOUR_SLOPE = KERNEL_PIECE_COLOUR + 3,
    KERNEL_PIECE_ENTRIES = KERNEL_PIECE_COLOUR_SLOPE + 3
};

typedef struct kernel_piece {
    kernel_real entry[KERNEL_PIECE_ENTRIES];
} kernel_piece;

/* Over a stretch of values: how the function may change in it, between steps. Extinctions are per unit distance, slopes
 * per domain. */
typedef struct kernel_bound {
    float extinction_low, extinction_high, extinction_slope, colour_slope;
} kernel_bound;

/* Where the opacity steps: at, and the end of pieces there, which is at rounded. */
typedef struct kernel_step {
    double at;
    float cut;
} kernel_step;

/* Values between which the opacity rises or falls nearly as at a step; is_narrow: one that has_rests is for. */
typedef struct kernel_steep {
    float low, high;
    bool is_narrow;
} kernel_steep;

/* A bin of the sums (kernel_preintegral.h), in units; read as ten floats. */
typedef struct kernel_pre_entry {
    struct {
        int32_t before; /* of all bins before it */
        float own;
    } sums[4];      /* the extinction's, and those of the emission in three channels */
    int32_t colour; /* at its middle, 10 bits a channel */
    float rough;    /* by how much extinction and emission vary in it, as light */
} kernel_pre_entry;

typedef struct kernel_preintegral {
    int bin_count;             /* of equal width; an entry before them and one behind are endless */
    kernel_pre_entry *entries; /* bin_count + 2 */
    float low, inverse;        /* the bins' begin, and 1 / their width */
    float depth_unit, light_unit;
    float colour_unit, colour_error;
    float bend_square, bend, bend_at_ends, contrast;
    float allowed_absorbed, allowed_length;
} kernel_preintegral;

typedef struct kernel_pieces {
    int count;
    kernel_piece *pieces; /* by value; the first and the last are endless */
    /* Bins of equal width from bin_low, to find a value's piece by: the piece at the bin's begin, as a number. */
    kernel_real bin_low, bin_inverse;
    kernel_real bin_first[KERNEL_PIECE_BINS];
    /* The bounds' bins begin at bin_low too; below and above the bins the function is constant. */
    float bound_inverse;
    kernel_bound bounds[KERNEL_BOUND_BINS];
    /* There is a ramp so narrow that its ends' rounding shows: they have rests, and values near it are to have them. */
    bool has_rests;
    int step_count, steep_count;
    kernel_step steps[RENDER_MAX_OPACITY_POINTS]; /* by value */
    kernel_steep steep[RENDER_MAX_OPACITY_POINTS];
    float contrast;                  /* no two colours differ by more, in any channel; black and white counted */
    kernel_preintegral *preintegral; /* NULL: no error is allowed */
} kernel_pieces;

#endif
