/* test_methods.c: the methods from the time before path tracing, and light-path expressions [PT-11, PT-18].

       cc -O2 -ffp-contract=off -I. tests/test_methods.c -o test_methods -lm -pthread && ./test_methods

   Each method is held to path tracing restricted to the paths that the method follows, and to formulas by hand.
   Expressions are held to a matcher of this file that works in another way. Arguments choose functions. */

#include "pt_test.h"

#define UNITS 128 /* independent randomisations of a Sobol estimate */

static double dbl(pt_real x) { return (double)x; }
static pt_rgb grey(double v) { return pt_rgb_grey((pt_real)v); }
static pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }
static double dot3(pt_vec3 a, pt_vec3 b)
{
    return dbl(a.x) * dbl(b.x) + dbl(a.y) * dbl(b.y) + dbl(a.z) * dbl(b.z);
}

static pt_ray ray_from(pt_vec3 o, pt_vec3 d)
{
    pt_ray r;
    r.o = o;
    r.d = pt_v3_normalize(d);
    r.tmax = (pt_real)HUGE_VAL;
    return r;
}

static pt_scene committed(pt_scene scene)
{
    const pt_result result = pt_commit(&scene);
    if (result != PT_OK) pt_check(0, "pt_commit", "%s", pt_scene_error(&scene));
    return scene;
}

/* A canonical scene with its camera. */
typedef struct stage {
    pt_scene scene;
    pt_camera camera;
} stage;

static stage stage_of(const char *name)
{
    const pt_scene_entry *const entry = pt_scene_find(name);
    const pt_scene empty = PT_SCENE_INIT;
    stage s;
    memset(&s.camera, 0, sizeof s.camera);
    s.scene = empty;
    if (!entry || entry->make(&s.scene, &s.camera) != PT_OK)
        pt_check(0, name, "cannot be made: %s", pt_scene_error(&s.scene));
    return s;
}

/* What is estimated: the radiance along `ray`, or the mean over the picture of `camera` if it is set; of all paths, or of
   class `which` if options.lpe is set. */
typedef struct experiment {
    const pt_scene *scene;
    const pt_camera *camera;
    pt_ray ray;
    pt_li_fn li;
    pt_li_options options;
    int which;
} experiment;

static experiment experiment_of(const pt_scene *scene, const char *method, int max_edges)
{
    experiment e;
    memset(&e, 0, sizeof e);
    e.scene = scene;
    e.li = pt_method_find(method)->li;
    e.options.max_edges = max_edges;
    e.options.roulette = PT_ROULETTE_NONE;
    return e;
}

static pt_rgbd one_path(const experiment *e, pt_sampler *sampler, pt_li_info *info)
{
    pt_ray ray = e->ray;
    pt_rgbd value;
#if PTI_HAS_LPE
    pt_rgbd classes[PT_LPE_EXPRESSIONS + 1];
#endif
    memset(info, 0, sizeof *info);
    if (e->camera) {
        pt_vec2 film;
        pt_sampler_seek(sampler, PT_DIM_FILM);
        film = pt_sampler_2d(sampler);
        ray = pt_camera_ray(e->camera, 1, film.x, film.y, pt_v2(0, 0));
    }
#if PTI_HAS_LPE
    memset(classes, 0, sizeof classes);
    info->classes = classes;
#endif
    value = e->li(e->scene, &ray, sampler, &e->options, info);
#if PTI_HAS_LPE
    if (e->options.lpe) return classes[e->which];
#endif
    return value;
}

/* UNITS independent randomisations of n Sobol points; the mean of each is one value: a third of the three bands. */
static pt_stats by_means(const experiment *e, uint64_t seed, uint32_t n)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, pt_test_seed(seed), 0);
    pt_stats s = PT_STATS_INIT;
    pt_li_info info;
    uint32_t unit, i;
    n = pt_test_samples(n);
    for (unit = 0; unit < UNITS; unit++) {
        double sum = 0;
        for (i = 0; i < n; i++) {
            pt_rgbd v;
            pt_sampler_start(&sampler, unit, i);
            v = one_path(e, &sampler, &info);
            sum += (v.r + v.g + v.b) / 3;
        }
        pt_stats_add(&s, sum / n);
    }
    return s;
}

/* The same of the difference of two experiments that use the same random numbers: paths part only where the methods do, so
   what both see does not disturb. *level is the mean of the second. */
static pt_stats by_pairs(const experiment *a, const experiment *b, uint64_t seed, uint32_t n, double *level)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, pt_test_seed(seed), 0);
    pt_stats s = PT_STATS_INIT, second = PT_STATS_INIT;
    pt_li_info info;
    uint32_t unit, i;
    n = pt_test_samples(n);
    for (unit = 0; unit < UNITS; unit++) {
        double sum = 0;
        for (i = 0; i < n; i++) {
            pt_rgbd v, w;
            pt_sampler_start(&sampler, unit, i);
            v = one_path(a, &sampler, &info);
            pt_sampler_start(&sampler, unit, i);
            w = one_path(b, &sampler, &info);
            sum += (v.r - w.r + v.g - w.g + v.b - w.b) / 3;
            pt_stats_add(&second, (w.r + w.g + w.b) / 3);
        }
        pt_stats_add(&s, sum / n);
    }
    *level = second.mean;
    return s;
}

/* One path for methods without noise. */
static pt_rgbd without_noise(const experiment *e, pt_li_info *info)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 1, 0);
    pt_sampler_start(&sampler, 0, 0);
    return one_path(e, &sampler, info);
}

/* ---- the table -------------------------------------------------------------------------------------- */

static void table(void)
{
    const unsigned delta = PT_NEEDS_POINT_LIGHTS | PT_NEEDS_SPOT_LIGHTS | PT_NEEDS_DIRECTIONAL_LIGHTS;
    const unsigned sky = PT_NEEDS_ENVIRONMENT | PT_NEEDS_ENVIRONMENT_IMAGE;
    const struct {
        const char *name;
        pt_li_fn li;
        unsigned lacks;
        int follows, classes;
    } row[7] = {{"path", pt_li_path, 0, 1, 1},
                {"path-light", pt_li_path_light, 0, 1, 1},
                {"path-plain", pt_li_path_plain, delta, 1, 1},
                {"local", pt_li_local, sky, 0, 0},
                {"whitted", pt_li_whitted, sky, 0, 0},
                {"distribution", pt_li_distribution, 0, 0, 1},
                {"branching", pt_li_branching, delta, 0, 0}};
    int count, i;
    const pt_method *const m = pt_methods(&count);
    pt_check(count == 7, "pt_methods", "%d methods", count);
    for (i = 0; i < 7 && i < count; i++)
        pt_check(strcmp(m[i].name, row[i].name) == 0 && m[i].li == row[i].li &&
                     m[i].handles == (PT_NEEDS_ALL & ~row[i].lacks) && m[i].follows == row[i].follows &&
                     m[i].classes == row[i].classes && pt_method_find(row[i].name) == &m[i],
                 label("method %s", row[i].name), "%s: handles %x, follows %d, classes %d", m[i].name,
                 m[i].handles, m[i].follows, m[i].classes);
}

/* What a method does not handle is black: lights that no ray hits for the plain methods. */
static void not_handled(void)
{
    static const char *const plain[2] = {"path-plain", "branching"};
    pt_scene scene = PT_SCENE_INIT;
    int k;
    pt_add_sphere(&scene, v3(0, 0, 0), 1, pt_add_material(&scene, pt_material_diffuse(grey(0.5))));
    pt_add_point_light(&scene, v3(0, 3, 0), grey(10));
    pt_add_spot_light(&scene, v3(0, 3, 0), v3(0, -1, 0), grey(10), 20, 30);
    pt_add_directional_light(&scene, v3(0, -1, 0), grey(10));
    scene = committed(scene);
    for (k = 0; k < 2; k++) {
        experiment e = experiment_of(&scene, plain[k], 3);
        pt_li_info info;
        e.ray = ray_from(v3(0, 2, 0), v3(0, -1, 0));
        pt_check(without_noise(&e, &info).r == 0, label("%s under lights that cannot be hit", plain[k]),
                 "is not black");
    }
    pt_scene_free(&scene);
}

