/* Reads a scene file twice. The first pass reads it as events, to reject dangerous input before memory is allocated for
 * it: deep nesting, and aliases, by which a few lines can expand to billions of nodes. The second pass reads it as a
 * tree. The tree is checked against the schema in this file, because a message needs the value, its key and its line,
 * and all three are known only here. The check also stores correct values in the schema's structs. */
#include "scene_document.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "scene_shorthand.h"
#include "scene_syntax.h"
#include "scene_words.h"

enum { path_size = 256, quote_size = 48, question_size = 96, list_size = 64, most_words = 64, most_plain = 60 };

/* A block of memory for the schema's structs: the link to the next block of the list, followed by the memory itself,
 * which is aligned for any type. */
struct scene_block {
    scene_block *next;
    max_align_t memory[];
};

static insitu_status fail_at_line(const scene_document *d, size_t line, const char *what)
{
    return base_fail(d->error, INSITU_ERROR_SCENE, "%.300s:%zu: %s", d->file_name, line, what);
}

/* ---- text to tree ---- */

static size_t count_lines_before(const char *text, size_t size, size_t offset)
{
    size_t lines = 0;
    for (size_t i = 0; i < size && i < offset; i++) lines += text[i] == '\n';
    return lines;
}

static insitu_status report_yaml_parser_error(const scene_document *d, const yaml_parser_t *parser, const char *text,
                                              size_t size)
{
    /* libyaml does not set an error for some failed allocations */
    if (parser->error == YAML_MEMORY_ERROR || parser->error == YAML_NO_ERROR) {
        return base_fail(d->error, INSITU_ERROR_MEMORY, "%.300s: no memory to read it", d->file_name);
    }
    size_t line;
    char what[SCENE_SYNTAX_SIZE];
    if (parser->error == YAML_READER_ERROR) { /* reader errors have an offset, but no line */
        line = count_lines_before(text, size, parser->problem_offset) + 1;
        snprintf(what, sizeof what, "not valid YAML: %.100s", parser->problem ? parser->problem : "unreadable");
    } else {
        scene_describe_syntax_error(parser, text, size, &line, what);
    }
    return fail_at_line(d, line, what);
}

static const char *find_unsupported_yaml_feature(const yaml_event_t *event, int *depth, int *documents)
{
    const yaml_char_t *anchor = NULL, *tag = NULL;
    switch (event->type) {
    case YAML_ALIAS_EVENT: return "an alias (*) is not allowed in a scene, expected the value itself";
    case YAML_DOCUMENT_START_EVENT:
        return ++*documents > 1 ? "a second document begins (---), expected one a file" : NULL;
    case YAML_SCALAR_EVENT: anchor = event->data.scalar.anchor, tag = event->data.scalar.tag; break;
    case YAML_SEQUENCE_START_EVENT:
        anchor = event->data.sequence_start.anchor, tag = event->data.sequence_start.tag, ++*depth;
        break;
    case YAML_MAPPING_START_EVENT:
        anchor = event->data.mapping_start.anchor, tag = event->data.mapping_start.tag, ++*depth;
        break;
    case YAML_SEQUENCE_END_EVENT:
    case YAML_MAPPING_END_EVENT: --*depth; break;
    default: break;
    }
    if (anchor) return "an anchor (&) is not allowed in a scene, expected the value alone";
    if (tag) return "a tag (!) is not allowed in a scene, expected the value alone";
    return *depth > SCENE_MAX_DEPTH ? "lists and mappings are nested too deep, expected at most 16 levels" : NULL;
}

static insitu_status check_yaml_events(const scene_document *d, const char *text, size_t size)
{
    yaml_parser_t parser;
    if (!yaml_parser_initialize(&parser)) {
        return base_fail(d->error, INSITU_ERROR_MEMORY, "%.300s: no memory to read it", d->file_name);
    }
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, size);
    insitu_status status = INSITU_OK;
    int depth = 0, documents = 0;
    for (bool is_end = false; status == INSITU_OK && !is_end;) {
        yaml_event_t event;
        if (!yaml_parser_parse(&parser, &event)) {
            status = report_yaml_parser_error(d, &parser, text, size);
            break;
        }
        const char *fault = find_unsupported_yaml_feature(&event, &depth, &documents);
        if (fault) status = fail_at_line(d, event.start_mark.line + 1, fault);
        is_end = event.type == YAML_STREAM_END_EVENT;
        yaml_event_delete(&event);
    }
    yaml_parser_delete(&parser);
    if (status == INSITU_OK && documents == 0)
        status = fail_at_line(d, 1, "the file is empty, expected the key images");
    return status;
}

