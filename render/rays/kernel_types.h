/* The constants of a frame in the forms that inner loops want. render_prepare.c makes them once a frame, and the
 * kernels of every instruction set read them. Kernel headers have nothing but static inline code and these types. */
#ifndef RENDER_KERNEL_TYPES_H
#define RENDER_KERNEL_TYPES_H

#include <stddef.h>

#include "fragment.h"
#include "grid.h"
#include "render.h"

enum {
    KERNEL_TILE = 16,
    KERNEL_TILE_RUN = 4, /* so many tiles, row by row, are drawn by one thread after each other */
    KERNEL_BLOCK = 4,    /* pixels along its side */
    KERNEL_MAX_GROUP = RENDER_MAX_GROUP,
    KERNEL_MAX_INTERVALS = RENDER_MAX_INTERVALS
};

/* A transfer function as pieces on which opacity and colour are linear (render_pieces.c), and bounds of its slopes. */

/* KERNEL_BLACK: light below which the rest of a segment is left out. KERNEL_SHORT: kernel_integral.h. */
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
    KERNEL_PIECE_SLOPE,   /* the opacity's */
    KERNEL_PIECE_COLOUR,
    KERNEL_PIECE_COLOUR_SLOPE = KERNEL_PIECE_COLOUR + 3,
    KERNEL_PIECE_ENTRIES = KERNEL_PIECE_COLOUR_SLOPE + 3
};

typedef struct kernel_piece {
    kernel_real entry[KERNEL_PIECE_ENTRIES];
} kernel_piece;

/* Bounds of the function over a stretch of values, between steps. Extinctions are per unit distance, slopes per
 * domain. */
typedef struct kernel_bound {
    float extinction_low, extinction_high, extinction_slope, colour_slope;
} kernel_bound;

/* Over a stretch of values, between steps: what a field that is off by d does to the light is at most cost d a unit
 * distance, and varies by swing d as long as neither the light that gets there changes nor that behind. */
typedef struct kernel_swing {
    float swing, cost;
    float extinction, steepness; /* the most of the extinction, and of its slope times the contrast */
} kernel_swing;

/* A step of the opacity: its value, and that value rounded, at which pieces end. */
typedef struct kernel_step {
    double at;
    float cut;
} kernel_step;

/* Values between which the opacity rises or falls nearly as at a step; is_narrow: one that has_rests is for. */
typedef struct kernel_steep {
    float low, high;
    bool is_narrow;
} kernel_steep;

/* A bin of the sums (kernel_preintegral.h), in units: the extinction's, then the emission's in three channels. It is
 * read as rows of four floats. */
typedef struct kernel_pre_entry {
    int32_t before[4]; /* all in the bins before it */
    float own[4];
    int32_t colour; /* at its middle, 10 bits a channel */
    float rough;    /* by how much extinction and emission vary in it, as light */
    float unused[2];
} kernel_pre_entry;

typedef struct kernel_preintegral {
    int bin_count;             /* equal in width; an entry before them and one behind are endless */
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
    /* Stretches of values by their widths, in classes, and by the bin of equal width where they begin, from bin_low too
     * (kernel_swing_entry()): KERNEL_SWING_WIDTHS x KERNEL_SWING_BINS. */
    float swing_inverse;
    kernel_swing *swings;
    /* There is a ramp so narrow that its ends' rounding shows: they have rests, and values near it are to have them. */
    bool has_rests;
    int step_count, steep_count;
    kernel_step steps[RENDER_MAX_OPACITY_POINTS]; /* by value */
    kernel_steep steep[RENDER_MAX_OPACITY_POINTS];
    float contrast;                  /* no two colours differ by more, in any channel; black and white counted */
    kernel_preintegral *preintegral; /* NULL: no error is allowed */
} kernel_pieces;

typedef struct kernel_tile {
    int x0, y0;                /* the upper left pixel */
    double centre_x, centre_y; /* slope (perspective) or offset (orthographic) of the centre */
    double depth_shift;        /* the frame's */
    float shear_x, shear_y;    /* the centre's slope; 0 where orthographic */
    /* Rays in tile space, by the tile's columns and rows. */
    float origin_x[KERNEL_TILE], origin_y[KERNEL_TILE], slope_x[KERNEL_TILE], slope_y[KERNEL_TILE];
    float radius; /* |u|, |v| of no ray are more */
} kernel_tile;

