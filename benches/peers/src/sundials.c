/* The oscillator (4.4), a sliding phase and dry friction with SUNDIALS: what a user writes around the integrators. */
#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <idas/idas.h>
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

/* --- a sliding phase with IDAS: x' = 1 + y, y' = cos x + 2 (1 - 2 a), with the weight a that keeps y = 0.3 sin x --- */

static int slide_residual(double t, N_Vector z, N_Vector zp, N_Vector r, void *data)
{
    const double *v = N_VGetArrayPointer(z), *d = N_VGetArrayPointer(zp);
    double *o = N_VGetArrayPointer(r);
    const double c = cos(v[0]), f = c + 2 * (1 - 2 * v[2]);
    (void)t, (void)data;
    o[0] = d[0] - 1 - v[1];
    o[1] = d[1] - f;
    o[2] = f - 0.3 * c * (1 + v[1]);
    return 0;
}

static int slide_jacobian(double t, double cj, N_Vector z, N_Vector zp, N_Vector r, SUNMatrix j, void *data, N_Vector a,
                          N_Vector b, N_Vector c)
{
    const double *v = N_VGetArrayPointer(z);
    const double s = sin(v[0]);
    (void)t, (void)zp, (void)r, (void)data, (void)a, (void)b, (void)c;
    SM_ELEMENT_D(j, 0, 0) = cj;
    SM_ELEMENT_D(j, 0, 1) = -1;
    SM_ELEMENT_D(j, 1, 0) = s;
    SM_ELEMENT_D(j, 1, 1) = cj;
    SM_ELEMENT_D(j, 1, 2) = 4;
    SM_ELEMENT_D(j, 2, 0) = -s + 0.3 * s * (1 + v[1]);
    SM_ELEMENT_D(j, 2, 1) = -0.3 * cos(v[0]);
    SM_ELEMENT_D(j, 2, 2) = -4;
    return 0;
}

struct slide {
    SUNContext context;
    void *memory;
    N_Vector z, zp, id;
    SUNMatrix matrix;
    SUNLinearSolver linear;
};

static void slide_start(struct slide *o, const double x[2])
{
    double *z = N_VGetArrayPointer(o->z), *zp = N_VGetArrayPointer(o->zp);
    z[0] = x[0];
    z[1] = x[1];
    z[2] = (2 + cos(x[0]) * (1 - 0.3 * (1 + x[1]))) / 4;
    zp[0] = 1 + x[1];
    zp[1] = cos(x[0]) + 2 * (1 - 2 * z[2]);
    zp[2] = 0;
}

void slide_free(struct slide *o)
{
    if (!o)
        return;
    IDAFree(&o->memory);
    SUNLinSolFree(o->linear);
    SUNMatDestroy(o->matrix);
    N_VDestroy(o->z);
    N_VDestroy(o->zp);
    N_VDestroy(o->id);
    SUNContext_Free(&o->context);
    free(o);
}

/* NULL on failure. */
struct slide *slide_create(double tol)
{
    static const double x[2] = {0, 0};
    struct slide *o = calloc(1, sizeof *o);
    int bad;
    if (!o || SUNContext_Create(NULL, &o->context))
        return NULL;
    o->z = N_VNew_Serial(3, o->context);
    o->zp = N_VNew_Serial(3, o->context);
    o->id = N_VNew_Serial(3, o->context);
    NV_Ith_S(o->id, 0) = NV_Ith_S(o->id, 1) = 1;
    NV_Ith_S(o->id, 2) = 0;
    slide_start(o, x);
    o->memory = IDACreate(o->context);
    o->matrix = SUNDenseMatrix(3, 3, o->context);
    o->linear = SUNLinSol_Dense(o->z, o->matrix, o->context);
    bad = IDAInit(o->memory, slide_residual, 0, o->z, o->zp) || IDASStolerances(o->memory, tol, tol) ||
          IDASetLinearSolver(o->memory, o->linear, o->matrix) || IDASetJacFn(o->memory, slide_jacobian) ||
          IDASetId(o->memory, o->id) || IDASetSuppressAlg(o->memory, 1) || IDASetMaxNumSteps(o->memory, 1000000);
    if (bad) {
        slide_free(o);
        return NULL;
    }
    return o;
}

