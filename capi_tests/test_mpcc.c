/* Nonlinear programs with and without complementarity: problems of the literature. */
#include "models.h"

struct problem {
    const char *name;
    swb_value_fn objective, constraints;
    int64_t n, m, n_pairs;
    int32_t kind[6];
    int64_t index[6];
    double x_lower[8], x_upper[8], c_lower[8], c_upper[8], start[8], solution[8], best;
};

#define FUNCTION(name, body)                                                                          \
    static int32_t name(const swb_point *at, double *out, void *user_data)                            \
    {                                                                                                 \
        const double *x = at->x;                                                                      \
        (void)user_data;                                                                              \
        body;                                                                                         \
        return 0;                                                                                     \
    }

#define INF (double)INFINITY
#define FREE {-INF, -INF, -INF, -INF, -INF, -INF, -INF, -INF}
#define NO_LIMIT {INF, INF, INF, INF, INF, INF, INF, INF}
#define V SWB_MEMBER_VARIABLE
#define C SWB_MEMBER_CONSTRAINT

FUNCTION(scheel_scholtes, out[0] = x[0] + x[1] - x[2])
FUNCTION(scheel_scholtes_rows, (out[0] = 4 * x[0] - x[2], out[1] = 4 * x[1] - x[2]))
FUNCTION(leyffer_munson, out[0] = (x[0] - 1) * (x[0] - 1) + x[1] * x[1] * (x[1] + 1))
FUNCTION(kth2, out[0] = x[0] + (x[1] - 1) * (x[1] - 1))
FUNCTION(ralph1, out[0] = 2 * x[0] - x[1])
FUNCTION(difference, out[0] = x[1] - x[0])
FUNCTION(jr1, out[0] = (x[0] - 1) * (x[0] - 1) + x[1] * x[1])
FUNCTION(bard1, out[0] = (x[0] - 5) * (x[0] - 5) + (2 * x[1] + 1) * (2 * x[1] + 1))
FUNCTION(bard1_rows, (out[0] = 2 * (x[1] - 1) - 1.5 * x[0] + x[2] - 0.5 * x[3] + x[4], out[1] = 3 * x[0] - x[1] - 3,
                      out[2] = -x[0] + 0.5 * x[1] + 4, out[3] = -x[0] - x[1] + 7))
FUNCTION(hs71, out[0] = x[0] * x[3] * (x[0] + x[1] + x[2]) + x[2])
FUNCTION(hs71_rows, (out[0] = x[0] * x[1] * x[2] * x[3],
                     out[1] = x[0] * x[0] + x[1] * x[1] + x[2] * x[2] + x[3] * x[3]))
FUNCTION(rosenbrock, out[0] = 100 * (x[1] - x[0] * x[0]) * (x[1] - x[0] * x[0]) + (1 - x[0]) * (1 - x[0]))

static const struct problem PROBLEMS[] = {
    /* B-stationary, not S-stationary: no multipliers of the right sign exist */
    {"Scheel-Scholtes", scheel_scholtes, scheel_scholtes_rows, 3, 2, 1, {V, V}, {0, 1}, FREE, NO_LIMIT, {0, 0},
     {INF, INF}, {1, 1, 1}, {0, 0, 0}, 0.0},
    /* (0, 0) is M-stationary with a direction of descent */
    {"Leyffer-Munson", leyffer_munson, NULL, 2, 0, 1, {V, V}, {0, 1}, FREE, NO_LIMIT, {0}, {0}, {0.1, 0.1}, {1, 0}, 0.0},
    {"kth2", kth2, NULL, 2, 0, 1, {V, V}, {0, 1}, FREE, NO_LIMIT, {0}, {0}, {1, 0.5}, {0, 1}, 0.0},
    {"ralph1", ralph1, difference, 2, 1, 1, {V, C}, {1, 0}, {0, -INF}, NO_LIMIT, {0}, {0}, {1, 1}, {0, 0}, 0.0},
    {"jr1", jr1, difference, 2, 1, 1, {V, C}, {1, 0}, FREE, NO_LIMIT, {0}, {0}, {0, 0}, {0.5, 0.5}, 0.5},
    {"bard1", bard1, bard1_rows, 5, 4, 3, {C, V, C, V, C, V}, {1, 2, 2, 3, 3, 4}, {0, 0, -INF, -INF, -INF}, NO_LIMIT,
     {0, 0, 0, 0}, {0, INF, INF, INF}, {1, 1, 1, 1, 1}, {1, 0, 3.5, 0, 0}, 17.0},
    {"hs71", hs71, hs71_rows, 4, 2, 0, {0}, {0}, {1, 1, 1, 1}, {5, 5, 5, 5}, {25, 40}, {INF, 40}, {1, 5, 5, 1},
     {1, 4.742999644, 3.821149978, 1.379408295}, 17.0140172891},
    {"rosenbrock", rosenbrock, NULL, 2, 0, 0, {0}, {0}, FREE, NO_LIMIT, {0}, {0}, {-1.2, 1}, {1, 1}, 0.0},
};

