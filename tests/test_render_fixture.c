/* Draws frames for the tests of the renderer and compares them with the reference.
 *
 * A ray is compared unless rounding may change the reference's result: the ray is within margin of an edge of a cell, a
 * face's value is within margin of an isovalue, a sample is within margin of an end of a cell, or a hit is within
 * margin of the eye. All other rays are excluded, and their fraction is bounded. Some rays are ambiguous: a cell has
 * several roots, or a warped face contradicts the interior of its cell (its value is that of the bilinear patch, its
 * position that of the two triangles). For ambiguous rays, only hit or miss is compared, not the depth. */
#include "test_render_fixture.h"

#include "comp.h"
#include "cpu.h"
#include "memory.h"
#include "render_isa.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

const float fixture_background[4] = {0.05f, 0.1f, 0.15f, 0.5f};

/* The usual bounds. Margin: float32 rounds positions near 1 by 6e-8, which is about 2e-7 of cells of size 1/3; a few
 * such errors make 1e-6. Excluded: a pixel's ray meets about 20 cells with 12 edges each, so the excluded fraction, 20
 * · 12 · 2e-6 · (1 / width of a cell in pixels), is below 1e-3. */
const fixture_bounds fixture_usual_bounds = {.depth = 1e-5, .colour = 1e-5, .excluded = 2e-3, .margin = 1e-6};

static const float surface_colours[4][3] = {
    {0.8f, 0.2f, 0.1f}, {0.1f, 0.7f, 0.3f}, {0.2f, 0.3f, 0.9f}, {0.9f, 0.8f, 0.2f}};
static const float transfer_colours[5][3] = {
    {0.1f, 0.2f, 0.8f}, {0.5f, 0.6f, 0.9f}, {0.9f, 0.9f, 0.9f}, {0.9f, 0.6f, 0.4f}, {0.7f, 0.1f, 0.1f}};
static const double tent_values[3] = {-0.6, 0, 0.6};
static const float tent_opacities[3] = {0, 0.8f, 0};

const char *fixture_camera_name(fixture_camera camera)
{
    static const char *const names[CAMERA_COUNT] = {"outside", "orthographic", "inside", "plane inside", "along x"};
    return names[camera];
}

void fixture_create(render_fixture *f, const test_mesh *meshes, int count, test_layout layout, double cell_size,
                    double scale, const double offset[3])
{
    memset(f, 0, sizeof *f);
    f->part_count = count;
    f->cell_size = cell_size;
    f->scale = scale;
    memcpy(f->offset, offset, sizeof f->offset);
    memcpy(f->job.space.origin, offset, sizeof f->offset);
    f->job.space.scale = ldexp(1, -1 - ilogb(scale));
    for (int i = 0; i < count; i++) {
        base_error error = {0};
        test_view_create(&meshes[i], layout, &f->views[i]);
        f->fields[i] = f->views[i].field;
        const insitu_status status = mmbvh_build(&f->views[i].cells, &f->fields[i], offset, f->job.space.scale,
                                                 &(mmbvh_options){.threads = 1}, &f->trees[i], &error);
        if (status != INSITU_OK) fail_msg("mmbvh_build: %s", error.message);
        /* A field exists only if its ranges are not NULL. A tree without nodes has no ranges, so any other numbers are
         * used. */
        f->ranges[i] = mmbvh_own_ranges(&f->trees[i]);
        if (!f->ranges[i].low) f->ranges[i] = mmbvh_pair_ranges((const float *)tent_opacities);
        f->parts[i] = (render_part){&f->views[i].cells, &f->trees[i], NULL};
    }
    f->lights[0] = (render_light){{0.6, 0.64, 0.48}, {0.9f, 0.8f, 0.7f}};
    f->lights[1] = (render_light){{-0.8, 0, 0.6}, {0.1f, 0.2f, 0.3f}};
    f->job.parts = f->parts;
    f->job.part_count = count;
    f->job.surfaces = f->surfaces;
    f->job.volumes = &f->volume;
    f->job.lights = f->lights;
    f->job.light_count = 2;
    f->job.step = cell_size;
    f->job.sample_group = 16;
    f->job.jitter = true;
    f->job.is_alone = true;
    f->job.threads = 1;
    fixture_set_camera(f, CAMERA_OUTSIDE, 48, 40);
}

