/* The brute-force renderer. It transforms all vertices to camera coordinates in double one time. Then, for each ray, it
 * computes the intervals [z_in, z_out) of every cell that is not a ghost and whose sheared box contains the ray. An
 * interval contains hits of the surface layers and the samples of the volume layers at depths in [z_in, z_out). All
 * hits and samples of a ray are gathered, sorted by depth and blended. Cells that the ray misses contribute only to the
 * margins. */
#include "reference_render.h"

#include "reference_base.h"
#include "reference_cell.h"
#include "reference_polyhedron.h"

#include <stdlib.h>
#include <string.h>

/* A hit or a sample on the ray; a sample stores its own colour. */
typedef struct event {
    double depth;
    bool is_sample;
    int order; /* of a hit: surface id; of a sample: index of the volume layer */
    double transmittance;
    double error_bound; /* for a hit: cell size times conditioning, the scale of the depth's rounding error */
    reference_hit hit;  /* for a sample only the colour is set */
} event;

struct reference_scene {
    const render_job *job;
    double **positions;    /* vertices of each part in camera coordinates, × 3 */
    reference_box **boxes; /* boxes of each part's cells in camera coordinates; unset for ghosts */
};

/* The state of one ray. */
typedef struct trace {
    const reference_scene *scene;
    reference_line line;
    double direction[3]; /* in world coordinates; its component along forward is 1 */
    double length;       /* length of `direction` if distances are measured along the ray, else 1 */
    double jitter;
    int64_t count, capacity;
    event *events;
    reference_ray *out;
} trace;

/* A cell on a ray, and its part. */
typedef struct camera_cell {
    const render_part *part;
    int part_index;
    int64_t index;
    int64_t vertices[REFERENCE_MAX_VERTICES];
    reference_cell cell;
    reference_crossing ends[2]; /* ends of the interval that is traced at present */
    double size;
} camera_cell;

static bool normalize_vector(double *v)
{
    const double length = sqrt(reference_dot(v, v));
    for (int axis = 0; axis < 3 && length > 0; axis++) v[axis] /= length;
    return length > 0;
}

static reference_box *bound_cells(const grid *g, const double *positions)
{
    reference_box *boxes = reference_reallocate(NULL, sizeof *boxes * (size_t)g->cell_count);
    for (int64_t cell = 0; cell < g->cell_count; cell++) {
        int64_t vertex;
        if (grid_is_ghost(g, cell)) continue;
        boxes[cell] = reference_empty_box;
        grid_walk walk = grid_walk_cell(g, cell);
        while (grid_walk_next(&walk, &vertex)) reference_box_add(&boxes[cell], positions + 3 * vertex);
    }
    return boxes;
}

reference_scene *reference_create(const render_job *job)
{
    const double *axes[3] = {job->camera.right, job->camera.up, job->camera.forward};
    reference_scene *scene = reference_reallocate(NULL, sizeof *scene);
    scene->job = job;
    scene->positions = reference_reallocate(NULL, sizeof *scene->positions * (size_t)job->part_count);
    scene->boxes = reference_reallocate(NULL, sizeof *scene->boxes * (size_t)job->part_count);
    for (int i = 0; i < job->part_count; i++) {
        const grid *g = job->parts[i].cells;
        double *p = scene->positions[i] = reference_reallocate(NULL, 3 * sizeof *p * (size_t)g->vertex_count);
        for (int64_t v = 0; v < g->vertex_count; v++) {
            double world[3];
            grid_read_vertex_position(g, v, world);
            for (int axis = 0; axis < 3; axis++) world[axis] -= job->camera.eye[axis];
            for (int axis = 0; axis < 3; axis++) p[3 * v + axis] = reference_dot(axes[axis], world);
        }
        scene->boxes[i] = bound_cells(g, p);
    }
    return scene;
}

void reference_free(reference_scene *scene)
{
    if (!scene) return;
    for (int i = 0; i < scene->job->part_count; i++) {
        free(scene->positions[i]);
        free(scene->boxes[i]);
    }
    free(scene->positions);
    free(scene->boxes);
    free(scene);
}

