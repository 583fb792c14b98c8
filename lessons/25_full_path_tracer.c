/* Lesson 25: the full path tracer, and what each of its choices is worth

   QUESTION   All pieces together: how short is a path tracer for every scene of this course, and which of its choices
              pay, measured as error against run time?
   IDEA       Path tracing is one loop. At each surface, with the throughput beta of the path so far:

                  emission found    sum += beta w_bsdf Le            w_bsdf = 1 seen directly or after a mirror
                  light sampled     sum += beta w_light f Le cos / p_light
                  next direction    beta *= f cos / p_bsdf           from the BSDF
                  Russian roulette  survive with q = min(1, largest band of beta), beta /= q

              with the weights w of multiple importance sampling (lesson 18). Choices: sample points (independent,
              stratified, Sobol's low-discrepancy sequence), roulette, light technique, and to use the machine: a small
              scene is traced by as many paths in lockstep as a SIMD register has lanes, in a body without the sky. All but
              cutting paths are free of bias: they change error and time, so the convergence, never the mean. What a
              choice is worth are the seconds for a given error, here a root mean square error of 10 % of each pixel.
              The exact mean luminance of the Cornell box's picture is 0.133522, se 0.0003 at most:
              tests/data/cornell_reference.csv. Ours has the standard error that the film's halves tell, even and odd
              samples: the sum of (A - B)^2 / 4 over pixels. The true error is that against 512 samples.
   PICTURE    A mirror and a glass sphere in the box, by my_path, 12 samples a pixel, made 1.5 times as bright.
   PLOT       The true error of each choice against seconds, for 1 to 32 samples a pixel.
   BUILD      cc -O2 -I.. 25_full_path_tracer.c -o 25_full_path_tracer -lm -pthread
   RUN        ./25_full_path_tracer [samples per pixel] [output]     writes also output.svg, error against seconds
   PRINTS     choice           samples         mean   est. error true error  sec 10%
              all of it             32      0.13341       0.1501     0.1735    0.401
   WORDS      path tracing 路径追踪; throughput 吞吐量; Russian roulette 俄罗斯轮盘赌; low-discrepancy sequence 低差异序列;
              multiple importance sampling 多重重要性采样; convergence 收敛; root mean square error 均方根误差
   HEADER     [PT-02] pt_sampler, [PT-11] pt_li_path, pt_li_options, [PT-18] pt_render, pt_report_write_svg
   SOURCES    [Kaj86], [Vea97], [PBR] 13 and 14
   Before: lesson 24, is it correct? Next: pathtracer.h itself, from [PT-00] on. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { W = 40, MISTAKE = EX >= 2 };

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

/* ---- the new piece: all of it -------------------------------------------------------------------------- */

static void add(pt_rgbd *sum, pt_rgbd beta, pt_rgb c, double k)
{
    sum->r += beta.r * (double)c.r * k;
    sum->g += beta.g * (double)c.g * k;
    sum->b += beta.b * (double)c.b * k;
}

static double my_weight(double p, double q) { return EX == 4 ? 1 : p * p / (p * p + q * q); } /* 4: counted twice */

/* Light from one light, at a surface that is no mirror and no smooth glass. */
static void my_direct(const pt_scene *scene, const pt_hit *hit, const pt_bsdf *bsdf, pt_vec3 wo, pt_rgbd beta,
                      double u_choice, pt_vec2 u, pt_rgbd *sum)
{
    pt_light_sample_result ls;
    double pmf;
    int light = pt_light_choose(scene, u_choice, &pmf);
    if (light < 0 || !pt_light_sample(scene, light, hit->p, u, &ls)) return;
    pt_rgb f = pt_bsdf_eval(bsdf, wo, ls.wi, PT_RADIANCE, PT_LOBE_ALL);
    pt_ray shadow = ls.infinite ? pt_spawn_ray(hit->p, hit->p_error, hit->ng, ls.wi)
                                : pt_spawn_ray_to(hit->p, hit->p_error, hit->ng, ls.p, ls.p_error, ls.n);
    if (!(f.r + f.g + f.b > 0) || pt_occluded(scene, &shadow)) return;
    double p = pmf * ls.pdf_w, w = my_weight(p, (double)pt_bsdf_pdf_w(bsdf, wo, ls.wi, PT_RADIANCE));
    double cosine = fabs((double)pt_v3_dot(ls.wi, bsdf->frame.n));
    add(sum, beta, pt_rgb_mul(f, ls.radiance), (ls.delta ? 1 : w) * cosine / p);
}

