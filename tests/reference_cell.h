/* One cell in double: its crossings with a ray and its interpolant inside. It is the reference for the kernels, written
 * to be obviously right, not fast.
 *
 * A polyhedron is the union of the tets between the triangles of its faces and its centre. A sheet is a triangle
 * between two of these tets; its vertices are two vertices of a face's triangle and the centre. The profile is the
 * polyhedron's field along a ray: it is linear between two sheets. A quad whose four vertices are not in a plane has a
 * bilinear patch, on which rays meet it, besides its two triangles. */
#ifndef REFERENCE_CELL_H
#define REFERENCE_CELL_H

#include <stdbool.h>

enum { REFERENCE_MAX_VERTICES = 96, REFERENCE_MAX_FACES = 64, REFERENCE_MAX_SIDES = 24, REFERENCE_MAX_TRIANGLES = 192 };

/* The faces and the triangles of a polyhedron, in addition to its vertices. */
typedef struct reference_polyhedron {
    int face_count;
    int face_size[REFERENCE_MAX_FACES];
    /* indices into the cell's vertices, in order around each face */
    int faces[REFERENCE_MAX_FACES][REFERENCE_MAX_SIDES];
    /* whether the face is a quad that rays meet on its bilinear patch */
    bool is_patch[REFERENCE_MAX_FACES];
    int triangle_count;
    /* the triangles of the faces (reference_polygon.h); face_of: the face of each triangle */
    int triangles[REFERENCE_MAX_TRIANGLES][3];
    int face_of[REFERENCE_MAX_TRIANGLES];
    int sign[REFERENCE_MAX_TRIANGLES]; /* sign of the tet between each triangle and the centre */
} reference_polyhedron;

/* A cell in camera coordinates (right, up, forward from the eye). */
typedef struct reference_cell {
    int type; /* one of GRID_* */
    int count;
    /* coordinates as the simulation passes them; they decide how faces are split */
    double world[REFERENCE_MAX_VERTICES][3];
    /* vertices in camera coordinates; a polyhedron's centre follows its vertices */
    double position[REFERENCE_MAX_VERTICES + 1][3];
    reference_polyhedron poly; /* set only for polyhedra */
} reference_cell;

/* The ray x = base[0] + slope[0] z, y = base[1] + slope[1] z in camera coordinates. */
typedef struct reference_line {
    double base[2], slope[2];
} reference_line;

/* The axis-aligned box of points in camera coordinates. */
typedef struct reference_box {
    double low[3], high[3];
} reference_box;

extern const reference_box reference_empty_box;
void reference_box_add(reference_box *box, const double point[3]);

/* Returns whether the line may pass through the box. At the depths of the box, the distances from the line to the box's
 * points along axis x or y lie between low and high. Returns false if low > most or high < -most for one axis, with
 * most = share * (high - low) + slack. */
bool reference_box_is_near(const reference_box *box, const reference_line *line, double share, double slack);

/* A point at which a line meets the cell's surface: on a triangle, or on a quad's bilinear patch at the coordinates u,
 * w. Whether the line meets the patch an odd number of times is decided by the quad's triangles. */
typedef struct reference_crossing {
    double z;
    int face;
    int triangle;      /* triangle of a polyhedron; -1 if the line meets no triangle but meets the face's patch twice */
    double z_triangle; /* depth at which the line meets the triangle */
    double u, w;
    /* whether the ray meets the patch twice, or meets the triangles of some quad of the cell but not its patch */
    bool is_folded;
} reference_crossing;

enum { REFERENCE_MAX_CROSSINGS = REFERENCE_MAX_TRIANGLES };

/* Computes the crossings sorted by z and returns their number. The number is even for every line. */
int reference_find_crossings(const reference_cell *cell, const reference_line *line,
                             reference_crossing crossings[REFERENCE_MAX_CROSSINGS]);

/* Computes the centre, the triangles and the signs of a polyhedron from the cell's distinct vertices and its faces. */
void reference_polyhedron_setup(reference_cell *cell);

/* Returns the distance of the point from the nearest sheet of the polyhedron. */
double reference_compute_sheet_distance(const reference_cell *cell, const double point[3]);

/* Computes the profile of a polyhedron at depth z between two crossings: the sum of the signed fields of the tets that
 * contain the point. From a crossing to the next sheet, the profile is linear and begins at the face's own value (on
 * quads, the value on the patch). If tets overlap at the crossing, the values of the other tets are added to the face's
 * value. Returns false if no sum is found. */
bool reference_compute_profile_value(const reference_cell *cell, const reference_line *line,
                                     const reference_crossing ends[2], const double *values, double z, double *value);

enum { REFERENCE_MAX_BREAKS = 3 * REFERENCE_MAX_TRIANGLES + 2 };

/* Finds the increasing depths, from the first crossing to the second, at which a polyhedron's profile bends: the
 * crossings with sheets that lie both between the faces and between the faces' triangles. Returns the number of
 * depths. */
int reference_find_profile_breaks(const reference_cell *cell, const reference_line *line,
                                  const reference_crossing ends[2], double z[REFERENCE_MAX_BREAKS]);

/* Returns the field at a crossing, interpolated from the face's vertices only: bilinear on quads, linear on the
 * triangles of all other faces. */
double reference_compute_face_value(const reference_cell *cell, const reference_line *line,
                                    const reference_crossing *crossing, const double *values, bool *is_folded);

/* Returns the smallest distance, in a plane of constant z, between the line and an edge of the cell. */
double reference_compute_edge_distance(const reference_cell *cell, const reference_line *line);

/* Evaluates the interpolant at a point. If the inverse map has no solution because the cell is degenerate, value and
 * gradient are 0 and false is returned. gradient (in camera coordinates) may be NULL. */
bool reference_interpolate(const reference_cell *cell, const double point[3], const double *values, double *value,
                           double gradient[3]);

#endif
