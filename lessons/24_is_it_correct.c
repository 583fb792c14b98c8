/* Lesson 24: is it correct? The Cornell box, spectra, and a photograph

   QUESTION   "Is path tracing correct? Yes, almost 100 %." How would we know?
   IDEA       An image that looks right proves nothing. Compare numbers with error bars with somebody else's, as near
              to ground truth as one gets: the radiance at twelve points of the Cornell box, found by another program
              by other methods. Two unbiased estimates differ by more than 5 standard errors sqrt(se1^2 + se2^2) once
              in two million times.
              Three bands R, G, B are an approximation themselves. Light is a spectrum, each wavelength l has its own
              rendering equation, and the eye comes last, with its color matching functions: Y = int ybar(l) L(l) dl /
              int ybar(l) dl. A renderer of three bands solves it for three wavelengths at a time, if walls and lamp
              have the values there instead of colours. The RGB of a product of spectra is not the product of their
              RGB; at the red wall it shows.
              A photograph differs still: reflectances were measured on other samples, the lamp is no uniform
              Lambertian square, the room around is not black, lens and film scatter, vignette and have a response
              curve, and no screen shows a lamp a hundred times as bright as the wall beside it.
   PICTURE    Left three bands by the header, with white dots at the probes; right spectra.
   BUILD      cc -O2 -I.. 24_is_it_correct.c -o 24_is_it_correct -lm -pthread
   RUN        ./24_is_it_correct [samples] [output]
   PRINTS     its G at 4         16384    0.0101499      0.01007    6.4e-05    0.034
               my Y at 4         16384    0.0429134     0.042913    0.00021    0.037
   WORDS      Cornell box 康奈尔盒; ground truth 真值; spectrum 光谱; wavelength 波长; unbiased 无偏; color matching function 颜色匹配函数
   HEADER     [PT-05] pt_cie_xyz, pt_xyz_to_rgb, [PT-11] pt_li_path, [PT-19] pt_scene_cornell, pt_cornell_spectrum
   SOURCES    [Kaj86]; the box and its data: Cornell University, Program of Computer Graphics; "exact": tests/data/
              cornell_reference.csv, brute force in double precision, 2e7 paths a point; RGB are bands, Y is spectral
   Before: lesson 23, measuring a BRDF. Next: lesson 25, the full path tracer. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { PROBES = 12, SETS = 25, MISTAKE = EX >= 2 };

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

/* Image points (u to the right, v upwards, from the middle), and what was found there, each with its error. */
static const struct {
    double u, v, rgb[3], se[3], y, se_y;
} probe[PROBES] = {
    {0, 0, {0.114351, 0.065645, 0.014398}, {0.000029, 0.000015, 0.000004}, 0.072322, 0.000017},
    {-0.3, -0.35, {0.048779, 0.009062, 0.002145}, {0.000019, 0.000007, 0.000002}, 0.015910, 0.000009},
    {0, -0.46, {0.135882, 0.065417, 0.016189}, {0.000024, 0.000011, 0.000003}, 0.076445, 0.000013},
    {0.32, -0.2, {0.019192, 0.061829, 0.003084}, {0.000002, 0.000008, 0.000001}, 0.049394, 0.000006},
    {-0.4, 0.1, {0.191562, 0.010070, 0.002523}, {0.000020, 0.000001, 0.000001}, 0.042913, 0.000004},
    {0.42, 0.1, {0.024437, 0.070908, 0.003791}, {0.000003, 0.000008, 0.000001}, 0.057773, 0.000006},
    {0, 0.3, {0.168539, 0.087023, 0.019327}, {0.000046, 0.000023, 0.000006}, 0.098986, 0.000026},
    {0, 0.47, {0.063440, 0.031749, 0.006494}, {0.000029, 0.000015, 0.000004}, 0.036351, 0.000017},
    {-0.16, -0.02, {0.079263, 0.039217, 0.008893}, {0.000022, 0.000011, 0.000003}, 0.045269, 0.000012},
    {0.2, -0.25, {0.008135, 0.002972, 0.000677}, {0.000008, 0.000003, 0.000001}, 0.003820, 0.000004},
    {-0.05, -0.28, {0.104306, 0.048982, 0.011898}, {0.000017, 0.000009, 0.000002}, 0.057678, 0.000010},
    {0.42, -0.42, {0.130346, 0.082295, 0.017365}, {0.000013, 0.000007, 0.000002}, 0.087963, 0.000008}};

