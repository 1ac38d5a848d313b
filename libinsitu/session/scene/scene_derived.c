/* Reads derived fields. The session computes these fields from other fields. Each derived field has a name, and may
 * depend on other derived fields, but not on itself. */
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "scene_convert.h"

static const struct {
    const char *key;
    scene_derivation kind;
} keys[] = {{"field", SCENE_EXPRESSION},      {"magnitude", SCENE_EXPRESSION},   {"gradient", SCENE_GRADIENT_OF},
            {"divergence", SCENE_DIVERGENCE}, {"vorticity", SCENE_VORTICITY},    {"q_criterion", SCENE_Q_CRITERION},
            {"lambda2", SCENE_LAMBDA2},       {"strain_rate", SCENE_STRAIN_RATE}};
enum { KEYS = sizeof keys / sizeof *keys, KEY_SIZE = SCENE_PATH_SIZE + 16, SPACE = 3 };

#define KEY_WORDS                                                                                                      \
    "one of expression, field, magnitude, gradient, divergence, vorticity, q_criterion, lambda2 and strain_rate"

/* ---- inputs of derived fields ----------------------------------------------------------------------------------- */

static insitu_status add_input_field(const scene_document *d, const char *path, const scene_reference *reference,
                                     scene_derived *out)
{
    scene_field *inputs = base_realloc(out->inputs, (size_t)(out->input_count + 1) * sizeof *inputs);
    if (!inputs) return scene_fail_for_memory(d);
    out->inputs = inputs;
    inputs[out->input_count] = (scene_field){.name = base_strdup(reference->name),
                                             .component = reference->component,
                                             .at_vertices = true,
                                             .line = scene_get_line_number_at_path(d, path)};
    return inputs[out->input_count++].name ? INSITU_OK : scene_fail_for_memory(d);
}

static insitu_status store_expression(const scene_document *d, const char *path, const char *text, scene_derived *out)
{
    char fault[SCENE_FAULT_SIZE];
    insitu_status status = INSITU_OK;
    const scene_parse_result result = scene_parse_expression(text, &out->expression, fault);
    if (result == SCENE_NO_MEMORY) return scene_fail_for_memory(d);
    if (result == SCENE_FAULTY) return scene_fail_at_key(d, path, "", "%s", fault);
    if (out->expression.input_count == 0)
        return scene_fail_at_key(d, path, "", "\"%.60s\" names no field, expected one at least", text);
    for (int i = 0; i < out->expression.input_count && !status; i++)
        status = add_input_field(d, path, &out->expression.inputs[i], out);
    return status;
}

/* Reads a text that consists of the name of a field, which may be followed by a component, and adds this field to the
 * inputs. Any other text is an error. */
static insitu_status parse_and_add_input_field(const scene_document *d, const char *path, const char *text,
                                               scene_derived *out)
{
    scene_expression one;
    char fault[SCENE_FAULT_SIZE];
    const scene_parse_result result = scene_parse_expression(text, &one, fault);
    if (result == SCENE_NO_MEMORY) return scene_fail_for_memory(d);
    if (result == SCENE_FAULTY) return scene_fail_at_key(d, path, "", "%s", fault);
    insitu_status status = INSITU_OK;
    if (one.count != 1 || one.input_count != 1 || one.inputs[0].component == SCENE_COMPONENT_MAGNITUDE)
        status = scene_fail_at_key(
            d, path, "",
            "\"%.60s\" is an expression, expected the name of a field: make it a derived field of its "
            "own, and name that",
            text);
    else
        status = add_input_field(d, path, &one.inputs[0], out);
    scene_expression_free(&one);
    return status;
}

/* Reads the input at the path: a single field, or a list of the components of a vector, each of which is a scalar. */
static insitu_status read_references(const scene_document *d, const char *path, scene_derived *out)
{
    const char *texts[SPACE];
    const int count = scene_list_texts_at_path(d, path, texts, SPACE);
    const bool is_list = scene_get_node_type_at_path(d, path) == SCENE_LIST;
    insitu_status status = INSITU_OK;
    if (is_list && (out->kind == SCENE_GRADIENT_OF || count < 2 || count > SPACE))
        return scene_fail_at_key(d, path, "", "a list of %d is not allowed, expected %s", count,
                                 out->kind == SCENE_GRADIENT_OF ? "the name of a field"
                                                                : "the name of a field, or a list of 2 or 3 scalars");
    for (int i = 0; i < count && !status; i++) status = parse_and_add_input_field(d, path, texts[i], out);
    for (int i = 0; i < out->input_count && !is_list && !status; i++)
        if (out->inputs[i].component >= 0 && out->kind != SCENE_GRADIENT_OF)
            status = scene_fail_at_key(d, path, "", "\"%.60s\" is a component, expected a field of 2 or 3 components",
                                       texts[i]);
    return status;
}