/* ---- the local model of the slides ------------------------------------------------------------------ */

/* A floor of that material at y = 0, a lamp above, and a plate between them that must cast no shadow. */
static pt_scene lecture_scene(pt_material m, int lights, int shadow)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_add_parallelogram(&scene, v3(-5, 0, -5), v3(0, 0, 10), v3(10, 0, 0), pt_add_material(&scene, m));
    if (shadow)
        pt_add_parallelogram(&scene, v3(-5, 2, -5), v3(0, 0, 10), v3(10, 0, 0),
                             pt_add_material(&scene, pt_material_diffuse(grey(0.3))));
    pt_add_point_light(&scene, v3(1, 3, -1), pt_rgb3(20, 10, 5));
    if (lights > 1) pt_add_directional_light(&scene, v3(0, -1, 1), grey(2));
    if (lights > 2) pt_add_spot_light(&scene, v3(-1, 4, 0), v3(0, -1, 0), grey(30), 60, 80);
    return committed(scene);
}

/* kd (n.l) I/r^2 and ks (n.h)^p I/r^2, from the same numbers by hand; from above or from below the floor. */
static void add_local(pt_vec3 wo, double side, pt_vec3 to_light, double irradiance, double kd, double ks,
                      double exponent, double *sum)
{
    const pt_vec3 l = pt_v3_normalize(to_light), h = pt_v3_normalize(pt_v3_add(l, wo));
    *sum += irradiance * (kd * fmax(0, side * dbl(l.y)) + ks * pow(fmax(0, side * dbl(h.y)), exponent));
}

static void local_by_hand(void)
{
    const double kd = 0.3, ks = 0.4, exponent = 20, ambient = 0.7;
    int lights, view;
    for (lights = 1; lights <= 3; lights++)
        for (view = 0; view < 6; view++) {
            pt_scene scene =
                lecture_scene(pt_material_phong(grey(kd), grey(ks), (pt_real)exponent), lights, view != 5);
            const pt_vec3 p = v3(0.3 * view - 0.6, 0, 0.2 * view),
                          eye = v3(-1 + 0.4 * view, view == 5 ? -1 : 1.5, 1),
                          wo = pt_v3_normalize(pt_v3_sub(eye, p));
            const pt_vec3 lamp = pt_v3_sub(v3(1, 3, -1), p), spot = pt_v3_sub(v3(-1, 4, 0), p);
            const double side = view == 5 ? -1 : 1, ds = sqrt(dot3(spot, spot));
            experiment e = experiment_of(&scene, "local", 0);
            double exact = ambient * kd;
            pt_li_info info;
            pt_rgbd got;
            add_local(wo, side, lamp, 20 / dot3(lamp, lamp), kd, ks, exponent, &exact);
            if (lights > 1) add_local(wo, side, v3(0, 1, -1), 2, kd, ks, exponent, &exact);
            if (lights > 2)
                add_local(wo, side, spot,
                          30 * pt_spot_falloff(dbl(spot.y) / ds, cos(PT_PI / 3), cos(80 * PT_PI / 180)) /
                              (ds * ds),
                          kd, ks, exponent, &exact);
            e.ray = ray_from(eye, pt_v3_sub(p, eye));
            e.options.ambient = grey(ambient);
            got = without_noise(&e, &info);
            pt_check_near(label("local, %d lights, view %d", lights, view), got.r, exact, 3e-6 * exact,
                          "ka Ia + sum of I/r^2 (kd n.l + ks (n.h)^p), no shadows");
            pt_check(info.rays == 1 && info.hit, "local traces one ray", "%g rays", (double)info.rays);
            pt_scene_free(&scene);
        }
}

/* An area lamp counts as if all of it came from its middle: radiance times solid angle, along the line to its centre. */
static void middle_of_lamps(void)
{
    static const double x[3] = {0, 1, 2.5};
    int i, kind;
    for (kind = 0; kind < 2; kind++)
        for (i = 0; i < 3; i++) {
            const double h = 2, r = 0.8, d = sqrt(h * h + x[i] * x[i]),
                         omega = kind == 0 ? 2 * PT_PI * (1 - sqrt(1 - r * r / (d * d)))
                                           : pt_solid_angle_rectangle(v3(0, 0, 0), v3(x[i] - 0.01, h, -0.01),
                                                                      v3(0.02, 0, 0), v3(0, 0, 0.02));
            const double rho = 0.6, exact = 5 * omega * h / d * rho;
            pt_scene scene = PT_SCENE_INIT;
            experiment e;
            pt_li_info info;
            pt_add_parallelogram(&scene, v3(-5, 0, -5), v3(0, 0, 10), v3(10, 0, 0),
                                 pt_add_material(&scene, pt_material_diffuse(grey(rho))));
            if (kind == 0)
                pt_add_sphere(&scene, v3(x[i], h, 0), (pt_real)r,
                              pt_add_material(&scene, pt_material_emitter(grey(5))));
            else
                pt_add_parallelogram(&scene, v3(x[i] - 0.01, h, -0.01), v3(0.02, 0, 0), v3(0, 0, 0.02),
                                     pt_add_material(&scene, pt_material_emitter(grey(5))));
            scene = committed(scene);
            e = experiment_of(&scene, "local", 0);
            e.ray = ray_from(v3(-2, 0.01, 0), v3(2, -0.01, 0));
            pt_check_near(label("local, %s %g m aside", kind ? "panel" : "ball", x[i]),
                          without_noise(&e, &info).g, exact, 1e-4 * exact,
                          "light from the middle of the lamp: radiance times solid angle times the cosine of "
                          "the line to its centre");
            e = experiment_of(&scene, "whitted", 2);
            e.ray = ray_from(v3(-2, 0.01, 0), v3(2, -0.01, 0));
            pt_check_near(label("whitted, %s %g m aside", kind ? "panel" : "ball", x[i]),
                          without_noise(&e, &info).g, exact / PT_PI, 1e-4 * exact, "the same with rho / pi");
            pt_scene_free(&scene);
        }
}

#if PTI_HAS_LPE
/* The diffuse part of path tracing is 1/pi of the slides' kd; its Blinn-Phong lobe is N(p) ks (n.h)^p cos, that is N(p) cos of
   the slides' highlight, with N = (p+2)(p+4) / (8 pi (2^(-p/2) + p)). */
