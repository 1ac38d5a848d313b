/* Bytes and counts are summed up at the end of a step, instead of being tracked while it runs. */
#include "session_summary.h"

#include "render.h"
#include "session_field_input.h"
#include "session_scalars.h"

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
    bytes += array_bytes(&m->face_offsets, m->face_count + (m->open_offsets ? 0 : 1));
    bytes += array_bytes(&m->face_connectivity, m->face_connectivity_count);
    bytes += array_bytes(&m->face_sizes, m->face_count);
    if (m->face_lists.data) bytes += m->face_count * (int64_t)sizeof(void *);
    bytes += array_bytes(&m->owner, m->face_count);
    bytes += array_bytes(&m->neighbour, m->neighbour_count);
    bytes += array_bytes(&m->boundary_face_offsets, m->boundary_face_count + 1);
    bytes += array_bytes(&m->boundary_face_connectivity, m->boundary_face_connectivity_count);
    bytes += array_bytes(&m->boundary_owner, m->boundary_face_count);
    bytes += array_bytes(&m->connectivity, m->connectivity_count);
    bytes += array_bytes(&m->offsets, m->cell_count + (m->open_offsets ? 0 : 1));
    for (int axis = 0; m->lattice && axis < 3; axis++)
        bytes += array_bytes(&m->lattice->axes[axis], m->lattice->cells[axis] + 1);
    return bytes + array_bytes(&m->ghosts, m->cell_count);
}

static int64_t patch_bytes(const insitu_field *field)
{
    int64_t bytes = 0;
    for (int i = 0; i < field->patch_count; i++) {
        const insitu_patch *patch = &field->patches[i];
        bytes += array_bytes(&patch->values, patch->count) * field->component_count;
        bytes += array_bytes(&patch->faces, patch->count) + array_bytes(&patch->offsets, patch->count + 1);
        bytes += array_bytes(&patch->connectivity, patch->connectivity_count);
    }
    return bytes;
}

static bool is_field_in_use(const session_mesh *mesh, int field)
{
    for (int i = 0; i < mesh->scalar_count; i++)
        if (mesh->scalars[i].field == field) return true;
    return false;
}

static int64_t value_bytes(const insitu_field *field)
{
    int64_t bytes = array_bytes(&field->values, field->count) * field->component_count;
    for (int c = 0; field->components && c < field->component_count; c++)
        bytes += array_bytes(&field->components[c], field->count);
    return bytes;
}

static void report_field(session_report *out, const session_mesh *mesh, int index)
{
    const insitu_field *field = &mesh->fields[index].given;
    const int64_t copied = mesh->fields[index].copy_bytes;
    out->numbers.bytes_copied += copied;
    if (copied)
        session_text_add(&out->copied_why, "mesh \"%s\": field \"%s\" %s: %lld bytes", mesh->name, field->name,
                         mesh->fields[index].is_derived ? "derived from others"
                         : field->index.data            ? "by its index"
                         : field->corner_row            ? "in rows of corners"
                                                        : "at the corners of a torn mesh",
                         (long long)copied);
    if (is_field_in_use(mesh, index))
        out->numbers.bytes_borrowed += value_bytes(field) +
                                       array_bytes(&field->index, session_field_places(&mesh->given, field)) +
                                       patch_bytes(field);
    else if (out->numbers.images)
        session_text_add(&out->left_out, "mesh \"%s\": field \"%s\" is in no picture", mesh->name, field->name);
}

static void report_scalar(session_report *out, const session_mesh *mesh, const session_scalar *scalar)
{
    const char *name = session_scalar_name(mesh, scalar);
    if (scalar->pairs) out->numbers.bytes_trees += mesh->tree.node_count * 2 * (int64_t)sizeof(float);
    if (scalar->vertex_values) {
        const int64_t bytes = session_vertex_count(mesh) * (int64_t)sizeof(double);
        const bool is_of_cells = mesh->fields[scalar->field].given.centring == INSITU_CELL;
        out->numbers.bytes_copied += bytes;
        session_text_add(&out->copied_why, "mesh \"%s\": field \"%s\" recentred from %s to vertices: %lld bytes",
                         mesh->name, name, is_of_cells ? "cells" : "corners", (long long)bytes);
    }
    if (scalar->gradients) {
        const int64_t bytes = session_vertex_count(mesh) * (int64_t)sizeof *scalar->gradient_entries +
                              scalar->gradient_count * (int64_t)sizeof *scalar->gradients;
        out->numbers.bytes_copied += bytes;
        session_text_add(&out->copied_why, "mesh \"%s\": gradients of field \"%s\" at vertices: %lld bytes", mesh->name,
                         name, (long long)bytes);
    }
    if (scalar->distances) {
        const int64_t bytes = session_vertex_count(mesh) * (int64_t)sizeof(float);
        out->numbers.bytes_copied += bytes;
        session_text_add(&out->copied_why, "mesh \"%s\": distances of vertices from a slice: %lld bytes", mesh->name,
                         (long long)bytes);
    }
}

