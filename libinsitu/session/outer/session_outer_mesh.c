#include "session_outer_mesh.h"

#include <stdlib.h>
#include <string.h>

#include "memory.h"
#include "polygon.h"
#include "session_agree.h"
#include "session_cell_faces.h"
#include "session_face_normals.h"
#include "session_rims.h"
#include "session_scalars.h"
#include "vector3.h"

/* ---- normal and apex of one face --------------------------------------------------------------------------------- */

/* A face with three or four corners. The order of the corners depends only on their positions: it begins with the
 * lexicographically smallest corner and continues to the smaller one of its neighbours. */
typedef struct corner_loop {
    int count;
    int64_t vertices[4];
    double positions[4][3];
} corner_loop;

static void add_corner(corner_loop *loop, int64_t vertex, const double position[3])
{
    for (int i = 0; i < loop->count; i++)
        if (vector3_compare(loop->positions[i], position) == 0) return;
    memcpy(loop->positions[loop->count], position, 3 * sizeof *position);
    loop->vertices[loop->count++] = vertex;
}

static void order_corners(corner_loop *loop)
{
    const corner_loop in = *loop;
    const int count = in.count;
    int least = 0;
    for (int i = 1; i < count; i++)
        if (vector3_compare(in.positions[i], in.positions[least]) < 0) least = i;
    const bool is_turned =
        vector3_compare(in.positions[(least + count - 1) % count], in.positions[(least + 1) % count]) < 0;
    for (int i = 0; i < count; i++) {
        const int from = (least + (is_turned ? count - i : i)) % count;
        loop->vertices[i] = in.vertices[from];
        memcpy(loop->positions[i], in.positions[from], sizeof in.positions[from]);
    }
}

static void subtract_vectors(const double a[3], const double b[3], double out[3])
{
    for (int axis = 0; axis < 3; axis++) out[axis] = a[axis] - b[axis];
}

/* Computes the face's normal, with a length of twice its area. */
static void find_normal(const corner_loop *loop, double out[3])
{
    double a[3], b[3];
    subtract_vectors(loop->positions[loop->count == 4 ? 2 : 1], loop->positions[0], a);
    subtract_vectors(loop->positions[loop->count - 1], loop->positions[loop->count == 4 ? 1 : 0], b);
    for (int axis = 0; axis < 3; axis++) {
        const int next = (axis + 1) % 3, last = (axis + 2) % 3;
        out[axis] = a[next] * b[last] - a[last] * b[next];
    }
}

static double measure_perimeter(const corner_loop *loop)
{
    double sum = 0, side[3];
    for (int i = 0; i < loop->count; i++) {
        subtract_vectors(loop->positions[(i + 1) % loop->count], loop->positions[i], side);
        sum += sqrt(vector3_dot(side, side));
    }
    return sum;
}

/* A point is treated as lying on one side of a face's plane only if its distance from the plane exceeds this fraction
 * of the face's size. The centre of a shell lies in the shell's plane except for rounding errors. These errors must not
 * determine the side, because they depend on the vertex at which the shell's list of vertices begins. */
static const double side_slack = 1e-9;

/* Computes the apex of the cell built on a face. The apex lies above the centre of the corners, at half of the mean
 * side length, on the same side of the face as the point `inside`. If `inside` lies in the face's plane, the apex lies
 * on the side to which the loop's own normal points. Returns false if the face's area is 0 up to rounding. */
static bool find_apex(const corner_loop *loop, const double inside[3], double apex[3])
{
    double normal[3], towards[3], middle[3] = {0, 0, 0};
    find_normal(loop, normal);
    const double length = sqrt(vector3_dot(normal, normal)), around = measure_perimeter(loop);
    if (!(length > 1e-12 * around * around)) return false;
    for (int i = 0; i < loop->count; i++)
        for (int axis = 0; axis < 3; axis++) middle[axis] += loop->positions[i][axis] / loop->count;
    subtract_vectors(inside, middle, towards);
    const bool is_below = vector3_dot(towards, normal) < -side_slack * around * length;
    const double height = 0.5 * around / loop->count * (is_below ? -1 : 1);
    for (int axis = 0; axis < 3; axis++) apex[axis] = middle[axis] + height * normal[axis] / length;
    return true;
}

