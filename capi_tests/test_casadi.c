/* Functions that CasADi generated: linked, from a library, every refusal. */
#include "models.h"

/* In this program: one file, compiled here. */
#define CASADI_SYMBOL_EXPORT static
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter"
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wunused-variable"
#pragma GCC diagnostic ignored "-Wundef"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#endif
#include "../tests/data/casadi/models_38.c"
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

/* a library of the system that is none of CasADi */
#ifdef _WIN32
#define ANY_LIBRARY "msvcrt.dll"
#else
#define ANY_LIBRARY "libm.so.6"
#endif

static swb_function *linked(const char *name, swb_casadi f, swb_casadi jac, swb_casadi hess, int64_t nx, int64_t nu)
{
    swb_function *out = NULL;
    CHECK_OK(swb_function_from_casadi_pointers(name, &f, &jac, &hess, NULL, nx, nu, 0, &out));
    return out;
}

#define LINKED(f, hess, nx, nu) linked(#f, (swb_casadi)SWB_CASADI(f), (swb_casadi)SWB_CASADI(jac_##f), (swb_casadi)SWB_CASADI(hess), nx, nu)

static void simulation(void)
{
    static const int64_t rows[] = {0, 1};
    static const int8_t signs[] = {1, -1};
    swb_function *modes = LINKED(osc_F, hess_osc_F, 2, 0), *c = LINKED(osc_c, hess_osc_c, 2, 0);
    swb_system *by_hand = make_oscillator(), *system = NULL;
    double ends[2][2];
    int64_t jnz, hnz;
    int k;

    CHECK_OK(swb_function_sizes(modes, NULL, NULL, NULL, NULL, &jnz, &hnz));
    CHECK(jnz == 8 && hnz == 0);
    CHECK_OK(swb_function_sizes(c, NULL, NULL, NULL, NULL, &jnz, &hnz));
    CHECK(jnz == 2 && hnz == 2);
    /* It has its derivatives. */
    CHECK_STATUS(SWB_ERR_STATE, swb_function_set_linear(c));
    CHECK_OK(swb_system_create(2, 0, 0, &system));
    CHECK_OK(swb_system_add_subsystem(system, rows, 2, modes, 2, c, signs, 2, NULL));
    swb_function_free(modes);
    swb_function_free(c);
    for (k = 0; k < 2; k++) {
        swb_simulator *sim = NULL;
        CHECK_OK(swb_simulator_create(k ? system : by_hand, NULL, &sim));
        CHECK_OK(swb_simulator_set_state(sim, 0.0, OSCILLATOR_X0, 2));
        CHECK_OK(swb_simulator_run(sim, OSCILLATOR_T, 12, NULL));
        CHECK_OK(swb_simulator_get_state(sim, ends[k], 2));
        swb_simulator_free(sim);
    }
    CHECK_NEAR(ends[0][0], ends[1][0], 1e-11);
    CHECK_NEAR(ends[0][1], ends[1][1], 1e-11);
    swb_system_free(system);
    swb_system_free(by_hand);
}

static void adjoint(void)
{
    static const double x[] = {0.7, -1.3, 0.0, 0.0}, u[] = {0.0, 0.0}, w[] = {2.0};
    const swb_point at = {0.0, x, u, NULL};
    swb_function *c = LINKED(c1, jac_adj1_c1, 4, 2);
    double out[2];
    int32_t passed = 0;

    CHECK_OK(swb_function_eval(c, &at, out, 1));
    CHECK_NEAR(out[0], 0.7 + 0.15 * 1.69, 1e-15);
    CHECK_OK(swb_function_eval_jacobian(c, &at, out, 2));
    CHECK_NEAR(out[1], -0.39, 1e-15);
    CHECK_OK(swb_function_eval_hessian(c, &at, w, 1, out, 1));
    CHECK_NEAR(out[0], 0.6, 1e-15);
    CHECK_OK(swb_function_check_derivatives(c, &at, &passed, NULL, NULL, 0, NULL));
    CHECK(passed == 1);
    swb_function_free(c);
}

