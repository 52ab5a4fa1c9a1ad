/* Sizes without limit and growth without end, in processes with little memory: each ends with an error that says what to do,
 * and the object can be freed. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "switchback.h"

enum { ALIVE = 7 };

static int64_t nx = 1;

static int32_t waves(const swb_point *at, double *out, void *data)
{
    int64_t i;
    (void)data;
    for (i = 0; i < nx; i++)
        out[i] = sin(3 * at->x[(i + 1) % nx]) - at->x[i];
    return 0;
}

static swb_system *make(int64_t n)
{
    swb_function *g = NULL;
    swb_system *s = NULL;
    nx = n;
    if (swb_function_create("f", n, 0, 0, n, waves, NULL, NULL, &g) != SWB_OK || swb_system_create(n, 0, 0, &s) != SWB_OK
        || swb_system_set_f0(s, g) != SWB_OK)
        exit(1);
    swb_function_free(g);
    return s;
}

/* A call that must have failed for its size or for lack of memory, with words. */
static void expect(const char *name, swb_status status)
{
    const char *text = swb_last_error();
    if ((status != SWB_ERR_DIMENSION && status != SWB_ERR_LIBRARY) || strlen(text) < 20) {
        printf("%s: status %d, %s\n", name, (int)status, text);
        exit(1);
    }
    if (getenv("SWB_TEST_VERBOSE"))
        printf("%s: %s\n", name, text);
}

static void many_stages(void)
{
    const int64_t n[] = {INT64_C(1) << 40, INT64_MAX, (INT64_C(1) << 20) + 1, -1};
    swb_system *s = make(1);
    int k;
    for (k = 0; k < 4; k++) {
        swb_ocp *o = NULL;
        expect("stages", swb_ocp_create(s, 1, n[k], NULL, &o));
        if (o != NULL)
            exit(1);
    }
    swb_system_free(s);
}

static void most_stages(void)
{
    swb_system *s = make(1);
    swb_ocp *o = NULL;
    if (swb_ocp_create(s, 1, INT64_C(1) << 20, NULL, &o) != SWB_OK)
        exit(1);
    expect("the most stages", swb_ocp_solve(o, NULL));
    swb_ocp_free(o);
    swb_system_free(s);
}

static void many_states(void)
{
    swb_system *s = make(1000000);
    swb_simulator *o = NULL;
    swb_integrator *i = NULL;
    expect("states of a simulator", swb_simulator_create(s, NULL, &o));
    expect("states of an integrator", swb_integrator_create(s, NULL, &i));
    if (o != NULL || i != NULL)
        exit(1);
    swb_system_free(s);
}

static void large_problem(void)
{
    const int64_t n[] = {20, 60, 200}, stages[] = {4000, 400, 100};
    int k;
    for (k = 0; k < 3; k++) {
        swb_system *s = make(n[k]);
        swb_ocp *o = NULL;
        if (swb_ocp_create(s, 1, stages[k], NULL, &o) != SWB_OK)
            exit(1);
        expect("a large problem", swb_ocp_solve(o, NULL));
        expect("the same again", swb_ocp_solve(o, NULL));
        swb_ocp_free(o);
        swb_system_free(s);
    }
}

static swb_integrator *growing(const char *option, int64_t max_memory)
{
    const double x[2] = {.3, 1};
    swb_system *s = make(2);
    swb_settings settings;
    swb_integrator *o = NULL;
    swb_settings_init(&settings, sizeof settings);
    settings.h_max = 1e-5;
    settings.max_memory = max_memory;
    swb_settings_set_string(&settings, option, "on");
    if (swb_integrator_create(s, &settings, &o) != SWB_OK || swb_integrator_reinit(o, 0, x, 2) != SWB_OK)
        exit(1);
    swb_system_free(s);
    return o;
}

