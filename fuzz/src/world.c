#include "world.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "casadi.h"
#include "draw.h"
#include "pool.h"
#include "problems.h"
#include "run.h"
#include "texts.h"

/* A call of the world: counted as one of the fuzzer. */
static int did(int function, swb_status status)
{
    tally->calls++;
    tally->called[function]++;
    tally->succeeded[function] += status == SWB_OK;
    if (status == SWB_ERR_INTERNAL) {
        tally->function = function;
        run_defect("internal error: %s", swb_last_error());
        tally->function = -1;
    }
    return status == SWB_OK;
}
/* Take in what a problem gave; 0 if there is none. */
static int keep(int type, void *object)
{
    if (object)
        pool_add(type, object);
    return object != NULL;
}

#define DO(name, ...) did(F_##name, name(__VA_ARGS__))

static swb_settings small_settings(struct random *r)
{
    swb_settings s;
    draw_settings(r, &s);
    if (random_once_in(r, 3))
        return s;
    swb_settings_init(&s, sizeof s);
    s.n_fe = 2;
    s.max_iter = 200;
    s.max_steps = 2000;
    s.dense = s.sensitivity = s.adjoint = 1;
    return s;
}

enum { ENOUGH = 1 << 16 };

/* The document of an object, to be freed; NULL if there is none. It is kept for later calls. */
static char *document_of(swb_status (*write)(void *, char *, int64_t, int64_t *), void *object)
{
    char *text = malloc(ENOUGH);
    if (text && write(object, text, ENOUGH, NULL) == SWB_OK) {
        draw_keep_document(text);
        return text;
    }
    free(text);
    return NULL;
}

static void keep_document(swb_status (*write)(void *, char *, int64_t, int64_t *), void *object)
{
    free(document_of(write, object));
}

static swb_status write_ocp(void *ocp, char *text, int64_t n, int64_t *needed)
{
    return swb_ocp_to_json(ocp, text, n, needed);
}

static swb_status write_model(void *model, char *text, int64_t n, int64_t *needed)
{
    return swb_model_to_json(model, text, n, needed);
}

static swb_expr *graph_written;

static swb_status write_scene(void *scene, char *text, int64_t n, int64_t *needed)
{
    return swb_scene_to_json(scene, graph_written, text, n, needed);
}

static swb_status write_simulator(void *sim, char *text, int64_t n, int64_t *needed)
{
    return swb_simulator_to_json(sim, 1.0, 4, text, n, needed);
}

static void simulate(struct random *r, const struct friction *f, const swb_settings *s)
{
    static const double v[FRICTION_NX] = {1.0, 0.0};
    double dx[FRICTION_NX] = {0}, dp[FRICTION_NP] = {0}, du[FRICTION_NU] = {0}, moved[FRICTION_NX];
    int32_t outcome;
    swb_integrator *it = friction_integrator(f, s);
    swb_run *run = NULL;
    if (keep(T_swb_integrator, it))
        DO(swb_integrator_advance, it, random_between(r, 0.1, 2.0), &outcome);
    if (it) {
        DO(swb_integrator_adjoint, it, v, FRICTION_NX, NULL, 0, NULL, 0, NULL, 0, NULL, 0, dx, FRICTION_NX, dp, FRICTION_NP, du, FRICTION_NU);
        DO(swb_integrator_adjoint_along, it, v, FRICTION_NX, dx, FRICTION_NX, dp, FRICTION_NP, du, FRICTION_NU, dx, FRICTION_NX, dp, FRICTION_NP, du,
           FRICTION_NU, moved, FRICTION_NX);
    }
    if (it && DO(swb_integrator_get_run, it, &run)) {
        double by[FRICTION_NX + FRICTION_NP + FRICTION_NU];
        int32_t before[2], after[2];
        DO(swb_run_event_modes, run, 0, before, after, 2);
        DO(swb_run_event_sensitivity, run, 0, by, FRICTION_NX + FRICTION_NP + FRICTION_NU);
        pool_add(T_swb_run, run);
    }
    swb_simulator *sim = friction_simulator(f, s);
    swb_trajectory *trajectory = NULL;
    if (keep(T_swb_simulator, sim)) {
        DO(swb_simulator_run, sim, 1.0, 2, &outcome);
        keep_document(write_simulator, sim);
    }
    if (sim && DO(swb_simulator_get_trajectory, sim, &trajectory))
        pool_add(T_swb_trajectory, trajectory);
    swb_batch *batch = friction_batch(f, s);
    const double starts[6] = {0.0, -0.4, 0.1, 0.3, 0.0, 0.0};
    if (keep(T_swb_batch, batch))
        DO(swb_batch_run, batch, 0.0, 0.5, starts, 6, friction_push, 1, friction_params, 1, random_below(r, 3));
}

