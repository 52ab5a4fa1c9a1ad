#include "pool.h"

#include <string.h>

enum { KEPT = 16, REMEMBERED = 32 };

static struct {
    void *object[KEPT];
    int number[KEPT];
    int n;
    void *freed[REMEMBERED];
    int n_freed;
} pools[N_TYPES];

static int next_number;

/* Readable memory that is no object. */
static uint64_t garbage[8];

static int find(int type, const void *object)
{
    for (int i = 0; i < pools[type].n; i++)
        if (pools[type].object[i] == object)
            return i;
    return -1;
}

int pool_number(int type, const void *object)
{
    int i = find(type, object);
    return i < 0 ? -1 : pools[type].number[i];
}

int pool_count(int type)
{
    return pools[type].n;
}

void *pool_at(int type, int index)
{
    return pools[type].object[index];
}

void pool_add(int type, void *object)
{
    if (pools[type].n == KEPT) {
        /* The oldest that is not in use; one that is stays behind as the last of the row. */
        for (int i = 0; i < KEPT && pools[type].n == KEPT; i++)
            pool_free(type, pools[type].object[0]);
    }
    if (pools[type].n < KEPT) {
        pools[type].object[pools[type].n] = object;
        pools[type].number[pools[type].n++] = next_number++;
        return;
    }
    pool_free(type, object); /* all are in use */
}

void *pool_alive(struct random *r, int type)
{
    int n = pools[type].n;
    if (n == 0)
        return NULL;
    return pools[type].object[random_once_in(r, 3) ? n - 1 : random_below(r, n)];
}

void *pool_any(struct random *r, int type)
{
    switch (random_below(r, 60)) {
    case 0:
        return NULL;
    case 1:
        return (char *)garbage + random_below(r, sizeof garbage);
    case 2:
        return pool_alive(r, (int)random_below(r, N_TYPES));
    case 3: { /* near a handle */
        char *object = pool_alive(r, type);
        return (void *)((uintptr_t)object + (uintptr_t)random_below(r, 64));
    }
    case 4:
        return (void *)(uintptr_t)random_bits(r);
    case 5:
    case 6:
        return pools[type].n_freed ? pools[type].freed[random_below(r, pools[type].n_freed)] : NULL;
    default:
        return pool_alive(r, type);
    }
}

void pool_freed(int type, void *object)
{
    int i = find(type, object), last = pools[type].n - 1, place = pools[type].n_freed;
    if (i < 0)
        return;
    memmove(&pools[type].object[i], &pools[type].object[i + 1], sizeof(void *) * (size_t)(last - i));
    memmove(&pools[type].number[i], &pools[type].number[i + 1], sizeof(int) * (size_t)(last - i));
    pools[type].n = last;
    if (place == REMEMBERED)
        place = next_number % REMEMBERED;
    else
        pools[type].n_freed++;
    pools[type].freed[place] = object;
}

void pool_free(int type, void *object)
{
    union value v = {.p = object};
    int64_t before = swb_live_objects();
    functions[free_functions[type]].call(&v);
    if (swb_live_objects() < before) /* else it is in use, which is refused */
        pool_freed(type, object);
}

void pool_clear(void)
{
    for (int type = 0; type < N_TYPES; type++)
        for (int i = pools[type].n; i > 0; i--)
            pool_free(type, pools[type].object[i - 1]);
}
