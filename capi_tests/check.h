/* Checks for the test programs: every failure is printed, the exit code says whether there was one. */
#ifndef CHECK_H
#define CHECK_H

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "switchback.h"

static int check_failures;

/* Does the program run under valgrind, many times as slowly as otherwise? Computations that are only repeated with other numbers are left out then. */
static inline int check_slow(void)
{
    return getenv("SWB_TEST_SLOW") != NULL;
}

#define CHECK(condition)                                                                              \
    do {                                                                                              \
        if (!(condition)) {                                                                           \
            check_failures++;                                                                         \
            fprintf(stderr, "%s:%d: %s is false (last error: %s)\n", __FILE__, __LINE__, #condition,  \
                    swb_last_error());                                                                \
        }                                                                                             \
    } while (0)

#define CHECK_STATUS(expected, call)                                                                  \
    do {                                                                                              \
        swb_status check_status_ = (call);                                                            \
        if (check_status_ != (expected)) {                                                            \
            check_failures++;                                                                         \
            fprintf(stderr, "%s:%d: %s is %s, not %s (last error: %s)\n", __FILE__, __LINE__, #call,  \
                    swb_status_string(check_status_), #expected, swb_last_error());                   \
        }                                                                                             \
        if (check_status_ != SWB_OK)                                                                  \
            swb_error_handled(); /* a refusal that was expected: the object is used further */        \
    } while (0)

#define CHECK_OK(call) CHECK_STATUS(SWB_OK, call)

#define CHECK_NEAR(a, b, tolerance)                                                                   \
    do {                                                                                              \
        double check_a_ = (a), check_b_ = (b);                                                        \
        if (!(fabs(check_a_ - check_b_) <= (tolerance))) {                                            \
            check_failures++;                                                                         \
            fprintf(stderr, "%s:%d: %s = %.16g, %s = %.16g differ by %.3g\n", __FILE__, __LINE__, #a, \
                    check_a_, #b, check_b_, fabs(check_a_ - check_b_));                               \
        }                                                                                             \
    } while (0)

#define CHECK_TEXT(expected, text)                                                                    \
    do {                                                                                              \
        const char *check_text_ = (text);                                                             \
        if (!check_text_ || strcmp(check_text_, (expected)) != 0) {                                   \
            check_failures++;                                                                         \
            fprintf(stderr, "%s:%d: %s is \"%s\", not \"%s\"\n", __FILE__, __LINE__, #text,           \
                    check_text_ ? check_text_ : "(NULL)", (expected));                                \
        }                                                                                             \
    } while (0)

#define CHECK_DONE() (check_failures ? 1 : 0)

#endif
