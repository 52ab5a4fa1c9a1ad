#include "scenarios.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../kink.h"

const char *failed_call = "";

/* Everything a scenario makes; what it did not come to stays NULL, which may be freed. */
struct made {
    swb_function *f[8];
    swb_system *system;
    swb_expr *graph, *second_graph;
    swb_model *model, *second_model;
    swb_scene *scene;
    swb_integrator *integrator;
    swb_stepper *stepper;
    swb_simulator *simulator, *second_simulator;
    swb_batch *batch;
    swb_run *run;
    swb_trajectory *trajectory;
    swb_mpcc *mpcc;
    swb_ocp *ocp, *second_ocp;
    swb_multiphase *multiphase;
    char *text;
    swb_status status;
};

#define DO(call)                         \
    do {                                 \
        m->status = (call);              \
        if (m->status != SWB_OK) {       \
            failed_call = #call;         \
            return;                      \
        }                                \
    } while (0)

static void release(struct made *m)
{
    int k;
    free(m->text);
    swb_multiphase_free(m->multiphase);
    swb_ocp_free(m->ocp);
    swb_ocp_free(m->second_ocp);
    swb_mpcc_free(m->mpcc);
    swb_trajectory_free(m->trajectory);
    swb_run_free(m->run);
    swb_batch_free(m->batch);
    swb_simulator_free(m->simulator);
    swb_simulator_free(m->second_simulator);
    swb_integrator_free(m->integrator);
    swb_stepper_free(m->stepper);
    swb_model_free(m->model);
    swb_scene_free(m->scene);
    swb_model_free(m->second_model);
    swb_expr_free(m->graph);
    swb_expr_free(m->second_graph);
    swb_system_free(m->system);
    for (k = 0; k < 8; k++)
        swb_function_free(m->f[k]);
}

/* Texts of the program itself are not what is tested: with room for all of them nothing else can fail. */
enum { ROOM = 1 << 18 };
static char room[ROOM];

/* --- callbacks ---------------------------------------------------------------------------------------- */

static int32_t relay_modes(const swb_point *at, double *out, void *data)
{
    double u = at->u ? at->u[0] : 0.0;
    (void)data;
    out[0] = 1.0 + u;
    out[1] = at->x[0];
    out[2] = -2.0 + u;
    out[3] = -at->x[1];
    return 0;
}

static int32_t relay_surface(const swb_point *at, double *out, void *data)
{
    (void)data;
    out[0] = at->x[0] + 0.1 * at->x[1];
    return 0;
}

static int32_t control_squared(const swb_point *at, double *out, void *data)
{
    (void)data;
    out[0] = at->u[0] * at->u[0] + at->x[0] * at->x[0];
    return 0;
}

static int32_t gap(const swb_point *at, double *out, void *data)
{
    (void)data;
    out[0] = at->x[1] - at->x[0];
    return 0;
}

static int32_t bilinear(const swb_point *at, double *out, void *data)
{
    (void)data;
    out[0] = at->x[0] * at->x[1];
    out[1] = at->x[0] + at->u[0];
    return 0;
}

static int32_t quadratic(const swb_point *at, double *out, void *data)
{
    (void)data;
    out[0] = (at->x[0] - 1.0) * (at->x[0] - 1.0) + (at->x[1] - 0.5) * (at->x[1] - 0.5);
    return 0;
}

static int32_t total(const swb_point *at, double *out, void *data)
{
    (void)data;
    out[0] = at->x[0] + at->x[1];
    return 0;
}

/* --- parts -------------------------------------------------------------------------------------------- */

static const int64_t BOTH[] = {0, 1}, FIRST[] = {0};
static const int8_t SIGNS[] = {-1, 1};

/* Two states, one control, a sliding mode. */
static void relay(struct made *m)
{
    DO(swb_function_create("F", 2, 1, 0, 4, relay_modes, NULL, NULL, &m->f[0]));
    DO(swb_function_create("c", 2, 1, 0, 1, relay_surface, NULL, NULL, &m->f[1]));
    DO(swb_system_create(2, 1, 0, &m->system));
    DO(swb_system_add_subsystem(m->system, BOTH, 2, m->f[0], 2, m->f[1], SIGNS, 2, NULL));
}

