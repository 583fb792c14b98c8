/* Lesson 02: local lighting

   QUESTION   How bright is a point that sees a lamp, and what does that answer leave out?

   IDEA       The oldest model of light in pictures asks only the point itself, the lamp (a point light) and the eye:

                  L = La + Ld + Ls = ka Ia + kd (I/r^2) max(0, n.l) + ks (I/r^2) max(0, n.h)^p

              Ia is the ambient light, ka, kd, ks are what the surface sends on of each; n is the normal, l points to
              the lamp at distance r, v to the eye, and the half vector h = (l + v) / |l + v| lies half way between
              (Blinn 1977; Phong 1975 had max(0, m.v)^p with the mirror image m of l). The diffuse term is physics: a
              lamp of intensity I gives the irradiance E = I n.l / r^2 (inverse-square falloff), and a grey surface
              that reflects the share `albedo` of it has the radiance f E with f = albedo / pi. So kd is albedo / pi
              and never above 1/pi; with kd = albedo, as it is often used, L is pi times too bright. The specular term
              is a guess that looks good, the first a confession: the light that comes from everywhere else is not
              known. With the eye at the lamp, h = l, and the mean over a disk of radius R right below the lamp, at
              distance H, is known: dA n.l / r^2 is the solid angle dw, so with cos a = H / sqrt(R^2 + H^2)

                  mean Ld = 2 kd I (1 - cos a) / R^2,   mean Ls = 2 ks I (1 - cos^p a) / (p R^2)

              No ray is traced to the lamp: nothing casts a shadow. Nothing is mirrored, and no light comes from the
              neighbours: that would be global illumination. This is local lighting.

   PICTURE    Left local lighting, right path tracing: a red ball above the floor, a mirror ball on it, one lamp above.

   BUILD      cc -O2 -I.. 02_local_lighting.c -o 02_local_lighting -lm -pthread
   RUN        ./02_local_lighting [samples] [output]

   PRINTS     term             samples     estimate        exact  std.error  seconds
              ...
              my La+Ld+Ls       262144     0.919929     0.919672    0.00065    0.034

   WORDS      local lighting 局部光照; ambient light 环境光; diffuse 漫反射; specular 镜面; half vector 半程向量;
              point light 点光源; inverse-square falloff 平方反比衰减; shadow 阴影; global illumination 全局光照

   HEADER     [PT-11] pt_li_local, pt_li_path, [PT-08] pt_material_blinn, [PT-10] pt_add_point_light

   SOURCES    Phong: Illumination for Computer Generated Pictures, 1975; Blinn: Models of Light Reflection for
              Computer Synthesized Pictures, 1977; the lecture's first slide on path tracing

   Before: lesson 01. Next: lesson 03, Whitted's ray tracing. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { WIDTH = 320, HEIGHT = 200, MISTAKE = EX == 2 || EX == 3 };

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

/* ---- mine ---- */

static const double kaIa = 0.125, kd = 0.5, ks = 0.25, power = 20; /* power: the exponent p */
static const double intensity = 10, height = EX == 1 ? 4 : 2, disk = 2;

/* Phong's highlight: the angle is that between the eye and the mirror image of the lamp. */
static double my_phong(pt_vec3 n, pt_vec3 l, pt_vec3 v, double p)
{
    pt_vec3 m = pt_v3_sub(pt_v3_scale(n, 2 * pt_v3_dot(n, l)), l);
    return pow(fmax(0, (double)pt_v3_dot(m, v)), p);
}

/* Blinn's: the angle between the normal and what is half way, half as large where all lie in a plane. */
static double my_blinn(pt_vec3 n, pt_vec3 l, pt_vec3 v, double p)
{
    return pow(fmax(0, (double)pt_v3_dot(n, pt_v3_normalize(pt_v3_add(l, v)))), p);
}

