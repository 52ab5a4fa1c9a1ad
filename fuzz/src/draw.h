/* Arguments of one call, drawn at random: mostly such that the call may succeed, now and then such that it must not. */
#ifndef DRAW_H
#define DRAW_H

#include "api.h"
#include "random.h"
#include "user.h"

struct call {
    int number; /* of the function */
    const struct function *function;
    union value values[MAX_ARGUMENTS];
    /* Memory of the arguments that are arrays, structs or texts: its size in bytes, and what was in it before the call.
       Exactly as large as the call says, for the sanitizer to see. */
    void *memory[MAX_ARGUMENTS];
    size_t bytes[MAX_ARGUMENTS];
    void *before[MAX_ARGUMENTS];
    double *blocks[3]; /* what a point of the call points to */
    struct user *user; /* the user data, if there is any */
    int option;        /* the option that a text names, or -1 */
    int null;          /* the number of an argument that is to be NULL, or -1 */
    /* Lengths that are given, by number of the argument; -1: drawn. */
    int64_t lengths[MAX_ARGUMENTS];
    /* The call that this one repeats with other lengths, on the same objects with the same numbers; NULL for a new one. */
    const union value *repeats;
};

/* A call without arguments; every length is to be drawn. */
void call_begin(struct call *call, int function);
/* Draw the arguments. */
void call_draw(struct call *call, struct random *r);
/* Give the memory back. */
void call_end(struct call *call);
void call_print(const struct call *call);

/* Options that keep a problem small, some of them at random. */
void draw_settings(struct random *r, swb_settings *settings);

/* A value of an option, within its range for the most part. */
double draw_option_value(struct random *r, int64_t option);

/* Texts that the library wrote are kept, to be given back to it, whole or damaged. */
void draw_keep_document(const char *text);

/* Who the user data of a function is; NULL if it has none. */
struct user *draw_user_of(const void *function);
void draw_set_user(const void *function, struct user *user);
void draw_reset(void);

#endif
