/* Computes the sizes of data and the numbers of cells in the step's report. They are computed at the end of a step,
 * instead of being tracked during the step. */
#include "session_summary.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "render.h"
#include "session_field_input.h"
#include "session_scalars.h"
#include "session_split.h"

static int64_t count_array_bytes(const insitu_array *array, int64_t count)
{
    return array->data ? count * session_type_size(array->type) : 0;
}

static int64_t count_mesh_bytes(const insitu_mesh *m)
{
    int64_t bytes = 0;
    for (int axis = 0; axis < 3; axis++) bytes += count_array_bytes(&m->coordinates[axis], m->vertex_count);
    bytes += count_array_bytes(&m->vertex_ids, m->vertex_count);
    bytes += count_array_bytes(&m->cell_types, m->cell_count);
    bytes += count_array_bytes(&m->face_offsets, m->face_count + (m->open_offsets ? 0 : 1));
    bytes += count_array_bytes(&m->face_connectivity, m->face_connectivity_count);
    bytes += count_array_bytes(&m->face_sizes, m->face_count);
    if (m->face_lists.data) bytes += m->face_count * (int64_t)sizeof(void *);
    bytes += count_array_bytes(&m->owner, m->face_count);
    bytes += count_array_bytes(&m->neighbour, m->neighbour_count);
    bytes += count_array_bytes(&m->boundary_face_offsets, m->boundary_face_count + 1);
    bytes += count_array_bytes(&m->boundary_face_connectivity, m->boundary_face_connectivity_count);
    bytes += count_array_bytes(&m->boundary_owner, m->boundary_face_count);
    bytes += count_array_bytes(&m->connectivity, m->connectivity_count);
    bytes += count_array_bytes(&m->offsets, m->cell_count + (m->open_offsets ? 0 : 1));
    for (int axis = 0; m->lattice && axis < 3; axis++)
        bytes += count_array_bytes(&m->lattice->axes[axis], m->lattice->cells[axis] + 1);
    return bytes + count_array_bytes(&m->ghosts, m->cell_count);
}

static int64_t count_patch_bytes(const insitu_field *field)
{
    int64_t bytes = 0;
    for (int i = 0; i < field->patch_count; i++) {
        const insitu_patch *patch = &field->patches[i];
        bytes += count_array_bytes(&patch->values, patch->count) * field->component_count;
        bytes += count_array_bytes(&patch->faces, patch->count) + count_array_bytes(&patch->offsets, patch->count + 1);
        bytes += count_array_bytes(&patch->connectivity, patch->connectivity_count);
    }
    return bytes;
}

/* MOST_REASONS: maximum number of different reasons for which data of a mesh is copied; REASON_SIZE: maximum size of
 * the text of a reason, in bytes. */
enum { MOST_REASONS = 24, REASON_SIZE = 512 };

typedef struct copied_reasons {
    int count;
    int64_t bytes[MOST_REASONS];
    char texts[MOST_REASONS][REASON_SIZE];
} copied_reasons;

__attribute__((format(printf, 3, 4))) static void add_copied_bytes_with_reason(copied_reasons *reasons, int64_t bytes,
                                                                               const char *format, ...)
{
    char words[REASON_SIZE];
    int at = 0;
    va_list arguments;
    if (!bytes) return;
    va_start(arguments, format);
    vsnprintf(words, sizeof words, format, arguments);
    va_end(arguments);
    while (at < reasons->count && strcmp(reasons->texts[at], words) != 0) at++;
    if (at == MOST_REASONS) at--; /* if there are too many reasons, the bytes are added to the last one */
    if (at == reasons->count) {
        memcpy(reasons->texts[at], words, sizeof words);
        reasons->bytes[at] = 0;
        reasons->count++;
    }
    reasons->bytes[at] += bytes;
}

static void report_copied_bytes_of_mesh(const copied_reasons *reasons, const char *mesh, session_report *out)
{
    for (int i = 0; i < reasons->count; i++) {
        out->public_report.bytes_copied += reasons->bytes[i];
        session_text_add(&out->copied_why, "mesh \"%s\": %s: %lld bytes", mesh, reasons->texts[i],
                         (long long)reasons->bytes[i]);
    }
}

static bool is_field_shown_or_displacement(const session_mesh *mesh, int field)
{
    for (int i = 0; i < mesh->scalar_count; i++)
        if (mesh->scalars[i].field == field) return true;
    return mesh->fields[field].is_displacement;
}

static int64_t count_value_bytes(const insitu_field *field)
{
    int64_t bytes = count_array_bytes(&field->values, field->count) * field->component_count;
    for (int c = 0; field->components && c < field->component_count; c++)
        bytes += count_array_bytes(&field->components[c], field->count);
    return bytes;
}

