#include "problems.h"

#include <stdio.h>
#include <stdlib.h>

const double friction_start[FRICTION_NX] = {0.0, -0.4}, friction_push[FRICTION_NU] = {0.9}, friction_params[FRICTION_NP] = {0.3};

void must(swb_status status, const char *what)
{
    if (status == SWB_OK)
        return;
    fprintf(stderr, "%s: %s: %s\n", what, swb_status_name(status), swb_last_error());
    exit(2);
}

/* --- callbacks: what they do is decided by the user data they share --- */

static int32_t answer(void *user_data, double *out, int n, const double *values)
{
    int32_t code = user_fault(user_data, out, n);
    if (code == USER_GOES_ON) {
        for (int i = 0; i < n; i++)
            out[i] = values[i];
        code = 0;
    }
    return code;
}

static int32_t modes(const swb_point *at, double *out, void *user_data)
{
    const double values[] = {at->p[0], -at->p[0]}; /* v < 0, v > 0 */
    return answer(user_data, out, 2, values);
}

static int32_t speed(const swb_point *at, double *out, void *user_data)
{
    return answer(user_data, out, 1, &at->x[1]);
}

static int32_t f0(const swb_point *at, double *out, void *user_data)
{
    const double values[] = {at->x[1], at->u[0] - 0.1 * at->x[1] * at->x[1] * at->x[1]};
    return answer(user_data, out, 2, values);
}

static int32_t cost(const swb_point *at, double *out, void *user_data)
{
    const double value = at->u[0] * at->u[0] + 0.1 * at->x[1] * at->x[1];
    return answer(user_data, out, 1, &value);
}

static int32_t goal(const swb_point *at, double *out, void *user_data)
{
    const double value = 10.0 * (at->x[0] - 1.0) * (at->x[0] - 1.0);
    return answer(user_data, out, 1, &value);
}

static swb_function *function(const char *name, int64_t nx, int64_t nu, int64_t np, int64_t n_out, swb_value_fn value,
                              struct user *user)
{
    swb_function *f = NULL;
    MUST(swb_function_create(name, nx, nu, np, n_out, value, user, NULL, &f));
    return f;
}

void friction_create(struct friction *out)
{
    static const int64_t row[] = {1};
    static const int8_t signs[] = {-1, 1};
    struct user *user = out->user = user_new(1, FRICTION_NX, FRICTION_NU, FRICTION_NP, 0);
    out->modes = function("modes", FRICTION_NX, FRICTION_NU, FRICTION_NP, 2, modes, user);
    MUST(swb_function_set_inputs(out->modes, SWB_INPUT_P));
    out->speed = function("speed", FRICTION_NX, FRICTION_NU, FRICTION_NP, 1, speed, user);
    MUST(swb_function_set_inputs(out->speed, SWB_INPUT_X));
    out->f0 = function("f0", FRICTION_NX, FRICTION_NU, FRICTION_NP, 2, f0, user);
    out->cost = function("cost", FRICTION_NX, FRICTION_NU, FRICTION_NP, 1, cost, user);
    out->goal = function("goal", FRICTION_NX, FRICTION_NU, FRICTION_NP, 1, goal, user);
    MUST(swb_system_create(FRICTION_NX, FRICTION_NU, FRICTION_NP, &out->system));
    MUST(swb_system_set_f0(out->system, out->f0));
    MUST(swb_system_add_subsystem(out->system, row, 1, out->modes, 2, out->speed, signs, 2, NULL));
}

void friction_free(struct friction *of)
{
    swb_system_free(of->system);
    swb_function_free(of->modes);
    swb_function_free(of->speed);
    swb_function_free(of->f0);
    swb_function_free(of->cost);
    swb_function_free(of->goal);
}

swb_ocp *friction_ocp(const struct friction *of, const swb_settings *settings, int64_t n_stages)
{
    static const double lower[] = {-2.0}, upper[] = {2.0};
    swb_ocp *ocp = NULL;
    if (swb_ocp_create(of->system, 2.0, n_stages, settings, &ocp) != SWB_OK)
        return NULL;
    MUST(swb_ocp_set_lagrange(ocp, of->cost));
    MUST(swb_ocp_set_mayer(ocp, of->goal));
    MUST(swb_ocp_set_initial_state(ocp, friction_start, FRICTION_NX));
    MUST(swb_ocp_set_control_bounds(ocp, lower, 1, upper, 1));
    MUST(swb_ocp_set_params(ocp, friction_params, FRICTION_NP));
    return ocp;
}

