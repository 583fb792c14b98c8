/* Lesson 21: Glass and caustics

   QUESTION  A path meets glass: which way does it go, with what weight, and what does it not find there?
   IDEA      Toss a coin with Fresnel's R: reflect, else refract; the weights R/R and (1-R)/(1-R) are 1. But a
             beam that enters glass is squeezed into a narrower cone, and its radiance rises by n^2:

                 n1 sin t1 = n2 sin t2   =>   n1^2 cos t1 dw1 = n2^2 cos t2 dw2   =>   L1 / n1^2 = L2 / n2^2

             A path from the eye carries the weight 1/n^2 into glass, n^2 out of it. They cancel for a path
             that leaves again: a missing n^2 is invisible until a lamp is inside.
             Caustics LS+DE: a path from the eye finds them when its diffuse bounce happens to hit the lamp
             through the glass. No shadow ray helps: the glass is in its way. Smaller lamps: rarer, brighter
             hits. Point lamps: probability zero, a black caustic, and no noise to warn of it.
   EXACT     Endless water over a floor of albedo rho that emits Le, under a sky of radiance Ls, seen where
             Fresnel's reflectance is F; Fo, Fi the diffuse ones from outside and inside (lesson 20):
                 L = F Ls + (1-F)/n^2 (Le + rho (1-Fo) Ls) / (1 - rho Fi)         (.358699 for the first row)
             Sun of half angle a in the zenith, a pane that transmits T = (1-F)/(1+F) (all reflections inside
             it), a floor below: L = rho/pi Lsun pi sin^2 a T. Here Lsun = 1/sin^2 a: L = rho T for all sizes.
   BUILD     cc -O2 -I.. 21_glass.c -o 21_glass -lm -pthread
   RUN       ./21_glass [samples] [output]
   PRINTS                     samples     estimate        exact  std error  seconds
             sky               131072     0.357887     0.358699     0.0013    0.006
             lit floor         131072     0.725657     0.725085      0.001    0.007
             sun 2 deg         131072     0.451008     0.480335      0.038    0.007
             point light       131072            0     0.480335          0    0.202
   WORDS     caustics 焦散, refraction 折射, radiance 辐亮度, specular 镜面, light path notation 光路传输记法
   HEADER    [PT-08] pt_material_dielectric, [PT-11] pt_li_path, pt_lpe_compile, [PT-19] pt_scene_pool
   SOURCES   [Vea97] 5.2: the n^2 of radiance; the slides' row LS+DE
   Before: lesson 20. Next: lesson 22. */

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

static const double ior = EX == 1 ? 1.5 : 1.33, degree = PT_PI / 180;

typedef struct my_water {
    const char *name;
    double rho, glow, sky, angle;
} my_water;

static const my_water waters[3] = {
    {"sky", 0.5, 0, 1, 0}, {"sky, 75 deg", 0.5, 0, 1, 75}, {"lit floor", 0.5, 1, 0, 0}};

/* --- mine --- */

/* Glass met at cosine *c; eta = index beyond over index before. 0: reflected; 1: refracted, *c is the cosine
   beyond and *beta multiplied. EX 2, 3 and 4 are WRONG: no n^2; its inverse; from inside as from outside. */
static int my_glass(double *c, double eta, pt_pcg32 *rng, double *beta)
{
    double c2, r = pt_fresnel_dielectric(*c, EX == 4 && eta < 1 ? 1 / eta : eta, &c2);
    if (pt_pcg32_double(rng) < r) return 0;
    *c = c2;
    if (EX != 2) *beta *= EX == 3 ? eta * eta : 1 / (eta * eta);
    return 1;
}

/* A path in the pool. Everything is endless and flat: the cosine is all that a path needs to know. */
static double my_pool(const my_water *w, pt_pcg32 *rng)
{
    double c = cos(w->angle * degree), beta = 1, sum = 0;
    if (!my_glass(&c, ior, rng, &beta)) return w->sky;
    for (;;) {
        sum += beta * w->glow;                          /* at the bottom */
        if (pt_pcg32_double(rng) >= w->rho) return sum; /* roulette: weight rho / rho */
        c = sqrt(pt_pcg32_double(rng));                 /* diffuse, upwards */
        if (my_glass(&c, 1 / ior, rng, &beta)) return sum + beta * w->sky;
    }
}

/* The floor under a pane, by a diffuse bounce of weight f cos / pdf = rho; the sun has sin^2 a = s2. */
static double my_caustic(double rho, double s2, pt_pcg32 *rng)
{
    double up = sqrt(1 - pt_pcg32_double(rng)), c = up, beta = 1;
    int side = 1; /* which surface of the pane is ahead: 1 = the upper one */
    if (!my_glass(&c, ior, rng, &beta)) return 0;
    while (!my_glass(&c, 1 / ior, rng, &beta)) side = !side;
    return side && 1 - up * up < s2 ? beta * rho / s2 : 0;
}

/* --- the same with the header --- */

static pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }

