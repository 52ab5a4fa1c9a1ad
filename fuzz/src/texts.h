/* Texts for calls. What is returned lives until the next call of the same function. */
#ifndef TEXTS_H
#define TEXTS_H

#include "random.h"

/* Long, empty, not UTF-8, with control characters. */
const char *texts_odd(struct random *r);

/* A number as text. */
const char *texts_number(struct random *r, double value);

/* What an argument of this name may mean: a path, a document, names, inputs. */
const char *texts_for(struct random *r, const char *argument);

/* A folder for files of the library: there or not, or one that cannot be made. All that can be made are in FUZZ_FOLDER, where the fuzzer runs. */
const char *texts_folder(struct random *r);

/* Keep a document that the library wrote. */
void texts_keep(const char *text);

/* A document, whole or damaged; NULL if none was kept. */
const char *texts_document(struct random *r);

#endif
