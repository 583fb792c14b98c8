/* Lesson 23: measuring a BRDF: gonioreflectometer and MERL table

   QUESTION   How does the BRDF of a real thing get into a renderer, and what is in such a table?
   IDEA       A gonioreflectometer sends a thin beam along wo and counts what arrives in a sensor of directions S:

                  f = (fraction of the light that arrives) / int_S cos dw,   a cone of half angle a: pi sin^2 a

              is the mean of f there. A Phong lobe f = rho (n+2)/(2 pi) cos^n sends rho (1 - cos^(n+2) a) into the cone.
              An isotropic BRDF has 3 angles, in tabular form 90 x 90 x 180 = 1,458,000 cells for each colour. Which
              angles? A highlight is where the half vector h = (wo + wi)/|wo + wi| is near the normal: take theta_h and
              the angles theta_d, phi_d of wi seen from h (Rusinkiewicz). Cells are even in sqrt(theta_h), so fine in
              the highlight. By reciprocity 180 cells do for phi_d: swapping wo and wi adds 180 degrees. The slides
              store (theta_i, theta_o, |phi_i - phi_o|), as they are measured; the MERL files hold (theta_h, theta_d,
              phi_d).
   PICTURE    Two balls under a lamp between them: the left one has the Phong lobe itself, the right one its table.
   BUILD      cc -O2 -I.. 23_measuring.c -o 23_measuring -lm -pthread
   RUN        ./23_measuring [samples] [output]          takes 40 MB of memory
   PRINTS     cells              pairs    rms error                             seconds
              MERL              262144        0.030                               0.116
              the slides'       262144        0.046                               0.101
   WORDS      gonioreflectometer 角反射仪(测角反射计); BRDF 双向反射分布函数; isotropic 各向同性; reciprocity 互易性; tabular 表格化
   HEADER     [PT-08] pt_measured_index, pt_measured_fill, pt_measured_scatter, [PT-17] pt_measured_read
   SOURCES    [Mat03] the database, [Rus98] the angles
   Before: lesson 22, microfacets. Next: lesson 24, is it correct? */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX >= 2 };
enum { MERL, SLIDES }; /* sqrt(theta_h), theta_d, phi_d; theta_i, theta_o, |phi_i - phi_o| */
static const double exponent = EX == 1 ? 1000 : 100, rho = 0.6;

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

typedef struct setting {
    double cos_a, cone; /* the sensor: its half angle, and int cos dw over it */
    pt_bsdf table;
} setting;

typedef double (*value_fn)(const setting *s, pt_sampler *random);

/* Takes n values and prints a row; 1 if the mean is exact within 5 standard errors and the rounding of float. */
static int row(const char *name, value_fn value, const setting *s, double exact, uint32_t n)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 23, n);
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

static pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }

/* ---- the new piece: the cell of a pair of directions; z is the normal ---------------------------------- */

static int my_index(pt_vec3 wo, pt_vec3 wi, int kind)
{
    double ix = (double)wi.x, iy = (double)wi.y, iz = (double)wi.z, ox = (double)wo.x, oy = (double)wo.y;
    double across = hypot(ox + ix, oy + iy), theta_h = atan2(across, (double)wo.z + iz);
    double cp = across > 0 ? (ox + ix) / across : 1, sp = across > 0 ? (oy + iy) / across : 0;
    double along = cp * ix + sp * iy, y = cp * iy - sp * ix; /* turn h over the x axis, then onto the z axis */
    double x = cos(theta_h) * along - sin(theta_h) * iz, z = sin(theta_h) * along + cos(theta_h) * iz;
    double a = EX == 3 ? theta_h / (PT_PI / 2) : sqrt(theta_h / (PT_PI / 2)), d = atan2(hypot(x, y), z) / (PT_PI / 2);
    double phi = atan2(y, x) / PT_PI + (y < 0); /* reciprocity */
    if (kind == SLIDES) {
        a = acos(fmin(1, iz)) / (PT_PI / 2);
        d = acos(fmin(1, (double)wo.z)) / (PT_PI / 2);
        phi = fabs(atan2(ix * oy - iy * ox, ix * ox + iy * oy)) / PT_PI;
    }
    return ((int)fmin(89, a * 90) * 90 + (int)fmin(89, d * 90)) * 180 + (int)fmin(179, phi * 180);
}

