/* Problems of every kind that the library knows, small enough to be solved often. */
#ifndef PROBLEMS_H
#define PROBLEMS_H

#include "switchback.h"
#include "user.h"

/* A cart with dry friction p[0] that a control pushes, as callbacks: x' = v, v' = u - p sign(v). */
struct friction {
    swb_system *system;
    swb_function *modes, *speed, *f0, *cost, *goal;
    struct user *user; /* of all functions: its fault comes at its n-th call, whichever function that is */
};

enum { FRICTION_NX = 2, FRICTION_NU = 1, FRICTION_NP = 1 };

extern const double friction_start[FRICTION_NX], friction_push[FRICTION_NU], friction_params[FRICTION_NP];

void friction_create(struct friction *out);
void friction_free(struct friction *of);

/* Push it to x = 1 with little force. Settings may be NULL; NULL if the library refuses them, here and below. */
swb_ocp *friction_ocp(const struct friction *of, const swb_settings *settings, int64_t n_stages);
swb_integrator *friction_integrator(const struct friction *of, const swb_settings *settings);
swb_simulator *friction_simulator(const struct friction *of, const swb_settings *settings);
swb_batch *friction_batch(const struct friction *of, const swb_settings *settings);

/* The same as expressions. */
swb_model *friction_model(swb_expr *graph);
swb_function *friction_cost(swb_expr *graph);
/* x'' = u, which is to come to rest: a least-squares term of x and u; bounds of x[0]. */
swb_ocp *tracking_ocp(swb_expr *graph, const swb_settings *settings);
/* The same system without costs. */
swb_ocp *observed_ocp(swb_expr *graph, const swb_settings *settings);
/* A point that is to move with the speed 1.3 + 3.6 t and pays while it is right of 0. In the optimum it gets there between the
 * two control stages: with the first control at 2 the derivative of the cost is -0.075 below and 0.05 above. */
swb_ocp *kinked_ocp(swb_expr *graph, const swb_settings *settings);

/* x' = 1, and x[1] counts how often x[0] has passed 0.1; the functions are the guard and the reset that begins again. */
struct counter {
    swb_system *system;
    swb_function *guard, *reset;
};

void counter_create(struct counter *out, swb_expr *graph);

/* Minimise (a - 1)^2 + (b - 1)^2 + c^2 subject to 0 <= a _|_ b >= 0 and a + b + c >= p, with two local minima. */
struct corner {
    swb_mpcc *mpcc;
    swb_function *objective, *rows;
    struct user *user;
};

/* 0 if the library refuses the settings. */
int corner_create(struct corner *out, const swb_settings *settings);
void corner_free(struct corner *of);

/* Print what failed and end the program: for calls that must succeed. */
void must(swb_status status, const char *what);
#define MUST(call) must(call, #call)

#endif
