/* Defines the keys of a scene, of its images, and of all their parts other than layers. The macros are in
 * scene_schema_lists.h. */
#include "scene.h"
#include "scene_schema_lists.h"

static const cyaml_strval_t method_words[] = {{"samples", SCENE_SAMPLES}, {"segments", SCENE_SEGMENTS}};
static const cyaml_strval_t statistic_words[] = {
    {"minimum", SCENE_MINIMUM}, {"maximum", SCENE_MAXIMUM}, {"mean", SCENE_MEAN}};
static const cyaml_strval_t tree_words[] = {
    {"auto", SCENE_TREE_AUTO}, {"full", SCENE_TREE_FULL}, {"partial", SCENE_TREE_PARTIAL}};
static const cyaml_strval_t schedule_words[] = {{"auto", SCENE_SCHEDULE_AUTO},
                                                {"direct", SCENE_SCHEDULE_DIRECT},
                                                {"nodes", SCENE_SCHEDULE_NODES},
                                                {"radix", SCENE_SCHEDULE_RADIX},
                                                {"binary", SCENE_SCHEDULE_BINARY}};
static const cyaml_strval_t writing_words[] = {{"background", SCENE_WRITE_BEHIND}, {"step", SCENE_WRITE_IN_STEP}};
static const cyaml_strval_t anchor_words[] = {{"top_left", SCENE_TOP_LEFT},   {"top", SCENE_TOP},
                                              {"top_right", SCENE_TOP_RIGHT}, {"left", SCENE_LEFT},
                                              {"right", SCENE_RIGHT},         {"bottom_left", SCENE_BOTTOM_LEFT},
                                              {"bottom", SCENE_BOTTOM},       {"bottom_right", SCENE_BOTTOM_RIGHT}};
static const cyaml_strval_t side_words[] = {{"left", SCENE_LEFT}, {"right", SCENE_RIGHT}};
static const cyaml_strval_t frame_words[] = {{"camera", SCENE_FRAME_CAMERA}, {"world", SCENE_FRAME_WORLD}};

#define LIGHT_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_SEQUENCE_FIXED("direction", CYAML_FLAG_POINTER, scene_file_light, direction, &number, 3),            \
      .help = "From the scene towards the light. Any length but 0.")                                                   \
    X(NUMBERS("colour", scene_file_light, colour, 3), .help = "Colour, sRGB.", .default_text = "`[1, 1, 1]`",          \
      .low = 0, .high = 1)                                                                                             \
    X(CYAML_FIELD_FLOAT_PTR("intensity", OPTIONAL, scene_file_light, intensity),                                       \
      .help = "Factor on the colour, in linear light.", .default_text = "`1`", .low = 0, .high = 100)                  \
    X(CHOICE("in", scene_file_light, in, frame_words),                                                                 \
      .help = "The axes of `direction`: `camera` (right, up, towards the eye), so that the light goes with the eye, "  \
              "or `world`.",                                                                                           \
      .default_text = "`camera`")                                                                                      \
    X(CYAML_FIELD_BOOL_PTR("shadows", OPTIONAL, scene_file_light, shadows),                                            \
      .help = "With the image's `shadows`: whether this light casts any.", .default_text = "`true`")
DEFINE_MAPPING(light, "lights", LIGHT_KEYS);
#define OCCLUSION_KEYS(X)                                                                                              \
    X(CYAML_FIELD_INT_PTR("samples", OPTIONAL, scene_file_occlusion, samples),                                         \
      .help = "Rays a pixel and frame. Their error falls as the number; with `antialias` each frame has others.",      \
      .default_text = "`16`", .low = 1, .high = 64)                                                                    \
    X(CYAML_FIELD_FLOAT_PTR("radius", OPTIONAL, scene_file_occlusion, radius),                                         \
      .help = "The largest distance at which something darkens a place, in scene units.",                              \
      .default_text = "a tenth of the diagonal of the bounds of all the data", .low = 0, .is_low_excluded = true,      \
      .high = 1e30)
