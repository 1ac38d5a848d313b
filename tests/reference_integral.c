/* Integrates the light of volumes adaptively. The ray is cut at every depth at which a cell begins or ends or a
 * polyhedron's profile bends (reference_cell.h), because only there may a peak be too narrow for any sample. Between
 * two cuts all cells of all volume layers emit and absorb together: their extinctions add up, and so do their
 * emissions. Boole's rule integrates an interval as a whole and in two halves. If the two results differ by more than
 * the tolerance, each half is integrated in turn.
 *
 * The ray is also cut where the field reaches a control point of the opacity, since the field may stay beyond it for
 * too short a distance for any sampling. These depths are searched between samples and the extremes next to them. Kinks
 * of the colours are found by halving. */
#include "reference_integral.h"

#include "reference_base.h"
#include "reference_cell.h"
#include "reference_polyhedron.h"

#include <math.h>
#include <stdlib.h>

typedef struct camera_cell {
    reference_cell cell;
    reference_box box;
    double values[REFERENCE_MAX_VERTICES];
    const render_transfer *transfer;
} camera_cell;

struct reference_integral {
    const render_job *job;
    double tolerance;
    int64_t count;
    camera_cell *cells;
};

/* The interval of the ray inside a cell of a layer. */
typedef struct cell_interval {
    const camera_cell *cell;
    double z_in, z_out;
    reference_crossing ends[2];
} cell_interval;

/* Colour C and transmittance T of an interval of the ray. */
typedef struct light {
    double colour[3], transmittance;
} light;

/* The integrand at one depth. */
typedef struct sample {
    double extinction, emission[3]; /* per unit of z */
} sample;

typedef struct active_intervals {
    const reference_integral *scene;
    int64_t count;
    const cell_interval **active; /* the intervals that contain the depth, `count` of them */
    reference_line line;
    double length; /* length of the ray per unit of z */
} active_intervals;

static void add_cell(reference_integral *scene, int volume, int part, int64_t index)
{
    const render_job *job = scene->job;
    const grid *g = job->parts[part].cells;
    const render_field *field = &job->volumes[volume].field;
    const double *axes[3] = {job->camera.right, job->camera.up, job->camera.forward};
    int64_t vertices[REFERENCE_MAX_VERTICES];
    camera_cell *c = &scene->cells[scene->count];
    if (grid_is_ghost(g, index) || !field->ranges[part].low) return;
    c->box = reference_empty_box;
    c->transfer = job->volumes[volume].transfer;
    c->cell.type = grid_cell_type(g, index);
    if (c->cell.type == GRID_POLYHEDRON)
        reference_polyhedron_read(g, index, &c->cell, vertices);
    else
        c->cell.count = grid_cell_vertices(g, index, vertices);
    if (!grid_cell_values(&field->fields[part], index, vertices, c->cell.count, c->values)) return;
    for (int i = 0; i < c->cell.count; i++) {
        double from_eye[3];
        grid_read_vertex_position(g, vertices[i], c->cell.world[i]);
        for (int axis = 0; axis < 3; axis++) from_eye[axis] = c->cell.world[i][axis] - job->camera.eye[axis];
        for (int axis = 0; axis < 3; axis++) c->cell.position[i][axis] = reference_dot(axes[axis], from_eye);
        reference_box_add(&c->box, c->cell.position[i]);
    }
    if (c->cell.type == GRID_POLYHEDRON) reference_polyhedron_setup(&c->cell);
    scene->count++;
}

static int64_t count_drawn(const render_job *job)
{
    int64_t count = 0;
    for (int part = 0; part < job->part_count; part++)
        for (int64_t cell = 0; cell < job->parts[part].cells->cell_count; cell++)
            count += !grid_is_ghost(job->parts[part].cells, cell);
    return count;
}

reference_integral *reference_integral_create(const render_job *job, double tolerance)
{
    reference_integral *scene = reference_reallocate(NULL, sizeof *scene);
    const size_t most = (size_t)count_drawn(job) * (size_t)job->volume_count;
    *scene = (reference_integral){job, tolerance, 0, reference_reallocate(NULL, most * sizeof(camera_cell))};
    for (int volume = 0; volume < job->volume_count; volume++)
        for (int part = 0; part < job->part_count; part++)
            for (int64_t cell = 0; cell < job->parts[part].cells->cell_count; cell++)
                add_cell(scene, volume, part, cell);
    return scene;
}

