#include "session_tensor.h"

#include <math.h>

double session_divergence(const double g[3][3])
{
    return (g[0][0] + g[1][1]) + g[2][2];
}

void session_curl(const double g[3][3], double out[3])
{
    out[0] = g[2][1] - g[1][2];
    out[1] = g[0][2] - g[2][0];
    out[2] = g[1][0] - g[0][1];
}

/* Returns the Q criterion. The square of the rotation rate minus the square of the strain rate equals minus the trace
 * of the gradient's square. Therefore it suffices to sum products of the gradient's entries. */
double session_q_criterion(const double g[3][3])
{
    const double squares = (g[0][0] * g[0][0] + g[1][1] * g[1][1]) + g[2][2] * g[2][2];
    return -0.5 * squares - ((g[0][1] * g[1][0] + g[0][2] * g[2][0]) + g[1][2] * g[2][1]);
}

double session_strain_rate(const double g[3][3])
{
    const double xy = g[0][1] + g[1][0], xz = g[0][2] + g[2][0], yz = g[1][2] + g[2][1];
    const double squares = (g[0][0] * g[0][0] + g[1][1] * g[1][1]) + g[2][2] * g[2][2];
    return sqrt(2 * squares + ((xy * xy + xz * xz) + yz * yz));
}

/* Returns the middle eigenvalue of a symmetric matrix with the entries xx, yy, zz, xy, xz, yz. It is computed from the
 * characteristic polynomial (Smith 1961). */
static double compute_middle_eigenvalue(const double m[6])
{
    const double mean = ((m[0] + m[1]) + m[2]) / 3, x = m[0] - mean, y = m[1] - mean, z = m[2] - mean;
    const double off = (m[3] * m[3] + m[4] * m[4]) + m[5] * m[5];
    const double size = sqrt((((x * x + y * y) + z * z) + 2 * off) / 6);
    if (!(size > 0)) return mean;
    const double a = x / size, b = y / size, c = z / size, d = m[3] / size, e = m[4] / size, f = m[5] / size;
    const double half = 0.5 * ((a * (b * c - f * f) - d * (d * c - f * e)) + e * (d * f - b * e));
    const double third = 2 * acos(-1.0) / 3;
    /* the angle for the largest eigenvalue, between 0 and 60 degrees */
    const double angle = acos(fmin(fmax(half, -1), 1)) / 3;
    return mean + 2 * size * cos(angle - third);
}

double session_lambda2(const double g[3][3])
{
    /* S² + W², where S and W are the symmetric and the antisymmetric part of G, is half of the sum of G² and its
     * transpose. */
    double square[3][3], m[6];
    static const int entries[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) square[i][k] = (g[i][0] * g[0][k] + g[i][1] * g[1][k]) + g[i][2] * g[2][k];
    for (int i = 0; i < 6; i++)
        m[i] = 0.5 * (square[entries[i][0]][entries[i][1]] + square[entries[i][1]][entries[i][0]]);
    return compute_middle_eigenvalue(m);
}
