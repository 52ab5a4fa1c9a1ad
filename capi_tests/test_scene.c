/* Scenes with contacts: a ball that bounces and rests, a sliding block, refusals. */
#include "check.h"
#include "switchback.h"

#include <math.h>
#include <string.h>

static const double g = 9.81;

/* A scene as a document and back: the gap is its only expression that is asked for, and what is no scene is refused. */
static void read_back(swb_scene *scene, swb_expr *graph)
{
    char text[4096], again[4096];
    int64_t needed = 0, gap = -1;
    swb_expr *other = NULL;
    swb_scene *read = NULL;
    swb_system *system = NULL;

    CHECK_STATUS(SWB_ERR_DIMENSION, swb_scene_to_json(scene, graph, text, 3, NULL));
    CHECK_OK(swb_scene_to_json(scene, graph, NULL, 0, &needed));
    CHECK(needed > 1 && needed <= (int64_t)sizeof text);
    CHECK_OK(swb_scene_to_json(scene, graph, text, sizeof text, NULL));
    CHECK_OK(swb_expr_create(&other));
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_to_json(scene, other, again, sizeof again, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_from_json(other, "{}", NULL, 0, NULL, 0, &read));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_scene_from_json(other, text, NULL, 0, &gap, 2, &read));
    CHECK(read == NULL);
    CHECK_OK(swb_scene_from_json(other, text, NULL, 0, &gap, 1, &read));
    CHECK(gap >= 0);
    CHECK_OK(swb_scene_to_json(read, other, again, sizeof again, NULL));
    CHECK(strcmp(text, again) == 0);
    CHECK_OK(swb_scene_build(read, other));
    CHECK_OK(swb_scene_system(read, &system));
    swb_system_free(system);
    swb_scene_free(read);
    swb_expr_free(other);
}

/* A ball of height q above a floor, with restitution e. */
static swb_system *ball(double e)
{
    const double numbers[2] = {-g, e};
    int64_t q, id[2], index = -1;
    swb_expr *graph = NULL;
    swb_scene *scene = NULL;
    swb_system *system = NULL;
    CHECK_OK(swb_expr_create(&graph));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_X, 0, &q, 1));
    CHECK_OK(swb_expr_constants(graph, numbers, 2, id, 2));
    CHECK_OK(swb_scene_create("ball", 1, 1, 0, 0, "y\nv", &scene));
    CHECK_OK(swb_scene_set_force(scene, graph, &id[0], 1));
    CHECK_OK(swb_scene_add_contact(scene, graph, "floor", q, NULL, 0, -1, id[1], &index));
    CHECK(index == 0);
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_system(scene, &system));
    CHECK(system == NULL);
    CHECK_OK(swb_scene_build(scene, graph));
    CHECK_OK(swb_scene_system(scene, &system));
    read_back(scene, graph);
    swb_scene_free(scene);
    swb_expr_free(graph);
    return system;
}

/* Bounces of a ball that falls from height 1: closed form. */
static void bounces(void)
{
    static const double x0[2] = {1.0, 0.0};
    const double e = 0.5, first = sqrt(2.0 / g);
    swb_system *system = ball(e);
    swb_integrator *integrator = NULL;
    swb_run *run = NULL;
    swb_run_info info;
    swb_impact impacts[64];
    int64_t modes[2];
    double x[2], dt[2], t, forces[6], times[2] = {0.1, 2.0}, speed = sqrt(2.0 * g);
    int32_t outcome = -1;

    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_set_double(integrator, "rtol", 1e-12));
    CHECK_OK(swb_integrator_set_double(integrator, "atol", 1e-12));
    CHECK_OK(swb_integrator_set_string(integrator, "sensitivity", "on"));
    CHECK_OK(swb_integrator_set_string(integrator, "dense", "on"));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, x0, 2));
    CHECK_OK(swb_integrator_advance(integrator, 2.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_state(integrator, x, 2));
    CHECK(fabs(x[0]) < 1e-12 && fabs(x[1]) < 1e-12); /* at rest since t = 3 first */
    CHECK_OK(swb_integrator_get_run(integrator, &run));
    CHECK_OK(swb_run_get_info(run, &info, sizeof info));
    CHECK(info.n_scene_contacts == 1 && info.n_accumulations == 1 && info.n_impacts > 8 && info.n_impacts <= 64);
    if (info.n_impacts <= 64)
        CHECK_OK(swb_run_impacts(run, impacts, info.n_impacts, sizeof impacts[0]));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_impacts(run, impacts, info.n_impacts + 1, sizeof impacts[0]));
    t = first;
    for (int i = 0; i < 8; i++) {
        CHECK_NEAR(impacts[i].t, t, 1e-12);
        CHECK_NEAR(impacts[i].rate_before, -speed, 1e-11);
        CHECK_NEAR(impacts[i].rate_after, e * speed, 1e-11);
        CHECK_NEAR(impacts[i].normal, (1.0 + e) * speed, 1e-11);
        CHECK(impacts[i].contact == 0 && impacts[i].kind == SWB_IMPACT_KIND_COLLISION && impacts[i].unique);
        CHECK_NEAR(impacts[i].depth, speed * speed / (2.0 * g), 1e-11);
        speed *= e;
        t += 2.0 * speed / g;
    }
    CHECK(impacts[info.n_impacts - 1].kind == SWB_IMPACT_KIND_LAST);
    CHECK_OK(swb_run_impact_sensitivity(run, 0, dt, 2));
    CHECK_NEAR(dt[0], 0.5 * first, 1e-12);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_impact_sensitivity(run, info.n_impacts, dt, 2));
    CHECK_OK(swb_run_contact_modes(run, times, 2, modes, 2));
    CHECK(modes[0] == SWB_CONTACT_MODE_OPEN && modes[1] == SWB_CONTACT_MODE_CLOSED);
    CHECK_OK(swb_run_contact_forces(run, times, 2, forces, 6));
    CHECK(forces[0] == 0.0);
    CHECK_NEAR(forces[3], g, 1e-12);
    times[0] = -1.0;
    CHECK_STATUS(SWB_ERR_RANGE, swb_run_contact_forces(run, times, 2, forces, 6));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_run_contact_forces(run, &times[1], 1, forces, 4));
    swb_run_free(run);
    /* below the floor */
    x[0] = -0.1;
    x[1] = 0.0;
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, x, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_integrator_advance(integrator, 1.0, &outcome));
    CHECK(strstr(swb_last_error(), "floor") != NULL && strstr(swb_last_error(), "-0.1") != NULL);
    swb_integrator_free(integrator);
    swb_system_free(system);
}