static void local_and_path(void)
{
    static const char *const words[2] = {"LDE", "LGE"};
    const double kd = 0.3, ks = 0.4, p = 20, N = (p + 2) * (p + 4) / (8 * PT_PI * (pow(2, -p / 2) + p));
    pt_scene scene = lecture_scene(pt_material_blinn(grey(kd), grey(ks), (pt_real)p), 1, 0);
    pt_scene matt = lecture_scene(pt_material_blinn(grey(kd), grey(0), (pt_real)p), 1, 0);
    pt_lpe lpe;
    int view;
    pt_check(pt_lpe_compile(&lpe, words, 2, NULL) == PT_OK, "LDE and LGE", "are refused");
    for (view = 0; view < 6; view++) {
        const pt_vec3 at = v3(0.4 * view - 0.6, 0, 0.2 * view - 0.5), eye = v3(-1, 2, 1),
                      lamp = pt_v3_sub(v3(1, 3, -1), at);
        const double cosine = dbl(lamp.y) / sqrt(dot3(lamp, lamp));
        experiment path = experiment_of(&scene, "path", 2), all = experiment_of(&scene, "local", 0),
                   diffuse = experiment_of(&matt, "local", 0);
        pt_li_info info;
        double lde, lge, d;
        path.ray = all.ray = diffuse.ray = ray_from(eye, pt_v3_sub(at, eye));
        path.options.lpe = &lpe;
        lde = without_noise(&path, &info).r;
        path.which = 1;
        lge = without_noise(&path, &info).r;
        d = without_noise(&diffuse, &info).r;
        pt_check_near("LDE is the slides' diffuse term / pi", PT_PI * lde, d, 1e-5 * d,
                      "rho / pi against kd");
        pt_check_near("LGE is the slides' highlight times N(p) cos", lge,
                      (without_noise(&all, &info).r - d) * N * cosine, 1e-5 * (d + lge),
                      "Blinn-Phong with its normalisation and the cosine of the light");
    }
    pt_scene_free(&scene);
    pt_scene_free(&matt);
}

/* ---- Whitted and distribution against classes of path tracing --------------------------------------- */

static pt_lpe one_class(const char *expression)
{
    const char *error = NULL;
    pt_lpe lpe;
    pt_check(pt_lpe_compile(&lpe, &expression, 1, &error) == PT_OK, expression, "%s", error ? error : "");
    return lpe;
}

/* Balls of many materials on a floor. glassy: those among them that a path leaves by one of two ways. */
static pt_scene many_balls(int glassy)
{
    pt_scene s = PT_SCENE_INIT;
    pt_add_parallelogram(
        &s, v3(-6, 0, -6), v3(0, 0, 12), v3(12, 0, 0),
        pt_add_material(&s, pt_material_diffuse(pt_rgb3((pt_real)0.6, (pt_real)0.5, (pt_real)0.4))));
    pt_add_parallelogram(&s, v3(-6, 0, -3), v3(12, 0, 0), v3(0, 5, 0),
                         pt_add_material(&s, pt_material_mirror(grey(0.8))));
    pt_add_sphere(&s, v3(-2, 0.7, 0), (pt_real)0.7,
                  pt_add_material(&s, pt_material_mirror(pt_rgb3((pt_real)0.9, (pt_real)0.7, (pt_real)0.5))));
    pt_add_sphere(&s, v3(-0.5, 0.6, 1), (pt_real)0.6,
                  pt_add_material(&s, pt_material_phong(grey(0.3), grey(0.5), 30)));
    pt_add_sphere(
        &s, v3(0.5, 0.7, -1), (pt_real)0.7,
        pt_add_material(&s, pt_material_conductor(pt_rgb3(1, (pt_real)0.5, (pt_real)0.2), grey(4), 0)));
    if (glassy) {
        pt_add_sphere(&s, v3(1, 0.6, 1.2), (pt_real)0.6,
                      pt_add_material(&s, pt_material_dielectric((pt_real)1.5)));
        pt_add_sphere(&s, v3(2.2, 0.7, 0), (pt_real)0.7,
                      pt_add_material(&s, pt_material_coat(pt_rgb3((pt_real)0.1, (pt_real)0.5, (pt_real)0.3),
                                                           (pt_real)1.5)));
    }
    return s;
}

static const pt_camera *ball_camera(void)
{
    static pt_camera camera;
    camera = pt_camera_look_at(v3(0, 2.5, 7), v3(0, 0.6, 0), v3(0, 1, 0), 40);
    return &camera;
}

/* Under one light that is a point, and without glass, both are functions of the ray alone: equal ray by ray. */
static void whitted_by_rays(void)
{
    const pt_lpe lpe = one_class("L(D|G)?S*E");
    int kind, i, edges;
    for (kind = 0; kind < 3; kind++) {
        pt_scene scene = many_balls(0);
        double worst = 0, sum = 0;
        if (kind == 0) pt_add_point_light(&scene, v3(2, 4, 3), grey(40));
        if (kind == 1) pt_add_spot_light(&scene, v3(-1, 5, 3), v3(0.2, -1, -0.5), grey(80), 20, 60);
        if (kind == 2) pt_add_directional_light(&scene, v3(-0.3, -1, -0.4), grey(3));
        scene = committed(scene);
        for (i = 0; i < 600; i++) {
            experiment tree = experiment_of(&scene, "whitted", edges = 2 + i % 4),
                       path = experiment_of(&scene, "path", edges);
            pt_li_info info;
            double a, b;
            tree.ray = path.ray = pt_camera_ray(ball_camera(), 1, (pt_real)((i % 24 + 0.5) / 24),
                                                (pt_real)((i / 24 + 0.5) / 25), pt_v2(0, 0));
            path.options.lpe = &lpe;
            a = without_noise(&tree, &info).r;
            b = without_noise(&path, &info).r;
            worst = fmax(worst, fabs(a - b) / fmax(1e-2, b));
            sum += a;
        }
        pt_check(worst < 1e-4 && sum > 10, label("whitted = path of L(D|G)?S*E, light %d", kind),
                 "off by %.3g of a ray's radiance; the mean is %g", worst, sum / 600);
        pt_scene_free(&scene);
    }
}

static void check_classes_agree(const char *name, const experiment *method, const experiment *path,
                                uint64_t seed, uint32_t n, double bound, const char *hint)
{
    double level;
    const pt_stats difference = by_pairs(method, path, seed, n, &level);
    pt_check_mean(label("%s: difference", name), &difference, 0, 1e-5 * level, bound * level, PT_TEST_MEANS,
                  hint);
}

/* With glass, a coat and three lights, in the mean over the picture. */
static void whitted_in_the_mean(void)
{
    const pt_lpe lpe = one_class("L(D|G)?S*E");
    pt_scene scene = many_balls(1);
    experiment tree, path;
    pt_add_point_light(&scene, v3(2, 4, 3), grey(40));
    pt_add_spot_light(&scene, v3(-1, 5, 3), v3(0.2, -1, -0.5), grey(80), 20, 60);
    pt_add_directional_light(&scene, v3(-0.3, -1, -0.4), grey(2));
    scene = committed(scene);
    tree = experiment_of(&scene, "whitted", 6);
    path = experiment_of(&scene, "path", 6);
    tree.camera = path.camera = ball_camera();
    path.options.lpe = &lpe;
    check_classes_agree("whitted = path of L(D|G)?S*E", &tree, &path, 100, 7000, 0.02,
                        "each specular branch has its whole weight: reflected and refracted, Fresnel once");
    pt_scene_free(&scene);
}

/* The class of a canonical scene, and of balls under a panel. */
static void distribution_in_the_mean(void)
{
    static const char *const name[4] = {"cornell-spheres", "glossy-box", "materials", "balls"};
    static const uint32_t n[4] = {400, 400, 850, 400};
    const pt_lpe lpe = one_class("L[DGS]?[GS]*E");
    int k;
    for (k = 0; k < 4; k++) {
        stage s;
        experiment method, path;
        if (k < 3)
            s = stage_of(name[k]);
        else {
            s.scene = many_balls(1);
            pt_add_parallelogram(&s.scene, v3(-2, 5, 0), v3(4, 0, 0), v3(0, 0, 4),
                                 pt_add_material(&s.scene, pt_material_emitter(grey(4))));
            s.scene = committed(s.scene);
            s.camera = *ball_camera();
        }
        method = experiment_of(&s.scene, "distribution", 5);
        path = experiment_of(&s.scene, "path", 5);
        method.camera = path.camera = &s.camera;
        path.options.lpe = &lpe;
        check_classes_agree(label("distribution = path of L[DGS]?[GS]*E, %s", name[k]), &method, &path,
                            110 + (uint64_t)k, n[k], 0.02,
                            "gloss and mirrors are followed, light that a diffuse direction would find is "
                            "left to light sampling");
        pt_scene_free(&s.scene);
    }
}

