/* Callbacks that fail, stop, count and call back; interrupts; threads; the wrong object at the wrong time. */
#include <pthread.h>
#include <stdlib.h>

#include "models.h"

static const int64_t ROWS[] = {0, 1};
static const int8_t SIGNS[] = {-1, 1};

/* The oscillator, whose modes return a code from a call on. */
struct failing {
    int calls, from;
    int32_t code;
};

static int32_t failing_modes(const swb_point *at, double *out, void *user_data)
{
    struct failing *f = (struct failing *)user_data;
    oscillator_modes(at, out, NULL);
    if (++f->calls < f->from)
        return 0;
    if (f->code == 0)
        out[1] = (double)NAN;
    return f->code;
}

static swb_simulator *make_failing(struct failing *f)
{
    swb_function *modes = make_function("F", 2, 0, 0, 4, failing_modes, f);
    swb_function *psi = make_function("c", 2, 0, 0, 1, circle, NULL);
    swb_system *system = NULL;
    swb_simulator *sim = NULL;

    CHECK_OK(swb_system_create(2, 0, 0, &system));
    CHECK_OK(swb_system_add_subsystem(system, ROWS, 2, modes, 2, psi, SIGNS, 2, NULL));
    CHECK_OK(swb_simulator_create(system, NULL, &sim));
    CHECK_OK(swb_simulator_set_state(sim, 0.0, OSCILLATOR_X0, 2));
    swb_function_free(modes);
    swb_function_free(psi);
    swb_system_free(system);
    return sim;
}

