/* Rewrites short forms of values. A short form is recognised by its key and the type of its value, independent of where
 * the key appears, because no key of the schema has two meanings that could have the same short form. Nodes are
 * identified by libyaml's indices, which begin at 1, because adding a node may move all nodes in memory. */
#include "scene_shorthand.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "scene_colour_names.h"

/* The state of replacing the short forms of values in a document by their full forms. */
typedef struct rewrite {
    yaml_document_t *document;
    yaml_mark_t mark; /* position in the file of the value that is being rewritten; new nodes get the same position */
    bool has_memory;
} rewrite;

static yaml_node_t *find_node_by_index(const rewrite *r, int number)
{
    return yaml_document_get_node(r->document, number);
}

static const char *get_scalar_text_or_null(const rewrite *r, int number)
{
    const yaml_node_t *node = find_node_by_index(r, number);
    return node->type == YAML_SCALAR_NODE ? (const char *)node->data.scalar.value : NULL;
}

/* ---- new nodes: each function returns the index of the node, or 0 if memory ran out ------------------------------ */

static int check_new_node_and_set_line(rewrite *r, int number)
{
    if (number)
        find_node_by_index(r, number)->start_mark = r->mark;
    else
        r->has_memory = false;
    return number;
}

static int create_scalar_node(rewrite *r, const char *text)
{
    return check_new_node_and_set_line(r, yaml_document_add_scalar(r->document, NULL, (const yaml_char_t *)text,
                                                                   (int)strlen(text), YAML_PLAIN_SCALAR_STYLE));
}

static int create_list_node(rewrite *r)
{
    return check_new_node_and_set_line(r, yaml_document_add_sequence(r->document, NULL, YAML_FLOW_SEQUENCE_STYLE));
}

static int create_mapping_node(rewrite *r)
{
    return check_new_node_and_set_line(r, yaml_document_add_mapping(r->document, NULL, YAML_FLOW_MAPPING_STYLE));
}

static void append_item(rewrite *r, int list, int item)
{
    if (!list || !item || !yaml_document_append_sequence_item(r->document, list, item)) r->has_memory = false;
}

static void append_pair(rewrite *r, int mapping, const char *key, int value)
{
    const int name = create_scalar_node(r, key);
    if (!mapping || !name || !value || !yaml_document_append_mapping_pair(r->document, mapping, name, value))
        r->has_memory = false;
}

static int create_vector_node(rewrite *r, const double v[3])
{
    const int list = create_list_node(r);
    for (int i = 0; i < 3; i++) {
        char text[32];
        snprintf(text, sizeof text, "%.17g", v[i]);
        append_item(r, list, create_scalar_node(r, text));
    }
    return list;
}

static int create_list_with_item(rewrite *r, int item)
{
    const int list = create_list_node(r);
    append_item(r, list, item);
    return list;
}

/* ---- colours and axes ------------------------------------------------------------------------------------------- */

static int compare_with_colour_name(const void *name, const void *entry)
{
    return strcmp(name, ((const scene_colour_name *)entry)->name);
}

/* Reads a colour given as "#rrggbb" or by name. */
static bool parse_colour(const char *text, double colour[3])
{
    unsigned long rgb;
    if (text[0] == '#') {
        if (strlen(text) != 7 || strspn(text + 1, "0123456789abcdefABCDEF") != 6) return false;
        rgb = strtoul(text + 1, NULL, 16);
    } else {
        const scene_colour_name *named =
            bsearch(text, scene_colour_names, sizeof scene_colour_names / sizeof *scene_colour_names,
                    sizeof *scene_colour_names, compare_with_colour_name);
        if (!named) return false;
        rgb = named->rgb;
    }
    for (int i = 0; i < 3; i++) colour[i] = (double)(rgb >> (16 - 8 * i) & 0xff) / 255;
    return true;
}

/* Reads an axis such as "x", "+y" or "-z" as a vector. */
static bool parse_axis(const char *text, double axis[3])
{
    const double sign = *text == '-' ? -1 : 1;
    text += *text == '-' || *text == '+';
    if (text[0] < 'x' || text[0] > 'z' || text[1]) return false;
    for (int i = 0; i < 3; i++) axis[i] = i == text[0] - 'x' ? sign : 0;
    return true;
}

static void expand_colour(rewrite *r, int *value)
{
    double colour[3];
    const char *text = get_scalar_text_or_null(r, *value);
    if (text && parse_colour(text, colour)) *value = create_vector_node(r, colour);
}

