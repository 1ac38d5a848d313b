/* Writes statistics as lines of text. Each of the scene's statistics has its own file, with one line for each step in
 * which it is due. */
#ifndef SESSION_STATISTICS_FILE_H
#define SESSION_STATISTICS_FILE_H

#include "error.h"
#include "session_statistics.h"

typedef struct session_event_time {
    int64_t cycle;
    double time;
} session_event_time;

/* Adds a line to the file. Missing directories are created. is_first: this is the first line in this file since the
 * session began or the run went back in time; the file's lines of the cycle kept_below and of later cycles are then
 * removed, because the run computes them again. If the file was removed during the session, it is created again. If the
 * file has other columns, an error is returned and the file is not changed. Local. */
insitu_status session_write_statistics(const char *path, bool is_first, int64_t kept_below,
                                       const session_event_time *now, const session_statistics *values,
                                       base_error *error);

#endif
