/* Numbered cases, run one after the other in a process that may die: the next one goes on behind the case that killed it. */
#ifndef CASES_H
#define CASES_H

#include <stdint.h>
#include <stdio.h>

struct cases {
    const char *name;
    int64_t n;
    /* Do one case: 0 if all is well; else it has reported what is wrong with cases_wrong. */
    int (*run)(int64_t number);
    /* Say in words what a case is. */
    void (*describe)(int64_t number, char *text, size_t size);
    /* Interrupt what runs; called in a signal handler when a case has used the processor for some seconds. May be NULL. */
    void (*interrupt)(void);
};

/* Run all cases, or every n-th as the arguments say: [--stride N] [--seed OFFSET] [--only NUMBER]; with [--seconds N] as many as the time
 * allows, spread over all of them. Returns the exit code. */
int cases_main(const struct cases *cases, int n, char **arguments);

/* Report that something is wrong with the case that runs; returns 1. */
int cases_wrong(const char *format, ...);

/* What every status must fulfil: known, not internal, with a message. 0 if it does. */
int cases_bad_status(int32_t status, const char *call);

/* Add to a counter that the report shows. */
void cases_count(const char *what);

#endif