/* x' = 2 - sign(x), start free, an optimum that is known. */
static void ocp(struct made *m, const swb_settings *settings)
{
    static const double lower[] = {-2.0}, upper[] = {-1.0};
    DO(swb_function_create("F", 1, 0, 0, 2, kink_slopes, NULL, NULL, &m->f[0]));
    DO(swb_function_create("c", 1, 0, 0, 1, first_state, NULL, NULL, &m->f[1]));
    DO(swb_function_create("L", 1, 0, 0, 1, first_state_squared, NULL, NULL, &m->f[2]));
    DO(swb_function_create("M", 1, 0, 0, 1, kink_distance, NULL, NULL, &m->f[3]));
    DO(swb_system_create(1, 0, 0, &m->system));
    DO(swb_system_add_subsystem(m->system, FIRST, 1, m->f[0], 2, m->f[1], SIGNS, 2, NULL));
    DO(swb_ocp_create(m->system, 2.0, 3, settings, &m->ocp));
    DO(swb_ocp_set_lagrange(m->ocp, m->f[2]));
    DO(swb_ocp_set_mayer(m->ocp, m->f[3]));
    DO(swb_ocp_set_initial_bounds(m->ocp, lower, 1, upper, 1));
}

/* The relay with a control that is paid for. */
static void controlled(struct made *m, const swb_settings *settings)
{
    static const double start[] = {0.5, 0.2}, lower[] = {-3.0}, upper[] = {3.0};
    relay(m);
    if (m->status != SWB_OK)
        return;
    DO(swb_function_create("L", 2, 1, 0, 1, control_squared, NULL, NULL, &m->f[2]));
    DO(swb_function_create("E", 2, 1, 0, 1, relay_surface, NULL, NULL, &m->f[3]));
    DO(swb_ocp_create(m->system, 1.0, 3, settings, &m->ocp));
    DO(swb_ocp_set_lagrange(m->ocp, m->f[2]));
    DO(swb_ocp_set_initial_state(m->ocp, start, 2));
    DO(swb_ocp_set_control_bounds(m->ocp, lower, 1, upper, 1));
}

/* x' = v, v' = -x + cos(t/2) - 0.4 sign(v), as expressions. */
static void coulomb(struct made *m)
{
    int64_t z[2], t, c[3], a, b, rhs[2];
    const double numbers[] = {0.5, 0.4, 1.0}, x0[] = {1.0, 0.0};
    const swb_point start = {0.0, x0, NULL, NULL};
    DO(swb_expr_create(&m->graph));
    DO(swb_expr_inputs(m->graph, SWB_INPUT_X, 0, z, 2));
    DO(swb_expr_inputs(m->graph, SWB_INPUT_T, 0, &t, 1));
    DO(swb_expr_constants(m->graph, numbers, 3, c, 3));
    DO(swb_expr_apply(m->graph, SWB_OPERATOR_MUL, &t, &c[0], NULL, &a, 1));
    DO(swb_expr_apply(m->graph, SWB_OPERATOR_COS, &a, NULL, NULL, &a, 1));
    DO(swb_expr_apply(m->graph, SWB_OPERATOR_SUB, &a, &z[0], NULL, &a, 1));
    DO(swb_expr_apply(m->graph, SWB_OPERATOR_SIGN, &z[1], NULL, NULL, &b, 1));
    DO(swb_expr_apply(m->graph, SWB_OPERATOR_MUL, &b, &c[1], NULL, &b, 1));
    DO(swb_expr_apply(m->graph, SWB_OPERATOR_SUB, &a, &b, NULL, &rhs[1], 1));
    rhs[0] = z[1];
    DO(swb_model_create(m->graph, "coulomb", 2, 0, 0, rhs, "q\nv", &start, &m->model));
    DO(swb_model_system(m->model, &m->system));
}

