/* A function as CasADi would have generated it, which lies about itself as it is told to. */
#ifndef CASADI_H
#define CASADI_H

#include "random.h"
#include "switchback.h"

/* Lies, to be added up. */
enum casadi_lie {
    LIE_NONE = 0,
    LIE_N_IN = 1 << 0,        /* number of inputs */
    LIE_N_OUT = 1 << 1,
    LIE_NAMES = 1 << 2,       /* names that are NULL, empty, or no inputs of ours */
    LIE_SIZE = 1 << 3,        /* sizes that are negative or huge */
    LIE_ROWS = 1 << 4,        /* rows outside of the matrix */
    LIE_COLUMNS = 1 << 5,     /* starts of columns that fall */
    LIE_NULL_PATTERN = 1 << 6,
    LIE_WORK = 1 << 7,        /* need of memory that is negative */
    LIE_CODE = 1 << 8,        /* the function fails */
    LIE_NAN = 1 << 9,
    LIE_MISSING = 1 << 10,    /* no addresses where some are needed */
    LIE_WIDTH = 1 << 11,      /* integers or numbers of other sizes */
    N_LIES = 12
};

/* What the functions below say from now on. */
void casadi_lies(unsigned lies, uint64_t seed);

/* f(x) of two states and a control with three outputs, or its Jacobian. */
void casadi_value(swb_casadi *out);
void casadi_jacobian(swb_casadi *out);

/* Any of these, with lies or without. */
void casadi_draw(struct random *r, swb_casadi *out);

#endif
