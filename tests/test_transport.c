/* test_transport.c: light transport whose answer is known, and methods that must agree [PT-11, PT-19].

       cc -O2 -ffp-contract=off -I. tests/test_transport.c -o test_transport -lm -pthread && ./test_transport

   Run it in the project's top directory: it reads tests/data. LONG=1 repeats the agreements of methods with
   more samples. Exact values are closed forms worked out at the line, or come from the files in tests/data.
   The work is about 50 CPU seconds; arguments choose functions: ./test_transport furnaces pools. */

#include "pt_test.h"

#define UNITS 128 /* independent randomisations of a Sobol estimate */

typedef struct method {
    const char *name;
    pt_li_fn li;
} method;

static const method METHODS[3] = {
    {"path", pt_li_path}, {"plain", pt_li_path_plain}, {"light", pt_li_path_light}};
enum { PATH, PLAIN, LIGHT };

/* What is estimated: the radiance along `ray`, or the mean over the picture of `camera` if it is set. */
typedef struct experiment {
    const pt_scene *scene;
    const pt_camera *camera;
    pt_ray ray;
    pt_li_fn li;
    pt_li_options options;
} experiment;

static uint64_t nonfinite; /* paths whose radiance was NaN or infinite */

static pt_rgb grey(double v) { return pt_rgb_grey((pt_real)v); }
static pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }

static pt_ray ray_from(pt_vec3 o, pt_vec3 d)
{
    pt_ray r;
    r.o = o;
    r.d = pt_v3_normalize(d);
    r.tmax = (pt_real)HUGE_VAL;
    return r;
}

static experiment experiment_of(const pt_scene *scene, pt_ray ray, int which)
{
    experiment e;
    memset(&e, 0, sizeof e);
    e.scene = scene;
    e.ray = ray;
    e.li = METHODS[which].li;
    return e;
}

static pt_rgbd one_path(const experiment *e, pt_sampler *sampler, pt_li_info *info)
{
    pt_ray ray = e->ray;
    pt_rgbd value;
    memset(info, 0, sizeof *info);
    if (e->camera) {
        pt_vec2 film;
        pt_sampler_seek(sampler, PT_DIM_FILM);
        film = pt_sampler_2d(sampler);
        ray = pt_camera_ray(e->camera, 1, film.x, film.y, pt_v2(0, 0));
    }
    value = e->li(e->scene, &ray, sampler, &e->options, info);
    nonfinite += !(fabs(value.r + value.g + value.b) < HUGE_VAL);
    return value;
}

static void add_rgb(pt_stats s[3], pt_rgbd v)
{
    pt_stats_add(&s[0], v.r);
    pt_stats_add(&s[1], v.g);
    pt_stats_add(&s[2], v.b);
}

/* n independent paths; each is one value. */
static void by_values(const experiment *e, uint64_t seed, uint32_t n, pt_stats out[3])
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(seed), 0);
    pt_li_info info;
    uint32_t i;
    memset(out, 0, 3 * sizeof *out);
    for (i = 0, n = pt_test_samples(n); i < n; i++) {
        pt_sampler_start(&sampler, 0, i);
        add_rgb(out, one_path(e, &sampler, &info));
    }
}

/* UNITS independent randomisations of n Sobol points; the mean of each is one value. */
static void by_means(const experiment *e, uint64_t seed, uint32_t n, pt_stats out[3])
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, pt_test_seed(seed), 0);
    pt_li_info info;
    uint32_t unit, i;
    memset(out, 0, 3 * sizeof *out);
    n = pt_test_samples(n);
    for (unit = 0; unit < UNITS; unit++) {
        pt_rgbd sum = pt_rgbd3(0, 0, 0);
        for (i = 0; i < n; i++) {
            pt_rgbd v;
            pt_sampler_start(&sampler, unit, i);
            v = one_path(e, &sampler, &info);
            sum = pt_rgbd3(sum.r + v.r, sum.g + v.g, sum.b + v.b);
        }
        add_rgb(out, pt_rgbd3(sum.r / n, sum.g / n, sum.b / n));
    }
}

static pt_scene committed(pt_scene scene)
{
    const pt_result result = pt_commit(&scene);
    if (result != PT_OK) pt_check(0, "pt_commit", "%s", pt_scene_error(&scene));
    return scene;
}

/* The six walls of a box, one-sided: they look inwards (sign 1) or outwards (sign -1). */
static void add_box(pt_scene *scene, pt_vec3 lo, pt_vec3 hi, int sign, int material)
{
    const pt_vec3 x = pt_v3(hi.x - lo.x, 0, 0), y = pt_v3(0, hi.y - lo.y, 0), z = pt_v3(0, 0, hi.z - lo.z);
    const pt_vec3 e[3] = {x, y, z};
    int k;
    for (k = 0; k < 3; k++) {
        const pt_vec3 a = e[(k + 1) % 3], b = e[(k + 2) % 3]; /* a x b points along e[k] */
        pt_add_parallelogram(scene, lo, sign > 0 ? a : b, sign > 0 ? b : a, material);
        pt_add_parallelogram(scene, pt_v3_add(lo, e[k]), sign > 0 ? b : a, sign > 0 ? a : b, material);
    }
}

static pt_material glowing(double rho, double radiance)
{
    pt_material m = pt_material_diffuse(grey(rho));
    m.emission = grey(radiance);
    return m;
}

/* A diffuse floor of 10 m x 10 m at y = 0 that looks up, for direct light. */
static void add_floor(pt_scene *scene, double rho)
{
    pt_add_parallelogram(scene, v3(-5, 0, -5), v3(0, 0, 10), v3(10, 0, 0),
                         pt_add_material(scene, pt_material_diffuse(grey(rho))));
}

/* ---- furnaces: every point of a closed surface emits Le and reflects rho, so L = Le + rho L --------- */

static pt_scene furnace_box(double rho)
{
    pt_scene s = PT_SCENE_INIT;
    add_box(&s, v3(-0.5, -0.5, -0.5), v3(0.5, 0.5, 0.5), 1, pt_add_material(&s, glowing(rho, 1)));
    return committed(s);
}

static pt_scene furnace_sphere(pt_vec3 centre, double radius, double rho)
{
    pt_scene s = PT_SCENE_INIT;
    pt_add_sphere(&s, centre, (pt_real)radius, pt_add_material(&s, glowing(rho, 1)));
    return committed(s);
}

static const pt_ray *furnace_ray(void)
{
    static pt_ray ray;
    ray = ray_from(v3(0.1, -0.2, 0.05), v3(0.3, 0.5, -0.8));
    return &ray;
}

/* Grey furnaces: exactly Le / (1 - rho). Roulette with a constant survival begins late, so that it is used
   and yet the variance is low. Light sampling alone aims at one of the six walls, or anywhere in the sphere,
   and half of that in vain; its bound is 1 %. */
static void furnaces(void)
{
    pt_test_source("geometric series: 1/(1 - rho)");
    static const double rho[3] = {0.5, 0.8, 0.95};
    static const int start[3] = {6, 16, 64};
    /* in a randomisation, but values without light sampling, which are too skewed for few of them */
    static const uint32_t paths[3][3] = {{64, 5000, 256}, {80, 5000, 384}, {32, 5000, 192}};
    int shape, i, m;
    for (shape = 0; shape < 2; shape++) {
        for (i = 0; i < 3; i++) {
            pt_scene scene = shape == 0 ? furnace_box(rho[i]) : furnace_sphere(v3(0, 0, 0), 1, rho[i]);
            for (m = 0; m < 3; m++) {
                experiment e = experiment_of(&scene, *furnace_ray(), m);
                pt_stats s[3];
                if (shape == 0 && i == 2 && m != PLAIN)
                    continue; /* slow, and nothing that the others do not see */
                e.options.roulette = PT_ROULETTE_CONSTANT;
                e.options.roulette_survival = (pt_real)(0.5 + 0.5 * rho[i]);
                e.options.roulette_start = start[i];
                (m == PLAIN ? by_values : by_means)(&e, 100 + (uint64_t)(60 * shape + 10 * i + m),
                                                    paths[i][m] + (m == LIGHT && shape ? paths[i][m] / 5 : 0),
                                                    s);
                pt_check_mean(
                    label("furnace %s, rho %g, %s", shape ? "sphere" : "box", rho[i], METHODS[m].name), &s[0],
                    1 / (1 - rho[i]), 0, m == LIGHT ? 0.01 : 0.005,
                    m == PLAIN ? PT_TEST_VALUES : PT_TEST_MEANS,
                    "energy is lost or made in a closed room: weights of the BSDF, of MIS, of roulette");
            }
            pt_scene_free(&scene);
        }
    }
}

/* The defaults: roulette by throughput from edge 3 on. Its variance at rho = 0.95 is that of rho / (1 -
   rho)^2, so the bound is wider there. */
static void furnace_default_roulette(void)
{
    pt_test_source("geometric series: 1/(1 - rho)");
    static const double rho[2] = {0.8, 0.95}, bound[2] = {0.005, 0.02};
    static const uint32_t paths[2] = {8192, 640};
    int i;
    for (i = 0; i < 2; i++) {
        pt_scene scene = furnace_sphere(v3(0, 0, 0), 1, rho[i]);
        experiment e = experiment_of(&scene, *furnace_ray(), PLAIN);
        pt_stats s[3];
        by_means(&e, 140 + (uint64_t)i, paths[i], s);
        pt_check_mean(label("furnace sphere, rho %g, roulette by throughput", rho[i]), &s[0],
                      1 / (1 - rho[i]), 0, bound[i], PT_TEST_MEANS,
                      "survivors must be divided by their probability to survive");
        pt_scene_free(&scene);
    }
}

/* Roulette with a constant P_RR, as the lecture has it: smaller and larger than rho. Values of finite
   variance need q > rho^2, a finite skewness q^2 > rho^3. */
static void furnace_constant_roulette(void)
{
    pt_test_source("geometric series: 1/(1 - rho)");
    static const double rho[5] = {0.5, 0.5, 0.5, 0.8, 0.95}, q[5] = {0.45, 0.8, 0.95, 0.9, 0.97};
    static const double bound[5] = {0.005, 0.005, 0.005, 0.005, 0.02};
    static const uint32_t paths[5] = {1800000, 256, 128, 1280, 256}; /* the first in all */
    int i, m;
    for (i = 0; i < 5; i++) {
        pt_scene scene = furnace_sphere(v3(0, 0, 0), 1, rho[i]);
        experiment e = experiment_of(&scene, *furnace_ray(), PLAIN);
        pt_stats s[3];
        e.options.roulette = PT_ROULETTE_CONSTANT;
        e.options.roulette_survival = (pt_real)q[i];
        (i == 0 ? by_values : by_means)(&e, 150 + (uint64_t)i, paths[i], s);
        pt_check_mean(label("furnace sphere, rho %g, P_RR %g", rho[i], q[i]), &s[0], 1 / (1 - rho[i]), 0,
                      bound[i], i == 0 ? PT_TEST_VALUES : PT_TEST_MEANS, "survivors must be divided by P_RR");
        pt_scene_free(&scene);
    }
    for (m = 0; m < 3; m += 2) { /* the methods with light sampling: after the light, before the next edge */
        pt_scene scene = furnace_sphere(v3(0, 0, 0), 1, 0.5);
        experiment e = experiment_of(&scene, *furnace_ray(), m);
        pt_stats s[3];
        e.options.roulette = PT_ROULETTE_CONSTANT; /* with its default, 0.8 */
        by_means(&e, 160 + (uint64_t)m, 320, s);
        pt_check_mean(label("furnace sphere, P_RR default, %s", METHODS[m].name), &s[0], 2, 0, 0.01,
                      PT_TEST_MEANS, "roulette after a light sample must not weigh that sample");
        pt_scene_free(&scene);
    }
}

/* With q = rho every survivor weighs 1, so a path's radiance is its number of edges, geometric with mean 2
   and variance q / (1 - q)^2 = 2. */
static void roulette_path_length(void)
{
    pt_test_source("geometric law: mean 1/(1 - q), variance q/(1 - q)^2");
    pt_scene scene = furnace_sphere(v3(0, 0, 0), 1, 0.5);
    experiment e = experiment_of(&scene, *furnace_ray(), PLAIN);
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(170), 0);
    const pt_stats none = PT_STATS_INIT;
    pt_stats edges = PT_STATS_INIT, square = PT_STATS_INIT;
    const uint32_t n = pt_test_all_samples(1300000);
    uint32_t i, strange = 0;
    e.options.roulette = PT_ROULETTE_CONSTANT;
    e.options.roulette_survival = (pt_real)0.5;
    for (i = 0; i < n; i++) {
        pt_li_info info;
        pt_rgbd v;
        pt_sampler_start(&sampler, 0, i);
        v = one_path(&e, &sampler, &info);
        strange += fabs(v.r - info.edges) > 1e-5 * v.r || info.rays != (uint64_t)info.edges;
        pt_stats_add(&edges, info.edges);
        pt_stats_add(&square, (v.r - 2) * (v.r - 2));
    }
    pt_check(strange == 0, "roulette with P_RR = rho: weight 1, a ray an edge", "%u of %u paths differ",
             strange, n);
    pt_check_mean("roulette: edges of a path", &edges, 2, 0, 0.005, PT_TEST_VALUES,
                  "the first roulette is drawn after edge 1, survival P_RR");
    pt_check_mean(
        "roulette: variance of a path", &square, 2, 0, 0.05, PT_TEST_VALUES,
        "the number of edges is geometric: variance q / (1 - q)^2; is each edge's roulette drawn afresh?");
    /* By throughput: 1/8 goes on after edge 3 with throughput 1, and a half after each further edge: 3 + 1/4. */
    edges = none;
    e.options.roulette = PT_ROULETTE_THROUGHPUT;
    for (i = 0; i < n / 4; i++) {
        pt_li_info info;
        pt_sampler_start(&sampler, 1, i);
        one_path(&e, &sampler, &info);
        pt_stats_add(&edges, info.edges);
    }
    pt_check_mean("roulette by throughput: edges of a path", &edges, 3.25, 0, 0.01, PT_TEST_VALUES,
                  "the survival is the throughput itself");
    pt_scene_free(&scene);
}

