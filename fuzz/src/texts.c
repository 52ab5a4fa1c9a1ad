#include "texts.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { KEPT = 24, LONGEST = 1 << 16, HUGE_TEXT = 1 << 20 };

static char kept[KEPT][LONGEST];
static int n_kept;

void texts_keep(const char *text)
{
    if (strlen(text) < LONGEST)
        strcpy(kept[n_kept++ % KEPT], text);
}

const char *texts_odd(struct random *r)
{
    static const char *const odd[] = {"", " ", "\xff\xfe", "\n", "%s%n%d", "../..", "{", "[[[[[[[[", "null", "1e999", "-0", "nan",
                                      "\xc3\xa9", "rk_family", "\t\r", "\xed\xa0\x80"};
    static char *huge;
    if (!huge && (huge = malloc(HUGE_TEXT))) {
        memset(huge, 'a', HUGE_TEXT - 1);
        huge[HUGE_TEXT - 1] = '\0';
    }
    int64_t which = random_below(r, 18);
    return which < 16 ? odd[which] : which == 16 ? "a_name_of_more_than_sixty_four_characters_which_no_option_has_and_never_will" : huge;
}

const char *texts_number(struct random *r, double value)
{
    static char text[64];
    snprintf(text, sizeof text, random_once_in(r, 2) ? "%.17g" : "%.0f", fmax(fmin(value, 1e40), -1e40));
    return text;
}

/* One damage: a character, a number, a piece twice or not at all. */
static void damage(struct random *r, char *text)
{
    static const char *const numbers[] = {"-1", "1e999", "18446744073709551616", "0", "nan", "null", "[]", "{}", "\"x\"", "1e-320"};
    size_t n = strlen(text);
    if (n == 0)
        return;
    size_t at = (size_t)random_below(r, (int64_t)n), length = (size_t)random_below(r, (int64_t)(n - at) + 1) % 64;
    switch (random_below(r, 5)) {
    case 0:
        text[at] = (char)(1 + random_below(r, 255));
        break;
    case 1:
        text[at] = '\0';
        break;
    case 2: /* a piece goes */
        memmove(text + at, text + at + length, n - at - length + 1);
        break;
    case 3: /* a piece twice */
        if (n + length + 1 < LONGEST)
            memmove(text + at + length, text + at, n - at + 1);
        break;
    default: { /* another value in the place of a number */
        size_t from = at + strcspn(text + at, "0123456789"), digits = strspn(text + from, "0123456789.eE+-");
        const char *other = numbers[random_below(r, 10)];
        if (digits && n - digits + strlen(other) + 1 < LONGEST) {
            memmove(text + from + strlen(other), text + from + digits, n - from - digits + 1);
            memcpy(text + from, other, strlen(other));
        }
    }
    }
}

const char *texts_document(struct random *r)
{
    static char text[LONGEST];
    int known = n_kept < KEPT ? n_kept : KEPT;
    if (known == 0)
        return NULL;
    strcpy(text, kept[random_below(r, known)]);
    for (int64_t k = random_below(r, 4); k > 0; k--)
        damage(r, text);
    return text;
}

const char *texts_folder(struct random *r)
{
    static const char *const folders[] = {"", "a", "a/b", "a b/\xc3\xa9", "..", "../..", "\xff\xfe", "/dev/null/none"};
    return getenv("FUZZ_FOLDER") ? folders[random_below(r, 8)] : "/dev/null/none";
}

const char *texts_for(struct random *r, const char *argument)
{
    static const char *const inputs[] = {"x", "x u", "x p", "x u p t", "", "u", "x x", "y", NULL};
    static const char *const names[] = {"f", "x\ny\nz", "a", "\n\n\n\n", "T_out\nT_in", "f0", "a b", "jac_f"};
    if (strcmp(argument, "text") == 0)
        return texts_document(r);
    if (strcmp(argument, "path") == 0 || strcmp(argument, "casadi") == 0 || strcmp(argument, "file") == 0) {
        static char variable[32];
        snprintf(variable, sizeof variable, "FUZZ_%s", strcmp(argument, "path") == 0 ? "LIBRARY" : strcmp(argument, "file") == 0 ? "CASADI_FILE" : "CASADI");
        const char *path = getenv(variable);
        return path && !random_once_in(r, 4) ? path : "/nonexistent";
    }
    if (strcmp(argument, "inputs") == 0)
        return inputs[random_below(r, 9)];
    return names[random_below(r, 8)];
}