static event *add_event(trace *t)
{
    if (t->count == t->capacity) {
        t->capacity = 2 * t->capacity + 64;
        t->events = reference_reallocate(t->events, (size_t)t->capacity * sizeof *t->events);
    }
    event *e = &t->events[t->count++];
    memset(e, 0, sizeof *e);
    return e;
}

static void lower_margin(double *margin, double by)
{
    *margin = fmin(*margin, by);
}

/* ---- surfaces ---- */

static void shade_hit(const trace *t, const render_material *m, const double base[3], const double normal[3],
                      double colour[3])
{
    double view[3] = {-t->direction[0], -t->direction[1], -t->direction[2]};
    double diffuse[3], specular[3] = {0, 0, 0};
    normalize_vector(view);
    for (int c = 0; c < 3; c++) diffuse[c] = (double)m->ambient;
    for (int i = 0; i < t->scene->job->light_count; i++) {
        const render_light *light = &t->scene->job->lights[i];
        double half[3];
        for (int axis = 0; axis < 3; axis++) half[axis] = light->direction[axis] + view[axis];
        normalize_vector(half);
        const double cosine = reference_dot(normal, light->direction), facing = fmax(0, cosine);
        const double shine = cosine > 0 ? pow(fmax(0, reference_dot(normal, half)), (double)m->shininess) : 0;
        /* a normal of length 0 means that the ray is ambiguous */
        const bool has_normal = reference_dot(normal, normal) > 0;
        if (m->specular > 0 && has_normal) lower_margin(&t->out->light_margin, fabs(cosine));
        for (int c = 0; c < 3; c++) {
            diffuse[c] += (double)light->colour[c] * (double)m->diffuse * facing;
            specular[c] += (double)light->colour[c] * (double)m->specular * shine;
        }
    }
    for (int c = 0; c < 3; c++) colour[c] = base[c] * diffuse[c] + specular[c];
}

static void compute_ray_point(const trace *t, double z, double point[3])
{
    for (int axis = 0; axis < 2; axis++) point[axis] = t->line.base[axis] + t->line.slope[axis] * z;
    point[2] = z;
}

static double find_value_on_ray(trace *t, const camera_cell *c, const double *values, double z)
{
    double point[3], value;
    compute_ray_point(t, z, point);
    const bool is_found = c->cell.type == GRID_POLYHEDRON
                              ? reference_compute_profile_value(&c->cell, &t->line, c->ends, values, z, &value)
                              : reference_interpolate(&c->cell, point, values, &value, NULL);
    if (!is_found) t->out->map_failed = true;
    return value;
}

/* Finds the depth of the root between the interval's ends by bisection. side_in: whether the value at z_in is at least
 * iso. */
static double bisect_root(trace *t, const camera_cell *c, const double *values, double iso, double z_in, double z_out,
                          bool side_in)
{
    double low = z_in, high = z_out;
    for (int step = 0; step < 36; step++) {
        const double middle = 0.5 * (low + high);
        if (middle <= low || middle >= high) break;
        if ((find_value_on_ray(t, c, values, middle) >= iso) == side_in)
            low = middle;
        else
            high = middle;
    }
    return 0.5 * (low + high);
}

/* ---- all crossings of a surface ---- */

typedef struct crossing_search {
    trace *t;
    const camera_cell *c;
    const double *values;
    double iso, range;
} crossing_search;

static double compute_relative_value_on_ray(const crossing_search *a, double z)
{
    return find_value_on_ray(a->t, a->c, a->values, z) - a->iso;
}

/* Finds the depth in [low, high] at which `side` times the field is least, by golden-section search. */
static double find_minimum(const crossing_search *a, double low, double high, double side)
{
    const double golden = 0.6180339887498949;
    double x = high - golden * (high - low), y = low + golden * (high - low);
    double at_x = side * compute_relative_value_on_ray(a, x), at_y = side * compute_relative_value_on_ray(a, y);
    for (int i = 0; i < 40; i++) {
        if (at_x < at_y) {
            high = y;
            y = x;
            at_y = at_x;
            x = high - golden * (high - low);
            at_x = side * compute_relative_value_on_ray(a, x);
        } else {
            low = x;
            x = y;
            at_x = at_y;
            y = low + golden * (high - low);
            at_y = side * compute_relative_value_on_ray(a, y);
        }
    }
    return 0.5 * (low + high);
}