/* The observer of a path: does it leave a diffuse surface other than to a light? */
static void distribution_words(void)
{
    static const char *const words[2] = {"L[DGS]?[GS]*E", "L.*E"};
    stage s = stage_of("glossy-box");
    experiment e = experiment_of(&s.scene, "distribution", 6);
    pt_stats sum[2];
    pt_lpe lpe;
    int k;
    pt_check(pt_lpe_compile(&lpe, words, 2, NULL) == PT_OK, "classes of distribution", "are refused");
    e.camera = &s.camera;
    e.options.lpe = &lpe;
    for (k = 0; k < 2; k++) {
        e.which = k;
        sum[k] = by_means(&e, 130, 32);
    }
    pt_check(sum[0].mean > 0.01 && sum[1].mean == 0, "words of distribution",
             "%g of its light is in other classes than L[DGS]?[GS]*E", sum[1].mean);
    pt_scene_free(&s.scene);
}
#endif

/* ---- the branching solver --------------------------------------------------------------------------- */

/* In a closed room every ray hits: 1 + N + ... + N^(m-1) rays, and with emission 1 and albedo 1/2 each tree has the radiance
   2 - 2^(1-m) up to rounding. */
static void branching_rays(void)
{
    static const int branching[4] = {1, 2, 4, 0}, edges[4] = {5, 4, 3, 0};
    stage s = stage_of("furnace");
    int k;
    for (k = 0; k < 4; k++) {
        experiment e = experiment_of(&s.scene, "branching", edges[k]);
        const int n = branching[k] ? branching[k] : 4,
                  most = edges[k] ? edges[k] : 4; /* the documented defaults */
        double rays = 0, power = 1;
        pt_li_info info;
        pt_rgbd got;
        int i;
        for (i = 0; i < most; i++, power *= n) rays += power;
        e.options.branching = branching[k];
        e.ray = ray_from(v3(0.1, -0.2, 0.3), v3(0.3, 0.5, -0.8));
        got = without_noise(&e, &info);
        pt_check((double)info.rays == rays && info.edges == most,
                 label("branching %d, %d edges: rays", branching[k], edges[k]), "%g rays, not %g; %d edges",
                 (double)info.rays, rays, info.edges);
        pt_check_near(label("branching %d, %d edges in a furnace", branching[k], edges[k]), got.r,
                      2 - ldexp(1, 1 - most), 1e-5, "the mean over the branches: 1/N of their sum");
    }
    pt_scene_free(&s.scene);
}

/* A room that glows unevenly, with a mirror ball and a rough one. */
static pt_scene uneven_room(void)
{
    pt_scene s = PT_SCENE_INIT;
    pt_material wall = pt_material_diffuse(pt_rgb3((pt_real)0.7, (pt_real)0.5, (pt_real)0.3));
    int glow, dark = pt_add_material(&s, wall), k;
    wall.emission = pt_rgb3(1, 2, 3);
    glow = pt_add_material(&s, wall);
    for (k = 0; k < 6; k++) { /* edge1 x edge2 points inwards */
        const double sign = k < 3 ? -1 : 1;
        double c[3] = {-1, -1, -1}, a[3] = {0, 0, 0}, b[3] = {0, 0, 0};
        c[k % 3] = sign;
        a[(k + (k < 3 ? 1 : 2)) % 3] = 2;
        b[(k + (k < 3 ? 2 : 1)) % 3] = 2;
        pt_add_parallelogram(&s, v3(c[0], c[1], c[2]), v3(a[0], a[1], a[2]), v3(b[0], b[1], b[2]),
                             k % 2 ? glow : dark);
    }
    pt_add_sphere(&s, v3(0.3, -0.4, 0), (pt_real)0.4, pt_add_material(&s, pt_material_mirror(grey(0.9))));
    pt_add_sphere(&s, v3(-0.5, 0.3, -0.3), (pt_real)0.3,
                  pt_add_material(&s, pt_material_conductor(grey(0.5), grey(3), (pt_real)0.6)));
    return committed(s);
}

static void branching_is_plain(void)
{
    static const int branching[3] = {1, 2, 4};
    static const uint32_t n[3] = {700, 450, 280};
    pt_scene scene = uneven_room();
    pt_camera camera = pt_camera_look_at(v3(0, 0, 0.9), v3(0, 0, 0), v3(0, 1, 0), 80);
    experiment plain = experiment_of(&scene, "path-plain", 4);
    pt_stats reference;
    int k;
    plain.camera = &camera;
    reference = by_means(&plain, 140, 700);
    for (k = 0; k < 3; k++) {
        experiment e = experiment_of(&scene, "branching", 4);
        pt_stats s;
        e.camera = &camera;
        e.options.branching = branching[k];
        s = by_means(&e, 141 + (uint64_t)k, n[k]);
        pt_check_equal_means(label("branching %d = path-plain, 4 edges", branching[k]), &s, &reference, 0.02,
                             "L = Le + 1/N sum of f cos / p L");
    }
    pt_scene_free(&scene);
}

/* Two mirrors face each other: a path ends by its number of edges alone. 0 means 12 for whitted and distribution. */
static void default_edges(void)
{
    static const struct {
        const char *method;
        int given, edges;
    } row[5] = {{"whitted", 0, 12},
                {"whitted", 5, 5},
                {"distribution", 0, 12},
                {"distribution", 7, 7},
                {"local", 0, 1}};
    pt_scene scene = PT_SCENE_INIT;
    const int mirror = pt_add_material(&scene, pt_material_mirror(grey(0.99)));
    int k;
    pt_add_parallelogram(&scene, v3(-1, 0, -1), v3(0, 0, 2), v3(2, 0, 0), mirror);
    pt_add_parallelogram(&scene, v3(-1, 1, -1), v3(2, 0, 0), v3(0, 0, 2), mirror);
    scene = committed(scene);
    for (k = 0; k < 5; k++) {
        experiment e = experiment_of(&scene, row[k].method, row[k].given);
        pt_li_info info;
        e.ray = ray_from(v3(0, 0.5, 0), v3(0, 1, 0));
        (void)without_noise(&e, &info);
        pt_check(info.edges == row[k].edges && info.rays == (uint64_t)row[k].edges,
                 label("%s, max_edges %d", row[k].method, row[k].given), "%d edges, %g rays", info.edges,
                 (double)info.rays);
    }
    pt_scene_free(&scene);
}

/* ---- options ---------------------------------------------------------------------------------------- */

static void bad_options(void)
{
    enum { BRANCHING, AMBIENT, FILTER, RADIUS, METHOD };
    static const struct {
        const char *name;
        int field;
        double value;
        const char *what;
    } bad[] = {{"branching -1", BRANCHING, -1, "li.branching"},
               {"branching 1025", BRANCHING, 1025, "li.branching"},
               {"ambient NaN", AMBIENT, (double)NAN, "li.ambient"},
               {"ambient infinite", AMBIENT, HUGE_VAL, "li.ambient"},
               {"filter 3", FILTER, 3, "desc.filter"},
               {"filter -1", FILTER, -1, "desc.filter"},
               {"filter radius -1", RADIUS, -1, "filter_radius"},
               {"filter radius 65", RADIUS, 65, "filter_radius"},
               {"filter radius NaN", RADIUS, (double)NAN, "filter_radius"},
               {"a method of that name", METHOD, 0, "unknown"}};
    stage s = stage_of("furnace");
    size_t i;
    for (i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        pt_render_desc d = pt_render_defaults();
        pt_report report = PT_REPORT_INIT;
        pt_film film = PT_FILM_INIT;
        pt_result result;
        d.camera = s.camera;
        d.width = d.height = 4;
        d.spp = 1;
        if (bad[i].field == BRANCHING) d.li.branching = (int)bad[i].value;
        if (bad[i].field == AMBIENT) d.li.ambient.g = (pt_real)bad[i].value;
        if (bad[i].field == FILTER) d.filter = (pt_filter)(int)bad[i].value;
        if (bad[i].field == RADIUS) d.filter_radius = bad[i].value;
        if (bad[i].field == METHOD) d.method = "whited";
        result = pt_render(&s.scene, &d, &film, &report);
        pt_check(result == PT_ERROR_ARGUMENT && report.error && strstr(report.error, bad[i].what) &&
                     !film.half[0],
                 bad[i].name, "'%s', sentence '%s'", pt_result_string(result),
                 report.error ? report.error : "none");
        pt_film_free(&film);
        pt_report_free(&report);
    }
    pt_scene_free(&s.scene);
}

