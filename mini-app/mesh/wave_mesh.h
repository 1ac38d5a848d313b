/* One rank's part of the mesh: its own cells, and then the halo, which is the cells of other ranks that share a vertex
 * with one of its own. Everything follows from the partition by index arithmetic, so both sides of every exchange make
 * the same lists without talking to each other. */
#ifndef WAVE_MESH_H
#define WAVE_MESH_H

#include <stddef.h>

#include "wave_map.h"
#include "wave_partition.h"

/* Cells exchanged with one other rank. */
typedef struct wave_link {
    int rank;
    int32_t send_begin, send_end;       /* the part of wave_mesh.sends */
    int32_t receive_begin, receive_end; /* halo cells */
} wave_link;

typedef struct wave_mesh {
    wave_partition partition;
    int rank;
    int32_t own_cells, cells;       /* own ones first; cells counts the halo too */
    int32_t own_vertices, vertices; /* own cells' first, then those of halo cells alone */
    int64_t *cell_ids;              /* cells */
    int64_t *vertex_ids;            /* vertices */
    uint8_t *walls;                 /* vertices: wave_lattice_walls() */
    uint8_t uniform_type;           /* 0: mixed */
    uint8_t *types;                 /* cells; NULL where uniform */
    int index_bytes;                /* 4 or 8: of connectivity and offsets */
    void *connectivity;             /* the cells' vertices, one cell after the other */
    void *offsets;                  /* cells + 1; NULL where uniform */
    int64_t connectivity_count;
    int64_t *face_offsets; /* own_cells + 1; NULL where uniform: faces of a cell are those of its shape, in order */
    int32_t *neighbours;   /* for each face of each own cell, the cell beyond, or -1 at a wall */
    int64_t face_count;    /* the faces of own cells, each cell counting its own */
    int64_t unmatched;     /* faces of own cells that lack their other cell, or have two: 0 for a mesh that conforms */
    int64_t *around_offsets; /* own_vertices + 1 */
    int32_t *around;         /* the cells around each vertex of an own cell, by rising cell id */
    int link_count;
    wave_link *links; /* by rising rank */
    int32_t *sends;   /* own cells */
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

/* The local vertices of a cell; returns its shape. */
const wave_cell_shape *wave_mesh_cell(const wave_mesh *mesh, int32_t cell, int32_t vertex[8]);

/* Where the faces of an own cell begin in neighbours. */
static inline int64_t wave_mesh_first_face(const wave_mesh *mesh, int32_t cell)
{
    if (mesh->face_offsets) return mesh->face_offsets[cell];
    return (int64_t)cell * wave_cell_shape_of(mesh->uniform_type)->face_count;
}

#endif
