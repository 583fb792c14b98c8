/* Lesson 11: the reflection equation, solved four ways

   QUESTION   A lamp lights a floor. Which directions should one try to find out how bright the floor is?

   IDEA       The reflection equation of the slides, and its Monte Carlo estimate:

                  L_r(p, omega_r) = integral over H^2 of f_r L_i(p, omega_i) cos(theta_i) d omega_i
                  L_r ~ 1/N sum of f_r L_i cos(theta_i) / p(omega_i)

              Any density p that is not 0 where the lamp is gives the right mean. Four of them:

                  hemisphere    p = 1/(2 pi)         most directions miss the lamp: values 0
                  cosine        p = cos(theta)/pi    they still miss, but f cos / p = rho is constant
                  area          p = r^2 / (cos(theta') A)     a point of the lamp, theta' at the lamp
                  solid angle   p = 1/Omega          a direction of the lamp, only cos(theta) varies

              For the third the integral is over the lamp's area: d omega = cos(theta') dA / r^2. Under the
              middle of a square lamp of side 1, height 1 and radiance 1 Lambert's formula for polygons gives
              the irradiance E = 0.752275, and a diffuse floor of rho = 1/2 has L_r = rho E / pi.

   BUILD      cc -O2 -I.. 11_reflection_equation.c -o 11_reflection_equation -lm -pthread
   RUN        ./11_reflection_equation [samples] [output]

   PRINTS     sampling         samples     estimate        exact  std.error  seconds
              ...
              my hemisphere     262144     0.120795     0.119728    0.00061    0.049
                  for 0.1 % error 6.9e+06                                          1.286
              ...
              my solid angle    262144     0.119741     0.119728      1e-05    0.165
                  for 0.1 % error 1.9e+03                                          0.001

   WORDS      reflection equation 反射方程; irradiance 辐照度; solid angle 立体角; hemisphere 半球; area light 面光源;
              direct light 直接光照; importance sampling 重要性采样; probability density 概率密度

   HEADER     [PT-04] pt_spherical_rectangle_sample, [PT-05] pt_irradiance_polygon, [PT-11] pt_li_path_plain,
              pt_li_path_light

   SOURCES    Lambert: Photometria, 1760; Urena, Fajardo, King: An Area-Preserving Parametrization for
              Spherical Rectangles, 2013; the slides on the reflection equation

   Before: lesson 10, BRDFs. Next: lesson 12, the rendering equation. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX == 2 || EX == 3 };
static const double HEIGHT = EX == 1 ? 0.25 : 1; /* of the lamp above the floor */

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
    pt_scene scene;         /* floor, lamp, a ball for the picture */
    pt_vec3 corner, e1, e2; /* the lamp: radiance 1 on the side of e1 x e2, which is downwards */
    pt_hit hit;             /* the point p that is lit, */
    pt_frame frame;         /* and its frame: normal n */
    double f;               /* BRDF there */
} setting;

/* ---- the new piece: four densities for one integral --------------------------------------------------- */

/* The integrand: f L_i cos for the direction w; L_i is what a ray finds. */
static double my_integrand(const setting *s, pt_vec3 w)
{
    double cosine = (double)pt_v3_dot(s->frame.n, w);
    pt_ray ray = pt_spawn_ray(s->hit.p, s->hit.p_error, s->hit.ng, w);
    pt_hit hit;
    if (cosine <= 0 || !pt_intersect(&s->scene, &ray, &hit)) return 0;
    return s->f * (double)pt_hit_emission(&s->scene, &hit, pt_v3_neg(w)).r * cosine;
}

static double my_hemisphere(const setting *s, pt_pcg32 *random)
{
    pt_vec3 w = pt_frame_to_world(&s->frame, pt_warp_hemisphere(pair(random)));
    return my_integrand(s, w) * 2 * PT_PI;
}

static double my_cosine(const setting *s, pt_pcg32 *random)
{
    pt_vec3 local = pt_warp_cosine(pair(random));
    double p = (double)local.z / PT_PI;
    if (EX == 2) p = 1 / (2 * PT_PI); /* directions by the cosine, but a density without it */
    return my_integrand(s, pt_frame_to_world(&s->frame, local)) / p;
}

