/* Checks what must not change pictures: the number of threads, the size of groups of samples, the order and numbering
 * of cells and vertices, memory layouts, the distribution of cells to parts and ranks, and ghosts. Values that are not
 * finite may only change their own cells. */
#include "memory.h"
#include "pixel_set.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static const double values[2] = {-0.2, 0.3};
static const double origin[3] = {0, 0, 0};
static const test_layout wide = {.wide_coordinates = true, .wide_values = true};

/* The scenes: an opaque surface, transparent surfaces, a volume, and combinations. */
typedef enum scene_kind { OPAQUE, TRANSPARENT, VOLUME, OPAQUE_VOLUME, TRANSPARENT_VOLUME, SCENE_COUNT } scene_kind;

static void add_layers(render_fixture *f, scene_kind scene)
{
    if (scene != VOLUME) fixture_add_surface(f, values, 2, scene == OPAQUE || scene == OPAQUE_VOLUME ? 1 : 0.4f);
    if (scene >= VOLUME) fixture_set_volume(f, 0.3);
}

static void create_mesh_fixture(render_fixture *f, const test_mesh *meshes, int count, int n, scene_kind scene,
                                fixture_camera camera)
{
    fixture_create(f, meshes, count, wide, 2.0 / n, 1, origin);
    fixture_set_camera(f, camera, 61, 47);
    add_layers(f, scene);
}

static void create_lattice_fixture(render_fixture *f, test_mesh_kind kind, scene_kind scene, fixture_camera camera)
{
    fixture_create_lattice(f, kind, 4, 0.2, test_wave_field);
    fixture_set_camera(f, camera, 61, 47);
    add_layers(f, scene);
}

static void any_thread_count_gives_same_bits(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        render_fixture f;
        drawn_frame one, more;
        create_lattice_fixture(&f, kind, TRANSPARENT_VOLUME, CAMERA_OUTSIDE);
        fixture_draw(&f, &one);
        for (f.job.threads = 2; f.job.threads <= 3; f.job.threads++) {
            fixture_draw(&f, &more);
            drawn_frame_assert_same(&one, &more);
            drawn_frame_free(&more);
        }
        drawn_frame_free(&one);
        fixture_free(&f);
    }
}

/* ---- tiles passed one by one ----------------------------------------------------------------------------------- */

typedef struct received_tiles {
    fragment_list list;
    unsigned char pixels[64 * 64]; /* for each pixel the number of tiles that contained it */
    /* refuse_after: number of tiles after which further tiles are refused; negative: none is refused */
    int width, refuse_after;
    bool has_stray_pixel;
} received_tiles;

static bool store_tile(void *state, int thread, const pixel_area *area, fragment *items, int64_t count)
{
    received_tiles *t = state;
    bool is_well;
    (void)thread;
#pragma omp critical
    {
        is_well = t->refuse_after-- != 0;
        for (int y = area->y; y < area->y + area->height; y++)
            for (int x = area->x; x < area->x + area->width; x++) t->pixels[y * t->width + x]++;
        for (int64_t i = 0; i < count; i++) {
            const int x = (int)items[i].pixel % t->width - area->x, y = (int)items[i].pixel / t->width - area->y;
            t->has_stray_pixel = t->has_stray_pixel || x < 0 || y < 0 || x >= area->width || y >= area->height;
            t->list.items[t->list.count++] = items[i];
        }
    }
    return is_well;
}

static int compare_bytes(const void *a, const void *b)
{
    return memcmp(a, b, sizeof(fragment));
}

static void compare_tiles_with_list(render_fixture *f)
{
    const render_camera *camera = &f->job.camera;
    const int64_t pixels = (int64_t)camera->width * camera->height;
    received_tiles t = {.width = camera->width, .refuse_after = -1};
    fragment_list list = {0};
    base_error error = {0};
    assert_int_equal(render_frame(&f->job, &list, NULL, &error), INSITU_OK);
    t.list.items = malloc((size_t)list.count * sizeof *t.list.items + 1);
    assert_int_equal(render_frame_tiles(&f->job, store_tile, &t, NULL, &error), INSITU_OK);
    assert_false(t.has_stray_pixel);
    for (int64_t p = 0; p < pixels; p++) assert_int_equal(t.pixels[p], 1);
    assert_int_equal(t.list.count, list.count);
    qsort(list.items, (size_t)list.count, sizeof *list.items, compare_bytes);
    qsort(t.list.items, (size_t)list.count, sizeof *list.items, compare_bytes);
    assert_memory_equal(t.list.items, list.items, (size_t)list.count * sizeof *list.items);
    free(t.list.items);
    base_free(list.items);
}

