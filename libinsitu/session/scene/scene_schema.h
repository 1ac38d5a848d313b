/* Defines the scene file's schema: the structs into which the file is read, and for each key the values that it accepts
 * and its meaning. The schema uses the types and macros of libcyaml's header, but calls no function of that library.
 *
 * Every optional value is a pointer, which is NULL if the file does not give the value; scene.c fills in the
 * defaults. */
#ifndef SCENE_SCENE_SCHEMA_H
#define SCENE_SCENE_SCHEMA_H

#include <cyaml/cyaml.h>
#include <stdbool.h>

typedef enum scene_frame { SCENE_FRAME_CAMERA, SCENE_FRAME_WORLD } scene_frame;

typedef struct scene_file_automatic {
    double *direction;   /* direction from the focal point to the eye, x y z */
    double *zoom;        /* zoom: 1 fits the bounds into the picture; larger values are closer */
    int *fit;            /* what must fit into the frame (scene_fit) */
    double (*bounds)[3]; /* two opposite corners, each a list of 3 numbers */
} scene_file_automatic;

typedef enum scene_fit { SCENE_FIT_SPHERE, SCENE_FIT_BOX } scene_fit;
typedef enum scene_projection { SCENE_PERSPECTIVE, SCENE_ORTHOGRAPHIC } scene_projection;

typedef struct scene_file_orbit {
    int views;     /* number of views on each circle */
    double *axis;  /* direction of the axis, x y z */
    double *start; /* angle of the first view, in degrees */
} scene_file_orbit;

typedef struct scene_file_point {
    double *time;                  /* time at which the camera is at this point; NULL: `cycle` is given */
    int *cycle;                    /* cycle at which the camera is at this point; NULL: `time` is given */
    double *position, *focal, *up; /* eye, focal point and up direction, x y z each */
    double *angle;                 /* vertical angle of view in degrees */
} scene_file_point;

typedef struct scene_file_camera {
    double *position, *focal; /* eye and focal point, x y z each */
    scene_file_automatic *automatic;
    double *up;      /* up direction, x y z */
    double *angle;   /* vertical angle of view in degrees */
    int *projection; /* perspective or orthographic (scene_projection) */
    double *height;  /* height of an orthographic view in scene units */
    scene_file_orbit *orbit;
    scene_file_point *path;
    int path_count; /* number of points of the path */
} scene_file_camera;

typedef struct scene_file_light {
    double *direction; /* direction towards the light, x y z */
    double *colour;    /* red, green and blue, sRGB, 0 .. 1 */
    double *intensity; /* factor by which the light's colour is multiplied */
    scene_frame *in;   /* axes in which the direction is given: those of the camera or of the scene */
    bool *shadows;     /* whether the light casts shadows */
} scene_file_light;

typedef struct scene_file_occlusion {
    int *samples;   /* number of occlusion rays per hit */
    double *radius; /* length of the occlusion rays in scene units */
} scene_file_occlusion;

typedef struct scene_file_material {
    double *ambient, *diffuse, *specular, *shininess;
} scene_file_material;

/* The keys of a colour map. The keys `map` and `range` have several forms and are read from the tree of the document
 * instead (scene_document.h). */
typedef struct scene_file_colour_map {
    bool *reversed;              /* whether the order of the colours is reversed */
    int *discrete;               /* number of bands of equal width */
    int *scale;                  /* linear, logarithmic or symmetric logarithmic (scene_scale) */
    double *threshold;           /* end of the linear part of a symmetric logarithmic scale */
    double *below, *above, *nan; /* colours of values below and above the range, and of NaN; red, green, blue */
} scene_file_colour_map;

typedef struct scene_file_colour_by {
    char *field, *component;
    int *interpolate; /* whether cell values are averaged to vertices (scene_interpolation) */
    scene_file_colour_map colours;
} scene_file_colour_by;

typedef struct scene_file_plane {
    double *normal, *point; /* normal, and a point of the plane, x y z each */
    double *offset;         /* distance from the point to the plane, along the normal */
    double *offsets;        /* offsets of several planes; only slices may have these and a count */
    int offsets_count;
    int *count; /* number of planes that are evenly spaced over the data */
} scene_file_plane;

typedef struct scene_file_sphere {
    double *centre; /* centre of the sphere, x y z */
    double radius;  /* radius of the sphere in scene units */
} scene_file_sphere;

typedef struct scene_file_clip {
    scene_file_plane *planes;
    int planes_count;
    double (*box)[3]; /* two opposite corners, each a list of 3 numbers */
    scene_file_sphere *sphere;
    int *keep; /* whether the inside or the outside is kept (scene_keep) */
} scene_file_clip;