static double my_area(const setting *s, pt_pcg32 *random)
{
    pt_vec2 u = pair(random);
    pt_vec3 q = pt_v3_add(s->corner, pt_v3_add(pt_v3_scale(s->e1, u.x), pt_v3_scale(s->e2, u.y)));
    pt_vec3 to = pt_v3_sub(q, s->hit.p), w = pt_v3_normalize(to), normal = pt_v3_cross(s->e1, s->e2);
    double area = (double)pt_v3_length(normal), r2 = (double)pt_v3_dot(to, to);
    double cos_lamp = -(double)pt_v3_dot(w, normal) / area;
    if (EX == 3) cos_lamp = 1; /* the lamp's own cosine forgotten */
    return my_integrand(s, w) * cos_lamp * area / r2;
}

static double my_solid_angle(const setting *s, pt_pcg32 *random)
{
    pt_spherical_rectangle lamp;
    double omega = pt_spherical_rectangle_make(&lamp, s->hit.p, s->corner, s->e1, s->e2);
    return my_integrand(s, pt_spherical_rectangle_sample(&lamp, pair(random))) * omega;
}

/* ---- the header's: paths of two edges, lamps found by hitting or by sampling them --------------------- */

static double its(pt_li_fn li, const setting *s, pt_pcg32 *random)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_pcg32_next(random), 1);
    pt_li_options options = pt_render_defaults().li;
    pt_li_info info;
    pt_ray ray = {{0.25, 0.25, 0.125}, {-0.25, -0.25, -0.125}, 2};
    memset(&info, 0, sizeof info);
    options.max_edges = 2;
    options.roulette = PT_ROULETTE_NONE;
    pt_sampler_start(&sampler, 0, 0);
    return li(&s->scene, &ray, &sampler, &options, &info).r;
}

static double its_plain(const setting *s, pt_pcg32 *random) { return its(pt_li_path_plain, s, random); }
static double its_light(const setting *s, pt_pcg32 *random) { return its(pt_li_path_light, s, random); }

static const struct {
    const char *name;
    double (*value)(const setting *, pt_pcg32 *);
} ways[6] = {{"my hemisphere", my_hemisphere}, {"my cosine", my_cosine}, {"my area", my_area},
             {"my solid angle", my_solid_angle}, {"its plain", its_plain}, {"its light", its_light}};

/* ---- tables, the picture ------------------------------------------------------------------------------ */

/* Looks along a ray, and makes what it hits the point that is lit. */
static int look(setting *s, const pt_ray *ray)
{
    if (!pt_intersect(&s->scene, ray, &s->hit)) return 0;
    s->frame = pt_frame_from_normal(s->hit.ns);
    s->f = (double)s->scene.materials[s->hit.material].albedo.r / PT_PI;
    return 1;
}

/* Rows for growing counts, then what an error of 0.1 % costs: error^2 falls as 1/n. */
static void table(const setting *s, int k, double exact, uint32_t first, uint32_t last)
{
    const pt_stats none = PT_STATS_INIT;
    pt_stats stats = none;
    double start = 0, error, n1;
    char text[80];
    for (; first <= last; first *= 16) {
        pt_pcg32 random = pt_pcg32_make(first, 11);
        start = pt_cpu_seconds();
        for (stats = none; stats.n < first; ) pt_stats_add(&stats, ways[k].value(s, &random));
        row(ways[k].name, &stats, exact, start = pt_cpu_seconds() - start);
    }
    error = pt_stats_standard_error(&stats);
    n1 = stats.n * pow(error / (0.001 * exact), 2);
    printf("    for 0.1 %% error %7.2g %46.3f\n", n1, start * n1 / stats.n);
    snprintf(text, sizeof text, "%s gives rho E / pi", ways[k].name);
    check(fabs(stats.mean - exact) <= 5 * error + 2e-5 * exact, text);
}

