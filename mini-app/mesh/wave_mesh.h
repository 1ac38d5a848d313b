/* One rank's part of the mesh: its own cells, followed by the halo. The halo consists of the cells of other ranks that
 * share a vertex with one of this rank's cells. Everything is computed from the partition by index arithmetic, so both
 * sides of every exchange compute the same lists without communication. */
#ifndef WAVE_MESH_H
#define WAVE_MESH_H

#include <stddef.h>

#include "wave_map.h"
#include "wave_partition.h"

/* The cells that are exchanged with one other rank. */
typedef struct wave_link {
    int rank;
    int32_t send_begin, send_end;       /* range of the link's cells in wave_mesh.sends */
    int32_t receive_begin, receive_end; /* range of the indices of halo cells whose values the other rank sends */
} wave_link;

typedef struct wave_mesh {
    wave_partition partition;
    int rank;
    /* own_cells: number of own cells, which come first; cells: number of all cells, including the halo */
    int32_t own_cells, cells;
    /* own_vertices: number of vertices of own cells, which come first; vertices: number of all vertices, including
     * those that only halo cells use */
    int32_t own_vertices, vertices;
    int64_t *cell_ids;    /* global id of each cell */
    int64_t *vertex_ids;  /* global id of each vertex */
    uint8_t *walls;       /* for each vertex the walls on which it lies, as wave_lattice_find_walls() returns them */
    uint8_t uniform_type; /* type of all cells; 0 if they are mixed */
    uint8_t *types;       /* type of each cell; NULL if all have uniform_type */
    int index_bytes;      /* size of the integers in connectivity and offsets: 4 or 8 */
    void *connectivity;   /* vertices of all cells, cell by cell */
    void *offsets; /* index of each cell's first entry in connectivity; a final entry is the total. NULL if all cells
                      have one type */
    int64_t connectivity_count;
    /* index of each own cell's first face; own_cells + 1 entries; NULL if uniform. The faces of a cell are in the order
     * of its shape */
    int64_t *face_offsets;
    int32_t *neighbours; /* for each face of each own cell: the neighbour across it, or -1 at a wall */
    int64_t face_count;  /* number of faces of own cells; a face between two own cells is counted twice */
    /* number of wrong faces of own cells: faces inside the box that do not have exactly one neighbour, and faces on a
     * wall that have a neighbour; 0 for a conforming mesh */
    int64_t unmatched;
    int64_t
        *vertex_cell_offsets; /* index of each own vertex's first entry in vertex_cells; a final entry is the total */
    int32_t *vertex_cells;    /* cells around each vertex of an own cell, in ascending order of cell id */
    int link_count;
    wave_link *links; /* links to other ranks, in ascending order of rank */
    int32_t *sends;   /* own cells to send to other ranks, link by link */
    int32_t send_count;
} wave_mesh;

void wave_mesh_free(wave_mesh *mesh);

static inline int wave_mesh_type(const wave_mesh *mesh, int32_t cell)
{
    return mesh->types ? mesh->types[cell] : mesh->uniform_type;
}

static inline int64_t wave_mesh_index(const wave_mesh *mesh, const void *array, int64_t at)
{
    return mesh->index_bytes == 8 ? ((const int64_t *)array)[at] : ((const int32_t *)array)[at];
}

/* Returns the shape of a cell, and its vertices as local indices. */
const wave_cell_shape *wave_mesh_cell(const wave_mesh *mesh, int32_t cell, int32_t vertex[8]);

/* Returns the index of an own cell's first face in `neighbours`. */
static inline int64_t wave_mesh_first_face(const wave_mesh *mesh, int32_t cell)
{
    if (mesh->face_offsets) return mesh->face_offsets[cell];
    return (int64_t)cell * wave_cell_shape_of(mesh->uniform_type)->face_count;
}

#endif
