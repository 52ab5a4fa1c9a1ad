/* Contacts event-driven beside CVODE with the modes written by hand: an oscillator that hits a stop, a block on a shaken slope,
 * a disc that starts to roll. Both at the same tolerances, in one run; best of several. Prints errors against a run at 1e-13.
 *
 * usage: contacts_cvode [RTOL] */
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <switchback.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>
#if SUNDIALS_VERSION_MAJOR < 7
#define SUN_COMM_NULL NULL
#endif

#define G 9.81
enum { RUNS = 30, MOST = 6 };

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void must(int ok, const char *what)
{
    if (!ok) {
        fprintf(stderr, "%s: %s\n", what, swb_last_error());
        exit(1);
    }
}

/* --- the problems by hand: right-hand side, root and what happens there, by mode ------------------------------------- */

struct problem {
    const char *name;
    int n, modes;
    double x0[MOST], end, longest;
    void (*rhs)(double t, const double *x, double *f, int mode);
    int n_roots;
    void (*roots)(double t, const double *x, double *g, int mode);
    /* the next mode where a root was passed; changes the state */
    int (*event)(double t, double *x, int mode);
    int first;
};

static const double STOP = 1.985217211169055, ANGLE = 0.3490658503988659;

static void oscillator_rhs(double t, const double *x, double *f, int mode)
{
    (void)mode;
    f[0] = x[1];
    f[1] = cos(1.2 * t) - x[0] - 0.2 * x[1];
}
static void oscillator_root(double t, const double *x, double *g, int mode)
{
    (void)t;
    (void)mode;
    g[0] = STOP - x[0];
}
static int oscillator_event(double t, double *x, int mode)
{
    (void)t;
    x[0] = STOP;
    x[1] = -0.7 * x[1];
    return mode;
}

/* modes: flight, slides down, slides up, sticks */
static double pull(double t) { return G * sin(ANGLE) + 3.0 * sin(5.0 * t); }
static void slope_rhs(double t, const double *x, double *f, int mode)
{
    const double press = 0.5 * G * cos(ANGLE);
    f[0] = x[2];
    f[1] = x[3];
    f[2] = mode == 3 ? 0.0 : pull(t) - (mode == 1 ? press : mode == 2 ? -press : 0.0);
    f[3] = mode == 0 ? -G * cos(ANGLE) : 0.0;
}
static void slope_root(double t, const double *x, double *g, int mode)
{
    g[0] = mode == 0 ? x[1] : mode == 3 ? 0.5 * G * cos(ANGLE) - fabs(pull(t)) : x[2];
}
static int slope_event(double t, double *x, int mode)
{
    if (mode == 0) {
        const double j = -0.5 * -x[3];
        x[1] = 0.0;
        x[2] = fabs(x[2]) > fabs(j) ? x[2] + (x[2] > 0 ? j : -j) : 0.0;
        x[3] = 0.0;
        return x[2] > 0 ? 1 : x[2] < 0 ? 2 : 3;
    }
    x[2] = 0.0;
    if (mode == 3)
        return pull(t) > 0 ? 1 : 2;
    return fabs(pull(t)) <= 0.5 * G * cos(ANGLE) ? 3 : pull(t) > 0 ? 1 : 2;
}

/* modes: slides, rolls */
static void disc_rhs(double t, const double *x, double *f, int mode)
{
    const double a = mode == 0 ? -0.25 * G : 0.0;
    (void)t;
    f[0] = x[3];
    f[1] = x[4];
    f[2] = x[5];
    f[3] = a;
    f[4] = 0.0;
    f[5] = a * 0.3 / (0.5 * 0.09);
}
static void disc_root(double t, const double *x, double *g, int mode)
{
    (void)t;
    g[0] = mode == 0 ? x[3] + 0.3 * x[5] : 1.0;
}
static int disc_event(double t, double *x, int mode)
{
    (void)t;
    (void)x;
    (void)mode;
    return 1;
}

static const struct problem PROBLEMS[] = {
    {"impact oscillator", 2, 1, {-1.751592356687898, 1.146496815286624}, 60.0, 60.0, oscillator_rhs, 1, oscillator_root, oscillator_event, 0},
    {"slope", 4, 4, {0.0, 0.4, 0.5, 0.0}, 20.0, 0.2, slope_rhs, 1, slope_root, slope_event, 0},
    {"disc", 6, 2, {0.0, 0.0, 0.0, 3.0, 0.0, 0.0}, 1.5, 1.5, disc_rhs, 1, disc_root, disc_event, 0},
};

