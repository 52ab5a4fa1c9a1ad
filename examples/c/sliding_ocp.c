/* Optimal control with sliding modes, (7.51) in the thesis of A. Nurkanovic.
 *
 *   q' = v - (sign(c1(q)), sign(c2(q))),  v' = u,   c1 = q1 + 0.15 q2^2,  c2 = q2 - 0.05 q1^3
 *
 * From rest at (2 pi / 3, pi / 3) to (-pi / 6, -pi / 4) in 4 time units, with least energy. On the curves c1 = 0
 * and c2 = 0 the state slides; on their intersection both at once. */
#include "example.h"

static int32_t double_integrator(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[2];
    out[1] = at->x[3];
    out[2] = at->u[0];
    out[3] = at->u[1];
    return 0;
}

static int32_t towards_zero(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[0] = -1.0;
    out[1] = 1.0;
    return 0;
}

static int32_t c1(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0] + 0.15 * at->x[1] * at->x[1];
    return 0;
}

static int32_t c2(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1] - 0.05 * at->x[0] * at->x[0] * at->x[0];
    return 0;
}

static int32_t energy(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] * at->u[0] + at->u[1] * at->u[1] + at->x[2] * at->x[2] + at->x[3] * at->x[3];
    return 0;
}

static int32_t position(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    out[1] = at->x[1];
    return 0;
}

static const char *set_name(uint64_t mask)
{
    return mask == 1 ? "c > 0" : mask == 2 ? "c < 0" : "sliding";
}

int main(int argc, char **argv)
{
    enum { STAGES = 6 };
    const char *folder = argc > 1 ? argv[1] : "out";
    const double pi = 3.141592653589793, horizon = 4.0;
    const double x0[4] = {2.0 * pi / 3.0, pi / 3.0, 0.0, 0.0}, goal[2] = {-pi / 6.0, -pi / 4.0};
    const double x_lower[4] = {-INFINITY, -INFINITY, -2.0, -2.0}, x_upper[4] = {INFINITY, INFINITY, 2.0, 2.0};
    const double u_lower[2] = {-10.0, -10.0}, u_upper[2] = {10.0, 10.0};
    const int64_t row[2] = {0, 1};
    const int8_t signs[2] = {1, -1};
    swb_function *f0 = function("f0", 4, 2, 4, double_integrator, NULL);
    swb_function *modes = function("modes", 4, 2, 2, towards_zero, NULL);
    swb_function *psi1 = function("c1", 4, 2, 1, c1, NULL), *psi2 = function("c2", 4, 2, 1, c2, NULL);
    swb_function *rate = function("energy", 4, 2, 1, energy, NULL), *end = function("position", 4, 2, 2, position, NULL);
    swb_system *system;
    swb_ocp *ocp;
    swb_trajectory *r;
    swb_trajectory_info info;
    swb_switch *s;
    swb_stats stats;
    swb_residuals residuals;
    int32_t outcome;
    int64_t i;
    double cost, u[2 * STAGES], grid[STAGES + 1], t[401], x[4 * 401];
    struct plot plot;

    TRY(swb_function_set_linear(f0));
    TRY(swb_function_set_linear(modes));
    TRY(swb_function_set_linear(end));
    TRY(swb_system_create(4, 2, 0, &system));
    TRY(swb_system_set_f0(system, f0));
    TRY(swb_system_add_subsystem(system, &row[0], 1, modes, 2, psi1, signs, 2, NULL));
    TRY(swb_system_add_subsystem(system, &row[1], 1, modes, 2, psi2, signs, 2, NULL));

    TRY(swb_ocp_create(system, horizon, STAGES, NULL, &ocp));
    TRY(swb_ocp_set_int(ocp, "n_fe", 6));
    TRY(swb_ocp_set_int(ocp, "n_s", 3));
    TRY(swb_ocp_set_lagrange(ocp, rate));
    TRY(swb_ocp_add_terminal(ocp, end, goal, 2, goal, 2));
    TRY(swb_ocp_set_initial_state(ocp, x0, 4));
    TRY(swb_ocp_set_state_bounds(ocp, x_lower, 4, x_upper, 4));
    TRY(swb_ocp_set_control_bounds(ocp, u_lower, 2, u_upper, 2));
    TRY(swb_ocp_solve(ocp, &outcome));

    TRY(swb_ocp_get_cost(ocp, &cost));
    TRY(swb_ocp_get_stats(ocp, &stats, sizeof stats));
    TRY(swb_ocp_get_residuals(ocp, &residuals, sizeof residuals));
    TRY(swb_ocp_get_controls(ocp, u, 2 * STAGES));
    printf("outcome %s, cost %.8f, %d variables, %d constraints, %d pairs\n", swb_outcome_name(outcome), cost,
           (int)stats.n_variables, (int)stats.n_constraints, (int)stats.n_pairs);
    printf("%d iterations in %.1f ms; violation %.1e, largest min(G, H) %.1e\n", (int)stats.iterations,
           1e3 * stats.time_total, residuals.primal, residuals.pair_min);

    TRY(swb_ocp_get_trajectory(ocp, &r));
    TRY(swb_trajectory_get_info(r, &info, sizeof info));
    s = allocate(info.n_switches, sizeof *s);
    TRY(swb_trajectory_switches(r, s, info.n_switches, sizeof *s));
    printf("\nswitch at   curve  before -> after\n");
    for (i = 0; i < info.n_switches; i++)
        printf("%.8f  c%d     %s -> %s\n", s[i].t, (int)s[i].subsystem + 1, set_name(s[i].before), set_name(s[i].after));
    printf("\nstage   u1          u2\n");
    for (i = 0; i < STAGES; i++)
        printf("%3d    %10.6f  %10.6f\n", (int)i, u[2 * i], u[2 * i + 1]);

    for (i = 0; i <= 400; i++)
        t[i] = info.t_start + (info.t_end - info.t_start) * (double)i / 400.0;
    for (i = 0; i <= STAGES; i++)
        grid[i] = horizon * (double)i / STAGES;
    TRY(swb_trajectory_state_at(r, t, 401, x, 4 * 401));
    plot = plot_open(folder, "c_sliding_ocp.svg", "Optimal control with sliding modes", "t", 0.0, horizon, -3.0, 4.0);
    plot_line(&plot, "q1", t, 1, x, 4, 401);
    plot_line(&plot, "q2", t, 1, x + 1, 4, 401);
    plot_line(&plot, "v1", t, 1, x + 2, 4, 401);
    plot_line(&plot, "v2", t, 1, x + 3, 4, 401);
    plot_steps(&plot, "u1", grid, u, 2, STAGES);
    plot_steps(&plot, "u2", grid, u + 1, 2, STAGES);
    for (i = 0; i < info.n_switches; i++)
        plot_mark(&plot, s[i].t);
    plot_close(&plot);
    printf("plot: %s/c_sliding_ocp.svg\n", folder);

    free(s);
    swb_trajectory_free(r);
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_function_free(f0);
    swb_function_free(modes);
    swb_function_free(psi1);
    swb_function_free(psi2);
    swb_function_free(rate);
    swb_function_free(end);
    return 0;
}
