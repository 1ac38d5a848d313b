/* The constants of a frame in the forms that inner loops use. render_prepare.c computes them once per frame, and the
 * kernels of every instruction set read them. Kernel headers contain only static inline code and these types.
 *
 * Terms of all kernel headers:
 *     t            a ray's parameter: depth along the camera's axis, counted from the depth origin, in scaled units
 *     tree space   the coordinates of the trees: (world position - space.origin) * space.scale; its unit of length, in
 *                  which the scene has a size near 1, is a scaled unit
 *     tile space   tree space relative to the eye, along the camera's axes (right, up, forward), sheared so that the
 *                  tile's middle ray is the axis X = Y = 0 (orthographic: moved sideways for that); Z is t
 *     tile         16 × 16 pixels, which one thread traces
 *     block        4 × 4 pixels of a tile
 *     packet       rays through SIMD_WIDTH neighbouring pixels, one per lane of a vector (kernel_packet.h)
 *     part         one mesh of this rank (render_part)
 *     hit          the point at which a ray meets an isosurface
 *     crossing     the point at which a ray passes through a face of a cell
 *     interval     the part of a ray between two values of t, for example inside a cell; or a range of values
 *     candidate    a cell that may be visible, found before tiles are traced; a bin has the candidates of one tile
 *     segment      a part of a ray's interval in a cell, on which the field is taken as linear for volumes
 *     piece        a range of values on which a transfer function's opacity and colour are linear
 *     half         the first or the last SIMD_WIDTH / 2 lanes of a vector (kernel_wide.h) */
#ifndef RENDER_KERNEL_TYPES_H
#define RENDER_KERNEL_TYPES_H

#include <stddef.h>

#include "fragment.h"
#include "grid.h"
#include "mmbvh.h"
#include "render.h"

enum {
    KERNEL_TILE = 16,
    KERNEL_TILE_PIXELS = KERNEL_TILE * KERNEL_TILE,
    KERNEL_TILES_PER_TASK = 4, /* number of consecutive tiles, row by row, that a thread draws as one task */
    KERNEL_BLOCK = 4,          /* pixels along a block's side */
    KERNEL_MAX_GROUP = RENDER_MAX_GROUP,
    /* maximum number of intervals of visible values of a volume, or of isovalues of a layer */
    KERNEL_MAX_INTERVALS = RENDER_MAX_ISOVALUES
};

_Static_assert((int)KERNEL_MAX_INTERVALS >= (int)RENDER_MAX_INTERVALS, "a volume's intervals fit");

/* KERNEL_BLACK: a segment is integrated only until its transmittance falls below this value. KERNEL_SHORT: no
 * integration step needs to be shorter than this, in unit distances (render_transfer). A step also does not need to be
 * shorter than KERNEL_SHORT times the length of the ray's part in one piece of the transfer function
 * (kernel_integral.h). */
#if defined(KERNEL_REAL_IS_DOUBLE)
typedef double kernel_real;
#define KERNEL_BLACK 1e-16
#define KERNEL_SHORT 1e-12
#else
typedef float kernel_real;
#define KERNEL_BLACK 1e-8f
#define KERNEL_SHORT 2e-6f
#endif

enum { KERNEL_PIECE_BINS = 256, KERNEL_VARIATION_BINS = 128, KERNEL_VARIATION_WIDTHS = 29 };

/* Entries of a piece of a transfer function. A piece is a range of values of the field, from low to high, on which
 * opacity and colour are linear functions of the value. At a value x in this range, the opacity is the opacity at `low`
 * plus (x - low) times its slope. Each channel of the colour is computed in the same way. 1 - opacity is stored
 * separately, because near an opacity of 1 the computed difference would consist of rounding errors only. The function
 * is constant below its first and above its last point. So the first piece begins at -infinity and the last ends at
 * +infinity; these two are replaced by -2^100 and 2^100, so that KERNEL_PIECE_INVERSE times the width is still 1. */