struct now_at {
    const struct problem *p;
    int mode;
};

static int cv_rhs(sunrealtype t, N_Vector y, N_Vector f, void *data)
{
    const struct now_at *s = data;
    s->p->rhs(t, N_VGetArrayPointer(y), N_VGetArrayPointer(f), s->mode);
    return 0;
}
static int cv_root(sunrealtype t, N_Vector y, sunrealtype *g, void *data)
{
    const struct now_at *s = data;
    s->p->roots(t, N_VGetArrayPointer(y), g, s->mode);
    return 0;
}

/* One run of CVODE (Adams, fixed-point iteration); the time in seconds. */
static double with_cvode(const struct problem *p, double rtol, double *x, int *events)
{
    SUNContext context = NULL;
    SUNContext_Create(SUN_COMM_NULL, &context);
    N_Vector y = N_VNew_Serial(p->n, context);
    struct now_at s = {p, p->first};
    void *cv = CVodeCreate(CV_ADAMS, context);
    double best = 1e300;
    must(CVodeInit(cv, cv_rhs, 0.0, y) == 0, "CVodeInit");
    CVodeSStolerances(cv, rtol, rtol);
    CVodeSetUserData(cv, &s);
    SUNNonlinearSolver solver = SUNNonlinSol_FixedPoint(y, 0, context);
    CVodeSetNonlinearSolver(cv, solver);
    CVodeRootInit(cv, p->n_roots, cv_root);
    CVodeSetMaxNumSteps(cv, 1000000);
    /* at rest a step would go over two roots at once */
    CVodeSetMaxStep(cv, p->longest);
    for (int run = 0; run < RUNS; run++) {
        double t = 0.0, start = now();
        for (int i = 0; i < p->n; i++)
            NV_Ith_S(y, i) = p->x0[i];
        s.mode = p->first;
        *events = 0;
        CVodeReInit(cv, 0.0, y);
        CVodeSetStopTime(cv, p->end);
        while (t < p->end) {
            int flag = CVode(cv, p->end, y, &t, CV_NORMAL);
            must(flag >= 0, "CVode");
            if (flag == CV_ROOT_RETURN) {
                s.mode = p->event(t, N_VGetArrayPointer(y), s.mode);
                ++*events;
                CVodeReInit(cv, t, y);
                CVodeSetStopTime(cv, p->end);
            }
        }
        double spent = now() - start;
        best = spent < best ? spent : best;
    }
    for (int i = 0; i < p->n; i++)
        x[i] = NV_Ith_S(y, i);
    CVodeFree(&cv);
    SUNNonlinSolFree(solver);
    N_VDestroy(y);
    SUNContext_Free(&context);
    return best;
}

/* --- the same as scenes ---------------------------------------------------------------------------------------------- */

static swb_expr *graph;
static int64_t number(double v)
{
    int64_t id;
    must(!swb_expr_constants(graph, &v, 1, &id, 1), "constant");
    return id;
}
static int64_t op(int32_t o, int64_t a, int64_t b)
{
    int64_t id;
    must(!swb_expr_apply(graph, o, &a, b < 0 ? NULL : &b, NULL, &id, 1), "operator");
    return id;
}
#define ADD(a, b) op(SWB_OPERATOR_ADD, a, b)
#define SUB(a, b) op(SWB_OPERATOR_SUB, a, b)
#define MUL(a, b) op(SWB_OPERATOR_MUL, a, b)

