/* Proof of a polyhedron: its faces are faces, and together they bound something. A ray that goes into a cell must come
 * out: along every edge of the faces exactly two of them meet. The edges are sorted, so that those of a pair stand side
 * by side; an edge from a vertex to itself bounds nothing and is left out. */
#include "session_faces.h"

#include <stdlib.h>
#include <string.h>

#include "memory.h"

struct face_edge {
    int64_t low, high, face;
};

void session_faces_free(face_room *room)
{
    base_free(room->edges);
    *room = (face_room){0};
}

static bool make_room(face_room *room, int64_t count)
{
    if (count <= room->capacity) return true;
    const int64_t capacity = count + count / 2 + 64;
    struct face_edge *edges = base_realloc(room->edges, (size_t)capacity * sizeof *edges);
    if (!edges) return false;
    room->edges = edges;
    room->capacity = capacity;
    return true;
}

static bool is_finite_vertex(const grid *g, int64_t vertex, double position[3])
{
    grid_vertex(g, vertex, position);
    return isfinite(position[0]) && isfinite(position[1]) && isfinite(position[2]);
}

static face_fault check_face(const session_mesh *mesh, bool is_ghost, face_place *place)
{
    const grid *g = &mesh->cells;
    if (place->face < 0 || place->face >= g->face_count) return FACE_BAD_INDEX;
    grid_face_vertices(g, place->face, &place->first, &place->next);
    if (place->first < 0 || place->next < place->first || place->next > mesh->given.face_connectivity_count)
        return FACE_BAD_OFFSETS;
    if (place->next - place->first < 3) return FACE_TOO_SMALL;
    for (int64_t i = place->first; i < place->next; i++) {
        place->vertex = grid_array_index(&g->face_connectivity, i);
        if (place->vertex < 0 || place->vertex >= g->vertex_count) return FACE_BAD_VERTEX;
        if (!is_ghost && !is_finite_vertex(g, place->vertex, place->position)) return FACE_BAD_COORDINATE;
    }
    return FACES_GOOD;
}

static int64_t add_edges(const grid *g, const face_place *place, struct face_edge *edges, int64_t count)
{
    int64_t from = grid_array_index(&g->face_connectivity, place->next - 1);
    for (int64_t i = place->first; i < place->next; i++) {
        const int64_t to = grid_array_index(&g->face_connectivity, i);
        if (from != to) edges[count++] = (struct face_edge){from < to ? from : to, from < to ? to : from, place->face};
        from = to;
    }
    return count;
}

static int compare_edges(const void *left, const void *right)
{
    const struct face_edge *a = left, *b = right;
    if (a->low != b->low) return a->low < b->low ? -1 : 1;
    if (a->high != b->high) return a->high < b->high ? -1 : 1;
    return a->face < b->face ? -1 : a->face > b->face;
}

static face_fault check_edges(struct face_edge *edges, int64_t count, face_place *place)
{
    if (count) qsort(edges, (size_t)count, sizeof *edges, compare_edges);
    for (int64_t i = 0; i < count; i += 2) {
        int64_t end = i;
        while (end < count && edges[end].low == edges[i].low && edges[end].high == edges[i].high) end++;
        if (end - i == 2 && edges[i].face != edges[i + 1].face) continue;
        place->face = edges[i].face;
        place->vertex = edges[i].low;
        place->other = edges[i].high;
        place->sharing = end - i < 1000 ? (int)(end - i) : 1000;
        return FACES_OPEN;
    }
    return FACES_GOOD;
}

face_fault session_check_faces(const session_mesh *mesh, int64_t cell, face_room *room, face_place *place)
{
    const grid *g = &mesh->cells;
    int64_t first, end, edges = 0;
    grid_cell_faces(g, cell, &first, &end);
    place->count = end - first;
    if (place->count < 4) return FACES_TOO_FEW;
    for (int64_t i = first; i < end; i++) {
        place->face = grid_array_index(&g->connectivity, i);
        const face_fault fault = check_face(mesh, grid_is_ghost(g, cell), place);
        if (fault) return fault;
        if (!make_room(room, edges + place->next - place->first)) return FACES_NO_MEMORY;
        edges = add_edges(g, place, room->edges, edges);
    }
    return check_edges(room->edges, edges, place);
}

