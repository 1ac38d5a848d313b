/* What a step did, in numbers and in three lists of words. */
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "error.h"
#include "memory.h"
#include "session.h"
#include "session_warnings.h"

void session_text_clear(session_text *text)
{
    text->size = 0;
    if (text->data) text->data[0] = '\0';
}

void session_text_free(session_text *text)
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

void session_text_add(session_text *text, const char *format, ...)
{
    char line[1536];
    va_list arguments;
    va_start(arguments, format);
    const int wanted = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (wanted < 0) return;
    base_escape(line, sizeof line);
    const size_t size = strlen(line);
    if (!reserve_text(text, size + 2)) return;
    if (text->size) text->data[text->size++] = '\n';
    memcpy(text->data + text->size, line, size + 1);
    text->size += size;
}

static const char *text_of(const session_text *text)
{
    return text->data ? text->data : "";
}

void session_begin_report(insitu_session *session, int64_t cycle, double time)
{
    session_text_clear(&session->copied_why);
    session_text_clear(&session->left_out);
    session_text_clear(&session->warnings);
    session->report = (insitu_report){.cycle = cycle, .time = time};
    base_memory_reset_peak();
}

static int64_t array_bytes(const insitu_array *array, int64_t count)
{
    return array->data ? count * session_type_size(array->type) : 0;
}

static int64_t mesh_bytes(const insitu_mesh *m)
{
    int64_t bytes = 0;
    for (int axis = 0; axis < 3; axis++) bytes += array_bytes(&m->coordinates[axis], m->vertex_count);
    bytes += array_bytes(&m->vertex_ids, m->vertex_count);
    bytes += array_bytes(&m->cell_types, m->cell_count);
    bytes += array_bytes(&m->face_offsets, m->face_count + 1);
    bytes += array_bytes(&m->face_connectivity, m->face_connectivity_count);
    bytes += array_bytes(&m->connectivity, m->connectivity_count);
    bytes += array_bytes(&m->offsets, m->offsets.data ? m->cell_count + 1 : 0);
    return bytes + array_bytes(&m->ghosts, m->cell_count);
}

static bool is_field_in_use(const session_mesh *mesh, int field)
{
    for (int i = 0; i < mesh->scalar_count; i++)
        if (mesh->scalars[i].field == field) return true;
    return false;
}

static void report_field(insitu_session *session, const session_mesh *mesh, int index)
{
    const insitu_field *field = &mesh->fields[index].given;
    if (is_field_in_use(mesh, index))
        session->report.bytes_borrowed += array_bytes(&field->values, field->count) * field->component_count;
    else if (session->report.images)
        session_text_add(&session->left_out, "mesh \"%s\": field \"%s\" is in no picture", mesh->name, field->name);
}

static void report_scalar(insitu_session *session, const session_mesh *mesh, const session_scalar *scalar)
{
    const char *name = mesh->fields[scalar->field].given.name;
    if (scalar->pairs) session->report.bytes_trees += mesh->tree.node_count * 2 * (int64_t)sizeof(float);
    if (scalar->vertex_values) {
        const int64_t bytes = mesh->given.vertex_count * (int64_t)sizeof(double);
        session->report.bytes_copied += bytes;
        session_text_add(&session->copied_why, "mesh \"%s\": field \"%s\" recentred from cells to vertices: %lld bytes",
                         mesh->name, name, (long long)bytes);
    }
    if (scalar->is_used && scalar->wants_ranges && scalar->unusable)
        session_text_add(&session->warnings,
                         "mesh \"%s\": %lld cells are not drawn: values of field \"%s\" are not finite", mesh->name,
                         (long long)scalar->unusable, name);
}

static void report_mesh(insitu_session *session, const session_mesh *mesh)
{
    insitu_report *report = &session->report;
    int64_t unusable = 0;
    report->cells += mesh->given.cell_count;
    report->bytes_borrowed += mesh_bytes(&mesh->given);
    if (!mesh->is_check_stale) {
        report->cells_ghost += mesh->ghost_count;
        report->cells_inverted += mesh->inverted_count;
        report->cells_flat += mesh->flat_count;
    }
    if (mesh->has_tree) report->bytes_trees += mmbvh_bytes(&mesh->tree);
    for (int i = 0; i < mesh->field_count; i++) report_field(session, mesh, i);
    for (int i = 0; i < mesh->scalar_count; i++) {
        const session_scalar *scalar = &mesh->scalars[i];
        report_scalar(session, mesh, scalar);
        if (scalar->is_used && scalar->wants_ranges && scalar->unusable > unusable) unusable = scalar->unusable;
    }
    report->cells_unusable += unusable;
    if (report->images && !mesh->is_needed)
        session_text_add(&session->left_out, "mesh \"%s\" is in no picture: no tree is built", mesh->name);
    if (report->images && mesh->is_needed && mesh->is_partial)
        session_text_add(
            &session->left_out, "mesh \"%s\": %lld of %lld cells show nothing in this step: the tree is without them",
            mesh->name, (long long)(mesh->drawn_count - mesh->tree.cell_count), (long long)mesh->drawn_count);
}

void session_end_report(insitu_session *session)
{
    insitu_report *report = &session->report;
    if (session->scene_warning)
        session_text_add(&session->warnings, "the scene file's last edit was not taken: %s", session->scene_warning);
    const char *isa = render_isa_warning();
    session_warn(session, &(session_warning){WARNING_ISA, NULL, NULL, 0}, *isa != '\0', "%s", isa);
    for (int i = 0; i < session->mesh_count; i++) report_mesh(session, session->meshes[i]);
    report->bytes_trees += mmbvh_bytes(&session->parent);
    report->bytes_pictures = (int64_t)session->picture_bytes;
    report->bytes_peak = base_memory_peak();
    report->copied_why = text_of(&session->copied_why);
    report->left_out = text_of(&session->left_out);
    report->warnings = text_of(&session->warnings);
}