/* max_edges k: 1 + rho + ... + rho^(k-1). Without light sampling each path has exactly that radiance. */
static void furnace_truncated(void)
{
    pt_test_source("geometric series: (1 - rho^k)/(1 - rho)");
    static const int edges[4] = {1, 2, 3, 5};
    const double rho = 0.8;
    pt_scene scene = furnace_box(rho);
    int i, m;
    for (i = 0; i < 4; i++) {
        const double exact = (1 - pow(rho, edges[i])) / (1 - rho);
        for (m = 0; m < 3; m++) {
            experiment e = experiment_of(&scene, *furnace_ray(), m);
            pt_stats s[3];
            e.options.max_edges = edges[i];
            e.options.roulette = PT_ROULETTE_NONE;
            by_means(&e, 180 + (uint64_t)(10 * i + m), m == PLAIN ? 8 : m == PATH ? 176 : 576, s);
            pt_check_mean(label("furnace of %d edges, %s", edges[i], METHODS[m].name), &s[0], exact,
                          1e-6 * exact, m == LIGHT ? 0.01 : 0.005, PT_TEST_MEANS,
                          "max_edges counts edges: 1 = emission seen directly, 2 = and direct light");
        }
    }
    pt_scene_free(&scene);
}

/* No ray may leak out of a closed sphere of any size anywhere, and none may meet the point it starts from:
   then each path of 20 edges without light sampling has the radiance 1 + rho + ... + rho^19. */
static void scale_of_furnace(double radius, double away, uint64_t seed)
{
    const double x = away * radius, exact = 2 - ldexp(1, -19);
    const uint32_t n = 500;
    pt_scene scene = furnace_sphere(v3(x, -x, 0.5 * x), radius, 0.5);
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(230), 0);
    experiment e = experiment_of(&scene, *furnace_ray(), PLAIN);
    pt_stats s[3];
    double worst = 0;
    uint32_t i;
    e.options.max_edges = 20;
    e.options.roulette = PT_ROULETTE_NONE;
    for (i = 0; i < n; i++) {
        pt_li_info info;
        pt_sampler_start(&sampler, 1, i);
        e.ray = ray_from(v3(x + 0.3 * radius, -x - 0.2 * radius, 0.5 * x),
                         pt_warp_sphere(pt_sampler_2d(&sampler)));
        pt_sampler_start(&sampler, 0, i);
        worst = fmax(worst, fabs(one_path(&e, &sampler, &info).r - exact));
    }
    pt_check(worst <= 1e-5, label("sphere of radius %g, %g radii away", radius, away),
             "radiance off by %.3g in one of %u paths: a ray leaked or met its own start", worst, n);
    e.li = pt_li_path;
    by_means(&e, seed, 48, s);
    pt_check_mean(label("sphere of radius %g, %g radii away, path", radius, away), &s[0], exact, 0, 0.005,
                  PT_TEST_MEANS,
                  "shadow rays inside the sphere are blocked, or densities depend on its size");
    pt_scene_free(&scene);
}

static void furnace_scales(void)
{
    pt_test_source("geometric series: 2 - 2^-19");
    static const double radius[3] = {1e-4, 1, 1e6}, away[3] = {0, 1e2, 1e4};
    int i, j;
    for (i = 0; i < 3; i++)
        for (j = 0; j < 3; j++) scale_of_furnace(radius[i], away[j], 231 + (uint64_t)(3 * i + j));
}

/* ---- lossless objects cannot be seen where radiance is the same everywhere -------------------------- */

enum { GLASS_BALL, MIRROR_BALL, GLASS_IN_GLASS, MIRROR_IN_GLASS, GLASS_PLATE, GLASS_CUBE };

static void add_object(pt_scene *s, int kind, double ior)
{
    const int glass = pt_add_material(s, pt_material_dielectric((pt_real)ior));
    const int mirror = pt_add_material(s, pt_material_mirror(grey(1)));
    switch (kind) {
    case GLASS_BALL:
        pt_add_sphere(s, v3(0, 0, 0), 1, glass);
        break;
    case MIRROR_BALL:
        pt_add_sphere(s, v3(0, 0, 0), 1, mirror);
        break;
    case GLASS_IN_GLASS:
        pt_add_sphere(s, v3(0, 0, 0), 1, glass);
        pt_add_sphere(s, v3(0.1, 0.2, 0), (pt_real)0.5,
                      pt_add_material(s, pt_material_dielectric((pt_real)1.3)));
        break;
    case MIRROR_IN_GLASS:
        pt_add_sphere(s, v3(0, 0, 0), 1, glass);
        pt_add_sphere(s, v3(0.1, 0.2, 0), (pt_real)0.5, mirror);
        break;
    case GLASS_PLATE:
        add_box(s, v3(-1, -1, -5e-5), v3(1, 1, 5e-5), -1, glass);
        break;
    default:
        add_box(s, v3(-0.5, -0.5, -0.5), v3(0.5, 0.5, 0.5), -1, glass);
        break;
    }
}

/* `room` 0: under a uniform sky; 1: in a glowing box with black walls. */
static pt_scene object_scene(int kind, double ior, int room)
{
    pt_scene s = PT_SCENE_INIT;
    add_object(&s, kind, ior);
    if (room)
        add_box(&s, v3(-4, -4, -4), v3(4, 4, 4), 1, pt_add_material(&s, pt_material_emitter(grey(1))));
    else
        pt_set_environment(&s, grey(1));
    return committed(s);
}

/* A ray from a sphere of radius 3 towards a point of the unit ball. */
static pt_ray ray_at_object(pt_sampler *sampler)
{
    const pt_vec3 from = pt_v3_scale(pt_warp_sphere(pt_sampler_2d(sampler)), 3);
    const pt_vec3 on = pt_warp_sphere(pt_sampler_2d(sampler));
    return ray_from(from, pt_v3_sub(pt_v3_scale(on, pt_sampler_1d(sampler)), from));
}

/* Every path has radiance 1 up to the rounding of its weights, less than eight an edge. With the default
   roulette too: its survival is the throughput without the factor eta^2, that is 1, cut to 1 - 2^-24. */
static int paths_off_one(experiment *e, uint64_t seed, uint32_t n, double *worst)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(seed), 0);
    int off = 0;
    uint32_t i;
    for (i = 0, *worst = 0; i < n; i++) {
        pt_li_info info;
        double difference;
        pt_sampler_start(&sampler, 1, i);
        e->ray = ray_at_object(&sampler);
        pt_sampler_start(&sampler, 0, i);
        difference = fabs(one_path(e, &sampler, &info).g - 1);
        off += !(difference <= info.edges * (8 * pt_gamma(1) + ldexp(1, -23)));
        *worst = fmax(*worst, difference);
    }
    return off;
}

static void invisible(void)
{
    static const struct {
        int kind;
        double ior;
        const char *name;
    } object[] = {
        {GLASS_BALL, 1.5, "glass ball 1.5"},       {GLASS_BALL, 1.33, "glass ball 1.33"},
        {GLASS_BALL, 1.0001, "glass ball 1.0001"}, {GLASS_BALL, 1, "glass ball 1"},
        {GLASS_BALL, 100, "glass ball 100"},       {GLASS_BALL, 1 / 1.5, "bubble 1/1.5"},
        {MIRROR_BALL, 1, "mirror ball"},           {GLASS_IN_GLASS, 1.5, "glass in glass"},
        {MIRROR_IN_GLASS, 2.4, "mirror in glass"}, {GLASS_PLATE, 1.5, "glass plate 1e-4 thick"},
        {GLASS_CUBE, 1.6, "glass cube"},
    };
    size_t i;
    for (i = 0; i < sizeof object / sizeof object[0]; i++) {
        int room, m, roulette;
        for (room = 0; room < 2; room++) {
            pt_scene scene = object_scene(object[i].kind, object[i].ior, room);
            for (m = 0; m < 3; m++)
                for (roulette = 0; roulette < 2; roulette++) {
                    experiment e = experiment_of(&scene, *furnace_ray(), m);
                    double worst;
                    int off;
                    e.options.max_edges = roulette ? 0 : 100000;
                    e.options.roulette = roulette ? PT_ROULETTE_THROUGHPUT : PT_ROULETTE_NONE;
                    off = paths_off_one(&e, 250 + i, 2000, &worst);
                    pt_check(off == 0,
                             label("%s in a white %s, %s%s", object[i].name, room ? "box" : "sky",
                                   METHODS[m].name, roulette ? ", roulette" : ""),
                             "%d of 2000 paths are not 1, by up to %.3g: Fresnel weights, eta^2 and its "
                             "roulette, or a "
                             "ray that lost its side of the surface",
                             off, worst);
                }
            pt_scene_free(&scene);
        }
    }
}

/* From inside glass of index n the white sky has radiance n^2 (Clausius); looked at along a diameter. */
static void radiance_inside_glass(void)
{
    static const double ior[2] = {1.5, 2.4};
    int i;
    for (i = 0; i < 2; i++) {
        pt_scene scene = object_scene(GLASS_BALL, ior[i], 0);
        experiment e = experiment_of(&scene, ray_from(v3(0, 0, 0), v3(1, 2, 3)), PATH);
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(270), 0);
        double worst = 0;
        uint32_t k;
        e.options.max_edges = 100000;
        e.options.roulette = PT_ROULETTE_NONE;
        for (k = 0; k < 1000; k++) {
            pt_li_info info;
            pt_sampler_start(&sampler, 0, k);
            worst = fmax(worst, fabs(one_path(&e, &sampler, &info).g / (ior[i] * ior[i]) - 1));
        }
        pt_check(worst <= 1e-5, label("white sky from inside glass %g", ior[i]),
                 "relative difference %.3g from n^2: is radiance scaled by eta^2 at refraction?", worst);
        pt_scene_free(&scene);
    }
}

/* A white diffuse ball is invisible too, but only in the mean. */
static void white_ball(void)
{
    pt_test_source("without losses, radiance is that of the surroundings: 1");
    int room, m;
    for (room = 0; room < 2; room++)
        for (m = 0; m < 3; m++) {
            pt_scene s = PT_SCENE_INIT;
            experiment e = experiment_of(&s, ray_from(v3(0.3, 0.4, 3), v3(0, -0.02, -1)), m);
            pt_stats means[3];
            pt_add_sphere(&s, v3(0, 0, 0), 1, pt_add_material(&s, pt_material_diffuse(grey(1))));
            if (room)
                add_box(&s, v3(-4, -4, -4), v3(4, 4, 4), 1,
                        pt_add_material(&s, pt_material_emitter(grey(1))));
            else
                pt_set_environment(&s, grey(1));
            s = committed(s);
            by_means(&e, 280 + (uint64_t)(10 * room + m), !room ? 128 : m == LIGHT ? 2560 : 512, means);
            pt_check_mean(label("white ball in a white %s, %s", room ? "box" : "sky", METHODS[m].name),
                          &means[0], 1, 1e-6, m == LIGHT ? 0.01 : 0.005, PT_TEST_MEANS,
                          "light from the background: its density, its weight, or its misses");
            pt_scene_free(&s);
        }
}

/* ---- a pool: Fresnel, total reflection and eta^2 in one number -------------------------------------- */

/* Unpolarised Fresnel reflectance, textbook form, to have it from somewhere else than the header. */
static double fresnel(double cos_i, double eta)
{
    const double sin2 = (1 - cos_i * cos_i) / (eta * eta);
    double cos_t, s, p;
    if (sin2 >= 1) return 1;
    cos_t = sqrt(1 - sin2);
    s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    return 0.5 * (s * s + p * p);
}

/* Its cosine-weighted mean over the hemisphere, by Simpson's rule in x with cos_i = x^2 (smooth at
   grazing). */
static double fresnel_mean(double eta)
{
    const int n = 2000;
    double sum = 0;
    int i;
    for (i = 0; i <= n; i++) {
        const double x = (double)i / n, mu = x * x, weight = i == 0 || i == n ? 1 : i % 2 ? 4 : 2;
        sum += weight * 2 * mu * fresnel(mu, eta) * 2 * x;
    }
    return sum / (3 * n);
}

