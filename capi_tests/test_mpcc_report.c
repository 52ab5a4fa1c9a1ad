/* What a program says about its result; second derivatives in one piece; names; warm starts; failing callbacks. */
#include "models.h"

#include <pthread.h>
#include <stdlib.h>

#define INF (double)INFINITY
#define V SWB_MEMBER_VARIABLE
#define C SWB_MEMBER_CONSTRAINT

/* min (x - p)^2 + x0 x2 over 0 <= x0 _|_ x1 - x2 >= 0, x0^2 + x1 <= 4. */
enum { VALUE = 1, GRADIENT, HESSIAN };

struct model {
    int fails;     /* this callback says no */
    int fail_from; /* from this iteration on, */
    int32_t code;  /* by this code, */
    int times;     /* so often */
    int iterations, hessians;
};

static int32_t trouble(struct model *m, int who)
{
    if (m->fails != who || !m->code || m->iterations < m->fail_from || m->times == 0)
        return 0;
    m->times--;
    return m->code;
}

static int32_t objective(const swb_point *at, double *out, void *user_data)
{
    const double *x = at->x, d = x[0] - 3 - at->p[0];

    out[0] = d * d + (x[1] - 1) * (x[1] - 1) + (x[2] + 2) * (x[2] + 2) + x[0] * x[2];
    return trouble(user_data, VALUE);
}

static int32_t gradient(const swb_point *at, double *out, void *user_data)
{
    const double *x = at->x;

    out[0] = 2 * (x[0] - 3 - at->p[0]) + x[2];
    out[1] = 2 * (x[1] - 1);
    out[2] = 2 * (x[2] + 2) + x[0];
    return trouble(user_data, GRADIENT);
}

static int32_t rows(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0] * at->x[0] + at->x[1];
    out[1] = at->x[1] - at->x[2];
    return 0;
}

static int32_t rows_jacobian(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = 2 * at->x[0];
    out[1] = 1;
    out[2] = 1;
    out[3] = -1;
    return 0;
}

static int32_t hessian(const swb_point *at, double weight, const double *y, double *out, void *user_data)
{
    struct model *m = user_data;

    (void)at;
    m->hessians++;
    out[0] = 2 * weight + 2 * y[0];
    out[1] = 2 * weight;
    out[2] = weight;
    out[3] = 2 * weight;
    return trouble(m, HESSIAN);
}

static const int64_t GRADIENT_COLUMNS[] = {0, 1, 2, 3, 3, 3}, GRADIENT_ROWS[] = {0, 0, 0};
static const int64_t JACOBIAN_COLUMNS[] = {0, 1, 3, 4, 4, 4}, JACOBIAN_ROWS[] = {0, 0, 1, 1};
static const int64_t HESSIAN_COLUMNS[] = {0, 1, 2, 4}, HESSIAN_ROWS[] = {0, 1, 0, 2};

static swb_mpcc *make(struct model *m)
{
    swb_function *f = NULL, *c = NULL;
    swb_mpcc *mpcc = NULL;
    double lower[] = {-INF, 0}, upper[] = {4, INF}, start[] = {1, 1, 1};

    CHECK_OK(swb_function_create("f", 3, 0, 1, 1, objective, m, NULL, &f));
    CHECK_OK(swb_function_set_jacobian(f, GRADIENT_COLUMNS, 6, GRADIENT_ROWS, 3, gradient));
    CHECK_OK(swb_function_set_linear(f));
    CHECK_OK(swb_function_create("c", 3, 0, 1, 2, rows, m, NULL, &c));
    CHECK_OK(swb_function_set_jacobian(c, JACOBIAN_COLUMNS, 6, JACOBIAN_ROWS, 4, rows_jacobian));
    CHECK_OK(swb_function_set_linear(c));
    CHECK_OK(swb_mpcc_create(3, 1, f, c, NULL, &mpcc));
    swb_function_free(f);
    swb_function_free(c);
    CHECK_OK(swb_mpcc_set_hessian(mpcc, HESSIAN_COLUMNS, 4, HESSIAN_ROWS, 4, hessian, m));
    CHECK_OK(swb_mpcc_add_pair(mpcc, V, 0, C, 1));
    CHECK_OK(swb_mpcc_set_constraint_bounds(mpcc, lower, 2, upper, 2));
    CHECK_OK(swb_mpcc_set_start(mpcc, start, 3));
    return mpcc;
}

