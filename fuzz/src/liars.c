/* What others wrote: functions of CasADi that lie about themselves, libraries that are none, documents that are damaged.
 *
 *   liars [--stride N] [--seed OFFSET] [--seconds N] [--only NUMBER]
 *
 * $FUZZ_LIBRARY names a shared library with honest and with incomplete functions. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "casadi.h"
#include "cases.h"
#include "problems.h"

enum { LUCKS = 64, LONGEST = 1 << 14, DAMAGES = 8, N_DOCUMENTS = 5 };

/* --- functions --- */

static int use_function(swb_function *f)
{
    double x[2] = {0.3, 0.7}, u = 0.1, out[3], entries[64], weights[3] = {1.0, -1.0, 2.0};
    int64_t jacobian = 0, hessian = 0;
    swb_point at = {0.0, x, &u, NULL};
    swb_system *system = NULL;
    int wrong = cases_bad_status(swb_function_sizes(f, NULL, NULL, NULL, NULL, &jacobian, &hessian), "sizes");
    wrong |= cases_bad_status(swb_function_eval(f, &at, out, 3), "eval");
    if (jacobian <= 64)
        wrong |= cases_bad_status(swb_function_eval_jacobian(f, &at, entries, jacobian), "eval_jacobian");
    if (hessian <= 64)
        wrong |= cases_bad_status(swb_function_eval_hessian(f, &at, weights, 3, entries, hessian), "eval_hessian");
    wrong |= cases_bad_status(swb_function_check_derivatives(f, &at, NULL, NULL, NULL, 0, NULL), "check_derivatives");
    wrong |= cases_bad_status(swb_system_create(2, 1, 0, &system), "system");
    wrong |= cases_bad_status(swb_system_set_f0(system, f), "f0"); /* three outputs: refused */
    swb_system_free(system);
    return wrong;
}

static int lying_function(int64_t number)
{
    int64_t which = number / LUCKS;
    swb_casadi value, jacobian;
    swb_function *f = NULL;
    casadi_lies(which == 0 ? LIE_NONE : 1u << (which - 1), (uint64_t)number);
    casadi_value(&value);
    casadi_jacobian(&jacobian);
    swb_status status = swb_function_from_casadi_pointers("f", &value, number % 2 ? &jacobian : NULL, NULL, number % 3 ? NULL : "x u", 2, 1, 0, &f);
    int wrong = cases_bad_status(status, "from_casadi_pointers");
    if (which == 0 && status != SWB_OK)
        wrong |= cases_wrong("the honest function is refused: %s", swb_last_error());
    if (status == SWB_OK)
        wrong |= use_function(f);
    else if (f)
        wrong |= cases_wrong("failed, and the function is not NULL");
    swb_function_free(f);
    return wrong;
}

/* --- libraries --- */

static const char *const functions_of_libraries[] = {"f", "bare", "absent", "", "f_n_in", "\xff", "jac_f"};
static const char *const other_paths[] = {NULL, "/nonexistent.so", "/dev/null", "/proc/self/exe", "", "/", "libm.so.6"};
enum { N_NAMES = 7, N_PATHS = 7 };

static int library(int64_t number)
{
    const char *path = number / N_NAMES == 0 ? getenv("FUZZ_LIBRARY") : other_paths[number / N_NAMES];
    swb_function *f = NULL;
    if (!path)
        path = "/nonexistent";
    swb_status status = swb_function_from_casadi_library(path, functions_of_libraries[number % N_NAMES], NULL, 2, 1, 0, &f);
    int wrong = cases_bad_status(status, "from_casadi_library");
    if (number == 0 && getenv("FUZZ_LIBRARY") && status != SWB_OK)
        wrong |= cases_wrong("the honest library is refused: %s", swb_last_error());
    if (status == SWB_OK)
        wrong |= use_function(f);
    swb_function_free(f);
    status = swb_function_from_casadi_file(path, path, "f", NULL, 2, 1, 0, &f);
    wrong |= cases_bad_status(status, "from_casadi_file");
    swb_function_free(f);
    return wrong;
}

/* --- documents --- */

static char documents[N_DOCUMENTS][LONGEST];