/* A square pool, 1 m deep, with mirrors for walls, so that it looks endless; the water's surface at y = 0. */
static pt_scene pool(double rho, double glow, double sky, double ior)
{
    pt_scene s = PT_SCENE_INIT;
    const int floor = pt_add_material(&s, glowing(rho, glow)),
              mirror = pt_add_material(&s, pt_material_mirror(grey(1)));
    const int water = pt_add_material(&s, pt_material_dielectric((pt_real)ior));
    pt_add_parallelogram(&s, v3(-1, -1, -1), v3(0, 0, 2), v3(2, 0, 0), floor);
    pt_add_parallelogram(&s, v3(-1, 0, -1), v3(0, 0, 2), v3(2, 0, 0), water);
    pt_add_parallelogram(&s, v3(-1, -1, -1), v3(2, 0, 0), v3(0, 1, 0), mirror);
    pt_add_parallelogram(&s, v3(-1, -1, 1), v3(2, 0, 0), v3(0, 1, 0), mirror);
    pt_add_parallelogram(&s, v3(-1, -1, -1), v3(0, 0, 2), v3(0, 1, 0), mirror);
    pt_add_parallelogram(&s, v3(1, -1, -1), v3(0, 0, 2), v3(0, 1, 0), mirror);
    pt_set_environment(&s, grey(sky));
    return committed(s);
}

static pt_ray pool_ray(double theta_deg)
{
    const double t = theta_deg * PT_PI / 180;
    const pt_vec3 d = v3(sin(t), -cos(t), 0.01);
    return ray_from(pt_v3_sub(v3(0.1, 0, 0.2), pt_v3_scale(d, 2)), d);
}

/* Under a white sky: F + (1-F)/n^2 rho (1-Fext)/(1 - rho Fint), Fext and Fint the mean reflectances from
   above and from below. With the sky dark and the floor glowing: (1-F)/n^2 Le/(1 - rho Fint); here eta^2 does
   not cancel along the path. */
static double pool_radiance(const pt_ray *ray, double rho, double glow, double sky, double n)
{
    const double f = fresnel(-(double)ray->d.y, n), external = fresnel_mean(n),
                 internal = 1 - (1 - external) / (n * n);
    return f * sky + (1 - f) / (n * n) * (glow + rho * (1 - external) * sky) / (1 - rho * internal);
}

/* A lamp under water is seen or not by one random number alone, and n well-spread ones have one of two
   neighbouring counts, in all randomisations the same one if luck wants it: their scatter then says nothing.
   Such counts are no wilder than fair coins (W. Hoeffding, 1963): half a path / sqrt(UNITS). Values are < 1. */
static double coin_error(uint32_t paths) { return 0.5 / (pt_test_samples(paths) * sqrt(UNITS)); }

static void check_pool(const char *name, const pt_scene *scene, const double water[4], double angle, int m,
                       int roulette, uint64_t seed, uint32_t paths)
{
    experiment e = experiment_of(scene, pool_ray(angle), m);
    pt_stats s[3];
    e.options.roulette = roulette ? PT_ROULETTE_THROUGHPUT : PT_ROULETTE_NONE;
    e.options.max_edges = roulette ? 0 : 400;
    by_means(&e, seed, paths, s);
    pt_check_mean(label("%s, %g degrees, %s%s", name, angle, METHODS[m].name, roulette ? ", roulette" : ""),
                  &s[0], pool_radiance(&e.ray, water[0], water[1], water[2], water[3]), coin_error(paths),
                  roulette ? 0.02 : 0.005, PT_TEST_MEANS,
                  "Fresnel, total reflection, eta^2, or light found behind a refraction");
}

/* Without roulette, which would be most of the variance here; then with it. */
static void pools(void)
{
    pt_test_source("closed form from Fresnel's equations: see pool_radiance in the test");
    static const double angle[3] = {0, 45, 75};
    static const double water[4][4] = {
        {0.5, 0, 1, 1.33}, {0.8, 0, 1, 1.5}, {0, 1, 0, 1.33}, {0.5, 1, 0, 1.5}};
    static const char *const name[4] = {"pool under a white sky", "pool of glass", "lamp under water",
                                        "lamp in glass"};
    static const uint32_t paths[4] = {1408, 0, 256, 448}, with_roulette[4] = {1024, 512, 64, 320};
    int w, a;
    for (w = 0; w < 4; w++) {
        pt_scene scene = pool(water[w][0], water[w][1], water[w][2], water[w][3]);
        const uint64_t seed = 300 + 10 * (uint64_t)w;
        for (a = 0; a < 3; a++)
            if (w % 2 == 0 || (w == 3 && a == 1))
                check_pool(name[w], &scene, water[w], angle[a], PATH, 0, seed + (uint64_t)a, paths[w]);
        check_pool(name[w], &scene, water[w], 45, PATH, 1, seed + 4, with_roulette[w]);
        if (w == 0) check_pool(name[w], &scene, water[w], 45, PLAIN, 0, seed + 5, paths[w]);
        if (w == 0) check_pool(name[w], &scene, water[w], 45, LIGHT, 0, seed + 6, paths[w]);
        pt_scene_free(&scene);
    }
}

/* The direction of a ray need not have unit length, a camera's neither. */
static void length_of_rays(void)
{
    pt_test_source("closed form from Fresnel's equations: see pool_radiance in the test");
    static const double length[2] = {7, 1e-3};
    pt_scene scene = pool(0, 1, 0, 1.33);
    int i;
    for (i = 0; i < 2; i++) {
        experiment e = experiment_of(&scene, pool_ray(75), PATH);
        const double exact = pool_radiance(&e.ray, 0, 1, 0, 1.33);
        pt_stats s[3];
        e.ray.d = pt_v3_scale(e.ray.d, (pt_real)length[i]);
        by_means(&e, 290 + (uint64_t)i, 256, s);
        pt_check_mean(label("lamp under water, direction of length %g", length[i]), &s[0], exact,
                      coin_error(256), 0.005, PT_TEST_MEANS,
                      "the direction must be normalised before cosines are taken of it");
    }
    pt_scene_free(&scene);
}

/* The closed form itself against values from quadrature: n = 1.33, rho = 0.5 at 0, 45 and 75 degrees, and n =
   1.5. */
static void pool_closed_form(void)
{
    static const double exact[4] = {0.358698903, 0.363582295, 0.483935109, 0.316070887};
    static const double angle[4] = {0, 45, 75, 0};
    int i;
    for (i = 0; i < 4; i++) {
        pt_ray ray = pool_ray(angle[i]);
        ray.d = v3(sin(angle[i] * PT_PI / 180), -cos(angle[i] * PT_PI / 180), 0);
        pt_check_near(
            "pool, closed form", pool_radiance(&ray, 0.5, 0, 1, i < 3 ? 1.33 : 1.5), exact[i], 2e-7,
            "Fresnel's mean over the hemisphere weighs with 2 cos; from inside it is 1 - (1 - F) / n^2");
    }
}

/* A pool with a white floor is a mirror of the sky: radiance 1 on every path, however long it stays
   inside. */
static void white_pool(void)
{
    pt_scene scene = pool(1, 0, 1, 1.33);
    experiment e = experiment_of(&scene, pool_ray(45), PLAIN);
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(345), 0);
    double worst = 0;
    uint32_t i;
    e.options.max_edges = 100000;
    e.options.roulette = PT_ROULETTE_NONE;
    for (i = 0; i < 2000; i++) {
        pt_li_info info;
        pt_sampler_start(&sampler, 0, i);
        worst = fmax(worst, fabs(one_path(&e, &sampler, &info).r - 1) / info.edges);
    }
    pt_check(worst <= 8 * pt_gamma(1), "pool with a white floor",
             "a path is off by %.3g for each of its edges", worst);
    pt_scene_free(&scene);
}

/* A glass plate before a black wall, under a white sky, at 60 degrees: reflectance 2F/(1+F), the sum over all
   reflections inside, with F that of one side, unpolarised at each. */
static void glass_plate(void)
{
    pt_test_source("closed form: 2F/(1 + F), F of one side by Fresnel's equations");
    pt_scene s = PT_SCENE_INIT;
    experiment e = experiment_of(&s, pool_ray(60), PATH);
    const double f = fresnel(-(double)e.ray.d.y, 1.5);
    pt_stats means[3];
    add_box(&s, v3(-100, -0.02, -100), v3(100, 0, 100), -1,
            pt_add_material(&s, pt_material_dielectric((pt_real)1.5)));
    pt_add_parallelogram(&s, v3(-1e6, -1, -1e6), v3(0, 0, 2e6), v3(2e6, 0, 0),
                         pt_add_material(&s, pt_material_diffuse(grey(0))));
    pt_set_environment(&s, grey(1));
    s = committed(s);
    by_means(&e, 346, 13312, means);
    pt_check_mean("glass plate at 60 degrees", &means[0], 2 * f / (1 + f), 1e-7, 0.005, PT_TEST_MEANS,
                  "probabilities and weights of reflection and refraction");
    pt_scene_free(&s);
}

/* Between two parallel mirrors of reflectance 0.9 and 0.8, the first of which glows: 1 / (1 - 0.72), path by
   path. */
static void glowing_mirrors(void)
{
    pt_scene s = PT_SCENE_INIT;
    pt_material first = pt_material_mirror(grey(0.9));
    int m;
    first.emission = grey(1);
    pt_add_parallelogram(&s, v3(-9, 0, -9), v3(0, 0, 18), v3(18, 0, 0), pt_add_material(&s, first));
    pt_add_parallelogram(&s, v3(-9, 1, -9), v3(18, 0, 0), v3(0, 0, 18),
                         pt_add_material(&s, pt_material_mirror(grey(0.8))));
    s = committed(s);
    for (m = 0; m < 3; m++) {
        experiment e = experiment_of(&s, ray_from(v3(0, 0.5, 0), v3(0, -1, 0)), m);
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(350), 0);
        pt_li_info info;
        e.options.max_edges = 200;
        e.options.roulette = PT_ROULETTE_NONE;
        pt_sampler_start(&sampler, 0, 0);
        pt_check_near(label("glowing mirrors, %s", METHODS[m].name), one_path(&e, &sampler, &info).b,
                      1 / 0.28, 1e-5,
                      "emission found after a mirror counts in full, for it cannot be sampled as a light");
    }
    pt_scene_free(&s);
}

/* ---- direct light on a floor: radiance rho/pi E ----------------------------------------------------- */

/* Irradiance at the origin, normal +y, from a polygon above the horizon of radiance 1: Lambert's sum over
   edges. */
static double lambert(const pt_vec3 *v, int count)
{
    double sum = 0;
    int i;
    for (i = 0; i < count; i++) {
        const pt_vec3 p = v[i], q = v[(i + 1) % count];
        const double a[3] = {(double)p.x, (double)p.y, (double)p.z},
                     b[3] = {(double)q.x, (double)q.y, (double)q.z};
        const double c[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
        const double sine = sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]);
        sum += atan2(sine, a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) * c[1] / sine;
    }
    return fabs(sum) / 2;
}

/* The floor at the origin, seen from just above it. */
static pt_ray floor_ray(void) { return ray_from(v3(0, 0.01, 0), v3(0, -1, 0)); }

/* Checks rho/pi E (rho = 1/2) by every method; `paths` in a randomisation with light sampling. Plain tracing
   sees small lights too rarely for a tight bound. */
static void check_direct(const char *name, pt_scene *scene, double irradiance, uint64_t seed, uint32_t paths)
{
    const double share =
        irradiance / PT_PI; /* of cosine-weighted directions that meet a light of radiance 1 */
    const uint32_t plain = share > 0.25   ? 2048
                           : share > 0.15 ? 4096
                           : share > 0.1  ? 8192
                           : share > 0.02 ? 4096
                                          : 16384;
    int m;
    *scene = committed(*scene);
    for (m = 0; m < 3; m++) {
        experiment e = experiment_of(scene, floor_ray(), m);
        pt_stats s[3];
        e.options.max_edges = 2;
        by_means(&e, seed + (uint64_t)m, m == PLAIN ? plain > paths ? plain : paths : paths, s);
        pt_check_mean(
            label("%s, %s", name, METHODS[m].name), &s[0], 0.5 / PT_PI * irradiance, 1e-6 * irradiance,
            m == PLAIN && share < 0.1 ? 0.02 : 0.005, PT_TEST_MEANS,
            "direct light: density of the light sample, cosine, area against solid angle, MIS weights");
    }
    pt_scene_free(scene);
}

static int add_lamp(pt_scene *s, double radiance)
{
    return pt_add_material(s, pt_material_emitter(grey(radiance)));
}

/* A triangle that emits towards the origin. */
static void add_triangle_lamp(pt_scene *s, pt_vec3 a, pt_vec3 b, pt_vec3 c, double radiance)
{
    const pt_vec3 n = pt_v3_cross(pt_v3_sub(b, a), pt_v3_sub(c, a));
    const int away = pt_v3_dot(n, a) > 0;
    pt_add_triangle(s, a, away ? c : b, away ? b : c, add_lamp(s, radiance));
}

/* Irradiance from a sphere of radius 1 and radiance 1 at distance d in a direction beta from the normal:
   above the horizon pi cos b / d^2; partly below (cos b acos y - x w) / d^2 + atan(w / x) with x = sqrt(d^2 -
   1), y = -x / tan b, w = sin b sqrt(1 - y^2) (Snyder, Area Light Sources for Real-Time Graphics, 1996). */
