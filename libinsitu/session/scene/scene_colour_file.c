/* Reads colour maps from files that ParaView has exported: a JSON list of mappings, or a single mapping. Each mapping
 * has a Name, and either RGBPoints (value, red, green and blue, repeated) and a ColorSpace, or IndexedColors (for
 * bands). libyaml can read JSON, which is a subset of YAML. Only the relative positions of the values are used: the
 * first value becomes the low end of a layer's range, and the last value the high end. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <yaml.h>

#include "memory.h"
#include "scene_convert.h"

enum { max_points = 4096 };

typedef struct colour_file {
    const char *name; /* name of the file, for messages */
    yaml_document_t yaml;
    base_error *error;
} colour_file;

static insitu_status fail_at_line_of_node(const colour_file *f, const yaml_node_t *node, const char *what)
{
    return base_fail(f->error, INSITU_ERROR_SCENE, "%.300s:%zu: %s", f->name, node->start_mark.line + 1, what);
}

static const yaml_node_t *find_node_by_index(const colour_file *f, int index)
{
    return yaml_document_get_node((yaml_document_t *)&f->yaml, index);
}

static int count_items(const yaml_node_t *list)
{
    return (int)(list->data.sequence.items.top - list->data.sequence.items.start);
}

static const char *get_scalar_text_or_empty(const yaml_node_t *node)
{
    return node && node->type == YAML_SCALAR_NODE ? (const char *)node->data.scalar.value : "";
}

static const yaml_node_t *find_value_of_key(const colour_file *f, const yaml_node_t *mapping, const char *key)
{
    const yaml_node_pair_t *end = mapping->data.mapping.pairs.top;
    for (const yaml_node_pair_t *p = mapping->data.mapping.pairs.start; p < end; p++)
        if (strcmp(get_scalar_text_or_empty(find_node_by_index(f, p->key)), key) == 0)
            return find_node_by_index(f, p->value);
    return NULL;
}

static insitu_status read_number(const colour_file *f, const char *key, const yaml_node_t *node, double *number)
{
    char what[64];
    const char *text = get_scalar_text_or_empty(node);
    char *end;
    *number = strtod(text, &end);
    if (end != text && !*end && *number - *number == 0) return INSITU_OK;
    snprintf(what, sizeof what, "%s: not a number, expected numbers", key);
    return fail_at_line_of_node(f, node, what);
}

static insitu_status read_colour_point(const colour_file *f, const yaml_node_t *list, int i, scene_colour_points *out)
{
    double numbers[4];
    colour_point *p = &out->items[i];
    const yaml_node_t *first = find_node_by_index(f, list->data.sequence.items.start[4 * (ptrdiff_t)i]);
    for (int n = 0; n < 4; n++) {
        const insitu_status status =
            read_number(f, "RGBPoints", find_node_by_index(f, list->data.sequence.items.start[4 * i + n]), &numbers[n]);
        if (status) return status;
        if (n > 0 && !(numbers[n] >= 0 && numbers[n] <= 1))
            return fail_at_line_of_node(f, first, "RGBPoints: a colour is outside of 0 to 1");
    }
    *p = (colour_point){numbers[0], {numbers[1], numbers[2], numbers[3]}};
    if (i > 0 && p->at < p[-1].at)
        return fail_at_line_of_node(f, first, "RGBPoints: values fall, expected rising ones");
    return INSITU_OK;
}

static insitu_status read_colour_points(const colour_file *f, const yaml_node_t *list, scene_colour_points *out)
{
    const int numbers = list->type == YAML_SEQUENCE_NODE ? count_items(list) : 0;
    if (numbers < 8 || numbers % 4 || numbers > 4 * max_points)
        return fail_at_line_of_node(f, list,
                                    "RGBPoints: expected 2 to 4096 times four numbers: value, red, green, blue");
    out->count = numbers / 4;
    out->items = base_calloc((size_t)out->count, sizeof *out->items);
    if (!out->items) return base_fail(f->error, INSITU_ERROR_MEMORY, "%.300s: no memory to read it", f->name);
    insitu_status status = INSITU_OK;
    for (int i = 0; i < out->count && !status; i++) status = read_colour_point(f, list, i, out);
    if (!status && !(out->items[0].at < out->items[out->count - 1].at))
        status = fail_at_line_of_node(f, list, "RGBPoints: all values are the same, expected rising ones");
    return status;
}

static insitu_status read_colour_space(const colour_file *f, const yaml_node_t *node, colour_space *space)
{
    static const struct {
        const char *word;
        colour_space space;
    } words[] = {{"RGB", COLOUR_RGB},
                 {"HSV", COLOUR_HSV},
                 {"Lab", COLOUR_LAB},
                 {"CIELAB", COLOUR_LAB},
                 {"Diverging", COLOUR_DIVERGING},
                 {"Step", COLOUR_STEP}};
    *space = COLOUR_RGB;
    if (!node) return INSITU_OK;
    for (size_t i = 0; i < sizeof words / sizeof *words; i++) {
        *space = words[i].space;
        if (strcmp(get_scalar_text_or_empty(node), words[i].word) == 0) return INSITU_OK;
    }
    return fail_at_line_of_node(f, node, "ColorSpace: expected one of RGB, HSV, Lab, CIELAB, Diverging and Step");
}

/* Reads the colours of bands from a list of numbers: red, green and blue of the first band, then of the second band,
 * and so on. */
