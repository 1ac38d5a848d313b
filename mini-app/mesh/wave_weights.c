/* Let f_i be the values and r_i the centroids of the n cells around a vertex. The least squares fit is value(x) = mean
 * + g.(x - m), where mean is the mean of the f_i, m is the mean of the r_i, and g = M^-1 sum (r_i - m) f_i with M = sum
 * (r_i - m)(r_i - m)^T. The weight of cell i at the vertex v is therefore 1/n + (v - m).M^-1 (r_i - m). M is singular
 * if the centroids do not span space. To regularize it, 1e-9 of its trace is added to its diagonal, which makes the
 * slope zero in the undetermined directions. */
#include "wave_weights.h"

static void solve_symmetric(const double m[3][3], const double b[3], double x[3])
{
    double inverse[3][3];
    for (int i = 0; i < 3; ++i) {
        int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
        for (int j = 0; j < 3; ++j) {
            int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            inverse[j][i] = m[i1][j1] * m[i2][j2] - m[i1][j2] * m[i2][j1];
        }
    }
    double determinant = m[0][0] * inverse[0][0] + m[0][1] * inverse[1][0] + m[0][2] * inverse[2][0];
    for (int i = 0; i < 3; ++i) {
        x[i] = (inverse[i][0] * b[0] + inverse[i][1] * b[1] + inverse[i][2] * b[2]) / determinant;
    }
}

void wave_weights_fit(const double vertex[3], unsigned walls, int count, const int32_t *cells,
                      const double (*centroid)[3], double *weight)
{
    double mean[3] = {0, 0, 0}, m[3][3] = {{0}}, offset[3], slope[3], r[3], trace = 0;
    for (int i = 0; i < count; ++i) {
        for (int a = 0; a < 3; ++a) mean[a] += centroid[cells[i]][a] / count;
    }
    for (int i = 0; i < count; ++i) {
        for (int a = 0; a < 3; ++a) r[a] = (walls >> a & 1) ? 0 : centroid[cells[i]][a] - mean[a];
        for (int a = 0; a < 3; ++a) {
            for (int b = 0; b < 3; ++b) m[a][b] += r[a] * r[b];
            trace += r[a] * r[a];
        }
    }
    for (int i = 0; i < count; ++i) weight[i] = 1.0 / count;
    if (trace == 0) return;
    for (int a = 0; a < 3; ++a) {
        m[a][a] += 1e-9 * trace;
        offset[a] = (walls >> a & 1) ? 0 : vertex[a] - mean[a];
    }
    solve_symmetric((const double(*)[3])m, offset, slope);
    for (int i = 0; i < count; ++i) {
        for (int a = 0; a < 3; ++a) weight[i] += slope[a] * (centroid[cells[i]][a] - mean[a]);
    }
}
