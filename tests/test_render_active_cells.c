/* Kept cells change no bit of a picture, whichever are kept and whatever is drawn afterwards; their number follows from
 * the meshes, and their memory is freed. */
#include "memory.h"
#include "pixel_set.h"
#include "test_effort.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

enum { WIDTH = 45, HEIGHT = 35, TET_BYTES = 64, HEX_BYTES = 128, MOST_BYTES = 64 << 20 };

static const double three_values[3] = {-0.2, 0.1, 0.6}, one_value[1] = {0.3};
static const double origin[3] = {0, 0, 0};
static const test_layout narrow = {0}, interleaved = {.is_interleaved = true};

/* ---- pictures ------------------------------------------------------------------------------------------------- */

static int by_bytes(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(fragment));
}

static insitu_status draw(render_fixture *f, render_active_cells *kept, fragment_list *list)
{
    base_error error = {0};
    *list = (fragment_list){0};
    f->job.active = kept;
    const insitu_status status = render_frame(&f->job, list, NULL, &error);
    f->job.active = NULL;
    if (!status) qsort(list->items, (size_t)list->count, sizeof *list->items, by_bytes);
    return status;
}

static void assert_same(const fragment_list *a, const fragment_list *b, const char *what)
{
    if (a->count != b->count) fail_msg("%s: %d fragments, not %d", what, (int)b->count, (int)a->count);
    if (memcmp(a->items, b->items, (size_t)a->count * sizeof *a->items) != 0) fail_msg("%s: other bits", what);
}

/* Returns how many fragments there are. */
static int64_t compare(render_fixture *f, render_active_cells *kept, const char *what)
{
    fragment_list without, with;
    assert_int_equal(draw(f, NULL, &without), INSITU_OK);
    assert_int_equal(draw(f, kept, &with), INSITU_OK);
    assert_same(&without, &with, what);
    base_free(without.items);
    base_free(with.items);
    return without.count;
}

/* Draws from all cameras in turn and the first again (or all, twice), by at most so many threads; the cells that the
 * first keeps serve the others. */
static void look_around_by(render_fixture *f, render_active_cells *kept, int threads, const char *what)
{
    int64_t fragments = 0, bytes = 0;
    for (int turn = 0; turn < test_effort(CAMERA_COUNT + 1, 2 * CAMERA_COUNT); turn++) {
        const fixture_camera camera = (fixture_camera)(turn % CAMERA_COUNT);
        char name[160];
        snprintf(name, sizeof name, "%s, %s, turn %d", what, fixture_camera_name(camera), turn);
        fixture_look(f, camera, WIDTH, HEIGHT);
        f->job.threads = 1 + (turn + 1) % threads;
        fragments += compare(f, kept, name);
        if (turn == 0) bytes = render_active_cells_bytes(kept);
        assert_int_equal(render_active_cells_bytes(kept), bytes);
    }
    assert_true(fragments > 0);
}

static void look_around(render_fixture *f, render_active_cells *kept, const char *what)
{
    look_around_by(f, kept, 3, what);
}

/* ---- what is to be kept --------------------------------------------------------------------------------------- */

/* Cells that an isovalue crosses: some vertex's value is below it, another's is not. */
static int64_t crossed_cells(const test_view *view, const double *values, int count)
{
    const grid *g = &view->cells;
    const int vertices = g->cell_type == GRID_HEX ? 8 : 4;
    int64_t crossed = 0;
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        double low = INFINITY, high = -INFINITY;
        for (int i = 0; i < vertices; i++) {
            const int32_t vertex = ((const int32_t *)(const void *)g->connectivity.data)[cell * vertices + i];
            float value;
            memcpy(&value, view->field.values.data + vertex * view->field.values.stride, sizeof value);
            low = fmin(low, (double)value);
            high = fmax(high, (double)value);
        }
        bool is_crossed = false;
        for (int i = 0; i < count; i++) is_crossed = is_crossed || (low < values[i] && high >= values[i]);
        crossed += is_crossed && !g->ghosts[cell];
    }
    return crossed;
}

static int64_t expected_bytes(const test_view *view, const double *values, int count)
{
    return crossed_cells(view, values, count) * (view->cells.cell_type == GRID_HEX ? HEX_BYTES : TET_BYTES);
}

static void lattice(render_fixture *f, test_mesh_kind kind, int n, test_layout layout, test_function *field)
{
    test_mesh mesh;
    test_mesh_lattice(kind, n, 0.2, field, &mesh);
    fixture_create(f, &mesh, 1, layout, 2.0 / n, 1, origin);
    test_mesh_free(&mesh);
}