/* Expands a list of colours, or a single colour. */
static void expand_colours(rewrite *r, int *value)
{
    double colour[3];
    const char *text = get_scalar_text_or_null(r, *value);
    if (text && parse_colour(text, colour)) *value = create_list_with_item(r, create_vector_node(r, colour));
    if (text || find_node_by_index(r, *value)->type != YAML_SEQUENCE_NODE) return;
    yaml_node_item_t *items = find_node_by_index(r, *value)->data.sequence.items.start;
    const yaml_node_item_t *end = find_node_by_index(r, *value)->data.sequence.items.top;
    for (; items < end && r->has_memory; items++) expand_colour(r, items);
}

static void expand_axis(rewrite *r, int *value)
{
    double axis[3];
    const char *text = get_scalar_text_or_null(r, *value);
    if (text && parse_axis(text, axis)) *value = create_vector_node(r, axis);
}

/* ---- texts, lists, switches and names --------------------------------------------------------------------------- */

/* Expands a text to a mapping in which the text is the value of the key. */
static void expand_text_to_mapping(rewrite *r, const char *key, int *value)
{
    const int text = *value;
    if (!get_scalar_text_or_null(r, text) || !*get_scalar_text_or_null(r, text)) return;
    *value = create_mapping_node(r);
    append_pair(r, *value, key, text);
}

static void expand_field(rewrite *r, int *value)
{
    expand_text_to_mapping(r, "field", value);
}

/* Expands a path, a mapping, or a list of either, to a list of mappings. */
static void expand_outputs(rewrite *r, int *value)
{
    expand_text_to_mapping(r, "path", value);
    if (r->has_memory && find_node_by_index(r, *value)->type == YAML_MAPPING_NODE)
        *value = create_list_with_item(r, *value);
    if (!r->has_memory || find_node_by_index(r, *value)->type != YAML_SEQUENCE_NODE) return;
    for (int i = 0; r->has_memory && find_node_by_index(r, *value)->data.sequence.items.start + i <
                                         find_node_by_index(r, *value)->data.sequence.items.top;
         i++) {
        int item = find_node_by_index(r, *value)->data.sequence.items.start[i];
        expand_text_to_mapping(r, "path", &item);
        if (item) find_node_by_index(r, *value)->data.sequence.items.start[i] = item;
    }
}

/* Expands `true` to an empty mapping. In such a mapping all keys have their default values. If the value is `false`,
 * *value becomes 0; the caller then removes the pair of the key and the value. */
static void expand_boolean_to_mapping(rewrite *r, int *value)
{
    const char *text = get_scalar_text_or_null(r, *value);
    if (!text) return;
    if (strcmp(text, "true") == 0) *value = create_mapping_node(r);
    if (strcmp(text, "false") == 0) *value = 0;
}

/* Expands `automatic` to {automatic: {}}. */
static void expand_automatic_camera(rewrite *r, int *value)
{
    const char *text = get_scalar_text_or_null(r, *value);
    if (!text || strcmp(text, "automatic") != 0) return;
    *value = create_mapping_node(r);
    append_pair(r, *value, "automatic", create_mapping_node(r));
}

/* Expands a single number to a list of this number. */
static void expand_number_to_list(rewrite *r, int *value)
{
    const char *text = get_scalar_text_or_null(r, *value);
    if (text && *text && !text[strspn(text, "+-.0123456789eE")]) *value = create_list_with_item(r, *value);
}

/* Expands a single mapping to a list of this mapping. */
static void expand_single_mapping_to_list(rewrite *r, int *value)
{
    if (find_node_by_index(r, *value)->type == YAML_MAPPING_NODE) *value = create_list_with_item(r, *value);
}

/* Adds a plane perpendicular to z to a slice that has no key `planes`. */
static void add_default_plane_to_slice(rewrite *r, int *value)
{
    static const double z[3] = {0, 0, 1};
    const yaml_node_t *slice = find_node_by_index(r, *value);
    if (slice->type != YAML_MAPPING_NODE) return;
    for (const yaml_node_pair_t *p = slice->data.mapping.pairs.start; p < slice->data.mapping.pairs.top; p++) {
        const char *key = get_scalar_text_or_null(r, p->key);
        if (key && strcmp(key, "planes") == 0) return;
    }
    const int plane = create_mapping_node(r);
    append_pair(r, plane, "normal", create_vector_node(r, z));
    append_pair(r, *value, "planes", create_list_with_item(r, plane));
}

