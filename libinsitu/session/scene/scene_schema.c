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
static const cyaml_strval_t corner_words[] = {{"top_left", SCENE_TOP_LEFT},
                                              {"top_right", SCENE_TOP_RIGHT},
                                              {"bottom_left", SCENE_BOTTOM_LEFT},
                                              {"bottom_right", SCENE_BOTTOM_RIGHT}};
static const cyaml_strval_t side_words[] = {{"left", SCENE_LEFT}, {"right", SCENE_RIGHT}};
static const cyaml_strval_t frame_words[] = {{"camera", SCENE_FRAME_CAMERA}, {"world", SCENE_FRAME_WORLD}};

#define LIGHT_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_SEQUENCE_FIXED("direction", CYAML_FLAG_POINTER, scene_file_light, direction, &number, 3),            \
      .help = "From the scene towards the light. Any length except 0.")                                                \
    X(NUMBERS("colour", scene_file_light, colour, 3), .help = "Colour, sRGB.", .default_text = "`[1, 1, 1]`",          \
      .low = 0, .high = 1)                                                                                             \
    X(CYAML_FIELD_FLOAT_PTR("intensity", OPTIONAL, scene_file_light, intensity),                                       \
      .help = "Factor on the colour, in linear light.", .default_text = "`1`", .low = 0, .high = 100)                  \
    X(CHOICE("in", scene_file_light, in, frame_words),                                                                 \
      .help = "The axes of `direction`. With `camera` (right, up, towards the eye) the light moves with the eye. "     \
              "With `world` it does not.",                                                                             \
      .default_text = "`camera`")                                                                                      \
    X(CYAML_FIELD_BOOL_PTR("shadows", OPTIONAL, scene_file_light, shadows),                                            \
      .help = "If the image has `shadows`: whether this light casts shadows.", .default_text = "`true`")
DEFINE_MAPPING(light, "lights", LIGHT_KEYS);
#define OCCLUSION_KEYS(X)                                                                                              \
    X(CYAML_FIELD_INT_PTR("samples", OPTIONAL, scene_file_occlusion, samples),                                         \
      .help = "Rays per pixel and frame. Their error is inversely proportional to this number. With `antialias`, "     \
              "each frame has other rays.",                                                                            \
      .default_text = "`16`", .low = 1, .high = 64)                                                                    \
    X(CYAML_FIELD_FLOAT_PTR("radius", OPTIONAL, scene_file_occlusion, radius),                                         \
      .help = "The largest distance at which something darkens a hit, in scene units.",                                \
      .default_text = "a tenth of the diagonal of the bounds of all the data", .low = 0, .is_low_excluded = true,      \
      .high = 1e30)
DEFINE_MAPPING(occlusion, "ambient_occlusion", OCCLUSION_KEYS);
#define SAMPLING_KEYS(X)                                                                                               \
    X(CHOICE("method", scene_file_sampling, method, method_words),                                                     \
      .help = "How a volume is integrated: by samples or by segments. Segments are exact on tetrahedra. On other "     \
              "cells they are of second order in the step (of first order on rays that graze a step of the opacity). " \
              "Segments of several volumes are mixed pixel by pixel, which is slower than samples.",                   \
      .default_text = "`segments` for one volume, or with `max_error`; `samples` for several volumes, or with any "    \
                      "other key of `sampling`")                                                                       \
    X(CYAML_FIELD_FLOAT_PTR("max_error", OPTIONAL, scene_file_sampling, max_error),                                    \
      .help = "The largest error of each channel of a pixel, in linear light. Cells are divided, and integrals "       \
              "computed, as finely as necessary. The bound also holds for steps of `opacity` and for ramps as narrow " \
              "as a millionth of the range. There are two exceptions. First, if the medium has 1000 optical depths "   \
              "or more across the scene, the positions of faces in single precision may cause a larger error. "        \
              "Second, polyhedra, mixed volumes and overlapping cells have values in single precision, which may add " \
              "an error in a ramp narrower than 0.01 of the range. For each unit distance in the ramp, this error is " \
              "4e-7 times the ramp's rise, divided by (the ramp's share of the range times the least 1 - opacity in "  \
              "it). On tetrahedra, and with tables of many colours, `1e-2` takes a fraction of the time of `method: "  \
              "segments`. Not allowed with `step`, `step_cells` or `method: samples`.",                                \
      .default_text = "`0.01` for one volume if no other key of `sampling` is given; otherwise the step decides",      \
      .low = 1e-4, .high = 1)                                                                                          \
    X(CYAML_FIELD_FLOAT_PTR("step", OPTIONAL, scene_file_sampling, step),                                              \
      .help = "Distance between samples, in scene units. Not allowed with `step_cells`.",                              \
      .default_text = "by `step_cells`", .low = 0, .is_low_excluded = true, .high = 1e30)                              \
    X(CYAML_FIELD_FLOAT_PTR("step_cells", OPTIONAL, scene_file_sampling, step_cells),                                  \
      .help = "Distance between samples, in mean cell sizes. A smaller distance is more accurate and slower. The "     \
              "size of a cell is the cube root of its volume. The mean is rounded by up to 1.6e-4, so that it is the " \
              "same on any partition.",                                                                                \
      .default_text = "`0.5`", .low = 0, .is_low_excluded = true, .high = 1000)                                        \
    X(CYAML_FIELD_BOOL_PTR("jitter", OPTIONAL, scene_file_sampling, jitter),                                           \
      .help =                                                                                                          \
          "Shifts the samples of each pixel by a different part of a step. This gives fine noise instead of rings.",   \
      .default_text = "`true`")                                                                                        \
    X(CYAML_FIELD_INT_PTR("frames", OPTIONAL, scene_file_sampling, frames),                                            \
      .help = "Number of frames with different jitter that are averaged into the image.", .default_text = "`1`",       \
      .low = 1, .high = 4096)                                                                                          \
    X(CYAML_FIELD_BOOL_PTR("reproducible", OPTIONAL, scene_file_sampling, reproducible),                               \
      .help =                                                                                                          \
          "If true, volumes are the same to the last bit on any number of ranks and any partition. Otherwise they "    \
          "are the same to 1e-6. Both hold unless cells overlap or a surface of another mesh, such as a shell, lies "  \
          "within them. A volume takes 1.1 to 1.6 times the time on one rank. On eight ranks it takes twice the "      \
          "time, because ranks send five times as many fragments to each other. Several volumes are drawn sample by "  \
          "sample or segment by segment, which is much slower.",                                                       \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_FLOAT_PTR("max_seconds", OPTIONAL, scene_file_sampling, max_seconds),                                \
      .help = "The longest time that the samples of an image may take, in seconds. The time is estimated before the "  \
              "image is drawn. If it is longer, the image is refused with the estimate. Without this limit, a `step` " \
              "that is a thousand times too small would make a run wait for days.",                                    \
      .default_text = "`3600`", .low = 1, .high = 1e9)