/* ---- volume --------------------------------------------------------------------------------------------------
 *
 * The mean size of cells, which steps are in, comes of it. So it is of the cell's geometry alone: another rank may list
 * a face from another vertex on or the other way round, and faces in another order. What is left is rounding, which the
 * mean size is rid of (session_space.c). */

typedef struct cell_frame {
    double mean[3]; /* of the vertices, each as often as faces have it */
    double least[3];
    double box; /* volume */
} cell_frame;

static bool comes_before(const double a[3], const double b[3])
{
    for (int axis = 0; axis < 3; axis++)
        if (a[axis] != b[axis]) return a[axis] < b[axis];
    return false;
}

typedef struct frame_sums {
    double sum[3], lower[3], upper[3];
    double count;
} frame_sums;

/* A vertex beside itself is one. */
static void add_face(const grid *g, int64_t face, frame_sums *sums, double least[3])
{
    int64_t from, to;
    grid_face_vertices(g, face, &from, &to);
    int64_t before = grid_array_index(&g->face_connectivity, to - 1);
    for (int64_t i = from; i < to; i++) {
        double p[3];
        const int64_t vertex = grid_array_index(&g->face_connectivity, i);
        if (vertex == before) continue;
        before = vertex;
        grid_vertex(g, vertex, p);
        if (comes_before(p, least)) memcpy(least, p, sizeof p);
        for (int axis = 0; axis < 3; axis++) {
            sums->sum[axis] += p[axis];
            sums->lower[axis] = p[axis] < sums->lower[axis] ? p[axis] : sums->lower[axis];
            sums->upper[axis] = p[axis] > sums->upper[axis] ? p[axis] : sums->upper[axis];
        }
        sums->count++;
    }
}

static cell_frame frame_of(const grid *g, int64_t cell)
{
    cell_frame frame = {.least = {INFINITY, INFINITY, INFINITY}, .box = 1};
    frame_sums sums = {.lower = {INFINITY, INFINITY, INFINITY}, .upper = {-INFINITY, -INFINITY, -INFINITY}};
    int64_t first, end;
    grid_cell_faces(g, cell, &first, &end);
    for (int64_t i = first; i < end; i++) add_face(g, grid_array_index(&g->connectivity, i), &sums, frame.least);
    if (sums.count == 0) return (cell_frame){0};
    for (int axis = 0; axis < 3; axis++) {
        frame.mean[axis] = sums.sum[axis] / sums.count;
        frame.box *= sums.upper[axis] - sums.lower[axis];
    }
    return frame;
}

static double tet_volume(const double *a, const double *b, const double *c)
{
    return fabs(a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
                a[2] * (b[0] * c[1] - b[1] * c[0])) /
           6;
}

static void corner_from(const grid *g, int64_t entry, const double mean[3], double out[3])
{
    grid_vertex(g, grid_array_index(&g->face_connectivity, entry), out);
    for (int axis = 0; axis < 3; axis++) out[axis] -= mean[axis];
}

/* Of the tet on a triangle with a corner of the cell, all relative to the mean. */
static double volume_from(const double origin[3], double corners[3][3])
{
    double d[3][3];
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 3; axis++) d[i][axis] = corners[i][axis] - origin[axis];
    return tet_volume(d[0], d[1], d[2]);
}

/* The entry of a face's least vertex, from which its canonical triangles fan out. Where a face passes it twice, either
 * will do: the fan has the same triangles, and some of no area. */
static int64_t least_entry(const grid *g, int64_t from, int64_t to)
{
    int64_t least = from;
    double position[3], p[3];
    grid_vertex(g, grid_array_index(&g->face_connectivity, from), position);
    for (int64_t i = from + 1; i < to; i++) {
        grid_vertex(g, grid_array_index(&g->face_connectivity, i), p);
        if (!comes_before(p, position)) continue;
        memcpy(position, p, sizeof p);
        least = i;
    }
    return least;
}

