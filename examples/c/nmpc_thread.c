/* A controller on a thread of its own, with a clock: a pendulum on a cart is held upright at 200 Hz while the main thread moves the place
 * where it is to stand. Preparations run on the library's thread; the controller's thread only sleeps, measures and acts, and gets a
 * control within the deadline whether the preparation was in time or not. Prints how late samples were and where controls came from. */
#define _POSIX_C_SOURCE 200809L
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <time.h>

#include "example.h"

#define STAGES 40

static const double sample = 0.005, length = 0.5, gravity = 9.81;

/* States: place, angle from upright, their speeds; control: acceleration of the cart. */
static int32_t pendulum(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[2];
    out[1] = at->x[3];
    out[2] = at->u[0];
    out[3] = (gravity * sin(at->x[1]) - at->u[0] * cos(at->x[1])) / length;
    return 0;
}

static int32_t everything(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    for (int i = 0; i < 4; i++)
        out[i] = at->x[i];
    out[4] = at->u[0];
    return 0;
}

static int32_t states(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    for (int i = 0; i < 4; i++)
        out[i] = at->x[i];
    return 0;
}

static swb_nmpc *make_controller(void)
{
    static const double weights[5] = {10.0, 10.0, 0.1, 0.1, 0.02}, ends[4] = {50.0, 50.0, 5.0, 5.0};
    static const double zero[5] = {0.0}, low = -8.0, high = 8.0;
    swb_function *f = function("pendulum", 4, 1, 4, pendulum, NULL);
    swb_function *all = function("stage", 4, 1, 5, everything, NULL);
    swb_function *end = function("end", 4, 1, 4, states, NULL);
    swb_settings settings;
    swb_nmpc_options options;
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    swb_nmpc *c = NULL;
    TRY(swb_settings_init(&settings, sizeof settings));
    settings.rk_family = SWB_RK_FAMILY_EXPLICIT;
    settings.n_s = 4;
    settings.n_fe = 1;
    TRY(swb_system_create(4, 1, 0, &system));
    TRY(swb_system_set_f0(system, f));
    TRY(swb_ocp_create(system, 2.0, STAGES, &settings, &ocp));
    TRY(swb_ocp_add_least_squares(ocp, all, weights, 5, zero, 5, SWB_COST_AT_RUNNING));
    TRY(swb_ocp_add_least_squares(ocp, end, ends, 4, zero, 4, SWB_COST_AT_TERMINAL));
    TRY(swb_ocp_set_control_bounds(ocp, &low, 1, &high, 1));
    TRY(swb_nmpc_options_init(&options, sizeof options));
    options.scheme = SWB_NMPC_SCHEME_RTI;
    options.deadline = 1e-3;
    TRY(swb_nmpc_create(ocp, &options, &c));
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_function_free(f);
    swb_function_free(all);
    swb_function_free(end);
    return c;
}

/* What the two threads share. */
struct shared {
    pthread_mutex_t lock;
    swb_nmpc *controller;
    double target, x[4], latest, slowest;
    int quit, samples, from[5];
};

/* The plant until the next sample. */
static void simulate(double x[4], double u)
{
    double out[4];
    swb_point at = {.x = x, .u = &u};
    for (int i = 0; i < 20; i++) {
        pendulum(&at, out, NULL);
        for (int j = 0; j < 4; j++)
            x[j] += sample / 20.0 * out[j];
    }
}

static double seconds_since(const struct timespec *from)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)(now.tv_sec - from->tv_sec) + 1e-9 * (double)(now.tv_nsec - from->tv_nsec);
}

static void *control(void *data)
{
    struct shared *s = data;
    double x[4] = {0.0, 0.1, 0.0, 0.0}, u = 0.0, target = 0.0, wanted = 0.0, late;
    struct timespec next;
    swb_nmpc_info info;
    int quit = 0;

    TRY(swb_nmpc_initialise(s->controller, x, 4, 50, NULL));
    clock_gettime(CLOCK_MONOTONIC, &next);
    while (!quit) {
        if (wanted != target) {
            double y[5] = {0.0};
            target = y[0] = wanted;
            TRY(swb_nmpc_set_references(s->controller, 0, y, 5));
            TRY(swb_nmpc_set_references(s->controller, 1, y, 4));
        }
        TRY(swb_nmpc_prepare_async(s->controller, NULL, 0, NULL));
        next.tv_nsec += (long)(1e9 * sample);
        if (next.tv_nsec >= 1000000000L) {
            next.tv_nsec -= 1000000000L;
            next.tv_sec++;
        }
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &next, NULL);
        /* here a real program reads its sensors */
        TRY(swb_nmpc_feedback(s->controller, x, 4, &u, 1, &info, sizeof info));
        /* and here it drives its motor */
        late = seconds_since(&next);
        simulate(x, u);
        pthread_mutex_lock(&s->lock);
        s->samples++;
        s->from[info.source]++;
        s->latest = fmax(s->latest, late);
        s->slowest = fmax(s->slowest, info.time);
        for (int i = 0; i < 4; i++)
            s->x[i] = x[i];
        wanted = s->target;
        quit = s->quit;
        pthread_mutex_unlock(&s->lock);
    }
    return NULL;
}

int main(void)
{
    static const char *const names[5] = {"qp", "soft qp", "tangent", "plan", "hold"};
    static const double targets[4] = {0.0, 0.3, -0.3, 0.0};
    struct shared s = {.lock = PTHREAD_MUTEX_INITIALIZER};
    const struct timespec rest = {0, 600000000L};
    pthread_t thread;
    double off = 0.0;

    s.controller = make_controller();
    if (pthread_create(&thread, NULL, control, &s))
        return 1;
    for (int k = 0; k < 4; k++) {
        pthread_mutex_lock(&s.lock);
        s.target = targets[k];
        pthread_mutex_unlock(&s.lock);
        nanosleep(&rest, NULL);
        nanosleep(&rest, NULL);
        pthread_mutex_lock(&s.lock);
        printf("target %5.2f: place %7.4f, angle %7.4f after %d samples\n", s.target, s.x[0], s.x[1], s.samples);
        off = fmax(off, fabs(s.x[0] - s.target));
        pthread_mutex_unlock(&s.lock);
    }
    pthread_mutex_lock(&s.lock);
    s.quit = 1;
    pthread_mutex_unlock(&s.lock);
    pthread_join(thread, NULL);
    for (int k = 0; k < 5; k++)
        if (s.from[k])
            printf("%d controls from the %s\n", s.from[k], names[k]);
    printf("slowest feedback %.1f us, latest control %.3f ms after its time\n", 1e6 * s.slowest, 1e3 * s.latest);
    swb_nmpc_free(s.controller);
    return off < 0.1 ? 0 : 1;
}
