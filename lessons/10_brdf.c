/* Lesson 10: what a BRDF is

   QUESTION   A surface is lit from one direction. How much light does it send into another one?

   IDEA       Light of radiance L_i from the small solid angle d omega_i gives the surface the irradiance

                  dE = L_i cos(theta_i) d omega_i

              per m^2 of the surface itself. (The slides also write per PROJECTED area: that would count the cosine
              twice.) The surface answers with the radiance dL_r; the ratio is the BRDF, a number per steradian (the
              BSDF, if light that passes through is counted as well):

                  f_r(omega_i -> omega_r) = dL_r(omega_r) / dE(omega_i) = dL_r / (L_i cos(theta_i) d omega_i)
                  ideal diffuse:   f = rho / pi                        the same for all pairs of directions
                  glossy (Phong):  f = k_s (n+2)/(2 pi) cos^n(alpha)   alpha: omega_r to the mirror direction
                  ideal specular:  f = a delta function                0 for every direction chosen beforehand

              Reciprocity: f is the same with its two directions exchanged. Energy: the albedo, the integral of f
              cos(theta_r) d omega_r, is at most 1: the share of the light from omega_i that is reflected. It is rho
              for the diffuse surface, and for the glossy one k_s for light from straight above; from the side it is
              less, for a part of the lobe is below the horizon. f itself may be above 1: it is a density, not a share.

   PICTURE    Diffuse, glossy, mirror, in one light. Bright dots are light that came by way of a shiny ball.

   BUILD      cc -O2 -I.. 10_brdf.c -o 10_brdf -lm -pthread
   RUN        ./10_brdf [samples] [output]

   PRINTS     albedo           samples     estimate        exact  std.error  seconds
              ...
              my glossy         262144     0.745084         0.75     0.0033    0.020
              pt glossy         262144     0.750008         0.75    4.2e-05    0.113
              ...
              lamp of 16 deg    262144      1.29596      1.29605    0.00059    0.036

   WORDS      BRDF 双向反射分布函数; irradiance 辐照度; radiance 辐亮度; diffuse 漫反射; specular 镜面; glossy 光泽;
              albedo 反照率; reciprocity 互易性; solid angle 立体角

   HEADER     [PT-08] pt_bsdf_make, pt_bsdf_eval, pt_bsdf_sample, [PT-04] pt_warp_cone, [PT-05] pt_irradiance_sphere

   SOURCES    Lafortune, Willems: Using the Modified Phong Reflectance Model, 1994; the slides on the BRDF

   Before: lesson 09. Next: lesson 11, the reflection equation. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { WIDTH = 320, HEIGHT = 160, MISTAKE = EX == 2 || EX == 3 };

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    double error = pt_stats_standard_error(s);
    if (error < 1e-6 * fabs(s->mean)) error = 0; /* rounding alone */
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact, error, seconds);
}

/* ---- mine ---- */

/* The surface, with z as its normal: reflectances, the lobe's exponent; and the same for the header. */
static double kd, ks, exponent;
static pt_bsdf bsdf;
/* Towards the eye and towards the middle of a lamp of radiance 1, and the half angle under which the lamp is seen. */
static pt_vec3 wo, axis;
static double cap;

/* f in 1/sr; directions point away from the surface. No cosine is in f: the cosine belongs to dE. */
static double my_f(pt_vec3 a, pt_vec3 b)
{
    double cos_alpha = (double)(a.z * b.z - a.x * b.x - a.y * b.y); /* mirrored, a is (-x, -y, z) */
    double lobe = ks * pow(fmax(0, cos_alpha), exponent), diffuse = EX == 2 ? kd : kd / PT_PI;
    if (EX == 3) return diffuse + lobe / (double)b.z; /* L_s of the slides */
    return diffuse + lobe * (exponent + 2) / (2 * PT_PI);
}

/* One value of the albedo: f cos / p with p = 1/(2 pi), all directions being equally likely. */
static double my_albedo(pt_sampler *random)
{
    pt_vec3 wi = pt_warp_hemisphere(pt_sampler_2d(random));
    return my_f(wo, wi) * (double)wi.z * 2 * PT_PI;
}

/* f as it is defined, dL_r / dE: dL_r is one value of f L_i cos / p, with a direction towards the lamp. */
static double my_dl_de(pt_sampler *random)
{
    double omc = 1 - cos(cap), dE = pt_irradiance_sphere(1, sin(cap), 1, (double)axis.z);
    pt_frame frame = pt_frame_from_normal(axis);
    pt_vec3 wi = pt_frame_to_world(&frame, pt_warp_cone(pt_sampler_2d(random), omc));
    return my_f(wo, wi) * (double)wi.z / pt_warp_cone_pdf_w(omc) / dE;
}

/* ---- the header's: directions drawn by the material's own density; their weight is f cos / p ---- */

static double its_albedo(pt_sampler *random)
{
    pt_bsdf_sample_result b;
    double choice = (double)pt_sampler_1d(random);
    return pt_bsdf_sample(&bsdf, wo, choice, pt_sampler_2d(random), PT_RADIANCE, &b) ? (double)b.weight.r : 0;
}

/* ---- both ---- */

static void table(const char *name, double (*value)(pt_sampler *), double exact, double most)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 17, 0);
    pt_stats s = PT_STATS_INIT;
    double seconds = pt_cpu_seconds();
    for (double n = floor(most / 16); n <= most; n *= 16) {
        while (s.n < n) pt_stats_add(&s, value(&random));
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s) + 2e-5 * exact, "within 5 standard errors");
}

