/* Compares the kernels with the reference for every ray: all kinds of cells, cameras outside and inside, opaque
 * surfaces, transparent surfaces, volumes, and surfaces together with volumes. */
#include "test_effort.h"
#include "test_render_fixture.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

static const double one_value[1] = {0.3};
static const double four_values[4] = {-0.9, -0.2, 0.3, 1.1};
static const double linear_values[3] = {-0.6, 0.1, 0.5};

/* Checks that the fraction of ambiguous rays is at most `share`: rays with several roots in a cell, or on which the
 * value on a warped face contradicts the interior of the cell. */
static void assert_few_ambiguous(const fixture_outcome *o, double share)
{
    if ((double)o->ambiguous > share * (double)o->rays) fail_msg("%d of %d ambiguous", (int)o->ambiguous, (int)o->rays);
}

static const char *make_case_name(test_mesh_kind kind, fixture_camera camera, const char *what)
{
    static char name[96];
    snprintf(name, sizeof name, "%s, %s, %s", test_mesh_kind_name(kind), fixture_camera_name(camera), what);
    return name;
}

/* Returns the number of cubes along a side of the lattice. It is smaller for kinds with many cells per cube. */
static int choose_lattice_side(test_mesh_kind kind)
{
    return kind == TEST_HEXES ? 6 : kind == TEST_WEDGES ? 5 : 4;
}

/* Returns whether a case is drawn. The usual run draws each kind of mesh from one or two of the cameras; variants
 * of a test, and tests, take the others. */
static bool is_case_selected(test_mesh_kind kind, fixture_camera camera, int variant)
{
    return test_is_long_run() || ((int)kind + (int)camera + variant) % 3 == 0;
}

static void surface_matches_the_reference_for_every_kind_and_camera(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_ALONG_X; camera++) {
            render_fixture f;
            if (!is_case_selected(kind, camera, 2)) continue;
            fixture_create_lattice(&f, kind, choose_lattice_side(kind), 0.2, test_wave_field);
            fixture_set_camera(&f, camera, 39, 33);
            fixture_add_surface(&f, one_value, 1, 1);
            const fixture_outcome o =
                fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(kind, camera, "one value"));
            assert_true(o.hits > 150);
            assert_few_ambiguous(&o, kind == TEST_TETS ? 0 : 0.02);
            fixture_free(&f);
        }
}

static void surfaces_of_several_values_match_the_reference(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_PLANE; camera++) {
            render_fixture f;
            if (!is_case_selected(kind, camera, 0)) continue;
            fixture_create_lattice(&f, kind, choose_lattice_side(kind), 0.2, test_wave_field);
            fixture_set_camera(&f, camera, 27, 23);
            fixture_add_surface(&f, four_values, 4, 1);
            fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(kind, camera, "four values"));
            f.surfaces[0].opacity = 0.4f;
            fixture_compare_with_reference(&f, &fixture_usual_bounds,
                                           make_case_name(kind, camera, "four transparent values"));
            fixture_free(&f);
        }
}

static void transparent_surfaces_before_an_opaque_one_match_the_reference(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        render_fixture f;
        fixture_create_lattice(&f, kind, choose_lattice_side(kind), 0.2, test_wave_field);
        fixture_set_camera(&f, CAMERA_OUTSIDE, 33, 29);
        fixture_add_surface(&f, four_values, 2, 0.3f);
        fixture_add_surface(&f, four_values + 2, 2, 1);
        fixture_compare_with_reference(&f, &fixture_usual_bounds,
                                       make_case_name(kind, CAMERA_OUTSIDE, "transparent before opaque"));
        fixture_free(&f);
    }
}

/* Checks lights behind the scene that shine almost along surfaces which face away from them. Some normals point half
 * way between the eye and such a light, but there must be no highlight. */
static void lights_behind_surfaces_leave_them_dark(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_INSIDE; camera++) {
            render_fixture f;
            if (!test_is_long_run() && ((int)kind + (int)camera) % 2) continue;
            fixture_create_lattice(&f, kind, choose_lattice_side(kind), 0.2, test_wave_field);
            fixture_set_camera(&f, camera, 33, 29);
            fixture_add_surface(&f, one_value, 1, 1);
            f.surfaces[0].material = (render_material){.ambient = 0.1f, .diffuse = 0.3f, .specular = 1, .shininess = 4};
            for (int a = 0; a < 3; a++) {
                const double side = 0.6 * f.job.camera.right[a], ahead = 0.8 * f.job.camera.forward[a];
                f.lights[0].direction[a] = ahead + side;
                f.lights[1].direction[a] = ahead - side;
            }
            fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(kind, camera, "lights behind"));
            fixture_free(&f);
        }
}