/* Checks that every pixel is in exactly one tile, and that the tile contains the same fragments of the pixel as the
 * list. */
static void tiles_have_the_fragments_of_the_list(void **state)
{
    (void)state;
    unsigned char pixels[(61 * 47 + 7) / 8] = {0};
    for (int64_t p = 0; p < 61 * 47; p++)
        if (p * p % 7 < 3) pixel_set_add(pixels, p);
    for (scene_kind scene = 0; scene < SCENE_COUNT; scene++)
        for (int trial = 0; trial < 4; trial++) {
            render_fixture f;
            create_lattice_fixture(&f, trial % 2 ? TEST_POLYHEDRA : TEST_HEXES, scene, CAMERA_OUTSIDE);
            f.job.threads = 1 + trial;
            f.job.pixels = trial < 2 ? NULL : pixels;
            f.job.separate_samples = trial == 3;
            compare_tiles_with_list(&f);
            fixture_free(&f);
        }
}

static void refused_tiles_end_the_frame(void **state)
{
    (void)state;
    const int64_t held = base_memory_held();
    render_fixture f;
    create_lattice_fixture(&f, TEST_TETS, TRANSPARENT, CAMERA_OUTSIDE);
    for (int after = 0; after < 12; after += 5) {
        received_tiles t = {.width = f.job.camera.width, .refuse_after = after};
        base_error error = {0};
        t.list.items = malloc(sizeof(fragment) * 61 * 47 * 64);
        assert_int_equal(render_frame_tiles(&f.job, store_tile, &t, NULL, &error), INSITU_ERROR_MEMORY);
        free(t.list.items);
    }
    fixture_free(&f);
    assert_int_equal(base_memory_held(), held);
}

/* Draws with cells that are found for the whole picture, and with cells that are found for each tile. Both must find
 * the same cells, or at least the same among the cells with a hit or samples. */
static void draw_by_traversals(render_fixture *f)
{
    drawn_frame drawn[2];
    for (int i = 0; i < 2; i++) {
        f->job.traversal = (render_traversal)i;
        fixture_draw(f, &drawn[i]);
        drawn_frame_assert_same(&drawn[0], &drawn[i]);
        assert_int_equal(drawn[0].list.count, drawn[i].list.count);
    }
    for (int i = 0; i < 2; i++) drawn_frame_free(&drawn[i]);
}

/* Compares the traversals for cells that cover ten pixels and three pixels. Some pixels are excluded. */
static void compare_traversals(test_mesh_kind kind, int n, scene_kind scene, fixture_camera camera, bool all)
{
    enum { WIDTH = 61, HEIGHT = 47 };
    render_fixture f;
    unsigned char pixels[(WIDTH * HEIGHT + 7) / 8] = {0};
    for (int64_t p = 0; p < WIDTH * HEIGHT; p++)
        if (p * p % 7 < 3) pixel_set_add(pixels, p);
    fixture_create_lattice(&f, kind, n, 0.2, test_wave_field);
    fixture_set_camera(&f, camera, WIDTH, HEIGHT);
    add_layers(&f, scene);
    if (scene == TRANSPARENT && kind == TEST_HEXES) {
        f.surfaces[0].normal = RENDER_DIFFERENCES;
        f.surfaces[0].difference = 1;
    }
    f.job.pixels = all ? NULL : pixels;
    draw_by_traversals(&f);
    fixture_free(&f);
}

static void all_traversals_give_the_same_bits(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
            compare_traversals(kind, 4, OPAQUE, camera, true);
            compare_traversals(kind, 13, OPAQUE, camera, camera % 2);
            compare_traversals(kind, 4, TRANSPARENT, camera, true);
            compare_traversals(kind, 4, OPAQUE_VOLUME, camera, false);
            compare_traversals(kind, 4, TRANSPARENT_VOLUME, camera, true);
        }
}