static swb_system *scene_of(const struct problem *p)
{
    const int n = p->n / 2;
    int64_t x[MOST], t, force[3], entries[9], tangent;
    swb_scene *scene = NULL;
    swb_system *system = NULL;
    must(!swb_expr_create(&graph), "graph");
    must(!swb_expr_inputs(graph, SWB_INPUT_X, 0, x, p->n), "states");
    must(!swb_expr_inputs(graph, SWB_INPUT_T, 0, &t, 1), "time");
    must(!swb_scene_create(p->name, n, n, 0, 0, NULL, &scene), "scene");
    for (int k = 0; k < n * n; k++)
        entries[k] = number(k / n == k % n ? 1.0 : 0.0);
    if (p == &PROBLEMS[0]) {
        force[0] = SUB(SUB(op(SWB_OPERATOR_COS, MUL(number(1.2), t), -1), x[0]), MUL(number(0.2), x[1]));
        must(!swb_scene_add_contact(scene, graph, "stop", SUB(number(STOP), x[0]), NULL, 0, -1, number(0.7), NULL), "stop");
    } else if (p == &PROBLEMS[1]) {
        force[0] = ADD(number(G * sin(ANGLE)), MUL(number(3.0), op(SWB_OPERATOR_SIN, MUL(number(5.0), t), -1)));
        force[1] = number(-G * cos(ANGLE));
        must(!swb_scene_add_contact(scene, graph, "plane", x[1], &x[0], 1, number(0.5), -1, NULL), "plane");
    } else {
        force[0] = force[2] = number(0.0);
        force[1] = number(-G);
        entries[8] = number(0.5 * 0.09);
        tangent = ADD(x[0], MUL(number(0.3), x[2]));
        must(!swb_scene_add_contact(scene, graph, "floor", x[1], &tangent, 1, number(0.25), -1, NULL), "floor");
    }
    must(!swb_scene_set_inertia(scene, graph, entries, (int64_t)n * n), "inertia");
    must(!swb_scene_set_force(scene, graph, force, n), "force");
    must(!swb_scene_build(scene, graph), "build");
    must(!swb_scene_system(scene, &system), "system");
    swb_scene_free(scene);
    swb_expr_free(graph);
    return system;
}

static double with_scene(const struct problem *p, double rtol, double *x, int *events)
{
    swb_system *system = scene_of(p);
    swb_integrator *integrator = NULL;
    swb_run_stats stats;
    swb_run *run = NULL;
    int32_t outcome;
    double best = 1e300;
    must(!swb_integrator_create(system, NULL, &integrator), "integrator");
    must(!swb_integrator_set_double(integrator, "rtol", rtol) && !swb_integrator_set_double(integrator, "atol", rtol), "rtol");
    for (int k = 0; k < RUNS; k++) {
        double start = now();
        must(!swb_integrator_reinit(integrator, 0.0, p->x0, p->n), "reinit");
        must(!swb_integrator_advance(integrator, p->end, &outcome) && outcome == SWB_RUN_OUTCOME_REACHED, "advance");
        double spent = now() - start;
        best = spent < best ? spent : best;
    }
    must(!swb_integrator_get_state(integrator, x, p->n), "state");
    must(!swb_integrator_get_run(integrator, &run) && !swb_run_get_stats(run, &stats, sizeof stats), "stats");
    *events = (int)(stats.impacts + stats.switches);
    swb_run_free(run);
    swb_integrator_free(integrator);
    swb_system_free(system);
    return best;
}

static double off(const double *a, const double *b, int n)
{
    double worst = 0.0;
    for (int i = 0; i < n; i++)
        worst = fmax(worst, fabs(a[i] - b[i]) / (1.0 + fabs(b[i])));
    return worst;
}

int main(int argc, char **argv)
{
    const double given = argc > 1 ? atof(argv[1]) : 0.0, all[] = {1e-4, 1e-6, 1e-8, 1e-10};
    printf("%-18s %8s %10s %10s %10s %10s %8s %8s %7s\n", "scene", "rtol", "ours us", "CVODE us", "ours err", "CVODE err",
           "events", "CVODE's", "ratio");
    for (size_t k = 0; k < sizeof PROBLEMS / sizeof *PROBLEMS; k++)
        for (size_t j = 0; j < (given > 0.0 ? 1 : sizeof all / sizeof *all); j++) {
            const struct problem *p = &PROBLEMS[k];
            double exact[MOST], a[MOST], b[MOST], rtol = given > 0.0 ? given : all[j];
            int ours, theirs;
            with_scene(p, 1e-13, exact, &ours);
            double mine = with_scene(p, rtol, a, &ours), other = with_cvode(p, rtol, b, &theirs);
            printf("%-18s %8.0e %10.1f %10.1f %10.1e %10.1e %8d %8d %7.3f\n", p->name, rtol, 1e6 * mine, 1e6 * other,
                   off(a, exact, p->n), off(b, exact, p->n), ours, theirs, mine / other);
        }
    return 0;
}
