/* One list a mapping holds each key twice over, as libcyaml's field and as our scene_key: the reader, the checks, the
 * error messages and docs/scene.md all come from these lists, so that none can fall behind the others. */
#include "scene_schema.h"

#include "colour_map.h"
#include "scene.h"

#define REQUIRED CYAML_FLAG_DEFAULT
#define OPTIONAL CYAML_FLAG_OPTIONAL
#define POINTER (CYAML_FLAG_OPTIONAL | CYAML_FLAG_POINTER)

#define AS_FIELD(field, ...) field,
#define AS_KEY(field, ...) {__VA_ARGS__},
#define DEFINE_MAPPING(name, the_title, LIST)                                                                          \
    static const cyaml_schema_field_t name##_fields[] = {LIST(AS_FIELD) CYAML_FIELD_END};                              \
    static const scene_key name##_keys[] = {LIST(AS_KEY)};                                                             \
    static const scene_mapping name##_mapping = {the_title, name##_fields, name##_keys}

/* A required or optional text of at most `longest` bytes. */
#define TEXT(key, flags, type, member, longest) CYAML_FIELD_STRING_PTR(key, flags, type, member, 1, longest)
/* An optional list of exactly `count` numbers. */
#define NUMBERS(key, type, member, count) CYAML_FIELD_SEQUENCE_FIXED(key, POINTER, type, member, &number, count)
/* An optional name or list of names. */
#define NAMES(key) CYAML_FIELD_IGNORE(key, OPTIONAL)
#define CHOICE(key, type, member, words)                                                                               \
    CYAML_FIELD_ENUM_PTR(key, CHOICE_FLAGS, type, member, words, CYAML_ARRAY_LEN(words))
#define CHOICE_FLAGS (POINTER | CYAML_FLAG_STRICT)

static const cyaml_schema_value_t number = {CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)};
static const cyaml_schema_value_t whole_number = {CYAML_VALUE_INT(CYAML_FLAG_DEFAULT, int)};
static const cyaml_schema_value_t colour = {CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number, 3)};
static const cyaml_schema_value_t opacity_point = {CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number, 2)};

#define MAP_WORD(word, name) {name, COLOUR_MAP_##word},
static const cyaml_strval_t map_words[] = {COLOUR_MAPS(MAP_WORD)};
static const cyaml_strval_t scale_words[] = {{"linear", SCENE_LINEAR}, {"log", SCENE_LOG}, {"symlog", SCENE_SYMLOG}};
static const cyaml_strval_t method_words[] = {{"samples", SCENE_SAMPLES}, {"segments", SCENE_SEGMENTS}};
static const cyaml_strval_t normal_words[] = {{"gradient", SCENE_GRADIENT}, {"differences", SCENE_DIFFERENCES}};
static const cyaml_strval_t interpolation_words[] = {{"cell", SCENE_BY_CELL}, {"vertex", SCENE_BY_VERTEX}};
static const cyaml_strval_t tree_words[] = {
    {"auto", SCENE_TREE_AUTO}, {"full", SCENE_TREE_FULL}, {"partial", SCENE_TREE_PARTIAL}};
static const cyaml_strval_t anchor_words[] = {{"top_left", SCENE_TOP_LEFT},   {"top", SCENE_TOP},
                                              {"top_right", SCENE_TOP_RIGHT}, {"left", SCENE_LEFT},
                                              {"right", SCENE_RIGHT},         {"bottom_left", SCENE_BOTTOM_LEFT},
                                              {"bottom", SCENE_BOTTOM},       {"bottom_right", SCENE_BOTTOM_RIGHT}};
static const cyaml_strval_t side_words[] = {{"left", SCENE_LEFT}, {"right", SCENE_RIGHT}};
static const cyaml_strval_t fit_words[] = {{"sphere", SCENE_FIT_SPHERE}, {"box", SCENE_FIT_BOX}};
static const cyaml_strval_t projection_words[] = {{"perspective", SCENE_PERSPECTIVE},
                                                  {"orthographic", SCENE_ORTHOGRAPHIC}};
static const cyaml_strval_t frame_words[] = {{"camera", SCENE_FRAME_CAMERA}, {"world", SCENE_FRAME_WORLD}};

#define COMPONENT_HELP "Which scalar of the field: `magnitude`, `x`, `y`, `z`, or a component's number from 0 to 999."
#define COMPONENT_DEFAULT "`0` of a field of one component, else `magnitude`"
#define FIELD_HELP "Name of the field, as the simulation or the file gives it; at most 255 bytes."
#define MESH_HELP                                                                                                      \
    "The mesh that the layer is drawn on, or a list of meshes, by the names that the simulation gives them. A name "   \
    "stands for the meshes below it too: `data` for `data/0`, `data/1`, ..., as the blocks of a file are called."
#define MESH_DEFAULT "the meshes that have the field"
#define INTERPOLATE_HELP                                                                                               \
    "How a field that has one value a cell is drawn: `cell`, as it is, the same throughout each cell; or `vertex`, "   \
    "by "                                                                                                              \
    "the means of the cells at each vertex, on all ranks, interpolated between the vertices (8 bytes a vertex are "    \
    "held). Of no effect on a field that has one value a vertex."
#define ISO_INTERPOLATE_HELP                                                                                           \
    "How a field that has one value a cell is drawn: by the means of the cells at each vertex, on all ranks (8 bytes " \
    "a vertex are held). `cell` is refused: between cells of two values there is a face, not a surface of the value "  \
    "asked for."
#define RANGE_DEFAULT "`data`"

/* A value of several forms, which is read from the document. */
#define FORMS(key) CYAML_FIELD_IGNORE(key, OPTIONAL)
#define TAKES(list) .forms = (list), .form_count = (int)CYAML_ARRAY_LEN(list)