/* A run with transitions. */
static void count(const swb_settings *s)
{
    static const double start[2] = {0.0, 0.0}, known = 0.1;
    static const int32_t jumps_ = 1;
    swb_note note;
    struct counter c = {NULL, NULL, NULL};
    double before[2], after[2], dt[2];
    int32_t outcome;
    swb_jump jumps[64];
    swb_run_info info;
    swb_integrator *it = NULL;
    swb_run *run = NULL;
    swb_expr *graph = NULL;
    MUST(swb_expr_create(&graph));
    counter_create(&c, graph);
    pool_add(T_swb_expr, graph);
    DO(swb_system_add_transition, c.system, c.guard, SWB_DIRECTION_RISING, NULL, 0, NULL, 0, c.reset, NULL, 0, NULL, 0, NULL);
    DO(swb_system_add_event, c.system, "end", SWB_EFFECT_STOP, SWB_TRIGGER_EDGE, c.guard, SWB_DIRECTION_FALLING, NULL, 0, NULL, 0, NULL, NULL, 0,
       NULL, 0, NULL);
    DO(swb_system_add_event, c.system, "seen", SWB_EFFECT_NOTE, SWB_TRIGGER_EDGE, c.guard, SWB_DIRECTION_RISING, NULL, 0, NULL, 0, NULL, NULL,
       0, NULL, 0, NULL);
    DO(swb_system_add_known_times, c.system, &known, 1, &jumps_, 1);
    keep(T_swb_system, c.system);
    keep(T_swb_function, c.guard);
    keep(T_swb_function, c.reset);
    if (!DO(swb_integrator_create, c.system, s, &it))
        return;
    pool_add(T_swb_integrator, it);
    DO(swb_integrator_reinit, it, 0.0, start, 2);
    DO(swb_integrator_advance, it, 0.5, &outcome);
    if (!DO(swb_integrator_get_run, it, &run))
        return;
    pool_add(T_swb_run, run);
    if (swb_run_get_info(run, &info, sizeof info) == SWB_OK && info.n_jumps <= 64)
        DO(swb_run_jumps, run, jumps, info.n_jumps, sizeof jumps[0]);
    DO(swb_run_jump_states, run, 0, before, after, 2);
    DO(swb_run_jump_sensitivity, run, 0, dt, 2);
    if (info.n_notes == 1)
        DO(swb_run_notes, run, &note, 1, sizeof note);
    DO(swb_run_note_state, run, 0, before, 2);
    DO(swb_run_note_sensitivity, run, 0, dt, 2);
}

/* An optimal control problem without controls: what it finds is the simulation. */
static void heater_ocp(swb_system *system, const swb_settings *s, const double *start)
{
    double before[2], after[2];
    swb_ocp_jump jumps[16];
    int64_t n = 0;
    int32_t outcome;
    swb_ocp *ocp = NULL;
    if (!DO(swb_ocp_create, system, 1.0, 2, s, &ocp))
        return;
    pool_add(T_swb_ocp, ocp);
    DO(swb_ocp_set_initial_state, ocp, start, 2);
    DO(swb_ocp_solve, ocp, &outcome);
    if (DO(swb_ocp_jump_count, ocp, &n) && n <= 16)
        DO(swb_ocp_jumps, ocp, jumps, n, sizeof jumps[0]);
    DO(swb_ocp_jump_states, ocp, 0, before, after, 2);
    double t[16];
    int64_t which[16], stages[16];
    int32_t at_once[16];
    if (n <= 16 && DO(swb_ocp_get_mode_transitions, ocp, t, which, stages, at_once, n)) {
        static const double begin = 0.0;
        DO(swb_ocp_set_modes, ocp, &begin, 1, NULL, 0, NULL, 0);
        DO(swb_ocp_set_mode_transitions, ocp, t, which, stages, at_once, n);
        DO(swb_ocp_solve, ocp, &outcome);
    }
}

/* A model with a discrete state and transitions, which is kept as a document, too. */
static void heater(const swb_settings *s)
{
    static const double start[2] = {0.4, 0.0}, numbers[3] = {0.3, 0.0, 0.5}, off = 0.0, on = 1.0;
    static const int64_t x_ = 0, heat = 1;
    int64_t x[2], c[3], rhs[2], cold, warm, raised, from, reset, to, id, n;
    double value, initial;
    char names[16];
    int32_t direction, outcome, effect, trigger;
    swb_expr *graph = NULL;
    swb_model *model = NULL;
    swb_system *system = NULL;
    swb_integrator *it = NULL;
    MUST(swb_expr_create(&graph));
    pool_add(T_swb_expr, graph);
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 2));
    MUST(swb_expr_constants(graph, numbers, 3, c, 3));
    MUST(swb_expr_apply(graph, SWB_OPERATOR_SUB, &x[1], &x[0], NULL, &rhs[0], 1));
    MUST(swb_expr_apply(graph, SWB_OPERATOR_MUL, &x[0], &x[0], NULL, &raised, 1));
    MUST(swb_expr_apply(graph, SWB_OPERATOR_SUB, &x[0], &c[0], NULL, &cold, 1));
    MUST(swb_expr_apply(graph, SWB_OPERATOR_SUB, &x[0], &c[2], NULL, &warm, 1));
    rhs[1] = c[1];
    if (!DO(swb_model_create, graph, "heater", 2, 0, 0, rhs, "x\nheat", NULL, &model))
        return;
    pool_add(T_swb_model, model);
    DO(swb_model_set_discrete, model, &off, 1);
    DO(swb_model_set_value_names, model, 0, "off\non");
    DO(swb_model_get_value_names, model, 0, names, sizeof names, &n);
    DO(swb_model_add_transition, model, graph, cold, SWB_DIRECTION_FALLING, &heat, 1, &off, 1, &x_, 1, &raised, 1, &heat, 1, &on, 1, NULL);
    DO(swb_model_add_transition, model, graph, warm, SWB_DIRECTION_RISING, &heat, 1, &on, 1, NULL, 0, NULL, 0, &heat, 1, &off, 1, &n);
    /* optimal control does not follow notes */
    if (DO(swb_model_system, model, &system)) {
        pool_add(T_swb_system, system);
        heater_ocp(system, s, start);
    }
    DO(swb_expr_apply, graph, SWB_OPERATOR_POSITIVE, &warm, NULL, NULL, &warm, 1);
    DO(swb_expr_apply, graph, SWB_OPERATOR_POSITIVE, &cold, NULL, NULL, &cold, 1);
    DO(swb_expr_apply, graph, SWB_OPERATOR_OR, &warm, &cold, NULL, &warm, 1);
    DO(swb_model_add_event, model, graph, "warm", SWB_EFFECT_NOTE, SWB_TRIGGER_EDGE, warm, SWB_DIRECTION_RISING, NULL, 0, NULL, 0, NULL, 0,
       NULL, 0, NULL, 0, NULL, 0, &n);
    DO(swb_model_write_fmu, model, "/dev/null", "/dev/null", 3, start, 2, NULL, 0, NULL, 0, 1e-6, 1e-8, 1.0);
    DO(swb_model_get_rule, model, 2, &effect, &trigger, names, sizeof names, &n);
    DO(swb_model_transition_counts, model, &n, NULL);
    DO(swb_model_get_discrete, model, &initial, 1);
    DO(swb_model_transition_sizes, model, 0, &n, NULL, NULL);
    DO(swb_model_get_transition, model, 0, &n, &direction, &from, 1, &value, 1, &reset, 1, &id, 1, &to, 1, &initial, 1);
    keep_document(write_model, model);
    if (!DO(swb_model_system, model, &system))
        return;
    pool_add(T_swb_system, system);
    if (!DO(swb_integrator_create, system, s, &it))
        return;
    pool_add(T_swb_integrator, it);
    DO(swb_integrator_reinit, it, 0.0, start, 2);
    DO(swb_integrator_advance, it, 2.0, &outcome);
    /* no system is made of it any more: the same state counts for all of them */
    DO(swb_model_add_clock, model, graph, 0.5, 0.1, 1, &x_, 1, &raised, 1, NULL, 0, NULL, 0, NULL);
    DO(swb_model_add_times, model, graph, numbers, 1, 1, &x_, 1, &raised, 1, NULL, 0, NULL, 0, NULL);
    DO(swb_model_add_pwm, model, graph, c[0], 1.0, 0.0, 1, 0, NULL);
}

