/* Lesson 03: Whitted's ray tracing

   QUESTION   What do mirrors, glass and shadows cost, and where exactly does the next ray start?

   IDEA       Each ray that meets a surface asks further rays (Whitted 1980):

                  diffuse    a shadow ray to the lamp:     L = albedo / pi  I n.l / r^2   or 0
                  mirror     one ray:                      L = albedo L(reflected)
                  glass      two rays:                     L = R L(reflected) + (1 - R) L(refracted)

              with R from Fresnel's formulas (lesson 20): a tree. A plate of glass, seen straight on, has R =
              ((n-1)/(n+1))^2 = 0.04 on each side; with what goes to and fro within, the share (1-R)/(1+R) =
              0.923 passes: a geometric series, which the tree sums. A lamp that is a point throws sharp
              shadows: that of a ball of radius r at distance d below it, on a floor at distance H below it,
              is a circle of area pi H^2 r^2 / (d^2 - r^2). The next ray starts where this one ended, at a
              rounded point a little inside or outside the surface. From inside it meets its own surface at
              once: acne. The usual cure, a small fixed step away, is too small in a large scene and too large
              in a small one; the header moves the start by a bound of that point's own rounding error. What
              the tree never finds: light that comes through glass to the floor (its shadow is black, without
              a caustic), soft shadows, light between diffuse surfaces.

   BUILD      cc -O2 -I.. 03_whitted.c -o 03_whitted -lm -pthread
   RUN        ./03_whitted [samples] [output]

   PRINTS     case             samples     estimate        exact  std.error  seconds
              my shadow         262144     0.471661     0.471239    0.00097    0.110
              ...
              no offset          16384     0.352295            0     0.0037    0.007

   WORDS      ray tracing 光线追踪; shadow ray 阴影光线; reflection 反射; refraction 折射;
              Fresnel term 菲涅耳项; hard shadow 硬阴影; multiple recursion 多重递归; rounding error 舍入误差

   HEADER     [PT-06] pt_spawn_ray, pt_spawn_ray_to, [PT-10] pt_intersect, pt_occluded, [PT-11] pt_li_whitted,
              [PT-08] pt_fresnel_dielectric

   SOURCES    [Whi80]; [PBR] 6.8 on rounding error; Waechter, Binder: A Fast and Robust Method for Avoiding
              Self-Intersection, Ray Tracing Gems ch. 6, 2019

   Before: lesson 02. Next: lesson 04, the notation of light paths. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { WIDTH = 320, HEIGHT = 240, MOST_EDGES = 12, MISTAKE = EX == 2 || EX == 3 };

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%s %s\n", ok ? "ok    " : "FAIL  ", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact,
           pt_stats_standard_error(s), seconds);
}

/* ---- mine ---- */

static pt_scene scene = PT_SCENE_INIT;
static const pt_real ior = EX == 1 ? 2 : (pt_real)1.5;

/* The usual start: a fixed step away from the surface, on the side where w goes. */
static pt_ray my_start(const pt_hit *hit, pt_vec3 w, double step)
{
    pt_real side = pt_v3_dot(hit->ng, w) > 0 ? 1 : -1;
    pt_ray ray;
    ray.o = pt_v3_add(hit->p, pt_v3_scale(hit->ng, side * (pt_real)step));
    ray.d = w;
    ray.tmax = (pt_real)1e30;
    return ray;
}

/* Does light from the lamp arrive? The shadow ray is lamp - start, so it ends there, at t = 1. */
static int my_sees(const pt_hit *hit, pt_vec3 lamp, double step)
{
    pt_ray ray = my_start(hit, pt_v3_sub(lamp, hit->p), step);
    ray.d = pt_v3_sub(lamp, ray.o);
    ray.tmax = EX == 3 ? (pt_real)1e30 : 1;
    return !pt_occluded(&scene, &ray);
}

/* m = 2 (n.w) n - w: the same angle on the other side of the normal. */
static pt_vec3 my_reflect(pt_vec3 w, pt_vec3 n) { return pt_v3_sub(pt_v3_scale(n, 2 * pt_v3_dot(n, w)), w); }