enum {
    KERNEL_PIECE_LOW,
    KERNEL_PIECE_HIGH,
    /* Exact lower and upper end of the piece minus KERNEL_PIECE_LOW and KERNEL_PIECE_HIGH, which are the ends rounded
     * to kernel_real; 0 unless kernel_pieces.has_rests is set. */
    KERNEL_PIECE_LOW_REST,
    KERNEL_PIECE_HIGH_REST,
    KERNEL_PIECE_OPACITY,
    KERNEL_PIECE_OPACITY_HIGH, /* opacity at the upper end */
    KERNEL_PIECE_CLEAR,        /* 1 - opacity at the lower end */
    KERNEL_PIECE_CLEAR_HIGH,
    KERNEL_PIECE_INVERSE, /* 1 / (high - low), the inverse width of the piece */
    KERNEL_PIECE_SLOPE,   /* derivative of the opacity with respect to the value */
    KERNEL_PIECE_COLOUR,
    KERNEL_PIECE_COLOUR_SLOPE = KERNEL_PIECE_COLOUR + 3,
    KERNEL_PIECE_ENTRIES = KERNEL_PIECE_COLOUR_SLOPE + 3
};

/* Bounds of a transfer function over a range of values in which the opacity has no step. Extinctions are per unit
 * distance (render_transfer). Slopes are derivatives with respect to the value, in the function's domain
 * (kernel_transfer). */
typedef struct kernel_bound {
    float extinction_low, extinction_high, extinction_slope, colour_slope;
} kernel_bound;

/* Entries of kernel_pieces.variations[i]: upper bounds over one range of values, in which the opacity has no step.
 * Suppose that the field has a small error e along one unit distance of a ray, and that this changes a channel of the
 * pixel's light by g e. g depends on the field's value there and on the light that comes from farther along the ray.
 * KERNEL_LIGHT_COST is the maximum of |g| over the range of values and over all colours of that light.
 * KERNEL_LIGHT_VARIATION is the largest difference between the g of two values of the range, for the same channel and
 * the same light from behind. */
enum {
    KERNEL_LIGHT_VARIATION,
    KERNEL_LIGHT_COST,
    KERNEL_LIGHT_EXTINCTION, /* maximum of the extinction */
    KERNEL_LIGHT_STEEPNESS,  /* maximum of the extinction's |slope|, times kernel_pieces.contrast */
    KERNEL_LIGHT_ENTRIES
};

/* A bin (a range of values) of the table of sums for preintegration (kernel_preintegral.h). In each array, element 0 is
 * a sum of extinctions, and elements 1 to 3 are sums of the emission (extinction times colour) in the three colour
 * channels. Sums are integers. A sum over n bins, divided by n, is the average extinction over these bins in units of
 * depth_unit, or the average emission in units of light_unit (kernel_preintegral). The struct is read as rows of four
 * floats. */
typedef struct kernel_preint_entry {
    int32_t before[4]; /* sums over all bins before this one */
    float own[4];      /* sums over this bin; integers, stored as floats */
    int32_t colour;    /* colour at the bin's middle, 10 bits per channel, in units of colour_unit */
    /* upper bound of the error of a segment's light, per unit distance of the segment, that arises because extinction
     * and emission vary within the bin but are stored as one average */
    float table_error;
    float unused[2];
} kernel_preint_entry;

typedef struct kernel_preintegral {
    /* number of bins of equal width; entries[0] and the last entry are bins for all values below and above them */
    int bin_count;
    kernel_preint_entry *entries; /* array of bin_count + 2 bins */
    float low, inverse;           /* value at which the first bin begins, and 1 / the width of a bin */
    float depth_unit, light_unit; /* units of the sums of extinctions and of emissions (kernel_preint_entry) */
    /* colour_unit: unit of packed colours; colour_error: upper bound of the difference between the colour at a value
     * and the colour stored for its bin */
    float colour_unit, colour_error;
    /* Over a range of values of width h, let the chord be the linear function that equals a colour channel at both ends
     * of the range. The channel deviates from its chord by at most h (h bend_square + bend) + colour_error. If the
     * range extends beyond the ends of the colour table, the smaller of h bend_at_ends and contrast is added. */
    float bend_square, bend, bend_at_ends, contrast;
    /* The light of a segment may have an error of at most allowed_absorbed times the segment's absorption (1 -
     * transmittance) plus allowed_length times its length in unit distances. */
    float allowed_absorbed, allowed_length;
} kernel_preintegral;

