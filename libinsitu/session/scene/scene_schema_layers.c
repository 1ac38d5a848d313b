/* Defines the keys of layers and clips. The macros are in scene_schema_lists.h. */
#include "colour_map.h"
#include "scene.h"
#include "scene_schema_lists.h"

static const cyaml_schema_value_t opacity_point = {CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number, 2)};

#define MAP_WORD(word, name) {name, COLOUR_MAP_##word},
static const cyaml_strval_t map_words[] = {COLOUR_MAPS(MAP_WORD)};
static const cyaml_strval_t scale_words[] = {{"linear", SCENE_LINEAR}, {"log", SCENE_LOG}, {"symlog", SCENE_SYMLOG}};
static const cyaml_strval_t normal_words[] = {
    {"gradient", SCENE_GRADIENT}, {"differences", SCENE_DIFFERENCES}, {"vertex", SCENE_VERTEX}};
static const cyaml_strval_t interpolation_words[] = {{"cell", SCENE_BY_CELL}, {"vertex", SCENE_BY_VERTEX}};

#define FIELD_HELP "Name of the field, as the simulation or the file gives it; at most 255 bytes."
#define MESH_HELP                                                                                                      \
    "The mesh that the layer is drawn on, or a list of meshes, by the names that the simulation gives them. A name "   \
    "stands for the meshes below it too: `data` for `data/0`, `data/1`, ..., as the blocks of a file are called."
#define MESH_DEFAULT "the meshes that have the field"
#define INTERPOLATE_HELP                                                                                               \
    "A field that has one value a cell is drawn by `cell` as it is, the same throughout each cell, and by `vertex` "   \
    "by the means of the cells at each vertex, on all ranks, interpolated between the vertices (24 bytes a vertex "    \
    "are held). A field that has a value at each corner of each cell is drawn torn by `cell`, and by the means of "    \
    "the "                                                                                                             \
    "corners at each vertex by `vertex`. It does not matter to a field that has one value a vertex."
#define ISO_INTERPOLATE_HELP                                                                                           \
    "A field that has one value a cell is drawn by the means of the cells at each vertex, on all ranks (24 bytes "     \
    "a vertex are held). `cell` is refused: between cells of two values there is a face, not a surface of the value "  \
    "asked for. A field that has a value at each corner of each cell is drawn torn unless this says `vertex`."
#define RANGE_DEFAULT "`data`"

/* Declares a value of several forms, which is read from the document. */
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
} no_members; /* a struct without members, for mappings that are one of several forms and are read from the document */

#define MAP_KEYS(X)                                                                                                    \
    X(CYAML_FIELD_IGNORE("colours", OPTIONAL),                                                                         \
      .help = "Colours `[red, green, blue]`, sRGB, between which the map is straight in sRGB. Not with `file`.",       \
      .default_text = "none", TAKES(colour_list_forms))                                                                \
    X(CYAML_FIELD_IGNORE("at", OPTIONAL),                                                                              \
      .help = "Where the colours are along the map: as many numbers, from 0 to 1, never falling, the first 0 and the " \
              "last 1; two the same make a step, of a 1024th of the map.",                                             \
      .default_text = "evenly spaced", TAKES(place_list_forms))                                                        \
    X(CYAML_FIELD_IGNORE("file", OPTIONAL),                                                                            \
      .help = "A file of colour maps as ParaView writes them (JSON, `RGBPoints`, or bands by `IndexedColors`), "       \
              "relative to the scene's folder. It "                                                                    \
              "is read on rank 0, again when the scene is.",                                                           \
      .default_text = "none", TAKES(path_forms))                                                                       \
    X(CYAML_FIELD_IGNORE("name", OPTIONAL), .help = "The name of the map in the file. Needed where it holds several.", \
      .default_text = "its only one", TAKES(name_forms))
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

/* The keys that describe how values become colours, for any mapping with a member `colours` of type
 * scene_file_colour_map. */
