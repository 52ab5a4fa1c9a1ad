/* What comes in over the border and does not fit: texts of any length, sizes, patterns, documents; which threads call. */
#include <pthread.h>
#include <stdlib.h>
#include <time.h>

#include "models.h"

static int32_t decay(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = -at->x[0];
    return 0;
}

static double seconds(clock_t since)
{
    return (double)(clock() - since) / CLOCKS_PER_SEC;
}

/* Texts of the caller are compared with names and shown in messages only as far as names reach. */
static void long_texts(void)
{
    const size_t n = 8u << 20;
    char *text = malloc(n);
    swb_settings settings;
    swb_expr *graph = NULL;
    swb_model *model = NULL;
    int64_t index = 0;
    double value = 0;
    clock_t start = clock();

    memset(text, 'a', n - 1);
    text[n - 1] = 0;
    CHECK_OK(swb_settings_init(&settings, sizeof settings));
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_set_int(&settings, text, 1));
    CHECK(strstr(swb_last_error(), "unknown option 'aaa") && strlen(swb_last_error()) < 200);
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_set_double(&settings, text, 1.0));
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_set_string(&settings, text, "1"));
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_set_string(&settings, "rk_family", text));
    CHECK(strstr(swb_last_error(), "radau_iia") && strlen(swb_last_error()) < 1000);
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_set_string(&settings, "n_s", text));
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_get_double(&settings, text, &value));
    CHECK_STATUS(SWB_ERR_OPTION, swb_option_find(text, &index));
    CHECK_OK(swb_expr_create(&graph));
    CHECK(swb_model_from_json(graph, text, NULL, 0, NULL, 0, &model) != SWB_OK && model == NULL);
    CHECK(strlen(swb_last_error()) < 4100);
    CHECK(seconds(start) < 5.0); /* it took 3 s for each MB of each text */
    swb_expr_free(graph);
    free(text);
}

/* Names of users may be long, messages about them are not. */
static void long_names(void)
{
    const size_t n = 1u << 20;
    char *name = malloc(n);
    double out[2];
    swb_function *f = NULL;

    memset(name, 'f', n - 1);
    name[n - 1] = 0;
    CHECK_OK(swb_function_create(name, 0, 0, 0, 2, decay, NULL, NULL, &f));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_set_inputs(f, 16));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_set_jacobian(f, NULL, 0, NULL, 0, NULL));
    CHECK(strlen(swb_last_error()) < 4100);
    CHECK_STATUS(SWB_ERR_NULL, swb_function_eval(f, NULL, out, 2));
    swb_function_free(f);
    free(name);
}

static void sizes(void)
{
    static const int64_t large[] = {INT64_MAX, INT64_MIN, -1, (int64_t)1 << 31};
    static const int64_t elements[2][2] = {{1000000, 1}, {1, 0}};
    swb_function *f0 = make_function("f0", 1, 0, 0, 1, decay, NULL);
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    size_t k;

    for (k = 0; k < sizeof large / sizeof large[0]; k++) {
        CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_create(large[k], 0, 0, &system));
        CHECK(system == NULL);
        CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_create(1, large[k], 0, &system));
        CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_create(1, 0, large[k], &system));
    }
    CHECK_OK(swb_system_create(1, 0, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_set_algebraic(system, INT64_MAX, NULL));
    CHECK_OK(swb_ocp_create(system, 1.0, 2, NULL, &ocp));
    for (k = 0; k < 2; k++) {
        CHECK_STATUS(SWB_ERR_RANGE, swb_ocp_set_elements(ocp, elements[k], 2));
        CHECK(strstr(swb_last_error(), "give it 1 to 100000"));
    }
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_function_free(f0);
}

static int32_t lagrangian(const swb_point *at, double weight, const double *y, double *out, void *user_data)
{
    (void)at, (void)weight, (void)y, (void)out, (void)user_data;
    return 0;
}

