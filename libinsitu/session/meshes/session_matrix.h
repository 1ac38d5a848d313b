/* Small dense matrices, stored row by row. */
#ifndef SESSION_MATRIX_H
#define SESSION_MATRIX_H

/* Inverts a matrix of count x count by elimination with pivots. The matrix is overwritten; `inverse` must contain the
 * unit matrix and receives the result. */
void session_invert_matrix(int count, double *matrix, double *inverse);

/* Multiplies a matrix of rows x columns by each of `outer` matrices of columns x inner, which are stored one after
 * another in `in`. `out` receives the `outer` products, each of rows x inner. */
void session_multiply_matrix(const double *matrix, int rows, int columns, int outer, int inner, const double *in,
                             double *out);

#endif