static int32_t solve(swb_mpcc *mpcc)
{
    int32_t outcome = -1;

    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    return outcome;
}

/* The answer, from stationarity in the branch x1 = x2 with x0^2 + x1 = 4 active. */
static void check_point(swb_mpcc *mpcc)
{
    double x[3], y[2], z[3];

    CHECK_OK(swb_mpcc_get_solution(mpcc, x, 3));
    CHECK_OK(swb_mpcc_get_multipliers(mpcc, y, 2, z, 3));
    CHECK_NEAR(x[1] - x[2], 0.0, 1e-9);
    CHECK_NEAR(x[0] * x[0] + x[1], 4.0, 1e-8);
    CHECK_NEAR(2 * (x[0] - 3) + x[2] + 2 * x[0] * y[0] - z[0], 0.0, 1e-8);
    CHECK_NEAR(2 * (x[1] - 1) + y[0] + y[1] - z[1], 0.0, 1e-8);
    CHECK_NEAR(2 * (x[2] + 2) + x[0] - y[1] - z[2], 0.0, 1e-8);
    CHECK(y[0] > 0.0);
}

static void one_hessian(void)
{
    struct model m = {0};
    swb_mpcc *mpcc = make(&m);
    swb_stats stats;
    int64_t below[] = {0, 1}, outside[] = {0, 5}, short_columns[] = {0, 1, 2}, falling[] = {0, 2, 1, 2};

    CHECK(solve(mpcc) == SWB_OUTCOME_SOLVED);
    check_point(mpcc);
    CHECK_OK(swb_mpcc_get_stats(mpcc, &stats, sizeof stats));
    CHECK(m.hessians > 0 && m.hessians <= 2 * stats.iterations + 5);
    /* What is no pattern changes nothing. */
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_set_hessian(mpcc, NULL, 4, HESSIAN_ROWS, 4, hessian, &m));
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_set_hessian(mpcc, HESSIAN_COLUMNS, 4, NULL, 4, hessian, &m));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_hessian(mpcc, short_columns, 3, HESSIAN_ROWS, 2, hessian, &m));
    CHECK(strstr(swb_last_error(), "variables") != NULL);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_hessian(mpcc, HESSIAN_COLUMNS, -4, HESSIAN_ROWS, 4, hessian, &m));
    CHECK(swb_mpcc_set_hessian(mpcc, HESSIAN_COLUMNS, 4, HESSIAN_ROWS, 3, hessian, &m) != SWB_OK);
    swb_error_handled();
    CHECK(swb_mpcc_set_hessian(mpcc, falling, 4, HESSIAN_ROWS, 2, hessian, &m) != SWB_OK);
    swb_error_handled();
    {
        int64_t first[] = {0, 2, 2, 2};
        CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_set_hessian(mpcc, first, 4, below, 2, hessian, &m));
        CHECK(strstr(swb_last_error(), "below the diagonal") != NULL);
        CHECK(swb_mpcc_set_hessian(mpcc, first, 4, outside, 2, hessian, &m) != SWB_OK);
        swb_error_handled();
    }
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_set_hessian(NULL, HESSIAN_COLUMNS, 4, HESSIAN_ROWS, 4, hessian, &m));
    CHECK(solve(mpcc) == SWB_OUTCOME_SOLVED);
    check_point(mpcc);
    swb_mpcc_free(mpcc);
}

static int32_t count(const swb_iteration_info *info, void *user_data)
{
    struct model *m = user_data;

    (void)info;
    m->iterations++;
    return 0;
}

