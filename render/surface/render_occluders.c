/* Collects occluders: cells that an opaque surface crosses, which may block rays from hits. Threads go through the
 * subtrees of the meshes' trees, and each lists the occluders in its subtrees. The lists are joined, and
 * render_occluder_tree.c builds trees over them. The order of the lists does not matter (kernel_occluders.h).
 *
 * For cells other than tets, a slab is stored, which contains the surface in the cell: the space between two parallel
 * planes, on each of which a linear function L is constant. L is fitted to the values at the vertices by least squares.
 * The position and the value of any point of the cell are weighted means of those of the vertices, with the same
 * weights. So the field differs from L nowhere by more than the largest difference at a vertex, which determines the
 * slab's thickness. */
#include "render_occluders.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_cell_values.h"
#include "kernel_visible_values.h"
#include "memory.h"
#include "mmbvh.h"
#include "region.h"
#include "render_occluder_tree.h"
#include "render_subtrees.h"

enum { HEX_BYTES = KERNEL_CURVED_RECORD_WORDS * sizeof(float) };

/* A growing array whose items all have the same size. */
typedef struct list {
    int64_t count, capacity;
    void *items;
} list;

/* The occluders that one thread has found, or all threads together, and the cell that is being searched. */
typedef struct occluder_search {
    const kernel_frame *frame;
    list triangles, slabs; /* items are occluder_piece */
    list cells;            /* items are kernel_occluder: the cells of the slabs, in the same order */
    list hexes;            /* per hex, its record of HEX_BYTES bytes: vertices, values and faces (kernel_occluders.h) */
    bool out_of_memory;
    kernel_occluder cell; /* the cell that is being searched, and the isovalue in it */
    /* number of entries in `places` and `values`: the cell's vertices, some several times if it is a polyhedron */
    int count;
    list places, values; /* positions of the vertices in tree space (3 doubles each), and the field there (double) */
    double reach;        /* distance from a hit, in tree space, within which the cell does not block the hit's rays */
} occluder_search;

/* Appends an item to a list and returns it; NULL if memory ran out. */
static void *append_list_item(occluder_search *s, list *l, size_t size)
{
    if (l->count == l->capacity) {
        const int64_t capacity = l->capacity + l->capacity / 2 + 256;
        void *items = base_realloc(l->items, (size_t)capacity * size);
        if (!items) {
            s->out_of_memory = true;
            return NULL;
        }
        l->items = items;
        l->capacity = capacity;
    }
    return (char *)l->items + (size_t)l->count++ * size;
}

static void free_lists(occluder_search *s)
{
    list *const lists[] = {&s->triangles, &s->slabs, &s->cells, &s->hexes, &s->places, &s->values};
    for (int i = 0; i < 6; i++) base_free(lists[i]->items);
}

/* ---- the vertices of the current cell ------------------------------------------------------------------------- */

static const double *place_of(const occluder_search *s, int i)
{
    return (const double *)s->places.items + (ptrdiff_t)3 * i;
}

static double value_of(const occluder_search *s, int i)
{
    return ((const double *)s->values.items)[i];
}

static void compute_vertex_bounds(const occluder_search *s, double low[3], double high[3])
{
    for (int a = 0; a < 3; a++) low[a] = high[a] = place_of(s, 0)[a];
    for (int i = 1; i < s->count; i++)
        for (int a = 0; a < 3; a++) {
            low[a] = fmin(low[a], place_of(s, i)[a]);
            high[a] = fmax(high[a], place_of(s, i)[a]);
        }
}

static bool add_vertex(occluder_search *s, const double world[3], double value)
{
    const render_space *space = &s->frame->job->space;
    double *place = append_list_item(s, &s->places, 3 * sizeof *place),
           *kept = append_list_item(s, &s->values, sizeof *kept);
    if (!place || !kept) return false;
    for (int a = 0; a < 3; a++) place[a] = (world[a] - space->origin[a]) * space->scale;
    *kept = value;
    s->count++;
    return true;
}

/* ---- the triangles of the surface in a tet ----------------------------------------------------------------------- */

/* Computes the point, in tree space, at which the surface crosses the edge between vertices i and j. These must be in
 * the lexicographic order of coordinates, so that all cells of the edge compute the same bits. */
