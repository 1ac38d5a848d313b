/* The effort of a test: the usual part, which covers each kind of case, or the whole, with ./test --long. CMake's
 * insitu_add_split_test() registers both. */
#ifndef TEST_EFFORT_H
#define TEST_EFFORT_H

#include <stdbool.h>
#include <stdlib.h>

static inline bool test_is_long_run(void)
{
    const char *whole = getenv("INSITU_TEST_WHOLE");
    return whole && whole[0] == '1';
}

/* Returns the number of cases to run. */
static inline int test_case_count(int usual, int whole)
{
    return test_is_long_run() ? whole : usual;
}

#endif
