/* Checks that short forms of scene keys have the same result as their full forms, and that messages about misspelt
 * words suggest the nearest word. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "scene.h"
#include "scene_shorthand.h"

enum { MOST_TEXT = 4096 };

static void print_numbers(char *to, const char *name, const float *v, int count)
{
    size_t used = strlen(to);
    used += (size_t)snprintf(to + used, MOST_TEXT - used, "%s:", name);
    for (int i = 0; i < count; i++) used += (size_t)snprintf(to + used, MOST_TEXT - used, " %.9g", (double)v[i]);
    snprintf(to + used, MOST_TEXT - used, "\n");
}

static void print_vector(char *to, const char *name, const double v[3])
{
    const float narrow[3] = {(float)v[0], (float)v[1], (float)v[2]};
    print_numbers(to, name, narrow, 3);
}

static void print_flag(char *to, const char *name, bool flag)
{
    const float number = flag;
    print_numbers(to, name, &number, 1);
}

static void print_layers(char *to, const scene_image *image)
{
    for (int i = 0; i < image->surface_count; i++) {
        print_numbers(to, "surface", image->surfaces[i].colour, 3);
        if (image->surfaces[i].has_colour_by) print_flag(to, image->surfaces[i].colour_by.name, true);
        print_numbers(to, "edge width", &image->surfaces[i].edge_width, 1);
        print_numbers(to, "edges", image->surfaces[i].edge_colour, 3);
    }
    for (int i = 0; i < image->isosurface_count; i++) {
        const scene_isosurface *layer = &image->isosurfaces[i];
        for (int n = 0; n < layer->value_count; n++) print_flag(to, "value", layer->values[n] == 0.5);
        print_numbers(to, "colours", layer->colours, 3 * layer->value_count);
        if (layer->has_colour_by) print_flag(to, layer->colour_by.name, true);
    }
    for (int i = 0; i < image->slice_count; i++) {
        print_numbers(to, "outside", image->slices[i].colour_map.outside_colours[0], 9);
        for (int n = 0; n < image->slices[i].plane_count; n++)
            print_vector(to, "normal", image->slices[i].planes[n].normal);
    }
}

/* Prints all values of an image that have short forms. */
static void print_image(char *to, const scene_image *image)
{
    *to = '\0';
    print_numbers(to, "background", image->background, 4);
    print_flag(to, "automatic", image->camera.is_automatic);
    print_vector(to, "direction", image->camera.direction);
    print_vector(to, "up", image->camera.up);
    print_vector(to, "orbit", image->camera.orbit.axis);
    print_flag(to, "bars", image->decorations.has_bars);
    print_flag(to, "scale bar", image->decorations.has_scale_bar);
    print_numbers(to, "decorations", image->decorations.colour, 3);
    for (int i = 0; i < image->decorations.words_count; i++) print_flag(to, image->decorations.words[i].text, true);
    print_flag(to, "occlusion", image->occlusion_samples > 0);
    for (int i = 0; i < image->light_count; i++) {
        print_vector(to, "light", image->lights[i].direction);
        print_numbers(to, "light", image->lights[i].colour, 3);
    }
    for (int i = 0; i < image->output_count; i++) print_flag(to, image->outputs[i].path, true);
    for (int i = 0; i < image->clip_count; i++) print_vector(to, "centre", image->clips[i].centre);
    print_layers(to, image);
}

static void make_scene(char text[MOST_TEXT], const char *line)
{
    const bool has_outputs = strstr(line, "outputs") != NULL, has_layers = strstr(line, "layers") != NULL;
    snprintf(text, MOST_TEXT, "images:\n  - name: a\n    %s\n%s%s", line,
             has_layers ? "" : "    layers: [{surface: {}}]\n", has_outputs ? "" : "    outputs: [{path: a.png}]\n");
}

static void print_scene(char out[MOST_TEXT], const char *line)
{
    char text[MOST_TEXT];
    base_error error = {.status = INSITU_OK};
    scene s;
    make_scene(text, line);
    if (scene_parse(text, strlen(text), "scene.yaml", NULL, &s, &error) != INSITU_OK)
        fail_msg("%s\n%s", text, error.message);
    print_image(out, &s.images[0]);
    scene_free(&s);
}

