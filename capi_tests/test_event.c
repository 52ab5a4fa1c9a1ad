/* Event-driven simulation: known solutions, stepping, derivatives, batches, and what a hostile caller does. */
#include <pthread.h>
#include <stdlib.h>

#include "kink.h"
#include "models.h"

static swb_integrator *make_integrator(const char *names[], const char *values[], int n)
{
    swb_system *system = make_oscillator();
    swb_integrator *integrator = NULL;
    int i;

    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    swb_system_free(system);
    for (i = 0; i < n; i++)
        CHECK_OK(swb_integrator_set_string(integrator, names[i], values[i]));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, OSCILLATOR_X0, 2));
    return integrator;
}

static void oscillator(void)
{
    static const char *names[] = {"rtol", "atol", "dense", "sensitivity"};
    static const char *values[] = {"1e-12", "1e-12", "on", "on"};
    swb_integrator *integrator = make_integrator(names, values, 4);
    swb_run *run = NULL;
    swb_run_info info;
    swb_event event;
    swb_run_stats stats;
    swb_settings settings;
    int64_t n_modes[1];
    int32_t outcome = -1, before[2], after[2], active[2];
    double x[2], f[2], t, at[2], y[4], s[4], dt[2], *times, growth;
    char reason[8] = "?";

    CHECK_OK(swb_integrator_get_active(integrator, 0, active, 2));
    CHECK(!active[0] && !active[1]);
    CHECK_OK(swb_integrator_advance(integrator, OSCILLATOR_T, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_TEXT("reached", swb_run_outcome_name(outcome));
    CHECK(swb_run_outcome_name(77) == NULL);
    CHECK_OK(swb_integrator_get_time(integrator, &t));
    CHECK(t == OSCILLATOR_T);
    CHECK_OK(swb_integrator_get_state(integrator, x, 2));
    CHECK_NEAR(x[0], OSCILLATOR_XT[0], 1e-10);
    CHECK_NEAR(x[1], OSCILLATOR_XT[1], 1e-10);
    CHECK_OK(swb_integrator_get_derivative(integrator, f, 2));
    CHECK_NEAR(f[0], x[0] - OMEGA * x[1], 1e-12);
    CHECK_OK(swb_integrator_get_active(integrator, 0, active, 2));
    CHECK(active[0] == 0 && active[1] == 1);
    CHECK_OK(swb_integrator_get_reason(integrator, reason, 8, NULL));
    CHECK_TEXT("", reason);
    CHECK_OK(swb_integrator_get_stats(integrator, &stats, sizeof stats));
    CHECK(stats.struct_size == sizeof stats && stats.steps > 5 && stats.switches == 1 && stats.time_total > 0.0);
    CHECK_OK(swb_integrator_get_settings(integrator, &settings, sizeof settings));
    CHECK(settings.rtol == 1e-12 && settings.dense == 1);

    /* the last step again */
    CHECK_OK(swb_integrator_get_dky(integrator, t, 0, y, 2));
    CHECK_NEAR(y[0], x[0], 1e-14);
    CHECK_OK(swb_integrator_get_dky(integrator, t, 1, y, 2));
    CHECK_NEAR(y[1], f[1], 1e-7);
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_get_dky(integrator, 0.1, 0, y, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_get_dky(integrator, t, -1, y, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_integrator_get_dky(integrator, t, 0, y, 3));

    CHECK_OK(swb_integrator_get_run(integrator, &run));
    swb_integrator_free(integrator); /* the run is a copy */
    CHECK_OK(swb_run_get_info(run, &info, sizeof info));
    CHECK(info.nx == 2 && info.outcome == SWB_RUN_OUTCOME_REACHED && info.n_events == 1 && info.n_subsystems == 1);
    CHECK(info.t_start == 0.0 && info.t_end == OSCILLATOR_T && info.n_columns == 2 && info.one_sided == 0);
    CHECK(info.n_pieces == stats.steps);
    CHECK_OK(swb_run_events(run, &event, 1, sizeof event));
    CHECK_NEAR(event.t, 1.0, 1e-11);
    CHECK(event.kind == SWB_EVENT_KIND_CROSS && event.subsystem == 0 && event.before == 1 && event.after == 2);
    CHECK(event.unique == 1 && event.simultaneous == 0);
    CHECK_NEAR(fabs(event.rate), 2.0, 1e-9); /* the derivative of |x|^2 is 2 |x|^2 */
    CHECK_NEAR(fabs(event.transversality), 1.0 / sqrt(1.0 + OMEGA * OMEGA), 1e-9);
    CHECK_OK(swb_run_modes(run, n_modes, 1));
    CHECK(n_modes[0] == 2);
    CHECK_OK(swb_run_event_modes(run, 0, before, after, 2));
    CHECK(before[0] == 1 && before[1] == 0 && after[0] == 0 && after[1] == 1);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_event_modes(run, 1, before, after, 2));
    CHECK_OK(swb_run_state(run, y, 2));
    CHECK(y[0] == x[0] && y[1] == x[1]);

    /* the radius grows like exp(t), so the time of the switch is -log |x0| */
    CHECK_OK(swb_run_sensitivity(run, s, 4));
    CHECK_OK(swb_run_event_sensitivity(run, 0, dt, 2));
    CHECK_NEAR(dt[0], -exp(1.0), 1e-9);
    CHECK_NEAR(dt[1], 0.0, 1e-9);
    growth = (x[0] * s[0] + x[1] * s[1]) / hypot(x[0], x[1]);
    CHECK_NEAR(growth, exp(OSCILLATOR_T), 1e-8);
    growth = (x[0] * s[2] + x[1] * s[3]) / hypot(x[0], x[1]);
    CHECK_NEAR(growth, 0.0, 1e-8);

    times = malloc((size_t)(info.n_pieces + 1) * sizeof *times);
    CHECK_OK(swb_run_times(run, times, info.n_pieces + 1));
    CHECK(times[0] == 0.0 && times[info.n_pieces] == OSCILLATOR_T);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_times(run, times, info.n_pieces));
    free(times);
    at[0] = 1.2;
    at[1] = 0.3;
    CHECK_OK(swb_run_evaluate(run, at, 2, 0, y, 4));
    CHECK_NEAR(hypot(y[0], y[1]), exp(0.2), 1e-10);
    CHECK_NEAR(hypot(y[2], y[3]), exp(-0.7), 1e-10);
    at[1] = (double)NAN;
    CHECK_STATUS(SWB_ERR_RANGE, swb_run_evaluate(run, at, 2, 0, y, 4));
    swb_run_free(run);
}

/* The radius grows like exp(t): gradients of the final radius, of one before, and of the time of the switch. */
static void adjoint(void)
{
    static const char *names[] = {"rtol", "atol", "adjoint"};
    static const char *values[] = {"1e-12", "1e-12", "on"};
    swb_integrator *i = make_integrator(names, values, 3);
    const double half = 0.5, nowhere = 0.51, zero[2] = {0.0, 0.0}, weight = 1.0;
    const int64_t index = 0, none = 1;
    double x[2], v[2], g[2], r;

    CHECK_OK(swb_integrator_advance(i, half, NULL));
    CHECK_OK(swb_integrator_get_state(i, x, 2));
    CHECK_OK(swb_integrator_advance(i, OSCILLATOR_T, NULL));
    r = hypot(x[0], x[1]);
    v[0] = x[0] / r;
    v[1] = x[1] / r;
    CHECK_OK(swb_integrator_adjoint(i, zero, 2, &half, 1, v, 2, NULL, 0, NULL, 0, g, 2, NULL, 0, NULL, 0));
    CHECK_NEAR(g[0], exp(0.5), 1e-9);
    CHECK_NEAR(g[1], 0.0, 1e-9);
    CHECK_OK(swb_integrator_adjoint(i, zero, 2, NULL, 0, NULL, 0, &index, 1, &weight, 1, g, 2, NULL, 0, NULL, 0));
    CHECK_NEAR(g[0], -exp(1.0), 1e-9);
    CHECK_OK(swb_integrator_get_state(i, x, 2));
    r = hypot(x[0], x[1]);
    v[0] = x[0] / r;
    v[1] = x[1] / r;
    CHECK_OK(swb_integrator_interrupt(i));
    CHECK_STATUS(SWB_ERR_INTERRUPTED,
                 swb_integrator_adjoint(i, v, 2, NULL, 0, NULL, 0, NULL, 0, NULL, 0, g, 2, NULL, 0, NULL, 0));
    CHECK_OK(swb_integrator_adjoint(i, v, 2, NULL, 0, NULL, 0, NULL, 0, NULL, 0, g, 2, NULL, 0, NULL, 0));
    double bent[2], moved[2];
    CHECK_OK(swb_integrator_adjoint_along(i, v, 2, v, 2, NULL, 0, NULL, 0, bent, 2, NULL, 0, NULL, 0, moved, 2));
    CHECK(isfinite(bent[0]) && isfinite(bent[1]) && isfinite(moved[0]) && isfinite(moved[1]));
    CHECK_STATUS(SWB_ERR_DIMENSION,
                 swb_integrator_adjoint_along(i, v, 2, v, 1, NULL, 0, NULL, 0, bent, 2, NULL, 0, NULL, 0, moved, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION,
                 swb_integrator_adjoint_along(i, v, 2, v, 2, NULL, 0, NULL, 0, bent, 1, NULL, 0, NULL, 0, moved, 2));
    CHECK_STATUS(SWB_ERR_NULL,
                 swb_integrator_adjoint_along(NULL, v, 2, v, 2, NULL, 0, NULL, 0, bent, 2, NULL, 0, NULL, 0, moved, 2));
    CHECK_NEAR(g[0], exp(OSCILLATOR_T), 1e-8);
    CHECK_NEAR(g[1], 0.0, 1e-8);
    CHECK_STATUS(SWB_ERR_RANGE,
                 swb_integrator_adjoint(i, v, 2, &nowhere, 1, v, 2, NULL, 0, NULL, 0, g, 2, NULL, 0, NULL, 0));
    CHECK_STATUS(SWB_ERR_RANGE,
                 swb_integrator_adjoint(i, v, 2, NULL, 0, NULL, 0, &none, 1, &weight, 1, g, 2, NULL, 0, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION,
                 swb_integrator_adjoint(i, v, 2, &half, 1, v, 1, NULL, 0, NULL, 0, g, 2, NULL, 0, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION,
                 swb_integrator_adjoint(i, v, 2, NULL, 0, NULL, 0, NULL, 0, NULL, 0, g, 1, NULL, 0, NULL, 0));
    CHECK_STATUS(SWB_ERR_NULL,
                 swb_integrator_adjoint(i, NULL, 2, NULL, 0, NULL, 0, NULL, 0, NULL, 0, g, 2, NULL, 0, NULL, 0));
    CHECK_OK(swb_integrator_set_string(i, "adjoint", "off"));
    CHECK_OK(swb_integrator_reinit(i, 0.0, OSCILLATOR_X0, 2));
    CHECK_OK(swb_integrator_advance(i, 0.1, NULL));
    CHECK_STATUS(SWB_ERR_STATE,
                 swb_integrator_adjoint(i, v, 2, NULL, 0, NULL, 0, NULL, 0, NULL, 0, g, 2, NULL, 0, NULL, 0));
    swb_integrator_free(i);
}

/* x' = 3 where x < 0, else 1, plus p and u. */
static swb_system *make_scalar(swb_value_fn drift, void *user_data)
{
    static const int64_t rows[] = {0};
    static const int8_t signs[] = {-1, 1};
    swb_system *system = NULL;
    swb_function *modes = make_function("F", 1, 1, 1, 2, kink_slopes, NULL);
    swb_function *psi = make_function("c", 1, 1, 1, 1, first_state, NULL);
    swb_function *f0 = make_function("drift", 1, 1, 1, 1, drift, user_data);

    CHECK_OK(swb_system_create(1, 1, 1, &system));
    CHECK_OK(swb_system_set_f0(system, f0));
    CHECK_OK(swb_system_add_subsystem(system, rows, 1, modes, 2, psi, signs, 2, NULL));
    swb_function_free(f0);
    swb_function_free(modes);
    swb_function_free(psi);
    return system;
}

static int32_t inputs(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] + at->p[0];
    return 0;
}

static int32_t failing(const swb_point *at, double *out, void *user_data)
{
    out[0] = 0.0;
    return at->x[0] > 0.5 ? *(const int32_t *)user_data : 0;
}

static int32_t decay(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = -at->p[0] * at->x[0] + at->u[0];
    return 0;
}

/* Functions that declare no inputs depend on parameters: x' = -p x + u + 3 up to x = 0, + 1 from there on. */
static void undeclared(void)
{
    static const double x0 = -1.0, u = 0.25, p = 0.5, one = 1.0, step = 1e-5;
    swb_system *system = make_scalar(decay, NULL);
    double s[3], by_inputs[3], g[3], end[2], x, q;
    int k, side;

    for (k = 0; k < 3; k++) {
        for (side = 0; side < 2; side++) {
            swb_integrator *i = NULL;
            const double by = side ? -step : step;
            CHECK_OK(swb_integrator_create(system, NULL, &i));
            CHECK_OK(swb_integrator_set_string(i, "rtol", "1e-11"));
            CHECK_OK(swb_integrator_set_string(i, "atol", "1e-12"));
            CHECK_OK(swb_integrator_set_string(i, "sensitivity", "on"));
            CHECK_OK(swb_integrator_set_string(i, "adjoint", "on"));
            x = x0 + (k == 0 ? by : 0.0);
            CHECK_OK(swb_integrator_reinit(i, 0.0, &x, 1));
            q = p + (k == 1 ? by : 0.0);
            CHECK_OK(swb_integrator_set_params(i, &q, 1));
            q = u + (k == 2 ? by : 0.0);
            CHECK_OK(swb_integrator_set_controls(i, &q, 1));
            CHECK_OK(swb_integrator_advance(i, 1.0, NULL));
            CHECK_OK(swb_integrator_get_state(i, &end[side], 1));
            if (k == 0 && side == 0) {
                swb_run *run = NULL;
                CHECK_OK(swb_integrator_adjoint(i, &one, 1, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &g[0], 1, &g[1], 1, &g[2], 1));
                CHECK_OK(swb_integrator_get_run(i, &run));
                CHECK_OK(swb_run_sensitivity(run, s, 3));
                swb_run_free(run);
                /* without the column of the initial state */
                CHECK_OK(swb_integrator_set_int(i, "sensitivity", SWB_SENSITIVITY_INPUTS));
                x = x0 + by;
                CHECK_OK(swb_integrator_reinit(i, 0.0, &x, 1));
                CHECK_OK(swb_integrator_advance(i, 1.0, NULL));
                CHECK_OK(swb_integrator_get_run(i, &run));
                CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_sensitivity(run, by_inputs, 3));
                CHECK_OK(swb_run_sensitivity(run, by_inputs, 2));
                CHECK(by_inputs[0] == s[1] && by_inputs[1] == s[2]);
                swb_run_free(run);
            }
            swb_integrator_free(i);
        }
        CHECK(fabs(s[k]) > 0.05);
        CHECK_NEAR(s[k], (end[0] - end[1]) / (2.0 * step), 1e-4);
        CHECK_NEAR(g[k], s[k], 1e-9);
    }
    swb_system_free(system);
}

struct steps {
    int64_t n, switched, stop_at;
    double t;
    swb_integrator *self;
};

static int32_t follow(const swb_progress *info, void *user_data)
{
    struct steps *s = user_data;
    CHECK(info->struct_size == sizeof *info && info->nx == 1 && info->t > s->t && isfinite(info->x[0]));
    s->t = info->t;
    s->n++;
    s->switched += info->kind == SWB_PROGRESS_KIND_SWITCHED;
    if (s->self) {
        double x = 0.0;
        CHECK_STATUS(SWB_ERR_STATE, swb_integrator_reinit(s->self, 0.0, &x, 1));
        CHECK_STATUS(SWB_ERR_STATE, swb_integrator_get_state(s->self, &x, 1));
        swb_integrator_free(s->self); /* refused */
    }
    return s->n == s->stop_at;
}

static int32_t stop_at_second(void *user_data)
{
    int64_t *polls = user_data;
    ++*polls;
    return *polls == 2;
}

static void note(int64_t level, const char *line, void *user_data)
{
    int *lines = user_data;
    CHECK(line[0] != '\0' && level > SWB_LOG_LEVEL_SILENT && level <= SWB_LOG_LEVEL_TRACE);
    lines[level]++;
}

static void stepping(void)
{
    swb_system *system = make_scalar(inputs, NULL);
    swb_integrator *i = NULL;
    swb_run *run = NULL;
    swb_run_stats stats;
    struct steps steps = {0, 0, -1, -1.0, NULL};
    const double x0 = -1.0, p = 0.5, u = 0.5, tight = 1e-10, stops[] = {0.5, 0.125, 9.0};
    const double at[] = {0.0, 0.25, 0.5, 1.0}, falling[] = {1.5, 1.25};
    double x, t, found[4];
    int32_t kind = -1, outcome = -1;
    int lines[8] = {0};

    CHECK_OK(swb_integrator_create(system, NULL, &i));
    swb_system_free(system);
    CHECK_OK(swb_integrator_set_tolerances(i, &tight, 1, &tight, 1));
    CHECK_OK(swb_integrator_set_params(i, &p, 1));
    CHECK_OK(swb_integrator_set_controls(i, &u, 1));
    CHECK_OK(swb_integrator_set_progress(i, follow, &steps));
    CHECK_OK(swb_integrator_set_log(i, note, lines));
    CHECK_OK(swb_integrator_set_string(i, "log_level", "trace"));
    CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));

    /* 4 t until t = 1/4, then 2 t */
    steps.self = i;
    CHECK_OK(swb_integrator_advance(i, 1.0, &outcome));
    steps.self = NULL;
    CHECK_OK(swb_integrator_get_state(i, &x, 1));
    CHECK_NEAR(x, 1.5, 1e-12);
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED && steps.switched == 1);
    CHECK_OK(swb_integrator_get_stats(i, &stats, sizeof stats));
    CHECK(stats.steps == steps.n && lines[SWB_LOG_LEVEL_TRACE] == (int)steps.n);
    CHECK(lines[SWB_LOG_LEVEL_INFO] == 1 && lines[SWB_LOG_LEVEL_DEBUG] == 1);

    /* the past is gone, the present is no step */
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_advance(i, 0.5, &outcome));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_step(i, (double)NAN, &kind));
    CHECK_OK(swb_integrator_step(i, 1.0, &kind));
    CHECK(kind == SWB_PROGRESS_KIND_DONE);
    CHECK_OK(swb_integrator_advance(i, 1.5, &outcome));
    CHECK_OK(swb_integrator_get_state(i, &x, 1));
    CHECK_NEAR(x, 2.5, 1e-12);

    /* states at times: the switch, and what was reached; no step ends for them */
    steps.t = -1.0;
    CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));
    CHECK_OK(swb_integrator_sample(i, at, 4, found, 4, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK(found[0] == -1.0);
    CHECK_NEAR(found[1], 0.0, 1e-12);
    CHECK_NEAR(found[2], 0.5, 1e-12);
    CHECK_NEAR(found[3], 1.5, 1e-12);
    CHECK_OK(swb_integrator_get_time(i, &t));
    CHECK(t == 1.0);
    CHECK_OK(swb_integrator_sample(i, NULL, 0, NULL, 0, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_sample(i, at, 4, found, 4, &outcome));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_sample(i, falling, 2, found, 2, &outcome));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_integrator_sample(i, falling, 1, found, 2, &outcome));
    CHECK_STATUS(SWB_ERR_NULL, swb_integrator_sample(i, falling, 1, NULL, 1, &outcome));

    /* stop times, in any order */
    CHECK_OK(swb_integrator_set_stop_times(i, stops, 3));
    CHECK_OK(swb_integrator_set_double(i, "h_max", 0.1));
    steps.t = -1.0;
    CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));
    do {
        CHECK_OK(swb_integrator_step(i, 1.0, &kind));
    } while (kind == SWB_PROGRESS_KIND_STEPPED);
    CHECK_OK(swb_integrator_get_time(i, &t));
    CHECK(kind == SWB_PROGRESS_KIND_STOP_TIME && t == 0.125);
    CHECK_OK(swb_integrator_step(i, 1.0, &kind));
    CHECK_OK(swb_integrator_step(i, 1.0, &kind));
    CHECK_OK(swb_integrator_get_time(i, &t));
    CHECK(kind == SWB_PROGRESS_KIND_SWITCHED);
    CHECK_NEAR(t, 0.25, 1e-14);

    /* a callback that stops; the next call goes on */
    steps.n = 0;
    steps.stop_at = 2;
    CHECK_OK(swb_integrator_advance(i, 1.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_STOPPED && steps.n == 2);
    CHECK_OK(swb_integrator_get_run(i, &run));
    swb_run_free(run);
    CHECK_OK(swb_integrator_interrupt(i));
    CHECK_OK(swb_integrator_advance(i, 1.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_STOPPED && steps.n == 2);
    CHECK_OK(swb_integrator_advance(i, 1.0, &outcome));
    CHECK_OK(swb_integrator_get_state(i, &x, 1));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_NEAR(x, 1.5, 1e-12);

    /* asked now and then: not at every step, nor in a short call; the next call goes on */
    {
        int64_t polls = 0;
        CHECK_OK(swb_integrator_set_progress(i, NULL, NULL));
        CHECK_OK(swb_integrator_set_log(i, NULL, NULL));
        CHECK_OK(swb_integrator_set_poll(i, stop_at_second, &polls));
        CHECK_OK(swb_integrator_set_double(i, "h_max", 1e-6));
        CHECK_OK(swb_integrator_set_int(i, "max_steps", 1000000000));
        CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));
        CHECK_OK(swb_integrator_step(i, 1000.0, &kind));
        CHECK(polls == 0 && kind == SWB_PROGRESS_KIND_STEPPED);
        CHECK_OK(swb_integrator_advance(i, 1000.0, &outcome));
        CHECK_OK(swb_integrator_get_stats(i, &stats, sizeof stats));
        CHECK(outcome == SWB_RUN_OUTCOME_STOPPED && polls == 2 && stats.steps > 20);
        CHECK_OK(swb_integrator_get_time(i, &t));
        CHECK_OK(swb_integrator_advance(i, t + 1e-5, &outcome));
        CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
        CHECK_OK(swb_integrator_set_poll(i, NULL, NULL));
        CHECK_OK(swb_integrator_set_double(i, "h_max", 0.1));
        CHECK_OK(swb_integrator_set_progress(i, follow, &steps));
        CHECK_OK(swb_integrator_set_log(i, note, lines));
    }

    /* too few steps; options come with the next start */
    CHECK_OK(swb_integrator_set_int(i, "max_steps", 3));
    steps.t = -1.0;
    CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));
    CHECK_OK(swb_integrator_advance(i, 1.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_MAX_STEPS && lines[SWB_LOG_LEVEL_WARNING] > 0);
    {
        int64_t needed = 0;
        char buffer[4] = "abc";
        CHECK_OK(swb_integrator_get_reason(i, NULL, 0, &needed));
        CHECK(needed > 10);
        CHECK_STATUS(SWB_ERR_DIMENSION, swb_integrator_get_reason(i, buffer, 4, NULL));
        CHECK_TEXT("abc", buffer);
    }
    swb_integrator_free(i);
}

