/* Each reported warning is stored as a hash of its subject (session_warning), so that it is not reported again. */
#include "session_report.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "error.h"
#include "memory.h"
#include "session_hash.h"

/* ---- texts that consist of lines --------------------------------------------------------------------------------- */

static void clear_text(session_text *text)
{
    text->size = 0;
    if (text->data) text->data[0] = '\0';
}

static void free_text(session_text *text)
{
    base_free(text->data);
    *text = (session_text){0};
}

static bool reserve_text(session_text *text, size_t bytes)
{
    if (text->size + bytes <= text->capacity) return true;
    const size_t capacity = 2 * (text->size + bytes);
    char *data = base_realloc(text->data, capacity);
    if (!data) return false;
    text->data = data;
    text->capacity = capacity;
    return true;
}

/* Appends bytes and a NUL, for which there must be space. */
static void append_text(session_text *text, const char *bytes, size_t count)
{
    memcpy(text->data + text->size, bytes, count);
    text->size += count;
    text->data[text->size] = '\0';
}

void session_text_add(session_text *text, const char *format, ...)
{
    char line[1536];
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (length < 0) return;
    base_escape(line, sizeof line);
    const size_t size = strlen(line);
    if (!reserve_text(text, size + 2)) return;
    if (text->size) append_text(text, "\n", 1);
    append_text(text, line, size);
}

static const char *text_or_empty(const session_text *text)
{
    return text->data ? text->data : "";
}

void session_report_create(session_report *report)
{
    *report = (session_report){
        .public_report = {.schedule = "", .copied_why = "", .left_out = "", .warnings = "", .pieces = ""}};
}

void session_report_begin(session_report *report, int64_t cycle, double time)
{
    report->public_report = (insitu_report){.cycle = cycle, .time = time, .schedule = ""};
    clear_text(&report->copied_why);
    clear_text(&report->left_out);
    clear_text(&report->warnings);
    clear_text(&report->pieces);
    base_memory_reset_peak();
}

void session_report_end(session_report *report)
{
    report->public_report.bytes_peak = base_memory_peak();
    report->public_report.copied_why = text_or_empty(&report->copied_why);
    report->public_report.left_out = text_or_empty(&report->left_out);
    report->public_report.warnings = text_or_empty(&report->warnings);
    report->public_report.pieces = text_or_empty(&report->pieces);
}

void session_report_free(session_report *report)
{
    free_text(&report->copied_why);
    free_text(&report->left_out);
    free_text(&report->warnings);
    free_text(&report->pieces);
    free_text(&report->own_warnings);
    base_free(report->reported);
}

/* ---- warnings ------------------------------------------------------------------------------------------------ */

static uint64_t hash_warning(const session_warning *w)
{
    const char *const texts[2] = {w->image ? w->image : "", w->mesh ? w->mesh : ""};
    const int numbers[2] = {(int)w->kind, w->number};
    uint64_t key = SESSION_HASH_BEGIN;
    session_hash_bytes(&key, numbers, sizeof numbers);
    for (int i = 0; i < 2; i++) session_hash_text(&key, texts[i]);
    return key;
}

/* Returns the index of the first hash in the sorted array `reported` that is not less than `key`, the hash of a
 * warning; reported_count if all are less. */
static int find_reported_warning(const session_report *report, uint64_t key)
{
    int begin = 0, end = report->reported_count;
    while (begin < end) {
        const int middle = begin + (end - begin) / 2;
        if (report->reported[middle] < key)
            begin = middle + 1;
        else
            end = middle;
    }
    return begin;
}

static bool is_reported_key_at(const session_report *report, int at, uint64_t key)
{
    return at < report->reported_count && report->reported[at] == key;
}

/* Inserts a warning's hash `key` into the sorted array of reported warnings at index `at`. If memory runs out, the hash
 * is not stored, so that the warning will be reported again. */
static void add_reported_warning(session_report *report, int at, uint64_t key)
{
    const int count = report->reported_count;
    if (count == report->reported_capacity) {
        const int capacity = 2 * count + 8;
        uint64_t *reported = base_realloc(report->reported, (size_t)capacity * sizeof *reported);
        if (!reported) return;
        report->reported = reported;
        report->reported_capacity = capacity;
    }
    memmove(report->reported + at + 1, report->reported + at, (size_t)(count - at) * sizeof *report->reported);
    report->reported[at] = key;
    report->reported_count++;
}

static void remove_reported_warning(session_report *report, int at)
{
    const int behind = --report->reported_count - at;
    memmove(report->reported + at, report->reported + at + 1, (size_t)behind * sizeof *report->reported);
}

static void add_warning(session_report *report, session_text *text, const session_warning *warning, bool holds,
                        const char *format, va_list arguments)
{
    const uint64_t key = hash_warning(warning);
    const int at = find_reported_warning(report, key);
    const bool is_reported = is_reported_key_at(report, at, key);
    if (holds && !is_reported) {
        char line[1024];
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wformat-nonliteral"
        vsnprintf(line, sizeof line, format, arguments);
#pragma GCC diagnostic pop
        session_text_add(text, "%s", line);
        add_reported_warning(report, at, key);
    } else if (!holds && is_reported) {
        remove_reported_warning(report, at);
    }
}

void session_warn(session_report *report, const session_warning *warning, bool holds, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    add_warning(report, &report->warnings, warning, holds, format, arguments);
    va_end(arguments);
}

void session_warn_locally(session_report *report, const session_warning *warning, bool holds, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    add_warning(report, &report->own_warnings, warning, holds, format, arguments);
    va_end(arguments);
}

bool session_has_reported_warning(const session_report *report, const session_warning *warning)
{
    const uint64_t key = hash_warning(warning);
    return is_reported_key_at(report, find_reported_warning(report, key), key);
}

void session_clear_reported_warnings(session_report *report)
{
    report->reported_count = 0;
    report->unusable_key = 0;
}
