#include "scene_words.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "scene_shorthand.h"

__attribute__((format(printf, 2, 3))) static void append_formatted_text(char words[SCENE_WORDS_SIZE],
                                                                        const char *format, ...)
{
    const size_t used = strlen(words);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(words + used, SCENE_WORDS_SIZE - used, format, arguments);
    va_end(arguments);
}

static void append_description_of_range(char words[SCENE_WORDS_SIZE], const scene_key *key)
{
    if (!key || (key->low == 0 && key->high == 0)) return;
    append_formatted_text(words, key->is_low_excluded ? " above %.10g" : " from %.10g", key->low);
    const char *const high = key->is_high_excluded ? " and below" : key->is_low_excluded ? " and at most" : " to";
    append_formatted_text(words, "%s %.10g", high, key->high);
}

static void append_description_of_choices(char words[SCENE_WORDS_SIZE], const cyaml_schema_value_t *value)
{
    append_formatted_text(words, "one of");
    for (uint32_t i = 0; i < value->enumeration.count; i++) {
        append_formatted_text(words, "%s %s", i ? "," : "", value->enumeration.strings[i].str);
    }
}

static void append_description_of_mapping(char words[SCENE_WORDS_SIZE], const scene_mapping *mapping)
{
    append_formatted_text(words, "a mapping with the keys");
    for (const cyaml_schema_field_t *f = mapping->fields; f->key; f++) {
        append_formatted_text(words, "%s %s", f == mapping->fields ? "" : ",", f->key);
    }
}

bool scene_is_colour_schema(const cyaml_schema_value_t *list, const scene_key *key)
{
    const cyaml_type_e type = list->sequence.entry->type;
    return list->sequence.min == 3 && type == CYAML_FLOAT && key && key->low == 0 && key->high == 1;
}

static void append_description_of_list(char words[SCENE_WORDS_SIZE], const cyaml_schema_value_t *list,
                                       const scene_key *key)
{
    const cyaml_schema_value_t *entry = list->sequence.entry;
    append_formatted_text(words, "a list of %u", list->sequence.min);
    if (list->sequence.max != list->sequence.min) append_formatted_text(words, " to %u", list->sequence.max);
    switch (entry->type) {
    case CYAML_MAPPING: append_formatted_text(words, " mappings"); return;
    case CYAML_INT: append_formatted_text(words, " whole numbers"); break;
    case CYAML_SEQUENCE_FIXED: append_formatted_text(words, " lists of %u numbers", entry->sequence.max); break;
    case CYAML_ENUM:
        append_formatted_text(words, ", each ");
        append_description_of_choices(words, entry);
        return;
    default: append_formatted_text(words, " numbers"); break;
    }
    append_description_of_range(words, key);
    if (scene_is_colour_schema(list, key))
        append_formatted_text(words, ", or the name of a colour, or \"#rrggbb\" in quotes");
}

static void append_description_of_forms(char words[SCENE_WORDS_SIZE], const scene_key *key)
{
    for (int i = 0; i < key->form_count; i++) {
        char form[SCENE_WORDS_SIZE];
        scene_describe_value(&key->forms[i].value, &key->forms[i].key, form);
        append_formatted_text(words, "%s%s", i ? "; or " : "", form);
    }
}

void scene_describe_value(const cyaml_schema_value_t *value, const scene_key *key, char words[SCENE_WORDS_SIZE])
{
    words[0] = '\0';
    switch (value->type) {
    case CYAML_INT:
        append_formatted_text(words, "a whole number");
        append_description_of_range(words, key);
        break;
    case CYAML_FLOAT:
        append_formatted_text(words, "a number");
        append_description_of_range(words, key);
        break;
    case CYAML_BOOL: append_formatted_text(words, "true or false"); break;
    case CYAML_STRING:
        append_formatted_text(words, "a text of %u to %u bytes", value->string.min, value->string.max);
        break;
    case CYAML_ENUM: append_description_of_choices(words, value); break;
    case CYAML_IGNORE:
        if (key->named) {
            char each[SCENE_WORDS_SIZE];
            scene_describe_value(&key->named->value, &key->named->key, each);
            append_formatted_text(words, "a mapping of at most %d names of your own, each with %s", SCENE_MAX_NAMES,
                                  each);
            break;
        }
        if (key->forms) {
            append_description_of_forms(words, key);
            break;
        }
        append_formatted_text(words, "a text of 1 to %d bytes or a list of 1 to %d of them", SCENE_NAME_BYTES,
                              SCENE_MAX_NAMES);
        break;
    case CYAML_MAPPING: append_description_of_mapping(words, key->child); break;
    default: append_description_of_list(words, value, key); break;
    }
}

/* Returns the last key of a path, or "" for an entry of a list. */
static const char *find_last_key(const char *path)
{
    const char *dot = strrchr(path, '.'), *key = dot ? dot + 1 : path;
    return *key && path[strlen(path) - 1] == ']' ? "" : key;
}

void scene_describe_expected_value(const char *path, const cyaml_schema_value_t *value, const scene_key *key,
                                   char expected[SCENE_WORDS_SIZE])
{
    scene_describe_value(value, key, expected);
    if (value->type == CYAML_SEQUENCE && value->sequence.entry->type == CYAML_MAPPING && key->child) {
        const scene_key entry = {.child = key->child};
        char keys[SCENE_WORDS_SIZE];
        scene_describe_value(value->sequence.entry, &entry, keys);
        append_formatted_text(expected, "%s", keys + strlen("a mapping"));
    }
    /* for lists of names and values of several forms, the description already contains all forms */
    const char *name = find_last_key(path), *short_form = scene_describe_short_form(name, strlen(name));
    if (short_form && value->type != CYAML_IGNORE) append_formatted_text(expected, ", or %s", short_form);
}
