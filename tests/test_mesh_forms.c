#include "test_mesh_forms.h"

#include <stdlib.h>
#include <string.h>

#include "test_mesh_make.h"

#define IMAGE(name, layers)                                                                                            \
    "  - name: " name "\n    size: [12, 9]\n    layers:\n" layers "    outputs: [{path: " name ".exr}]\n"

const char formed_scene[] =
    "threads: 1\nimages:\n" IMAGE("a",
                                  "      - isosurface: {field: f, values: [0.1], colour_by: {field: c, range: data}}\n"
                                  "      - isosurface: {field: c, component: x, values: [0.2], normals: vertex}\n")
        IMAGE("b", "      - volume: {field: f}\n") IMAGE("c", "      - volume: {field: c, component: magnitude}\n")
            IMAGE("d", "      - slice: {field: i, planes: [{normal: [1, 2, 3]}]}\n"
                       "      - slice: {field: c, interpolate: vertex, planes: [{normal: [1, 0, 0]}]}\n")
                IMAGE("e", "      - surface: {colour_by: {field: c, interpolate: vertex}, edges: {}}\n")
                    IMAGE("g", "      - surface: {threshold: {field: f, from: -0.5, to: 0.5}, colour_by: {field: i}}\n"
                               "      - isosurface: {field: i, values: [0.3], normals: differences}\n");

const char formed_corner_scene[] = "threads: 1\nimages:\n" IMAGE("a", "      - isosurface: {field: d, values: [0.1]}\n"
                                                                      "      - surface: {colour_by: {field: d}}\n")
    IMAGE("b", "      - volume: {field: "
               "d}\n");

const char *mesh_form_name(mesh_form form)
{
    static const char *const names[] = {"tets",  "hexes", "rows",  "mixed", "polyhedra",
                                        "owner", "pairs", "lists", "shells"};
    return names[form];
}

bool formed_mesh_has_corners(mesh_form form)
{
    return form < MESH_POLYHEDRA || form == MESH_SHELLS;
}

/* ---- the part of the mesh ------------------------------------------------------------------------------------- */

static test_mesh_kind get_mesh_kind(mesh_form form)
{
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_HEXES, TEST_WEDGES};
    return form <= MESH_ROWS ? kinds[form] : TEST_MIXED;
}

/* Turns a mesh of polyhedra into a mesh whose cells are the faces of the polyhedra: triangles, quads and polygons. */
static void make_mesh_of_faces(test_mesh *part)
{
    const int64_t count = part->face_count;
    part->types = realloc(part->types, (size_t)count + 1);
    part->ghosts = realloc(part->ghosts, (size_t)count + 1);
    assert_true(part->types && part->ghosts);
    memset(part->ghosts, 0, (size_t)count + 1);
    for (int64_t face = 0; face < count; face++) {
        const int64_t size = part->face_offsets[face + 1] - part->face_offsets[face];
        part->types[face] = face % 5 == 0 ? INSITU_POLYGON : size == 3 ? INSITU_TRIANGLE : INSITU_QUAD;
    }
    free(part->offsets);
    free(part->connectivity);
    part->cell_count = count;
    part->connectivity_count = part->face_connectivity_count;
    part->offsets = part->face_offsets;
    part->connectivity = part->face_connectivity;
    part->face_count = part->face_connectivity_count = 0;
    part->face_offsets = part->face_connectivity = NULL;
}

static void make_part(formed_mesh *m)
{
    test_mesh whole;
    test_mesh_make_lattice(get_mesh_kind(m->form), m->side, 0.2, test_wave_field, &whole);
    if (m->form >= MESH_POLYHEDRA) test_mesh_to_polyhedra(&whole, 1);
    int *owners = test_calloc((size_t)whole.cell_count, sizeof *owners);
    test_partition_cells(&whole, TEST_BLOCK, m->side, m->count, owners);
    test_mesh_extract_part(&whole, owners, m->rank, &m->part);
    test_free(owners);
    test_mesh_free(&whole);
    if (m->form == MESH_SHELLS) make_mesh_of_faces(&m->part);
}

/* ---- descriptions of the part in each form --------------------------------------------------------------------- */