enum { CROSSING_PIECES = 24 };

/* Computes depths between which the field crosses the isovalue at most once: evenly spaced depths, and the minimum of
 * every dip towards the isovalue between two neighbouring depths on the same side. */
static int find_crossing_depths(const crossing_search *a, double z_in, double z_out, double *z, double *v)
{
    double at[CROSSING_PIECES + 1], f[CROSSING_PIECES + 1];
    int n = 0;
    for (int i = 0; i <= CROSSING_PIECES; i++) {
        at[i] = z_in + (z_out - z_in) * i / CROSSING_PIECES;
        f[i] = compute_relative_value_on_ray(a, at[i]);
    }
    for (int i = 0; i <= CROSSING_PIECES; i++) {
        z[n] = at[i];
        v[n++] = f[i];
        const int before = i > 0 ? i - 1 : 0, behind = i + 2 <= CROSSING_PIECES ? i + 2 : CROSSING_PIECES;
        if (i == CROSSING_PIECES || (f[i] < 0) != (f[i + 1] < 0)) continue;
        /* A dip is an interval at whose two ends the slopes have opposite signs. */
        const double side = f[i] < 0 ? -1 : 1;
        const bool falls = before == i || side * (f[i] - f[before]) <= 0;
        const bool rises = behind == i + 1 || side * (f[behind] - f[i + 1]) >= 0;
        if (!falls || !rises) continue;
        z[n] = find_minimum(a, at[i], at[i + 1], side);
        v[n] = compute_relative_value_on_ray(a, z[n]);
        lower_margin(&a->t->out->value_margin, fabs(v[n]) / a->range);
        n++;
    }
    return n;
}

/* Finds the depths at which a polyhedron's profile bends; the profile is linear between two of them. A bend whose value
 * is near the isovalue lowers the margin, since rounding decides on which side of the isovalue it is. */
static int find_profile_depths(const crossing_search *a, double z[REFERENCE_MAX_BREAKS], double v[REFERENCE_MAX_BREAKS])
{
    const int count = reference_find_profile_breaks(&a->c->cell, &a->t->line, a->c->ends, z);
    for (int i = 0; i < count; i++) {
        v[i] = compute_relative_value_on_ray(a, z[i]);
        lower_margin(&a->t->out->value_margin, fabs(v[i]) / a->range);
    }
    return count;
}

static void lower_margin_near_sheets(trace *t, const camera_cell *c, double z)
{
    double point[3];
    compute_ray_point(t, z, point);
    lower_margin(&t->out->value_margin, reference_compute_sheet_distance(&c->cell, point) / c->size);
}

static void compute_value_range(const double *values, int count, double *low, double *high)
{
    *low = *high = values[0];
    for (int i = 1; i < count; i++) {
        *low = fmin(*low, values[i]);
        *high = fmax(*high, values[i]);
    }
}

static void transform_to_world(const render_camera *camera, const double v[3], double world[3])
{
    for (int axis = 0; axis < 3; axis++)
        world[axis] = camera->right[axis] * v[0] + camera->up[axis] * v[1] + camera->forward[axis] * v[2];
}

static void compute_surface_colour(trace *t, const camera_cell *c, const render_surface_layer *layer, int value_index,
                                   double z, double colour[3])
{
    for (int k = 0; k < 3; k++) colour[k] = layer->colour_map ? 0 : (double)layer->colours[3 * value_index + k];
    if (!layer->colour_map) return;
    double values[REFERENCE_MAX_VERTICES];
    grid_cell_values(&layer->colour_field.fields[c->part_index], c->index, c->vertices, c->cell.count, values);
    reference_compute_colour(layer->colour_map, find_value_on_ray(t, c, values, z), colour);
}

