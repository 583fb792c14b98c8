/* Lesson 17: light sampling (next event estimation)

   QUESTION   A path finds the lamp by chance, and seldom. Why not ask for it at every surface?
   IDEA       Next event estimation: the integral of the rendering equation is split by where the light comes from:

                  L_o(p) = L_e + integral of f L_e(q) cos  +  integral of f (L_o(q) - L_e(q)) cos
                                 direct: sample the lamp      indirect: sample a direction, as in lesson 15

              Direct lighting is taken over points q of the area light, chosen with density 1/A; a shadow ray asks for
              their visibility V, 1 if nothing is in between:

                  direct = V f L_e cos cos' A / (r^2 pmf)          pmf: probability to choose this lamp

              Now the light of a lamp that a path HITS was counted one edge before, by the sampling. So emission is
              added at the first edge only, and after mirrors, where a lamp cannot be asked. Adding it always counts
              all reflected light twice: a picture that looks fine. Two rays at each surface instead of one cost up to
              twice the time; the variance falls by a factor of 70 to 200 in this box, the Cornell box.
   PICTURE    The header's best method with 64 samples a pixel, the reference for what is measured of the others:
              without light sampling by 16 (middle), with it by 8 (right), about as many rays.
   PLOT       The errors of the two against seconds, relative to the reference.
   BUILD      cc -O2 -I.. 17_light_sampling.c -o 17_light_sampling -lm -pthread
   RUN        ./17_light_sampling [samples] [output]     writes also output.svg, error against seconds
   PRINTS     probe            samples     estimate        exact  std.error  seconds
              my floor           65536     0.136373     0.135882    0.00045    0.077
              its floor          65536     0.135938     0.135882    0.00045    0.112
                by chance        65536     0.138084     0.135882     0.0062    0.053
   WORDS      next event estimation 下一事件估计; light sampling 直接光采样; shadow ray 阴影光线; area light 面光源;
              direct lighting 直接光照; visibility 可见性; variance 方差; Cornell box 康奈尔盒
   HEADER     [PT-09] pt_light_sample, [PT-10] pt_light_choose, pt_spawn_ray_to, pt_occluded, [PT-11]
              pt_li_path_light
   SOURCES    Kajiya: The Rendering Equation, 1986; probes 2, 4, 9 of tests/data/cornell_reference.csv (another
              program, 2 * 10^7 paths); TU Wien's course warns of counting emission twice
   Before: lesson 16, how many bounces. Next: lesson 18, multiple importance sampling. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX >= 2 };
static const double P_RR = EX == 1 ? 0.5 : 0.8;

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

typedef struct setting {
    pt_scene scene;
    pt_camera camera;
    pt_ray ray; /* through the probe */
} setting;

typedef double (*value_fn)(const setting *s, pt_sampler *random);

/* Takes n values and prints a row; 1 if the mean is exact within 5 standard errors and the rounding of float. */
static int row(const char *name, value_fn value, const setting *s, double exact, uint32_t n)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 17, n);
    pt_stats stats = PT_STATS_INIT;
    double start = pt_cpu_seconds(), error;
    for (uint32_t i = 0; i < n; i++) {
        pt_sampler_start(&random, n, i);
        pt_stats_add(&stats, value(s, &random));
    }
    error = pt_stats_standard_error(&stats);
    printf("%-14s %9u %12.6g %12.6g %10.2g %8.3f\n", name, n, stats.mean, exact, error, pt_cpu_seconds() - start);
    return fabs(stats.mean - exact) <= 5 * error + pt_gamma(300) * exact; /* 300 operations */
}

/* ---- the new piece: ask a lamp ------------------------------------------------------------------------- */

/* One value of the direct light at a hit, over f: L_e cos cos' A / (r^2 pmf). The lamp is two triangles: two lights.
   n is the normal on the side of the eye. */
