/* Defines the scene file's keys of the camera and of sweeps. A sweep draws one entry of `images` several times, once
 * for each combination of its fields, isovalues and planes, as separate pictures. Macros that are not defined here are
 * in scene_schema_lists.h. */
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
      .help = "From the middle of the data towards the eye. Any length except 0.",                                     \
      .default_text = "`[1, 0.8, 1.2]`; for flat data, the direction from which they are seen from the front")         \
    X(CHOICE("fit", scene_file_automatic, fit, fit_words),                                                             \
      .help = "What fits into the image. `box` is the box of the data's bounds: it fills 0.95 of the frame's width "   \
              "or height, without the room of a title, colour bars and rulers. `sphere` is the sphere around that "    \
              "box: it looks the same size from every side and leaves the same room free.",                            \
      .default_text = "`sphere`; `box` for flat data")                                                                 \
    X(CYAML_FIELD_FLOAT_PTR("zoom", OPTIONAL, scene_file_automatic, zoom),                                             \
      .help = "With 1 the data fit the image. With a larger number they look larger.", .default_text = "`1`",          \
      .low = 1e-4, .high = 1000)                                                                                       \
    X(CYAML_FIELD_SEQUENCE_FIXED("bounds", POINTER, scene_file_automatic, bounds, &colour, 2),                         \
      .help = "Two corners, `[[x, y, z], [x, y, z]]`, the lower one first. The camera is placed by this box instead, " \
              "and does not move when the data move.",                                                                 \
      .default_text = "the bounds of all the data, at each drawn step")
DEFINE_MAPPING(automatic, "automatic", AUTOMATIC_KEYS);

#define ORBIT_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_INT("views", REQUIRED, scene_file_orbit, views),                                                     \
      .help = "The number of views on a circle, evenly spaced. An image makes a picture for each view of each "        \
              "circle. All images together make at most 1024 pictures per step.",                                      \
      .low = 1, .high = SCENE_MAX_PICTURES)                                                                            \
    X(NUMBERS("axis", scene_file_orbit, axis, 3),                                                                      \
      .help = "The axis around which the eye moves, through the middle of the data. The motion is counterclockwise, "  \
              "seen from the tip of the axis. The axis is up in the image. Any length except 0.",                      \
      .default_text = "`[0, 1, 0]`")                                                                                   \
    X(CYAML_FIELD_IGNORE("elevation", OPTIONAL),                                                                       \
      .help = "The angle of the eye above the plane that is perpendicular to the axis, in degrees (theta). A list "    \
              "makes one circle for each of its angles.",                                                              \
      .default_text = "`30`", TAKES(elevation_forms))                                                                  \
    X(CYAML_FIELD_FLOAT_PTR("start", OPTIONAL, scene_file_orbit, start),                                               \
      .help = "The position of a circle's first view, in degrees (phi). 0 is towards the z axis if `axis` is nearest " \
              "to y, towards x if it is nearest to z, and towards y if it is nearest to x.",                           \
      .default_text = "`0`", .low = -360, .high = 360)
DEFINE_MAPPING(orbit, "orbit", ORBIT_KEYS);

#define POINT_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_FLOAT_PTR("time", OPTIONAL, scene_file_point, time),                                                 \
      .help = "The time at which the camera is here. It must be later than at the previous place. Either all places "  \
              "have a `time`, or all have a `cycle`.",                                                                 \
      .default_text = "by `cycle`", .low = -1e30, .high = 1e30)                                                        \
    X(CYAML_FIELD_INT_PTR("cycle", OPTIONAL, scene_file_point, cycle),                                                 \
      .help = "The same as `time`, but given as the cycle of the run.", .default_text = "by `time`",                   \
      .low = -2000000000, .high = 2000000000)                                                                          \
    X(CYAML_FIELD_SEQUENCE_FIXED("position", CYAML_FLAG_POINTER, scene_file_point, position, &number, 3),              \
      .help = "Position of the eye, in scene units.", .low = -1e30, .high = 1e30)                                      \
    X(CYAML_FIELD_SEQUENCE_FIXED("focal", CYAML_FLAG_POINTER, scene_file_point, focal, &number, 3),                    \
      .help = "The point that the camera looks at. It must differ from the eye.", .low = -1e30, .high = 1e30)          \
    X(NUMBERS("up", scene_file_point, up, 3),                                                                          \
      .help = "The direction that is up in the image. It must not be parallel to the view.",                           \
      .default_text = "the camera's `up`, or `[0, 1, 0]`", .low = -1e30, .high = 1e30)                                 \
    X(CYAML_FIELD_FLOAT_PTR("angle", OPTIONAL, scene_file_point, angle),                                               \
      .help = "The full vertical angle of view, in degrees.", .default_text = "the camera's", .low = 1e-6,             \
      .high = 180, .is_high_excluded = true)
DEFINE_MAPPING(point, "path", POINT_KEYS);

static const cyaml_schema_value_t point = {CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, scene_file_point, point_fields)};