static void integrator(struct made *m, const char *option, const char *method)
{
    static const double x0[] = {0.5, 0.2}, u[] = {0.1};
    swb_settings settings;
    relay(m);
    if (m->status != SWB_OK)
        return;
    DO(swb_settings_init(&settings, sizeof settings));
    DO(swb_settings_set_string(&settings, option, "on"));
    DO(swb_settings_set_string(&settings, "integration", method));
    DO(swb_integrator_create(m->system, &settings, &m->integrator));
    DO(swb_integrator_reinit(m->integrator, 0.0, x0, 2));
    DO(swb_integrator_set_controls(m->integrator, u, 1));
    DO(swb_integrator_advance(m->integrator, 2.0, NULL));
}

static void mpcc(struct made *m, const swb_settings *settings, double least)
{
    static const double zero[] = {0.0, 0.0}, one[] = {1.0, 1.0};
    const double upper = 1e20;
    DO(swb_function_create("f", 2, 0, 0, 1, quadratic, NULL, NULL, &m->f[0]));
    DO(swb_function_create("c", 2, 0, 0, 1, total, NULL, NULL, &m->f[1]));
    DO(swb_mpcc_create(2, 0, m->f[0], m->f[1], settings, &m->mpcc));
    DO(swb_mpcc_add_pair(m->mpcc, SWB_MEMBER_VARIABLE, 0, SWB_MEMBER_VARIABLE, 1));
    DO(swb_mpcc_set_name(m->mpcc, SWB_ITEM_CONSTRAINT, 0, "total"));
    DO(swb_mpcc_set_bounds(m->mpcc, zero, 2, (const double[]){5.0, least > 5.0 ? 1.0 : 5.0}, 2));
    DO(swb_mpcc_set_constraint_bounds(m->mpcc, &least, 1, &upper, 1));
    DO(swb_mpcc_set_start(m->mpcc, one, 2));
    DO(swb_mpcc_solve(m->mpcc, NULL));
}

/* --- scenarios ---------------------------------------------------------------------------------------- */

static void functions(struct made *m)
{
    static const double x[] = {1.0, 2.0}, u[] = {0.5}, w[] = {1.0, 1.0};
    const swb_point at = {0.0, x, u, NULL};
    int64_t jac = 0, hess = 0;
    int32_t passed;
    double out[2], entries[32];
    DO(swb_function_create("g", 2, 1, 0, 2, bilinear, NULL, NULL, &m->f[0]));
    DO(swb_function_sizes(m->f[0], NULL, NULL, NULL, NULL, &jac, &hess));
    DO(swb_function_eval(m->f[0], &at, out, 2));
    DO(swb_function_eval_jacobian(m->f[0], &at, entries, jac));
    DO(swb_function_eval_hessian(m->f[0], &at, w, 2, entries, hess));
    DO(swb_function_check_derivatives(m->f[0], &at, &passed, NULL, room, ROOM, NULL));
    DO(swb_function_name(m->f[0], room, ROOM, NULL));
}

static void systems(struct made *m)
{
    int64_t nx;
    relay(m);
    if (m->status == SWB_OK)
        DO(swb_system_sizes(m->system, &nx, NULL, NULL, NULL));
}

static void settings(struct made *m)
{
    swb_settings s;
    DO(swb_settings_init(&s, sizeof s));
    DO(swb_settings_set_string(&s, "rk_family", "gauss_legendre"));
    DO(swb_settings_set_string(&s, "tol", "1e-7"));
    DO(swb_settings_get_string(&s, "tol", room, ROOM, NULL));
    DO(swb_settings_to_json(&s, room, ROOM, NULL));
    DO(swb_settings_validate(&s));
}

static void models(struct made *m)
{
    coulomb(m);
    if (m->status != SWB_OK)
        return;
    DO(swb_model_report(m->model, 0, room, ROOM, NULL));
    DO(swb_model_report(m->model, 1, room, ROOM, NULL));
    DO(swb_model_write_c(m->model, room, ROOM, NULL));
}

