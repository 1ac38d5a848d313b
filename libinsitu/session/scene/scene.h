/* The contents of a scene file: the images to draw, when to draw them, and the files to write them to. The file is YAML
 * text and is read by a schema; docs/scene.md is generated from the same schema. Colours in the file are sRGB in [0,
 * 1]; colours in these structs are linear. */
#ifndef SCENE_SCENE_H
#define SCENE_SCENE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "error.h"
#include "scene_expression.h"

typedef enum scene_sampling_method { SCENE_SAMPLES, SCENE_SEGMENTS } scene_sampling_method;
typedef enum scene_interpolation { SCENE_BY_CELL, SCENE_BY_VERTEX } scene_interpolation;

/* The scalar that is taken from a field: its magnitude, or its component n. SCENE_COMPONENT_DEFAULT is component 0 if
 * the field has one component, else the magnitude. SCENE_COMPONENT_ONLY is component 0 of a field that must have no
 * other component. */
enum { SCENE_COMPONENT_ONLY = -3, SCENE_COMPONENT_DEFAULT = -2, SCENE_COMPONENT_MAGNITUDE = -1 };

/* A field that a layer shows, with the meshes on which it is shown. */
typedef struct scene_field {
    char *name;
    int component;      /* 0 .., or one of the above */
    bool at_vertices;   /* cell values are recentred to the vertices; else they are drawn as they are */
    bool joins_corners; /* values at cells' corners give way to their means at the vertices */
    bool is_as_given;   /* hanging vertices keep the values that they were given */
    int line;           /* line in the scene file, for messages about the field */
    int mesh_count;     /* 0: on the meshes that have the field */
    char **meshes;      /* a name stands for the meshes below it too: "a" for "a/0" */
    int meshes_line;    /* for messages about them */
    uint64_t joined;    /* a hash of the meshes that means at vertices are over; the session's (session_joints.h) */
} scene_field;

/* Checks whether the layer is drawn on a mesh of this name, if the mesh has the field. */
bool scene_field_is_on(const scene_field *field, const char *mesh);
/* Checks whether the name stands for the mesh. */
bool scene_name_stands_for(const char *name, const char *mesh);

/* The kind of a derived field. All kinds after the expression are computed from gradients at vertices. */
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
    int line;
    scene_derivation kind;
    const char *key;             /* key in the scene file, for messages; "" for an expression without one */
    int component;               /* component of a gradient or vorticity; SCENE_COMPONENT_DEFAULT: all three */
    scene_expression expression; /* its inputs are those below */
    int input_count;
    scene_field *inputs; /* an expression's inputs; otherwise a vector field, its two or three components, or for a
                            gradient a scalar */
    int *made_by;        /* for each input, the index of the derived field it comes from, or -1 */
    uint64_t joined;     /* as scene_field.joined, of meshes that gradients are over; the session's */
} scene_derived;

/* The source of a range that is not fixed. Each source uses the values on all ranks at each drawn step. */
typedef enum scene_range_source {
    SCENE_RANGE_DATA, /* the minimum and the maximum */
    /* minimum and maximum over all steps drawn so far, kept in a file across restarts (session_run_ranges.h) */
    SCENE_RANGE_RUN,
    SCENE_RANGE_SYMMETRIC,  /* from -m to m, where m is the largest absolute value */
    SCENE_RANGE_PERCENTILES /* the values that `low` and `high` percent of the cells do not exceed */
} scene_range_source;

typedef struct scene_range {
    bool is_fixed; /* low and high are values of the field */
    double low, high;
    scene_range_source source; /* used unless is_fixed */
} scene_range;

/* The scale by which values are spaced along a colour map: linear; logarithmic; or, for values of both signs, linear up
 * to a threshold and logarithmic beyond it (see render_scaled() in render.h, which uses the same terms). */
typedef enum scene_scale { SCENE_LINEAR, SCENE_LOG, SCENE_SYMLOG } scene_scale;

/* A colour map converts a value into a colour, for all kinds of layers. The position of a value is (s(value) - s(low))
 * / (s(high) - s(low)), s being the scale and [low, high] the range. Positions below 0 and above 1 have the colours of
 * 0 and 1, or the colours in `outside`. The colour of a position is interpolated linearly between entries of the table;
 * with bands it is the colour of entry floor(position × count). */