#define CAMERA_KEYS(X)                                                                                                 \
    X(NUMBERS("position", scene_file_camera, position, 3),                                                             \
      .help = "Position of the eye, in scene units. `focal` must be given too. Not allowed with `automatic`.",         \
      .default_text = "automatic")                                                                                     \
    X(NUMBERS("focal", scene_file_camera, focal, 3),                                                                   \
      .help = "The point that the camera looks at, which is in the middle of the image. It must differ from the eye. " \
              "`position` must be given too.",                                                                         \
      .default_text = "automatic")                                                                                     \
    X(CYAML_FIELD_MAPPING_PTR("automatic", OPTIONAL, scene_file_camera, automatic, automatic_fields),                  \
      .help = "Places the eye by the bounds of all data of all ranks, at each drawn step. Flat data are treated "      \
              "differently. Data are flat if all cells are triangles, quads and polygons, and if the extent of the "   \
              "bounds along x, y or z is at most 1e-6 of the largest extent. Flat data are seen from the front, "      \
              "orthographic, and fill the frame, unless `direction`, `projection`, `fit` or an `orbit` say "           \
              "otherwise. In the plane of x and y, x goes to the right and y up. In the plane of x and z, z goes up. " \
              "In the plane of y and z, y goes to the right and z up.",                                                \
      .default_text = "used if no `position` is given", .child = &automatic_mapping)                                   \
    X(NUMBERS("up", scene_file_camera, up, 3),                                                                         \
      .help = "The direction that is up in the image. It must not be parallel to the view.",                           \
      .default_text = "`[0, 1, 0]`; `[0, 0, 1]` if the view is along y")                                               \
    X(CYAML_FIELD_FLOAT_PTR("angle", OPTIONAL, scene_file_camera, angle),                                              \
      .help = "The full vertical angle of view, in degrees.", .default_text = "`40`", .low = 1e-6, .high = 180,        \
      .is_high_excluded = true)                                                                                        \
    X(CHOICE("projection", scene_file_camera, projection, projection_words),                                           \
      .help = "With `orthographic`, all rays are parallel, and equal lengths look equal at any distance.",             \
      .default_text = "`perspective`; `orthographic` for flat data with an automatic camera")                          \
    X(CYAML_FIELD_FLOAT_PTR("height", OPTIONAL, scene_file_camera, height),                                            \
      .help = "With `projection: orthographic`: the height of the region that the image shows, in scene units.",       \
      .default_text = "what fits the data; with `position`, the height that a perspective image shows at `focal`",     \
      .low = 0, .is_low_excluded = true, .high = 1e30)                                                                 \
    X(CYAML_FIELD_MAPPING_PTR("orbit", OPTIONAL, scene_file_camera, orbit, orbit_fields),                              \
      .help = "Draws the image from several viewpoints on circles around the data, at each drawn step. Each "          \
              "viewpoint gives a picture. `fit` and `zoom` are those of `automatic`.",                                 \
      .default_text = "none", .child = &orbit_mapping)                                                                 \
    X(CYAML_FIELD_SEQUENCE("path", POINTER, scene_file_camera, path, &point, 1, 256),                                  \
      .help =                                                                                                          \
          "Places that the camera passes during the run. Between two places, each coordinate and the angle follow a "  \
          "cubic. Its slope at a place is the weighted harmonic mean of the slopes to the neighbours. The slope is 0 " \
          "at the ends and where the coordinate changes direction. So the camera starts and ends at rest, moves "      \
          "without a jerk, and never leaves the range of the coordinates of the two places. Before the first place "   \
          "and after the last it does not move. Not allowed with `position`, `automatic` or `orbit`.",                 \
      .default_text = "none", .child = &point_mapping)
EXPORT_MAPPING(camera, "camera", CAMERA_KEYS);

#define SWEEP_KEYS(X)                                                                                                  \
    X(CYAML_FIELD_BOOL_PTR("isovalues", OPTIONAL, scene_file_sweep, isovalues),                                        \
      .help = "Makes one picture for each of the `values` of the image's isosurface, instead of one picture with all " \
              "of them. The image must have one such layer.",                                                          \
      .default_text = "`false`")                                                                                       \
    X(CYAML_FIELD_BOOL_PTR("planes", OPTIONAL, scene_file_sweep, planes),                                              \
      .help = "Makes one picture for each plane of the image's slice, instead of one picture with all of them. The "   \
              "planes are taken in the order of the list, of `offsets` or of `count`. The image must have one such "   \
              "layer.",                                                                                                \
      .default_text = "`false`")                                                                                       \
    X(NAMES("fields"),                                                                                                 \
      .help = "Names of fields, without `/`. Each gives one picture, in which it replaces the field of every layer "   \
              "that is coloured by a field: slices, volumes, and `colour_by` of isosurfaces and surfaces. The other "  \
              "keys of these layers stay as they are.",                                                                \
      .default_text = "none")
EXPORT_MAPPING(sweep, "sweep", SWEEP_KEYS);
