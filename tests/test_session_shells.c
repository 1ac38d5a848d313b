/* Checks shells: triangles, quads and polygons, without other cells and together with cells of three dimensions. A
 * sheet of shells is compared with the closed form of its plane, and must be bit-identical for any partition. A shell
 * on a cell's face must be drawn instead of the face. Isosurfaces, slices and volumes must be those of the mesh without
 * its shells. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "colour_map.h"
#include "render.h"
#include "session.h"
#include "test_session_fixture.h"
#include "test_session_view.h"

#define SURFACE                                                                                                        \
    "      - surface: {colour_by: {field: f, map: grey, range: [-2, 2]}, material: {ambient: 1, diffuse: 0, "          \
    "specular: 0}}\n"

/* ---- meshes -------------------------------------------------------------------------------------------------- */

enum { MAX_VERTICES = 256, MAX_CELLS = 256, MAX_ENTRIES = 1024 };

typedef struct shell_mesh {
    int vertex_count, cell_count, entry_count;
    double coordinates[3 * MAX_VERTICES], values[MAX_VERTICES], cell_values[MAX_CELLS];
    unsigned char types[MAX_CELLS], ghosts[MAX_CELLS];
    int offsets[MAX_CELLS + 1], connectivity[MAX_ENTRIES];
    bool is_of_one_type;
} shell_mesh;

static int add_vertex(shell_mesh *m, double x, double y, double z)
{
    double *place = m->coordinates + 3 * (ptrdiff_t)m->vertex_count;
    place[0] = x;
    place[1] = y;
    place[2] = z;
    m->values[m->vertex_count] = test_linear_field(place);
    return m->vertex_count++;
}

static void add_cell(shell_mesh *m, unsigned char type, double value, int count, const int *vertices)
{
    m->types[m->cell_count] = type;
    m->cell_values[m->cell_count] = value;
    memcpy(m->connectivity + m->entry_count, vertices, (size_t)count * sizeof *vertices);
    m->entry_count += count;
    m->offsets[++m->cell_count] = m->entry_count;
}

/* The types of shells into which each block of two squares of a sheet is divided. */
typedef enum sheet_kind { QUADS, TRIANGLES, POLYGONS, MIXED, SHEET_KINDS } sheet_kind;

static void add_block(shell_mesh *m, sheet_kind kind, const int at[6])
{
    const int around[6] = {at[0], at[1], at[2], at[5], at[4], at[3]};
    if (kind == POLYGONS) {
        add_cell(m, INSITU_POLYGON, 0, 6, around);
        return;
    }
    for (int i = 0; i < 2; i++) {
        const int quad[4] = {at[i], at[i + 1], at[i + 4], at[i + 3]}, other[3] = {at[i], at[i + 4], at[i + 3]};
        if (kind == QUADS) {
            add_cell(m, INSITU_QUAD, 0, 4, quad);
        } else {
            add_cell(m, INSITU_TRIANGLE, 0, 3, quad);
            add_cell(m, INSITU_TRIANGLE, 0, 3, other);
        }
    }
}

/* Makes a sheet of 6 × 6 squares over x and y from -1 to 1, in the plane z = 0.3 x + 0.2 y. */
static void make_sheet(sheet_kind kind, shell_mesh *out)
{
    enum { SIDE = 6 };
    *out = (shell_mesh){.is_of_one_type = kind != MIXED};
    for (int j = 0; j <= SIDE; j++)
        for (int i = 0; i <= SIDE; i++) {
            const double x = 2. * i / SIDE - 1, y = 2. * j / SIDE - 1;
            add_vertex(out, x, y, 0.3 * x + 0.2 * y);
        }
    for (int j = 0; j < SIDE; j++)
        for (int i = 0; i < SIDE; i += 2) {
            int at[6];
            for (int k = 0; k < 6; k++) at[k] = (j + k / 3) * (SIDE + 1) + i + k % 3;
            add_block(out, kind == MIXED ? (sheet_kind)((i / 2 + j) % MIXED) : kind, at);
        }
}

/* Makes 2 × 2 × 2 hexes with the value 0 between -1 and 1, and shells with the value 1: on the hexes' outer faces at z
 * = 1, on interior faces at z = 0, and through the hexes at z = 0.5. */
