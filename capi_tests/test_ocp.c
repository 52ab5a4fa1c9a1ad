/* Optimal control: a problem with a known solution, one with sliding modes, options, what can go wrong. */
#include <stdlib.h>

#include "kink.h"
#include "models.h"

static swb_ocp *make_problem(const swb_settings *settings)
{
    static const int64_t rows[] = {0};
    static const int8_t signs[] = {-1, 1};
    static const double lower[] = {-2.0}, upper[] = {-1.0};
    swb_function *modes = make_function("F", 1, 0, 0, 2, kink_slopes, NULL);
    swb_function *psi = make_function("c", 1, 0, 0, 1, first_state, NULL);
    swb_function *rate = make_function("L", 1, 0, 0, 1, first_state_squared, NULL);
    swb_function *end = make_function("M", 1, 0, 0, 1, kink_distance, NULL);
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;

    CHECK_OK(swb_function_set_linear(modes));
    CHECK_OK(swb_function_set_linear(psi));
    CHECK_OK(swb_system_create(1, 0, 0, &system));
    CHECK_OK(swb_system_add_subsystem(system, rows, 1, modes, 2, psi, signs, 2, NULL));
    CHECK_OK(swb_ocp_create(system, 2.0, 5, settings, &ocp));
    CHECK_OK(swb_ocp_set_lagrange(ocp, rate));
    CHECK_OK(swb_ocp_set_mayer(ocp, end));
    CHECK_OK(swb_ocp_set_initial_bounds(ocp, lower, 1, upper, 1));
    swb_system_free(system);
    swb_function_free(modes);
    swb_function_free(psi);
    swb_function_free(rate);
    swb_function_free(end);
    return ocp;
}

/* Where the program is slow the homotopy from the guess alone: searches for better answers solve the same kind of program again and again. */
static void without_search(swb_ocp *ocp)
{
    if (check_slow())
        CHECK_OK(swb_ocp_set_int(ocp, "ocp_start", SWB_OCP_START_HOMOTOPY));
}

/* Start x0, switch at -x0/3; the cost is -x0^3/9 + (2 + x0/3)^3/3 + (1/3 + x0/3)^2, least at x0 below. */
static void known_solution(void)
{
    const double x0 = (18.0 - sqrt(1668.0)) / 16.0;
    const double best = -x0 * x0 * x0 / 9.0 + pow(2.0 + x0 / 3.0, 3.0) / 3.0 + pow((1.0 + x0) / 3.0, 2.0);
    swb_settings settings;
    swb_ocp *ocp;
    swb_trajectory *r = NULL;
    swb_trajectory_info info;
    swb_switch s;
    swb_stats stats;
    swb_residuals residuals;
    swb_certificate certificate;
    int32_t outcome = -1, polished = -1, one_sided = -1;
    int64_t stage[10];
    double cost = 0.0, x[11];

    CHECK_OK(swb_settings_init(&settings, sizeof settings));
    settings.n_fe = 2;
    ocp = make_problem(&settings);
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_cost(ocp, &cost));
    CHECK(strstr(swb_last_error(), "swb_ocp_solve") != NULL);
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_trajectory(ocp, &r));
    CHECK(r == NULL);
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_sensitivity(ocp, x, 1, NULL, 0, NULL));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_ocp_get_polished(ocp, &polished));
    CHECK(polished == SWB_POLISHED_DONE);
    CHECK_OK(swb_ocp_get_certificate(ocp, &certificate, sizeof certificate));
    CHECK(certificate.stationarity == SWB_STATIONARITY_S && certificate.b_stationarity == SWB_B_STATIONARITY_YES);
    CHECK_OK(swb_ocp_get_cost(ocp, &cost));
    CHECK_NEAR(cost, best, 1e-9);
    CHECK_OK(swb_ocp_get_trajectory(ocp, &r));
    CHECK_OK(swb_trajectory_get_info(r, &info, sizeof info));
    CHECK(info.n_elements == 10 && info.n_switches == 1 && info.t_end == 2.0);
    CHECK_OK(swb_trajectory_states(r, x, 11));
    CHECK_NEAR(x[0], x0, 1e-6);
    CHECK_NEAR(x[10], 2.0 + x0 / 3.0, 1e-6);
    CHECK_OK(swb_trajectory_switches(r, &s, 1, sizeof s));
    CHECK_NEAR(s.t, -x0 / 3.0, 1e-6);
    CHECK_OK(swb_trajectory_control_stages(r, stage, 10));
    CHECK(stage[0] == 0 && stage[1] == 0 && stage[2] == 1 && stage[9] == 4);
    CHECK_OK(swb_ocp_get_stats(ocp, &stats, sizeof stats));
    CHECK(stats.iterations > 0 && stats.n_variables > 0 && stats.n_constraints > 0 && stats.n_pairs > 0);
    CHECK(stats.time_build > 0.0);
    CHECK_OK(swb_ocp_get_residuals(ocp, &residuals, sizeof residuals));
    CHECK(residuals.primal < 1e-9 && residuals.dual < 1e-6 && residuals.pair_min < 1e-9);
    CHECK_OK(swb_ocp_get_controls(ocp, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_get_controls(ocp, x, 1));
    swb_trajectory_free(r);

    /* The initial state is free here: no datum. */
    CHECK_OK(swb_ocp_get_sensitivity(ocp, x, 1, NULL, 0, &one_sided));
    CHECK(x[0] == 0.0 && one_sided == 0);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_get_sensitivity(ocp, x, 2, NULL, 0, NULL));
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_get_sensitivity(NULL, x, 1, NULL, 0, NULL));

    /* Again, with what was built, and with other options. */
    CHECK_OK(swb_ocp_solve(ocp, NULL));
    CHECK_OK(swb_ocp_get_stats(ocp, &stats, sizeof stats));
    CHECK_OK(swb_ocp_set_int(ocp, "ocp_start", SWB_OCP_START_HOMOTOPY));
    CHECK_OK(swb_ocp_solve(ocp, NULL));
    CHECK_OK(swb_ocp_solve(ocp, NULL));
    CHECK_OK(swb_ocp_get_stats(ocp, &stats, sizeof stats));
    CHECK(stats.time_build == 0.0);
    CHECK_OK(swb_ocp_set_int(ocp, "n_s", 2));
    CHECK_OK(swb_ocp_get_settings(ocp, &settings, sizeof settings));
    CHECK(settings.n_s == 2 && settings.n_fe == 2 && settings.initial_guess == SWB_INITIAL_GUESS_CONSTANT);
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_ocp_get_cost(ocp, &cost));
    CHECK(cost >= best - 1e-9 && cost < best + 1e-8);
    CHECK_OK(swb_ocp_get_stats(ocp, &stats, sizeof stats));
    CHECK(stats.time_build > 0.0);
    /* From a simulation: another start may end in another local solution. */
    CHECK_OK(swb_ocp_set_string(ocp, "initial_guess", "simulation"));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_ocp_get_cost(ocp, &cost));
    CHECK(cost >= best - 1e-9);
    CHECK_OK(swb_ocp_set_int(ocp, "max_iter", 2));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_MAX_ITER);
    /* what is no solution shows no cost, but says what its point costs to who asks for that */
    CHECK_OK(swb_ocp_get_cost(ocp, &cost));
    CHECK(isnan(cost));
    CHECK_OK(swb_ocp_get_cost_reached(ocp, &cost));
    CHECK(isfinite(cost));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_sensitivity(ocp, x, 1, NULL, 0, NULL));
    CHECK_OK(swb_ocp_set_double(ocp, "max_time", 0.0));
    CHECK_OK(swb_ocp_set_int(ocp, "max_iter", 1000));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_MAX_TIME);
    swb_ocp_free(ocp);
}

