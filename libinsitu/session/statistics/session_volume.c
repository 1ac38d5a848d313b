/* Computes volumes by closed formulas, which are exact up to rounding.
 *
 * A cell is the region that its faces enclose, so that cells with the same faces have the same volume. A wedge or
 * pyramid is treated as a hex with coincident corners. The volume of a hex is the integral of the Jacobian determinant
 * of its trilinear map, which is a sum of three determinants of differences of the corners (Grandy, 1997).
 *
 * The volume of a polyhedron is the sum of the volumes of the cones from any point over its faces, oriented outward.
 * The two triangulations of a quad enclose a tet, which the quad's bilinear patch divides into halves, so that the
 * volume of the cone over a patch is the mean of the volumes over both triangulations.
 *
 * The area of a shell is the length of its vector area, which is half the sum of the cross products of consecutive
 * vertices around it. */
#include "session_volume.h"

#include <math.h>
#include <string.h>

#include "closed_faces.h"
#include "memory.h"

static double determinant3(const double u[3], const double v[3], const double w[3])
{
    return u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2]) + u[2] * (v[0] * w[1] - v[1] * w[0]);
}

static void subtract_vectors(const double a[3], const double b[3], double out[3])
{
    for (int axis = 0; axis < 3; axis++) out[axis] = a[axis] - b[axis];
}

static double tet_volume(double (*p)[3])
{
    double u[3], v[3], w[3];
    subtract_vectors(p[1], p[0], u);
    subtract_vectors(p[2], p[0], v);
    subtract_vectors(p[3], p[0], w);
    return determinant3(u, v, w) / 6;
}

/* Returns an array that contains, for each of the eight corners of a hex, the index of the cell's corner that takes its
 * place. A wedge or pyramid is thereby read as a hex with coincident corners. */
static const signed char *find_corners_as_hex(int type)
{
    static const signed char hex[8] = {0, 1, 2, 3, 4, 5, 6, 7}, wedge[8] = {0, 1, 2, 2, 3, 4, 5, 5},
                             pyramid[8] = {0, 1, 2, 3, 4, 4, 4, 4};
    return type == GRID_HEX ? hex : type == GRID_WEDGE ? wedge : pyramid;
}

static double hex_volume(double (*p)[3], const signed char *corner)
{
    static const signed char ends[6][2] = {{6, 1}, {7, 0}, {6, 3}, {2, 0}, {5, 0}, {6, 4}};
    double d[6][3], sums[3][3];
    for (int i = 0; i < 6; i++) subtract_vectors(p[corner[ends[i][0]]], p[corner[ends[i][1]]], d[i]);
    for (int axis = 0; axis < 3; axis++) {
        sums[0][axis] = d[0][axis] + d[1][axis];
        sums[1][axis] = d[2][axis] + d[4][axis];
        sums[2][axis] = d[5][axis] + d[3][axis];
    }
    return (determinant3(sums[0], d[2], d[3]) + determinant3(d[1], sums[1], d[5]) + determinant3(d[0], d[4], sums[2])) /
           12;
}

/* ---- polyhedra ------------------------------------------------------------------------------------------------ */

void session_volume_free(volume_buffer *buffer)
{
    base_free(buffer->bytes);
    *buffer = (volume_buffer){0};
}

static bool reserve_bytes(volume_buffer *buffer, size_t size)
{
    if (size <= buffer->size) return true;
    base_free(buffer->bytes);
    buffer->requested_size = size + size / 2;
    buffer->bytes = base_alloc(buffer->requested_size);
    buffer->size = buffer->bytes ? buffer->requested_size : 0;
    buffer->is_out_of_memory = buffer->is_out_of_memory || !buffer->bytes;
    return buffer->bytes;
}

/* Reads positions relative to the first vertex, so that no digits are lost if the cell is far from the origin. */
static void read_positions(const grid *g, const closed_faces *c, double (*positions)[3])
{
    double origin[3];
    grid_read_vertex_position(g, c->vertices[0], origin);
    for (int i = 0; i < c->vertex_count; i++) {
        grid_read_vertex_position(g, c->vertices[i], positions[i]);
        for (int axis = 0; axis < 3; axis++) positions[i][axis] -= origin[axis];
    }
}