/* A block slides to a stop: x(t) with friction mu, then sticks. */
static void slides(void)
{
    const double numbers[4] = {0.0, -g, 0.3, 2.0}, x0[4] = {0.0, 0.0, 1.5, 0.0};
    int64_t x[4], c[4], entries[4], force[2];
    double end[4];
    int32_t outcome = -1;
    char text[2000];
    swb_expr *graph = NULL, *other = NULL;
    swb_scene *scene = NULL;
    swb_system *system = NULL;
    swb_integrator *integrator = NULL;

    CHECK_OK(swb_expr_create(&graph));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 4));
    CHECK_OK(swb_expr_constants(graph, numbers, 4, c, 4));
    CHECK_OK(swb_scene_create("block", 2, 2, 0, 0, NULL, &scene));
    entries[0] = entries[3] = c[3];
    entries[1] = entries[2] = c[0];
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_scene_set_inertia(scene, graph, entries, 3));
    CHECK_OK(swb_scene_set_inertia(scene, graph, entries, 4));
    CHECK_OK(swb_expr_create(&other));
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_build(scene, other)); /* the expressions are of another graph */
    swb_expr_free(other);
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_build(scene, graph)); /* no forces */
    force[0] = c[0];
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_MUL, &c[1], &c[3], NULL, &force[1], 1));
    CHECK_OK(swb_scene_set_force(scene, graph, force, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_add_contact(scene, graph, "floor", 9999, &x[0], 1, c[2], -1, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_add_contact(scene, graph, "floor", x[1], x, 3, c[2], -1, NULL));
    CHECK_OK(swb_scene_add_contact(scene, graph, "floor", x[1], &x[0], 1, c[2], -1, NULL));
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_add_contact(scene, graph, "again", x[1], &x[0], 1, c[2], -1, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_set_impact_law(scene, 7));
    CHECK_OK(swb_scene_set_impact_law(scene, SWB_IMPACT_LAW_NEWTON));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_set_bounds(scene, 5, 0.0, 1.0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_set_bounds(scene, 0, 1.0, 0.0));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_set_bounds(scene, 0, NAN, 0.0));
    CHECK(strstr(swb_last_error(), "-inf or inf") != NULL);
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_set_bounds(scene, 0, INFINITY, INFINITY));
    CHECK_OK(swb_scene_set_bounds(scene, 0, -100.0, INFINITY));
    CHECK_OK(swb_scene_set_bounds(scene, 1, -INFINITY, INFINITY)); /* nothing is known */
    CHECK_OK(swb_scene_build(scene, graph));
    CHECK_OK(swb_scene_report(scene, 0, text, sizeof text, NULL));
    CHECK(strstr(text, "contact floor: friction in the plane") != NULL);
    CHECK_OK(swb_scene_report(scene, 1, text, sizeof text, NULL));
    CHECK(text[0] == '{');
    CHECK_OK(swb_scene_system(scene, &system));
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, x0, 4));
    CHECK_OK(swb_integrator_advance(integrator, 2.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_state(integrator, end, 4));
    CHECK_NEAR(end[0], 1.5 * 1.5 / (2.0 * 0.3 * g), 1e-10);
    CHECK(end[1] == 0.0 && end[2] == 0.0 && end[3] == 0.0);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_scene_free(scene);
    swb_expr_free(graph);
    swb_scene_free(NULL);
}