/* x1' = v1 + u-free part that slides on x1 = 0; v' = u; path, terminal and control bounds, guesses. */
static int32_t drift(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    out[1] = at->u[0] + at->p[0];
    return 0;
}

static int32_t push(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[0] = 1.0;
    out[1] = -1.0;
    return 0;
}

static int32_t effort(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] * at->u[0] + at->x[1] * at->x[1];
    return 0;
}

static int32_t speed(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1] + 0.0 * at->u[0];
    return 0;
}

static int32_t both(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    out[1] = at->x[1];
    return 0;
}

static void constraints(void)
{
    static const int64_t rows[] = {0};
    static const int8_t signs[] = {-1, 1};
    static const double x0[] = {-0.5, 0.0}, goal[] = {0.25, 0.5}, u_lower[] = {-4.0}, u_upper[] = {4.0};
    static const double x_lower[] = {-1.0, -(double)INFINITY}, x_upper[] = {1.0, 1e20};
    static const double v_lower[] = {-2.0}, v_upper[] = {1.4}, p[] = {0.1}, times[] = {0.0, 2.0};
    static const double guess[] = {-0.5, 0.0, 0.25, 0.5}, u_guess[] = {1.0, 1.0, 0.0, -1.0};
    swb_function *f0 = make_function("f0", 2, 1, 1, 2, drift, NULL), *psi = make_function("c", 2, 1, 1, 1, first_state, NULL);
    swb_function *modes = make_function("F", 2, 1, 1, 2, push, NULL), *rate = make_function("L", 2, 1, 1, 1, effort, NULL);
    swb_function *path = make_function("v", 2, 1, 1, 1, speed, NULL), *end = make_function("e", 2, 1, 1, 2, both, NULL);
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    swb_trajectory *r = NULL;
    swb_trajectory_info info;
    int32_t outcome = -1, at;
    double u[4], *x, last = 0.0, cost;
    int64_t i;

    CHECK_OK(swb_system_create(2, 1, 1, &system));
    CHECK_OK(swb_system_set_f0(system, f0));
    CHECK_OK(swb_system_add_subsystem(system, rows, 1, modes, 2, psi, signs, 2, NULL));
    CHECK_OK(swb_ocp_create(system, 2.0, 4, NULL, &ocp));
    CHECK_OK(swb_ocp_set_lagrange(ocp, rate));
    CHECK_OK(swb_ocp_add_terminal(ocp, end, goal, 2, goal, 2));
    CHECK_OK(swb_ocp_set_initial_state(ocp, x0, 2));
    CHECK_OK(swb_ocp_set_state_bounds(ocp, x_lower, 2, x_upper, 2));
    CHECK_OK(swb_ocp_set_control_bounds(ocp, u_lower, 1, u_upper, 1));
    CHECK_OK(swb_ocp_set_params(ocp, p, 1));
    u[0] = (double)NAN, u[1] = 2.0; /* nothing of the first state is known */
    CHECK_OK(swb_ocp_set_nominal(ocp, u, 2, u + 1, 1, NULL, 0));
    CHECK_OK(swb_ocp_set_initial_time(ocp, 10.0));
    CHECK_OK(swb_ocp_set_state_guess(ocp, times, 2, guess, 4));
    CHECK_OK(swb_ocp_set_control_guess(ocp, u_guess, 4));
    without_search(ocp);
    for (at = SWB_PATH_AT_CONTROL_GRID; at <= SWB_PATH_AT_STAGE_POINTS; at++) {
        CHECK_OK(swb_ocp_add_path(ocp, path, v_lower, 1, v_upper, 1, at));
        if (check_slow() && at < SWB_PATH_AT_STAGE_POINTS)
            continue;
        CHECK_OK(swb_ocp_solve(ocp, &outcome));
        CHECK(outcome == SWB_OUTCOME_SOLVED);
        CHECK_OK(swb_ocp_get_cost(ocp, &cost));
        CHECK(cost >= last - 1e-6); /* more constraints cost more */
        last = cost;
    }
    CHECK_OK(swb_ocp_get_controls(ocp, u, 4));
    for (i = 0; i < 4; i++)
        CHECK(fabs(u[i]) <= 4.0 + 1e-9);
    CHECK_OK(swb_ocp_get_trajectory(ocp, &r));
    CHECK_OK(swb_trajectory_get_info(r, &info, sizeof info));
    CHECK_NEAR(info.t_start, 10.0, 1e-14);
    CHECK_NEAR(info.t_end, 12.0, 1e-12);
    x = malloc((size_t)(2 * (info.n_elements + 1)) * sizeof *x);
    CHECK_OK(swb_trajectory_states(r, x, 2 * (info.n_elements + 1)));
    for (i = 0; i <= info.n_elements; i++)
        CHECK(x[2 * i + 1] <= 1.4 + 1e-7);
    CHECK_NEAR(x[2 * info.n_elements], 0.25, 1e-8);
    CHECK_NEAR(x[2 * info.n_elements + 1], 0.5, 1e-8);
    free(x);
    swb_trajectory_free(r);

    /* Refusals. */
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_add_path(ocp, path, v_upper, 1, v_lower, 1, SWB_PATH_AT_ELEMENTS));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_add_path(ocp, path, v_lower, 1, v_upper, 1, 3));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_add_path(ocp, end, v_lower, 1, v_upper, 1, SWB_PATH_AT_ELEMENTS));
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_add_path(ocp, NULL, v_lower, 1, v_upper, 1, SWB_PATH_AT_ELEMENTS));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_set_lagrange(ocp, end));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_set_params(ocp, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_set_control_guess(ocp, u, 3));
    u[0] = 0.0, u[1] = 1.0;
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_nominal(ocp, u, 2, NULL, 0, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_set_nominal(ocp, NULL, 0, u, 2, NULL, 0));
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_set_nominal(ocp, NULL, 2, NULL, 0, NULL, 0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_state_guess(ocp, x0, 0, guess, 0));
    u[0] = (double)NAN;
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_control_bounds(ocp, u, 1, u_upper, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_params(ocp, u, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_initial_time(ocp, u[0]));
    u[1] = 0.0;
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_initial_state(ocp, u, 2));
    CHECK_STATUS(SWB_ERR_OPTION, swb_ocp_set_int(ocp, "n_stages", 3));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_int(ocp, "n_s", 30));
    swb_ocp_free(ocp);
    ocp = NULL;
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_create(system, -1.0, 4, NULL, &ocp));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_create(system, (double)NAN, 4, NULL, &ocp));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_create(system, 1.0, 0, NULL, &ocp));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_create(system, 1.0, -4, NULL, &ocp));
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_create(NULL, 1.0, 4, NULL, &ocp));
    CHECK(ocp == NULL);
    swb_system_free(system);
    swb_function_free(f0);
    swb_function_free(psi);
    swb_function_free(modes);
    swb_function_free(rate);
    swb_function_free(path);
    swb_function_free(end);
}