static const scene_form colour_list_forms[] = {
    {{CYAML_VALUE_SEQUENCE(CYAML_FLAG_DEFAULT, double, &colour, 2, 1024)}, {.low = 0, .high = 1}}};
static const scene_form place_list_forms[] = {
    {{CYAML_VALUE_SEQUENCE(CYAML_FLAG_DEFAULT, double, &number, 2, 1024)}, {.low = 0, .high = 1}}};
static const scene_form path_forms[] = {{{CYAML_VALUE_STRING(CYAML_FLAG_POINTER, char *, 1, 1024)}, {0}}};
static const scene_form name_forms[] = {{{CYAML_VALUE_STRING(CYAML_FLAG_POINTER, char *, 1, 255)}, {0}}};
typedef struct no_members {
    char unused;
} no_members; /* libcyaml reads nothing of a mapping that stands for one of several forms */

#define MAP_KEYS(X)                                                                                                    \
    X(CYAML_FIELD_IGNORE("colours", OPTIONAL),                                                                         \
      .help = "Colours `[red, green, blue]`, sRGB, between which the map is straight in sRGB. Not with `file`.",       \
      .by_default = "none", TAKES(colour_list_forms))                                                                  \
    X(CYAML_FIELD_IGNORE("at", OPTIONAL),                                                                              \
      .help = "Where the colours are along the map: as many numbers, from 0 to 1, never falling, the first 0 and the " \
              "last 1; two the same make a step, of a 1024th of the map.",                                             \
      .by_default = "evenly spaced", TAKES(place_list_forms))                                                          \
    X(CYAML_FIELD_IGNORE("file", OPTIONAL),                                                                            \
      .help = "A file of colour maps as ParaView writes them (JSON, `RGBPoints`, or bands by `IndexedColors`), "       \
              "relative to the scene's folder. It "                                                                    \
              "is read on rank 0, again when the scene is.",                                                           \
      .by_default = "none", TAKES(path_forms))                                                                         \
    X(CYAML_FIELD_IGNORE("name", OPTIONAL), .help = "The name of the map in the file. Needed where it holds several.", \
      .by_default = "its only one", TAKES(name_forms))
DEFINE_MAPPING(map, "map", MAP_KEYS);

static const scene_form map_forms[] = {
    {{CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, map_words, CYAML_ARRAY_LEN(map_words))}, {0}},
    {{CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, no_members, map_fields)}, {.child = &map_mapping}}};
static const scene_form percentile_forms[] = {
    {{CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number, 2)}, {.low = 0, .high = 100}}};
#define RANGE_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_IGNORE("percentile", REQUIRED),                                                                      \
      .help = "Two percentages, low < high: the range is from the value that so many of the cells' values are no "     \
              "greater than to the other. A cell counts once, by the middle between its least and greatest value; "    \
              "the same on any partition.",                                                                            \
      TAKES(percentile_forms))
DEFINE_MAPPING(range, "range", RANGE_KEYS);

static const cyaml_strval_t range_words[] = {
    {"data", SCENE_RANGE_DATA}, {"run", SCENE_RANGE_RUN}, {"symmetric", SCENE_RANGE_SYMMETRIC}};
static const scene_form range_forms[] = {
    {{CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number, 2)}, {0}},
    {{CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, range_words, CYAML_ARRAY_LEN(range_words))}, {0}},
    {{CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, no_members, range_fields)}, {.child = &range_mapping}}};

/* The keys that say how values become colours, of any mapping that has a scene_file_colour_map called colours. */
#define COLOUR_MAP_KEYS(X, type)                                                                                       \
    X(FORMS("map"), .help = "Colour map: one that is built in, a list of colours, or one of a file.",                  \
      .by_default = "`viridis`", TAKES(map_forms))                                                                     \
    X(CYAML_FIELD_BOOL_PTR("reversed", OPTIONAL, type, colours.reversed), .help = "The map from its high end.",        \
      .by_default = "`false`")                                                                                         \
    X(CYAML_FIELD_INT_PTR("discrete", OPTIONAL, type, colours.discrete),                                               \
      .help = "So many bands of equal width, each in one colour: those of the map at even places, ends included.",     \
      .by_default = "smooth", .low = 1, .high = 64)                                                                    \
    X(CHOICE("scale", type, colours.scale, scale_words),                                                               \
      .help = "How values are spaced along the map: as they are, by their logarithm (values of 0 and less are below "  \
              "the range), or by `symlog`, linear up to the `threshold` on both sides of 0 and logarithmic beyond: s " \
              "= value / threshold there, and 1 + ln(value / threshold), mirrored.",                                   \
      .by_default = "`linear`")                                                                                        \
    X(CYAML_FIELD_FLOAT_PTR("threshold", OPTIONAL, type, colours.threshold),                                           \
      .help = "Up to what size values are linear by `symlog`, which needs it.", .by_default = "none", .low = 0,        \
      .is_low_excluded = true, .high = 1e300)                                                                          \
    X(NUMBERS("below", type, colours.below, 3), .help = "Colour of values below the range, sRGB.",                     \
      .by_default = "that of its low end", .low = 0, .high = 1)                                                        \
    X(NUMBERS("above", type, colours.above, 3), .help = "Colour of values above the range, sRGB.",                     \
      .by_default = "that of its high end", .low = 0, .high = 1)                                                       \
    X(FORMS("range"),                                                                                                  \
      .help = "The values `[low, high]`, low < high, that the ends of the colour map stand for; clamped outside. Or "  \
              "of the values on the meshes of the layer, over all ranks, at each drawn step: `data`, the least and "   \
              "the greatest (with `scale: log` the least above 0); `symmetric`, the same made as wide on both sides "  \
              "of 0; `run`, the widest of all steps drawn so far, which is kept in the file NAME.ranges beside the "   \
              "first output's pictures, so that a run that is started again goes on with it (delete it to begin "      \
              "anew); or percentiles.",                                                                                \
      .by_default = RANGE_DEFAULT, TAKES(range_forms))

