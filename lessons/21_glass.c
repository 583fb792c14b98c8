/* Lesson 21: glass and caustics

   QUESTION   A path meets glass: which way does it go, with what weight, and what does it not find there?
   IDEA       Toss a coin with Fresnel's R: reflect, else refract; the weights R/R and (1-R)/(1-R) are 1. But a beam
              that enters glass is squeezed into a narrower cone, and its radiance rises by n^2:

                  n1 sin t1 = n2 sin t2   =>   n1^2 cos t1 dw1 = n2^2 cos t2 dw2   =>   L1 / n1^2 = L2 / n2^2

              A path from the eye carries the weight 1/n^2 into glass by refraction, n^2 out of it. They cancel for a
              path that leaves again: a missing n^2 is invisible until a lamp, or the eye, is inside.
              Caustics, LS+DE in light path notation, are light that specular surfaces bundle: a path from the eye
              finds them when its diffuse bounce happens to hit the lamp through the glass. No shadow ray helps: the
              glass is in its way. Smaller lamps: rarer, brighter hits. Point lamps: probability zero, black, and no
              noise to warn of it.
              All this is known for endless water over a floor of albedo rho = 1/2 that emits Le, under a sky of
              radiance Ls and a sun in the zenith of irradiance pi Es. With Fresnel's reflectances F0 straight down, Fo
              and Fi for diffuse light from outside and inside (lesson 20), F where the eye looks:

                  Lw = (Le + rho ((1-Fo) Ls + (1-F0) Es)) / (1 - rho Fi)       of the floor, seen in the water
                  L  = F Ls + (1-F)/n^2 Lw                                     from above
   PICTURE    A glass ball under a large lamp (left), and under a small one of the same power (right), 24 samples a
              pixel.
   BUILD      cc -O2 -I.. 21_glass.c -o 21_glass -lm -pthread
   RUN        ./21_glass [samples] [output]
   PRINTS     my sun 2 deg      131072     0.775627     0.641301      0.093    0.009
              its point         131072            0     0.641301          0    0.305
   WORDS      caustics 焦散; refraction 折射; radiance 辐亮度; specular 镜面; light path notation 光路传输记法
   HEADER     [PT-08] pt_material_dielectric, pt_fresnel_dielectric, [PT-11] pt_li_path, [PT-19] pt_scene_pool
   SOURCES    [Vea97] 5.2: the n^2 of radiance; the slides' row LS+DE
   Before: lesson 20, Snell and Fresnel. Next: lesson 22, microfacets. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX >= 2 };
static const double ior = EX == 1 ? 1.5 : 1.33, rho = 0.5, degree = PT_PI / 180;

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

typedef struct setting {
    const char *name[2];
    double glow, sky; /* Le, Ls */
    double angle;     /* of the view from above, in degrees; -1: the eye is in the water */
    double sun;       /* its half angle in degrees; 0: a point, -1: none */
    pt_scene scene;
} setting;

typedef double (*value_fn)(const setting *s, pt_sampler *random);

/* Takes n values and prints a row; 1 if the mean is exact within 5 standard errors and the rounding of float. */
static int row(const char *name, value_fn value, const setting *s, double exact, uint32_t n, double *error)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 21, n);
    pt_stats stats = PT_STATS_INIT;
    double start = pt_cpu_seconds();
    for (uint32_t i = 0; i < n; i++) {
        pt_sampler_start(&random, (uint64_t)(s->sun + 1), i); /* each sun has its own numbers */
        pt_stats_add(&stats, value(s, &random));
    }
    *error = pt_stats_standard_error(&stats);
    printf("%-14s %9u %12.6g %12.6g %10.2g %8.3f\n", name, n, stats.mean, exact, *error, pt_cpu_seconds() - start);
    return fabs(stats.mean - exact) <= 5 * *error + pt_gamma(300) * exact; /* 300 operations */
}

/* ---- the new piece: a coin, and n^2 -------------------------------------------------------------------- */

/* Glass met at cosine *c; eta = index beyond over index before. 0: reflected; 1: refracted, *c is the cosine beyond,
   and *beta multiplied. Mistakes: 2 no n^2; 3 its inverse; 4 from inside as from outside. */
