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

int main(void)
{
    if (check_slow())
        calls = 200;
    codes();
    last_error();
    threads();
    return CHECK_DONE();
}
