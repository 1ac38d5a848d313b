/* Finds the mistake in a text that is not valid YAML. libyaml reports the position at which it could not continue, in
 * terms of the grammar. This position is often several lines behind the mistake. The report is therefore only used to
 * select the lines to examine: the lines from the start of the structure that could not be completed to the reported
 * position. They are searched for common mistakes, beginning with those that can be identified most reliably. Any other
 * mistake is reported in libyaml's words. */
#include "scene_syntax.h"

#include <ctype.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

enum { longest_quote = 40 };

/* A line of the text, without its line ending. */
typedef struct text_line {
    const char *start;
    size_t length;
    size_t indent; /* number of leading blanks and tabs; equal to the length of a line that has nothing else */
    size_t number; /* index of the line, from 0 */
} text_line;

typedef struct fault {
    const yaml_parser_t *parser;
    const char *text;
    size_t size;
    size_t first_line, last_line; /* indices, from 0, of the first and the last line to examine */
    bool is_flow;                 /* set if the position of the error is within { } or [ ] */
    size_t *line;
    char *words;
} fault;

static text_line parse_text_line(const char *start, const char *end, size_t number)
{
    const char *stop = memchr(start, '\n', (size_t)(end - start));
    text_line l = {.start = start, .length = (size_t)((stop ? stop : end) - start), .number = number};
    while (l.length > 0 && l.start[l.length - 1] == '\r') l.length--;
    while (l.indent < l.length && (l.start[l.indent] == ' ' || l.start[l.indent] == '\t')) l.indent++;
    return l;
}

/* Returns the line after this one; if this is the last line, returns an empty line. */
static text_line find_next_line(text_line l, const char *end)
{
    const char *stop = memchr(l.start, '\n', (size_t)(end - l.start));
    return parse_text_line(stop ? stop + 1 : end, end, l.number + 1);
}

static text_line find_line_by_index(const char *text, size_t size, size_t number)
{
    text_line l = parse_text_line(text, text + size, 0);
    while (l.number < number) l = find_next_line(l, text + size);
    return l;
}

static bool has_text_besides_comment(text_line l)
{
    return l.indent < l.length && l.start[l.indent] != '#';
}

/* Stores the message and the line of the error. line: index of the line, from 0. Always returns true, so that a rule
 * can return the result of this call when it has found an error. */
__attribute__((format(printf, 3, 4))) static bool write_syntax_error(const fault *f, size_t line, const char *format,
                                                                     ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(f->words, SCENE_SYNTAX_SIZE, format, arguments);
    va_end(arguments);
    *f->line = line + 1;
    return true;
}

static int limit_length_of_quotation(size_t length)
{
    return (int)(length < longest_quote ? length : longest_quote);
}

/* ---- rules: each writes a message about one kind of mistake and returns true, or returns false ------------------- */

static bool report_tab_indent(const fault *f, text_line l)
{
    const char *tab = memchr(l.start, '\t', l.indent);
    if (!tab || !has_text_besides_comment(l)) return false;
    return write_syntax_error(f, l.number, "a tab stands before \"%.*s\", expected blanks: tabs are not allowed there",
                              limit_length_of_quotation(l.length - l.indent), l.start + l.indent);
}

/* Returns whether the character at p is within quotes, or is a quotation mark that begins or ends a quoted text. *quote
 * is the quotation mark that is open before p, or 0; it is updated. */
static bool is_in_quotes(text_line l, const char *p, char *quote)
{
    const bool begins = p == l.start || strchr(" \t[{,:", p[-1]);
    if (!*quote && begins && (*p == '"' || *p == '\'')) return *quote = *p, true;
    if (!*quote) return false;
    if (*quote == *p) *quote = '\0';
    return true;
}

