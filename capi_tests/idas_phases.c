/* The same phases by FESD and by IDAS: the smooth phases of the oscillator, also through its switch; a sliding
 * mode as index-reduced DAE; a nonlinear mode as DAE. FESD must agree, and converge with its order. */
#include "idas_models.h"

enum { LEVELS = 4 };

/* What to simulate: the state at t0 and t1. */
struct phase {
    const char *name;
    double t0, t1;
    const double *x0, *reference;
    int64_t nx, n_s;
    int64_t n_steps[LEVELS];
    double order, floor; /* expected order, errors below which rounding and tolerances rule */
};

static void converge(swb_system *system, const struct phase *p)
{
    swb_simulator *sim = NULL;
    swb_settings settings;
    double h[LEVELS], error[LEVELS], x[8], found;
    int32_t outcome;
    int k;
    int64_t i;

    CHECK_OK(swb_settings_init(&settings, sizeof settings));
    settings.n_s = p->n_s;
    settings.n_fe = 2;
    CHECK_OK(swb_simulator_create(system, &settings, &sim));
    for (k = 0; k < LEVELS; k++) {
        CHECK_OK(swb_simulator_set_state(sim, p->t0, p->x0, p->nx));
        CHECK_OK(swb_simulator_run(sim, p->t1 - p->t0, p->n_steps[k], &outcome));
        CHECK(outcome == SWB_OUTCOME_SOLVED);
        CHECK_OK(swb_simulator_get_state(sim, x, p->nx));
        h[k] = (p->t1 - p->t0) / (double)(2 * p->n_steps[k]);
        error[k] = 0.0;
        for (i = 0; i < p->nx; i++)
            error[k] = fmax(error[k], fabs(x[i] - p->reference[i]));
    }
    found = slope(h, error, LEVELS, p->floor);
    printf("%-28s n_s = %d  errors", p->name, (int)p->n_s);
    for (k = 0; k < LEVELS; k++)
        printf(" %.1e", error[k]);
    printf("  slope %.2f, order %.0f\n", found, p->order);
    CHECK(found > p->order - 0.4);
    CHECK(error[LEVELS - 1] < 1e-2 * error[0] || error[LEVELS - 1] < 10.0 * p->floor);
    swb_simulator_free(sim);
}

/* --- the oscillator ------------------------------------------------------------------------------- */

static void oscillator(void)
{
    struct dae before = INSIDE, after = OUTSIDE;
    swb_system *system = make_oscillator();
    double x1[2] = {OSCILLATOR_X0[0], OSCILLATOR_X0[1]}, x2[2] = {1.0, 0.0}, yp[2], all[2];
    const double on[2] = {1.0, 0.0};
    int64_t n_s;

    start(inside, x1, yp);
    idas_solve(&before, 0.0, 0.95, x1, yp, 1e-10);
    start(outside, x2, yp);
    idas_solve(&after, 1.0, 1.5, x2, yp, 1e-10);
    for (n_s = 2; n_s <= 4; n_s++) {
        struct phase first = {"oscillator, inside", 0.0, 0.95, OSCILLATOR_X0, x1, 2, n_s, {8, 16, 32, 64}, 0, 2e-9};
        struct phase second = {"oscillator, outside", 1.0, 1.5, on, x2, 2, n_s, {8, 16, 32, 64}, 0, 2e-9};
        first.order = second.order = (double)(2 * n_s - 1);
        if (n_s == 4)
            first.n_steps[0] = 4, first.n_steps[1] = 6, first.n_steps[2] = 8, first.n_steps[3] = 12;
        if (n_s == 4)
            second.n_steps[0] = 2, second.n_steps[1] = 3, second.n_steps[2] = 4, second.n_steps[3] = 6;
        converge(system, &first);
        converge(system, &second);
    }

    /* Through the switch: IDAS phase by phase, the switch at t = 1 where it is known to be. */
    all[0] = OSCILLATOR_X0[0];
    all[1] = OSCILLATOR_X0[1];
    start(inside, all, yp);
    idas_solve(&before, 0.0, 1.0, all, yp, 1e-11);
    start(outside, all, yp);
    idas_solve(&after, 1.0, OSCILLATOR_T, all, yp, 1e-11);
    CHECK_NEAR(all[0], OSCILLATOR_XT[0], 1e-7);
    CHECK_NEAR(all[1], OSCILLATOR_XT[1], 1e-7);
    for (n_s = 2; n_s <= 3; n_s++) {
        struct phase p = {"oscillator, with its switch", 0.0, 0, OSCILLATOR_X0, OSCILLATOR_XT, 2, n_s, {13, 26, 52, 104}, 0, 1e-9};
        p.t1 = OSCILLATOR_T;
        p.order = (double)(2 * n_s - 1);
        converge(system, &p);
    }
    swb_system_free(system);
}

/* --- sliding -------------------------------------------------------------------------------------- */

static void sliding(void)
{
    static const double x0[2] = {0.0, 0.0};
    struct dae dae = SLIDING;
    swb_system *system = make_sliding();
    double y[3] = {0.0, 0.0, 0.25}, yp[3] = {1.0, 0.5, 0.0};
    int64_t n_s;

    idas_solve(&dae, 0.0, 1.0, y, yp, 1e-10);
    CHECK_NEAR(y[1], 0.5 * sin(y[0]), 1e-9);
    CHECK(fabs(y[2]) < 0.9); /* it slides indeed */
    for (n_s = 2; n_s <= 3; n_s++) {
        /* the differential part of an index-2 DAE: order 2 n_s - 1 */
        struct phase p = {"sliding", 0.0, 1.0, x0, y, 2, n_s, {1, 2, 4, 8}, 0, 1e-9};
        p.order = (double)(2 * n_s - 1);
        converge(system, &p);
    }
    swb_system_free(system);
}

/* --- a nonlinear mode ----------------------------------------------------------------------------- */

static void nonlinear(void)
{
    static const double x0[2] = {2.0, 0.5};
    struct dae dae = LIENARD;
    swb_system *system = make_lienard();
    double y[3] = {2.0, 0.5, 0.0}, yp[3] = {0.0, -0.5, 0.0};
    int64_t n_s;

    yp[0] = y[2] = 2.0 * (y[1] - y[0] * y[0] * y[0] / 3.0 + y[0]);
    idas_solve(&dae, 0.0, 1.0, y, yp, 1e-10);
    for (n_s = 2; n_s <= 3; n_s++) {
        struct phase p = {"nonlinear mode", 0.0, 1.0, x0, y, 2, n_s, {2, 4, 8, 16}, 0, 2e-11};
        p.order = (double)(2 * n_s - 1);
        converge(system, &p);
    }
    swb_system_free(system);
}

int main(void)
{
    oscillator();
    sliding();
    nonlinear();
    return CHECK_DONE();
}
