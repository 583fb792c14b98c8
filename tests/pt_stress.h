/* pt_stress.h: rows of the stress suite. A row is one measured quantity of one case: what was got, what is
   exact for the rounded input, the error and the bound that is promised for it.

       begin_group("shapes");
       STRESS.x = 1e6;                                     where in its series the case stands (for the plots)
       told_count("sphere", "wrong decisions", bad, n);    none of n may be wrong
       told_error("sphere", "t", got, exact, error, "rel", bound);
       told_mean("furnace", &stats, exact, exact_error, power);

   A row fails if its error is above its bound, or if it met a NaN. Where one precision cannot hold a bound, the
   row says so beforehand: limited(why, at) with the derivation, and the error that the derivation allows. Within
   that the verdict is "limit", above it the row fails as any other; within the promised bound it is "ok". Nothing
   else widens a bound.

   In the long form each row is printed as a line for tests/stress_report.c; fields are separated by '|'. In the
   short form only what fails is printed (VERBOSE=1: all). */

#ifndef PT_STRESS_H
#define PT_STRESS_H

#include "pt_means.h"

#ifdef STRESS_SHORT
#define STRESS_LONG 0
#else
#define STRESS_LONG 1
#endif

static struct {
    const char *group;
    double x, y;       /* scale or offset of the case; 0 = it stands in no series */
    const char *limit; /* why the bound cannot hold */
    double limit_at;   /* and how large the error may be then */
    long nan;          /* NaN, infinite or dropped contributions since the last row */
    double clock;
    int limits; /* rows with that verdict */
} STRESS;

/* How many of something: all in the long form. */
static inline int many(int all, int few) { return STRESS_LONG ? all : (int)pt_test_samples((uint32_t)few); }

static inline void begin_group(const char *group)
{
    STRESS.group = group;
    STRESS.x = STRESS.y = 0;
    STRESS.limit = NULL;
    STRESS.nan = 0;
    STRESS.clock = pt_wall_seconds();
}

static inline void limited(const char *why, double at)
{
    STRESS.limit = why;
    STRESS.limit_at = at;
}

static inline void seen(double value) { STRESS.nan += !(fabs(value) < HUGE_VAL); }

/* Verdict, count and line of a row. */
static inline void told(const char *name, const char *quantity, double got, double exact, double error,
                        const char *unit, double bound)
{
    const double seconds = pt_wall_seconds() - STRESS.clock;
    const int good = error <= bound && STRESS.nan == 0;
    const int known = !good && STRESS.limit && error <= STRESS.limit_at && STRESS.nan == 0;
    const char *const verdict = good ? "ok" : known ? "limit" : "FAIL";
    if (!pt_test.is_seeded) {
        const char *const word = pt_test_count(good || known);
        STRESS.limits += known;
        if (STRESS_LONG || pt_test.is_verbose || !(good || known))
            printf("row|%s|%s|%s|%.6g|%.6g|%.17g|%.17g|%.4g|%s|%.4g|%s|%ld|%.3f|%s\n", STRESS.group, name,
                   quantity, STRESS.x, STRESS.y, got, exact, error, unit, bound, verdict, STRESS.nan, seconds,
                   known ? STRESS.limit : "");
        if (!(good || known))
            printf("%s %s: %s: %s got %.17g, exact %.17g, error %.4g %s, bound %.4g, %ld not finite\n", word,
                   STRESS.group, name, quantity, got, exact, error, unit, bound, STRESS.nan);
    }
    STRESS.limit = NULL;
    STRESS.nan = 0;
    STRESS.clock = pt_wall_seconds();
}

static inline void told_count(const char *name, const char *quantity, double bad, double of)
{
    told(name, quantity, bad, 0, bad, label("of %.0f", of), 0);
}

static inline void told_error(const char *name, const char *quantity, double got, double exact, double error,
                              const char *unit, double bound)
{
    seen(got);
    told(name, quantity, got, exact, error, unit, bound);
}

static inline void told_relative(const char *name, const char *quantity, double got, double exact,
                                 double bound)
{
    const double error = got - exact != 0 ? fabs(got - exact) / fabs(exact) : 0; /* 0 for 0: exactly */
    told_error(name, quantity, got, exact, error, "rel", bound);
}

/* Is a mean the exact value, known up to exact_error? In standard errors; the level is that of the harness. The row
   is one of its own that says what bias it would have seen: no more than `power`, relative. */
static inline void told_mean(const char *name, const pt_stats *s, double exact, double exact_error,
                             double power)
{
    const double own = pt_stats_standard_error(s);
    const double se = sqrt(own * own + exact_error * exact_error + 0x1p-100 * exact * exact);
    const double quantile = pt_test_quantile(s->n - 1), skew = fabs(pt_stats_skewness(s)) / sqrt(s->n);
    const double sees = (quantile + pt_normal_isf(0.1)) * se / fabs(exact);
    const double nan = (double)STRESS.nan;
    told_error(name, "mean", s->mean, exact, fabs(s->mean - exact) / se, "se", quantile);
    if (STRESS_LONG && power > 0) {
        STRESS.nan = (long)nan;
        told(name, "smallest bias that would be seen", sees, 0, sees, "rel", power);
        told(name, "skewness of the mean, times z^3/6", skew, 0, skew * pow(quantile, 3) / 6, "k", 1);
    }
}

#endif /* PT_STRESS_H */
