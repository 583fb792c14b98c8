/* test_estimators.c: Monte Carlo as a library, and the statistics that judge it ([PT-03]), against integrals,
   variances and quantiles that are known exactly. The exact values stand in tests/data/oracles_mc.csv; at the
   end every row must have been used. */

#include "pt_rows.h"

#define ROWS_PATH "tests/data/oracles_mc.csv"
#define REPEATS 1024u /* how often an estimate is repeated where the spread of its results is looked at */

/* ---------------------------------------------------------------------------------------------------------
   Integrands; user points to their parameters */

static double power_of(const double *u, void *user) { return pow(u[0], ((const double *)user)[0]); }
static double exponential(const double *u, void *user) { return exp(((const double *)user)[0] * u[0]); }
static double step(const double *u, void *user) { return u[0] < ((const double *)user)[0]; }
static double gaussian(const double *u, void *user)
{
    const double *const a = (const double *)user;
    const double x = (u[0] - a[0]) / a[1];
    return exp(-0.5 * x * x);
}
static double lorentzian(const double *u, void *user)
{
    const double *const a = (const double *)user;
    return 1 / (a[1] * a[1] + (u[0] - a[0]) * (u[0] - a[0]));
}
static double lorentzian_squared(const double *u, void *user)
{
    const double f = lorentzian(u, user);
    return f * f;
}
static double line(const double *u, void *user)
{
    (void)user;
    return u[0];
}

/* In a[0] dimensions */
static double product(const double *u, void *user)
{
    const double *const a = (const double *)user;
    double value = 1;
    int d;
    for (d = 0; d < (int)a[0]; d++) value *= u[d];
    return value;
}
static double product_squared(const double *u, void *user)
{
    const double f = product(u, user);
    return f * f;
}
static double sum_of(const double *u, void *user)
{
    const double *const a = (const double *)user;
    double value = 0;
    int d;
    for (d = 0; d < (int)a[0]; d++) value += u[d];
    return value;
}
static double ball(const double *u, void *user)
{
    const double *const a = (const double *)user;
    double square = 0;
    int d;
    for (d = 0; d < (int)a[0]; d++) square += u[d] * u[d];
    return square < 1;
}
static double centred_product(const double *u, void *user)
{
    (void)user;
    return (u[0] - 0.5) * (u[1] - 0.5);
}

/* The families of Genz: a = dimensions, coefficient, shift */
static double product_peak(const double *u, void *user)
{
    const double *const a = (const double *)user;
    double value = 1;
    int d;
    for (d = 0; d < (int)a[0]; d++) value /= 1 / (a[1] * a[1]) + (u[d] - a[2]) * (u[d] - a[2]);
    return value;
}
static double genz_gaussian(const double *u, void *user)
{
    const double *const a = (const double *)user;
    double square = 0;
    int d;
    for (d = 0; d < (int)a[0]; d++) square += (u[d] - a[2]) * (u[d] - a[2]);
    return exp(-a[1] * a[1] * square);
}
static double corner_peak(const double *u, void *user)
{
    const double *const a = (const double *)user;
    return pow(1 + a[1] * sum_of(u, user), -(a[0] + 1));
}
static double discontinuous(const double *u, void *user)
{
    const double *const a = (const double *)user;
    return u[0] < a[2] && u[1] < a[2] ? exp(a[1] * sum_of(u, user)) : 0;
}
/* plus 1: its integral is near 0, and no standard error is small beside that */
static double oscillatory(const double *u, void *user)
{
    const double *const a = (const double *)user;
    return 1 + cos(2 * PT_PI * a[2] + a[1] * sum_of(u, user));
}

/* ---------------------------------------------------------------------------------------------------------
   Techniques */

/* Density (q+1) x^q in each of `dimensions` coordinates */
typedef struct power_law {
    double q;
    int dimensions;
} power_law;

static void power_warp(const double *u, double *x, void *user)
{
    const power_law *const law = (const power_law *)user;
    int d;
    for (d = 0; d < law->dimensions; d++)
        x[d] = law->q > 0 || law->q < 0 ? pow(u[d], 1 / (law->q + 1)) : u[d];
}
static double power_density(const double *x, void *user)
{
    const power_law *const law = (const power_law *)user;
    double p = 1;
    int d;
    for (d = 0; d < law->dimensions; d++) p *= (law->q + 1) * pow(x[d], law->q);
    return p;
}

/* Density proportional to 1 / (e^2 + (x-c)^2) on [0,1]; a = c, e */
static void tangent_warp(const double *u, double *x, void *user)
{
    const double *const a = (const double *)user;
    const double low = atan(a[0] / a[1]), high = atan((1 - a[0]) / a[1]);
    x[0] = a[0] + a[1] * tan(u[0] * (low + high) - low);
}
static double tangent_density(const double *x, void *user)
{
    const double *const a = (const double *)user;
    return lorentzian(x, user) * a[1] / (atan(a[0] / a[1]) + atan((1 - a[0]) / a[1]));
}

/* ---------------------------------------------------------------------------------------------------------
   A job is an estimator with an integrand whose integral is known. */

typedef enum how { MEAN, ANTITHETIC, IMPORTANCE, CONTROL, MIS, MIS_ONE, ROULETTE, SPLITTING } how;

typedef struct job {
    const char *name;
    how how;
    pt_integrand f;
    double a[3];             /* parameters of f                        */
    int dimensions;          /* of f                                   */
    power_law law[2];        /* IMPORTANCE: the first; MIS: both       */
    int counts[2];           /* MIS                                    */
    double shares[2];        /* MIS_ONE                                */
    pt_heuristic heuristic;  /* MIS, MIS_ONE                           */
    pt_integrand g;          /* CONTROL                                */
    double g_integral, c, q; /* CONTROL, but q: ROULETTE               */
    int outer, splits;       /* SPLITTING                              */
    double exact;            /* the integral                           */
} job;

static pt_result run(const job *original, uint32_t n, pt_sampler_kind kind, uint64_t seed, pt_estimate *out)
{
    job j = *original;
    const pt_technique t[2] = {{power_warp, power_density, &j.law[0]},
                               {power_warp, power_density, &j.law[1]}};
    const pt_integral p = {j.f, j.a, j.dimensions, n, kind, pt_test_seed(seed)};
    switch (j.how) {
    case MEAN:
        return pt_estimate_mean(&p, out);
    case ANTITHETIC:
        return pt_estimate_antithetic(&p, out);
    case IMPORTANCE:
        return pt_estimate_importance(&p, t, out);
    case CONTROL:
        return pt_estimate_control(&p, j.g, j.g_integral, j.c, out);
    case MIS:
        return pt_estimate_mis(&p, t, j.counts, 2, j.heuristic, out);
    case MIS_ONE:
        return pt_estimate_mis_one(&p, t, j.shares, 2, j.heuristic, out);
    case ROULETTE:
        return pt_estimate_roulette(&p, j.q, out);
    case SPLITTING:
        return pt_estimate_splitting(&p, j.outer, j.splits, out);
    }
    return PT_ERROR_ARGUMENT;
}

/* What many estimates with different seeds say. */
typedef struct tally {
    pt_stats units;    /* all their independent values: merged                          */
    pt_stats variance; /* their unbiased estimates of the variance of one unit          */
    pt_stats square;   /* the squares of their errors,                                  */
    pt_stats claimed;  /* and the squares of the standard errors that they report       */
    pt_stats calls;    /* evaluations                                                   */
    int failed;
} tally;

static tally repeat(const job *j, uint32_t repeats, uint32_t n, pt_sampler_kind kind, uint64_t seed)
{
    tally t;
    uint32_t i;
    memset(&t, 0, sizeof t);
    for (i = 0; i < repeats; i++) {
        pt_estimate e;
        t.failed += run(j, n, kind, seed + i, &e) != PT_OK;
        pt_stats_merge(&t.units, &e.units);
        pt_stats_add(&t.variance, pt_stats_variance(&e.units));
        pt_stats_add(&t.square, (e.value - j->exact) * (e.value - j->exact));
        pt_stats_add(&t.claimed, e.standard_error * e.standard_error);
        pt_stats_add(&t.calls, e.evaluations);
    }
    pt_check(t.failed == 0, j->name, "%d estimates were refused", t.failed);
    return t;
}

/* ---------------------------------------------------------------------------------------------------------
   Plain Monte Carlo: integrals and variances */

/* Rows whose values are too skewed for 2^20 of them: four times as many, and looser bounds. */
static int is_rare(const row *r)
{
    return strcmp(r->params, "c=0.7;s=0.001") == 0 || strcmp(r->params, "a=0.001") == 0;
}

/* Where f takes two values, each half of the time, (f - I)^2 is constant and the variance hardly scatters:
   what is left is the square of the error of the mean, which is not normal. The tolerance is far wider. */
static int is_even_chance(double mean, double variance)
{
    return fabs(variance - mean * (1 - mean)) < 1e-9 && fabs(mean - 0.5) < 0.05;
}
static void check_variance(const char *name, const pt_stats *seen, double mean, double variance, double bound)
{
    const char *const hint = "standard_error^2 n is not the variance of this estimator";
    if (is_even_chance(mean, variance))
        pt_check_near(name, seen->mean, variance, 0.01 * variance, hint);
    else
        pt_check_mean(name, seen, variance, 0, bound, PT_TEST_VALUES, hint);
}

/* Mean and variance of independent values. variance < 0: not tested; 0 has its own test. The variance of one
   unit is estimated REPEATS times, so its standard error, which needs a finite fourth moment, is known. */
static void mean_and_variance(const job *j, uint32_t n, double variance, double bound, double variance_bound,
                              uint64_t seed)
{
    const tally t = repeat(j, REPEATS, pt_test_all_samples(n), PT_SAMPLER_INDEPENDENT, seed);
    char name[96];
    sprintf(name, "mean: %.80s", j->name);
    pt_check_mean(name, &t.units, j->exact, 0, bound, PT_TEST_VALUES, "the estimator is biased");
    if (variance < 0) return;
    sprintf(name, "variance: %.80s", j->name);
    check_variance(name, &t.variance, j->exact, variance, variance_bound);
}

