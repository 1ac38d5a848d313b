/* Compares the reference renderer, which is the reference for the kernels, with closed forms. */
#include "reference_cell.h"
#include "reference_render.h"
#include "test_meshes.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
#include <cmocka.h>

/* Adds a vertex to a cell. The camera is at the origin and looks along z, so that camera coordinates equal world
 * coordinates. Returns the vertex's index in the cell. */
static int add_vertex(const test_mesh *mesh, int64_t v, int64_t *met, reference_cell *cell, double *values)
{
    int at = 0;
    while (at < cell->count && met[at] != v) at++;
    if (at < cell->count && cell->type == GRID_POLYHEDRON) return at;
    at = cell->count++;
    met[at] = v;
    memcpy(cell->world[at], mesh->coordinates + 3 * v, sizeof cell->world[at]);
    memcpy(cell->position[at], mesh->coordinates + 3 * v, sizeof cell->position[at]);
    values[at] = mesh->values[v];
    return at;
}

static void load_cell(const test_mesh *mesh, int64_t index, reference_cell *cell, double values[REFERENCE_MAX_VERTICES])
{
    int64_t met[REFERENCE_MAX_VERTICES];
    cell->type = mesh->types[index];
    cell->count = cell->poly.face_count = 0;
    for (int64_t i = mesh->offsets[index]; i < mesh->offsets[index + 1]; i++) {
        const int64_t entry = mesh->connectivity[i];
        if (cell->type != GRID_POLYHEDRON) {
            add_vertex(mesh, entry, met, cell, values);
            continue;
        }
        const int face = cell->poly.face_count++;
        const int64_t first = mesh->face_offsets[entry], end = mesh->face_offsets[entry + 1];
        cell->poly.face_size[face] = (int)(end - first);
        for (int64_t k = first; k < end; k++)
            cell->poly.faces[face][k - first] = add_vertex(mesh, mesh->face_connectivity[k], met, cell, values);
    }
    if (cell->type == GRID_POLYHEDRON) reference_polyhedron_setup(cell);
}

static reference_line make_random_line(uint64_t index)
{
    return (reference_line){{0.9 * test_uniform(index, 11) - 0.45, 0.9 * test_uniform(index, 12) - 0.45},
                            {test_uniform(index, 13) - 0.5, test_uniform(index, 14) - 0.5}};
}

static void crossings_of_unit_hex_match_slab_test(void **state)
{
    (void)state;
    test_mesh mesh;
    reference_cell cell;
    double values[REFERENCE_MAX_VERTICES];
    int met = 0;
    test_mesh_make_single_cell(TEST_UNIT_HEX, test_linear_field, &mesh);
    load_cell(&mesh, 0, &cell, values);
    for (uint64_t i = 0; i < 2000; i++) {
        const reference_line line = make_random_line(i);
        reference_crossing crossings[REFERENCE_MAX_CROSSINGS];
        double low = -0.5, high = 0.5;
        for (int axis = 0; axis < 2; axis++) {
            const double a = (-0.5 - line.base[axis]) / line.slope[axis],
                         b = (0.5 - line.base[axis]) / line.slope[axis];
            low = fmax(low, fmin(a, b));
            high = fmin(high, fmax(a, b));
        }
        const int count = reference_find_crossings(&cell, &line, crossings);
        assert_int_equal(count, low < high ? 2 : 0);
        if (!count) continue;
        met++;
        assert_true(fabs(crossings[0].z - low) < 1e-13);
        assert_true(fabs(crossings[1].z - high) < 1e-13);
    }
    assert_true(met > 500);
    test_mesh_free(&mesh);
}

/* Returns a line that is random, that passes through a vertex, or that passes through the middle between two
 * vertices. */
static reference_line make_aimed_line(const reference_cell *cell, uint64_t i)
{
    reference_line line = make_random_line(i);
    if (i % 3 == 0) return line;
    const double *a = cell->position[i % (uint64_t)cell->count], *b = cell->position[(i / 3) % (uint64_t)cell->count];
    const double along = i % 3 == 1 ? 0 : 0.5;
    if (i % 2) line.slope[0] = line.slope[1] = 0;
    for (int axis = 0; axis < 2; axis++)
        line.base[axis] = a[axis] + along * (b[axis] - a[axis]) - line.slope[axis] * (a[2] + along * (b[2] - a[2]));
    return line;
}

