/* Lesson 09: importance sampling and stratification

   QUESTION   Where should samples go, and what is gained if they go there?

   IDEA       The estimator f(X) / p(X) is a constant if p is proportional to f: then one sample is enough,
              and its variance is 0. (To make p one needs the integral of f, which is wanted; but parts of f
              are known.) Irradiance below a sky of radiance L = cos^m t is E = integral of cos^m t cos t dw =
              2 pi / (m + 2), and

                  uniform  p = 1/(2 pi):         variance 4 pi^2 / (2 m + 3) - E^2
                  cosine   p = cos t / pi:       variance pi^2 / (m + 1) - E^2,     which is 0 for m = 0

              The same trick in the words of expectations: E_p[f] = integral of f p = E_q[f p / q], for every
              q that is positive wherever f p is not 0. What is rare under p may be common under q. P(X > 6)
              for p = e^-x is e^-6 = 0.00248: of a thousand samples 2 or 3 are there. Under q = e^(-x/6) / 6
              it is one in three, each with the weight p/q = 6 e^(-5 x/6):

                  plain    variance e^-6 (1 - e^-6)          = 0.00247
                  q        variance (36 / 11) e^-11 - e^-12  = 0.0000485

              Stratification asks everywhere once: n cells with one sample each. What is left is the variance
              within the cells, so for smooth f the error falls faster than n^(-1/2), in two dimensions like
              1/n.

   BUILD      cc -O2 -I.. 09_importance.c -o 09_importance -lm -pthread
   RUN        ./09_importance [samples] [output]

   PRINTS     estimator        samples     estimate        exact  std.error  seconds
              my uniform, 0       4096      3.12049      3.14159      0.028    0.000
              ...
              my cosine, 0        4096      3.14159      3.14159          0    0.000

   WORDS      importance sampling 重要性采样; stratified sampling 分层采样; variance reduction 方差缩减;
              low-discrepancy sequence 低差异序列; proposal density 提议密度; rare event 稀有事件; weight 权重

   HEADER     [PT-03] pt_estimate_mean, pt_estimate_importance, [PT-04] pt_warp_cosine, pt_warp_cosine_pdf_w,
              [PT-02] PT_SAMPLER_STRATIFIED, PT_SAMPLER_SOBOL, [PT-18] pt_report_write_svg

   SOURCES    Kahn, Marshall: Methods of Reducing Sample Size in Monte Carlo Computations, 1953; [PBR] 2.2;
              [Vea97] 2.4; the lecture's slide on accelerating a path tracer

   Before: lesson 08. Next: lesson 10, what a BRDF is. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { SIZE = 120, ROWS = 6, RUNS = 64, MISTAKE = EX == 2 || EX == 3 };

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%s %s\n", ok ? "ok    " : "FAIL  ", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    double error = pt_stats_standard_error(s);
    if (error < 1e-8) error = 0; /* rounding alone */
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact, error, seconds);
}

/* ---- mine: the value f / p for given uniform numbers u, v ---- */

static double sky = 0; /* m: the sky has radiance cos^m */

static double my_uniform(double u, double v)
{
    double z = u; /* the height of a uniform direction */
    (void)v;
    return pow(z, sky) * z / (1 / (2 * PT_PI));
}

static double my_cosine(double u, double v)
{
    double z = sqrt(EX == 2 ? 0.25 + 0.75 * u : u); /* EX 2: never further than 60 degrees from the zenith */
    (void)v;
    return pow(z, sky) * z / (z / PT_PI) * (EX == 2 ? 0.75 : 1);
}

/* Is X > 6? By p itself, and by q with the weight p / q. */
static double my_plain(double u, double v)
{
    (void)v;
    return -log(1 - u) > 6;
}

static double my_rare(double u, double v)
{
    double x = -6 * log(1 - u), p = exp(-x), q = exp(-x / 6) / 6;
    (void)v;
    return x > 6 ? (EX == 3 ? 1 : p / q) : 0;
}

/* The mean of n values with one in each of n cells of the square; n is a square number. */
static double my_stratified(double (*value)(double, double), int n, pt_pcg32 *random)
{
    int side = (int)(sqrt(n) + 0.5), i;
    double sum = 0;
    for (i = 0; i < side * side; i++) {
        double u = (i % side + pt_pcg32_double(random)) / side,
               v = (i / side + pt_pcg32_double(random)) / side;
        sum += value(u, v);
    }
    return sum / (side * side);
}

