/* Event-driven simulation beside IDAS: smooth phases, and whole runs of relays that slide on one surface and on two at once,
 * with crossings, entries and exits. On the side of IDAS the logic of the modes is written by hand below: each phase is an
 * index-1 DAE, IDAS finds its end as a root, the next phase follows from the signs. The error of IDAS itself is measured by
 * halving its tolerance; the engine must agree to 1e-9 and err in proportion to its own tolerance. */
#include "idas_models.h"

enum { MAX_EVENTS = 32, MAX_STATES = 8 };

static const double BLIND = 1e-2; /* after an event its surface is not watched for so long: it is still next to zero */
static const char *const METHODS[] = {"auto", "dp5", "dop853", "radau5"};

struct event {
    double t;
    int surface, kind; /* enum swb_event_kind */
};

/* What a run ends with. */
struct end {
    double x[MAX_STATES];
    int nx, n_events;
    struct event events[MAX_EVENTS];
};

static double apart(const struct end *a, const struct end *b)
{
    double off = 0.0;
    int i;
    CHECK(a->n_events == b->n_events);
    for (i = 0; i < a->nx; i++)
        off = fmax(off, fabs(a->x[i] - b->x[i]));
    for (i = 0; i < a->n_events && i < b->n_events; i++) {
        CHECK(a->events[i].surface == b->events[i].surface && a->events[i].kind == b->events[i].kind);
        off = fmax(off, fabs(a->events[i].t - b->events[i].t));
    }
    return off;
}

/* --- the engine ------------------------------------------------------------------------------------ */

static void engine_run(const swb_system *system, const char *method, double rtol, const double *x0, double t0, double t1,
                       struct end *end)
{
    swb_integrator *integrator = NULL;
    swb_event events[MAX_EVENTS];
    swb_run *run = NULL;
    swb_run_info info;
    int32_t outcome = -1;
    int64_t i;

    CHECK_OK(swb_integrator_create(system, NULL, &integrator));
    CHECK_OK(swb_integrator_set_string(integrator, "integration", method));
    CHECK_OK(swb_integrator_set_double(integrator, "rtol", rtol));
    CHECK_OK(swb_integrator_set_double(integrator, "atol", rtol));
    CHECK_OK(swb_integrator_reinit(integrator, t0, x0, end->nx));
    CHECK_OK(swb_integrator_advance(integrator, t1, &outcome));
    CHECK(outcome == SWB_RUN_OUTCOME_REACHED);
    CHECK_OK(swb_integrator_get_state(integrator, end->x, end->nx));
    CHECK_OK(swb_integrator_get_run(integrator, &run));
    CHECK_OK(swb_run_get_info(run, &info, sizeof info));
    CHECK(info.n_events <= MAX_EVENTS);
    CHECK_OK(swb_run_events(run, events, info.n_events, sizeof *events));
    end->n_events = (int)info.n_events;
    for (i = 0; i < info.n_events; i++) {
        end->events[i].t = events[i].t;
        end->events[i].surface = (int)events[i].subsystem;
        end->events[i].kind = (int)events[i].kind;
    }
    swb_run_free(run);
    swb_integrator_free(integrator);
}

/* Every method over tolerances from 1e-4 to 1e-11: within 100 rtol of IDAS, and on a line of slope 1. */
static void compare(const char *name, const swb_system *system, const double *x0, double t0, double t1,
                    const struct end *idas, double idas_error)
{
    enum { LEVELS = 8 };
    size_t m;
    CHECK(idas_error < 1e-11);
    for (m = 0; m < sizeof METHODS / sizeof *METHODS; m++) {
        double rtol[LEVELS], error[LEVELS], rate;
        int k, n = 0;
        printf("%-26s %-7s", name, METHODS[m]);
        for (k = 0; k < LEVELS; k++) {
            struct end end = *idas;
            rtol[k] = pow(10.0, -4 - k);
            engine_run(system, METHODS[m], rtol[k], x0, t0, t1, &end);
            error[k] = apart(&end, idas);
            printf(" %.0e", error[k]);
            CHECK(error[k] <= 100.0 * rtol[k] + idas_error);
        }
        CHECK(error[LEVELS - 1] <= 1e-9);
        /* steps that switches cut short are far more accurate than a loose tolerance asks: they show no trend */
        for (k = 0; k < LEVELS; k++) {
            if (error[k] >= 0.01 * rtol[k]) {
                rtol[n] = rtol[k];
                error[n++] = error[k];
            }
        }
        rate = slope(rtol, error, n, 3.0 * idas_error + 1e-13);
        printf("  rate %.2f\n", rate);
        /* a problem of few steps passes whole orders at once: the rate is a trend over seven decades, not a law */
        CHECK(isnan(rate) || rate > 0.75);
    }
}

