/* mutants.c: tests the tests. A mutant is the header with one change that makes it wrong; the tests are
   compiled against it, and one of them must fail. A mutant that survives is a check that is missing.

       cc -O2 tests/mutants.c -o mutants && CC=cc ./mutants [OPTIONS] test_numbers test_transport ...

   in the project's top directory (POSIX); the arguments are the test programs. Options:

       --generate N    as well as the planted bugs, N changes that nobody chose (default 0)
       --generated     without the planted bugs
       --all           also what tests/mutants_equivalent.txt excuses
       --only NAME     one mutant
       --share k/n     every n-th from the k-th on
       --list          says what would be tried, and tries nothing

   PLANTED BUGS stand in tests/mutants.txt:

       mutant name: what is wrong
       section PT-04                       only there, in the implementation (default: the whole header)
       test test_sampling cosine           the program, and names of tests in it, that should catch it
       < text that occurs exactly once
       > what stands there instead

   Several lines of < (and of >) are one text with line ends between them.

   GENERATED ONES exchange an operator, change a constant, drop a sign or negate a condition in one of the
   sections PT-03 to PT-11. Each possible change has a key, a hash of DRAW_SEED, the function's name and the line
   before and after; each section gives those with the smallest keys. So a draw of 20 is part of a draw of 200,
   and an edit of the header exchanges only the mutants of the lines that it touches. What survives and is no
   error stands in tests/mutants_equivalent.txt with the reason, and is left out:

       equivalent function: why no test can see it
       < the line as it is, without blanks around it
       > the line changed

   The test most likely to catch a mutant runs first, with SHORT=1, then in full; then the programs that look at its
   section, then all others. Each also runs on the header as it is, where it must pass, and has four times the CPU
   seconds that it takes there, 4 more, and 2 GB. A program ends at its first failed check. A mutant that the compiler
   turns into the same machine code is no mutant; one that does not compile is drawn again (a planted one has failed).

   Prints one line a mutant: section, what it is, what caught it, seconds; and at the end 'mutants: N passed, N
   failed'. Failed: survived; a planted one that does not compile or is not found; a wrong excuse. */

#define _POSIX_C_SOURCE 200809L

#include <ctype.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#define DIR "build/mutants"
#define DRAW_SEED 1

enum { MAX_TEXT = 4096, MAX_LINE = 640, MAX_NAME = 64, MAX_TESTS = 32, MAX_MUTANTS = 512, MAX_SOUND = 1024 };
enum { FIRST_SECTION = 3, LAST_SECTION = 11, SECTIONS = LAST_SECTION - FIRST_SECTION + 1 };

typedef struct mutant {
    char name[MAX_NAME], what[MAX_LINE], section[16], test[MAX_LINE];
    char find[MAX_TEXT], replace[MAX_TEXT];
    size_t at, length;              /* what is replaced                                                    */
} mutant;

/* A change that can be made. */
typedef struct site {
    size_t at, length, function_at; /* in the header                                                       */
    int function_length, section;
    uint64_t key;
    char with[128];
} site;

/* How a test behaves on the header as it is. */
typedef struct soundness {
    char test[MAX_LINE];
    int is_short, passed;
    double seconds;                 /* of CPU                                                              */
} soundness;

/* How a run ended; text: its first failed check, or what ended it. Empty = all is well. */
typedef struct outcome {
    char text[128];
    int passed;
    double seconds;                 /* of CPU                                                              */
} outcome;

typedef enum verdict { CAUGHT, NOT_CAUGHT, SAME_CODE, NO_COMPILE, INVALID } verdict;

typedef struct runner {
    char *header;
    const char *only;               /* NULL = all                                                          */
    int share, shares, generate, skip_planted, all, list;
    const char *tests[MAX_TESTS];   /* names of the test programs                                          */
    verdict built[MAX_TESTS];       /* against the mutant: INVALID = not yet, else CAUGHT = it differs,
                                       SAME_CODE or NO_COMPILE                                             */
    int test_count;
    soundness sound[MAX_SOUND];
    int sound_count;
    mutant *excuses;
    int excuse_count;
    site *sites;                    /* by section and key                                                  */
    int site_count, site_room, first[SECTIONS + 1];
    int passed, failed, excused, same;
} runner;

/* ---- files and text --------------------------------------------------------------------------------- */

/* The whole file as a string, NULL on failure. To be freed. */
static char *read_file(const char *path)
{
    FILE *f = fopen(path, "rb");
    char *text = NULL;
    long size;

    if (!f) return NULL;
    if (fseek(f, 0, SEEK_END) == 0 && (size = ftell(f)) >= 0 && fseek(f, 0, SEEK_SET) == 0 &&
        (text = (char *)malloc((size_t)size + 1)) != NULL)
        text[fread(text, 1, (size_t)size, f)] = '\0';
    fclose(f);
    return text;
}

/* Writes head[0..length) and the two strings after it; 1 if all went well. */
static int write_file(const char *path, const char *head, size_t length, const char *middle, const char *tail)
{
    FILE *f = fopen(path, "wb");
    int ok;

    if (!f) return 0;
    ok = fwrite(head, 1, length, f) == length && fputs(middle, f) >= 0 && fputs(tail, f) >= 0;
    return (fclose(f) == 0) & ok;
}

