#include "draw.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "casadi.h"
#include "pool.h"
#include "texts.h"

/* Larger arrays are not made: the call then says a length that no array has, which the library has to see. */
enum { LARGEST_ARRAY = 1 << 22, KNOWN_FUNCTIONS = 4096 };

static struct {
    const void *function;
    struct user *user;
} known[KNOWN_FUNCTIONS];
static int n_known;

void draw_reset(void)
{
    n_known = 0;
}

struct user *draw_user_of(const void *function)
{
    for (int i = 0; i < n_known && i < KNOWN_FUNCTIONS; i++)
        if (known[i].function == function)
            return known[i].user;
    return NULL;
}

void draw_set_user(const void *function, struct user *user)
{
    int i = n_known++ % KNOWN_FUNCTIONS;
    known[i].function = function;
    known[i].user = user;
}

void call_begin(struct call *call, int function)
{
    memset(call, 0, sizeof *call);
    call->number = function;
    call->function = &functions[function];
    call->option = -1;
    call->null = -1;
    for (int i = 0; i < MAX_ARGUMENTS; i++)
        call->lengths[i] = -1;
}

void call_end(struct call *call)
{
    for (int i = 0; i < MAX_ARGUMENTS; i++) {
        free(call->memory[i]);
        free(call->before[i]);
        call->memory[i] = call->before[i] = NULL;
        call->bytes[i] = 0;
    }
    for (int b = 0; b < 3; b++) {
        free(call->blocks[b]);
        call->blocks[b] = NULL;
    }
}

/* Memory of its own for argument i; one byte too few or too many is seen by the sanitizer. */
static void *memory(struct call *call, int i, size_t bytes)
{
    call->memory[i] = malloc(bytes);
    call->bytes[i] = bytes;
    if (call->memory[i])
        memset(call->memory[i], 0xa5, bytes);
    return call->memory[i];
}

static int64_t named(const struct call *call, const char *name)
{
    for (int i = 0; i < call->function->n_arguments; i++)
        if (strcmp(call->function->arguments[i].name, name) == 0 && call->function->arguments[i].kind <= A_LENGTH)
            return call->values[i].i;
    return 0;
}

static void *handle_of(const struct call *call, int type)
{
    for (int i = 0; i < call->function->n_arguments; i++)
        if (call->function->arguments[i].kind == A_HANDLE && call->function->arguments[i].of == type)
            return call->values[i].p;
    return NULL;
}

/* --- numbers --- */

static int64_t draw_size(struct random *r)
{
    int64_t kind = random_below(r, 100);
    return kind < 80 ? random_below(r, 4) : kind < 94 ? random_below(r, 12) : kind < 95 ? random_below(r, 400) : random_odd_integer(r);
}

static int64_t draw_length(struct random *r)
{
    static const int64_t no_length[] = {-1, -5, INT64_MIN, INT64_MAX, INT64_MAX / 8};
    int64_t kind = random_below(r, 100);
    if (kind < 2)
        return no_length[random_below(r, 5)];
    return kind < 80 ? random_below(r, 7) : random_below(r, 40);
}

static int64_t draw_integer(struct random *r, const struct argument *a, int option)
{
    if (a->enum_of >= 0 && !random_once_in(r, 10))
        return enums[a->enum_of].values[random_below(r, enums[a->enum_of].n)];
    if (option >= 0 && strcmp(a->name, "value") == 0)
        return (int64_t)fmax(fmin(draw_option_value(r, option), 1e18), -1e18);
    if (strcmp(a->name, "index") == 0 && random_once_in(r, 3))
        return random_below(r, swb_option_count());
    return draw_size(r);
}

double draw_option_value(struct random *r, int64_t option)
{
    double low = 0.0, high = 1.0, value = 0.0;
    int32_t kind = 0, low_open, high_open;
    swb_option_kind(option, &kind);
    swb_option_range(option, &low, &high, &low_open, &high_open);
    swb_option_default(option, &value);
    switch (random_below(r, 8)) {
    case 0:
        return low;
    case 1:
        return high;
    case 2:
        return random_odd_double(r);
    case 3:
        return kind == SWB_KIND_FLOAT ? nextafter(low, high) : low + 1.0;
    case 4:
        return kind == SWB_KIND_FLOAT ? nextafter(high, low) : high - 1.0;
    default:
        if (kind == SWB_KIND_ENUM)
            return low + (double)random_below(r, (int64_t)(high - low) + 1);
        if (kind == SWB_KIND_INT)
            return low + (double)random_below(r, 8);
        return value * pow(10.0, random_between(r, -3.0, 3.0));
    }
}