static void crossings_of_every_shape_are_even(void **state)
{
    (void)state;
    for (test_cell_shape shape = 0; shape < TEST_SHAPE_COUNT; shape++) {
        test_mesh mesh;
        reference_cell cell;
        double values[REFERENCE_MAX_VERTICES];
        test_mesh_make_single_cell(shape, test_linear_field, &mesh);
        load_cell(&mesh, 0, &cell, values);
        for (uint64_t i = 0; i < 3000; i++) {
            const reference_line line = make_aimed_line(&cell, i);
            reference_crossing crossings[REFERENCE_MAX_CROSSINGS];
            assert_int_equal(reference_find_crossings(&cell, &line, crossings) % 2, 0);
        }
        test_mesh_free(&mesh);
    }
}

/* Checks that the intervals of the cells of a conforming lattice follow each other along a ray without gaps and
 * overlaps. */
static void intervals_of_lattices_tile_the_ray(void **state)
{
    (void)state;
    for (test_mesh_kind kind = 0; kind < TEST_KIND_COUNT; kind++) {
        test_mesh mesh;
        test_mesh_make_lattice(kind, 4, 0.2, test_linear_field, &mesh);
        for (uint64_t i = 0; i < 40; i++) {
            reference_line line = make_random_line(i);
            if (i % 4 == 0)
                line = (reference_line){{0.5 * (double)(i / 16) - 0.5, 0}, {0, 0}}; /* along planes of the lattice */
            double length = 0, low = 0, high = 0;
            for (int64_t index = 0; index < mesh.cell_count; index++) {
                reference_cell cell;
                double values[REFERENCE_MAX_VERTICES];
                reference_crossing c[REFERENCE_MAX_CROSSINGS];
                load_cell(&mesh, index, &cell, values);
                const int count = reference_find_crossings(&cell, &line, c);
                for (int k = 0; k + 1 < count; k += 2) {
                    length += c[k + 1].z - c[k].z;
                    low = fmin(low, c[k].z);
                    high = fmax(high, c[k + 1].z);
                }
            }
            assert_true(high > low);
            assert_true(fabs(length - (high - low)) < 1e-12);
        }
        test_mesh_free(&mesh);
    }
}

/* Computes a point inside the cell, as a random weighted mean of the vertices. */
static void choose_inner_point(const reference_cell *cell, uint64_t i, double point[3])
{
    double total = 0;
    point[0] = point[1] = point[2] = 0;
    for (int v = 0; v < cell->count; v++) {
        const double weight = test_uniform(8 * i + (uint64_t)v, 15);
        total += weight;
        for (int axis = 0; axis < 3; axis++) point[axis] += weight * cell->position[v][axis];
    }
    for (int axis = 0; axis < 3; axis++) point[axis] /= total;
}

static void linear_field_is_exact_in_every_cell(void **state)
{
    (void)state;
    static const double slope[3] = {0.3, -0.7, 0.5};
    for (test_cell_shape shape = 0; shape < TEST_FLAT_TET; shape++) {
        test_mesh mesh;
        reference_cell cell;
        double values[REFERENCE_MAX_VERTICES];
        test_mesh_make_single_cell(shape, test_linear_field, &mesh);
        load_cell(&mesh, 0, &cell, values);
        /* The error of the gradient is the rounding of values (1e-16) divided by the smallest extent of the cell
         * (1e-4). */
        const double bound = shape == TEST_SLIVER_TET ? 1e-11 : 1e-12;
        for (uint64_t i = 0; i < 300; i++) {
            double point[3], value, gradient[3];
            choose_inner_point(&cell, i, point);
            assert_true(reference_interpolate(&cell, point, values, &value, gradient));
            assert_true(fabs(value - test_linear_field(point)) < 1e-12);
            for (int axis = 0; axis < 3; axis++) assert_true(fabs(gradient[axis] - slope[axis]) < bound);
        }
        test_mesh_free(&mesh);
    }
}

/* Loads a hexagonal prism of which one base has collapsed to a single vertex. All faces remain: a hexagon that repeats
 * this vertex, and quads with three distinct vertices. The bits of turns select the orientation of each quad. */
