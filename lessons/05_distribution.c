/* Lesson 05: distribution ray tracing

   QUESTION   What makes edges smooth, shadows soft, backgrounds blurred and metal rough, and how many rays is
              that?

   IDEA       Each of these is a mean: over the area of a pixel, of a lamp, of a lens, over the lobe of
              directions that a rough surface reflects. A mean is estimated by asking at random places (Cook,
              Porter, Carpenter 1984):

                  pixel   a point of the square              share of x + 2 y < 1:    1/4
                  lens    a point of the disk of radius R    share that sees x > s at depth z, focus at f:
                                     (acos c - c sqrt(1 - c^2)) / pi,  c = s / (R |1 - z/f|)
                  light   a point of the lamp                E = A mean of (V cos cos' / r^2):
                                     Lambert's formula for the part of the lamp that is visible
                  gloss   a direction, density (m+1)/(2 pi) cos^m, around the mirrored one:
                                                             a round lamp of half angle a: 1 - cos^(m+1) a

              The point of it: the means are not nested. One ray takes one random number for each of its
              decisions, all at once. Four means with 4 rays each, one inside the other, are 256 rays whose
              pixel was asked at 4 places only; 256 rays that decide all at once ask the pixel at 256 places,
              and the lens, and the lamp. All decisions of one ray need numbers of their own: a ray that uses
              one number twice sees only combinations that belong together by chance. Light that goes from one
              diffuse surface to the next is still missing: words L(D|G|S)?(G|S)*E.

   BUILD      cc -O2 -I.. 05_distribution.c -o 05_distribution -lm -pthread
   RUN        ./05_distribution [samples] [output]

   PRINTS     mean over        samples     estimate        exact  std.error  seconds
              my pixel            1024     0.251953         0.25      0.014    0.000
              ...
              rays              262144   0.00681939   0.00683974    7.6e-05    0.027
              trees of 256        1024   0.00700545   0.00683974    0.00027    0.012

   WORDS      distribution ray tracing 分布式光线追踪; anti-aliasing 抗锯齿; area light 面光源; soft shadow 软阴影;
              depth of field 景深; glossy 光泽; samples per pixel 每像素采样数; penumbra 半影

   HEADER     [PT-11] pt_li_distribution, [PT-10] pt_camera_ray, pt_filter_sample, [PT-05]
              pt_irradiance_polygon, [PT-08] pt_material_phong

   SOURCES    [Coo84]; Cook: Stochastic Sampling in Computer Graphics, 1986; [Lam60]

   Before: lesson 04. Next: lesson 06, radiometry. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { WIDTH = 240, HEIGHT = 180, MISTAKE = EX == 2 || EX == 3 };
enum { PIXEL, LENS, LIGHT, GLOSS, DECISIONS };

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

static const double lens_radius = EX == 1 ? 0.25 : 0.5, focus = 4, depth = 2, edge = 0.0625; /* z, s */
static const double exponent = 19; /* m of the density; Phong's f cos has its exponent + 1 */

/* Does this point of the pixel see the shape x + 2 y < 1? */
static double my_pixel(pt_vec2 u) { return (double)u.x + 2 * (double)u.y < 1; }

/* Does the ray from this point of the lens, through the point in focus on the axis, pass x > s at depth z? */
static double my_lens(pt_vec2 u)
{
    double r = lens_radius * (EX == 3 ? (double)u.x : sqrt((double)u.x)),
           x = r * cos(2 * PT_PI * (double)u.y);
    return x * (1 - depth / focus) > edge;
}

/* Irradiance at the origin from this point of the lamp, 1 x 1 at height 2, of radiance 1; x < 0 is hidden. */
static double my_light(pt_vec2 u)
{
    double x = (double)u.x - 0.5, z = (double)u.y - 0.5, r2 = x * x + 4 + z * z;
    return x > 0 ? 4 / (r2 * r2) : 0; /* cos = cos' = 2 / r */
}

/* Does the direction with this density around the vertical hit the ball at height 3? Its sin a = 1/3. */
static double my_gloss(pt_vec2 u)
{
    double cosine = pow(1 - (double)u.x, 1 / (exponent + 1)); /* the cumulative probability, inverted */
    return cosine > sqrt(1 - 1 / 9.0);
}

static double my_decision(int which, pt_vec2 u)
{
    return which == PIXEL   ? my_pixel(u)
           : which == LENS  ? my_lens(u)
           : which == LIGHT ? my_light(u)
                            : my_gloss(u);
}

static pt_vec2 pair(pt_pcg32 *random)
{
    double x = pt_pcg32_double(random);
    return pt_v2((pt_real)x, (pt_real)pt_pcg32_double(random));
}