static double draw_double(struct random *r)
{
    int64_t kind = random_below(r, 10);
    return kind < 6 ? random_between(r, 0.01, 1.0) : kind < 8 ? random_between(r, -2.0, 2.0) : random_odd_double(r);
}

/* A time near the present one of the integrator of the call. */
static double draw_time(struct random *r, const struct call *call)
{
    double now = 0.0;
    void *integrator = handle_of(call, T_swb_integrator);
    if (!integrator || random_once_in(r, 4) || swb_integrator_get_time(integrator, &now) != SWB_OK)
        return draw_double(r);
    return random_once_in(r, 3) ? now : now + random_between(r, -0.01, 0.3);
}

/* --- arrays --- */

static void fill_doubles(struct random *r, double *out, int64_t n, const char *name)
{
    int64_t kind = random_below(r, 20);
    double time = 0.0;
    for (int64_t i = 0; i < n; i++) {
        double v = random_between(r, -1.0, 1.0);
        if (kind < 9) /* bounds that leave room */
            out[i] = strcmp(name, "lower") == 0 ? -2.0 - fabs(v) : strcmp(name, "upper") == 0 ? 2.0 + fabs(v) : v;
        else if (kind < 11)
            out[i] = 0.0;
        else if (kind < 14) { /* rising from zero */
            out[i] = time;
            time += 0.05 + 0.1 * fabs(v);
        } else if (kind < 16)
            out[i] = 0.1 + fabs(v);
        else if (kind < 19)
            out[i] = random_once_in(r, 4) ? random_odd_double(r) : v;
        else
            out[i] = random_odd_double(r);
    }
}

static int64_t element_integer(struct random *r, int64_t kind, int64_t i, int64_t step)
{
    if (kind < 5)
        return random_below(r, 10);
    if (kind < 8)
        return i * step;
    if (kind < 10)
        return 0;
    return kind < 11 ? random_odd_integer(r) : random_below(r, 3);
}

static void fill_integers(struct random *r, void *out, int element, int64_t n)
{
    int64_t kind = random_below(r, 14), step = random_below(r, 3);
    for (int64_t i = 0; i < n; i++) {
        int64_t v = element_integer(r, kind, i, step);
        if (element == E_INT64)
            ((int64_t *)out)[i] = v;
        else if (element == E_INT32)
            ((int32_t *)out)[i] = (int32_t)(kind < 10 ? v % 2 : v);
        else
            ((int8_t *)out)[i] = (int8_t)(kind < 10 ? random_below(r, 3) - 1 : v);
    }
}

static void draw_array(struct call *call, struct random *r, int i, int64_t n)
{
    const struct argument *a = &call->function->arguments[i];
    size_t size = element_size(a->of);
    int64_t made = n < 0 || n > LARGEST_ARRAY ? 0 : n;
    if (random_once_in(r, 80)) { /* an address that does not fit the type */
        call->values[i].p = (char *)memory(call, i, (size_t)made * size + 1) + 1;
        return;
    }
    if (a->kind == A_ARRAY_OUT) { /* a length that says "at most" may be larger than any array, but not than this one */
        call->values[i].p = n > made ? NULL : memory(call, i, (size_t)made * size);
        return;
    }
    call->values[i].p = memory(call, i, (size_t)made * size);
    if (a->of == E_DOUBLE)
        fill_doubles(r, call->values[i].p, made, a->name);
    else
        fill_integers(r, call->values[i].p, a->of, made);
}

static void draw_handles(struct call *call, struct random *r, int i, int64_t n)
{
    int64_t made = n < 0 || n > LARGEST_ARRAY ? 0 : n;
    void **handles = memory(call, i, (size_t)made * sizeof(void *));
    for (int64_t k = 0; k < made; k++)
        handles[k] = random_once_in(r, 12) ? pool_any(r, call->function->arguments[i].of)
                                           : pool_alive(r, call->function->arguments[i].of);
    call->values[i].p = handles;
}

static void draw_texts(struct call *call, struct random *r, int i, int64_t n)
{
    static const char *const names[] = {"a", "b", "", "T_out", "a b", "x", NULL, "\xff"};
    int64_t made = n < 0 || n > LARGEST_ARRAY ? 0 : n;
    const char **texts = memory(call, i, (size_t)made * sizeof(char *));
    for (int64_t k = 0; k < made; k++)
        texts[k] = names[random_below(r, random_once_in(r, 4) ? 8 : 6)];
    call->values[i].p = texts;
}

/* --- structs --- */

