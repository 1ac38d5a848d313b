/* Short forms of a scene's values, rewritten into the full forms that the schema describes. */
#ifndef SCENE_SCENE_SHORTHAND_H
#define SCENE_SCENE_SHORTHAND_H

#include <stdbool.h>
#include <stddef.h>
#include <yaml.h>

/* Rewrites the document's short forms in place; new nodes keep the lines of those that they replace, so that messages
 * still name them. What is not a short form stays as it is, for the schema to judge. Returns false if memory runs out.
 */
bool scene_expand_shorthand(yaml_document_t *document);

/* The short forms that a key's value may have, in words, as "true or false"; NULL: none. */
const char *scene_shorthand_words(const char *key, size_t length);

/* Returns the candidate that the word was probably meant to be: what other programs call so, or the nearest by edits of
 * a letter (insert, remove, replace, or swap of two neighbours), if a third of the letters or fewer differ. NULL: there
 * is none. */
const char *scene_nearest_word(const char *word, const char *const *candidates, int count);

#endif
