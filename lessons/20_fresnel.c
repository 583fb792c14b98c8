/* Lesson 20: Snell and Fresnel

   QUESTION  How much light does glass reflect, how much does it let through, and in which direction?
   IDEA      Snell: n1 sin t1 = n2 sin t2. Fresnel, for light polarised across (s) and in (p) the plane of
             incidence, and for unpolarised light:

                 R_s = ((n1 cos t1 - n2 cos t2) / (n1 cos t1 + n2 cos t2))^2
                 R_p = ((n1 cos t2 - n2 cos t1) / (n1 cos t2 + n2 cos t1))^2          R = (R_s + R_p) / 2

             From the dense side there is no t2 beyond the critical angle asin(n2/n1): all light is reflected.
             R_p = 0 at Brewster's angle atan(n2/n1). Schlick: R0 + (1 - R0) (1 - cos t)^5.
   EXACT     The mean over diffuse (cosine-distributed) light, 2 int R(c) c dc, has Walsh's closed form.
             From inside it follows by reciprocity: the same beams pass, n^2 times narrower inside, so
             1 - F_inside = (1 - F_outside) / n^2.
   SLIDES    "The brightness of shadows varies": reflections are meant. Schlick as written there fails for
             n1 > n2: t must be the angle in the thinner medium, and total reflection is not in the formula.
   BUILD     cc -O2 -I.. 20_fresnel.c -o 20_fresnel -lm -pthread
   RUN       ./20_fresnel [samples] [output]
   PRINTS    angle             R_s          R_p            R      Schlick   error
             60            0.17657      0.00180      0.08919      0.07000   -21.5%
   WORDS     Snell's law 斯涅尔定律, Fresnel term 菲涅耳项, reflectance 反射率, refraction 折射,
             polarization 偏振, total internal reflection 全内反射, reciprocity 互易性
   HEADER    [PT-08] pt_fresnel_make, pt_fresnel_schlick, pt_fresnel_diffuse, pt_bsdf_sample
   SOURCES   [Sch94]; [Wal26] the closed form; [PBR] 9.3 Fresnel's equations
   Before: lesson 19. Next: lesson 21. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0
#endif
#define MISTAKE (EX >= 2)

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact, pt_stats_standard_error(s),
           seconds);
}

static const double glass = EX == 1 ? 1.33 : 1.5, degree = PT_PI / 180;

/* --- mine --- */

/* cos t2 by Snell's law; -1 at total reflection. */
static double my_snell(double cos1, double n1, double n2)
{
    double sin2 = n1 / n2 * sqrt(1 - cos1 * cos1);
    if (EX == 3) sin2 = n2 / n1 * sqrt(1 - cos1 * cos1); /* WRONG: the ratio is upside down */
    return sin2 < 1 ? sqrt(1 - sin2 * sin2) : -1;
}

/* The slides' formula; with the angle in the thinner medium, and total reflection. */
static double my_schlick(double cos1, double n1, double n2)
{
    double r0 = (n1 - n2) / (n1 + n2), c = n1 > n2 ? my_snell(cos1, n1, n2) : cos1;
    r0 *= r0;
    return c < 0 ? 1 : r0 + (1 - r0) * pow(1 - c, 5);
}

static double my_fresnel(double cos1, double n1, double n2, double *rs, double *rp)
{
    double cos2 = my_snell(cos1, n1, n2), s, p;
    *rs = *rp = 1;
    if (cos2 < 0) return 1;
    s = (n1 * cos1 - n2 * cos2) / (n1 * cos1 + n2 * cos2);
    p = (n1 * cos2 - n2 * cos1) / (n1 * cos2 + n2 * cos1);
    *rs = s * s;
    *rp = p * p;
    if (EX == 2) { /* WRONG: the slides' Schlick as it stands, from both sides */
        double r0 = (n1 - n2) / (n1 + n2);
        return r0 * r0 + (1 - r0 * r0) * pow(1 - cos1, 5);
    }
    return EX == 4 ? *rs : 0.5 * (*rs + *rp); /* 4: WRONG: light has two polarisations */
}

/* Walsh's mean for diffuse light from the thin side. */
static double walsh(double n)
{
    double m = n * n, a = m + 1, b = m * m - 1, c = m - 1;
    double d = log((n - 1) / (n + 1));
    return 0.5 + (n - 1) * (3 * n + 1) / (6 * (n + 1) * (n + 1)) + m * c * c / (a * a * a) * d -
           2 * n * m * (m + 2 * n - 1) / (a * b) + 8 * m * m * (b + 2) / (a * b * b) * log(n);
}

/* --- the formulas, angle by angle --- */

