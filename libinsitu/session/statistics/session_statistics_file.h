/* Statistics as lines of text: a file each, a line for each step in which they are due. */
#ifndef SESSION_STATISTICS_FILE_H
#define SESSION_STATISTICS_FILE_H

#include "error.h"
#include "session_statistics.h"

/* Add a line; missing folders are made. A session's first line drops the file's lines of this cycle and of later ones,
 * which a restarted run writes again. A file that was taken away since is begun anew. A file with other columns is an error, and stays as it is. Local. */
insitu_status session_write_statistics(const char *path, bool is_first, int64_t cycle, double time,
                                       const session_statistics *values, base_error *error);

#endif
