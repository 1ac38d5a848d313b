/* The contents of a scene file: the images to draw, when to draw them, and the files to write them to. An image is an
 * entry of the file's `images`; a picture is one result of drawing an image in a step. The file is YAML text and is
 * read by a schema; docs/scene.md is generated from the same schema. Colours in the file are sRGB in [0, 1]; colours in
 * these structs are linear. */
#ifndef SCENE_SCENE_H
#define SCENE_SCENE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "error.h"
#include "scene_expression.h"

typedef enum scene_sampling_method { SCENE_SAMPLES, SCENE_SEGMENTS } scene_sampling_method;
/* Whether each cell is drawn with its own cell or corner values, or with their means at vertices. */
typedef enum scene_interpolation { SCENE_BY_CELL, SCENE_BY_VERTEX } scene_interpolation;

/* The scalar that is computed from a field: its magnitude, or its component n. SCENE_COMPONENT_DEFAULT is component 0
 * if the field has one component, and otherwise the magnitude. SCENE_COMPONENT_ONLY is component 0 of a field that must
 * not have other components. */
enum { SCENE_COMPONENT_ONLY = -3, SCENE_COMPONENT_DEFAULT = -2, SCENE_COMPONENT_MAGNITUDE = -1 };

/* A field that a layer shows, with the meshes on which it is shown. */
typedef struct scene_field {
    char *name;
    int component; /* index of the component, or one of the constants SCENE_COMPONENT_* */
    /* set if cell values are averaged to the vertices; otherwise each cell is drawn with its constant value */
    bool at_vertices;
    /* For a field with a value at each corner of each cell: set if the values of all corners at a vertex are replaced
     * by their mean. Otherwise cells may have different values at a common vertex. */
    bool joins_corners;
    bool is_as_given; /* set if hanging vertices keep the caller's values instead of interpolated ones */
    int line;         /* line in the scene file, for messages about the field */
    int mesh_count;   /* number of names in `meshes`; 0: the field is shown on all meshes that have it */
    char **meshes;    /* names of meshes; the name "a" also selects meshes whose names begin with "a/" */
    int meshes_line;  /* line of `meshes` in the scene file, for messages */
    /* hash of the set of meshes over which values are averaged at vertices; set by the session (session_mesh_groups.h)
     */
    uint64_t mesh_group_name;
} scene_field;

/* Returns whether the field's list of meshes (scene_field.meshes) selects the mesh of this name. The mesh may
 * nevertheless lack the field. */
bool scene_field_selects_mesh(const scene_field *field, const char *mesh);
/* Returns whether a name in a scene selects the mesh. It does so if it is the mesh's whole name, or the part of the
 * mesh's name before a slash. */
bool scene_name_selects_mesh(const char *name, const char *mesh);

/* The kind of a derived field. All kinds except SCENE_EXPRESSION are computed from gradients at vertices. */
typedef enum scene_derivation {
    SCENE_EXPRESSION,
    SCENE_GRADIENT_OF,
    SCENE_DIVERGENCE,
    SCENE_VORTICITY,
    SCENE_Q_CRITERION,
    SCENE_LAMBDA2,
    SCENE_STRAIN_RATE
} scene_derivation;

enum { SCENE_MAX_DERIVED = 64 };

/* A field that the session derives from other fields. */
typedef struct scene_derived {
    char *name;
    int line; /* line in the scene file, for messages */
    scene_derivation kind;
    /* key of the scene file by which the field is computed, such as "gradient", for messages; "" for an expression
     * without a key */
    const char *key;
    /* component of a gradient or vorticity; SCENE_COMPONENT_DEFAULT: all three components */
    int component;
    scene_expression expression; /* program of an expression; its inputs are `inputs` below */
    int input_count;
    /* fields from which the field is computed: for an expression its inputs; for a gradient a scalar; for other kinds a
     * vector field, or its two or three components */
    scene_field *inputs;
    /* for each input: its index among the scene's derived fields, or -1 if it is a field of the caller */
    int *derived_indices;
    /* hash of the set of meshes over which gradients are averaged; set by the session (session_mesh_groups.h) */
    uint64_t mesh_group_name;
} scene_derived;

/* How a range that is not fixed is computed, in each step that draws, from the values on all ranks. */
typedef enum scene_range_source {
    SCENE_RANGE_DATA, /* the minimum and the maximum of the values */
    /* the minimum and the maximum over all steps drawn so far; they are kept in a file across restarts
     * (session_run_ranges.h) */
    SCENE_RANGE_RUN,
    SCENE_RANGE_SYMMETRIC,  /* from -m to m, where m is the largest absolute value */
    SCENE_RANGE_PERCENTILES /* the values that `low` and `high` percent of the cells do not exceed */
} scene_range_source;