/* Copies the rest of a line without blanks around it; 1 if it fits. */
static int copy_trimmed(char *out, size_t size, const char *s)
{
    size_t n;

    while (isspace((unsigned char)*s)) s++;
    n = strlen(s);
    while (n > 0 && isspace((unsigned char)s[n - 1])) n--;
    if (n >= size) return 0;
    memcpy(out, s, n);
    out[n] = '\0';
    return 1;
}

/* Appends one line of text, line ends in between; 1 if it fits. */
static int append_line(char *text, const char *line)
{
    size_t length = strlen(text), n = strcspn(line, "\n");

    if (length + n + 2 > MAX_TEXT) return 0;
    if (length > 0) text[length++] = '\n';
    memcpy(text + length, line, n);
    text[length + n] = '\0';
    return 1;
}

/* A name put together, cut off if it is too long: names of mutants and tests are short. */
static void name(char *out, size_t size, const char *format, ...)
{
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(out, size, format, arguments);
    va_end(arguments);
}

/* Runs a command put together; 1 if it succeeded. */
static int shell(const char *format, ...)
{
    char command[2048];
    va_list arguments;
    int length;

    va_start(arguments, format);
    length = vsnprintf(command, sizeof command, format, arguments);
    va_end(arguments);
    return length > 0 && length < (int)sizeof command && system(command) == 0;
}

