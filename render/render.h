/* Renders local cells to local fragments: camera, layers, and the one call that draws a frame. It does not use MPI.
 *
 * A ray through pixel (x, y) is p(z) = eye + offset + z (forward + slope), where z is the depth along the camera's
 * axis: perspective cameras have the slope, orthographic ones the offset. The ray's parameter everywhere is t = (z -
 * depth_origin) * scale, so that float32 t has its resolution where the cells are. Samples of a volume lie at distances
 * (k + jitter) * step from the eye (perspective) or the eye's plane (orthographic), k = 0, 1, ...
 *
 * The result of a frame is a function of the cells and the job alone. It does not depend on the rank that holds a cell,
 * the order of the cells, the trees, or the number of threads.
 *
 * If cells overlap, each contributes its own sample. Samples at one position, of several cells or of several volumes,
 * share what all of them absorb in proportion to what each would absorb alone. A rank cannot know which cells of other
 * ranks overlap its own. So a frame keeps one cell's sample and marks the ray by a second sample, as a fragment of its
 * own at the same depth. Compositing finds the pixels in which fragments of any ranks overlap (comp.h), and these are
 * traced again with separate_samples, which leaves the sharing to compositing. Until then the result in such pixels is
 * undefined. Volumes by segments work the same way: if cells overlap, each cell's segments become separate fragments;
 * segments of several volumes do so on all pixels.
 *
 * Faces that coincide but do not have the same bits, as at hanging nodes, leave overlaps and gaps of the size of
 * rounding. Segments that overlap by no more are not reported to compositing: each has its own length, and the sum of
 * lengths is the same on any partition. A sample in such an overlap marks its ray. Separate samples are flagged if they
 * are near their cell's begin or end, so that compositing can distinguish two such owners from cells that overlap. */
#ifndef RENDER_RENDER_H
#define RENDER_RENDER_H

#include "error.h"
#include "fragment.h"
#include "grid.h"
#include "insitu/status.h"
#include "mmbvh.h"

typedef struct render_camera {
    double eye[3];
    double right[3], up[3], forward[3]; /* orthonormal, right-handed: right × up = -forward */
    double half_height;                 /* perspective: tangent of half the vertical angle; else half the height */
    bool is_orthographic;
    int width, height;
    double offset[2]; /* offset of every ray from its pixel's centre, in pixels, to the right and down; 0 by default */
} render_camera;

/* Computes the offset of sample k of count (1, 2, 4, 8 or 16) in a pixel. Along either axis the samples are evenly
 * spaced, and their mean is the pixel's centre. */
void render_camera_sample(int count, int k, double offset[2]);

/* Sets a camera at eye that looks at focal. vertical_degrees: the whole vertical angle, in (0, 180). Returns false if
 * eye equals focal, or up is parallel to the view. */
bool render_camera_look_at(render_camera *camera, const double eye[3], const double focal[3], const double up[3],
                           double vertical_degrees, int width, int height);

/* Computes the ray through pixel (x, y), at its centre plus the offset: p(z) = base + z * direction, z >= 0. direction
 * has length 1 along forward, not length 1. */
void render_camera_ray(const render_camera *camera, int x, int y, double base[3], double direction[3]);

/* The space of float32 numbers. Positions are taken relative to origin and multiplied by scale, a power of two that
 * scales the scene to a size near 1. The trees have the same origin and scale. */
typedef struct render_space {
    double origin[3];
    double scale;
    double depth_origin; /* z at which t = 0 */
} render_space;

/* The spacing of values along a colour table: linear; by the logarithm, for which low > 0; or by render_scaled(). */
typedef enum render_scale { RENDER_LINEAR, RENDER_LOG, RENDER_SYMLOG } render_scale;

/* The scale's function s, which is monotone, and its inverse. RENDER_LOG: ln value, -infinity if value <= 0.
 * RENDER_SYMLOG: value / threshold for |value| <= threshold (> 0); 1 + ln(value / threshold) above, and the negative
 * mirror image below, so that s and its slope are continuous. */
double render_scaled(render_scale scale, double threshold, double value);
double render_unscaled(render_scale scale, double threshold, double scaled);

/* Colour and opacity of a value. A value's position is (s(value) - s(low)) / (s(high) - s(low)), s being the scale.
 * Colours are a table of linear RGB, evenly spaced over the positions from 0 to 1, interpolated linearly by position
 * (in volumes with a scale, by value between entries), clamped outside. Opacity is piecewise linear by position through
 * points of rising value (two of the same value make a step), constant outside; with a scale the points lie between low
 * and high. Opacity is per unit_distance: extinction = -ln(1 - opacity) / unit_distance. */