DEFINE_MAPPING(sampling, "sampling", SAMPLING_KEYS);

#define PLACEHOLDERS                                                                                                   \
    "These placeholders are replaced. `{cycle}`: the cycle. `{cycle:06}`: the cycle with zeros to 6 digits. "          \
    "`{time}`: the time. `{time:.3f}`: the time as C's printf writes it (`f`, `e` or `g`). `{name}`: the image's "     \
    "name. `{view}` and `{view:03}`: the number of an orbit's view, from 0. A `sweep` has `{isovalue}` (with formats " \
    "as for the time), `{plane}` (its number from 0, with formats as for `{view}`) and `{field}`."

#define WORDS_KEYS(X)                                                                                                  \
    X(TEXT("text", REQUIRED, scene_file_words, text, 255), .help = "One line of text. " PLACEHOLDERS)                  \
    X(CHOICE("at", scene_file_words, at, anchor_words), .help = "The position in the picture.",                        \
      .default_text = "`top_left`")
DEFINE_MAPPING(words, "text", WORDS_KEYS);

static const cyaml_strval_t notation_words[] = {
    {"auto", SCENE_SHORTEST}, {"fixed", SCENE_FIXED}, {"scientific", SCENE_SCIENTIFIC}};

#define COLOUR_BAR_KEYS(X)                                                                                             \
    X(CHOICE("at", scene_file_colour_bar, at, side_words), .help = "The side of the picture on which the bar is.",     \
      .default_text = "`right`")                                                                                       \
    X(NAMES("labels"),                                                                                                 \
      .help = "The words above a bar. If there are several bars, give a list of them in the order of the layers: "     \
              "isosurfaces, surfaces, slices, volumes.",                                                               \
      .default_text = "the names of the fields, with their components: `v x`; `|v|` for a magnitude")                  \
    X(CYAML_FIELD_INT_PTR("ticks", OPTIONAL, scene_file_colour_bar, ticks),                                            \
      .help = "The largest number of ticks, which are at round numbers.", .default_text = "`6`", .low = 2, .high = 12) \
    X(NAMES("units"),                                                                                                  \
      .help = "The unit of a bar's numbers, which is written after its words as `[m/s]`. If there are several bars, "  \
              "give a list of units in the order of `labels`. A single unit applies to all bars.",                     \
      .default_text = "none")                                                                                          \
    X(CHOICE("notation", scene_file_colour_bar, notation, notation_words),                                             \
      .help = "How numbers are written: `fixed` as 0.25, `scientific` as 2.5e-1. If a number has more than 30 "        \
              "characters as `fixed`, it is written as `scientific`.",                                                 \
      .default_text = "`auto`: `fixed` if that is short")                                                              \
    X(CYAML_FIELD_INT_PTR("digits", OPTIONAL, scene_file_colour_bar, digits),                                          \
      .help = "Number of digits after the decimal point.",                                                             \
      .default_text = "as many as are needed to distinguish neighbouring numbers", .low = 0, .high = 12)
DEFINE_MAPPING(colour_bar, "colour_bar", COLOUR_BAR_KEYS);

static const cyaml_schema_value_t words = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_words, words_fields)};

#define SCALE_BAR_KEYS(X)                                                                                              \
    X(TEXT("unit", OPTIONAL, scene_file_scale_bar, unit, 63),                                                          \
      .help = "The unit of the coordinates, which is written after the number.", .default_text = "none")               \
    X(CHOICE("at", scene_file_scale_bar, at, anchor_words), .help = "The position in the picture.",                    \
      .default_text = "`bottom_right`")
DEFINE_MAPPING(scale_bar, "scale_bar", SCALE_BAR_KEYS);

static const cyaml_strval_t outline_words[] = {{"false", SCENE_NO_BOX},
                                               {"true", SCENE_BOX_OF_DATA},
                                               {"meshes", SCENE_BOXES_OF_MESHES},
                                               {"ranks", SCENE_BOXES_OF_RANKS}};
