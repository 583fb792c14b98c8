/* Lesson 09: importance sampling and stratification

   QUESTION   Where should samples go, and what is gained if they go there?

   IDEA       The estimator f(X) / p(X) is a constant if p is proportional to f: then one sample is enough, and its
              variance is 0. (To make p one needs the integral of f, which is wanted; but parts of f are known.)
              Irradiance below a sky of radiance L = cos^m t is E = integral of cos^m t cos t dw = 2 pi / (m + 2), and

                  uniform  p = 1/(2 pi):         variance 4 pi^2 / (2 m + 3) - E^2
                  cosine   p = cos t / pi:       variance pi^2 / (m + 1) - E^2,     which is 0 for m = 0

              Importance sampling of a rare event: E_p[f] = integral of f p = E_q[f p / q], for every proposal density
              q that is positive wherever f p is not 0. What is rare under p may be common under q. P(X > 6) for p =
              e^-x is e^-6 = 0.00248: of a thousand samples 2 or 3 are there. Under q = e^(-x/6) / 6 it is one in
              three, each with the weight p/q = 6 e^(-5 x/6):

                  plain    variance e^-6 (1 - e^-6)          = 0.00247
                  q        variance (36 / 11) e^-11 - e^-12  = 0.0000485

              Another variance reduction is stratified sampling: n cells with one sample each. Only the variance within
              cells is left, so for smooth f the error falls faster than n^(-1/2): in two dimensions like 1/n, and like
              n^(-3/2) with a low-discrepancy sequence, scrambled Sobol points: one in each of n rows and columns too.

   PICTURE    E by 16 samples in each pixel, m = 2: left uniform, right cosine; above independent, below stratified.
   PLOT       The same E; upwards the root mean square error of 64 runs over E: the square root of relMSE.

   BUILD      cc -O2 -I.. 09_importance.c -o 09_importance -lm -pthread
   RUN        ./09_importance [samples] [output]

   PRINTS     estimator        samples     estimate        exact  std.error  seconds
              my uniform, 0       4096      3.16625      3.14159      0.029    0.000
              ...
              my cosine, 0        4096      3.14159      3.14159          0    0.000

   WORDS      importance sampling 重要性采样; stratified sampling 分层采样; variance reduction 方差缩减;
              low-discrepancy sequence 低差异序列; proposal density 提议密度; rare event 稀有事件; weight 权重

   HEADER     [PT-03] pt_estimate_importance, [PT-04] pt_warp_cosine, pt_warp_cosine_pdf_w, [PT-02] PT_SAMPLER_SOBOL

   SOURCES    Kahn, Marshall: Methods of Reducing Sample Size in Monte Carlo Computations, 1953; [PBR] 2.2; [Vea97] 2.4

   Before: lesson 08. Next: lesson 10, what a BRDF is. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { SIZE = 120, CURVES = 5, ROWS = 6, RUNS = 64, MISTAKE = EX == 2 || EX == 3 };

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    double error = pt_stats_standard_error(s);
    if (error < 1e-8) error = 0; /* rounding alone */
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact, error, seconds);
}

/* ---- mine: the value f / p for two uniform numbers ---- */

static double sky = 0; /* m: the sky has radiance cos^m */

static double my_uniform(pt_vec2 u)
{
    double z = (double)u.x; /* the height of a uniform direction */
    return pow(z, sky) * z / (1 / (2 * PT_PI));
}

static double my_cosine(pt_vec2 u)
{
    double low = EX == 2 ? 0.25 : 0; /* EX 2: never further than 60 degrees from the zenith */
    double z = sqrt(low + (1 - low) * (double)u.x), p = z / PT_PI / (1 - low);
    return pow(z, sky) * z / p;
}

/* Is X > 6? By p itself, and by q with the weight p / q. */
static double my_plain(pt_vec2 u) { return -log(1 - (double)u.x) > 6; }

static double my_rare(pt_vec2 u)
{
    double x = -6 * log(1 - (double)u.x), p = exp(-x), q = exp(-x / 6) / 6;
    return x > 6 ? (EX == 3 ? 1 : p / q) : 0;
}

/* The mean of n values with one in each of n cells of the square; n is a square number. */
static double my_stratified(double (*value)(pt_vec2), int n, pt_sampler *random)
{
    int side = (int)(sqrt(n) + 0.5);
    double sum = 0;
    for (int i = 0; i < n; i++) {
        pt_vec2 u = pt_sampler_2d(random);
        sum += value(pt_v2(((pt_real)(i % side) + u.x) / (pt_real)side, ((pt_real)(i / side) + u.y) / (pt_real)side));
    }
    return sum / n;
}

/* ---- the header's: warp and density; a sampler of any kind ---- */

static double its_cosine(pt_vec2 u)
{
    pt_vec3 w = pt_warp_cosine(u);
    return pow((double)w.z, sky) * (double)w.z / (double)pt_warp_cosine_pdf_w(w);
}

static double its_mean(double (*value)(pt_vec2), int n, pt_sampler *sampler)
{
    double sum = 0;
    for (int i = 0; i < n; i++) {
        pt_sampler_start(sampler, 0, (uint32_t)i);
        sum += value(pt_sampler_2d(sampler));
    }
    return sum / n;
}

/* ---- both ---- */