static int32_t duration(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[0] = 1.0;
    return 0;
}

static int32_t ends(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[2] - at->x[0];
    return 0;
}

/* The fastest way from rest to rest over a distance of 1 with -2 <= u <= 1 takes sqrt(3), the switch at 2/sqrt(3). */
static void free_lengths(void)
{
    char text[1000];
    static const double x0[] = {0.0, 0.0}, goal[] = {1.0, 0.0}, lower[] = {-2.0}, upper[] = {1.0}, one[] = {1.0};
    static const double weights[] = {1.0, 1.0}, lengths[] = {0.4, 0.6}, zero[] = {0.0, 0.0}, seven[] = {7.0, 7.0};
    static const int64_t elements[] = {1, 2}, first[] = {0};
    static const int32_t linear[] = {1};
    swb_function *f0 = make_function("f0", 2, 1, 1, 2, drift, NULL), *end = make_function("e", 2, 1, 1, 2, both, NULL);
    swb_function *rate = make_function("L", 2, 1, 1, 1, duration, NULL), *across = make_function("b", 4, 1, 1, 1, ends, NULL);
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    swb_accuracy accuracy;
    swb_certificate certificate;
    swb_optimality optimality;
    swb_kink kink;
    int64_t length = 0;
    int32_t outcome = -1;
    swb_function *all[4];
    double found[2], times[3], costates[6], cost = 0.0, violation = -1.0;
    int64_t n_times = 0, width = 0;
    int i;

    all[0] = f0, all[1] = end, all[2] = rate, all[3] = across;
    for (i = 0; i < 4; i++) /* none depends on the parameter */
        CHECK_OK(swb_function_set_inputs(all[i], SWB_INPUT_X + SWB_INPUT_U));
    CHECK_OK(swb_system_create(2, 1, 1, &system));
    CHECK_OK(swb_system_set_f0(system, f0));
    CHECK_OK(swb_ocp_create(system, 1.0, 2, NULL, &ocp));
    CHECK_OK(swb_ocp_set_initial_state(ocp, x0, 2));
    CHECK_OK(swb_ocp_set_control_bounds(ocp, lower, 1, upper, 1));
    CHECK_OK(swb_ocp_set_lagrange(ocp, rate));
    CHECK_OK(swb_ocp_add_relaxed(ocp, end, goal, 2, goal, 2, -1, SWB_NORM_L1, 1e3));
    CHECK_OK(swb_ocp_add_boundary(ocp, across, one, 1, one, 1));
    CHECK_OK(swb_ocp_set_free_time(ocp, SWB_FREE_TIME_STAGES, 0.1, 5.0));
    CHECK_OK(swb_ocp_set_durations(ocp, lengths, 2));
    CHECK_OK(swb_ocp_set_elements(ocp, elements, 2));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_shift(ocp));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_durations(ocp, found, 2));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_accuracy(ocp, &accuracy, sizeof accuracy));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_certificate(ocp, &certificate, sizeof certificate));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_solve(ocp, &outcome)); /* the parameter has no value */
    CHECK_OK(swb_ocp_set_params(ocp, zero, 1));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_ocp_get_durations(ocp, found, 2));
    CHECK_NEAR(found[0], 2.0 / sqrt(3.0), 1e-6);
    CHECK_NEAR(found[1], 1.0 / sqrt(3.0), 1e-6);
    CHECK_OK(swb_ocp_get_control_ends(ocp, found, 2));
    CHECK_NEAR(found[0], 1.0, 1e-6);
    CHECK_NEAR(found[1], -2.0, 1e-6);
    CHECK_OK(swb_ocp_get_cost(ocp, &cost));
    CHECK_NEAR(cost, sqrt(3.0), 1e-6);
    CHECK_OK(swb_ocp_get_violation(ocp, &violation));
    CHECK(violation < 1e-8);
    CHECK_OK(swb_ocp_get_accuracy(ocp, &accuracy, sizeof accuracy));
    CHECK_OK(swb_ocp_get_certificate(ocp, &certificate, sizeof certificate));
    CHECK(certificate.stationarity == SWB_STATIONARITY_S); /* without pairs: multipliers, and curvature */
    CHECK(certificate.second_order == SWB_SECOND_ORDER_STRICT_MINIMUM);
    CHECK(accuracy.reached == 1 && accuracy.terminal < 1e-8 && fabs(accuracy.cost_error) < 1e-6);
    CHECK_OK(swb_ocp_get_optimality(ocp, &optimality, sizeof optimality));
    CHECK(optimality.verdict == SWB_VERDICT_LOCAL_OPTIMUM && optimality.residual < 1e-3 && optimality.n_kinks == 0);
    CHECK_OK(swb_ocp_get_optimality_reason(ocp, NULL, 0, &length));
    CHECK(length == 1);
    CHECK_OK(swb_ocp_get_reduced_gradient(ocp, found, 2)); /* both controls are at bounds: against them the cost rises */
    CHECK(found[0] < 0.0 && found[1] > 0.0);
    CHECK_OK(swb_ocp_get_descent(ocp, found, 2));
    CHECK(found[0] == 0.0 && found[1] == 0.0);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_get_descent(ocp, found, 1));
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_get_optimality(ocp, NULL, sizeof optimality));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_get_kink(ocp, 0, &kink, sizeof kink));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_get_kink(ocp, -1, &kink, sizeof kink));
    /* the Hamiltonian 1 + lambda_q v + lambda_v u of the fastest way vanishes, with u = 1 at the start and -2 at the end */
    CHECK_OK(swb_ocp_multiplier_sizes(ocp, SWB_MULTIPLIERS_OF_COSTATES, 0, &n_times, &width));
    CHECK(n_times == 3 && width == 2);
    CHECK_OK(swb_ocp_get_multipliers(ocp, SWB_MULTIPLIERS_OF_COSTATES, 0, times, 3, costates, 6));
    CHECK_NEAR(costates[1], -1.0, 1e-6);
    CHECK_NEAR(costates[5], 0.5, 1e-6);
    CHECK(times[0] == 0.0 && fabs(times[2] - sqrt(3.0)) < 1e-6);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_get_multipliers(ocp, SWB_MULTIPLIERS_OF_COSTATES, 0, times, 3, costates, 5));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_multiplier_sizes(ocp, 9, 0, &n_times, &width));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_multiplier_sizes(ocp, SWB_MULTIPLIERS_OF_PATH, -1, &n_times, &width));
    CHECK_OK(swb_ocp_count_multipliers(ocp, SWB_MULTIPLIERS_OF_PATH, &n_times));
    CHECK(n_times == 0);
    CHECK_OK(swb_ocp_get_mismatch(ocp, found, 2));
    CHECK(found[0] <= accuracy.worst && found[1] <= accuracy.worst);
    CHECK_OK(swb_ocp_get_params(ocp, found, 1));
    CHECK(found[0] == 0.0);
    CHECK_OK(swb_ocp_solve_warm(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_ocp_set_int(ocp, "accuracy", 0));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_accuracy(ocp, &accuracy, sizeof accuracy));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_optimality(ocp, &optimality, sizeof optimality));

    /* Refusals. */
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_free_time(ocp, 3, 0.0, 1.0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_free_time(ocp, SWB_FREE_TIME_HORIZON, 2.0, 1.0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_add_relaxed(ocp, end, goal, 2, goal, 2, -2, SWB_NORM_L1, 1.0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_add_relaxed(ocp, end, goal, 2, goal, 2, -1, 9, 1.0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_add_boundary(ocp, end, goal, 2, goal, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_set_durations(ocp, lengths, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_set_elements(ocp, elements, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_add_least_squares(ocp, end, weights, 1, zero, 2, SWB_COST_AT_RUNNING));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_references(ocp, 0, zero, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_set_stage_params(ocp, zero, 1));
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_add_periodic(ocp, NULL, 1));
    CHECK_OK(swb_ocp_add_least_squares(ocp, end, weights, 2, zero, 2, SWB_COST_AT_TERMINAL));
    CHECK_OK(swb_ocp_set_references(ocp, 0, seven, 2));
    CHECK_OK(swb_ocp_add_periodic(ocp, first, 0));
    CHECK_OK(swb_ocp_set_linear_controls(ocp, linear, 1));
    CHECK_OK(swb_ocp_add_horizon(ocp, 0.5, 4.0));
    CHECK_OK(swb_ocp_set_stage_params(ocp, zero, 2));
    CHECK_OK(swb_ocp_set_param_bounds(ocp, lower, 1, upper, 1));
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_ocp_solve(ocp, NULL));
    CHECK(strstr(swb_last_error(), "parameter 0 is free") != NULL);
    CHECK_OK(swb_ocp_get_message(ocp, text, sizeof text, NULL));
    CHECK(strstr(text, "parameter 0 is free") != NULL);
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_function_free(f0);
    swb_function_free(rate);
    swb_function_free(end);
    swb_function_free(across);
}

/* x' = u with |u| <= 1 in a time of 1, twice: a goal out of reach, and a right-hand side that ends before the goal. */
static int32_t walled(const swb_point *at, double *out, void *user_data)
{
    const double *wall = user_data;

    out[0] = at->x[0] > *wall ? NAN : at->u[0];
    return 0;
}

static int32_t place(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    return 0;
}

static void message(double wall, double goal, const char *expected)
{
    static const double start[] = {0.0}, lower[] = {-1.0}, upper[] = {1.0};
    swb_function *f0 = make_function("speed", 1, 1, 0, 1, walled, &wall), *end = make_function("goal", 1, 1, 0, 1, place, NULL);
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    int32_t outcome = -1;
    int64_t needed = 0;
    char text[1000];

    CHECK_OK(swb_system_create(1, 1, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f0));
    CHECK_OK(swb_ocp_create(system, 1.0, 4, NULL, &ocp));
    CHECK_OK(swb_ocp_set_initial_state(ocp, start, 1));
    CHECK_OK(swb_ocp_set_control_bounds(ocp, lower, 1, upper, 1));
    CHECK_OK(swb_ocp_add_terminal(ocp, end, &goal, 1, &goal, 1));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_message(ocp, text, sizeof text, NULL));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK((outcome == SWB_OUTCOME_SOLVED) == (expected[0] == '\0'));
    CHECK_OK(swb_ocp_get_message(ocp, NULL, 0, &needed));
    CHECK_OK(swb_ocp_get_message(ocp, text, sizeof text, NULL));
    CHECK(needed == (int64_t)strlen(text) + 1 && strstr(text, expected) == text);
    if (needed > 1)
        CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_get_message(ocp, text, 1, NULL));
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_function_free(f0);
    swb_function_free(end);
}

/* Two controls, one of which is zero, in two phases of the same system. */
static int32_t sum_of_controls(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] - 2.0 * at->u[1];
    return 0;
}

