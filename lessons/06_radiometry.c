/* Lesson 06: radiometry

   QUESTION   A bulb says 815 lumens. How bright is the table below it, and what does an eye see of the table?

   IDEA       Light is power, and radiometry has four quantities for it that differ in what it is divided by:

                  radiant flux        Phi                          W  (lm)           all of it
                  radiant intensity   I = dPhi / dw                W/sr  (cd)        in a direction, of a small source
                  irradiance          E = dPhi / dA                W/m^2  (lx)       on a surface
                  radiance            L = d^2Phi / (dw dA cos t)   W/(sr m^2)        along a ray: what is seen

              In brackets are the units of light as an eye weighs it: luminous flux in lumen, intensity in candela,
              illuminance in lux. A watt gives about 90 lm in an LED, 12 in an incandescent lamp. A solid angle is area
              over squared distance on a sphere, dw = sin t dt dphi, 4 pi steradian (sr) in all. So a bulb that shines
              evenly has I = 815 lm / (4 pi) = 64.86 cd, and at 2 m, straight below, E = I cos t / d^2 = 16.21 lx, by
              the inverse-square falloff and Lambert's cosine law. The cosine makes summer and winter: the same beam
              covers a larger piece of ground. Irradiance is what radiance brings from all directions of the
              hemisphere, intensity what a surface sends out:

                  E = integral of L cos t dw,  pi L below an even sky
                  I = integral of L cos t dA over the lamp

              Two corrections to the slides. E is power per area of the surface dA, as they say first, not per
              projected area: the projection is in L, which is why L cos t dw stands in the integral. And the L in the
              integral for I is what leaves the lamp, L_o, not the L_i that arrives. 1/d^2 holds for points. A disk of
              radius R has E = pi L R^2 / (R^2 + d^2): 1/d^2 within 1 % from d = 10 R. The rows "cone" are for a half
              angle of 10 degrees.

   PICTURE    The table of 8 m x 6 m from above; it is darker where E is 1, 2, 4, 8 lx (rings) and 16 lx (the middle).

   BUILD      cc -O2 -I.. 06_radiometry.c -o 06_radiometry -lm -pthread
   RUN        ./06_radiometry [samples] [output]

   PRINTS     integral         samples     estimate        exact  std.error  seconds
              my flux / 6         4096       135.58      135.833       0.81    0.000
              my flux / 6        65536      136.165      135.833        0.2    0.002
              my flux / 6      1048576       135.92      135.833       0.05    0.034

   WORDS      radiometry 辐射度量学; radiant flux 辐射通量; luminous flux 光通量; radiant intensity 辐射强度;
              irradiance 辐照度; illuminance 光照度; radiance 辐亮度; solid angle 立体角; steradian 球面度; lumen 流明;
              candela 坎德拉; Lambert's cosine law 朗伯余弦定律; inverse-square falloff 平方反比衰减;
              projected area 投影面积; hemisphere 半球

   HEADER     [PT-05] pt_intensity_of_flux, pt_irradiance_point, pt_irradiance_disk, pt_solid_angle_cap, [PT-04]
              pt_warp_sphere, pt_warp_hemisphere, pt_warp_disk

   SOURCES    [Lam60]; [PBR] 4.1; the lecture's slides on radiometry; [How10]

   Before: lesson 05. Next: lesson 07, probability and Monte Carlo. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { WIDTH = 240, HEIGHT = 180, MISTAKE = EX == 2 || EX == 3 };

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

/* ---- mine: each function of two uniform numbers is one value of an integral, f over its density ---- */

static const double bulb = 815, height = EX == 1 ? 4 : 2, cone = 10 * PT_PI / 180;

/* Irradiance from a point source: intensity, turned by the cosine, spread over d^2. */
static double my_irradiance(double intensity, double d, double cosine) { return intensity * fmax(0, cosine) / (d * d); }

/* The flux through one face of a cube of edge 2 around the bulb: irradiance at a point, times the area. */
static double my_flux(pt_vec2 u)
{
    double x = 2 * (double)u.x - 1, y = 2 * (double)u.y - 1, d = sqrt(x * x + y * y + 1);
    return my_irradiance(bulb / (4 * PT_PI), d, 1 / d) * 4;
}

/* The solid angle of a cone: t and phi uniform over the rectangle [0, cone] x [0, 2 pi]. */
static double my_cone(pt_vec2 u)
{
    double t = cone * (double)u.x;
    return (EX == 2 ? 1 : sin(t)) * cone * 2 * PT_PI; /* circles of latitude shrink towards the pole */
}

/* Irradiance below a sky of radiance 1. On a sphere the height z is uniform (Archimedes). */
static double my_sky(pt_vec2 u)
{
    double cosine = (double)u.x;
    return (EX == 3 ? 1 : cosine) * 2 * PT_PI;
}

/* Irradiance opposite a disk of radius 1 and radiance 1 at distance 1: L cos cos' / r^2 per area. */
static double my_disk(pt_vec2 u)
{
    double r2 = (double)u.x + 1;  /* squared distance: that from the middle is uniform, plus 1 */
    return 1 / (r2 * r2) * PT_PI; /* cos = cos' = 1 / sqrt(r2) */
}

/* Intensity of that disk at an angle: L_o cos per area; all of its points are alike. */
static double my_intensity(double angle) { return 1 * cos(angle) * PT_PI; }

/* ---- the header's ---- */

static double its_flux(pt_vec2 u)
{
    double d = (double)pt_v3_length(pt_v3(2 * u.x - 1, 2 * u.y - 1, 1));
    return pt_irradiance_point(pt_intensity_of_flux(bulb), d, 1 / d) * 4;
}

static double its_cone(pt_vec2 u) { return (double)pt_warp_sphere(u).z > cos(cone) ? 4 * PT_PI : 0; }

