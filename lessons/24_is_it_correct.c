/* Lesson 24: Is it correct? The Cornell box, spectra, and a photograph

   QUESTION  "Is path tracing correct? Yes, almost 100 %." How would we know?
   IDEA      An image that looks right proves nothing. Compare numbers with error bars with somebody else's:
             the radiance at twelve points of the Cornell box, found by another program by other methods. Two
             unbiased estimates differ by more than 5 standard errors sqrt(se1^2 + se2^2) once in two million
             times; a bug differs always. "Higher brightness often means higher accuracy" is true of cutting
             bounces off only: light counted twice is brighter too.

             Three bands R, G, B are an approximation themselves. Light is a spectrum, each wavelength has its
             own rendering equation, and the eye comes last: Y = int ybar(l) L(l) dl / int ybar(l) dl. The RGB
             of a product of spectra is not the product of their RGB; at the red wall it shows. Here a path
             carries three wavelengths, one from each third of 400 to 700 nm.
   REFERENCE tests/data/cornell_reference.csv: brute force in double precision, 2e7 paths a point; RGB are
             bands, Y is spectral, se is the standard error of each.
   PHOTO     A photograph differs still: reflectances were measured on other samples, the lamp is no uniform
             Lambertian square, the room around is not black, lens and film scatter, vignette and have a
             response curve, and no screen shows a lamp a hundred times as bright as the wall beside it.
   BUILD     cc -O2 -I.. 24_is_it_correct.c -o 24_is_it_correct -lm -pthread
   RUN       ./24_is_it_correct [samples] [output]
   PRINTS    probe    G, ref.       mine     header    Y, ref.       mine Y of RGB  seconds
             0        0.06564    0.06571    0.06532    0.07232    0.07202    -0.0%    0.115
             4        0.01007    0.01010    0.01015    0.04291    0.04244   +12.1%    0.095
   WORDS     Cornell box 康奈尔盒, ground truth 真值(参考图), spectrum 光谱, wavelength 波长, unbiased 无偏,
             color matching function 颜色匹配函数
   HEADER    [PT-05] pt_cie_xyz, pt_xyz_to_rgb, [PT-11] pt_li_path, [PT-19] pt_scene_cornell,
             pt_cornell_spectrum
   SOURCES   [Kaj86]; the box and its data: Cornell University, Program of Computer Graphics
   Before: lesson 23. Next: lesson 25. */

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

/* The points as image points (u to the right, v upwards, from the middle), and what was found there. */
enum { PROBES = 12 };
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

/* --- mine: a path tracer for diffuse surfaces, of three bands or of three wavelengths --- */

typedef struct my_colours {
    pt_rgb albedo[4], lamp; /* of the box's materials: white, green, red, lamp; and the lamp's radiance */
} my_colours;

static void add(pt_rgbd *sum, pt_rgbd beta, pt_rgb c, double k)
{
    sum->r += beta.r * (double)c.r * k;
    sum->g += beta.g * (double)c.g * k;
    sum->b += beta.b * (double)c.b * k;
}

static pt_rgbd my_path(const pt_scene *scene, pt_ray ray, const my_colours *colours, pt_pcg32 *rng)
{
    pt_rgbd sum = {0, 0, 0}, beta = {1, 1, 1}, next;
    int edges, k;
    for (edges = 1;; edges++) {
        pt_vec3 wo = pt_v3_neg(pt_v3_normalize(ray.d)), w;
        pt_light_sample_result ls;
        pt_frame frame;
        pt_rgb albedo;
        pt_hit hit;
        double u[6], pmf, q;
        int light;
        for (k = 0; k < 6; k++) u[k] = pt_pcg32_double(rng);
        if (!pt_intersect(scene, &ray, &hit)) return sum;
        albedo = colours->albedo[hit.material];
        if (hit.light >= 0 && (edges == 1 || EX == 2) && pt_v3_dot(hit.ng, wo) > 0) /* 2: WRONG, twice */
            add(&sum, beta, colours->lamp, 1);
        if (EX == 4 && edges == 3) return sum; /* WRONG: light bounces on */
        if (pt_v3_dot(hit.ng, wo) < 0) hit.ng = pt_v3_neg(hit.ng); /* to the side we came from */

        light = pt_light_choose(scene, u[0], &pmf);
        if (pt_light_sample(scene, light, hit.p, pt_v2((pt_real)u[1], (pt_real)u[2]), &ls)) {
            double cosine = (double)pt_v3_dot(hit.ng, ls.wi);
            pt_ray shadow = pt_spawn_ray_to(hit.p, hit.p_error, hit.ng, ls.p, ls.p_error, ls.n);
            if (cosine > 0 && !pt_occluded(scene, &shadow))
                add(&sum, beta, pt_rgb_mul(albedo, colours->lamp), cosine / (PT_PI * pmf * ls.pdf_w));
        }

        next = pt_rgbd3(0, 0, 0); /* cosine-weighted: f cos / pdf = albedo */
        add(&next, beta, albedo, 1);
        q = fmax(next.r, fmax(next.g, next.b)) / fmax(beta.r, fmax(beta.g, beta.b)); /* < 1: largest albedo */
        if (edges < 2) q = 1;
        if (u[5] >= q) return sum;
        if (EX == 3) q = 1; /* WRONG: the survivors must carry the light of the dead */
        beta = pt_rgbd3(next.r / q, next.g / q, next.b / q);
        frame = pt_frame_from_normal(hit.ng);
        w = pt_warp_cosine(pt_v2((pt_real)u[3], (pt_real)u[4]));
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, pt_frame_to_world(&frame, w));
    }
}