static int fails(const double **arg, double **res, long long *iw, double *w, int mem)
{
    (void)arg;
    (void)res;
    (void)iw;
    (void)w;
    (void)mem;
    return -3;
}

static void refusals(void)
{
    swb_casadi f = SWB_CASADI(osc_c), jac = SWB_CASADI(jac_osc_F);
    static const double x[] = {0.7, -1.3};
    const swb_point at = {0.0, x, NULL, NULL};
    swb_function *out = NULL;
    double value = 5.0;

    CHECK_STATUS(SWB_ERR_NULL, swb_function_from_casadi_pointers(NULL, &f, NULL, NULL, NULL, 2, 0, 0, &out));
    CHECK_STATUS(SWB_ERR_NULL, swb_function_from_casadi_pointers("f", NULL, NULL, NULL, NULL, 2, 0, 0, &out));
    CHECK_STATUS(SWB_ERR_NULL, swb_function_from_casadi_pointers("f", &f, NULL, NULL, NULL, 2, 0, 0, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_from_casadi_pointers("f", &f, NULL, NULL, NULL, 3, 0, 0, &out));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_from_casadi_pointers("f", &f, NULL, NULL, NULL, -1, 0, 0, &out));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_from_casadi_pointers("f", &f, NULL, NULL, "x u", 2, 0, 0, &out));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_from_casadi_pointers("f", &f, NULL, NULL, "y", 2, 0, 0, &out));
    /* The Jacobian of another function. */
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_from_casadi_pointers("f", &f, &jac, NULL, NULL, 2, 0, 0, &out));
    CHECK(out == NULL && strstr(swb_last_error(), "expected 1 x 2") != NULL);
    f.struct_size = 8;
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_function_from_casadi_pointers("f", &f, NULL, NULL, NULL, 2, 0, 0, &out));
    f.struct_size = sizeof f;
    f.sparsity_out = NULL;
    CHECK_STATUS(SWB_ERR_LIBRARY, swb_function_from_casadi_pointers("f", &f, NULL, NULL, NULL, 2, 0, 0, &out));
    f.sparsity_out = (swb_code)osc_c_sparsity_out;

    /* What fails everywhere, here at zero too. */
    f.eval = (swb_code)fails;
    CHECK_OK(swb_function_from_casadi_pointers("f", &f, NULL, NULL, "x", 2, 0, 0, &out));
    CHECK_STATUS(SWB_ERR_NONFINITE, swb_function_eval(out, &at, &value, 1));
    CHECK(value == 5.0 && strstr(swb_last_error(), "'f'") != NULL);
    swb_function_free(out);
    out = NULL;

    CHECK_STATUS(SWB_ERR_LIBRARY, swb_function_from_casadi_library("/no/such.so", "f", NULL, 2, 0, 0, &out));
    CHECK(strstr(swb_last_error(), "/no/such.so") != NULL);
    CHECK_STATUS(SWB_ERR_NULL, swb_function_from_casadi_library(NULL, "f", NULL, 2, 0, 0, &out));
    CHECK_STATUS(SWB_ERR_RANGE, swb_function_from_casadi_library("", "f", NULL, 2, 0, 0, &out));
    CHECK_STATUS(SWB_ERR_LIBRARY, swb_function_from_casadi_library(ANY_LIBRARY, "f", NULL, 2, 0, 0, &out));
    CHECK_STATUS(SWB_ERR_LIBRARY, swb_function_from_casadi_library(ANY_LIBRARY, "cos", NULL, 2, 0, 0, &out));
    CHECK_STATUS(SWB_ERR_LIBRARY, swb_function_from_casadi_file(ANY_LIBRARY, "f", "f", NULL, 2, 0, 0, &out));
    CHECK(out == NULL && strstr(swb_last_error(), "no library of CasADi") != NULL);
}

int main(void)
{
    simulation();
    adjoint();
    refusals();
    return CHECK_DONE();
}
