/* Lesson 23: Measuring a BRDF: gonioreflectometer and MERL table

   QUESTION  How does the BRDF of a real thing get into a renderer, and what is in such a table?
   IDEA      A gonioreflectometer sends a thin beam along wo and counts what arrives in a sensor at wi. If
             it covers the directions S, it measures the mean of f there:

                 f = (fraction of the light that arrives) / int_S cos dw,   a cone of half angle a: pi sin^2 a

             An isotropic BRDF has 3 angles: 90 x 90 x 180 = 1,458,000 cells for each colour. Which angles?
             A highlight is where the half vector h = (wo + wi)/|wo + wi| is near the normal: take theta_h and
             the angles theta_d, phi_d of wi seen from h (Rusinkiewicz). Cells are even in sqrt(theta_h), so
             fine in the highlight. Reciprocity: swapping wo and wi adds 180 degrees to phi_d, 180 cells do.
   SLIDES    They store (theta_i, theta_o, |phi_i - phi_o|), as the angles are measured. The MERL files hold
             (theta_h, theta_d, phi_d). The program compares both, cell for cell.
   EXACT     A Phong lobe f = rho (n+2)/(2 pi) cos^n from above: the cone gets rho (1 - cos^(n+2) a).
   BUILD     cc -O2 -I.. 23_measuring.c -o 23_measuring -lm -pthread
   RUN       ./23_measuring [samples] [output]     (uses 70 MB; writes and removes a file of 35 MB)
   PRINTS
             cells              pairs    rms error                             seconds
             MERL              262144        0.030                               0.102
             theta_h linear    262144        0.069                               0.101
             the slides'       262144        0.046                               0.115
   WORDS     gonioreflectometer 角反射仪(测角反射计), BRDF 双向反射分布函数, isotropic 各向同性,
             reciprocity 互易性, tabular 表格化, half vector 半程向量
   HEADER    [PT-08] pt_measured_index, pt_measured_directions, pt_measured_fill, pt_measured_scatter,
             pt_material_measured, [PT-17] pt_measured_write, pt_measured_read
   SOURCES   [Mat03] the database, [Rus98] the angles
   Before: lesson 22. Next: lesson 24. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0
#endif
#define MISTAKE (EX >= 2)
#define EXPONENT (EX == 1 ? 1000.0 : 100.0)
#define ALBEDO 0.6

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

static pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }

/* --- mine: the cell of a pair of directions, z is the normal --- */

enum { MERL, LINEAR, SLIDES }; /* sqrt(theta_h) or theta_h, ...; theta_i, theta_o, |phi_i - phi_o| */

static int bin(double x, int count) { return x < 0 ? 0 : x >= 1 ? count - 1 : (int)(x * count); }

/* The three angles of a pair, each mapped to [0,1]. */
static void my_angles(pt_vec3 wo, pt_vec3 wi, int kind, double angle[3])
{
    double hx = (double)wo.x + (double)wi.x, hy = (double)wo.y + (double)wi.y;
    double hz = (double)wo.z + (double)wi.z;
    double across = hypot(hx, hy), l = hypot(across, hz), s = across / l, c = hz / l, x, y, z;
    double cp = across > 0 ? hx / across : 1, sp = across > 0 ? hy / across : 0;
    x = cp * (double)wi.x + sp * (double)wi.y; /* turn h over the x axis, ... */
    y = cp * (double)wi.y - sp * (double)wi.x;
    z = s * x + c * (double)wi.z;              /* ... then onto the z axis */
    x = c * x - s * (double)wi.z;
    angle[0] = atan2(s, c) / (PT_PI / 2);
    angle[1] = atan2(hypot(x, y), z) / (PT_PI / 2);
    angle[2] = atan2(y, x) / PT_PI;
    if (angle[2] < 0) angle[2] += 1; /* reciprocity */
    if (kind == MERL) angle[0] = sqrt(angle[0]);
    if (kind != SLIDES) return;
    angle[0] = acos(fmin(1, (double)wi.z)) / (PT_PI / 2);
    angle[1] = acos(fmin(1, (double)wo.z)) / (PT_PI / 2);
    x = (double)wi.x * (double)wo.x + (double)wi.y * (double)wo.y;
    y = (double)wi.x * (double)wo.y - (double)wi.y * (double)wo.x;
    angle[2] = fabs(atan2(y, x)) / PT_PI;
}