/* Values that show: a node whose range meets none of these intervals is skipped. Rounded outward. */
typedef struct kernel_interest {
    int count;
    float low[KERNEL_MAX_INTERVALS], high[KERNEL_MAX_INTERVALS];
} kernel_interest;

/* Maps values to places in a colour table whose scale s is not linear: place = s(value) * slope + shift. */
typedef struct kernel_scale {
    render_scale kind;
    float threshold; /* below it s is linear (symlog), or no more than at it (log) */
    float inverse;   /* 1 / threshold */
    float slope, shift;
} kernel_scale;

/* A transfer function in its own domain, where low is 0 and 1 / inverse_width is 1: the range [low, high], or, with a
 * scale, what lies between 0 and the end that is farther from it, so that small values keep their digits. Opacity is
 * the first point's plus a sum of ramps (a ramp of infinite slope is a step), by places in the colour table. */
typedef struct kernel_transfer {
    double low, inverse_width; /* value -> domain */
    const float *colours;
    int colour_count;
    kernel_scale scale;
    bool is_banded;
    const float *outside; /* 3 × 3, NULL: none */
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
    double value_scale;       /* a power of two that brings the field's range near 1: for differences */
} kernel_surface;

/* A cell whose surface of an isovalue, or whose volume, may be seen: its depths, and pixels, ends included. */
typedef struct kernel_candidate {
    uint32_t cell;
    uint32_t source; /* part * RENDER_MAX_ISOVALUES + index into the frame's isovalues; of a volume: part */
    float near, far;
    uint16_t x0, x1, y0, y1;
} kernel_candidate;

/* A candidate in one tile: a bit a block; and the first and last column, first and last row of pixels, from the low
 * bits on. */
typedef struct kernel_tile_candidate {
    float near;
    union {
        float far;
        int32_t next; /* the next surface's candidate of the bin in the tile: render_kernels.c */
    };
    uint32_t cell, source;
    uint16_t blocks, box;
} kernel_tile_candidate;

/* The candidates of a tile, in any order; the kernels may change them. */
typedef struct kernel_bin {
    kernel_tile_candidate *items;
    int count;
    kernel_tile_candidate *room; /* for those of several threads */
    int64_t capacity;
} kernel_bin;

/* The tile's blocks that are in these columns and rows of blocks, a bit each. */
static inline unsigned kernel_blocks_at(unsigned columns, unsigned rows)
{
    /* A bit for each row, in the column of the first blocks. */
    static const uint16_t spread[1 << KERNEL_TILE / KERNEL_BLOCK] = {0x0000, 0x0001, 0x0010, 0x0011, 0x0100, 0x0101,
                                                                     0x0110, 0x0111, 0x1000, 0x1001, 0x1010, 0x1011,
                                                                     0x1100, 0x1101, 0x1110, 0x1111};
    return columns * spread[rows];
}

/* A list is a chain of chunks, none of which moves. */
typedef struct kernel_candidate_chunk {
    struct kernel_candidate_chunk *before;
    int64_t count; /* if it is full */
    kernel_candidate items[];
} kernel_candidate_chunk;

typedef struct kernel_candidate_list {
    kernel_candidate_chunk *chunk; /* the one that is filled; NULL at first */
    kernel_candidate *items;       /* its own, */
    int64_t count, capacity;       /* count of which are filled */
    uint32_t *counts;              /* for a picture's tiles, row by row: how many of all there are of each */
    int tile_columns;
    bool is_full;   /* no more are wanted: memory ran out, or the bound is reached */
    int64_t *bound; /* how many more all lists together may have room for */
} kernel_candidate_list;