/* Of tets: all with the mean, and all with a corner of the cell. */
typedef struct volume_sums {
    int64_t triangles;
    double from_mean, from_corner;
} volume_sums;

static void add_fan(const grid *g, int64_t face, const double mean[3], const double origin[3], volume_sums *sums)
{
    int64_t from, to;
    double corners[3][3];
    grid_face_vertices(g, face, &from, &to);
    const int64_t least = least_entry(g, from, to), count = to - from;
    corner_from(g, least, mean, corners[0]);
    corner_from(g, from + (least - from + 1) % count, mean, corners[1]);
    for (int64_t k = 2; k < count; k++, sums->triangles++) {
        corner_from(g, from + (least - from + k) % count, mean, corners[2]);
        sums->from_mean += tet_volume(corners[0], corners[1], corners[2]);
        sums->from_corner += volume_from(origin, corners);
        memcpy(corners[1], corners[2], sizeof corners[2]);
    }
}

/* What rounding may leave of a triangle's tet with a corner of the same plane, of the cell's box. With u = 2^-53: an
 * edge is of three differences, each off by u of the box's side (the mean, whatever it is, drops out), a determinant's
 * six products of three edges by 9 u more, 2 u and 3 u of sums and products: 6 times 14 u, over 6. 32 u leaves room for
 * the sum over triangles, which are few beside 1 / u, the box's own roundings and squares of u. */
static const double flat_share = 0x1p-48;

double session_polyhedron_volume(const grid *g, int64_t cell, bool *is_flat)
{
    int64_t first, end;
    double origin[3];
    volume_sums sums = {0};
    const cell_frame frame = frame_of(g, cell);
    for (int axis = 0; axis < 3; axis++) origin[axis] = frame.least[axis] - frame.mean[axis];
    grid_cell_faces(g, cell, &first, &end);
    for (int64_t i = first; i < end; i++) add_fan(g, grid_array_index(&g->connectivity, i), frame.mean, origin, &sums);
    *is_flat = sums.from_corner <= flat_share * (double)sums.triangles * frame.box;
    return *is_flat ? 0 : sums.from_mean;
}

/* ---- words --------------------------------------------------------------------------------------------------- */

insitu_status session_describe_faces(const session_mesh *mesh, int64_t cell, face_fault fault, const face_place *place,
                                     base_error *error)
{
    const char *name = mesh->name;
    const long long at = cell, face = place->face, vertex = place->vertex;
    switch (fault) {
    case FACES_NO_MEMORY:
        return base_fail(error, INSITU_ERROR_MEMORY, "mesh \"%s\": no memory to check cell %lld", name, at);
    case FACES_TOO_FEW:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): %lld faces, a closed surface has at least 4", name, at,
                         (long long)place->count);
    case FACE_BAD_INDEX:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face index %lld is outside 0..%lld", name, at, face,
                         (long long)mesh->given.face_count - 1);
    case FACE_BAD_OFFSETS:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face %lld: offsets %lld and %lld do not rise within "
                         "0..%lld",
                         name, at, face, (long long)place->first, (long long)place->next,
                         (long long)mesh->given.face_connectivity_count);
    case FACE_TOO_SMALL:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face %lld has %lld vertices, at least 3 are needed",
                         name, at, face, (long long)(place->next - place->first));
    case FACE_BAD_VERTEX:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face %lld: vertex index %lld is outside 0..%lld", name,
                         at, face, vertex, (long long)mesh->given.vertex_count - 1);
    case FACE_BAD_COORDINATE:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face %lld: vertex %lld has a coordinate that is not "
                         "finite: (%g, %g, %g)",
                         name, at, face, vertex, place->position[0], place->position[1], place->position[2]);
    case FACES_OPEN:
        return base_fail(error, INSITU_ERROR_MESH,
                         "mesh \"%s\": cell %lld (polyhedron): face %lld: the edge from vertex %lld to %lld occurs %d "
                         "times, not once in each of two faces: the surface is not closed",
                         name, at, face, vertex, (long long)place->other, place->sharing);
    case FACES_GOOD: break;
    }
    return INSITU_OK;
}
