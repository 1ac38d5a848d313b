/* The distance between the samples that a ray takes in a volume depends on the mean size of cells, which is computed
 * from the volumes of the cells. Therefore a cell's volume must depend only on the cell's geometry, and not on the
 * order in which faces and vertices are listed, which may differ between ranks. Volumes may still differ by rounding,
 * but the mean size does not, because it is rounded to few bits (session_space.c). */
#include "session_polyhedron.h"

#include <string.h>

#include "vector3.h"

typedef struct cell_frame {
    /* mean of the cell's vertices, in which the weight of a vertex is the number of the cell's faces that contain it */
    double mean[3];
    double least_vertex[3]; /* position of the cell's lexicographically first vertex */
    double box_volume;      /* volume of the bounding box */
} cell_frame;

typedef struct frame_sums {
    double sum[3], lower[3], upper[3];
    double count;
} frame_sums;

/* Adds a face's vertices to the sums and the bounds, and updates `least`, the cell's lexicographically first vertex.
 * Consecutive repetitions of a vertex are added once. */
static void add_face_vertices_to_sums(const grid *g, int64_t face, frame_sums *sums, double least[3])
{
    int64_t from, to;
    grid_face_vertices(g, face, &from, &to);
    int64_t before = grid_read_index(&g->face_connectivity, to - 1);
    for (int64_t i = from; i < to; i++) {
        double p[3];
        const int64_t vertex = grid_read_index(&g->face_connectivity, i);
        if (vertex == before) continue;
        before = vertex;
        grid_read_vertex_position(g, vertex, p);
        if (vector3_compare(p, least) < 0) memcpy(least, p, sizeof p);
        for (int axis = 0; axis < 3; axis++) {
            sums->sum[axis] += p[axis];
            sums->lower[axis] = p[axis] < sums->lower[axis] ? p[axis] : sums->lower[axis];
            sums->upper[axis] = p[axis] > sums->upper[axis] ? p[axis] : sums->upper[axis];
        }
        sums->count++;
    }
}

static cell_frame find_mean_and_least_vertex(const grid *g, int64_t cell)
{
    cell_frame frame = {.least_vertex = {INFINITY, INFINITY, INFINITY}, .box_volume = 1};
    frame_sums sums = {.lower = {INFINITY, INFINITY, INFINITY}, .upper = {-INFINITY, -INFINITY, -INFINITY}};
    int64_t first, end;
    grid_cell_faces(g, cell, &first, &end);
    for (int64_t i = first; i < end; i++)
        add_face_vertices_to_sums(g, grid_read_index(&g->connectivity, i), &sums, frame.least_vertex);
    if (sums.count == 0) return (cell_frame){0};
    for (int axis = 0; axis < 3; axis++) {
        frame.mean[axis] = sums.sum[axis] / sums.count;
        frame.box_volume *= sums.upper[axis] - sums.lower[axis];
    }
    return frame;
}

static double tet_volume(const double *a, const double *b, const double *c)
{
    return fabs(a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) +
                a[2] * (b[0] * c[1] - b[1] * c[0])) /
           6;
}

static void read_relative_corner(const grid *g, int64_t entry, const double mean[3], double out[3])
{
    grid_read_vertex_position(g, grid_read_index(&g->face_connectivity, entry), out);
    for (int axis = 0; axis < 3; axis++) out[axis] -= mean[axis];
}

/* Returns the volume of the tet that a triangle forms with `origin`, the cell's lexicographically first vertex; all
 * positions are relative to the mean of the vertices. */
static double tet_volume_from_origin(const double origin[3], double corners[3][3])
{
    double d[3][3];
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 3; axis++) d[i][axis] = corners[i][axis] - origin[axis];
    return tet_volume(d[0], d[1], d[2]);
}

/* Returns the entry of a face's lexicographically first vertex, at which its canonical fan of triangles begins. If the
 * face contains that vertex twice, either entry may be returned, because both fans have the same triangles, apart from
 * triangles of area 0. */
static int64_t find_first_vertex_entry(const grid *g, int64_t from, int64_t to)
{
    int64_t least = from;
    double position[3], p[3];
    grid_read_vertex_position(g, grid_read_index(&g->face_connectivity, from), position);
    for (int64_t i = from + 1; i < to; i++) {
        grid_read_vertex_position(g, grid_read_index(&g->face_connectivity, i), p);
        if (vector3_compare(p, position) >= 0) continue;
        memcpy(position, p, sizeof p);
        least = i;
    }
    return least;
}

/* Sums of tet volumes over the triangles of a cell's faces. Each triangle forms one tet with the mean of the cell's
 * vertices, and one with the cell's lexicographically first vertex. The sum of the latter shows whether the cell is
 * flat. */
typedef struct volume_sums {
    int64_t triangle_count;
    double volume_from_mean, volume_from_corner;
} volume_sums;

/* Adds the tets on the fan of triangles of a face to the sums. mean: mean of the cell's vertices. origin: position of
 * the cell's lexicographically first vertex, relative to the mean. */
static void add_tets_of_face(const grid *g, int64_t face, const double mean[3], const double origin[3],
                             volume_sums *sums)
{
    int64_t from, to;
    double corners[3][3];
    grid_face_vertices(g, face, &from, &to);
    const int64_t least = find_first_vertex_entry(g, from, to), count = to - from;
    read_relative_corner(g, least, mean, corners[0]);
    read_relative_corner(g, from + (least - from + 1) % count, mean, corners[1]);
    for (int64_t k = 2; k < count; k++, sums->triangle_count++) {
        read_relative_corner(g, from + (least - from + k) % count, mean, corners[2]);
        sums->volume_from_mean += tet_volume(corners[0], corners[1], corners[2]);
        sums->volume_from_corner += tet_volume_from_origin(origin, corners);
        memcpy(corners[1], corners[2], sizeof corners[2]);
    }
}

/* Upper bound of the rounding error of the volume of a tet whose exact volume is 0, as a fraction of the volume of the
 * cell's bounding box. The volume is a sixth of a sum of six products. Each product has three factors: components of
 * the tet's edges along the three axes. Let u be 2^-53. A component is computed by three subtractions, each with an
 * error of at most u times the box's side, so the three factors add an error of 9 u to each product. Its two
 * multiplications add 2 u, and the up to three additions of products 3 u. The error of the volume is therefore at most
 * 6 (9 + 2 + 3) u / 6 = 14 u. The bound of 32 u leaves a margin for the sum over triangles, whose number is small
 * compared to 1 / u, for the rounding of the box's volume, and for squares of u. */
static const double flat_share = 0x1p-48;

double session_polyhedron_volume(const grid *g, int64_t cell, bool *is_flat)
{
    int64_t first, end;
    double origin[3];
    volume_sums sums = {0};
    const cell_frame frame = find_mean_and_least_vertex(g, cell);
    for (int axis = 0; axis < 3; axis++) origin[axis] = frame.least_vertex[axis] - frame.mean[axis];
    grid_cell_faces(g, cell, &first, &end);
    for (int64_t i = first; i < end; i++)
        add_tets_of_face(g, grid_read_index(&g->connectivity, i), frame.mean, origin, &sums);
    *is_flat = sums.volume_from_corner <= flat_share * (double)sums.triangle_count * frame.box_volume;
    return *is_flat ? 0 : sums.volume_from_mean;
}