static my_colours bands(const pt_scene *scene)
{
    my_colours c;
    int k;
    for (k = 0; k < 4; k++) c.albedo[k] = scene->materials[k].albedo;
    c.lamp = scene->materials[3].emission;
    return c;
}

static pt_rgb at(const pt_spectrum *s, const double nm[3])
{
    return pt_rgb3((pt_real)pt_spectrum_at(s, nm[0]), (pt_real)pt_spectrum_at(s, nm[1]),
                   (pt_real)pt_spectrum_at(s, nm[2]));
}

/* The colours at three wavelengths, one from each third of 400..700 nm: density 1/100 each. */
static my_colours wavelengths(double u, double nm[3])
{
    static const char *const wall[3] = {"white", "green", "red"};
    my_colours c;
    pt_spectrum s;
    int k;
    for (k = 0; k < 3; k++) nm[k] = 400 + 100 * (k + u);
    for (k = 0; k < 3; k++) {
        s = pt_cornell_spectrum(wall[k]);
        c.albedo[k] = at(&s, nm);
    }
    s = pt_cornell_spectrum("lamp");
    c.albedo[3] = pt_rgb_grey((pt_real)0.78);
    c.lamp = at(&s, nm);
    return c;
}

/* One spectral value: the eye's X, Y, Z of a path. */
static void my_xyz(const pt_scene *scene, pt_ray ray, pt_pcg32 *rng, double xyz[3])
{
    double nm[3], eye[3], ybar = 106.857; /* int ybar dl in nm, of the CIE's table */
    my_colours c = wavelengths(pt_pcg32_double(rng), nm);
    pt_rgbd L = my_path(scene, ray, &c, rng);
    int k, l;
    xyz[0] = xyz[1] = xyz[2] = 0;
    for (k = 0; k < 3; k++) {
        pt_cie_xyz(nm[k], eye);
        for (l = 0; l < 3; l++) xyz[l] += eye[l] * (k == 0 ? L.r : k == 1 ? L.g : L.b) * 100 / ybar;
    }
}

/* --- the probes --- */

enum { MINE, HEADER, SPECTRAL };

/* n values of a probe; s: the bands, or X, Y, Z. */
static void measure(const pt_scene *scene, pt_ray ray, int how, int n, uint64_t stream, pt_stats s[3])
{
    pt_pcg32 rng = pt_pcg32_make(24, stream);
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 24, 0);
    pt_li_options options = {0};
    pt_li_info info = {0};
    my_colours rgb = bands(scene);
    int i, k;
    if (EX == 1) rgb.albedo[3] = pt_rgb_grey(0);
    memset(s, 0, 3 * sizeof *s);
    for (i = 0; i < n; i++) {
        double v[3];
        if (how == SPECTRAL) my_xyz(scene, ray, &rng, v);
        else {
            pt_rgbd c;
            pt_sampler_start(&sampler, stream, (uint32_t)i);
            if (how == MINE) c = my_path(scene, ray, &rgb, &rng);
            else c = pt_li_path(scene, &ray, &sampler, &options, &info);
            v[0] = c.r;
            v[1] = c.g;
            v[2] = c.b;
        }
        for (k = 0; k < 3; k++) pt_stats_add(&s[k], v[k]);
    }
}

/* The reference is rounded to 6 digits behind the point. */
static double deviation(const pt_stats *s, double exact, double se)
{
    double e = pt_stats_standard_error(s);
    return fabs(s->mean - exact) / sqrt(e * e + se * se + 2.5e-13);
}

