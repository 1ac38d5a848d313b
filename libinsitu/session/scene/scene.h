/* The scene file: what to draw, when, and where to put it. Read from YAML text by a schema; docs/scene.md is drawn
 * from the same schema. Colours in the file are sRGB in [0, 1]; they are linear here. */
#ifndef SCENE_SCENE_H
#define SCENE_SCENE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "error.h"
#include "scene_expression.h"

typedef enum scene_sampling_method { SCENE_SAMPLES, SCENE_SEGMENTS } scene_sampling_method;
typedef enum scene_interpolation { SCENE_BY_CELL, SCENE_BY_VERTEX } scene_interpolation;

/* The scalar of a field: the magnitude, or component n. Default: component 0 if the field has one, else the magnitude.
 * Only: component 0 of a field that must have no other. */
enum { SCENE_COMPONENT_ONLY = -3, SCENE_COMPONENT_DEFAULT = -2, SCENE_COMPONENT_MAGNITUDE = -1 };

/* A field as a layer shows it: on some of the meshes. */
typedef struct scene_field {
    char *name;
    int component;      /* 0 .., or one of the above */
    bool at_vertices;   /* cell values are recentred to the vertices; else they are drawn as they are */
    bool joins_corners; /* values at cells' corners give way to their means at the vertices */
    int line;           /* line in the scene file, for messages about the field */
    int mesh_count;     /* 0: on the meshes that have the field */
    char **meshes;      /* a name stands for the meshes below it too: "a" for "a/0" */
    int meshes_line;    /* for messages about them */
    uint64_t joined;    /* a hash of the meshes that means at vertices are over; the session's (session_joints.h) */
} scene_field;

/* Tells whether the layer is drawn on a mesh of this name, if that has the field. */
bool scene_field_is_on(const scene_field *field, const char *mesh);
/* Tells whether name stands for the mesh. */
bool scene_name_stands_for(const char *name, const char *mesh);

/* What a derived field is. Those after the expression are made of gradients at vertices. */
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

/* A field that the session makes of others. */
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

/* The source of a range that is not fixed. All use the values on all ranks, at each drawn step. */
typedef enum scene_range_source {
    SCENE_RANGE_DATA,       /* the least and the greatest value */
    SCENE_RANGE_RUN,        /* those of all steps drawn so far, kept in a file over restarts (session_run_ranges.h) */
    SCENE_RANGE_SYMMETRIC,  /* as far below 0 as above: the greater size of the two */
    SCENE_RANGE_PERCENTILES /* the values that low and high percent of the cells are no greater than */
} scene_range_source;

typedef struct scene_range {
    bool is_fixed; /* low and high are values */
    double low, high;
    scene_range_source source; /* where not fixed */
} scene_range;

/* The scale that spaces values along a colour map: linear; the logarithm; or, for values of both signs, linear up to a
 * threshold and the logarithm beyond (render_scaled() of render.h, in the same terms). */
typedef enum scene_scale { SCENE_LINEAR, SCENE_LOG, SCENE_SYMLOG } scene_scale;

/* A colour map turns a value into a colour, for layers of all kinds. The value's place is (s(value) - s(low)) /
 * (s(high) - s(low)), s being the scale and [low, high] the range. Places below 0 and above 1 have the colours of 0 and
 * 1, or those of outside. A place's colour is taken from the table, linear between entries; in bands it is that of
 * entry floor(place × count). */
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

/* A file that the scene names, by the path that it is opened by. */
typedef struct scene_attachment {
    char *path, *text; /* text: size bytes, not ended */
    int64_t size;
} scene_attachment;

/* Files that a scene names. One rank reads them while it parses, and the others get them with the scene. */
typedef struct scene_attachments {
    /* Reads a whole file into *text, from base_alloc(); NULL: only files in items can be had. */
    insitu_status (*read)(const char *path, char **text, int64_t *size, base_error *error);
    int count;
    scene_attachment *items;
} scene_attachments;

enum { SCENE_MAX_ATTACHMENTS = 64 };
void scene_attachments_free(scene_attachments *attachments);

typedef struct scene_opacity_point {
    double at;     /* 0 .. 1 of the range; never falling, two the same make a step */
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
    float *colours; /* value_count × 3, linear: those given, the last repeated; or a default cycle */
    bool has_colour_by;
    scene_field colour_by;
    scene_colour_map colour_map;
    scene_lines lines;
    float opacity;
    scene_material material;
    scene_normal normals;
    double difference; /* in cell sizes, > 0; 1 by default */
    uint32_t clips;    /* a set of the image's */
    int number;        /* in the image's list of layers */
} scene_isosurface;