typedef struct scene_colour_map {
    char *name;     /* name of a built-in map or path of a map file; "" for a list of colours */
    int count;      /* at least 2 colours, or 1 for bands */
    float *colours; /* count × 3, linear light, evenly spaced over the places from 0 to 1; reversed where asked for */
    bool is_banded; /* the colours are those of bands of equal width */
    scene_scale scale;
    double threshold; /* the linear part of SCENE_SYMLOG reaches from -threshold to threshold; > 0 */
    bool has_below, has_above;
    float outside[3][3]; /* colours below and above the range (by default the map's ends), and of NaN */
    bool has_nan;
    scene_range range;
} scene_colour_map;

/* A file that the scene names, with the path by which it is opened. */
typedef struct scene_attachment {
    char *path, *text; /* text: size bytes, without a terminating NUL */
    int64_t size;
} scene_attachment;

/* Files that a scene names. One rank reads these files while it parses the scene, and sends them to the other ranks
 * together with the scene. */
typedef struct scene_attachments {
    /* Reads a whole file into *text, allocated with base_alloc(). NULL: only the files in items are available. */
    insitu_status (*read)(const char *path, char **text, int64_t *size, base_error *error);
    int count;
    scene_attachment *items;
} scene_attachments;

enum { SCENE_MAX_ATTACHMENTS = 64 };
void scene_attachments_free(scene_attachments *attachments);

typedef struct scene_opacity_point {
    double at;     /* position in the range, 0 .. 1, not decreasing; two equal positions make a step */
    float opacity; /* 0 .. 1, per unit_distance */
} scene_opacity_point;

typedef struct scene_material {
    float ambient, diffuse, specular, shininess;
} scene_material;

enum { SCENE_MAX_LINES = 64 };

/* Contour lines on a layer's surface. */
typedef struct scene_lines {
    bool is_given; /* else there are none */
    scene_field field;
    bool is_of_colours;                 /* the field is that of the layer's colours */
    bool has_values;                    /* else they cut a range into parts of equal width */
    int count;                          /* 1 .. SCENE_MAX_LINES */
    double values[SCENE_MAX_LINES];     /* rising */
    float width;                        /* pixels */
    float colours[3 * SCENE_MAX_LINES]; /* of each line, linear */
    bool is_alone; /* nothing else is seen of the surface; its own colours are the lines' if a field colours it */
} scene_lines;

/* The width of lines where the scene gives none, in a picture of this height. */
float scene_line_width(int height);

typedef enum scene_normal { SCENE_GRADIENT, SCENE_DIFFERENCES, SCENE_VERTEX } scene_normal;

typedef struct scene_isosurface {
    scene_field field;
    int value_count; /* 1 .. 64 */
    double *values;
    /* value_count × 3, linear: the given colours, the last one repeated; or colours of the default cycle */
    float *colours;
    bool has_colour_by;
    scene_field colour_by;
    scene_colour_map colour_map;
    scene_lines lines;
    float opacity;
    scene_material material;
    scene_normal normals;
    double difference; /* distance of the differences in cell sizes, > 0; 1 by default */
    uint32_t clips;    /* set of the image's clips, one bit each */
    int number;        /* index in the image's list of layers */
} scene_isosurface;

typedef struct scene_volume {
    scene_field field;
    scene_colour_map colour_map;
    int opacity_count; /* 1 .. 32 */
    scene_opacity_point *opacity;
    double unit_distance; /* > 0; 0: a twentieth of the diagonal of the bounds */
    uint32_t clips;       /* set of the image's clips, the same for all its volumes */
} scene_volume;

/* The cells in which the values of a field lie from low to high. */
typedef struct scene_threshold {
    bool is_given; /* else all cells are drawn */
    scene_field field;
    double low, high; /* may be infinite */
} scene_threshold;

typedef struct scene_surface {
    scene_field on;    /* the meshes; no field: name is NULL */
    bool is_of_shells; /* on meshes of shells alone; never of the file */
    float colour[3];   /* linear */
    float edge_width;  /* pixels; 0: no edges are drawn */
    float edge_colour[3];
    scene_threshold threshold;
    bool has_colour_by;
    scene_field colour_by;
    scene_colour_map colour_map;
    scene_lines lines;
    float opacity;
    bool has_material; /* without a material, flat data is drawn without lighting */
    scene_material material;
    uint32_t clips; /* set of the image's clips, one bit each */
    int number;     /* index in the image's list of layers */
} scene_surface;

