/* Documents: models and problems in JSON. */
#include "check.h"

#include <stdlib.h>

/* x' = -a sign(x), a a constant or the output of a function of x and t */
static swb_model *model_of(swb_expr *g, const swb_function *f)
{
    int64_t x, t, s, a, args[2];
    const double one = 1.0;
    swb_model *model = NULL;
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_X, 0, &x, 1));
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_T, 0, &t, 1));
    CHECK_OK(swb_expr_constants(g, &one, 1, &a, 1));
    if (f != NULL) {
        args[0] = x;
        args[1] = t;
        CHECK_OK(swb_expr_call(g, f, args, 2, &a, 1));
    }
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SIGN, &x, NULL, NULL, &s, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &a, &s, NULL, &s, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_NEG, &s, NULL, NULL, &s, 1));
    CHECK_OK(swb_model_create(g, "m", 1, 0, 0, &s, NULL, NULL, &model));
    return model;
}

static char *model_text(const swb_model *model)
{
    int64_t needed = 0;
    char *text;
    CHECK_OK(swb_model_to_json(model, NULL, 0, &needed));
    text = malloc((size_t)needed);
    CHECK_OK(swb_model_to_json(model, text, needed, NULL));
    return text;
}

static void models(void)
{
    swb_expr *g = NULL, *h = NULL;
    swb_model *model, *again = NULL;
    char *text, *second;
    int64_t nx = 0, nu = -1, rhs = -1, two[2] = {-1, -1}, needed = 0;
    CHECK_OK(swb_expr_create(&g));
    CHECK_OK(swb_expr_create(&h));
    model = model_of(g, NULL);
    text = model_text(model);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_to_json(model, text, 3, &needed));
    CHECK_OK(swb_model_from_json(h, text, NULL, 0, &rhs, 1, &again));
    CHECK_OK(swb_model_sizes(again, &nx, &nu, NULL));
    CHECK(nx == 1 && nu == 0 && rhs > 0);
    second = model_text(again);
    CHECK(strcmp(text, second) == 0);
    swb_model_free(again);
    CHECK_OK(swb_model_from_json(h, text, NULL, 0, NULL, 0, &again));
    swb_model_free(again);

    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_from_json(h, text, NULL, 0, two, 2, &again));
    CHECK(again == NULL && two[0] == -1);
    CHECK_STATUS(SWB_ERR_NULL, swb_model_from_json(h, NULL, NULL, 0, NULL, 0, &again));
    CHECK_STATUS(SWB_ERR_NULL, swb_model_from_json(NULL, text, NULL, 0, NULL, 0, &again));
    CHECK_STATUS(SWB_ERR_NULL, swb_model_from_json(h, text, NULL, 0, NULL, 0, NULL));
    CHECK_STATUS(SWB_ERR_NULL, swb_model_from_json(h, text, NULL, 1, NULL, 0, &again));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_from_json(h, text, NULL, -1, NULL, 0, &again));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_from_json(h, "\xff", NULL, 0, NULL, 0, &again));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_from_json(h, "", NULL, 0, NULL, 0, &again));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_from_json(h, text + 1, NULL, 0, NULL, 0, &again));
    strstr(text, "\"version\":1")[10] = '9';
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_model_from_json(h, text, NULL, 0, NULL, 0, &again));
    CHECK(strstr(swb_last_error(), "version 9") != NULL);
    CHECK(again == NULL);
    free(text);
    free(second);
    swb_model_free(model);
    swb_expr_free(g);
    swb_expr_free(h);
}

static int32_t strength(const swb_point *at, double *out, void *data)
{
    (void)data;
    out[0] = 1.0 + at->x[0] * at->x[0];
    return 0;
}

