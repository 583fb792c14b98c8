/* pt_cases.h: reads tests/data/cases.csv, stiff and extreme cases with expected results; what its columns and
   flags mean is said at the top of that file. Tests run from the root of the repository. */

#ifndef PT_CASES_H
#define PT_CASES_H

#include "pt_test.h"

#define PT_CASES_PATH "tests/data/cases.csv"

/* One row. The lists hold key=value pairs joined by ';', vectors joined by ':'. */
typedef struct pt_case {
    const char *id, *kind, *variety, *inputs, *expected, *tolerance_float, *tolerance_double, *flags;
    char line[1024];
} pt_case;

static inline FILE *pt_cases_open(void)
{
    FILE *const file = fopen(PT_CASES_PATH, "r");
    if (!file) {
        printf("%s cannot open " PT_CASES_PATH "; run the tests from the root of the repository\n",
               pt_test_count(0));
    }
    return file;
}

/* Cuts the next field off a line; the last one ends at the line's end. */
static inline const char *pt_case_field(char **rest)
{
    char *const field = *rest;
    char *const end = field + strcspn(field, ",\r\n");
    *rest = *end ? end + 1 : end;
    *end = '\0';
    return field;
}

/* The next row of a kind, 0 at the end of the file. */
static inline int pt_case_next(FILE *file, const char *kind, pt_case *c)
{
    while (fgets(c->line, sizeof c->line, file)) {
        char *rest = c->line;
        if (c->line[0] == '#') continue;
        c->id = pt_case_field(&rest);
        c->kind = pt_case_field(&rest);
        c->variety = pt_case_field(&rest);
        c->inputs = pt_case_field(&rest);
        c->expected = pt_case_field(&rest);
        c->tolerance_float = pt_case_field(&rest);
        c->tolerance_double = pt_case_field(&rest);
        c->flags = pt_case_field(&rest);
        if (strcmp(c->kind, kind) == 0) return 1;
    }
    return 0;
}

/* What stands behind `key` and the separator (one character) in a list, NULL if the key is not there. */
static inline const char *pt_case_find(const char *list, const char *key, char separator)
{
    const size_t length = strlen(key);
    const char *at = list;
    while (at) {
        if (strncmp(at, key, length) == 0 && at[length] == separator) return at + length + 1;
        at = strchr(at, ';');
        if (at) at++;
    }
    return NULL;
}

static inline double pt_case_number(const char *list, const char *key)
{
    const char *const at = pt_case_find(list, key, '=');
    return at ? strtod(at, NULL) : HUGE_VAL;
}

static inline uint64_t pt_case_integer(const char *list, const char *key)
{
    const char *const at = pt_case_find(list, key, '=');
    return at ? strtoull(at, NULL, 0) : 0;
}

static inline pt_vec3 pt_case_vec3(const char *list, const char *key)
{
    const char *const at = pt_case_find(list, key, '=');
    double v[3] = {0, 0, 0};
    char *end = NULL;
    int i;
    for (i = 0; at && i < 3; i++) v[i] = strtod(end ? end + 1 : at, &end);
    return pt_v3((pt_real)v[0], (pt_real)v[1], (pt_real)v[2]);
}

/* Of a float code or a double one: key "abs", "rel", "abs_t", ...; "exact" and absent keys are 0. */
static inline double pt_case_tolerance(const pt_case *c, int in_double, const char *key)
{
    const char *const at = pt_case_find(in_double ? c->tolerance_double : c->tolerance_float, key, ':');
    return at ? strtod(at, NULL) : 0;
}

static inline int pt_case_has(const pt_case *c, const char *flag)
{
    const char *at = c->flags;
    const size_t length = strlen(flag);
    for (; at; at = strchr(at, ';') ? strchr(at, ';') + 1 : NULL)
        if (strncmp(at, flag, length) == 0 && (at[length] == ';' || at[length] == '\0')) return 1;
    return 0;
}

#endif /* PT_CASES_H */
