/* The functions of the library as data: what a call needs, made from the header by gen_table.py. */
#ifndef API_H
#define API_H

#include <stddef.h>
#include <stdint.h>

#include "switchback.h"

#define API_TABLE_NUMBERS
#include "api_table.h"
#undef API_TABLE_NUMBERS

/* What an argument is. */
enum argument_kind {
    A_HANDLE,      /* an object */
    A_HANDLES,     /* an array of objects */
    A_NEW_HANDLE,  /* where a new object goes */
    A_INT64,       /* numbers by value */
    A_INT32,
    A_UINT64,
    A_DOUBLE,
    A_LENGTH,      /* length of one or several arrays of the call */
    A_STRUCT_SIZE, /* size of the struct in front of it */
    A_TEXT,
    A_TEXTS,       /* an array of texts */
    A_ARRAY_IN,    /* numbers that are read; one if there is no length */
    A_ARRAY_OUT,   /* numbers that are written; one if there is no length */
    A_RECORD_IN,   /* a struct that is read */
    A_RECORD_OUT,  /* structs that are written; one if there is no length */
    A_CALLBACK,
    A_USER_DATA    /* what callbacks get */
};

enum element { E_DOUBLE, E_INT64, E_INT32, E_INT8, E_CHAR };

enum result { R_STATUS, R_NOTHING, R_NUMBER, R_TEXT };

struct argument {
    const char *name;
    enum argument_kind kind;
    int of;       /* type of the object, element of the array, struct, or callback */
    int length;   /* number of the argument that is its length, or -1 */
    int enum_of;  /* number of the enumeration its values belong to, or -1 */
    int nullable; /* does the description allow NULL? */
    int constant; /* is it read only? */
};

/* The value of an argument; `f` for code, since C does not convert it to other pointers. */
union value {
    int64_t i;
    double d;
    void *p;
    swb_code f;
};

struct function {
    const char *name;
    enum result result;
    int n_arguments;
    const struct argument *arguments;
    /* Result as a number: the status, the number, or the address of the text. */
    int64_t (*call)(const union value *);
};

struct enumeration {
    const char *name;
    const int64_t *values;
    int n;
};

#define MAX_ARGUMENTS 24

extern const struct function functions[];
extern const struct enumeration enums[];
extern const char *const type_names[];
extern const size_t record_sizes[];
extern const int record_sized[];        /* does the struct begin with its size? */
extern const int free_functions[];      /* by type of object */
extern const int interrupt_functions[]; /* by type of object, -1 where there is none */

size_t element_size(int element);

#endif