swb_integrator *friction_integrator(const struct friction *of, const swb_settings *settings)
{
    swb_integrator *it = NULL;
    if (swb_integrator_create(of->system, settings, &it) != SWB_OK)
        return NULL;
    MUST(swb_integrator_set_controls(it, friction_push, FRICTION_NU));
    MUST(swb_integrator_set_params(it, friction_params, FRICTION_NP));
    if (swb_integrator_reinit(it, 0.0, friction_start, FRICTION_NX) == SWB_OK)
        return it;
    swb_integrator_free(it); /* tolerances that no run can hold */
    return NULL;
}

swb_simulator *friction_simulator(const struct friction *of, const swb_settings *settings)
{
    swb_simulator *sim = NULL;
    if (swb_simulator_create(of->system, settings, &sim) != SWB_OK)
        return NULL;
    MUST(swb_simulator_set_state(sim, 0.0, friction_start, FRICTION_NX));
    MUST(swb_simulator_set_controls(sim, friction_push, FRICTION_NU));
    MUST(swb_simulator_set_params(sim, friction_params, FRICTION_NP));
    return sim;
}

swb_batch *friction_batch(const struct friction *of, const swb_settings *settings)
{
    swb_batch *batch = NULL;
    return swb_batch_create(of->system, settings, &batch) == SWB_OK ? batch : NULL;
}

/* --- expressions --- */

static int64_t apply(swb_expr *graph, int32_t op, int64_t a, int64_t b)
{
    int64_t out = -1;
    MUST(swb_expr_apply(graph, op, &a, b < 0 ? NULL : &b, NULL, &out, 1));
    return out;
}

swb_model *friction_model(swb_expr *graph)
{
    int64_t x[FRICTION_NX], u, p, rhs[FRICTION_NX];
    swb_model *model = NULL;
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, FRICTION_NX));
    MUST(swb_expr_inputs(graph, SWB_INPUT_U, 0, &u, 1));
    MUST(swb_expr_inputs(graph, SWB_INPUT_P, 0, &p, 1));
    rhs[0] = x[1];
    rhs[1] = apply(graph, SWB_OPERATOR_SUB, u, apply(graph, SWB_OPERATOR_MUL, p, apply(graph, SWB_OPERATOR_SIGN, x[1], -1)));
    MUST(swb_model_create(graph, "friction", FRICTION_NX, FRICTION_NU, FRICTION_NP, rhs, "x\nv\nu\np", NULL, &model));
    return model;
}

swb_function *friction_cost(swb_expr *graph)
{
    int64_t u, square;
    swb_function *f = NULL;
    MUST(swb_expr_inputs(graph, SWB_INPUT_U, 0, &u, 1));
    square = apply(graph, SWB_OPERATOR_MUL, u, u);
    MUST(swb_expr_function(graph, "effort", FRICTION_NX, FRICTION_NU, FRICTION_NP, &square, 1, &f));
    return f;
}

static int64_t constant(swb_expr *graph, double value)
{
    int64_t out = -1;
    MUST(swb_expr_constants(graph, &value, 1, &out, 1));
    return out;
}

/* A problem of two states and one control on [0, 1], two stages. */
static swb_ocp *ocp_of(swb_expr *graph, const int64_t *rhs, const double *start, const swb_settings *settings)
{
    swb_model *model = NULL;
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    MUST(swb_model_create(graph, "controlled", 2, 1, 0, rhs, NULL, NULL, &model));
    MUST(swb_model_system(model, &system));
    swb_model_free(model);
    swb_status status = swb_ocp_create(system, 1.0, 2, settings, &ocp);
    swb_system_free(system);
    if (status != SWB_OK)
        return NULL;
    MUST(swb_ocp_set_initial_state(ocp, start, 2));
    return ocp;
}

swb_ocp *tracking_ocp(swb_expr *graph, const swb_settings *settings)
{
    static const double start[2] = {1.0, 0.0}, zero[3] = {0.0, 0.0, 0.0}, weights[3] = {1.0, 1.0, 0.1};
    static const double lower[2] = {-2.0, -INFINITY}, upper[2] = {2.0, INFINITY};
    int64_t of[3], rhs[2];
    swb_function *residual = NULL;
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 0, of, 2));
    MUST(swb_expr_inputs(graph, SWB_INPUT_U, 0, &of[2], 1));
    rhs[0] = of[1];
    rhs[1] = of[2];
    swb_ocp *ocp = ocp_of(graph, rhs, start, settings);
    if (!ocp)
        return NULL;
    MUST(swb_ocp_set_state_bounds(ocp, lower, 2, upper, 2));
    MUST(swb_expr_function(graph, "residual", 2, 1, 0, of, 3, &residual));
    MUST(swb_ocp_add_least_squares(ocp, residual, weights, 3, zero, 3, SWB_COST_AT_RUNNING));
    swb_function_free(residual);
    return ocp;
}

