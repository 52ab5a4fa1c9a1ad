/* Settings: the struct, the door by name, the option table, other versions of the struct. */
#include <stdlib.h>

#include "check.h"

static const uint64_t SENTINEL = 0xdeadbeefdeadbeef;

static void init_writes_every_word(void)
{
    union {
        swb_settings settings;
        uint64_t word[sizeof(swb_settings) / 8 + 4];
    } u;
    const size_t n = sizeof(swb_settings) / 8;
    size_t i, size;

    CHECK(sizeof(swb_settings) % 8 == 0);
    /* The struct of this header, older (shorter) and newer (longer) ones. */
    for (size = 1; size <= n + 3; size++) {
        for (i = 0; i < n + 4; i++)
            u.word[i] = SENTINEL;
        CHECK_OK(swb_settings_init(&u.settings, 8 * size));
        for (i = 0; i < n + 4; i++)
            CHECK((u.word[i] == SENTINEL) == (i >= size));
        CHECK(u.settings.struct_size == 8 * size);
        CHECK_OK(swb_settings_validate(&u.settings));
    }
    CHECK_STATUS(SWB_ERR_NULL, swb_settings_init(NULL, sizeof(swb_settings)));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_settings_init(&u.settings, 0));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_settings_init(&u.settings, 4));
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_settings_init(&u.settings, 8 * n + 1));

    /* A struct that nobody initialised is noticed. */
    for (i = 0; i < n; i++)
        u.word[i] = SENTINEL;
    CHECK_STATUS(SWB_ERR_STATE, swb_settings_validate(&u.settings));
    CHECK_STATUS(SWB_ERR_STATE, swb_settings_set_int(&u.settings, "n_s", 3));
    CHECK(u.word[2] == SENTINEL);

    /* An option behind the end of an older struct cannot be set. */
    CHECK_OK(swb_settings_init(&u.settings, 16));
    u.word[2] = SENTINEL;
    CHECK_OK(swb_settings_set_string(&u.settings, "rk_family", "explicit"));
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_set_int(&u.settings, "n_s", 3));
    CHECK(u.word[2] == SENTINEL);
}

static void doors(void)
{
    swb_settings s;
    int64_t i;
    double d;
    char text[64];

    CHECK_OK(swb_settings_init(&s, sizeof s));
    CHECK(s.n_s == 3 && s.n_fe == 3 && s.tol == 1e-9 && isinf(s.max_time));
    CHECK(s.step_equilibration == SWB_STEP_EQUILIBRATION_DIFFERENCE && s.polish == SWB_POLISH_ON);

    CHECK_OK(swb_settings_set_int(&s, "n_s", 4));
    CHECK_OK(swb_settings_set_double(&s, "tol", 1e-6));
    CHECK_OK(swb_settings_set_int(&s, "rho_h", 3));
    CHECK_OK(swb_settings_set_string(&s, "rk_family", "gauss_legendre"));
    CHECK_OK(swb_settings_set_string(&s, "max_time", "2.5"));
    CHECK_OK(swb_settings_set_string(&s, "log_level", "4"));
    CHECK(s.n_s == 4 && s.tol == 1e-6 && s.rho_h == 3.0 && s.max_time == 2.5);
    CHECK(s.rk_family == SWB_RK_FAMILY_GAUSS_LEGENDRE && s.log_level == SWB_LOG_LEVEL_DEBUG);

    CHECK_OK(swb_settings_get_int(&s, "n_s", &i));
    CHECK(i == 4);
    CHECK_OK(swb_settings_get_double(&s, "n_s", &d));
    CHECK(d == 4.0);
    CHECK_OK(swb_settings_get_double(NULL, "tol", &d)); /* NULL: defaults */
    CHECK(d == 1e-9);
    CHECK_OK(swb_settings_get_string(&s, "rk_family", text, sizeof text, &i));
    CHECK_TEXT("gauss_legendre", text);
    CHECK(i == 15);

    CHECK_STATUS(SWB_ERR_RANGE, swb_settings_set_double(&s, "tol", 0.0));
    CHECK_TEXT("option 'tol' is 0, outside (0, 1)", swb_last_error());
    CHECK_STATUS(SWB_ERR_RANGE, swb_settings_set_double(&s, "tol", (double)NAN));
    CHECK_STATUS(SWB_ERR_RANGE, swb_settings_set_int(&s, "cross", 9));
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_set_double(&s, "n_s", 3.0));
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_set_string(&s, "n_s", "three"));
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_set_int(&s, "max_itre", 3));
    CHECK_TEXT("unknown option 'max_itre'; did you mean 'max_iter'?", swb_last_error());
    CHECK_STATUS(SWB_ERR_OPTION, swb_settings_get_int(&s, "tol", &i));
    CHECK_STATUS(SWB_ERR_NULL, swb_settings_set_int(&s, NULL, 3));
    CHECK_STATUS(SWB_ERR_NULL, swb_settings_set_int(NULL, "n_s", 3));
    CHECK_STATUS(SWB_ERR_NULL, swb_settings_set_string(&s, "n_s", NULL));
    CHECK_STATUS(SWB_ERR_NULL, swb_settings_get_int(&s, "n_s", NULL));
    CHECK_STATUS(SWB_ERR_RANGE, swb_settings_set_string(&s, "\xff\xfe", "1"));
    CHECK(s.n_s == 4 && s.tol == 1e-6 && s.cross == SWB_CROSS_ELEMENT);

    CHECK_OK(swb_settings_validate(&s));
    s.gamma_h = 2.0;
    CHECK_STATUS(SWB_ERR_RANGE, swb_settings_validate(&s));
    CHECK_TEXT("option 'gamma_h' is 2, outside (0, 1]", swb_last_error());
}

