/* Numbers computed from the gradient of a vector field at a point: row c is the gradient of component c. */
#ifndef SESSION_TENSOR_H
#define SESSION_TENSOR_H

double session_divergence(const double gradient[3][3]);
void session_curl(const double gradient[3][3], double out[3]);
/* Returns half of the square of the rotation rate less that of the strain rate (Hunt, Wray and Moin 1988). */
double session_q_criterion(const double gradient[3][3]);
/* Returns the middle eigenvalue of the sum of the squares of the symmetric and the antisymmetric part (Jeong and
 * Hussain 1995). */
double session_lambda2(const double gradient[3][3]);
/* Returns sqrt(2 S:S), S being the symmetric part. */
double session_strain_rate(const double gradient[3][3]);

#endif