static reference_hit *add_hit(trace *t, const camera_cell *c, const render_surface_layer *layer, int value_index,
                              int surface, const double *values, double depth)
{
    double point[3], value, gradient[3], colour[3];
    event *e = add_event(t);
    e->depth = e->hit.depth = depth;
    e->order = e->hit.surface = surface;
    e->hit.part = c->part_index;
    e->hit.cell = c->index;
    e->hit.opacity = (double)layer->opacity;
    e->transmittance = 1 - e->hit.opacity;
    double z = depth;
    if (c->cell.type == GRID_POLYHEDRON) { /* a quad's patch may lie outside the tets, where the field is not defined */
        const double inner = 1e-9 * (c->ends[1].z_triangle - c->ends[0].z_triangle);
        z = fmin(fmax(depth, c->ends[0].z_triangle + inner), c->ends[1].z_triangle - inner);
    }
    compute_ray_point(t, z, point);
    reference_interpolate(&c->cell, point, values, &value, gradient);
    transform_to_world(&t->scene->job->camera, gradient, e->hit.normal);
    normalize_vector(e->hit.normal);
    const double crossing_search =
        reference_dot(e->hit.normal, t->direction) / sqrt(reference_dot(t->direction, t->direction));
    for (int axis = 0; axis < 3 && crossing_search > 0; axis++) e->hit.normal[axis] = -e->hit.normal[axis];
    /* A ray may enter and leave a polyhedron through the patch of one quad without meeting the quad's triangles. It is
     * then outside of the tets: the field is defined along the ray, from patch to patch, but not across it. */
    const bool has_gradient = crossing_search != 0;
    if (!has_gradient) t->out->ambiguous = true;
    e->hit.conditioning = has_gradient ? 1 / fabs(crossing_search) : 1;
    e->error_bound = c->size * e->hit.conditioning;
    compute_surface_colour(t, c, layer, value_index, depth, colour);
    shade_hit(t, &layer->material, colour, e->hit.normal, e->hit.colour);
    return &e->hit;
}

/* Adds all crossings of a surface in a cell. If the isovalue is between the face's value and the interpolant's value at
 * the same face, the crossing is placed on the face. */
static void add_hits_of_isovalue(trace *t, const camera_cell *c, const render_surface_layer *layer, int value_index,
                                 int surface, const double *values, const reference_crossing ends[2],
                                 const double face[2])
{
    /* both functions below write to these arrays; the profile needs more elements */
    double z[REFERENCE_MAX_BREAKS], v[REFERENCE_MAX_BREAKS], low, high;
    crossing_search a = {t, c, values, layer->values[value_index], 0};
    compute_value_range(values, c->cell.count, &low, &high);
    if (a.iso > high || a.iso < low || ends[1].z < 0) return;
    a.range = high - low;
    const bool is_polyhedron = c->cell.type == GRID_POLYHEDRON;
    const int count =
        is_polyhedron ? find_profile_depths(&a, z, v) : find_crossing_depths(&a, ends[0].z, ends[1].z, z, v);
    bool side = face[0] >= a.iso;
    for (int i = 0; i <= count; i++) {
        const bool is_end = i == count, now = is_end ? face[1] >= a.iso : v[i] >= 0;
        if (now == side) continue;
        if (is_end || i == 0) t->out->ambiguous = true;
        double depth = is_end ? ends[1].z : ends[0].z;
        const bool is_inner = !is_end && i > 0;
        if (is_inner) depth = bisect_root(t, c, values, a.iso, z[i - 1], z[i], side);
        side = now;
        lower_margin(&t->out->eye_margin, fabs(depth) / c->size);
        if (is_polyhedron) lower_margin_near_sheets(t, c, depth);
        if (depth < 0) continue;
        reference_hit *hit = add_hit(t, c, layer, value_index, surface, values, depth);
        /* The last interval of a profile ends on a quad's patch. The patch may lie outside the tets, so the tets'
         * gradient does not give the slope in this interval. */
        if (is_polyhedron && is_inner) hit->slowness = a.range * (z[i] - z[i - 1]) / (fabs(v[i] - v[i - 1]) * c->size);
    }
}

