/* Checks batches, in which tiles trace one cell per lane (kernel_batch.h, kernel_curved_batch.h). Pictures must be
 * bit-identical to those of a scene in which every cell is a mesh of its own, because a batch has cells of one mesh
 * only: each cell is then traced alone. A cell covers one pixel, some or many. The last cells of a mesh share a vector,
 * and several of them may hit the same pixel. The usual run draws each scene from every third camera, alternately, so
 * that each kind of cells is drawn from each camera. */
#include "test_effort.h"
#include "test_render_fixture.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <cmocka.h>

/* such that clipped pictures have more than 100 fragments, too */
enum { WIDTH = 81, HEIGHT = 63 };

static const float other_colours[2][3] = {{0.9f, 0.9f, 0.1f}, {0.1f, 0.9f, 0.9f}};
static const double values[4] = {-0.2, 0.3, 0.1, -0.5};

static void create_fixture_with_layout(render_fixture *f, const test_mesh *meshes, int count, int n,
                                       fixture_camera camera, test_layout layout)
{
    fixture_create(f, meshes, count, layout, 2.0 / n, 1, (const double[]){0, 0, 0});
    fixture_set_camera(f, camera, WIDTH, HEIGHT);
}

static void create_fixture(render_fixture *f, const test_mesh *meshes, int count, int n, fixture_camera camera)
{
    create_fixture_with_layout(f, meshes, count, n, camera, (test_layout){.is_interleaved = n % 2});
}

/* A scene in which each cell of a fixture is a mesh of its own. mesh: index of the cell's mesh in the fixture. */
typedef struct single_cells {
    int count;
    int *mesh;
    grid *cells;
    mmbvh *trees;
    mmbvh_ranges *ranges;
    render_part *parts;
} single_cells;

static void *allocate(int count, size_t size)
{
    void *memory = calloc((size_t)count, size);
    assert_non_null(memory);
    return memory;
}

static void single_cells_add(single_cells *all, const render_fixture *f, int mesh, int64_t cell)
{
    const int i = all->count++;
    grid *one = &all->cells[i];
    base_error error = {0};
    *one = f->views[mesh].cells;
    if (one->offsets.data)
        one->connectivity.data += grid_read_index(&one->offsets, cell) * one->connectivity.stride;
    else
        one->connectivity.data += cell * grid_type_vertex_count(one->cell_type) * one->connectivity.stride;
    one->cell_type = grid_cell_type(&f->views[mesh].cells, cell);
    one->cell_types = one->ghosts = NULL;
    one->offsets = (grid_array){0};
    one->cell_count = 1;
    all->mesh[i] = mesh;
    assert_int_equal(mmbvh_build(one, &f->fields[mesh], f->job.space.origin, f->job.space.scale,
                                 &(mmbvh_options){.threads = 1}, &all->trees[i], &error),
                     INSITU_OK);
    static const float no_values[2] = {1e30f, 1e30f};
    all->ranges[i] = mmbvh_own_ranges(&all->trees[i]);
    if (!all->ranges[i].low) all->ranges[i] = mmbvh_pair_ranges(no_values);
    all->parts[i] = (render_part){one, &all->trees[i], NULL};
}

static void single_cells_create(const render_fixture *f, single_cells *out)
{
    int count = 0;
    for (int i = 0; i < f->part_count; i++) count += (int)f->views[i].cells.cell_count;
    *out = (single_cells){.mesh = allocate(count, sizeof *out->mesh),
                          .cells = allocate(count, sizeof *out->cells),
                          .trees = allocate(count, sizeof *out->trees),
                          .ranges = allocate(count, sizeof *out->ranges),
                          .parts = allocate(count, sizeof *out->parts)};
    for (int i = 0; i < f->part_count; i++)
        for (int64_t cell = 0; cell < f->views[i].cells.cell_count; cell++) single_cells_add(out, f, i, cell);
}

static void single_cells_free(single_cells *all)
{
    for (int i = 0; i < all->count; i++) mmbvh_free(&all->trees[i]);
    free(all->mesh);
    free(all->cells);
    free(all->trees);
    free(all->ranges);
    free(all->parts);
}

/* Returns a field on the meshes of single cells. The caller frees its member `fields`. */
static render_field spread_field(const single_cells *all, render_field of)
{
    grid_field *fields = allocate(all->count, sizeof *fields);
    for (int i = 0; of.fields && i < all->count; i++) fields[i] = of.fields[all->mesh[i]];
    return (render_field){fields, all->ranges};
}

