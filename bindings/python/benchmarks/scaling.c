/* Many units that switch by CVODE, with the logic of modes that a user writes: scaling.py compiles and runs this.
 * Arguments: the kind of the units, their number or that of the nodes of a rod, the longest step (0: any), the relative tolerance,
 * and optionally a file for the units that switch and their times. Adams; for the rod BDF with a banded Jacobian. */
#include <cvode/cvode.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sunlinsol/sunlinsol_band.h>
#include <sunmatrix/sunmatrix_band.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <time.h>

struct model;

struct kind {
    const char *name;
    double end;
    void (*start)(struct model *, double *x);
    int (*rhs)(double t, N_Vector state, N_Vector rate, void *data);
    int (*root)(double t, N_Vector state, double *g, void *data);
    /* root i vanishes */
    void (*change)(struct model *, double t, double *x, int i);
};

/* mode: side of the surface, 0 on it; or whether a heater is on */
struct model {
    const struct kind *kind;
    int n, nx, roots, *mode;
    double *level, *rate, *drive, *kick;
    /* where the heater and the sensor of a rod are */
    int heated;
    double coupling;
    int switches;
    FILE *log;
};

static void note(struct model *m, double t, int unit)
{
    m->switches++;
    if (m->log)
        fprintf(m->log, "%d %.17g\n", unit, t);
}

/* Numbers between 0 and 1, the same as in scaling.py. */
static double part(int i, int of)
{
    return fmod(0.61803398875 * (i + 1) * (of + 1) + 0.31 * of, 1);
}

static double outside(double t)
{
    return 8 + 10 * sin(1.3 * t);
}

/* Differences to the neighbours in a row of n. */
static double neighbours(const double *x, int n, int i)
{
    double c = 0;
    if (i)
        c += x[i - 1] - x[i];
    if (i < n - 1)
        c += x[i + 1] - x[i];
    return c;
}

/* Blocks on a belt, coupled by springs, with friction that falls with the speed. */

static double spring(const struct model *m, const double *x, int i)
{
    double c = 0;
    if (i)
        c += x[2 * i - 2] - x[2 * i];
    if (i < m->n - 1)
        c += x[2 * i + 2] - x[2 * i];
    return 2 * c - x[2 * i];
}

static double friction(int i)
{
    return 1 + 0.02 * (i % 7);
}

static void chain_start(struct model *m, double *x)
{
    for (int i = 0; i < m->n; i++) {
        x[2 * i] = 0.3 * sin(1.7 * i + 0.3);
        x[2 * i + 1] = 0;
        m->mode[i] = 1;
    }
}

static int chain_rhs(double t, N_Vector state, N_Vector rate, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    double *d = N_VGetArrayPointer(rate);
    (void)t;
    for (int i = 0; i < m->n; i++) {
        const int s = m->mode[i];
        d[2 * i] = x[2 * i + 1];
        d[2 * i + 1] = s ? spring(m, x, i) + friction(i) * s / (1 + 2.5 * s * (0.1 - x[2 * i + 1])) : 0;
    }
    return 0;
}

static int chain_root(double t, N_Vector state, double *g, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    (void)t;
    for (int i = 0; i < m->n; i++)
        g[i] = m->mode[i] ? 0.1 - x[2 * i + 1] : friction(i) - fabs(spring(m, x, i));
    return 0;
}

static void chain_change(struct model *m, double t, double *x, int i)
{
    const double f = spring(m, x, i);
    if (m->mode[i])
        x[2 * i + 1] = 0.1;
    m->mode[i] = m->mode[i] && fabs(f) <= friction(i) ? 0 : f > 0 ? -1 : 1;
    note(m, t, i);
}

/* Rooms that lose heat to each other and to the outside, each with an ideal thermostat. */

static double losses(const struct model *m, double t, const double *x, int i)
{
    return (1 + 0.05 * (i % 5)) * (outside(t) - x[i]) + 0.5 * neighbours(x, m->n, i);
}

static double heater(int i)
{
    return 9 + 0.3 * (i % 3);
}

static void rooms_start(struct model *m, double *x)
{
    for (int i = 0; i < m->n; i++) {
        m->level[i] = 20 + 0.1 * (i % 4) + 0.01 * sin(i);
        x[i] = 18 + 2 * sin(2.1 * i);
        m->mode[i] = x[i] > m->level[i] ? 1 : -1;
    }
}

static int rooms_rhs(double t, N_Vector state, N_Vector rate, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    double *d = N_VGetArrayPointer(rate);
    for (int i = 0; i < m->n; i++) {
        const int s = m->mode[i];
        d[i] = s ? losses(m, t, x, i) + heater(i) * (1 - s) : 0;
    }
    return 0;
}

static int rooms_root(double t, N_Vector state, double *g, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    for (int i = 0; i < m->n; i++)
        g[i] = m->mode[i] ? x[i] - m->level[i] : 1 - fabs(1 + losses(m, t, x, i) / heater(i));
    return 0;
}

