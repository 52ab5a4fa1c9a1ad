/* Pseudo-random numbers: the same for the same seed, everywhere. */
#ifndef RANDOM_H
#define RANDOM_H

#include <math.h>
#include <stdint.h>

struct random {
    uint64_t state;
};

/* splitmix64 */
static inline uint64_t random_bits(struct random *r)
{
    uint64_t z = (r->state += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

/* Streams of different numbers are independent. */
static inline struct random random_stream(uint64_t seed, uint64_t number)
{
    struct random r = {seed};
    r.state = random_bits(&r) + number * 0xd1342543de82ef95u;
    return r;
}

/* 0 to n - 1; 0 for n = 0 */
static inline int64_t random_below(struct random *r, int64_t n)
{
    return n > 0 ? (int64_t)(random_bits(r) % (uint64_t)n) : 0;
}

/* true once in n times */
static inline int random_once_in(struct random *r, int64_t n)
{
    return random_below(r, n) == 0;
}

static inline double random_between(struct random *r, double low, double high)
{
    return low + (high - low) * (double)(random_bits(r) >> 11) * 0x1p-53;
}

/* Numbers that have hurt somebody before. */
static inline double random_odd_double(struct random *r)
{
    static const double odd[] = {0.0,    -0.0,   1.0,  -1.0,   5e-324, -5e-324, 2.2e-308, 1e-300, 1e300,
                                 -1e300, 1e150,  1e20, -1e20,  1e-16,  1e-8,    0.1,      1e8,    1.7976931348623157e308,
                                 NAN,    INFINITY, -INFINITY};
    return odd[random_below(r, (int64_t)(sizeof odd / sizeof *odd))];
}

static inline int64_t random_odd_integer(struct random *r)
{
    static const int64_t odd[] = {-1, -2, 0, 64, 65, 255, INT32_MAX, (int64_t)INT32_MAX + 1, INT32_MIN, INT64_MIN,
                                  INT64_MIN + 1, INT64_MAX, INT64_MAX - 1, INT64_MAX / 8, INT64_MAX / 64, INT64_C(1) << 53};
    return odd[random_below(r, (int64_t)(sizeof odd / sizeof *odd))];
}

#endif
