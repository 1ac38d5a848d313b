#include "session_cinema.h"

#include <stdio.h>
#include <string.h>

#include "memory.h"
#include "text_file.h"

/* maximum size in bytes of an existing table to which lines are added; about four million pictures */
enum { MOST_BYTES = 1 << 28 };

insitu_status session_fail_for_database_file(const scene_database *database, const char *file, const char *what,
                                             const file_failure *failure, base_error *error)
{
    return base_fail(error, failure->is_out_of_memory ? INSITU_ERROR_MEMORY : INSITU_ERROR_IO,
                     "cinema: %.300s/%s: cannot be %s: %s", database->path, file, what, failure->reason);
}

static insitu_status fail_memory(const scene_database *database, const char *file, const char *what, base_error *error)
{
    const file_failure failure = {.is_out_of_memory = true, .reason = "cannot allocate memory"};
    return session_fail_for_database_file(database, file, what, &failure, error);
}

char *session_make_database_path(const scene_database *database, const char *file)
{
    const size_t size = strlen(database->path) + strlen(file) + 2;
    char *path = base_alloc(size);
    if (path) snprintf(path, size, "%s/%s", database->path, file);
    return path;
}

/* ---- lines of the table ---------------------------------------------------------------------------------------- */

/* Ensures that the text has space for `more` more bytes and a terminating NUL. Returns false if memory runs out. */
static bool reserve_text(session_table *t, size_t more)
{
    if (t->size + more < t->capacity) return true;
    const size_t capacity = 2 * t->capacity + more + 4096;
    char *text = base_realloc(t->text, capacity);
    if (!text) return false;
    t->text = text;
    t->capacity = capacity;
    return true;
}

/* A line of the table while it is being written. is_complete is false if memory has run out. */
typedef struct table_line {
    session_table *table;
    bool is_complete;
} table_line;

static void add_bytes(table_line *line, const char *bytes, size_t count)
{
    session_table *t = line->table;
    line->is_complete = line->is_complete && reserve_text(t, count);
    if (!line->is_complete) return;
    memcpy(t->text + t->size, bytes, count);
    t->size += count;
}

static void add_number(table_line *line, double number)
{
    char text[32];
    const int length = snprintf(text, sizeof text, "%.9g,", number);
    add_bytes(line, text, (size_t)length);
}

/* Adds a text to the line. The text is quoted if it contains a character that separates fields (RFC 4180). If a
 * spreadsheet would interpret the text as a formula, the character `shield`, which prevents this, is put before the
 * text. */
static void add_text(table_line *line, const char *shield, const char *text, char end)
{
    const bool is_quoted = strpbrk(text, ",\"") != NULL, is_formula = *text && strchr("=+-@", *text);
    if (is_quoted) add_bytes(line, "\"", 1);
    if (is_formula) add_bytes(line, shield, strlen(shield));
    for (; *text; text++) add_bytes(line, *text == '"' ? "\"\"" : text, *text == '"' ? 2 : 1);
    if (is_quoted) add_bytes(line, "\"", 1);
    add_bytes(line, &end, 1);
}

/* Adds an empty field, which means "no value" in Spec D of Cinema databases. */
static void add_empty_field(table_line *line)
{
    add_bytes(line, ",", 1);
}

static void add_header(table_line *line)
{
    const scene_database *database = line->table->database;
    static const char begin[] = "cycle,time,", images[] = "image,", orbits[] = "phi,theta,", isovalues[] = "isovalue,",
                      planes[] = "plane,", fields[] = "field,", end[] = "FILE\n";
    add_bytes(line, begin, sizeof begin - 1);
    if (database->has_images) add_bytes(line, images, sizeof images - 1);
    if (database->has_orbits) add_bytes(line, orbits, sizeof orbits - 1);
    if (database->has_isovalues) add_bytes(line, isovalues, sizeof isovalues - 1);
    if (database->has_planes) add_bytes(line, planes, sizeof planes - 1);
    if (database->has_fields) add_bytes(line, fields, sizeof fields - 1);
    add_bytes(line, end, sizeof end - 1);
}