/* --- smooth phases --------------------------------------------------------------------------------- */

/* IDAS with half its tolerance again and again, until that changes nothing beyond 4e-12; the last change. */
static double refine(void (*solve)(double rtol, struct end *end), struct end *end)
{
    struct end before;
    double rtol = 1e-11, change = INFINITY;
    solve(rtol, end);
    while (change > 4e-12 && rtol > 1e-14) {
        before = *end;
        rtol *= 0.5;
        solve(rtol, end);
        change = apart(end, &before);
    }
    return change;
}

struct smooth {
    struct dae dae;
    double t1, y0[MAX_STATES], yp0[MAX_STATES];
    int nx;
};

static struct smooth *the_smooth; /* what `solve_smooth` solves */

static void solve_smooth(double rtol, struct end *end)
{
    double y[MAX_STATES];
    memcpy(y, the_smooth->y0, sizeof y);
    CHECK(idas_solve(&the_smooth->dae, 0.0, the_smooth->t1, y, the_smooth->yp0, rtol) == the_smooth->t1);
    memcpy(end->x, y, sizeof y);
    end->nx = the_smooth->nx;
    end->n_events = 0;
}

static void smooth_phase(const char *name, swb_system *system, struct smooth *phase)
{
    struct end idas;
    double error;
    the_smooth = phase;
    error = refine(solve_smooth, &idas);
    compare(name, system, phase->y0, 0.0, phase->t1, &idas, error);
    swb_system_free(system);
}

static void smooth_phases(void)
{
    struct smooth in = {INSIDE, 0.95, {0.36787944117144233, 0.0}, {0}, 2};
    struct smooth out = {OUTSIDE, 1.2, {1.2, -0.3}, {0}, 2};
    struct smooth slow = {LIENARD, 2.0, {2.0, 0.5, 0.0}, {0}, 2};
    struct smooth slide = {SLIDING, 1.2, {0.0, 0.0, 0.25}, {1.0, 0.5}, 2};

    start(inside, in.y0, in.yp0);
    start(outside, out.y0, out.yp0);
    slow.y0[2] = slow.yp0[0] = 2.0 * (slow.y0[1] - pow(slow.y0[0], 3) / 3.0 + slow.y0[0]);
    slow.yp0[1] = -0.2 * slow.y0[0] - 0.1;
    smooth_phase("oscillator, inside", make_oscillator(), &in);
    smooth_phase("oscillator, outside", make_oscillator(), &out);
    smooth_phase("nonlinear mode", make_lienard(), &slow);
    smooth_phase("sliding from the start", make_sliding(), &slide);
}

/* --- relays ---------------------------------------------------------------------------------------- */

/* n relays on moving, curved surfaces, with a clock that they disturb:
 *   z'   = g = 1 + y_1^2 / 5
 *   y_i' = a_i - sum_j B_ij w_j,   w_j in sign(psi_j),   psi_j = y_j - c_j(z)
 * While S is the set of surfaces it slides on, w_S follows from d psi_S / dt = 0. */
static const double B[2][2] = {{1.0, 0.3}, {-0.2, 0.9}};
static const double T_RELAYS = 7.0, X0_RELAYS[3] = {0.0, 0.7, -0.5};