/* Checks sizes of groups of samples. They only decide how many samples are gathered before they are blended, so
 * pictures may differ only by the rounding of blending. */
static void sample_groups_draw_the_same(void **state)
{
    (void)state;
    static const int groups[4] = {1, 4, 16, 64};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (scene_kind scene = VOLUME; scene < SCENE_COUNT; scene++) {
            render_fixture f;
            drawn_frame one, more;
            create_lattice_fixture(&f, kind, scene, CAMERA_OUTSIDE);
            f.job.sample_group = 1;
            fixture_draw(&f, &one);
            for (int i = 1; i < 4; i++) {
                f.job.sample_group = groups[i];
                fixture_draw(&f, &more);
                drawn_frame_assert_same_depths(&one, &more);
                assert_true(drawn_frame_find_largest_difference(&one, &more) <= 1e-6);
                drawn_frame_free(&more);
            }
            drawn_frame_free(&one);
            fixture_free(&f);
        }
}

static void any_cell_order_gives_the_same_bits(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (scene_kind scene = 0; scene < SCENE_COUNT; scene++) {
            test_mesh mesh;
            render_fixture f;
            drawn_frame first, other;
            test_mesh_make_lattice(kind, 4, 0.2, test_wave_field, &mesh);
            create_mesh_fixture(&f, &mesh, 1, 4, scene, CAMERA_OUTSIDE);
            fixture_draw(&f, &first);
            fixture_free(&f);
            test_mesh_shuffle_cells(&mesh, 77);
            create_mesh_fixture(&f, &mesh, 1, 4, scene, CAMERA_OUTSIDE);
            fixture_draw(&f, &other);
            drawn_frame_assert_same(&first, &other);
            drawn_frame_free(&first);
            drawn_frame_free(&other);
            fixture_free(&f);
            test_mesh_free(&mesh);
        }
}

/* Returns the largest difference of depth in units of t. Returns infinity if only one of the pictures has a hit in some
 * pixel. */
static double find_largest_depth_difference(const drawn_frame *a, const drawn_frame *b)
{
    double worst = 0;
    for (int64_t p = 0; p < (int64_t)a->picture.width * a->picture.height; p++) {
        const double x = (double)a->picture.depth[p], y = (double)b->picture.depth[p];
        if (isinf(x) && isinf(y)) continue;
        worst = test_larger_error(worst, fabs(x - y));
    }
    return worst;
}

/* Checks cells whose vertices are reordered by a symmetry of the cell. The faces are the same, so exactly the same rays
 * hit them. The map inside has other coordinates and rounds differently: t has an error of about 1e-7 times the
 * conditioning. The conditioning is up to 30 among 61 × 47 rays. */
static void reordered_cells_draw_the_same(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (scene_kind scene = 0; scene < SCENE_COUNT; scene++) {
            test_mesh mesh;
            render_fixture f;
            drawn_frame first, other;
            test_mesh_make_lattice(kind, 4, 0.2, test_wave_field, &mesh);
            create_mesh_fixture(&f, &mesh, 1, 4, scene, CAMERA_OUTSIDE);
            fixture_draw(&f, &first);
            fixture_free(&f);
            test_mesh_reorder_vertices(&mesh, 78);
            create_mesh_fixture(&f, &mesh, 1, 4, scene, CAMERA_OUTSIDE);
            fixture_draw(&f, &other);
            if (getenv("INSITU_TEST_VERBOSE"))
                fprintf(stderr, "turned %s, scene %d: depth %.2g, colour %.2g\n", test_mesh_kind_name(kind), (int)scene,
                        find_largest_depth_difference(&first, &other),
                        drawn_frame_find_largest_difference(&first, &other));
            if (kind == TEST_TETS) drawn_frame_assert_same(&first, &other);
            assert_true(find_largest_depth_difference(&first, &other) < 5e-6);
            assert_true(drawn_frame_find_largest_difference(&first, &other) < 2e-5);
            drawn_frame_free(&first);
            drawn_frame_free(&other);
            fixture_free(&f);
            test_mesh_free(&mesh);
        }
}