insitu_status scene_document_open(scene_document *d, const char *text, size_t size, const char *file_name,
                                  base_error *error)
{
    *d = (scene_document){.file_name = file_name, .error = error, .text = text, .size = size};
    if (size > SCENE_MAX_BYTES) {
        return base_fail(error, INSITU_ERROR_SCENE, "%.300s:1: the file has %zu bytes, expected at most %d", file_name,
                         size, SCENE_MAX_BYTES);
    }
    insitu_status status = check_yaml_events(d, text, size);
    if (status != INSITU_OK) return status;

    yaml_parser_t parser;
    if (!yaml_parser_initialize(&parser)) {
        return base_fail(error, INSITU_ERROR_MEMORY, "%.300s: no memory to read it", file_name);
    }
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, size);
    if (!yaml_parser_load(&parser, &d->yaml)) status = report_yaml_parser_error(d, &parser, text, size);
    yaml_parser_delete(&parser);
    if (status == INSITU_OK && !scene_expand_shorthand(&d->yaml)) {
        scene_document_close(d);
        status = scene_fail_for_memory(d);
    }
    return status;
}

void scene_document_close(scene_document *d)
{
    yaml_document_delete(&d->yaml);
    while (d->blocks) {
        scene_block *next = d->blocks->next;
        base_free(d->blocks);
        d->blocks = next;
    }
}

/* ---- nodes and paths ---- */

static yaml_node_t *find_node_by_index(const scene_document *d, int index)
{
    return yaml_document_get_node((yaml_document_t *)&d->yaml, index);
}

static int get_line_number_of_node(const yaml_node_t *node)
{
    return (int)node->start_mark.line + 1;
}

static int count_items(const yaml_node_t *list)
{
    return (int)(list->data.sequence.items.top - list->data.sequence.items.start);
}

static const char *get_text_of_scalar(const yaml_node_t *scalar)
{
    return (const char *)scalar->data.scalar.value;
}

/* Writes the node's text in quotes, shortened for a message. */
static void write_quoted_node_text(const yaml_node_t *node, char quoted[quote_size])
{
    if (node->type == YAML_SEQUENCE_NODE) {
        snprintf(quoted, quote_size, "a list");
    } else if (node->type == YAML_MAPPING_NODE) {
        snprintf(quoted, quote_size, "a mapping");
    } else if (node->data.scalar.length == 0) {
        snprintf(quoted, quote_size, "nothing");
    } else {
        const bool is_long = node->data.scalar.length > 36;
        snprintf(quoted, quote_size, "\"%.36s%s\"", get_text_of_scalar(node), is_long ? "..." : "");
    }
}

static const yaml_node_pair_t *find_key_value_pair(const scene_document *d, const yaml_node_t *mapping,
                                                   const char *name, size_t length)
{
    for (const yaml_node_pair_t *p = mapping->data.mapping.pairs.start; p < mapping->data.mapping.pairs.top; p++) {
        const yaml_node_t *key = find_node_by_index(d, p->key);
        const bool is_it = key->type == YAML_SCALAR_NODE && key->data.scalar.length == length &&
                           memcmp(key->data.scalar.value, name, length) == 0;
        if (is_it) return p;
    }
    return NULL;
}

bool scene_is_valid_path_name(const char *name)
{
    return *name && strlen(name) <= most_plain && !name[strcspn(name, ".[")];
}

/* Returns the mapping in a list whose value of the key "name" is the string `name` of `length` bytes; NULL if there is
 * none. */
static const yaml_node_t *find_entry_by_name(const scene_document *d, const yaml_node_t *list, const char *name,
                                             size_t length)
{
    for (int i = 0; i < count_items(list); i++) {
        const yaml_node_t *entry = find_node_by_index(d, list->data.sequence.items.start[i]);
        const yaml_node_pair_t *pair =
            entry->type == YAML_MAPPING_NODE ? find_key_value_pair(d, entry, "name", 4) : NULL;
        const yaml_node_t *text = pair ? find_node_by_index(d, pair->value) : NULL;
        if (text && text->type == YAML_SCALAR_NODE && text->data.scalar.length == length &&
            memcmp(text->data.scalar.value, name, length) == 0)
            return entry;
    }
    return NULL;
}

/* Returns the node at a path, or NULL if there is none. *line receives the line of the node, or of the deepest node of
 * the path that exists. */
static const yaml_node_t *find_node_at_path(const scene_document *d, const char *path, int *line)
{
    const yaml_node_t *node = yaml_document_get_root_node((yaml_document_t *)&d->yaml);
    *line = get_line_number_of_node(node);
    while (*path) {
        if (*path == '[') {
            char *end;
            const long index = strtol(path + 1, &end, 10);
            if (node->type != YAML_SEQUENCE_NODE || index >= count_items(node)) return NULL;
            node = find_node_by_index(d, node->data.sequence.items.start[index]);
            *line = get_line_number_of_node(node);
            path = end + 1;
        } else {
            path += *path == '.';
            const size_t length = strcspn(path, ".[");
            if (node->type == YAML_SEQUENCE_NODE) {
                node = find_entry_by_name(d, node, path, length);
                if (!node) return NULL;
                *line = get_line_number_of_node(node);
                path += length;
                continue;
            }
            if (node->type != YAML_MAPPING_NODE) return NULL;
            const yaml_node_pair_t *pair = find_key_value_pair(d, node, path, length);
            if (!pair) return NULL;
            *line = get_line_number_of_node(find_node_by_index(d, pair->key));
            node = find_node_by_index(d, pair->value);
            path += length;
        }
    }
    return node;
}

