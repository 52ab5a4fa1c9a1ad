/* A controller in a loop with a clock: a cart is brought to rest by feedback at 200 Hz. Between two samples the controller prepares;
 * the control is out a few microseconds after the measurement. Prints how late samples were and where controls came from. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <stdio.h>
#include <time.h>

#include "example.h"

#define STAGES 25

static const double sample = 0.005;

/* A cart with a drag of the air: x' = (v, F - c v |v|). */
static int32_t cart(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1];
    out[1] = at->u[0] - 0.2 * at->x[1] * fabs(at->x[1]);
    return 0;
}

static int32_t everything(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    out[1] = at->x[1];
    out[2] = at->u[0];
    return 0;
}

static swb_ocp *make_problem(void)
{
    static const double weights[3] = {10.0, 0.5, 0.05}, zero[3] = {0.0, 0.0, 0.0}, low = -2.0, high = 2.0;
    swb_function *f = NULL, *all = NULL;
    swb_settings settings;
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    TRY(swb_settings_init(&settings, sizeof settings));
    settings.rk_family = SWB_RK_FAMILY_EXPLICIT;
    settings.n_s = 4;
    settings.n_fe = 1;
    TRY(swb_function_create("cart", 2, 1, 0, 2, cart, NULL, NULL, &f));
    TRY(swb_function_create("cost", 2, 1, 0, 3, everything, NULL, NULL, &all));
    TRY(swb_system_create(2, 1, 0, &system));
    TRY(swb_system_set_f0(system, f));
    TRY(swb_ocp_create(system, 2.0, STAGES, &settings, &ocp));
    TRY(swb_ocp_add_least_squares(ocp, all, weights, 3, zero, 3, SWB_COST_AT_RUNNING));
    TRY(swb_ocp_set_control_bounds(ocp, &low, 1, &high, 1));
    swb_system_free(system);
    swb_function_free(f);
    swb_function_free(all);
    return ocp;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void wait_until(double end)
{
    double left;
    while ((left = end - now()) > 0.0) {
        struct timespec t = {0, (long)(1e9 * (left < 0.5 ? left : 0.5))};
        nanosleep(&t, NULL);
    }
}

int main(void)
{
    double x[2] = {1.0, 0.0}, u = 0.0, start, late = 0.0, slowest = 0.0;
    int64_t from[5] = {0, 0, 0, 0, 0};
    swb_nmpc_options options;
    swb_nmpc_info info;
    swb_ocp *ocp = make_problem();
    swb_nmpc *c = NULL;
    TRY(swb_nmpc_options_init(&options, sizeof options));
    options.scheme = SWB_NMPC_SCHEME_AS_RTI;
    options.deadline = 0.5e-3;
    TRY(swb_nmpc_create(ocp, &options, &c));
    swb_ocp_free(ocp);
    TRY(swb_nmpc_initialise(c, x, 2, 50, NULL));
    start = now();
    for (int k = 0; k < 400; k++) {
        TRY(swb_nmpc_prepare(c, NULL, 0, NULL, 0));
        wait_until(start + k * sample);
        /* here a real program reads its sensors */
        TRY(swb_nmpc_feedback(c, x, 2, &u, 1, &info, sizeof info));
        /* and here it drives its motor */
        from[info.source]++;
        late = fmax(late, now() - (start + k * sample));
        slowest = fmax(slowest, info.time);
        TRY(swb_nmpc_finish(c));
        for (int i = 0; i < 10; i++) {
            x[0] += 0.1 * sample * x[1];
            x[1] += 0.1 * sample * (u - 0.2 * x[1] * fabs(x[1]));
        }
    }
    printf("after %.1f s: x = (%.4f, %.4f); controls from the quadratic program %d, others %d\n", 400 * sample, x[0], x[1],
           (int)from[SWB_NMPC_SOURCE_QP], 400 - (int)from[SWB_NMPC_SOURCE_QP]);
    printf("slowest feedback %.1f us, latest sample %.3f ms after its time\n", 1e6 * slowest, 1e3 * late);
    swb_nmpc_free(c);
    return fabs(x[0]) < 0.1 ? 0 : 1;
}