/* ---- plain meshes --------------------------------------------------------------------------------------------- */

static const test_mesh_kind plain_kinds[2] = {TEST_TETS, TEST_HEXES};

static void plain_meshes_are_kept_and_draw_the_same(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++)
        for (int variant = 0; variant < 8; variant++) {
            const int64_t held = base_memory_held();
            const int count = variant & 1 ? 3 : 1;
            const double *values = variant & 1 ? three_values : one_value;
            render_fixture f;
            render_active_cells *kept = render_active_cells_create();
            lattice(&f, plain_kinds[i], variant & 4 ? 5 : 3, variant & 2 ? interleaved : narrow, test_wave);
            fixture_add_surface(&f, values, count, 1);
            f.surfaces[0].root = RENDER_ROBUST;
            assert_int_equal(render_active_cells_bytes(kept), 0);
            look_around(&f, kept, test_mesh_kind_name(plain_kinds[i]));
            assert_int_equal(render_active_cells_bytes(kept), expected_bytes(&f.views[0], values, count));
            fixture_free(&f);
            render_active_cells_free(kept);
            assert_int_equal(base_memory_held(), held);
        }
}

/* Hexes whose volume is none of float32's are looked at one by one: here all are, in a space that is made for others.
 */
static void tiny_hexes_draw_the_same(void **state)
{
    static const double size = 1e-11;
    test_mesh mesh;
    render_fixture f;
    render_active_cells *kept = render_active_cells_create();
    (void)state;
    test_mesh_lattice(TEST_HEXES, 6, 0.2, test_wave, &mesh);
    test_mesh_transform(&mesh, size, origin);
    fixture_create(&f, &mesh, 1, narrow, 2.0 / 6 * size, 1, origin);
    f.scale = size;
    fixture_add_surface(&f, three_values, 3, 1);
    f.surfaces[0].root = RENDER_ROBUST;
    look_around(&f, kept, "tiny hexes");
    assert_int_equal(render_active_cells_bytes(kept), expected_bytes(&f.views[0], three_values, 3));
    fixture_free(&f);
    test_mesh_free(&mesh);
    render_active_cells_free(kept);
}

/* Every second layer of vertices lies on the one before: flat hexes, and where only half of it does some are wedges. */
static void collapsed_hexes_draw_the_same(void **state)
{
    (void)state;
    for (int wedges = 0; wedges < 2; wedges++) {
        test_mesh mesh;
        render_fixture f;
        render_active_cells *kept = render_active_cells_create();
        test_mesh_lattice(TEST_HEXES, 6, 0, test_wave, &mesh);
        for (int64_t i = 0; i < mesh.vertex_count; i++) {
            double *at = mesh.coordinates + 3 * i;
            const int layer = (int)lround((at[2] + 1) * 3);
            if (layer % 2 && (!wedges || at[0] < 0)) at[2] = (layer - 1) / 3.0 - 1;
        }
        test_mesh_set_values(&mesh, test_wave);
        fixture_create(&f, &mesh, 1, narrow, 2.0 / 6, 1, origin);
        fixture_add_surface(&f, three_values, 3, 1);
        f.surfaces[0].root = RENDER_ROBUST;
        look_around(&f, kept, wedges ? "wedges told as hexes" : "flat hexes");
        fixture_free(&f);
        test_mesh_free(&mesh);
        render_active_cells_free(kept);
    }
}

/* Ghosts are not drawn, so they are not kept. */
static void ghosts_are_not_kept(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        test_mesh mesh;
        render_fixture f;
        render_active_cells *kept = render_active_cells_create();
        test_mesh_lattice(plain_kinds[i], 5, 0.2, test_wave, &mesh);
        for (int64_t cell = 0; cell < mesh.cell_count; cell++) mesh.ghosts[cell] = cell % 3 == 0;
        fixture_create(&f, &mesh, 1, narrow, 2.0 / 5, 1, origin);
        fixture_add_surface(&f, three_values, 3, 1);
        f.surfaces[0].root = RENDER_ROBUST;
        look_around(&f, kept, "with ghosts");
        assert_int_equal(render_active_cells_bytes(kept), expected_bytes(&f.views[0], three_values, 3));
        fixture_free(&f);
        test_mesh_free(&mesh);
        render_active_cells_free(kept);
    }
}

/* Several cells show in a pixel, so tiles go down the tree and do not use kept cells; nothing is kept but where the eye
 * is amid the cells. */
