#include "session_news.h"

#include <math.h>
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

void session_record_step_messages(session_news *news, const session_report *report, const base_error *error)
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

/* Returns the size in bytes of the UTF-8 character at the start of a text that is not empty, or 0 if the text does not
 * start with one. Longer forms than necessary, surrogates and numbers above U+10FFFF are no characters (RFC 3629). */
static size_t count_character_bytes(const unsigned char *text)
{
    if (text[0] < 0x80) return 1;
    const size_t size = text[0] < 0xc2 ? 0 : text[0] < 0xe0 ? 2 : text[0] < 0xf0 ? 3 : text[0] < 0xf5 ? 4 : 0;
    const unsigned least = text[0] == 0xe0 ? 0xa0 : text[0] == 0xf0 ? 0x90 : 0x80;
    const unsigned most = text[0] == 0xed ? 0x9f : text[0] == 0xf4 ? 0x8f : 0xbf;
    if (size == 0 || text[1] < least || text[1] > most) return 0;
    for (size_t i = 2; i < size; i++)
        if ((text[i] & 0xc0) != 0x80) return 0;
    return size;
}

/* Adds a JSON string in quotes, or null if text is NULL. JSON must be UTF-8, but a name of the simulation may have
 * another encoding, and a message may have been cut inside a character. Bytes of no character become U+FFFD. */
static void add_quoted(text_output *out, const char *text)
{
    text_add(out, text ? "\"" : "null", text ? 1 : 4);
    while (text && *text) {
        const unsigned char byte = (unsigned char)*text;
        const size_t size = count_character_bytes((const unsigned char *)text);
        if (byte < 0x20 || size == 0) {
            text_print(out, "\\u%04x", size ? byte : 0xfffdU);
        } else {
            if (byte == '"' || byte == '\\') text_add(out, "\\", 1);
            text_add(out, text, size);
        }
        text += size ? size : 1;
    }
    if (text) text_add(out, "\"", 1);
}

/* Adds a number. Infinity and NaN become null, because JSON cannot represent them. */
static void add_number(text_output *out, double number)
{
    if (isfinite(number))
        text_print(out, "%.17g", number);
    else
        text_add(out, "null", 4);
}

static void add_scene(text_output *out, const session_news_scene *source)
{
    text_print(out, ",\n \"scene\": {\"path\": ");
    add_quoted(out, source->path);
    text_print(out, ", \"modified\": ");
    if (source->stamp)
        text_print(out, "\"%lld.%09ld\"", (long long)source->stamp->st_mtim.tv_sec, source->stamp->st_mtim.tv_nsec);
    else
        add_quoted(out, NULL);
    text_print(out, ", \"error\": ");
    add_quoted(out, source->refusal);
    text_print(out, "},\n \"parameters\": {");
    for (int i = 0; i < source->scene->parameter_count; i++) {
        if (i) text_print(out, ", ");
        add_quoted(out, source->scene->parameters[i].name);
        text_print(out, ": ");
        add_number(out, source->scene->parameters[i].value);
    }
    text_print(out, "}");
}

static void add_pieces(text_output *out, const char *pieces)
{
    text_print(out, ",\n \"pieces\": ");
    add_quoted(out, pieces);
}

static void add_warnings(text_output *out, const session_news *news)
{
    const int64_t first = news->count > SESSION_NEWS_LINES ? news->count - SESSION_NEWS_LINES : 0;
    bool is_first = true;
    text_print(out, ",\n \"warnings\": [");
    for (int64_t i = first; i < news->count; i++) {
        const int at = (int)(i % SESSION_NEWS_LINES);
        if (!news->lines[at]) continue;
        text_print(out, "%s\n  {\"cycle\": %lld, \"text\": ", is_first ? "" : ",", (long long)news->cycles[at]);
        add_quoted(out, news->lines[at]);
        text_print(out, "}");
        is_first = false;
    }
    text_print(out, "]}\n");
}

char *session_compose_report_json(session_news *news, const session_news_scene *source, const insitu_report *report)
{
    text_output out = {0};
    c_locale numbers;
    if (!c_locale_enter(&numbers)) return NULL;
    text_print(&out, "{\"cycle\": %lld, \"time\": ", (long long)report->cycle);
    add_number(&out, report->time);
    text_print(&out, ", \"error\": ");
    add_quoted(&out, news->error.status ? news->error.message : NULL);
    add_scene(&out, source);
    add_pieces(&out, source->pieces);
    add_warnings(&out, news);
    c_locale_leave(&numbers);
    if (!out.is_incomplete) {
        news->is_new = false;
        return out.bytes;
    }
    base_free(out.bytes);
    return NULL;
}

insitu_status session_write_report_json(const scene *scene, const char *text, base_error *error)
{
    for (int i = 0; i < scene->database_count; i++) {
        file_failure failure;
        char *path = session_make_database_path(&scene->databases[i], "report.json");
        const bool is_awaited = path && !file_exists(scene->databases[i].path);
        if (path && !is_awaited && !file_replace(path, text, strlen(text), &failure))
            session_fail_for_database_file(&scene->databases[i], "report.json", "written", &failure, error);
        base_free(path);
    }
    return error->status;
}

void session_news_free(session_news *news)
{
    for (int i = 0; i < SESSION_NEWS_LINES; i++) base_free(news->lines[i]);
    *news = (session_news){0};
}
