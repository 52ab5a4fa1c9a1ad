/* Moving horizon estimation: a constant against the weighted mean of its measurements, a double integrator, bad input. */
#include <stdlib.h>

#include "models.h"

#define STAGES 6

static const double sample = 0.1, start[2] = {0.5, 0.0}, initial[2] = {1.0, 2.0}, process[2] = {0.0, 0.1}, sigma[1] = {0.2};

static int32_t rest(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[0] = 0.0;
    out[1] = 0.0;
    return 0;
}

static int32_t position(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    return 0;
}

static swb_ocp *make_problem(swb_value_fn f)
{
    swb_function *rhs = make_function("f", 2, 1, 0, 2, f, NULL);
    swb_settings settings;
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;

    CHECK_OK(swb_settings_init(&settings, sizeof settings));
    settings.rk_family = SWB_RK_FAMILY_EXPLICIT;
    settings.n_s = 4;
    settings.n_fe = 1;
    CHECK_OK(swb_system_create(2, 1, 0, &system));
    CHECK_OK(swb_system_set_f0(system, rhs));
    CHECK_OK(swb_ocp_create(system, STAGES * sample, STAGES, &settings, &ocp));
    CHECK_OK(swb_ocp_set_initial_state(ocp, start, 2));
    swb_system_free(system);
    swb_function_free(rhs);
    return ocp;
}

/* Without motion and noise the estimate is the mean of all measurements, weighted with that of the start, however short the window is. */
static void a_constant_is_its_mean(void)
{
    static const double none[2] = {0.0, 0.0}, u = 0.0;
    swb_ocp *ocp = make_problem(rest);
    swb_function *y = make_function("y", 2, 1, 0, 1, position, NULL);
    swb_nmpc_info info;
    swb_mhe *c = NULL;
    double x[2], p[4], sum = start[0] / (initial[0] * initial[0]), weight = 1.0 / (initial[0] * initial[0]);
    double states[2 * (STAGES + 1)];
    int64_t n, nx, nu, ny, nw, filled;
    int k;

    CHECK_OK(swb_mhe_create(ocp, y, initial, 2, none, 2, sigma, 1, NULL, &c));
    swb_function_free(y);
    swb_ocp_free(ocp);
    CHECK_OK(swb_mhe_sizes(c, &n, &nx, &nu, &ny, &nw));
    CHECK(n == STAGES && nx == 2 && nu == 1 && ny == 1 && nw == 0);
    for (k = 0; k < 20; k++) {
        double measured = k % 4 == 3 ? NAN : 0.7 + 0.1 * (k % 3);
        if (k % 4 != 3) {
            weight += 1.0 / (sigma[0] * sigma[0]);
            sum += measured / (sigma[0] * sigma[0]);
        }
        CHECK_OK(swb_mhe_estimate(c, &measured, 1, x, 2, &info, sizeof info));
        CHECK(info.source == SWB_NMPC_SOURCE_QP && info.qp_status == SWB_NMPC_QP_STATUS_SOLVED && info.inner == 1);
        CHECK(fabs(x[0] - sum / weight) < 1e-9 && fabs(x[1]) < 1e-12);
        CHECK_OK(swb_mhe_get_covariance(c, p, 4));
        CHECK(fabs(p[0] * weight - 1.0) < 1e-9 && fabs(p[3] - initial[1] * initial[1]) < 1e-9);
        CHECK_OK(swb_mhe_prepare(c, &u, 1, &info, sizeof info));
        CHECK(info.ready == 1);
    }
    CHECK_OK(swb_mhe_get_window(c, states, 2 * (STAGES + 1), NULL, 0, &filled));
    CHECK(filled == STAGES && states[2 * STAGES] == x[0]);
    CHECK_OK(swb_mhe_reset(c, start, 2));
    CHECK_OK(swb_mhe_get_window(c, states, 2 * (STAGES + 1), NULL, 0, &filled));
    CHECK(filled == 0 && states[0] == start[0]);
    swb_mhe_free(c);
}

