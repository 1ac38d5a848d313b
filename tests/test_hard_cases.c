/* Checks hard cases that no other test covers; docs/development/hard-cases.md lists all of them. */
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static const double values[2] = {-0.2, 0.3};
static const test_mesh_kind kinds[5] = {TEST_TETS, TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};

/* The scenes: an opaque surface; transparent surfaces in a volume drawn by samples; a volume drawn by segments. */
typedef enum scene_kind { OPAQUE, SURFACES_IN_SAMPLES, SEGMENTS, SCENE_COUNT } scene_kind;

static void draw_mesh(const test_mesh *mesh, scene_kind scene, fixture_camera camera, drawn_frame *out)
{
    render_fixture f;
    fixture_create(&f, mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 0.5, 1,
                   (const double[]){0, 0, 0});
    fixture_set_camera(&f, camera, 61, 47);
    if (scene != SEGMENTS) fixture_add_surface(&f, values, 2, scene == OPAQUE ? 1 : 0.4f);
    if (scene != OPAQUE) fixture_set_volume(&f, 0.3);
    if (scene == SEGMENTS) f.job.integration = RENDER_SEGMENTS;
    fixture_draw(&f, out);
    fixture_free(&f);
}

/* How cells lose their volume: all vertices of a cell are replaced by those of one point, one edge or one face of the
 * cell. */
typedef enum collapse { TO_A_POINT, TO_AN_EDGE, TO_A_FACE, COLLAPSE_COUNT } collapse;

/* Returns the index of the vertex that replaces vertex i. TO_A_FACE keeps all corners of the cell's first face, so that
 * the cell consists of this face twice. */
static int find_replacing_vertex(int type, collapse how, int i)
{
    static const int tet[4] = {0, 1, 2, 2}, pyramid[5] = {0, 1, 1, 0, 4};
    if (how == TO_A_POINT) return 0;
    if (how == TO_AN_EDGE) return i % 2;
    return type == GRID_TET ? tet[i] : type == GRID_PYRAMID ? pyramid[i] : type == GRID_WEDGE ? i % 3 : i % 4;
}

static void *grow_array(void *block, int64_t count, size_t size)
{
    void *larger = realloc(block, (size_t)count * size);
    assert_non_null(larger);
    return larger;
}

/* Adds, for every third cell, a cell without volume that has the same vertices except the replaced ones. */
static void add_collapsed_cells(test_mesh *mesh)
{
    const int64_t cells = mesh->cell_count, most = cells + cells / 3 + 1;
    mesh->types = grow_array(mesh->types, most, 1);
    mesh->ghosts = grow_array(mesh->ghosts, most, 1);
    mesh->offsets = grow_array(mesh->offsets, most + 1, sizeof *mesh->offsets);
    mesh->connectivity = grow_array(mesh->connectivity, 8 * most, sizeof *mesh->connectivity);
    for (int64_t cell = 0; cell < cells; cell += 3) {
        const int64_t first = mesh->offsets[cell];
        const int type = mesh->types[cell], count = grid_type_vertex_count(type);
        for (int i = 0; i < count; i++)
            mesh->connectivity[mesh->connectivity_count++] =
                mesh->connectivity[first + find_replacing_vertex(type, (collapse)(cell / 3 % COLLAPSE_COUNT), i)];
        mesh->ghosts[mesh->cell_count] = 0;
        mesh->types[mesh->cell_count++] = (unsigned char)type;
        mesh->offsets[mesh->cell_count] = mesh->connectivity_count;
    }
}

static void cells_without_volume_change_no_pixel(void **state)
{
    (void)state;
    for (int k = 0; k < 5; k++)
        for (scene_kind scene = 0; scene < SCENE_COUNT; scene++)
            for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
                test_mesh mesh;
                drawn_frame without, with;
                test_mesh_make_lattice(kinds[k], 4, camera == CAMERA_ALONG_X ? 0 : 0.1, test_wave_field, &mesh);
                draw_mesh(&mesh, scene, camera, &without);
                add_collapsed_cells(&mesh);
                draw_mesh(&mesh, scene, camera, &with);
                assert_true(without.list.count > 100);
                drawn_frame_assert_same(&without, &with);
                drawn_frame_free(&without);
                drawn_frame_free(&with);
                test_mesh_free(&mesh);
            }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cells_without_volume_change_no_pixel),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