static void volume_matches_the_reference_for_every_kind_and_camera(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_ALONG_X; camera++) {
            render_fixture f;
            fixture_create_lattice(&f, kind, choose_lattice_side(kind), 0.2, test_wave_field);
            fixture_set_camera(&f, camera, 37, 31);
            fixture_set_volume(&f, 0.3);
            fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(kind, camera, "volume"));
            fixture_free(&f);
        }
}

static void volume_and_surfaces_match_the_reference_together(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_PLANE; camera++)
            for (int transparent = 0; transparent < 2; transparent++) {
                render_fixture f;
                if (!is_case_selected(kind, camera, transparent)) continue;
                fixture_create_lattice(&f, kind, choose_lattice_side(kind), 0.2, test_wave_field);
                fixture_set_camera(&f, camera, 25, 21);
                fixture_add_surface(&f, four_values + 1, 2, transparent ? 0.5f : 1);
                fixture_set_volume(&f, 0.4);
                const char *what = transparent ? "volume and transparent surfaces" : "volume and surfaces";
                fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(kind, camera, what));
                f.job.is_alone = false;
                fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(kind, camera, what));
                fixture_free(&f);
            }
}

static double short_wave_field(const double p[3])
{
    return test_wave_field((const double[]){2 * p[0], 2 * p[1], 2 * p[2]});
}

/* Checks rays that cross more surfaces than a packet can store. The volume fragments of these rays end at every
 * sample. */
static void volume_between_many_surfaces_matches_the_reference(void **state)
{
    static const float colours[48] = {0.8f, 0.2f, 0.1f};
    double values[16];
    (void)state;
    for (int i = 0; i < 16; i++) values[i] = -1.17 + 0.171 * i;
    for (int alone = 0; alone < 2; alone++) {
        render_fixture f;
        drawn_frame drawn;
        int crowded = 0;
        fixture_create_lattice(&f, TEST_TETS, 7, 0.2, short_wave_field);
        fixture_set_camera(&f, CAMERA_OUTSIDE, 29, 27);
        fixture_add_surface(&f, values, 16, 0.03f);
        f.surfaces[0].colours = colours;
        fixture_set_volume(&f, 0.2);
        f.job.is_alone = alone;
        fixture_draw(&f, &drawn);
        for (int p = 0; p < 29 * 27; p++) {
            int hits = 0;
            for (int64_t i = drawn.first[p]; i < drawn.first[p + 1]; i++)
                hits += drawn.list.items[i].kind >= FRAGMENT_SURFACE;
            crowded += hits > 32 && hits <= REFERENCE_MAX_HITS;
        }
        assert_true(crowded > 10);
        fixture_compare_with_reference(&f, &fixture_usual_bounds, "many surfaces");
        drawn_frame_free(&drawn);
        fixture_free(&f);
    }
}

/* ---- closed forms ---- */

static double compute_linear_slope_on_ray(const render_camera *camera, int pixel, double *at_base)
{
    double base[3], d[3];
    render_camera_ray(camera, pixel % camera->width, pixel / camera->width, base, d);
    *at_base = test_linear_field(base);
    return 0.3 * d[0] - 0.7 * d[1] + 0.5 * d[2];
}

/* Checks that the isosurface of a linear field is its plane, in cells with plane faces and in warped cells. Positions
 * and values in float32 have an error of a few times 6e-8 of the mesh's size (values are at most 1.6). The ray's slope
 * turns this error into an error of depth. */
static void compare_plane(test_mesh_kind kind, fixture_camera camera, bool is_warped)
{
    render_fixture f;
    drawn_frame drawn;
    fixture_create_lattice(&f, kind, 3, is_warped ? 0.2 : 0, test_linear_field);
    fixture_set_camera(&f, camera, 41, 37);
    fixture_add_surface(&f, linear_values, 3, 0.5f);
    fixture_draw(&f, &drawn);
    for (int64_t i = 0; i < drawn.list.count; i++) {
        const fragment *hit = &drawn.list.items[i];
        double at_base;
        const double slope = compute_linear_slope_on_ray(&f.job.camera, (int)hit->pixel, &at_base);
        const double value = at_base + slope * fixture_compute_scene_depth(&f, hit->t_in);
        assert_true(fabs(value - linear_values[hit->kind - FRAGMENT_SURFACE]) < 2e-6 + 1e-6 * fabs(slope));
    }
    assert_true(drawn.list.count > 300);
    drawn_frame_free(&drawn);
    fixture_free(&f);
}