static void find_point_inside_cell(const grid *g, int64_t cell, double out[3])
{
    grid_walk walk = grid_walk_cell(g, cell);
    int64_t vertex, count = 0;
    double sum[3] = {0, 0, 0}, position[3];
    while (grid_walk_next(&walk, &vertex)) {
        grid_read_vertex_position(g, vertex, position);
        for (int axis = 0; axis < 3; axis++) sum[axis] += position[axis];
        count++;
    }
    for (int axis = 0; axis < 3; axis++) out[axis] = sum[axis] / (double)(count ? count : 1);
}

/* ---- building the outer mesh ------------------------------------------------------------------------------------- */

/* A face with more than four corners, or a concave quad. It is drawn as triangles (polygon.h). Of equal consecutive
 * corners only one is stored. */
typedef struct face_polygon {
    int count;
    int64_t *vertices;
    double (*positions)[3];
    int (*triangles)[3];
    void *work_memory;
    double normal[3]; /* normal that points towards the apexes of the cells built on the face */
} face_polygon;

/* The state while the outer mesh is built. The arrays have the largest size that the outer faces may require. */
typedef struct outer_work {
    const grid *cells;
    session_outer *out;
    /* for each vertex of the whole mesh, its index in the outer mesh; -1: the outer mesh does not have it, or the
     * current face must not use it (clear_vertex_map_for_new_face()) */
    int64_t *vertex_map;
    float *heights; /* value of the scalar at each vertex of the outer mesh: 0 on a face, -1 at an apex */
    int64_t vertex_count, cell_count, entry_count, pyramid_count;
    face_polygon polygon; /* buffer with space for the largest polygon */
    int64_t loop_end; /* index after the last entry of out->loops (vertices along which edges are drawn) that has been
                       * stored */
    /* Set if cells of higher order are split into pieces. Edge lines are then drawn along the edges of the caller's
     * faces, whose nodes are listed in `rims`, and not around the faces of pieces. */
    bool has_rims;
    session_rims rims;
    const uint32_t *parents; /* for each piece of a split cell, the caller's cell (session_topology.parents) */
    const session_mesh *whole;
    float (*normals)[3];         /* normal at each vertex of the outer mesh; NULL: the mesh has no normals */
    session_face_normals curved; /* computes normals of curved faces; used only if there are normals and rims */
    /* If the current face belongs to a linear piece of a cell: parent is the index of the caller's cell that is split
     * into this piece. `face` is the index, within the caller's cell, of the face on which the current face lies; -1:
     * the current face lies inside the caller's cell. */
    int64_t parent;
    int face;
    bool is_curved; /* true: normals of face `face` of the cell `parent` can be computed */
    /* Used if there are normals. vertex_map then contains only the vertices that were added for one curved face: face
     * mapped_face of the caller's cell mapped_parent. first_mapped: index of the first of these vertices in the outer
     * mesh. */
    int64_t mapped_parent, first_mapped;
    int mapped_face;
    double normal_scale; /* factor by which the normals at the vertices from first_mapped on are multiplied; 0: not
                            computed yet */
    /* for each face of the cell `parent`, the index in out->loops of the loop of nodes along its edges; 0: not stored
     * yet */
    int64_t rim_loops[RIMS_MOST_FACES];
} outer_work;

static int64_t add_vertex(outer_work *w, const double position[3], int64_t origin, float height)
{
    memcpy(w->out->coordinates + 3 * w->vertex_count, position, 3 * sizeof *position);
    w->out->vertex_origins[w->vertex_count] = origin;
    w->heights[w->vertex_count] = height;
    return w->vertex_count++;
}

