/* Sends warnings that have been found on only one rank to all ranks. */
#ifndef SESSION_LINES_H
#define SESSION_LINES_H

#include "error.h"
#include "session_report.h"
#include "session_team.h"

/* Returns a number that is 0 if this rank has no warnings, and otherwise the larger the lower the rank is. From the
 * maximum of these numbers over all ranks, session_decode_rank_with_warnings() determines the lowest rank that has
 * warnings. Local. */
int session_encode_rank_with_warnings(const session_report *report, const session_team *team);
/* Returns the lowest rank that has warnings, from the maximum of session_encode_rank_with_warnings() over all ranks; -1
 * if no rank has warnings. Local. */
int session_decode_rank_with_warnings(int word, const session_team *team);

/* Adds the warnings of the rank `root` to the reports of all ranks. Warnings of the other ranks are dropped, because
 * they are mostly the same as those of `root`. Collective. */
insitu_status session_broadcast_warnings(session_report *report, int root, const session_team *team, base_error *error);

#endif
