/* Computes the true values. The adaptive integral takes only opacities. Extinctions that are linear between the knots
 * are given as a dense table of opacities: between points at a distance of 1/256 of a knot's interval, 1 - exp(-e)
 * differs from its chord by at most (ln 2 / 256)^2 / 8 = 9.2e-7 of opacity. */
#include "accuracy_reference.h"

#include <stdlib.h>

#include "reference_integral.h"

enum { DENSE = 256, DENSE_POINTS = (ACCURACY_KNOTS - 1) * DENSE + 1 };

/* Error allowed to the interval of a ray in one cell: the sum of a hundred intervals is less than float32's rounding of
 * a channel. */
static const double tolerance = 1e-10;

struct accuracy_reference {
    const accuracy_subject *subject;
    bench_pixels *pixels;
    int count;
    double *rgba[2]; /* one array for each accuracy_opacity: count × 4 */
    accuracy_scene surface;
    render_part kept;
    reference_scene *reference;
    reference_ray *rays; /* count elements */
};

static void *require_memory(void *p)
{
    if (!p) abort();
    return p;
}

static const float nothing[4] = {0, 0, 0, 0};

static void trace_surface(accuracy_reference *t)
{
    accuracy_scene_create_surface(&t->surface, t->subject);
    t->surface.job.parts = &t->kept;
    t->reference = reference_create(&t->surface.job);
    t->rays = require_memory(malloc((size_t)t->count * sizeof *t->rays));
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < t->count; i++) {
        int x, y;
        bench_pixels_position(t->pixels, i, &x, &y);
        reference_trace(t->reference, x, y, nothing, &t->rays[i]);
    }
}

static void make_dense(const accuracy_subject *s, double values[DENSE_POINTS], float opacities[DENSE_POINTS])
{
    for (int i = 0; i < DENSE_POINTS; i++) {
        const int knot = i / DENSE < ACCURACY_KNOTS - 1 ? i / DENSE : ACCURACY_KNOTS - 2;
        const double part = (double)i / DENSE - knot;
        const double low = -log1p(-(double)s->opacities[knot]), high = -log1p(-(double)s->opacities[knot + 1]);
        values[i] = s->knots[knot] + part * (s->knots[knot + 1] - s->knots[knot]);
        opacities[i] = (float)-expm1(-(low + part * (high - low)));
    }
}

static double *integrate_reference(const accuracy_reference *t, accuracy_opacity meaning)
{
    double values[DENSE_POINTS];
    float opacities[DENSE_POINTS];
    double *rgba = require_memory(malloc(4 * (size_t)t->count * sizeof *rgba));
    accuracy_scene scene;
    accuracy_scene_create_volume(&scene, t->subject);
    scene.job.parts = &t->kept;
    if (meaning == ACCURACY_EXTINCTION) {
        make_dense(t->subject, values, opacities);
        scene.transfer.opacity_count = DENSE_POINTS;
        scene.transfer.opacity_values = values;
        scene.transfer.opacities = opacities;
    }
    reference_integral *integral = reference_integral_create(&scene.job, tolerance);
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < t->count; i++) {
        int x, y;
        bench_pixels_position(t->pixels, i, &x, &y);
        reference_integral_trace(integral, x, y, nothing, NULL, 0, rgba + 4 * i);
    }
    reference_integral_free(integral);
    return rgba;
}

accuracy_reference *accuracy_reference_create(const accuracy_subject *subject, int block)
{
    accuracy_reference *t = require_memory(calloc(1, sizeof *t));
    t->subject = subject;
    t->pixels = bench_pixels_create(&subject->view.cells, &subject->camera, block);
    t->count = bench_pixels_count(t->pixels);
    t->kept = (render_part){bench_pixels_cells(t->pixels), NULL, NULL};
    trace_surface(t);
    t->rgba[ACCURACY_OPACITY] = integrate_reference(t, ACCURACY_OPACITY);
    t->rgba[ACCURACY_EXTINCTION] = integrate_reference(t, ACCURACY_EXTINCTION);
    return t;
}

void accuracy_reference_free(accuracy_reference *t)
{
    reference_free(t->reference);
    bench_pixels_destroy(t->pixels);
    free(t->rays);
    free(t->rgba[0]);
    free(t->rgba[1]);
    free(t);
}

const bench_pixels *accuracy_reference_pixels(const accuracy_reference *t)
{
    return t->pixels;
}

accuracy_error accuracy_compute_volume_error(const accuracy_reference *t, accuracy_opacity meaning, const float *rgba)
{
    const double *truth = t->rgba[meaning];
    accuracy_error e = {0, 0, 0, 0, (double)NAN};
    double sum = 0;
    for (int i = 0; i < t->count; i++) {
        if (!(truth[4 * i + 3] > 0)) continue;
        e.pixels++;
        for (int c = 4 * i; c < 4 * i + 4; c++) {
            const double off = fabs((double)rgba[c] - truth[c]);
            sum += off * off;
            if (!(off <= e.max)) e.max = off;
        }
    }
    if (e.pixels) e.rms = sqrt(sum / (4 * e.pixels));
    return e;
}

/* Returns whether the true hit is undefined. In a polyhedron, a quad's bilinear patch and the adjacent tets may be on
 * different sides of the isovalue; whether the surface lies between them is a matter of definition. In other cells,
 * hits are compared on ambiguous rays too. */
static bool is_undefined(const accuracy_reference *t, const reference_ray *ray)
{
    return ray->ambiguous && t->subject->mesh.face_count > 0;
}

accuracy_error accuracy_compute_surface_error(const accuracy_reference *t, const double *depths)
{
    accuracy_error e = {0, 0, 0, 0, t->subject->mesh.face_count ? (double)NAN : 0};
    double sum = 0;
    int same = 0;
    for (int i = 0; i < t->count; i++) {
        const reference_hit *hit = t->rays[i].hit_count ? &t->rays[i].hits[0] : NULL;
        if ((!hit && !isfinite(depths[i])) || is_undefined(t, &t->rays[i])) continue;
        e.pixels += hit != NULL;
        const double off =
            hit ? fabs(depths[i] - hit->depth) / accuracy_compute_box_size(t->kept.cells, hit->cell) : (double)INFINITY;
        if (!(off <= 1)) {
            e.wrong++;
            continue;
        }
        int x, y;
        double slope;
        same++;
        sum += off * off;
        e.max = fmax(e.max, off);
        if (isnan(e.residual)) continue;
        bench_pixels_position(t->pixels, i, &x, &y);
        e.residual =
            fmax(e.residual, fabs(reference_compute_residual(t->reference, x, y, hit, depths[i], &slope, NULL)));
    }
    if (same) e.rms = sqrt(sum / same);
    return e;
}
