/* Lesson 18: multiple importance sampling (MIS)

   QUESTION   A lamp in a rough plate: should a shadow ray ask the lamp, or the reflected ray hit it by luck?
   IDEA       Neither is right for all lamps and plates. Next event estimation (lesson 17) has the probability density
              p1, of points of the lamp, the other p2, of the plate's BSDF (BRDF and its counterpart for light that
              passes). Do both, and weigh. Both densities per solid angle (!), X1 and X2 drawn by them:

                  F = w1(X1) f(X1)/p1(X1) + w2(X2) f(X2)/p2(X2),     w1(x) + w2(x) = 1 wherever f(x) > 0

              E[F] = int w1 f + int w2 f = int f: unbiased for all such weights with w_i = 0 wherever p_i = 0. Good
              ones trust the technique that was likely to find x: w1 = p1 / (p1 + p2), the balance heuristic, or w1 =
              p1^2 / (p1^2 + p2^2), the power heuristic. With one sample of each, balance is never far behind any other
              weights: V(balance) <= V(other) + mean^2/2 ([Vea97] theorem 9.2; the check is of power, for which it is
              an observation). Glossy plates with the lobe f = (n+2)/(2 pi) cos^n (Phong), n = 10, 200, 2000, seen from
              above, under lamps of radius r = 0.2, 0.4, 1, radiance L, d = 4 above, each a cone with sin a = r/d:

                  Lr = L (n+2) int_(cos a)^1 c^(n+1) dc = L (1 - (1 - r^2/d^2)^((n+2)/2)),   L = 1/r^2 here
   PICTURE    Veach's plates by light sampling, BSDF sampling (above), both, and who found the light: red the first,
              green the second (below).
   BUILD      cc -O2 -I.. 18_mis.c -o 18_mis -lm -pthread
   RUN        ./18_mis [samples] [output]
   PRINTS     my light          131072     0.980143            1      0.015    0.087
              my bsdf           131072     0.999999            1    1.4e-06    0.108
              my MIS            131072      1.00051            1    0.00038    0.166
   WORDS      multiple importance sampling 多重重要性采样; next event estimation 下一事件估计; unbiased 无偏;
              probability density 概率密度; glossy 光泽
   HEADER     [PT-03] pt_mis_weight, [PT-08] pt_bsdf_pdf_w, [PT-10] pt_light_sample, pt_light_pdf_w, [PT-11] pt_li_path
   SOURCES    [Vea97] chapter 9: weights, heuristics, theorem 9.2, the plates
   Before: lesson 17, light sampling. Next: lesson 19, the bounding volume hierarchy. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX >= 2 };

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

enum { LIGHT = 1, BSDF = 2, BOTH = 3 };

typedef struct setting {
    pt_scene scene;
    int technique;
} setting;

typedef double (*value_fn)(const setting *s, pt_sampler *random);

/* Takes n values and prints a row; 1 if the mean is exact within 5 standard errors and the rounding of float. */
static int row(const char *name, value_fn value, const setting *s, double exact, uint32_t n, double *variance)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 18, n);
    pt_stats stats = PT_STATS_INIT;
    double start = pt_cpu_seconds(), error;
    for (uint32_t i = 0; i < n; i++) {
        pt_sampler_start(&random, (uint64_t)s->technique, i);
        pt_stats_add(&stats, value(s, &random));
    }
    error = pt_stats_standard_error(&stats);
    printf("%-14s %9u %12.6g %12.6g %10.2g %8.3f\n", name, n, stats.mean, exact, error, pt_cpu_seconds() - start);
    *variance = pt_stats_variance(&stats);
    return fabs(stats.mean - exact) <= 5 * error + pt_gamma(300) * exact; /* 300 operations */
}

/* ---- the new piece: two techniques, and their weights -------------------------------------------------- */

/* The weight of the technique with density p, when the other one has density q at the same direction. */
static double my_weight(double p, double q)
{
    if (EX == 1) return p / (p + q); /* balance heuristic */
    if (EX == 2) return 1;           /* the light is counted twice */
    if (EX == 3) return 0.5;         /* unbiased, but keeps a quarter of the worse one's variance */
    return p * p / (p * p + q * q);  /* power heuristic */
}