/* A callback that fails from the third iteration on. */
static void failures(void)
{
    int who;

    for (who = VALUE; who <= HESSIAN; who++) {
        struct model m = {0};
        swb_mpcc *mpcc = make(&m);
        int32_t outcome = -1;
        swb_status status;

        CHECK_OK(swb_mpcc_set_iteration(mpcc, count, &m));
        m.fails = who;
        m.fail_from = 3;
        m.code = -17;
        m.times = 1;
        CHECK_STATUS(SWB_ERR_USER, swb_mpcc_solve(mpcc, &outcome));
        CHECK(swb_last_user_code() == -17 && outcome == -1);
        CHECK(strstr(swb_last_error(), who == HESSIAN ? "'Lagrangian'" : "'f'") != NULL);
        /* Once not defined: a value is survived by a shorter step, a derivative may end the solve, by name. */
        m.iterations = 0;
        m.code = 5;
        m.times = 1;
        status = swb_mpcc_solve(mpcc, &outcome);
        CHECK(m.times == 0);
        if (who == VALUE) {
            CHECK(status == SWB_OK && outcome == SWB_OUTCOME_SOLVED);
        } else if (status != SWB_OK) {
            CHECK(status == SWB_ERR_NONFINITE);
            CHECK(strstr(swb_last_error(), who == HESSIAN ? "'Lagrangian'" : "'f'") != NULL);
        }
        /* Afterwards it works as before. */
        m.code = 0;
        CHECK(solve(mpcc) == SWB_OUTCOME_SOLVED);
        check_point(mpcc);
        swb_mpcc_free(mpcc);
    }
}

static void warm_starts(void)
{
    struct model m = {0};
    swb_mpcc *mpcc = make(&m);
    swb_stats cold, warm;
    double x[3], y[2], z[3], p = 0.05, other[3], nan = (double)NAN;
    int32_t outcome = -1;

    CHECK_STATUS(SWB_ERR_STATE, swb_mpcc_resolve(mpcc, &outcome));
    CHECK(solve(mpcc) == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_mpcc_get_stats(mpcc, &cold, sizeof cold));
    CHECK_OK(swb_mpcc_get_solution(mpcc, x, 3));
    CHECK_OK(swb_mpcc_get_multipliers(mpcc, y, 2, z, 3));
    CHECK_OK(swb_mpcc_resolve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    check_point(mpcc);
    CHECK_OK(swb_mpcc_get_stats(mpcc, &warm, sizeof warm));
    CHECK(warm.iterations <= 3 && warm.iterations < cold.iterations && warm.time_build == 0.0);
    /* Another parameter: the same as from the start. */
    CHECK_OK(swb_mpcc_set_params(mpcc, &p, 1));
    CHECK_OK(swb_mpcc_resolve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_mpcc_get_solution(mpcc, other, 3));
    CHECK(solve(mpcc) == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_mpcc_get_solution(mpcc, x, 3));
    CHECK_NEAR(other[0], x[0], 1e-8);
    CHECK_NEAR(other[2], x[2], 1e-8);
    /* A point of one's own, with multipliers and without. */
    p = 0.0;
    CHECK_OK(swb_mpcc_set_params(mpcc, &p, 1));
    CHECK_OK(swb_mpcc_set_warm_start(mpcc, x, 3, y, 2, z, 3));
    CHECK(solve(mpcc) == SWB_OUTCOME_SOLVED);
    check_point(mpcc);
    CHECK_OK(swb_mpcc_set_warm_start(mpcc, x, 3, NULL, 0, NULL, 0));
    CHECK(solve(mpcc) == SWB_OUTCOME_SOLVED);
    check_point(mpcc);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_warm_start(mpcc, x, 2, y, 2, z, 3));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_warm_start(mpcc, x, 3, y, 1, z, 3));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_warm_start(mpcc, x, 3, y, 2, z, 2));
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_set_warm_start(mpcc, NULL, 3, y, 2, z, 3));
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_set_warm_start(mpcc, x, 3, NULL, 2, z, 3));
    y[1] = nan;
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_set_warm_start(mpcc, x, 3, y, 2, z, 3));
    swb_mpcc_free(mpcc);
}

/* An active set of bounds and pairs alone is found at once. */
static int32_t tracking(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = (at->x[0] - at->p[0]) * (at->x[0] - at->p[0]) + (at->x[1] - at->p[1]) * (at->x[1] - at->p[1]);
    return 0;
}

/* Differences would leave more or less to be done, as they happen to round. */
static int32_t tracking_gradient(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = 2 * (at->x[0] - at->p[0]);
    out[1] = 2 * (at->x[1] - at->p[1]);
    return 0;
}

