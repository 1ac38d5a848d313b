/* Statistics as lines of text: one file each, with a line for each step in which they are due. */
#ifndef SESSION_STATISTICS_FILE_H
#define SESSION_STATISTICS_FILE_H

#include "error.h"
#include "session_statistics.h"

/* Adds a line; creates missing folders. A session's first line removes the file's lines of this cycle and of later
 * ones, which a restarted run writes again. A file that was removed in between is begun anew. A file with other columns
 * is an error and is not changed. Local. */
insitu_status session_write_statistics(const char *path, bool is_first, int64_t cycle, double time,
                                       const session_statistics *values, base_error *error);

#endif