#define AUTOMATIC_KEYS(X)                                                                                              \
    X(NUMBERS("direction", scene_file_automatic, direction, 3),                                                        \
      .help = "From the middle of the data towards the eye. Any length but 0.", .by_default = "`[1, 0.8, 1.2]`")       \
    X(CHOICE("fit", scene_file_automatic, fit, fit_words),                                                             \
      .help = "What fits into the image: the `box` of the data's bounds, which then fills 0.95 of the frame's width "  \
              "or height, or the `sphere` around it, which looks the same size from every side.",                      \
      .by_default = "`sphere`")                                                                                        \
    X(CYAML_FIELD_FLOAT_PTR("zoom", OPTIONAL, scene_file_automatic, zoom), .help = "1 fits; larger is nearer.",        \
      .by_default = "`1`", .low = 1e-4, .high = 1000)
DEFINE_MAPPING(automatic, "automatic", AUTOMATIC_KEYS);

#define CAMERA_KEYS(X)                                                                                                 \
    X(NUMBERS("position", scene_file_camera, position, 3),                                                             \
      .help = "Where the eye is, in scene units. With `focal`; not with `automatic`.", .by_default = "automatic")      \
    X(NUMBERS("focal", scene_file_camera, focal, 3),                                                                   \
      .help = "The point looked at, in the middle of the image. Not where the eye is. With `position`.",               \
      .by_default = "automatic")                                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("automatic", OPTIONAL, scene_file_camera, automatic, automatic_fields),                  \
      .help = "Place the eye by the bounds of all the data of all ranks, at each drawn step.",                         \
      .by_default = "where no `position` is given", .child = &automatic_mapping)                                       \
    X(NUMBERS("up", scene_file_camera, up, 3), .help = "What is up in the image. Not parallel to the view.",           \
      .by_default = "`[0, 1, 0]`; `[0, 0, 1]` where the view is along y")                                              \
    X(CYAML_FIELD_FLOAT_PTR("angle", OPTIONAL, scene_file_camera, angle),                                              \
      .help = "Whole vertical angle of view, in degrees.", .by_default = "`40`", .low = 1e-6, .high = 180,             \
      .is_high_excluded = true)                                                                                        \
    X(CHOICE("projection", scene_file_camera, projection, projection_words),                                           \
      .help = "`orthographic`: all rays are parallel, and equal lengths look equal wherever they are.",                \
      .by_default = "`perspective`")                                                                                   \
    X(CYAML_FIELD_FLOAT_PTR("height", OPTIONAL, scene_file_camera, height),                                            \
      .help = "With `projection: orthographic`: the height of what the image shows, in scene units.",                  \
      .by_default = "what fits the data; with `position`, what a perspective image shows at `focal`", .low = 0,        \
      .is_low_excluded = true, .high = 1e30)
DEFINE_MAPPING(camera, "camera", CAMERA_KEYS);

#define LIGHT_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_SEQUENCE_FIXED("direction", CYAML_FLAG_POINTER, scene_file_light, direction, &number, 3),            \
      .help = "From the scene towards the light. Any length but 0.")                                                   \
    X(NUMBERS("colour", scene_file_light, colour, 3), .help = "Colour, sRGB.", .by_default = "`[1, 1, 1]`", .low = 0,  \
      .high = 1)                                                                                                       \
    X(CYAML_FIELD_FLOAT_PTR("intensity", OPTIONAL, scene_file_light, intensity),                                       \
      .help = "Factor on the colour, in linear light.", .by_default = "`1`", .low = 0, .high = 100)                    \
    X(CHOICE("in", scene_file_light, in, frame_words),                                                                 \
      .help = "The axes of `direction`: `camera` (right, up, towards the eye), so that the light goes with the eye, "  \
              "or `world`.",                                                                                           \
      .by_default = "`camera`")
DEFINE_MAPPING(light, "lights", LIGHT_KEYS);

#define MATERIAL_KEYS(X)                                                                                               \
    X(CYAML_FIELD_FLOAT_PTR("ambient", OPTIONAL, scene_file_material, ambient),                                        \
      .help = "Share of the colour that is seen without any light.", .by_default = "`0.15`", .low = 0, .high = 1)      \
    X(CYAML_FIELD_FLOAT_PTR("diffuse", OPTIONAL, scene_file_material, diffuse),                                        \
      .help = "Share of the colour that is seen in full light.", .by_default = "`0.75`", .low = 0, .high = 1)          \
    X(CYAML_FIELD_FLOAT_PTR("specular", OPTIONAL, scene_file_material, specular),                                      \
      .help = "Strength of the highlight (Blinn-Phong), of the light's colour.", .by_default = "`0.25`", .low = 0,     \
      .high = 1)                                                                                                       \
    X(CYAML_FIELD_FLOAT_PTR("shininess", OPTIONAL, scene_file_material, shininess),                                    \
      .help = "Exponent of the highlight: larger is smaller and sharper.", .by_default = "`32`", .low = 1,             \
      .high = 10000)
DEFINE_MAPPING(material, "material", MATERIAL_KEYS);