static double my_direct(const pt_scene *scene, const pt_hit *hit, pt_vec3 n, pt_sampler *random)
{
    const pt_light *light = &scene->lights[(int)(pt_sampler_1d(random) * (pt_real)scene->light_count)];
    const pt_triangle *t = &scene->triangles[scene->primitives[light->primitive].index];
    pt_vec3 a = scene->positions[t->v[0]], none = pt_v3(0, 0, 0); /* rounding error of a point of the lamp */
    pt_vec3 ab = pt_v3_sub(scene->positions[t->v[1]], a), ac = pt_v3_sub(scene->positions[t->v[2]], a);
    pt_vec3 n_lamp = pt_v3_normalize(pt_v3_cross(ab, ac));
    pt_vec2 w = pt_warp_triangle(pt_sampler_2d(random));
    pt_vec3 q = pt_v3_add(a, pt_v3_add(pt_v3_scale(ab, w.x), pt_v3_scale(ac, w.y)));
    pt_vec3 d = pt_v3_sub(q, hit->p);
    double r = (double)pt_v3_length(d), pmf = EX == 5 ? 1 : 1.0 / scene->light_count;
    double cosine = (double)pt_v3_dot(n, d) / r, cos_lamp = -(double)pt_v3_dot(n_lamp, d) / r;
    if (cosine <= 0 || cos_lamp <= 0) return 0;
    pt_ray shadow = pt_spawn_ray_to(hit->p, hit->p_error, hit->ng, q, none, n_lamp); /* meets neither surface */
    if (EX == 4) shadow.tmax = 2; /* the shadow ray goes on and hits the lamp itself */
    double visible = EX == 3 || !pt_occluded(scene, &shadow);
    return visible * (double)light->emission.r * cosine * cos_lamp * light->area / (r * r * pmf);
}

static double my_value(const setting *s, pt_sampler *random)
{
    pt_ray ray = s->ray;
    double lo = 0, beta = 1; /* beta: product of f cos / p / P_RR so far */
    for (int k = 1;; k++) {
        pt_hit hit;
        if (!pt_intersect(&s->scene, &ray, &hit)) return lo;
        if (k == 1 || EX == 2) lo += beta * (double)pt_hit_emission(&s->scene, &hit, pt_v3_neg(ray.d)).r;
        double albedo = (double)s->scene.materials[hit.material].albedo.r;
        pt_frame frame = pt_frame_from_normal(pt_v3_dot(hit.ns, ray.d) < 0 ? hit.ns : pt_v3_neg(hit.ns));
        lo += beta * albedo / PT_PI * my_direct(&s->scene, &hit, frame.n, random);
        if ((double)pt_sampler_1d(random) >= P_RR) return lo;
        beta *= albedo / P_RR;
        pt_vec3 w = pt_frame_to_world(&frame, pt_warp_cosine(pt_sampler_2d(random)));
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, w);
    }
}

/* ---- the header's: with light sampling, and without (lesson 15) ---------------------------------------- */

static double its(pt_li_fn li, const setting *s, pt_sampler *random)
{
    pt_li_options options = {0};
    pt_li_info info = {0};
    options.roulette = PT_ROULETTE_CONSTANT;
    options.roulette_survival = (pt_real)P_RR;
    return li(&s->scene, &s->ray, random, &options, &info).r;
}

static double its_light(const setting *s, pt_sampler *random) { return its(pt_li_path_light, s, random); }
static double its_plain(const setting *s, pt_sampler *random) { return its(pt_li_path_plain, s, random); }

/* ---- tables, the picture ------------------------------------------------------------------------------- */

/* The probes are u to the right of the picture's middle and v above it; red: the radiance of that band. */
static void table(setting *s, uint32_t n)
{
    static const char *const name[2][3] = {{"my floor", "my red wall", "my shadow"},
                                           {"its floor", "its red wall", "its shadow"}};
    static const double u[3] = {0, -0.4, 0.2}, v[3] = {-0.46, 0.1, -0.25}, red[3] = {0.135882, 0.191562, 0.008135};
    for (int k = 0; k < 3; k++) { /* by chance: fewer than 65536 hit the lamp too seldom to judge */
        int good = 0;
        s->ray = pt_camera_ray(&s->camera, 1, (pt_real)(0.5 + u[k]), (pt_real)(0.5 - v[k]), pt_v2(0, 0));
        for (uint32_t i = n / 16; i <= n; i *= 4) good = row(name[0][k], my_value, s, red[k], i);
        check(good, "mine is right");
        check(row(name[1][k], its_light, s, red[k], n), "so is the header");
        check(row("  by chance", its_plain, s, red[k], n < 65536 ? 65536 : n), "and chance, in the end");
    }
}

