/* Circuits and relays whose modes are affine, by CVODE: work_precision.py writes the modes, compiles this and runs it.
 *
 * What a user of CVODE writes by hand: the right-hand side of the present mode with its Jacobian, a root function for each way
 * out of the mode, a restart in the mode behind it, and stops at the ticks of the clock, so that no step looks across one.
 *
 * Standard input: n, modes, period (0: no clock), end, checks, first mode, the start; then for every mode its matrix by rows,
 * its constant, the mode behind a tick (-1: the same), the state that is 0 in this mode (-1: none), the number of ways out and
 * for each the mode behind it, weights of the states, constant, slope over the time since the last tick: it is left where
 * weights x + constant + slope (t - tick) falls below 0. Then sizes of the states. Arguments: adams or bdf, the relative
 * tolerance, the longest step (0: no limit), how often to run. Output: shortest CPU time, switches, right-hand sides, and the
 * states at the checks. */
#include <cvode/cvode.h>
#include <float.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <time.h>

enum { STATES = 4, MODES = 4, WAYS = 3, CHECKS = 100 };

struct way {
    int target;
    double weights[STATES], constant, slope;
};

struct mode {
    double a[STATES][STATES], b[STATES];
    int tick, zero, ways;
    struct way out[WAYS];
};

struct problem {
    int n, modes, first, checks, mode;
    double period, end, tick, start[STATES], sizes[STATES];
    struct mode all[MODES];
};

static int rhs(double t, N_Vector state, N_Vector rate, void *data)
{
    const struct problem *p = data;
    const struct mode *m = &p->all[p->mode];
    const double *x = N_VGetArrayPointer(state);
    double *d = N_VGetArrayPointer(rate);
    (void)t;
    for (int i = 0; i < p->n; i++) {
        d[i] = m->b[i];
        for (int j = 0; j < p->n; j++)
            d[i] += m->a[i][j] * x[j];
    }
    return 0;
}

static int jacobian(double t, N_Vector x, N_Vector f, SUNMatrix out, void *data, N_Vector a, N_Vector b, N_Vector c)
{
    const struct problem *p = data;
    (void)t, (void)x, (void)f, (void)a, (void)b, (void)c;
    for (int i = 0; i < p->n; i++)
        for (int j = 0; j < p->n; j++)
            SM_ELEMENT_D(out, i, j) = p->all[p->mode].a[i][j];
    return 0;
}

static double margin(const struct problem *p, const struct way *w, double t, const double *x)
{
    double g = w->constant + w->slope * (t - p->tick);
    for (int j = 0; j < p->n; j++)
        g += w->weights[j] * x[j];
    return g;
}

static int root(double t, N_Vector state, double *g, void *data)
{
    const struct problem *p = data;
    const struct mode *m = &p->all[p->mode];
    for (int i = 0; i < WAYS; i++)
        g[i] = i < m->ways ? margin(p, &m->out[i], t, N_VGetArrayPointer(state)) : 1;
    return 0;
}

/* Into a mode, and on through modes whose way out lies behind already. */
static void enter(struct problem *p, int mode, double t, double *x)
{
    for (int k = 0; k < 2 * MODES; k++) {
        const struct mode *m = &p->all[mode];
        int next = mode;
        p->mode = mode;
        if (m->zero >= 0)
            x[m->zero] = 0;
        for (int i = 0; i < m->ways && next == mode; i++)
            if (margin(p, &m->out[i], t, x) < 0)
                next = m->out[i].target;
        if (next == mode)
            return;
        mode = next;
    }
}

