/* Checks of the arrays that a caller describes. */
#ifndef SESSION_ARRAYS_H
#define SESSION_ARRAYS_H

#include "error.h"
#include "insitu/insitu.h"

#include <stdbool.h>

enum {
    SESSION_ALLOW_FLOATS = 1,
    SESSION_ALLOW_INTEGERS = 2,
    SESSION_IS_OPTIONAL = 8,
    SESSION_HAS_END = 16,   /* one element more than its count, as offsets have */
    SESSION_ALLOW_ANY = 32, /* all integers, aligned or not; floats need not be aligned either */
};

/* The requirements of an array. */
typedef struct session_array_rule {
    const char *name; /* in the plural */
    int64_t count;    /* number of its elements */
    int kind;         /* the bits above */
    int per_tuple;    /* elements from one to the next if there is no stride */
} session_array_rule;

/* Checks that the array is given, has an allowed type, is aligned unless it need not be, and has a stride by which its
 * elements can lie in memory. bad: the status where anything but the type is wrong. */
insitu_status session_check_array(const insitu_array *array, const session_array_rule *rule, insitu_status bad,
                                  base_error *error);

/* As above, for an array of pointers, which must be given; its type is that of the elements to which they point. */
insitu_status session_check_pointers(const insitu_array *array, const session_array_rule *rule, insitu_status bad,
                                     base_error *error);

/* Checks the stride from each component of data's tuples to the next, of any size if is_anywhere. name: of the
 * components. */
insitu_status session_check_components(const insitu_array *data, int count, int64_t stride, bool is_anywhere,
                                       const char *name, base_error *error);

/* Returns whether both descriptions have the same address and layout. */
bool session_is_same_array(const insitu_array *a, const insitu_array *b);

#endif