DEFINE_MAPPING(occlusion, "ambient_occlusion", OCCLUSION_KEYS);
#define SAMPLING_KEYS(X)                                                                                               \
    X(CHOICE("method", scene_file_sampling, method, method_words),                                                     \
      .help = "How a volume is integrated: by samples, or by segments, exact on tetrahedra and of second order in "    \
              "the step elsewhere (of first on rays that graze a step of the opacity). Segments of several volumes "   \
              "are mixed pixel by pixel, slower than samples.",                                                        \
      .default_text = "`segments` of one volume, or with `max_error`; `samples` of several, or with any other key of " \
                      "`sampling`")                                                                                    \
    X(CYAML_FIELD_FLOAT_PTR("max_error", OPTIONAL, scene_file_sampling, max_error),                                    \
      .help = "No channel of a pixel is off by more, in linear light: cells are cut, and integrals taken, as "         \
              "finely as that takes, where the medium is of less than 1000 optical depths across the scene: of "       \
              "a denser one single precision's places of faces may cost more. Steps of `opacity` and ramps as narrow " \
              "as a millionth of the range are kept to it; but polyhedra, mixed volumes and cells that overlap "       \
              "have values in single precision, which in a ramp narrower than 0.01 of the range may cost more: for "   \
              "each unit distance in it 4e-7 times its rise / (its share of the range times the least 1 - opacity "    \
              "in it). On "                                                                                            \
              "tetrahedra, and with tables of many colours, `1e-2` takes a fraction of the time of "                   \
              "`method: segments`. Not with `step`, "                                                                  \
              "`step_cells`, nor `method: samples`.",                                                                  \
      .default_text = "`0.01` of one volume where no other key of `sampling` is given; else by the step", .low = 1e-4, \
      .high = 1)                                                                                                       \
    X(CYAML_FIELD_FLOAT_PTR("step", OPTIONAL, scene_file_sampling, step),                                              \
      .help = "Distance between samples, in scene units. Not with `step_cells`.", .default_text = "by `step_cells`",   \
      .low = 0, .is_low_excluded = true, .high = 1e30)                                                                 \
    X(CYAML_FIELD_FLOAT_PTR("step_cells", OPTIONAL, scene_file_sampling, step_cells),                                  \
      .help =                                                                                                          \
          "Distance between samples in mean cell sizes (a cell's size is the cube root of its volume; the mean is "    \
          "rounded by up to 1.6e-4, so that no partition shows in it). Smaller is finer and slower.",                  \
      .default_text = "`0.5`", .low = 0, .is_low_excluded = true, .high = 1000)                                        \
    X(CYAML_FIELD_BOOL_PTR("jitter", OPTIONAL, scene_file_sampling, jitter),                                           \
      .help = "Shift each pixel's samples by a part of a step of its own: fine noise instead of rings.",               \
      .default_text = "`true`")                                                                                        \
    X(CYAML_FIELD_INT_PTR("frames", OPTIONAL, scene_file_sampling, frames),                                            \
      .help = "Frames of different jitter that are averaged into the image.", .default_text = "`1`", .low = 1,         \
      .high = 4096)                                                                                                    \
    X(CYAML_FIELD_BOOL_PTR("reproducible", OPTIONAL, scene_file_sampling, reproducible),                               \
      .help =                                                                                                          \
          "Volumes are the same to the last bit on any number of ranks and any partition, where no cells overlap; "    \
          "else to 1e-6. A volume takes 1.1 to 1.6 times the time on one rank, and twice on eight, where five "        \
          "fragments go "                                                                                              \
          "from rank to rank in the place of one; several volumes are drawn sample by sample or segment by segment, "  \
          "slower by far.",                                                                                            \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_FLOAT_PTR("max_seconds", OPTIONAL, scene_file_sampling, max_seconds),                                \
      .help = "An image whose samples would take longer, as estimated before it is drawn, is refused with the "        \
              "estimate: a step that is a thousand times too small keeps no run waiting for days.",                    \
      .default_text = "`3600`", .low = 1, .high = 1e9)
DEFINE_MAPPING(sampling, "sampling", SAMPLING_KEYS);

#define PLACEHOLDERS                                                                                                   \
    "`{cycle}` becomes the cycle, `{cycle:06}` the cycle with zeros to 6 digits, `{time}` the time, `{time:.3f}` the " \
    "time as C's printf writes it (`f`, `e` or `g`), `{name}` the image's "                                            \
    "name, `{view}` and `{view:03}` the number of an orbit's view, from 0, `{isovalue}` (formats as of the time), "    \
    "`{plane}` (its number from 0, as `{view}`) and `{field}` those of a `sweep`."

#define WORDS_KEYS(X)                                                                                                  \
    X(TEXT("text", REQUIRED, scene_file_words, text, 255), .help = "One line of text. " PLACEHOLDERS)                  \
    X(CHOICE("at", scene_file_words, at, anchor_words), .help = "Where it stands.", .default_text = "`top_left`")
DEFINE_MAPPING(words, "text", WORDS_KEYS);

static const cyaml_strval_t notation_words[] = {
    {"auto", SCENE_SHORTEST}, {"fixed", SCENE_FIXED}, {"scientific", SCENE_SCIENTIFIC}};