static void cross_edge(const occluder_search *s, double isovalue, int i, int j, float out[3])
{
    const double *a = place_of(s, i), *b = place_of(s, j);
    const double va = value_of(s, i) - isovalue, vb = value_of(s, j) - isovalue, w = va / (va - vb);
    for (int k = 0; k < 3; k++) out[k] = (float)(a[k] + w * (b[k] - a[k]));
}

static void add_triangle(occluder_search *s, float a[3], float b[3], float c[3])
{
    occluder_piece *t = append_list_item(s, &s->triangles, sizeof *t);
    if (!t) return;
    memcpy(t->rows, a, 3 * sizeof *a);
    memcpy(t->rows + 3, b, 3 * sizeof *b);
    memcpy(t->rows + 6, c, 3 * sizeof *c);
    t->rows[KERNEL_TRIANGLE_REACH] = (float)s->reach;
    t->surface = s->cell.surface;
}

/* Adds the isosurface in a tet as one or two triangles. The tet's vertices must be in the lexicographic order of
 * coordinates. */
static void add_tet(occluder_search *s, double isovalue)
{
    float at[4][3];
    int below[4], above[4], belows = 0, aboves = 0, n = 0;
    for (int i = 0; i < 4; i++)
        if (value_of(s, i) < isovalue)
            below[belows++] = i;
        else
            above[aboves++] = i;
    /* the crossings must be in cyclic order around the surface in the tet, so the edges from every second vertex below
     * the isovalue are visited in reverse order */
    for (int i = 0; i < belows; i++)
        for (int k = 0; k < aboves; k++) {
            const int j = i % 2 ? aboves - 1 - k : k, p = below[i], q = above[j];
            cross_edge(s, isovalue, p < q ? p : q, p < q ? q : p, at[n++]);
        }
    add_triangle(s, at[0], at[1], at[2]);
    if (n == 4) add_triangle(s, at[0], at[2], at[3]);
}

/* ---- slabs, which contain the surface in other cells ------------------------------------------------------------- */

/* Solves m x = b for a symmetric matrix m. x is 0 if m is nearly singular; then the slab is the whole cell. */
static void solve_symmetric_system(double m[3][3], const double b[3], double x[3])
{
    double inverse[3][3];
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const int i1 = (i + 1) % 3, i2 = (i + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
            inverse[k][i] = m[i1][k1] * m[i2][k2] - m[i1][k2] * m[i2][k1];
        }
    const double det = m[0][0] * inverse[0][0] + m[0][1] * inverse[1][0] + m[0][2] * inverse[2][0];
    const double size = m[0][0] + m[1][1] + m[2][2];
    for (int i = 0; i < 3; i++) {
        x[i] = 0;
        if (det > 1e-12 * size * size * size)
            for (int k = 0; k < 3; k++) x[i] += inverse[i][k] * b[k] / det;
    }
}

/* Computes the linear function L that fits the values at the vertices best, by least squares about the mean of the
 * vertices. The values are taken minus the isovalue, times `scale`. *level receives L at the origin of tree space. */
static void fit_linear_function(const occluder_search *s, double isovalue, double scale, double gradient[3],
                                double *level)
{
    double mean[3] = {0, 0, 0}, value = 0, m[3][3] = {{0}}, b[3] = {0, 0, 0};
    for (int i = 0; i < s->count; i++) {
        for (int a = 0; a < 3; a++) mean[a] += place_of(s, i)[a] / s->count;
        value += (value_of(s, i) - isovalue) * scale / s->count;
    }
    for (int i = 0; i < s->count; i++) {
        double d[3];
        for (int a = 0; a < 3; a++) d[a] = place_of(s, i)[a] - mean[a];
        for (int a = 0; a < 3; a++) {
            b[a] += d[a] * ((value_of(s, i) - isovalue) * scale - value);
            for (int k = 0; k < 3; k++) m[a][k] += d[a] * d[k];
        }
    }
    solve_symmetric_system(m, b, gradient);
    *level = value;
    for (int a = 0; a < 3; a++) *level -= gradient[a] * mean[a];
}