static void add_hits_of_surface(trace *t, const camera_cell *c, const render_surface_layer *layer, int first_surface,
                                const double *values, const reference_crossing ends[2])
{
    double face[2], low, high;
    compute_value_range(values, c->cell.count, &low, &high);
    for (int i = 0; i < 2; i++) {
        bool is_folded;
        face[i] = reference_compute_face_value(&c->cell, &t->line, &ends[i], values, &is_folded);
        if (is_folded && c->cell.type == GRID_POLYHEDRON) t->out->ambiguous = true;
    }
    for (int i = 0; i < layer->value_count; i++) {
        const double iso = layer->values[i];
        for (int end = 0; end < 2 && high > low; end++)
            lower_margin(&t->out->value_margin, fabs(face[end] - iso) / (high - low));
        if (c->cell.type != GRID_TET) {
            add_hits_of_isovalue(t, c, layer, i, first_surface + i, values, ends, face);
            continue;
        }
        const bool side = face[0] >= iso;
        if (side == (face[1] >= iso) || ends[1].z < 0) continue;
        const double z = bisect_root(t, c, values, iso, ends[0].z, ends[1].z, side);
        lower_margin(&t->out->eye_margin, fabs(z) / c->size);
        if (z >= 0) add_hit(t, c, layer, i, first_surface + i, values, z);
    }
}

static void add_hits_of_all_surfaces(trace *t, const camera_cell *c, const reference_crossing ends[2])
{
    const render_job *job = t->scene->job;
    for (int layer = 0, first = 0; layer < job->surface_count; first += job->surfaces[layer++].value_count) {
        const render_surface_layer *s = &job->surfaces[layer];
        double values[REFERENCE_MAX_VERTICES];
        if (!s->field.ranges[c->part_index].low) continue;
        if (grid_cell_values(&s->field.fields[c->part_index], c->index, c->vertices, c->cell.count, values))
            add_hits_of_surface(t, c, s, first, values, ends);
    }
}

/* ---- volumes ---- */

static void add_sample_to_sums(trace *t, const render_transfer *transfer, int layer, double depth, double value)
{
    const double opacity = reference_compute_opacity(transfer, value);
    double colour[3];
    t->out->samples++;
    if (opacity <= 0) return;
    event *e = add_event(t);
    e->depth = depth;
    e->is_sample = true;
    e->order = layer;
    e->transmittance = pow(1 - opacity, t->scene->job->step / transfer->unit_distance);
    reference_compute_colour(transfer, value, colour);
    for (int c = 0; c < 3; c++) e->hit.colour[c] = colour[c];
}

static void add_samples_of_volume(trace *t, const camera_cell *c, int layer, const double *values,
                                  const reference_crossing ends[2])
{
    const double spacing = t->scene->job->step / t->length;
    const bool is_folded = ends[0].is_folded || ends[1].is_folded;
    if (is_folded && c->cell.type == GRID_POLYHEDRON) t->out->ambiguous = true;
    int64_t k = (int64_t)floor(ends[0].z / spacing - t->jitter) - 1;
    for (k = k < 0 ? 0 : k;; k++) {
        const double z = ((double)k + t->jitter) * spacing;
        lower_margin(&t->out->sample_margin, fmin(fabs(z - ends[0].z), fabs(z - ends[1].z)) / c->size);
        if (z >= ends[1].z) break;
        if (z < ends[0].z) continue;
        add_sample_to_sums(t, t->scene->job->volumes[layer].transfer, layer, z, find_value_on_ray(t, c, values, z));
    }
}

static void add_samples_of_all_volumes(trace *t, const camera_cell *c, const reference_crossing ends[2])
{
    const render_job *job = t->scene->job;
    for (int layer = 0; layer < job->volume_count; layer++) {
        const render_field *field = &job->volumes[layer].field;
        double values[REFERENCE_MAX_VERTICES];
        if (!field->ranges[c->part_index].low) continue;
        if (grid_cell_values(&field->fields[c->part_index], c->index, c->vertices, c->cell.count, values))
            add_samples_of_volume(t, c, layer, values, ends);
    }
}

/* ---- the ray ---- */