typedef struct kernel_pieces {
    int count;
    /* pieces of the transfer function, sorted by value; the first begins at -2^100, the last ends at 2^100 */
    kernel_real (*pieces)[KERNEL_PIECE_ENTRIES];
    /* A table to find the piece of a value: KERNEL_PIECE_BINS bins of equal width (1 / bin_inverse), the first of which
     * begins at bin_low. bin_first contains, for each bin, the index of the piece in which the bin begins. */
    kernel_real bin_low, bin_inverse;
    kernel_real bin_first[KERNEL_PIECE_BINS];
    /* A table of KERNEL_VARIATION_WIDTHS rows and KERNEL_VARIATION_BINS columns, row by row, with upper bounds over
     * ranges of values (KERNEL_LIGHT_VARIATION and so on). The row is chosen by the width of the range, and the column
     * by the bin in which the range begins (kernel_look_up_light_error_bounds()). The bins of this table have the width
     * 1 / variation_inverse, and the first begins at bin_low. */
    float variation_inverse;
    float (*variations)[KERNEL_LIGHT_ENTRIES];
    /* Set if the opacity rises or falls so steeply that the rounding of a piece's ends to kernel_real would be visible.
     * The rounding errors of the ends (KERNEL_PIECE_LOW_REST) are then added to the ends. */
    bool has_rests;
    int step_count;
    /* values at which the opacity has a step, sorted; at each of them, rounded to kernel_real, one piece ends and the
     * next begins */
    double steps[RENDER_MAX_OPACITY_POINTS];
    /* largest difference between two colours of the function in any channel; black and white count as its colours */
    float contrast;
    kernel_preintegral *preintegral; /* table of sums; NULL if the job allows no error (max_error) */
} kernel_pieces;

/* Returns the value at which the piece below a step of the opacity ends and the piece above it begins: the value of the
 * step, rounded to kernel_real. */
static inline float kernel_round_opacity_step(double step)
{
    return (float)(kernel_real)step;
}

typedef struct kernel_tile {
    int x0, y0;                /* column and row of the tile's upper left pixel */
    double centre_x, centre_y; /* slope (perspective) or offset (orthographic) of the ray through the tile's centre */
    double depth_shift;        /* copy of the frame's depth_shift */
    float shear_x, shear_y;    /* slope of the ray through the tile's centre; 0 if the camera is orthographic */
    /* The tile's rays in tile space: x for each column, y for each row of pixels. A ray's point at depth Z is its
     * origin plus Z times its slope. */
    float origin_x[KERNEL_TILE], origin_y[KERNEL_TILE], slope_x[KERNEL_TILE], slope_y[KERNEL_TILE];
    /* upper bound of |u| and |v| over the tile's rays; (u, v) is a ray's slope or, if the camera is orthographic, its
     * origin */
    float radius;
} kernel_tile;

/* Intervals of field values at which a surface or volume is visible, rounded outward. Nodes and cells whose range of
 * values overlaps none of these intervals are skipped. */
typedef struct kernel_visible_values {
    int count;
    mmbvh_interval intervals[KERNEL_MAX_INTERVALS];
} kernel_visible_values;

/* A transfer function in its own domain: values are mapped linearly, so that low becomes 0 and low + 1 / inverse_width
 * becomes 1. With a linear scale these two are the ends of the function's range. With a logarithmic scale they are the
 * value 0 and the largest magnitude of the range, so that small values keep their digits. The opacity is that of the
 * first point plus a sum of ramps over the position in the colour table (a step is a ramp of infinite slope). */
typedef struct kernel_transfer {
    double low, inverse_width; /* a value x is mapped to the domain by (x - low) * inverse_width */
    const float *colours;
    int colour_count;
    /* On a logarithmic or symmetric logarithmic scale, the position of a value in the colour table is s(value) *
     * scale_slope + scale_shift, where s is the scale's function (render_scaled()). */
    render_scale scale;
    /* Threshold of the scale, in the transfer function's domain. A symmetric logarithmic scale is linear for values of
     * at most this magnitude. On a logarithmic scale, smaller values are replaced by the threshold. */
    float threshold;
    float inverse_threshold; /* 1 divided by the threshold */
    float scale_slope, scale_shift;
    bool is_banded;
    /* colours of values below the range, above it, and of NaN, 3 numbers each; NULL if there are none */
    const float *outside;
    int ramp_count;
    float base_opacity;
    float ramp_start[RENDER_MAX_OPACITY_POINTS], ramp_inverse[RENDER_MAX_OPACITY_POINTS];
    float ramp_rise[RENDER_MAX_OPACITY_POINTS];
    /* distance between samples / unit_distance; a sample's transmittance is (1 - opacity) to this power */
    float exponent;
    kernel_visible_values visible_values;
} kernel_transfer;