/* Expands a mapping with names as keys to a list of mappings with the key `name`. A value that is not a mapping is
 * first expanded to a mapping with the single key text_key. If text_key is NULL, such a value remains unchanged, and
 * the schema refuses it. */
static void expand_mapping_to_named_list(rewrite *r, const char *text_key, int *value)
{
    if (find_node_by_index(r, *value)->type != YAML_MAPPING_NODE) return;
    const int list = create_list_node(r), from = *value;
    const int count = (int)(find_node_by_index(r, from)->data.mapping.pairs.top -
                            find_node_by_index(r, from)->data.mapping.pairs.start);
    for (int i = 0; i < count && r->has_memory; i++) {
        const yaml_node_pair_t pair = find_node_by_index(r, from)->data.mapping.pairs.start[i];
        const bool is_mapping = find_node_by_index(r, pair.value)->type == YAML_MAPPING_NODE;
        r->mark = find_node_by_index(r, pair.key)->start_mark;
        const int entry = is_mapping || !text_key ? pair.value : create_mapping_node(r);
        if (!is_mapping && text_key) append_pair(r, entry, text_key, pair.value);
        if (is_mapping || text_key) append_pair(r, entry, "name", pair.key);
        append_item(r, list, entry);
    }
    *value = list;
}

static void expand_fields(rewrite *r, int *value)
{
    expand_mapping_to_named_list(r, "expression", value);
}

static void expand_meshes(rewrite *r, int *value)
{
    expand_mapping_to_named_list(r, NULL, value);
}

/* ---- table of short forms, and expansion of a document ----------------------------------------------------------- */

static const char axis_words[] = "x, y or z, or -x, -y or -z", switch_words[] = "true or false";

static const struct {
    const char *key;
    void (*expand)(rewrite *r, int *value);
    /* description of the short form, for messages; NULL if the schema's description already includes it */
    const char *words;
} rules[] = {
    {"colour", expand_colour, NULL},
    {"background", expand_colour, NULL},
    {"below", expand_colour, NULL},
    {"above", expand_colour, NULL},
    {"nan", expand_colour, NULL},
    {"colours", expand_colours, "names of colours, or \"#rrggbb\" in quotes"},
    {"normal", expand_axis, axis_words},
    {"direction", expand_axis, axis_words},
    {"up", expand_axis, axis_words},
    {"axis", expand_axis, axis_words},
    {"colour_bar", expand_boolean_to_mapping, switch_words},
    {"scale_bar", expand_boolean_to_mapping, switch_words},
    {"ambient_occlusion", expand_boolean_to_mapping, switch_words},
    {"edges", expand_boolean_to_mapping, switch_words},
    {"automatic", expand_boolean_to_mapping, switch_words},
    {"camera", expand_automatic_camera, "automatic"},
    {"colour_by", expand_field, "a field's name"},
    {"values", expand_number_to_list, "one number"},
    {"planes", expand_single_mapping_to_list, NULL},
    {"lights", expand_single_mapping_to_list, NULL},
    {"outputs", expand_outputs, "a path"},
    {"text", expand_single_mapping_to_list, NULL},
    {"slice", add_default_plane_to_slice, NULL},
    {"fields", expand_fields, "a mapping from names to these, or to expressions"},
    {"meshes", expand_meshes, "a mapping from names to these"},
    {"warp", expand_field, "a field's name"},
};

const char *scene_describe_short_form(const char *key, size_t length)
{
    for (size_t i = 0; i < sizeof rules / sizeof *rules; i++)
        if (strlen(rules[i].key) == length && memcmp(rules[i].key, key, length) == 0) return rules[i].words;
    return NULL;
}

/* Replaces a word in a key: the first occurrence of `from` in `text` becomes `to`, which must be at least as long. The
 * words of a key are separated by underscores. */
static void replace_word(char *text, size_t size, const char *from, const char *to)
{
    char *at = strstr(text, from);
    if (!at || strlen(text) + strlen(to) >= size) return;
    /* a plural, such as colors, is also replaced */
    const char *behind = at + strlen(from) + (at[strlen(from)] == 's');
    if ((at > text && at[-1] != '_') || (*behind && *behind != '_')) return;
    memmove(at + strlen(to), at + strlen(from), strlen(at + strlen(from)) + 1);
    /* the NUL of `to` is not copied, because the rest of the text may follow */
    for (size_t i = 0; to[i]; i++) at[i] = to[i];
}

