#include "blueprint_node.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- messages --------------------------------------------------------------------------------------------------- */

/* Appends the path of a node, beginning at the root. */
static void write_path(const node *n, char *out)
{
    if (n->parent) write_path(n->parent, out);
    const size_t length = strlen(out);
    snprintf(out + length, NODE_PATH - length, "%s%s", length && *n->name ? "/" : "", n->name);
}

static void make_path(const node *parent, const char *path, char *out)
{
    *out = 0;
    write_path(parent, out);
    const size_t length = strlen(out);
    snprintf(out + length, NODE_PATH - length, "%s%s", length && *path ? "/" : "", path);
    if (!*out) snprintf(out, NODE_PATH, "(the node itself)");
}

bool node_set_error(const node *parent, const char *path, insitu_status status, const char *format, ...)
{
    node_log *log = parent->log;
    char where[NODE_PATH], what[NODE_PATH];
    if (log->status) return false;
    va_list list;
    va_start(list, format);
    vsnprintf(what, sizeof what, format, list);
    va_end(list);
    make_path(parent, path, where);
    log->status = status;
    snprintf(log->message, sizeof log->message, "%.500s: %.500s", where, what);
    return false;
}

/* Appends a line to the text. If memory runs out, the text stays as it is. */
static void add_line(char **text, const char *where, const char *what)
{
    const size_t length = *text ? strlen(*text) : 0, room = length + strlen(where) + strlen(what) + 4;
    char *longer = realloc(*text, room);
    if (!longer) return;
    snprintf(longer + length, room - length, "%s%s: %s", length ? "\n" : "", where, what);
    *text = longer;
}

void node_report_left_out(const node *parent, const char *path, const char *format, ...)
{
    char where[NODE_PATH], what[NODE_PATH];
    va_list list;
    va_start(list, format);
    vsnprintf(what, sizeof what, format, list);
    va_end(list);
    make_path(parent, path, where);
    add_line(&parent->log->left_out, where, what);
}

void node_report_copy(const node *parent, const char *path, int64_t bytes, const char *why)
{
    char where[NODE_PATH], what[NODE_PATH];
    make_path(parent, path, where);
    snprintf(what, sizeof what, "%s (%lld bytes)", why, (long long)bytes);
    add_line(&parent->log->copied_why, where, what);
    parent->log->bytes_copied += bytes;
}

void node_log_free(node_log *log)
{
    free(log->left_out);
    free(log->copied_why);
    *log = (node_log){.status = INSITU_OK};
}

/* ---- nodes ------------------------------------------------------------------------------------------------------ */

bool node_has(const node *parent, const char *path)
{
    return parent->conduit->has_path(parent->conduit_node, path);
}

bool node_find(const node *parent, const char *path, node *out)
{
    if (!node_has(parent, path)) return false;
    *out =
        (node){parent->conduit, parent->log, parent->conduit->fetch_existing(parent->conduit_node, path), parent, {0}};
    snprintf(out->name, sizeof out->name, "%s", path);
    return true;
}

bool node_require(const node *parent, const char *path, node *out)
{
    return node_find(parent, path, out) || node_set_error(parent, path, INSITU_ERROR_MESH, "is missing");
}

int64_t node_child_count(const node *parent)
{
    return parent->conduit->number_of_children(parent->conduit_node);
}

void node_get_child(const node *parent, int64_t number, node *out)
{
    *out = (node){parent->conduit, parent->log, parent->conduit->child(parent->conduit_node, number), parent, {0}};
    char *name = parent->conduit->name(out->conduit_node);
    if (name && *name)
        snprintf(out->name, sizeof out->name, "%s", name);
    else
        snprintf(out->name, sizeof out->name, "[%lld]", (long long)number);
    free(name);
}

bool node_read_string(const node *parent, const char *path, const char **out)
{
    node found;
    if (!node_require(parent, path, &found)) return false;
    if (!found.conduit->is_string(found.conduit_node))
        return node_set_error(&found, "", INSITU_ERROR_MESH, "is no string");
    *out = found.conduit->as_char8_str(found.conduit_node);
    return *out || node_set_error(&found, "", INSITU_ERROR_MESH, "is no string");
}

/* ---- arrays ----------------------------------------------------------------------------------------------------- */

/* Converts a Conduit type id (3 to 12) to an insitu_type. Returns 0 for all other ids, because they are not numeric. */
static int convert_conduit_type(int64_t id)
{
    static const unsigned char types[] = {0,
                                          0,
                                          0,
                                          INSITU_INT8,
                                          INSITU_INT16,
                                          INSITU_INT32,
                                          INSITU_INT64,
                                          INSITU_UINT8,
                                          INSITU_UINT16,
                                          INSITU_UINT32,
                                          INSITU_UINT64,
                                          INSITU_FLOAT32,
                                          INSITU_FLOAT64};
    return id >= 0 && id < (int64_t)sizeof types ? types[id] : 0;
}

