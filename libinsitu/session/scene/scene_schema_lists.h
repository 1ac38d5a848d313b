/* Defines macros for the lists of keys in the schema's files. Each mapping of the scene file has one list of its keys.
 * An entry of the list describes a key both as a field of libcyaml's schema and as a scene_key. The reader, the checks,
 * the error messages and docs/scene.md are all derived from these lists, so that they always agree. */
#ifndef SCENE_SCHEMA_LISTS_H
#define SCENE_SCHEMA_LISTS_H

#include "scene_schema.h"

#define REQUIRED CYAML_FLAG_DEFAULT
#define OPTIONAL CYAML_FLAG_OPTIONAL
#define POINTER (CYAML_FLAG_OPTIONAL | CYAML_FLAG_POINTER)

#define AS_FIELD(field, ...) field,
#define AS_KEY(field, ...) {__VA_ARGS__},
#define DEFINE_MAPPING(name, the_title, LIST)                                                                          \
    static const cyaml_schema_field_t name##_fields[] = {LIST(AS_FIELD) CYAML_FIELD_END};                              \
    static const scene_key name##_keys[] = {LIST(AS_KEY)};                                                             \
    static const scene_mapping name##_mapping = {the_title, name##_fields, name##_keys}

/* Defines a mapping that other files use too. */
#define EXPORT_MAPPING(name, the_title, LIST)                                                                          \
    const cyaml_schema_field_t scene_##name##_fields[] = {LIST(AS_FIELD) CYAML_FIELD_END};                             \
    static const scene_key name##_keys[] = {LIST(AS_KEY)};                                                             \
    const scene_mapping scene_##name##_mapping = {the_title, scene_##name##_fields, name##_keys}

/* Declares a required or optional text of at most `longest` bytes. */
#define TEXT(key, flags, type, member, longest) CYAML_FIELD_STRING_PTR(key, flags, type, member, 1, longest)
/* Declares an optional list of exactly `count` numbers. */
#define NUMBERS(key, type, member, count) CYAML_FIELD_SEQUENCE_FIXED(key, POINTER, type, member, &number, count)
/* Declares an optional name or list of names. */
#define NAMES(key) CYAML_FIELD_IGNORE(key, OPTIONAL)
#define CHOICE(key, type, member, words)                                                                               \
    CYAML_FIELD_ENUM_PTR(key, CHOICE_FLAGS, type, member, words, CYAML_ARRAY_LEN(words))
#define CHOICE_FLAGS (POINTER | CYAML_FLAG_STRICT)

/* Declares a value that several of the schema's files may use. The attribute is needed because a file may leave it
 * unused. */
#define SHARED static const __attribute__((unused)) cyaml_schema_value_t
SHARED number = {CYAML_VALUE_FLOAT(CYAML_FLAG_DEFAULT, double)};
SHARED whole_number = {CYAML_VALUE_INT(CYAML_FLAG_DEFAULT, int)};
SHARED colour = {CYAML_VALUE_SEQUENCE_FIXED(CYAML_FLAG_DEFAULT, double, &number, 3)};
#undef SHARED

#define COMPONENT_HELP                                                                                                 \
    "The scalar of the field that is used: `magnitude`, `x`, `y`, `z`, or a component's number from 0 to 999."
#define COMPONENT_DEFAULT "`0` for a field with one component, otherwise `magnitude`"

/* the lists of keys that scene_schema_layers.c defines */
extern const cyaml_schema_field_t scene_layer_fields[], scene_clip_fields[];
extern const scene_mapping scene_layer_mapping, scene_clip_mapping;
/* the lists of keys that series/scene_schema_series.c defines */
extern const cyaml_schema_field_t scene_camera_fields[], scene_sweep_fields[];
extern const scene_mapping scene_camera_mapping, scene_sweep_mapping;

#endif