static void small_pictures_of_many_cells_draw_the_same(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++)
        for (int size = 1; size <= 16; size *= 4) {
            render_fixture f;
            render_active_cells *kept = render_active_cells_create();
            lattice(&f, plain_kinds[i], 20, narrow, test_wave);
            fixture_add_surface(&f, three_values, 3, 1);
            f.surfaces[0].root = RENDER_ROBUST;
            for (int turn = 0; turn < 3; turn++) {
                fixture_look(&f, turn == 1 ? CAMERA_INSIDE : CAMERA_OUTSIDE, size, size);
                compare(&f, kept, "a small picture");
                if (turn == 0) assert_int_equal(render_active_cells_bytes(kept), 0);
            }
            const int64_t bytes = render_active_cells_bytes(kept);
            assert_true(bytes == 0 || bytes == expected_bytes(&f.views[0], three_values, 3));
            fixture_free(&f);
            render_active_cells_free(kept);
        }
}

static void subsets_of_pixels_and_other_traversals_draw_the_same(void **state)
{
    (void)state;
    unsigned char pixels[(WIDTH * HEIGHT + 7) / 8] = {0};
    for (int64_t p = 0; p < WIDTH * HEIGHT; p++)
        if (p * p % 7 < 3) pixel_set_add(pixels, p);
    for (int i = 0; i < 2; i++) {
        render_fixture f;
        render_active_cells *kept = render_active_cells_create();
        lattice(&f, plain_kinds[i], 4, narrow, test_wave);
        fixture_look(&f, CAMERA_OUTSIDE, WIDTH, HEIGHT);
        fixture_add_surface(&f, three_values, 3, 1);
        for (int turn = 0; turn < 2; turn++) {
            f.job.pixels = pixels;
            assert_true(compare(&f, kept, "some of the pixels") > 0);
            f.job.pixels = NULL;
            for (render_traversal t = RENDER_BINNED; t <= RENDER_SPMD; t++) {
                f.job.traversal = t;
                assert_true(compare(&f, kept, "a traversal") > 0);
            }
            f.job.traversal = RENDER_BINNED;
        }
        fixture_free(&f);
        render_active_cells_free(kept);
    }
}

/* ---- what is not kept ----------------------------------------------------------------------------------------- */

static void other_meshes_and_layouts_are_not_kept(void **state)
{
    (void)state;
    static const test_layout wide[4] = {{.wide_coordinates = true},
                                        {.wide_values = true},
                                        {.with_types = true},
                                        {.wide_coordinates = true, .wide_values = true, .wide_indices = true}};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int layout = -1; layout < 4; layout++) {
            render_fixture f;
            render_active_cells *kept = render_active_cells_create();
            if (layout < 0 && (kind == TEST_TETS || kind == TEST_HEXES)) {
                render_active_cells_free(kept);
                continue;
            }
            lattice(&f, kind, 4, layout < 0 ? narrow : wide[layout], test_wave);
            fixture_add_surface(&f, three_values, 3, 1);
            f.surfaces[0].root = RENDER_ROBUST;
            look_around(&f, kept, test_mesh_kind_name(kind));
            assert_int_equal(render_active_cells_bytes(kept), 0);
            fixture_free(&f);
            render_active_cells_free(kept);
        }
}

/* A record has numbers, and no indices. */
static void cells_of_wide_indices_are_kept(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        render_fixture f;
        render_active_cells *kept = render_active_cells_create();
        lattice(&f, plain_kinds[i], 4, (test_layout){.wide_indices = true}, test_wave);
        fixture_add_surface(&f, three_values, 3, 1);
        f.surfaces[0].root = RENDER_ROBUST;
        look_around(&f, kept, test_mesh_kind_name(plain_kinds[i]));
        assert_true(render_active_cells_bytes(kept) > 0);
        fixture_free(&f);
        render_active_cells_free(kept);
    }
}

