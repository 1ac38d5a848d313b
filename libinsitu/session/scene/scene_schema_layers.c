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
    "The mesh on which the layer is drawn, or a list of meshes, by the names that the simulation gives them. A name "  \
    "also stands for the meshes below it: `data` for `data/0`, `data/1`, ..., which are the names of the blocks of a " \
    "file."
#define MESH_DEFAULT "the meshes that have the field"
#define INTERPOLATE_HELP                                                                                               \
    "For a field with one value per cell: `cell` draws each cell in its own value, and `vertex` draws the means of "   \
    "the cells' values at each vertex, over all ranks, interpolated between the vertices (24 bytes per vertex are "    \
    "held). For a field with a value at each corner of each cell: `cell` draws each cell with its own values, and "    \
    "`vertex` draws the means of the corners' values at each vertex. For a field with one value per vertex both are "  \
    "the same."
#define ISO_INTERPOLATE_HELP                                                                                           \
    "If the field has one value per cell, each vertex gets the mean of its cells' values, over all ranks, and these "  \
    "means are drawn (24 bytes per vertex are held). `cell` is refused, because between two cells with different "     \
    "values there is a face, and no surface of the isovalue. If the field has a value at each corner of each cell, "   \
    "each cell shows its own values, unless this is `vertex`."
#define RANGE_DEFAULT "`data`"

/* Declares a value that may have several forms. libcyaml's schema cannot describe such a value, so that it is read from
 * the tree of the document. */
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
    /* Stands for the struct of a mapping in the schema. The mapping is one of several forms of a value, so that it is
     * read from the tree of the document and has no struct. */
} no_members;

#define MAP_KEYS(X)                                                                                                    \
    X(CYAML_FIELD_IGNORE("colours", OPTIONAL),                                                                         \
      .help = "Colours `[red, green, blue]`, sRGB. Between them the map is linear in sRGB. Not allowed with `file`.",  \
      .default_text = "none", TAKES(colour_list_forms))                                                                \
    X(CYAML_FIELD_IGNORE("at", OPTIONAL),                                                                              \
      .help = "The positions of the colours along the map, as many numbers as there are colours. They go from 0 to 1 " \
              "and never decrease; the first is 0 and the last is 1. Two equal numbers make a step, which is a "       \
              "1024th of the map wide.",                                                                               \
      .default_text = "evenly spaced", TAKES(place_list_forms))                                                        \
    X(CYAML_FIELD_IGNORE("file", OPTIONAL),                                                                            \
      .help = "A file of colour maps as ParaView writes them (JSON, `RGBPoints`, or bands by `IndexedColors`). The "   \
              "path is relative to the scene's folder. The file is read on rank 0, and read again when the scene is.", \
      .default_text = "none", TAKES(path_forms))                                                                       \
    X(CYAML_FIELD_IGNORE("name", OPTIONAL),                                                                            \
      .help = "The name of the map in the file. It is needed if the file has several maps.",                           \
      .default_text = "the only map in the file", TAKES(name_forms))
DEFINE_MAPPING(map, "map", MAP_KEYS);

static const scene_form map_forms[] = {
    {{CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, map_words, CYAML_ARRAY_LEN(map_words))}, {0}},
    {{CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, no_members, map_fields)}, {.child = &map_mapping}}};
static const scene_form percentile_forms[] = {
    {{CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number, 2)}, {.low = 0, .high = 100}}};
#define RANGE_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_IGNORE("percentile", REQUIRED),                                                                      \
      .help = "Two percentages, low < high. The range begins at the value that is not exceeded by the first "          \
              "percentage of the cells' values, and ends at the value for the second percentage. The value of a cell " \
              "is the middle between its least and greatest value. Each cell counts once. If the field is only on "    \
              "triangles, quads and polygons, they are weighted by their area. If it is also on cells with a volume, " \
              "only those cells count. The range is the same on any partition.",                                       \
      TAKES(percentile_forms))