static double my_independent(double (*value)(double, double), int n, pt_pcg32 *random)
{
    double sum = 0;
    int i;
    for (i = 0; i < n; i++) {
        double u = pt_pcg32_double(random);
        sum += value(u, pt_pcg32_double(random));
    }
    return sum / n;
}

/* ---- the header's: f and a technique on directions ---- */

static double sky_cosine(const double *w, void *user)
{
    (void)user;
    return pow(w[2], sky) * w[2];
}

static void cosine_warp(const double *u, double *w, void *user)
{
    pt_vec3 d = pt_warp_cosine(pt_v2((pt_real)u[0], (pt_real)u[1]));
    (void)user;
    w[0] = (double)d.x, w[1] = (double)d.y, w[2] = (double)d.z;
}

static double cosine_density(const double *w, void *user)
{
    (void)user;
    return (double)pt_warp_cosine_pdf_w(pt_v3((pt_real)w[0], (pt_real)w[1], (pt_real)w[2]));
}

/* ---- both ---- */

/* Mine, with independent numbers: the mean, and the variance of the formula. */
static void table(const char *name, double (*value)(double, double), double exact, double variance,
                  double most)
{
    pt_pcg32 random = pt_pcg32_make(14, 0);
    pt_stats s = PT_STATS_INIT, squared = PT_STATS_INIT;
    double seconds = pt_cpu_seconds(), n, x;
    for (n = floor(most / 256); n <= most; n *= 16) {
        while (s.n < n) {
            x = pt_pcg32_double(&random);
            x = value(x, pt_pcg32_double(&random));
            pt_stats_add(&s, x);
            pt_stats_add(&squared, (x - exact) * (x - exact));
        }
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s) + 1e-12, "within 5 standard errors");
    check(fabs(squared.mean - variance) <= 5 * pt_stats_standard_error(&squared) + 1e-12,
          "variance as computed");
}

static void header_table(const char *name, double exact, double most)
{
    pt_technique technique = {cosine_warp, cosine_density, NULL};
    pt_integral p = {sky_cosine, NULL, 2, 0, PT_SAMPLER_INDEPENDENT, 14};
    pt_estimate e = {0};
    for (p.n = (uint32_t)(most / 256); p.n <= most; p.n *= 16)
        if (pt_estimate_importance(&p, &technique, &e) == PT_OK) row(name, &e.units, exact, e.seconds);
    check(fabs(e.value - exact) <= 5 * e.standard_error + 1e-6, "within 5 standard errors");
}

/* True relative error, over RUNS runs, for n = 16, 64, ...; the slope against n is returned. method: 0 mine,
   independent; 1 mine, stratified; 2 the header's Sobol points. */
static double curve(int method, double (*value)(double, double), double exact, pt_report *report,
                    pt_report_row *rows)
{
    pt_pcg32 random = pt_pcg32_make(15, 0);
    double sx = 0, sy = 0, sxx = 0, sxy = 0, x, y;
    int k, run, n = 16, i;
    for (k = 0; k < ROWS; k++, n *= 4) {
        double squares = 0, seconds = pt_cpu_seconds();
        for (run = 0; run < RUNS; run++) {
            double mean = 0;
            if (method == 2) {
                pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, (uint64_t)run, 0);
                for (i = 0; i < n; i++) {
                    pt_vec2 u;
                    pt_sampler_start(&sampler, 0, (uint32_t)i);
                    u = pt_sampler_2d(&sampler);
                    mean += value((double)u.x, (double)u.y) / n;
                }
            } else mean = method ? my_stratified(value, n, &random) : my_independent(value, n, &random);
            squares += (mean / exact - 1) * (mean / exact - 1) / RUNS;
        }
        rows[k].cpu_seconds = (pt_cpu_seconds() - seconds) / RUNS;
        rows[k].has_true_error = 1;
        rows[k].true_error.relmse = squares;
        x = log(n), y = 0.5 * log(squares);
        sx += x, sy += y, sxx += x * x, sxy += x * y;
    }
    report->rows = rows;
    report->row_count = ROWS;
    return (ROWS * sxy - sx * sy) / (ROWS * sxx - sx * sx);
}