static void all_layouts_give_the_same_bits(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh;
        drawn_frame first;
        test_mesh_make_lattice(kind, 3, 0.2, test_wave_field, &mesh);
        test_mesh_round_to_float(&mesh);
        for (unsigned bits = 0; bits < 32; bits++) {
            const test_layout layout = {bits & 1, bits & 2, bits & 4, bits & 8, bits & 16};
            render_fixture f;
            drawn_frame other;
            fixture_create(&f, &mesh, 1, layout, 2.0 / 3, 1, origin);
            fixture_set_camera(&f, CAMERA_OUTSIDE, 29, 23);
            add_layers(&f, TRANSPARENT_VOLUME);
            fixture_draw(&f, bits ? &other : &first);
            if (bits) {
                drawn_frame_assert_same(&first, &other);
                drawn_frame_free(&other);
            }
            fixture_free(&f);
        }
        drawn_frame_free(&first);
        test_mesh_free(&mesh);
    }
}

/* ---- parts and ranks ---- */

/* Distributes the cells of the mesh to parts. If `ghosts` is set, every part has all cells, and the cells of other
 * parts are ghosts. */
static void distribute_cells(const test_mesh *mesh, test_partition_kind partition, int n, int parts, bool ghosts,
                             test_mesh *out)
{
    int *owners = malloc((size_t)mesh->cell_count * sizeof *owners);
    test_partition_cells(mesh, partition, n, parts, owners);
    for (int part = 0; part < parts; part++) {
        if (!ghosts) {
            test_mesh_extract_part(mesh, owners, part, &out[part]);
            continue;
        }
        int *all = calloc((size_t)mesh->cell_count, sizeof *all);
        test_mesh_extract_part(mesh, all, 0, &out[part]);
        for (int64_t i = 0; i < mesh->cell_count; i++) out[part].ghosts[i] = owners[i] != part;
        free(all);
    }
    free(owners);
}

/* Compares pictures up to rounding. Volumes are blended in different groups: the colour of each fragment is rounded by
 * 6e-8, and a pixel has about 30 fragments. */
static void assert_same_to_rounding(const drawn_frame *whole, const drawn_frame *parts, scene_kind scene)
{
    drawn_frame_assert_same_depths(whole, parts);
    const double off = drawn_frame_find_largest_difference(whole, parts);
    if (off > 1e-6) fail_msg("colour off by %g", off);
    if (scene == OPAQUE || scene == TRANSPARENT) drawn_frame_assert_same(whole, parts);
}

static void compare_distributed(test_mesh_kind kind, scene_kind scene, test_partition_kind partition, int parts,
                                bool ghosts)
{
    const fixture_camera camera = (int)scene % 2 ? CAMERA_INSIDE : CAMERA_OUTSIDE;
    test_mesh mesh, distributed[5];
    render_fixture f, apart[5];
    drawn_frame whole, other;
    test_mesh_make_lattice(kind, 4, 0.2, test_wave_field, &mesh);
    create_mesh_fixture(&f, &mesh, 1, 4, scene, camera);
    fixture_draw(&f, &whole);
    fixture_free(&f);
    distribute_cells(&mesh, partition, 4, parts, ghosts, distributed);
    for (int i = 0; i < parts; i++) {
        create_mesh_fixture(&apart[i], &distributed[i], 1, 4, scene, camera);
        apart[i].job.is_alone = false;
    }
    fixture_draw_distributed(apart, parts, &other);
    assert_same_to_rounding(&whole, &other, scene);
    drawn_frame_free(&other);
    create_mesh_fixture(&f, distributed, parts, 4, scene, camera);
    fixture_draw(&f, &other);
    assert_same_to_rounding(&whole, &other, scene);
    drawn_frame_free(&other);
    drawn_frame_free(&whole);
    fixture_free(&f);
    for (int i = 0; i < parts; i++) {
        fixture_free(&apart[i]);
        test_mesh_free(&distributed[i]);
    }
    test_mesh_free(&mesh);
}

/* Draws two overlapping meshes in two ways: with windows of three samples, so that most cells are in several windows,
 * and with one window for all samples. Tets in 4-byte arrays are read by vector instructions. */