static void flat(pt_scene *s, double r, double y, int material) /* a square of half width r, facing up */
{
    pt_add_parallelogram(s, v3(-r, y, -r), v3(0, 0, 2 * r), v3(2 * r, 0, 0), material);
}

static pt_scene pool_scene(const my_water *w)
{
    pt_scene s = PT_SCENE_INIT;
    pt_material bottom = pt_material_diffuse(pt_rgb_grey((pt_real)w->rho));
    int mirror = pt_add_material(&s, pt_material_mirror(pt_rgb_grey(1))), k;
    bottom.emission = pt_rgb_grey((pt_real)w->glow);
    flat(&s, 1, -1, pt_add_material(&s, bottom));
    flat(&s, 1, 0, pt_add_material(&s, pt_material_dielectric((pt_real)ior)));
    for (k = -1; k <= 1; k += 2) { /* mirrors for walls: endless */
        pt_add_parallelogram(&s, v3(-1, -1, k), v3(2, 0, 0), v3(0, 1, 0), mirror);
        pt_add_parallelogram(&s, v3(k, -1, -1), v3(0, 0, 2), v3(0, 1, 0), mirror);
    }
    pt_set_environment(&s, pt_rgb_grey((pt_real)w->sky));
    pt_commit(&s);
    return s;
}

/* Sun (s2 = 0: a point light), pane and floor. */
static pt_scene pane_scene(double rho, double s2)
{
    pt_scene s = PT_SCENE_INIT;
    int glass = pt_add_material(&s, pt_material_dielectric((pt_real)ior));
    flat(&s, 10, 0, pt_add_material(&s, pt_material_diffuse(pt_rgb_grey((pt_real)rho))));
    flat(&s, 10, 1.01, glass);
    pt_add_parallelogram(&s, v3(-10, 1, -10), v3(20, 0, 0), v3(0, 0, 20), glass); /* facing down */
    if (s2 > 0) {
        int sun = pt_add_material(&s, pt_material_emitter(pt_rgb_grey((pt_real)(1 / s2))));
        pt_add_sphere(&s, v3(0, 1000, 0), (pt_real)(1000 * sqrt(s2)), sun);
    } else pt_add_point_light(&s, v3(0, 1000, 0), pt_rgb_grey((pt_real)(PT_PI * 1e6)));
    pt_commit(&s);
    return s;
}

/* Radiance along a ray; with an expression, that of its paths only. */
static pt_stats measure(const pt_scene *scene, pt_ray ray, const pt_lpe *lpe, int n)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 21, 0);
    pt_li_options options = {0};
    pt_stats s = PT_STATS_INIT;
    int i;
    options.lpe = lpe;
    for (i = 0; i < n; i++) {
        pt_rgbd classes[2] = {{0, 0, 0}, {0, 0, 0}}, all;
        pt_li_info info = {0};
        info.classes = classes;
        pt_sampler_start(&sampler, 0, (uint32_t)i);
        all = pt_li_path(scene, &ray, &sampler, &options, &info);
        pt_stats_add(&s, lpe ? classes[0].g : all.g);
    }
    return s;
}

static int agrees(const char *name, pt_stats s, double exact, double start)
{
    row(name, &s, exact, pt_cpu_seconds() - start);
    return fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s);
}

static void pools(int n)
{
    int k, i, m, ok;
    for (k = 0; k < 3; k++) {
        const my_water *w = &waters[k];
        double a = w->angle * degree, fo = pt_fresnel_diffuse(ior), fi = pt_fresnel_diffuse(1 / ior);
        double t, f = pt_fresnel_dielectric(cos(a), ior, &t), start;
        double exact = f * w->sky +
                       (1 - f) / (ior * ior) * (w->glow + w->rho * (1 - fo) * w->sky) / (1 - w->rho * fi);
        pt_scene scene = pool_scene(w);
        pt_ray ray = {{0, 0, 0}, {0, 0, 0}, 1};
        ray.o = v3(0.1 - sin(a), cos(a), 0.2);
        ray.d = v3(sin(a), -cos(a), 0);
        for (m = n / 16, ok = 1; m <= n; m *= 16) {
            pt_pcg32 rng = pt_pcg32_make(21, 0);
            pt_stats s = PT_STATS_INIT;
            start = pt_cpu_seconds();
            for (i = 0; i < m; i++) pt_stats_add(&s, my_pool(w, &rng));
            ok = agrees(w->name, s, exact, start) && ok;
        }
        start = pt_cpu_seconds();
        ok = agrees("header", measure(&scene, ray, NULL, n), exact, start) && ok;
        check(ok, "pool within 5 standard errors of the closed form");
        pt_scene_free(&scene);
    }
}

