/* Checks degenerate polyhedra: faces that repeat a vertex, have no area or consist of one point, and cells without
 * volume. If a cell is stored in another form, the picture must be bit-identical; cells without volume change no bit of
 * the picture; all other pictures must agree with the reference. docs/development/hard-cases.md lists all cases.
 * test_session_faces.c checks those that are refused. */
#include "reference_integral.h"
#include "test_effort.h"
#include "test_mesh_make.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static const double values[2] = {-0.2, 0.3};

/* The scenes: an opaque surface; transparent surfaces in a volume drawn by samples; a volume drawn by segments. */
typedef enum scene_kind { OPAQUE, SURFACES_IN_SAMPLES, SEGMENTS, SCENE_COUNT } scene_kind;

static void open_scene(render_fixture *f, const test_mesh *mesh, scene_kind scene, fixture_camera camera, int width,
                       int height)
{
    fixture_create(f, mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 0.5, 1,
                   (const double[]){0, 0, 0});
    fixture_set_camera(f, camera, width, height);
    if (scene != SEGMENTS) fixture_add_surface(f, values, 2, scene == OPAQUE ? 1 : 0.4f);
    if (scene != OPAQUE) fixture_set_volume(f, 0.3);
    if (scene == SEGMENTS) f->job.integration = RENDER_SEGMENTS;
}

static void assert_finite(const drawn_frame *drawn)
{
    for (int64_t i = 0; i < 4 * (int64_t)drawn->picture.width * drawn->picture.height; i++)
        if (!isfinite(drawn->picture.rgba[i])) fail_msg("pixel %d is not finite", (int)(i / 4));
}

static void draw_mesh(const test_mesh *mesh, scene_kind scene, fixture_camera camera, drawn_frame *out)
{
    render_fixture f;
    open_scene(&f, mesh, scene, camera, 61, 47);
    fixture_draw(&f, out);
    assert_finite(out);
    fixture_free(&f);
}

/* ---- other forms of a mesh ------------------------------------------------------------------------------------- */

/* Returns a mesh with the vertices and values of `from` and without cells. It has space for additional vertices, faces
 * and cells. */
static test_mesh begin_copy(const test_mesh *from)
{
    test_mesh mesh;
    const int64_t entries = from->connectivity_count + from->face_connectivity_count, more = 8 * (entries + 64);
    test_mesh_allocate(&mesh, from->vertex_count + more, 4 * from->cell_count + 4, more);
    test_mesh_allocate_faces(&mesh, more, 4 * more);
    for (int64_t v = 0; v < from->vertex_count; v++)
        mesh.values[test_mesh_add_vertex(&mesh, from->coordinates + 3 * v)] = from->values[v];
    return mesh;
}

static int64_t face_size(const test_mesh *mesh, int64_t face)
{
    return mesh->face_offsets[face + 1] - mesh->face_offsets[face];
}

static int64_t get_face_vertex(const test_mesh *mesh, int64_t face, int64_t i)
{
    return mesh->face_connectivity[mesh->face_offsets[face] + i % face_size(mesh, face)];
}

static int count_cell_faces(const test_mesh *mesh, int64_t cell)
{
    return (int)(mesh->offsets[cell + 1] - mesh->offsets[cell]);
}

static void copy_cell(const test_mesh *from, int64_t cell, const int64_t *more, int count, test_mesh *to)
{
    static const int all[8] = {0, 1, 2, 3, 4, 5, 6, 7};
    const int64_t *own = from->connectivity + from->offsets[cell];
    int64_t faces[64];
    if (from->types[cell] != GRID_POLYHEDRON) {
        test_mesh_add_cell(to, from->types[cell], own, all);
        return;
    }
    const int own_count = count_cell_faces(from, cell);
    assert_true(own_count + count <= 64);
    for (int i = 0; i < own_count; i++) faces[i] = own[i];
    for (int i = 0; i < count; i++) faces[own_count + i] = more[i];
    test_mesh_add_polyhedron(to, faces, own_count + count);
}