static void rooms_change(struct model *m, double t, double *x, int i)
{
    if (m->mode[i])
        x[i] = m->level[i];
    const double s = 1 + losses(m, t, x, i) / heater(i);
    m->mode[i] = m->mode[i] && fabs(s) <= 1 ? 0 : s > 0 ? 1 : -1;
    note(m, t, i);
}

/* Heat that flows to a node of a rod: insulated at its beginning, the temperature outside at its end. One ideal thermostat. */

static double conduction(const struct model *m, double t, const double *x, int i)
{
    const double air = 8 + 14 * sin(1.3 * t), before = i ? x[i - 1] : x[i], behind = i < m->nx - 1 ? x[i + 1] : air;
    return 0.2 * m->nx * m->nx * (before - 2 * x[i] + behind) + 0.3 * (air - x[i]);
}

static double power(const struct model *m)
{
    return 2.0 * m->nx;
}

static void rod_start(struct model *m, double *x)
{
    for (int i = 0; i < m->nx; i++)
        x[i] = 15;
    m->level[0] = 20;
    m->mode[0] = -1;
}

static int rod_rhs(double t, N_Vector state, N_Vector rate, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    double *d = N_VGetArrayPointer(rate);
    for (int i = 0; i < m->nx; i++)
        d[i] = conduction(m, t, x, i);
    const int s = m->mode[0];
    d[m->heated] = s ? d[m->heated] + power(m) * (1 - s) : 0;
    return 0;
}

static int rod_root(double t, N_Vector state, double *g, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    g[0] = m->mode[0] ? x[m->heated] - m->level[0] : 1 - fabs(1 + conduction(m, t, x, m->heated) / power(m));
    return 0;
}

static void rod_change(struct model *m, double t, double *x, int i)
{
    if (m->mode[0])
        x[m->heated] = m->level[0];
    const double s = 1 + conduction(m, t, x, m->heated) / power(m);
    m->mode[0] = m->mode[0] && fabs(s) <= 1 ? 0 : s > 0 ? 1 : -1;
    note(m, t, i);
}

/* Rooms whose thermostats have hysteresis. */

static void hystereses_start(struct model *m, double *x)
{
    for (int i = 0; i < m->n; i++) {
        m->level[i] = 18 + 4 * part(i, 0);
        m->rate[i] = 0.8 + 0.4 * part(i, 1);
        x[i] = m->level[i] + 0.8 * part(i, 2) - 0.4;
        m->mode[i] = 0;
    }
}

static void row_start(struct model *m, double *x)
{
    hystereses_start(m, x);
    m->coupling = 0.1;
}

static int hystereses_rhs(double t, N_Vector state, N_Vector rate, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state), air = outside(t);
    double *d = N_VGetArrayPointer(rate);
    for (int i = 0; i < m->n; i++)
        d[i] = m->rate[i] * (air - x[i]) + 25.0 * m->mode[i];
    if (m->coupling > 0)
        for (int i = 0; i < m->n; i++)
            d[i] += m->coupling * neighbours(x, m->n, i);
    return 0;
}

static int hystereses_root(double t, N_Vector state, double *g, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    (void)t;
    for (int i = 0; i < m->n; i++)
        g[i] = m->level[i] - x[i] + (m->mode[i] ? 0.5 : -0.5);
    return 0;
}

static void hystereses_change(struct model *m, double t, double *x, int i)
{
    (void)x;
    m->mode[i] = !m->mode[i];
    note(m, t, i);
}

/* Integrate-and-fire neurons that move others when they fire. */

static void neurons_start(struct model *m, double *x)
{
    for (int i = 0; i < m->n; i++) {
        m->rate[i] = 1 / (1 + 0.2 * part(i, 1));
        m->drive[i] = 1.05 + 0.3 * part(i, 0);
        x[i] = part(i, 3);
    }
    for (int i = 0; i < 2 * m->n; i++)
        m->kick[i] = 0.02 * (part(i, 2) - 0.5);
}

static int neurons_rhs(double t, N_Vector state, N_Vector rate, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    double *d = N_VGetArrayPointer(rate);
    (void)t;
    for (int i = 0; i < m->n; i++)
        d[i] = (m->drive[i] - x[i]) * m->rate[i];
    return 0;
}

static int neurons_root(double t, N_Vector state, double *g, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    (void)t;
    for (int i = 0; i < m->n; i++)
        g[i] = x[i] - 1;
    return 0;
}

static void fire(struct model *m, double t, double *x, int i, int of_ring)
{
    const int to[2] = {of_ring ? (i + m->n - 1) % m->n : 0, of_ring ? (i + 1) % m->n : 0};
    x[i] -= 1;
    note(m, t, i);
    for (int k = 0; k < 1 + of_ring; k++)
        if (to[k] != i)
            x[to[k]] += m->kick[i + to[k]];
    for (int k = 0; k < 1 + of_ring; k++)
        if (to[k] != i && x[to[k]] > 1)
            fire(m, t, x, to[k], of_ring);
}

static void ring_change(struct model *m, double t, double *x, int i)
{
    fire(m, t, x, i, 1);
}

static void hub_change(struct model *m, double t, double *x, int i)
{
    fire(m, t, x, i, 0);
}