static void linear_surface_is_a_plane_in_every_kind(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_PLANE; camera++)
            for (int is_warped = 0; is_warped < 2; is_warped++) compare_plane(kind, camera, is_warped);
}

/* Checks that no sample is lost or counted twice at a face, an edge or a vertex, including rays along lattice lines. If
 * the opacity is constant, the transmittance of a ray follows from the number of samples in the cube. */
static void constant_volume_counts_every_sample_once(void **state)
{
    (void)state;
    static const float constant[1] = {0.3f};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = CAMERA_OUTSIDE; camera < CAMERA_COUNT; camera++) {
            render_fixture f;
            drawn_frame drawn;
            int off = 0, met = 0;
            fixture_create_lattice(&f, kind, 4, camera == CAMERA_ALONG_X ? 0 : 0.2, test_linear_field);
            fixture_set_camera(&f, camera, 43, 41);
            fixture_set_volume(&f, 0.23);
            f.transfer.opacity_count = 1;
            f.transfer.opacities = constant;
            fixture_draw(&f, &drawn);
            for (int p = 0; p < 43 * 41; p++) {
                double base[3], d[3], low = 0, high = (double)INFINITY;
                render_camera_ray(&f.job.camera, p % 43, p / 43, base, d);
                for (int axis = 0; axis < 3; axis++) {
                    const double a = (-1 - base[axis]) / d[axis], b = (1 - base[axis]) / d[axis];
                    low = fmax(low, fmin(a, b));
                    high = fmin(high, fmax(a, b));
                }
                /* Within rounding of the cube's border, a ray or a sample may be inside or outside. */
                if (fabs(high - low) < 1e-5 || (camera == CAMERA_ALONG_X && (fabs(base[1]) == 1 || fabs(base[2]) == 1)))
                    continue;
                const double length = f.job.camera.is_orthographic ? 1 : sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
                const double step = f.job.step / length, jitter = render_jitter((uint32_t)p, 0);
                const double count = low < high ? ceil(high / step - jitter) - ceil(low / step - jitter) : 0;
                const double clear = pow(0.7, count * f.job.step / f.transfer.unit_distance) * 0.5;
                met += low < high;
                off += fabs(1 - (double)drawn.picture.rgba[4 * p + 3] - clear) > 1e-5;
            }
            assert_true(met > 300);
            if (off) fail_msg("%s: %d of %d rays", make_case_name(kind, camera, "samples"), off, met);
            drawn_frame_free(&drawn);
            fixture_free(&f);
        }
}

/* Checks that rays through the vertices, along the edges and in the faces of a lattice meet the isosurface of a linear
 * field exactly once. */
static void lattice_lines_have_no_holes(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        render_fixture f;
        drawn_frame drawn;
        int met = 0;
        fixture_create_lattice(&f, kind, 4, 0, test_linear_field);
        fixture_set_camera(&f, CAMERA_ALONG_X, 43, 41);
        static const double value[1] = {0.1};
        fixture_add_surface(&f, value, 1, 0.5f);
        fixture_draw(&f, &drawn);
        for (int p = 0; p < 43 * 41; p++) {
            double base[3], d[3], at_base;
            render_camera_ray(&f.job.camera, p % 43, p / 43, base, d);
            const double slope = compute_linear_slope_on_ray(&f.job.camera, p, &at_base), z = (0.1 - at_base) / slope;
            const double x = base[0] + z * d[0];
            if (fabs(base[1]) >= 1 || fabs(base[2]) >= 1 || fabs(fabs(x) - 1) < 1e-5) continue;
            met++;
            assert_int_equal(drawn.first[p + 1] - drawn.first[p], fabs(x) < 1);
        }
        assert_true(met > 800);
        drawn_frame_free(&drawn);
        fixture_free(&f);
    }
}

/* ---- single cells, including degenerate ones ---- */

