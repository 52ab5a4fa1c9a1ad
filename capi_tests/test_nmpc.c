/* Model predictive control: feedback of a linear problem by its Riccati recursion, bounds, calls in any order, bad input. */
#include <stdlib.h>

#include "models.h"

#define STAGES 12

static const double sample = 0.1, weight_x[2] = {2.0, 0.5}, weight_u = 0.3, weight_end[2] = {5.0, 1.0};

static int32_t all(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    out[1] = at->x[1];
    out[2] = at->u[0];
    return 0;
}

static int32_t undefined_far_away(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    out[1] = at->u[0];
    return fabs(at->x[0]) > 50.0;
}

static int32_t states(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    out[1] = at->x[1];
    return 0;
}

static swb_ocp *make_problem(swb_value_fn f)
{
    static const double zero[3] = {0.0, 0.0, 0.0}, low = -1.0, high = 1.0;
    double weights[3];
    swb_function *rhs = make_function("f", 2, 1, 0, 2, f, NULL);
    swb_function *stage = make_function("stage", 2, 1, 0, 3, all, NULL);
    swb_function *end = make_function("end", 2, 1, 0, 2, states, NULL);
    swb_settings settings;
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;

    weights[0] = weight_x[0];
    weights[1] = weight_x[1];
    weights[2] = weight_u;
    CHECK_OK(swb_settings_init(&settings, sizeof settings));
    settings.rk_family = SWB_RK_FAMILY_EXPLICIT;
    settings.n_s = 4;
    settings.n_fe = 1;
    CHECK_OK(swb_system_create(2, 1, 0, &system));
    CHECK_OK(swb_system_set_f0(system, rhs));
    CHECK_OK(swb_ocp_create(system, STAGES * sample, STAGES, &settings, &ocp));
    CHECK_OK(swb_ocp_add_least_squares(ocp, stage, weights, 3, zero, 3, SWB_COST_AT_RUNNING));
    CHECK_OK(swb_ocp_add_least_squares(ocp, end, weight_end, 2, zero, 2, SWB_COST_AT_TERMINAL));
    CHECK_OK(swb_ocp_set_control_bounds(ocp, &low, 1, &high, 1));
    swb_system_free(system);
    swb_function_free(rhs);
    swb_function_free(stage);
    swb_function_free(end);
    return ocp;
}

/* First gain of the Riccati recursion of x+ = A x + B u with costs h x'Wx + h w u^2 and x'W_N x at the end. */
static void riccati(double gain[2])
{
    const double a[2][2] = {{1.0, sample}, {0.0, 1.0}}, b[2] = {0.5 * sample * sample, sample};
    double p[2][2] = {{weight_end[0], 0.0}, {0.0, weight_end[1]}};
    for (int k = 0; k < STAGES; k++) {
        double pa[2][2], pb[2], next[2][2], s = sample * weight_u;
        for (int i = 0; i < 2; i++) {
            pb[i] = p[i][0] * b[0] + p[i][1] * b[1];
            for (int j = 0; j < 2; j++)
                pa[i][j] = p[i][0] * a[0][j] + p[i][1] * a[1][j];
        }
        s += b[0] * pb[0] + b[1] * pb[1];
        for (int j = 0; j < 2; j++)
            gain[j] = (b[0] * pa[0][j] + b[1] * pa[1][j]) / s;
        for (int i = 0; i < 2; i++)
            for (int j = 0; j < 2; j++)
                next[i][j] = a[0][i] * pa[0][j] + a[1][i] * pa[1][j] - gain[i] * s * gain[j];
        for (int i = 0; i < 2; i++)
            for (int j = 0; j < 2; j++)
                p[i][j] = next[i][j] + (i == j ? sample * weight_x[i] : 0.0);
    }
}

static void feedback_is_that_of_riccati(void)
{
    const double x[2] = {0.1, -0.05}, far[2] = {3.0, 1.0};
    double gain[2], u = NAN, plan_x[2 * (STAGES + 1)], plan_u[STAGES];
    int64_t n, nx, nu, done;
    swb_nmpc_options options;
    swb_nmpc_info info;
    swb_nmpc_monitor monitor;
    swb_ocp *ocp = make_problem(double_integrator);
    swb_nmpc *c = NULL;

    CHECK_OK(swb_nmpc_options_init(&options, sizeof options));
    CHECK_OK(swb_nmpc_create(ocp, &options, &c));
    swb_ocp_free(ocp);
    CHECK_OK(swb_nmpc_sizes(c, &n, &nx, &nu));
    CHECK(n == STAGES && nx == 2 && nu == 1);
    CHECK_OK(swb_nmpc_prepare(c, NULL, 0, &info, sizeof info));
    CHECK(info.ready == 1);
    CHECK_OK(swb_nmpc_feedback(c, x, 2, &u, 1, &info, sizeof info));
    CHECK(info.source == SWB_NMPC_SOURCE_QP && info.qp_status == SWB_NMPC_QP_STATUS_SOLVED);
    riccati(gain);
    /* derivatives of callbacks by differences of a linear function: exact but for rounding */
    CHECK_NEAR(u, -gain[0] * x[0] - gain[1] * x[1], 1e-7);
    CHECK_OK(swb_nmpc_finish(c));
    CHECK_OK(swb_nmpc_get_plan(c, plan_x, 2 * (STAGES + 1), plan_u, STAGES));
    CHECK_NEAR(plan_u[0], u, 1e-15);
    CHECK_NEAR(plan_x[0], x[0], 1e-12);
    CHECK_NEAR(plan_x[2], x[0] + sample * x[1] + 0.5 * sample * sample * u, 1e-7);
    /* a bound */
    CHECK_OK(swb_nmpc_prepare(c, NULL, 0, NULL, 0));
    CHECK_OK(swb_nmpc_feedback(c, far, 2, &u, 1, &info, sizeof info));
    CHECK(u == -1.0);
    CHECK(info.qp_iterations > 0);
    CHECK_OK(swb_nmpc_initialise(c, x, 2, 20, &done));
    CHECK(done >= 1);
    CHECK_OK(swb_nmpc_get_monitor(c, &monitor, sizeof monitor));
    CHECK(monitor.preparations == 2 && monitor.feedbacks == 2 && monitor.from_qp == 2);
    CHECK_OK(swb_nmpc_reset(c));
    CHECK_OK(swb_nmpc_get_monitor(c, &monitor, sizeof monitor));
    CHECK(monitor.feedbacks == 0);
    swb_nmpc_free(c);
}

