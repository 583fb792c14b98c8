/* Lesson 15: path tracing

   QUESTION   What does the slides' program compute, once it is complete, and how many samples does a pixel
              need?

   IDEA       The tree of lesson 13 with N = 1 is a path, and the roulette of lesson 14 ends it. The noise of
              one path is large; the mean of many through a pixel, each through its own point, has

                  error = sigma / sqrt(n):      four times the samples and the seconds, half the error

              It converges to the solution of the rendering equation, not to something that looks like it. The
              walls and the lamp of the Cornell box were measured for such comparisons; "exact" is here the
              radiance that 2 * 10^7 paths of another program found for these data, with a standard error of
              0.03 % or less. Where the slides' shade() forgets something, the lesson says so: L_e at the
              point that the camera sees (the lamp would be black), and that a lamp reflects, too (this one
              0.78 of what it gets).

   BUILD      cc -O2 -I.. 15_path_tracing.c -o 15_path_tracing -lm -pthread
   RUN        ./15_path_tracing [samples] [output]       samples: of each probe, and 1/64 of it for each pixel

   PRINTS     probe            samples     estimate        exact  std.error  seconds
              ...
              my floor           65536     0.132202     0.135882      0.006    0.051
              its floor          65536      0.13724     0.135882     0.0061    0.063
              ...
              picture              spp    RMS error  * sqrt(spp)             seconds
                                     4       0.5007        1.001               0.005
                                    16       0.2313       0.9253               0.018
                                    64       0.1191       0.9527               0.071
                                   256      0.06413        1.026               0.275
                                  1024      0.03076       0.9842               1.210

   WORDS      path tracing 路径追踪; samples per pixel 每像素采样数; Russian roulette 俄罗斯轮盘赌; noise 噪声;
              convergence 收敛; Cornell box 康奈尔盒; root mean square error 均方根误差; ground truth 真值

   HEADER     [PT-11] pt_li_path_plain, [PT-10] pt_camera_ray, pt_film, pt_film_error_estimate, [PT-19]
              pt_scene_cornell

   SOURCES    Kajiya: The Rendering Equation, 1986; Cornell Box Data, Cornell University Program of Computer
              Graphics; probes 2, 4, 6 and the mean of the picture of tests/data/cornell_reference.csv

   Before: lesson 14, Russian roulette. Next: lesson 16, how many bounces. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX == 2 || EX == 3 };
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
               {"ceiling", 0, 0.3, 0.168539}};
static const double IMAGE_MEAN = 0.227625;

/* ---- the new piece: shade() along one path, complete --------------------------------------------------- */

static pt_rgbd my_path(const setting *s, pt_ray ray, pt_pcg32 *random)
{
    pt_rgbd lo = {0, 0, 0}, beta = {1, 1, 1}; /* beta: product of f cos / p / P_RR so far */
    for (int k = 1;; k++) {
        pt_hit hit;
        pt_frame frame;
        pt_rgb le, albedo;
        if (!pt_intersect(&s->scene, &ray, &hit)) return lo;
        le = pt_hit_emission(&s->scene, &hit, pt_v3_neg(ray.d));
        if (EX == 2 && k == 1) le = pt_rgb_grey(0); /* the slides: ray_generation never looks at the lamp */
        lo.r += beta.r * (double)le.r;
        lo.g += beta.g * (double)le.g;
        lo.b += beta.b * (double)le.b;
        if (pt_pcg32_double(random) >= P_RR) return lo;
        albedo = s->scene.materials[hit.material].albedo; /* = f cos / p, with f = albedo/pi and p = cos/pi */
        beta.r *= (double)albedo.r / P_RR;
        beta.g *= (double)albedo.g / P_RR;
        beta.b *= (double)albedo.b / P_RR;
        frame = pt_frame_from_normal(pt_v3_dot(hit.ns, ray.d) < 0 ? hit.ns : pt_v3_neg(hit.ns));
        ray.d = pt_frame_to_world(&frame, pt_warp_cosine(pair(random)));
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, ray.d);
    }
}