typedef struct scene_range {
    bool is_fixed; /* set if the scene gives low and high as values of the field */
    double low, high;
    scene_range_source source; /* how the range is computed; used unless is_fixed is set */
} scene_range;

/* The scale by which values are mapped to positions in a colour map: linear; logarithmic; or, for values of both signs,
 * linear up to a threshold and logarithmic beyond it (render_scaled() in render.h). */
typedef enum scene_scale { SCENE_LINEAR, SCENE_LOG, SCENE_SYMLOG } scene_scale;

/* A colour map converts a value into a colour, for all kinds of layers. The position of a value is (s(value) - s(low))
 * / (s(high) - s(low)), where s is the scale and [low, high] the range. Positions below 0 and above 1 have the colours
 * of 0 and 1, or the colours in outside_colours. The colour of a position is interpolated linearly between entries of
 * the table; with bands it is the colour of entry floor(position × count). */
typedef struct scene_colour_map {
    char *name; /* name of a built-in map, or path of a file with a map; "" for a list of colours */
    int count;  /* number of colours: at least 2, or at least 1 for bands */
    /* table of colours: count × 3 numbers in linear light, evenly spaced over the positions from 0 to 1, in reversed
     * order already if the scene requests that */
    float *colours;
    bool is_banded; /* set if each colour belongs to a band and colours are not interpolated; bands have equal widths */
    scene_scale scale;
    double threshold;          /* SCENE_SYMLOG is linear from -threshold to threshold; > 0 */
    bool has_below, has_above; /* set if the scene gives a colour for values below, or above, the range */
    /* colours of values below the range, of values above it (by default the colours of the map's ends), and of NaN */
    float outside_colours[3][3];
    bool has_nan; /* set if the scene gives a colour for NaN */
    scene_range range;
} scene_colour_map;

/* A file that the scene names, and its content. */
typedef struct scene_attachment {
    char *path, *text; /* path of the file, and its `size` bytes of text, without a terminating NUL */
    int64_t size;
} scene_attachment;

/* Files that a scene names. One rank reads these files while it parses the scene, and sends them to the other ranks
 * together with the scene. */
typedef struct scene_attachments {
    /* callback that reads a whole file into *text, allocated by base_alloc(); NULL: only the files in `items` are
     * available */
    insitu_status (*read)(const char *path, char **text, int64_t *size, base_error *error);
    int count;
    scene_attachment *items;
} scene_attachments;

enum { SCENE_MAX_ATTACHMENTS = 64 };
void scene_attachments_free(scene_attachments *attachments);

typedef struct scene_opacity_point {
    /* position in the range, 0 .. 1, in ascending order; the opacity jumps where two positions are equal */
    double position;
    float opacity; /* opacity at this position, 0 .. 1, of a layer of thickness unit_distance */
} scene_opacity_point;

typedef struct scene_material {
    float ambient, diffuse, specular, shininess;
} scene_material;

enum { SCENE_MAX_LINES = 64 };

/* Contour lines on a layer's surface. */
typedef struct scene_lines {
    bool is_given; /* true: the layer has contour lines */
    scene_field field;
    /* set if the lines are contours of the field that colours the layer; otherwise of another field */
    bool is_of_colours;
    /* set if the scene gives the values of the lines; otherwise the lines divide a range into parts of equal width */
    bool has_values;
    int count;                          /* number of lines, 1 .. SCENE_MAX_LINES */
    double values[SCENE_MAX_LINES];     /* value of each line, in increasing order */
    float width;                        /* width of the lines in pixels */
    float colours[3 * SCENE_MAX_LINES]; /* colour of each line, linear RGB */
    /* set if only the lines are drawn and not the surface; if a field colours the surface, the lines get its colours */
    bool is_alone;
} scene_lines;

/* Returns the default width of contour lines, in pixels, in a picture of this height. */
float scene_get_default_line_width(int height);

/* How an isosurface's normals are computed: from the gradient in the crossed cell, from central differences between
 * samples of the field, or by interpolation between gradients at the cell's vertices. */
typedef enum scene_normal { SCENE_GRADIENT, SCENE_DIFFERENCES, SCENE_VERTEX } scene_normal;

