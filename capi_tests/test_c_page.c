/* A mass on a belt, with a spring: simulated, then moved by the least force. The program of docs/c.md. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <switchback.h>

#define TRY(call) if ((call) != SWB_OK) return fprintf(stderr, "%s\n", swb_last_error()), 1

static int32_t smooth(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    out[1] = at->u[0] - at->x[0]; /* motor and spring */
    return 0;
}
static int32_t friction(const swb_point *at, double *out, void *user_data)
{
    (void)at; (void)user_data;
    out[0] = 1.0;  /* where slip > 0 */
    out[1] = -1.0; /* where slip < 0 */
    return 0;
}
static int32_t slip(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = 1.0 - at->x[1]; /* the belt has the speed 1 */
    return 0;
}
static int32_t effort(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] * at->u[0];
    return 0;
}
static int32_t state(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    out[1] = at->x[1];
    return 0;
}

int main(void)
{
    const double rest[2] = {-1.0, 0.0}, goal[2] = {1.0, 0.0}, no_force = 0.0, least = -3.0, most = 3.0;
    const int64_t rows[1] = {1};     /* friction drives the velocity */
    const int8_t signs[2] = {1, -1}; /* mode 0: slip > 0, mode 1: slip < 0 */
    swb_function *f0, *modes, *psi, *cost, *end;
    swb_system *system;
    swb_integrator *integrator;
    swb_run *run;
    swb_run_info info;
    swb_event *switches;
    swb_ocp *ocp;
    int32_t outcome;
    double value;

    /* sizes: states, controls, parameters, outputs */
    TRY(swb_function_create("f0", 2, 1, 0, 2, smooth, NULL, NULL, &f0));
    TRY(swb_function_create("friction", 2, 1, 0, 2, friction, NULL, NULL, &modes));
    TRY(swb_function_create("slip", 2, 1, 0, 1, slip, NULL, NULL, &psi));
    TRY(swb_function_create("effort", 2, 1, 0, 1, effort, NULL, NULL, &cost));
    TRY(swb_function_create("state", 2, 1, 0, 2, state, NULL, NULL, &end));
    TRY(swb_system_create(2, 1, 0, &system));
    TRY(swb_system_set_f0(system, f0));
    TRY(swb_system_add_subsystem(system, rows, 1, modes, 2, psi, signs, 2, NULL));

    TRY(swb_integrator_create(system, NULL, &integrator));
    TRY(swb_integrator_set_controls(integrator, &no_force, 1));
    TRY(swb_integrator_reinit(integrator, 0.0, rest, 2));
    TRY(swb_integrator_advance(integrator, 5.0, NULL));
    TRY(swb_integrator_get_run(integrator, &run));
    TRY(swb_run_get_info(run, &info, sizeof info));
    switches = malloc((size_t)info.n_events * sizeof *switches);
    TRY(swb_run_events(run, switches, info.n_events, sizeof *switches));
    for (int64_t k = 0; k < info.n_events; k++)
        printf("switch at %.4f\n", switches[k].t); /* pi/6, pi/6 + sqrt(3): it sticks in between */

    TRY(swb_ocp_create(system, 2.0, 10, NULL, &ocp));
    TRY(swb_ocp_set_lagrange(ocp, cost));
    TRY(swb_ocp_set_initial_state(ocp, rest, 2));
    TRY(swb_ocp_set_control_bounds(ocp, &least, 1, &most, 1));
    TRY(swb_ocp_add_terminal(ocp, end, goal, 2, goal, 2));
    TRY(swb_ocp_solve(ocp, &outcome));
    TRY(swb_ocp_get_cost(ocp, &value));
    printf("%s, cost %.5f\n", swb_outcome_name(outcome), value); /* solved, cost 4.03906 */

    free(switches);
    swb_ocp_free(ocp);
    swb_run_free(run);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_function_free(f0);
    swb_function_free(modes);
    swb_function_free(psi);
    swb_function_free(cost);
    swb_function_free(end);
    return info.n_events == 2 && outcome == SWB_OUTCOME_SOLVED && fabs(value - 4.03906) < 1e-4 ? 0 : 1;
}