DEFINE_MAPPING(range, "range", RANGE_KEYS);

static const cyaml_strval_t range_words[] = {
    {"data", SCENE_RANGE_DATA}, {"run", SCENE_RANGE_RUN}, {"symmetric", SCENE_RANGE_SYMMETRIC}};
static const scene_form range_forms[] = {
    {{CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number, 2)}, {0}},
    {{CYAML_VALUE_ENUM(CYAML_FLAG_STRICT, int, range_words, CYAML_ARRAY_LEN(range_words))}, {0}},
    {{CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, no_members, range_fields)}, {.child = &range_mapping}}};

/* Declares the keys that describe how values are mapped to colours. type: struct into which the keys are read; it must
 * have a member `colours` of type scene_file_colour_map. */
#define COLOUR_MAP_KEYS(X, type)                                                                                       \
    X(FORMS("map"), .help = "Colour map: a built-in one, a list of colours, or one from a file.",                      \
      .default_text = "`viridis`", TAKES(map_forms))                                                                   \
    X(CYAML_FIELD_BOOL_PTR("reversed", OPTIONAL, type, colours.reversed), .help = "Reverses the colour map.",          \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_INT_PTR("discrete", OPTIONAL, type, colours.discrete),                                               \
      .help = "Number of bands of equal width, each in one colour. The colours are those of the map at evenly spaced " \
              "places, including its ends. If the range has one whole number for each band, for example ids, colour "  \
              "bars show the numbers in the middle of the bands.",                                                     \
      .default_text = "smooth", .low = 1, .high = 64)                                                                  \
    X(CHOICE("scale", type, colours.scale, scale_words),                                                               \
      .help = "The spacing of values along the map. `linear`: as the values are. `log`: by their logarithm; values "   \
              "of 0 and less are below the range. `symlog`: linear up to the `threshold` on both sides of 0, and "     \
              "logarithmic beyond. If t is value / threshold, the position of a positive value is t up to t = 1, and " \
              "1 + ln(t) beyond. Negative values are mirrored.",                                                       \
      .default_text = "`linear`")                                                                                      \
    X(CYAML_FIELD_FLOAT_PTR("threshold", OPTIONAL, type, colours.threshold),                                           \
      .help = "The magnitude up to which values are linear with `symlog`. It is required then.",                       \
      .default_text = "none", .low = 0, .is_low_excluded = true, .high = 1e300)                                        \
    X(NUMBERS("below", type, colours.below, 3), .help = "Colour of values below the range, sRGB.",                     \
      .default_text = "the colour at the low end of the map", .low = 0, .high = 1)                                     \
    X(NUMBERS("above", type, colours.above, 3), .help = "Colour of values above the range, sRGB.",                     \
      .default_text = "the colour at the high end of the map", .low = 0, .high = 1)                                    \
    X(FORMS("range"),                                                                                                  \
      .help =                                                                                                          \
          "The values `[low, high]`, low < high, at the ends of the colour map. Values outside get the colours "       \
          "of the ends. Instead of numbers, the range can be computed from the values on the meshes of the "           \
          "layer, over all ranks, at each drawn step. `data`: from the least to the greatest value (with `scale: "     \
          "log` from the least value above 0). `symmetric`: the same, but equally wide on both sides of 0. "           \
          "`run`: the widest range of all steps drawn so far. It is kept in the file NAME.ranges beside the "          \
          "first output's pictures (for the other pictures of a sweep in NAME.1.ranges and so on). So a run that "     \
          "is started again goes on with it. Delete the file to begin anew. An image without outputs has no file. "    \
          "With `scale: log` a kept range that reaches 0 is dropped. A mapping gives percentiles.",                    \
      .default_text = RANGE_DEFAULT, TAKES(range_forms))
