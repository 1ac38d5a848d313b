/* One cell in double: where a ray crosses its faces, and its interpolant inside. The truth that kernels are measured
 * against; made to be obviously right, not fast. */
#ifndef REFERENCE_CELL_H
#define REFERENCE_CELL_H

#include <stdbool.h>

enum { REFERENCE_MAX_VERTICES = 96, REFERENCE_MAX_FACES = 64, REFERENCE_MAX_SIDES = 24, REFERENCE_MAX_TRIANGLES = 192 };

/* The faces and centre that a polyhedron has besides its vertices. */
typedef struct reference_polyhedron {
    int face_count;
    int face_size[REFERENCE_MAX_FACES];
    int faces[REFERENCE_MAX_FACES][REFERENCE_MAX_SIDES]; /* numbers of the cell's vertices, around */
    bool is_patch[REFERENCE_MAX_FACES];                  /* a quad that is met on its bilinear patch */
    int triangle_count;
    int triangles[REFERENCE_MAX_TRIANGLES][3]; /* the canonical ones */
    int face_of[REFERENCE_MAX_TRIANGLES];
    int sign[REFERENCE_MAX_TRIANGLES]; /* of the tet with the centre */
} reference_polyhedron;

/* A cell in camera coordinates (right, up, forward from the eye). */
typedef struct reference_cell {
    int type; /* GRID_* */
    int count;
    double world[REFERENCE_MAX_VERTICES][3];        /* as the simulation has them: decides how faces are split */
    double position[REFERENCE_MAX_VERTICES + 1][3]; /* a polyhedron's centre behind its vertices */
    reference_polyhedron poly;                      /* of polyhedra alone */
} reference_cell;

/* The ray x = base[0] + slope[0] z, y = base[1] + slope[1] z of camera coordinates. */
typedef struct reference_line {
    double base[2], slope[2];
} reference_line;

/* The bounds of points in camera coordinates. */
typedef struct reference_box {
    double low[3], high[3];
} reference_box;

extern const reference_box reference_empty_box;
void reference_box_add(reference_box *box, const double point[3]);

/* Tells whether the line may pass the points: false only if their distances from it along x or y, of which low is the
 * least and high the greatest, are all above share * (high - low) + slack, or all as much below 0. */
bool reference_box_is_near(const reference_box *box, const reference_line *line, double share, double slack);

/* A place where a line meets the cell's surface: on triangles as they are, on a quad's bilinear patch at the
 * coordinates u, w. The quad's triangles tell whether the line meets it an odd number of times. */
typedef struct reference_crossing {
    double z;
    int face;
    int triangle;      /* of a polyhedron; -1 where none is met but the patch of its face, twice */
    double z_triangle; /* where the triangle is met */
    double u, w;
    bool is_folded; /* the ray meets the patch twice, or the triangles of some quad of the cell and not its patch */
} reference_crossing;

enum { REFERENCE_MAX_CROSSINGS = REFERENCE_MAX_TRIANGLES };

/* Crossings sorted by z; their number is even for every line. */
int reference_crossings(const reference_cell *cell, const reference_line *line,
                        reference_crossing crossings[REFERENCE_MAX_CROSSINGS]);

/* Take a polyhedron apart: cell has its vertices (each once) and faces. */
void reference_polyhedron_setup(reference_cell *cell);

/* Returns the distance of the point from the nearest sheet between two of the polyhedron's tets. */
double reference_sheet_distance(const reference_cell *cell, const double point[3]);

/* A polyhedron's field at depth z between two crossings: the sum over the tets that hold the point. From a crossing to
 * the next sheet it is linear along the line, beginning at the face's own value, which on quads is the patch's. Where
 * tets overlap at the crossing, the others' values are added to the face's. False where no sum is found. */
bool reference_profile_value(const reference_cell *cell, const reference_line *line, const reference_crossing ends[2],
                             const double *values, double z, double *value);

enum { REFERENCE_MAX_BREAKS = 3 * REFERENCE_MAX_TRIANGLES + 2 };

/* Finds the rising depths, from the first crossing to the second, at which a polyhedron's profile bends. Sheets count
 * if they are between both the faces and the triangles. Returns how many there are. */
int reference_profile_breaks(const reference_cell *cell, const reference_line *line, const reference_crossing ends[2],
                             double z[REFERENCE_MAX_BREAKS]);

/* The field at a crossing from the face's own vertices: linear on triangles, and on the triangles of faces of more than
 * four; bilinear on quads. */
double reference_face_value(const reference_cell *cell, const reference_line *line, const reference_crossing *crossing,
                            const double *values, bool *is_folded);

/* The smallest distance, in a plane of constant z, between the line and an edge of the cell. */
double reference_edge_distance(const reference_cell *cell, const reference_line *line);

/* Interpolant at a point. Returns false where the inverse map has no solution (a degenerate cell): value and gradient
 * are then 0. gradient (camera coordinates) may be NULL. */
bool reference_interpolate(const reference_cell *cell, const double point[3], const double *values, double *value,
                           double gradient[3]);

#endif