static void single_cells_match_the_reference(void **state)
{
    (void)state;
    static const double values[3] = {-0.25, 0.1, 0.35};
    /* Rounding to float32 changes positions by 6e-8 of a sliver's length, or 1e-3 of its thickness. The margin and the
     * tolerance of depth follow from this error. */
    static const fixture_bounds thin = {.depth = 1e-2, .colour = 2, .excluded = 1, .margin = 1e-3};
    for (test_cell_shape shape = 0; shape < TEST_SHAPE_COUNT; shape++)
        for (fixture_camera camera = 0; camera < CAMERA_INSIDE; camera++) {
            test_mesh mesh;
            render_fixture f;
            test_mesh_make_single_cell(shape, test_linear_field, &mesh);
            fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 1, 1,
                           (const double[]){0, 0, 0});
            fixture_set_camera(&f, camera, 39, 33);
            fixture_add_surface(&f, values, 3, 0.5f);
            fixture_set_volume(&f, 0.05);
            const bool is_thin = shape == TEST_SLIVER_TET || shape >= TEST_FLAT_TET;
            fixture_compare_with_reference(&f, is_thin ? &thin : &fixture_usual_bounds, test_cell_shape_name(shape));
            fixture_free(&f);
            test_mesh_free(&mesh);
        }
}

/* Checks isosurfaces that lie along a sliver, of a field that varies across its thickness. In pixels that certainly
 * show the sliver, hits must be inside it. */
static void surfaces_along_slivers_match_the_reference(void **state)
{
    (void)state;
    static const double values[3] = {-0.25, 0.1, 0.35};
    for (fixture_camera camera = 0; camera < CAMERA_INSIDE; camera++) {
        test_mesh mesh;
        render_fixture f;
        test_mesh_make_single_cell(TEST_SLIVER_TET, test_linear_field, &mesh);
        for (int v = 0; v < 4; v++) mesh.values[v] = v == 3 ? 0.5 : -0.5;
        fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 1, 1,
                       (const double[]){0, 0, 0});
        fixture_set_camera(&f, camera, 121, 101);
        fixture_add_surface(&f, values, 3, 0.5f);
        const fixture_outcome met =
            fixture_compare_with_reference(&f, &fixture_usual_bounds, fixture_camera_name(camera));
        assert_true(met.hits > 100);
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
}

static void left_handed_cells_match_the_reference(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh;
        render_fixture f;
        test_mesh_make_lattice(kind, 3, 0.2, test_wave_field, &mesh);
        test_mesh_mirror_cells(&mesh, true);
        fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 2.0 / 3, 1,
                       (const double[]){0, 0, 0});
        fixture_set_camera(&f, CAMERA_OUTSIDE, 33, 29);
        fixture_add_surface(&f, one_value, 1, 0.5f);
        fixture_set_volume(&f, 0.3);
        fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(kind, CAMERA_OUTSIDE, "left-handed"));
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
}

/* Checks meshes in double that are far from the origin: relative to the cells, the picture must be the same as near the
 * origin. Double coordinates are rounded by 5.8e6 · 1e-16 = 6e-10, for cells of size 2000 / 4, and the coordinates of
 * the camera by as much. */
static void far_coordinates_match_the_reference(void **state)
{
    (void)state;
    static const double far_away[3] = {5.8e6, -4.9e5, 3.1e6};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh;
        render_fixture f;
        test_mesh_make_lattice(kind, 4, 0.2, test_wave_field, &mesh);
        test_mesh_transform(&mesh, 1000, far_away);
        fixture_create(&f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 500, 1000, far_away);
        fixture_set_camera(&f, CAMERA_OUTSIDE, 33, 29);
        fixture_add_surface(&f, one_value, 1, 0.5f);
        fixture_set_volume(&f, 0.3);
        fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(kind, CAMERA_OUTSIDE, "far away"));
        fixture_free(&f);
        test_mesh_free(&mesh);
    }
}

static void two_volumes_share_their_light(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh;
        test_view second;
        render_fixture f;
        test_mesh_make_lattice(kind, 4, 0.2, test_linear_field, &mesh);
        test_view_create(&mesh, (test_layout){.wide_coordinates = true, .wide_values = true}, &second);
        fixture_create_lattice(&f, kind, 4, 0.2, test_wave_field);
        fixture_set_camera(&f, CAMERA_OUTSIDE, 33, 29);
        fixture_set_volume(&f, 0.3);
        float *pairs = malloc((size_t)f.trees[0].node_count * 2 * sizeof *pairs);
        int64_t unusable;
        assert_int_equal(mmbvh_compute_ranges(&f.trees[0], &f.views[0].cells, &second.field,
                                              &(mmbvh_options){.threads = 1}, pairs, &unusable),
                         INSITU_OK);
        const mmbvh_ranges ranges = mmbvh_pair_ranges(pairs);
        render_transfer other = f.transfer;
        static const float red_to_green[6] = {0.9f, 0.1f, 0.1f, 0.1f, 0.9f, 0.1f}, opacities[2] = {0.1f, 0.7f};
        static const double at[2] = {-1, 1};
        other.colours = red_to_green;
        other.colour_count = other.opacity_count = 2;
        other.opacity_values = at;
        other.opacities = opacities;
        const render_volume_layer both[2] = {f.volume, {{&second.field, &ranges}, &other}};
        f.job.volumes = both;
        f.job.volume_count = 2;
        fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(kind, CAMERA_OUTSIDE, "two volumes"));
        free(pairs);
        fixture_free(&f);
        test_view_free(&second);
        test_mesh_free(&mesh);
    }
}