/* The levels of contour lines (values of the field on the lines), mapped linearly so that the first level is 0 and the
 * last, if there are several, is 1. gap: distance from each level to the nearest other level, infinite if there is
 * none. */
typedef struct kernel_lines {
    double low, inverse_width; /* a value x is mapped to the domain by (x - low) * inverse_width */
    int count;
    float level[RENDER_MAX_LINES], gap[RENDER_MAX_LINES];
} kernel_lines;

typedef struct kernel_surface {
    const render_surface_layer *layer;
    kernel_visible_values visible_values; /* the visible values: the layer's isovalues */
    kernel_transfer colour;               /* transfer function of the colour field; set if the layer has a colour_map */
    kernel_lines lines;                   /* contour lines on the surface; set if the layer has lines */
    /* mask of this layer's clips that are not among the frame's common_clips; bit i stands for clip i of the job */
    uint32_t own_clips;
    uint32_t first_kind; /* fragment kind (fragment.h) of the layer's first isovalue */
    /* power of two by which values are multiplied, so that the width of the field's range is near 1; set if normals are
     * computed from differences (RENDER_DIFFERENCES) */
    double value_scale;
} kernel_surface;

/* A candidate: a cell in which an isosurface or the volume may be visible. near, far: least and greatest t in the cell;
 * x0, x1, y0, y1: first and last column, first and last row of the pixels that the cell may cover. */
typedef struct kernel_candidate {
    uint32_t cell;
    /* for a surface: index of the mesh part * RENDER_MAX_ISOVALUES + index of the isovalue in the frame; for a volume:
     * index of the mesh part */
    uint32_t source;
    float near, far;
    uint16_t x0, x1, y0, y1;
} kernel_candidate;

/* A candidate as stored for one tile. blocks: one bit for each of the tile's blocks in which the cell may be visible.
 * box: first and last column, first and last row, relative to the tile, of the pixels that the cell may cover; 4 bits
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

/* Number of depth bins (ranges of depth) into which a tile's candidates are sorted. The candidates of one depth bin are
 * not sorted. This order is accurate enough to skip cells that nearer hits hide. */
enum { KERNEL_DEPTHS = 32 };

/* The candidates of one tile, in any order. Kernels may reorder them. */
typedef struct kernel_bin {
    kernel_tile_candidate *items;
    int count;
    /* The following members are set by kernel_sort_by_depth(). first: index of the first item of each depth bin, or -1;
     * the nearest depth bin comes first. Items of a depth bin are linked by `next`, which is -1 at the end. low: least
     * t of an item; scale: number of depth bins per unit of t. */
    int first[KERNEL_DEPTHS];
    float low, scale;
    /* buffer for `capacity` items, in which candidates that several threads have found are gathered */
    kernel_tile_candidate *buffer;
    int64_t capacity;
} kernel_bin;

/* Returns a mask of the blocks that lie both in one of the given columns and in one of the given rows of blocks.
 * columns, rows: masks with one bit for each column or row. */
static inline unsigned kernel_mask_blocks_in_columns_and_rows(unsigned columns, unsigned rows)
{
    /* spread[rows] is a mask that has, for each row in the mask `rows`, the bit of the row's first block */
    static const uint16_t spread[1 << KERNEL_TILE / KERNEL_BLOCK] = {0x0000, 0x0001, 0x0010, 0x0011, 0x0100, 0x0101,
                                                                     0x0110, 0x0111, 0x1000, 0x1001, 0x1010, 0x1011,
                                                                     0x1100, 0x1101, 0x1110, 0x1111};
    return columns * spread[rows];
}

/* A list of candidates is a chain of chunks, which are never moved in memory. */
typedef struct kernel_candidate_chunk {
    struct kernel_candidate_chunk *before;
    int64_t count; /* number of items; set when the next chunk is begun or the search ends */
    kernel_candidate items[];
} kernel_candidate_chunk;