/* One ray that decides everything at once. */
static double my_ray(pt_pcg32 *random)
{
    pt_vec2 u[DECISIONS];
    double product = 1;
    int k;
    for (k = 0; k < DECISIONS; k++) u[k] = pair(random);
    if (EX == 2) u[PIXEL] = u[LENS]; /* the same numbers twice */
    for (k = 0; k < DECISIONS; k++) product *= my_decision(k, u[k]);
    return product;
}

/* A tree of rays: 4 points of the pixel, for each of them 4 of the lens, and so on. */
static double my_tree(pt_pcg32 *random, int which)
{
    double sum = 0;
    int k;
    if (which == DECISIONS) return 1;
    for (k = 0; k < 4; k++) sum += my_decision(which, pair(random)) * my_tree(random, which + 1);
    return sum / 4;
}

/* ---- both ---- */

/* A floor with the lamp and the half plane that hides it; or a glossy floor below the ball. */
static void make_scene(pt_scene *scene, int which)
{
    pt_material phong = pt_material_phong(pt_rgb_grey(0), pt_rgb_grey(1), (pt_real)(exponent - 1));
    int base = pt_add_material(scene, which == LIGHT ? pt_material_diffuse(pt_rgb_grey(1)) : phong);
    int lamp = pt_add_material(scene, pt_material_emitter(pt_rgb_grey(1)));
    pt_add_parallelogram(scene, pt_v3(-9, 0, -9), pt_v3(0, 0, 18), pt_v3(18, 0, 0), base);
    if (which == LIGHT) {
        pt_add_parallelogram(scene, pt_v3(-9, 1, -9), pt_v3(0, 0, 18), pt_v3(9, 0, 0), base);
        pt_add_parallelogram(scene, pt_v3((pt_real)-0.5, 2, (pt_real)-0.5), pt_v3(1, 0, 0), pt_v3(0, 0, 1),
                             lamp);
    } else pt_add_sphere(scene, pt_v3(0, 3, 0), 1, lamp);
    check(pt_commit(scene) == PT_OK, which == LIGHT ? "a scene for the light" : "a scene for the gloss");
}

/* The header's value for one decision. The floor is seen from 1/2 above it. */
static double header_decision(const pt_scene *scene, int which, pt_sampler *sampler, uint32_t i)
{
    pt_camera camera = pt_camera_look_at(pt_v3(0, 0, 0), pt_v3(0, 0, -1), pt_v3(0, 1, 0), 40);
    pt_li_options options = {0};
    pt_li_info info = {0};
    pt_ray ray;
    pt_sampler_start(sampler, 0, i);
    if (which == PIXEL) {
        pt_vec2 p = pt_filter_sample(PT_FILTER_BOX, 0, pt_sampler_2d(sampler));
        return ((double)p.x + 0.5) + 2 * ((double)p.y + 0.5) < 1;
    }
    camera.lens_radius = (pt_real)lens_radius;
    camera.focus_distance = (pt_real)focus;
    ray = pt_camera_ray(&camera, 1, (pt_real)0.5, (pt_real)0.5, pt_sampler_2d(sampler));
    if (which == LENS) return (double)(ray.o.x - ray.d.x / ray.d.z * (ray.o.z + (pt_real)depth)) > edge;
    ray.o = pt_v3(0, (pt_real)0.5, 0);
    ray.d = pt_v3(0, -1, 0);
    return pt_li_distribution(scene, &ray, sampler, &options, &info).g * (which == LIGHT ? PT_PI : 1);
}

/* One decision: mine, and the header's. */
static void table(const char *name, int which, int mine, double most, double exact)
{
    pt_pcg32 random = pt_pcg32_make(6, (uint64_t)which);
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 6, 0);
    pt_scene scene = PT_SCENE_INIT;
    pt_stats s = PT_STATS_INIT;
    double seconds, n;
    if (!mine && which >= LIGHT) make_scene(&scene, which);
    seconds = pt_cpu_seconds();
    for (n = floor(most / 256); n <= most; n *= 16) {
        while (s.n < n)
            pt_stats_add(&s, mine ? my_decision(which, pair(&random))
                                  : header_decision(&scene, which, &sampler, (uint32_t)s.n));
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s),
          "within 5 standard errors of the exact mean");
    pt_scene_free(&scene);
}