typedef struct scene_volume {
    scene_field field;
    scene_colour_map colour_map;
    int opacity_count; /* 1 .. 32 */
    scene_opacity_point *opacity;
    double unit_distance; /* > 0; 0: a twentieth of the diagonal of the bounds */
    uint32_t clips;       /* a set of the image's, the same for all its volumes */
} scene_volume;

/* Cells whose values of a field lie from low to high. */
typedef struct scene_threshold {
    bool is_given; /* else all cells */
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
    bool has_material; /* else flat data takes no light */
    scene_material material;
    uint32_t clips; /* a set of the image's */
    int number;     /* in the image's list of layers */
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

/* Everything outside the half space, box or sphere is cut away; with is_outside, everything inside. */
typedef struct scene_clip {
    scene_clip_kind kind;
    bool is_outside;
    scene_plane plane; /* its normal points to what is cut away */
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
    scene_material material; /* no light by default: colours are those of the map */
    uint32_t clips;          /* a set of the image's */
    int number;              /* in the image's list of layers */
} scene_slice;

typedef struct scene_light {
    double direction[3]; /* towards the light; camera axes (right, up, backward) unless in_world; unit length */
    bool in_world;
    float colour[3]; /* linear, intensity included */
} scene_light;

/* Places on circles around the data, numbered circle by circle: view / view_count is the circle. */
enum { SCENE_MAX_ELEVATIONS = 32 };

/* The default of step_cells. */
#define SCENE_STEP_CELLS 0.5
typedef struct scene_orbit {
    int view_count;                          /* views on each circle; 0: there is no orbit */
    double axis[3];                          /* unit length */
    double start;                            /* degrees: phi of the first view of a circle */
    int circle_count;                        /* 1 .. SCENE_MAX_ELEVATIONS */
    double elevations[SCENE_MAX_ELEVATIONS]; /* degrees above the plane across the axis */
} scene_orbit;

/* Where a moving camera is at a time, or at a cycle. */
typedef struct scene_camera_point {
    double at;
    double eye[3], focal[3], up[3], angle;
} scene_camera_point;

typedef struct scene_camera {
    bool is_automatic; /* eye and focal from the global bounds, looking along -direction */
    /* Keys that the scene gives; the others follow the data where that is flat (session_camera.h). */
    bool has_direction, has_up, has_fit, has_projection;
    bool has_bounds; /* automatic: of these, not of the data */
    double lower[3], upper[3];
    double eye[3], focal[3];
    double direction[3]; /* automatic: from the focal point towards the eye */
    double up[3];
    double angle;  /* vertical, degrees; 40 by default */
    double zoom;   /* automatic: 1 fits the bounds; larger is nearer */
    bool fits_box; /* automatic: the bounds' box fills the frame; else the sphere around it */
    bool is_orthographic;
    double height; /* orthographic: of what the picture shows, scene units; 0: as far as a perspective one shows */
    scene_orbit orbit;
    double phi, theta; /* angles of an orbit's view in degrees: around the axis, and above the plane across it */
    bool is_by_cycle;  /* points are at cycles, else at times */
    int point_count;   /* 0: the camera does not move */
    scene_camera_point *points; /* rising */
} scene_camera;

/* The camera as it stands in a step: one that moves is found between its points. */
scene_camera scene_camera_at(const scene_camera *camera, int64_t cycle, double time);

/* Places in the picture, as insitu_anchor (image_output.h) has them. */
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
    char *text; /* {time}, {cycle} and {name} are replaced */
    scene_anchor at;
} scene_words;

/* Words, bars and lines drawn beside the data. */
/* Boxes around all data, around each mesh, or around what each rank holds. */
typedef enum scene_boxes { SCENE_NO_BOX, SCENE_BOX_OF_DATA, SCENE_BOXES_OF_MESHES, SCENE_BOXES_OF_RANKS } scene_boxes;

/* The numbers of colour bars: as short as tells them apart, or all as 0.25, or all as 2.5e-1. */
typedef enum scene_notation { SCENE_SHORTEST, SCENE_FIXED, SCENE_SCIENTIFIC } scene_notation;

typedef struct scene_number_form {
    scene_notation notation;
    bool has_digits; /* else as many as tell neighbours apart */
    int digits;      /* 0 .. 12, behind the point */
} scene_number_form;

