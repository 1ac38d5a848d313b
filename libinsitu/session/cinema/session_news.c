#include "session_news.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "session_cinema.h"
#include "text_file.h"

/* ---- warnings and errors --------------------------------------------------------------------------------------- */

static void store_line(session_news *news, int64_t cycle, const char *line, size_t size)
{
    const int64_t at = news->count++ % SESSION_NEWS_LINES;
    base_free(news->lines[at]);
    news->lines[at] = base_alloc(size + 1);
    news->cycles[at] = cycle;
    news->is_new = true;
    if (!news->lines[at]) return;
    memcpy(news->lines[at], line, size);
    news->lines[at][size] = '\0';
}

void session_record_news(session_news *news, const session_report *report, const base_error *error)
{
    const char *at = report->warnings.size ? report->warnings.data : "";
    while (*at) {
        const size_t size = strcspn(at, "\n");
        store_line(news, report->public_report.cycle, at, size);
        at += size + (at[size] == '\n');
    }
    if (!error->status && !report->public_report.images) return;
    news->is_new = news->is_new || report->public_report.images || strcmp(error->message, news->error.message) != 0;
    news->error = *error;
}

/* ---- text of report.json --------------------------------------------------------------------------------------- */

/* A text that is being written. is_complete is set as long as memory has sufficed for all of it. */
typedef struct news_text {
    session_text text;
    bool is_complete;
} news_text;

static void add_bytes(news_text *out, const char *bytes, size_t count)
{
    out->is_complete = out->is_complete && session_text_append(&out->text, bytes, count);
}

__attribute__((format(printf, 2, 3))) static void add_formatted(news_text *out, const char *format, ...)
{
    char piece[256];
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(piece, sizeof piece, format, arguments);
    va_end(arguments);
    if (length > 0) add_bytes(out, piece, (size_t)length);
}

/* Adds a JSON string in quotes, or null if text is NULL. */
static void add_quoted(news_text *out, const char *text)
{
    add_bytes(out, text ? "\"" : "null", text ? 1 : 4);
    for (; text && *text; text++) {
        if ((unsigned char)*text < 0x20) {
            add_formatted(out, "\\u%04x", (unsigned)(unsigned char)*text);
            continue;
        }
        if (*text == '"' || *text == '\\') add_bytes(out, "\\", 1);
        add_bytes(out, text, 1);
    }
    if (text) add_bytes(out, "\"", 1);
}

/* Adds a number. Infinity and NaN become null, because JSON cannot represent them. */
static void add_number(news_text *out, double number)
{
    if (isfinite(number))
        add_formatted(out, "%.17g", number);
    else
        add_bytes(out, "null", 4);
}

static void add_scene(news_text *out, const session_news_scene *source)
{
    add_formatted(out, ",\n \"scene\": {\"path\": ");
    add_quoted(out, source->path);
    add_formatted(out, ", \"modified\": ");
    if (source->stamp)
        add_formatted(out, "\"%lld.%09ld\"", (long long)source->stamp->st_mtim.tv_sec, source->stamp->st_mtim.tv_nsec);
    else
        add_quoted(out, NULL);
    add_formatted(out, ", \"error\": ");
    add_quoted(out, source->refusal);
    add_formatted(out, "},\n \"parameters\": {");
    for (int i = 0; i < source->scene->parameter_count; i++) {
        if (i) add_formatted(out, ", ");
        add_quoted(out, source->scene->parameters[i].name);
        add_formatted(out, ": ");
        add_number(out, source->scene->parameters[i].value);
    }
    add_formatted(out, "}");
}

static void add_warnings(news_text *out, const session_news *news)
{
    const int64_t first = news->count > SESSION_NEWS_LINES ? news->count - SESSION_NEWS_LINES : 0;
    bool is_first = true;
    add_formatted(out, ",\n \"warnings\": [");
    for (int64_t i = first; i < news->count; i++) {
        const int at = (int)(i % SESSION_NEWS_LINES);
        if (!news->lines[at]) continue;
        add_formatted(out, "%s\n  {\"cycle\": %lld, \"text\": ", is_first ? "" : ",", (long long)news->cycles[at]);
        add_quoted(out, news->lines[at]);
        add_formatted(out, "}");
        is_first = false;
    }
    add_formatted(out, "]}\n");
}

char *session_make_news(session_news *news, const session_news_scene *source, const insitu_report *report)
{
    news_text out = {.is_complete = true};
    c_locale numbers;
    if (!c_locale_enter(&numbers)) return NULL;
    add_formatted(&out, "{\"cycle\": %lld, \"time\": ", (long long)report->cycle);
    add_number(&out, report->time);
    add_formatted(&out, ", \"error\": ");
    add_quoted(&out, news->error.status ? news->error.message : NULL);
    add_scene(&out, source);
    add_warnings(&out, news);
    c_locale_leave(&numbers);
    if (out.is_complete) news->is_new = false;
    if (out.is_complete) return out.text.data;
    base_free(out.text.data);
    return NULL;
}

insitu_status session_write_news(const scene *scene, const char *text, base_error *error)
{
    for (int i = 0; i < scene->database_count; i++) {
        file_failure failure;
        char *path = session_database_file(&scene->databases[i], "report.json");
        const bool is_awaited = path && !file_exists(scene->databases[i].path);
        if (path && !is_awaited && !file_replace(path, text, strlen(text), &failure))
            session_fail_database(&scene->databases[i], "report.json", "written", &failure, error);
        base_free(path);
    }
    return error->status;
}

void session_news_free(session_news *news)
{
    for (int i = 0; i < SESSION_NEWS_LINES; i++) base_free(news->lines[i]);
    *news = (session_news){0};
}
