/* Functions of the shortest problem with a switch, x' = 2 - sign(x): 3 on the left, 1 on the right, and of its costs. */
#ifndef KINK_H
#define KINK_H

#include <switchback.h>

static inline int32_t kink_slopes(const swb_point *at, double *out, void *user_data)
{
    (void)at;
    (void)user_data;
    out[0] = 3.0;
    out[1] = 1.0;
    return 0;
}

static inline int32_t first_state(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0];
    return 0;
}

static inline int32_t first_state_squared(const swb_point *at, double *out, void *user_data)
{
    (void)user_data;
    out[0] = at->x[0] * at->x[0];
    return 0;
}

/* Where the solution from -1 is at time 2. */
static inline int32_t kink_distance(const swb_point *at, double *out, void *user_data)
{
    double d = at->x[0] - 5.0 / 3.0;
    (void)user_data;
    out[0] = d * d;
    return 0;
}

#endif
