/* Lesson 18: Multiple importance sampling (MIS)

   QUESTION  A lamp in a rough plate: should the shadow ray ask the lamp (lesson 17), or should the ray be
             reflected by the BRDF and hit the lamp by luck? Neither is right for all lamps and plates.
   IDEA      Do both, and weigh. Two techniques with densities p1, p2 (both per solid angle!) draw X1, X2:

                 F = w1(X1) f(X1)/p1(X1) + w2(X2) f(X2)/p2(X2),     w1(x) + w2(x) = 1 wherever f(x) > 0

             E[F] = int w1 f + int w2 f = int f: unbiased for every such pair of weights. Good weights trust
             the technique that was likely to find x: w1 = p1 / (p1 + p2) is the balance heuristic,
             w1 = p1^2 / (p1^2 + p2^2) the power heuristic. Balance is never far behind any other weights:
             V(balance) <= V(other) + mean^2/2, two techniques, one sample of each ([Vea97] theorem 9.2).
   EXACT     A plate with a Phong lobe f = (n+2)/(2 pi) cos^n, seen from straight above; a lamp of radius r,
             radiance L, its centre d above, fills a cone of half angle a, sin a = r/d. So
                 Lr = L (n+2) int_(cos a)^1 c^(n+1) dc = L (1 - (1 - r^2/d^2)^((n+2)/2)),   L = 1/r^2 here.
   BUILD     cc -O2 -I.. 18_mis.c -o 18_mis -lm -pthread
   RUN       ./18_mis [samples] [output]
   PRINTS                     samples     estimate        exact  std error  seconds
             lamp of radius 1, plate of exponent 2000
             my light          131072      1.00757            1      0.015    0.054
             my bsdf           131072            1            1    1.4e-06    0.067
             my MIS            131072     0.999278            1    0.00038    0.109
   WORDS     multiple importance sampling 多重重要性采样, next event estimation 下一事件估计(直接光采样),
             variance 方差, unbiased 无偏, probability density 概率密度, glossy 光泽(有光泽反射)
   HEADER    [PT-03] pt_mis_weight, [PT-08] pt_bsdf_sample, pt_bsdf_pdf_w, [PT-09] pt_light_sample,
             [PT-10] pt_light_pdf_w, [PT-11] pt_li_path, [PT-19] pt_scene_veach_plates
   SOURCES   [Vea97] chapter 9: weights, heuristics, theorem 9.2, the plates
   Before: lesson 17. Next: lesson 19. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0
#endif
#define MISTAKE (EX >= 2)

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact, pt_stats_standard_error(s),
           seconds);
}

enum { LIGHT = 1, BSDF = 2, BOTH = 3 };

/* --- mine --- */

/* The weight of the technique with density p, when the other one has density q at the same direction. */
static double my_weight(double p, double q)
{
    if (EX == 1) return p / (p + q); /* balance heuristic                                        */
    if (EX == 2) return 1;           /* WRONG: the light is counted twice                        */
    if (EX == 3) return 0.5;         /* unbiased, but keeps a quarter of the worse one's variance */
    return p * p / (p * p + q * q);  /* power heuristic                                          */
}

static pt_vec2 draw(pt_pcg32 *rng)
{
    double x = pt_pcg32_double(rng), y = pt_pcg32_double(rng);
    return pt_v2((pt_real)x, (pt_real)y);
}

/* f cos L weight / p for one direction. */
static pt_rgb value(const pt_bsdf *bsdf, pt_vec3 wo, pt_vec3 wi, pt_rgb radiance, double weight, double p)
{
    pt_rgb f = pt_bsdf_eval(bsdf, wo, wi, PT_RADIANCE, PT_LOBE_ALL);
    double cosine = fabs((double)pt_v3_dot(wi, bsdf->frame.n));
    return pt_rgb_scale(pt_rgb_mul(f, radiance), (pt_real)(weight * cosine / p));
}