static int64_t add_copied_vertex(outer_work *w, int64_t origin, const double position[3])
{
    int64_t *out = &w->vertex_map[origin];
    if (*out < 0) *out = add_vertex(w, position, origin, 0);
    return *out;
}

/* Used if there are normals, which differ between faces at a common vertex. Removes all vertices from vertex_map, so
 * that the current face gets vertices of its own, unless it lies on the same curved face of a cell as the previous
 * face. */
static void clear_vertex_map_for_new_face(outer_work *w)
{
    if (w->is_curved && w->face == w->mapped_face && w->parent == w->mapped_parent) return;
    for (int64_t v = w->first_mapped; v < w->vertex_count; v++) w->vertex_map[w->out->vertex_origins[v]] = -1;
    w->first_mapped = w->vertex_count;
    w->mapped_parent = w->parent;
    w->mapped_face = w->face;
    w->normal_scale = 0;
}

/* Computes the normal of the curved face at a corner. If that is not possible, computes the normal of the bilinear
 * patch or triangle instead; its length is twice the area of the triangle at the corner. */
static void find_corner_normal(outer_work *w, const corner_loop *loop, int corner, double out[3])
{
    const int count = loop->count, next = (corner + 1) % count, last = (corner + count - 1) % count;
    double a[3], b[3];
    if (w->is_curved && session_find_face_normal(&w->curved, w->whole, w->parent, w->face, loop->vertices[corner], out))
        return;
    subtract_vectors(loop->positions[next], loop->positions[corner], a);
    subtract_vectors(loop->positions[last], loop->positions[corner], b);
    vector3_cross(a, b, out);
}

/* Stores the normals at the corners and at the apex of the cell that is being added; the normal at the apex is not
 * used. All normals of a curved face are multiplied by the same factor, instead of being normalized: the normals of a
 * face of order 2 are polynomials, which pieces interpolate well only without normalization. */
static void add_normals(outer_work *w, const corner_loop *loop, int64_t apex)
{
    const int64_t *vertices = w->out->connectivity + w->entry_count - loop->count - 1;
    for (int i = 0; i < loop->count; i++) {
        double normal[3];
        find_corner_normal(w, loop, i, normal);
        const double length = vector3_length(normal);
        if (w->normal_scale == 0 && length > 0) w->normal_scale = 1 / length;
        for (int x = 0; x < 3; x++) w->normals[vertices[i]][x] = (float)(w->normal_scale * normal[x]);
    }
    memcpy(w->normals[apex], w->normals[vertices[0]], sizeof w->normals[apex]);
}

/* Adds a tet on a triangle, or a pyramid on a quad. The apex must have been added before. */
static void add_cell_between_face_and_apex(outer_work *w, const corner_loop *loop, int64_t apex, int64_t origin)
{
    if (w->normals) clear_vertex_map_for_new_face(w);
    w->out->offsets[w->cell_count] = w->entry_count;
    w->out->types[w->cell_count] = loop->count == 3 ? GRID_TET : GRID_PYRAMID;
    w->pyramid_count += loop->count == 4;
    w->out->cell_origins[w->cell_count++] = origin;
    for (int i = 0; i < loop->count; i++)
        w->out->connectivity[w->entry_count++] = add_copied_vertex(w, loop->vertices[i], loop->positions[i]);
    w->out->connectivity[w->entry_count++] = apex;
    if (w->normals) add_normals(w, loop, apex);
}

/* Adds a tet on a triangle, or a pyramid on a quad, together with its apex. Does nothing if the face's area is 0. */
static void add_cell_on_face(outer_work *w, corner_loop *loop, const double inside[3], int64_t origin)
{
    double apex[3];
    if (loop->count < 3) return;
    order_corners(loop);
    if (find_apex(loop, inside, apex))
        add_cell_between_face_and_apex(w, loop, add_vertex(w, apex, loop->vertices[0], -1), origin);
}