static void make_block(bool with_shells, shell_mesh *out)
{
    *out = (shell_mesh){0};
    int at[4][3][3];
    for (int k = 0; k < 4; k++)
        for (int j = 0; j < 3; j++)
            for (int i = 0; i < 3; i++) at[k][j][i] = add_vertex(out, i - 1, j - 1, k == 3 ? 0.5 : k - 1);
    for (int k = 0; k < 2; k++)
        for (int j = 0; j < 2; j++)
            for (int i = 0; i < 2; i++)
                add_cell(out, INSITU_HEX, 0, 8,
                         (const int[]){at[k][j][i], at[k][j][i + 1], at[k][j + 1][i + 1], at[k][j + 1][i],
                                       at[k + 1][j][i], at[k + 1][j][i + 1], at[k + 1][j + 1][i + 1],
                                       at[k + 1][j + 1][i]});
    for (int k = 1; k < 4 && with_shells; k++)
        for (int j = 0; j < 2; j++)
            for (int i = 0; i < 2; i++)
                add_cell(out, INSITU_QUAD, 1, 4,
                         (const int[]){at[k][j][i], at[k][j + 1][i], at[k][j + 1][i + 1], at[k][j][i + 1]});
}

/* Extracts this rank's cells or, if with_ghosts is set, all cells, of which those of other ranks are ghosts. Cells are
 * dealt to the ranks one by one. */
static void extract_rank_cells(const shell_mesh *whole, bool with_ghosts, shell_mesh *out)
{
    *out = *whole;
    out->cell_count = out->entry_count = 0;
    for (int cell = 0; cell < whole->cell_count; cell++) {
        const bool is_own = (cell + cell / 8) % rank_count == own_rank;
        if (!is_own && !with_ghosts) continue;
        out->ghosts[out->cell_count] = !is_own;
        add_cell(out, whole->types[cell], whole->cell_values[cell], whole->offsets[cell + 1] - whole->offsets[cell],
                 whole->connectivity + whole->offsets[cell]);
    }
}

static insitu_mesh describe_shells(const shell_mesh *m)
{
    insitu_mesh mesh;
    insitu_mesh_defaults(&mesh);
    mesh.vertex_count = m->vertex_count;
    for (int axis = 0; axis < 3; axis++)
        mesh.coordinates[axis] = (insitu_array){m->coordinates + axis, INSITU_FLOAT64, 3 * sizeof(double)};
    mesh.cell_count = m->cell_count;
    mesh.connectivity_count = m->entry_count;
    mesh.connectivity = (insitu_array){m->connectivity, INSITU_INT32, 0};
    mesh.ghosts = (insitu_array){m->ghosts, INSITU_UINT8, 0};
    if (m->is_of_one_type)
        mesh.cell_type = (insitu_cell_type)m->types[0];
    else
        mesh.cell_types = (insitu_array){m->types, INSITU_UINT8, 0};
    if (!m->is_of_one_type || mesh.cell_type == INSITU_POLYGON)
        mesh.offsets = (insitu_array){m->offsets, INSITU_INT32, 0};
    return mesh;
}

static insitu_status set_field(insitu_session *session, const char *name, insitu_centring centring, int count,
                               const double *values)
{
    insitu_field field;
    insitu_field_defaults(&field);
    field.name = name;
    field.centring = centring;
    field.count = count;
    field.values = (insitu_array){values, INSITU_FLOAT64, 0};
    return insitu_set_field(session, "m", &field);
}

static insitu_session *open_session_with_shells(MPI_Comm comm, const char *scene, const shell_mesh *m)
{
    insitu_session *session = open_session(comm, scene);
    const insitu_mesh mesh = describe_shells(m);
    discard_pictures();
    assert_int_equal(insitu_set_mesh(session, "m", &mesh), INSITU_OK);
    assert_int_equal(set_field(session, "f", INSITU_VERTEX, m->vertex_count, m->values), INSITU_OK);
    assert_int_equal(set_field(session, "c", INSITU_CELL, m->cell_count, m->cell_values), INSITU_OK);
    const insitu_status status = insitu_step(session, 0, 0);
    if (status) fprintf(stderr, "%s\n", insitu_error(session));
    assert_int_equal(status, INSITU_OK);
    return session;
}

