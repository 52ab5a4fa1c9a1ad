/* Functions: values and derivatives, patterns, the checker, who keeps them alive, every refusal. */
#include "models.h"

/* (x0^2 u + sin(x1 t), exp(x2) p); the inputs are x0 x1 x2 u p t. */
struct log {
    int values, jacobians, hessians, destroyed;
};

static int32_t value(const swb_point *at, double *out, void *user_data)
{
    ((struct log *)user_data)->values++;
    if (out[0] != 0.0 || out[1] != 0.0)
        return -9;
    out[0] = at->x[0] * at->x[0] * at->u[0] + sin(at->x[1] * at->t);
    out[1] = exp(at->x[2]) * at->p[0];
    return 0;
}

static int32_t jacobian(const swb_point *at, double *out, void *user_data)
{
    double phase = at->x[1] * at->t;
    ((struct log *)user_data)->jacobians++;
    out[0] = 2.0 * at->x[0] * at->u[0];
    out[1] = cos(phase) * at->t;
    out[2] = exp(at->x[2]) * at->p[0];
    out[3] = at->x[0] * at->x[0];
    out[4] = exp(at->x[2]);
    out[5] = cos(phase) * at->x[1];
    return 0;
}

static int32_t hessian(const swb_point *at, const double *w, double *out, void *user_data)
{
    double phase = at->x[1] * at->t;
    ((struct log *)user_data)->hessians++;
    out[0] = w[0] * 2.0 * at->u[0];
    out[1] = -w[0] * sin(phase) * at->t * at->t;
    out[2] = w[1] * exp(at->x[2]) * at->p[0];
    out[3] = w[0] * 2.0 * at->x[0];
    out[4] = w[1] * exp(at->x[2]);
    out[5] = w[0] * (cos(phase) - sin(phase) * phase);
    out[6] = -w[0] * sin(phase) * at->x[1] * at->x[1];
    return 0;
}

static void destroyed(void *user_data)
{
    ((struct log *)user_data)->destroyed++;
}

static const int64_t JP[] = {0, 1, 2, 3, 4, 5, 6}, JI[] = {0, 0, 1, 0, 1, 0};
static const int64_t HP[] = {0, 1, 2, 3, 4, 5, 7}, HI[] = {0, 1, 2, 0, 2, 1, 5};
static const double X[] = {0.7, -1.3, 2.1}, U[] = {0.9}, P[] = {1.7};
static const swb_point AT = {0.4, X, U, P};

static swb_function *make(struct log *log)
{
    swb_function *f = NULL;
    CHECK_OK(swb_function_create("f", 3, 1, 1, 2, value, log, destroyed, &f));
    return f;
}

static void derivatives(void)
{
    struct log log = {0, 0, 0, 0};
    swb_function *f = make(&log);
    double out[2], jac[6], by_differences[6], hess[7], exact[7], second[7];
    static const double w[] = {0.8, -1.1};
    int64_t nx, nu, np, n_out, jnz, hnz, col_ptr[7], row_idx[8];
    char name[8];
    int i;

    CHECK_OK(swb_function_eval(f, &AT, out, 2));
    CHECK_NEAR(out[0], 0.49 * 0.9 + sin(-0.52), 1e-15);
    CHECK_OK(swb_function_name(f, name, sizeof name, NULL));
    CHECK_TEXT("f", name);

    /* Dense in x, u and p by default. */
    CHECK_OK(swb_function_sizes(f, &nx, &nu, &np, &n_out, &jnz, &hnz));
    CHECK(nx == 3 && nu == 1 && np == 1 && n_out == 2 && jnz == 10 && hnz == 15);
    CHECK_OK(swb_function_set_inputs(f, SWB_INPUT_X + SWB_INPUT_T));
    CHECK_OK(swb_function_sizes(f, NULL, NULL, NULL, NULL, &jnz, &hnz));
    CHECK(jnz == 8 && hnz == 10);
    CHECK_OK(swb_function_jacobian_pattern(f, col_ptr, 7, row_idx, 8));
    CHECK(col_ptr[3] == 6 && col_ptr[5] == 6 && col_ptr[6] == 8 && row_idx[7] == 1);

    /* The pattern alone, then the values. */
    CHECK_OK(swb_function_set_jacobian(f, JP, 7, JI, 6, NULL));
    CHECK_OK(swb_function_eval_jacobian(f, &AT, by_differences, 6));
    CHECK_OK(swb_function_set_hessian(f, HP, 7, HI, 7, NULL));
    CHECK_OK(swb_function_eval_hessian(f, &AT, w, 2, second, 7));
    CHECK(log.jacobians == 0);
    CHECK_OK(swb_function_set_jacobian(f, JP, 7, JI, 6, jacobian));
    CHECK_OK(swb_function_eval_jacobian(f, &AT, jac, 6));
    CHECK(log.jacobians == 1 && jac[0] == 2.0 * 0.7 * 0.9);
    for (i = 0; i < 6; i++)
        CHECK_NEAR(jac[i], by_differences[i], 1e-8);
    CHECK_OK(swb_function_eval_hessian(f, &AT, w, 2, hess, 7));
    CHECK(log.hessians == 0);
    CHECK_OK(swb_function_set_hessian(f, HP, 7, HI, 7, hessian));
    CHECK_OK(swb_function_eval_hessian(f, &AT, w, 2, exact, 7));
    CHECK(log.hessians == 1);
    for (i = 0; i < 7; i++) {
        CHECK_NEAR(hess[i], exact[i], 1e-8);
        CHECK_NEAR(second[i], exact[i], 1e-5);
    }
    CHECK_OK(swb_function_hessian_pattern(f, col_ptr, 7, row_idx, 7));
    CHECK(col_ptr[6] == 7 && row_idx[6] == 5);
    CHECK_OK(swb_function_set_linear(f));
    CHECK_OK(swb_function_sizes(f, NULL, NULL, NULL, NULL, NULL, &hnz));
    CHECK(hnz == 0);
    CHECK_OK(swb_function_eval_hessian(f, &AT, w, 2, NULL, 0));
    swb_function_free(f);
    CHECK(log.destroyed == 1);
}