/* The floor and a ball in four strips, one for each of my ways, 4 samples a pixel. */
static void picture(setting *s, const char *output)
{
    enum { W = 320, H = 200, SPP = 4 };
    pt_camera camera = pt_camera_look_at(pt_v3(0, -4, 0.75), pt_v3(0, 0, 0.5), pt_v3(0, 0, 1), 40);
    pt_pcg32 random = pt_pcg32_make(0, 11);
    pt_film film = PT_FILM_INIT;
    char path[512];
    if (pt_film_make(&film, W, H, 0) != PT_OK) return;
    film.samples[0] = SPP;
    for (int i = 0; i < W * H * SPP; i++) {
        int x = i / SPP % W, y = i / SPP / W;
        double *pixel = film.half[0] + 3 * (y * W + x), value;
        pt_vec2 u = pair(&random);
        pt_ray ray = pt_camera_ray(&camera, (pt_real)W / H, ((pt_real)x + u.x) / W,
                                   ((pt_real)y + u.y) / H, u);
        if (!look(s, &ray)) continue;
        value = (double)pt_hit_emission(&s->scene, &s->hit, pt_v3_neg(ray.d)).r;
        value += ways[x * 4 / W].value(s, &random);
        for (int c = 0; c < 3; c++) pixel[c] += value;
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 4);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 4) == PT_OK, path);
    pt_film_free(&film);
}

int main(int argc, char **argv)
{
    uint32_t samples = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 262144;
    pt_ray down = {{0, 0, 0.125}, {0, 0, -1}, 1};
    pt_vec3 lamp[4];
    setting s;
    double exact;
    samples = (uint32_t)fmax(4096, samples / (getenv("SHORT") ? 16 : 1));
    memset(&s, 0, sizeof s);
    s.corner = pt_v3(-0.5, -0.5, (pt_real)HEIGHT);
    s.e1 = pt_v3(0, 1, 0);
    s.e2 = pt_v3(1, 0, 0);
    pt_add_material(&s.scene, pt_material_diffuse(pt_rgb_grey(0.5)));
    pt_add_material(&s.scene, pt_material_emitter(pt_rgb_grey(1)));
    pt_add_parallelogram(&s.scene, pt_v3(-4, -4, 0), pt_v3(8, 0, 0), pt_v3(0, 8, 0), 0);
    pt_add_parallelogram(&s.scene, s.corner, s.e1, s.e2, 1);
    if (pt_commit(&s.scene) != PT_OK || !look(&s, &down)) return 1;
    lamp[0] = s.corner;
    lamp[1] = pt_v3_add(s.corner, s.e1);
    lamp[2] = pt_v3_add(lamp[1], s.e2);
    lamp[3] = pt_v3_add(s.corner, s.e2);
    exact = 0.5 / PT_PI * pt_irradiance_polygon(1, pt_v3(0, 0, 0), pt_v3(0, 0, 1), lamp, 4);

    printf("%-14s %9s %12s %12s %10s %8s\n", "sampling", "samples", "estimate", "exact", "std.error",
           "seconds");
    for (int k = 0; k < 6; k++) table(&s, k, exact, samples / 256, samples);
    printf("What to see: all are right; they differ in the time for one error, by a factor of a thousand.\n");
    pt_add_sphere(&s.scene, pt_v3(0.75, 0.25, 0.375), 0.375, 0);
    check(pt_commit(&s.scene) == PT_OK, "a ball added for the picture");
    picture(&s, argc > 2 ? argv[2] : "11_reflection_equation");
    pt_scene_free(&s.scene);
    printf("lesson 11: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return failed == 0;
}

/* EXERCISES
   (1) Predict: the lamp hangs at 0.25 instead of 1 (-DEX=1), E is 2.6108. Which way is now the slowest of the
       four? Answer: the area. Its values vary as cos cos' / r^2, here by a factor of 81: hitting the lamp by
       chance with cosine sampling (probability E / pi = 0.83) is now seven times better. Only the solid angle
       is good in both.
   (2) Break: draw by the cosine, but divide by 1/(2 pi) (-DEX=2): the cosine counts twice, "my cosine" fails.
       Forget the cosine at the lamp (-DEX=3): "my area" fails. No picture shows it: brightness falls off as
       smoothly.
   (3) Extend: predict the standard error of "my cosine". Its values are rho with probability q = E / pi and
       else 0. Answer: rho sqrt(q (1 - q) / n) = 0.000417 for n = 262144; and 1/q - 1 times 10^6 samples,
       3.18e6, for 0.1 %. */
