/* pt_test.h: the harness of the tests. A test is a function; one program runs many:

       #include "pt_test.h"
       static void tails(void) { pt_check_near("normal tail", pt_normal_sf(0), 0.5, 1e-15, ""); }
       int main(int argc, char **argv)
       {   pt_test_begin("test_numbers", argc, argv); PT_TEST(tails); return pt_test_end();   }

   A test with statistical checks begins with pt_test_source("..."): where its exact values come from.
   `make test-table` makes a table of all lines that begin with ok and of these sources.

   Arguments choose tests: those whose name contains one of them. Environment:
       SHORT=1    a sixteenth of the samples; power bounds are not enforced, and checks that then have too
                  few samples are skipped (for sanitizers and exercises)
       SEED=n     other random numbers, for the statistical checks alone: deterministic ones count nothing. A
                  quarter of the samples, for many seeds to be tried; power bounds are not enforced, as the
                  power was shown with all samples. That skewness allows a verdict is still asked: checks that
                  would not have it with a quarter ask for pt_test_all_samples().
       LONG=1     pt_test_long() is 1: more samples where a test knows how to use them
       VERBOSE=1  deterministic checks that pass print a line too; k, see below, is shown

   Two kinds of checks. A deterministic one compares with a tolerance. A statistical one asks whether data
   could come from a correct program: all of a suite together may fail by luck once in a million runs, which
   gives each of PT_TEST_CHECKS checks the level 1 - (1 - 1e-6)^(1/PT_TEST_CHECKS) (Sidak), about 6.3 standard
   errors. It prints the smallest bias that it would have found with probability 90 %, and fails if that is
   above `bound`: a check that cannot see an error is no check.

   So far out the mean of skewed values is not normal. With k = |skewness| z^3 / (6 sqrt n), the relative
   error of the normal tail there, a z-test serves below 0.3, Hall's transformed t (P. Hall, On the Removal of
   Skewness by Transformation, J. Royal Stat. Soc. B 54, 1992) up to 1; above, the check is invalid and
   fails.

   If all is right the p-values are uniform. Those of a program, where they are continuous and share no
   samples, are compared with that at the end: a check of the checks. Whether samples are shared is seen by
   their seeds: a p-value counts if most of the seeds asked for since the check before are new to its test. */

#ifndef PT_TEST_H
#define PT_TEST_H

#if !defined(PT_TEST_LINKED) && !defined(PATHTRACER_IMPLEMENTATION)
#define PATHTRACER_IMPLEMENTATION /* the Makefile compiles the implementation once, for all programs */
#endif
#include "pathtracer.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

#if defined(__GNUC__)
#define PT_TEST_FORMAT __attribute__((format(printf, 3, 4)))
#else
#define PT_TEST_FORMAT
#endif
#define PT_TEST_CHECKS 4096
#define PT_TEST_REPLICATIONS 1024 /* pt_check_equal_means takes up to this many values as PT_TEST_MEANS */
#define PT_TEST_VALUES 0          /* independent values: normal tail, skewness watched                  */
#define PT_TEST_MEANS 1           /* means of independent randomisations, at least 32: Student's t      */
#define PT_TEST_SEEDS 1048576     /* marks for the seeds of a test; a power of two                      */

static struct {
    const char *program;
    int argc, passed, failed, skipped, statistical, is_short, is_long, is_verbose, is_seeded;
    char **argv;
    uint64_t seed;
    double clock; /* CPU seconds at the last check */
    struct {      /* the test that runs, and what stood when it began */
        const char *name;
        int checks, statistical;
        double clock;
    } test;
    unsigned char used[PT_TEST_SEEDS]; /* seeds of this test */
    uint32_t seeds, new_seeds;         /* asked for since the last check */
    double p[PT_TEST_CHECKS];          /* continuous p-values that share no samples */
    int p_count;
} pt_test;