static int my_glass(double *c, double eta, pt_sampler *random, double *beta)
{
    double c2, r = pt_fresnel_dielectric(*c, EX == 4 && eta < 1 ? 1 / eta : eta, &c2);
    if ((double)pt_sampler_1d(random) < r) return 0;
    *c = c2;
    *beta *= EX == 2 ? 1 : EX == 3 ? eta * eta : 1 / (eta * eta);
    return 1;
}

/* A path in the pool. Everything is endless and flat: the cosine is all that a path needs to know. */
static double my_pool(const setting *s, pt_sampler *random)
{
    double c = cos(s->angle * degree), beta = 1, sum = 0, sin2 = pow(sin(s->sun * degree), 2);
    if (s->angle >= 0 && !my_glass(&c, ior, random, &beta)) return s->sky;
    for (;;) {
        sum += beta * s->glow;                                /* at the bottom */
        if ((double)pt_sampler_1d(random) >= rho) return sum; /* roulette: the weight is rho / rho */
        c = (double)pt_warp_cosine(pt_sampler_2d(random)).z;  /* diffuse, upwards: f cos / p is rho */
        if (!my_glass(&c, 1 / ior, random, &beta)) continue;
        return sum + beta * (1 - c * c < sin2 && s->sun > 0 ? 1 / sin2 : s->sky); /* the sun's radiance: Es = 1 */
    }
}

/* ---- the header's: the same pool, endless by mirrors --------------------------------------------------- */

static double its_value(const setting *s, pt_sampler *random)
{
    double a = s->angle * degree;
    pt_ray above = {{(pt_real)(0.1 - sin(a)), (pt_real)cos(a), 0}, {(pt_real)sin(a), (pt_real)-cos(a), 0}, 9};
    pt_ray inside = {{0, (pt_real)-0.5, 0}, {(pt_real)0.5, -1, 0}, 9};
    pt_li_options options = {0};
    pt_li_info info = {0};
    return pt_li_path(&s->scene, s->angle < 0 ? &inside : &above, random, &options, &info).g;
}

static pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }

static int grey(pt_scene *s, double albedo, double radiance) /* a material */
{
    pt_material m = pt_material_diffuse(pt_rgb_grey((pt_real)albedo));
    m.emission = pt_rgb_grey((pt_real)radiance);
    return pt_add_material(s, m);
}

