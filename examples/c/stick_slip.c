/* A block on a moving belt, held by a spring: it sticks, and slips when the spring pulls harder than dry friction holds.
 *
 *   q' = v,   v' = -q - f(v - v_belt),   f in F [-1, 1] at rest, F / (1 + |v - v_belt|) against the motion else
 *
 * Simulated by the event-driven integrator: every beginning and end of sticking is located to rounding, and sticking is
 * integrated as the sliding mode it is. The plot shows the velocity locked to that of the belt, dotted lines at the
 * switches, and between the phases of sticking short slips in which the block swings back. */
#include "example.h"

static const double F = 1.0, BELT = 0.3, T = 30.0;

static int32_t smooth(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    out[1] = -at->x[0];
    return 0;
}

/* mode 0: slower than the belt, which pulls it along; mode 1: faster */
static int32_t friction(const swb_point *at, double *out, void *user_data)
{
    double slip = at->x[1] - BELT;
    (void)user_data;
    out[0] = F / (1.0 - slip);
    out[1] = -F / (1.0 + slip);
    return 0;
}

static int32_t slip(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1] - BELT;
    return 0;
}

int main(int argc, char **argv)
{
    static const char *const kinds[] = {"crosses", "begins to stick", "begins to slip", "may slip"};
    const char *folder = argc > 1 ? argv[1] : "out";
    const int64_t rows[1] = {1};
    const int8_t signs[2] = {-1, 1};
    const double x0[2] = {0.0, 0.0};
    enum { POINTS = 1500 };
    swb_function *f0 = function("smooth", 2, 0, 2, smooth, NULL), *psi = function("slip", 2, 0, 1, slip, NULL);
    swb_function *modes = function("friction", 2, 0, 2, friction, NULL);
    swb_system *system;
    swb_settings settings;
    swb_integrator *integrator;
    swb_run *run;
    swb_run_info info;
    swb_run_stats stats;
    swb_event *events;
    int32_t outcome;
    int64_t i;
    double *t = allocate(POINTS, sizeof *t), *x = allocate(2 * POINTS, sizeof *x);
    struct plot plot;

    TRY(swb_system_create(2, 0, 0, &system));
    TRY(swb_system_set_f0(system, f0));
    TRY(swb_system_add_subsystem(system, rows, 1, modes, 2, psi, signs, 2, NULL));
    TRY(swb_settings_init(&settings, sizeof settings));
    settings.rtol = settings.atol = 1e-10;
    settings.dense = 1;
    TRY(swb_integrator_create(system, &settings, &integrator));
    TRY(swb_integrator_reinit(integrator, 0.0, x0, 2));
    TRY(swb_integrator_advance(integrator, T, &outcome));
    TRY(swb_integrator_get_run(integrator, &run));
    TRY(swb_run_get_info(run, &info, sizeof info));
    TRY(swb_run_get_stats(run, &stats, sizeof stats));

    events = allocate(info.n_events, sizeof *events);
    TRY(swb_run_events(run, events, info.n_events, sizeof *events));
    printf("%s at t = %g: %d steps, %d switches, %.0f microseconds\n", swb_run_outcome_name(outcome), info.t_end,
           (int)stats.steps, (int)stats.switches, 1e6 * stats.time_total);
    for (i = 0; i < info.n_events; i++)
        printf("  t = %17.13f  %s\n", events[i].t, kinds[events[i].kind]);

    for (i = 0; i < POINTS; i++)
        t[i] = T * (double)i / (POINTS - 1);
    TRY(swb_run_evaluate(run, t, POINTS, 0, x, 2 * POINTS));
    plot = plot_open(folder, "c_stick_slip.svg", "Block on a belt: sticks and slips", "t", 0.0, T, -1.5, 1.5);
    plot_line(&plot, "position", t, 1, x, 2, POINTS);
    plot_line(&plot, "velocity", t, 1, x + 1, 2, POINTS);
    for (i = 0; i < info.n_events; i++)
        plot_mark(&plot, events[i].t);
    plot_close(&plot);
    printf("%s/c_stick_slip.svg: the velocity is that of the belt while the block sticks; it slips back between.\n", folder);

    free(events);
    free(t);
    free(x);
    swb_run_free(run);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_function_free(f0);
    swb_function_free(modes);
    swb_function_free(psi);
    return 0;
}
