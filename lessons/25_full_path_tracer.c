/* Lesson 25: The full path tracer, and what each of its choices is worth

   QUESTION  All pieces together: how short is a path tracer for every scene of this course, and which
             of its choices pay, measured as error against run time?
   IDEA      One loop. At each surface, with the path's weight beta so far:

                 emission found    sum += beta w_bsdf Le            w_bsdf = 1 seen directly or after a mirror
                 light sampled     sum += beta w_light f Le cos / p_light
                 next direction    beta *= f cos / p_bsdf           from the BSDF
                 Russian roulette  survive with q = min(1, largest band of beta), beta /= q

             with w from lessons 17 and 18. Choices: sample points (independent, stratified, Sobol), roulette,
             light technique, and to leave out what a scene does not need: a scene without mirrors, glass and
             sky is traced by a body in which they do not exist. All but cutting paths are free of bias: they
             change the error and the time, never the mean. Worth = 1 / (error^2 seconds).
   EXACT     The mean of the Cornell box's picture in tests/data/cornell_reference.csv: .227625, .116342,
             .026600 in R, G, B, so luminance .133522; se .000252, .000132, .000034. Our standard error comes
             from the halves of the film, of even and odd samples: the sum of (A - B)^2 / 4 over pixels.
   BUILD     cc -O2 -I.. 25_full_path_tracer.c -o 25_full_path_tracer -lm -pthread
   RUN       ./25_full_path_tracer [samples per pixel] [output]
   PRINTS
             choice           samples         mean    est. RMSE  rays/path  seconds
             all of it             32      0.13383      0.03125       4.61    0.173
             independent           32      0.13245      0.07968        4.6    0.161
             BSDF only             32      0.13177       0.1353        2.9    0.093
   WORDS     path tracing 路径追踪, throughput 吞吐量(路径通量), Russian roulette 俄罗斯轮盘赌,
             multiple importance sampling 多重重要性采样, low-discrepancy 低差异序列, convergence 收敛,
             root mean square error 均方根误差
   HEADER    [PT-02] pt_sampler, [PT-11] pt_li_path, pt_li_options, [PT-18] pt_render, pt_report_write_svg
   SOURCES   [Kaj86], [Vea97], [PBR] 13 and 14
   Before: lesson 24. Next: pathtracer.h itself, from [PT-00] on. */

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

/* --- mine --- */

static void add(pt_rgbd *sum, pt_rgbd beta, pt_rgb c, double k)
{
    sum->r += beta.r * (double)c.r * k;
    sum->g += beta.g * (double)c.g * k;
    sum->b += beta.b * (double)c.b * k;
}

static double my_weight(double p, double q) { return EX == 4 ? 1 : p * p / (p * p + q * q); } /* 4: WRONG */

/* Light from one light, at a surface that is no mirror and no smooth glass. */
static void my_direct(const pt_scene *scene, const pt_hit *hit, const pt_bsdf *bsdf, pt_vec3 wo, pt_rgbd beta,
                      uint32_t dimension, pt_sampler *sampler, pt_rgbd *sum)
{
    pt_light_sample_result ls;
    pt_ray shadow;
    pt_rgb f;
    pt_vec2 u;
    double pmf, p, w;
    int light;
    pt_sampler_seek(sampler, dimension + PT_DIM_LIGHT);
    u = pt_sampler_2d(sampler);
    pt_sampler_seek(sampler, dimension + PT_DIM_LIGHT_CHOICE);
    light = pt_light_choose(scene, (double)pt_sampler_1d(sampler), &pmf);
    if (light < 0 || !pt_light_sample(scene, light, hit->p, u, &ls)) return;
    f = pt_bsdf_eval(bsdf, wo, ls.wi, PT_RADIANCE, PT_LOBE_ALL);
    if (!(pt_rgb_max(f) > 0)) return;
    if (ls.infinite) shadow = pt_spawn_ray(hit->p, hit->p_error, hit->ng, ls.wi);
    else shadow = pt_spawn_ray_to(hit->p, hit->p_error, hit->ng, ls.p, ls.p_error, ls.n);
    if (pt_occluded(scene, &shadow)) return;
    p = pmf * ls.pdf_w;
    w = ls.delta ? 1 : my_weight(p, (double)pt_bsdf_pdf_w(bsdf, wo, ls.wi, PT_RADIANCE));
    add(sum, beta, pt_rgb_mul(f, ls.radiance), w * fabs((double)pt_v3_dot(ls.wi, bsdf->frame.n)) / p);
}

