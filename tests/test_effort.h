/* A test runs its usual part, which meets each kind of case, or the whole, by ./test --long. CMake's
 * insitu_add_split_test() registers both. */
#ifndef TEST_EFFORT_H
#define TEST_EFFORT_H

#include <stdbool.h>
#include <stdlib.h>

static inline bool test_is_whole(void)
{
    const char *whole = getenv("INSITU_TEST_WHOLE");
    return whole && whole[0] == '1';
}

/* The number of cases to do. */
static inline int test_effort(int usual, int whole)
{
    return test_is_whole() ? whole : usual;
}

#endif
