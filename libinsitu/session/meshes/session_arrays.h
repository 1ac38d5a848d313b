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
    SESSION_HAS_END = 16,   /* the array has one element more than its count, as arrays of offsets have */
    SESSION_ALLOW_ANY = 32, /* all integer types are allowed, and no array needs to be aligned, not even of floats */
};

/* The requirements of an array. */
typedef struct session_array_rule {
    const char *name; /* name of the elements in messages, in the plural */
    int64_t count;    /* number of its elements */
    int flags;        /* a combination of the SESSION_* bits above */
    int per_tuple;    /* distance from one element to the next, in elements, if no stride is given */
} session_array_rule;

/* Checks that the array is given, has an allowed type, is aligned unless it need not be, and has a stride with which
 * its elements can lie in memory. If anything but the type is wrong, the status `bad` is returned. */
insitu_status session_check_array(const insitu_array *array, const session_array_rule *rule, insitu_status bad,
                                  base_error *error);

/* Checks an array of pointers in the same way as session_check_array(). It must be given; its type is the type of the
 * elements to which the pointers point. */
insitu_status session_check_pointers(const insitu_array *array, const session_array_rule *rule, insitu_status bad,
                                     base_error *error);

/* Checks the stride from each component of data's tuples to the next. If is_anywhere, any size is allowed. Messages
 * call the components `name`. */
insitu_status session_check_components(const insitu_array *data, int count, int64_t stride, bool is_anywhere,
                                       const char *name, base_error *error);

/* Returns whether both descriptions have the same address and layout. */
bool session_is_same_array(const insitu_array *a, const insitu_array *b);

#endif
