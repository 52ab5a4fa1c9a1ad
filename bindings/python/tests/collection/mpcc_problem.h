/* The interface of a collection of programs with complementarity pairs, as the benchmarks read it:
 *
 *   min f(x)   s.t.  lbx <= x <= ubx,  lbg <= g(x) <= ubg,  0 <= G(x) _|_ H(x) >= 0
 *
 * Every function is int fn(x[n], y, out, user); it fills `out` and returns 0, or 1 where a number is not finite.
 *   f    [1]         grad [n], dense        con [m + 2 c], [g; G; H]
 *   jac  [jac_nnz]   of con, CSC order      hess [hess_nnz], upper triangle of y[0] f + y[1..]' con, CSC order
 * G_var[i] = j >= 0 where G_i is the variable x_j, else -1; its row is part of con all the same. */
#ifndef MPCC_PROBLEM_H
#define MPCC_PROBLEM_H
#include <stdint.h>
#define MPCC_ABI 1
typedef int (*mpcc_fn)(const double *x, const double *y, double *out, void *user);

typedef struct mpcc_problem {
    int32_t abi, n, m, c;
    int32_t jac_nnz, hess_nnz;
    const char *name;
    const double *x0, *lbx, *ubx, *lbg, *ubg;
    const int32_t *jac_colptr, *jac_row, *jac_col;
    const int32_t *hess_colptr, *hess_row, *hess_col;
    const int32_t *G_var, *H_var; /* [c] */
    mpcc_fn f, grad, con, jac, hess;
    void *user; /* for every function */
} mpcc_problem;

const mpcc_problem *mpcc_open(const char *path); /* NULL where there is no such problem */
void mpcc_close(const mpcc_problem *p);
#endif
