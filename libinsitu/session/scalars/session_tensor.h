/* Computes scalars from the gradient of a vector field at a point. Row c of the matrix is the gradient of component
 * c. */
#ifndef SESSION_TENSOR_H
#define SESSION_TENSOR_H

double session_divergence(const double gradient[3][3]);
void session_curl(const double gradient[3][3], double out[3]);
/* Returns the Q criterion: half of the difference between the squares of the rotation rate and the strain rate (Hunt,
 * Wray and Moin 1988). */
double session_q_criterion(const double gradient[3][3]);
/* Returns lambda 2: the middle eigenvalue of the sum of the squares of the gradient's symmetric and antisymmetric parts
 * (Jeong and Hussain 1995). */
double session_lambda2(const double gradient[3][3]);
/* Returns the strain rate sqrt(2 S:S), where S is the symmetric part of the gradient. */
double session_strain_rate(const double gradient[3][3]);

#endif