int scene_get_line_number_at_path(const scene_document *d, const char *path)
{
    int line;
    find_node_at_path(d, path, &line);
    return line;
}

int scene_list_texts_at_path(const scene_document *d, const char *path, const char **texts, int most)
{
    int line;
    const yaml_node_t *node = find_node_at_path(d, path, &line);
    if (!node) return 0;
    if (node->type == YAML_SCALAR_NODE) {
        if (most > 0) texts[0] = get_text_of_scalar(node);
        return 1;
    }
    const int count = count_items(node);
    for (int i = 0; i < count && i < most; i++)
        texts[i] = get_text_of_scalar(find_node_by_index(d, node->data.sequence.items.start[i]));
    return count;
}

int scene_list_keys_at_path(const scene_document *d, const char *path, const char **names, int most)
{
    int line, count = 0;
    const yaml_node_t *node = find_node_at_path(d, path, &line);
    if (!node || node->type != YAML_MAPPING_NODE) return 0;
    for (const yaml_node_pair_t *p = node->data.mapping.pairs.start; p < node->data.mapping.pairs.top; p++, count++)
        if (count < most) names[count] = get_text_of_scalar(find_node_by_index(d, p->key));
    return count;
}

scene_node scene_get_node_type_at_path(const scene_document *d, const char *path)
{
    int line;
    const yaml_node_t *node = find_node_at_path(d, path, &line);
    if (!node) return SCENE_NOTHING;
    return node->type == YAML_SCALAR_NODE     ? SCENE_SCALAR
           : node->type == YAML_SEQUENCE_NODE ? SCENE_LIST
                                              : SCENE_MAPPING;
}

int scene_get_list_length_at_path(const scene_document *d, const char *path)
{
    int line;
    const yaml_node_t *node = find_node_at_path(d, path, &line);
    return node && node->type == YAML_SEQUENCE_NODE ? count_items(node) : 0;
}

double scene_get_number_at_path(const scene_document *d, const char *path)
{
    int line;
    const yaml_node_t *node = find_node_at_path(d, path, &line);
    return node && node->type == YAML_SCALAR_NODE ? strtod(get_text_of_scalar(node), NULL) : 0;
}

insitu_status scene_fail_for_memory(const scene_document *d)
{
    return base_fail(d->error, INSITU_ERROR_MEMORY, "%.300s: no memory for the scene", d->file_name);
}

insitu_status scene_fail_at_key(const scene_document *d, const char *parent, const char *key, const char *format, ...)
{
    char path[path_size], what[sizeof d->error->message / 2];
    snprintf(path, sizeof path, "%s%s%s", parent, *parent && *key && *key != '[' ? "." : "", key);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    return base_fail(d->error, INSITU_ERROR_SCENE, "%.300s:%d: %s%s%s", d->file_name,
                     scene_get_line_number_at_path(d, path), path, *path ? ": " : "", what);
}

/* ---- check of the tree against the schema ---- */

/* Writes a question that suggests the candidate nearest to the word, or "" if none is near. */
static void suggest_candidate(const yaml_node_t *word, const char *const *candidates, int count,
                              char question[question_size])
{
    const char *meant = word->type == YAML_SCALAR_NODE
                            ? scene_find_most_similar_word(get_text_of_scalar(word), candidates, count)
                            : NULL;
    question[0] = '\0';
    if (meant) snprintf(question, question_size, " (did you mean %.64s?)", meant);
}

/* Lists the words that the schema allows as a value, in all forms of the value. Returns their number, at most
 * `most`. */
static int list_allowed_words(const cyaml_schema_value_t *value, const scene_key *key, const char **words, int most)
{
    int count = 0;
    if (value->type == CYAML_BOOL && most > 1) {
        words[count++] = "true";
        words[count++] = "false";
    }
    if (value->type == CYAML_ENUM)
        for (uint32_t i = 0; i < value->enumeration.count && count < most; i++)
            words[count++] = value->enumeration.strings[i].str;
    for (int i = 0; value->type == CYAML_IGNORE && i < key->form_count; i++)
        count += list_allowed_words(&key->forms[i].value, &key->forms[i].key, words + count, most - count);
    return count;
}

/* Converts a text of numbers such as "640x480" or "0 0 5" into the text of the list that was probably meant, or "" if
 * the text does not consist of numbers. */