static void plain_table(const char *table, pt_integrand f, const char *first, const char *second,
                        uint64_t seed)
{
    const row *r;
    int at = 0;
    for (; (r = next_row(table, "I", &at)) != NULL; seed += REPEATS) {
        const row *const variance = find_row(table, "Var", r->params);
        job j = {.name = r->params, .how = MEAN, .f = f, .dimensions = 1};
        const double loose = is_rare(r) ? 2 : 1;
        char name[80];
        sprintf(name, "%s %s", r->id, r->params);
        j.name = name;
        j.a[0] = parameter(r, first);
        j.a[1] = second ? parameter(r, second) : 0;
        j.exact = r->value;
        if (f == lorentzian && j.a[1] < 1e-3) continue; /* by importance sampling, see peaks */
        mean_and_variance(&j, is_rare(r) ? 4096 : 1024, variance->value, 0.08 * loose, 0.1 * loose, seed);
    }
}

static void one_dimension(void)
{
    pt_test_source("tests/data/oracles_mc.csv: MC-POW, -EXP, -GAUSS, -LORENTZ, -STEP, elementary integrals");
    plain_table("MC-POW", power_of, "p", NULL, 10000);
    plain_table("MC-EXP", exponential, "a", NULL, 15000);
    plain_table("MC-GAUSS", gaussian, "c", "s", 20000);
    plain_table("MC-LORENTZ", lorentzian, "c", "e", 25000);
    plain_table("MC-STEP", step, "a", NULL, 30000);
}

static void nd_rows(const char *what, pt_integrand f, uint64_t seed)
{
    char mean[16], variance[16];
    const row *r;
    int at = 0;
    sprintf(mean, "%s_I", what);
    sprintf(variance, "%s_Var", what);
    for (; (r = next_row("MC-ND", mean, &at)) != NULL; seed += REPEATS) {
        const double exact = find_row("MC-ND", variance, r->params)->value;
        job j = {.name = "", .how = MEAN, .f = f};
        char name[80];
        sprintf(name, "%s %s %s", r->id, what, r->params);
        j.name = name;
        j.dimensions = (int)parameter(r, "d");
        j.a[0] = j.dimensions;
        j.exact = r->value;
        if (exact > 0) /* the squares of ten factors are too skewed: see peaks */
            mean_and_variance(&j, j.dimensions == 10 ? 4096 : 1024,
                              j.dimensions == 10 && f == product ? -1 : exact, 0.1, 0.15, seed);
    }
}

static void many_dimensions(void)
{
    pt_test_source("tests/data/oracles_mc.csv: MC-ND, elementary integrals");
    job j = {.name = "sum of 10", .how = MEAN, .f = sum_of, .a = {10}, .dimensions = 10, .exact = 5};
    nd_rows("prod", product, 40000);
    nd_rows("ball", ball, 46000);
    mean_and_variance(&j, 1024, 10.0 / 12, 0.01, 0.05, 52000);
}

/* Families of Genz by every kind of numbers */
static void genz(void)
{
    pt_test_source("tests/data/oracles_mc.csv: MC-GENZ, families of A. Genz, 1984");
    static const struct {
        const char *quantity;
        pt_integrand f;
    } family[5] = {{"productpeak_I", product_peak},
                   {"gaussian_I", genz_gaussian},
                   {"cornerpeak_I", corner_peak},
                   {"discontinuous_I", discontinuous},
                   {"oscillatory_I", oscillatory}};
    static const pt_sampler_kind kinds[3] = {PT_SAMPLER_SOBOL, PT_SAMPLER_INDEPENDENT, PT_SAMPLER_STRATIFIED};
    static const char *const names[3] = {"sobol", "independent", "stratified"};
    uint64_t seed = 60000;
    int i, k, at;
    for (i = 0; i < 5; i++)
        for (at = 0; at < row_count;) {
            const row *const r = next_row("MC-GENZ", family[i].quantity, &at);
            if (!r) break;
            for (k = 0; k < 3; k++, seed += 300) {
                const int independent = kinds[k] == PT_SAMPLER_INDEPENDENT;
                const uint32_t n = independent ? 8192 : 2048; /* corner peaks are skewed: more of them */
                const int skewed = independent && family[i].f == corner_peak;
                job j = {.name = r->params, .how = MEAN, .f = family[i].f};
                tally t;
                char name[80];
                j.dimensions = (int)parameter(r, "d");
                j.a[0] = j.dimensions;
                j.a[1] = parameter(r, "a");
                j.a[2] = parameter(r, "u");
                j.exact = r->value + (family[i].f == oscillatory ? 1 : 0);
                t = repeat(&j, skewed ? 256 : 64, skewed ? pt_test_all_samples(n) : pt_test_samples(n),
                           kinds[k], seed);
                sprintf(name, "%s %s, %s", r->id, family[i].quantity, names[k]);
                pt_check_mean(
                    name, &t.units, j.exact, 0, 0.1, independent ? PT_TEST_VALUES : PT_TEST_MEANS,
                    "the sum must be divided by n; do the points fill the unit cube, all of its dimensions?");
            }
        }
}

/* ---------------------------------------------------------------------------------------------------------
   Zero variance: every single value must be the integral */

static void exactly(const char *name, const pt_estimate *e, double exact, double tolerance)
{
    near_relative(name, e->value, exact, tolerance);
    pt_check(sqrt(e->units.m2 / e->units.n) <= tolerance * fabs(exact), name,
             "the values spread by %g: all must be the integral", sqrt(e->units.m2 / e->units.n));
}

/* f / density constant; a control variate that is f; f odd about the centre */
static void zero_variance(void)
{
    job importance = {.how = IMPORTANCE, .f = power_of, .dimensions = 1, .law = {{0, 1}, {0, 1}}};
    job control = {.how = CONTROL, .f = exponential, .a = {1}, .dimensions = 1, .g = exponential, .c = 1};
    job antithetic = {.how = ANTITHETIC, .f = sum_of, .a = {3}, .dimensions = 3, .exact = 1.5};
    job splitting = {.how = SPLITTING, .f = ball, .a = {1}, .dimensions = 2, .outer = 1, .splits = 3};
    pt_estimate e;
    const row *r;
    int at = 0;
    while ((r = next_row("MC-IS", "Var", &at)) != NULL) {
        if (r->value > 0) continue;
        importance.a[0] = importance.law[0].q = parameter(r, "q");
        run(&importance, 1000, PT_SAMPLER_INDEPENDENT, 1, &e);
        exactly(r->id, &e, 1 / (importance.a[0] + 1), 1e-14);
        pt_check(e.evaluations == 1000, r->id, "%g evaluations", e.evaluations);
    }
    for (at = 0; (r = next_row("MC-HEAVY", "I", &at)) != NULL;) { /* infinite variance cured */
        importance.a[0] = importance.law[0].q = -parameter(r, "a");
        run(&importance, 1000, PT_SAMPLER_SOBOL, 2, &e);
        exactly(r->id, &e, r->value, 1e-13);
    }
    control.g_integral = find_row("MC-EXP", "I", "a=1")->value;
    run(&control, 1000, PT_SAMPLER_INDEPENDENT, 3, &e);
    exactly("the perfect control variate", &e, control.g_integral, 1e-15);
    run(&antithetic, 1000, PT_SAMPLER_INDEPENDENT, 4, &e);
    exactly("antithetic numbers for a sum", &e, 1.5, 1e-15);
    run(&splitting, 1000, PT_SAMPLER_INDEPENDENT, 5, &e);
    exactly("splitting of a constant", &e, find_row("MC-ND", "ball_I", "d=1")->value, 1e-15);
    pt_check(e.standard_error == 0 && e.efficiency == 0, "efficiency without a spread", "%g", e.efficiency);
    near_relative("variance of a constant", 1 + pt_stats_variance(&e.units),
                  1 + find_row("MC-ND", "ball_Var", "d=1")->value, 1e-15);
}

/* Integrals of f^2 that are too skewed for plain Monte Carlo, by zero variance: Var = that - I^2 */
static void second_moments(void)
{
    job j = {.how = IMPORTANCE, .f = power_of, .dimensions = 1, .law = {{0, 1}, {0, 1}}};
    const row *r;
    pt_estimate e;
    int at = 0;
    while ((r = next_row("MC-HEAVY", "Var", &at)) != NULL) {
        const double a = parameter(r, "a"), mean = find_row("MC-HEAVY", "I", r->params)->value;
        pt_check(isinf(r->value) == (2 * a >= 1), r->id, "finite for a < 1/2 only");
        if (isinf(r->value)) continue;
        j.a[0] = j.law[0].q = -2 * a;
        run(&j, 1000, PT_SAMPLER_INDEPENDENT, 1, &e);
        near_relative(r->id, e.value - mean * mean, r->value, 1e-12);
    }
    for (at = 0; (r = next_row("MC-IS", "Var", &at)) != NULL;) { /* of f / density: x^(2p-q) / (q+1) */
        const double p = parameter(r, "p"), q = parameter(r, "q"), mean = 1 / (p + 1);
        pt_check(isinf(r->value) == (q >= 2 * p + 1), r->id, "finite for q < 2p + 1 only");
        if (isinf(r->value)) continue;
        j.a[0] = j.law[0].q = 2 * p - q;
        run(&j, 1000, PT_SAMPLER_INDEPENDENT, 2, &e);
        pt_check_near(r->id, e.value / (q + 1) - mean * mean, r->value, 1e-14,
                      "f / p at the warped point, p the density of that technique there");
    }
}

/* Peaks that plain Monte Carlo misses: importance sampling by a wider peak, and of f^2 by f */
static void peaks(void)
{
    pt_test_source("tests/data/oracles_mc.csv: MC-LORENTZ, MC-ND, elementary integrals");
    double a[2], wide[2];
    const pt_technique same = {tangent_warp, tangent_density, a},
                       wider = {tangent_warp, tangent_density, wide};
    pt_integral p = {lorentzian, a, 1, pt_test_samples(1u << 18), PT_SAMPLER_INDEPENDENT, pt_test_seed(99)};
    power_law linear = {1, 10};
    const pt_technique corner = {power_warp, power_density, &linear};
    const row *r;
    pt_estimate e;
    double ten = 10, mean;
    int at = 0;
    for (; (r = next_row("MC-LORENTZ", "I", &at)) != NULL; p.seed = pt_test_seed((uint64_t)at)) {
        const double variance = find_row("MC-LORENTZ", "Var", r->params)->value;
        wide[0] = a[0] = parameter(r, "c");
        a[1] = parameter(r, "e");
        wide[1] = 2 * a[1];
        pt_estimate_importance(&p, &wider, &e);
        pt_check_mean(r->id, &e.units, r->value, 0, 0.02, PT_TEST_VALUES,
                      "f / p: is p the density at x, normalised over the interval?");
        p.f = lorentzian_squared;
        p.seed = pt_test_seed(100 + (uint64_t)at);
        pt_estimate_importance(&p, &same, &e);
        pt_check_mean("its second moment", &e.units, variance + r->value * r->value, 0, 0.02, PT_TEST_VALUES,
                      "f^2 / p by the technique that samples f itself: p must be normalised");
        p.f = lorentzian;
        pt_estimate_importance(&p, &same, &e);
        exactly("a peak sampled by itself", &e, r->value, 1e-9); /* x - c cancels near the peak */
    }
    mean = find_row("MC-ND", "prod_I", "d=10")->value;
    p.f = product_squared;
    p.user = &ten;
    p.dimensions = 10;
    pt_estimate_importance(&p, &corner, &e);
    pt_check_mean("second moment of ten factors", &e.units,
                  find_row("MC-ND", "prod_Var", "d=10")->value + mean * mean, 0, 0.03, PT_TEST_VALUES,
                  "in ten dimensions the density is the product of ten");
}