static void add_picture(table_line *line, const scene_image *image, const scene_placeholder_values *moment,
                        const char *file)
{
    const scene_database *database = line->table->database;
    char cycle[32];
    const int length = snprintf(cycle, sizeof cycle, "%lld,", moment->cycle);
    add_bytes(line, cycle, (size_t)length);
    add_number(line, moment->time);
    if (database->has_images) add_text(line, "'", image->name, ',');
    for (int i = 0; i < 2 && database->has_orbits; i++) {
        if (image->camera.orbit.view_count)
            add_number(line, i ? image->camera.theta : image->camera.phi);
        else
            add_empty_field(line);
    }
    if (database->has_isovalues && image->has_isovalue) add_number(line, image->isovalue);
    if (database->has_isovalues && !image->has_isovalue) add_empty_field(line);
    if (database->has_planes && image->has_plane) add_number(line, image->variant.plane);
    if (database->has_planes && !image->has_plane) add_empty_field(line);
    if (database->has_fields) add_text(line, "'", image->swept_field ? image->swept_field : "", ',');
    add_text(line, "./", file, '\n');
}

/* ---- tables in memory ------------------------------------------------------------------------------------------ */

/* Removes the lines of the cycle `cycle` and of later cycles from the table. */
static void drop_lines_from_cycle(session_table *t, int64_t cycle)
{
    const char *end = t->size ? memchr(t->text, '\n', t->size) : NULL;
    const size_t header = end ? (size_t)(end + 1 - t->text) : 0;
    t->text[t->size] = '\0';
    t->size = header + text_keep_lines_below(t->text + header, cycle);
}

/* Appends to the table the lines of the existing file data.csv, whose content is `old`, that belong to cycles before
 * `cycle`. Fails if the file has other columns. */
static insitu_status copy_earlier_lines(session_table *t, const file_content *old, int64_t cycle, base_error *error)
{
    const scene_database *database = t->database;
    if (strncmp(old->text, t->text, t->size) != 0)
        return base_fail(error, INSITU_ERROR_IO,
                         "cinema: %.300s/data.csv: exists with other columns, expected \"%.*s\" (move or delete the "
                         "folder to begin anew)",
                         database->path, (int)t->size - 1, t->text);
    table_line line = {t, true};
    add_bytes(&line, old->text + t->size, old->size - t->size);
    if (!line.is_complete) return fail_memory(database, "data.csv", "read", error);
    drop_lines_from_cycle(t, cycle);
    return INSITU_OK;
}

static insitu_status begin_table(session_table *t, int64_t cycle, base_error *error)
{
    table_line line = {t, true};
    file_content old;
    file_failure failure;
    char *path = session_make_database_path(t->database, "data.csv");
    t->size = 0;
    add_header(&line);
    if (!path || !line.is_complete) {
        base_free(path);
        return fail_memory(t->database, "data.csv", "read", error);
    }
    insitu_status status = INSITU_OK;
    if (!file_read_written_by_library(path, MOST_BYTES, &old, &failure) && !failure.is_missing)
        status = session_fail_for_database_file(t->database, "data.csv", "read", &failure, error);
    if (!status && old.size) status = copy_earlier_lines(t, &old, cycle, error);
    base_free(old.text);
    base_free(path);
    t->has_earlier_lines = !status;
    t->last_cycle = INT64_MIN;
    return status;
}

void session_store_first_cinema_cycle(session_cinema *cinema, int64_t cycle)
{
    if (!cinema->has_begun) cinema->first_cycle = cycle;
    cinema->has_begun = true;
}

static bool make_tables(session_cinema *cinema, const scene *scene)
{
    if (cinema->tables) return true;
    cinema->tables = base_calloc((size_t)scene->database_count, sizeof *cinema->tables);
    if (!cinema->tables) return false;
    cinema->count = scene->database_count;
    for (int i = 0; i < cinema->count; i++) cinema->tables[i].database = &scene->databases[i];
    return true;
}

