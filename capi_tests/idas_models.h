/* Models for the comparison with IDAS, each as a system and as the differential-algebraic equations of its phases. */
#ifndef IDAS_MODELS_H
#define IDAS_MODELS_H

#include "idas.h"
#include "models.h"

static const int TWO_STATES[] = {1, 1}, AND_ONE_ALGEBRAIC[] = {1, 1, 0};

/* Two modes of which each has a row of its own in the state x[row] and is valid on its side of psi. */
static inline swb_system *make_two_modes(swb_value_fn f0, swb_value_fn modes, swb_value_fn psi, int64_t row, int psi_is_linear)
{
    static const int8_t signs[] = {-1, 1};
    swb_function *f = make_function("f0", 2, 0, 0, 2, f0, NULL), *c = make_function("c", 2, 0, 0, 1, psi, NULL);
    swb_function *m = make_function("F", 2, 0, 0, 2, modes, NULL);
    swb_system *system = NULL;

    CHECK_OK(swb_function_set_linear(m));
    if (psi_is_linear)
        CHECK_OK(swb_function_set_linear(c));
    CHECK_OK(swb_system_create(2, 0, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f));
    CHECK_OK(swb_system_add_subsystem(system, &row, 1, m, 2, c, signs, 2, NULL));
    swb_function_free(f);
    swb_function_free(c);
    swb_function_free(m);
    return system;
}

/* --- the oscillator ------------------------------------------------------------------------------- */

static inline void inside(double t, const double *y, const double *yp, double *r)
{
    (void)t;
    r[0] = y[0] + OMEGA * y[1] - yp[0];
    r[1] = -OMEGA * y[0] + y[1] - yp[1];
}

static inline void outside(double t, const double *y, const double *yp, double *r)
{
    (void)t;
    r[0] = y[0] - OMEGA * y[1] - yp[0];
    r[1] = OMEGA * y[0] + y[1] - yp[1];
}

#define INSIDE {2, inside, TWO_STATES, 0, NULL}
#define OUTSIDE {2, outside, TWO_STATES, 0, NULL}

/* --- sliding -------------------------------------------------------------------------------------- */

/* x' = 1 + y^2, y' = x + 2 below the curve psi = y - sin(x)/2 = 0 and x - 2 above it: both modes push towards
 * it. On it y' = x + 2 s, and the difference s of the two coefficients follows from d psi / dt = 0. */
static inline int32_t sliding_f0(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = 1.0 + at->x[1] * at->x[1];
    out[1] = at->x[0];
    return 0;
}

static inline int32_t sliding_modes(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[0] = 2.0;
    out[1] = -2.0;
    return 0;
}

static inline int32_t curve(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1] - 0.5 * sin(at->x[0]);
    return 0;
}

/* Index 1: x, y and the coefficient s, with d psi / dt = 0 in place of psi = 0. */
static inline void sliding_dae(double t, const double *y, const double *yp, double *r)
{
    double fx = 1.0 + y[1] * y[1];
    (void)t;
    r[0] = fx - yp[0];
    r[1] = y[0] + 2.0 * y[2] - yp[1];
    r[2] = y[0] + 2.0 * y[2] - 0.5 * cos(y[0]) * fx;
}

#define SLIDING {3, sliding_dae, AND_ONE_ALGEBRAIC, 0, NULL}

static inline swb_system *make_sliding(void)
{
    return make_two_modes(sliding_f0, sliding_modes, curve, 1, 0);
}

/* --- a nonlinear mode ----------------------------------------------------------------------------- */

/* Van der Pol in Lienard's plane with a constant pull against x: x' = 2 (z - x^3/3 + x), z' = -x/5 - sign(x)/10.
 * The DAE has the slope x' as a variable of its own. */
static inline int32_t lienard(const swb_point *at, double *out, void *user_data)
{
    double x = at->x[0];
    (void)user_data;
    out[0] = 2.0 * (at->x[1] - x * x * x / 3.0 + x);
    out[1] = -0.2 * x;
    return 0;
}

static inline int32_t friction(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[0] = 0.1;
    out[1] = -0.1;
    return 0;
}

static inline void lienard_dae(double t, const double *y, const double *yp, double *r)
{
    (void)t;
    r[0] = y[2] - yp[0];
    r[1] = -0.2 * y[0] - 0.1 - yp[1];
    r[2] = 2.0 * (y[1] - y[0] * y[0] * y[0] / 3.0 + y[0]) - y[2];
}

static inline int32_t first(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    return 0;
}

#define LIENARD {3, lienard_dae, AND_ONE_ALGEBRAIC, 0, NULL}

static inline swb_system *make_lienard(void)
{
    return make_two_modes(lienard, friction, first, 1, 1);
}

#endif