/* Layers that need more of a cell than is kept. Tets are kept for any root finder, as they have one root. */
static void layers_that_want_more_are_not_kept(void **state)
{
    enum { COLOURED, DIFFERENCES, TRANSPARENT, NEUBAUER, CASE_COUNT };
    (void)state;
    for (int i = 0; i < 2; i++)
        for (int c = 0; c < CASE_COUNT; c++) {
            render_fixture f;
            render_active_cells *kept = render_active_cells_create();
            lattice(&f, plain_kinds[i], 5, narrow, test_wave);
            fixture_set_volume(&f, 0.3);
            f.job.volume_count = 0;
            fixture_add_surface(&f, three_values, 3, c == TRANSPARENT ? 0.4f : 1);
            f.surfaces[0].root = c == NEUBAUER ? RENDER_NEUBAUER : RENDER_ROBUST;
            if (c == COLOURED) {
                f.surfaces[0].colour_field = f.surfaces[0].field;
                f.surfaces[0].colour_map = &f.transfer;
            }
            if (c == DIFFERENCES) {
                f.surfaces[0].normal = RENDER_DIFFERENCES;
                f.surfaces[0].difference = 1;
            }
            look_around(&f, kept, "a layer that wants more");
            const bool is_kept = c == NEUBAUER && plain_kinds[i] == TEST_TETS;
            assert_int_equal(render_active_cells_bytes(kept),
                             is_kept ? expected_bytes(&f.views[0], three_values, 3) : 0);
            fixture_free(&f);
            render_active_cells_free(kept);
        }
}

/* ---- layers, volumes and parts -------------------------------------------------------------------------------- */

/* A second field on the fixture's mesh. */
typedef struct other_field {
    test_view view;
    grid_field field;
    mmbvh_ranges ranges;
    float *pairs;
} other_field;

static void other_field_create(const render_fixture *f, test_mesh_kind kind, int n, test_function *function,
                               other_field *out)
{
    test_mesh mesh;
    int64_t unusable;
    test_mesh_lattice(kind, n, 0.2, function, &mesh);
    test_view_create(&mesh, narrow, &out->view);
    out->field = out->view.field;
    out->pairs = malloc((size_t)f->trees[0].node_count * 2 * sizeof *out->pairs);
    mmbvh_compute_ranges(&f->trees[0], &f->views[0].cells, &out->field, &(mmbvh_options){.threads = 1}, out->pairs,
                         &unusable);
    out->ranges = mmbvh_pair_ranges(out->pairs);
    test_mesh_free(&mesh);
}

static void other_field_free(other_field *other)
{
    free(other->pairs);
    test_view_free(&other->view);
}

/* Two opaque layers of two fields, the second one transparent or coloured in its turn, with a volume and without. */
static void layers_of_two_fields_draw_the_same(void **state)
{
    enum { BOTH_OPAQUE, ONE_TRANSPARENT, ONE_COLOURED, BOTH_OPAQUE_VOLUME, ONE_TRANSPARENT_VOLUME, CASE_COUNT };
    (void)state;
    for (int i = 0; i < 2; i++)
        for (int c = 0; c < CASE_COUNT; c++)
            for (int first = 0; first < 2; first++) { /* which of them comes first in the job */
                render_fixture f;
                other_field other;
                render_active_cells *kept = render_active_cells_create();
                lattice(&f, plain_kinds[i], 4, narrow, test_wave);
                other_field_create(&f, plain_kinds[i], 4, test_linear, &other);
                fixture_set_volume(&f, 0.3);
                if (c < BOTH_OPAQUE_VOLUME) f.job.volume_count = 0;
                const bool is_transparent = c == ONE_TRANSPARENT || c == ONE_TRANSPARENT_VOLUME;
                fixture_add_surface(&f, three_values, 3, first && is_transparent ? 0.4f : 1);
                fixture_add_surface(&f, one_value, 1, !first && is_transparent ? 0.4f : 1);
                f.surfaces[1].field = (render_field){&other.field, &other.ranges};
                f.surfaces[0].root = f.surfaces[1].root = RENDER_ROBUST;
                if (c == ONE_COLOURED) {
                    f.surfaces[!first].colour_field = f.surfaces[0].field;
                    f.surfaces[!first].colour_map = &f.transfer;
                }
                look_around(&f, kept, "layers of two fields");
                int64_t expected = 0;
                const bool is_alone = is_transparent || c == ONE_COLOURED;
                if (!is_alone || !first) expected += expected_bytes(&f.views[0], three_values, 3);
                if (!is_alone || first) {
                    const test_view view = {f.views[0].cells, other.field, {0}};
                    expected += expected_bytes(&view, one_value, 1);
                }
                assert_int_equal(render_active_cells_bytes(kept), expected);
                other_field_free(&other);
                fixture_free(&f);
                render_active_cells_free(kept);
            }
}

/* The same isovalues of two fields, and two sets of isovalues of one field, are not confused when layers come and go;
 * kept cells serve all frames that have their layer. */