void reference_integral_free(reference_integral *scene)
{
    if (scene) free(scene->cells);
    free(scene);
}

static double interpolate_value(const cell_interval *s, const reference_line *line, double z)
{
    const camera_cell *placed = s->cell;
    const double point[3] = {line->base[0] + line->slope[0] * z, line->base[1] + line->slope[1] * z, z};
    double value;
    if (placed->cell.type == GRID_POLYHEDRON)
        reference_compute_profile_value(&placed->cell, line, s->ends, placed->values, z, &value);
    else
        reference_interpolate(&placed->cell, point, placed->values, &value, NULL);
    return value;
}

static void add_sample_to_sums(const active_intervals *c, const cell_interval *s, double z, sample *sum)
{
    const camera_cell *placed = s->cell;
    const double value = interpolate_value(s, &c->line, z);
    double colour[3];
    const double clear = -log1p(-fmin(reference_compute_opacity(placed->transfer, value), 1 - 1e-15));
    const double extinction = clear * c->length / placed->transfer->unit_distance;
    reference_compute_colour(placed->transfer, value, colour);
    sum->extinction += extinction;
    for (int k = 0; k < 3; k++) sum->emission[k] += extinction * colour[k];
}

static sample compute_sample(const active_intervals *c, double z)
{
    sample sum = {0};
    for (int64_t i = 0; i < c->count; i++) add_sample_to_sums(c, c->active[i], z, &sum);
    return sum;
}

/* Integrates five equidistant samples by Boole's rule. The extinction and the emission are replaced by the quartics
 * through the samples; the optical depth up to each sample is the exact integral of its quartic. */
static light integrate_by_boole(const sample s[5], double width)
{
    static const double up_to[5][5] = {{0, 0, 0, 0, 0},
                                       {251 / 2880.0, 646 / 2880.0, -264 / 2880.0, 106 / 2880.0, -19 / 2880.0},
                                       {29 / 360.0, 124 / 360.0, 24 / 360.0, 4 / 360.0, -1 / 360.0},
                                       {27 / 320.0, 102 / 320.0, 72 / 320.0, 42 / 320.0, -3 / 320.0},
                                       {7 / 90.0, 32 / 90.0, 12 / 90.0, 32 / 90.0, 7 / 90.0}};
    light out = {{0, 0, 0}, 1};
    for (int i = 0; i < 5; i++) {
        double depth = 0;
        for (int k = 0; k < 5; k++) depth += width * up_to[i][k] * s[k].extinction;
        out.transmittance = exp(-depth);
        for (int c = 0; c < 3; c++) out.colour[c] += width * up_to[4][i] * s[i].emission[c] * out.transmittance;
    }
    return out;
}

static light blend_over(const light *front, const light *back)
{
    light out = {{0, 0, 0}, front->transmittance * back->transmittance};
    for (int c = 0; c < 3; c++) out.colour[c] = front->colour[c] + front->transmittance * back->colour[c];
    return out;
}

static double compute_light_difference(const light *a, const light *b)
{
    double most = fabs(a->transmittance - b->transmittance);
    for (int c = 0; c < 3; c++) most = fmax(most, fabs(a->colour[c] - b->colour[c]));
    return most;
}

/* Integrates the light between two depths to the tolerance. s holds the samples at both ends, at the quarters and in
 * the middle. */
static light integrate_adaptively(const active_intervals *c, double from, double to, const sample s[5],
                                  double tolerance, int depth)
{
    const double middle = 0.5 * (from + to), width = to - from;
    sample left[5] = {s[0], compute_sample(c, from + width / 8), s[1], compute_sample(c, from + 3 * width / 8), s[2]};
    sample right[5] = {s[2], compute_sample(c, from + 5 * width / 8), s[3], compute_sample(c, from + 7 * width / 8),
                       s[4]};
    light a = integrate_by_boole(left, 0.5 * width), b = integrate_by_boole(right, 0.5 * width);
    const light whole = integrate_by_boole(s, width), halves = blend_over(&a, &b);
    if ((compute_light_difference(&whole, &halves) <= tolerance && depth >= 2) || depth > 40) return halves;
    a = integrate_adaptively(c, from, middle, left, 0.5 * tolerance, depth + 1);
    b = integrate_adaptively(c, middle, to, right, 0.5 * tolerance, depth + 1);
    return blend_over(&a, &b);
}