static void convert_text_to_list(const char *text, const cyaml_schema_value_t *value, char list[list_size])
{
    static const char between[] = " ,;x*()";
    size_t used = 0;
    uint32_t count = 0;
    list[0] = '\0';
    for (const char *at = text + strspn(text, between); *at; at += strspn(at, between)) {
        const size_t length = strcspn(at, between);
        if (strspn(at, "+-.0123456789eE") != length || used + length + 4 > list_size) count = value->sequence.max;
        if (count++ == value->sequence.max) break;
        used += (size_t)snprintf(list + used, list_size - used, "%s%.*s", used ? ", " : "[", (int)length, at);
        at += length;
    }
    const bool is_right = count >= value->sequence.min && count <= value->sequence.max;
    snprintf(list + used, list_size - used, "]");
    if (!is_right) list[0] = '\0';
}

static bool parse_finite_number(const char *text, double *number)
{
    char *end;
    /* strtod() would also accept nan, inf and hexadecimal numbers */
    if (text[strspn(text, "+-.0123456789eE")]) return false;
    *number = strtod(text, &end);
    return end != text && !*end && isfinite(*number);
}

/* Writes a question that suggests why a value is empty: YAML reads an unquoted #ff0000 as a comment, or the keys below
 * the value are not indented. */
static void suggest_for_empty_value(const scene_document *d, const yaml_node_t *node, const cyaml_schema_value_t *value,
                                    char question[question_size])
{
    size_t length;
    const char *colour = scene_find_colour_in_comment(d->text, d->size, (size_t)get_line_number_of_node(node), &length);
    if (colour)
        snprintf(question, question_size, " (did you mean \"%.*s\" in quotes?)", (int)length, colour);
    else if (value->type == CYAML_MAPPING)
        snprintf(question, question_size, " (its keys stand on the next lines, further in, or in { })");
}

static bool mapping_has_key(const cyaml_schema_value_t *mapping, const char *key)
{
    const cyaml_schema_field_t *f = mapping->mapping.fields;
    while (f->key && strcmp(f->key, key) != 0) f++;
    return f->key != NULL;
}

/* Writes a question about a word that stands in place of a mapping. It suggests the mapping that was probably meant if
 * the word is one of the mapping's keys or can be the name of a field. */
static void suggest_mapping(const char *word, const cyaml_schema_value_t *mapping, const char *begin, const char *end,
                            char question[question_size])
{
    double number;
    for (const char *at = word; *at; at++)
        if (!isalnum((unsigned char)*at) && *at != '_') return;
    if (mapping_has_key(mapping, word))
        snprintf(question, question_size, " (did you mean %s%.32s: {}%s?)", begin, word, end);
    else if (mapping_has_key(mapping, "field") && !parse_finite_number(word, &number))
        snprintf(question, question_size, " (did you mean %sfield: %.32s%s?)", begin, word, end);
}

/* Writes a question about a mapping that stands in place of a list of mappings. The author may have written entries
 * under their names, or omitted a "- ". */
static void suggest_list_of_mappings(const scene_document *d, const yaml_node_t *node,
                                     const cyaml_schema_value_t *entry, char question[question_size])
{
    const bool is_empty = node->data.mapping.pairs.top == node->data.mapping.pairs.start;
    const yaml_node_t *first = is_empty ? NULL : find_node_by_index(d, node->data.mapping.pairs.start->key);
    const char *name = first && first->type == YAML_SCALAR_NODE ? get_text_of_scalar(first) : NULL;
    if (name && mapping_has_key(entry, "name") && !mapping_has_key(entry, name))
        snprintf(question, question_size, " (did you mean \"- name: %.32s\"?)", name);
    else
        snprintf(question, question_size, " (is a \"- \" missing before its first key?)");
}

/* Writes a question that suggests another form in which the value would be valid: in quotes, as a list, or as an entry
 * of a list. */
static void suggest_valid_form_of_value(const scene_document *d, const yaml_node_t *node,
                                        const cyaml_schema_value_t *value, const scene_key *key,
                                        char question[question_size])
{
    const bool is_list = value->type == CYAML_SEQUENCE || value->type == CYAML_SEQUENCE_FIXED;
    const cyaml_type_e entry = is_list ? value->sequence.entry->type : CYAML_IGNORE;
    char list[list_size] = "";
    double number;
    if (node->type == YAML_SCALAR_NODE && node->data.scalar.length == 0) {
        suggest_for_empty_value(d, node, value, question);
    } else if (node->type == YAML_SCALAR_NODE && is_list) {
        const char *text = get_text_of_scalar(node), *digits = text + (strncmp(text, "0x", 2) == 0 ? 2 : 0);
        if (entry == CYAML_INT || entry == CYAML_FLOAT) convert_text_to_list(text, value, list);
        if (scene_is_colour_schema(value, key) && strspn(digits, "0123456789abcdefABCDEF") == 6 && !digits[6])
            snprintf(question, question_size, " (did you mean \"#%s\" in quotes?)", digits);
        else if (*list)
            snprintf(question, question_size, " (did you mean %s?)", list);
        else if (entry == CYAML_SEQUENCE_FIXED && value->sequence.entry->sequence.max == 2 &&
                 parse_finite_number(text, &number))
            snprintf(question, question_size, " (did you mean [[0, %.24s], [1, %.24s]]?)", text, text);
        else if (entry == CYAML_MAPPING)
            suggest_mapping(text, value->sequence.entry, "[{", "}]", question);
    } else if (node->type == YAML_SCALAR_NODE && value->type == CYAML_MAPPING) {
        suggest_mapping(get_text_of_scalar(node), value, "{", "}", question);
    } else if (node->type == YAML_MAPPING_NODE && entry == CYAML_MAPPING) {
        suggest_list_of_mappings(d, node, value->sequence.entry, question);
    } else if (node->type == YAML_MAPPING_NODE && node->data.mapping.pairs.top - node->data.mapping.pairs.start == 1) {
        const yaml_node_t *name = find_node_by_index(d, node->data.mapping.pairs.start->key);
        const yaml_node_t *rest = find_node_by_index(d, node->data.mapping.pairs.start->value);
        if (name->type == YAML_SCALAR_NODE && rest->type == YAML_SCALAR_NODE && rest->data.scalar.length == 0)
            snprintf(question, question_size, " (did you mean \"{%.32s}\" in quotes?)", get_text_of_scalar(name));
    }
}

