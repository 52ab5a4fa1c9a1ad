/* What a program does with the library, from the first object to the last, stopping at the first call that fails. */
#ifndef SCENARIOS_H
#define SCENARIOS_H

#include "switchback.h"

/* Status of the first call that failed, or SWB_OK; everything that was made is freed. */
typedef swb_status (*scenario_fn)(void);

struct scenario {
    const char *name;
    scenario_fn run;
};

extern const struct scenario SCENARIOS[];
extern const int N_SCENARIOS;

/* The call that failed last, for messages. */
extern const char *failed_call;

#endif
