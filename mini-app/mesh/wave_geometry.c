/* Quads are bilinear patches. The area vector of a quad is half the cross product of its diagonals, even if the quad is
 * warped. The contribution of a quad to a cell's volume is the mean of those of its two possible splits into triangles;
 * this mean is exact for the patch. Therefore the volumes of all cells add up to the volume of the box, and the area
 * vectors of a cell add up to zero. */
#include "wave_geometry.h"

static void subtract_vectors(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; ++i) out[i] = a[i] - b[i];
}

static void cross_product(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot_product(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double determinant3(const double a[3], const double b[3], const double c[3])
{
    double ab[3];
    cross_product(a, b, ab);
    return dot_product(ab, c);
}

static void compute_face_area(const double p[4][3], int size, double area[3])
{
    double a[3], b[3];
    subtract_vectors(p[size == 4 ? 2 : 1], p[0], a);
    subtract_vectors(p[size == 4 ? 3 : 2], size == 4 ? p[1] : p[0], b);
    cross_product(a, b, area);
    for (int i = 0; i < 3; ++i) area[i] *= 0.5;
}

/* Returns the volume of the pyramid between the origin and the face. */
static double compute_face_volume(const double p[4][3], int size)
{
    if (size == 3) return determinant3(p[0], p[1], p[2]) / 6;
    return (determinant3(p[0], p[1], p[2]) + determinant3(p[0], p[2], p[3]) + determinant3(p[0], p[1], p[3]) +
            determinant3(p[1], p[2], p[3])) /
           12;
}

/* Stores in p[] the vertices of a face relative to origin, beginning with the vertex with the smallest id. Both cells
 * that share the face begin with the same vertex, and therefore round the face's area and volume in the same way. */
static void face_points(const wave_cell_shape *shape, int face, const double position[8][3], const int64_t id[8],
                        const double origin[3], double p[4][3])
{
    int size = shape->face_size[face], first = 0;
    for (int i = 1; i < size; ++i) {
        if (id[shape->face[face][i]] < id[shape->face[face][first]]) first = i;
    }
    for (int i = 0; i < size; ++i) subtract_vectors(position[shape->face[face][(first + i) % size]], origin, p[i]);
}

void wave_cell_measure(const wave_cell_shape *shape, const double position[8][3], const int64_t id[8],
                       wave_cell_geometry *out)
{
    static const double zero[3] = {0, 0, 0};
    double p[4][3];
    *out = (wave_cell_geometry){0};
    for (int i = 0; i < shape->vertex_count; ++i) {
        for (int a = 0; a < 3; ++a) out->centroid[a] += shape->centre[i] * position[i][a];
    }
    for (int f = 0; f < shape->face_count; ++f) {
        face_points(shape, f, position, id, zero, p);
        compute_face_area(p, shape->face_size[f], out->area[f]);
        face_points(shape, f, position, id, position[0], p);
        out->volume += compute_face_volume(p, shape->face_size[f]);
    }
}
