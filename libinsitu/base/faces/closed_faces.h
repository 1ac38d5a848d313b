/* Reads the faces of one polyhedron, numbers its vertices from 0, orients its faces consistently, cuts them into
 * triangles, and orients them outward.
 *
 * The result does not depend on how the caller's mesh lists the faces: they may begin at any vertex and run in either
 * direction. Faces that share an edge are oriented so that they run along it in opposite directions. The faces that are
 * connected by shared edges form a piece of the surface; a cell with a cavity has more than one piece, and each is
 * oriented separately. The sign of the sum of a piece's tet volumes then shows whether the piece is oriented outward. A
 * piece inside an odd number of other pieces bounds a cavity and is oriented the opposite way. */
#ifndef BASE_CLOSED_FACES_H
#define BASE_CLOSED_FACES_H

#include <stddef.h>

#include "grid.h"

typedef struct closed_triangle {
    int vertex[3]; /* indices of the triangle's vertices in the polyhedron, in increasing order */
    int face;
    /* 1 if the vertices, visited in increasing order of their indices, run around the triangle in the direction that
     * closed_faces_orient() has given to the face, else -1 */
    int orientation;
    /* set by closed_faces_orient_outward(): six times the volume of the tet between the triangle and the centre;
     * negative if the outward normal points towards the centre */
    double volume;
} closed_triangle;

/* An edge of the polyhedron. Each face at the edge has one side (see closed_faces) that runs along it. */
typedef struct closed_edge {
    /* indices of the two vertices in the polyhedron; low is -1 in an unused slot of the hash table of edges */
    int low, high;
    int side[2]; /* indices of the sides that the two faces at the edge have along it; -1: there is no such face */
} closed_edge;

/* The faces of a polyhedron as lists of entries. An entry is one vertex in the list of one face. A side is the part of
 * a face's boundary from one entry to the next entry of the face. The index of a side is the index of the entry at
 * which it starts. */
typedef struct closed_faces {
    int face_count, entry_count, vertex_count, triangle_count, piece_count, table_size;
    int *first_entries;  /* first entry of each face; face_count + 1 elements */
    int *entry_vertices; /* for each entry, the index of its vertex in the polyhedron */
    int *face_of;        /* for each entry, the face to which it belongs */
    int64_t *vertices;   /* for each vertex of the polyhedron, its index in the grid */
    /* for each face: -1 if its list of entries must be read in reverse to be consistent with the first face of its
     * piece, otherwise 1. After closed_faces_orient_outward(): 1 if the list runs counterclockwise as seen from outside
     * the cell, otherwise -1 */
    int *orientation;
    int *piece; /* for each face, the index of the connected piece of the surface to which it belongs */
    closed_triangle *triangles;
    closed_edge *edges; /* hash table of edges with 2 * table_size entries */
    /* working memory of the functions below */
    double (*corners)[3];
    int (*cuts)[3];
    void *polygon;
    int *edge_of, *stack, *seen_number;
    int64_t *seen;
    double *piece_volume;
} closed_faces;

/* Counts the polyhedron's faces and the entries of their lists. Returns false if there are more than INT32_MAX / 64
 * faces or entries. */
bool closed_faces_count_entries(closed_faces *c, const grid *g, int64_t cell);

/* Sets the arrays to sections of `memory`, which must be aligned to 64 bytes, and returns the number of bytes that they
 * take. If memory is NULL, only the size is computed. */
size_t closed_faces_lay_out(closed_faces *c, char *memory);

/* Reads the faces, and numbers the vertices in the order in which they appear. If a face repeats a vertex in
 * succession, only one entry is stored. A quad with repeated corners therefore remains a quad. A face that consists of
 * a single vertex has no entries. */
void closed_faces_read(closed_faces *c, const grid *g, int64_t cell);

/* Orients the faces of each connected piece consistently with the first face of the piece in the list. */
void closed_faces_orient(closed_faces *c);

/* Cuts the faces into triangles (polygon.h). positions: the position of each vertex, by its index in the polyhedron. A
 * triangle that has the same vertex at two corners has no area and is left out. */
void closed_faces_triangulate(closed_faces *c, const double (*positions)[3]);

/* Computes the volumes of the tets between the triangles and the centre, and orients the pieces outward. */
void closed_faces_orient_outward(closed_faces *c, const double (*positions)[3], const double centre[3]);

/* Returns whether the face is intersected as a bilinear patch: it has four vertices, and none of its corners is
 * concave. Any other face is intersected as its triangles. */
bool closed_face_is_bilinear_patch(const closed_faces *c, int face, const double (*positions)[3]);

/* closed_edges_clear() clears the hash table of edges. closed_edges_find() returns the index of the edge between two
 * vertices. If the edge is not in the table, it is added, as yet without adjacent faces. */
void closed_edges_clear(closed_faces *c);
int closed_edges_find(closed_faces *c, int a, int b);

#endif
