/* The constants of a frame in the forms that inner loops use. render_prepare.c computes them once per frame, and the
 * kernels of every instruction set read them. Kernel headers contain only static inline code and these types. */
#ifndef RENDER_KERNEL_TYPES_H
#define RENDER_KERNEL_TYPES_H

#include <stddef.h>

#include "fragment.h"
#include "grid.h"
#include "render.h"

enum {
    KERNEL_TILE = 16,
    KERNEL_TILE_RUN = 4, /* number of tiles, row by row, that one thread draws in order */
    KERNEL_BLOCK = 4,    /* pixels along a block's side */
    KERNEL_MAX_GROUP = RENDER_MAX_GROUP,
    KERNEL_MAX_INTERVALS = RENDER_MAX_INTERVALS
};

/* A transfer function as pieces on which opacity and colour are linear (render_pieces.c), and bounds of its slopes. */

/* KERNEL_BLACK: light below which the rest of a segment is dropped. KERNEL_SHORT: kernel_integral.h. */
#if defined(KERNEL_REAL_IS_DOUBLE)
typedef double kernel_real;
#define KERNEL_BLACK 1e-16
#define KERNEL_SHORT 1e-12
#else
typedef float kernel_real;
#define KERNEL_BLACK 1e-8f
#define KERNEL_SHORT 2e-6f
#endif

enum { KERNEL_PIECE_BINS = 256, KERNEL_BOUND_BINS = 64, KERNEL_SWING_BINS = 128, KERNEL_SWING_WIDTHS = 29 };

/* Opacity and colour at a value x of the piece are entry[..] + (x - low) * slope. 1 - opacity has entries of its own:
 * near an opacity of 1 the difference would be only rounding. If a function is constant to either side, the outermost
 * pieces' ends are at -+2^100, so that INVERSE times the width is 1. */
enum {
    KERNEL_PIECE_LOW,
    KERNEL_PIECE_HIGH,
    KERNEL_PIECE_LOW_REST, /* rounding errors of the ends: 0 unless has_rests */
    KERNEL_PIECE_HIGH_REST,
    KERNEL_PIECE_OPACITY,
    KERNEL_PIECE_OPACITY_HIGH, /* opacity at the upper end */
    KERNEL_PIECE_CLEAR,        /* 1 - opacity */
    KERNEL_PIECE_CLEAR_HIGH,
    KERNEL_PIECE_INVERSE, /* 1 / (high - low) */
    KERNEL_PIECE_SLOPE,   /* slope of the opacity */
    KERNEL_PIECE_COLOUR,
    KERNEL_PIECE_COLOUR_SLOPE = KERNEL_PIECE_COLOUR + 3,
    KERNEL_PIECE_ENTRIES = KERNEL_PIECE_COLOUR_SLOPE + 3
};

typedef struct kernel_piece {
    kernel_real entry[KERNEL_PIECE_ENTRIES];
} kernel_piece;

/* Bounds of the function over a range of values, between steps. Extinctions are per unit distance, slopes per
 * domain. */
typedef struct kernel_bound {
    float extinction_low, extinction_high, extinction_slope, colour_slope;
} kernel_bound;

/* Bounds over a range of values, between steps. A field error of d changes the light by at most cost d per unit
 * distance. That change varies by at most swing d while the light that arrives and the light from behind stay the
 * same. */
typedef struct kernel_swing {
    float swing, cost;
    float extinction, steepness; /* maximum of the extinction, and of its slope times the contrast */
} kernel_swing;

/* A step of the opacity: its value, and that value rounded to float, at which pieces end. */
typedef struct kernel_step {
    double at;
    float cut;
} kernel_step;

/* Range of values over which the opacity changes almost as in a step. is_narrow: so narrow that values near it need
 * rests (has_rests). */
typedef struct kernel_steep {
    float low, high;
    bool is_narrow;
} kernel_steep;

/* A bin of the sums (kernel_preintegral.h), in integer units: first the extinction's, then the emission's in three
 * channels. It is read as rows of four floats. */
typedef struct kernel_pre_entry {
    int32_t before[4]; /* sums of all earlier bins */
    float own[4];
    int32_t colour; /* colour at the bin's middle, 10 bits per channel */
    float rough;    /* variation of extinction and emission within the bin, as light */
    float unused[2];
} kernel_pre_entry;

