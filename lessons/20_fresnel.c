/* Lesson 20: Snell and Fresnel

   QUESTION   How much light does glass reflect, how much does it let through, and in which direction?
   IDEA       Snell's law: n1 sin t1 = n2 sin t2. The Fresnel term for polarization across (s) and in (p) the plane of
              incidence, and the reflectance R for light without:

                  R_s = ((n1 cos t1 - n2 cos t2) / (n1 cos t1 + n2 cos t2))^2
                  R_p = ((n1 cos t2 - n2 cos t1) / (n1 cos t2 + n2 cos t1))^2          R = (R_s + R_p) / 2

              From the dense side there is no t2 beyond the critical angle asin(n2/n1): total internal reflection. R_p
              = 0 at Brewster's angle atan(n2/n1). Schlick: R0 + (1 - R0) (1 - cos t)^5; as it stands on the slides it
              fails for n1 > n2, where t must be the angle in the thinner medium and total reflection is missing.
              (Their "brightness of shadows varies" means reflections.) The mean over diffuse (cosine-distributed)
              light, F = 2 int R(c) c dc, is known (Walsh); inside, by reciprocity, 1 - F_inside = (1 - F) / n^2.
   PICTURE    Up from under water: Snell's window has all of the sky; around it the water mirrors floor and ball.
   PLOT       R_s, R_p, R and Schlick's formula over the angle, from air (left) and from inside.
   BUILD      cc -O2 -I.. 20_fresnel.c -o 20_fresnel -lm -pthread
   RUN        ./20_fresnel [samples] [output]          writes also output.svg, the curves over the angle
   PRINTS     angle             R_s          R_p            R      Schlick   error
              60.00         0.17657      0.00180      0.08919      0.07000   -21.5%
   WORDS      Snell's law 斯涅尔定律; Fresnel term 菲涅耳项; reflectance 反射率; polarization 偏振; total internal reflection 全内反射
   HEADER     [PT-08] pt_fresnel_make, pt_fresnel_schlick, pt_fresnel_diffuse, pt_bsdf_sample
   SOURCES    [Sch94]; [Wal26] the closed form; [PBR] 9.3 Fresnel's equations
   Before: lesson 19, the bounding volume hierarchy. Next: lesson 21, glass and caustics. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX >= 2 };
static const double ior = EX == 1 ? 1.33 : 1.5, degree = PT_PI / 180;

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

typedef struct setting {
    double n1, n2; /* light comes from the side of n1 */
    pt_bsdf bsdf;
} setting;

typedef double (*value_fn)(const setting *s, pt_sampler *random);

/* Takes n values and prints a row; 1 if the mean is exact within 5 standard errors and the rounding of float. */
static int row(const char *name, value_fn value, const setting *s, double exact, uint32_t n)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 20, n);
    pt_stats stats = PT_STATS_INIT;
    double start = pt_cpu_seconds(), error;
    for (uint32_t i = 0; i < n; i++) {
        pt_sampler_start(&random, n, i);
        pt_stats_add(&stats, value(s, &random));
    }
    error = pt_stats_standard_error(&stats);
    printf("%-14s %9u %12.6g %12.6g %10.2g %8.3f\n", name, n, stats.mean, exact, error, pt_cpu_seconds() - start);
    return fabs(stats.mean - exact) <= 5 * error + pt_gamma(300) * exact; /* 300 operations */
}

/* ---- the new piece: what happens at a smooth surface --------------------------------------------------- */

/* cos t2 by Snell's law; -1 at total reflection. */
static double my_snell(double cos1, double n1, double n2)
{
    double sin2 = (EX == 3 ? n2 / n1 : n1 / n2) * sqrt(1 - cos1 * cos1); /* 3: the ratio is upside down */
    return sin2 < 1 ? sqrt(1 - sin2 * sin2) : -1;
}

/* The slides' formula, but with the angle in the thinner medium, and with total reflection. */
static double my_schlick(double cos1, double n1, double n2)
{
    double r = (n1 - n2) / (n1 + n2), c = n1 <= n2 || EX == 2 ? cos1 : my_snell(cos1, n1, n2); /* 2: as it stands */
    return c < 0 ? 1 : r * r + (1 - r * r) * pow(1 - c, 5);
}