insitu_status session_record_picture(session_cinema *cinema, const scene *scene, const scene_image *image,
                                     const scene_output *output, const scene_placeholder_values *moment,
                                     base_error *error)
{
    const scene_database *database = &scene->databases[output->database];
    c_locale numbers;
    if (!make_tables(cinema, scene)) return fail_memory(database, "data.csv", "written", error);
    session_table *t = &cinema->tables[output->database];
    insitu_status status = t->has_earlier_lines ? INSITU_OK : begin_table(t, cinema->first_cycle, error);
    if (status) return status;
    if (!t->has_lines_of_step && moment->cycle <= t->last_cycle) drop_lines_from_cycle(t, moment->cycle);
    char *file = scene_expand_placeholders(output->path + output->folder_bytes, moment);
    if (!file || !c_locale_enter(&numbers)) {
        base_free(file);
        return fail_memory(database, "data.csv", "written", error);
    }
    const size_t before = t->size;
    table_line line = {t, true};
    add_picture(&line, image, moment, file);
    c_locale_leave(&numbers);
    base_free(file);
    if (!line.is_complete) {
        t->size = before;
        return fail_memory(database, "data.csv", "written", error);
    }
    t->has_lines_of_step = t->is_changed = true;
    t->last_cycle = moment->cycle;
    return INSITU_OK;
}

/* ---- files of the database ------------------------------------------------------------------------------------- */

/* Returns whether a byte must be escaped in a string of the script data.js. Bytes above 0x7f need no escape, since the
 * script is UTF-8. */
static bool must_escape(unsigned char byte)
{
    return byte == '"' || byte == '\\' || byte < 0x20;
}

static void write_script_line(text_output *out, const char *line, size_t size)
{
    for (size_t at = 0, end; at < size; at = end) {
        for (end = at; end < size && !must_escape((unsigned char)line[end]);) end++;
        if (end > at)
            text_add(out, line + at, end - at);
        else
            text_print(out, "\\x%02x", (unsigned)(unsigned char)line[end++]);
    }
}

/* Writes data.js: a call of the page's function cinemaTable() with an array of strings, one per line of the table. */
static void write_script(text_output *out, const void *what)
{
    const session_table *t = what;
    text_print(out, "cinemaTable([\n");
    for (size_t at = 0, size; at < t->size; at += size + 1) {
        size = (size_t)((const char *)memchr(t->text + at, '\n', t->size - at) - (t->text + at));
        text_add(out, "\"", 1);
        write_script_line(out, t->text + at, size);
        text_add(out, "\",\n", 3);
    }
    text_print(out, "]);\n");
}

typedef bool table_writer(const session_table *t, const char *path, file_failure *failure);

static bool write_table_file(const session_table *t, const char *path, file_failure *failure)
{
    return file_replace(path, t->text, t->size, failure);
}

static bool write_script_file(const session_table *t, const char *path, file_failure *failure)
{
    return text_file_replace(path, write_script, t, failure);
}

/* Writes index.html if it does not exist, or if this session has not written it yet. Its content is always the same. */
static bool write_page_file(const session_table *t, const char *path, file_failure *failure)
{
    if (t->has_page && file_exists(path)) return true;
    return file_replace(path, (const char *)session_cinema_page, session_cinema_page_size, failure);
}

static insitu_status write_file(const session_table *t, const char *name, table_writer *put, base_error *error)
{
    file_failure failure;
    char *path = session_make_database_path(t->database, name);
    if (!path) return fail_memory(t->database, name, "written", error);
    const bool is_written = put(t, path, &failure);
    base_free(path);
    return is_written ? INSITU_OK : session_fail_for_database_file(t->database, name, "written", &failure, error);
}

insitu_status session_write_cinema(session_cinema *cinema, base_error *error)
{
    for (int i = 0; i < cinema->count; i++) {
        session_table *t = &cinema->tables[i];
        base_error own = {.status = INSITU_OK};
        t->has_lines_of_step = false;
        if (!t->is_changed) continue;
        insitu_status status = write_file(t, "data.csv", write_table_file, &own);
        if (!status) status = write_file(t, "data.js", write_script_file, &own);
        if (!status) status = write_file(t, "index.html", write_page_file, &own);
        t->is_changed = status != INSITU_OK;
        t->has_page = t->has_page || !status;
        if (status && !error->status) *error = own;
    }
    return error->status;
}

void session_cinema_free(session_cinema *cinema)
{
    for (int i = 0; i < cinema->count; i++) base_free(cinema->tables[i].text);
    base_free(cinema->tables);
    *cinema = (session_cinema){0};
}