static swb_mpcc *make(const struct problem *p)
{
    swb_function *f = make_function("f", p->n, 0, 0, 1, p->objective, NULL), *c = NULL;
    swb_mpcc *mpcc = NULL;
    int64_t k;

    if (p->constraints)
        c = make_function("c", p->n, 0, 0, p->m, p->constraints, NULL);
    CHECK_OK(swb_mpcc_create(p->n, 0, f, c, NULL, &mpcc));
    swb_function_free(f);
    swb_function_free(c);
    for (k = 0; k < p->n_pairs; k++)
        CHECK_OK(swb_mpcc_add_pair(mpcc, p->kind[2 * k], p->index[2 * k], p->kind[2 * k + 1], p->index[2 * k + 1]));
    CHECK_OK(swb_mpcc_set_bounds(mpcc, p->x_lower, p->n, p->x_upper, p->n));
    CHECK_OK(swb_mpcc_set_constraint_bounds(mpcc, p->c_lower, p->m, p->c_upper, p->m));
    CHECK_OK(swb_mpcc_set_start(mpcc, p->start, p->n));
    return mpcc;
}

static void textbook(void)
{
    size_t i;

    for (i = 0; i < sizeof PROBLEMS / sizeof PROBLEMS[0]; i++) {
        const struct problem *p = &PROBLEMS[i];
        swb_mpcc *mpcc = make(p);
        int32_t outcome = -1;
        int64_t j;
        double f = -1.0, x[8], c[8], y[8], z[8], g[3], h[3], nu[3], xi[3];
        swb_residuals residuals;
        swb_stats stats;
        int failures = check_failures;

        CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
        CHECK(outcome == SWB_OUTCOME_SOLVED);
        CHECK_OK(swb_mpcc_get_objective(mpcc, &f));
        CHECK_NEAR(f, p->best, 1e-6);
        CHECK_OK(swb_mpcc_get_solution(mpcc, x, p->n));
        for (j = 0; j < p->n; j++)
            CHECK_NEAR(x[j], p->solution[j], 2e-5);
        CHECK_OK(swb_mpcc_get_constraints(mpcc, c, p->m));
        CHECK_OK(swb_mpcc_get_multipliers(mpcc, y, p->m, z, p->n));
        CHECK_OK(swb_mpcc_get_pairs(mpcc, g, h, nu, xi, p->n_pairs));
        CHECK_OK(swb_mpcc_get_pairs(mpcc, NULL, NULL, NULL, NULL, p->n_pairs));
        for (j = 0; j < p->n_pairs; j++)
            CHECK(g[j] > -1e-7 && h[j] > -1e-7 && fmin(g[j], h[j]) < 1e-4);
        CHECK_OK(swb_mpcc_get_residuals(mpcc, &residuals, sizeof residuals));
        CHECK(residuals.primal < 1e-8);
        CHECK_OK(swb_mpcc_get_stats(mpcc, &stats, sizeof stats));
        CHECK(stats.iterations > 0 && stats.n_pairs == p->n_pairs && stats.n_variables >= p->n);
        if (check_failures != failures)
            fprintf(stderr, "  in problem %s\n", p->name);
        swb_mpcc_free(mpcc);
    }
}

/* The sign and size of multipliers: min (x - 1)^2 + y^2, x + y = 3, y >= 2. */
FUNCTION(quadratic, out[0] = (x[0] - 1) * (x[0] - 1) + x[1] * x[1])
FUNCTION(sum, out[0] = x[0] + x[1])