#define COLOUR_BAR_KEYS(X)                                                                                             \
    X(CHOICE("at", scene_file_colour_bar, at, side_words), .help = "The side of the picture.",                         \
      .default_text = "`right`")                                                                                       \
    X(NAMES("labels"),                                                                                                 \
      .help = "The words above a bar; a list of them where there are several bars, in the order of the layers: "       \
              "isosurfaces, surfaces, slices, volumes.",                                                               \
      .default_text = "the names of the fields, with their components: `v x`; `|v|` of a magnitude")                   \
    X(CYAML_FIELD_INT_PTR("ticks", OPTIONAL, scene_file_colour_bar, ticks),                                            \
      .help = "At most so many ticks, at round numbers.", .default_text = "`6`", .low = 2, .high = 12)                 \
    X(NAMES("units"),                                                                                                  \
      .help = "The unit of a bar's numbers, which is written behind its words as `[m/s]`; a list of them where there " \
              "are several bars, in the order of `labels`. One alone is that of all bars.",                            \
      .default_text = "none")                                                                                          \
    X(CHOICE("notation", scene_file_colour_bar, notation, notation_words),                                             \
      .help =                                                                                                          \
          "How numbers are written: `fixed` as 0.25, `scientific` as 2.5e-1; a number that has no room as `fixed`, "   \
          "of more than 30 characters, is written as `scientific`.",                                                   \
      .default_text = "`auto`: `fixed` where that is short")                                                           \
    X(CYAML_FIELD_INT_PTR("digits", OPTIONAL, scene_file_colour_bar, digits), .help = "Digits behind the point.",      \
      .default_text = "as many as tell neighbours apart", .low = 0, .high = 12)
DEFINE_MAPPING(colour_bar, "colour_bar", COLOUR_BAR_KEYS);

static const cyaml_schema_value_t words = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_words, words_fields)};

#define SCALE_BAR_KEYS(X)                                                                                              \
    X(TEXT("unit", OPTIONAL, scene_file_scale_bar, unit, 63),                                                          \
      .help = "The unit of the coordinates, behind the number.", .default_text = "none")                               \
    X(CHOICE("at", scene_file_scale_bar, at, anchor_words), .help = "Where it stands.",                                \
      .default_text = "`bottom_right`")
DEFINE_MAPPING(scale_bar, "scale_bar", SCALE_BAR_KEYS);

static const cyaml_strval_t outline_words[] = {{"false", SCENE_NO_BOX},
                                               {"true", SCENE_BOX_OF_DATA},
                                               {"meshes", SCENE_BOXES_OF_MESHES},
                                               {"ranks", SCENE_BOXES_OF_RANKS}};
#define DECORATIONS_KEYS(X)                                                                                            \
    X(TEXT("title", OPTIONAL, scene_file_decorations, title, 255),                                                     \
      .help = "One line in the middle at the top, larger than other text, with the same placeholders.",                \
      .default_text = "none")                                                                                          \
    X(CYAML_FIELD_SEQUENCE("text", POINTER, scene_file_decorations, text, &words, 1, 16),                              \
      .help = "Lines of text. Those of one place stack.", .default_text = "none", .child = &words_mapping)             \
    X(CYAML_FIELD_MAPPING_PTR("colour_bar", OPTIONAL, scene_file_decorations, colour_bar, colour_bar_fields),          \
      .help = "A bar of colours with its numbers for each layer that is coloured by a field: isosurfaces and "         \
              "surfaces with `colour_by`, slices and volumes. `{}` takes all its defaults.",                           \
      .default_text = "none", .child = &colour_bar_mapping)                                                            \
    X(CHOICE("outline", scene_file_decorations, outline, outline_words),                                               \
      .help = "The edges of the box around all data; or of those around each of the `meshes`, or around what each of " \
              "the `ranks` holds. What is drawn hides edges at the back of a box.",                                    \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_BOOL_PTR("rulers", OPTIONAL, scene_file_decorations, rulers),                                        \
      .help = "Round numbers along three edges of the box around all data. With `fit: box` they have room; else a "    \
              "`zoom` below 1 leaves some.",                                                                           \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("scale_bar", OPTIONAL, scene_file_decorations, scale_bar, scale_bar_fields),             \
      .help =                                                                                                          \
          "A bar of a round length; by a perspective camera that of things as far away as the middle of the data.",    \
      .default_text = "none", .child = &scale_bar_mapping)                                                             \
    X(CYAML_FIELD_BOOL_PTR("axes", OPTIONAL, scene_file_decorations, axes),                                            \
      .help = "The directions of x, y and z, in the lower left corner.", .default_text = "`false`")                    \
    X(NUMBERS("colour", scene_file_decorations, colour, 3), .help = "Colour of words and lines, sRGB.",                \
      .default_text = "light where the background is dark, dark where it is light or transparent", .low = 0,           \
      .high = 1)                                                                                                       \
    X(CYAML_FIELD_FLOAT_PTR("size", OPTIONAL, scene_file_decorations, size),                                           \
      .help = "Height of words as a share of the picture's height.", .default_text = "`0.03`", .low = 0.005,           \
      .high = 0.2)