static void report_memory_of_field(session_report *out, copied_reasons *copied, const session_mesh *mesh, int index)
{
    const insitu_field *field = &mesh->fields[index].given;
    const int64_t copied_bytes = mesh->fields[index].has_borrowed_copy ? 0 : mesh->fields[index].copy_bytes;
    add_copied_bytes_with_reason(copied, copied_bytes, "field \"%s\" %s", field->name,
                                 mesh->fields[index].is_derived ? "derived from others"
                                 : mesh->finer.parts            ? "in finer cells of higher order"
                                 : field->index.data            ? "by its index"
                                 : field->corner_row            ? "in rows of corners"
                                                                : "at the corners of a discontinuous mesh");
    if (is_field_shown_or_displacement(mesh, index) && !mesh->source)
        out->public_report.bytes_borrowed +=
            count_value_bytes(field) +
            count_array_bytes(&field->index, session_count_field_entries(&mesh->original, field)) +
            count_patch_bytes(field);
}

static void report_memory_of_scalar(session_report *out, copied_reasons *copied, const session_mesh *mesh,
                                    const session_scalar *scalar)
{
    const char *name = session_get_scalar_name(mesh, scalar);
    const int64_t vertices = session_vertex_count(mesh);
    if (scalar->node_ranges) out->public_report.bytes_trees += mesh->tree.node_count * 2 * (int64_t)sizeof(float);
    if (scalar->vertex_values) {
        const insitu_centring centring = mesh->fields[scalar->field].given.centring;
        add_copied_bytes_with_reason(copied, vertices * (int64_t)sizeof(double),
                                     "field \"%s\" recentred from %s to vertices", name,
                                     centring == INSITU_CELL     ? "cells"
                                     : centring == INSITU_CORNER ? "corners"
                                                                 : "levels of refinement");
    }
    if (scalar->gradients)
        add_copied_bytes_with_reason(copied,
                                     vertices * (int64_t)sizeof *scalar->gradient_indices +
                                         scalar->gradient_count * (int64_t)sizeof *scalar->gradients,
                                     "gradients of field \"%s\" at vertices", name);
    if (scalar->distances)
        add_copied_bytes_with_reason(copied, vertices * (int64_t)sizeof(float), "distances of vertices from a slice");
}

static void report_memory_of_outer_meshes(session_report *out, copied_reasons *copied, const session_mesh *mesh)
{
    int64_t bytes = 0;
    for (int i = 0; i < mesh->outer_count; i++) {
        const session_outer *outer = mesh->outers[i];
        if (!outer->mesh) continue;
        bytes += outer->bytes;
        out->public_report.bytes_trees += outer->mesh->has_tree ? mmbvh_bytes(&outer->mesh->tree) : 0;
    }
    add_copied_bytes_with_reason(copied, bytes, "its outer faces");
}

static void report_bytes_of_copied_cell_arrays(session_report *out, copied_reasons *copied, const session_mesh *mesh)
{
    const session_topology *t = &mesh->topology;
    out->public_report.cells_recognised += mesh->source ? 0 : t->recognised_count;
    if (t->recognised_count)
        add_copied_bytes_with_reason(
            copied, t->cell_bytes,
            "%lld of %lld polyhedra are drawn as the tets, hexes, wedges or pyramids that their faces make",
            (long long)t->recognised_count, (long long)t->polyhedron_count);
    else if (t->is_split)
        add_copied_bytes_with_reason(copied, t->cell_bytes, "%lld linear pieces of its cells of higher order",
                                     (long long)t->cell_count);
    else if (t->has_own_order)
        add_copied_bytes_with_reason(copied, t->cell_bytes, "its cells' vertices, one after the other in VTK's order");
    else
        add_copied_bytes_with_reason(copied, t->cell_bytes, "its cells' faces, by owner and neighbour");
    add_copied_bytes_with_reason(copied, t->face_bytes, "its faces' vertices, out of lists");
    add_copied_bytes_with_reason(copied, mesh->conformed.bytes,
                                 "arrays that are not aligned or of types that are not read in place");
    add_copied_bytes_with_reason(copied, mesh->lattice.bytes, "coordinates along the axes of its lattice");
    add_copied_bytes_with_reason(copied, mesh->mirrored.bytes, "coordinates of its mirror images");
    add_copied_bytes_with_reason(copied, mesh->warp.bytes,
                                 "coordinates of its vertices where the scene's warp moves them");
    if (mesh->covered)
        add_copied_bytes_with_reason(copied, mesh->given.cell_count, "flags of cells that finer blocks cover");
    add_copied_bytes_with_reason(copied, mesh->finer.bytes, "nodes of finer cells, with %d piece%s between two nodes",
                                 mesh->finer.parts, mesh->finer.parts > 1 ? "s" : "");
    add_copied_bytes_with_reason(copied, mesh->discontinuous.bytes,
                                 "vertices of each cell's own, for fields with values at corners");
}