/* Takes a material; puts eye and lamp at the angle theta on either side of the normal: the lamp is at the peak. */
static void look(const pt_material *m, double theta)
{
    pt_hit hit = {.ng = {0, 0, 1}, .ns = {0, 0, 1}};
    bsdf = pt_bsdf_make(m, &hit);
    kd = (double)m->albedo.r;
    ks = (double)m->specular.r;
    exponent = (double)m->exponent;
    wo = pt_v3((pt_real)-sin(theta), 0, (pt_real)cos(theta));
    axis = pt_v3(-wo.x, 0, wo.z);
}

/* The largest relative difference between f(a, b), f(b, a) and the header's f(a, b). */
static double asymmetry(void)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 18, 0);
    double most = 0;
    for (int i = 0; i < 4096; i++) {
        pt_vec3 a = pt_warp_hemisphere(pt_sampler_2d(&random)), b = pt_warp_hemisphere(pt_sampler_2d(&random));
        double ab = my_f(a, b), ba = my_f(b, a), its = (double)pt_bsdf_eval(&bsdf, a, b, PT_RADIANCE, PT_LOBE_ALL).r;
        most = fmax(most, fmax(fabs(ab - ba), fabs(ab - its)) / (ab + ba));
    }
    return most;
}

/* The three materials as balls in the same light. */
static void picture(const pt_material *m, const char *output)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    char path[1024];
    for (int k = 0; k < 3; k++)
        pt_add_sphere(&scene, pt_v3((pt_real)(2 * k - 2), 1, 0), 1, pt_add_material(&scene, m[k]));
    pt_add_parallelogram(&scene, pt_v3(-5, 0, -4), pt_v3(0, 0, 7), pt_v3(10, 0, 0), 0);
    pt_add_sphere(&scene, pt_v3(-3, 5, 5), 1, pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(20))));
    pt_set_environment(&scene, pt_rgb3(0.25, 0.375, 0.5));
    desc.camera = pt_camera_look_at(pt_v3(0, 3, 9), pt_v3(0, 1, 0), pt_v3(0, 1, 0), 25);
    desc.width = WIDTH;
    desc.height = HEIGHT;
    desc.spp = 16;
    check(pt_commit(&scene) == PT_OK && pt_render(&scene, &desc, &film, NULL) == PT_OK, "the picture is rendered");
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
    pt_material m[3];
    m[0] = pt_material_diffuse(pt_rgb_grey(0.75));
    m[1] = pt_material_phong(pt_rgb_grey(0.25), pt_rgb_grey(0.5), EX == 1 ? 200 : 20);
    m[2] = pt_material_mirror(pt_rgb_grey(1));
    /* In light from above the lobe's albedo is k_s (n+2)/(2 pi) 2 pi/(n+2) = k_s, the diffuse part's k_d. */
    printf("%-14s %9s %12s %12s %10s %8s\n", "albedo", "samples", "estimate", "exact", "std.error", "seconds");
    for (int k = 0; k < 2; k++) {
        look(&m[k], 0);
        table(k ? "my glossy" : "my diffuse", my_albedo, kd + ks, most);
        table(k ? "pt glossy" : "pt diffuse", its_albedo, kd + ks, most);
        check(asymmetry() < 1e-3, "reciprocity, and the header has the same f");
    }
    look(&m[2], 0);
    table("pt mirror", its_albedo, 1, most);
    check(!(pt_bsdf_eval(&bsdf, wo, axis, PT_RADIANCE, PT_LOBE_ALL).r > 0), "its albedo is 1 although its f is 0");
    /* A lamp of half angle c at the peak: dL_r/dE = k_d/pi + k_s/pi (1 - cos^(n+2) c) / sin^2 c. */
    printf("%-14s %9s %12s %12s %10s %8s\n", "dL_r / dE", "samples", "estimate", "exact", "std.error", "seconds");
    look(&m[1], PT_PI / 6);
    for (int degrees = 16; degrees >= 2; degrees /= 2) {
        char name[32];
        snprintf(name, sizeof name, "lamp of %d deg", degrees);
        cap = degrees * PT_PI / 180;
        table(name, my_dl_de, kd / PT_PI + ks / PT_PI * (1 - pow(cos(cap), exponent + 2)) / pow(sin(cap), 2), most);
    }
    printf("What to see: the smaller the lamp, the nearer to f = %.5g, which may be above 1.\n", my_f(wo, axis));
    picture(m, argc > 2 ? argv[2] : "10_brdf");

    printf("lesson 10: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: exponent 200 instead of 20 (-DEX=1). What are f in the mirror direction, the albedo, and the standard
       error of "my glossy"? Answer: f = 0.080 + 0.5 * 202 / (2 pi) = 16.15; still 0.75; threefold.
   (2) Break: without 1/pi (-DEX=2) the diffuse albedo is 0.75 pi = 2.36, more light out than in. -DEX=3 takes
       L_s = k_s (I/r^2) cos^p of the slides for reflected light; as a BRDF that is k_s cos^p / cos(theta_i): not
       reciprocal, and its lobe reflects 2 pi k_s / (n+1) = 0.15 instead of 0.5.
   (3) Extend: a lobe N cos^n of the angle between normal and half vector. Which N gives it the albedo k_s in light
       from above? Answer: N = k_s (n+2)(n+4) / (8 pi (n + 2^(-n/2))), as in pt_material_blinn: 1.0504 k_s at n = 20. */
