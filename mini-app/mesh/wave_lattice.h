/* The lattice of cubes that the mesh is cut from. It is index arithmetic alone: nothing is stored per cube, so that any
 * rank can make any part of the mesh. Cube (i, j, k) has id i + nx (j + ny k); i, j, k go along x, y, z. z = 0 is the
 * surface of the ground, z falls with depth; x and y are centred on 0. */
#ifndef WAVE_LATTICE_H
#define WAVE_LATTICE_H

#include <stdbool.h>
#include <stdint.h>

#include "wave_shape.h"

typedef enum wave_cells { WAVE_TETS, WAVE_HEXES, WAVE_WEDGES, WAVE_PYRAMIDS, WAVE_MIXED } wave_cells;

typedef struct wave_lattice {
    int size[3];      /* cubes along x, y, z; each >= 1 */
    wave_cells cells; /* what the cubes are cut into */
    double jitter;    /* inner vertices move by up to this times the edge, per axis; 0 .. 0.3 */
    double edge;      /* edge of a cube; the longest side of the box is 2 */
    double origin[3]; /* the corner of least x, y, z */
} wave_lattice;

enum { WAVE_CELLS_PER_CUBE = 12 }; /* the most there are: cell ids are cube id * 12 + number in the cube */

typedef struct wave_cell {
    uint8_t type;      /* WAVE_TYPE_* */
    int64_t vertex[8]; /* ids: of lattice vertices, then of cube centres */
} wave_cell;

wave_lattice wave_lattice_make(const int size[3], wave_cells cells, double jitter);

int64_t wave_lattice_cube_count(const wave_lattice *lattice);
int64_t wave_lattice_cube(const wave_lattice *lattice, const int ijk[3]);
void wave_lattice_cube_ijk(const wave_lattice *lattice, int64_t cube, int ijk[3]);
bool wave_lattice_holds(const wave_lattice *lattice, const int ijk[3]);

/* The cells of a cube, in an order that depends on the cube alone. Returns their number. */
int wave_lattice_cells(const wave_lattice *lattice, int64_t cube, wave_cell cells[WAVE_CELLS_PER_CUBE]);

/* The type of all cells, or 0 where they are mixed. */
uint8_t wave_lattice_uniform_type(const wave_lattice *lattice);

/* Finds a vertex's place in the lattice. Returns false, and the cube's ijk, for a vertex at a cube's centre. */
bool wave_lattice_vertex_ijk(const wave_lattice *lattice, int64_t vertex, int ijk[3]);
void wave_lattice_vertex(const wave_lattice *lattice, int64_t vertex, double xyz[3]);

/* Bits 1, 2, 4: the vertex lies on a wall across x, y, z. */
uint8_t wave_lattice_walls(const wave_lattice *lattice, int64_t vertex);

/* A fixed hash of 64 bits (the finalizer of splitmix64). */
static inline uint64_t wave_hash(uint64_t x)
{
    x += 0x9e3779b97f4a7c15u;
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

#endif