/* Computes a triangle of the polygon and the triangle's own apex. Returns false if its area is 0. */
static bool find_polygon_triangle(const face_polygon *p, int i, corner_loop *out, double apex[3])
{
    double inside[3];
    *out = (corner_loop){.count = 3};
    for (int k = 0; k < 3; k++) {
        out->vertices[k] = p->vertices[p->triangles[i][k]];
        memcpy(out->positions[k], p->positions[p->triangles[i][k]], sizeof out->positions[k]);
    }
    order_corners(out);
    for (int axis = 0; axis < 3; axis++)
        inside[axis] =
            (out->positions[0][axis] + out->positions[1][axis] + out->positions[2][axis]) / 3 + p->normal[axis];
    return find_apex(out, inside, apex);
}

/* Computes a common apex for all triangles of the polygon, the mean of the apexes that the triangles would have by
 * themselves. The tets on the triangles then share faces, and a ray along the line between two triangles passes from
 * one tet into the other; with separate apexes the ray might miss both tets. Returns false if the apex is not well
 * above each triangle, because the triangles are too far from a common plane. */
static bool find_common_apex(const face_polygon *p, double out[3])
{
    corner_loop loop;
    double own[3], height[3], normal[3];
    int count = 0;
    out[0] = out[1] = out[2] = 0;
    for (int i = 0; i + 2 < p->count; i++) {
        if (!find_polygon_triangle(p, i, &loop, own)) continue;
        for (int axis = 0; axis < 3; axis++) out[axis] += own[axis];
        count++;
    }
    for (int axis = 0; axis < 3 && count; axis++) out[axis] /= count;
    for (int i = 0; i + 2 < p->count; i++) {
        if (!find_polygon_triangle(p, i, &loop, own)) continue;
        find_normal(&loop, normal);
        subtract_vectors(own, loop.positions[0], height);
        const double most = vector3_dot(height, normal);
        subtract_vectors(out, loop.positions[0], height);
        if (!(vector3_dot(height, normal) / most > 0.25)) return false;
    }
    return count > 0;
}

/* Computes the polygon's normal. It points to the side of the polygon on which the point `inside` lies. If this point
 * is in the polygon's plane, the normal's component of largest magnitude is positive. The normal's length is about the
 * polygon's width. */
static void find_polygon_normal(face_polygon *p, const double inside[3])
{
    double towards[3], middle[3] = {0, 0, 0}, sum[3] = {0, 0, 0};
    for (int i = 0; i + 2 < p->count; i++) {
        double a[3], b[3];
        subtract_vectors(p->positions[p->triangles[i][1]], p->positions[p->triangles[i][0]], a);
        subtract_vectors(p->positions[p->triangles[i][2]], p->positions[p->triangles[i][0]], b);
        for (int axis = 0; axis < 3; axis++) {
            const int next = (axis + 1) % 3, last = (axis + 2) % 3;
            sum[axis] += a[next] * b[last] - a[last] * b[next];
        }
    }
    for (int i = 0; i < p->count; i++)
        for (int axis = 0; axis < 3; axis++) middle[axis] += p->positions[i][axis] / p->count;
    subtract_vectors(inside, middle, towards);
    const double length = sqrt(vector3_dot(sum, sum)), width = sqrt(length), side = vector3_dot(towards, sum);
    int largest = 0;
    for (int axis = 1; axis < 3; axis++)
        if (fabs(sum[axis]) > fabs(sum[largest])) largest = axis;
    const double sign = (fabs(side) > side_slack * length * width ? side : sum[largest]) < 0 ? -1 : 1;
    for (int axis = 0; axis < 3; axis++) p->normal[axis] = length > 0 ? sign * sum[axis] / width : 0;
}

/* Appends the polygon's vertices as a loop along which edges are drawn (render_part.loops), and assigns the loop to the
 * cells from index `first` on. */