/* The system of a block that falls on a rough floor and slides. */
static void make_block(struct made *m)
{
    static const double numbers[4] = {0.0, -10.0, 0.3, 1.0};
    int64_t x[4], c[4], entries[4], force[2];
    DO(swb_expr_create(&m->graph));
    DO(swb_expr_inputs(m->graph, SWB_INPUT_X, 0, x, 4));
    DO(swb_expr_constants(m->graph, numbers, 4, c, 4));
    DO(swb_scene_create("block", 2, 2, 0, 0, "x\ny\nu\nv", &m->scene));
    entries[0] = entries[3] = c[3];
    entries[1] = entries[2] = force[0] = c[0];
    force[1] = c[1];
    DO(swb_scene_set_inertia(m->scene, m->graph, entries, 4));
    DO(swb_scene_set_force(m->scene, m->graph, force, 2));
    DO(swb_scene_add_contact(m->scene, m->graph, "floor", x[1], x, 1, c[2], c[0], NULL));
    DO(swb_scene_build(m->scene, m->graph));
    DO(swb_scene_report(m->scene, 1, room, ROOM, NULL));
    DO(swb_scene_system(m->scene, &m->system));
}

static const double block_start[4] = {0.0, 0.1, 1.0, 0.0};

static void scenes(struct made *m)
{
    static const double t = 0.4;
    int64_t modes[1];
    double forces[3];
    int32_t outcome;
    make_block(m);
    if (m->status != SWB_OK)
        return;
    DO(swb_integrator_create(m->system, NULL, &m->integrator));
    DO(swb_integrator_set_string(m->integrator, "dense", "on"));
    DO(swb_integrator_set_string(m->integrator, "sensitivity", "on"));
    DO(swb_integrator_reinit(m->integrator, 0.0, block_start, 4));
    DO(swb_integrator_advance(m->integrator, 0.5, &outcome));
    DO(swb_integrator_get_run(m->integrator, &m->run));
    DO(swb_run_contact_modes(m->run, &t, 1, modes, 1));
    DO(swb_run_contact_forces(m->run, &t, 1, forces, 3));
}

/* The same block in steps: it lands during the first calls and slides in the last. */
static void steps_of_scenes(struct made *m)
{
    double times[16], states[64], impulses[48], x[4];
    int64_t n = 0;
    swb_step_options options;
    swb_step_stats stats;
    make_block(m);
    if (m->status != SWB_OK)
        return;
    DO(swb_step_options_init(&options, sizeof options));
    options.h = 0.01;
    DO(swb_stepper_create(m->system, &options, &m->stepper));
    DO(swb_stepper_set_state(m->stepper, 0.0, block_start, 4));
    DO(swb_stepper_step(m->stepper));
    DO(swb_stepper_advance(m->stepper, 0.3));
    DO(swb_stepper_count(m->stepper, 0.4, 2, &n));
    if (n <= 16)
        DO(swb_stepper_run(m->stepper, 0.4, 2, times, n, states, 4 * n, impulses, 3 * n));
    DO(swb_stepper_get_state(m->stepper, x, 4));
    DO(swb_stepper_get_stats(m->stepper, &stats, sizeof stats));
}