/* The three terms at a point, each on its own. */
static void my_local(pt_vec3 point, pt_vec3 n, pt_vec3 eye, pt_vec3 lamp, double term[3])
{
    pt_vec3 to_lamp = pt_v3_sub(lamp, point);
    pt_vec3 l = pt_v3_normalize(to_lamp), v = pt_v3_normalize(pt_v3_sub(eye, point));
    double r2 = EX == 3 ? 1 : (double)pt_v3_dot(to_lamp, to_lamp), nl = (double)pt_v3_dot(n, l);
    if (EX != 2) nl = fmax(0, nl); /* a lamp below the horizon gives no light, not negative light */
    term[0] = kaIa;
    term[1] = kd * intensity / r2 * nl;
    term[2] = ks * intensity / r2 * my_blinn(n, l, v, power);
}

/* ---- both ---- */

static pt_scene scene = PT_SCENE_INIT;

/* The header's value for a ray. */
static double header_value(pt_li_fn li, pt_vec3 from, pt_vec3 to)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 1, 0);
    pt_li_options options = {.max_edges = 2, .ambient = pt_rgb_grey((pt_real)(kaIa / kd))}; /* times albedo */
    pt_li_info info = {0};
    pt_ray ray = {from, pt_v3_sub(to, from), 1};
    pt_sampler_start(&sampler, 0, 0);
    return li(&scene, &ray, &sampler, &options, &info).g;
}

/* The mean over the disk: random points, the eye at the lamp. which: 0 all, 1 Ld, 2 Ls, 3 the header's. */
static void table(const char *name, int which, double exact, double most)
{
    const pt_vec3 lamp = {0, (pt_real)height, 0}, up = {0, 1, 0};
    pt_pcg32 random = pt_pcg32_make(2, (uint64_t)which);
    pt_stats s = PT_STATS_INIT;
    double seconds = pt_cpu_seconds(), term[3];
    for (double n = floor(most / 256); n <= most; n *= 16) {
        while (s.n < n) {
            double r = disk * sqrt(pt_pcg32_double(&random)), phi = 2 * PT_PI * pt_pcg32_double(&random);
            pt_vec3 point = pt_v3((pt_real)(r * cos(phi)), 0, (pt_real)(r * sin(phi)));
            my_local(point, up, lamp, lamp, term);
            if (which == 0) term[0] += term[1] + term[2];
            pt_stats_add(&s, which == 3 ? header_value(pt_li_local, lamp, point) : term[which]);
        }
        row(name, &s, exact, pt_cpu_seconds() - seconds);
    }
    check(fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s), "within 5 standard errors of the exact mean");
}

/* A floor and a lamp; with_balls adds what local lighting cannot do justice to. */
static void make_scene(int with_balls)
{
    pt_rgb grey = pt_rgb_grey((pt_real)kd), shine = pt_rgb_grey((pt_real)ks), none = pt_rgb_grey(0);
    int plain = pt_add_material(&scene, pt_material_blinn(grey, with_balls ? none : shine, (pt_real)power));
    int red = pt_add_material(&scene, pt_material_blinn(pt_rgb3(0.5, 0.125, 0.125), shine, (pt_real)power));
    int mirror = pt_add_material(&scene, pt_material_mirror(pt_rgb_grey(0.875)));
    pt_add_parallelogram(&scene, pt_v3(-9, 0, -9), pt_v3(0, 0, 18), pt_v3(18, 0, 0), plain);
    if (with_balls) {
        pt_add_sphere(&scene, pt_v3(0, 1, 0), 0.5, red);
        pt_add_sphere(&scene, pt_v3(1.125, 0.5, 0.5), 0.5, mirror);
    }
    pt_add_point_light(&scene, pt_v3(0, (pt_real)height, 0), pt_rgb_grey((pt_real)intensity));
    check(pt_commit(&scene) == PT_OK, "the scene is ready");
}

