/* mutants.c: tests the tests. Each entry of tests/mutants.txt is a bug: a change of one place of the header.
   The program makes a copy of the header with that one change, compiles the tests against it and runs them;
   one of them must fail. A bug that survives is a check that is missing.

       cc -O2 tests/mutants.c -o mutants && CC=cc ./mutants test_numbers test_transport ...

   in the project's top directory; the arguments are the test programs. --only NAME takes one mutant, --share
   k/n every n-th from the k-th on. Prints for each mutant the check that caught it, and at the end 'mutants:
   N passed, N failed': a mutant that survives, does not compile, or whose text is not found has failed.

   An entry of mutants.txt:

       mutant name: what is wrong
       section PT-04                       only there, in the implementation (default: the whole header)
       test test_sampling cosine           the program, and names of tests in it, that should catch it
       < text that occurs exactly once
       > what stands there instead

   Several lines of < (and of >) are one text with line ends between them. The named test runs first, and on
   the header as it is too, where it must pass; if it does not catch the mutant all programs run in full. */

#include <ctype.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define DIR "build/mutants"

enum { MAX_TEXT = 4096, MAX_LINE = 512, MAX_NAME = 64, MAX_TESTS = 32, MAX_MUTANTS = 256 };

typedef struct mutant {
    char name[MAX_NAME], what[MAX_LINE], section[16], test[MAX_LINE];
    char find[MAX_TEXT], replace[MAX_TEXT];
} mutant;

typedef struct runner {
    char *header;
    const char *only;               /* NULL = all                                                          */
    int share, shares;
    const char *tests[MAX_TESTS];   /* names of the test programs                                          */
    int test_count;
    char sound[MAX_MUTANTS][MAX_LINE]; /* what has passed on the header as it is                           */
    int sound_count;
    int passed, failed;
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

/* ---- the list of mutants ---------------------------------------------------------------------------- */

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

/* One line of mutants.txt into the newest mutant; 1 if it is understood. */
static int take_line(mutant *list, int *count, const char *line)
{
    mutant *m = *count > 0 ? &list[*count - 1] : NULL;

    if (line[0] == '#' || line[strspn(line, " \t\r\n")] == '\0') return 1;
    if (strncmp(line, "mutant ", 7) == 0)
        return *count < MAX_MUTANTS && take_name(&list[(*count)++], line + 7);
    if (!m) return 0;
    if (strncmp(line, "section ", 8) == 0) return copy_trimmed(m->section, sizeof m->section, line + 8);
    if (strncmp(line, "test ", 5) == 0) return copy_trimmed(m->test, sizeof m->test, line + 5);
    if (line[0] == '<') return append_line(m->find, line + (line[1] == ' ' ? 2 : 1));
    if (line[0] == '>') return append_line(m->replace, line + (line[1] == ' ' ? 2 : 1));
    return 0;
}

/* How many mutants there are, -1 if the file cannot be read or understood. */
static int read_mutants(const char *path, mutant *list)
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
        ok = strchr(line, '\n') != NULL && take_line(list, &count, line);
    }
    fclose(f);
    if (!ok) fprintf(stderr, "mutants: %s:%d is not understood\n", path, number);
    return ok ? count : -1;
}

/* ---- the changed header ------------------------------------------------------------------------------ */

/* The range of the header in which a mutant's text is to be found; 0 if there is no such section. */
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

/* The one place of the text in the range; NULL, and why, if there is none or more than one. */
static const char *find_once(const char *text, const char *begin, const char *end, const char **why)
{
    const char *first = strstr(begin, text), *second;

    *why = "its text is not in the header";
    if (!text[0] || !first || first + strlen(text) > end) return NULL;
    second = strstr(first + 1, text);
    *why = "its text occurs more than once";
    return second && second + strlen(text) <= end ? NULL : first;
}

/* Writes the changed header; NULL, or why it could not be. */
static const char *write_mutant(const runner *r, const mutant *m)
{
    char path[256];
    const char *begin, *end, *place, *why;

    if (!section_range(r->header, m->section, &begin, &end)) return "its section is not in the header";
    place = find_once(m->find, begin, end, &why);
    if (!place) return why;
    if (strcmp(m->find, m->replace) == 0) return "it changes nothing";
    name(path, sizeof path, DIR "/%s/pathtracer.h", m->name);
    if (!write_file(path, r->header, (size_t)(place - r->header), m->replace, place + strlen(m->find)))
        return "the changed header could not be written";
    return NULL;
}