/* A scene in numerical time. */
static void frozen(swb_scene *scene, swb_expr *graph, const double *at)
{
    char text[4000];
    int64_t needed;
    swb_freeze_options options;
    swb_freeze_layout layout;
    swb_model *model = NULL;
    if (!DO(swb_freeze_options_init, &options, sizeof options))
        return;
    if (DO(swb_scene_freeze, scene, graph, &options, at, 4, NULL, 0, &layout, sizeof layout, &model))
        pool_add(T_swb_model, model);
    DO(swb_scene_freeze_report, scene, text, sizeof text, &needed);
}

/* Steps of a scene with two coordinates and one contact. */
static void steps(swb_system *system, const double *start)
{
    double x[4], t, times[8], states[32], impulses[24];
    int64_t n, sizes[4];
    swb_step_options options;
    swb_step_stats stats;
    swb_stepper *stepper = NULL;
    if (!DO(swb_step_options_init, &options, sizeof options))
        return;
    options.h = 0.01;
    if (!DO(swb_stepper_create, system, &options, &stepper))
        return;
    pool_add(T_swb_stepper, stepper);
    DO(swb_stepper_set_params, stepper, NULL, 0);
    DO(swb_stepper_set_controls, stepper, NULL, 0);
    DO(swb_stepper_set_state, stepper, 0.0, start, 4);
    DO(swb_stepper_step, stepper);
    DO(swb_stepper_advance, stepper, 0.2);
    if (DO(swb_stepper_count, stepper, 0.3, 2, &n) && n <= 8)
        DO(swb_stepper_run, stepper, 0.3, 2, times, n, states, 4 * n, impulses, 3 * n);
    DO(swb_stepper_sizes, stepper, &sizes[0], &sizes[1], &sizes[2], &sizes[3]);
    DO(swb_stepper_get_time, stepper, &t);
    DO(swb_stepper_get_state, stepper, x, 4);
    DO(swb_stepper_get_impulses, stepper, impulses, 3);
    DO(swb_stepper_get_stats, stepper, &stats, sizeof stats);
    DO(swb_stepper_interrupt, stepper);
}

/* Optimal control of a block that falls: when it lands is found. */
static void controlled_block(const swb_scene *scene, const swb_settings *s, const double *start)
{
    static const double t = 0.1;
    int64_t n_contacts = 0, n_impacts = 0, modes[1];
    double forces[3];
    int32_t outcome;
    char text[64];
    swb_impact impacts[64];
    swb_ocp *ocp = NULL;
    if (!DO(swb_ocp_create_scene, scene, 0.4, 2, s, &ocp))
        return;
    pool_add(T_swb_ocp, ocp);
    DO(swb_ocp_set_jumps, ocp, SWB_JUMPS_MODES);
    DO(swb_ocp_set_initial_state, ocp, start, 4);
    DO(swb_ocp_solve, ocp, &outcome);
    DO(swb_ocp_get_contacts, ocp, &n_contacts, &n_impacts);
    DO(swb_ocp_freezing_report, ocp, text, sizeof text, NULL);
    if (n_impacts >= 0 && n_impacts <= 64)
        DO(swb_ocp_impacts, ocp, impacts, n_impacts, sizeof *impacts);
    DO(swb_ocp_contact_modes, ocp, &t, 1, modes, 1);
    DO(swb_ocp_contact_forces, ocp, &t, 1, forces, 3);
}

/* Dry friction, a larger one for sticking, and a constraint, added to a scene with two coordinates and one contact. */
static void joints(swb_scene *scene, swb_expr *graph, const int64_t *x, const int64_t *c, const swb_settings *s,
                   const double *start)
{
    static const double t = 0.2;
    int64_t modes[3];
    double forces[9];
    int32_t outcome;
    swb_system *system = NULL;
    swb_integrator *it = NULL;
    swb_run *run = NULL;
    DO(swb_scene_set_stiction, scene, graph, 0, c[3]);
    DO(swb_scene_set_separation, scene, graph, 0, c[2]);
    DO(swb_scene_add_friction, scene, graph, "guide", x[0], c[2], c[3], NULL);
    DO(swb_scene_add_constraint, scene, graph, "level", x[3], NULL);
    DO(swb_scene_set_state_rates, scene, graph, NULL, 0);
    if (!DO(swb_scene_build, scene, graph) || !DO(swb_scene_system, scene, &system))
        return;
    pool_add(T_swb_system, system);
    if (!DO(swb_integrator_create, system, s, &it))
        return;
    pool_add(T_swb_integrator, it);
    DO(swb_integrator_reinit, it, 0.0, start, 4);
    DO(swb_integrator_advance, it, 0.5, &outcome);
    if (!DO(swb_integrator_get_run, it, &run))
        return;
    pool_add(T_swb_run, run);
    DO(swb_run_contact_modes, run, &t, 1, modes, 3);
    DO(swb_run_contact_forces, run, &t, 1, forces, 9);
}

