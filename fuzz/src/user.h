/* The user's side: functions with smooth values that may fail as they are told to, and count what is done to them. */
#ifndef USER_H
#define USER_H

#include <pthread.h>

#include "api.h"
#include "random.h"

/* What a callback does instead of its work. */
enum fault { FAULT_NONE, FAULT_NAN, FAULT_INFINITE, FAULT_UNDEFINED, FAULT_STOP, FAULT_AGAIN, FAULT_FREE, FAULT_INTERRUPT, N_FAULTS };

extern const char *const fault_names[];

/* What callbacks get as user data. Sizes are those the function was created with. */
struct user {
    uint64_t magic;
    uint64_t seed;  /* of the values */
    int64_t nx, nu, np, n_out;
    int64_t jacobian_nnz, hessian_nnz; /* what the callbacks have to write */
    double scale;   /* of the quadratic terms */
    int wants_destroy, destroyed;
    enum fault fault;
    int64_t fault_at;     /* number of the call that fails, from 1; 0: none */
    int64_t fault_every;  /* and every so many calls from then on; 0: once */
    int64_t calls;
};

/* A new one that behaves; it lives until users_clear. */
struct user *user_new(uint64_t seed, int64_t nx, int64_t nu, int64_t np, int64_t n_out);

/* Let it fail now and then. */
void user_misbehave(struct user *user, struct random *r);

/* What went wrong with user data since the last call: not destroyed or more than once, callbacks with wrong user data.
   NULL if nothing. All objects must be free. */
const char *users_complaint(void);
void users_clear(void);

/* What the faults FAULT_AGAIN, FAULT_FREE and FAULT_INTERRUPT do; only called on the thread that set it. */
extern void (*user_hook)(enum fault fault);

/* For callbacks of others that have a user as their user data: count the call, and fill n numbers or return a code if it is
   to fail; else USER_GOES_ON. */
enum { USER_GOES_ON = 1000 };
int32_t user_fault(void *user_data, double *out, int64_t n);

int32_t user_value(const swb_point *at, double *out, void *user_data);
int32_t user_jacobian(const swb_point *at, double *out, void *user_data);
int32_t user_hessian(const swb_point *at, const double *weights, double *out, void *user_data);
int32_t user_lagrangian(const swb_point *at, double weight, const double *y, double *out, void *user_data);
void user_destroy(void *user_data);
int32_t user_iteration(const swb_iteration_info *info, void *user_data);
void user_log(int64_t level, const char *line, void *user_data);
int64_t user_decide(const swb_branching *branching, void *user_data);
int32_t user_progress(const swb_progress *info, void *user_data);
int32_t user_poll(void *user_data);

/* The callback of a type of callbacks. */
swb_code user_callback(int callback);

#endif