typedef struct scene_isosurface {
    scene_field field;
    int value_count; /* number of isovalues, 1 .. 64 */
    double *values;
    /* one colour per isovalue, value_count × 3 numbers, linear RGB. If the scene gives colours, the final one is
     * repeated for further isovalues; otherwise the default cycle of colours is used */
    float *colours;
    bool has_colour_by;
    scene_field colour_by;
    scene_colour_map colour_map;
    scene_lines lines;
    float opacity;
    scene_material material;
    scene_normal normals;
    /* distance between the samples from which central differences are computed, in cell sizes, > 0; 1 by default */
    double difference;
    uint32_t clips; /* bit mask of the clips that cut the layer; bit n stands for clip n of the image */
    int number;     /* index of the layer in the image's list */
} scene_isosurface;

typedef struct scene_volume {
    scene_field field;
    scene_colour_map colour_map;
    int opacity_count; /* number of opacity points, 1 .. 32 */
    scene_opacity_point *opacity;
    /* thickness for which opacities are given, in scene units, > 0; 0: a twentieth of the diagonal of the bounds */
    double unit_distance;
    uint32_t clips; /* set of clips, one bit per clip of the image; it is the same for all volumes of the image */
} scene_volume;

/* Selects the cells whose values of a field lie between low and high. */
typedef struct scene_threshold {
    bool is_given; /* set if there is a threshold; otherwise all cells are drawn */
    scene_field field;
    double low, high; /* ends of the range of values; they may be infinite */
} scene_threshold;

typedef struct scene_surface {
    /* selects the meshes whose outer surface is drawn; only the names of meshes are used, and the field's name is
     * NULL */
    scene_field meshes_field;
    /* set if the session has added the layer to draw isosurfaces on meshes that consist only of shells (cells without a
     * volume); a scene file cannot set this */
    bool is_of_shells;
    float colour[3];      /* colour of the surface, linear RGB, unless a field colours it (has_colour_by) */
    float edge_width;     /* width of the edges in pixels; 0: no edges are drawn */
    float edge_colour[3]; /* colour of the edges, linear RGB */
    scene_threshold threshold;
    bool has_colour_by;
    scene_field colour_by;
    scene_colour_map colour_map;
    scene_lines lines;
    float opacity;
    bool has_material; /* true: the scene gives a material; false: two-dimensional data is drawn without lighting */
    scene_material material;
    uint32_t clips; /* set of clips that cut the layer: one bit per clip of the image */
    int number;     /* index of the layer in the image's list */
} scene_surface;

typedef struct scene_plane {
    double normal[3]; /* unit normal of the plane */
    /* set if the scene gives a point; otherwise the plane passes through the middle of the data's bounds */
    bool has_point;
    double point[3];
    double offset; /* distance from the point to the plane, along the normal */
    /* if has_point is not set: additional displacement along the normal, as a fraction of half the extent of the data
     * in this direction; -1 .. 1 */
    double extent_fraction;
} scene_plane;

enum { SCENE_MAX_PLANES = 64 };

typedef enum scene_clip_kind { SCENE_CLIP_PLANE, SCENE_CLIP_BOX, SCENE_CLIP_SPHERE } scene_clip_kind;
typedef enum scene_keep { SCENE_KEEP_INSIDE, SCENE_KEEP_OUTSIDE } scene_keep;

enum { SCENE_MAX_CLIPS = 32 };

/* SCENE_MAX_SURFACES: maximum number of isovalues, planes and outer surfaces of an image, all together.
 * SCENE_MAX_VOLUMES: maximum number of volumes of an image. */
enum { SCENE_MAX_SURFACES = 64, SCENE_MAX_VOLUMES = 4 };

/* A half space, box or sphere by which layers are clipped. The part of a layer outside of this body is cut away or, if
 * is_outside is set, the part inside of it. */
typedef struct scene_clip {
    scene_clip_kind kind;
    bool is_outside;
    scene_plane plane;         /* bounding plane of a half space; its normal points to the side that is cut away */
    double lower[3], upper[3]; /* lower and upper corner of a box */
    double centre[3], radius;  /* centre and radius (> 0) of a sphere */
} scene_clip;

typedef struct scene_slice {
    scene_field field;
    int plane_count; /* number of planes of the slice, 1 .. 64 */
    scene_plane *planes;
    scene_colour_map colour_map;
    scene_lines lines;
    float opacity;
    scene_material material; /* unlit by default, so that colours equal those of the map */
    uint32_t clips;          /* set of clips that cut the layer: one bit per clip of the image */
    int number;              /* index of the layer in the image's list */
} scene_slice;