static double seconds_now(void)
{
    struct timespec t;

    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ---- the two lists ----------------------------------------------------------------------------------- */

static int take_name(mutant *m, const char *s)
{
    const char *colon = strchr(s, ':');
    size_t n = colon ? (size_t)(colon - s) : 0;

    if (n == 0 || n >= MAX_NAME) return 0;
    memset(m, 0, sizeof *m);
    memcpy(m->name, s, n);
    return strspn(m->name, "abcdefghijklmnopqrstuvwxyz0123456789_") == n &&
           copy_trimmed(m->what, sizeof m->what, colon + 1);
}

/* One line of a list, whose entries begin with `keyword`, into its newest entry; 1 if it is understood. */
static int take_line(mutant *list, int *count, const char *keyword, const char *line)
{
    mutant *m = *count > 0 ? &list[*count - 1] : NULL;
    size_t n = strlen(keyword);

    if (line[0] == '#' || line[strspn(line, " \t\r\n")] == '\0') return 1;
    if (strncmp(line, keyword, n) == 0) return *count < MAX_MUTANTS && take_name(&list[(*count)++], line + n);
    if (!m) return 0;
    if (strncmp(line, "section ", 8) == 0) return copy_trimmed(m->section, sizeof m->section, line + 8);
    if (strncmp(line, "test ", 5) == 0) return copy_trimmed(m->test, sizeof m->test, line + 5);
    if (line[0] == '<') return append_line(m->find, line + (line[1] == ' ' ? 2 : 1));
    if (line[0] == '>') return append_line(m->replace, line + (line[1] == ' ' ? 2 : 1));
    return 0;
}

/* How many entries there are, -1 if the file cannot be read or understood. */
static int read_list(const char *path, const char *keyword, mutant *list)
{
    FILE *f = fopen(path, "r");
    char line[MAX_LINE];
    int count = 0, number = 0, ok = 1;

    if (!f) {
        fprintf(stderr, "mutants: cannot read %s\n", path);
        return -1;
    }
    while (ok && fgets(line, sizeof line, f)) {
        number++;
        ok = strchr(line, '\n') != NULL && take_line(list, &count, keyword, line);
    }
    fclose(f);
    if (!ok) fprintf(stderr, "mutants: %s:%d is not understood\n", path, number);
    return ok ? count : -1;
}

/* ---- places in the header ---------------------------------------------------------------------------- */

/* The range of the implementation of a section, "" = the whole header; 0 if there is no such section. */
static int section_range(const char *header, const char *section, const char **begin, const char **end)
{
    char tag[24];
    const char *p = header, *line_end;

    *begin = header;
    *end = header + strlen(header);
    if (!section[0]) return 1;
    name(tag, sizeof tag, "\n   [%s]", section);
    for (*begin = NULL; !*begin && (p = strstr(p, tag)) != NULL; p++) {
        line_end = strchr(p + 1, '\n');
        if (line_end && strstr(p, ": implementation") && strstr(p, ": implementation") < line_end) *begin = p;
    }
    if (!*begin) return 0;
    p = strstr(*begin + 1, "\n   [PT-");
    if (p) *end = p;
    return 1;
}

/* Finds the one place of a planted bug's text; NULL, or why that failed. */
static const char *find_place(const char *header, mutant *m)
{
    const char *begin, *end, *first, *second;

    if (!section_range(header, m->section, &begin, &end)) return "its section is not in the header";
    m->length = strlen(m->find);
    first = strstr(begin, m->find);
    if (m->length == 0 || !first || first + m->length > end) return "its text is not in the header";
    second = strstr(first + 1, m->find);
    if (second && second + m->length <= end) return "its text occurs more than once";
    if (strcmp(m->find, m->replace) == 0) return "it changes nothing";
    m->at = (size_t)(first - header);
    return NULL;
}

/* ---- generated mutants: the places where something can be changed ------------------------------------- */

/* A walk over one section. */
typedef struct scan {
    runner *r;
    const char *p, *end;
    int section, depth, in_function;
    const char *function;           /* the last name before a ( outside of all braces, NULL = none         */
    int function_length;
} scan;

static void line_bounds(const char *header, const char *p, const char **begin, const char **end)
{
    *begin = p;
    while (*begin > header && (*begin)[-1] != '\n') --*begin;
    *end = p + strcspn(p, "\n");
}

/* The site's line before and after, without blanks around it. */
static void site_lines(const char *header, const site *s, char *before, char *after, size_t size)
{
    const char *at = header + s->at, *begin, *end;
    char line[2 * MAX_LINE];

    line_bounds(header, at, &begin, &end);
    name(line, sizeof line, "%.*s", (int)(end - begin), begin);
    if (!copy_trimmed(before, size, line)) before[0] = '\0';
    name(line, sizeof line, "%.*s%s%.*s", (int)(at - begin), begin, s->with, (int)(end - at - (long)s->length),
         at + s->length);
    if (!copy_trimmed(after, size, line)) after[0] = '\0';
}

static uint64_t hash_text(uint64_t h, const char *s, size_t n)
{
    size_t i;

    for (i = 0; i < n; i++) h = (h ^ (unsigned char)s[i]) * UINT64_C(0x100000001b3); /* FNV-1a */
    return (h ^ (h >> 32)) * UINT64_C(0x9e3779b97f4a7c15);
}

/* Equal changes of equal lines of a function differ by how many there are before. */
static uint64_t site_key(const runner *r, const site *s)
{
    char before[MAX_LINE], after[MAX_LINE];
    uint64_t key = hash_text(DRAW_SEED, r->header + s->function_at, (size_t)s->function_length);
    int i;

    site_lines(r->header, s, before, after, sizeof before);
    key = hash_text(hash_text(key, before, strlen(before)), after, strlen(after));
    for (i = r->site_count - 1; i >= 0 && r->sites[i].function_at == s->function_at; i--)
        if (r->sites[i].key == key) key = hash_text(key, "again", 5);
    return key;
}

static void add_site(scan *c, const char *at, size_t length, const char *with)
{
    runner *r = c->r;
    site *s;

    if (!c->in_function || strlen(with) >= sizeof s->with) return;
    if (r->site_count == r->site_room) {
        r->site_room = r->site_room * 2 + 1024;
        s = (site *)realloc(r->sites, (size_t)r->site_room * sizeof *s);
        if (!s) {
            fprintf(stderr, "mutants: out of memory\n");
            exit(2);
        }
        r->sites = s;
    }
    s = &r->sites[r->site_count];
    s->at = (size_t)(at - r->header);
    s->length = length;
    s->function_at = (size_t)(c->function - r->header);
    s->function_length = c->function_length;
    s->section = c->section;
    strcpy(s->with, with);
    s->key = site_key(r, s);
    r->site_count++;
}

/* Is the number at p (n characters) the size of an array that is declared here? */
static int is_array_size(const char *header, const char *p, size_t n)
{
    static const char *const types[] = {"double ", "int ", "char ", "static ", "const ", "uint", "size_t ", "unsigned ", "pt_", "pti_"};
    const char *begin, *end;
    size_t i;

    if (p[-1] != '[' || p[n] != ']' || !strchr(",;[) ", p[n + 1])) return 0;
    line_bounds(header, p, &begin, &end);
    begin += strspn(begin, " ");
    for (i = 0; i < sizeof types / sizeof types[0]; i++)
        if (strncmp(begin, types[i], strlen(types[i])) == 0) return 1;
    return 0;
}

/* 0 becomes 1, 1 becomes 0 and 2, 0.5 becomes 0.25, other whole numbers one more, other reals twice as much. */
static const char *scan_number(scan *c, const char *p)
{
    size_t n = 0;
    int is_hex = p[0] == '0' && (p[1] == 'x' || p[1] == 'X');
    char with[128];

    while (isalnum((unsigned char)p[n]) || p[n] == '.' || (!is_hex && strchr("+-", p[n]) && strchr("eE", p[n - 1]))) n++;
    if (n > 60 || is_array_size(c->r->header, p, n)) return p + n;
    if (n == 1 && p[0] == '0') add_site(c, p, n, "1");
    else if (n == 1 && p[0] == '1') {
        add_site(c, p, n, "0");
        add_site(c, p, n, "2");
    } else if (n == 3 && strncmp(p, "0.5", 3) == 0) add_site(c, p, n, "0.25");
    else {
        name(with, sizeof with, is_hex || !memchr(p, '.', n) ? "(%.*s + 1)" : "(2 * %.*s)", (int)n, p);
        add_site(c, p, n, with);
    }
    return p + n;
}

/* A word: perhaps the function's name, an assertion to be skipped, or an if whose condition can be negated. */
static const char *scan_word(scan *c, const char *p)
{
    size_t n = 0, k;
    int depth = 0;
    char with[128];

    while (isalnum((unsigned char)p[n]) || p[n] == '_') n++;
    if (c->depth == 0 && p[n] == '(') {
        c->function = p;
        c->function_length = (int)n;
    }
    if (n == 9 && strncmp(p, "PT_ASSERT", n) == 0) return p + strcspn(p, ";");
    if (n != 2 || strncmp(p, "if", n) != 0 || p[2] != ' ' || p[3] != '(') return p + n;
    for (k = 3; p[k] != '\n'; k++) {
        depth += (p[k] == '(') - (p[k] == ')');
        if (depth == 0) break;
    }
    name(with, sizeof with, "(!%.*s)", (int)(k - 2), p + 3);
    if (p[k] == ')' && k < 100) add_site(c, p + 3, k - 2, with);
    return p + n;
}

/* An operator. One character between blanks has two operands; a minus before its operand is a sign. */
static const char *scan_operator(scan *c, const char *p)
{
    static const char *const swaps[][3] = {
        {"->", NULL, NULL}, {"++", "--", NULL}, {"--", "++", NULL}, {"+=", "-=", NULL}, {"-=", "+=", NULL},
        {"*=", "/=", NULL}, {"/=", "*=", NULL}, {"|=", NULL, NULL}, {"&=", NULL, NULL}, {"<<", ">>", NULL},
        {">>", "<<", NULL}, {"<=", "<", ">"}, {">=", ">", "<"}, {"==", "!=", NULL}, {"!=", "==", NULL},
        {"&&", "||", NULL}, {"||", "&&", NULL}, {"+", "-", NULL}, {"-", "+", NULL}, {"*", "/", NULL},
        {"/", "*", NULL}, {"%", "/", NULL}, {"<", "<=", ">="}, {">", ">=", "<="}
    };
    int is_binary;
    size_t i, k, n;

    for (i = 0; i < sizeof swaps / sizeof swaps[0]; i++) {
        n = strlen(swaps[i][0]);
        if (strncmp(p, swaps[i][0], n) != 0) continue;
        is_binary = p[-1] == ' ' && isspace((unsigned char)p[n]);
        for (k = 1; k < 3 && (n > 1 || is_binary); k++)
            if (swaps[i][k]) add_site(c, p, n, swaps[i][k]);
        if (n == 1 && *p == '-' && !is_binary) add_site(c, p, n, "");
        return p + n;
    }
    if (*p == '!') add_site(c, p, 1, "");
    return p + 1;
}

/* Past comments, strings and lines of the preprocessor; p itself if none of these begins here. */
static const char *skip_text(const char *p, int at_line_start)
{
    const char *q;

    if (p[0] == '/' && p[1] == '*') return (q = strstr(p + 2, "*/")) != NULL ? q + 2 : p + strlen(p);
    if (*p == '"' || *p == '\'') {
        for (q = p + 1; *q && *q != *p; q++)
            if (*q == '\\') q++;
        return q + 1;
    }
    if (*p != '#' || !at_line_start) return p;
    for (q = p; *q && *q != '\n'; q++)
        if (q[0] == '\\' && q[1] == '\n') q++;
    return q;
}

static void scan_brace(scan *c, char brace)
{
    if (brace == '{') {
        if (c->depth++ == 0) c->in_function = c->function != NULL;
    } else if (brace == '}' && --c->depth == 0) {
        c->in_function = 0;
        c->function = NULL;
    } else if (brace == ';' && c->depth == 0) {
        c->function = NULL;
    }
}

static int scan_section(runner *r, int section)
{
    scan c = {NULL, NULL, NULL, 0, 0, 0, NULL, 0};
    const char *begin, *next;
    char tag[16];

    name(tag, sizeof tag, "PT-%02d", section);
    c.r = r;
    c.section = section;
    if (!section_range(r->header, tag, &begin, &c.end)) return 0;
    c.p = strstr(begin, "*/"); /* the banner */
    for (c.p = c.p ? c.p + 2 : begin; c.p < c.end; c.p = next) {
        next = skip_text(c.p, c.p[-1] == '\n');
        if (next != c.p) continue;
        if (isdigit((unsigned char)*c.p)) next = scan_number(&c, c.p);
        else if (isalpha((unsigned char)*c.p) || *c.p == '_') next = scan_word(&c, c.p);
        else next = scan_operator(&c, c.p);
        if (strchr("{};", *c.p)) scan_brace(&c, *c.p);
    }
    return 1;
}

static int site_order(const void *a, const void *b)
{
    const site *s = (const site *)a, *t = (const site *)b;

    if (s->section != t->section) return s->section < t->section ? -1 : 1;
    return s->key < t->key ? -1 : s->key > t->key;
}

static int find_sites(runner *r)
{
    int k, i;

    for (k = FIRST_SECTION; k <= LAST_SECTION; k++)
        if (!scan_section(r, k)) return 0;
    qsort(r->sites, (size_t)r->site_count, sizeof *r->sites, site_order);
    for (k = i = 0; k <= SECTIONS; k++) {
        while (i < r->site_count && r->sites[i].section < FIRST_SECTION + k) i++;
        r->first[k] = i;
    }
    return 1;
}

static void mutant_of_site(const runner *r, const site *s, mutant *m)
{
    char before[MAX_LINE], after[MAX_LINE];

    memset(m, 0, sizeof *m);
    site_lines(r->header, s, before, after, sizeof before);
    name(m->name, sizeof m->name, "g%02d_%08lx", s->section, (unsigned long)(s->key >> 32));
    name(m->section, sizeof m->section, "PT-%02d", s->section);
    name(m->what, sizeof m->what, "%.*s: %.180s  ->  %.180s", s->function_length, r->header + s->function_at, before, after);
    strcpy(m->replace, s->with);
    m->at = s->at;
    m->length = s->length;
}

/* Why this change is no error, NULL if the list does not say so. */
static const char *find_excuse(const runner *r, const site *s)
{
    char before[MAX_LINE], after[MAX_LINE];
    const mutant *e;
    int i;

    site_lines(r->header, s, before, after, sizeof before);
    for (i = 0; i < r->excuse_count; i++) {
        e = &r->excuses[i];
        if (strlen(e->name) == (size_t)s->function_length && strcmp(before, e->find) == 0 &&
            strcmp(after, e->replace) == 0 && memcmp(e->name, r->header + s->function_at, strlen(e->name)) == 0)
            return e->what;
    }
    return NULL;
}

/* ---- compiling and running --------------------------------------------------------------------------- */

static const char *env_or(const char *variable, const char *otherwise)
{
    const char *value = getenv(variable);

    return value && value[0] ? value : otherwise;
}

/* Compiles SOURCE of tests/ with the header of a directory; 1 if it compiled. Warnings do not count: a mutant may leave
   something unused. */
static int compile_source(const char *dir, const char *source, const char *flags, const char *out)
{
    return shell("%s -std=c99 -ffp-contract=off %s -w -I%s -I. -Itests %s tests/%s.c -o %s -lm -pthread > %s/cc.log 2>&1",
                 env_or("CC", "cc"), env_or("MUTANT_CFLAGS", "-O1"), dir, flags, source, out, dir);
}

/* Does a test program bring its own implementation, to look at private functions? */
static int is_alone(const char *program)
{
    char path[256], *text;
    int alone;

    name(path, sizeof path, "tests/%s.c", program);
    text = read_file(path);
    alone = !text || strstr(text, "PT_STATIC") || strstr(text, "PATHTRACER_IMPLEMENTATION") || strstr(text, ".c\"");
    free(text);
    return alone;
}

/* Builds a test program against the header of a directory; 1 if that went well. If only the implementation differs from the
   project's, what most programs share is compiled once, and the programs themselves once for all mutants, in `unchanged`. */
static int compile(const char *dir, const char *unchanged, const char *program, int shares)
{
    char out[256], object[256], implementation[256];

    name(out, sizeof out, "%s/%s", dir, program);
    if (!shares || is_alone(program)) return compile_source(dir, program, "", out);
    name(object, sizeof object, "%s/%s.o", unchanged, program);
    name(implementation, sizeof implementation, "%s/implementation.o", dir);
    if (access(object, R_OK) != 0 && !compile_source(unchanged, program, "-c -DPT_TEST_LINKED", object)) return 0;
    if (access(implementation, R_OK) != 0 && !compile_source(dir, "implementation", "-c", implementation)) return 0;
    return shell("%s %s %s -o %s -lm -pthread > %s/cc.log 2>&1", env_or("CC", "cc"), implementation, object, out, dir);
}

/* Makes an empty directory in which a test finds what it expects in the project's top directory. */
static int make_directory(const char *dir)
{
    return shell("rm -rf %s && mkdir -p %s/build/test %s/tests && ln -s ../../../../tests/data %s/tests/data", dir, dir, dir, dir);
}

/* CPU seconds of all processes waited for. */
static double child_seconds(void)
{
    struct rusage u;

    if (getrusage(RUSAGE_CHILDREN, &u) != 0) return 0;
    return (double)(u.ru_utime.tv_sec + u.ru_stime.tv_sec) + 1e-6 * (double)(u.ru_utime.tv_usec + u.ru_stime.tv_usec);
}

/* The child's side of run(): limits, which a program keeps that takes its place; then the test. */
static void become_test(const char *dir, const char *command, int is_short, double limit, int output)
{
    const struct rlimit memory = {(rlim_t)2 << 30, (rlim_t)2 << 30};
    struct rlimit cpu;

    if (dup2(output, 1) < 0 || dup2(output, 2) < 0 || chdir(dir) != 0) _exit(126);
    cpu.rlim_cur = (rlim_t)limit + 1;
    cpu.rlim_max = cpu.rlim_cur + 5;
    setrlimit(RLIMIT_CPU, &cpu);
    setrlimit(RLIMIT_AS, &memory);
    unsetenv("SEED");
    unsetenv("LONG");
    if (is_short) setenv("SHORT", "1", 1);
    else unsetenv("SHORT");
    alarm(10 * ((unsigned)limit + 1)); /* one that waits and does nothing */
    execl("/bin/sh", "sh", "-c", command, (char *)NULL);
    _exit(126);
}

/* Takes the output of a run up to the first failed check; 1 if there was one. */
static int read_output(FILE *f, const char *log_path, outcome *o)
{
    FILE *log = fopen(log_path, "w");
    char line[512], *comma;
    int failed = 0;
    size_t n;

    while (!failed && fgets(line, sizeof line, f)) {
        if (log) fputs(line, log);
        if (strncmp(line, "FAIL ", 5) == 0) {
            n = strcspn(line + 7, "\n");
            for (n = n > 48 ? 48 : n; n > 0 && line[6 + n] == ' '; n--) {}
            name(o->text, sizeof o->text, "%.*s", (int)n, line + 7);
            failed = 1;
        }
        comma = strstr(line, " passed, ");
        for (n = comma ? (size_t)(comma - line) : 0; n > 0 && isdigit((unsigned char)line[n - 1]); n--) {}
        if (comma) o->passed = atoi(line + n);
    }
    if (log) fclose(log);
    return failed;
}

/* Runs a compiled test with limits, so that a mutant that runs away ends too; its output goes to run.log. */
static void run(const char *dir, const char *test, int is_short, double limit, outcome *o)
{
    char path[256], command[MAX_LINE + 16];
    double start = child_seconds();
    int ends[2], status = 0, failed = 0;
    FILE *f;
    pid_t child;

    memset(o, 0, sizeof *o);
    name(o->text, sizeof o->text, "could not be started");
    name(path, sizeof path, "%s/run.log", dir);
    name(command, sizeof command, "exec ./%s", test);
    if (pipe(ends) != 0) return;
    child = fork();
    if (child == 0) {
        close(ends[0]);
        become_test(dir, command, is_short, limit, ends[1]);
    }
    close(ends[1]);
    f = fdopen(ends[0], "r");
    if (child > 0 && f) {
        o->text[0] = '\0';
        failed = read_output(f, path, o);
        if (failed) kill(child, SIGKILL);
    }
    if (f) fclose(f);
    if (child > 0) waitpid(child, &status, 0);
    o->seconds = child_seconds() - start;
    if (failed || child <= 0) return;
    if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGALRM || WTERMSIG(status) == SIGXCPU)) name(o->text, sizeof o->text, "time");
    else if (WIFSIGNALED(status)) name(o->text, sizeof o->text, "crash (signal %d)", WTERMSIG(status));
    else if (WEXITSTATUS(status) != 0) name(o->text, sizeof o->text, "exit status %d", WEXITSTATUS(status));
}