static void layers_are_told_apart(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        render_fixture f;
        other_field other;
        render_active_cells *kept = render_active_cells_create();
        int64_t expected = 0;
        lattice(&f, plain_kinds[i], 4, narrow, test_wave);
        other_field_create(&f, plain_kinds[i], 4, test_linear, &other);
        fixture_add_surface(&f, one_value, 1, 1);
        const test_view view = {f.views[0].cells, other.field, {0}};
        for (int turn = 0; turn < 8; turn++) {
            const bool is_other = turn & 1;
            const double *values = turn & 2 ? three_values : one_value;
            const int count = turn & 2 ? 3 : 1;
            f.surfaces[0].field =
                is_other ? (render_field){&other.field, &other.ranges} : (render_field){f.fields, f.ranges};
            f.surfaces[0].values = values;
            f.surfaces[0].value_count = count;
            f.surfaces[0].root = RENDER_ROBUST;
            assert_true(compare(&f, kept, "one layer after the other") > 0);
            if (turn < 4) expected += expected_bytes(is_other ? &view : &f.views[0], values, count);
            assert_int_equal(render_active_cells_bytes(kept), expected);
        }
        other_field_free(&other);
        fixture_free(&f);
        render_active_cells_free(kept);
    }
}

static void volumes_behind_draw_the_same(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++)
        for (int segments = 0; segments < 2; segments++) {
            render_fixture f;
            render_active_cells *kept = render_active_cells_create();
            lattice(&f, plain_kinds[i], 5, narrow, test_wave);
            fixture_add_surface(&f, one_value, 1, 1);
            f.surfaces[0].root = RENDER_ROBUST;
            fixture_set_volume(&f, 0.3);
            f.job.integration = segments ? RENDER_SEGMENTS : RENDER_SAMPLES;
            look_around(&f, kept, segments ? "a volume by segments" : "a volume by samples");
            assert_int_equal(render_active_cells_bytes(kept), expected_bytes(&f.views[0], one_value, 1));
            fixture_free(&f);
            render_active_cells_free(kept);
        }
}

/* Tets dealt to parts, one of which has no cells, beside hexes and a mesh that is not kept. */
static void parts_draw_the_same(void **state)
{
    enum { DEALT = 3, PARTS = 6 };
    static const double beside[2][3] = {{0.9, 0.8, -0.7}, {-0.8, 0.9, 0.6}};
    test_mesh whole, meshes[PARTS];
    render_fixture f;
    render_active_cells *kept = render_active_cells_create();
    int64_t expected = 0;
    (void)state;
    test_mesh_lattice(TEST_TETS, 5, 0.2, test_wave, &whole);
    int *owners = malloc((size_t)whole.cell_count * sizeof *owners);
    test_partition(&whole, TEST_RANDOM, 5, DEALT, owners);
    for (int part = 0; part <= DEALT; part++) test_mesh_part(&whole, owners, part, &meshes[part]);
    assert_int_equal(meshes[DEALT].cell_count, 0);
    test_mesh_lattice(TEST_HEXES, 4, 0.2, test_wave, &meshes[4]);
    test_mesh_lattice(TEST_MIXED, 4, 0.2, test_wave, &meshes[5]);
    for (int i = 0; i < 2; i++) test_mesh_transform(&meshes[4 + i], 0.3, beside[i]);
    fixture_create(&f, meshes, PARTS, narrow, 2.0 / 5, 1, origin);
    fixture_add_surface(&f, three_values, 3, 1);
    f.surfaces[0].root = RENDER_ROBUST;
    look_around(&f, kept, "parts");
    for (int part = 0; part < 5; part++) expected += expected_bytes(&f.views[part], three_values, 3);
    assert_int_equal(render_active_cells_bytes(kept), expected);
    fixture_free(&f);
    for (int part = 0; part < PARTS; part++) test_mesh_free(&meshes[part]);
    test_mesh_free(&whole);
    free(owners);
    render_active_cells_free(kept);
}

/* ---- numbers -------------------------------------------------------------------------------------------------- */

/* One thread draws: surfaces in cells with values far larger or smaller than the others' cover each other within
 * rounding, so their pictures depend on the order in which threads find them, with and without kept cells. */
static void odd_values_draw_the_same(void **state)
{
    (void)state;
    static const double odd[] = {
        (double)NAN, (double)INFINITY, -(double)INFINITY, 1e30, -1e30, 3e38, 4e29, 1e-30, -1e-30, 1e-45, 0.3};
    for (int i = 0; i < 2; i++)
        for (size_t o = 0; o < sizeof odd / sizeof odd[0]; o++) {
            test_mesh mesh;
            render_fixture f;
            render_active_cells *kept = render_active_cells_create();
            char what[80];
            snprintf(what, sizeof what, "%s with a value of %g", test_mesh_kind_name(plain_kinds[i]), odd[o]);
            test_mesh_lattice(plain_kinds[i], 5, 0.2, test_wave, &mesh);
            for (int64_t v = 7; v < mesh.vertex_count; v += 31) mesh.values[v] = odd[o];
            fixture_create(&f, &mesh, 1, narrow, 2.0 / 5, 1, origin);
            fixture_add_surface(&f, three_values, 3, 1);
            f.surfaces[0].root = RENDER_ROBUST;
            look_around_by(&f, kept, 1, what);
            fixture_free(&f);
            test_mesh_free(&mesh);
            render_active_cells_free(kept);
        }
}