/* Switches until the end, negative on failure. */
static int run(struct problem *p, int adams, double tol, double longest, double *states, long *evaluations)
{
    const int n = p->n;
    int switches = 0, found[WAYS], ticks = 0, check = 0;
    double t = 0;
    SUNContext context;
    if (SUNContext_Create(NULL, &context))
        return -1;
    N_Vector y = N_VNew_Serial(n, context), atol = N_VNew_Serial(n, context);
    double *x = N_VGetArrayPointer(y);
    for (int i = 0; i < n; i++) {
        x[i] = p->start[i];
        NV_Ith_S(atol, i) = 1e-2 * tol * p->sizes[i];
    }
    p->tick = 0;
    enter(p, p->first, 0, x);
    void *memory = CVodeCreate(adams ? CV_ADAMS : CV_BDF, context);
    SUNNonlinearSolver solver = adams ? SUNNonlinSol_FixedPoint(y, 0, context) : NULL;
    SUNMatrix dense = adams ? NULL : SUNDenseMatrix(n, n, context);
    SUNLinearSolver linear = adams ? NULL : SUNLinSol_Dense(y, dense, context);
    int bad = CVodeInit(memory, rhs, 0, y) || CVodeSVtolerances(memory, tol, atol) || CVodeSetUserData(memory, p) ||
              CVodeRootInit(memory, WAYS, root) || CVodeSetMaxNumSteps(memory, 100000000) ||
              CVodeSetNoInactiveRootWarn(memory) || (longest > 0 && CVodeSetMaxStep(memory, longest)) ||
              (adams ? CVodeSetNonlinearSolver(memory, solver)
                     : CVodeSetLinearSolver(memory, linear, dense) || CVodeSetJacFn(memory, jacobian));
    *evaluations = 0;
    while (!bad && check < p->checks) {
        const double at = p->end * (check + 1) / p->checks;
        const double tick = p->period > 0 ? (ticks + 1) * p->period : DBL_MAX;
        const int clock_first = tick <= at * (1 + 1e-12);
        const double stop = clock_first ? tick : at;
        const int before = p->mode;
        long count = 0;
        bad = CVodeSetStopTime(memory, stop);
        const int reason = bad ? -1 : CVode(memory, stop, y, &t, CV_NORMAL);
        bad = reason < 0;
        if (bad)
            break;
        if (reason == CV_ROOT_RETURN) {
            bad = CVodeGetRootInfo(memory, found);
            for (int i = 0; i < p->all[before].ways; i++)
                if (found[i] < 0) {
                    enter(p, p->all[before].out[i].target, t, x);
                    break;
                }
        } else {
            if (fabs(stop - at) <= 1e-12 * at) {
                memcpy(states + n * check, x, (size_t)n * sizeof *x);
                check++;
            }
            if (clock_first) {
                ticks++;
                p->tick = t = tick;
                enter(p, p->all[before].tick >= 0 ? p->all[before].tick : before, t, x);
            }
        }
        if (reason == CV_ROOT_RETURN || clock_first) {
            switches += p->mode != before;
            CVodeGetNumRhsEvals(memory, &count);
            *evaluations += count;
            bad = CVodeReInit(memory, t, y);
        }
    }
    CVodeFree(&memory);
    if (adams) {
        SUNNonlinSolFree(solver);
    } else {
        SUNLinSolFree(linear);
        SUNMatDestroy(dense);
    }
    N_VDestroy(y);
    N_VDestroy(atol);
    SUNContext_Free(&context);
    return bad ? -1 : switches;
}

static int numbers(double *out, int n)
{
    for (int i = 0; i < n; i++)
        if (scanf("%lf", &out[i]) != 1)
            return 0;
    return 1;
}

static int whole(int *out, int least, int most)
{
    return scanf("%d", out) == 1 && *out >= least && *out <= most;
}

static int read_problem(struct problem *p)
{
    if (!whole(&p->n, 1, STATES) || !whole(&p->modes, 1, MODES) || !numbers(&p->period, 1) || !numbers(&p->end, 1) ||
        !whole(&p->checks, 1, CHECKS) || !whole(&p->first, 0, p->modes - 1) || !numbers(p->start, p->n))
        return 0;
    for (int k = 0; k < p->modes; k++) {
        struct mode *m = &p->all[k];
        for (int i = 0; i < p->n; i++)
            if (!numbers(m->a[i], p->n))
                return 0;
        if (!numbers(m->b, p->n) || !whole(&m->tick, -1, p->modes - 1) || !whole(&m->zero, -1, p->n - 1) ||
            !whole(&m->ways, 0, WAYS))
            return 0;
        for (int i = 0; i < m->ways; i++) {
            struct way *w = &m->out[i];
            if (!whole(&w->target, 0, p->modes - 1) || !numbers(w->weights, p->n) || !numbers(&w->constant, 1) ||
                !numbers(&w->slope, 1))
                return 0;
        }
    }
    return numbers(p->sizes, p->n);
}

int main(int count, char **values)
{
    static struct problem p;
    static double states[STATES * CHECKS];
    double best = HUGE_VAL;
    int switches = 0;
    long evaluations = 0;
    if (count != 5 || !read_problem(&p))
        return 2;
    for (int i = 0; i < atoi(values[4]); i++) {
        const clock_t clock_before = clock();
        switches = run(&p, strcmp(values[1], "adams") == 0, atof(values[2]), atof(values[3]), states, &evaluations);
        best = fmin(best, (double)(clock() - clock_before) / CLOCKS_PER_SEC);
        if (switches < 0)
            return 1;
    }
    printf("%.9f %d %ld", best, switches, evaluations);
    for (int i = 0; i < p.n * p.checks; i++)
        printf(" %.17g", states[i]);
    printf("\n");
    return 0;
}
