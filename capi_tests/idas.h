/* Integrate a small DAE with SUNDIALS IDAS at tight tolerances. */
#ifndef IDAS_H
#define IDAS_H

#include <idas/idas.h>
#include <nvector/nvector_serial.h>
#include <sunlinsol/sunlinsol_dense.h>
#include <sunmatrix/sunmatrix_dense.h>
#if SUNDIALS_VERSION_MAJOR < 7
#define SUN_COMM_NULL NULL
#endif

#include "check.h"

/* Residual F(t, y, y') of n equations; differential[i] != 0 where y_i' occurs. `roots`, if any, fills n_roots functions of y;
 * where one of them changes its sign a solve ends. */
typedef void (*residual_fn)(double t, const double *y, const double *yp, double *r);
typedef void (*roots_fn)(const double *y, double *g);

struct dae {
    int n;
    residual_fn residual;
    const int *differential;
    int n_roots;
    roots_fn roots;
};

static inline int idas_residual(sunrealtype t, N_Vector y, N_Vector yp, N_Vector r, void *user_data)
{
    ((struct dae *)user_data)->residual(t, N_VGetArrayPointer(y), N_VGetArrayPointer(yp), N_VGetArrayPointer(r));
    return 0;
}

static inline int idas_roots(sunrealtype t, N_Vector y, N_Vector yp, sunrealtype *g, void *user_data)
{
    (void)t;
    (void)yp;
    ((struct dae *)user_data)->roots(N_VGetArrayPointer(y), g);
    return 0;
}

#define IDAS(call) CHECK((call) >= 0)

/* From y(t0), with a guess of y' and of what is not differential, to y(t1), or to the first root. Returns the time. */
static inline double idas_solve(struct dae *dae, double t0, double t1, double *y, const double *yp, double rtol)
{
    SUNContext context = NULL;
    N_Vector v, vp, id;
    SUNMatrix matrix;
    SUNLinearSolver solver;
    void *memory;
    sunrealtype t;
    int i, flag, algebraic = 0;

    IDAS(SUNContext_Create(SUN_COMM_NULL, &context));
    v = N_VNew_Serial(dae->n, context);
    vp = N_VNew_Serial(dae->n, context);
    id = N_VNew_Serial(dae->n, context);
    for (i = 0; i < dae->n; i++) {
        NV_Ith_S(v, i) = y[i];
        NV_Ith_S(vp, i) = yp[i];
        NV_Ith_S(id, i) = dae->differential[i] ? 1.0 : 0.0;
        algebraic += !dae->differential[i];
    }
    memory = IDACreate(context);
    IDAS(IDAInit(memory, idas_residual, t0, v, vp));
    IDAS(IDASStolerances(memory, rtol, 1e-2 * rtol));
    matrix = SUNDenseMatrix(dae->n, dae->n, context);
    solver = SUNLinSol_Dense(v, matrix, context);
    IDAS(IDASetLinearSolver(memory, solver, matrix));
    IDAS(IDASetUserData(memory, dae));
    IDAS(IDASetMaxNumSteps(memory, 1000000));
    IDAS(IDASetStopTime(memory, t1));
    IDAS(IDASetNonlinConvCoef(memory, 1e-3)); /* the default leaves a tenth of the tolerance to Newton's method */
    if (dae->n_roots)
        IDAS(IDARootInit(memory, dae->n_roots, idas_roots));
    if (algebraic)
        IDAS(IDASetId(memory, id));
    IDAS(IDACalcIC(memory, algebraic ? IDA_YA_YDP_INIT : IDA_Y_INIT, t0 + 1e-3 * (t1 - t0)));
    flag = IDASolve(memory, t1, &t, v, vp, IDA_NORMAL);
    CHECK(flag == IDA_ROOT_RETURN || (flag >= 0 && t == t1));
    for (i = 0; i < dae->n; i++)
        y[i] = NV_Ith_S(v, i);
    IDAFree(&memory);
    SUNLinSolFree(solver);
    SUNMatDestroy(matrix);
    N_VDestroy(v);
    N_VDestroy(vp);
    N_VDestroy(id);
    SUNContext_Free(&context);
    return t;
}

/* The derivatives that make the residual r = f(y) - y' of an ordinary differential equation vanish. */
static inline void start(residual_fn f, const double *y, double *yp)
{
    double zero[8] = {0};
    f(0.0, y, zero, yp);
}

/* Slope of log(error) over log(h), least squares over the errors above `floor`. */
static inline double slope(const double *h, const double *error, int n, double floor)
{
    double sx = 0, sy = 0, sxx = 0, sxy = 0, m = 0;
    int i;
    for (i = 0; i < n; i++) {
        double x = log(h[i]), y = log(error[i]);
        if (error[i] <= floor)
            continue;
        m += 1;
        sx += x;
        sy += y;
        sxx += x * x;
        sxy += x * y;
    }
    return m < 2 ? (double)NAN : (m * sxy - sx * sy) / (m * sxx - sx * sx);
}

#endif