typedef struct scene_plane {
    double normal[3]; /* unit length */
    bool has_point;   /* else it goes by the middle of the data's bounds */
    double point[3];
    double offset; /* distance along the normal from the point to the plane */
    double share; /* without a point: moved by this share of half the data's extent along the normal besides; -1 .. 1 */
} scene_plane;

enum { SCENE_MAX_PLANES = 64 };

typedef enum scene_clip_kind { SCENE_CLIP_PLANE, SCENE_CLIP_BOX, SCENE_CLIP_SPHERE } scene_clip_kind;
typedef enum scene_keep { SCENE_KEEP_INSIDE, SCENE_KEEP_OUTSIDE } scene_keep;

enum { SCENE_MAX_CLIPS = 32 };

/* Most surfaces of an image (isovalues, planes and outer surfaces together), and most volumes. */
enum { SCENE_MAX_SURFACES = 64, SCENE_MAX_VOLUMES = 4 };

/* A half space, box or sphere: everything outside it is cut away, or, with is_outside, everything inside it. */
typedef struct scene_clip {
    scene_clip_kind kind;
    bool is_outside;
    scene_plane plane; /* its normal points to the side that is cut away */
    double lower[3], upper[3];
    double centre[3], radius; /* > 0 */
} scene_clip;

typedef struct scene_slice {
    scene_field field;
    int plane_count; /* 1 .. 64 */
    scene_plane *planes;
    scene_colour_map colour_map;
    scene_lines lines;
    float opacity;
    scene_material material; /* unlit by default: the colours are exactly those of the map */
    uint32_t clips;          /* set of the image's clips, one bit each */
    int number;              /* index in the image's list of layers */
} scene_slice;

typedef struct scene_light {
    double direction[3]; /* towards the light; in camera axes (right, up, backward) unless in_world; unit length */
    bool in_world;
    float colour[3]; /* linear, multiplied by the intensity */
} scene_light;

/* Camera positions on circles around the data, numbered circle by circle: view / view_count is the index of the
 * circle. */
enum { SCENE_MAX_ELEVATIONS = 32 };

/* The default of step_cells. */
#define SCENE_STEP_CELLS 0.5
typedef struct scene_orbit {
    int view_count;                          /* views on each circle; 0: there is no orbit */
    double axis[3];                          /* unit length */
    double start;                            /* in degrees: the angle phi of the first view of each circle */
    int circle_count;                        /* 1 .. SCENE_MAX_ELEVATIONS */
    double elevations[SCENE_MAX_ELEVATIONS]; /* in degrees above the plane perpendicular to the axis */
} scene_orbit;

/* The position of a moving camera at a time or at a cycle. */
typedef struct scene_camera_point {
    double at;
    double eye[3], focal[3], up[3], angle;
} scene_camera_point;

typedef struct scene_camera {
    bool is_automatic; /* eye and focal are derived from the global bounds, and the camera looks along -direction */
    /* Keys that the scene gives; if the data is flat, the other ones are chosen from the data (session_camera.h). */
    bool has_direction, has_up, has_fit, has_projection;
    bool has_bounds; /* automatic: the bounds below replace those of the data */
    double lower[3], upper[3];
    double eye[3], focal[3];
    double direction[3]; /* automatic: direction from the focal point to the eye */
    double up[3];
    double angle;  /* vertical angle of view in degrees; 40 by default */
    double zoom;   /* automatic: 1 fits the bounds into the picture; larger values are closer */
    bool fits_box; /* automatic: the box of the bounds fills the frame; else the sphere around the box does */
    bool is_orthographic;
    /* orthographic: height of the visible region in scene units; 0: the same height as with a perspective camera */
    double height;
    scene_orbit orbit;
    double phi, theta; /* angles of an orbit's view in degrees: around the axis, and above the plane across it */
    bool is_by_cycle;  /* points are at cycles, else at times */
    int point_count;   /* 0: the camera does not move */
    scene_camera_point *points; /* rising */
} scene_camera;

/* Returns the camera of a step: the position of a moving camera is interpolated between its points. */
scene_camera scene_camera_at(const scene_camera *camera, int64_t cycle, double time);

