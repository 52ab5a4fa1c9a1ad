/* Functions of the user that fail at their n-th call, in every way, for all n (or every so many): the call ends with a
 * status, and the same object then solves to the same bits as one that nobody ever disturbed.
 *
 *   faults [--stride N] [--seed OFFSET] [--seconds N] [--only NUMBER] */
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "cases.h"
#include "tasks.h"

enum { ROOM = 64, LATEST = 4096 };

/* The object of the kind that is used now, kept from case to case: what one leaves behind would be seen in the next. */
static struct task task;
static int kept = -1;
static double undisturbed[ROOM];
static int n_undisturbed;
static int64_t calls;
/* Only what a fault disturbs may take for ever: what is compared afterwards is not interrupted, however slow the machine is. */
static volatile sig_atomic_t disturbed, interrupted;

static void drop(void)
{
    if (kept >= 0)
        task_free(&task);
    kept = -1;
}

/* The functions of another object, and options: calls back into the library that are allowed. */
static void again(void)
{
    swb_settings settings;
    swb_function *f = NULL;
    MUST(swb_settings_init(&settings, sizeof settings));
    if (swb_function_create("inner", 1, 0, 0, 1, user_value, user_new(7, 1, 0, 0, 1), NULL, &f) == SWB_OK) {
        double x = 0.5, y;
        swb_point at = {0.0, &x, NULL, NULL};
        MUST(swb_function_eval(f, &at, &y, 1));
        swb_function_free(f);
    }
    /* Into the object itself: refused, whatever it is. */
    int32_t outcome;
    if (task_run(&task, &outcome) != SWB_ERR_STATE)
        cases_wrong("a callback could call into the object that calls it");
}

static void hook(enum fault fault)
{
    if (fault == FAULT_AGAIN)
        again();
    if (fault == FAULT_INTERRUPT)
        task_interrupt(&task);
    if (fault == FAULT_FREE) { /* what runs stays; what it does not need any more goes: this is done once */
        struct task copy = task;
        swb_simulator_free(copy.simulator);
        swb_integrator_free(copy.integrator);
        swb_batch_free(copy.batch);
        if (copy.phases)
            swb_multiphase_free(copy.phases);
        else
            swb_ocp_free(copy.ocp);
        swb_mpcc_free(copy.corner.mpcc);
    }
}

static int same_as_undisturbed(const char *after)
{
    double numbers[ROOM];
    int n = task_result(&task, numbers, ROOM);
    if (n != n_undisturbed)
        return cases_wrong("%s there are %d numbers in the result, not %d", after, n, n_undisturbed);
    for (int i = 0; i < n; i++)
        if (memcmp(&numbers[i], &undisturbed[i], sizeof numbers[i]) != 0)
            return cases_wrong("%s number %d of the result is %.17g, not %.17g", after, i, numbers[i], undisturbed[i]);
    return 0;
}

/* An object of the kind, and what it does when nobody disturbs it. */
static int prepare(enum task_kind kind)
{
    int32_t outcome;
    swb_settings settings;
    if (kept == (int)kind)
        return 0;
    drop();
    MUST(swb_settings_init(&settings, sizeof settings));
    settings.n_fe = 2;
    settings.max_iter = 300;
    task_settings(kind, &settings);
    if (!task_create(&task, kind, &settings))
        return cases_wrong("create: %s", swb_last_error());
    kept = (int)kind;
    task.user->calls = 0;
    MUST(task_run(&task, &outcome));
    calls = task.user->calls;
    n_undisturbed = task_result(&task, undisturbed, ROOM);
    if (n_undisturbed == 0)
        return cases_wrong("no result");
    task_reset(&task);
    if (task_run(&task, &outcome) != SWB_OK || same_as_undisturbed("a second time")) {
        drop();
        return 1;
    }
    return 0;
}

/* Cases run through the tasks, the faults, and the calls 1, 2, ..., LATEST; those behind the last call do nothing. */
static enum task_kind kind_of(int64_t number)
{
    return (enum task_kind)(number / (LATEST * (N_FAULTS - 1)));
}

static enum fault fault_of(int64_t number)
{
    return (enum fault)(1 + number / LATEST % (N_FAULTS - 1));
}

static void describe(int64_t number, char *text, size_t size)
{
    snprintf(text, size, "%s, %s at call %d", task_names[kind_of(number)], fault_names[fault_of(number)], (int)(number % LATEST) + 1);
}

static int run(int64_t number)
{
    int32_t outcome;
    enum fault fault = fault_of(number);
    if (prepare(kind_of(number)))
        return 1;
    if (number % LATEST >= calls)
        return 0;
    user_hook = hook;
    task_reset(&task);
    task.user->fault = fault;
    task.user->fault_at = task.user->calls + 1 + number % LATEST;
    interrupted = 0;
    disturbed = 1;
    swb_status status = task_run(&task, &outcome);
    disturbed = 0;
    task.user->fault = FAULT_NONE;
    user_hook = NULL;
    int wrong = cases_bad_status(status, fault_names[fault]);
    /* Of several runs or starts the others go on: the call succeeds. */
    int several = task.kind == TASK_BATCH || task.kind == TASK_STARTS;
    if (fault == FAULT_STOP && !several && (status != SWB_ERR_USER || swb_last_user_code() != -7))
        wrong = cases_wrong("a callback returned -7, and the call %s with %d", swb_status_name(status), swb_last_user_code());
    if (interrupted) /* one that came too late is for the next call */
        (void)task_run(&task, &outcome);
    task_reset(&task);
    status = task_run(&task, &outcome);
    if (status != SWB_OK)
        wrong = cases_wrong("afterwards: %s: %s", swb_status_name(status), swb_last_error());
    else if (same_as_undisturbed("afterwards"))
        wrong = 1;
    if (wrong)
        drop();
    return wrong;
}

static void interrupt(void)
{
    if (kept >= 0 && disturbed) {
        interrupted = 1;
        task_interrupt(&task);
    }
}

int main(int n, char **arguments)
{
    const struct cases cases = {"faults", (int64_t)N_TASKS * (N_FAULTS - 1) * LATEST, run, describe, interrupt};
    return cases_main(&cases, n, arguments);
}