static void expressions(struct made *m)
{
    int64_t x[4], rhs[2], y[2], product[4], jac[16], w[1], equation;
    const double points[] = {0.0, 1.0, 2.0}, values[] = {0.0, 1.0, 4.0}, at_x[] = {2.0, 1.0, 1.0, 3.0};
    const swb_point at = {0.0, at_x, NULL, NULL};
    double out[2];
    DO(swb_expr_create(&m->graph));
    DO(swb_expr_inputs(m->graph, SWB_INPUT_X, 0, x, 4));
    rhs[0] = x[0];
    rhs[1] = x[3];
    DO(swb_expr_solve(m->graph, x, 4, rhs, y, 2));
    DO(swb_expr_lagrangian_forces(m->graph, x, 1, x[0], x, &x[1], y, 1));
    DO(swb_expr_unknowns(m->graph, w, 1));
    DO(swb_expr_apply(m->graph, SWB_OPERATOR_SUB, w, x, NULL, &equation, 1));
    DO(swb_expr_implicit(m->graph, &equation, w, x, y, 1));
    DO(swb_expr_matmul(m->graph, 2, 1, 2, y, 2, y, 2, product, 4));
    DO(swb_expr_table(m->graph, SWB_TABLE_SPLINE, points, 3, values, 3, y, product, 2));
    DO(swb_expr_jacobian(m->graph, product, 2, x, 4, jac, 8));
    DO(swb_expr_text(m->graph, product[0], room, ROOM, NULL));
    DO(swb_expr_function(m->graph, "f", 4, 0, 0, product, 2, &m->f[0]));
    DO(swb_function_eval(m->f[0], &at, out, 2));
}

static void model_document(struct made *m)
{
    coulomb(m);
    if (m->status != SWB_OK)
        return;
    DO(swb_model_to_json(m->model, room, ROOM, NULL));
    DO(swb_expr_create(&m->second_graph));
    DO(swb_model_from_json(m->second_graph, room, NULL, 0, NULL, 0, &m->second_model));
}

static void simulation_document(struct made *m)
{
    static const double x0[] = {1.0, 0.0};
    coulomb(m);
    if (m->status != SWB_OK)
        return;
    DO(swb_simulator_create(m->system, NULL, &m->simulator));
    DO(swb_simulator_set_state(m->simulator, 0.0, x0, 2));
    DO(swb_simulator_to_json(m->simulator, 1.0, 4, room, ROOM, NULL));
    DO(swb_simulator_from_json(room, NULL, 0, NULL, NULL, &m->second_simulator));
}

static void ocp_document(struct made *m)
{
    static const double x0[] = {1.0, 0.0};
    coulomb(m);
    if (m->status != SWB_OK)
        return;
    DO(swb_ocp_create(m->system, 1.0, 2, NULL, &m->ocp));
    DO(swb_ocp_set_initial_state(m->ocp, x0, 2));
    DO(swb_ocp_to_json(m->ocp, room, ROOM, NULL));
    DO(swb_ocp_from_json(room, NULL, 0, &m->second_ocp));
}

static void dense_output(struct made *m)
{
    static const double t[] = {0.1, 0.7, 1.5};
    double x[6];
    swb_run_info info;
    integrator(m, "dense", "auto");
    if (m->status != SWB_OK)
        return;
    DO(swb_integrator_get_run(m->integrator, &m->run));
    DO(swb_run_get_info(m->run, &info, sizeof info));
    DO(swb_run_evaluate(m->run, t, 3, 0, x, 6));
    DO(swb_run_reason(m->run, room, ROOM, NULL));
}

static void stiff_integration(struct made *m)
{
    integrator(m, "dense", "radau5");
}

static void forward_sensitivity(struct made *m)
{
    double s[8];
    swb_run_info info;
    integrator(m, "sensitivity", "auto");
    if (m->status != SWB_OK)
        return;
    DO(swb_integrator_get_run(m->integrator, &m->run));
    DO(swb_run_get_info(m->run, &info, sizeof info));
    if (info.n_columns * 2 <= 8)
        DO(swb_run_sensitivity(m->run, s, info.n_columns * 2));
}

static void adjoint_sensitivity(struct made *m)
{
    static const double v[] = {1.0, 0.0};
    double dx0[2], du[1];
    integrator(m, "adjoint", "auto");
    if (m->status == SWB_OK)
        DO(swb_integrator_adjoint(m->integrator, v, 2, NULL, 0, NULL, 0, NULL, 0, NULL, 0, dx0, 2, NULL, 0, du, 1));
}

static void second_derivatives(struct made *m)
{
    static const double v[] = {1.0, 0.0}, direction[] = {0.3, 0.4}, by_control[] = {1.0};
    double dx0[2], du[1], moved[2];
    integrator(m, "adjoint", "auto");
    if (m->status == SWB_OK)
        DO(swb_integrator_adjoint_along(m->integrator, v, 2, direction, 2, NULL, 0, by_control, 1, dx0, 2, NULL, 0, du, 1, moved, 2));
}

