/* Options: all pairs of values of two enumerations, and all numbers at both ends of their range, beside them and as small
 * as numbers get, with everything that takes options. Always a status with a message, never an internal error; afterwards
 * the same object works with the settings it had.
 *
 *   matrix [--stride N] [--seed OFFSET] [--seconds N] [--only NUMBER] */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "cases.h"
#include "tasks.h"

enum { MOST_OPTIONS = 256, ENDS = 8 };

/* What is tried of the options: every pair of two values, then every end of every number. */
struct choice {
    int64_t options[2]; /* -1: none */
    double values[2];
};

static int64_t enumerations[MOST_OPTIONS], numbers[MOST_OPTIONS], n_enumerations, n_numbers, n_choices;
static struct task running;
static volatile int runs;

static int64_t n_values(int64_t option)
{
    int64_t n = 0;
    while (swb_option_value_name(option, n))
        n++;
    return n;
}

static void list_options(void)
{
    for (int64_t i = 0; i < swb_option_count() && i < MOST_OPTIONS; i++) {
        int32_t kind = 0;
        swb_option_kind(i, &kind);
        if (kind == SWB_KIND_ENUM)
            enumerations[n_enumerations++] = i;
        else
            numbers[n_numbers++] = i;
    }
    for (int64_t a = 0; a < n_enumerations; a++)
        for (int64_t b = a + 1; b < n_enumerations; b++)
            n_choices += n_values(enumerations[a]) * n_values(enumerations[b]);
    n_choices += n_numbers * ENDS;
}

static double end_of(int64_t option, int64_t which)
{
    double low = 0.0, high = 0.0, value = 0.0;
    int32_t low_open, high_open, kind;
    swb_option_range(option, &low, &high, &low_open, &high_open);
    swb_option_default(option, &value);
    swb_option_kind(option, &kind);
    double step = kind == SWB_KIND_INT ? 1.0 : 0.0;
    switch (which) {
    case 0:
        return low;
    case 1:
        return high;
    case 2:
        return step > 0.0 ? low + step : nextafter(low, INFINITY);
    case 3:
        return step > 0.0 ? high - step : nextafter(high, -INFINITY);
    case 4:
        return 5e-324;
    case 5:
        return 2.2250738585072014e-308;
    case 6:
        return step > 0.0 ? 2.0 * value + 3.0 : value * 1e-6;
    default:
        return step > 0.0 ? value + 1.0 : value * 1e6;
    }
}

static struct choice choice_of(int64_t number)
{
    for (int64_t a = 0; a < n_enumerations; a++)
        for (int64_t b = a + 1; b < n_enumerations; b++) {
            int64_t na = n_values(enumerations[a]), nb = n_values(enumerations[b]);
            if (number < na * nb)
                return (struct choice){{enumerations[a], enumerations[b]}, {(double)(number / nb), (double)(number % nb)}};
            number -= na * nb;
        }
    int64_t option = numbers[number / ENDS];
    return (struct choice){{option, -1}, {end_of(option, number % ENDS), 0.0}};
}

static void describe(int64_t number, char *text, size_t size)
{
    struct choice c = choice_of(number / N_TASKS);
    int n = snprintf(text, size, "%s", task_names[number % N_TASKS]);
    for (int i = 0; i < 2 && n > 0 && (size_t)n < size; i++)
        if (c.options[i] >= 0)
            n += snprintf(text + n, size - (size_t)n, ", %s = %.17g", swb_option_name(c.options[i]), c.values[i]);
}

static int set(swb_settings *settings, int64_t option, double value)
{
    int32_t kind = 0;
    swb_option_kind(option, &kind);
    const char *name = swb_option_name(option);
    swb_status status = kind == SWB_KIND_FLOAT ? swb_settings_set_double(settings, name, value)
                                               : swb_settings_set_int(settings, name, (int64_t)fmax(fmin(value, 9e18), -9e18));
    return status == SWB_OK;
}

static void usual(enum task_kind kind, swb_settings *settings)
{
    MUST(swb_settings_init(settings, sizeof *settings));
    settings->n_fe = 2;
    settings->max_iter = 150;
    settings->max_steps = 20000;
    task_settings(kind, settings);
}

static int run_once(const char *when)
{
    int32_t outcome;
    runs = 1;
    swb_status status = task_run(&running, &outcome);
    runs = 0;
    if (status != SWB_OK)
        return cases_bad_status(status, when);
    const char *name = running.integrator || running.batch ? swb_run_outcome_name(outcome) : swb_outcome_name(outcome);
    if (!name)
        return cases_wrong("%s: no such outcome: %d", when, outcome);
    cases_count(name);
    return 0;
}

static int run(int64_t number)
{
    enum task_kind kind = (enum task_kind)(number % N_TASKS);
    struct choice c = choice_of(number / N_TASKS);
    swb_settings settings, before;
    usual(kind, &before);
    settings = before;
    for (int i = 0; i < 2; i++)
        if (c.options[i] >= 0 && !set(&settings, c.options[i], c.values[i])) {
            cases_count("outside the range");
            return 0;
        }
    if (!task_create(&running, kind, &settings)) {
        cases_count("refused when made");
        return cases_bad_status(SWB_ERR_UNSUPPORTED, "create"); /* for its message */
    }
    int wrong = run_once("with the options");
    if (!wrong && task_set_settings(&running, &before) == SWB_OK && kind != TASK_BATCH && kind != TASK_PHASES) {
        int32_t outcome;
        task_reset(&running);
        runs = 1;
        swb_status status = task_run(&running, &outcome);
        if (status == SWB_OK && outcome == SWB_OUTCOME_STOPPED) /* the interrupt of the call before came too late */
            task_reset(&running), status = task_run(&running, &outcome);
        runs = 0;
        if (status != SWB_OK)
            wrong = cases_wrong("afterwards, with the settings as they are usually: %s: %s", swb_status_name(status), swb_last_error());
    }
    task_free(&running);
    return wrong;
}

static void interrupt(void)
{
    if (runs)
        task_interrupt(&running);
}

int main(int n, char **arguments)
{
    list_options();
    const struct cases cases = {"matrix", n_choices * N_TASKS, run, describe, interrupt};
    return cases_main(&cases, n, arguments);
}