#define COLOUR_BY_KEYS(X)                                                                                              \
    X(TEXT("field", REQUIRED, scene_file_colour_by, field, 255), .help = FIELD_HELP)                                   \
    X(TEXT("component", OPTIONAL, scene_file_colour_by, component, 16), .help = COMPONENT_HELP,                        \
      .by_default = COMPONENT_DEFAULT)                                                                                 \
    X(CHOICE("interpolate", scene_file_colour_by, interpolate, interpolation_words), .help = INTERPOLATE_HELP,         \
      .by_default = "`cell`")                                                                                          \
    COLOUR_MAP_KEYS(X, scene_file_colour_by)                                                                           \
    X(NUMBERS("nan", scene_file_colour_by, colours.nan, 3),                                                            \
      .help = "Colour where the field is not a number, and on meshes that do not have it, sRGB.",                      \
      .by_default = "grey, `[0.6, 0.6, 0.6]`", .low = 0, .high = 1)
DEFINE_MAPPING(colour_by, "colour_by", COLOUR_BY_KEYS);

#define ISOSURFACE_KEYS(X)                                                                                             \
    X(TEXT("field", REQUIRED, scene_file_isosurface, field, 255), .help = FIELD_HELP)                                  \
    X(TEXT("component", OPTIONAL, scene_file_isosurface, component, 16), .help = COMPONENT_HELP,                       \
      .by_default = COMPONENT_DEFAULT)                                                                                 \
    X(CHOICE("interpolate", scene_file_isosurface, interpolate, interpolation_words), .help = ISO_INTERPOLATE_HELP,    \
      .by_default = "`vertex`")                                                                                        \
    X(NAMES("mesh"), .help = MESH_HELP, .by_default = MESH_DEFAULT)                                                    \
    X(CYAML_FIELD_SEQUENCE("values", CYAML_FLAG_POINTER, scene_file_isosurface, values, &number, 1, 16),               \
      .help = "The values at which surfaces are drawn, none twice. At most 16 in all isosurfaces of an image "         \
              "together.")                                                                                             \
    X(CYAML_FIELD_SEQUENCE("colours", POINTER, scene_file_isosurface, colours, &colour, 1, 16),                        \
      .help = "Colours of the values in turn, sRGB; the last serves all values that are left. Not with `colour_by`.",  \
      .by_default = "colours that differ, from a fixed cycle", .low = 0, .high = 1)                                    \
    X(CYAML_FIELD_MAPPING_PTR("colour_by", OPTIONAL, scene_file_isosurface, colour_by, colour_by_fields),              \
      .help = "Colour the surfaces by a field. They are grey, with a warning, on meshes of the layer that do not "     \
              "have it, and where it is not a number.",                                                                \
      .by_default = "by `colours`", .child = &colour_by_mapping)                                                       \
    X(CYAML_FIELD_FLOAT_PTR("opacity", OPTIONAL, scene_file_isosurface, opacity),                                      \
      .help = "1 hides what is behind; 0 shows nothing.", .by_default = "`1`", .low = 0, .high = 1)                    \
    X(CYAML_FIELD_MAPPING_PTR("material", OPTIONAL, scene_file_isosurface, material, material_fields),                 \
      .help = "How the surfaces take light.", .by_default = "a slight gloss", .child = &material_mapping)              \
    X(CHOICE("normals", scene_file_isosurface, normals, normal_words),                                                 \
      .help = "What light falls on: the `gradient` of the cell that is hit, which changes from cell to cell, or "      \
              "central `differences` about the hit, smoother and slower, over the cells of one rank.",                 \
      .by_default = "`gradient`")                                                                                      \
    X(CYAML_FIELD_FLOAT_PTR("difference", OPTIONAL, scene_file_isosurface, difference),                                \
      .help = "Distance between the two samples of a difference, in sizes of the cell that is hit.",                   \
      .by_default = "`1`", .low = 0, .is_low_excluded = true, .high = 100)
DEFINE_MAPPING(isosurface, "isosurface", ISOSURFACE_KEYS);

#define VOLUME_KEYS(X)                                                                                                 \
    X(TEXT("field", REQUIRED, scene_file_volume, field, 255), .help = FIELD_HELP)                                      \
    X(TEXT("component", OPTIONAL, scene_file_volume, component, 16), .help = COMPONENT_HELP,                           \
      .by_default = COMPONENT_DEFAULT)                                                                                 \
    X(CHOICE("interpolate", scene_file_volume, interpolate, interpolation_words), .help = INTERPOLATE_HELP,            \
      .by_default = "`cell`")                                                                                          \
    X(NAMES("mesh"), .help = MESH_HELP, .by_default = MESH_DEFAULT)                                                    \
    COLOUR_MAP_KEYS(X, scene_file_volume)                                                                              \
    X(CYAML_FIELD_SEQUENCE("opacity", POINTER, scene_file_volume, opacity, &opacity_point, 1, 32),                     \
      .help =                                                                                                          \
          "Points `[at, opacity]`, joined by straight lines: `at` 0 is the low end of the range and 1 the high "       \
          "end, never falling (twice the same makes a step); opacity is that of `unit_distance`. By a `scale` the "    \
          "lines are straight along it, to 0.002 of the height of one ramp over six decades and 0.02 of that of "      \
          "seven (twice that by `symlog`), and there are at most 8 points.",                                           \
      .by_default = "`[[0, 0], [1, 0.9]]`", .low = 0, .high = 1)                                                       \
    X(CYAML_FIELD_FLOAT_PTR("unit_distance", OPTIONAL, scene_file_volume, unit_distance),                              \
      .help = "The length in scene units that lets 1 - opacity of the light through.",                                 \
      .by_default = "a twentieth of the diagonal of the bounds", .low = 0, .is_low_excluded = true, .high = 1e30)
DEFINE_MAPPING(volume, "volume", VOLUME_KEYS);

