/* What is done with a problem: every way through the library that takes time, with one interface. */
#ifndef TASKS_H
#define TASKS_H

#include "problems.h"

enum task_kind { TASK_SIMULATE, TASK_INTEGRATE, TASK_BATCH, TASK_SOLVE, TASK_ADAPT, TASK_SEARCH, TASK_WARM, TASK_SENSITIVITY, TASK_STARTS, TASK_PHASES, TASK_PROGRAM, N_TASKS };

extern const char *const task_names[];

struct task {
    enum task_kind kind;
    struct friction friction;
    struct corner corner;
    struct user *user; /* of all its functions */
    swb_ocp *ocp;
    swb_multiphase *phases;
    swb_integrator *integrator;
    swb_simulator *simulator;
    swb_batch *batch;
};

/* Settings that suit the task, from those given. */
void task_settings(enum task_kind kind, swb_settings *settings);

/* Make the object of a task; 0 if the library refuses the settings, with its message. */
int task_create(struct task *task, enum task_kind kind, const swb_settings *settings);
void task_free(struct task *task);

/* Give the object its data again, as it has them after task_create. */
void task_reset(struct task *task);

/* Do it: all calls, until the first that fails. The outcome is that of the last, -1 if there is none. */
swb_status task_run(struct task *task, int32_t *outcome);

/* The result as numbers; how many there are, at most `room`. */
int task_result(struct task *task, double *numbers, int room);

/* Change all settings of the object. */
swb_status task_set_settings(struct task *task, const swb_settings *settings);

/* Interrupt what runs; allowed in a signal handler. */
void task_interrupt(const struct task *task);

#endif