#define DECORATIONS_KEYS(X)                                                                                            \
    X(TEXT("title", OPTIONAL, scene_file_decorations, title, 255),                                                     \
      .help = "One line in the middle at the top, larger than other text, with the same placeholders as `text`.",      \
      .default_text = "none")                                                                                          \
    X(CYAML_FIELD_SEQUENCE("text", POINTER, scene_file_decorations, text, &words, 1, 16),                              \
      .help = "Lines of text. Lines at the same place are stacked.", .default_text = "none", .child = &words_mapping)  \
    X(CYAML_FIELD_MAPPING_PTR("colour_bar", OPTIONAL, scene_file_decorations, colour_bar, colour_bar_fields),          \
      .help = "A colour bar with numbers for each layer that is coloured by a field: isosurfaces and surfaces with "   \
              "`colour_by`, slices and volumes. `{}` uses all defaults.",                                              \
      .default_text = "none", .child = &colour_bar_mapping)                                                            \
    X(CHOICE("outline", scene_file_decorations, outline, outline_words),                                               \
      .help = "Draws the edges of a box: the box around all data (`true`), a box around each of the `meshes`, or a "   \
              "box around the data of each of the `ranks`. Edges at the back of a box are hidden by what is drawn.",   \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_BOOL_PTR("rulers", OPTIONAL, scene_file_decorations, rulers),                                        \
      .help = "Round numbers along three edges of the box around all data. With `fit: box` the image leaves room for " \
              "them. Otherwise set `zoom` below 1 to leave room.",                                                     \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("scale_bar", OPTIONAL, scene_file_decorations, scale_bar, scale_bar_fields),             \
      .help = "A bar whose length is a round number. With a perspective camera it is the scale at the distance of "    \
              "the middle of the data.",                                                                               \
      .default_text = "none", .child = &scale_bar_mapping)                                                             \
    X(CYAML_FIELD_BOOL_PTR("axes", OPTIONAL, scene_file_decorations, axes),                                            \
      .help = "The directions of x, y and z, in the lower left corner.", .default_text = "`false`")                    \
    X(NUMBERS("colour", scene_file_decorations, colour, 3), .help = "Colour of words and lines, sRGB.",                \
      .default_text = "light if the background is dark, and dark if it is light or transparent", .low = 0, .high = 1)  \
    X(CYAML_FIELD_FLOAT_PTR("size", OPTIONAL, scene_file_decorations, size),                                           \
      .help = "Height of the words, as a share of the picture's height.", .default_text = "`0.03`", .low = 0.005,      \
      .high = 0.2)
DEFINE_MAPPING(decorations, "decorations", DECORATIONS_KEYS);

#define OUTPUT_KEYS(X)                                                                                                 \
    X(TEXT("path", OPTIONAL, scene_file_output, path, 1023),                                                           \
      .help = "File to write, ending in `.png` or `.exr`. The path is relative to the working directory of rank 0. "   \
              "Missing folders are made. " PLACEHOLDERS                                                                \
              " The path has at most 1023 bytes. With `cinema` the file is a PNG in the database's folder. The "       \
              "channel Z of an EXR file is the depth of the nearest surface in the pixel. This is the distance from "  \
              "the eye along the camera's axis, in scene units (not along the pixel's ray). Surfaces of any opacity "  \
              "count, also those with opacity 0, and no volume hides them. Volumes and the background have no depth: " \
              "without a surface the depth is infinite.",                                                              \
      .default_text =                                                                                                  \
          "required without `cinema`. With it, the default is `{name}_{cycle:06}.png`, with `_{view:03}`, "            \
          "`_{isovalue}`, `_{plane:02}` and `_{field}` before the ending if the image has them")                       \
    X(TEXT("cinema", OPTIONAL, scene_file_output, cinema, 511),                                                        \
      .help = "Folder of a Cinema database of Spec D, ending in `.cdb`. The pictures are written into it. `data.csv` " \
              "has a line for each picture, and `index.html` shows them in a browser, without a server. Several "      \
              "images may use the same database. If a run begins in a folder that already has a database, the lines "  \
              "of its first cycle and of later cycles are removed, and the run continues the database.",               \
      .default_text = "none")                                                                                          \
    X(CYAML_FIELD_SEQUENCE_FIXED("grid", POINTER, scene_file_output, grid, &whole_number, 2),                          \
      .help = "Columns and rows of a PNG in which several pictures are placed side by side. These are all pictures "   \
              "of a step whose outputs have the same file. They are placed row by row: first in the order of the "     \
              "images, for each image in the order of its sweep, and for each of these in the order of the views of "  \
              "its orbit. All pictures must have the same size and the same `grid`. Each has its own decorations. A "  \
              "place whose picture is not due, or could not be drawn, stays transparent. Rank 0 holds 16 bytes per "   \
              "pixel of the whole file while a step's pictures are written. Not allowed with `cinema`.",               \
      .default_text = "none", .low = 1, .high = 16)                                                                    \
    X(CYAML_FIELD_BOOL_PTR("shared_bars", OPTIONAL, scene_file_output, shared_bars),                                   \
      .help = "With `grid`: if all pictures of a step have the same colour bars, these are drawn once, in a strip "    \
              "beside the pictures, on the side that the first image's `colour_bar` names. Bars are the same if "      \
              "their words, colours and numbers are. Otherwise each picture has its own bars, the strip stays "        \
              "empty, and a warning says so. All pictures must set the same value, and each image needs a "            \
              "`colour_bar`.",                                                                                         \
      .default_text = "`false`")                                                                                       \
    X(CHOICE("inset", scene_file_output, inset, corner_words),                                                         \
      .help = "Lays the picture, with a grey frame, over a corner of the PNG that earlier outputs with the same file " \
              "and a `grid` make: for example a second image with a closer view. For a single picture below it, use "  \
              "`grid: [1, 1]`. The picture covers what is below it, except that colour bars, texts, the scale bar "    \
              "and the axes of the pictures below keep clear of it. It must leave space on all sides for its frame "   \
              "and a margin of a fiftieth of the file's height. Each corner may have one inset, and insets must not "  \
              "overlap. All outputs of the file with a `grid` come before the insets. If the file has "                \
              "`shared_bars`, the inset lies beside the strip, and is drawn without its own colour bars if they are "  \
              "the shared ones.",                                                                                      \
      .default_text = "none")                                                                                          \
    X(CYAML_FIELD_INT_PTR("bits", OPTIONAL, scene_file_output, bits),                                                  \
      .help = "Bits per channel of a PNG: 8 or 16. EXR always has 32-bit floats: R, G, B (linear, times A), A, and "   \
              "the depth, Z.",                                                                                         \
      .default_text = "`8`", .low = 8, .high = 16)                                                                     \
    X(CYAML_FIELD_BOOL_PTR("decorations", OPTIONAL, scene_file_output, decorations),                                   \
      .help = "Draws the image's decorations into this file.", .default_text = "`true` for PNG, `false` for EXR")      \
    X(CYAML_FIELD_BOOL_PTR("data", OPTIONAL, scene_file_output, data),                                                 \
      .help = "Adds data of the nearest surface of any opacity, at the pixel's centre, to an EXR file. N.X, N.Y and "  \
              "N.Z are the unit normal towards the eye, in the scene's axes. `value` is the value of the field that "  \
              "colours the surface, or its isovalue. `layer` is the number of its layer in the list, from 0. "         \
              "`surface` is the number of its isovalue or plane in the layer. If there is no surface, the normal is "  \
              "0, the value NaN, and the numbers -1. Two more frames of surfaces are drawn for this.",                 \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_BOOL_PTR("deep", OPTIONAL, scene_file_output, deep),                                                 \
      .help = "Writes a deep EXR file. Each pixel has samples of everything along its ray, from the nearest to the "   \
              "farthest, as R, G, B (linear, times A), A, Z and ZBack. A surface is a sample whose Z and ZBack are "   \
              "equal. A volume gives one sample for each continuous part. No samples overlap, and none stands for "    \
              "the background. `oiiotool --flatten` makes the picture from them. The samples are those at the "        \
              "pixel's centre, whatever `antialias` and `frames` are. Rank 0 holds 24 bytes per sample and 12 per "    \
              "pixel until the file is written. Not allowed with `decorations` or `data`.",                            \
      .default_text = "`false`")
