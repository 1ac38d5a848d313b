/* Defines the functions of Conduit's C API that the adaptors call, with the same names, since Debian has no package of
 * Conduit. A node has a name and either children or an array in the test's memory. If a path is missing or a node has
 * another type, Conduit throws an exception, and this replacement ends the process. */
#ifndef CONDUIT_STAND_IN_H
#define CONDUIT_STAND_IN_H
#define CONDUIT_NODE_H /* the include guard of Conduit's own header */

#include <stdint.h>

typedef int64_t conduit_index_t;
typedef struct conduit_node_impl conduit_node;
typedef struct conduit_datatype_impl conduit_datatype;

/* Conduit's identifiers of data types. */
enum {
    STAND_IN_EMPTY = 0,
    STAND_IN_OBJECT = 1,
    STAND_IN_LIST = 2,
    STAND_IN_INT8 = 3,
    STAND_IN_INT16 = 4,
    STAND_IN_INT32 = 5,
    STAND_IN_INT64 = 6,
    STAND_IN_UINT8 = 7,
    STAND_IN_UINT16 = 8,
    STAND_IN_UINT32 = 9,
    STAND_IN_UINT64 = 10,
    STAND_IN_FLOAT32 = 11,
    STAND_IN_FLOAT64 = 12,
    STAND_IN_STRING = 13
};

conduit_node *conduit_node_create(void);
void conduit_node_destroy(conduit_node *node);

/* Returns the node at the path; creates the nodes that do not exist yet. */
conduit_node *conduit_node_fetch(conduit_node *node, const char *path);
conduit_node *conduit_node_fetch_existing(conduit_node *node, const char *path);
conduit_node *conduit_node_child(conduit_node *node, conduit_index_t number);
conduit_index_t conduit_node_number_of_children(conduit_node *node);
char *conduit_node_name(const conduit_node *node);
int conduit_node_has_path(const conduit_node *node, const char *path);
void *conduit_node_element_ptr(conduit_node *node, conduit_index_t number);
char *conduit_node_as_char8_str(conduit_node *node);
const conduit_datatype *conduit_node_dtype(const conduit_node *node);
conduit_index_t conduit_datatype_id(const conduit_datatype *type);
conduit_index_t conduit_datatype_number_of_elements(const conduit_datatype *type);
conduit_index_t conduit_datatype_stride(const conduit_datatype *type);
int conduit_datatype_is_string(const conduit_datatype *type);
void conduit_node_set_path_char8_str(conduit_node *node, const char *path, const char *value);
void conduit_node_set_path_int64(conduit_node *node, const char *path, int64_t value);
void conduit_node_set_path_float64(conduit_node *node, const char *path, double value);

/* Stores a pointer to the array as the data of the node at the path; a stride of 0 means packed. Conduit has no such
 * function. */
void stand_in_set_array(conduit_node *node, const char *path, int id, const void *data, int64_t count, int64_t stride);
/* Exchanges the contents of two nodes but not their names. */
void stand_in_swap(conduit_node *a, conduit_node *b);
/* Sets the stride of the array at the path to 0. */
void stand_in_set_zero_stride(conduit_node *node, const char *path);
/* Removes the node at the path. */
void stand_in_remove(conduit_node *node, const char *path);
/* Copies all arrays of the tree into one block of memory without gaps, from an odd address on, as in Conduit's compact
 * nodes. */
void stand_in_pack(conduit_node *node);
int64_t stand_in_size(int id);

#endif