/* What asking the lamp finds at a hit, f cos L / p, and its weight. */
static double my_light(const pt_scene *scene, const pt_hit *hit, pt_vec3 wo, pt_sampler *random, double *w)
{
    pt_bsdf bsdf = pt_bsdf_make(&scene->materials[hit->material], hit);
    pt_light_sample_result ls;
    double pmf;
    int light = pt_light_choose(scene, (double)pt_sampler_1d(random), &pmf);
    if (!pt_light_sample(scene, light, hit->p, pt_sampler_2d(random), &ls)) return 0;
    pt_ray shadow = pt_spawn_ray_to(hit->p, hit->p_error, hit->ng, ls.p, ls.p_error, ls.n);
    if (pt_occluded(scene, &shadow)) return 0;
    double p = pmf * ls.pdf_w, per_area = p * fabs((double)pt_v3_dot(ls.n, ls.wi)) / pow((double)ls.distance, 2);
    *w = my_weight(EX == 4 ? per_area : p, (double)pt_bsdf_pdf_w(&bsdf, wo, ls.wi, PT_RADIANCE));
    double f = (double)pt_bsdf_eval(&bsdf, wo, ls.wi, PT_RADIANCE, PT_LOBE_ALL).g;
    return f * fabs((double)pt_v3_dot(ls.wi, hit->ns)) * (double)ls.radiance.g / p;
}

/* What a direction of the BSDF finds: the sample's weight is f cos / p. */
static double my_bsdf(const pt_scene *scene, const pt_hit *hit, pt_vec3 wo, pt_sampler *random, double *w)
{
    pt_bsdf bsdf = pt_bsdf_make(&scene->materials[hit->material], hit);
    pt_vec2 u = pt_sampler_2d(random);
    pt_bsdf_sample_result s;
    pt_hit lamp;
    if (!pt_bsdf_sample(&bsdf, wo, (double)pt_sampler_1d(random), u, PT_RADIANCE, &s)) return 0;
    pt_ray ray = pt_spawn_ray(hit->p, hit->p_error, hit->ng, s.wi);
    if (!pt_intersect(scene, &ray, &lamp) || lamp.light < 0) return 0;
    double p = (double)s.pdf_w, q = pt_light_pdf_w(scene, lamp.light, hit->p, s.wi, &lamp);
    *w = my_weight(p, q * scene->lights[lamp.light].pmf);
    return (double)s.weight.g * (double)pt_hit_emission(scene, &lamp, pt_v3_neg(s.wi)).g;
}

static const pt_ray down = {{0, 1, 0}, {0, -1, 0}, 2}; /* onto the middle of the plate */

static double my_value(const setting *s, pt_sampler *random)
{
    pt_vec3 wo = pt_v3(0, 1, 0);
    double w[2] = {0, 0};
    pt_hit hit;
    if (!pt_intersect(&s->scene, &down, &hit)) return 0;
    double light = s->technique & LIGHT ? my_light(&s->scene, &hit, wo, random, &w[0]) : 0;
    double bsdf = s->technique & BSDF ? my_bsdf(&s->scene, &hit, wo, random, &w[1]) : 0;
    return s->technique == BOTH ? w[0] * light + w[1] * bsdf : light + bsdf;
}

/* ---- the header's: both; two edges are direct light ---------------------------------------------------- */

