/* The lattice of cubes from which the mesh is made. It uses only index arithmetic and stores nothing per cube, so that
 * any rank can compute any part of the mesh. Cube (i, j, k) has the id i + nx (j + ny k), where i, j, k are along x, y,
 * z. The surface of the ground is at z = 0, and z decreases with depth; x and y are centred on 0. */
#ifndef WAVE_LATTICE_H
#define WAVE_LATTICE_H

#include <stdbool.h>
#include <stdint.h>

#include "wave_shape.h"

typedef enum wave_cells { WAVE_TETS, WAVE_HEXES, WAVE_WEDGES, WAVE_PYRAMIDS, WAVE_MIXED } wave_cells;

typedef struct wave_lattice {
    int size[3];      /* number of cubes along x, y, z; each at least 1 */
    wave_cells cells; /* kind of cells into which cubes are split */
    double jitter;    /* maximum displacement of inner vertices along each axis, relative to the edge; 0 to 0.3 */
    double edge;      /* edge length of a cube; the longest side of the box is 2 */
    double origin[3]; /* corner of the box with the smallest x, y, z */
} wave_lattice;

enum {
    WAVE_CELLS_PER_CUBE = 12
}; /* maximum number of cells per cube; a cell's id is cube id * 12 + index in the cube */

typedef struct wave_cell {
    uint8_t type;      /* cell type, one of WAVE_TYPE_* */
    int64_t vertex[8]; /* global ids; the ids of lattice vertices are smaller than those of cube centres */
} wave_cell;

wave_lattice wave_lattice_make(const int size[3], wave_cells cells, double jitter);

int64_t wave_lattice_cube_count(const wave_lattice *lattice);
int64_t wave_lattice_find_cube_id(const wave_lattice *lattice, const int ijk[3]);
void wave_lattice_find_cube_indices(const wave_lattice *lattice, int64_t cube, int ijk[3]);
bool wave_lattice_contains_cube(const wave_lattice *lattice, const int ijk[3]);

/* Computes the cells of a cube, in an order that depends only on the cube. Returns their number. */
int wave_lattice_make_cells(const wave_lattice *lattice, int64_t cube, wave_cell cells[WAVE_CELLS_PER_CUBE]);

/* Returns the type of all cells, or 0 if they are mixed. */
uint8_t wave_lattice_uniform_type(const wave_lattice *lattice);

/* Computes the indices (i, j, k) of a vertex of the lattice, and returns true. If the vertex is the centre of a cube,
 * returns false, and *ijk receives the indices of the cube. */
bool wave_lattice_find_vertex_indices(const wave_lattice *lattice, int64_t vertex, int ijk[3]);
void wave_lattice_compute_position(const wave_lattice *lattice, int64_t vertex, double xyz[3]);

/* Returns the walls on which the vertex lies: bit 1, 2 or 4 for a wall perpendicular to x, y or z. */
uint8_t wave_lattice_find_walls(const wave_lattice *lattice, int64_t vertex);

/* Returns a 64-bit hash (the finalizer of splitmix64). */
static inline uint64_t wave_hash(uint64_t x)
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

#endif