#if PTI_HAS_LPE
/* ---- light-path expressions: a matcher of our own ---------------------------------------------------- */

/* It walks the text of the expression with a set of places in the word (bit k: k letters are read) and returns where the
   expression can end: no automaton, read from the light to the eye. */
typedef struct matcher {
    const char *word;
} matcher;

static unsigned match_or(const matcher *m, const char **at, unsigned from);

static unsigned step(const matcher *m, unsigned from, char letter)
{
    unsigned to = 0;
    int k;
    for (k = 0; m->word[k]; k++)
        if ((from >> k & 1) && m->word[k] == letter) to |= 2u << k;
    return to;
}

static unsigned match_atom(const matcher *m, const char **at, unsigned from)
{
    unsigned to = 0;
    const char c = *(*at)++;
    if (c == '(') {
        to = match_or(m, at, from);
        ++*at; /* ) */
    } else if (c == '[') {
        for (; **at != ']'; ++*at) to |= step(m, from, **at);
        ++*at;
    } else if (c == '.') {
        to = step(m, from, 'D') | step(m, from, 'G') | step(m, from, 'S') | step(m, from, 'V');
    } else {
        to = step(m, from, c);
    }
    return to;
}

/* The atom at `atom`, with the first `count` of the signs behind it. */
static unsigned match_repeated(const matcher *m, const char *atom, const char *signs, int count,
                               unsigned from)
{
    unsigned to, more;
    if (count == 0) return match_atom(m, &atom, from);
    to = signs[count - 1] == '+' ? match_repeated(m, atom, signs, count - 1, from) : from;
    if (signs[count - 1] == '?') return to | match_repeated(m, atom, signs, count - 1, from);
    for (more = 0; more != to;) {
        more = to;
        to |= match_repeated(m, atom, signs, count - 1, to);
    }
    return to;
}

static unsigned match_sequence(const matcher *m, const char **at, unsigned from)
{
    while (**at && **at != '|' && **at != ')') {
        const char *const atom = *at, *signs;
        int count;
        (void)match_atom(m, at, 0);
        signs = *at;
        count = (int)strspn(signs, "*+?");
        *at += count;
        from = match_repeated(m, atom, signs, count, from);
    }
    return from;
}

static unsigned match_or(const matcher *m, const char **at, unsigned from)
{
    unsigned to = match_sequence(m, at, from);
    while (**at == '|') {
        ++*at;
        to |= match_sequence(m, at, from);
    }
    return to;
}

static int matches(const char *expression, const char *word)
{
    matcher m;
    m.word = word;
    return (int)(match_or(&m, &expression, 1u) >> strlen(word) & 1u);
}

/* Word number k over the letters, with L and E around it: all words, the short ones first. */
static void word_of(int k, const char *letters, char *word)
{
    const int base = (int)strlen(letters);
    int length = 0, block = 1;
    while (k >= block) {
        k -= block;
        block *= base;
        length++;
    }
    *word++ = 'L';
    for (; length > 0; length--, k /= base) *word++ = letters[k % base];
    *word++ = 'E';
    *word = '\0';
}

/* How many of the first `words` words over DGSV the automaton puts in another class than the first that matches. */
static int words_off(const pt_lpe *lpe, const char *const *list, int count, int words, char *example)
{
    int k, c, off = 0;
    char word[16];
    for (k = 0; k < words; k++) {
        word_of(k, "DGSV", word);
        for (c = 0; c < count && !matches(list[c], word); c++) {
        }
        if (pt_lpe_class(lpe, word) != c && off++ == 0) strcpy(example, word);
    }
    return off;
}

static void check_list(const char *const *list, int count, int words)
{
    const char *error = NULL;
    char example[16] = "";
    pt_lpe lpe;
    int off;
    pt_check(pt_lpe_compile(&lpe, list, count, &error) == PT_OK && !error && lpe.class_count == count + 1,
             label("expression %s", list[0]), "is refused: %s", error ? error : "no sentence");
    off = lpe.class_count ? words_off(&lpe, list, count, words, example) : words;
    pt_check(off == 0, label("words of %s, %d expressions", list[0], count),
             "%d of %d words are in another class, first %s: the first expression that matches counts", off,
             words, example);
}

/* All 21845 words of up to 7 letters over DGSV between L and E. */
static void expressions(void)
{
    static const char *const alone[] = {"LE",
                                        "L(S|D)*DDE",
                                        "LS+DE",
                                        "LDS?E",
                                        "L.*E",
                                        "L[SD]+DS+E",
                                        "LD*S*G*E",
                                        "L(DS)*E",
                                        "L(D(S|G)*)+E",
                                        "L((D|S)(G|V))*E",
                                        "L(D|)E",
                                        "L(|S)+DE",
                                        "L(D?S?)*VE",
                                        "L.?.?.?E",
                                        "L[DGSV]+E",
                                        "L(D+S)?(G*V)+E",
                                        "LD+?E",
                                        "LD?+E",
                                        "LD*+E",
                                        "L(D*)*E",
                                        "L((D))E",
                                        "(LDE|LSE|LVE)",
                                        "LDE|LS*E",
                                        "L(D|DS|DSD)*E",
                                        "L(.V)*.E",
                                        "(L)(D)(E)",
                                        "L[D]E",
                                        "L.*V.*E",
                                        "L(.*D.*D.*)E",
                                        "L(S|SS)+E",
                                        "L()DE",
                                        "L(()|D)+()E",
                                        "[L]D[E]",
                                        "DE",
                                        "LD",
                                        "L.L.E",
                                        "E",
                                        "LDEE",
                                        "(L|D)SE",
                                        "[LD]+SE",
                                        "L((((((((D))))))))*E"};
    static const char *const lists[][6] = {{"LDE", "L.E", "L..E", "L.*E", NULL, NULL},
                                           {"L.*E", "LDE", NULL, NULL, NULL, NULL},
                                           {"LD*E", "L(D|S)*E", "LS*E", "L.*VE", "L.*", NULL},
                                           {"LS+DE", "L[SD]+DE", "L.*DE", "LE", NULL, NULL},
                                           {"LDE", "LDE", "LSE", NULL, NULL, NULL},
                                           {"L.*DE", "L.*SE", "L.*GE", "L.*VE", "LE", NULL}};
    size_t i;
    int n;
    for (i = 0; i < sizeof alone / sizeof alone[0]; i++) check_list(&alone[i], 1, 21845);
    for (i = 0; i < sizeof lists / sizeof lists[0]; i++) {
        for (n = 0; n < 6 && lists[i][n]; n++) {
        }
        check_list(lists[i], n, 21845);
    }
}

