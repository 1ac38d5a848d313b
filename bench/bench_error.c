/* Computes the reference in double for a few hundred pixels of a big mesh.
 *
 * Brute force over all cells is affordable because each cell is first projected. Every kind of cell lies within the
 * convex hull of its vertices, so the rectangle around its projected vertices contains its projection. A cell is kept
 * only if this rectangle, enlarged by one pixel on all sides, contains a chosen pixel. The reference then intersects
 * the ray of every chosen pixel with every cell that was kept. */
#include "bench_error.h"

#include <stdlib.h>
#include <string.h>

#include "comp.h"
#include "reference_render.h"
#include "test_meshes.h"

typedef struct chosen_pixel {
    uint32_t pixel;
    int x, y;
} chosen_pixel;

struct bench_pixels {
    render_camera camera;
    int block, columns, rows;
    chosen_pixel *pixels; /* columns × rows */
    grid kept;            /* the cells near chosen pixels, with all vertices of the mesh; owns the three arrays below */
    int64_t *connectivity, *offsets;
    unsigned char *types;
};

static void *require_memory(void *p)
{
    if (!p) abort();
    return p;
}

static chosen_pixel choose_pixel(const bench_pixels *all, int column, int row)
{
    const uint64_t block = (uint64_t)(row * 100000 + column);
    const int x = column * all->block + (int)(test_uniform(2 * block, 11) * all->block);
    const int y = row * all->block + (int)(test_uniform(2 * block + 1, 11) * all->block);
    return (chosen_pixel){(uint32_t)(y * all->camera.width + x), x, y};
}

static void project_to_pixel(const render_camera *c, const double world[3], double out[2])
{
    double p[3] = {0, 0, 0};
    for (int i = 0; i < 3; i++) {
        const double d = world[i] - c->eye[i];
        p[0] += d * c->right[i];
        p[1] += d * c->up[i];
        p[2] += d * c->forward[i];
    }
    const double per_slope = 0.5 * c->height / c->half_height;
    out[0] = 0.5 * c->width - 0.5 + per_slope * p[0] / p[2];
    out[1] = 0.5 * c->height - 0.5 - per_slope * p[1] / p[2];
}

static bool contains_chosen_pixel(const bench_pixels *all, const double low[2], const double high[2])
{
    const int last_column = (int)fmin(all->columns - 1, floor(high[0] / all->block));
    const int last_row = (int)fmin(all->rows - 1, floor(high[1] / all->block));
    for (int row = (int)fmax(0, floor(low[1] / all->block)); row <= last_row; row++)
        for (int column = (int)fmax(0, floor(low[0] / all->block)); column <= last_column; column++) {
            const chosen_pixel *p = &all->pixels[row * all->columns + column];
            if (p->x >= low[0] && p->x <= high[0] && p->y >= low[1] && p->y <= high[1]) return true;
        }
    return false;
}

static bool is_wanted(const bench_pixels *all, const grid *cells, int64_t cell)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    grid_walk walk = grid_walk_cell(cells, cell);
    int64_t vertex;
    while (grid_walk_next(&walk, &vertex)) {
        double world[3], pixel[2];
        grid_read_vertex_position(cells, vertex, world);
        project_to_pixel(&all->camera, world, pixel);
        for (int axis = 0; axis < 2; axis++) {
            low[axis] = fmin(low[axis], pixel[axis] - 1);
            high[axis] = fmax(high[axis], pixel[axis] + 1);
        }
    }
    return contains_chosen_pixel(all, low, high);
}

/* Returns the range of the cell's entries in connectivity: vertices, or faces of a polyhedron. */
static void find_cell_entries(const grid *cells, int64_t cell, int64_t *first, int64_t *end)
{
    const grid_walk walk = grid_walk_cell(cells, cell);
    const bool has_faces = grid_cell_type(cells, cell) == GRID_POLYHEDRON;
    *first = has_faces ? walk.face_next : walk.next;
    *end = has_faces ? walk.face_end : walk.end;
}