static insitu_status fail_for_invalid_value(const scene_document *d, const char *path, const yaml_node_t *node,
                                            const cyaml_schema_value_t *value, const scene_key *key)
{
    const char *words[most_words];
    char quoted[quote_size], expected[SCENE_WORDS_SIZE], question[question_size];
    write_quoted_node_text(node, quoted);
    scene_describe_expected_value(path, value, key, expected);
    int count = list_allowed_words(value, key, words, most_words);
    const bool is_switch = count == 0 && strstr(expected, "true or false");
    if (is_switch) words[count++] = "true", words[count++] = "false";
    suggest_candidate(node, words, count, question);
    if (!*question) suggest_valid_form_of_value(d, node, value, key, question);
    const bool is_entry = *path && path[strlen(path) - 1] == ']';
    if (!*question && is_entry && value->type == CYAML_SEQUENCE_FIXED && node->type == YAML_SCALAR_NODE)
        snprintf(question, question_size, " (each entry is a list of its own, in [ ])");
    return scene_fail_at_key(d, path, "", "%s is not allowed%s, expected %s", quoted, question, expected);
}

/* Reads a decimal whole number. A leading zero is rejected, because 010 could mean 10 or 8. */
static bool parse_decimal_integer(const char *text, double *number)
{
    const char *digits = text + (*text == '-' || *text == '+');
    const size_t count = strspn(digits, "0123456789");
    if (count == 0 || digits[count] || (count > 1 && digits[0] == '0')) return false;
    *number = strtod(text, NULL);
    return true;
}

static bool is_in_range(double number, const scene_key *key)
{
    if (key->low == 0 && key->high == 0) return true;
    if (key->is_low_excluded ? number <= key->low : number < key->low) return false;
    return key->is_high_excluded ? number < key->high : number <= key->high;
}

/* Returns the schema's choice whose word is this text, or NULL if there is none. */
static const cyaml_strval_t *find_enum_entry(const char *text, const cyaml_schema_value_t *value)
{
    for (uint32_t i = 0; i < value->enumeration.count; i++) {
        if (strcmp(text, value->enumeration.strings[i].str) == 0) return &value->enumeration.strings[i];
    }
    return NULL;
}

static bool is_valid_scalar(const yaml_node_t *node, const cyaml_schema_value_t *value, const scene_key *key)
{
    if (node->type != YAML_SCALAR_NODE) return false;
    const char *text = get_text_of_scalar(node);
    const size_t length = strlen(text);
    if (length != node->data.scalar.length) return false; /* false for a text that contains a NUL */
    double number;
    switch (value->type) {
    case CYAML_INT: return parse_decimal_integer(text, &number) && is_in_range(number, key);
    case CYAML_FLOAT: return parse_finite_number(text, &number) && is_in_range(number, key);
    case CYAML_BOOL: return strcmp(text, "true") == 0 || strcmp(text, "false") == 0;
    case CYAML_ENUM: return find_enum_entry(text, value) != NULL;
    case CYAML_IGNORE: return length >= 1 && length <= SCENE_NAME_BYTES;
    default: return length >= value->string.min && length <= value->string.max;
    }
}

/* Sets *to to the address at which `count` values are to be stored. If the schema describes the member at *to as a
 * pointer, allocates memory for the values, and stores its address in this member. If *to is NULL on entry, nothing is
 * done, because the value will be read from the tree of the document. */
static bool allocate_values(scene_document *d, const cyaml_schema_value_t *value, int count, void **to)
{
    if (!*to || !(value->flags & CYAML_FLAG_POINTER)) return true;
    scene_block *block = base_calloc(1, sizeof *block + (size_t)count * value->data_size);
    if (!block) return false;
    block->next = d->blocks;
    d->blocks = block;
    void *made = block->memory;
    memcpy(*to, &made, sizeof made);
    *to = made;
    return true;
}

