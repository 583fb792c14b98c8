/* Lesson 03: Whitted's ray tracing

   QUESTION   What do mirrors, glass and shadows cost, and where exactly does the next ray start?

   IDEA       Each ray that meets a surface asks further rays (Whitted 1980), a multiple recursion:

                  diffuse    a shadow ray to the lamp:     L = albedo / pi  I n.l / r^2   (lesson 02) or 0
                  mirror     one ray, the reflection:      L = albedo L(reflected)
                  glass      also one of refraction:       L = R L(reflected) + (1 - R) L(refracted)

              R is the Fresnel term (lesson 20). Straight through a ball of refractive index eta = 1.5 it is
              ((eta-1)/(eta+1))^2 = 0.04 on each side, and with what goes to and fro within, (1-R)/(1+R) = 0.923
              passes: a series, which this tree of rays sums. A point as lamp casts a hard shadow: a ball of radius s
              at distance d below it, on a floor at distance H, one of area pi H^2 s^2 / (d^2 - s^2); here s = 1/2, d =
              2, H = 3, counted in a square of side 2. The next ray starts where this one ended, by a rounding error
              inside or outside the surface; from inside it meets its own surface at once: acne. A fixed step away is
              too small in a large scene, too large in a small one; the header's step is a bound of that error. Ray
              tracing of this kind never finds light through glass, soft shadows, and light between diffuse walls.

   PICTURE    My picture. The shadow of the clear ball of glass is as black as that of the mirror behind it.

   BUILD      cc -O2 -I.. 03_whitted.c -o 03_whitted -lm -pthread
   RUN        ./03_whitted [samples] [output]

   PRINTS     shadow           samples     estimate        exact  std.error  seconds
              ...
              my, size 1      262144      0.47179     0.471239    0.00098    0.154

   WORDS      ray tracing 光线追踪; shadow ray 阴影光线; reflection 反射; refraction 折射;
              Fresnel term 菲涅耳项; hard shadow 硬阴影; multiple recursion 多重递归; rounding error 舍入误差

   HEADER     [PT-06] pt_spawn_ray, [PT-10] pt_occluded, [PT-11] pt_li_whitted, [PT-08] pt_fresnel_dielectric

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
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
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
static pt_real scale; /* of the scene */
static const pt_real ior = EX == 1 ? 2 : 1.5, sky = 0.5, endless = (pt_real)1e30;

/* The usual start: a fixed step away from the surface, on the side where w goes. */
static pt_ray my_start(const pt_hit *hit, pt_vec3 w, pt_real tmax)
{
    double step = EX == 2 ? 0 : 1e-4, side = pt_v3_dot(hit->ng, w) > 0 ? 1 : -1;
    pt_ray ray = {pt_v3_add(hit->p, pt_v3_scale(hit->ng, (pt_real)(side * step))), w, tmax};
    return ray;
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
static double my_whitted(pt_ray ray, int edges)
{
    pt_vec3 wo = pt_v3_neg(ray.d), n;
    const pt_material *m;
    pt_hit hit;
    double sum = 0, cos_t, r, eta;
    if (!pt_intersect(&scene, &ray, &hit)) return (double)sky;
    m = &scene.materials[hit.material];
    n = pt_v3_dot(hit.ng, wo) > 0 ? hit.ng : pt_v3_neg(hit.ng);
    for (uint32_t k = 0; m->kind == PT_MATERIAL_DIFFUSE && k < scene.delta_light_count; k++) {
        pt_vec3 l = pt_v3_sub(scene.delta_lights[k].position, hit.p); /* the shadow ray ends at the lamp, t = 1 */
        pt_ray shadow = my_start(&hit, l, EX == 3 ? endless : 1);
        double r2 = (double)pt_v3_dot(l, l), nl = (double)pt_v3_dot(n, l) / sqrt(r2);
        if (nl > 0 && !pt_occluded(&scene, &shadow)) sum += (double)scene.delta_lights[k].intensity.g * nl / r2;
    }
    if (m->kind == PT_MATERIAL_DIFFUSE) return (double)pt_bsdf_make(m, &hit).albedo.g / PT_PI * sum;
    if (edges == MOST_EDGES) return 0;
    sum = my_whitted(my_start(&hit, my_reflect(wo, n), endless), edges + 1);
    if (m->kind == PT_MATERIAL_MIRROR) return (double)m->albedo.g * sum;
    eta = pt_v3_dot(hit.ng, wo) > 0 ? (double)m->ior : 1 / (double)m->ior;
    r = pt_fresnel_dielectric((double)pt_v3_dot(n, wo), eta, &cos_t);
    if (!(r < 1)) return sum; /* total reflection */
    return r * sum + (1 - r) * my_whitted(my_start(&hit, my_refract(wo, n, eta, cos_t), endless), edges + 1);
}

/* ---- both ---- */

/* Scene coordinates to the world's: scaled, and tilted, for a level floor at height 0 has no rounding errors. */
static pt_vec3 at(pt_real x, pt_real y, pt_real z)
{
    pt_frame tilted = pt_frame_from_normal(pt_v3_normalize(pt_v3(1, 2, 3)));
    return pt_v3_scale(pt_frame_to_world(&tilted, pt_v3(x, y, z)), scale);
}

/* Floor, a glass ball below the lamp, a mirror; a ceiling above the lamp, which must not throw a shadow. */
static void make_scene(void)
{
    static pt_texture board = {.kind = PT_TEXTURE_CHECKER, .scale = {12, 12}, .a = {1, 1, 1}, .b = {0.5, 0.5, 0.5}};
    pt_material white = pt_material_diffuse(pt_rgb_grey(0.75)), tiles = white, black = {0};
    tiles.texture = &board;
    pt_scene_free(&scene);
    pt_add_parallelogram(&scene, at(-6, 0, -6), at(0, 0, 12), at(12, 0, 0), pt_add_material(&scene, tiles));
    pt_add_parallelogram(&scene, at(-6, 4, -6), at(12, 0, 0), at(0, 0, 12), pt_add_material(&scene, white));
    pt_add_parallelogram(&scene, at(-6, 0, 7), at(12, 0, 0), at(0, 4, 0), pt_add_material(&scene, black));
    pt_add_sphere(&scene, at(0, 1, 0), scale / 2, pt_add_material(&scene, pt_material_dielectric(ior)));
    pt_add_sphere(&scene, at(-2, 1, -2), scale, pt_add_material(&scene, pt_material_mirror(pt_rgb_grey(0.875))));
    pt_add_point_light(&scene, at(0, 3, 0), pt_rgb_grey(20 * scale * scale));
    pt_set_environment(&scene, pt_rgb_grey(sky));
    check(pt_commit(&scene) == PT_OK, "the scene is ready");
}

static double whitted(pt_ray ray, int mine)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 1, 0);
    pt_li_options options = {0};
    pt_li_info info = {0};
    return mine ? my_whitted(ray, 1) : pt_li_whitted(&scene, &ray, &sampler, &options, &info).g;
}