/* Returns the power of two by which the cell's values minus the isovalue are scaled to near 1. */
static double compute_value_scale(const occluder_search *s, double isovalue)
{
    double largest = 0;
    for (int i = 0; i < s->count; i++) largest = fmax(largest, fabs(value_of(s, i) - isovalue));
    return kernel_compute_normalizing_power(largest);
}

/* Computes the numbers that are stored for the slab of the current cell (out->rows). */
static void fill_slab(const occluder_search *s, double isovalue, occluder_piece *out)
{
    double low[3], high[3], gradient[3], level, off = 0, steep = 0, size = 0;
    const double scale = compute_value_scale(s, isovalue);
    compute_vertex_bounds(s, low, high);
    fit_linear_function(s, isovalue, scale, gradient, &level);
    for (int i = 0; i < s->count; i++) {
        double l = level;
        for (int a = 0; a < 3; a++) l += gradient[a] * place_of(s, i)[a];
        off = fmax(off, fabs((value_of(s, i) - isovalue) * scale - l));
    }
    for (int a = 0; a < 3; a++) {
        steep += fabs(gradient[a]);
        size = fmax(size, fmax(fabs(low[a]), fabs(high[a])));
        out->rows[KERNEL_SLAB_LOWER + a] = (float)low[a];
        out->rows[KERNEL_SLAB_UPPER + a] = (float)high[a];
        out->rows[KERNEL_SLAB_GRADIENT + a] = (float)gradient[a];
    }
    out->rows[KERNEL_SLAB_LEVEL] = (float)level;
    /* The slab must also contain points at which the computed field is 0 only because of rounding. The thickness
     * therefore includes 1e-5, which exceeds the rounding errors of values (6e-8 of the largest) and of the field at
     * roots (KERNEL_ROOT_BAND). KERNEL_SLAB_ERROR is an upper bound of the error of L due to the rounding of positions,
     * divided by the positions' magnitude. */
    out->rows[KERNEL_SLAB_THICKNESS] = (float)(off * 1.0001 + 1e-5);
    out->rows[KERNEL_SLAB_ERROR] = (float)(16 * 6e-8 * steep);
    out->rows[KERNEL_SLAB_REACH] = (float)s->reach;
}

/* Stores in the hex's record which of its vertices are the corners of each face, in the form of
 * kernel_transformed_curved.corners. */
static void store_face_corners(const kernel_cell *c, float *record)
{
    for (int face = 0; face < 6; face++) {
        const signed char *loop = kernel_shapes[0].faces[face].vertices;
        int corner[4];
        kernel_quad_corners(c, loop, corner);
        const int32_t word = corner[0] | corner[1] << 4 | corner[2] << 8 | corner[3] << 12;
        memcpy(&record[KERNEL_CURVED_RECORD_QUADS + face], &word, sizeof word);
    }
    for (int n = KERNEL_CURVED_RECORD_QUADS + 6; n < KERNEL_CURVED_RECORD_WORDS; n++) record[n] = 0;
}

/* Returns whether one of the hex's faces has collapsed to a triangle. */
static bool has_collapsed_face(const kernel_cell *c)
{
    for (int face = 0; face < 6; face++) {
        int corner[4];
        kernel_quad_corners(c, kernel_shapes[0].faces[face].vertices, corner);
        if (kernel_quad_collapses(c, corner)) return true;
    }
    return false;
}

/* Adds the hex's record (its vertices, values and faces, from which crossings of rays with its faces are computed) to
 * s->hexes, and returns the record's index. Returns -1 if the hex gets no record, because rays must be traced in it one
 * by one: if the job has clips, if a face of the hex has collapsed to a triangle, or if memory ran out. */
static int32_t add_hex(occluder_search *s, const kernel_cell *c, double isovalue)
{
    const double scale = compute_value_scale(s, isovalue);
    if (s->frame->job->clip_count || has_collapsed_face(c)) return -1;
    float *record = append_list_item(s, &s->hexes, HEX_BYTES);
    if (!record) return -1;
    for (int i = 0; i < 8; i++) {
        for (int a = 0; a < 3; a++) record[4 * i + a] = (float)place_of(s, i)[a];
        record[4 * i + 3] = (float)((value_of(s, i) - isovalue) * scale);
    }
    store_face_corners(c, record);
    return (int32_t)s->hexes.count - 1;
}