static inline const char *pt_test_option(const char *name) { return getenv(name) ? getenv(name) : ""; }
static inline void pt_test_begin(const char *program, int argc, char **argv)
{
    pt_test.program = program;
    pt_test.argc = argc;
    pt_test.argv = argv;
    pt_test.is_short = atoi(pt_test_option("SHORT")) != 0;
    pt_test.is_long = atoi(pt_test_option("LONG")) != 0;
    pt_test.is_verbose = atoi(pt_test_option("VERBOSE")) != 0;
    pt_test.is_seeded = pt_test_option("SEED")[0] != '\0';
    pt_test.seed = (uint64_t)strtoull(pt_test_option("SEED"), NULL, 10);
    pt_test.clock = pt_cpu_seconds();
    setvbuf(stdout, NULL, _IOLBF, BUFSIZ);
    if (pt_test.is_short) printf("%s: SHORT=1, power bounds are not enforced\n", program);
    if (pt_test.is_seeded)
        printf("%s: SEED is set, statistical checks alone, a quarter of the samples\n", program);
}

/* Counts one check; returns the word its line begins with. */
static inline const char *pt_test_count(int ok)
{
    *(ok ? &pt_test.passed : &pt_test.failed) += 1;
    return ok ? "ok    " : "FAIL  ";
}

/* Tells what the test that ran has checked. */
static inline void pt_test_close(void)
{
    const int checks = pt_test.passed + pt_test.failed - pt_test.test.checks;
    const int statistical = pt_test.statistical - pt_test.test.statistical;
    if (pt_test.test.name)
        printf("done   %s: %d deterministic, %d statistical, %.2f s\n", pt_test.test.name,
               checks > statistical ? checks - statistical : 0, statistical,
               pt_cpu_seconds() - pt_test.test.clock);
    pt_test.test.name = NULL;
}

static inline int pt_test_wanted(const char *function)
{
    int i, wanted = pt_test.argc < 2;
    for (i = 1; i < pt_test.argc; i++) wanted |= strstr(function, pt_test.argv[i]) != NULL;
    pt_test_close();
    if (!wanted) return 0;
    printf("%s\n", function);
    pt_test.test.name = function;
    pt_test.test.checks = pt_test.passed + pt_test.failed;
    pt_test.test.statistical = pt_test.statistical;
    pt_test.test.clock = pt_test.clock = pt_cpu_seconds();
    pt_test.seeds = pt_test.new_seeds = 0;
    memset(pt_test.used, 0, sizeof pt_test.used);
    return 1;
}

/* Where the exact values of the statistical checks come from, until the next call or test. */
static inline void pt_test_source(const char *source) { printf("source %s\n", source); }

#define PT_TEST(function) (pt_test_wanted(#function) ? function() : (void)0)
/* The same for a test without statistical checks: left out when SEED is set. */
#define PT_TEST_EXACT(function) (pt_test.is_seeded ? (void)0 : PT_TEST(function))

/* The k-th seed of the tests; two estimates that are compared use different k. */
static inline uint64_t pt_test_seed(uint64_t k)
{
    unsigned char *const used = &pt_test.used[pt_hash64(k) & (PT_TEST_SEEDS - 1)];
    pt_test.seeds++;
    pt_test.new_seeds += !*used;
    *used = 1;
    return k + pt_test.seed * UINT64_C(1000003);
}
static inline int pt_test_long(void) { return pt_test.is_long; }
static inline uint32_t pt_test_share(uint32_t n, uint32_t parts)
{
    const uint32_t fewer = n / parts > 32 ? n / parts : 32;
    return fewer < n ? fewer : n;
}
static inline uint32_t pt_test_samples(uint32_t n)
{
    return pt_test_share(n, pt_test.is_short ? 16 : pt_test.is_seeded ? 4 : 1);
}
/* For values so skewed that a quarter of them gives no verdict. */
static inline uint32_t pt_test_all_samples(uint32_t n) { return pt_test_share(n, pt_test.is_short ? 16 : 1); }

/* DETERMINISTIC CHECKS. The message tells a student what to look at when the check fails. */
PT_TEST_FORMAT static inline void pt_check(int ok, const char *name, const char *format, ...)
{
    va_list arguments;
    if (pt_test.is_seeded) return;
    (void)pt_test_count(ok);
    if (ok && pt_test.is_verbose) printf("ok     %s\n", name);
    if (ok) return;
    printf("FAIL   %s\n       ", name);
    va_start(arguments, format);
    vprintf(format, arguments);
    va_end(arguments);
    printf("\n");
}
static inline void pt_check_near(const char *name, double got, double exact, double tolerance,
                                 const char *hint)
{
    pt_check(fabs(got - exact) <= tolerance, name, "got %.17g, exact %.17g, off by %.3g, tolerance %.3g. %s",
             got, exact, got - exact, tolerance, hint);
}