static caught_picture draw_shells(MPI_Comm comm, const char *scene, const shell_mesh *m)
{
    insitu_session *session = open_session_with_shells(comm, scene, m);
    if (insitu_last_report(session)->warnings[0]) fail_msg("warnings: %s", insitu_last_report(session)->warnings);
    const caught_picture picture = pop_caught_picture();
    insitu_destroy(&session);
    return picture;
}

/* ---- pictures ------------------------------------------------------------------------------------------------ */

/* Computes the position at which the pixel's ray intersects the plane 0.3 x + 0.2 y = z; returns its depth. */
static double intersect_sheet(int pixel, double place[3])
{
    static const double normal[3] = {0.3, 0.2, -1};
    const ray r = make_pixel_ray(pixel);
    double along = 0, left = 0;
    for (int a = 0; a < 3; a++) {
        along += normal[a] * r.direction[a];
        left -= normal[a] * r.base[a];
    }
    for (int a = 0; a < 3; a++) place[a] = r.base[a] + left / along * r.direction[a];
    return left / along;
}

/* Compares depths and colours with those of the sheet. The tolerances are derived at is_cube() in
 * test_session_surfaces.c. */
static bool is_picture_of_sheet(const caught_picture *picture)
{
    int hits = 0;
    for (int pixel = 0; pixel < PIXELS; pixel++) {
        double place[3];
        const double depth = intersect_sheet(pixel, place), reach = fmax(fabs(place[0]), fabs(place[1]));
        const float *own = picture->rgba + 4 * (ptrdiff_t)pixel;
        if (fabs(reach - 1) < 1e-4) continue;
        const double grey = (double)colour_linear_from_srgb((float)((test_linear_field(place) + 2) / 4));
        const bool is_hit = reach < 1;
        hits += is_hit;
        if (is_hit ? own[3] == 1 && fabs((double)picture->depth[pixel] - depth) < 1.5e-5 &&
                         fabs((double)own[0] - grey) < 1e-4
                   : own[3] == 0)
            continue;
        fprintf(stderr, "pixel %d: opacity %g, grey %g, depth %g; expected %d, %g, %g\n", pixel, (double)own[3],
                (double)own[0], (double)picture->depth[pixel], is_hit, grey, depth);
        return false;
    }
    return hits > PIXELS / 20;
}

static void sheets_are_planes_on_any_ranks(void **state)
{
    (void)state;
    const char *scene = write_scene(IMAGE(SURFACE));
    for (sheet_kind kind = 0; kind < SHEET_KINDS; kind++)
        for (int with_ghosts = 0; with_ghosts < 2; with_ghosts++) {
            shell_mesh whole, part;
            make_sheet(kind, &whole);
            extract_rank_cells(&whole, with_ghosts, &part);
            caught_picture ours = draw_shells(MPI_COMM_WORLD, scene, &part), alone = {0};
            bool is_well = true;
            if (own_rank == 0) {
                alone = draw_shells(MPI_COMM_SELF, scene, &whole);
                is_well = is_picture_of_sheet(&alone) && are_same_pictures(&ours, &alone);
            }
            everywhere(is_well);
            free_caught(&ours);
            free_caught(&alone);
        }
}

/* Checks the outer surface of the block. It has 24 outer faces; 4 of the 12 shells replace outer faces. */
static void shells_replace_coincident_faces(void **state)
{
    (void)state;
    shell_mesh whole, part;
    make_block(true, &whole);
    extract_rank_cells(&whole, false, &part);
    insitu_session *session = open_session_with_shells(
        MPI_COMM_WORLD, write_scene(IMAGE("      - surface: {colour_by: {field: c}}\n")), &part);
    const session_mesh *mesh = session_find_mesh(&session->meshes, "m");
    const session_outer *outer = mesh->outers[0];
    int64_t counts[4] = {outer->face_count, 0, insitu_last_report(session)->cells_shell,
                         insitu_last_report(session)->cells_flat};
    for (int64_t i = 0; i < outer->face_count; i++) counts[1] += part.types[outer->faces[i].cell] == INSITU_QUAD;
    MPI_Allreduce(MPI_IN_PLACE, counts, 4, MPI_INT64_T, MPI_SUM, MPI_COMM_WORLD);
    everywhere(counts[0] == 20 + 12 && counts[1] == 12 && counts[2] == 12 && counts[3] == 0);
    insitu_destroy(&session);
}