static double my_value(const setting *s, pt_pcg32 *random)
{
    return my_path(s, pt_camera_ray(&s->camera, 1, s->x, s->y, pt_v2(0, 0)), random).r;
}

/* ---- the header's -------------------------------------------------------------------------------------- */

static double its_value(const setting *s, pt_pcg32 *random)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_pcg32_next(random), 1);
    pt_ray ray = pt_camera_ray(&s->camera, 1, s->x, s->y, pt_v2(0, 0));
    pt_li_options options = pt_render_defaults().li;
    pt_li_info info;
    memset(&info, 0, sizeof info);
    options.roulette = PT_ROULETTE_CONSTANT;
    options.roulette_survival = (pt_real)P_RR;
    pt_sampler_start(&sampler, 0, 0);
    return pt_li_path_plain(&s->scene, &ray, &sampler, &options, &info).r;
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

/* Rows for growing counts; 1 if the last mean is exact within 5 standard errors and what float loses. */
static int table(const char *name, double (*value)(const setting *, pt_pcg32 *), const setting *s,
                 double exact, uint32_t first, uint32_t last)
{
    const pt_stats none = PT_STATS_INIT;
    pt_stats stats = none;
    for (; first <= last; first *= 4) {
        pt_pcg32 random = pt_pcg32_make(first, 15);
        double start = pt_cpu_seconds();
        for (stats = none; stats.n < first; ) pt_stats_add(&stats, value(s, &random));
        row(name, &stats, exact, pt_cpu_seconds() - start);
    }
    return fabs(stats.mean - exact) <= 5 * pt_stats_standard_error(&stats) + 2e-5 * fabs(exact);
}

/* ray_generation() of the slides: adds samples first..last - 1 to every pixel. Even ones go to half A of the
film, odd
   ones to half B: the difference of the halves tells the error. */
static void my_render(const setting *s, pt_film *film, uint32_t first, uint32_t last)
{
    for (int i = 0; i < film->width * film->height; i++)
        for (uint32_t k = first; k < last; k++) {
            pt_pcg32 random = pt_pcg32_make(EX == 3 ? 0 : k, (uint64_t)i);
            pt_vec2 u = pair(&random);
            pt_real x = ((pt_real)(i % film->width) + u.x) / (pt_real)film->width;
            pt_real y = ((pt_real)(i / film->width) + u.y) / (pt_real)film->height;
            pt_rgbd c = my_path(s, pt_camera_ray(&s->camera, 1, x, y, pt_v2(0, 0)), &random);
            double *to = film->half[k % 2] + 3 * i;
            to[0] += c.r;
            to[1] += c.g;
            to[2] += c.b;
        }
    for (uint32_t k = first; k < last; k++) film->samples[k % 2]++;
}

