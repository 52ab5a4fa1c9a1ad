/* A shared library as CasADi would make it: `f` is complete, `bare` has an address and nothing else. */
#include <stddef.h>

typedef long long integer;

integer f_n_in(void) { return 2; }
integer f_n_out(void) { return 1; }
const char *f_name_in(integer i) { return i == 0 ? "x" : "u"; }

const integer *f_sparsity_in(integer i)
{
    static const integer x[] = {2, 1, 0, 2, 0, 1}, u[] = {1, 1, 0, 1, 0};
    return i == 0 ? x : u;
}

const integer *f_sparsity_out(integer i)
{
    static const integer out[] = {3, 1, 0, 3, 0, 1, 2};
    return i == 0 ? out : NULL;
}

int f_work(integer *arguments, integer *results, integer *integers, integer *numbers)
{
    *arguments = 2, *results = 1, *integers = 0, *numbers = 0;
    return 0;
}

int f(const double **arg, double **res, integer *iw, double *w, int mem)
{
    double x0 = arg[0] ? arg[0][0] : 0.0, x1 = arg[0] ? arg[0][1] : 0.0, u = arg[1] ? arg[1][0] : 0.0;
    (void)iw, (void)w, (void)mem;
    if (res[0])
        res[0][0] = x0 + u, res[0][1] = x0 * x1, res[0][2] = x1 - u * u;
    return 0;
}

int bare(const double **arg, double **res, integer *iw, double *w, int mem) { return f(arg, res, iw, w, mem); }
