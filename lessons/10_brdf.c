/* Lesson 10: what a BRDF is

   QUESTION   A surface is lit from one direction. How much light does it send into another one?

   IDEA       Light of radiance L_i from the small solid angle d omega_i gives the surface the irradiance

                  dE = L_i cos(theta_i) d omega_i

              per m^2 of the surface itself. (The slides also write per PROJECTED area: that would count the
              cosine twice.) The surface answers with the radiance dL_r; the ratio is the BRDF, a number per
              steradian:

                  f_r(omega_i -> omega_r) = dL_r(omega_r) / dE(omega_i) = dL_r / (L_i cos(theta_i) d omega_i)
                  ideal diffuse:   f = rho / pi                        the same for all pairs of directions
                  glossy (Phong):  f = k_s (n+2)/(2 pi) cos^n(alpha)   alpha: omega_r to the mirror direction
                  ideal specular:  f = a delta function                0 for every direction chosen beforehand

              Reciprocity: f is the same with its two directions exchanged. Energy: the albedo, the integral
              of f cos(theta_r) d omega_r, is at most 1. f itself may be above 1: it is a density, not a
              share.

   BUILD      cc -O2 -I.. 10_brdf.c -o 10_brdf -lm -pthread
   RUN        ./10_brdf [samples] [output]

   PRINTS     albedo           samples     estimate        exact  std.error  seconds
              ...
              glossy mine       262144     0.801086          0.8     0.0039    0.012
                header          262144     0.800061          0.8    4.9e-05    0.074
              ...
              lamp of 16 deg     16384      1.52328      1.52343     0.0028    0.001

   WORDS      BRDF 双向反射分布函数; irradiance 辐照度; radiance 辐亮度; diffuse 漫反射; specular 镜面; glossy 光泽;
              albedo 反照率; reciprocity 互易性; solid angle 立体角

   HEADER     [PT-08] pt_bsdf_make, pt_bsdf_eval, pt_bsdf_sample, [PT-04] pt_warp_cone, [PT-05]
              pt_irradiance_sphere

   SOURCES    Lafortune, Willems: Using the Modified Phong Reflectance Model, 1994; the slides on the BRDF

   Before: lesson 09. Next: lesson 11, the reflection equation. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX == 2 || EX == 3 };
static const double EXPONENT = EX == 1 ? 200 : 20;

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
    double kd, ks, n;   /* the surface: diffuse and glossy reflectance, exponent; its normal is z */
    pt_vec3 wo, axis;   /* towards the eye, and towards the middle of the lamp */
    double cap;         /* half the angle under which the lamp, of radiance 1, is seen */
    pt_bsdf bsdf;       /* the same surface for the header */
} setting;

/* ---- the new piece: f, its integral, and its definition ----------------------------------------------- */

/* f in 1/sr; directions point away from the surface. No cosine is in f: the cosine belongs to dE. */
static double my_f(const setting *s, pt_vec3 wo, pt_vec3 wi)
{
    double diffuse = EX == 2 ? s->kd : s->kd / PT_PI;
    double cos_alpha = (double)(wo.z * wi.z - wo.x * wi.x - wo.y * wi.y); /* mirrored, wo is (-x, -y, z) */
    double lobe = cos_alpha > 0 ? s->ks * pow(cos_alpha, s->n) : 0;
    if (EX == 3) return diffuse + lobe / (double)wi.z; /* L_s of the slides */
    return diffuse + lobe * (s->n + 2) / (2 * PT_PI);
}

/* One value of the albedo: f cos / p with p = 1/(2 pi), all directions being equally likely. */
static double my_albedo(const setting *s, pt_pcg32 *random)
{
    pt_vec3 wi = pt_warp_hemisphere(pair(random));
    return my_f(s, s->wo, wi) * (double)wi.z * 2 * PT_PI;
}

