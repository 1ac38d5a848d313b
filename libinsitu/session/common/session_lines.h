/* Sends warnings that only one rank knows to all ranks. */
#ifndef SESSION_LINES_H
#define SESSION_LINES_H

#include "error.h"
#include "session_report.h"
#include "session_team.h"

/* Returns this rank's operand for an MPI maximum, from whose result session_telling_rank() computes the rank. Local. */
int session_telling_word(const session_report *report, const session_team *team);
/* Returns the lowest rank that has lines; -1 if no rank has any. Local. */
int session_telling_rank(int word, const session_team *team);

/* Adds one rank's lines, possibly none, to all ranks' reports. Lines of other ranks, which are mostly the same, are
 * dropped. Collective. */
insitu_status session_share_lines(session_report *report, int root, const session_team *team, base_error *error);

#endif