static void check_malformed(const char *name, const char *const *list, int count, const char *what)
{
    const char *error = NULL;
    pt_lpe lpe;
    const pt_result result = pt_lpe_compile(&lpe, list, count, &error);
    pt_check(result == PT_ERROR_ARGUMENT && error && strstr(error, what) && lpe.class_count == 0 &&
                 pt_lpe_compile(&lpe, list, count, NULL) == PT_ERROR_ARGUMENT,
             label("%s is refused", name), "'%s', sentence '%s'", pt_result_string(result),
             error ? error : "none");
    pt_check(pt_lpe_class(&lpe, "LDE") == -1, "a list that was refused", "has classes");
}

static void malformed(void)
{
    static const struct {
        const char *text, *what;
    } bad[] = {
        {"L(DE", "not closed"},   {"L(D(S)E", "not closed"}, {"L[DE", "not closed"}, {"L[]E", "empty"},
        {"L[D*]E", "not closed"}, {"LD)E", "not opened"},    {")", "not opened"},    {"", "empty"},
        {"()", "empty"},          {"D*", "empty"},           {"LDE|", "empty"},      {"LXE", "letter"},
        {"lde", "letter"},        {"L D E", "letter"},       {"*LE", "letter"},      {"L|*E", "letter"},
        {"LD{2}E", "letter"},     {"L\377E", "letter"},      {NULL, "empty"}};
    size_t i;
    for (i = 0; i < sizeof bad / sizeof bad[0]; i++)
        check_malformed(bad[i].text ? bad[i].text : "NULL", &bad[i].text, 1, bad[i].what);
}

/* Up to 16 expressions of 64 letters, 32 parentheses deep, with 64 states. */
static void limits(void)
{
    static const char *const seventeen[17] = {"LE", "LE", "LE", "LE", "LE", "LE", "LE", "LE", "LE",
                                              "LE", "LE", "LE", "LE", "LE", "LE", "LE", "LE"};
    static const char *const states =
        "L[DS][DS][DS][DS][DS][DS][DS]D[DS]*E"; /* from the eye: which of the last 8 were D */
    const char *error = NULL, *text;
    char many[128];
    pt_lpe lpe;
    check_malformed("a list of 17", seventeen, 17, "16");
    check_malformed("a list of -1", seventeen, -1, "16");
    check_malformed("a list that is NULL", NULL, 1, "16");
    check_malformed("an automaton of 2^8 states", &states, 1, "states");
    memset(many, 'D', sizeof many);
    many[0] = 'L';
    many[64] = 'E';
    many[65] = '\0';
    text = many;
    check_malformed("65 letters", &text, 1, "64 letters");
    many[60] = 'E';
    many[61] = '\0';
    pt_check(pt_lpe_compile(&lpe, &text, 1, &error) == PT_OK && pt_lpe_class(&lpe, many) == 0 &&
                 pt_lpe_class(&lpe, "LDDDE") == 1,
             "61 letters", "are refused: %s", error ? error : "");
    memset(many, '(', 33);
    strcpy(many + 33, "LE)))))))))))))))))))))))))))))))))");
    check_malformed("33 parentheses", &text, 1, "deep");
    memset(many, '(', 32);
    strcpy(many + 32, "LE))))))))))))))))))))))))))))))))");
    pt_check(pt_lpe_compile(&lpe, &text, 1, &error) == PT_OK && pt_lpe_class(&lpe, "LE") == 0,
             "32 parentheses", "are refused: %s", error ? error : "");
    pt_check(pt_lpe_compile(&lpe, seventeen, 16, NULL) == PT_OK && lpe.class_count == 17 &&
                 pt_lpe_class(&lpe, "LE") == 0,
             "a list of 16", "is refused");
    pt_check(pt_lpe_compile(&lpe, NULL, 0, NULL) == PT_OK && lpe.class_count == 1 &&
                 pt_lpe_class(&lpe, "LDE") == 0,
             "an empty list", "is not one class of everything");
}

/* Random text never crashes; what is accepted means what our matcher says. */
static void random_text(void)
{
    static const char letters[] = "LDGSVE.[]()|*+?LLEEDS()";
    pt_pcg32 rng = pt_pcg32_make(7, 7);
    int i, k, accepted = 0, off = 0;
    char example[16] = "", text[41];
    for (i = 0; i < 60000; i++) {
        const int n = (int)(pt_pcg32_next(&rng) % 20), hostile = i % 8 == 0;
        const char *list = text;
        pt_lpe lpe;
        for (k = 0; k < n; k++)
            text[k] = hostile ? (char)(1 + pt_pcg32_next(&rng) % 255)
                              : letters[pt_pcg32_next(&rng) % (sizeof letters - 1)];
        text[n] = '\0';
        if (pt_lpe_compile(&lpe, &list, 1, NULL) != PT_OK) continue;
        accepted++;
        off += words_off(&lpe, &list, 1, 341, example) > 0; /* up to 4 letters */
    }
    pt_check(off == 0 && accepted > 1000, "random expressions",
             "%d of %d accepted ones sort words wrongly, for example %s", off, accepted, example);
}

static void bad_words(void)
{
    static const char *const bad[14] = {"",    "L",   "E",   "DE",  "LD",  "LXE", "lde",
                                        "LLE", "LEE", "ELE", " LE", "LE ", "L*E", "LD\351E"};
    pt_lpe lpe = one_class("L.*E"), none;
    int i;
    memset(&none, 0, sizeof none);
    for (i = 0; i < 14; i++)
        pt_check(pt_lpe_class(&lpe, bad[i]) == -1, label("the word '%s'", bad[i]), "has class %d",
                 pt_lpe_class(&lpe, bad[i]));
    pt_check(pt_lpe_class(&none, "LE") == -1, "classes of nothing", "there are some");
}

/* The row of a word of D, G, S by the slides' meaning, G counting as D. */
static int row_by_hand(const char *word)
{
    const int n = (int)strlen(word) - 2;
    const char *const w = word + 1;
    int i, after_first = 0, before_last = 0, tail = 0;
    for (i = 0; i < n; i++) {
        after_first += i > 0 && w[i] != 'S'; /* diffuse ones that are not at the light */
        before_last += i < n - 1 && w[i] != 'S';
    }
    for (i = n - 1; i >= 0 && w[i] == 'S'; i--) tail++;
    if (n < 2) return n;                              /* emission, direct                       */
    if (after_first == 0) return 2;                   /* mirrored light or surface              */
    if (before_last == 0) return 3;                   /* specular until the last: caustic       */
    if (w[n - 1] != 'S' && w[n - 2] != 'S') return 4; /* the last two diffuse: bleeding         */
    return tail > 0 ? 5 : 6;                          /* mirrored bleeding or caustic; others   */
}

static void slides(void)
{
    static const struct {
        const char *word;
        int row;
    } example[] = {{"LE", 0},     {"LDE", 1},   {"LSE", 1},   {"LGE", 1},     {"LDSE", 2},  {"LSSE", 2},
                   {"LGSSE", 2},  {"LSDE", 3},  {"LSSGE", 3}, {"LDDE", 4},    {"LSDDE", 4}, {"LDGE", 4},
                   {"LDGDDE", 4}, {"LSDSE", 5}, {"LDDSE", 5}, {"LSSDSSE", 5}, {"LDSDE", 6}, {"LSDSDE", 6},
                   {"LVE", 7},    {"LDVE", 7},  {"LVSDE", 7}};
    pt_lpe lpe;
    char word[16];
    size_t i;
    int k, wrong = 0, count[9] = {0};
    pt_check(pt_lpe_compile(&lpe, pt_lpe_slides(), PT_LPE_SLIDES_COUNT, NULL) == PT_OK &&
                 lpe.class_count == PT_LPE_SLIDES_COUNT + 1,
             "rows of the slides", "are refused");
    for (i = 0; i < sizeof example / sizeof example[0]; i++)
        pt_check(pt_lpe_class(&lpe, example[i].word) == example[i].row, label("row of %s", example[i].word),
                 "%d, not %d", pt_lpe_class(&lpe, example[i].word), example[i].row);
    for (k = 0; k < 9841; k++) { /* up to 8 letters */
        word_of(k, "DGS", word);
        wrong += pt_lpe_class(&lpe, word) != row_by_hand(word);
        count[pt_lpe_class(&lpe, word)]++;
    }
    pt_check(wrong == 0, "rows of the slides for all words of 8 letters", "%d of 9841 differ", wrong);
    pt_check(count[0] == 1 && count[1] == 3 && count[7] == 0 && count[8] == 0 && count[6] > 0,
             "rows of the slides", "the rest class holds %d words, 'LE' %d", count[8], count[0]);
    for (k = 0, wrong = 0; k < 21845; k++) {
        word_of(k, "DGSV", word);
        wrong +=
            pt_lpe_class(&lpe, word) == 8 || (strchr(word, 'V') != NULL) != (pt_lpe_class(&lpe, word) == 7);
    }
    pt_check(wrong == 0, "the row of volumes", "%d words of 7 letters are wrong", wrong);
}