static void supplied_functions(void)
{
    swb_expr *g = NULL;
    swb_function *f = NULL, *other = NULL;
    const swb_function *both[2];
    swb_model *model, *again = NULL;
    char *text;
    CHECK_OK(swb_expr_create(&g));
    CHECK_OK(swb_function_create("strength", 1, 0, 0, 1, strength, NULL, NULL, &f));
    CHECK_OK(swb_function_create("other", 1, 0, 0, 1, strength, NULL, NULL, &other));
    model = model_of(g, f);
    text = model_text(model);
    CHECK_STATUS(SWB_ERR_STATE, swb_model_from_json(g, text, NULL, 0, NULL, 0, &again));
    CHECK(strstr(swb_last_error(), "'strength'") != NULL);
    both[0] = other;
    both[1] = f;
    CHECK_STATUS(SWB_ERR_STATE, swb_model_from_json(g, text, both, 1, NULL, 0, &again));
    CHECK_OK(swb_model_from_json(g, text, both, 2, NULL, 0, &again));
    swb_model_free(again);
    both[0] = NULL;
    CHECK_STATUS(SWB_ERR_NULL, swb_model_from_json(g, text, both, 2, NULL, 0, &again));
    free(text);
    swb_model_free(model);
    swb_expr_free(g);
    swb_function_free(f);
    swb_function_free(other);
}

static void problems(void)
{
    swb_expr *g = NULL;
    swb_model *model;
    swb_system *system = NULL;
    swb_simulator *sim = NULL, *sim2 = NULL;
    swb_ocp *ocp = NULL, *ocp2 = NULL;
    const double x0 = 0.75;
    double duration = 0, end[2] = {0, 1}, cost[2] = {0, 1};
    int64_t n_steps = 0, needed = 0;
    int32_t outcome = -1;
    char *text, *second;
    CHECK_OK(swb_expr_create(&g));
    model = model_of(g, NULL);
    CHECK_OK(swb_model_system(model, &system));

    CHECK_OK(swb_simulator_create(system, NULL, &sim));
    CHECK_OK(swb_simulator_set_state(sim, 0.5, &x0, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_simulator_to_json(sim, -1.0, 4, NULL, 0, &needed));
    CHECK_STATUS(SWB_ERR_RANGE, swb_simulator_to_json(sim, 1.0, 0, NULL, 0, &needed));
    CHECK_OK(swb_simulator_to_json(sim, 1.0, 4, NULL, 0, &needed));
    text = malloc((size_t)needed);
    CHECK_OK(swb_simulator_to_json(sim, 1.0, 4, text, needed, NULL));
    CHECK_OK(swb_simulator_from_json(text, NULL, 0, &duration, &n_steps, &sim2));
    CHECK(duration == 1.0 && n_steps == 4);
    CHECK_OK(swb_simulator_run(sim, 1.0, 4, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_simulator_run(sim2, duration, n_steps, &outcome));
    CHECK_OK(swb_simulator_get_state(sim, &end[0], 1));
    CHECK_OK(swb_simulator_get_state(sim2, &end[1], 1));
    CHECK(end[0] == end[1]);
    CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_from_json(text, NULL, 0, &ocp2));
    CHECK(ocp2 == NULL && strstr(swb_last_error(), "swb_simulator_from_json") != NULL);
    free(text);

    CHECK_OK(swb_ocp_create(system, 1.0, 2, NULL, &ocp));
    CHECK_OK(swb_ocp_set_initial_state(ocp, &x0, 1));
    CHECK_OK(swb_ocp_set_int(ocp, "n_fe", 4));
    CHECK_OK(swb_ocp_to_json(ocp, NULL, 0, &needed));
    text = malloc((size_t)needed);
    second = malloc((size_t)needed);
    CHECK_OK(swb_ocp_to_json(ocp, text, needed, NULL));
    CHECK(strstr(text, "\"n_fe\":4") != NULL);
    CHECK_OK(swb_ocp_from_json(text, NULL, 0, &ocp2));
    CHECK_OK(swb_ocp_to_json(ocp2, second, needed, NULL));
    CHECK(strcmp(text, second) == 0);
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_ocp_solve(ocp2, &outcome));
    CHECK_OK(swb_ocp_get_cost(ocp, &cost[0]));
    CHECK_OK(swb_ocp_get_cost(ocp2, &cost[1]));
    CHECK(cost[0] == cost[1]);
    free(text);
    free(second);
    swb_ocp_free(ocp);
    swb_ocp_free(ocp2);
    swb_simulator_free(sim);
    swb_simulator_free(sim2);
    swb_system_free(system);
    swb_model_free(model);
    swb_expr_free(g);
}