/* Stores a scalar that has been checked. Texts remain owned by the document. */
static insitu_status store_scalar(scene_document *d, const yaml_node_t *node, const cyaml_schema_value_t *value,
                                  void *to)
{
    const char *text = get_text_of_scalar(node);
    if (to && value->type == CYAML_STRING) memcpy(to, &text, sizeof text);
    if (!to || value->type == CYAML_STRING) return INSITU_OK;
    if (!allocate_values(d, value, 1, &to)) return scene_fail_for_memory(d);
    switch (value->type) {
    case CYAML_INT: *(int *)to = (int)strtol(text, NULL, 10); break;
    case CYAML_ENUM: *(int *)to = (int)find_enum_entry(text, value)->val; break;
    case CYAML_BOOL: *(bool *)to = *text == 't'; break;
    default: *(double *)to = strtod(text, NULL); break;
    }
    return INSITU_OK;
}

static insitu_status check_and_store_value(scene_document *d, const char *path, const yaml_node_t *node,
                                           const cyaml_schema_value_t *value, const scene_key *key, void *to);

/* Writes the path of an entry of a list. The last part of the path is the entry's name if it has one, and otherwise its
 * index. */
static void write_path_of_list_entry(const scene_document *d, const char *path, const yaml_node_t *list,
                                     const scene_key *key, int index, char out[path_size])
{
    const yaml_node_t *entry = find_node_by_index(d, list->data.sequence.items.start[index]);
    const yaml_node_pair_t *pair =
        key->is_named && entry->type == YAML_MAPPING_NODE ? find_key_value_pair(d, entry, "name", 4) : NULL;
    const yaml_node_t *name = pair ? find_node_by_index(d, pair->value) : NULL;
    if (name && name->type == YAML_SCALAR_NODE && scene_is_valid_path_name(get_text_of_scalar(name)))
        snprintf(out, path_size, "%s.%s", path, get_text_of_scalar(name));
    else
        snprintf(out, path_size, "%s[%d]", path, index);
}

static insitu_status fail_for_list_length(const scene_document *d, const char *path, int count,
                                          const cyaml_schema_value_t *value, const scene_key *key)
{
    char expected[SCENE_WORDS_SIZE];
    scene_describe_value(value, key, expected);
    return scene_fail_at_key(d, path, "", "a list of %d is not allowed, expected %s", count, expected);
}

static insitu_status check_and_store_list(scene_document *d, const char *path, const yaml_node_t *node,
                                          const cyaml_schema_value_t *value, const scene_key *key, void *to)
{
    if (node->type != YAML_SEQUENCE_NODE) return fail_for_invalid_value(d, path, node, value, key);
    const int count = count_items(node);
    if ((uint32_t)count < value->sequence.min || (uint32_t)count > value->sequence.max)
        return fail_for_list_length(d, path, count, value, key);
    if (!allocate_values(d, value, count, &to)) return scene_fail_for_memory(d);
    insitu_status status = INSITU_OK;
    for (int i = 0; i < count && status == INSITU_OK; i++) {
        char item_path[path_size];
        write_path_of_list_entry(d, path, node, key, i, item_path);
        void *item = to ? (char *)to + (size_t)i * value->data_size : NULL;
        status = check_and_store_value(d, item_path, find_node_by_index(d, node->data.sequence.items.start[i]),
                                       value->sequence.entry, key, item);
    }
    return status;
}

/* Checks a value that is a name, or a list of names. */
static insitu_status check_name_or_list_of_names(scene_document *d, const char *path, const yaml_node_t *node,
                                                 const cyaml_schema_value_t *value, const scene_key *key)
{
    static const cyaml_schema_value_t one = {CYAML_VALUE_STRING(CYAML_FLAG_POINTER, char, 1, SCENE_NAME_BYTES)};
    if (node->type != YAML_SEQUENCE_NODE)
        return is_valid_scalar(node, value, key) ? INSITU_OK : fail_for_invalid_value(d, path, node, value, key);
    const int count = count_items(node);
    if (count < 1 || count > SCENE_MAX_NAMES) return fail_for_list_length(d, path, count, value, key);
    for (int i = 0; i < count; i++) {
        const yaml_node_t *item = find_node_by_index(d, node->data.sequence.items.start[i]);
        char item_path[path_size];
        snprintf(item_path, sizeof item_path, "%s[%d]", path, i);
        if (!is_valid_scalar(item, value, key)) return fail_for_invalid_value(d, item_path, item, &one, key);
    }
    return INSITU_OK;
}

static bool can_value_have_node_type(const cyaml_schema_value_t *value, const yaml_node_t *node)
{
    switch (value->type) {
    case CYAML_MAPPING: return node->type == YAML_MAPPING_NODE;
    case CYAML_SEQUENCE:
    case CYAML_SEQUENCE_FIXED: return node->type == YAML_SEQUENCE_NODE;
    default: return node->type == YAML_SCALAR_NODE;
    }
}