static void load_collapsed_prism(unsigned turns, reference_cell *cell, double values[REFERENCE_MAX_VERTICES])
{
    reference_polyhedron *p = &cell->poly;
    cell->type = GRID_POLYHEDRON;
    cell->count = 7;
    p->face_count = 8;
    p->face_size[0] = p->face_size[1] = 6;
    for (int i = 0; i < 6; i++) {
        const double angle = acos(-1) / 3 * i;
        const double corner[3] = {cos(angle), sin(angle), 1};
        memcpy(cell->position[i + 1], corner, sizeof corner);
        p->faces[0][i] = 0;
        p->faces[1][i] = i + 1;
        const int left = i + 1, right = (i + 1) % 6 + 1, is_turned = turns >> i & 1;
        p->face_size[i + 2] = 4;
        p->faces[i + 2][0] = p->faces[i + 2][1] = 0;
        p->faces[i + 2][2] = is_turned ? right : left;
        p->faces[i + 2][3] = is_turned ? left : right;
    }
    memset(cell->position[0], 0, sizeof cell->position[0]);
    memcpy(cell->world, cell->position, sizeof cell->world);
    for (int i = 0; i < cell->count; i++) values[i] = test_linear_field(cell->position[i]);
    reference_polyhedron_setup(cell);
}

/* Checks that prisms with a collapsed base behave as pyramids. An edge from a vertex to itself has no direction, so it
 * must not be used to orient faces. */
static void collapsed_prisms_are_pyramids(void **state)
{
    (void)state;
    for (unsigned turns = 0; turns < 64; turns++) {
        reference_cell cell;
        double values[REFERENCE_MAX_VERTICES];
        load_collapsed_prism(turns, &cell, values);
        for (uint64_t i = 0; i < 100; i++) {
            double point[3], value;
            choose_inner_point(&cell, i, point);
            assert_true(reference_interpolate(&cell, point, values, &value, NULL));
            assert_true(fabs(value - test_linear_field(point)) < 1e-12);
        }
    }
}

static double trilinear_field(const double p[3])
{
    return p[0] * p[1] * p[2] + p[0] * p[1] - 2 * p[2] * p[0] + p[1];
}

static void trilinear_field_is_exact_in_a_box(void **state)
{
    (void)state;
    test_mesh mesh;
    reference_cell cell;
    double values[REFERENCE_MAX_VERTICES];
    test_mesh_make_single_cell(TEST_UNIT_HEX, trilinear_field, &mesh);
    load_cell(&mesh, 0, &cell, values);
    for (uint64_t i = 0; i < 300; i++) {
        double p[3], value, gradient[3];
        choose_inner_point(&cell, i, p);
        assert_true(reference_interpolate(&cell, p, values, &value, gradient));
        assert_true(fabs(value - trilinear_field(p)) < 1e-13);
        assert_true(fabs(gradient[0] - (p[1] * p[2] + p[1] - 2 * p[2])) < 1e-12);
        assert_true(fabs(gradient[1] - (p[0] * p[2] + p[0] + 1)) < 1e-12);
        assert_true(fabs(gradient[2] - (p[0] * p[1] - 2 * p[0])) < 1e-12);
    }
    test_mesh_free(&mesh);
}

/* Compares the gradient of a field that is not linear with central differences. Their error is h²·f''' ~ 1e-9, and
 * their rounding is 1e-15 / h ~ 1e-10. */
static void gradient_agrees_with_differences(void **state)
{
    (void)state;
    const double h = 1e-5;
    for (test_cell_shape shape = 0; shape < TEST_FLAT_TET; shape++) {
        if (shape == TEST_SLIVER_TET) continue;
        test_mesh mesh;
        reference_cell cell;
        double values[REFERENCE_MAX_VERTICES];
        test_mesh_make_single_cell(shape, test_wave_field, &mesh);
        load_cell(&mesh, 0, &cell, values);
        for (uint64_t i = 0; i < 100; i++) {
            double p[3], value, gradient[3];
            choose_inner_point(&cell, i, p);
            assert_true(reference_interpolate(&cell, p, values, &value, gradient));
            for (int axis = 0; axis < 3; axis++) {
                double ahead[3] = {p[0], p[1], p[2]}, behind[3] = {p[0], p[1], p[2]}, f1, f0;
                ahead[axis] += h;
                behind[axis] -= h;
                assert_true(reference_interpolate(&cell, ahead, values, &f1, NULL));
                assert_true(reference_interpolate(&cell, behind, values, &f0, NULL));
                assert_true(fabs((f1 - f0) / (2 * h) - gradient[axis]) < 1e-6);
            }
        }
        test_mesh_free(&mesh);
    }
}