static void caustics(int n)
{
    static const double half_angle[4] = {8, 4, 2, 0};
    static const char *const name[4] = {"sun 8 deg", "sun 4 deg", "sun 2 deg", "point light"};
    static const char *const expression[1] = {"LS+DE"};
    double rho = 0.5, t, f = pt_fresnel_dielectric(1, ior, &t), exact = rho * (1 - f) / (1 + f), se[3] = {0};
    pt_ray ray = {{0, 0, 0}, {0, 0, 0}, 1};
    pt_lpe lpe;
    int k, i, ok = 1;
    ray.o = v3(-0.5, 0.5, 0);
    ray.d = v3(0.5, -0.5, 0);
    pt_lpe_compile(&lpe, expression, 1, NULL);
    for (k = 0; k < 4; k++) {
        double s2 = pow(sin(half_angle[k] * degree), 2), start = pt_cpu_seconds();
        pt_scene scene = pane_scene(rho, s2);
        pt_pcg32 rng = pt_pcg32_make(22, 0);
        pt_stats mine = PT_STATS_INIT, theirs;
        for (i = 0; i < n; i++) pt_stats_add(&mine, my_caustic(rho, s2, &rng));
        if (s2 > 0) ok = agrees(name[k], mine, exact, start) && ok;
        start = pt_cpu_seconds();
        theirs = measure(&scene, ray, &lpe, n);
        if (s2 > 0) {
            ok = agrees("header", theirs, exact, start) && ok;
            se[k] = pt_stats_standard_error(&theirs);
        } else {
            row(name[k], &theirs, exact, pt_cpu_seconds() - start);
            check(theirs.mean == 0 && theirs.m2 == 0, "caustic of a point light: black, error bar 0");
        }
        pt_scene_free(&scene);
    }
    check(ok, "caustics within 5 standard errors of rho T");
    check(se[1] > 1.5 * se[0] && se[2] > 1.5 * se[1], "half the lamp's width, twice the standard error");
}

/* A glass ball under a large lamp (left), and under a small one of the same power (right). */
static int picture(const char *output, int spp)
{
    enum { W = 160, H = 120 };
    static unsigned char image[3 * 2 * W * H];
    char path[512];
    int k, x, ok = 1;
    for (k = 0; k < 2; k++) {
        double r = k ? 0.1 : 0.8;
        pt_scene s = PT_SCENE_INIT;
        pt_film film = PT_FILM_INIT;
        pt_render_desc desc = pt_render_defaults();
        int glass = pt_add_material(&s, pt_material_dielectric((pt_real)1.5));
        int lamp = pt_add_material(&s, pt_material_emitter(pt_rgb_grey((pt_real)(16 / (r * r)))));
        flat(&s, 8, 0, pt_add_material(&s, pt_material_diffuse(pt_rgb_grey((pt_real)0.5))));
        pt_add_sphere(&s, v3(0, 0.9, 0), (pt_real)0.8, glass);
        pt_add_sphere(&s, v3(2.5, 5, 0), (pt_real)r, lamp);
        desc.camera = pt_camera_look_at(v3(0, 3, 5), v3(-0.4, 0.4, 0), v3(0, 1, 0), 40);
        desc.width = W;
        desc.height = H;
        desc.spp = (uint32_t)spp;
        ok = ok && pt_commit(&s) == PT_OK && pt_render(&s, &desc, &film, NULL) == PT_OK;
        for (x = 0; ok && x < W * H; x++) {
            pt_rgbd c = pt_film_pixel(&film, x % W, x / W);
            memset(image + 3 * (x / W * 2 * W + k * W + x % W), pt_srgb_byte(c.g), 3);
        }
        pt_film_free(&film);
        pt_scene_free(&s);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    ok = ok && pt_write_ppm_bytes(path, image, 2 * W, H) == PT_OK;
    snprintf(path, sizeof path, "%s.png", output);
    return ok && pt_write_png_bytes(path, image, 2 * W, H) == PT_OK;
}

int main(int argc, char **argv)
{
    int n = argc > 1 && atoi(argv[1]) > 0 ? atoi(argv[1]) : 131072;
    const char *output = argc > 2 ? argv[2] : "21_glass";
    if (getenv("SHORT")) n /= 16;
    printf("%-14s %9s %12s %12s %10s %8s\n", "", "samples", "estimate", "exact", "std error", "seconds");
    pools(n);
    caustics(n);
    printf("See: the smaller the sun, the noisier its caustic; a point light has none, without noise.\n");
    check(picture(output, 24), "picture written");
    printf("lesson 21: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("the mistake of exercise %d was %s\n", EX, failed ? "noticed" : "NOT noticed");
    return !failed;
}

/* EXERCISES (cc -DEX=1 ... compiles the first one, and so on)
   1. Predict and run, -DEX=1: glass, n = 1.5, instead of water. Is the floor under the sky brighter or
      darker? (Darker: .316071 instead of .358699; more is reflected, and more is kept inside.)
   2. Break it, and watch which check fails. -DEX=2: no n^2. -DEX=3: n^2 upside down. Both pass under the
      sky, where it cancels; the lit floor comes out n^2 and n^4 times too bright. -DEX=4: no total
      reflection: Fresnel's R from the wrong side.
   3. Extend it: print which fraction of the values of my_caustic is not 0, for the sun as it is (half angle
      .267 degrees). (sin^2 a T = 2.0e-5: one path in 50,000; path tracing to 1 % takes 5e8 paths a pixel.) */
