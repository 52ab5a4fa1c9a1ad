/* One program with complementarity pairs, given by an mpcc_problem, for two solvers: the callbacks of switchback.h,
 * and those of IPOPT's C interface for the relaxation of Scholtes, G_i H_i <= sigma, and for the elastic mode in the
 * maximum norm, min f + s / sigma with G_i H_i <= s and one variable s more. Both call the same functions and
 * copy numbers from one array to another; nothing is evaluated twice at the same point for want of a place to keep it.
 *
 * Rows of the problem are con = [g; G; H]. A member of a pair that is a variable of the solver has no row: `member`
 * says so, and the rows that are left keep their order. */
#include "mpcc_problem.h"
#include "switchback.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct {
    const mpcc_problem *p;
    int rows;      /* of con */
    int n_kept;    /* rows of con that are rows of the solver, */
    int *kept;     /* [n_kept] these */
    int n_jac;     /* entries of the Jacobian in rows that are kept: */
    int *jac_from; /* [n_jac] where they are in that of the problem, by columns, */
    int *jac_row;  /* [n_jac] their row among those kept, */
    int *jac_col;  /* [n_jac] and their column */

    double *units;    /* [1 + rows] what objective and rows of con are multiplied by for switchback.h; NULL: nothing */
    double *sizes;    /* [n] what variables are multiplied by there; NULL: nothing */
    double *own;      /* [n] the variables of the problem */
    double *weights;  /* [1 + rows] */
    double *con;      /* [rows] at x_con */
    double *jac;      /* [jac_nnz] at x_jac */
    double *x_con, *x_jac;
    int has_con, has_jac;

    /* Scholtes: rows kept, then a product for every pair */
    double sigma;
    int elastic;                    /* is s a variable, behind those of the problem? Then sigma is its inverse weight */
    int n_prod;                     /* entries of the Jacobian of the products: */
    int *prod_pair, *prod_col;      /* [n_prod] pair and column, */
    int *prod_g, *prod_h;           /* [n_prod] entries of G_i and H_i in that of the problem, or -1 */
    int n_outer;                    /* terms of the Hessian of the products: */
    int *outer_pair, *outer_g, *outer_h, *outer_to; /* weight times two entries goes to `to` */
    double *outer_factor;           /* times 2 on the diagonal */
    int n_hess;                     /* entries of the Hessian of the Lagrangian; the problem's own come first */
    int *hess_row, *hess_col;
    int iterations;
    int count;             /* is the time in the functions of the problem counted? */
    double reading;        /* seconds that two readings of the clock take */
    double functions;      /* seconds of the thread's CPU clock in those functions */
    double deadline, wall; /* of the same clock; of the wall's, which comes no later */
} adapter;