/* Reads the field that the key `field` or `magnitude` of a derived field names. The derived field becomes an expression
 * that consists only of this input, with the given component. */
static insitu_status read_single_input_field(const scene_document *d, const char *path, int component,
                                             scene_derived *out)
{
    const char *text = NULL;
    if (scene_get_node_type_at_path(d, path) == SCENE_LIST)
        return scene_fail_at_key(d, path, "", "a list is not allowed, expected the name of a field");
    scene_list_texts_at_path(d, path, &text, 1);
    insitu_status status = parse_and_add_input_field(d, path, text, out);
    if (status) return status;
    if (out->inputs[0].component >= 0)
        return scene_fail_at_key(d, path, "", "\"%.60s\" is a component, expected the name of a field", text);
    out->inputs[0].component = component;
    scene_instruction *program = base_alloc(sizeof *program);
    if (!program) return scene_fail_for_memory(d);
    *program = (scene_instruction){SCENE_OP_PUSH_INPUT, 0, 0};
    out->expression = (scene_expression){.count = 1, .instructions = program, .depth = 1};
    return INSITU_OK;
}

/* ---- conversion of one derived field ---------------------------------------------------------------------------- */

/* Finds the key of a derived field that tells how the field is computed, such as `gradient`, and checks that there is
 * exactly one. *found receives the key's index in `keys`, or -1 for an expression. */
static insitu_status find_key_of_operation(const scene_document *d, const char *path, const scene_file_derived *in,
                                           int *found)
{
    const char *first = in->expression ? "expression" : NULL;
    *found = -1;
    for (int i = 0; i < KEYS; i++) {
        char key_path[KEY_SIZE];
        snprintf(key_path, sizeof key_path, "%s.%s", path, keys[i].key);
        if (scene_get_node_type_at_path(d, key_path) == SCENE_NOTHING) continue;
        if (first) return scene_fail_at_key(d, path, keys[i].key, "given beside %s, expected one of the two", first);
        first = keys[i].key;
        *found = i;
    }
    return first ? INSITU_OK : scene_fail_at_key(d, path, "", "says not what it is, expected " KEY_WORDS);
}

static bool takes_component(int key)
{
    return key >= 0 && (strcmp(keys[key].key, "field") == 0 || keys[key].kind == SCENE_GRADIENT_OF ||
                        keys[key].kind == SCENE_VORTICITY);
}

static insitu_status check_name_of_derived_field(const scene_document *d, const char *path, const scene *s,
                                                 const char *name)
{
    if (name[strcspn(name, ".[]\"'")])
        return scene_fail_at_key(
            d, path, "", "\"%.60s\" is no name for a derived field, expected one without . [ ] and quotes", name);
    for (int i = 0; i < s->derived_count; i++)
        if (s->derived[i].name && strcmp(s->derived[i].name, name) == 0)
            return scene_fail_at_key(d, path, "", "the name is given twice, expected it once");
    return INSITU_OK;
}

static insitu_status convert_derived(const scene_document *d, const char *path, const scene_file_derived *in, scene *s,
                                     scene_derived *out)
{
    char key_path[KEY_SIZE];
    int key = -1;
    out->line = scene_get_line_number_at_path(d, path);
    insitu_status status = check_name_of_derived_field(d, path, s, in->name);
    out->name = base_strdup(in->name);
    if (!out->name) return scene_fail_for_memory(d);
    if (!status) status = find_key_of_operation(d, path, in, &key);
    if (!status) status = scene_convert_component(d, path, in->component, &out->component);
    if (!status && in->component && !takes_component(key))
        status =
            scene_fail_at_key(d, path, "component", "given beside %s, expected it beside field, gradient or vorticity",
                              key < 0 ? "expression" : keys[key].key);
    if (!status && key >= 0 && keys[key].kind != SCENE_EXPRESSION && out->component >= SPACE)
        status = scene_fail_at_key(d, path, "component", "is %d, expected magnitude, x, y, z or a number from 0 to 2",
                                   out->component);
    if (status) return status;
    out->key = key < 0 ? "" : keys[key].key;
    out->kind = key < 0 ? SCENE_EXPRESSION : keys[key].kind;
    snprintf(key_path, sizeof key_path, "%s%s%s", path, key < 0 ? "" : ".", out->key);
    if (key < 0) return store_expression(d, path, in->expression, out);
    if (out->kind == SCENE_EXPRESSION)
        return read_single_input_field(d, key_path, takes_component(key) ? out->component : SCENE_COMPONENT_MAGNITUDE,
                                       out);
    return read_references(d, key_path, out);
}