/* The weight of light that the BSDF's direction found. */
static double my_hit_weight(const pt_scene *scene, int light, pt_ray *ray, const pt_hit *hit, double pdf)
{
    if (pdf == 0) return 1;
    return my_weight(pdf, scene->lights[light].pmf * pt_light_pdf_w(scene, light, ray->o, ray->d, hit));
}

static pt_rgbd my_path(const pt_scene *scene, pt_ray ray, pt_sampler *sampler)
{
    pt_rgbd sum = {0, 0, 0}, beta = {1, 1, 1}, next;
    double pdf = 0, eta2 = 1, q; /* pdf: of the last direction, 0 = no other technique could have found it */
    int edges;
    ray.d = pt_v3_normalize(ray.d);
    for (edges = 1;; edges++) {
        uint32_t dimension = PT_DIM_EDGE(edges);
        pt_vec3 wo = pt_v3_neg(ray.d);
        pt_bsdf_sample_result s;
        pt_bsdf bsdf;
        pt_hit hit;
        pt_vec2 u;
        int sky = scene->environment_light;
        if (!pt_intersect(scene, &ray, &hit)) {
            if (sky >= 0)
                add(&sum, beta, pt_environment_radiance(scene, ray.d),
                    my_hit_weight(scene, sky, &ray, NULL, pdf));
            return sum;
        }
        bsdf = pt_bsdf_make(&scene->materials[hit.material], &hit);
        if (hit.light >= 0)
            add(&sum, beta, pt_hit_emission(scene, &hit, wo),
                my_hit_weight(scene, hit.light, &ray, &hit, pdf));
        if (bsdf.lobes & (PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY))
            my_direct(scene, &hit, &bsdf, wo, beta, dimension, sampler, &sum);

        pt_sampler_seek(sampler, dimension + PT_DIM_BSDF);
        u = pt_sampler_2d(sampler);
        pt_sampler_seek(sampler, dimension + PT_DIM_LOBE);
        if (!pt_bsdf_sample(&bsdf, wo, (double)pt_sampler_1d(sampler), u, PT_RADIANCE, &s)) return sum;
        pdf = s.lobe == PT_LOBE_SPECULAR ? 0 : (double)s.pdf_w;
        eta2 *= (double)(s.eta * s.eta); /* what glass took from radiance must not count as darkness */
        next = pt_rgbd3(0, 0, 0);
        add(&next, beta, s.weight, 1);
        q = edges < 3 ? 1 : fmin(1 - 1e-6, fmax(next.r, fmax(next.g, next.b)) * eta2);
        pt_sampler_seek(sampler, dimension + PT_DIM_ROULETTE);
        if (!((double)pt_sampler_1d(sampler) < q)) return sum;
        if (EX == 3) q = 1; /* WRONG: the survivors must carry the light of the dead */
        beta = pt_rgbd3(next.r / q, next.g / q, next.b / q);
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, s.wi);
    }
}

static int my_render(const pt_scene *scene, const pt_camera *camera, int width, uint32_t spp, pt_film *film)
{
    pt_sampler_kind kind = EX == 1 ? PT_SAMPLER_INDEPENDENT : PT_SAMPLER_SOBOL;
    pt_sampler sampler[2];
    uint32_t i, k;
    sampler[0] = pt_sampler_make(kind, 25, 0); /* the halves are independent: each has its own seed */
    sampler[1] = pt_sampler_make(kind, 26, 0);
    if (pt_film_make(film, width, width, 0) != PT_OK) return 0;
    for (k = 0; k < (uint32_t)(width * width); k++)
        for (i = 0; i < spp; i++) {
            pt_sampler *s = &sampler[i % 2];
            double *pixel = film->half[i % 2] + 3 * k;
            pt_rgbd c;
            pt_vec2 u;
            pt_sampler_start(s, k, i / 2);
            u = pt_sampler_2d(s);
            u.x = (u.x + (pt_real)(k % (uint32_t)width)) / (pt_real)width;
            u.y = (u.y + (pt_real)(k / (uint32_t)width)) / (pt_real)width;
            c = my_path(scene, pt_camera_ray(camera, 1, u.x, u.y, pt_v2(0, 0)), s);
            pixel[0] += c.r;
            pixel[1] += c.g;
            pixel[2] += c.b;
        }
    film->samples[0] = (spp + 1) / 2;
    film->samples[1] = spp / 2;
    return 1;
}