swb_ocp *observed_ocp(swb_expr *graph, const swb_settings *settings)
{
    static const double start[2] = {1.0, 0.0};
    int64_t rhs[2];
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 1, &rhs[0], 1));
    MUST(swb_expr_inputs(graph, SWB_INPUT_U, 0, &rhs[1], 1));
    return ocp_of(graph, rhs, start, settings);
}

swb_ocp *kinked_ocp(swb_expr *graph, const swb_settings *settings)
{
    static const double start[2] = {-1.0, 0.0};
    int64_t x[2], u, t, rhs[2], miss, squared, price;
    swb_function *effort = NULL, *paid = NULL;
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 2));
    MUST(swb_expr_inputs(graph, SWB_INPUT_U, 0, &u, 1));
    MUST(swb_expr_inputs(graph, SWB_INPUT_T, 0, &t, 1));
    rhs[0] = u;
    rhs[1] = apply(graph, SWB_OPERATOR_SIGN, x[0], -1);
    swb_ocp *ocp = ocp_of(graph, rhs, start, settings);
    if (!ocp)
        return NULL;
    miss = apply(graph, SWB_OPERATOR_MUL, t, constant(graph, 3.6));
    miss = apply(graph, SWB_OPERATOR_SUB, u, apply(graph, SWB_OPERATOR_ADD, miss, constant(graph, 1.3)));
    squared = apply(graph, SWB_OPERATOR_MUL, miss, miss);
    MUST(swb_expr_function(graph, "effort", 2, 1, 0, &squared, 1, &effort));
    price = apply(graph, SWB_OPERATOR_MUL, x[1], constant(graph, 0.5));
    MUST(swb_expr_function(graph, "paid", 2, 1, 0, &price, 1, &paid));
    MUST(swb_ocp_set_lagrange(ocp, effort));
    MUST(swb_ocp_set_mayer(ocp, paid));
    swb_function_free(effort);
    swb_function_free(paid);
    return ocp;
}

void counter_create(struct counter *out, swb_expr *graph)
{
    const double numbers[3] = {0.0, 0.1, 1.0};
    int64_t x[2], number[3], rhs[2], guard, reset[2];
    swb_function *f0 = NULL;
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 2));
    MUST(swb_expr_constants(graph, numbers, 3, number, 3));
    rhs[0] = number[2];
    rhs[1] = number[0];
    guard = apply(graph, SWB_OPERATOR_SUB, x[0], number[1]);
    reset[0] = number[0];
    reset[1] = apply(graph, SWB_OPERATOR_ADD, x[1], number[2]);
    MUST(swb_expr_function(graph, "f0", 2, 0, 0, rhs, 2, &f0));
    MUST(swb_expr_function(graph, "guard", 2, 0, 0, &guard, 1, &out->guard));
    MUST(swb_expr_function(graph, "reset", 2, 0, 0, reset, 2, &out->reset));
    MUST(swb_system_create(2, 0, 0, &out->system));
    MUST(swb_system_set_f0(out->system, f0));
    swb_function_free(f0);
}

/* --- a program with a pair --- */

static int32_t distance(const swb_point *at, double *out, void *user_data)
{
    double a = at->x[0] - 1.0, b = at->x[1] - 1.0, c = at->x[2];
    const double value = a * a + 1.5 * b * b + c * c;
    return answer(user_data, out, 1, &value);
}

static int32_t sum(const swb_point *at, double *out, void *user_data)
{
    const double value = at->x[0] + at->x[1] + at->x[2] - at->p[0];
    return answer(user_data, out, 1, &value);
}

int corner_create(struct corner *out, const swb_settings *settings)
{
    static const double lower[] = {0.0}, upper[] = {INFINITY}, p[] = {0.5};
    struct user *user = out->user = user_new(1, 3, 0, 1, 1);
    out->mpcc = NULL;
    out->objective = function("distance", 3, 0, 1, 1, distance, user);
    out->rows = function("sum", 3, 0, 1, 1, sum, user);
    if (swb_mpcc_create(3, 1, out->objective, out->rows, settings, &out->mpcc) != SWB_OK) {
        corner_free(out);
        return 0;
    }
    MUST(swb_mpcc_add_pair(out->mpcc, SWB_MEMBER_VARIABLE, 0, SWB_MEMBER_VARIABLE, 1));
    MUST(swb_mpcc_set_constraint_bounds(out->mpcc, lower, 1, upper, 1));
    MUST(swb_mpcc_set_params(out->mpcc, p, 1));
    return 1;
}

void corner_free(struct corner *of)
{
    swb_mpcc_free(of->mpcc);
    swb_function_free(of->objective);
    swb_function_free(of->rows);
}
