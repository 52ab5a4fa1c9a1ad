/* Simulation: the oscillator with its known solution, what can be read from a trajectory, going on. */
#include <stdlib.h>

#include "models.h"

static swb_simulator *make_simulator(int64_t n_s)
{
    swb_system *system = make_oscillator();
    swb_simulator *sim = NULL;
    swb_settings settings;

    CHECK_OK(swb_settings_init(&settings, sizeof settings));
    settings.n_s = n_s;
    settings.n_fe = 2;
    CHECK_OK(swb_simulator_create(system, &settings, &sim));
    swb_system_free(system);
    CHECK_OK(swb_simulator_set_state(sim, 0.0, OSCILLATOR_X0, 2));
    return sim;
}

static void oscillator(void)
{
    swb_simulator *sim = make_simulator(5);
    swb_trajectory *r = NULL;
    swb_trajectory_info info;
    swb_switch s;
    swb_stats stats;
    swb_residuals residuals;
    int32_t outcome = -1, *active;
    int64_t i, n, *stage, modes[1];
    double x[2], t, *times, *states, *steps, *stage_t, *stage_x, *theta, between[2], at[4];

    CHECK_OK(swb_simulator_run(sim, OSCILLATOR_T, 10, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_simulator_get_time(sim, &t));
    CHECK_NEAR(t, OSCILLATOR_T, 1e-15);
    CHECK_OK(swb_simulator_get_state(sim, x, 2));
    CHECK_NEAR(x[0], OSCILLATOR_XT[0], 1e-9);
    CHECK_NEAR(x[1], OSCILLATOR_XT[1], 1e-9);

    CHECK_OK(swb_simulator_get_trajectory(sim, &r));
    CHECK_OK(swb_trajectory_get_info(r, &info, sizeof info));
    CHECK(info.struct_size == sizeof info);
    CHECK(info.nx == 2 && info.n_s == 5 && info.n_subsystems == 1 && info.n_modes == 2);
    CHECK(info.n_elements == 20 && info.n_switches == 1);
    CHECK(info.t_start == 0.0);
    CHECK_NEAR(info.t_end, OSCILLATOR_T, 1e-14);

    CHECK_OK(swb_trajectory_switches(r, &s, 1, sizeof s));
    CHECK_NEAR(s.t, 1.0, 1e-9);
    CHECK(s.struct_size == sizeof s && s.subsystem == 0 && s.kind == SWB_SWITCH_KIND_CROSS);
    CHECK(s.before == 1 && s.after == 2);

    n = info.n_elements;
    times = malloc((size_t)(n + 1) * sizeof *times);
    states = malloc((size_t)(2 * (n + 1)) * sizeof *states);
    steps = malloc((size_t)n * sizeof *steps);
    stage = malloc((size_t)n * sizeof *stage);
    active = malloc((size_t)(2 * n) * sizeof *active);
    stage_t = malloc((size_t)(5 * n) * sizeof *stage_t);
    stage_x = malloc((size_t)(10 * n) * sizeof *stage_x);
    theta = malloc((size_t)(10 * n) * sizeof *theta);
    CHECK_OK(swb_trajectory_times(r, times, n + 1));
    CHECK_OK(swb_trajectory_states(r, states, 2 * (n + 1)));
    CHECK_OK(swb_trajectory_steps(r, steps, n));
    CHECK_OK(swb_trajectory_control_stages(r, stage, n));
    CHECK_OK(swb_trajectory_modes(r, modes, 1));
    CHECK_OK(swb_trajectory_active(r, active, 2 * n));
    CHECK_OK(swb_trajectory_stage_times(r, stage_t, 5 * n));
    CHECK_OK(swb_trajectory_stage_states(r, stage_x, 10 * n));
    CHECK_OK(swb_trajectory_stage_theta(r, theta, 10 * n));
    CHECK(modes[0] == 2 && times[0] == 0.0 && states[0] == OSCILLATOR_X0[0]);
    CHECK(states[2 * n] == x[0] && states[2 * n + 1] == x[1]);
    CHECK_NEAR(times[s.element], s.t, 1e-14);
    for (i = 0; i < n; i++) {
        int inside = i < s.element;
        CHECK_NEAR(times[i + 1], times[i] + steps[i], 1e-14);
        CHECK(active[2 * i] == inside && active[2 * i + 1] == !inside && stage[i] == 0);
        /* the last stage point of Radau IIA is the end of the element */
        CHECK_NEAR(stage_t[5 * i + 4], times[i + 1], 1e-14);
        CHECK(stage_x[10 * i + 8] == states[2 * i + 2] && stage_x[10 * i + 9] == states[2 * i + 3]);
        CHECK_NEAR(theta[10 * i] + theta[10 * i + 1], 1.0, 1e-9);
        CHECK_NEAR(theta[10 * i + 8], inside, 1e-9);
    }

    /* Dense output: the radius is exp(t - 1) as long as x is inside. */
    at[0] = 0.3;
    CHECK_OK(swb_trajectory_state_at(r, at, 1, between, 2));
    CHECK_NEAR(hypot(between[0], between[1]), exp(0.3 - 1.0), 1e-5);
    at[0] = times[3];
    at[1] = times[2];
    CHECK_OK(swb_trajectory_state_at(r, at, 2, stage_x, 4));
    CHECK_NEAR(stage_x[0], states[6], 1e-13);
    CHECK_NEAR(stage_x[3], states[5], 1e-13);
    at[0] = 2.0;
    CHECK_STATUS(SWB_ERR_RANGE, swb_trajectory_state_at(r, at, 1, between, 2));
    at[0] = (double)NAN;
    CHECK_STATUS(SWB_ERR_RANGE, swb_trajectory_state_at(r, at, 1, between, 2));

    CHECK_OK(swb_simulator_get_stats(sim, &stats, sizeof stats));
    CHECK(stats.n_steps == 10 && stats.n_homotopies <= 10 && stats.iterations > 10 && stats.time_total > 0.0);
    CHECK(stats.time_build > 0.0);
    CHECK_OK(swb_simulator_get_residuals(sim, &residuals, sizeof residuals));
    CHECK_NEAR(residuals.primal, 0.0, 1e-9);

    free(times);
    free(states);
    free(steps);
    free(stage);
    free(active);
    free(stage_t);
    free(stage_x);
    free(theta);
    swb_simulator_free(sim);
    CHECK_OK(swb_trajectory_get_info(r, &info, sizeof info)); /* it is a copy */
    swb_trajectory_free(r);
}

static void going_on(void)
{
    swb_simulator *sim = make_simulator(3);
    swb_trajectory *r = NULL;
    swb_trajectory_info info;
    double whole[2], parts[2], t;
    int i;

    CHECK_OK(swb_simulator_run(sim, 1.25, 10, NULL));
    CHECK_OK(swb_simulator_get_state(sim, whole, 2));
    CHECK_OK(swb_simulator_set_state(sim, 0.0, OSCILLATOR_X0, 2));
    for (i = 0; i < 4; i++)
        CHECK_OK(swb_simulator_step(sim, 0.125, NULL));
    CHECK_OK(swb_simulator_run(sim, 0.75, 6, NULL));
    CHECK_OK(swb_simulator_get_state(sim, parts, 2));
    CHECK_OK(swb_simulator_get_time(sim, &t));
    CHECK(t == 1.25);
    CHECK_NEAR(parts[0], whole[0], 1e-10);
    CHECK_NEAR(parts[1], whole[1], 1e-10);
    CHECK_OK(swb_simulator_get_trajectory(sim, &r));
    CHECK_OK(swb_trajectory_get_info(r, &info, sizeof info));
    CHECK(info.n_elements >= 20 && info.n_switches == 1 && info.t_start == 0.0); /* a step may be divided */
    swb_trajectory_free(r);

    /* Other options: the method changes, so the trajectory begins anew; time and state stay. */
    CHECK_OK(swb_simulator_set_int(sim, "n_s", 2));
    CHECK_OK(swb_simulator_set_string(sim, "cross", "stage"));
    CHECK_OK(swb_simulator_set_double(sim, "tol", 1e-8));
    CHECK_OK(swb_simulator_run(sim, 0.25, 2, NULL));
    CHECK_OK(swb_simulator_get_trajectory(sim, &r));
    CHECK_OK(swb_trajectory_get_info(r, &info, sizeof info));
    CHECK(info.n_s == 2 && info.n_elements == 4 && info.t_start == 1.25);
    swb_trajectory_free(r);

    CHECK_OK(swb_simulator_clear(sim));
    CHECK_OK(swb_simulator_get_trajectory(sim, &r));
    CHECK_OK(swb_trajectory_get_info(r, &info, sizeof info));
    CHECK(info.n_elements == 0 && info.n_switches == 0 && isnan(info.t_start));
    CHECK_OK(swb_trajectory_times(r, NULL, 0));
    CHECK_OK(swb_trajectory_states(r, NULL, 0));
    CHECK_OK(swb_trajectory_switches(r, NULL, 0, sizeof(swb_switch)));
    t = 1.5;
    CHECK_STATUS(SWB_ERR_STATE, swb_trajectory_state_at(r, &t, 1, parts, 2));
    swb_trajectory_free(r);
    swb_simulator_free(sim);
}

static int32_t forced(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] * at->p[0] * cos(at->t) - at->x[0];
    return 0;
}