/* A ball falls on a floor and stays there, in steps. */
static void steps(void)
{
    const double numbers[2] = {0.0, -g}, x0[2] = {1.0, 0.0}, deep[2] = {-1.0, 0.0};
    int64_t x[2], c[2], n = 0, nx = 0, n_contacts = 0;
    double t, end[2], impulse[3], times[11], states[22], impulses[33];
    swb_expr *graph = NULL;
    swb_scene *scene = NULL;
    swb_system *system = NULL;
    swb_stepper *stepper = NULL;
    swb_step_options options;
    swb_step_stats stats;

    CHECK_OK(swb_expr_create(&graph));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 2));
    CHECK_OK(swb_expr_constants(graph, numbers, 2, c, 2));
    CHECK_OK(swb_scene_create("ball", 1, 1, 0, 0, NULL, &scene));
    CHECK_OK(swb_scene_set_force(scene, graph, &c[1], 1));
    CHECK_OK(swb_scene_add_contact(scene, graph, "floor", x[0], NULL, 0, -1, -1, NULL));
    CHECK_OK(swb_scene_build(scene, graph));
    CHECK_OK(swb_scene_system(scene, &system));

    CHECK_STATUS(SWB_ERR_DIMENSION, swb_step_options_init(&options, 7));
    CHECK_OK(swb_step_options_init(&options, sizeof options));
    CHECK(options.h == 1e-3 && options.theta == 0.5 && options.law == -1);
    options.law = 9;
    CHECK_STATUS(SWB_ERR_RANGE, swb_stepper_create(system, &options, &stepper));
    options.law = SWB_IMPACT_LAW_NEWTON;
    options.h = 0.0;
    CHECK_STATUS(SWB_ERR_RANGE, swb_stepper_create(system, &options, &stepper));
    options.h = 2e-3;
    CHECK_OK(swb_stepper_create(system, &options, &stepper));
    CHECK_OK(swb_stepper_sizes(stepper, &nx, NULL, NULL, &n_contacts));
    CHECK(nx == 2 && n_contacts == 1);
    CHECK_STATUS(SWB_ERR_STATE, swb_stepper_step(stepper));
    CHECK_STATUS(SWB_ERR_RANGE, swb_stepper_set_state(stepper, 0.0, deep, 2));
    CHECK_OK(swb_stepper_set_state(stepper, 0.0, x0, 2));
    CHECK_OK(swb_stepper_step(stepper));
    CHECK_OK(swb_stepper_get_time(stepper, &t));
    CHECK_NEAR(t, 2e-3, 1e-15);
    CHECK_OK(swb_stepper_advance(stepper, 1.0));
    CHECK_OK(swb_stepper_get_state(stepper, end, 2));
    CHECK_NEAR(end[0], 0.0, 4e-5);
    CHECK(end[1] == 0.0);
    CHECK_OK(swb_stepper_get_impulses(stepper, impulse, 3));
    CHECK_NEAR(impulse[0], 2e-3 * g, 1e-6);
    CHECK_STATUS(SWB_ERR_RANGE, swb_stepper_advance(stepper, 0.5));
    CHECK_STATUS(SWB_ERR_RANGE, swb_stepper_count(stepper, 1.1, 0, &n));
    CHECK_OK(swb_stepper_count(stepper, 1.1, 5, &n));
    CHECK(n == 11);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_stepper_run(stepper, 1.1, 5, times, 10, states, 22, NULL, 0));
    CHECK_OK(swb_stepper_run(stepper, 1.1, 5, times, 11, states, 22, impulses, 33));
    CHECK(times[0] == 1.0 && times[10] == 1.1 && states[1] == 0.0);
    CHECK_NEAR(impulses[30], 2e-3 * g, 1e-6);
    CHECK_OK(swb_stepper_get_stats(stepper, &stats, sizeof stats));
    CHECK(stats.steps == 550 && stats.unconverged == 0 && stats.deepest == 0 && stats.penetration < 0.02);
    CHECK_OK(swb_stepper_interrupt(stepper));
    CHECK_STATUS(SWB_ERR_INTERRUPTED, swb_stepper_step(stepper));
    CHECK_OK(swb_stepper_step(stepper));
    swb_stepper_free(stepper);
    swb_stepper_free(NULL);
    swb_system_free(system);
    swb_scene_free(scene);
    swb_expr_free(graph);
}

/* What a new call must refuse, and with which words. */
#define REFUSED(status, call, words)                                     \
    do {                                                                 \
        CHECK_STATUS(status, call);                                      \
        CHECK(strstr(swb_last_error(), words) != NULL);                  \
    } while (0)

/* A point over a floor in the plane: the scene of the next test, with the force on x, friction and restitution. */
static swb_scene *point(swb_expr *graph, const int64_t *x, int64_t force_x, int64_t down, int64_t mu, int64_t e, int64_t n_tangents)
{
    swb_scene *scene = NULL;
    int64_t force[2];
    force[0] = force_x;
    force[1] = down;
    CHECK_OK(swb_scene_create("point", 2, 2, 1, 1, "x\ny\nu\nv\npush\nrough", &scene));
    CHECK_OK(swb_scene_set_force(scene, graph, force, 2));
    CHECK_OK(swb_scene_add_contact(scene, graph, "floor", x[1], &x[0], n_tangents, mu, e, NULL));
    return scene;
}

