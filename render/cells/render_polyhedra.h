/* Polyhedra as kernels want them: taken apart once a tile, into one thread's memory. The essay is in
 * render_polyhedra.c. */
#ifndef RENDER_RENDER_POLYHEDRA_H
#define RENDER_RENDER_POLYHEDRA_H

#include <stddef.h>

#include "grid.h"

/* A triangle of the surface: vertices and edges (ab, bc, ac) by number, a < b < c. */
typedef struct polyhedron_facet {
    int vertex[3];
    int edge[3];
    int quad;   /* the quad it is half of, or -1, */
    int twin;   /* and the other half's number */
    float sign; /* for the tet it spans with the centre: 1, -1 where that lies outside, 0 where it has no volume */
} polyhedron_facet;

/* Vertices are numbered in the order of coordinates, so that a < b says which of two comes first; the centre is number
 * vertex_count, behind them all. Everything is in an order that depends on coordinates and values alone. */
typedef struct polyhedron {
    struct polyhedron *next; /* in the store's table */
    uint32_t index;
    int part, layer;
    bool is_finite, is_placed, is_constant;
    bool is_star; /* no sign is negative */
    bool has_slopes;
    int vertex_count, edge_count, facet_count;
    double (*world)[3]; /* vertex_count + 1 each, from here */
    double *values;
    float *x, *y, *z;  /* tile space */
    float *f, *g;      /* values as the kernels want them; of the colour field */
    double scale;      /* for the values in f */
    double fall, rise; /* by how much values change at most along the tile's rays, down and up, a unit of depth */
    float (*lines)[4]; /* kernel_cell.h: of the edges, then from each vertex to the centre */
    float least;       /* for all its triangles: kernel_blur_least() */
    int64_t *vertices; /* vertex_count */
    int (*edges)[2];
    polyhedron_facet *facets;
    int (*quads)[4]; /* the corners around of faces of four vertices in as many places */
} polyhedron;

/* A quad with two neighbouring corners in one place is a triangle, and its neighbour may have it as such. */
static inline bool quad_collapses(const double *const corners[4])
{
    for (int i = 0; i < 4; i++) {
        const double *a = corners[i], *b = corners[(i + 1) & 3];
        if (a[0] == b[0] && a[1] == b[1] && a[2] == b[2]) return true;
    }
    return false;
}

typedef struct polyhedron_store polyhedron_store;

/* Makes the store of one thread. Returns NULL where memory ran out. */
polyhedron_store *polyhedra_create(void);
void polyhedra_free(polyhedron_store *store);

/* Forget all. */
void polyhedra_reset(polyhedron_store *store);

/* The cell with the field's values, not placed when it is new. What an earlier call returned may be gone after this
 * one. NULL where memory ran out. layer tells fields apart. */
polyhedron *polyhedra_find(polyhedron_store *store, const grid *g, const grid_field *field, int part, int layer,
                           uint32_t index);

/* Room for the kernels' own numbers about one cell, 64-byte aligned; the next call may take it back. */
void *polyhedra_scratch(polyhedron_store *store, size_t bytes);

#endif