static void re_solve(void)
{
    static const int64_t columns[] = {0, 1, 2, 2, 2, 2}, rows_of[] = {0, 0};
    swb_function *f = make_function("f", 2, 0, 2, 1, tracking, NULL);
    swb_mpcc *mpcc = NULL;
    swb_stats stats;
    double p[] = {3.0, 1.0}, x[2];
    int32_t outcome = -1;

    CHECK_OK(swb_function_set_jacobian(f, columns, 6, rows_of, 2, tracking_gradient));
    CHECK_OK(swb_mpcc_create(2, 2, f, NULL, NULL, &mpcc));
    swb_function_free(f);
    CHECK_OK(swb_mpcc_add_pair(mpcc, V, 0, V, 1));
    CHECK_OK(swb_mpcc_set_params(mpcc, p, 2));
    CHECK(solve(mpcc) == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_mpcc_resolve(mpcc, &outcome));
    CHECK_OK(swb_mpcc_get_stats(mpcc, &stats, sizeof stats));
    CHECK(outcome == SWB_OUTCOME_SOLVED && stats.iterations <= 1);
    p[0] = 3.2;
    CHECK_OK(swb_mpcc_set_params(mpcc, p, 2));
    CHECK_OK(swb_mpcc_resolve(mpcc, &outcome));
    CHECK_OK(swb_mpcc_get_stats(mpcc, &stats, sizeof stats));
    CHECK(outcome == SWB_OUTCOME_SOLVED && stats.iterations <= 3);
    CHECK_OK(swb_mpcc_get_solution(mpcc, x, 2));
    CHECK_NEAR(x[0], 3.2, 1e-9);
    CHECK(x[1] == 0.0);
    swb_mpcc_free(mpcc);
}

static char *text_of(swb_mpcc *mpcc, swb_status (*f)(const swb_mpcc *, char *, int64_t, int64_t *))
{
    int64_t needed = 0;
    char *text;

    CHECK_OK(f(mpcc, NULL, 0, &needed));
    text = malloc((size_t)needed);
    CHECK_STATUS(SWB_ERR_DIMENSION, f(mpcc, text, needed - 1, NULL));
    CHECK_OK(f(mpcc, text, needed, NULL));
    CHECK((int64_t)strlen(text) == needed - 1);
    return text;
}

static int32_t opposed(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0] + at->x[1];
    out[1] = at->x[0] + at->x[1];
    out[2] = at->x[2];
    return 0;
}

static int32_t squares(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0] * at->x[0] + at->x[1] * at->x[1] + at->x[2] * at->x[2];
    return 0;
}

static void keep_conflict(int64_t level, const char *line, void *user_data)
{
    (void)level;
    if (strncmp(line, "mpcc conflict", 13) == 0)
        snprintf(user_data, 200, "%s", line);
}