static const char *find_colour_turned_into_comment(text_line l, size_t *length)
{
    char quote = '\0';
    for (size_t i = 1; i < l.length; i++) {
        if (is_in_quotes(l, l.start + i, &quote) || l.start[i] != '#' || !strchr(" \t[{,", l.start[i - 1])) continue;
        size_t digits = 0;
        while (i + 1 + digits < l.length && isxdigit((unsigned char)l.start[i + 1 + digits])) digits++;
        const bool is_colour = digits == 3 || digits == 6 || digits == 8;
        *length = digits + 1;
        return is_colour ? l.start + i : NULL;
    }
    return NULL;
}

const char *scene_find_colour_in_comment(const char *text, size_t size, size_t line, size_t *length)
{
    return find_colour_turned_into_comment(find_line_by_index(text, size, line - 1), length);
}

static bool report_colour_turned_into_comment(const fault *f, text_line l)
{
    size_t length;
    const char *colour = find_colour_turned_into_comment(l, &length);
    if (!colour) return false;
    return write_syntax_error(f, l.number,
                              "a # behind a blank begins a comment, expected the colour in quotes: \"%.*s\"",
                              (int)length, colour);
}

/* Returns the length of a placeholder such as {cycle:04} at the start of a text, or 0 if there is none. */
static size_t get_placeholder_length(const char *at, const char *end)
{
    const char *p = at + 1;
    if (at >= end || *at != '{') return 0;
    while (p < end && (isalnum((unsigned char)*p) || *p == '_' || *p == ':' || *p == '.')) p++;
    const bool is_one = p > at + 1 && p < end && *p == '}' && isalpha((unsigned char)at[1]);
    return is_one ? (size_t)(p - at) + 1 : 0;
}

/* Returns the length of a word: placeholders and other characters up to a blank, comma, bracket or quotation mark. */
static size_t get_unquoted_word_length(const char *at, const char *end)
{
    const char *p = at;
    while (p < end) {
        const size_t placeholder = get_placeholder_length(p, end);
        if (placeholder == 0 && strchr(" \t,{}[]\"'", *p)) break;
        p += placeholder ? placeholder : 1;
    }
    return (size_t)(p - at);
}

/* Returns the length of the unquoted text that begins at `at`, whose first word has the length `word`. The text ends
 * after this word if a comma, a # or another key follows on the line, and otherwise at the end of the line. */
static size_t get_unquoted_text_length(const char *at, size_t word, const char *end)
{
    while (end > at && (end[-1] == ' ' || end[-1] == '\t')) end--;
    for (const char *p = at + word; p < end; p++)
        if (*p == ',' || *p == '#' || (*p == ':' && p + 1 < end && p[1] == ' ')) return word;
    return (size_t)(end - at);
}

/* Reports a text with a placeholder that is not in quotes, such as path: {name}.png. */
static bool report_unquoted_placeholder(const fault *f, text_line l)
{
    const char *end = l.start + l.length;
    char quote = '\0';
    for (const char *p = l.start + l.indent; p < end; p++) {
        if (is_in_quotes(l, p, &quote)) continue;
        const bool begins = p > l.start && strchr(" \t[{,", p[-1]) && !strchr(" \t,{}[]", *p);
        const bool is_placeholder = *p == '{' && get_placeholder_length(p, end) > 0;
        if (!begins && !is_placeholder) continue;
        const size_t length = get_unquoted_word_length(p, end);
        if (!memchr(p, '{', length)) continue;
        /* a text that consists only of {name} could also be a mapping */
        if (is_placeholder && length == get_placeholder_length(p, end) && f->is_flow) continue;
        return write_syntax_error(f, l.number, "a text with { } needs quotes, expected \"%.*s\"",
                                  (int)(f->is_flow ? length : get_unquoted_text_length(p, length, end)), p);
    }
    return false;
}