#define PLANE_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_SEQUENCE_FIXED("normal", CYAML_FLAG_POINTER, scene_file_plane, normal, &number, 3),                  \
      .help = "What the plane is at right angles to. Any length but 0.")                                               \
    X(NUMBERS("point", scene_file_plane, point, 3), .help = "A point of the plane, in scene units.",                   \
      .by_default = "the middle of the bounds of all the data, at each drawn step")                                    \
    X(CYAML_FIELD_FLOAT_PTR("offset", OPTIONAL, scene_file_plane, offset),                                             \
      .help = "How far the plane is moved from `point` along `normal`, in scene units.", .by_default = "`0`")
DEFINE_MAPPING(plane, "planes", PLANE_KEYS);

static const cyaml_schema_value_t plane = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_plane, plane_fields)};

#define CLIP_KEYS(X)                                                                                                   \
    X(CYAML_FIELD_SEQUENCE("planes", POINTER, scene_file_clip, planes, &plane, 1, 10),                                 \
      .help = "Planes. What lies on the side of any of them that its `normal` points to is cut away. A slice in the "  \
              "plane itself is not.",                                                                                  \
      .by_default = "none", .child = &plane_mapping)                                                                   \
    X(CYAML_FIELD_SEQUENCE_FIXED("box", POINTER, scene_file_clip, box, &colour, 2),                                    \
      .help = "Two corners, `[[x, y, z], [x, y, z]]`, the first less than the other along each axis. What lies "       \
              "outside of the box is cut away.",                                                                       \
      .by_default = "none")
DEFINE_MAPPING(clip, "clip", CLIP_KEYS);

#define SLICE_KEYS(X)                                                                                                  \
    X(TEXT("field", REQUIRED, scene_file_slice, field, 255),                                                           \
      .help = "Name of the field that colours the planes; at most 255 bytes.")                                         \
    X(TEXT("component", OPTIONAL, scene_file_slice, component, 16), .help = COMPONENT_HELP,                            \
      .by_default = COMPONENT_DEFAULT)                                                                                 \
    X(CHOICE("interpolate", scene_file_slice, interpolate, interpolation_words), .help = INTERPOLATE_HELP,             \
      .by_default = "`cell`")                                                                                          \
    X(NAMES("mesh"), .help = MESH_HELP, .by_default = MESH_DEFAULT)                                                    \
    X(CYAML_FIELD_SEQUENCE("planes", CYAML_FLAG_POINTER, scene_file_slice, planes, &plane, 1, 16),                     \
      .help = "The planes. At most 16 isovalues and planes in an image together. 4 bytes a vertex are held for each "  \
              "plane. A plane that lies in faces of cells is drawn once, by the cells that its normal points away "    \
              "from; so that one on the border of the data is seen too, it is taken into them where it lies within a " \
              "millionth of half the diagonal of their bounds from it.",                                               \
      .child = &plane_mapping)                                                                                         \
    COLOUR_MAP_KEYS(X, scene_file_slice)                                                                               \
    X(NUMBERS("nan", scene_file_slice, colours.nan, 3), .help = "Colour where the field is not a number, sRGB.",       \
      .by_default = "grey, `[0.6, 0.6, 0.6]`", .low = 0, .high = 1)                                                    \
    X(CYAML_FIELD_FLOAT_PTR("opacity", OPTIONAL, scene_file_slice, opacity),                                           \
      .help = "1 hides what is behind; 0 shows nothing.", .by_default = "`1`", .low = 0, .high = 1)                    \
    X(CYAML_FIELD_MAPPING_PTR("material", OPTIONAL, scene_file_slice, material, material_fields),                      \
      .help = "How the planes take light, as an isosurface where it is given; `{}` for a slight gloss.",               \
      .by_default = "no light: the colours are those of the map", .child = &material_mapping)
DEFINE_MAPPING(slice, "slice", SLICE_KEYS);

#define EDGES_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_FLOAT_PTR("width", OPTIONAL, scene_file_edges, width), .help = "Width of the lines, in pixels.",     \
      .by_default = "a 900th of the picture's height, but at least 1", .low = 0.5, .high = 100)                        \
    X(NUMBERS("colour", scene_file_edges, colour, 3), .help = "Colour of the lines, sRGB, before light falls on it.",  \
      .by_default = "`[0.1, 0.1, 0.1]`", .low = 0, .high = 1)
DEFINE_MAPPING(edges, "edges", EDGES_KEYS);

#define THRESHOLD_KEYS(X)                                                                                              \
    X(TEXT("field", REQUIRED, scene_file_threshold, field, 255),                                                       \
      .help = "Name of the field; at most 255 bytes. Meshes that do not have it show nothing of the layer.")           \
    X(TEXT("component", OPTIONAL, scene_file_threshold, component, 16), .help = COMPONENT_HELP,                        \
      .by_default = COMPONENT_DEFAULT)                                                                                 \
    X(CYAML_FIELD_FLOAT_PTR("from", OPTIONAL, scene_file_threshold, from), .help = "The least value that is shown.",   \
      .by_default = "none")                                                                                            \
    X(CYAML_FIELD_FLOAT_PTR("to", OPTIONAL, scene_file_threshold, to), .help = "The greatest value that is shown.",    \
      .by_default = "none")
DEFINE_MAPPING(threshold, "threshold", THRESHOLD_KEYS);

