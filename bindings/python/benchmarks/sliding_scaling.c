/* Chains of blocks with friction and rows of rooms with thermostats by CVODE (Adams), a rod with one thermostat by CVODE (BDF,
 * banded), with the logic of modes that a user writes: sliding_scaling.py compiles and runs this. Arguments: chain, rooms or
 * rod, their number or that of its nodes, the longest step, the relative tolerance. */
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

/* mode: side of the surface, 0 on it */
struct model {
    int n, rooms, *mode;
    double *level;
    /* nodes of a rod, 0 without one, and that of its heater and sensor */
    int nodes, heated;
};

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

static double outside(double t)
{
    return 8 + 10 * sin(1.3 * t);
}

static double losses(const struct model *m, double t, const double *x, int i)
{
    double c = 0;
    if (i)
        c += x[i - 1] - x[i];
    if (i < m->n - 1)
        c += x[i + 1] - x[i];
    return (1 + 0.05 * (i % 5)) * (outside(t) - x[i]) + 0.5 * c;
}

static double heater(int i)
{
    return 9 + 0.3 * (i % 3);
}

/* Heat that flows to a node of the rod: insulated at its beginning, the temperature outside at its end. */
static double conduction(const struct model *m, double t, const double *x, int i)
{
    const double air = 8 + 14 * sin(1.3 * t), before = i ? x[i - 1] : x[i], behind = i < m->nodes - 1 ? x[i + 1] : air;
    return 0.2 * m->nodes * m->nodes * (before - 2 * x[i] + behind) + 0.3 * (air - x[i]);
}

static double power(const struct model *m)
{
    return 2.0 * m->nodes;
}