/* Snell: across the surface the tangential part of the direction is divided by eta. cos_i = n.w > 0. */
static pt_vec3 my_refract(pt_vec3 w, pt_vec3 n, double eta, double cos_t)
{
    double cos_i = (double)pt_v3_dot(n, w);
    return pt_v3_add(pt_v3_scale(w, (pt_real)(-1 / eta)), pt_v3_scale(n, (pt_real)(cos_i / eta - cos_t)));
}

/* The radiance along a ray, green only: all colours here are grey. */
static double my_whitted(const pt_ray *ray, int edges)
{
    static const double step = EX == 2 ? 0 : 1e-4;
    pt_vec3 wo = pt_v3_neg(ray->d), n;
    const pt_material *m;
    pt_hit hit;
    pt_ray next;
    double sum, cos_t, reflectance;
    uint32_t k;
    if (!pt_intersect(&scene, ray, &hit)) return 0;
    sum = (double)pt_hit_emission(&scene, &hit, wo).g;
    m = &scene.materials[hit.material];
    n = pt_v3_dot(hit.ng, wo) > 0 ? hit.ng : pt_v3_neg(hit.ng);
    if (edges == MOST_EDGES) return sum;
    if (m->kind == PT_MATERIAL_DIFFUSE)
        for (k = 0; k < scene.delta_light_count; k++) {
            pt_vec3 lamp = scene.delta_lights[k].position, l = pt_v3_sub(lamp, hit.p);
            double r2 = (double)pt_v3_dot(l, l), nl = (double)pt_v3_dot(n, l) / sqrt(r2);
            if (nl > 0 && my_sees(&hit, lamp, step))
                sum += (double)pt_bsdf_make(m, &hit).albedo.g / PT_PI * nl / r2 *
                       (double)scene.delta_lights[k].intensity.g;
        }
    if (m->kind == PT_MATERIAL_MIRROR) {
        next = my_start(&hit, my_reflect(wo, n), step);
        sum += (double)m->albedo.g * my_whitted(&next, edges + 1);
    }
    if (m->kind == PT_MATERIAL_DIELECTRIC) {
        double eta = pt_v3_dot(hit.ng, wo) > 0 ? (double)m->ior : 1 / (double)m->ior;
        reflectance = pt_fresnel_dielectric((double)pt_v3_dot(n, wo), eta, &cos_t);
        next = my_start(&hit, my_reflect(wo, n), step);
        sum += reflectance * my_whitted(&next, edges + 1);
        if (reflectance < 1) {
            next = my_start(&hit, my_refract(wo, n, eta, cos_t), step);
            sum += (1 - reflectance) * my_whitted(&next, edges + 1);
        }
    }
    return sum;
}

/* ---- both ---- */

static double header_whitted(const pt_ray *ray)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 1, 0);
    pt_li_options options = {0};
    pt_li_info info = {0};
    return pt_li_whitted(&scene, ray, &sampler, &options, &info).g;
}

static pt_ray ray_along(pt_vec3 o, pt_vec3 d)
{
    pt_ray ray;
    ray.o = o;
    ray.d = pt_v3_normalize(d);
    ray.tmax = (pt_real)1e30;
    return ray;
}

static pt_vec2 pair(pt_pcg32 *random) /* two calls as arguments of one have no order: take them one by one */
{
    double x = pt_pcg32_double(random);
    return pt_v2((pt_real)x, (pt_real)pt_pcg32_double(random));
}