static double sphere_irradiance(double d, double beta)
{
    const double x = sqrt(d * d - 1);
    double y, w;
    if (beta + asin(1 / d) <= PT_PI / 2) return PT_PI * cos(beta) / (d * d);
    y = -x / tan(beta);
    w = sin(beta) * sqrt(1 - y * y);
    return (cos(beta) * acos(y) - x * w) / (d * d) + atan(w / x);
}

static void direct_sphere(void)
{
    pt_test_source("rho/pi E, irradiance of a sphere (Snyder 1996)");
    static const double beta[5] = {0, 45, 75, 90, 105};
    int i;
    for (i = 0; i < 5; i++) {
        const double b = beta[i] * PT_PI / 180;
        pt_scene s = PT_SCENE_INIT;
        add_floor(&s, 0.5);
        pt_add_sphere(&s, v3(2 * sin(b), 2 * cos(b), 0), 1, add_lamp(&s, 1));
        check_direct(label("sphere light at %g degrees", beta[i]), &s, sphere_irradiance(2, b),
                     400 + 3 * (uint64_t)i, 512);
    }
}

/* A small and far sphere: 1 - cos of its half angle has no digits left in float. Plain tracing never finds
   it. */
static void direct_small_sphere(void)
{
    pt_test_source("rho L (r/d)^2");
    pt_scene s = PT_SCENE_INIT;
    const double exact = 0.5 * 1e12 * 1e-10 / 9; /* rho/pi * pi L (r/d)^2 */
    int m;
    add_floor(&s, 0.5);
    pt_add_sphere(&s, v3(0, 3, 0), (pt_real)1e-5, add_lamp(&s, 1e12));
    s = committed(s);
    for (m = 0; m < 3; m += 2) {
        experiment e = experiment_of(&s, floor_ray(), m);
        pt_stats means[3];
        e.options.max_edges = 2;
        by_means(&e, 420 + (uint64_t)m, 32, means);
        pt_check_mean(label("sphere light of radius 1e-5, %s", METHODS[m].name), &means[0], exact,
                      2e-6 * exact, 0.005, PT_TEST_MEANS,
                      "the solid angle of a small light is lost to cancellation");
    }
    pt_scene_free(&s);
}

static void direct_rectangle(void)
{
    pt_test_source("rho/pi E, Lambert 1760");
    /* corner, edges (which look at the floor or at the origin), irradiance; closed forms by Lambert's
       formula */
    static const struct {
        double c[3], a[3], b[3], e;
        const char *name;
    } light[] = {
        {{-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, 1.7408395027342064, "square 2 x 2 above"},
        {{0, 1, 0}, {1, 0, 0}, {0, 0, 1}, 0.4352098756835516, "square from its corner"},
        {{1, 0, -1}, {0, 0, 2}, {0, 2, 0}, 0.59732949128392144, "rectangle standing on the floor"},
        {{1, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0.35018828771389671, "rectangle half below the floor"},
    };
    size_t i;
    for (i = 0; i < sizeof light / sizeof light[0]; i++) {
        const double *c = light[i].c, *a = light[i].a, *b = light[i].b;
        pt_scene s = PT_SCENE_INIT;
        add_floor(&s, 0.5);
        pt_add_parallelogram(&s, v3(c[0], c[1], c[2]), v3(a[0], a[1], a[2]), v3(b[0], b[1], b[2]),
                             add_lamp(&s, 1));
        check_direct(light[i].name, &s, light[i].e, 430 + 3 * i, 512);
    }
}

/* A parallelogram that is no rectangle, and a quad of two triangles: the same light by two kinds of
   sampling. */
static void direct_parallelogram(void)
{
    pt_test_source("rho/pi E, Lambert 1760");
    const pt_vec3 v[4] = {v3(-0.9, 1.1, -0.4), v3(0.4, 1.4, -0.8), v3(1.5, 1.2, 0.7), v3(0.2, 0.9, 1.1)};
    int kind;
    for (kind = 0; kind < 2; kind++) {
        pt_scene s = PT_SCENE_INIT;
        add_floor(&s, 0.5);
        if (kind)
            pt_add_quad(&s, v[0], v[1], v[2], v[3], add_lamp(&s, 1));
        else
            pt_add_parallelogram(&s, v[0], pt_v3_sub(v[1], v[0]), pt_v3_sub(v[3], v[0]), add_lamp(&s, 1));
        check_direct(kind ? "quad of two triangles" : "parallelogram", &s, lambert(v, 4),
                     450 + 3 * (uint64_t)kind, 512);
    }
}

/* The triangles of tests/data/triangle_lights.csv: nine coordinates, then the irradiance. */
static void direct_triangle(void)
{
    pt_test_source("rho/pi E, tests/data/triangle_lights.csv and Lambert 1760");
    FILE *const file = fopen("tests/data/triangle_lights.csv", "r");
    char line[512];
    uint64_t row = 0;
    pt_check(file != NULL, "tests/data/triangle_lights.csv",
             "cannot be read; run in the project's top directory");
    while (file && fgets(line, sizeof line, file)) {
        pt_scene s = PT_SCENE_INIT;
        double x[10];
        char name[32];
        pt_vec3 v[3];
        int i;
        if (sscanf(line, "%31[^,],%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf,%lf", name, &x[0], &x[1], &x[2], &x[3],
                   &x[4], &x[5], &x[6], &x[7], &x[8], &x[9]) != 11)
            continue;
        for (i = 0; i < 3; i++) v[i] = v3(x[3 * i], x[3 * i + 1], x[3 * i + 2]);
        pt_check_near(label("%s, Lambert's formula", name), lambert(v, 3), x[9], 2e-7,
                      "the test's own closed form");
        add_floor(&s, 0.5);
        add_triangle_lamp(&s, v[0], v[1], v[2], 1);
        check_direct(label("triangle light %s", name), &s, x[9], 460 + 3 * row++, 512);
    }
    if (file) fclose(file);
    pt_check(row == 5, "tests/data/triangle_lights.csv", "%u of 5 rows read", (unsigned)row);
}

/* A disk of radius R, parallel to the receiver at height h and distance r from its axis: E = pi/2 (1 - (h^2 +
   r^2 - R^2) / sqrt((h^2 + r^2 + R^2)^2 - 4 r^2 R^2)). There is no disk among the shapes; it is integrated
   over its area with the disk warp. */
typedef struct disk_light {
    double radius, height, offset;
} disk_light;

static double disk_integrand(const double *u, void *user)
{
    const disk_light *const d = (const disk_light *)user;
    const pt_vec2 q =
        pt_warp_disk(pt_v2((pt_real)u[0], (pt_real)u[1])); /* density 1 / (pi R^2) after scaling */
    const double x = d->radius * (double)q.x + d->offset, z = d->radius * (double)q.y;
    const double d2 = x * x + z * z + d->height * d->height, cosine = d->height / sqrt(d2);
    return PT_PI * d->radius * d->radius * cosine * cosine / d2;
}

static void direct_disk(void)
{
    pt_test_source("irradiance of a parallel disk (Howell 2010)");
    static const disk_light light[4] = {{1, 1, 0}, {1, 1, 0.5}, {1, 2, 3}, {0.25, 1, 1}};
    int i, k;
    for (i = 0; i < 4; i++) {
        const double r = light[i].radius, h = light[i].height, o = light[i].offset,
                     sum = h * h + o * o + r * r;
        const double exact = PT_PI / 2 * (1 - (sum - 2 * r * r) / sqrt(sum * sum - 4 * o * o * r * r));
        pt_stats s = PT_STATS_INIT;
        disk_light disk = light[i];
        for (k = 0; k < UNITS; k++) {
            const uint64_t seed = pt_test_seed(480 + UNITS * (uint64_t)i + (uint64_t)k);
            const pt_integral integral = {disk_integrand,   &disk, 2, pt_test_samples(2048),
                                          PT_SAMPLER_SOBOL, seed};
            pt_estimate estimate;
            pt_estimate_mean(&integral, &estimate);
            pt_stats_add(&s, estimate.value);
        }
        pt_check_mean(label("disk of radius %g at (%g, %g)", r, o, h), &s, exact, 1e-6 * exact, 0.005,
                      PT_TEST_MEANS, "the disk warp or its density 1/pi");
    }
}

/* Flat lamps shine on the side of their normal only, spheres on both: seen from there, and by what they
   light. */
static void one_sided(void)
{
    static const char *const name[4] = {"front of flat lamps", "back of flat lamps", "sphere from outside",
                                        "sphere from inside"};
    int i, m, flat;
    for (i = 0; i < 4; i++)
        for (m = 0; m < 3; m++)
            for (flat = 0; flat < 2; flat++) {
                const pt_vec3 a = v3(-1, 1, -1), b = v3(1, 1, -1), c = v3(0, 1, 1); /* looks down */
                pt_scene s = PT_SCENE_INIT;
                experiment e = experiment_of(&s, ray_from(v3(0, 0.5, 0), v3(0.01, 1, 0.02)), m);
                pt_stats seen[3], floor[3];
                add_floor(&s, 0.5);
                if (i >= 2)
                    pt_add_sphere(&s, v3(0, i == 2 ? 2 : 0.5, 0), 1, add_lamp(&s, 1));
                else if (flat)
                    pt_add_triangle(&s, a, i ? c : b, i ? b : c, add_lamp(&s, 1));
                else
                    pt_add_parallelogram(&s, a, v3(i ? 0 : 2, 0, i ? 2 : 0), v3(i ? 2 : 0, 0, i ? 0 : 2),
                                         add_lamp(&s, 1));
                s = committed(s);
                e.options.max_edges = 2;
                by_values(&e, 780, 100, seen);
                e.ray = floor_ray();
                by_values(&e, 781, 2000, floor);
                pt_check(fabs(seen[0].mean - (i != 1)) <= 1e-6 && (floor[0].mean > 0) == (i != 1),
                         label("%s %d, %s", name[i], flat, METHODS[m].name), "radiance %g, of the floor %g",
                         seen[0].mean, floor[0].mean);
                pt_scene_free(&s);
            }
}

static void direct_point(void)
{
    pt_scene s = PT_SCENE_INIT;
    int m;
    add_floor(&s, 0.5);
    pt_add_point_light(&s, v3(1, 2, -2), pt_rgb3(9, 18, 27));
    s = committed(s);
    for (m = 0; m < 3; m++) {
        experiment e = experiment_of(&s, floor_ray(), m);
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 1, 0);
        pt_li_info info;
        pt_rgbd v;
        e.options.max_edges = 2;
        pt_sampler_start(&sampler, 0, 0);
        v = one_path(&e, &sampler, &info);
        /* d = 3, cos = 2/3: E = I (2/3) / 9. Plain paths do not find points. */
        pt_check_near(label("point light, %s, red", METHODS[m].name), v.r, m == PLAIN ? 0 : 1 / (3 * PT_PI),
                      1e-6, "I cos / d^2");
        pt_check_near(label("point light, %s, blue", METHODS[m].name), v.b, m == PLAIN ? 0 : 1 / PT_PI, 1e-6,
                      "I cos / d^2");
    }
    pt_scene_free(&s);
}

/* A floor under a white sky has its own reflectance as radiance; and lights of very different power together:
   sphere, rectangle, triangle, and a sky of which they hide their part (their surfaces are black). */
static void direct_together(void)
{
    pt_test_source("rho/pi times the sum of the irradiances");
    const pt_vec3 t[3] = {v3(-0.2, 2, 1), v3(0.5, 2.5, 1.5), v3(-0.4, 1, 2)};
    const double sphere = PT_PI * 0.25 / 8 * sqrt(0.5), square = 0.4352098756835516, triangle = lambert(t, 3);
    pt_scene sky = PT_SCENE_INIT, all = PT_SCENE_INIT;
    add_floor(&sky, 0.5);
    pt_set_environment(&sky, grey(2));
    check_direct("floor under a white sky", &sky, 2 * PT_PI, 760, 512);
    add_floor(&all, 0.5);
    pt_add_sphere(&all, v3(2, 2, 0), (pt_real)0.5, add_lamp(&all, 20));
    pt_add_parallelogram(&all, v3(-1, 1, -1), v3(1, 0, 0), v3(0, 0, 1), add_lamp(&all, 0.7));
    add_triangle_lamp(&all, t[0], t[1], t[2], 5);
    pt_set_environment(&all, grey(1));
    check_direct("four lights together", &all,
                 20 * sphere + 0.7 * square + 5 * triangle + PT_PI - sphere - square - triangle, 770, 4096);
}

/* ---- light that has been reflected more than once --------------------------------------------------- */

/* Concentric spheres, the inner one seen from outside, the outer one from inside: L1 = Le1 + rho1 L2,
   L2 = Le2 + rho2 (F L1 + (1 - F) L2), F = (r1/r2)^2. */
static void concentric_spheres(void)
{
    pt_test_source("two linear equations with the form factor (r1/r2)^2: see the test");
    static const struct {
        double r1, r2, le1, rho1, le2, rho2;
    } row[3] = {{1, 2, 1, 0.3, 0, 0.8}, {1, 3, 0, 0.5, 1, 0.5}, {0.5, 1, 2, 0, 1, 0.9}};
    static const uint32_t paths[3][3] = {{160, 256, 176}, {64, 64, 576}, {640, 320, 1408}};
    int i, m;
    for (i = 0; i < 3; i++) {
        const double f = row[i].r1 * row[i].r1 / (row[i].r2 * row[i].r2), r1 = row[i].rho1, r2 = row[i].rho2;
        const double outer = (row[i].le2 + r2 * f * row[i].le1) / (1 - r2 * (1 - f) - r2 * f * r1);
        const double inner = row[i].le1 + r1 * outer, gap = 0.5 * (row[i].r1 + row[i].r2);
        pt_scene s = PT_SCENE_INIT;
        pt_add_sphere(&s, v3(0.1, 0, 0.3), (pt_real)row[i].r1, pt_add_material(&s, glowing(r1, row[i].le1)));
        pt_add_sphere(&s, v3(0.1, 0, 0.3), (pt_real)row[i].r2, pt_add_material(&s, glowing(r2, row[i].le2)));
        s = committed(s);
        for (m = 0; m < 6; m++) {
            const pt_ray ray = ray_from(v3(0.1 + gap, 0, 0.3), v3(m % 2 ? -1 : 1, 0.05, -0.1));
            experiment e = experiment_of(&s, ray, m / 2);
            pt_stats means[3];
            e.options.roulette = PT_ROULETTE_CONSTANT;
            e.options.roulette_survival = (pt_real)(0.5 + 0.5 * r2);
            e.options.roulette_start = i == 2 ? 20 : 8;
            by_means(&e, 800 + (uint64_t)(10 * i + m), paths[i][m / 2], means);
            pt_check_mean(
                label("concentric spheres %d, %s wall, %s", i, m % 2 ? "inner" : "outer",
                      METHODS[m / 2].name),
                &means[0], m % 2 ? inner : outer, 1e-6, 0.01, PT_TEST_MEANS,
                "a sphere as a light from outside and from inside, and shadows of one on the other");
        }
        pt_scene_free(&s);
    }
}

#define EDGES 10

/* Contributions of one path by its number of edges, in three bands; what has EDGES or more stands at 0. */
typedef struct edge_tally {
    pt_rgbd by[EDGES];
} edge_tally;

static void tally_edges(void *user, const char *word, int edges, pt_rgbd value)
{
    pt_rgbd *const to = &((edge_tally *)user)->by[edges < EDGES ? edges : 0];
    (void)word;
    *to = pt_rgbd3(to->r + value.r, to->g + value.g, to->b + value.b);
}

/* Inside a diffuse sphere each point sees every other under the same kernel, so all light that was reflected
   once is spread evenly: edges m >= 3 bring rho/pi * rho Phi / (4 pi R^2) * rho^(m-3) everywhere, wherever
   the lamp. */
static void check_diffuse_sphere(pt_scene *scene, double rho, pt_vec3 lamp, pt_vec3 towards, int which,
                                 uint64_t seed)
{
    experiment e = experiment_of(scene, ray_from(v3(0, 0, 0), towards), which);
    const pt_vec3 x = e.ray.d, to = pt_v3_sub(lamp, x);
    const double d2 = (double)pt_v3_dot(to, to), first = rho * rho / (4 * PT_PI * PT_PI);
    const double direct = rho / PT_PI * (-(double)pt_v3_dot(x, to) / sqrt(d2)) / (4 * PT_PI * d2);
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, pt_test_seed(seed), 0);
    pt_stats s[4];
    const uint32_t n = pt_test_samples(rho > 0.7 ? 256 : 704);
    double worst = 0;
    uint32_t unit, i;
    int k;
    memset(s, 0, sizeof s);
    e.options.roulette = PT_ROULETTE_CONSTANT; /* late, so that the terms checked are not rare */
    e.options.roulette_survival = (pt_real)(0.5 + 0.5 * rho);
    e.options.roulette_start = 5;
    for (unit = 0; unit < UNITS; unit++) {
        edge_tally sum;
        double all = 0;
        memset(&sum, 0, sizeof sum);
        e.options.observer = tally_edges;
        e.options.observer_user = &sum;
        for (i = 0; i < n; i++) {
            pt_li_info info;
            const double before = sum.by[2].r;
            pt_sampler_start(&sampler, unit, i);
            all += one_path(&e, &sampler, &info).r - direct;
            worst = fmax(worst, fabs(sum.by[2].r - before - direct));
        }
        pt_stats_add(&s[0], all / n);
        for (k = 1; k < 4; k++) pt_stats_add(&s[k], sum.by[k + 2].r / n);
    }
    pt_check(worst <= 1e-5 * direct,
             label("diffuse sphere, rho %g, direct light, %s", rho, METHODS[which].name),
             "a path is off by %.3g of %.6g: rho/pi I cos / d^2", worst, direct);
    pt_check_mean(label("diffuse sphere, rho %g, indirect, %s", rho, METHODS[which].name), &s[0],
                  first / (1 - rho), 0, 0.02, PT_TEST_MEANS,
                  "indirect light in a sphere is the same everywhere");
    for (k = 1; k < 4; k++)
        pt_check_mean(label("diffuse sphere, rho %g, %d edges, %s", rho, k + 2, METHODS[which].name), &s[k],
                      first * pow(rho, k - 1), 0, k == 1 ? 0.01 : 0.04, PT_TEST_MEANS,
                      "the series of reflections, term by term");
}