/* Rows, columns and starts of patterns: every one is checked, and a pattern that is refused changes nothing. */
static void patterns(void)
{
    static const struct {
        int64_t col_ptr[4], rows[3], n_col_ptr, nnz;
    } bad[] = {
        {{0, 1, 2, 2}, {0, 4, 0}, 4, 2},                  /* row 4 of 4 */
        {{0, 1, 2, 2}, {-1, 0, 0}, 4, 2},                 /* a negative row */
        {{0, 1, 2, 2}, {INT64_MAX, INT64_MIN, 0}, 4, 2},  /* far away */
        {{0, 2, 2, 2}, {1, 0, 0}, 4, 2},                  /* rows fall */
        {{0, 2, 2, 2}, {1, 1, 0}, 4, 2},                  /* an entry twice */
        {{0, 3, 1, 2}, {0, 1, 2}, 4, 2},                  /* starts fall */
        {{1, 1, 2, 2}, {0, 1, 0}, 4, 2},                  /* does not start at 0 */
        {{0, 1, 2, 3}, {0, 1, 2}, 4, 2},                  /* ends behind the rows */
        {{0, 1, 2, 2}, {0, 1, 2}, 4, 3},                  /* ends before the rows */
        {{0, -1, 2, 2}, {0, 1, 2}, 4, 2},                 /* a negative start */
        {{0, INT64_MAX, 2, 2}, {0, 1, 2}, 4, 2},          /* starts far away */
        {{0, 1, 2, 2}, {0, 1, 2}, 3, 2},                  /* a column is missing */
        {{0, 1, 2, 2}, {0, 1, 2}, INT64_MAX, 2},          /* no such array */
        {{0, 1, 2, 2}, {0, 1, 2}, 4, -1},
    };
    swb_function *modes = make_function("F", 2, 0, 0, 4, oscillator_modes, NULL);
    swb_function *objective = make_function("f", 2, 0, 0, 1, circle, NULL);
    swb_mpcc *program = NULL;
    int64_t before = -1, nnz = -1;
    size_t k;

    CHECK_OK(swb_mpcc_create(2, 0, objective, NULL, NULL, &program));
    CHECK_OK(swb_function_sizes(modes, NULL, NULL, NULL, NULL, &before, NULL));
    for (k = 0; k < sizeof bad / sizeof bad[0]; k++) {
        const int64_t *col_ptr = bad[k].col_ptr, *rows = bad[k].rows, n = bad[k].n_col_ptr, m = bad[k].nnz;
        swb_status status = swb_function_set_jacobian(modes, col_ptr, n, rows, m, oscillator_modes_jacobian);
        CHECK(status == SWB_ERR_RANGE || status == SWB_ERR_DIMENSION);
        CHECK(strstr(swb_last_error(), "Jacobian of 'F'") || n == INT64_MAX || m < 0);
        status = swb_function_set_hessian(modes, col_ptr, n, rows, m, circle_hessian);
        CHECK(status == SWB_ERR_RANGE || status == SWB_ERR_DIMENSION);
        if (k >= 7)
            continue; /* with a column less some are patterns */
        status = swb_mpcc_set_hessian(program, col_ptr, 3, rows, m, lagrangian, NULL);
        CHECK(status == SWB_ERR_RANGE || status == SWB_ERR_DIMENSION);
    }
    CHECK_OK(swb_function_sizes(modes, NULL, NULL, NULL, NULL, &nnz, NULL));
    CHECK(nnz == before);
    swb_mpcc_free(program);
    swb_function_free(objective);
    swb_function_free(modes);
}

