/* Checks the caller's descriptions of arrays (type, alignment, stride and size) before any element is read. */
#include "session_arrays.h"

#include "grid.h"
#include "session_mesh.h"

static bool is_allowed_type(insitu_type type, int allowed)
{
    switch (type) {
    case INSITU_FLOAT32:
    case INSITU_FLOAT64: return allowed & SESSION_ALLOW_FLOATS;
    case INSITU_INT32:
    case INSITU_INT64: return allowed & (SESSION_ALLOW_INTEGERS | SESSION_ALLOW_ANY);
    case INSITU_UINT8:
    case INSITU_INT8:
    case INSITU_INT16:
    case INSITU_UINT16:
    case INSITU_UINT32:
    case INSITU_UINT64: return allowed & SESSION_ALLOW_ANY;
    }
    return false;
}

static const char *describe_allowed_types(int kind)
{
    switch (kind & (SESSION_ALLOW_FLOATS | SESSION_ALLOW_INTEGERS | SESSION_ALLOW_ANY)) {
    case SESSION_ALLOW_INTEGERS: return "int32 or int64";
    case SESSION_ALLOW_ANY: return "an integer type";
    case SESSION_ALLOW_FLOATS | SESSION_ALLOW_INTEGERS: return "float32, float64, int32 or int64";
    default: return "float32, float64 or an integer type";
    }
}

/* Upper bound of the size of a process's address space in bytes, on all supported machines. If all elements of an array
 * lie within it, the product of an index and a stride cannot overflow. */
static const uint64_t most_bytes = (uint64_t)1 << 48;

/* Checks a stride in bytes. A negative stride is valid: the other elements then lie before the first one. A stride of 0
 * means that the elements are packed. */
static insitu_status check_stride(const void *data, const char *name, int64_t count, int64_t stride, int64_t size,
                                  bool is_any_stride, insitu_status bad, base_error *error)
{
    if (stride % size != 0 && !is_any_stride)
        return base_fail(error, bad, "%s have a stride of %lld bytes, no multiple of their %lld", name,
                         (long long)stride, (long long)size);
    const uint64_t step = stride < 0 ? 0 - (uint64_t)stride : (uint64_t)stride;
    /* number of strides from the first element to the last; at least 1, because it is a divisor */
    const uint64_t steps = count > 1 ? (uint64_t)count - 1 : 1;
    const bool fits = count == 0 || step <= most_bytes / steps;
    if (!fits || (stride < 0 && count && step * steps > (uintptr_t)data))
        return base_fail(error, bad, "%s have a stride of %lld bytes: %lld of them lie outside of memory", name,
                         (long long)stride, (long long)count);
    return INSITU_OK;
}

static insitu_status check_alignment(const void *data, const char *name, int64_t size, insitu_status bad,
                                     base_error *error)
{
    if ((uintptr_t)data % (uintptr_t)size == 0) return INSITU_OK;
    return base_fail(error, bad, "%s are not aligned to their %lld bytes", name, (long long)size);
}

insitu_status session_check_array(const insitu_array *array, const session_array_rule *rule, insitu_status bad,
                                  base_error *error)
{
    if (!array->data) {
        if (rule->count == 0 || rule->flags & SESSION_IS_OPTIONAL) return INSITU_OK;
        return base_fail(error, bad, "%s are not given", rule->name);
    }
    if (!is_allowed_type(array->type, rule->flags))
        return base_fail(error, INSITU_ERROR_ARGUMENT, "%s are of element type %d, not %s", rule->name,
                         (int)array->type, describe_allowed_types(rule->flags));
    const int64_t size = session_type_size(array->type), count = rule->count + (rule->flags & SESSION_HAS_END ? 1 : 0);
    const bool is_any_stride = rule->flags & SESSION_ALLOW_ANY;
    const insitu_status status = is_any_stride ? INSITU_OK : check_alignment(array->data, rule->name, size, bad, error);
    if (status) return status;
    const int64_t stride = array->stride_bytes ? array->stride_bytes : size * rule->per_tuple;
    return check_stride(array->data, rule->name, count, stride, size, is_any_stride, bad, error);
}

insitu_status session_check_components(const insitu_array *data, int count, int64_t stride, bool is_any_stride,
                                       const char *name, base_error *error)
{
    if (!data->data) return INSITU_OK;
    return check_stride(data->data, name, count, stride, session_type_size(data->type), is_any_stride,
                        INSITU_ERROR_FIELD, error);
}

insitu_status session_check_pointers(const insitu_array *array, const session_array_rule *rule, insitu_status bad,
                                     base_error *error)
{
    const int64_t size = sizeof(void *);
    if (!is_allowed_type(array->type, rule->flags))
        return base_fail(error, INSITU_ERROR_ARGUMENT, "%s are of element type %d, not %s", rule->name,
                         (int)array->type, describe_allowed_types(rule->flags));
    const insitu_status status = check_alignment(array->data, rule->name, size, bad, error);
    if (status) return status;
    return check_stride(array->data, rule->name, rule->count, array->stride_bytes ? array->stride_bytes : size, size,
                        false, bad, error);
}

bool session_is_same_array(const insitu_array *a, const insitu_array *b)
{
    const grid_array x = session_grid_array(a), y = session_grid_array(b);
    return x.data == y.data && x.stride == y.stride && (!x.data || a->type == b->type);
}