bool node_read_array(const node *of, node_array *out)
{
    const int type = convert_conduit_type(of->conduit->id(of->conduit_node));
    if (!type) return node_set_error(of, "", INSITU_ERROR_MESH, "is no array of numbers");
    *out = (node_array){.count = of->conduit->number_of_elements(of->conduit_node)};
    out->array.type = (insitu_type)type;
    if (out->count < 0) return node_set_error(of, "", INSITU_ERROR_MESH, "has %lld elements", (long long)out->count);
    if (out->count == 0) return true;
    out->array.data = of->conduit->element_ptr(of->conduit_node, 0);
    out->array.stride_bytes = of->conduit->stride(of->conduit_node);
    if (!out->array.data)
        return node_set_error(of, "", INSITU_ERROR_MESH, "has %lld elements and no address", (long long)out->count);
    if (out->array.stride_bytes == 0 && out->count > 1)
        return node_set_error(of, "", INSITU_ERROR_MESH, "has %lld elements and a stride of 0", (long long)out->count);
    return true;
}

bool node_require_array(const node *parent, const char *path, node_array *out)
{
    node found;
    return node_require(parent, path, &found) && node_read_array(&found, out);
}

int64_t node_type_bytes(insitu_type type)
{
    switch (type) {
    case INSITU_UINT8:
    case INSITU_INT8: return 1;
    case INSITU_INT16:
    case INSITU_UINT16: return 2;
    case INSITU_FLOAT32:
    case INSITU_INT32:
    case INSITU_UINT32: return 4;
    case INSITU_FLOAT64:
    case INSITU_INT64:
    case INSITU_UINT64: return 8;
    }
    return 0;
}

#define READ_AS(type)                                                                                                  \
    {                                                                                                                  \
        type value;                                                                                                    \
        memcpy(&value, p, sizeof value);                                                                               \
        return (int64_t)value;                                                                                         \
    }

int64_t node_get_element(const insitu_array *array, int64_t i)
{
    const int64_t stride = array->stride_bytes ? array->stride_bytes : node_type_bytes(array->type);
    const char *p = (const char *)array->data + i * stride;
    switch (array->type) {
    case INSITU_INT8: READ_AS(int8_t)
    case INSITU_UINT8: READ_AS(uint8_t)
    case INSITU_INT16: READ_AS(int16_t)
    case INSITU_UINT16: READ_AS(uint16_t)
    case INSITU_INT32: READ_AS(int32_t)
    case INSITU_UINT32: READ_AS(uint32_t)
    case INSITU_INT64: READ_AS(int64_t)
    case INSITU_UINT64: READ_AS(uint64_t)
    case INSITU_FLOAT32:
    case INSITU_FLOAT64: break;
    }
    return 0;
}

bool node_is_integer_array(const node_array *array)
{
    return array->array.type != INSITU_FLOAT32 && array->array.type != INSITU_FLOAT64;
}

/* Finds the single number at a path. Returns false if there is no number. Sets the error if a required number is
 * missing, or if the node at the path is not a single number. */
static bool find_number(const node *parent, const char *path, bool is_required, node *found, node_array *out)
{
    if (!node_find(parent, path, found))
        return is_required ? node_set_error(parent, path, INSITU_ERROR_MESH, "is missing") : false;
    if (!node_read_array(found, out)) return false;
    return out->count == 1 ||
           node_set_error(found, "", INSITU_ERROR_MESH, "has %lld elements, expected 1", (long long)out->count);
}

bool node_read_integer(const node *parent, const char *path, bool is_required, int64_t *out)
{
    node found;
    node_array number;
    if (!find_number(parent, path, is_required, &found, &number)) return !parent->log->status;
    if (!node_is_integer_array(&number)) return node_set_error(&found, "", INSITU_ERROR_MESH, "is no whole number");
    *out = node_get_element(&number.array, 0);
    return true;
}

bool node_read_real(const node *parent, const char *path, bool is_required, double *out)
{
    node found;
    node_array number;
    float narrow;
    if (!find_number(parent, path, is_required, &found, &number)) return !parent->log->status;
    if (number.array.type == INSITU_FLOAT64) {
        memcpy(out, number.array.data, sizeof *out);
    } else if (number.array.type == INSITU_FLOAT32) {
        memcpy(&narrow, number.array.data, sizeof narrow);
        *out = (double)narrow;
    } else {
        *out = (double)node_get_element(&number.array, 0);
    }
    return true;
}

bool node_read_integers(const node *parent, const char *path, int64_t out[3], int *count)
{
    node found;
    node_array array;
    if (!node_find(parent, path, &found) || !node_read_array(&found, &array)) return false;
    if (!node_is_integer_array(&array)) return node_set_error(&found, "", INSITU_ERROR_MESH, "are no whole numbers");
    if (array.count < 1 || array.count > 3)
        return node_set_error(&found, "", INSITU_ERROR_MESH, "has %lld elements, expected 1 to 3",
                              (long long)array.count);
    *count = (int)array.count;
    for (int i = 0; i < *count; i++) out[i] = node_get_element(&array.array, i);
    return true;
}

void node_read_strides(const node *parent, const char *path, const int64_t counts[3], int64_t strides[3])
{
    int count = 0;
    strides[0] = 1;
    if (parent) node_read_integers(parent, path, strides, &count);
    for (int axis = 1; axis < 3; axis++)
        if (axis >= count) strides[axis] = strides[axis - 1] * (counts[axis - 1] > 0 ? counts[axis - 1] : 1);
}