static void failures(void)
{
    int32_t code = -7, outcome = 99, flag;
    swb_system *system = make_scalar(failing, &code), *nothing = NULL;
    swb_integrator *i = NULL, *none = (swb_integrator *)&code;
    swb_run *run = NULL;
    swb_run_stats stats;
    const double x0 = -1.0, bad = (double)NAN, two[2] = {0.0, 0.0}, negative = -1.0;
    double x = 7.0;
    char reason[512];

    CHECK_STATUS(SWB_ERR_NULL, swb_integrator_create(NULL, NULL, &none));
    CHECK(none == NULL);
    CHECK_STATUS(SWB_ERR_NULL, swb_integrator_create(system, NULL, NULL));
    CHECK_OK(swb_system_create(1, 0, 0, &nothing));
    CHECK_STATUS(SWB_ERR_STATE, swb_integrator_create(nothing, NULL, &none));
    swb_system_free(nothing);
    CHECK_STATUS(SWB_ERR_NULL, swb_integrator_advance(NULL, 1.0, NULL));
    CHECK_STATUS(SWB_ERR_NULL, swb_integrator_interrupt(NULL));
    CHECK_STATUS(SWB_ERR_STATE, swb_integrator_advance((swb_integrator *)system, 1.0, NULL));
    swb_integrator_free(NULL);
    swb_run_free(NULL);

    CHECK_OK(swb_integrator_create(system, NULL, &i));
    CHECK_STATUS(SWB_ERR_NULL, swb_integrator_reinit(i, 0.0, NULL, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_integrator_reinit(i, 0.0, two, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_reinit(i, 0.0, &bad, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_reinit(i, bad, &x0, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_integrator_set_params(i, two, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_set_controls(i, &bad, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_set_tolerances(i, &negative, 1, &x0, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_integrator_set_tolerances(i, two, 2, &x, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_set_stop_times(i, &bad, 1));
    CHECK_STATUS(SWB_ERR_OPTION, swb_integrator_set_int(i, "rtoll", 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_set_double(i, "rtol", -1.0));
    CHECK_STATUS(SWB_ERR_OPTION, swb_integrator_set_string(i, "zeno", "never"));
    CHECK_STATUS(SWB_ERR_STATE, swb_integrator_get_dky(i, 0.0, 0, &x, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_integrator_get_active(i, 1, &flag, 1));
    CHECK_STATUS(SWB_ERR_NULL, swb_integrator_get_run(i, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_integrator_get_stats(i, &stats, 12));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_integrator_get_state(i, &x, 2));
    CHECK(x == 7.0);

    /* a function that ends the call: time and state are those of the last step, and only a new start helps */
    CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));
    CHECK_STATUS(SWB_ERR_USER, swb_integrator_advance(i, 2.0, &outcome));
    CHECK(outcome == 99 && swb_last_user_code() == -7 && strstr(swb_last_error(), "drift"));
    CHECK_OK(swb_integrator_get_state(i, &x, 1));
    CHECK(x <= 0.5 && x >= -1.0);
    CHECK_STATUS(SWB_ERR_STATE, swb_integrator_advance(i, 2.0, &outcome));
    CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));
    /* the mode of x < 0 is looked at beyond the surface too, up to x = 0.2 */
    CHECK_OK(swb_integrator_advance(i, 0.4, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);

    /* a function that is not defined: an outcome with its name */
    code = 3;
    CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));
    CHECK_OK(swb_integrator_advance(i, 2.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_STEP_TOO_SMALL);
    CHECK_OK(swb_integrator_get_state(i, &x, 1));
    CHECK_NEAR(x, 0.5, 1e-9);
    CHECK_OK(swb_integrator_get_reason(i, reason, sizeof reason, NULL));
    CHECK(strstr(reason, "drift"));
    CHECK_OK(swb_integrator_get_run(i, &run));
    CHECK_STATUS(SWB_ERR_STATE, swb_run_sensitivity(run, &x, 1));
    CHECK_STATUS(SWB_ERR_STATE, swb_run_evaluate(run, two, 1, 0, &x, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_events(run, NULL, 7, sizeof(swb_event)));
    CHECK_STATUS(SWB_ERR_NULL, swb_run_events(run, NULL, 1, sizeof(swb_event)));
    swb_run_free(run);
    swb_system_free(system);
    swb_integrator_free(i);
}

static int32_t apart(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[0] = -1.0;
    out[1] = 1.0;
    return 0;
}

struct choice {
    int64_t answer, asked;
};

static int64_t choose(const swb_branching *b, void *user_data)
{
    struct choice *c = user_data;
    int64_t i;
    c->asked++;
    CHECK(b->struct_size == sizeof *b && b->t == 0.0 && b->nx == 1 && b->x[0] == 0.0 && b->n_modes == 2);
    CHECK(b->n_continuations >= 2 && b->before != NULL);
    for (i = 0; i < b->n_continuations; i++)
        if (b->active[2 * i] == (c->answer == 0) && b->active[2 * i + 1] == (c->answer == 1)) {
            CHECK(b->velocity[i] == (c->answer ? 1.0 : -1.0));
            return i;
        }
    return c->answer;
}

/* x' = sign x from 0: both ways and the rest are possible */
static void choices(void)
{
    static const int64_t rows[] = {0};
    static const int8_t signs[] = {-1, 1};
    swb_system *system = NULL;
    swb_function *modes = make_function("F", 1, 0, 0, 2, apart, NULL);
    swb_function *psi = make_function("c", 1, 0, 0, 1, first_state, NULL);
    swb_integrator *i = NULL;
    swb_run *run = NULL;
    swb_run_info info;
    swb_branch_point point;
    struct choice choice = {0, 0};
    const double x0 = 0.0;
    const int64_t mode = 1, no_mode = 2;
    int32_t outcome;
    double x;

    CHECK_OK(swb_system_create(1, 0, 0, &system));
    CHECK_OK(swb_system_add_subsystem(system, rows, 1, modes, 2, psi, signs, 2, NULL));
    CHECK_OK(swb_integrator_create(system, NULL, &i));
    swb_system_free(system);
    swb_function_free(modes);
    swb_function_free(psi);

    CHECK_OK(swb_integrator_set_decider(i, choose, &choice));
    for (choice.answer = 0; choice.answer < 2; choice.answer++) {
        CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));
        CHECK_OK(swb_integrator_advance(i, 1.0, &outcome));
        CHECK_OK(swb_integrator_get_state(i, &x, 1));
        CHECK_NEAR(x, choice.answer ? 1.0 : -1.0, 1e-12);
    }
    CHECK(choice.asked == 2);
    for (choice.answer = -1; choice.answer < 100; choice.answer += 100) {
        CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));
        CHECK_OK(swb_integrator_advance(i, 1.0, &outcome));
        CHECK(outcome == SWB_RUN_OUTCOME_AMBIGUOUS);
    }
    CHECK_OK(swb_integrator_get_run(i, &run));
    CHECK_OK(swb_run_get_info(run, &info, sizeof info));
    CHECK(info.n_branch_points == 1 && info.n_contacts == 0 && info.n_accumulations == 0);
    CHECK_OK(swb_run_branch_points(run, &point, 1, sizeof point));
    CHECK(point.t == 0.0 && point.n_continuations >= 2 && point.taken == -1);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_contacts(run, NULL, 1, sizeof(swb_contact)));
    CHECK_OK(swb_run_accumulations(run, NULL, 0, sizeof(swb_accumulation)));
    swb_run_free(run);

    CHECK_OK(swb_integrator_set_decider(i, NULL, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_set_preferred(i, 0, &no_mode, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_integrator_set_preferred(i, 1, &mode, 1));
    CHECK_OK(swb_integrator_set_preferred(i, 0, &mode, 1));
    CHECK_OK(swb_integrator_set_string(i, "ambiguity", "prefer"));
    CHECK_OK(swb_integrator_reinit(i, 0.0, &x0, 1));
    CHECK_OK(swb_integrator_advance(i, 1.0, &outcome));
    CHECK_OK(swb_integrator_get_state(i, &x, 1));
    CHECK_NEAR(x, 1.0, 1e-12);
    swb_integrator_free(i);
}

static void surfaces(void)
{
    swb_system *system = make_oscillator();
    const double inside[2] = {0.5, 0.5};
    swb_point at = {0.0, inside, NULL, NULL};
    double psi[2];
    int64_t n = -1;

    CHECK_OK(swb_system_surfaces(system, 0, &at, NULL, 0, &n));
    CHECK(n == 1);
    CHECK_OK(swb_system_surfaces(system, 0, &at, psi, 1, NULL));
    CHECK_NEAR(psi[0], -0.5, 1e-15);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_surfaces(system, 0, &at, psi, 2, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_surfaces(system, 1, &at, psi, 1, NULL));
    CHECK_STATUS(SWB_ERR_NULL, swb_system_surfaces(system, 0, NULL, psi, 1, NULL));
    swb_system_free(system);
}

#define RUNS 24

static void batches(void)
{
    static const int64_t threads[] = {1, 2, 5, 0};
    swb_system *system = make_scalar(inputs, NULL);
    swb_settings settings;
    swb_batch *batch = NULL;
    swb_run *run = NULL;
    swb_run_info info;
    double x0[RUNS], p[RUNS], one[RUNS], x[RUNS];
    const double u = 0.5;
    int32_t outcome[RUNS];
    int64_t n = -1;
    int k, i;

    for (i = 0; i < RUNS; i++) {
        x0[i] = -0.1 * i;
        p[i] = 0.25 * i;
    }
    CHECK_OK(swb_settings_init(&settings, sizeof settings));
    settings.dense = 1;
    CHECK_OK(swb_batch_create(system, &settings, &batch));
    CHECK_OK(swb_batch_size(batch, &n));
    CHECK(n == 0);
    for (k = 0; k < 4; k++) {
        CHECK_OK(swb_batch_run(batch, 0.0, 1.0, x0, RUNS, &u, 1, p, RUNS, threads[k]));
        CHECK_OK(swb_batch_states(batch, k ? x : one, RUNS));
        CHECK_OK(swb_batch_outcomes(batch, outcome, RUNS));
        for (i = 0; i < RUNS; i++) {
            double below = -x0[i] / (3.5 + p[i]);
            CHECK(outcome[i] == SWB_RUN_OUTCOME_REACHED && (!k || x[i] == one[i]));
            CHECK_NEAR(one[i], below > 1.0 ? x0[i] + 3.5 + p[i] : (1.0 - below) * (1.5 + p[i]), 1e-12);
        }
    }
    CHECK_OK(swb_batch_get_run(batch, RUNS - 1, &run));
    CHECK_OK(swb_run_get_info(run, &info, sizeof info));
    CHECK(info.n_events == 1 && info.n_pieces > 0);
    swb_run_free(run);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_batch_get_run(batch, RUNS, &run));
    CHECK(run == NULL);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_batch_run(batch, 0.0, 1.0, x0, RUNS, &u, 1, p, RUNS - 1, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_batch_run(batch, 0.0, 1.0, x0, RUNS, &u, 1, p, RUNS, -1));
    CHECK_STATUS(SWB_ERR_NULL, swb_batch_run(batch, 0.0, 1.0, NULL, RUNS, &u, 1, p, RUNS, 1));

    /* an interrupt beforehand stops them all, once */
    CHECK_OK(swb_batch_interrupt(batch));
    CHECK_OK(swb_batch_run(batch, 0.0, 1.0, x0, RUNS, &u, 1, p, RUNS, 2));
    CHECK_OK(swb_batch_outcomes(batch, outcome, RUNS));
    CHECK(outcome[0] == SWB_RUN_OUTCOME_STOPPED && outcome[RUNS - 1] == SWB_RUN_OUTCOME_STOPPED);
    swb_batch_free(batch);
    swb_system_free(system);

    /* runs that fail leave the others alone */
    {
        int32_t code = -7;
        double start[2] = {-1.0, 0.25};
        system = make_scalar(failing, &code);
        CHECK_OK(swb_batch_create(system, NULL, &batch));
        swb_system_free(system);
        CHECK_OK(swb_batch_run(batch, 0.0, 0.4, start, 2, NULL, 0, NULL, 0, 2));
        CHECK_OK(swb_batch_outcomes(batch, outcome, 2));
        CHECK(outcome[0] == SWB_RUN_OUTCOME_REACHED && outcome[1] == SWB_ERR_USER);
        CHECK_STATUS(SWB_ERR_USER, swb_batch_get_run(batch, 1, &run));
        CHECK(strstr(swb_last_error(), "drift"));
        CHECK_OK(swb_batch_states(batch, x, 2));
        CHECK_NEAR(x[0], 1.0 / 15.0, 1e-12);
        CHECK(isnan(x[1]));
        swb_batch_free(batch);
    }
}

/* x' = u - z, 0 = z + z^3 - (1 + p) x - x^3 - p x^3: for p = 0 it is z = x. */
static int32_t tied(const swb_point *at, double *out, void *user_data)
{
    const double x = at->x[0], z = at->x[1];
    (void)user_data;
    out[0] = at->u[0] - z;
    out[1] = z + z * z * z - (1.0 + at->p[0]) * (x + x * x * x);
    return 0;
}

/* 0 = x - 1: not of index 1. */
static int32_t untied(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    out[1] = at->x[0] - 1.0;
    return 0;
}

static int32_t ones(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[0] = out[1] = 1.0;
    return 0;
}

/* 0 = z^2 + x: no solution for positive x. */
static int32_t unsolvable(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    out[1] = at->x[1] * at->x[1] + at->x[0];
    return 0;
}

/* A code that depends on the algebraic state. */
static int32_t tied_and_failing(const swb_point *at, double *out, void *user_data)
{
    tied(at, out, NULL);
    return at->x[1] < 0.5 ? *(const int32_t *)user_data : 0;
}

static swb_integrator *make_tied(swb_value_fn f, void *user_data, swb_system **system)
{
    swb_integrator *integrator = NULL;
    swb_function *f0 = make_function("f0", 2, 1, 1, 2, f, user_data);

    CHECK_OK(swb_system_create(2, 1, 1, system));
    CHECK_OK(swb_system_set_f0(*system, f0));
    CHECK_OK(swb_system_set_algebraic(*system, 1, NULL));
    swb_function_free(f0);
    CHECK_OK(swb_integrator_create(*system, NULL, &integrator));
    return integrator;
}

/* Algebraic equations of index 1: known solutions, derivatives, controls on the way, and what has no solution. */
static void algebraic(void)
{
    static const double x0[2] = {1.0, 0.3}, two[4] = {1.0, 0.0, -1.0, 5.0}, v[2] = {0.0, 1.0}, one = 1.0;
    swb_system *system = NULL;
    swb_integrator *i = make_tied(tied, NULL, &system);
    swb_batch *batch = NULL;
    swb_run *run = NULL;
    double x[2], f[2], y[4], g[2], gp, gu, s[8];
    int32_t outcome = -1, outcomes[2] = {-1, -1}, code = -3;
    char reason[600] = "";

    CHECK_OK(swb_integrator_set_string(i, "rtol", "1e-11"));
    CHECK_OK(swb_integrator_set_string(i, "atol", "1e-12"));
    CHECK_OK(swb_integrator_set_string(i, "sensitivity", "on"));
    CHECK_OK(swb_integrator_set_string(i, "adjoint", "on"));
    CHECK_OK(swb_integrator_reinit(i, 0.0, x0, 2));
    CHECK_OK(swb_integrator_advance(i, 1.0, &outcome));
    CHECK_OK(swb_integrator_get_state(i, x, 2));
    CHECK_OK(swb_integrator_get_derivative(i, f, 2));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_NEAR(x[0], exp(-1.0), 1e-9);
    CHECK_NEAR(x[1], x[0], 1e-12);
    CHECK_NEAR(f[1], -x[1], 1e-9);
    /* dx/dx0 = e^-1, dx/du = 1 - e^-1, and z moves by p as (x + x^3) / (1 + 3 z^2) */
    CHECK_OK(swb_integrator_adjoint(i, v, 2, NULL, 0, NULL, 0, NULL, 0, NULL, 0, g, 2, &gp, 1, &gu, 1));
    CHECK_NEAR(g[0], exp(-1.0), 1e-6);
    CHECK(g[1] == 0.0);
    CHECK_NEAR(gu, 1.0 - exp(-1.0), 1e-6);
    CHECK_OK(swb_integrator_get_run(i, &run));
    CHECK_OK(swb_run_sensitivity(run, s, 8));
    CHECK_NEAR(s[1], g[0], 1e-9);
    CHECK_NEAR(s[5], gp, 1e-9);
    CHECK_NEAR(s[7], gu, 1e-9);
    CHECK(s[2] == 0.0 && s[3] == 0.0);
    swb_run_free(run);
    CHECK_OK(swb_integrator_set_controls(i, &one, 1));
    CHECK_OK(swb_integrator_advance(i, 3.0, &outcome));
    CHECK_OK(swb_integrator_get_state(i, x, 2));
    CHECK_NEAR(x[1], 1.0 + (exp(-1.0) - 1.0) * exp(-2.0), 1e-9);
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_advance(i, 1.0, &outcome));
    swb_integrator_free(i);

    CHECK_OK(swb_batch_create(system, NULL, &batch));
    CHECK_OK(swb_batch_run(batch, 0.0, 1.0, two, 4, NULL, 0, NULL, 0, 2));
    CHECK_OK(swb_batch_states(batch, y, 4));
    CHECK_NEAR(y[1], exp(-1.0), 1e-6);
    CHECK_NEAR(y[3], -exp(-1.0), 1e-6);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_batch_run(batch, 0.0, 1.0, two, 3, NULL, 0, NULL, 0, 2));
    swb_batch_free(batch);
    swb_system_free(system);

    /* no index 1: said where the integrator is made */
    {
        swb_function *f0 = make_function("f0", 2, 0, 0, 2, untied, NULL);
        static const int64_t columns[] = {0, 1, 2, 2}, rows[] = {1, 0};
        swb_integrator *none = NULL;
        CHECK_OK(swb_function_set_jacobian(f0, columns, 4, rows, 2, ones));
        CHECK_OK(swb_system_create(2, 0, 0, &system));
        CHECK_OK(swb_system_set_f0(system, f0));
        CHECK_OK(swb_system_set_algebraic(system, 1, NULL));
        CHECK_STATUS(SWB_ERR_STATE, swb_integrator_create(system, NULL, &none));
        CHECK(none == NULL && strstr(swb_last_error(), "index 1") != NULL);
        swb_function_free(f0);
        swb_system_free(system);
    }
    /* without a pattern: where it begins */
    i = make_tied(untied, NULL, &system);
    CHECK_OK(swb_integrator_reinit(i, 0.0, x0, 2));
    CHECK_STATUS(SWB_ERR_NUMERIC, swb_integrator_advance(i, 1.0, &outcome));
    CHECK(strstr(swb_last_error(), "singular") != NULL);
    swb_integrator_free(i);
    swb_system_free(system);
    i = make_tied(unsolvable, NULL, &system);
    CHECK_OK(swb_integrator_reinit(i, 0.0, x0, 2));
    CHECK_STATUS(SWB_ERR_NUMERIC, swb_integrator_advance(i, 1.0, &outcome));
    CHECK(strstr(swb_last_error(), "no consistent start") != NULL);
    /* and from a point that has one it ends where that ceases to exist: x = -(2 - t)^2 / 4 */
    x[0] = -1.0;
    x[1] = 1.0;
    CHECK_OK(swb_integrator_reinit(i, 0.0, x, 2));
    CHECK_OK(swb_integrator_advance(i, 5.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_STEP_TOO_SMALL || outcome == SWB_RUN_OUTCOME_NO_CONTINUATION);
    CHECK_OK(swb_integrator_get_reason(i, reason, sizeof reason, NULL));
    CHECK(strstr(reason, "algebraic equations") != NULL);
    swb_integrator_free(i);
    swb_system_free(system);
    /* a negative code ends the call */
    i = make_tied(tied_and_failing, &code, &system);
    CHECK_OK(swb_integrator_reinit(i, 0.0, two, 2));
    CHECK_STATUS(SWB_ERR_USER, swb_integrator_advance(i, 3.0, &outcome));
    swb_integrator_free(i);
    CHECK_OK(swb_batch_create(system, NULL, &batch));
    CHECK_OK(swb_batch_run(batch, 0.0, 3.0, two, 4, NULL, 0, NULL, 0, 1));
    CHECK_OK(swb_batch_outcomes(batch, outcomes, 2));
    CHECK(outcomes[0] == SWB_ERR_USER && outcomes[1] == SWB_ERR_USER);
    swb_batch_free(batch);
    swb_system_free(system);
}

struct shared {
    swb_integrator *integrator;
    int busy;
};

static void *disturb(void *data)
{
    struct shared *s = data;
    double x;
    int k;
    for (k = 0; k < 200; k++) {
        swb_status status = swb_integrator_get_state(s->integrator, &x, 1);
        s->busy += status == SWB_ERR_STATE;
        CHECK(status == SWB_OK || status == SWB_ERR_STATE);
    }
    CHECK_OK(swb_integrator_interrupt(s->integrator));
    return NULL;
}

static void two_threads(void)
{
    swb_system *system = make_scalar(inputs, NULL);
    struct shared shared = {NULL, 0};
    pthread_t thread;
    const double x0 = -1.0;
    int32_t outcome = -1;
    double t;

    CHECK_OK(swb_integrator_create(system, NULL, &shared.integrator));
    swb_system_free(system);
    CHECK_OK(swb_integrator_set_double(shared.integrator, "h_max", 1e-3));
    CHECK_OK(swb_integrator_reinit(shared.integrator, 0.0, &x0, 1));
    CHECK(pthread_create(&thread, NULL, disturb, &shared) == 0);
    /* no end but the interrupt; a start that the other thread reads into is refused */
    do {
        swb_status status = swb_integrator_advance(shared.integrator, 1e9, &outcome);
        CHECK(status == SWB_OK || status == SWB_ERR_STATE);
        if (status != SWB_OK)
            outcome = -1;
    } while (outcome == -1);
    CHECK(outcome == SWB_RUN_OUTCOME_STOPPED || outcome == SWB_RUN_OUTCOME_MAX_STEPS);
    pthread_join(thread, NULL);
    CHECK_OK(swb_integrator_get_time(shared.integrator, &t));
    CHECK(t >= 0.0 && t < 1e9);
    swb_integrator_free(shared.integrator);
}

static int32_t ball_f(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    out[1] = -at->p[0];
    out[2] = 0.0;
    return 0;
}

static int32_t ball_gap(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    return 0;
}

static int32_t ball_bounce(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    out[1] = -0.9 * at->x[1];
    out[2] = at->x[2] + 1.0;
    return 0;
}

/* A ball that bounces, and counts how often in a state. */
static void transitions(void)
{
    static const double x0[3] = {1.0, 0.0, 0.0}, g = 9.81;
    static const int64_t state = 2, missing = 7;
    static const double never = -1.0;
    swb_system *system = NULL;
    swb_function *f = make_function("f", 3, 0, 1, 3, ball_f, NULL), *gap = make_function("gap", 3, 0, 1, 1, ball_gap, NULL),
                 *bounce = make_function("bounce", 3, 0, 1, 3, ball_bounce, NULL);
    swb_integrator *integrator = NULL;
    swb_run *run = NULL;
    swb_run_info info;
    swb_run_stats stats;
    swb_jump jumps[4];
    int64_t index = -1;
    int32_t outcome = -1;
    double x[3], before[3], after[3], dt[4];

    CHECK_OK(swb_system_create(3, 0, 1, &system));
    CHECK_OK(swb_system_set_f0(system, f));
    CHECK_STATUS(SWB_ERR_STATE, swb_system_add_transition(system, gap, SWB_DIRECTION_FALLING, NULL, 0, NULL, 0, NULL, NULL, 0,
                                                          NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_transition(system, gap, 2, NULL, 0, NULL, 0, bounce, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_transition(system, gap, SWB_DIRECTION_FALLING, &missing, 1, &never, 1, bounce,
                                                          NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_transition(system, gap, SWB_DIRECTION_FALLING, &state, 1, NULL, 0, bounce,
                                                              NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_transition(system, bounce, SWB_DIRECTION_FALLING, NULL, 0, NULL, 0, bounce,
                                                              NULL, 0, NULL, 0, &index));
    CHECK(index == -1);
    /* one that is never watched, for the count is never negative */
    CHECK_OK(swb_system_add_transition(system, gap, SWB_DIRECTION_RISING, &state, 1, &never, 1, bounce, NULL, 0, NULL, 0, &index));
    CHECK(index == 0);
    CHECK_OK(swb_system_add_transition(system, gap, SWB_DIRECTION_FALLING, NULL, 0, NULL, 0, bounce, NULL, 0, NULL, 0, &index));
    CHECK(index == 1);
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_set_double(integrator, "rtol", 1e-11));
    CHECK_OK(swb_integrator_set_double(integrator, "atol", 1e-11));
    CHECK_OK(swb_integrator_set_string(integrator, "sensitivity", "on"));
    CHECK_OK(swb_integrator_set_params(integrator, &g, 1));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, x0, 3));
    CHECK_OK(swb_integrator_advance(integrator, 3.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_state(integrator, x, 3));
    CHECK_NEAR(x[0], 0.41835172208395643, 1e-9);
    CHECK_NEAR(x[1], -0.48755089263868119, 1e-9);
    CHECK(x[2] == 4.0);
    CHECK_OK(swb_integrator_get_run(integrator, &run));
    CHECK_OK(swb_run_get_info(run, &info, sizeof info));
    CHECK(info.n_jumps == 4 && info.n_events == 0 && info.one_sided == 0);
    CHECK_OK(swb_run_get_stats(run, &stats, sizeof stats));
    CHECK(stats.jumps == 4);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_jumps(run, jumps, 3, sizeof jumps[0]));
    CHECK_OK(swb_run_jumps(run, jumps, 4, sizeof jumps[0]));
    CHECK(jumps[3].transition == 1 && !jumps[3].simultaneous && jumps[3].rate > 0.0);
    CHECK_NEAR(jumps[0].t, 0.45152364098573090, 1e-12);
    CHECK_NEAR(jumps[3].t, 2.6540559617141263, 1e-11);
    CHECK_OK(swb_run_jump_states(run, 3, before, after, 3));
    CHECK(after[1] == -0.9 * before[1] && after[2] == before[2] + 1.0);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_jump_states(run, 4, before, after, 3));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_jump_states(run, 0, before, after, 2));
    CHECK_OK(swb_run_jump_sensitivity(run, 3, dt, 4));
    CHECK_NEAR(dt[0], 1.327027980857063, 1e-6); /* by differences of the callbacks */
    CHECK_NEAR(dt[1], 0.1019367991845056, 1e-6);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_jump_sensitivity(run, -1, dt, 4));
    swb_run_free(run);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_function_free(f);
    swb_function_free(gap);
    swb_function_free(bounce);
}