DEFINE_MAPPING(output, "outputs", OUTPUT_KEYS);

static const cyaml_schema_value_t light = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_light, light_fields)};
static const cyaml_schema_value_t layer = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_layer, scene_layer_fields)};
static const cyaml_schema_value_t output = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_output, output_fields)};

#define STATISTICS_MESH_HELP                                                                                           \
    "The mesh whose cells count, or a list of meshes, by the names that the simulation gives them, as for a layer."
#define STATISTICS_FIELD_HELP                                                                                          \
    "Name of the field; at most 255 bytes. Its values are used as they are, at cells or vertices."

#define CONDITION_KEYS(X)                                                                                              \
    X(TEXT("field", REQUIRED, scene_file_condition, field, 255), .help = STATISTICS_FIELD_HELP)                        \
    X(TEXT("component", OPTIONAL, scene_file_condition, component, 16), .help = COMPONENT_HELP,                        \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(NAMES("mesh"), .help = STATISTICS_MESH_HELP, .default_text = "all meshes that have the field")                   \
    X(CHOICE("of", scene_file_condition, of, statistic_words),                                                         \
      .help = "The number that is compared. The mean is weighted by the cells' volumes.", .default_text = "`maximum`") \
    X(CYAML_FIELD_FLOAT_PTR("above", OPTIONAL, scene_file_condition, above),                                           \
      .help = "The number must be greater than this.", .default_text = "no bound")                                     \
    X(CYAML_FIELD_FLOAT_PTR("below", OPTIONAL, scene_file_condition, below),                                           \
      .help = "The number must be less than this.", .default_text = "no bound")
DEFINE_MAPPING(condition, "when", CONDITION_KEYS);

#define HISTOGRAM_KEYS(X)                                                                                              \
    X(CYAML_FIELD_INT_PTR("bins", OPTIONAL, scene_file_histogram, bins),                                               \
      .help = "The number of bins, which have equal widths.", .default_text = "`32`", .low = 1, .high = 256)           \
    X(NUMBERS("range", scene_file_histogram, range, 2),                                                                \
      .help = "The values `[low, high]` that the bins cover, low < high. Cells with values outside are in no bin.",    \
      .default_text = "the least and the greatest value of each step")
DEFINE_MAPPING(histogram, "histogram", HISTOGRAM_KEYS);

#define STATISTICS_KEYS(X)                                                                                             \
    X(TEXT("field", REQUIRED, scene_file_statistics, field, 255), .help = STATISTICS_FIELD_HELP)                       \
    X(TEXT("component", OPTIONAL, scene_file_statistics, component, 16), .help = COMPONENT_HELP,                       \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(NAMES("mesh"), .help = STATISTICS_MESH_HELP, .default_text = "all meshes that have the field")                   \
    X(TEXT("path", REQUIRED, scene_file_statistics, path, 1023),                                                       \
      .help = "File to write, ending in `.csv`. The path is relative to the working directory of rank 0. Missing "     \
              "folders are made. If a run begins in a folder that already has the file, the lines of its first cycle " \
              "and of later cycles are removed, and the run continues the file. The same happens if a run goes back "  \
              "in time.")                                                                                              \
    X(CYAML_FIELD_INT_PTR("every", OPTIONAL, scene_file_statistics, every),                                            \
      .help = "Write at the cycles that are multiples of this.", .default_text = "`1`", .low = 1, .high = 1000000000)  \
    X(CYAML_FIELD_MAPPING_PTR("histogram", OPTIONAL, scene_file_statistics, histogram, histogram_fields),              \
      .help = "The share of the volume that has values in each bin. Each cell counts with its value. A cell of "       \
              "higher order counts with the values at its quadrature points.",                                         \
      .default_text = "none", .child = &histogram_mapping)
DEFINE_MAPPING(statistics, "statistics", STATISTICS_KEYS);

static const cyaml_schema_value_t statistics = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_statistics, statistics_fields)};