/* Fields as large and small as floats are, and isovalues at, above and below them. */
static void scaled_values_draw_the_same(void **state)
{
    (void)state;
    static const double scales[] = {1e-42, 1e-37, 1e-31, 1e-30, 1e-20, 1e20, 2e29, 1e30, 1e37};
    for (int i = 0; i < 2; i++)
        for (size_t s = 0; s < sizeof scales / sizeof scales[0]; s++) {
            double values[3];
            test_mesh mesh;
            render_fixture f;
            render_active_cells *kept = render_active_cells_create();
            char what[80];
            snprintf(what, sizeof what, "%s with values of %g", test_mesh_kind_name(plain_kinds[i]), scales[s]);
            test_mesh_lattice(plain_kinds[i], 5, 0.2, test_wave, &mesh);
            for (int64_t v = 0; v < mesh.vertex_count; v++) mesh.values[v] *= scales[s];
            for (int k = 0; k < 3; k++) values[k] = three_values[k] * scales[s];
            fixture_create(&f, &mesh, 1, narrow, 2.0 / 5, 1, origin);
            fixture_add_surface(&f, values, 3, 1);
            f.surfaces[0].root = RENDER_ROBUST;
            look_around(&f, kept, what);
            fixture_free(&f);
            test_mesh_free(&mesh);
            render_active_cells_free(kept);
        }
}

/* Isovalues beyond all values and beyond float32; one at a level stretch of the field. */
static double level_field(const double p[3])
{
    return p[0] < 0 ? 0.3 : p[1];
}

static void odd_isovalues_draw_the_same(void **state)
{
    (void)state;
    static const double odd[][2] = {{0.3, 1e300},      {0.3, 5e29}, {-1e300, 0.3},
                                    {0.3, 0.3 + 1e-3}, {0.3, 0.0},  {-0.0, 0.3}};
    for (int i = 0; i < 2; i++)
        for (size_t o = 0; o < sizeof odd / sizeof odd[0]; o++) {
            render_fixture f;
            render_active_cells *kept = render_active_cells_create();
            lattice(&f, plain_kinds[i], 5, narrow, level_field);
            fixture_add_surface(&f, odd[o], 2, 1);
            f.surfaces[0].root = RENDER_ROBUST;
            look_around(&f, kept, "odd isovalues");
            fixture_free(&f);
            render_active_cells_free(kept);
        }
}

/* Some vertices are too far out for cells to be kept. */
static void vertices_far_out_are_not_kept(void **state)
{
    (void)state;
    static const double far[] = {1e16, 1e25, 3e38};
    for (int i = 0; i < 2; i++)
        for (size_t o = 0; o < sizeof far / sizeof far[0]; o++) {
            test_mesh mesh;
            render_fixture f;
            render_active_cells *kept = render_active_cells_create();
            char what[80];
            snprintf(what, sizeof what, "%s with vertices at %g", test_mesh_kind_name(plain_kinds[i]), far[o]);
            test_mesh_lattice(plain_kinds[i], 5, 0.2, test_wave, &mesh);
            for (int64_t v = 7; v < mesh.vertex_count; v += 61) mesh.coordinates[3 * v + (v & 1)] += far[o];
            fixture_create(&f, &mesh, 1, narrow, 2.0 / 5, 1, origin);
            fixture_add_surface(&f, three_values, 3, 1);
            f.surfaces[0].root = RENDER_ROBUST;
            look_around_by(&f, kept, 1, what);
            assert_int_equal(render_active_cells_bytes(kept), 0);
            fixture_free(&f);
            test_mesh_free(&mesh);
            render_active_cells_free(kept);
        }
}