static void compare_volume_traversals(test_mesh_kind kind, scene_kind scene, fixture_camera camera, test_layout layout)
{
    render_fixture f;
    test_mesh mesh, parts[2];
    test_mesh_make_lattice(kind, 5, 0.2, test_wave_field, &mesh);
    distribute_cells(&mesh, TEST_CHECKERBOARD, 5, 2, false, parts);
    fixture_create(&f, parts, 2, layout, 0.4, 1, origin);
    fixture_set_camera(&f, camera, 61, 47);
    add_layers(&f, scene);
    for (f.job.sample_group = 3; f.job.sample_group <= 64; f.job.sample_group += 61) draw_by_traversals(&f);
    fixture_free(&f);
    for (int i = 0; i < 2; i++) test_mesh_free(&parts[i]);
    test_mesh_free(&mesh);
}

static void volume_traversals_give_the_same_bits(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
            compare_volume_traversals(kind, VOLUME, camera, wide);
            compare_volume_traversals(kind, OPAQUE_VOLUME, camera, (test_layout){0});
        }
}

static void parts_and_ranks_draw_the_whole_picture(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (scene_kind scene = 0; scene < SCENE_COUNT; scene++)
            for (test_partition_kind partition = 0; partition < TEST_PARTITION_COUNT; partition++)
                compare_distributed(kind, scene, partition, 2 + ((int)kind + (int)partition) % 4, false);
}

/* Checks samples that lie exactly on faces between ranks. The distance of the eye from the middle of a lattice of half
 * units is 3.125, and samples are at depths (k + 1/2) / 4; all these numbers are exact in float32. Eight samples must
 * count between x = 1 and x = -1: the one on the first face counts, the one on the last face does not. */
static void samples_on_faces_have_one_owner(void **state)
{
    (void)state;
    static const float constant[1] = {0.2f};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (test_partition_kind partition = 0; partition < TEST_PARTITION_COUNT; partition++) {
            test_mesh mesh, distributed[3];
            render_fixture apart[3];
            drawn_frame drawn;
            test_mesh_make_lattice(kind, 4, 0, test_wave_field, &mesh);
            distribute_cells(&mesh, partition, 4, 3, false, distributed);
            for (int i = 0; i < 3; i++) {
                create_mesh_fixture(&apart[i], &distributed[i], 1, 4, VOLUME, CAMERA_ALONG_X);
                apart[i].job.camera.eye[0] = 3.125;
                apart[i].job.space.depth_origin = 3;
                apart[i].job.is_alone = apart[i].job.jitter = false;
                apart[i].job.step = 0.25;
                apart[i].transfer.opacity_count = 1;
                apart[i].transfer.opacities = constant;
                apart[i].transfer.unit_distance = 0.25;
            }
            fixture_draw_distributed(apart, 3, &drawn);
            const double clear = pow(0.8, 8) * (1 - (double)fixture_background[3]);
            for (int p = 0; p < 61 * 47; p++) {
                double base[3], d[3];
                render_camera_ray(&apart[0].job.camera, p % 61, p / 61, base, d);
                if (fabs(base[1]) >= 1 || fabs(base[2]) >= 1) continue;
                assert_true(fabs(1 - (double)drawn.picture.rgba[4 * p + 3] - clear) < 1e-6);
            }
            drawn_frame_free(&drawn);
            for (int i = 0; i < 3; i++) {
                fixture_free(&apart[i]);
                test_mesh_free(&distributed[i]);
            }
            test_mesh_free(&mesh);
        }
}

static void ghosts_change_nothing(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (scene_kind scene = 0; scene < SCENE_COUNT; scene++) compare_distributed(kind, scene, TEST_RANDOM, 3, true);
}

static void parent_tree_changes_nothing(void **state)
{
    (void)state;
    for (scene_kind scene = 0; scene < SCENE_COUNT; scene++) {
        test_mesh mesh, distributed[5];
        render_fixture f;
        drawn_frame without, with;
        float lower[5][3], upper[5][3], ranges[5][2];
        mmbvh parent;
        base_error error = {0};
        test_mesh_make_lattice(TEST_MIXED, 4, 0.2, test_wave_field, &mesh);
        distribute_cells(&mesh, TEST_BLOCK, 4, 5, false, distributed);
        create_mesh_fixture(&f, distributed, 5, 4, scene, CAMERA_OUTSIDE);
        fixture_draw(&f, &without);
        for (int i = 0; i < 5; i++) {
            float low[4], high[4];
            const mmbvh_ranges own = mmbvh_own_ranges(&f.trees[i]);
            mmbvh_node_box(&f.trees[i], 0, low, high);
            memcpy(lower[i], low, sizeof lower[i]);
            memcpy(upper[i], high, sizeof upper[i]);
            memcpy(&ranges[i][0], own.low, sizeof ranges[i][0]);
            memcpy(&ranges[i][1], own.high, sizeof ranges[i][1]);
        }
        assert_int_equal(
            mmbvh_build_boxes(lower[0], upper[0], ranges[0], 5, &(mmbvh_options){.threads = 1}, &parent, &error),
            INSITU_OK);
        f.job.parent = &parent;
        fixture_draw(&f, &with);
        drawn_frame_assert_same(&without, &with);
        mmbvh_free(&parent);
        drawn_frame_free(&without);
        drawn_frame_free(&with);
        fixture_free(&f);
        for (int i = 0; i < 5; i++) test_mesh_free(&distributed[i]);
        test_mesh_free(&mesh);
    }
}