static void load_cell(const reference_scene *scene, int part, int64_t index, camera_cell *c)
{
    double low[3], high[3], volume = 1, longest = 0;
    c->part = &scene->job->parts[part];
    c->part_index = part;
    c->index = index;
    c->cell.type = grid_cell_type(c->part->cells, index);
    if (c->cell.type == GRID_POLYHEDRON)
        reference_polyhedron_read(c->part->cells, index, &c->cell, c->vertices);
    else
        c->cell.count = grid_cell_vertices(c->part->cells, index, c->vertices);
    for (int i = 0; i < c->cell.count; i++) {
        grid_read_vertex_position(c->part->cells, c->vertices[i], c->cell.world[i]);
        memcpy(c->cell.position[i], scene->positions[part] + 3 * c->vertices[i], sizeof c->cell.position[i]);
    }
    for (int axis = 0; axis < 3; axis++) {
        low[axis] = high[axis] = c->cell.world[0][axis];
        for (int i = 1; i < c->cell.count; i++) {
            low[axis] = fmin(low[axis], c->cell.world[i][axis]);
            high[axis] = fmax(high[axis], c->cell.world[i][axis]);
        }
        longest = fmax(longest, high[axis] - low[axis]);
    }
    if (c->cell.type == GRID_POLYHEDRON) reference_polyhedron_setup(&c->cell);
    for (int axis = 0; axis < 3; axis++) volume *= fmax(high[axis] - low[axis], 1e-3 * longest);
    c->size = longest > 0 ? cbrt(volume) : 1;
}

/* Returns whether the ray passes through the cell's box, which is sheared along the ray and widened by a margin. */
static bool is_cell_near_ray(const trace *t, int part, int64_t index)
{
    const grid *g = t->scene->job->parts[part].cells;
    if (!reference_box_is_near(&t->scene->boxes[part][index], &t->line, 1e-3, 1e-6)) return false;
    for (int axis = 0; axis < 2; axis++) {
        double low = (double)INFINITY, high = -(double)INFINITY;
        grid_walk walk = grid_walk_cell(g, index);
        int64_t vertex;
        while (grid_walk_next(&walk, &vertex)) {
            const double *p = t->scene->positions[part] + 3 * vertex;
            const double u = p[axis] - t->line.base[axis] - t->line.slope[axis] * p[2];
            low = fmin(low, u);
            high = fmax(high, u);
        }
        const double slack = 1e-3 * (high - low) + 1e-6;
        if (low > slack || high < -slack) return false;
    }
    return true;
}

static void intersect_cell(trace *t, int part, int64_t index)
{
    camera_cell c;
    reference_crossing crossings[REFERENCE_MAX_CROSSINGS];
    if (grid_is_ghost(t->scene->job->parts[part].cells, index) || !is_cell_near_ray(t, part, index)) return;
    load_cell(t->scene, part, index, &c);
    lower_margin(&t->out->edge_margin, reference_compute_edge_distance(&c.cell, &t->line) / c.size);
    const int count = reference_find_crossings(&c.cell, &t->line, crossings);
    for (int i = 0; i + 1 < count; i += 2) {
        memcpy(c.ends, crossings + i, sizeof c.ends);
        add_hits_of_all_surfaces(t, &c, crossings + i);
        add_samples_of_all_volumes(t, &c, crossings + i);
    }
}

static int compare_events(const void *left, const void *right)
{
    const event *a = left, *b = right;
    if (a->depth != b->depth) return a->depth < b->depth ? -1 : 1;
    if (a->is_sample != b->is_sample) return a->is_sample ? 1 : -1;
    return a->order - b->order;
}

static void blend_event(double rgb[3], double *transmittance, const event *e)
{
    for (int c = 0; c < 3; c++) rgb[c] += *transmittance * (1 - e->transmittance) * e->hit.colour[c];
    *transmittance *= e->transmittance;
}

/* Merges samples of several volumes at the same depth into the last of them. The light that all of them absorb together
 * is divided among them in proportion to what each would absorb without the others. Returns the index of the merged
 * sample. */
static int64_t gather_samples(event *events, int64_t count, int64_t i)
{
    int64_t last = i;
    while (last + 1 < count && events[last + 1].is_sample && events[last + 1].depth == events[i].depth) last++;
    if (last == i) return i;
    double colour[3] = {0, 0, 0}, weight = 0, through = 1;
    for (int64_t k = i; k <= last; k++) {
        const double absorbed = 1 - events[k].transmittance;
        for (int c = 0; c < 3; c++) colour[c] += absorbed * events[k].hit.colour[c];
        weight += absorbed;
        through *= events[k].transmittance;
    }
    for (int c = 0; c < 3; c++) events[last].hit.colour[c] = weight > 0 ? colour[c] / weight : 0;
    events[last].transmittance = through;
    return last;
}