/* Index of the test program that begins a test "program filter filter ...", -1 if there is none. */
static int find_program(const runner *r, const char *test)
{
    size_t n = strcspn(test, " ");
    int i;

    for (i = 0; i < r->test_count; i++)
        if (strlen(r->tests[i]) == n && strncmp(r->tests[i], test, n) == 0) return i;
    return -1;
}

/* A test that fails on the header as it is says nothing about a mutant: what is wrong with it, NULL if
   nothing is. *s: how long it takes there, and how many checks it has. */
static const char *what_is_unsound(runner *r, const char *test, int is_short, soundness **s)
{
    char dir[64], path[256];
    const char *program;
    outcome o;
    int i, k = find_program(r, test);

    for (i = 0; i < r->sound_count; i++)
        if (strcmp(r->sound[i].test, test) == 0 && r->sound[i].is_short == is_short) {
            *s = &r->sound[i];
            return NULL;
        }
    if (k < 0) return "is no test program";
    program = r->tests[k];
    name(dir, sizeof dir, DIR "/unchanged%d", r->share); /* has no header in it: the project's is found */
    name(path, sizeof path, "%s/%s", dir, program);
    if (access(path, X_OK) != 0 && !compile(dir, dir, program, 1)) return "does not compile with the header as it is";
    run(dir, test, is_short, 3600, &o);
    if (o.text[0]) return "fails on the header as it is";
    if (r->sound_count == MAX_SOUND) return "is one test too many";
    *s = &r->sound[r->sound_count++];
    strcpy((*s)->test, test);
    (*s)->is_short = is_short;
    (*s)->passed = o.passed;
    (*s)->seconds = o.seconds;
    return NULL;
}