typedef struct scene_file_lines {
    char *field, *component;
    double *values; /* value of the field on each contour line */
    int values_count;
    int *count;             /* number of lines, if the scene gives no values */
    double *width, *colour; /* width of the lines in pixels, and their colour: red, green and blue */
} scene_file_lines;

typedef struct scene_file_isosurface {
    char *field, *component;
    int *interpolate; /* whether cell values are averaged to vertices (scene_interpolation) */
    double *values;   /* isovalues of the layer */
    int values_count;
    double (*colours)[3]; /* one colour per isovalue: red, green, blue */
    int colours_count;
    scene_file_colour_by *colour_by;
    double *opacity;
    scene_file_material *material;
    int *normals;       /* how normals are computed (scene_normal) */
    double *difference; /* distance between the samples of central differences, in cell sizes */
    scene_file_lines *lines;
    scene_file_clip *clip;
} scene_file_isosurface;

typedef struct scene_file_volume {
    char *field, *component;
    int *interpolate; /* whether cell values are averaged to vertices (scene_interpolation) */
    scene_file_colour_map colours;
    double (*opacity)[2]; /* points of the opacity curve: position in the range, and opacity */
    int opacity_count;
    double *unit_distance; /* thickness of a layer to which opacities refer, in scene units */
    scene_file_clip *clip;
} scene_file_volume;

typedef struct scene_file_edges {
    double *width, *colour; /* width of the edges in pixels, and their colour: red, green and blue */
} scene_file_edges;

typedef struct scene_file_threshold {
    char *field, *component;
    double *from, *to; /* least and greatest value of the cells that are drawn */
} scene_file_threshold;

typedef struct scene_file_surface {
    double *colour; /* colour of the surface: red, green and blue */
    scene_file_colour_by *colour_by;
    scene_file_edges *edges;
    scene_file_threshold *threshold;
    double *opacity;
    scene_file_material *material;
    scene_file_lines *lines;
    scene_file_clip *clip;
} scene_file_surface;

typedef struct scene_file_slice {
    char *field, *component;
    int *interpolate; /* whether cell values are averaged to vertices (scene_interpolation) */
    scene_file_plane *planes;
    int planes_count;
    scene_file_colour_map colours;
    double *opacity;
    scene_file_material *material;
    scene_file_lines *lines;
    scene_file_clip *clip;
} scene_file_slice;

typedef struct scene_file_layer {
    scene_file_isosurface *isosurface;
    scene_file_volume *volume;
    scene_file_slice *slice;
    scene_file_surface *surface;
} scene_file_layer;

typedef struct scene_file_sampling {
    int *method;               /* method for volumes: samples or segments (scene_sampling_method) */
    double *max_error;         /* allowed error of a colour channel if the method is segments */
    double *step, *step_cells; /* distance between samples in scene units, or in mean cell sizes */
    bool *jitter, *reproducible;
    int *frames;         /* number of frames that are averaged */
    double *max_seconds; /* upper bound of the estimated time for samples */
} scene_file_sampling;

typedef struct scene_file_words {
    char *text; /* the text, with placeholders */
    int *at;    /* edge or corner of the picture at which the text stands (scene_anchor) */
} scene_file_words;

typedef struct scene_file_colour_bar {
    int *at;       /* edge or corner of the picture at which the bars stand (scene_anchor) */
    int *ticks;    /* largest number of ticks per bar */
    int *notation; /* form of the numbers, with or without exponents (scene_notation) */
    int *digits;   /* number of digits after the decimal point */
} scene_file_colour_bar;

typedef struct scene_file_scale_bar {
    char *unit; /* unit of length, for the label */
    int *at;    /* corner of the picture at which the bar stands (scene_anchor) */
} scene_file_scale_bar;

typedef struct scene_file_decorations {
    char *title;
    scene_file_words *text;
    int text_count;
    scene_file_colour_bar *colour_bar;
    int *outline; /* boxes that are outlined (scene_boxes) */
    bool *rulers, *axes;
    scene_file_scale_bar *scale_bar;
    double *colour; /* colour of text and lines: red, green and blue */
    double *size;   /* height of text, as a fraction of the picture's height */
} scene_file_decorations;

/* The keys of a sweep. The key `fields` is read from the tree of the document instead (scene_document.h). */
typedef struct scene_file_sweep {
    bool *isovalues, *planes;
} scene_file_sweep;

typedef struct scene_file_output {
    char *path, *cinema;
    int *grid; /* number of columns, and number of rows of a montage */
    bool *shared_bars;
    int *inset; /* corner of the montage at which the picture is an inset (scene_anchor) */
    int *bits;  /* bits per channel of a PNG file: 8 or 16 */
    bool *decorations, *data, *deep;
} scene_file_output;

typedef struct scene_file_condition {
    char *field, *component;
    int *of;               /* statistic of the field that is compared (scene_statistic) */
    double *above, *below; /* bounds between which the statistic must lie; `above` is the lower bound */
} scene_file_condition;

