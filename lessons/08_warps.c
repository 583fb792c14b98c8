/* Lesson 08: warps

   QUESTION   The computer has uniform numbers. How do they become directions with a wanted density, and who notices
              if the density is another one?

   IDEA       A warp turns numbers u, v that are uniform in [0, 1) into directions. Inversion: if P(x) is the
              cumulative distribution, the integral of p up to x, then x = P^-1(u) has the probability density p. For
              directions around a normal, with density proportional to cos^n,

                  p(w) = (n+1)/(2 pi) cos^n t per solid angle,   cos t = (1 - u)^(1/(n+1)),   phi = 2 pi v

              n = 0 is the uniform hemisphere, n = 1 is Lambert's cosine law. For the disk the same gives r = sqrt(u),
              not r = u: a ring at radius r has a circumference that grows with r. Rejection sampling: draw in the
              square until the point is in the disk; pi/4 of the draws stay. The famous mistake: "normal + random point
              in the unit ball" looks like a diffuse surface, and is not. The points on the ray at angle t fill it up
              to length 2 cos t, so their density is proportional to the integral of r^2 up to there: p = (2/pi) cos^3
              t, and light that comes in flat counts too little. With a random point ON the sphere it is right: that is
              cos t / pi exactly.

              Means tell some mistakes: E[cos t] = (n+1)/(n+2), that is 1/2, 2/3, and 4/5 for the mistake. All of them
              are told by a chi-squared test: count directions in cells of equal probability; the sum of (observed -
              expected)^2 / expected is distributed like chi-squared with cells - 1 degrees of freedom, and the
              p-value, the chance of a sum at least as large, is uniform if the density is right and 0 if it is wrong.

   PICTURE    2500 points each, from above: uniform directions and cosine (blue); the famous mistake and r = u (red).

   BUILD      cc -O2 -I.. 08_warps.c -o 08_warps -lm -pthread
   RUN        ./08_warps [samples] [output]

   PRINTS     mean             samples     estimate        exact  std.error  seconds
              my cosine           1024      0.66926     0.666667     0.0072    0.000
              ...
              normal + in       262144     0.800627     0.666667    0.00032    0.045

   WORDS      warp 变换采样; inversion 逆变换法; rejection sampling 拒绝采样; cumulative distribution 累积分布;
              probability density 概率密度; chi-squared test 卡方检验; diffuse 漫反射; hemisphere 半球;
              Lambert's cosine law 朗伯余弦定律

   HEADER     [PT-04] pt_warp_cosine, pt_warp_hemisphere, pt_warp_disk, pt_warp_sphere, [PT-03] pt_p_value_counts

   SOURCES    Malley: A Shading Method for Computer Generated Images, 1988; [Shi97]; [PBR] A.5; Shirley, Wang,
              Zimmerman: Monte Carlo Techniques for Direct Lighting Calculations, 1996

   Before: lesson 07. Next: lesson 09, importance sampling. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { SIZE = 128, BANDS = 8, SECTORS = 8, CELLS = BANDS * SECTORS, MISTAKE = EX == 2 || EX == 3 };

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

/* ---- mine: each warp draws its own numbers; z is the axis ---- */

/* Density proportional to cos^n, by inversion. */
static pt_vec3 my_power(pt_sampler *random, double n)
{
    pt_vec2 u = pt_sampler_2d(random);
    double z = pow(1 - (double)u.x, 1 / (n + 1)), r = sqrt(1 - z * z), phi = 2 * PT_PI * (double)u.y;
    return pt_v3((pt_real)(r * cos(phi)), (pt_real)(r * sin(phi)), (pt_real)z);
}

/* Points of the cube (of the square, if flat) until one is in the ball (in the disk): rejection. */
static pt_vec3 my_ball(pt_sampler *random, int flat)
{
    for (;;) {
        pt_vec2 u = pt_sampler_2d(random);
        pt_vec3 p = pt_v3(2 * u.x - 1, 2 * u.y - 1, flat ? 0 : 2 * pt_sampler_1d(random) - 1);
        if (pt_v3_dot(p, p) < 1) return p;
    }
}

/* The disk as many write it first. */
static pt_vec3 my_wrong_disk(pt_sampler *random)
{
    pt_vec2 u = pt_sampler_2d(random);
    double phi = 2 * PT_PI * (double)u.y;
    return pt_v3(u.x * (pt_real)cos(phi), u.x * (pt_real)sin(phi), 0);
}

/* Normal + point in the unit ball: the famous mistake. */
static pt_vec3 my_wrong_lambert(pt_sampler *random)
{
    return pt_v3_normalize(pt_v3_add(my_ball(random, 0), pt_v3(0, 0, 1)));
}

/* Normal + point on the unit sphere: right. */
static pt_vec3 my_sphere_lambert(pt_sampler *random)
{
    return pt_v3_normalize(pt_v3_add(pt_warp_sphere(pt_sampler_2d(random)), pt_v3(0, 0, 1)));
}

static pt_vec3 my_hemisphere(pt_sampler *random) { return my_power(random, 0); }
static pt_vec3 my_narrow(pt_sampler *random) { return my_power(random, EX == 1 ? 100 : 19); }
static pt_vec3 my_cosine(pt_sampler *random) { return EX == 2 ? my_wrong_lambert(random) : my_power(random, 1); }
static pt_vec3 my_disk(pt_sampler *random) { return EX == 3 ? my_wrong_disk(random) : my_ball(random, 1); }

