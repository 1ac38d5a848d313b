#include "session_matrix.h"

#include <math.h>

void session_invert_matrix(int count, double *matrix, double *inverse)
{
    for (int c = 0; c < count; c++) {
        int pivot = c;
        for (int r = c + 1; r < count; r++)
            if (fabs(matrix[r * count + c]) > fabs(matrix[pivot * count + c])) pivot = r;
        for (int s = 0; s < count; s++) {
            const double a = matrix[c * count + s], b = inverse[c * count + s];
            matrix[c * count + s] = matrix[pivot * count + s];
            inverse[c * count + s] = inverse[pivot * count + s];
            matrix[pivot * count + s] = a;
            inverse[pivot * count + s] = b;
        }
        const double scale = 1 / matrix[c * count + c];
        for (int s = 0; s < count; s++) {
            matrix[c * count + s] *= scale;
            inverse[c * count + s] *= scale;
        }
        for (int r = 0; r < count; r++) {
            const double factor = matrix[r * count + c];
            for (int s = 0; s < count && r != c && factor != 0; s++) {
                matrix[r * count + s] -= factor * matrix[c * count + s];
                inverse[r * count + s] -= factor * inverse[c * count + s];
            }
        }
    }
}

void session_multiply_matrix(const double *matrix, int rows, int columns, int outer, int inner, const double *in,
                             double *out)
{
    for (int o = 0; o < outer; o++, in += columns * inner)
        for (int r = 0; r < rows; r++, out += inner) {
            for (int s = 0; s < inner; s++) out[s] = 0;
            for (int c = 0; c < columns; c++)
                for (int s = 0; s < inner; s++) out[s] += matrix[r * columns + c] * in[c * inner + s];
        }
}