static bool report_unclosed_quote(const fault *f, text_line l)
{
    const char *context = f->parser->context ? f->parser->context : "";
    if (!strstr(context, "quoted scalar")) return false;
    const char *problem = f->parser->problem ? f->parser->problem : "";
    if (strstr(problem, "escape"))
        return write_syntax_error(
            f, f->parser->problem_mark.line,
            "a \\ in double quotes begins a special character, expected \\\\, or single quotes around the text");
    const size_t column = f->parser->context_mark.column;
    const size_t length = column < l.length ? l.length - column : 0;
    return write_syntax_error(f, l.number, "the text %.*s has no end, expected %c at its end",
                              limit_length_of_quotation(length), l.start + column,
                              column < l.length ? l.start[column] : '"');
}

/* Reports a quotation mark in an earlier line that is closed only by the quotation mark in this line. */
static bool report_unclosed_quote_above(const fault *f, text_line l)
{
    const char *quote = NULL; /* opening quotation mark that is not closed so far; NULL if there is none */
    text_line opened = l;
    for (text_line other = find_line_by_index(f->text, f->size, 0); other.number < l.number;
         other = find_next_line(other, f->text + f->size))
        for (size_t i = 0; i < other.length && has_text_besides_comment(other); i++) {
            if (other.start[i] != '"') continue;
            quote = quote ? NULL : other.start + i;
            opened = other;
        }
    if (!quote) return false;
    return write_syntax_error(f, opened.number, "the text %.*s has no end, expected \" at its end",
                              limit_length_of_quotation((size_t)(opened.start + opened.length - quote)), quote);
}

/* Reports the last of the earlier lines that end with an opening bracket, because this bracket is most likely the one
 * that is not closed. */
static bool report_last_open_bracket_above(const fault *f)
{
    bool is_reported = false;
    for (text_line l = find_line_by_index(f->text, f->size, 0); l.number < f->last_line;
         l = find_next_line(l, f->text + f->size)) {
        const char last = has_text_besides_comment(l) ? l.start[l.length - 1] : ' ';
        if (last == '[' || last == '{')
            is_reported = write_syntax_error(f, l.number, "the %c of this line is not closed, expected %c", last,
                                             last == '[' ? ']' : '}');
    }
    return is_reported;
}

static bool report_unclosed_bracket(const fault *f, text_line l)
{
    const char *problem = f->parser->problem ? f->parser->problem : "";
    if (f->is_flow && strstr(problem, "node content")) return report_last_open_bracket_above(f);
    if (!f->is_flow || !strstr(problem, "expected ','")) return false;
    const char open = strchr(problem, '}') ? '{' : '[', close = open == '{' ? '}' : ']';
    const text_line stop = find_line_by_index(f->text, f->size, f->last_line);
    size_t column = f->parser->problem_mark.column;
    /* the text before this colon is a key that is indented too little */
    if (column < stop.length && stop.start[column] == ':')
        while (column > stop.indent && !strchr(" {[,", stop.start[column - 1])) column--;
    const size_t length = column < stop.length ? stop.length - column : 0;
    if (l.number == stop.number && length > 0)
        return write_syntax_error(f, l.number, "expected a comma or %c before \"%.*s\"", close,
                                  limit_length_of_quotation(length), stop.start + column);
    return write_syntax_error(f, l.number, "the %c of this line is not closed, expected %c", open, close);
}

/* Returns the last line with content before the line with index `number`; if there is none, returns the line with this
 * index. */
static text_line find_previous_line(const fault *f, size_t number)
{
    text_line found = find_line_by_index(f->text, f->size, number);
    for (text_line l = find_line_by_index(f->text, f->size, 0); l.number < number;
         l = find_next_line(l, f->text + f->size))
        if (has_text_besides_comment(l)) found = l;
    return found;
}

static bool is_list_item(text_line l)
{
    return l.indent + 1 < l.length && l.start[l.indent] == '-' && l.start[l.indent + 1] == ' ';
}

/* Returns the line with content, among those before this one, whose indentation is nearest to that of this line. If
 * this line is a list item, only list items are searched. Otherwise the indentation of a list item counts as that of
 * the keys in it, which is 2 more. *expected receives the indentation that this line should probably have. */
