/* Random calls of all functions of the library.
 *
 *   fuzz [--seed N] [--runs N] [--seconds S] [--calls N] [--hang S]     many runs, each in a process of its own
 *   fuzz --replay SEED [--calls N] [--skip FIRST-LAST]... [--quiet]     one run in this process, every call printed
 *
 * With --seconds they go on for that time, and then until every function has succeeded, but in this not beyond --runs.
 * A run makes a world of objects and does some hundred random calls; the seed decides everything but the moment at which
 * a call that takes long is interrupted. The exit code is 1 if anything is wrong, see README.md. */
#include <errno.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "draw.h"
#include "pool.h"
#include "run.h"
#include "user.h"
#include "world.h"

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/lsan_interface.h>
#define LEAKS() __lsan_do_recoverable_leak_check()
#else
#define LEAKS() 0
#endif

enum { MAX_SKIPS = 4096, INTERRUPT_AFTER = 2 };

static struct {
    uint64_t seed;
    int64_t runs, calls;
    double seconds, hang;
    int replay, quiet;
    int64_t skip[MAX_SKIPS][2];
    int n_skips;
} options = {.seed = 1, .runs = 50, .calls = 500, .hang = 120.0};

static int skipped(int64_t call)
{
    for (int i = 0; i < options.n_skips; i++)
        if (options.skip[i][0] <= call && call <= options.skip[i][1])
            return 1;
    return 0;
}

/* A call that has used the processor for long is interrupted: it has to end soon, then. */
static void on_timer(int signal)
{
    (void)signal;
    double began = tally->began;
    if (began > 0.0 && run_now() - began > INTERRUPT_AFTER) {
        if (tally->interrupted == 0.0)
            tally->interrupted = run_now();
        run_interrupt();
    }
}

static void start_timer(void)
{
    struct sigaction action = {.sa_handler = on_timer, .sa_flags = SA_RESTART};
    struct itimerval every = {{0, 500000}, {0, 500000}};
    sigaction(SIGPROF, &action, NULL);
    setitimer(ITIMER_PROF, &every, NULL);
}

/* One run; the number of defects. */
static int run(uint64_t seed)
{
    int before = tally->defects;
    run_seed = seed;
    tally->call = -1;
    run_begin();
    draw_reset();
    struct random r = random_stream(seed, 0);
    world_create(&r);
    for (int64_t call = 0; call < options.calls; call++) {
        tally->call = call;
        struct random own = random_stream(seed, 1000 + (uint64_t)call); /* so that calls can be left out */
        if (!skipped(call))
            run_any(&own);
    }
    tally->call = options.calls;
    tally->function = -1;
    user_hook = NULL;
    pool_clear();
    if (swb_live_objects() != 0)
        run_defect("%" PRId64 " objects are alive after all were freed", swb_live_objects());
    const char *complaint = users_complaint();
    if (complaint)
        run_defect("%s", complaint);
    users_clear();
    if (LEAKS())
        run_defect("memory leaked");
    return tally->defects - before;
}

/* --- the process that watches --- */

static int watch(pid_t child, uint64_t seed)
{
    int status;
    while (waitpid(child, &status, WNOHANG) == 0) {
        double began = tally->began;
        if (began > 0.0 && run_now() - began > options.hang) {
            kill(child, SIGKILL);
            waitpid(child, &status, 0);
            run_defect("hangs for %.0f s%s", options.hang, tally->interrupted > 0.0 ? ", although interrupted" : "");
            tally->began = 0.0;
            return 1;
        }
        nanosleep(&(struct timespec){0, 2000000}, NULL);
    }
    if (WIFSIGNALED(status))
        run_defect("killed by signal %d", WTERMSIG(status));
    else if (WEXITSTATUS(status) != 0 && tally->defects == 0)
        run_defect("ended with exit code %d: see above", WEXITSTATUS(status));
    tally->began = 0.0;
    if (status != 0)
        fprintf(stderr, "replay: --replay %" PRIu64 " --calls %" PRId64 "\n", seed, tally->call + 1);
    return status != 0;
}

/* A function without a status cannot fail. */
static int never_succeeded(int function)
{
    return tally->succeeded[function] == 0 && functions[function].result != R_NOTHING;
}

