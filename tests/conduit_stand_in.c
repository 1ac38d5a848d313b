#include "conduit_stand_in.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct conduit_node_impl {
    char name[256];
    int id;
    char *data;
    int64_t count, stride;
    void *owned; /* the data if the node owns it, else NULL */
    int child_count;
    conduit_node **children;
};

static void abort_with_message(const char *what, const char *name)
{
    fprintf(stderr, "Conduit would throw: %s: %s\n", what, name);
    abort();
}

int64_t stand_in_size(int id)
{
    static const int sizes[] = {0, 0, 0, 1, 2, 4, 8, 1, 2, 4, 8, 4, 8, 1};
    return sizes[id];
}

conduit_node *conduit_node_create(void)
{
    conduit_node *node = calloc(1, sizeof *node);
    if (!node) abort();
    return node;
}

static void clear_node(conduit_node *node)
{
    for (int i = 0; i < node->child_count; i++) conduit_node_destroy(node->children[i]);
    free(node->children);
    free(node->owned);
    node->children = NULL;
    node->owned = NULL;
    node->child_count = 0;
}

void conduit_node_destroy(conduit_node *node)
{
    clear_node(node);
    free(node);
}

/* Returns the child whose name is the first component of the path; *rest receives the remaining path. */
static conduit_node *find_first_child(const conduit_node *node, const char *path, const char **rest)
{
    const size_t length = strcspn(path, "/");
    *rest = path[length] ? path + length + 1 : path + length;
    for (int i = 0; i < node->child_count; i++) {
        const char *name = node->children[i]->name;
        if (strlen(name) == length && strncmp(name, path, length) == 0) return node->children[i];
    }
    return NULL;
}

static conduit_node *find_node(const conduit_node *node, const char *path)
{
    while (node && *path) node = find_first_child(node, path, &path);
    return (conduit_node *)(uintptr_t)node;
}

conduit_node *conduit_node_fetch(conduit_node *node, const char *path)
{
    while (*path) {
        const char *rest;
        conduit_node *child = find_first_child(node, path, &rest);
        if (!child) {
            child = conduit_node_create();
            snprintf(child->name, sizeof child->name, "%.*s", (int)strcspn(path, "/"), path);
            node->children = realloc(node->children, (size_t)(node->child_count + 1) * sizeof *node->children);
            if (!node->children) abort();
            node->children[node->child_count++] = child;
            node->id = STAND_IN_OBJECT;
        }
        node = child;
        path = rest;
    }
    return node;
}

conduit_node *conduit_node_fetch_existing(conduit_node *node, const char *path)
{
    conduit_node *found = find_node(node, path);
    if (!found) abort_with_message("no such path", path);
    return found;
}

conduit_node *conduit_node_child(conduit_node *node, conduit_index_t number)
{
    if (number < 0 || number >= node->child_count) abort_with_message("no such child", node->name);
    return node->children[number];
}

conduit_index_t conduit_node_number_of_children(conduit_node *node)
{
    return node->child_count;
}

char *conduit_node_name(const conduit_node *node)
{
    char *copy = malloc(strlen(node->name) + 1);
    if (!copy) abort();
    return strcpy(copy, node->name);
}

int conduit_node_has_path(const conduit_node *node, const char *path)
{
    return find_node(node, path) != NULL;
}

void *conduit_node_element_ptr(conduit_node *node, conduit_index_t number)
{
    if (!stand_in_size(node->id)) abort_with_message("no array", node->name);
    return node->data + number * node->stride;
}

char *conduit_node_as_char8_str(conduit_node *node)
{
    if (node->id != STAND_IN_STRING) abort_with_message("no string", node->name);
    return node->data;
}

const conduit_datatype *conduit_node_dtype(const conduit_node *node)
{
    return (const conduit_datatype *)(const void *)node;
}

static const conduit_node *find_owning_node(const conduit_datatype *type)
{
    return (const conduit_node *)(const void *)type;
}