/* The speed of a mass from its positions, with a control that is known. */
static void a_mass_has_its_speed(void)
{
    swb_ocp *ocp = make_problem(double_integrator);
    swb_function *y = make_function("y", 2, 1, 0, 1, position, NULL);
    swb_mhe_options options;
    swb_mhe *c = NULL;
    double q = 1.0, v = -0.5, u = 0.4, x[2] = {0.0, 0.0};
    int k;

    CHECK_OK(swb_mhe_options_init(&options, sizeof options));
    options.iterations = 2;
    CHECK_OK(swb_mhe_create(ocp, y, initial, 2, process, 2, sigma, 1, &options, &c));
    for (k = 0; k < 80; k++) {
        CHECK_OK(swb_mhe_estimate(c, &q, 1, x, 2, NULL, 0));
        q += sample * v + 0.5 * sample * sample * u;
        v += sample * u;
        CHECK_OK(swb_mhe_prepare(c, &u, 1, NULL, 0));
    }
    CHECK(fabs(x[0] - (q - sample * (v - sample * u) - 0.5 * sample * sample * u)) < 1e-3 && fabs(x[1] - (v - sample * u)) < 1e-2);
    swb_mhe_free(c);
    swb_function_free(y);
    swb_ocp_free(ocp);
}

static void bad_input(void)
{
    swb_ocp *ocp = make_problem(double_integrator);
    swb_function *y = make_function("y", 2, 1, 0, 1, position, NULL);
    double x[2] = {7.0, 7.0}, measured = 0.0, nan1 = NAN, infinite = INFINITY, none[2] = {0.0, 0.0};
    swb_mhe_options options;
    swb_mhe *c = NULL;
    int64_t n;

    CHECK_STATUS(SWB_ERR_RANGE, swb_mhe_create(ocp, y, none, 2, process, 2, sigma, 1, NULL, &c));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mhe_create(ocp, y, initial, 2, process, 2, initial, 2, NULL, &c));
    CHECK_STATUS(SWB_ERR_NULL, swb_mhe_create(ocp, NULL, initial, 2, process, 2, sigma, 1, NULL, &c));
    CHECK_STATUS(SWB_ERR_NULL, swb_mhe_create(NULL, y, initial, 2, process, 2, sigma, 1, NULL, &c));
    CHECK_OK(swb_mhe_options_init(&options, sizeof options));
    options.iterations = 0;
    CHECK_STATUS(SWB_ERR_RANGE, swb_mhe_create(ocp, y, initial, 2, process, 2, sigma, 1, &options, &c));
    options.struct_size = 7;
    CHECK_STATUS(SWB_ERR_STATE, swb_mhe_create(ocp, y, initial, 2, process, 2, sigma, 1, &options, &c));
    CHECK(c == NULL);
    CHECK_OK(swb_mhe_create(ocp, y, initial, 2, process, 2, sigma, 1, NULL, &c));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mhe_estimate(c, &infinite, 1, x, 2, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mhe_estimate(c, x, 2, x, 2, NULL, 0));
    CHECK_STATUS(SWB_ERR_NULL, swb_mhe_estimate(c, &measured, 1, NULL, 2, NULL, 0));
    CHECK(x[0] == 7.0 && x[1] == 7.0);
    CHECK_OK(swb_mhe_estimate(c, &measured, 1, x, 2, NULL, 0));
    CHECK_STATUS(SWB_ERR_STATE, swb_mhe_estimate(c, &measured, 1, x, 2, NULL, 0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mhe_prepare(c, &nan1, 1, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mhe_prepare(c, x, 2, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mhe_set_params(c, x, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mhe_reset(c, x, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_mhe_get_covariance(c, x, 2));
    CHECK_STATUS(SWB_ERR_NULL, swb_mhe_write_c(c, NULL, "c", SWB_C_REAL_DOUBLE));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mhe_write_c(c, ".", "c", 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_mhe_write_c(c, ".", "no name", SWB_C_REAL_FLOAT));
    CHECK_STATUS(SWB_ERR_NULL, swb_mhe_sizes(c, &n, &n, NULL, &n, &n));
    CHECK_OK(swb_mhe_interrupt(c));
    swb_mhe_free(c);
    CHECK_STATUS(SWB_ERR_STATE, swb_mhe_prepare(c, &measured, 1, NULL, 0));
    swb_mhe_free(NULL);
    swb_function_free(y);
    swb_ocp_free(ocp);
}

int main(void)
{
    a_constant_is_its_mean();
    a_mass_has_its_speed();
    bad_input();
    CHECK(swb_live_objects() == 0);
    return CHECK_DONE();
}