/* The share of directions (of points of the disk, n < 0) that should be nearer to the axis than w. */
static double my_cumulative(pt_vec3 w, double n)
{
    return n < 0 ? (double)w.x * (double)w.x + (double)w.y * (double)w.y : 1 - pow((double)w.z, n + 1);
}

/* ---- the header's ---- */

static pt_vec3 its_hemisphere(pt_sampler *random) { return pt_warp_hemisphere(pt_sampler_2d(random)); }
static pt_vec3 its_cosine(pt_sampler *random) { return pt_warp_cosine(pt_sampler_2d(random)); }
static pt_vec3 its_disk(pt_sampler *random)
{
    pt_vec2 p = pt_warp_disk(pt_sampler_2d(random));
    return pt_v3(p.x, p.y, 0);
}

/* ---- both ---- */

/* The mean of cos t (or, for the disk, of r), and the cells. right = 0: a mistake, which both must reject. */
static void table(const char *name, pt_vec3 (*warp)(pt_sampler *), double n, int right, double most)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 12, 0);
    pt_stats s = PT_STATS_INIT;
    double seconds = pt_cpu_seconds(), exact = n < 0 ? 2 / 3.0 : (n + 1) / (n + 2);
    double observed[CELLS] = {0}, expected[CELLS], p;
    int mean_right;
    for (double k = floor(most / 256); k <= most; k *= 16) {
        while (s.n < k) {
            pt_vec3 w = warp(&random);
            double turn = atan2((double)w.y, (double)w.x) / (2 * PT_PI) + 0.5;
            int band = (int)fmin(my_cumulative(w, n) * BANDS, BANDS - 1); /* rounding may make one too many */
            int sector = (int)fmin(turn * SECTORS, SECTORS - 1);
            observed[band * SECTORS + sector]++;
            pt_stats_add(&s, n < 0 ? sqrt(my_cumulative(w, n)) : (double)w.z);
        }
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    for (int i = 0; i < CELLS; i++) expected[i] = s.n / CELLS;
    p = pt_p_value_counts(observed, expected, CELLS);
    mean_right = fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s);
    if (right) {
        check(mean_right, "within 5 standard errors of the exact mean");
        check(p > 1e-6, "and the counts of 64 cells agree");
    } else check(!mean_right && p < 1e-6, "a mistake: the mean tells, and the cells do");
}

/* From above: uniform hemisphere, cosine (even in the disk), the mistake (crowded inside), wrong disk. */
static void picture(const char *output)
{
    static unsigned char rgb[4 * SIZE * SIZE * 3];
    static pt_vec3 (*const warp[4])(pt_sampler *) = {my_hemisphere, my_cosine, my_wrong_lambert, my_wrong_disk};
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 13, 0);
    char path[1024];
    memset(rgb, 255, sizeof rgb);
    for (int i = 0; i < 4 * 2500; i++) {
        int panel = i % 4;
        pt_vec3 w = warp[panel](&random);
        int x = (int)(((double)w.x * 0.47 + 0.5) * SIZE) + panel % 2 * SIZE;
        int y = (int)((0.5 - (double)w.y * 0.47) * SIZE) + panel / 2 * SIZE;
        unsigned char *to = rgb + 3 * (y * 2 * SIZE + x);
        to[1] = 60;
        to[panel < 2 ? 0 : 2] = 0; /* right: blue, mistakes: red */
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, 2 * SIZE, 2 * SIZE) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, 2 * SIZE, 2 * SIZE) == PT_OK, "and as PNG");
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 16384) : 262144) / (getenv("SHORT") ? 16 : 1);
    printf("%-14s %9s %12s %12s %10s %8s\n", "mean", "samples", "estimate", "exact", "std.error", "seconds");
    table("my hemisphere", my_hemisphere, 0, 1, most);
    table("pt hemisphere", its_hemisphere, 0, 1, most);
    table("my cosine", my_cosine, 1, 1, most);
    table("pt cosine", its_cosine, 1, 1, most);
    table("normal + on", my_sphere_lambert, 1, 1, most);
    table("normal + in", my_wrong_lambert, 1, 0, most);
    table("narrow lobe", my_narrow, EX == 1 ? 100 : 19, 1, most);
    table("my disk", my_disk, -1, 1, most);
    table("pt disk", its_disk, -1, 1, most);
    table("r = u", my_wrong_disk, -1, 0, most);
    printf("What to see: a mistake converges as fast as the truth, to something else.\n");
    picture(argc > 2 ? argv[2] : "08_warps");

    printf("lesson 08: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: the narrow lobe has n = 19 and E[cos t] = 20/21. With n = 100 (-DEX=1)? And half of its directions are
       within which angle of the axis? Answer: 101/102 = 0.9902; cos t = 0.5^(1/101), t = 6.71 degrees.
   (2) Break: take the famous mistake for the cosine (-DEX=2), or r = u for the disk (-DEX=3). Two checks fail each
       time. How many samples does the mean need to notice? Answer: it is off by 0.8 - 0.6667 and one cosine deviates
       by 0.163, so five standard errors are reached after 38 of them.
   (3) Extend: points in a triangle: (1 - sqrt u, v sqrt u) as weights of corners 2 and 3. Means? Answer: 1/3 each;
       with u instead of sqrt u they are 1/2 and 1/4. */