DEFINE_MAPPING(decorations, "decorations", DECORATIONS_KEYS);

#define OUTPUT_KEYS(X)                                                                                                 \
    X(TEXT("path", OPTIONAL, scene_file_output, path, 1023),                                                           \
      .help =                                                                                                          \
          "File to write, ending in `.png` or `.exr`; relative to the working directory of rank 0; missing "           \
          "folders are made. " PLACEHOLDERS                                                                            \
          " At most 1023 bytes. The channel Z of an EXR is the depth of the nearest surface in the pixel: how far "    \
          "from the eye it is along the camera's axis, in scene units (not along the pixel's ray). Surfaces of any "   \
          "opacity count, 0 as well, and no volume hides them; it is infinite where there is none: volumes and the "   \
          "background have no depth. With `cinema`: a PNG in the database's folder.",                                  \
      .default_text =                                                                                                  \
          "required without `cinema`; with it `{name}_{cycle:06}.png`, and before the ending `_{view:03}`, "           \
          "`_{isovalue}`, `_{plane:02}` and `_{field}` as far as the image has them")                                  \
    X(TEXT("cinema", OPTIONAL, scene_file_output, cinema, 511),                                                        \
      .help =                                                                                                          \
          "Folder of a Cinema database of Spec D, ending in `.cdb`, into which the pictures go: `data.csv` has a "     \
          "line for each, and `index.html` shows them in a browser, without a server. Several images may go into "     \
          "one. A run that begins in a folder which has one drops the lines of its first cycle and of later ones, "    \
          "and goes on.",                                                                                              \
      .default_text = "none")                                                                                          \
    X(CYAML_FIELD_SEQUENCE_FIXED("grid", POINTER, scene_file_output, grid, &whole_number, 2),                          \
      .help =                                                                                                          \
          "Columns and rows of a PNG in which pictures stand side by side: all those of a step whose outputs have "    \
          "the same file, row by row, in the order of the images, of each its sweep's pictures, and of these the "     \
          "views of its orbit. They have one size, each with its own decorations, and all say the same `grid`. A "     \
          "cell whose picture is not due, or could not be drawn, stays transparent. Not with `cinema`. 16 bytes a "    \
          "pixel of the whole are held on rank 0 while a step's pictures are written.",                                \
      .default_text = "none", .low = 1, .high = 16)                                                                    \
    X(CYAML_FIELD_INT_PTR("bits", OPTIONAL, scene_file_output, bits),                                                  \
      .help =                                                                                                          \
          "Bits a channel of a PNG: 8 or 16. EXR always holds 32-bit floats: R, G, B (linear, times A), A, and the "   \
          "depth, Z.",                                                                                                 \
      .default_text = "`8`", .low = 8, .high = 16)                                                                     \
    X(CYAML_FIELD_BOOL_PTR("decorations", OPTIONAL, scene_file_output, decorations),                                   \
      .help = "Draw the image's decorations into this file.", .default_text = "`true` for PNG, `false` for EXR")       \
    X(CYAML_FIELD_BOOL_PTR("data", OPTIONAL, scene_file_output, data),                                                 \
      .help = "An EXR also gets numbers of the nearest surface in the pixel, of any opacity, through the pixel's "     \
              "centre. N.X, N.Y and N.Z are its unit normal towards the eye, in the scene's axes; value is that of "   \
              "the field that colours it, or its isovalue; layer is the number of its layer in the list, from 0, and " \
              "surface that of its isovalue or plane in the layer. 0, NaN and -1 where there is no surface. Two "      \
              "frames of surfaces more are drawn.",                                                                    \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_BOOL_PTR("deep", OPTIONAL, scene_file_output, deep),                                                 \
      .help = "A deep EXR: of every pixel all that lies behind each other, as R, G, B (linear, times A), A, Z and "    \
              "ZBack, from what is nearest on. A surface is a sample with Z and ZBack the same, of volumes each is a " \
              "stretch; none overlaps another, and nothing stands for the background. `oiiotool --flatten` makes the " \
              "picture of it. Through the pixel's centre, whatever `antialias` and `frames` are; with neither "        \
              "`decorations` nor `data`. 24 bytes a sample and 12 a pixel are held on rank 0 until it is written.",    \
      .default_text = "`false`")
