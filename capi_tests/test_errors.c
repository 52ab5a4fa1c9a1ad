/* Status codes, the last error, and that every thread has its own. */
#include <pthread.h>
#include <stdlib.h>

#include "check.h"

static void codes(void)
{
    static const struct {
        swb_status status;
        const char *name;
    } all[] = {
        {SWB_OK, "SWB_OK"},
        {SWB_ERR_NULL, "SWB_ERR_NULL"},
        {SWB_ERR_DIMENSION, "SWB_ERR_DIMENSION"},
        {SWB_ERR_RANGE, "SWB_ERR_RANGE"},
        {SWB_ERR_STATE, "SWB_ERR_STATE"},
        {SWB_ERR_UNSUPPORTED, "SWB_ERR_UNSUPPORTED"},
        {SWB_ERR_OPTION, "SWB_ERR_OPTION"},
        {SWB_ERR_USER, "SWB_ERR_USER"},
        {SWB_ERR_NONFINITE, "SWB_ERR_NONFINITE"},
        {SWB_ERR_INTERRUPTED, "SWB_ERR_INTERRUPTED"},
        {SWB_ERR_NUMERIC, "SWB_ERR_NUMERIC"},
        {SWB_ERR_LIBRARY, "SWB_ERR_LIBRARY"},
        {SWB_ERR_INTERNAL, "SWB_ERR_INTERNAL"},
    };
    size_t i;

    for (i = 0; i < sizeof all / sizeof all[0]; i++) {
        CHECK_TEXT(all[i].name, swb_status_name(all[i].status));
        CHECK(strcmp(swb_status_string(all[i].status), "unknown status") != 0);
    }
    CHECK_TEXT("unknown status", swb_status_string(1));
    CHECK_TEXT("unknown status", swb_status_string(-1000));
    CHECK(swb_status_name(12345) == NULL);
}

static void last_error(void)
{
    int64_t index = 77, needed = -1;
    char text[80], expected[80];

    CHECK_TEXT("", swb_last_error());
    CHECK_STATUS(SWB_ERR_OPTION, swb_option_find("tolr", &index));
    CHECK(index == 77); /* nothing is written on failure */
    CHECK_TEXT("unknown option 'tolr'; did you mean 'tol'?", swb_last_error());
    CHECK(swb_last_user_code() == 0);

    /* Success keeps it. */
    CHECK_OK(swb_option_find("tol", &index));
    CHECK_TEXT("tol", swb_option_name(index));
    strcpy(expected, swb_last_error());
    CHECK_TEXT("unknown option 'tolr'; did you mean 'tol'?", expected);

    /* Copies: the length, too short, exactly long enough. */
    CHECK_OK(swb_last_error_copy(NULL, 0, &needed));
    CHECK(needed == (int64_t)strlen(expected) + 1);
    memset(text, '#', sizeof text);
    needed = -1;
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_last_error_copy(text, 5, &needed));
    CHECK(needed == (int64_t)strlen(expected) + 1 && text[0] == '#');
    CHECK_OK(swb_last_error_copy(text, needed, NULL));
    CHECK_TEXT(expected, text);
    CHECK(text[needed] == '#');
    CHECK_STATUS(SWB_ERR_NULL, swb_last_error_copy(NULL, 5, NULL));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_last_error_copy(text, -1, NULL));
    CHECK_TEXT(expected, swb_last_error());
}

enum { THREADS = 8 };
static int calls = 20000;

static void *fail_often(void *argument)
{
    int number = *(int *)argument, i;
    size_t wrong = 0;
    swb_settings settings;
    char expected[80];

    if (*swb_last_error() != '\0')
        wrong++;
    if (swb_settings_init(&settings, sizeof settings) != SWB_OK)
        wrong++;
    for (i = 0; i < calls; i++) {
        int value = 1000 + THREADS * i + number;
        sprintf(expected, "option 'n_s' is %d, outside [1, 9]", value);
        if (swb_settings_set_int(&settings, "n_s", value) != SWB_ERR_RANGE)
            wrong++;
        if (strcmp(expected, swb_last_error()) != 0)
            wrong++;
    }
    return (void *)wrong;
}

