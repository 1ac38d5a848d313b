/* Warnings that one rank alone knows of, told to all. */
#ifndef SESSION_LINES_H
#define SESSION_LINES_H

#include "error.h"
#include "session_report.h"
#include "session_team.h"

/* What this rank brings into a maximum over all ranks, which is for session_telling_rank(). Local. */
int session_telling_word(const session_report *report, const session_team *team);
/* The lowest rank that has lines; -1: none has. Local. */
int session_telling_rank(int word, const session_team *team);

/* Give all ranks' reports the lines of one rank, which may have none. Those of other ranks, which mostly are the same,
 * are dropped. Collective. */
insitu_status session_share_lines(session_report *report, int root, const session_team *team, base_error *error);

#endif