static void copy_faces(const test_mesh *from, test_mesh *to)
{
    for (int64_t face = 0; face < from->face_count; face++)
        test_mesh_add_face(to, from->face_connectivity + from->face_offsets[face], face_size(from, face));
}

static void complete_copy(test_mesh *mesh, test_mesh *copy)
{
    test_mesh_free(mesh);
    *mesh = *copy;
}

typedef void rewriting(test_mesh *mesh);

/* Repeats vertices in two of three faces: one vertex is repeated, up to three times, and the first vertex also stands
 * at the end. A quad then has up to seven entries. Both cells at a face share the changed face. */
static void repeat_vertices(test_mesh *mesh)
{
    test_mesh copy = begin_copy(mesh);
    for (int64_t face = 0; face < mesh->face_count; face++) {
        const int64_t size = face_size(mesh, face), twice = face % 3 ? face % size : -1;
        int64_t loop[64], count = 0;
        for (int64_t i = 0; i < size; i++)
            for (int64_t k = 0; k < (i == twice ? 1 + face % 3 : 1); k++)
                loop[count++] = get_face_vertex(mesh, face, i);
        if (face % 3 == 2) loop[count++] = loop[0];
        test_mesh_add_face(&copy, loop, count);
    }
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) copy_cell(mesh, cell, NULL, 0, &copy);
    complete_copy(mesh, &copy);
}

/* Adds for every vertex a face that consists of this vertex only. Each cell receives the face of the first vertex of
 * its first face, so that cells share some of these faces. */
static void add_point_faces(test_mesh *mesh)
{
    test_mesh copy = begin_copy(mesh);
    copy_faces(mesh, &copy);
    for (int64_t v = 0; v < mesh->vertex_count; v++) test_mesh_add_face(&copy, (const int64_t[]){v, v, v}, 3);
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        const int64_t more = mesh->face_count + get_face_vertex(mesh, mesh->connectivity[mesh->offsets[cell]], 0);
        copy_cell(mesh, cell, &more, mesh->types[cell] == GRID_POLYHEDRON, &copy);
    }
    complete_copy(mesh, &copy);
}

/* Reverses the orientation of all faces. */
static void reverse_faces(test_mesh *mesh)
{
    for (int64_t face = 0; face < mesh->face_count; face++)
        for (int64_t i = mesh->face_offsets[face], k = mesh->face_offsets[face + 1] - 1; i < k; i++, k--) {
            const int64_t v = mesh->face_connectivity[i];
            mesh->face_connectivity[i] = mesh->face_connectivity[k];
            mesh->face_connectivity[k] = v;
        }
}

static void reverse_every_second_cell(test_mesh *mesh)
{
    test_mesh copy = begin_copy(mesh), turned = begin_copy(mesh);
    copy_faces(mesh, &turned);
    reverse_faces(&turned);
    for (int64_t face = 0; face < mesh->face_count; face++) {
        const test_mesh *from = face % 2 ? mesh : &turned;
        test_mesh_add_face(&copy, from->face_connectivity + from->face_offsets[face], face_size(from, face));
    }
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) copy_cell(mesh, cell, NULL, 0, &copy);
    test_mesh_free(&turned);
    complete_copy(mesh, &copy);
}

/* ---- cells without volume next to others ----------------------------------------------------------------------- */

/* Adds a flat cell: a face of another cell as front and as back, closed by two faces that are single points. */
static void add_pillow(test_mesh *mesh, int64_t face)
{
    const int64_t *loop = mesh->face_connectivity + mesh->face_offsets[face];
    int64_t copy[16], faces[4] = {face};
    memcpy(copy, loop, (size_t)face_size(mesh, face) * sizeof *copy);
    faces[1] = test_mesh_add_face(mesh, copy, face_size(mesh, face));
    for (int i = 0; i < 2; i++)
        faces[2 + i] = test_mesh_add_face(mesh, (const int64_t[]){copy[i], copy[i], copy[i]}, 3);
    test_mesh_add_polyhedron(mesh, faces, 4);
}