void fixture_create_lattice(render_fixture *f, test_mesh_kind kind, int n, double jitter, test_function *field)
{
    test_mesh mesh;
    test_mesh_make_lattice(kind, n, jitter, field, &mesh);
    fixture_create(f, &mesh, 1, (test_layout){.wide_coordinates = true, .wide_values = true}, 2.0 / n, 1,
                   (const double[]){0, 0, 0});
    test_mesh_free(&mesh);
}

void fixture_free(render_fixture *f)
{
    for (int i = 0; i < f->part_count; i++) {
        test_view_free(&f->views[i]);
        mmbvh_free(&f->trees[i]);
    }
    memset(f, 0, sizeof *f);
}

void fixture_set_camera(render_fixture *f, fixture_camera camera, int width, int height)
{
    static const double views[CAMERA_COUNT][2][3] = {{{2.4, 1.6, 3.0}, {0, 0, 0}},
                                                     {{2.4, 1.6, 3.0}, {0, 0, 0}},
                                                     {{0.13, -0.21, 0.17}, {1, 0.3, -0.23}},
                                                     {{0.1, 0.05, 0.15}, {-1.1, -0.7, -1.9}},
                                                     {{3, 0, 0}, {0, 0, 0}}};
    double eye[3], focal[3], depth = 0;
    for (int axis = 0; axis < 3; axis++) {
        eye[axis] = views[camera][0][axis] * f->scale + f->offset[axis];
        focal[axis] = views[camera][1][axis] * f->scale + f->offset[axis];
    }
    render_camera *c = &f->job.camera;
    const double angle = camera == CAMERA_INSIDE ? 75 : 40;
    assert_true(render_camera_look_at(c, eye, focal, (const double[]){0, 1, 0}, angle, width, height));
    if (camera != CAMERA_OUTSIDE && camera != CAMERA_INSIDE) {
        c->is_orthographic = true;
        /* With this camera, the side of a pixel is 1/16, so that the middles of pixels are on lattice planes for n = 4
         * and images of odd height. */
        c->half_height = (camera == CAMERA_ALONG_X ? height / 32.0 : 1.5) * f->scale;
    }
    for (int axis = 0; axis < 3; axis++) depth += c->forward[axis] * (f->offset[axis] - c->eye[axis]);
    f->job.space.depth_origin = fmax(depth, 0);
}

void fixture_add_surface(render_fixture *f, const double *values, int count, float opacity)
{
    f->surfaces[f->job.surface_count++] =
        (render_surface_layer){.field = {f->fields, f->ranges},
                               .value_count = count,
                               .values = values,
                               .colours = surface_colours[0],
                               .opacity = opacity,
                               .material = {.ambient = 0.2f, .diffuse = 0.7f, .specular = 0.3f, .shininess = 12}};
}

void fixture_set_volume(render_fixture *f, double step)
{
    f->transfer = (render_transfer){.low = -0.7,
                                    .high = 0.7,
                                    .colour_count = 5,
                                    .colours = transfer_colours[0],
                                    .opacity_count = 3,
                                    .opacity_values = tent_values,
                                    .opacities = tent_opacities,
                                    .unit_distance = 0.3 * f->scale};
    f->volume = (render_volume_layer){{f->fields, f->ranges}, &f->transfer};
    f->job.volume_count = 1;
    f->job.step = step * f->cell_size;
}

void fixture_set_function(render_fixture *f, fixture_function *function, uint64_t seed, bool step, double most,
                          double unit)
{
    double *values = function->values;
    for (uint64_t i = 0; i < FIXTURE_POINTS; i++) {
        values[i] = step && i == 2 ? values[1] : 0.25 * (double)i + test_uniform_between(i, seed, 0.05, 0.2);
        function->opacities[i] = (float)test_uniform_between(i, seed + 1, 0, most);
    }
    for (uint64_t i = 0; i < 3 * FIXTURE_COLOURS; i++) function->colours[i] = (float)test_uniform(i, seed + 2);
    f->transfer = (render_transfer){.low = 0,
                                    .high = 1,
                                    .colour_count = FIXTURE_COLOURS,
                                    .colours = function->colours,
                                    .opacity_count = FIXTURE_POINTS,
                                    .opacity_values = values,
                                    .opacities = function->opacities,
                                    .unit_distance = unit};
}

