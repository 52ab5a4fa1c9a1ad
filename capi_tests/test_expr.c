/* Expressions and models made of them. */
#include "check.h"

#include <math.h>
#include <stdlib.h>

enum { N_STATES = 2 };

/* x' = v, v' = -x + cos(t/2) - 0.4 sign(v) */
static swb_model *coulomb(swb_expr *g)
{
    int64_t z[N_STATES], t, c[3], a, b, rhs[N_STATES];
    const double numbers[] = {0.5, 0.4, 1.0}, x0[] = {1.0, 0.0};
    const swb_point start = {0.0, x0, NULL, NULL};
    swb_model *model = NULL;
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_X, 0, z, N_STATES));
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_T, 0, &t, 1));
    CHECK_OK(swb_expr_constants(g, numbers, 3, c, 3));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &t, &c[0], NULL, &a, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_COS, &a, NULL, NULL, &a, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SUB, &a, &z[0], NULL, &a, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SIGN, &z[1], NULL, NULL, &b, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &b, &c[1], NULL, &b, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SUB, &a, &b, NULL, &rhs[1], 1));
    rhs[0] = z[1];
    CHECK_OK(swb_model_create(g, "coulomb", N_STATES, 0, 0, rhs, "q\nv", &start, &model));
    return model;
}