#define CLIP_PLANE_KEYS(X)                                                                                             \
    X(CYAML_FIELD_SEQUENCE_FIXED("normal", CYAML_FLAG_POINTER, scene_file_plane, normal, &number, 3),                  \
      .help = "The direction perpendicular to the plane. Any length except 0.")                                        \
    X(NUMBERS("point", scene_file_plane, point, 3), .help = "A point of the plane, in scene units.",                   \
      .default_text = "the middle of the bounds of all the data, at each drawn step")                                  \
    X(CYAML_FIELD_FLOAT_PTR("offset", OPTIONAL, scene_file_plane, offset),                                             \
      .help = "The distance by which the plane is moved from `point` along `normal`, in scene units.",                 \
      .default_text = "`0`")
DEFINE_MAPPING(clip_plane, "planes", CLIP_PLANE_KEYS);

static const cyaml_schema_value_t clip_plane = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_plane, clip_plane_fields)};

#define PLANE_KEYS(X)                                                                                                  \
    CLIP_PLANE_KEYS(X)                                                                                                 \
    X(CYAML_FIELD_SEQUENCE("offsets", POINTER, scene_file_plane, offsets, &number, 1, SCENE_MAX_PLANES),               \
      .help = "Instead of `offset`: a list, which gives one plane for each of its numbers.",                           \
      .default_text = "by `offset`")                                                                                   \
    X(CYAML_FIELD_INT_PTR("count", OPTIONAL, scene_file_plane, count),                                                 \
      .help = "Instead of a position: the number of planes. They are placed at each drawn step. The bounds of all "    \
              "data are divided along `normal` into as many layers of equal thickness, and a plane is in the middle "  \
              "of each layer.",                                                                                        \
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
      .help = "The region on that side of a plane to which its `normal` points is cut away. This holds for each "      \
              "plane. A slice in the plane itself is not cut.",                                                        \
      .default_text = "none", .child = &clip_plane_mapping)                                                            \
    X(CYAML_FIELD_SEQUENCE_FIXED("box", POINTER, scene_file_clip, box, &colour, 2),                                    \
      .help = "Two corners, `[[x, y, z], [x, y, z]]`. The first must be less than the other along each axis. The "     \
              "region outside the box is cut away.",                                                                   \
      .default_text = "none")                                                                                          \
    X(CYAML_FIELD_MAPPING_PTR("sphere", OPTIONAL, scene_file_clip, sphere, sphere_fields),                             \
      .help = "The region outside the sphere is cut away.", .default_text = "none", .child = &sphere_mapping)          \
    X(CHOICE("keep", scene_file_clip, keep, keep_words),                                                               \
      .help = "The side of the box and of the sphere that is kept. With `outside`, the region inside either of them "  \
              "is cut away.",                                                                                          \
      .default_text = "`inside`")
EXPORT_MAPPING(clip, "clip", CLIP_KEYS);

/* Declares the key `clip` of a layer. type: struct of the layer; more: text that is added to the help. */
#define CLIP_KEY(X, type, more)                                                                                        \
    X(CYAML_FIELD_MAPPING_PTR("clip", OPTIONAL, type, clip, scene_clip_fields),                                        \
      .help = "Cuts away parts of this layer, in addition to what the image's `clip` cuts from all layers." more,      \
      .default_text = "none", .child = &scene_clip_mapping)
#define MATERIAL_KEYS(X)                                                                                               \
    X(CYAML_FIELD_FLOAT_PTR("ambient", OPTIONAL, scene_file_material, ambient),                                        \
      .help = "Share of the colour that is visible without any light.", .default_text = "`0.15`", .low = 0, .high = 1) \
    X(CYAML_FIELD_FLOAT_PTR("diffuse", OPTIONAL, scene_file_material, diffuse),                                        \
      .help = "Share of the colour that is visible in full light.", .default_text = "`0.75`", .low = 0, .high = 1)     \
    X(CYAML_FIELD_FLOAT_PTR("specular", OPTIONAL, scene_file_material, specular),                                      \
      .help = "Strength of the highlight (Blinn-Phong). It has the colour of the light.", .default_text = "`0.25`",    \
      .low = 0, .high = 1)                                                                                             \
    X(CYAML_FIELD_FLOAT_PTR("shininess", OPTIONAL, scene_file_material, shininess),                                    \
      .help = "Exponent of the highlight. A larger exponent makes the highlight smaller and sharper.",                 \
      .default_text = "`32`", .low = 1, .high = 10000)