static const struct kind kinds[] = {
    {"chain", 8, chain_start, chain_rhs, chain_root, chain_change},
    {"rooms", 6, rooms_start, rooms_rhs, rooms_root, rooms_change},
    {"rod", 12, rod_start, rod_rhs, rod_root, rod_change},
    {"apart", 2, hystereses_start, hystereses_rhs, hystereses_root, hystereses_change},
    {"row", 2, row_start, hystereses_rhs, hystereses_root, hystereses_change},
    {"ring", 10, neurons_start, neurons_rhs, neurons_root, ring_change},
    {"hub", 10, neurons_start, neurons_rhs, neurons_root, hub_change},
};

/* Goes to the end; negative on failure. */
static int run(struct model *m, double rtol, double h_max, double *sum)
{
    const int rod = m->kind->rhs == rod_rhs;
    int *found = malloc((size_t)m->roots * sizeof *found);
    double t = 0;
    SUNContext context;
    if (!found || SUNContext_Create(NULL, &context))
        return -1;
    N_Vector y = N_VNew_Serial(m->nx, context);
    double *x = N_VGetArrayPointer(y);
    m->switches = 0;
    m->kind->start(m, x);
    void *memory = CVodeCreate(rod ? CV_BDF : CV_ADAMS, context);
    SUNNonlinearSolver solver = rod ? NULL : SUNNonlinSol_FixedPoint(y, 0, context);
    SUNMatrix band = rod ? SUNBandMatrix(m->nx, 1, 1, context) : NULL;
    SUNLinearSolver linear = rod ? SUNLinSol_Band(y, band, context) : NULL;
    int bad = CVodeInit(memory, m->kind->rhs, 0, y) || CVodeSStolerances(memory, rtol, 0.01 * rtol) ||
              CVodeSetUserData(memory, m) || CVodeRootInit(memory, m->roots, m->kind->root) ||
              CVodeSetMaxNumSteps(memory, 10000000) || CVodeSetMaxStep(memory, h_max) ||
              (rod ? CVodeSetLinearSolver(memory, linear, band) : CVodeSetNonlinearSolver(memory, solver)) ||
              CVodeSetNoInactiveRootWarn(memory) || CVodeSetStopTime(memory, m->kind->end);
    while (!bad && t < m->kind->end) {
        const int reason = CVode(memory, m->kind->end, y, &t, CV_NORMAL);
        bad = reason < 0;
        if (reason == CV_ROOT_RETURN) {
            bad = CVodeGetRootInfo(memory, found);
            for (int i = 0; i < m->roots; i++)
                if (found[i])
                    m->kind->change(m, t, x, i);
            bad = bad || CVodeReInit(memory, t, y) || CVodeSetStopTime(memory, m->kind->end);
        }
    }
    *sum = 0;
    for (int i = 0; i < m->nx; i++)
        *sum += x[i];
    CVodeFree(&memory);
    if (rod) {
        SUNLinSolFree(linear);
        SUNMatDestroy(band);
    } else {
        SUNNonlinSolFree(solver);
    }
    N_VDestroy(y);
    SUNContext_Free(&context);
    free(found);
    return bad ? -1 : 0;
}

int main(int count, char **values)
{
    const int n = count == 5 || count == 6 ? atoi(values[2]) : 0;
    const struct kind *kind = NULL;
    for (size_t i = 0; count > 1 && i < sizeof kinds / sizeof *kinds; i++)
        kind = strcmp(values[1], kinds[i].name) ? kind : &kinds[i];
    if (n < 1 || !kind)
        return 2;
    const int rod = kind->rhs == rod_rhs;
    const size_t own = (size_t)n;
    struct model m = {.kind = kind,
                      .n = rod ? 1 : n,
                      .nx = kind->rhs == chain_rhs ? 2 * n : n,
                      .roots = rod ? 1 : n,
                      .mode = calloc(own, sizeof(int)),
                      .level = calloc(own, sizeof(double)),
                      .rate = calloc(own, sizeof(double)),
                      .drive = calloc(own, sizeof(double)),
                      .kick = calloc(2 * own, sizeof(double)),
                      .heated = n / 4};
    double best = HUGE_VAL, sum = 0;
    if (!m.mode || !m.level || !m.rate || !m.drive || !m.kick)
        return 2;
    if (count == 6 && !(m.log = fopen(values[5], "w")))
        return 2;
    /* until it has taken a fifth of a second, or five times */
    double spent = 0;
    for (int i = 0; i < (m.log ? 1 : 5) && (i == 0 || spent < 0.2); i++) {
        const clock_t before = clock();
        if (run(&m, atof(values[4]), atof(values[3]), &sum))
            return 1;
        const double taken = (double)(clock() - before) / CLOCKS_PER_SEC;
        best = fmin(best, taken);
        spent += taken;
    }
    if (m.log)
        fclose(m.log);
    printf("%.9f %d %.12f\n", best, m.switches, sum);
    free(m.mode);
    free(m.level);
    free(m.rate);
    free(m.drive);
    free(m.kick);
    return 0;
}