static struct {
    int n, side[2]; /* +1, -1, or 0 while it slides */
    int watched[2];
} relays;

static double speed(const double *y) { return 1.0 + 0.2 * y[1] * y[1]; }

static void pull(const double *y, double *a)
{
    a[0] = 1.3 * sin(1.3 * y[0]) + 0.3 * y[2];
    a[1] = 1.2 * cos(1.1 * y[0] + 0.3) - 0.2 * y[1];
}

static double surface(int j, double z) { return j ? 0.15 * cos(2.0 * z) : 0.2 * sin(z); }
static double surface_slope(int j, double z) { return j ? -0.3 * sin(2.0 * z) : 0.2 * cos(z); }

/* y: z, y_1, y_2, w_1, w_2; where there is one relay only, y_2 and w_2 stay zero. */
static void relays_dae(double t, const double *y, const double *yp, double *r)
{
    double a[2], g = speed(y), rate;
    int i;
    (void)t;
    pull(y, a);
    r[0] = g - yp[0];
    for (i = 0; i < 2; i++) {
        if (i >= relays.n) {
            r[1 + i] = -yp[1 + i];
            r[3 + i] = y[3 + i];
            continue;
        }
        rate = a[i] - B[i][0] * y[3] - B[i][1] * y[4];
        r[1 + i] = rate - yp[1 + i];
        r[3 + i] = relays.side[i] ? y[3 + i] - relays.side[i] : rate - surface_slope(i, y[0]) * g;
    }
}

/* Where it slides, w may not leave [-1, 1]; elsewhere psi may not change its sign. */
static void relays_roots(const double *y, double *root)
{
    int i;
    for (i = 0; i < 2; i++) {
        if (!relays.watched[i])
            root[i] = 1.0;
        else if (relays.side[i])
            root[i] = y[1 + i] - surface(i, y[0]);
        else
            root[i] = 1.0 - y[3 + i] * y[3 + i];
    }
}

/* w at y for the present sides: two linear equations by Cramer's rule. */
static void weights(const double *y, double *w)
{
    double a[2], m[2][2] = {{1, 0}, {0, 1}}, b[2] = {0, 0}, det;
    int i;
    pull(y, a);
    for (i = 0; i < relays.n; i++) {
        if (relays.side[i]) {
            b[i] = relays.side[i];
        } else {
            memcpy(m[i], B[i], sizeof m[i]);
            b[i] = a[i] - surface_slope(i, y[0]) * speed(y);
        }
    }
    det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    w[0] = (b[0] * m[1][1] - m[0][1] * b[1]) / det;
    w[1] = (m[0][0] * b[1] - m[1][0] * b[0]) / det;
}

/* Do these sides follow at y, where the surfaces in `at` have psi = 0? It moves to the side it is said to be on, and slides
 * only with weights that are no more than full. */
static int follows(const double *y, const int *at)
{
    double a[2], w[2], rate;
    int i;
    weights(y, w);
    pull(y, a);
    for (i = 0; i < relays.n; i++) {
        rate = a[i] - B[i][0] * w[0] - B[i][1] * w[1] - surface_slope(i, y[0]) * speed(y);
        if (relays.side[i] ? at[i] && rate * relays.side[i] <= 0.0 : fabs(w[i]) > 1.0 + 1e-9)
            return 0;
    }
    return 1;
}

/* At a root: B is a P-matrix, so exactly one choice of the sides follows; all are tried. The other surface may change because of
 * it, at the same time. */
