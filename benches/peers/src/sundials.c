/* The oscillator (4.4) and a sliding phase with SUNDIALS: what a user writes around the integrators. */
#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <math.h>
#include <nvector/nvector_serial.h>
#include <stdlib.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

enum method { ADAMS, BDF, ERK_DORMAND_PRINCE_5, ERK_FEHLBERG_8 };

struct oscillator {
    SUNContext context;
    void *memory;
    N_Vector x;
    SUNMatrix matrix;
    SUNLinearSolver linear;
    SUNNonlinearSolver nonlinear;
    int method;
    double omega;
};

static int rhs(double t, N_Vector x, N_Vector dx, void *data)
{
    const double w = ((struct oscillator *)data)->omega;
    const double *v = N_VGetArrayPointer(x);
    double *d = N_VGetArrayPointer(dx);
    (void)t;
    d[0] = v[0] + w * v[1];
    d[1] = v[1] - w * v[0];
    return 0;
}

static int jacobian(double t, N_Vector x, N_Vector dx, SUNMatrix j, void *data, N_Vector a, N_Vector b, N_Vector c)
{
    const double w = ((struct oscillator *)data)->omega;
    (void)t, (void)x, (void)dx, (void)a, (void)b, (void)c;
    SM_ELEMENT_D(j, 0, 0) = 1;
    SM_ELEMENT_D(j, 0, 1) = w;
    SM_ELEMENT_D(j, 1, 0) = -w;
    SM_ELEMENT_D(j, 1, 1) = 1;
    return 0;
}

static int root(double t, N_Vector x, double *g, void *data)
{
    const double *v = N_VGetArrayPointer(x);
    (void)t, (void)data;
    g[0] = v[0] * v[0] + v[1] * v[1] - 1;
    return 0;
}

void oscillator_free(struct oscillator *o)
{
    if (!o)
        return;
    if (o->method <= BDF)
        CVodeFree(&o->memory);
    else
        ERKStepFree(&o->memory);
    if (o->linear)
        SUNLinSolFree(o->linear);
    if (o->nonlinear)
        SUNNonlinSolFree(o->nonlinear);
    if (o->matrix)
        SUNMatDestroy(o->matrix);
    N_VDestroy(o->x);
    SUNContext_Free(&o->context);
    free(o);
}

/* NULL on failure. */
struct oscillator *oscillator_create(int method, double tol, double omega)
{
    struct oscillator *o = calloc(1, sizeof *o);
    int bad;
    if (!o || SUNContext_Create(NULL, &o->context))
        return NULL;
    o->method = method;
    o->omega = omega;
    o->x = N_VNew_Serial(2, o->context);
    if (method <= BDF) {
        o->memory = CVodeCreate(method == ADAMS ? CV_ADAMS : CV_BDF, o->context);
        bad = CVodeInit(o->memory, rhs, 0, o->x) || CVodeSStolerances(o->memory, tol, tol) ||
              CVodeSetUserData(o->memory, o) || CVodeRootInit(o->memory, 1, root) ||
              CVodeSetMaxNumSteps(o->memory, 1000000);
        if (method == ADAMS) {
            o->nonlinear = SUNNonlinSol_FixedPoint(o->x, 0, o->context);
            bad = bad || CVodeSetNonlinearSolver(o->memory, o->nonlinear);
        } else {
            o->matrix = SUNDenseMatrix(2, 2, o->context);
            o->linear = SUNLinSol_Dense(o->x, o->matrix, o->context);
            bad = bad || CVodeSetLinearSolver(o->memory, o->linear, o->matrix) || CVodeSetJacFn(o->memory, jacobian);
        }
    } else {
        o->memory = ERKStepCreate(rhs, 0, o->x, o->context);
        bad = !o->memory || ERKStepSStolerances(o->memory, tol, tol) || ERKStepSetUserData(o->memory, o) ||
              ERKStepRootInit(o->memory, 1, root) || ERKStepSetMaxNumSteps(o->memory, 1000000) ||
              ERKStepSetTableNum(o->memory, method == ERK_FEHLBERG_8 ? ARKODE_FEHLBERG_13_7_8 : ARKODE_DORMAND_PRINCE_7_4_5);
    }
    if (bad) {
        oscillator_free(o);
        return NULL;
    }
    return o;
}

/* From x to its value at `end`; the time of the switch, NaN without one. Not 0 on failure. */
int oscillator_run(struct oscillator *o, double x[2], double end, double *t_switch)
{
    double *v = N_VGetArrayPointer(o->x), t = 0;
    const double omega = o->omega;
    int code;
    v[0] = x[0];
    v[1] = x[1];
    *t_switch = NAN;
    code = o->method <= BDF ? CVodeReInit(o->memory, 0, o->x) : ERKStepReInit(o->memory, rhs, 0, o->x);
    code = code ? code : o->method <= BDF ? CVodeSetStopTime(o->memory, end) : ERKStepSetStopTime(o->memory, end);
    while (code == 0 && t < end) {
        int reason = o->method <= BDF ? CVode(o->memory, end, o->x, &t, CV_NORMAL)
                                      : ERKStepEvolve(o->memory, end, o->x, &t, ARK_NORMAL);
        if (reason < 0) {
            code = reason;
        } else if (reason == CV_ROOT_RETURN) {
            *t_switch = t;
            o->omega = -omega;
            code = o->method <= BDF ? CVodeReInit(o->memory, t, o->x) : ERKStepReInit(o->memory, rhs, t, o->x);
            code = code ? code : o->method <= BDF ? CVodeSetStopTime(o->memory, end) : ERKStepSetStopTime(o->memory, end);
        }
    }
    o->omega = omega;
    x[0] = v[0];
    x[1] = v[1];
    return code;
}
