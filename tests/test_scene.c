/* Checks the scene parser: the result of a valid file, all defaults, and the messages about invalid files. Each invalid
 * file is the same valid file with one line replaced, so that only this line can cause the message. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <dirent.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colour_map.h"
#include "memory.h"
#include "scene.h"
#include "scene_document.h"

/* Converts a colour by the definition of sRGB, in double and independently of the library. */
static double convert_srgb_to_linear(double s)
{
    return s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
}

/* Tolerance of a colour for its roundings to float32: sRGB to float, pow, and multiplication by a factor, each within
 * 2^-24 relative; the slope of the curve is below 2.5. */
#define COLOUR_TOLERANCE 1e-6

static void assert_nearly_equal(double value, double expected, double tolerance)
{
    if (!(fabs(value - expected) <= tolerance)) fail_msg("%.17g, expected %.17g within %g", value, expected, tolerance);
}

static insitu_status parse_scene(const char *text, scene *s, base_error *error)
{
    *error = (base_error){.status = INSITU_OK};
    return scene_parse(text, strlen(text), "scene.yaml", NULL, s, error);
}

static void parse_valid_scene(const char *text, scene *s)
{
    base_error error;
    if (parse_scene(text, s, &error) != INSITU_OK) fail_msg("refused: %s", error.message);
}

/* 64 brackets, the largest number that may be nested */
#define EIGHT(text) text text text text text text text text
#define BEGIN_64 EIGHT(EIGHT("("))
#define END_64 EIGHT(EIGHT(")"))

static const char every_key[] =
    "threads: 3\n"
    "tree: partial\n"
    "images:\n"
    "  - name: wave\n"
    "    size: [640, 480]\n"
    "    every: 10\n"
    "    camera: {position: [4, 3, 5], focal: [1, 0, 0], up: [0, 0, 2], angle: 35.5}\n"
    "    background: [0.5, 0.25, 1, 0.5]\n"
    "    lights:\n"
    "      - {direction: [0, 0, 2], colour: [1, 0.5, 0], intensity: 0.5, in: world}\n"
    "      - {direction: [3, 0, 4], in: camera, shadows: false}\n"
    "    shadows: true\n"
    "    ambient_occlusion: {samples: 24, radius: 0.75}\n"
    "    layers:\n"
    "      - isosurface:\n"
    "          field: pressure\n"
    "          component: magnitude\n"
    "          values: [0.2, 0.5, -1e-3]\n"
    "          colours: [[1, 0, 0], [0.5, 0.25, 0]]\n"
    "          opacity: 0.5\n"
    "          material: {ambient: 0.1, diffuse: 0.2, specular: 0.3, shininess: 40}\n"
    "          normals: differences\n"
    "          difference: 0.25\n"
    "      - volume:\n"
    "          field: temperature\n"
    "          component: y\n"
    "          mesh: [air, sea]\n"
    "          interpolate: vertex\n"
    "          map: cool_to_warm\n"
    "          range: [-2, 3]\n"
    "          opacity: [[0, 0], [0.4, 0.3], [0.4, 0.5], [1, 0.9]]\n"
    "          unit_distance: 0.1\n"
    "          clip: {sphere: {centre: [1, -2, 3], radius: 2.5}, keep: outside}\n"
    "      - isosurface:\n"
    "          {field: q, values: [7], mesh: air, interpolate: vertex, colour_by:\n"
    "           {field: speed, component: 2, map: inferno, range: [0, 1],\n"
    "            interpolate: vertex}, lines: {field: q, component: x, values: [1, 2], width: 2, colour: [1, 0, 0]},\n"
    "           clip: {sphere: {centre: [1, -2, 3], radius: 2.5}, keep: outside}}\n"
    "      - slice: {field: q, component: x, interpolate: vertex, mesh: air, map: grey,\n"
    "                range: [0, 2], opacity: 0.5, material: {specular: 0}, planes: [\n"
    "                {normal: [1, 0, 0], point: [1, 2, 3], offset: 1},\n"
    "                {normal: [0, 1, 0], offsets: [1, 2]}, {normal: [0, 0, 1], count: 3}],\n"
    "                clip: {box: [[0, 0, 0], [9, 9, 9]], keep: inside}, lines: {count: 5}}\n"
    "      - surface: {mesh: [air, sea], colour: [1, 0.5, 0], opacity: 0.5,\n"
    "                  edges: {width: 2, colour: [0, 0.5, 1]}, lines: {field: q, values: [3]},\n"
    "                  clip: {box: [[0, 0, 0], [1, 2, 3]]}}\n"
    "      - surface: {colour_by: {field: q, map: grey, interpolate: vertex}, edges: {},\n"
    "                  threshold: {field: q, component: 1, from: 1, to: 2.5}}\n"
    "      - surface: {threshold: {field: q, from: -3}}\n"
    "    sampling: {step_cells: 0.25, jitter: false, frames: 4,\n"
    "               max_seconds: 10, method: segments, reproducible: true}\n"
    "    clip: {planes: [{normal: [0, 0, -2], point: [1, 2, 3]}], box: [[0, 0, 0], [1, 2, 3]]}\n"
    "    outputs:\n"
    "      - path: \"out/{name}_{cycle:06}.png\"\n"
    "        bits: 16\n"
    "      - path: out/wave_{cycle}.EXR\n"
    "        data: true\n"
    "      - {path: \"out/{name}.exr\", deep: true}\n"
    "  - name: second\n"
    "    every_time: 0.25\n"
    "    once: true\n"
    "    when: {field: p, component: 2, mesh: [air, sea], of: mean, above: 1, below: 2.5}\n"
    "    antialias: 4\n"
    "    camera: {automatic: {direction: [0, 3, 4], zoom: 1.5, fit: box, bounds: [[0, 1, 2], [3, 4, 5]]},\n"
    "             projection: orthographic, height: 2.5}\n"
    "    layers: [{volume: {field: p}}]\n"
    "    sampling: {step: 0.125}\n"
    "    outputs: [{path: b.png, bits: 8}]\n"
    "  - name: third\n"
    "    layers:\n"
    "      - volume: {field: p}\n"
    "      - volume: {field: q}\n"
    "      - isosurface:\n"
    "          {field: q, values: [7], colour_by: {field: p, reversed: true, discrete: 5,\n"
    "           map: {colours: [[0, 0, 0], [1, 0, 0], [1, 1, 1]], at: [0, 0.25, 1]},\n"
    "           scale: symlog, threshold: 0.5, below: [0, 0, 1], above: [0, 1, 0],\n"
    "           nan: [1, 0, 1]}}\n"
    "    sampling: {max_error: 1e-3}\n"
    "    decorations:\n"
    "      title: \"{name} at {time:.2f} s\"\n"
    "      text: [{text: \"cycle {cycle}\", at: bottom_right}, {text: plain}]\n"
    "      colour_bar: {at: left, labels: [p in Pa, q], ticks: 4, units: [Pa, K], notation: fixed, digits: 2}\n"
    "      outline: true\n"
    "      axes: true\n"
    "      rulers: true\n"
    "      scale_bar: {unit: mm, at: bottom}\n"
    "      colour: [1, 0, 0.5]\n"
    "      size: 0.04\n"
    "    outputs:\n"
    "      - {path: c.png, decorations: false, grid: [2, 1], shared_bars: false}\n"
    "      - {path: \"c{time:.1e}.exr\", decorations: true}\n"
    "  - name: fourth\n"
    "    camera:\n"
    "      automatic: {zoom: 0.9}\n"
    "      orbit: {views: 4, axis: [0, 0, 2], elevation: [-10, 20.5], start: 45}\n"
    "    sweep: {isovalues: true, planes: true, fields: [p, r]}\n"
    "    layers:\n"
    "      - slice: {field: p, planes: [{normal: x}]}\n"
    "      - isosurface: {field: q, values: [1, 2, 3], colour_by: {field: p}}\n"
    "    outputs:\n"
    "      - {cinema: runs/all.cdb}\n"
    "      - {path: \"d{view:02}{isovalue:.1f}{field}.exr\"}\n"
    "  - name: fifth\n"
    "    camera:\n"
    "      angle: 30\n"
    "      path:\n"
    "        - {time: 0, position: [0, 0, 5], focal: [0, 0, 0]}\n"
    "        - {time: 2, position: [5, 0, 0], focal: [0, 1, 0], up: [0, 0, 3], angle: 50}\n"
    "    layers: [{volume: {field: p}}]\n"
    "    outputs: [{cinema: runs/all.cdb, path: \"{cycle}/e.png\"}]\n"
    "  - name: sixth\n"
    "    size: [64, 48]\n"
    "    camera: {path: [{cycle: 3, position: [0, 0, 5], focal: [0, 0, 0]}]}\n"
    "    layers: [{volume: {field: p}}]\n"
    "    outputs: [{path: f.png}, {path: c.png, inset: bottom_right}]\n"
    "statistics:\n"
    "  - {field: p, mesh: air, component: x, path: out/p.csv, every: 3, histogram: {bins: 8, range: [-1, 1]}}\n"
    "  - {field: q, path: q.CSV, histogram: {}}\n"
    "  - {field: r, path: r.csv}\n"
    "fields:\n"
    "  late: 2 * last.z - speed^2\n"
    "  speed: {magnitude: u}\n"
    "  last: {vorticity: [vx, u.1, late_w]}\n"
    "  late_w: {expression: \"max(u.z, 'a b')\"}\n"
    "  y: {field: u, component: y}\n"
    "  g: {gradient: speed, component: magnitude}\n"
    "  d: {divergence: u}\n"
    "  q: {q_criterion: u}\n"
    "  l: {lambda2: u}\n"
    "  s: {strain_rate: u}\n"
    "  slice: {field: u, component: x}\n"
    "  nested: " BEGIN_64 "p" END_64 "\n"
    "meshes:\n"
    "  plate: {warp: {field: DISPL, scale: -2.5}}\n"
    "  plate/a.b: {warp: w}\n"
    "  colour: {warp: {field: u, scale: 0}, mirror: [z, x]}\n"
    "  axis: {mirror: y}\n"
    "  axis/b: {mirror: {x: -1.5, z: 2}}\n"
    "writing: step\n"
    "finer_pieces: 1\n"
    "finer_memory: 200.5\n"
    "parameters: {inflow: 2.5, _k-2: -1e-3, values: 3, color: 4, axis: 5}\n"
    "schedule: radix\n";

/* Keys that must not be combined with other keys of the file above. */
static const char excluding_keys[] = "surface_error: 0.5\n"
                                     "images:\n"
                                     "- {name: a, layers: [volume: {field: p}], outputs: [{path: a.png}]}\n";

static const char mirrored_keys[] = "meshes: {plate: {mirror: x}}\n"
                                    "images:\n"
                                    "- {name: a, layers: [volume: {field: p}], outputs: [{path: a.png}]}\n";

static const char fewest_keys[] = "images:\n"
                                  "- name: a\n"
                                  "  layers:\n"
                                  "  - isosurface: {field: p, values: [1, 2]}\n"
                                  "  - isosurface: {field: p, values: [1], colour_by: {field: q}}\n"
                                  "  - volume: {field: p}\n"
                                  "  outputs: [{path: a.png}]\n";

static void check_vector(const double v[3], double x, double y, double z)
{
    assert_nearly_equal(v[0], x, 1e-15);
    assert_nearly_equal(v[1], y, 1e-15);
    assert_nearly_equal(v[2], z, 1e-15);
}

/* Checks that the colours of the map are bitwise equal to the table with the given name. */
static void check_built_in_colour_map(const scene_colour_map *map, const char *name)
{
    int count = 0;
    const float *table = colour_map_table(name, &count);
    assert_string_equal(map->name, name);
    assert_int_equal(map->count, count);
    assert_memory_equal(map->colours, table, (size_t)count * 3 * sizeof *table);
}

static void check_colour(const float c[3], double r, double g, double b)
{
    assert_nearly_equal(c[0], r, COLOUR_TOLERANCE);
    assert_nearly_equal(c[1], g, COLOUR_TOLERANCE);
    assert_nearly_equal(c[2], b, COLOUR_TOLERANCE);
}