static void angles(void)
{
    static const double list[10] = {0, 15, 30, 45, 60, 75, 85, 10, 30, 40};
    double worst = 0, energy = 0, rs, rp, r, brewster = atan(glass), critical = asin(1 / glass);
    int k;
    printf("%-10s %10s %12s %12s %12s %7s\n", "angle", "R_s", "R_p", "R", "Schlick", "error");
    for (k = 0; k < 10; k++) {
        double n1 = k < 7 ? 1 : glass, n2 = k < 7 ? glass : 1, c = cos(list[k] * degree);
        double s = my_schlick(c, n1, n2);
        r = my_fresnel(c, n1, n2, &rs, &rp);
        printf("%-3g %-6s %10.5f %12.5f %12.5f %12.5f", list[k], k < 7 ? "" : "inside", rs, rp, r, s);
        printf(" %6.1f%%\n", 100 * (s / r - 1));
    }
    for (k = 1; k < 1000; k++) { /* every cosine, from both sides */
        double n1 = k % 2 ? 1 : glass, n2 = k % 2 ? glass : 1, c = k / 1000.0, c2 = my_snell(c, n1, n2);
        double t = 2 * n1 * c / (n1 * c + n2 * c2); /* Fresnel's amplitude of the transmitted s wave */
        pt_fresnel f = pt_fresnel_make(c, n2 / n1);
        r = my_fresnel(c, n1, n2, &rs, &rp);
        worst = fmax(worst, fabs(r - f.r) + fabs(rs - f.rs) + fabs(rp - f.rp));
        worst = fmax(worst, fabs(my_schlick(c, n1, n2) - pt_fresnel_schlick(c, n2 / n1)));
        if (c2 >= 0) energy = fmax(energy, fabs(rs + t * t * n2 * c2 / (n1 * c) - 1));
    }
    check(worst < 1e-9, "mine and the header's agree at every angle, from both sides");
    check(energy < 1e-12, "reflected and transmitted power sum to 1");
    my_fresnel(cos(brewster), 1, glass, &rs, &rp);
    check(rp < 1e-20, "R_p = 0 at Brewster's angle");
    r = my_fresnel(cos(critical + 1e-6), glass, 1, &rs, &rp);
    check(r == 1 && my_fresnel(cos(critical - 1e-6), glass, 1, &rs, &rp) < 1,
          "total reflection begins at asin(1/n)");
    printf("       Brewster %.2f degrees, critical %.2f degrees\n", brewster / degree, critical / degree);
    r = my_fresnel(0.5, 1, glass, &rs, &rp);
    if (EX != 1) check(fabs(r - 0.0892) < 5e-5, "60 degrees, n = 1.5: R = .0892 (Schlick .0700)");
}

/* --- the mean over diffuse light --- */

static int estimate(int inside, int header, int n)
{
    static const char *const name[4] = {"mine", "header", "mine, inside", "header, inside"};
    pt_pcg32 rng = pt_pcg32_make(20, 0);
    pt_material material = pt_material_dielectric((pt_real)glass);
    pt_stats s = PT_STATS_INIT;
    pt_hit hit;
    pt_bsdf bsdf;
    double start = pt_cpu_seconds(), exact = inside ? 1 - (1 - walsh(glass)) / (glass * glass) : walsh(glass);
    double n1 = inside ? glass : 1, n2 = inside ? 1 : glass;
    int i, k;
    memset(&hit, 0, sizeof hit);
    hit.ng = hit.ns = pt_v3(0, 0, inside ? -1 : 1);
    bsdf = pt_bsdf_make(&material, &hit);
    for (i = 0; i < n; i++) {
        double u[3], rs, rp;
        pt_bsdf_sample_result out;
        pt_vec3 wo;
        for (k = 0; k < 3; k++) u[k] = pt_pcg32_double(&rng);
        wo = pt_warp_cosine(pt_v2((pt_real)u[0], (pt_real)u[1]));
        if (!header) pt_stats_add(&s, my_fresnel((double)wo.z, n1, n2, &rs, &rp));
        else if (pt_bsdf_sample(&bsdf, wo, u[2], pt_v2(0, 0), PT_RADIANCE, &out))
            pt_stats_add(&s, out.wi.z > 0);
    }
    row(name[2 * inside + header], &s, exact, pt_cpu_seconds() - start);
    return fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s);
}

/* --- a plot of R_s, R_p, R and Schlick's formula; and a picture from under water: Snell's window, 2 x 48.75
   degrees wide, has the whole sky; around it the water mirrors the floor --- */

