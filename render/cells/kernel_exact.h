/* A cell's map and field in double, from the coordinates and values as they were handed over, a point at a time: what
 * kernel_map.h is in float32. */
#ifndef RENDER_KERNEL_EXACT_H
#define RENDER_KERNEL_EXACT_H

#include <math.h>

#include "grid.h"
#include "kernel_cell.h"
#include "kernel_double.h"
#include "kernel_map.h"
#include "kernel_packet.h"
#include "kernel_types.h"

enum { KERNEL_EXACT_STEPS = 24 };

typedef struct kernel_exact_map {
    bool is_pyramid;
    double position[3][8], field[8];
} kernel_exact_map;

static void kernel_exact_setup(kernel_exact_map *m, const kernel_packet *p, const kernel_cell *c,
                               const kernel_transfer *transfer)
{
    double d[4][GRID_MAX_CELL_VERTICES];
    for (int i = 0; i < c->count; i++) {
        const kernel_double_spot spot = kernel_double_place(p->frame, p->tile, c->world[i]);
        d[0][i] = spot.x;
        d[1][i] = spot.y;
        d[2][i] = spot.t;
        d[3][i] = kernel_double_domain(transfer, c->values[i]);
    }
    m->is_pyramid = c->type == GRID_PYRAMID;
    for (int a = 0; a < 3; a++) kernel_polynomial_fit(m->position[a], c->type, d[a]);
    kernel_polynomial_fit(m->field, c->type, d[3]);
}

/* m of kernel_map.h, and its derivatives. */
static inline double kernel_exact_product(bool is_pyramid, const double r[3], double slopes[3])
{
    slopes[0] = r[1];
    slopes[1] = r[0];
    slopes[2] = 0;
    if (!is_pyramid) return r[0] * r[1];
    const double inverse = 1 / fmax(r[2], 1e-9);
    slopes[0] = fmax(fmin(r[1] * inverse, 2), -1);
    slopes[1] = fmax(fmin(r[0] * inverse, 2), -1);
    slopes[2] = -slopes[0] * slopes[1];
    return slopes[1] * r[1];
}

static inline double kernel_exact_value(const double c[8], const double r[3], double m)
{
    return ((c[0] + r[0] * c[1]) + (r[1] * c[2] + r[2] * c[3])) + m * c[4] +
           r[2] * ((r[0] * c[5] + r[1] * c[6]) + m * c[7]);
}

static inline void kernel_exact_gradient(const double c[8], const double r[3], double m, const double slopes[3],
                                         double out[3])
{
    const double of_m = c[4] + r[2] * c[7];
    out[0] = c[1] + r[2] * c[5] + slopes[0] * of_m;
    out[1] = c[2] + r[2] * c[6] + slopes[1] * of_m;
    out[2] = c[3] + (r[0] * c[5] + r[1] * c[6]) + m * c[7] + slopes[2] * of_m;
}

/* kernel_map_newton(), to the end: where a step is below 1e-8, the next would be below rounding. */
static bool kernel_exact_newton(const kernel_exact_map *map, const double target[3], double r[3])
{
    for (int n = 0; n < KERNEL_EXACT_STEPS; n++) {
        double slopes[3], row[3][3], off[3], cross[3][3], largest = 0;
        const double m = kernel_exact_product(map->is_pyramid, r, slopes);
        for (int a = 0; a < 3; a++) {
            off[a] = target[a] - kernel_exact_value(map->position[a], r, m);
            kernel_exact_gradient(map->position[a], r, m, slopes, row[a]);
        }
        for (int a = 0; a < 3; a++) {
            const double *x = row[(a + 1) % 3], *y = row[(a + 2) % 3];
            for (int b = 0; b < 3; b++) cross[a][b] = x[(b + 1) % 3] * y[(b + 2) % 3] - x[(b + 2) % 3] * y[(b + 1) % 3];
        }
        const double det = row[0][0] * cross[0][0] + row[0][1] * cross[0][1] + row[0][2] * cross[0][2];
        if (det == 0) return false;
        for (int b = 0; b < 3; b++) {
            const double move = (cross[0][b] * off[0] + cross[1][b] * off[1] + cross[2][b] * off[2]) / det;
            largest = fmax(largest, fabs(move));
            r[b] = fmax(fmin(r[b] + fmax(fmin(move, 1), -1), 2), -1);
        }
        if (largest <= 1e-8) return true;
    }
    return false;
}

static inline bool kernel_exact_is_near(const double r[3])
{
    bool near = true;
    for (int a = 0; a < 3; a++)
        near = near && -r[a] <= (double)KERNEL_MAP_BEYOND && r[a] - 1 <= (double)KERNEL_MAP_BEYOND;
    return near;
}

#endif