static int32_t one_control(const swb_point *at, double *out, void *user_data)
{
    out[0] = at->u[*(const int *)user_data];
    return 0;
}

static int32_t apart(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1] - at->x[0];
    return 0;
}

static int32_t squares_of_controls(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] * at->u[0] + at->u[1] * at->u[1];
    return 0;
}

static swb_ocp *half(const swb_system *system, const swb_function *rate, const swb_function *up, const swb_function *down)
{
    static const double lower[] = {0.0, 0.0}, upper[] = {5.0, 5.0};
    swb_ocp *ocp = NULL;

    CHECK_OK(swb_ocp_create(system, 1.0, 2, NULL, &ocp));
    CHECK_OK(swb_ocp_set_lagrange(ocp, rate));
    CHECK_OK(swb_ocp_set_control_bounds(ocp, lower, 2, upper, 2));
    CHECK_OK(swb_ocp_add_complementarity(ocp, up, down, SWB_PATH_AT_CONTROL_GRID));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_add_complementarity(ocp, up, down, 7));
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_add_complementarity(ocp, up, NULL, 0));
    return ocp;
}

static void phases(void)
{
    static int first = 0, second = 1;
    static const double start[] = {0.0}, there[] = {1.0}, back[] = {-0.5}, zero[] = {0.0}, one[] = {1.0};
    swb_function *f0 = make_function("f0", 1, 2, 0, 1, sum_of_controls, NULL);
    swb_function *up = make_function("up", 1, 2, 0, 1, one_control, &first);
    swb_function *down = make_function("down", 1, 2, 0, 1, one_control, &second);
    swb_function *rate = make_function("rate", 1, 2, 0, 1, squares_of_controls, NULL);
    swb_function *end = make_function("end", 1, 2, 0, 1, place, NULL), *gap = make_function("gap", 2, 0, 0, 1, apart, NULL);
    swb_system *system = NULL;
    swb_ocp *parts[2], *found = NULL;
    swb_multiphase *m = NULL;
    swb_multiphase_info info;
    int32_t outcome = -1;
    int64_t nx, nu, np, n_stages, needed = 0;
    double u[4];
    char text[200];

    CHECK_OK(swb_system_create(1, 2, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f0));
    parts[0] = half(system, rate, up, down);
    parts[1] = half(system, rate, up, down);
    CHECK_OK(swb_ocp_set_initial_state(parts[0], start, 1));
    CHECK_OK(swb_ocp_add_terminal(parts[0], end, there, 1, there, 1));
    CHECK_OK(swb_ocp_add_terminal(parts[1], end, back, 1, back, 1));
    CHECK_OK(swb_ocp_sizes(parts[0], &nx, &nu, &np, &n_stages));
    CHECK(nx == 1 && nu == 2 && np == 0 && n_stages == 2);
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_sizes(NULL, NULL, NULL, NULL, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_multiphase_create(parts, 0, NULL, &m));
    CHECK_STATUS(SWB_ERR_NULL, swb_multiphase_create(NULL, 2, NULL, &m));
    CHECK_OK(swb_multiphase_create(parts, 2, NULL, &m));
    swb_ocp_free(parts[0]);
    swb_ocp_free(parts[1]);
    CHECK_STATUS(SWB_ERR_STATE, swb_multiphase_get_info(m, &info, sizeof info));
    CHECK_STATUS(SWB_ERR_STATE, swb_multiphase_get_phase(m, 0, &found));
    CHECK(found == NULL);
    CHECK_STATUS(SWB_ERR_RANGE, swb_multiphase_link(m, 1, gap, one, 1, one, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_multiphase_link(m, -1, gap, one, 1, one, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_multiphase_link(m, 0, end, one, 1, one, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_multiphase_link_continuous(m, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_multiphase_link_reset(m, 1, end));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_multiphase_link_reset(m, 0, gap));
    CHECK_STATUS(SWB_ERR_NULL, swb_multiphase_link_reset(m, 0, NULL));
    /* the second phase begins 1 above the end of the first: from 2 to -1/2 at 2.5 by u = (0, 1.25) */
    CHECK_OK(swb_multiphase_link(m, 0, gap, one, 1, one, 1));
    CHECK_OK(swb_multiphase_solve(m, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_multiphase_get_info(m, &info, sizeof info));
    CHECK(info.n_phases == 2 && info.polished == SWB_POLISHED_DONE && info.iterations > 0);
    CHECK_NEAR(info.cost, 1.0 + 1.25 * 1.25, 1e-7);
    CHECK(info.link_violation < 1e-9 && info.error < 1e-7);
    CHECK_OK(swb_multiphase_get_message(m, text, sizeof text, &needed));
    CHECK(needed == 1);
    CHECK_OK(swb_multiphase_get_phase(m, 1, &found));
    CHECK_OK(swb_ocp_get_controls(found, u, 4));
    CHECK_NEAR(u[0], 0.0, 1e-9);
    CHECK_NEAR(u[1], 1.25, 1e-6);
    CHECK_NEAR(u[3], 1.25, 1e-6);
    swb_ocp_free(found);
    CHECK_STATUS(SWB_ERR_RANGE, swb_multiphase_get_phase(m, 2, &found));
    CHECK_OK(swb_multiphase_interrupt(m));
    CHECK_OK(swb_multiphase_solve(m, &outcome));
    CHECK(outcome == SWB_OUTCOME_STOPPED);
    CHECK_OK(swb_multiphase_link(m, 0, gap, zero, 1, zero, 1));
    CHECK_OK(swb_multiphase_solve(m, &outcome));
    CHECK(outcome != SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_multiphase_get_message(m, NULL, 0, &needed));
    CHECK(needed > 1);
    swb_multiphase_free(m);
    swb_multiphase_free(NULL);
    swb_system_free(system);
    swb_function_free(f0);
    swb_function_free(up);
    swb_function_free(down);
    swb_function_free(rate);
    swb_function_free(end);
    swb_function_free(gap);
}

/* x' in {3, 1} across x = 0, the running cost is the distance from a line: the modes of the solution lead back to it, and
   starts give the same whatever the number of threads. */
static int32_t driven_slopes(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = 3.0 + at->u[0];
    out[1] = 1.0 + at->u[0];
    return 0;
}

static int32_t effort_and_distance(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] * at->u[0] + at->x[0] * at->x[0];
    return 0;
}

static void modes_starts_and_grids(void)
{
    static const double start[] = {-1.0}, lower[] = {-1.0}, upper[] = {1.0}, late[] = {0.5};
    static const int32_t one[] = {1, 0};
    swb_function *f = make_function("slopes", 1, 1, 0, 2, driven_slopes, NULL), *psi = make_function("psi", 1, 1, 0, 1, place, NULL);
    swb_function *cost = make_function("cost", 1, 1, 0, 1, effort_and_distance, NULL);
    static const int8_t signs[] = {-1, 1};
    static const int64_t rows[] = {0};
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    int32_t outcome = -1, reached = -1, modes[100], cells[100], before[100];
    int64_t n = 0, n_modes = 0, n_cells = 0, best = -1, kept = -1, elements[4], n_variables = 0;
    double times[50], value = 0.0, found = 0.0, error = 0.0, u[12], controls[2][12];

    CHECK_OK(swb_system_create(1, 1, 0, &system));
    CHECK_OK(swb_system_add_subsystem(system, rows, 1, f, 2, psi, signs, 2, NULL));
    CHECK_OK(swb_ocp_create(system, 2.0, 4, NULL, &ocp));
    CHECK_OK(swb_ocp_set_lagrange(ocp, cost));
    CHECK_OK(swb_ocp_set_initial_state(ocp, start, 1));
    CHECK_OK(swb_ocp_set_control_bounds(ocp, lower, 1, upper, 1));
    without_search(ocp);
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_mode_sizes(ocp, &n, NULL, NULL));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_ocp_get_cost(ocp, &value));
    CHECK_OK(swb_ocp_mode_sizes(ocp, &n, &n_modes, &n_cells));
    CHECK(n >= 2 && n <= 50 && n_modes == 2 && n_cells == 2);
    CHECK_OK(swb_ocp_get_modes(ocp, times, n, modes, 2 * n, cells, 2 * n));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_get_modes(ocp, times, n - 1, modes, 2 * n, NULL, 0));
    CHECK(times[0] == 0.0 && modes[0] == 1 && modes[1] == 0);
    CHECK_OK(swb_ocp_set_modes(ocp, times, n, modes, 2 * n, cells, 2 * n));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK_OK(swb_ocp_get_cost(ocp, &found));
    CHECK(fabs(found - value) < 1e-9);
    CHECK_OK(swb_ocp_get_modes(ocp, times, n, before, 2 * n, NULL, 0));
    CHECK(memcmp(before, modes, (size_t)(2 * n) * sizeof *modes) == 0);
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_modes(ocp, late, 1, one, 2, NULL, 0));
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_set_modes(ocp, times, n, NULL, 2 * n, NULL, 0));
    CHECK_OK(swb_ocp_set_modes(ocp, NULL, 0, NULL, 0, NULL, 0));

    CHECK_OK(swb_ocp_random_starts(ocp, 3, u, 12));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_random_starts(ocp, 3, u, 11));
    for (int k = 0; k < 2; k++) {
        CHECK_OK(swb_ocp_solve_starts(ocp, u, 12, 2 * k + 1, &best));
        CHECK(best >= 0 && best < 3);
        for (int64_t i = 0; i < 3; i++)
            CHECK_OK(swb_ocp_get_start(ocp, i, &outcome, NULL, &found, controls[k] + 4 * i, 4));
    }
    CHECK(memcmp(controls[0], controls[1], sizeof controls[0]) == 0);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_get_start(ocp, 3, &outcome, NULL, NULL, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_solve_starts(ocp, u, 11, 1, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_solve_starts(ocp, u, 12, -1, NULL));
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_solve_starts(ocp, NULL, 12, 1, NULL));
    u[4] = NAN;
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_solve_starts(ocp, u, 12, 1, NULL));

    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_get_adaptation(ocp, &n, NULL, NULL));
    CHECK_OK(swb_ocp_set_double(ocp, "adapt_tol", 1e-9));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK_OK(swb_ocp_get_adaptation(ocp, &n, &kept, &reached));
    CHECK(n >= 1 && kept >= 0 && kept < n && reached == 1);
    CHECK_OK(swb_ocp_get_round(ocp, kept, elements, 4, &n_variables, NULL, &error, &found));
    CHECK(error <= 1e-9 && n_variables > 0 && elements[0] >= 1 && fabs(found - value) < 1e-3);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_get_round(ocp, n, NULL, 0, NULL, NULL, NULL, NULL));
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_function_free(f);
    swb_function_free(psi);
    swb_function_free(cost);
}