DEFINE_MAPPING(output, "outputs", OUTPUT_KEYS);

static const cyaml_schema_value_t light = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_light, light_fields)};
static const cyaml_schema_value_t layer = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_layer, scene_layer_fields)};
static const cyaml_schema_value_t output = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_output, output_fields)};

#define STATISTICS_MESH_HELP                                                                                           \
    "The mesh whose cells count, or a list of meshes, by the names that the simulation gives them, as at a layer."
#define STATISTICS_FIELD_HELP "Name of the field; at most 255 bytes. It is taken as it is, at cells or vertices."

#define CONDITION_KEYS(X)                                                                                              \
    X(TEXT("field", REQUIRED, scene_file_condition, field, 255), .help = STATISTICS_FIELD_HELP)                        \
    X(TEXT("component", OPTIONAL, scene_file_condition, component, 16), .help = COMPONENT_HELP,                        \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(NAMES("mesh"), .help = STATISTICS_MESH_HELP, .default_text = "all meshes that have the field")                   \
    X(CHOICE("of", scene_file_condition, of, statistic_words),                                                         \
      .help = "Which number of the field is looked at; the mean is weighted by the cells' volumes.",                   \
      .default_text = "`maximum`")                                                                                     \
    X(CYAML_FIELD_FLOAT_PTR("above", OPTIONAL, scene_file_condition, above), .help = "It is to be greater than this.", \
      .default_text = "no bound")                                                                                      \
    X(CYAML_FIELD_FLOAT_PTR("below", OPTIONAL, scene_file_condition, below), .help = "It is to be less than this.",    \
      .default_text = "no bound")
DEFINE_MAPPING(condition, "when", CONDITION_KEYS);

#define HISTOGRAM_KEYS(X)                                                                                              \
    X(CYAML_FIELD_INT_PTR("bins", OPTIONAL, scene_file_histogram, bins),                                               \
      .help = "The number of bins, which have equal widths.", .default_text = "`32`", .low = 1, .high = 256)           \
    X(NUMBERS("range", scene_file_histogram, range, 2),                                                                \
      .help = "The values `[low, high]` that the bins cover, low < high. Cells beyond are in no bin.",                 \
      .default_text = "the least and the greatest value of each step")
DEFINE_MAPPING(histogram, "histogram", HISTOGRAM_KEYS);

#define STATISTICS_KEYS(X)                                                                                             \
    X(TEXT("field", REQUIRED, scene_file_statistics, field, 255), .help = STATISTICS_FIELD_HELP)                       \
    X(TEXT("component", OPTIONAL, scene_file_statistics, component, 16), .help = COMPONENT_HELP,                       \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(NAMES("mesh"), .help = STATISTICS_MESH_HELP, .default_text = "all meshes that have the field")                   \
    X(TEXT("path", REQUIRED, scene_file_statistics, path, 1023),                                                       \
      .help = "File to write, ending in `.csv`; relative to the working directory of rank 0; missing folders are "     \
              "made. A run that begins in a folder which has the file drops the lines of its first cycle and of "      \
              "later ones, and goes on.")                                                                              \
    X(CYAML_FIELD_INT_PTR("every", OPTIONAL, scene_file_statistics, every),                                            \
      .help = "Write at the cycles that are multiples of this.", .default_text = "`1`", .low = 1, .high = 1000000000)  \
    X(CYAML_FIELD_MAPPING_PTR("histogram", OPTIONAL, scene_file_statistics, histogram, histogram_fields),              \
      .help = "The share of the volume whose cells' values lie in each of some bins.", .default_text = "none",         \
      .child = &histogram_mapping)
DEFINE_MAPPING(statistics, "statistics", STATISTICS_KEYS);

static const cyaml_schema_value_t statistics = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_statistics, statistics_fields)};

