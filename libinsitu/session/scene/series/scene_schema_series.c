/* Defines the keys of the camera, and of sweeps, which make several pictures of an image. The macros are in
 * scene_schema_lists.h. */
#include "scene.h"
#include "scene_schema_lists.h"

#define TAKES(list) .forms = (list), .form_count = (int)CYAML_ARRAY_LEN(list)

static const scene_form elevation_forms[] = {
    {{CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)}, {.low = -89.9, .high = 89.9}},
    {{CYAML_VALUE_SEQUENCE(CYAML_FLAG_DEFAULT, double, &number, 1, SCENE_MAX_ELEVATIONS)},
     {.low = -89.9, .high = 89.9}}};

static const cyaml_strval_t fit_words[] = {{"sphere", SCENE_FIT_SPHERE}, {"box", SCENE_FIT_BOX}};
static const cyaml_strval_t projection_words[] = {{"perspective", SCENE_PERSPECTIVE},
                                                  {"orthographic", SCENE_ORTHOGRAPHIC}};
#define AUTOMATIC_KEYS(X)                                                                                              \
    X(NUMBERS("direction", scene_file_automatic, direction, 3),                                                        \
      .help = "From the middle of the data towards the eye. Any length but 0.",                                        \
      .default_text = "`[1, 0.8, 1.2]`; the front of flat data")                                                       \
    X(CHOICE("fit", scene_file_automatic, fit, fit_words),                                                             \
      .help = "The body that fits into the image: the `box` of the data's bounds, which then fills 0.95 of the "       \
              "frame's width or height, less the room of a title, colour bars and rulers, or the `sphere` around it, " \
              "which looks the same size from every side and keeps off the same room.",                                \
      .default_text = "`sphere`; `box` of flat data")                                                                  \
    X(CYAML_FIELD_FLOAT_PTR("zoom", OPTIONAL, scene_file_automatic, zoom), .help = "1 fits; larger is nearer.",        \
      .default_text = "`1`", .low = 1e-4, .high = 1000)                                                                \
    X(CYAML_FIELD_SEQUENCE_FIXED("bounds", POINTER, scene_file_automatic, bounds, &colour, 2),                         \
      .help = "Two corners, `[[x, y, z], [x, y, z]]`, the lower one first: the camera is placed by this box, and "     \
              "stays where it is while the data moves.",                                                               \
      .default_text = "the bounds of all the data, at each drawn step")
DEFINE_MAPPING(automatic, "automatic", AUTOMATIC_KEYS);

#define ORBIT_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_INT("views", REQUIRED, scene_file_orbit, views),                                                     \
      .help =                                                                                                          \
          "The number of views of a circle, evenly spaced. An image makes a picture for each view of each circle, "    \
          "and all images together at most 1024 a step.",                                                              \
      .low = 1, .high = SCENE_MAX_PICTURES)                                                                            \
    X(NUMBERS("axis", scene_file_orbit, axis, 3),                                                                      \
      .help = "The axis that the eye goes around, counterclockwise seen from its tip, through the middle of the "      \
              "data; up in the image. Any length but 0.",                                                              \
      .default_text = "`[0, 1, 0]`")                                                                                   \
    X(CYAML_FIELD_IGNORE("elevation", OPTIONAL),                                                                       \
      .help = "How far the eye is above the plane across the axis, in degrees (theta); a list makes as many circles.", \
      .default_text = "`30`", TAKES(elevation_forms))                                                                  \
    X(CYAML_FIELD_FLOAT_PTR("start", OPTIONAL, scene_file_orbit, start),                                               \
      .help = "Where a circle's first view is, in degrees (phi). 0 is towards the z axis where `axis` is nearest to "  \
              "y, x where it is nearest to z, y where it is nearest to x.",                                            \
      .default_text = "`0`", .low = -360, .high = 360)
DEFINE_MAPPING(orbit, "orbit", ORBIT_KEYS);

#define POINT_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_FLOAT_PTR("time", OPTIONAL, scene_file_point, time),                                                 \
      .help = "When the camera is here. Later than at the place before. All places have a `time`, or all a `cycle`.",  \
      .default_text = "by `cycle`", .low = -1e30, .high = 1e30)                                                        \
    X(CYAML_FIELD_INT_PTR("cycle", OPTIONAL, scene_file_point, cycle), .help = "The same, by the run's cycle.",        \
      .default_text = "by `time`", .low = -2000000000, .high = 2000000000)                                             \
    X(CYAML_FIELD_SEQUENCE_FIXED("position", CYAML_FLAG_POINTER, scene_file_point, position, &number, 3),              \
      .help = "Where the eye is, in scene units.", .low = -1e30, .high = 1e30)                                         \
    X(CYAML_FIELD_SEQUENCE_FIXED("focal", CYAML_FLAG_POINTER, scene_file_point, focal, &number, 3),                    \
      .help = "The point looked at. Not where the eye is.", .low = -1e30, .high = 1e30)                                \
    X(NUMBERS("up", scene_file_point, up, 3),                                                                          \
      .help = "The direction that is up in the image, not parallel to the view.",                                      \
      .default_text = "the camera's `up`, or `[0, 1, 0]`", .low = -1e30, .high = 1e30)                                 \
    X(CYAML_FIELD_FLOAT_PTR("angle", OPTIONAL, scene_file_point, angle),                                               \
      .help = "Whole vertical angle of view, in degrees.", .default_text = "the camera's", .low = 1e-6, .high = 180,   \
      .is_high_excluded = true)