static void refusals(void)
{
    const double numbers[5] = {0.0, -g, 0.3, -0.1, 1.1}, nan_state[4] = {0.0, NAN, 0.0, 0.0}, start[4] = {0.0, 1.0, 0.0, 0.0};
    const double nan_ = NAN, negative = -0.5, rough = 0.5, landed[4] = {0.0, 0.0, 1.0, 0.0};
    int64_t x[4], p, u, c[5], entries[4], foreign[2], square;
    double out[8];
    int32_t outcome;
    char text[4];
    swb_expr *graph = NULL, *other = NULL;
    swb_scene *scene = NULL, *gone;
    swb_system *system = NULL, *empty = NULL;
    swb_stepper *stepper = NULL;
    swb_step_options options;
    swb_step_stats stats;
    swb_integrator *integrator = NULL;

    CHECK_OK(swb_expr_create(&graph));
    CHECK_OK(swb_expr_create(&other));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 4));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_P, 0, &p, 1));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_U, 0, &u, 1));
    CHECK_OK(swb_expr_constants(graph, numbers, 5, c, 5));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_MUL, &x[2], &x[2], NULL, &square, 1));
    CHECK_OK(swb_expr_inputs(other, SWB_INPUT_X, 0, foreign, 2));

    /* sizes */
    REFUSED(SWB_ERR_DIMENSION, swb_scene_create("empty", 0, 0, 0, 0, NULL, &scene), "at least one coordinate");
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_scene_create("negative", 1, -1, 0, 0, NULL, &scene));
    CHECK_STATUS(SWB_ERR_NULL, swb_scene_create("nowhere", 1, 1, 0, 0, NULL, NULL));
    REFUSED(SWB_ERR_DIMENSION, swb_scene_create_projected("empty", 0, 0, 0, NULL, &scene), "at least one state");
    CHECK(scene == NULL);
    scene = point(graph, x, u, c[1], p, -1, 1);
    REFUSED(SWB_ERR_DIMENSION, swb_scene_set_rates(scene, graph, x, 1), "1 rates of coordinates, expected 2");
    REFUSED(SWB_ERR_DIMENSION, swb_scene_set_force(scene, graph, c, 1), "1 forces, expected 2");
    REFUSED(SWB_ERR_STATE, swb_scene_set_force(scene, other, foreign, 2), "graph");
    REFUSED(SWB_ERR_STATE, swb_scene_add_contact(scene, other, "top", foreign[0], NULL, 0, -1, -1, NULL), "graph");
    REFUSED(SWB_ERR_STATE, swb_scene_add_contact(scene, graph, "floor", x[0], NULL, 0, -1, -1, NULL), "floor already");
    REFUSED(SWB_ERR_STATE, swb_scene_report(scene, 0, text, sizeof text, NULL), "build");
    REFUSED(SWB_ERR_STATE, swb_scene_system(scene, &system), "build");
    CHECK_OK(swb_scene_build(scene, graph));
    REFUSED(SWB_ERR_DIMENSION, swb_scene_report(scene, 0, text, sizeof text, NULL), "buffer");
    CHECK_OK(swb_scene_system(scene, &system));

    /* values */
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    REFUSED(SWB_ERR_RANGE, swb_integrator_reinit(integrator, 0.0, nan_state, 4), "NaN");
    CHECK_OK(swb_integrator_set_params(integrator, &negative, 1));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, landed, 4));
    REFUSED(SWB_ERR_RANGE, swb_integrator_advance(integrator, 1.0, &outcome), "friction -0.5");
    CHECK_OK(swb_integrator_set_params(integrator, &rough, 1));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, landed, 4));
    CHECK_OK(swb_integrator_advance(integrator, 1.0, &outcome));
    swb_integrator_free(integrator);

    /* the stepper */
    CHECK_OK(swb_system_create(1, 0, 0, &empty));
    CHECK_STATUS(SWB_ERR_STATE, swb_stepper_create(empty, NULL, &stepper));
    CHECK_STATUS(SWB_ERR_NULL, swb_stepper_create(NULL, NULL, &stepper));
    swb_system_free(empty);
    CHECK_OK(swb_step_options_init(&options, sizeof options));
    options.h = NAN;
    REFUSED(SWB_ERR_RANGE, swb_stepper_create(system, &options, &stepper), "the step h is NaN");
    options.h = 1e-3;
    options.tolerance = -1.0;
    REFUSED(SWB_ERR_RANGE, swb_stepper_create(system, &options, &stepper), "tolerance");
    CHECK(stepper == NULL);
    CHECK_OK(swb_stepper_create(system, NULL, &stepper));
    REFUSED(SWB_ERR_STATE, swb_stepper_step(stepper), "set its state first");
    REFUSED(SWB_ERR_DIMENSION, swb_stepper_set_state(stepper, 0.0, start, 3), "4");
    REFUSED(SWB_ERR_RANGE, swb_stepper_set_state(stepper, 0.0, nan_state, 4), "NaN");
    CHECK_STATUS(SWB_ERR_RANGE, swb_stepper_set_state(stepper, INFINITY, start, 4));
    REFUSED(SWB_ERR_DIMENSION, swb_stepper_set_controls(stepper, start, 2), "expected 1");
    REFUSED(SWB_ERR_RANGE, swb_stepper_set_params(stepper, &nan_, 1), "NaN");
    CHECK_OK(swb_stepper_set_params(stepper, &negative, 1));
    CHECK_OK(swb_stepper_set_state(stepper, 0.0, start, 4));
    REFUSED(SWB_ERR_RANGE, swb_stepper_advance(stepper, 1.0), "friction"); /* where the contact closes */
    CHECK_OK(swb_stepper_set_params(stepper, &rough, 1));
    CHECK_OK(swb_stepper_set_state(stepper, 0.0, start, 4));
    CHECK_STATUS(SWB_ERR_RANGE, swb_stepper_advance(stepper, NAN));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_stepper_get_state(stepper, out, 3));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_stepper_get_impulses(stepper, out, 4));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_stepper_get_stats(stepper, &stats, 3));
    CHECK_STATUS(SWB_ERR_NULL, swb_stepper_get_time(stepper, NULL));
    CHECK_OK(swb_stepper_advance(stepper, 0.1)); /* it is as it was */
    swb_stepper_free(stepper);
    swb_system_free(system);

    /* what was freed */
    gone = scene;
    swb_scene_free(scene);
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_build(gone, graph));
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_set_bounds(gone, 0, 0.0, 1.0));

    /* what the build refuses */
    scene = point(graph, x, c[0], c[1], c[3], -1, 1);
    REFUSED(SWB_ERR_RANGE, swb_scene_build(scene, graph), "friction of contact floor is -0.1");
    swb_scene_free(scene);
    scene = point(graph, x, c[0], c[1], -1, c[4], 0);
    REFUSED(SWB_ERR_RANGE, swb_scene_build(scene, graph), "restitution of contact floor is 1.1");
    swb_scene_free(scene);
    scene = point(graph, x, c[0], c[1], c[2], -1, 0);
    REFUSED(SWB_ERR_RANGE, swb_scene_build(scene, graph), "no tangents");
    swb_scene_free(scene);
    scene = point(graph, x, c[0], c[1], -1, -1, 0);
    CHECK_OK(swb_scene_add_contact(scene, graph, "wall", square, NULL, 0, -1, -1, NULL));
    REFUSED(SWB_ERR_RANGE, swb_scene_build(scene, graph), "depends on velocities");
    swb_scene_free(scene);
    scene = point(graph, x, c[0], c[1], -1, -1, 0);
    CHECK_OK(swb_scene_add_contact(scene, graph, "wall", x[0], &square, 1, c[2], -1, NULL));
    REFUSED(SWB_ERR_RANGE, swb_scene_build(scene, graph), "linear");
    swb_scene_free(scene);
    /* a body without mass */
    scene = point(graph, x, c[0], c[1], -1, -1, 0);
    entries[0] = entries[1] = entries[2] = c[0];
    entries[3] = c[2];
    CHECK_OK(swb_scene_set_inertia(scene, graph, entries, 4));
    CHECK_OK(swb_scene_build(scene, graph));
    CHECK_OK(swb_scene_system(scene, &system));
    CHECK_STATUS(SWB_ERR_NUMERIC, swb_stepper_create(system, NULL, &stepper));
    CHECK(strstr(swb_last_error(), "positive definite") != NULL);
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_set_params(integrator, &rough, 1));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, start, 4));
    REFUSED(SWB_ERR_RANGE, swb_integrator_advance(integrator, 1.0, &outcome), "not positive definite");
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_scene_free(scene);
    swb_expr_free(graph);
    swb_expr_free(other);
}