static void draw_single_cells(const render_fixture *f, drawn_frame *out)
{
    render_fixture alone = *f;
    single_cells all;
    render_lines lines[2];
    single_cells_create(f, &all);
    alone.job.parts = all.parts;
    alone.job.part_count = all.count;
    alone.job.surfaces = alone.surfaces;
    alone.job.volumes = &alone.volume;
    alone.volume.field = spread_field(&all, f->volume.field);
    for (int i = 0; i < f->job.surface_count; i++) {
        render_surface_layer *layer = &alone.surfaces[i];
        layer->field = spread_field(&all, layer->field);
        layer->colour_field = spread_field(&all, layer->colour_field);
        if (!layer->lines) continue;
        lines[i] = *layer->lines;
        lines[i].field = spread_field(&all, lines[i].field);
        layer->lines = &lines[i];
    }
    fixture_draw(&alone, out);
    for (int i = 0; i < f->job.surface_count; i++) {
        free((void *)alone.surfaces[i].field.fields);
        free((void *)alone.surfaces[i].colour_field.fields);
        if (alone.surfaces[i].lines) free((void *)lines[i].field.fields);
    }
    free((void *)alone.volume.field.fields);
    single_cells_free(&all);
}

static void compare_with_single_cells(render_fixture *f)
{
    drawn_frame batches, alone;
    fixture_draw(f, &batches);
    draw_single_cells(f, &alone);
    assert_true(batches.list.count > 100);
    drawn_frame_assert_same(&batches, &alone);
    drawn_frame_free(&alone);
    drawn_frame_free(&batches);
    fixture_free(f);
}

/* Ways to draw a layer, each of which kernels process in another way. */
enum { PLAIN, TRANSPARENT, CLIPPED, CLIPPED_IN_ALL_LAYERS, BY_DIFFERENCES, VALUES, WAYS };

static void choose_way(render_fixture *f, int way)
{
    static const render_clip ball = {
        .kind = RENDER_CLIP_SPHERE, .centre = {0.5, 0.3, 0.6}, .radius = 0.7, .is_outside = true};
    static const render_clip box = {.kind = RENDER_CLIP_BOX, .lower = {-0.8, -0.7, -0.6}, .upper = {0.6, 0.9, 0.7}};
    render_surface_layer *layer = &f->surfaces[0];
    if (way == TRANSPARENT || way == CLIPPED) layer->opacity = 0.4f;
    if (way == CLIPPED || way == CLIPPED_IN_ALL_LAYERS) {
        f->job.clips = way == CLIPPED ? &ball : &box;
        f->job.clip_count = 1;
        layer->clips = 1;
    }
    if (way == BY_DIFFERENCES) {
        layer->normal = RENDER_DIFFERENCES;
        layer->difference = 1;
    }
    if (way == VALUES) f->job.paint = RENDER_VALUES;
}

static bool is_case_selected(int turn)
{
    return test_is_long_run() || turn % 6 == 0;
}

static void batches_draw_same_picture_as_single_cells(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    static const struct {
        int n;
        test_function *field;
    } lattices[] = {{2, test_wave_field}, {4, test_wave_field}, {7, test_wave_field}, {9, test_linear_field}};
    for (size_t i = 0; i < sizeof lattices / sizeof *lattices; i++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++)
            for (int turn = 0; turn < 2 * (int)(sizeof kinds / sizeof *kinds); turn++) {
                const int jittered = turn % 2;
                const double jitter = jittered ? 0.2 : 0;
                render_fixture f;
                test_mesh mesh;
                if (!is_case_selected((int)i + (int)camera + turn)) continue;
                test_mesh_make_lattice(kinds[turn / 2], lattices[i].n, jitter, lattices[i].field, &mesh);
                create_fixture(&f, &mesh, 1, lattices[i].n, camera);
                fixture_add_surface(&f, values, 1 + jittered, 1);
                choose_way(&f, ((int)i + (int)camera + turn / 2) % (int)WAYS);
                compare_with_single_cells(&f);
                test_mesh_free(&mesh);
            }
}

/* Checks cells whose vertices are in any order, in arrays of all layouts. Some cells have an edge of length 0, so that
 * quads collapse to triangles and triangles to edges. */
