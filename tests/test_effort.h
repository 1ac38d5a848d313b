/* The effort of a test: the usual run covers each kind of case, and the whole run, ./test --long, all cases. CMake's
 * insitu_add_split_test() registers a test for both runs. */
#ifndef TEST_EFFORT_H
#define TEST_EFFORT_H

#include <stdbool.h>
#include <stdlib.h>

static inline bool test_is_long_run(void)
{
    const char *whole = getenv("INSITU_TEST_WHOLE");
    return whole && whole[0] == '1';
}

/* Returns the number of cases: `usual` in the usual run, `whole` in the long run. */
static inline int test_case_count(int usual, int whole)
{
    return test_is_long_run() ? whole : usual;
}

#endif
