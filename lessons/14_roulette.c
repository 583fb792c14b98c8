/* Lesson 14: Russian roulette

   QUESTION   Light goes on for ever, a program must not. How can a path end without taking light away?
   IDEA       Go on with the probability q (P_RR of the slides), and divide by q what comes after:

                  S = L_e + B f cos / (p q) S',    B = 1 with probability q, else 0:    E S = L_e + T E S

              with the density p of the direction, S' the same value at the next point, and T the operator of lesson
              12. So the expected value is the radiance for every q: unbiased. Cutting at d edges loses rho^d / (1 -
              rho), always ("directly limiting bounces is wrong"): biased. The price is variance. In a furnace where
              each wall emits 1 and reflects rho, let c rho^2 be the mean square of f cos / p: c = 4/3 for uniform
              directions, c = 1 for the cosine. Then squaring the line above gives

                  E S^2 = (1 + rho) / ((1 - rho) (1 - c rho^2 / q)),   mean edges of a path = 1 / (1 - q)

              and for q <= c rho^2 it is infinite. The time for a given error goes as variance times edges. With uniform
              directions this is least at a q below 1; with the cosine it falls up to q = 1, where paths never end.

              What shade() of the slides forgets: the emission L_e at its point, so that a lamp in view of the camera is
              black, and that lamps reflect, too: it returns at the first lamp. In a furnace, where all walls are lamps,
              it gives rho instead of 1 / (1 - rho).
   PICTURE    The Cornell box, 8 samples a pixel: left cut at 3 edges, right with roulette. Both ask the lamp (17).
   BUILD      cc -O2 -I.. 14_roulette.c -o 14_roulette -lm -pthread
   RUN        ./14_roulette [samples] [output]
   PRINTS     roulette         samples     estimate        exact  std.error  seconds
              cut at 4 edges     16384      1.87963            2     0.0045    0.027
              my q = 0.75        16384      2.00848            2     0.0093    0.029
              P_RR               edges     variance        exact  var*edges sec 0.1%
              my q = 0.75        4.048        1.429          1.4       5.79    0.628
   WORDS      Russian roulette 俄罗斯轮盘赌; tail recursion 尾递归; unbiased 无偏; biased 有偏; variance 方差; expected value 期望;
              throughput 吞吐量; bounce 弹射
   HEADER     [PT-11] pt_li_path_plain, pt_li_options (roulette, roulette_survival), [PT-19] pt_scene_furnace
   SOURCES    Arvo, Kirk: Particle Transport and Image Synthesis, 1990; the slides' shade() with P_RR
   Before: lesson 13, the branching solver. Next: lesson 15, path tracing. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX >= 2 };
static const double RHO = EX == 1 ? 0.8 : 0.5; /* albedo of every wall of the furnace; each emits 1 */

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

typedef struct setting {
    pt_scene scene;
    double q;              /* P_RR */
    int cut;               /* edges at most, 0 = no limit */
    double edges, seconds; /* what the row took */
} setting;

typedef double (*value_fn)(setting *s, pt_sampler *random);

/* Takes n values and prints a row; 1 if the mean is exact within 5 standard errors and the rounding of float. */
static int row(const char *name, value_fn value, setting *s, double exact, uint32_t n, pt_stats *stats)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 14, n);
    double start = pt_cpu_seconds(), error;
    memset(stats, 0, sizeof *stats);
    s->edges = 0;
    for (uint32_t i = 0; i < n; i++) {
        pt_sampler_start(&random, (uint64_t)(100 * s->q), i); /* each q has its own numbers */
        pt_stats_add(stats, value(s, &random));
    }
    error = pt_stats_standard_error(stats);
    s->seconds = pt_cpu_seconds() - start;
    printf("%-14s %9u %12.6g %12.6g %10.2g %8.3f\n", name, n, stats->mean, exact, error, s->seconds);
    return fabs(stats->mean - exact) <= 5 * error + pt_gamma(300) * exact; /* 300 operations */
}

static const pt_ray first_ray = {{0, 0, 0.375}, {0.25, 0.5, -1}, 9};

/* ---- the new piece: one direction, and an end by chance ------------------------------------------------ */

/* The slides' recursion is the last thing that shade() does (tail recursion): a loop with a running product, the
   throughput. */
static double my_shade(setting *s, pt_sampler *random)
{
    double lo = 0, beta = 1;
    pt_ray ray = first_ray;
    for (int k = 1;; k++) {
        pt_hit hit;
        s->edges++;
        if (!pt_intersect(&s->scene, &ray, &hit)) return lo;
        if (EX != 3 || k > 1) lo += beta * (double)pt_hit_emission(&s->scene, &hit, pt_v3_neg(ray.d)).r;
        if (EX == 3 && k > 1) return lo; /* the slides: a lamp ends the path */
        if (k == s->cut) return lo;
        if ((double)pt_sampler_1d(random) >= s->q) return lo;
        beta /= EX == 2 ? 1 : s->q;
        double f = (double)s->scene.materials[hit.material].albedo.r / PT_PI;
        pt_frame frame = pt_frame_from_normal(hit.ns);
        pt_vec3 w = pt_warp_hemisphere(pt_sampler_2d(random));
        beta *= f * (double)w.z * 2 * PT_PI;
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, pt_frame_to_world(&frame, w));
    }
}

/* ---- the header's: directions by the cosine ------------------------------------------------------------ */