/* A smooth system with time, controls and parameters; derivatives by differences. */
static void inputs(void)
{
    swb_system *system = NULL;
    swb_simulator *sim = NULL;
    swb_function *f0 = make_function("f0", 1, 1, 1, 1, forced, NULL);
    int32_t outcome;
    double x = 0.5, u = 2.0, p = 3.0, expected;

    CHECK_OK(swb_function_set_inputs(f0, SWB_INPUT_X + SWB_INPUT_U + SWB_INPUT_T));
    CHECK_OK(swb_system_create(1, 1, 1, &system));
    CHECK_OK(swb_system_set_f0(system, f0));
    CHECK_OK(swb_simulator_create(system, NULL, &sim));
    CHECK_OK(swb_simulator_set_state(sim, 1.0, &x, 1));
    CHECK_OK(swb_simulator_set_controls(sim, &u, 1));
    CHECK_OK(swb_simulator_set_params(sim, &p, 1));
    CHECK_OK(swb_simulator_set_int(sim, "n_s", 4));
    CHECK_OK(swb_simulator_run(sim, 1.0, 5, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_simulator_get_state(sim, &x, 1));
    /* x = 3 (cos t + sin t) + c exp(-t) */
    expected = 3.0 * (cos(2.0) + sin(2.0)) + (0.5 - 3.0 * (cos(1.0) + sin(1.0))) * exp(-1.0);
    CHECK_NEAR(x, expected, 1e-9);
    swb_simulator_free(sim);
    swb_system_free(system);
    swb_function_free(f0);

    /* Without the declaration the function is not told the time, and the message says what to do. */
    f0 = make_function("f0", 1, 1, 1, 1, forced, NULL);
    CHECK_OK(swb_system_create(1, 1, 1, &system));
    CHECK_OK(swb_system_set_f0(system, f0));
    CHECK_OK(swb_simulator_create(system, NULL, &sim));
    outcome = 77;
    CHECK_STATUS(SWB_ERR_NONFINITE, swb_simulator_run(sim, 1.0, 5, &outcome));
    CHECK(outcome == 77);
    CHECK(strstr(swb_last_error(), "'f0'") && strstr(swb_last_error(), "swb_function_set_inputs"));
    CHECK_OK(swb_simulator_get_outcome(sim, &outcome));
    CHECK(outcome == SWB_OUTCOME_FAILED);
    swb_simulator_free(sim);
    swb_system_free(system);
    swb_function_free(f0);
}

int main(void)
{
    oscillator();
    going_on();
    inputs();
    return CHECK_DONE();
}
