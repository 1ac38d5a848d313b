/* Draws this rank's cells as fragments (fragment.h): defines the camera, the layers and the job of a frame, and
 * declares the functions that draw the frame. They do not use MPI. "The thesis" in comments is the thesis that first
 * described the method (docs/development/architecture.md).
 *
 * A ray through pixel (x, y) is p(z) = eye + offset + z (forward + slope), where z is the depth along the camera's
 * axis: perspective cameras have the slope, orthographic ones the offset. In all files of render/ the ray's parameter
 * is t = (z - depth_origin) * scale, so that float32 t has its resolution where the cells are. Samples of a volume lie
 * at distances (k + jitter) * step from the eye (perspective) or the eye's plane (orthographic), k = 0, 1, ...
 *
 * The result of a frame depends only on the cells and the job. It does not depend on the rank that holds a cell, the
 * order of the cells, the trees, or the number of threads.
 *
 * If cells overlap, each contributes its own sample. If several cells or several volumes have a sample at one position,
 * the light that they absorb together is divided among them in proportion to what each would absorb alone. A rank
 * cannot know which cells of other ranks overlap its own. If cells of one rank overlap, its frame therefore keeps the
 * sample of one of these cells, and marks the ray by a second fragment at the same depth. Compositing finds the pixels
 * in which fragments of any ranks overlap (comp.h), and these are traced again with separate_samples, which leaves the
 * sharing to compositing. Until then the result in such pixels is undefined. Volumes that are integrated by segments
 * (RENDER_SEGMENTS) work the same way: where cells overlap, each cell's segments become separate fragments. Segments of
 * several volumes become separate fragments on all pixels.
 *
 * Faces that coincide but whose coordinates or depths are not bit-identical, as at hanging nodes, leave overlaps and
 * gaps of the size of rounding. Segments whose overlap is that small are not reported to compositing: each has its own
 * length, and the sum of lengths is the same on any partition. A sample in such an overlap marks its ray. Separate
 * samples are flagged if they are near an end of the ray's interval in their cell, so that compositing can distinguish
 * such an overlap by rounding from cells that really overlap. */
#ifndef RENDER_RENDER_H
#define RENDER_RENDER_H

#include "error.h"
#include "fragment.h"
#include "grid.h"
#include "insitu/status.h"
#include "mmbvh.h"

typedef struct render_camera {
    double eye[3];
    /* camera axes in world coordinates: orthonormal and right-handed, right × up = -forward */
    double right[3], up[3], forward[3];
    /* perspective: tangent of half the vertical angle of view; orthographic: half the picture's height in scene
     * units */
    double half_height;
    bool is_orthographic;
    int width, height;
    /* offset of every ray from its pixel's centre, in pixels, positive to the right and down; 0 by default */
    double offset[2];
} render_camera;

/* Computes the offset from a pixel's centre, in pixels, of sample k of `count` (1, 2, 4, 8 or 16) samples in the pixel.
 * Along either axis the samples are evenly spaced, and their mean is the pixel's centre. */
void render_camera_sample(int count, int k, double offset[2]);

/* Sets up a camera at the position `eye` that looks at the position `focal`. vertical_degrees: the whole vertical
 * angle, in (0, 180). Returns false if eye equals focal, or up is parallel to the line of sight. */
bool render_camera_look_at(render_camera *camera, const double eye[3], const double focal[3], const double up[3],
                           double vertical_degrees, int width, int height);

/* Computes the ray through pixel (x, y), at its centre plus the offset: p(z) = base + z * direction, z >= 0. The
 * component of direction along forward is 1, so its length is 1 or more. */
void render_camera_ray(const render_camera *camera, int x, int y, double base[3], double direction[3]);

/* The coordinate space of float32 positions. World positions are taken relative to origin and multiplied by scale, a
 * power of two that brings the scene to a size near 1. The trees use the same origin and scale. */
