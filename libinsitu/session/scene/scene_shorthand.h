/* Rewrites short forms of a scene's values into the full forms that the schema describes. */
#ifndef SCENE_SCENE_SHORTHAND_H
#define SCENE_SCENE_SHORTHAND_H

#include <stdbool.h>
#include <stddef.h>
#include <yaml.h>

/* Rewrites the document's short forms in place. New nodes keep the lines of the nodes that they replace, so that
 * messages still contain the correct lines. Everything else remains unchanged; the schema checks it later. Returns
 * false if memory runs out. */
bool scene_expand_shorthand(yaml_document_t *document);

/* Returns a description of the short forms that the value of a key may have, such as "true or false", or NULL if it has
 * none. */
const char *scene_describe_short_form(const char *key, size_t length);

/* Returns the candidate that the author of a scene probably meant by an unknown word. If other programs use the word,
 * this is the corresponding word of the schema. Otherwise it is the candidate that is reached with the fewest edits
 * (insertion, removal or replacement of a letter, exchange of two neighbouring letters), if their number is at most a
 * third of the word's length. Returns NULL if there is no such candidate. */
const char *scene_find_most_similar_word(const char *word, const char *const *candidates, int count);

#endif