static int32_t wrong_jacobian(const swb_point *at, double *out, void *user_data)
{
    jacobian(at, out, user_data);
    out[2] *= 1.01;
    return 0;
}

static void checker(void)
{
    static const int64_t narrow_ptr[] = {0, 1, 2, 3, 4, 5, 5};
    struct log log = {0, 0, 0, 0};
    swb_function *f = make(&log);
    int32_t passed = -1;
    double worst = -1.0, bad[] = {0.0, (double)NAN, 0.0};
    int64_t needed = 0;
    char text[2048];
    swb_point at = AT;

    CHECK_OK(swb_function_set_jacobian(f, JP, 7, JI, 6, jacobian));
    CHECK_OK(swb_function_set_hessian(f, HP, 7, HI, 7, hessian));
    CHECK_OK(swb_function_check_derivatives(f, &AT, &passed, &worst, text, sizeof text, &needed));
    CHECK(passed == 1 && worst < 1e-7 && needed == (int64_t)strlen(text) + 1);

    CHECK_OK(swb_function_set_jacobian(f, JP, 7, JI, 6, wrong_jacobian));
    CHECK_OK(swb_function_check_derivatives(f, &AT, &passed, &worst, text, sizeof text, NULL));
    CHECK(passed == 0 && worst > 5e-3 && strstr(text, "out[1]") && strstr(text, "x[2]"));

    /* Not declared: the dependence on time. */
    CHECK_OK(swb_function_set_jacobian(f, narrow_ptr, 7, JI, 5, NULL));
    CHECK_OK(swb_function_check_derivatives(f, &AT, &passed, NULL, text, sizeof text, NULL));
    CHECK(passed == 0 && strstr(text, "missing in Jacobian pattern"));

    CHECK_OK(swb_function_check_derivatives(f, &AT, NULL, NULL, NULL, 0, &needed));
    passed = 55;
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_check_derivatives(f, &AT, &passed, NULL, text, needed - 1, NULL));
    CHECK(passed == 55);
    at.x = bad;
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_check_derivatives(f, &at, &passed, NULL, NULL, 0, NULL));
    swb_function_free(f);
}

static void lifetimes(void)
{
    struct log modes = {0, 0, 0, 0}, psi = {0, 0, 0, 0}, third = {0, 0, 0, 0};
    static const int64_t rows[] = {0, 1};
    static const int8_t signs[] = {-1, 1};
    swb_function *f = NULL, *g = NULL, *h = NULL;
    swb_system *system = NULL;
    swb_simulator *sim = NULL;

    CHECK_OK(swb_function_create("F", 2, 0, 0, 4, oscillator_modes, &modes, destroyed, &f));
    CHECK_OK(swb_function_create("c", 2, 0, 0, 1, circle, &psi, destroyed, &g));
    CHECK_OK(swb_system_create(2, 0, 0, &system));
    CHECK_OK(swb_system_add_subsystem(system, rows, 2, f, 2, g, signs, 2, NULL));
    /* It belongs to a model: its description is fixed. */
    CHECK_STATUS(SWB_ERR_STATE, swb_function_set_linear(f));
    CHECK_STATUS(SWB_ERR_STATE, swb_function_set_inputs(f, SWB_INPUT_X));
    CHECK_STATUS(SWB_ERR_STATE, swb_function_set_jacobian(f, DENSE_4X2, 4, DENSE_4X2_ROWS, 8, NULL));
    CHECK(strstr(swb_last_error(), "'F'") != NULL);
    swb_function_free(f);
    swb_function_free(g);
    CHECK(modes.destroyed == 0 && psi.destroyed == 0);
    CHECK_OK(swb_simulator_create(system, NULL, &sim));
    swb_system_free(system);
    CHECK(modes.destroyed == 0 && psi.destroyed == 0);
    CHECK_OK(swb_simulator_set_state(sim, 0.0, OSCILLATOR_X0, 2));
    CHECK_OK(swb_simulator_step(sim, 0.1, NULL));
    swb_simulator_free(sim);
    CHECK(modes.destroyed == 1 && psi.destroyed == 1);

    /* A failed constructor leaves the user data to the caller. */
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_create("f", -1, 0, 0, 1, value, &third, destroyed, &h));
    CHECK(h == NULL && third.destroyed == 0);
    swb_function_free(NULL);
}