/* Replaces American spellings in a key: color becomes colour, and center becomes centre. */
static void replace_american_spellings(rewrite *r, int *key)
{
    char text[64];
    const char *written = get_scalar_text_or_null(r, *key);
    if (!written || strlen(written) >= sizeof text - 2) return;
    snprintf(text, sizeof text, "%s", written);
    replace_word(text, sizeof text, "color", "colour");
    replace_word(text, sizeof text, "center", "centre");
    r->mark = find_node_by_index(r, *key)->start_mark;
    if (strcmp(text, written) != 0) *key = create_scalar_node(r, text);
}

static void expand_short_form_of_pair(rewrite *r, yaml_node_pair_t *pair)
{
    replace_american_spellings(r, &pair->key);
    const char *key = r->has_memory ? get_scalar_text_or_null(r, pair->key) : NULL;
    for (size_t i = 0; key && i < sizeof rules / sizeof *rules; i++) {
        if (strcmp(key, rules[i].key) != 0) continue;
        r->mark = find_node_by_index(r, pair->value)->start_mark;
        rules[i].expand(r, &pair->value);
        return;
    }
}

static void expand_short_forms_in_mapping(rewrite *r, int number)
{
    yaml_node_pair_t *kept = find_node_by_index(r, number)->data.mapping.pairs.start;
    yaml_node_pair_t *pair = kept, *end = find_node_by_index(r, number)->data.mapping.pairs.top;
    for (; pair < end && r->has_memory; pair++) {
        expand_short_form_of_pair(r, pair);
        if (pair->value) *kept++ = *pair;
    }
    if (r->has_memory) find_node_by_index(r, number)->data.mapping.pairs.top = kept;
}

/* Returns the index of the node that is the value of this key at the top of the file; 0 if the file does not have the
 * key. It is used for mappings whose keys are names that the scene defines. */
static int find_top_level_value(const rewrite *r, const char *name)
{
    const yaml_node_t *root = find_node_by_index(r, 1);
    if (!root || root->type != YAML_MAPPING_NODE) return 0;
    for (const yaml_node_pair_t *p = root->data.mapping.pairs.start; p < root->data.mapping.pairs.top; p++) {
        const char *key = get_scalar_text_or_null(r, p->key);
        if (key && strcmp(key, name) == 0) return p->value;
    }
    return 0;
}

bool scene_expand_shorthand(yaml_document_t *document)
{
    rewrite r = {.document = document, .has_memory = true};
    const int count = (int)(document->nodes.top - document->nodes.start);
    /* the keys of these mappings are names that the scene defines, and have no short forms */
    const int parameters = find_top_level_value(&r, "parameters"), fields = find_top_level_value(&r, "fields");
    const int meshes = find_top_level_value(&r, "meshes");
    for (int number = 1; number <= count && r.has_memory; number++)
        if (number != parameters && number != fields && number != meshes &&
            find_node_by_index(&r, number)->type == YAML_MAPPING_NODE)
            expand_short_forms_in_mapping(&r, number);
    return r.has_memory;
}

/* ---- suggestions for unknown words ------------------------------------------------------------------------------- */

enum { LONGEST_WORD = 63 };

static int find_smaller_integer(int a, int b)
{
    return a < b ? a : b;
}

/* Counts the edits between two words (optimal string alignment distance). */
static int compute_edit_distance(const char *a, const char *b)
{
    int rows[3][LONGEST_WORD + 1];
    const int m = (int)strlen(a), n = (int)strlen(b);
    for (int j = 0; j <= n; j++) rows[0][j] = j;
    for (int i = 1; i <= m; i++) {
        int *row = rows[i % 3];
        const int *above = rows[(i + 2) % 3], *second = rows[(i + 1) % 3];
        row[0] = i;
        for (int j = 1; j <= n; j++) {
            row[j] = find_smaller_integer(find_smaller_integer(above[j], row[j - 1]) + 1,
                                          above[j - 1] + (a[i - 1] != b[j - 1]));
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                row[j] = find_smaller_integer(row[j], second[j - 2] + 1);
        }
    }
    return rows[m % 3][n];
}

static bool is_equal_ignoring_case(const char *a, const char *b)
{
    while (*a && tolower((unsigned char)*a) == tolower((unsigned char)*b)) a++, b++;
    return !*a && !*b;
}

