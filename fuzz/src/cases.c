#include "cases.h"

#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "switchback.h"

#if defined(__SANITIZE_ADDRESS__)
#include <sanitizer/lsan_interface.h>
#define LEAKS() __lsan_do_recoverable_leak_check()
#else
#define LEAKS() 0
#endif

enum { COUNTERS = 24, INTERRUPT_AFTER = 4, HANG_AFTER = 240, CASES_OF_A_PROCESS = 200 };

/* Shared with the process that runs the cases. */
static struct shared {
    volatile int64_t number, place; /* of the case that runs */
    volatile double began;
    int64_t done, wrong;
    struct {
        char what[40];
        int64_t n;
    } counters[COUNTERS];
} *shared;

static const struct cases *all;
static int64_t stride = 1, offset, only = -1;
static double seconds; /* 0: no limit */

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

int cases_wrong(const char *format, ...)
{
    char what[600], which[200] = "";
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    if (all->describe)
        all->describe(shared->number, which, sizeof which);
    fprintf(stderr, "DEFECT %s --only %" PRId64 " (%s): %s\n", all->name, shared->number, which, what);
    shared->wrong++;
    return 1;
}

int cases_bad_status(int32_t status, const char *call)
{
    const char *message = swb_last_error();
    if (!swb_status_name(status))
        return cases_wrong("%s: unknown status %d", call, status);
    cases_count(swb_status_name(status));
    if (status == SWB_ERR_INTERNAL)
        return cases_wrong("%s: %s", call, message);
    if (status != SWB_OK && message[0] == '\0')
        return cases_wrong("%s: %s without a message", call, swb_status_name(status));
    return 0;
}

void cases_count(const char *what)
{
    for (int i = 0; i < COUNTERS; i++) {
        if (shared->counters[i].n == 0)
            snprintf(shared->counters[i].what, sizeof shared->counters[i].what, "%s", what);
        if (strcmp(shared->counters[i].what, what) == 0) {
            shared->counters[i].n++;
            return;
        }
    }
}

static void on_timer(int signal)
{
    (void)signal;
    if (all->interrupt && shared->began > 0.0 && now() - shared->began > INTERRUPT_AFTER)
        all->interrupt();
}

static void start_timer(void)
{
    struct sigaction action = {.sa_handler = on_timer, .sa_flags = SA_RESTART};
    struct itimerval every = {{1, 0}, {1, 0}};
    sigaction(SIGPROF, &action, NULL);
    setitimer(ITIMER_PROF, &every, NULL);
}

static int64_t divisor(int64_t a, int64_t b)
{
    return b == 0 ? a : divisor(b, a % b);
}

/* How far the next case is. With a limit of time all cases come, in an order that is spread evenly over their numbers wherever it ends:
 * multiples of the golden section. */
static int64_t distance(void)
{
    if (seconds <= 0.0)
        return stride;
    int64_t next = (int64_t)(0.6180339887498949 * (double)all->n) + 1;
    while (divisor(next, all->n) != 1)
        next++;
    return next;
}

static int64_t count(void)
{
    return seconds > 0.0 ? all->n : (all->n - offset % stride + stride - 1) / stride;
}

/* Number of the case at a place in the order. */
static int64_t case_at(int64_t place)
{
    int64_t first = seconds > 0.0 ? offset : offset % stride;
    return (place * distance() + first) % all->n;
}

/* In a process of its own: cases from the place `first` on. */
static void run_cases(int64_t first, int64_t end, double until)
{
    start_timer();
    for (int64_t place = first; place < end && now() < until; place++) {
        shared->place = place;
        shared->number = case_at(place);
        shared->began = now();
        all->run(shared->number);
        shared->began = 0.0;
        shared->done++;
    }
    if (LEAKS())
        cases_wrong("memory leaked in one of the cases before, back to %" PRId64, case_at(first));
    fflush(NULL);
    _exit(0);
}

/* Wait for the process; 0 if it did all its cases. */
static int watch(pid_t child)
{
    int status;
    while (waitpid(child, &status, WNOHANG) == 0) {
        double began = shared->began;
        if (began > 0.0 && now() - began > HANG_AFTER) {
            kill(child, SIGKILL);
            waitpid(child, &status, 0);
            return cases_wrong("hangs for %d s", HANG_AFTER);
        }
        nanosleep(&(struct timespec){0, 2000000}, NULL);
    }
    if (WIFSIGNALED(status))
        return cases_wrong("killed by signal %d", WTERMSIG(status));
    return WEXITSTATUS(status) ? cases_wrong("ended with exit code %d", WEXITSTATUS(status)) : 0;
}

static void read_arguments(int n, char **arguments)
{
    for (int i = 1; i + 1 < n; i += 2) {
        int64_t value = atoll(arguments[i + 1]);
        if (strcmp(arguments[i], "--stride") == 0 && value > 0)
            stride = value;
        else if (strcmp(arguments[i], "--seed") == 0)
            offset = value;
        else if (strcmp(arguments[i], "--only") == 0)
            only = value;
        else if (strcmp(arguments[i], "--seconds") == 0 && value > 0)
            seconds = (double)value;
    }
}

int cases_main(const struct cases *cases, int n, char **arguments)
{
    double began = now();
    all = cases;
    read_arguments(n, arguments);
    shared = mmap(NULL, sizeof *shared, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (shared == MAP_FAILED)
        return 2;
    if (only >= 0) {
        shared->number = only;
        start_timer();
        shared->began = now();
        return cases->run(only) || LEAKS();
    }
    double until = seconds > 0.0 ? began + seconds : HUGE_VAL;
    int64_t places = count();
    for (int64_t first = 0; first < places && now() < until;) {
        int64_t end = first + CASES_OF_A_PROCESS;
        fflush(NULL);
        pid_t child = fork();
        if (child == 0)
            run_cases(first, end < places ? end : places, until);
        shared->place = first;
        shared->number = case_at(first);
        first = watch(child) ? shared->place + 1 : end;
        shared->began = 0.0;
    }
    printf("%s: %" PRId64 " of %" PRId64 " cases in %.0f s, %" PRId64 " defects\n", cases->name, shared->done, cases->n, now() - began,
           shared->wrong);
    for (int i = 0; i < COUNTERS && shared->counters[i].n; i++)
        printf("  %-24s %" PRId64 "\n", shared->counters[i].what, shared->counters[i].n);
    return shared->wrong != 0 || shared->done == 0;
}