static void add_loop(outer_work *w, const face_polygon *p, int64_t first)
{
    int64_t *loops = w->out->loops;
    for (int64_t cell = first; cell < w->cell_count; cell++) loops[cell] = w->loop_end;
    loops[w->loop_end++] = p->count;
    loops[w->loop_end++] = 1;
    for (int i = 0; i < p->count; i++) loops[w->loop_end++] = add_copied_vertex(w, p->vertices[i], p->positions[i]);
}

/* Appends the nodes along the edges of a face of the caller's cell (the face's rim) to out->loops, so that edges are
 * drawn along them. Returns the index of the new loop in out->loops. */
static int64_t add_rim_loop(outer_work *w, int64_t cell, int face)
{
    const session_rim_kind *of = session_get_rims_of_cell(&w->rims, cell);
    const int64_t loop = w->loop_end;
    w->out->loops[w->loop_end++] = of->counts[face];
    w->out->loops[w->loop_end++] = w->rims.rows.kinds[session_find_kind_of_cell(&w->rims.rows, cell)].nodes.order;
    for (int i = 0; i < of->counts[face]; i++) {
        const int64_t vertex = session_find_vertex_of_node(&w->rims.rows, cell, of->nodes[face][i]);
        double position[3];
        grid_read_vertex_position(w->cells, vertex, position);
        w->out->loops[w->loop_end++] = add_copied_vertex(w, vertex, position);
    }
    return loop;
}

/* Finds the face of a higher-order cell that contains a face of a linear piece of this cell. Stores the index of the
 * caller's cell in w->parent, and the index of its face in w->face; w->face is -1 if the piece's face lies inside the
 * cell. Sets w->is_curved if normals are requested and can be computed from the cell's polynomials. */
static void find_parent_face(outer_work *w, int64_t piece, const face_polygon *p)
{
    w->parent = w->parents[piece];
    if (w->parent != w->rims.cell) memset(w->rim_loops, 0, sizeof w->rim_loops);
    w->face = session_find_face_of_vertices(&w->rims, w->parent, p->vertices, p->count);
    w->is_curved = w->normals && w->face >= 0 && session_has_face_normals(&w->curved, w->whole, w->parent);
}

/* Sets the loop of the cells from index `first` on, which were built on a piece's face, to the rim of the face that
 * find_parent_face() has found: the nodes along that face's edges. Does nothing for a face inside its cell. */
static void assign_rim_loop_to_cells(outer_work *w, int64_t first)
{
    if (w->face < 0) return;
    if (!w->rim_loops[w->face]) w->rim_loops[w->face] = add_rim_loop(w, w->parent, w->face);
    for (int64_t i = first; i < w->cell_count; i++) w->out->loops[i] = w->rim_loops[w->face];
}

static void add_polygon(outer_work *w, face_polygon *p, const double inside[3], int64_t origin)
{
    const int64_t first = w->cell_count;
    double common[3], own[3];
    corner_loop loop;
    polygon_triangulate((const double(*)[3])p->positions, p->count, p->work_memory, p->triangles);
    find_polygon_normal(p, inside);
    const bool is_shared = find_common_apex(p, common);
    const int64_t apex = is_shared ? add_vertex(w, common, p->vertices[p->triangles[0][0]], -1) : -1;
    for (int i = 0; i + 2 < p->count; i++) {
        if (!find_polygon_triangle(p, i, &loop, own)) continue;
        add_cell_between_face_and_apex(w, &loop, is_shared ? apex : add_vertex(w, own, loop.vertices[0], -1), origin);
    }
    add_loop(w, p, first);
}

/* Returns whether a face is a concave quad. Returns false for faces of hexes, wedges and pyramids, which are always
 * bilinear patches. */
static bool is_concave(const session_face_loop *face, const double (*positions)[3], int count)
{
    return count == 4 && !face->corners && polygon_is_concave_quad(positions);
}