double fixture_compute_scene_depth(const render_fixture *f, float t)
{
    return (double)t / f->job.space.scale + f->job.space.depth_origin;
}

static int compare_fragments(const void *left, const void *right)
{
    const fragment *a = left, *b = right;
    if (a->pixel != b->pixel) return a->pixel < b->pixel ? -1 : 1;
    if (a->t_in != b->t_in) return a->t_in < b->t_in ? -1 : 1;
    return (a->kind < b->kind) - (a->kind > b->kind);
}

static void build_pixel_index(drawn_frame *out, int64_t pixels)
{
    if (out->list.count) qsort(out->list.items, (size_t)out->list.count, sizeof *out->list.items, compare_fragments);
    out->first = malloc((size_t)(pixels + 1) * sizeof *out->first);
    int64_t at = 0;
    for (int64_t p = 0; p <= pixels; p++) {
        while (at < out->list.count && (int64_t)out->list.items[at].pixel < p) at++;
        out->first[p] = at;
    }
    assert_int_equal(out->first[pixels], out->list.count);
}

static int used_set = CPU_ISA_COUNT - 1;

int fixture_isa_count(void)
{
    return render_isa_level() + 1;
}

const char *fixture_isa_name(int set)
{
    return cpu_isa_name((cpu_isa)set);
}

void fixture_select_isa(int set)
{
    used_set = set;
    render_isa_limit(set);
}

bool fixture_isa_is_unavailable(void)
{
    const char *query = getenv("INSITU_ISA");
    const bool is_lacking = query && strcmp(query, render_isa()) != 0;
    if (is_lacking) fprintf(stderr, "skipped: %s\n", render_isa_warning());
    return is_lacking;
}

void fixture_draw(const render_fixture *f, drawn_frame *out)
{
    fixture_draw_distributed(f, 1, out);
}

void fixture_draw_distributed(const render_fixture *fixtures, int count, drawn_frame *out)
{
    const int width = fixtures[0].job.camera.width, height = fixtures[0].job.camera.height;
    const int64_t pixels = (int64_t)width * height;
    memset(out, 0, sizeof *out);
    for (int i = 0; i < count; i++) {
        base_error error = {0};
        if (render_frame(&fixtures[i].job, &out->list, &out->statistics, &error) != INSITU_OK)
            fail_msg("render_frame: %s", error.message);
    }
    build_pixel_index(out, pixels);
    out->picture = (image){.width = width,
                           .height = height,
                           .rgba = malloc((size_t)pixels * 4 * sizeof(float)),
                           .depth = malloc((size_t)pixels * sizeof(float))};
    for (int64_t p = 0; p < pixels; p++)
        comp_merge_pixel(out->list.items + out->first[p], out->first[p + 1] - out->first[p], fixture_background,
                         out->picture.rgba + 4 * p, out->picture.depth + p);
}

void drawn_frame_free(drawn_frame *drawn)
{
    free(drawn->picture.rgba);
    free(drawn->picture.depth);
    free(drawn->first);
    base_free(drawn->list.items);
    memset(drawn, 0, sizeof *drawn);
}

static void print_difference(const drawn_frame *a, const drawn_frame *b, int64_t p)
{
    const float *x = a->picture.rgba + 4 * p, *y = b->picture.rgba + 4 * p;
    fail_msg("pixel %d, %d: depth %.9g and %.9g, red %.9g and %.9g, green %.9g and %.9g, alpha %.9g and %.9g",
             (int)(p % a->picture.width), (int)(p / a->picture.width), (double)a->picture.depth[p],
             (double)b->picture.depth[p], (double)x[0], (double)y[0], (double)x[1], (double)y[1], (double)x[3],
             (double)y[3]);
}

void drawn_frame_assert_same_depths(const drawn_frame *a, const drawn_frame *b)
{
    const int64_t pixels = (int64_t)a->picture.width * a->picture.height;
    for (int64_t p = 0; p < pixels; p++)
        if (memcmp(a->picture.depth + p, b->picture.depth + p, sizeof(float))) print_difference(a, b, p);
}

void drawn_frame_assert_same(const drawn_frame *a, const drawn_frame *b)
{
    const int64_t pixels = (int64_t)a->picture.width * a->picture.height;
    drawn_frame_assert_same_depths(a, b);
    for (int64_t p = 0; p < pixels; p++)
        if (memcmp(a->picture.rgba + 4 * p, b->picture.rgba + 4 * p, 4 * sizeof(float))) print_difference(a, b, p);
}