static double my_fresnel(double cos1, double n1, double n2, double *rs, double *rp)
{
    double cos2 = my_snell(cos1, n1, n2);
    *rs = cos2 < 0 ? 1 : pow((n1 * cos1 - n2 * cos2) / (n1 * cos1 + n2 * cos2), 2);
    *rp = cos2 < 0 ? 1 : pow((n1 * cos2 - n2 * cos1) / (n1 * cos2 + n2 * cos1), 2);
    return EX == 4 ? *rs : (*rs + *rp) / 2; /* 4: light has two polarisations */
}

static double my_value(const setting *s, pt_sampler *random)
{
    double rs, rp;
    return my_fresnel((double)pt_warp_cosine(pt_sampler_2d(random)).z, s->n1, s->n2, &rs, &rp);
}

/* ---- the header's: tosses a coin, reflects or refracts ------------------------------------------------- */

static double its_value(const setting *s, pt_sampler *random)
{
    pt_vec3 wo = pt_warp_cosine(pt_sampler_2d(random));
    double u = (double)pt_sampler_1d(random);
    pt_bsdf_sample_result out;
    return pt_bsdf_sample(&s->bsdf, wo, u, pt_v2(0, 0), PT_RADIANCE, &out) && out.wi.z > 0;
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

/* The formulas, angle by angle. */
static void angles(void)
{
    double worst = 0, energy = 0, rs, rp, r, brewster = atan(ior) / degree, critical = asin(1 / ior) / degree;
    double list[11] = {0, 15, 30, 45, 60, 75, 85, brewster, 30, 40, critical};
    printf("%-10s %10s %12s %12s %12s %7s\n", "angle", "R_s", "R_p", "R", "Schlick", "error");
    for (int k = 0; k < 11; k++) {
        double n1 = k < 8 ? 1 : ior, n2 = k < 8 ? ior : 1, c = cos(list[k] * degree), s = my_schlick(c, n1, n2);
        r = my_fresnel(c, n1, n2, &rs, &rp);
        printf("%-5.2f %-6s %8.5f %12.5f %12.5f %12.5f", list[k], k < 8 ? "" : "inside", rs, rp, r, s);
        printf(" %6.1f%%\n", 100 * (s / r - 1));
    }
    for (int k = 1; k < 1000; k++) { /* every cosine, from both sides */
        double n1 = k % 2 ? 1 : ior, n2 = k % 2 ? ior : 1, c = k / 1000.0, c2 = my_snell(c, n1, n2);
        double t = 2 * n1 * c / (n1 * c + n2 * c2); /* Fresnel's amplitude of the s wave that passes */
        pt_fresnel f = pt_fresnel_make(c, n2 / n1);
        r = my_fresnel(c, n1, n2, &rs, &rp);
        worst = fmax(worst, fabs(r - f.r) + fabs(rs - f.rs) + fabs(rp - f.rp));
        worst = fmax(worst, fabs(my_schlick(c, n1, n2) - pt_fresnel_schlick(c, n2 / n1)));
        if (c2 >= 0) energy = fmax(energy, fabs(rs + t * t * n2 * c2 / (n1 * c) - 1));
    }
    check(worst < 1e-9, "mine and the header's agree at every angle, from both sides");
    check(energy < 1e-12, "reflected and transmitted power sum to 1");
    my_fresnel(cos(brewster * degree), 1, ior, &rs, &rp);
    check(rp < 1e-20, "R_p = 0 at Brewster's angle");
    double below = my_snell(cos((critical - 1e-4) * degree), ior, 1);
    check(below > 0 && my_snell(cos((critical + 1e-4) * degree), ior, 1) < 0, "total reflection begins at asin(1/n)");
}

/* The mean over diffuse light, from outside and from inside. */
static void table(uint32_t n)
{
    pt_material material = pt_material_dielectric((pt_real)ior);
    int good = 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "diffuse light", "samples", "estimate", "exact", "std.error", "seconds");
    for (int inside = 0; inside < 2; inside++) {
        double f = pt_fresnel_diffuse(ior), exact = inside ? 1 - (1 - f) / (ior * ior) : f;
        setting s = {inside ? ior : 1, inside ? 1 : ior, {0}};
        pt_hit hit = {0};
        hit.ng = hit.ns = pt_v3(0, 0, inside ? -1 : 1);
        s.bsdf = pt_bsdf_make(&material, &hit);
        good &= row(inside ? "mine, inside" : "mine", my_value, &s, exact, n);
        good &= row(inside ? "coins, inside" : "its coins", its_value, &s, exact, n);
    }
    check(good, "means within 5 standard errors of Walsh's formula");
}