static int make_pool(pt_scene *s, const setting *of)
{
    pt_vec3 x = v3(2, 0, 0), y = v3(0, 1, 0), z = v3(0, 0, 2);
    double r = 1000 * sin(of->sun * degree);
    int mirror = pt_add_material(s, pt_material_mirror(pt_rgb_grey(1)));
    pt_add_parallelogram(s, v3(-1, -1, -1), z, x, grey(s, rho, of->glow));
    pt_add_parallelogram(s, v3(-1, 0, -1), z, x, pt_add_material(s, pt_material_dielectric((pt_real)ior)));
    for (int k = -1; k <= 1; k += 2) {
        pt_add_parallelogram(s, v3(-1, -1, k), x, y, mirror);
        pt_add_parallelogram(s, v3(k, -1, -1), z, y, mirror);
    }
    pt_set_environment(s, pt_rgb_grey((pt_real)of->sky));
    if (of->sun > 0) pt_add_sphere(s, v3(0, 1000, 0), (pt_real)r, grey(s, 0, 1e6 / (r * r)));
    if (of->sun == 0) pt_add_point_light(s, v3(0, 1000, 0), pt_rgb_grey((pt_real)(PT_PI * 1e6)));
    return pt_commit(s) == PT_OK;
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

static void table(uint32_t n)
{
    static const setting pools[7] = {
        {{"my sky", "its sky"}, 0, 1, 0, -1, PT_SCENE_INIT},
        {{"my sky, 75 deg", "its sky, 75"}, 0, 1, 75, -1, PT_SCENE_INIT},
        {{"my lit floor", "its lit floor"}, 1, 0, 0, -1, PT_SCENE_INIT},
        {{"my sun 8 deg", "its sun 8 deg"}, 0, 0, -1, 8, PT_SCENE_INIT},
        {{"my sun 4 deg", "its sun 4 deg"}, 0, 0, -1, 4, PT_SCENE_INIT},
        {{"my sun 2 deg", "its sun 2 deg"}, 0, 0, -1, 2, PT_SCENE_INIT},
        {{"my point", "its point"}, 0, 0, -1, 0, PT_SCENE_INIT}};
    double fo = pt_fresnel_diffuse(ior), fi = pt_fresnel_diffuse(1 / ior), error[7], t;
    for (int k = 0; k < 7; k++) {
        setting s = pools[k];
        double f = s.angle < 0 ? 0 : pt_fresnel_dielectric(cos(s.angle * degree), ior, &t);
        double sun = s.sun < 0 ? 0 : 1 - pt_fresnel_dielectric(1, ior, &t);
        double floor_light = (s.glow + rho * ((1 - fo) * s.sky + sun)) / (1 - rho * fi);
        double exact = s.angle < 0 ? floor_light : f * s.sky + (1 - f) / (ior * ior) * floor_light;
        int good = make_pool(&s.scene, &s) && row(s.name[0], my_pool, &s, exact, n, &error[k]);
        good &= row(s.name[1], its_value, &s, exact, n, &error[k]);
        if (k < 6) check(good, "within 5 standard errors of the closed form");
        pt_scene_free(&s.scene);
    }
    check(error[4] > 1.5 * error[3] && error[5] > 1.5 * error[4], "half the lamp's width, twice the standard error");
    check(error[6] == 0, "the caustic of a point light: black, error bar 0");
}

static void picture(const char *output)
{
    enum { W = 160, H = 120 };
    pt_film film = PT_FILM_INIT, half = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    char path[512];
    if (pt_film_make(&film, 2 * W, H, 0) != PT_OK) return;
    film.samples[0] = 1;
    desc.camera = pt_camera_look_at(v3(0, 3, 5), v3(-0.4, 0.4, 0), v3(0, 1, 0), 40);
    desc.width = W;
    desc.height = H;
    desc.spp = 24;
    for (int k = 0; k < 2; k++) {
        pt_scene s = PT_SCENE_INIT;
        double r = k ? 0.1 : 0.8;
        pt_add_parallelogram(&s, v3(-8, 0, -8), v3(0, 0, 16), v3(16, 0, 0), grey(&s, 0.5, 0));
        pt_add_sphere(&s, v3(0, 0.9, 0), (pt_real)0.8, pt_add_material(&s, pt_material_dielectric((pt_real)1.5)));
        pt_add_sphere(&s, v3(2.5, 5, 0), (pt_real)r, grey(&s, 0, 16 / (r * r)));
        if (pt_commit(&s) != PT_OK || pt_render(&s, &desc, &half, NULL) != PT_OK) return;
        for (int i = 0; i < W * H; i++) {
            pt_rgbd c = pt_film_pixel(&half, i % W, i / W);
            memcpy(film.half[0] + 3 * (i / W * 2 * W + i % W + k * W), &c, sizeof c);
        }
        pt_film_free(&half);
        pt_scene_free(&s);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1) == PT_OK, path);
    pt_film_free(&film);
}

int main(int argc, char **argv)
{
    double n = fmax(65536, argc > 1 ? strtod(argv[1], NULL) : 131072); /* fewer hit the smallest sun too seldom */
    printf("%-14s %9s %12s %12s %10s %8s\n", "pool", "samples", "estimate", "exact", "std.error", "seconds");
    table(getenv("SHORT") ? 65536 : (uint32_t)n);
    printf("What to see: the smaller the sun, the noisier its caustic; a point light has none, without noise.\n");
    picture(argc > 2 ? argv[2] : "21_glass");
    printf("lesson 21: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: glass, n = 1.5, instead of water (-DEX=1). Is the floor under the sky brighter or darker? Answer:
       darker, 0.316071 instead of 0.358699; more is reflected, and more is kept inside.
   (2) Break: no n^2 (-DEX=2), its inverse (-DEX=3). Right under the sky, where it cancels; the lit floor is n^2 and n^4
       times too bright, a sun as many times too dark. Fresnel's R from the wrong side (-DEX=4): all rows fail.
   (3) Extend: which fraction of my values is not 0 for the sun as it is (half angle 0.267 degrees)? Answer: a hit has
       the value n^2 / sin^2 a, so 0.6413 sin^2 a / n^2 = 7.9e-6: one path in 127,000; 1 % takes 1.3e9 paths a pixel. */