#define SURFACE_KEYS(X)                                                                                                \
    X(NAMES("mesh"), .help = "The mesh whose outer surface is drawn, or a list of meshes, as at an isosurface.",       \
      .by_default = "all meshes")                                                                                      \
    X(NUMBERS("colour", scene_file_surface, colour, 3), .help = "Colour, sRGB. Not with `colour_by`.",                 \
      .by_default = "`[0.8, 0.8, 0.8]`", .low = 0, .high = 1)                                                          \
    X(CYAML_FIELD_MAPPING_PTR("colour_by", OPTIONAL, scene_file_surface, colour_by, colour_by_fields),                 \
      .help = "Colour the surface by a field. It is grey, with a warning, on meshes of the layer that do not have "    \
              "it, and where it is not a number.",                                                                     \
      .by_default = "by `colour`", .child = &colour_by_mapping)                                                        \
    X(CYAML_FIELD_MAPPING_PTR("edges", OPTIONAL, scene_file_surface, edges, edges_fields),                             \
      .help = "Lines along the edges of the cells' faces; `{}` takes all its defaults. They fade where faces are "     \
              "hardly wider than lines.",                                                                              \
      .by_default = "none", .child = &edges_mapping)                                                                   \
    X(CYAML_FIELD_MAPPING_PTR("threshold", OPTIONAL, scene_file_surface, threshold, threshold_fields),                 \
      .help = "Only cells whose value lies within bounds are there, with the field at vertices those all of whose "    \
              "vertices' values do; what is drawn is the outer surface of these. It is found anew when the values "    \
              "have changed.",                                                                                         \
      .by_default = "all cells", .child = &threshold_mapping)                                                          \
    X(CYAML_FIELD_FLOAT_PTR("opacity", OPTIONAL, scene_file_surface, opacity),                                         \
      .help = "1 hides what is behind; 0 shows nothing.", .by_default = "`1`", .low = 0, .high = 1)                    \
    X(CYAML_FIELD_MAPPING_PTR("material", OPTIONAL, scene_file_surface, material, material_fields),                    \
      .help = "How the surface takes light; `{ambient: 1, diffuse: 0, specular: 0}` shows the colours of the map.",    \
      .by_default = "a slight gloss", .child = &material_mapping)
DEFINE_MAPPING(surface, "surface", SURFACE_KEYS);

#define LAYER_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_MAPPING_PTR("isosurface", OPTIONAL, scene_file_layer, isosurface, isosurface_fields),                \
      .help = "Surfaces on which a field has given values.", .by_default = "none", .child = &isosurface_mapping)       \
    X(CYAML_FIELD_MAPPING_PTR("volume", OPTIONAL, scene_file_layer, volume, volume_fields),                            \
      .help = "A field as coloured mist. At most 4 in an image.", .by_default = "none", .child = &volume_mapping)      \
    X(CYAML_FIELD_MAPPING_PTR("slice", OPTIONAL, scene_file_layer, slice, slice_fields),                               \
      .help = "Planes through the cells, coloured by a field.", .by_default = "none", .child = &slice_mapping)         \
    X(CYAML_FIELD_MAPPING_PTR("surface", OPTIONAL, scene_file_layer, surface, surface_fields),                         \
      .help = "The outer surface of meshes: the faces that one cell alone has, of the cells of all ranks but ghosts. " \
              "Faces are one where their vertices are, by global ids or else by equal coordinates; a face that meets " \
              "smaller ones, at hanging nodes, is drawn, and so are these. They are found once for a mesh, and "       \
              "some 250 bytes a face are held. Each counts as one isovalue.",                                          \
      .by_default = "none", .child = &surface_mapping)
DEFINE_MAPPING(layer, "layers", LAYER_KEYS);

#define SAMPLING_KEYS(X)                                                                                               \
    X(CHOICE("method", scene_file_sampling, method, method_words),                                                     \
      .help = "How a volume is integrated: by samples, or by segments, exact on tetrahedra and of second order in "    \
              "the step elsewhere (of first on rays that graze a step of the opacity). Segments of several volumes "   \
              "are mixed pixel by pixel, slower than samples.",                                                        \
      .by_default = "`segments` of one volume, or with `max_error`; `samples` of several, or with any other key of "   \
                    "`sampling`")                                                                                      \
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
      .by_default = "`0.01` of one volume where no other key of `sampling` is given; else by the step", .low = 1e-4,   \
      .high = 1)                                                                                                       \
    X(CYAML_FIELD_FLOAT_PTR("step", OPTIONAL, scene_file_sampling, step),                                              \
      .help = "Distance between samples, in scene units. Not with `step_cells`.", .by_default = "by `step_cells`",     \
      .low = 0, .is_low_excluded = true, .high = 1e30)                                                                 \
    X(CYAML_FIELD_FLOAT_PTR("step_cells", OPTIONAL, scene_file_sampling, step_cells),                                  \
      .help =                                                                                                          \
          "Distance between samples in mean cell sizes (a cell's size is the cube root of its volume; the mean is "    \
          "rounded by up to 1.6e-4, so that no partition shows in it). Smaller is finer and slower.",                  \
      .by_default = "`0.5`", .low = 0, .is_low_excluded = true, .high = 1000)                                          \
    X(CYAML_FIELD_BOOL_PTR("jitter", OPTIONAL, scene_file_sampling, jitter),                                           \
      .help = "Shift each pixel's samples by a part of a step of its own: fine noise instead of rings.",               \
      .by_default = "`true`")                                                                                          \
    X(CYAML_FIELD_INT_PTR("frames", OPTIONAL, scene_file_sampling, frames),                                            \
      .help = "Frames of different jitter that are averaged into the image.", .by_default = "`1`", .low = 1,           \
      .high = 4096)                                                                                                    \
    X(CYAML_FIELD_FLOAT_PTR("max_seconds", OPTIONAL, scene_file_sampling, max_seconds),                                \
      .help = "An image whose samples would take longer, as estimated before it is drawn, is refused with the "        \
              "estimate: a step that is a thousand times too small keeps no run waiting for days.",                    \
      .by_default = "`3600`", .low = 1, .high = 1e9)
DEFINE_MAPPING(sampling, "sampling", SAMPLING_KEYS);