/* Checks the node against the first form of the value that allows the node's type (scalar, list or mapping). */
static insitu_status check_against_alternative_forms(scene_document *d, const char *path, const yaml_node_t *node,
                                                     const cyaml_schema_value_t *value, const scene_key *key)
{
    for (int i = 0; i < key->form_count; i++) {
        const scene_form *form = &key->forms[i];
        if (!can_value_have_node_type(&form->value, node)) continue;
        if (node->type == YAML_SCALAR_NODE && !is_valid_scalar(node, &form->value, &form->key)) break;
        return check_and_store_value(d, path, node, &form->value, &form->key, NULL);
    }
    return fail_for_invalid_value(d, path, node, value, key);
}

/* Returns whether a name that the scene defines is allowed. Such names occur in paths in messages, and simulations pass
 * them to functions of the library. */
static bool is_valid_scene_name(const yaml_node_t *name)
{
    static const char letters[] = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_", digits[] = "0123456789-";
    if (name->type != YAML_SCALAR_NODE || name->data.scalar.length > SCENE_KEY_BYTES) return false;
    size_t i = 0;
    for (const char *text = get_text_of_scalar(name); i < name->data.scalar.length; i++)
        if (!text[i] || !(strchr(letters, text[i]) || (i && strchr(digits, text[i])))) return false;
    return i > 0;
}

/* Checks a mapping whose keys are names that the scene defines. */
static insitu_status check_mapping_of_names(scene_document *d, const char *path, const yaml_node_t *node,
                                            const cyaml_schema_value_t *value, const scene_key *key)
{
    if (node->type != YAML_MAPPING_NODE) return fail_for_invalid_value(d, path, node, value, key);
    const yaml_node_pair_t *first = node->data.mapping.pairs.start, *end = node->data.mapping.pairs.top;
    if (end - first > SCENE_MAX_NAMES)
        return scene_fail_at_key(d, path, "", "%d names are not allowed, expected at most %d", (int)(end - first),
                                 SCENE_MAX_NAMES);
    insitu_status status = INSITU_OK;
    for (const yaml_node_pair_t *p = first; p < end && !status; p++) {
        const yaml_node_t *name = find_node_by_index(d, p->key);
        char quoted[quote_size], own_path[path_size];
        write_quoted_node_text(name, quoted);
        if (!is_valid_scene_name(name))
            return base_fail(d->error, INSITU_ERROR_SCENE,
                             "%.300s:%d: %s: the name %s is not allowed, expected a letter or _ and then letters, "
                             "digits, _ or -, at most %d bytes",
                             d->file_name, get_line_number_of_node(name), path, quoted, SCENE_KEY_BYTES);
        if (find_key_value_pair(d, node, get_text_of_scalar(name), name->data.scalar.length) != p)
            return base_fail(d->error, INSITU_ERROR_SCENE,
                             "%.300s:%d: %s: the name %s is given twice, expected it once", d->file_name,
                             get_line_number_of_node(name), path, quoted);
        snprintf(own_path, sizeof own_path, "%s.%s", path, get_text_of_scalar(name));
        status = check_and_store_value(d, own_path, find_node_by_index(d, p->value), &key->named->value,
                                       &key->named->key, NULL);
    }
    return status;
}

/* Writes a question that suggests where an unknown key is allowed: at the top of the file, or in the only child mapping
 * that has a key of this name. */
static void suggest_parent_of_key(const yaml_node_t *name, const scene_mapping *mapping, char question[question_size])
{
    const char *text = name->type == YAML_SCALAR_NODE ? get_text_of_scalar(name) : "", *holder = NULL;
    int holders = 0;
    for (int i = 0; mapping->fields[i].key; i++) {
        const scene_mapping *child = mapping->keys[i].child;
        for (const cyaml_schema_field_t *f = child ? child->fields : NULL; f && f->key; f++) {
            if (strcmp(f->key, text) != 0) continue;
            holder = mapping->fields[i].key;
            holders++;
        }
    }
    if (holders == 1) snprintf(question, question_size, " (did you mean %s.%s?)", holder, text);
    for (const cyaml_schema_field_t *f = scene_top.fields; f->key; f++)
        if (strcmp(f->key, text) == 0)
            snprintf(question, question_size, " (it stands at the top of the file, beside images)");
}

static insitu_status fail_for_invalid_key(scene_document *d, const char *path, const yaml_node_t *name,
                                          const scene_mapping *mapping, const char *fault)
{
    const scene_key holder = {.child = mapping};
    const cyaml_schema_value_t value = {.type = CYAML_MAPPING};
    const char *words[most_words];
    char quoted[quote_size], expected[SCENE_WORDS_SIZE], question[question_size];
    int count = 0;
    write_quoted_node_text(name, quoted);
    scene_describe_value(&value, &holder, expected);
    for (const cyaml_schema_field_t *f = mapping->fields; f->key && count < most_words; f++) words[count++] = f->key;
    suggest_candidate(name, words, count, question);
    if (!*question) suggest_parent_of_key(name, mapping, question);
    return base_fail(d->error, INSITU_ERROR_SCENE, "%.300s:%d: %s%sthe key %s is %s%s, expected %s", d->file_name,
                     get_line_number_of_node(name), path, *path ? ": " : "", quoted, fault, question, expected);
}