static long calls, interrupt_at;
static swb_ocp *running;

/* x' = u - x, a function that interrupts the call it is called by. */
static int32_t decay(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    if (++calls == interrupt_at) CHECK_OK(swb_ocp_interrupt(running));
    out[0] = at->u[0] - at->x[0];
    return 0;
}

/* An interrupt in the comparison, or in the certificate behind it, leaves the solution; no function is called behind an interrupt anywhere. */
static void interrupts(void)
{
    static const double start[] = {1.0}, lower[] = {-1.0}, upper[] = {1.0};
    swb_function *f = make_function("decay", 1, 1, 0, 1, decay, NULL);
    swb_function *rate = make_function("L", 1, 1, 0, 1, first_state_squared, NULL);
    swb_system *system = NULL;
    swb_accuracy accuracy;
    int32_t outcome = -1;
    double cost, found;
    swb_optimality optimality;
    char text[256];
    long all, k, compared = 0;

    CHECK_OK(swb_system_create(1, 1, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f));
    CHECK_OK(swb_ocp_create(system, 1.0, 4, NULL, &running));
    CHECK_OK(swb_ocp_set_lagrange(running, rate));
    CHECK_OK(swb_ocp_set_initial_state(running, start, 1));
    CHECK_OK(swb_ocp_set_control_bounds(running, lower, 1, upper, 1));
    CHECK_OK(swb_ocp_solve(running, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_ocp_get_cost(running, &cost));
    calls = 0;
    CHECK_OK(swb_ocp_solve(running, &outcome));
    all = calls;
    for (k = 1; k <= 100; k++) {
        calls = 0;
        interrupt_at = all * k / 100;
        CHECK_OK(swb_ocp_solve(running, &outcome));
        CHECK(calls == interrupt_at);
        CHECK(outcome == SWB_OUTCOME_STOPPED || outcome == SWB_OUTCOME_SOLVED);
        if (outcome == SWB_OUTCOME_STOPPED) continue;
        CHECK_OK(swb_ocp_get_cost(running, &found));
        CHECK_NEAR(found, cost, 1e-9); /* the tolerance of the solver, which may be stopped just before its last step */
        CHECK_OK(swb_ocp_get_optimality(running, &optimality, sizeof optimality));
        CHECK(optimality.verdict == SWB_VERDICT_UNKNOWN && isnan(optimality.residual));
        CHECK_OK(swb_ocp_get_optimality_reason(running, text, sizeof text, NULL));
        CHECK(strstr(text, "interrupted") != NULL);
        CHECK_OK(swb_ocp_get_accuracy(running, &accuracy, sizeof accuracy));
        if (accuracy.reached) continue;
        compared++;
        CHECK(isnan(accuracy.worst) && isnan(accuracy.cost_error));
        CHECK_OK(swb_ocp_get_message(running, text, sizeof text, NULL));
        CHECK(strstr(text, "interrupted in the comparison") != NULL);
    }
    CHECK(outcome == SWB_OUTCOME_SOLVED && compared > 0 && accuracy.reached);
    interrupt_at = 0;
    CHECK_OK(swb_ocp_solve(running, &outcome));
    CHECK_OK(swb_ocp_get_accuracy(running, &accuracy, sizeof accuracy));
    CHECK(outcome == SWB_OUTCOME_SOLVED && accuracy.reached == 1 && accuracy.worst < 1e-3);
    swb_ocp_free(running);
    swb_system_free(system);
    swb_function_free(f);
    swb_function_free(rate);
}

static int32_t driven(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] * (1.0 + at->x[1]);
    out[1] = 0.0;
    return 0;
}