/* A mass on a spring with dry friction: half turns of pi seconds that lose twice the friction each. */
static void joints(void)
{
    static const double numbers[5] = {0.15, 0.2, -0.1, 0.1, 1.0}, start[2] = {1.0, 0.0};
    const double pi = acos(-1.0), nan = sqrt(-1.0);
    int64_t x[2], c[5], same[5], force, index = -1, bad, modes[2];
    double state[2], forces[6], times[2] = {1.0, 12.0};
    int32_t outcome;
    swb_expr *graph = NULL, *other = NULL;
    swb_scene *scene = NULL, *play = NULL;
    swb_system *system = NULL;
    swb_integrator *integrator = NULL;
    swb_run *run = NULL;
    swb_ocp *ocp = NULL;
    CHECK_OK(swb_expr_create(&graph));
    CHECK_OK(swb_expr_create(&other));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 2));
    CHECK_OK(swb_expr_constants(graph, numbers, 5, c, 5));
    CHECK_OK(swb_expr_constants(graph, &nan, 1, &bad, 1));
    CHECK_OK(swb_expr_inputs(other, SWB_INPUT_X, 0, same, 2));
    CHECK_OK(swb_expr_constants(other, numbers, 5, same, 5));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_NEG, x, NULL, NULL, &force, 1));
    CHECK_OK(swb_scene_create("slider", 1, 1, 0, 0, NULL, &scene));
    CHECK_OK(swb_scene_set_force(scene, graph, &force, 1));
    CHECK_OK(swb_scene_add_friction(scene, graph, "guide", x[0], c[0], c[1], &index));
    CHECK(index == 0);

    /* wrong calls, which change nothing */
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_add_friction(scene, graph, "guide", x[0], c[0], -1, &index));
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_add_friction(scene, other, "other", x[0], c[0], -1, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_add_friction(scene, graph, "other", x[0], 1000, -1, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_add_friction(scene, graph, "other", -5, c[0], -1, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_add_friction(scene, graph, "other", x[0], c[0], -2, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_scene_add_friction(scene, NULL, "other", x[0], c[0], -1, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_scene_add_friction(NULL, graph, "other", x[0], c[0], -1, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_scene_add_friction(scene, graph, NULL, x[0], c[0], -1, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_set_stiction(scene, graph, 0, c[1]));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_set_stiction(scene, graph, 7, c[1]));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_set_separation(scene, graph, 7, c[1]));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_set_separation(scene, graph, 0, 1000));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_set_stiction(scene, graph, 0, 1000));
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_add_constraint(scene, graph, "guide", x[0], &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_scene_add_constraint(scene, graph, "rod", 1000, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_scene_add_constraint(scene, graph, NULL, x[0], &index));
    CHECK(index == 0);
    CHECK_OK(swb_scene_create_projected("play", 1, 0, 0, NULL, &play));
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_scene_add_friction(play, graph, "guide", x[0], c[0], -1, NULL));
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_scene_add_constraint(play, graph, "rod", x[0], NULL));
    swb_scene_free(play);

    CHECK_OK(swb_scene_build(scene, graph));
    CHECK_OK(swb_scene_system(scene, &system));
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_set_double(integrator, "rtol", 1e-11));
    CHECK_OK(swb_integrator_set_double(integrator, "atol", 1e-11));
    CHECK_OK(swb_integrator_set_string(integrator, "dense", "on"));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, start, 2));
    CHECK_OK(swb_integrator_advance(integrator, 20.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_state(integrator, state, 2));
    CHECK_NEAR(state[0], -0.1, 1e-9);
    CHECK_NEAR(state[1], 0.0, 1e-9);
    CHECK_OK(swb_integrator_get_run(integrator, &run));
    CHECK_OK(swb_run_contact_modes(run, times, 2, modes, 2));
    CHECK(modes[0] == SWB_CONTACT_MODE_SLIDES_BACK && modes[1] == SWB_CONTACT_MODE_CLOSED && times[1] > 3.0 * pi);
    CHECK_OK(swb_run_contact_forces(run, times, 2, forces, 6));
    CHECK_NEAR(forces[1], 0.15, 1e-12);
    CHECK_NEAR(forces[4], -0.1, 1e-9);
    CHECK(forces[0] == 0.0 && forces[3] == 0.0);
    swb_run_free(run);
    swb_integrator_free(integrator);
    swb_system_free(system);

    /* optimal control follows it by simulations */
    CHECK_OK(swb_ocp_create_scene(scene, 1.0, 4, NULL, &ocp));
    swb_ocp_free(ocp);
    ocp = NULL;
    swb_scene_free(scene);

    /* what the build refuses */
    for (int k = 0; k < 4; k++) {
        const int64_t bound[4] = {c[2], bad, c[1], c[0]}, stiction[4] = {-1, -1, c[3], c[2]};
        CHECK_OK(swb_scene_create("slider", 1, 1, 0, 0, NULL, &scene));
        CHECK_OK(swb_scene_set_force(scene, graph, &force, 1));
        CHECK_OK(swb_scene_add_friction(scene, graph, "guide", x[0], bound[k], stiction[k], NULL));
        REFUSED(SWB_ERR_RANGE, swb_scene_build(scene, graph), k == 2 ? "must not be less" : "must not be negative");
        swb_scene_free(scene);
    }
    /* a constraint that the start does not satisfy */
    CHECK_OK(swb_scene_create("slider", 1, 1, 0, 0, NULL, &scene));
    CHECK_OK(swb_scene_set_force(scene, graph, &force, 1));
    CHECK_OK(swb_scene_add_constraint(scene, graph, "stop", x[1], NULL));
    CHECK_OK(swb_scene_build(scene, graph));
    CHECK_OK(swb_scene_system(scene, &system));
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    state[0] = 0.0;
    state[1] = 1.0;
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, state, 2));
    REFUSED(SWB_ERR_RANGE, swb_integrator_advance(integrator, 1.0, &outcome), "not satisfied at the start");
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, start, 2));
    CHECK_OK(swb_integrator_advance(integrator, 1.0, &outcome));
    CHECK_OK(swb_integrator_get_state(integrator, state, 2));
    CHECK(state[0] == 1.0 && state[1] == 0.0);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_scene_free(scene);
    swb_expr_free(graph);
    swb_expr_free(other);
}

