/* The scene file's schema: the structs that the file is read into, and the values and meaning of each key. The schema
 * uses the types and macros of libcyaml's header; no function of that library is called.
 *
 * Every optional value is a pointer, which is NULL if the file does not give the value; scene.c fills in the
 * defaults. */
#ifndef SCENE_SCENE_SCHEMA_H
#define SCENE_SCENE_SCHEMA_H

#include <cyaml/cyaml.h>
#include <stdbool.h>

typedef enum scene_frame { SCENE_FRAME_CAMERA, SCENE_FRAME_WORLD } scene_frame;

typedef struct scene_file_automatic {
    double *direction; /* list of 3 numbers */
    double *zoom;
    int *fit;            /* value of the enum scene_fit */
    double (*bounds)[3]; /* two opposite corners, each a list of 3 numbers */
} scene_file_automatic;

typedef enum scene_fit { SCENE_FIT_SPHERE, SCENE_FIT_BOX } scene_fit;
typedef enum scene_projection { SCENE_PERSPECTIVE, SCENE_ORTHOGRAPHIC } scene_projection;

typedef struct scene_file_orbit {
    int views;
    double *axis; /* list of 3 numbers */
    double *start;
} scene_file_orbit;

typedef struct scene_file_point {
    double *time;
    int *cycle;
    double *position, *focal, *up; /* lists of 3 numbers */
    double *angle;
} scene_file_point;

typedef struct scene_file_camera {
    double *position, *focal; /* lists of 3 numbers */
    scene_file_automatic *automatic;
    double *up; /* list of 3 numbers */
    double *angle;
    int *projection; /* value of the enum scene_projection */
    double *height;
    scene_file_orbit *orbit;
    scene_file_point *path;
    int path_count;
} scene_file_camera;

typedef struct scene_file_light {
    double *direction; /* list of 3 numbers */
    double *colour;    /* list of 3 numbers */
    double *intensity;
    scene_frame *in;
    bool *shadows;
} scene_file_light;

typedef struct scene_file_occlusion {
    int *samples;
    double *radius;
} scene_file_occlusion;

typedef struct scene_file_material {
    double *ambient, *diffuse, *specular, *shininess;
} scene_file_material;

/* The keys of a colour map. The keys map and range have several forms and are read from the document. */
typedef struct scene_file_colour_map {
    bool *reversed;
    int *discrete;
    int *scale; /* value of the enum scene_scale */
    double *threshold;
    double *below, *above, *nan; /* lists of 3 numbers */
} scene_file_colour_map;

typedef struct scene_file_colour_by {
    char *field, *component;
    int *interpolate; /* value of the enum scene_interpolation */
    scene_file_colour_map colours;
} scene_file_colour_by;

typedef struct scene_file_plane {
    double *normal, *point; /* lists of 3 numbers */
    double *offset;
    double *offsets; /* offsets of several planes; only slices may have these and a count */
    int offsets_count;
    int *count;
} scene_file_plane;

typedef struct scene_file_sphere {
    double *centre; /* list of 3 numbers */
    double radius;
} scene_file_sphere;

typedef struct scene_file_clip {
    scene_file_plane *planes;
    int planes_count;
    double (*box)[3]; /* two opposite corners, each a list of 3 numbers */
    scene_file_sphere *sphere;
    int *keep; /* value of the enum scene_keep */
} scene_file_clip;

typedef struct scene_file_lines {
    char *field, *component;
    double *values;
    int values_count;
    int *count;
    double *width, *colour; /* colour: list of 3 numbers */
} scene_file_lines;

typedef struct scene_file_isosurface {
    char *field, *component;
    int *interpolate; /* value of the enum scene_interpolation */
    double *values;
    int values_count;
    double (*colours)[3];
    int colours_count;
    scene_file_colour_by *colour_by;
    double *opacity;
    scene_file_material *material;
    int *normals; /* value of the enum scene_normal */
    double *difference;
    scene_file_lines *lines;
    scene_file_clip *clip;
} scene_file_isosurface;

typedef struct scene_file_volume {
    char *field, *component;
    int *interpolate; /* value of the enum scene_interpolation */
    scene_file_colour_map colours;
    double (*opacity)[2];
    int opacity_count;
    double *unit_distance;
    scene_file_clip *clip;
} scene_file_volume;

typedef struct scene_file_edges {
    double *width, *colour; /* colour: list of 3 numbers */
} scene_file_edges;

typedef struct scene_file_threshold {
    char *field, *component;
    double *from, *to;
} scene_file_threshold;