/* A bearing whose friction depends on a state beside coordinate and velocity. */
static void bearing(const swb_settings *s)
{
    static const double start[5] = {0.0, 1.0, 0.5, 0.0, 0.0}, low = 0.0, high = 1.0;
    int64_t x[3], on, slow = 3, where = 1;
    int32_t outcome;
    swb_expr *graph = NULL;
    swb_scene *scene = NULL;
    swb_system *system = NULL;
    swb_integrator *it = NULL;
    MUST(swb_expr_create(&graph));
    pool_add(T_swb_expr, graph);
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 3));
    if (!DO(swb_scene_create_with_states, "bearing", 1, 1, 1, 0, 0, NULL, &scene))
        return;
    pool_add(T_swb_scene, scene);
    /* the force switches with the velocity */
    if (!DO(swb_expr_apply, graph, SWB_OPERATOR_SIGN, &x[1], NULL, NULL, &on, 1))
        return;
    DO(swb_scene_set_force, scene, graph, &on, 1);
    DO(swb_scene_set_state_rates, scene, graph, &x[1], 1);
    DO(swb_scene_add_friction, scene, graph, "bearing", x[0], x[2], -1, NULL);
    /* the velocity is reset where it has fallen, and a discrete state says that once */
    DO(swb_scene_add_discrete, scene, "slow", 0.0, &slow);
    DO(swb_scene_add_event, scene, graph, "slows", SWB_EFFECT_JUMP, SWB_TRIGGER_LEVEL, x[1], SWB_DIRECTION_FALLING, &slow, 1, &low, 1, &where, 1,
       &x[2], 1, &slow, 1, &high, 1, NULL);
    int64_t ticks;
    if (DO(swb_scene_add_discrete, scene, "ticks", 0.0, &ticks)) {
        static const double strikes[] = {0.1, 0.3};
        DO(swb_scene_add_clock, scene, graph, 0.25, 0.05, ticks, &where, 1, &x[2], 1, NULL, 0, NULL, 0, NULL);
        DO(swb_scene_add_times, scene, graph, strikes, 2, slow, &where, 1, &x[2], 1, NULL, 0, NULL, 0, NULL);
        DO(swb_scene_add_pwm, scene, graph, x[2], 0.4, 0.0, slow, ticks, NULL);
    }
    if (!DO(swb_scene_build, scene, graph) || !DO(swb_scene_system, scene, &system))
        return;
    pool_add(T_swb_system, system);
    if (!DO(swb_integrator_create, system, s, &it))
        return;
    pool_add(T_swb_integrator, it);
    DO(swb_integrator_reinit, it, 0.0, start, 5);
    DO(swb_integrator_advance, it, 0.5, &outcome);
}

/* A block that falls on a rough floor and slides. */
static void block(const swb_settings *s)
{
    static const double numbers[4] = {0.0, -10.0, 0.3, 1.0}, start[4] = {0.0, 0.1, 1.0, 0.0}, t = 0.2;
    int64_t x[4], c[4], entries[4], force[2], modes[1];
    double dt[4], forces[3];
    int32_t outcome;
    char text[1000];
    swb_impact impacts[64];
    swb_run_info info;
    swb_expr *graph = NULL;
    swb_scene *scene = NULL;
    swb_system *system = NULL;
    swb_integrator *it = NULL;
    swb_run *run = NULL;
    MUST(swb_expr_create(&graph));
    pool_add(T_swb_expr, graph);
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 4));
    MUST(swb_expr_constants(graph, numbers, 4, c, 4));
    if (!DO(swb_scene_create, "block", 2, 2, 0, 0, NULL, &scene))
        return;
    pool_add(T_swb_scene, scene);
    entries[0] = entries[3] = c[3];
    entries[1] = entries[2] = force[0] = c[0];
    force[1] = c[1];
    DO(swb_scene_set_rates, scene, graph, &x[2], 2);
    DO(swb_scene_set_inertia, scene, graph, entries, 4);
    DO(swb_scene_set_force, scene, graph, force, 2);
    DO(swb_scene_add_contact, scene, graph, "floor", x[1], x, 1, c[2], c[0], NULL);
    DO(swb_scene_set_bounds, scene, 0, -10.0, INFINITY);
    DO(swb_scene_set_impact_law, scene, SWB_IMPACT_LAW_SEQUENTIAL);
    if (!DO(swb_scene_build, scene, graph))
        return;
    DO(swb_scene_report, scene, 1, text, sizeof text, NULL);
    graph_written = graph;
    char *saved = document_of(write_scene, scene);
    swb_scene *again = NULL;
    if (saved && DO(swb_scene_from_json, graph, saved, NULL, 0, NULL, 0, &again))
        pool_add(T_swb_scene, again);
    free(saved);
    controlled_block(scene, s, start);
    if (!DO(swb_scene_system, scene, &system))
        return;
    pool_add(T_swb_system, system);
    if (!DO(swb_integrator_create, system, s, &it))
        return;
    pool_add(T_swb_integrator, it);
    DO(swb_integrator_reinit, it, 0.0, start, 4);
    DO(swb_integrator_advance, it, 0.5, &outcome);
    if (!DO(swb_integrator_get_run, it, &run))
        return;
    pool_add(T_swb_run, run);
    if (swb_run_get_info(run, &info, sizeof info) == SWB_OK && info.n_impacts <= 64)
        DO(swb_run_impacts, run, impacts, info.n_impacts, sizeof impacts[0]);
    DO(swb_run_impact_sensitivity, run, 0, dt, 4);
    DO(swb_run_contact_modes, run, &t, 1, modes, 1);
    DO(swb_run_contact_forces, run, &t, 1, forces, 3);
    steps(system, start);
    frozen(scene, graph, start);
    joints(scene, graph, x, c, s, start);
}