static void multipliers(void)
{
    struct problem p = {"q", quadratic, sum, 2, 1, 0, {0}, {0}, {-INF, 2}, NO_LIMIT, {3}, {3}, {0, 0}, {1, 2}, 4.0};
    swb_mpcc *mpcc = make(&p);
    double y, z[2];

    CHECK_OK(swb_mpcc_solve(mpcc, NULL));
    CHECK_OK(swb_mpcc_get_multipliers(mpcc, &y, 1, z, 2));
    CHECK_NEAR(y, 0.0, 1e-6); /* 2 (x - 1) + y = 0 */
    CHECK_NEAR(z[1], 4.0, 1e-6); /* 2 y + y_c - z = 0 */
    swb_mpcc_free(mpcc);
}

/* Parameters: min (x - p)^2 with 0 <= x _|_ x2 >= 0; another value, the same structure. */
static int32_t tracking(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = (at->x[0] - at->p[0]) * (at->x[0] - at->p[0]) + (at->x[1] - at->p[1]) * (at->x[1] - at->p[1]);
    return 0;
}

static void parameters(void)
{
    swb_function *f = make_function("f", 2, 0, 2, 1, tracking, NULL);
    swb_mpcc *mpcc = NULL;
    swb_stats stats;
    double p[] = {3.0, 1.0}, x[2];

    CHECK_OK(swb_mpcc_create(2, 2, f, NULL, NULL, &mpcc));
    swb_function_free(f);
    CHECK_OK(swb_mpcc_add_pair(mpcc, V, 0, V, 1));
    CHECK_OK(swb_mpcc_set_params(mpcc, p, 2));
    CHECK_OK(swb_mpcc_solve(mpcc, NULL));
    CHECK_OK(swb_mpcc_get_solution(mpcc, x, 2));
    CHECK_NEAR(x[0], 3.0, 1e-6);
    CHECK(x[1] == 0.0);
    p[1] = 7.0;
    CHECK_OK(swb_mpcc_set_params(mpcc, p, 2));
    CHECK_OK(swb_mpcc_solve(mpcc, NULL));
    CHECK_OK(swb_mpcc_get_solution(mpcc, x, 2));
    CHECK_NEAR(x[1], 7.0, 1e-6);
    CHECK(x[0] == 0.0);
    CHECK_OK(swb_mpcc_get_stats(mpcc, &stats, sizeof stats));
    CHECK(stats.time_build == 0.0);
    swb_mpcc_free(mpcc);
}

FUNCTION(log_objective, out[0] = x[0] - log(x[0]))
FUNCTION(linear, out[0] = -x[0] - x[1])
FUNCTION(apart, (out[0] = x[0], out[1] = x[1]))

static void outcomes(void)
{
    struct problem domain = {"log", log_objective, NULL, 1, 0, 0, {0}, {0}, FREE, NO_LIMIT, {0}, {0}, {5}, {1}, 1.0};
    struct problem open = {"open", linear, NULL, 2, 0, 1, {V, V}, {0, 1}, FREE, NO_LIMIT, {0}, {0}, {1, 1}, {0}, 0.0};
    struct problem never = {"never", linear, apart, 2, 2, 1, {V, V}, {0, 1}, FREE, NO_LIMIT, {1, 1}, {9, 9}, {1, 1}, {0}, 0.0};
    swb_mpcc *mpcc = make(&domain);
    int32_t outcome = -1;
    double x[2];

    /* NaN on the way is survived. */
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK_OK(swb_mpcc_get_solution(mpcc, x, 1));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_NEAR(x[0], 1.0, 1e-6);
    /* NaN at the start is not. */
    x[0] = -1.0;
    CHECK_OK(swb_mpcc_set_start(mpcc, x, 1));
    CHECK_STATUS(SWB_ERR_NONFINITE, swb_mpcc_solve(mpcc, NULL));
    CHECK(strstr(swb_last_error(), "function 'f'") != NULL);
    CHECK_OK(swb_mpcc_get_outcome(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_FAILED);
    x[0] = 2.0;
    CHECK_OK(swb_mpcc_set_start(mpcc, x, 1));
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    swb_mpcc_free(mpcc);

    mpcc = make(&open);
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome != SWB_OUTCOME_SOLVED);
    swb_mpcc_free(mpcc);
    mpcc = make(&never);
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome != SWB_OUTCOME_SOLVED);
    swb_mpcc_free(mpcc);
}