/* ---- compiling and running --------------------------------------------------------------------------- */

static const char *env_or(const char *name, const char *otherwise)
{
    const char *value = getenv(name);

    return value && value[0] ? value : otherwise;
}

/* Compiles a test program against the header of a directory; 1 if it compiled. Warnings do not count: a
   mutant may leave something unused. */
static int compile(const char *dir, const char *program)
{
    return shell("%s -std=c99 -ffp-contract=off %s -w -I%s -I. -Itests tests/%s.c -o %s/%s -lm -pthread "
                 "> %s/cc.log 2>&1",
                 env_or("CC", "cc"), env_or("MUTANT_CFLAGS", "-O1"), dir, program, dir, program, dir);
}

/* Makes an empty directory in which a test finds what it expects in the project's top directory. */
static int make_directory(const char *dir)
{
    return shell("rm -rf %s && mkdir -p %s/build/test && ln -s ../../../tests %s/tests", dir, dir, dir);
}

/* Runs a compiled test with limits of time and memory, so that a mutant that runs away ends too. Its
   output goes to run.log; returns its exit status, -1 if that could not be found out. */
static int run(const char *dir, const char *program, const char *filter)
{
    char path[256], *log;
    const char *found;
    int status = -1;

    if (!shell("cd %s && (ulimit -t 300; ulimit -v 6000000; t=; command -v timeout > /dev/null && "
               "t='timeout 300'; $t ./%s %s) > run.log 2>&1; echo \"exit status $?\" >> run.log",
               dir, program, filter))
        return -1;
    name(path, sizeof path, "%s/run.log", dir);
    log = read_file(path);
    if (!log) return -1;
    for (found = strstr(log, "exit status "); found; found = strstr(found + 1, "exit status "))
        status = atoi(found + strlen("exit status "));
    free(log);
    return status;
}

/* The first failed check of the last run, or how the program ended. */
static void describe_failure(const char *dir, const char *program, int status, char *out, size_t size)
{
    char path[256], *log, *line;
    size_t n;

    name(path, sizeof path, "%s/run.log", dir);
    log = read_file(path);
    line = log ? strstr(log, "\nFAIL") : NULL;
    if (line) {
        line += strspn(line, "\nFAIL ");
        n = strcspn(line, "\n");
        if (n > 48) n = 48;
        while (n > 0 && line[n - 1] == ' ') n--;
        name(out, size, "%s: %.*s", program, (int)n, line);
    } else {
        name(out, size, "%s: ended with status %d", program, status);
    }
    free(log);
}

/* Splits "program filter filter" at the first blank. */
static const char *split_test(const char *test, char *program)
{
    size_t n = strcspn(test, " ");

    if (n >= MAX_NAME) n = MAX_NAME - 1;
    memcpy(program, test, n);
    program[n] = '\0';
    return test + n;
}

/* A test that fails on the header as it is, or checks nothing, says nothing about a mutant: what is wrong
   with it, NULL if nothing is. */
static const char *what_is_unsound(runner *r, const char *test)
{
    char program[MAX_NAME], dir[64], path[256], *log;
    const char *filter = split_test(test, program);
    FILE *made;
    int i, empty;

    for (i = 0; i < r->sound_count; i++)
        if (strcmp(r->sound[i], test) == 0) return NULL;
    name(dir, sizeof dir, DIR "/unchanged%d", r->share); /* has no header in it: the project's is found */
    name(path, sizeof path, "%s/%s", dir, program);
    made = fopen(path, "rb");
    if (made) fclose(made);
    if (!made && !compile(dir, program)) return "does not compile with the header as it is";
    if (run(dir, program, filter) != 0) return "fails on the header as it is";
    name(path, sizeof path, "%s/run.log", dir);
    log = read_file(path);
    empty = !log || strstr(log, ": 0 passed") != NULL;
    free(log);
    if (empty) return "checks nothing";
    if (r->sound_count < MAX_MUTANTS) strcpy(r->sound[r->sound_count++], test);
    return NULL;
}