typedef struct kernel_candidate_list {
    kernel_candidate_chunk *chunk; /* the current chunk; NULL at first */
    kernel_candidate *items;       /* items of the current chunk */
    int64_t count, capacity;       /* number of items in the current chunk, and how many fit */
    /* set if no more candidates can be added, because memory ran out or the maximum number is reached */
    bool is_full;
    /* number of candidates for which chunks may still be allocated; all threads' lists share this counter */
    int64_t *bound;
} kernel_candidate_list;

/* A unit of work in the search for candidates: a subtree of one mesh's tree, searched for one layer. */
typedef struct kernel_subtree {
    int surface, part; /* index of the surface layer, or -1 for the first volume; index of the mesh part */
    int64_t node;      /* index of the subtree's root in the tree */
} kernel_subtree;

typedef struct kernel_frame {
    const render_job *job;
    int surface_count, volume_count;
    kernel_surface *surfaces; /* surface layers, the opaque ones first */
    int opaque_count;
    /* for each isovalue of the frame: index in `surfaces` of the layer that has it, and the isovalue's index in this
     * layer */
    int isovalue_surface[RENDER_MAX_ISOVALUES], isovalue_number[RENDER_MAX_ISOVALUES];
    /* binned candidates of surfaces (render_candidates.c); NULL if tiles traverse the trees themselves */
    struct kernel_bins *candidates;
    /* binned candidates of the volume; NULL if tiles traverse the tree themselves */
    struct kernel_bins *volume_candidates;
    /* pixels in which the bounding box of some tree may be visible: first and last column in cover[0], first and last
     * row in cover[1]; set only if needs_planes */
    int cover[2][2];
    kernel_transfer volumes[RENDER_MAX_VOLUMES];
    /* the camera's axes right, up and forward, in world coordinates, each times the space's scale */
    double scaled_axes[3][3];
    double depth_shift; /* depth_origin * scale: t + depth_shift is the scaled depth from the eye's plane */
    /* In pixel column x the ray has the slope (or, if the camera is orthographic, the offset) slope_x0 + x * slope_dx.
     * Rows have slope_y0 + y * slope_dy. */
    double slope_x0, slope_dx;
    double slope_y0, slope_dy;
    double scaled_step;                          /* distance between samples in scaled units: the job's step * scale */
    float light_direction[RENDER_MAX_LIGHTS][3]; /* unit vectors to the lights, in camera axes */
    /* mask of the clips that apply to all layers and leave at most one interval of each ray; bit i stands for clip i of
     * the job */
    uint32_t common_clips;
    /* Upper bound of the number of intervals that the clips of volumes leave of a ray; 0 if volumes have no clips of
     * their own. */
    int volume_intervals;
    bool has_transparent;
    bool has_polyhedra; /* set if at least one mesh part has polyhedra */
    /* set if candidates of surfaces are searched for and binned by tile; tiles traverse the trees nevertheless if the
     * cells are too small or too many */
    bool is_binned;
    bool bins_volume; /* set if candidates of the frame's only volume are searched for and binned by tile */
    /* set if tiles traverse the trees and therefore need the planes between their blocks (kernel_tile.h) */
    bool needs_planes;
    bool has_segments; /* set if volumes are integrated by segments; otherwise they are sampled */
    /* set if the ends of intervals in tets and of bisected intervals are computed in double (kernel_exact.h) */
    bool is_double;
    kernel_pieces pieces[RENDER_MAX_VOLUMES];
    /* Limits for segments of volumes. allowance: largest error of light that the approximation of the field may cause
     * (kernel_local_budget.h). If it is 0, segments of hexes, wedges and pyramids are at most as long as the sampling
     * step. mixing: largest error of light that compositing may cause where segments of several volumes or cells
     * overlap in depth. reach: per volume, upper bound of the length of a ray in the scene, in the volume's unit
     * distances (render_transfer). */
    float allowance, mixing, reach[RENDER_MAX_VOLUMES];
    /* Set if volume fragments must end at gaps between this rank's cells, because other ranks may have surfaces
     * there. */
    bool needs_contact;
} kernel_frame;