/* Adds a bent cell without volume: two faces of another cell, each as front and as back. */
static void add_bent_pillow(test_mesh *mesh, int64_t one, int64_t other)
{
    int64_t faces[4] = {one, other};
    for (int i = 0; i < 2; i++) {
        int64_t copy[16];
        memcpy(copy, mesh->face_connectivity + mesh->face_offsets[faces[i]],
               (size_t)face_size(mesh, faces[i]) * sizeof *copy);
        faces[2 + i] = test_mesh_add_face(mesh, copy, face_size(mesh, faces[i]));
    }
    test_mesh_add_polyhedron(mesh, faces, 4);
}

static void add_tet(test_mesh *mesh, const int64_t v[4])
{
    static const int picks[4][3] = {{0, 1, 2}, {0, 1, 3}, {1, 2, 3}, {0, 2, 3}};
    int64_t faces[4];
    for (int i = 0; i < 4; i++)
        faces[i] = test_mesh_add_face(mesh, (const int64_t[]){v[picks[i][0]], v[picks[i][1]], v[picks[i][2]]}, 3);
    test_mesh_add_polyhedron(mesh, faces, 4);
}

/* Adds a tet with new vertices at quarters of the line from one vertex to another. If both are the same vertex, all
 * four vertices have its position. */
static void add_new_tet(test_mesh *mesh, int64_t from, int64_t to)
{
    int64_t v[4];
    for (int i = 0; i < 4; i++) {
        double p[3];
        for (int axis = 0; axis < 3; axis++) {
            const double a = mesh->coordinates[3 * from + axis], b = mesh->coordinates[3 * to + axis];
            p[axis] = a + 0.25 * i * (b - a);
        }
        v[i] = test_mesh_add_vertex(mesh, p);
        mesh->values[v[i]] = i % 2 ? 1 : -1;
    }
    add_tet(mesh, v);
}

enum { FLAT_KINDS = 5 };

static void add_flat_cells(test_mesh *mesh)
{
    test_mesh copy = begin_copy(mesh);
    copy_faces(mesh, &copy);
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) copy_cell(mesh, cell, NULL, 0, &copy);
    for (int64_t cell = 0, next = 0; cell < mesh->cell_count; cell++) {
        if (mesh->types[cell] != GRID_POLYHEDRON || cell % 2) continue;
        const int64_t *faces = mesh->connectivity + mesh->offsets[cell];
        const int64_t v[3] = {get_face_vertex(mesh, faces[0], 0), get_face_vertex(mesh, faces[0], 1),
                              get_face_vertex(mesh, faces[0], 2)};
        switch (next++ % FLAT_KINDS) {
        case 0: add_pillow(&copy, faces[0]); break;
        case 1: add_bent_pillow(&copy, faces[0], faces[1]); break;
        case 2: add_new_tet(&copy, v[0], v[0]); break;
        case 3: add_new_tet(&copy, v[0], v[1]); break;
        default: add_tet(&copy, (const int64_t[]){v[0], v[0], v[0], v[0]}); break;
        }
    }
    complete_copy(mesh, &copy);
}

/* ---- pictures that must be bit-identical ------------------------------------------------------------------------- */

/* Makes a mesh of polyhedra. kind 0: from tets; 1 and 2: from hexes, of which half or all become polyhedra; 3: from
 * mixed cells, of which half become polyhedra. */
static void make_mesh(int kind, double jitter, test_mesh *mesh)
{
    static const test_mesh_kind kinds[4] = {TEST_POLYHEDRA, TEST_HEXES, TEST_HEXES, TEST_MIXED};
    test_mesh_make_lattice(kinds[kind], 4, jitter, test_wave_field, mesh);
    if (kind) test_mesh_to_polyhedra(mesh, kind == 2 ? 1 : 0.5);
}

