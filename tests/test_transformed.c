#include "test_transformed.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { MOST_TEXT = 1 << 13 };

static double read_number(const insitu_array *array, int64_t i)
{
    const int64_t size = array->type == INSITU_FLOAT64 ? 8 : 4;
    const char *at = (const char *)array->data + i * (array->stride_bytes ? array->stride_bytes : size);
    float narrow;
    double wide;
    if (size == 8) return memcpy(&wide, at, sizeof wide), wide;
    return memcpy(&narrow, at, sizeof narrow), (double)narrow;
}

void compute_vertex_position(const insitu_mesh *mesh, int64_t vertex, double out[3])
{
    const insitu_lattice *l = mesh->lattice;
    const bool has_axes = l && !mesh->coordinates[0].data;
    for (int axis = 0; axis < 3; axis++) {
        const insitu_array *given = &mesh->coordinates[axis];
        int64_t at = vertex;
        for (int a = 0; has_axes && a < axis; a++) at /= l->cells[a] + 1;
        if (has_axes) at %= l->cells[axis] + 1;
        out[axis] = !has_axes               ? given->data ? read_number(given, vertex) : 0
                    : l->axes[axis].data    ? read_number(&l->axes[axis], at)
                    : l->spacing[axis] != 0 ? l->origin[axis] + l->spacing[axis] * (double)(l->first[axis] + at)
                                            : 0;
    }
}

insitu_status copy_filled_values(void *filled, insitu_field *field)
{
    filled_values *f = filled;
    int one = 1, ranks = 0;
    /* completes only if all ranks call this function */
    MPI_Allreduce(&one, &ranks, 1, MPI_INT, MPI_SUM, MPI_COMM_WORLD);
    f->calls += ranks == rank_count;
    field->count = f->count;
    field->values = f->values;
    return INSITU_OK;
}

void expect_same(drawn *a, drawn *b, const char *what)
{
    const bool is_same = are_same_picture_sets(a, b), has_any = own_rank != 0 || a->count > 0;
    if (!is_same || !has_any) fprintf(stderr, "%s\n", what);
    everywhere(is_same && has_any);
    free_picture_set(a);
    free_picture_set(b);
}

insitu_session *open_session_from_texts(MPI_Comm comm, const char *before, const char *scene)
{
    char text[MOST_TEXT];
    insitu_session *session = NULL;
    snprintf(text, sizeof text, "%s%s", before, scene);
    const insitu_status status = insitu_create_from_text(comm, text, &session);
    if (status) fprintf(stderr, "%s\n", insitu_error(NULL));
    assert_int_equal(status, INSITU_OK);
    return session;
}

const char all_layers[] = "threads: 1\nimages:\n" LAYERS("a", "[{isosurface: {field: f, values: [0.1]}}]")
    LAYERS("b", "[{volume: {field: f}}]") LAYERS("c", "[{slice: {field: f, planes: [{normal: [1, 2, 3]}]}}]")
        LAYERS("d", "[{surface: {colour_by: {field: f}, edges: {}, threshold: {field: f, from: -0.8}}}]");
const char surface_layers[] =
    "threads: 1\nimages:\n" LAYERS("a", "[{isosurface: {field: f, values: [0.1], normals: vertex}}]")
        LAYERS("d", "[{surface: {colour_by: {field: f}, edges: {}}}]\n    shadows: true");

drawn draw_mesh(insitu_session *session, const insitu_mesh *mesh, const insitu_field *f, const insitu_field *u)
{
    everywhere(insitu_set_mesh(session, "m", mesh) == INSITU_OK);
    everywhere(insitu_set_field(session, "m", f) == INSITU_OK);
    if (u) everywhere(insitu_set_field(session, "m", u) == INSITU_OK);
    drawn out = step_and_take_pictures(session, 0);
    insitu_destroy(&session);
    return out;
}

drawn draw_formed(insitu_session *session, const formed_mesh *m, const insitu_mesh *mesh, bool with_corners,
                  const insitu_field *u)
{
    formed_mesh own = *m;
    own.mesh = *mesh;
    everywhere(formed_mesh_submit(session, &own, with_corners) == INSITU_OK);
    if (u) everywhere(insitu_set_field(session, "m", u) == INSITU_OK);
    drawn out = step_and_take_pictures(session, 0);
    insitu_destroy(&session);
    return out;
}