#define COLOUR_MAP_KEYS(X, type)                                                                                       \
    X(FORMS("map"), .help = "Colour map: one that is built in, a list of colours, or one of a file.",                  \
      .default_text = "`viridis`", TAKES(map_forms))                                                                   \
    X(CYAML_FIELD_BOOL_PTR("reversed", OPTIONAL, type, colours.reversed), .help = "The map from its high end.",        \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_INT_PTR("discrete", OPTIONAL, type, colours.discrete),                                               \
      .help = "So many bands of equal width, each in one colour: those of the map at even places, ends included. If "  \
              "the range has a whole number for each, as of ids, colour bars show them in the bands' middles.",        \
      .default_text = "smooth", .low = 1, .high = 64)                                                                  \
    X(CHOICE("scale", type, colours.scale, scale_words),                                                               \
      .help = "The spacing of values along the map: as they are, by their logarithm (values of 0 and less are below "  \
              "the range), or by `symlog`, linear up to the `threshold` on both sides of 0 and logarithmic beyond: s " \
              "= value / threshold there, and 1 + ln(value / threshold), mirrored.",                                   \
      .default_text = "`linear`")                                                                                      \
    X(CYAML_FIELD_FLOAT_PTR("threshold", OPTIONAL, type, colours.threshold),                                           \
      .help = "Up to what size values are linear by `symlog`, which needs it.", .default_text = "none", .low = 0,      \
      .is_low_excluded = true, .high = 1e300)                                                                          \
    X(NUMBERS("below", type, colours.below, 3), .help = "Colour of values below the range, sRGB.",                     \
      .default_text = "that of its low end", .low = 0, .high = 1)                                                      \
    X(NUMBERS("above", type, colours.above, 3), .help = "Colour of values above the range, sRGB.",                     \
      .default_text = "that of its high end", .low = 0, .high = 1)                                                     \
    X(FORMS("range"),                                                                                                  \
      .help = "The values `[low, high]`, low < high, that the ends of the colour map stand for; clamped outside. Or "  \
              "of the values on the meshes of the layer, over all ranks, at each drawn step: `data`, the least and "   \
              "the greatest (with `scale: log` the least above 0); `symmetric`, the same made as wide on both sides "  \
              "of 0; `run`, the widest of all steps drawn so far, which is kept in the file NAME.ranges beside the "   \
              "first output's pictures (of a sweep's others in NAME.1.ranges and so on), so that a run that is "       \
              "started again goes on with it (delete it to begin anew); or percentiles.",                              \
      .default_text = RANGE_DEFAULT, TAKES(range_forms))
#define CLIP_PLANE_KEYS(X)                                                                                             \
    X(CYAML_FIELD_SEQUENCE_FIXED("normal", CYAML_FLAG_POINTER, scene_file_plane, normal, &number, 3),                  \
      .help = "The direction at right angles to the plane, of any length but 0.")                                      \
    X(NUMBERS("point", scene_file_plane, point, 3), .help = "A point of the plane, in scene units.",                   \
      .default_text = "the middle of the bounds of all the data, at each drawn step")                                  \
    X(CYAML_FIELD_FLOAT_PTR("offset", OPTIONAL, scene_file_plane, offset),                                             \
      .help = "How far the plane is moved from `point` along `normal`, in scene units.", .default_text = "`0`")
DEFINE_MAPPING(clip_plane, "planes", CLIP_PLANE_KEYS);

static const cyaml_schema_value_t clip_plane = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_plane, clip_plane_fields)};

#define PLANE_KEYS(X)                                                                                                  \
    CLIP_PLANE_KEYS(X)                                                                                                 \
    X(CYAML_FIELD_SEQUENCE("offsets", POINTER, scene_file_plane, offsets, &number, 1, SCENE_MAX_PLANES),               \
      .help = "In place of `offset`: a plane for each.", .default_text = "by `offset`")                                \
    X(CYAML_FIELD_INT_PTR("count", OPTIONAL, scene_file_plane, count),                                                 \
      .help = "In place of a place: so many planes, which cut the bounds of all the data along `normal` into layers "  \
              "of equal thickness, of which each plane is in the middle; at each drawn step.",                         \
      .default_text = "one plane", .low = 1, .high = SCENE_MAX_PLANES)