static int32_t three(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = 2 * at->x[0] + at->x[1] - 3;
    out[1] = at->x[1] - at->x[0] + 5;
    out[2] = at->x[2] - 4;
    return 0;
}

static int32_t nothing(const swb_point *at, double *out, void *user_data)
{
    (void)at, (void)user_data;
    out[0] = 0;
    return 0;
}

/* A free variable, one held at its lower bound, one at its upper bound: x = (2, -1, 1), F = (0, 2, -3). */
static void boxes(void)
{
    swb_function *f = make_function("f", 3, 0, 0, 1, nothing, NULL), *c = make_function("c", 3, 0, 0, 3, three, NULL);
    swb_mpcc *mpcc = NULL;
    double lower[3] = {-INFINITY, -1, 0}, upper[3] = {INFINITY, INFINITY, 1}, x[3], rows[3];
    char name[16];
    int32_t outcome;
    int64_t k;

    CHECK_OK(swb_mpcc_create(3, 0, f, c, NULL, &mpcc));
    for (k = 0; k < 3; k++)
        CHECK_OK(swb_mpcc_add_box(mpcc, k, k));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_add_box(mpcc, 1, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_add_pair(mpcc, V, 0, C, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_add_box(mpcc, 3, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_add_box(mpcc, 0, -1));
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_add_box(NULL, 0, 0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_set_bounds(mpcc, upper, 3, lower, 3));
    CHECK_OK(swb_mpcc_set_name(mpcc, SWB_ITEM_BOX, 2, "gate"));
    CHECK_OK(swb_mpcc_get_name(mpcc, SWB_ITEM_BOX, 2, name, sizeof name, NULL));
    CHECK(strcmp(name, "gate") == 0);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_name(mpcc, SWB_ITEM_BOX, 3, "gate"));
    CHECK_OK(swb_mpcc_set_bounds(mpcc, lower, 3, upper, 3));
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_mpcc_get_solution(mpcc, x, 3));
    CHECK_OK(swb_mpcc_get_constraints(mpcc, rows, 3));
    CHECK_NEAR(x[0], 2, 1e-7);
    CHECK_NEAR(x[1], -1, 1e-7);
    CHECK_NEAR(x[2], 1, 1e-7);
    CHECK_NEAR(rows[0], 0, 1e-7);
    CHECK_NEAR(rows[1], 2, 1e-7);
    CHECK_NEAR(rows[2], -3, 1e-7);
    CHECK_OK(swb_mpcc_get_pairs(mpcc, NULL, NULL, NULL, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_get_pairs(mpcc, NULL, NULL, NULL, NULL, 2));
    /* other bounds are finite: the solution is started from although other pairs stand for the boxes */
    lower[0] = upper[0] = 0.5;
    lower[2] = -INFINITY;
    CHECK_OK(swb_mpcc_set_bounds(mpcc, lower, 3, upper, 3));
    CHECK_OK(swb_mpcc_resolve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_mpcc_get_solution(mpcc, x, 3));
    CHECK_NEAR(x[0], 0.5, 1e-7);
    CHECK_NEAR(x[1], -1, 1e-7);
    CHECK_NEAR(x[2], 1, 1e-7);
    swb_mpcc_free(mpcc);
    swb_function_free(f);
    swb_function_free(c);
}

/* x = max(p, 0) by its distance from p: slope 1 above zero, none below, and a kink between. */
static int32_t distance(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = (at->x[0] - at->p[0]) * (at->x[0] - at->p[0]);
    return 0;
}

static void derivatives(void)
{
    swb_function *f = make_function("f", 1, 0, 1, 1, distance, NULL);
    swb_mpcc *mpcc = NULL;
    double lower = 0, upper = INFINITY, p, x, slope, of_objective, weight = 3, nothing = (double)NAN;
    int32_t sides;
    int k;

    CHECK_OK(swb_mpcc_create(1, 1, f, NULL, NULL, &mpcc));
    CHECK_OK(swb_mpcc_set_bounds(mpcc, &lower, 1, &upper, 1));
    CHECK_STATUS(SWB_ERR_STATE, swb_mpcc_get_tangents(mpcc, &slope, 1, NULL, 0, NULL, 0));
    for (k = 0; k < 2; k++) {
        p = k ? 2 : -1;
        CHECK_OK(swb_mpcc_set_params(mpcc, &p, 1));
        CHECK_OK(swb_mpcc_solve(mpcc, NULL));
        CHECK_OK(swb_mpcc_get_tangents(mpcc, &slope, 1, &of_objective, 1, &sides, 1));
        CHECK_NEAR(slope, k, 1e-5);
        CHECK_NEAR(of_objective, k ? 0 : -2, 1e-4);
        CHECK(sides == SWB_SIDES_BOTH);
        CHECK_OK(swb_mpcc_vjp(mpcc, &weight, 1, 0, &x, 1, NULL, 0));
        CHECK_NEAR(x, 3 * k, 1e-4);
        CHECK_OK(swb_mpcc_vjp(mpcc, NULL, 0, 1, &x, 1, &sides, 1));
        CHECK_NEAR(x, k ? 0 : -2, 1e-4);
    }
    slope = 7;
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_get_tangents(mpcc, &slope, 2, NULL, 0, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_get_tangents(mpcc, &slope, 1, NULL, 0, &sides, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_vjp(mpcc, &weight, 2, 0, &slope, 1, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_vjp(mpcc, &weight, 1, 0, &slope, 0, NULL, 0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_vjp(mpcc, &nothing, 1, 0, &slope, 1, NULL, 0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_vjp(mpcc, &weight, 1, nothing, &slope, 1, NULL, 0));
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_vjp(NULL, &weight, 1, 0, &slope, 1, NULL, 0));
    CHECK(slope == 7);
    swb_mpcc_free(mpcc);
    swb_function_free(f);
}

static void refusals(void)
{
    swb_mpcc *mpcc = make(&PROBLEMS[5]), *none = NULL;
    swb_function *f = make_function("f", 2, 0, 0, 1, quadratic, NULL), *g = make_function("g", 2, 1, 0, 1, quadratic, NULL);
    swb_function *two = make_function("two", 2, 0, 0, 2, apart, NULL);
    double x[5] = {0, 0, 0, 0, 0}, y[5] = {1, 1, 1, 1, 1};

    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_create(2, 0, NULL, NULL, NULL, &none));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_create(3, 0, f, NULL, NULL, &none));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_create(-2, 0, f, NULL, NULL, &none));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_create(2, 0, g, NULL, NULL, &none));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_create(2, 0, two, NULL, NULL, &none));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_create(2, 0, f, g, NULL, &none));
    CHECK(none == NULL);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_add_pair(mpcc, V, 5, V, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_add_pair(mpcc, V, 0, C, -1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_add_pair(mpcc, 2, 0, V, 0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_add_pair(mpcc, V, 0, V, 0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_add_pair(mpcc, V, 0, C, 1)); /* is in a pair */
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_set_bounds(mpcc, y, 5, x, 5));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_bounds(mpcc, x, 4, y, 4));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_bounds(mpcc, x, 5, y, 4));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_constraint_bounds(mpcc, x, 5, y, 5));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_params(mpcc, x, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_set_start(mpcc, x, 4));
    x[3] = (double)NAN;
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_set_bounds(mpcc, x, 5, y, 5));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mpcc_set_start(mpcc, x, 5));
    CHECK_STATUS(SWB_ERR_STATE, swb_mpcc_get_solution(mpcc, x, 5));
    CHECK_STATUS(SWB_ERR_STATE, swb_mpcc_get_objective(mpcc, x));
    CHECK_OK(swb_mpcc_solve(mpcc, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_get_solution(mpcc, x, 4));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_get_multipliers(mpcc, y, 3, x, 5));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mpcc_get_pairs(mpcc, NULL, NULL, NULL, NULL, 2));
    /* A member bounded away from zero. */
    x[3] = 0.0;
    x[2] = y[2] = 0.5;
    CHECK_OK(swb_mpcc_set_bounds(mpcc, x, 5, y, 5));
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_mpcc_solve(mpcc, NULL));
    swb_mpcc_free(mpcc);
    swb_function_free(f);
    swb_function_free(g);
    swb_function_free(two);
}

int main(void)
{
    textbook();
    multipliers();
    parameters();
    outcomes();
    boxes();
    derivatives();
    refusals();
    return CHECK_DONE();
}