/* ---- values that are not finite ---- */

static bool contains_plane_vertex(const test_mesh *mesh, int64_t cell)
{
    for (int64_t i = mesh->offsets[cell]; i < mesh->offsets[cell + 1]; i++) {
        const int64_t entry = mesh->connectivity[i];
        if (mesh->types[cell] != GRID_POLYHEDRON) {
            if (!isfinite(mesh->values[entry])) return true;
            continue;
        }
        for (int64_t k = mesh->face_offsets[entry]; k < mesh->face_offsets[entry + 1]; k++)
            if (!isfinite(mesh->values[mesh->face_connectivity[k]])) return true;
    }
    return false;
}

/* Draws by samples (way 0), by exact segments (1), or by segments under max_error (2). */
static void draw_opaque_ends(const test_mesh *mesh, scene_kind scene, int way, drawn_frame *out)
{
    static const float opaque_ends[3] = {0.6f, 0.1f, 0.5f};
    render_fixture f;
    create_mesh_fixture(&f, mesh, 1, 4, scene, CAMERA_OUTSIDE);
    f.transfer.opacities = opaque_ends;
    f.job.integration = way ? RENDER_SEGMENTS : RENDER_SAMPLES;
    f.job.max_error = way == 2 ? 1e-3 : 0;
    /* The same extent for the mesh with and without these cells, so that the allowed error per length is equal. */
    f.job.extent = 3.5;
    fixture_draw(&f, out);
    fixture_free(&f);
}

/* Checks that pictures with cells that have a NaN or an infinite value are bit-identical to pictures without these
 * cells. */
static void cells_with_infinite_values_are_skipped(void **state)
{
    (void)state;
    static const double wrong[3] = {(double)NAN, (double)INFINITY, -(double)INFINITY};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh, without;
        test_mesh_make_lattice(kind, 4, 0.2, test_wave_field, &mesh);
        for (int i = 0; i < 3; i++) mesh.values[31 + 20 * i] = wrong[i];
        int *owners = malloc((size_t)mesh.cell_count * sizeof *owners);
        for (int64_t i = 0; i < mesh.cell_count; i++) owners[i] = contains_plane_vertex(&mesh, i);
        test_mesh_extract_part(&mesh, owners, 0, &without);
        assert_true(without.cell_count < mesh.cell_count);
        for (scene_kind scene = 0; scene < SCENE_COUNT; scene++)
            for (int way = 0; way < (scene == VOLUME || scene == OPAQUE_VOLUME ? 3 : 1); way++) {
                drawn_frame first, other;
                draw_opaque_ends(&mesh, scene, way, &first);
                draw_opaque_ends(&without, scene, way, &other);
                drawn_frame_assert_same(&first, &other);
                for (int i = 0; i < 4 * 61 * 47; i++) assert_true(isfinite(first.picture.rgba[i]));
                drawn_frame_free(&first);
                drawn_frame_free(&other);
            }
        free(owners);
        test_mesh_free(&mesh);
        test_mesh_free(&without);
    }
}

static double constant_field(const double p[3])
{
    (void)p;
    return 0.3;
}

/* Checks that a constant field equal to an isovalue has no surface, because it is on the same side of the isovalue in
 * all cells. */