static text_line find_line_with_nearest_indentation(const fault *f, text_line l, size_t *expected)
{
    text_line nearest = l;
    size_t least = (size_t)-1;
    for (text_line other = find_line_by_index(f->text, f->size, 0); other.number < l.number;
         other = find_next_line(other, f->text + f->size)) {
        if (!has_text_besides_comment(other) || (is_list_item(l) && !is_list_item(other))) continue;
        const size_t at = other.indent + (is_list_item(other) && !is_list_item(l) ? 2 : 0);
        const size_t distance = at > l.indent ? at - l.indent : l.indent - at;
        if (distance > least) continue;
        least = distance;
        *expected = at;
        nearest = other;
    }
    return nearest;
}

/* Reports that the line before this one lacks a colon, or a blank after its hyphen, so that this line cannot continue
 * it. */
static bool report_incomplete_previous_line(const fault *f, text_line l)
{
    const char *problem = f->parser->problem ? f->parser->problem : "";
    if (!strstr(problem, "not allowed") && !strstr(problem, "did not find expected")) return false;
    const text_line other = find_previous_line(f, l.number);
    const char *start = other.start + other.indent, *end = other.start + other.length;
    if (other.number == l.number || strchr("\"'[]{}", end[-1])) return false;
    if (start + 1 < end && *start == '-' && isalpha((unsigned char)start[1]))
        return write_syntax_error(f, other.number, "no blank behind the - of a list, expected \"- %.*s\"",
                                  limit_length_of_quotation((size_t)(end - start) - 1), start + 1);
    start += is_list_item(other) ? 2 : 0;
    if (memchr(start, ':', (size_t)(end - start))) return false;
    return write_syntax_error(f, other.number, "\"%.*s\" has no colon, expected \"%.*s:\"",
                              limit_length_of_quotation((size_t)(end - start)), start, (int)strcspn(start, " =;\r\n"),
                              start);
}

static const char *get_plural_ending(size_t count)
{
    return count == 1 ? "" : "s";
}

static bool report_inconsistent_indentation(const fault *f, text_line l)
{
    const char *problem = f->parser->problem ? f->parser->problem : "";
    const bool is_deeper = strstr(problem, "mapping values are not allowed") != NULL;
    const size_t key_length = strcspn(l.start + l.indent, ":\r\n");
    const size_t column = f->parser->problem_mark.column;
    if (is_deeper ? column > l.indent + key_length : column != l.indent) return false;
    if (!is_deeper && !strstr(problem, "did not find expected")) return false;
    size_t expected = l.indent;
    const text_line other = find_line_with_nearest_indentation(f, l, &expected);
    if (expected == l.indent) return false;
    return write_syntax_error(f, l.number,
                              "wrong indentation: %zu blank%s before \"%.*s\", expected %zu, as in line %zu", l.indent,
                              get_plural_ending(l.indent), limit_length_of_quotation(key_length), l.start + l.indent,
                              expected, other.number + 1);
}

/* Reports text after a complete value, as in title: "a" b, or an unquoted text with a colon, as in title: a: b. */
static bool report_misplaced_unquoted_text(const fault *f, text_line l)
{
    const char *problem = f->parser->problem ? f->parser->problem : "";
    const bool has_colon = strstr(problem, "mapping values are not allowed") != NULL;
    if (!has_colon && !strstr(problem, "did not find expected")) return false;
    if (!has_colon && report_unclosed_quote_above(f, l)) return true;
    const char *colon = memchr(l.start + l.indent, ':', l.length - l.indent);
    if (!colon) return false;
    const char *value = colon + 1;
    while (value < l.start + l.length && *value == ' ') value++;
    const size_t length = (size_t)(l.start + l.length - value);
    if (length == 0) return false;
    if (has_colon)
        return write_syntax_error(f, l.number, "a text with \": \" needs quotes, expected \"%.*s\"",
                                  limit_length_of_quotation(length), value);
    return write_syntax_error(f, l.number,
                              "the value ends before the line does, found %.*s, expected quotes around all of it",
                              limit_length_of_quotation(length), value);
}