/* Fills `kept` with the wanted cells, in the order of the mesh. */
static void copy_wanted_cells(bench_pixels *all, const grid *cells, const unsigned char *wanted)
{
    int64_t count = 0, entries = 0, at = 0, first, end;
    for (int64_t cell = 0; cell < cells->cell_count; cell++) {
        if (!wanted[cell]) continue;
        find_cell_entries(cells, cell, &first, &end);
        entries += end - first;
        count++;
    }
    all->connectivity = require_memory(malloc(sizeof(int64_t) * (size_t)(entries + 1)));
    all->offsets = require_memory(malloc(sizeof(int64_t) * (size_t)(count + 1)));
    all->types = require_memory(malloc((size_t)(count + 1)));
    all->offsets[0] = 0;
    for (int64_t cell = 0; cell < cells->cell_count; cell++) {
        if (!wanted[cell]) continue;
        find_cell_entries(cells, cell, &first, &end);
        all->types[at] = (unsigned char)grid_cell_type(cells, cell);
        all->offsets[at + 1] = all->offsets[at] + end - first;
        for (int64_t i = first; i < end; i++)
            all->connectivity[all->offsets[at] + i - first] = grid_read_index(&cells->connectivity, i);
        at++;
    }
    all->kept = *cells;
    all->kept.cell_count = count;
    all->kept.connectivity =
        (grid_array){.data = (char *)all->connectivity, .stride = 8, .is_wide = true, .is_integer = true};
    all->kept.offsets = (grid_array){.data = (char *)all->offsets, .stride = 8, .is_wide = true, .is_integer = true};
    all->kept.cell_types = (char *)all->types;
    all->kept.cell_types_stride = all->kept.cell_types_bytes = 1;
}

bench_pixels *bench_pixels_create(const grid *cells, const render_camera *camera, int block)
{
    bench_pixels *all = require_memory(calloc(1, sizeof *all));
    all->camera = *camera;
    all->block = block;
    all->columns = camera->width / block;
    all->rows = camera->height / block;
    all->pixels = require_memory(malloc((size_t)(all->columns * all->rows) * sizeof *all->pixels));
    for (int i = 0; i < all->columns * all->rows; i++)
        all->pixels[i] = choose_pixel(all, i % all->columns, i / all->columns);
    unsigned char *wanted = require_memory(malloc((size_t)cells->cell_count + 1));
#pragma omp parallel for schedule(static)
    for (int64_t cell = 0; cell < cells->cell_count; cell++) wanted[cell] = is_wanted(all, cells, cell);
    copy_wanted_cells(all, cells, wanted);
    free(wanted);
    return all;
}

void bench_pixels_destroy(bench_pixels *pixels)
{
    free(pixels->pixels);
    free(pixels->connectivity);
    free(pixels->offsets);
    free(pixels->types);
    free(pixels);
}

int bench_pixels_count(const bench_pixels *all)
{
    return all->columns * all->rows;
}

void bench_pixels_position(const bench_pixels *all, int i, int *x, int *y)
{
    *x = all->pixels[i].x;
    *y = all->pixels[i].y;
}

const grid *bench_pixels_cells(const bench_pixels *all)
{
    return &all->kept;
}

/* Traces the chosen pixels by the reference. The caller frees the result. */
static reference_ray *trace_chosen(const bench_pixels *all, const render_job *job)
{
    const float nothing[4] = {0, 0, 0, 0};
    const render_part part = {&all->kept, NULL, NULL};
    const int count = all->columns * all->rows;
    render_job kept = *job;
    kept.parts = &part;
    reference_ray *rays = require_memory(malloc((size_t)count * sizeof *rays));
    reference_scene *scene = reference_create(&kept);
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < count; i++) reference_trace(scene, all->pixels[i].x, all->pixels[i].y, nothing, &rays[i]);
    reference_free(scene);
    return rays;
}

/* Returns the index of this pixel among the chosen pixels, or -1. */
static int find_chosen_pixel(const bench_pixels *all, uint32_t pixel)
{
    const int x = (int)pixel % all->camera.width, y = (int)pixel / all->camera.width;
    const int column = x / all->block, row = y / all->block, i = row * all->columns + column;
    return column < all->columns && row < all->rows && all->pixels[i].pixel == pixel ? i : -1;
}

