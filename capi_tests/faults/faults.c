/* Lack of memory at every place: the n-th request fails, alone or with all later ones above a size. The process survives,
 * the call that is at work reports it or succeeds, and everything that was made can be freed.
 *
 *   faults [samples] [scenario]
 *
 * tries `samples` places of every scenario and way to fail, spread over all requests with a fixed seed; 0 tries all.
 * Every scenario runs in a process of its own, which is begun again behind a place it does not survive. */
#include "heap.h"
#include "scenarios.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

struct way {
    const char *name;
    int all;
    size_t above;
};

static const struct way WAYS[] = {
    {"one request", 0, 0},
    {"all requests from one on", 1, 0},
    {"all requests above 256 bytes from one on", 1, 256},
    {"all requests above 4096 bytes from one on", 1, 4096},
};
enum { N_WAYS = sizeof WAYS / sizeof WAYS[0], MOST_CRASHES = 10 };

/* What the process at work tells its parent. */
struct report {
    long at, done, errors, unmet, live, requests;
    int wrong;
};

static uint64_t state = 12;

static uint64_t draw(void)
{
    state = state * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return state >> 33;
}

/* The place after `at`: in steps whose length varies around the mean. */
static long next_place(long at, long requests, long samples)
{
    long mean = samples == 0 ? 1 : requests / samples + 1;
    return at + (mean == 1 ? 1 : 1 + (long)(draw() % (uint64_t)(2 * mean - 1)));
}

static void complain(struct report *r, const char *scenario, const struct way *w, const char *what)
{
    if (r->wrong++ < 5)
        fprintf(stderr, "%s, %s fails, number %ld: %s (%s; last error: %s)\n", scenario, w->name, r->at, what, failed_call,
                swb_last_error());
}

static void one(const struct scenario *s, const struct way *w, struct report *r)
{
    long before = heap_live;
    char text[80];
    swb_status status;
    heap_fail(r->at, w->all, w->above);
    status = s->run();
    heap_fail(0, 0, 0);
    r->done++;
    if (status == SWB_ERR_LIBRARY) {
        r->errors++;
        if (strlen(swb_last_error()) < 20)
            complain(r, s->name, w, "an error without a message");
    } else if (status != SWB_OK) {
        snprintf(text, sizeof text, "status %d", (int)status);
        complain(r, s->name, w, text);
    }
    if (heap_live > before) {
        snprintf(text, sizeof text, "%ld blocks are not freed", (long)heap_live - before);
        complain(r, s->name, w, text);
    }
}

/* All places from r->at on, in a process of its own. */
static void work(const struct scenario *s, const struct way *w, struct report *r, long samples)
{
    int k;
    swb_system *none;
    /* what is made once for the whole process is made here, the message of the last error among it */
    if (swb_system_create(-1, 0, 0, &none) != SWB_ERR_DIMENSION)
        complain(r, s->name, w, "a negative size is taken");
    for (k = 0; k < 2; k++) {
        heap_fail(0, 0, 0);
        if (s->run() != SWB_OK)
            complain(r, s->name, w, "fails with all the memory it wants");
        r->requests = heap_requests;
    }
    if (r->at == 0)
        r->at = next_place(0, r->requests, samples);
    for (; r->at <= r->requests; r->at = next_place(r->at, r->requests, samples))
        one(s, w, r);
    if (s->run() != SWB_OK)
        complain(r, s->name, w, "fails after all the failures, with all the memory it wants");
}

static int scenario(const struct scenario *s, const struct way *w, struct report *r, long samples)
{
    int crashes = 0, status = 0;
    memset(r, 0, sizeof *r);
    for (;;) {
        pid_t child = fork();
        if (child == 0) {
            alarm(3000);
            work(s, w, r, samples);
            _exit(0);
        }
        if (child < 0 || waitpid(child, &status, 0) < 0)
            return 1;
        if (WIFEXITED(status) && WEXITSTATUS(status) == 0)
            return crashes;
        fprintf(stderr, "%s, %s fails, number %ld of %ld: the process ends with %s %d\n", s->name, w->name, r->at, r->requests,
                WIFSIGNALED(status) ? "signal" : "status", WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status));
        if (++crashes == MOST_CRASHES)
            return crashes;
        r->at = next_place(r->at, r->requests, samples);
    }
}

int main(int argc, char **argv)
{
    long samples = argc > 1 ? strtol(argv[1], NULL, 10) : 40, places = 0, bad = 0;
    struct report *r = mmap(NULL, sizeof *r, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    int i, k;

    if (r == MAP_FAILED)
        return 2;
    for (i = 0; i < N_SCENARIOS; i++) {
        if (argc > 2 && strcmp(argv[2], SCENARIOS[i].name) != 0)
            continue;
        for (k = 0; k < N_WAYS; k++) {
            int crashes = scenario(&SCENARIOS[i], &WAYS[k], r, samples);
            printf("%-26s %-42s %7ld requests %6ld failed %6ld errors %3d wrong %2d crashes\n", SCENARIOS[i].name, WAYS[k].name,
                   r->requests, r->done, r->errors, r->wrong, crashes);
            fflush(stdout);
            places += r->done;
            bad += r->wrong + crashes;
        }
    }
    printf("%ld places, %ld defects\n", places, bad);
    return bad != 0 || places == 0;
}