typedef struct scene_light {
    double direction[3]; /* unit vector towards the light; in camera axes (right, up, backward) unless is_in_world */
    bool is_in_world;    /* set if the direction is in the axes of the scene */
    float colour[3];     /* linear RGB, multiplied by the light's intensity */
} scene_light;

/* Maximum number of circles of an orbit. */
enum { SCENE_MAX_ELEVATIONS = 32 };

/* Default distance between the samples of volumes, in cell sizes (scene_image.step_cells). */
#define SCENE_STEP_CELLS 0.5

/* Camera positions on circles around the data. Views are numbered circle by circle: view / view_count is the index of
 * the view's circle. */
typedef struct scene_orbit {
    int view_count;   /* number of views on each circle; 0: there is no orbit */
    double axis[3];   /* unit vector along the axis of the orbit */
    double start;     /* angle phi (scene_camera) of the first view on each circle, in degrees */
    int circle_count; /* number of circles, 1 .. SCENE_MAX_ELEVATIONS */
    /* elevation of each circle above the plane perpendicular to the axis, in degrees */
    double elevations[SCENE_MAX_ELEVATIONS];
} scene_orbit;

/* The position of a moving camera at a time or at a cycle. */
typedef struct scene_camera_point {
    double at; /* time or cycle (scene_camera.is_by_cycle) at which the camera has this position */
    double eye[3], focal[3], up[3], angle;
} scene_camera_point;

typedef struct scene_camera {
    /* set if eye and focal point are computed from the bounds of all data, with the camera looking along -direction */
    bool is_automatic;
    /* each is set if the scene gives the camera's key of this name (direction, up, fit, projection); keys that are
     * missing are chosen from the data if the data has no extent along an axis (session_camera.h) */
    bool has_direction, has_up, has_fit, has_projection;
    bool has_bounds; /* automatic camera: set if the bounds below replace those of the data */
    double lower[3], upper[3];
    double eye[3], focal[3];
    double direction[3]; /* automatic camera: direction from the focal point to the eye */
    double up[3];
    double angle; /* vertical angle of view in degrees; 40 by default */
    double zoom;  /* zoom of an automatic camera: 1 fits the bounds into the picture; larger values are closer */
    /* automatic camera: true: the box of the bounds is fitted into the frame; false: the sphere around this box is
     * fitted */
    bool fits_box;
    bool is_orthographic;
    /* orthographic camera: height of the visible region in scene units; 0: the height that a perspective camera would
     * show */
    double height;
    scene_orbit orbit;
    /* angles of an orbit's view in degrees: phi around the axis, theta above the plane perpendicular to it */
    double phi, theta;
    bool is_by_cycle;           /* set if the points of a moving camera are given by cycle; otherwise by time */
    int point_count;            /* number of points of a moving camera; 0: the camera does not move */
    scene_camera_point *points; /* points of a moving camera, in increasing order of cycle or time */
} scene_camera;

/* Returns the camera of a step. The position of a moving camera is interpolated between its points. */
scene_camera scene_compute_camera_at_time(const scene_camera *camera, int64_t cycle, double time);

/* Anchors in the picture; the values are those of insitu_anchor (image_output.h). */
typedef enum scene_anchor {
    SCENE_TOP_LEFT,
    SCENE_TOP,
    SCENE_TOP_RIGHT,
    SCENE_LEFT,
    SCENE_RIGHT,
    SCENE_BOTTOM_LEFT,
    SCENE_BOTTOM,
    SCENE_BOTTOM_RIGHT,
    SCENE_ANCHORS
} scene_anchor;

typedef struct scene_words {
    char *text;          /* text to draw, in which the placeholders {time}, {cycle} and {name} are replaced */
    scene_anchor anchor; /* edge or corner of the picture at which the text stands */
} scene_words;

/* The boxes that are outlined: one around all data, one per mesh, or one around the data of each rank. */
typedef enum scene_boxes { SCENE_NO_BOX, SCENE_BOX_OF_DATA, SCENE_BOXES_OF_MESHES, SCENE_BOXES_OF_RANKS } scene_boxes;

/* The format of numbers at colour bars: the shortest that distinguishes neighbouring ticks, fixed-point (0.25), or with
 * an exponent (2.5e-1). */
typedef enum scene_notation { SCENE_SHORTEST, SCENE_FIXED, SCENE_SCIENTIFIC } scene_notation;

