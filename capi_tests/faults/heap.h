/* The heap as seen by the library, which fails when it is told to. Link with -Wl,--wrap=malloc,... (see CMakeLists.txt). */
#ifndef HEAP_H
#define HEAP_H

#include <stdatomic.h>
#include <stddef.h>

/* Requests since heap_fail, and blocks that are allocated. */
extern atomic_long heap_requests, heap_live;

/* From now on request number n fails, counted from 1; with `all` every request from it on that is larger than `above` bytes.
   0 fails none. */
void heap_fail(long n, int all, size_t above);

#endif
