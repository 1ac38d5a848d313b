/* Proof of one polyhedron. */
#ifndef SESSION_FACES_H
#define SESSION_FACES_H

#include "session_mesh.h"

typedef enum face_fault {
    FACES_GOOD,
    FACES_NO_MEMORY,
    FACES_TOO_FEW,       /* a cell of less than 4 faces */
    FACE_BAD_INDEX,      /* no such face */
    FACE_BAD_OFFSETS,    /* outside face_connectivity, or falling */
    FACE_TOO_SMALL,      /* less than 3 vertices */
    FACE_BAD_VERTEX,     /* no such vertex */
    FACE_BAD_COORDINATE, /* not finite; not looked at in ghosts */
    FACES_OPEN           /* an edge that is not one of exactly two faces */
} face_fault;

typedef struct face_place {
    int64_t count; /* of the cell's faces */
    int64_t face;  /* index as it stands in the connectivity */
    int64_t first, next;
    int64_t vertex, other; /* at fault; the ends of an edge */
    int sharing;           /* faces that have the edge */
    double position[3];
} face_place;

/* Room that grows with the cells: one for each thread, zeroed at first, freed with session_faces_free(). */
typedef struct face_room {
    struct face_edge *edges;
    int64_t capacity;
} face_room;

void session_faces_free(face_room *room);

/* offsets of the cell have been proved. */
face_fault session_check_faces(const session_mesh *mesh, int64_t cell, face_room *room, face_place *place);

/* The volume: exact for cells that are star-shaped from their vertices' mean, else somewhat more; however faces are
 * listed the same but for rounding. Flat, of volume 0: in one plane, but for rounding. */
double session_polyhedron_volume(const grid *g, int64_t cell, bool *is_flat);

/* The error in words. */
insitu_status session_describe_faces(const session_mesh *mesh, int64_t cell, face_fault fault, const face_place *place,
                                     base_error *error);

#endif