static void assert_same_bits(rewriting *rewrite)
{
    for (int kind = 0; kind < 4; kind++)
        for (scene_kind scene = 0; scene < SCENE_COUNT; scene++)
            for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
                test_mesh mesh;
                drawn_frame first, other;
                make_mesh(kind, camera == CAMERA_ALONG_X ? 0 : 0.1, &mesh);
                draw_mesh(&mesh, scene, camera, &first);
                rewrite(&mesh);
                draw_mesh(&mesh, scene, camera, &other);
                assert_true(first.list.count > 100);
                drawn_frame_assert_same(&first, &other);
                drawn_frame_free(&first);
                drawn_frame_free(&other);
                test_mesh_free(&mesh);
            }
}

static void repeated_vertices_of_faces_change_no_pixel(void **state)
{
    (void)state;
    assert_same_bits(repeat_vertices);
}

static void coincident_faces_change_no_pixel(void **state)
{
    (void)state;
    assert_same_bits(add_point_faces);
}

static void reversed_faces_change_no_pixel(void **state)
{
    (void)state;
    assert_same_bits(reverse_faces);
    assert_same_bits(reverse_every_second_cell);
}

static void polyhedra_without_volume_change_no_pixel(void **state)
{
    (void)state;
    assert_same_bits(add_flat_cells);
}

/* ---- pictures that must agree with the reference ----------------------------------------------------------------- */

/* Compares surfaces and samples with the brute-force renderer, and segments with the adaptive integral on every ray.
 * The tolerance of 1e-5 for segments covers values in float32, which have an error of about 1e-6, and the same error of
 * a segment's length in a steep part of the transfer function (see sums_on_spokes_match_the_reference). */
static void assert_matches_reference(const test_mesh *mesh, fixture_camera camera, const char *what)
{
    render_fixture f;
    drawn_frame drawn;
    open_scene(&f, mesh, SURFACES_IN_SAMPLES, camera, 49, 43);
    /* The sheets (triangles between two of the polyhedron's tets) at a face without area lie in one plane. A hit on
     * them is also near to an edge of a tet, and is excluded. */
    fixture_bounds bounds = fixture_usual_bounds;
    bounds.excluded = 3e-3;
    const fixture_outcome o = fixture_compare_with_reference(&f, &bounds, what);
    assert_true(o.hits > 20);
    fixture_free(&f);
    open_scene(&f, mesh, SEGMENTS, camera, 23, 19);
    fixture_draw(&f, &drawn);
    assert_finite(&drawn);
    reference_integral *scene = reference_integral_create(&f.job, 1e-9);
    double worst = 0;
    for (int pixel = 0; pixel < 23 * 19; pixel++) {
        double truth[4];
        reference_integral_trace(scene, pixel % 23, pixel / 23, fixture_background, NULL, 0, truth);
        for (int c = 0; c < 4; c++) {
            const double off = fabs((double)drawn.picture.rgba[4 * pixel + c] - truth[c]);
            worst = test_larger_error(worst, off);
        }
    }
    fprintf(stderr, "%s, %s, by segments: %.2g\n", what, fixture_camera_name(camera), worst);
    assert_true(worst < 1e-5);
    reference_integral_free(scene);
    drawn_frame_free(&drawn);
    fixture_free(&f);
}

/* An edge between two vertices, and the vertex in the middle of the edge. */
typedef struct split_edge {
    int64_t low, high, middle, face; /* face: the face without area along the edge */
} split_edge;

typedef struct split_edges {
    split_edge *items;
    int count;
} split_edges;

static bool is_split(int64_t low, int64_t high)
{
    return test_uniform((uint64_t)(low * 1000 + high), 3) < 0.2;
}

static split_edge *find_split(split_edges *edges, test_mesh *mesh, int64_t a, int64_t b)
{
    const int64_t low = a < b ? a : b, high = a < b ? b : a;
    if (!is_split(low, high)) return NULL;
    for (int i = 0; i < edges->count; i++)
        if (edges->items[i].low == low && edges->items[i].high == high) return &edges->items[i];
    split_edge *e = &edges->items[edges->count++];
    double p[3];
    for (int axis = 0; axis < 3; axis++)
        p[axis] = (mesh->coordinates[3 * low + axis] + mesh->coordinates[3 * high + axis]) / 2;
    *e = (split_edge){low, high, test_mesh_add_vertex(mesh, p), -1};
    mesh->values[e->middle] = (mesh->values[low] + mesh->values[high]) / 2;
    return e;
}