static void plot(const char *path)
{
    static const char *const colour[4] = {"#c33", "#36c", "#000", "#e90"};
    FILE *file = fopen(path, "w");
    if (!file) return;
    fprintf(file, "<svg xmlns='http://www.w3.org/2000/svg' width='640' height='330' style='background:#fff'>"
                  "<path d='M20 10V310H310M340 10V310H630' fill='none' stroke='#888'/>"
                  "<text x='25' y='325'>from air: R_s red, R_p blue, R black, Schlick orange</text>"
                  "<text x='400' y='325'>from inside, 0 to 90 degrees</text>\n");
    for (int k = 0; k < 8; k++) {
        double n1 = k / 4 ? ior : 1, n2 = k / 4 ? 1 : ior, r[4];
        fprintf(file, "<polyline fill='none' stroke='%s' points='", colour[k % 4]);
        for (int x = 0; x <= 290; x++) {
            r[2] = my_fresnel(cos(x / 290.0 * 90 * degree), n1, n2, &r[0], &r[1]);
            r[3] = my_schlick(cos(x / 290.0 * 90 * degree), n1, n2);
            fprintf(file, "%d,%.1f ", 20 + 320 * (k / 4) + x, 310 - 300 * r[k % 4]);
        }
        fprintf(file, "'/>\n");
    }
    fprintf(file, "</svg>\n");
    fclose(file);
}

static void picture(const char *output)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    char path[512];
    if (pt_scene_pool(&scene, &desc.camera) != PT_OK) return;
    int red = pt_add_material(&scene, pt_material_diffuse(pt_cornell_rgb("red")));
    int green = pt_add_material(&scene, pt_material_diffuse(pt_cornell_rgb("green")));
    pt_add_sphere(&scene, pt_v3(-3, 3, 1), 1, red);
    pt_add_sphere(&scene, pt_v3(0, (pt_real)-0.5, (pt_real)-1.5), (pt_real)0.25, green);
    desc.camera = pt_camera_look_at(pt_v3(0, (pt_real)-0.25, 0), pt_v3(0, 0, 0), pt_v3(0, 0, 1), 120);
    desc.spp = 12;
    if (pt_commit(&scene) != PT_OK || pt_render(&scene, &desc, &film, NULL) != PT_OK) return;
    snprintf(path, sizeof path, "%s.svg", output);
    plot(path);
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 0.7);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 0.7) == PT_OK, path);
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    double n = fmax(4096, (argc > 1 ? strtod(argv[1], NULL) : 1048576) / (getenv("SHORT") ? 16 : 1));
    angles();
    table((uint32_t)n);
    printf("What to see: more than half of the diffuse light inside is kept in; coins have more noise.\n");
    picture(argc > 2 ? argv[2] : "20_fresnel");
    printf("lesson 20: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict for water (-DEX=1): Brewster's angle; the critical angle, half the window. Answer: 53.06, 48.75 degrees.
   (2) Break: Schlick as on the slides (-DEX=2), Snell's ratio upside down (-DEX=3), one polarisation for both (-DEX=4).
       All pass the check of the energy: why? Answer: R_s + T_s = 1 is an identity for whatever cos t2.
   (3) Extend: a window pane has two surfaces, and light goes to and fro between them. Sum the series. Answer: R =
       2F/(1+F), 0.0769 at normal incidence for n = 1.5, not 2F = 0.08. */
