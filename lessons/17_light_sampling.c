/* Lesson 17: light sampling (next event estimation)

   QUESTION   A path finds the lamp by chance, and seldom. Why not ask for it at every surface?

   IDEA       The integral of the rendering equation is split by where its light comes from:

                  L_o(p) = L_e + integral of f L_e(q) cos  +  integral of f (L_o(q) - L_e(q)) cos
                                 direct: sample the lamp      indirect: sample a direction, as in lesson 15

              The first one is taken over points q of the lamp, chosen with density 1/A, if nothing is in
              between:

                  direct = f L_e cos cos' A / (r^2 pmf)          pmf: probability to choose this lamp

              Now the light of a lamp that a path HITS was counted one edge before, by the sampling. So
              emission is added at the first edge only, and after mirrors, where a lamp cannot be asked.
              Adding it always counts all reflected light twice: a picture that looks fine. Two rays at each
              surface instead of one cost up to twice the time; the variance falls by a factor of 60 to 200 in
              this box.

   BUILD      cc -O2 -I.. 17_light_sampling.c -o 17_light_sampling -lm -pthread
   RUN        ./17_light_sampling [samples] [output]     writes also output.svg, error against seconds

   PRINTS     probe            samples     estimate        exact  std.error  seconds
              ...
              my floor           65536     0.134963     0.135882    0.00045    0.099
              ...
              its floor          65536     0.136319     0.135882    0.00044    0.146
              ...
                by chance        65536     0.145909     0.135882     0.0063    0.073

   WORDS      next event estimation 下一事件估计; light sampling 直接光采样; shadow ray 阴影光线; area light 面光源;
              direct lighting 直接光照; visibility 可见性; variance 方差; Cornell box 康奈尔盒

   HEADER     [PT-09] pt_light_sample, [PT-10] pt_light_choose, pt_spawn_ray_to, pt_occluded, [PT-11]
              pt_li_path_light

   SOURCES    Kajiya: The Rendering Equation, 1986; probes 2, 4, 9 of tests/data/cornell_reference.csv
              (another program, 2 * 10^7 paths); TU Wien's course warns of counting emission twice

   Before: lesson 16, how many bounces. Next: lesson 18, multiple importance sampling. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX == 2 || EX == 3 || EX == 4 || EX == 5 };
static const double P_RR = EX == 1 ? 0.5 : 0.8;

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    double error = pt_stats_standard_error(s); /* rounding alone is no error of sampling */
    if (error < 1e-6 * fabs(s->mean)) error = 0;
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact, error, seconds);
}

static pt_vec2 pair(pt_pcg32 *random)
{
    pt_real x = pt_real_from_u32(pt_pcg32_next(random));
    return pt_v2(x, pt_real_from_u32(pt_pcg32_next(random)));
}

typedef struct setting {
    pt_scene scene;
    pt_camera camera;
    pt_real x, y;        /* the point of the picture, from the left and from the top, in [0,1] */
} setting;

static const struct {
    const char *what;
    double u, v, red;    /* from the middle, upwards; radiance of the red band */
} probes[3] = {{"floor", 0, -0.46, 0.135882}, {"red wall", -0.4, 0.1, 0.191562},
               {"shadow", 0.2, -0.25, 0.008135}};

/* ---- the new piece: ask a lamp ------------------------------------------------------------------------- */

/* One value of the direct light at a hit, over f: L_e cos cos' A / (r^2 pmf). The lamp is two triangles: two
lights.
   n is the normal on the side of the eye. */