static void describe_tets(formed_mesh *m)
{
    const test_mesh *part = &m->part;
    m->narrow_coordinates = test_allocate(3 * part->vertex_count, sizeof(float));
    m->narrow_connectivity = test_allocate(part->connectivity_count, sizeof(int32_t));
    for (int64_t i = 0; i < 3 * part->vertex_count; i++) m->narrow_coordinates[i] = (float)part->coordinates[i];
    for (int64_t i = 0; i < part->connectivity_count; i++) m->narrow_connectivity[i] = (int32_t)part->connectivity[i];
    insitu_mesh_interleaved(&m->mesh, m->narrow_coordinates, INSITU_FLOAT32);
    m->mesh.connectivity = (insitu_array){m->narrow_connectivity, INSITU_INT32, 0};
    m->mesh.cell_types = m->mesh.offsets = m->mesh.ghosts = (insitu_array){0};
}

static void describe_hexes(formed_mesh *m)
{
    m->ids = test_allocate(m->part.vertex_count, sizeof *m->ids);
    for (int64_t v = 0; v < m->part.vertex_count; v++) {
        const double *p = m->part.coordinates + 3 * v;
        int64_t id = 0; /* vertices of the lattice are more than a hundredth apart, so that ids are distinct */
        for (int axis = 0; axis < 3; axis++) id = 1000 * id + (int64_t)(100 * (p[axis] + 2));
        m->ids[v] = id;
    }
    m->mesh.cell_type = INSITU_HEX;
    m->mesh.cell_types = (insitu_array){0};
    m->mesh.vertex_ids = (insitu_array){m->ids, INSITU_INT64, 0};
}

static void describe_rows(formed_mesh *m)
{
    static const int order[6] = {0, 2, 1, 3, 4, 5};
    enum { ROW = 9 };
    m->rows = test_allocate(ROW * m->part.cell_count, sizeof *m->rows);
    for (int64_t cell = 0; cell < m->part.cell_count; cell++)
        for (int i = 0; i < ROW; i++) m->rows[ROW * cell + i] = i < 6 ? m->part.connectivity[6 * cell + order[i]] : -7;
    m->mesh.cell_type = INSITU_WEDGE;
    m->mesh.cell_types = m->mesh.offsets = (insitu_array){0};
    m->mesh.connectivity = (insitu_array){m->rows, INSITU_INT64, 0};
    m->mesh.connectivity_count = ROW * m->part.cell_count;
    m->mesh.connectivity_row = ROW;
    m->mesh.vertex_order = INSITU_ORDER_DMPLEX;
}

static void describe_mesh(formed_mesh *m)
{
    describe_part(&m->part, &m->mesh);
    if (m->form == MESH_TETS) describe_tets(m);
    if (m->form == MESH_HEXES) describe_hexes(m);
    if (m->form == MESH_ROWS) describe_rows(m);
    if (m->form == MESH_MIXED && m->part.cell_count > 1) m->part.ghosts[m->part.cell_count / 2] = 1;
    m->mesh.keep_polyhedra = m->form == MESH_POLYHEDRA || m->form == MESH_LISTS;
    if (m->form < MESH_OWNER || m->form > MESH_LISTS) return;
    m->faces = make_owned_faces(&m->part, m->form != MESH_OWNER);
    describe_owned_faces(&m->faces,
                         m->form == MESH_OWNER   ? FORM_WIDE
                         : m->form == MESH_PAIRS ? FORM_PAIRS
                                                 : FORM_LISTS,
                         m->form != MESH_OWNER, &m->mesh);
}

/* ---- fields ---------------------------------------------------------------------------------------------------- */

static int64_t corner_count(const formed_mesh *m)
{
    const insitu_mesh *mesh = &m->mesh;
    if (!formed_mesh_has_corners(m->form)) return 0;
    if (mesh->cell_count <= 0 || mesh->cell_count > INT32_MAX) return mesh->cell_count;
    if (mesh->offsets.data) return mesh->connectivity_count;
    return mesh->cell_count * (m->form == MESH_TETS ? 4 : m->form == MESH_HEXES ? 8 : 6);
}

void formed_mesh_resize_fields(formed_mesh *m)
{
    m->fields[FORMED_F].count = m->mesh.vertex_count;
    m->fields[FORMED_C].count = m->mesh.cell_count;
    m->fields[FORMED_D].count = corner_count(m);
    if (m->mesh.cell_count == 0 || m->mesh.face_count == 0) m->fields[FORMED_C].patch_count = 0;
}

