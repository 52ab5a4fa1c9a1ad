#include <math.h>
#include <stdio.h>
#include <switchback.h>

#define CHECK(call) if ((call) != SWB_OK) return fprintf(stderr, "%s\n", swb_last_error()), 1

static int32_t smooth(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    out[1] = 1.2 * sin(at->x[2]);
    out[2] = 1.0; /* a clock state */
    return 0;
}
static int32_t friction(const swb_point *at, double *out, void *user_data)
{
    (void)at; (void)user_data;
    out[0] = -1.0; /* force where v > 0 */
    out[1] = 1.0;  /* force where v < 0 */
    return 0;
}
static int32_t velocity(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    return 0;
}

int main(void)
{
    const double x0[3] = {0.0, 0.0, 0.0};
    const int64_t rows[1] = {1};       /* the modes drive the velocity */
    const int8_t signs[2] = {1, -1};   /* mode 0: v > 0, mode 1: v < 0 */
    double x[3];
    swb_function *f0, *modes, *psi;
    swb_system *system;
    swb_simulator *sim;

    CHECK(swb_function_create("f0", 3, 0, 0, 3, smooth, NULL, NULL, &f0));
    CHECK(swb_function_create("friction", 3, 0, 0, 2, friction, NULL, NULL, &modes));
    CHECK(swb_function_create("v", 3, 0, 0, 1, velocity, NULL, NULL, &psi));
    CHECK(swb_system_create(3, 0, 0, &system));
    CHECK(swb_system_set_f0(system, f0));
    CHECK(swb_system_add_subsystem(system, rows, 1, modes, 2, psi, signs, 2, NULL));
    CHECK(swb_simulator_create(system, NULL, &sim));
    CHECK(swb_simulator_set_state(sim, 0.0, x0, 3));
    CHECK(swb_simulator_run(sim, 10.0, 50, NULL));
    CHECK(swb_simulator_get_state(sim, x, 3));
    printf("q = %.10f, v = %.10f\n", x[0], x[1]);
    swb_simulator_free(sim);
    swb_system_free(system);
    swb_function_free(f0);
    swb_function_free(modes);
    swb_function_free(psi);
    return 0;
}