#define IMAGE_KEYS(X)                                                                                                  \
    X(TEXT("name", REQUIRED, scene_file_image, name, 64),                                                              \
      .help = "Name of the image, unique among the images; at most 64 bytes, without `/`.")                            \
    X(CYAML_FIELD_SEQUENCE_FIXED("size", POINTER, scene_file_image, size, &whole_number, 2),                           \
      .help = "Width and height in pixels.", .default_text = "`[1280, 720]`", .low = 1, .high = 32768)                 \
    X(CYAML_FIELD_INT_PTR("every", OPTIONAL, scene_file_image, every),                                                 \
      .help = "Draw at the cycles that are multiples of this.", .default_text = "`1`", .low = 1, .high = 1000000000)   \
    X(CYAML_FIELD_FLOAT_PTR("every_time", OPTIONAL, scene_file_image, every_time),                                     \
      .help = "Draw at the first step, and whenever the time has passed a multiple of this number since the previous " \
              "step. A step is also drawn if its time or that of the previous step is NaN. Not allowed with `every`.", \
      .default_text = "by `every`", .low = 0, .is_low_excluded = true, .high = 1e30)                                   \
    X(CYAML_FIELD_MAPPING_PTR("when", OPTIONAL, scene_file_image, when, condition_fields),                             \
      .help = "Draw only in those steps of `every` or `every_time` in which this condition holds.",                    \
      .default_text = "always", .child = &condition_mapping)                                                           \
    X(CYAML_FIELD_BOOL_PTR("once", OPTIONAL, scene_file_image, once),                                                  \
      .help = "Draw only in the first of the steps in which the image is due. After an edit of the scene, the image "  \
              "is drawn in the first such step again.",                                                                \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("camera", OPTIONAL, scene_file_image, camera, scene_camera_fields),                      \
      .help = "The viewpoint of the image.", .default_text = "automatic", .child = &scene_camera_mapping)              \
    X(CYAML_FIELD_MAPPING_PTR("sweep", OPTIONAL, scene_file_image, sweep, scene_sweep_fields),                         \
      .help = "Draw the image once for each of several values and fields. Each gives a picture of its own.",           \
      .default_text = "none", .child = &scene_sweep_mapping)                                                           \
    X(CYAML_FIELD_SEQUENCE("background", POINTER, scene_file_image, background, &number, 3, 4),                        \
      .help = "Colour of pixels that show nothing, sRGB, and optionally its opacity.",                                 \
      .default_text = "`[0.08, 0.09, 0.11, 1]`", .low = 0, .high = 1)                                                  \
    X(CYAML_FIELD_SEQUENCE("lights", POINTER, scene_file_image, lights, &light, 1, 8),                                 \
      .help = "The lights, in place of the default ones.",                                                             \
      .default_text = "one light from the upper right of the camera and a weaker one from its left",                   \
      .child = &light_mapping)                                                                                         \
    X(CYAML_FIELD_BOOL_PTR("shadows", OPTIONAL, scene_file_image, shadows),                                            \
      .help = "The opaque isosurfaces, slices and surfaces of all ranks cast shadows on each other and on "            \
              "transparent surfaces. Every light casts shadows unless its own `shadows` is false. The picture is the " \
              "same on any partition. Transparent layers and volumes cast no shadows, and volumes receive none. A "    \
              "layer that is not lit, such as a slice by default, receives none either. What `clip` cuts away casts "  \
              "no shadow. What lies outside the camera's view casts shadows too. A part of an isosurface casts no "    \
              "shadow on a hit that is closer than a fifth of the size of that part's cell.",                          \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("ambient_occlusion", OPTIONAL, scene_file_image, ambient_occlusion, occlusion_fields),   \
      .help = "Darkens corners and hollows. From each hit, rays are sent into the hemisphere above it, in directions " \
              "that are distributed in proportion to the cosine of their angle to the normal. The share of rays that " \
              "meet no opaque layer within `radius` is a factor on the ambient "                                       \
              "and diffuse light of the hit. The layers that block rays and those that are darkened are the same as "  \
              "with `shadows`. The rays of a "                                                                         \
              "pixel do not change from step to step. A part of an isosurface does not hide a hit that is closer "     \
              "than a fifth of the size of that part's cell, so `radius` should be several cells. One core traces "    \
              "some 7 million rays a second in tetrahedra and 4 million in hexahedra. `{}` uses all defaults.",        \
      .default_text = "none", .child = &occlusion_mapping)                                                             \
    X(CYAML_FIELD_MAPPING_PTR("clip", OPTIONAL, scene_file_image, clip, scene_clip_fields),                            \
      .help = "Cuts away parts of all layers, exactly, also through cells. Volumes keep their `max_error`.",           \
      .default_text = "nothing is cut away", .child = &scene_clip_mapping)                                             \
    X(CYAML_FIELD_SEQUENCE("layers", CYAML_FLAG_POINTER, scene_file_image, layers, &layer, 1, 20),                     \
      .help = "The layers to draw. Each entry has one of the keys of a layer.", .child = &scene_layer_mapping)         \
    X(CYAML_FIELD_MAPPING_PTR("sampling", OPTIONAL, scene_file_image, sampling, sampling_fields),                      \
      .help = "How volumes are integrated, and how finely.",                                                           \
      .default_text = "one volume with a `max_error` of 0.01; several volumes by jittered samples half a cell apart, " \
                      "whose error is not known, with a warning",                                                      \
      .child = &sampling_mapping)                                                                                      \
    X(CYAML_FIELD_INT_PTR("antialias", OPTIONAL, scene_file_image, antialias),                                         \
      .help = "Samples per pixel, at fixed places in it: 1, 2, 4, 8 or 16, averaged in linear light. Images without "  \
              "volumes take the additional samples only at pixels that differ from a neighbour, by some 6 of 255 "     \
              "codes, in the picture with one sample per pixel. So they miss things that are thinner than a pixel "    \
              "and that this picture does not show. Images with volumes take all samples at every pixel, each with a " \
              "jitter of its own (`frames`, rounded up to a multiple of this number, if that is more). The depth in "  \
              "an EXR file is that of the pixel's centre.",                                                            \
      .default_text = "`1`", .low = 1, .high = 16)                                                                     \
    X(CYAML_FIELD_MAPPING_PTR("decorations", OPTIONAL, scene_file_image, decorations, decorations_fields),             \
      .help =                                                                                                          \
          "Words, bars and lines in addition to the data. None of them lies over another, and all of them grow with "  \
          "the picture. What is too large is wrapped or made smaller, and bars may be placed in several columns. "     \
          "Anything for which there is no space at all is left out, and the report names it, except the numbers of "   \
          "rulers. Words need a font: DejaVuSans, or another common one. It is looked for in the folders that "        \
          "OPENIMAGEIO_FONTS names in rank 0's environment, and "                                                      \
          "otherwise in the system's folders. The report warns if there is no font, or none in the folders named. "    \
          "Words are UTF-8; a character that the font lacks is a box, and the report names it.",                       \
      .default_text = "none", .child = &decorations_mapping)                                                           \
    X(CYAML_FIELD_SEQUENCE("outputs", POINTER, scene_file_image, outputs, &output, 1, 16),                             \
      .help = "Files to which the image is written. No two files of a scene may have the same name. An image without " \
              "outputs is drawn only if the code keeps pictures in memory (`insitu_keep_pictures`). If it does not, "  \
              "the image is not drawn, and a warning says so.",                                                        \
      .default_text = "none", .child = &output_mapping)