static void add_slab(occluder_search *s, const kernel_cell *c, double isovalue)
{
    const int32_t record = kernel_is_box(c->type) ? add_hex(s, c, isovalue) : -1;
    occluder_piece *out = append_list_item(s, &s->slabs, sizeof *out);
    kernel_occluder *cell = append_list_item(s, &s->cells, sizeof *cell);
    if (!out || !cell) return;
    fill_slab(s, isovalue, out);
    out->surface = s->cell.surface;
    *cell = s->cell;
    cell->record = record;
}

/* ---- collecting occluders in subtrees ---------------------------------------------------------------------------- */

/* Lists the vertices of a cell that is not a polyhedron, in the canonical order that kernels use. */
static bool list_cell_vertices(occluder_search *s, kernel_cell *c, const grid *g)
{
    for (int i = 0; i < c->count; i++) grid_read_vertex_position(g, c->vertices[i], c->world[i]);
    kernel_cell_sort_vertices(c);
    for (int i = 0; i < c->count; i++)
        if (!add_vertex(s, c->world[i], c->values[i])) return false;
    return true;
}

static bool list_polyhedron_vertices(occluder_search *s, const grid *g, const grid_field *field)
{
    grid_walk walk = grid_walk_cell(g, s->cell.cell);
    int64_t vertex;
    double world[3];
    while (grid_walk_next(&walk, &vertex)) {
        grid_read_vertex_position(g, vertex, world);
        if (!add_vertex(s, world, grid_field_value(field, vertex))) return false;
    }
    return s->count > 0;
}

/* Adds the occluders of the current cell (s->cell), for all isovalues of its surface's layer. */
static void find_in_cell(occluder_search *s)
{
    const render_surface_layer *layer = s->frame->surfaces[s->cell.surface].layer;
    const grid *g = s->frame->job->parts[s->cell.part].cells;
    const grid_field *field = &layer->field.fields[s->cell.part];
    kernel_cell c = {.type = 0};
    kernel_cell_fetch(&c, g, field, s->cell.cell);
    const bool is_polyhedron = kernel_has_own_faces(c.type);
    if (!is_polyhedron && !c.is_finite) return;
    s->count = 0;
    s->places.count = s->values.count = 0;
    if (is_polyhedron ? !list_polyhedron_vertices(s, g, field) : !list_cell_vertices(s, &c, g)) return;
    /* The reach is a distance in tree space, because s->places are in tree space. kernel_occlusion_is_beyond_contact()
     * computes the same distance from world coordinates. */
    s->reach = layer->contact > 0 ? (double)layer->contact * kernel_cell_size(s->places.items, s->count) : 0;
    for (s->cell.value = 0; s->cell.value < layer->value_count; s->cell.value++) {
        const double isovalue = layer->values[s->cell.value];
        if (!kernel_values_straddle(s->values.items, s->count, isovalue)) continue;
        if (kernel_is_linear(c.type))
            add_tet(s, isovalue);
        else
            add_slab(s, &c, isovalue);
    }
}

/* Adds the occluders in all cells of a subtree. */
static void find_in_subtree(occluder_search *s, const kernel_subtree *subtree)
{
    const mmbvh *tree = s->frame->job->parts[subtree->part].tree;
    const kernel_surface *surface = &s->frame->surfaces[subtree->surface];
    const mmbvh_ranges *ranges = &surface->layer->field.ranges[subtree->part];
    int64_t stack[MMBVH_MAX_DEPTH];
    int top = 0;
    s->cell.surface = subtree->surface;
    s->cell.part = subtree->part;
    stack[top++] = subtree->node;
    while (top && !s->out_of_memory) {
        const int64_t node = stack[--top], ref = mmbvh_node_ref(tree, node);
        const int count = mmbvh_node_count(tree, node);
        if (!kernel_node_is_visible(&surface->visible_values, ranges, node)) continue;
        for (int n = 0; n < count; n++) {
            s->cell.cell = tree->cells[ref + n];
            find_in_cell(s);
        }
        if (count) continue;
        stack[top++] = ref + 1;
        stack[top++] = ref;
    }
}