/* The plot; and an estimate of 16 samples in each pixel: uniform, cosine, and both stratified below. */
static void picture(double exact, const char *output)
{
    static unsigned char rgb[4 * SIZE * SIZE * 3];
    static pt_report_row rows[4][ROWS];
    pt_report reports[4] = {PT_REPORT_INIT, PT_REPORT_INIT, PT_REPORT_INIT, PT_REPORT_INIT};
    const pt_report *all[4];
    static const char *const labels[] = {"uniform", "cosine", "stratified", "Sobol"};
    double slope[4];
    pt_pcg32 random = pt_pcg32_make(16, 0);
    char path[1024];
    int i, k;
    for (i = 0; i < 4 * SIZE * SIZE; i++) {
        int column = i % (2 * SIZE) / SIZE, line = i / (2 * SIZE) / SIZE;
        double (*value)(double, double) = column ? my_cosine : my_uniform;
        double e = line ? my_stratified(value, 16, &random) : my_independent(value, 16, &random);
        rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = pt_srgb_byte(e / exact / 2);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, 2 * SIZE, 2 * SIZE) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, 2 * SIZE, 2 * SIZE) == PT_OK, "and as PNG");
    for (k = 0; k < 4; k++) {
        slope[k] = curve(k < 2 ? 0 : k - 1, k ? my_cosine : my_uniform, exact, &reports[k], rows[k]);
        all[k] = &reports[k];
    }
    printf("slope of log error over log samples: uniform %.1f, cosine %.1f, stratified %.1f, Sobol %.1f\n",
           slope[0], slope[1], slope[2], slope[3]);
    check(fabs(slope[0] + 0.5) < 0.1 && slope[2] < -0.65 && slope[3] < -0.9, "stratified is steeper");
    snprintf(path, sizeof path, "%s.svg", output);
    check(pt_report_write_svg(all, labels, 4, "irradiance", path) == PT_OK, "and the plot as SVG");
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 16384) : 1048576) / (getenv("SHORT") ? 16 : 1);
    double e, rare = exp(-6.0);
    int k;
    printf("%-14s %9s %12s %12s %10s %8s\n",
           "estimator", "samples", "estimate", "exact", "std.error", "seconds");
    for (k = 0; k < 2; k++) {
        static const char *const name[2][3] = {{"my uniform, 0", "my cosine, 0", "pt cosine, 0"},
                                               {"my uniform, m", "my cosine, m", "pt cosine, m"}};
        sky = k == 0 ? 0 : EX == 1 ? 8 : 2;
        e = 2 * PT_PI / (sky + 2);
        table(name[k][0], my_uniform, e, 4 * PT_PI * PT_PI / (2 * sky + 3) - e * e, most);
        table(name[k][1], my_cosine, e, PT_PI * PT_PI / (sky + 1) - e * e, most);
        header_table(name[k][2], e, most);
    }
    table("plain X > 6", my_plain, rare, rare * (1 - rare), most);
    table("my q", my_rare, rare, 36 / 11.0 * exp(-11.0) - exp(-12.0), most);
    printf("What to see: no error at all where p follows f; for the rare event 51 times fewer samples.\n");
    picture(2 * PT_PI / (sky + 2), argc > 2 ? argv[2] : "09_importance");
    printf("lesson 09: %d passed, %d failed\n", passed, failed);
    if (MISTAKE)
        printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: a sky that is bright at the zenith only, m = 8 instead of 2 (-DEX=1). By which factor is the
       cosine's variance smaller than the uniform one's, for m = 2 and for m = 8? Answer: 3.172 / 0.8225 =
       3.9, and 1.683 / 0.7018 = 2.4: the cosine knows less and less of what matters.
   (2) Break: sample only directions within 60 degrees of the zenith (-DEX=2): p = 0 where f is not. The
       tables say "no error" and are wrong by a quarter. Then forget the weight p / q (-DEX=3).
   (3) Extend: take p proportional to cos^3 for m = 2. Answer: every sample is pi/2, the variance 0. */