static int plot(const char *output)
{
    static const char *const colour[4] = {"#c33", "#36c", "#000", "#e90"};
    char path[512];
    FILE *file;
    int side, c, k;
    snprintf(path, sizeof path, "%s.svg", output);
    file = fopen(path, "w");
    if (!file) return 0;
    fprintf(file, "<svg xmlns='http://www.w3.org/2000/svg' width='640' height='330'>"
                  "<rect width='640' height='330' fill='#fff'/>"
                  "<path d='M20 10V310H310M340 10V310H630' fill='none' stroke='#888'/>"
                  "<text x='25' y='325'>from air: R_s red, R_p blue, R black, Schlick orange</text>"
                  "<text x='400' y='325'>from inside, 0 to 90 degrees</text>\n");
    for (side = 0; side < 2; side++)
        for (c = 0; c < 4; c++) {
            fprintf(file, "<polyline fill='none' stroke='%s' points='", colour[c]);
            for (k = 0; k <= 290; k++) {
                double r[4], x = cos(k / 290.0 * 90 * degree), n1 = side ? glass : 1, n2 = side ? 1 : glass;
                r[2] = my_fresnel(x, n1, n2, &r[0], &r[1]);
                r[3] = my_schlick(x, n1, n2);
                fprintf(file, "%d,%.1f ", 20 + 320 * side + k, 310 - 300 * r[c]);
            }
            fprintf(file, "'/>\n");
        }
    fprintf(file, "</svg>\n");
    return fclose(file) == 0;
}

static pt_rgb rgb(double r, double g, double b) { return pt_rgb3((pt_real)r, (pt_real)g, (pt_real)b); }

static int picture(const char *output)
{
    pt_texture checker = {0};
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    pt_material tiles = pt_material_diffuse(pt_rgb_grey(1));
    pt_vec3 x = pt_v3(40, 0, 0), z = pt_v3(0, 0, 40);
    int water = pt_add_material(&scene, pt_material_dielectric((pt_real)1.33)), red, bottom, ok;
    char path[512];
    checker.kind = PT_TEXTURE_CHECKER;
    checker.scale = pt_v2(40, 40);
    checker.a = pt_rgb_grey((pt_real)0.7);
    checker.b = rgb(0.1, 0.4, 0.4);
    tiles.texture = &checker;
    bottom = pt_add_material(&scene, tiles);
    red = pt_add_material(&scene, pt_material_diffuse(rgb(0.7, 0.2, 0.1)));
    pt_add_parallelogram(&scene, pt_v3(-20, -2, -20), z, x, bottom);
    pt_add_parallelogram(&scene, pt_v3(-20, 0, -20), z, x, water);
    pt_add_sphere(&scene, pt_v3(-6, 4, 3), 2, red);
    pt_set_environment(&scene, rgb(0.3, 0.4, 0.55));
    desc.camera = pt_camera_look_at(pt_v3(0, (pt_real)-1.5, 0), pt_v3(0, 0, 0), pt_v3(0, 0, 1), 125);
    desc.width = 320;
    desc.height = 240;
    desc.spp = 8;
    ok = pt_commit(&scene) == PT_OK && pt_render(&scene, &desc, &film, NULL) == PT_OK;
    snprintf(path, sizeof path, "%s.ppm", output);
    ok = ok && pt_write_ppm(path, &film, 1) == PT_OK;
    snprintf(path, sizeof path, "%s.png", output);
    ok = ok && pt_write_png(path, &film, 1) == PT_OK;
    pt_film_free(&film);
    pt_scene_free(&scene);
    return ok && plot(output);
}

int main(int argc, char **argv)
{
    int n = argc > 1 && atoi(argv[1]) > 0 ? atoi(argv[1]) : 1 << 20, k, i, agree = 1;
    const char *output = argc > 2 ? argv[2] : "20_fresnel";
    if (getenv("SHORT")) n /= 16;
    angles();
    printf("%-14s %9s %12s %12s %10s %8s\n", "diffuse light", "samples", "estimate", "exact", "std error",
           "seconds");
    for (k = 0; k < 4; k++)
        for (i = n / 256; i <= n; i *= 16) agree = estimate(k / 2, k % 2, i) && agree;
    printf("See: more than half of the diffuse light inside is kept in; coins have more noise.\n");
    check(agree, "means within 5 standard errors of Walsh's formula");
    check(fabs(walsh(glass) - pt_fresnel_diffuse(glass)) < 1e-12, "pt_fresnel_diffuse is Walsh's formula");
    check(picture(output), "picture and plot written");
    printf("lesson 20: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("the mistake of exercise %d was %s\n", EX, failed ? "noticed" : "NOT noticed");
    return !failed;
}

/* EXERCISES (cc -DEX=1 ... compiles the first one, and so on)
   1. Predict and run, -DEX=1: water, n = 1.33. Brewster's angle? The critical angle, half the width of the
      window in the picture? (53.06 and 48.75 degrees.)
   2. Break it, and watch which check fails. -DEX=2: the slides' Schlick from both sides. -DEX=3: Snell's
      ratio upside down. -DEX=4: one polarisation for both. All pass the check of the energy: why? (R_s +
      T_s = 1 is an identity for whatever cos t2: conservation of energy does not prove a direction right.)
   3. Extend it: a window pane has two surfaces, and light goes to and fro between them. Sum the series: R =
      2F/(1+F), .0769 at normal incidence for n = 1.5, not 2F = .08. */
