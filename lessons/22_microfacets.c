/* Lesson 22: microfacets: D, F, G, and visible normals

   QUESTION   Frosted metal is made of tiny mirrors. What BRDF has such a surface, how is it sampled, and does it
              reflect all light?
   IDEA       A facet with normal h sends wo into wi only if h is half way, the half vector h = (wo + wi)/|wo + wi|.
              With the normal distribution function D (GGX, roughness alpha), Fresnel's F and the shadowing-masking G,
              the share of facets that is both seen and lit:

                  f = F(wo,h) G(wo,wi) D(h) / (4 (n.wo) (n.wi)),       int D(h) (n.h) dh = 1
                  D = alpha^2 / (pi ((n.h)^2 (alpha^2 - 1) + 1)^2),    density of wi = density of h / (4 (wo.h))
                  G1 = 1/(1+L),  L = (sqrt(1 + alpha^2 tan^2) - 1) / 2,  G = 1/(1 + L(wo) + L(wi))

              Draw h from D (n.h), or better from the facets that wo sees, D G1 (wo.h)/(n.wo): then the weight
              f cos / density = F G/G1(wo) is never above 1. (Why? G, seen and lit, is at most G1, seen.)
              Perfect mirrors, F = 1, lose light all the same, as a furnace test shows: what hits a second facet is
              dropped. The albedo from above, with t = tan^2 of h, is E = int_0^1 alpha^2/(alpha^2+t)^2 G1(tan^2 =
              4t/(1-t)^2) dt. If alpha = 1, G1 is 1-t, and E = int_0^1 (1-t)/(1+t)^2 dt = 1 - ln 2. The other values
              are quadratures.
   PICTURE    Perfect metals, alpha 0.1, 0.25 (above), 0.5, 1 (below), in a white furnace, where they should vanish.
   BUILD      cc -O2 -I.. 22_microfacets.c -o 22_microfacets -lm -pthread
   RUN        ./22_microfacets [samples] [output]
   PRINTS     alpha .5, 60 deg samples     estimate        exact  std.error  seconds
              my normals        524288     0.698933     0.698251    0.00096    0.091
              my visible        524288      0.69849     0.698251     0.0005    0.109
   WORDS      microfacet 微表面; normal distribution function 法线分布函数; shadowing-masking 阴影遮蔽(几何项);
              roughness 粗糙度; half vector 半程向量; albedo 反照率; furnace test 白炉测试
   HEADER     [PT-08] pt_ggx_d, pt_ggx_g1, pt_ggx_visible_sample, pt_bsdf_eval, pt_bsdf_sample
   SOURCES    [Wal07] GGX; [Hei14] G; [Hei18], [Dup23] visible normals
   Before: lesson 21, glass and caustics. Next: lesson 23, measuring a BRDF. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX >= 2 };

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

typedef struct setting {
    double alpha, angle; /* of the view in degrees, -1: light from a uniform sky, by the cosine */
    double most;         /* the largest value so far */
    pt_bsdf bsdf;
} setting;

typedef double (*value_fn)(setting *s, pt_vec3 o, pt_sampler *random);

static pt_vec3 unit(double x, double y, double z)
{
    return pt_v3_normalize(pt_v3((pt_real)x, (pt_real)y, (pt_real)z));
}

/* Takes n values and prints a row; 1 if the mean is exact within 5 standard errors and the rounding of float. */
static int row(const char *name, value_fn value, setting *s, double exact, uint32_t n)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 22, n);
    pt_stats stats = PT_STATS_INIT;
    double start = pt_cpu_seconds(), error;
    s->most = 0;
    for (uint32_t i = 0; i < n; i++) {
        pt_sampler_start(&random, n, i);
        double u = (double)pt_sampler_1d(&random), z = s->angle < 0 ? sqrt(1 - u) : cos(s->angle * PT_PI / 180);
        double v = value(s, unit(sqrt(1 - z * z), 0, z), &random);
        s->most = fmax(s->most, v);
        pt_stats_add(&stats, v);
    }
    error = pt_stats_standard_error(&stats);
    printf("%-14s %9u %12.6g %12.6g %10.2g %8.3f\n", name, n, stats.mean, exact, error, pt_cpu_seconds() - start);
    return fabs(stats.mean - exact) <= 5 * error + pt_gamma(300) * exact; /* 300 operations */
}