static void threads(void)
{
    pthread_t thread[THREADS];
    int number[THREADS], i;
    char before[80];

    strcpy(before, swb_last_error());
    for (i = 0; i < THREADS; i++) {
        number[i] = i;
        CHECK(pthread_create(&thread[i], NULL, fail_often, &number[i]) == 0);
    }
    for (i = 0; i < THREADS; i++) {
        void *wrong;
        CHECK(pthread_join(thread[i], &wrong) == 0);
        CHECK(wrong == NULL);
    }
    CHECK_TEXT(before, swb_last_error());
}

static int32_t nothing(const swb_point *at, double *out, void *user_data)
{
    (void)at, (void)user_data;
    out[0] = 0.0;
    return 0;
}

/* Random wrong calls on a system, none of which anybody looks at: the simulator refuses with the first one's error. */
static void incomplete_objects(void)
{
    uint32_t random = 7;
    for (int round = 0; round < 36; round++) {
        const int64_t rows[1] = {0};
        const int8_t signs[2] = {1, -1}, same[2] = {1, 1};
        const double x0[1] = {0.0};
        swb_function *good = NULL, *wide = NULL;
        swb_system *system = NULL;
        swb_simulator *sim = NULL;
        swb_status first = SWB_OK, status = SWB_OK;
        CHECK_OK(swb_function_create("good", 1, 0, 0, 1, nothing, NULL, NULL, &good));
        CHECK_OK(swb_function_create("wide", 2, 0, 0, 1, nothing, NULL, NULL, &wide));
        CHECK_OK(swb_system_create(1, 0, 0, &system));
        CHECK_OK(swb_system_set_f0(system, good));
        CHECK_OK(swb_simulator_create(system, NULL, &sim));
        swb_simulator_free(sim);
        int calls = 1 + round % 3;
        for (int k = 0; k < calls; k++) {
            random = random * 1664525u + 1013904223u;
            switch (random >> 16 & 3) {
            case 0: status = swb_system_set_f0(system, wide); break;
            case 1: status = swb_system_set_f0(system, NULL); break;
            case 2: status = swb_system_add_subsystem(system, rows, 1, good, 2, good, signs, 2, NULL); break;
            default: status = swb_system_add_subsystem(system, rows, 1, good, 1, good, same, 2, NULL); break;
            }
            CHECK(status < 0);
            first = k == 0 ? status : first;
        }
        CHECK_OK(swb_system_set_f0(system, good)); /* a later success is not the call that failed */
        CHECK(swb_simulator_create(system, NULL, &sim) == first && sim == NULL);
        CHECK(strstr(swb_last_error(), "swb_system is incomplete") != NULL);
        swb_error_handled(); /* of no call that set something: nothing is forgotten */
        CHECK(swb_simulator_create(system, NULL, &sim) == first);
        swb_system_free(system);

        /* who says that the failure was dealt with goes on */
        CHECK_OK(swb_system_create(1, 0, 0, &system));
        CHECK_OK(swb_system_set_f0(system, good));
        CHECK(swb_system_set_f0(system, wide) == SWB_ERR_DIMENSION);
        swb_error_handled();
        CHECK_OK(swb_simulator_create(system, NULL, &sim));
        CHECK(swb_simulator_set_state(sim, 0.0, x0, 2) == SWB_ERR_DIMENSION);
        CHECK(swb_simulator_run(sim, 1.0, 1, NULL) == SWB_ERR_DIMENSION);
        swb_simulator_free(sim);
        swb_system_free(system);
        swb_function_free(good);
        swb_function_free(wide);
    }
    swb_function *none = NULL;
    swb_system *system = NULL;
    CHECK(swb_function_create("none", -1, 0, 0, 1, nothing, NULL, NULL, &none) == SWB_ERR_DIMENSION);
    CHECK_OK(swb_system_create(1, 0, 0, &system));
    CHECK(swb_system_set_f0(system, none) == SWB_ERR_NULL && strstr(swb_last_error(), "nx is -1") != NULL);
    swb_system_free(system);
}

int main(void)
{
    if (check_slow())
        calls = 200;
    codes();
    last_error();
    threads();
    incomplete_objects();
    return CHECK_DONE();
}