static int my_index(pt_vec3 wo, pt_vec3 wi, int kind)
{
    double a[3];
    my_angles(wo, wi, kind, a);
    return (bin(a[0], 90) * 90 + bin(a[1], 90)) * 180 + bin(a[2], 180);
}

/* The pair of directions in the middle of a cell; they may be below the surface. */
static void my_directions(int index, int kind, pt_vec3 *wo, pt_vec3 *wi)
{
    double a = (index / (90 * 180) + 0.5) / 90, d = (index / 180 % 90 + 0.5) / 90 * (PT_PI / 2);
    double phi = (index % 180 + 0.5) / 180 * PT_PI, h = (kind == MERL ? a * a : a) * (PT_PI / 2), x, z;
    if (kind == SLIDES) {
        *wi = v3(sin(h) * cos(phi), sin(h) * sin(phi), cos(h));
        *wo = v3(sin(d), 0, cos(d));
        return;
    }
    x = sin(d) * cos(phi);
    z = cos(d);
    *wi = v3(cos(h) * x + sin(h) * z, sin(d) * sin(phi), cos(h) * z - sin(h) * x);
    *wo = v3(-cos(h) * x + sin(h) * z, -sin(d) * sin(phi), cos(h) * z + sin(h) * x);
}

/* --- the sample on the turntable: a Phong lobe --- */

static double lobe(pt_vec3 wo, pt_vec3 wi)
{
    double c = (double)(wo.z * wi.z - wo.x * wi.x - wo.y * wi.y);
    return c > 0 ? ALBEDO * (EXPONENT + 2) / (2 * PT_PI) * pow(c, EXPONENT) : 0;
}

static pt_rgb phong(void *user, pt_vec3 wo, pt_vec3 wi)
{
    (void)user;
    return pt_rgb_grey((pt_real)lobe(wo, wi));
}

static int scatter(void *user, pt_vec3 wo, pt_pcg32 *rng, pt_vec3 *wi, pt_rgb *weight)
{
    double c = pow(pt_pcg32_double(rng), 1 / (EXPONENT + 1)), phi = 2 * PT_PI * pt_pcg32_double(rng);
    double s = sqrt(1 - c * c);
    pt_frame frame = pt_frame_from_normal(pt_v3(-wo.x, -wo.y, wo.z));
    (void)user;
    *wi = pt_frame_to_world(&frame, v3(s * cos(phi), s * sin(phi), c));
    *weight = pt_rgb_grey((pt_real)(ALBEDO * (EXPONENT + 2) / (EXPONENT + 1)) * wi->z); /* f cos / pdf */
    return wi->z > 0;
}

/* Beam from above, sensor of 5 degrees above: mine scatters at the sample, the header's at its table. */
static int goniometer(const pt_material *table, int mine, int n)
{
    double a = 5 * PT_PI / 180, cone = PT_PI * sin(a) * sin(a), start = pt_cpu_seconds();
    double exact = ALBEDO * (1 - pow(cos(a), EXPONENT + 2)) / cone;
    pt_pcg32 rng = pt_pcg32_make(23, 0);
    pt_stats s = PT_STATS_INIT;
    pt_bsdf bsdf;
    pt_hit hit;
    int i;
    memset(&hit, 0, sizeof hit);
    hit.ng = hit.ns = pt_v3(0, 0, 1);
    bsdf = pt_bsdf_make(table, &hit);
    for (i = 0; i < n; i++) {
        pt_vec3 wo = pt_v3(0, 0, 1);
        pt_bsdf_sample_result out;
        int lit;
        if (mine) lit = scatter(NULL, wo, &rng, &out.wi, &out.weight);
        else {
            double u = pt_pcg32_double(&rng), v = pt_pcg32_double(&rng), lo = pt_pcg32_double(&rng);
            lit = pt_bsdf_sample(&bsdf, wo, lo, pt_v2((pt_real)u, (pt_real)v), PT_RADIANCE, &out);
        }
        pt_stats_add(&s, lit && (double)out.wi.z > cos(a) ? (double)out.weight.g / cone : 0);
    }
    row(mine ? "my sensor" : "header, table", &s, exact, pt_cpu_seconds() - start);
    return fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s);
}

