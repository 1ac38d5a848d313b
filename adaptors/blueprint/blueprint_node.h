/* Reads nodes by paths, so that whatever is wrong is reported with its path. Conduit ends the process if a path is
 * missing or a node has another type than is asked for, so nothing is read before it has been looked for. */
#ifndef BLUEPRINT_NODE_H
#define BLUEPRINT_NODE_H

#include <stdbool.h>
#include <stdint.h>

#include "insitu/blueprint.h"

enum { NODE_NAME = 256, NODE_PATH = 512, NODE_MESSAGE = 1024 };

/* The first error, and lines of text on what was left out or copied. */
typedef struct node_log {
    insitu_status status;
    char message[NODE_MESSAGE];
    char *left_out, *copied_why; /* NULL: nothing */
    int64_t bytes_copied;
} node_log;

/* A node with its ancestors, which live on the stack of whoever reads them. */
typedef struct node {
    const insitu_conduit *conduit;
    node_log *log;
    const void *at;
    const struct node *parent; /* NULL: the root, whose name is the caller's */
    char name[NODE_NAME];
} node;

/* An array as a node has it. */
typedef struct node_array {
    insitu_array array;
    int64_t count;
} node_array;

/* Keeps the error if it is the first: "path: what". path is relative to the node, and may be "". Returns false. */
bool node_fail(const node *parent, const char *path, insitu_status status, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Notes that what stands at the path is left out. */
void node_leave_out(const node *parent, const char *path, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Notes bytes that the door holds. */
void node_note_copy(const node *parent, const char *path, int64_t bytes, const char *why);

void node_log_free(node_log *log);

bool node_has(const node *parent, const char *path);

/* The node at the path, which may have several names; false where there is none, which is no error. */
bool node_find(const node *parent, const char *path, node *out);

/* As above, but an error where there is none. */
bool node_need(const node *parent, const char *path, node *out);

int64_t node_child_count(const node *parent);
void node_child(const node *parent, int64_t number, node *out);

/* Reads a string. False, an error, where there is none or it is none. The string is the node's. */
bool node_string(const node *parent, const char *path, const char **out);

/* Reads a number; leaves *out where there is none, which is an error only if it is needed. */
bool node_integer(const node *parent, const char *path, bool is_needed, int64_t *out);
bool node_real(const node *parent, const char *path, bool is_needed, double *out);

/* Reads up to three whole numbers of an array, as strides are; *count: how many. */
bool node_integers(const node *parent, const char *path, int64_t out[3], int *count);

/* Describes the array of a node, or of the one at the path; false, an error, where it is no array of numbers. */
bool node_read_array(const node *of, node_array *out);
bool node_need_array(const node *parent, const char *path, node_array *out);

/* An element as a whole number, of arrays of integers. */
int64_t node_element(const insitu_array *array, int64_t i);

/* Bytes of an element of the type. */
int64_t node_type_bytes(insitu_type type);

bool node_is_integers(const node_array *array);

#endif