/* Lowers the margin for a sample and a hit at nearly the same depth, since rounding may exchange their order. */
static void lower_margins_between_events(const event *events, int64_t count, double *margin)
{
    for (int64_t i = 0; i + 1 < count; i++)
        if (events[i].is_sample != events[i + 1].is_sample)
            lower_margin(margin, (events[i + 1].depth - events[i].depth) /
                                     fmax(events[i].error_bound, events[i + 1].error_bound));
}

static void blend_events(trace *t, const float background[4])
{
    reference_ray *out = t->out;
    double transmittance = 1;
    out->volume_transmittance = 1;
    if (t->count) qsort(t->events, (size_t)t->count, sizeof *t->events, compare_events);
    lower_margins_between_events(t->events, t->count, &out->sample_margin);
    for (int64_t i = 0; i < t->count; i++) {
        if (t->events[i].is_sample) i = gather_samples(t->events, t->count, i);
        const event *e = &t->events[i];
        blend_event(out->rgba, &transmittance, e);
        if (e->is_sample) {
            blend_event(out->volume_rgb, &out->volume_transmittance, e);
            continue;
        }
        if (out->hit_count < REFERENCE_MAX_HITS) out->hits[out->hit_count++] = e->hit;
        if (e->hit.opacity >= 1) break;
    }
    for (int c = 0; c < 3; c++) out->rgba[c] += transmittance * (double)background[c];
    out->rgba[3] = 1 - transmittance * (1 - (double)background[3]);
}

static void begin_ray(trace *t, const reference_scene *scene, int x, int y)
{
    const render_camera *camera = &scene->job->camera;
    const double *axes[2] = {camera->right, camera->up};
    double base[3], from_eye[3];
    render_camera_ray(camera, x, y, base, t->direction);
    for (int axis = 0; axis < 3; axis++) from_eye[axis] = base[axis] - camera->eye[axis];
    for (int axis = 0; axis < 2; axis++) {
        t->line.base[axis] = reference_dot(axes[axis], from_eye);
        t->line.slope[axis] = reference_dot(axes[axis], t->direction);
    }
    t->length = camera->is_orthographic ? 1 : sqrt(reference_dot(t->direction, t->direction));
    const uint32_t pixel = (uint32_t)(y * camera->width + x);
    t->jitter = scene->job->jitter ? render_jitter(pixel, (uint32_t)scene->job->frame) : 0.5;
}

void reference_trace(const reference_scene *scene, int x, int y, const float background[4], reference_ray *out)
{
    trace t = {.scene = scene, .out = out};
    memset(out, 0, sizeof *out);
    out->edge_margin = out->value_margin = out->sample_margin = out->eye_margin = out->light_margin = (double)INFINITY;
    begin_ray(&t, scene, x, y);
    for (int part = 0; part < scene->job->part_count; part++)
        for (int64_t cell = 0; cell < scene->job->parts[part].cells->cell_count; cell++) intersect_cell(&t, part, cell);
    blend_events(&t, background);
    free(t.events);
}

double reference_compute_residual(const reference_scene *scene, int x, int y, const reference_hit *hit, double depth,
                                  double *slope, double gradient[3])
{
    reference_ray unused = {.hit_count = 0};
    trace t = {.scene = scene, .out = &unused};
    camera_cell c;
    double values[8], point[3], value, low, high, g[3], iso = 0;
    int surface = hit->surface;
    const render_surface_layer *layer = scene->job->surfaces;
    for (; surface >= layer->value_count; layer++) surface -= layer->value_count;
    iso = layer->values[surface];
    begin_ray(&t, scene, x, y);
    load_cell(scene, hit->part, hit->cell, &c);
    grid_cell_values(&layer->field.fields[hit->part], c.index, c.vertices, c.cell.count, values);
    compute_value_range(values, c.cell.count, &low, &high);
    compute_ray_point(&t, depth, point);
    reference_interpolate(&c.cell, point, values, &value, g);
    *slope = (g[0] * t.line.slope[0] + g[1] * t.line.slope[1] + g[2]) / (high - low);
    for (int axis = 0; axis < 3; axis++) g[axis] /= high - low;
    if (gradient) transform_to_world(&scene->job->camera, g, gradient);
    return (value - iso) / (high - low);
}