DEFINE_MAPPING(image, "images", IMAGE_KEYS);

static const cyaml_schema_value_t image = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_image, image_fields)};

#define OF_VELOCITY "The field must have 2 or 3 components. `[u, v, w]` can name 2 or 3 scalars instead. "
#define DERIVED_KEYS(X)                                                                                                \
    X(TEXT("name", REQUIRED, scene_file_derived, name, 255),                                                           \
      .help = "The name that layers, statistics and other derived fields use. It must not be the name of a field of "  \
              "the simulation, and must not contain `.`, `[`, `]` or quotes.")                                         \
    X(TEXT("expression", OPTIONAL, scene_file_derived, expression, 1000),                                              \
      .help = "An expression of numbers, fields with one component, components of other fields (`u.x`, `u.y`, `u.z`, " \
              "`u.0` ...), `+ - * / ^`, brackets, `mag(u)`, and the functions `sqrt abs exp log log10 sin cos tan "    \
              "min max pow`. A name with characters other than letters, digits and `_` must be in quotes.",            \
      .default_text = "none")                                                                                          \
    X(NAMES("field"), .help = "One scalar of a field, selected by `component` as in a layer.", .default_text = "none") \
    X(NAMES("magnitude"), .help = "The magnitude of a field.", .default_text = "none")                                 \
    X(NAMES("gradient"),                                                                                               \
      .help = "The gradient of a field with one component, or of a component such as `u.x`. It has 3 components. "     \
              "With `component` it is one of them, or their magnitude.",                                               \
      .default_text = "none")                                                                                          \
    X(NAMES("divergence"), .help = "The divergence of a vector field. " OF_VELOCITY, .default_text = "none")           \
    X(NAMES("vorticity"),                                                                                              \
      .help = "The curl of a vector field. It has 3 components. With `component` it is one of them, or their "         \
              "magnitude. " OF_VELOCITY,                                                                               \
      .default_text = "none")                                                                                          \
    X(NAMES("q_criterion"),                                                                                            \
      .help = "Half of the difference between the square of the rotation rate and the square of the strain rate. It "  \
              "is above 0 in vortices. " OF_VELOCITY,                                                                  \
      .default_text = "none")                                                                                          \
    X(NAMES("lambda2"),                                                                                                \
      .help = "The middle eigenvalue of the sum of the squares of the tensors of strain rate and rotation. It is "     \
              "below 0 in vortices. " OF_VELOCITY,                                                                     \
      .default_text = "none")                                                                                          \
    X(NAMES("strain_rate"),                                                                                            \
      .help =                                                                                                          \
          "The magnitude of the strain rate, sqrt(2 S:S). In a simple shear flow it is the shear rate. " OF_VELOCITY,  \
      .default_text = "none")                                                                                          \
    X(TEXT("component", OPTIONAL, scene_file_derived, component, 16),                                                  \
      .help = "With `field`, `gradient` and `vorticity`: `magnitude`, `x`, `y`, `z`, or a component's number.",        \
      .default_text = "`0` for a `field` with one component, otherwise `magnitude`; for a gradient or vorticity, all " \
                      "three components")