typedef struct kernel_preintegral {
    int bin_count;             /* number of bins of equal width; one infinite entry before and one behind them */
    kernel_pre_entry *entries; /* bin_count + 2 */
    float low, inverse;        /* begin of the first bin, and 1 / a bin's width */
    float depth_unit, light_unit;
    float colour_unit, colour_error;
    float bend_square, bend, bend_at_ends, contrast;
    float allowed_absorbed, allowed_length;
} kernel_preintegral;

typedef struct kernel_pieces {
    int count;
    kernel_piece *pieces; /* sorted by value; the first and the last are infinite */
    /* Bins of equal width from bin_low on, to find a value's piece: the number of the piece at the bin's begin. */
    kernel_real bin_low, bin_inverse;
    kernel_real bin_first[KERNEL_PIECE_BINS];
    /* Bins of bounds, which also begin at bin_low; outside the bins the function is constant. */
    float bound_inverse;
    kernel_bound bounds[KERNEL_BOUND_BINS];
    /* Bounds of ranges of values, by class of width and by the bin of equal width in which they begin; these bins also
     * begin at bin_low (kernel_swing_entry()). KERNEL_SWING_WIDTHS x KERNEL_SWING_BINS. */
    float swing_inverse;
    kernel_swing *swings;
    /* There is a ramp so narrow that the rounding of its ends is visible: the ends have rests, and values near it need
     * them. */
    bool has_rests;
    int step_count, steep_count;
    kernel_step steps[RENDER_MAX_OPACITY_POINTS]; /* sorted by value */
    kernel_steep steep[RENDER_MAX_OPACITY_POINTS];
    float contrast;                  /* largest difference of two colours in any channel, black and white included */
    kernel_preintegral *preintegral; /* NULL if no error is allowed */
} kernel_pieces;

typedef struct kernel_tile {
    int x0, y0;                /* upper left pixel */
    double centre_x, centre_y; /* slope (perspective) or offset (orthographic) of the centre */
    double depth_shift;        /* the frame's depth_shift */
    float shear_x, shear_y;    /* slope of the centre; 0 if orthographic */
    /* Rays in tile space, by column and row of the tile. */
    float origin_x[KERNEL_TILE], origin_y[KERNEL_TILE], slope_x[KERNEL_TILE], slope_y[KERNEL_TILE];
    float radius; /* upper bound of the rays' |u| and |v| */
} kernel_tile;

/* Intervals of visible values, rounded outward: a node whose range meets none of them is skipped. */
typedef struct kernel_interest {
    int count;
    float low[KERNEL_MAX_INTERVALS], high[KERNEL_MAX_INTERVALS];
} kernel_interest;

/* Maps values to positions in a colour table whose scale s is not linear: position = s(value) * slope + shift. */
typedef struct kernel_scale {
    render_scale kind;
    float threshold; /* symlog: s is linear up to it; log: smaller values are raised to it */
    float inverse;   /* 1 / threshold */
    float slope, shift;
} kernel_scale;

/* A transfer function in its own domain, in which low is 0 and low + 1 / inverse_width is 1. The domain is the range
 * [low, high]; with a logarithmic scale it goes from 0 to the largest magnitude, so that small values keep their
 * digits. Opacity is the first point's plus a sum of ramps (a step is a ramp of infinite slope), by position in the
 * colour table. */
typedef struct kernel_transfer {
    double low, inverse_width; /* value -> domain */
    const float *colours;
    int colour_count;
    kernel_scale scale;
    bool is_banded;
    const float *outside; /* 3 × 3 colours; NULL if there are none */
    int ramp_count;
    float base_opacity;
    float ramp_start[RENDER_MAX_OPACITY_POINTS], ramp_inverse[RENDER_MAX_OPACITY_POINTS];
    float ramp_rise[RENDER_MAX_OPACITY_POINTS];
    float exponent; /* step / unit_distance */
    kernel_interest interest;
} kernel_transfer;

/* The levels of contour lines, in a domain in which the first is 0 and the last, if there are several, 1; and how near
 * each one's nearest neighbour is, infinite if there is none. */
typedef struct kernel_lines {
    double low, inverse_width; /* value -> domain */
    int count;
    float level[RENDER_MAX_LINES], gap[RENDER_MAX_LINES];
} kernel_lines;

typedef struct kernel_surface {
    const render_surface_layer *layer;
    kernel_interest interest; /* the isovalues */
    kernel_transfer colour;   /* where layer->colour_map */
    kernel_lines lines;       /* where layer->lines */
    uint32_t own_clips;       /* those of the layer that are not the frame's common ones */
    uint32_t first_kind;      /* fragment kind of the layer's first isovalue */
    double value_scale;       /* power of two that scales the field's range to near 1, for differences */
} kernel_surface;

