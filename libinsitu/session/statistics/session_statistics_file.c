#include "session_statistics_file.h"

#include <errno.h>
#include <string.h>

#include "memory.h"
#include "session_agree.h"
#include "text_file.h"

/* The line of column names, without its end: from base_alloc(). NULL: no memory. */
static char *make_header(int bin_count)
{
    static const char columns[] = "cycle,time,cells,volume,minimum,maximum,mean,deviation";
    const size_t size = sizeof columns + (bin_count ? 16 + 8 * (size_t)bin_count : 0);
    char *out = base_alloc(size);
    if (!out) return NULL;
    size_t length = (size_t)snprintf(out, size, "%s%s", columns, bin_count ? ",low,high" : "");
    for (int bin = 0; bin < bin_count; bin++)
        length += (size_t)snprintf(out + length, size - length, ",bin%d", bin + 1);
    return out;
}

/* Input that a file is written from. */
typedef struct new_lines {
    char *old; /* the lines that stay */
    size_t old_size;
    const char *header; /* NULL: there is one */
    int64_t cycle;
    double time;
    const session_statistics *values;
} new_lines;

static void write_line(FILE *file, const new_lines *n)
{
    const session_statistics *v = n->values;
    fprintf(file, "%lld,%.9g,%lld,%.9g,%.9g,%.9g,%.9g,%.9g", (long long)n->cycle, n->time, (long long)v->cells,
            v->volume, v->least, v->most, v->mean, v->deviation);
    if (v->bin_count) fprintf(file, ",%.9g,%.9g", v->low, v->high);
    for (int bin = 0; bin < v->bin_count; bin++) fprintf(file, ",%.9g", v->shares[bin]);
    fputc('\n', file);
}

static void write_lines(FILE *file, const void *what)
{
    const new_lines *n = what;
    if (n->header) fprintf(file, "%s\n", n->header);
    if (n->old_size) fwrite(n->old, 1, n->old_size, file);
    write_line(file, n);
}

static insitu_status fail(const char *path, const char *what, int reason, base_error *error)
{
    return base_fail(error, reason == ENOMEM ? INSITU_ERROR_MEMORY : INSITU_ERROR_IO,
                     "statistics: %.300s: cannot be %s: %s", path, what, strerror(reason));
}

/* The session's first line. */
static insitu_status begin_file(const char *path, new_lines *lines, base_error *error)
{
    char *text;
    const size_t header = strlen(lines->header);
    if (!text_file_make_folders(path)) return fail(path, "written", errno, error);
    insitu_status status = INSITU_OK;
    if (!text_file_read(path, &text) && errno != ENOENT) return fail(path, "read", errno, error);
    if (text && *text) {
        if (strncmp(text, lines->header, header) != 0 || text[header] != '\n')
            status = base_fail(error, INSITU_ERROR_IO,
                               "statistics: %.300s: exists with other columns, expected \"%.200s\" (move or delete "
                               "it to begin anew)",
                               path, lines->header);
        else
            lines->old_size = text_keep_below(lines->old = text + header + 1, lines->cycle);
    }
    if (!status && !text_file_replace(path, write_lines, lines)) status = fail(path, "written", errno, error);
    base_free(text);
    return status;
}

static insitu_status append(const char *path, const new_lines *lines, base_error *error)
{
    c_numbers numbers;
    FILE *file = fopen(path, "ae");
    if (!file || !c_numbers_begin(&numbers)) {
        const int reason = file ? ENOMEM : errno;
        if (file) fclose(file);
        return fail(path, "written", reason, error);
    }
    write_line(file, lines);
    const bool is_written = !ferror(file);
    c_numbers_end(&numbers);
    return fclose(file) == 0 && is_written ? INSITU_OK : fail(path, "written", errno, error);
}

insitu_status session_write_statistics(const char *path, bool is_first, int64_t cycle, double time,
                                       const session_statistics *values, base_error *error)
{
    char *header = make_header(values->bin_count);
    new_lines lines = {.header = header, .cycle = cycle, .time = time, .values = values};
    if (!header) return fail(path, "written", ENOMEM, error);
    const insitu_status status = is_first ? begin_file(path, &lines, error) : append(path, &lines, error);
    base_free(header);
    return status;
}