/* x' = w - x/2 with w on below 1 and off above 1.5; where it goes on x is raised by a tenth. */
static swb_model *heater(swb_expr *g)
{
    static const double numbers[5] = {0.5, 1.0, 1.5, 0.1, 0.0}, initial[1] = {1.0}, off = 0.0, on = 1.0;
    static const int64_t state = 0, heat = 1, missing = 7, negative = -1;
    static const double nan_ = 0.0 / 0.0;
    int64_t x[2], c[5], rhs[2], low, high, raised, index = -1, n = 0, m = 0, condition;
    swb_model *model = NULL;
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_X, 0, x, 2));
    CHECK_OK(swb_expr_constants(g, numbers, 5, c, 5));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &c[0], &x[0], NULL, &rhs[0], 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SUB, &x[1], &rhs[0], NULL, &rhs[0], 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SUB, &x[0], &c[1], NULL, &low, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_SUB, &x[0], &c[2], NULL, &high, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_ADD, &x[0], &c[3], NULL, &raised, 1));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_POSITIVE, &low, NULL, NULL, &condition, 1));
    rhs[1] = c[4];
    CHECK_OK(swb_model_create(g, "heater", 2, 0, 0, rhs, "x\nheat", NULL, &model));

    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_set_discrete(model, numbers, 3));
    CHECK_STATUS(SWB_ERR_STATE, swb_model_set_discrete(model, numbers, 2)); /* x moves */
    CHECK(strstr(swb_last_error(), "state x is discrete") != NULL);
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_set_discrete(model, &nan_, 1));
    CHECK_OK(swb_model_transition_counts(model, &n, &m));
    CHECK(n == 0 && m == 0);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_set_value_names(model, 0, "off\non")); /* there is none yet */
    CHECK_OK(swb_model_set_discrete(model, initial, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_set_value_names(model, 1, "off\non"));
    CHECK(strstr(swb_last_error(), "no discrete state 1") != NULL);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_set_value_names(model, -1, "off\non"));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_set_value_names(model, 0, "off\noff"));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_set_value_names(model, 0, "off\n"));
    CHECK_OK(swb_model_set_value_names(model, 0, "off\non"));

    CHECK_STATUS(SWB_ERR_STATE, swb_model_add_transition(model, g, low, SWB_DIRECTION_FALLING, NULL, 0, NULL, 0, NULL, 0, NULL, 0,
                                                         NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_transition(model, g, low, 5, &heat, 1, &off, 1, NULL, 0, NULL, 0, &heat, 1, &on, 1,
                                                         &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_transition(model, g, low, SWB_DIRECTION_FALLING, &heat, 1, &off, 1, &state, 1,
                                                         &condition, 1, &heat, 1, &on, 1, &index)); /* a reset is a value */
    CHECK_STATUS(SWB_ERR_STATE, swb_model_add_event(model, g, "low", SWB_EFFECT_STOP, SWB_TRIGGER_LEVEL, condition,
                                                    SWB_DIRECTION_FALLING, NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0,
                                                    &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_event(model, g, "low", 3, SWB_TRIGGER_EDGE, condition, SWB_DIRECTION_FALLING, NULL, 0,
                                                    NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_event(model, g, "low", SWB_EFFECT_NOTE, 2, condition, SWB_DIRECTION_FALLING, NULL, 0,
                                                    NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_event(model, g, "two\nlines", SWB_EFFECT_NOTE, SWB_TRIGGER_EDGE, condition,
                                                    SWB_DIRECTION_FALLING, NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0,
                                                    &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_transition(model, g, -4, SWB_DIRECTION_FALLING, &heat, 1, &off, 1, NULL, 0, NULL, 0,
                                                         &heat, 1, &on, 1, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_transition(model, g, low, SWB_DIRECTION_FALLING, &heat, 1, &off, 1, &missing, 1,
                                                         &raised, 1, &heat, 1, &on, 1, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_transition(model, g, low, SWB_DIRECTION_FALLING, &heat, 1, &off, 1, &negative, 1,
                                                         &raised, 1, &heat, 1, &on, 1, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_add_transition(model, g, low, SWB_DIRECTION_FALLING, &heat, 1, &off, 1, &state, 1,
                                                             NULL, 0, &heat, 1, &on, 1, &index));
    CHECK(index == -1);
    CHECK_OK(swb_model_add_transition(model, g, low, SWB_DIRECTION_FALLING, &heat, 1, &off, 1, &state, 1, &raised, 1, &heat, 1,
                                      &on, 1, &index));
    CHECK(index == 0);
    CHECK_OK(swb_model_add_transition(model, g, high, SWB_DIRECTION_RISING, &heat, 1, &on, 1, NULL, 0, NULL, 0, &heat, 1, &off, 1,
                                      NULL));
    CHECK_OK(swb_model_add_event(model, g, "cold", SWB_EFFECT_NOTE, SWB_TRIGGER_EDGE, condition, SWB_DIRECTION_FALLING, NULL, 0,
                                 NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK(index == 2);
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_event(model, g, "cold", SWB_EFFECT_NOTE, SWB_TRIGGER_EDGE, condition,
                                                    SWB_DIRECTION_FALLING, NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0, NULL, 0,
                                                    NULL));
    CHECK(strstr(swb_last_error(), "'cold' already") != NULL);
    return model;
}

static swb_run *heated(const swb_model *model)
{
    static const double x0[2] = {1.2, 1.0};
    swb_system *system = NULL;
    swb_integrator *integrator = NULL;
    swb_run *run = NULL;
    int32_t outcome = -1;
    CHECK_OK(swb_model_system(model, &system));
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, x0, 2));
    CHECK_OK(swb_integrator_advance(integrator, 10.0, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_run(integrator, &run));
    swb_integrator_free(integrator);
    swb_system_free(system);
    return run;
}

/* Transitions and discrete states return, and what returns runs alike to the last bit. */
static void transitions(void)
{
    swb_expr *g = NULL, *h = NULL;
    swb_model *model, *again = NULL;
    swb_run *run, *run2;
    swb_run_info info, info2;
    char *text, *named, names[16], report[4000];
    double initial = -1.0, from_value = -1.0, to_value = -1.0, x[2], x2[2];
    int64_t n = -1, m = -1, rhs[2], guard = -1, from = -1, reset = -1, to = -1, id = -1, sizes[3];
    int32_t direction = -1, effect = -1, trigger = -1;
    CHECK_OK(swb_expr_create(&g));
    CHECK_OK(swb_expr_create(&h));
    model = heater(g);
    text = model_text(model);
    CHECK_OK(swb_model_from_json(h, text, NULL, 0, rhs, 2, &again));
    CHECK_OK(swb_model_transition_counts(again, &n, &m));
    CHECK(n == 1 && m == 3);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_get_rule(again, 3, NULL, NULL, NULL, 0, &n));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_get_rule(again, 2, NULL, NULL, names, 2, &n));
    CHECK_OK(swb_model_get_rule(again, 2, &effect, &trigger, names, sizeof names, &n));
    CHECK(effect == SWB_EFFECT_NOTE && trigger == SWB_TRIGGER_EDGE && n == 5 && strcmp(names, "cold") == 0);
    CHECK_OK(swb_model_get_rule(again, 0, &effect, &trigger, names, sizeof names, NULL));
    CHECK(effect == SWB_EFFECT_JUMP && trigger == SWB_TRIGGER_LEVEL && names[0] == '\0');
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_get_discrete(again, &initial, 2));
    CHECK_OK(swb_model_get_discrete(again, &initial, 1));
    CHECK(initial == 1.0);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_get_value_names(again, 1, names, sizeof names, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_get_value_names(again, 0, names, 3, &n));
    CHECK(n == 7);
    CHECK_OK(swb_model_get_value_names(again, 0, names, sizeof names, NULL));
    CHECK(strcmp(names, "off\non") == 0);
    CHECK_OK(swb_model_report(again, 0, report, sizeof report, NULL));
    CHECK(strstr(report, "discrete: heat (off, on)") != NULL);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_transition_sizes(again, 3, NULL, NULL, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_transition_sizes(again, -1, NULL, NULL, NULL));
    CHECK_OK(swb_model_transition_sizes(again, 0, &sizes[0], &sizes[1], &sizes[2]));
    CHECK(sizes[0] == 1 && sizes[1] == 1 && sizes[2] == 1);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_get_transition(again, 0, &guard, &direction, &from, 1, &from_value, 1, NULL, 0, NULL,
                                                             0, &to, 1, &to_value, 1));
    CHECK_STATUS(SWB_ERR_NULL, swb_model_get_transition(again, 0, NULL, &direction, &from, 1, &from_value, 1, &reset, 1, &id, 1, &to,
                                                        1, &to_value, 1));
    CHECK(direction == -1 && guard == -1 && from == -1);
    CHECK_OK(swb_model_get_transition(again, 0, &guard, &direction, &from, 1, &from_value, 1, &reset, 1, &id, 1, &to, 1, &to_value,
                                      1));
    CHECK(direction == SWB_DIRECTION_FALLING && from == 1 && from_value == 0.0 && reset == 0 && to == 1 && to_value == 1.0);
    CHECK(guard >= 0 && id >= 0);
    CHECK_OK(swb_model_transition_sizes(again, 1, &sizes[0], &sizes[1], &sizes[2]));
    CHECK(sizes[0] == 1 && sizes[1] == 0 && sizes[2] == 1);
    run = heated(model);
    run2 = heated(again);
    CHECK_OK(swb_run_get_info(run, &info, sizeof info));
    CHECK_OK(swb_run_get_info(run2, &info2, sizeof info2));
    CHECK(info.n_jumps == info2.n_jumps && info.n_jumps > 3 && info.n_notes == info2.n_notes && info.n_notes > 1);
    CHECK_OK(swb_run_state(run, x, 2));
    CHECK_OK(swb_run_state(run2, x2, 2));
    CHECK(x[0] == x2[0] && x[1] == x2[1]);
    swb_model_free(again);
    again = NULL;
    /* documents from before there were names */
    named = strstr(text, "\"value_names\":[[\"off\",\"on\"]],");
    CHECK(named != NULL);
    if (named != NULL)
        memset(named, ' ', strlen("\"value_names\":[[\"off\",\"on\"]],"));
    CHECK_OK(swb_model_from_json(h, text, NULL, 0, NULL, 0, &again));
    CHECK_OK(swb_model_get_value_names(again, 0, names, sizeof names, NULL));
    CHECK(names[0] == 0);
    swb_model_free(again);
    again = NULL;
    memcpy(strstr(text, "\"falling\""), "\"failing\"", 9);
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_from_json(h, text, NULL, 0, NULL, 0, &again));
    CHECK(again == NULL && strstr(swb_last_error(), "failing") != NULL);
    free(text);
    swb_run_free(run);
    swb_run_free(run2);
    swb_model_free(model);
    swb_expr_free(g);
    swb_expr_free(h);
}

/* x' = pulse; y is x at 0.25, 0.55 and 0.85, and at 0.9 what it is then is doubled; the pulse lasts for half of every period of 0.4. */
static void clocks(void)
{
    static const double numbers[4] = {0.0, 0.5, 1.5, 2.0}, nan_ = 0.0 / 0.0, once[1] = {0.9}, past[2] = {2.0, 1.0}, one = 1.0;
    static const double x0[6] = {0};
    static const int64_t sampled = 1, pulse = 2, strikes = 3, times = 4, pulses = 5, missing = 7;
    int64_t x[6], c[4], rhs[6], doubled, index = -1;
    double end[6];
    swb_expr *g = NULL;
    swb_model *m = NULL;
    swb_system *system = NULL;
    swb_integrator *integrator = NULL;
    int32_t outcome = -1;
    CHECK_OK(swb_expr_create(&g));
    CHECK_OK(swb_expr_inputs(g, SWB_INPUT_X, 0, x, 6));
    CHECK_OK(swb_expr_constants(g, numbers, 4, c, 4));
    CHECK_OK(swb_expr_apply(g, SWB_OPERATOR_MUL, &c[3], &x[1], NULL, &doubled, 1));
    for (int i = 0; i < 6; i++)
        rhs[i] = i ? c[0] : x[2];
    CHECK_OK(swb_model_create(g, "clocked", 6, 0, 0, rhs, NULL, NULL, &m));
    CHECK_OK(swb_model_set_discrete(m, x0, 5));

    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_clock(m, g, 0.0, 0.0, strikes, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_clock(m, g, 1.0, nan_, strikes, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_clock(m, g, 1.0, 0.0, missing, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK(strstr(swb_last_error(), "counts in state 7") != NULL);
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_clock(m, g, 1.0, 0.0, strikes, NULL, 0, NULL, 0, &strikes, 1, &one, 1, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_model_add_clock(m, g, 1.0, 0.0, strikes, &sampled, 1, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_model_add_clock(NULL, g, 1.0, 0.0, strikes, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_model_add_clock(m, NULL, 1.0, 0.0, strikes, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_times(m, g, past, 2, times, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_times(m, g, past, 0, times, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_model_add_times(m, g, NULL, 2, times, NULL, 0, NULL, 0, NULL, 0, NULL, 0, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_pwm(m, g, c[2], 0.4, 0.0, pulse, pulses, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_pwm(m, g, -1, 0.4, 0.0, pulse, pulses, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_model_add_pwm(m, g, c[1], 0.4, 0.0, missing, pulses, &index));
    CHECK(index == -1);

    CHECK_OK(swb_model_add_clock(m, g, 0.3, 0.25, strikes, &sampled, 1, &x[0], 1, NULL, 0, NULL, 0, &index));
    CHECK(index == 0);
    CHECK_OK(swb_model_add_times(m, g, once, 1, times, &sampled, 1, &doubled, 1, NULL, 0, NULL, 0, NULL));
    CHECK_OK(swb_model_add_pwm(m, g, c[1], 0.4, 0.0, pulse, pulses, &index));
    CHECK(index == 2);
    CHECK_OK(swb_model_system(m, &system));
    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_reinit(integrator, 0.0, x0, 6));
    CHECK_OK(swb_integrator_advance(integrator, 1.05, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_state(integrator, end, 6));
    CHECK(fabs(end[0] - 0.6) < 1e-6);     /* 0.2, 0.2, 0.2 */
    CHECK(fabs(end[1] - 2 * 0.45) < 1e-6); /* 0.2 + 0.2 + 0.05 at 0.85 */
    CHECK(end[2] == 0 && end[3] == 3 && end[4] == 1 && end[5] == 3);
    swb_integrator_free(integrator);
    swb_system_free(system);
    swb_model_free(m);
    swb_expr_free(g);
}

int main(void)
{
    models();
    transitions();
    clocks();
    supplied_functions();
    problems();
    return CHECK_DONE();
}