static void any_numbering_gives_the_same_batches(void **state)
{
    static const test_mesh_kind kinds[] = {TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    (void)state;
    for (int turn = 0; turn < 6 * (int)(sizeof kinds / sizeof *kinds); turn++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
            const int n = turn / 2 % 2 ? 8 : 5;
            render_fixture f;
            test_mesh mesh;
            if (!is_case_selected((int)camera + turn)) continue;
            test_mesh_make_lattice(kinds[turn / 6], n, 0.2, test_wave_field, &mesh);
            for (int64_t c = 0; turn % 6 < 4 && c < mesh.cell_count; c += 7)
                mesh.connectivity[mesh.offsets[c] + 1] = mesh.connectivity[mesh.offsets[c]];
            test_mesh_reorder_vertices(&mesh, (uint64_t)turn);
            create_fixture_with_layout(
                &f, &mesh, 1, n, camera,
                (test_layout){.wide_coordinates = turn % 2, .wide_indices = turn % 6 == 4, .is_interleaved = true});
            fixture_add_surface(&f, values, 2, 1);
            compare_with_single_cells(&f);
            test_mesh_free(&mesh);
        }
}

/* Checks scenes with several meshes and layers: all cells of a batch must belong to one mesh and one layer. */
static void batches_contain_one_mesh_and_layer(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[][2] = {
        {TEST_TETS, TEST_HEXES}, {TEST_TETS, TEST_TETS}, {TEST_WEDGES, TEST_PYRAMIDS}, {TEST_MIXED, TEST_WEDGES}};
    for (size_t kind = 0; kind < sizeof kinds / sizeof *kinds; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
            render_fixture f;
            test_mesh meshes[2];
            test_mesh_make_lattice(kinds[kind][0], 7, 0.2, test_wave_field, &meshes[0]);
            test_mesh_make_lattice(kinds[kind][1], 8, 0.1, test_linear_field, &meshes[1]);
            create_fixture(&f, meshes, 2, 7, camera);
            fixture_add_surface(&f, values, 2, 1);
            fixture_add_surface(&f, values + 2, 2, kind % 2 ? 1 : 0.4f);
            f.surfaces[1].colours = other_colours[0];
            compare_with_single_cells(&f);
            for (int i = 0; i < 2; i++) test_mesh_free(&meshes[i]);
        }
}

/* Checks hits at equal depths: each hit occurs twice. */
static void hits_at_equal_depth_are_kept(void **state)
{
    (void)state;
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS};
    for (int turn = 0; turn < 2 * (int)(sizeof kinds / sizeof *kinds); turn++) {
        const int n = turn % 2 ? 8 : 4;
        render_fixture f;
        test_mesh meshes[2];
        for (int i = 0; i < 2; i++) test_mesh_make_lattice(kinds[turn / 2], n, 0.2, test_linear_field, &meshes[i]);
        create_fixture(&f, meshes, 2, n, CAMERA_OUTSIDE);
        fixture_add_surface(&f, values, 1, 1);
        compare_with_single_cells(&f);
        for (int i = 0; i < 2; i++) test_mesh_free(&meshes[i]);
    }
}

/* Checks cells with extreme values, from tiny ones to NaN. They are traced one by one although other cells in the same
 * vector are traced in a batch. */
static void unusual_values_are_handled_one_by_one(void **state)
{
    static const float opacity[1] = {0.3f};
    static const double odd[] = {3e31, -3e31, 1e-41, (double)INFINITY, (double)NAN, 3e38};
    (void)state;
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_TETS, TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS};
    for (size_t turn = 0; turn < sizeof kinds / sizeof *kinds; turn++) {
        const bool as_volume = turn == 1;
        render_fixture f;
        test_mesh mesh;
        test_mesh_make_lattice(kinds[turn], 7, 0.2, test_wave_field, &mesh);
        for (int64_t v = 5; v < mesh.vertex_count; v += 37)
            mesh.values[v] = odd[v / 37 % (int64_t)(sizeof odd / sizeof *odd)];
        create_fixture(&f, &mesh, 1, 7, CAMERA_OUTSIDE);
        if (as_volume) {
            fixture_set_volume(&f, 0.1);
            f.transfer.opacity_count = 1; /* the opacity is the same for all values, however large */
            f.transfer.opacities = opacity;
        } else {
            /* a single isovalue, because with two many hits would have equal depths */
            fixture_add_surface(&f, values, 1, 1);
        }
        compare_with_single_cells(&f);
        test_mesh_free(&mesh);
    }
}

/* Checks contour lines over the colours of isovalues and over a colour map. The kernels sort a cell's vertices by their
 * coordinates, so the order of vertices in the mesh must not matter. */