static double my_direct(const pt_scene *scene, const pt_hit *hit, pt_vec3 n, pt_pcg32 *random)
{
    int choice = (int)(pt_pcg32_next(random) % scene->light_count);
    const pt_light *light = &scene->lights[choice];
    const pt_triangle *t = &scene->triangles[scene->primitives[light->primitive].index];
    pt_vec3 a = scene->positions[t->v[0]], b = scene->positions[t->v[1]], c = scene->positions[t->v[2]];
    pt_vec3 ab = pt_v3_sub(b, a), ac = pt_v3_sub(c, a), none = pt_v3(0, 0, 0);
    pt_vec3 n_lamp = pt_v3_normalize(pt_v3_cross(ab, ac));
    pt_vec2 w = pt_warp_triangle(pair(random));
    pt_vec3 q = pt_v3_add(a, pt_v3_add(pt_v3_scale(ab, w.x), pt_v3_scale(ac, w.y)));
    pt_vec3 d = pt_v3_sub(q, hit->p);
    double r = (double)pt_v3_length(d), pmf = EX == 5 ? 1 : 1.0 / scene->light_count;
    double cosine = (double)pt_v3_dot(n, d) / r, cos_lamp = -(double)pt_v3_dot(n_lamp, d) / r;
    /* from surface to surface, without meeting either */
    pt_ray shadow = pt_spawn_ray_to(hit->p, hit->p_error, hit->ng, q, none, n_lamp);
    if (cosine <= 0 || cos_lamp <= 0) return 0;
    if (EX == 4) shadow.tmax = 2; /* the shadow ray goes on and hits the lamp itself */
    if (EX != 3 && pt_occluded(scene, &shadow)) return 0;
    return (double)light->emission.r * cosine * cos_lamp * light->area / (r * r * pmf);
}

static double my_value(const setting *s, pt_pcg32 *random)
{
    pt_ray ray = pt_camera_ray(&s->camera, 1, s->x, s->y, pt_v2(0, 0));
    double lo = 0, beta = 1; /* the product of f cos / p / P_RR so far */
    for (int k = 1;; k++) {
        pt_hit hit;
        pt_frame frame;
        double albedo;
        if (!pt_intersect(&s->scene, &ray, &hit)) return lo;
        if (k == 1 || EX == 2) lo += beta * (double)pt_hit_emission(&s->scene, &hit, pt_v3_neg(ray.d)).r;
        albedo = (double)s->scene.materials[hit.material].albedo.r;
        frame = pt_frame_from_normal(pt_v3_dot(hit.ns, ray.d) < 0 ? hit.ns : pt_v3_neg(hit.ns));
        lo += beta * albedo / PT_PI * my_direct(&s->scene, &hit, frame.n, random);
        if (pt_pcg32_double(random) >= P_RR) return lo;
        beta *= albedo / P_RR;
        ray.d = pt_frame_to_world(&frame, pt_warp_cosine(pair(random)));
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, ray.d);
    }
}

/* ---- the header's: with light sampling, and without (lesson 15) ---------------------------------------- */

static double its(pt_li_fn li, const setting *s, pt_pcg32 *random)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_pcg32_next(random), 1);
    pt_ray ray = pt_camera_ray(&s->camera, 1, s->x, s->y, pt_v2(0, 0));
    pt_li_options options = pt_render_defaults().li;
    pt_li_info info;
    memset(&info, 0, sizeof info);
    options.roulette = PT_ROULETTE_CONSTANT;
    options.roulette_survival = (pt_real)P_RR;
    pt_sampler_start(&sampler, 0, 0);
    return li(&s->scene, &ray, &sampler, &options, &info).r;
}

static double its_light(const setting *s, pt_pcg32 *random) { return its(pt_li_path_light, s, random); }
static double its_plain(const setting *s, pt_pcg32 *random) { return its(pt_li_path_plain, s, random); }

/* ---- tables, the picture ------------------------------------------------------------------------------- */

/* Rows for growing counts; 1 if the last mean is exact within 5 standard errors and what float loses. */
static int table(const char *name, double (*value)(const setting *, pt_pcg32 *), const setting *s,
                 double exact, uint32_t first, uint32_t last)
{
    const pt_stats none = PT_STATS_INIT;
    pt_stats stats = none;
    for (; first <= last; first *= 4) {
        pt_pcg32 random = pt_pcg32_make(first, 17);
        double start = pt_cpu_seconds();
        for (stats = none; stats.n < first; ) pt_stats_add(&stats, value(s, &random));
        row(name, &stats, exact, pt_cpu_seconds() - start);
    }
    return fabs(stats.mean - exact) <= 5 * pt_stats_standard_error(&stats) + 2e-5 * fabs(exact);
}

/* The box without light sampling (left, 16 samples a pixel) and with it (right, 8: about as many rays); the
reports of
   both make the plot. */