/* The eye, of the picture after the first, is near or far away: of the scene's size, and of numbers. */
static void sizes_and_distant_eyes_draw_the_same(void **state)
{
    (void)state;
    static const double sizes[] = {1e-28, 1e-22, 1e-15, 1e-5, 1, 1e5, 1e13, 1e14, 3e14, 1e16, 1e22, 1e28};
    static const double away[] = {1, 4, 30, 1e3, 1e6, 1e15, 2};
    for (int i = 0; i < 2; i++)
        for (size_t s = 0; s < sizeof sizes / sizeof sizes[0]; s++) {
            test_mesh mesh;
            render_fixture f;
            render_active_cells *kept = render_active_cells_create();
            test_mesh_lattice(plain_kinds[i], 5, 0.2, test_wave, &mesh);
            test_mesh_transform(&mesh, sizes[s], origin);
            fixture_create(&f, &mesh, 1, narrow, 2.0 / 5 * sizes[s], sizes[s], origin);
            fixture_add_surface(&f, three_values, 3, 1);
            f.surfaces[0].root = RENDER_ROBUST;
            for (size_t a = 0; a < sizeof away / sizeof away[0]; a++) {
                char what[80];
                double depth = 0;
                snprintf(what, sizeof what, "%s of size %g, seen from %g of it", test_mesh_kind_name(plain_kinds[i]),
                         sizes[s], away[a]);
                fixture_look(&f, CAMERA_OUTSIDE, WIDTH, HEIGHT);
                for (int axis = 0; axis < 3; axis++) {
                    f.job.camera.eye[axis] *= away[a];
                    depth -= f.job.camera.forward[axis] * f.job.camera.eye[axis];
                }
                f.job.camera.half_height /= away[a];
                f.job.space.depth_origin = depth;
                const int64_t fragments = compare(&f, kept, what);
                assert_true(fragments > 0 || away[a] >= 1e6);
            }
            fixture_free(&f);
            test_mesh_free(&mesh);
            render_active_cells_free(kept);
        }
}

/* ---- changes and memory --------------------------------------------------------------------------------------- */

static void cleared_after_a_change_draws_the_same(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        render_fixture f;
        render_active_cells *kept = render_active_cells_create();
        lattice(&f, plain_kinds[i], 5, narrow, test_wave);
        fixture_add_surface(&f, three_values, 3, 1);
        f.surfaces[0].root = RENDER_ROBUST;
        look_around(&f, kept, "before a change");
        float *values = f.views[0].storage[1];
        for (int64_t v = 0; v < f.views[0].cells.vertex_count; v++) values[v] = 0.2f - values[v] * values[v];
        assert_int_equal(
            mmbvh_refit_ranges(&f.trees[0], &f.views[0].cells, &f.fields[0], &(mmbvh_options){.threads = 1}),
            INSITU_OK);
        render_active_cells_clear(kept);
        assert_int_equal(render_active_cells_bytes(kept), 0);
        look_around(&f, kept, "after a change");
        assert_int_equal(render_active_cells_bytes(kept), expected_bytes(&f.views[0], three_values, 3));
        fixture_free(&f);
        render_active_cells_free(kept);
    }
}

static double rough(const double p[3])
{
    uint64_t bits = 0;
    for (int a = 0; a < 3; a++) bits = 1009 * bits + (uint64_t)lround((p[a] + 1) * 500);
    return test_uniform_in(bits, 3, -1, 1);
}

/* Sixteen layers, each of which crosses a third of the cells or more: most are kept, and those that come then are not.
 */
static void more_than_the_bound_draws_the_same(void **state)
{
    enum { LAYERS = 16, SIDE = 26 };
    (void)state;
    for (int threads = 1; threads <= 3; threads += 2) {
        double values[LAYERS];
        render_surface_layer layers[LAYERS];
        render_fixture f;
        render_active_cells *kept = render_active_cells_create();
        int64_t all = 0, largest = 0;
        lattice(&f, TEST_TETS, SIDE, narrow, rough);
        fixture_add_surface(&f, one_value, 1, 1);
        for (int i = 0; i < LAYERS; i++) {
            values[i] = -0.16 + 0.02 * i;
            layers[i] = f.surfaces[0];
            layers[i].values = &values[i];
            const int64_t bytes = expected_bytes(&f.views[0], &values[i], 1);
            all += bytes;
            largest = bytes > largest ? bytes : largest;
        }
        assert_true(all > MOST_BYTES + largest);
        f.job.surfaces = layers;
        f.job.surface_count = LAYERS;
        f.job.threads = threads;
        for (int turn = 0; turn < 3; turn++) {
            /* One picture has cells so small that nothing is kept, one has few cells, and one is large. */
            const bool is_large = turn == 2;
            fixture_look(&f, turn == 1 ? CAMERA_INSIDE : CAMERA_OUTSIDE, is_large ? 1000 : 48, is_large ? 800 : 40);
            if (turn == 1) f.job.camera.half_height = 0.01;
            if (is_large) f.job.camera.half_height *= 0.7; /* the mesh fills it, so that its cells are large */
            assert_true(compare(&f, kept, "sixteen layers") > 0);
            /* Less what room the threads leave at the end, 256 KiB each at most. */
            assert_true(render_active_cells_bytes(kept) <= MOST_BYTES);
            assert_true(!is_large || render_active_cells_bytes(kept) > MOST_BYTES - largest - threads * (1 << 18));
        }
        fixture_free(&f);
        render_active_cells_free(kept);
    }
}

