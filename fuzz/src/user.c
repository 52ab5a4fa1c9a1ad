#include "user.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MAGIC 0x7573657264617461u

const char *const fault_names[] = {"none", "NaN", "infinite", "undefined (+1)", "stop (-7)", "call again", "free", "interrupt"};

enum { MAX_USERS = 1 << 16 };

static struct user *users[MAX_USERS];
static int n_users;
static const char *complaint;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

void (*user_hook)(enum fault fault);

struct user *user_new(uint64_t seed, int64_t nx, int64_t nu, int64_t np, int64_t n_out)
{
    struct user *user = calloc(1, sizeof *user);
    if (!user || n_users == MAX_USERS)
        abort();
    user->magic = MAGIC;
    user->seed = seed;
    user->nx = nx, user->nu = nu, user->np = np, user->n_out = n_out;
    user->scale = 0.1;
    users[n_users++] = user;
    return user;
}

void user_misbehave(struct user *user, struct random *r)
{
    user->fault = (enum fault)random_below(r, N_FAULTS);
    user->fault_at = 1 + random_below(r, random_once_in(r, 2) ? 5 : 300);
    user->fault_every = random_once_in(r, 3) ? 1 + random_below(r, 100) : 0;
}

const char *users_complaint(void)
{
    for (int i = 0; i < n_users && !complaint; i++)
        if (users[i]->destroyed != users[i]->wants_destroy)
            complaint = users[i]->destroyed ? "user data destroyed more than once, or of a call that failed"
                                            : "user data never destroyed";
    const char *found = complaint;
    complaint = NULL;
    return found;
}

void users_clear(void)
{
    for (int i = 0; i < n_users; i++)
        free(users[i]);
    n_users = 0;
}

static void complain(const char *what)
{
    pthread_mutex_lock(&lock);
    complaint = what;
    pthread_mutex_unlock(&lock);
}

/* Count the call; the fault it has to show. */
static enum fault enter(struct user *user)
{
    if (!user || user->magic != MAGIC) {
        complain("a callback was called with other user data");
        return FAULT_STOP;
    }
    if (user->destroyed)
        complain("a callback was called after its user data was destroyed");
    int64_t call = __atomic_add_fetch(&user->calls, 1, __ATOMIC_RELAXED), behind = call - user->fault_at;
    int due = user->fault_at > 0 && (behind == 0 || (behind > 0 && user->fault_every && behind % user->fault_every == 0));
    enum fault fault = due ? user->fault : FAULT_NONE;
    if (fault >= FAULT_AGAIN && user_hook)
        user_hook(fault);
    return fault;
}

/* A coefficient between -1 and 1 that belongs to two numbers. */
static double coefficient(const struct user *user, int64_t i, int64_t j)
{
    struct random r = random_stream(user->seed, (uint64_t)(i * 1000 + j));
    return random_between(&r, -1.0, 1.0);
}

/* Fill n numbers as the fault says. Returns what the callback returns, or USER_GOES_ON. */
static int32_t spoil(enum fault fault, double *out, int64_t n)
{
    double bad = fault == FAULT_INFINITE ? INFINITY : NAN;
    if (fault == FAULT_UNDEFINED)
        return 1;
    if (fault == FAULT_STOP)
        return -7;
    if (fault != FAULT_NAN && fault != FAULT_INFINITE)
        return USER_GOES_ON;
    for (int64_t i = 0; i < n; i++)
        out[i] = bad;
    return 0;
}

static void expect_zeros(const double *out, int64_t n)
{
    for (int64_t i = 0; i < n; i++)
        if (out[i] != 0.0)
            complain("an output did not come filled with zeros");
}

int32_t user_fault(void *user_data, double *out, int64_t n)
{
    enum fault fault = enter(user_data);
    expect_zeros(out, n);
    return spoil(fault, out, n);
}

int32_t user_value(const swb_point *at, double *out, void *user_data)
{
    struct user *user = user_data;
    enum fault fault = enter(user);
    if (!user || user->magic != MAGIC)
        return -7;
    expect_zeros(out, user->n_out);
    int32_t code = spoil(fault, out, user->n_out);
    if (code != USER_GOES_ON)
        return code;
    for (int64_t i = 0; i < user->n_out; i++) {
        double sum = 0.3 * coefficient(user, i, 0);
        for (int64_t j = 0; j < user->nx; j++)
            sum += coefficient(user, i, 1 + j) * at->x[j] + user->scale * at->x[j] * at->x[j] * coefficient(user, j, i);
        for (int64_t j = 0; j < user->nu; j++)
            sum += coefficient(user, i, 101 + j) * at->u[j];
        for (int64_t j = 0; j < user->np; j++)
            sum += coefficient(user, i, 201 + j) * at->p[j];
        out[i] = sum;
    }
    return 0;
}

