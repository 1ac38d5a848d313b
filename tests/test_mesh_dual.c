/* Makes polyhedra with faces that are not plane (test_mesh_dual.h). */
#include "test_mesh_dual.h"

#include <stdlib.h>
#include <string.h>

#include "test_mesh_make.h"

/* ---- random polyhedra ---- */

enum { MOST_POINTS = 22, MOST_TRIANGLES = 2 * MOST_POINTS - 4 };

/* Directions, and the triangles of their convex hull with outward orientation. */
typedef struct hull {
    int point_count, triangle_count;
    double points[MOST_POINTS][3];
    int triangles[MOST_TRIANGLES][3];
    double normals[MOST_TRIANGLES][3];
} hull;

const char *test_random_polyhedron_name(test_random_polyhedron kind)
{
    static const char *const names[TEST_RANDOM_COUNT] = {"random hulls", "random duals", "random spikes"};
    return names[kind];
}

static double dot_product(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void normalize_vector(double *v)
{
    const double length = sqrt(dot_product(v, v));
    for (int a = 0; a < 3; a++) v[a] /= length;
}

static void draw_random_direction(uint64_t index, uint64_t seed, double out[3])
{
    const double z = test_uniform_between(2 * index, seed, -1, 1),
                 angle = 6.283185307 * test_uniform(2 * index + 1, seed);
    out[0] = sqrt(1 - z * z) * cos(angle);
    out[1] = sqrt(1 - z * z) * sin(angle);
    out[2] = z;
}

/* Chooses directions that are spread over the sphere. They must not be too close to each other, because the hull would
 * have slivers. */
static void spread_points(hull *h, uint64_t seed)
{
    double least = 1.9 / sqrt(h->point_count);
    for (uint64_t n = 0, tries = 0; n < (uint64_t)h->point_count; tries++) {
        double nearest = 4;
        draw_random_direction(tries, seed, h->points[n]);
        for (uint64_t i = 0; i < n; i++) nearest = fmin(nearest, 2 - 2 * dot_product(h->points[i], h->points[n]));
        if (nearest >= least * least)
            n++;
        else
            least *= 0.995;
    }
}

static void compute_triangle_normal(const hull *h, const int *t, double out[3])
{
    double d[2][3];
    for (int k = 0; k < 2; k++)
        for (int a = 0; a < 3; a++) d[k][a] = h->points[t[k + 1]][a] - h->points[t[0]][a];
    for (int a = 0; a < 3; a++) out[a] = d[0][(a + 1) % 3] * d[1][(a + 2) % 3] - d[0][(a + 2) % 3] * d[1][(a + 1) % 3];
    normalize_vector(out);
}

/* Returns whether the triangle is part of the hull: all other points are behind its plane. */
static bool is_outside(const hull *h, const int *t, const double *normal)
{
    for (int i = 0; i < h->point_count; i++)
        if (i != t[0] && i != t[1] && i != t[2] &&
            dot_product(normal, h->points[i]) > dot_product(normal, h->points[t[0]]))
            return false;
    return true;
}

static void find_triangles(hull *h)
{
    h->triangle_count = 0;
    for (int i = 0; i < h->point_count; i++)
        for (int j = i + 1; j < h->point_count; j++)
            for (int k = j + 1; k < h->point_count; k++)
                for (int side = 0; side < 2; side++) {
                    const int t[3] = {i, side ? k : j, side ? j : k};
                    double normal[3];
                    compute_triangle_normal(h, t, normal);
                    if (h->triangle_count == MOST_TRIANGLES || !is_outside(h, t, normal)) continue;
                    memcpy(h->normals[h->triangle_count], normal, sizeof normal);
                    memcpy(h->triangles[h->triangle_count++], t, sizeof t);
                }
}

/* Makes a hull that is closed and contains the origin. */
static void make_hull(uint64_t seed, hull *h)
{
    bool is_good = false;
    for (uint64_t n = 0; !is_good; n++) {
        h->point_count = 6 + (int)(17 * test_uniform(n, seed));
        spread_points(h, test_hash(n, seed));
        find_triangles(h);
        is_good = h->triangle_count == 2 * h->point_count - 4;
        for (int t = 0; t < h->triangle_count; t++)
            is_good = is_good && dot_product(h->normals[t], h->points[h->triangles[t][0]]) > 0.05;
    }
}

/* Lists the triangles around a point in cyclic order: the last corner of a triangle is the first corner of the next
 * one. Returns their number. */
static int list_triangles_around(const hull *h, int point, int64_t out[MOST_TRIANGLES])
{
    int first = -1, next = -1, count = 0;
    do {
        for (int t = 0; t < h->triangle_count; t++)
            for (int k = 0; k < 3; k++) {
                const int *v = h->triangles[t];
                if (v[k] != point || (next >= 0 && v[(k + 1) % 3] != next)) continue;
                if (first < 0) first = v[(k + 1) % 3];
                out[count++] = t;
                next = v[(k + 2) % 3];
                t = h->triangle_count;
                break;
            }
    } while (next != first);
    return count;
}

static void add_random_vertex(test_mesh *mesh, const double *direction, double least, uint64_t seed)
{
    const uint64_t index = (uint64_t)mesh->vertex_count;
    const double radius = test_uniform_between(index, seed, least, 1);
    const double p[3] = {radius * direction[0], radius * direction[1], radius * direction[2]};
    mesh->values[test_mesh_add_vertex(mesh, p)] = test_uniform_between(index, seed + 1, -1, 1);
}

void test_mesh_make_random_polyhedron(test_random_polyhedron kind, uint64_t seed, test_mesh *out)
{
    const bool is_hull = kind == TEST_RANDOM_HULL;
    const double least = kind == TEST_RANDOM_SPIKY ? 0.2 : 0.75;
    int64_t faces[MOST_TRIANGLES], loop[MOST_TRIANGLES];
    hull h;
    make_hull(seed, &h);
    const int face_count = is_hull ? h.triangle_count : h.point_count;
    const int vertex_count = is_hull ? h.point_count : h.triangle_count;
    test_mesh_allocate(out, vertex_count, 1, face_count);
    test_mesh_allocate_faces(out, face_count, 3 * (int64_t)MOST_TRIANGLES);
    for (int i = 0; i < vertex_count; i++)
        add_random_vertex(out, is_hull ? h.points[i] : h.normals[i], least, test_hash(seed, 3));
    for (int i = 0; i < face_count; i++) {
        for (int k = 0; is_hull && k < 3; k++) loop[k] = h.triangles[i][k];
        faces[i] = test_mesh_add_face(out, loop, is_hull ? 3 : list_triangles_around(&h, i, loop));
    }
    test_mesh_add_polyhedron(out, faces, face_count);
}

/* ---- duals ---- */

enum { MOST_AROUND = 16, MOST_EDGES = 32 };

typedef struct edge {
    int64_t ends[2]; /* -1 if the slot of the table is empty */
    int tet_count;
    int64_t tets[MOST_AROUND];
} edge;

typedef struct tet_mesh {
    int n;
    int64_t point_count, tet_count, table_size;
    double (*points)[3]; /* corners of the lattice, followed by the centres of the cubes */
    int64_t (*tets)[4];
    edge *table;
} tet_mesh;

static int64_t get_corner_index(const tet_mesh *m, int x, int y, int z)
{
    return x + (m->n + 1) * (y + (int64_t)(m->n + 1) * z);
}

static void place_points(tet_mesh *m, double jitter)
{
    const double side = 2.0 / m->n;
    const int64_t corners = get_corner_index(m, m->n, m->n, m->n) + 1;
    for (int64_t i = 0; i < m->point_count; i++) {
        const bool is_corner = i < corners;
        const int64_t at = is_corner ? i : i - corners, across = is_corner ? m->n + 1 : m->n;
        const int64_t place[3] = {at % across, at / across % across, at / across / across};
        bool is_inner = true;
        for (int a = 0; a < 3; a++) is_inner = is_inner && (!is_corner || (place[a] > 0 && place[a] < m->n));
        for (int a = 0; a < 3; a++) {
            m->points[i][a] = ((double)place[a] + (is_corner ? 0 : 0.5)) * side - 1;
            if (is_inner) m->points[i][a] += jitter * side * test_uniform_between((uint64_t)(3 * i + a), 21, -1, 1);
        }
    }
}

/* Adds two tets between the centre of a cube and the cube's face across an axis on the given side. A hash of the face
 * chooses the diagonal that splits the face, so that the neighbouring cube uses the same diagonal. */
static void add_face_tets(tet_mesh *m, const int cube[3], int axis, int side, int64_t centre)
{
    int64_t around[4];
    for (int i = 0; i < 4; i++) {
        int at[3] = {cube[0], cube[1], cube[2]};
        at[axis] += side;
        at[(axis + 1) % 3] += i == 1 || i == 2;
        at[(axis + 2) % 3] += i >= 2;
        around[i] = get_corner_index(m, at[0], at[1], at[2]);
    }
    const int first = test_uniform((uint64_t)(3 * around[0] + axis), 22) < 0.5;
    for (int half = 0; half < 2; half++) {
        int64_t *tet = m->tets[m->tet_count++];
        tet[0] = around[first];
        tet[1] = around[(first + 1 + half) % 4];
        tet[2] = around[(first + 2 + half) % 4];
        tet[3] = centre;
    }
}

static void make_tets(tet_mesh *m)
{
    int64_t centre = get_corner_index(m, m->n, m->n, m->n) + 1;
    for (int z = 0; z < m->n; z++)
        for (int y = 0; y < m->n; y++)
            for (int x = 0; x < m->n; x++, centre++)
                for (int face = 0; face < 6; face++)
                    add_face_tets(m, (const int[]){x, y, z}, face / 2, face % 2, centre);
}

static edge *find_edge(const tet_mesh *m, int64_t a, int64_t b)
{
    const int64_t low = a < b ? a : b, high = a < b ? b : a;
    int64_t at = (int64_t)(test_hash((uint64_t)low, (uint64_t)high) % (uint64_t)m->table_size);
    while (m->table[at].ends[0] >= 0 && (m->table[at].ends[0] != low || m->table[at].ends[1] != high))
        at = (at + 1) % m->table_size;
    m->table[at].ends[0] = low;
    m->table[at].ends[1] = high;
    return &m->table[at];
}

static void find_edges(tet_mesh *m)
{
    for (int64_t i = 0; i < m->table_size; i++) m->table[i].ends[0] = -1;
    for (int64_t tet = 0; tet < m->tet_count; tet++)
        for (int i = 0; i < 4; i++)
            for (int k = i + 1; k < 4; k++) {
                edge *e = find_edge(m, m->tets[tet][i], m->tets[tet][k]);
                e->tets[e->tet_count++] = tet;
            }
}

static bool contains_tet_point(const int64_t *tet, int64_t point)
{
    return tet[0] == point || tet[1] == point || tet[2] == point || tet[3] == point;
}

/* Returns whether two tets have a common triangle. */
static bool are_adjacent_tets(const int64_t *one, const int64_t *other)
{
    int common = 0;
    for (int i = 0; i < 4; i++) common += contains_tet_point(other, one[i]);
    return common == 3;
}

/* Sorts the tets at an edge into cyclic order around the edge. */
static void sort_tets_around_edge(const tet_mesh *m, edge *e)
{
    for (int i = 0; i + 1 < e->tet_count; i++)
        for (int k = i + 1; k < e->tet_count; k++) {
            const int64_t tet = e->tets[k];
            if (!are_adjacent_tets(m->tets[e->tets[i]], m->tets[tet])) continue;
            e->tets[k] = e->tets[i + 1];
            e->tets[i + 1] = tet;
            break;
        }
}

static bool is_inner_point(const tet_mesh *m, int64_t point)
{
    const int64_t across = m->n + 1;
    if (point >= across * across * across) return true;
    const int64_t place[3] = {point % across, point / across % across, point / across / across};
    for (int a = 0; a < 3; a++)
        if (place[a] == 0 || place[a] == m->n) return false;
    return true;
}

/* Adds a face of the dual for each edge of which an end is an inner point. Lists the face for both ends; the list of a
 * point begins at faces[MOST_EDGES * point]. */
static void add_dual_faces(const tet_mesh *m, test_mesh *out, int64_t *faces, int *counts)
{
    for (int64_t i = 0; i < m->table_size; i++) {
        edge *e = &m->table[i];
        if (e->ends[0] < 0 || !(is_inner_point(m, e->ends[0]) || is_inner_point(m, e->ends[1]))) continue;
        sort_tets_around_edge(m, e);
        const int64_t face = test_mesh_add_face(out, e->tets, e->tet_count);
        for (int end = 0; end < 2; end++) faces[MOST_EDGES * e->ends[end] + counts[e->ends[end]]++] = face;
    }
}

static void add_tet_means(const tet_mesh *m, test_mesh *out)
{
    for (int64_t tet = 0; tet < m->tet_count; tet++) {
        double p[3] = {0, 0, 0};
        for (int i = 0; i < 4; i++)
            for (int a = 0; a < 3; a++) p[a] += m->points[m->tets[tet][i]][a] / 4;
        test_mesh_add_vertex(out, p);
    }
}

void test_mesh_make_dual(int n, double jitter, test_function *f, test_mesh *out)
{
    tet_mesh m = {.n = n};
    const int64_t cubes = (int64_t)n * n * n, edges = 24 * cubes;
    m.point_count = get_corner_index(&m, n, n, n) + 1 + cubes;
    m.table_size = 4 * edges;
    m.points = test_allocate(m.point_count, sizeof *m.points);
    m.tets = test_allocate(12 * cubes, sizeof *m.tets);
    m.table = test_allocate(m.table_size, sizeof *m.table);
    int64_t *faces = test_allocate(MOST_EDGES * m.point_count, sizeof *faces);
    int *counts = test_allocate(m.point_count, sizeof *counts);
    place_points(&m, jitter);
    make_tets(&m);
    find_edges(&m);
    test_mesh_allocate(out, m.tet_count, m.point_count, MOST_EDGES * m.point_count);
    test_mesh_allocate_faces(out, edges, MOST_AROUND * edges);
    add_tet_means(&m, out);
    add_dual_faces(&m, out, faces, counts);
    for (int64_t i = 0; i < m.point_count; i++)
        if (is_inner_point(&m, i)) test_mesh_add_polyhedron(out, faces + MOST_EDGES * i, counts[i]);
    test_mesh_set_values(out, f);
    free(m.points);
    free(m.tets);
    free(m.table);
    free(faces);
    free(counts);
}

/* ---- random polyhedra and duals ---- */

void test_mesh_split_quads(test_mesh *mesh)
{
    test_mesh old = *mesh;
    int64_t *halves = test_allocate(old.face_count, sizeof *halves);
    test_mesh_allocate(mesh, old.vertex_count, old.cell_count, 2 * old.connectivity_count);
    test_mesh_allocate_faces(mesh, 2 * old.face_count, 2 * old.face_connectivity_count);
    mesh->vertex_count = old.vertex_count;
    memcpy(mesh->coordinates, old.coordinates, 3 * (size_t)old.vertex_count * sizeof(double));
    memcpy(mesh->values, old.values, (size_t)old.vertex_count * sizeof(double));
    memcpy(mesh->ghosts, old.ghosts, (size_t)old.cell_count);
    for (int64_t face = 0; face < old.face_count; face++) {
        const int64_t *v = old.face_connectivity + old.face_offsets[face];
        const int64_t count = old.face_offsets[face + 1] - old.face_offsets[face];
        halves[face] = test_mesh_add_face(mesh, v, count == 4 ? 3 : count);
        if (count == 4) test_mesh_add_face(mesh, (const int64_t[]){v[0], v[2], v[3]}, 3);
    }
    for (int64_t cell = 0; cell < old.cell_count; cell++) {
        int64_t faces[128], count = 0;
        for (int64_t i = old.offsets[cell]; i < old.offsets[cell + 1]; i++) {
            const int64_t face = old.connectivity[i];
            faces[count++] = halves[face];
            if (old.face_offsets[face + 1] - old.face_offsets[face] == 4) faces[count++] = halves[face] + 1;
        }
        test_mesh_add_polyhedron(mesh, faces, count);
    }
    free(halves);
    test_mesh_free(&old);
}