/* If the n-th allocation fails, the frame is the same or has failed; so has the next one, and nothing is lost. */
static bool draws_without_the_nth(render_fixture *f, const fragment_list *expected, int64_t n)
{
    const int64_t held = base_memory_held();
    fragment_list list;
    render_active_cells *kept = render_active_cells_create();
    const int64_t before = base_memory_allocations();
    base_memory_fail_nth(n);
    const insitu_status status = draw(f, kept, &list);
    base_memory_fail_nth(0);
    const bool was_reached = base_memory_allocations() - before >= n;
    assert_true(status == INSITU_OK || status == INSITU_ERROR_MEMORY);
    assert_true(was_reached || status == INSITU_OK);
    if (!status) assert_same(expected, &list, "an allocation failed");
    base_free(list.items);
    assert_int_equal(draw(f, kept, &list), INSITU_OK);
    assert_same(expected, &list, "an allocation failed before");
    base_free(list.items);
    render_active_cells_free(kept);
    assert_int_equal(base_memory_held(), held);
    return was_reached;
}

static void failing_allocations_are_survived(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++)
        for (int threads = 1; threads <= 2; threads++) {
            render_fixture f;
            other_field other;
            fragment_list expected;
            int64_t n = 1;
            lattice(&f, plain_kinds[i], 4, narrow, test_wave);
            other_field_create(&f, plain_kinds[i], 4, test_linear, &other);
            fixture_add_surface(&f, three_values, 3, 1);
            fixture_add_surface(&f, one_value, 1, 1);
            f.surfaces[1].field = (render_field){&other.field, &other.ranges};
            f.surfaces[0].root = f.surfaces[1].root = RENDER_ROBUST;
            fixture_look(&f, CAMERA_OUTSIDE, WIDTH, HEIGHT);
            f.job.threads = threads;
            assert_int_equal(draw(&f, NULL, &expected), INSITU_OK);
            while (draws_without_the_nth(&f, &expected, n)) n++;
            assert_true(n > 10);
            base_free(expected.items);
            other_field_free(&other);
            fixture_free(&f);
        }
    base_memory_fail_nth(1);
    assert_null(render_active_cells_create());
    base_memory_fail_nth(0);
    render_active_cells_free(NULL);
}

/* An argument: the tests to run, as cmocka matches names. */
int main(int argc, char **argv)
{
    if (fixture_lacks_set()) return 77;
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(plain_meshes_are_kept_and_draw_the_same),
        cmocka_unit_test(tiny_hexes_draw_the_same),
        cmocka_unit_test(collapsed_hexes_draw_the_same),
        cmocka_unit_test(ghosts_are_not_kept),
        cmocka_unit_test(small_pictures_of_many_cells_draw_the_same),
        cmocka_unit_test(subsets_of_pixels_and_other_traversals_draw_the_same),
        cmocka_unit_test(other_meshes_and_layouts_are_not_kept),
        cmocka_unit_test(cells_of_wide_indices_are_kept),
        cmocka_unit_test(layers_that_want_more_are_not_kept),
        cmocka_unit_test(layers_of_two_fields_draw_the_same),
        cmocka_unit_test(layers_are_told_apart),
        cmocka_unit_test(volumes_behind_draw_the_same),
        cmocka_unit_test(parts_draw_the_same),
        cmocka_unit_test(odd_values_draw_the_same),
        cmocka_unit_test(scaled_values_draw_the_same),
        cmocka_unit_test(odd_isovalues_draw_the_same),
        cmocka_unit_test(vertices_far_out_are_not_kept),
        cmocka_unit_test(sizes_and_distant_eyes_draw_the_same),
        cmocka_unit_test(cleared_after_a_change_draws_the_same),
        cmocka_unit_test(more_than_the_bound_draws_the_same),
        cmocka_unit_test(failing_allocations_are_survived),
    };
    if (argc > 1) cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