/* ---- dependencies between derived fields ------------------------------------------------------------------------- */

int scene_find_derived(const scene *s, const char *name)
{
    for (int i = 0; i < s->derived_count && name; i++)
        if (strcmp(s->derived[i].name, name) == 0) return i;
    return -1;
}

/* The state of a depth-first search along dependencies. It sorts the derived fields so that each comes after the fields
 * on which it depends. */
typedef struct search {
    const scene_document *d;
    scene *s;
    /* the chain of fields that the search follows: from the field at which the search began to the current field, each
     * followed by a field on which it depends */
    int path[SCENE_MAX_DERIVED], length;
    int order[SCENE_MAX_DERIVED], count; /* indices of the sorted fields, and their number */
    bool is_done[SCENE_MAX_DERIVED];
} search;

static insitu_status fail_for_dependency_cycle(const search *w, int first)
{
    char circle[300] = "";
    const scene_derived *fields = w->s->derived;
    size_t size = 0;
    char path[SCENE_PATH_SIZE];
    snprintf(path, sizeof path, "fields.%.100s", fields[w->path[first]].name);
    for (int i = first + 1; i < w->length && size < sizeof circle - 80; i++)
        size +=
            (size_t)snprintf(circle + size, sizeof circle - size, "%.60s, which is made of ", fields[w->path[i]].name);
    return scene_fail_at_key(w->d, path, "", "is made of %s%s: expected fields that are not made of themselves", circle,
                             w->length == first + 1 ? "itself" : fields[w->path[first]].name);
}

static insitu_status visit_dependencies_of_field(search *w, int at)
{
    scene_derived *field = &w->s->derived[at];
    insitu_status status = INSITU_OK;
    if (w->is_done[at]) return INSITU_OK;
    for (int i = 0; i < w->length; i++)
        if (w->path[i] == at) return fail_for_dependency_cycle(w, i);
    w->path[w->length++] = at;
    for (int i = 0; i < field->input_count && !status; i++) {
        const int source = scene_find_derived(w->s, field->inputs[i].name);
        if (source >= 0) status = visit_dependencies_of_field(w, source);
    }
    w->length--;
    w->is_done[at] = true;
    if (!status) w->order[w->count++] = at;
    return status;
}

static insitu_status sort_derived_fields_by_dependency(const scene_document *d, scene *s)
{
    search w = {.d = d, .s = s};
    insitu_status status = INSITU_OK;
    scene_derived *sorted = base_calloc((size_t)s->derived_count, sizeof *sorted);
    if (!sorted) return scene_fail_for_memory(d);
    for (int i = 0; i < s->derived_count && !status; i++) status = visit_dependencies_of_field(&w, i);
    for (int i = 0; i < s->derived_count && !status; i++) sorted[i] = s->derived[w.order[i]];
    if (!status) memcpy(s->derived, sorted, (size_t)s->derived_count * sizeof *sorted);
    base_free(sorted);
    for (int i = 0; i < s->derived_count && !status; i++) {
        scene_derived *field = &s->derived[i];
        field->derived_indices = base_calloc((size_t)field->input_count, sizeof *field->derived_indices);
        if (!field->derived_indices) return scene_fail_for_memory(d);
        for (int k = 0; k < field->input_count; k++)
            field->derived_indices[k] = scene_find_derived(s, field->inputs[k].name);
    }
    return status;
}

insitu_status scene_convert_derived(const scene_document *d, const scene_file *in, scene *out)
{
    insitu_status status = INSITU_OK;
    if (in->fields_count == 0) return INSITU_OK;
    out->derived = base_calloc((size_t)in->fields_count, sizeof *out->derived);
    if (!out->derived) return scene_fail_for_memory(d);
    for (int i = 0; i < in->fields_count && !status; i++) {
        const char *name = in->fields[i].name;
        char path[SCENE_PATH_SIZE];
        if (scene_is_valid_path_name(name))
            snprintf(path, sizeof path, "fields.%s", name);
        else
            snprintf(path, sizeof path, "fields[%d]", i);
        status = convert_derived(d, path, &in->fields[i], out, &out->derived[out->derived_count]);
        out->derived_count++;
    }
    return status ? status : sort_derived_fields_by_dependency(d, out);
}

void scene_free_derived(scene *s)
{
    for (int i = 0; i < s->derived_count; i++) {
        scene_derived *field = &s->derived[i];
        for (int k = 0; k < field->input_count; k++) scene_free_field(&field->inputs[k]);
        base_free(field->inputs);
        base_free(field->derived_indices);
        base_free(field->name);
        scene_expression_free(&field->expression);
    }
    base_free(s->derived);
}