/* --- means, errors, choices --- */

static const double exact = 0.133522, exact_se = 0.0003;

/* The picture's mean luminance; its standard error from the halves. */
static pt_stats mean_of(const pt_film *film)
{
    pt_stats s = PT_STATS_INIT;
    double na = film->samples[0], nb = film->samples[1], variance = 0, sum = 0;
    int k, h, pixels = film->width * film->height;
    for (k = 0; k < pixels; k++) {
        double y[2];
        for (h = 0; h < 2; h++) {
            const double *c = film->half[h] + 3 * k;
            y[h] = pt_luminance(c[0], c[1], c[2]);
        }
        sum += (y[0] + y[1]) / (na + nb);
        variance += (y[0] / na - y[1] / nb) * (y[0] / na - y[1] / nb) / 4;
    }
    s.n = na + nb;
    s.mean = sum / pixels;
    s.m2 = variance / pixels / pixels * s.n * (s.n - 1);
    return s;
}

static int agrees(pt_stats s)
{
    double e = pt_stats_standard_error(&s);
    return fabs(s.mean - exact) <= 5 * sqrt(e * e + exact_se * exact_se);
}

enum { CHOICES = 8, W = 48 };

static pt_render_desc choice(int k, const pt_camera *camera, uint32_t spp)
{
    pt_render_desc d = pt_render_defaults();
    d.camera = *camera;
    d.width = d.height = W;
    d.spp = spp;
    d.threads = 1;
    d.general_body = k == 1;
    d.sampler = k == 2 ? PT_SAMPLER_INDEPENDENT : k == 3 ? PT_SAMPLER_STRATIFIED : PT_SAMPLER_SOBOL;
    d.li.roulette = k == 4 ? PT_ROULETTE_CONSTANT : k == 5 ? PT_ROULETTE_NONE : PT_ROULETTE_THROUGHPUT;
    d.li.max_edges = k == 5 ? (EX == 2 ? 4 : 20) : 0; /* 2: WRONG, two bounces are not enough */
    d.method = k == 6 ? "path-light" : k == 7 ? "path-plain" : "path";
    return d;
}

static int compare(const pt_scene *scene, const pt_camera *camera, uint32_t spp)
{
    uint32_t n;
    int header, ok = 1;
    for (header = 0; header < 2; header++)
        for (n = spp < 32 ? spp : spp / 16; n <= spp; n *= 4) {
            pt_film film = PT_FILM_INIT;
            pt_render_desc desc = choice(0, camera, n);
            double start = pt_cpu_seconds();
            pt_stats s;
            if (header) ok = pt_render(scene, &desc, &film, NULL) == PT_OK && ok;
            else ok = my_render(scene, camera, W, n, &film) && ok;
            s = mean_of(&film);
            row(header ? "header" : "mine", &s, exact, pt_cpu_seconds() - start);
            ok = ok && agrees(s);
            pt_film_free(&film);
        }
    return ok;
}