/* The pair of directions in the middle of a cell; they may be below the surface. */
static void my_directions(int index, int kind, pt_vec3 *wo, pt_vec3 *wi)
{
    double a = (index / (90 * 180) + 0.5) / 90, d = (index / 180 % 90 + 0.5) / 90 * (PT_PI / 2);
    double phi = (index % 180 + 0.5) / 180 * PT_PI, h = (kind == MERL && EX != 3 ? a * a : a) * (PT_PI / 2);
    double x = sin(d) * cos(phi), y = sin(d) * sin(phi), z = cos(d);
    *wi = v3(cos(h) * x + sin(h) * z, y, cos(h) * z - sin(h) * x);
    *wo = v3(-cos(h) * x + sin(h) * z, -y, cos(h) * z + sin(h) * x);
    if (kind != SLIDES) return;
    *wi = v3(sin(h) * cos(phi), sin(h) * sin(phi), cos(h));
    *wo = v3(sin(d), 0, cos(d));
}

/* ---- the sample on the turntable: a Phong lobe --------------------------------------------------------- */

static pt_rgb lobe(void *user, pt_vec3 wo, pt_vec3 wi)
{
    double c = (double)(wo.z * wi.z - wo.x * wi.x - wo.y * wi.y);
    (void)user;
    return pt_rgb_grey((pt_real)(c > 0 ? rho * (exponent + 2) / (2 * PT_PI) * pow(c, exponent) : 0));
}

/* Draws wi from the lobe; its weight is f cos / p. 0: below the surface. */
static double scatter(pt_vec3 wo, pt_sampler *random, pt_vec3 *wi)
{
    pt_vec2 u = pt_sampler_2d(random);
    double c = pow((double)u.x, 1 / (exponent + 1)), s = sqrt(1 - c * c), phi = 2 * PT_PI * (double)u.y;
    pt_frame frame = pt_frame_from_normal(pt_v3(-wo.x, -wo.y, wo.z));
    *wi = pt_frame_to_world(&frame, v3(s * cos(phi), s * sin(phi), c));
    return wi->z > 0 ? rho * (exponent + 2) / (exponent + 1) * (double)wi->z : 0;
}

static double my_sensor(const setting *s, pt_sampler *random)
{
    pt_vec3 wi;
    double weight = scatter(pt_v3(0, 0, 1), random, &wi);
    return (double)wi.z > s->cos_a ? weight / s->cone : 0;
}

/* ---- the header's: it scatters at the table ------------------------------------------------------------- */

static double its_sensor(const setting *s, pt_sampler *random)
{
    pt_vec2 u = pt_sampler_2d(random);
    pt_bsdf_sample_result out;
    if (!pt_bsdf_sample(&s->table, pt_v3(0, 0, 1), (double)pt_sampler_1d(random), u, PT_RADIANCE, &out)) return 0;
    return (double)out.wi.z > s->cos_a ? (double)out.weight.g / s->cone : 0;
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

/* How well cells hold the lobe: root mean square of f(middle of the cell) - f over that of f, at pairs that it
   scatters. bad: at all pairs, cells that are not found back from their middles, and that are not the header's. */
static double cells(const char *name, int kind, uint32_t n, int bad[2])
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 23, n);
    double wrong = 0, all = 0, start = pt_cpu_seconds();
    for (uint32_t i = 0; i < n; i++) {
        pt_sampler_start(&random, 0, i);
        pt_vec3 wo = pt_warp_cosine(pt_sampler_2d(&random)), wi = pt_warp_cosine(pt_sampler_2d(&random)), co, ci;
        int cell = my_index(wo, wi, kind);
        my_directions(cell, kind, &co, &ci);
        bad[0] += co.z > 0 && ci.z > 0 && my_index(co, ci, kind) != cell;
        bad[1] += pt_measured_index(wo, wi) != cell;
        if (scatter(wo, &random, &wi) == 0) continue;
        my_directions(my_index(wo, wi, kind), kind, &co, &ci);
        double f = (double)lobe(NULL, wo, wi).g, g = co.z > 0 && ci.z > 0 ? (double)lobe(NULL, co, ci).g : 0;
        wrong += (g - f) * (g - f);
        all += f * f;
    }
    printf("%-14s %9u %12.3f %35.3f\n", name, n, sqrt(wrong / all), pt_cpu_seconds() - start);
    return sqrt(wrong / all);
}