/* STATISTICAL CHECKS. Their level; the x with P(X > x) = level / 2 for the normal (df 0) or Student's t. */
static inline double pt_test_level(void) { return -expm1(log1p(-1e-6) / PT_TEST_CHECKS); }
static inline double pt_test_quantile(double df)
{
    double low = 0, high = 1e6;
    int i;
    if (!(df > 0)) return pt_normal_isf(0.5 * pt_test_level());
    for (i = 0; i < 100; i++) {
        const double middle = 0.5 * (low + high);
        *(pt_student_sf(middle, df) > 0.5 * pt_test_level() ? &low : &high) = middle;
    }
    return high;
}
static inline double pt_test_lap(void)
{
    const double last = pt_test.clock;
    return (pt_test.clock = pt_cpu_seconds()) - last;
}

/* With SHORT=1 a check that has too few samples for a verdict is left out: 1. */
static inline int pt_test_skip(const char *name, int too_few)
{
    if (!pt_test.is_short || !too_few) return 0;
    printf("skip   %s: too few samples\n", name);
    return ++pt_test.skipped;
}

/* Did most seeds since the last check belong to no earlier check of this test? Then its p-value, if it is
   continuous, is one of those that must be uniform. Returns how it is printed. */
static inline const char *pt_test_keep_p(double p, int continuous)
{
    const int is_new = pt_test.new_seeds > 0 && pt_test.new_seeds >= pt_test.seeds - pt_test.seeds / 4;
    const int keep = continuous && is_new && pt_test.p_count < PT_TEST_CHECKS;
    static char text[32];
    if (keep) pt_test.p[pt_test.p_count++] = p;
    pt_test.seeds = pt_test.new_seeds = 0;
    snprintf(text, sizeof text, keep ? "p %.3g" : "(p %.3g)", p);
    return text;
}

/* A mean and what it should be. skewness: of the mean, that of one value / sqrt n; df: 0 = normal; own: the
   part of se that comes from the values. */
typedef struct pt_judged_mean {
    double n, value, exact, se, skewness, df, own;
} pt_judged_mean;

static inline void pt_test_judge(const char *name, const pt_judged_mean *m, double bound, int reject,
                                 const char *hint)
{
    const int relative = m->exact < 0 || m->exact > 0;
    const double limit = pt_test_quantile(m->df), g = m->skewness, k = fabs(g) * limit * limit * limit / 6;
    const double sees = (limit + pt_normal_isf(0.1)) * m->se / (relative ? fabs(m->exact) : 1);
    const double t = m->se > 0 ? (m->value - m->exact) / m->se : m->value - m->exact != 0 ? HUGE_VAL : 0;
    const double z = k < 0.3 || !(fabs(t) < 1e9) ? t : t + g * t * t / 3 + g * g * t * t * t / 27 + g / 6;
    const int valid = k <= 1 && m->n >= 32, accepted = fabs(z) <= limit; /* both false for NaN */
    const double p = 2 * (m->df > 0 ? pt_student_sf(fabs(z), m->df) : pt_normal_sf(fabs(z)));
    const char *const p_text = pt_test_keep_p(p, valid && !reject && m->own > 0.99);
    const char *why = "";
    pt_test.statistical++;
    if (pt_test_skip(name, !valid || (reject && accepted))) return;
    if (!reject && bound > 0 && !pt_test.is_short && !pt_test.is_seeded && !(sees <= bound))
        why = "the check could have missed a bias above its bound: take more samples. ";
    if (accepted == reject) why = reject ? "the wrong value was not noticed. " : "the value is wrong. ";
    if (!valid) why = "invalid: too few samples, or too skewed ones. ";
    printf("%s %-48s n %-8.0f got %-12.8g exact %-12.8g se %-8.2g z %+6.2f  sees %.3g%s (bound %g)  %s  %.2f "
           "s\n",
           pt_test_count(why[0] == '\0'), name, m->n, m->value, m->exact, m->se, z,
           relative ? 100 * sees : sees, relative ? " %" : "", relative ? 100 * bound : bound, p_text,
           pt_test_lap());
    if (pt_test.is_verbose && k > 0) printf("       k %.2f\n", k);
    if (why[0] != '\0') printf("       %s%s\n", why, hint);
}