typedef struct scene_number_form {
    scene_notation notation;
    /* set if the scene gives the number of digits; otherwise as many digits are written as are needed to distinguish
     * neighbouring ticks */
    bool has_digits;
    int digits; /* number of digits after the decimal point, 0 .. 12 */
} scene_number_form;

/* Titles, colour bars and lines that are drawn in addition to the data. */
typedef struct scene_decorations {
    bool is_given; /* set if the scene has decorations; otherwise none are drawn */
    char *title;   /* title of the picture; NULL: there is none */
    int words_count;
    scene_words *words;
    bool has_bars; /* set if a bar is drawn for each layer that is coloured by a field */
    scene_anchor bar_anchor;
    int tick_count; /* maximum number of ticks per bar; a bar with one band per integer may have more */
    int label_count;
    char **labels; /* labels of the bars, in order; further bars are labelled with the names of their fields */
    int unit_count;
    char **units; /* units of the bars, in order; a single one is used for all bars */
    scene_number_form number_form;
    scene_boxes outline;
    bool has_rulers, has_axes;
    bool has_scale_bar;
    char *scale_unit; /* unit of length of the scale bar; NULL: none */
    scene_anchor scale_bar_anchor;
    bool has_colour;
    /* colour of text and lines, linear RGB, if has_colour is set; otherwise they are light on a dark background and
     * dark on a light one */
    float colour[3];
    double size; /* height of text, as a fraction of the picture's height */
} scene_decorations;

typedef enum scene_format { SCENE_PNG8, SCENE_PNG16, SCENE_EXR } scene_format;

typedef struct scene_output {
    /* path of the file, with placeholders (scene_expand_placeholders()), relative to rank 0's working directory */
    char *path;
    /* format, chosen by the file name's ending; the key `bits: 16` selects SCENE_PNG16. EXR files contain float colours
     * and depth. */
    scene_format format;
    bool has_decorations; /* set if the image's decorations, if it has any, are drawn into this file */
    /* set if an EXR file also contains the normal and the value of the nearest surface, the index of its layer, and its
     * index within the layer */
    bool has_data;
    bool is_deep; /* set for an EXR file with all samples of each pixel, in order of depth */
    int database; /* index of the scene's database that lists the picture in its table; -1: none */
    /* number of leading bytes of `path` that are the database's folder and its slash; 0 if there is no database */
    int folder_bytes;
    /* number of columns and rows of pictures in one file; 0: the picture is an inset or has its own file */
    int columns, rows;
    /* set if colour bars are drawn once beside the pictures, provided that all pictures of the file have the same
     * bars */
    bool shares_bars;
    bool is_inset;       /* set if the picture is laid over the panels of a montage */
    scene_anchor corner; /* corner of an inset */
    int montage;         /* index of the scene's montage that contains the picture; -1: none */
    /* index of the panel that shows the first view of the output; for an inset, the number of panels (columns × rows)
     */
    int first_panel;
} scene_output;

/* A rectangle of a file in pixels: (x, y) is its upper left corner. */
typedef struct scene_rectangle {
    int x, y, width, height;
} scene_rectangle;

/* A file that contains several pictures (panels) side by side, and insets over their corners. */
typedef struct scene_montage {
    char *name; /* path of the file, expanded for a sample cycle and time; pictures with this path belong to the montage
                 */
    int columns, rows;
    int width, height; /* size of each picture in pixels */
    scene_format format;
    int panel_count;  /* number of panels that have a picture, at most columns × rows */
    bool shares_bars; /* set if colour bars that all pictures have in common are drawn once, beside the pictures */
    int bar_width;    /* width in pixels of the strip for shared bars; 0 if shares_bars is not set */
    /* set if the strip for shared colour bars is left of the pictures, otherwise it is right of them */
    bool are_bars_left;
    int frame_width; /* width in pixels of the frames of insets */
    /* distance in pixels of an inset from the outer edges of the panels, including the width of its frame */
    int inset_margin;
    /* rectangle of the inset at each corner (scene_anchor), without its frame; width 0: there is no inset. No two
     * insets overlap. */
    scene_rectangle insets[SCENE_ANCHORS];
} scene_montage;

/* A Cinema database by Spec D: a folder of pictures, and a table that describes them. */
typedef struct scene_database {
    char *path;      /* path of the folder, relative to rank 0's working directory, without a slash at its end */
    int first_image; /* index, in the scene file, of the first image whose pictures are in the database */
    /* has_images is set if the table has a column for the name of the image; the others, likewise for the angles of an
     * orbit, the isovalue, the plane and the field */
    bool has_images, has_orbits, has_isovalues, has_planes, has_fields;
} scene_database;