/* What a unit of FMI cannot be; "/dev/null" serves as file and as library. */
static void units(const swb_model *m)
{
    static const double x0[8] = {0};
    const char *null = "/dev/null";
    CHECK_OK(swb_model_write_fmu(m, null, null, 2, x0, N_STATES, NULL, 0, NULL, 0, 1e-6, 1e-8, 1.0));
    CHECK_OK(swb_model_write_fmu(m, null, null, 3, x0, N_STATES, NULL, 0, NULL, 0, 1e-6, 1e-8, 1.0));
    CHECK_STATUS(SWB_ERR_NULL, swb_model_write_fmu(m, NULL, null, 2, x0, N_STATES, NULL, 0, NULL, 0, 1e-6, 1e-8, 1.0));
    CHECK_STATUS(SWB_ERR_NULL, swb_model_write_fmu(m, null, NULL, 2, x0, N_STATES, NULL, 0, NULL, 0, 1e-6, 1e-8, 1.0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_write_fmu(m, null, null, 1, x0, N_STATES, NULL, 0, NULL, 0, 1e-6, 1e-8, 1.0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_write_fmu(m, "/dev/no name", null, 2, x0, N_STATES, NULL, 0, NULL, 0, 1e-6, 1e-8, 1.0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_write_fmu(m, null, null, 2, x0, N_STATES + 1, NULL, 0, NULL, 0, 1e-6, 1e-8, 1.0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_write_fmu(m, null, null, 2, x0, N_STATES, NULL, 0, NULL, 0, 1e-6, 1e-8, 0.0));
}

static void models(void)
{
    swb_expr *g = NULL;
    swb_model *model;
    swb_system *system = NULL;
    swb_simulator *simulator = NULL;
    int64_t groups = 0, psi = 0, regions = 0, algebraic = 0, pairs = 0, needed = 0, nx = 0;
    char *text;
    CHECK_OK(swb_expr_create(&g));
    model = coulomb(g);
    swb_expr_free(g);
    CHECK_OK(swb_model_counts(model, &groups, &psi, &regions, &algebraic, &pairs));
    CHECK(groups == 1 && psi == 1 && regions == 2 && algebraic == 5 && pairs == 2);
    CHECK_OK(swb_model_report(model, 0, NULL, 0, &needed));
    text = malloc((size_t)needed);
    CHECK_OK(swb_model_report(model, 0, text, needed, NULL));
    CHECK(strstr(text, "v switch with v: 2 modes in 2 regions") != NULL);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_report(model, 0, text, needed - 1, NULL));
    free(text);
    CHECK_OK(swb_model_write_c(model, NULL, 0, &needed));
    CHECK(needed > 1000);
    units(model);
    CHECK_OK(swb_model_system(model, &system));
    swb_model_free(model);
    CHECK_OK(swb_system_sizes(system, &nx, NULL, NULL, NULL));
    CHECK(nx == N_STATES);
    CHECK_OK(swb_simulator_create(system, NULL, &simulator));
    swb_simulator_free(simulator);
    swb_system_free(system);
}

static void functions(void)
{
    swb_expr *g = NULL;
    swb_function *f = NULL;
    int64_t x[4], y[2], product[4], jac[4], col_ptr[6], row_idx[4], nnz = 0, m = 0;
    const double at_x[] = {2.0, 1.0, 1.0, 3.0}, points[] = {0.0, 1.0, 2.0}, values[] = {0.0, 1.0, 4.0};
    const swb_point at = {0.0, at_x, NULL, NULL};
    double out[2], weights[] = {1.0, 1.0};
    int32_t passed = 0;
    CHECK_OK(swb_expr_create(&g));
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_X, 0, x, 4));
    /* Solution of [2 1; 1 3] y = (x0, x3), the squares of the elements, interpolated. */
    CHECK_OK(swb_expr_solve(g, x, 4, (const int64_t[]){x[0], x[3]}, y, 2));
    CHECK_OK(swb_expr_matmul(g, 2, 1, 2, y, 2, y, 2, product, 4));
    CHECK_OK(swb_expr_table(g, SWB_TABLE_SPLINE, points, 3, values, 3, y, product, 2));
    CHECK_OK(swb_expr_function(g, "f", 4, 0, 0, product, 2, &f));
    CHECK_OK(swb_function_eval(f, &at, out, 2));
    CHECK_NEAR(out[0], 0.36, 1e-14);
    CHECK_NEAR(out[1], 0.64, 1e-14);
    CHECK_OK(swb_function_check_derivatives(f, &at, &passed, NULL, NULL, 0, NULL));
    CHECK(passed);
    CHECK_STATUS(SWB_ERR_STATE, swb_function_set_linear(f));
    /* The function as a node. */
    {
        const int64_t args[] = {x[0], x[1], x[2], x[3], x[0]};
        int64_t called[2];
        CHECK_OK(swb_expr_call(g, f, args, 5, called, 2));
        CHECK_STATUS(SWB_ERR_DIMENSION, swb_expr_call(g, f, args, 4, called, 2));
    }
    swb_function_free(f);
    /* x0 x1 by expressions: the derivative with respect to x0 is x1. */
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &x[0], &x[1], NULL, y, 1));
    CHECK_OK(swb_expr_jacobian(g, y, 1, x, 4, jac, 4));
    CHECK(jac[0] == x[1] && jac[1] == x[0] && jac[2] == jac[3]);
    CHECK_OK(swb_expr_function(g, "f", 4, 0, 0, y, 1, &f));
    CHECK_OK(swb_function_sizes(f, NULL, NULL, NULL, &m, &nnz, NULL));
    CHECK(m == 1 && nnz == 2);
    CHECK_OK(swb_function_jacobian_pattern(f, col_ptr, 6, row_idx, 2));
    CHECK(col_ptr[1] == 1 && col_ptr[2] == 2 && col_ptr[5] == 2);
    CHECK_OK(swb_function_eval_hessian(f, &at, weights, 1, out, 1));
    CHECK(out[0] == 1.0);
    swb_function_free(f);
    swb_expr_free(g);
}