/* Checks that the value on a plane face is the limit of the values inside the cell. */
static void face_values_are_continuous_with_the_interior(void **state)
{
    (void)state;
    static const test_cell_shape shapes[] = {TEST_UNIT_TET,     TEST_UNIT_HEX,     TEST_UNIT_WEDGE,
                                             TEST_UNIT_PYRAMID, TEST_HEX_AS_WEDGE, TEST_HEX_AS_PYRAMID};
    for (size_t s = 0; s < sizeof shapes / sizeof shapes[0]; s++) {
        test_mesh mesh;
        reference_cell cell;
        double values[REFERENCE_MAX_VERTICES];
        test_mesh_make_single_cell(shapes[s], test_wave_field, &mesh);
        load_cell(&mesh, 0, &cell, values);
        for (uint64_t i = 0; i < 500; i++) {
            const reference_line line = make_random_line(i);
            reference_crossing c[REFERENCE_MAX_CROSSINGS];
            const int count = reference_find_crossings(&cell, &line, c);
            for (int k = 0; k < count; k++) {
                double value;
                bool is_folded;
                const double face = reference_compute_face_value(&cell, &line, &c[k], values, &is_folded);
                const double point[3] = {line.base[0] + line.slope[0] * c[k].z, line.base[1] + line.slope[1] * c[k].z,
                                         c[k].z};
                assert_true(reference_interpolate(&cell, point, values, &value, NULL));
                /* Near a collapsed vertex, the inverse map loses half of the digits. */
                assert_true(fabs(face - value) < (s < 4 ? 1e-11 : 1e-6));
            }
        }
        test_mesh_free(&mesh);
    }
}

/* ---- whole rays ---- */

typedef struct frame_fixture {
    test_view view;
    mmbvh_ranges ranges;
    render_part part;
    render_surface_layer surface;
    render_volume_layer volume;
    render_transfer transfer;
    render_job job;
    double iso;
} frame_fixture;

static const float white[6] = {1, 1, 1, 1, 1, 1};
static const double opacity_at[1] = {0};
static const float opacity[1] = {0.4f};
static const float no_background[4] = {0, 0, 0, 0};

static void set_up_frame(frame_fixture *f, test_mesh_kind kind, bool is_orthographic)
{
    const double eye[3] = {2.4, 1.6, 3.0}, focal[3] = {0, 0, 0}, up[3] = {0, 1, 0};
    test_mesh mesh;
    memset(f, 0, sizeof *f);
    test_mesh_make_lattice(kind, 3, 0.2, test_linear_field, &mesh);
    test_view_create(&mesh, (test_layout){.wide_coordinates = true, .wide_values = true}, &f->view);
    test_mesh_free(&mesh);
    f->iso = 0.2;
    f->ranges.low = f->ranges.high = (const char *)white;
    f->part.cells = &f->view.cells;
    f->surface = (render_surface_layer){.field = {&f->view.field, &f->ranges},
                                        .value_count = 1,
                                        .values = &f->iso,
                                        .colours = white,
                                        .opacity = 1,
                                        .material = {.ambient = 0.25f}};
    f->transfer = (render_transfer){.low = -1,
                                    .high = 1,
                                    .colour_count = 2,
                                    .colours = white,
                                    .opacity_count = 1,
                                    .opacity_values = opacity_at,
                                    .opacities = opacity,
                                    .unit_distance = 0.5};
    f->volume = (render_volume_layer){{&f->view.field, &f->ranges}, &f->transfer};
    f->job =
        (render_job){.parts = &f->part, .part_count = 1, .surfaces = &f->surface, .volumes = &f->volume, .step = 0.01};
    assert_true(render_camera_look_at(&f->job.camera, eye, focal, up, 40, 24, 20));
    f->job.camera.is_orthographic = is_orthographic;
    if (is_orthographic) f->job.camera.half_height = 1.5;
}

/* Computes the interval of the ray inside the cube [-1, 1]^3. Returns whether the ray meets the cube. */
static bool compute_cube_interval(const double *base, const double *direction, double *low, double *high)
{
    *low = 0;
    *high = (double)INFINITY;
    for (int axis = 0; axis < 3; axis++) {
        const double a = (-1 - base[axis]) / direction[axis], b = (1 - base[axis]) / direction[axis];
        *low = fmax(*low, fmin(a, b));
        *high = fmin(*high, fmax(a, b));
    }
    return *low < *high;
}