static void dense_output_grows(void)
{
    swb_integrator *o = growing("dense", 0);
    swb_run *run = NULL;
    double x[2];
    expect("dense output", swb_integrator_advance(o, 1e6, NULL));
    /* the object stands where it came to, and what it holds can still be read */
    if (swb_integrator_get_state(o, x, 2) != SWB_OK || !(x[0] != 0.3))
        exit(1);
    expect("a copy", swb_integrator_get_run(o, &run));
    expect("going on", swb_integrator_advance(o, 1e6, NULL));
    swb_integrator_free(o);
}

static void record_grows(void)
{
    swb_integrator *o = growing("adjoint", 0);
    expect("record for adjoints", swb_integrator_advance(o, 1e6, NULL));
    swb_integrator_free(o);
}

static void limit_of_growth(void)
{
    swb_integrator *o = growing("dense", 1 << 20);
    const double x[2] = {.3, 1};
    expect("max_memory of an integrator", swb_integrator_advance(o, 1e6, NULL));
    if (strstr(swb_last_error(), "max_memory") == NULL)
        exit(1);
    /* a shorter run fits */
    if (swb_integrator_reinit(o, 0, x, 2) != SWB_OK || swb_integrator_advance(o, 1e-2, NULL) != SWB_OK)
        exit(1);
    swb_integrator_free(o);
}

static void limit_of_a_problem(void)
{
    swb_system *s = make(3);
    swb_ocp *o = NULL;
    int32_t outcome = -1;
    swb_settings settings;
    const double x[3] = {.1, .2, .3};
    swb_settings_init(&settings, sizeof settings);
    settings.max_memory = 100000;
    if (swb_ocp_create(s, 1, 10, &settings, &o) != SWB_OK || swb_ocp_set_initial_state(o, x, 3) != SWB_OK)
        exit(1);
    expect("max_memory of a problem", swb_ocp_solve(o, NULL));
    if (strstr(swb_last_error(), "max_memory") == NULL || strstr(swb_last_error(), "30 finite elements") == NULL)
        exit(1);
    if (swb_ocp_set_int(o, "max_memory", 100000000) != SWB_OK || swb_ocp_solve(o, &outcome) != SWB_OK || outcome != 0)
        exit(1);
    swb_ocp_free(o);
    swb_system_free(s);
}

static void many_starts(void)
{
    const int64_t n[] = {INT64_C(1) << 56, INT64_MAX, INT64_C(1) << 30};
    swb_system *s = make(1);
    swb_ocp *o = NULL;
    double u[2];
    int k;
    if (swb_ocp_create(s, 1, 2, NULL, &o) != SWB_OK)
        exit(1);
    for (k = 0; k < 3; k++)
        expect("starts", swb_ocp_random_starts(o, 1, u, n[k]));
    swb_ocp_free(o);
    swb_system_free(s);
}

static void sizes_of_everything(void)
{
    const int64_t n[] = {INT64_MAX, INT64_MIN, INT64_C(1) << 62, INT64_C(1) << 33};
    swb_expr *graph = NULL;
    swb_function *f = NULL;
    swb_system *s = NULL;
    swb_mpcc *program = NULL;
    int64_t id[4];
    int k;
    if (swb_expr_create(&graph) != SWB_OK || swb_expr_inputs(graph, SWB_INPUT_X, 0, id, 1) != SWB_OK)
        exit(1);
    for (k = 0; k < 4; k++) {
        int64_t v = n[k];
        expect("nx", swb_function_create("f", v, 0, 0, 1, waves, NULL, NULL, &f));
        expect("nu", swb_function_create("f", 1, v, 0, 1, waves, NULL, NULL, &f));
        expect("np", swb_function_create("f", 1, 0, v, 1, waves, NULL, NULL, &f));
        expect("n_out", swb_function_create("f", 1, 0, 0, v, waves, NULL, NULL, &f));
        expect("nx of a system", swb_system_create(v, 0, 0, &s));
        expect("nu of a system", swb_system_create(1, v, 0, &s));
        expect("np of a system", swb_system_create(1, 0, v, &s));
        expect("inputs", swb_expr_inputs(graph, SWB_INPUT_X, 0, id, v));
        expect("first input", swb_expr_inputs(graph, SWB_INPUT_X, v, id, 1));
        expect("rows of a product", swb_expr_matmul(graph, v, 1, 1, id, 1, id, 1, id, 1));
        expect("rows of a product", swb_expr_matmul(graph, v, v, v, id, 1, id, 1, id, 1));
    }
    if (swb_function_create("f", 2, 0, 0, 1, waves, NULL, NULL, &f) != SWB_OK)
        exit(1);
    for (k = 0; k < 4; k++)
        expect("variables", swb_mpcc_create(n[k], 0, f, NULL, NULL, &program));
    swb_function_free(f);
    swb_expr_free(graph);
}