static double its_sky(pt_vec2 u)
{
    pt_vec3 w = pt_warp_hemisphere(u);
    return (double)(w.z / pt_warp_hemisphere_pdf_w(w));
}

static double its_disk(pt_vec2 u)
{
    pt_vec2 p = pt_warp_disk(u);
    double r2 = (double)(p.x * p.x + p.y * p.y) + 1;
    return 1 / (r2 * r2) / (double)pt_warp_disk_pdf_a();
}

/* ---- both ---- */

static void table(const char *name, double (*value)(pt_vec2), double exact, double most)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 8, 0);
    pt_stats s = PT_STATS_INIT;
    double seconds = pt_cpu_seconds();
    for (double n = floor(most / 256); n <= most; n *= 16) {
        while (s.n < n) pt_stats_add(&s, value(pt_sampler_2d(&random)));
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s), "within 5 standard errors of the exact value");
}

/* A table of 8 m x 6 m below the bulb, with rings at 1, 2, 4, 8, 16 lx; and how far the header's is off. */
static void picture(const char *output)
{
    static unsigned char rgb[WIDTH * HEIGHT * 3];
    pt_scene scene = PT_SCENE_INIT;
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 1, 0);
    pt_li_options options = {.max_edges = 2};
    double intensity = bulb / (4 * PT_PI), off = 0;
    char path[1024];
    pt_add_parallelogram(&scene, pt_v3(-4, 0, -3), pt_v3(0, 0, 6), pt_v3(8, 0, 0),
                         pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(0.5))));
    pt_add_point_light(&scene, pt_v3(0, (pt_real)height, 0), pt_rgb_grey((pt_real)intensity));
    check(pt_commit(&scene) == PT_OK, "the table is ready");
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double x = (i % WIDTH + 0.5) / WIDTH * 8 - 4, z = (i / WIDTH + 0.5) / HEIGHT * 6 - 3;
        double d = sqrt(x * x + height * height + z * z), e = my_irradiance(intensity, d, height / d);
        double nearest = floor(log2(e) + 0.5), dark = fabs(log2(e) - nearest) < 0.03 ? 0.3 : 1;
        pt_ray ray = {pt_v3((pt_real)x, 1, (pt_real)z), pt_v3(0, -1, 0), 9};
        pt_li_info info = {0};
        pt_sampler_start(&sampler, 0, 0);
        off = fmax(off, fabs(pt_li_path(&scene, &ray, &sampler, &options, &info).g * PT_PI / 0.5 / e - 1));
        rgb[3 * i] = rgb[3 * i + 1] = pt_srgb_byte(e / 20 * dark);
        rgb[3 * i + 2] = pt_srgb_byte(e / 30 * dark);
    }
    check(off < 1e-5, "pixel by pixel, the header's radiance times pi / albedo is my irradiance");
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "and as PNG");
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 1048576) / (getenv("SHORT") ? 16 : 1);
    double intensity = bulb / (4 * PT_PI), below = my_irradiance(intensity, height, 1);
    double summer = cos((40 - 23.44) * PT_PI / 180), winter = cos((40 + 23.44) * PT_PI / 180);
    printf("%-14s %9s %12s %12s %10s %8s\n", "integral", "samples", "estimate", "exact", "std.error", "seconds");
    table("my flux / 6", my_flux, bulb / 6, most);
    table("pt flux / 6", its_flux, bulb / 6, most);
    table("my cone", my_cone, pt_solid_angle_cap(cone), most);
    table("pt cone", its_cone, pt_solid_angle_cap(cone), most);
    table("my sky", my_sky, PT_PI, most);
    table("pt sky", its_sky, PT_PI, most);
    table("my disk", my_disk, PT_PI / 2, most);
    table("pt disk", its_disk, PT_PI / 2, most);
    printf("What to see: four integrals, one recipe. Darts at the whole sphere (pt cone) have 20 times the error.\n");
    printf("815 lm: %.4g cd, %.4g lx straight below at %g m; %.3g W as LED, %.3g W as incandescent lamp\n", intensity,
           below, height, bulb / 90, bulb / 12);
    check(fabs(intensity - 64.855) < 1e-3 && fabs(below - 64.855 / (height * height)) < 1e-3, "as computed by hand");
    printf("noon at 40 degrees north: irradiance %.3f of the beam's in summer, %.3f in winter\n", summer, winter);
    check(fabs(summer / winter - 2.1437) < 1e-3, "2.14 times as much in summer");
    for (double d = 1; d < 200; d *= 10)
        printf("a disk of radius 1 at distance %3g: E d^2 / I = %.4f\n", d,
               pt_irradiance_disk(1, 1, d, 0) * d * d / PT_PI);
    check(fabs(pt_irradiance_disk(1, 1, 10, 0) * 100 / PT_PI - 1) < 0.01, "from 10 radii on it is a point within 1 %");
    check(fabs(my_intensity(PT_PI / 3) / PT_PI - 0.5) < 1e-12, "intensity of a flat lamp falls by the cosine");
    picture(argc > 2 ? argv[2] : "06_radiometry");

    printf("lesson 06: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: the bulb at 4 m instead of 2 m (-DEX=1). What is E straight below, and does the flux through a face of
       the cube change? Answer: 4.053 lx, a quarter; no.
   (2) Break: forget sin t in the solid angle (-DEX=2): the cone has 1.097 sr instead of 0.09546. Forget the cosine
       below the sky (-DEX=3), as if E were per projected area: 2 pi instead of pi.
   (3) Extend: the flux that the table of 8 m x 6 m gets, by the mean of E over it. Answer: 815 lm times its solid
       angle / (4 pi): pt_solid_angle_rectangle gives 3.357 sr at 2 m, so 217.7 lm. */