static void infeasible(void)
{
    swb_function *f = make_function("f", 3, 0, 0, 1, squares, NULL), *c = make_function("c", 3, 0, 0, 3, opposed, NULL);
    swb_mpcc *mpcc = NULL;
    const char *names[] = {"demand", "supply", NULL};
    double lower[] = {3, 0, 0}, upper[] = {9, 1, 1}, weights[5], gap = 0, residual = 1, violation[5];
    int32_t kinds[5], outcome = -1;
    int64_t indices[5], found = -1;
    char line[200] = "", name[20], *json, *report;
    swb_certificate certificate;

    CHECK_OK(swb_mpcc_create(3, 0, f, c, NULL, &mpcc));
    swb_function_free(f);
    swb_function_free(c);
    CHECK_OK(swb_mpcc_add_pair(mpcc, V, 0, V, 1));
    CHECK_OK(swb_mpcc_set_constraint_bounds(mpcc, lower, 3, upper, 3));
    CHECK_STATUS(SWB_ERR_STATE, swb_mpcc_get_conflict(mpcc, NULL, NULL, NULL, 0, &found, NULL, NULL));
    CHECK_STATUS(SWB_ERR_STATE, swb_mpcc_get_worst(mpcc, NULL, NULL, NULL, 0, &found));
    CHECK_STATUS(SWB_ERR_STATE, swb_mpcc_statistics_json(mpcc, NULL, 0, &found));
    CHECK_STATUS(SWB_ERR_STATE, swb_mpcc_report_text(mpcc, NULL, 0, &found));
    CHECK_OK(swb_mpcc_set_names(mpcc, SWB_ITEM_CONSTRAINT, names, 3));
    CHECK_OK(swb_mpcc_set_name(mpcc, SWB_ITEM_VARIABLE, 1, "flow"));
    CHECK_OK(swb_mpcc_set_name(mpcc, SWB_ITEM_PAIR, 0, "valve"));
    CHECK_OK(swb_mpcc_set_string(mpcc, "log_level", "warning"));
    CHECK_OK(swb_mpcc_set_log(mpcc, keep_conflict, line));
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_INFEASIBLE);
    CHECK(strstr(line, "demand") && strstr(line, "supply"));
    CHECK_OK(swb_mpcc_get_conflict(mpcc, kinds, indices, weights, 5, &found, &gap, &residual));
    CHECK(found == 2 && kinds[0] == SWB_ITEM_CONSTRAINT && kinds[1] == SWB_ITEM_CONSTRAINT);
    CHECK(indices[0] + indices[1] == 1);
    CHECK_NEAR(weights[indices[0]], -1.0, 1e-6);
    CHECK_NEAR(weights[indices[1]], 1.0, 1e-6);
    CHECK_NEAR(gap, 2.0, 1e-5);
    CHECK(residual < 1e-6);
    CHECK_OK(swb_mpcc_get_worst(mpcc, kinds, indices, violation, 2, &found));
    CHECK(found >= 2 && violation[0] >= violation[1] && violation[1] > 0.0);
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_get_worst(mpcc, NULL, indices, violation, 2, &found));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_get_worst(mpcc, kinds, indices, violation, -1, &found));
    CHECK_OK(swb_mpcc_get_certificate(mpcc, &certificate, sizeof certificate));
    CHECK(certificate.stationarity == SWB_STATIONARITY_UNKNOWN);
    json = text_of(mpcc, swb_mpcc_statistics_json);
    CHECK(strstr(json, "\"schema\": \"switchback.mpcc/1\"") && strstr(json, "\"name\": \"demand\""));
    CHECK(strstr(json, "\"outcome\": \"infeasible\"") != NULL);
    report = text_of(mpcc, swb_mpcc_report_text);
    CHECK(strstr(report, "demand") && strstr(report, "conflict"));
    free(json);
    free(report);
    /* Names. */
    CHECK_OK(swb_mpcc_get_name(mpcc, SWB_ITEM_VARIABLE, 1, name, sizeof name, NULL));
    CHECK_TEXT("flow", name);
    CHECK_OK(swb_mpcc_get_name(mpcc, SWB_ITEM_CONSTRAINT, 2, name, sizeof name, NULL));
    CHECK_TEXT("constraint 2", name);
    CHECK_OK(swb_mpcc_set_name(mpcc, SWB_ITEM_PAIR, 0, NULL));
    CHECK_OK(swb_mpcc_get_name(mpcc, SWB_ITEM_PAIR, 0, name, sizeof name, NULL));
    CHECK_TEXT("pair 0", name);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_get_name(mpcc, SWB_ITEM_PAIR, 0, name, 3, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_name(mpcc, SWB_ITEM_PAIR, 1, "x"));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_name(mpcc, SWB_ITEM_VARIABLE, -1, "x"));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_set_name(mpcc, 4, 0, "x"));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_set_name(mpcc, SWB_ITEM_PAIR, 0, "\xff"));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_names(mpcc, SWB_ITEM_VARIABLE, names, 2));
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_set_names(mpcc, SWB_ITEM_VARIABLE, NULL, 3));
    swb_mpcc_free(mpcc);
}