/* ---------------------------------------------------------------------------------------------------------
   Infinite variance is shown, not tested: no standard error means anything, and no z-test holds. */

static int by_size(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median_error(const job *j, uint32_t n, uint64_t seed)
{
    double error[255];
    uint32_t i;
    for (i = 0; i < 255; i++) {
        pt_estimate e;
        run(j, n, PT_SAMPLER_INDEPENDENT, seed + i, &e);
        error[i] = fabs(e.value - j->exact);
    }
    qsort(error, 255, sizeof error[0], by_size);
    return error[127];
}

static void show_order(const job *j, const char *name, double theory, uint64_t seed)
{
    const double few = median_error(j, 64, seed), many = median_error(j, 4096, seed + 1000);
    printf("shown  %-48s median error of 255 runs %.3g (n 64), %.3g (n 4096): n^%.2f, theory n^%.2f\n", name,
           few, many, log(many / few) / log(64), -theory);
}

static void heavy_tails(void)
{
    pt_test_source("tests/data/oracles_mc.csv: MC-HEAVY, elementary integrals");
    job j = {.how = MEAN, .f = power_of, .dimensions = 1, .law = {{0, 1}, {0, 1}}};
    tally t;
    const row *r;
    char name[80];
    int at = 0;
    while ((r = next_row("MC-HEAVY", "convergence_exponent", &at)) != NULL) {
        const double a = parameter(r, "a");
        j.a[0] = -a;
        j.exact = find_row("MC-HEAVY", "I", r->params)->value;
        near_relative(r->id, r->value, a > 0.5 ? 1 - a : 0.5, 1e-15);
        sprintf(name, "x^-%g%s", a, a >= 0.5 ? ", infinite variance" : "");
        show_order(&j, name, r->value, (uint64_t)(70000 + 2000 * at));
        if (a > 0.3) continue; /* the third moment is infinite too */
        t = repeat(&j, REPEATS, pt_test_samples(1024), PT_SAMPLER_INDEPENDENT, 69000);
        /* Its skewness is 7.07, little for so many values; seen in the values it would jump about, as their
           sixth moment is infinite. */
        pt_check_mean("mean: x^-0.25", &t.units, j.exact, 0, 0.02, PT_TEST_MEANS,
                      "large values near 0 are rare, yet they count: is u = 0 left out, or cut off?");
    }
    j.how = IMPORTANCE; /* q = 5 is infinite: x^-3 / 6 where density 6 x^5 hardly ever goes */
    j.a[0] = 2;
    j.exact = 1.0 / 3;
    for (at = 4; at <= 5; at++) {
        j.law[0].q = at;
        sprintf(name, "x^2 with density %d x^%d, %s", at + 1, at,
                at == 4 ? "infinite fourth moment" : "infinite variance");
        show_order(&j, name, 0.5, (uint64_t)(95000 + 2000 * at));
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Every estimator is unbiased with every kind of numbers, and its reported error is the true one. */

static const job jobs[] = {
    {.name = "mean", .how = MEAN, .f = power_of, .a = {2}, .dimensions = 1, .exact = 1.0 / 3},
    {.name = "antithetic", .how = ANTITHETIC, .f = power_of, .a = {2}, .dimensions = 1, .exact = 1.0 / 3},
    {.name = "antithetic, 5-D",
     .how = ANTITHETIC,
     .f = product,
     .a = {5},
     .dimensions = 5,
     .exact = 1.0 / 32},
    {.name = "importance",
     .how = IMPORTANCE,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .law = {{1, 1}, {0, 1}},
     .exact = 1.0 / 3},
    {.name = "importance, 3-D",
     .how = IMPORTANCE,
     .f = product,
     .a = {3},
     .dimensions = 3,
     .law = {{0.5, 3}, {0, 1}},
     .exact = 1.0 / 8},
    {.name = "control",
     .how = CONTROL,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .g = line,
     .g_integral = 0.5,
     .c = 0.7,
     .exact = 1.0 / 3},
    {.name = "MIS, power",
     .how = MIS,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .law = {{0, 1}, {1, 1}},
     .counts = {1, 1},
     .heuristic = PT_HEURISTIC_POWER,
     .exact = 1.0 / 3},
    {.name = "MIS, balance, 2 + 1",
     .how = MIS,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .law = {{0, 1}, {1, 1}},
     .counts = {2, 1},
     .heuristic = PT_HEURISTIC_BALANCE,
     .exact = 1.0 / 3},
    {.name = "MIS, maximum, 1 + 3",
     .how = MIS,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .law = {{0, 1}, {1, 1}},
     .counts = {1, 3},
     .heuristic = PT_HEURISTIC_MAXIMUM,
     .exact = 1.0 / 3},
    {.name = "MIS, power, 0 + 2",
     .how = MIS,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .law = {{0, 1}, {1, 1}},
     .counts = {0, 2},
     .heuristic = PT_HEURISTIC_POWER,
     .exact = 1.0 / 3},
    {.name = "MIS, the same twice, maximum",
     .how = MIS,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .law = {{1, 1}, {1, 1}},
     .counts = {1, 1},
     .heuristic = PT_HEURISTIC_MAXIMUM,
     .exact = 1.0 / 3},
    {.name = "one-sample MIS, power",
     .how = MIS_ONE,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .law = {{0, 1}, {1, 1}},
     .shares = {0.3, 0.7},
     .heuristic = PT_HEURISTIC_POWER,
     .exact = 1.0 / 3},
    {.name = "one-sample MIS, balance",
     .how = MIS_ONE,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .law = {{0, 1}, {1, 1}},
     .shares = {0.5, 0.5},
     .heuristic = PT_HEURISTIC_BALANCE,
     .exact = 1.0 / 3},
    {.name = "one-sample MIS, maximum",
     .how = MIS_ONE,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .law = {{0, 1}, {1, 1}},
     .shares = {0.6, 0.4},
     .heuristic = PT_HEURISTIC_MAXIMUM,
     .exact = 1.0 / 3},
    {.name = "one-sample MIS, 0 + 1",
     .how = MIS_ONE,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .law = {{0, 1}, {1, 1}},
     .shares = {0, 1},
     .heuristic = PT_HEURISTIC_BALANCE,
     .exact = 1.0 / 3},
    {.name = "roulette",
     .how = ROULETTE,
     .f = power_of,
     .a = {2},
     .dimensions = 1,
     .q = 0.4,
     .exact = 1.0 / 3},
    {.name = "splitting",
     .how = SPLITTING,
     .f = product,
     .a = {3},
     .dimensions = 3,
     .outer = 1,
     .splits = 3,
     .exact = 1.0 / 8}};
#define JOBS (int)(sizeof jobs / sizeof jobs[0])

static double calls_each(const job *j)
{
    if (j->how == ANTITHETIC) return 2;
    if (j->how == MIS) return j->counts[0] + j->counts[1];
    if (j->how == ROULETTE) return j->q;
    return j->how == SPLITTING ? j->splits : 1;
}

static void unbiased(void)
{
    pt_test_source("elementary integrals; the mean of reported squared errors is that of true ones");
    static const pt_sampler_kind kinds[3] = {PT_SAMPLER_SOBOL, PT_SAMPLER_INDEPENDENT, PT_SAMPLER_STRATIFIED};
    static const char *const names[3] = {"sobol", "independent", "stratified"};
    const uint32_t n = pt_test_samples(256);
    char name[96];
    int i, k;
    for (i = 0; i < JOBS; i++)
        for (k = 0; k < 3; k++) {
            const tally t = repeat(&jobs[i], 512, n, kinds[k], (uint64_t)(500000 + 600 * (3 * i + k)));
            sprintf(name, "%s, %s", jobs[i].name, names[k]);
            pt_check_mean(name, &t.units, jobs[i].exact, 0, 0.05,
                          kinds[k] == PT_SAMPLER_INDEPENDENT ? PT_TEST_VALUES : PT_TEST_MEANS,
                          "the estimator is biased");
            sprintf(name, "reported error: %s, %s", jobs[i].name, names[k]);
            pt_check_equal_means(name, &t.square, &t.claimed, 0, "the true error is another one");
            if (jobs[i].how == ROULETTE && kinds[k] == PT_SAMPLER_INDEPENDENT)
                pt_check_mean("evaluations of roulette", &t.calls, n * jobs[i].q, 0, 0.05, PT_TEST_MEANS,
                              "f is called with probability q");
            else if (jobs[i].how != ROULETTE)
                pt_check(t.calls.mean == n * calls_each(&jobs[i]) && t.calls.m2 == 0, name,
                         "%g evaluations of f, not %g", t.calls.mean, n * calls_each(&jobs[i]));
        }
}

/* ---------------------------------------------------------------------------------------------------------
   Their variances */

/* x^p with densities 1 and 2x: n[i] samples each, or one sample chosen with probability n[i] */
typedef struct mis_case {
    double p, n[2];
    pt_heuristic heuristic;
    int one;
} mis_case;

static double mis_weight_of(const mis_case *m, int i, double x)
{
    const double a = m->n[i] * (i ? 2 * x : 1), b = m->n[1 - i] * (i ? 1 : 2 * x);
    if (m->heuristic == PT_HEURISTIC_MAXIMUM) return a > b;
    return m->heuristic == PT_HEURISTIC_BALANCE ? a / (a + b) : a * a / (a * a + b * b);
}

/* Integral of w f, or of (w f)^2 / (n p), for technique i over [low,high] by Gauss' rule of three points */
static double mis_moment(const mis_case *m, int i, int squared, double low, double high)
{
    static const double node[3] = {-0.77459666924148338, 0, 0.77459666924148338}, weight[3] = {5, 8, 5};
    const int panels = 500;
    const double half = 0.5 * (high - low) / panels;
    double sum = 0;
    int panel, k;
    for (panel = 0; panel < panels; panel++)
        for (k = 0; k < 3; k++) {
            const double x = low + half * (2 * panel + 1 + node[k]),
                         wf = mis_weight_of(m, i, x) * pow(x, m->p);
            sum += weight[k] * (squared ? wf * wf / (m->n[i] * (i ? 2 * x : 1)) : wf);
        }
    return sum * half / 9;
}

static double mis_variance(const mis_case *m)
{
    const double tie = 0.5 * m->n[0] / m->n[1], middle = tie < 1 ? tie : 0.5, total = 1 / (m->p + 1);
    double variance = m->one ? -total * total : 0;
    int i;
    for (i = 0; i < 2; i++) {
        const double mean = mis_moment(m, i, 0, 0, middle) + mis_moment(m, i, 0, middle, 1);
        variance += mis_moment(m, i, 1, 0, middle) + mis_moment(m, i, 1, middle, 1);
        if (!m->one) variance -= mean * mean / m->n[i];
    }
    return variance;
}

static void one_mis_variance(const char *label, const mis_case *m, double exact, uint64_t seed)
{
    static const char *const names[3] = {"power", "balance", "maximum"};
    job j = {.how = MIS, .f = power_of, .dimensions = 1, .law = {{0, 1}, {1, 1}}};
    char name[96];
    int i;
    sprintf(name, "%s x^%g, %s, %g : %g%s", label, m->p, names[m->heuristic], m->n[0], m->n[1],
            m->one ? ", one sample" : "");
    j.name = name;
    j.how = m->one ? MIS_ONE : MIS;
    j.a[0] = m->p;
    j.exact = 1 / (m->p + 1);
    j.heuristic = m->heuristic;
    for (i = 0; i < 2; i++) {
        j.counts[i] = (int)m->n[i];
        j.shares[i] = m->n[i];
    }
    mean_and_variance(&j, 128, exact, 0.03, 0.06, seed);
}

static void mis_rows(const char *quantity, pt_heuristic heuristic, int one, uint64_t seed)
{
    const row *r;
    int at = 0;
    for (; (r = next_row("MC-MIS", quantity, &at)) != NULL; seed += REPEATS) {
        const double n = one ? 0.5 : 1;
        mis_case m = {0, {0, 0}, PT_HEURISTIC_POWER, 0};
        m.p = parameter(r, "p");
        m.n[0] = m.n[1] = n;
        m.heuristic = heuristic;
        m.one = one;
        if (m.p > 0.5) near_relative(r->id, mis_variance(&m), r->value, 1e-9);
        one_mis_variance(r->id, &m, r->value, seed);
    }
}

static void mis_variances(void)
{
    pt_test_source(
        "tests/data/oracles_mc.csv: MC-MIS (Veach and Guibas 1995); others by Gauss quadrature in the test");
    static const mis_case others[8] = {
        {2, {1, 1}, PT_HEURISTIC_MAXIMUM, 0},     {1, {2, 1}, PT_HEURISTIC_BALANCE, 0},
        {2, {1, 3}, PT_HEURISTIC_POWER, 0},       {2, {4, 4}, PT_HEURISTIC_BALANCE, 0},
        {5, {1, 2}, PT_HEURISTIC_MAXIMUM, 0},     {2, {0.25, 0.75}, PT_HEURISTIC_BALANCE, 1},
        {1, {0.75, 0.25}, PT_HEURISTIC_POWER, 1}, {2, {0.5, 0.5}, PT_HEURISTIC_MAXIMUM, 1}};
    int i;
    mis_rows("Var_balance", PT_HEURISTIC_BALANCE, 0, 130000);
    mis_rows("Var_power2", PT_HEURISTIC_POWER, 0, 135000);
    mis_rows("Var_onesample_balance", PT_HEURISTIC_BALANCE, 1, 140000);
    for (i = 0; i < 8; i++)
        one_mis_variance("MIS of", &others[i], mis_variance(&others[i]), (uint64_t)(145000 + 1100 * i));
}

static void importance_variances(void)
{
    pt_test_source("tests/data/oracles_mc.csv: MC-IS, elementary: 1/((q+1)(2p-q+1)) - I^2");
    const row *r;
    char name[96];
    int at = 0;
    while ((r = next_row("MC-IS", "Var", &at)) != NULL) {
        job j = {.how = IMPORTANCE, .f = power_of, .dimensions = 1, .law = {{0, 1}, {0, 1}}};
        const double p = parameter(r, "p"), q = parameter(r, "q");
        if (!(r->value > 0) || 3 * q >= 4 * p + 1) continue; /* fourth moment of f / density */
        sprintf(name, "%s %s", r->id, r->params);
        j.name = name;
        j.a[0] = p;
        j.law[0].q = q;
        j.exact = 1 / (p + 1);
        mean_and_variance(&j, 1024, r->value, 0.01, 0.05, (uint64_t)(155000 + 1100 * at));
    }
}

/* Antithetic x^2: half of (1/5 + B(3,3)) less 1/9 = 1/180. Control: e^x - c (x - 1/2) has
   Var - 2 c cov + c^2 / 12 with cov = (3 - e) / 2. Roulette: E f^2 / q - I^2. Splitting of xy: Var E(f|x) is
   1/48, E Var(f|x) is 1/36. */
static void other_variances(void)
{
    pt_test_source("elementary: worked out at the test");
    static const double c[3] = {0, 1, 1.6903090292428586}, q[3] = {1, 0.5, 0.1};
    const double covariance = 0.5 * (3 - 2.7182818284590452),
                 variance = find_row("MC-EXP", "Var", "a=1")->value;
    job antithetic = jobs[1];
    job control = {.how = CONTROL, .f = exponential, .a = {1}, .dimensions = 1, .g = line, .g_integral = 0.5};
    job roulette = {.how = ROULETTE, .f = power_of, .a = {2}, .dimensions = 1, .exact = 1.0 / 3};
    job splitting = {.how = SPLITTING, .f = product, .a = {2}, .dimensions = 2, .outer = 1, .exact = 0.25};
    char name[64];
    int i;
    antithetic.name = "antithetic x^2";
    mean_and_variance(&antithetic, 256, 1.0 / 180, 0.01, 0.05, 170000);
    control.name = roulette.name = splitting.name = name;
    control.exact = find_row("MC-EXP", "I", "a=1")->value;
    for (i = 0; i < 3; i++) {
        sprintf(name, "e^x with %g x as control variate", c[i]);
        control.c = c[i];
        mean_and_variance(&control, 1024, variance - 2 * c[i] * covariance + c[i] * c[i] / 12, 0.01, 0.05,
                          (uint64_t)(172000 + 1100 * i));
        sprintf(name, "roulette with q = %g", q[i]);
        roulette.q = q[i];
        mean_and_variance(&roulette, 1024, 0.2 / q[i] - 1.0 / 9, 0.05, 0.1, (uint64_t)(176000 + 1100 * i));
        splitting.splits = 1 << 2 * i;
        sprintf(name, "xy split into %d", splitting.splits);
        mean_and_variance(&splitting, 256, 1.0 / 48 + 1.0 / 36 / splitting.splits, 0.02, 0.05,
                          (uint64_t)(180000 + 1100 * i));
    }
    near_relative("xy not split", 1.0 / 48 + 1.0 / 36, find_row("MC-ND", "prod_Var", "d=2")->value, 1e-15);
}

/* ---------------------------------------------------------------------------------------------------------
   Well-spread points: their exact variances. A spread is the variance of means of n points, from 32 sets. */

typedef double (*spread)(const job *j, uint32_t n, uint64_t seed);

static double spread_of_nets(const job *j, uint32_t n, uint64_t seed)
{
    pt_estimate e;
    run(j, 32 * n, PT_SAMPLER_SOBOL, seed, &e);
    return pt_stats_variance(&e.units);
}

static double spread_of_strata(const job *j, uint32_t n, uint64_t seed)
{
    pt_estimate e;
    run(j, 32 * n, PT_SAMPLER_STRATIFIED, seed, &e);
    return pt_stats_variance(&e.units);
}

/* Cells of a square grid, one point each: the pairs of the stratified sampler */
static double spread_of_grids(const job *j, uint32_t n, uint64_t seed)
{
    pt_sampler s = pt_sampler_make(PT_SAMPLER_STRATIFIED, pt_test_seed(seed), n);
    pt_stats means = PT_STATS_INIT;
    double a[3];
    uint32_t set, i;
    memcpy(a, j->a, sizeof a);
    for (set = 0; set < 32; set++) {
        double sum = 0;
        for (i = 0; i < n; i++) {
            double u[2];
            pt_vec2 pair;
            pt_sampler_start(&s, set, i);
            pair = pt_sampler_2d(&s);
            u[0] = (double)pair.x;
            u[1] = (double)pair.y;
            sum += j->f(u, a);
        }
        pt_stats_add(&means, sum / n);
    }
    return pt_stats_variance(&means);
}

static double spread_of_runs(const job *j, uint32_t n, uint64_t seed)
{
    pt_stats means = PT_STATS_INIT;
    uint64_t i;
    for (i = 0; i < 32; i++) {
        pt_estimate e;
        run(j, n, PT_SAMPLER_INDEPENDENT, pt_hash64(32 * seed + i), &e);
        pt_stats_add(&means, e.value);
    }
    return pt_stats_variance(&means);
}

static void expect_spread(const row *r, spread of, const job *j, uint32_t n, uint64_t seed)
{
    const uint32_t runs = pt_test_samples(n > 64 ? 400 : 640);
    pt_stats seen = PT_STATS_INIT;
    char name[80];
    uint32_t i;
    for (i = 0; i < runs; i++) pt_stats_add(&seen, of(j, n, seed + i));
    sprintf(name, "%s %s, %s", r->id, r->quantity, r->params);
    pt_check_mean(name, &seen, r->value, r->error, 0.12, PT_TEST_MEANS,
                  "are the points spread as they should?");
}

static const job on_line = {.name = "x", .how = MEAN, .f = line, .dimensions = 1, .exact = 0.5};
static const job on_plane = {
    .name = "x + y", .how = MEAN, .f = sum_of, .a = {2}, .dimensions = 2, .exact = 1};
static const job on_step = {
    .name = "x < 0.3", .how = MEAN, .f = step, .a = {0.3}, .dimensions = 2, .exact = 0.3};
static const job on_saddle = {.name = "saddle", .how = MEAN, .f = centred_product, .dimensions = 2};

static void stratified_variances(void)
{
    pt_test_source("tests/data/oracles_mc.csv: MC-STRAT (Haber 1966, Mitchell 1996), MC-STRATSTEP, one "
                   "Bernoulli cell a row");
    static const struct {
        const char *table, *quantity;
        spread of;
        const job *j;
    } kinds[5] = {{"MC-STRAT", "jitter1D_x_Var", spread_of_strata, &on_line},
                  {"MC-STRAT", "latin_xplusy_Var", spread_of_strata, &on_plane},
                  {"MC-STRAT", "jitter2D_xplusy_Var", spread_of_grids, &on_plane},
                  {"MC-STRATSTEP", "Var_1D", spread_of_strata, &on_step},
                  {"MC-STRATSTEP", "Var_2D", spread_of_grids, &on_step}};
    const row *r;
    int k, at;
    for (k = 0; k < 5; k++)
        for (at = 0; (r = next_row(kinds[k].table, kinds[k].quantity, &at)) != NULL;) {
            const uint32_t n = (uint32_t)parameter(r, "N");
            expect_spread(r, kinds[k].of, kinds[k].j, n, (uint64_t)(200000 + 10000 * k + 2000 * (at % 5)));
        }
}

static void scrambled_variances(void)
{
    pt_test_source("tests/data/oracles_mc.csv: MC-OWEN (gain coefficients, Owen 1997)");
    static const char *const quantities[3] = {"Var_x", "Var_xplusy", "Var_centredproduct"};
    static const job *const on[3] = {&on_line, &on_plane, &on_saddle};
    const row *r;
    int k, at;
    for (k = 0; k < 3; k++)
        for (at = 0; (r = next_row("MC-OWEN", quantities[k], &at)) != NULL;) {
            const int m = (int)parameter(r, "m");
            expect_spread(r, spread_of_nets, on[k], 1u << m, (uint64_t)(260000 + 10000 * k + 1000 * m));
        }
}

/* Numbers of the points themselves: nothing random. The squared discrepancy after Warnock. */
static double star_discrepancy(const double *x, const double *y, int n)
{
    double single = 0, pairs = 0;
    int i, j;
    for (i = 0; i < n; i++) {
        single += (1 - x[i] * x[i]) * (1 - y[i] * y[i]);
        for (j = 0; j < n; j++)
            pairs += (1 - (x[i] > x[j] ? x[i] : x[j])) * (1 - (y[i] > y[j] ? y[i] : y[j]));
    }
    return sqrt(1.0 / 9 - single / (2.0 * n) + pairs / ((double)n * n));
}

static void hammersley(void)
{
    static double x[4096], y[4096];
    const row *r;
    int at = 0;
    while ((r = next_row("MC-QMC", "vdC_mean_x", &at)) != NULL) {
        const int n = 1 << (int)parameter(r, "m");
        double mean = 0, product_mean = 0;
        int i;
        for (i = 0; i < n; i++) {
            x[i] = (double)i / n;
            y[i] = pt_sobol_u32((uint32_t)i, 0) * 0x1p-32;
            mean += y[i] / n;
            product_mean += x[i] * y[i] / n;
        }
        near_relative(r->id, mean, r->value, 1e-15);
        near_relative("mean of x y", product_mean, find_row("MC-QMC", "Hammersley_mean_xy", r->params)->value,
                      1e-15);
        near_relative("star discrepancy", star_discrepancy(x, y, n),
                      find_row("MC-QMC", "Hammersley_L2star", r->params)->value, 1e-8);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   The variance of well-spread points from the means of f over boxes of the unit square, 2^-j wide and 2^-k
   high. */

typedef double (*box_mean)(double x0, double x1, double y0, double y1);

static double mean_exponential(double x0, double x1, double y0, double y1) /* of e^x */
{
    (void)y0;
    (void)y1;
    return (exp(x1) - exp(x0)) / (x1 - x0);
}
static double mean_saddle(double x0, double x1, double y0, double y1)
{
    return (0.5 * (x0 + x1) - 0.5) * (0.5 * (y0 + y1) - 0.5);
}
static double mean_edge(double x0, double x1, double y0, double y1) /* of x < 0.3 */
{
    (void)y0;
    (void)y1;
    return fmin(fmax((0.3 - x0) / (x1 - x0), 0), 1);
}
static double mean_peak(double x0, double x1, double y0, double y1)
{
    return (atan(x1 - 0.3) - atan(x0 - 0.3)) / (x1 - x0) * (atan(y1 - 0.3) - atan(y0 - 0.3)) / (y1 - y0);
}
static double under_circle(double x) { return 0.5 * (x * sqrt(1 - x * x) + asin(x)); }
static double mean_disk(double x0, double x1, double y0, double y1) /* of x^2 + y^2 < 1 */
{
    const double full = fmin(fmax(sqrt(1 - fmin(y1 * y1, 1)), x0), x1); /* up to here the box is covered, */
    const double none = fmin(fmax(sqrt(1 - fmin(y0 * y0, 1)), x0), x1); /* and from here on empty         */
    const double area =
        (full - x0) * (y1 - y0) + under_circle(none) - under_circle(full) - (none - full) * y0;
    return area / ((x1 - x0) * (y1 - y0));
}

/* The mean of the squares of the means over all boxes */
static double power_of_boxes(box_mean mean, int j, int k)
{
    const double w = ldexp(1, -j), h = ldexp(1, -k);
    double sum = 0;
    int x, y;
    for (x = 0; x < 1 << j; x++)
        for (y = 0; y < 1 << k; y++) sum += pow(mean(x * w, (x + 1) * w, y * h, (y + 1) * h), 2);
    return sum * w * h;
}

/* One point in each of 2^j times 2^k boxes; square: the integral of f^2 */
static double variance_of_boxes(box_mean mean, double square, int j, int k)
{
    return (square - power_of_boxes(mean, j, k)) * ldexp(1, -j - k);
}

/* Owen's scrambled net of 2^m points in the square, base 2: what f has between scales (j, k) and the next
   finer ones in each coordinate counts in full if j + k >= m, twice if j + k = m - 1, not at all below (A.
   Owen, Monte Carlo Variance of Scrambled Net Quadrature, 1997; these are the gains of a (0,m,2)-net). */
static double variance_of_net(box_mean mean, double square, int m)
{
    double left = square - power_of_boxes(mean, 0, 0);
    int j, k;
    left -= power_of_boxes(mean, m, 0) - power_of_boxes(mean, 0, 0);
    left -= power_of_boxes(mean, 0, m) - power_of_boxes(mean, 0, 0);
    for (j = 0; j < m; j++)
        for (k = 0; j + k < m; k++) {
            const double detail = power_of_boxes(mean, j + 1, k + 1) - power_of_boxes(mean, j, k + 1) -
                                  power_of_boxes(mean, j + 1, k) + power_of_boxes(mean, j, k);
            left -= j + k == m - 1 ? -detail : detail;
        }
    return left * ldexp(1, -m);
}

static void variances_of_boxes(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("MC-OWEN", "Var_centredproduct", &at)) != NULL)
        near_relative("scrambled net, (x-1/2)(y-1/2)",
                      variance_of_net(mean_saddle, 1.0 / 144, (int)parameter(r, "m")), r->value, 1e-9);
    for (at = 0; (r = next_row("MC-STRATSTEP", "Var_2D", &at)) != NULL;) {
        const int k = (int)(log(parameter(r, "N")) / log(4) + 0.5);
        if (fabs(parameter(r, "a") - 0.3) < 1e-9)
            near_relative("cells, x < 0.3", variance_of_boxes(mean_edge, 0.3, k, k), r->value, 1e-9);
    }
    pt_check_near("quarter disk from its boxes", mean_disk(0, 1, 0, 1), 0.25 * PT_PI, 1e-15,
                  "the means over boxes are wrong");
}

/* ---------------------------------------------------------------------------------------------------------
   Orders of convergence: slopes of log(standard deviation) over log(n) for n, 4n, 16n by least squares. Each
   regression has its own seeds, so the regressions are independent and Student's t judges their mean. What
   the logarithm of an estimated variance is off by depends on n through the kurtosis of a mean alone: with
   32 means, by (kurtosis - 3) / 64, and that of n or so terms is at most 0.4 from 3 here: 0.001 in a slope. */

typedef struct order_case {
    const char *name;
    spread of;
    const job *j;
    uint32_t n;
    double order;  /* theory, for large n            */
    double at_16;  /* exact variance for 16 points,  */
    double at_256; /* and for 256; 0: of order n^-1  */
} order_case;

static void one_order(const order_case *o, int too_slow, uint64_t seed)
{
    const uint32_t regressions = pt_test_samples(384);
    const double exact = o->at_16 > 0 ? 0.5 * log(o->at_256 / o->at_16) / log(16) : o->order;
    pt_stats slopes = PT_STATS_INIT;
    double half;
    uint32_t i;
    for (i = 0; i < regressions; i++, seed += 3) {
        const double few = o->of(o->j, o->n, seed), many = o->of(o->j, 16 * o->n, seed + 2);
        /* of three equally spaced points, the one in the middle does not tilt the line */
        pt_stats_add(&slopes, 0.5 * log(many / few) / log(16));
    }
    half = pt_stats_interval(&slopes, 0.99);
    printf("shown  %-48s n^%.4f to n^%.4f with confidence 99 %%, here n^%.4f, in the end n^%.4f\n", o->name,
           slopes.mean - half, slopes.mean + half, exact, o->order);
    pt_check_mean(o->name, &slopes, exact, 0.001, 0.06, PT_TEST_MEANS,
                  "the error falls in another order: are the points one to a cell, and the cells scrambled?");
    if (too_slow)
        pt_check_rejects_mean("which is not n^-1/2", &slopes, -0.5, 0, PT_TEST_MEANS,
                              "a test that takes these points for independent ones sees nothing");
}

/* Between 16 and 256 points the orders are not yet those of large n: the centred product has a logarithm in
   its order, a curved edge cuts cells irregularly. The exact variances say what the slope must be. */
static void orders(void)
{
    pt_test_source("n^-1/2, or the slope between exact variances: means over boxes, gains of a scrambled net "
                   "(Owen 1997)");
    static const job bend = {.name = "e^x", .how = MEAN, .f = exponential, .a = {1}, .dimensions = 1};
    static const job disk = {.name = "disk", .how = MEAN, .f = ball, .a = {2}, .dimensions = 2};
    static const job peak = {
        .name = "peak", .how = MEAN, .f = product_peak, .a = {2, 1, 0.3}, .dimensions = 2};
    /* integrals of the squares of f: of 1/(1 + x^2)^2 it is (x/(1 + x^2) + atan x)/2 */
    const double e2 = 0.5 * (exp(2) - 1), quarter = 0.25 * PT_PI;
    const double p2 = pow(0.5 * (0.7 / 1.49 + atan(0.7) + 0.3 / 1.09 + atan(0.3)), 2);
    const order_case cases[9] = {
        {"order: independent, e^x", spread_of_runs, &bend, 32, -0.5, 0, 0},
        {"order: independent, quarter disk", spread_of_runs, &disk, 32, -0.5, 0, 0},
        {"order: strata on a line, e^x", spread_of_strata, &bend, 16, -1.5,
         variance_of_boxes(mean_exponential, e2, 4, 0), variance_of_boxes(mean_exponential, e2, 8, 0)},
        {"order: cells in a square, peak", spread_of_grids, &peak, 16, -1,
         variance_of_boxes(mean_peak, p2, 2, 2), variance_of_boxes(mean_peak, p2, 4, 4)},
        {"order: cells in a square, straight edge", spread_of_grids, &on_step, 16, -0.75,
         variance_of_boxes(mean_edge, 0.3, 2, 2), variance_of_boxes(mean_edge, 0.3, 4, 4)},
        {"order: cells in a square, quarter disk", spread_of_grids, &disk, 16, -0.75,
         variance_of_boxes(mean_disk, quarter, 2, 2), variance_of_boxes(mean_disk, quarter, 4, 4)},
        {"order: scrambled on a line, e^x", spread_of_nets, &bend, 16, -1.5,
         variance_of_boxes(mean_exponential, e2, 4, 0), variance_of_boxes(mean_exponential, e2, 8, 0)},
        {"order: scrambled in a square, (x-1/2)(y-1/2)", spread_of_nets, &on_saddle, 16, -1.5,
         variance_of_net(mean_saddle, 1.0 / 144, 4), variance_of_net(mean_saddle, 1.0 / 144, 8)},
        {"order: scrambled in a square, quarter disk", spread_of_nets, &disk, 16, -0.75,
         variance_of_net(mean_disk, quarter, 4), variance_of_net(mean_disk, quarter, 8)}};
    int i;
    for (i = 0; i < 9; i++) one_order(&cases[i], i >= 2, (uint64_t)(300000 + 2000 * i));
}

/* ---------------------------------------------------------------------------------------------------------
   What an estimate reports */

static double counted(const double *u, void *user)
{
    ((double *)user)[0]++;
    return exp(u[0]);
}

static void bookkeeping(void)
{
    double calls = 0;
    pt_integral p = {counted, &calls, 1, 1000, PT_SAMPLER_INDEPENDENT, 7};
    power_law flat = {0, 1}, ramp = {1, 1};
    const pt_technique t[2] = {{power_warp, power_density, &flat}, {power_warp, power_density, &ramp}};
    static const int counts[2] = {2, 3};
    static const double shares[2] = {0.25, 0.75};
    pt_estimate e, again;
    double before, used;
    pt_estimate_roulette(&p, 0.3, &e);
    pt_check(e.evaluations == calls && calls < 400, "evaluations of roulette", "%g, not %g", e.evaluations,
             calls);
    calls = 0;
    pt_estimate_mis(&p, t, counts, 2, PT_HEURISTIC_POWER, &e);
    pt_check(e.evaluations == calls && calls == 5000, "evaluations of MIS", "%g, not %g", e.evaluations,
             calls);
    calls = 0;
    pt_estimate_mis_one(&p, t, shares, 2, PT_HEURISTIC_POWER, &e);
    pt_check(e.evaluations == calls && calls == 1000, "evaluations of one-sample MIS", "%g, not %g",
             e.evaluations, calls);
    calls = 0;
    pt_estimate_control(&p, exponential, 1.7, 0.5, &e); /* g is not f */
    pt_check(e.evaluations == 1000, "evaluations with a control variate", "%g", e.evaluations);
    p.n = 1 << 21; /* more than a tick of a coarse clock */
    before = pt_cpu_seconds();
    pt_estimate_mean(&p, &e);
    used = pt_cpu_seconds() - before;
    pt_check(e.seconds > 0 && e.seconds <= used, "seconds", "%g s of %g s", e.seconds, used);
    near_relative("efficiency is 1 / (standard error^2 seconds)",
                  e.efficiency * e.standard_error * e.standard_error * e.seconds, 1, 1e-14);
    near_relative("standard error is that of the units", e.standard_error, pt_stats_standard_error(&e.units),
                  1e-15);
    pt_check(e.value == e.units.mean && e.units.n == p.n, "value is the mean of the units", "%g of %g units",
             e.value, e.units.n);
    pt_estimate_mean(&p, &again);
    pt_check(again.value == e.value, "the same seed, the same estimate", "%.17g and %.17g", e.value,
             again.value);
    p.seed = 8;
    pt_estimate_mean(&p, &again);
    pt_check(again.value != e.value, "another seed, another estimate", "the same %.17g", e.value);
    p.sampler = PT_SAMPLER_SOBOL;
    p.n = 1000;
    pt_estimate_mean(&p, &e);
    pt_check(e.units.n == 32 && e.evaluations == 992, "randomised point sets", "%g sets, %g evaluations",
             e.units.n, e.evaluations);
}

static int refuses(pt_result r) { return r == PT_ERROR_ARGUMENT; }

static void refusals_by_all(const char *what, const pt_integral *p)
{
    power_law flat = {0, 1};
    const pt_technique t = {power_warp, power_density, &flat};
    static const int one = 1;
    static const double all = 1;
    pt_estimate e;
    pt_check(refuses(pt_estimate_mean(p, &e)), what, "accepted by pt_estimate_mean");
    pt_check(refuses(pt_estimate_antithetic(p, &e)), what, "accepted by pt_estimate_antithetic");
    pt_check(refuses(pt_estimate_importance(p, &t, &e)), what, "accepted by pt_estimate_importance");
    pt_check(refuses(pt_estimate_control(p, line, 0.5, 1, &e)), what, "accepted by pt_estimate_control");
    pt_check(refuses(pt_estimate_mis(p, &t, &one, 1, PT_HEURISTIC_POWER, &e)), what,
             "accepted by pt_estimate_mis");
    pt_check(refuses(pt_estimate_mis_one(p, &t, &all, 1, PT_HEURISTIC_POWER, &e)), what,
             "accepted by pt_estimate_mis_one");
    pt_check(refuses(pt_estimate_roulette(p, 0.5, &e)), what, "accepted by pt_estimate_roulette");
    pt_check(refuses(pt_estimate_splitting(p, 1, 2, &e)), what, "accepted by pt_estimate_splitting");
}

static void refused_techniques(void)
{
    double a[3] = {2, 0, 0};
    const pt_integral p = {sum_of, a, 2, 100, PT_SAMPLER_INDEPENDENT, 0};
    power_law flat = {0, 2};
    const pt_technique one = {power_warp, power_density, &flat};
    pt_technique t[9];
    int counts[9] = {1, 1, 1, 1, 1, 1, 1, 1, 1}, none[2] = {0, 0}, negative[2] = {2, -1}, i, huge[2] = {2147483647, 2147483647};
    double shares[9] = {0.5, 0.5, 0, 0, 0, 0, 0, 0, 0}, more[2] = {0.5, 0.75}, below[2] = {1.5, -0.5},
           nan_share[2] = {0.5, (double)NAN};
    const pt_heuristic h = PT_HEURISTIC_BALANCE;
    pt_estimate e;
    for (i = 0; i < 9; i++) t[i] = one;
    pt_check(pt_estimate_mis(&p, t, counts, 8, h, &e) == PT_OK, "eight techniques", "refused");
    pt_check(pt_estimate_mis_one(&p, t, shares, 8, h, &e) == PT_OK, "eight shares", "refused");
    pt_check(refuses(pt_estimate_mis(&p, t, counts, 9, h, &e)), "nine techniques", "accepted");
    pt_check(refuses(pt_estimate_mis_one(&p, t, shares, 9, h, &e)), "nine shares", "accepted");
    pt_check(refuses(pt_estimate_mis(&p, t, counts, 0, h, &e)), "no technique", "accepted");
    pt_check(refuses(pt_estimate_mis(&p, NULL, counts, 1, h, &e)), "NULL techniques", "accepted");
    pt_check(refuses(pt_estimate_mis(&p, t, NULL, 1, h, &e)), "NULL counts", "accepted");
    pt_check(refuses(pt_estimate_mis_one(&p, t, NULL, 1, h, &e)), "NULL shares", "accepted");
    pt_check(refuses(pt_estimate_importance(&p, NULL, &e)), "NULL technique", "accepted");
    pt_check(refuses(pt_estimate_mis(&p, t, none, 2, h, &e)), "no samples of any technique", "accepted");
    pt_check(refuses(pt_estimate_mis(&p, t, negative, 2, h, &e)), "a negative number of samples", "accepted");
    pt_check(refuses(pt_estimate_mis(&p, t, huge, 2, h, &e)), "counts whose sum overflows", "accepted");
    pt_check(refuses(pt_estimate_mis_one(&p, t, more, 2, h, &e)), "shares that sum to 1.25", "accepted");
    pt_check(refuses(pt_estimate_mis_one(&p, t, below, 2, h, &e)), "a negative share", "accepted");
    pt_check(refuses(pt_estimate_mis_one(&p, t, nan_share, 2, h, &e)), "a share that is NaN", "accepted");
}

static void refusals(void)
{
    double a[3] = {2, 0, 0};
    const pt_integral good = {sum_of, a, 2, 100, PT_SAMPLER_INDEPENDENT, 0};
    pt_integral p = good;
    pt_estimate e;
    p.f = NULL;
    refusals_by_all("no integrand", &p);
    p = good;
    p.dimensions = 0;
    refusals_by_all("0 dimensions", &p);
    p.dimensions = 65;
    refusals_by_all("65 dimensions", &p);
    p = good;
    p.n = 31;
    refusals_by_all("31 values", &p);
    p = good;
    p.sampler = PT_SAMPLER_GIVEN;
    refusals_by_all("given numbers", &p);
    p.sampler = (pt_sampler_kind)17;
    refusals_by_all("an unknown sampler", &p);
    pt_check(refuses(pt_estimate_control(&good, NULL, 0.5, 1, &e)), "no control variate", "accepted");
    pt_check(refuses(pt_estimate_control(&good, line, (double)NAN, 1, &e)), "unknown integral of g",
             "accepted");
    pt_check(refuses(pt_estimate_control(&good, line, 0.5, HUGE_VAL, &e)), "infinite coefficient",
             "accepted");
    pt_check(refuses(pt_estimate_roulette(&good, 0, &e)), "q = 0", "accepted");
    pt_check(refuses(pt_estimate_roulette(&good, 1.001, &e)), "q > 1", "accepted");
    pt_check(refuses(pt_estimate_roulette(&good, (double)NAN, &e)), "q = NaN", "accepted");
    pt_check(refuses(pt_estimate_splitting(&good, 0, 2, &e)), "nothing drawn once", "accepted");
    pt_check(refuses(pt_estimate_splitting(&good, 2, 2, &e)), "nothing left to split", "accepted");
    pt_check(refuses(pt_estimate_splitting(&good, 1, 0, &e)), "split into none", "accepted");
    refused_techniques();
}

static void maximum_heuristic(void)
{
    const pt_heuristic h = PT_HEURISTIC_MAXIMUM;
    pt_check(pt_mis_weight(2, 1, h) == 1 && pt_mis_weight(1, 2, h) == 0, "maximum heuristic",
             "all to the larger density");
    pt_check(pt_mis_weight(1, 1, h) > 0.49 && pt_mis_weight(1, 1, h) < 0.51, "maximum heuristic",
             "equal densities share");
    pt_check(pt_mis_weight(0, 0, h) == 0 && pt_mis_weight(0, 1, h) == 0, "maximum heuristic",
             "density 0 gives 0");
}

/* ---------------------------------------------------------------------------------------------------------
   Wrong estimators of the integral of x^2 over [0,1], 1/3: all must be found out. */

static double roulette_unweighted(const double *u, void *user)
{
    (void)user;
    return u[0] < 0.8 ? u[1] * u[1] : 0;
}

/* x has density 1, y has 2y; weights a[0] and a[1]: 0 power, 1 balance, 2 one (each counted in full) */
static double two_techniques(const double *u, void *user)
{
    static const pt_heuristic heuristics[2] = {PT_HEURISTIC_POWER, PT_HEURISTIC_BALANCE};
    const double *const a = (const double *)user;
    const double x = u[0], y = sqrt(1 - u[1]);
    const double wx = a[0] > 1 ? 1 : pt_mis_weight(1, 2 * x, heuristics[(int)a[0]]);
    const double wy = a[1] > 1 ? 1 : pt_mis_weight(2 * y, 1, heuristics[(int)a[1]]);
    return wx * x * x + wy * y / 2;
}

static void upper_half(const double *u, double *x, void *user)
{
    (void)user;
    x[0] = 0.5 + 0.5 * u[0];
}
static double two(const double *x, void *user)
{
    (void)x;
    (void)user;
    return 2;
}
/* of points that have density 2x */
static double wrong_density(const double *x, void *user)
{
    (void)user;
    return 2.05 * x[0];
}

static void expect_wrong(const char *name, const pt_estimate *e)
{
    pt_check_rejects_mean(name, &e->units, 1.0 / 3, 0, PT_TEST_VALUES, "a wrong estimator passed the test");
}

static void wrong_estimators(void)
{
    pt_test_source("elementary integrals; WRONG ones must be rejected");
    static const double weights[5][2] = {{1, 1}, {0, 0}, {1, 0}, {0, 1}, {2, 2}};
    static const char *const names[5] = {"balance weights", "power weights", "WRONG: balance beside power",
                                         "WRONG: power beside balance", "WRONG: two techniques in full"};
    double a[3] = {2, 0, 0};
    power_law ramp = {1, 1};
    const pt_technique half = {upper_half, two, NULL}, wrong = {power_warp, wrong_density, &ramp};
    const pt_technique overlap[2] = {{power_warp, power_density, &ramp}, {power_warp, wrong_density, &ramp}};
    static const int counts[2] = {1, 1};
    pt_integral p = {roulette_unweighted, a, 2, 1u << 16, PT_SAMPLER_INDEPENDENT, pt_test_seed(400000)};
    pt_estimate e;
    int i;
    pt_estimate_mean(&p, &e);
    expect_wrong("WRONG: roulette without 1/q", &e);
    p.f = two_techniques;
    p.user = a;
    for (i = 0; i < 5; i++) {
        memcpy(a, weights[i], sizeof weights[i]);
        p.seed++;
        pt_estimate_mean(&p, &e);
        if (i > 1)
            expect_wrong(names[i], &e);
        else
            pt_check_mean(names[i], &e.units, 1.0 / 3, 0, 0.05, PT_TEST_VALUES,
                          "at each point the weights of the techniques must sum to 1");
    }
    p.f = power_of;
    p.dimensions = 1;
    a[0] = 2;
    pt_estimate_importance(&p, &wrong, &e);
    expect_wrong("WRONG: importance with another density", &e);
    pt_estimate_importance(&p, &half, &e);
    expect_wrong("WRONG: a density that is 0 where f is not", &e);
    pt_estimate_mis(&p, overlap, counts, 2, PT_HEURISTIC_BALANCE, &e);
    expect_wrong("WRONG: MIS with another density", &e);
    pt_estimate_control(&p, line, 0.51, 1, &e);
    expect_wrong("WRONG: control variate of unknown integral", &e);
}

/* ---------------------------------------------------------------------------------------------------------
   Statistics: quantiles, p-values, intervals */

static void critical_values(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("ST-Z", "z_Bonferroni", &at)) != NULL) {
        const double level = parameter(r, "alpha"), m = parameter(r, "m");
        const row *const sidak = find_row("ST-Z", "z_Sidak", r->params);
        near_relative(r->id, pt_normal_isf(0.5 * level / m), r->value, 1e-14);
        near_relative(sidak->id, pt_normal_isf(-0.5 * expm1(log1p(-level) / m)), sidak->value, 1e-14);
        near_relative(r->id, 2 * pt_normal_sf(r->value), level / m, 1e-13);
    }
    for (at = 0; (r = next_row("ST-N", "N", &at)) != NULL;) /* level 1e-4, power 0.99 */
        near_relative(
            r->id,
            pow((pt_normal_isf(0.5e-4) + pt_normal_isf(0.01)) * parameter(r, "cv") / parameter(r, "delta"),
                2),
            r->value, 1e-13);
    for (at = 0; (r = next_row("ST-BIAS", "delta", &at)) != NULL;)
        near_relative(r->id,
                      (pt_normal_isf(0.5e-4 / parameter(r, "m")) + pt_normal_isf(0.01)) * parameter(r, "cv") /
                          sqrt(parameter(r, "N")),
                      r->value, 1e-13);
}

/* n values of standard error 1 around `mean` */
static pt_stats unit_error(double n, double mean)
{
    pt_stats s = PT_STATS_INIT;
    s.n = n;
    s.mean = mean;
    s.m2 = n * (n - 1);
    return s;
}

static void p_values_of_rows(void)
{
    double observed[1024], expected[1024];
    const row *r;
    int at = 0, i;
    while ((r = next_row("ST-T", "t", &at)) != NULL) {
        const double df = parameter(r, "df"), level = parameter(r, "alpha") / parameter(r, "m");
        const pt_stats s = unit_error(df + 1, 5 + r->value), half = unit_error(df / 2 + 1, 3),
                       other = unit_error(df / 2 + 1, 3 - r->value * 1.4142135623730950);
        near_relative(r->id, pt_p_value_mean(&s, 5), level, 1e-10);
        near_relative(r->id, pt_p_value_mean(&s, 5 + 2 * r->value), level, 1e-10);
        near_relative(r->id, pt_stats_interval(&s, 1 - level), r->value, 1e-9);
        /* two samples of equal size and variance: df = 2 (n - 1), the difference has error sqrt 2 */
        near_relative(r->id, pt_p_value_equal_means(&half, &other), level, 1e-10);
        near_relative(r->id, pt_p_value_equal_means(&other, &half), level, 1e-10);
    }
    for (at = 0; (r = next_row("ST-CHI2", "chi2", &at)) != NULL;) {
        const int cells = (int)parameter(r, "df") + 1;
        const double shift = sqrt(0.5 * r->value * 1e4);
        for (i = 0; i < cells; i++) observed[i] = expected[i] = 1e4;
        observed[0] += shift;
        observed[cells - 1] -= shift;
        near_relative(r->id, pt_p_value_counts(observed, expected, cells), parameter(r, "alpha"), 1e-10);
    }
}

static void p_values_by_hand(void)
{
    static const double expected[6] = {2, 3, 10, 4, 6, 1}, observed[6] = {4, 4, 8, 3, 6, 1},
                        few[3] = {1, 1, 2};
    static const double first[3] = {1, 2, 4}, a[2] = {0, 2}, b[2] = {3, 5};
    pt_stats s = PT_STATS_INIT, sa = PT_STATS_INIT, sb = PT_STATS_INIT, same = PT_STATS_INIT,
             one = PT_STATS_INIT;
    const double t = 4 / sqrt(7), w = 3 / sqrt(2);
    int i;
    for (i = 0; i < 3; i++) pt_stats_add(&s, first[i]);
    for (i = 0; i < 2; i++) {
        pt_stats_add(&sa, a[i]);
        pt_stats_add(&sb, b[i]);
        pt_stats_add(&same, 3);
    }
    pt_stats_add(&one, 3);
    /* two degrees of freedom: P(|T| > t) = 2 / (r (r + t)) with r = sqrt(t^2 + 2) */
    near_relative("p of a mean", pt_p_value_mean(&s, 1), 2 / (sqrt(t * t + 2) * (sqrt(t * t + 2) + t)),
                  1e-13);
    near_relative("p of two means", pt_p_value_equal_means(&sa, &sb),
                  2 / (sqrt(w * w + 2) * (sqrt(w * w + 2) + w)), 1e-13);
    /* only one of them spreads: Satterthwaite gives its one degree of freedom */
    near_relative("p of two means, Satterthwaite", pt_p_value_equal_means(&sa, &same), 2 * atan(0.5) / PT_PI,
                  1e-13);
    pt_check(pt_p_value_mean(&s, s.mean) == 1 && pt_p_value_equal_means(&sa, &sa) == 1, "no deviation",
             "p is not 1");
    pt_check(pt_p_value_mean(&same, 3) == 1 && pt_p_value_mean(&same, 3.5) == 0, "no spread",
             "p must be 1 or 0");
    pt_check(pt_p_value_equal_means(&same, &same) == 1, "equal, no spread", "p must be 1");
    pt_check(pt_p_value_mean(&one, 7) == 1 && pt_p_value_equal_means(&one, &sa) == 1, "one value",
             "p must be 1");
    /* pooled: 5, 10, 10 + 1 are expected, 8, 8, 10 seen */
    near_relative("p of counts", pt_p_value_counts(observed, expected, 6),
                  exp(-0.5 * (9.0 / 5 + 4.0 / 10 + 1.0 / 11)), 1e-13);
    pt_check(pt_p_value_counts(expected, expected, 6) == 1, "counts as expected", "p must be 1");
    pt_check(pt_p_value_counts(few, few, 3) == 1, "too few for two cells", "p must be 1");
    pt_check(isinf(pt_stats_interval(&one, 0.9)), "interval of one value", "must be infinite");
    pt_check_near("interval without spread", pt_stats_interval(&same, 0.9), 0, 0,
                  "t times standard error: without spread both ends are the mean");
    near_relative("interval, two degrees of freedom", pt_stats_interval(&s, 0.9),
                  0.9 * sqrt(2 / (1 - 0.81)) * sqrt(7) / 3, 1e-12); /* t = c sqrt(2 / (1 - c^2)) */
}

static double normal_number(pt_pcg32 *rng)
{
    const double u = pt_pcg32_double(rng), v = pt_pcg32_double(rng);
    return sqrt(-2 * log(1 - u)) * cos(2 * PT_PI * v);
}

static pt_stats normal_sample(pt_pcg32 *rng, int n, double mean, double deviation)
{
    pt_stats s = PT_STATS_INIT;
    for (; n > 0; n--) pt_stats_add(&s, mean + deviation * normal_number(rng));
    return s;
}

/* P(sqrt(n) D > c) of Kolmogorov's statistic, n large */
static double kolmogorov_sf(double c)
{
    double sum = 0, sign = 1;
    int k;
    for (k = 1; k <= 20; k++, sign = -sign) sum += 2 * sign * exp(-2.0 * k * k * c * c);
    return sum;
}

/* Are p-values uniform? By 32 equal cells, and by the greatest distance from the straight line. */
static void expect_uniform_p(const char *name, double *p, uint32_t n)
{
    double counts[32] = {0}, expected[32], distance = 0, tail;
    uint32_t i;
    for (i = 0; i < n; i++) counts[p[i] < 1 ? (int)(32 * p[i]) : 31]++;
    for (i = 0; i < 32; i++) expected[i] = n / 32.0;
    pt_check_chi2(name, counts, expected, 32, "p-values under the null hypothesis must be uniform");
    qsort(p, n, sizeof p[0], by_size);
    for (i = 0; i < n; i++) {
        distance = fmax(distance, fabs(p[i] - (double)i / n));
        distance = fmax(distance, fabs(p[i] - (double)(i + 1) / n));
    }
    tail = kolmogorov_sf(distance * sqrt((double)n));
    pt_test.statistical++;
    printf("%s %-48s n %-8.0f Kolmogorov's distance %.3g  p %.3g\n", pt_test_count(!(tail < pt_test_level())),
           name, (double)n, distance, tail);
}

#define P_VALUES 32768u
static double p_values[P_VALUES];

static void p_of_means(void)
{
    pt_test_source("p-values under the null hypothesis are uniform");
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(410000), 1);
    const uint32_t n = pt_test_all_samples(P_VALUES);
    uint32_t i;
    for (i = 0; i < n; i++) {
        const pt_stats s = normal_sample(&rng, 5, 7, 2);
        p_values[i] = pt_p_value_mean(&s, 7);
    }
    expect_uniform_p("p of a mean of five", p_values, n);
    for (i = 0; i < n / 4; i++) {
        const pt_stats a = normal_sample(&rng, 20, 7, 1), b = normal_sample(&rng, 6, 7, 3);
        p_values[i] = pt_p_value_equal_means(&a, &b);
    }
    expect_uniform_p("p of two means, unlike variances", p_values, n / 4);
}

