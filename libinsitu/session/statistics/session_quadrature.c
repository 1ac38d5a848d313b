/* The rules of triangles and tets are products of rules on lines, by Duffy's map from a square or cube to a simplex:
 *
 *     a = s (1 - t) (1 - u),   b = t (1 - u),   c = u,   da db dc = (1 - t) (1 - u)^2 ds dt du
 *
 * The factors (1 - t) and (1 - u)^2 are weight functions of Gauss-Jacobi rules, so that no degree is lost: the rules of
 * n points along s, t and u are exact for the degree 2 n - 1 (Karniadakis and Sherwin, 2005). */
#include "session_quadrature.h"

#include <math.h>

#include "memory.h"

/* Computes Jacobi's polynomial of order n > 0 with the weight function (1 - x)^alpha, and its derivative. */
static double evaluate_jacobi_polynomial(int n, int alpha, double x, double *slope)
{
    double last = 1, value = 0.5 * (alpha + (alpha + 2) * x);
    for (int k = 1; k < n; k++) {
        const double s = 2 * k + alpha, a = 2 * (k + 1) * (k + alpha + 1) * s;
        const double b = (s + 1) * (s * (s + 2) * x + alpha * alpha), c = 2 * (k + alpha) * k * (s + 2);
        const double next = (b * value - c * last) / a;
        last = value;
        value = next;
    }
    const double s = 2 * n + alpha;
    *slope = (n * (alpha - s * x) * value + 2 * n * (n + alpha) * last) / (s * (1 - x * x));
    return value;
}

/* Finds the Gauss-Jacobi rule on the line from 0 to 1 with the weight function (1 - x)^alpha. The points are found by
 * Newton's method. The polynomial is divided by the factors of roots found before, so that no root is found twice. */
static void compute_gauss_jacobi_rule(int count, int alpha, double *points, double *weights)
{
    double roots[QUADRATURE_MOST_POINTS], slope = 1;
    for (int i = 0; i < count; i++) {
        double x = -cos(acos(-1) * (2 * i + 1) / (2 * count));
        if (i > 0) x = 0.5 * (x + roots[i - 1]);
        for (int turn = 0; turn < 50; turn++) {
            const double value = evaluate_jacobi_polynomial(count, alpha, x, &slope);
            double sum = 0;
            for (int k = 0; k < i; k++) sum += 1 / (x - roots[k]);
            const double step = value / (slope - sum * value);
            x -= step;
            if (fabs(step) < 1e-17) break;
        }
        evaluate_jacobi_polynomial(count, alpha, x, &slope);
        roots[i] = x;
        points[i] = 0.5 + 0.5 * x;
        weights[i] = 1 / ((1 - x * x) * slope * slope);
    }
}

bool session_make_quadrature(int dimensions, int per_axis, session_quadrature *out)
{
    double x[3][QUADRATURE_MOST_POINTS] = {{0}}, w[3][QUADRATURE_MOST_POINTS] = {{1}, {1}, {1}};
    int counts[3] = {1, 1, 1};
    *out = (session_quadrature){.dimensions = dimensions, .count = 1};
    for (int axis = 0; axis < dimensions; axis++) {
        compute_gauss_jacobi_rule(per_axis, axis, x[axis], w[axis]);
        counts[axis] = per_axis;
        out->count *= per_axis;
    }
    out->points = base_alloc((size_t)out->count * sizeof *out->points);
    out->weights = base_alloc((size_t)out->count * sizeof *out->weights);
    if (!out->points || !out->weights) return false;
    for (int n = 0; n < out->count; n++) {
        const int s = n % counts[0], t = n / counts[0] % counts[1], u = n / counts[0] / counts[1];
        out->points[n][0] = x[0][s] * (1 - x[1][t]) * (1 - x[2][u]);
        out->points[n][1] = x[1][t] * (1 - x[2][u]);
        out->points[n][2] = x[2][u];
        out->weights[n] = w[0][s] * w[1][t] * w[2][u];
    }
    return true;
}

void session_drop_quadrature(session_quadrature *quadrature)
{
    base_free(quadrature->points);
    base_free(quadrature->weights);
    *quadrature = (session_quadrature){0};
}