/* x' = pulse; y is x at 0.25 and 0.55, and is doubled at 0.9. */
static void clocks(struct made *m)
{
    static const double numbers[3] = {0.0, 0.5, 2.0}, once[1] = {0.9}, x0[6] = {0};
    static const int64_t sampled = 1, pulse = 2, strikes = 3, times = 4, pulses = 5;
    int64_t x[6], c[3], rhs[6], doubled;
    DO(swb_expr_create(&m->graph));
    DO(swb_expr_inputs(m->graph, SWB_INPUT_X, 0, x, 6));
    DO(swb_expr_constants(m->graph, numbers, 3, c, 3));
    DO(swb_expr_apply(m->graph, SWB_OPERATOR_MUL, &c[2], &x[1], NULL, &doubled, 1));
    for (int i = 0; i < 6; i++)
        rhs[i] = i ? c[0] : x[2];
    DO(swb_model_create(m->graph, "clocked", 6, 0, 0, rhs, NULL, NULL, &m->model));
    DO(swb_model_set_discrete(m->model, x0, 5));
    DO(swb_model_add_clock(m->model, m->graph, 0.3, 0.25, strikes, &sampled, 1, &x[0], 1, NULL, 0, NULL, 0, NULL));
    DO(swb_model_add_times(m->model, m->graph, once, 1, times, &sampled, 1, &doubled, 1, NULL, 0, NULL, 0, NULL));
    DO(swb_model_add_pwm(m->model, m->graph, c[1], 0.4, 0.0, pulse, pulses, NULL));
    DO(swb_model_system(m->model, &m->system));
    DO(swb_integrator_create(m->system, NULL, &m->integrator));
    DO(swb_integrator_reinit(m->integrator, 0.0, x0, 6));
    DO(swb_integrator_advance(m->integrator, 1.0, NULL));
}

static void batch(struct made *m, int64_t threads)
{
    static const double x0[] = {0.5, 0.2, 0.4, 0.1, 0.3, -0.2};
    double x[6];
    relay(m);
    if (m->status != SWB_OK)
        return;
    DO(swb_batch_create(m->system, NULL, &m->batch));
    DO(swb_batch_run(m->batch, 0.0, 1.0, x0, 6, NULL, 0, NULL, 0, threads));
    DO(swb_batch_states(m->batch, x, 6));
    DO(swb_batch_get_run(m->batch, 1, &m->run));
}

static void batch_of_one_thread(struct made *m)
{
    batch(m, 1);
}

static void batch_of_threads(struct made *m)
{
    batch(m, 3);
}

static void simulation_with(struct made *m, const char *discretisation)
{
    static const double x0[] = {0.5, 0.2};
    double t[32];
    swb_trajectory_info info;
    swb_settings s;
    relay(m);
    if (m->status != SWB_OK)
        return;
    DO(swb_settings_init(&s, sizeof s));
    DO(swb_settings_set_string(&s, "discretisation", discretisation));
    DO(swb_simulator_create(m->system, &s, &m->simulator));
    DO(swb_simulator_set_state(m->simulator, 0.0, x0, 2));
    DO(swb_simulator_run(m->simulator, 1.0, 4, NULL));
    DO(swb_simulator_get_trajectory(m->simulator, &m->trajectory));
    DO(swb_trajectory_get_info(m->trajectory, &info, sizeof info));
    if (info.n_elements < 32)
        DO(swb_trajectory_times(m->trajectory, t, info.n_elements + 1));
}

static void simulation(struct made *m)
{
    simulation_with(m, "fesd");
}

static void time_stepping(struct made *m)
{
    simulation_with(m, "standard");
}