/* Cells that expect 4, 4, 4, 52, 256, ..., 4 of 8192: those below 5 are pooled */
static void throw_counts(pt_pcg32 *rng, uint32_t tilt, double *observed)
{
    static const uint32_t up_to[9] = {1, 2, 3, 16, 80, 336, 848, 2047, 2048};
    uint32_t i, cell, at;
    for (cell = 0; cell < 9; cell++) observed[cell] = 0;
    for (i = 0; i < 8192; i++) {
        at = pt_pcg32_next(rng) >> 21;
        if (tilt && i % tilt == 0) at /= 2;
        for (cell = 8; cell > 0 && at < up_to[cell - 1]; cell--) {
        }
        observed[cell]++;
    }
}

static void p_of_counts(void)
{
    pt_test_source("p-values under the null hypothesis are uniform");
    static const double expected[9] = {4, 4, 4, 52, 256, 1024, 2048, 4796, 4};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(420000), 1);
    const uint32_t n = pt_test_all_samples(4096);
    double observed[9];
    uint32_t i;
    for (i = 0; i < n; i++) {
        throw_counts(&rng, 0, observed);
        p_values[i] = pt_p_value_counts(observed, expected, 9);
    }
    expect_uniform_p("p of counts", p_values, n);
}

/* A bias of twelve standard errors */
static void p_of_wrong(void)
{
    static const double expected[9] = {4, 4, 4, 52, 256, 1024, 2048, 4796, 4};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(430000), 1);
    const pt_stats a = normal_sample(&rng, 10000, 7.12, 1), b = normal_sample(&rng, 10000, 6.95, 1);
    double observed[9];
    throw_counts(&rng, 6, observed);
    pt_check(pt_p_value_mean(&a, 7) < 1e-15, "p of a wrong mean", "%g", pt_p_value_mean(&a, 7));
    pt_check(pt_p_value_equal_means(&a, &b) < 1e-15, "p of unlike means", "%g",
             pt_p_value_equal_means(&a, &b));
    pt_check(pt_p_value_counts(observed, expected, 9) < 1e-10, "p of wrong counts", "%g",
             pt_p_value_counts(observed, expected, 9));
}