/* Decides by a hash whether the middle of the edge that begins at vertex `low` is inserted into the face. Both cells at
 * the face get the same decision. */
static bool inserts_edge_middle(int64_t face, int64_t low)
{
    return test_uniform((uint64_t)(face * 1000 + low), 4) < 0.5;
}

static void add_middle_to_face(const test_mesh *mesh, int64_t face, split_edges *edges, test_mesh *copy)
{
    int64_t loop[64], count = 0;
    for (int64_t i = 0; i < face_size(mesh, face); i++) {
        const int64_t a = get_face_vertex(mesh, face, i);
        const split_edge *e = find_split(edges, copy, a, get_face_vertex(mesh, face, i + 1));
        loop[count++] = a;
        if (e && inserts_edge_middle(face, e->low)) loop[count++] = e->middle;
    }
    test_mesh_add_face(copy, loop, count);
}

/* Adds faces without area to a cell: one for each edge at which only one of the cell's two faces contains the edge's
 * middle. */
static int add_flat_faces_to_cell(const test_mesh *mesh, int64_t cell, split_edges *edges, test_mesh *copy,
                                  int64_t more[32])
{
    int count = 0;
    const int64_t *faces = mesh->connectivity + mesh->offsets[cell];
    for (int e = 0; e < edges->count; e++) {
        split_edge *edge = &edges->items[e];
        int at_edge = 0, with = 0;
        for (int i = 0; i < count_cell_faces(mesh, cell); i++)
            for (int64_t k = 0; k < face_size(mesh, faces[i]); k++) {
                const int64_t a = get_face_vertex(mesh, faces[i], k), b = get_face_vertex(mesh, faces[i], k + 1);
                if ((a < b ? a : b) != edge->low || (a < b ? b : a) != edge->high) continue;
                at_edge++;
                with += inserts_edge_middle(faces[i], edge->low);
            }
        if (at_edge != 2 || with != 1) continue;
        if (edge->face < 0)
            edge->face = test_mesh_add_face(copy, (const int64_t[]){edge->low, edge->middle, edge->high}, 3);
        more[count++] = edge->face;
        assert_true(count < 32);
    }
    return count;
}

/* Adds vertices in the middle of edges. Neighbouring cells share the faces without area that this requires. Returns the
 * number of cells with such faces. */
static int add_edge_middles(test_mesh *mesh)
{
    test_mesh copy = begin_copy(mesh);
    split_edges edges = {test_allocate(mesh->face_connectivity_count, sizeof(split_edge)), 0};
    int64_t more[32];
    int cells = 0;
    for (int64_t face = 0; face < mesh->face_count; face++) add_middle_to_face(mesh, face, &edges, &copy);
    for (int64_t cell = 0; cell < mesh->cell_count; cell++) {
        const int count = add_flat_faces_to_cell(mesh, cell, &edges, &copy, more);
        cells += count > 0;
        copy_cell(mesh, cell, more, count, &copy);
    }
    free(edges.items);
    complete_copy(mesh, &copy);
    return cells;
}

/* Checks vertices in the middle of edges that only some of the faces at the edge contain. First their values are the
 * means of the edge's ends, and pictures must agree with the reference; in jittered lattices these vertices are off the
 * edges by rounding. Then they have other values: the field as defined jumps at the face without area, and a ray's
 * profile (the field along the ray) may take the value of either side up to the next sheet, so the picture must only
 * consist of finite numbers. */