/* Friction that fades with a state beside coordinate and velocity: z = exp(-t), v = 1 - (1 - z)/2. */
static void states(void)
{
    static const double half = 0.5, zero = 0.0, start[3] = {0.0, 1.0, 1.0};
    int64_t x[3], c[2], rate, bound;
    double state[3];
    int32_t outcome;
    swb_expr *graph = NULL;
    swb_scene *scene = NULL;
    swb_system *system = NULL;
    swb_integrator *integrator = NULL;
    CHECK_OK(swb_expr_create(&graph));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 3));
    CHECK_OK(swb_expr_constants(graph, &half, 1, &c[0], 1));
    CHECK_OK(swb_expr_constants(graph, &zero, 1, &c[1], 1));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_NEG, &x[2], NULL, NULL, &rate, 1));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_MUL, &c[0], &x[2], NULL, &bound, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_scene_create_with_states("fading", 1, 1, -1, 0, 0, NULL, &scene));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_scene_create_with_states("fading", 0, 1, 1, 0, 0, NULL, &scene));
    CHECK_STATUS(SWB_ERR_NULL, swb_scene_create_with_states(NULL, 1, 1, 1, 0, 0, NULL, &scene));
    CHECK(scene == NULL);
    CHECK_OK(swb_scene_create_with_states("fading", 1, 1, 1, 0, 0, "x\nv\nz", &scene));
    CHECK_OK(swb_scene_set_force(scene, graph, &c[1], 1));
    REFUSED(SWB_ERR_STATE, swb_scene_build(scene, graph), "no rate of z");
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_scene_set_state_rates(scene, graph, x, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_scene_set_state_rates(scene, graph, NULL, 0));
    CHECK_OK(swb_scene_set_state_rates(scene, graph, &rate, 1));
    CHECK_OK(swb_scene_add_friction(scene, graph, "guide", x[0], bound, -1, NULL));
    CHECK_OK(swb_scene_build(scene, graph));
    CHECK_OK(swb_scene_system(scene, &system));
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_set_double(integrator, "rtol", 1e-11));
    CHECK_OK(swb_integrator_set_double(integrator, "atol", 1e-11));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, start, 3));
    CHECK_OK(swb_integrator_advance(integrator, 1.0, &outcome));
    CHECK_OK(swb_integrator_get_state(integrator, state, 3));
    CHECK_NEAR(state[1], 1.0 - 0.5 * (1.0 - exp(-1.0)), 1e-9);
    CHECK_NEAR(state[2], exp(-1.0), 1e-9);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_scene_free(scene);
    swb_expr_free(graph);
}

/* A relay holds the current of a motor, z' = -z + 2 sign(1 - z), which drives a joint of friction 0.3 towards a far stop. */
static void switches(void)
{
    const double start[3] = {0.0, 0.0, 0.0}, numbers[4] = {1.0, 2.0, 0.3, 5.0}, at[2] = {0.5, 1.5};
    const double t1 = -log(0.85), t2 = log(2.0);
    int64_t x[3], c[4], psi, on, rate, gap, modes[6];
    double state[3], forces[18];
    int32_t outcome;
    char text[1200];
    swb_expr *graph = NULL;
    swb_scene *scene = NULL;
    swb_system *system = NULL;
    swb_integrator *integrator = NULL;
    swb_run *run = NULL;
    swb_stepper *stepper = NULL;
    CHECK_OK(swb_expr_create(&graph));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 3));
    CHECK_OK(swb_expr_constants(graph, numbers, 4, c, 4));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_SUB, &c[0], &x[2], NULL, &psi, 1));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_SIGN, &psi, NULL, NULL, &on, 1));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_MUL, &c[1], &on, NULL, &on, 1));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_SUB, &on, &x[2], NULL, &rate, 1));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_SUB, &c[3], &x[0], NULL, &gap, 1));
    CHECK_OK(swb_scene_create_with_states("motor", 1, 1, 1, 0, 0, "x\nv\nz", &scene));
    CHECK_OK(swb_scene_set_force(scene, graph, &x[2], 1));
    CHECK_OK(swb_scene_set_state_rates(scene, graph, &rate, 1));
    CHECK_OK(swb_scene_add_friction(scene, graph, "gear", x[0], c[2], -1, NULL));
    CHECK_OK(swb_scene_add_contact(scene, graph, "stop", gap, NULL, 0, -1, -1, NULL));
    CHECK_OK(swb_scene_build(scene, graph));
    CHECK_OK(swb_scene_report(scene, 1, text, sizeof text, NULL));
    CHECK(strstr(text, "\"kind\":\"switch\"") && strstr(text, "switch at 1 - z = 0"));
    CHECK_OK(swb_scene_system(scene, &system));
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_set_double(integrator, "rtol", 1e-11));
    CHECK_OK(swb_integrator_set_double(integrator, "atol", 1e-11));
    CHECK_OK(swb_integrator_set_string(integrator, "dense", "on"));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, start, 3));
    CHECK_OK(swb_integrator_advance(integrator, 2.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_state(integrator, state, 3));
    CHECK_NEAR(state[1], 1.7 * (t2 - t1) + 2.0 * (exp(-t2) - exp(-t1)) + 0.7 * (2.0 - t2), 1e-9);
    CHECK_NEAR(state[2], 1.0, 1e-10);
    CHECK_OK(swb_integrator_get_run(integrator, &run));
    CHECK_OK(swb_run_contact_modes(run, at, 2, modes, 6));
    CHECK(modes[2] == SWB_CONTACT_MODE_SLIDES && modes[5] == SWB_CONTACT_MODE_CLOSED && modes[0] == SWB_CONTACT_MODE_SLIDES);
    CHECK_OK(swb_run_contact_forces(run, at, 2, forces, 18));
    CHECK_NEAR(forces[7], 1.0, 1e-12);
    CHECK_NEAR(forces[16], 0.5, 1e-9);
    /* what does not follow switches says so, and a condition is no force */
    REFUSED(SWB_ERR_UNSUPPORTED, swb_stepper_create(system, NULL, &stepper), "switch at 1 - z = 0");
    CHECK(stepper == NULL);
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_POSITIVE, &psi, NULL, NULL, &on, 1));
    CHECK_OK(swb_scene_set_force(scene, graph, &on, 1));
    REFUSED(SWB_ERR_RANGE, swb_scene_build(scene, graph), "is a condition");
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_SIGN, &gap, NULL, NULL, &gap, 1));
    CHECK_OK(swb_scene_set_force(scene, graph, &x[2], 1));
    CHECK_OK(swb_scene_add_contact(scene, graph, "jump", gap, NULL, 0, -1, -1, NULL));
    REFUSED(SWB_ERR_UNSUPPORTED, swb_scene_build(scene, graph), "only forces and the rates");
    swb_run_free(run);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_scene_free(scene);
    swb_expr_free(graph);
}