static void kolmogorov(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("ST-KS", "c", &at)) != NULL)
        near_relative(r->id, kolmogorov_sf(r->value), parameter(r, "alpha"), 1e-12);
}

static void coverage(void)
{
    pt_test_source("definition of a confidence interval");
    static const double confidence[2] = {0.5, 0.8};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(440000), 1);
    const uint32_t n = pt_test_all_samples(1u << 14);
    pt_stats covered[2] = {{0, 0, 0, 0}, {0, 0, 0, 0}};
    uint32_t i;
    int c;
    for (i = 0; i < n; i++) {
        const pt_stats s = normal_sample(&rng, 4, -3, 5);
        c = (int)(i % 2);
        pt_stats_add(&covered[c], fabs(s.mean + 3) <= pt_stats_interval(&s, confidence[c]));
    }
    for (c = 0; c < 2; c++)
        pt_check_mean("coverage of intervals of four values", &covered[c], confidence[c], 0, 0.1,
                      PT_TEST_VALUES,
                      "Student's t with n - 1 degrees of freedom, not the normal quantile: with n = 4 they "
                      "differ much");
}

/* How far sample variances of n values scatter, relative to the variance: this depends on the kurtosis. */
static double scatter(double n, double kurtosis) { return sqrt((kurtosis - (n - 3) / (n - 1)) / n); }