static void scene_image_keys_are_read(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(every_key, &s);
    assert_int_equal(s.threads, 3);
    assert_int_equal(s.tree, SCENE_TREE_PARTIAL);
    assert_int_equal(s.writing, SCENE_WRITE_IN_STEP);
    assert_true(s.finer_pieces == 1 && s.finer_memory == 200.5);
    assert_int_equal(s.schedule, SCENE_SCHEDULE_RADIX);
    assert_int_equal(s.image_count, 3 + 4 * 2 * 3 * 2 + 2);
    const scene_image *image = &s.images[0];
    assert_string_equal(image->name, "wave");
    assert_int_equal(image->line, 4);
    assert_int_equal(image->width, 640);
    assert_int_equal(image->height, 480);
    assert_int_equal(image->cycle_interval, 10);
    check_colour(image->background, 0.5 * convert_srgb_to_linear(0.5), 0.5 * convert_srgb_to_linear(0.25), 0.5);
    assert_true(image->background[3] == 0.5F);
    assert_true(image->step == 0 && image->step_cells == 0.25);
    assert_false(image->jitter);
    assert_int_equal(image->frames, 4);
    assert_true(image->is_reproducible && !s.images[1].is_reproducible);
    assert_true(image->max_seconds == 10 && s.images[1].max_seconds == 3600);
    assert_true(image->method == SCENE_SEGMENTS && image->max_error == 0);
    assert_true(s.images[2].method == SCENE_SEGMENTS && s.images[2].max_error == 1e-3 && s.images[2].volume_count == 2);
    assert_int_equal(image->output_count, 3);
    assert_string_equal(image->outputs[0].path, "out/{name}_{cycle:06}.png");
    assert_int_equal(image->outputs[0].format, SCENE_PNG16);
    assert_string_equal(image->outputs[1].path, "out/wave_{cycle}.EXR");
    assert_int_equal(image->outputs[1].format, SCENE_EXR);
    assert_true(image->outputs[1].has_data && !image->outputs[0].has_data);
    assert_true(image->outputs[2].is_deep && !image->outputs[1].is_deep && !image->outputs[2].has_decorations);
    assert_int_equal(image->isosurfaces[1].number, 2);
    assert_int_equal(image->slices[0].number, 3);
    assert_int_equal(image->surfaces[2].number, 6);
    assert_true(s.images[1].step == 0.125);
    assert_int_equal(s.images[1].outputs[0].format, SCENE_PNG8);
    scene_free(&s);
}

static void scene_view_keys_are_read(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(every_key, &s);
    const scene_camera *camera = &s.images[0].camera;
    assert_false(camera->is_automatic);
    check_vector(camera->eye, 4, 3, 5);
    check_vector(camera->focal, 1, 0, 0);
    check_vector(camera->up, 0, 0, 1);
    assert_true(camera->angle == 35.5);
    assert_true(s.images[0].antialias == 1 && s.images[1].antialias == 4 && s.images[1].frames == 4);
    assert_true(s.images[1].camera.is_automatic && s.images[1].camera.fits_box);
    assert_true(s.images[0].time_interval == 0 && s.images[1].time_interval == 0.25);
    assert_true(s.images[1].camera.is_orthographic && s.images[1].camera.height == 2.5);
    check_vector(s.images[1].camera.direction, 0, 0.6, 0.8);
    assert_true(s.images[1].camera.zoom == 1.5 && s.images[1].camera.has_bounds);
    check_vector(s.images[1].camera.lower, 0, 1, 2);
    check_vector(s.images[1].camera.upper, 3, 4, 5);

    const scene_light *lights = s.images[0].lights;
    assert_int_equal(s.images[0].light_count, 2);
    check_vector(lights[0].direction, 0, 0, 1);
    assert_true(lights[0].is_in_world);
    check_colour(lights[0].colour, 0.5, 0.5 * convert_srgb_to_linear(0.5), 0);
    check_vector(lights[1].direction, 0.6, 0, 0.8);
    assert_false(lights[1].is_in_world);
    assert_int_equal(s.images[0].shadows, 1);
    assert_int_equal(s.images[0].occlusion_samples, 24);
    assert_true(s.images[0].occlusion_radius == 0.75);
    scene_free(&s);
}

