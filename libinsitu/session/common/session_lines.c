#include "session_lines.h"

#include <string.h>

#include "session_agree.h"

int session_telling_word(const session_report *report, const session_team *team)
{
    return report->own.size ? team->ranks - team->rank : 0;
}

int session_telling_rank(int word, const session_team *team)
{
    return word ? team->ranks - word : -1;
}

insitu_status session_share_lines(session_report *report, int root, const session_team *team, base_error *error)
{
    char text[4096] = "";
    const size_t size = report->own.size < sizeof text ? report->own.size : sizeof text - 1;
    if (size) memcpy(text, report->own.data, size);
    report->own.size = 0;
    const insitu_status status =
        session_mpi(error, MPI_Bcast(text, sizeof text, MPI_CHAR, root, team->comm), "MPI_Bcast");
    for (char *line = text; *line && !status;) {
        char *end = line + strcspn(line, "\n");
        const bool is_last = !*end;
        *end = '\0';
        session_text_add(&report->warnings, "%s", line);
        line = is_last ? end : end + 1;
    }
    return status;
}
