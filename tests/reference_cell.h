/* One cell in double: its crossings with a ray, and its interpolant inside. It is the reference for the kernels,
 * written to be obviously right, not fast. */
#ifndef REFERENCE_CELL_H
#define REFERENCE_CELL_H

#include <stdbool.h>

enum { REFERENCE_MAX_VERTICES = 96, REFERENCE_MAX_FACES = 64, REFERENCE_MAX_SIDES = 24, REFERENCE_MAX_TRIANGLES = 192 };

/* The faces and centre of a polyhedron, in addition to its vertices. */
typedef struct reference_polyhedron {
    int face_count;
    int face_size[REFERENCE_MAX_FACES];
    int faces[REFERENCE_MAX_FACES][REFERENCE_MAX_SIDES]; /* numbers of the cell's vertices, in order around each face */
    bool is_patch[REFERENCE_MAX_FACES];                  /* the face is a quad that rays meet on its bilinear patch */
    int triangle_count;
    int triangles[REFERENCE_MAX_TRIANGLES][3]; /* the canonical triangles */
    int face_of[REFERENCE_MAX_TRIANGLES];
    int sign[REFERENCE_MAX_TRIANGLES]; /* sign of the tet of each triangle and the centre */
} reference_polyhedron;

/* A cell in camera coordinates (right, up, forward from the eye). */
typedef struct reference_cell {
    int type; /* one of GRID_* */
    int count;
    /* coordinates as the simulation gives them: they decide how faces are split */
    double world[REFERENCE_MAX_VERTICES][3];
    /* in camera coordinates; a polyhedron's centre follows its vertices */
    double position[REFERENCE_MAX_VERTICES + 1][3];
    reference_polyhedron poly; /* for polyhedra only */
} reference_cell;

/* The ray x = base[0] + slope[0] z, y = base[1] + slope[1] z in camera coordinates. */
typedef struct reference_line {
    double base[2], slope[2];
} reference_line;

/* The bounds of points in camera coordinates. */
typedef struct reference_box {
    double low[3], high[3];
} reference_box;

extern const reference_box reference_empty_box;
void reference_box_add(reference_box *box, const double point[3]);

/* Returns whether the line may pass through the box: false only if the signed distances of the box's points from the
 * line along x or y, between low and high, are all above share * (high - low) + slack, or all below minus that. */
bool reference_box_is_near(const reference_box *box, const reference_line *line, double share, double slack);

/* A point where a line meets the cell's surface: on a triangle, or on a quad's bilinear patch at coordinates u, w. The
 * quad's triangles decide whether the line meets the quad an odd number of times. */
typedef struct reference_crossing {
    double z;
    int face;
    int triangle;      /* of a polyhedron; -1 if the line meets no triangle but twice the face's patch */
    double z_triangle; /* depth at which the line meets the triangle */
    double u, w;
    /* the ray meets the patch twice, or meets the triangles of some quad of the cell but not its patch */
    bool is_folded;
} reference_crossing;

enum { REFERENCE_MAX_CROSSINGS = REFERENCE_MAX_TRIANGLES };

/* Computes the crossings sorted by z; their number is even for every line. */
int reference_crossings(const reference_cell *cell, const reference_line *line,
                        reference_crossing crossings[REFERENCE_MAX_CROSSINGS]);

/* Computes centre, triangles and signs of a polyhedron from the cell's vertices (each once) and faces. */
void reference_polyhedron_setup(reference_cell *cell);

/* Returns the distance of the point from the nearest sheet between two of the polyhedron's tets. */
double reference_sheet_distance(const reference_cell *cell, const double point[3]);

/* Computes a polyhedron's field at depth z between two crossings: the sum over the tets that contain the point. From a
 * crossing to the next sheet it is linear along the line and begins at the face's own value, which on quads is the
 * patch's. If tets overlap at the crossing, the values of the other tets are added to the face's. Returns false if no
 * sum is found. */
bool reference_profile_value(const reference_cell *cell, const reference_line *line, const reference_crossing ends[2],
                             const double *values, double z, double *value);

enum { REFERENCE_MAX_BREAKS = 3 * REFERENCE_MAX_TRIANGLES + 2 };

/* Finds the increasing depths, from the first crossing to the second, at which a polyhedron's profile bends. Sheets
 * count if they lie between both the faces and the triangles. Returns the number of depths. */
int reference_profile_breaks(const reference_cell *cell, const reference_line *line, const reference_crossing ends[2],
                             double z[REFERENCE_MAX_BREAKS]);

/* Returns the field at a crossing from the face's own vertices: linear on triangles and on the triangles of faces with
 * more than four corners, bilinear on quads. */
double reference_face_value(const reference_cell *cell, const reference_line *line, const reference_crossing *crossing,
                            const double *values, bool *is_folded);

/* Returns the smallest distance, in a plane of constant z, between the line and an edge of the cell. */
double reference_edge_distance(const reference_cell *cell, const reference_line *line);

/* Evaluates the interpolant at a point. Returns false, with value and gradient 0, if the inverse map has no solution (a
 * degenerate cell). gradient (camera coordinates) may be NULL. */
bool reference_interpolate(const reference_cell *cell, const double point[3], const double *values, double *value,
                           double gradient[3]);

#endif