static int32_t over_one(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0] - 1.0;
    return 0;
}

static int32_t squared_control(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] * at->u[0];
    return 0;
}

/* x' = u (1 + w), w goes on where x exceeds 1; from 0 to 3 with the least squared_control: u and 2 u share the way evenly. */
static void transitions(void)
{
    static const int64_t w = 1;
    static const double off = 0.0, on = 1.0, start[] = {0.0, 0.0}, low[] = {-9.0}, high[] = {9.0}, goal[] = {3.0};
    swb_function *f = make_function("f", 2, 1, 0, 2, driven, NULL), *guard = make_function("guard", 2, 1, 0, 1, over_one, NULL);
    swb_function *rate = make_function("L", 2, 1, 0, 1, squared_control, NULL), *end = make_function("e", 2, 1, 0, 1, first_state, NULL);
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    swb_ocp_jump jumps[2];
    double before[2], after[2], t = 0.0, cost = 0.0, again = 0.0;
    int64_t n = -1, which = -1, stage = -1;
    int32_t outcome = -1, at_once = -1;

    CHECK_OK(swb_system_create(2, 1, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f));
    CHECK_OK(swb_system_add_transition(system, guard, SWB_DIRECTION_RISING, &w, 1, &off, 1, NULL, &w, 1, &on, 1, NULL));
    CHECK_OK(swb_ocp_create(system, 2.0, 4, NULL, &ocp));
    CHECK_OK(swb_ocp_set_lagrange(ocp, rate));
    CHECK_OK(swb_ocp_set_control_bounds(ocp, low, 1, high, 1));
    CHECK_OK(swb_ocp_add_terminal(ocp, end, goal, 1, goal, 1));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_jump_count(ocp, &n));
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_solve(ocp, &outcome));
    CHECK(strstr(swb_last_error(), "state 1 is discrete") != NULL);
    CHECK_OK(swb_ocp_set_initial_state(ocp, start, 2));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_jump_count(ocp, NULL));
    CHECK_OK(swb_ocp_jump_count(ocp, &n));
    CHECK(n == 1);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_jumps(ocp, jumps, 2, sizeof jumps[0]));
    CHECK_OK(swb_ocp_jumps(ocp, jumps, 1, sizeof jumps[0]));
    CHECK(jumps[0].transition == 0 && jumps[0].at_once == 0 && jumps[0].stage >= 0 && jumps[0].stage < 4);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_jump_states(ocp, 1, before, after, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_jump_states(ocp, -1, before, after, 2));
    CHECK_OK(swb_ocp_jump_states(ocp, 0, before, after, 2));
    CHECK_NEAR(before[0], 1.0, 1e-8);
    CHECK(before[1] == 0.0 && after[1] == 1.0 && fabs(after[0] - before[0]) < 1e-12);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_ocp_get_mode_transitions(ocp, &t, &which, &stage, &at_once, 2));
    CHECK_OK(swb_ocp_get_mode_transitions(ocp, &t, &which, &stage, &at_once, 1));
    CHECK(t == jumps[0].t && which == 0 && stage == jumps[0].stage && at_once == 0);
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_set_mode_transitions(ocp, &t, &which, &stage, &at_once, 1));
    CHECK_OK(swb_ocp_get_cost(ocp, &cost));
    CHECK_OK(swb_ocp_set_modes(ocp, &off, 1, NULL, 0, NULL, 0));
    n = 1;
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_mode_transitions(ocp, &t, &n, &stage, &at_once, 1));
    CHECK_STATUS(SWB_ERR_NULL, swb_ocp_set_mode_transitions(ocp, &t, &which, NULL, &at_once, 1));
    CHECK_OK(swb_ocp_set_mode_transitions(ocp, &t, &which, &stage, &at_once, 1));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK_OK(swb_ocp_get_cost(ocp, &again));
    CHECK_NEAR(again, cost, 1e-9);
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_function_free(f);
    swb_function_free(guard);
    swb_function_free(rate);
    swb_function_free(end);
}