/* Words that other programs use, each followed by the corresponding word of the schema. */
static const char *const synonyms[][2] = {{"resolution", "size"},
                                          {"width", "size"},
                                          {"height", "size"},
                                          {"contour", "isosurface"},
                                          {"contours", "lines"},
                                          {"contour_lines", "lines"},
                                          {"linewidth", "width"},
                                          {"line_width", "width"},
                                          {"contours", "isosurface"},
                                          {"iso", "isosurface"},
                                          {"array", "field"},
                                          {"variable", "field"},
                                          {"scalar", "field"},
                                          {"scalars", "field"},
                                          {"field", "colour_by"},
                                          {"colormap", "map"},
                                          {"colour_map", "map"},
                                          {"color_map", "map"},
                                          {"cmap", "map"},
                                          {"lut", "map"},
                                          {"jet", "turbo"},
                                          {"rainbow", "turbo"},
                                          {"coolwarm", "cool_to_warm"},
                                          {"gray", "grey"},
                                          {"parallel", "orthographic"},
                                          {"ortho", "orthographic"},
                                          {"eye", "position"},
                                          {"from", "position"},
                                          {"look_at", "focal"},
                                          {"lookat", "focal"},
                                          {"focal_point", "focal"},
                                          {"view_up", "up"},
                                          {"up_vector", "up"},
                                          {"bands", "discrete"},
                                          {"log", "scale"},
                                          {"min", "range"},
                                          {"max", "range"},
                                          {"vmin", "range"},
                                          {"vmax", "range"},
                                          {"clim", "range"},
                                          {"label", "labels"},
                                          {"title", "labels"},
                                          {"wireframe", "edges"},
                                          {"representation", "edges"},
                                          {"background_colour", "background"},
                                          {"target", "focal"},
                                          {"to", "focal"},
                                          {"fov", "angle"},
                                          {"file", "path"},
                                          {"filename", "path"},
                                          {"file_name", "path"},
                                          {"isovalue", "values"},
                                          {"isovalues", "values"},
                                          {"levels", "values"},
                                          {"normal", "planes"},
                                          {"origin", "point"},
                                          {"origin", "planes"},
                                          {"point", "planes"},
                                          {"path", "outputs"},
                                          {"file", "outputs"},
                                          {"filename", "outputs"},
                                          {"plane", "planes"},
                                          {"logarithmic", "log"},
                                          {"alpha", "opacity"},
                                          {"transparency", "opacity"},
                                          {"position", "at"},
                                          {"location", "at"},
                                          {"position", "direction"},
                                          {"auto", "data"},
                                          {"direction", "automatic"},
                                          {"color", "colour"},
                                          {"yes", "true"},
                                          {"on", "true"},
                                          {"1", "true"},
                                          {"no", "false"},
                                          {"off", "false"},
                                          {"0", "false"},
                                          {"step", "cycle"},
                                          {"time", "text"},
                                          {"curl", "vorticity"},
                                          {"div", "divergence"},
                                          {"grad", "gradient"},
                                          {"qcriterion", "q_criterion"},
                                          {"q", "q_criterion"},
                                          {"shear_rate", "strain_rate"},
                                          {"formula", "expression"},
                                          {"displacement", "warp"},
                                          {"deform", "warp"},
                                          {"reflect", "mirror"},
                                          {"symmetry", "mirror"},
                                          {"vector", "field"},
                                          {"factor", "scale"},
                                          {"mesh", "meshes"},
                                          {"frequency", "every"},
                                          {"interval", "every"}};

/* Returns the first candidate that `synonyms` lists as the schema's word for the given word, or NULL if there is
 * none. */
static const char *find_candidate_with_same_meaning(const char *word, const char *const *candidates, int count)
{
    for (size_t i = 0; i < sizeof synonyms / sizeof *synonyms; i++)
        for (int k = 0; k < count; k++)
            if (is_equal_ignoring_case(word, synonyms[i][0]) && strcmp(candidates[k], synonyms[i][1]) == 0)
                return candidates[k];
    return NULL;
}

const char *scene_find_most_similar_word(const char *word, const char *const *candidates, int count)
{
    const char *synonym = find_candidate_with_same_meaning(word, candidates, count);
    if (synonym) return synonym;
    const int length = (int)strlen(word);
    const char *nearest = NULL;
    int fewest = length / 3 + 1;
    if (length < 2 || length > LONGEST_WORD) return NULL;
    for (int i = 0; i < count; i++) {
        if (strlen(candidates[i]) > LONGEST_WORD) continue;
        const int edits = compute_edit_distance(word, candidates[i]);
        if (edits >= fewest) continue;
        fewest = edits;
        nearest = candidates[i];
    }
    return nearest;
}
