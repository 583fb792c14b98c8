/* Lesson 05: distribution ray tracing

   QUESTION   What makes edges smooth, shadows soft, backgrounds blurred, metal rough, and how many rays is that?

   IDEA       Smooth edges (anti-aliasing), soft shadows with a penumbra, depth of field, glossy metal: each is a mean,
              over the area of a pixel, of an area light, of a lens, over the lobe of directions around the mirrored
              one that a rough surface reflects. A mean is estimated by asking at random places [Coo84]:

                  pixel   a point of the square              share of x + 2 y < 1:    1/4
                  lens    a point of the disk of radius R    share that sees x > s at depth z, focus at f:
                                                             (acos c - c sqrt(1 - c^2)) / pi,  c = s / (R |1 - z/f|)
                  light   a point of the lamp of area A      E = A mean of V cos cos' / r^2: Lambert's formula
                  gloss   a direction, density (m+1)/(2 pi) cos^m   a round lamp of half angle a: 1 - cos^(m+1) a

              Here R = 1/2, s = 1/16, z = 2, f = 4, m = 19, sin a = 1/3; the lamp, 1 x 1 at height 2, is half hidden: V
              is 1 where it is seen, else 0. The means are not nested. One ray takes numbers for all of its decisions
              at once. Four means with 4 rays each, one inside the other, are 256 rays whose pixel was asked at 4
              places only; 256 samples per pixel that decide all at once ask pixel, lens and lamp at 256 places each.
              Each decision needs numbers of its own: one number used twice ties together what has nothing to do with
              each other. Light between diffuse surfaces is still missing; found is L(D|G|S)?(G|S)*E, G for glossy.

   PICTURE    By the header's distribution ray tracing, 32 rays a pixel: the balls are in focus, the distance is not.

   BUILD      cc -O2 -I.. 05_distribution.c -o 05_distribution -lm -pthread
   RUN        ./05_distribution [samples] [output]

   PRINTS     mean over        samples     estimate        exact  std.error  seconds
              ...
              rays              262144    0.0068893   0.00683974    7.7e-05    0.029
              trees of 256        1024   0.00689695   0.00683974    0.00026    0.011

   WORDS      distribution ray tracing 分布式光线追踪; anti-aliasing 抗锯齿; area light 面光源; soft shadow 软阴影;
              depth of field 景深; glossy 光泽; samples per pixel 每像素采样数; penumbra 半影

   HEADER     [PT-11] pt_li_distribution, [PT-10] pt_camera_ray, [PT-04] pt_spherical_rectangle_sample

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

static const double lens_radius = EX == 1 ? 0.25 : 0.5, focus = 4, depth = 2, edge = 0.0625; /* z, s */
static const double exponent = 19; /* m of the density */
static const pt_vec3 origin = {0, 0, 0}, up = {0, 1, 0}, lamp_corner = {-0.5, 2, -0.5};

/* Does this point of the pixel see the shape x + 2 y < 1? */
static double my_pixel(pt_vec2 u) { return (double)u.x + 2 * (double)u.y < 1; }

/* Does the ray from this point of the lens, through the point in focus on the axis, pass x > s at depth z? */
static double my_lens(pt_vec2 u)
{
    double r = lens_radius * (EX == 3 ? (double)u.x : sqrt((double)u.x));
    return r * cos(2 * PT_PI * (double)u.y) * (1 - depth / focus) > edge;
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
    return cosine > sqrt(8 / 9.0);
}

static double (*const my_decision[DECISIONS])(pt_vec2) = {my_pixel, my_lens, my_light, my_gloss};

/* One ray that decides everything at once. */
static double my_ray(pt_sampler *random)
{
    pt_vec2 u[DECISIONS];
    double product = 1;
    for (int k = 0; k < DECISIONS; k++) u[k] = pt_sampler_2d(random);
    if (EX == 2) u[PIXEL] = u[LENS]; /* the same numbers twice */
    for (int k = 0; k < DECISIONS; k++) product *= my_decision[k](u[k]);
    return product;
}

/* A tree of rays: 4 points of the pixel, for each of them 4 of the lens, and so on. */
static double my_tree(pt_sampler *random, int which)
{
    double sum = 0;
    if (which == DECISIONS) return 1;
    for (int k = 0; k < 4; k++) sum += my_decision[which](pt_sampler_2d(random)) * my_tree(random, which + 1);
    return sum / 4;
}

/* ---- the header's ---- */