typedef enum scene_statistic { SCENE_MINIMUM, SCENE_MAXIMUM, SCENE_MEAN } scene_statistic;

/* A condition on a statistic of a field: the statistic must be greater than `above` and less than `below`. */
typedef struct scene_condition {
    bool is_given; /* set if there is a condition; otherwise it always holds */
    scene_field field;
    scene_statistic statistic;
    double above, below; /* bounds of the statistic; they may be infinite */
} scene_condition;

/* Statistics of a field that are written to a file, one line per step. */
typedef struct scene_statistics {
    scene_field field;
    char *path;         /* path of the file, relative to rank 0's working directory */
    int cycle_interval; /* the statistics are written at cycles that are multiples of this number */
    int bin_count;      /* number of the histogram's bins; 0: there is no histogram */
    double low, high;   /* range of values that the bins divide; low > high: the range of the step's values */
} scene_statistics;

/* Identifies one of the pictures that an image of the scene file makes. There is one picture for each combination of a
 * field, an isovalue and a plane of the image's sweep and a view of its orbit, in this order, so that views change
 * fastest. Each picture has its own scene_image. */
typedef struct scene_variant {
    int source; /* index of the image in the file */
    /* index of the picture's combination of field, isovalue and plane among all combinations of the sweep; 0 without a
     * sweep */
    int layers;
    /* indices of the picture's field, isovalue and plane in the lists of the sweep; 0 if the sweep has no such list */
    int field, isovalue, plane;
    /* index of the view. Pictures with the same `source` and `layers` differ only in their view and camera. Pictures
     * with a view above 0 share the data that the picture with view 0 owns. */
    int view;
} scene_variant;

typedef struct scene_image {
    char *name; /* name of the image, the same for all its variants */
    int line;   /* line of the image in the scene file, for messages */
    scene_variant variant;
    bool has_isovalue; /* set if the sweep selects the isovalue */
    double isovalue;
    bool has_plane;    /* set if the sweep selects the plane */
    char *swept_field; /* the field that the sweep selects; NULL if the sweep has no fields */
    int width, height; /* size of the picture in pixels, 1 .. 32768; 1280 × 720 by default */
    scene_camera camera;
    float background[4]; /* background colour: linear premultiplied RGBA */
    int isosurface_count;
    scene_isosurface *isosurfaces;
    int volume_count;
    scene_volume *volumes;
    int surface_count;
    scene_surface *surfaces;
    int slice_count;
    scene_slice *slices;
    scene_decorations decorations;
    int clip_count; /* number of clips of all layers together, 0 .. SCENE_MAX_CLIPS, without duplicates */
    scene_clip *clips;
    uint32_t clips_of_all; /* bit mask of the clips that cut all layers; bit n stands for entry n of `clips` */
    bool has_lights;       /* set if the scene gives lights */
    /* number of lights, 1 .. 8; if the scene gives none, there are a default key light and fill light */
    int light_count;
    scene_light *lights;
    uint32_t shadows; /* bit mask of the lights that cast shadows; 0 by default */
    /* number of rays for ambient occlusion per hit, 1 .. 64; 0 (default): no ambient occlusion */
    int occlusion_samples;
    double occlusion_radius; /* length of occlusion rays in scene units; 0: chosen from the data's bounds */
    /* method for volumes: samples along each ray, or integration over segments into which the ray's interval in each
     * cell is divided; by default segments for one volume, samples for several */
    scene_sampling_method method;
    /* method segments: allowed error of a colour channel, in linear light; 0: the error has no bound and depends on
     * `step`. The default for one volume is 0.01. */
    double max_error;
    bool has_default_samples; /* set if several volumes are sampled because the scene does not specify the method */
    double step;              /* distance between samples in scene units; 0: step_cells is used */
    /* distance between samples in mean cell sizes, where the size of a cell is the cube root of its volume */
    double step_cells;
    bool jitter;          /* whether samples are offset randomly per pixel; true by default */
    bool is_reproducible; /* whether the picture of volumes must be bit-identical for any partition */
    int frames;           /* number of frames that are averaged, 1 .. 4096, a multiple of antialias; 1 by default */
    /* number of sample positions in a pixel, which successive frames use in turn: 1 (default), 2, 4, 8 or 16. Without
     * volumes, only pixels at edges get more than one frame. */
    int antialias;
    double max_seconds; /* upper bound of the estimated time for samples, in seconds; 3600 by default */
    int output_count;   /* number of output files; 0: the picture is only passed to the caller in memory */
    scene_output *outputs;
    int cycle_interval;        /* the image is drawn at cycles that are multiples of this number; 1 by default */
    double time_interval;      /* if > 0, the image is instead drawn whenever the time passes a multiple of this */
    scene_condition condition; /* the image is drawn only if this condition holds */
    bool is_drawn_once;        /* set if the image is drawn only in the first step in which it is due */
} scene_image;