/* Returns six times the volume of the cone from the origin over the bilinear patch. */
static double compute_patch_cone_volume(const double (*p)[3], const int v[4])
{
    const double *a = p[v[0]], *b = p[v[1]], *c = p[v[2]], *d = p[v[3]];
    return (determinant3(a, b, c) + determinant3(a, c, d) + determinant3(a, b, d) + determinant3(b, c, d)) / 2;
}

static double polyhedron_volume(const grid *g, int64_t cell, volume_buffer *buffer)
{
    static const double origin[3] = {0, 0, 0};
    closed_faces c = {0};
    if (!closed_faces_count_entries(&c, g, cell)) return NAN;
    const size_t bytes = 3 * (size_t)c.entry_count * sizeof(double);
    if (!reserve_bytes(buffer, closed_faces_lay_out(&c, NULL) + bytes)) return NAN;
    double(*places)[3] = (double(*)[3])(void *)(buffer->bytes + closed_faces_lay_out(&c, buffer->bytes));
    const double(*positions)[3] = (const double(*)[3])places;
    closed_faces_read(&c, g, cell);
    buffer->vertices = c.vertices;
    buffer->vertex_count = c.vertex_count;
    if (!c.vertex_count) return 0;
    read_positions(g, &c, places);
    closed_faces_orient(&c);
    closed_faces_triangulate(&c, positions);
    closed_faces_orient_outward(&c, positions, origin);
    double volume = 0;
    for (int i = 0; i < c.triangle_count; i++)
        if (!closed_face_is_bilinear_patch(&c, c.triangles[i].face, positions)) volume += c.triangles[i].volume;
    for (int face = 0; face < c.face_count; face++)
        if (closed_face_is_bilinear_patch(&c, face, positions))
            volume +=
                c.orientation[face] * compute_patch_cone_volume(positions, c.entry_vertices + c.first_entries[face]);
    return fabs(volume) / 6;
}

/* ---- shells ---------------------------------------------------------------------------------------------------- */

/* Stores the vertices of the shell in the buffer. Returns false if memory runs out. */
static bool read_vertices(const grid *g, int64_t cell, volume_buffer *buffer)
{
    grid_walk walk = grid_walk_cell(g, cell);
    const int64_t count = walk.end - walk.next;
    int64_t *vertices = buffer->corners;
    if (count > GRID_MAX_CELL_VERTICES) {
        if (!reserve_bytes(buffer, (size_t)count * sizeof *vertices)) return false;
        vertices = (int64_t *)(void *)buffer->bytes;
    }
    for (int64_t i = 0; i < count; i++) grid_walk_next(&walk, &vertices[i]);
    buffer->vertices = vertices;
    buffer->vertex_count = (int)count;
    return true;
}

double session_shell_area(const grid *g, int64_t cell)
{
    double first[3], last[3] = {0, 0, 0}, sum[3] = {0, 0, 0};
    grid_walk walk = grid_walk_cell(g, cell);
    int64_t vertex;
    if (!grid_walk_next(&walk, &vertex)) return 0;
    grid_read_vertex_position(g, vertex, first);
    while (grid_walk_next(&walk, &vertex)) {
        double place[3], next[3];
        grid_read_vertex_position(g, vertex, place);
        subtract_vectors(place, first, next);
        for (int a = 0; a < 3; a++) {
            const int b = (a + 1) % 3, c = (a + 2) % 3;
            sum[a] += last[b] * next[c] - last[c] * next[b];
        }
        for (int a = 0; a < 3; a++) last[a] = next[a];
    }
    return 0.5 * hypot(hypot(sum[0], sum[1]), sum[2]);
}

double session_cell_volume(const grid *g, int64_t cell, volume_buffer *buffer)
{
    double points[GRID_MAX_CELL_VERTICES][3];
    const int type = grid_cell_type(g, cell);
    buffer->vertex_count = 0;
    if (grid_is_shell_type(type)) return read_vertices(g, cell, buffer) ? session_shell_area(g, cell) : NAN;
    if (type == GRID_POLYHEDRON) return polyhedron_volume(g, cell, buffer);
    buffer->vertices = buffer->corners;
    buffer->vertex_count = grid_cell_vertices(g, cell, buffer->corners);
    for (int i = 0; i < buffer->vertex_count; i++) grid_read_vertex_position(g, buffer->corners[i], points[i]);
    return fabs(type == GRID_TET ? tet_volume(points) : hex_volume(points, find_corners_as_hex(type)));
}
