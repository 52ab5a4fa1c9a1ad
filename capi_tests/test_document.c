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

int main(void)
{
    models();
    supplied_functions();
    problems();
    return CHECK_DONE();
}
