/* Handles: what is freed stays freed, also when another object takes its place; what is no handle is refused unread. */
#include <pthread.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <unistd.h>

#include "models.h"

static swb_system *make_system(int64_t nx)
{
    swb_system *s = NULL;
    CHECK_OK(swb_system_create(nx, 0, 0, &s));
    return s;
}

/* Every use of a stale handle is refused with a message, and hurts no object that lives. */
static void stale(void)
{
    swb_system *first = make_system(1), *second;
    int64_t nx = 0;
    int k;

    swb_system_free(first);
    for (k = 0; k < 100; k++) {
        second = make_system(7);
        CHECK(second != first);
        CHECK_STATUS(SWB_ERR_STATE, swb_system_sizes(first, &nx, NULL, NULL, NULL));
        CHECK(strstr(swb_last_error(), "has been freed"));
        swb_system_free(first); /* not second */
        CHECK(strstr(swb_last_error(), "has been freed"));
        CHECK_OK(swb_system_sizes(second, &nx, NULL, NULL, NULL));
        CHECK(nx == 7);
        swb_system_free(second);
    }
}

static void foreign(void)
{
    union {
        double number;
        char bytes[64];
    } memory;
    swb_system *system = make_system(2), *other = (swb_system *)memory.bytes;
    swb_ocp *ocp = (swb_ocp *)(void *)system;
    int64_t n = 0;
    int k;

    memset(&memory, 0x5a, sizeof memory);
    for (k = 0; k < 16; k++) {
        other = (swb_system *)(void *)(memory.bytes + k);
        CHECK_STATUS(SWB_ERR_STATE, swb_system_sizes(other, &n, NULL, NULL, NULL));
        CHECK(strstr(swb_last_error(), "no such object"));
        swb_system_free(other);
        /* Addresses where nothing is. */
        other = (swb_system *)((uintptr_t)k * 4096 + (uintptr_t)k + 1);
        CHECK_STATUS(SWB_ERR_STATE, swb_system_sizes(other, &n, NULL, NULL, NULL));
        /* Next to a handle. */
        other = (swb_system *)((uintptr_t)system + 1u + (unsigned)k);
        CHECK_STATUS(SWB_ERR_STATE, swb_system_sizes(other, &n, NULL, NULL, NULL));
    }
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_sizes(ocp, &n, NULL, NULL, NULL));
    swb_ocp_free(ocp);
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_interrupt(ocp));
    CHECK_OK(swb_system_sizes(system, &n, NULL, NULL, NULL));
    CHECK(n == 2);
    swb_system_free(system);
    CHECK_STATUS(SWB_ERR_NULL, swb_system_sizes(NULL, &n, NULL, NULL, NULL));
}

/* A handle among the arguments. */
static void stale_arguments(void)
{
    swb_function *f = make_function("f", 2, 0, 0, 4, oscillator_modes, NULL);
    swb_system *system = make_oscillator(), *out_system = (swb_system *)&f;
    swb_ocp *ocp = (swb_ocp *)&f;

    swb_function_free(f);
    CHECK_STATUS(SWB_ERR_STATE, swb_system_set_f0(system, f));
    swb_system_free(system);
    CHECK_STATUS(SWB_ERR_STATE, swb_ocp_create(system, 1.0, 2, NULL, &ocp));
    CHECK(ocp == NULL);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_create(0, 0, 0, &out_system));
    CHECK(out_system == NULL);
}

enum { THREADS = 8, ROUNDS = 2000 };

static void *work(void *data)
{
    int64_t wanted = 1 + *(int *)data, found;
    swb_system *own, *stale_one = NULL;
    int k, *wrong = data;

    *wrong = 0;
    for (k = 0; k < ROUNDS; k++) {
        own = NULL;
        found = 0;
        *wrong += swb_system_create(wanted, 0, 0, &own) != SWB_OK;
        *wrong += swb_system_sizes(own, &found, NULL, NULL, NULL) != SWB_OK || found != wanted;
        *wrong += stale_one && swb_system_sizes(stale_one, &found, NULL, NULL, NULL) != SWB_ERR_STATE;
        swb_system_free(stale_one);
        swb_system_free(own);
        stale_one = own;
    }
    return NULL;
}

