/* Functions that check the arrays described by the caller. */
#ifndef SESSION_ARRAYS_H
#define SESSION_ARRAYS_H

#include "error.h"
#include "insitu/insitu.h"

#include <stdbool.h>

enum {
    SESSION_ALLOW_FLOATS = 1,
    SESSION_ALLOW_INTEGERS = 2,
    SESSION_IS_OPTIONAL = 8,
    /* the array has one element more than session_array_rule.count, as arrays of offsets have */
    SESSION_HAS_END = 16,
    SESSION_ALLOW_ANY = 32, /* all integer types are allowed, and arrays of any type may be unaligned */
};

/* The requirements that an array given by the caller must meet. */
typedef struct session_array_rule {
    const char *name; /* name of the elements in messages, in the plural */
    int64_t count; /* number of elements that the array must have, not counting the additional one of SESSION_HAS_END */
    int flags;     /* a combination of the SESSION_* bits above */
    /* number of array elements from the start of one tuple to the start of the next if the caller gives no stride: the
     * number of interleaved components, or 1 */
    int per_tuple;
} session_array_rule;

/* Checks that the array is given, has an allowed type, is aligned unless the flags allow unaligned arrays, and has a
 * stride with which all of its elements fit into the address space. A wrong type is INSITU_ERROR_ARGUMENT; any other
 * error has the status `bad`. */
insitu_status session_check_array(const insitu_array *array, const session_array_rule *rule, insitu_status bad,
                                  base_error *error);

/* Checks an array of pointers in the same way as session_check_array(). The array of pointers must be given.
 * array->type is the type of the elements to which the pointers point. */
insitu_status session_check_pointers(const insitu_array *array, const session_array_rule *rule, insitu_status bad,
                                     base_error *error);

/* Checks the stride between the components of a tuple in `data`. count: number of components. is_any_stride: the stride
 * need not be a multiple of the element size. name: the word for components in messages. */
insitu_status session_check_components(const insitu_array *data, int count, int64_t stride, bool is_any_stride,
                                       const char *name, base_error *error);

/* Returns whether two descriptions of arrays have the same address, element type and stride; two arrays that are not
 * given are equal. */
bool session_is_same_array(const insitu_array *a, const insitu_array *b);

#endif