static const char *const forms[][2] = {
    {"background: white", "background: [1, 1, 1]"},
    {"background: \"#336699\"", "background: [0.2, 0.4, 0.6]"},
    {"background: rebeccapurple", "background: [0.4, 0.2, 0.6]"},
    {"camera: automatic", "camera: {automatic: {}}"},
    {"camera: {automatic: true}", "camera: {automatic: {}}"},
    {"camera: {automatic: {direction: -x}}", "camera: {automatic: {direction: [-1, 0, 0]}}"},
    {"camera: {automatic: {}, up: z}", "camera: {automatic: {}, up: [0, 0, 1]}"},
    {"camera: {orbit: {views: 3, axis: +x}}\n    outputs: [{path: \"{view}.png\"}]",
     "camera: {orbit: {views: 3, axis: [1, 0, 0]}}\n    outputs: [{path: \"{view}.png\"}]"},
    {"lights: {direction: y, color: red}", "lights: [{direction: [0, 1, 0], colour: [1, 0, 0]}]"},
    {"ambient_occlusion: true", "ambient_occlusion: {}"},
    {"clip: {sphere: {center: [1, 2, 3], radius: 1}}", "clip: {sphere: {centre: [1, 2, 3], radius: 1}}"},
    {"decorations: {color_bar: true, scale_bar: true}", "decorations: {colour_bar: {}, scale_bar: {}}"},
    {"decorations: {colour_bar: false, axes: true}", "decorations: {axes: true}"},
    {"decorations: {colour: gold, text: {text: hello}}",
     "decorations: {colour: [1, 0.84313725490196079, 0], text: [{text: hello}]}"},
    {"layers: [{surface: {color: lime, edges: true}}]", "layers: [{surface: {colour: [0, 1, 0], edges: {}}}]"},
    {"layers: [{surface: {edges: {colour: black}}}]", "layers: [{surface: {edges: {colour: [0, 0, 0]}}}]"},
    {"layers: [{isosurface: {field: p, values: 0.5, colors: [blue]}}]",
     "layers: [{isosurface: {field: p, values: [0.5], colours: [[0, 0, 1]]}}]"},
    {"layers: [{isosurface: {field: p, values: [0.5, 2], colours: [red, [0, 0, 1]]}}]",
     "layers: [{isosurface: {field: p, values: [0.5, 2], colours: [[1, 0, 0], [0, 0, 1]]}}]"},
    {"layers: [{isosurface: {field: p, values: 0.5, colours: aqua}}]",
     "layers: [{isosurface: {field: p, values: [0.5], colours: [[0, 1, 1]]}}]"},
    {"layers: [{surface: {colour_by: heat}}]", "layers: [{surface: {colour_by: {field: heat}}}]"},
    {"layers: [{isosurface: {field: p, values: 1, color_by: 2}}]",
     "layers: [{isosurface: {field: p, values: [1], colour_by: {field: 2}}}]"},
    {"layers: [{slice: {field: p}}]", "layers: [{slice: {field: p, planes: [{normal: [0, 0, 1]}]}}]"},
    {"layers: [{slice: {field: p, planes: {normal: -y}, below: navy, above: \"#FF0000\", nan: white}}]",
     "layers: [{slice: {field: p, planes: [{normal: [0, -1, 0]}], below: [0, 0, 0.50196078431372548], above: [1, 0, "
     "0], nan: [1, 1, 1]}}]"},
    {"outputs: {path: a.png}", "outputs: [{path: a.png}]"},
    {"outputs: b.png", "outputs: [{path: b.png}]"},
    {"outputs: [c.png, {path: d.exr}]", "outputs: [{path: c.png}, {path: d.exr}]"},
};

static void short_forms_equal_their_full_forms(void **context)
{
    (void)context;
    for (size_t i = 0; i < sizeof forms / sizeof *forms; i++) {
        char shorter[MOST_TEXT], full[MOST_TEXT];
        print_scene(shorter, forms[i][0]);
        print_scene(full, forms[i][1]);
        if (strcmp(shorter, full) != 0) fail_msg("%s\n%s\nis not\n%s\n%s", forms[i][0], shorter, forms[i][1], full);
    }
}

