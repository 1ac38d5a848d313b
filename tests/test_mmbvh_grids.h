/* Grids for the tests of the tree: jittered lattices of tets, hexes, wedges or a mixture of types, in any memory layout
 * that a grid may have. */
#ifndef TEST_MMBVH_GRIDS_H
#define TEST_MMBVH_GRIDS_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "grid.h"

typedef enum lattice_kind { LATTICE_TETS, LATTICE_HEXES, LATTICE_WEDGES, LATTICE_MIXED } lattice_kind;

typedef struct lattice_layout {
    bool wide_coordinates, wide_indices, wide_values;
    /* Whether all arrays have gaps between their elements. Otherwise they are packed, and float coordinates are stored
     * axis by axis. */
    bool strided;
} lattice_layout;

typedef struct lattice {
    grid g;
    grid_field field;
    char *coordinates, *connectivity, *offsets, *types, *ghosts, *values;
} lattice;

/* Returns a pseudorandom number in [0, 1) that depends only on i. */
static inline double hash_to_unit_interval(uint64_t i)
{
    i = (i ^ (i >> 30)) * 0xbf58476d1ce4e5b9u;
    i = (i ^ (i >> 27)) * 0x94d049bb133111ebu;
    return (double)((i ^ (i >> 31)) >> 11) * 0x1p-53;
}

static inline void set_number(const grid_array *a, int64_t i, double value)
{
    char *p = (char *)a->data + i * a->stride;
    if (a->is_wide) {
        memcpy(p, &value, sizeof value);
    } else {
        const float f = (float)value;
        memcpy(p, &f, sizeof f);
    }
}

static inline void set_index(const grid_array *a, int64_t i, int64_t value)
{
    char *p = (char *)a->data + i * a->stride;
    if (a->is_wide) {
        memcpy(p, &value, sizeof value);
    } else {
        const int32_t narrow = (int32_t)value;
        memcpy(p, &narrow, sizeof narrow);
    }
}

static inline grid_array make_array(char **memory, int64_t count, bool wide, bool integer, bool strided)
{
    const int64_t stride = (wide ? 8 : 4) * (strided ? 3 : 1);
    *memory = calloc((size_t)(count ? count : 1), (size_t)stride);
    return (grid_array){.data = *memory, .stride = stride, .is_wide = wide, .is_integer = integer};
}

static inline void make_points(lattice *l, int n, lattice_layout layout)
{
    const int64_t side = n + 1;
    grid *g = &l->g;
    g->vertex_count = side * side * side;
    const bool is_apart = !layout.wide_coordinates && !layout.strided;
    const int64_t size = layout.wide_coordinates ? 8 : 4, stride = (layout.strided ? 5 : is_apart ? 1 : 3) * size;
    /* distance in bytes between the coordinates of two axes */
    const int64_t next = is_apart ? g->vertex_count * size : size;
    l->coordinates = calloc((size_t)g->vertex_count, (size_t)(is_apart ? 3 * stride : stride));
    l->field.values = make_array(&l->values, g->vertex_count, layout.wide_values, false, layout.strided);
    l->field.component_count = 1;
    l->field.component_stride = 4;
    for (int axis = 0; axis < 3; axis++) {
        g->coordinates[axis] =
            (grid_array){.data = l->coordinates + axis * next, .stride = stride, .is_wide = layout.wide_coordinates};
    }
    for (int64_t v = 0; v < g->vertex_count; v++) {
        const int64_t ijk[3] = {v % side, v / side % side, v / side / side};
        double p[3];
        for (int axis = 0; axis < 3; axis++) {
            p[axis] = (double)ijk[axis] + 0.6 * (hash_to_unit_interval((uint64_t)(3 * v + axis)) - 0.5);
            set_number(&g->coordinates[axis], v, p[axis]);
        }
        set_number(&l->field.values, v, sin(0.7 * p[0]) + 0.3 * p[1] * cos(0.2 * p[2]));
    }
}

/* Corners of a cube are numbered by bits x, y, z. */
static const signed char lattice_tets[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                               {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
static const signed char lattice_hex[8] = {0, 1, 3, 2, 4, 5, 7, 6};
static const signed char lattice_wedges[2][6] = {{0, 1, 3, 4, 5, 7}, {0, 3, 2, 4, 7, 6}};
static const signed char lattice_pyramids[3][5] = {{0, 1, 5, 4, 7}, {0, 1, 3, 2, 7}, {0, 2, 6, 4, 7}};

typedef struct lattice_writer {
    lattice *l;
    int64_t cells, entries;
    int64_t corner[8];
} lattice_writer;

static inline void write_cell(lattice_writer *w, int type, const signed char *corners)
{
    lattice *l = w->l;
    for (int i = 0; i < grid_type_vertex_count(type); i++) {
        set_index(&l->g.connectivity, w->entries + i, w->corner[corners[i]]);
    }
    if (l->offsets) set_index(&l->g.offsets, w->cells, w->entries);
    if (l->types) l->types[w->cells * l->g.cell_types_stride] = (char)type;
    w->entries += grid_type_vertex_count(type);
    w->cells++;
}

static inline void write_cube(lattice_writer *w, lattice_kind kind, int64_t cube)
{
    const int choice = kind == LATTICE_MIXED ? (int)(cube % 4) : (int)kind;
    if (choice == 0) {
        for (int i = 0; i < 6; i++) write_cell(w, GRID_TET, lattice_tets[i]);
    } else if (choice == 1) {
        write_cell(w, GRID_HEX, lattice_hex);
    } else if (choice == 2) {
        for (int i = 0; i < 2; i++) write_cell(w, GRID_WEDGE, lattice_wedges[i]);
    } else {
        for (int i = 0; i < 3; i++) write_cell(w, GRID_PYRAMID, lattice_pyramids[i]);
    }
}

/* Makes n x n x n cubes. Each consists of 6 tets, a hex, or 2 wedges; in the mixture, cubes consist in turn of tets, a
 * hex, two wedges, and three pyramids. */
static inline lattice make_lattice(int n, lattice_kind kind, lattice_layout layout)
{
    lattice l = {0};
    make_points(&l, n, layout);
    const int64_t cubes = (int64_t)n * n * n, side = n + 1;
    l.g.connectivity = make_array(&l.connectivity, 24 * cubes, layout.wide_indices, true, layout.strided);
    l.g.cell_type = kind == LATTICE_HEXES ? GRID_HEX : kind == LATTICE_WEDGES ? GRID_WEDGE : GRID_TET;
    if (kind == LATTICE_MIXED) {
        l.g.offsets = make_array(&l.offsets, 6 * cubes, layout.wide_indices, true, layout.strided);
        l.g.cell_types_bytes = 1;
        l.g.cell_types_stride = layout.strided ? 2 : 1;
        l.types = calloc((size_t)(6 * cubes), (size_t)l.g.cell_types_stride);
        l.g.cell_types = l.types;
    }
    lattice_writer w = {.l = &l};
    for (int64_t cube = 0; cube < cubes; cube++) {
        const int64_t base = cube % n + side * (cube / n % n + side * (cube / n / n));
        for (int c = 0; c < 8; c++) w.corner[c] = base + (c & 1) + side * ((c >> 1 & 1) + side * (c >> 2));
        write_cube(&w, kind, cube);
    }
    l.g.cell_count = w.cells;
    return l;
}

static inline void free_lattice(lattice *l)
{
    free(l->coordinates);
    free(l->connectivity);
    free(l->offsets);
    free(l->types);
    free(l->ghosts);
    free(l->values);
}

#endif