static double now(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double cpu(void) { return now(CLOCK_THREAD_CPUTIME_ID); }

/* A function of the problem. To read the thread's clock is a call of the system, which takes as long as an iteration of a
 * small program: it is read where time is counted only. */
static int call(adapter *a, mpcc_fn fn, const double *x, const double *y, double *out) {
    if (!a->count) return fn(x, y, out, a->p->user);
    double begin = cpu();
    int status = fn(x, y, out, a->p->user);
    double spent = cpu() - begin - a->reading;
    if (spent > 0.) a->functions += spent;
    return status;
}

/* Are the CPU seconds up that a solve may take? The thread's clock is not ahead of the wall's, which is cheap to read. */
static int late(const adapter *a) { return now(CLOCK_MONOTONIC) > a->wall && cpu() > a->deadline; }

static int *ints(size_t n) { return (int *)calloc(n + 1, sizeof(int)); }
static double *doubles(size_t n) { return (double *)calloc(n + 1, sizeof(double)); }

/* --- structure -------------------------------------------------------------------------------------- */

typedef struct {
    long long key;
    int index;
} keyed;

static int by_key(const void *a, const void *b) {
    const keyed *p = (const keyed *)a, *q = (const keyed *)b;
    if (p->key != q->key) return p->key < q->key ? -1 : 1;
    return p->index - q->index;
}

/* Entries of the Jacobian by rows: row_ptr [rows + 1], entry [jac_nnz]. */
static void by_rows(const mpcc_problem *p, int rows, int *row_ptr, int *entry) {
    for (int k = 0; k < p->jac_nnz; ++k) ++row_ptr[p->jac_row[k] + 1];
    for (int i = 0; i < rows; ++i) row_ptr[i + 1] += row_ptr[i];
    int *next = ints((size_t)rows);
    memcpy(next, row_ptr, sizeof(int) * (size_t)rows);
    for (int k = 0; k < p->jac_nnz; ++k) entry[next[p->jac_row[k]]++] = k;
    free(next);
}

static void products(adapter *a) {
    const mpcc_problem *p = a->p;
    int *row_ptr = ints((size_t)a->rows), *entry = ints((size_t)p->jac_nnz);
    by_rows(p, a->rows, row_ptr, entry);
    size_t n_prod = 0, n_outer = 0;
    for (int i = 0; i < p->c; ++i) {
        int g = p->m + i, h = p->m + p->c + i;
        size_t ng = (size_t)(row_ptr[g + 1] - row_ptr[g]), nh = (size_t)(row_ptr[h + 1] - row_ptr[h]);
        n_prod += ng + nh;
        n_outer += ng * nh;
    }
    a->prod_pair = ints(n_prod), a->prod_col = ints(n_prod), a->prod_g = ints(n_prod), a->prod_h = ints(n_prod);
    a->outer_pair = ints(n_outer), a->outer_g = ints(n_outer), a->outer_h = ints(n_outer), a->outer_to = ints(n_outer);
    a->outer_factor = doubles(n_outer);
    keyed *keys = (keyed *)calloc((size_t)p->hess_nnz + n_outer + 1, sizeof(keyed));
    for (int k = 0; k < p->hess_nnz; ++k) {
        keys[k].key = (long long)p->hess_col[k] * p->n + p->hess_row[k];
        keys[k].index = k;
    }
    size_t q = 0, o = 0;
    for (int i = 0; i < p->c; ++i) {
        int g = p->m + i, h = p->m + p->c + i;
        int s = row_ptr[g], t = row_ptr[h];
        while (s < row_ptr[g + 1] || t < row_ptr[h + 1]) { /* both by increasing columns */
            int cg = s < row_ptr[g + 1] ? p->jac_col[entry[s]] : p->n;
            int ch = t < row_ptr[h + 1] ? p->jac_col[entry[t]] : p->n;
            a->prod_pair[q] = i;
            a->prod_col[q] = cg < ch ? cg : ch;
            a->prod_g[q] = cg <= ch ? entry[s++] : -1;
            a->prod_h[q] = ch <= cg ? entry[t++] : -1;
            ++q;
        }
        for (s = row_ptr[g]; s < row_ptr[g + 1]; ++s)
            for (t = row_ptr[h]; t < row_ptr[h + 1]; ++t) {
                int u = p->jac_col[entry[s]], v = p->jac_col[entry[t]];
                int row = u < v ? u : v, col = u < v ? v : u;
                a->outer_pair[o] = i, a->outer_g[o] = entry[s], a->outer_h[o] = entry[t];
                a->outer_factor[o] = u == v ? 2. : 1.;
                keys[(size_t)p->hess_nnz + o].key = (long long)col * p->n + row;
                keys[(size_t)p->hess_nnz + o].index = p->hess_nnz + (int)o;
                ++o;
            }
    }
    a->n_prod = (int)q, a->n_outer = (int)o;
    size_t all = (size_t)p->hess_nnz + o;
    qsort(keys, all, sizeof(keyed), by_key); /* of equal keys the problem's own entry is first */
    a->hess_row = ints(all), a->hess_col = ints(all);
    a->n_hess = p->hess_nnz;
    for (size_t k = 0, at = 0; k < all; ++k) {
        if (k == 0 || keys[k].key != keys[k - 1].key) {
            at = keys[k].index < p->hess_nnz ? (size_t)keys[k].index : (size_t)a->n_hess++;
            a->hess_row[at] = (int)(keys[k].key % p->n), a->hess_col[at] = (int)(keys[k].key / p->n);
        }
        if (keys[k].index >= p->hess_nnz) a->outer_to[keys[k].index - p->hess_nnz] = (int)at;
    }
    free(keys), free(row_ptr), free(entry);
}

/* member [2 c]: 1 where G_i, then H_i, is a variable of the solver. NULL when memory is short. */
adapter *adapter_open(const mpcc_problem *p, const uint8_t *member) {
    adapter *a = (adapter *)calloc(1, sizeof(adapter));
    if (!a) return NULL;
    a->p = p;
    a->rows = p->m + 2 * p->c;
    a->kept = ints((size_t)a->rows);
    int *number = ints((size_t)a->rows);
    for (int i = 0; i < a->rows; ++i) {
        number[i] = i >= p->m && member[i - p->m] ? -1 : a->n_kept;
        if (number[i] >= 0) a->kept[a->n_kept++] = i;
    }
    a->jac_from = ints((size_t)p->jac_nnz), a->jac_row = ints((size_t)p->jac_nnz);
    a->jac_col = ints((size_t)p->jac_nnz);
    for (int k = 0; k < p->jac_nnz; ++k)
        if (number[p->jac_row[k]] >= 0) {
            a->jac_from[a->n_jac] = k, a->jac_col[a->n_jac] = p->jac_col[k];
            a->jac_row[a->n_jac++] = number[p->jac_row[k]];
        }
    free(number);
    a->weights = doubles(1 + (size_t)a->rows);
    a->con = doubles((size_t)a->rows), a->jac = doubles((size_t)p->jac_nnz);
    a->x_con = doubles((size_t)p->n), a->x_jac = doubles((size_t)p->n);
    products(a);
    return a;
}

int adapter_n_kept(const adapter *a) { return a->n_kept; }
int adapter_n_jac(const adapter *a) { return a->n_jac; }
int adapter_scholtes_n_jac(const adapter *a) { return a->n_jac + a->n_prod + (a->elastic ? a->p->c : 0); }
int adapter_scholtes_n_hess(const adapter *a) { return a->n_hess; }
const int *adapter_kept(const adapter *a) { return a->kept; }
const int *adapter_jac_row(const adapter *a) { return a->jac_row; }
const int *adapter_jac_col(const adapter *a) { return a->jac_col; }

/* Forget what was evaluated, so that the next solve pays for its own. */
void adapter_reset(adapter *a) { a->has_con = a->has_jac = a->iterations = 0; }

/* Begin to count, or not, the CPU seconds in the functions of the problem. */
void adapter_count(adapter *a, int on) {
    a->count = on, a->functions = 0., a->reading = 1.;
    for (int k = 0; on && k < 100; ++k) {
        double begin = cpu(), spent = cpu() - begin;
        if (spent < a->reading) a->reading = spent;
    }
}

/* Those seconds so far. */
double adapter_functions(const adapter *a) { return a->functions; }

/* Multiply objective and rows of con by units [1 + rows] in what switchback.h sees. */
void adapter_set_units(adapter *a, const double *units) {
    size_t n = 1 + (size_t)a->rows;
    if (!a->units) a->units = doubles(n);
    if (a->units) memcpy(a->units, units, sizeof(double) * n);
}

/* Multiply variables by sizes [n] in what switchback.h sees. */
void adapter_set_sizes(adapter *a, const double *sizes) {
    size_t n = (size_t)a->p->n;
    if (!a->sizes) a->sizes = doubles(n), a->own = doubles(n);
    if (a->sizes && a->own) memcpy(a->sizes, sizes, sizeof(double) * n);
}

void adapter_set_deadline(adapter *a, double seconds) {
    a->deadline = cpu() + seconds;
    a->wall = now(CLOCK_MONOTONIC) + seconds;
}

/* --- evaluation ------------------------------------------------------------------------------------- */

static const double *con_at(adapter *a, const double *x) {
    size_t bytes = sizeof(double) * (size_t)a->p->n;
    if (!a->has_con || memcmp(x, a->x_con, bytes)) {
        a->has_con = !call(a, a->p->con, x, NULL, a->con);
        memcpy(a->x_con, x, bytes);
    }
    return a->has_con ? a->con : NULL;
}

static const double *jac_at(adapter *a, const double *x) {
    size_t bytes = sizeof(double) * (size_t)a->p->n;
    if (!a->has_jac || memcmp(x, a->x_jac, bytes)) {
        a->has_jac = !call(a, a->p->jac, x, NULL, a->jac);
        memcpy(a->x_jac, x, bytes);
    }
    return a->has_jac ? a->jac : NULL;
}

/* --- switchback.h ----------------------------------------------------------------------------------- */

/* The point of the problem at that of switchback.h. */
static const double *own(adapter *a, const double *x) {
    if (!a->sizes) return x;
    for (int j = 0; j < a->p->n; ++j) a->own[j] = x[j] / a->sizes[j];
    return a->own;
}

int32_t adapter_f(const swb_point *at, double *out, void *data) {
    adapter *a = (adapter *)data;
    if (call(a, a->p->f, own(a, at->x), NULL, out)) return 1;
    if (a->units) *out *= a->units[0];
    return 0;
}

int32_t adapter_f_jac(const swb_point *at, double *out, void *data) {
    adapter *a = (adapter *)data;
    if (call(a, a->p->grad, own(a, at->x), NULL, out)) return 1;
    for (int j = 0; a->units && j < a->p->n; ++j) out[j] *= a->units[0];
    for (int j = 0; a->sizes && j < a->p->n; ++j) out[j] /= a->sizes[j];
    return 0;
}

int32_t adapter_c(const swb_point *at, double *out, void *data) {
    adapter *a = (adapter *)data;
    if (a->n_kept == a->rows && !a->units) return call(a, a->p->con, own(a, at->x), NULL, out);
    if (call(a, a->p->con, own(a, at->x), NULL, a->con)) return 1;
    for (int i = 0; i < a->n_kept; ++i) out[i] = a->con[a->kept[i]];
    for (int i = 0; a->units && i < a->n_kept; ++i) out[i] *= a->units[1 + a->kept[i]];
    return 0;
}

int32_t adapter_c_jac(const swb_point *at, double *out, void *data) {
    adapter *a = (adapter *)data;
    if (a->n_jac == a->p->jac_nnz && !a->units && !a->sizes) return call(a, a->p->jac, own(a, at->x), NULL, out);
    if (call(a, a->p->jac, own(a, at->x), NULL, a->jac)) return 1;
    for (int k = 0; k < a->n_jac; ++k) out[k] = a->jac[a->jac_from[k]];
    for (int k = 0; a->units && k < a->n_jac; ++k) out[k] *= a->units[1 + a->kept[a->jac_row[k]]];
    for (int k = 0; a->sizes && k < a->n_jac; ++k) out[k] /= a->sizes[a->jac_col[k]];
    return 0;
}

int32_t adapter_hess(const swb_point *at, double weight, const double *y, double *out, void *data) {
    adapter *a = (adapter *)data;
    memset(a->weights, 0, sizeof(double) * (1 + (size_t)a->rows));
    a->weights[0] = weight;
    for (int i = 0; i < a->n_kept; ++i) a->weights[1 + a->kept[i]] = y[i];
    for (int i = 0; a->units && i <= a->rows; ++i) a->weights[i] *= a->units[i];
    if (call(a, a->p->hess, own(a, at->x), a->weights, out)) return 1;
    for (int j = 0; a->sizes && j < a->p->n; ++j)
        for (int k = a->p->hess_colptr[j]; k < a->p->hess_colptr[j + 1]; ++k)
            out[k] /= a->sizes[j] * a->sizes[a->p->hess_row[k]];
    return 0;
}

int32_t adapter_iteration(const swb_iteration_info *info, void *data) {
    (void)info;
    return late((const adapter *)data);
}

/* --- IPOPT, C interface of 3.14 ------------------------------------------------------------------------
 * min f(x) subject to the rows kept and G_i H_i - sigma <= 0, or G_i H_i - s <= 0 in elastic mode. Truth values are int 0 or 1, which serves callers
 * that read one byte as well as those that read four. */

void adapter_set_elastic(adapter *a, int on) { a->elastic = on; }
void adapter_set_sigma(adapter *a, double sigma) { a->sigma = sigma; }
int adapter_iterations(const adapter *a) { return a->iterations; }

int scholtes_f(int n, double *x, int new_x, double *out, void *data) {
    adapter *a = (adapter *)data;
    (void)n, (void)new_x;
    if (call(a, a->p->f, x, NULL, out)) return 0;
    if (a->elastic) *out += x[a->p->n] / a->sigma;
    return 1;
}

int scholtes_grad(int n, double *x, int new_x, double *out, void *data) {
    adapter *a = (adapter *)data;
    (void)n, (void)new_x;
    if (a->elastic) out[a->p->n] = 1. / a->sigma;
    return !call(a, a->p->grad, x, NULL, out);
}

int scholtes_g(int n, double *x, int new_x, int m, double *out, void *data) {
    adapter *a = (adapter *)data;
    const double *con = con_at(a, x);
    (void)n, (void)new_x, (void)m;
    if (!con) return 0;
    const double *g = con + a->p->m, *h = g + a->p->c;
    for (int i = 0; i < a->n_kept; ++i) out[i] = con[a->kept[i]];
    for (int i = 0; i < a->p->c; ++i) out[a->n_kept + i] = g[i] * h[i] - (a->elastic ? x[a->p->n] : a->sigma);
    return 1;
}

int scholtes_jac(int n, double *x, int new_x, int m, int nnz, int *rows, int *cols, double *out, void *data) {
    adapter *a = (adapter *)data;
    (void)n, (void)new_x, (void)m, (void)nnz;
    if (!out) {
        memcpy(rows, a->jac_row, sizeof(int) * (size_t)a->n_jac);
        memcpy(cols, a->jac_col, sizeof(int) * (size_t)a->n_jac);
        for (int k = 0; k < a->n_prod; ++k)
            rows[a->n_jac + k] = a->n_kept + a->prod_pair[k], cols[a->n_jac + k] = a->prod_col[k];
        for (int i = 0, at = a->n_jac + a->n_prod; a->elastic && i < a->p->c; ++i)
            rows[at + i] = a->n_kept + i, cols[at + i] = a->p->n;
        return 1;
    }
    const double *con = con_at(a, x), *jac = jac_at(a, x);
    if (!con || !jac) return 0;
    const double *g = con + a->p->m, *h = g + a->p->c;
    for (int k = 0; k < a->n_jac; ++k) out[k] = jac[a->jac_from[k]];
    for (int k = 0; k < a->n_prod; ++k) {
        int i = a->prod_pair[k];
        double value = 0.;
        if (a->prod_g[k] >= 0) value += jac[a->prod_g[k]] * h[i];
        if (a->prod_h[k] >= 0) value += jac[a->prod_h[k]] * g[i];
        out[a->n_jac + k] = value;
    }
    for (int i = 0; a->elastic && i < a->p->c; ++i) out[a->n_jac + a->n_prod + i] = -1.;
    return 1;
}

int scholtes_hess(int n, double *x, int new_x, double weight, int m, double *y, int new_y, int nnz, int *rows, int *cols,
                  double *out, void *data) {
    adapter *a = (adapter *)data;
    const mpcc_problem *p = a->p;
    (void)n, (void)new_x, (void)m, (void)new_y, (void)nnz;
    if (!out) {
        memcpy(rows, a->hess_row, sizeof(int) * (size_t)a->n_hess);
        memcpy(cols, a->hess_col, sizeof(int) * (size_t)a->n_hess);
        return 1;
    }
    const double *con = con_at(a, x), *jac = jac_at(a, x);
    if (!con || !jac) return 0;
    const double *g = con + p->m, *h = g + p->c, *yp = y + a->n_kept;
    memset(a->weights, 0, sizeof(double) * (1 + (size_t)a->rows));
    a->weights[0] = weight;
    for (int i = 0; i < a->n_kept; ++i) a->weights[1 + a->kept[i]] = y[i];
    for (int i = 0; i < p->c; ++i) {
        a->weights[1 + p->m + i] += yp[i] * h[i];
        a->weights[1 + p->m + p->c + i] += yp[i] * g[i];
    }
    memset(out, 0, sizeof(double) * (size_t)a->n_hess);
    if (call(a, p->hess, x, a->weights, out)) return 0;
    for (int k = 0; k < a->n_outer; ++k)
        out[a->outer_to[k]] += a->outer_factor[k] * yp[a->outer_pair[k]] * jac[a->outer_g[k]] * jac[a->outer_h[k]];
    return 1;
}

int scholtes_iteration(int mode, int iteration, double f, double inf_pr, double inf_du, double mu, double step,
                       double delta, double alpha_du, double alpha_pr, int trials, void *data) {
    adapter *a = (adapter *)data;
    (void)mode, (void)f, (void)inf_pr, (void)inf_du, (void)mu, (void)step, (void)delta, (void)alpha_du, (void)alpha_pr;
    (void)trials;
    a->iterations = iteration;
    return !late(a);
}