/* A document holds what may be run. */
static void documents(void)
{
    static const char *const wrong[][2] = {
        {"\"duration\":1.0", "\"duration\":-1 "}, {"\"duration\":1.0", "\"duration\":0.0"}, {"\"n_steps\":10", "\"n_steps\":0 "}};
    swb_system *system = make_oscillator();
    swb_simulator *simulator = NULL, *again = NULL;
    swb_function *modes = make_function("F", 2, 0, 0, 4, oscillator_modes, NULL);
    swb_function *psi = make_function("c", 2, 0, 0, 1, circle, NULL);
    const swb_function *functions[2];
    int64_t needed = 0, steps = -7;
    double duration = 7;
    char *text, *copy, *place;
    size_t k;

    functions[0] = modes;
    functions[1] = psi;
    CHECK_OK(swb_simulator_create(system, NULL, &simulator));
    CHECK_OK(swb_simulator_to_json(simulator, 1.0, 10, NULL, 0, &needed));
    text = malloc((size_t)needed);
    copy = malloc((size_t)needed);
    CHECK_OK(swb_simulator_to_json(simulator, 1.0, 10, text, needed, NULL));
    CHECK_OK(swb_simulator_from_json(text, functions, 2, &duration, &steps, &again));
    CHECK(duration == 1.0 && steps == 10);
    swb_simulator_free(again);
    for (k = 0; k < sizeof wrong / sizeof wrong[0]; k++) {
        memcpy(copy, text, (size_t)needed);
        place = strstr(copy, wrong[k][0]);
        CHECK(place != NULL);
        if (!place)
            continue;
        memcpy(place, wrong[k][1], strlen(wrong[k][1]));
        duration = 7;
        steps = -7;
        again = simulator;
        CHECK_STATUS(SWB_ERR_RANGE, swb_simulator_from_json(copy, functions, 2, &duration, &steps, &again));
        CHECK(again == NULL && duration == 7 && steps == -7);
    }
    free(copy);
    free(text);
    swb_function_free(psi);
    swb_function_free(modes);
    swb_simulator_free(simulator);
    swb_system_free(system);
}

/* The first error of a thread may be that of asking for it. */
static void *fresh(void *data)
{
    char buffer[1];
    int64_t needed = -1;
    int *failures = data;

    *failures += swb_last_error_copy(buffer, -1, &needed) != SWB_ERR_DIMENSION;
    *failures += swb_last_error()[0] == 0;
    return NULL;
}

static void first_error(void)
{
    pthread_t thread;
    int failures = 0;

    CHECK(pthread_create(&thread, NULL, fresh, &failures) == 0);
    pthread_join(thread, NULL);
    CHECK(failures == 0);
}

struct calls {
    pthread_t caller;
    int elsewhere;
};

static int32_t counted(const swb_point *at, double *out, void *user_data)
{
    struct calls *calls = user_data;
    if (!pthread_equal(pthread_self(), calls->caller))
        calls->elsewhere++;
    out[0] = -at->x[0];
    return 0;
}

/* SWB_SERIAL: however many threads are asked for, functions are called by the caller's. Through expressions, too. */
static void serial(void)
{
    struct calls calls = {pthread_self(), 0};
    swb_function *f = make_function("f", 1, 0, 0, 1, counted, &calls);
    swb_system *system = NULL;
    swb_batch *batch = NULL;
    swb_expr *graph = NULL;
    swb_model *model = NULL;
    double x0[64], end[64];
    int64_t x = 0, y = 0;
    int k;

    CHECK_STATUS(SWB_ERR_RANGE, swb_function_set_flags(f, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_set_flags(f, -1));
    CHECK_OK(swb_function_set_flags(f, SWB_SERIAL));
    for (k = 0; k < 64; k++)
        x0[k] = 1.0 + k;
    CHECK_OK(swb_system_create(1, 0, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f));
    CHECK_STATUS(SWB_ERR_STATE, swb_function_set_flags(f, 0));
    CHECK_OK(swb_batch_create(system, NULL, &batch));
    CHECK_OK(swb_batch_run(batch, 0.0, 1.0, x0, 64, NULL, 0, NULL, 0, 8));
    CHECK_OK(swb_batch_states(batch, end, 64));
    CHECK_NEAR(end[63], 64.0 * exp(-1.0), 1e-4);
    swb_batch_free(batch);
    swb_system_free(system);

    CHECK_OK(swb_expr_create(&graph));
    CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_X, 0, &x, 1));
    {
        int64_t inputs[2];
        inputs[0] = x;
        CHECK_OK(swb_expr_inputs(graph, SWB_INPUT_T, 0, &inputs[1], 1));
        CHECK_OK(swb_expr_call(graph, f, inputs, 2, &y, 1));
    }
    CHECK_OK(swb_model_create(graph, "m", 1, 0, 0, &y, NULL, NULL, &model));
    CHECK_OK(swb_model_system(model, &system));
    CHECK_OK(swb_batch_create(system, NULL, &batch));
    CHECK_OK(swb_batch_run(batch, 0.0, 1.0, x0, 64, NULL, 0, NULL, 0, 8));
    CHECK(calls.elsewhere == 0);
    swb_batch_free(batch);
    swb_system_free(system);
    swb_model_free(model);
    swb_expr_free(graph);
    swb_function_free(f);
}