/* The play operator: an output that follows the time with slack. */
static void play(const swb_settings *s)
{
    static const double numbers[2] = {0.0, 0.5}, start = 0.0;
    int64_t y, t, c[2], gap;
    int32_t outcome;
    swb_expr *graph = NULL;
    swb_scene *scene = NULL;
    swb_system *system = NULL;
    swb_integrator *it = NULL;
    MUST(swb_expr_create(&graph));
    pool_add(T_swb_expr, graph);
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 0, &y, 1));
    MUST(swb_expr_inputs(graph, SWB_INPUT_T, 0, &t, 1));
    MUST(swb_expr_constants(graph, numbers, 2, c, 2));
    MUST(swb_expr_apply(graph, SWB_OPERATOR_SUB, &y, &t, NULL, &gap, 1));
    MUST(swb_expr_apply(graph, SWB_OPERATOR_ADD, &gap, &c[1], NULL, &gap, 1));
    if (!DO(swb_scene_create_projected, "play", 1, 0, 0, "y", &scene))
        return;
    pool_add(T_swb_scene, scene);
    DO(swb_scene_set_force, scene, graph, &c[0], 1);
    DO(swb_scene_add_contact, scene, graph, "lower", gap, NULL, 0, -1, -1, NULL);
    if (!DO(swb_scene_build, scene, graph) || !DO(swb_scene_system, scene, &system))
        return;
    pool_add(T_swb_system, system);
    if (!DO(swb_integrator_create, system, s, &it))
        return;
    pool_add(T_swb_integrator, it);
    DO(swb_integrator_reinit, it, 0.0, &start, 1);
    DO(swb_integrator_advance, it, 2.0, &outcome);
}

/* Derivatives of a function, dense in the states. */
static void give_derivatives(swb_function *f, int64_t nx, int64_t nu, int64_t np, int64_t n_out)
{
    int64_t columns = nx + nu + np + 1, col_ptr[16], rows[64], n = 0;
    struct user *user = draw_user_of(f);
    if (!f || columns > 15 || nx * n_out > 64)
        return;
    for (int64_t c = 0; c <= columns; c++) {
        col_ptr[c] = n;
        for (int64_t i = 0; c < nx && i < n_out; i++)
            rows[n++] = i;
    }
    if (DO(swb_function_set_jacobian, f, col_ptr, columns + 1, rows, n, user_jacobian))
        user->jacobian_nnz = n;
    for (int64_t c = 0; c <= columns; c++)
        col_ptr[c] = c < nx ? c : nx;
    for (int64_t i = 0; i < nx; i++)
        rows[i] = i;
    if (DO(swb_function_set_hessian, f, col_ptr, columns + 1, rows, nx, user_hessian))
        user->hessian_nnz = nx;
}

static swb_function *function_of(struct random *r, int64_t nx, int64_t nu, int64_t np, int64_t n_out)
{
    swb_function *f = NULL;
    struct user *user = user_new(random_bits(r), nx, nu, np, n_out);
    if (random_once_in(r, 4))
        user_misbehave(user, r);
    if (!DO(swb_function_create, "random", nx, nu, np, n_out, user_value, user, user_destroy, &f))
        return NULL;
    user->wants_destroy = 1;
    draw_set_user(f, user);
    pool_add(T_swb_function, f);
    if (random_once_in(r, 3))
        give_derivatives(f, nx, nu, np, n_out);
    if (random_once_in(r, 8))
        DO(swb_function_set_linear, f);
    if (random_once_in(r, 8))
        DO(swb_function_set_flags, f, SWB_SERIAL);
    return f;
}

static void solve_ocp(struct random *r, const struct friction *f, swb_settings s)
{
    int32_t outcome;
    s.adapt_tol = random_once_in(r, 2) ? 1e-4 : 0.0;
    s.adapt_rounds = 2;
    swb_ocp *ocp = friction_ocp(f, &s, 2 + random_below(r, 2));
    if (!keep(T_swb_ocp, ocp) || !DO(swb_ocp_solve, ocp, &outcome))
        return;
    if (random_once_in(r, 2))
        DO(swb_ocp_solve_warm, ocp, &outcome);
    double derivatives[FRICTION_NX + FRICTION_NP], cost, times[8], costates[16];
    int64_t rounds, round_of, n_times, width;
    if (DO(swb_ocp_multiplier_sizes, ocp, SWB_MULTIPLIERS_OF_COSTATES, 0, &n_times, &width) && n_times <= 8 && width <= 2)
        DO(swb_ocp_get_multipliers, ocp, SWB_MULTIPLIERS_OF_COSTATES, 0, times, n_times, costates, n_times * width);
    DO(swb_ocp_get_sensitivity, ocp, derivatives, FRICTION_NX + FRICTION_NP, NULL, 0, NULL);
    DO(swb_ocp_get_adaptation, ocp, &rounds, NULL, NULL);
    DO(swb_ocp_get_round, ocp, 0, NULL, 0, &round_of, NULL, NULL, &cost);
    double u[8];
    int64_t best;
    s.adapt_tol = 0.0;
    swb_ocp *other = friction_ocp(f, &s, 2);
    if (!keep(T_swb_ocp, other))
        return;
    if (DO(swb_ocp_random_starts, other, 5, u, 4) && DO(swb_ocp_solve_starts, other, u, 4, 1 + random_below(r, 3), &best))
        DO(swb_ocp_get_start, other, best, NULL, NULL, &cost, NULL, 0);
    keep_document(write_ocp, ocp);
    swb_ocp *phases[2] = {other, other};
    swb_multiphase *multiphase = NULL;
    s.max_iter = 100;
    if (!DO(swb_multiphase_create, phases, 2, &s, &multiphase))
        return;
    pool_add(T_swb_multiphase, multiphase);
    DO(swb_multiphase_link_continuous, multiphase, 0);
    static const double low[] = {-9.0}, high[] = {9.0};
    DO(swb_multiphase_link, multiphase, 0, function_of(r, 2 * FRICTION_NX, 0, 0, 1), low, 1, high, 1);
    DO(swb_multiphase_solve, multiphase, &outcome);
    DO(swb_multiphase_link_reset, multiphase, 0, function_of(r, FRICTION_NX, 0, 0, FRICTION_NX));
}

