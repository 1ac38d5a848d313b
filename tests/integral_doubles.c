/* Compiles the kernels' integral a second time, for double and with as many Gauss nodes as double can resolve. Its
 * error is then the error of the method, not of the arithmetic. Vectors of two doubles replace simd.h. */
#define KERNEL_REAL_IS_DOUBLE
#define BASE_SIMD_H
#define render_pieces_build pieces_build_of_doubles
#define render_variations_build swings_build_of_doubles
#define render_pieces_free pieces_free_of_doubles

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "integral_double.h"

enum { SIMD_WIDTH = 2 };
#define SIMD_INLINE static inline __attribute__((always_inline, unused))
typedef double vf __attribute__((vector_size(16)));
typedef int64_t vi __attribute__((vector_size(16)));
typedef vi vm;

SIMD_INLINE vf vf_set(double x)
{
    return (vf){x, x};
}
SIMD_INLINE vm vf_lt(vf a, vf b)
{
    return (vm)(a < b);
}
SIMD_INLINE vm vf_le(vf a, vf b)
{
    return (vm)(a <= b);
}
SIMD_INLINE vm vf_eq(vf a, vf b)
{
    return (vm)(a == b);
}
SIMD_INLINE vm vm_and(vm a, vm b)
{
    return a & b;
}
SIMD_INLINE vm vm_or(vm a, vm b)
{
    return a | b;
}
SIMD_INLINE vm vm_none(void)
{
    return (vm){0, 0};
}
SIMD_INLINE vm vm_andnot(vm a, vm b)
{
    return a & ~b;
}
SIMD_INLINE unsigned vm_bits(vm m)
{
    return (m[0] ? 1u : 0u) | (m[1] ? 2u : 0u);
}
SIMD_INLINE int vm_any(vm m)
{
    return vm_bits(m) != 0;
}
SIMD_INLINE vf vf_select(vm m, vf a, vf b)
{
    return (vf)(((vi)a & m) | ((vi)b & ~m));
}
SIMD_INLINE vf vf_min(vf a, vf b)
{
    return vf_select(vf_lt(a, b), a, b);
}
SIMD_INLINE vf vf_max(vf a, vf b)
{
    return vf_select(vf_lt(b, a), a, b);
}
SIMD_INLINE vf vf_clamp(vf a, vf low, vf high)
{
    return vf_min(vf_max(a, low), high);
}
SIMD_INLINE vf vf_abs(vf a)
{
    return (vf){fabs(a[0]), fabs(a[1])};
}
SIMD_INLINE vf vf_sqrt(vf a)
{
    return (vf){sqrt(a[0]), sqrt(a[1])};
}
SIMD_INLINE vi vi_from_vf(vf a)
{
    return (vi){(int64_t)a[0], (int64_t)a[1]};
}
SIMD_INLINE vf vf_gather(const double *base, vi index)
{
    return (vf){base[index[0]], base[index[1]]};
}
SIMD_INLINE vf kernel_exp(vf a)
{
    return (vf){exp(a[0]), exp(a[1])};
}
SIMD_INLINE double compute_extinction(double a, double clear)
{
    return a < 0.5 ? -log1p(-a) : -log(clear);
}
SIMD_INLINE vf kernel_extinction(vf a, vf clear)
{
    return (vf){compute_extinction(a[0], clear[0]), compute_extinction(a[1], clear[1])};
}

enum { KERNEL_NODES = 9 };
static struct {
    double node[KERNEL_NODES], weight[KERNEL_NODES], partial[KERNEL_NODES][KERNEL_NODES];
} kernel_gauss;

#include "kernel_integral.h"
#include "kernel_types.h"
#include "render_pieces.c"

/* Computes the Legendre polynomial of degree KERNEL_NODES and its derivative. */
static double evaluate_legendre(double x, double *derivative)
{
    double last = 1, p = x;
    for (int n = 2; n <= KERNEL_NODES; n++) {
        const double next = ((2 * n - 1) * x * p - (n - 1) * last) / n;
        last = p;
        p = next;
    }
    *derivative = KERNEL_NODES * (x * p - last) / (x * x - 1);
    return p;
}

static double evaluate_lagrange(int k, double x)
{
    double product = 1;
    for (int i = 0; i < KERNEL_NODES; i++)
        if (i != k) product *= (x - kernel_gauss.node[i]) / (kernel_gauss.node[k] - kernel_gauss.node[i]);
    return product;
}

/* Computes the Gauss nodes on [0, 1], their weights, and the integrals of the Lagrange polynomials up to each node. */
static void prepare_gauss(void)
{
    for (int i = 0; i < KERNEL_NODES; i++) {
        double slope, x = -cos(acos(-1) * (i + 0.75) / (KERNEL_NODES + 0.5));
        for (int step = 0; step < 50; step++) {
            const double p = evaluate_legendre(x, &slope);
            x -= p / slope;
        }
        evaluate_legendre(x, &slope);
        kernel_gauss.node[i] = 0.5 + 0.5 * x;
        kernel_gauss.weight[i] = 1 / ((1 - x * x) * slope * slope);
    }
    for (int j = 0; j < KERNEL_NODES; j++)
        for (int k = 0; k < KERNEL_NODES; k++) {
            kernel_gauss.partial[j][k] = 0;
            for (int i = 0; i < KERNEL_NODES; i++)
                kernel_gauss.partial[j][k] += kernel_gauss.node[j] * kernel_gauss.weight[i] *
                                              evaluate_lagrange(k, kernel_gauss.node[j] * kernel_gauss.node[i]);
        }
}

void integrate_in_double(const render_transfer *t, double length, double v_in, double v_out, double out[4])
{
    kernel_pieces pieces;
    base_error error = {0};
    prepare_gauss();
    if (render_pieces_build(&pieces, t, 0, &error) != INSITU_OK) abort();
    kernel_light light = kernel_light_none();
    const kernel_unit_segment run = kernel_unit_segment_of(vf_set(length), vf_set(v_in), vf_set(v_out));
    kernel_integrate_segments(&pieces, (vm){-1, -1}, &run, &light);
    for (int c = 0; c < 3; c++) out[c] = light.colour[c][0];
    out[3] = light.transmittance[0];
    render_pieces_free(&pieces);
}
