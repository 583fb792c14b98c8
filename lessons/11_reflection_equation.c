/* Lesson 11: the reflection equation, solved four ways

   QUESTION   A lamp lights a floor. Which directions should one try to find out how bright the floor is?

   IDEA       Direct lighting is one integral, the reflection equation of the slides, which has a Monte Carlo estimate:

                  L_r(p, omega_r) = integral over H^2 of f_r L_i(p, omega_i) cos(theta_i) d omega_i
                  L_r ~ 1/N sum of f_r L_i cos(theta_i) / p(omega_i)

              over the hemisphere H^2 above the point p. Any probability density, if not 0 towards the lamp, will do:

                  hemisphere    p = 1/(2 pi)         most directions miss the lamp: values 0
                  cosine        p = cos(theta)/pi    they still miss, but f cos / p = rho is constant
                  area          p = r^2 / (cos(theta') A)     a point of the area light, theta' there
                  solid angle   p = 1/Omega          importance sampling of the lamp: only cos(theta) varies

              For the third, d omega = cos(theta') dA / r^2. A square lamp of side, height and radiance 1 gives the
              irradiance E = 0.752275 below its middle (Lambert's formula), and L_r = rho E / pi with rho = 1/2.

   PICTURE    4 samples in each pixel, in strips from left to right: hemisphere, cosine, area, solid angle.

   BUILD      cc -O2 -I.. 11_reflection_equation.c -o 11_reflection_equation -lm -pthread
   RUN        ./11_reflection_equation [samples] [output]

   PRINTS     sampling         samples     estimate        exact  std.error  seconds
              ...
              my hemisphere     262144      0.11975     0.119728    0.00061    0.049
                  for 0.1 % error 6.8e+06                                          1.278
              ...
              my solid angle    262144     0.119739     0.119728      1e-05    0.167
                  for 0.1 % error 1.9e+03                                          0.001

   WORDS      reflection equation 反射方程; irradiance 辐照度; solid angle 立体角; hemisphere 半球; area light 面光源;
              direct lighting 直接光照; importance sampling 重要性采样; probability density 概率密度

   HEADER     [PT-04] pt_spherical_rectangle_sample, [PT-05] pt_irradiance_polygon, [PT-11] pt_li_path_plain,
              pt_li_path_light

   SOURCES    [Lam60]; [Ure13]; the slides on the reflection equation

   Before: lesson 10, BRDFs. Next: lesson 12, the rendering equation. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { WIDTH = 320, HEIGHT = 200, SPP = 4, MISTAKE = EX == 2 || EX == 3 };

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

/* ---- mine: four densities for one integral ---- */

static pt_scene scene = PT_SCENE_INIT; /* floor, lamp, a ball for the picture */
/* The lamp: radiance 1 on the side of e1 x e2, which is downwards, and area 1. */
static const pt_vec3 corner = {-0.5, -0.5, EX == 1 ? 0.25 : 1}, e1 = {0, 1, 0}, e2 = {1, 0, 0};
static pt_hit lit;     /* the point p, */
static pt_frame frame; /* the frame there: n is the normal, */
static double brdf;    /* and f */

/* The integrand: f L_i cos for the direction w; L_i is what a ray finds. */
static double my_integrand(pt_vec3 w)
{
    double cosine = (double)pt_v3_dot(frame.n, w);
    pt_ray ray = pt_spawn_ray(lit.p, lit.p_error, lit.ng, w);
    pt_hit hit;
    if (cosine <= 0 || !pt_intersect(&scene, &ray, &hit)) return 0;
    return brdf * (double)pt_hit_emission(&scene, &hit, pt_v3_neg(w)).r * cosine;
}

static double my_hemisphere(pt_sampler *random)
{
    pt_vec3 local = pt_warp_hemisphere(pt_sampler_2d(random));
    return my_integrand(pt_frame_to_world(&frame, local)) * 2 * PT_PI;
}

static double my_cosine(pt_sampler *random)
{
    pt_vec3 local = pt_warp_cosine(pt_sampler_2d(random));
    double p = EX == 2 ? 1 / (2 * PT_PI) : (double)local.z / PT_PI; /* EX 2: by the cosine, but not divided by it */
    return my_integrand(pt_frame_to_world(&frame, local)) / p;
}

static double my_area(pt_sampler *random)
{
    pt_vec2 u = pt_sampler_2d(random);
    pt_vec3 q = pt_v3_add(corner, pt_v3_add(pt_v3_scale(e1, u.x), pt_v3_scale(e2, u.y)));
    pt_vec3 to = pt_v3_sub(q, lit.p), w = pt_v3_normalize(to);
    double cos_lamp = EX == 3 ? 1 : (double)w.z; /* EX 3: the lamp's own cosine is forgotten */
    return my_integrand(w) * cos_lamp * 1 / (double)pt_v3_dot(to, to);
}

static double my_solid_angle(pt_sampler *random)
{
    pt_spherical_rectangle lamp;
    double omega = pt_spherical_rectangle_make(&lamp, lit.p, corner, e1, e2);
    return my_integrand(pt_spherical_rectangle_sample(&lamp, pt_sampler_2d(random))) * omega;
}

/* ---- the header's: paths of two edges, lamps found by hitting or by sampling them ---- */

static double its(pt_li_fn li, pt_sampler *random)
{
    pt_li_options options = {.max_edges = 2, .roulette = PT_ROULETTE_NONE};
    pt_li_info info = {0};
    pt_ray ray = {{0.25, 0.25, 0.125}, {-0.25, -0.25, -0.125}, 2};
    return li(&scene, &ray, random, &options, &info).r;
}