static void lights_cast_shadows_by_default(void **state)
{
    static const char text[] = "images:\n  - name: a\n    %s\n"
                               "    layers: [{isosurface: {field: f, values: [0]}}]\n"
                               "    outputs: [{path: a.png}]\n";
    static const struct {
        const char *keys;
        uint32_t shadows;
        int samples;
    } cases[] = {{"shadows: true", 3, 0},
                 {"shadows: false", 0, 0},
                 {"ambient_occlusion: {}", 0, 16},
                 {"lights: [{direction: [0, 0, 1], shadows: true}]\n    shadows: false", 0, 0},
                 {"lights: [{direction: [0, 0, 1], shadows: false}, {direction: [1, 0, 0]}]\n    shadows: true", 2, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char filled[512];
        scene s;
        snprintf(filled, sizeof filled, text, cases[i].keys);
        parse_valid_scene(filled, &s);
        assert_int_equal(s.images[0].shadows, cases[i].shadows);
        assert_int_equal(s.images[0].occlusion_samples, cases[i].samples);
        assert_true(s.images[0].occlusion_radius == 0);
        scene_free(&s);
    }
}

static void scene_isosurface_keys_are_read(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(every_key, &s);
    assert_int_equal(s.images[0].isosurface_count, 2);
    const scene_isosurface *first = &s.images[0].isosurfaces[0], *second = first + 1;
    assert_string_equal(first->field.name, "pressure");
    assert_int_equal(first->field.line, 16);
    assert_int_equal(first->field.component, SCENE_COMPONENT_MAGNITUDE);
    assert_int_equal(first->value_count, 3);
    assert_true(first->values[0] == 0.2 && first->values[1] == 0.5 && first->values[2] == -1e-3);
    check_colour(first->colours, 1, 0, 0);
    check_colour(first->colours + 3, convert_srgb_to_linear(0.5), convert_srgb_to_linear(0.25), 0);
    check_colour(first->colours + 6, convert_srgb_to_linear(0.5), convert_srgb_to_linear(0.25), 0);
    assert_true(first->opacity == 0.5F);
    assert_true(first->material.ambient == 0.1F && first->material.diffuse == 0.2F);
    assert_true(first->material.specular == 0.3F && first->material.shininess == 40);
    assert_true(first->normals == SCENE_DIFFERENCES && first->difference == 0.25);
    assert_true(second->normals == SCENE_GRADIENT && second->difference == 1);
    assert_false(first->has_colour_by);
    assert_true(second->has_colour_by);
    assert_string_equal(second->colour_by.name, "speed");
    assert_int_equal(second->colour_by.component, 2);
    assert_int_equal(second->colour_by.line, 36);
    assert_true(second->field.mesh_count == 1 && second->colour_by.mesh_count == 1 && first->field.mesh_count == 0);
    assert_true(scene_field_selects_mesh(&second->colour_by, "air") &&
                !scene_field_selects_mesh(&second->colour_by, "sea"));
    assert_true(scene_field_selects_mesh(&first->field, "anything"));
    assert_true(first->field.at_vertices && second->field.at_vertices && second->colour_by.at_vertices);
    check_built_in_colour_map(&second->colour_map, "inferno");
    assert_true(second->colour_map.range.is_fixed);
    assert_true(second->colour_map.range.low == 0 && second->colour_map.range.high == 1);
    scene_free(&s);
}

static void scene_volume_keys_are_read(void **state)
{
    (void)state;
    static const double at[] = {0, 0.4, 0.4, 1};
    static const float opacity[] = {0, 0.3F, 0.5F, 0.9F};
    scene s;
    parse_valid_scene(every_key, &s);
    assert_int_equal(s.images[0].volume_count, 1);
    const scene_volume *volume = &s.images[0].volumes[0];
    assert_string_equal(volume->field.name, "temperature");
    assert_int_equal(volume->field.component, 1);
    check_built_in_colour_map(&volume->colour_map, "cool_to_warm");
    const scene_range *range = &volume->colour_map.range;
    assert_true(range->is_fixed && range->low == -2 && range->high == 3);
    assert_true(volume->unit_distance == 0.1);
    assert_true(volume->field.at_vertices && !s.images[1].volumes[0].field.at_vertices);
    assert_true(volume->field.mesh_count == 2 && volume->field.meshes_line == 27);
    assert_true(scene_field_selects_mesh(&volume->field, "air") &&
                scene_field_selects_mesh(&volume->field, "sea/12/3"));
    assert_false(scene_field_selects_mesh(&volume->field, "se") || scene_field_selects_mesh(&volume->field, "sea2"));
    assert_int_equal(volume->opacity_count, 4);
    for (int i = 0; i < 4; i++)
        assert_true(volume->opacity[i].position == at[i] && volume->opacity[i].opacity == opacity[i]);
    scene_free(&s);
}

static void scene_image_defaults_hold(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(fewest_keys, &s);
    const scene_image *image = &s.images[0];
    const double length = sqrt(1 + 0.64 + 1.44);
    assert_int_equal(s.threads, 0);
    assert_int_equal(s.tree, SCENE_TREE_AUTO);
    assert_int_equal(s.writing, SCENE_WRITE_BEHIND);
    assert_true(s.finer_pieces == 0 && s.surface_error == 0.25 && !s.is_surface_error_given && s.finer_memory == 4096);
    assert_true(image->width == 1280 && image->height == 720 && image->cycle_interval == 1);
    check_colour(image->background, convert_srgb_to_linear(0.08), convert_srgb_to_linear(0.09),
                 convert_srgb_to_linear(0.11));
    assert_true(image->background[3] == 1);
    assert_true(image->step == 0 && image->step_cells == 0.5);
    assert_true(image->jitter && image->frames == 1);
    assert_true(image->method == SCENE_SEGMENTS && image->max_error == 0.01);
    assert_true(image->camera.is_automatic && image->camera.angle == 40 && image->camera.zoom == 1);
    check_vector(image->camera.direction, 1 / length, 0.8 / length, 1.2 / length);
    check_vector(image->camera.up, 0, 1, 0);
    assert_int_equal(image->light_count, 2);
    for (int i = 0; i < 2; i++) {
        const double *d = image->lights[i].direction;
        assert_false(image->lights[i].is_in_world);
        assert_nearly_equal(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1, 1e-15);
        assert_true(d[2] > 0); /* the light comes from the side of the eye */
    }
    assert_int_equal(image->outputs[0].format, SCENE_PNG8);
    scene_free(&s);
}

/* Checks the integration method that follows from the sampling keys of a scene and its number of volumes. */
static void sampling_method_follows_the_keys(void **state)
{
    (void)state;
    static const struct {
        const char *sampling;
        int volumes;
        scene_sampling_method method;
        double max_error;
    } cases[] = {
        {"{}", 1, SCENE_SEGMENTS, 0.01},
        {"{}", 0, SCENE_SAMPLES, 0},
        {"{}", 2, SCENE_SAMPLES, 0},
        {"{}", 4, SCENE_SAMPLES, 0},
        {"{method: samples}", 1, SCENE_SAMPLES, 0},
        {"{method: segments}", 1, SCENE_SEGMENTS, 0},
        {"{method: segments}", 2, SCENE_SEGMENTS, 0},
        {"{method: segments, max_error: 1e-3}", 1, SCENE_SEGMENTS, 1e-3},
        {"{max_error: 1e-3}", 1, SCENE_SEGMENTS, 1e-3},
        {"{max_error: 1e-3}", 2, SCENE_SEGMENTS, 1e-3},
        {"{max_error: 1e-3, frames: 4, jitter: false}", 1, SCENE_SEGMENTS, 1e-3},
        {"{method: segments, step_cells: 0.25}", 1, SCENE_SEGMENTS, 0},
        {"{step: 0.1}", 1, SCENE_SAMPLES, 0},
        {"{step_cells: 0.25}", 1, SCENE_SAMPLES, 0},
        {"{jitter: true}", 1, SCENE_SAMPLES, 0},
        {"{frames: 1}", 1, SCENE_SAMPLES, 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char text[512] = "images:\n- name: a\n  layers:\n  - isosurface: {field: p, values: [1]}\n";
        scene s;
        for (int k = 0; k < cases[i].volumes; k++) strcat(text, "  - volume: {field: p}\n");
        snprintf(text + strlen(text), sizeof text - strlen(text), "  sampling: %s\n  outputs: [{path: a.png}]\n",
                 cases[i].sampling);
        parse_valid_scene(text, &s);
        const scene_image *image = &s.images[0];
        if (image->method != cases[i].method || image->max_error != cases[i].max_error)
            fprintf(stderr, "%s, %d volumes: method %d, max_error %g\n", cases[i].sampling, cases[i].volumes,
                    (int)image->method, image->max_error);
        assert_true(image->method == cases[i].method && image->max_error == cases[i].max_error);
        scene_free(&s);
    }
}

static void clips_are_read_for_images_and_layers(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(every_key, &s);
    const scene_image *image = &s.images[0];
    const scene_clip *clips = image->clips;
    assert_int_equal(image->clip_count, 4);
    assert_true(image->clips_of_all == 3);
    assert_true(clips[0].kind == SCENE_CLIP_PLANE && !clips[0].is_outside);
    check_vector(clips[0].plane.normal, 0, 0, -1);
    check_vector(clips[0].plane.point, 1, 2, 3);
    assert_true(clips[1].kind == SCENE_CLIP_BOX && !clips[1].is_outside);
    check_vector(clips[1].lower, 0, 0, 0);
    check_vector(clips[1].upper, 1, 2, 3);
    assert_true(clips[2].kind == SCENE_CLIP_SPHERE && clips[2].is_outside && clips[2].radius == 2.5);
    check_vector(clips[2].centre, 1, -2, 3);
    assert_true(clips[3].kind == SCENE_CLIP_BOX && !clips[3].is_outside);
    assert_true(image->isosurfaces[0].clips == 3 && image->isosurfaces[1].clips == 7);
    assert_true(image->volumes[0].clips == 7); /* identical spheres are stored one time */
    assert_true(image->slices[0].clips == 11);
    assert_true(image->surfaces[0].clips == 3); /* the box of the image clips all layers */
    assert_int_equal(s.images[1].clip_count, 0);
    scene_free(&s);
}

static void statistics_and_conditions_are_read(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(every_key, &s);
    assert_int_equal(s.statistics_count, 3);
    const scene_statistics *first = s.statistics;
    assert_string_equal(first->field.name, "p");
    assert_string_equal(first->path, "out/p.csv");
    assert_true(first->field.component == 0 && first->field.mesh_count == 1 && first->cycle_interval == 3);
    assert_true(first->bin_count == 8 && first->low == -1 && first->high == 1);
    assert_true(first[1].bin_count == 32 && first[1].low > first[1].high && first[1].cycle_interval == 1);
    assert_true(first[2].bin_count == 0);
    const scene_condition *when = &s.images[1].condition;
    assert_true(s.images[1].is_drawn_once && !s.images[0].is_drawn_once && !s.images[0].condition.is_given);
    assert_true(when->is_given && when->statistic == SCENE_MEAN && when->above == 1 && when->below == 2.5);
    assert_true(when->field.component == 2 && when->field.mesh_count == 2);
    scene_free(&s);
}

/* Checks that the key `meshes` maps each mesh's name to its warp. */
static void warps_are_read_per_mesh(void **state)
{
    (void)state;
    static const scene_warp expected[] = {
        {"plate", "DISPL", -2.5, 0, 0}, {"plate/a.b", "w", 1, 0, 0}, {"colour", "u", 0, 0, 0}};
    scene s;
    parse_valid_scene(every_key, &s);
    assert_int_equal(s.warp_count, 3);
    for (int i = 0; i < 3; i++) {
        const scene_warp *warp = &s.warps[i];
        assert_string_equal(warp->mesh, expected[i].mesh);
        assert_string_equal(warp->field, expected[i].field);
        assert_true(fabs(warp->scale - expected[i].scale) <= 0);
        assert_int_equal(warp->line, s.warps[0].line + i);
        assert_int_equal(warp->field_line, warp->line);
    }
    assert_ptr_equal(scene_find_warp(&s, "plate"), &s.warps[0]);
    assert_ptr_equal(scene_find_warp(&s, "plate/a"), &s.warps[0]);
    assert_ptr_equal(scene_find_warp(&s, "plate/a.b/c"), &s.warps[1]);
    assert_null(scene_find_warp(&s, "plates"));
    scene_free(&s);
    parse_valid_scene(fewest_keys, &s);
    assert_int_equal(s.warp_count, 0);
    scene_free(&s);
}

static void mirrors_are_read_per_mesh(void **state)
{
    (void)state;
    static const scene_mirror expected[] = {
        {"colour", 5, {0, 0, 0}, 0}, {"axis", 2, {0, 0, 0}, 0}, {"axis/b", 5, {-1.5, 0, 2}, 0}};
    scene s;
    parse_valid_scene(every_key, &s);
    assert_int_equal(s.mirror_count, 3);
    for (int i = 0; i < 3; i++) {
        const scene_mirror *mirror = &s.mirrors[i];
        assert_string_equal(mirror->mesh, expected[i].mesh);
        assert_int_equal(mirror->axes, expected[i].axes);
        for (int axis = 0; axis < 3; axis++) assert_true(fabs(mirror->planes[axis] - expected[i].planes[axis]) <= 0);
        assert_int_equal(mirror->line, s.warps[2].line + i);
    }
    assert_ptr_equal(scene_find_mirror(&s, "axis/a"), &s.mirrors[1]);
    assert_ptr_equal(scene_find_mirror(&s, "axis/b"), &s.mirrors[2]);
    assert_null(scene_find_mirror(&s, "plate"));
    scene_free(&s);
    parse_valid_scene(fewest_keys, &s);
    assert_int_equal(s.mirror_count, 0);
    scene_free(&s);
}

/* Checks parameters, which are addressed by their names. The scene defines these names, so they have no short forms and
 * no alternative spellings. */
static void parameters_are_read_by_their_names(void **state)
{
    (void)state;
    static const scene_parameter expected[] = {
        {"inflow", 2.5}, {"_k-2", -1e-3}, {"values", 3}, {"color", 4}, {"axis", 5}};
    scene s;
    parse_valid_scene(every_key, &s);
    assert_int_equal(s.parameter_count, 5);
    for (int i = 0; i < 5; i++) {
        assert_string_equal(s.parameters[i].name, expected[i].name);
        assert_ptr_equal(scene_find_parameter(&s, expected[i].name), &s.parameters[i]);
        assert_true(fabs(s.parameters[i].value - expected[i].value) <= 0);
    }
    assert_null(scene_find_parameter(&s, "colour"));
    scene_free(&s);
    parse_valid_scene(fewest_keys, &s);
    assert_int_equal(s.parameter_count, 0);
    scene_free(&s);
}

static void surface_colours_are_read(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(every_key, &s);
    assert_int_equal(s.images[0].surface_count, 3);
    const scene_surface *surface = s.images[0].surfaces;
    check_colour(surface[0].colour, convert_srgb_to_linear(1), convert_srgb_to_linear(0.5), convert_srgb_to_linear(0));
    assert_true(surface[0].opacity == 0.5F && !surface[0].has_colour_by && !surface[0].meshes_field.name);
    const scene_threshold *threshold = &surface[1].threshold;
    assert_false(surface[0].threshold.is_given);
    assert_true(threshold->is_given && threshold->low == 1 && threshold->high == 2.5);
    assert_string_equal(threshold->field.name, "q");
    assert_true(threshold->field.component == 1 && !threshold->field.at_vertices);
    assert_true(surface[2].threshold.low == -3 && isinf(surface[2].threshold.high));
    assert_true(surface[0].edge_width == 2 && surface[1].edge_width >= 1);
    check_colour(surface[0].edge_colour, convert_srgb_to_linear(0), convert_srgb_to_linear(0.5),
                 convert_srgb_to_linear(1));
    check_colour(surface[1].edge_colour, convert_srgb_to_linear(0.1), convert_srgb_to_linear(0.1),
                 convert_srgb_to_linear(0.1));
    assert_true(surface[0].meshes_field.mesh_count == 2 && scene_field_selects_mesh(&surface[0].meshes_field, "sea/3"));
    assert_false(scene_field_selects_mesh(&surface[0].meshes_field, "seaside"));
    assert_true(surface[1].opacity == 1 && surface[1].has_colour_by && surface[1].colour_by.at_vertices);
    assert_true(scene_field_selects_mesh(&surface[1].meshes_field, "any"));
    assert_string_equal(surface[1].colour_by.name, "q");
    check_built_in_colour_map(&surface[1].colour_map, "grey");
    check_colour(surface[1].colour, convert_srgb_to_linear(0.8), convert_srgb_to_linear(0.8),
                 convert_srgb_to_linear(0.8));
    assert_true(surface[1].material.diffuse == 0.75F);
    scene_free(&s);
}

/* Checks list entries that define several planes: by offsets, or spread evenly over the data. */
static void several_planes_are_read(void **state)
{
    (void)state;
    static const double offsets[] = {-1, 0.5, 2}, shares[] = {-0.75, -0.25, 0.25, 0.75};
    scene s;
    parse_valid_scene(
        "images:\n"
        "- name: a\n"
        "  layers:\n"
        "  - slice: {field: p, planes: [{normal: x, point: [1, 2, 3], offsets: [-1, 0.5, 2]}, {normal: -z, "
        "count: 4}]}\n"
        "  - slice: {field: p, planes: {normal: y, count: 1}}\n",
        &s);
    const scene_slice *slice = s.images[0].slices;
    assert_int_equal(slice[0].plane_count, 7);
    for (int i = 0; i < 7; i++) {
        const scene_plane *plane = &slice[0].planes[i];
        check_vector(plane->normal, i < 3, 0, i < 3 ? 0 : -1);
        assert_true(plane->has_point == (i < 3) && fabs(plane->offset - (i < 3 ? offsets[i] : 0)) <= 0);
        /* multiples of a quarter are exact */
        assert_true(fabs(plane->extent_fraction - (i < 3 ? 0 : shares[i - 3])) <= 0);
    }
    assert_true(slice[1].plane_count == 1 && slice[1].planes[0].extent_fraction == 0);
    scene_free(&s);
}

/* Checks that normals of any length are normalized, including those with components whose squares underflow or
 * overflow. */
static void slices_have_planes_of_unit_normals(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(
        "images:\n- name: a\n  layers:\n"
        "  - slice: {field: p, planes: [{normal: [3e200, 0, 4e200]}, {normal: [0, -1e-200, 0], point: [1, 2, 3],\n"
        "            offset: -2}]}\n"
        "  - slice: {field: q, component: x, interpolate: vertex, mesh: air, map: plasma, range: [0, 2],\n"
        "            opacity: 0.5, planes: [{normal: [1, 0, 0]}], material: {specular: 0}}\n"
        "  outputs: [{path: a.png}]\n",
        &s);
    assert_int_equal(s.images[0].slice_count, 2);
    const scene_slice *slice = s.images[0].slices;
    assert_int_equal(slice[0].plane_count, 2);
    check_vector(slice[0].planes[0].normal, 0.6, 0, 0.8);
    assert_true(!slice[0].planes[0].has_point && slice[0].planes[0].offset == 0);
    check_vector(slice[0].planes[1].normal, 0, -1, 0);
    check_vector(slice[0].planes[1].point, 1, 2, 3);
    assert_true(slice[0].planes[1].has_point && slice[0].planes[1].offset == -2);
    check_built_in_colour_map(&slice[0].colour_map, "viridis");
    assert_true(slice[0].opacity == 1 && !slice[0].colour_map.range.is_fixed && !slice[0].field.at_vertices);
    assert_true(slice[0].material.ambient == 1 && slice[0].material.diffuse == 0 && slice[0].material.specular == 0);
    check_built_in_colour_map(&slice[1].colour_map, "plasma");
    assert_true(slice[1].opacity == 0.5F && slice[1].colour_map.range.high == 2 && slice[1].field.at_vertices);
    assert_true(slice[1].field.component == 0 && slice[1].field.mesh_count == 1);
    assert_true(slice[1].material.diffuse == 0.75F && slice[1].material.specular == 0);
    scene_free(&s);
}

static void contour_lines_use_the_colour_field(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(
        "images:\n- name: a\n  size: [40, 1200]\n  sweep: {fields: [w]}\n  layers:\n"
        "  - slice: {field: p, component: y, mesh: air, lines: {count: 7}}\n"
        "  - isosurface: {field: q, values: [1], lines: {field: r, component: x, values: [3, -1, 2], width: 4,\n"
        "                 colour: white}}\n"
        "  - surface: {colour_by: {field: p}, lines: {values: 5}}\n"
        "  - slice: {field: p}\n"
        "  outputs: [{path: a.png}]\n",
        &s);
    const scene_lines *slice = &s.images[0].slices[0].lines, *iso = &s.images[0].isosurfaces[0].lines;
    const scene_lines *outer = &s.images[0].surfaces[0].lines;
    assert_true(slice->is_given && slice->is_of_colours && !slice->has_values && slice->count == 7);
    assert_string_equal(slice->field.name, "w"); /* the field set by the sweep */
    assert_true(slice->field.component == 1 && slice->field.mesh_count == 1 && slice->field.at_vertices);
    /* 0.1 in sRGB, converted to linear light */
    assert_true(slice->width == 2 && fabsf(slice->colours[20] - 0.0100228F) < 1e-6F);
    assert_true(!iso->is_of_colours && iso->has_values && iso->count == 3 && iso->width == 4);
    assert_string_equal(iso->field.name, "r");
    assert_true(iso->values[0] == -1 && iso->values[1] == 2 && iso->values[2] == 3 && iso->field.component == 0);
    assert_true(iso->colours[0] == 1 && iso->colours[8] == 1);
    assert_true(outer->is_of_colours && outer->count == 1 && outer->values[0] == 5);
    assert_false(s.images[0].slices[1].lines.is_given);
    scene_free(&s);
}

static void scene_layer_defaults_hold(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(fewest_keys, &s);
    const scene_isosurface *surface = &s.images[0].isosurfaces[0];
    assert_int_equal(surface->field.component, SCENE_COMPONENT_DEFAULT);
    assert_true(surface->opacity == 1);
    assert_true(surface->material.ambient == 0.15F && surface->material.diffuse == 0.75F);
    assert_true(surface->material.specular == 0.25F && surface->material.shininess == 32);
    check_built_in_colour_map(&surface[1].colour_map, "viridis");
    assert_false(surface[1].colour_map.range.is_fixed);
    assert_memory_not_equal(surface[0].colours, surface[0].colours + 3, 3 * sizeof(float));
    assert_memory_not_equal(surface[0].colours, surface[1].colours, 3 * sizeof(float));
    const scene_volume *volume = &s.images[0].volumes[0];
    check_built_in_colour_map(&volume->colour_map, "viridis");
    assert_false(volume->colour_map.range.is_fixed);
    assert_true(volume->unit_distance == 0 && volume->opacity_count == 2);
    assert_true(volume->opacity[0].position == 0 && volume->opacity[0].opacity == 0);
    assert_true(volume->opacity[1].position == 1 && volume->opacity[1].opacity == 0.9F);
    scene_free(&s);
}

static void scene_up_defaults_to_z_for_views_along_y(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(
        "images: [{name: a, camera: {automatic: {direction: [0, -2, 0]}}, layers: [{volume: {field: p}}], "
        "outputs: [{path: a.png}]}]",
        &s);
    check_vector(s.images[0].camera.up, 0, 0, 1);
    scene_free(&s);
}

static void check_example(const char *folder, const char *name)
{
    static char text[SCENE_MAX_BYTES];
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    const size_t size = fread(text, 1, sizeof text, file);
    fclose(file);
    scene s;
    base_error error = {.status = INSITU_OK};
    if (scene_parse(text, size, path, NULL, &s, &error) != INSITU_OK) fail_msg("%s", error.message);
    scene_free(&s);
}

static void scene_examples_are_valid(void **state)
{
    const char *folder = *state;
    if (!folder) skip();
    DIR *listing = opendir(folder);
    assert_non_null(listing);
    int count = 0;
    for (const struct dirent *entry; (entry = readdir(listing));) {
        const char *ending = strrchr(entry->d_name, '.');
        if (!ending || strcmp(ending, ".yaml") != 0) continue;
        check_example(folder, entry->d_name);
        count++;
    }
    closedir(listing);
    assert_true(count > 0);
}

/* ---- invalid files ---- */

static const char *const good_lines[] = {
    /* line 1 */ "threads: 1",
    /* line 2 */ "images:",
    /* line 3 */ "  - name: a",
    /* line 4 */ "    size: [64, 48]",
    /* line 5 */ "    every: 2",
    /* line 6 */ "    camera: {position: [0, 0, 5], focal: [0, 0, 0]}",
    /* line 7 */ "    background: [1, 1, 1]",
    /* line 8 */ "    lights: [{direction: [0, 0, 1]}]",
    /* line 9 */ "    layers:",
    /* line 10 */ "      - isosurface: {field: f, values: [1, 2]}",
    /* line 11 */ "      - volume: {field: f}",
    /* line 12 */ "    sampling: {step: 0.5}",
    /* line 13 */ "    outputs:",
    /* line 14 */ "      - path: a.png",
    /* line 15 */ "  - name: b",
    /* line 16 */ "    layers: [{volume: {field: f}}]",
    /* line 17 */ "    outputs: [{path: b.exr}]",
};
enum { good_line_count = sizeof good_lines / sizeof *good_lines };

#define V "{volume: {field: f}}"
#define FIFTY                                                                                                          \
    "0,1,2,3,4,5,6,7,8,9,10,11,12,13,14,15,16,17,18,19,20,21,22,23,24,25,26,27,28,29,30,31,32,33,34,35,36,37,38,39,"   \
    "40,41,42,43,44,45,46,47,48,49"
#define AT_THE(keys) "{position: [0, 0, 5], focal: [0, 0, 0], " keys "}"
#define AT "{position: [0, 0, 5], focal: [0, 0, 0]}"

static const struct bad_file {
    int line; /* number of the line that is replaced, counted from 1 */
    const char *by;
    int reported; /* number of the line that the message must state */
    const char *words[3];
} bad_files[] = {
    {1,
     "thread: 1",
     1,
     {"the key \"thread\" is unknown",
      "threads, tree, schedule, writing, finer_pieces, surface_error, finer_memory, images"}},
    {1, "finer_pieces: 0", 1, {"finer_pieces: \"0\"", "from 1 to 12"}},
    {1, "finer_pieces: 13", 1, {"finer_pieces: \"13\"", "from 1 to 12"}},
    {1, "finer_pieces: fine", 1, {"finer_pieces: \"fine\"", "a whole number from 1 to 12"}},
    {1, "surface_error: 0", 1, {"surface_error: \"0\"", "above 0"}},
    {1, "surface_error: small", 1, {"surface_error: \"small\"", "a number above 0"}},
    {1, "surface_error: 1001", 1, {"surface_error: \"1001\"", "at most 1000"}},
    {1, "surface_error: 0.5\nfiner_memory: 0", 2, {"finer_memory: \"0\"", "above 0"}},
    {1, "surface_error: 0.5\nfiner_memory: 1e13", 2, {"finer_memory: \"1e13\"", "at most 1e+12"}},
    {1, "threads: many", 1, {"threads: \"many\"", "a whole number from 0 to 4096"}},
    {1, "threads: -1", 1, {"threads: \"-1\"", "from 0 to 4096"}},
    {1, "threads: 010", 1, {"threads: \"010\"", "a whole number"}},
    {1, "threads: 2.5", 1, {"threads: \"2.5\"", "a whole number"}},
    {1, "threads:", 1, {"threads: nothing", "a whole number"}},
    {1, "threads: [1]", 1, {"threads: a list", "a whole number"}},
    {1, "threads: &t 1", 1, {"an anchor (&)"}},
    {1, "threads: *t", 1, {"an alias (*)"}},
    {1, "threads: !!int 1", 1, {"a tag (!)"}},
    {1, "threads: 1\nthreads: 2", 2, {"the key \"threads\" is given twice"}},
    {1, "threads: 1\n---", 2, {"a second document"}},
    {1, "threads: \"1", 1, {"the text \"1 has no end", "expected \" at its end"}},
    {1, "[[[[[[[[[[[[[[[[[[[[ ", 1, {"too deep", "16"}},
    {1, "threads: \x01", 1, {"not valid YAML", "control characters"}},
    {2, "pictures:", 2, {"the key \"pictures\" is unknown"}},
    {3,
     "  - title: a",
     3,
     {"images[0]: the key \"title\" is unknown", "name, size, every, every_time, when, once, camera"}},
    {3, "  - every: 3\n    name: a", 6, {"images[0]: the key \"every\" is given twice"}},
    {3, "  - threads: 1", 3, {"the key \"threads\" is unknown"}},
    {3, "  - [a]: b", 3, {"the key a list is unknown"}},
    {3, "  - name: b", 15, {"images[1].name: \"b\" is the name of the image in line 3"}},
    {3, "  - name: a/b", 3, {"images[0].name: \"a/b\"", "without"}},
    {3, "  - name: [a]", 3, {"images[0].name: a list", "a text of 1 to 64 bytes"}},
    {3, "  - name: \"\\e[1m/\"", 3, {"images[0].name: \"\\x1b[1m/\"", "without"}},
    {4, "    size: \"\\a\"", 4, {"images[0].size: \"\\x07\""}},
    {3, "  - name: \"a\\0b\"", 3, {"images[0].name: ", "a text"}},
    {4, "    size: 64", 4, {"images[0].size: \"64\"", "a list of 2 whole numbers from 1 to 32768"}},
    {4, "    size: [64]", 4, {"images[0].size: a list of 1", "a list of 2"}},
    {4, "    size: [0, 48]", 4, {"images[0].size[0]: \"0\"", "from 1 to 32768"}},
    {4, "    size: [64,\n      32769]", 5, {"images[0].size[1]: \"32769\""}},
    {4, "    size: [64, 99999999999999999999]", 4, {"images[0].size[1]"}},
    {5, "    every: 0", 5, {"images[0].every: \"0\"", "from 1"}},
    {6, "    camera: [0, 0, 5]", 6, {"images[0].camera: a list", "a mapping with the keys position, focal"}},
    {6, "    camera: {position: [0, 0, 5]}", 6, {"images[0].camera.focal: missing"}},
    {6, "    camera: {focal: [0, 0, 5]}", 6, {"images[0].camera.position: missing"}},
    {6, "    camera: {position: [1, 1, 1], focal: [1, 1, 1]}", 6, {"camera.focal: [1, 1, 1] is the position too"}},
    {6, "    camera: {position: [0, 5, 0], focal: [0, 0, 0], up: [0, 1, 0]}", 6, {"camera.up", "parallel to the view"}},
    {6, "    camera: {position: [0, 5, 0], focal: [0, 0, 0], up: [0, 0, 0]}", 6, {"camera.up: has length 0"}},
    {6, "    camera: {position: [0, 5, 0], focal: [0, 0, 0], automatic: {}}", 6, {"camera.automatic: given beside"}},
    {6, "    camera: {position: [1e308, 0, 0], focal: [-1e308, 0, 0]}", 6, {"camera.position: too far from focal"}},
    {6, "    camera: {automatic: {direction: [0, 0, 0]}}", 6, {"camera.automatic.direction: has length 0"}},
    {5, "    every_time: 0", 5, {"every_time: \"0\"", "above 0"}},
    {5, "    every: 2\n    every_time: 1", 6, {"every_time: given beside every"}},
    {10, "      - surface: {edges: {width: 0}}", 10, {"layers[0].surface.edges.width: \"0\"", "0.5 to 100"}},
    {10, "      - surface: {edges: {colour: [0, 0, 2]}}", 10, {"surface.edges.colour[2]: \"2\"", "from 0 to 1"}},
    {10, "      - surface: {threshold: {field: f}}", 10, {"layers[0].surface.threshold: has no bounds", "from, to"}},
    {10, "      - surface: {threshold: {from: 1}}", 10, {"surface.threshold.field: missing"}},
    {10, "      - surface: {threshold: {field: f, from: 2, to: 1}}", 10, {"threshold.to: is 1", "no less than from"}},
    {10, "      - surface: {threshold: {field: f, from: nan}}", 10, {"threshold.from: \"nan\"", "a number"}},
    {1, "statistics: [{field: f}]", 1, {"statistics[0].path: missing"}},
    {1, "statistics: [{path: a.csv}]", 1, {"statistics[0].field: missing"}},
    {1, "statistics: [{field: f, path: a.txt}]", 1, {"statistics[0].path: \"a.txt\"", "expected .csv"}},
    {1, "statistics: [{field: f, path: a.csv}, {field: g, path: a.csv}]", 1, {"statistics[1].path", "another one's"}},
    {1, "statistics: [{field: f, path: a.csv, every: 0}]", 1, {"statistics[0].every: \"0\"", "1 to"}},
    {1, "statistics: [{field: f, path: a.csv, histogram: {bins: 300}}]", 1, {"histogram.bins: \"300\"", "1 to 256"}},
    {1, "statistics: [{field: f, path: a.csv, histogram: {range: [2, 2]}}]", 1, {"histogram.range: goes from 2"}},
    {1, "meshes: 7", 1, {"meshes: \"7\" is not allowed", "a mapping from names to these"}},
    {1, "meshes: {}", 1, {"meshes: a list of 0 is not allowed", "1 to 64"}},
    {1, "meshes: {a: u}", 1, {"meshes[0]: \"u\" is not allowed", "a mapping with the keys name, warp, mirror"}},
    {1, "meshes: {a: {}}", 1, {"meshes.a: holds nothing, expected warp or mirror"}},
    {1,
     "meshes: {a: {mirror: w}}",
     1,
     {"meshes.a.mirror: \"w\" is not allowed", "one of x, y, z; or a list of 1 to 3"}},
    {1, "meshes: {a: {mirror: }}", 1, {"meshes.a.mirror: nothing is not allowed", "a mapping with the keys x, y, z"}},
    {1, "meshes: {a: {mirror: 0}}", 1, {"meshes.a.mirror: \"0\" is not allowed", "one of x, y, z"}},
    {1, "meshes: {a: {mirror: []}}", 1, {"meshes.a.mirror: a list of 0", "a list of 1 to 3, each one of x, y, z"}},
    {1, "meshes: {a: {mirror: [x, -y]}}", 1, {"meshes.a.mirror[1]: \"-y\" is not allowed", "one of x, y, z"}},
    {1, "meshes: {a: {mirror: [x, y, x]}}", 1, {"meshes.a.mirror: x is given twice"}},
    {1, "meshes: {a: {mirror: {}}}", 1, {"meshes.a.mirror: holds nothing", "the coordinate of a plane"}},
    {1, "meshes: {a: {mirror: {w: 1}}}", 1, {"meshes.a.mirror: the key \"w\" is unknown", "x, y, z"}},
    {1, "meshes: {a: {mirror: {x: left}}}", 1, {"meshes.a.mirror.x: \"left\"", "a number"}},
    {1, "meshes: {a: {reflect: x}}", 1, {"meshes.a: the key \"reflect\" is unknown (did you mean mirror?)"}},
    {1, "meshes: {a: {warp: }}", 1, {"meshes.a.warp: nothing is not allowed", "a field's name"}},
    {1, "meshes: {a: {warp: [u, v]}}", 1, {"meshes.a.warp: a list is not allowed", "a mapping"}},
    {1, "meshes: {a: {warp: {scale: 2}}}", 1, {"meshes.a.warp.field: missing", "a text"}},
    {1, "meshes: {a: {warp: {field: u, scale: big}}}", 1, {"meshes.a.warp.scale: \"big\"", "a number"}},
    {1, "meshes: {a: {warp: {field: u, scale: 1e31}}}", 1, {"meshes.a.warp.scale: \"1e31\"", "to 1e+30"}},
    {1, "meshes: {a: {warp: {field: u, factor: 2}}}", 1, {"the key \"factor\" is unknown (did you mean scale?)"}},
    {1, "meshes: {a: {warp: {field: u, offset: 2}}}", 1, {"meshes.a.warp: the key \"offset\"", "field, scale"}},
    {1, "meshes: {a: {displacement: u}}", 1, {"meshes.a: the key \"displacement\" is unknown (did you mean warp?)"}},
    {1, "meshes: {a: {warp: u}, b: {warp: u}, a: {warp: v}}", 1, {"meshes.a: the name is given twice"}},
    {1, "meshes: {a.b: {warp: u}, \"a.b\": {warp: v}}", 1, {"meshes[1]: the name is given twice"}},
    {1, "mesh: {a: {warp: u}}", 1, {"\"mesh\" is unknown (did you mean meshes?)"}},
    {5, "    meshes: {a: {warp: u}}", 5, {"the key \"meshes\" is unknown", "stands at the top of the file"}},
    {1, "parameters: {a: 1, inflow: fast}", 1, {"parameters.inflow: \"fast\" is not allowed, expected a number"}},
    {1, "parameters: {inflow: }", 1, {"parameters.inflow: nothing is not allowed", "a number"}},
    {1, "parameters: {inflow: [1]}", 1, {"parameters.inflow: a list", "a number"}},
    {1, "parameters: {inflow: nan}", 1, {"parameters.inflow: \"nan\"", "a number"}},
    {1, "parameters: {inflow: 1, a: 2, inflow: 3}", 1, {"parameters: the name \"inflow\" is given twice"}},
    {1, "parameters: {a.b: 1}", 1, {"parameters: the name \"a.b\" is not allowed", "a letter or _"}},
    {1, "parameters: {2a: 1}", 1, {"parameters: the name \"2a\" is not allowed"}},
    {1, "parameters: {\"\": 1}", 1, {"parameters: the name nothing is not allowed"}},
    {1, "parameters: {[a]: 1}", 1, {"parameters: the name a list is not allowed"}},
    {1, "parameters: {aaaaaaaaaabbbbbbbbbbccccccccccddddddddddeeeeeeeeeeffffffffff1234: 1}", 1, {"at most 63 bytes"}},
    {1, "parameters: [1, 2]", 1, {"parameters: a list is not allowed", "names of your own, each with a number"}},
    {1, "parameters: 7", 1, {"parameters: \"7\" is not allowed"}},
    {1, "parameter: {a: 1}", 1, {"\"parameter\" is unknown (did you mean parameters?)"}},
    {5, "    when: {field: f}", 5, {"images[0].when: has no bound", "above, below"}},
    {5, "    when: {above: 1}", 5, {"images[0].when.field: missing"}},
    {5, "    when: {field: f, above: 2, below: 1}", 5, {"when.below: is 1", "more than above"}},
    {5, "    when: {field: f, of: median, above: 1}", 5, {"when.of: \"median\"", "minimum, maximum, mean"}},
    {5, "    once: 1", 5, {"images[0].once: \"1\"", "true or false"}},
    {10, "      - surface: {edges: yes}", 10, {"surface.edges: \"yes\"", "a mapping"}},
    {6, "    antialias: 3", 6, {"antialias: is 3", "1, 2, 4, 8 or 16"}},
    {6, "    antialias: 32", 6, {"antialias: \"32\"", "from 1 to 16"}},
    {6, "    camera: {automatic: {fit: data}}", 6, {"camera.automatic.fit: \"data\"", "one of sphere, box"}},
    {6,
     "    camera: {automatic: {bounds: [[0, 0, 0], [1, -1, 1]]}}",
     6,
     {"automatic.bounds: goes from 0 to -1 along y"}},
    {6, "    camera: {automatic: {bounds: [0, 0, 0]}}", 6, {"automatic.bounds", "expected a list of 2"}},
    {6, "    camera: {projection: flat}", 6, {"camera.projection: \"flat\"", "perspective, orthographic"}},
    {6, "    camera: {height: 3}", 6, {"camera.height: given without projection: orthographic"}},
    {6, "    camera: {projection: orthographic, height: 0}", 6, {"camera.height: \"0\"", "above 0"}},
    {6, "    camera: {automatic: {zoom: 0}}", 6, {"camera.automatic.zoom: \"0\"", "from 0.0001 to 1000"}},
    {6, "    camera: {automatic: {zoom: 1e-300}}", 6, {"camera.automatic.zoom: \"1e-300\"", "from 0.0001 to 1000"}},
    {6, "    camera: {angle: 0}", 6, {"camera.angle: \"0\"", "from 1e-06 and below 180"}},
    {6, "    camera: {angle: 1e-300}", 6, {"camera.angle: \"1e-300\"", "from 1e-06 and below 180"}},
    {6, "    camera: {angle: 180}", 6, {"camera.angle: \"180\"", "from 1e-06 and below 180"}},
    {6, "    camera: {angle: nan}", 6, {"camera.angle: \"nan\"", "a number"}},
    {6, "    camera: {position: [0, 0, inf], focal: [0, 0, 0]}", 6, {"camera.position[2]: \"inf\"", "a number"}},
    {6, "    camera: {position: [0, 0, 1e999], focal: [0, 0, 0]}", 6, {"camera.position[2]: \"1e999\""}},
    {6, "    camera: {position: [0, 0, 0x5], focal: [0, 0, 0]}", 6, {"camera.position[2]: \"0x5\""}},
    {6, "    camera: {position: [0, 0, 5 m], focal: [0, 0, 0]}", 6, {"camera.position[2]: \"5 m\""}},
    {7, "    background: [1, 1]", 7, {"background: a list of 2", "a list of 3 to 4 numbers from 0 to 1"}},
    {7, "    background: [1, 1, 255]", 7, {"background[2]: \"255\"", "from 0 to 1"}},
    {7, "    background: wite", 7, {"background: \"wite\"", "a list"}},
    {8, "    lights: []", 8, {"lights: a list of 0", "a list of 1 to 8 mappings"}},
    {8, "    lights: [{colour: [1, 1, 1]}]", 8, {"lights[0].direction: missing", "a list of 3 numbers"}},
    {8, "    lights:\n      - {direction: [0, 0, 1]}\n      - {direction: [0, 0, 0]}", 10, {"lights[1].direction"}},
    {8, "    lights: [{direction: [0, 0, 1], in: sky}]", 8, {"lights[0].in: \"sky\"", "one of camera, world"}},
    {8, "    lights: [{direction: [0, 0, 1], shadows: false}]", 8, {"lights[0].shadows: given without shadows"}},
    {8, "    shadows: maybe", 8, {"shadows: \"maybe\"", "true or false"}},
    {8, "    ambient_occlusion: {samples: 0}", 8, {"ambient_occlusion.samples: \"0\"", "from 1 to 64"}},
    {8, "    ambient_occlusion: {samples: 65}", 8, {"ambient_occlusion.samples: \"65\"", "from 1 to 64"}},
    {8, "    ambient_occlusion: {radius: 0}", 8, {"ambient_occlusion.radius: \"0\"", "above 0 and at most 1e+30"}},
    {8, "    lights: [{direction: [0, 0, 1], intensity: -1}]", 8, {"lights[0].intensity: \"-1\"", "from 0 to 100"}},
    {9, "    layers: []\n    layer:", 9, {"images[0].layers: a list of 0", "1 to 20 mappings"}},
    {10, "      - isosurface: {field: f}", 10, {"isosurface.values: missing", "a list of 1 to 64 numbers"}},
    {10, "      - isosurface: {values: [1]}", 10, {"layers[0].isosurface.field: missing", "a text"}},
    {10, "      - isosurface: {field: f, values: []}", 10, {"isosurface.values: a list of 0"}},
    {10, "      - isosurface: {field: f, values: one}", 10, {"isosurface.values: \"one\"", "a list"}},
    {10, "      - isosurface: {field: f, values: [1,\n        2, 1]}", 11, {"values[2]: 1 is there twice"}},
    {10,
     "      - isosurface: {field: f, values: [" FIFTY ",50,51]}\n"
     "      - isosurface: {field: f, values: [0,1,2,3,4,5,6,7,8,9,10,11,12]}",
     11,
     {"layers[1]: 65 isovalues", "at most 64"}},
    {10,
     "      - isosurface: {field: f, values: [" FIFTY ",50,51,52,53,54,55,56,57,58,59,60,61,62,63,64]}",
     10,
     {"a list of 65"}},
    {10, "      - isosurface: {field: f, values: [1], colours: [[1,0,0],[0,1,0]]}", 10, {"2 colours for 1 values"}},
    {10, "      - isosurface: {field: f, values: [1], colours: [[1,0]]}", 10, {"colours[0]: a list of 2", "of 3"}},
    {10, "      - isosurface: {field: f, values: [1], colours: [[1,0,2]]}", 10, {"colours[0][2]: \"2\"", "0 to 1"}},
    {10, "      - isosurface: {field: f, values: [1], colours: [[1,0,0]], colour_by: {field: g}}", 10, {"colour_by"}},
    {10,
     "      - isosurface: {field: f, values: [1], colour_by: {field: g, map: jet}}",
     10,
     {"\"jet\"", "viridis, plasma, inferno"}},
    {10, "      - isosurface: {field: f, values: [1], colour_by: {field: g, range: [1, 1]}}", 10, {"does not rise"}},
    {10, "      - isosurface: {field: f, values: [1], component: w}", 10, {"component: \"w\"", "magnitude, x, y, z"}},
    {10, "      - isosurface: {field: f, values: [1], component: -1}", 10, {"component: \"-1\"", "magnitude"}},
    {10, "      - isosurface: {field: f, values: [1], opacity: 1.5}", 10, {"opacity: \"1.5\"", "from 0 to 1"}},
    {10,
     "      - isosurface: {field: f, values: [1], root_steps: 2}",
     10,
     {"the key \"root_steps\" is gone", "polished"}},
    {10,
     "      - isosurface: {field: f, values: [1], roots: robust}",
     10,
     {"the key \"roots\" is gone", "no crossing"}},
    {10, "      - isosurface: {field: f, values: [1], difference: 0}", 10, {"difference: \"0\"", "above 0"}},
    {10, "      - isosurface: {field: f, values: [1], material: {shine: 1}}", 10, {"material: the key \"shine\""}},
    {10, "      - isosurface: {field: f, values: [1], material: {shininess: 0}}", 10, {"material.shininess: \"0\""}},
    {10, "      - isosurface: {field: f, values: [1], mesh: }", 10, {"isosurface.mesh: nothing", "a text of 1 to 255"}},
    {10, "      - isosurface: {field: f, values: [1], mesh: []}", 10, {"mesh: a list", "a list of 1 to 64 of them"}},
    {11, "      - volume: {field: f, mesh: [a, [b]]}", 11, {"volume.mesh[1]: a list", "a text of 1 to 255"}},
    {11, "      - volume: {field: f, mesh: {a: b}}", 11, {"volume.mesh: a mapping", "a list of 1 to 64 of them"}},
    {10, "      - isosurface: {field: f, values: [1], interpolate: cell}", 10, {"interpolate: cell is not", "vertex"}},
    {11, "      - volume: {field: f, interpolate: face}", 11, {"interpolate: \"face\"", "one of cell, vertex"}},
    {11, "      - {}", 11, {"layers[1]: holds nothing", "isosurface, volume, slice and surface"}},
    {11, "      - {isosurface: {field: f, values: [1]}, volume: {field: f}}", 11, {"layers[1]: holds more than one"}},
    {8, "    clip: {}", 8, {"images[0].clip: holds nothing", "planes, a box or a sphere"}},
    {8, "    clip: {planes: []}", 8, {"clip.planes: a list of 0", "1 to 10"}},
    {8, "    clip: {planes: [{normal: [0, 0, 0]}]}", 8, {"clip.planes[0].normal: [0, 0, 0]", "any length but 0"}},
    {8, "    clip: {box: [[0, 0, 0]]}", 8, {"clip.box: a list of 1", "a list of 2"}},
    {8, "    clip: {box: [[0, 0, 0], [1, 0, 1]]}", 8, {"clip.box: from 0 to 0 along y", "first corner to be less"}},
    {8, "    clip: {cone: 1}", 8, {"clip: the key \"cone\" is unknown", "planes, box, sphere, keep"}},
    {8, "    clip: {sphere: 1}", 8, {"clip.sphere: \"1\"", "a mapping"}},
    {8, "    clip: {sphere: {radius: 1}}", 8, {"clip.sphere.centre: missing", "a list of 3 numbers"}},
    {8, "    clip: {sphere: {centre: [0, 0, 0], radius: 0}}", 8, {"clip.sphere.radius: \"0\"", "above 0"}},
    {8, "    clip: {keep: outside}", 8, {"images[0].clip: holds nothing", "planes, a box or a sphere"}},
    {8, "    clip: {planes: [{normal: [1, 0, 0]}], keep: outside}", 8, {"clip.keep: given without a box or a sphere"}},
    {8, "    clip: {box: [[0, 0, 0], [1, 1, 1]], keep: both}", 8, {"clip.keep: \"both\"", "inside, outside"}},
    {11,
     "      - surface: {clip: {box: [[0, 0, 0], [0, 1, 1]]}}",
     11,
     {"layers[1].surface.clip.box: from 0 to 0 along x", "first corner to be less"}},
    {11, "      - surface: {clip: {}}", 11, {"layers[1].surface.clip: holds nothing", "planes, a box or a sphere"}},
    {11, "      - surface: {field: f}", 11, {"surface: the key \"field\" is unknown", "colour_by"}},
    {11, "      - surface: {colour: redd}", 11, {"surface.colour: \"redd\"", "a list of 3 numbers from 0 to 1"}},
    {11, "      - surface: {colour: [1, 0, 0], colour_by: {field: f}}", 11, {"surface.colour: given beside colour_by"}},
    {11, "      - surface: {colour_by: {map: grey}}", 11, {"surface.colour_by.field: missing", "a text"}},
    {11, "      - surface: {mesh: []}", 11, {"surface.mesh: a list", "1 to 64"}},
    {11, "      - surface: {opacity: -1}", 11, {"surface.opacity: \"-1\"", "from 0 to 1"}},
    {11, "      - {surface: {}, slice: {field: f, planes: [{normal: [0, 0, 1]}]}}", 11, {"holds more than one layer"}},
    {11, "      - clips: {field: f}", 11, {"layers[1]: the key \"clips\" is unknown", "isosurface, volume, slice"}},
    {11, "      - slice: {field: f, planes: 2}", 11, {"slice.planes: \"2\"", "a list of 1 to 64 mappings"}},
    {11, "      - slice: {planes: [{normal: [0, 0, 1]}]}", 11, {"slice.field: missing", "a text"}},
    {11, "      - slice: {field: f, planes: []}", 11, {"slice.planes: a list of 0", "1 to 64"}},
    {11, "      - slice: {field: f, planes: [{}]}", 11, {"planes[0].normal: missing", "a list of 3 numbers"}},
    {11,
     "      - slice:\n          field: f\n          planes:\n            - {normal: [1, 0, 0]}\n"
     "            - {normal: [0, 0, 0]}",
     15,
     {"planes[1].normal: [0, 0, 0] has no direction", "any length but 0"}},
    {11, "      - slice: {field: f, planes: {normal: x, count: 0}}", 11, {"planes[0].count: \"0\"", "from 1 to 64"}},
    {11,
     "      - slice: {field: f, planes: {normal: x, count: 3, offset: 1}}",
     11,
     {"planes[0].count: given beside offset,"}},
    {11,
     "      - slice: {field: f, planes: {normal: x, count: 3, offsets: [1]}}",
     11,
     {"count: given beside offsets,"}},
    {11,
     "      - slice: {field: f, planes: {normal: x, count: 3, point: [0, 0, 0]}}",
     11,
     {"count: given beside point,"}},
    {11,
     "      - slice: {field: f, planes: {normal: x, offset: 0, offsets: [1]}}",
     11,
     {"offsets: given beside offset,"}},
    {11,
     "      - slice: {field: f, planes: {normal: x, offsets: []}}",
     11,
     {"planes[0].offsets: a list of 0", "1 to 64"}},
    {11,
     "      - slice: {field: f, planes: {normal: x, offsets: 1}}",
     11,
     {"planes[0].offsets: \"1\"", "a list of 1 to 64 numbers"}},
    {11,
     "      - slice: {field: f, planes: [{normal: x, count: 40}, {normal: y, count: 25}]}",
     11,
     {"67 isovalues, planes and outer"}},
    {8,
     "    clip: {planes: [{normal: x, count: 2}]}",
     8,
     {"clip.planes[0]: the key \"count\" is unknown", "normal, point, offset"}},
    {11, "      - slice: {field: f, planes: [{normal: w}]}", 11, {"planes[0].normal: \"w\"", "a list of 3 numbers"}},
    {11, "      - slice: {field: f, planes: [{normal: [0, 1]}]}", 11, {"normal: a list of 2", "a list of 3"}},
    {11, "      - slice: {field: f, planes: [{normal: [0, 1, 0], point: 3}]}", 11, {"planes[0].point: \"3\""}},
    {11,
     "      - slice: {field: f, planes: [{normal: [0, 1, 0], at: 3}]}",
     11,
     {"the key \"at\" is unknown", "offset"}},
    {11, "      - slice: {field: f, planes: [{normal: [0, 1, 0]}], opacity: 2}", 11, {"slice.opacity: \"2\""}},
    {11,
     "      - slice: {field: f, planes: [{normal: [0, 1, 0]}], range: [1, 0]}",
     11,
     {"slice.range", "does not rise"}},
    {10,
     "      - isosurface: {field: f, values: [" FIFTY ",50,51,52,53,54,55,56,57,58,59,60,61,62,63]}\n"
     "      - slice: {field: f, planes: [{normal: [0, 0, 1]}]}",
     11,
     {"layers[1]: 65 isovalues, planes and outer surfaces", "at most 64"}},
    {11, "      - " V "\n      - " V "\n      - " V "\n      - " V "\n      - " V, 15, {"5 volumes", "at most 4"}},
    {11, "      - volume: {field: f, range: [2, 1]}", 11, {"volume.range: [2, 1] does not rise", "low < high"}},
    {11, "      - volume: {field: f, opacity: [[0, 0], [0.5, 1], [0.4, 0]]}", 11, {"opacity[2]: 0.4 comes after 0.5"}},
    {11, "      - volume: {field: f, opacity: [[0, 0], [0, 1], [0, 0]]}", 11, {"opacity[2]: 0 is there three times"}},
    {11, "      - volume: {field: f, opacity: [[0, 0], [1.5, 1]]}", 11, {"opacity[1][0]: \"1.5\"", "from 0 to 1"}},
    {11, "      - volume: {field: f, opacity: [[0, 0, 0]]}", 11, {"opacity[0]: a list of 3", "a list of 2"}},
    {11, "      - volume: {field: f, opacity: 0.5}", 11, {"opacity: \"0.5\"", "lists of 2 numbers"}},
    {11, "      - volume: {field: f, unit_distance: 0}", 11, {"unit_distance: \"0\"", "above 0 and at most 1e+30"}},
    {12, "    sampling: {step: 1, step_cells: 1}", 12, {"sampling.step: given beside step_cells"}},
    {12, "    sampling: {max_error: 1e-3, step: 1}", 12, {"sampling.max_error: given beside a step"}},
    {12, "    sampling: {max_error: 1e-3, method: samples}", 12, {"sampling.max_error: given with method: samples"}},
    {12, "    sampling: {max_error: 0}", 12, {"sampling.max_error: \"0\"", "from 0.0001 to 1"}},
    {12, "    sampling: {max_error: 9e-5}", 12, {"sampling.max_error: \"9e-5\"", "from 0.0001 to 1"}},
    {12, "    sampling: {method: rays}", 12, {"sampling.method: \"rays\"", "samples, segments"}},
    {12, "    sampling: {step: 0}", 12, {"sampling.step: \"0\"", "above 0 and at most 1e+30"}},
    {12, "    sampling: {step: 1e300}", 12, {"sampling.step: \"1e300\"", "above 0 and at most 1e+30"}},
    {12, "    sampling: {max_seconds: 0}", 12, {"sampling.max_seconds: \"0\"", "from 1 to 1000000000"}},
    {12, "    sampling: {group: 64}", 12, {"the key \"group\" is gone", "never changed an image"}},
    {12, "    sampling: {jitter: maybe}", 12, {"sampling.jitter: \"maybe\"", "true or false"}},
    {12, "    sampling: {frames: 4097}", 12, {"sampling.frames: \"4097\"", "from 1 to 4096"}},
    {14, "      - path: a.jpg", 14, {"outputs[0].path: \"a.jpg\"", ".png or .exr"}},
    {14, "      - path: a{date}.png", 14, {"\"{date}\" is unknown", "{cycle}"}},
    {14, "      - path: a{time:.18f}.png", 14, {"\"{time:.18f}\" is unknown", "{time:.17f}"}},
    {14, "      - path: a{time:.2x}.png", 14, {"\"{time:.2x}\" is unknown", "(or e, or g)"}},
    {14, "      - path: a{time:2f}.png", 14, {"\"{time:2f}\" is unknown"}},
    {14, "      - path: a.png\n        decorations: 3", 15, {"outputs[0].decorations: \"3\"", "true or false"}},
    {12, "    decorations: true", 12, {"decorations: \"true\"", "a mapping with the keys title, text, colour_bar"}},
    {12, "    decorations: {rulers: 3}", 12, {"decorations.rulers: \"3\"", "true or false"}},
    {12, "    decorations: {scale_bar: {units: m}}", 12, {"scale_bar: the key \"units\" is unknown", "unit, at"}},
    {12, "    decorations: {scale_bar: {at: middle}}", 12, {"scale_bar.at: \"middle\"", "bottom_right"}},
    {12, "    decorations: {titel: t}", 12, {"decorations: the key \"titel\" is unknown", "title"}},
    {12, "    decorations: {title: [a]}", 12, {"decorations.title: a list", "a text of 1 to 255 bytes"}},
    {12, "    decorations: {title: \"{times}\"}", 12, {"decorations.title: \"{times}\" is unknown", "{time}"}},
    {12, "    decorations: {text: t}", 12, {"decorations.text: \"t\"", "a list of 1 to 16 mappings"}},
    {12, "    decorations: {text: [{at: top}]}", 12, {"text[0].text: missing"}},
    {12, "    decorations: {text: [{text: \"{x}\"}]}", 12, {"text[0].text: \"{x}\" is unknown"}},
    {12, "    decorations: {text: [{text: a, at: middle}]}", 12, {"text[0].at: \"middle\"", "top_left, top"}},
    {12, "    decorations: {colour_bar: yes}", 12, {"colour_bar: \"yes\"", "keys at, labels, ticks"}},
    {12, "    decorations: {colour_bar: {at: top}}", 12, {"colour_bar.at: \"top\"", "one of left, right"}},
    {12, "    decorations: {colour_bar: {ticks: 1}}", 12, {"colour_bar.ticks: \"1\"", "from 2 to 12"}},
    {12, "    decorations: {colour_bar: {digits: 20}}", 12, {"colour_bar.digits: \"20\"", "from 0 to 12"}},
    {12, "    decorations: {colour_bar: {notation: \"%.2f\"}}", 12, {"notation: \"%.2f\"", "auto, fixed, scientific"}},
    {12, "    decorations: {colour_bar: {units: {p: Pa}}}", 12, {"colour_bar.units", "a mapping"}},
    {12, "    decorations: {outline: box}", 12, {"decorations.outline: \"box\"", "one of false, true, meshes, ranks"}},
    {12, "    decorations: {axes: 3}", 12, {"decorations.axes: \"3\"", "true or false"}},
    {12, "    decorations: {colour: [1, 0]}", 12, {"decorations.colour: a list of 2", "a list of 3 numbers"}},
    {12, "    decorations: {colour: [1, 0, 2]}", 12, {"decorations.colour[2]: \"2\"", "from 0 to 1"}},
    {12, "    decorations: {size: 1}", 12, {"decorations.size: \"1\"", "from 0.005 to 0.2"}},
    {14, "      - path: a{cycle:6}.png", 14, {"\"{cycle:6}\" is unknown"}},
    {14, "      - path: a{cycle:021}.png", 14, {"\"{cycle:021}\" is unknown"}},
    {14, "      - path: a{cycle.png", 14, {"is unknown"}},
    {14, "      - path: a.png\n        bits: 12", 15, {"outputs[0].bits: 12", "8 or 16"}},
    {14, "      - path: a.exr\n        bits: 16", 15, {"outputs[0].bits", "for a PNG only"}},
    {14, "      - path: a.png\n        data: true", 15, {"outputs[0].data: given for a PNG", "an EXR only"}},
    {14, "      - path: a.png\n        deep: true", 15, {"outputs[0].deep: given for a PNG", "an EXR only"}},
    {14, "      - path: a.exr\n        deep: 1", 15, {"outputs[0].deep: \"1\"", "true or false"}},
    {14, "      - {path: a.exr, deep: true, data: true}", 14, {"outputs[0].deep: given with data"}},
    {14, "      - {path: a.exr, deep: true, decorations: true}", 14, {"outputs[0].deep: given with decorations"}},
    {14, "      - path: a.exr\n        data: 1", 15, {"outputs[0].data: \"1\"", "true or false"}},
    {14, "      - path: a.png\n      - path: a.png", 15, {"outputs[1].path: \"a.png\" is another output's file too"}},
    {14, "      - path: b.exr", 17, {"images[1].outputs[0].path: \"b.exr\" is another"}},
    {14, "      - path: a{cycle}.png\n      - path: a{cycle:03}.png", 15, {"is another output's file too"}},
    {14, "      - bits: 8", 14, {"outputs[0].path: missing", "cinema:"}},
    {6, "    camera: {orbit: {axis: [0, 1, 0]}}", 6, {"camera.orbit.views: missing", "from 1 to 1024"}},
    {6, "    camera: {orbit: {views: 0}}", 6, {"camera.orbit.views: \"0\"", "from 1 to 1024"}},
    {6, "    camera: {orbit: {views: 2, axis: [0, 0, 0]}}", 6, {"camera.orbit.axis: has length 0"}},
    {6, "    camera: {orbit: {views: 2, elevation: 90}}", 6, {"orbit.elevation: \"90\"", "-89.9 to 89.9; or a list"}},
    {6, "    camera: {orbit: {views: 2, elevation: [0, 90]}}", 6, {"orbit.elevation[1]: \"90\"", "-89.9 to 89.9"}},
    {6, "    camera: {orbit: {views: 2, elevation: []}}", 6, {"orbit.elevation: a list of 0", "1 to 32"}},
    {6, "    camera: {orbit: {views: 2, start: 400}}", 6, {"orbit.start: \"400\"", "-360 to 360"}},
    {6, "    camera: {orbit: {views: 2}, up: [0, 0, 1]}", 6, {"camera.up: given beside orbit", "axis"}},
    {6, "    camera: {orbit: {views: 2}, automatic: {direction: [0, 0, 1]}}", 6, {"automatic.direction: given beside"}},
    {6, "    camera: {orbit: {views: 2}, focal: [0, 0, 1]}", 6, {"camera.focal: given beside orbit"}},
    {6, "    camera: {orbit: {views: 2}}", 14, {"images[0].outputs[0].path: \"a.png\"", "several views", "{view}"}},
    {6, "    camera: {orbit: {views: 1025}}", 6, {"orbit.views: \"1025\"", "1 to 1024"}},
    {6, "    camera: {orbit: {views: 1024}}", 15, {"images[1]: 1025 pictures a step up to here", "at most 1024"}},
    {6, "    camera: {path: []}", 6, {"camera.path: a list of 0", "1 to 256 mappings"}},
    {6, "    camera: {path: [{time: 0, focal: [0, 0, 0]}]}", 6, {"camera.path[0].position: missing"}},
    {6, "    camera: {path: [" AT "]}", 6, {"camera.path[0]: has no time and no cycle"}},
    {6, "    camera: {path: [" AT_THE("time: 1, cycle: 2") "]}", 6, {"camera.path[0].cycle: given beside time"}},
    {6,
     "    camera:\n      path:\n        - " AT_THE("time: 1") "\n        - " AT_THE("cycle: 2"),
     9,
     {"camera.path[1].cycle: given where the first place has a time"}},
    {6,
     "    camera:\n      path:\n        - " AT_THE("cycle: 2") "\n        - " AT_THE("cycle: 2"),
     9,
     {"camera.path[1].cycle: 2 comes after 2", "in the order of time"}},
    {6, "    camera: {path: [" AT_THE("time: 1, up: [0, 0, 0]") "]}", 6, {"path[0].up: has length 0"}},
    {6, "    camera: {path: [" AT_THE("time: 1, up: [0, 0, 1]") "]}", 6, {"path[0].up: [0, 0, 1] is parallel"}},
    {6, "    camera: {path: [{time: 1, position: [1, 1, 1], focal: [1, 1, 1]}]}", 6, {"path[0].focal: [1, 1, 1] is"}},
    {6,
     "    camera: {path: [{time: 1, position: [1e31, 1, 1], focal: [1, 1, 1]}]}",
     6,
     {"path[0].position[0]: \"1e31"}},
    {6, "    camera: {automatic: {}, path: [" AT_THE("time: 1") "]}", 6, {"camera.automatic: given beside path"}},
    {6, "    camera: {orbit: {views: 2}, path: [" AT_THE("time: 1") "]}", 6, {"camera.path: given beside orbit"}},
    {6, "    sweep: {}", 6, {"images[0].sweep: holds nothing", "isovalues: true, planes: true, fields"}},
    {6, "    sweep: {isovalues: 3}", 6, {"sweep.isovalues: \"3\"", "true or false"}},
    {6,
     "    sweep: {isovalues: true}",
     14,
     {"outputs[0].path: \"a.png\" is one file for several isovalues", "{isovalue}"}},
    {15,
     "  - name: c\n    sweep: {isovalues: true}\n    layers: [{isosurface: {field: f, values: [1, 1.2]}}]\n"
     "    outputs: [{path: \"c{isovalue:.0f}.png\"}]\n  - name: b",
     18,
     {"outputs[0].path: \"c{isovalue:.0f}.png\" is one file for several isovalues", "more digits of {isovalue}"}},
    {6, "    sweep: {fields: [f, g]}", 14, {"outputs[0].path: \"a.png\" is one file for several fields", "{field}"}},
    {6, "    sweep: {fields: [f, f]}", 6, {"sweep.fields[1]: \"f\" is there twice"}},
    {6, "    sweep: {fields: [f, a/b]}", 6, {"sweep.fields[1]: \"a/b\" holds a /"}},
    {11, "    sweep: {fields: g}", 11, {"sweep.fields: no layer is coloured by a field", "colour_by"}},
    {11,
     "      - isosurface: {field: f, values: [3]}\n    sweep: {isovalues: true}",
     12,
     {"sweep.isovalues: the image has 2 isosurface layers", "expected one"}},
    {16, "    layers: [{volume: {field: f}}]\n    sweep: {isovalues: true}", 17, {"the image has 0 isosurface layers"}},
    {14, "      - path: a{view}.png", 14, {"outputs[0].path: \"{view}\" is of images with an orbit alone"}},
    {14, "      - path: a{isovalue}.png", 14, {"\"{isovalue}\" is of images with sweep: {isovalues: true} alone"}},
    {14, "      - path: a{field}.png", 14, {"\"{field}\" is of images with sweep: {fields: ...} alone"}},
    {14, "      - path: a{view:2}.png", 14, {"\"{view:2}\" is unknown", "{view}"}},
    {12, "    decorations: {title: \"{view}\"}", 12, {"decorations.title: \"{view}\" is of images with an orbit"}},
    {14, "      - cinema: a.png", 14, {"outputs[0].cinema: \"a.png\" has another ending", ".cdb"}},
    {14, "      - cinema: out/.cdb", 14, {"outputs[0].cinema: \"out/.cdb\" has another ending", ".cdb"}},
    {14, "      - cinema: \"{name}.cdb\"", 14, {"outputs[0].cinema: \"{name}.cdb\" holds a placeholder"}},
    {14, "      - cinema: \"a\\nb.cdb\"", 14, {"outputs[0].cinema: holds a control character"}},
    {14, "      - {cinema: a.cdb, path: a.exr}", 14, {"outputs[0].path: \"a.exr\" is no PNG"}},
    {14, "      - {cinema: a.cdb, path: ../a.png}", 14, {"outputs[0].path: \"../a.png\" is not below the folder"}},
    {14, "      - {cinema: a.cdb, path: b/../a.png}", 14, {"outputs[0].path: \"b/../a.png\" is not below"}},
    {14,
     "      - {cinema: a.cdb, path: a.png}\n      - cinema: a.cdb",
     15,
     {"outputs[1].cinema: \"a.cdb\" has this image"}},
    {14,
     "      - {cinema: a.cdb, path: a.png}\n      - path: a.cdb/a.png",
     15,
     {"outputs[1].path: \"a.cdb/a.png\" is another"}},
    {14, "      - cinema: a.cdb\n        bits: 12", 15, {"outputs[0].bits: 12"}},
};

static void replace_line(int line, const char *by, char *text)
{
    *text = '\0';
    for (int i = 0; i < good_line_count; i++) {
        strcat(text, i + 1 == line ? by : good_lines[i]);
        strcat(text, "\n");
    }
}

static void unmodified_scene_of_error_cases_is_valid(void **state)
{
    (void)state;
    char text[4096];
    scene s;
    replace_line(0, "", text);
    parse_valid_scene(text, &s);
    scene_free(&s);
}

static void scene_bad_files_are_reported_line_key_and_expectation(void **state)
{
    (void)state;
    int failures = 0;
    for (size_t i = 0; i < sizeof bad_files / sizeof *bad_files; i++) {
        const struct bad_file *bad = &bad_files[i];
        char text[4096], where[32];
        scene s;
        base_error error;
        replace_line(bad->line, bad->by, text);
        snprintf(where, sizeof where, "scene.yaml:%d: ", bad->reported);
        const int64_t held = base_memory_held();
        const insitu_status status = parse_scene(text, &s, &error);
        bool is_reported = status == INSITU_ERROR_SCENE && strncmp(error.message, where, strlen(where)) == 0;
        for (int w = 0; w < 3 && bad->words[w]; w++) is_reported = is_reported && strstr(error.message, bad->words[w]);
        is_reported = is_reported && s.image_count == 0 && !s.images && base_memory_held() == held;
        if (!is_reported) print_error("%s\n  status %d: %s\n", bad->by, status, error.message);
        failures += !is_reported;
    }
    assert_int_equal(failures, 0);
}

static void scene_whole_file_faults_are_reported(void **state)
{
    (void)state;
    static const char *const files[][2] = {
        {"", "scene.yaml:1: the file is empty"},
        {"# nothing\n", "scene.yaml:1: the file is empty"},
        {"- a\n", "scene.yaml:1: a list is not allowed, expected a mapping with the keys threads, tree, schedule, "
                  "writing, finer_pieces, surface_error, finer_memory, images"},
        {"hello", "scene.yaml:1: \"hello\" is not allowed"},
        {"threads: 1\n", "scene.yaml:1: images: missing, expected a list of 1 to 64 mappings"},
        {"threads: 1\nimages: \xff\n", "scene.yaml:2: not valid YAML: invalid leading UTF-8"},
    };
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        scene s;
        base_error error;
        assert_int_equal(parse_scene(files[i][0], &s, &error), INSITU_ERROR_SCENE);
        if (strncmp(error.message, files[i][1], strlen(files[i][1])) != 0) fail_msg("%s", error.message);
    }
}

static void scene_huge_file_is_refused(void **state)
{
    (void)state;
    const size_t size = SCENE_MAX_BYTES + 1;
    char *text = test_malloc(size);
    memset(text, '\n', size);
    memcpy(text, fewest_keys, sizeof fewest_keys - 1);
    scene s;
    base_error error = {.status = INSITU_OK};
    assert_int_equal(scene_parse(text, size, "scene.yaml", NULL, &s, &error), INSITU_ERROR_SCENE);
    assert_non_null(strstr(error.message, "1048577 bytes"));
    assert_int_equal(scene_parse(text, size - 1, "scene.yaml", NULL, &s, NULL), INSITU_OK);
    scene_free(&s);
    test_free(text);
}

/* Checks every prefix of a valid file. Most prefixes are errors; none may crash or leak memory. */
static void scene_truncated_files_fail_cleanly(void **state)
{
    (void)state;
    const int64_t held = base_memory_held();
    for (size_t size = 0; size < sizeof every_key; size++) {
        scene s;
        base_error error = {.status = INSITU_OK};
        const insitu_status status = scene_parse(every_key, size, "scene.yaml", NULL, &s, &error);
        assert_true((status == INSITU_OK) == (error.message[0] == '\0'));
        scene_free(&s);
    }
    assert_int_equal(base_memory_held(), held);
}

static void scene_every_failed_allocation_is_an_error_without_a_leak(void **state)
{
    (void)state;
    const int64_t held = base_memory_held();
    insitu_status status = INSITU_ERROR_MEMORY;
    int failures = 0;
    for (int n = 1; status != INSITU_OK && n < 10000; n++) {
        scene s;
        base_error error;
        base_memory_fail_nth(n);
        status = parse_scene(every_key, &s, &error);
        base_memory_fail_nth(0);
        if (status != INSITU_OK) {
            assert_int_equal(status, INSITU_ERROR_MEMORY);
            assert_string_equal(error.message, "scene.yaml: no memory for the scene");
            assert_null(s.images);
            failures++;
        }
        scene_free(&s);
        assert_int_equal(base_memory_held(), held);
    }
    assert_int_equal(status, INSITU_OK);
    assert_true(failures > 50);
}

static void scene_numbers_do_not_follow_the_locale(void **state)
{
    (void)state;
    if (!setlocale(LC_NUMERIC, "de_DE.UTF-8") && !setlocale(LC_NUMERIC, "de_DE")) skip();
    scene s;
    parse_valid_scene(every_key, &s);
    assert_true(s.images[0].camera.angle == 35.5);
    scene_free(&s);
    assert_string_equal(localeconv()->decimal_point, ",");
    setlocale(LC_NUMERIC, "C");
}

static void scene_texts_have_their_placeholders_replaced(void **state)
{
    (void)state;
    static const struct {
        const char *pattern;
        long long cycle;
        const char *path;
    } cases[] = {{"a.png", 7, "a.png"},
                 {"{time}s", 7, "0.125s"},
                 {"{time:.2f} {time:.0f} {time:.3e} {time:.1g}", 7, "0.12 0 1.250e-01 0.1"},
                 {"{name}/{cycle}.png", 7, "wave/7.png"},
                 {"{cycle:06}{cycle:01}", 42, "00004242"},
                 {"{cycle:020}", 1, "00000000000000000001"},
                 {"{cycle:03}", 123456, "123456"},
                 {"{cycle}", INT64_MIN, "-9223372036854775808"},
                 {"{cycle:05}", -3, "-0003"},
                 {"{view} {view:02} {field}", 1, "3 03 p"},
                 {"{isovalue} {isovalue:.3f}", 1, "-0.5 -0.500"},
                 {"{plane} {plane:03}", 1, "7 007"},
                 {"{", 1, "{"},
                 {"", 1, ""}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char *path = scene_expand_placeholders(
            cases[i].pattern, &(scene_placeholder_values){"wave", cases[i].cycle, 0.125, 3, 7, -0.5, "p"});
        assert_string_equal(path, cases[i].path);
        base_free(path);
    }
    base_memory_fail_nth(1);
    assert_null(scene_expand_placeholders("a", &(scene_placeholder_values){"b", 1, 0, 0, 0, 0, NULL}));
    base_memory_fail_nth(0);
}

static void mutually_exclusive_keys_are_checked(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(excluding_keys, &s);
    assert_true(s.finer_pieces == 0 && s.surface_error == 0.5 && s.is_surface_error_given && s.finer_memory == 4096);
    scene_free(&s);
    parse_valid_scene(mirrored_keys, &s);
    assert_true(s.finer_pieces == 0 && s.mirror_count > 0);
    scene_free(&s);
}

/* ---- the schema ---- */

static bool contains_mappings(const cyaml_schema_value_t *value)
{
    if (value->type == CYAML_MAPPING) return true;
    return value->type == CYAML_SEQUENCE && value->sequence.entry->type == CYAML_MAPPING;
}

static void check_mapping(const scene_mapping *mapping)
{
    for (int i = 0; mapping->fields[i].key; i++) {
        const cyaml_schema_field_t *field = &mapping->fields[i];
        const scene_key *key = &mapping->keys[i];
        const bool is_optional = field->value.flags & CYAML_FLAG_OPTIONAL;
        char in_file[64];
        snprintf(in_file, sizeof in_file, "%s:", field->key);
        if (!key->help || strlen(key->help) < 10) fail_msg("%s.%s has no help", mapping->title, field->key);
        if (is_optional == !key->default_text)
            fail_msg("%s.%s: default and optional differ", mapping->title, field->key);
        if (contains_mappings(&field->value) == !key->child) fail_msg("%s.%s: child", mapping->title, field->key);
        if (!strstr(every_key, in_file) && !strstr(excluding_keys, in_file))
            fail_msg("%s.%s is not in the test's file", mapping->title, field->key);
        if (key->child) {
            const cyaml_schema_value_t *value = &field->value;
            const cyaml_schema_value_t *entry = value->type == CYAML_MAPPING ? value : value->sequence.entry;
            assert_ptr_equal(entry->mapping.fields, key->child->fields);
            check_mapping(key->child);
        }
    }
}

static void scene_decorations_are_read(void **state)
{
    (void)state;
    scene s;
    parse_valid_scene(every_key, &s);
    const scene_decorations *d = &s.images[2].decorations;
    assert_true(d->has_rulers && d->has_scale_bar && d->scale_bar_anchor == SCENE_BOTTOM);
    assert_string_equal(d->scale_unit, "mm");
    assert_true(d->is_given && d->outline == SCENE_BOX_OF_DATA && d->has_axes && d->has_bars && d->has_colour);
    assert_string_equal(d->title, "{name} at {time:.2f} s");
    assert_int_equal(d->words_count, 2);
    assert_string_equal(d->words[0].text, "cycle {cycle}");
    assert_true(d->words[0].anchor == SCENE_BOTTOM_RIGHT && d->words[1].anchor == SCENE_TOP_LEFT);
    assert_true(d->bar_anchor == SCENE_LEFT && d->tick_count == 4 && d->label_count == 2 && d->size == 0.04);
    assert_string_equal(d->labels[0], "p in Pa");
    assert_true(d->unit_count == 2 && strcmp(d->units[1], "K") == 0);
    assert_true(d->number_form.notation == SCENE_FIXED && d->number_form.has_digits && d->number_form.digits == 2);
    assert_true(d->colour[0] == 1 && d->colour[1] == 0 && d->colour[2] == colour_linear_from_srgb(0.5F));
    assert_true(!s.images[2].outputs[0].has_decorations && s.images[2].outputs[1].has_decorations);
    scene_free(&s);
    parse_valid_scene(fewest_keys, &s);
    assert_true(!s.images[0].decorations.is_given && s.images[0].outputs[0].has_decorations);
    assert_true(!s.images[0].camera.has_bounds && !s.images[0].has_lights);
    scene_free(&s);
}

static const scene_derived *find_derived(const scene *s, const char *name, int *at)
{
    for (*at = 0; *at < s->derived_count; ++*at)
        if (strcmp(s->derived[*at].name, name) == 0) return &s->derived[*at];
    fail_msg("no derived field %s", name);
    return NULL;
}

static void derived_fields_are_sorted_and_read(void **state)
{
    (void)state;
    scene s;
    int late, speed, last, late_w, at;
    parse_valid_scene(every_key, &s);
    assert_int_equal(s.derived_count, 12);
    const scene_derived *of = find_derived(&s, "late", &late);
    find_derived(&s, "speed", &speed);
    const scene_derived *curl = find_derived(&s, "last", &last);
    find_derived(&s, "late_w", &late_w);
    assert_true(late > last && late > speed && last > late_w);
    assert_true(of->kind == SCENE_EXPRESSION && of->input_count == 2 && of->derived_indices[0] == last &&
                of->derived_indices[1] == speed);
    assert_true(of->inputs[0].component == 2 && of->inputs[1].component == SCENE_COMPONENT_ONLY);
    int line = 1;
    for (const char *c = every_key; c < strstr(every_key, "  late:"); c++) line += *c == '\n';
    assert_int_equal(of->line, line);
    assert_true(curl->kind == SCENE_VORTICITY && curl->component == SCENE_COMPONENT_DEFAULT && curl->input_count == 3);
    assert_true(curl->derived_indices[0] == -1 && curl->inputs[1].component == 1 && curl->derived_indices[2] == late_w);
    assert_string_equal(s.derived[late_w].inputs[1].name, "a b");
    assert_true(s.derived[speed].inputs[0].component == SCENE_COMPONENT_MAGNITUDE);
    assert_true(find_derived(&s, "y", &at)->inputs[0].component == 1);
    assert_true(find_derived(&s, "slice", &at)->inputs[0].component == 0);
    assert_true(find_derived(&s, "g", &at)->component == SCENE_COMPONENT_MAGNITUDE);
    assert_true(find_derived(&s, "d", &at)->kind == SCENE_DIVERGENCE &&
                find_derived(&s, "q", &at)->kind == SCENE_Q_CRITERION);
    assert_true(find_derived(&s, "l", &at)->kind == SCENE_LAMBDA2 &&
                find_derived(&s, "s", &at)->kind == SCENE_STRAIN_RATE);
    const double x[2] = {3, -1}, y[2] = {2, 0.5};
    double stack[SCENE_STACK * SCENE_BLOCK];
    scene_evaluate_expression(&of->expression, (const double *const[]){x, y}, 2, stack);
    assert_true(stack[0] == 2 && stack[1] == -2.25);
    scene_free(&s);
}

static void schema_keys_have_help_and_defaults(void **state)
{
    (void)state;
    check_mapping(&scene_top);
}

/* The command's argument is the folder of the example scenes. */
int main(int argument_count, char **arguments)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scene_image_keys_are_read),
        cmocka_unit_test(scene_view_keys_are_read),
        cmocka_unit_test(scene_decorations_are_read),
        cmocka_unit_test(scene_isosurface_keys_are_read),
        cmocka_unit_test(scene_volume_keys_are_read),
        cmocka_unit_test(scene_image_defaults_hold),
        cmocka_unit_test(sampling_method_follows_the_keys),
        cmocka_unit_test(lights_cast_shadows_by_default),
        cmocka_unit_test(scene_layer_defaults_hold),
        cmocka_unit_test(several_planes_are_read),
        cmocka_unit_test(slices_have_planes_of_unit_normals),
        cmocka_unit_test(contour_lines_use_the_colour_field),
        cmocka_unit_test(surface_colours_are_read),
        cmocka_unit_test(statistics_and_conditions_are_read),
        cmocka_unit_test(warps_are_read_per_mesh),
        cmocka_unit_test(mirrors_are_read_per_mesh),
        cmocka_unit_test(parameters_are_read_by_their_names),
        cmocka_unit_test(clips_are_read_for_images_and_layers),
        cmocka_unit_test(scene_up_defaults_to_z_for_views_along_y),
        cmocka_unit_test_prestate(scene_examples_are_valid, argument_count > 1 ? arguments[1] : NULL),
        cmocka_unit_test(unmodified_scene_of_error_cases_is_valid),
        cmocka_unit_test(scene_bad_files_are_reported_line_key_and_expectation),
        cmocka_unit_test(scene_whole_file_faults_are_reported),
        cmocka_unit_test(scene_huge_file_is_refused),
        cmocka_unit_test(scene_truncated_files_fail_cleanly),
        cmocka_unit_test(scene_every_failed_allocation_is_an_error_without_a_leak),
        cmocka_unit_test(scene_numbers_do_not_follow_the_locale),
        cmocka_unit_test(scene_texts_have_their_placeholders_replaced),
        cmocka_unit_test(mutually_exclusive_keys_are_checked),
        cmocka_unit_test(derived_fields_are_sorted_and_read),
        cmocka_unit_test(schema_keys_have_help_and_defaults),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
