/* pt_rows.h: reads tables of exact values, tests/data/oracles_*.csv. A row is an id (TABLE-number), a quantity,
   parameters key=value joined by ';', the value and its absolute uncertainty. Every row must be used by some
   test, but those of tables that are named as due later, with the reason. Tests run from the root of the
   repository. */

#ifndef PT_ROWS_H
#define PT_ROWS_H

#include "pt_cases.h"

#define ROWS_MAX 1024

typedef struct row {
    char line[256]; /* comments of the file included */
    const char *id, *quantity, *params;
    double value, error;
    int used;
    const char *later; /* why no test uses it yet, or NULL */
} row;

static row rows[ROWS_MAX];
static int row_count;

/* Adds the rows of a file to those that are there. */
static inline int load_rows(const char *path)
{
    const int before = row_count;
    FILE *const file = fopen(path, "r");
    while (file && row_count < ROWS_MAX && fgets(rows[row_count].line, sizeof rows[0].line, file)) {
        row *const r = &rows[row_count];
        char *rest = r->line;
        if (r->line[0] == '#') continue;
        r->id = pt_case_field(&rest);
        r->quantity = pt_case_field(&rest);
        r->params = pt_case_field(&rest);
        r->value = strtod(pt_case_field(&rest), NULL);
        r->error = strtod(pt_case_field(&rest), NULL);
        row_count++;
    }
    if (file) fclose(file);
    if (row_count == before)
        printf("%s cannot read %s; run the tests from the root of the repository\n", pt_test_count(0), path);
    return row_count > before && row_count < ROWS_MAX;
}

static inline int in_table(const row *r, const char *table)
{
    const size_t length = strlen(table);
    return strncmp(r->id, table, length) == 0 && r->id[length] == '-';
}

/* The next row of a table that is not due later, with that quantity unless it is NULL; NULL at the end. `at`
   begins at 0. */
static inline const row *next_row(const char *table, const char *quantity, int *at)
{
    while (*at < row_count) {
        row *const r = &rows[(*at)++];
        if (r->later || !in_table(r, table)) continue;
        if (quantity && strcmp(r->quantity, quantity) != 0) continue;
        r->used = 1;
        return r;
    }
    return NULL;
}

static inline const row *find_row(const char *table, const char *quantity, const char *params)
{
    const row *r;
    int at = 0;
    while ((r = next_row(table, quantity, &at)) != NULL && strcmp(r->params, params) != 0) {
    }
    pt_check(r != NULL, "exact values", "no row %s %s %s", table, quantity, params);
    return r ? r : &rows[0];
}

static inline double parameter(const row *r, const char *key) { return pt_case_number(r->params, key); }
static inline int has(const row *r, const char *key) { return pt_case_find(r->params, key, '=') != NULL; }

/* Is the parameter this word? */
static inline int is_word(const row *r, const char *key, const char *word)
{
    const char *const at = pt_case_find(r->params, key, '=');
    const size_t length = strlen(word);
    return at && strncmp(at, word, length) == 0 && (at[length] == ';' || at[length] == '\0');
}

/* Numbers of a list like ((-1 -1 1) (1 0 2)), at most max; returns how many. */
static inline int numbers(const row *r, const char *key, double *out, int max)
{
    const char *at = pt_case_find(r->params, key, '=');
    int n = 0;
    while (at && *at && *at != ';' && n < max) {
        char *end;
        out[n] = strtod(at, &end);
        if (end == at) at++;
        else n++, at = end;
    }
    return n;
}

/* A table that waits for something, or those of its rows whose quantity ends in `part` or whose parameters do
   (NULL: all). One line is printed for each. */
typedef struct later_rows {
    const char *table, *part, *reason;
} later_rows;

static inline int ends_in(const char *text, const char *part)
{
    const size_t n = strlen(text), m = strlen(part);
    return n >= m && strcmp(text + n - m, part) == 0;
}

static inline void due_later(const later_rows *list, size_t count)
{
    size_t k;
    for (k = 0; k < count; k++) {
        const char *const part = list[k].part;
        int i, n = 0;
        for (i = 0; i < row_count; i++) {
            row *const r = &rows[i];
            if (r->later || !in_table(r, list[k].table)) continue;
            if (part && !ends_in(r->quantity, part) && !ends_in(r->params, part)) continue;
            r->later = list[k].reason;
            n++;
        }
        printf("%s  %s%s%s %d rows: %s\n", strncmp(list[k].reason, "tests/", 6) == 0 ? "tested" : "later",
               list[k].table, part ? " " : "", part ? part : "", n, list[k].reason);
        pt_check(n > 0, "rows due later", "%s has none; take it off the list", list[k].table);
    }
}

static inline void every_row_is_used(void)
{
    int i;
    for (i = 0; i < row_count; i++)
        pt_check(rows[i].used || rows[i].later, "rows in use", "%s %s %s", rows[i].id, rows[i].quantity,
                 rows[i].params);
}

static inline void near_relative(const char *name, double got, double exact, double tolerance)
{
    pt_check(fabs(got - exact) <= tolerance * fabs(exact), name, "got %.17g, exact %.17g, relative %.3g", got,
             exact, fabs(got - exact) / fabs(exact));
}

#endif /* PT_ROWS_H */
