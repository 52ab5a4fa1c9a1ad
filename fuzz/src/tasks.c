#include "tasks.h"

#include <string.h>

enum { N_STAGES = 3, N_RUNS = 3 };

const char *const task_names[] = {"simulate", "integrate", "batch", "solve", "adapt", "search", "warm", "sensitivity", "starts", "phases", "program"};

static int is_ocp(enum task_kind kind)
{
    return kind >= TASK_SOLVE && kind <= TASK_PHASES;
}

void task_settings(enum task_kind kind, swb_settings *settings)
{
    if (kind == TASK_ADAPT) {
        settings->adapt_tol = 1e-6;
        settings->adapt_rounds = 2;
        settings->adapt_elements = 16;
    }
    if (kind == TASK_SEARCH)
        settings->mode_search = 4;
    if (kind == TASK_INTEGRATE)
        settings->dense = settings->sensitivity = settings->adjoint = 1;
}

int task_create(struct task *task, enum task_kind kind, const swb_settings *settings)
{
    memset(task, 0, sizeof *task);
    task->kind = kind;
    if (kind == TASK_PROGRAM) {
        int made = corner_create(&task->corner, settings);
        task->user = task->corner.user;
        return made;
    }
    friction_create(&task->friction);
    task->user = task->friction.user;
    if (is_ocp(kind))
        task->ocp = friction_ocp(&task->friction, settings, N_STAGES);
    if (kind == TASK_PHASES && task->ocp) {
        swb_ocp *parts[] = {task->ocp, task->ocp};
        if (swb_multiphase_create(parts, 2, settings, &task->phases) == SWB_OK)
            MUST(swb_multiphase_link_continuous(task->phases, 0));
    }
    if (kind == TASK_SIMULATE)
        task->simulator = friction_simulator(&task->friction, settings);
    if (kind == TASK_INTEGRATE)
        task->integrator = friction_integrator(&task->friction, settings);
    if (kind == TASK_BATCH)
        task->batch = friction_batch(&task->friction, settings);
    int made = kind == TASK_PHASES ? task->phases != NULL : task->ocp || task->simulator || task->integrator || task->batch;
    if (!made)
        task_free(task);
    return made;
}

void task_free(struct task *task)
{
    if (task->kind == TASK_PROGRAM) {
        corner_free(&task->corner);
        return;
    }
    swb_multiphase_free(task->phases);
    swb_ocp_free(task->ocp);
    swb_simulator_free(task->simulator);
    swb_integrator_free(task->integrator);
    swb_batch_free(task->batch);
    friction_free(&task->friction);
}

void task_reset(struct task *task)
{
    if (task->simulator)
        MUST(swb_simulator_set_state(task->simulator, 0.0, friction_start, FRICTION_NX));
    if (task->integrator)
        MUST(swb_integrator_reinit(task->integrator, 0.0, friction_start, FRICTION_NX));
}

static swb_status run_integrator(struct task *task, int32_t *outcome)
{
    static const double v[FRICTION_NX] = {1.0, 0.5};
    double dx[FRICTION_NX], dp[FRICTION_NP], du[FRICTION_NU];
    swb_status status = swb_integrator_advance(task->integrator, 1.5, outcome);
    if (status != SWB_OK || *outcome != SWB_RUN_OUTCOME_REACHED)
        return status;
    status = swb_integrator_adjoint(task->integrator, v, FRICTION_NX, NULL, 0, NULL, 0, NULL, 0, NULL, 0, dx, FRICTION_NX, dp, FRICTION_NP, du, FRICTION_NU);
    return status == SWB_ERR_STATE ? SWB_OK : status; /* the option may be off */
}

static swb_status run_batch(struct task *task, int32_t *outcome)
{
    static const double starts[N_RUNS * FRICTION_NX] = {0.0, -0.4, 0.1, 0.3, 0.0, 0.0};
    int32_t outcomes[N_RUNS];
    swb_status status = swb_batch_run(task->batch, 0.0, 1.0, starts, N_RUNS * FRICTION_NX, friction_push, 1, friction_params, 1, 1);
    if (status == SWB_OK)
        status = swb_batch_outcomes(task->batch, outcomes, N_RUNS);
    if (status != SWB_OK)
        return status;
    int first = 0; /* that is not as it should be */
    while (first < N_RUNS - 1 && outcomes[first] == SWB_RUN_OUTCOME_REACHED)
        first++;
    *outcome = outcomes[first];
    if (*outcome < 0) { /* the message of a run that failed comes with the run */
        swb_run *run;
        status = swb_batch_get_run(task->batch, first, &run);
        swb_run_free(run);
    }
    return status;
}