typedef struct scene_file_histogram {
    int *bins;     /* number of bins of the histogram */
    double *range; /* lower end of the first bin and upper end of the last one */
} scene_file_histogram;

typedef struct scene_file_statistics {
    char *field, *component, *path;
    int *every; /* the statistics are written at cycles that are multiples of this */
    scene_file_histogram *histogram;
} scene_file_statistics;

/* The keys of a derived field. The key that names the input fields is read from the tree of the document instead
 * (scene_document.h). */
typedef struct scene_file_derived {
    char *name, *expression, *component;
} scene_file_derived;

typedef struct scene_file_image {
    char *name;
    int *size;          /* width and height of the picture in pixels */
    int *every;         /* the image is drawn at cycles that are multiples of this */
    double *every_time; /* interval of simulated time at which the image is drawn */
    scene_file_condition *when;
    bool *once;
    int *antialias; /* number of sample positions in a pixel, which successive frames use in turn */
    scene_file_camera *camera;
    scene_file_sweep *sweep;
    double *background; /* background colour: red, green, blue and, if background_count is 4, opacity */
    int background_count;
    scene_file_light *lights;
    int lights_count;
    bool *shadows;
    scene_file_occlusion *ambient_occlusion;
    scene_file_clip *clip;
    scene_file_layer *layers;
    int layers_count;
    scene_file_sampling *sampling;
    scene_file_decorations *decorations;
    scene_file_output *outputs;
    int outputs_count;
} scene_file_image;

typedef struct scene_file_warp {
    char *field;
    double *scale;
} scene_file_warp;

typedef struct scene_file_mesh {
    char *name;
    scene_file_warp *warp;
} scene_file_mesh;

typedef struct scene_file {
    int *threads;          /* number of threads per rank */
    int *tree;             /* cells over which trees are built (scene_tree) */
    int *schedule;         /* order in which ranks exchange fragments (scene_schedule) */
    int *writing;          /* when pictures are written: during the step or after it (scene_writing) */
    int *finer_pieces;     /* number of linear pieces between two nodes of a cell of higher order */
    double *surface_error; /* allowed error of linear pieces, in pixels, by which their number is chosen */
    double *finer_memory;  /* maximum memory of the pieces of cells of higher order, on all ranks together, in MiB */
    scene_file_image *images;
    int images_count;
    scene_file_statistics *statistics;
    int statistics_count;
    scene_file_derived *fields;
    int fields_count;
    scene_file_mesh *meshes;
    int meshes_count;
} scene_file;

struct scene_mapping;

/* The meaning and the range of a key, in addition to its field in libcyaml's schema. */
typedef struct scene_key {
    const char *help;
    const char *default_text; /* default value, as shown in docs/scene.md; NULL: the key is required */
    double low, high; /* range of a number, or of each number of a list; any finite number is allowed if both are 0 */
    bool is_low_excluded;  /* set if a number must be greater than `low`; otherwise it may be equal to it */
    bool is_high_excluded; /* set if a number must be less than `high`; otherwise it may be equal to it */
    bool is_named; /* for a list: set if paths contain the name of an entry (its key `name`) instead of its index */
    const struct scene_mapping *child; /* keys of the mapping, or of each mapping in the list */
    /* forms of the value, one for each type that it may have; NULL: there is a single type */
    const struct scene_form *forms;
    int form_count;
    const struct scene_form
        *named; /* for a mapping whose keys are names that the scene defines: the form of its values; otherwise NULL */
} scene_key;

/* One of the forms of a value that may have several types. */
typedef struct scene_form {
    cyaml_schema_value_t value;
    scene_key key;
} scene_form;

typedef struct scene_mapping {
    const char *title;
    const cyaml_schema_field_t *fields; /* libcyaml's fields of the mapping; the last entry has a NULL key */
    const scene_key *keys;              /* one description of a key per field, in the same order */
} scene_mapping;

enum { SCENE_MAX_BYTES = 1 << 20, SCENE_MAX_DEPTH = 16 };

/* Maximum number of bytes of a name, of names in a list or mapping, and of bytes of a key that the scene defines.
 * libcyaml has no type for three kinds of values: a name or a list of names, a value of several forms, and a mapping
 * whose keys the scene defines. The schema marks these by CYAML_IGNORE, and they are read from the document
 * (scene_list_texts_at_path(), scene_get_node_type_at_path(), scene_list_keys_at_path()). */
enum { SCENE_NAME_BYTES = 255, SCENE_MAX_NAMES = 64, SCENE_KEY_BYTES = 63 };

/* scene_top: the top-level mapping of a file, which is read into a scene_file; scene_top_value: the same mapping as a
 * value of the schema. */
extern const scene_mapping scene_top;
extern const cyaml_schema_value_t scene_top_value;

#endif