/* ---- one mutant -------------------------------------------------------------------------------------- */

/* Compiles program k against the mutant, once; compares it with the unchanged one. */
static verdict build(runner *r, const mutant *m, int k)
{
    char dir[128], unchanged[64];
    const char *begin, *end;

    if (r->built[k] != INVALID) return r->built[k];
    name(dir, sizeof dir, DIR "/%s", m->name);
    name(unchanged, sizeof unchanged, DIR "/unchanged%d", r->share);
    if (!compile(dir, unchanged, r->tests[k], section_range(r->header, "PT-00", &begin, &end) && r->header + m->at > begin)) return r->built[k] = NO_COMPILE;
    r->built[k] = shell("cmp -s %s/%s " DIR "/unchanged%d/%s", dir, r->tests[k], r->share, r->tests[k]) ? SAME_CODE : CAUGHT;
    return r->built[k];
}

/* Runs one test ("program filter ...") on a mutant. `text`: the check that caught it, or what is wrong. */
static verdict try_test(runner *r, const mutant *m, const char *test, int is_short, char *text, size_t size)
{
    char dir[128];
    soundness *s = NULL;
    const char *unsound = what_is_unsound(r, test, is_short, &s);
    verdict v;
    outcome o;

    if (!unsound && s->passed == 0 && !is_short) unsound = "checks nothing";
    name(text, size, "%s %s", test, unsound ? unsound : "does not compile against it");
    if (unsound) return INVALID;
    if (s->passed == 0) return NOT_CAUGHT;
    v = build(r, m, find_program(r, test));
    if (v != CAUGHT) return v;
    name(dir, sizeof dir, DIR "/%s", m->name);
    run(dir, test, is_short, 4 * s->seconds + 4, &o);
    if (!o.text[0]) return NOT_CAUGHT;
    name(text, size, "%.*s: %s", (int)strcspn(test, " "), test, o.text);
    return CAUGHT;
}