static void programs(struct made *m)
{
    swb_certificate certificate;
    double y[1], z[2];
    mpcc(m, NULL, 0.0);
    if (m->status != SWB_OK)
        return;
    DO(swb_mpcc_get_certificate(m->mpcc, &certificate, sizeof certificate));
    DO(swb_mpcc_get_multipliers(m->mpcc, y, 1, z, 2));
    DO(swb_mpcc_report_text(m->mpcc, room, ROOM, NULL));
    DO(swb_mpcc_statistics_json(m->mpcc, room, ROOM, NULL));
    DO(swb_mpcc_resolve(m->mpcc, NULL));
}

static void conflicts(struct made *m)
{
    int64_t found;
    mpcc(m, NULL, 9.0);
    if (m->status != SWB_OK)
        return;
    DO(swb_mpcc_get_conflict(m->mpcc, NULL, NULL, NULL, 0, &found, NULL, NULL));
    DO(swb_mpcc_report_text(m->mpcc, room, ROOM, NULL));
}

static void ocp_with(struct made *m, const char *name, int64_t value)
{
    swb_settings s;
    DO(swb_settings_init(&s, sizeof s));
    s.n_fe = 2;
    DO(swb_settings_set_int(&s, name, value));
    ocp(m, &s);
    if (m->status == SWB_OK)
        DO(swb_ocp_solve(m->ocp, NULL));
}

static void optimal_control(struct made *m)
{
    double cost;
    swb_certificate certificate;
    ocp_with(m, "accuracy", 0);
    if (m->status != SWB_OK)
        return;
    DO(swb_ocp_get_cost(m->ocp, &cost));
    DO(swb_ocp_get_trajectory(m->ocp, &m->trajectory));
    DO(swb_ocp_get_certificate(m->ocp, &certificate, sizeof certificate));
    DO(swb_ocp_get_message(m->ocp, room, ROOM, NULL));
}

static void accuracy_and_sensitivity(struct made *m)
{
    double d[2];
    swb_accuracy accuracy;
    swb_settings s;
    DO(swb_settings_init(&s, sizeof s));
    controlled(m, &s);
    if (m->status != SWB_OK)
        return;
    DO(swb_ocp_solve(m->ocp, NULL));
    DO(swb_ocp_get_accuracy(m->ocp, &accuracy, sizeof accuracy));
    DO(swb_ocp_get_sensitivity(m->ocp, d, 2, NULL, 0, NULL));
}

static void mode_search(struct made *m)
{
    ocp_with(m, "mode_search", 10);
}

static void standard_elements(struct made *m)
{
    ocp_with(m, "discretisation", SWB_DISCRETISATION_STANDARD);
}

static void stand_in(struct made *m)
{
    ocp_with(m, "rk_family", SWB_RK_FAMILY_GAUSS_LEGENDRE);
}

static void adaptation(struct made *m)
{
    swb_settings s;
    int64_t rounds;
    DO(swb_settings_init(&s, sizeof s));
    s.n_fe = 2;
    s.adapt_tol = 1e-6;
    ocp(m, &s);
    if (m->status != SWB_OK)
        return;
    DO(swb_ocp_solve(m->ocp, NULL));
    DO(swb_ocp_get_adaptation(m->ocp, &rounds, NULL, NULL));
}

static void starts_on(struct made *m, int64_t threads)
{
    double u[9];
    int64_t best;
    controlled(m, NULL);
    if (m->status != SWB_OK)
        return;
    DO(swb_ocp_random_starts(m->ocp, 3, u, 9));
    DO(swb_ocp_solve_starts(m->ocp, u, 9, threads, &best));
}

static void starts(struct made *m)
{
    starts_on(m, 1);
}

static void starts_of_threads(struct made *m)
{
    starts_on(m, 3);
}

static void infeasible(struct made *m)
{
    static const double far[] = {50.0};
    ocp(m, NULL);
    if (m->status != SWB_OK)
        return;
    DO(swb_ocp_add_terminal(m->ocp, m->f[1], far, 1, far, 1));
    DO(swb_ocp_solve(m->ocp, NULL));
    DO(swb_ocp_get_message(m->ocp, room, ROOM, NULL));
}