/* The kinds of layers. */
typedef enum scene_layer_kind { SCENE_ISOSURFACE, SCENE_VOLUME, SCENE_SLICE, SCENE_SURFACE } scene_layer_kind;

typedef enum scene_field_role {
    SCENE_SHOWN,    /* the field of which the layer is made */
    SCENE_COLOURS,  /* a field that colours a surface */
    SCENE_LINES,    /* a field whose contour lines are drawn on a surface */
    SCENE_THRESHOLD /* a field that selects cells */
} scene_field_role;

/* Iterator over the fields that an image's layers use. Layers are visited in the order of scene_layer_kind, and the
 * fields of each layer in the order of scene_field_role. */
typedef struct scene_field_walk {
    const scene_image *image;
    int position; /* position of the next field; used only by scene_find_next_field_of_layers() */
    scene_layer_kind kind;
    scene_field_role role; /* role of the most recently returned field */
} scene_field_walk;

/* Returns the next field, or NULL after the last one. Only `image` must be set when an iteration begins. */
scene_field *scene_find_next_field_of_layers(scene_field_walk *walk);
/* Returns the word for a kind of layer, such as "isosurface", for messages. */
const char *scene_get_layer_word(scene_layer_kind kind);

/* Returns whether this is the first of the pictures (scene_variant) that an image of the scene file makes. Results that
 * all these pictures share are stored with the first one. */
static inline bool scene_is_first_variant(const scene_image *image)
{
    return image->variant.layers == 0 && image->variant.view == 0;
}

/* Returns whether text is drawn into pictures of the image. */
static inline bool scene_draws_text(const scene_image *image)
{
    const scene_decorations *d = &image->decorations;
    bool is_decorated = false;
    for (int i = 0; i < image->output_count; i++)
        is_decorated = is_decorated || (image->outputs[i].has_decorations && !image->outputs[i].is_deep);
    return is_decorated && d->is_given &&
           (d->title || d->words_count || d->has_bars || d->has_rulers || d->has_axes || d->has_scale_bar);
}

/* The cells over which bounding volume hierarchies (trees) are built. SCENE_TREE_FULL: all cells; SCENE_TREE_PARTIAL:
 * only cells that images can show; SCENE_TREE_AUTO: whichever of these two is estimated to cost less time. */
typedef enum scene_tree { SCENE_TREE_AUTO, SCENE_TREE_FULL, SCENE_TREE_PARTIAL } scene_tree;

/* The order in which ranks exchange fragments for blending; the constants are those of comp_schedule. */
typedef enum scene_schedule {
    SCENE_SCHEDULE_AUTO,
    SCENE_SCHEDULE_DIRECT,
    SCENE_SCHEDULE_NODES,
    SCENE_SCHEDULE_RADIX,
    SCENE_SCHEDULE_BINARY
} scene_schedule;

/* When pictures are written: by a thread while the simulation continues, or before the step ends. */
typedef enum scene_writing { SCENE_WRITE_BEHIND, SCENE_WRITE_IN_STEP } scene_writing;

/* Default of scene.finer_memory, in MiB. */
enum { SCENE_FINER_MEMORY = 4096 };
/* Default of scene.surface_error, in pixels. */
#define SCENE_SURFACE_ERROR 0.25

/* Maximum number of images of a scene file (session_events.h has one bit for each), and of pictures that they make in a
 * step. */
enum { SCENE_MAX_IMAGES = 64, SCENE_MAX_PICTURES = 1024 };
enum { SCENE_MAX_STATISTICS = 64 }; /* maximum number of statistics that a scene file writes to files */

/* A named number in the scene that the simulation can read (insitu_parameter()). */
typedef struct scene_parameter {
    char *name;
    double value;
} scene_parameter;

/* A request to draw the vertices of meshes at x + scale * u, where x is the position of a vertex, and u is the value of
 * a field at this vertex. */
