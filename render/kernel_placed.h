/* Tets of a plain mesh, one a lane, placed for a tile and given their lines: the operations of kernel_tet_place(),
 * kernel_cell_order(), kernel_cell_domain() and kernel_tet_lines(), and so the same bits, for as many tets at once as a
 * vector has lanes. Vertices are put in order first, by coordinates that float32 has as they are, so that all else
 * comes in order; what is computed in double are plain arrays and one loop a quantity, which compilers vectorize. */
#ifndef RENDER_KERNEL_PLACED_H
#define RENDER_KERNEL_PLACED_H

#include "kernel_plain.h"
#include "kernel_volume.h"

/* Lane by lane what kernel_cell has. */
typedef struct kernel_placed {
    float world[3][4][SIMD_WIDTH], values[4][SIMD_WIDTH]; /* as they were handed over */
    float at[3][4][SIMD_WIDTH], f[4][SIMD_WIDTH];
    float c[KERNEL_TET_EDGES][SIMD_WIDTH], cu[KERNEL_TET_EDGES][SIMD_WIDTH], cv[KERNEL_TET_EDGES][SIMD_WIDTH];
    float bound[KERNEL_TET_EDGES][SIMD_WIDTH], least[4][SIMD_WIDTH], doubt[SIMD_WIDTH];
} kernel_placed;

/* Vertices on their way into order. */
typedef struct kernel_ordered {
    vf at[3];
    vi vertex;
} kernel_ordered;

SIMD_INLINE vi vi_select(vm m, vi a, vi b)
{
    return vi_from_bits(vf_select(m, vf_from_bits(a), vf_from_bits(b)));
}

/* In the lanes in which b is before a, they change places. */
SIMD_INLINE void kernel_ordered_swap(kernel_ordered *a, kernel_ordered *b)
{
    vm before = vf_lt(b->at[2], a->at[2]);
    for (int axis = 1; axis >= 0; axis--)
        before = vm_or(vf_lt(b->at[axis], a->at[axis]), vm_and(vf_eq(b->at[axis], a->at[axis]), before));
    const kernel_ordered was = *a;
    for (int axis = 0; axis < 3; axis++) {
        a->at[axis] = vf_select(before, b->at[axis], was.at[axis]);
        b->at[axis] = vf_select(before, was.at[axis], b->at[axis]);
    }
    a->vertex = vi_select(before, b->vertex, was.vertex);
    b->vertex = vi_select(before, was.vertex, b->vertex);
}

/* Neighbours alone change places, and equal ones do not: vertices in one place stay as they came. */
SIMD_INLINE void kernel_ordered_fetch(const kernel_plain *p, const int32_t vertices[4][SIMD_WIDTH],
                                      kernel_ordered spots[4])
{
    for (int i = 0; i < 4; i++) {
        memcpy(&spots[i].vertex, vertices[i], sizeof spots[i].vertex);
        for (int a = 0; a < 3; a++) spots[i].at[a] = vf_gather(p->coordinates[a], spots[i].vertex * p->stride);
    }
    for (int last = 3; last > 0; last--)
        for (int i = 0; i < last; i++) kernel_ordered_swap(&spots[i], &spots[i + 1]);
}

/* kernel_tet_place() of one of the vertices. */
SIMD_INLINE void kernel_placed_spot(kernel_placed *out, const kernel_frame *f, const kernel_tile *tile,
                                    const kernel_ordered *spot, int i)
{
    const bool flat = f->job->camera.is_orthographic;
    const double *eye = f->job->camera.eye, (*axes)[3] = (const double(*)[3])f->scaled_axes;
    const double scale = f->job->space.scale;
    for (int a = 0; a < 3; a++) vf_store(out->world[a][i], spot->at[a]);
    for (int n = 0; n < SIMD_WIDTH; n++) {
        const double d0 = (double)out->world[0][i][n] - eye[0], d1 = (double)out->world[1][i][n] - eye[1],
                     d2 = (double)out->world[2][i][n] - eye[2];
        const double x = axes[0][0] * d0 + axes[0][1] * d1 + axes[0][2] * d2;
        const double y = axes[1][0] * d0 + axes[1][1] * d1 + axes[1][2] * d2;
        const double z = axes[2][0] * d0 + axes[2][1] * d1 + axes[2][2] * d2;
        const double depth = flat ? scale : z;
        out->at[0][i][n] = (float)(x - tile->centre_x * depth);
        out->at[1][i][n] = (float)(y - tile->centre_y * depth);
        out->at[2][i][n] = (float)(z - tile->depth_shift);
    }
}

/* kernel_cell_domain() of one of the vertices. */
SIMD_INLINE void kernel_placed_value(kernel_placed *out, const kernel_plain *p, const kernel_transfer *t, vi vertex,
                                     int i)
{
    vf_store(out->values[i], vf_gather(p->values, vertex * p->value_stride));
    for (int n = 0; n < SIMD_WIDTH; n++)
        out->f[i][n] = kernel_hold(((double)out->values[i][n] - t->low) * t->inverse_width, 1e18);
}