typedef struct render_transfer {
    double low, high;
    int colour_count;     /* >= 2 */
    const float *colours; /* colour_count × 3 */
    render_scale scale;
    double threshold; /* for RENDER_SYMLOG, > 0 */
    /* surfaces only: colours are those of bands of equal width, not interpolated; colour_count may be 1 */
    bool is_banded;
    /* surfaces only: 3 × 3, the colours below low, above high, and of NaN; values within RENDER_END of an end belong to
     * the range. NULL: the colours of low and high, and RENDER_NO_COLOUR */
    const float *outside;
    int opacity_count; /* 1 .. RENDER_MAX_OPACITY_POINTS; 0 for surfaces, which have none */
    const double *opacity_values;
    const float *opacities;
    double unit_distance; /* scene units, > 0 */
} render_transfer;

enum { RENDER_MAX_OPACITY_POINTS = 32, RENDER_MAX_ISOVALUES = 64, RENDER_MAX_VOLUMES = 4, RENDER_MAX_LIGHTS = 8 };
enum { RENDER_MAX_LINES = 64 };
enum { RENDER_MAX_GROUP = 64 };
enum { RENDER_MAX_CLIPS = 32 };
enum { RENDER_MAX_INTERVALS = RENDER_MAX_OPACITY_POINTS / 2 + 2 };

typedef struct render_light {
    double direction[3]; /* from the surface towards the light; unit length; world */
    float colour[3];     /* linear, intensity included */
} render_light;

/* Blinn-Phong: colour * (ambient + sum diffuse max(0, n.l)) + sum specular max(0, n.h)^shininess, with n towards the
 * eye and the sums over the lights with n.l > 0. */
typedef struct render_material {
    float ambient, diffuse, specular, shininess;
} render_material;

static inline bool render_takes_light(const render_material *m)
{
    return m->diffuse != 0 || m->specular != 0;
}

/* One field over all parts: fields[i] and ranges[i] belong to parts[i]. ranges[i].low NULL: not on that part. */
typedef struct render_field {
    const grid_field *fields;
    const mmbvh_ranges *ranges;
} render_field;

typedef enum render_normal {
    RENDER_GRADIENT,    /* the gradient in the cell that holds the hit */
    RENDER_DIFFERENCES, /* central ones (thesis, 4.3.4): one-sided where a sample is in no cell, the cell's gradient
                           where an axis has neither. Over this rank's cells, or with the job's waiting over those of
                           all */
    RENDER_VERTEX /* gradients that the caller gives at the vertices, interpolated in the hit's cell as values are */
} render_normal;

enum { RENDER_DIFFERENCE_SAMPLES = 6 };

/* A hit of RENDER_DIFFERENCES that needs samples of other ranks (render_differences.h). 16 bytes. */
typedef struct render_waiting_hit {
    uint32_t pixel, kind; /* those of its future fragment */
    float t, reach;       /* reach: distance of its samples along each axis, before and behind it; scaled units */
} render_waiting_hit;

/* The look of such a hit: the cell's gradient in camera axes, and the unlit colour. */
typedef struct render_waiting_look {
    float normal[3], colour[3];
} render_waiting_look;

/* Growing lists of hits and looks, of equal count; memory from memory.h. */
typedef struct render_waiting_list {
    render_waiting_hit *items;
    render_waiting_look *looks;
    int64_t count, capacity;
} render_waiting_list;

/* The samples around a hit: before and behind it along the first axis, the second, the third. 32 bytes. */
typedef struct render_samples_about {
    uint32_t found, unused; /* found: a bit per sample, set if a cell contains its point */
    float values[RENDER_DIFFERENCE_SAMPLES];
} render_samples_about;

/* Transmittance that marks placeholder fragments of such hits while a frame is traced. */
#define RENDER_WAITS 2.0f

/* Range of each surface's field over all ranks, low > high if no rank has it; and the list of hits that need
 * samples. */
typedef struct render_waiting {
    double ranges[RENDER_MAX_ISOVALUES][2];
    render_waiting_list list;
} render_waiting;

/* Gradients at a part's vertices, of any length. Each vertex of the cells that the layer's isovalues cross has one. */
typedef struct render_vertex_gradients {
    const int32_t *entries;      /* by vertex: index into gradients; -1: none. NULL: the part has no such cells */
    const float (*gradients)[3]; /* world axes */
} render_vertex_gradients;

/* Contour lines on a surface: the share of a pixel that one covers takes its colour, before light falls on it. Lines
 * that are less than two widths apart fade. */
typedef struct render_lines {
    render_field field;   /* vertex-centred, with values (or NaN) on every part that has the surface; ranges not looked
                             at */
    int count;            /* 1 .. RENDER_MAX_LINES */
    const double *values; /* rising */
    float width;          /* pixels, > 0 */
    const float *colours; /* count × 3, linear; NULL: the hit's own */
    bool is_alone; /* nothing of the surface is seen but lines: hits beside them are none, and if it is transparent, a
                      hit's opacity is the layer's times the share. The material takes no light */
} render_lines;