/* From x to its value at `end`. Not 0 on failure. */
int slide_run(struct slide *o, double x[2], double end)
{
    const double *z = N_VGetArrayPointer(o->z);
    double t = 0;
    int code;
    slide_start(o, x);
    code = IDAReInit(o->memory, 0, o->z, o->zp);
    code = code ? code : IDASetStopTime(o->memory, end);
    if (code == 0)
        code = IDASolve(o->memory, end, &t, o->z, o->zp, IDA_NORMAL);
    x[0] = z[0];
    x[1] = z[1];
    return code < 0;
}

/* --- dry friction with CVODE: q' = v, v' = -q + cos(t / 2) - f, |f| <= 0.4, f = 0.4 sign v ------------------------- */

static const double MU = 0.4;

struct block {
    int mode; /* sign of v, 0: at rest */
};

static double force(double t, double q)
{
    return cos(0.5 * t) - q;
}

static int block_rhs(double t, N_Vector x, N_Vector dx, void *data)
{
    const int mode = ((struct block *)data)->mode;
    const double *v = N_VGetArrayPointer(x);
    double *d = N_VGetArrayPointer(dx);
    d[0] = mode ? v[1] : 0;
    d[1] = mode ? force(t, v[0]) - MU * mode : 0;
    return 0;
}

static int block_root(double t, N_Vector x, double *g, void *data)
{
    const double *v = N_VGetArrayPointer(x);
    g[0] = ((struct block *)data)->mode ? v[1] : MU - fabs(force(t, v[0]));
    return 0;
}

/* Events found until `end` from the state x > 0, and the state there; negative on failure. */
int block_run(int method, double tol, double x[2], double end)
{
    SUNContext context;
    struct block block = {1};
    void *memory;
    N_Vector y;
    SUNMatrix matrix;
    SUNLinearSolver linear;
    double t = 0, *v;
    int events = 0, code;
    if (SUNContext_Create(NULL, &context))
        return -1;
    y = N_VNew_Serial(2, context);
    v = N_VGetArrayPointer(y);
    v[0] = x[0];
    v[1] = x[1];
    memory = CVodeCreate(method == ADAMS ? CV_ADAMS : CV_BDF, context);
    matrix = SUNDenseMatrix(2, 2, context);
    linear = SUNLinSol_Dense(y, matrix, context);
    code = CVodeInit(memory, block_rhs, 0, y) || CVodeSStolerances(memory, tol, tol) || CVodeSetUserData(memory, &block) ||
           CVodeRootInit(memory, 1, block_root) || CVodeSetMaxNumSteps(memory, 1000000) ||
           CVodeSetLinearSolver(memory, linear, matrix) || CVodeSetStopTime(memory, end);
    while (code == 0 && t < end) {
        int reason = CVode(memory, end, y, &t, CV_NORMAL);
        if (reason < 0) {
            code = 1;
        } else if (reason == CV_ROOT_RETURN) {
            const double f = force(t, v[0]);
            events++;
            if (block.mode)
                block.mode = fabs(f) <= MU ? 0 : (f > 0) - (f < 0);
            else
                block.mode = (f > 0) - (f < 0);
            v[1] = 0;
            code = CVodeReInit(memory, t, y) || CVodeSetStopTime(memory, end);
        }
    }
    x[0] = v[0];
    x[1] = v[1];
    CVodeFree(&memory);
    SUNLinSolFree(linear);
    SUNMatDestroy(matrix);
    N_VDestroy(y);
    SUNContext_Free(&context);
    return code ? -1 : events;
}