static void table(void)
{
    int64_t n = swb_option_count(), i, k, index;
    swb_settings s;

    CHECK_OK(swb_settings_init(&s, sizeof s));
    CHECK(8 * (n + 1) == (int64_t)sizeof s);
    for (i = 0; i < n; i++) {
        const char *name = swb_option_name(i);
        double min, max, value, current;
        int32_t kind, min_open, max_open, setup_only;

        CHECK_OK(swb_option_find(name, &index));
        CHECK(index == i);
        CHECK(strlen(swb_option_doc(i)) > 10 && swb_option_symbol(i) != NULL);
        CHECK_OK(swb_option_kind(i, &kind));
        CHECK_OK(swb_option_range(i, &min, &max, &min_open, &max_open));
        CHECK_OK(swb_option_range(i, NULL, NULL, NULL, NULL));
        CHECK_OK(swb_option_default(i, &value));
        CHECK_OK(swb_option_setup_only(i, &setup_only));
        CHECK(min_open ? value > min : value >= min);
        CHECK(max_open ? value < max : value <= max);
        CHECK_OK(swb_settings_get_double(&s, name, &current));
        CHECK(current == value);
        CHECK(setup_only == 0 || setup_only == 1);

        for (k = 0; swb_option_value_name(i, k) != NULL; k++) {
            CHECK_OK(swb_settings_set_string(&s, name, swb_option_value_name(i, k)));
            CHECK_OK(swb_settings_get_int(&s, name, &index));
            CHECK(index == k);
        }
        CHECK(kind == SWB_KIND_ENUM ? (double)k == max + 1 : k == 0);
    }
    for (i = -1; i <= n; i += n + 1) {
        int32_t kind = 55;
        CHECK(swb_option_name(i) == NULL && swb_option_doc(i) == NULL && swb_option_symbol(i) == NULL);
        CHECK(swb_option_value_name(i, 0) == NULL);
        CHECK_STATUS(SWB_ERR_DIMENSION, swb_option_kind(i, &kind));
        CHECK(kind == 55);
    }
}

static void json(void)
{
    int64_t needed;
    char *text;

    CHECK_OK(swb_settings_to_json(NULL, NULL, 0, &needed));
    text = (char *)malloc((size_t)needed);
    CHECK_STATUS(SWB_ERR_DIMENSION, swb_settings_to_json(NULL, text, needed - 1, NULL));
    CHECK_OK(swb_settings_to_json(NULL, text, needed, NULL));
    CHECK(strlen(text) + 1 == (size_t)needed);
    CHECK(strstr(text, "\"rk_family\": \"radau_iia\"") && strstr(text, "\"tol\": 1e-9"));
    free(text);
}

struct lines {
    int debug, info;
    char last[128];
};

static void collect(int64_t level, const char *line, void *user_data)
{
    struct lines *lines = (struct lines *)user_data;
    if (level == SWB_LOG_LEVEL_DEBUG) {
        lines->debug++;
    } else if (level == SWB_LOG_LEVEL_INFO) {
        lines->info++;
        strncpy(lines->last, line, sizeof lines->last - 1);
    }
}

static void log_sink(void)
{
    struct lines lines = {0, 0, ""};
    swb_settings s;

    CHECK_OK(swb_settings_init(&s, sizeof s));
    s.max_iter = 50;
    CHECK_OK(swb_settings_log(&s, collect, &lines));
    CHECK(lines.info == 1 && lines.debug == swb_option_count() - 1);
    CHECK_TEXT("settings max_iter = 50", lines.last);
    CHECK_STATUS(SWB_ERR_NULL, swb_settings_log(&s, NULL, NULL));
}

int main(void)
{
    init_writes_every_word();
    doors();
    table();
    json();
    log_sink();
    return CHECK_DONE();
}
