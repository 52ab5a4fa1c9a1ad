/* An oscillator that turns one way inside the unit circle and the other way outside.
 *
 *   x' = A1 x  if |x| < 1,   A2 x  if |x| > 1,   A1 = [1 w; -w 1],  A2 = [1 -w; w 1],  w = 2 pi
 *
 * Simulated over [0, pi/2] from (1/e, 0): it crosses the circle at t = 1. The error at the end is compared for
 * several step sizes: its order is that of the Runge-Kutta method, as if there were no switch. */
#include "example.h"

static const double W = 6.283185307179586;
static const double T = 1.5707963267948966;
static const double X0[2] = {0.36787944117144233, 0.0};
static const double XT[2] = {-1.5974603774506981, -0.7614936206060115};

static int32_t modes(const swb_point *at, double *out, void *user_data)
{
    double x = at->x[0], y = at->x[1];
    (void)user_data;
    out[0] = x + W * y;
    out[1] = y - W * x;
    out[2] = x - W * y;
    out[3] = y + W * x;
    return 0;
}

static int32_t circle(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0] * at->x[0] + at->x[1] * at->x[1] - 1.0;
    return 0;
}

int main(int argc, char **argv)
{
    const char *folder = argc > 1 ? argv[1] : "out";
    const int64_t rows[2] = {0, 1};
    const int8_t signs[2] = {-1, 1}; /* mode 0 where circle < 0, mode 1 where circle > 0 */
    swb_function *f = function("modes", 2, 0, 4, modes, NULL), *psi = function("circle", 2, 0, 1, circle, NULL);
    swb_system *system;
    swb_simulator *sim;
    swb_trajectory *r;
    swb_trajectory_info info;
    swb_switch s;
    swb_stats stats;
    int64_t n_s, n_steps, i;
    double x[2], t[401], path[802];
    struct plot plot;

    TRY(swb_function_set_linear(f));
    TRY(swb_system_create(2, 0, 0, &system));
    TRY(swb_system_add_subsystem(system, rows, 2, f, 2, psi, signs, 2, NULL));
    TRY(swb_simulator_create(system, NULL, &sim));
    TRY(swb_simulator_set_int(sim, "n_fe", 2));

    printf("Radau IIA  steps   error at the end   switch at        iterations  ms\n");
    for (n_s = 2; n_s <= 4; n_s++) {
        TRY(swb_simulator_set_int(sim, "n_s", n_s));
        for (n_steps = 13; n_steps <= 52; n_steps *= 2) {
            TRY(swb_simulator_set_state(sim, 0.0, X0, 2));
            TRY(swb_simulator_run(sim, T, n_steps, NULL));
            TRY(swb_simulator_get_state(sim, x, 2));
            TRY(swb_simulator_get_stats(sim, &stats, sizeof stats));
            TRY(swb_simulator_get_trajectory(sim, &r));
            TRY(swb_trajectory_get_info(r, &info, sizeof info));
            s.t = NAN;
            if (info.n_switches == 1)
                TRY(swb_trajectory_switches(r, &s, 1, sizeof s));
            printf("order %d    %5d   %.2e           %.12f   %10d  %.2f\n", (int)(2 * n_s - 1), (int)n_steps,
                   hypot(x[0] - XT[0], x[1] - XT[1]), s.t, (int)stats.iterations, 1e3 * stats.time_total);
            if (n_s < 4 || n_steps < 52)
                swb_trajectory_free(r);
        }
    }

    for (i = 0; i <= 400; i++)
        t[i] = info.t_start + (info.t_end - info.t_start) * (double)i / 400.0;
    TRY(swb_trajectory_state_at(r, t, 401, path, 802));
    plot = plot_open(folder, "c_oscillator.svg", "Oscillator that changes its sense of rotation at |x| = 1", "t", 0.0, T,
                     -2.0, 2.0);
    plot_line(&plot, "x1", t, 1, path, 2, 401);
    plot_line(&plot, "x2", t, 1, path + 1, 2, 401);
    plot_mark(&plot, s.t);
    plot_close(&plot);
    printf("plot: %s/c_oscillator.svg\n", folder);

    swb_trajectory_free(r);
    swb_simulator_free(sim);
    swb_system_free(system);
    swb_function_free(f);
    swb_function_free(psi);
    return 0;
}