#define PLACEHOLDERS                                                                                                   \
    "`{cycle}` becomes the cycle, `{cycle:06}` the cycle with zeros to 6 digits, `{time}` the time, `{time:.3f}` the " \
    "time as C's printf writes it (`f`, `e` or `g`), `{name}` the image's name."

#define WORDS_KEYS(X)                                                                                                  \
    X(TEXT("text", REQUIRED, scene_file_words, text, 255), .help = "One line of text. " PLACEHOLDERS)                  \
    X(CHOICE("at", scene_file_words, at, anchor_words), .help = "Where it stands.", .by_default = "`top_left`")
DEFINE_MAPPING(words, "text", WORDS_KEYS);

#define COLOUR_BAR_KEYS(X)                                                                                             \
    X(CHOICE("at", scene_file_colour_bar, at, side_words), .help = "The side of the picture.",                         \
      .by_default = "`right`")                                                                                         \
    X(NAMES("labels"),                                                                                                 \
      .help = "The words above a bar, units for instance; a list of them where there are several bars, in the order "  \
              "of the layers: isosurfaces, surfaces, slices, volumes.",                                                \
      .by_default = "the names of the fields, with their components")                                                  \
    X(CYAML_FIELD_INT_PTR("ticks", OPTIONAL, scene_file_colour_bar, ticks),                                            \
      .help = "At most so many ticks, at round numbers.", .by_default = "`6`", .low = 2, .high = 12)
DEFINE_MAPPING(colour_bar, "colour_bar", COLOUR_BAR_KEYS);

static const cyaml_schema_value_t words = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_words, words_fields)};

#define DECORATIONS_KEYS(X)                                                                                            \
    X(TEXT("title", OPTIONAL, scene_file_decorations, title, 255),                                                     \
      .help = "One line in the middle at the top, larger than other text, with the same placeholders.",                \
      .by_default = "none")                                                                                            \
    X(CYAML_FIELD_SEQUENCE("text", POINTER, scene_file_decorations, text, &words, 1, 16),                              \
      .help = "Lines of text. Those of one place stack.", .by_default = "none", .child = &words_mapping)               \
    X(CYAML_FIELD_MAPPING_PTR("colour_bar", OPTIONAL, scene_file_decorations, colour_bar, colour_bar_fields),          \
      .help = "A bar of colours with its numbers for each layer that is coloured by a field: isosurfaces and "         \
              "surfaces with `colour_by`, slices and volumes. `{}` takes all its defaults.",                           \
      .by_default = "none", .child = &colour_bar_mapping)                                                              \
    X(CYAML_FIELD_BOOL_PTR("outline", OPTIONAL, scene_file_decorations, outline),                                      \
      .help = "The edges of the box around all data; what is drawn hides those that lie behind it.",                   \
      .by_default = "`false`")                                                                                         \
    X(CYAML_FIELD_BOOL_PTR("axes", OPTIONAL, scene_file_decorations, axes),                                            \
      .help = "The directions of x, y and z, in the lower left corner.", .by_default = "`false`")                      \
    X(NUMBERS("colour", scene_file_decorations, colour, 3), .help = "Colour of words and lines, sRGB.",                \
      .by_default = "light where the background is dark, dark where it is light or transparent", .low = 0, .high = 1)  \
    X(CYAML_FIELD_FLOAT_PTR("size", OPTIONAL, scene_file_decorations, size),                                           \
      .help = "Height of words as a share of the picture's height.", .by_default = "`0.03`", .low = 0.005,             \
      .high = 0.2)
DEFINE_MAPPING(decorations, "decorations", DECORATIONS_KEYS);

#define OUTPUT_KEYS(X)                                                                                                 \
    X(TEXT("path", REQUIRED, scene_file_output, path, 1023),                                                           \
      .help =                                                                                                          \
          "File to write, ending in `.png` or `.exr`; relative to the working directory of rank 0; missing "           \
          "folders are made. " PLACEHOLDERS                                                                            \
          " At most 1023 bytes. The channel Z of an EXR is the depth of the nearest surface in the pixel: how far "    \
          "from the eye it is along the camera's axis, in scene units (not along the pixel's ray). Surfaces of any "   \
          "opacity count, 0 as well, and no volume hides them; it is infinite where there is none: volumes and the "   \
          "background have no depth.")                                                                                 \
    X(CYAML_FIELD_INT_PTR("bits", OPTIONAL, scene_file_output, bits),                                                  \
      .help =                                                                                                          \
          "Bits a channel of a PNG: 8 or 16. EXR always holds 32-bit floats: R, G, B (linear, times A), A, and the "   \
          "depth, Z.",                                                                                                 \
      .by_default = "`8`", .low = 8, .high = 16)                                                                       \
    X(CYAML_FIELD_BOOL_PTR("decorations", OPTIONAL, scene_file_output, decorations),                                   \
      .help = "Draw the image's decorations into this file.", .by_default = "`true` for PNG, `false` for EXR")
DEFINE_MAPPING(output, "outputs", OUTPUT_KEYS);

static const cyaml_schema_value_t light = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_light, light_fields)};
static const cyaml_schema_value_t layer = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_layer, layer_fields)};
static const cyaml_schema_value_t output = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_output, output_fields)};