static void lines_of_batches_match_single_cells(void **state)
{
    static const test_mesh_kind kinds[] = {TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    static const double levels[3] = {-0.4, 0.05, 0.3};
    static const float white[9] = {1, 1, 1, 1, 1, 1, 1, 1, 1};
    (void)state;
    for (int turn = 0; turn < 4 * (int)(sizeof kinds / sizeof *kinds); turn++) {
        const int n = turn % 2 ? 8 : 4;
        render_fixture f;
        test_mesh mesh, other;
        test_view view;
        test_mesh_make_lattice(kinds[turn / 4], n, 0.2, test_wave_field, &mesh);
        test_mesh_make_lattice(kinds[turn / 4], n, 0.2, test_linear_field, &other);
        test_mesh_reorder_vertices(&mesh, 3);
        test_mesh_reorder_vertices(&other, 3);
        test_view_create(&other, (test_layout){.is_interleaved = true}, &view);
        create_fixture(&f, &mesh, 1, n, (fixture_camera)(turn % (int)CAMERA_COUNT));
        fixture_add_surface(&f, values, 2, 1);
        const render_lines lines = {
            .field = {&view.field, f.ranges}, .count = 3, .values = levels, .width = 2, .colours = white};
        f.surfaces[0].lines = &lines;
        if (turn % 4 > 1) {
            fixture_set_volume(&f, 0.3); /* the surface uses the colours of this volume's transfer function */
            f.job.volume_count = 0;
            f.surfaces[0].colour_field = (render_field){&view.field, f.ranges};
            f.surfaces[0].colour_map = &f.transfer;
        }
        compare_with_single_cells(&f);
        test_view_free(&view);
        test_mesh_free(&mesh);
        test_mesh_free(&other);
    }
}

/* Adds this number to the indices of all vertices and faces, so that they do not fit in 32 bits. */
static const int64_t index_shift = 3000000000;

/* Moves an array's address so that an index that is index_shift larger reads the same element. */
static void shift_array(grid_array *a)
{
    a->data = (const char *)((uintptr_t)a->data - (uintptr_t)(index_shift * a->stride));
}

static void shift_indices(render_fixture *f)
{
    grid *g = &f->views[0].cells;
    g->vertex_count += index_shift;
    for (int a = 0; a < 3; a++) shift_array(&g->coordinates[a]);
    shift_array(&f->fields[0].values);
    g->connectivity.base -= index_shift;
    g->face_connectivity.base -= index_shift;
    if (g->face_count) shift_array(&g->face_offsets); /* connectivity contains the indices of faces, too */
}

/* Sets contour lines and the colour map of a surface to the other field. */
static void show_other_field(render_fixture *f, const grid_field *other, render_lines *lines)
{
    static const double levels[2] = {-0.4, 0.05};
    static const float white[6] = {1, 1, 1, 1, 1, 1};
    *lines = (render_lines){.field = {other, f->ranges}, .count = 2, .values = levels, .width = 2, .colours = white};
    f->surfaces[0].lines = lines;
    fixture_set_volume(f, 0.3); /* the surface uses the colours of this volume's transfer function */
    f->job.volume_count = 0;
    f->surfaces[0].colour_field = lines->field;
    f->surfaces[0].colour_map = &f->transfer;
}

static void compare_with_large_indices(test_mesh_kind kind, double share_of_polyhedra, int way)
{
    render_fixture f;
    render_lines lines;
    test_mesh mesh;
    test_view other;
    drawn_frame expected, drawn;
    test_mesh_make_lattice(kind, 5, way % 2 ? 0.2 : 0, test_linear_field, &mesh);
    if (share_of_polyhedra > 0) test_mesh_to_polyhedra(&mesh, share_of_polyhedra);
    test_view_create(&mesh, (test_layout){.is_interleaved = true}, &other);
    test_mesh_set_values(&mesh, test_wave_field);
    create_fixture(&f, &mesh, 1, 5, (fixture_camera)(way % (int)CAMERA_COUNT));
    fixture_add_surface(&f, values, 2, 1);
    if (way < WAYS)
        choose_way(&f, way);
    else
        show_other_field(&f, &other.field, &lines);
    fixture_draw(&f, &expected);
    shift_indices(&f);
    shift_array(&other.field.values);
    fixture_draw(&f, &drawn);
    assert_true(expected.list.count > 100);
    drawn_frame_assert_same(&expected, &drawn);
    drawn_frame_free(&expected);
    drawn_frame_free(&drawn);
    fixture_free(&f);
    test_view_free(&other);
    test_mesh_free(&mesh);
}

/* Checks meshes whose vertex indices do not fit in 32 bits. Some polyhedra are tets. */
static void large_indices_give_the_same_picture(void **state)
{
    static const test_mesh_kind kinds[] = {TEST_TETS, TEST_HEXES, TEST_WEDGES, TEST_PYRAMIDS, TEST_MIXED};
    (void)state;
    for (size_t kind = 0; kind < sizeof kinds / sizeof *kinds; kind++)
        for (int way = 0; way <= WAYS; way++) compare_with_large_indices(kinds[kind], 0, way);
    for (int way = 0; way <= WAYS; way++)
        if (way != BY_DIFFERENCES) compare_with_large_indices(TEST_MIXED, 0.5, way);
}

int main(void)
{
    if (fixture_isa_is_unavailable()) return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(batches_draw_same_picture_as_single_cells),
        cmocka_unit_test(any_numbering_gives_the_same_batches),
        cmocka_unit_test(batches_contain_one_mesh_and_layer),
        cmocka_unit_test(hits_at_equal_depth_are_kept),
        cmocka_unit_test(unusual_values_are_handled_one_by_one),
        cmocka_unit_test(lines_of_batches_match_single_cells),
        cmocka_unit_test(large_indices_give_the_same_picture),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