static void constraints_of_all_kinds(struct made *m)
{
    static const double low[] = {-5.0}, high[] = {5.0}, weight[] = {0.1}, aim[] = {0.2};
    controlled(m, NULL);
    if (m->status != SWB_OK)
        return;
    DO(swb_ocp_add_path(m->ocp, m->f[3], low, 1, high, 1, SWB_PATH_AT_ELEMENTS));
    DO(swb_ocp_add_relaxed(m->ocp, m->f[3], low, 1, aim, 1, SWB_PATH_AT_CONTROL_GRID, SWB_NORM_L1, 10.0));
    DO(swb_ocp_add_least_squares(m->ocp, m->f[3], weight, 1, aim, 1, SWB_COST_AT_TERMINAL));
    DO(swb_ocp_set_free_time(m->ocp, SWB_FREE_TIME_HORIZON, 0.5, 1.5));
    DO(swb_ocp_solve(m->ocp, NULL));
}

static void warm_start(struct made *m)
{
    static const double start[] = {0.45, 0.2};
    double times[64];
    int32_t modes[256], cells[256];
    int64_t n_phases = 0, n_modes = 0, n_cells = 0;
    controlled(m, NULL);
    if (m->status != SWB_OK)
        return;
    DO(swb_ocp_solve(m->ocp, NULL));
    DO(swb_ocp_mode_sizes(m->ocp, &n_phases, &n_modes, &n_cells));
    if (n_phases * (n_modes + n_cells) < 256 && n_phases < 60) {
        DO(swb_ocp_get_modes(m->ocp, times, n_phases, modes, n_phases * n_modes, cells, n_phases * n_cells));
        DO(swb_ocp_set_modes(m->ocp, times, n_phases, modes, n_phases * n_modes, cells, n_phases * n_cells));
    }
    DO(swb_ocp_shift(m->ocp));
    DO(swb_ocp_set_initial_state(m->ocp, start, 2));
    DO(swb_ocp_solve_warm(m->ocp, NULL));
}

static void multiphase(struct made *m)
{
    swb_ocp *parts[2];
    ocp(m, NULL);
    if (m->status != SWB_OK)
        return;
    DO(swb_ocp_create(m->system, 1.0, 2, NULL, &m->second_ocp));
    parts[0] = m->ocp;
    parts[1] = m->second_ocp;
    DO(swb_function_create("gap", 2, 0, 0, 1, gap, NULL, NULL, &m->f[4]));
    DO(swb_multiphase_create(parts, 2, NULL, &m->multiphase));
    DO(swb_multiphase_link(m->multiphase, 0, m->f[4], (const double[]){0.0}, 1, (const double[]){0.0}, 1));
    DO(swb_multiphase_solve(m->multiphase, NULL));
}

#define SCENARIO(name)                   \
    static swb_status run_##name(void)   \
    {                                    \
        struct made m = {0};             \
        name(&m);                        \
        release(&m);                     \
        return m.status;                 \
    }
#define ALL(X)                                                                                                    \
    X(functions) X(systems) X(settings) X(expressions) X(models) X(scenes) X(steps_of_scenes) X(model_document) X(simulation_document)         \
    X(ocp_document) X(dense_output) X(stiff_integration) X(forward_sensitivity) X(adjoint_sensitivity)            \
    X(second_derivatives) X(clocks)                                                                               \
    X(batch_of_one_thread) X(batch_of_threads) X(simulation) X(time_stepping) X(programs) X(conflicts)            \
    X(optimal_control) X(accuracy_and_sensitivity) X(mode_search) X(standard_elements) X(stand_in) X(adaptation)  \
    X(starts) X(starts_of_threads) X(infeasible) X(constraints_of_all_kinds) X(warm_start) X(multiphase)

ALL(SCENARIO)

#define ROW(name) {#name, run_##name},
const struct scenario SCENARIOS[] = {ALL(ROW)};
const int N_SCENARIOS = (int)(sizeof SCENARIOS / sizeof SCENARIOS[0]);