static void diffuse_sphere(void)
{
    pt_test_source("the kernel of a sphere is constant: rho^2 Phi / (4 pi^2 R^2 (1 - rho)) (Jacquez and "
                   "Kuppenheim 1955)");
    static const double towards[3][3] = {{0.55, 0.3, -0.35}, {-1, 0.2, 0.1}, {0, -1, 0.3}};
    const pt_vec3 lamp = v3(0.6, 0.2, -0.3), other = v3(-0.1, 0.3, 0.2);
    pt_scene canonical = PT_SCENE_INIT, bright = PT_SCENE_INIT;
    pt_camera camera;
    int i;
    pt_check(pt_scene_diffuse_sphere(&canonical, &camera) == PT_OK, "pt_scene_diffuse_sphere", "%s",
             pt_scene_error(&canonical));
    pt_add_sphere(&bright, v3(0, 0, 0), 1, pt_add_material(&bright, pt_material_diffuse(grey(0.8))));
    pt_add_point_light(&bright, other, grey(1 / (4 * PT_PI)));
    bright = committed(bright);
    for (i = 0; i < 3; i++) {
        const pt_vec3 d = v3(towards[i][0], towards[i][1], towards[i][2]);
        check_diffuse_sphere(&canonical, 0.5, lamp, d, i == 1 ? LIGHT : PATH, 850 + (uint64_t)i);
    }
    check_diffuse_sphere(&bright, 0.8, other, v3(0.2, 1, 0.4), PATH, 860);
    {
        experiment e = experiment_of(&canonical, ray_from(v3(0, 0, 0), v3(1, 0, 0)), PLAIN);
        pt_stats s[3];
        by_values(&e, 861, 1000, s);
        pt_check(s[0].mean == 0 && s[0].m2 == 0, "diffuse sphere, plain", "a point was found by chance: %g",
                 s[0].mean);
    }
    pt_scene_free(&bright);
    pt_scene_free(&canonical);
}

/* ---- the Cornell box against a reference computed by another program -------------------------------- */

#define PROBES 12

typedef struct cornell_row {
    double u, v, hit[3], rgb[3], se[3];
} cornell_row;

typedef struct cornell_reference {
    cornell_row probe[PROBES], image;
    double bounce[24][3];
    int probes, bounces, images;
} cornell_reference;

/* Reads tests/data/cornell_reference.csv; its columns are explained in its first lines. */
static void cornell_read(cornell_reference *r)
{
    FILE *const file = fopen("tests/data/cornell_reference.csv", "r");
    char line[512];
    memset(r, 0, sizeof *r);
    while (file && fgets(line, sizeof line, file)) {
        cornell_row row;
        int k;
        if (sscanf(line, "%d,%lf,%lf,%lf,%lf,%lf,%*d,%*[^,],%lf,%lf,%lf,%lf,%lf,%lf", &k, &row.u, &row.v,
                   &row.hit[0], &row.hit[1], &row.hit[2], &row.rgb[0], &row.rgb[1], &row.rgb[2], &row.se[0],
                   &row.se[1], &row.se[2]) == 12 &&
            k >= 0 && k < PROBES) {
            r->probe[k] = row;
            r->probes++;
        } else if (sscanf(line, "image_mean,,,,,,,,%lf,%lf,%lf,%lf,%lf,%lf", &row.rgb[0], &row.rgb[1],
                          &row.rgb[2], &row.se[0], &row.se[1], &row.se[2]) == 6) {
            r->image = row;
            r->images++;
        } else if (sscanf(line, "bounce,%d,,,,,,,%lf,%lf,%lf", &k, &row.rgb[0], &row.rgb[1], &row.rgb[2]) ==
                       4 &&
                   k >= 0 && k < 24) {
            memcpy(r->bounce[k], row.rgb, sizeof row.rgb);
            r->bounces++;
        }
    }
    if (file) fclose(file);
    pt_check(r->probes == PROBES && r->images == 1 && r->bounces == 24, "tests/data/cornell_reference.csv",
             "%d probes, %d image means, %d bounces read; run in the project's top directory", r->probes,
             r->images, r->bounces);
}

/* The values have six digits behind the point: an error of at most half a unit, taken in full. */
static double reference_error(double se)
{
    const double rounding = 5e-7, e = fmax(se, rounding);
    return sqrt(e * e + rounding * rounding);
}

/* Film point (u,v) in [-1/2,1/2]^2, v upwards, is image point (1/2 + u, 1/2 - v). */
static pt_ray probe_ray(const pt_camera *camera, const cornell_row *row)
{
    return pt_camera_ray(camera, 1, (pt_real)(0.5 + row->u), (pt_real)(0.5 - row->v), pt_v2(0, 0));
}

static void cornell_probes(void)
{
    pt_test_source("tests/data/cornell_reference.csv: another program, with its standard errors");
    static const char *const band[3] = {"red", "green", "blue"};
    /* Paths in a randomisation; more where little light arrives. Probe 1 gains nothing by Sobol points and by
       a late roulette, and takes independent paths. */
    static const uint32_t paths[PROBES] = {640, 2500000, 640,  768,   384, 320,
                                           896, 1536,    1024, 28672, 768, 448};
    cornell_reference reference;
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    int k, b;
    cornell_read(&reference);
    pt_check(pt_scene_cornell(&scene, &camera) == PT_OK, "pt_scene_cornell", "%s", pt_scene_error(&scene));
    for (k = 0; k < reference.probes; k++) {
        const cornell_row *const row = &reference.probe[k];
        experiment e = experiment_of(&scene, probe_ray(&camera, row), PATH);
        pt_stats s[3];
        pt_hit hit;
        const int met = pt_intersect(&scene, &e.ray, &hit);
        pt_check(met && fabs((double)hit.p.x - row->hit[0]) < 2e-3 &&
                     fabs((double)hit.p.y - row->hit[1]) < 2e-3 && fabs((double)hit.p.z - row->hit[2]) < 2e-3,
                 label("Cornell probe %d meets its point", k), "(%g, %g, %g) instead of (%g, %g, %g)",
                 (double)hit.p.x, (double)hit.p.y, (double)hit.p.z, row->hit[0], row->hit[1], row->hit[2]);
        e.options.roulette_start = k == 1 ? 3 : 6; /* half the variance of 3 behind the tall block */
        (k == 1 ? by_values : by_means)(&e, 900 + (uint64_t)k, paths[k], s);
        for (b = 0; b < 3; b++)
            pt_check_mean(label("Cornell probe %d, %s", k, band[b]), &s[b], row->rgb[b],
                          reference_error(row->se[b]), 0.02, k == 1 ? PT_TEST_VALUES : PT_TEST_MEANS,
                          "geometry, reflectances, lamp or transport of the Cornell box");
    }
    pt_scene_free(&scene);
}

/* The part of the picture that the lamp covers, from its corners seen from (278, 273, -800) with a film of 25
   mm at 35 mm; nothing stands before it. */
static double cornell_lamp_share(void)
{
    static const double x[4] = {343, 343, 213, 213}, z[4] = {227, 332, 332, 227};
    double u[4], v[4], area = 0;
    int i;
    for (i = 0; i < 4; i++) {
        u[i] = -(x[i] - 278) / (z[i] + 800) * 35 / 25;
        v[i] = (548.79 - 273) / (z[i] + 800) * 35 / 25;
    }
    for (i = 0; i < 4; i++) area += 0.5 * (u[i] * v[(i + 1) % 4] - u[(i + 1) % 4] * v[i]);
    return fabs(area);
}

/* The picture's mean by number of edges. The reference's own error is taken from the spread seen here, for
   its 40 million paths, and from the six digits of each row. Rows from the fifth bounce on are checked as
   one. */