/* The box with 2, 4, 16, ... samples a pixel, each pixel drawn 3 x 3: what less noise costs. */
static void picture(const setting *s, uint32_t most, const char *output)
{
    enum { SIZE = 32, ZOOM = 3 };
    pt_film small = PT_FILM_INIT, film = PT_FILM_INIT;
    pt_error error;
    double start = pt_cpu_seconds(), first_error = 0, mean = 0, slope;
    uint32_t done = 0, first = 0;
    char path[512];
    if (pt_film_make(&small, SIZE, SIZE, 0) != PT_OK) return;
    if (pt_film_make(&film, 3 * ZOOM * SIZE, 2 * ZOOM * SIZE, 0) != PT_OK) return;
    film.samples[0] = 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "picture", "spp", "RMS error", "* sqrt(spp)", "", "seconds");
    for (uint32_t panel = 0; panel < 6; panel++) {
        uint32_t spp = panel == 0 ? 1 : done == 1 ? 4 : done * 4;
        if (spp > most) spp = most;
        my_render(s, &small, done, spp);
        done = spp;
        for (uint32_t i = 0; i < ZOOM * SIZE * ZOOM * SIZE; i++) {
            uint32_t x = i % (ZOOM * SIZE), y = i / (ZOOM * SIZE);
            pt_rgbd c = pt_film_pixel(&small, (int)(x / ZOOM), (int)(y / ZOOM));
            uint32_t at = (y + panel / 3 * ZOOM * SIZE) * 3 * ZOOM * SIZE + x + panel % 3 * ZOOM * SIZE;
            memcpy(film.half[0] + 3 * at, &c, sizeof c);
        }
        if (!pt_film_error_estimate(&small, &error)) continue; /* one sample does not know its error */
        printf("%-14s %9u %12.4g %12.4g %10s %8.3f\n", "", spp, error.rmse, error.rmse * sqrt(spp), "",
               pt_cpu_seconds() - start);
        if (first == 0) first_error = error.rmse, first = spp;
    }
    for (int i = 0; i < SIZE * SIZE; i++) mean += pt_film_pixel(&small, i % SIZE, i / SIZE).r / (SIZE * SIZE);
    slope = log(error.rmse / first_error) / log((double)done / first);
    printf("mean of the picture: %.4g, reference %.4g; slope of the error: %.2f\n", mean, IMAGE_MEAN, slope);
    check(fabs(slope + 0.5) < (most < 256 ? 0.3 : 0.1), "the error falls as samples^(-1/2)");
    check(fabs(mean - IMAGE_MEAN) <= 5 * error.rmse * sqrt(3) / SIZE, "mean of the picture: the reference's");
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1) == PT_OK, path);
    pt_film_free(&film);
    pt_film_free(&small);
}

int main(int argc, char **argv)
{
    uint32_t samples = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 65536;
    setting s;
    samples = (uint32_t)fmax(4096, samples / (getenv("SHORT") ? 16 : 1));
    memset(&s, 0, sizeof s);
    if (pt_scene_cornell(&s.scene, &s.camera) != PT_OK) return 1;

    printf("%-14s %9s %12s %12s %10s %8s\n", "probe", "samples", "estimate", "exact", "std.error", "seconds");
    for (int k = 0; k < 3; k++) {
        char name[32];
        int ok;
        s.x = (pt_real)(0.5 + probes[k].u);
        s.y = (pt_real)(0.5 - probes[k].v);
        snprintf(name, sizeof name, "my %s", probes[k].what);
        ok = table(name, my_value, &s, probes[k].red, samples / 16, samples);
        snprintf(name, sizeof name, "its %s", probes[k].what);
        ok &= table(name, its_value, &s, probes[k].red, samples, samples);
        check(ok, "both have the radiance of the reference");
    }
    picture(&s, (uint32_t)fmax(64, samples / 64), argc > 2 ? argv[2] : "15_path_tracing");
    printf("What to see: the last column times four, the error times one half.\n");
    pt_scene_free(&s.scene);
    printf("lesson 15: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return failed == 0;
}

/* EXERCISES
   (1) Predict: P_RR = 0.5 instead of 0.8 (-DEX=1). Is the picture darker, is it faster, is it better? Answer:
       the same mean in 0.64 of the time, but 1.5 times the error: for the same error it takes 1.5 times as
       long.
   (2) Break: leave out L_e at the first hit (-DEX=2): the probes do not notice, none of them is on the lamp;
       the mean of the picture lacks 0.122 of 0.228. Start the random numbers anew for every sample (-DEX=3):
       more samples change nothing, both halves are the same, and the estimated error is 0. An error estimate
       cannot see that.
   (3) Extend: how many samples a pixel would bring the error to 1/256 of white, a step of an 8-bit picture?
       Answer: (0.98 * 256)^2, about 63000: with the seconds above 75 s for these 1024 pixels, an hour and a
       half for 320 x 240. Lesson 17 looks for light instead of waiting for it. */
