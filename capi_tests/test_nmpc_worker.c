/* Controllers that are interrupted at random moments, get deadlines at random moments, states that are no numbers and states where the
 * model is not defined, with preparations in the caller's thread and on the controller's: there always is a control within its bounds. */
#define _POSIX_C_SOURCE 200809L
#include <pthread.h>
#include <stdlib.h>
#include <time.h>

#include "models.h"

#define STAGES 12

static const double zero[3] = {0.0, 0.0, 0.0}, weights[3] = {2.0, 0.5, 0.3};

/* A tank that empties through a hole, with a valve that follows the control: no level below zero. */
static int32_t tank(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[1] - 0.6 * sqrt(at->x[0]);
    out[1] = 4.0 * (at->u[0] - at->x[1]);
    return at->x[0] < 0.0;
}

static int32_t everything(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0] - 1.0;
    out[1] = at->x[1] - 0.6;
    out[2] = at->u[0] - 0.6;
    return 0;
}

static int32_t level(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    return 0;
}

static swb_nmpc *make_controller(swb_nmpc_scheme scheme, swb_nmpc_level what)
{
    static const double low = 0.0, high = 2.0, none = 0.0, full = 1.3, start[2] = {0.5, 0.5};
    swb_function *f = make_function("tank", 2, 1, 0, 2, tank, NULL);
    swb_function *stage = make_function("stage", 2, 1, 0, 3, everything, NULL);
    swb_function *height = make_function("level", 2, 1, 0, 1, level, NULL);
    swb_nmpc_options options;
    swb_settings settings;
    swb_system *system = NULL;
    swb_ocp *ocp = NULL;
    swb_nmpc *c = NULL;

    CHECK_OK(swb_settings_init(&settings, sizeof settings));
    settings.rk_family = SWB_RK_FAMILY_EXPLICIT;
    settings.n_s = 4;
    settings.n_fe = 1;
    CHECK_OK(swb_system_create(2, 1, 0, &system));
    CHECK_OK(swb_system_set_f0(system, f));
    CHECK_OK(swb_ocp_create(system, 1.2, STAGES, &settings, &ocp));
    CHECK_OK(swb_ocp_add_least_squares(ocp, stage, weights, 3, zero, 3, SWB_COST_AT_RUNNING));
    CHECK_OK(swb_ocp_add_path(ocp, height, &none, 1, &full, 1, SWB_PATH_AT_CONTROL_GRID));
    CHECK_OK(swb_ocp_set_control_bounds(ocp, &low, 1, &high, 1));
    CHECK_OK(swb_ocp_set_state_guess(ocp, &none, 1, start, 2));
    CHECK_OK(swb_nmpc_options_init(&options, sizeof options));
    options.scheme = scheme;
    options.level = what;
    options.inner = 2;
    options.shift = 1;
    CHECK_OK(swb_nmpc_create(ocp, &options, &c));
    swb_ocp_free(ocp);
    swb_system_free(system);
    swb_function_free(f);
    swb_function_free(stage);
    swb_function_free(height);
    return c;
}

/* Numbers from 0 to below n. */
static uint64_t state = 1;

static int below(int n)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (int)((state >> 33) % (uint64_t)n);
}

static const double *measurement(void)
{
    static const double all[8][2] = {{0.5, 0.5}, {0.9, 0.6}, {1.2, 0.1}, {0.02, 1.9}, {-0.3, 0.5}, {NAN, 0.5}, {0.5, INFINITY}, {1e300, -1e300}};
    return all[below(8)];
}

static void check_feedback(swb_nmpc *c, int64_t from[5])
{
    const double *x = measurement();
    swb_nmpc_info info;
    double u = NAN;
    CHECK_OK(swb_nmpc_feedback(c, x, 2, &u, 1, &info, sizeof info));
    CHECK(u >= 0.0 && u <= 2.0);
    CHECK(info.source >= SWB_NMPC_SOURCE_QP && info.source <= SWB_NMPC_SOURCE_HOLD);
    if (!isfinite(x[0]) || !isfinite(x[1]))
        CHECK(info.source == SWB_NMPC_SOURCE_PLAN || info.source == SWB_NMPC_SOURCE_HOLD);
    from[info.source]++;
}

static void calls_in_any_order(swb_nmpc_scheme scheme, swb_nmpc_level what)
{
    swb_nmpc *c = make_controller(scheme, what);
    int64_t from[5] = {0, 0, 0, 0, 0};
    swb_nmpc_info info;
    swb_nmpc_monitor m;
    swb_status status;

    CHECK_STATUS(SWB_ERR_STATE, swb_nmpc_wait(c, NULL, 0));
    for (int k = 0; k < 200; k++) {
        switch (below(8)) {
        case 0:
        case 1:
            check_feedback(c, from);
            break;
        case 2:
            CHECK_OK(swb_nmpc_prepare(c, NULL, 0, &info, sizeof info));
            break;
        case 3:
        case 4: {
            int64_t started = -1;
            CHECK_OK(swb_nmpc_prepare_async(c, NULL, 0, &started));
            CHECK(started == 0 || started == 1);
            break;
        }
        case 5: {
            const double *x = measurement();
            status = swb_nmpc_prepare_async(c, x, 2, NULL);
            CHECK(status == (isfinite(x[0]) && isfinite(x[1]) ? SWB_OK : SWB_ERR_RANGE));
            break;
        }
        case 6:
            status = swb_nmpc_wait(c, &info, sizeof info);
            CHECK(status == SWB_OK || status == SWB_ERR_STATE);
            break;
        default:
            CHECK_OK(swb_nmpc_set_deadline(c, below(2) ? INFINITY : 1e-6 * below(50) + 1e-9));
        }
    }
    CHECK_OK(swb_nmpc_get_monitor(c, &m, sizeof m));
    CHECK(m.from_qp == from[0] && m.from_soft_qp == from[1] && m.from_tangent == from[2] && m.from_plan == from[3] && m.from_hold == from[4]);
    /* freed with a preparation under way */
    CHECK_OK(swb_nmpc_prepare_async(c, NULL, 0, NULL));
    swb_nmpc_free(c);
}