static void check_bounces(const cornell_reference *reference, const pt_stats s[6])
{
    static const double bound[6] = {0, 0.015, 0.03, 0.03, 0.06, 0.07};
    double later = 0;
    int k;
    for (k = 1; k < 5; k++)
        pt_check_mean(label("Cornell, bounce %d", k), &s[k], reference->bounce[k][0],
                      reference_error(sqrt(pt_stats_variance(&s[k]) / 4e7)), bound[k], PT_TEST_VALUES,
                      "light of one path length: max_edges, or a factor of each reflection");
    for (k = 5; k < 24; k++) later += reference->bounce[k][0];
    pt_check_mean("Cornell, bounce 5 and later", &s[5], later,
                  sqrt(pt_stats_variance(&s[5]) / 4e7 + 19 * 2.5e-13), bound[5], PT_TEST_VALUES,
                  "long paths: roulette");
    pt_check_mean("Cornell, mean without the lamp, green", &s[0],
                  reference->image.rgb[1] - reference->bounce[0][1],
                  reference_error(sqrt(pt_stats_variance(&s[0]) / 4e7)), 0.02, PT_TEST_VALUES,
                  "all bounces together: does green alone fail? then a reflectance, else the transport");
}

static void cornell_bounces(void)
{
    pt_test_source("tests/data/cornell_reference.csv: another program, with its standard errors");
    const uint32_t n = pt_test_all_samples(1000000);
    cornell_reference reference;
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(920), 0);
    pt_stats s[6];
    experiment e;
    edge_tally tally;
    uint32_t i;
    memset(s, 0, sizeof s);
    cornell_read(&reference);
    pt_check(pt_scene_cornell(&scene, &camera) == PT_OK, "pt_scene_cornell", "%s", pt_scene_error(&scene));
    e = experiment_of(&scene, *furnace_ray(), PATH);
    e.camera = &camera;
    e.options.observer = tally_edges;
    e.options.observer_user = &tally;
    for (i = 0; i < n; i++) {
        pt_li_info info;
        pt_rgbd v;
        int k;
        memset(&tally, 0, sizeof tally);
        pt_sampler_start(&sampler, 0, i);
        v = one_path(&e, &sampler, &info);
        for (k = 1; k < 5; k++) pt_stats_add(&s[k], tally.by[k + 1].r);
        pt_stats_add(&s[5],
                     v.r - tally.by[1].r - tally.by[2].r - tally.by[3].r - tally.by[4].r - tally.by[5].r);
        pt_stats_add(&s[0], v.g - tally.by[1].g);
    }
    check_bounces(&reference, s);
    pt_scene_free(&scene);
}

/* The lamp itself, seen directly: its share of the picture times its radiance. */
static void cornell_lamp(void)
{
    pt_test_source("area of the lamp in the picture, by its projected corners, times its radiance");
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    pt_stats s[3];
    experiment e;
    pt_check(pt_scene_cornell(&scene, &camera) == PT_OK, "pt_scene_cornell", "%s", pt_scene_error(&scene));
    e = experiment_of(&scene, *furnace_ray(), PATH);
    e.camera = &camera;
    e.options.max_edges = 1;
    by_means(&e, 921, 16384, s);
    pt_check_mean("Cornell, the lamp in the picture, red", &s[0], cornell_lamp_share() * 20.711595, 1e-6,
                  0.02, PT_TEST_MEANS, "the camera, or the lamp's place, size or radiance");
    pt_check_mean("Cornell, the lamp in the picture, blue", &s[2], cornell_lamp_share() * 2.770784, 1e-6,
                  0.02, PT_TEST_MEANS, "the lamp's spectrum");
    pt_scene_free(&scene);
}

/* ---- methods that must agree ------------------------------------------------------------------------ */

/* A closed room with coloured walls, a mirror ball and a glass ball under a lamp that is most of the ceiling:
   light is found by luck often enough for plain tracing. */
static pt_scene room(void)
{
    pt_scene s = PT_SCENE_INIT;
    const int white =
        pt_add_material(&s, pt_material_diffuse(pt_rgb3((pt_real)0.7, (pt_real)0.65, (pt_real)0.6)));
    const int red =
        pt_add_material(&s, pt_material_diffuse(pt_rgb3((pt_real)0.6, (pt_real)0.3, (pt_real)0.2)));
    pt_material lamp = pt_material_diffuse(grey(0.5));
    lamp.emission = pt_rgb3(1, (pt_real)0.9, (pt_real)0.8);
    pt_add_parallelogram(&s, v3(-1, 0, -1), v3(0, 0, 2), v3(2, 0, 0), white);
    pt_add_parallelogram(&s, v3(-1, 2, -1), v3(2, 0, 0), v3(0, 0, 2), white);
    pt_add_parallelogram(&s, v3(-1, 0, -1), v3(0, 2, 0), v3(0, 0, 2), red);
    pt_add_parallelogram(&s, v3(1, 0, -1), v3(0, 0, 2), v3(0, 2, 0), white);
    pt_add_quad(&s, v3(-1, 0, -1), v3(1, 0, -1), v3(1, 2, -1), v3(-1, 2, -1), white);
    pt_add_quad(&s, v3(-1, 0, 1), v3(-1, 2, 1), v3(1, 2, 1), v3(1, 0, 1), red);
    pt_add_parallelogram(&s, v3(-0.9, 1.99, -0.9), v3(1.8, 0, 0), v3(0, 0, 1.8), pt_add_material(&s, lamp));
    pt_add_sphere(&s, v3(-0.4, 0.35, -0.4), (pt_real)0.35,
                  pt_add_material(&s, pt_material_mirror(grey(0.9))));
    pt_add_sphere(&s, v3(0.4, 0.4, 0.2), (pt_real)0.35,
                  pt_add_material(&s, pt_material_dielectric((pt_real)1.5)));
    return committed(s);
}

/* The scene of pt_scene_glass_ball with a lamp of radius 1.8 instead of 0.1. There the caustic is found
   hundreds of times more rarely than here, and a mean of values so skewed cannot be tested with an honest
   number of paths. */
static pt_scene glass_ball_large_lamp(void)
{
    pt_scene s = PT_SCENE_INIT;
    pt_add_parallelogram(&s, v3(-4, 0, -4), v3(0, 0, 8), v3(8, 0, 0),
                         pt_add_material(&s, pt_material_diffuse(grey(0.8))));
    pt_add_sphere(&s, v3(0, 0.5, 0), (pt_real)0.4, pt_add_material(&s, pt_material_dielectric((pt_real)1.5)));
    pt_add_sphere(&s, v3(1.5, 3, 0), (pt_real)1.8, pt_add_material(&s, pt_material_emitter(grey(1))));
    return committed(s);
}

/* What a path brings but the lamps that are seen directly: their share of the picture is no question of
   method, and its noise would hide the rest. */
static void tally_reflected(void *user, const char *word, int edges, pt_rgbd value)
{
    pt_rgbd *const to = (pt_rgbd *)user;
    (void)word;
    if (edges > 1) *to = pt_rgbd3(to->r + value.r, to->g + value.g, to->b + value.b);
}

/* UNITS randomised means of reflected light over a picture, in three bands. */
static void picture_means(const pt_scene *scene, const pt_camera *camera, const pt_li_options *options,
                          int which, uint64_t seed, uint32_t n, pt_observer observer, pt_stats out[3])
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, pt_test_seed(seed), 0);
    experiment e = experiment_of(scene, *furnace_ray(), which);
    pt_li_info info;
    uint32_t unit, i;
    pt_rgbd sum;
    memset(out, 0, 3 * sizeof *out);
    n = pt_test_samples(n);
    if (options) e.options = *options;
    e.camera = camera;
    e.options.observer = observer;
    e.options.observer_user = &sum;
    for (unit = 0; unit < UNITS; unit++) {
        sum = pt_rgbd3(0, 0, 0);
        for (i = 0; i < n; i++) {
            pt_sampler_start(&sampler, unit, i);
            one_path(&e, &sampler, &info);
        }
        add_rgb(out, pt_rgbd3(sum.r / n, sum.g / n, sum.b / n));
    }
}

/* The same picture by two methods; paths of up to `edges` edges, enough for every way to find a light. The
   three bands go together; the bound is that of the middle one. */
static void check_agree(const char *name, const pt_scene *scene, const pt_camera *camera, int edges, int a,
                        int b, uint64_t seed, uint32_t na, uint32_t nb, double bound)
{
    static const char *const band[3] = {"red", "green", "blue"};
    pt_li_options options;
    pt_stats sa[3], sb[3];
    int k;
    memset(&options, 0, sizeof options);
    options.max_edges = edges;
    options.roulette = PT_ROULETTE_NONE;
    picture_means(scene, camera, &options, a, seed, na, tally_reflected, sa);
    picture_means(scene, camera, &options, b, seed + 1, nb, tally_reflected, sb);
    for (k = 0; k < 3; k++)
        pt_check_equal_means(label("%s: %s = %s, %s", name, METHODS[a].name, METHODS[b].name, band[k]),
                             &sa[k], &sb[k], k == 1 ? bound : 0,
                             "two ways to find the same light disagree: densities or MIS weights");
}

static void agreement_rooms(void)
{
    pt_test_source("the other method");
    const pt_camera inside = pt_camera_look_at(v3(0.3, 1.3, 0.9), v3(-0.1, 0.5, -0.3), v3(0, 1, 0), 75);
    const pt_camera ball = pt_camera_look_at(v3(0, 1.2, 3.2), v3(0, 0.3, 0), v3(0, 1, 0), 40);
    pt_scene closed = room(), caustic = glass_ball_large_lamp();
    check_agree("room", &closed, &inside, 5, PATH, PLAIN, 1000, 1792, 5120, 0.02);
    check_agree("room", &closed, &inside, 5, PATH, LIGHT, 1002, 1280, 1280, 0.02);
    check_agree("glass ball, large lamp", &caustic, &ball, 6, PATH, PLAIN, 1004, 3072, 10240, 0.02);
    check_agree("glass ball, large lamp", &caustic, &ball, 6, PATH, LIGHT, 1006, 2048, 2048, 0.02);
    pt_scene_free(&closed);
    pt_scene_free(&caustic);
}

/* The canonical scenes. Where one method needs too many paths for every day, the bound is wide, and LONG=1
   has the narrow one. */
static void agreement_scenes(void)
{
    pt_test_source("the other method");
    static const struct {
        char name[16];
        int edges;
        uint32_t paths, more;
        double bound;
    } scenes[5] = {{"cornell", 4, 2048, 16384, 0.02},
                   {"cornell-empty", 4, 512, 16384, 0.02},
                   {"cornell-spheres", 6, 1792, 32768, 0.1},
                   {"smallpt", 6, 640, 65536, 0.25},
                   {"diffuse-sphere", 4, 256, 4096, 0.02}};
    const int patient = pt_test_long();
    int i;
    for (i = 0; i < 5; i++) {
        const pt_scene_entry *const entry = pt_scene_find(scenes[i].name);
        const uint32_t n = patient ? scenes[i].more : scenes[i].paths;
        const uint64_t seed = 1010 + 4 * (uint64_t)i;
        pt_scene scene = PT_SCENE_INIT;
        pt_camera camera;
        pt_check(entry != NULL, label("scene %s", scenes[i].name), "is not in the table");
        if (!entry) continue;
        pt_check(entry->make(&scene, &camera) == PT_OK, entry->name, "%s", pt_scene_error(&scene));
        check_agree(entry->name, &scene, &camera, patient ? 8 : scenes[i].edges, PATH, LIGHT, seed, n, n,
                    patient ? 0.02 : scenes[i].bound);
        if (i < 2 && patient)
            check_agree(entry->name, &scene, &camera, 6, PATH, PLAIN, seed + 2, n, 10 * n, 0.02);
        pt_scene_free(&scene);
    }
}

/* Contributions without caustics: no word with a diffuse reflection after a specular one, from the light
   on. */
static void tally_no_caustics(void *user, const char *word, int edges, pt_rgbd value)
{
    const int caustic = word[0] == '*' || (word[1] == 'S' && strchr(word, 'D') != NULL);
    if (!caustic) tally_reflected(user, word, edges, value);
}

/* The canonical glass ball: all but its caustic, which both methods find in the same way, rarely. */
static void agreement_glass_ball(void)
{
    pt_test_source("the other method");
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    pt_stats a[3], b[3];
    pt_check(pt_scene_glass_ball(&scene, &camera) == PT_OK, "pt_scene_glass_ball", "%s",
             pt_scene_error(&scene));
    picture_means(&scene, &camera, NULL, PATH, 1040, pt_test_long() ? 98304 : 2560, tally_no_caustics, a);
    picture_means(&scene, &camera, NULL, LIGHT, 1041, pt_test_long() ? 98304 : 2560, tally_no_caustics, b);
    pt_check_equal_means("glass ball without its caustic: path = light", &a[1], &b[1],
                         pt_test_long() ? 0.02 : 0.1, "shadows, or light seen in glass");
    pt_scene_free(&scene);
}

/* The heuristics weigh differently and have the same mean. */
static void heuristics(void)
{
    pt_test_source("the power heuristic");
    static const char *const name[3] = {"power", "balance", "maximum"};
    const pt_camera inside = pt_camera_look_at(v3(0.3, 1.3, 0.9), v3(-0.1, 0.5, -0.3), v3(0, 1, 0), 75);
    pt_scene scene = room();
    pt_stats s[3][3];
    pt_li_options options;
    int k;
    memset(&options, 0, sizeof options);
    options.max_edges = 3;
    options.roulette = PT_ROULETTE_NONE;
    for (k = 0; k < 3; k++) {
        options.heuristic = (pt_heuristic)k;
        picture_means(&scene, &inside, &options, PATH, 1050 + (uint64_t)k, 1536, tally_reflected, s[k]);
    }
    for (k = 1; k < 3; k++)
        pt_check_equal_means(label("power = %s heuristic", name[k]), &s[0][1], &s[k][1], 0.02,
                             "the weights of the techniques do not sum to 1");
    pt_scene_free(&scene);
}

