/* Threads: the same constant objects, objects of their own, the same objects at once, interrupts and frees from elsewhere,
 * and a process that forks meanwhile. Under ThreadSanitizer, or plainly as a stress.
 *
 *   threads [--rounds N] */
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "problems.h"
#include "random.h"
#include "tasks.h"

enum { N_THREADS = 8 };

static int failures;

#define EXPECT(condition)                                                                                              \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            __atomic_add_fetch(&failures, 1, __ATOMIC_RELAXED);                                                        \
            fprintf(stderr, "DEFECT threads %s:%d: %s is false (%s)\n", __FILE__, __LINE__, #condition, swb_last_error()); \
        }                                                                                                              \
    } while (0)

static void in_threads(void *(*work)(void *), void *data)
{
    pthread_t threads[N_THREADS];
    for (int i = 0; i < N_THREADS; i++)
        if (pthread_create(&threads[i], NULL, work, data) != 0)
            exit(2);
    for (int i = 0; i < N_THREADS; i++)
        pthread_join(threads[i], NULL);
}

/* --- constant objects, read by all --- */

struct shared {
    swb_function *function;
    swb_ocp *ocp;
    swb_run *run;
    swb_trajectory *trajectory;
    swb_system *system;
    double cost;
};

static void *read_all(void *data)
{
    const struct shared *s = data;
    for (int k = 0; k < 40; k++) {
        double out[8], x[2] = {0.1 * k, 0.2}, u = 0.3, p = 0.4, cost = 0.0, t = 0.5;
        swb_point at = {0.0, x, &u, &p};
        char text[4096];
        int64_t n;
        EXPECT(swb_function_eval(s->function, &at, out, 2) == SWB_OK);
        EXPECT(swb_function_sizes(s->function, &n, NULL, NULL, NULL, NULL, NULL) == SWB_OK);
        EXPECT(swb_ocp_get_cost(s->ocp, &cost) == SWB_OK && cost == s->cost);
        EXPECT(swb_ocp_get_message(s->ocp, text, sizeof text, NULL) == SWB_OK);
        EXPECT(swb_run_evaluate(s->run, &t, 1, 0, out, 2) == SWB_OK);
        EXPECT(swb_trajectory_state_at(s->trajectory, &t, 1, out, 2) == SWB_OK);
        EXPECT(swb_system_surfaces(s->system, 0, &at, out, 1, NULL) == SWB_OK);
        EXPECT(swb_function_eval(s->function, &at, out, 3) == SWB_ERR_DIMENSION && strstr(swb_last_error(), "3"));
    }
    return NULL;
}

static void constant_objects(void)
{
    int32_t outcome;
    swb_settings settings;
    struct friction f;
    struct shared s;
    MUST(swb_settings_init(&settings, sizeof settings));
    settings.dense = 1;
    settings.n_fe = 2;
    friction_create(&f);
    s.function = f.f0;
    s.system = f.system;
    s.ocp = friction_ocp(&f, &settings, 2);
    MUST(swb_ocp_solve(s.ocp, &outcome));
    MUST(swb_ocp_get_cost(s.ocp, &s.cost));
    MUST(swb_ocp_get_trajectory(s.ocp, &s.trajectory));
    swb_integrator *it = friction_integrator(&f, &settings);
    MUST(swb_integrator_advance(it, 1.0, &outcome));
    MUST(swb_integrator_get_run(it, &s.run));
    in_threads(read_all, &s);
    swb_run_free(s.run);
    swb_trajectory_free(s.trajectory);
    swb_ocp_free(s.ocp);
    swb_integrator_free(it);
    friction_free(&f);
}

/* --- objects of their own: the same numbers everywhere --- */

static void *solve_own(void *data)
{
    static double first[N_TASKS][16];
    static int known[N_TASKS];
    static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
    const enum task_kind *kind = data;
    int32_t outcome;
    double numbers[16] = {0};
    swb_settings settings;
    struct task task;
    MUST(swb_settings_init(&settings, sizeof settings));
    settings.n_fe = 2;
    task_settings(*kind, &settings);
    pthread_mutex_lock(&lock); /* the list of users belongs to one thread */
    int made = task_create(&task, *kind, &settings);
    pthread_mutex_unlock(&lock);
    EXPECT(made);
    if (!made)
        return NULL;
    EXPECT(task_run(&task, &outcome) == SWB_OK);
    int n = task_result(&task, numbers, 16);
    pthread_mutex_lock(&lock);
    if (!known[*kind])
        memcpy(first[*kind], numbers, sizeof numbers);
    known[*kind] = 1;
    EXPECT(n > 0 && memcmp(first[*kind], numbers, sizeof numbers) == 0);
    pthread_mutex_unlock(&lock);
    task_free(&task);
    return NULL;
}