/* Independent numbers: the mean, and the variance of the formula. The tolerances are what rounding takes. */
static void table(const char *name, double (*value)(pt_vec2), double exact, double variance, double most)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 14, 0);
    pt_stats s = PT_STATS_INIT, squared = PT_STATS_INIT;
    double seconds = pt_cpu_seconds();
    for (double n = floor(most / 256); n <= most; n *= 16) {
        while (s.n < n) {
            double v = value(pt_sampler_2d(&random));
            pt_stats_add(&s, v);
            pt_stats_add(&squared, (v - exact) * (v - exact));
        }
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s) + 1e-6, "within 5 standard errors");
    check(fabs(squared.mean - variance) <= 5 * pt_stats_standard_error(&squared) + 1e-12, "variance as computed");
}

/* True relative error, over RUNS runs of n = 16, 64, ... samples, against seconds; the slopes against n. */
static void plot(double exact, const char *path)
{
    static const char *const label[CURVES] = {"uniform", "cosine", "my strata", "pt strata", "Sobol"};
    static const double expected[CURVES] = {-0.5, -0.5, -1, -1, -1.5};
    static pt_report_row rows[CURVES][ROWS];
    pt_report reports[CURVES];
    const pt_report *all[CURVES];
    for (int c = 0; c < CURVES; c++) {
        double (*value)(pt_vec2) = c == 0 ? my_uniform : my_cosine, slope;
        pt_sampler_kind kind = c == 3 ? PT_SAMPLER_STRATIFIED : c == 4 ? PT_SAMPLER_SOBOL : PT_SAMPLER_INDEPENDENT;
        for (int k = 0, n = 16; k < ROWS; k++, n *= 4) {
            double squares = 0, seconds = pt_cpu_seconds();
            for (int run = 0; run < RUNS; run++) {
                pt_sampler sampler = pt_sampler_make(kind, (uint64_t)run, (uint32_t)n);
                double mean = c == 2 ? my_stratified(value, n, &sampler) : its_mean(value, n, &sampler);
                squares += (mean / exact - 1) * (mean / exact - 1) / RUNS;
            }
            rows[c][k].cpu_seconds = (pt_cpu_seconds() - seconds) / RUNS;
            rows[c][k].has_true_error = 1, rows[c][k].true_error.relmse = squares;
        }
        slope = 0.25 * log2(rows[c][ROWS - 1].true_error.relmse / rows[c][0].true_error.relmse) / (ROWS - 1);
        printf("%-10s slope of log error over log samples %.2f\n", label[c], slope);
        check(fabs(slope - expected[c]) < 0.15, "as expected");
        reports[c].rows = rows[c], reports[c].row_count = ROWS, all[c] = &reports[c];
    }
    check(pt_report_write_svg(all, label, CURVES, "irradiance", path) == PT_OK, "the plot as SVG");
}

/* An estimate of 16 samples in each pixel: uniform, cosine, and both stratified below; and the plot. */
static void picture(double exact, const char *output)
{
    static unsigned char rgb[4 * SIZE * SIZE * 3];
    char path[1024];
    for (int i = 0; i < 4 * SIZE * SIZE; i++) {
        double (*value)(pt_vec2) = i % (2 * SIZE) < SIZE ? my_uniform : my_cosine, e;
        pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, (uint64_t)i, 0);
        e = i / (2 * SIZE) < SIZE ? its_mean(value, 16, &random) : my_stratified(value, 16, &random);
        rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = pt_srgb_byte(e / exact / 2);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, 2 * SIZE, 2 * SIZE) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, 2 * SIZE, 2 * SIZE) == PT_OK, "and as PNG");
    snprintf(path, sizeof path, "%s.svg", output);
    plot(exact, path);
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 16384) : 1048576) / (getenv("SHORT") ? 16 : 1), e, rare = exp(-6.0);
    printf("%-14s %9s %12s %12s %10s %8s\n", "estimator", "samples", "estimate", "exact", "std.error", "seconds");
    for (int k = 0; k < 2; k++) {
        sky = k == 0 ? 0 : EX == 1 ? 8 : 2;
        e = 2 * PT_PI / (sky + 2);
        table(k ? "my uniform, m" : "my uniform, 0", my_uniform, e, 4 * PT_PI * PT_PI / (2 * sky + 3) - e * e, most);
        table(k ? "my cosine, m" : "my cosine, 0", my_cosine, e, PT_PI * PT_PI / (sky + 1) - e * e, most);
        table(k ? "pt cosine, m" : "pt cosine, 0", its_cosine, e, PT_PI * PT_PI / (sky + 1) - e * e, most);
    }
    table("plain X > 6", my_plain, rare, rare * (1 - rare), most);
    table("my q", my_rare, rare, 36 / 11.0 * exp(-11.0) - exp(-12.0), most);
    printf("What to see: no error at all where p follows f; for the rare event 51 times fewer samples.\n");
    picture(2 * PT_PI / (sky + 2), argc > 2 ? argv[2] : "09_importance");

    printf("lesson 09: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: a sky that is bright at the zenith only, m = 8 instead of 2 (-DEX=1). By which factor is the cosine's
       variance smaller than the uniform one's, for m = 2 and for m = 8? Answer: 3.172 / 0.8225 = 3.9, and 1.683 /
       0.7018 = 2.4: the cosine knows less and less of what matters.
   (2) Break: sample only directions within 60 degrees of the zenith (-DEX=2): p = 0 where f is not. The tables say
       "no error" and are wrong by a quarter. Then forget the weight p / q (-DEX=3).
   (3) Extend: take p proportional to cos^3 for m = 2. Answer: every sample is pi/2, the variance 0. */