/* The same picture by each choice; the plot has error against run time. */
static void choices(const char *output, const pt_scene *scene, const pt_camera *camera, uint32_t spp)
{
    static const char *const name[CHOICES] = {"all of it", "general body", "independent", "stratified",
                                              "roulette .8", "no roulette", "light only", "BSDF only"};
    static const int plotted[5] = {0, 2, 4, 6, 7};
    pt_report report[CHOICES];
    const pt_report *lines[5];
    const char *labels[5];
    pt_stats s[CHOICES];
    double error[CHOICES];
    char path[512];
    int k, ok = 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "choice", "samples", "mean", "est. RMSE", "rays/path",
           "seconds");
    for (k = 0; k < CHOICES; k++) {
        pt_render_desc desc = choice(k, camera, spp);
        pt_film film = PT_FILM_INIT;
        const pt_report empty = PT_REPORT_INIT, *r = &report[k];
        report[k] = empty;
        if (pt_render(scene, &desc, &film, &report[k]) != PT_OK) return;
        s[k] = mean_of(&film);
        ok = ok && agrees(s[k]);
        error[k] = r->rows[r->row_count - 1].error.rmse;
        printf("%-14s %9u %12.5g %12.4g %10.3g %8.3f\n", name[k], r->spp, s[k].mean, error[k],
               (double)r->rays / (W * W * (double)spp), r->cpu_seconds);
        pt_film_free(&film);
    }
    check(ok, "every choice has the exact mean, within 5 standard errors");
    check(fabs(s[1].mean / s[0].mean - 1) < 1e-5, "the body without mirrors, glass, sky: the same picture");
    check(error[7] > error[0], "BSDF sampling alone has the larger error");
    for (k = 0; k < 5; k++) {
        lines[k] = &report[plotted[k]];
        labels[k] = name[plotted[k]];
    }
    snprintf(path, sizeof path, "%s.svg", output);
    ok = pt_report_write_svg(lines, labels, 5, "The Cornell box: error against run time", path) == PT_OK;
    check(ok, "plot written");
    for (k = 0; k < CHOICES; k++) pt_report_free(&report[k]);
}

/* A mirror and a glass sphere in the box, by my_path. */
static int picture(const char *output, uint32_t spp)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_camera camera;
    char path[512];
    int ok = pt_scene_cornell_spheres(&scene, &camera) == PT_OK;
    ok = ok && my_render(&scene, &camera, 200, spp, &film);
    snprintf(path, sizeof path, "%s.ppm", output);
    ok = ok && pt_write_ppm(path, &film, 1.5) == PT_OK;
    snprintf(path, sizeof path, "%s.png", output);
    ok = ok && pt_write_png(path, &film, 1.5) == PT_OK;
    pt_film_free(&film);
    pt_scene_free(&scene);
    return ok;
}

int main(int argc, char **argv)
{
    int n = argc > 1 && atoi(argv[1]) > 1 ? atoi(argv[1]) : 32;
    const char *output = argc > 2 ? argv[2] : "25_full_path_tracer";
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    char needs[200];
    if (getenv("SHORT") && !MISTAKE) n = n / 16 > 2 ? n / 16 : 2; /* a mistake is not seen without samples */
    if (pt_scene_cornell(&scene, &camera) != PT_OK) return 1;
    printf("the scene needs: %s\n", pt_scene_needs_string(&scene, needs, sizeof needs));
    printf("%-14s %9s %12s %12s %10s %8s\n", "mean", "samples", "estimate", "exact", "std error", "seconds");
    check(compare(&scene, &camera, (uint32_t)n), "the reference's mean within 5 standard errors");
    choices(output, &scene, &camera, (uint32_t)n);
    printf("See: all means agree; the error and the time differ. Worth is 1 / (error^2 seconds).\n");
    check(picture(output, 12), "picture written");
    pt_scene_free(&scene);
    printf("lesson 25: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("the mistake of exercise %d was %s\n", EX, failed ? "noticed" : "NOT noticed");
    return !failed;
}

/* EXERCISES (cc -DEX=1 ... compiles the first one, and so on)
   1. Predict and run, -DEX=1: my path tracer with independent points instead of Sobol's. Same mean; what
      standard error at 32 samples? (.00094 instead of .00052.)
   2. Break it, and watch which check fails. -DEX=2: "no roulette" cut after two bounces; its estimated
      error is the smallest of all: the halves agree on what both leave out. -DEX=3: roulette without 1/q.
      -DEX=4: weights 1, light counted twice.
   3. Extend it: render the header's scene "veach-plates" with the eight choices, and "glass-ball". Which
      choice that was best here is worst there? (Light sampling only, in the smooth plates; and no choice
      finds the caustic soon: that takes paths from the light.) */