/* A ball that bounces, as a scene and in an optimal control problem. */
static void write_scenes(void)
{
    static const double numbers[2] = {-9.81, 0.5};
    int64_t x[2], u, c[2], force;
    swb_expr *graph = NULL;
    swb_scene *scene = NULL;
    swb_ocp *ocp = NULL;
    MUST(swb_expr_create(&graph));
    MUST(swb_expr_inputs(graph, SWB_INPUT_X, 0, x, 2));
    MUST(swb_expr_inputs(graph, SWB_INPUT_U, 0, &u, 1));
    MUST(swb_expr_constants(graph, numbers, 2, c, 2));
    MUST(swb_expr_apply(graph, SWB_OPERATOR_ADD, &c[0], &u, NULL, &force, 1));
    MUST(swb_scene_create("ball", 1, 1, 1, 0, "y\nv\npush", &scene));
    MUST(swb_scene_set_force(scene, graph, &force, 1));
    MUST(swb_scene_add_contact(scene, graph, "floor", x[0], NULL, 0, -1, c[1], NULL));
    MUST(swb_scene_to_json(scene, graph, documents[3], LONGEST, NULL));
    MUST(swb_scene_build(scene, graph));
    MUST(swb_ocp_create_scene(scene, 1.0, 2, NULL, &ocp));
    MUST(swb_ocp_to_json(ocp, documents[4], LONGEST, NULL));
    swb_ocp_free(ocp);
    swb_scene_free(scene);
    swb_expr_free(graph);
}

static void write_documents(void)
{
    swb_expr *graph = NULL;
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    swb_simulator *sim = NULL;
    MUST(swb_expr_create(&graph));
    swb_model *model = friction_model(graph);
    swb_function *cost = friction_cost(graph);
    MUST(swb_model_to_json(model, documents[0], LONGEST, NULL));
    MUST(swb_model_system(model, &system));
    MUST(swb_simulator_create(system, NULL, &sim));
    MUST(swb_simulator_to_json(sim, 1.0, 3, documents[1], LONGEST, NULL));
    MUST(swb_ocp_create(system, 1.0, 2, NULL, &ocp));
    MUST(swb_ocp_set_lagrange(ocp, cost));
    MUST(swb_ocp_to_json(ocp, documents[2], LONGEST, NULL));
    swb_ocp_free(ocp);
    swb_simulator_free(sim);
    swb_system_free(system);
    swb_function_free(cost);
    swb_model_free(model);
    swb_expr_free(graph);
    write_scenes();
}

/* The text with damage number `how` at byte `at`. */
static void damaged(const char *text, char *out, int64_t at, int64_t how)
{
    static const char bytes[] = {'\0', '"', '{', '9', '-', (char)0xff};
    size_t place = (size_t)at, n = strlen(text);
    memcpy(out, text, n + 1);
    if (how < 6)
        out[place] = bytes[how];
    else if (how == 6)
        memmove(out + place, out + place + 1, n - place);
    else if (n + 8 < LONGEST) {
        memmove(out + place + 3, out + place, n - place + 1);
        memcpy(out + place, "e99", 3);
    }
}

static int document(int64_t number)
{
    static char text[LONGEST + 16];
    int64_t which = number % N_DOCUMENTS, how = number / N_DOCUMENTS % DAMAGES, at = number / N_DOCUMENTS / DAMAGES;
    if (at >= (int64_t)strlen(documents[which]))
        return 0;
    damaged(documents[which], text, at, how);
    swb_status status;
    if (which == 0) {
        swb_expr *graph = NULL;
        swb_model *model = NULL;
        MUST(swb_expr_create(&graph));
        status = swb_model_from_json(graph, text, NULL, 0, NULL, 0, &model);
        swb_model_free(model);
        swb_expr_free(graph);
    } else if (which == 1) {
        swb_simulator *sim = NULL;
        status = swb_simulator_from_json(text, NULL, 0, NULL, NULL, &sim);
        swb_simulator_free(sim);
    } else if (which == 3) {
        swb_expr *graph = NULL;
        swb_scene *scene = NULL;
        MUST(swb_expr_create(&graph));
        status = swb_scene_from_json(graph, text, NULL, 0, NULL, 0, &scene);
        if (status == SWB_OK)
            status = swb_scene_build(scene, graph);
        swb_scene_free(scene);
        swb_expr_free(graph);
    } else {
        swb_ocp *ocp = NULL;
        status = swb_ocp_from_json(text, NULL, 0, &ocp);
        swb_ocp_free(ocp);
    }
    return cases_bad_status(status, "from_json");
}

/* --- cases --- */

enum { FUNCTIONS = (N_LIES + 1) * LUCKS, LIBRARIES = N_NAMES * N_PATHS, DOCUMENTS = N_DOCUMENTS * DAMAGES * 6000 };

static int run(int64_t number)
{
    if (number < FUNCTIONS)
        return lying_function(number);
    if (number < FUNCTIONS + LIBRARIES)
        return library(number - FUNCTIONS);
    return document(number - FUNCTIONS - LIBRARIES);
}

static void describe(int64_t number, char *text, size_t size)
{
    snprintf(text, size, "%s", number < FUNCTIONS ? "function" : number < FUNCTIONS + LIBRARIES ? "library" : "document");
}

int main(int n, char **arguments)
{
    write_documents();
    const struct cases cases = {"liars", FUNCTIONS + LIBRARIES + DOCUMENTS, run, describe, NULL};
    return cases_main(&cases, n, arguments);
}