DEFINE_MAPPING(material, "material", MATERIAL_KEYS);

#define COLOUR_BY_KEYS(X)                                                                                              \
    X(TEXT("field", REQUIRED, scene_file_colour_by, field, 255), .help = FIELD_HELP)                                   \
    X(TEXT("component", OPTIONAL, scene_file_colour_by, component, 16), .help = COMPONENT_HELP,                        \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(CHOICE("interpolate", scene_file_colour_by, interpolate, interpolation_words), .help = INTERPOLATE_HELP,         \
      .default_text = "`cell`")                                                                                        \
    COLOUR_MAP_KEYS(X, scene_file_colour_by)                                                                           \
    X(NUMBERS("nan", scene_file_colour_by, colours.nan, 3),                                                            \
      .help = "Colour of places where the field is not a number, and of meshes that do not have it, sRGB.",            \
      .default_text = "grey, `[0.6, 0.6, 0.6]`", .low = 0, .high = 1)
DEFINE_MAPPING(colour_by, "colour_by", COLOUR_BY_KEYS);

#define LINES_KEYS(X)                                                                                                  \
    X(TEXT("field", OPTIONAL, scene_file_lines, field, 255),                                                           \
      .help = "Name of the field whose contour lines are drawn; at most 255 bytes. Meshes that do not have it have "   \
              "no lines, with a warning. Cell values are averaged at the vertices, as for an isosurface.",             \
      .default_text = "the field that colours the layer")                                                              \
    X(TEXT("component", OPTIONAL, scene_file_lines, component, 16), .help = COMPONENT_HELP,                            \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(CYAML_FIELD_SEQUENCE("values", POINTER, scene_file_lines, values, &number, 1, SCENE_MAX_LINES),                  \
      .help = "The values at which lines are drawn. No value may occur twice. Either `values` or `count` is needed.",  \
      .default_text = "by `count`")                                                                                    \
    X(CYAML_FIELD_INT_PTR("count", OPTIONAL, scene_file_lines, count),                                                 \
      .help =                                                                                                          \
          "Number of lines, which divide the range into parts of equal width. The range is that of the layer's "       \
          "colours, and the lines are spaced evenly along their `scale`. With `field` the range goes from the least "  \
          "to the greatest value of that field on the meshes of the layer, over all ranks, at each drawn step.",       \
      .default_text = "by `values`", .low = 1, .high = SCENE_MAX_LINES)                                                \
    X(CYAML_FIELD_FLOAT_PTR("width", OPTIONAL, scene_file_lines, width),                                               \
      .help = "Width of the lines, in pixels, independent of the orientation of the surface. Lines that are less "     \
              "than two widths apart fade, and disappear if they would touch.",                                        \
      .default_text = "a 600th of the picture's height, but at least 1.5", .low = 0.5, .high = 100)                    \
    X(NUMBERS("colour", scene_file_lines, colour, 3),                                                                  \
      .help = "Colour of the lines, sRGB, before lighting. The lines are as transparent as the layer.",                \
      .default_text = "`[0.1, 0.1, 0.1]`", .low = 0, .high = 1)
DEFINE_MAPPING(lines, "lines", LINES_KEYS);

/* Declares the key `lines` of a layer. type: struct of the layer. */
#define LINES_KEY(X, type)                                                                                             \
    X(CYAML_FIELD_MAPPING_PTR("lines", OPTIONAL, type, lines, lines_fields),                                           \
      .help = "Contour lines, at places of the surface where a field has given values.", .default_text = "none",       \
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
      .help = "The values at which surfaces are drawn. No value may occur twice. All isosurfaces of an image "         \
              "together can have at most 64 values.")                                                                  \
    X(CYAML_FIELD_SEQUENCE("colours", POINTER, scene_file_isosurface, colours, &colour, 1, SCENE_MAX_SURFACES),        \
      .help = "Colours of the values, in the same order, sRGB. If there are fewer colours than values, the last one "  \
              "is used for all further values. Not allowed with `colour_by`.",                                         \
      .default_text = "different colours, from a fixed cycle", .low = 0, .high = 1)                                    \
    X(CYAML_FIELD_MAPPING_PTR("colour_by", OPTIONAL, scene_file_isosurface, colour_by, colour_by_fields),              \
      .help = "Colours the surfaces by a field. On meshes of the layer that do not have the field, and where it is "   \
              "not a number, they are grey or have the colour `nan`, with a warning.",                                 \
      .default_text = "by `colours`", .child = &colour_by_mapping)                                                     \
    X(CYAML_FIELD_FLOAT_PTR("opacity", OPTIONAL, scene_file_isosurface, opacity),                                      \
      .help = "1 hides everything behind the layer; 0 shows nothing of the layer.", .default_text = "`1`", .low = 0,   \
      .high = 1)                                                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("material", OPTIONAL, scene_file_isosurface, material, material_fields),                 \
      .help = "How the surfaces reflect light.", .default_text = "a slight gloss", .child = &material_mapping)         \
    X(CHOICE("normals", scene_file_isosurface, normals, normal_words),                                                 \
      .help = "The normals used for lighting. `gradient` is the gradient within the cell that is hit, which changes "  \
              "from cell to cell. The other two are smooth. `vertex` interpolates gradients at the vertices, which "   \
              "are averaged over the cells of the mesh on all ranks; the light may have a seam where two meshes "      \
              "meet. `differences` takes central differences at the hit, in the cells of all ranks, and is slower. "   \
              "In layers on cells of higher order, `gradient` and `vertex` both interpolate gradients of the cells' "  \
              "polynomials at the nodes.",                                                                             \
      .default_text = "`gradient`")                                                                                    \
    X(CYAML_FIELD_FLOAT_PTR("difference", OPTIONAL, scene_file_isosurface, difference),                                \
      .help = "Distance between the two samples of a central difference, in sizes of the cell that is hit.",           \
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
      .help = "Points `[at, opacity]`, joined by straight lines. `at` is the position in the range: 0 is the low end " \
              "and 1 the high end. It must never decrease; the same number twice makes a step. The opacity is that "   \
              "of a layer of thickness `unit_distance`. With a `scale`, the lines are straight along the scale.",      \
      .default_text = "`[[0, 0], [1, 0.9]]`", .low = 0, .high = 1)                                                     \
    X(CYAML_FIELD_FLOAT_PTR("unit_distance", OPTIONAL, scene_file_volume, unit_distance),                              \
      .help = "The distance to which the `opacity` refers, in scene units. Over this distance, the share 1 - opacity " \
              "of the light passes.",                                                                                  \
      .default_text = "a twentieth of the diagonal of the bounds", .low = 0, .is_low_excluded = true, .high = 1e30)    \
    CLIP_KEY(X, scene_file_volume, " All volumes of an image must have the same `clip`.")
DEFINE_MAPPING(volume, "volume", VOLUME_KEYS);

#define SLICE_KEYS(X)                                                                                                  \
    X(TEXT("field", REQUIRED, scene_file_slice, field, 255),                                                           \
      .help = "Name of the field that gives the planes their colours; at most 255 bytes.")                             \
    X(TEXT("component", OPTIONAL, scene_file_slice, component, 16), .help = COMPONENT_HELP,                            \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(CHOICE("interpolate", scene_file_slice, interpolate, interpolation_words), .help = INTERPOLATE_HELP,             \
      .default_text = "`cell`")                                                                                        \
    X(NAMES("mesh"), .help = MESH_HELP, .default_text = MESH_DEFAULT)                                                  \
    X(CYAML_FIELD_SEQUENCE("planes", POINTER, scene_file_slice, planes, &plane, 1, SCENE_MAX_SURFACES),                \
      .help = "The planes. An image can have at most 64 isovalues and planes together. Each plane "                    \
              "takes 4 bytes per vertex. If a plane lies in faces of cells, it is drawn once, by the cells on the "    \
              "side from which its normal points away. A plane on the border of the data is moved slightly into the "  \
              "data so that it is visible. This is done if its distance from the border is less than a millionth of "  \
              "half the diagonal of the bounds.",                                                                      \
      .default_text = "one plane perpendicular to z, through the middle of the data", .child = &plane_mapping)         \
    COLOUR_MAP_KEYS(X, scene_file_slice)                                                                               \
    X(NUMBERS("nan", scene_file_slice, colours.nan, 3),                                                                \
      .help = "Colour of places where the field is not a number, sRGB.", .default_text = "grey, `[0.6, 0.6, 0.6]`",    \
      .low = 0, .high = 1)                                                                                             \
    X(CYAML_FIELD_FLOAT_PTR("opacity", OPTIONAL, scene_file_slice, opacity),                                           \
      .help = "1 hides everything behind the layer; 0 shows nothing of the layer.", .default_text = "`1`", .low = 0,   \
      .high = 1)                                                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("material", OPTIONAL, scene_file_slice, material, material_fields),                      \
      .help = "How the planes reflect light, as for an isosurface. `{}` gives a slight gloss.",                        \
      .default_text = "no lighting: the colours are those of the map", .child = &material_mapping)                     \
    LINES_KEY(X, scene_file_slice)                                                                                     \
    CLIP_KEY(X, scene_file_slice, "")
DEFINE_MAPPING(slice, "slice", SLICE_KEYS);

#define EDGES_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_FLOAT_PTR("width", OPTIONAL, scene_file_edges, width), .help = "Width of the lines, in pixels.",     \
      .default_text = "a 900th of the picture's height, but at least 1", .low = 0.5, .high = 100)                      \
    X(NUMBERS("colour", scene_file_edges, colour, 3), .help = "Colour of the lines, sRGB, before lighting.",           \
      .default_text = "`[0.1, 0.1, 0.1]`", .low = 0, .high = 1)