/* The standard error grows by the reference's own and by the rounding of sums. */
static inline void pt_test_judge_mean(const char *name, const pt_stats *s, double exact, double exact_error,
                                      double bound, int df_mode, int reject, const char *hint)
{
    const double se = pt_stats_standard_error(s), rounding = 0x1p-50 * fabs(exact);
    pt_judged_mean m = {s->n, s->mean, exact, 0, 0, 0, 0};
    m.se = sqrt(se * se + exact_error * exact_error + rounding * rounding);
    m.own = m.se > 0 ? se / m.se : 0;
    if (df_mode == PT_TEST_MEANS)
        m.df = s->n - 1;
    else if (se > 0)
        m.skewness = pt_stats_skewness(s) / sqrt(s->n) * pow(se / m.se, 3);
    pt_test_judge(name, &m, bound, reject, hint);
}

/* pt_check_mean(name, stats, exact, exact_error, bound, df_mode, hint): is the mean the exact value, itself
   known up to exact_error? bound: of the bias, relative, or absolute where exact is 0; <= 0: none. df_mode:
   PT_TEST_VALUES or _MEANS. pt_check_rejects_mean passes only if the value would be found wrong. */
#define pt_check_mean(name, stats, exact, exact_error, bound, df_mode, hint) \
    pt_test_judge_mean(name, stats, exact, exact_error, bound, df_mode, 0, hint)
#define pt_check_rejects_mean(name, stats, exact, exact_error, df_mode, hint) \
    pt_test_judge_mean(name, stats, exact, exact_error, 0, df_mode, 1, hint)

/* Do a and b have the same mean (Welch)? They must not share random numbers. */
static inline void pt_check_equal_means(const char *name, const pt_stats *a, const pt_stats *b, double bound,
                                        const char *hint)
{
    const double ea = pt_stats_standard_error(a), va = ea * ea, eb = pt_stats_standard_error(b), vb = eb * eb;
    const double ga = pt_stats_skewness(a) / sqrt(a->n), gb = pt_stats_skewness(b) / sqrt(b->n);
    pt_judged_mean m = {a->n < b->n ? a->n : b->n, a->mean, b->mean, 0, 0, 0, 0};
    m.se = sqrt(va + vb + 0x1p-100 * b->mean * b->mean);
    m.own = m.se > 0 ? sqrt(va + vb) / m.se : 0;
    if (va + vb > 0) m.df = (va + vb) * (va + vb) / (va * va / (a->n - 1) + vb * vb / (b->n - 1));
    if (va + vb > 0 && m.n > PT_TEST_REPLICATIONS) m.skewness = (ga * va * ea - gb * vb * eb) / pow(m.se, 3);
    pt_test_judge(name, &m, bound, 0, hint);
}

/* Cells that expect less than 100 are pooled, and with them the smallest other cell if the pool still expects
   less. What fell where nothing can has p = 0, as have totals that differ: then the density is not one. */