static pt_rgbd my_path(const pt_scene *scene, pt_ray ray, pt_sampler *sampler)
{
    pt_rgbd sum = {0, 0, 0}, beta = {1, 1, 1};
    double pdf = 0, eta2 = 1; /* pdf: of the last direction, 0 = no other technique could have found it */
    ray.d = pt_v3_normalize(ray.d);
    for (int edges = 1;; edges++) {
        pt_sampler_seek(sampler, PT_DIM_EDGE(edges)); /* then in the order of PT_DIM_BSDF to PT_DIM_ROULETTE */
        pt_vec2 u_bsdf = pt_sampler_2d(sampler), u_light = pt_sampler_2d(sampler);
        double u_choice = (double)pt_sampler_1d(sampler), u_lobe = (double)pt_sampler_1d(sampler);
        pt_vec3 wo = pt_v3_neg(ray.d);
        pt_bsdf_sample_result s;
        pt_hit hit;
        int met = pt_intersect(scene, &ray, &hit), light = met ? hit.light : scene->environment_light;
        if (light >= 0) {
            pt_rgb le = met ? pt_hit_emission(scene, &hit, wo) : pt_environment_radiance(scene, ray.d);
            double p = pt_light_pdf_w(scene, light, ray.o, ray.d, met ? &hit : NULL) * scene->lights[light].pmf;
            add(&sum, beta, le, pdf > 0 ? my_weight(pdf, p) : 1);
        }
        if (!met) return sum;
        pt_bsdf bsdf = pt_bsdf_make(&scene->materials[hit.material], &hit);
        if (bsdf.lobes & (PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY))
            my_direct(scene, &hit, &bsdf, wo, beta, u_choice, u_light, &sum);
        if (!pt_bsdf_sample(&bsdf, wo, u_lobe, u_bsdf, PT_RADIANCE, &s)) return sum;
        pdf = s.lobe == PT_LOBE_SPECULAR ? 0 : (double)s.pdf_w;
        eta2 *= (double)(s.eta * s.eta); /* what glass took from radiance must not count as darkness */
        beta = pt_rgbd3(beta.r * (double)s.weight.r, beta.g * (double)s.weight.g, beta.b * (double)s.weight.b);
        double q = edges < 3 ? 1 : fmin(1, fmax(beta.r, fmax(beta.g, beta.b)) * eta2);
        if (!((double)pt_sampler_1d(sampler) < q)) return sum;
        if (EX == 3) q = 1; /* the survivors must carry the light of the dead */
        beta = pt_rgbd3(beta.r / q, beta.g / q, beta.b / q);
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, s.wi);
    }
}