DEFINE_MAPPING(plane, "planes", PLANE_KEYS);

static const cyaml_schema_value_t plane = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_plane, plane_fields)};

static const cyaml_strval_t keep_words[] = {{"inside", SCENE_KEEP_INSIDE}, {"outside", SCENE_KEEP_OUTSIDE}};

#define SPHERE_KEYS(X)                                                                                                 \
    X(CYAML_FIELD_SEQUENCE_FIXED("centre", CYAML_FLAG_POINTER, scene_file_sphere, centre, &number, 3),                 \
      .help = "Its centre, in scene units.")                                                                           \
    X(CYAML_FIELD_FLOAT("radius", REQUIRED, scene_file_sphere, radius), .help = "Its radius, in scene units.",         \
      .low = 0, .is_low_excluded = true, .high = 1e30)
DEFINE_MAPPING(sphere, "sphere", SPHERE_KEYS);

#define CLIP_KEYS(X)                                                                                                   \
    X(CYAML_FIELD_SEQUENCE("planes", POINTER, scene_file_clip, planes, &clip_plane, 1, 10),                            \
      .help = "Planes. What lies on the side of any of them that its `normal` points to is cut away. A slice in the "  \
              "plane itself is not.",                                                                                  \
      .default_text = "none", .child = &clip_plane_mapping)                                                            \
    X(CYAML_FIELD_SEQUENCE_FIXED("box", POINTER, scene_file_clip, box, &colour, 2),                                    \
      .help = "Two corners, `[[x, y, z], [x, y, z]]`, the first less than the other along each axis. What lies "       \
              "outside of the box is cut away.",                                                                       \
      .default_text = "none")                                                                                          \
    X(CYAML_FIELD_MAPPING_PTR("sphere", OPTIONAL, scene_file_clip, sphere, sphere_fields),                             \
      .help = "What lies outside of the sphere is cut away.", .default_text = "none", .child = &sphere_mapping)        \
    X(CHOICE("keep", scene_file_clip, keep, keep_words),                                                               \
      .help = "The side of the box and of the sphere that is kept. With `outside`, all that lies inside of either is " \
              "cut away.",                                                                                             \
      .default_text = "`inside`")
EXPORT_MAPPING(clip, "clip", CLIP_KEYS);

/* The clip key of a layer of this type. */
#define CLIP_KEY(X, type, more)                                                                                        \
    X(CYAML_FIELD_MAPPING_PTR("clip", OPTIONAL, type, clip, scene_clip_fields),                                        \
      .help = "Cuts parts of this layer away, beside what the image's `clip` cuts of all." more,                       \
      .default_text = "none", .child = &scene_clip_mapping)
#define MATERIAL_KEYS(X)                                                                                               \
    X(CYAML_FIELD_FLOAT_PTR("ambient", OPTIONAL, scene_file_material, ambient),                                        \
      .help = "Share of the colour that is seen without any light.", .default_text = "`0.15`", .low = 0, .high = 1)    \
    X(CYAML_FIELD_FLOAT_PTR("diffuse", OPTIONAL, scene_file_material, diffuse),                                        \
      .help = "Share of the colour that is seen in full light.", .default_text = "`0.75`", .low = 0, .high = 1)        \
    X(CYAML_FIELD_FLOAT_PTR("specular", OPTIONAL, scene_file_material, specular),                                      \
      .help = "Strength of the highlight (Blinn-Phong), of the light's colour.", .default_text = "`0.25`", .low = 0,   \
      .high = 1)                                                                                                       \
    X(CYAML_FIELD_FLOAT_PTR("shininess", OPTIONAL, scene_file_material, shininess),                                    \
      .help = "Exponent of the highlight: larger is smaller and sharper.", .default_text = "`32`", .low = 1,           \
      .high = 10000)
DEFINE_MAPPING(material, "material", MATERIAL_KEYS);

