/* Lesson 07: probability and Monte Carlo

   QUESTION   How does a mean of random numbers become an integral, and how does it know its own error?

   IDEA       A probability density p(x) >= 0 with integral 1 says how often X is near x. The expected value of g(X) is
              the integral of g p. So for X_i drawn independently, with p > 0 wherever f is not 0,

                  F_N = (1/N) sum of f(X_i) / p(X_i),   E[F_N] = integral of f(x)/p(x) p(x) dx = integral of f

              whatever N is: the estimator is unbiased. (One that is biased, but less and less as N grows, is
              consistent.) For X uniform in [a, b] it is (b - a) times the mean of f. One value f/p has the variance
              s^2 = E[(f/p)^2] - (integral of f)^2 and the standard deviation s, a mean of N the root mean square error
              s / sqrt(N), its standard error; s^2 is estimated from the same values, as N/(N-1) (mean of squares -
              square of mean). This convergence is slow: four times the samples, and seconds, for half the error, slope
              -1/2 on log-log axes, but in any number of dimensions. Here f(x) = 4 sqrt(1 - x^2) on [0, 1], with the
              integral pi, by u, v uniform in [0, 1); the last p is large where f is:

                  darts     p = 1 on a square: 4 if u^2 + v^2 < 1, else 0    s^2 = pi (4 - pi)           = 2.697
                  uniform   p = 1, x = u                                     s^2 = 32/3 - pi^2           = 0.7971
                  falling   p = (4 - 2 x) / 3, x = 2 - sqrt(4 - 3 u)         s^2 = 60 - 72 ln 2 - pi^2   = 0.2238

   PICTURE    4000 darts, blue where they hit the quarter of a circle.
   PLOT       Upwards the root mean square error of 256 runs, divided by pi: the square root of relMSE.

   BUILD      cc -O2 -I.. 07_monte_carlo.c -o 07_monte_carlo -lm -pthread
   RUN        ./07_monte_carlo [samples] [output]

   PRINTS     estimator        samples     estimate        exact  std.error  seconds
              my darts            4096        3.125      3.14159      0.026    0.000
              my darts           65536      3.14417      3.14159     0.0064    0.001
              my darts         1048576        3.142      3.14159     0.0016    0.023

   WORDS      probability density 概率密度; expected value 期望; variance 方差; standard deviation 标准差; estimator 估计量;
              unbiased 无偏; biased 有偏; consistent 一致; Monte Carlo 蒙特卡洛; convergence 收敛;
              root mean square error 均方根误差

   HEADER     [PT-03] pt_stats_add, pt_estimate_mean, [PT-02] pt_sampler_2d, [PT-18] pt_report_write_svg

   SOURCES    [PBR] 2.1; Hammersley, Handscomb: Monte Carlo Methods, 1964; [Vea97] 2; [Che83]

   Before: lesson 06. Next: lesson 08, warps. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { SIZE = 240, ROWS = 8, RUNS = 256, MISTAKE = EX == 2 || EX == 3 };

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact,
           pt_stats_standard_error(s), seconds);
}

/* ---- mine: each function of two uniform numbers is one value f(X) / p(X) of an estimator ---- */

static double my_darts(pt_vec2 u) { return (double)u.x * (double)u.x + (double)u.y * (double)u.y < 1 ? 4 : 0; }

static double my_uniform(pt_vec2 u) { return 4 * sqrt(1 - (double)u.x * (double)u.x); }

static double my_falling(pt_vec2 u)
{
    double x = 2 - sqrt(4 - 3 * (double)u.x), p = (4 - 2 * x) / 3;
    return EX == 2 ? 4 * sqrt(1 - x * x) : 4 * sqrt(1 - x * x) / p;
}

/* Mean and standard error of n values, from two sums. (They lose digits if the mean is large and the deviations
   small; the header's pt_stats does not.) */
static double my_estimate(double (*value)(pt_vec2), double n, pt_sampler *random, double *error)
{
    double sum = 0, squares = 0, mean;
    for (double i = 0; i < n; i++) {
        double v = value(pt_sampler_2d(random));
        sum += v;
        squares += v * v;
    }
    mean = sum / n;
    *error = sqrt((squares / n - mean * mean) / (n - 1));
    if (EX == 3) *error *= sqrt(n); /* that is the deviation of one value */
    return mean;
}

/* ---- the header's ---- */

static double its_uniform(const double *u, void *user)
{
    (void)user;
    return 4 * sqrt(1 - u[0] * u[0]);
}

/* ---- both ---- */

/* Mine; the variance of one value must be that of the formula, and the error bars must be right. */
static void table(const char *name, double (*value)(pt_vec2), double variance, double most)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 9, 0);
    pt_stats s = PT_STATS_INIT, squared = PT_STATS_INIT;
    double seconds = pt_cpu_seconds(), error;
    int within1 = 0, within2 = 0;
    for (double n = floor(most / 256); n <= most; n *= 16) {
        while (s.n < n) {
            double v = value(pt_sampler_2d(&random));
            pt_stats_add(&s, v);
            pt_stats_add(&squared, (v - PT_PI) * (v - PT_PI));
        }
        row(name, &s, PT_PI, pt_cpu_seconds() - seconds);
    }
    check(fabs(s.mean - PT_PI) <= 5 * pt_stats_standard_error(&s), "within 5 standard errors of pi");
    check(fabs(squared.mean - variance) <= 5 * pt_stats_standard_error(&squared), "the variance is as computed");
    for (int run = 0; run < 1000; run++) { /* how often is the reported error right? */
        double off = fabs(my_estimate(value, 256, &random, &error) - PT_PI);
        within1 += off <= error;
        within2 += off <= 2 * error;
    }
    printf("of 1000 runs with 256 samples %d are within one standard error, %d within two\n", within1, within2);
    check(abs(within1 - 683) < 74 && abs(within2 - 954) < 34, "they should be 683 and 954, but for luck");
}

