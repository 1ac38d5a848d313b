/* Statistics as lines of text: a file each, a line for each step in which they are due. */
#ifndef SESSION_STATISTICS_FILE_H
#define SESSION_STATISTICS_FILE_H

#include "error.h"
#include "session_statistics.h"

/* Add a line; missing folders are made. The first of a session leaves out what the file has of this cycle and of later
 * ones, which a run that began again draws again; a file of other columns is an error, and stays as it is. Local. */
insitu_status session_write_statistics(const char *path, bool is_first, int64_t cycle, double time,
                                       const session_statistics *values, base_error *error);

#endif
