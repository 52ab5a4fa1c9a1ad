#include "heap.h"

#include <errno.h>
#include <stdlib.h>

atomic_long heap_requests, heap_live;
static atomic_long fail_at;
static atomic_int fail_all;
static atomic_size_t fail_above;

void *__real_malloc(size_t size);
void *__real_calloc(size_t n, size_t size);
void *__real_realloc(void *p, size_t size);
void *__real_aligned_alloc(size_t alignment, size_t size);
int __real_posix_memalign(void **p, size_t alignment, size_t size);
void __real_free(void *p);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t n, size_t size);
void *__wrap_realloc(void *p, size_t size);
void *__wrap_aligned_alloc(size_t alignment, size_t size);
int __wrap_posix_memalign(void **p, size_t alignment, size_t size);
void __wrap_free(void *p);

void heap_fail(long n, int all, size_t above)
{
    heap_requests = 0;
    fail_all = all;
    fail_above = above;
    fail_at = n;
}

static int fails(size_t size)
{
    long k = ++heap_requests, n = fail_at;
    if (n == 0)
        return 0;
    return fail_all ? k >= n && size > fail_above : k == n;
}

static void *counted(void *p)
{
    if (p != NULL)
        heap_live++;
    return p;
}

void *__wrap_malloc(size_t size)
{
    return fails(size) ? NULL : counted(__real_malloc(size));
}

void *__wrap_calloc(size_t n, size_t size)
{
    return fails(n * size) ? NULL : counted(__real_calloc(n, size));
}

void *__wrap_realloc(void *p, size_t size)
{
    void *q;
    if (fails(size))
        return NULL;
    q = __real_realloc(p, size);
    if (p == NULL)
        counted(q);
    return q;
}

void *__wrap_aligned_alloc(size_t alignment, size_t size)
{
    return fails(size) ? NULL : counted(__real_aligned_alloc(alignment, size));
}

int __wrap_posix_memalign(void **p, size_t alignment, size_t size)
{
    int status;
    if (fails(size))
        return ENOMEM;
    status = __real_posix_memalign(p, alignment, size);
    if (status == 0)
        heap_live++;
    return status;
}

void __wrap_free(void *p)
{
    if (p != NULL)
        heap_live--;
    __real_free(p);
}
