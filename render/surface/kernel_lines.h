/* Draws contour lines on surfaces: lines on which another field, interpolated in the cell that is hit, equals one of
 * the layer's levels.
 *
 * A hit's distance from the line of a level, in pixels, is |f - level| divided by the change of f from one pixel to the
 * next. That change is taken along the surface: the rays through the neighbouring pixels meet the surface's tangent
 * plane next to the hit. All vectors are in camera axes, z along the view. Let d be the ray's direction, with d.z = 1,
 * n the surface's normal and g the gradient of f. A step parallel to the picture at the hit's depth, followed by a step
 * along the ray back to the tangent plane, changes f by
 *      G = (gx, gy) - (nx, ny) (g.d) / (n.d)
 * times the step's length, which is a pixel's size at that depth. The weight of the line's colour is the share of a box
 * of one pixel that a strip of the line's width covers: with the distance from the line it falls along a ramp that is
 * one pixel wide. Lines that are less than two widths apart fade, and at a distance of one width they vanish, because
 * otherwise only lines would be visible.
 *
 * Everything is computed from the cell and the ray alone, so that lines are the same on any partition. */
#ifndef RENDER_KERNEL_LINES_H
#define RENDER_KERNEL_LINES_H

#include <math.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_colour.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_types.h"
#include "kernel_wide.h"
#include "render.h"
#include "simd.h"

/* The field whose contour lines are drawn, at hits on the surface, one hit per lane. value: the field, mapped linearly
 * so that it is 0 on the first line and, if there are several lines, 1 on the last (kernel_lines); gradient: the
 * gradient of `value` per scaled unit, in camera axes; normal: a vector of any length along the surface's normal, in
 * camera axes. */
typedef struct kernel_line_field {
    vf value, gradient[3], normal[3];
} kernel_line_field;

/* Returns the value at a vertex of the field whose contour lines are drawn, mapped as in kernel_lines (0 on the first
 * line and, if there are several, 1 on the last); it may be NaN. */
SIMD_INLINE double kernel_lines_read_vertex_value(const kernel_surface *s, const grid_field *field, int64_t vertex)
{
    return (grid_field_value(field, vertex) - s->lines.low) * s->lines.inverse_width;
}

/* Computes the gradient g of a field that changes by df[i] along the vectors d[i], by Cramer's rule. */
SIMD_INLINE void kernel_solve_for_gradient(const double d[3][3], const double df[3], double g[3])
{
    double n[3][3];
    for (int i = 0; i < 3; i++) {
        const double *u = d[(i + 1) % 3], *v = d[(i + 2) % 3];
        for (int a = 0; a < 3; a++) n[i][a] = u[(a + 1) % 3] * v[(a + 2) % 3] - u[(a + 2) % 3] * v[(a + 1) % 3];
    }
    const double volume = d[0][0] * n[0][0] + d[0][1] * n[0][1] + d[0][2] * n[0][2];
    for (int a = 0; a < 3; a++) g[a] = (df[0] * n[0][a] + df[1] * n[1][a] + df[2] * n[2][a]) / volume;
}

/* Computes the gradient of a linear field in a tet, per scaled unit, in camera axes. corner: world coordinates of the
 * corners; value: the field there. */
SIMD_INLINE void kernel_tet_gradient(const kernel_frame *f, const double *const corner[4], const double value[4],
                                     double out[3])
{
    const double scale = f->job->space.scale;
    double d[3][3], df[3], g[3];
    for (int i = 0; i < 3; i++) {
        df[i] = value[i] - value[3];
        for (int a = 0; a < 3; a++) d[i][a] = (corner[i][a] - corner[3][a]) * scale;
    }
    kernel_solve_for_gradient((const double(*)[3])d, df, g);
    for (int a = 0; a < 3; a++) {
        const double *axis = f->scaled_axes[a];
        out[a] = (axis[0] * g[0] + axis[1] * g[1] + axis[2] * g[2]) / scale;
    }
}

/* The field whose contour lines are drawn, in one tet, in which it is linear. Values are mapped as in kernel_lines:
 * they are 0 on the first line and, if there are several, 1 on the last. */
typedef struct kernel_tet_line {
    float value;       /* value at the tet's last vertex */
    float gradient[3]; /* gradient of the value per scaled unit, in camera axes */
    float along;       /* change of the value per scaled unit of depth along the tile's middle ray */
} kernel_tet_line;

/* Computes the contour lines' field in a tet of a mesh part. world, vertices: the tet's world coordinates and vertex
 * indices. */
static __attribute__((noinline)) void kernel_compute_tet_line_field(const kernel_frame *f, const kernel_tile *tile,
                                                                    const kernel_surface *s, int part,
                                                                    const double (*world)[3], const int64_t *vertices,
                                                                    kernel_tet_line *out)
{
    const grid_field *field = &s->layer->lines->field.fields[part];
    const double *const corner[4] = {world[0], world[1], world[2], world[3]};
    double value[4], g[3];
    for (int i = 0; i < 4; i++) value[i] = kernel_lines_read_vertex_value(s, field, vertices[i]);
    kernel_tet_gradient(f, corner, value, g);
    /* in tile space the third axis is the direction of the tile's middle ray */
    const double shear[2] = {(double)tile->shear_x, (double)tile->shear_y};
    out->value = (float)value[3];
    out->along = (float)(g[2] + (g[0] * shear[0] + g[1] * shear[1]));
    for (int a = 0; a < 3; a++) out->gradient[a] = (float)g[a];
}

/* Computes the contour lines' field at the hit at depth t in each lane's tet: out->value holds the field at the tet's
 * last corner, and the field's change from there to the hit is added. last: the corner's position in tile space; along:
 * the field's change per unit of depth along the tile's middle ray. */