/* ---- order of convergence --------------------------------------------------------------------------- */

/* Absolute errors of `runs` independent estimates, each of n paths, of direct light from the square above. */
static pt_stats absolute_errors(pt_sampler_kind kind, uint64_t seed, uint32_t runs, uint32_t n)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_sampler sampler = pt_sampler_make(kind, pt_test_seed(seed), n);
    experiment e = experiment_of(&scene, floor_ray(), LIGHT);
    pt_stats errors = PT_STATS_INIT;
    uint32_t run, i;
    add_floor(&scene, 0.5);
    pt_add_parallelogram(&scene, v3(-1, 1, -1), v3(2, 0, 0), v3(0, 0, 2), add_lamp(&scene, 1));
    scene = committed(scene);
    e.options.max_edges = 2;
    for (run = 0; run < runs; run++) {
        double sum = 0;
        for (i = 0; i < n; i++) {
            pt_li_info info;
            pt_sampler_start(&sampler, run, i);
            sum += one_path(&e, &sampler, &info).r;
        }
        pt_stats_add(&errors, fabs(sum / n - 0.5 / PT_PI * 1.7408395027342064));
    }
    pt_scene_free(&scene);
    return errors;
}

static pt_stats scaled(pt_stats s, double k)
{
    s.mean *= k;
    s.m2 *= k * k;
    s.m3 *= k * k * k;
    return s;
}

/* Independent samples: error times sqrt N is constant, which says the order is -1/2. A difference of 20 %
   between 16 and 512 samples would be an order wrong by ln 1.2 / ln 32 = 0.05. */
static void one_over_root_n(void)
{
    pt_test_source("order -1/2: error times root of n is constant");
    const uint32_t runs = pt_test_samples(2000); /* as many of each: then their skewness cancels */
    const pt_stats few = scaled(absolute_errors(PT_SAMPLER_INDEPENDENT, 1100, runs, 16), 4);
    const pt_stats many = scaled(absolute_errors(PT_SAMPLER_INDEPENDENT, 1101, runs, 512), sqrt(512));
    pt_check_equal_means("error falls as 1/sqrt(N)", &few, &many, 0.2, "samples that are not independent");
}

/* Sobol and stratified points on the same smooth integrand: at 1024 samples the error is far smaller, by at
   least the factor 5 (N^-1 of jittered strata would be 32, N^-3/2 more). */
static void better_than_random(void)
{
    const double random = absolute_errors(PT_SAMPLER_INDEPENDENT, 1102, 200, 1024).mean;
    const double sobol = absolute_errors(PT_SAMPLER_SOBOL, 1103, 200, 1024).mean;
    const double stratified = absolute_errors(PT_SAMPLER_STRATIFIED, 1104, 200, 1024).mean;
    pt_check(5 * sobol < random, "Sobol beats random on a smooth integrand", "errors %.3g and %.3g", sobol,
             random);
    pt_check(5 * stratified < random, "strata beat random on a smooth integrand", "errors %.3g and %.3g",
             stratified, random);
}

/* ---- the observer: words of the light-path alphabet ------------------------------------------------- */

typedef struct word_log {
    const char *allowed[4]; /* words that may be seen; NULL ends the list                            */
    int seen[4];            /* how often                                                             */
    int strange, lengths;   /* other words; words whose edges are not their letters less one         */
    char example[PT_WORD_MAX + 8];
    pt_rgbd sum;          /* of all values                                                         */
    double first, second; /* green, of one edge and of two                                         */
    int negative;         /* values below zero                                                     */
} word_log;

static void log_word(void *user, const char *word, int edges, pt_rgbd value)
{
    word_log *const log = (word_log *)user;
    const size_t length = strlen(word);
    int i, known = log->allowed[0] == NULL;
    for (i = 0; i < 4 && log->allowed[i] != NULL; i++) {
        if (strcmp(word, log->allowed[i]) != 0) continue;
        log->seen[i] += value.g > 0;
        known = 1;
    }
    if (!known && value.g > 0) {
        log->strange++;
        strncpy(log->example, word, sizeof log->example - 1);
    }
    log->lengths +=
        word[0] != '*' ? length != (size_t)edges + 1 || word[0] != 'L' : length != PT_WORD_MAX + 2;
    log->lengths += length == 0 || word[length - 1] != 'E' || strspn(word, "*LDGSE") != length;
    log->sum = pt_rgbd3(log->sum.r + value.r, log->sum.g + value.g, log->sum.b + value.b);
    if (edges <= 2) *(edges == 1 ? &log->first : &log->second) += value.g;
    log->negative += value.r < 0 || value.g < 0 || value.b < 0;
}

/* 400 paths along one ray: only these words, and each of them. */
static void check_words(const char *name, const pt_scene *scene, pt_ray ray, int max_edges,
                        const char *const allowed[4])
{
    experiment e = experiment_of(scene, ray, PATH);
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 7, 0);
    word_log log;
    uint32_t i;
    int k, missing = 0;
    memset(&log, 0, sizeof log);
    for (k = 0; k < 4; k++) log.allowed[k] = allowed[k];
    e.options.max_edges = max_edges;
    e.options.observer = log_word;
    e.options.observer_user = &log;
    for (i = 0; i < 400; i++) {
        pt_li_info info;
        pt_sampler_start(&sampler, 0, i);
        one_path(&e, &sampler, &info);
    }
    for (k = 0; k < 4 && allowed[k] != NULL; k++) missing += log.seen[k] == 0;
    pt_check(missing == 0 && log.strange == 0 && log.lengths == 0 && log.negative == 0,
             label("words: %s", name),
             "%d expected words missing, %d others (such as %s), %d of a wrong length", missing, log.strange,
             log.example, log.lengths);
}

static void words(void)
{
    static const char *const le[4] = {"LE"}, *const lse[4] = {"LSE"}, *const lde[4] = {"LDE"},
                             *const ldse[4] = {"LDSE"};
    static const char *const ball[4] = {"LSE", "LSSE", "LSSSE"}, *const caustic[4] = {"LSSDE", "LDSDE"};
    static const char *const furnace[4] = {"LE", "LDE", "LDDE"};
    pt_scene s = PT_SCENE_INIT;
    add_floor(&s, 0.5);
    pt_add_sphere(&s, v3(0, 0.5, 0), (pt_real)0.4, pt_add_material(&s, pt_material_dielectric((pt_real)1.5)));
    pt_add_parallelogram(&s, v3(-2, 4, -2), v3(4, 0, 0), v3(0, 0, 4), add_lamp(&s, 1));
    s = committed(s);
    check_words("the lamp", &s, ray_from(v3(0.5, 2, 0.5), v3(0, 1, 0)), 1, le);
    check_words("the floor", &s, ray_from(v3(-3, 1, 0), v3(-0.1, -1, 0)), 2, lde);
    check_words("the floor under the glass ball", &s, ray_from(v3(0.1, 0.05, 0), v3(0, -1, 0)), 4, caustic);
    pt_add_parallelogram(&s, v3(5, 0, -2), v3(0, 0, 4), v3(0, 4, 0),
                         pt_add_material(&s, pt_material_mirror(grey(1))));
    s = committed(s);
    check_words("the lamp in a mirror", &s, ray_from(v3(2.5, 1, 0), v3(2.5, 1, 0)), 3, lse);
    check_words("the floor in a mirror", &s, ray_from(v3(4, 1.5, 1.5), v3(1, -0.6, 0)), 3, ldse);
    pt_scene_free(&s);
    s = furnace_box(0.5);
    check_words("furnace of three edges", &s, *furnace_ray(), 3, furnace);
    pt_scene_free(&s);
    s = object_scene(GLASS_BALL, 1.5, 0);
    check_words("glass ball under the sky", &s, ray_from(v3(0.3, 0, 3), v3(0, 0, -1)), 4, ball);
    pt_scene_free(&s);
}

/* One path of a picture, from the same random numbers with other options. */
static pt_rgbd again(experiment e, pt_sampler *sampler, uint32_t index, word_log *log, int max_edges)
{
    pt_li_info info;
    e.options.observer = log ? log_word : NULL;
    e.options.observer_user = log;
    e.options.max_edges = max_edges;
    pt_sampler_start(sampler, 3, index);
    return one_path(&e, sampler, &info);
}

/* Path by path: values sum to the radiance, observing changes nothing, and the words of up to two edges are
   what max_edges = 2 gives, those of one what max_edges = 1 gives (the first roulette comes later): LDE is
   the difference of the two. */
static void observer_sums(void)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    int m;
    pt_check(pt_scene_cornell_spheres(&scene, &camera) == PT_OK, "pt_scene_cornell_spheres", "%s",
             pt_scene_error(&scene));
    for (m = 0; m < 3; m++) {
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, pt_test_seed(1200), 0);
        experiment e = experiment_of(&scene, *furnace_ray(), m);
        double sums = 0, parts = 0;
        int changed = 0, lengths = 0;
        uint32_t i;
        e.camera = &camera;
        for (i = 0; i < 4000; i++) {
            word_log log;
            pt_rgbd v, w;
            memset(&log, 0, sizeof log);
            v = again(e, &sampler, i, &log, 0);
            w = again(e, &sampler, i, NULL, 0);
            changed += memcmp(&v, &w, sizeof v) != 0;
            lengths += log.lengths;
            sums = fmax(sums, fabs(log.sum.g - v.g) / (fabs(v.g) + 1e-9));
            v = again(e, &sampler, i, NULL, 1);
            w = again(e, &sampler, i, NULL, 2);
            parts = fmax(parts, fmax(fabs(log.first - v.g), fabs(log.second - (w.g - v.g))) / (w.g + 1e-9));
        }
        pt_check(changed == 0, label("observing changes no number, %s", METHODS[m].name),
                 "%d of 4000 paths differ", changed);
        pt_check(sums <= 1e-12, label("values of a path sum to its radiance, %s", METHODS[m].name),
                 "off by %.3g of it", sums);
        pt_check(parts <= 1e-12, label("LE and LDE by max_edges, %s", METHODS[m].name), "off by %.3g", parts);
        pt_check(lengths == 0, label("edges are letters less one, %s", METHODS[m].name), "%d words are not",
                 lengths);
    }
    pt_scene_free(&scene);
}

/* A path ends where its throughput is zero: between a red and a green mirror after two reflections. */
static void red_then_green(void)
{
    pt_scene scene = PT_SCENE_INIT;
    const int red = pt_add_material(&scene, pt_material_mirror(pt_rgb3(1, 0, 0))),
              green = pt_add_material(&scene, pt_material_mirror(pt_rgb3(0, 1, 0)));
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 1, 0);
    const pt_ray ray = ray_from(v3(0.1, 0.2, 0), v3(0, 0, 1));
    pt_li_options options;
    pt_li_info info;
    memset(&options, 0, sizeof options);
    memset(&info, 0, sizeof info);
    options.roulette = PT_ROULETTE_NONE;
    options.max_edges = 50;
    pt_add_parallelogram(&scene, v3(-1, -1, 1), v3(2, 0, 0), v3(0, 2, 0), red);
    pt_add_parallelogram(&scene, v3(-1, -1, -1), v3(2, 0, 0), v3(0, 2, 0), green);
    scene = committed(scene);
    pt_li_path(&scene, &ray, &sampler, &options, &info);
    pt_check(info.edges == 2 && info.rays == 2, "red, then green", "%d edges, %d rays", info.edges, (int)info.rays);
    pt_scene_free(&scene);
}

/* Words of more than PT_WORD_MAX letters between L and E begin with '*'; their values are all there. */
static void count_long(void *user, const char *word, int edges, pt_rgbd value)
{
    double *const t = (double *)user;
    const size_t length = strlen(word);
    t[0] += value.r;
    t[1] += edges - 1 > PT_WORD_MAX &&
            (word[0] != '*' || length != PT_WORD_MAX + 2 || word[length - 1] != 'E' || word[1] != 'D');
    t[2] += edges - 1 <= PT_WORD_MAX && (word[0] != 'L' || length != (size_t)edges + 1);
    t[2] += strspn(word + 1, "D") + 2 != length && strspn(word + 1, "S") + 2 != length;
    t[3] += edges - 1 > PT_WORD_MAX;
}