/* Positions in the picture, the same as insitu_anchor (image_output.h). */
typedef enum scene_anchor {
    SCENE_TOP_LEFT,
    SCENE_TOP,
    SCENE_TOP_RIGHT,
    SCENE_LEFT,
    SCENE_RIGHT,
    SCENE_BOTTOM_LEFT,
    SCENE_BOTTOM,
    SCENE_BOTTOM_RIGHT
} scene_anchor;

typedef struct scene_words {
    char *text; /* the placeholders {time}, {cycle} and {name} are replaced */
    scene_anchor at;
} scene_words;

/* Words, bars and lines that are drawn beside the data. */
/* Boxes around all data, around each mesh, or around the data of each rank. */
typedef enum scene_boxes { SCENE_NO_BOX, SCENE_BOX_OF_DATA, SCENE_BOXES_OF_MESHES, SCENE_BOXES_OF_RANKS } scene_boxes;

/* The format of numbers at colour bars: the shortest that distinguishes neighbours, or all as 0.25, or all as
 * 2.5e-1. */
typedef enum scene_notation { SCENE_SHORTEST, SCENE_FIXED, SCENE_SCIENTIFIC } scene_notation;

typedef struct scene_number_form {
    scene_notation notation;
    bool has_digits; /* else as many digits as distinguish neighbours */
    int digits;      /* 0 .. 12, behind the decimal point */
} scene_number_form;

typedef struct scene_decorations {
    bool is_given; /* else no decorations are drawn */
    char *title;   /* NULL: none */
    int words_count;
    scene_words *words;
    bool has_bars; /* a bar for each layer that is coloured by a field */
    scene_anchor bars_at;
    int tick_count; /* approximate number of ticks per bar */
    int label_count;
    char **labels; /* one label a bar, in order; further bars are called by their fields */
    int unit_count;
    char **units; /* one unit a bar, in order; a single one holds for all bars */
    scene_number_form numbers;
    scene_boxes outline;
    bool has_rulers, has_axes;
    bool has_scale_bar;
    char *scale_unit; /* NULL: none */
    scene_anchor scale_at;
    bool has_colour;
    float colour[3]; /* linear; where has_colour is not set, light on a dark background and dark on a light one */
    double size;     /* height of words, as a share of the picture's height */
} scene_decorations;

typedef enum scene_format { SCENE_PNG8, SCENE_PNG16, SCENE_EXR } scene_format;

typedef struct scene_output {
    char *path;           /* with placeholders (scene_expand()); relative to the working directory of rank 0 */
    scene_format format;  /* by the ending; bits: 16 makes SCENE_PNG16. EXR holds float colour and depth */
    bool has_decorations; /* the image's decorations are drawn, if it has any */
    bool has_data;        /* an EXR also holds the nearest surface's normal, value and numbers */
    bool is_deep;         /* an EXR of all that lies behind each other in a pixel */
    int database;         /* index of the scene's, in which the picture is a line; -1: none */
    int folder_bytes;     /* bytes of path that are the database's folder and its slash; 0 without a database */
    int columns, rows;    /* of pictures side by side; 0: the picture has a file of its own */
    int montage;          /* index of the scene's; -1: none */
    int first_cell;       /* of the first view */
} scene_output;

/* A file of pictures side by side. */
typedef struct scene_montage {
    char *name; /* by which pictures belong together: the path as it comes out at one cycle and time */
    int columns, rows;
    int width, height; /* of each picture */
    scene_format format;
    int cell_count; /* of pictures in a step, at most columns × rows */
} scene_montage;

/* A Cinema database of Spec D: a folder of pictures, and a table of what they show. */
typedef struct scene_database {
    char *path;      /* the folder, relative to the working directory of rank 0; no slash at its end */
    int first_image; /* the source of the first image in it */
    bool has_images, has_orbits, has_isovalues, has_planes, has_fields; /* the table has this column */
} scene_database;

typedef enum scene_statistic { SCENE_MINIMUM, SCENE_MAXIMUM, SCENE_MEAN } scene_statistic;

/* The condition that a statistic of a field lies above one bound and below another. */
typedef struct scene_condition {
    bool is_given; /* else the condition always holds */
    scene_field field;
    scene_statistic of;
    double above, below; /* may be infinite */
} scene_condition;