/* Inner problems: the signed distance of an ellipse and a circle, an inverse function, a least value. */
static void inner(void)
{
    swb_expr *g = NULL;
    swb_function *f = NULL;
    int64_t x[2], d[2], w[2], squares[2], two, four, parts[2], support, out[5], least, product, energy;
    double value[5];
    const double at_x[] = {0.0, 3.0}, constants[] = {4.0, 2.0};
    const swb_point at = {0.0, at_x, NULL, NULL};
    int32_t passed = 0;
    CHECK_OK(swb_expr_create(&g));
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_X, 0, x, 2));
    CHECK_OK(swb_expr_unknowns(g, d, 2));
    CHECK_OK(swb_expr_unknowns(g, w, 2));
    CHECK(d[0] != w[0]);
    CHECK_OK(swb_expr_constants(g, &constants[0], 1, &four, 1));
    CHECK_OK(swb_expr_constants(g, &constants[1], 1, &two, 1));
    /* sqrt(4 d0^2 + d1^2) + sqrt(d0^2 + d1^2): semi-axes 2 and 1, and a circle of radius 1 */
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, d, d, NULL, squares, 2));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &four, squares, NULL, &product, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_ADD, &product, &squares[1], NULL, &parts[0], 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_ADD, &squares[0], &squares[1], NULL, &parts[1], 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SQRT, parts, NULL, NULL, parts, 2));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_ADD, &parts[0], &parts[1], NULL, &support, 1));
    CHECK_OK(swb_expr_signed_distance(g, x, support, d, x, 2.0, &out[0], &out[1], 2));
    /* w0^2 = x1 + 1, and the least value of w1^2 - 2 x1 w1 */
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, w, w, NULL, squares, 2));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SUB, &squares[0], &x[1], NULL, &product, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SUB, &product, &four, NULL, &product, 1));
    CHECK_OK(swb_expr_implicit(g, &product, w, &two, &out[3], 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &w[1], &x[1], NULL, &product, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &two, &product, NULL, &product, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SUB, &squares[1], &product, NULL, &product, 1));
    CHECK_OK(swb_expr_inner_minimum(g, product, &w[1], &two, &least, &out[4], 1));
    out[4] = least;
    CHECK_OK(swb_expr_function(g, "inner", 2, 0, 0, out, 5, &f));
    CHECK_OK(swb_function_eval(f, &at, value, 5));
    CHECK_NEAR(value[0], 1.0, 1e-14);
    CHECK_NEAR(value[1], 0.0, 1e-14);
    CHECK_NEAR(value[2], 1.0, 1e-14);
    CHECK_NEAR(value[3], sqrt(7.0), 1e-14);
    CHECK_NEAR(value[4], -9.0, 1e-14);
    CHECK_OK(swb_function_check_derivatives(f, &at, &passed, NULL, NULL, 0, NULL));
    CHECK(passed);
    swb_function_free(f);
    /* T = x0 x1^2 / 2 and V = 4 x0: the force -4 + x1^2 / 2 - x1^2 */
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &four, x, NULL, &energy, 1));
    CHECK_OK(swb_expr_lagrangian_forces(g, x, 1, energy, x, &x[1], out, 1));
    CHECK_OK(swb_expr_function(g, "force", 2, 0, 0, out, 1, &f));
    CHECK_OK(swb_function_eval(f, &at, value, 1));
    CHECK_NEAR(value[0], -8.5, 1e-14);
    swb_function_free(f);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_expr_lagrangian_forces(g, x, 2, product, x, &x[1], out, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_lagrangian_forces(g, x, 1, product, &product, &x[1], out, 1));
    /* not inner problems */
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_implicit(g, &product, x, &two, out, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_implicit(g, w, w, w, out, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_signed_distance(g, x, support, d, x, -1.0, out, out, 2));
    CHECK_STATUS(SWB_ERR_NULL, swb_expr_inner_minimum(g, product, &w[1], &two, NULL, out, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_function(g, "f", 2, 0, 0, w, 1, &f));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_expr_unknowns(g, w, -1));
    swb_expr_free(g);
}

