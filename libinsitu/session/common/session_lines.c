#include "session_lines.h"

#include <string.h>

#include "session_agree.h"

enum { MOST_BYTES = 2048 }; /* maximum length in bytes of the line of a warning */

int session_encode_rank_with_warnings(const session_report *report, const session_team *team)
{
    return report->own_warnings.size ? team->ranks - team->rank : 0;
}

int session_decode_rank_with_warnings(int word, const session_team *team)
{
    return word ? team->ranks - word : -1;
}

insitu_status session_broadcast_warnings(session_report *report, int root, const session_team *team, base_error *error)
{
    const char *lines = team->rank == root && report->own_warnings.size ? report->own_warnings.data : "";
    char line[MOST_BYTES];
    report->own_warnings.size = 0;
    for (;;) {
        int size = (int)strcspn(lines, "\n");
        insitu_status status = session_check_mpi(error, MPI_Bcast(&size, 1, MPI_INT, root, team->comm), "MPI_Bcast");
        if (status || !size) return status;
        const int taken = size < MOST_BYTES ? size : MOST_BYTES - 1;
        if (team->rank == root) memcpy(line, lines, (size_t)taken);
        status = session_check_mpi(error, MPI_Bcast(line, taken, MPI_CHAR, root, team->comm), "MPI_Bcast");
        if (status) return status;
        line[taken] = '\0';
        session_text_add(&report->warnings, "%s", line);
        if (team->rank == root) lines += size + (lines[size] == '\n');
    }
}