/* Every kind of cost and constraint. */
static void terms_of_ocp(struct random *r, const struct friction *f, const swb_settings *s)
{
    static const double zero[] = {0.0, 0.0}, one[] = {1.0, 1.0}, wide[] = {50.0, 50.0};
    static const int64_t first_state = 0;
    swb_ocp *ocp = friction_ocp(f, s, 2);
    swb_function *ends = function_of(r, 2 * FRICTION_NX, FRICTION_NU, FRICTION_NP, 1);
    if (!keep(T_swb_ocp, ocp))
        return;
    DO(swb_ocp_add_boundary, ocp, ends, zero, 1, wide, 1);
    DO(swb_ocp_add_periodic, ocp, &first_state, 1);
    if (DO(swb_ocp_add_least_squares, ocp, f->speed, one, 1, zero, 1, SWB_COST_AT_RUNNING))
        DO(swb_ocp_set_references, ocp, 0, one, 1);
    DO(swb_ocp_add_relaxed, ocp, f->speed, zero, 1, one, 1, SWB_PATH_AT_ELEMENTS, SWB_NORM_L1, 2.0);
    DO(swb_ocp_add_terminal, ocp, f->speed, zero, 1, wide, 1);
    DO(swb_ocp_add_path, ocp, f->cost, zero, 1, wide, 1, SWB_PATH_AT_CONTROL_GRID);
    DO(swb_ocp_add_complementarity, ocp, f->cost, f->goal, SWB_PATH_AT_CONTROL_GRID);
    if (random_once_in(r, 3)) {
        int32_t outcome;
        DO(swb_ocp_solve, ocp, &outcome);
    }
}

/* A controller of whatever problem there is. */
static void controller(struct random *r, swb_ocp *ocp, const double *numbers)
{
    double x[64], u[16];
    int64_t n, nx, nu, done;
    swb_nmpc_options options;
    swb_nmpc_info info;
    swb_nmpc_monitor monitor;
    swb_nmpc *c = NULL;
    if (!DO(swb_nmpc_options_init, &options, sizeof options))
        return;
    options.scheme = random_below(r, 4);
    options.level = random_below(r, 6);
    options.inner = random_below(r, 3);
    options.shift = random_below(r, 2);
    options.rk_family = random_below(r, 3);
    options.n_s = 2;
    options.steps = 1 + random_below(r, 2);
    if (!DO(swb_nmpc_create, ocp, &options, &c))
        return;
    pool_add(T_swb_nmpc, c);
    if (!DO(swb_nmpc_sizes, c, &n, &nx, &nu) || (n + 1) * nx > 64 || n * nu > 16)
        return;
    DO(swb_nmpc_set_time, c, 0.5);
    DO(swb_nmpc_set_deadline, c, 1e-3);
    DO(swb_nmpc_set_params, c, numbers, random_below(r, 3));
    DO(swb_nmpc_set_references, c, 0, numbers, nx + nu);
    DO(swb_nmpc_initialise, c, numbers, nx, 5, &done);
    for (int k = 0; k < 3; k++) {
        DO(swb_nmpc_prepare, c, k == 1 ? numbers : NULL, k == 1 ? nx : 0, &info, sizeof info);
        DO(swb_nmpc_feedback, c, numbers, nx, u, nu, &info, sizeof info);
        DO(swb_nmpc_finish, c);
    }
    DO(swb_nmpc_get_plan, c, x, (n + 1) * nx, u, n * nu);
    DO(swb_nmpc_set_iterate, c, x, (n + 1) * nx, u, n * nu);
    DO(swb_nmpc_get_monitor, c, &monitor, sizeof monitor);
    DO(swb_nmpc_interrupt, c);
    DO(swb_nmpc_reset, c);
}

/* A problem that controllers can be made of. */
static void tracking(struct random *r, const swb_settings *s)
{
    static const double numbers[8] = {0.9, 0.1, 0.2};
    swb_expr *graph = NULL;
    MUST(swb_expr_create(&graph));
    pool_add(T_swb_expr, graph);
    swb_ocp *ocp = tracking_ocp(graph, s);
    if (keep(T_swb_ocp, ocp))
        controller(r, ocp, numbers);
}

/* A controller of the kind that can be written as C files, into the folder the fuzzer runs in. */
static void written(struct random *r, const swb_settings *s)
{
    static const double state[2] = {0.9, 0.1}, lower[2] = {-1.0, -INFINITY}, upper[2] = {1.0, INFINITY};
    double u;
    swb_nmpc_options options;
    swb_nmpc_info info;
    swb_expr *graph = NULL;
    swb_nmpc *c = NULL;
    MUST(swb_expr_create(&graph));
    pool_add(T_swb_expr, graph);
    swb_ocp *ocp = tracking_ocp(graph, s);
    if (!keep(T_swb_ocp, ocp) || !DO(swb_nmpc_options_init, &options, sizeof options))
        return;
    options.qp_solver = SWB_NMPC_QP_STAGEWISE;
    options.rk_family = SWB_RK_FAMILY_EXPLICIT;
    options.n_s = 2;
    if (!DO(swb_nmpc_create, ocp, &options, &c))
        return;
    pool_add(T_swb_nmpc, c);
    DO(swb_nmpc_prepare, c, NULL, 0, &info, sizeof info);
    DO(swb_nmpc_set_state_bounds, c, lower, upper, 2);
    DO(swb_nmpc_feedback, c, state, 2, &u, 1, &info, sizeof info);
    DO(swb_nmpc_write_c, c, texts_folder(r), "controller", random_below(r, 2) ? SWB_C_REAL_FLOAT : SWB_C_REAL_DOUBLE);
}