/* ---- the new piece: two results compared, and spectra -------------------------------------------------- */

/* How many standard errors of both lie between them. The reference is rounded to 6 digits behind the point. */
static double my_deviation(const pt_stats *s, double reference, double se)
{
    double e = pt_stats_standard_error(s), rounding = 0.5e-6;
    return fabs(s->mean - reference) / sqrt(e * e + se * se + rounding * rounding);
}

/* The wavelengths of a set, one from each third of 400 to 700 nm. */
static double my_wavelength(int set, int k) { return 400 + 100 * k + 100 * (set + 0.5) / SETS; }

/* The values of a spectrum at the wavelengths of a set. */
static pt_rgb my_values(const char *name, int set)
{
    pt_spectrum s = pt_cornell_spectrum(name);
    double v[3];
    for (int k = 0; k < 3; k++) v[k] = pt_spectrum_at(&s, my_wavelength(set, k));
    return pt_rgb3((pt_real)v[0], (pt_real)v[1], (pt_real)v[2]);
}

/* The Cornell box with walls and lamp as they are at the wavelengths of a set; a wall is known by its RGB. */
static int my_box(pt_scene *scene, pt_camera *camera, int set)
{
    static const char *const wall[3] = {"white", "green", "red"};
    if (pt_scene_cornell(scene, camera) != PT_OK) return 0;
    for (uint32_t i = 0; i < scene->material_count; i++) {
        pt_material *m = &scene->materials[i];
        const pt_real red = m->albedo.r;
        for (int k = 0; k < 3 && set < SETS; k++)
            if (red == pt_cornell_rgb(wall[k]).r) m->albedo = my_values(wall[k], set);
        if (m->emission.r > 0 && EX == 1) m->albedo = pt_rgb_grey(0);
        if (m->emission.r > 0 && set < SETS) m->emission = my_values("lamp", set);
    }
    return pt_commit(scene) == PT_OK;
}

/* The colour that the eye sees of radiance at the wavelengths of a set: X, Y, Z, as RGB. */
static pt_rgbd my_eye(pt_rgbd radiance, int set)
{
    double l[3] = {radiance.r, radiance.g, radiance.b}, bar[3], xyz[3] = {0, 0, 0}, ybar = 106.857; /* its integral */
    for (int k = 0; k < 3; k++) {
        pt_cie_xyz(my_wavelength(set, k), bar);
        for (int c = 0; c < 3; c++) xyz[c] += bar[c] * l[k] * 100 / ybar; /* each stands for 100 nm */
    }
    return pt_xyz_to_rgb(xyz);
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

static pt_rgbd radiance(const pt_scene *scene, const pt_ray *ray, pt_sampler *random)
{
    pt_li_options options = {0};
    pt_li_info info = {0};
    options.max_edges = EX == 3 ? 4 : 0; /* light bounces on */
    pt_rgbd c = pt_li_path(scene, ray, random, &options, &info);
    pt_rgbd hit = EX == 2 ? pt_li_path_plain(scene, ray, random, &options, &info) : pt_rgbd3(0, 0, 0); /* twice */
    return pt_rgbd3(c.r + hit.r, c.g + hit.g, c.b + hit.b);
}

/* Prints a row; the deviation from the reference. */
static double row(const char *what, int k, const pt_stats *s, double exact, double se, double seconds)
{
    double error = pt_stats_standard_error(s);
    printf("%s at %-5d %9.0f %12.6g %12.6g %10.2g %8.3f\n", what, k, s->n, s->mean, exact, error, seconds);
    return my_deviation(s, exact, se);
}

/* n paths for each probe: the header's three bands in box[SETS], and Y of paths in the box of a random set. */
static void table(const pt_scene *box, const pt_camera *camera, uint32_t n)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 24, n);
    double bands = 0, spectral = 0, most = 0;
    for (int k = 0; k < PROBES; k++) {
        pt_real x = (pt_real)(0.5 + probe[k].u), y = (pt_real)(0.5 - probe[k].v);
        pt_ray ray = pt_camera_ray(camera, 1, x, y, pt_v2(0, 0));
        pt_stats s[4];
        double start = pt_cpu_seconds(), seconds;
        memset(s, 0, sizeof s);
        for (uint32_t i = 0; i < n; i++) {
            pt_sampler_start(&random, (uint64_t)k, i);
            pt_rgbd c = radiance(&box[SETS], &ray, &random);
            double band[3] = {c.r, c.g, c.b};
            for (int b = 0; b < 3; b++) pt_stats_add(&s[b], band[b]);
        }
        seconds = pt_cpu_seconds();
        for (uint32_t i = 0; i < n; i++) {
            pt_sampler_start(&random, (uint64_t)k + PROBES, i);
            int set = (int)(pt_sampler_1d(&random) * SETS);
            pt_rgbd c = radiance(&box[EX == 4 ? SETS : set], &ray, &random), seen = EX == 4 ? c : my_eye(c, set);
            pt_stats_add(&s[3], pt_luminance(seen.r, seen.g, seen.b)); /* luminance is Y; 4: of three bands */
        }
        bands = fmax(bands, row("its G", k, &s[1], probe[k].rgb[1], probe[k].se[1], seconds - start));
        spectral = fmax(spectral, row(" my Y", k, &s[3], probe[k].y, probe[k].se_y, pt_cpu_seconds() - seconds));
        for (int b = 0; b < 3; b++) bands = fmax(bands, my_deviation(&s[b], probe[k].rgb[b], probe[k].se[b]));
        most = fmax(most, pt_luminance(probe[k].rgb[0], probe[k].rgb[1], probe[k].rgb[2]) / probe[k].y - 1);
    }
    printf("What to see: all agree; but Y of three bands would be %.0f %% too bright at the red wall.\n", 100 * most);
    check(bands < 5, "three bands at twelve probes: within 5 standard errors of the reference");
    check(spectral < 5, "Y of spectra: within 5 standard errors");
}