typedef struct render_space {
    double origin[3];
    double scale;
    double depth_origin; /* depth z from the eye's plane, in scene units, at which the ray parameter t is 0 */
} render_space;

/* The spacing of values along a colour table: linear, logarithmic (for which low > 0), or symmetric logarithmic
 * (render_scaled()). */
typedef enum render_scale { RENDER_LINEAR, RENDER_LOG, RENDER_SYMLOG } render_scale;

/* render_scaled() returns s(value), where s is the monotone function that belongs to the scale. render_unscaled() is
 * its inverse: it returns the value for which s(value) = scaled. RENDER_LINEAR: s(value) = value. RENDER_LOG: s(value)
 * = ln value, -infinity if value <= 0. RENDER_SYMLOG: s(value) = value / threshold for |value| <= threshold (> 0); 1 +
 * ln(value / threshold) above, and the negative mirror image below, so that s and its slope are continuous. */
double render_scaled(render_scale scale, double threshold, double value);
double render_unscaled(render_scale scale, double threshold, double scaled);

/* Colour and opacity as functions of a value. The position of a value in the colour table is (s(value) - s(low)) /
 * (s(high) - s(low)), where s is the function of the scale (render_scaled()).
 *
 * The colour table has linear RGB colours at evenly spaced positions from 0 to 1. Between two entries, colours are
 * interpolated linearly by position; in volumes with a logarithmic or symlog scale, linearly by value. Positions below
 * 0 and above 1 get the first and the last colour.
 *
 * The opacity is given at points of increasing value. Two points of the same value make a step. Between two points, the
 * opacity is interpolated linearly by position; before the first and behind the last point it is constant. With a
 * logarithmic or symlog scale the points must lie between low and high. An opacity is that of a path of length
 * unit_distance: extinction = -ln(1 - opacity) / unit_distance. */
typedef struct render_transfer {
    double low, high;
    int colour_count;     /* number of entries in the colour table, >= 2 */
    const float *colours; /* colour table: colour_count × 3 numbers, linear RGB */
    render_scale scale;
    double threshold; /* end of the linear part of RENDER_SYMLOG, > 0; unused by other scales */
    /* For surfaces only: the positions from 0 to 1 are divided into colour_count bands of equal width, each with one
     * colour of the table; colours are not interpolated. colour_count may then be 1. */
    bool is_banded;
    /* For surfaces only: the colours of values below low, above high, and of NaN, 3 numbers each. A value that is
     * outside the range by no more than the rounding error RENDER_END still counts as inside. NULL: values outside get
     * the colours of low and high, and NaN gets RENDER_NO_COLOUR. */
    const float *outside;
    /* number of opacity points, 1 .. RENDER_MAX_OPACITY_POINTS; 0 for surfaces, whose transfer functions have no
     * opacity */
    int opacity_count;
    const double *opacity_values;
    const float *opacities;
    double unit_distance; /* length to which opacities refer, in scene units, > 0 */
} render_transfer;

enum { RENDER_MAX_OPACITY_POINTS = 32, RENDER_MAX_ISOVALUES = 64, RENDER_MAX_VOLUMES = 4, RENDER_MAX_LIGHTS = 8 };
enum { RENDER_MAX_LINES = 64 };
enum { RENDER_MAX_GROUP = 64 };
enum { RENDER_MAX_CLIPS = 32 };
enum { RENDER_MAX_INTERVALS = RENDER_MAX_OPACITY_POINTS / 2 + 2 };