/* Reads the corners of a face into the polygon. */
static void read_polygon(const grid *g, const session_face_loop *face, face_polygon *p)
{
    p->count = 0;
    for (int64_t i = 0; i < face->size; i++) {
        p->vertices[p->count] = session_face_vertex(face, i);
        grid_read_vertex_position(g, p->vertices[p->count], p->positions[p->count]);
        if (p->count && vector3_compare(p->positions[p->count], p->positions[p->count - 1]) == 0) continue;
        p->count++;
    }
    while (p->count > 1 && vector3_compare(p->positions[p->count - 1], p->positions[0]) == 0) p->count--;
}

static void add_cells_on_outer_face(outer_work *w, const session_face *face)
{
    const session_cell_faces faces = session_faces_of_cell(w->cells, face->cell);
    const session_face_loop of = session_find_face_loop(&faces, face->face);
    face_polygon *p = &w->polygon;
    const int64_t first = w->cell_count;
    double inside[3];
    find_point_inside_cell(w->cells, face->cell, inside);
    read_polygon(w->cells, &of, p);
    if (w->has_rims) find_parent_face(w, face->cell, p);
    if (p->count > 4 || is_concave(&of, (const double(*)[3])p->positions, p->count)) {
        add_polygon(w, p, inside, face->cell);
    } else {
        corner_loop loop = {0};
        for (int i = 0; i < p->count; i++) add_corner(&loop, p->vertices[i], p->positions[i]);
        add_cell_on_face(w, &loop, inside, face->cell);
    }
    if (w->has_rims) assign_rim_loop_to_cells(w, first);
}

/* Upper bounds of the sizes of the arrays that a part's outer faces need in the outer mesh. */
typedef struct outer_counts {
    int64_t cell_count, entry_count; /* number of cells, and number of entries of the connectivity */
    int64_t loop_entry_count;        /* number of entries of the loops */
    int64_t largest_corner_count;    /* largest number of corners of one face */
} outer_counts;

/* Computes upper bounds of the sizes of arrays for the outer mesh of a part (outer_counts). entry_count also bounds the
 * number of vertices. If there are normals, the triangles of a polygon have no common vertices, and the polygon's loop
 * needs further vertices. */
static outer_counts find_array_size_bounds(const grid *g, const session_outer *outer, bool has_normals)
{
    outer_counts most = {0};
    for (int64_t i = 0; i < outer->face_count; i++) {
        const session_face *face = &outer->faces[i];
        const session_cell_faces faces = session_faces_of_cell(g, face->cell);
        const session_face_loop loop = session_find_face_loop(&faces, face->face);
        const int64_t size = loop.size;
        double positions[4][3];
        for (int k = 0; k < 4 && k < size; k++)
            grid_read_vertex_position(g, session_face_vertex(&loop, k), positions[k]);
        const bool is_polygon = size > 4 || is_concave(&loop, (const double(*)[3])positions, (int)size);
        most.cell_count += is_polygon ? size - 2 : 1;
        most.loop_entry_count += is_polygon ? size + 2 : 0;
        most.entry_count += is_polygon ? (has_normals ? 5 : 4) * (size - 2) : size + 1;
        most.largest_corner_count = size > most.largest_corner_count ? size : most.largest_corner_count;
    }
    return most;
}

/* Adds to the upper bounds in *most the space for the rims (nodes along the edges of faces) of the caller's cells that
 * have outer faces. A rim is stored as a loop. It may also need further vertices, because some of its nodes may lie on
 * no outer face. */
static void add_rim_sizes(const outer_work *w, const session_outer *outer, outer_counts *most)
{
    int64_t last = -1;
    for (int64_t i = 0; i < outer->face_count; i++) {
        const int64_t cell = w->parents[outer->faces[i].cell];
        if (cell == last) continue;
        const int64_t nodes = session_count_rim_nodes(&w->rims, cell);
        most->entry_count += nodes;
        most->loop_entry_count += nodes + 2 * RIMS_MOST_FACES;
        last = cell;
    }
}

