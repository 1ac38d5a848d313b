/* The schema in words, for error messages and for docs/scene.md alike. */
#include "scene_document.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

__attribute__((format(printf, 2, 3))) static void append(char words[SCENE_WORDS_SIZE], const char *format, ...)
{
    const size_t used = strlen(words);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(words + used, SCENE_WORDS_SIZE - used, format, arguments);
    va_end(arguments);
}

static void append_range(char words[SCENE_WORDS_SIZE], const scene_key *key)
{
    if (!key || (key->low == 0 && key->high == 0)) return;
    append(words, key->is_low_excluded ? " above %.10g" : " from %.10g", key->low);
    const char *const high = key->is_high_excluded ? " and below" : key->is_low_excluded ? " and at most" : " to";
    append(words, "%s %.10g", high, key->high);
}

static void append_choices(char words[SCENE_WORDS_SIZE], const cyaml_schema_value_t *value)
{
    append(words, "one of");
    for (uint32_t i = 0; i < value->enumeration.count; i++) {
        append(words, "%s %s", i ? "," : "", value->enumeration.strings[i].str);
    }
}

static void append_mapping(char words[SCENE_WORDS_SIZE], const scene_mapping *mapping)
{
    append(words, "a mapping with the keys");
    for (const cyaml_schema_field_t *f = mapping->fields; f->key; f++) {
        append(words, "%s %s", f == mapping->fields ? "" : ",", f->key);
    }
}

static void append_list(char words[SCENE_WORDS_SIZE], const cyaml_schema_value_t *list, const scene_key *key)
{
    const cyaml_schema_value_t *entry = list->sequence.entry;
    append(words, "a list of %u", list->sequence.min);
    if (list->sequence.max != list->sequence.min) append(words, " to %u", list->sequence.max);
    switch (entry->type) {
    case CYAML_MAPPING: append(words, " mappings"); return;
    case CYAML_INT: append(words, " whole numbers"); break;
    case CYAML_SEQUENCE_FIXED: append(words, " lists of %u numbers", entry->sequence.max); break;
    default: append(words, " numbers"); break;
    }
    append_range(words, key);
}

void scene_value_words(const cyaml_schema_value_t *value, const scene_key *key, char words[SCENE_WORDS_SIZE])
{
    words[0] = '\0';
    switch (value->type) {
    case CYAML_INT:
        append(words, "a whole number");
        append_range(words, key);
        break;
    case CYAML_FLOAT:
        append(words, "a number");
        append_range(words, key);
        break;
    case CYAML_BOOL: append(words, "true or false"); break;
    case CYAML_STRING: append(words, "a text of %u to %u bytes", value->string.min, value->string.max); break;
    case CYAML_ENUM: append_choices(words, value); break;
    case CYAML_IGNORE:
        append(words, "a text of 1 to %d bytes or a list of 1 to %d of them", SCENE_NAME_BYTES, SCENE_MAX_NAMES);
        break;
    case CYAML_MAPPING: append_mapping(words, key->child); break;
    default: append_list(words, value, key); break;
    }
}
