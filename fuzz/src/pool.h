/* The objects of a run: alive, or freed and remembered to be used again wrongly. */
#ifndef POOL_H
#define POOL_H

#include "api.h"
#include "random.h"

/* Take in a new object; one of the same type is freed where there are too many. */
void pool_add(int type, void *object);

/* The number of an object of the pool in the order they came, for traces; -1 if it is none. */
int pool_number(int type, const void *object);

/* An object of the type, alive; NULL if there is none. The newest are the likeliest. */
void *pool_alive(struct random *r, int type);

/* What a caller might pass: mostly pool_alive, else NULL, freed, of another type, or no object at all. */
void *pool_any(struct random *r, int type);

/* Call the free function of the type, and remember the object as freed unless it is in use. */
void pool_free(int type, void *object);

/* Note that a call may have freed the object. */
void pool_freed(int type, void *object);

int pool_count(int type);
void *pool_at(int type, int index);

/* Free everything; nothing may be in use. */
void pool_clear(void);

#endif