static void threads(void)
{
    pthread_t all[THREADS];
    int wrong[THREADS], k;

    for (k = 0; k < THREADS; k++) {
        wrong[k] = k;
        CHECK(pthread_create(&all[k], NULL, work, &wrong[k]) == 0);
    }
    for (k = 0; k < THREADS; k++) {
        pthread_join(all[k], NULL);
        CHECK(wrong[k] == 0);
    }
}

/* A child process goes on with the objects of its parent, and with its own. */
static void after_fork(void)
{
    swb_system *before = make_system(3);
    int status = -1;
    pid_t child = fork();

    if (child == 0) {
        swb_system *own = NULL;
        int64_t n = 0;
        int ok = swb_system_sizes(before, &n, NULL, NULL, NULL) == SWB_OK && n == 3;
        ok = ok && swb_system_create(4, 0, 0, &own) == SWB_OK;
        swb_system_free(before);
        ok = ok && swb_system_sizes(before, &n, NULL, NULL, NULL) == SWB_ERR_STATE;
        ok = ok && swb_system_sizes(own, &n, NULL, NULL, NULL) == SWB_OK && n == 4;
        swb_system_free(own);
        _exit(ok ? 0 : 1);
    }
    CHECK(child > 0 && waitpid(child, &status, 0) == child);
    CHECK(WIFEXITED(status) && WEXITSTATUS(status) == 0);
    swb_system_free(before);
}

/* A signal handler interrupts whatever handle it finds: live, being freed, freed, none. */
enum { WORKERS = 4 };
static swb_batch *volatile exposed[WORKERS];
static volatile sig_atomic_t signals;

static void on_alarm(int number)
{
    (void)number;
    signals++;
    swb_batch_interrupt(exposed[signals % WORKERS]);
}

static void *run_batches(void *data)
{
    static const double x0[4] = {1.0, 2.0, 3.0, 4.0};
    int *k = data, round;
    int32_t outcome[4];

    for (round = 0; round < 25; round++) {
        swb_system *system = make_oscillator();
        swb_batch *batch = NULL;
        CHECK_OK(swb_batch_create(system, NULL, &batch));
        exposed[*k] = batch;
        CHECK_OK(swb_batch_run(batch, 0.0, 0.1, x0, 4, NULL, 0, NULL, 0, 2));
        CHECK_OK(swb_batch_outcomes(batch, outcome, 2));
        CHECK(outcome[0] == SWB_RUN_OUTCOME_REACHED || outcome[0] == SWB_RUN_OUTCOME_STOPPED);
        swb_batch_free(batch);
        swb_system_free(system);
    }
    return NULL;
}

static void interrupts_from_signals(void)
{
    const struct itimerval often = {{0, 300}, {0, 300}}, never = {{0, 0}, {0, 0}};
    struct sigaction action;
    pthread_t all[WORKERS];
    int number[WORKERS], k;

    memset(&action, 0, sizeof action);
    action.sa_handler = on_alarm;
    action.sa_flags = SA_RESTART;
    CHECK(sigaction(SIGALRM, &action, NULL) == 0);
    CHECK_STATUS(SWB_ERR_NULL, swb_batch_interrupt(NULL));
    CHECK(strstr(swb_last_error(), "NULL"));
    CHECK(setitimer(ITIMER_REAL, &often, NULL) == 0);
    for (k = 0; k < WORKERS; k++) {
        number[k] = k;
        CHECK(pthread_create(&all[k], NULL, run_batches, &number[k]) == 0);
    }
    for (k = 0; k < WORKERS; k++)
        pthread_join(all[k], NULL);
    CHECK(setitimer(ITIMER_REAL, &never, NULL) == 0);
    /* A signal may still be pending, and the default action would end the program: from here on it is ignored. */
    action.sa_handler = SIG_IGN;
    CHECK(sigaction(SIGALRM, &action, NULL) == 0);
}

int main(void)
{
    int64_t before = swb_live_objects();

    stale();
    foreign();
    stale_arguments();
    threads();
    after_fork();
    interrupts_from_signals();
    CHECK(swb_live_objects() == before);
    return CHECK_DONE();
}