/* A cost with a kink, |u| + q^2 / 2: its values and one-sided derivatives, where it belongs, and where it does not. */
static void kinks(void)
{
    swb_expr *g = NULL;
    swb_function *f = NULL, *other = NULL;
    swb_model *model = NULL;
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    int64_t z[2], modulus, square, half, cost, m = 0, nnz = 0;
    const double q[] = {3.0}, u[] = {-2.0}, number = 0.5, up = 1.0;
    const swb_point at = {0.0, q, u, NULL};
    double out[2];
    CHECK_OK(swb_expr_create(&g));
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_X, 0, &z[0], 1));
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_U, 0, &z[1], 1));
    CHECK_OK(swb_expr_constants(g, &number, 1, &half, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_ABS, &z[1], NULL, NULL, &modulus, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &z[0], &z[0], NULL, &square, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &square, &half, NULL, &square, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_ADD, &modulus, &square, NULL, &cost, 1));
    CHECK_OK(swb_expr_function(g, "cost", 1, 1, 0, &cost, 1, &f));
    CHECK_OK(swb_function_sizes(f, NULL, NULL, NULL, &m, &nnz, NULL));
    CHECK(m == 1 && nnz == 2);
    CHECK_OK(swb_function_eval(f, &at, out, 1));
    CHECK_NEAR(out[0], 6.5, 1e-15);
    CHECK_OK(swb_function_eval_jacobian(f, &at, out, 2));
    CHECK(out[0] == 3.0 && out[1] == -1.0);
    CHECK_OK(swb_model_create(g, "integrator", 1, 1, 0, &z[1], NULL, NULL, &model));
    CHECK_OK(swb_model_system(model, &system));
    CHECK_OK(swb_ocp_create(system, 1.0, 4, NULL, &ocp));
    CHECK_OK(swb_ocp_set_lagrange(ocp, f));
    CHECK_OK(swb_ocp_set_mayer(ocp, f));
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_ocp_add_path(ocp, f, NULL, 0, &up, 1, SWB_PATH_AT_CONTROL_GRID));
    CHECK(strstr(swb_last_error(), "-b <= a <= b") != NULL);
    /* a kink in a state is between the stages */
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_ABS, &z[0], NULL, NULL, &modulus, 1));
    CHECK_OK(swb_expr_function(g, "far", 1, 1, 0, &modulus, 1, &other));
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_ocp_set_lagrange(ocp, other));
    CHECK_OK(swb_ocp_set_mayer(ocp, other));
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_model_free(model);
    swb_function_free(other);
    swb_function_free(f);
    swb_expr_free(g);
}