/* ---- the new piece; z is the normal -------------------------------------------------------------------- */

static double my_d(pt_vec3 h, double alpha)
{
    double k = (double)h.z * (double)h.z * (alpha * alpha - 1) + 1;
    return alpha * alpha / (PT_PI * k * k);
}

static double my_lambda(pt_vec3 w, double alpha)
{
    double z2 = (double)w.z * (double)w.z;
    return (sqrt(1 + alpha * alpha * (1 - z2) / z2) - 1) / 2;
}

static double my_g(pt_vec3 o, pt_vec3 i, double alpha)
{
    if (EX == 1) return 1 / ((1 + my_lambda(o, alpha)) * (1 + my_lambda(i, alpha))); /* as if independent */
    return EX == 2 ? 1 : 1 / (1 + my_lambda(o, alpha) + my_lambda(i, alpha));        /* 2: no masking */
}

static double my_f(pt_vec3 o, pt_vec3 i, double alpha) /* of perfect mirrors: F = 1 */
{
    double d = my_d(pt_v3_normalize(pt_v3_add(o, i)), alpha);
    return o.z > 0 && i.z > 0 ? my_g(o, i, alpha) * d / (4 * (double)o.z * (double)i.z) : 0;
}

/* The weight f cos / density of the direction that h mirrors, if h has the density p. */
static double my_weight(pt_vec3 o, pt_vec3 h, double p, double alpha)
{
    pt_vec3 i = pt_v3_sub(pt_v3_scale(h, 2 * pt_v3_dot(o, h)), o);
    double oh = (double)pt_v3_dot(o, h), density = EX == 3 ? p : p / (4 * oh); /* 3: that of h is not that of wi */
    return oh > 0 && i.z > 0 ? my_f(o, i, alpha) * (double)i.z / density : 0;  /* 0: to a second facet, lost */
}

/* By a normal with density D cos: its tan^2 has the distribution function t / (alpha^2 + t). */
static double my_normal(setting *s, pt_vec3 o, pt_sampler *random)
{
    pt_vec2 u = pt_sampler_2d(random);
    double r = s->alpha * sqrt((double)u.x / (1 - (double)u.x)), phi = 2 * PT_PI * (double)u.y;
    pt_vec3 h = unit(r * cos(phi), r * sin(phi), 1);
    return my_weight(o, h, my_d(h, s->alpha) * (double)h.z, s->alpha);
}

/* By a normal that o sees. Stretched by alpha the facets are a hemisphere; its seen part mirrors into a cap. */
static double my_visible(setting *s, pt_vec3 o, pt_sampler *random)
{
    pt_vec3 t = unit(s->alpha * (double)o.x, s->alpha * (double)o.y, (double)o.z);
    pt_vec2 u = pt_sampler_2d(random);
    double z = (1 - (double)u.x) * (1 + (double)t.z) - (double)t.z, r = sqrt(fmax(0, 1 - z * z));
    double x = (double)t.x + r * cos(2 * PT_PI * (double)u.y), y = (double)t.y + r * sin(2 * PT_PI * (double)u.y);
    pt_vec3 h = unit(s->alpha * x, s->alpha * y, (double)t.z + z);
    double g1 = 1 / (1 + my_lambda(o, s->alpha)), oh = (double)pt_v3_dot(o, h);
    return my_weight(o, h, my_d(h, s->alpha) * g1 * oh / (double)o.z, s->alpha);
}

/* ---- the header's -------------------------------------------------------------------------------------- */

static double its_value(setting *s, pt_vec3 o, pt_sampler *random)
{
    pt_bsdf_sample_result out;
    return pt_bsdf_sample(&s->bsdf, o, 0, pt_sampler_2d(random), PT_RADIANCE, &out) ? (double)out.weight.g : 0;
}