/* The programs in the order in which a mutant of a section is tried: what is likely, then what is quick. Returns how
   many are likely. */
static int programs_in_order(const runner *r, const char *section, int order[MAX_TESTS], int *count)
{
    static const char *const likely[][2] = {
        {"PT-03", "test_numbers test_estimators"}, {"PT-04", "test_sampling test_radiometry"},
        {"PT-05", "test_numbers test_radiometry"}, {"PT-06", "test_geometry test_sampling"},
        {"PT-07", "test_geometry"},                {"PT-08", "test_materials test_sampling test_input"},
        {"PT-09", "test_lights test_sampling test_input"}, {"PT-10", "test_input test_sampling test_geometry test_lights test_materials"},
        {"PT-11", "test_methods test_driver test_transport"}, {"", "test_input test_geometry test_numbers test_sampling test_estimators"}
    };
    const char *p;
    unsigned taken = 0;
    int n = 0, first = 0, i, k;

    for (i = 0; i < (int)(sizeof likely / sizeof likely[0]); i++)
        for (p = likely[i][1]; p && (!likely[i][0][0] || strcmp(section, likely[i][0]) == 0); p = strchr(p, ' ')) {
            p += *p == ' ';
            k = find_program(r, p);
            if (k < 0) continue;
            if (!(taken >> k & 1u)) order[n++] = k;
            taken |= 1u << k;
            if (likely[i][0][0]) first = n;
        }
    for (k = 0; k < r->test_count; k++)
        if (!(taken >> k & 1u)) order[n++] = k;
    *count = n;
    return first;
}