/* Direct light at a hit. part[0]: what light sampling found, part[1]: what BSDF sampling found; add them. */
static void my_direct(const pt_scene *scene, const pt_hit *hit, pt_vec3 wo, int technique, pt_pcg32 *rng,
                      pt_rgb part[2])
{
    pt_bsdf bsdf = pt_bsdf_make(&scene->materials[hit->material], hit);
    pt_light_sample_result ls;
    pt_bsdf_sample_result bs;
    double pmf, u = pt_pcg32_double(rng), u_lobe = pt_pcg32_double(rng);
    pt_vec2 u_light = draw(rng), u_bsdf = draw(rng);
    int light = pt_light_choose(scene, u, &pmf);
    part[0] = part[1] = pt_rgb_grey(0);

    if ((technique & LIGHT) && light >= 0 && pt_light_sample(scene, light, hit->p, u_light, &ls)) {
        pt_ray shadow = pt_spawn_ray_to(hit->p, hit->p_error, hit->ng, ls.p, ls.p_error, ls.n);
        double p = pmf * ls.pdf_w, q = (double)pt_bsdf_pdf_w(&bsdf, wo, ls.wi, PT_RADIANCE);
        double d = (double)ls.distance, per_area = p * fabs((double)pt_v3_dot(ls.n, ls.wi)) / (d * d);
        double weight = technique == BOTH ? my_weight(EX == 4 ? per_area : p, q) : 1; /* EX 4: WRONG */
        if (!pt_occluded(scene, &shadow)) part[0] = value(&bsdf, wo, ls.wi, ls.radiance, weight, p);
    }
    if ((technique & BSDF) && pt_bsdf_sample(&bsdf, wo, u_lobe, u_bsdf, PT_RADIANCE, &bs)) {
        pt_ray ray = pt_spawn_ray(hit->p, hit->p_error, hit->ng, bs.wi);
        pt_hit lamp;
        if (pt_intersect(scene, &ray, &lamp) && lamp.light >= 0) {
            double p = (double)bs.pdf_w;
            double q = scene->lights[lamp.light].pmf;
            pt_rgb radiance = pt_hit_emission(scene, &lamp, pt_v3_neg(bs.wi));
            q *= pt_light_pdf_w(scene, lamp.light, hit->p, bs.wi, &lamp);
            part[1] = value(&bsdf, wo, bs.wi, radiance, technique == BOTH ? my_weight(p, q) : 1, p);
        }
    }
}

/* --- comparison with the header, and with the exact value --- */

static const double height = 4, radius[3] = {0.2, 0.4, 1}, exponent[3] = {10, 200, 2000};

static pt_scene plate_scene(double r, double n) /* the lamp has the same power whatever its radius */
{
    pt_scene scene = PT_SCENE_INIT;
    int plate = pt_add_material(&scene, pt_material_phong(pt_rgb_grey(0), pt_rgb_grey(1), (pt_real)n));
    int lamp = pt_add_material(&scene, pt_material_emitter(pt_rgb_grey((pt_real)(1 / (r * r)))));
    pt_add_parallelogram(&scene, pt_v3(-1, 0, -1), pt_v3(0, 0, 2), pt_v3(2, 0, 0), plate);
    pt_add_sphere(&scene, pt_v3(0, (pt_real)height, 0), (pt_real)r, lamp);
    if (pt_commit(&scene) != PT_OK) fprintf(stderr, "%s\n", pt_scene_error(&scene));
    return scene;
}

static pt_stats run(const pt_scene *scene, int technique, int mine, int n, double exact)
{
    static const pt_li_fn header[4] = {NULL, pt_li_path_light, pt_li_path_plain, pt_li_path};
    static const char *const name[2][4] = {{"", "header light", "header bsdf", "header MIS"},
                                           {"", "my light", "my bsdf", "my MIS"}};
    pt_pcg32 rng = pt_pcg32_make(18, (uint64_t)technique);
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 18, 0);
    pt_ray ray = {{0, 1, 0}, {0, -1, 0}, 2};
    pt_li_options options = {0};
    pt_li_info info = {0};
    pt_stats s = PT_STATS_INIT;
    double start = pt_cpu_seconds();
    pt_hit hit;
    int i;
    options.max_edges = 2; /* emitters and direct light */
    options.heuristic = EX == 1 ? PT_HEURISTIC_BALANCE : PT_HEURISTIC_POWER;
    if (!pt_intersect(scene, &ray, &hit)) return s;
    for (i = 0; i < n; i++) {
        pt_rgb part[2];
        pt_sampler_start(&sampler, 0, (uint32_t)i);
        if (mine) my_direct(scene, &hit, pt_v3(0, 1, 0), technique, &rng, part);
        pt_stats_add(&s, mine ? (double)part[0].g + (double)part[1].g
                              : header[technique](scene, &ray, &sampler, &options, &info).g);
    }
    row(name[mine][technique], &s, exact, pt_cpu_seconds() - start);
    return s;
}

static int agrees(pt_stats s, double exact)
{
    return fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s);
}