/* Checks values in cells: each cell of the volume has a constant value. A sample near a face may belong to either cell.
 * Such rays are excluded by the margin, 2e-6 for each of about 20 cells on a ray. */
static void cell_centred_volume_matches_the_reference(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int is_alone = 0; is_alone < 2; is_alone++) {
            render_fixture f;
            fixture_create_lattice(&f, kind, 4, 0.2, test_wave_field);
            const int64_t cells = f.views[0].cells.cell_count;
            double *values = malloc((size_t)cells * sizeof *values);
            for (int64_t i = 0; i < cells; i++) values[i] = 2 * test_uniform((uint64_t)i, 21) - 1;
            f.fields[0].values = (grid_array){.data = (const char *)values, .stride = 8, .is_wide = true};
            f.fields[0].is_cell_centred = true;
            assert_int_equal(
                mmbvh_refit_ranges(&f.trees[0], &f.views[0].cells, &f.fields[0], &(mmbvh_options){.threads = 1}),
                INSITU_OK);
            fixture_set_camera(&f, CAMERA_OUTSIDE, 33, 29);
            fixture_set_volume(&f, 0.2);
            f.job.is_alone = is_alone;
            fixture_compare_with_reference(&f, &fixture_usual_bounds,
                                           make_case_name(kind, CAMERA_OUTSIDE, "cell-centred"));
            free(values);
            fixture_free(&f);
        }
}

/* A field of very large values. The transfer function and the isovalue are scaled like the field. */
static double huge_wave_field(const double p[3])
{
    return 1e30 * test_wave_field(p);
}
static double tiny_wave_field(const double p[3])
{
    return 1e-30 * test_wave_field(p);
}

static void values_of_any_size_match_the_reference(void **state)
{
    (void)state;
    static const double huge_values[1] = {0.3e30}, tiny_values[1] = {0.3e-30};
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (int tiny = 0; tiny < 2; tiny++) {
            render_fixture f;
            const double scale = tiny ? 1e-30 : 1e30, tent[3] = {-0.6 * scale, 0, 0.6 * scale};
            fixture_create_lattice(&f, kind, 3, 0.2, tiny ? tiny_wave_field : huge_wave_field);
            fixture_set_camera(&f, CAMERA_OUTSIDE, 33, 29);
            fixture_add_surface(&f, tiny ? tiny_values : huge_values, 1, 0.5f);
            fixture_set_volume(&f, 0.3);
            f.transfer.low *= scale;
            f.transfer.high *= scale;
            f.transfer.opacity_values = tent;
            fixture_compare_with_reference(&f, &fixture_usual_bounds,
                                           make_case_name(kind, CAMERA_OUTSIDE, tiny ? "1e-30" : "1e30"));
            fixture_free(&f);
        }
}

static void surface_coloured_by_the_field_matches_the_reference(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh;
        test_view colours;
        render_fixture f;
        test_mesh_make_lattice(kind, 4, 0.2, test_linear_field, &mesh);
        test_view_create(&mesh, (test_layout){.wide_coordinates = true, .wide_values = true}, &colours);
        fixture_create_lattice(&f, kind, 4, 0.2, test_wave_field);
        fixture_set_camera(&f, CAMERA_OUTSIDE, 33, 29);
        fixture_set_volume(&f, 0.3);
        f.job.volume_count = 0;
        fixture_add_surface(&f, four_values, 4, 1);
        f.surfaces[0].colour_field = (render_field){&colours.field, f.ranges};
        f.surfaces[0].colour_map = &f.transfer;
        fixture_compare_with_reference(&f, &fixture_usual_bounds,
                                       make_case_name(kind, CAMERA_OUTSIDE, "coloured by a field"));
        test_view_free(&colours);
        test_mesh_free(&mesh);
        fixture_free(&f);
    }
}