DEFINE_MAPPING(point, "path", POINT_KEYS);

static const cyaml_schema_value_t point = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_point, point_fields)};

#define CAMERA_KEYS(X)                                                                                                 \
    X(NUMBERS("position", scene_file_camera, position, 3),                                                             \
      .help = "Where the eye is, in scene units. With `focal`; not with `automatic`.", .default_text = "automatic")    \
    X(NUMBERS("focal", scene_file_camera, focal, 3),                                                                   \
      .help = "The point looked at, in the middle of the image. Not where the eye is. With `position`.",               \
      .default_text = "automatic")                                                                                     \
    X(CYAML_FIELD_MAPPING_PTR("automatic", OPTIONAL, scene_file_camera, automatic, automatic_fields),                  \
      .help = "Place the eye by the bounds of all the data of all ranks, at each drawn step. Data is flat if all of "  \
              "its cells are triangles, quads and polygons, and its bounds are at most 1e-6 as wide along x, y or z "  \
              "as along the widest axis. It is seen from the front, orthographic, and fills the frame, unless "        \
              "`direction`, `projection`, `fit` or an `orbit` say otherwise: in the plane of x and y, x goes to the "  \
              "right and y up, of x and z, z up, of y and z, y to the right and z up.",                                \
      .default_text = "where no `position` is given", .child = &automatic_mapping)                                     \
    X(NUMBERS("up", scene_file_camera, up, 3),                                                                         \
      .help = "The direction that is up in the image, not parallel to the view.",                                      \
      .default_text = "`[0, 1, 0]`; `[0, 0, 1]` where the view is along y")                                            \
    X(CYAML_FIELD_FLOAT_PTR("angle", OPTIONAL, scene_file_camera, angle),                                              \
      .help = "Whole vertical angle of view, in degrees.", .default_text = "`40`", .low = 1e-6, .high = 180,           \
      .is_high_excluded = true)                                                                                        \
    X(CHOICE("projection", scene_file_camera, projection, projection_words),                                           \
      .help = "`orthographic`: all rays are parallel, and equal lengths look equal wherever they are.",                \
      .default_text = "`perspective`; `orthographic` of flat data with an automatic camera")                           \
    X(CYAML_FIELD_FLOAT_PTR("height", OPTIONAL, scene_file_camera, height),                                            \
      .help = "With `projection: orthographic`: the height of what the image shows, in scene units.",                  \
      .default_text = "what fits the data; with `position`, what a perspective image shows at `focal`", .low = 0,      \
      .is_low_excluded = true, .high = 1e30)                                                                           \
    X(CYAML_FIELD_MAPPING_PTR("orbit", OPTIONAL, scene_file_camera, orbit, orbit_fields),                              \
      .help = "Draw the image from several places on circles around the data, at each drawn step: a picture each. "    \
              "`fit` and `zoom` are those of `automatic`.",                                                            \
      .default_text = "none", .child = &orbit_mapping)                                                                 \
    X(CYAML_FIELD_SEQUENCE("path", POINTER, scene_file_camera, path, &point, 1, 256),                                  \
      .help = "Places that the camera goes through as the run goes on. Between two of them each coordinate and the "   \
              "angle follow a cubic whose slope at a place is the weighted harmonic mean of the slopes to its "        \
              "neighbours, and 0 at the ends and where the coordinate turns: the camera begins and ends at rest, "     \
              "moves without a "                                                                                       \
              "jerk, and never beyond the coordinates of the two places. It stands at the first before, and at the "   \
              "last after. Not with `position`, `automatic` or `orbit`.",                                              \
      .default_text = "none", .child = &point_mapping)
EXPORT_MAPPING(camera, "camera", CAMERA_KEYS);

#define SWEEP_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_BOOL_PTR("isovalues", OPTIONAL, scene_file_sweep, isovalues),                                        \
      .help = "A picture for each of the `values` of the image's isosurface, of which there is one layer, in place "   \
              "of all of them in one.",                                                                                \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_BOOL_PTR("planes", OPTIONAL, scene_file_sweep, planes),                                              \
      .help = "A picture for each of the planes of the image's slice, of which there is one layer, in place of all "   \
              "of them in one: those of a list, of `offsets` or of a `count`, in turn.",                               \
      .default_text = "`false`")                                                                                       \
    X(NAMES("fields"),                                                                                                 \
      .help = "Names of fields without `/`, a picture for each: it takes the place of the field in every layer that "  \
              "a field colours: slices, volumes, and `colour_by` of isosurfaces and surfaces, with their other keys "  \
              "as they are.",                                                                                          \
      .default_text = "none")
EXPORT_MAPPING(sweep, "sweep", SWEEP_KEYS);