static void faces_without_area_match_the_reference(void **state)
{
    (void)state;
    for (fixture_camera camera = 0; camera < CAMERA_ALONG_X; camera++)
        for (int kind = 0; kind < 2; kind++) {
            test_mesh mesh;
            if (!test_is_long_run() && ((int)camera + kind) % 2) continue;
            test_mesh_make_lattice(kind ? TEST_TETS : TEST_HEXES, 3, 0.1, test_wave_field, &mesh);
            test_mesh_to_polyhedra(&mesh, 1);
            assert_true(add_edge_middles(&mesh) > 10);
            assert_matches_reference(&mesh, camera,
                                     kind ? "tets with faces of no area" : "hexes with faces of no area");
            test_mesh_set_values(&mesh, test_wave_field);
            for (scene_kind scene = 0; scene < SCENE_COUNT; scene++) {
                drawn_frame drawn;
                draw_mesh(&mesh, scene, camera, &drawn);
                drawn_frame_free(&drawn);
            }
            test_mesh_free(&mesh);
        }
}

/* Checks a polyhedron of two tets that touch at one vertex. They have one common face, which passes this vertex
 * twice. */
static void face_with_a_repeated_vertex_matches_the_reference(void **state)
{
    (void)state;
    static const double places[7][3] = {{0, 0, -0.3},     {-0.7, -0.5, -0.3}, {-0.6, 0.6, -0.3}, {0.7, -0.6, -0.3},
                                        {0.6, 0.5, -0.3}, {-0.4, 0.1, 0.7},   {0.4, -0.1, 0.6}};
    static const int64_t loops[6][3] = {{5, 0, 1}, {5, 1, 2}, {5, 2, 0}, {6, 0, 4}, {6, 4, 3}, {6, 3, 0}};
    for (fixture_camera camera = 0; camera < CAMERA_INSIDE; camera++) {
        test_mesh mesh;
        int64_t faces[7];
        test_mesh_allocate(&mesh, 7, 1, 7);
        test_mesh_allocate_faces(&mesh, 7, 24);
        for (int i = 0; i < 7; i++) test_mesh_add_vertex(&mesh, places[i]);
        for (int i = 0; i < 6; i++) faces[i] = test_mesh_add_face(&mesh, loops[i], 3);
        faces[6] = test_mesh_add_face(&mesh, (const int64_t[]){0, 1, 2, 0, 4, 3}, 6);
        test_mesh_add_polyhedron(&mesh, faces, 7);
        test_mesh_set_values(&mesh, test_wave_field);
        assert_matches_reference(&mesh, camera, "a face through a vertex twice");
        test_mesh_free(&mesh);
    }
}

/* Checks a single flat cell with its own vertices and values. It must be invisible in volumes. Its field may have
 * different values in front of and behind the cell; a surface is then visible between them, as in the thin cell whose
 * limit the flat cell is. All numbers must be finite. */
static void flat_polyhedra_are_finite(void **state)
{
    (void)state;
    static const test_cell_shape shapes[3] = {TEST_FLAT_TET, TEST_FLAT_HEX, TEST_POINT_HEX};
    for (int s = 0; s < 3; s++)
        for (scene_kind scene = 0; scene < SCENE_COUNT; scene++)
            for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
                test_mesh mesh;
                drawn_frame drawn;
                test_mesh_make_single_cell(shapes[s], test_wave_field, &mesh);
                for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.values[v] = 2 * test_uniform((uint64_t)v, 5) - 1;
                test_mesh_to_polyhedra(&mesh, 1);
                draw_mesh(&mesh, scene, camera, &drawn);
                for (int64_t i = 0; scene == SEGMENTS && i < 4 * 61 * 47; i++)
                    if (fabs((double)(drawn.picture.rgba[i] - fixture_background[i % 4])) > 1e-6)
                        fail_msg("%s, %s: pixel %d", test_cell_shape_name(shapes[s]), fixture_camera_name(camera),
                                 (int)(i / 4));
                drawn_frame_free(&drawn);
                test_mesh_free(&mesh);
            }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(repeated_vertices_of_faces_change_no_pixel),
        cmocka_unit_test(coincident_faces_change_no_pixel),
        cmocka_unit_test(reversed_faces_change_no_pixel),
        cmocka_unit_test(polyhedra_without_volume_change_no_pixel),
        cmocka_unit_test(faces_without_area_match_the_reference),
        cmocka_unit_test(face_with_a_repeated_vertex_matches_the_reference),
        cmocka_unit_test(flat_polyhedra_are_finite),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