typedef struct scene_warp {
    /* name of a mesh, or the common beginning of several meshes' names, as in a layer's list of meshes
     * (scene_name_selects_mesh()) */
    char *mesh;
    char *field;          /* name of the field of displacements */
    double scale;         /* factor by which displacements are multiplied */
    int line, field_line; /* lines of the mesh's name and of the field in the scene file */
} scene_warp;

/* A request to draw meshes together with their mirror images. */
typedef struct scene_mirror {
    /* name of a mesh, or the common beginning of several meshes' names, as in a layer's list of meshes */
    char *mesh;
    int axes;         /* bit i is set if the mesh is mirrored along axis i; at least one bit is set */
    double planes[3]; /* position of the mirror plane on each of these axes */
    int line;         /* line of the mesh's name in the scene file */
} scene_mirror;

typedef struct scene {
    int derived_count;      /* number of derived fields, 0 .. SCENE_MAX_DERIVED */
    scene_derived *derived; /* derived fields; each comes after those from which it is derived */
    int threads;            /* number of threads per rank; 0: the node's cores divided by its number of ranks */
    /* number of linear pieces along an edge between two nodes of a cell of higher order, 1 .. 12; 0: the number is
     * chosen by surface_error */
    int finer_pieces;
    double surface_error;        /* bound of the error of these pieces in pixels, > 0; used if finer_pieces is 0 */
    bool is_surface_error_given; /* set if the scene file has the bound; otherwise it is the default */
    double finer_memory;         /* memory that finer pieces may take on all ranks together, in MiB, > 0 */
    scene_tree tree;
    scene_schedule schedule;
    scene_writing writing;
    int image_count; /* number of images including their variants, 1 .. SCENE_MAX_PICTURES */
    scene_image *images;
    int database_count;
    scene_database *databases;
    int montage_count;
    scene_montage *montages;
    int statistics_count; /* number of statistics that are written to files, 0 .. SCENE_MAX_STATISTICS */
    scene_statistics *statistics;
    int parameter_count; /* number of parameters, 0 .. 64; their names differ */
    scene_parameter *parameters;
    int warp_count; /* number of warps, 0 .. 64; the names of their meshes differ */
    scene_warp *warps;
    int mirror_count; /* number of mirrors, 0 .. 64; the names of their meshes differ */
    scene_mirror *mirrors;
} scene;

/* Parses a scene text of `size` bytes. file_name is used in messages; paths in the scene are relative to its folder.
 * Files that the scene names are read and added to *attachments; NULL: the scene may not name files. On an error *out
 * is zeroed, and the message has the form "file:line: key: what is wrong, what was expected". */
insitu_status scene_parse(const char *text, size_t size, const char *file_name, scene_attachments *attachments,
                          scene *out, base_error *error);

void scene_free(scene *s);

/* Returns the parameter of this name, or NULL if the scene has none. */
const scene_parameter *scene_find_parameter(const scene *s, const char *name);
/* Writes the end of a message about an unknown parameter: the name that was probably meant, and the names of all
 * parameters. */
void scene_describe_parameter_names(const scene *s, const char *name, char *words, size_t size);

/* Returns the index of the field among the scene's derived fields; -1 if it is not derived. */
int scene_find_derived(const scene *s, const char *name);

/* Returns the warp of the mesh of this name, or NULL if the mesh is not warped. If several entries select the mesh, the
 * one with the longest name is used. */
const scene_warp *scene_find_warp(const scene *s, const char *mesh);
/* Returns the mirror of the mesh of this name, or NULL if the mesh is not mirrored. If several entries select the mesh,
 * the one with the longest name is used. */
const scene_mirror *scene_find_mirror(const scene *s, const char *mesh);

/* The values by which placeholders in texts and paths, such as {cycle}, are replaced. */
typedef struct scene_placeholder_values {
    const char *name; /* name of the image */
    long long cycle;
    double time;
    int view, plane;
    double isovalue;
    const char *field; /* name of the field that the sweep selects; NULL if there is no sweep of fields */
} scene_placeholder_values;

scene_placeholder_values scene_make_placeholder_values(const scene_image *image, int64_t cycle, double time);

/* Returns the pattern with its placeholders replaced. The placeholders {cycle}, {view} and {plane} may have a format
 * such as {cycle:0N}, and {time} and {isovalue} a format such as {time:.Nf} (or e or g instead of f). {name} and
 * {field} have no format. Numbers have a decimal point in any locale. The result is allocated by base_alloc(); NULL if
 * memory ran out. */
char *scene_expand_placeholders(const char *pattern, const scene_placeholder_values *moment);

#endif