void make_plane(bool is_wide, plane *out)
{
    for (int v = 0; v < 16; v++) {
        const double place[3] = {0.25 * (v % 4), 0.25 * (v / 4 + 3 * own_rank), 0};
        for (int a = 0; a < 2; a++) out->narrow[v][a] = (float)(out->wide[v][a] = place[a]);
        out->values[v] = test_wave_field(place);
    }
    for (int q = 0; q < 9; q++) {
        const int first = q % 3 + 4 * (q / 3), corners[4] = {first, first + 1, first + 5, first + 4};
        for (int i = 0; i < 4; i++) out->quads[q][i] = corners[i];
    }
    insitu_mesh_defaults(&out->mesh);
    out->mesh.vertex_count = 16;
    out->mesh.cell_count = 9;
    out->mesh.cell_type = INSITU_QUAD;
    out->mesh.connectivity_count = 36;
    out->mesh.connectivity = (insitu_array){out->quads, INSITU_INT32, 0};
    for (int a = 0; a < 2; a++)
        out->mesh.coordinates[a] = is_wide ? (insitu_array){&out->wide[0][a], INSITU_FLOAT64, 16}
                                           : (insitu_array){&out->narrow[0][a], INSITU_FLOAT32, 8};
    insitu_field_defaults(&out->field);
    out->field.name = "f";
    out->field.count = 16;
    out->field.values = (insitu_array){out->values, INSITU_FLOAT64, 0};
}

const char *lattice_form_name(lattice_form form)
{
    static const char *const names[LATTICE_FORMS] = {"uniform", "rectilinear", "curvilinear", "of quads"};
    return names[form];
}

void make_block(lattice_form form, int number, block *out)
{
    const bool is_plane = form == QUADS, is_curved = form == CURVILINEAR;
    const int64_t cells[3] = {ACROSS - (is_curved ? 1 : 0), is_plane ? THICK : ACROSS, is_plane ? 0 : THICK};
    const int along = is_plane ? 1 : 2;
    *out = (block){.lattice = {.cells = {cells[0], cells[1], cells[2]}}};
    insitu_lattice *l = &out->lattice;
    l->first[along] = (int64_t)THICK * number;
    for (int axis = 0; axis < 3; axis++) {
        l->origin[axis] = 0.1 * (axis + 1);
        l->spacing[axis] = 0.13 + 0.02 * axis;
        for (int n = 0; n < 8; n++) {
            const double at = (double)(l->first[axis] + n);
            out->axes[axis][n] = (float)(l->origin[axis] + 0.1 * at + 0.01 * at * at);
        }
    }
    insitu_mesh_defaults(&out->mesh);
    out->mesh.lattice = l;
    out->mesh.cell_count = cells[0] * cells[1] * (is_plane ? 1 : cells[2]);
    out->mesh.vertex_count = (cells[0] + 1 + (is_curved ? 1 : 0)) * (cells[1] + 1) * (cells[2] + 1);
    if (form == RECTILINEAR || is_plane)
        for (int axis = 0; axis < (is_plane ? 2 : 3); axis++)
            l->axes[axis] = (insitu_array){out->axes[axis], INSITU_FLOAT32, 0};
    for (int axis = 0; axis < 3 && form != UNIFORM; axis++) l->origin[axis] = l->spacing[axis] = 0;
    if (is_curved) {
        l->vertex_strides[0] = 1;
        l->vertex_strides[1] = cells[0] + 2;
        l->vertex_strides[2] = (cells[0] + 2) * (cells[1] + 1);
    }
    for (int64_t v = 0; v < out->mesh.vertex_count && is_curved; v++) {
        const double at[3] = {(double)(v % (cells[0] + 2)), (double)(v / (cells[0] + 2) % (cells[1] + 1)),
                              (double)(l->first[2] + v / l->vertex_strides[2])};
        const bool is_padding = v % (cells[0] + 2) > cells[0];
        for (int axis = 0; axis < 3; axis++)
            out->places[axis][v] = is_padding ? (double)NAN : 0.15 * at[axis] + 0.02 * sin(at[(axis + 1) % 3]);
    }
    for (int axis = 0; axis < 3 && is_curved; axis++)
        out->mesh.coordinates[axis] = (insitu_array){out->places[axis], INSITU_FLOAT64, 0};
    for (int64_t v = 0; v < out->mesh.vertex_count; v++) {
        double place[3];
        compute_vertex_position(&out->mesh, v, place);
        out->values[v] = test_wave_field(place);
    }
    insitu_field_defaults(&out->field);
    out->field.name = "f";
    out->field.count = out->mesh.vertex_count;
    out->field.values = (insitu_array){out->values, INSITU_FLOAT64, 0};
}