DEFINE_MAPPING(derived, "fields", DERIVED_KEYS);

static const cyaml_schema_value_t derived = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_derived, derived_fields)};

#define WARP_KEYS(X)                                                                                                   \
    X(TEXT("field", REQUIRED, scene_file_warp, field, 255),                                                            \
      .help =                                                                                                          \
          "Name of the field of displacements, one of the simulation's: 3 components at the vertices, or 2, along "    \
          "x and y, on a mesh of triangles, quads and polygons.")                                                      \
    X(CYAML_FIELD_FLOAT_PTR("scale", OPTIONAL, scene_file_warp, scale),                                                \
      .help = "Factor of the displacements. With 0 the mesh is drawn as it is.", .default_text = "`1`", .low = -1e30,  \
      .high = 1e30)
DEFINE_MAPPING(warp, "warp", WARP_KEYS);

static const cyaml_strval_t axis_words[] = {{"x", 0}, {"y", 1}, {"z", 2}};
static const cyaml_schema_value_t axis_word = {
    CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, axis_words, CYAML_ARRAY_LEN(axis_words))};
static const scene_form plane_forms[] = {{{CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)}, {0}}};
typedef struct no_members {
    char unused;
    /* Stands for the struct of a mapping in the schema. The mapping is one of several forms of a value, so that it is
     * read from the tree of the document and has no struct. */
} no_members;

#define MIRROR_KEYS(X)                                                                                                 \
    X(CYAML_FIELD_IGNORE("x", OPTIONAL), .help = "The mirror plane perpendicular to x is at this x.",                  \
      .default_text = "none", .forms = plane_forms, .form_count = 1)                                                   \
    X(CYAML_FIELD_IGNORE("y", OPTIONAL), .help = "The mirror plane perpendicular to y is at this y.",                  \
      .default_text = "none", .forms = plane_forms, .form_count = 1)                                                   \
    X(CYAML_FIELD_IGNORE("z", OPTIONAL), .help = "The mirror plane perpendicular to z is at this z.",                  \
      .default_text = "none", .forms = plane_forms, .form_count = 1)
DEFINE_MAPPING(mirror, "mirror", MIRROR_KEYS);
static const scene_form mirror_forms[] = {
    {{CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, axis_words, CYAML_ARRAY_LEN(axis_words))}, {0}},
    {{CYAML_VALUE_SEQUENCE(CYAML_FLAG_DEFAULT, int, &axis_word, 1, 3)}, {0}},
    {{CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, no_members, mirror_fields)}, {.child = &mirror_mapping}}};

#define MESH_KEYS(X)                                                                                                   \
    X(TEXT("name", REQUIRED, scene_file_mesh, name, 255),                                                              \
      .help = "The name that the simulation gives the mesh; or the beginning of several meshes' names, as at a "       \
              "layer. If several entries apply to a mesh, each key is taken from the entry that has this key and the " \
              "longest name.")                                                                                         \
    X(CYAML_FIELD_MAPPING_PTR("warp", OPTIONAL, scene_file_mesh, warp, warp_fields),                                   \
      .help = "Draw the mesh's vertices at x + `scale` * `field`, as in [Warped meshes](#warped-meshes).",             \
      .default_text = "none", .child = &warp_mapping)                                                                  \
    X(CYAML_FIELD_IGNORE("mirror", OPTIONAL),                                                                          \
      .help = "Draw the mesh together with its mirror images, as in [Mirrored meshes](#mirrored-meshes): an axis, or " \
              "several, whose mirror planes are at 0, or a mapping from axes to the planes' coordinates.",             \
      .default_text = "none", .forms = mirror_forms, .form_count = (int)CYAML_ARRAY_LEN(mirror_forms))
DEFINE_MAPPING(mesh, "meshes", MESH_KEYS);

static const cyaml_schema_value_t mesh = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_mesh, mesh_fields)};

static const scene_form parameter_form = {{CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)}, {0}};