static void other_layers_skip_shells(void **state)
{
    (void)state;
    static const char *const scenes[] = {
        IMAGE("      - isosurface: {field: f, values: [0.2]}\n"),
        IMAGE("      - slice: {field: f, range: [-2, 2], planes: [{normal: [1, 2, 3], point: [0, 0, 0.1]}]}\n"),
        IMAGE("      - volume: {field: f, range: [-2, 2], unit_distance: 1}\n")};
    for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
        shell_mesh whole, part, without;
        const char *scene = write_scene(scenes[i]);
        make_block(true, &whole);
        make_block(false, &without);
        extract_rank_cells(&whole, false, &part);
        caught_picture ours = draw_shells(MPI_COMM_WORLD, scene, &part), alone = {0}, bare = {0};
        bool is_well = true;
        if (own_rank == 0) {
            alone = draw_shells(MPI_COMM_SELF, scene, &whole);
            bare = draw_shells(MPI_COMM_SELF, scene, &without);
            int hits = 0;
            for (int pixel = 0; pixel < PIXELS; pixel++) hits += bare.rgba[4 * pixel + 3] > 0;
            is_well = hits > PIXELS / 20 && are_same_pictures(&alone, &bare);
            for (int k = 0; k < 4 * PIXELS; k++)
                is_well = is_well && fabs((double)alone.rgba[k] - (double)ours.rgba[k]) <= 1e-6;
        }
        everywhere(is_well);
        free_caught(&ours);
        free_caught(&alone);
        free_caught(&bare);
    }
}

/* ---- errors -------------------------------------------------------------------------------------------------- */

static void is_reported(const shell_mesh *m, const char *const words[2])
{
    insitu_session *session = open_session(MPI_COMM_WORLD, write_scene(IMAGE(SURFACE)));
    const insitu_mesh mesh = describe_shells(m);
    insitu_set_mesh(session, "m", &mesh);
    set_field(session, "f", INSITU_VERTEX, m->vertex_count, m->values);
    const insitu_status status = insitu_step(session, 0, 0);
    check_reported_everywhere(session, status, INSITU_ERROR_MESH, words[0], words[1]);
    insitu_destroy(&session);
}

static void bad_shells_are_reported(void **state)
{
    (void)state;
    shell_mesh m;
    const bool is_last = own_rank == rank_count - 1; /* only the last rank has wrong input */
    make_sheet(MIXED, &m);
    if (is_last) m.connectivity[1] = 999;
    is_reported(&m, (const char *const[]){"cell 0 (quad)", "vertex index 999 is outside 0..48"});
    make_sheet(POLYGONS, &m);
    if (is_last) m.connectivity[7] = -1;
    is_reported(&m, (const char *const[]){"cell 1 (polygon)", "vertex index -1 is outside 0..48"});
    make_sheet(POLYGONS, &m);
    if (is_last) m.offsets[1] = 2;
    is_reported(&m, (const char *const[]){"cell 0 (polygon)", "at least 3 vertices"});
    make_sheet(TRIANGLES, &m);
    if (is_last) m.coordinates[4] = NAN;
    is_reported(&m, (const char *const[]){"(triangle)", "not finite"});
    make_sheet(MIXED, &m);
    if (is_last) m.types[0] = 6;
    is_reported(&m, (const char *const[]){"cell 0", "unknown cell type 6"});
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sheets_are_planes_on_any_ranks),
        cmocka_unit_test(shells_replace_coincident_faces),
        cmocka_unit_test(other_layers_skip_shells),
        cmocka_unit_test(bad_shells_are_reported),
    };
    return run_session_tests(argc, argv, tests, NULL, NULL);
}