static int report(int64_t runs, double seconds)
{
    int never = 0, slowest = 0;
    printf("%" PRId64 " runs from seed %" PRIu64 ", %" PRIu64 " calls (%" PRIu64 " from callbacks) in %.0f s, %d defects\n", runs, options.seed,
           tally->calls, tally->nested, seconds, tally->defects);
    for (int i = 0; i < 128; i++)
        if (tally->statuses[i])
            printf("  %-20s %" PRIu64 "\n", swb_status_name(-i), tally->statuses[i]);
    for (int i = 0; i < N_FUNCTIONS; i++) {
        if (tally->slowest[i] > tally->slowest[slowest])
            slowest = i;
        if (!never_succeeded(i))
            continue;
        never++;
        printf("  never succeeded: %s (%" PRIu64 " calls)\n", functions[i].name, tally->called[i]);
    }
    printf("  slowest call: %s, %.1f s\n", functions[slowest].name, tally->slowest[slowest]);
    return never;
}

/* Functions that cannot succeed here: those that need a library that is not installed. */
static int excused(void)
{
    int excuses = 0;
    const char *casadi = getenv("FUZZ_CASADI");
    if (!casadi || !*casadi) {
        printf("  without CasADi: swb_function_from_casadi_file cannot succeed\n");
        excuses += tally->succeeded[F_swb_function_from_casadi_file] == 0;
    }
    return excuses;
}

static int goes_on(int64_t runs, double seconds)
{
    if (options.seconds > 0.0 && seconds < options.seconds)
        return 1;
    if (runs >= options.runs)
        return 0;
    int left = options.seconds <= 0.0;
    for (int i = 0; i < N_FUNCTIONS; i++)
        left |= never_succeeded(i);
    return left;
}

static int many_runs(void)
{
    double began = run_now();
    int failed = 0;
    int64_t runs = 0;
    for (; goes_on(runs, run_now() - began); runs++) {
        uint64_t seed = options.seed + (uint64_t)runs;
        fflush(NULL);
        pid_t child = fork();
        if (child == 0) {
            start_timer();
            int defects = run(seed);
            fflush(NULL);
            _exit(defects ? 1 : 0);
        }
        run_seed = seed;
        failed += watch(child, seed);
    }
    int never = report(runs, run_now() - began) - excused();
    if (tally->defects)
        printf("first defect: %s\n", tally->defect);
    return failed || tally->defects || never > 0;
}

static void usage(void)
{
    fprintf(stderr, "usage: fuzz [--seed N] [--runs N] [--seconds S] [--calls N] [--hang S]\n"
                    "       fuzz --replay SEED [--calls N] [--skip FIRST-LAST]... [--quiet]\n");
    exit(2);
}

static void read_options(int n, char **arguments)
{
    for (int i = 1; i < n; i++) {
        const char *a = arguments[i], *value = i + 1 < n ? arguments[i + 1] : NULL;
        if (strcmp(a, "--quiet") == 0) {
            options.quiet = 1;
            continue;
        }
        if (!value)
            usage();
        i++;
        if (strcmp(a, "--seed") == 0)
            options.seed = strtoull(value, NULL, 10);
        else if (strcmp(a, "--runs") == 0)
            options.runs = atoll(value);
        else if (strcmp(a, "--seconds") == 0)
            options.seconds = atof(value);
        else if (strcmp(a, "--calls") == 0)
            options.calls = atoll(value);
        else if (strcmp(a, "--hang") == 0)
            options.hang = atof(value);
        else if (strcmp(a, "--replay") == 0)
            options.replay = 1, options.seed = strtoull(value, NULL, 10);
        else if (strcmp(a, "--skip") == 0 && options.n_skips < MAX_SKIPS &&
                 sscanf(value, "%" SCNd64 "-%" SCNd64, &options.skip[options.n_skips][0], &options.skip[options.n_skips][1]) == 2)
            options.n_skips++;
        else
            usage();
    }
}

int main(int n, char **arguments)
{
    const char *folder = getenv("FUZZ_FOLDER");
    read_options(n, arguments);
    if (folder && chdir(folder) != 0)
        return 2;
    tally = mmap(NULL, sizeof *tally, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (tally == MAP_FAILED)
        return 2;
    tally->function = -1;
    if (!options.replay)
        return many_runs();
    run_verbose = !options.quiet;
    start_timer();
    return run(options.seed) ? 1 : 0;
}