static void picture(const setting *s, const char *output)
{
    enum { SIZE = 100 };
    static const char *const methods[3] = {"path", "path-plain", "path-light"};
    static const uint32_t spp[3] = {64, 16, 8};
    static float reference[3 * SIZE * SIZE];
    pt_film film = PT_FILM_INIT, one = PT_FILM_INIT;
    pt_report report[3] = {PT_REPORT_INIT, PT_REPORT_INIT, PT_REPORT_INIT};
    const pt_report *plotted[2] = {&report[1], &report[2]};
    pt_render_desc desc = pt_render_defaults();
    double error[3];
    char path[512];
    if (pt_film_make(&film, 3 * SIZE, SIZE, 0) != PT_OK) return;
    film.samples[0] = 1;
    desc.camera = s->camera;
    desc.width = desc.height = SIZE;
    for (int k = 0; k < 3; k++) {
        desc.method = methods[k];
        desc.seed = (uint64_t)k;
        desc.spp = spp[k];
        desc.reference = k ? reference : NULL;
        if (pt_render(&s->scene, &desc, &one, &report[k]) != PT_OK) return;
        error[k] = report[k].rows[report[k].row_count - 1].true_error.rmse;
        for (int i = 0; i < SIZE * SIZE; i++) {
            pt_rgbd c = pt_film_pixel(&one, i % SIZE, i / SIZE);
            double *to = film.half[0] + 3 * (i / SIZE * 3 * SIZE + i % SIZE + k * SIZE);
            memcpy(to, &c, sizeof c);
            for (int b = 0; b < 3 && k == 0; b++) reference[3 * i + b] = (float)to[b];
        }
        pt_film_free(&one);
    }
    printf("RMS error of the picture: %.2g by chance, %.2g by light sampling\n", error[1], error[2]);
    check(error[2] < 0.5 * error[1], "the picture has less than half the error");
    snprintf(path, sizeof path, "%s.svg", output);
    pt_report_write_svg(plotted, methods + 1, 2, "Cornell box: finding the lamp", path);
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1) == PT_OK, path);
    for (int k = 0; k < 3; k++) pt_report_free(&report[k]);
    pt_film_free(&film);
}

int main(int argc, char **argv)
{
    double n = fmax(4096, (argc > 1 ? strtod(argv[1], NULL) : 65536) / (getenv("SHORT") ? 16 : 1));
    setting s;
    memset(&s, 0, sizeof s);
    if (pt_scene_cornell(&s.scene, &s.camera) != PT_OK) return 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "probe", "samples", "estimate", "exact", "std.error", "seconds");
    table(&s, (uint32_t)n);
    printf("What to see: twice the seconds, a tenth of the error and less.\n");
    picture(&s, argc > 2 ? argv[2] : "17_light_sampling");
    pt_scene_free(&s.scene);
    printf("lesson 17: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: P_RR = 0.5 instead of 0.8 (-DEX=1). In lesson 15 the error grew by one half. And here? Answer: by
       still more (floor: from 0.00045 to 0.00073). Direct light at the first surface is found before the roulette
       and has little noise; what noise is left is that of indirect light, and that went through the roulette.
   (2) Break: add emission at every hit (-DEX=2): twice the light; leave out the shadow ray (-DEX=3): light goes
       through the blocks, and all is too bright; let it run into the lamp itself (-DEX=4): black; forget that the lamp
       is two lights of which one is asked (-DEX=5): half the light.
   (3) Extend: choose lamps by pt_light_choose and points by pt_light_sample (by solid angle), and measure the error
       again. Answer: it hardly changes; the lamp is small and far away, so its points are nearly alike (lesson 11). */