static bool allocate_polygon(face_polygon *p, int64_t corners)
{
    const size_t count = (size_t)corners;
    p->vertices = base_alloc(count * sizeof *p->vertices);
    p->positions = base_alloc(count * sizeof *p->positions);
    p->triangles = base_alloc(count * sizeof *p->triangles);
    p->work_memory = base_alloc(polygon_work_bytes((int)corners));
    return p->vertices && p->positions && p->triangles && p->work_memory;
}

static void work_free(outer_work *w)
{
    base_free(w->vertex_map);
    base_free(w->heights);
    base_free(w->polygon.vertices);
    base_free(w->polygon.positions);
    base_free(w->polygon.triangles);
    base_free(w->polygon.work_memory);
    base_free(w->normals);
    session_rims_free(&w->rims);
    session_face_normals_free(&w->curved);
}

static bool work_create(const session_mesh *whole, bool has_normals, session_outer *out, outer_work *w)
{
    const grid *g = &whole->cells;
    outer_counts most = find_array_size_bounds(g, out, has_normals);
    *w = (outer_work){.cells = g,
                      .out = out,
                      .has_rims = whole->topology.is_split,
                      .parents = whole->topology.parents,
                      .whole = whole,
                      .face = -1,
                      .mapped_face = -1};
    if (w->has_rims && !session_rims_create(whole, &w->rims)) return false;
    if (w->has_rims && has_normals && !session_face_normals_create(whole, &w->curved)) return false;
    if (w->has_rims) add_rim_sizes(w, out, &most);
    const int64_t cells = most.cell_count, entries = most.entry_count, loops = most.loop_entry_count;
    if (most.largest_corner_count > INT32_MAX / 64) return false;
    out->bytes = entries * (int64_t)(5 * sizeof(int64_t) + sizeof(float)) + cells * 17;
    if (has_normals) out->bytes += entries * (int64_t)(sizeof *w->normals + sizeof(int32_t));
    if (loops) out->bytes += (cells + loops) * (int64_t)sizeof *out->loops;
    out->bytes += out->face_count * (int64_t)sizeof *out->faces;
    out->mesh = base_calloc(1, sizeof *out->mesh);
    out->coordinates = base_alloc((size_t)entries * 3 * sizeof *out->coordinates);
    out->connectivity = base_alloc((size_t)entries * sizeof *out->connectivity);
    out->vertex_origins = base_alloc((size_t)entries * sizeof *out->vertex_origins);
    out->offsets = base_alloc(((size_t)cells + 1) * sizeof *out->offsets);
    out->types = base_alloc((size_t)cells);
    if (loops) out->loops = base_calloc((size_t)(cells + loops), sizeof *out->loops);
    w->loop_end = cells;
    out->cell_origins = base_alloc((size_t)cells * sizeof *out->cell_origins);
    w->heights = base_alloc((size_t)entries * sizeof *w->heights);
    w->vertex_map = base_alloc((size_t)g->vertex_count * sizeof *w->vertex_map);
    if (has_normals) w->normals = base_calloc((size_t)entries, sizeof *w->normals);
    if (has_normals && !w->normals) return false;
    return out->mesh && out->coordinates && out->connectivity && out->vertex_origins && out->offsets && out->types &&
           (out->loops || !loops) && out->cell_origins && w->heights && w->vertex_map &&
           allocate_polygon(&w->polygon, most.largest_corner_count);
}

/* Returns the mesh as a grid. If all cells have one type, types and offsets are omitted, so that vectorized code can be
 * used. */