/* Expressions without end: the graph refuses to grow, and can be freed. */
static void expressions_without_end(void)
{
    swb_expr *graph = NULL;
    int64_t x, k;
    if (swb_expr_create(&graph) != SWB_OK || swb_expr_inputs(graph, SWB_INPUT_X, 0, &x, 1) != SWB_OK)
        exit(1);
    for (k = 0; k < 100000000; k++) {
        double v = (double)k;
        int64_t c;
        swb_status status = swb_expr_constants(graph, &v, 1, &c, 1);
        if (status != SWB_OK) {
            expect("expressions", status);
            swb_expr_free(graph);
            return;
        }
    }
    exit(1);
}

/* Objects without end. */
static void objects_without_end(void)
{
    swb_system *s = make(1);
    int64_t k;
    for (k = 0; k < 10000000; k++) {
        swb_ocp *o = NULL;
        swb_status status = swb_ocp_create(s, 1, 1000, NULL, &o);
        if (status != SWB_OK) {
            expect("objects", status);
            /* what the refused one gave back may be enough for one more, which needs its blocks in another order, but not for many */
            k = 0;
            do
                status = swb_ocp_create(s, 1, 1000, NULL, &o);
            while (status == SWB_OK && ++k < 100);
            expect("another object", status);
            return;
        }
    }
    exit(1);
}

struct test {
    const char *name;
    void (*run)(void);
    rlim_t megabytes;
};

static const struct test TESTS[] = {
    {"control stages beyond all limits", many_stages, 300},
    {"the largest number of control stages", most_stages, 300},
    {"a million states", many_states, 300},
    {"problems that are too large", large_problem, 300},
    {"dense output that grows", dense_output_grows, 150},
    {"a record that grows", record_grows, 150},
    {"max_memory of an integrator", limit_of_growth, 300},
    {"max_memory of a problem", limit_of_a_problem, 300},
    {"starts beyond all limits", many_starts, 300},
    {"sizes beyond all limits", sizes_of_everything, 300},
    {"expressions without end", expressions_without_end, 150},
    {"objects without end", objects_without_end, 100},
};

int main(void)
{
    int failures = 0;
    size_t k;
    for (k = 0; k < sizeof TESTS / sizeof TESTS[0]; k++) {
        int status = 0;
        pid_t child;
        fflush(NULL);
        child = fork();
        if (child == 0) {
            struct rlimit r = {TESTS[k].megabytes << 20, TESTS[k].megabytes << 20};
            setrlimit(RLIMIT_AS, &r);
            alarm(120);
            TESTS[k].run();
            fflush(NULL);
            _exit(ALIVE);
        }
        if (child < 0 || waitpid(child, &status, 0) < 0)
            return 2;
        if (!WIFEXITED(status) || WEXITSTATUS(status) != ALIVE) {
            printf("%s: %s %d\n", TESTS[k].name, WIFSIGNALED(status) ? "ended by signal" : "exit status",
                   WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
            failures++;
        }
    }
    return failures != 0;
}