static bool report_key_without_colon(const fault *f)
{
    const char *problem = f->parser->problem ? f->parser->problem : "";
    if (!strstr(problem, "could not find expected ':'")) return false;
    const text_line l = find_line_by_index(f->text, f->size, f->parser->context_mark.line);
    const size_t column = f->parser->context_mark.column;
    const size_t length = column < l.length ? l.length - column : 0;
    const char *colon = memchr(l.start + column, ':', length);
    if (colon)
        return write_syntax_error(f, l.number, "no blank behind the colon in \"%.*s\", expected \"%.*s: ...\"",
                                  limit_length_of_quotation(length), l.start + column,
                                  limit_length_of_quotation((size_t)(colon - l.start) - column), l.start + column);
    return write_syntax_error(f, l.number, "\"%.*s\" has no colon, expected \"key: value\"",
                              limit_length_of_quotation(length), l.start + column);
}

static bool report_invalid_start_of_value(const fault *f)
{
    const char *problem = f->parser->problem ? f->parser->problem : "";
    const text_line l = find_line_by_index(f->text, f->size, f->parser->problem_mark.line);
    const size_t column = f->parser->problem_mark.column;
    if (strstr(problem, "block sequence entries are not allowed"))
        return write_syntax_error(f, l.number,
                                  "a list's \"-\" behind a key, expected it on a line of its own, or the list in [ ]");
    if (!strstr(problem, "cannot start any token") || column >= l.length) return false;
    return write_syntax_error(f, l.number, "no text begins with %c, expected quotes around \"%.*s\"", l.start[column],
                              (int)get_unquoted_word_length(l.start + column, l.start + l.length), l.start + column);
}

/* ---- search for the mistake ------------------------------------------------------------------------------------- */

static bool apply_rule_to_lines(const fault *f, bool (*rule)(const fault *f, text_line l))
{
    for (text_line l = find_line_by_index(f->text, f->size, f->first_line); l.number <= f->last_line;
         l = find_next_line(l, f->text + f->size))
        if (rule(f, l)) return true;
    return false;
}

void scene_describe_syntax_error(const yaml_parser_t *parser, const char *text, size_t size, size_t *line,
                                 char words[SCENE_SYNTAX_SIZE])
{
    const char *context = parser->context ? parser->context : "";
    fault f = {.parser = parser, .text = text, .size = size, .line = line, .words = words};
    f.is_flow = strstr(context, "flow") != NULL;
    f.last_line = parser->problem_mark.line;
    const bool is_before = (f.is_flow || strstr(context, "scan")) && parser->context_mark.line < f.last_line;
    f.first_line = is_before ? parser->context_mark.line : f.last_line;
    const text_line begin = find_line_by_index(text, size, f.first_line),
                    stop = find_line_by_index(text, size, f.last_line);
    if (apply_rule_to_lines(&f, report_tab_indent) || apply_rule_to_lines(&f, report_colour_turned_into_comment) ||
        apply_rule_to_lines(&f, report_unquoted_placeholder))
        return;
    if (report_unclosed_quote(&f, begin) || report_unclosed_bracket(&f, begin) ||
        report_incomplete_previous_line(&f, stop))
        return;
    if (report_inconsistent_indentation(&f, stop) || report_key_without_colon(&f) ||
        report_invalid_start_of_value(&f) || report_misplaced_unquoted_text(&f, stop))
        return;
    write_syntax_error(&f, f.last_line, "not valid YAML: %.100s%s%.100s",
                       parser->problem ? parser->problem : "unreadable", *context ? " " : "", context);
}