/* A cell whose isosurface or volume may be visible: its range of depths, and its box of pixels, ends included. */
typedef struct kernel_candidate {
    uint32_t cell;
    uint32_t source; /* part * RENDER_MAX_ISOVALUES + index into the frame's isovalues; for a volume only the part */
    float near, far;
    uint16_t x0, x1, y0, y1;
} kernel_candidate;

/* A candidate in one tile. blocks: a bit per block; box: first and last column, first and last row of pixels, 4 bits
 * each, from bit 0 on. */
typedef struct kernel_tile_candidate {
    float near;
    union {
        float far;
        int32_t next; /* index of the next candidate in the depth bin, for surfaces (kernel_bins.h) */
    };
    uint32_t cell, source;
    uint16_t blocks, box;
} kernel_tile_candidate;

/* The candidates of a tile, unordered; kernels may reorder them. */
typedef struct kernel_bin {
    kernel_tile_candidate *items;
    int count;
    kernel_tile_candidate *room; /* buffer for candidates that several threads have found */
    int64_t capacity;
} kernel_bin;

/* Returns a bit for each of the tile's blocks in these columns and rows of blocks. */
static inline unsigned kernel_blocks_at(unsigned columns, unsigned rows)
{
    /* A bit per row, in the column of the first blocks. */
    static const uint16_t spread[1 << KERNEL_TILE / KERNEL_BLOCK] = {0x0000, 0x0001, 0x0010, 0x0011, 0x0100, 0x0101,
                                                                     0x0110, 0x0111, 0x1000, 0x1001, 0x1010, 0x1011,
                                                                     0x1100, 0x1101, 0x1110, 0x1111};
    return columns * spread[rows];
}

/* A list is a chain of chunks, which are never moved. */
typedef struct kernel_candidate_chunk {
    struct kernel_candidate_chunk *before;
    int64_t count; /* set when the chunk is full */
    kernel_candidate items[];
} kernel_candidate_chunk;

typedef struct kernel_candidate_list {
    kernel_candidate_chunk *chunk; /* the current chunk; NULL at first */
    kernel_candidate *items;       /* items of the current chunk */
    int64_t count, capacity;       /* number and capacity of the current chunk's items */
    uint32_t *counts;              /* number of all chunks' candidates in each of the picture's tiles, row by row */
    int tile_columns;
    bool is_full;   /* no more candidates are added: memory ran out, or the bound is reached */
    int64_t *bound; /* capacity that all lists together may still add */
} kernel_candidate_list;

/* A part of the search for candidates. */
typedef struct kernel_subtree {
    int surface, part; /* surface: -1 for cells of the first volume */
    int64_t node;      /* root of the subtree */
} kernel_subtree;

typedef struct kernel_isovalue {
    int surface, value;
} kernel_isovalue;

typedef struct kernel_frame {
    const render_job *job;
    int surface_count, volume_count;
    kernel_surface *surfaces; /* opaque ones first */
    int opaque_count;
    kernel_isovalue isovalues[RENDER_MAX_ISOVALUES];
    struct kernel_bins *candidates;        /* render_candidates.c; NULL: tiles traverse the trees */
    struct kernel_bins *volume_candidates; /* candidates of the volume's cells; NULL as above */
    int cover[2][2]; /* first and last column, and row, in which trees may be visible; set if needs_planes */
    kernel_transfer volumes[RENDER_MAX_VOLUMES];
    double scaled_axes[3][3];  /* right, up, forward, each times the space's scale */
    double depth_shift;        /* depth_origin * scale: t + depth_shift is the scaled depth from the eye's plane */
    double slope_x0, slope_dx; /* slope of pixel column x: slope_x0 + x * slope_dx; an offset if orthographic */
    double slope_y0, slope_dy;
    double scaled_step;                          /* step * scale */
    float light_direction[RENDER_MAX_LIGHTS][3]; /* in camera axes */
    uint32_t common_clips; /* clips that all layers have and that leave a single interval of a ray */
    /* number of intervals that clips of volumes may leave of a ray; 0: volumes have no clips of their own */
    int volume_turns;
    bool has_transparent;
    bool is_binned;     /* surfaces' cells are binned by tile if that pays */
    bool bins_volume;   /* the only volume's cells are binned by tile */
    bool needs_planes;  /* tiles traverse the trees */
    bool needs_packets; /* single packets traverse trees too, for differences */
    bool has_segments;  /* volumes are integrated by segments, else sampled */
    bool is_double;     /* ends of tets and of bisected intervals are computed in double (kernel_double.h) */
    kernel_pieces pieces[RENDER_MAX_VOLUMES];
    float allowance, mixing, reach[RENDER_MAX_VOLUMES]; /* kernel_segment_list.h */
    bool needs_contact; /* volume fragments end at gaps between this rank's cells, because other ranks may have surfaces
                           there */
} kernel_frame;

