/* Describes the values that the schema allows in words, for messages and for docs/scene.md. */
#ifndef SCENE_SCENE_WORDS_H
#define SCENE_SCENE_WORDS_H

#include "scene_schema.h"

/* Size in bytes of the buffers for descriptions, including the terminating NUL. */
enum { SCENE_WORDS_SIZE = 640 };

/* Describes the values that a key accepts, for example "a number above 0 and below 180" or "a list of 3 numbers from 0
 * to 1". */
void scene_describe_value(const cyaml_schema_value_t *value, const scene_key *key, char words[SCENE_WORDS_SIZE]);

/* Describes the values that a key accepts, with additions for messages: the keys of the mappings in a list, and the
 * short form that the last key of the path may have. */
void scene_describe_expected_value(const char *path, const cyaml_schema_value_t *value, const scene_key *key,
                                   char expected[SCENE_WORDS_SIZE]);

/* Returns whether a list is a colour: 3 or 4 numbers from 0 to 1. scene_shorthand.c also accepts names for colours. */
bool scene_is_colour_schema(const cyaml_schema_value_t *list, const scene_key *key);

#endif