static double its_value(const setting *s, pt_sampler *random)
{
    pt_li_options options = {0};
    pt_li_info info = {0};
    options.max_edges = 2;
    options.heuristic = EX == 1 ? PT_HEURISTIC_BALANCE : PT_HEURISTIC_POWER;
    return pt_li_path(&s->scene, &down, random, &options, &info).g;
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

/* A plate of that exponent under a lamp of radius r, whose power is the same whatever its radius. */
static void table(double r, double exponent, uint32_t n)
{
    static const char *const name[4] = {"", "my light", "my bsdf", "my MIS"};
    double exact = (1 - pow(1 - r * r / 16, 0.5 * (exponent + 2))) / (r * r), variance[4], its;
    setting s = {PT_SCENE_INIT, LIGHT};
    pt_material phong = pt_material_phong(pt_rgb_grey(0), pt_rgb_grey(1), (pt_real)exponent);
    int lamp = pt_add_material(&s.scene, pt_material_emitter(pt_rgb_grey((pt_real)(1 / (r * r)))));
    int plate = pt_add_material(&s.scene, phong), good;
    pt_add_parallelogram(&s.scene, pt_v3(-1, 0, -1), pt_v3(0, 0, 2), pt_v3(2, 0, 0), plate);
    pt_add_sphere(&s.scene, pt_v3(0, 4, 0), (pt_real)r, lamp);
    good = pt_commit(&s.scene) == PT_OK;
    printf("lamp of radius %g, plate of exponent %g\n", r, exponent);
    for (; s.technique <= BOTH; s.technique++)
        good &= row(name[s.technique], my_value, &s, exact, n, &variance[s.technique]);
    good &= row("its MIS", its_value, &s, exact, n, &its);
    check(good, "within 5 standard errors of the exact value, mine and the header's");
    check(variance[BOTH] <= fmin(variance[LIGHT], variance[BSDF]) + 0.5 * exact * exact,
          "variance of MIS at most that of the better technique + mean^2/2");
    pt_scene_free(&s.scene);
}

static void picture(const char *output)
{
    enum { W = 160, H = 120, SPP = 8 };
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 18, SPP);
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_camera camera;
    char path[512];
    if (pt_scene_veach_plates(&scene, &camera) != PT_OK || pt_film_make(&film, 2 * W, 2 * H, 0) != PT_OK) return;
    film.samples[0] = SPP;
    for (int k = 0; k < W * H * SPP; k++) {
        int x = k / SPP % W, y = k / SPP / W;
        pt_sampler_start(&random, (uint64_t)k / SPP, (uint32_t)(k % SPP));
        pt_vec2 u = pt_sampler_2d(&random);
        pt_ray ray = pt_camera_ray(&camera, (pt_real)W / H, ((pt_real)x + u.x) / W, ((pt_real)y + u.y) / H, u);
        pt_vec3 wo = pt_v3_neg(ray.d);
        double w[2] = {0, 0};
        pt_hit hit;
        if (!pt_intersect(&scene, &ray, &hit)) continue;
        double le = (double)pt_hit_emission(&scene, &hit, wo).g, light = my_light(&scene, &hit, wo, &random, &w[0]);
        double bsdf = my_bsdf(&scene, &hit, wo, &random, &w[1]), red = w[0] * light, green = w[1] * bsdf;
        double panel[4][3] = {{light, light, light}, {bsdf, bsdf, bsdf}, {red + green, red + green, red + green},
                              {red, green, 0}};
        for (int i = 0; i < 12; i++)
            film.half[0][3 * ((i / 6 * H + y) * 2 * W + i / 3 % 2 * W + x) + i % 3] += le + panel[i / 3][i % 3];
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
    double n = fmax(4096, (argc > 1 ? strtod(argv[1], NULL) : 131072) / (getenv("SHORT") ? 16 : 1));
    printf("%-14s %9s %12s %12s %10s %8s\n", "technique", "samples", "estimate", "exact", "std.error", "seconds");
    table(0.2, 10, (uint32_t)n);
    table(0.4, 200, (uint32_t)n);
    table(1, 2000, (uint32_t)n);
    printf("What to see: the winner changes from lamp to lamp; MIS is never far off, for the price of both rays.\n");
    picture(argc > 2 ? argv[2] : "18_mis");
    printf("lesson 18: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: the balance heuristic (-DEX=1): more or less noise? Answer: more where one technique is nearly
       perfect: it trusts the other too much, 0.00066, not 0.00038, for the shiny plate, 0.00012, not 4.4e-6, for the
       small lamp.
   (2) Break: no weights (-DEX=2): the means double. Both weights 1/2 (-DEX=3): the means are right, only the check of
       the variance sees it. In the weight, the lamp's density per area, not per solid angle (-DEX=4): the weights no
       longer sum to 1, and the means are 0.322, 1.29 and 0.978.
   (3) Extend: draw one technique with probability 1/2 instead of both, and divide by 1/2. Answer: balance is the best
       weight now, and the errors 0.0010, 0.0056, 0.0026, worse than both even at equal numbers of rays. */