typedef struct render_light {
    double direction[3]; /* unit vector from the surface towards the light, in world axes */
    float colour[3];     /* linear RGB, multiplied by the light's intensity */
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

/* One field on all mesh parts of a job: fields[i] has the values on parts[i], and ranges[i] has the range of values in
 * each node of the tree of parts[i]. If ranges[i].low is NULL, the field does not exist on parts[i]. */
typedef struct render_field {
    const grid_field *fields;
    const mmbvh_ranges *ranges;
} render_field;

typedef enum render_normal {
    RENDER_GRADIENT, /* the field's gradient in the cell that contains the hit */
    /* Central differences of the field (thesis, section 4.3.4). The difference is one-sided if one of its two samples
     * lies in no cell. If neither lies in a cell, the gradient in the hit's cell is used along this axis. Samples come
     * from this rank's cells, or, if the job has a list `waiting`, from those of all ranks. */
    RENDER_DIFFERENCES,
    RENDER_VERTEX /* gradients that the caller gives at the vertices, interpolated in the hit's cell like values */
} render_normal;

enum { RENDER_DIFFERENCE_SAMPLES = 6 };

/* A hit with a normal from RENDER_DIFFERENCES that needs samples of other ranks (render_differences.h). It takes 16
 * bytes. */
typedef struct render_pending_hit {
    uint32_t pixel, kind; /* pixel and kind of the fragment that will be made of the hit */
    /* t: ray parameter at the hit; reach: distance from the hit to each of its six samples, which lie before and behind
     * it along the three world axes; both in scaled units (render_space) */
    float t, reach;
} render_pending_hit;

/* A growing list of pending hits. items and shadings are arrays with `count` entries, one per hit, and with space for
 * `capacity` entries; they are allocated by memory.h. */
typedef struct render_pending_list {
    render_pending_hit *items;
    /* shadings[i][0]: gradient of the field in the cell of hit i, in camera axes; shadings[i][1]: unlit colour of hit
     * i, linear RGB */
    float (*shadings)[2][3];
    int64_t count, capacity;
} render_pending_list;

/* The six samples around a hit, in the order: before and behind it along the first world axis, then along the second
 * and the third. The struct takes 32 bytes. */
typedef struct render_difference_samples {
    uint32_t found, unused; /* found: one bit per sample, set if some cell contains the sample's point */
    float values[RENDER_DIFFERENCE_SAMPLES];
} render_difference_samples;

/* Value of `transmittance` that marks the placeholder fragments of pending hits while a frame is traced. */
#define RENDER_PENDING_TRANSMITTANCE 2.0f

/* Gradients of a surface layer's field at the vertices of one mesh part; they need not be unit vectors. Every vertex of
 * a cell that one of the layer's isovalues crosses has a gradient. */
typedef struct render_vertex_gradients {
    /* for each vertex, the index of its entry in `gradients`, or -1 if it has no gradient; NULL if no isovalue crosses
     * a cell of the part */
    const int32_t *entries;
    const float (*gradients)[3]; /* gradients in world axes */
} render_vertex_gradients;

/* Contour lines on a surface. The line's colour replaces the hit's colour, before lighting, in proportion to the share
 * of the pixel that the line covers. Lines that are less than two line widths apart fade. */
typedef struct render_lines {
    /* The field whose contours are drawn, vertex-centred. It must have values (or NaN) on every part that has the
     * surface; its ranges are not used. */
    render_field field;
    int count;            /* number of lines, 1 .. RENDER_MAX_LINES */
    const double *values; /* value of the field on each line, in increasing order */
    float width;          /* width of the lines in pixels, > 0 */
    /* colour of each line: count × 3 numbers, linear RGB; NULL: lines have the surface's own colour */
    const float *colours;
    /* Only the lines of the surface are drawn: hits beside them are discarded. If the surface is transparent, a hit's
     * opacity is the layer's times the share of the pixel that a line covers. The material must not take light. */
    bool is_alone;
} render_lines;

typedef struct render_surface_layer {
    render_field field; /* the field whose isosurfaces are drawn; vertex-centred */
    int value_count;
    const double *values; /* isovalues of the surface */
    const float *colours; /* colour of each isovalue: value_count × 3 numbers, linear RGB; used if colour_map is NULL */
    /* The field that colours the surface if colour_map is set: vertex- or cell-centred, with values on every part that
     * has the surface. Its ranges are not used. */
    render_field colour_field;
    const render_transfer *colour_map;
    float opacity; /* opacity of the surface, 0 .. 1; at 1 it ends the ray */
    render_material material;
    render_normal normal;
    /* distance h between the two samples of a central difference, which lie h / 2 before and behind the hit; > 0, in
     * units of the size of the hit's cell (the cube root of its bounding box's volume) */
    double difference;
    const render_vertex_gradients *gradients; /* gradients at the vertices of each part; used by RENDER_VERTEX */
    const render_lines *lines;                /* contour lines on the surface; NULL if there are none */
    /* Width in pixels of lines along cell edges whose two vertices lie in the surface; 0: no lines. Cells must be tets
     * with three such vertices or pyramids with four. */
    float edge_width;
    float edge_colour[3]; /* colour of these edges, linear RGB */
    /* Set if the surface consists of faces of its cells; the rest of each cell is below the isovalue. A ray that meets
     * such a face only in an edge, so that its interval in the cell has length zero, then also hits the surface. */
    bool is_of_faces;
    uint32_t clips; /* clips of the job that cut the surface: bit i stands for clips[i] */
    /* Used for shadows and ambient occlusion, whose rays begin at hits (render_light.h). A ray's crossing of this
     * surface does not occlude the hit if it is closer to the hit than `contact` times the size of the crossed cell
     * (the cube root of its bounding box's volume). 0: every crossing occludes. */
    float contact;
} render_surface_layer;

typedef struct render_volume_layer {
    render_field field;
    const render_transfer *transfer;
} render_volume_layer;

/* Upper bound of the distance by which rounding may move a value that is at an end of the colour table's range, as a
 * fraction of the table's length. */
#define RENDER_END 4e-6f

/* Linear grey level of surfaces at points at which their colour field is NaN. It is the sRGB colour 0.6 in float. */
#define RENDER_NO_COLOUR 0.318546802f

/* A mesh of this rank, which is one part of the scene. */
typedef struct render_part {
    const grid *cells;
    const mmbvh *tree; /* min-max tree over the cells, in the coordinates of the job's space */
    /* Vertex loops of polygons, for layers with edge lines. If loops[cell] is 0, all edges of the cell whose two
     * vertices lie in the surface are drawn. Otherwise the cell's face in the surface is one of the faces into which a
     * polygon was divided, and only the polygon's edges are drawn. The entries from loops[loops[cell]] on describe the
     * polygon: the number of vertices around the polygon, the number of segments into which each of its edges is
     * divided, and the vertices in cyclic order, beginning with a corner. NULL: the mesh has no polygons. */
    const int64_t *loops;
} render_part;

/* The method by which tiles of 16 x 16 rays find their visible cells. The picture is bit-identical with both; only the
 * speed differs. The only exception is a volume that is integrated by segments: its colours may differ by 5e-7, because
 * segments that begin at the same t may be blended in a different order. */
typedef enum render_traversal {
    /* One traversal finds the cells of isosurfaces and of a single volume for the whole picture, and bins them by tile.
     * If too many cells are visible, or the job has several volumes, tiles traverse the trees as with RENDER_TILES. */
    RENDER_BINNED,
    RENDER_TILES /* each tile traverses the trees */
} render_traversal;

/* The method that integrates volumes. RENDER_SAMPLES sums samples (thesis, 4.4); the error depends on the step.
 * RENDER_SEGMENTS divides a ray's interval in each cell into segments with a linear field. It is exact in tets, in
 * which the field is linear, and of second order in the segments' length in other cells. Segments of several volumes
 * need separate_samples; without it, several volumes are sampled. */
typedef enum render_integration { RENDER_SAMPLES, RENDER_SEGMENTS } render_integration;

/* Largest error of a colour, in linear light, that is allowed where compositing mixes overlapping segments; used if the
 * job gives no max_error. */
#define RENDER_MIXING_ERROR 1e-4

typedef enum render_clip_kind { RENDER_CLIP_PLANE, RENDER_CLIP_BOX, RENDER_CLIP_SPHERE } render_clip_kind;

/* A half space, box or sphere that clips layers. Only the parts of a layer inside it are drawn, or only the parts
 * outside it if is_outside is set. */
typedef struct render_clip {
    render_clip_kind kind;
    bool is_outside;
    /* for RENDER_CLIP_PLANE: the half space normal . position <= distance, in world coordinates; the normal may have
     * any length but 0 */
    double normal[3], distance;
    double lower[3], upper[3]; /* opposite corners of a box, in world coordinates */
    double centre[3], radius;  /* centre and radius of a sphere, in world coordinates */
} render_clip;

/* The contents of the fragments of hits: lit or unlit colours, or, in place of red, green and blue, numbers that
 * describe the pixel's nearest surface (RENDER_NORMALS, RENDER_VALUES). With such numbers, all surfaces must be opaque
 * and there must be no volumes. */
typedef enum render_paint {
    RENDER_LIGHT,
    /* Fragments of surfaces that take light contain the unlit colour, and the surface's normal in place of t_out and
     * transmittance. render_light_fragment() later computes from them the fragments that RENDER_LIGHT would have given
     * (render_light.h). */
    RENDER_UNLIT,
    RENDER_NORMALS, /* the unit normal in world axes, on the side of the surface that faces the eye */
    /* the value of the colour field, or the isovalue if the layer has no colour field; and the isovalue's index among
     * all isovalues of the job */
    RENDER_VALUES
} render_paint;

/* Parameters of shadows and ambient occlusion, for hits painted RENDER_UNLIT (render_light.h). */
typedef struct render_occlusion {
    uint32_t lights; /* lights that cast shadows: bit i stands for lights[i] */
    int samples;     /* number of rays per hit for ambient occlusion, 0 .. 64; 0: no ambient occlusion */
    /* distance beyond which surfaces do not occlude a hit's rays into the hemisphere; scene units, > 0 */
    double radius;
} render_occlusion;

typedef struct render_job {
    render_camera camera;
    render_space space;
    const render_part *parts;
    int part_count;
    /* tree over the parts' bounding boxes (mmbvh_build_boxes); NULL: all parts are traversed one by one */
    const mmbvh *parent;
    const render_surface_layer *surfaces;
    /* number of surface layers; all of them together may have at most RENDER_MAX_ISOVALUES isovalues */
    int surface_count;
    render_paint paint;
    const render_occlusion *occlusion; /* shadows and ambient occlusion; used by RENDER_UNLIT */
    /* NULL: normals by RENDER_DIFFERENCES are computed at once from this rank's cells. Otherwise such hits, except
     * those of polyhedra, are added to this list instead of becoming fragments. Not allowed with RENDER_VALUES. */
    render_pending_list *waiting;
    /* used to light pending hits: for each surface layer, minimum and maximum of its field over all ranks; minimum >
     * maximum if no rank has the field */
    double (*waiting_ranges)[2];
    render_traversal traversal;
    const render_volume_layer *volumes;
    int volume_count;
    int clip_count;           /* number of clips, at most RENDER_MAX_CLIPS */
    const render_clip *clips; /* the clips; layers refer to them by bit sets, in which bit i stands for clips[i] */
    uint32_t volume_clips;    /* clips that cut all volumes: bit i stands for clips[i] */
    const render_light *lights;
    int light_count;
    double step; /* distance between the samples of volumes, in scene units, > 0 */
    render_integration integration;
    /* Error bound for RENDER_SEGMENTS. > 0: intervals in cells other than tets are divided into so many segments that
     * no channel of a pixel errs by more than this, in linear light. 0: they are divided into segments no longer than
     * `step`. */
    double max_error;
    /* Upper bound of the length of a ray inside the cells of all ranks together, in scene units; used with max_error.
     * It must be the same on all ranks, so that all of them divide intervals into the same segments. 0: the bound for
     * this rank's cells is used. */
    double extent;
    /* number of consecutive samples of a ray whose cells are searched for together, 1 .. RENDER_MAX_GROUP: the N of the
     * thesis's sample position packets (section 4.4.1) */
    int sample_group;
    /* Set if a ray's first sample is displaced by a hash of pixel and frame, between 0 and 1 steps (render_jitter());
     * otherwise it is displaced by half a step. */
    bool jitter;
    int frame;     /* number of this frame among those that are averaged, from 0 on */
    bool is_alone; /* Set if no other rank holds cells: all samples of a ray may then be blended into one fragment. */
    /* Set of the pixels to trace (pixel_set.h); NULL: all pixels. */
    const unsigned char *pixels;
    /* Set if samples and segments are not blended by this rank but passed on, so that compositing can mix those of
     * overlapping cells and of several volumes. Each sample then becomes a fragment of length 0, and each segment one
     * or several fragments. */
    bool separate_samples;
    /* Set if this rank's samples or segments are folded (blended in the fixed order of fragment_fold.h), so that the
     * picture is bit-identical for any partition of the mesh. There must be only one volume. Not allowed with
     * separate_samples. */
    bool reproducible;
    int threads; /* number of threads, >= 1; 0: OpenMP's default */
} render_job;

typedef struct render_statistics {
    int64_t rays; /* number of traced rays, one per pixel */
    /* number of points at which a cell's map from reference coordinates to positions could not be inverted */
    int64_t map_failures;
    /* number of cells that were transformed into tile space for volumes; a tile is traced in several ranges of depth
     * (windows), and a cell counts once for each tile and window in which it is transformed */
    int64_t volume_cells;
    double surface_ms, volume_ms;
} render_statistics;

/* Returns the distance of the first sample on a pixel's ray from the eye (orthographic: from the eye's plane), in
 * steps, in [0, 1). It is a hash of the pixel's index and the frame's number. */
double render_jitter(uint32_t pixel, uint32_t frame);

/* Compute intervals of visible values: a cell is invisible if its range of values, rounded to float, overlaps none of
 * them. render_isovalue_interval() returns the interval of an isovalue. render_visible_intervals() computes the
 * intervals in which a transfer function is not transparent, and returns their number, at most RENDER_MAX_INTERVALS. */
mmbvh_interval render_isovalue_interval(double value);
int render_visible_intervals(const render_transfer *t, mmbvh_interval out[RENDER_MAX_INTERVALS]);

/* Traces the camera's pixels (all, or the set job->pixels) through this rank's mesh parts, and appends the fragments to
 * *out. The caller must free them with base_free(out->items). Tiles are traced in parallel. statistics may be NULL. */
insitu_status render_frame(const render_job *job, fragment_list *out, render_statistics *statistics, base_error *error);

/* Draws as render_frame() does, but passes the fragments to take() tile by tile. Every pixel of the camera lies in one
 * of the tiles; tiles without fragments are passed too. take() is called by as many threads as the job has. */
insitu_status render_frame_tiles(const render_job *job, fragment_callback *take, void *state,
                                 render_statistics *statistics, base_error *error);

/* Returns the instruction set in use: "avx512", "avx2", "sse4.2" or "plain". INSITU_ISA in the environment may select a
 * lower one than the machine's best; a name that is unknown or not available is ignored. In that case
 * render_isa_warning() returns a message, otherwise an empty string. */
const char *render_isa(void);
const char *render_isa_warning(void);

/* A bounding box, in scene units, of those cells of a rank that may affect hits of other ranks. Ranks exchange these
 * boxes to find which ranks' cells a hit's normal or light depends on. The box is empty if lower > upper. */
typedef struct render_box {
    double lower[3], upper[3];
} render_box;

#endif