/* Even samples go to half A of the film, odd ones to half B, which is independent: it has its own seed. spp is even. */
static int my_render(const pt_scene *scene, const pt_camera *camera, int w, uint32_t spp, pt_film *film)
{
    pt_sampler_kind kind = EX == 1 ? PT_SAMPLER_INDEPENDENT : PT_SAMPLER_SOBOL;
    pt_sampler sampler[2] = {pt_sampler_make(kind, 25, 0), pt_sampler_make(kind, 26, 0)};
    if (pt_film_make(film, w, w, 0) != PT_OK) return 0;
    for (int k = 0; k < w * w; k++)
        for (uint32_t i = 0; i < spp; i++) {
            pt_sampler_start(&sampler[i % 2], (uint64_t)k, i / 2);
            pt_vec2 u = pt_sampler_2d(&sampler[i % 2]);
            pt_real x = ((pt_real)(k % w) + u.x) / (pt_real)w, y = ((pt_real)(k / w) + u.y) / (pt_real)w;
            pt_rgbd c = my_path(scene, pt_camera_ray(camera, 1, x, y, pt_v2(0, 0)), &sampler[i % 2]);
            double *pixel = film->half[i % 2] + 3 * k;
            pixel[0] += c.r;
            pixel[1] += c.g;
            pixel[2] += c.b;
        }
    film->samples[0] = film->samples[1] = spp / 2;
    return 1;
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

/* Prints a row; 1 if the picture's mean luminance is exact within 5 standard errors, ours and the reference's. */
static int row(const char *name, const pt_film *film, const float *reference, double seconds)
{
    double mean = 0, variance = 0, exact = 0.133522, exact_se = 0.0003, na = film->samples[0], nb = film->samples[1];
    pt_error estimated, actual;
    for (int k = 0; k < W * W; k++) {
        const double *a = film->half[0] + 3 * k, *b = film->half[1] + 3 * k;
        double y = pt_luminance(a[0], a[1], a[2]) / na, z = pt_luminance(b[0], b[1], b[2]) / nb;
        mean += (y + z) / 2 / (W * W);
        variance += pow((y - z) / 2 / (W * W), 2);
    }
    pt_film_error_estimate(film, &estimated);
    pt_film_error(film, reference, &actual);
    printf("%-14s %9.0f %12.5f %12.4f %10.4f %8.3f\n", name, na + nb, mean, sqrt(estimated.relmse),
           sqrt(actual.relmse), seconds * actual.relmse / 0.01);
    return fabs(mean - exact) <= 5 * sqrt(variance + exact_se * exact_se);
}

/* The same picture by each choice of the header, and by mine; the plot has error against run time. */
static void table(const pt_scene *scene, const pt_camera *camera, uint32_t spp, const char *output)
{
    static const struct {
        const char *name;
        pt_render_desc desc; /* zero is the default: MIS, Sobol points, roulette by throughput */
    } choice[9] = {{"reference", {.seed = 1}},
                   {"all of it", {.no_lockstep = 1}}, /* one path at a time, as mine goes */
                   {"independent", {.no_lockstep = 1, .sampler = PT_SAMPLER_INDEPENDENT}},
                   {"stratified", {.no_lockstep = 1, .sampler = PT_SAMPLER_STRATIFIED}},
                   {"roulette .8", {.no_lockstep = 1, .li = {.roulette = PT_ROULETTE_CONSTANT}}},
                   {"no roulette", {.no_lockstep = 1, .li = {.roulette = PT_ROULETTE_NONE, .max_edges = EX == 2 ? 4 : 20}}},
                   {"light only", {.no_lockstep = 1, .method = "path-light"}},
                   {"BSDF only", {.no_lockstep = 1, .method = "path-plain"}},
                   {"in lockstep", {.seed = 0}}}; /* paths walk together, as many as the machine has lanes */
    static float reference[3 * W * W];
    pt_report report[9];
    const pt_report *lines[9];
    const char *labels[9], *title = "The Cornell box: error against run time";
    pt_film film = PT_FILM_INIT;
    int good = 1;
    memset(report, 0, sizeof report);
    for (int k = 0; k < 9; k++) {
        pt_render_desc desc = choice[k].desc;
        desc.camera = *camera;
        desc.width = desc.height = W;
        desc.spp = k ? spp : 512;
        desc.reference = k ? reference : NULL;
        good &= pt_render(scene, &desc, &film, &report[k]) == PT_OK;
        if (k > 0) good &= row(choice[k].name, &film, reference, report[k].cpu_seconds);
        for (int i = 0; i < 3 * W * W && k == 0; i++)
            reference[i] = (float)((film.half[0][i] + film.half[1][i]) / 512);
        lines[k] = &report[k];
        labels[k] = choice[k].name;
        pt_film_free(&film);
    }
    double start = pt_cpu_seconds();
    good &= my_render(scene, camera, W, spp, &film);
    good &= row("mine", &film, reference, pt_cpu_seconds() - start);
    check(good, "every choice has the exact mean, within 5 standard errors");
    check(pt_report_write_svg(lines + 1, labels + 1, 8, title, output) == PT_OK, output);
    for (int k = 0; k < 9; k++) pt_report_free(&report[k]);
    pt_film_free(&film);
}

static void picture(const char *output)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_camera camera;
    char path[512];
    if (pt_scene_cornell_spheres(&scene, &camera) != PT_OK || !my_render(&scene, &camera, 160, 12, &film)) return;
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1.5);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1.5) == PT_OK, path);
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    double n = fmax(2, (argc > 1 ? strtod(argv[1], NULL) : 32) / (getenv("SHORT") && !MISTAKE ? 16 : 1));
    const char *output = argc > 2 ? argv[2] : "25_full_path_tracer";
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    char path[512];
    if (pt_scene_cornell(&scene, &camera) != PT_OK) return 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "choice", "samples", "mean", "est. error", "true error", "sec 10%");
    snprintf(path, sizeof path, "%s.svg", output);
    table(&scene, &camera, 2 * (uint32_t)(n / 2), path);
    printf("What to see: all means agree; asking for light is worth most by far, then to end paths early.\n");
    picture(output);
    pt_scene_free(&scene);
    printf("lesson 25: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: my path tracer with independent points instead of Sobol's (-DEX=1). Same mean; what error? Answer: 0.24
       instead of 0.19, as if it had two thirds of the samples.
   (2) Break: "no roulette" cut after two bounces (-DEX=2): its estimated error is the smallest of all, as the halves
       agree on what both leave out; only the mean tells. Roulette without 1/q (-DEX=3): a smaller error, and a mean 4 %
       too dark. Weights 1 (-DEX=4): light counted twice.
   (3) Extend: render "veach-plates" instead, 64 samples. Which choice that is as good as the best here is the worst
       there? Answer: light only, 135 s; BSDF only takes 18, both 0.3. In "glass-ball" single pixels decide, an error of
       0.2 or of 18, as a path has found the caustic or not: that takes paths from the light. */