static void own_objects(void)
{
    for (int kind = 0; kind < N_TASKS; kind++) {
        enum task_kind k = (enum task_kind)kind;
        in_threads(solve_own, &k);
    }
}

/* --- one object, used by all at once: some are refused, nothing breaks --- */

static void *use_together(void *data)
{
    struct task *task = data;
    for (int k = 0; k < 6; k++) {
        int32_t outcome;
        double cost;
        swb_status status = swb_ocp_solve(task->ocp, &outcome);
        EXPECT(status == SWB_OK || status == SWB_ERR_STATE || status == SWB_ERR_INTERRUPTED);
        status = swb_ocp_get_cost(task->ocp, &cost);
        EXPECT(status == SWB_OK || status == SWB_ERR_STATE);
        status = swb_ocp_set_int(task->ocp, "max_iter", 50 + k);
        EXPECT(status == SWB_OK || status == SWB_ERR_STATE);
        EXPECT(swb_ocp_interrupt(task->ocp) == SWB_OK);
    }
    return NULL;
}

static void one_object(void)
{
    swb_settings settings;
    struct task task;
    MUST(swb_settings_init(&settings, sizeof settings));
    settings.n_fe = 2;
    if (!task_create(&task, TASK_SOLVE, &settings))
        exit(2);
    in_threads(use_together, &task);
    task_free(&task);
}

/* --- objects that others free --- */

static swb_function *slots[64];

static void *make_and_free(void *data)
{
    uint64_t number = (uint64_t)(uintptr_t)pthread_self();
    struct random r = random_stream(number, 1);
    (void)data;
    for (int k = 0; k < 300; k++) {
        swb_function *f = NULL;
        static struct user user = {.magic = 0};
        EXPECT(swb_function_create("f", 1, 0, 0, 1, user_value, &user, NULL, &f) == SWB_OK);
        swb_function *old = __atomic_exchange_n(&slots[random_below(&r, 64)], f, __ATOMIC_ACQ_REL);
        int64_t n;
        swb_function *other = __atomic_load_n(&slots[random_below(&r, 64)], __ATOMIC_ACQUIRE);
        swb_status status = swb_function_sizes(other, &n, NULL, NULL, NULL, NULL, NULL);
        EXPECT(status == SWB_OK || status == SWB_ERR_STATE || status == SWB_ERR_NULL);
        do /* while another thread uses it, it stays */
            swb_function_free(old);
        while (old && swb_function_sizes(old, &n, NULL, NULL, NULL, NULL, NULL) == SWB_OK);
    }
    return NULL;
}

static void freed_by_others(void)
{
    int64_t before = swb_live_objects();
    in_threads(make_and_free, NULL);
    for (int i = 0; i < 64; i++) {
        swb_function_free(slots[i]);
        slots[i] = NULL;
    }
    EXPECT(swb_live_objects() == before);
}

#if !defined(__SANITIZE_THREAD__) && !defined(__SANITIZE_ADDRESS__) /* their allocators stay locked in a child of several threads */
/* --- fork while others solve --- */

static volatile int stop;

static void *keep_solving(void *data)
{
    struct task *task = data;
    int32_t outcome;
    while (!stop)
        EXPECT(task_run(task, &outcome) == SWB_OK);
    return NULL;
}

static void forked(int times)
{
    swb_settings settings;
    struct task task;
    pthread_t thread;
    MUST(swb_settings_init(&settings, sizeof settings));
    settings.n_fe = 2;
    stop = 0;
    if (!task_create(&task, TASK_SOLVE, &settings) || pthread_create(&thread, NULL, keep_solving, &task) != 0)
        exit(2);
    for (int k = 0; k < times; k++) {
        fflush(NULL);
        pid_t child = fork();
        if (child == 0) { /* what others were at work on stays in use; new objects work */
            struct task own;
            int32_t outcome;
            int good = task_create(&own, TASK_SOLVE, &settings) && task_run(&own, &outcome) == SWB_OK && outcome == SWB_OUTCOME_SOLVED;
            _exit(good ? 0 : 1);
        }
        int status;
        EXPECT(waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
    }
    stop = 1;
    pthread_join(thread, NULL);
    task_free(&task);
}
#else
static void forked(int times)
{
    (void)times;
}
#endif

int main(int n, char **arguments)
{
    int rounds = n > 2 && strcmp(arguments[1], "--rounds") == 0 ? atoi(arguments[2]) : 1;
    for (int k = 0; k < rounds; k++) {
        constant_objects();
        own_objects();
        one_object();
        freed_by_others();
        forked(2);
        users_clear();
    }
    printf("threads: %d rounds, %d threads, %d defects\n", rounds, N_THREADS, failures);
    return failures != 0;
}