SIMD_INLINE void kernel_line_field_add_change_to_hit(kernel_line_field *out, const kernel_rays *rays, vf t,
                                                     const vf last[3], vf along)
{
    const vf x = (rays->origin_x + rays->slope_x * t) - last[0], y = (rays->origin_y + rays->slope_y * t) - last[1];
    out->value = (out->value + x * out->gradient[0]) + (y * out->gradient[1] + (t - last[2]) * along);
}

/* Computes the contour lines' field, its gradient and the surface's normal at the reference coordinates r, each lane in
 * its own cell. `line` is the polynomial of the contour lines' field. */
SIMD_INLINE void kernel_map_line_field(const kernel_tile *tile, const kernel_map *map, const vf line[8], const vf r[3],
                                       kernel_line_field *out)
{
    const kernel_product m = kernel_compute_coordinate_product(map->is_pyramid, r);
    vf cross[3][3], n[3], g[3];
    const vf det = kernel_jacobian(map->position, map->is_pyramid, &m, r, cross);
    kernel_polynomial_gradient(map->field, map->is_pyramid, &m, r, n);
    kernel_polynomial_gradient(line, map->is_pyramid, &m, r, g);
    for (int a = 0; a < 3; a++) {
        out->normal[a] = kernel_dot(cross[a], n);
        out->gradient[a] = kernel_dot(cross[a], g) / det;
    }
    out->normal[2] -= out->normal[0] * tile->shear_x + out->normal[1] * tile->shear_y;
    out->gradient[2] -= out->gradient[0] * tile->shear_x + out->gradient[1] * tile->shear_y;
    out->value = kernel_polynomial_value(line, map->is_pyramid, &m, r);
}

/* Computes the contour lines' field, its gradient and the surface's normal at the hits of a packet in one hex, wedge or
 * pyramid. */
static __attribute__((noinline)) void kernel_curved_line_field(const kernel_packet *p, const kernel_surface *s,
                                                               const kernel_cell *c, const kernel_map *map,
                                                               const vf r[3], kernel_line_field *out)
{
    const grid_field *field = &s->layer->lines->field.fields[c->part];
    double value[GRID_MAX_CELL_VERTICES], fit[8];
    vf line[8];
    for (int i = 0; i < c->count; i++)
        value[i] = (double)(float)kernel_lines_read_vertex_value(s, field, c->vertices[i]);
    kernel_polynomial_fit(fit, c->type, value);
    for (int i = 0; i < 8; i++) line[i] = vf_set((float)fit[i]);
    kernel_map_line_field(p->tile, map, line, r, out);
}

/* Finds the contour line that is nearest to each hit, stores its index among the layer's lines in *line, and returns
 * the share of the hit's pixel that this line covers. The share is 0 if the field is constant along the surface or NaN
 * there. */
static __attribute__((noinline)) vf kernel_lines_coverage(const kernel_frame *f, const kernel_tile *tile,
                                                          const kernel_surface *s, const kernel_rays *rays, vf t,
                                                          const kernel_line_field *at, vi *line)
{
    const kernel_lines *l = &s->lines;
    const vf zero = vf_set(0), one = vf_set(1), *g = at->gradient, *n = at->normal;
    const bool flat = f->job->camera.is_orthographic;
    const vf depth = flat ? vf_set((float)f->job->space.scale) : (vf)(t + (float)f->depth_shift);
    const vf pixel = depth * (float)f->slope_dx;
    const vf dx = rays->slope_x + tile->shear_x, dy = rays->slope_y + tile->shear_y;
    const vf turn = ((g[0] * dx + g[1] * dy) + g[2]), tilt = ((n[0] * dx + n[1] * dy) + n[2]);
    const vf change[3] = {(g[0] - n[0] / tilt * turn) * pixel, (g[1] - n[1] / tilt * turn) * pixel, zero};
    vi nearest = vi_set(0);
    vf distance = vf_set(INFINITY), gap = distance;
    vm still;
    const vf inverse = kernel_inverse_length(change, &still);
    for (int i = 0; i < l->count; i++) {
        const vf away = vf_abs(at->value - l->level[i]);
        const vm nearer = vf_lt(away, distance);
        distance = vf_select(nearer, away, distance);
        gap = vf_select(nearer, vf_set(l->gap[i]), gap);
        nearest = vi_select(nearer, vi_set(i), nearest);
    }
    const float width = s->layer->lines->width, most = width < 1 ? width : 1;
    const vf covered = vf_min(0.5f * (width + 1) - distance * inverse, vf_set(most));
    const vf fade = vf_clamp(gap * inverse / width - 1.0f, zero, one);
    *line = nearest;
    return vf_select(vm_andnot(vf_lt(zero, covered), still), covered * fade, zero);
}

/* Draws contour lines over the colours, before lighting, of hits at depth t. Returns the share of each hit's pixel that
 * a line covers. */
SIMD_INLINE vf kernel_draw_lines(const kernel_frame *f, const kernel_tile *tile, const kernel_surface *s,
                                 const kernel_rays *rays, vf t, const kernel_line_field *at, vf colour[3])
{
    const float *colours = s->layer->lines->colours;
    vi line;
    const vf share = kernel_lines_coverage(f, tile, s, rays, t, at, &line);
    for (int a = 0; a < 3 && colours; a++) {
        const vf own = vf_gather(colours + a, line * 3);
        colour[a] = s->layer->lines->is_alone ? own : (vf)(colour[a] + share * (own - colour[a]));
    }
    return share;
}

#endif
