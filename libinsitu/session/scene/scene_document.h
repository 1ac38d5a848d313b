/* A scene file as a tree of YAML nodes with their lines. Errors are found and worded here, and right values go into the
 * schema's structs. */
#ifndef SCENE_SCENE_DOCUMENT_H
#define SCENE_SCENE_DOCUMENT_H

#include <yaml.h>

#include "error.h"
#include "scene_schema.h"

typedef struct scene_block scene_block;

typedef struct scene_document {
    const char *file_name; /* borrowed */
    const char *text;      /* borrowed until the document is closed; of `size` bytes */
    size_t size;
    base_error *error;                     /* borrowed; where messages go */
    struct scene_attachments *attachments; /* borrowed; NULL: none may be named */
    yaml_document_t yaml;
    scene_block *blocks; /* memory of what was read */
} scene_document;

/* Read text, which is borrowed, into *d: one YAML document, of bounded size and depth, without anchors, aliases and
 * tags. On an error there is nothing to close. Numbers are read in the thread's locale, which must be one with a
 * decimal point, from here on.
 */
insitu_status scene_document_open(scene_document *d, const char *text, size_t size, const char *file_name,
                                  base_error *error);

void scene_document_close(scene_document *d);

/* Check the document by the schema (keys are known, given once, and none is missing; types, counts and ranges are
 * right) and make *file of it. *file belongs to the document and is valid until that is closed; it is undefined on an
 * error. */
insitu_status scene_document_read(scene_document *d, scene_file **file);

/* The line (from 1) of a path such as "images[0].size[1]"; of as much of it as there is. In a list whose entries have
 * the key `name`, one may stand as its name, as in "fields.speed", if that is plain: short, without . and [. */
int scene_document_line(const scene_document *d, const char *path);

bool scene_is_plain_name(const char *name);

/* The texts at a path: of a text alone, or of a list of them; borrowed from the document. Returns how many there are;
 * at most `most` are filled in. 0: nothing stands there. */
int scene_document_texts(const scene_document *d, const char *path, const char **texts, int most);

/* The names that are the keys of a mapping at a path, as scene_document_texts(). */
int scene_document_names(const scene_document *d, const char *path, const char **names, int most);

/* The text at a path, and a number of it; a node that passed the check is what its key asks for. */
typedef enum scene_node { SCENE_NOTHING, SCENE_SCALAR, SCENE_LIST, SCENE_MAPPING } scene_node;
scene_node scene_document_kind(const scene_document *d, const char *path);
int scene_document_length(const scene_document *d, const char *path); /* the length of a list; 0: there is none */
double scene_document_number(const scene_document *d, const char *path);

/* Record "file:line: parent.key: ..." and return INSITU_ERROR_SCENE. key may be "", meaning the parent itself. */
insitu_status scene_bad(const scene_document *d, const char *parent, const char *key, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Records that memory ran out while the scene was read; returns INSITU_ERROR_MEMORY. */
insitu_status scene_no_memory(const scene_document *d);

#endif