/* How often is it wrong whether a point of a ball of radius `scale` sees the lamp? It does if n.l > 0. */
static double wrong_share(const char *name, double scale, double step, double most)
{
    pt_pcg32 random = pt_pcg32_make(3, 0);
    pt_stats s = PT_STATS_INIT;
    double seconds = pt_cpu_seconds();
    pt_real k = (pt_real)scale;
    pt_vec3 lamp = pt_v3(2 * k, 3 * k, 3 * k), eye = pt_v3(0, 0, 4 * k), zero = {0, 0, 0};
    pt_add_sphere(&scene, zero, k, pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(0))));
    if (pt_commit(&scene) != PT_OK) return -1;
    while (s.n < most) {
        pt_ray ray = ray_along(eye, pt_v3_sub(pt_v3_scale(pt_warp_sphere(pair(&random)), k), eye));
        pt_hit hit;
        double nl;
        if (!pt_intersect(&scene, &ray, &hit)) continue;
        nl = (double)pt_v3_dot(hit.ng, pt_v3_normalize(pt_v3_sub(lamp, hit.p)));
        if (fabs(nl) < 0.05) continue; /* grazing: left out */
        ray = pt_spawn_ray_to(hit.p, hit.p_error, hit.ng, lamp, zero, zero);
        pt_stats_add(&s, (step < 0 ? !pt_occluded(&scene, &ray) : my_sees(&hit, lamp, step)) != (nl > 0));
    }
    row(name, &s, 0, pt_cpu_seconds() - seconds);
    pt_scene_free(&scene);
    return s.mean;
}

/* The share of the square [-1, 1]^2 of the floor that is in the shadow of the ball. */
static void table(const char *name, int mine, double most, double exact)
{
    pt_pcg32 random = pt_pcg32_make(4, (uint64_t)mine);
    pt_stats s = PT_STATS_INIT;
    double seconds = pt_cpu_seconds(), n;
    for (n = floor(most / 256); n <= most; n *= 16) {
        while (s.n < n) {
            pt_vec2 u = pair(&random); /* the ray starts below the ball and above the floor */
            pt_ray ray = ray_along(pt_v3(2 * u.x - 1, (pt_real)0.25, 2 * u.y - 1), pt_v3(0, -1, 0));
            pt_stats_add(&s, (mine ? my_whitted(&ray, 1) : header_whitted(&ray)) == 0);
        }
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s),
          "within 5 standard errors of the exact share");
}

/* Floor, a glass ball below the lamp, a mirror; a ceiling above the lamp, which must not throw a shadow. */
static void make_scene(void)
{
    static const pt_texture checker = {
        .kind = PT_TEXTURE_CHECKER, .scale = {12, 12}, .a = {1, 1, 1}, .b = {0.5, 0.5, 0.5}};
    pt_material tiles = pt_material_diffuse(pt_rgb_grey((pt_real)0.75));
    int white = pt_add_material(&scene, tiles), glass = pt_add_material(&scene, pt_material_dielectric(ior));
    int mirror = pt_add_material(&scene, pt_material_mirror(pt_rgb_grey((pt_real)0.9)));
    tiles.texture = &checker;
    pt_add_parallelogram(&scene, pt_v3(-6, 0, -6), pt_v3(0, 0, 12), pt_v3(12, 0, 0),
                         pt_add_material(&scene, tiles));
    pt_add_parallelogram(&scene, pt_v3(-6, 4, -6), pt_v3(12, 0, 0), pt_v3(0, 0, 12), white);
    pt_add_sphere(&scene, pt_v3(0, 1, 0), (pt_real)0.5, glass);
    pt_add_sphere(&scene, pt_v3(-2, 1, -2), 1, mirror);
    pt_add_point_light(&scene, pt_v3(0, 3, 0), pt_rgb_grey(20));
    check(pt_commit(&scene) == PT_OK, "the scene is ready");
}

/* A plate of glass before a lamp of radiance 1, seen straight on. */
static void plate(double exact)
{
    pt_ray ray = ray_along(pt_v3(0, 0, 3), pt_v3(0, 0, -1));
    int glass = pt_add_material(&scene, pt_material_dielectric(ior));
    double mine;
    pt_add_parallelogram(&scene, pt_v3(-1, -1, (pt_real)0.5), pt_v3(2, 0, 0), pt_v3(0, 2, 0), glass);
    pt_add_parallelogram(&scene, pt_v3(-1, -1, (pt_real)-0.5), pt_v3(0, 2, 0), pt_v3(2, 0, 0), glass);
    pt_add_parallelogram(&scene, pt_v3(-1, -1, -2), pt_v3(2, 0, 0), pt_v3(0, 2, 0),
                         pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(1))));
    check(pt_commit(&scene) == PT_OK, "the plate is ready");
    mine = my_whitted(&ray, 1);
    printf("through a plate of glass: mine %.5f, header %.5f, exact %.5f\n", mine, header_whitted(&ray),
           exact);
    check(fabs(mine - exact) < 1e-5 && fabs(header_whitted(&ray) - exact) < 1e-5, "the tree sums the series");
    pt_scene_free(&scene);
}