#define IMAGE_KEYS(X)                                                                                                  \
    X(TEXT("name", REQUIRED, scene_file_image, name, 64),                                                              \
      .help = "Name of the image, its own among the images; at most 64 bytes, no `/`.")                                \
    X(CYAML_FIELD_SEQUENCE_FIXED("size", POINTER, scene_file_image, size, &whole_number, 2),                           \
      .help = "Width and height in pixels.", .default_text = "`[1280, 720]`", .low = 1, .high = 32768)                 \
    X(CYAML_FIELD_INT_PTR("every", OPTIONAL, scene_file_image, every),                                                 \
      .help = "Draw at the cycles that are multiples of this.", .default_text = "`1`", .low = 1, .high = 1000000000)   \
    X(CYAML_FIELD_FLOAT_PTR("every_time", OPTIONAL, scene_file_image, every_time),                                     \
      .help =                                                                                                          \
          "Draw at the first step, and whenever the time has passed a multiple of this since the step before. Not "    \
          "with `every`.",                                                                                             \
      .default_text = "by `every`", .low = 0, .is_low_excluded = true, .high = 1e30)                                   \
    X(CYAML_FIELD_MAPPING_PTR("when", OPTIONAL, scene_file_image, when, condition_fields),                             \
      .help = "Draw only in those steps of `every` or `every_time` in which this holds.", .default_text = "always",    \
      .child = &condition_mapping)                                                                                     \
    X(CYAML_FIELD_BOOL_PTR("once", OPTIONAL, scene_file_image, once),                                                  \
      .help = "Draw only at the first of the steps in which the image is due. An edited scene begins anew.",           \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("camera", OPTIONAL, scene_file_image, camera, scene_camera_fields),                      \
      .help = "Where the image is seen from.", .default_text = "automatic", .child = &scene_camera_mapping)            \
    X(CYAML_FIELD_MAPPING_PTR("sweep", OPTIONAL, scene_file_image, sweep, scene_sweep_fields),                         \
      .help = "Draw the image once for each of several values and fields: a picture each.", .default_text = "none",    \
      .child = &scene_sweep_mapping)                                                                                   \
    X(CYAML_FIELD_SEQUENCE("background", POINTER, scene_file_image, background, &number, 3, 4),                        \
      .help = "Colour where nothing is, sRGB, and optionally its opacity.", .default_text = "`[0.08, 0.09, 0.11, 1]`", \
      .low = 0, .high = 1)                                                                                             \
    X(CYAML_FIELD_SEQUENCE("lights", POINTER, scene_file_image, lights, &light, 1, 8),                                 \
      .help = "The lights, in place of the default ones.",                                                             \
      .default_text = "a light from the upper right of the camera and a weaker one from its left",                     \
      .child = &light_mapping)                                                                                         \
    X(CYAML_FIELD_BOOL_PTR("shadows", OPTIONAL, scene_file_image, shadows),                                            \
      .help =                                                                                                          \
          "The opaque isosurfaces, slices and surfaces of all ranks cast shadows on each other, and on transparent "   \
          "ones, by every light that does not say otherwise; the same picture on any partition. Transparent layers "   \
          "and volumes cast none, and volumes have none. A layer that takes no light, as slices by default, has "      \
          "none either. What `clip` cuts away casts none, what the camera does not see casts its own. Of "             \
          "isosurfaces, "                                                                                              \
          "what is nearer to a hit than a fifth of the size of its cell casts none.",                                  \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("ambient_occlusion", OPTIONAL, scene_file_image, ambient_occlusion, occlusion_fields),   \
      .help =                                                                                                          \
          "Darken what is hidden from the open sky, in corners and hollows: of rays from each hit into the "           \
          "hemisphere above it, spread as the cosine, the share that meets no opaque layer within `radius` is a "      \
          "factor on its ambient and diffuse light. By what casts shadows, on what has them. Which rays a pixel has "  \
          "does not change from step to step. Of isosurfaces, what is nearer to a hit than a fifth of its "            \
          "cell's size hides nothing: `radius` is to be several cells. A core asks some 7 million rays a second in "   \
          "tetrahedra, 4 "                                                                                             \
          "million in hexahedra. `{}` takes all its defaults.",                                                        \
      .default_text = "none", .child = &occlusion_mapping)                                                             \
    X(CYAML_FIELD_MAPPING_PTR("clip", OPTIONAL, scene_file_image, clip, scene_clip_fields),                            \
      .help = "Cuts parts of all layers away, exactly, and through the cells; volumes keep their `max_error`.",        \
      .default_text = "nothing is cut away", .child = &scene_clip_mapping)                                             \
    X(CYAML_FIELD_SEQUENCE("layers", CYAML_FLAG_POINTER, scene_file_image, layers, &layer, 1, 20),                     \
      .help = "The layers to draw. Each entry holds one of the keys of a layer.", .child = &scene_layer_mapping)       \
    X(CYAML_FIELD_MAPPING_PTR("sampling", OPTIONAL, scene_file_image, sampling, sampling_fields),                      \
      .help = "How volumes are integrated, and how finely.",                                                           \
      .default_text = "one volume to a `max_error` of 0.01; several by samples, half a cell apart, jittered, to no "   \
                      "known error, of which a warning tells",                                                         \
      .child = &sampling_mapping)                                                                                      \
    X(CYAML_FIELD_INT_PTR("antialias", OPTIONAL, scene_file_image, antialias),                                         \
      .help =                                                                                                          \
          "Samples a pixel, at fixed places in it: 1, 2, 4, 8 or 16, averaged in linear light. Images without "        \
          "volumes take them where a pixel differs from a neighbour of the picture at one sample a pixel, by some 6 "  \
          "of 255 codes, and so miss what is thinner than a pixel and not met by that; those with volumes take them "  \
          "everywhere, each with a jitter of its own (`frames`, rounded up to a multiple of this, if those are "       \
          "more). Depth in an EXR is that of the pixel's centre.",                                                     \
      .default_text = "`1`", .low = 1, .high = 16)                                                                     \
    X(CYAML_FIELD_MAPPING_PTR("decorations", OPTIONAL, scene_file_image, decorations, decorations_fields),             \
      .help =                                                                                                          \
          "Words, bars and lines beside the data. None of them lies over another, and all of them grow with "          \
          "the picture. What is too large is wrapped or made smaller, bars may stand in several columns, and what "    \
          "has no room at all is left out and named by the report. Words need a font: DejaVuSans, or another common "  \
          "one, in the folders that OPENIMAGEIO_FONTS names in rank 0's environment, or else in the system's. The "    \
          "report warns if there is none, or none in the folders named. Words are UTF-8; a character that the font "   \
          "lacks is a box, and the report names it.",                                                                  \
      .default_text = "none", .child = &decorations_mapping)                                                           \
    X(CYAML_FIELD_SEQUENCE("outputs", POINTER, scene_file_image, outputs, &output, 1, 16),                             \
      .help = "Files that the image is written to. No two files of a scene may have the same name. An image without "  \
              "outputs is drawn where the code keeps pictures in memory (`insitu_keep_pictures`), and else not, of "   \
              "which a warning tells.",                                                                                \
      .default_text = "none", .child = &output_mapping)