/* All four at once, and one inside the other, with the same number of rays at the end. */
static void all_at_once(double most, double exact)
{
    pt_pcg32 random = pt_pcg32_make(7, 0);
    pt_stats at_once = PT_STATS_INIT, nested = PT_STATS_INIT;
    double seconds = pt_cpu_seconds();
    while (at_once.n < most) pt_stats_add(&at_once, my_ray(&random));
    row("rays", &at_once, exact, pt_cpu_seconds() - seconds);
    seconds = pt_cpu_seconds();
    while (256 * nested.n < most) pt_stats_add(&nested, my_tree(&random, 0));
    row("trees of 256", &nested, exact, pt_cpu_seconds() - seconds);
    check(fabs(at_once.mean - exact) <= 5 * pt_stats_standard_error(&at_once),
          "rays: within 5 standard errors");
    check(fabs(nested.mean - exact) <= 5 * pt_stats_standard_error(&nested),
          "trees: within 5 standard errors");
    check(pt_stats_standard_error(&at_once) < pt_stats_standard_error(&nested) / 2,
          "rays have half the error, or less");
}

static void picture(const char *output)
{
    pt_render_desc desc = pt_render_defaults();
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    int k, white = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(0.75)));
    int metal = pt_add_material(
        &scene, pt_material_conductor(pt_rgb3((pt_real)0.14, (pt_real)0.37, (pt_real)1.44),
                                      pt_rgb3((pt_real)3.98, (pt_real)2.38, (pt_real)1.6), 0.5));
    pt_add_parallelogram(&scene, pt_v3(-9, 0, -20), pt_v3(0, 0, 29), pt_v3(18, 0, 0), white);
    for (k = 0; k < 4; k++)
        pt_add_sphere(&scene, pt_v3((pt_real)(1.5 * k - 2), 1, (pt_real)(3 - 3 * k)), 1,
                      k % 2 ? white : metal);
    pt_add_parallelogram(&scene, pt_v3(-3, 6, 0), pt_v3(3, 0, 0), pt_v3(0, 0, 3),
                         pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(12))));
    desc.camera = pt_camera_look_at(pt_v3(-6, 3, 8), pt_v3(0, 1, -1), pt_v3(0, 1, 0), 35);
    desc.camera.lens_radius = 0.25;
    desc.camera.focus_distance = 8.5;
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.spp = getenv("SHORT") ? 2 : 24;
    desc.threads = 1;
    desc.method = "distribution";
    check(pt_commit(&scene) == PT_OK && pt_render(&scene, &desc, &film, NULL) == PT_OK,
          "the picture is rendered");
    for (k = 0; k < 2; k++) {
        char path[1024];
        snprintf(path, sizeof path, "%s.%s", output, k ? "png" : "ppm");
        check((k ? pt_write_png(path, &film, 1) : pt_write_ppm(path, &film, 1)) == PT_OK,
              k ? "and as PNG" : "written as PPM");
    }
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 262144) / (getenv("SHORT") ? 16 : 1);
    const pt_vec3 visible[4] = {{0, 2, -0.5f}, {0.5f, 2, -0.5f}, {0.5f, 2, 0.5f}, {0, 2, 0.5f}};
    double c = edge / (lens_radius * (1 - depth / focus)), exact[DECISIONS], product = 1;
    static const char *const mine[] = {"my pixel", "my lens", "my light", "my gloss"};
    static const char *const header[] = {"pt pixel", "pt lens", "pt light", "pt gloss"};
    int k;
    exact[PIXEL] = 0.25;
    exact[LENS] = (acos(c) - c * sqrt(1 - c * c)) / PT_PI;
    exact[LIGHT] = pt_irradiance_polygon(1, pt_v3(0, 0, 0), pt_v3(0, 1, 0), visible, 4);
    exact[GLOSS] = 1 - pow(8 / 9.0, (exponent + 1) / 2);
    printf("%-14s %9s %12s %12s %10s %8s\n",
           "mean over", "samples", "estimate", "exact", "std.error", "seconds");
    for (k = 0; k < DECISIONS; k++) {
        table(mine[k], k, 1, most, exact[k]);
        table(header[k], k, 0, most, exact[k]);
        product *= exact[k];
    }
    all_at_once(most, product);
    printf("What to see: trees of rays are cheaper by the ray, and still lose.\n");
    picture(argc > 2 ? argv[2] : "05_distribution");
    printf("lesson 05: %d passed, %d failed\n", passed, failed);
    if (MISTAKE)
        printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: half the lens radius (-DEX=1). Which share of the lens sees x > s?
       Answer: c = 1/2 instead of 1/4, and so 0.1955 instead of 0.3425.
   (2) Break: let pixel and lens use the same numbers (-DEX=2). All eight tables are right, and the product is
       wrong. Then choose lens points by r = R u (-DEX=3): they crowd in the middle, and "my lens" fails.
   (3) Extend: hide the lamp up to x = 1/4 instead of 0. Which irradiance is left?
       Answer: Lambert's formula for [1/4, 1/2] x [-1/2, 1/2] gives 0.05599. */