static void picture(const char *output, pt_material table)
{
    pt_material phong = pt_material_phong(pt_rgb_grey(0), pt_rgb_grey((pt_real)rho), (pt_real)exponent);
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    char path[512];
    pt_add_sphere(&scene, pt_v3(-1, 0, 0), (pt_real)0.9, pt_add_material(&scene, phong));
    pt_add_sphere(&scene, pt_v3(1, 0, 0), (pt_real)0.9, pt_add_material(&scene, table));
    pt_add_sphere(&scene, pt_v3(0, 3, 4), 1, pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(3))));
    pt_set_environment(&scene, pt_rgb_grey((pt_real)0.3));
    desc.camera = pt_camera_look_at(pt_v3(0, 0, 8), pt_v3(0, 0, 0), pt_v3(0, 1, 0), 15);
    desc.width = 240;
    desc.height = 120;
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
    double n = fmax(16384, (argc > 1 ? strtod(argv[1], NULL) : 262144) / (getenv("SHORT") ? 16 : 1));
    double a = 5 * PT_PI / 180, exact = rho * (1 - pow(cos(a), exponent + 2)), merl, slides;
    setting s = {cos(a), PT_PI * sin(a) * sin(a), {0}};
    pt_measured table = PT_MEASURED_INIT;
    pt_material material = pt_material_measured(&table);
    pt_hit hit = {.ng = {0, 0, 1}, .ns = {0, 0, 1}};
    int bad[4] = {0};
    if (pt_measured_fill(&table, lobe, NULL) != PT_OK) return 1;
    s.table = pt_bsdf_make(&material, &hit);
    printf("%-14s %9s %12s %12s %10s %8s\n", "beam, sensor", "samples", "estimate", "exact", "std.error", "seconds");
    check(row("my sensor", my_sensor, &s, exact / s.cone, (uint32_t)n), "mine measures the exact mean");
    check(row("its, of table", its_sensor, &s, exact / s.cone, (uint32_t)n), "so does the header's, of its table");
    printf("%-14s %9s %12s %35s\n", "cells", "pairs", "rms error", "seconds");
    merl = cells("MERL", EX == 2 ? SLIDES : MERL, (uint32_t)n, bad);
    slides = cells("the slides'", SLIDES, (uint32_t)n, bad + 2);
    check(bad[0] + bad[2] == 0, "cells are found back from their middles");
    check(bad[1] == 0, "my MERL index is the header's: theta_h by its root, theta_d, phi_d");
    check(merl < 0.75 * slides, "MERL's angles hold the lobe better");
    printf("What to see: of two tables of one size, that whose angles follow the highlight holds it better.\n");
    picture(argc > 2 ? argv[2] : "23_measuring", material);
    pt_measured_free(&table);
    printf("lesson 23: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: exponent 1000, not 100 (-DEX=1). Which error grows more? Answer: 0.046 to 0.144; MERL's 0.030 to 0.049.
   (2) Break: the slides' angles as index (-DEX=2), theta_h instead of its root (-DEX=3). Cells are still found back
       from their middles: a table that is consistent with itself can still be no MERL table.
   (3) Extend: measure a diffuse sample of albedo 0.5 with pt_measured_scatter, which is handed a scatter() and knows
       no f: 1e6 samples, blocks of 30^3 cells. Answer: 0.159 (0.5/pi) in all blocks to a few percent, but for two at
       grazing angles, which few rays reach: 0.08 and 0.21. */
