/* A collection of three programs, written down in C; the last part of a path is the name of one. Each has two variables, which
 * are a pair, and one linear row:
 *
 *   min (x0 - a)^2 + (x1 - b)^2   s.t.  x0 + x1 >= r,  0 <= x0 _|_ x1 >= 0
 *
 * `near`: r = 0; `far`: the row keeps the target away; `none`: both members are bounded away from zero. */
#include "mpcc_problem.h"

#include <math.h>
#include <string.h>

typedef struct {
    double a, b;
} target;

static int f(const double *x, const double *y, double *out, void *user)
{
    const target *t = (const target *)user;
    (void)y;
    out[0] = (x[0] - t->a) * (x[0] - t->a) + (x[1] - t->b) * (x[1] - t->b);
    return !isfinite(out[0]);
}
static int grad(const double *x, const double *y, double *out, void *user)
{
    const target *t = (const target *)user;
    (void)y;
    out[0] = 2.0 * (x[0] - t->a);
    out[1] = 2.0 * (x[1] - t->b);
    return 0;
}
static int con(const double *x, const double *y, double *out, void *user)
{
    (void)y;
    (void)user;
    out[0] = x[0] + x[1];
    out[1] = x[0];
    out[2] = x[1];
    return 0;
}
static int jac(const double *x, const double *y, double *out, void *user)
{
    (void)x;
    (void)y;
    (void)user;
    out[0] = out[1] = out[2] = out[3] = 1.0;
    return 0;
}
static int hess(const double *x, const double *y, double *out, void *user)
{
    (void)x;
    (void)user;
    out[0] = out[1] = 2.0 * y[0];
    return 0;
}

static const int32_t jac_colptr[] = {0, 2, 4}, jac_row[] = {0, 1, 0, 2}, jac_col[] = {0, 0, 1, 1};
static const int32_t hess_colptr[] = {0, 1, 2}, diagonal[] = {0, 1}, first[] = {0}, second[] = {1};
static const double start[] = {0.3, 0.6}, zero[] = {0.0, 0.0}, one[] = {1.0, 1.0}, far_away[] = {10.0, 10.0};
static const double nothing[] = {0.0}, two[] = {2.0}, unbounded[] = {INFINITY};
static target near_target = {1.0, 0.25}, far_target = {1.0, 0.25}, none_target = {1.0, 1.0};

#define PROBLEM(name, target, lbx, lbg)                                                                              \
    {                                                                                                                \
        MPCC_ABI, 2, 1, 1, 4, 2, name, start, lbx, far_away, lbg, unbounded, jac_colptr, jac_row, jac_col, hess_colptr, \
            diagonal, diagonal, first, second, f, grad, con, jac, hess, target                                      \
    }

static const mpcc_problem problems[] = {
    PROBLEM("near", &near_target, zero, nothing), /* x = (1, 0), f = 1/16; locally (0, 1/4), f = 1 */
    PROBLEM("far", &far_target, zero, two),       /* x = (2, 0), f = 1 + 1/16; locally (0, 2), f = 1 + 49/16 */
    PROBLEM("none", &none_target, one, two),      /* both members at least 1 */
};

const mpcc_problem *mpcc_open(const char *path)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    size_t i;
    for (i = 0; i < sizeof problems / sizeof *problems; i++)
        if (!strcmp(problems[i].name, name))
            return &problems[i];
    return NULL;
}

void mpcc_close(const mpcc_problem *p) { (void)p; }