typedef struct scene_file_surface {
    double *colour; /* list of 3 numbers */
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
    int *interpolate; /* value of the enum scene_interpolation */
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
    int *method; /* value of the enum scene_sampling_method */
    double *max_error;
    double *step, *step_cells;
    bool *jitter, *reproducible;
    int *frames;
    double *max_seconds;
} scene_file_sampling;

typedef struct scene_file_words {
    char *text;
    int *at; /* value of the enum scene_anchor */
} scene_file_words;

typedef struct scene_file_colour_bar {
    int *at; /* value of the enum scene_anchor */
    int *ticks;
    int *notation; /* value of the enum scene_notation */
    int *digits;
} scene_file_colour_bar;

typedef struct scene_file_scale_bar {
    char *unit;
    int *at; /* value of the enum scene_anchor */
} scene_file_scale_bar;

typedef struct scene_file_decorations {
    char *title;
    scene_file_words *text;
    int text_count;
    scene_file_colour_bar *colour_bar;
    int *outline; /* value of the enum scene_boxes */
    bool *rulers, *axes;
    scene_file_scale_bar *scale_bar;
    double *colour; /* list of 3 numbers */
    double *size;
} scene_file_decorations;

/* The keys of a sweep, except `fields`, which is read from the document. */
typedef struct scene_file_sweep {
    bool *isovalues, *planes;
} scene_file_sweep;

typedef struct scene_file_output {
    char *path, *cinema;
    int *grid; /* list of 2 numbers */
    int *bits;
    bool *decorations, *data, *deep;
} scene_file_output;

typedef struct scene_file_condition {
    char *field, *component;
    int *of; /* value of the enum scene_statistic */
    double *above, *below;
} scene_file_condition;

typedef struct scene_file_histogram {
    int *bins;
    double *range; /* list of 2 numbers */
} scene_file_histogram;

typedef struct scene_file_statistics {
    char *field, *component, *path;
    int *every;
    scene_file_histogram *histogram;
} scene_file_statistics;

/* The keys of a derived field, except the one that names the input fields, which is read from the document. */
typedef struct scene_file_derived {
    char *name, *expression, *component;
} scene_file_derived;

typedef struct scene_file_image {
    char *name;
    int *size; /* list of 2 numbers */
    int *every;
    double *every_time;
    scene_file_condition *when;
    bool *once;
    int *antialias;
    scene_file_camera *camera;
    scene_file_sweep *sweep;
    double *background; /* list of 3 or 4 numbers */
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

typedef struct scene_file {
    int *threads;
    int *tree;     /* value of the enum scene_tree */
    int *schedule; /* value of the enum scene_schedule */
    int *writing;  /* value of the enum scene_writing */
    scene_file_image *images;
    int images_count;
    scene_file_statistics *statistics;
    int statistics_count;
    scene_file_derived *fields;
    int fields_count;
} scene_file;

struct scene_mapping;

/* Describes the meaning and the range of one field of a cyaml schema. */
typedef struct scene_key {
    const char *help;
    const char *default_text; /* default value as the reference shows it; NULL: the key is required */
    double low, high;         /* range of a number, or of each number in a list; both 0: any finite number is allowed */
    bool is_low_excluded;
    bool is_high_excluded;
    bool is_named;                     /* for a list: set if paths identify its entries by their key `name` */
    const struct scene_mapping *child; /* keys of a mapping, or of each mapping in a list */
    /* list of forms, one for each type that the value may have; NULL: the key has a single type */
    const struct scene_form *forms;
    int form_count;
    const struct scene_form
        *named; /* for a mapping whose keys are names chosen by the scene: the form of its values; otherwise NULL */
} scene_key;

/* One of the forms of a value that may have several types. */
typedef struct scene_form {
    cyaml_schema_value_t value;
    scene_key key;
} scene_form;

typedef struct scene_mapping {
    const char *title;
    const cyaml_schema_field_t *fields; /* fields of the mapping; the last entry has a NULL key */
    const scene_key *keys;              /* one description per field, in the same order */
} scene_mapping;

enum { SCENE_MAX_BYTES = 1 << 20, SCENE_MAX_DEPTH = 16 };

/* libcyaml has no type for "a name or a list of names", for values of several forms, or for mappings with keys that the
 * scene chooses. CYAML_IGNORE marks these here, and they are read from the document (scene_document_texts(),
 * scene_document_kind(), scene_document_names()). Keys that the scene chooses have at most SCENE_KEY_BYTES bytes. */
enum { SCENE_NAME_BYTES = 255, SCENE_MAX_NAMES = 64, SCENE_KEY_BYTES = 63 };

/* The top-level mapping of a file, which is read into a scene_file; and the same mapping as a value. */
extern const scene_mapping scene_top;
extern const cyaml_schema_value_t scene_top_value;

#endif