void draw_settings(struct random *r, swb_settings *settings)
{
    swb_settings_init(settings, sizeof *settings);
    settings->n_fe = 2;
    settings->max_iter = 60;
    settings->max_steps = 500;
    settings->adapt_rounds = 1;
    settings->adapt_elements = 12;
    settings->log_level = random_below(r, 6);
    settings->dense = random_below(r, 2);
    settings->sensitivity = random_below(r, 2);
    settings->adjoint = random_below(r, 2);
    for (int64_t k = random_below(r, 5) - 1; k > 0; k--) {
        int64_t option = random_below(r, swb_option_count());
        swb_settings_set_double(settings, swb_option_name(option), draw_option_value(r, option));
        swb_settings_set_int(settings, swb_option_name(option), (int64_t)fmin(fmax(draw_option_value(r, option), -1e18), 1e18));
    }
}

/* The point a function of the call is evaluated at has as many numbers as the function wants. */
static void draw_point(struct call *call, struct random *r, swb_point *at)
{
    int64_t n[3] = {named(call, "nx"), named(call, "nu"), named(call, "np")};
    void *function = handle_of(call, T_swb_function), *system = handle_of(call, T_swb_system);
    if (function)
        swb_function_sizes(function, &n[0], &n[1], &n[2], NULL, NULL, NULL);
    if (system)
        swb_system_sizes(system, &n[0], &n[1], &n[2], NULL);
    enum { LARGEST_BLOCK = 4096 };
    for (int b = 0; b < 3; b++) {
        if (n[b] <= 0 || n[b] > LARGEST_BLOCK || random_once_in(r, 60))
            continue;
        call->blocks[b] = malloc((size_t)n[b] * sizeof(double));
        fill_doubles(r, call->blocks[b], n[b], "");
    }
    at->t = draw_double(r);
    at->x = call->blocks[0], at->u = call->blocks[1], at->p = call->blocks[2];
}

static uint64_t draw_struct_size(struct random *r, size_t right)
{
    const uint64_t wrong[] = {0, 1, 8, right - 8, right + 1, right + 8, 2 * right, UINT64_MAX, UINT64_C(1) << 40};
    return random_once_in(r, 12) ? wrong[random_below(r, 9)] : right;
}

static void draw_record(struct call *call, struct random *r, int i, int64_t n)
{
    const struct argument *a = &call->function->arguments[i];
    size_t size = record_sizes[a->of];
    int last = call->function->n_arguments - 1;
    uint64_t said = size;
    if (call->function->arguments[last].kind == A_STRUCT_SIZE)
        said = (uint64_t)(call->values[last].i = (int64_t)draw_struct_size(r, size));
    int64_t made = n < 0 || n > 4096 ? 0 : n;
    size_t each = said > size && said <= 1 << 16 ? (size_t)said : size;
    void *record = memory(call, i, (size_t)made * each);
    call->values[i].p = record;
    if (made == 0)
        return;
    if (a->of == S_swb_settings && (a->kind == A_RECORD_IN || call->function->arguments[last].kind != A_STRUCT_SIZE)) {
        draw_settings(r, record);
        if (random_once_in(r, 30)) /* no larger than it is: the library must not read beyond */
            ((swb_settings *)record)->struct_size = (uint64_t)(random_below(r, 2) ? 8 * random_below(r, (int64_t)size / 8 + 1) : random_odd_integer(r));
        if (((swb_settings *)record)->struct_size > size && ((swb_settings *)record)->struct_size <= 1 << 16)
            ((swb_settings *)record)->struct_size = size;
    } else if (a->of == S_swb_point) {
        draw_point(call, r, record);
    } else if (a->of == S_swb_casadi) {
        casadi_draw(r, record);
    } else if (a->kind == A_RECORD_IN && record_sized[a->of]) {
        *(uint64_t *)record = draw_struct_size(r, size);
    }
}

/* --- texts --- */

static const char *draw_text(struct call *call, struct random *r, const char *name)
{
    if (strcmp(name, "folder") == 0)
        return texts_folder(r);
    if (random_once_in(r, 20))
        return texts_odd(r);
    if (strcmp(name, "value") == 0 && call->option >= 0) {
        const char *value = swb_option_value_name(call->option, random_below(r, 4));
        return value && !random_once_in(r, 5) ? value : texts_number(r, draw_option_value(r, call->option));
    }
    if (strcmp(name, "name") == 0 && !random_once_in(r, 4)) {
        call->option = (int)random_below(r, swb_option_count());
        return swb_option_name(call->option);
    }
    return texts_for(r, name);
}

void draw_keep_document(const char *text)
{
    texts_keep(text);
}

/* --- the call --- */

static int64_t length_of(const struct call *call, int i)
{
    int length = call->function->arguments[i].length;
    return length < 0 ? 1 : call->values[length].i;
}

