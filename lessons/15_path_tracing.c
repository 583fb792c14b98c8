/* Lesson 15: path tracing

   QUESTION   What does the slides' program compute, once it is complete, and how many samples does a pixel need?
   IDEA       The tree of lesson 13 with N = 1 is a path, and the Russian roulette of lesson 14, with q = P_RR, ends it:
              path tracing. The noise of one path is large; the mean of many through a pixel, each through its own
              point, has

                  error = sigma / sqrt(n):      four times the samples per pixel and the seconds, half the error

              Its convergence is to the solution of the rendering equation, not to something that looks like it. The
              walls and the lamp of the Cornell box were measured for such comparisons; "exact" (the ground truth) is
              here the radiance in the red band that 2 * 10^7 paths of another program found for these data, with a
              standard error of 0.03 % or less. The error of a picture is the root mean square error over its pixels and
              bands, as the difference of two halves of its samples tells it. Where the slides' shade() forgets
              something, the lesson says so: L_e at the point that the camera sees (the lamp would be black), and that a
              lamp reflects, too (this one 0.78 of what it gets).
   PICTURE    The box with 1, 4, 16 (above), 64, 256 and 1024 samples a pixel (below), each pixel drawn 3 x 3.
   BUILD      cc -O2 -I.. 15_path_tracing.c -o 15_path_tracing -lm -pthread
   RUN        ./15_path_tracing [samples] [output]       samples: of each probe, and 1/64 of it for each pixel
   PRINTS     probe            samples     estimate        exact  std.error  seconds
              my floor           65536     0.133927     0.135882      0.006    0.048
              its floor          65536     0.138703     0.135882     0.0062    0.050
              picture              spp    RMS error  * sqrt(spp)             seconds
                                   256      0.05682       0.9091               0.287
                                  1024      0.02804       0.8973               1.187
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
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 15, n);
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

/* ---- the new piece: shade() along one path, complete --------------------------------------------------- */

static pt_rgbd my_path(const pt_scene *scene, pt_ray ray, pt_sampler *random)
{
    pt_rgbd lo = {0, 0, 0}, beta = {1, 1, 1}; /* beta: product of f cos / p / P_RR so far */
    for (int k = 1;; k++) {
        pt_hit hit;
        if (!pt_intersect(scene, &ray, &hit)) return lo;
        pt_rgb le = pt_hit_emission(scene, &hit, pt_v3_neg(ray.d));
        if (EX == 2 && k == 1) le = pt_rgb_grey(0); /* the slides: ray_generation never looks at the lamp */
        lo.r += beta.r * (double)le.r;
        lo.g += beta.g * (double)le.g;
        lo.b += beta.b * (double)le.b;
        if ((double)pt_sampler_1d(random) >= P_RR) return lo;
        pt_rgb albedo = scene->materials[hit.material].albedo; /* = f cos / p, with f = albedo/pi, p = cos/pi */
        beta.r *= (double)albedo.r / P_RR;
        beta.g *= (double)albedo.g / P_RR;
        beta.b *= (double)albedo.b / P_RR;
        pt_frame frame = pt_frame_from_normal(pt_v3_dot(hit.ns, ray.d) < 0 ? hit.ns : pt_v3_neg(hit.ns));
        pt_vec3 w = pt_frame_to_world(&frame, pt_warp_cosine(pt_sampler_2d(random)));
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, w);
    }
}

static double my_value(const setting *s, pt_sampler *random) { return my_path(&s->scene, s->ray, random).r; }

/* ray_generation() of the slides: adds samples first..last - 1 to every pixel. Even ones go to half A of the film,
   odd ones to half B: the difference of the halves tells the error. */
static void my_render(const setting *s, pt_film *film, uint32_t first, uint32_t last)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 15, last);
    for (uint32_t k = first; k < last; k++) {
        for (int i = 0; i < film->width * film->height; i++) {
            pt_sampler_start(&random, (uint64_t)i, EX == 3 ? 0 : k);
            pt_vec2 u = pt_sampler_2d(&random);
            pt_real x = ((pt_real)(i % film->width) + u.x) / (pt_real)film->width;
            pt_real y = ((pt_real)(i / film->width) + u.y) / (pt_real)film->height;
            pt_rgbd c = my_path(&s->scene, pt_camera_ray(&s->camera, 1, x, y, pt_v2(0, 0)), &random);
            double *sum = film->half[k % 2] + 3 * i;
            sum[0] += c.r;
            sum[1] += c.g;
            sum[2] += c.b;
        }
        film->samples[k % 2]++;
    }
}

/* ---- the header's -------------------------------------------------------------------------------------- */