/* Tries the programs order[0..n), all with SHORT=1 before any in full; *same: how many the compiler makes the same of. */
static verdict try_programs(runner *r, const mutant *m, const int *order, int n, int *same, char *text, size_t size)
{
    verdict v = NOT_CAUGHT;
    int is_short, i;

    *same = 0;
    for (is_short = 1; is_short >= 0 && (v == NOT_CAUGHT || v == SAME_CODE) && *same < n; is_short--)
        for (i = *same = 0; i < n && (v == NOT_CAUGHT || v == SAME_CODE); i++) {
            v = try_test(r, m, r->tests[order[i]], is_short, text, size);
            *same += v == SAME_CODE;
        }
    return v == SAME_CODE ? NOT_CAUGHT : v;
}

/* The named test first, then the likely programs, then the others. */
static verdict hunt(runner *r, const mutant *m, char *text, size_t size)
{
    int order[MAX_TESTS], is_short, i, n, first = programs_in_order(r, m->section, order, &n), same = 0, more = 0;
    verdict v = NOT_CAUGHT;

    for (i = 0; i < r->test_count; i++) r->built[i] = INVALID;
    for (is_short = 1; is_short >= 0 && v == NOT_CAUGHT && m->test[0]; is_short--)
        v = try_test(r, m, m->test, is_short, text, size);
    if (v == SAME_CODE) v = NOT_CAUGHT;
    if (v == NOT_CAUGHT) v = try_programs(r, m, order, first, &same, text, size);
    if (v == NOT_CAUGHT) v = try_programs(r, m, order + first, n - first, &more, text, size);
    if (v == NOT_CAUGHT && same + more == n) v = SAME_CODE;
    if (v == NOT_CAUGHT) name(text, size, "SURVIVED");
    if (v == SAME_CODE) name(text, size, "equivalent: same machine code");
    return v;
}

static void report(const char *word, const mutant *m, const char *text, double seconds)
{
    printf("%s %-26s %-6s%6.1f s  %-58s %s\n", word, m->name, m->section, seconds, text, m->what);
}