static void refusals(void)
{
    swb_expr *g = NULL;
    swb_function *f = NULL;
    swb_model *model = NULL;
    int64_t x[2], c, y, id = 7;
    char text[8];
    const double nan_value = NAN;
    CHECK_STATUS(SWB_ERR_NULL, swb_expr_create(NULL));
    CHECK_OK(swb_expr_create(&g));
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_X, 0, x, 2));
    CHECK_STATUS(SWB_ERR_NULL, swb_expr_inputs(NULL, SWB_INPUT_X, 0, x, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_inputs(g, 3, 0, x, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_expr_inputs(g, SWB_INPUT_T, 1, x, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_expr_inputs(g, SWB_INPUT_X, -1, x, 1));
    CHECK_STATUS(SWB_ERR_NULL, swb_expr_inputs(g, SWB_INPUT_X, 0, NULL, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_apply(g, 999, x, NULL, NULL, &y, 1));
    CHECK_STATUS(SWB_ERR_NULL, swb_expr_apply(g, SWB_OPERATOR_ADD, x, NULL, NULL, &y, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_expr_apply(g, SWB_OPERATOR_SIN, x, x, NULL, &y, 1));
    id = 1000;
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_apply(g, SWB_OPERATOR_SIN, &id, NULL, NULL, &y, 1));
    id = -1;
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_apply(g, SWB_OPERATOR_SIN, &id, NULL, NULL, &y, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_POSITIVE, x, NULL, NULL, &c, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_apply(g, SWB_OPERATOR_SIN, &c, NULL, NULL, &y, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_apply(g, SWB_OPERATOR_NOT, x, NULL, NULL, &y, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_solve(g, &c, 1, x, &y, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_expr_solve(g, x, 2, x, x, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_expr_matmul(g, 1, 2, 2, x, 2, x, 2, &y, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_table(g, 9, NULL, 0, &nan_value, 1, x, &y, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_table(g, SWB_TABLE_STEPS, NULL, 0, &nan_value, 1, x, &y, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_jacobian(g, x, 1, &c, 1, &y, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_expr_function(g, "f", 2, 0, 0, &c, 1, &f));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_expr_function(g, "f", 1, 0, 0, x, 2, &f));
    CHECK_STATUS(SWB_ERR_NULL, swb_expr_function(g, NULL, 2, 0, 0, x, 2, &f));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SIGN, x, NULL, NULL, &y, 1));
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_expr_function(g, "f", 2, 0, 0, &y, 1, &f));
    CHECK_OK(swb_expr_constants(g, &nan_value, 1, &y, 1));
    CHECK_STATUS(SWB_ERR_NONFINITE, swb_expr_function(g, "f", 2, 0, 0, &y, 1, &f));
    CHECK(f == NULL);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_create(g, "m", 0, 0, 0, NULL, NULL, NULL, &model));
    CHECK_STATUS(SWB_ERR_NULL, swb_model_create(g, "m", 2, 0, 0, NULL, NULL, NULL, &model));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_create(g, "m", 1, 0, 0, &c, NULL, NULL, &model));
    CHECK(model == NULL);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_expr_text(g, x[0], text, 2, NULL));
    CHECK_OK(swb_expr_text(g, x[0], text, 8, NULL));
    CHECK_TEXT("x[0]", text);
    CHECK_STATUS(SWB_ERR_NULL, swb_model_counts(NULL, NULL, NULL, NULL, NULL, NULL));
    swb_expr_free(g);
    swb_expr_free(NULL);
    swb_model_free(NULL);
}

/* Moduli inside of moduli: more branches than can be listed, so that modes are formed on demand. */
enum { N_FOLDS = 12 };

static double folded(double x)
{
    for (int k = 0; k < N_FOLDS; k++)
        x = fabs(x) - ldexp(1.0, -k - 1);
    return x;
}

/* x' = 1, q' = folded(x): the integral of a function that is linear between the points of a fine grid. */
static void modes_on_demand(void)
{
    enum { N_PIECES = 1 << (N_FOLDS + 1) };
    const double x0[] = {-0.7, 0.0};
    swb_expr *g = NULL;
    swb_model *model = NULL;
    swb_system *system = NULL;
    const double tolerance = 1e-9;
    swb_integrator *integrator = NULL;
    swb_simulator *simulator = NULL;
    swb_ocp *ocp = NULL;
    int64_t x, rhs[2], half;
    int32_t outcome = -1;
    double expected = 0.0, state[2];
    CHECK_OK(swb_expr_create(&g));
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_X, 0, &x, 1));
    rhs[1] = x;
    for (int k = 0; k < N_FOLDS; k++) {
        const double offset = ldexp(1.0, -k - 1);
        CHECK_OK(swb_expr_constants(g, &offset, 1, &half, 1));
        CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_ABS, &rhs[1], NULL, NULL, &rhs[1], 1));
        CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SUB, &rhs[1], &half, NULL, &rhs[1], 1));
    }
    CHECK_OK(swb_expr_constants(g, (const double[]){1.0}, 1, &rhs[0], 1));
    CHECK_OK(swb_model_create(g, "folds", 2, 0, 0, rhs, NULL, NULL, &model));
    CHECK_OK(swb_model_system(model, &system));
    /* one eighth of a unit is passed, over some five hundred of the points of the grid */
    for (int k = 0; k < N_PIECES; k++)
        expected += 0.125 / N_PIECES * folded(x0[0] + 0.125 * (k + 0.5) / N_PIECES);
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_set_tolerances(integrator, &tolerance, 1, &tolerance, 1));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, x0, 2));
    CHECK_OK(swb_integrator_advance(integrator, 0.125, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_state(integrator, state, 2));
    CHECK_NEAR(state[1], expected, 1e-7);
    /* what needs all modes says so when it is made */
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_simulator_create(system, NULL, &simulator));
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_ocp_create(system, 1.0, 5, NULL, &ocp));
    CHECK(simulator == NULL && ocp == NULL && strstr(swb_last_error(), "on demand") != NULL);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_model_free(model);
    swb_expr_free(g);
}

int main(void)
{
    models();
    functions();
    inner();
    modes_on_demand();
    kinks();
    refusals();
    return CHECK_DONE();
}
