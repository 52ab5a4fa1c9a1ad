#include "run.h"

#include <ctype.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "draw.h"
#include "pool.h"

enum { DEEPEST = 3, MOST_LENGTHS = 8 };

struct tally *tally;
int run_verbose;
uint64_t run_seed;

static struct call *running[DEEPEST + 1];
static volatile int depth;
static pthread_t caller;
static struct random hook_random;

double run_now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void run_defect(const char *format, ...)
{
    char what[400];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(what, sizeof what, format, arguments);
    va_end(arguments);
    const char *function = tally->function >= 0 ? functions[tally->function].name : "(between calls)";
    char line[512];
    snprintf(line, sizeof line, "DEFECT seed %" PRIu64 " call %" PRId64 " %s: %s", run_seed, tally->call, function, what);
    fprintf(stderr, "%s\n", line);
    if (tally->defects++ == 0)
        strcpy(tally->defect, line);
}

void run_interrupt(void)
{
    for (int level = 0; level < depth && level <= DEEPEST; level++) {
        struct call *call = running[level];
        for (int i = 0; call && i < call->function->n_arguments; i++) {
            const struct argument *a = &call->function->arguments[i];
            if (a->kind == A_HANDLE && interrupt_functions[a->of] >= 0)
                functions[interrupt_functions[a->of]].call(&call->values[i]);
        }
    }
}

/* --- after a call --- */

static int known_status(int64_t status)
{
    for (int i = 0; i < enums[E_swb_status].n; i++)
        if (enums[E_swb_status].values[i] == status)
            return 1;
    return 0;
}

static void check_status(int64_t status)
{
    const char *message = swb_last_error();
    if (!known_status(status))
        run_defect("unknown status %" PRId64, status);
    else if (status == SWB_ERR_INTERNAL)
        run_defect("internal error: %s", message);
    else if (status != SWB_OK && message[0] == '\0')
        run_defect("status %s without a message", swb_status_name((int32_t)status));
}

/* "On failure no output is written, except NULL to the new object of a constructor and the needed length of a text." */
static void check_memory(const struct call *call, int64_t status)
{
    for (int i = 0; i < call->function->n_arguments; i++) {
        const struct argument *a = &call->function->arguments[i];
        if (!call->memory[i] || !call->before[i])
            continue;
        int same = memcmp(call->memory[i], call->before[i], call->bytes[i]) == 0;
        if (a->constant && a->kind != A_HANDLE && !same)
            run_defect("argument %s is read only, and was written to", a->name);
        int may_change = status == SWB_OK || a->kind == A_NEW_HANDLE || strcmp(a->name, "needed") == 0;
        if (!same && !may_change)
            run_defect("argument %s was written to by a call that failed with %s", a->name, swb_status_name((int32_t)status));
    }
}

static void take_new(struct call *call, int64_t status, int i)
{
    const struct argument *a = &call->function->arguments[i];
    void **out = call->values[i].p, *object = NULL;
    if (!out || out != call->memory[i])
        return;
    memcpy(&object, out, sizeof object);
    if (status != SWB_OK && object != NULL && memcmp(call->memory[i], call->before[i], sizeof object) != 0)
        run_defect("failed with %s, and %s is not NULL", swb_status_name((int32_t)status), a->name);
    else if (status != SWB_OK && object != NULL && status != SWB_ERR_NULL)
        run_defect("failed with %s, and %s was not set to NULL", swb_status_name((int32_t)status), a->name);
    if (status != SWB_OK)
        return;
    if (object == NULL || memcmp(call->memory[i], call->before[i], sizeof object) == 0) {
        run_defect("succeeded without an object in %s", a->name);
        return;
    }
    if (call->user && a->of == T_swb_function)
        draw_set_user(object, call->user);
    pool_add(a->of, object);
}

static union value value_of(const struct call *call, const char *argument)
{
    union value nothing = {0};
    for (int i = 0; i < call->function->n_arguments; i++)
        if (strcmp(call->function->arguments[i].name, argument) == 0)
            return call->values[i];
    return nothing;
}

/* What callbacks of the function have to write from now on. */
static void note_pattern(struct call *call)
{
    struct user *user = draw_user_of(call->values[0].p);
    if (user && call->number == F_swb_function_set_jacobian)
        user->jacobian_nnz = value_of(call, "nnz").i;
    if (user && call->number == F_swb_function_set_hessian)
        user->hessian_nnz = value_of(call, "nnz").i;
}

