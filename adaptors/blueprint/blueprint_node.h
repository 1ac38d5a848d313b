/* Access to Conduit nodes by path. Every error message contains the path of the node. Conduit terminates the process if
 * a path is missing or a node has an unexpected type, so each access is preceded by a check. */
#ifndef BLUEPRINT_NODE_H
#define BLUEPRINT_NODE_H

#include <stdbool.h>
#include <stdint.h>

#include "insitu/blueprint.h"

enum { NODE_NAME = 256, NODE_PATH = 512, NODE_MESSAGE = 1024 };

/* Collects the first error, and the reports of what the adaptor has left out or copied. */
typedef struct node_log {
    insitu_status status;
    char message[NODE_MESSAGE];
    char *left_out, *copied_why; /* report texts with one line per item; NULL if there are no items */
    int64_t bytes_copied;
} node_log;

/* A node and its ancestors. The ancestors are in the stack frames of the calling functions. */
typedef struct node {
    const insitu_conduit *conduit;
    node_log *log;
    const void *conduit_node;
    const struct node *parent; /* parent node; NULL for the root, whose name the caller chose */
    char name[NODE_NAME];
} node;

/* An array of a node, and its number of elements. */
typedef struct node_array {
    insitu_array array;
    int64_t count;
} node_array;

/* Stores the error "path: what" if it is the first one. The path is relative to the node and may be "". Always returns
 * false. */
bool node_set_error(const node *parent, const char *path, insitu_status status, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Reports that the item at the path is left out, and why. */
void node_report_left_out(const node *parent, const char *path, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* Reports a copy of this many bytes that the adaptor holds, and why. */
void node_report_copy(const node *parent, const char *path, int64_t bytes, const char *why);

void node_log_free(node_log *log);

bool node_has(const node *parent, const char *path);

/* Finds the node at the path. The path may have several components. Returns false if the node does not exist; this is
 * not an error. */
bool node_find(const node *parent, const char *path, node *out);

/* Finds the node at the path. If it does not exist, sets the error and returns false. */
bool node_require(const node *parent, const char *path, node *out);

int64_t node_child_count(const node *parent);
void node_get_child(const node *parent, int64_t number, node *out);

/* Reads a string, whose memory belongs to the node. Returns false and sets the error if there is no string at the
 * path. */
bool node_read_string(const node *parent, const char *path, const char **out);

/* node_read_integer() and node_read_real() read a number. If the number is missing, *out does not change; this is an
 * error only if is_required is set. */
bool node_read_integer(const node *parent, const char *path, bool is_required, int64_t *out);
bool node_read_real(const node *parent, const char *path, bool is_required, double *out);

/* Reads one to three integers of an optional array, for example strides; *count receives their number. Returns false if
 * the array is missing or invalid. */
bool node_read_integers(const node *parent, const char *path, int64_t out[3], int *count);

/* Reads the strides of an array in which i varies fastest. Missing strides are computed from the numbers of elements
 * along each axis, as for an array without padding; parent is NULL if all are missing. A count of 0 is treated as 1. */
void node_read_strides(const node *parent, const char *path, const int64_t counts[3], int64_t strides[3]);

/* node_read_array() describes the array of the node, node_require_array() that of the node at the path. They return
 * false and set the error if the node is not an array of numbers. */
bool node_read_array(const node *of, node_array *out);
bool node_require_array(const node *parent, const char *path, node_array *out);

/* Returns an element of an array of integers. */
int64_t node_get_element(const insitu_array *array, int64_t i);

/* Returns the size of the type in bytes. */
int64_t node_type_bytes(insitu_type type);

bool node_is_integer_array(const node_array *array);

#endif