static void picture(const pt_scene *box, const pt_camera *camera, const char *output)
{
    enum { W = 128 };
    pt_film film = PT_FILM_INIT, one = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    char path[512];
    if (pt_film_make(&film, 2 * W, W, 0) != PT_OK) return;
    film.samples[0] = 1;
    desc.camera = *camera;
    desc.width = desc.height = W;
    for (int set = 0; set <= SETS; set++) {
        desc.spp = set < SETS ? 1 : 16;
        desc.seed = (uint64_t)set;
        if (pt_render(&box[set], &desc, &one, NULL) != PT_OK) return;
        for (int i = 0; i < W * W; i++) {
            double *to = film.half[0] + 3 * (i / W * 2 * W + i % W + (set < SETS ? W : 0));
            pt_rgbd c = pt_film_pixel(&one, i % W, i / W), seen = set < SETS ? my_eye(c, set) : c;
            to[0] += seen.r / (set < SETS ? SETS : 1);
            to[1] += seen.g / (set < SETS ? SETS : 1);
            to[2] += seen.b / (set < SETS ? SETS : 1);
        }
        pt_film_free(&one);
    }
    for (int k = 0; k < 3 * PROBES; k++) { /* white dots */
        int x = (int)((0.5 + probe[k / 3].u) * W), y = (int)((0.5 - probe[k / 3].v) * W);
        film.half[0][3 * (y * 2 * W + x) + k % 3] = 1;
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1.5);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1.5) == PT_OK, path);
    pt_film_free(&film);
}

int main(int argc, char **argv)
{
    static pt_scene box[SETS + 1]; /* one for each set of wavelengths; the last one has three bands */
    double n = fmax(1024, (argc > 1 ? strtod(argv[1], NULL) : 16384) / (getenv("SHORT") && !MISTAKE ? 16 : 1));
    pt_camera camera;
    for (int set = 0; set <= SETS; set++)
        if (!my_box(&box[set], &camera, set)) return 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "probe", "samples", "estimate", "exact", "std.error", "seconds");
    table(box, &camera, (uint32_t)n);
    picture(box, &camera, argc > 2 ? argv[2] : "24_is_it_correct");
    for (int set = 0; set <= SETS; set++) pt_scene_free(&box[set]);
    printf("lesson 24: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: the lamp has albedo 0 instead of 0.78 (-DEX=1). Does a probe notice? Answer: not with 16384 paths each.
       With 200000 four greens are off by more than 5: an agreement says no more than what it could have seen.
   (2) Break: light counted twice, by hitting the lamp and by asking it (-DEX=2); two bounces only (-DEX=3); Y of
       three bands (-DEX=4). Which makes the picture brighter? Answer: the first; brighter is not more right.
   (3) Extend: use one wavelength a path instead of three. The same mean Y, but which standard error? Answer: 0.0011 at
       probe 0, the root of 3 times 0.00063. And the picture has colour noise, as each path has a colour of its own. */
