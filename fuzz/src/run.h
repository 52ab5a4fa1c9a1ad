/* Random calls, and what must hold after each of them. */
#ifndef RUN_H
#define RUN_H

#include "api.h"
#include "random.h"

/* Shared by the process that calls and the one that watches it. */
struct tally {
    uint64_t calls, nested, statuses[128];
    uint64_t called[N_FUNCTIONS], succeeded[N_FUNCTIONS];
    /* The call that runs: its number in the run, its function, when it began (seconds), and when it was interrupted. */
    volatile int64_t call;
    volatile int function;
    volatile double began, interrupted;
    volatile double slowest[N_FUNCTIONS];
    volatile int defects;
    char defect[512];
};

extern struct tally *tally;

/* Print every call. */
extern int run_verbose;
extern uint64_t run_seed;

/* Do one call of a function, repeated with other lengths where those did not fit. */
void run_function(struct random *r, int function);
/* One call of any function; callbacks may call again. */
void run_any(struct random *r);

/* Report a defect: of the call that runs, or of `what` alone. */
void run_defect(const char *format, ...);

/* Interrupt the calls that run; allowed in a signal handler. */
void run_interrupt(void);

/* What callbacks do that call back. */
void run_begin(void);

/* Seconds since some time. */
double run_now(void);

#endif
