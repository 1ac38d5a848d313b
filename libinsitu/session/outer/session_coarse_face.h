/* Triangles and quads of cells on which vertices may hang, and positions on them. */
#ifndef SESSION_COARSE_FACE_H
#define SESSION_COARSE_FACE_H

#include "session_homes.h"
#include "session_mesh.h"

typedef struct session_coarse_face {
    int count; /* number of corners: 3 or 4 */
    /* in loop order, beginning at the least corner towards the lesser of its neighbours; a triangle's fourth is its
     * third */
    double places[4][3];
    double normal[3]; /* unit vector that points away from the cell */
    session_box box;
    double area, width;
} session_coarse_face;

enum { SESSION_FACE_WORDS = 13 };

/* A triangle or quad of a cell, as little of it as tells where it is not. */
typedef struct session_face_outline {
    int count;
    int64_t vertices[4]; /* in the cell's order */
    double places[4][3];
    session_box box;
    double reach; /* no two corners are farther apart */
} session_face_outline;

/* False where the face is no triangle or quad of a cell. */
bool session_read_outline(const grid *g, const session_face *face, session_face_outline *out);
/* Tells whether the place, in the outline's box, may be within slack of the face: it is not beyond all of the face's
 * corners, along its normal or across one of its edges. */
bool session_may_hold(const session_face_outline *outline, const double place[3], double slack);

/* Reads a face and its vertices, in the order of its places. False where it is no triangle or quad of a cell, or has no
 * area. */
bool session_read_coarse_face(const grid *g, const session_face *face, session_coarse_face *out, int64_t vertices[4]);

/* Write the face as words for another rank, and read it from them. */
void session_pack_coarse_face(const session_coarse_face *face, uint64_t words[SESSION_FACE_WORDS]);
void session_unpack_coarse_face(const uint64_t words[SESSION_FACE_WORDS], session_coarse_face *out);

/* Returns whether the position is within slack of a corner. */
bool session_is_at_corner(const session_coarse_face *face, const double place[3], double slack);

/* Computes the weights of the corners at a position, with 0 for a triangle's fourth; returns false if the position is
 * farther than slack from the face. */
bool session_find_on_face(const session_coarse_face *face, const double place[3], double slack, double weights[4]);

/* Returns an upper bound of the rounding of the mesh's coordinates; 0 for NULL. */
double session_place_rounding(const session_mesh *mesh);

double session_place_distance(const double a[3], const double b[3]);

/* Define an order of positions, and of faces by area and then by positions. */
int session_compare_places(const double a[3], const double b[3]);
bool session_is_larger_face(const session_coarse_face *a, const session_coarse_face *b);

#endif