static double its_shade(setting *s, pt_sampler *random)
{
    pt_li_options options = {0};
    pt_li_info info = {0};
    options.max_edges = s->cut;
    options.roulette = PT_ROULETTE_CONSTANT;
    options.roulette_survival = (pt_real)s->q;
    double value = pt_li_path_plain(&s->scene, &first_ray, random, &options, &info).r;
    s->edges += info.edges;
    return value;
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

/* Is the mean right for every q, and what does it cost? sec 0.1%: seconds until the error is 0.1 % of the mean. */
static void table(const char *who, value_fn value, setting *s, uint32_t n)
{
    static const double q[6] = {0.6, 0.7, 0.75, 0.8, 0.9, 0.95};
    double exact = 1 / (1 - RHO), c = value == my_shade ? 4.0 / 3 : 1, edges[6], seconds[6];
    int good = 1, as_predicted = 1, k;
    pt_stats stats[6];
    char text[96];
    s->cut = EX == 4 ? 4 : 0;
    for (k = 0; k < 6; k++) {
        s->q = q[k];
        snprintf(text, sizeof text, "%s q = %.2f", who, q[k]);
        good &= row(text, value, s, exact, n, &stats[k]) || q[k] <= c * RHO * RHO; /* infinite: no error bar */
        edges[k] = s->edges / n;
        seconds[k] = s->seconds;
    }
    printf("%-14s %9s %12s %12s %10s %8s\n", "P_RR", "edges", "variance", "exact", "var*edges", "sec 0.1%");
    for (k = 0; k < 6; k++) {
        double v = pt_stats_variance(&stats[k]), second = (1 + RHO) / ((1 - RHO) * (1 - c * RHO * RHO / q[k]));
        double exact_v = q[k] > c * RHO * RHO ? second - exact * exact : HUGE_VAL;
        printf("%s q = %-7.2f %9.3f %12.4g %12.4g %10.3g %8.3f\n", who, q[k], edges[k], v, exact_v, v * edges[k],
               seconds[k] / n * v / pow(0.001 * exact, 2));
        as_predicted &= fabs(edges[k] * (1 - q[k]) - 1) <= 5 / sqrt(n);
        if (k > 0 && EX != 1) as_predicted &= fabs(v / exact_v - 1) <= 0.15 * fmax(1, sqrt(16384.0 / n));
    }
    snprintf(text, sizeof text, "%s mean is 1 / (1 - rho), whatever q is", who);
    check(good, text);
    snprintf(text, sizeof text, "%s edges and variance are as predicted", who);
    check(as_predicted, text);
}

static void picture(const char *output)
{
    enum { SIZE = 150 };
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT, half = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    char path[512];
    if (pt_scene_cornell(&scene, &desc.camera) != PT_OK || pt_film_make(&film, 2 * SIZE, SIZE, 0) != PT_OK) return;
    film.samples[0] = 1;
    desc.width = desc.height = SIZE;
    desc.spp = 8;
    for (int k = 0; k < 2; k++) {
        desc.li.max_edges = k ? 0 : 3;
        desc.li.roulette = k ? PT_ROULETTE_CONSTANT : PT_ROULETTE_NONE;
        if (pt_render(&scene, &desc, &half, NULL) != PT_OK) return;
        for (int i = 0; i < SIZE * SIZE; i++) {
            pt_rgbd c = pt_film_pixel(&half, i % SIZE, i / SIZE);
            memcpy(film.half[0] + 3 * (i / SIZE * 2 * SIZE + i % SIZE + k * SIZE), &c, sizeof c);
        }
        pt_film_free(&half);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1) == PT_OK, path);
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    double n = fmax(2048, (argc > 1 ? strtod(argv[1], NULL) : 16384) / (getenv("SHORT") ? 16 : 1));
    double exact = 1 / (1 - RHO);
    setting s = {PT_SCENE_INIT, 1, 4, 0, 0};
    pt_camera camera;
    pt_stats stats;
    if (pt_scene_furnace(&s.scene, &camera) != PT_OK) return 1;
    s.scene.materials[0].albedo = pt_rgb_grey((pt_real)RHO);
    if (pt_commit(&s.scene) != PT_OK) return 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "roulette", "samples", "estimate", "exact", "std.error", "seconds");
    row("cut at 4 edges", my_shade, &s, exact, (uint32_t)n, &stats);
    check(fabs(exact - stats.mean - pow(RHO, 4) * exact) <= 5 * pt_stats_standard_error(&stats),
          "cutting loses rho^4 / (1 - rho), however many samples are taken");
    table("my", my_shade, &s, (uint32_t)n);
    table("its", its_shade, &s, (uint32_t)n);
    printf("What to see: every q is right; the seconds for one error follow variance * edges.\n");
    picture(argc > 2 ? argv[2] : "14_roulette");
    pt_scene_free(&s.scene);
    printf("lesson 14: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: rho = 0.8 (-DEX=1). For which q is the variance of mine infinite, and does the table show it? Answer:
       for q <= 4/3 * 0.64 = 0.853; any run shows a finite number that means nothing and changes with every seed: values
       that are rare and huge are missing. This is why survival must follow the throughput.
   (2) Break: do not divide by q (-DEX=2): 1 / (1 - q rho), 1.818 for q = 0.9. Take shade() of the slides as it stands
       (-DEX=3): 0.5. Use roulette and also cut at 4 edges (-DEX=4): 1.875. All are dark; only the exact value tells.
   (3) Extend: which q is best for c = 4/3 and rho = 1/2? Answer: the least of (3 / (1 - 1/(3q)) - 4) / (1 - q) is
       5.60, at q = 0.756. For c = 1 it falls to 4/3 as q goes to 1: with f cos / p constant, only roulette has
       variance. */