static double its_value(const setting *s, pt_sampler *random)
{
    pt_li_options options = {0};
    pt_li_info info = {0};
    options.roulette = PT_ROULETTE_CONSTANT;
    options.roulette_survival = (pt_real)P_RR;
    return pt_li_path_plain(&s->scene, &s->ray, random, &options, &info).r;
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

/* The probes are u to the right of the picture's middle and v above it; red: the radiance of that band. */
static void table(setting *s, uint32_t n)
{
    static const char *const name[2][3] = {{"my floor", "my red wall", "my ceiling"},
                                           {"its floor", "its red wall", "its ceiling"}};
    static const double u[3] = {0, -0.4, 0}, v[3] = {-0.46, 0.1, 0.3}, red[3] = {0.135882, 0.191562, 0.168539};
    for (int k = 0; k < 3; k++) {
        int good = 0;
        s->ray = pt_camera_ray(&s->camera, 1, (pt_real)(0.5 + u[k]), (pt_real)(0.5 - v[k]), pt_v2(0, 0));
        for (uint32_t i = n / 16; i <= n; i *= 4) good = row(name[0][k], my_value, s, red[k], i);
        good &= row(name[1][k], its_value, s, red[k], n);
        check(good, "both have the radiance of the reference");
    }
}

static void picture(const setting *s, uint32_t most, const char *output)
{
    enum { SIZE = 32, ZOOM = 3, EDGE = SIZE * ZOOM };
    pt_film small = PT_FILM_INIT, film = PT_FILM_INIT;
    pt_error error = {0, 0, 0};
    double start = pt_cpu_seconds(), first_error = 0, mean = 0, image_mean = 0.227625, slope;
    uint32_t spp = 0;
    char path[512];
    if (pt_film_make(&small, SIZE, SIZE, 0) != PT_OK || pt_film_make(&film, 3 * EDGE, 2 * EDGE, 0) != PT_OK) return;
    film.samples[0] = 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "picture", "spp", "RMS error", "* sqrt(spp)", "", "seconds");
    for (int k = 0; k < 6 && 1u << 2 * k <= most; k++) {
        my_render(s, &small, spp, 1u << 2 * k);
        spp = 1u << 2 * k;
        for (int i = 0; i < EDGE * EDGE; i++) {
            pt_rgbd c = pt_film_pixel(&small, i % EDGE / ZOOM, i / EDGE / ZOOM);
            int at = (i / EDGE + k / 3 * EDGE) * film.width + i % EDGE + k % 3 * EDGE;
            memcpy(film.half[0] + 3 * at, &c, sizeof c);
        }
        if (!pt_film_error_estimate(&small, &error)) continue; /* one sample does not know its error */
        printf("%-14s %9u %12.4g %12.4g %19.3f\n", "", spp, error.rmse, error.rmse * sqrt(spp),
               pt_cpu_seconds() - start);
        if (k == 1) first_error = error.rmse;
    }
    for (int i = 0; i < SIZE * SIZE; i++) mean += pt_film_pixel(&small, i % SIZE, i / SIZE).r / (SIZE * SIZE);
    slope = log(error.rmse / first_error) / log(spp / 4.0);
    printf("mean, red band, with the lamp: %.4g, reference %.4g; slope of the error: %.2f\n", mean, image_mean, slope);
    check(fabs(slope + 0.5) < (most < 256 ? 0.3 : 0.1), "the error falls as samples^(-1/2)");
    check(fabs(mean - image_mean) <= 5 * error.rmse * sqrt(3) / SIZE, "mean of the picture: the reference's");
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1) == PT_OK, path);
    pt_film_free(&film);
    pt_film_free(&small);
}

int main(int argc, char **argv)
{
    double n = fmax(4096, (argc > 1 ? strtod(argv[1], NULL) : 65536) / (getenv("SHORT") ? 16 : 1));
    setting s;
    memset(&s, 0, sizeof s);
    if (pt_scene_cornell(&s.scene, &s.camera) != PT_OK) return 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "probe", "samples", "estimate", "exact", "std.error", "seconds");
    table(&s, (uint32_t)n);
    picture(&s, (uint32_t)n / 64, argc > 2 ? argv[2] : "15_path_tracing");
    printf("What to see: the last column times four, the error times one half.\n");
    pt_scene_free(&s.scene);
    printf("lesson 15: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: P_RR = 0.5 instead of 0.8 (-DEX=1). Is the picture darker, is it faster, is it better? Answer: the
       same mean in 0.5 to 0.7 of the time, but 1.4 to 2.4 times the error: for the same error it takes longer.
   (2) Break: leave out L_e at the first hit (-DEX=2): the probes do not notice, none of them is on the lamp; the mean
       of the picture lacks 0.122 of 0.228. Start the random numbers anew for every sample (-DEX=3): more samples
       change nothing, both halves are the same, and the estimated error is 0. An error estimate cannot see that.
   (3) Extend: how many samples a pixel would bring the error to 1/256 of white, in linear light? Answer: (0.9 * 256)^2,
       about 53000, 52 times the seconds of the last row for these 32 x 32 pixels, and 75 times that, more than an hour,
       for 320 x 240. Lesson 17 looks for light instead of waiting for it. */