static void report_outer(session_report *out, const session_mesh *mesh)
{
    int64_t bytes = 0;
    for (int i = 0; i < mesh->outer_count; i++) {
        const session_outer *outer = mesh->outers[i];
        if (!outer->mesh) continue;
        bytes += outer->bytes;
        out->numbers.bytes_trees += outer->mesh->has_tree ? mmbvh_bytes(&outer->mesh->tree) : 0;
    }
    if (!bytes) return;
    out->numbers.bytes_copied += bytes;
    session_text_add(&out->copied_why, "mesh \"%s\": its outer faces: %lld bytes", mesh->name, (long long)bytes);
}

static void report_topology(session_report *out, const session_mesh *mesh)
{
    const session_topology *t = &mesh->topology;
    const long long bytes = t->cell_bytes, face_bytes = t->face_bytes;
    out->numbers.cells_recognised += t->recognised_count;
    out->numbers.bytes_copied += t->cell_bytes + t->face_bytes;
    if (t->recognised_count)
        session_text_add(&out->copied_why,
                         "mesh \"%s\": %lld of %lld polyhedra are drawn as the tets, hexes, wedges or pyramids that "
                         "their faces make: %lld bytes",
                         mesh->name, (long long)t->recognised_count, (long long)t->polyhedron_count, bytes);
    else if (t->has_own_order)
        session_text_add(&out->copied_why,
                         "mesh \"%s\": its cells' vertices, one after the other in VTK's order: %lld bytes", mesh->name,
                         bytes);
    else if (bytes)
        session_text_add(&out->copied_why, "mesh \"%s\": its cells' faces, by owner and neighbour: %lld bytes",
                         mesh->name, bytes);
    if (face_bytes)
        session_text_add(&out->copied_why, "mesh \"%s\": its faces' vertices, out of lists: %lld bytes", mesh->name,
                         face_bytes);
    if (mesh->conformed.bytes) {
        out->numbers.bytes_copied += mesh->conformed.bytes;
        session_text_add(&out->copied_why,
                         "mesh \"%s\": arrays that are not aligned or of types that are not read in place: %lld bytes",
                         mesh->name, (long long)mesh->conformed.bytes);
    }
    if (mesh->lattice.bytes) {
        out->numbers.bytes_copied += mesh->lattice.bytes;
        session_text_add(&out->copied_why, "mesh \"%s\": coordinates along the axes of its lattice: %lld bytes",
                         mesh->name, (long long)mesh->lattice.bytes);
    }
    if (!mesh->torn.bytes) return;
    out->numbers.bytes_copied += mesh->torn.bytes;
    session_text_add(&out->copied_why,
                     "mesh \"%s\": vertices of each cell's own, for fields with values at corners: %lld bytes",
                     mesh->name, (long long)mesh->torn.bytes);
}

static void report_mesh(session_report *out, const session_mesh *mesh)
{
    if (!mesh->is_given) return;
    insitu_report *report = &out->numbers;
    int64_t unusable = 0;
    report->cells += session_cell_count(mesh);
    report->bytes_borrowed += mesh_bytes(&mesh->original);
    report_topology(out, mesh);
    if (!mesh->is_check_stale) {
        report->cells_ghost += mesh->ghost_count;
        report->cells_inverted += mesh->inverted_count;
        report->cells_flat += mesh->flat_count - mesh->shell_count;
        report->cells_shell += mesh->shell_count;
    }
    if (mesh->has_tree) report->bytes_trees += mmbvh_bytes(&mesh->tree);
    for (int i = 0; i < mesh->field_count; i++) report_field(out, mesh, i);
    for (int i = 0; i < mesh->scalar_count; i++) {
        const session_scalar *scalar = &mesh->scalars[i];
        report_scalar(out, mesh, scalar);
        if (scalar->is_used && scalar->wants_ranges && scalar->unusable > unusable) unusable = scalar->unusable;
    }
    report->cells_unusable += unusable;
    report_outer(out, mesh);
    bool is_shown = mesh->is_needed;
    for (int i = 0; i < mesh->outer_count; i++) is_shown = is_shown || mesh->outers[i]->is_wanted;
    if (report->images && !is_shown)
        session_text_add(&out->left_out, "mesh \"%s\" is in no picture: no tree is built", mesh->name);
    if (report->images && mesh->is_needed && mesh->is_partial)
        session_text_add(
            &out->left_out, "mesh \"%s\": %lld of %lld cells show nothing in this step: the tree is without them",
            mesh->name, (long long)(mesh->drawn_count - mesh->tree.cell_count), (long long)mesh->drawn_count);
}

void session_summarize(const session_meshes *meshes, const mmbvh *parent, session_writer *writer,
                       const char *scene_warning, session_report *out)
{
    insitu_report *report = &out->numbers;
    if (scene_warning) session_text_add(&out->warnings, "the scene file's last edit was not taken: %s", scene_warning);
    for (int i = 0; i < meshes->count; i++) report_mesh(out, meshes->items[i]);
    report->bytes_trees += mmbvh_bytes(parent);
    report->bytes_pictures = session_writer_bytes(writer, &report->pictures_waiting);
    session_report_end(out);
}