static insitu_status read_colour_bands(const colour_file *f, const yaml_node_t *list, scene_colour_points *out)
{
    const int numbers = list->type == YAML_SEQUENCE_NODE ? count_items(list) : 0;
    if (numbers < 3 || numbers % 3 || numbers > 3 * max_points)
        return fail_at_line_of_node(f, list, "IndexedColors: expected 1 to 4096 times three numbers: red, green, blue");
    out->is_banded = true;
    out->count = numbers / 3;
    out->items = base_calloc((size_t)out->count, sizeof *out->items);
    if (!out->items) return base_fail(f->error, INSITU_ERROR_MEMORY, "%.300s: no memory to read it", f->name);
    insitu_status status = INSITU_OK;
    for (int i = 0; i < numbers && !status; i++) {
        const yaml_node_t *node = find_node_by_index(f, list->data.sequence.items.start[i]);
        double *channel = &out->items[i / 3].srgb[i % 3];
        status = read_number(f, "IndexedColors", node, channel);
        if (!status && !(*channel >= 0 && *channel <= 1))
            status = fail_at_line_of_node(f, node, "IndexedColors: a colour is outside of 0 to 1");
    }
    return status;
}

static insitu_status read_colour_map_from_node(const colour_file *f, const yaml_node_t *mapping,
                                               scene_colour_points *out)
{
    const yaml_node_t *points = find_value_of_key(f, mapping, "RGBPoints"),
                      *bands = find_value_of_key(f, mapping, "IndexedColors");
    if (!points && bands) return read_colour_bands(f, bands, out);
    if (!points)
        return fail_at_line_of_node(f, mapping, "the map has no RGBPoints, expected a list of value, red, green, blue");
    const insitu_status status = read_colour_space(f, find_value_of_key(f, mapping, "ColorSpace"), &out->space);
    return status ? status : read_colour_points(f, points, out);
}

static insitu_status fail_for_map_name(const colour_file *f, const yaml_node_t *root, const char *name, int count)
{
    const char *first = get_scalar_text_or_empty(
        find_value_of_key(f, find_node_by_index(f, root->data.sequence.items.start[0]), "Name"));
    if (name)
        return base_fail(f->error, INSITU_ERROR_SCENE,
                         "%.300s: none of its %d colour maps is called \"%.100s\", "
                         "expected a name as \"%.100s\"",
                         f->name, count, name, first);
    return base_fail(f->error, INSITU_ERROR_SCENE,
                     "%.300s: holds %d colour maps, expected the name of one beside file, "
                     "as \"%.100s\"",
                     f->name, count, first);
}

static insitu_status find_colour_map_by_name(const colour_file *f, const char *name, const yaml_node_t **out)
{
    const yaml_node_t *root = yaml_document_get_root_node((yaml_document_t *)&f->yaml);
    if (!root) return base_fail(f->error, INSITU_ERROR_SCENE, "%.300s:1: is empty, expected a colour map", f->name);
    const bool is_list = root->type == YAML_SEQUENCE_NODE;
    const int count = is_list ? count_items(root) : 1;
    for (int i = 0; i < count; i++) {
        const yaml_node_t *map = is_list ? find_node_by_index(f, root->data.sequence.items.start[i]) : root;
        if (map->type != YAML_MAPPING_NODE)
            return fail_at_line_of_node(f, map, "expected a colour map, a mapping with RGBPoints");
        *out = map;
        if (name ? strcmp(get_scalar_text_or_empty(find_value_of_key(f, map, "Name")), name) == 0 : count == 1)
            return INSITU_OK;
    }
    if (count == 0) return fail_at_line_of_node(f, root, "holds no colour map");
    if (is_list) return fail_for_map_name(f, root, name, count);
    return base_fail(f->error, INSITU_ERROR_SCENE,
                     "%.300s: its colour map is not called \"%.100s\", expected \"%.100s\"", f->name, name,
                     get_scalar_text_or_empty(find_value_of_key(f, root, "Name")));
}

static insitu_status fail_for_syntax(const colour_file *f, const yaml_parser_t *parser)
{
    if (parser->error == YAML_MEMORY_ERROR || parser->error == YAML_NO_ERROR)
        return base_fail(f->error, INSITU_ERROR_MEMORY, "%.300s: no memory to read it", f->name);
    return base_fail(f->error, INSITU_ERROR_SCENE, "%.300s:%zu: not valid JSON: %.200s", f->name,
                     parser->problem_mark.line + 1, parser->problem ? parser->problem : "unreadable");
}

insitu_status scene_read_colour_file(const scene_attachment *file, const char *file_name, const char *name,
                                     scene_colour_points *out, base_error *error)
{
    colour_file f = {.name = file_name, .error = error};
    const yaml_node_t *map = NULL;
    yaml_parser_t parser;
    if (!yaml_parser_initialize(&parser))
        return base_fail(error, INSITU_ERROR_MEMORY, "%.300s: no memory to read it", file_name);
    yaml_parser_set_input_string(&parser, (const unsigned char *)file->text, (size_t)file->size);
    insitu_status status = yaml_parser_load(&parser, &f.yaml) ? INSITU_OK : fail_for_syntax(&f, &parser);
    yaml_parser_delete(&parser);
    if (status) return status;
    status = find_colour_map_by_name(&f, name, &map);
    if (!status && map) status = read_colour_map_from_node(&f, map, out);
    yaml_document_delete(&f.yaml);
    return status;
}