/* The kurtosis of uniform numbers is 1.8. */
static void variance_of_variance(void)
{
    pt_test_source("relative variance of s^2: (kurtosis - (n-3)/(n-1)) / n, kurtosis of uniform numbers 1.8");
    const uint32_t runs = pt_test_all_samples(1u << 15), n = 512;
    const double exact = scatter(n, 1.8);
    const row *r;
    pt_stats squares = PT_STATS_INIT;
    uint32_t i, k;
    int at = 0;
    while ((r = next_row("ST-POIS", "rel_sd", &at)) != NULL)
        near_relative(r->id, scatter(parameter(r, "N"), parameter(r, "kurtosis")), r->value, 1e-14);
    for (i = 0; i < runs; i++) {
        pt_pcg32 rng = pt_pcg32_make(pt_test_seed(450000 + (uint64_t)i), 1);
        pt_stats s = PT_STATS_INIT;
        for (k = 0; k < n; k++) pt_stats_add(&s, pt_pcg32_double(&rng));
        pt_stats_add(&squares, pow(12 * pt_stats_variance(&s) - 1, 2));
    }
    pt_check_mean(
        "scatter of sample variances, squared", &squares, exact * exact, 0, 0.1, PT_TEST_VALUES,
        "divide by n - 1; the scatter of a variance depends on the kurtosis, 1.8 for uniform numbers");
}