static grid describe_grid(const outer_work *w)
{
    const session_outer *out = w->out;
    const int64_t size = (int64_t)sizeof(double);
    grid g = {
        .vertex_count = w->vertex_count,
        .cell_count = w->cell_count,
        .connectivity = {.data = (const char *)out->connectivity, .stride = size, .is_wide = true, .is_integer = true},
        .cell_type = w->pyramid_count ? GRID_PYRAMID : GRID_TET};
    for (int axis = 0; axis < 3; axis++)
        g.coordinates[axis] =
            (grid_array){.data = (const char *)(out->coordinates + axis), .stride = 3 * size, .is_wide = true};
    if (w->pyramid_count == 0 || w->pyramid_count == w->cell_count) return g;
    g.offsets = (grid_array){.data = (const char *)out->offsets, .stride = size, .is_wide = true, .is_integer = true};
    g.cell_types = (const char *)out->types;
    g.cell_types_stride = g.cell_types_bytes = 1;
    return g;
}

/* Stores the normals as the gradients of the outer mesh's scalar, from which the renderer computes normals. Returns
 * false if memory runs out, or if there are too many vertices for 32-bit indices of gradients. */
static bool store_normals_as_gradients(outer_work *w, session_scalar *scalar)
{
    if (!w->normals) return true;
    if (w->vertex_count > INT32_MAX) return false;
    scalar->gradient_indices = base_alloc((size_t)w->vertex_count * sizeof *scalar->gradient_indices + 1);
    for (int64_t v = 0; v < w->vertex_count && scalar->gradient_indices; v++) scalar->gradient_indices[v] = (int32_t)v;
    scalar->gradients = w->normals;
    scalar->gradient_count = w->vertex_count;
    w->normals = NULL;
    return scalar->gradient_indices != NULL;
}

/* Completes the outer mesh. Its scalar takes ownership of w->heights and w->normals. Returns false if memory runs
 * out. */
static bool finish_mesh(const session_mesh *whole, outer_work *w)
{
    session_mesh *out = w->out->mesh;
    out->name = whole->name;
    out->is_given = true;
    out->is_topology_stale = true;
    out->cells = describe_grid(w);
    out->given.vertex_count = w->vertex_count;
    out->given.cell_count = out->drawn_count = w->cell_count;
    session_scalar *scalar = session_add_scalar(out);
    if (!scalar) return false;
    scalar->field = -1;
    scalar->are_values_stale = scalar->may_have_changed = false;
    scalar->distances = w->heights;
    w->heights = NULL;
    return store_normals_as_gradients(w, scalar);
}

insitu_status session_make_outer_mesh(const session_mesh *whole, session_outer *outer, bool has_normals,
                                      base_error *error)
{
    outer_work work;
    if (outer->mesh && (outer->mesh->scalars[0].gradients != NULL) == has_normals) return INSITU_OK;
    session_drop_outer_surface(outer, false);
    bool is_made = work_create(whole, has_normals, outer, &work);
    if (is_made) {
        for (int64_t v = 0; v < whole->cells.vertex_count; v++) work.vertex_map[v] = -1;
        for (int64_t i = 0; i < outer->face_count; i++) add_cells_on_outer_face(&work, &outer->faces[i]);
        outer->offsets[work.cell_count] = work.entry_count;
        is_made = finish_mesh(whole, &work);
    }
    work_free(&work);
    if (is_made) return INSITU_OK;
    session_drop_outer_surface(outer, false);
    return session_fail_for_memory(error, outer->face_count * 250, "the mesh of outer faces");
}

double *session_gather_outer_values(const session_outer *outer, const grid_field *field)
{
    const grid *g = &outer->mesh->cells;
    const int64_t *origins = field->is_cell_centred ? outer->cell_origins : outer->vertex_origins;
    const int64_t count = field->is_cell_centred ? g->cell_count : g->vertex_count;
    double *out = base_alloc((size_t)count * sizeof *out);
    for (int64_t i = 0; i < count && out; i++) out[i] = grid_field_value(field, origins[i]);
    return out;
}