/* How well cells hold the lobe: root mean square of f(middle of the cell) - f over that of f, at pairs that
   the lobe scatters. */
static double cells(const char *name, int kind, int n)
{
    pt_pcg32 rng = pt_pcg32_make(24, 0);
    double wrong = 0, all = 0, start = pt_cpu_seconds();
    int i;
    for (i = 0; i < n; i++) {
        double u = pt_pcg32_double(&rng), v = pt_pcg32_double(&rng), f, d;
        pt_vec3 wo = pt_warp_cosine(pt_v2((pt_real)u, (pt_real)v)), wi, co, ci;
        pt_rgb w;
        if (!scatter(NULL, wo, &rng, &wi, &w)) continue;
        my_directions(my_index(wo, wi, kind), kind, &co, &ci);
        f = lobe(wo, wi);
        d = co.z > 0 && ci.z > 0 ? lobe(co, ci) - f : -f;
        wrong += d * d;
        all += f * f;
    }
    printf("%-14s %9d %12.3f %35.3f\n", name, n, sqrt(wrong / all), pt_cpu_seconds() - start);
    return sqrt(wrong / all);
}

/* Cells are found back from their middles, and the header's index is mine at random pairs. */
static void indices(int n)
{
    int kind = EX == 2 ? SLIDES : EX == 3 ? LINEAR : MERL, i, lost = 0, differ = 0; /* 2, 3: WRONG angles */
    pt_pcg32 rng = pt_pcg32_make(25, 0);
    for (i = 0; i < PT_MEASURED_CELLS; i += 11) {
        pt_vec3 wo, wi;
        my_directions(i, kind, &wo, &wi);
        lost += wo.z > 0 && wi.z > 0 && my_index(wo, wi, kind) != i;
    }
    for (i = 0; i < n; i++) {
        double u[4];
        pt_vec3 wo, wi;
        int k;
        for (k = 0; k < 4; k++) u[k] = pt_pcg32_double(&rng);
        wo = pt_warp_cosine(pt_v2((pt_real)u[0], (pt_real)u[1]));
        wi = pt_warp_cosine(pt_v2((pt_real)u[2], (pt_real)u[3]));
        differ += pt_measured_index(wo, wi) != my_index(wo, wi, kind);
    }
    check(lost == 0, "cells are found back from their middles");
    check(differ == 0, "my index is that of the header (theta_h by its root, theta_d, phi_d)");
}

/* The table goes to a file in the MERL format, comes back, and is the same to the last bit. */
static int round_trip(const char *output, const pt_measured *table)
{
    pt_measured back = PT_MEASURED_INIT;
    char path[512];
    int ok;
    snprintf(path, sizeof path, "%s.binary", output);
    ok = pt_measured_write(path, table) == PT_OK && pt_measured_read(path, &back) == PT_OK &&
         memcmp(back.value, table->value, 3 * PT_MEASURED_CELLS * sizeof *back.value) == 0;
    remove(path);
    pt_measured_free(&back);
    return ok;
}