static light integrate_light(const active_intervals *c, double from, double to)
{
    sample s[5];
    for (int i = 0; i < 5; i++) s[i] = compute_sample(c, from + (to - from) * i / 4);
    return integrate_adaptively(c, from, to, s, c->scene->tolerance, 0);
}

static bool is_box_near_line(const reference_cell *cell, const reference_line *line)
{
    for (int axis = 0; axis < 2; axis++) {
        bool below = false, above = false;
        for (int i = 0; i < cell->count; i++) {
            const double *p = cell->position[i];
            const double u = p[axis] - line->base[axis] - line->slope[axis] * p[2];
            below = below || u <= 1e-9;
            above = above || u >= -1e-9;
        }
        if (!below || !above) return false;
    }
    return true;
}

/* Collects the intervals of the cells that the ray crosses in front of the eye. */
static cell_interval *collect_intervals(const reference_integral *scene, const reference_line *line, int64_t *count)
{
    cell_interval *list = NULL;
    int64_t capacity = 0;
    *count = 0;
    for (int64_t i = 0; i < scene->count; i++) {
        reference_crossing crossings[REFERENCE_MAX_CROSSINGS];
        const reference_cell *cell = &scene->cells[i].cell;
        const bool may_pass =
            reference_box_is_near(&scene->cells[i].box, line, 0, 1e-9) && is_box_near_line(cell, line);
        const int found = may_pass ? reference_find_crossings(cell, line, crossings) : 0;
        for (int k = 0; k + 1 < found; k += 2) {
            if (!(crossings[k + 1].z > fmax(crossings[k].z, 0))) continue;
            if (*count == capacity)
                list = reference_reallocate(list, (size_t)(capacity = 2 * capacity + 64) * sizeof *list);
            list[(*count)++] = (cell_interval){
                &scene->cells[i], fmax(crossings[k].z, 0), crossings[k + 1].z, {crossings[k], crossings[k + 1]}};
        }
    }
    return list;
}

static active_intervals begin_ray(const reference_integral *scene, int x, int y)
{
    const render_camera *camera = &scene->job->camera;
    const double *axes[2] = {camera->right, camera->up};
    active_intervals c = {.scene = scene};
    double base[3], direction[3], from_eye[3];
    render_camera_ray(camera, x, y, base, direction);
    for (int axis = 0; axis < 3; axis++) from_eye[axis] = base[axis] - camera->eye[axis];
    for (int axis = 0; axis < 2; axis++) {
        c.line.base[axis] = reference_dot(axes[axis], from_eye);
        c.line.slope[axis] = reference_dot(axes[axis], direction);
    }
    c.length = camera->is_orthographic ? 1 : sqrt(reference_dot(direction, direction));
    return c;
}

static void blend_hit(light *sum, const reference_hit *hit)
{
    light surface = {{0, 0, 0}, 1 - hit->opacity};
    for (int c = 0; c < 3; c++) surface.colour[c] = hit->opacity * hit->colour[c];
    *sum = blend_over(sum, &surface);
}