static double its_lens(pt_vec2 u)
{
    pt_camera camera = pt_camera_look_at(pt_v3(0, 0, 0), pt_v3(0, 0, -1), pt_v3(0, 1, 0), 40);
    pt_ray ray;
    camera.lens_radius = (pt_real)lens_radius;
    camera.focus_distance = (pt_real)focus;
    ray = pt_camera_ray(&camera, 1, 0.5, 0.5, u);
    return (double)(ray.o.x - ray.d.x / ray.d.z * (ray.o.z + (pt_real)depth)) > edge;
}

static double its_light(pt_vec2 u)
{
    pt_spherical_rectangle lamp;
    double omega = pt_spherical_rectangle_make(&lamp, origin, lamp_corner, pt_v3(1, 0, 0), pt_v3(0, 0, 1));
    pt_vec3 w = pt_spherical_rectangle_sample(&lamp, u); /* uniform in solid angle, not in area */
    return w.x > 0 ? (double)w.y * omega : 0;
}

/* ---- both ---- */

static void table(const char *name, double (*decision)(pt_vec2), double exact, double most)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 6, 0);
    pt_stats s = PT_STATS_INIT;
    double seconds = pt_cpu_seconds();
    for (double n = floor(most / 256); n <= most; n *= 16) {
        while (s.n < n) pt_stats_add(&s, decision(pt_sampler_2d(&random)));
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s), "within 5 standard errors of the exact mean");
}

/* All four at once, and one inside the other, with the same number of rays at the end. */
static void all_at_once(double exact, double most)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 7, 0);
    pt_stats rays = PT_STATS_INIT, trees = PT_STATS_INIT;
    double seconds = pt_cpu_seconds();
    while (rays.n < most) pt_stats_add(&rays, my_ray(&random));
    row("rays", &rays, exact, pt_cpu_seconds() - seconds);
    seconds = pt_cpu_seconds();
    while (256 * trees.n < most) pt_stats_add(&trees, my_tree(&random, 0));
    row("trees of 256", &trees, exact, pt_cpu_seconds() - seconds);
    check(fabs(rays.mean - exact) <= 5 * pt_stats_standard_error(&rays), "within 5 standard errors of the product");
    check(fabs(trees.mean - exact) <= 5 * pt_stats_standard_error(&trees), "and so are the trees");
    check(pt_stats_standard_error(&rays) < pt_stats_standard_error(&trees) / 2, "rays have half the error, or less");
}

/* Balls of many materials, those in the middle in focus, in the light of a hazy sun. */
static void picture(const char *output)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    char path[1024];
    check(pt_scene_materials(&scene, &desc.camera) == PT_OK, "the scene is ready");
    desc.camera.lens_radius = 0.25;
    desc.camera.focus_distance = 6.5;
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.spp = getenv("SHORT") ? 2 : 32;
    desc.method = "distribution";
    check(pt_render(&scene, &desc, &film, NULL) == PT_OK, "the picture is rendered");
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm(path, &film, 1) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1) == PT_OK, "and as PNG");
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 262144) / (getenv("SHORT") ? 16 : 1);
    const pt_vec3 visible[4] = {{0, 2, -0.5}, {0.5, 2, -0.5}, {0.5, 2, 0.5}, {0, 2, 0.5}};
    double c = edge / (lens_radius * (1 - depth / focus)), lens = (acos(c) - c * sqrt(1 - c * c)) / PT_PI;
    double pixel = 0.25, light = pt_irradiance_polygon(1, origin, up, visible, 4);
    double gloss = 1 - pow(8 / 9.0, (exponent + 1) / 2);
    printf("%-14s %9s %12s %12s %10s %8s\n", "mean over", "samples", "estimate", "exact", "std.error", "seconds");
    table("my pixel", my_pixel, pixel, most);
    table("my lens", my_lens, lens, most);
    table("pt lens", its_lens, lens, most);
    table("my light", my_light, light, most);
    table("pt light", its_light, light, most);
    table("my gloss", my_gloss, gloss, most);
    all_at_once(pixel * lens * light * gloss, fmax(most, 262144)); /* fewer trees do not know their own error */
    printf("What to see: trees of rays are cheaper by the ray, and still lose.\n");
    picture(argc > 2 ? argv[2] : "05_distribution");

    printf("lesson 05: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: half the lens radius (-DEX=1). Which share of the lens sees x > s? Answer: c = 1/2 instead of 1/4, and
       so 0.1955 instead of 0.3425.
   (2) Break: let pixel and lens use the same numbers (-DEX=2). All six tables are right, and the product is wrong.
       Then choose lens points by r = R u (-DEX=3): they crowd in the middle, "my lens" and the product fail.
   (3) Extend: hide the lamp up to x = 1/4 instead of 0. Which irradiance is left? Answer: Lambert's formula for [1/4,
       1/2] x [-1/2, 1/2] gives 0.05599. */