static void probes(const pt_scene *scene, const pt_camera *camera, int n)
{
    static const char *const name[3] = {"mine, green", "header, green", "spectral Y"};
    double worst[3] = {0, 0, 0}, most = 0;
    pt_stats s[3][3];
    int k, h, b, i;
    printf("%-14s %9s %12s %12s %10s %8s\n", "probe 0", "samples", "estimate", "exact", "std error",
           "seconds");
    for (k = 0; k < PROBES; k++) {
        const double *rgb = probe[k].rgb, y = probe[k].y, off = pt_luminance(rgb[0], rgb[1], rgb[2]) / y - 1;
        pt_vec2 p = pt_v2((pt_real)(0.5 + probe[k].u), (pt_real)(0.5 - probe[k].v));
        pt_ray ray = pt_camera_ray(camera, 1, p.x, p.y, pt_v2(0, 0));
        double start = pt_cpu_seconds(), d;
        for (h = 0; h < 3; h++) {
            for (i = k ? n : n / 16; i <= n; i *= 4) {
                double begin = pt_cpu_seconds();
                measure(scene, ray, h, i, (uint64_t)k, s[h]);
                if (k == 0) row(name[h], &s[h][1], h == SPECTRAL ? y : rgb[1], pt_cpu_seconds() - begin);
            }
            for (b = 0; b < 3; b++) {
                d = deviation(&s[h][b], rgb[b], probe[k].se[b]);
                if (h == SPECTRAL) d = deviation(&s[h][1], y, probe[k].se_y);
                worst[h] = fmax(worst[h], d);
            }
        }
        if (k == 0)
            printf("%-5s %10s %10s %10s %10s %10s %8s %8s\n", "probe", "G, ref.", "mine", "header", "Y, ref.",
                   "mine", "Y of RGB", "seconds");
        most = fmax(most, off);
        printf("%-5d %10.5f %10.5f %10.5f ", k, rgb[1], s[0][1].mean, s[1][1].mean);
        printf("%10.5f %10.5f %+7.1f%% %8.3f\n", y, s[2][1].mean, 100 * off, pt_cpu_seconds() - start);
    }
    printf("See: all agree; but three bands are %.0f %% too bright at the red wall.\n", 100 * most);
    check(worst[MINE] < 5, "my path tracer at twelve probes, three bands: within 5 standard errors");
    check(worst[HEADER] < 5, "the header's: within 5 standard errors");
    check(worst[SPECTRAL] < 5, "my spectral path tracer, Y: within 5 standard errors");
}

/* Left: three bands, by the header, and where the probes are; right: spectra, by mine. */
static int picture(const char *output, const pt_scene *scene, const pt_camera *camera, int spp)
{
    enum { W = 160 };
    static unsigned char image[3 * 2 * W * W];
    pt_render_desc desc = pt_render_defaults();
    pt_film film = PT_FILM_INIT;
    pt_pcg32 rng = pt_pcg32_make(240, 0);
    char path[512];
    int k, s, l, x, y, ok;
    desc.camera = *camera;
    desc.width = desc.height = W;
    desc.spp = (uint32_t)spp;
    ok = pt_render(scene, &desc, &film, NULL) == PT_OK;
    for (k = 0; ok && k < 2 * W * W; k++) {
        double xyz[3] = {0, 0, 0}, eye[3];
        pt_rgbd c;
        x = k % (2 * W);
        y = k / (2 * W);
        for (s = 0; x >= W && s < spp; s++) {
            double u = (x - W + pt_pcg32_double(&rng)) / W, t = (y + pt_pcg32_double(&rng)) / W;
            my_xyz(scene, pt_camera_ray(camera, 1, (pt_real)u, (pt_real)t, pt_v2(0, 0)), &rng, eye);
            for (l = 0; l < 3; l++) xyz[l] += eye[l] / spp;
        }
        c = x < W ? pt_film_pixel(&film, x, y) : pt_xyz_to_rgb(xyz);
        for (l = 0; l < PROBES; l++) {
            int u = (int)((0.5 + probe[l].u) * W), v = (int)((0.5 - probe[l].v) * W);
            if (abs(x - u) + abs(y - v) < 2) c = pt_rgbd3(1, 1, 1);
        }
        image[3 * k] = pt_srgb_byte(1.5 * c.r);
        image[3 * k + 1] = pt_srgb_byte(1.5 * c.g);
        image[3 * k + 2] = pt_srgb_byte(1.5 * c.b);
    }
    pt_film_free(&film);
    snprintf(path, sizeof path, "%s.ppm", output);
    ok = ok && pt_write_ppm_bytes(path, image, 2 * W, W) == PT_OK;
    snprintf(path, sizeof path, "%s.png", output);
    return ok && pt_write_png_bytes(path, image, 2 * W, W) == PT_OK;
}

int main(int argc, char **argv)
{
    int n = argc > 1 && atoi(argv[1]) > 0 ? atoi(argv[1]) : 16384;
    const char *output = argc > 2 ? argv[2] : "24_is_it_correct";
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    if (getenv("SHORT") && !MISTAKE) n /= 16; /* a mistake is not seen without samples */
    if (pt_scene_cornell(&scene, &camera) != PT_OK) return 1;
    probes(&scene, &camera, n);
    check(picture(output, &scene, &camera, 8), "picture written");
    pt_scene_free(&scene);
    printf("lesson 24: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("the mistake of exercise %d was %s\n", EX, failed ? "noticed" : "NOT noticed");
    return !failed;
}

/* EXERCISES (cc -DEX=1 ... compiles the first one, and so on)
   1. Predict and run, -DEX=1: my lamp has albedo 0 instead of .78. Does a probe notice? (Not with 16384
      paths a point. With 200000 one is off by 10 standard errors: an agreement says no more than what it
      could have seen.)
   2. Break it, and watch which check fails. -DEX=2: the lamp is hit and sampled. -DEX=3: roulette without
      1/q. -DEX=4: two bounces only. Which makes the picture brighter? (2 alone: brighter is not more
      right.)
   3. Extend it: start from one wavelength a path instead of three. The same mean Y, but which standard
      error? And colour noise in the picture, why? */