static inline void pt_test_judge_chi2(const char *name, const double *observed, const double *expected,
                                      int cells, int reject, const char *hint)
{
    double chi2 = 0, p = 0, pool_o = 0, pool_e = 0, total_o = 0, total_e = 0;
    int i, df = -1, smallest = -1, impossible = 0;
    const char *p_text;
    for (i = 0; i < cells; i++) {
        impossible |= !(expected[i] > 0) && observed[i] > 0;
        total_o += observed[i];
        total_e += expected[i];
        if (expected[i] >= 100 && (smallest < 0 || expected[i] < expected[smallest])) smallest = i;
        if (expected[i] < 100) pool_e += expected[i];
    }
    if (pool_e >= 100) smallest = -1;
    for (i = 0, pool_e = 0; i < cells; i++) {
        if (i == smallest || expected[i] < 100) {
            pool_o += observed[i];
            pool_e += expected[i];
        } else {
            chi2 += (observed[i] - expected[i]) * (observed[i] - expected[i]) / expected[i];
            df++;
        }
    }
    if (pool_e > 0) chi2 += (pool_o - pool_e) * (pool_o - pool_e) / pool_e;
    df += pool_e > 0;
    impossible |= !(fabs(total_o - total_e) <= 0.02 * sqrt(total_e));
    if (df >= 1 && !impossible) p = pt_chi2_sf(chi2, df);
    p_text = pt_test_keep_p(p, df >= 1 && !reject);
    pt_test.statistical++;
    if (pt_test_skip(name, df < 1 || (reject && p >= pt_test_level()))) return;
    printf("%s %-48s n %-8.0f expected %-12.9g chi2 %-10.6g df %-6d %s  %.2f s\n",
           pt_test_count(df >= 1 && (p >= pt_test_level()) != reject), name, total_o, total_e, chi2, df,
           p_text, pt_test_lap());
    if (df < 1)
        printf("       invalid: fewer than two cells expect 100 samples. %s\n", hint);
    else if (impossible && !reject)
        printf("       samples where the density is zero, or lost. %s\n", hint);
    else if ((p >= pt_test_level()) == reject)
        printf("       %s\n", hint);
}

/* Do counts follow expectations? pt_check_rejects_chi2 passes only if a difference is found. */
#define pt_check_chi2(name, observed, expected, cells, hint) \
    pt_test_judge_chi2(name, observed, expected, cells, 0, hint)
#define pt_check_rejects_chi2(name, observed, expected, cells, hint) \
    pt_test_judge_chi2(name, observed, expected, cells, 1, hint)

/* Are the p-values kept so far uniform? Kolmogorov's distance D, and P(D > d) <= 2 exp(-2 n d^2) for every n
   (P. Massart, The Tight Constant in the Dvoretzky-Kiefer-Wolfowitz Inequality, Ann. Probab. 18, 1990). */
static inline int pt_test_by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}
static inline void pt_test_uniform(void)
{
    const int n = pt_test.p_count;
    double distance = 0, p;
    int i, ok;
    if (n < 32 || pt_test.is_short) return;
    qsort(pt_test.p, (size_t)n, sizeof pt_test.p[0], pt_test_by_size);
    for (i = 0; i < n; i++)
        distance = fmax(distance, fmax((i + 1.0) / n - pt_test.p[i], pt_test.p[i] - (double)i / n));
    p = fmin(2 * exp(-2 * n * distance * distance), 1);
    ok = p >= pt_test_level();
    pt_test.statistical++;
    printf("%s %-48s n %-8d distance %-8.3g (p %.3g)\n", pt_test_count(ok), "p-values are uniform", n,
           distance, p);
    if (!ok)
        printf(
            "       too many small p-values: standard errors are too small, or something is biased; too few: "
            "standard errors are too large, or samples are not independent\n");
}

static inline int pt_test_end(void)
{
    pt_test_close();
    pt_test_uniform();
    if (pt_test.statistical > PT_TEST_CHECKS)
        printf("%s more than %d statistical checks share one level\n", pt_test_count(0), PT_TEST_CHECKS);
    if (pt_test.skipped > 0) printf("%s: %d skipped for want of samples\n", pt_test.program, pt_test.skipped);
    printf("%s: %d passed, %d failed\n", pt_test.program, pt_test.passed, pt_test.failed);
    return pt_test.failed != 0;
}

#if defined(__GNUC__)
#define PT_TEST_LABEL __attribute__((format(printf, 1, 2)))
#else
#define PT_TEST_LABEL
#endif

/* A name put together; holds for the next three calls. */
PT_TEST_LABEL static inline const char *label(const char *format, ...)
{
    static char ring[4][160];
    static int next;
    char *const text = ring[next++ % 4];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof ring[0], format, arguments);
    va_end(arguments);
    return text;
}

#endif /* PT_TEST_H */