double drawn_frame_find_largest_difference(const drawn_frame *a, const drawn_frame *b)
{
    const int64_t numbers = 4 * (int64_t)a->picture.width * a->picture.height;
    double worst = 0;
    for (int64_t i = 0; i < numbers; i++) {
        const double off = fabs((double)a->picture.rgba[i] - (double)b->picture.rgba[i]);
        worst = test_larger_error(worst, off);
    }
    return worst;
}

/* ---- comparison with the reference ---------------------------------------------------------------------------- */

typedef struct comparison {
    const render_fixture *f;
    const fixture_bounds *bounds;
    const char *what;
    const drawn_frame *drawn;
    fixture_outcome outcome;
} comparison;

/* Returns whether a ray is excluded because rounding may change its result. The margin of lights is one reason: a
 * highlight ends abruptly where its light is below the surface, and on which side the light is depends on the rounding
 * of the normal to float32. */
static bool is_excluded(const reference_ray *ray, double margin)
{
    return ray->light_margin < margin || ray->edge_margin < margin || ray->value_margin < margin ||
           ray->sample_margin < margin || ray->eye_margin < margin;
}

/* Lists the surface fragments of a pixel up to the first opaque one. Returns their number. */
static int list_surface_fragments(const drawn_frame *drawn, int64_t pixel, const fragment *hits[REFERENCE_MAX_HITS])
{
    int count = 0;
    for (int64_t i = drawn->first[pixel]; i < drawn->first[pixel + 1] && count < REFERENCE_MAX_HITS; i++) {
        const fragment *item = &drawn->list.items[i];
        if (item->kind < FRAGMENT_SURFACE) continue;
        hits[count++] = item;
        if (item->transmittance <= 0) break;
    }
    return count;
}

static void print_hits(const comparison *c, int x, int y, const reference_ray *ray, int count,
                       const fragment *const *hits)
{
    fprintf(stderr, "%s, pixel %d, %d: edge margin %.3g, value margin %.3g%s%s\n", c->what, x, y, ray->edge_margin,
            ray->value_margin, ray->ambiguous ? ", ambiguous" : "", ray->map_failed ? ", map failed" : "");
    for (int i = 0; i < ray->hit_count; i++)
        fprintf(stderr, "  reference: %.9g surface %d, conditioning %.3g, slowness %.3g\n", ray->hits[i].depth,
                ray->hits[i].surface, ray->hits[i].conditioning, ray->hits[i].slowness);
    for (int i = 0; i < count; i++)
        fprintf(stderr, "  kernels:   %.9g surface %u\n", fixture_compute_scene_depth(c->f, hits[i]->t_in),
                hits[i]->kind - FRAGMENT_SURFACE);
}

static void compare_hits(comparison *c, int x, int y, const reference_ray *ray)
{
    const fragment *hits[REFERENCE_MAX_HITS];
    const int count = list_surface_fragments(c->drawn, (int64_t)y * c->f->job.camera.width + x, hits);
    bool same = count == ray->hit_count;
    for (int i = 0; same && i < count; i++) same = hits[i]->kind - FRAGMENT_SURFACE == (uint32_t)ray->hits[i].surface;
    if (!same && !ray->ambiguous) {
        print_hits(c, x, y, ray, count, hits);
        fail_msg("%s: not the same hits", c->what);
    }
    c->outcome.hits += count > 0;
    double worst = 0;
    for (int i = 0; same && i < count; i++) {
        /* A position in float32 has an error of half a unit in the last place of 1, 6e-8 in scaled units or 1.2e-7 in
         * the scene. On a grazing ray, the conditioning turns an error across the surface into an error of depth; for
         * cells of 0.3, it exceeds the bound from a conditioning of 25 on. A value is rounded twice by 6e-8 of the
         * range, at the two ends of its interval, and a slowly varying field turns this into an error of depth. */
        const double grazing = fmax(1.2e-7 * ray->hits[i].conditioning / c->f->cell_size +
                                        1.2e-7 * ray->hits[i].slowness - c->bounds->depth,
                                    0);
        const double off = fabs(fixture_compute_scene_depth(c->f, hits[i]->t_in) - ray->hits[i].depth);
        c->outcome.total_depth += off / c->f->cell_size;
        worst = test_larger_error(worst, off / c->f->cell_size - grazing);
    }
    double *kept = ray->ambiguous ? &c->outcome.worst_ambiguous : &c->outcome.worst_depth;
    if (worst > *kept && !ray->ambiguous && worst > c->bounds->depth) print_hits(c, x, y, ray, count, hits);
    *kept = fmax(*kept, worst);
}