DEFINE_MAPPING(image, "images", IMAGE_KEYS);

static const cyaml_schema_value_t image = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_image, image_fields)};

#define OF_VELOCITY "The field has 2 or 3 components; `[u, v, w]` names 2 or 3 scalars in its place. "
#define DERIVED_KEYS(X)                                                                                                \
    X(TEXT("name", REQUIRED, scene_file_derived, name, 255),                                                           \
      .help = "The name by which layers, statistics and other derived fields use it: no field of the simulation's. "   \
              "Without `.`, `[`, `]` and quotes.")                                                                     \
    X(TEXT("expression", OPTIONAL, scene_file_derived, expression, 1000),                                              \
      .help = "Of numbers, fields of one component, `u.x`, `u.y`, `u.z`, `u.0` ... of others, `+ - * / ^`, brackets, " \
              "and `sqrt abs exp log log10 sin cos tan min max pow`, `mag(u)`. A name that holds other signs than "    \
              "letters, digits and `_` stands in quotes.",                                                             \
      .default_text = "none")                                                                                          \
    X(NAMES("field"), .help = "A scalar of a field, by `component`, as a layer shows it.", .default_text = "none")     \
    X(NAMES("magnitude"), .help = "The magnitude of a field.", .default_text = "none")                                 \
    X(NAMES("gradient"),                                                                                               \
      .help = "The gradient of a field of one component, or of a component as `u.x`: 3 components, or by `component` " \
              "one, or its magnitude.",                                                                                \
      .default_text = "none")                                                                                          \
    X(NAMES("divergence"), .help = "The divergence of a vector field. " OF_VELOCITY, .default_text = "none")           \
    X(NAMES("vorticity"),                                                                                              \
      .help = "The curl of a vector field: 3 components, or by `component` one, or its magnitude. " OF_VELOCITY,       \
      .default_text = "none")                                                                                          \
    X(NAMES("q_criterion"),                                                                                            \
      .help =                                                                                                          \
          "Half of the square of the rotation rate less that of the strain rate: above 0 in vortices. " OF_VELOCITY,   \
      .default_text = "none")                                                                                          \
    X(NAMES("lambda2"),                                                                                                \
      .help = "The middle eigenvalue of the sum of the squares of the tensors of strain rate and rotation: below 0 "   \
              "in vortices. " OF_VELOCITY,                                                                             \
      .default_text = "none")                                                                                          \
    X(NAMES("strain_rate"),                                                                                            \
      .help = "The size of the strain rate, sqrt(2 S:S): the shear rate of a simple shear. " OF_VELOCITY,              \
      .default_text = "none")                                                                                          \
    X(TEXT("component", OPTIONAL, scene_file_derived, component, 16),                                                  \
      .help = "Beside `field`, `gradient` and `vorticity`: `magnitude`, `x`, `y`, `z`, or a component's number.",      \
      .default_text = "`0` of a `field` of one component, else `magnitude`; of a gradient or vorticity, all three")
