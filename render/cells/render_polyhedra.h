/* Polyhedra in the form that kernels use: the faces are divided into triangles (facets), and a centre, the mean of the
 * vertices, forms a tet with each triangle. A polyhedron is decomposed once per tile, in memory of the thread that
 * traces the tile; render_polyhedra.c explains how. */
#ifndef RENDER_RENDER_POLYHEDRA_H
#define RENDER_RENDER_POLYHEDRA_H

#include <stddef.h>

#include "grid.h"

/* A triangle of the polyhedron's surface. vertex: indices a < b < c of its vertices in the polyhedron; edge: indices of
 * its edges ab, bc and ac. */
typedef struct polyhedron_facet {
    int vertex[3];
    int edge[3];
    int quad;       /* index in `quads` of the quad of which the triangle is one half, or -1 */
    int other_half; /* index of the triangle that is the quad's other half, or -1 */
    /* sign of the volume of the tet between the triangle and the centre: 1; -1 if the tet is inverted; 0 if it has no
     * volume */
    float sign;
} polyhedron_facet;

/* A decomposed polyhedron. Vertices are stored in the lexicographic order of coordinates, then the centre, at index
 * vertex_count. The order of vertices, edges and facets depends only on the vertices' coordinates and values. */
typedef struct polyhedron {
    struct polyhedron *next; /* next polyhedron in the same slot of the store's hash table */
    uint32_t index;
    int part, layer;
    /* is_finite: the values at all vertices are finite; is_transformed: x, y and z are computed; is_constant: all
     * values are equal */
    bool is_finite, is_transformed, is_constant;
    bool is_star_shaped; /* true if no tet's sign is negative: the cell is star-shaped from its centre */
    bool has_slopes;     /* set if `fall` and `rise` have been computed */
    int vertex_count, edge_count, facet_count;
    double (*world)[3]; /* the arrays from `world` to `g` have one entry for each vertex, then one for the centre */
    double *values;
    float *x, *y, *z; /* vertices and centre in tile space */
    /* f: values of the layer's field, for a surface minus an isovalue and scaled, for a volume in the transfer
     * function's domain; g: values of the colour field, in the domain of its transfer function */
    float *f, *g;
    double scale; /* factor by which the differences from the isovalue are multiplied in f */
    /* upper bounds, over all tets of the cell and all rays of the tile, of the rates per unit of t at which the field
     * falls and rises along a ray */
    double fall, rise;
    /* the four members of kernel_line (kernel_cell.h), for each edge, then for the edge from each vertex to the
     * centre */
    float (*lines)[4];
    /* if the sum of a crossing's weights is at least this, the crossing is accurate, whichever triangle is crossed
     * (kernel_bound_least_weight_sum()) */
    float least;
    int64_t *vertices; /* vertex indices in the mesh, vertex_count of them */
    int (*edges)[2];
    polyhedron_facet *facets;
    int (*quads)[4]; /* for each face that has four vertices at four different positions: its corners in cyclic order */
} polyhedron;

/* Returns whether two neighbouring corners of a quad are at the same position. Such a quad is treated as a triangle,
 * because the neighbouring cell may have it as a triangle. */
static inline bool quad_collapses(const double *const corners[4])
{
    for (int i = 0; i < 4; i++) {
        const double *a = corners[i], *b = corners[(i + 1) & 3];
        if (a[0] == b[0] && a[1] == b[1] && a[2] == b[2]) return true;
    }
    return false;
}

typedef struct polyhedron_store polyhedron_store;

/* Creates the store of one thread. Returns NULL if there is no memory. */
polyhedron_store *polyhedra_create(void);
void polyhedra_free(polyhedron_store *store);

/* Removes all polyhedra from the store; its memory is kept for new ones. */
void polyhedra_reset(polyhedron_store *store);

/* Returns cell `index` of the mesh part from the store, with the field's values; if it is not in the store, it is
 * decomposed, and its members in tile space are not set yet. Pointers that earlier calls returned may be invalid after
 * this call. The layer is part of the key, because layers have different fields. Returns NULL if there is no memory. */
polyhedron *polyhedra_find(polyhedron_store *store, const grid *g, const grid_field *field, int part, int layer,
                           uint32_t index);

/* Returns memory for temporary arrays of the kernels, aligned to 64 bytes. The next call may reuse or free it. Returns
 * NULL if there is no memory. */
void *polyhedra_scratch(polyhedron_store *store, size_t bytes);

#endif