static swb_status run_starts(struct task *task, int32_t *outcome)
{
    double u[2 * N_STAGES];
    int64_t best;
    swb_status status = swb_ocp_random_starts(task->ocp, 3, u, 2 * N_STAGES);
    if (status == SWB_OK)
        status = swb_ocp_solve_starts(task->ocp, u, 2 * N_STAGES, 1, &best);
    return status == SWB_OK ? swb_ocp_get_outcome(task->ocp, outcome) : status;
}

static swb_status run_sensitivity(struct task *task, int32_t *outcome)
{
    double cost[FRICTION_NX + FRICTION_NP];
    swb_status status = swb_ocp_solve(task->ocp, outcome);
    if (status != SWB_OK || *outcome == SWB_OUTCOME_STOPPED)
        return status;
    status = swb_ocp_get_sensitivity(task->ocp, cost, FRICTION_NX + FRICTION_NP, NULL, 0, NULL);
    /* A solution that is not exact, or no isolated minimiser, has none. */
    return status == SWB_ERR_STATE || status == SWB_ERR_NUMERIC ? SWB_OK : status;
}

swb_status task_run(struct task *task, int32_t *outcome)
{
    swb_status status;
    *outcome = -1;
    switch (task->kind) {
    case TASK_SIMULATE:
        return swb_simulator_run(task->simulator, 1.0, 3, outcome);
    case TASK_INTEGRATE:
        return run_integrator(task, outcome);
    case TASK_BATCH:
        return run_batch(task, outcome);
    case TASK_WARM:
        status = swb_ocp_solve(task->ocp, outcome);
        if (status != SWB_OK || *outcome == SWB_OUTCOME_STOPPED)
            return status;
        return swb_ocp_solve_warm(task->ocp, outcome);
    case TASK_SENSITIVITY:
        return run_sensitivity(task, outcome);
    case TASK_STARTS:
        return run_starts(task, outcome);
    case TASK_PHASES:
        return swb_multiphase_solve(task->phases, outcome);
    case TASK_PROGRAM:
        return swb_mpcc_solve(task->corner.mpcc, outcome);
    default:
        return swb_ocp_solve(task->ocp, outcome);
    }
}

int task_result(struct task *task, double *numbers, int room)
{
    swb_multiphase_info info;
    int n = 0;
    if (task->simulator && swb_simulator_get_state(task->simulator, numbers, FRICTION_NX) == SWB_OK)
        n = FRICTION_NX;
    else if (task->integrator && swb_integrator_get_state(task->integrator, numbers, FRICTION_NX) == SWB_OK)
        n = FRICTION_NX;
    else if (task->batch && swb_batch_states(task->batch, numbers, N_RUNS * FRICTION_NX) == SWB_OK)
        n = N_RUNS * FRICTION_NX;
    else if (task->phases && swb_multiphase_get_info(task->phases, &info, sizeof info) == SWB_OK)
        numbers[n++] = info.cost;
    else if (task->ocp && swb_ocp_get_controls(task->ocp, numbers + 1, N_STAGES) == SWB_OK && swb_ocp_get_cost(task->ocp, numbers) == SWB_OK)
        n = 1 + N_STAGES;
    else if (task->kind == TASK_PROGRAM && swb_mpcc_get_solution(task->corner.mpcc, numbers, 3) == SWB_OK)
        n = 3;
    return n <= room ? n : 0;
}

swb_status task_set_settings(struct task *task, const swb_settings *settings)
{
    if (task->simulator)
        return swb_simulator_set_settings(task->simulator, settings);
    if (task->integrator)
        return swb_integrator_set_settings(task->integrator, settings);
    if (task->kind == TASK_PROGRAM)
        return swb_mpcc_set_settings(task->corner.mpcc, settings);
    if (task->ocp && !task->phases)
        return swb_ocp_set_settings(task->ocp, settings);
    return SWB_OK; /* batches and phases take theirs when they are made */
}

void task_interrupt(const struct task *task)
{
    if (task->simulator)
        swb_simulator_interrupt(task->simulator);
    if (task->integrator)
        swb_integrator_interrupt(task->integrator);
    if (task->batch)
        swb_batch_interrupt(task->batch);
    if (task->phases)
        swb_multiphase_interrupt(task->phases);
    else if (task->ocp)
        swb_ocp_interrupt(task->ocp);
    if (task->kind == TASK_PROGRAM)
        swb_mpcc_interrupt(task->corner.mpcc);
}