static void one_pixel_images_match_the_reference(void **state)
{
    (void)state;
    static const int sizes[4][2] = {{1, 1}, {1, 9}, {17, 1}, {3, 5}};
    for (int i = 0; i < 4; i++) {
        render_fixture f;
        fixture_create_lattice(&f, TEST_HEXES, 3, 0.2, test_wave_field);
        fixture_set_camera(&f, CAMERA_OUTSIDE, sizes[i][0], sizes[i][1]);
        fixture_add_surface(&f, one_value, 1, 0.5f);
        fixture_set_volume(&f, 0.3);
        fixture_compare_with_reference(&f, &fixture_usual_bounds, "small images");
        fixture_free(&f);
    }
}

/* Replaces the fixture's tree by one with nodes of the reference layout. */
static void build_reference_layout(render_fixture *f)
{
    base_error error = {0};
    mmbvh_free(&f->trees[0]);
    assert_int_equal(mmbvh_build(&f->views[0].cells, &f->fields[0], f->offset, f->job.space.scale,
                                 &(mmbvh_options){.threads = 1, .layout = MMBVH_REFERENCE}, &f->trees[0], &error),
                     INSITU_OK);
    f->ranges[0] = mmbvh_own_ranges(&f->trees[0]);
}

/* Checks cells that are smaller than pixels. Tiles then traverse the trees by themselves and skip hidden cells. */
static void surfaces_of_cells_smaller_than_pixels_match_the_reference(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++)
        for (fixture_camera camera = 0; camera < CAMERA_COUNT; camera++) {
            render_fixture f;
            drawn_frame drawn[2];
            fixture_create_lattice(&f, kind, choose_lattice_side(kind), 0.2, test_wave_field);
            fixture_set_camera(&f, camera, 9, 5);
            fixture_add_surface(&f, four_values, 2, 1);
            fixture_add_surface(&f, one_value, 1, 1);
            if (camera % 2) build_reference_layout(&f);
            if (camera < CAMERA_ALONG_X)
                fixture_compare_with_reference(&f, &fixture_usual_bounds, make_case_name(kind, camera, "small cells"));
            for (render_traversal t = RENDER_BINNED; t <= RENDER_TILES; t++) {
                f.job.traversal = t;
                fixture_draw(&f, &drawn[t]);
                drawn_frame_assert_same(&drawn[0], &drawn[t]);
                assert_int_equal(drawn[0].list.count, drawn[t].list.count);
            }
            for (int t = 0; t < 2; t++) drawn_frame_free(&drawn[t]);
            fixture_free(&f);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(surface_matches_the_reference_for_every_kind_and_camera),
        cmocka_unit_test(surfaces_of_several_values_match_the_reference),
        cmocka_unit_test(transparent_surfaces_before_an_opaque_one_match_the_reference),
        cmocka_unit_test(lights_behind_surfaces_leave_them_dark),
        cmocka_unit_test(volume_matches_the_reference_for_every_kind_and_camera),
        cmocka_unit_test(volume_and_surfaces_match_the_reference_together),
        cmocka_unit_test(linear_surface_is_a_plane_in_every_kind),
        cmocka_unit_test(single_cells_match_the_reference),
        cmocka_unit_test(surfaces_along_slivers_match_the_reference),
        cmocka_unit_test(left_handed_cells_match_the_reference),
        cmocka_unit_test(far_coordinates_match_the_reference),
        cmocka_unit_test(two_volumes_share_their_light),
        cmocka_unit_test(cell_centred_volume_matches_the_reference),
        cmocka_unit_test(values_of_any_size_match_the_reference),
        cmocka_unit_test(surface_coloured_by_the_field_matches_the_reference),
        cmocka_unit_test(one_pixel_images_match_the_reference),
        cmocka_unit_test(surfaces_of_cells_smaller_than_pixels_match_the_reference),
    };
    /* These tests draw without the comparison that uses all instruction sets, so they are run for each instruction
     * set. */
    const struct CMUnitTest of_a_set[] = {
        cmocka_unit_test(volume_between_many_surfaces_matches_the_reference),
        cmocka_unit_test(constant_volume_counts_every_sample_once),
        cmocka_unit_test(lattice_lines_have_no_holes),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    for (int set = 0; set < fixture_isa_count(); set++) {
        fixture_select_isa(set);
        failed += cmocka_run_group_tests(of_a_set, NULL, NULL);
    }
    return failed;
}