static void isosurface_of_a_linear_field_is_its_plane(void **state)
{
    (void)state;
    for (int pass = 0; pass < 2 * TEST_KIND_COUNT; pass++) {
        frame_fixture f;
        int hits = 0, ambiguous = 0;
        set_up_frame(&f, (test_mesh_kind)(pass / 2), pass % 2);
        f.job.surface_count = 1;
        reference_scene *scene = reference_create(&f.job);
        for (int pixel = 0; pixel < 24 * 20; pixel++) {
            double base[3], d[3], low, high;
            reference_ray ray;
            render_camera_ray(&f.job.camera, pixel % 24, pixel / 24, base, d);
            reference_trace(scene, pixel % 24, pixel / 24, no_background, &ray);
            const double slope = 0.3 * d[0] - 0.7 * d[1] + 0.5 * d[2], z = (f.iso - test_linear_field(base)) / slope;
            const bool inside = compute_cube_interval(base, d, &low, &high) && z > low && z < high;
            assert_int_equal(ray.hit_count, inside);
            if (!inside) continue;
            hits++;
            if (ray.ambiguous) {
                /* On a warped face, the face's value is that of the bilinear patch. The patch and the two triangles
                 * differ by up to a tenth of a cell here, and a root between them is moved to the face. */
                assert_true(fabs(ray.hits[0].depth - z) < 0.1 * 2 / 3 * ray.hits[0].conditioning);
                ambiguous++;
                continue;
            }
            /* Bisection ends at an interval of 2^-36 of a cell. */
            assert_true(fabs(ray.hits[0].depth - z) < 2e-11);
            const double scale = (slope > 0 ? -1 : 1) / sqrt(0.83);
            assert_true(fabs(ray.hits[0].normal[0] - 0.3 * scale) < 1e-12);
            assert_true(fabs(ray.hits[0].normal[1] + 0.7 * scale) < 1e-12);
            assert_true(fabs(ray.rgba[0] - 0.25) < 1e-12 && ray.rgba[3] == 1);
        }
        assert_true(hits > 40);
        assert_true(ambiguous <= (pass / 2 == TEST_TETS ? 0 : hits / 10));
        reference_free(scene);
        test_view_free(&f.view);
    }
}

static void constant_extinction_follows_beers_law(void **state)
{
    (void)state;
    for (int pass = 0; pass < 2 * TEST_KIND_COUNT; pass++) {
        frame_fixture f;
        int met = 0;
        set_up_frame(&f, (test_mesh_kind)(pass / 2), pass % 2);
        f.job.volume_count = 1;
        reference_scene *scene = reference_create(&f.job);
        for (int pixel = 0; pixel < 24 * 20; pixel++) {
            double base[3], d[3], low, high;
            reference_ray ray;
            render_camera_ray(&f.job.camera, pixel % 24, pixel / 24, base, d);
            reference_trace(scene, pixel % 24, pixel / 24, no_background, &ray);
            if (!compute_cube_interval(base, d, &low, &high)) continue;
            met++;
            const double length = pass % 2 ? 1 : sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]),
                         step = f.job.step / length;
            const double count = ceil(high / step - 0.5) - ceil(low / step - 0.5);
            assert_true((double)ray.samples == count);
            const double clear = pow(1 - (double)opacity[0], count * f.job.step / f.transfer.unit_distance);
            assert_true(fabs(ray.volume_transmittance - clear) < 1e-12);
            assert_true(fabs(ray.rgba[1] - (1 - clear)) < 1e-12);
        }
        assert_true(met > 100);
        reference_free(scene);
        test_view_free(&f.view);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(crossings_of_unit_hex_match_slab_test),
        cmocka_unit_test(crossings_of_every_shape_are_even),
        cmocka_unit_test(intervals_of_lattices_tile_the_ray),
        cmocka_unit_test(linear_field_is_exact_in_every_cell),
        cmocka_unit_test(collapsed_prisms_are_pyramids),
        cmocka_unit_test(trilinear_field_is_exact_in_a_box),
        cmocka_unit_test(gradient_agrees_with_differences),
        cmocka_unit_test(face_values_are_continuous_with_the_interior),
        cmocka_unit_test(isosurface_of_a_linear_field_is_its_plane),
        cmocka_unit_test(constant_extinction_follows_beers_law),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