/* Checks colour names in a map's list of colours. The parser reads this list from the document by paths. */
static void colours_of_maps_have_names(void **context)
{
    (void)context;
    scene named, given;
    base_error error = {.status = INSITU_OK};
    char text[MOST_TEXT];
    make_scene(text, "layers: [{slice: {field: p, map: {colours: [black, \"#3366ff\", white]}}}]");
    assert_int_equal(scene_parse(text, strlen(text), "scene.yaml", NULL, &named, &error), INSITU_OK);
    make_scene(text, "layers: [{slice: {field: p, map: {colours: [[0, 0, 0], [0.2, 0.4, 1], [1, 1, 1]]}}}]");
    assert_int_equal(scene_parse(text, strlen(text), "scene.yaml", NULL, &given, &error), INSITU_OK);
    const scene_colour_map *a = &named.images[0].slices[0].colour_map, *b = &given.images[0].slices[0].colour_map;
    assert_int_equal(a->count, b->count);
    assert_memory_equal(a->colours, b->colours, (size_t)a->count * 3 * sizeof *a->colours);
    scene_free(&named);
    scene_free(&given);
}

static const struct {
    const char *line;
    const char *words[3];
} wrong[] = {
    {"background: whte", {"scene.yaml:3: images[0].background", "\"whte\" is not allowed", "the name of a colour"}},
    {"background: \"#12345\"", {"scene.yaml:3", "\"#12345\" is not allowed", "#rrggbb"}},
    {"layers: [{slice: {field: p, planes: {normal: w}}}]", {"planes[0].normal", "\"w\" is not allowed", "3 numbers"}},
    {"layers: [{isosurface: {feild: p, values: 1}}]", {"\"feild\" is unknown (did you mean field?)"}},
    {"layers: [{isosurface: {field: p, value: 1}}]", {"\"value\" is unknown (did you mean values?)"}},
    {"layers: [{iso_surface: {field: p, values: 1}}]", {"(did you mean isosurface?)"}},
    {"layers: [{volume: {field: p, map: viridiss}}]", {"\"viridiss\" is not allowed (did you mean viridis?)"}},
    {"layers: [{volume: {field: p, scale: lgo}}]", {"\"lgo\" is not allowed (did you mean log?)"}},
    {"layer: []", {"\"layer\" is unknown (did you mean layers?)"}},
    {"decorations: {titel: x}", {"\"titel\" is unknown (did you mean title?)"}},
};

static void similar_words_are_suggested(void **context)
{
    (void)context;
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        char text[MOST_TEXT];
        base_error error = {.status = INSITU_OK};
        scene s;
        make_scene(text, wrong[i].line);
        assert_int_equal(scene_parse(text, strlen(text), "scene.yaml", NULL, &s, &error), INSITU_ERROR_SCENE);
        for (int n = 0; n < 3 && wrong[i].words[n]; n++)
            if (!strstr(error.message, wrong[i].words[n]))
                fail_msg("no \"%s\" in: %s", wrong[i].words[n], error.message);
    }
}

static void dissimilar_words_get_no_suggestion(void **context)
{
    (void)context;
    static const char *const keys[] = {"field", "values", "opacity", "colour_by"};
    /* the exchange of two letters counts as one edit */
    assert_string_equal(scene_find_most_similar_word("vlaues", keys, 4), "values");
    assert_string_equal(scene_find_most_similar_word("opacty", keys, 4), "opacity");
    assert_null(scene_find_most_similar_word("threshold", keys, 4));
    assert_null(scene_find_most_similar_word("", keys, 4));
    assert_null(scene_find_most_similar_word("x", keys, 4));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(short_forms_equal_their_full_forms),
        cmocka_unit_test(colours_of_maps_have_names),
        cmocka_unit_test(similar_words_are_suggested),
        cmocka_unit_test(dissimilar_words_get_no_suggestion),
    };
    return cmocka_run_group_tests_name("scene_shorthand", tests, NULL, NULL);
}