/* The state of one thread. */
typedef struct kernel_thread {
    /* The thread's memory, which has kernel_table.memory_bytes bytes. kernel_table.begin() sets the pointers below to
     * parts of it. */
    void *memory;
    /* cache of cells that are traced one cell at a time, with packets (kernel_cell_cache.h) */
    struct kernel_cell *cells;
    struct kernel_tile_trace *tile;
    struct kernel_tile_cells *tile_cells;
    struct kernel_tile_volume *tile_volume;
    struct kernel_tile_segments *tile_segments;
    struct kernel_finder *finder;
    /* current tile's candidates of surfaces and of the volume; used only if the frame bins them */
    kernel_bin bin, volume_bin;
    uint32_t serial;   /* number of the current tile, counted from 1; cached cells of other tiles are out of date */
    fragment_list out; /* fragments of the current tile */
    render_pending_list waiting; /* pending hits: hits whose normals need samples from the cells of other ranks */
    bool out_of_memory;
    /* counters for render_statistics: number of points whose reference coordinates could not be computed, and number of
     * cells visited by volumes */
    int64_t map_failures, volume_cells;
    /* The tile's polyhedra (render_polyhedra.h); NULL if no mesh part has any. */
    struct polyhedron_store *polyhedra;
    double surface_seconds, volume_seconds;
} kernel_thread;

/* Functions of render_frame.c that kernels call. The first two add space to a list, and return false if memory ran
 * out. */
bool render_reserve_fragments(fragment_list *list, int64_t more); /* ensures space for `more` more fragments */
bool render_grow_pending(render_pending_list *list);
double render_read_clock(void); /* a clock */

struct kernel_bundle;
struct kernel_occluder;
struct kernel_occluders;
struct kernel_secondary_rays;

/* The kernels that are compiled for one instruction set. */
typedef struct kernel_table {
    int width;
    size_t memory_bytes;
    void (*begin)(kernel_thread *thread); /* sets pointers into the thread's memory at the start of a frame */
    /* Traces the tile whose upper left pixel is (x0, y0). */
    void (*trace_tile)(const kernel_frame *frame, kernel_thread *thread, int x0, int y0);
    /* Appends the candidates of a subtree to the list. It calls grow() if the current chunk has too little space;
     * grow() allocates another chunk, or marks the list as full. */
    void (*find_candidates)(const kernel_frame *frame, kernel_thread *thread, const kernel_subtree *subtree,
                            kernel_candidate_list *list, bool (*grow)(kernel_candidate_list *list));
    /* Secondary rays lead from hits to lights or into the hemisphere. Clears is_open of the secondary rays that an
     * opaque surface certainly blocks, and records the ray-cell pairs that must be tested exactly. */
    void (*occlude)(const kernel_frame *frame, kernel_thread *thread, const struct kernel_occluders *occluders,
                    struct kernel_secondary_rays *rays);
    /* Clears the bits in bundle->open of the rays that the surface in this cell blocks. */
    void (*occlude_by_cell)(const kernel_frame *frame, kernel_thread *thread, struct kernel_bundle *bundle,
                            const struct kernel_occluder *occluder);
    /* Samples the field of this rank's cells at the six points around each of `count` hits, for normals by central
     * differences; out[i] has the samples of hits[i]. */
    void (*sample_pending)(const kernel_frame *frame, kernel_thread *thread, const render_pending_hit *hits,
                           render_difference_samples *out, int64_t count);
    /* Computes normals, shades `count` hits and stores their fragments: out[i] from hits[i], shadings[i]
     * (render_pending_list.shadings) and the samples around the hit, samples[i]. */
    void (*light_pending)(const kernel_frame *frame, kernel_thread *thread, const render_pending_hit *hits,
                          float (*shadings)[2][3], const render_difference_samples *samples, fragment *out,
                          int64_t count);
} kernel_table;

extern const kernel_table kernel_table_plain, kernel_table_sse42, kernel_table_avx2, kernel_table_avx512;

/* Returns the slope (perspective) or the offset (orthographic) of the rays of a column of pixels along the camera's
 * axis `right`; x: the column. */
static inline double kernel_column_slope(const kernel_frame *f, double x)
{
    return f->slope_x0 + x * f->slope_dx;
}
/* Returns the slope (perspective) or the offset (orthographic) of the rays of a row of pixels along the camera's axis
 * `up`; y: the row. */
static inline double kernel_row_slope(const kernel_frame *f, double y)
{
    return f->slope_y0 + y * f->slope_dy;
}

#endif