conduit_index_t conduit_datatype_id(const conduit_datatype *type)
{
    return find_owning_node(type)->id;
}

conduit_index_t conduit_datatype_number_of_elements(const conduit_datatype *type)
{
    return find_owning_node(type)->count;
}

conduit_index_t conduit_datatype_stride(const conduit_datatype *type)
{
    return find_owning_node(type)->stride;
}

int conduit_datatype_is_string(const conduit_datatype *type)
{
    return find_owning_node(type)->id == STAND_IN_STRING;
}

void stand_in_set_array(conduit_node *node, const char *path, int id, const void *data, int64_t count, int64_t stride)
{
    conduit_node *at = conduit_node_fetch(node, path);
    clear_node(at);
    at->id = id;
    at->data = (char *)(uintptr_t)data;
    at->count = count;
    at->stride = stride ? stride : stand_in_size(id);
}

/* Stores a copy of the bytes at the path. */
static void store_copy(conduit_node *node, const char *path, int id, const void *data, size_t bytes)
{
    void *copy = malloc(bytes);
    if (!copy) abort();
    memcpy(copy, data, bytes);
    stand_in_set_array(node, path, id, copy, id == STAND_IN_STRING ? (int64_t)bytes : 1, 0);
    conduit_node_fetch(node, path)->owned = copy;
}

void conduit_node_set_path_char8_str(conduit_node *node, const char *path, const char *value)
{
    store_copy(node, path, STAND_IN_STRING, value, strlen(value) + 1);
}

void conduit_node_set_path_int64(conduit_node *node, const char *path, int64_t value)
{
    store_copy(node, path, STAND_IN_INT64, &value, sizeof value);
}

void conduit_node_set_path_float64(conduit_node *node, const char *path, double value)
{
    store_copy(node, path, STAND_IN_FLOAT64, &value, sizeof value);
}

void stand_in_set_zero_stride(conduit_node *node, const char *path)
{
    conduit_node_fetch_existing(node, path)->stride = 0;
}

void stand_in_swap(conduit_node *a, conduit_node *b)
{
    const conduit_node was = *a;
    *a = *b;
    *b = was;
    memcpy(b->name, a->name, sizeof a->name);
    memcpy(a->name, was.name, sizeof a->name);
}

void stand_in_remove(conduit_node *node, const char *path)
{
    const char *rest, *last = strrchr(path, '/');
    char parent[256];
    snprintf(parent, sizeof parent, "%.*s", last ? (int)(last - path) : 0, path);
    conduit_node *from = conduit_node_fetch_existing(node, parent);
    conduit_node *gone = find_first_child(from, last ? last + 1 : path, &rest);
    if (!gone) abort_with_message("no such path", path);
    for (int i = 0, kept = 0; i < from->child_count; i++)
        if (from->children[i] != gone) from->children[kept++] = from->children[i];
    from->child_count--;
    conduit_node_destroy(gone);
}

static int64_t compute_packed_bytes(const conduit_node *node)
{
    int64_t bytes = node->count * stand_in_size(node->id);
    for (int i = 0; i < node->child_count; i++) bytes += compute_packed_bytes(node->children[i]);
    return bytes;
}

static char *pack_node(conduit_node *node, char *to)
{
    const int64_t size = stand_in_size(node->id);
    if (size) {
        for (int64_t i = 0; i < node->count; i++) memcpy(to + i * size, node->data + i * node->stride, (size_t)size);
        free(node->owned);
        node->owned = NULL;
        node->data = to;
        node->stride = size;
        to += node->count * size;
    }
    for (int i = 0; i < node->child_count; i++) to = pack_node(node->children[i], to);
    return to;
}

void stand_in_pack(conduit_node *node)
{
    char *memory = malloc((size_t)compute_packed_bytes(node) + 1);
    if (!memory) abort();
    pack_node(node, memory + 1);
    node->owned = memory;
}