static void long_words(void)
{
    pt_scene scene = furnace_sphere(v3(0, 0, 0), 1, 0.99);
    experiment e = experiment_of(&scene, *furnace_ray(), PLAIN);
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 1, 0);
    double t[4] = {0, 0, 0, 0};
    pt_li_info info;
    int kind;
    e.options.max_edges = 200;
    e.options.roulette = PT_ROULETTE_NONE;
    e.options.observer = count_long;
    e.options.observer_user = t;
    pt_sampler_start(&sampler, 0, 0);
    one_path(&e, &sampler, &info);
    pt_check(t[1] == 0 && t[2] == 0 && t[3] == 199 - PT_WORD_MAX, "words of 200 edges",
             "%g long and %g short words wrong, %g long", t[1], t[2], t[3]);
    pt_check_near("values of 200 edges", t[0], (1 - pow(0.99, 200)) / 0.01, 1e-3,
                  "long words lose their values");
    /* Between mirrors first: should a letter of the next walk not be written, it finds an S there. */
    for (kind = 0; kind < 2; kind++) {
        scene.materials[0].kind = kind ? PT_MATERIAL_DIFFUSE : PT_MATERIAL_MIRROR;
        e.li = kind ? pt_li_path_light : pt_li_path_plain;
        memset(t, 0, sizeof t);
        pt_sampler_start(&sampler, 0, 0);
        one_path(&e, &sampler, &info);
        pt_check(t[1] + t[2] <= (kind ? 0 : 199) && t[2] == 0 && t[3] > 130, kind ? "words, light sampled" : "words of mirrors",
                 "%g long and %g short words wrong, %g long", t[1], t[2], t[3]);
    }
    pt_scene_free(&scene);
}

/* ---- negative controls: estimators known to be wrong must be found wrong ---------------------------- */

typedef enum mistake {
    RIGHT,           /* no mistake: must pass                                                       */
    MEAN_OF_BOTH,    /* half of each technique: noisy, yet right, and must pass                     */
    TWICE,           /* light found by both techniques, each counted in full                        */
    WEIGHTS_NOT_ONE, /* power heuristic for one technique, full weight for the other                */
    AREA_AS_ANGLE,   /* density per area used as if it were per solid angle                         */
    NO_COSINE,       /* cosine at the receiver forgotten                                            */
    NO_CHOICE,       /* probability of the choice of the light forgotten                            */
    NO_REWEIGHT,     /* roulette: survivors not divided by their probability                        */
    NO_ETA           /* radiance not scaled by eta^2 at refraction                                  */
} mistake;

/* A value and its weight by multiple importance sampling. */
typedef struct weighted {
    double value, weight;
} weighted;

/* Direct light at the hit by asking a point of a light, grey. */
static weighted light_by_hand(const pt_scene *scene, const pt_hit *hit, const pt_bsdf *bsdf, pt_vec3 wo,
                              double u_choice, pt_vec2 u, mistake wrong)
{
    weighted result = {0, 1};
    pt_light_sample_result light;
    double pmf, pdf, cosine;
    const int which = pt_light_choose(scene, u_choice, &pmf);
    pt_ray shadow;
    if (wrong == NO_CHOICE) pmf = 1;
    if (!pt_light_sample(scene, which, hit->p, u, &light)) return result;
    cosine = wrong == NO_COSINE ? 1 : fabs((double)pt_v3_dot(light.wi, hit->ng));
    pdf = wrong == AREA_AS_ANGLE ? 1 / scene->lights[which].area : (double)light.pdf_w;
    shadow = pt_spawn_ray_to(hit->p, hit->p_error, hit->ng, light.p, light.p_error, light.n);
    if (!pt_occluded(scene, &shadow))
        result.value = (double)pt_bsdf_eval(bsdf, wo, light.wi, PT_RADIANCE, PT_LOBE_ALL).g * cosine *
                       (double)light.radiance.g / (pdf * pmf);
    result.weight = pt_mis_weight((double)light.pdf_w * pmf,
                                  (double)pt_bsdf_pdf_w(bsdf, wo, light.wi, PT_RADIANCE), PT_HEURISTIC_POWER);
    return result;
}

/* The same by following a direction of the BSDF. */
static weighted bsdf_by_hand(const pt_scene *scene, const pt_hit *hit, const pt_bsdf *bsdf, pt_vec3 wo,
                             pt_vec2 u)
{
    weighted result = {0, 1};
    pt_bsdf_sample_result next;
    pt_hit far_hit;
    pt_ray ray;
    if (!pt_bsdf_sample(bsdf, wo, 0, u, PT_RADIANCE, &next)) return result;
    ray = pt_spawn_ray(hit->p, hit->p_error, hit->ng, next.wi);
    if (!pt_intersect(scene, &ray, &far_hit) || far_hit.light < 0) return result;
    result.value = (double)next.weight.g * (double)pt_hit_emission(scene, &far_hit, pt_v3_neg(next.wi)).g;
    result.weight = pt_mis_weight((double)next.pdf_w,
                                  (double)pt_light_pdf_w(scene, far_hit.light, hit->p, next.wi, &far_hit) *
                                      scene->lights[far_hit.light].pmf,
                                  PT_HEURISTIC_POWER);
    return result;
}

/* Direct light at the hit from both techniques, with a mistake. */
static double direct_by_hand(const pt_scene *scene, const pt_hit *hit, pt_vec3 wo, pt_sampler *sampler,
                             mistake wrong)
{
    const pt_bsdf bsdf = pt_bsdf_make(&scene->materials[hit->material], hit);
    weighted by_light, by_bsdf;
    pt_vec2 u_light, u_bsdf;
    double u_choice;
    pt_sampler_seek(sampler, PT_DIM_EDGE(1));
    u_bsdf = pt_sampler_2d(sampler);
    u_light = pt_sampler_2d(sampler);
    u_choice = (double)pt_sampler_1d(sampler);
    by_light = light_by_hand(scene, hit, &bsdf, wo, u_choice, u_light, wrong);
    by_bsdf = bsdf_by_hand(scene, hit, &bsdf, wo, u_bsdf);
    if (wrong == MEAN_OF_BOTH) by_light.weight = by_bsdf.weight = 0.5;
    if (wrong == TWICE) by_light.weight = by_bsdf.weight = 1;
    if (wrong == WEIGHTS_NOT_ONE) by_bsdf.weight = 1;
    if (wrong == AREA_AS_ANGLE || wrong == NO_COSINE || wrong == NO_CHOICE) {
        by_light.weight = 1;
        by_bsdf.weight = 0;
    }
    return by_light.weight * by_light.value + by_bsdf.weight * by_bsdf.value;
}

/* The furnace with a hand-written roulette, and the lamp under water without light sampling. */
static double roulette_by_hand(double rho, pt_pcg32 *rng, mistake wrong)
{
    const double q = 0.7;
    double sum = 1, throughput = 1;
    while (pt_pcg32_double(rng) < q) {
        throughput *= wrong == NO_REWEIGHT ? rho : rho / q;
        sum += throughput;
    }
    return sum;
}

static double refraction_by_hand(const pt_scene *scene, pt_ray ray, pt_sampler *sampler, mistake wrong)
{
    double throughput = 1;
    pt_hit hit;
    int edge;
    for (edge = 1; edge < 1000 && pt_intersect(scene, &ray, &hit); edge++) {
        const pt_vec3 wo = pt_v3_neg(pt_v3_normalize(ray.d));
        const pt_bsdf bsdf = pt_bsdf_make(&scene->materials[hit.material], &hit);
        const double emitted = (double)pt_hit_emission(scene, &hit, wo).g;
        pt_bsdf_sample_result next;
        double u_lobe;
        if (emitted > 0) return throughput * emitted;
        pt_sampler_seek(sampler, PT_DIM_EDGE(edge) + PT_DIM_LOBE);
        u_lobe = (double)pt_sampler_1d(sampler);
        if (!pt_bsdf_sample(&bsdf, wo, u_lobe, pt_v2(0, 0), PT_RADIANCE, &next)) return 0;
        throughput *= (double)next.weight.g * (wrong == NO_ETA ? (double)next.eta * (double)next.eta : 1);
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, next.wi);
    }
    return 0;
}

static void judge_mistake(const char *name, const pt_stats *s, double exact, mistake wrong)
{
    if (wrong == RIGHT || wrong == MEAN_OF_BOTH)
        pt_check_mean(name, s, exact, 1e-6 * exact, 0.02, PT_TEST_VALUES,
                      "the test's own estimator is right");
    else
        pt_check_rejects_mean(name, s, exact, 1e-6 * exact, PT_TEST_VALUES,
                              "a test that accepts this estimator sees nothing");
}

static void mistakes_direct(void)
{
    pt_test_source("rho/pi E, Lambert 1760; wrong estimators must be rejected");
    static const char *const name[] = {
        "right",     "mean of both techniques", "light counted twice", "weights not 1", "area as solid angle",
        "no cosine", "no probability of choice"};
    pt_scene s = PT_SCENE_INIT;
    pt_ray ray = floor_ray();
    pt_hit hit;
    int wrong;
    add_floor(&s, 0.5);
    pt_add_parallelogram(&s, v3(-1, 1, -1), v3(2, 0, 0), v3(0, 0, 2), add_lamp(&s, 1));
    pt_add_parallelogram(&s, v3(4, 0, -1), v3(0, 0, 2), v3(0, 2, 0), add_lamp(&s, 1));
    s = committed(s);
    pt_check(pt_intersect(&s, &ray, &hit), "mistakes, floor", "is not met");
    for (wrong = RIGHT; wrong <= NO_CHOICE; wrong++) {
        const pt_vec3 wall[4] = {v3(4, 0, -1), v3(4, 0, 1), v3(4, 2, 1), v3(4, 2, -1)};
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(1300 + (uint64_t)wrong), 0);
        pt_stats stats = PT_STATS_INIT;
        const uint32_t n = pt_test_samples(wrong == RIGHT || wrong == MEAN_OF_BOTH ? 80000 : 20000);
        uint32_t i;
        for (i = 0; i < n; i++) {
            pt_sampler_start(&sampler, 0, i);
            pt_stats_add(&stats, direct_by_hand(&s, &hit, v3(0, 1, 0), &sampler, (mistake)wrong));
        }
        judge_mistake(label("mistake, direct light: %s", name[wrong]), &stats,
                      0.5 / PT_PI * (1.7408395027342064 + lambert(wall, 4)), (mistake)wrong);
    }
    pt_scene_free(&s);
}

static void mistakes_paths(void)
{
    pt_test_source("geometric series; pool_radiance in the test; wrong estimators must be rejected");
    const uint32_t n = pt_test_all_samples(200000);
    pt_scene scene = pool(0, 1, 0, 1.33);
    const pt_ray ray = pool_ray(45);
    int k;
    for (k = 0; k < 4; k++) {
        const mistake wrong = k % 2 == 0 ? RIGHT : k == 1 ? NO_REWEIGHT : NO_ETA;
        pt_pcg32 rng = pt_pcg32_make(pt_test_seed(1320), (uint64_t)k);
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(1321 + (uint64_t)k), 0);
        pt_stats stats = PT_STATS_INIT;
        uint32_t i;
        for (i = 0; i < n; i++) {
            pt_sampler_start(&sampler, 0, i);
            pt_stats_add(&stats, k < 2 ? roulette_by_hand(0.5, &rng, wrong)
                                       : refraction_by_hand(&scene, ray, &sampler, wrong));
        }
        if (k < 2)
            judge_mistake(label("mistake, roulette: %s", k ? "not reweighted" : "right"), &stats, 2, wrong);
        else
            judge_mistake(label("mistake, refraction: %s", k == 3 ? "no eta^2" : "right"), &stats,
                          pool_radiance(&ray, 0, 1, 0, 1.33), wrong);
    }
    pt_scene_free(&scene);
}

static void nothing_hidden(void)
{
    pt_check(nonfinite == 0, "no path was NaN or infinite", "%g were", (double)nonfinite);
}

int main(int argc, char **argv)
{
    pt_test_begin("test_transport", argc, argv);
    PT_TEST(furnaces);
    PT_TEST(furnace_default_roulette);
    PT_TEST(furnace_constant_roulette);
    PT_TEST(roulette_path_length);
    PT_TEST(furnace_truncated);
    PT_TEST(furnace_scales);
    PT_TEST_EXACT(invisible);
    PT_TEST_EXACT(radiance_inside_glass);
    PT_TEST(white_ball);
    PT_TEST_EXACT(pool_closed_form);
    PT_TEST(pools);
    PT_TEST(length_of_rays);
    PT_TEST_EXACT(white_pool);
    PT_TEST(glass_plate);
    PT_TEST_EXACT(glowing_mirrors);
    PT_TEST(direct_sphere);
    PT_TEST(direct_small_sphere);
    PT_TEST(direct_rectangle);
    PT_TEST(direct_parallelogram);
    PT_TEST(direct_triangle);
    PT_TEST(direct_disk);
    PT_TEST_EXACT(one_sided);
    PT_TEST_EXACT(direct_point);
    PT_TEST(direct_together);
    PT_TEST(concentric_spheres);
    PT_TEST(diffuse_sphere);
    PT_TEST(cornell_probes);
    PT_TEST(cornell_bounces);
    PT_TEST(cornell_lamp);
    PT_TEST(agreement_rooms);
    PT_TEST(agreement_scenes);
    PT_TEST(agreement_glass_ball);
    PT_TEST(heuristics);
    PT_TEST(one_over_root_n);
    PT_TEST_EXACT(better_than_random);
    PT_TEST_EXACT(words);
    PT_TEST_EXACT(observer_sums);
    PT_TEST_EXACT(long_words);
    PT_TEST_EXACT(red_then_green);
    PT_TEST(mistakes_direct);
    PT_TEST(mistakes_paths);
    PT_TEST(nothing_hidden);
    return pt_test_end();
}