/* Left: local lighting, divided by pi to compare. Right: light that arrives, by path tracing. */
static void picture(const char *output)
{
    static unsigned char rgb[WIDTH * HEIGHT * 3];
    pt_render_desc desc = pt_render_defaults();
    char path[1024];
    desc.camera = pt_camera_look_at(pt_v3(0, 3, 7), pt_v3(0.25, 0.625, 0), pt_v3(0, 1, 0), 36);
    desc.width = WIDTH / 2, desc.height = HEIGHT, desc.spp = 32;
    desc.li.ambient = pt_rgb_grey((pt_real)(kaIa / kd));
    for (int k = 0; k < 2; k++) {
        pt_film film = PT_FILM_INIT;
        desc.method = k ? "path" : "local";
        check(pt_render(&scene, &desc, &film, NULL) == PT_OK, k ? "right: path tracing" : "left: local lighting");
        for (int i = 0; i < WIDTH * HEIGHT / 2; i++) {
            int x = i % (WIDTH / 2), y = i / (WIDTH / 2);
            pt_rgbd v = pt_film_pixel(&film, x, y);
            unsigned char *to = rgb + 3 * (y * WIDTH + x + k * WIDTH / 2);
            double band[3] = {v.r, v.g, v.b};
            for (int c = 0; c < 3; c++) to[c] = pt_srgb_byte(band[c] * (k ? 2 : 2 / PT_PI));
        }
        pt_film_free(&film);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, WIDTH, HEIGHT) == PT_OK, "and as PNG");
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 262144) / (getenv("SHORT") ? 16 : 1), term[3];
    double cosa = height / sqrt(disk * disk + height * height), local, path;
    double ld = 2 * kd * intensity * (1 - cosa) / (disk * disk);
    double ls = 2 * ks * intensity * (1 - pow(cosa, power)) / (power * disk * disk);
    const pt_vec3 up = {0, 1, 0}, foot = {0, 0, 0}, eye = {3, 1, 0}, above = {3, 1, 3}, lit = {2, 0, 2};
    pt_vec3 l = pt_v3_normalize(pt_v3(-3, 4, 0)), v = pt_v3_normalize(pt_v3(3.25, 4, 0));

    make_scene(0);
    printf("%-14s %9s %12s %12s %10s %8s\n", "term", "samples", "estimate", "exact", "std.error", "seconds");
    table("my La+Ld+Ls", 0, kaIa + ld + ls, most);
    table("pt_li_local", 3, kaIa + ld + ls, most);
    table("my Ld", 1, ld, most);
    table("my Ls", 2, ls, most);
    printf("What to see: the guess Ls is a small part of the whole, and most of what makes it look real.\n");
    my_local(foot, up, eye, pt_v3(0, -1, 0), term);
    check(term[1] == 0, "a lamp below the floor gives no diffuse light");
    check(fabs(my_phong(up, l, v, 20) / my_blinn(up, l, v, 80) - 1) < 0.01, "Phong with p is Blinn with 4 p, nearly");
    pt_scene_free(&scene);

    make_scene(1);
    local = header_value(pt_li_local, eye, foot);
    path = header_value(pt_li_path, eye, foot);
    printf("below the red ball: local lighting %.4g, light that arrives %.4g\n", local, path);
    check(local > kaIa && path == 0, "local lighting does not see that the ball is in the way");
    local = header_value(pt_li_local, above, lit) - kaIa;
    path = header_value(pt_li_path, above, lit);
    check(fabs(local / path - PT_PI) < 1e-4, "with kd = albedo it is pi times too bright");
    picture(argc > 2 ? argv[2] : "02_local_lighting");
    pt_scene_free(&scene);

    printf("lesson 02: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: the lamp hangs twice as high, at 4 instead of 2 (-DEX=1). Is the mean of Ld over the disk a quarter?
       Answer: no, 0.2639 instead of 0.7322: a lamp nearby does not light all of the disk from distance H.
   (2) Break: leave out max(0, n.l) (-DEX=2): negative light from a lamp below the floor; one check fails, and no
       table notices, since there the lamp is always above. Leave out 1/r^2 (-DEX=3): the tables of my terms fail.
   (3) Extend: move the eye to infinity above the floor, v = (0, 1, 0), and find the mean of Ls with p = 2 by
       integration over the disk. Answer: n.h = cos(t/2) for the angle t at the lamp, its square is (1 + cos t) / 2,
       and the mean is (ks I / R^2) (-ln(cos a) + 1 - cos a) = 0.3997. */
