/* Normals out of gradients at the vertices: the three components are interpolated in the hit's cell just as values are,
 * so that they go on from cell to cell without a jump, and so does the light on the surface.
 *
 * Only what is seen gets one: a hit keeps its cell, and in the place of its normal where it lies in that, until no
 * nearer one can come. Then rays are taken one by one; those of a packet that hit the same cell share its
 * coefficients. */
#ifndef RENDER_KERNEL_VERTEX_NORMALS_H
#define RENDER_KERNEL_VERTEX_NORMALS_H

#include <math.h>
#include <string.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_hits.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "render.h"
#include "simd.h"

/* A cell's gradients, in camera axes. */
typedef struct kernel_smooth_cell {
    int part;
    int32_t index;
    kernel_cell cell;
    double gradient[3][GRID_MAX_CELL_VERTICES];
    double polynomial[3][8]; /* of all but tets */
} kernel_smooth_cell;

/* The gradient at a vertex, in camera axes; 0 where it has none. */
SIMD_INLINE void kernel_vertex_gradient(const kernel_frame *f, const render_vertex_gradients *gradients, int64_t vertex,
                                        double out[3])
{
    const double *axes[3] = {f->job->camera.right, f->job->camera.up, f->job->camera.forward};
    const int32_t entry = gradients->entries ? gradients->entries[vertex] : -1;
    for (int k = 0; k < 3; k++) {
        const float *g = gradients->gradients[entry < 0 ? 0 : entry];
        out[k] = entry < 0 ? 0 : ((double)g[0] * axes[k][0] + (double)g[1] * axes[k][1]) + (double)g[2] * axes[k][2];
    }
}

static void kernel_smooth_setup(const kernel_packet *p, const render_surface_layer *layer, int part, int32_t index,
                                kernel_smooth_cell *out)
{
    const grid *g = p->frame->job->parts[part].cells;
    kernel_cell *c = &out->cell;
    out->part = part;
    out->index = index;
    kernel_cell_fetch(c, g, &layer->field.fields[part], (uint32_t)index);
    kernel_cell_place_in(c, p->frame, p->tile, g);
    for (int i = 0; i < c->count; i++) {
        double gradient[3];
        kernel_vertex_gradient(p->frame, &layer->gradients[part], c->vertices[i], gradient);
        for (int k = 0; k < 3; k++) out->gradient[k][i] = gradient[k];
    }
    for (int k = 0; k < 3 && c->type != GRID_TET; k++)
        kernel_polynomial_fit(out->polynomial[k], c->type, out->gradient[k]);
}

/* A point's barycentric coordinates in a tet of four corners; 1/4 each where the tet has no volume. */
SIMD_INLINE void kernel_barycentric(const double corner[4][3], const double point[3], double out[4])
{
    double d[4][3], sum = 0;
    for (int i = 0; i < 4; i++)
        for (int a = 0; a < 3; a++) d[i][a] = corner[i][a] - point[a];
    for (int i = 0; i < 4; i++) {
        const double *u = d[(i + 1) & 3], *v = d[(i + 2) & 3], *w = d[(i + 3) & 3];
        const double volume = (u[0] * (v[1] * w[2] - v[2] * w[1]) + u[1] * (v[2] * w[0] - v[0] * w[2])) +
                              u[2] * (v[0] * w[1] - v[1] * w[0]);
        out[i] = i & 1 ? -volume : volume; /* three steps around four corners are an odd permutation */
        sum += out[i];
    }
    for (int i = 0; i < 4; i++) {
        const double share = out[i] / sum;
        out[i] = share >= -1 && share <= 2 ? share : 0.25;
    }
}

/* kernel_value_of() in double. */
SIMD_INLINE double kernel_polynomial_at(const double c[8], bool is_pyramid, const double r[3])
{
    double m = r[0] * r[1];
    if (is_pyramid) {
        const double share = r[0] / (r[2] > 1e-6 ? r[2] : 1e-6);
        m = (share < -1 ? -1 : share > 2 ? 2 : share) * r[1];
    }
    const double v = ((c[0] + r[0] * c[1]) + (r[1] * c[2] + r[2] * c[3])) + m * c[4];
    return is_pyramid ? v : v + r[2] * ((r[0] * c[5] + r[1] * c[6]) + m * c[7]);
}

/* place: the cell's own coordinates, or of a tet the point in tile space. */
SIMD_INLINE void kernel_smooth_at(const kernel_smooth_cell *s, const double place[3], float out[3])
{
    const kernel_cell *c = &s->cell;
    if (c->type != GRID_TET) {
        for (int k = 0; k < 3; k++)
            out[k] = (float)kernel_polynomial_at(s->polynomial[k], c->type == GRID_PYRAMID, place);
        return;
    }
    double corner[4][3], share[4];
    for (int i = 0; i < 4; i++) {
        corner[i][0] = (double)c->x[i];
        corner[i][1] = (double)c->y[i];
        corner[i][2] = (double)c->z[i];
    }
    kernel_barycentric(corner, place, share);
    for (int k = 0; k < 3; k++) {
        const double *g = s->gradient[k];
        out[k] = (float)((share[0] * g[0] + share[1] * g[1]) + (share[2] * g[2] + share[3] * g[3]));
    }
}

/* Where a ray is at t, in tile space. */
SIMD_INLINE void kernel_ray_point(const kernel_packet *p, int ray, float t, double out[3])
{
    out[0] = (double)p->origin_x[ray] + (double)p->slope_x[ray] * (double)t;
    out[1] = (double)p->origin_y[ray] + (double)p->slope_y[ray] * (double)t;
    out[2] = (double)t;
}

/* Turn what hits have in the place of their normals into normals, in camera axes. Hits of no cell have theirs. */
static __attribute__((noinline)) void kernel_vertex_normals(const kernel_packet *p, const kernel_surface *s, vm rays,
                                                            vf t, const kernel_hit_cells *cells, vf normal[3])
{
    kernel_smooth_cell known;
    known.part = -1;
    for (unsigned left = vm_bits(rays); left; left &= left - 1) {
        const int ray = __builtin_ctz(left);
        const int part = cells->part[ray];
        const int32_t index = cells->index[ray];
        double place[3];
        float out[3];
        if (part < 0) continue;
        if (known.part != part || known.index != index) kernel_smooth_setup(p, s->layer, part, index, &known);
        if (known.cell.type == GRID_TET)
            kernel_ray_point(p, ray, t[ray], place);
        else
            for (int a = 0; a < 3; a++) place[a] = (double)normal[a][ray];
        kernel_smooth_at(&known, place, out);
        for (int a = 0; a < 3; a++) normal[a][ray] = out[a];
    }
}

#endif