/* One mutant; `excuse`: why it is none. 0 if it does not compile and was not planted: another takes its place. */
static int take_mutant(runner *r, mutant *m, const char *excuse)
{
    char text[MAX_LINE + 64], dir[128], path[160];
    const char *why = m->find[0] ? find_place(r->header, m) : NULL;
    double start = seconds_now();
    verdict v = INVALID;
    int ok;

    name(dir, sizeof dir, DIR "/%s", m->name);
    name(path, sizeof path, "%s/pathtracer.h", dir);
    if (!why && !make_directory(dir)) why = "its directory could not be made";
    if (!why && !write_file(path, r->header, m->at, m->replace, r->header + m->at + m->length))
        why = "the changed header could not be written";
    if (why) name(text, sizeof text, "%s", why);
    else v = hunt(r, m, text, sizeof text);
    if (v != NOT_CAUGHT && !why && !shell("rm -rf %s", dir)) printf("       %s could not be removed\n", dir);
    if (v == NO_COMPILE && !m->find[0]) return 0;
    ok = v == CAUGHT || (v == SAME_CODE && !m->find[0]);
    if (excuse && v == CAUGHT) {
        name(path, sizeof path, "excused, yet caught by %s", text);
        strcpy(text, path);
    }
    if (excuse) ok = v != CAUGHT && v != INVALID;
    if (ok && v == SAME_CODE) r->same++;
    else *(ok ? &r->passed : &r->failed) += 1;
    report(!ok ? "FAIL  " : v == SAME_CODE ? "same  " : "ok    ", m, excuse && ok ? excuse : text, seconds_now() - start);
    return 1;
}

/* ---- the command line -------------------------------------------------------------------------------- */

static int parse(runner *r, int argc, char **argv)
{
    int i;

    r->shares = 1;
    for (i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--only") == 0 && i + 1 < argc) r->only = argv[++i];
        else if (strcmp(argv[i], "--generate") == 0 && i + 1 < argc) r->generate = atoi(argv[++i]);
        else if (strcmp(argv[i], "--generated") == 0) r->skip_planted = 1;
        else if (strcmp(argv[i], "--all") == 0) r->all = 1;
        else if (strcmp(argv[i], "--list") == 0) r->list = 1;
        else if (strcmp(argv[i], "--share") == 0 && i + 1 < argc) {
            if (sscanf(argv[++i], "%d/%d", &r->share, &r->shares) != 2) return 0;
            if (r->share < 1 || r->share > r->shares) return 0;
            r->share--;
        } else if (argv[i][0] != '-' && r->test_count < MAX_TESTS) r->tests[r->test_count++] = argv[i];
        else return 0;
    }
    if (r->only) r->share = r->shares; /* a directory of its own */
    return r->test_count > 0;
}

static int take_site(runner *r, const site *s)
{
    mutant m;
    const char *excuse = find_excuse(r, s);

    mutant_of_site(r, s, &m);
    if (r->list || (excuse && !r->all && !r->only)) {
        report(excuse ? "excuse" : "list  ", &m, excuse ? excuse : "", 0);
        r->excused += excuse != NULL;
        return 1;
    }
    return take_mutant(r, &m, excuse);
}

/* The draw: place i is the (i / SECTIONS)-th of its section. What does not compile is replaced by one from
   behind the draw. */
static void take_generated(runner *r)
{
    const int ranks = (r->generate + SECTIONS - 1) / SECTIONS;
    int reserve[SECTIONS], i, k, rank;

    for (k = 0; k < SECTIONS; k++) reserve[k] = ranks + r->share;
    for (i = r->share; i < r->generate; i += r->shares) {
        k = i % SECTIONS;
        for (rank = i / SECTIONS; r->first[k] + rank < r->first[k + 1]; rank = reserve[k], reserve[k] += r->shares)
            if (take_site(r, &r->sites[r->first[k] + rank])) break;
    }
}

static int run_all(runner *r, mutant *list, int count)
{
    char dir[64];
    mutant m;
    int i;

    name(dir, sizeof dir, DIR "/unchanged%d", r->share);
    if (!r->list && !make_directory(dir)) return 0;
    for (i = 0; i < count && !r->skip_planted; i++) {
        if (r->only ? strcmp(r->only, list[i].name) != 0 : i % r->shares != r->share) continue;
        if (r->list) report("list  ", &list[i], list[i].test, 0);
        else take_mutant(r, &list[i], NULL);
    }
    for (i = 0; i < r->site_count && r->only; i++) {
        mutant_of_site(r, &r->sites[i], &m);
        if (strcmp(r->only, m.name) == 0) take_site(r, &r->sites[i]);
    }
    if (!r->only) take_generated(r);
    return 1;
}

int main(int argc, char **argv)
{
    static mutant list[MAX_MUTANTS], excuses[MAX_MUTANTS];
    static runner r;
    int count, ok;

    if (!parse(&r, argc, argv)) {
        fprintf(stderr, "usage: mutants [--generate N] [--generated] [--all] [--only NAME] [--share k/n] [--list] TEST...\n");
        return 2;
    }
    setvbuf(stdout, NULL, _IOLBF, BUFSIZ);
    count = read_list("tests/mutants.txt", "mutant ", list);
    r.excuses = excuses;
    r.excuse_count = read_list("tests/mutants_equivalent.txt", "equivalent ", excuses);
    r.header = read_file("pathtracer.h");
    ok = count >= 0 && r.excuse_count >= 0 && r.header && find_sites(&r);
    if (!ok) fprintf(stderr, "mutants: the header or a list cannot be used\n");
    ok = ok && run_all(&r, list, count);
    free(r.header);
    free(r.sites);
    if (r.excused + r.same > 0) printf("mutants: %d excused, %d with the same machine code\n", r.excused, r.same);
    printf("mutants: %d passed, %d failed\n", r.passed, r.failed);
    return ok && r.failed == 0 && (r.passed > 0 || r.list) ? 0 : 1;
}
