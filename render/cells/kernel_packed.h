/* Meshes that most simulations of tets or hexes have, whose arrays are read without asking each element for its type.
 */
#ifndef RENDER_KERNEL_PACKED_H
#define RENDER_KERNEL_PACKED_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "simd.h"

/* A mesh of tets alone, or of hexes, whose indices are int32 one after the other, and whose coordinates and values
 * float32, within reach of a gather: strides in elements. */
typedef struct kernel_packed {
    bool is_tets;                         /* of tets; */
    bool is_hexes;                        /* of hexes */
    bool is_interleaved;                  /* a vertex's coordinates are side by side */
    const int32_t *connectivity;          /* NULL: the cells' vertices are one after the other */
    int32_t base;                         /* of the indices */
    const float *coordinates[3], *values; /* of the vertex of index 0, which there may not be */
    int32_t stride, value_stride;
    float eye[3][2], scale; /* in two parts: the nearest float, and what is left */
} kernel_packed;

/* A stride in elements of float32; 0: elements are others, or some of so many out of a gather's reach. */
static inline int32_t kernel_packed_stride(const grid_array *a, int64_t count)
{
    const int64_t stride = a->stride / (int64_t)sizeof(float);
    const bool is_packed = !a->is_wide && !a->is_integer && a->stride % (int64_t)sizeof(float) == 0;
    return is_packed && stride > 0 && stride < INT32_MAX && count <= INT32_MAX / stride ? (int32_t)stride : 0;
}

/* Numbers are of sizes at which float32 differences keep their precision. */
static inline void kernel_packed_begin(kernel_packed *p, const kernel_frame *f, const grid *g, const grid_field *field)
{
    const grid_array *c = g->coordinates;
    memset(p, 0, sizeof *p);
    if (g->offsets.data || g->cell_types || (g->cell_type != GRID_TET && g->cell_type != GRID_HEX) ||
        g->connectivity.is_wide || g->connectivity.stride != sizeof(int32_t) || field->is_cell_centred ||
        field->component < 0)
        return;
    p->connectivity = (const int32_t *)(const void *)g->connectivity.data;
    const int64_t base = g->connectivity.base, count = g->vertex_count + base;
    p->base = (int32_t)base;
    p->stride = kernel_packed_stride(&c[0], count);
    p->value_stride = kernel_packed_stride(&field->values, count);
    p->values = (const float *)(const void *)(field->values.data + field->component * field->component_stride -
                                              base * field->values.stride);
    p->scale = (float)f->job->space.scale;
    p->is_tets = p->stride && p->value_stride && p->scale > 1e-25f && p->scale < 1e25f;
    p->is_interleaved = true;
    for (int a = 0; a < 3; a++) {
        const double eye = f->job->camera.eye[a];
        p->coordinates[a] = (const float *)(const void *)(c[a].data - base * c[a].stride);
        p->eye[a][0] = (float)eye;
        p->eye[a][1] = (float)(eye - (double)p->eye[a][0]);
        p->is_tets = p->is_tets && kernel_packed_stride(&c[a], count) == p->stride && fabs(eye) < 1e15;
        p->is_interleaved = p->is_interleaved && c[a].data == c[0].data + a * (int64_t)sizeof(float);
    }
    p->is_hexes = p->is_tets && g->cell_type == GRID_HEX;
    p->is_tets = p->is_tets && g->cell_type == GRID_TET;
}

/* What is kept of a surface's cells on a part; NULL: nothing is. */
SIMD_INLINE const kernel_active *kernel_active_of(const kernel_frame *f, int surface, int part)
{
    const kernel_active *active = f->active ? &f->active[surface * f->job->part_count + part] : NULL;
    return active && active->records ? active : NULL;
}

/* A surface's cells on a part: as they are kept, or else in the mesh. */
static inline void kernel_packed_surface(kernel_packed *p, const kernel_frame *f, int surface, int part)
{
    const kernel_active *active = kernel_active_of(f, surface, part);
    kernel_packed_begin(p, f, f->job->parts[part].cells, &f->surfaces[surface].layer->field.fields[part]);
    if (!active) return;
    p->connectivity = NULL;
    p->base = 0;
    for (int a = 0; a < 3; a++) p->coordinates[a] = active->records + a;
    p->values = active->records + 3;
    p->stride = p->value_stride = KERNEL_ACTIVE_FLOATS;
    p->is_interleaved = true;
}

/* A cell's i-th vertex, of so many. */
SIMD_INLINE int32_t kernel_packed_vertex(const kernel_packed *p, uint32_t cell, int vertices, int i)
{
    const int64_t at = (int64_t)cell * vertices + i;
    return p->connectivity ? p->connectivity[at] : (int32_t)at;
}

/* Nothing of cells that are kept: all of one was asked for at once (kernel_candidate_prefetch()). */
SIMD_INLINE void kernel_packed_prefetch(const kernel_packed *p, int32_t vertex)
{
    if (!p->connectivity) return;
    const int64_t at = (int64_t)vertex * p->stride;
    __builtin_prefetch(p->values + (int64_t)vertex * p->value_stride);
    __builtin_prefetch(p->coordinates[0] + at);
    if (!p->is_interleaved) __builtin_prefetch(p->coordinates[1] + at);
    __builtin_prefetch(p->coordinates[2] + at);
}

/* A tet or hex with finite values, as kernel_cell_fetch() makes it, and where its vertices are; for the
 * caller to place. */
SIMD_INLINE void kernel_packed_fetch(kernel_cell *c, const kernel_packed *p, uint32_t index, int vertices)
{
    c->index = index;
    c->type = vertices == 8 ? GRID_HEX : GRID_TET;
    c->count = vertices;
    c->is_finite = c->is_placed = true;
    c->has_lines = c->has_normal = false;
    for (int i = 0; i < vertices; i++) {
        const int64_t vertex = kernel_packed_vertex(p, index, vertices, i);
        c->vertices[i] = vertex - p->base;
        c->values[i] = (double)p->values[vertex * p->value_stride];
        for (int a = 0; a < 3; a++) c->world[i][a] = (double)p->coordinates[a][vertex * p->stride];
    }
}

/* A tet, as kernel_cell_move() places it. */
SIMD_INLINE void kernel_packed_cell(kernel_cell *c, const kernel_packed *p, const kernel_frame *f,
                                    const kernel_tile *tile, uint32_t index)
{
    kernel_packed_fetch(c, p, index, 4);
    kernel_tet_place(c, f, tile);
}

#endif