/* The header's. */
static void header_table(const char *name, pt_integrand value, double most)
{
    pt_integral p = {value, NULL, 1, 0, PT_SAMPLER_INDEPENDENT, 9};
    pt_estimate e = {0};
    for (p.n = (uint32_t)(most / 256); p.n <= most && pt_estimate_mean(&p, &e) == PT_OK; p.n *= 16)
        row(name, &e.units, PT_PI, e.seconds);
    check(fabs(e.value - PT_PI) <= 5 * e.standard_error, "within 5 standard errors of pi");
}

/* True error, over RUNS runs, against seconds per run; the slope against n is returned. */
static double curve(double (*value)(pt_vec2), pt_report *report, pt_report_row *rows)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 10, 0);
    for (int k = 0, n = 16; k < ROWS; k++, n *= 2) {
        double squares = 0, seconds = pt_cpu_seconds();
        for (int run = 0; run < RUNS; run++) {
            double sum = 0;
            for (int i = 0; i < n; i++) sum += value(pt_sampler_2d(&random));
            squares += pow(sum / n / PT_PI - 1, 2) / RUNS;
        }
        rows[k].cpu_seconds = (pt_cpu_seconds() - seconds) / RUNS;
        rows[k].has_true_error = 1;
        rows[k].true_error.relmse = squares;
    }
    report->rows = rows, report->row_count = ROWS;
    return 0.5 * log2(rows[ROWS - 1].true_error.relmse / rows[0].true_error.relmse) / (ROWS - 1);
}

/* Darts, and the plot of error against run time. */
static void picture(const char *output)
{
    static unsigned char rgb[SIZE * SIZE * 3];
    static pt_report_row rows[3][ROWS];
    static double (*const value[3])(pt_vec2) = {my_darts, my_uniform, my_falling};
    static const char *const labels[3] = {"darts", "uniform", "falling"};
    pt_report reports[3] = {PT_REPORT_INIT, PT_REPORT_INIT, PT_REPORT_INIT};
    const pt_report *all[3] = {&reports[0], &reports[1], &reports[2]};
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 11, 0);
    char path[1024];
    memset(rgb, 255, sizeof rgb);
    for (int i = 0; i < 4000; i++) {
        pt_vec2 u = pt_sampler_2d(&random);
        unsigned char *to = rgb + 3 * ((int)((1 - u.y) * (SIZE - (pt_real)0.5)) * SIZE + (int)(u.x * SIZE));
        to[1] = 60;
        to[my_darts(u) > 0 ? 0 : 2] = 0;
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, SIZE, SIZE) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, SIZE, SIZE) == PT_OK, "and as PNG");
    for (int k = 0; k < 3; k++) {
        double slope = curve(value[k], &reports[k], rows[k]);
        printf("%s: slope of log error over log samples %.2f\n", labels[k], slope);
        check(fabs(slope + 0.5) < 0.05, "-1/2, for good estimators and bad ones");
    }
    snprintf(path, sizeof path, "%s.svg", output);
    check(pt_report_write_svg(all, labels, 3, "pi: error against run time", path) == PT_OK, "the plot as SVG");
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 16384) : 1048576) / (getenv("SHORT") ? 16 : 1), mean, error;
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 9, 0);
    printf("%-14s %9s %12s %12s %10s %8s\n", "estimator", "samples", "estimate", "exact", "std.error", "seconds");
    table("my darts", my_darts, PT_PI * (4 - PT_PI), most);
    table("my uniform", my_uniform, 32 / 3.0 - PT_PI * PT_PI, most);
    table("my falling", my_falling, 60 - 72 * log(2) - PT_PI * PT_PI, most);
    header_table("pt uniform", its_uniform, most);
    printf("What to see: for one error darts take 12 times the samples, 8 times the seconds of the falling density.\n");
    if (EX == 1) {
        mean = my_estimate(my_darts, 2732, &random, &error);
        printf("2732 darts: %.4g, error %.2g %%\n", mean, 100 * error / PT_PI);
        check(fabs(error / PT_PI - 0.01) < 0.001, "2732 darts have a standard error of 1 % of pi");
    }
    picture(argc > 2 ? argv[2] : "07_monte_carlo");

    printf("lesson 07: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: how many darts until the standard error is 1 % of pi? (-DEX=1 throws that many.) Answer: pi (4 - pi) /
       (0.01 pi)^2 = 2732.
   (2) Break: forget to divide by p (-DEX=2): the mean is the integral of f p, 3.29990, with a small error bar; its line
       in the plot goes flat. Then report the deviation of one value as the error of the mean (-DEX=3): all runs are
       within it. An error bar that is always right is wrong.
   (3) Extend: antithetic samples, the mean of f(u) and f(1 - u) (pt_estimate_antithetic). Which variance has one
       such mean? Answer: 0.1097, 3.6 times less than half of 0.7971, that of two values independent of each other. */