static int rod_rhs(double t, N_Vector state, N_Vector rate, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    double *d = N_VGetArrayPointer(rate);
    for (int i = 0; i < m->nodes; i++)
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

static void rod_change(struct model *m, double t, double *x)
{
    if (m->mode[0])
        x[m->heated] = m->level[0];
    const double s = 1 + conduction(m, t, x, m->heated) / power(m);
    m->mode[0] = m->mode[0] && fabs(s) <= 1 ? 0 : s > 0 ? 1 : -1;
}

static int rhs(double t, N_Vector state, N_Vector rate, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    double *d = N_VGetArrayPointer(rate);
    for (int i = 0; i < m->n; i++) {
        const int s = m->mode[i];
        if (m->rooms) {
            d[i] = s ? losses(m, t, x, i) + heater(i) * (1 - s) : 0;
        } else {
            d[2 * i] = x[2 * i + 1];
            d[2 * i + 1] = s ? spring(m, x, i) + friction(i) * s / (1 + 2.5 * s * (0.1 - x[2 * i + 1])) : 0;
        }
    }
    return 0;
}

static int root(double t, N_Vector state, double *g, void *data)
{
    const struct model *m = data;
    const double *x = N_VGetArrayPointer(state);
    for (int i = 0; i < m->n; i++) {
        if (m->rooms)
            g[i] = m->mode[i] ? x[i] - m->level[i] : 1 - fabs(1 + losses(m, t, x, i) / heater(i));
        else
            g[i] = m->mode[i] ? 0.1 - x[2 * i + 1] : friction(i) - fabs(spring(m, x, i));
    }
    return 0;
}

static void change(struct model *m, double t, double *x, int i)
{
    if (m->rooms) {
        if (m->mode[i])
            x[i] = m->level[i];
        const double s = 1 + losses(m, t, x, i) / heater(i);
        m->mode[i] = m->mode[i] && fabs(s) <= 1 ? 0 : s > 0 ? 1 : -1;
    } else {
        const double f = spring(m, x, i);
        if (m->mode[i])
            x[2 * i + 1] = 0.1;
        m->mode[i] = m->mode[i] && fabs(f) <= friction(i) ? 0 : f > 0 ? -1 : 1;
    }
}

static void start(struct model *m, double *x)
{
    if (m->nodes) {
        for (int i = 0; i < m->nodes; i++)
            x[i] = 15;
        m->level[0] = 20;
        m->mode[0] = -1;
        return;
    }
    for (int i = 0; i < m->n; i++) {
        if (m->rooms) {
            m->level[i] = 20 + 0.1 * (i % 4) + 0.01 * sin(i);
            x[i] = 18 + 2 * sin(2.1 * i);
            m->mode[i] = x[i] > m->level[i] ? 1 : -1;
        } else {
            x[2 * i] = 0.3 * sin(1.7 * i + 0.3);
            x[2 * i + 1] = 0;
            m->mode[i] = 1;
        }
    }
}

/* Switches until the end, negative on failure. */
static int run(struct model *m, double rtol, double h_max, double end, double *sum)
{
    const int n = m->n, nx = m->nodes ? m->nodes : m->rooms ? n : 2 * n;
    int switches = 0, *found = malloc((size_t)n * sizeof *found);
    double t = 0;
    SUNContext context;
    if (!found || SUNContext_Create(NULL, &context))
        return -1;
    N_Vector y = N_VNew_Serial(nx, context);
    double *x = N_VGetArrayPointer(y);
    start(m, x);
    void *memory = CVodeCreate(m->nodes ? CV_BDF : CV_ADAMS, context);
    SUNNonlinearSolver solver = m->nodes ? NULL : SUNNonlinSol_FixedPoint(y, 0, context);
    SUNMatrix band = m->nodes ? SUNBandMatrix(nx, 1, 1, context) : NULL;
    SUNLinearSolver linear = m->nodes ? SUNLinSol_Band(y, band, context) : NULL;
    int bad = CVodeInit(memory, m->nodes ? rod_rhs : rhs, 0, y) || CVodeSStolerances(memory, rtol, 0.01 * rtol) ||
              CVodeSetUserData(memory, m) || CVodeRootInit(memory, n, m->nodes ? rod_root : root) ||
              CVodeSetMaxNumSteps(memory, 10000000) || CVodeSetMaxStep(memory, h_max) ||
              (m->nodes ? CVodeSetLinearSolver(memory, linear, band) : CVodeSetNonlinearSolver(memory, solver)) ||
              CVodeSetNoInactiveRootWarn(memory) || CVodeSetStopTime(memory, end);
    while (!bad && t < end) {
        const int reason = CVode(memory, end, y, &t, CV_NORMAL);
        bad = reason < 0;
        if (reason == CV_ROOT_RETURN) {
            bad = CVodeGetRootInfo(memory, found);
            for (int i = 0; i < n; i++)
                if (found[i]) {
                    if (m->nodes)
                        rod_change(m, t, x);
                    else
                        change(m, t, x, i);
                    switches++;
                }
            bad = bad || CVodeReInit(memory, t, y) || CVodeSetStopTime(memory, end);
        }
    }
    *sum = 0;
    for (int i = 0; i < nx; i++)
        *sum += x[i];
    CVodeFree(&memory);
    if (m->nodes) {
        SUNLinSolFree(linear);
        SUNMatDestroy(band);
    } else {
        SUNNonlinSolFree(solver);
    }
    N_VDestroy(y);
    SUNContext_Free(&context);
    free(found);
    return bad ? -1 : switches;
}

int main(int count, char **values)
{
    if (count != 5)
        return 2;
    const int n = atoi(values[2]);
    const int rod = strcmp(values[1], "rod") == 0;
    struct model m = {rod ? 1 : n, strcmp(values[1], "rooms") == 0, calloc((size_t)n, sizeof(int)),
                      calloc((size_t)n, sizeof(double)), rod ? n : 0, n / 4};
    double best = HUGE_VAL, sum = 0;
    int switches = 0;
    if (n < 1 || !m.mode || !m.level)
        return 2;
    for (int i = 0; i < 5; i++) {
        const clock_t clock_before = clock();
        switches = run(&m, atof(values[4]), atof(values[3]), m.nodes ? 12 : m.rooms ? 6 : 8, &sum);
        best = fmin(best, (double)(clock() - clock_before) / CLOCKS_PER_SEC);
        if (switches < 0)
            return 1;
    }
    printf("%.9f %d %.12f\n", best, switches, sum);
    free(m.mode);
    free(m.level);
    return 0;
}