/* An estimator of the position and speed of a mass, and of what the control lacks. */
static void estimator(struct random *r, const swb_settings *s)
{
    static const double initial[2] = {1.0, 0.5}, process[2] = {0.0, 0.1}, sigma[1] = {0.1}, start[2] = {0.9, 0.1}, u[1] = {0.2};
    double y[1] = {0.5}, x[8], w[2], covariance[4];
    int64_t of[2], n, nx, nu, ny, nw, filled;
    swb_mhe_options options;
    swb_nmpc_info info;
    swb_expr *graph = NULL;
    swb_function *measured = NULL;
    swb_mhe *c = NULL;
    MUST(swb_expr_create(&graph));
    pool_add(T_swb_expr, graph);
    swb_ocp *ocp = observed_ocp(graph, s);
    if (!keep(T_swb_ocp, ocp) || !DO(swb_mhe_options_init, &options, sizeof options))
        return;
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 0, of, 2));
    MUST(swb_expr_function(graph, "measured", 2, 1, 0, of, 1, &measured));
    pool_add(T_swb_function, measured);
    options.iterations = 1 + random_below(r, 3);
    options.rk_family = random_below(r, 3);
    options.n_s = 2;
    if (!DO(swb_mhe_create, ocp, measured, initial, 2, process, 2, sigma, 1, &options, &c))
        return;
    pool_add(T_swb_mhe, c);
    DO(swb_mhe_sizes, c, &n, &nx, &nu, &ny, &nw);
    for (int k = 0; k < 4; k++) {
        y[0] = k == 2 ? NAN : 0.5;
        DO(swb_mhe_estimate, c, y, 1, x, 2, &info, sizeof info);
        DO(swb_mhe_prepare, c, u, 1, &info, sizeof info);
    }
    DO(swb_mhe_set_params, c, NULL, 0);
    DO(swb_mhe_get_window, c, x, 6, w, 2, &filled);
    DO(swb_mhe_get_covariance, c, covariance, 4);
    DO(swb_mhe_interrupt, c);
    DO(swb_mhe_write_c, c, texts_folder(r), "estimator", random_below(r, 2) ? SWB_C_REAL_FLOAT : SWB_C_REAL_DOUBLE);
    DO(swb_mhe_reset, c, start, 2);
}

/* An optimum whose switch lies between two control stages. */
static void kinked(const swb_settings *s)
{
    int32_t outcome;
    swb_optimality optimality;
    swb_kink kink;
    swb_expr *graph = NULL;
    MUST(swb_expr_create(&graph));
    pool_add(T_swb_expr, graph);
    swb_ocp *ocp = kinked_ocp(graph, s);
    if (!keep(T_swb_ocp, ocp) || !DO(swb_ocp_solve, ocp, &outcome))
        return;
    if (DO(swb_ocp_get_optimality, ocp, &optimality, sizeof optimality))
        DO(swb_ocp_get_kink, ocp, 0, &kink, sizeof kink);
}

/* Systems with functions that may fail, of any form. */
static void random_system(struct random *r, const swb_settings *s)
{
    int64_t nx = 1 + random_below(r, 3), nu = random_below(r, 3), np = random_below(r, 2), row = random_below(r, nx), index;
    const int8_t signs[] = {-1, 1};
    swb_system *system = NULL;
    if (!DO(swb_system_create, nx, nu, np, &system))
        return;
    pool_add(T_swb_system, system);
    DO(swb_system_set_f0, system, function_of(r, nx, nu, np, nx));
    swb_function *modes = function_of(r, nx, nu, np, 2);
    switch (random_below(r, 4)) {
    case 0:
        DO(swb_system_add_subsystem, system, &row, 1, modes, 2, function_of(r, nx, nu, np, 1), signs, 2, &index);
        break;
    case 1:
        DO(swb_system_add_subsystem_indicators, system, &row, 1, modes, 2, function_of(r, nx, nu, np, 2), &index);
        break;
    case 2:
        DO(swb_system_add_inclusion, system, &row, 1, function_of(r, nx + 1, nu, np, 1), function_of(r, nx, nu, np, 1), &index);
        break;
    default:
        if (nx > 1 && DO(swb_system_set_algebraic, system, 1, random_below(r, 2) ? function_of(r, nx, nu, np, 1) : NULL) && random_below(r, 2)) {
            /* modes that may switch inside of the equation */
            DO(swb_system_add_subsystem, system, &row, 1, modes, 2, function_of(r, nx, nu, np, 1), signs, 2, &index);
            row = nx - 1;
            DO(swb_system_add_complementarity, system, &row, 1, random_below(r, 2) ? function_of(r, nx, nu, np, 1) : NULL,
               function_of(r, nx, nu, np, 1), &index);
        }
    }
    static const double levels[2] = {0.0, 1.0};
    if (nu > 0 && random_below(r, 3) == 0)
        DO(swb_system_add_choice, system, 0, levels, 2, 0.5 * random_below(r, 2), NULL);
    swb_ocp *ocp = NULL;
    if (DO(swb_ocp_create, system, 1.0, 2, s, &ocp)) {
        static const double numbers[8] = {0.1, -0.2, 0.3, 0.4, 0.5, -0.6, 0.7, 0.8};
        pool_add(T_swb_ocp, ocp);
        DO(swb_ocp_add_least_squares, ocp, function_of(r, nx, nu, np, nx + nu), numbers, nx + nu, numbers, nx + nu, SWB_COST_AT_RUNNING);
        controller(r, ocp, numbers);
    }
    swb_integrator *it = NULL;
    if (DO(swb_integrator_create, system, s, &it))
        pool_add(T_swb_integrator, it);
}

static void solve_program(struct random *r, const swb_settings *s)
{
    int32_t outcome;
    struct corner c;
    if (!corner_create(&c, s))
        return;
    pool_add(T_swb_function, c.objective);
    pool_add(T_swb_function, c.rows);
    pool_add(T_swb_mpcc, c.mpcc);
    if (DO(swb_mpcc_solve, c.mpcc, &outcome) && random_once_in(r, 2))
        DO(swb_mpcc_resolve, c.mpcc, &outcome);
    if (random_once_in(r, 2)) {
        double weights[3] = {1, -1, 0.5}, p;
        int32_t sides;
        DO(swb_mpcc_vjp, c.mpcc, weights, 3, 1.0, &p, 1, &sides, 1);
    }
}