/* Moves the items of `from` to the end of `to`. Returns false if memory ran out. */
static bool append_items_of_list(list *to, list *from, size_t size)
{
    if (!to->items) {
        *to = *from;
        *from = (list){0};
        return true;
    }
    if (!from->count) return true;
    void *items = base_realloc(to->items, (size_t)(to->count + from->count) * size);
    if (!items) return false;
    memcpy((char *)items + (size_t)to->count * size, from->items, (size_t)from->count * size);
    *to = (list){to->count + from->count, to->count + from->count, items};
    return true;
}

/* Moves all occluders of `from` to `to`, and adapts the indices of records. Returns false if memory ran out. */
static bool append_occluders(occluder_search *to, occluder_search *from)
{
    kernel_occluder *cells = from->cells.items;
    for (int64_t i = 0; i < from->cells.count; i++)
        if (cells[i].record >= 0) cells[i].record += (int32_t)to->hexes.count;
    return !from->out_of_memory && append_items_of_list(&to->triangles, &from->triangles, sizeof(occluder_piece)) &&
           append_items_of_list(&to->slabs, &from->slabs, sizeof(occluder_piece)) &&
           append_items_of_list(&to->cells, &from->cells, sizeof(kernel_occluder)) &&
           append_items_of_list(&to->hexes, &from->hexes, HEX_BYTES);
}

static bool find_all_occluders(const kernel_frame *frame, int threads, occluder_search *out)
{
    int64_t count;
    kernel_subtree *subtrees = render_subtrees(frame, 0, frame->opaque_count, &count);
    bool is_well = subtrees;
#pragma omp parallel num_threads(threads) reduction(&& : is_well)
    {
        region_enter();
        occluder_search own = {.frame = frame};
#pragma omp for schedule(dynamic, 1) nowait
        for (int64_t i = 0; i < count; i++) find_in_subtree(&own, &subtrees[i]);
#pragma omp critical(occluders)
        is_well = append_occluders(out, &own);
        free_lists(&own);
        region_leave();
    }
    base_free(subtrees);
    return is_well;
}

/* ---- building the trees ------------------------------------------------------------------------------------------ */

static insitu_status build_trees(const occluder_search *found, int threads, kernel_occluders *out, base_error *error)
{
    const occluder_piece *triangles = found->triangles.items;
    insitu_status status = occluder_tree_build(triangles, found->triangles.count, KERNEL_TRIANGLE_ROWS, out->width,
                                               threads, &out->triangles, error);
    if (!status)
        status = occluder_tree_build(found->slabs.items, found->slabs.count, KERNEL_SLAB_ROWS, out->width, threads,
                                     &out->slabs, error);
    if (status) return status;
    for (int64_t i = 0; i < out->triangles.leaf_count * out->width; i++) {
        int32_t *source = &out->triangles.sources[i];
        *source = *source < 0 ? -1 : triangles[*source].surface;
    }
    return INSITU_OK;
}

insitu_status occluders_build(const kernel_frame *frame, int width, int threads, kernel_occluders *out,
                              base_error *error)
{
    occluder_search all = {0};
    insitu_status status = INSITU_OK;
    *out = (kernel_occluders){.width = width};
    if (!find_all_occluders(frame, threads, &all))
        status = base_fail(error, INSITU_ERROR_MEMORY, "no memory for what blocks rays from hits");
    if (!status && (all.triangles.count > INT32_MAX / 2 || all.slabs.count > INT32_MAX / 64))
        status = base_fail(error, INSITU_ERROR_MEMORY, "shadows: %lld pieces of surfaces on a rank are too many",
                           (long long)all.triangles.count + (long long)all.slabs.count);
    if (!status) status = build_trees(&all, threads, out, error);
    out->cells = all.cells.items;
    out->hexes = all.hexes.items;
    all.cells.items = all.hexes.items = NULL;
    free_lists(&all);
    return status;
}

void occluders_free(kernel_occluders *occluders)
{
    occluder_tree_free(&occluders->triangles);
    occluder_tree_free(&occluders->slabs);
    base_free(occluders->cells);
    base_free(occluders->hexes);
    *occluders = (kernel_occluders){0};
}