DEFINE_MAPPING(derived, "fields", DERIVED_KEYS);

static const cyaml_schema_value_t derived = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_derived, derived_fields)};

static const scene_form parameter_form = {{CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)}, {0}};

#define TOP_KEYS(X)                                                                                                    \
    X(CYAML_FIELD_INT_PTR("threads", OPTIONAL, scene_file, threads),                                                   \
      .help =                                                                                                          \
          "Threads of each rank, as far as there are cores and they can be started; the report warns where there are " \
          "fewer. 0: the cores of the node, shared among its ranks.",                                                  \
      .default_text = "`0`", .low = 0, .high = 4096)                                                                   \
    X(CHOICE("tree", scene_file, tree, tree_words),                                                                    \
      .help = "Trees are built over all cells (`full`), over those that the images can show (`partial`), or over "     \
              "whichever has cost less so far (`auto`). Changes the speed, not the images.",                           \
      .default_text = "`auto`")                                                                                        \
    X(CHOICE("schedule", scene_file, schedule, schedule_words),                                                        \
      .help =                                                                                                          \
          "By which ranks what they have traced goes to those that blend it: at once (`direct`), within nodes "        \
          "first (`nodes`), within nodes and then in rounds of at most 8 (`radix`), in rounds of two (`binary`), or "  \
          "what a model of the network finds cheapest (`auto`). Changes the speed, not the images; the report tells "  \
          "which.",                                                                                                    \
      .default_text = "`auto`")                                                                                        \
    X(CHOICE("writing", scene_file, writing, writing_words),                                                           \
      .help =                                                                                                          \
          "When pictures are written: by a thread of rank 0 while the simulation goes on (`background`), or "          \
          "before `insitu_step` returns (`step`). In the background at most 128 MiB of pictures wait, or one, and "    \
          "a picture that cannot be written is an error of the next step, or of `insitu_destroy`, which waits "        \
          "for all.",                                                                                                  \
      .default_text = "`background`")                                                                                  \
    X(CYAML_FIELD_SEQUENCE("images", CYAML_FLAG_POINTER, scene_file, images, &image, 1, SCENE_MAX_IMAGES),             \
      .help =                                                                                                          \
          "The images to draw. Three frames or more of a step that show the same isosurface, opaque, in one colour a " \
          "value, normals by gradient, share the work of finding its cells, where these are tets or hexes in arrays "  \
          "of float32 and the images have most of a rank's mesh in view: 64 bytes a crossed tet and 128 a "            \
          "hex, at most 64 MiB a rank, are held while the step is drawn.",                                             \
      .child = &image_mapping)                                                                                         \
    X(CYAML_FIELD_SEQUENCE("statistics", POINTER, scene_file, statistics, &statistics, 0, 64),                         \
      .help =                                                                                                          \
          "Numbers of fields, a file each and a line a step: cycle, time, how many cells, their volume, the least "    \
          "and the greatest value, mean and standard deviation, the last two of cells' values (their own, or the "     \
          "mean of their vertices') weighted by volume; then the histogram. Ghost cells, cells of no volume and "      \
          "those with values that are not finite do not count. A field on triangles, quads and polygons alone has "    \
          "their area in the place of the volume; beside cells with a volume they do not count. The same on any "      \
          "partition. Without any cell no line is written.",                                                           \
      .default_text = "none", .child = &statistics_mapping)                                                            \
    X(CYAML_FIELD_SEQUENCE("fields", POINTER, scene_file, fields, &derived, 1, SCENE_MAX_DERIVED),                     \
      .help = "Fields that are made of the simulation's, or of each other: a mapping from their names to what they "   \
              "are, as in [Derived fields](#derived-fields).",                                                         \
      .default_text = "none", .child = &derived_mapping, .is_named = true)                                             \
    X(CYAML_FIELD_IGNORE("parameters", OPTIONAL),                                                                      \
      .help = "Numbers for the simulation, which reads them by `insitu_parameter()`: `parameters: {inflow: 2.5}`. An " \
              "edit of the scene changes them from the step on that reads it, on all ranks at once. A name is a "      \
              "letter or `_` and then letters, digits, `_` or `-`, 63 at most. From the second step on, a parameter "  \
              "that rank 0 has never asked for is a warning.",                                                         \
      .default_text = "none", .named = &parameter_form)
static const cyaml_schema_field_t top_fields[] = {TOP_KEYS(AS_FIELD) CYAML_FIELD_END};
static const scene_key top_keys[] = {TOP_KEYS(AS_KEY)};

const scene_mapping scene_top = {"scene", top_fields, top_keys};
const cyaml_schema_value_t scene_top_value = {CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, scene_file, top_fields)};