/* ---- classes in a picture --------------------------------------------------------------------------- */

static pt_lpe slides_lpe(void)
{
    pt_lpe lpe;
    (void)pt_lpe_compile(&lpe, pt_lpe_slides(), PT_LPE_SLIDES_COUNT, NULL);
    return lpe;
}

static pt_render_desc desc_of(const stage *s, const pt_lpe *lpe, const char *method)
{
    pt_render_desc d = pt_render_defaults();
    d.camera = s->camera;
    d.width = 14;
    d.height = 10;
    d.spp = 8;
    d.threads = 1;
    d.method = method;
    d.seed = 5;
    d.li.max_edges = 6;
    d.li.lpe = lpe;
    d.no_lockstep = 1; /* where classes are told apart, paths go one after the other */
    return d;
}

static pt_film rendered(const stage *s, const pt_render_desc *d)
{
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    const pt_result result = pt_render(&s->scene, d, &film, &report);
    pt_check(result == PT_OK && report.nonfinite == 0, "picture with classes", "%s, %s",
             pt_result_string(result), report.error ? report.error : "");
    pt_report_free(&report);
    return film;
}

static int same_sums(const double *a, const double *b, size_t n)
{
    return a && b && memcmp(a, b, n * sizeof *a) == 0;
}

/* Both sides are sums of the same non-negative numbers: contributions, divided by shares that add up to 1. A sum of n such terms
   is off by n 2^-53 of itself at most. Per pixel: 8 samples, 2 contributions an edge, at most 64 states each; the shares are
   products over 6 edges, of 3 roundings each. */
static void classes_add_up(void)
{
    static const char *const method[4] = {"path", "path-light", "path-plain", "distribution"},
                             *const name[3] = {"cornell-spheres", "glossy-box", "materials"};
    const pt_lpe lpe = slides_lpe();
    const double bound = (8.0 * 2 * 6 * lpe.state_count + 6 * 3 + lpe.class_count) * 0x1p-53;
    int m, k;
    for (k = 0; k < 3; k++)
        for (m = 0; m < 4; m++) {
            stage s = stage_of(name[k]);
            pt_render_desc d = desc_of(&s, &lpe, method[m]);
            pt_film film = rendered(&s, &d), plain;
            const size_t n = 3 * 14 * 10;
            double worst = 0, light = 0;
            size_t i, c;
            for (i = 0; i < n; i++) {
                const double whole = film.half[0][i] + film.half[1][i];
                double sum = 0;
                for (c = 0; c < (size_t)film.class_count; c++) sum += film.classes[c * n + i];
                worst = fmax(worst, fabs(sum - whole) / fmax(whole, 1e-300));
                light += whole;
            }
            pt_check(film.class_count == PT_LPE_SLIDES_COUNT + 1 && worst <= bound && light > 0,
                     label("classes of %s, %s", name[k], method[m]),
                     "%d classes; their sum is off by %.3g of the whole, %.3g is rounding", film.class_count,
                     worst, bound);
            d.li.lpe = NULL;
            plain = rendered(&s, &d);
            pt_check(same_sums(plain.half[0], film.half[0], n) && same_sums(plain.half[1], film.half[1], n),
                     label("%s, %s with and without classes", name[k], method[m]),
                     "the picture differs: asking for classes may change no bit of it");
            pt_film_free(&plain);
            pt_film_free(&film);
            pt_scene_free(&s.scene);
        }
}

static int same_classes(const pt_film *a, const pt_film *b)
{
    const size_t n = 3 * (size_t)a->width * (size_t)a->height;
    return a->class_count == b->class_count &&
           same_sums(a->classes, b->classes, n * (size_t)a->class_count) &&
           same_sums(a->half[0], b->half[0], n) && same_sums(a->half[1], b->half[1], n);
}

/* Threads, tiles, a continued render: the same bits; a merge: the same up to the rounding of one more addition. */
static void films_with_classes(void)
{
    const pt_lpe lpe = slides_lpe();
    stage s = stage_of("glossy-box");
    pt_render_desc d = desc_of(&s, &lpe, "path");
    pt_film film = rendered(&s, &d), other, second;
    const size_t n = 3 * 14 * 10 * (size_t)lpe.class_count;
    double worst = 0;
    size_t i;
    d.threads = 3;
    d.tile = 3;
    other = rendered(&s, &d);
    pt_check(same_classes(&film, &other), "classes with three threads and small tiles", "differ");
    pt_film_free(&other);
    d.spp = 3;
    other = rendered(&s, &d);
    d.spp = 8;
    pt_check(pt_render(&s.scene, &d, &other, NULL) == PT_OK && same_classes(&film, &other),
             "classes of a continued render", "differ");
    pt_film_free(&other);
    d.spp = 4;
    other = rendered(&s, &d);
    d.first_sample = 4;
    second = rendered(&s, &d);
    pt_check(pt_film_merge(&other, &second) == PT_OK, "merging films with classes", "is refused");
    for (i = 0; i < n; i++)
        worst = fmax(worst, fabs(other.classes[i] - film.classes[i]) / fmax(film.classes[i], 1e-300));
    pt_check(worst <= 8 * 0x1p-53, "classes of merged films", "off by %.3g", worst);
    pt_film_free(&second);
    pt_film_free(&other);
    pt_film_free(&film);
    pt_scene_free(&s.scene);
}