struct nuisance {
    swb_nmpc *controller;
    pthread_mutex_t lock;
    int quit;
};

/* Interrupts a controller at intervals of 0 to 2 ms. */
static void *disturb(void *data)
{
    struct nuisance *n = data;
    uint64_t s = 7;
    int quit = 0;
    while (!quit) {
        struct timespec t = {0, 0};
        s = s * 6364136223846793005u + 1442695040888963407u;
        t.tv_nsec = (long)((s >> 33) % 2000000u);
        nanosleep(&t, NULL);
        CHECK_OK(swb_nmpc_interrupt(n->controller));
        pthread_mutex_lock(&n->lock);
        quit = n->quit;
        pthread_mutex_unlock(&n->lock);
    }
    return NULL;
}

static void interrupts_at_random_moments(swb_nmpc_scheme scheme, swb_nmpc_level what)
{
    struct nuisance n = {make_controller(scheme, what), PTHREAD_MUTEX_INITIALIZER, 0};
    const double x[2] = {0.5, 0.5};
    int64_t from[5] = {0, 0, 0, 0, 0};
    int ended = 0;
    swb_nmpc_info info;
    pthread_t thread;

    CHECK_OK(swb_nmpc_set_deadline(n.controller, 1e-3));
    CHECK(pthread_create(&thread, NULL, disturb, &n) == 0);
    for (int k = 0; k < 150; k++) {
        swb_status status;
        if (k % 2) {
            status = swb_nmpc_prepare(n.controller, NULL, 0, &info, sizeof info);
        } else {
            CHECK_OK(swb_nmpc_prepare_async(n.controller, NULL, 0, NULL));
            status = k % 4 ? SWB_OK : swb_nmpc_wait(n.controller, &info, sizeof info);
        }
        CHECK(status == SWB_OK || status == SWB_ERR_INTERRUPTED);
        ended += status == SWB_ERR_INTERRUPTED;
        check_feedback(n.controller, from);
    }
    pthread_mutex_lock(&n.lock);
    n.quit = 1;
    pthread_mutex_unlock(&n.lock);
    pthread_join(thread, NULL);
    /* the last flag may still be up */
    (void)swb_nmpc_prepare(n.controller, x, 2, &info, sizeof info);
    CHECK_OK(swb_nmpc_prepare(n.controller, x, 2, &info, sizeof info));
    CHECK(info.ready == 1);
    (void)ended;
    swb_nmpc_free(n.controller);
}

static void the_thread_changes_nothing(void)
{
    swb_nmpc *a = make_controller(SWB_NMPC_SCHEME_AS_RTI, SWB_NMPC_LEVEL_D0);
    swb_nmpc *b = make_controller(SWB_NMPC_SCHEME_AS_RTI, SWB_NMPC_LEVEL_D0);
    double x[2] = {0.5, 0.5};
    for (int k = 0; k < 20; k++) {
        double u = NAN, v = NAN;
        int64_t started = 0;
        swb_nmpc_info info;
        CHECK_OK(swb_nmpc_prepare(a, NULL, 0, NULL, 0));
        CHECK_OK(swb_nmpc_prepare_async(b, NULL, 0, &started));
        CHECK(started == 1);
        if (k % 2) {
            CHECK_OK(swb_nmpc_wait(b, &info, sizeof info));
            CHECK(info.ready == 1 && info.inner == (k > 0 ? 2 : 0));
        }
        CHECK_OK(swb_nmpc_feedback(a, x, 2, &u, 1, NULL, 0));
        CHECK_OK(swb_nmpc_feedback(b, x, 2, &v, 1, &info, sizeof info));
        CHECK(u == v && info.source == SWB_NMPC_SOURCE_QP);
        x[0] += 0.1 * (x[1] - 0.6 * sqrt(x[0]));
        x[1] += 0.4 * (u - x[1]);
    }
    swb_nmpc_free(a);
    swb_nmpc_free(b);
}

int main(void)
{
    static const swb_nmpc_scheme schemes[4] = {SWB_NMPC_SCHEME_RTI, SWB_NMPC_SCHEME_MLI, SWB_NMPC_SCHEME_AS_RTI, SWB_NMPC_SCHEME_ASC};
    static const swb_nmpc_level levels[6] = {SWB_NMPC_LEVEL_A, SWB_NMPC_LEVEL_B, SWB_NMPC_LEVEL_C, SWB_NMPC_LEVEL_D0, SWB_NMPC_LEVEL_D1, SWB_NMPC_LEVEL_D2};
    /* all levels where they differ, one of the others */
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 6; j++)
            if (j == 3 || i == 1 || i == 2) {
                calls_in_any_order(schemes[i], levels[j]);
                if (j % 2)
                    interrupts_at_random_moments(schemes[i], levels[j]);
            }
    the_thread_changes_nothing();
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_prepare_async(NULL, NULL, 0, NULL));
    CHECK_STATUS(SWB_ERR_NULL, swb_nmpc_wait(NULL, NULL, 0));
    CHECK(swb_live_objects() == 0);
    return CHECK_DONE();
}