static void keep_text(const struct call *call)
{
    for (int i = 0; i < call->function->n_arguments; i++) {
        const struct argument *a = &call->function->arguments[i];
        if (a->kind == A_ARRAY_OUT && a->of == E_CHAR && call->values[i].p && strstr(call->function->name, "_to_json"))
            draw_keep_document(call->values[i].p);
    }
}

static int frees(const struct call *call)
{
    size_t n = strlen(call->function->name);
    return n > 5 && strcmp(call->function->name + n - 5, "_free") == 0 && call->function->n_arguments == 1;
}

static void check(struct call *call, int64_t result, int64_t live_before)
{
    if (call->function->result == R_TEXT && result)
        (void)strlen((const char *)(intptr_t)result);
    if (frees(call) && swb_live_objects() < live_before)
        pool_freed(call->function->arguments[0].of, call->values[0].p);
    if (call->function->result != R_STATUS)
        return;
    check_status(result);
    check_memory(call, result);
    for (int i = 0; i < call->function->n_arguments; i++)
        if (call->function->arguments[i].kind == A_NEW_HANDLE)
            take_new(call, result, i);
    if (result != SWB_OK)
        return;
    if (call->user && call->number == F_swb_function_create)
        call->user->wants_destroy = value_of(call, "destroy").f != NULL;
    note_pattern(call);
    keep_text(call);
}

static int64_t invoke(struct call *call)
{
    int outer = tally->function;
    int64_t live = swb_live_objects();
    if (run_verbose) {
        fprintf(stderr, "%*s%" PRId64 " ", 2 * depth, "", tally->call);
        call_print(call);
        fprintf(stderr, "\n");
    }
    tally->function = call->number;
    tally->calls++;
    tally->nested += depth > 0;
    tally->called[call->number]++;
    running[depth] = call;
    depth++;
    double began = run_now();
    if (depth == 1)
        tally->interrupted = 0.0, tally->began = began;
    int64_t result = call->function->call(call->values);
    if (depth == 1)
        tally->began = 0.0;
    depth--;
    tally->slowest[call->number] = fmax(tally->slowest[call->number], run_now() - began);
    tally->function = call->number;
    int good = call->function->result != R_STATUS || result == SWB_OK;
    if (call->function->result == R_TEXT)
        good = result != 0;
    tally->succeeded[call->number] += (uint64_t)good;
    if (call->function->result == R_STATUS && result <= 0 && result > -128)
        tally->statuses[-result]++;
    if (run_verbose && call->function->result == R_STATUS)
        fprintf(stderr, "%*s= %" PRId64 " %.150s\n", 2 * depth + 4, "", result, result ? swb_last_error() : "");
    check(call, result, live);
    /* Most failures are dealt with; the others leave objects that refuse to run. */
    if (call->function->result == R_STATUS && result != SWB_OK && tally->calls % 8 != 0)
        swb_error_handled();
    tally->function = outer;
    return result;
}

/* --- lengths that the library asked for --- */

static int numbers_in(const char *message, int64_t *numbers)
{
    int n = 0;
    for (const char *c = message; *c && n < MOST_LENGTHS;) {
        char *end = (char *)(uintptr_t)c + 1;
        if (isdigit((unsigned char)*c))
            numbers[n++] = strtoll(c, &end, 10);
        c = end;
    }
    return n;
}

/* Is the argument, or the length of it, mentioned? */
static int mentioned(const struct call *call, int length, const char *message)
{
    char word[64];
    for (int i = 0; i < call->function->n_arguments; i++) {
        const struct argument *a = &call->function->arguments[i];
        if (i != length && a->length != length)
            continue;
        snprintf(word, sizeof word, "%s ", a->name);
        if (strncmp(message, word, strlen(word)) == 0)
            return 1;
    }
    return 0;
}

/* Take a number of the message for a length of the call. */
static int learn(struct call *call, struct random *r, const char *message)
{
    int64_t numbers[MOST_LENGTHS];
    int n = numbers_in(message, numbers), candidates[MAX_ARGUMENTS], n_candidates = 0, certain = 0;
    for (int i = 0; i < call->function->n_arguments; i++) {
        if (call->function->arguments[i].kind != A_LENGTH)
            continue;
        int named = mentioned(call, i, message);
        if (named && !certain)
            n_candidates = 0, certain = 1;
        if (named || !certain)
            candidates[n_candidates++] = i;
    }
    if (n == 0 || n_candidates == 0)
        return 0;
    int at = candidates[random_below(r, n_candidates)];
    int64_t number = numbers[certain || random_once_in(r, 2) ? n - 1 : random_below(r, n)];
    if (number > 1 << 16)
        return 0;
    for (int i = 0; i < call->function->n_arguments; i++) /* what fits already stays */
        if (call->function->arguments[i].kind == A_LENGTH && call->lengths[i] < 0 && call->values[i].i >= 0)
            call->lengths[i] = call->values[i].i;
    call->lengths[at] = number;
    return 1;
}