DEFINE_MAPPING(edges, "edges", EDGES_KEYS);

#define THRESHOLD_KEYS(X)                                                                                              \
    X(TEXT("field", REQUIRED, scene_file_threshold, field, 255),                                                       \
      .help = "Name of the field; at most 255 bytes. Nothing of the layer is shown on meshes that do not have it.")    \
    X(TEXT("component", OPTIONAL, scene_file_threshold, component, 16), .help = COMPONENT_HELP,                        \
      .default_text = COMPONENT_DEFAULT)                                                                               \
    X(CYAML_FIELD_FLOAT_PTR("from", OPTIONAL, scene_file_threshold, from), .help = "The least value that is shown.",   \
      .default_text = "none")                                                                                          \
    X(CYAML_FIELD_FLOAT_PTR("to", OPTIONAL, scene_file_threshold, to), .help = "The greatest value that is shown.",    \
      .default_text = "none")
DEFINE_MAPPING(threshold, "threshold", THRESHOLD_KEYS);

#define SURFACE_KEYS(X)                                                                                                \
    X(NAMES("mesh"), .help = "The mesh whose outer surface is drawn, or a list of meshes, as for an isosurface.",      \
      .default_text = "all meshes")                                                                                    \
    X(NUMBERS("colour", scene_file_surface, colour, 3), .help = "Colour, sRGB. Not allowed with `colour_by`.",         \
      .default_text = "`[0.8, 0.8, 0.8]`", .low = 0, .high = 1)                                                        \
    X(CYAML_FIELD_MAPPING_PTR("colour_by", OPTIONAL, scene_file_surface, colour_by, colour_by_fields),                 \
      .help = "Colours the surface by a field. On meshes of the layer that do not have the field, and where it is "    \
              "not a number, it is grey or has the colour `nan`, with a warning.",                                     \
      .default_text = "by `colour`", .child = &colour_by_mapping)                                                      \
    X(CYAML_FIELD_MAPPING_PTR("edges", OPTIONAL, scene_file_surface, edges, edges_fields),                             \
      .help = "Lines along the edges of the cells' faces. They fade if the faces are hardly wider than the lines. "    \
              "`{}` uses all defaults.",                                                                               \
      .default_text = "none", .child = &edges_mapping)                                                                 \
    X(CYAML_FIELD_MAPPING_PTR("threshold", OPTIONAL, scene_file_surface, threshold, threshold_fields),                 \
      .help = "Selects the cells whose value is within bounds. If the field is at vertices, the values of all "        \
              "vertices of a cell must be within the bounds. The outer surface of the selected cells is drawn. It is " \
              "computed again when the values have changed.",                                                          \
      .default_text = "all cells", .child = &threshold_mapping)                                                        \
    X(CYAML_FIELD_FLOAT_PTR("opacity", OPTIONAL, scene_file_surface, opacity),                                         \
      .help = "1 hides everything behind the layer; 0 shows nothing of the layer.", .default_text = "`1`", .low = 0,   \
      .high = 1)                                                                                                       \
    X(CYAML_FIELD_MAPPING_PTR("material", OPTIONAL, scene_file_surface, material, material_fields),                    \
      .help = "How the surface reflects light. `{ambient: 1, diffuse: 0, specular: 0}` shows the colours of the map.", \
      .default_text =                                                                                                  \
          "a slight gloss; for flat data (see `automatic`) in an image without `lights`, the colours are not lit",     \
      .child = &material_mapping)                                                                                      \
    LINES_KEY(X, scene_file_surface)                                                                                   \
    CLIP_KEY(X, scene_file_surface, "")