/* A piece of the search for candidates. */
typedef struct kernel_subtree {
    int surface, part; /* surface -1: cells of the first volume */
    int64_t node;      /* the subtree's root */
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
    struct kernel_bins *candidates;        /* render_candidates.c; NULL: tiles go down the trees */
    struct kernel_bins *volume_candidates; /* the same of the volume's cells */
    int cover[2][2]; /* the first and the last column, and row, in which trees may be seen; set where needs_planes */
    kernel_transfer volumes[RENDER_MAX_VOLUMES];
    double scaled_axes[3][3];  /* right, up, forward, each times the space's scale */
    double depth_shift;        /* depth_origin * scale: t + depth_shift is the scaled depth from the eye's plane */
    double slope_x0, slope_dx; /* the pixel column x has slope_x0 + x * slope_dx; offsets where orthographic */
    double slope_y0, slope_dy;
    double scaled_step;                          /* step * scale */
    float light_direction[RENDER_MAX_LIGHTS][3]; /* in camera axes */
    uint32_t common_clips;                       /* those of all layers that leave one stretch of a ray */
    int volume_turns; /* stretches that clips of volumes may leave of a ray; 0: they have none of their own */
    bool has_transparent;
    bool is_binned;     /* surfaces' cells are binned by tile, where that pays; */
    bool bins_volume;   /* those of the only volume */
    bool needs_planes;  /* tiles go down the trees */
    bool needs_packets; /* rays go down trees on their own beside that: for differences */
    bool has_segments;  /* volumes are integrated by segments, else sampled; */
    bool is_double;     /* ends of tets and of halved stretches are taken in double (kernel_double.h) */
    kernel_pieces pieces[RENDER_MAX_VOLUMES];
    float allowance, mixing, reach[RENDER_MAX_VOLUMES]; /* kernel_segment_list.h */
    bool needs_contact; /* volume fragments end at gaps between this rank's cells, because other ranks may have surfaces
                           there */
} kernel_frame;

/* One thread's state. */
typedef struct kernel_thread {
    /* memory_bytes of the kernel table, and where the kernels' rooms have theirs in it: set by the table's begin(). */
    void *memory;
    struct kernel_cell_cache *cells; /* that packets on their own have met */
    struct kernel_tile_trace *tile;
    struct kernel_tile_cells *tile_cells;
    struct kernel_tile_volume *tile_volume;
    struct kernel_tile_segments *tile_segments;
    struct kernel_finder *finder;
    kernel_bin bin, volume_bin; /* for the tile, where the frame has candidates of surfaces, of the volume */
    uint32_t serial;            /* the tile's number, from 1: cells of other tiles in the cache are stale */
    fragment_list *out;
    /* Make room for more items in out; false where memory ran out. */
    bool (*reserve)(fragment_list *list, int64_t more);
    /* Hits that wait for other ranks' samples; and room for more of them, false where memory ran out. */
    render_waiting_list waiting;
    bool (*grow_waiting)(render_waiting_list *list);
    bool out_of_memory;
    int64_t map_failures, volume_cells; /* render_statistics */
    /* The tile's polyhedra (render_polyhedra.h); NULL where no mesh has any. */
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
    void (*begin)(kernel_thread *thread); /* ready the thread's memory for a frame */
    /* Trace the tile of pixels whose upper left one is (x0, y0). */
    void (*trace_tile)(const kernel_frame *frame, kernel_thread *thread, int x0, int y0);
    /* Adds the subtree's candidates to the list; grow() makes room for more, or the list full. */
    void (*find_candidates)(const kernel_frame *frame, kernel_thread *thread, const kernel_subtree *subtree,
                            kernel_candidate_list *list, bool (*grow)(kernel_candidate_list *list));
    /* Closes the rays that an opaque surface blocks for certain, and notes cells that others are to be asked of. */
    void (*occlude)(const kernel_frame *frame, kernel_thread *thread, const struct kernel_occluders *occluders,
                    struct kernel_straights *rays);
    /* Closes the bundle's rays that the cell blocks. */
    void (*occlude_by_cell)(const kernel_frame *frame, kernel_thread *thread, struct kernel_bundle *bundle,
                            const struct kernel_occluder *occluder);
    /* Samples this rank's cells about all hits. */
    void (*sample_waiting)(const kernel_frame *frame, kernel_thread *thread, const render_waiting_hit *hits,
                           render_samples_about *out, int64_t count);
    /* Makes out[i] of the list's hit i, first <= i < first + count, by its samples[i]. */
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
