/* Defines insitu_conduit_functions, the table of Conduit's functions for insitu/blueprint.h. Conduit's own header must
 * be included first: conduit.h, or Catalyst's catalyst.h, which renames the functions. Without it the table is not
 * defined. */
#ifndef INSITU_CONDUIT_H
#define INSITU_CONDUIT_H

#include "insitu/blueprint.h"

#ifdef CONDUIT_NODE_H

/* Removes const, because Conduit's C API takes non-const pointers even for nodes that are only read. */
static inline conduit_node *insitu_conduit_node(const void *node)
{
    return (conduit_node *)(uintptr_t)node;
}

static inline int64_t insitu_conduit_number_of_children(const void *node)
{
    return conduit_node_number_of_children(insitu_conduit_node(node));
}

static inline void *insitu_conduit_child(const void *node, int64_t number)
{
    return conduit_node_child(insitu_conduit_node(node), (conduit_index_t)number);
}

static inline char *insitu_conduit_name(const void *node)
{
    return conduit_node_name(insitu_conduit_node(node));
}

static inline int insitu_conduit_has_path(const void *node, const char *path)
{
    return conduit_node_has_path(insitu_conduit_node(node), path);
}

static inline void *insitu_conduit_fetch_existing(const void *node, const char *path)
{
    return conduit_node_fetch_existing(insitu_conduit_node(node), path);
}

static inline void *insitu_conduit_element_ptr(const void *node, int64_t number)
{
    return conduit_node_element_ptr(insitu_conduit_node(node), (conduit_index_t)number);
}

static inline char *insitu_conduit_as_char8_str(const void *node)
{
    return conduit_node_as_char8_str(insitu_conduit_node(node));
}

static inline int64_t insitu_conduit_id(const void *node)
{
    return conduit_datatype_id(conduit_node_dtype(insitu_conduit_node(node)));
}

static inline int64_t insitu_conduit_number_of_elements(const void *node)
{
    return conduit_datatype_number_of_elements(conduit_node_dtype(insitu_conduit_node(node)));
}

static inline int64_t insitu_conduit_stride(const void *node)
{
    return conduit_datatype_stride(conduit_node_dtype(insitu_conduit_node(node)));
}

static inline int insitu_conduit_is_string(const void *node)
{
    return conduit_datatype_is_string(conduit_node_dtype(insitu_conduit_node(node)));
}

static const insitu_conduit insitu_conduit_functions = {
    insitu_conduit_number_of_children, insitu_conduit_child,       insitu_conduit_name,         insitu_conduit_has_path,
    insitu_conduit_fetch_existing,     insitu_conduit_element_ptr, insitu_conduit_as_char8_str, insitu_conduit_id,
    insitu_conduit_number_of_elements, insitu_conduit_stride,      insitu_conduit_is_string};

#endif

#endif