/* A ball that a gripper lifts with the velocity 1 and lets go at the height 1.2; it bounces once. */
static void jumps(void)
{
    const double start[3] = {0.5, 1.0, 1.0}, numbers[4] = {-10.0, 1.0, 0.8, 1.2}, one = 1.0, zero = 0.0;
    const double hit = 0.7 + (1.0 + sqrt(25.0)) / 10.0, left = 2.0 - hit;
    int64_t x[3], c[4], force, guard, state = -1, index = -1, held = 2, none = 7;
    double end[3];
    int32_t outcome;
    swb_expr *graph = NULL;
    swb_scene *scene = NULL, *projected = NULL;
    swb_system *system = NULL;
    swb_integrator *integrator = NULL;
    swb_ocp *ocp = NULL;
    CHECK_OK(swb_expr_create(&graph));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 3));
    CHECK_OK(swb_expr_constants(graph, numbers, 4, c, 4));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_SUB, &c[1], &x[2], NULL, &force, 1));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_MUL, &c[0], &force, NULL, &force, 1));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_SUB, &x[0], &c[3], NULL, &guard, 1));
    CHECK_OK(swb_scene_create("gripper", 1, 1, 0, 0, "y\nv", &scene));
    REFUSED(SWB_ERR_RANGE, swb_scene_add_discrete(scene, "held", NAN, &state), "initial value");
    CHECK_STATUS(SWB_ERR_NULL, swb_scene_add_discrete(NULL, "held", 1.0, &state));
    CHECK(state == -1);
    CHECK_OK(swb_scene_add_discrete(scene, "held", 1.0, &state));
    CHECK(state == 2);
    CHECK_OK(swb_scene_set_force(scene, graph, &force, 1));
    CHECK_OK(swb_scene_set_state_rates(scene, graph, NULL, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_scene_set_state_rates(scene, graph, &x[1], 1));
    CHECK_OK(swb_scene_add_contact(scene, graph, "floor", x[0], NULL, 0, -1, c[2], NULL));
#define EVENT(g, effect, from, n_to, to)                                                                                          \
    swb_scene_add_event(scene, graph, "go", effect, SWB_TRIGGER_LEVEL, g, SWB_DIRECTION_RISING, from, 1, &one, 1, NULL, 0, NULL, 0, \
                        to, n_to, &zero, n_to, &index)
    REFUSED(SWB_ERR_RANGE, EVENT(-1, SWB_EFFECT_JUMP, &held, 1, &held), "count from 0");
    REFUSED(SWB_ERR_RANGE, EVENT(guard, 9, &held, 1, &held), "no effect 9");
    CHECK(index == -1);
    CHECK_OK(EVENT(guard, SWB_EFFECT_JUMP, &held, 1, &held));
    CHECK(index == 0);
    CHECK_OK(swb_scene_build(scene, graph));
    CHECK_OK(swb_scene_system(scene, &system));
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_set_double(integrator, "rtol", 1e-11));
    CHECK_OK(swb_integrator_set_double(integrator, "atol", 1e-11));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, start, 3));
    CHECK_OK(swb_integrator_advance(integrator, 2.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_state(integrator, end, 3));
    CHECK_NEAR(end[0], 4.0 * left - 5.0 * left * left, 1e-8);
    CHECK_NEAR(end[1], 4.0 - 10.0 * left, 1e-8);
    CHECK(end[2] == 0.0);
    CHECK_OK(swb_ocp_create_scene(scene, 1.0, 4, NULL, &ocp));
    swb_ocp_free(ocp);
    ocp = NULL;
    /* what a transition names is looked at when the scene is built */
    CHECK_OK(EVENT(guard, SWB_EFFECT_JUMP, &none, 1, &held));
    REFUSED(SWB_ERR_RANGE, swb_scene_build(scene, graph), "transition 1");
    CHECK_OK(swb_scene_create_projected("set", 1, 0, 0, NULL, &projected));
    CHECK_OK(swb_scene_add_discrete(projected, "w", 0.0, NULL));
#undef EVENT
    swb_scene_free(projected);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_scene_free(scene);
    swb_expr_free(graph);
}