static void there_is_a_control_for_everything(void)
{
    const double x[2] = {0.1, 0.0}, nan2[2] = {NAN, 0.0}, away[2] = {1e3, 0.0};
    double u = NAN;
    swb_nmpc_info info;
    swb_ocp *ocp = make_problem(undefined_far_away);
    swb_nmpc *c = NULL;

    CHECK_OK(swb_nmpc_create(ocp, NULL, &c));
    /* nothing was prepared */
    CHECK_OK(swb_nmpc_feedback(c, x, 2, &u, 1, &info, sizeof info));
    CHECK(info.source == SWB_NMPC_SOURCE_PLAN && fabs(u) <= 1.0);
    for (int k = 0; k < 2 * STAGES; k++) {
        CHECK_OK(swb_nmpc_prepare(c, NULL, 0, NULL, 0));
        CHECK_OK(swb_nmpc_feedback(c, nan2, 2, &u, 1, &info, sizeof info));
        CHECK(info.source == SWB_NMPC_SOURCE_PLAN || info.source == SWB_NMPC_SOURCE_HOLD);
        CHECK(fabs(u) <= 1.0);
    }
    CHECK(info.source == SWB_NMPC_SOURCE_HOLD);
    /* outside of where the model is defined the program before is used further */
    CHECK_OK(swb_nmpc_feedback(c, away, 2, &u, 1, &info, sizeof info));
    CHECK(u == -1.0);
    CHECK_OK(swb_nmpc_prepare(c, NULL, 0, &info, sizeof info));
    CHECK(info.ready == 1);
    CHECK_OK(swb_nmpc_feedback(c, x, 2, &u, 1, &info, sizeof info));
    CHECK(fabs(u) <= 1.0);
    swb_nmpc_free(c);
    swb_ocp_free(ocp);
}

static void bad_input(void)
{
    const double x[2] = {0.1, 0.0}, nan1 = NAN;
    double u = 7.0;
    int64_t n;
    swb_nmpc_options options;
    swb_ocp *ocp = make_problem(double_integrator);
    swb_nmpc *c = NULL, *none = (swb_nmpc *)&options;

    CHECK_OK(swb_nmpc_options_init(&options, sizeof options));
    options.scheme = 17;
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_create(ocp, &options, &none));
    CHECK(none == NULL);
    CHECK_OK(swb_nmpc_options_init(&options, sizeof options));
    options.tol = NAN;
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_create(ocp, &options, &none));
    options.struct_size = 7;
    CHECK_STATUS(SWB_ERR_STATE, swb_nmpc_create(ocp, &options, &none));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_create(NULL, NULL, &none));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_create(ocp, NULL, NULL));
    CHECK_OK(swb_nmpc_create(ocp, NULL, &c));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_feedback(c, x, 1, &u, 1, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_feedback(c, x, 2, &u, 2, NULL, 0));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_feedback(c, x, 2, NULL, 1, NULL, 0));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_feedback(c, NULL, 2, &u, 1, NULL, 0));
    CHECK(u == 7.0);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_prepare(c, x, 1, NULL, 0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_set_time(c, NAN));
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_set_deadline(c, 0.0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_set_params(c, x, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_set_references(c, 2, x, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_set_references(c, 1, x, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_set_references(c, 0, &nan1, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_set_iterate(c, x, 2, &u, 1));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_sizes(c, &n, NULL, &n));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_get_monitor(c, NULL, 8));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_initialise(c, NULL, 2, 3, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_set_weights(c, 9, x, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_set_weights(c, -1, x, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_set_weights(c, 1, x, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_set_control_bounds(c, x, x, 2));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_set_control_bounds(c, NULL, x, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_set_control_bounds(c, &nan1, &nan1, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_set_state_bounds(c, x, x, 1));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_get_objective(c, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_get_gain(c, &u, 1));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_count_rows(c, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_nmpc_get_multipliers(c, &u, 1, &u, 1, NULL, 0, NULL, 0));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_write_c(c, NULL, "c", SWB_C_REAL_DOUBLE));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_write_c(c, ".", NULL, SWB_C_REAL_DOUBLE));
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_write_c(c, ".", "c", 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_nmpc_write_c(c, ".", "no name", SWB_C_REAL_FLOAT));
    CHECK_OK(swb_nmpc_interrupt(c));
    swb_nmpc_free(c);
    CHECK_STATUS(SWB_ERR_STATE, swb_nmpc_finish(c));
    swb_nmpc_free(NULL);
    swb_ocp_free(ocp);
}

int main(void)
{
    feedback_is_that_of_riccati();
    there_is_a_control_for_everything();
    bad_input();
    CHECK(swb_live_objects() == 0);
    return CHECK_DONE();
}