/* Derivatives that are only of the right size: wrong ones must do no harm. */
static int32_t some_numbers(struct user *user, double *out, int64_t n)
{
    enum fault fault = enter(user);
    if (!user || user->magic != MAGIC)
        return -7;
    expect_zeros(out, n);
    int32_t code = spoil(fault, out, n);
    if (code != USER_GOES_ON)
        return code;
    for (int64_t i = 0; i < n; i++)
        out[i] = coefficient(user, i, 301);
    return 0;
}

int32_t user_jacobian(const swb_point *at, double *out, void *user_data)
{
    struct user *user = user_data;
    (void)at;
    return some_numbers(user, out, user ? user->jacobian_nnz : 0);
}

int32_t user_hessian(const swb_point *at, const double *weights, double *out, void *user_data)
{
    struct user *user = user_data;
    (void)at;
    (void)weights;
    return some_numbers(user, out, user ? user->hessian_nnz : 0);
}

int32_t user_lagrangian(const swb_point *at, double weight, const double *y, double *out, void *user_data)
{
    (void)weight;
    (void)y;
    return user_hessian(at, NULL, out, user_data);
}

void user_destroy(void *user_data)
{
    struct user *user = user_data;
    if (!user || user->magic != MAGIC) {
        complain("destroy was called with other user data");
        return;
    }
    __atomic_add_fetch(&user->destroyed, 1, __ATOMIC_RELAXED);
    if (user->fault >= FAULT_AGAIN && user_hook)
        user_hook(user->fault);
}

/* The callbacks that only watch stop with any fault that is none of the library's functions. */
static int32_t watch(struct user *user, uint64_t size, uint64_t expected)
{
    if (size < expected)
        complain("a callback got a struct that is too small");
    enum fault fault = enter(user);
    return fault > FAULT_NONE && fault < FAULT_AGAIN ? 1 : 0;
}

int32_t user_iteration(const swb_iteration_info *info, void *user_data)
{
    return watch(user_data, info->struct_size, sizeof *info);
}

int32_t user_progress(const swb_progress *info, void *user_data)
{
    volatile double sum = 0.0;
    for (int64_t i = 0; i < info->nx; i++)
        sum = sum + info->x[i];
    return watch(user_data, info->struct_size, sizeof *info);
}

int32_t user_poll(void *user_data)
{
    return watch(user_data, 0, 0);
}

void user_log(int64_t level, const char *line, void *user_data)
{
    if (level < SWB_LOG_LEVEL_ERROR || level > SWB_LOG_LEVEL_TRACE || strchr(line, '\n'))
        complain("the log got a level that is none, or a line with a line break");
    enter(user_data);
}

int64_t user_decide(const swb_branching *branching, void *user_data)
{
    struct user *user = user_data;
    volatile double sum = 0.0;
    for (int64_t i = 0; i < branching->n_continuations * branching->nx; i++)
        sum = sum + branching->velocity[i];
    for (int64_t i = 0; i < branching->n_continuations * branching->n_modes; i++)
        sum = sum + branching->active[i];
    enum fault fault = enter(user);
    return fault == FAULT_NONE ? (int64_t)(user->seed % (uint64_t)branching->n_continuations) : (int64_t)fault * 1000 - 2000;
}

swb_code user_callback(int callback)
{
    switch (callback) {
    case C_swb_value_fn:
        return (swb_code)user_value;
    case C_swb_jacobian_fn:
        return (swb_code)user_jacobian;
    case C_swb_hessian_fn:
        return (swb_code)user_hessian;
    case C_swb_lagrangian_fn:
        return (swb_code)user_lagrangian;
    case C_swb_destroy_fn:
        return (swb_code)user_destroy;
    case C_swb_iteration_fn:
        return (swb_code)user_iteration;
    case C_swb_log_fn:
        return (swb_code)user_log;
    case C_swb_decide_fn:
        return (swb_code)user_decide;
    case C_swb_progress_fn:
        return (swb_code)user_progress;
    case C_swb_poll_fn:
        return (swb_code)user_poll;
    default:
        fprintf(stderr, "user.c: write a callback for type number %d of the header\n", callback);
        abort();
    }
}