/* f as it is defined, dL_r / dE: dL_r is one value of f L_i cos / p, with a direction towards the lamp. */
static double my_dl_de(const setting *s, pt_pcg32 *random)
{
    double omc = 1 - cos(s->cap), dE = pt_irradiance_sphere(1, sin(s->cap), 1, (double)s->axis.z);
    pt_frame frame = pt_frame_from_normal(s->axis);
    pt_vec3 wi = pt_frame_to_world(&frame, pt_warp_cone(pair(random), omc));
    return my_f(s, s->wo, wi) * (double)wi.z / pt_warp_cone_pdf_w(omc) / dE;
}

/* The header's: directions drawn by the material's own density. */
static double its_albedo(const setting *s, pt_pcg32 *random)
{
    pt_bsdf_sample_result b; /* its weight is f cos / p */
    double choice = pt_pcg32_double(random);
    return pt_bsdf_sample(&s->bsdf, s->wo, choice, pair(random), PT_RADIANCE, &b) ? (double)b.weight.r : 0;
}

/* Eye and lamp at the angle theta on either side of the normal, so that the lamp's middle is at the peak. */
static setting make(const pt_material *m, double theta, double cap)
{
    setting s;
    pt_hit hit;
    memset(&hit, 0, sizeof hit);
    hit.ng = hit.ns = pt_v3(0, 0, 1);
    s.bsdf = pt_bsdf_make(m, &hit);
    s.kd = (double)m->albedo.r;
    s.ks = (double)m->specular.r;
    s.n = (double)m->exponent;
    s.wo = pt_v3((pt_real)-sin(theta), 0, (pt_real)cos(theta));
    s.axis = pt_v3(-s.wo.x, 0, s.wo.z);
    s.cap = cap;
    return s;
}

/* ---- tables, the picture ------------------------------------------------------------------------------ */

/* Rows for growing counts; 1 if the last mean is exact within 5 standard errors and what float loses. */
static int table(const char *name, double (*value)(const setting *, pt_pcg32 *), const setting *s,
                 double exact, uint32_t first, uint32_t last)
{
    const pt_stats none = PT_STATS_INIT;
    pt_stats stats = none;
    for (; first <= last; first *= 4) {
        pt_pcg32 random = pt_pcg32_make(first, 10);
        double start = pt_cpu_seconds();
        for (stats = none; stats.n < first; ) pt_stats_add(&stats, value(s, &random));
        row(name, &stats, exact, pt_cpu_seconds() - start);
    }
    return fabs(stats.mean - exact) <= 5 * pt_stats_standard_error(&stats) + 2e-5 * fabs(exact);
}

/* The largest relative difference between f(a, b), f(b, a) and the header's f(a, b). */
static double asymmetry(const setting *s)
{
    pt_pcg32 random = pt_pcg32_make(3, 10);
    double most = 0;
    for (int i = 0; i < 4096; i++) {
        pt_vec3 a = pt_warp_hemisphere(pair(&random)), b = pt_warp_hemisphere(pair(&random));
        double ab = my_f(s, a, b), ba = my_f(s, b, a);
        double its = (double)pt_bsdf_eval(&s->bsdf, a, b, PT_RADIANCE, PT_LOBE_ALL).r;
        most = fmax(most, fmax(fabs(ab - ba), fabs(ab - its)) / (ab + ba));
    }
    return most;
}

