/* Iterates over the faces of a cell of any type. A shell (a cell without volume) has one face, which is the shell
 * itself. */
#ifndef SESSION_CELL_FACES_H
#define SESSION_CELL_FACES_H

#include "grid.h"

/* The faces of a type of cell with a fixed number of vertices, in VTK's order. The fourth vertex of a triangle is
 * -1. */
typedef struct session_face_table {
    int count;
    signed char vertices[6][4];
} session_face_table;

static inline const session_face_table *session_faces_of_type(int type)
{
    static const session_face_table tet = {4, {{0, 1, 3, -1}, {1, 2, 3, -1}, {2, 0, 3, -1}, {0, 2, 1, -1}}};
    static const session_face_table hex = {
        6, {{0, 4, 7, 3}, {1, 2, 6, 5}, {0, 1, 5, 4}, {3, 7, 6, 2}, {0, 3, 2, 1}, {4, 5, 6, 7}}};
    static const session_face_table wedge = {5,
                                             {{0, 1, 2, -1}, {3, 5, 4, -1}, {0, 3, 4, 1}, {1, 4, 5, 2}, {2, 5, 3, 0}}};
    static const session_face_table pyramid = {
        5, {{0, 3, 2, 1}, {0, 1, 4, -1}, {1, 2, 4, -1}, {2, 3, 4, -1}, {3, 0, 4, -1}}};
    static const session_face_table none = {0};
    switch (type) {
    case GRID_TET: return &tet;
    case GRID_HEX: return &hex;
    case GRID_WEDGE: return &wedge;
    case GRID_PYRAMID: return &pyramid;
    default: return &none;
    }
}

typedef struct session_cell_faces {
    const grid *cells;
    /* the faces of the cell's type; NULL for polyhedra, and for shells (cells without volume) except the quads of a
     * structured grid */
    const session_face_table *table;
    int64_t count;
    /* the cell's vertices, if `table` is given */
    int64_t vertices[GRID_MAX_CELL_VERTICES];
    int64_t first; /* index of the cell's first entry in the connectivity */
    int64_t size;  /* number of the shell's vertices, if the cell is a shell; otherwise 0 */
} session_cell_faces;

static inline session_cell_faces session_faces_of_cell(const grid *g, int64_t cell)
{
    session_cell_faces out = {.cells = g};
    const int type = grid_cell_type(g, cell);
    if (type == GRID_POLYHEDRON) {
        int64_t end;
        grid_cell_faces(g, cell, &out.first, &end);
        out.count = end - out.first;
        return out;
    }
    if (g->lattice && type == GRID_QUAD) {
        static const session_face_table quad = {1, {{0, 1, 2, 3}}};
        out.table = &quad;
        out.count = 1;
        out.size = grid_cell_vertices(g, cell, out.vertices);
        return out;
    }
    if (grid_is_shell_type(type)) {
        const grid_walk walk = grid_walk_cell(g, cell);
        out.first = walk.next;
        out.size = walk.end - walk.next;
        out.count = 1;
        return out;
    }
    out.table = session_faces_of_type(type);
    out.count = out.table->count;
    grid_cell_vertices(g, cell, out.vertices);
    return out;
}

/* The vertices of a face in cyclic order. session_face_vertex() returns the i-th of them, i = 0 .. size - 1. */
typedef struct session_face_loop {
    const session_cell_faces *faces;
    /* positions of the face's vertices within its cell; NULL: the vertices are the entries of `list` from the index
     * `first` on */
    const signed char *corners;
    const grid_array *list;
    int64_t first, size;
} session_face_loop;

static inline session_face_loop session_find_face_loop(const session_cell_faces *faces, int64_t face)
{
    session_face_loop out = {.faces = faces};
    if (faces->table) {
        out.corners = faces->table->vertices[face];
        out.size = out.corners[3] < 0 ? 3 : 4;
        return out;
    }
    if (faces->size) {
        out.list = &faces->cells->connectivity;
        out.first = faces->first;
        out.size = faces->size;
        return out;
    }
    int64_t end;
    out.list = &faces->cells->face_connectivity;
    grid_face_vertices(faces->cells, grid_read_index(&faces->cells->connectivity, faces->first + face), &out.first,
                       &end);
    out.size = end - out.first;
    return out;
}

static inline int64_t session_face_vertex(const session_face_loop *loop, int64_t i)
{
    if (loop->corners) return loop->faces->vertices[(int)loop->corners[i]];
    return grid_read_index(loop->list, loop->first + i);
}

#endif