static void results(void)
{
    struct model m = {0};
    swb_mpcc *mpcc = make(&m);
    swb_certificate certificate;
    swb_linear_stats linear;
    swb_residuals plain, scaled;
    int64_t found = -1;
    char *report;

    CHECK_STATUS(SWB_ERR_STATE, swb_mpcc_get_certificate(mpcc, &certificate, sizeof certificate));
    CHECK(solve(mpcc) == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_mpcc_get_certificate(mpcc, &certificate, sizeof certificate));
    CHECK(certificate.struct_size == sizeof certificate);
    CHECK(certificate.stationarity == SWB_STATIONARITY_S && certificate.b_stationarity == SWB_B_STATIONARITY_YES);
    CHECK(certificate.doubt == SWB_DOUBT_NONE && certificate.biactive == 0);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_get_certificate(mpcc, &certificate, 12));
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_get_certificate(mpcc, NULL, sizeof certificate));
    CHECK_TEXT("S", swb_stationarity_name(SWB_STATIONARITY_S));
    CHECK_TEXT("nodes", swb_doubt_name(SWB_DOUBT_NODES));
    CHECK(swb_stationarity_name(-1) == NULL && swb_doubt_name(99) == NULL);
    CHECK_OK(swb_mpcc_get_linear_stats(mpcc, &linear, sizeof linear));
    CHECK(linear.n >= 4 && linear.nnz_k >= linear.n && linear.factorisations > 0 && linear.flops > 0);
    CHECK_OK(swb_mpcc_get_residuals(mpcc, &plain, sizeof plain));
    CHECK_OK(swb_mpcc_get_scaled_residuals(mpcc, &scaled, sizeof scaled));
    CHECK(plain.primal < 1e-9 && plain.dual < 1e-7 && plain.pair_min == 0.0 && scaled.primal <= plain.primal + 1e-15);
    CHECK_OK(swb_mpcc_get_conflict(mpcc, NULL, NULL, NULL, 0, &found, NULL, NULL));
    CHECK(found == 0);
    report = text_of(mpcc, swb_mpcc_report_text);
    CHECK(strstr(report, "B-stationary: yes") != NULL);
    free(report);
    swb_mpcc_free(mpcc);
}

static int32_t downhill(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = -at->x[0] - at->x[1];
    return 0;
}

static int32_t interrupt_third(const swb_iteration_info *info, void *user_data)
{
    if (info->iter == 3)
        CHECK_OK(swb_mpcc_interrupt(user_data));
    return 0;
}

static void unbounded_and_interrupt(void)
{
    swb_function *f = make_function("f", 2, 0, 0, 1, downhill, NULL);
    struct model m = {0};
    swb_mpcc *mpcc = NULL;
    int32_t outcome = -1;

    CHECK_OK(swb_mpcc_create(2, 0, f, NULL, NULL, &mpcc));
    swb_function_free(f);
    CHECK_OK(swb_mpcc_add_pair(mpcc, V, 0, V, 1));
    CHECK(solve(mpcc) == SWB_OUTCOME_DIVERGING);
    /* Nothing to start from: a solve from the start. */
    CHECK_OK(swb_mpcc_resolve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_DIVERGING);
    swb_mpcc_free(mpcc);

    mpcc = make(&m);
    CHECK_OK(swb_mpcc_set_iteration(mpcc, interrupt_third, mpcc));
    CHECK(solve(mpcc) == SWB_OUTCOME_STOPPED);
    CHECK_OK(swb_mpcc_set_iteration(mpcc, NULL, NULL));
    CHECK_OK(swb_mpcc_resolve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    check_point(mpcc);
    swb_mpcc_free(mpcc);
}

/* Two programs in two threads: the same numbers to the last bit. */
static void *work(void *result)
{
    struct model m = {0};
    swb_mpcc *mpcc = make(&m);
    int k;

    for (k = 0; k < 20; k++) {
        CHECK(solve(mpcc) == SWB_OUTCOME_SOLVED);
        CHECK_OK(swb_mpcc_get_solution(mpcc, result, 3));
    }
    swb_mpcc_free(mpcc);
    return NULL;
}

static void threads(void)
{
    pthread_t thread[2];
    double x[2][3] = {{0}};
    int k;

    for (k = 0; k < 2; k++)
        CHECK(pthread_create(&thread[k], NULL, work, x[k]) == 0);
    for (k = 0; k < 2; k++)
        CHECK(pthread_join(thread[k], NULL) == 0);
    CHECK(memcmp(x[0], x[1], sizeof x[0]) == 0);
}

int main(void)
{
    one_hessian();
    failures();
    warm_starts();
    re_solve();
    infeasible();
    results();
    unbounded_and_interrupt();
    threads();
    return CHECK_DONE();
}