/* Metal of F = 1 - 4e-10. */
static pt_material white_metal(double alpha)
{
    return pt_material_conductor(pt_rgb_grey(1), pt_rgb_grey(100000), (pt_real)sqrt(alpha));
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

/* Exact values for mine, and for the header's, which has no exercises. */
static void table(const char *name, double alpha, double angle, double exact, double its_exact, uint32_t n)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 22, 0);
    pt_material metal = white_metal(alpha);
    setting s = {alpha, angle, 0, {0}};
    pt_hit hit = {0};
    double most, difference = 0;
    hit.ng = hit.ns = pt_v3(0, 0, 1);
    s.bsdf = pt_bsdf_make(&metal, &hit);
    printf("%-16s %7s %12s %12s %10s %8s\n", name, "samples", "estimate", "exact", "std.error", "seconds");
    int good = row("my normals", my_normal, &s, exact, n);
    most = s.most;
    good &= row("my visible", my_visible, &s, exact, n) && s.most <= 1 + pt_gamma(300);
    printf("               largest weight %.4g by normals, %.4g by visible ones\n", most, s.most);
    good &= row("its visible", its_value, &s, its_exact, n) && s.most <= 1 + pt_gamma(300);
    for (int k = 0; k < 1000; k++) {
        pt_vec3 o = pt_warp_cosine(pt_sampler_2d(&random)), i = pt_warp_cosine(pt_sampler_2d(&random));
        pt_rgb its = pt_bsdf_eval(&s.bsdf, o, i, PT_RADIANCE, PT_LOBE_ALL);
        difference = fmax(difference, fabs((double)its.g / my_f(o, i, alpha) - 1));
    }
    check(good, "within 5 standard errors of the exact value, visible weights at most 1");
    if (EX != 1) check(difference < 1e-3, "f is the header's");
}

static void picture(const char *output)
{
    static const double alpha[4] = {0.1, 0.25, 0.5, 1};
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    char path[512];
    for (int k = 0; k < 4; k++) {
        pt_vec3 centre = pt_v3((pt_real)(k % 2 * 2 - 1), (pt_real)(1 - k / 2 * 2), 0);
        pt_add_sphere(&scene, centre, (pt_real)0.9, pt_add_material(&scene, white_metal(alpha[k])));
    }
    pt_set_environment(&scene, pt_rgb_grey((pt_real)0.7));
    desc.camera = pt_camera_look_at(pt_v3(0, 0, 20), pt_v3(0, 0, 0), pt_v3(0, 1, 0), (pt_real)11.5);
    desc.spp = 8;
    if (pt_commit(&scene) != PT_OK || pt_render(&scene, &desc, &film, NULL) != PT_OK) return;
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1) == PT_OK, path);
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    double n = fmax(4096, (argc > 1 ? strtod(argv[1], NULL) : 524288) / (getenv("SHORT") ? 16 : 1));
    table("alpha .5, above", 0.5, 0, 0.687848515, 0.687848515, (uint32_t)n);
    table("alpha .5, 60 deg", 0.5, 60, EX == 1 ? 0.686007250 : 0.698250697, 0.698250697, (uint32_t)n);
    if (EX != 1) table("alpha .5, sky", 0.5, -1, 0.700240477, 0.700240477, (uint32_t)n);
    table("alpha 1, above", 1, 0, 1 - log(2), 1 - log(2), (uint32_t)n);
    printf("What to see: off the axis visible normals have half the standard error; mirrors lose up to two thirds.\n");
    picture(argc > 2 ? argv[2] : "22_microfacets");
    printf("lesson 22: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: G = G1(wo) G1(wi), as if being seen and being lit were independent (-DEX=1). More or less light at 60
       degrees? Answer: less, 0.686007, not 0.698251; high facets are both seen and lit.
   (2) Break: no G (-DEX=2): 0.975 at 60 degrees, weights above 1. The factor 4 (wo.h) between the densities of h and wi
       forgotten (-DEX=3): all estimates are wrong, but f is the header's: a mistake of the sampler alone.
   (3) Extend: add what is lost as a second lobe, (1 - E(wo)) (1 - E(wi)) / (pi (1 - 0.700240)) for alpha 0.5 (Kulla,
       Conty 2017), E(w) the albedo seen from w. Answer: its albedo is 1 - E(wo), the sum 1 from everywhere. */