static void picture(const setting *s, const char *output)
{
    enum { SIZE = 150 };
    static const char *const methods[2] = {"path-plain", "path-light"};
    pt_film film = PT_FILM_INIT, half = PT_FILM_INIT;
    pt_report report[2] = {PT_REPORT_INIT, PT_REPORT_INIT};
    const pt_report *both[2];
    pt_render_desc desc = pt_render_defaults();
    pt_error error[2];
    char path[512];
    if (pt_film_make(&film, 2 * SIZE, SIZE, 0) != PT_OK) return;
    film.samples[0] = 1;
    desc.camera = s->camera;
    desc.width = desc.height = SIZE;
    for (int k = 0; k < 2; k++) {
        both[k] = &report[k];
        desc.method = methods[k];
        desc.spp = k ? 8 : 16;
        if (pt_render(&s->scene, &desc, &half, &report[k]) != PT_OK) return;
        pt_film_error_estimate(&half, &error[k]);
        for (int i = 0; i < SIZE * SIZE; i++) {
            pt_rgbd c = pt_film_pixel(&half, i % SIZE, i / SIZE);
            memcpy(film.half[0] + 3 * (i / SIZE * 2 * SIZE + i % SIZE + k * SIZE), &c, sizeof c);
        }
        pt_film_free(&half);
    }
    printf("RMS error of the picture: %.2g by chance, %.2g by light sampling\n", error[0].rmse,
           error[1].rmse);
    check(error[1].rmse < 0.5 * error[0].rmse, "the picture has less than half the error");
    snprintf(path, sizeof path, "%s.svg", output);
    pt_report_write_svg(both, methods, 2, "Cornell box: finding the lamp", path);
    pt_report_free(&report[0]);
    pt_report_free(&report[1]);
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1) == PT_OK, path);
    pt_film_free(&film);
}

int main(int argc, char **argv)
{
    uint32_t samples = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 65536;
    const uint32_t plenty = (uint32_t)fmax(65536, samples); /* fewer hit the lamp too seldom to judge */
    setting s;
    samples = (uint32_t)fmax(4096, samples / (getenv("SHORT") ? 16 : 1));
    memset(&s, 0, sizeof s);
    if (pt_scene_cornell(&s.scene, &s.camera) != PT_OK) return 1;

    printf("%-14s %9s %12s %12s %10s %8s\n", "probe", "samples", "estimate", "exact", "std.error", "seconds");
    for (int k = 0; k < 3; k++) {
        char name[32];
        s.x = (pt_real)(0.5 + probes[k].u);
        s.y = (pt_real)(0.5 - probes[k].v);
        snprintf(name, sizeof name, "my %s", probes[k].what);
        check(table(name, my_value, &s, probes[k].red, samples / 16, samples), "mine is right");
        snprintf(name, sizeof name, "its %s", probes[k].what);
        check(table(name, its_light, &s, probes[k].red, samples, samples), "so is the header");
        check(table("  by chance", its_plain, &s, probes[k].red, plenty, plenty), "and chance, in the end");
    }
    printf("What to see: twice the seconds, a tenth of the error and less.\n");
    picture(&s, argc > 2 ? argv[2] : "17_light_sampling");
    pt_scene_free(&s.scene);
    printf("lesson 17: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return failed == 0;
}

/* EXERCISES
   (1) Predict: P_RR = 0.5 instead of 0.8 (-DEX=1). In lesson 15 the error grew by one half. And here? Answer:
       by as much (floor: from 0.00045 to 0.00068). Direct light at the first surface is found before the
       roulette and has little noise; what noise is left is that of indirect light, and that went through the
       roulette.
   (2) Break: add emission at every hit (-DEX=2): twice the light;
       leave out the shadow ray (-DEX=3): light goes through the blocks, and all is too bright;
       let it run into the lamp itself (-DEX=4): black;
       forget that the lamp is two lights of which one is asked (-DEX=5): half the light.
   (3) Extend: choose lamps by pt_light_choose and points by pt_light_sample (by solid angle), and measure the
       error again. Answer: it hardly changes; the lamp is small and far away, so its points are nearly alike
       (lesson 11). */