/* A controller of a body that samples its velocity, kicks at two times, and pulses that push another one. */
static void clocks(void)
{
    const double start[10] = {0.0, 0.0, 1.0, 0.0}, numbers[2] = {0.25, 1.5}, times[2] = {0.2, 0.7}, back[2] = {0.7, 0.2}, one = 1.0;
    int64_t x[10], c[2], force[2], kicked, state = -1, index = -1, kept = 4, pulse = 5, kick = 3, strikes = 6, pulses = 7, kicks = 8;
    double end[10];
    int32_t outcome;
    swb_expr *graph = NULL, *other = NULL;
    swb_scene *scene = NULL, *projected = NULL;
    swb_system *system = NULL;
    swb_integrator *integrator = NULL;
    int k;
    CHECK_OK(swb_expr_create(&graph));
    CHECK_OK(swb_expr_create(&other));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 10));
    CHECK_OK(swb_expr_constants(graph, numbers, 2, c, 2));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_NEG, &x[4], NULL, NULL, &force[0], 1));
    CHECK_OK(swb_expr_apply(graph, SWB_OPERATOR_ADD, &x[3], &c[1], NULL, &kicked, 1));
    force[1] = x[5];
    CHECK_OK(swb_scene_create("sampled", 2, 2, 0, 0, NULL, &scene));
    for (k = 0; k < 5; k++)
        CHECK_OK(swb_scene_add_discrete(scene, NULL, 0.0, &state));
    CHECK(state == 8);
    CHECK_OK(swb_scene_set_force(scene, graph, force, 2));
#define CLOCK(scene, graph, period, offset, count)                                                                                \
    swb_scene_add_clock(scene, graph, period, offset, count, &kept, 1, &x[2], 1, NULL, 0, NULL, 0, &index)
#define TIMES(t, n, count) swb_scene_add_times(scene, graph, t, n, count, &kick, 1, &kicked, 1, NULL, 0, NULL, 0, &index)
    REFUSED(SWB_ERR_RANGE, CLOCK(scene, graph, 0.0, 0.0, strikes), "must be positive");
    REFUSED(SWB_ERR_RANGE, CLOCK(scene, graph, 0.5, NAN, strikes), "must be finite");
    REFUSED(SWB_ERR_RANGE, CLOCK(scene, graph, 0.5, 0.0, 9), "counts in state 9");
    REFUSED(SWB_ERR_DIMENSION, CLOCK(scene, graph, 0.5, 0.0, -1), "count");
    CHECK_STATUS(SWB_ERR_NULL, CLOCK(NULL, graph, 0.5, 0.0, strikes));
    CHECK_STATUS(SWB_ERR_NULL, CLOCK(scene, NULL, 0.5, 0.0, strikes));
    REFUSED(SWB_ERR_RANGE, swb_scene_add_clock(scene, graph, 0.5, 0.0, strikes, NULL, 0, NULL, 0, &strikes, 1, &one, 1, &index), "counts the strikes");
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_scene_add_clock(scene, graph, 0.5, 0.0, strikes, &kept, 1, NULL, 0, NULL, 0, NULL, 0, &index));
    REFUSED(SWB_ERR_RANGE, TIMES(back, 2, kicks), "must increase");
    REFUSED(SWB_ERR_RANGE, TIMES(times, 0, kicks), "one at least");
    CHECK_STATUS(SWB_ERR_NULL, TIMES(NULL, 2, kicks));
    REFUSED(SWB_ERR_RANGE, swb_scene_add_pwm(scene, graph, c[1], 0.4, 0.0, pulse, pulses, &index), "between 0 and 1");
    REFUSED(SWB_ERR_RANGE, swb_scene_add_pwm(scene, graph, -1, 0.4, 0.0, pulse, pulses, &index), "count from 0");
    REFUSED(SWB_ERR_RANGE, swb_scene_add_pwm(scene, graph, c[0], 0.4, 0.0, pulse, 77, &index), "counts in state 77");
    CHECK(index == -1);
    CHECK_OK(CLOCK(scene, graph, 0.5, 0.0, strikes));
    CHECK(index == 0);
    CHECK_OK(swb_scene_add_pwm(scene, graph, c[0], 0.4, 0.0, pulse, pulses, &index));
    CHECK(index == 1);
    CHECK_OK(TIMES(times, 2, kicks));
    CHECK(index == 3);
    CHECK_STATUS(SWB_ERR_STATE, swb_scene_add_clock(scene, other, 0.5, 0.0, strikes, NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL));
    CHECK_OK(swb_scene_build(scene, graph));
    CHECK_OK(swb_scene_system(scene, &system));
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, start, 9));
    CHECK_OK(swb_integrator_advance(integrator, 1.25, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_state(integrator, end, 9));
    CHECK_NEAR(end[2], 0.1875, 1e-12); /* 1, 0.5, 0.25, and half of the next quarter */
    CHECK_NEAR(end[3], 3.0 + 0.35, 1e-12); /* two kicks, three pulses and a half */
    CHECK(end[6] == 3.0 && end[7] == 4.0 && end[8] == 2.0);
    CHECK_OK(swb_scene_create_projected("set", 1, 0, 0, NULL, &projected));
    CHECK_OK(CLOCK(projected, graph, 0.5, 0.0, 0));
#undef CLOCK
#undef TIMES
    swb_scene_free(projected);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_scene_free(scene);
    swb_expr_free(other);
    swb_expr_free(graph);
}

int main(void)
{
    bounces();
    switches();
    jumps();
    clocks();
    joints();
    states();
    slides();
    steps();
    refusals();
    return CHECK_DONE();
}