#define TOP_KEYS(X)                                                                                                    \
    X(CYAML_FIELD_INT_PTR("threads", OPTIONAL, scene_file, threads),                                                   \
      .help = "Number of threads of each rank. Fewer are used if there are fewer cores, or if some threads cannot be " \
              "started; the report then warns. 0: the cores of the node, shared among its ranks.",                     \
      .default_text = "`0`", .low = 0, .high = 4096)                                                                   \
    X(CHOICE("tree", scene_file, tree, tree_words),                                                                    \
      .help = "The cells over which trees are built: all cells (`full`), only those that the images can show "         \
              "(`partial`), or whichever of these has cost less so far (`auto`). This changes only the speed, not "    \
              "the images.",                                                                                           \
      .default_text = "`auto`")                                                                                        \
    X(CHOICE("schedule", scene_file, schedule, schedule_words),                                                        \
      .help = "The route by which traced fragments are sent to the ranks that blend them. `direct`: without other "    \
              "ranks in between. `nodes`: within nodes first. `radix`: within nodes, and then in rounds of at most 8 " \
              "ranks. `binary`: in rounds of two ranks. `auto`: the route that is cheapest according to a model of "   \
              "the network. This changes only the speed, not the images. The report names the route.",                 \
      .default_text = "`auto`")                                                                                        \
    X(CHOICE("writing", scene_file, writing, writing_words),                                                           \
      .help = "When pictures are written: by a thread of rank 0 while the simulation goes on (`background`), or "      \
              "before `insitu_step` returns (`step`). In the background, at most 128 MiB of pictures wait, or one "    \
              "picture if it is larger. A picture that cannot be written is then an error of the next step, or of "    \
              "`insitu_destroy`, which waits for all pictures.",                                                       \
      .default_text = "`background`")                                                                                  \
    X(CYAML_FIELD_INT_PTR("finer_pieces", OPTIONAL, scene_file, finer_pieces),                                         \
      .help = "The number of linear pieces along an edge between two neighbouring nodes of a cell of higher order, "   \
              "instead of the number that `surface_error` chooses. With 1, the corners of pieces are the cells' "      \
              "own nodes. With more, the cells' polynomials are also evaluated between the nodes, and surfaces "       \
              "come closer to the polynomial's: with twice as many pieces, their error is divided by 4. Memory "       \
              "and time grow with the number of pieces. See [Cells of higher order](high_order.md#finer-pieces). "     \
              "Linear cells are not affected.",                                                                        \
      .default_text = "by `surface_error`", .low = 1, .high = 12)                                                      \
    X(CYAML_FIELD_FLOAT_PTR("surface_error", OPTIONAL, scene_file, surface_error),                                     \
      .help =                                                                                                          \
          "The largest distance, in pixels, of isosurfaces and of positions in other layers from those of the "        \
          "polynomials of cells of higher order. Such cells are drawn as linear pieces. For each mesh and step, the "  \
          "smallest number of pieces from 1 to 12 is chosen that keeps this error. The report states the numbers and " \
          "the bounds. Volumes get as many pieces as their `max_error` needs. If all cells of a mesh are refined for " \
          "other reasons, it has at most 2 pieces, unless the scene gives this key. By default, isosurfaces that "     \
          "cover few pixels have a smaller error. See [Cells of higher order](high_order.md#an-error-in-pixels).",     \
      .default_text = "`0.25`", .low = 0, .is_low_excluded = true, .high = 1000)                                       \
    X(CYAML_FIELD_FLOAT_PTR("finer_memory", OPTIONAL, scene_file, finer_memory),                                       \
      .help = "Memory in MiB that finer pieces, their nodes and the values there may take on all ranks together. If "  \
              "they would take more, fewer pieces are made, and a warning states the numbers.",                        \
      .default_text = "`4096`", .low = 0, .is_low_excluded = true, .high = 1e12)                                       \
    X(CYAML_FIELD_SEQUENCE("images", CYAML_FLAG_POINTER, scene_file, images, &image, 1, SCENE_MAX_IMAGES),             \
      .help = "The images to draw.", .child = &image_mapping)                                                          \
    X(CYAML_FIELD_SEQUENCE("statistics", POINTER, scene_file, statistics, &statistics, 0, SCENE_MAX_STATISTICS),       \
      .help =                                                                                                          \
          "Statistics of fields. Each entry writes one file with one line per step. A line has the cycle, the "        \
          "time, the number of cells, their volume, the least and the greatest value, the mean and the standard "      \
          "deviation, and then the histogram. Mean and standard deviation are those of the cells' values (their "      \
          "own, or the mean of their vertices' values), weighted by volume. In cells of higher order they are "        \
          "integrals of polynomials: see [Statistics](high_order.md#statistics). Ghost cells, cells without volume "   \
          "and cells with values that are not finite do not count. If the field is only on triangles, quads and "      \
          "polygons, their area is used instead of the volume. If it is also on cells with a volume, only those "      \
          "cells count. The numbers are the same on any partition. No line is written if there are no cells.",         \
      .default_text = "none", .child = &statistics_mapping)                                                            \
    X(CYAML_FIELD_SEQUENCE("fields", POINTER, scene_file, fields, &derived, 1, SCENE_MAX_DERIVED),                     \
      .help = "Fields that are computed from the simulation's fields, or from each other. This is a mapping from "     \
              "their names to their definitions: see [Derived fields](#derived-fields).",                              \
      .default_text = "none", .child = &derived_mapping, .is_named = true)                                             \
    X(CYAML_FIELD_SEQUENCE("meshes", POINTER, scene_file, meshes, &mesh, 1, SCENE_MAX_NAMES),                          \
      .help = "How meshes are drawn: a mapping from their names to what is to be done with them, as "                  \
              "`meshes: {plate: {warp: {field: DISPL, scale: 10}}}`.",                                                 \
      .default_text = "each as it is given", .child = &mesh_mapping, .is_named = true)                                 \
    X(CYAML_FIELD_IGNORE("parameters", OPTIONAL),                                                                      \
      .help = "Numbers for the simulation, which reads them by `insitu_parameter()`: `parameters: {inflow: 2.5}`. An " \
              "edit of the scene changes them from the step on that reads it, on all ranks at once. A name begins "    \
              "with a letter or `_`, followed by letters, digits, `_` or `-`; it has at most 63 characters. If rank "  \
              "0 has never read a parameter, a warning says so from the second step on.",                              \
      .default_text = "none", .named = &parameter_form)
static const cyaml_schema_field_t top_fields[] = {TOP_KEYS(AS_FIELD) CYAML_FIELD_END};
static const scene_key top_keys[] = {TOP_KEYS(AS_KEY)};

const scene_mapping scene_top = {"scene", top_fields, top_keys};
const cyaml_schema_value_t scene_top_value = {CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, scene_file, top_fields)};