int main(int argc, char **argv)
{
    pt_test_begin("test_estimators", argc, argv);
    if (!load_rows(ROWS_PATH)) return pt_test_end();
    PT_TEST(one_dimension);
    PT_TEST(many_dimensions);
    PT_TEST(genz);
    PT_TEST_EXACT(zero_variance);
    PT_TEST_EXACT(second_moments);
    PT_TEST(peaks);
    PT_TEST(heavy_tails);
    PT_TEST(unbiased);
    PT_TEST(mis_variances);
    PT_TEST(importance_variances);
    PT_TEST(other_variances);
    PT_TEST(stratified_variances);
    PT_TEST(scrambled_variances);
    PT_TEST_EXACT(hammersley);
    PT_TEST_EXACT(variances_of_boxes);
    PT_TEST(orders);
    PT_TEST_EXACT(bookkeeping);
    PT_TEST_EXACT(refusals);
    PT_TEST_EXACT(maximum_heuristic);
    PT_TEST(wrong_estimators);
    PT_TEST_EXACT(critical_values);
    PT_TEST_EXACT(p_values_of_rows);
    PT_TEST_EXACT(p_values_by_hand);
    PT_TEST(p_of_means);
    PT_TEST(p_of_counts);
    PT_TEST_EXACT(p_of_wrong);
    PT_TEST_EXACT(kolmogorov);
    PT_TEST(coverage);
    PT_TEST(variance_of_variance);
    if (argc < 2) PT_TEST_EXACT(every_row_is_used);
    return pt_test_end();
}
