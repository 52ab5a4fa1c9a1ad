/* What random calls start from: objects of every type that fit each other, in every state that a getter asks for. */
#ifndef WORLD_H
#define WORLD_H

#include "random.h"

/* Some of them, all in the pool. Which ones, and their options, are drawn. */
void world_create(struct random *r);

#endif