static void compare(double r, double k, int n)
{
    pt_scene scene = plate_scene(r, k);
    double exact = (1 - pow(1 - r * r / (height * height), 0.5 * (k + 2))) / (r * r), variance[4];
    int t, all = 1;
    printf("lamp of radius %g, plate of exponent %g\n", r, k);
    for (t = LIGHT; t <= BOTH; t++) {
        pt_stats mine;
        all = agrees(run(&scene, t, 1, n / 16, exact), exact) && all;
        mine = run(&scene, t, 1, n, exact);
        all = agrees(run(&scene, t, 0, n, exact), exact) && agrees(mine, exact) && all;
        variance[t] = pt_stats_variance(&mine);
    }
    check(all, "within 5 standard errors of the exact value, mine and the header's");
    check(variance[BOTH] <= fmin(variance[LIGHT], variance[BSDF]) + 0.5 * exact * exact,
          "variance of MIS at most that of the better technique + mean^2/2");
    pt_scene_free(&scene);
}

/* --- the picture: Veach's plates by light sampling, by BSDF sampling, by MIS, and who found the light:
   red = light sampling, green = BSDF sampling --- */

enum { W = 160, H = 120 };

static void put(unsigned char *image, int panel, int x, int y, pt_rgb c)
{
    unsigned char *p = image + 3 * ((y + panel / 2 * H) * 2 * W + x + panel % 2 * W);
    p[0] = pt_srgb_byte((double)c.r);
    p[1] = pt_srgb_byte((double)c.g);
    p[2] = pt_srgb_byte((double)c.b);
}

static int picture(const char *output, int spp)
{
    static unsigned char image[3 * 4 * W * H];
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    pt_pcg32 rng = pt_pcg32_make(180, 0);
    pt_real scale = 1 / (pt_real)spp;
    char path[512];
    int k, s, ok = pt_scene_veach_plates(&scene, &camera) == PT_OK;
    for (k = 0; k < 3 * W * H; k++) {
        pt_rgb sum[2] = {{0, 0, 0}, {0, 0, 0}}, part[2], all = {0, 0, 0};
        int technique = 1 + k / (W * H), x = k % W, y = k / W % H;
        for (s = 0; s < spp; s++) {
            pt_vec2 u = draw(&rng), at = pt_v2(((pt_real)x + u.x) / W, ((pt_real)y + u.y) / H);
            pt_ray ray = pt_camera_ray(&camera, (pt_real)W / H, at.x, at.y, u);
            pt_hit hit;
            if (!pt_intersect(&scene, &ray, &hit)) continue;
            all = pt_rgb_add(all, pt_hit_emission(&scene, &hit, pt_v3_neg(ray.d)));
            my_direct(&scene, &hit, pt_v3_neg(ray.d), technique, &rng, part);
            sum[0] = pt_rgb_add(sum[0], part[0]);
            sum[1] = pt_rgb_add(sum[1], part[1]);
        }
        all = pt_rgb_add(all, pt_rgb_add(sum[0], sum[1]));
        put(image, technique - 1, x, y, pt_rgb_scale(all, scale));
        if (technique == BOTH) put(image, 3, x, y, pt_rgb3(sum[0].g * scale, sum[1].g * scale, 0));
    }
    pt_scene_free(&scene);
    snprintf(path, sizeof path, "%s.ppm", output);
    ok = ok && pt_write_ppm_bytes(path, image, 2 * W, 2 * H) == PT_OK;
    snprintf(path, sizeof path, "%s.png", output);
    return ok && pt_write_png_bytes(path, image, 2 * W, 2 * H) == PT_OK;
}

int main(int argc, char **argv)
{
    int n = argc > 1 && atoi(argv[1]) > 0 ? atoi(argv[1]) : 131072, k;
    const char *output = argc > 2 ? argv[2] : "18_mis";
    if (getenv("SHORT")) n /= 16;
    printf("%-14s %9s %12s %12s %10s %8s\n", "", "samples", "estimate", "exact", "std error", "seconds");
    for (k = 0; k < 3; k++) compare(radius[k], exponent[k], n);
    printf("See: the winner changes from lamp to lamp; MIS stays near it, for the price of both rays.\n");
    check(picture(output, 8), "picture written");
    printf("lesson 18: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("the mistake of exercise %d was %s\n", EX, failed ? "noticed" : "NOT noticed");
    return !failed;
}

/* EXERCISES (cc -DEX=1 ... compiles the first one, and so on)
   1. Predict and run, -DEX=1: the balance heuristic. Where one technique is nearly perfect it trusts the
      other too much: std error .00066, not .00038, for the shiny plate; 1.2e-4, not 4.4e-6, for the small
      lamp.
   2. Break it, and watch which check fails. -DEX=2: no weights (the means double). -DEX=3: both weights 1/2
      (only the check of the variance sees it: the means are right). -DEX=4: in the weight, the lamp's
      density is per area instead of per solid angle: weights no longer sum to 1 (.3223 instead of .3727).
   3. Extend it: draw one technique with probability 1/2 instead of both, and divide by 1/2
      (pt_estimate_mis_one). Balance is the best weight there ([Vea97] theorem 9.4); one ray instead of two.
   */