/* A program of functions that may fail. */
static void random_program(struct random *r, const swb_settings *s)
{
    int64_t n = 2 + random_below(r, 3), m = random_below(r, 3);
    swb_function *objective = function_of(r, n, 0, 0, 1), *rows = m ? function_of(r, n, 0, 0, m) : NULL;
    swb_mpcc *mpcc = NULL;
    if (!DO(swb_mpcc_create, n, 0, objective, rows, s, &mpcc))
        return;
    pool_add(T_swb_mpcc, mpcc);
    if (m && random_once_in(r, 2))
        DO(swb_mpcc_add_box, mpcc, 0, 0);
    else
        DO(swb_mpcc_add_pair, mpcc, SWB_MEMBER_VARIABLE, 0, SWB_MEMBER_VARIABLE, 1);
}

static void functions_of_casadi(struct random *r)
{
    const char *library = getenv("FUZZ_LIBRARY"), *casadi = getenv("FUZZ_CASADI"), *file = getenv("FUZZ_CASADI_FILE");
    swb_casadi value, jacobian;
    swb_function *f = NULL;
    casadi_lies(LIE_NONE, 0);
    casadi_value(&value);
    casadi_jacobian(&jacobian);
    if (DO(swb_function_from_casadi_pointers, "f", &value, &jacobian, NULL, NULL, 2, 1, 0, &f))
        pool_add(T_swb_function, f);
    if (library && DO(swb_function_from_casadi_library, library, "f", NULL, 2, 1, 0, &f))
        pool_add(T_swb_function, f);
    if (casadi && *casadi && random_once_in(r, 4) && DO(swb_function_from_casadi_file, casadi, file, "f", NULL, 2, 1, 0, &f))
        pool_add(T_swb_function, f);
}

/* Objects made of expressions, written as documents and read again. */
static void there_and_back(swb_expr *graph, swb_model *model, swb_system *system)
{
    swb_ocp *ocp = NULL, *ocp_again = NULL;
    swb_simulator *sim = NULL, *sim_again = NULL;
    swb_model *model_again = NULL;
    if (DO(swb_ocp_create, system, 1.0, 2, NULL, &ocp))
        pool_add(T_swb_ocp, ocp);
    if (DO(swb_simulator_create, system, NULL, &sim))
        pool_add(T_swb_simulator, sim);
    char *of_ocp = ocp ? document_of(write_ocp, ocp) : NULL, *of_model = document_of(write_model, model),
         *of_sim = sim ? document_of(write_simulator, sim) : NULL;
    if (of_ocp && DO(swb_ocp_from_json, of_ocp, NULL, 0, &ocp_again))
        pool_add(T_swb_ocp, ocp_again);
    if (of_sim && DO(swb_simulator_from_json, of_sim, NULL, 0, NULL, NULL, &sim_again))
        pool_add(T_swb_simulator, sim_again);
    if (of_model && DO(swb_model_from_json, graph, of_model, NULL, 0, NULL, 0, &model_again))
        pool_add(T_swb_model, model_again);
    free(of_ocp);
    free(of_model);
    free(of_sim);
}

static void expressions(struct random *r)
{
    swb_expr *graph = NULL;
    if (!DO(swb_expr_create, &graph))
        return;
    pool_add(T_swb_expr, graph);
    swb_model *model = friction_model(graph);
    pool_add(T_swb_model, model);
    pool_add(T_swb_function, friction_cost(graph));
    keep_document(write_model, model);
    int64_t product, x[FRICTION_NX];
    if (DO(swb_expr_inputs, graph, SWB_INPUT_X, 0, x, FRICTION_NX)) {
        DO(swb_expr_matmul, graph, 1, FRICTION_NX, 1, x, FRICTION_NX, x, FRICTION_NX, &product, 1);
        DO(swb_expr_solve, graph, x, 1, x + 1, &product, 1);
        DO(swb_expr_lagrangian_forces, graph, x, 1, x[0], x, x + 1, &product, 1);
        int64_t w[2], least, found[2];
        if (DO(swb_expr_unknowns, graph, w, 2)) {
            DO(swb_expr_implicit, graph, w, w, x, found, 1);
            DO(swb_expr_inner_minimum, graph, w[0], w, x, &least, found, 1);
            DO(swb_expr_signed_distance, graph, x, w[1], w, x, 1.0, &least, found, 2);
        }
    }
    swb_system *system = NULL;
    if (DO(swb_model_system, model, &system))
        pool_add(T_swb_system, system);
    if (system && random_once_in(r, 4))
        there_and_back(graph, model, system);
}

void world_create(struct random *r)
{
    swb_settings s = small_settings(r);
    struct friction f;
    expressions(r);
    random_system(r, &s);
    random_program(r, &s);
    functions_of_casadi(r);
    friction_create(&f);
    pool_add(T_swb_system, f.system);
    swb_function *const all[] = {f.modes, f.speed, f.f0, f.cost, f.goal};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        pool_add(T_swb_function, all[i]);
    if (random_once_in(r, 3))
        solve_ocp(r, &f, s);
    if (random_once_in(r, 2))
        terms_of_ocp(r, &f, &s);
    if (random_once_in(r, 2))
        simulate(r, &f, &s);
    if (random_once_in(r, 2))
        count(&s);
    if (random_once_in(r, 2))
        heater(&s);
    if (random_once_in(r, 2))
        tracking(r, &s);
    if (random_once_in(r, 3))
        kinked(&s);
    if (random_once_in(r, 2))
        block(&s);
    if (random_once_in(r, 3))
        bearing(&s);
    if (random_once_in(r, 3))
        play(&s);
    if (random_once_in(r, 2))
        solve_program(r, &s);
    if (random_once_in(r, 2))
        written(r, &s);
    if (random_once_in(r, 2))
        estimator(r, &s);
}
