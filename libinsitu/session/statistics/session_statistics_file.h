/* Writes statistics as lines of text. Each of the scene's statistics has its own file, with one line for each step in
 * which it is due. */
#ifndef SESSION_STATISTICS_FILE_H
#define SESSION_STATISTICS_FILE_H

#include "error.h"
#include "session_statistics.h"

/* Adds a line to the file. Missing folders are created. The first line of a session removes the file's lines of this
 * cycle and of later ones, since a restarted run writes them again. If the file was removed in the meantime, it is
 * created again. If the file has other columns, an error is returned and the file is not changed. Local. */
insitu_status session_write_statistics(const char *path, bool is_first, int64_t cycle, double time,
                                       const session_statistics *values, base_error *error);

#endif