/* kernel_line_between() of one of the edges, without its bound. */
SIMD_INLINE void kernel_placed_line(kernel_placed *out, const kernel_frame *f, int edge)
{
    const int a = kernel_tet_edge[edge][0], b = kernel_tet_edge[edge][1];
    const bool flat = f->job->camera.is_orthographic;
    for (int n = 0; n < SIMD_WIDTH; n++) {
        const double ax = (double)out->at[0][a][n], ay = (double)out->at[1][a][n];
        const double bx = (double)out->at[0][b][n], by = (double)out->at[1][b][n];
        const double da = flat ? 1 : (double)out->at[2][a][n] + f->depth_shift;
        const double db = flat ? 1 : (double)out->at[2][b][n] + f->depth_shift;
        out->c[edge][n] = (float)(ax * by - bx * ay);
        out->cu[edge][n] = (float)(db * ay - da * by);
        out->cv[edge][n] = (float)(da * bx - db * ax);
    }
}

/* Bounds of the lines, and the faces' least weights. */
SIMD_INLINE void kernel_placed_bounds(kernel_placed *out, const kernel_frame *f, const kernel_tile *tile)
{
    const bool flat = f->job->camera.is_orthographic;
    vf at[4][3], size[4], errors[KERNEL_TET_EDGES], extents[KERNEL_TET_EDGES], doubt = vf_set(0);
    for (int i = 0; i < 4; i++) {
        for (int a = 0; a < 3; a++) at[i][a] = vf_load(out->at[a][i]);
        vf depth = vf_set(1);
        if (!flat) depth = vf_abs(at[i][2]) + fabsf((float)f->depth_shift);
        size[i] = 2 * vf_max(vf_abs(at[i][0]), vf_abs(at[i][1])) + (5 * tile->radius) * depth;
    }
    for (int n = 0; n < KERNEL_TET_EDGES; n++) {
        const int i = kernel_tet_edge[n][0], j = kernel_tet_edge[n][1];
        const vf bound = (6 * 6e-8f) * (size[i] * size[j]);
        const vf x = vf_abs(at[i][0] - at[j][0]), y = vf_abs(at[i][1] - at[j][1]), z = vf_abs(at[i][2] - at[j][2]);
        vf_store(out->bound[n], bound);
        doubt = vf_max(bound, doubt);
        errors[n] = 6e-8f * (3 * vf_abs(vf_load(out->c[n])) +
                             tile->radius * (4 * vf_abs(vf_load(out->cu[n])) + 3 * vf_abs(vf_load(out->cv[n]))));
        extents[n] = z + 0.25f * (x + y);
    }
    vf_store(out->doubt, doubt);
    for (int n = 0; n < 4; n++) {
        const signed char *edge = kernel_tet_face[n] + 3;
        const vf error = (errors[edge[0]] + errors[edge[1]]) + errors[edge[2]];
        const vf extent = (extents[edge[0]] + extents[edge[1]]) + extents[edge[2]];
        vf_store(out->least[n], (error * extent) * (0.5f / KERNEL_WEIGHT_ERROR));
    }
}

/* vertices: 0 to 3 of each lane's tet. */
static __attribute__((noinline)) void kernel_place_tets(kernel_placed *out, const kernel_plain *p,
                                                        const kernel_frame *f, const kernel_tile *tile,
                                                        const kernel_transfer *t, const int32_t vertices[4][SIMD_WIDTH])
{
    kernel_ordered spots[4];
    kernel_ordered_fetch(p, vertices, spots);
    for (int i = 0; i < 4; i++) {
        kernel_placed_spot(out, f, tile, &spots[i], i);
        kernel_placed_value(out, p, t, spots[i].vertex, i);
    }
    for (int n = 0; n < KERNEL_TET_EDGES; n++) kernel_placed_line(out, f, n);
    kernel_placed_bounds(out, f, tile);
}

/* Lane n as a cell, with all that rays ask of a tet in float32. */
SIMD_INLINE void kernel_placed_cell(const kernel_placed *placed, int n, kernel_cell *c)
{
    c->type = GRID_TET;
    c->count = 4;
    c->is_finite = c->is_placed = c->has_lines = true;
    for (int i = 0; i < 4; i++) {
        c->x[i] = placed->at[0][i][n];
        c->y[i] = placed->at[1][i][n];
        c->z[i] = placed->at[2][i][n];
        c->f[i] = placed->f[i][n];
        c->least[i] = placed->least[i][n];
    }
    for (int i = 0; i < KERNEL_TET_EDGES; i++)
        c->lines[i] = (kernel_line){placed->c[i][n], placed->cu[i][n], placed->cv[i][n], placed->bound[i][n]};
    c->doubt = placed->doubt[n];
}

/* What kernel_fine.h asks beside that. */
SIMD_INLINE void kernel_placed_exactly(const kernel_placed *placed, int n, kernel_cell *c)
{
    for (int i = 0; i < 4; i++) {
        c->values[i] = (double)placed->values[i][n];
        for (int a = 0; a < 3; a++) c->world[i][a] = (double)placed->world[a][i][n];
    }
}

#endif