static int32_t fails(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    out[0] = (double)NAN;
    return *(int32_t *)user_data;
}

static void refusals(void)
{
    struct log log = {0, 0, 0, 0};
    swb_function *f = make(&log), *g = NULL;
    int32_t code = -42;
    double out[3] = {5.0, 5.0, 5.0};
    static const int64_t decreasing[] = {0, 1, 0, 3, 4, 5, 6}, negative[] = {0, 0, -1, 0, 1, 0};
    static const int64_t unsorted_ptr[] = {0, 2, 2, 2, 2, 2, 2}, unsorted[] = {1, 0}, large[] = {0, 2};
    static const int64_t lower_ptr[] = {0, 1, 1, 1, 1, 1, 1}, lower[] = {1};
    swb_point at = AT;

    CHECK_STATUS(SWB_ERR_NULL, swb_function_create(NULL, 3, 1, 1, 2, value, NULL, NULL, &g));
    CHECK_STATUS(SWB_ERR_NULL, swb_function_create("g", 3, 1, 1, 2, NULL, NULL, NULL, &g));
    CHECK_STATUS(SWB_ERR_NULL, swb_function_create("g", 3, 1, 1, 2, value, NULL, NULL, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_create("\xff", 3, 1, 1, 2, value, NULL, NULL, &g));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_create("g", 3, 1, -1, 2, value, NULL, NULL, &g));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_create("g", 3, INT64_MAX, 1, 2, value, NULL, NULL, &g));
    CHECK(g == NULL);

    CHECK_STATUS(SWB_ERR_NULL, swb_function_set_jacobian(NULL, JP, 7, JI, 6, jacobian));
    CHECK_STATUS(SWB_ERR_NULL, swb_function_set_jacobian(f, NULL, 7, JI, 6, jacobian));
    CHECK_STATUS(SWB_ERR_NULL, swb_function_set_jacobian(f, JP, 7, NULL, 6, jacobian));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_set_jacobian(f, JP, 6, JI, 5, jacobian));
    CHECK(strstr(swb_last_error(), "Jacobian of 'f'") && strstr(swb_last_error(), "expected 7"));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_set_jacobian(f, JP, 7, JI, 5, jacobian));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_set_jacobian(f, JP, -7, JI, 6, jacobian));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_set_jacobian(f, decreasing, 7, JI, 6, jacobian));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_set_jacobian(f, JP, 7, negative, 6, jacobian));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_set_jacobian(f, unsorted_ptr, 7, unsorted, 2, jacobian));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_set_jacobian(f, unsorted_ptr, 7, large, 2, jacobian));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_set_hessian(f, lower_ptr, 7, lower, 1, hessian));
    CHECK(strstr(swb_last_error(), "upper triangle") != NULL);
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_set_inputs(f, 16));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_set_inputs(f, -1));

    CHECK_STATUS(SWB_ERR_NULL, swb_function_eval(f, NULL, out, 2));
    CHECK_STATUS(SWB_ERR_NULL, swb_function_eval(f, &AT, NULL, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_eval(f, &AT, out, 3));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_eval_hessian(f, &AT, X, 3, out, 3));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_jacobian_pattern(f, NULL, 0, NULL, 0));
    at.p = NULL;
    CHECK_STATUS(SWB_ERR_NULL, swb_function_eval(f, &at, out, 2));
    CHECK(strstr(swb_last_error(), "at->p") != NULL);
    CHECK(out[0] == 5.0 && out[1] == 5.0);
    swb_function_free(f);

    /* Codes of the callback. */
    g = make_function("g", 3, 1, 1, 1, fails, &code);
    CHECK_STATUS(SWB_ERR_USER, swb_function_eval(g, &AT, out, 1));
    CHECK(swb_last_user_code() == -42 && strstr(swb_last_error(), "'g'") != NULL);
    CHECK_STATUS(SWB_ERR_USER, swb_function_eval_jacobian(g, &AT, out, 4));
    CHECK_STATUS(SWB_ERR_USER, swb_function_check_derivatives(g, &AT, NULL, NULL, NULL, 0, NULL));
    code = 3;
    CHECK_STATUS(SWB_ERR_NONFINITE, swb_function_eval(g, &AT, out, 1));
    CHECK(swb_last_user_code() == 0 && strstr(swb_last_error(), "code 3") != NULL);
    code = 0;
    CHECK_STATUS(SWB_ERR_NONFINITE, swb_function_eval(g, &AT, out, 1));
    CHECK(strstr(swb_last_error(), "not finite") != NULL);
    CHECK(out[0] == 5.0);
    swb_function_free(g);
}

int main(void)
{
    derivatives();
    checker();
    lifetimes();
    refusals();
    return CHECK_DONE();
}