/* One thread's state. */
typedef struct kernel_thread {
    /* Memory of memory_bytes (kernel table). The table's begin() sets the pointers below into it. */
    void *memory;
    struct kernel_cell_cache *cells; /* cells that single packets have met */
    struct kernel_tile_trace *tile;
    struct kernel_tile_cells *tile_cells;
    struct kernel_tile_volume *tile_volume;
    struct kernel_tile_segments *tile_segments;
    struct kernel_finder *finder;
    kernel_bin bin, volume_bin; /* the tile's candidates, if the frame has candidates of surfaces, of the volume */
    uint32_t serial;            /* the tile's number, from 1; cached cells with another number are stale */
    fragment_list *out;
    /* Ensures space for `more` more items in the list; returns false if memory ran out. */
    bool (*reserve)(fragment_list *list, int64_t more);
    /* Hits that need other ranks' samples, and the function that adds space for more; it returns false if memory ran
     * out. */
    render_waiting_list waiting;
    bool (*grow_waiting)(render_waiting_list *list);
    bool out_of_memory;
    int64_t map_failures, volume_cells; /* render_statistics */
    /* The tile's polyhedra (render_polyhedra.h); NULL if no mesh has any. */
    struct polyhedron_store *polyhedra;
    struct polyhedron *(*find_polyhedron)(struct polyhedron_store *store, const grid *g, const grid_field *field,
                                          int part, int layer, uint32_t index);
    void *(*polyhedron_scratch)(struct polyhedron_store *store, size_t bytes);
    double surface_seconds, volume_seconds;
    double (*now)(void);
} kernel_thread;

struct kernel_bundle;
struct kernel_occluder;
struct kernel_occluders;
struct kernel_straights;

/* The functions that one instruction set's object exports. */
typedef struct kernel_table {
    int width;
    size_t memory_bytes;
    void (*begin)(kernel_thread *thread); /* sets up the thread's memory for a frame */
    /* Traces the tile whose upper left pixel is (x0, y0). */
    void (*trace_tile)(const kernel_frame *frame, kernel_thread *thread, int x0, int y0);
    /* Adds the subtree's candidates to the list; grow() adds space or marks the list as full. */
    void (*find_candidates)(const kernel_frame *frame, kernel_thread *thread, const kernel_subtree *subtree,
                            kernel_candidate_list *list, bool (*grow)(kernel_candidate_list *list));
    /* Closes the rays that an opaque surface blocks with certainty, and records the cells that must be tested
     * exactly. */
    void (*occlude)(const kernel_frame *frame, kernel_thread *thread, const struct kernel_occluders *occluders,
                    struct kernel_straights *rays);
    /* Closes the bundle's rays that the cell blocks. */
    void (*occlude_by_cell)(const kernel_frame *frame, kernel_thread *thread, struct kernel_bundle *bundle,
                            const struct kernel_occluder *occluder);
    /* Samples this rank's cells around all hits. */
    void (*sample_waiting)(const kernel_frame *frame, kernel_thread *thread, const render_waiting_hit *hits,
                           render_samples_about *out, int64_t count);
    /* Computes the fragments out[i] of the list's hits i from samples[i], first <= i < first + count. */
    void (*light_waiting)(const kernel_frame *frame, kernel_thread *thread, const render_waiting_list *list,
                          const render_samples_about *samples, int64_t first, int64_t count, fragment *out);
} kernel_table;

extern const kernel_table kernel_table_plain, kernel_table_sse42, kernel_table_avx2, kernel_table_avx512;

static inline double kernel_column(const kernel_frame *f, double x)
{
    return f->slope_x0 + x * f->slope_dx;
}
static inline double kernel_row(const kernel_frame *f, double y)
{
    return f->slope_y0 + y * f->slope_dy;
}

#endif