static int32_t pushed(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] - at->x[0];
    return 0;
}

static int32_t off_half(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = (at->x[0] - 0.5) * (at->x[0] - 0.5);
    return 0;
}

/* The cost of `x' = u - x` from 1 over stages of length 1/2 with the bits of a number as values of u: x = u + (x0 - u) exp(-t). */
static double cost_of(int bits)
{
    double x = 1.0, cost = 0.0;
    for (int k = 0; k < 4; k++) {
        const double u = bits >> k & 1, d = x - u, c = u - 0.5, h = 0.5;
        cost += c * c * h + 2.0 * c * d * (1.0 - exp(-h)) + 0.5 * d * d * (1.0 - exp(-2.0 * h));
        x = u + d * exp(-h);
    }
    return cost;
}

/* A control that is on or off: the best of all sequences, with its proof. */
static void choices(void)
{
    static const double start = 1.0, values[] = {1.0, 0.0}, twice[] = {1.0, 1.0};
    swb_function *f = make_function("f", 1, 1, 0, 1, pushed, NULL), *rate = make_function("L", 1, 1, 0, 1, off_half, NULL);
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    swb_optimality found;
    double u[4], least = cost_of(0);
    int64_t index = -1;
    int32_t outcome = -1;

    for (int bits = 1; bits < 16; bits++)
        least = fmin(least, cost_of(bits));
    CHECK_OK(swb_system_create(1, 1, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_choice(system, 1, values, 2, 0.0, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_choice(system, -1, values, 2, 0.0, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_choice(system, 0, twice, 2, 0.0, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_choice(system, 0, values, 0, 0.0, NULL));
    CHECK_STATUS(SWB_ERR_NULL, swb_system_add_choice(system, 0, NULL, 2, 0.0, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_choice(system, 0, values, 2, -1.0, NULL));
    CHECK_OK(swb_system_add_choice(system, 0, values, 2, 0.0, &index));
    CHECK(index == 0);
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_choice(system, 0, values, 2, 0.0, NULL));
    CHECK(strstr(swb_last_error(), "already") != NULL);
    CHECK_OK(swb_ocp_create(system, 2.0, 4, NULL, &ocp));
    CHECK_OK(swb_ocp_set_lagrange(ocp, rate));
    CHECK_OK(swb_ocp_set_initial_state(ocp, &start, 1));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_ocp_get_controls(ocp, u, 4));
    int bits = 0;
    for (int k = 0; k < 4; k++) {
        CHECK(u[k] == 0.0 || u[k] == 1.0);
        bits |= (int)u[k] << k;
    }
    CHECK_NEAR(cost_of(bits), least, 1e-12);
    CHECK_OK(swb_ocp_get_optimality(ocp, &found, sizeof found));
    CHECK(found.verdict == SWB_VERDICT_GLOBAL && found.gap <= 1e-6);
    CHECK(strcmp(swb_verdict_name(SWB_VERDICT_GLOBAL), "global") == 0);
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_function_free(f);
    swb_function_free(rate);
}

int main(void)
{
    transitions();
    choices();
    interrupts();
    phases();
    known_solution();
    modes_starts_and_grids();
    constraints();
    free_lengths();
    message(2.0, 0.5, "");
    message(2.0, 1.25, "terminal constraint 0 ('goal') row 0 cannot be met: off by 0.2500 at best");
    message(0.4, 0.9, "the smooth part 'speed' of the right-hand side returned NaN in stage ");
    return CHECK_DONE();
}
