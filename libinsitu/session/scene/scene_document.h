/* Represents a scene file as a tree of YAML nodes with their lines. The functions check the tree against the schema,
 * compose messages about errors, and store correct values in the schema's structs. */
#ifndef SCENE_SCENE_DOCUMENT_H
#define SCENE_SCENE_DOCUMENT_H

#include <yaml.h>

#include "error.h"
#include "scene_schema.h"

typedef struct scene_block scene_block;

typedef struct scene_document {
    const char *file_name; /* name of the file for messages; borrowed */
    const char *text;      /* text of the file, `size` bytes; borrowed until the document is closed */
    size_t size;
    base_error *error; /* receives the error messages; borrowed */
    /* files that the scene names; borrowed; NULL if the scene may name no files */
    struct scene_attachments *attachments;
    yaml_document_t yaml;
    scene_block *blocks; /* memory blocks that hold the schema's structs */
} scene_document;

/* Reads a text into *d. The text is borrowed. It must be one YAML document of bounded size and depth, without anchors,
 * aliases and tags. After an error there is nothing to close. From this call until the document is closed, the thread's
 * locale must have a decimal point, because numbers are read in this locale. */
insitu_status scene_document_open(scene_document *d, const char *text, size_t size, const char *file_name,
                                  base_error *error);

void scene_document_close(scene_document *d);

/* Checks the document against the schema (keys are known and unique, and none is missing; types, counts and ranges are
 * correct) and stores it in *file. *file is owned by the document and valid until the document is closed; after an
 * error it is undefined. */
insitu_status scene_convert_document_to_structs(scene_document *d, scene_file **file);

/* Returns the line (from 1) of a path such as "images[0].size[1]", or of the deepest node of the path that exists. In a
 * list whose entries have the key `name`, a short name without . and [ may replace the index, as in "fields.speed". */
int scene_get_line_number_at_path(const scene_document *d, const char *path);

/* Returns whether a path may contain this name instead of an index: the name is short and contains no . and no [. */
bool scene_is_valid_path_name(const char *name);

/* Stores pointers to the texts of the node at a path in `texts`, at most `most` of them. The node must be a text or a
 * list of texts; the document owns the texts. Returns how many texts the node has, even if this is more than `most`; 0
 * if there is no node at the path. */
int scene_list_texts_at_path(const scene_document *d, const char *path, const char **texts, int most);

/* Stores pointers to the keys of the mapping at a path, at most `most` of them. The keys must be names that the scene
 * defines; the document owns them. Returns how many keys the mapping has, even if this is more than `most`; 0 if there
 * is no mapping at the path. */
int scene_list_keys_at_path(const scene_document *d, const char *path, const char **names, int most);

/* scene_get_node_type_at_path() tells whether the node at a path is a scalar, a list or a mapping, or does not exist.
 * scene_get_number_at_path() returns the node's value if it is a number, otherwise 0. After the document has been
 * checked, a node has a type that the schema allows for its key. */
typedef enum scene_node { SCENE_NOTHING, SCENE_SCALAR, SCENE_LIST, SCENE_MAPPING } scene_node;
scene_node scene_get_node_type_at_path(const scene_document *d, const char *path);
/* Returns the length of the list at a path; 0 if there is no list. */
int scene_get_list_length_at_path(const scene_document *d, const char *path);
double scene_get_number_at_path(const scene_document *d, const char *path);

/* Records "file:line: parent.key: ..." and returns INSITU_ERROR_SCENE. If the key is empty, the message refers to the
 * parent itself. */
insitu_status scene_fail_at_key(const scene_document *d, const char *parent, const char *key, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Records that memory ran out while the scene was read, and returns INSITU_ERROR_MEMORY. */
insitu_status scene_fail_for_memory(const scene_document *d);

#endif
