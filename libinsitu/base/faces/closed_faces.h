/* The faces of one polyhedron: its vertices numbered, its faces turned alike, cut into triangles and turned outward.
 *
 * Nothing depends on how the caller's mesh lists faces: they may begin at any vertex and run either way. Faces that
 * share an edge are turned to run along it in opposite directions, one connected piece of the surface after the other
 * (a cell with a cavity has more than one); the sum of a piece's volumes then says which way is out, and a piece
 * inside an odd number of others is turned over. */
#ifndef BASE_CLOSED_FACES_H
#define BASE_CLOSED_FACES_H

#include <stddef.h>

#include "grid.h"

typedef struct closed_triangle {
    int vertex[3]; /* rising */
    int face;
    int turn;      /* 1 where the three run as the face's vertices do, else -1 */
    double volume; /* six times that of the tet with the centre, positive where the triangle is seen from inside */
} closed_triangle;

/* An edge of the faces: the sides that run along it. */
typedef struct closed_edge {
    int low, high; /* vertices; low -1: no edge */
    int side[2];   /* entries; -1: none */
} closed_edge;

/* An entry is a vertex of a face; a side runs from an entry to the face's next. */
typedef struct closed_faces {
    int face_count, entry_count, vertex_count, triangle_count, piece_count, table_size;
    int *first;        /* face_count + 1: a face's first entry */
    int *entry;        /* its vertex, by number */
    int *face_of;      /* an entry's face */
    int64_t *vertices; /* the grid's index of each number */
    int *turn;         /* 1 or -1 for each face; from closed_faces_turn_outward() on, 1 if it runs around outward */
    int *piece;        /* the connected piece of each face */
    closed_triangle *triangles;
    closed_edge *edges; /* 2 * table_size, by hash */
    /* For the functions below. */
    double (*corners)[3];
    int (*cuts)[3];
    void *polygon;
    int *edge_of, *stack, *seen_number;
    int64_t *seen;
    double *piece_volume;
} closed_faces;

/* Counts faces and entries. False where they are too many for int. */
bool closed_faces_count(closed_faces *c, const grid *g, int64_t cell);

/* Lays the arrays out in a room of 64-byte alignment and returns how much they take; NULL: only returns it. */
size_t closed_faces_lay_out(closed_faces *c, char *room);

/* Reads the faces, and numbers vertices as they are met. A vertex that follows itself in a face counts once: a quad is
 * one however often its corners are said, and a face all of whose entries are one vertex has none. */
void closed_faces_read(closed_faces *c, const grid *g, int64_t cell);

/* Turns each piece's faces as its first is listed. */
void closed_faces_turn(closed_faces *c);

/* Cuts the faces into triangles (polygon.h). Positions by number. A triangle with two corners in one vertex bounds
 * nothing and is left out. */
void closed_faces_cut(closed_faces *c, const double (*positions)[3]);

/* Finds the triangles' volumes, and turns pieces outward. */
void closed_faces_turn_outward(closed_faces *c, const double (*positions)[3], const double centre[3]);

/* Tells whether the face is met on a bilinear patch: it has four vertices, and none of them points inwards. Else it is
 * its triangles. */
bool closed_face_is_patch(const closed_faces *c, int face, const double (*positions)[3]);

/* Empties the table of edges, and finds an edge's place in it; a new one has no sides. */
void closed_edges_empty(closed_faces *c);
int closed_edges_find(closed_faces *c, int a, int b);

#endif