typedef struct render_surface_layer {
    render_field field; /* vertex-centred */
    int value_count;
    const double *values; /* isovalues */
    const float *colours; /* value_count × 3, linear; used if colour_map is NULL */
    /* used if colour_map is set: vertex- or cell-centred, with values on every part that has the surface; its ranges
     * are not read */
    render_field colour_field;
    const render_transfer *colour_map;
    float opacity; /* 0 .. 1; 1 ends the ray */
    render_material material;
    render_normal normal;
    double difference; /* h of central differences, > 0, in sizes of the hit's cell (cube root of its box's volume) */
    const render_vertex_gradients *gradients; /* for RENDER_VERTEX: part by part */
    const render_lines *lines;                /* NULL: none */
    float edge_width; /* pixels, of lines along edges between vertices that lie in the surface; 0: none. Cells are tets
                         of three such vertices or pyramids on four */
    float edge_colour[3]; /* linear */
    /* the surface is a face of each of its cells, which are below the isovalue elsewhere: a ray that meets the face
     * only in an edge, and so is in the cell for no length, hits it too */
    bool is_of_faces;
    uint32_t clips; /* the job's clips that cut it, one bit each */
    /* for rays from hits (render_light.h): a cell that is met nearer to the hit than this many sizes of the cell does
     * not block; 0: every cell blocks */
    float contact;
} render_surface_layer;

typedef struct render_volume_layer {
    render_field field;
    const render_transfer *transfer;
} render_volume_layer;

/* Rounding may move a value at an end of the range by this share of the colour table's length. */
#define RENDER_END 4e-6f

/* Linear grey of surfaces where their colour field is NaN: a scene's colour of 0.6 in float. */
#define RENDER_NO_COLOUR 0.318546802f

/* A mesh of this rank. */
typedef struct render_part {
    const grid *cells;
    const mmbvh *tree; /* over cells; it has the space's origin and scale */
    /* Loops of vertices, for layers with edges. If loops[cell] is 0, every edge between the cell's vertices in the
     * surface is drawn; else the cell is one triangle of a polygon, whose corner count is at loops[loops[cell]] and
     * whose corners follow. NULL: there are no polygons. */
    const int64_t *loops;
} render_part;

/* How tiles of 16 x 16 rays find their visible cells. The picture is the same to the last bit; only the speed differs.
 * Pictures by segments may differ by the order of segments that begin at the same t, by 5e-7 at most. */
typedef enum render_traversal {
    /* isosurfaces and a single volume: one traversal for the whole picture, and cells are binned by tile, unless too
     * many are visible; several volumes as by RENDER_TILES */
    RENDER_BINNED,
    RENDER_TILES /* one traversal per tile */
} render_traversal;

/* The method that integrates volumes: samples (thesis, 4.4), whose error depends on the step, or segments, which are
 * exact if the field is linear along the ray (tets) and of second order in the pieces of other cells. Segments of
 * several volumes need separate_samples: without it several volumes are sampled. */
typedef enum render_integration { RENDER_SAMPLES, RENDER_SEGMENTS } render_integration;

/* Error allowed to mixed segments if the job gives no max_error. */
#define RENDER_MIXING_ERROR 1e-4

typedef enum render_clip_kind { RENDER_CLIP_PLANE, RENDER_CLIP_BOX, RENDER_CLIP_SPHERE } render_clip_kind;

/* A half space, box or sphere that clips layers: only what lies inside it is drawn, or outside it if is_outside is
 * set. */
typedef struct render_clip {
    render_clip_kind kind;
    bool is_outside;
    double normal[3], distance; /* plane: normal . position <= distance; world, any length but 0 */
    double lower[3], upper[3];  /* box */
    double centre[3], radius;   /* sphere */
} render_clip;

/* What hits are painted with: their colours, lit or not; or numbers of the pixel's nearest surface as red, green and
 * blue. With numbers, surfaces must be opaque and there must be no volumes. */
typedef enum render_paint {
    RENDER_LIGHT,
    RENDER_UNLIT,   /* of surfaces that take light, colours before it falls on them; in the place of t_out and
                       transmittance the normal, from which render_light_fragment() makes those of RENDER_LIGHT
                       (render_light.h) */
    RENDER_NORMALS, /* the unit normal that light falls on, towards the eye, in world axes */
    RENDER_VALUES   /* the value that colours the surface, or where none does its isovalue; and the number of the
                       isovalue among the job's */
} render_paint;