/* A sphere: the left half of the Phong lobe itself, the right half of its table. */
static int picture(const char *output, pt_material table)
{
    enum { W = 240, H = 180 };
    static unsigned char image[3 * W * H];
    double half[2] = {0, 0};
    char path[512];
    int k, x, ok = 1;
    for (k = 0; k < 2; k++) {
        pt_scene s = PT_SCENE_INIT;
        pt_film film = PT_FILM_INIT;
        pt_render_desc desc = pt_render_defaults();
        pt_rgb grey = pt_rgb_grey((pt_real)ALBEDO);
        pt_material lobes = pt_material_phong(pt_rgb_grey(0), grey, (pt_real)EXPONENT);
        pt_add_sphere(&s, pt_v3(0, 0, 0), 1, pt_add_material(&s, k ? table : lobes));
        pt_add_sphere(&s, pt_v3(0, 3, 4), 1, pt_add_material(&s, pt_material_emitter(pt_rgb_grey(3))));
        pt_set_environment(&s, pt_rgb_grey((pt_real)0.3));
        desc.camera = pt_camera_look_at(pt_v3(0, 0, 6), pt_v3(0, 0, 0), pt_v3(0, 1, 0), 25);
        desc.width = W;
        desc.height = H;
        desc.spp = k ? 64 : 16; /* the header draws table directions less well */
        desc.li.max_edges = 2;
        ok = ok && pt_commit(&s) == PT_OK && pt_render(&s, &desc, &film, NULL) == PT_OK;
        for (x = 0; ok && x < W * H; x++)
            if ((x % W >= W / 2) == k) {
                double g = pt_film_pixel(&film, x % W, x / W).g;
                half[k] += g;
                memset(image + 3 * x, pt_srgb_byte(g), 3);
            }
        pt_film_free(&film);
        pt_scene_free(&s);
    }
    check(fabs(half[1] / half[0] - 1) < 0.01, "both halves of the picture have the same mean, to 1 %");
    snprintf(path, sizeof path, "%s.ppm", output);
    ok = ok && pt_write_ppm_bytes(path, image, W, H) == PT_OK;
    snprintf(path, sizeof path, "%s.png", output);
    return ok && pt_write_png_bytes(path, image, W, H) == PT_OK;
}

int main(int argc, char **argv)
{
    int n = argc > 1 && atoi(argv[1]) > 0 ? atoi(argv[1]) : 1 << 18, i, ok = 1;
    const char *output = argc > 2 ? argv[2] : "23_measuring";
    pt_measured table = PT_MEASURED_INIT;
    pt_material material = pt_material_measured(&table);
    double error[3];
    if (getenv("SHORT")) n /= 16;
    indices(n);
    if (pt_measured_fill(&table, phong, NULL) != PT_OK) return 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "beam, sensor", "samples", "estimate", "exact", "std error",
           "seconds");
    for (i = n / 256; i <= n; i *= 16) ok = goniometer(&material, 1, i) && ok;
    for (i = n / 256; i <= n; i *= 16) ok = goniometer(&material, 0, i) && ok;
    check(ok, "sensors within 5 standard errors of the exact mean");
    printf("%-14s %9s %12s %35s\n", "cells", "pairs", "rms error", "seconds");
    error[0] = cells("MERL", MERL, n);
    error[1] = cells("theta_h linear", LINEAR, n);
    error[2] = cells("the slides'", SLIDES, n);
    printf("See: of three tables of one size, that whose angles follow the highlight holds it best.\n");
    check(error[0] < error[1] && error[0] < error[2], "MERL's angles hold the lobe best");
    check(round_trip(output, &table), "file in the MERL format: the same bits back");
    check(picture(output, material), "picture written");
    pt_measured_free(&table);
    printf("lesson 23: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("the mistake of exercise %d was %s\n", EX, failed ? "noticed" : "NOT noticed");
    return !failed;
}

/* EXERCISES (cc -DEX=1 ... compiles the first one, and so on)
   1. Predict and run, -DEX=1: exponent 1000 instead of 100. Which of the three errors grows most? (theta_h
      linear: .069 to .207; the slides' .046 to .144, MERL's .030 to .049.)
   2. Break it, and watch which check fails. -DEX=2: the slides' angles as index. -DEX=3: theta_h linear.
      Cells are still found back from their middles: a table that is consistent with itself can still be no
      MERL table.
   3. Extend it: measure with pt_measured_scatter, which is handed scatter() and knows no f. 1e6 samples in
      blocks of 30^3 cells of a diffuse sample of albedo .5 give .159 (.5/pi) in each block, to about 1 %. */