static void report_cells_and_memory_of_part(session_report *out, copied_reasons *copied, const session_mesh *mesh)
{
    insitu_report *report = &out->public_report;
    int64_t unusable = 0;
    if (!mesh->is_given) return;
    if (!mesh->source) {
        report->cells += session_cell_count(mesh);
        report->bytes_borrowed += count_mesh_bytes(&mesh->original);
    }
    report_bytes_of_copied_cell_arrays(out, copied, mesh);
    if (!mesh->is_check_stale && !mesh->source) {
        report->cells_ghost += mesh->given_counts.ghost_count;
        report->cells_inverted += mesh->given_counts.inverted_count;
        report->cells_flat += mesh->given_counts.flat_count - mesh->given_counts.shell_count;
        report->cells_shell += mesh->given_counts.shell_count;
    }
    if (mesh->has_tree) report->bytes_trees += mmbvh_bytes(&mesh->tree);
    for (int i = 0; i < mesh->field_count; i++) report_memory_of_field(out, copied, mesh, i);
    for (int i = 0; i < mesh->scalar_count; i++) {
        const session_scalar *scalar = &mesh->scalars[i];
        report_memory_of_scalar(out, copied, mesh, scalar);
        if (!scalar->is_used || !scalar->needs_ranges || mesh->source) continue;
        const int64_t count = session_count_unusable_cells(mesh, scalar);
        unusable = count > unusable ? count : unusable;
    }
    report->cells_unusable += unusable;
    report_memory_of_outer_meshes(out, copied, mesh);
}

static bool is_mesh_or_outer_surface_shown(const session_mesh *mesh)
{
    bool is_any = mesh->is_needed;
    for (int i = 0; i < mesh->outer_count; i++) is_any = is_any || mesh->outers[i]->is_needed;
    return is_any;
}

/* Returns the number of the caller's cells that the mesh's tree contains. */
static int64_t count_cells_in_tree(const session_mesh *mesh)
{
    return mesh->topology.is_split ? session_count_cells_of_pieces(mesh, mesh->tree.cells, mesh->tree.cell_count)
                                   : mesh->tree.cell_count;
}

/* Reports the data of a mesh that pictures leave out: fields and meshes that no image uses, and cells that trees do not
 * contain. All blocks of a mesh have the same fields, and each field is reported one time. */
static void report_data_not_shown(session_report *out, const session_parts *parts)
{
    const session_mesh *first = parts->items[0];
    int64_t shown = 0, drawn = 0, given = 0, partial = 0;
    for (int i = 0; i < parts->count; i++) {
        const session_mesh *part = parts->items[i];
        if (part->source) continue;
        given += part->is_given;
        shown += part->is_given && is_mesh_or_outer_surface_shown(part);
        if (!part->is_given || !part->is_needed) continue;
        drawn += part->given_counts.drawn_count;
        if (part->is_partial) partial += part->given_counts.drawn_count - count_cells_in_tree(part);
    }
    if (!given || !out->public_report.images) return;
    for (int i = 0; i < first->field_count; i++)
        if (!is_field_shown_or_displacement(first, i))
            session_text_add(&out->left_out, "mesh \"%s\": field \"%s\" is in no picture", first->name,
                             first->fields[i].given.name);
    if (!shown) session_text_add(&out->left_out, "mesh \"%s\" is in no picture: no tree is built", first->name);
    if (partial)
        session_text_add(&out->left_out,
                         "mesh \"%s\": %lld of %lld cells show nothing in this step: the tree is without them",
                         first->name, (long long)partial, (long long)drawn);
}

static void report_mesh_from_its_parts(session_report *out, const session_parts *parts)
{
    copied_reasons copied = {.count = 0};
    for (int i = 0; i < parts->count; i++) report_cells_and_memory_of_part(out, &copied, parts->items[i]);
    report_copied_bytes_of_mesh(&copied, parts->items[0]->name, out);
    report_data_not_shown(out, parts);
}

void session_add_mesh_data_to_report(const session_meshes *meshes, const mmbvh *parent, session_writer *writer,
                                     const char *scene_warning, session_report *out)
{
    insitu_report *report = &out->public_report;
    if (scene_warning) session_text_add(&out->warnings, "the scene file's last edit was not taken: %s", scene_warning);
    for (int i = 0; i < meshes->count;) {
        const session_parts parts = session_find_parts_from_index(meshes, i);
        report_mesh_from_its_parts(out, &parts);
        i += parts.count;
    }
    report->bytes_trees += mmbvh_bytes(parent);
    report->bytes_pictures = session_writer_count_bytes(writer, &report->pictures_waiting);
    session_report_end(out);
}