/* The shadows and ambient occlusion of hits painted RENDER_UNLIT: render_light.h. */
typedef struct render_occlusion {
    uint32_t lights; /* lights that cast shadows, one bit each */
    int samples;     /* for ambient occlusion: number of rays per hit, 0 .. 64; 0: none */
    double radius;   /* for ambient occlusion: distance beyond which surfaces do not block; scene units, > 0 */
} render_occlusion;

typedef struct render_job {
    render_camera camera;
    render_space space;
    const render_part *parts;
    int part_count;
    const mmbvh *parent; /* over the parts' boxes (mmbvh_build_boxes); NULL: all parts are traversed */
    const render_surface_layer *surfaces;
    int surface_count; /* isovalues of all surface layers together: at most RENDER_MAX_ISOVALUES */
    render_paint paint;
    const render_occlusion *occlusion; /* for RENDER_UNLIT */
    /* NULL: RENDER_DIFFERENCES are computed at once; else its hits are added to the list instead of becoming fragments,
     * except those of polyhedra. Not with RENDER_VALUES */
    render_waiting *waiting;
    render_traversal traversal;
    const render_volume_layer *volumes;
    int volume_count;
    int clip_count;           /* at most RENDER_MAX_CLIPS */
    const render_clip *clips; /* layers have sets of them, with bit i for clips[i] */
    uint32_t volume_clips;    /* clips of all volumes */
    const render_light *lights;
    int light_count;
    double step; /* distance between samples, scene units, > 0; volumes only */
    render_integration integration;
    /* for segments: > 0: cells other than tets are cut so that no channel of a pixel errs by more, in linear light; 0:
     * into parts no longer than step */
    double max_error;
    /* with max_error: upper bound of the length of rays in the cells of all ranks, in scene units; the same on all
     * ranks, so that all cut alike. 0: the bound for this rank's cells */
    double extent;
    /* samples of a ray that are looked up together, 1 .. RENDER_MAX_GROUP: N of the thesis's sample position packets
     * (4.4.1) */
    int sample_group;
    bool jitter;   /* the offset of a ray's first sample is a hash of pixel and frame; else 1/2 */
    int frame;     /* 0 .. : number of the accumulated frame */
    bool is_alone; /* no other rank holds cells: all samples of a ray may go into one fragment */
    /* Pixels to trace (pixel_set.h); NULL: all. */
    const unsigned char *pixels;
    /* every sample of every cell and volume becomes a fragment of length 0, every segment one or several fragments that
     * compositing can mix */
    bool separate_samples;
    /* the fragments of a volume, of which there is one, are the fold of this rank's samples or segments
     * (fragment_fold.h); not with separate_samples */
    bool reproducible;
    int threads; /* >= 1; 0: OpenMP's default */
} render_job;

typedef struct render_statistics {
    int64_t rays; /* number of rays traced: one per pixel */
    int64_t map_failures;
    int64_t volume_cells; /* cells that tiles transformed for volumes, counted once per tile and window of depth */
    double surface_ms, volume_ms;
} render_statistics;

/* Returns the offset in [0, 1) of a pixel's samples in a frame. */
double render_jitter(uint32_t pixel, uint32_t frame);

/* Intervals of visible values: a cell whose range, rounded to float, meets none of them is invisible. For a transfer
 * function they are the ranges that are not transparent; returns their number, at most RENDER_MAX_INTERVALS. */
mmbvh_interval render_isovalue_interval(double value);
int render_visible_intervals(const render_transfer *t, mmbvh_interval out[RENDER_MAX_INTERVALS]);

/* Traces every pixel of the camera against this rank's parts and appends the fragments to out (memory from memory.h;
 * freed by the caller with base_free(out->items)). Parallel over tiles. statistics may be NULL. */
insitu_status render_frame(const render_job *job, fragment_list *out, render_statistics *statistics, base_error *error);

/* Draws as render_frame() does, but passes the fragments to take() tile by tile. Every pixel of the camera lies in one
 * of the tiles; tiles without fragments are passed too. take() is called by as many threads as the job has. */
insitu_status render_frame_tiles(const render_job *job, fragment_taker *take, void *state,
                                 render_statistics *statistics, base_error *error);

/* Returns the instruction set in use: "avx512", "avx2", "sse4.2" or "plain". INSITU_ISA in the environment may select a
 * lower one than the machine's best; a name that is unknown or not available is ignored, and render_isa_warning()
 * returns a message. */
const char *render_isa(void);
const char *render_isa_warning(void);

/* A box around a rank's cells that may matter to hits of other ranks. Ranks exchange these boxes to find the ranks that
 * a hit needs. Scene units; empty if lower > upper. */
typedef struct render_box {
    double lower[3], upper[3];
} render_box;

#endif