/* Statistics of a field that are written to a file, one line per step. */
typedef struct scene_statistics {
    scene_field field;
    char *path;       /* relative to the working directory of rank 0 */
    int every;        /* written at cycles that are multiples of it */
    int bin_count;    /* bins of the histogram; 0: there is no histogram */
    double low, high; /* range of the bins; low > high: the range of the values */
} scene_statistics;

/* An image of the file makes a picture for each field, isovalue and plane of its sweep and each view of its orbit: in
 * this order, views running fastest. Each is a scene_image. */
typedef struct scene_variant {
    int source;                 /* which image of the file */
    int layers;                 /* counts the fields, isovalues and planes of a source through; 0 without a sweep */
    int field, isovalue, plane; /* which of the sweep's; 0 where there is none */
    int view; /* pictures of the same source and layers differ in this and the camera alone: those after view 0 point
               * to what that one owns */
} scene_variant;

typedef struct scene_image {
    char *name; /* the same for all variants */
    int line;
    scene_variant variant;
    bool has_isovalue; /* the sweep sets the isovalue */
    double isovalue;
    bool has_plane;    /* the sweep sets the plane */
    char *swept_field; /* NULL: the sweep has no fields */
    int width, height; /* 1 .. 32768; 1280 × 720 by default */
    scene_camera camera;
    float background[4]; /* linear premultiplied RGBA */
    int isosurface_count;
    scene_isosurface *isosurfaces;
    int volume_count;
    scene_volume *volumes;
    int surface_count;
    scene_surface *surfaces;
    int slice_count;
    scene_slice *slices;
    scene_decorations decorations;
    int clip_count; /* 0 .. SCENE_MAX_CLIPS, without duplicates */
    scene_clip *clips;
    uint32_t clips_of_all; /* set of the clips that cut all layers, one bit each */
    bool has_lights;       /* the scene gives lights */
    int light_count;       /* 1 .. 8; a default head light and fill light if the scene gives none */
    scene_light *lights;
    uint32_t shadows;             /* lights that cast some, a bit each; 0 by default */
    int occlusion_samples;        /* rays of ambient occlusion, 1 .. 64; 0 (default): none */
    double occlusion_radius;      /* how far they go, in scene units; 0: by the bounds */
    scene_sampling_method method; /* default: one volume by segments, several by samples */
    double max_error; /* error bound of segments in a linear colour channel; 0: by step; default for one volume: 0.01 */
    bool has_default_samples; /* several volumes are sampled because the scene does not say how */
    double step;              /* sample distance in scene units; 0: by step_cells */
    double step_cells;        /* in mean cell sizes: a cell's is the cube root of its volume */
    bool jitter;              /* true by default */
    bool is_reproducible;     /* volumes to the last bit */
    int frames;               /* accumulated; a multiple of antialias; 1 by default, 1 .. 4096 */
    int antialias; /* places in a pixel that frames go through in turn: 1 (default), 2, 4, 8 or 16. Where there are no
                    * volumes only pixels at edges take more than one frame */
    double max_seconds; /* that samples may take by estimate; 3600 by default */
    int output_count;   /* 0: for memory alone */
    scene_output *outputs;
    int every;         /* the image is drawn at cycles that are multiples of this; 1 by default */
    double every_time; /* > 0: the image is drawn instead when the time passes a multiple of this */
    scene_condition when;
    bool once; /* the image is drawn only in the first step in which it is due */
} scene_image;

/* An iteration over the fields that an image's layers show: for each kind of layers in turn, first the fields that are
 * shown and then those that colour the layers. */
typedef enum scene_layer_kind { SCENE_ISOSURFACE, SCENE_VOLUME, SCENE_SLICE, SCENE_SURFACE } scene_layer_kind;

typedef enum scene_field_role {
    SCENE_SHOWN,    /* the layer is made of its values */
    SCENE_COLOURS,  /* it colours a surface */
    SCENE_LINES,    /* contour lines on a surface are of it */
    SCENE_THRESHOLD /* it chooses cells */
} scene_field_role;

typedef struct scene_field_walk {
    const scene_image *image;
    int place; /* place of the next field among all that the layers may have */
    scene_layer_kind kind;
    scene_field_role role; /* role of the last field returned */
} scene_field_walk;

