/* Triangles and quads of cells on which hanging vertices may lie, and positions on these faces. A hanging vertex is a
 * vertex of a fine cell that lies on a face of a coarser cell without being a corner of this face. */
#ifndef SESSION_COARSE_FACE_H
#define SESSION_COARSE_FACE_H

#include "session_homes.h"
#include "session_mesh.h"

typedef struct session_coarse_face {
    int count;     /* number of corners: 3 or 4 */
    bool is_shell; /* set if the face is a shell, that is, a triangle or quad that is a cell of its own */
    /* corners in loop order, beginning with the lexicographically least one and continuing to the lesser of its
     * neighbours; a triangle's fourth corner equals its third */
    double corner_positions[4][3];
    double normal[3]; /* unit vector that points away from the cell; 0 if the face is a shell */
    session_box box;
    double area;  /* area of the face */
    double width; /* length of the longer diagonal or, for a triangle, of the longer of the two edges at its last
                   * corner */
} session_coarse_face;

enum { SESSION_FACE_WORDS = 13 };

/* The corners and bounds of a triangle or quad. Most positions can be recognized from these as not lying on the face,
 * before the face's normal and area are computed (session_coarse_face). */
typedef struct session_face_outline {
    int count; /* number of corners: 3 or 4 */
    bool is_shell;
    int64_t vertices[4]; /* vertices in the cell's own order */
    double corner_positions[4][3];
    session_box box;
    double diameter; /* upper bound of the distance between any two corners */
} session_face_outline;

/* Reads the outline of a face. Returns false if the face is not a triangle or quad. */
bool session_read_outline(const grid *g, const session_face *face, session_face_outline *out);
/* Returns false only if a position in the outline's box is certainly more than `slack` away from the face: the position
 * is beyond all corners of the face, either along its normal or across one of its edges. */
bool session_can_face_contain_position(const session_face_outline *outline, const double position[3], double slack);

/* Reads a face. vertices: receives the face's vertices, in the order of out->corner_positions. Returns false if the
 * face is not a triangle or quad, or if its area is 0. */
bool session_read_coarse_face(const grid *g, const session_face *face, session_coarse_face *out, int64_t vertices[4]);

/* session_pack_coarse_face() writes a face as 64-bit words for another rank; session_unpack_coarse_face() reads a face
 * from these words. */
void session_pack_coarse_face(const session_coarse_face *face, uint64_t words[SESSION_FACE_WORDS]);
void session_unpack_coarse_face(const uint64_t words[SESSION_FACE_WORDS], session_coarse_face *out);

/* Returns whether the position is within slack of a corner. */
bool session_is_at_corner(const session_coarse_face *face, const double position[3], double slack);

/* Computes the weights with which the values at the face's corners are summed to give the interpolated value at a
 * position on the face; the fourth weight of a triangle is 0. Returns false if the position is farther than `slack`
 * from the face. */
bool session_find_weights(const session_coarse_face *face, const double position[3], double slack, double weights[4]);

/* Returns an upper bound of the rounding errors of the mesh's coordinates; 0 if mesh is NULL. */
double session_bound_position_rounding(const session_mesh *mesh);

/* Returns the distance between two points. */
double session_point_distance(const double a[3], const double b[3]);

/* Returns whether face a has the larger area or, if the areas are equal, the lexicographically smaller corners. */
bool session_is_larger_face(const session_coarse_face *a, const session_coarse_face *b);

#endif