static void draw_argument(struct call *call, struct random *r, int i)
{
    const struct argument *a = &call->function->arguments[i];
    union value *v = &call->values[i];
    switch (a->kind) {
    case A_HANDLE:
        v->p = pool_any(r, a->of);
        break;
    case A_HANDLES:
        draw_handles(call, r, i, length_of(call, i));
        break;
    case A_NEW_HANDLE:
        v->p = memory(call, i, sizeof(void *));
        break;
    case A_INT64:
        v->i = draw_integer(r, a, call->option);
        break;
    case A_INT32:
        v->i = (int32_t)draw_integer(r, a, call->option);
        break;
    case A_UINT64:
        v->i = (int64_t)random_bits(r);
        break;
    case A_DOUBLE:
        v->d = strcmp(a->name, "t") == 0 || strcmp(a->name, "t_stop") == 0 ? draw_time(r, call)
               : call->option >= 0                                         ? draw_option_value(r, call->option)
                                                                           : draw_double(r);
        break;
    case A_TEXT:
        v->p = (void *)(uintptr_t)draw_text(call, r, a->name);
        break;
    case A_TEXTS:
        draw_texts(call, r, i, length_of(call, i));
        break;
    case A_ARRAY_IN:
    case A_ARRAY_OUT:
        draw_array(call, r, i, length_of(call, i));
        break;
    case A_RECORD_IN:
    case A_RECORD_OUT:
        draw_record(call, r, i, length_of(call, i));
        break;
    case A_CALLBACK:
        v->f = random_once_in(r, 12) ? NULL : user_callback(a->of);
        break;
    case A_USER_DATA:
        if (!call->user)
            call->user = user_new(random_bits(r), named(call, "nx"), named(call, "nu"), named(call, "np"), named(call, "n_out"));
        call->user->hessian_nnz = named(call, "nnz");
        if (random_once_in(r, 3))
            user_misbehave(call->user, r);
        v->p = call->user;
        break;
    case A_LENGTH:
    case A_STRUCT_SIZE:
        break; /* drawn before */
    }
}

void call_draw(struct call *call, struct random *r)
{
    int64_t same = draw_length(r); /* lengths that are equal are the likeliest to fit */
    int all_same = random_below(r, 2);
    for (int i = 0; i < call->function->n_arguments; i++) {
        if (call->function->arguments[i].kind != A_LENGTH)
            continue;
        int text = 0;
        for (int k = 0; k < call->function->n_arguments; k++)
            text |= call->function->arguments[k].length == i && call->function->arguments[k].of == E_CHAR &&
                    call->function->arguments[k].kind == A_ARRAY_OUT;
        int64_t n = text ? random_below(r, random_once_in(r, 3) ? 16 : 1 << 14) : all_same ? same : draw_length(r);
        call->values[i].i = call->lengths[i] >= 0 ? call->lengths[i] : n;
    }
    for (int i = 0; i < call->function->n_arguments; i++) {
        draw_argument(call, r, i);
        const struct argument *a = &call->function->arguments[i];
        int by_value = a->kind >= A_INT64 && a->kind <= A_DOUBLE;
        if (call->repeats && (a->kind == A_HANDLE || by_value))
            call->values[i] = call->repeats[i];
        int pointer = a->kind != A_LENGTH && a->kind != A_STRUCT_SIZE && !by_value;
        if (pointer && a->kind != A_USER_DATA && (call->null == i || random_once_in(r, a->nullable ? 8 : 60)))
            call->values[i].p = NULL;
        if (call->memory[i] && call->bytes[i] && (call->before[i] = malloc(call->bytes[i])))
            memcpy(call->before[i], call->memory[i], call->bytes[i]);
    }
}

static void print_argument(const struct argument *a, union value v)
{
    switch (a->kind) {
    case A_HANDLE:
        if (pool_number(a->of, v.p) >= 0)
            fprintf(stderr, "%s#%d", type_names[a->of] + 4, pool_number(a->of, v.p));
        else
            fprintf(stderr, "%p", v.p);
        break;
    case A_DOUBLE:
        fprintf(stderr, "%.17g", v.d);
        break;
    case A_INT64:
    case A_INT32:
    case A_UINT64:
    case A_LENGTH:
    case A_STRUCT_SIZE:
        fprintf(stderr, "%" PRId64, v.i);
        break;
    case A_TEXT:
        if (v.p)
            fprintf(stderr, "\"%.40s\"", (const char *)v.p);
        else
            fprintf(stderr, "NULL");
        break;
    default:
        fprintf(stderr, v.p ? "%s" : "NULL", a->name);
    }
}

void call_print(const struct call *call)
{
    fprintf(stderr, "%s(", call->function->name);
    for (int i = 0; i < call->function->n_arguments; i++) {
        if (i)
            fprintf(stderr, ", ");
        print_argument(&call->function->arguments[i], call->values[i]);
    }
    fprintf(stderr, ")");
}