/* Returns the next field, or NULL after the last one. An iteration begins with only the image set. */
scene_field *scene_next_field(scene_field_walk *walk);
/* Returns the name of the kind for messages. */
const char *scene_layer_word(scene_layer_kind kind);

/* Checks whether the image is the first of its variants. Results that all variants share are stored in this one. */
static inline bool scene_is_first_variant(const scene_image *image)
{
    return image->variant.layers == 0 && image->variant.view == 0;
}

/* Checks whether words are drawn into pictures of the image. */
static inline bool scene_has_words(const scene_image *image)
{
    const scene_decorations *d = &image->decorations;
    bool is_decorated = false;
    for (int i = 0; i < image->output_count; i++)
        is_decorated = is_decorated || (image->outputs[i].has_decorations && !image->outputs[i].is_deep);
    return is_decorated && d->is_given &&
           (d->title || d->words_count || d->has_bars || d->has_rulers || d->has_axes || d->has_scale_bar);
}

/* The cells that trees are built over: all cells, the cells that the images can show, or whichever of the two costs
 * less. */
typedef enum scene_tree { SCENE_TREE_AUTO, SCENE_TREE_FULL, SCENE_TREE_PARTIAL } scene_tree;

/* The order in which ranks exchange fragments for blending; the constants are those of comp_schedule. */
typedef enum scene_schedule {
    SCENE_SCHEDULE_AUTO,
    SCENE_SCHEDULE_DIRECT,
    SCENE_SCHEDULE_NODES,
    SCENE_SCHEDULE_RADIX,
    SCENE_SCHEDULE_BINARY
} scene_schedule;

/* Pictures are written by a thread while the simulation continues, or before the step ends. */
typedef enum scene_writing { SCENE_WRITE_BEHIND, SCENE_WRITE_IN_STEP } scene_writing;

/* Most images of a scene file (session_events.h has a bit for each), and most pictures that they make in a step. */
enum { SCENE_MAX_IMAGES = 64, SCENE_MAX_PICTURES = 1024 };

/* A number in the scene for the simulation (insitu_parameter()). */
typedef struct scene_parameter {
    char *name;
    double value;
} scene_parameter;

typedef struct scene {
    int derived_count;      /* 0 .. SCENE_MAX_DERIVED */
    scene_derived *derived; /* sorted: each field after the fields that it is derived from */
    int threads;            /* threads per rank; 0: the cores of the node, shared among its ranks */
    scene_tree tree;
    scene_schedule schedule;
    scene_writing writing;
    int image_count; /* 1 .. SCENE_MAX_PICTURES, including variants */
    scene_image *images;
    int database_count;
    scene_database *databases;
    int montage_count;
    scene_montage *montages;
    int statistics_count; /* 0 .. 64 */
    scene_statistics *statistics;
    int parameter_count; /* 0 .. 64, with different names */
    scene_parameter *parameters;
} scene;

/* Parses a text of size bytes. file_name is for messages, and paths in the scene are relative to its folder.
 * attachments is NULL if the scene may name no file; files that are read are added to it. On an error *out is zeroed
 * and the message has the form "file:line: key: what is wrong, what was expected". */
insitu_status scene_parse(const char *text, size_t size, const char *file_name, scene_attachments *attachments,
                          scene *out, base_error *error);

void scene_free(scene *s);

/* Returns the parameter of this name, or NULL if the scene has none. */
const scene_parameter *scene_find_parameter(const scene *s, const char *name);
/* Writes the end of a message about an unknown parameter: the parameter that was probably meant, and a list of all
 * parameters. */
void scene_list_parameters(const scene *s, const char *name, char *words, size_t size);

/* The values that placeholders are replaced by. */
typedef struct scene_moment {
    const char *name; /* name of the image */
    long long cycle;
    double time;
    int view, plane;
    double isovalue;
    const char *field; /* the sweep's field; NULL: no sweep */
} scene_moment;

scene_moment scene_moment_of(const scene_image *image, int64_t cycle, double time);

/* Replace {cycle}, {cycle:0N}, {view} and {plane} likewise, {time}, {time:.Nf} (or e, or g), {isovalue} as {time},
 * {name} and {field} of pattern. Numbers have a decimal point in any locale. The result is from base_alloc(), NULL
 * where memory ran out. */
char *scene_expand(const char *pattern, const scene_moment *moment);

#endif