static void classes_refused(void)
{
    static const char *const names[3] = {"local", "whitted", "branching"};
    const pt_lpe lpe = slides_lpe(), fewer = one_class("LDE");
    pt_lpe none;
    stage s = stage_of("furnace");
    pt_render_desc d = desc_of(&s, &lpe, "path"), without = desc_of(&s, NULL, "path"),
                   another = desc_of(&s, &fewer, "path");
    pt_film film = rendered(&s, &d), plain, empty = PT_FILM_INIT, out = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    int k;
    memset(&none, 0, sizeof none);
    without.spp = another.spp = 16;
    pt_check(pt_render(&s.scene, &without, &film, &report) == PT_ERROR_MISMATCH && report.error,
             "continuing without classes", "is not refused");
    pt_check(pt_render(&s.scene, &another, &film, NULL) == PT_ERROR_MISMATCH, "continuing with other classes",
             "is not refused");
    without.first_sample = 8;
    without.spp = 8;
    plain = rendered(&s, &without);
    plain.fingerprint = film.fingerprint; /* the classes alone must tell them apart */
    pt_check(pt_film_merge(&film, &plain) == PT_ERROR_MISMATCH, "merging films with and without classes",
             "is not refused");
    for (k = 0; k < 3; k++) {
        d.method = names[k];
        pt_check(pt_render(&s.scene, &d, &empty, &report) == PT_ERROR_ARGUMENT && report.error &&
                     strstr(report.error, "classes"),
                 label("classes of %s", names[k]), "are not refused");
    }
    d.method = "path";
    d.li.lpe = &none;
    pt_check(pt_render(&s.scene, &d, &empty, &report) == PT_ERROR_ARGUMENT && report.error &&
                 strstr(report.error, "compiled"),
             "a list that was not compiled", "is not refused");
    pt_check(pt_film_class(&film, -1, &out) == PT_ERROR_ARGUMENT &&
                 pt_film_class(&film, film.class_count, &out) == PT_ERROR_ARGUMENT &&
                 pt_film_class(&plain, 0, &out) == PT_ERROR_ARGUMENT,
             "a class that is not there", "is given");
    pt_check(pt_film_class(&film, 1, &out) == PT_OK &&
                 fabs(pt_film_pixel(&out, 3, 2).g - film.classes[3 * (140 + 2 * 14 + 3) + 1] / 8) < 1e-15 &&
                 pt_film_spp(&out) == 8,
             "pt_film_class", "is not the mean of the class");
    pt_check(pt_film_make_classes(&empty, 3) == PT_ERROR_ARGUMENT &&
                 pt_film_make_classes(&out, 0) == PT_ERROR_ARGUMENT,
             "classes of an empty film", "are made");
    pt_film_free(&film);
    pt_film_free(&plain);
    pt_film_free(&empty);
    pt_film_free(&out);
    pt_report_free(&report);
    pt_scene_free(&s.scene);
}

/* ---- classes are exact for materials of two lobes ---------------------------------------------------- */

enum { MIXED, MATT, GLOSSY };

/* A corner: floor and wall of a Phong material with both lobes, or one of them; a lamp above. */
static pt_scene corner(int floor_kind, int wall_kind)
{
    pt_scene s = PT_SCENE_INIT;
    const pt_material f =
        pt_material_phong(grey(floor_kind == GLOSSY ? 0 : 0.4), grey(floor_kind == MATT ? 0 : 0.5), 12);
    const pt_material w =
        pt_material_phong(grey(wall_kind == GLOSSY ? 0 : 0.5), grey(wall_kind == MATT ? 0 : 0.4), 6);
    pt_add_parallelogram(&s, v3(-2, 0, -2), v3(0, 0, 4), v3(4, 0, 0), pt_add_material(&s, f));
    pt_add_parallelogram(&s, v3(-2, 0, -2), v3(4, 0, 0), v3(0, 3, 0), pt_add_material(&s, w));
    pt_add_parallelogram(&s, v3(-1, 2.5, -1.5), v3(2, 0, 0), v3(0, 0, 2),
                         pt_add_material(&s, pt_material_emitter(grey(6))));
    return committed(s);
}

static experiment corner_experiment(const pt_scene *scene, const pt_lpe *lpe, const char *method, int edges)
{
    experiment e = experiment_of(scene, method, edges);
    e.ray = ray_from(v3(0.2, 1.2, 1.5), v3(-0.1, -1.2, -1.3));
    e.options.lpe = lpe;
    return e;
}

/* One bounce: LDE and LGE of the mixture against floors with one lobe; LDE also by Lambert's formula. */
static void one_bounce_classes(void)
{
    static const char *const words[2] = {"LDE", "LGE"}, *const method[3] = {"path", "path-plain",
                                                                            "path-light"};
    static const uint32_t n[3] = {320, 2700, 600};
    const pt_vec3 lamp[4] = {v3(-1, 2.5, -1.5), v3(1, 2.5, -1.5), v3(1, 2.5, 0.5), v3(-1, 2.5, 0.5)};
    pt_scene mixed = corner(MIXED, MATT);
    pt_lpe lpe;
    int k, m;
    pt_check(pt_lpe_compile(&lpe, words, 2, NULL) == PT_OK, "LDE and LGE", "are refused");
    for (k = 0; k < 2; k++) {
        pt_scene pure = corner(k == 0 ? MATT : GLOSSY, MATT);
        for (m = 0; m < 3; m++) {
            experiment a = corner_experiment(&mixed, &lpe, method[m], 2),
                       b = corner_experiment(&pure, NULL, "path", 2);
            pt_stats sa, sb;
            a.which = k;
            sa = by_means(&a, 150 + (uint64_t)(4 * m + k), n[m]);
            sb = by_means(&b, 170 + (uint64_t)(4 * m + k), 320);
            pt_check_equal_means(
                label("%s of a mixture, %s", words[k], method[m]), &sa, &sb, 0.04,
                "a direction belongs to both lobes, by their parts of the BSDF, whichever lobe drew it");
            if (k == 0)
                pt_check_mean(label("LDE in closed form, %s", method[m]), &sa,
                              0.4 / PT_PI * pt_irradiance_polygon(6, v3(0.1, 0, 0.2), v3(0, 1, 0), lamp, 4),
                              1e-6, 0.04, PT_TEST_MEANS,
                              "albedo / pi times the irradiance of the lamp by Lambert's formula");
        }
        pt_scene_free(&pure);
    }
    pt_scene_free(&mixed);
}

/* Two bounces: light, wall, floor, eye. */
static void two_bounce_classes(void)
{
    static const char *const words[4] = {"LDDE", "LGDE", "LDGE", "LGGE"}, *const any = "L..E";
    static const uint32_t n[4] = {1000, 3300, 900, 1350};
    const pt_lpe all = one_class(any);
    pt_scene mixed = corner(MIXED, MIXED);
    pt_lpe lpe;
    int k;
    pt_check(pt_lpe_compile(&lpe, words, 4, NULL) == PT_OK, "words of two bounces", "are refused");
    for (k = 0; k < 4; k++) {
        pt_scene pure = corner(k < 2 ? MATT : GLOSSY, k % 2 ? GLOSSY : MATT);
        experiment a = corner_experiment(&mixed, &lpe, "path", 3),
                   b = corner_experiment(&pure, &all, "path", 3);
        pt_stats sa, sb;
        a.which = k;
        sa = by_means(&a, 190 + 2 * (uint64_t)k, n[k]);
        sb = by_means(&b, 191 + 2 * (uint64_t)k, n[k]);
        pt_check_equal_means(
            label("%s of two mixtures", words[k]), &sa, &sb, 0.05,
            "what a direction carries on is divided by the lobes' parts of the BSDF at that direction");
        pt_scene_free(&pure);
    }
    pt_scene_free(&mixed);
}
#endif

int main(int argc, char **argv)
{
    pt_test_begin("test_methods", argc, argv);
    PT_TEST_EXACT(table);
    PT_TEST_EXACT(not_handled);
    PT_TEST_EXACT(local_by_hand);
    PT_TEST_EXACT(middle_of_lamps);
    PT_TEST_EXACT(branching_rays);
    PT_TEST(branching_is_plain);
    PT_TEST_EXACT(default_edges);
    PT_TEST_EXACT(bad_options);
#if PTI_HAS_LPE
    PT_TEST_EXACT(local_and_path);
    PT_TEST_EXACT(whitted_by_rays);
    PT_TEST(whitted_in_the_mean);
    PT_TEST(distribution_in_the_mean);
    PT_TEST_EXACT(distribution_words);
    PT_TEST_EXACT(expressions);
    PT_TEST_EXACT(malformed);
    PT_TEST_EXACT(limits);
    PT_TEST_EXACT(random_text);
    PT_TEST_EXACT(bad_words);
    PT_TEST_EXACT(slides);
    PT_TEST_EXACT(classes_add_up);
    PT_TEST_EXACT(films_with_classes);
    PT_TEST_EXACT(classes_refused);
    PT_TEST(one_bounce_classes);
    PT_TEST(two_bounce_classes);
#endif
    return pt_test_end();
}
