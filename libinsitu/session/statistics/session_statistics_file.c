#include "session_statistics_file.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "text_file.h"

enum { MOST_BYTES = 1 << 28 }; /* maximum size of an existing file to which lines are added; about two million lines */

/* Returns the line of column names without its newline. The line is allocated by base_alloc(); NULL if memory runs
 * out. */
static char *make_header(int bin_count, bool is_of_shells)
{
    static const char solids[] = "cycle,time,cells,volume,minimum,maximum,mean,deviation";
    static const char shells[] = "cycle,time,cells,area,minimum,maximum,mean,deviation";
    const char *columns = is_of_shells ? shells : solids;
    const size_t size = sizeof solids + (bin_count ? 16 + 8 * (size_t)bin_count : 0);
    char *out = base_alloc(size);
    if (!out) return NULL;
    size_t length = (size_t)snprintf(out, size, "%s%s", columns, bin_count ? ",low,high" : "");
    for (int bin = 0; bin < bin_count; bin++)
        length += (size_t)snprintf(out + length, size - length, ",bin%d", bin + 1);
    return out;
}

/* The new content of the file. */
typedef struct new_lines {
    char *kept_text;    /* the lines of the old file that are kept */
    size_t kept_bytes;  /* size of kept_text in bytes */
    const char *header; /* line of column names; NULL: the file already has one */
    int64_t kept_below; /* lines of this cycle and of later cycles are removed */
    session_event_time now;
    const session_statistics *values;
} new_lines;

/* Returns the number of significant digits that resolve the width of the range to nine digits, even if the range is far
 * from 0. It is at most the number of digits of a double. */
static int count_digits_to_resolve_range(double low, double high)
{
    enum { OF_THE_WIDTH = 9, MOST = 17 };
    const double share = (0.5 * high - 0.5 * low) / fmax(fabs(low), fabs(high));
    return share > 0 && share < 1 ? (int)fmin(OF_THE_WIDTH + floor(-log10(share)), MOST) : OF_THE_WIDTH;
}

static void write_line(text_output *out, const new_lines *n)
{
    const session_statistics *v = n->values;
    const int digits = count_digits_to_resolve_range(v->minimum, v->maximum),
              of_bins = count_digits_to_resolve_range(v->low, v->high);
    text_print(out, "%lld,%.9g,%lld,%.9g,%.*g,%.*g,%.*g,%.9g", (long long)n->now.cycle, n->now.time,
               (long long)v->cell_count, v->volume, digits, v->minimum, digits, v->maximum, digits, v->mean,
               v->deviation);
    if (v->bin_count) text_print(out, ",%.*g,%.*g", of_bins, v->low, of_bins, v->high);
    for (int bin = 0; bin < v->bin_count; bin++) text_print(out, ",%.9g", v->bin_fractions[bin]);
    text_add(out, "\n", 1);
}

static void write_lines(text_output *out, const void *what)
{
    const new_lines *n = what;
    text_print(out, "%s\n", n->header);
    if (n->kept_bytes) text_add(out, n->kept_text, n->kept_bytes);
    write_line(out, n);
}

/* Stores an error for the file and returns its status. `what` is "read" or "written". */
static insitu_status fail_at_file(const char *path, const char *what, const file_failure *failure, base_error *error)
{
    return base_fail(error, failure->is_out_of_memory ? INSITU_ERROR_MEMORY : INSITU_ERROR_IO,
                     "statistics: %.300s: cannot be %s: %s", path, what, failure->reason);
}

/* Determines which lines of the existing file are kept. */
static insitu_status select_kept_lines(const char *path, file_content *old, new_lines *lines, base_error *error)
{
    const size_t header = strlen(lines->header);
    if (strncmp(old->text, lines->header, header) != 0 || old->text[header] != '\n')
        return base_fail(error, INSITU_ERROR_IO,
                         "statistics: %.300s: exists with other columns, expected \"%.200s\" (move or delete "
                         "it to begin anew)",
                         path, lines->header);
    lines->kept_text = old->text + header + 1;
    lines->kept_bytes = text_keep_lines_below(lines->kept_text, lines->kept_below);
    return INSITU_OK;
}

/* Writes a line to a file of which lines may have to be removed, or which does not exist. */
static insitu_status rewrite_file_with_kept_lines(const char *path, new_lines *lines, base_error *error)
{
    file_content old;
    file_failure failure;
    if (!file_read_written_by_library(path, MOST_BYTES, &old, &failure) && !failure.is_missing)
        return fail_at_file(path, "read", &failure, error);
    insitu_status status = old.size ? select_kept_lines(path, &old, lines, error) : INSITU_OK;
    if (!status && !text_file_replace(path, write_lines, lines, &failure))
        status = fail_at_file(path, "written", &failure, error);
    base_free(old.text);
    return status;
}

static void write_appended_line(text_output *out, const void *what)
{
    write_line(out, what);
}

insitu_status session_write_statistics(const char *path, bool is_first, int64_t kept_below,
                                       const session_event_time *now, const session_statistics *values,
                                       base_error *error)
{
    file_failure failure = {.is_missing = is_first};
    new_lines lines = {.kept_below = kept_below, .now = *now, .values = values};
    if (!is_first && text_file_append(path, write_appended_line, &lines, &failure)) return INSITU_OK;
    if (!failure.is_missing) return fail_at_file(path, "written", &failure, error);
    char *header = make_header(values->bin_count, values->is_of_shells);
    if (!header) return session_fail_for_memory(error, 1 << 12, "a line of statistics");
    lines.header = header;
    const insitu_status status = rewrite_file_with_kept_lines(path, &lines, error);
    base_free(header);
    return status;
}