static int count_up(const swb_point *at, double *out, void *data)
{
    (void)data;
    (void)at;
    out[0] = 1.0;
    return 0;
}

static int above_quarter(const swb_point *at, double *out, void *data)
{
    (void)data;
    out[0] = at->x[0] - 0.25;
    return 0;
}

static int below_half(const swb_point *at, double *out, void *data)
{
    (void)data;
    out[0] = 0.5 - at->x[0];
    return 0;
}

/* An event that is noted, one that ends the run, and times that are known. */
static void named_events(void)
{
    static const double x0 = 0.0, t[2] = {0.125, 0.4}, wrong[2] = {0.1, 0.0 / 0.0};
    static const int32_t jumps[2] = {0, 1};
    swb_system *system = NULL;
    swb_function *f = make_function("f", 1, 0, 0, 1, count_up, NULL), *quarter = make_function("quarter", 1, 0, 0, 1, above_quarter, NULL),
                 *half = make_function("half", 1, 0, 0, 1, below_half, NULL);
    swb_integrator *integrator = NULL;
    swb_run *run = NULL;
    swb_run_info info;
    swb_run_stats stats;
    swb_note note;
    int64_t index = -1;
    int32_t outcome = -1;
    double x = -1.0, dt = 0.0, times[64];
    CHECK_OK(swb_system_create(1, 0, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_known_times(system, t, 2, jumps, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_known_times(system, wrong, 2, jumps, 2));
    CHECK_OK(swb_system_add_known_times(system, t, 2, jumps, 2));
    CHECK_STATUS(SWB_ERR_STATE, swb_system_add_event(system, "a", SWB_EFFECT_NOTE, SWB_TRIGGER_LEVEL, quarter, SWB_DIRECTION_RISING, NULL,
                                                     0, NULL, 0, NULL, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_STATE, swb_system_add_event(system, "a", SWB_EFFECT_STOP, SWB_TRIGGER_EDGE, quarter, SWB_DIRECTION_RISING, NULL, 0,
                                                     NULL, 0, f, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_event(system, "a", 9, SWB_TRIGGER_EDGE, quarter, SWB_DIRECTION_RISING, NULL, 0, NULL, 0,
                                                     NULL, NULL, 0, NULL, 0, &index));
    CHECK(index == -1);
    CHECK_OK(swb_system_add_event(system, "quarter", SWB_EFFECT_NOTE, SWB_TRIGGER_EDGE, quarter, SWB_DIRECTION_RISING, NULL, 0, NULL, 0,
                                  NULL, NULL, 0, NULL, 0, &index));
    CHECK(index == 0);
    CHECK_OK(swb_system_add_event(system, NULL, SWB_EFFECT_STOP, SWB_TRIGGER_EDGE, half, SWB_DIRECTION_FALLING, NULL, 0, NULL, 0, NULL,
                                  NULL, 0, NULL, 0, &index));
    CHECK(index == 1);
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_set_string(integrator, "sensitivity", "on"));
    CHECK_OK(swb_integrator_set_int(integrator, "dense", 1));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, &x0, 1));
    CHECK_OK(swb_integrator_advance(integrator, 3.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_EVENT && strcmp(swb_run_outcome_name(outcome), "event") == 0);
    CHECK_OK(swb_integrator_get_run(integrator, &run));
    CHECK_OK(swb_run_get_info(run, &info, sizeof info));
    CHECK(info.n_notes == 1 && info.n_jumps == 1 && info.stopped_by == 1);
    CHECK_NEAR(info.t_end, 0.5, 1e-13);
    CHECK_OK(swb_run_get_stats(run, &stats, sizeof stats));
    CHECK(stats.notes == 1 && stats.jumps == 1);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_notes(run, &note, 2, sizeof note));
    CHECK_OK(swb_run_notes(run, &note, 1, sizeof note));
    CHECK(note.transition == 0);
    CHECK_NEAR(note.t, 0.25, 1e-13);
    CHECK_NEAR(note.rate, 1.0, 1e-9);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_note_state(run, 1, &x, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_note_state(run, 0, &x, 2));
    CHECK_OK(swb_run_note_state(run, 0, &x, 1));
    CHECK_NEAR(x, 0.25, 1e-13);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_note_sensitivity(run, -1, &dt, 1));
    CHECK_OK(swb_run_note_sensitivity(run, 0, &dt, 1));
    CHECK_NEAR(dt, -1.0, 1e-7);
    CHECK(info.n_pieces + 1 <= 64);
    CHECK_OK(swb_run_times(run, times, info.n_pieces + 1));
    for (int k = 0, found = 0; k <= info.n_pieces; k++) {
        found += times[k] == 0.125 || times[k] == 0.4;
        if (k == info.n_pieces)
            CHECK(found == 2);
    }
    swb_run_free(run);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_function_free(f);
    swb_function_free(quarter);
    swb_function_free(half);
}

int main(void)
{
    transitions();
    named_events();
    oscillator();
    adjoint();
    undeclared();
    stepping();
    failures();
    choices();
    surfaces();
    batches();
    algebraic();
    two_threads();
    return CHECK_DONE();
}