/* ---- one mutant -------------------------------------------------------------------------------------- */

typedef enum verdict { CAUGHT, NOT_CAUGHT, INVALID } verdict;

/* Runs one test ("program filter ...") on a mutant. `text`: the check that caught it, or what is wrong.
   */
static verdict try_test(runner *r, const mutant *m, const char *test, char *text, size_t size)
{
    char dir[128], program[MAX_NAME];
    const char *filter = split_test(test, program), *unsound = what_is_unsound(r, test);
    int status;

    name(dir, sizeof dir, DIR "/%s", m->name);
    if (unsound) {
        name(text, size, "%s %s", test, unsound);
        return INVALID;
    }
    if (!compile(dir, program)) {
        name(text, size, "%s does not compile against it", program);
        return INVALID;
    }
    status = run(dir, program, filter);
    if (status == 0) return NOT_CAUGHT;
    describe_failure(dir, program, status, text, size);
    return CAUGHT;
}

/* The named test first, then all programs in full. */
static verdict hunt(runner *r, const mutant *m, char *text, size_t size)
{
    verdict v = try_test(r, m, m->test, text, size);
    int i;

    for (i = 0; i < r->test_count && v == NOT_CAUGHT; i++) v = try_test(r, m, r->tests[i], text, size);
    if (v == NOT_CAUGHT) name(text, size, "SURVIVED: %.200s", m->what);
    return v;
}

static void take_mutant(runner *r, const mutant *m)
{
    char text[512], dir[128];
    const char *why;
    verdict v = INVALID;

    name(dir, sizeof dir, DIR "/%s", m->name);
    if (!make_directory(dir)) why = "its directory could not be made";
    else why = write_mutant(r, m);
    if (why) name(text, sizeof text, "%s", why);
    else v = hunt(r, m, text, sizeof text);
    *(v == CAUGHT ? &r->passed : &r->failed) += 1;
    printf("%s %-28s %s\n", v == CAUGHT ? "ok    " : "FAIL  ", m->name, text);
    if (v == CAUGHT && !shell("rm -rf %s", dir)) printf("       %s could not be removed\n", dir);
}

/* ---- the command line -------------------------------------------------------------------------------- */

static int parse(runner *r, int argc, char **argv)
{
    int i;

    r->shares = 1;
    for (i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--only") == 0 && i + 1 < argc) r->only = argv[++i];
        else if (strcmp(argv[i], "--share") == 0 && i + 1 < argc) {
            if (sscanf(argv[++i], "%d/%d", &r->share, &r->shares) != 2) return 0;
            if (r->share < 1 || r->share > r->shares) return 0;
            r->share--;
        } else if (argv[i][0] != '-' && r->test_count < MAX_TESTS) r->tests[r->test_count++] = argv[i];
        else return 0;
    }
    return r->test_count > 0;
}

static int run_all(runner *r, const mutant *list, int count)
{
    char dir[64];
    int i, mine;

    name(dir, sizeof dir, DIR "/unchanged%d", r->share);
    if (!make_directory(dir)) return 0;
    for (i = 0; i < count; i++) {
        mine = r->only ? strcmp(r->only, list[i].name) == 0 : i % r->shares == r->share;
        if (mine) take_mutant(r, &list[i]);
    }
    return 1;
}

int main(int argc, char **argv)
{
    static mutant list[MAX_MUTANTS];
    static runner r;
    int count, ok;

    if (!parse(&r, argc, argv)) {
        fprintf(stderr, "usage: mutants [--only NAME] [--share k/n] TEST...\n");
        return 2;
    }
    setvbuf(stdout, NULL, _IOLBF, BUFSIZ);
    count = read_mutants("tests/mutants.txt", list);
    r.header = read_file("pathtracer.h");
    if (!r.header) fprintf(stderr, "mutants: cannot read pathtracer.h\n");
    ok = count >= 0 && r.header && run_all(&r, list, count);
    free(r.header);
    printf("mutants: %d passed, %d failed\n", r.passed, r.failed);
    return ok && r.failed == 0 && r.passed > 0 ? 0 : 1;
}
