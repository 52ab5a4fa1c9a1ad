/* How long a call goes on after it was interrupted: at random moments of everything that takes time.
 *
 *   latency [--samples N] [--seed N]
 *
 * What counts is the processor time of the thread that solves, so other programs on the machine do not disturb. The
 * bound is generous, and relative to what the whole call takes when nobody interrupts it: a call that is deaf in one of
 * its phases is found, a slow machine is not. */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "random.h"
#include "tasks.h"

/* A call may go on for this share of its time, and for what the timer and the machine need to notice. */
static const double share = 0.25, slack = 0.1;

static double seconds(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

struct alarm {
    const struct task *task;
    clockid_t clock; /* of the thread that solves */
    double at;       /* its time at which it is interrupted */
    double done;     /* when that was */
    volatile int over;
};

static void *ring(void *data)
{
    struct alarm *alarm = data;
    while (!alarm->over && seconds(alarm->clock) < alarm->at)
        nanosleep(&(struct timespec){0, 200000}, NULL);
    alarm->done = seconds(alarm->clock);
    task_interrupt(alarm->task);
    return NULL;
}

static void settings_of(enum task_kind kind, swb_settings *settings)
{
    MUST(swb_settings_init(settings, sizeof *settings));
    settings->n_fe = 6;
    settings->n_s = 3;
    task_settings(kind, settings);
    settings->adapt_elements = 60;
    settings->rtol = settings->atol = 1e-12;
    settings->h_max = 1e-4;
    settings->max_steps = 10000000;
}

/* Worst latency of some samples; negative if an object was not usable afterwards. */
static double worst_of(enum task_kind kind, int samples, struct random *r, double *whole)
{
    int32_t outcome;
    double worst = 0.0;
    swb_settings settings;
    struct task task;
    settings_of(kind, &settings);
    if (!task_create(&task, kind, &settings))
        return -1.0;
    double began = seconds(CLOCK_THREAD_CPUTIME_ID);
    MUST(task_run(&task, &outcome));
    *whole = seconds(CLOCK_THREAD_CPUTIME_ID) - began;
    for (int i = 0; i < samples; i++) {
        struct alarm alarm = {&task, 0, 0.0, 0.0, 0};
        pthread_t thread;
        task_reset(&task);
        pthread_getcpuclockid(pthread_self(), &alarm.clock);
        alarm.at = seconds(alarm.clock) + *whole * random_between(r, 0.0, 1.0);
        if (pthread_create(&thread, NULL, ring, &alarm) != 0)
            return -1.0;
        swb_status status = task_run(&task, &outcome);
        double end = seconds(CLOCK_THREAD_CPUTIME_ID);
        alarm.over = 1;
        pthread_join(thread, NULL);
        if (status != SWB_OK && status != SWB_ERR_INTERRUPTED)
            return -1.0;
        if (end > alarm.done)
            worst = fmax(worst, end - alarm.done);
        /* An interrupt that came too late is for the next call: take it away. */
        task_reset(&task);
        task_interrupt(&task);
        task_run(&task, &outcome);
    }
    task_free(&task);
    return worst;
}

int main(int n, char **arguments)
{
    int samples = 3, failed = 0;
    struct random r = random_stream(1, 5);
    for (int i = 1; i + 1 < n; i += 2) {
        if (strcmp(arguments[i], "--samples") == 0)
            samples = atoi(arguments[i + 1]);
        if (strcmp(arguments[i], "--seed") == 0)
            r = random_stream(strtoull(arguments[i + 1], NULL, 10), 5);
    }
    printf("latency of interrupts, %d samples each, seconds of the processor:\n", samples);
    for (int kind = 0; kind < N_TASKS; kind++) {
        double whole = 0.0, worst = worst_of((enum task_kind)kind, samples, &r, &whole);
        int late = worst < 0.0 || worst > share * whole + slack;
        printf("  %-12s worst %.4f of %.3f%s\n", task_names[kind], worst, whole,
               worst < 0.0 ? "  DEFECT: the object is not usable" : late ? "  DEFECT: late" : "");
        if (worst < 0.0)
            printf("    %s\n", swb_last_error());
        failed += late;
    }
    users_clear();
    return failed != 0;
}