static void switch_sides(double *y, double t, struct end *end)
{
    static const int choices[3] = {0, 1, -1};
    double root[2];
    int hit, i, k, before[2], at[2] = {0, 0}, found = 0, now[2] = {0, 0};

    memcpy(before, relays.side, sizeof before);
    relays_roots(y, root);
    hit = fabs(root[1]) < fabs(root[0]);
    for (i = 0; i < relays.n; i++)
        at[i] = i == hit || !before[i];
    if (before[hit])
        y[1 + hit] = surface(hit, y[0]);
    for (k = 0; k < 9; k++) {
        int fits = 1;
        for (i = 0; i < 2; i++) {
            relays.side[i] = i < relays.n ? choices[i ? k / 3 : k % 3] : 0;
            fits = fits && (i < relays.n ? at[i] || relays.side[i] == before[i] : k < 3);
        }
        /* where a weight has just become full the sliding mode is over */
        if (fits && !before[hit])
            fits = relays.side[hit] == (y[3 + hit] > 0.0 ? 1 : -1);
        if (fits && (!before[hit] || follows(y, at))) {
            memcpy(now, relays.side, sizeof now);
            found++;
            if (!before[hit])
                break;
        }
    }
    CHECK(found == 1);
    memcpy(relays.side, now, sizeof now);
    for (i = 0; i < relays.n; i++) {
        if (relays.side[i] != before[i]) {
            struct event *e = &end->events[end->n_events++];
            e->t = t;
            e->surface = i;
            e->kind = !relays.side[i] ? SWB_EVENT_KIND_ENTER : before[i] ? SWB_EVENT_KIND_CROSS : SWB_EVENT_KIND_LEAVE;
            relays.watched[i] = 0;
        }
    }
    weights(y, y + 3);
}

static void solve_relays(double rtol, struct end *end)
{
    static const int differential[] = {1, 1, 1, 0, 0};
    struct dae dae = {5, relays_dae, differential, 2, relays_roots};
    double y[MAX_STATES] = {0}, yp[MAX_STATES], t = 0.0, zero[MAX_STATES] = {0};
    int i;

    memcpy(y, X0_RELAYS, (size_t)(1 + relays.n) * sizeof *y);
    end->nx = 1 + relays.n;
    end->n_events = 0;
    for (i = 0; i < relays.n; i++) {
        relays.side[i] = y[1 + i] > surface(i, y[0]) ? 1 : -1;
        relays.watched[i] = 1;
    }
    weights(y, y + 3);
    while (t < T_RELAYS && end->n_events < MAX_EVENTS) {
        int blind = !relays.watched[0] || (relays.n == 2 && !relays.watched[1]);
        double until = blind ? fmin(t + BLIND, T_RELAYS) : T_RELAYS;
        relays_dae(t, y, zero, yp);
        yp[3] = yp[4] = 0.0;
        t = idas_solve(&dae, t, until, y, yp, rtol);
        if (t < until)
            switch_sides(y, t, end);
        else
            relays.watched[0] = 1, relays.watched[1] = relays.n == 2;
    }
    CHECK(t == T_RELAYS);
    memcpy(end->x, y, sizeof end->x);
}

static int32_t relays_f0(const swb_point *at, double *out, void *user_data)
{
    double y[3] = {0}, a[2];
    int n = *(int *)user_data, i;
    memcpy(y, at->x, (size_t)(1 + n) * sizeof *y);
    pull(y, a);
    out[0] = speed(y);
    for (i = 0; i < n; i++)
        out[1 + i] = a[i];
    return 0;
}

/* The two modes of relay j: w_j = 1 and w_j = -1. */
static void relay_modes(int j, int n, double *out)
{
    int i;
    for (i = 0; i < n; i++) {
        out[i] = -B[i][j];
        out[n + i] = B[i][j];
    }
}
static int32_t first_modes(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    relay_modes(0, *(int *)user_data, out);
    return 0;
}
static int32_t second_modes(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    relay_modes(1, *(int *)user_data, out);
    return 0;
}
/* Columns: the clock, y_1, y_2. */
static int32_t relays_f0_jacobian(const swb_point *at, double *out, void *user_data)
{
    int n = *(int *)user_data;
    double z = at->x[0], all[9] = {0};
    int i, j;
    all[1] = 1.3 * 1.3 * cos(1.3 * z);
    all[2] = -1.2 * 1.1 * sin(1.1 * z + 0.3);
    all[3] = 0.4 * at->x[1];
    all[5] = -0.2;
    all[7] = 0.3;
    for (j = 0; j <= n; j++)
        for (i = 0; i <= n; i++)
            out[(1 + n) * j + i] = all[3 * j + i];
    return 0;
}
static int32_t surface_gradient(const swb_point *at, double *out, int j)
{
    out[0] = -surface_slope(j, at->x[0]);
    out[1] = 1.0;
    return 0;
}
static int32_t first_gradient(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    return surface_gradient(at, out, 0);
}
static int32_t second_gradient(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    return surface_gradient(at, out, 1);
}
static int32_t first_surface(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1] - surface(0, at->x[0]);
    return 0;
}
static int32_t second_surface(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[2] - surface(1, at->x[0]);
    return 0;
}