static void constant_equal_to_the_isovalue_has_no_surface(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        render_fixture f;
        drawn_frame drawn;
        fixture_create_lattice(&f, kind, 3, 0.2, constant_field);
        fixture_add_surface(&f, values, 2, 1);
        fixture_draw(&f, &drawn);
        assert_int_equal(drawn.list.count, 0);
        drawn_frame_free(&drawn);
        fixture_free(&f);
    }
}

/* The field is x, so that all vertices in a plane have exactly the isovalue 0. A ray through an edge that lies in the
 * surface crosses cells whose value is zero up to rounding, on either side: it has an odd number of hits at the same
 * depth. */
static double plane_field(const double p[3])
{
    return p[0];
}

static void isovalue_at_vertices_gives_no_hole(void **state)
{
    (void)state;
    static const double zero[1] = {0};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
            render_fixture f;
            drawn_frame drawn;
            int met = 0, several = 0;
            if (camera == CAMERA_INSIDE) continue; /* this camera does not see the plane */
            fixture_create_lattice(&f, kind, 4, 0, plane_field);
            fixture_set_camera(&f, camera, 43, 41);
            fixture_add_surface(&f, zero, 1, 0.5f);
            fixture_draw(&f, &drawn);
            for (int p = 0; p < 43 * 41; p++) {
                double base[3], d[3];
                render_camera_ray(&f.job.camera, p % 43, p / 43, base, d);
                const double z = -base[0] / d[0], y = base[1] + z * d[1], w = base[2] + z * d[2];
                if (fabs(fabs(y) - 1) < 1e-5 || fabs(fabs(w) - 1) < 1e-5 || fabs(z) < 1e-5) continue;
                const bool inside = z > 0 && fabs(y) < 1 && fabs(w) < 1;
                met += inside;
                const int hits = (int)(drawn.first[p + 1] - drawn.first[p]);
                several += hits > 1;
                for (int64_t i = drawn.first[p]; i < drawn.first[p + 1]; i++)
                    assert_true(fabs(fixture_compute_scene_depth(&f, drawn.list.items[i].t_in) - z) < 1e-5);
                if (hits % 2 != inside)
                    fail_msg("%s, %s, pixel %d, %d: %d hits", test_mesh_kind_name(kind), fixture_camera_name(camera),
                             p % 43, p / 43, hits);
            }
            assert_true(met > 0 && several <= 43);
            drawn_frame_free(&drawn);
            fixture_free(&f);
        }
}

static void jitter_is_uniform_per_pixel_and_frame(void **state)
{
    (void)state;
    double sum = 0, product = 0;
    for (uint32_t pixel = 0; pixel < 100; pixel++)
        for (uint32_t frame = 0; frame < 100; frame++) {
            const double a = render_jitter(pixel, frame), b = render_jitter(pixel + 1, frame);
            assert_true(a >= 0 && a < 1);
            sum += a;
            product += (a - 0.5) * (b - 0.5);
        }
    /* Tolerances are 4 standard deviations, which are 0.0029 for the mean and 1/12/100 for the correlation of 10,000
     * uniform numbers. */
    assert_true(fabs(sum / 10000 - 0.5) < 0.012);
    assert_true(fabs(product / 10000) < 0.0034);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_thread_count_gives_same_bits),
        cmocka_unit_test(tiles_have_the_fragments_of_the_list),
        cmocka_unit_test(refused_tiles_end_the_frame),
        cmocka_unit_test(all_traversals_give_the_same_bits),
        cmocka_unit_test(sample_groups_draw_the_same),
        cmocka_unit_test(any_cell_order_gives_the_same_bits),
        cmocka_unit_test(reordered_cells_draw_the_same),
        cmocka_unit_test(all_layouts_give_the_same_bits),
        cmocka_unit_test(volume_traversals_give_the_same_bits),
        cmocka_unit_test(parts_and_ranks_draw_the_whole_picture),
        cmocka_unit_test(samples_on_faces_have_one_owner),
        cmocka_unit_test(ghosts_change_nothing),
        cmocka_unit_test(parent_tree_changes_nothing),
        cmocka_unit_test(cells_with_infinite_values_are_skipped),
        cmocka_unit_test(constant_equal_to_the_isovalue_has_no_surface),
        cmocka_unit_test(isovalue_at_vertices_gives_no_hole),
        cmocka_unit_test(jitter_is_uniform_per_pixel_and_frame),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
