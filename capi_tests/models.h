/* Models of the tests. */
#ifndef MODELS_H
#define MODELS_H

#include "check.h"

#define OMEGA 6.283185307179586

/* x' = A1 x inside the unit circle, A2 x outside; A1 turns one way, A2 the other. */
static inline int32_t oscillator_modes(const swb_point *at, double *out, void *user_data)
{
    double x = at->x[0], y = at->x[1];
    (void)user_data;
    out[0] = x + OMEGA * y;
    out[1] = -OMEGA * x + y;
    out[2] = x - OMEGA * y;
    out[3] = OMEGA * x + y;
    return 0;
}

static inline int32_t oscillator_modes_jacobian(const swb_point *at, double *out, void *user_data)
{
    static const double values[8] = {1, -OMEGA, 1, OMEGA, OMEGA, 1, -OMEGA, 1};
    (void)at;
    (void)user_data;
    memcpy(out, values, sizeof values);
    return 0;
}

static inline int32_t circle(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0] * at->x[0] + at->x[1] * at->x[1] - 1.0;
    return 0;
}

/* A mass that a force moves: x' = (x_1, u). */
static inline int32_t double_integrator(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    out[1] = at->u[0];
    return 0;
}

static inline int32_t circle_jacobian(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = 2.0 * at->x[0];
    out[1] = 2.0 * at->x[1];
    return 0;
}

static inline int32_t circle_hessian(const swb_point *at, const double *weights, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[0] = 2.0 * weights[0];
    out[1] = 2.0 * weights[0];
    return 0;
}

static const int64_t DENSE_4X2[] = {0, 4, 8, 8}, DENSE_4X2_ROWS[] = {0, 1, 2, 3, 0, 1, 2, 3};
static const int64_t DENSE_1X2[] = {0, 1, 2, 2}, DENSE_1X2_ROWS[] = {0, 0};
static const int64_t DIAGONAL_2[] = {0, 1, 2, 2}, DIAGONAL_2_ROWS[] = {0, 1};

/* A function; derivatives by differences. */
static inline swb_function *make_function(const char *name, int64_t nx, int64_t nu, int64_t np, int64_t n_out,
                                   swb_value_fn value, void *user_data)
{
    swb_function *f = NULL;
    CHECK_OK(swb_function_create(name, nx, nu, np, n_out, value, user_data, NULL, &f));
    return f;
}

static inline swb_system *make_oscillator(void)
{
    static const int64_t rows[] = {0, 1};
    static const int8_t signs[] = {-1, 1};
    swb_system *system = NULL;
    swb_function *modes = make_function("F", 2, 0, 0, 4, oscillator_modes, NULL);
    swb_function *psi = make_function("c", 2, 0, 0, 1, circle, NULL);

    CHECK_OK(swb_function_set_jacobian(modes, DENSE_4X2, 4, DENSE_4X2_ROWS, 8, oscillator_modes_jacobian));
    CHECK_OK(swb_function_set_linear(modes));
    CHECK_OK(swb_function_set_jacobian(psi, DENSE_1X2, 4, DENSE_1X2_ROWS, 2, circle_jacobian));
    CHECK_OK(swb_function_set_hessian(psi, DIAGONAL_2, 4, DIAGONAL_2_ROWS, 2, circle_hessian));
    CHECK_OK(swb_system_create(2, 0, 0, &system));
    CHECK_OK(swb_system_add_subsystem(system, rows, 2, modes, 2, psi, signs, 2, NULL));
    swb_function_free(modes);
    swb_function_free(psi);
    return system;
}

/* exp(-1), 0: the switch is at t = 1 exactly. */
static const double OSCILLATOR_X0[2] = {0.36787944117144232160, 0.0};
static const double OSCILLATOR_T = 1.57079632679489661923;
static const double OSCILLATOR_XT[2] = {-1.59746037745069812212, -0.76149362060601145276};

#endif