DEFINE_MAPPING(surface, "surface", SURFACE_KEYS);

#define LAYER_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_MAPPING_PTR("isosurface", OPTIONAL, scene_file_layer, isosurface, isosurface_fields),                \
      .help = "Surfaces on which a field has given values. If a mesh has only triangles, quads and polygons, its "     \
              "contour lines are drawn instead, as wide as `lines` are by default. In that case each layer counts as " \
              "one isovalue more.",                                                                                    \
      .default_text = "none", .child = &isosurface_mapping)                                                            \
    X(CYAML_FIELD_MAPPING_PTR("volume", OPTIONAL, scene_file_layer, volume, volume_fields),                            \
      .help = "A field as a coloured transparent volume. At most 4 in an image.", .default_text = "none",              \
      .child = &volume_mapping)                                                                                        \
    X(CYAML_FIELD_MAPPING_PTR("slice", OPTIONAL, scene_file_layer, slice, slice_fields),                               \
      .help = "Planes through the cells, coloured by a field.", .default_text = "none", .child = &slice_mapping)       \
    X(CYAML_FIELD_MAPPING_PTR("surface", OPTIONAL, scene_file_layer, surface, surface_fields),                         \
      .help = "The outer surface of meshes. It consists of the faces that belong to only one cell, over the cells of " \
              "all ranks except ghosts. Two faces are the same if their vertices are the same, by global ids or "      \
              "otherwise by equal coordinates. If a face meets smaller faces at hanging nodes, both the face and the " \
              "smaller ones are drawn. The faces are found once for a mesh, and take some 250 bytes each. Triangles, " \
              "quads and polygons of a mesh are drawn too. If one lies on a cell's face, it is drawn instead of that " \
              "face. Each layer counts as one isovalue.",                                                              \
      .default_text = "none", .child = &surface_mapping)
EXPORT_MAPPING(layer, "layers", LAYER_KEYS);