typedef struct scene_decorations {
    bool is_given; /* else there are none */
    char *title;   /* NULL: none */
    int words_count;
    scene_words *words;
    bool has_bars; /* one for each layer that colours by a field */
    scene_anchor bars_at;
    int tick_count; /* about so many a bar */
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

/* A statistic of a field lies above one bound and below another. */
typedef struct scene_condition {
    bool is_given; /* else it always holds */
    scene_field field;
    scene_statistic of;
    double above, below; /* may be infinite */
} scene_condition;

/* Statistics that are written as a line of a file. */
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
    char *name; /* the same of all variants */
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
    int clip_count; /* 0 .. SCENE_MAX_CLIPS, each once */
    scene_clip *clips;
    uint32_t clips_of_all; /* a set of them, a bit each: those that cut all layers */
    bool has_lights;       /* the scene gives some */
    int light_count;       /* 1 .. 8; a default head light and fill light where none is given */
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
    int every;         /* drawn at cycles that are multiples of it; 1 by default */
    double every_time; /* > 0: instead, when the time passes a multiple of it */
    scene_condition when;
    bool once; /* drawn only in the first step in which it is due */
} scene_image;

/* The fields that an image's layers show, one after the other: of each kind of layers in turn, its fields and then what
 * colours it. */
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

/* The next field; NULL: there is none. A walk begins with the image alone. */
scene_field *scene_next_field(scene_field_walk *walk);
/* The kind's name for messages. */
const char *scene_layer_word(scene_layer_kind kind);

/* Results that all variants of an image share are found for the first of them. */
static inline bool scene_is_first_variant(const scene_image *image)
{
    return image->variant.layers == 0 && image->variant.view == 0;
}

/* Tells whether words are written into pictures of the image. */
static inline bool scene_has_words(const scene_image *image)
{
    const scene_decorations *d = &image->decorations;
    bool is_decorated = false;
    for (int i = 0; i < image->output_count; i++)
        is_decorated = is_decorated || (image->outputs[i].has_decorations && !image->outputs[i].is_deep);
    return is_decorated && d->is_given &&
           (d->title || d->words_count || d->has_bars || d->has_rulers || d->has_axes || d->has_scale_bar);
}

/* The cells that trees are built over: all cells, those that the images can show, or what costs less. */
typedef enum scene_tree { SCENE_TREE_AUTO, SCENE_TREE_FULL, SCENE_TREE_PARTIAL } scene_tree;

/* By which ranks fragments go to those that blend them, in the order of comp_schedule. */
typedef enum scene_schedule {
    SCENE_SCHEDULE_AUTO,
    SCENE_SCHEDULE_DIRECT,
    SCENE_SCHEDULE_NODES,
    SCENE_SCHEDULE_RADIX,
    SCENE_SCHEDULE_BINARY
} scene_schedule;

/* Pictures are written by a thread while the simulation goes on, or before the step is over. */
typedef enum scene_writing { SCENE_WRITE_BEHIND, SCENE_WRITE_IN_STEP } scene_writing;

/* Most images of a scene file (session_events.h has a bit for each), and most pictures that they make in a step. */
enum { SCENE_MAX_IMAGES = 64, SCENE_MAX_PICTURES = 1024 };

/* A number of the scene for the simulation (insitu_parameter()). */
typedef struct scene_parameter {
    char *name;
    double value;
} scene_parameter;

typedef struct scene {
    int derived_count;      /* 0 .. SCENE_MAX_DERIVED */
    scene_derived *derived; /* each after those that it is made of */
    int threads;            /* per rank; 0: the cores there are, shared by the ranks of a node */
    scene_tree tree;
    scene_schedule schedule;
    scene_writing writing;
    int image_count; /* 1 .. SCENE_MAX_PICTURES, variants counted */
    scene_image *images;
    int database_count;
    scene_database *databases;
    int montage_count;
    scene_montage *montages;
    int statistics_count; /* 0 .. 64 */
    scene_statistics *statistics;
    int parameter_count; /* 0 .. 64, of different names */
    scene_parameter *parameters;
} scene;

/* Parse text (size bytes; file_name for messages, and paths in the scene are relative to its folder). attachments: NULL
 * where the scene may name no file; those that are read are added. On an error *out is zeroed and the message reads
 * "file:line: key: what is wrong, what was expected". */
insitu_status scene_parse(const char *text, size_t size, const char *file_name, scene_attachments *attachments,
                          scene *out, base_error *error);

void scene_free(scene *s);

/* The parameter of this name; NULL: the scene has none. */
const scene_parameter *scene_find_parameter(const scene *s, const char *name);
/* What a message about a name that is no parameter's says of those that there are: what was meant, and all of them. */
void scene_list_parameters(const scene *s, const char *name, char *words, size_t size);

/* The values that placeholders stand for. */
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