/* Defines a boundary patch with one face. In the order of owners, the last faces are on the boundary of the rank's
 * part; the patch is one of them that is also on the boundary of the whole mesh. */
static void describe_patch(formed_mesh *m)
{
    const int64_t *offsets = m->faces.offsets;
    int64_t face = m->part.face_count - 1;
    for (; face > m->faces.inner; face--) {
        bool is_outer = true;
        for (int64_t i = offsets[face]; i < offsets[face + 1]; i++)
            is_outer = is_outer && m->part.coordinates[3 * m->faces.vertices[i] + 1] == -1;
        if (is_outer) break;
    }
    m->patch = (insitu_patch){.count = 1, .first_face = face + m->mesh.index_base};
    m->patch.values = (insitu_array){m->patch_values, INSITU_FLOAT64, 0};
    m->fields[FORMED_C].patch_count = m->faces.inner < m->part.face_count;
    m->fields[FORMED_C].patches = &m->patch;
}

static void describe_fields(formed_mesh *m)
{
    static const char *const names[FORMED_FIELDS] = {"f", "c", "i", "d"};
    const test_mesh *part = &m->part;
    const int64_t cells = 3 * part->cell_count, corners = part->connectivity_count;
    m->cell_values = test_allocate(cells, sizeof(double));
    m->corner_values = test_allocate(corners, sizeof(double));
    m->patch_values = test_allocate(3, sizeof(double));
    m->index = test_allocate(part->vertex_count, sizeof *m->index);
    for (int64_t i = 0; i < cells; i++) m->cell_values[i] = test_uniform_between((uint64_t)i, 3, -1, 1);
    for (int64_t i = 0; i < corners; i++) m->corner_values[i] = test_uniform_between((uint64_t)i, 4, -1, 1);
    for (int64_t i = 0; i < part->vertex_count; i++) m->index[i] = part->vertex_count - 1 - i + m->mesh.index_base;
    for (int i = 0; i < FORMED_FIELDS; i++) {
        insitu_field_defaults(&m->fields[i]);
        m->fields[i].name = names[i];
    }
    m->fields[FORMED_F].values = (insitu_array){part->values, INSITU_FLOAT64, 0};
    m->fields[FORMED_C].values = (insitu_array){m->cell_values, INSITU_FLOAT64, 0};
    m->fields[FORMED_C].centring = INSITU_CELL;
    m->fields[FORMED_C].component_count = 3;
    m->fields[FORMED_I].values = (insitu_array){part->values, INSITU_FLOAT64, 0};
    m->fields[FORMED_I].index = (insitu_array){m->index, INSITU_INT64, 0};
    m->fields[FORMED_I].count = part->vertex_count;
    m->fields[FORMED_D].values = (insitu_array){m->corner_values, INSITU_FLOAT64, 0};
    m->fields[FORMED_D].centring = INSITU_CORNER;
    if (m->faces.owner) describe_patch(m);
    formed_mesh_resize_fields(m);
}

/* ---- creation and submission ----------------------------------------------------------------------------------- */

void formed_mesh_create(mesh_form form, int side, int rank, int count, formed_mesh *out)
{
    *out = (formed_mesh){.form = form, .side = side, .rank = rank, .count = count};
    make_part(out);
    describe_mesh(out);
    describe_fields(out);
}

void formed_mesh_free(formed_mesh *m)
{
    void *const arrays[] = {m->narrow_coordinates, m->narrow_connectivity, m->rows,        m->ids, m->index,
                            m->cell_values,        m->corner_values,       m->patch_values};
    for (size_t i = 0; i < sizeof arrays / sizeof arrays[0]; i++) free(arrays[i]);
    free_owned_faces(&m->faces);
    test_mesh_free(&m->part);
}

void formed_mesh_restore(formed_mesh *m)
{
    const formed_mesh last = *m;
    formed_mesh_free(m);
    formed_mesh_create(last.form, last.side, last.rank, last.count, m);
}

insitu_status formed_mesh_submit(insitu_session *session, const formed_mesh *m, bool with_corners)
{
    insitu_status status = insitu_set_mesh(session, "m", &m->mesh);
    for (int i = 0; i < FORMED_FIELDS; i++) {
        if (i == FORMED_D && !with_corners) continue;
        const insitu_status own = insitu_set_field(session, "m", &m->fields[i]);
        if (!status) status = own;
    }
    return status;
}