/* The three materials as balls in the same light. (Bright dots: light that came by way of a shiny ball.) */
static void picture(const pt_material *m, const char *output)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    char path[512];
    int lamp = pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(20)));
    for (int k = 0; k < 3; k++)
        pt_add_sphere(&scene, pt_v3((pt_real)(2 * k - 2), 1, 0), 1, pt_add_material(&scene, m[k]));
    pt_add_parallelogram(&scene, pt_v3(-5, 0, -4), pt_v3(0, 0, 7), pt_v3(10, 0, 0), 1);
    pt_add_sphere(&scene, pt_v3(-3, 5, 5), 1, lamp);
    pt_set_environment(&scene, pt_rgb3(0.25, 0.375, 0.5));
    pt_commit(&scene);
    desc.camera = pt_camera_look_at(pt_v3(0, 3, 9), pt_v3(0, 1, 0), pt_v3(0, 1, 0), 25);
    desc.width = 2 * (desc.height = 160);
    desc.spp = 16;
    pt_render(&scene, &desc, &film, NULL);
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1) == PT_OK, path);
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    uint32_t samples = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 262144;
    const char *head = "%-13s %10s %12s %12s %10s %8s\n";
    pt_material m[3];
    setting s;
    int ok;
    samples = (uint32_t)fmax(1024, samples / (getenv("SHORT") ? 16 : 1));
    m[0] = pt_material_phong(pt_rgb_grey((pt_real)0.7), pt_rgb_grey(0), 0);
    m[1] = pt_material_phong(pt_rgb_grey((pt_real)0.2), pt_rgb_grey((pt_real)0.6), (pt_real)EXPONENT);
    m[2] = pt_material_mirror(pt_rgb_grey(1));
    /* In light from above the lobe's albedo is k_s (n+2)/(2 pi) 2 pi/(n+2) = k_s, the diffuse part's k_d. */
    printf(head, "albedo", "samples", "estimate", "exact", "std.error", "seconds");
    for (int k = 0; k < 2; k++) {
        s = make(&m[k], 0, 0);
        ok = table(k ? "glossy mine" : "diffuse mine", my_albedo, &s, s.kd + s.ks, samples / 16, samples);
        ok &= table("  header", its_albedo, &s, s.kd + s.ks, samples / 16, samples);
        check(ok, "the albedo is k_d + k_s");
        check(asymmetry(&s) < 1e-3, "reciprocity, and the header has the same f");
    }
    s = make(&m[2], 0, 0); /* f is 0 even towards the mirror image, yet all of the light is reflected */
    ok = table("mirror header", its_albedo, &s, 1, samples, samples);
    ok &= !(pt_bsdf_eval(&s.bsdf, s.wo, s.axis, PT_RADIANCE, PT_LOBE_ALL).r > 0);
    check(ok, "mirror: the albedo is 1 although f is 0");
    /* A lamp of half angle c at the peak: dL_r/dE = k_d/pi + k_s/pi (1 - cos^(n+2) c) / sin^2 c. */
    printf(head, "dL_r / dE", "samples", "estimate", "exact", "std.error", "seconds");
    ok = 1;
    for (int degrees = 16; degrees >= 2; degrees /= 2) {
        double c = degrees * PT_PI / 180, share = (1 - pow(cos(c), EXPONENT + 2)) / (sin(c) * sin(c));
        char name[32];
        snprintf(name, sizeof name, "lamp of %d deg", degrees);
        s = make(&m[1], PT_PI / 6, c);
        ok &= table(name, my_dl_de, &s, 0.2 / PT_PI + 0.6 / PT_PI * share, samples / 16, samples / 16);
    }
    printf("What to see: the smaller the lamp, the nearer to f = %.6g; f may be above 1, the albedo not.\n",
           my_f(&s, s.wo, s.axis));
    check(ok, "f is the limit of dL_r / dE");
    picture(m, argc > 2 ? argv[2] : "10_brdf");
    printf("lesson 10: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return failed == 0;
}

/* EXERCISES
   (1) Predict: exponent 200 instead of 20 (-DEX=1). What are f in the mirror direction, the albedo, and the
       standard error of "glossy mine"? Answer: f = 0.064 + 0.6 * 202 / (2 pi) = 19.35; still 0.8; threefold.
   (2) Break: without 1/pi (-DEX=2) the diffuse albedo is 0.7 pi = 2.2, more light out than in. -DEX=3 takes
       L_s = k_s (I/r^2) cos^p of the slides for reflected light; as a BRDF that is k_s cos^p / cos(theta_i):
       not reciprocal, and its lobe reflects 2 pi k_s / (n+1) = 0.18 instead of 0.6.
   (3) Extend: a lobe N cos^n of the angle between normal and half vector. Which N gives it the albedo k_s in
       light from above? Answer: N = k_s (n+2)(n+4) / (8 pi (n + 2^(-n/2))), as in pt_material_blinn: 1.0504
       k_s at n = 20. */