static swb_system *make_relays(int *n)
{
    static const swb_value_fn modes[] = {first_modes, second_modes}, surfaces[] = {first_surface, second_surface};
    static const int64_t rows[] = {1, 2};
    static const int8_t signs[] = {1, -1};
    static const swb_jacobian_fn gradients[] = {first_gradient, second_gradient};
    static const int64_t rows_2[] = {0, 1, 0, 1}, rows_3[] = {0, 1, 2, 0, 1, 2, 0, 1, 2}, one_row[] = {0, 0};
    const int64_t nx = 1 + *n;
    swb_function *f0 = make_function("f0", nx, 0, 0, nx, relays_f0, n);
    swb_system *system = NULL;
    int64_t columns[5], i;
    int j;

    /* columns of the clock, the y and the time */
    for (j = 0; j <= nx + 1; j++)
        columns[j] = nx * (j <= nx ? j : nx);
    CHECK_OK(swb_function_set_jacobian(f0, columns, nx + 2, nx == 2 ? rows_2 : rows_3, nx * nx, relays_f0_jacobian));
    CHECK_OK(swb_system_create(nx, 0, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f0));
    for (j = 0; j < *n; j++) {
        swb_function *m = make_function("F", nx, 0, 0, 2 * *n, modes[j], n), *c = make_function("c", nx, 0, 0, 1, surfaces[j], n);
        CHECK_OK(swb_function_set_linear(m));
        for (i = 0; i <= nx + 1; i++)
            columns[i] = (i > 0) + (i > 1 + j);
        CHECK_OK(swb_function_set_jacobian(c, columns, nx + 2, one_row, 2, gradients[j]));
        CHECK_OK(swb_system_add_subsystem(system, rows, *n, m, 2, c, signs, 2, NULL));
        swb_function_free(m);
        swb_function_free(c);
    }
    swb_function_free(f0);
    return system;
}

/* n relays; how often surfaces are crossed, entered and left is part of what is checked. */
static void relays_run(const char *name, int n, int crossed, int entered, int left)
{
    swb_system *system = make_relays(&n);
    struct end idas;
    double error;
    int count[3] = {0, 0, 0}, i;

    relays.n = n;
    error = refine(solve_relays, &idas);
    for (i = 0; i < idas.n_events; i++) {
        const struct event *e = &idas.events[i];
        count[0] += e->kind == SWB_EVENT_KIND_CROSS;
        count[1] += e->kind == SWB_EVENT_KIND_ENTER;
        count[2] += e->kind == SWB_EVENT_KIND_LEAVE;
        printf("%-26s t = %.13f: surface %d, %s\n", name, e->t, e->surface,
               e->kind == SWB_EVENT_KIND_CROSS ? "crossed" : e->kind == SWB_EVENT_KIND_ENTER ? "entered" : "left");
    }
    printf("%-26s error of IDAS %.1e\n", name, error);
    CHECK(count[0] == crossed && count[1] == entered && count[2] == left);
    compare(name, system, X0_RELAYS, 0.0, T_RELAYS, &idas, error);
    swb_system_free(system);
}

int main(void)
{
    smooth_phases();
    relays_run("relay", 1, 0, 3, 2);
    relays_run("two relays", 2, 1, 5, 3);
    return CHECK_DONE();
}