static int32_t friction(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[1] = -0.5;
    out[3] = 0.5;
    return 0;
}

static int32_t speed(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    return 0;
}

static int32_t effort(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->u[0] * at->u[0];
    return 0;
}

/* A solve, an adapted grid with its simulation, and a document nested as deeply as it goes. */
static void *with_little_stack(void *data)
{
    static const int64_t rows[] = {0, 1};
    static const int8_t signs[] = {1, -1};
    static const double rest[] = {0.0, 0.0}, low[] = {-1.0, -1.0}, high[] = {2.0, 2.0};
    swb_function *f0 = make_function("f0", 2, 1, 0, 2, double_integrator, NULL);
    swb_function *modes = make_function("F", 2, 1, 0, 4, friction, NULL);
    swb_function *psi = make_function("v", 2, 1, 0, 1, speed, NULL);
    swb_function *cost = make_function("L", 2, 1, 0, 1, effort, NULL);
    swb_system *system = NULL;
    swb_ocp *ocp = NULL, *none = NULL;
    int32_t outcome = -1;
    char *text = malloc(100001);

    memset(text, '[', 100000);
    text[100000] = 0;
    CHECK(swb_ocp_from_json(text, NULL, 0, &none) != SWB_OK && none == NULL);
    free(text);
    CHECK_OK(swb_system_create(2, 1, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f0));
    CHECK_OK(swb_system_add_subsystem(system, rows, 2, modes, 2, psi, signs, 2, NULL));
    CHECK_OK(swb_ocp_create(system, 2.0, 5, NULL, &ocp));
    CHECK_OK(swb_ocp_set_double(ocp, "adapt_tol", 1e-4));
    CHECK_OK(swb_ocp_set_lagrange(ocp, cost));
    CHECK_OK(swb_ocp_set_initial_bounds(ocp, rest, 2, rest, 2));
    CHECK_OK(swb_ocp_set_state_bounds(ocp, low, 2, high, 2));
    CHECK_OK(swb_ocp_solve(ocp, &outcome));
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_function_free(cost);
    swb_function_free(psi);
    swb_function_free(modes);
    swb_function_free(f0);
    *(int *)data = 1;
    return NULL;
}

/* The figure in the header. */
static void stack(void)
{
    pthread_attr_t attributes;
    pthread_t thread;
    int done = 0;

    pthread_attr_init(&attributes);
    CHECK(pthread_attr_setstacksize(&attributes, 512 * 1024) == 0);
    CHECK(pthread_create(&thread, &attributes, with_little_stack, &done) == 0);
    pthread_join(thread, NULL);
    pthread_attr_destroy(&attributes);
    CHECK(done);
}

int main(void)
{
    if (!check_slow()) /* valgrind says nothing of the size of a stack */
        stack();
    long_texts();
    long_names();
    sizes();
    patterns();
    documents();
    first_error();
    serial();
    CHECK(swb_live_objects() == 0);
    return CHECK_DONE();
}