/* The share of the square [-1, 1]^2 of the floor that is in the shadow of the glass ball. */
static void table(int mine, int right, double exact, double most)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 4, 0);
    pt_stats s = PT_STATS_INIT;
    double seconds = pt_cpu_seconds();
    char name[32];
    snprintf(name, sizeof name, "%s, size %g", mine ? "my" : "pt", (double)scale);
    for (double n = floor(most / 16); n <= most; n *= 16) {
        while (s.n < n) {
            pt_vec2 u = pt_sampler_2d(&random); /* the ray starts below the ball and above the floor */
            pt_ray ray = {at(2 * u.x - 1, 0.25, 2 * u.y - 1), at(0, -1, 0), 1};
            pt_stats_add(&s, whitted(ray, mine) == 0);
        }
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    check((fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s)) == right,
          right ? "within 5 standard errors of the exact share" : "wrong: the fixed step does not fit this size");
}

/* My picture, whose pixels must be the header's; rounding decides a few. */
static void picture(const char *output)
{
    static unsigned char rgb[WIDTH * HEIGHT * 3];
    pt_camera camera = pt_camera_look_at(at(0, 3, 6), at(-0.5, 0.75, 0), at(0, 1, 0), 40);
    char path[1024];
    int different = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        pt_ray ray = pt_camera_ray(&camera, (pt_real)WIDTH / HEIGHT, (pt_real)((i % WIDTH + 0.5) / WIDTH),
                                   (pt_real)((i / WIDTH + 0.5) / HEIGHT), pt_v2(0, 0));
        double mine = whitted(ray, 1);
        different += fabs(mine - whitted(ray, 0)) > 1e-3;
        rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = pt_srgb_byte(mine);
    }
    check(different < WIDTH * HEIGHT / 1000, "my picture is the header's");
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "and as PNG");
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 262144) / (getenv("SHORT") ? 16 : 1);
    double sizes[3] = {1e-6, 1e6, 1}, shadow = PT_PI * 9 * 0.25 / (4 - 0.25) / 4;
    double root = ((double)ior - 1) / ((double)ior + 1), r = root * root, through = (1 - r) / (1 + r), mine, its;
    pt_ray axis; /* through the middle of the glass ball to the sky; what comes back ends at the black wall */

    printf("%-14s %9s %12s %12s %10s %8s\n", "shadow", "samples", "estimate", "exact", "std.error", "seconds");
    for (int k = 0; k < 3; k++) {
        scale = (pt_real)sizes[k];
        make_scene();
        table(1, k == 2 || (k == 1 && sizeof scale > 4), shadow, most); /* a double at 1e6 still knows 1e-4 */
        table(0, 1, shadow, most);
    }
    printf("What to see: a fixed step is right at one size; the header's, a bound of the rounding error, at all.\n");
    axis.o = at(0, 1, 3), axis.d = at(0, 0, -1), axis.tmax = endless;
    mine = whitted(axis, 1) / (double)sky, its = whitted(axis, 0) / (double)sky;
    printf("straight through the glass ball: mine %.5f, header %.5f, exact %.5f\n", mine, its, through);
    check(fabs(mine - through) < 1e-5 && fabs(its - through) < 1e-5, "the tree sums the series");
    picture(argc > 2 ? argv[2] : "03_whitted");
    pt_scene_free(&scene);

    printf("lesson 03: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: glass of index 2 (-DEX=1). What comes straight through the ball? Answer: R = 1/9, (1-R)/(1+R) = 0.8.
   (2) Break: start rays where they ended (-DEX=2) and look at the picture. Then let the shadow ray go on beyond the
       lamp (-DEX=3). Which checks fail? Answer: (2) my share at size 1, the way through the ball, and the picture,
       full of dots; (3) the share, which is 1, and the picture: the ceiling darkens all of the floor.
   (3) Extend: a second lamp like the first, at (1, 3, 0). Which share of the square gets no light? Answer: 0.274. */