static int64_t draw_and_invoke(struct call *call, struct random *r)
{
    call_draw(call, r);
    return invoke(call);
}

/* The same call with each of its pointers NULL in turn. */
static void sweep_nulls(struct call *call)
{
    for (int i = 0; i < call->function->n_arguments; i++) {
        const struct argument *a = &call->function->arguments[i];
        int pointer = a->kind != A_LENGTH && a->kind != A_STRUCT_SIZE && !(a->kind >= A_INT64 && a->kind <= A_DOUBLE);
        union value kept = call->values[i];
        if (!pointer || a->kind == A_USER_DATA || !kept.p)
            continue;
        for (int k = 0; k < call->function->n_arguments; k++) /* as they were */
            if (call->memory[k] && call->before[k])
                memcpy(call->memory[k], call->before[k], call->bytes[k]);
        struct user *user = call->user;
        if (user) { /* the first call keeps its own */
            call->user = user_new(user->seed, user->nx, user->nu, user->np, user->n_out);
            call->user->hessian_nnz = user->hessian_nnz;
            for (int k = 0; k < call->function->n_arguments; k++)
                if (call->function->arguments[k].kind == A_USER_DATA)
                    call->values[k].p = call->user;
        }
        call->values[i].p = NULL;
        invoke(call);
        call->values[i] = kept;
    }
}

void run_function(struct random *r, int function)
{
    if (depth > DEEPEST - 1)
        return;
    struct call call;
    call_begin(&call, function);
    int64_t result = draw_and_invoke(&call, r);
    for (int k = 0; k < MOST_LENGTHS && call.function->result == R_STATUS && result == SWB_ERR_DIMENSION; k++) {
        char message[256];
        snprintf(message, sizeof message, "%s", swb_last_error());
        if (!learn(&call, r, message))
            break;
        call_end(&call);
        int64_t lengths[MAX_ARGUMENTS];
        union value values[MAX_ARGUMENTS];
        memcpy(lengths, call.lengths, sizeof lengths);
        memcpy(values, call.values, sizeof values);
        call_begin(&call, function);
        memcpy(call.lengths, lengths, sizeof lengths);
        call.repeats = values;
        result = draw_and_invoke(&call, r);
        call.repeats = NULL;
    }
    if (result == SWB_OK && call.function->result == R_STATUS && depth == 0 && random_once_in(r, 10))
        sweep_nulls(&call);
    call_end(&call);
}

/* Calls that cost a solve are rarer. */
static int works_long(const char *name)
{
    static const char *const parts[] = {"solve", "_run", "advance", "_step", "sensitivity", "from_casadi_file"};
    for (size_t i = 0; i < sizeof parts / sizeof *parts; i++)
        if (strstr(name, parts[i]))
            return 1;
    return 0;
}

void run_any(struct random *r)
{
    int function = (int)random_below(r, N_FUNCTIONS);
    const char *name = functions[function].name;
    if (works_long(name) && !random_once_in(r, 4))
        return;
    if (strstr(name, "_free") && !random_once_in(r, 4))
        return;
    run_function(r, function);
}

/* --- callbacks that call back --- */

static void hook(enum fault fault)
{
    if (!pthread_equal(pthread_self(), caller))
        return;
    if (fault == FAULT_INTERRUPT) {
        run_interrupt();
    } else if (fault == FAULT_FREE && depth > 0) { /* what they run in, and something else */
        struct call *call = running[depth - 1];
        for (int i = 0; i < call->function->n_arguments; i++) {
            const struct argument *a = &call->function->arguments[i];
            if (a->kind == A_HANDLE && pool_number(a->of, call->values[i].p) >= 0)
                pool_free(a->of, call->values[i].p);
        }
    } else if (fault == FAULT_AGAIN) {
        for (int64_t k = 1 + random_below(&hook_random, 3); k > 0; k--)
            run_any(&hook_random);
    }
}

void run_begin(void)
{
    caller = pthread_self();
    depth = 0;
    tally->function = -1;
    hook_random = random_stream(run_seed, 77);
    user_hook = hook;
}