/* Merges the fragments of the chosen pixels. The kernels' depths are values of the rays' parameter t; they are
 * converted to depths along the camera's axis. */
void bench_pixels_merge(const bench_pixels *all, const render_space *space, const fragment_list *fragments, float *rgba,
                        double *depths)
{
    enum { MANY = 4096 };
    const float nothing[4] = {0, 0, 0, 0};
    const int count = all->columns * all->rows;
    fragment *own = require_memory(malloc((size_t)count * MANY * sizeof *own));
    int *own_count = require_memory(calloc((size_t)count, sizeof *own_count));
    for (int64_t i = 0; i < fragments->count; i++) {
        const int at = find_chosen_pixel(all, fragments->items[i].pixel);
        if (at < 0) continue;
        if (own_count[at] == MANY) abort();
        own[(int64_t)at * MANY + own_count[at]++] = fragments->items[i];
    }
    for (int i = 0; i < count; i++) {
        float t;
        comp_merge_pixel(own + (int64_t)i * MANY, own_count[i], nothing, rgba + 4 * i, &t);
        depths[i] = (double)t / space->scale + space->depth_origin;
    }
    free(own);
    free(own_count);
}

static double compute_field_error(const bench_pixels *all, const render_job *job, const chosen_pixel *p, double depth,
                                  double (*exact)(const double position[3]))
{
    double base[3], direction[3], point[3];
    render_camera_ray(&all->camera, p->x, p->y, base, direction);
    for (int axis = 0; axis < 3; axis++) point[axis] = base[axis] + depth * direction[axis];
    return fabs(exact(point) - job->surfaces[0].values[0]);
}

bench_surface_error bench_surface_compare(const bench_pixels *all, const render_job *job,
                                          double (*exact)(const double position[3]), const fragment_list *fragments)
{
    const int count = all->columns * all->rows;
    float *rgba = require_memory(malloc(4 * (size_t)count * sizeof *rgba));
    double *depths = require_memory(malloc((size_t)count * sizeof *depths));
    double *errors = require_memory(malloc(2 * (size_t)count * sizeof *errors)), *fields = errors + count;
    reference_ray *truth = trace_chosen(all, job);
    bench_surface_error out = {.checked = count};
    int both = 0, hits = 0;
    bench_pixels_merge(all, &job->space, fragments, rgba, depths);
    for (int i = 0; i < count; i++) {
        const bool is_hit = isfinite(depths[i]), should_hit = truth[i].hit_count > 0;
        if (is_hit) fields[hits++] = compute_field_error(all, job, &all->pixels[i], depths[i], exact);
        if (is_hit && should_hit) errors[both++] = fabs(depths[i] - truth[i].hits[0].depth);
        out.disagreements += is_hit != should_hit;
        out.ambiguous += is_hit != should_hit && truth[i].ambiguous;
    }
    out.depth = bench_compute_stats(errors, both);
    out.field = bench_compute_stats(fields, hits);
    free(rgba);
    free(depths);
    free(errors);
    free(truth);
    return out;
}

bench_stats bench_volume_compare(const bench_pixels *all, const render_job *job, const fragment_list *fragments)
{
    const int count = all->columns * all->rows;
    float *rgba = require_memory(malloc(4 * (size_t)count * sizeof *rgba));
    double *depths = require_memory(malloc((size_t)count * sizeof *depths));
    double *errors = require_memory(malloc((size_t)count * sizeof *errors));
    reference_ray *truth = trace_chosen(all, job);
    bench_pixels_merge(all, &job->space, fragments, rgba, depths);
    int seen = 0;
    for (int i = 0; i < count; i++) {
        if (!truth[i].samples) continue;
        double error = 0;
        for (int channel = 0; channel < 4; channel++)
            error = fmax(error, fabs((double)rgba[4 * i + channel] - truth[i].rgba[channel]));
        errors[seen++] = error;
    }
    const bench_stats out = bench_compute_stats(errors, seen);
    free(rgba);
    free(depths);
    free(errors);
    free(truth);
    return out;
}