static void failing_functions(void)
{
    struct failing f = {0, 0, -77};
    swb_simulator *sim;
    swb_trajectory *r = NULL;
    swb_trajectory_info info;
    int32_t outcome = 55;
    int calls;
    double t = -1.0, x[2];

    f.from = 1 << 30;
    sim = make_failing(&f);
    CHECK_OK(swb_simulator_run(sim, 0.4, 4, NULL));
    calls = f.calls;

    /* A negative code in the third step: the first two are kept, no call follows the one that failed. */
    CHECK_OK(swb_simulator_set_state(sim, 0.0, OSCILLATOR_X0, 2));
    f.calls = 0;
    f.from = calls / 2 + 2;
    CHECK_STATUS(SWB_ERR_USER, swb_simulator_run(sim, 0.4, 4, &outcome));
    CHECK(outcome == 55 && swb_last_user_code() == -77);
    CHECK(strstr(swb_last_error(), "function 'F'") != NULL);
    CHECK(f.calls == f.from);
    CHECK_OK(swb_simulator_get_outcome(sim, &outcome));
    CHECK(outcome == SWB_OUTCOME_FAILED);
    CHECK_OK(swb_simulator_get_time(sim, &t));
    CHECK_NEAR(t, 0.2, 1e-14);
    CHECK_OK(swb_simulator_get_trajectory(sim, &r));
    CHECK_OK(swb_trajectory_get_info(r, &info, sizeof info));
    CHECK_NEAR(info.t_end, 0.2, 1e-14);
    swb_trajectory_free(r);

    /* NaN for good, and a positive code. */
    f.code = 0;
    CHECK_STATUS(SWB_ERR_NONFINITE, swb_simulator_run(sim, 0.2, 2, &outcome));
    f.code = 5;
    CHECK_STATUS(SWB_ERR_NONFINITE, swb_simulator_run(sim, 0.2, 2, &outcome));
    CHECK(strstr(swb_last_error(), "code 5") != NULL);

    /* Well again: go on where it stopped. */
    f.from = 1 << 30;
    CHECK_OK(swb_simulator_run(sim, 0.2, 2, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_OK(swb_simulator_get_state(sim, x, 2));
    CHECK_OK(swb_simulator_get_time(sim, &t));
    CHECK_NEAR(t, 0.4, 1e-14);
    CHECK_NEAR(hypot(x[0], x[1]), exp(t - 1.0), 1e-3);
    swb_simulator_free(sim);
}

/* A program whose objective and monitor look at the program itself. */
struct nosy {
    swb_mpcc *mpcc, *other;
    swb_status own, shared, other_status, freed;
    int iterations, stop_at, lines[6];
    double last_mu;
};

static int32_t nosy_objective(const swb_point *at, double *out, void *user_data)
{
    struct nosy *n = (struct nosy *)user_data;
    double a = at->x[0] - 2.0, b = at->x[1] - 1.0;
    out[0] = a * a + b * b + 0.1 * a * a * b * b;
    if (n->mpcc) {
        double f;
        n->own = swb_mpcc_solve(n->mpcc, NULL);
        n->shared = swb_mpcc_get_objective(n->mpcc, &f);
        swb_mpcc_free(n->mpcc); /* refused: it is in use */
        n->freed = swb_mpcc_set_start(n->mpcc, at->x, 2);
        if (n->other)
            n->other_status = swb_mpcc_solve(n->other, NULL);
    }
    return 0;
}

static int32_t monitor(const swb_iteration_info *info, void *user_data)
{
    struct nosy *n = (struct nosy *)user_data;
    CHECK(info->struct_size >= sizeof *info);
    CHECK(info->iter >= 0 && info->mu >= 0.0 && info->inf_pr >= 0.0 && info->trials >= 0);
    CHECK(strchr(" rpjs", (int)info->phase) != NULL);
    n->last_mu = info->mu;
    return ++n->iterations == n->stop_at;
}

static void listener(int64_t level, const char *line, void *user_data)
{
    struct nosy *n = (struct nosy *)user_data;
    CHECK(level >= SWB_LOG_LEVEL_ERROR && level <= SWB_LOG_LEVEL_TRACE && strchr(line, '='));
    n->lines[level]++;
}

static swb_mpcc *make_program(struct nosy *n)
{
    swb_function *f = make_function("f", 2, 0, 0, 1, nosy_objective, n);
    swb_mpcc *mpcc = NULL;
    CHECK_OK(swb_mpcc_create(2, 0, f, NULL, NULL, &mpcc));
    CHECK_OK(swb_mpcc_add_pair(mpcc, SWB_MEMBER_VARIABLE, 0, SWB_MEMBER_VARIABLE, 1));
    swb_function_free(f);
    return mpcc;
}

static void calling_back(void)
{
    struct nosy n, inner;
    swb_mpcc *mpcc;
    int32_t outcome = -1;
    double x[2];

    memset(&n, 0, sizeof n);
    memset(&inner, 0, sizeof inner);
    mpcc = make_program(&n);
    n.mpcc = mpcc;
    n.other = make_program(&inner);
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK(n.own == SWB_ERR_STATE && n.shared == SWB_ERR_STATE && n.freed == SWB_ERR_STATE);
    CHECK(n.other_status == SWB_OK);
    CHECK_OK(swb_mpcc_get_solution(mpcc, x, 2));
    CHECK_NEAR(x[0], 2.0, 1e-5);
    n.mpcc = NULL;
    swb_mpcc_free(n.other);

    /* The monitor sees every iteration and may stop. */
    CHECK_OK(swb_mpcc_set_iteration(mpcc, monitor, &n));
    CHECK_OK(swb_mpcc_set_log(mpcc, listener, &n));
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED && n.iterations > 3 && n.lines[SWB_LOG_LEVEL_INFO] == 0);
    n.stop_at = n.iterations + 3;
    CHECK_OK(swb_mpcc_set_string(mpcc, "log_level", "debug"));
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_STOPPED && n.iterations == n.stop_at);
    CHECK(n.lines[SWB_LOG_LEVEL_DEBUG] == 3 && n.lines[SWB_LOG_LEVEL_WARNING] >= 1);
    CHECK_OK(swb_mpcc_set_iteration(mpcc, NULL, NULL));
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED && n.lines[SWB_LOG_LEVEL_INFO] == 1);

    /* An interrupt ahead of the call stops it, and only it. */
    CHECK_OK(swb_mpcc_interrupt(mpcc));
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_STOPPED);
    CHECK_OK(swb_mpcc_solve(mpcc, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    CHECK_STATUS(SWB_ERR_NULL, swb_mpcc_interrupt(NULL));
    swb_mpcc_free(mpcc);
}

/* Interrupt from another thread. */
static int32_t wait_a_little(const swb_iteration_info *info, void *user_data)
{
    volatile double sum = 0.0;
    int i;
    (void)info;
    (void)user_data;
    for (i = 0; i < 20000; i++)
        sum += (double)i;
    return 0;
}

static void *interrupter(void *argument)
{
    volatile double sum = 0.0;
    int i;
    for (i = 0; i < 200000; i++)
        sum += (double)i;
    return swb_simulator_interrupt((swb_simulator *)argument) == SWB_OK ? NULL : argument;
}

static void interrupts(void)
{
    struct failing f = {0, 1 << 30, 0};
    swb_simulator *sim = make_failing(&f);
    pthread_t thread;
    void *wrong;
    int32_t outcome = -1;
    double t;

    CHECK_OK(swb_simulator_set_iteration(sim, wait_a_little, NULL));
    CHECK(pthread_create(&thread, NULL, interrupter, sim) == 0);
    /* shrinking circles never leave the disc backwards in radius; long enough to be interrupted */
    CHECK_OK(swb_simulator_run(sim, 0.9, 100000, &outcome));
    CHECK(pthread_join(thread, &wrong) == 0 && wrong == NULL);
    CHECK(outcome == SWB_OUTCOME_STOPPED);
    CHECK_OK(swb_simulator_get_time(sim, &t));
    CHECK(t < 0.9);
    CHECK_OK(swb_simulator_set_iteration(sim, NULL, NULL));
    CHECK_OK(swb_simulator_run(sim, 0.95 - t, 10, &outcome));
    CHECK(outcome == SWB_OUTCOME_SOLVED);
    swb_simulator_free(sim);
}

/* Own objects in two threads, the same functions: the same bits. */
struct job {
    swb_system *system;
    double x[2];
    int failures;
};

static void *simulate(void *argument)
{
    struct job *job = (struct job *)argument;
    swb_simulator *sim = NULL;
    int i;

    if (swb_simulator_create(job->system, NULL, &sim) != SWB_OK)
        job->failures++;
    for (i = 0; i < 3; i++) {
        if (swb_simulator_set_state(sim, 0.0, OSCILLATOR_X0, 2) != SWB_OK)
            job->failures++;
        if (swb_simulator_run(sim, OSCILLATOR_T, 20, NULL) != SWB_OK)
            job->failures++;
        if (swb_simulator_get_state(sim, job->x, 2) != SWB_OK)
            job->failures++;
        if (swb_simulator_set_state(sim, 0.0, OSCILLATOR_X0, 3) != SWB_ERR_DIMENSION)
            job->failures++;
        swb_error_handled();
    }
    swb_simulator_free(sim);
    return NULL;
}

static void threads(void)
{
    struct job jobs[2];
    pthread_t thread[2];
    int i;

    memset(jobs, 0, sizeof jobs);
    jobs[0].system = jobs[1].system = make_oscillator();
    for (i = 0; i < 2; i++)
        CHECK(pthread_create(&thread[i], NULL, simulate, &jobs[i]) == 0);
    for (i = 0; i < 2; i++)
        CHECK(pthread_join(thread[i], NULL) == 0 && jobs[i].failures == 0);
    CHECK(jobs[0].x[0] == jobs[1].x[0] && jobs[0].x[1] == jobs[1].x[1]);
    CHECK_NEAR(jobs[0].x[0], OSCILLATOR_XT[0], 1e-2);
    swb_system_free(jobs[0].system);
}

static void wrong_calls(void)
{
    swb_system *system = NULL, *empty = NULL;
    swb_simulator *sim = NULL;
    swb_trajectory *r = NULL;
    swb_function *modes = make_function("F", 2, 0, 0, 4, oscillator_modes, NULL);
    swb_function *psi = make_function("c", 2, 0, 0, 1, circle, NULL);
    swb_settings settings;
    swb_trajectory_info info;
    swb_stats stats;
    static const int64_t twice[] = {0, 0}, outside[] = {0, 2}, negative[] = {-1, 0};
    static const int8_t overlap[] = {1, 1}, zero[] = {0, 1}, wild[] = {-1, 2};
    double x[2] = {(double)NAN, 0.0};
    int64_t index = 44, n;

    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_create(0, 0, 0, &system));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_create(2, -1, 0, &system));
    CHECK_STATUS(SWB_ERR_NULL, swb_system_create(2, 0, 0, NULL));
    CHECK_OK(swb_system_create(2, 0, 0, &system));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_subsystem(system, twice, 2, modes, 2, psi, SIGNS, 2, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_subsystem(system, outside, 2, modes, 2, psi, SIGNS, 2, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_subsystem(system, negative, 2, modes, 2, psi, SIGNS, 2, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_subsystem(system, ROWS, 1, modes, 2, psi, SIGNS, 2, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_subsystem(system, ROWS, 2, modes, 3, psi, SIGNS, 2, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_subsystem(system, ROWS, 2, modes, 2, psi, SIGNS, 1, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_subsystem(system, ROWS, 2, modes, -2, psi, SIGNS, 2, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_subsystem(system, ROWS, 2, modes, 2, psi, overlap, 2, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_subsystem(system, ROWS, 2, modes, 2, psi, zero, 2, &index));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_subsystem(system, ROWS, 2, modes, 2, psi, wild, 2, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_system_add_subsystem(system, ROWS, 2, modes, 2, NULL, SIGNS, 2, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_system_add_subsystem(system, NULL, 2, modes, 2, psi, SIGNS, 2, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_subsystem_indicators(system, ROWS, 2, modes, 2, psi, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_set_f0(system, psi));
    CHECK_STATUS(SWB_ERR_NULL, swb_system_set_f0(system, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_inclusion(system, ROWS, 2, modes, psi, &index));
    CHECK(strstr(swb_last_error(), "expected (3, 0, 0)") != NULL);
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_inclusion(system, twice, 2, modes, psi, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_system_add_inclusion(system, ROWS, 2, NULL, psi, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_set_algebraic(system, 2, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_set_algebraic(system, -1, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_set_algebraic(system, 1, modes));
    CHECK_STATUS(SWB_ERR_STATE, swb_system_add_complementarity(system, ROWS, 1, NULL, psi, &index));
    CHECK(strstr(swb_last_error(), "set_algebraic") != NULL);
    CHECK_OK(swb_system_set_algebraic(system, 1, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_system_add_complementarity(system, outside, 2, NULL, psi, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_complementarity(system, &ROWS[1], 1, NULL, modes, &index));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_system_add_complementarity(system, &ROWS[1], 1, modes, psi, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_system_add_complementarity(system, &ROWS[1], 1, NULL, NULL, &index));
    CHECK_STATUS(SWB_ERR_NULL, swb_system_add_complementarity(system, NULL, 1, NULL, psi, &index));
    CHECK_OK(swb_system_set_algebraic(system, 0, NULL));
    CHECK(index == 44);
    CHECK_OK(swb_system_add_subsystem(system, ROWS, 2, modes, 2, psi, SIGNS, 2, &index));
    CHECK_OK(swb_system_sizes(system, NULL, NULL, NULL, &n));
    CHECK(index == 0 && n == 1);

    CHECK_OK(swb_system_create(1, 0, 0, &empty));
    CHECK_STATUS(SWB_ERR_STATE, swb_simulator_create(empty, NULL, &sim));
    CHECK(strstr(swb_last_error(), "set f0") != NULL);
    CHECK_OK(swb_settings_init(&settings, sizeof settings));
    settings.n_s = 99;
    CHECK_STATUS(SWB_ERR_RANGE, swb_simulator_create(system, &settings, &sim));
    settings.n_s = 2;
    settings.rk_family = SWB_RK_FAMILY_EXPLICIT;
    settings.stage_form = SWB_STAGE_FORM_VALUES;
    CHECK_STATUS(SWB_ERR_UNSUPPORTED, swb_simulator_create(system, &settings, &sim));
    CHECK_STATUS(SWB_ERR_NULL, swb_simulator_create(NULL, NULL, &sim));
    CHECK_STATUS(SWB_ERR_STATE, swb_simulator_create((swb_system *)modes, NULL, &sim));
    CHECK(sim == NULL);

    CHECK_OK(swb_simulator_create(system, NULL, &sim));
    CHECK_STATUS(SWB_ERR_RANGE, swb_simulator_set_state(sim, 0.0, x, 2));
    CHECK_STATUS(SWB_ERR_RANGE, swb_simulator_set_state(sim, x[0], OSCILLATOR_X0, 2));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_simulator_set_state(sim, 0.0, OSCILLATOR_X0, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_simulator_set_controls(sim, x, 1));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_simulator_set_params(sim, x, 1));
    CHECK_STATUS(SWB_ERR_RANGE, swb_simulator_run(sim, 0.0, 1, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_simulator_run(sim, (double)INFINITY, 1, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_simulator_run(sim, 1.0, 0, NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_simulator_step(sim, -1.0, NULL));
    CHECK_STATUS(SWB_ERR_NULL, swb_simulator_run(NULL, 1.0, 1, NULL));
    CHECK_STATUS(SWB_ERR_OPTION, swb_simulator_set_int(sim, "n_fee", 3));
    CHECK(strstr(swb_last_error(), "n_fe") != NULL);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_simulator_get_state(sim, x, 3));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_simulator_get_stats(sim, &stats, 5));
    CHECK_STATUS(SWB_ERR_NULL, swb_simulator_get_stats(sim, NULL, sizeof stats));
    CHECK_STATUS(SWB_ERR_NULL, swb_simulator_get_trajectory(sim, NULL));
    CHECK_OK(swb_simulator_get_trajectory(sim, &r));
    CHECK_STATUS(SWB_ERR_STATE, swb_trajectory_get_info((swb_trajectory *)sim, &info, sizeof info));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_trajectory_times(r, x, 2));
    swb_trajectory_free((swb_trajectory *)sim); /* refused */
    CHECK_OK(swb_simulator_get_time(sim, x));
    swb_trajectory_free(r);
    swb_simulator_free(sim);
    swb_simulator_free(NULL);
    swb_system_free(system);
    swb_system_free(empty);
    swb_function_free(modes);
    swb_function_free(psi);
}

int main(void)
{
    failing_functions();
    calling_back();
    interrupts();
    threads();
    wrong_calls();
    return CHECK_DONE();
}