/* Returns the reason why a key of earlier versions was removed; NULL if there never was such a key. */
static const char *find_removal_reason(const char *key)
{
    static const char *const removed[][2] = {{"roots", "gone (no crossing in a cell is missed any more)"},
                                             {"root_steps", "gone (roots are polished until they stay)"},
                                             {"group", "gone (it never changed an image)"}};
    for (size_t i = 0; i < sizeof removed / sizeof removed[0]; i++)
        if (strcmp(key, removed[i][0]) == 0) return removed[i][1];
    return NULL;
}

static insitu_status check_and_store_pair(scene_document *d, const char *path, const yaml_node_pair_t *pair,
                                          const scene_mapping *mapping, unsigned *seen, void *to)
{
    const yaml_node_t *name = find_node_by_index(d, pair->key);
    int i = 0;
    while (mapping->fields[i].key &&
           (name->type != YAML_SCALAR_NODE || strcmp(get_text_of_scalar(name), mapping->fields[i].key) != 0)) {
        i++;
    }
    if (!mapping->fields[i].key) {
        const char *fault = name->type == YAML_SCALAR_NODE ? find_removal_reason(get_text_of_scalar(name)) : NULL;
        return fail_for_invalid_key(d, path, name, mapping, fault ? fault : "unknown");
    }
    if (*seen & 1u << i)
        return base_fail(d->error, INSITU_ERROR_SCENE, "%.300s:%d: %s%sthe key \"%s\" is given twice, expected it once",
                         d->file_name, get_line_number_of_node(name), path, *path ? ": " : "", mapping->fields[i].key);
    *seen |= 1u << i;
    char value_path[path_size];
    snprintf(value_path, sizeof value_path, "%s%s%s", path, *path ? "." : "", mapping->fields[i].key);
    const cyaml_schema_field_t *field = &mapping->fields[i];
    const yaml_node_t *node = find_node_by_index(d, pair->value);
    if (field->value.type == CYAML_IGNORE) to = NULL;
    if (to && field->value.type == CYAML_SEQUENCE && node->type == YAML_SEQUENCE_NODE)
        *(int *)((char *)to + field->count_offset) = count_items(node);
    void *place = to ? (char *)to + field->data_offset : NULL;
    return check_and_store_value(d, value_path, node, &field->value, &mapping->keys[i], place);
}

static insitu_status check_and_store_mapping(scene_document *d, const char *path, const yaml_node_t *node,
                                             const scene_mapping *mapping, void *to)
{
    unsigned seen = 0;
    insitu_status status = INSITU_OK;
    const yaml_node_pair_t *end = node->data.mapping.pairs.top;
    for (const yaml_node_pair_t *p = node->data.mapping.pairs.start; p < end && status == INSITU_OK; p++) {
        status = check_and_store_pair(d, path, p, mapping, &seen, to);
    }
    for (int i = 0; mapping->fields[i].key && status == INSITU_OK; i++) {
        if (seen & 1u << i || mapping->fields[i].value.flags & CYAML_FLAG_OPTIONAL) continue;
        char expected[SCENE_WORDS_SIZE];
        scene_describe_expected_value(mapping->fields[i].key, &mapping->fields[i].value, &mapping->keys[i], expected);
        status = scene_fail_at_key(d, path, mapping->fields[i].key, "missing, expected %s", expected);
    }
    return status;
}

static insitu_status check_and_store_value(scene_document *d, const char *path, const yaml_node_t *node,
                                           const cyaml_schema_value_t *value, const scene_key *key, void *to)
{
    switch (value->type) {
    case CYAML_MAPPING:
        if (node->type != YAML_MAPPING_NODE) return fail_for_invalid_value(d, path, node, value, key);
        if (!allocate_values(d, value, 1, &to)) return scene_fail_for_memory(d);
        return check_and_store_mapping(d, path, node, key->child, to);
    case CYAML_SEQUENCE:
    case CYAML_SEQUENCE_FIXED: return check_and_store_list(d, path, node, value, key, to);
    case CYAML_IGNORE:
        return (key->named   ? check_mapping_of_names
                : key->forms ? check_against_alternative_forms
                             : check_name_or_list_of_names)(d, path, node, value, key);
    default:
        return is_valid_scalar(node, value, key) ? store_scalar(d, node, value, to)
                                                 : fail_for_invalid_value(d, path, node, value, key);
    }
}

insitu_status scene_convert_document_to_structs(scene_document *d, scene_file **file)
{
    const scene_key key = {.child = &scene_top};
    const yaml_node_t *root = yaml_document_get_root_node((yaml_document_t *)&d->yaml);
    return check_and_store_value(d, "", root, &scene_top_value, &key, file);
}