static int compare_numbers(const void *left, const void *right)
{
    const double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

/* Finds the depths at which the interval begins, bends and ends. Returns the number of depths. */
static int find_interval_cuts(const cell_interval *s, const reference_line *line, double z[REFERENCE_MAX_BREAKS])
{
    z[0] = s->z_in;
    z[1] = s->z_out;
    if (s->cell->cell.type != GRID_POLYHEDRON) return 2;
    double breaks[REFERENCE_MAX_BREAKS];
    const int count = reference_find_profile_breaks(&s->cell->cell, line, s->ends, breaks);
    int cuts = 2;
    for (int i = 1; i + 1 < count; i++)
        if (breaks[i] > s->z_in) z[cuts++] = breaks[i];
    return cuts;
}

/* A growing list of depths. */
typedef struct places {
    double *z;
    int64_t count, capacity;
} places;

static void add_depth(places *list, double z)
{
    if (list->count == list->capacity)
        list->z = reference_reallocate(list->z, (size_t)(list->capacity = 2 * list->capacity + 64) * sizeof *list->z);
    list->z[list->count++] = z;
}

/* Adds the two depths between which the value crosses x, found by bisection: the value is on one side of x up to the
 * first depth, and on the other side from the second depth on. */
static void add_crossing(const cell_interval *s, const reference_line *line, double low, double high, double x,
                         places *out)
{
    const bool rises = interpolate_value(s, line, low) < x;
    for (int i = 0; i < 60; i++) {
        const double middle = 0.5 * (low + high);
        if ((interpolate_value(s, line, middle) < x) == rises)
            low = middle;
        else
            high = middle;
    }
    add_depth(out, low);
    add_depth(out, high);
}

/* Returns the greatest (sign 1) or the least (sign -1) value between two depths, by golden-section search. */
static double find_extreme_value(const cell_interval *s, const reference_line *line, double low, double high,
                                 double sign)
{
    const double golden = 0.6180339887498949;
    double a = high - golden * (high - low), b = low + golden * (high - low);
    double at_a = sign * interpolate_value(s, line, a), at_b = sign * interpolate_value(s, line, b);
    for (int i = 0; i < 60; i++) {
        if (at_a < at_b) {
            low = a, a = b, at_a = at_b;
            b = low + golden * (high - low);
            at_b = sign * interpolate_value(s, line, b);
        } else {
            high = b, b = a, at_b = at_a;
            a = high - golden * (high - low);
            at_a = sign * interpolate_value(s, line, a);
        }
    }
    return 0.5 * (low + high);
}

static void add_crossings(const cell_interval *s, const reference_line *line, double from, double to, places *out)
{
    const render_transfer *t = s->cell->transfer;
    const double a = interpolate_value(s, line, from), b = interpolate_value(s, line, to);
    for (int i = 0; i < t->opacity_count; i++) {
        const double x = t->opacity_values[i];
        if ((i && x == t->opacity_values[i - 1]) || (a < x) == (b < x)) continue;
        add_crossing(s, line, from, to, x, out);
    }
}

/* Adds the depths at which the field reaches a control point of the opacity, between two depths from and to between
 * which the profile does not bend. */
static void add_points(const cell_interval *s, const reference_line *line, double from, double to, places *out)
{
    enum { SAMPLES = 48 };
    const render_transfer *t = s->cell->transfer;
    const int type = s->cell->cell.type, count = type == GRID_TET || type == GRID_POLYHEDRON ? 1 : SAMPLES;
    double value[SAMPLES + 1], low = INFINITY, high = -INFINITY;
    bool is_met = false;
    for (int i = 0; i < s->cell->cell.count; i++) {
        low = fmin(low, s->cell->values[i]);
        high = fmax(high, s->cell->values[i]);
    }
    for (int i = 0; i < t->opacity_count; i++)
        is_met = is_met || (low <= t->opacity_values[i] && t->opacity_values[i] <= high);
    if (!is_met) return;
    for (int i = 0; i <= count; i++) value[i] = interpolate_value(s, line, from + (to - from) * i / count);
    double last = from;
    for (int i = 0; i <= count; i++) {
        /* Searches for an extreme near sample i. Near the first and the last sample, the extreme may lie between that
         * sample and its only neighbour. */
        const int before = i ? i - 1 : 0, after = i < count ? i + 1 : count;
        const bool is_top = value[i] >= fmax(value[before], value[after]);
        const bool is_bottom = value[i] <= fmin(value[before], value[after]);
        if (count > 1 && is_top != is_bottom) {
            const double top = find_extreme_value(s, line, from + (to - from) * before / count,
                                                  from + (to - from) * after / count, is_top ? 1 : -1);
            if (top > last) add_crossings(s, line, last, top, out);
            last = fmax(last, top);
        }
        const double z = from + (to - from) * i / count;
        if (z > last) add_crossings(s, line, last, z, out);
        last = fmax(last, z);
    }
}

/* Returns the sorted depths at which an interval begins, bends, reaches a control point of the opacity or ends. */
static double *find_cuts(const cell_interval *list, int64_t count, const reference_line *line,
                         const reference_hit *hits, int hit_count, int64_t *cuts)
{
    places all = {0};
    for (int64_t i = 0; i < count; i++) {
        double own[REFERENCE_MAX_BREAKS];
        const int more = find_interval_cuts(&list[i], line, own);
        if (more > 2) qsort(own, (size_t)more, sizeof *own, compare_numbers);
        for (int k = 0; k < more; k++) add_depth(&all, own[k]);
        for (int k = 0; k + 1 < more; k++)
            if (own[k] < own[k + 1]) add_points(&list[i], line, own[k], own[k + 1], &all);
    }
    for (int i = 0; i < hit_count; i++) add_depth(&all, hits[i].depth);
    if (all.count) qsort(all.z, (size_t)all.count, sizeof *all.z, compare_numbers);
    *cuts = all.count;
    return all.z;
}

static void find_active_intervals(active_intervals *c, const cell_interval *list, int64_t count, double from, double to)
{
    c->count = 0;
    for (int64_t i = 0; i < count; i++)
        if (list[i].z_in <= from && list[i].z_out >= to) c->active[c->count++] = &list[i];
}

/* Returns whether no clip that the job applies to volumes removes the point of the ray at depth z. */
static bool is_depth_unclipped(const active_intervals *c, double z)
{
    const render_job *job = c->scene->job;
    const render_camera *camera = &job->camera;
    const double x = c->line.base[0] + c->line.slope[0] * z, y = c->line.base[1] + c->line.slope[1] * z;
    for (int i = 0; i < job->clip_count; i++) {
        const render_clip *clip = &job->clips[i];
        double square = 0, along = 0;
        bool is_in_box = true;
        for (int a = 0; a < 3; a++) {
            const double place = camera->eye[a] + x * camera->right[a] + y * camera->up[a] + z * camera->forward[a];
            square += (place - clip->centre[a]) * (place - clip->centre[a]);
            along += place * clip->normal[a];
            is_in_box = is_in_box && clip->lower[a] <= place && place <= clip->upper[a];
        }
        const bool is_within = clip->kind == RENDER_CLIP_SPHERE  ? square <= clip->radius * clip->radius
                               : clip->kind == RENDER_CLIP_PLANE ? along <= clip->distance
                                                                 : is_in_box;
        if (job->volume_clips >> i & 1 && is_within == clip->is_outside) return false;
    }
    return true;
}

void reference_integral_trace(const reference_integral *scene, int x, int y, const float background[4],
                              const reference_hit *hits, int hit_count, double rgba[4])
{
    active_intervals c = begin_ray(scene, x, y);
    light sum = {{0, 0, 0}, 1};
    int64_t count, cuts;
    int next = 0;
    cell_interval *list = collect_intervals(scene, &c.line, &count);
    double *z = find_cuts(list, count, &c.line, hits, hit_count, &cuts);
    c.active = reference_reallocate(NULL, (size_t)count * sizeof *c.active);
    for (int64_t i = 0; i < cuts && sum.transmittance > 0; i++) {
        for (; next < hit_count && hits[next].depth <= z[i]; next++) blend_hit(&sum, &hits[next]);
        if (i + 1 == cuts || !(z[i] < z[i + 1]) || !is_depth_unclipped(&c, 0.5 * (z[i] + z[i + 1]))) continue;
        find_active_intervals(&c, list, count, z[i], z[i + 1]);
        if (!c.count) continue;
        const light part = integrate_light(&c, z[i], z[i + 1]);
        sum = blend_over(&sum, &part);
    }
    for (int k = 0; k < 3; k++) rgba[k] = sum.colour[k] + sum.transmittance * (double)background[k];
    rgba[3] = 1 - sum.transmittance * (1 - (double)background[3]);
    free(z);
    free(c.active);
    free(list);
}