static void compare_colour(comparison *c, int x, int y, const reference_ray *ray)
{
    const float *rgba = c->drawn->picture.rgba + 4 * ((int64_t)y * c->f->job.camera.width + x);
    double worst = 0;
    for (int i = 0; i < 4; i++) {
        const double off = fabs((double)rgba[i] - ray->rgba[i]);
        worst = test_larger_error(worst, off);
    }
    if (!(worst <= c->bounds->colour) && !(worst <= c->outcome.worst_colour))
        fprintf(stderr, "%s, pixel %d, %d: %.7g %.7g %.7g %.7g, reference %.7g %.7g %.7g %.7g, %d samples\n", c->what,
                x, y, (double)rgba[0], (double)rgba[1], (double)rgba[2], (double)rgba[3], ray->rgba[0], ray->rgba[1],
                ray->rgba[2], ray->rgba[3], (int)ray->samples);
    if (!(worst <= c->outcome.worst_colour)) c->outcome.worst_colour = worst;
}

static void compare_ray(comparison *c, const reference_ray *ray, int x, int y)
{
    c->outcome.rays++;
    if (is_excluded(ray, c->bounds->margin)) {
        c->outcome.excluded++;
        return;
    }
    c->outcome.ambiguous += ray->ambiguous;
    compare_hits(c, x, y, ray);
    if (!ray->ambiguous) compare_colour(c, x, y, ray);
}

/* Computes the reference of each ray one time and compares the frames of all instruction sets with it. */
static void compare_rays(const render_job *job, comparison *sets, int count)
{
    reference_scene *scene = reference_create(job);
    for (int y = 0; y < job->camera.height; y++)
        for (int x = 0; x < job->camera.width; x++) {
            reference_ray ray;
            reference_trace(scene, x, y, fixture_background, &ray);
            for (int i = 0; i < count; i++) compare_ray(&sets[i], &ray, x, y);
        }
    reference_free(scene);
}

static void check_isa_outcome(const comparison *c, const char *set)
{
    const fixture_outcome *o = &c->outcome;
    if (getenv("INSITU_TEST_VERBOSE"))
        fprintf(stderr,
                "%s, %s: %d rays, %d hits, %d excluded, %d ambiguous; depth %.2g cells (ambiguous %.2g), colour %.2g\n",
                c->what, set, (int)o->rays, (int)o->hits, (int)o->excluded, (int)o->ambiguous, o->worst_depth,
                o->worst_ambiguous, o->worst_colour);
    if (!(o->worst_depth <= c->bounds->depth)) fail_msg("%s, %s: depth off by %g cells", c->what, set, o->worst_depth);
    if (!(o->worst_colour <= c->bounds->colour)) fail_msg("%s, %s: colour off by %g", c->what, set, o->worst_colour);
    if ((double)o->excluded > c->bounds->excluded * (double)o->rays + 1)
        fail_msg("%s: %d of %d rays excluded", c->what, (int)o->excluded, (int)o->rays);
}

fixture_outcome fixture_compare_with_reference(const render_fixture *f, const fixture_bounds *bounds, const char *what)
{
    drawn_frame drawn[CPU_ISA_COUNT];
    comparison sets[CPU_ISA_COUNT];
    const int count = fixture_isa_count(), used_before = used_set;
    for (int i = 0; i < count; i++) {
        fixture_select_isa(i);
        fixture_draw(f, &drawn[i]);
        sets[i] = (comparison){.f = f, .bounds = bounds, .what = what, .drawn = &drawn[i]};
    }
    fixture_select_isa(used_before);
    compare_rays(&f->job, sets, count);
    for (int i = 0; i < count; i++) {
        check_isa_outcome(&sets[i], fixture_isa_name(i));
        drawn_frame_free(&drawn[i]);
    }
    return sets[count - 1].outcome;
}