#define COLOUR_BY_KEYS(X)                                                                                              \
    X(TEXT("field", REQUIRED, scene_file_colour_by, field, 255), .help = FIELD_HELP)                                   \
    X(TEXT("component", OPTIONAL, scene_file_colour_by, component, 16), .help = COMPONENT_HELP,                        \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(CHOICE("interpolate", scene_file_colour_by, interpolate, interpolation_words), .help = INTERPOLATE_HELP,         \
      .default_text = "`cell`")                                                                                        \
    COLOUR_MAP_KEYS(X, scene_file_colour_by)                                                                           \
    X(NUMBERS("nan", scene_file_colour_by, colours.nan, 3),                                                            \
      .help = "Colour where the field is not a number, and on meshes that do not have it, sRGB.",                      \
      .default_text = "grey, `[0.6, 0.6, 0.6]`", .low = 0, .high = 1)
DEFINE_MAPPING(colour_by, "colour_by", COLOUR_BY_KEYS);

#define LINES_KEYS(X)                                                                                                  \
    X(TEXT("field", OPTIONAL, scene_file_lines, field, 255),                                                           \
      .help = "Name of the field whose lines are drawn; at most 255 bytes. Meshes that do not have it have no lines, " \
              "with a warning. Values in cells are taken to the vertices, as for an isosurface.",                      \
      .default_text = "the field that colours the layer")                                                              \
    X(TEXT("component", OPTIONAL, scene_file_lines, component, 16), .help = COMPONENT_HELP,                            \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(CYAML_FIELD_SEQUENCE("values", POINTER, scene_file_lines, values, &number, 1, SCENE_MAX_LINES),                  \
      .help = "The values at which lines are drawn, none twice. One of `values` and `count` is needed.",               \
      .default_text = "by `count`")                                                                                    \
    X(CYAML_FIELD_INT_PTR("count", OPTIONAL, scene_file_lines, count),                                                 \
      .help = "So many lines, which cut the range into parts of equal width: that of the layer's colours, evenly "     \
              "along their `scale`; with `field` the least and the greatest value on the meshes of the layer, over "   \
              "all ranks, at each drawn step.",                                                                        \
      .default_text = "by `values`", .low = 1, .high = SCENE_MAX_LINES)                                                \
    X(CYAML_FIELD_FLOAT_PTR("width", OPTIONAL, scene_file_lines, width),                                               \
      .help = "Width of the lines, in pixels, whatever way the surface is turned. Lines less than two widths apart "   \
              "fade, and are gone where they would touch.",                                                            \
      .default_text = "a 600th of the picture's height, but at least 1.5", .low = 0.5, .high = 100)                    \
    X(NUMBERS("colour", scene_file_lines, colour, 3),                                                                  \
      .help = "Colour of the lines, sRGB, before light falls on it. They are as transparent as the layer.",            \
      .default_text = "`[0.1, 0.1, 0.1]`", .low = 0, .high = 1)
DEFINE_MAPPING(lines, "lines", LINES_KEYS);

/* The key of a layer of the type. */
#define LINES_KEY(X, type)                                                                                             \
    X(CYAML_FIELD_MAPPING_PTR("lines", OPTIONAL, type, lines, lines_fields),                                           \
      .help = "Contour lines: where a field has given values on the surface.", .default_text = "none",                 \
      .child = &lines_mapping)

#define ISOSURFACE_KEYS(X)                                                                                             \
    X(TEXT("field", REQUIRED, scene_file_isosurface, field, 255), .help = FIELD_HELP)                                  \
    X(TEXT("component", OPTIONAL, scene_file_isosurface, component, 16), .help = COMPONENT_HELP,                       \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(CHOICE("interpolate", scene_file_isosurface, interpolate, interpolation_words), .help = ISO_INTERPOLATE_HELP,    \
      .default_text = "`vertex`")                                                                                      \
    X(NAMES("mesh"), .help = MESH_HELP, .default_text = MESH_DEFAULT)                                                  \
    X(CYAML_FIELD_SEQUENCE("values", CYAML_FLAG_POINTER, scene_file_isosurface, values, &number, 1,                    \
                           SCENE_MAX_SURFACES),                                                                        \
      .help = "The values at which surfaces are drawn, none twice. The most are those of all isosurfaces of an image " \
              "together.")                                                                                             \
    X(CYAML_FIELD_SEQUENCE("colours", POINTER, scene_file_isosurface, colours, &colour, 1, SCENE_MAX_SURFACES),        \
      .help = "Colours of the values in turn, sRGB; the last serves all values that are left. Not with `colour_by`.",  \
      .default_text = "colours that differ, from a fixed cycle", .low = 0, .high = 1)                                  \
    X(CYAML_FIELD_MAPPING_PTR("colour_by", OPTIONAL, scene_file_isosurface, colour_by, colour_by_fields),              \
      .help = "Colour the surfaces by a field. They are grey, or of the colour `nan`, with a warning, on meshes of "   \
              "the layer that do not have it, and where it is not a number.",                                          \
      .default_text = "by `colours`", .child = &colour_by_mapping)                                                     \
    X(CYAML_FIELD_FLOAT_PTR("opacity", OPTIONAL, scene_file_isosurface, opacity),                                      \
      .help = "1 hides what is behind; 0 shows nothing.", .default_text = "`1`", .low = 0, .high = 1)                  \
    X(CYAML_FIELD_MAPPING_PTR("material", OPTIONAL, scene_file_isosurface, material, material_fields),                 \
      .help = "How the surfaces take light.", .default_text = "a slight gloss", .child = &material_mapping)            \
    X(CHOICE("normals", scene_file_isosurface, normals, normal_words),                                                 \
      .help =                                                                                                          \
          "The normals that light falls on: the `gradient` of the cell that is hit, which changes from cell to cell, " \
          "or smooth: gradients at each `vertex`, over the cells of its mesh on all ranks, interpolated within "       \
          "cells, "                                                                                                    \
          "so that light may have a seam where two meshes meet; or central "                                           \
          "`differences` about the hit, in the cells of all ranks, slower.",                                           \
      .default_text = "`gradient`")                                                                                    \
    X(CYAML_FIELD_FLOAT_PTR("difference", OPTIONAL, scene_file_isosurface, difference),                                \
      .help = "Distance between the two samples of a difference, in sizes of the cell that is hit.",                   \
      .default_text = "`1`", .low = 0, .is_low_excluded = true, .high = 100)                                           \
    LINES_KEY(X, scene_file_isosurface)                                                                                \
    CLIP_KEY(X, scene_file_isosurface, "")
DEFINE_MAPPING(isosurface, "isosurface", ISOSURFACE_KEYS);

#define VOLUME_KEYS(X)                                                                                                 \
    X(TEXT("field", REQUIRED, scene_file_volume, field, 255), .help = FIELD_HELP)                                      \
    X(TEXT("component", OPTIONAL, scene_file_volume, component, 16), .help = COMPONENT_HELP,                           \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(CHOICE("interpolate", scene_file_volume, interpolate, interpolation_words), .help = INTERPOLATE_HELP,            \
      .default_text = "`cell`")                                                                                        \
    X(NAMES("mesh"), .help = MESH_HELP, .default_text = MESH_DEFAULT)                                                  \
    COLOUR_MAP_KEYS(X, scene_file_volume)                                                                              \
    X(CYAML_FIELD_SEQUENCE("opacity", POINTER, scene_file_volume, opacity, &opacity_point, 1, 32),                     \
      .help =                                                                                                          \
          "Points `[at, opacity]`, joined by straight lines: `at` 0 is the low end of the range and 1 the high "       \
          "end, never falling (twice the same makes a step); opacity is that of `unit_distance`. By a `scale` the "    \
          "lines are straight along it.",                                                                              \
      .default_text = "`[[0, 0], [1, 0.9]]`", .low = 0, .high = 1)                                                     \
    X(CYAML_FIELD_FLOAT_PTR("unit_distance", OPTIONAL, scene_file_volume, unit_distance),                              \
      .help = "The length in scene units that lets 1 - opacity of the light through.",                                 \
      .default_text = "a twentieth of the diagonal of the bounds", .low = 0, .is_low_excluded = true, .high = 1e30)    \
    CLIP_KEY(X, scene_file_volume, " All volumes of an image have the same.")
DEFINE_MAPPING(volume, "volume", VOLUME_KEYS);

#define SLICE_KEYS(X)                                                                                                  \
    X(TEXT("field", REQUIRED, scene_file_slice, field, 255),                                                           \
      .help = "Name of the field that colours the planes; at most 255 bytes.")                                         \
    X(TEXT("component", OPTIONAL, scene_file_slice, component, 16), .help = COMPONENT_HELP,                            \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(CHOICE("interpolate", scene_file_slice, interpolate, interpolation_words), .help = INTERPOLATE_HELP,             \
      .default_text = "`cell`")                                                                                        \
    X(NAMES("mesh"), .help = MESH_HELP, .default_text = MESH_DEFAULT)                                                  \
    X(CYAML_FIELD_SEQUENCE("planes", POINTER, scene_file_slice, planes, &plane, 1, SCENE_MAX_SURFACES),                \
      .help = "The planes. The most are all isovalues and planes of an image together. 4 bytes a vertex are held for " \
              "each "                                                                                                  \
              "plane. A plane that lies in faces of cells is drawn once, by the cells that its normal points away "    \
              "from; so that one on the border of the data is seen too, it is taken into them where it lies within a " \
              "millionth of half the diagonal of their bounds from it.",                                               \
      .default_text = "one at right angles to z, through the middle of the data", .child = &plane_mapping)             \
    COLOUR_MAP_KEYS(X, scene_file_slice)                                                                               \
    X(NUMBERS("nan", scene_file_slice, colours.nan, 3), .help = "Colour where the field is not a number, sRGB.",       \
      .default_text = "grey, `[0.6, 0.6, 0.6]`", .low = 0, .high = 1)                                                  \
    X(CYAML_FIELD_FLOAT_PTR("opacity", OPTIONAL, scene_file_slice, opacity),                                           \
      .help = "1 hides what is behind; 0 shows nothing.", .default_text = "`1`", .low = 0, .high = 1)                  \
    X(CYAML_FIELD_MAPPING_PTR("material", OPTIONAL, scene_file_slice, material, material_fields),                      \
      .help = "How the planes take light, as an isosurface where it is given; `{}` for a slight gloss.",               \
      .default_text = "no light: the colours are those of the map", .child = &material_mapping)                        \
    LINES_KEY(X, scene_file_slice)                                                                                     \
    CLIP_KEY(X, scene_file_slice, "")
DEFINE_MAPPING(slice, "slice", SLICE_KEYS);

#define EDGES_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_FLOAT_PTR("width", OPTIONAL, scene_file_edges, width), .help = "Width of the lines, in pixels.",     \
      .default_text = "a 900th of the picture's height, but at least 1", .low = 0.5, .high = 100)                      \
    X(NUMBERS("colour", scene_file_edges, colour, 3), .help = "Colour of the lines, sRGB, before light falls on it.",  \
      .default_text = "`[0.1, 0.1, 0.1]`", .low = 0, .high = 1)
DEFINE_MAPPING(edges, "edges", EDGES_KEYS);

#define THRESHOLD_KEYS(X)                                                                                              \
    X(TEXT("field", REQUIRED, scene_file_threshold, field, 255),                                                       \
      .help = "Name of the field; at most 255 bytes. Meshes that do not have it show nothing of the layer.")           \
    X(TEXT("component", OPTIONAL, scene_file_threshold, component, 16), .help = COMPONENT_HELP,                        \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(CYAML_FIELD_FLOAT_PTR("from", OPTIONAL, scene_file_threshold, from), .help = "The least value that is shown.",   \
      .default_text = "none")                                                                                          \
    X(CYAML_FIELD_FLOAT_PTR("to", OPTIONAL, scene_file_threshold, to), .help = "The greatest value that is shown.",    \
      .default_text = "none")
DEFINE_MAPPING(threshold, "threshold", THRESHOLD_KEYS);

#define SURFACE_KEYS(X)                                                                                                \
    X(NAMES("mesh"), .help = "The mesh whose outer surface is drawn, or a list of meshes, as at an isosurface.",       \
      .default_text = "all meshes")                                                                                    \
    X(NUMBERS("colour", scene_file_surface, colour, 3), .help = "Colour, sRGB. Not with `colour_by`.",                 \
      .default_text = "`[0.8, 0.8, 0.8]`", .low = 0, .high = 1)                                                        \
    X(CYAML_FIELD_MAPPING_PTR("colour_by", OPTIONAL, scene_file_surface, colour_by, colour_by_fields),                 \
      .help = "Colour the surface by a field. It is grey, or of the colour `nan`, with a warning, on meshes of the "   \
              "layer that do not have it, and where it is not a number.",                                              \
      .default_text = "by `colour`", .child = &colour_by_mapping)                                                      \
    X(CYAML_FIELD_MAPPING_PTR("edges", OPTIONAL, scene_file_surface, edges, edges_fields),                             \
      .help = "Lines along the edges of the cells' faces; `{}` takes all its defaults. They fade where faces are "     \
              "hardly wider than lines.",                                                                              \
      .default_text = "none", .child = &edges_mapping)                                                                 \
    X(CYAML_FIELD_MAPPING_PTR("threshold", OPTIONAL, scene_file_surface, threshold, threshold_fields),                 \
      .help = "Only cells whose value lies within bounds are there, with the field at vertices those all of whose "    \
              "vertices' values do; what is drawn is the outer surface of these. It is found anew when the values "    \
              "have changed.",                                                                                         \
      .default_text = "all cells", .child = &threshold_mapping)                                                        \
    X(CYAML_FIELD_FLOAT_PTR("opacity", OPTIONAL, scene_file_surface, opacity),                                         \
      .help = "1 hides what is behind; 0 shows nothing.", .default_text = "`1`", .low = 0, .high = 1)                  \
    X(CYAML_FIELD_MAPPING_PTR("material", OPTIONAL, scene_file_surface, material, material_fields),                    \
      .help = "How the surface takes light; `{ambient: 1, diffuse: 0, specular: 0}` shows the colours of the map.",    \
      .default_text =                                                                                                  \
          "a slight gloss; of flat data (see `automatic`), where the image gives no `lights`, the colours "            \
          "as they are",                                                                                               \
      .child = &material_mapping)                                                                                      \
    LINES_KEY(X, scene_file_surface)                                                                                   \
    CLIP_KEY(X, scene_file_surface, "")
DEFINE_MAPPING(surface, "surface", SURFACE_KEYS);

#define LAYER_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_MAPPING_PTR("isosurface", OPTIONAL, scene_file_layer, isosurface, isosurface_fields),                \
      .help = "Surfaces on which a field has given values. On a mesh of triangles, quads and polygons alone its "      \
              "contour lines, as wide as `lines` are by default; there each layer counts as one isovalue more.",       \
      .default_text = "none", .child = &isosurface_mapping)                                                            \
    X(CYAML_FIELD_MAPPING_PTR("volume", OPTIONAL, scene_file_layer, volume, volume_fields),                            \
      .help = "A field as coloured mist. At most 4 in an image.", .default_text = "none", .child = &volume_mapping)    \
    X(CYAML_FIELD_MAPPING_PTR("slice", OPTIONAL, scene_file_layer, slice, slice_fields),                               \
      .help = "Planes through the cells, coloured by a field.", .default_text = "none", .child = &slice_mapping)       \
    X(CYAML_FIELD_MAPPING_PTR("surface", OPTIONAL, scene_file_layer, surface, surface_fields),                         \
      .help = "The outer surface of meshes: the faces that one cell alone has, of the cells of all ranks but ghosts. " \
              "Faces are one where their vertices are, by global ids or else by equal coordinates; a face that meets " \
              "smaller ones, at hanging nodes, is drawn, and so are these. They are found once for a mesh, and "       \
              "some 250 bytes a face are held. Triangles, quads and polygons of a mesh are drawn too, each that lies " \
              "on a "                                                                                                  \
              "cell's face in its place. Each counts as one isovalue.",                                                \
      .default_text = "none", .child = &surface_mapping)
EXPORT_MAPPING(layer, "layers", LAYER_KEYS);