#define IMAGE_KEYS(X)                                                                                                  \
    X(TEXT("name", REQUIRED, scene_file_image, name, 64),                                                              \
      .help = "Name of the image, its own among the images; at most 64 bytes, no `/`.")                                \
    X(CYAML_FIELD_SEQUENCE_FIXED("size", POINTER, scene_file_image, size, &whole_number, 2),                           \
      .help = "Width and height in pixels.", .by_default = "`[1280, 720]`", .low = 1, .high = 32768)                   \
    X(CYAML_FIELD_INT_PTR("every", OPTIONAL, scene_file_image, every),                                                 \
      .help = "Draw at the cycles that are multiples of this.", .by_default = "`1`", .low = 1, .high = 1000000000)     \
    X(CYAML_FIELD_FLOAT_PTR("every_time", OPTIONAL, scene_file_image, every_time),                                     \
      .help =                                                                                                          \
          "Draw at the first step, and whenever the time has passed a multiple of this since the step before. Not "    \
          "with `every`.",                                                                                             \
      .by_default = "by `every`", .low = 0, .is_low_excluded = true, .high = 1e30)                                     \
    X(CYAML_FIELD_MAPPING_PTR("camera", OPTIONAL, scene_file_image, camera, camera_fields),                            \
      .help = "Where the image is seen from.", .by_default = "automatic", .child = &camera_mapping)                    \
    X(CYAML_FIELD_SEQUENCE("background", POINTER, scene_file_image, background, &number, 3, 4),                        \
      .help = "Colour where nothing is, sRGB, and optionally its opacity.", .by_default = "`[0.08, 0.09, 0.11, 1]`",   \
      .low = 0, .high = 1)                                                                                             \
    X(CYAML_FIELD_SEQUENCE("lights", POINTER, scene_file_image, lights, &light, 1, 8),                                 \
      .help = "The lights, in place of the default ones.",                                                             \
      .by_default = "a light from the upper right of the camera and a weaker one from its left",                       \
      .child = &light_mapping)                                                                                         \
    X(CYAML_FIELD_MAPPING_PTR("clip", OPTIONAL, scene_file_image, clip, clip_fields),                                  \
      .help = "Cuts parts of all layers away, exactly, and through the cells; volumes keep their `max_error`.",        \
      .by_default = "nothing is cut away", .child = &clip_mapping)                                                     \
    X(CYAML_FIELD_SEQUENCE("layers", CYAML_FLAG_POINTER, scene_file_image, layers, &layer, 1, 20),                     \
      .help = "What is drawn. Each entry holds one of the keys of a layer.", .child = &layer_mapping)                  \
    X(CYAML_FIELD_MAPPING_PTR("sampling", OPTIONAL, scene_file_image, sampling, sampling_fields),                      \
      .help = "How volumes are integrated, and how finely.",                                                           \
      .by_default = "one volume to a `max_error` of 0.01; several by samples, half a cell apart, jittered",            \
      .child = &sampling_mapping)                                                                                      \
    X(CYAML_FIELD_INT_PTR("antialias", OPTIONAL, scene_file_image, antialias),                                         \
      .help =                                                                                                          \
          "Samples a pixel, at fixed places in it: 1, 2, 4, 8 or 16, averaged in linear light. Images without "        \
          "volumes take them where a pixel differs from a neighbour of the picture at one sample a pixel, by some 6 "  \
          "of 255 codes, and so miss what is thinner than a pixel and not met by that; those with volumes take them "  \
          "everywhere, each with a jitter of its own (`frames`, rounded up to a multiple of this, if those are "       \
          "more). Depth in an EXR is that of the pixel's centre.",                                                     \
      .by_default = "`1`", .low = 1, .high = 16)                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("decorations", OPTIONAL, scene_file_image, decorations, decorations_fields),             \
      .help =                                                                                                          \
          "What is written and drawn beside the data. Nothing of it lies over another, and all of it grows with "      \
          "the picture. Words need a font: DejaVuSans, or another common one, in the system's folders or in those "    \
          "that OPENIMAGEIO_FONTS names in rank 0's environment; without one the report warns.",                       \
      .by_default = "none", .child = &decorations_mapping)                                                             \
    X(CYAML_FIELD_SEQUENCE("outputs", CYAML_FLAG_POINTER, scene_file_image, outputs, &output, 1, 16),                  \
      .help = "Files that the image is written to. No two files of a scene may have the same name.",                   \
      .child = &output_mapping)
DEFINE_MAPPING(image, "images", IMAGE_KEYS);

static const cyaml_schema_value_t image = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_image, image_fields)};

#define TOP_KEYS(X)                                                                                                    \
    X(CYAML_FIELD_INT_PTR("threads", OPTIONAL, scene_file, threads),                                                   \
      .help =                                                                                                          \
          "Threads of each rank, as far as there are cores and they can be started; the report warns where there are " \
          "fewer. 0: the cores of the node, shared among its ranks.",                                                  \
      .by_default = "`0`", .low = 0, .high = 4096)                                                                     \
    X(CHOICE("tree", scene_file, tree, tree_words),                                                                    \
      .help = "What the trees are built over: all cells (`full`), those that the images can show (`partial`), or "     \
              "whichever has cost less so far (`auto`). Changes the speed, not the images.",                           \
      .by_default = "`auto`")                                                                                          \
    X(CYAML_FIELD_SEQUENCE("images", CYAML_FLAG_POINTER, scene_file, images, &image, 1, 64),                           \
      .help =                                                                                                          \
          "The images to draw. Three frames or more of a step that show the same isosurface, opaque, in one colour a " \
          "value, normals by gradient, share the work of finding its cells, where these are tets or hexes in arrays "  \
          "of float32 and int32 and the images have most of a rank's mesh in view: 64 bytes a crossed tet and 128 a "  \
          "hex, at most 64 MiB a rank, are held while the step is drawn.",                                             \
      .child = &image_mapping)
static const cyaml_schema_field_t top_fields[] = {TOP_KEYS(AS_FIELD) CYAML_FIELD_END};
static const scene_key top_keys[] = {TOP_KEYS(AS_KEY)};

const scene_mapping scene_top = {"scene", top_fields, top_keys};
const cyaml_schema_value_t scene_top_value = {CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, scene_file, top_fields)};
