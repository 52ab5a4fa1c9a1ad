#include "casadi.h"

#include <string.h>

/* CasADi's own type. */
typedef long long integer;

static unsigned lies;
static struct random luck;

void casadi_lies(unsigned which, uint64_t seed)
{
    lies = which;
    luck = random_stream(seed, which);
}

/* 0 to n - 1 where this lie is told, else n */
static int64_t lie(unsigned which, int64_t n)
{
    return lies & which ? random_below(&luck, n) : n;
}

static integer value_n_in(void)
{
    static const integer other[] = {0, -1, 1, 3, 1 << 20, INT64_MAX};
    int64_t k = lie(LIE_N_IN, 6);
    return k < 6 ? other[k] : 2;
}

static integer value_n_out(void)
{
    static const integer other[] = {0, -1, 2, 1 << 20, INT64_MIN};
    int64_t k = lie(LIE_N_OUT, 5);
    return k < 5 ? other[k] : 1;
}

static const char *value_name_in(integer i)
{
    static const char *const other[] = {NULL, "", "y", "\xff", "x x", "p"};
    int64_t k = lie(LIE_NAMES, 6);
    return k < 6 ? other[k] : i == 0 ? "x" : i == 1 ? "u" : i == 2 ? "out_f" : NULL;
}

/* A pattern of n_rows and n_columns <= 3, dense, written out or abbreviated. */
static const integer *pattern(integer n_rows, integer n_columns)
{
    static integer made[4][2 + 4 + 16];
    static int next;
    integer *p = made[next++ % 4], *start = p + 2, *rows = start + n_columns + 1;
    static const integer sizes[] = {-1, 0, INT64_MIN, INT64_C(1) << 40, INT64_MAX};
    static const integer bad[] = {-1, 3, 1 << 20, INT64_MIN, INT64_MAX};
    p[0] = n_rows;
    p[1] = n_columns;
    for (integer c = 0; c <= n_columns; c++)
        start[c] = c * n_rows;
    for (integer k = 0; k < n_rows * n_columns; k++)
        rows[k] = k % n_rows;
    int64_t k = lie(LIE_SIZE, 5);
    if (k < 5)
        p[0] = sizes[k]; /* the number of columns is the length of the array: no reader can see that it is wrong */
    if ((k = lie(LIE_ROWS, 5)) < 5)
        rows[random_below(&luck, n_rows * n_columns)] = bad[k];
    if ((k = lie(LIE_COLUMNS, 3)) < 3)
        start[random_below(&luck, n_columns + 1)] = k == 0 ? -1 : k == 1 ? 2 : 3;
    return lie(LIE_NULL_PATTERN, 2) < 2 ? NULL : p;
}

static const integer *value_sparsity_in(integer i)
{
    return i == 0 ? pattern(2, 1) : i == 1 ? pattern(1, 1) : i == 2 ? pattern(3, 1) : NULL;
}

static const integer *value_sparsity_out(integer i)
{
    return i == 0 ? pattern(3, 1) : NULL;
}

static const integer *jacobian_sparsity_out(integer i)
{
    return i == 0 ? pattern(3, 3) : NULL;
}

static int work(integer *arguments, integer *results, integer *integers, integer *numbers)
{
    static const integer other[] = {-1, INT64_MIN, INT64_MAX, 0, INT64_C(1) << 50};
    int64_t k = lie(LIE_WORK, 5);
    *arguments = 2, *results = 1, *integers = 0, *numbers = 0;
    if (k < 5)
        *(random_once_in(&luck, 2) ? numbers : arguments) = other[k];
    return lie(LIE_WORK, 8) == 0 ? 1 : 0;
}

static int finish(double *out, int n)
{
    if (lie(LIE_NAN, 3) < 2)
        for (int i = 0; i < n; i++)
            out[i] = NAN;
    return lie(LIE_CODE, 3) < 2 ? 1 : 0;
}

static int value(const double **arg, double **res, integer *iw, double *w, int mem)
{
    (void)iw, (void)w, (void)mem;
    double x0 = arg[0] ? arg[0][0] : 0.0, x1 = arg[0] ? arg[0][1] : 0.0, u = arg[1] ? arg[1][0] : 0.0;
    if (!res[0])
        return 0;
    res[0][0] = x0 + u, res[0][1] = x0 * x1, res[0][2] = x1 - u * u;
    return finish(res[0], 3);
}

static int jacobian(const double **arg, double **res, integer *iw, double *w, int mem)
{
    (void)iw, (void)w, (void)mem;
    double x0 = arg[0] ? arg[0][0] : 0.0, x1 = arg[0] ? arg[0][1] : 0.0, u = arg[1] ? arg[1][0] : 0.0;
    const double by_columns[9] = {1, x1, 0, 0, x0, 1, 1, 0, -2 * u};
    if (!res[0])
        return 0;
    memcpy(res[0], by_columns, sizeof by_columns);
    return finish(res[0], 9);
}

static integer width(void)
{
    static const integer other[] = {4, 0, -1, 16};
    int64_t k = lie(LIE_WIDTH, 4);
    return k < 4 ? other[k] : 8;
}

static void take_addresses_away(swb_casadi *out)
{
    swb_code *codes = &out->eval;
    for (int k = 0; k < 4; k++)
        if (lies & LIE_MISSING)
            codes[random_below(&luck, 7)] = NULL;
}

static void common(swb_casadi *out)
{
    memset(out, 0, sizeof *out);
    out->struct_size = sizeof *out;
    out->n_in = (swb_code)value_n_in;
    out->n_out = (swb_code)value_n_out;
    out->name_in = (swb_code)value_name_in;
    out->sparsity_in = (swb_code)value_sparsity_in;
    out->work = (swb_code)work;
    if (lies & LIE_WIDTH)
        out->int_size = out->real_size = (swb_code)width;
}

void casadi_value(swb_casadi *out)
{
    common(out);
    out->eval = (swb_code)value;
    out->sparsity_out = (swb_code)value_sparsity_out;
    take_addresses_away(out);
}

void casadi_jacobian(swb_casadi *out)
{
    common(out);
    out->eval = (swb_code)jacobian;
    out->sparsity_out = (swb_code)jacobian_sparsity_out;
    take_addresses_away(out);
}

void casadi_draw(struct random *r, swb_casadi *out)
{
    unsigned which = random_once_in(r, 2) ? LIE_NONE : 1u << random_below(r, N_LIES);
    casadi_lies(which, random_bits(r));
    if (random_once_in(r, 2))
        casadi_value(out);
    else
        casadi_jacobian(out);
    if (random_once_in(r, 20))
        out->struct_size = (uint64_t)random_odd_integer(r);
}