/* My picture; how many of its pixels are not the header's. */
static int picture(const char *output)
{
    static unsigned char rgb[WIDTH * HEIGHT * 3];
    pt_camera camera =
        pt_camera_look_at(pt_v3(0, 3, 6), pt_v3((pt_real)-0.5, (pt_real)0.75, 0), pt_v3(0, 1, 0), 40);
    char path[1024];
    int i, different = 0;
    for (i = 0; i < WIDTH * HEIGHT; i++) {
        pt_ray ray = pt_camera_ray(&camera, (pt_real)WIDTH / HEIGHT, (pt_real)((i % WIDTH + 0.5) / WIDTH),
                                   (pt_real)((i / WIDTH + 0.5) / HEIGHT), pt_v2(0, 0));
        double mine = my_whitted(&ray, 1);
        different += fabs(mine - header_whitted(&ray)) > 1e-3;
        rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = pt_srgb_byte(mine);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "and as PNG");
    return different;
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 262144) / (getenv("SHORT") ? 16 : 1);
    double r = ((double)ior - 1) / ((double)ior + 1), reflectance = r * r, wrong, usual;
    double large = sizeof(pt_real) == 4 ? 1e6 : 1e15;

    printf("%-14s %9s %12s %12s %10s %8s\n", "case", "samples", "estimate", "exact", "std.error", "seconds");
    make_scene();
    table("my shadow", 1, most, PT_PI * 9 * 0.25 / (4 - 0.25) / 4);
    table("pt shadow", 0, most, PT_PI * 9 * 0.25 / (4 - 0.25) / 4);
    check(picture(argc > 2 ? argv[2] : "03_whitted") < WIDTH * HEIGHT / 1000, "my picture is the header's");
    pt_scene_free(&scene);
    plate((1 - reflectance) / (1 + reflectance));

    printf("points of a ball that are wrong about the lamp; the ball has radius 1, is large, is small:\n");
    wrong = wrong_share("no offset", 1, 0, most / 16);
    usual = wrong_share("1e-4", 1, EX == 2 ? 0 : 1e-4, most / 16);
    check(wrong > 0.05 && usual == 0, "without an offset many are wrong, with 1e-4 none");
    check(wrong_share("1e-4, large", large, 1e-4, most / 16) > 0.05, "1e-4 is nothing in a large scene");
    check(wrong_share("1e-4, small", 1e-6, 1e-4, most / 16) > 0.05, "and everything in a small one");
    wrong = wrong_share("header", 1, -1, most / 16);
    wrong += wrong_share("header, large", large, -1, most / 16);
    wrong += wrong_share("header, small", 1e-6, -1, most / 16);
    check(wrong == 0, "the header's bound holds at all scales");

    printf("lesson 03: %d passed, %d failed\n", passed, failed);
    if (MISTAKE)
        printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: glass of index 2 (-DEX=1). What comes through the plate?
       Answer: R = 1/9 on each side, (1 - R) / (1 + R) = 0.8.
   (2) Break: start rays where they ended (-DEX=2) and look at the picture. Then let the shadow ray go on
       beyond the lamp (-DEX=3). Which checks fail? Answer: (2) my picture, full of dots, and the one about
       offsets; (3) my picture and my shadow: the ceiling darkens all of the floor, and the share is 1.
   (3) Extend: a second lamp like the first, at (1, 3, 0). Which share of the square is still quite dark?
       Answer: 0.274, where the two shadows overlap. */