static double its_plain(pt_sampler *random) { return its(pt_li_path_plain, random); }
static double its_light(pt_sampler *random) { return its(pt_li_path_light, random); }

/* ---- both ---- */

/* Rows for growing counts, then what an error of 0.1 % costs: error^2 falls as 1/n. */
static void table(const char *name, double (*value)(pt_sampler *), double exact, double most)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 19, 0);
    pt_stats s = PT_STATS_INIT;
    double seconds = pt_cpu_seconds(), error, needed;
    for (double n = floor(most / 256); n <= most; n *= 16) {
        while (s.n < n) {
            pt_sampler_start(&random, 0, (uint32_t)s.n);
            pt_stats_add(&s, value(&random));
        }
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    error = pt_stats_standard_error(&s);
    needed = s.n * pow(error / (0.001 * exact), 2);
    printf("    for 0.1 %% error %7.2g %46.3f\n", needed, (pt_cpu_seconds() - seconds) * needed / s.n);
    check(fabs(s.mean - exact) <= 5 * error + 2e-5 * exact, "within 5 standard errors of rho E / pi");
}

/* Makes what a ray hits the point that is lit. */
static int look(const pt_ray *ray)
{
    if (!pt_intersect(&scene, ray, &lit)) return 0;
    frame = pt_frame_from_normal(lit.ns);
    brdf = (double)scene.materials[lit.material].albedo.r / PT_PI;
    return 1;
}

/* The floor and a ball in four strips, one for each of my ways, 4 samples a pixel. */
static void picture(const char *output)
{
    static unsigned char rgb[WIDTH * HEIGHT * 3];
    static double (*const way[4])(pt_sampler *) = {my_hemisphere, my_cosine, my_area, my_solid_angle};
    pt_camera camera = pt_camera_look_at(pt_v3(0, -4, 0.75), pt_v3(0, 0, 0.5), pt_v3(0, 0, 1), 40);
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 20, 0);
    char path[1024];
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        int x = i % WIDTH, y = i / WIDTH;
        double sum = 0;
        for (int k = 0; k < SPP; k++) {
            pt_vec2 u = pt_sampler_2d(&random);
            pt_ray ray = pt_camera_ray(&camera, (pt_real)WIDTH / HEIGHT, ((pt_real)x + u.x) / WIDTH,
                                       ((pt_real)y + u.y) / HEIGHT, u);
            if (!look(&ray)) continue;
            sum += (double)pt_hit_emission(&scene, &lit, pt_v3_neg(ray.d)).r + way[x * 4 / WIDTH](&random);
        }
        rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = pt_srgb_byte(4 * sum / SPP);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "and as PNG");
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 262144) / (getenv("SHORT") ? 16 : 1), exact;
    int floor_material = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(0.5)));
    int lamp_material = pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(1)));
    pt_ray down = {{0, 0, 0.125}, {0, 0, -1}, 1};
    pt_vec3 lamp[4] = {corner, pt_v3_add(corner, e1), pt_v3_add(pt_v3_add(corner, e1), e2), pt_v3_add(corner, e2)};
    pt_add_parallelogram(&scene, pt_v3(-4, -4, 0), pt_v3(8, 0, 0), pt_v3(0, 8, 0), floor_material);
    pt_add_parallelogram(&scene, corner, e1, e2, lamp_material);
    check(pt_commit(&scene) == PT_OK && look(&down), "the scene is ready");
    exact = 0.5 / PT_PI * pt_irradiance_polygon(1, pt_v3(0, 0, 0), pt_v3(0, 0, 1), lamp, 4);
    printf("%-14s %9s %12s %12s %10s %8s\n", "sampling", "samples", "estimate", "exact", "std.error", "seconds");
    table("my hemisphere", my_hemisphere, exact, most);
    table("my cosine", my_cosine, exact, most);
    table("my area", my_area, exact, most);
    table("my solid angle", my_solid_angle, exact, most);
    table("its plain", its_plain, exact, most);
    table("its light", its_light, exact, most);
    printf("What to see: all are right; they differ in the time for one error, by a factor of a thousand.\n");
    pt_add_sphere(&scene, pt_v3(0.75, 0.25, 0.375), 0.375, floor_material);
    check(pt_commit(&scene) == PT_OK, "a ball added for the picture");
    picture(argc > 2 ? argv[2] : "11_reflection_equation");
    pt_scene_free(&scene);

    printf("lesson 11: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: the lamp hangs at 0.25 instead of 1 (-DEX=1), E is 2.6108. Which way is now the slowest of the four?
       Answer: the area. Its values vary as cos cos' / r^2, here by a factor of 81: hitting the lamp by chance with
       cosine sampling (probability E / pi = 0.83) is now seven times better. Only the solid angle is good in both.
   (2) Break: draw by the cosine, but divide by 1/(2 pi) (-DEX=2): the cosine counts twice, "my cosine" fails. Forget
       the cosine at the lamp (-DEX=3): "my area" fails. No picture shows it: brightness falls off as smoothly.
   (3) Extend: predict the standard error of "my cosine". Its values are rho with probability q = E / pi and else 0.
       Answer: rho sqrt(q (1 - q) / n) = 0.000417 for n = 262144; so (1/q - 1) 10^6 = 3.18e6 samples for 0.1 %. */
