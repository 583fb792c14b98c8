/* test_oracles.c: light transport, glass and pictures against exact values ([PT-02, -08, -10, -11, -18]), row
   by row: tests/data/oracles_transport.csv, oracles_bsdf.csv, oracles_methods.csv. At the end every row must
   have been used, but those of materials and methods that are still to come; they are listed with the reason.

   Where a path's radiance is a sum that no random number changes (a closed room, light found by hits only, no
   roulette), one path must give the exact value. Elsewhere means of many paths are judged, and for Russian
   roulette the variance of one path: where the sample variance itself has no finite variance, its value is
   shown and not judged. */

#include "pt_means.h"

#define POINTS 1024u /* in each randomisation of an estimate */

#define OTHER_MODEL "Beckmann's distribution, separable masking: the header has GGX and correlated masking"

static const later_rows LATER[] = {
    {"LT-INVIS", "scattering medium albedo 1", "media"},
    {"LT-SLAB", "polarised", "the renderer is unpolarised"},
    {"LT-SLAB", "tau=0.5", "media: glass that absorbs"},
    {"LT-SLAB", "tau=1", "media: glass that absorbs"},
    {"BSDF-NDF", "beck", OTHER_MODEL},
    {"BSDF-GGXALB", "E_beck_corr", OTHER_MODEL},
    {"BSDF-GGXALB", "beck_sep", OTHER_MODEL},
    {"BSDF-GGXALB", "E_ggx_sep", OTHER_MODEL},
    {"BSDF-GGXALB", "P_below_beck", OTHER_MODEL},
    {"BSDF-EVAL", "f_sep", OTHER_MODEL},
    {"BSDF-EVAL", "pdf_ndf", OTHER_MODEL},
    {"BSDF-FDR", "fit", "subsurface scattering, which uses the fit"},
    {"BSDF-PHONG", NULL, "tests/test_materials.c"},
    {"BSDF-PHONGBELOW", NULL, "tests/test_materials.c"},
    {"BSDF-FC", NULL, "tests/test_materials.c"},
    {"BSDF-SCHLICK", NULL, "tests/test_materials.c"},
    {"BSDF-NDF", NULL, "tests/test_materials.c"},
    {"BSDF-GGXALB", NULL, "tests/test_materials.c"},
    {"BSDF-AVG", NULL, "tests/test_materials.c"},
    {"BSDF-RDIEL", NULL, "tests/test_materials.c"},
    {"BSDF-EVAL", NULL, "tests/test_materials.c"},
    {"BSDF-ON", NULL, "tests/test_materials.c"},
    {"BSDF-MERL", NULL, "tests/test_materials.c"},
    {"LTM-MIRROR", NULL, "light tracing: a point light by way of a mirror"},
    {"LTM-PARAB", NULL, "light tracing: a point light by way of a mirror"},
    {"LTM-GLASS", NULL, "light tracing: a point light through glass"},
    {"LTM-GLASSOFF", NULL, "light tracing: a point light through glass"},
    {"LTM-GSPH", "polarised", "the renderer is unpolarised"},
    {"LTM-PHOT", NULL, "photon mapping"},
    {"LTM-EDGE", NULL, "photon mapping"},
    {"LTM-KNN", NULL, "photon mapping"},
    {"LTM-PPM", NULL, "progressive photon mapping"},
    {"LTM-MH", NULL, "Markov chains"},
    {"LTM-VPL", NULL, "instant radiosity"},
};

/* ---------------------------------------------------------------------------------------------------------
   Paths */

enum { PATH, PLAIN, LIGHT };
static const pt_li_fn METHODS[3] = {pt_li_path, pt_li_path_plain, pt_li_path_light};
static const char *const NAMES[3] = {"path", "plain", "light"};

/* Where paths begin: one ray, or one drawn from the first four numbers. */
typedef struct walk {
    const pt_scene *scene;
    pt_ray ray;
    double omc; /* > 0: directions of a cone around ray.d, its 1 - cos */
    pt_li_fn li;
    pt_li_options options;
} walk;

static walk walk_of(const pt_scene *scene, pt_ray ray, int method, int max_edges)
{
    walk w;
    memset(&w, 0, sizeof w);
    w.scene = scene;
    w.ray = ray;
    w.li = METHODS[method];
    w.options.max_edges = max_edges;
    w.options.roulette = max_edges > 0 ? PT_ROULETTE_NONE : PT_ROULETTE_THROUGHPUT;
    return w;
}

static pt_rgbd follow(const walk *w, pt_sampler *s, pt_li_info *info)
{
    pt_ray ray = w->ray;
    memset(info, 0, sizeof *info);
    if (w->omc > 0) {
        const pt_frame frame = pt_frame_from_normal(w->ray.d);
        ray.d = pt_frame_to_world(&frame, pt_warp_cone(pt_sampler_2d(s), w->omc));
    }
    return w->li(w->scene, &ray, s, &w->options, info);
}
static double radiance(const void *user, pt_sampler *s)
{
    pt_li_info info;
    return follow((const walk *)user, s, &info).g;
}
static double one_path(const walk *w)
{
    pt_sampler s = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(1), 0);
    pt_sampler_start(&s, 0, 0);
    return radiance(w, &s);
}

/* So many edges that, with this share of the light left after each, what is cut off is below `part` of all. */
static int edges_for(double share, double part) { return 2 + (int)ceil(log(part) / log(share)); }

/* How far the rounding of an albedo moves 1 / (1 - albedo), relative. */
static double rounded_albedo(double albedo) { return 1e-8 + pt_gamma(2) / (1 - albedo); }

/* ---------------------------------------------------------------------------------------------------------
   Furnaces */

static pt_scene furnace(double rho, double emission)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_add_sphere(&scene, v3(0, 0, 0), 1, glowing(&scene, rho, emission));
    commit(&scene);
    return scene;
}
static pt_ray furnace_ray(void) { return ray_from(v3(0.1, -0.2, 0.05), pt_v3_normalize(v3(0.3, 0.5, -0.8))); }

/* The edge at which the sum of a path comes within 1e-3 of the whole. */
typedef struct nearly {
    double sum, goal;
    int edges;
} nearly;

static void note_edge(void *user, const char *word, int edges, pt_rgbd value)
{
    nearly *const n = (nearly *)user;
    (void)word;
    n->sum += value.g;
    if (n->edges == 0 && n->sum >= n->goal) n->edges = edges;
}

/* Rounding moves log(rho), and with it the number of bounces, by 2^-24 / (1 - rho) of itself at most; where
   the series meets the goal exactly (rho = 0.1), the goal gives way by 1e-10. */
static void bounces(const row *r, walk w)
{
    const double rho = parameter(r, "rho");
    nearly n = {0, 0, 0};
    n.goal = (0.999 - 1e-10) / (1 - (double)real(rho));
    w.options.observer = note_edge;
    w.options.observer_user = &n;
    (void)one_path(&w);
    pt_check(fabs(n.edges - 1 - r->value) <= floor(r->value * pt_gamma(1) / (1 - rho)), r->id,
             "after %d bounces 1e-3 are missing, should be %g: emission at the first hit is bounce 0",
             n.edges - 1, r->value);
}

static void furnaces(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("LT-FURN", NULL, &at)) != NULL) {
        const double rho = parameter(r, "rho");
        pt_scene scene = furnace(rho, 1);
        const walk plain = walk_of(&scene, furnace_ray(), PLAIN, edges_for(rho, 1e-9));
        walk mis = walk_of(&scene, furnace_ray(), PATH, 0);
        if (strcmp(r->quantity, "L") != 0) {
            bounces(r, plain);
            pt_scene_free(&scene);
            continue;
        }
        near_relative(row_label(r->id, "one long path"), one_path(&plain), r->value, rounded_albedo(rho));
        /* roulette begins when 1 % is left: the rest of a path hardly adds to its spread. A path of the two
           whitest rooms would then have 4,600 and 46,000 edges: too long to take many */
        mis.omc = 2;
        mis.options.roulette = PT_ROULETTE_CONSTANT;
        mis.options.roulette_survival = real(0.5 + 0.5 * rho);
        mis.options.roulette_start = edges_for(rho, 0.01);
        if (rho < 0.995)
            check_bound(row_label(r->id, "path"), radiance, &mis, rho > 0.95 ? 24 : rho < 0.6 ? 384 : 256, r->value,
                        rounded_albedo(rho), BOUND,
                        "energy is lost or made in a closed room: weights of MIS or of roulette");
        pt_scene_free(&scene);
    }
}

static void furnaces_cut_off(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("LT-FURNK", "L_k", &at)) != NULL) {
        const double rho = parameter(r, "rho");
        const int k = (int)parameter(r, "k");
        pt_scene scene = furnace(rho, 1);
        const walk plain = walk_of(&scene, furnace_ray(), PLAIN, k + 1);
        walk mis = walk_of(&scene, furnace_ray(), PATH, k + 1);
        pt_check_near(row_label(r->id, "one path"), one_path(&plain), r->value,
                      (1e-12 + k * pt_gamma(1)) * r->value, "k reflections are k + 1 edges");
        mis.omc = 2;
        if (k == 2)
            check_bound(row_label(r->id, "path"), radiance, &mis, POINTS, r->value, 0, BOUND,
                        "k reflections are k + 1 edges, the last one by light sampling or by a hit");
        pt_scene_free(&scene);
    }
}

static void add_object(pt_scene *s, const row *r)
{
    const pt_vec3 lo = v3(-1, -1, -0.005), x = v3(2, 0, 0), y = v3(0, 2, 0), z = v3(0, 0, 0.01);
    const int glass = pt_add_material(s, pt_material_dielectric(real(1.5)));
    const int nothing = pt_add_material(s, pt_material_dielectric(1));
    const int slab[6][3] = {{0, 1, 0}, {1, 2, 0}, {2, 0, 0}, {0, 1, 1}, {1, 2, 1}, {2, 0, 1}};
    const pt_vec3 e[3] = {x, y, z};
    int i;
    if (is_word(r, "object", "mirror"))
        pt_add_sphere(s, v3(0, 0, 0), 1, pt_add_material(s, pt_material_mirror(grey(1))));
    else if (is_word(r, "object", "smooth dielectric 1.5")) pt_add_sphere(s, v3(0, 0, 0), 1, glass);
    else if (is_word(r, "object", "index-matched 1.0")) pt_add_sphere(s, v3(0, 0, 0), 1, nothing);
    else if (is_word(r, "object", "null interface")) pt_add_parallelogram(s, lo, x, y, nothing);
    else
        for (i = 0; i < 6; i++) { /* outwards: the three at the low corner, and those opposite */
            const pt_vec3 a = e[slab[i][0]], b = e[slab[i][1]];
            const pt_vec3 c = slab[i][2] ? pt_v3_add(lo, e[3 - slab[i][0] - slab[i][1]]) : lo;
            pt_add_parallelogram(s, c, slab[i][2] ? a : b, slab[i][2] ? b : a, glass);
        }
}

/* From all sides towards all parts of an object; the largest difference from radiance 1. */
static double worst_view(walk *w)
{
    pt_sampler s = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(2), 0);
    double worst = 0;
    uint32_t i;
    for (i = 0; i < 300; i++) {
        pt_vec3 from, to;
        pt_sampler_start(&s, 1, i);
        from = pt_v3_scale(pt_warp_sphere(pt_sampler_2d(&s)), 3);
        to = pt_v3_scale(pt_warp_sphere(pt_sampler_2d(&s)), pt_sampler_1d(&s));
        w->ray = ray_from(from, pt_v3_normalize(pt_v3_sub(to, from)));
        pt_sampler_start(&s, 0, i);
        worst = fmax(worst, fabs(radiance(w, &s) - 1));
    }
    return worst;
}

/* Under a white sky, and in a furnace whose walls reflect and glow half: the radiance is 1 on every path. A
   weight is off by eight roundings at most, and what is left of the light after 50 refractions does not
   matter. A ray that enters a slab by its side is guided along by up to 300 total reflections, of weight 1. */
static void invisible(void)
{
    const row *r;
    int at = 0, room;
    while ((r = next_row("LT-INVIS", "L", &at)) != NULL)
        for (room = 0; room < 2; room++) {
            pt_scene scene = PT_SCENE_INIT;
            walk w = walk_of(&scene, furnace_ray(), PLAIN, 1000);
            double worst;
            add_object(&scene, r);
            if (room) pt_add_sphere(&scene, v3(0, 0, 0), 4, glowing(&scene, 0.5, 0.5));
            else pt_set_environment(&scene, grey(1));
            commit(&scene);
            worst = worst_view(&w);
            pt_check(worst <= 400 * pt_gamma(1), row_label(r->id, room ? "in a furnace" : "under the sky"),
                     "a path is off by %.3g: weights of reflection and refraction, which must cancel on the way "
                     "out, or a ray on the wrong side of a surface", worst);
            pt_scene_free(&scene);
        }
}

/* ---------------------------------------------------------------------------------------------------------
   Planes and mirrors */

/* Two endless planes: two squares 1 apart between mirrors, in whose images they go on. `mirror`: the upper one
   reflects like a mirror of the same albedo. Mirrors and squares stick out beyond their common edges. */
static pt_scene planes(const row *r, int mirror)
{
    pt_scene s = PT_SCENE_INIT;
    pt_material upper = pt_material_diffuse(grey(parameter(r, "rho2")));
    const int lower = glowing(&s, parameter(r, "rho1"), parameter(r, "Le1"));
    const int silver = pt_add_material(&s, pt_material_mirror(grey(1)));
    if (mirror) upper.kind = PT_MATERIAL_MIRROR;
    upper.emission = grey(parameter(r, "Le2"));
    pt_add_parallelogram(&s, v3(-4, 0, -4), v3(0, 0, 8), v3(8, 0, 0), lower);
    pt_add_parallelogram(&s, v3(-4, 1, -4), v3(8, 0, 0), v3(0, 0, 8), pt_add_material(&s, upper));
    pt_add_parallelogram(&s, v3(-3, -1, -4), v3(0, 3, 0), v3(0, 0, 8), silver);
    pt_add_parallelogram(&s, v3(3, -1, -4), v3(0, 3, 0), v3(0, 0, 8), silver);
    pt_add_parallelogram(&s, v3(-4, -1, -3), v3(0, 3, 0), v3(8, 0, 0), silver);
    pt_add_parallelogram(&s, v3(-4, -1, 3), v3(0, 3, 0), v3(8, 0, 0), silver);
    commit(&s);
    return s;
}

static void parallel_planes(void)
{
    const row *r;
    int at = 0, mirror;
    while ((r = next_row("LT-PLANES", NULL, &at)) != NULL) {
        const double share = parameter(r, "rho1") * parameter(r, "rho2");
        const pt_ray down = ray_from(v3(0.1, 0.5, 0.2), v3(0, -1, 0)), up = ray_from(down.o, v3(0, 1, 0));
        for (mirror = 0; mirror < 2; mirror++) {
            pt_scene scene = planes(r, mirror);
            const int first = strcmp(r->quantity, "L1") == 0;
            const walk plain = walk_of(&scene, first ? down : up, PLAIN, 8 * edges_for(share, 1e-9));
            walk mis = walk_of(&scene, first ? down : up, PATH, 0);
            near_relative(row_label(r->id, mirror ? "one path, upper mirror" : "one path"), one_path(&plain),
                          r->value, rounded_albedo(share));
            mis.omc = 0.5;
            mis.options.roulette = PT_ROULETTE_CONSTANT; /* when 1 % of the light is left or so */
            mis.options.roulette_survival = real(share > 0.9 ? 0.98 : 0.7);
            mis.options.roulette_start = 3 * edges_for(share, 0.01);
            if (!mirror) /* long paths: fewer of them, and a wider bound */
                check_bound(row_label(r->id, "path"), radiance, &mis, share > 0.9 ? 12 : POINTS / 8, r->value,
                            rounded_albedo(share), share > 0.9 ? 4 * BOUND : 3 * BOUND,
                            "light found by way of a mirror counts in full, directly by its MIS weight");
            pt_scene_free(&scene);
        }
    }
}

static void parallel_mirrors(void)
{
    const row *r;
    int at = 0, m;
    while ((r = next_row("LT-MIRRORS", "L1", &at)) != NULL) {
        const double share = parameter(r, "r1") * parameter(r, "r2");
        pt_material first = pt_material_mirror(grey(parameter(r, "r1")));
        pt_scene s = PT_SCENE_INIT;
        first.emission = grey(parameter(r, "Le1"));
        pt_add_parallelogram(&s, v3(-9, 0, -9), v3(0, 0, 18), v3(18, 0, 0), pt_add_material(&s, first));
        pt_add_parallelogram(&s, v3(-9, 1, -9), v3(18, 0, 0), v3(0, 0, 18),
                             pt_add_material(&s, pt_material_mirror(grey(parameter(r, "r2")))));
        commit(&s);
        for (m = 0; m < 3; m++) {
            const walk w = walk_of(&s, ray_from(v3(0, 0.5, 0), v3(0, -1, 0)), m, 2 * edges_for(share, 1e-9));
            near_relative(row_label(r->id, NAMES[m]), one_path(&w), r->value, rounded_albedo(share));
        }
        pt_scene_free(&s);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Bowls. What a bowl sees through its opening, a sky of radiance 1, is what it would see of a lid of radiance
   1; the sphere that it is cut from goes on behind the lid, where no path comes. */

static pt_scene bowl(const row *r, int glows)
{
    const double rho = parameter(r, "rho"), z = cos(degrees(parameter(r, "a_deg")));
    pt_scene s = PT_SCENE_INIT;
    pt_add_sphere(&s, v3(0, 0, 0), 1, glowing(&s, rho, glows ? 1 - rho : 0));
    pt_add_parallelogram(&s, v3(-1.25, -1.25, z), v3(2.5, 0, 0), v3(0, 2.5, 0), glowing(&s, 0, glows ? 0 : 1));
    commit(&s);
    return s;
}

/* How many points, and the bound: few paths find their way out of a narrow opening, and take long. 0: none. */
static uint32_t bowl_effort(double share, int method, double *bound)
{
    *bound = share > 0.6 ? 24 * BOUND : method == LIGHT ? 12 * BOUND : 6 * BOUND;
    if (share < 0.6) return method == LIGHT ? POINTS / 2 : POINTS;
    if (share < 0.95) return method == PLAIN ? POINTS : 0;
    return method == PLAIN ? POINTS / 8 : 0;
}

static void bowls(void)
{
    const row *r;
    int at = 0, m;
    while ((r = next_row("LT-BOWL", NULL, &at)) != NULL) {
        const double cosine = cos(degrees(parameter(r, "a_deg"))), share = 0.5 * (1 - cosine);
        pt_scene scene = bowl(r, strcmp(r->quantity, "emissivity") == 0);
        for (m = 0; m < 3; m++) {
            double bound;
            const uint32_t points = bowl_effort(share, m, &bound);
            walk w = walk_of(&scene, ray_from(v3(0.01, 0.02, 0.5 + 0.5 * cosine), v3(0, 0, 1)), m,
                             edges_for(share * parameter(r, "rho"), 1e-7));
            w.omc = 1;
            if (points > 0)
                check_bound(row_label(r->id, NAMES[m]), radiance, &w, points, r->value, rounded_albedo(0.5),
                            bound, "the kernel of a sphere is constant: cosines, shadow rays inside, MIS weights");
        }
        pt_scene_free(&scene);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Russian roulette: variances. With the survival probability q a path of K + 1 edges has the radiance
   1 + w + ... + w^K, w = rho / q; scored at its end only it would be w^K / (1 - q). */

typedef struct chain {
    pt_stats edges, every, terminal; /* the number of edges, squared differences from the mean */
} chain;

static chain run_chain(const char *name, const walk *w, double rho, double q, uint32_t count)
{
    const uint32_t n = pt_test_all_samples(count);
    const double mean = 1 / (1 - rho);
    pt_sampler s = pt_sampler_make(PT_SAMPLER_INDEPENDENT, seed_of(name, 0), 0);
    pt_li_info info;
    uint32_t i;
    chain c;
    memset(&c, 0, sizeof c);
    for (i = 0; i < n; i++) {
        double x, last;
        pt_sampler_start(&s, 0, i);
        x = follow(w, &s, &info).g;
        last = pow(rho / q, info.edges - 1) / (1 - q);
        pt_stats_add(&c.edges, info.edges);
        pt_stats_add(&c.every, (x - mean) * (x - mean));
        pt_stats_add(&c.terminal, (last - mean) * (last - mean));
    }
    return c;
}

static walk roulette_walk(const pt_scene *scene, double q, int start)
{
    walk w = walk_of(scene, furnace_ray(), PLAIN, 0);
    w.options.roulette = PT_ROULETTE_CONSTANT;
    w.options.roulette_survival = real(q);
    w.options.roulette_start = start;
    return w;
}

static int fourth_moment(double rho, double q) { return pow(rho, 4) / pow(q, 3) < 1; }

/* rho = q: no variance where only the end is scored; its row is 0 up to rounding. */
static void check_variance(const char *name, const pt_stats *s, double exact, int is_finite, double bound)
{
    if (!is_finite)
        printf("shown  %-48s n %-8.0f got %-12.8g exact %-12.8g: its spread is infinite\n", name, s->n,
               s->mean, exact);
    else if (fabs(exact) < 1e-20) pt_check_near(name, s->mean, 0, 1e-6, "w = 1: all paths end with 1 / (1 - q)");
    else
        pt_check_mean(name, s, exact, 1e-5 * exact, bound, PT_TEST_VALUES,
                      "survivors weigh 1 / q, the first roulette is drawn after the first edge");
}

/* Geometric lengths (rho = q) are skewed: the squares of 700,000 are needed for a verdict, which then sees 3 %
   of a variance. 60,000 see 6 % of the other variances and 4 % of a mean length. */
static uint32_t chain_paths(double rho, double q) { return fabs(rho - q) < 1e-9 ? 700000 : 60000; }

/* Paths of q = 0.99 have 100 edges. Roulette is drawn without the furnace for their variance. */
static chain run_alone(const char *name, double rho, double q)
{
    const uint32_t n = pt_test_all_samples(1500000);
    const double mean = 1 / (1 - rho);
    pt_pcg32 rng = pt_pcg32_make(seed_of(name, 1), 9);
    uint32_t i;
    chain c;
    memset(&c, 0, sizeof c);
    for (i = 0; i < n; i++) {
        double x = 1, weight = 1;
        while (pt_pcg32_double(&rng) < q) x += weight *= rho / q;
        pt_stats_add(&c.every, (x - mean) * (x - mean));
        pt_stats_add(&c.terminal, pow(weight / (1 - q) - mean, 2));
    }
    return c;
}

static void roulette(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("LT-RR", "E_vertices", &at)) != NULL) {
        const double rho = parameter(r, "rho"), q = parameter(r, "q");
        const int is_finite = fourth_moment(rho, q), is_long = q > 0.98;
        pt_scene scene = furnace(rho, 1);
        const walk w = roulette_walk(&scene, q, 1);
        chain c = run_chain(r->id, &w, rho, q, is_long ? 15000 : chain_paths(rho, q));
        if (rho * rho / q < 1 - 1e-12)
            near_relative(r->id, pow(rho, 4) / pow(q, 3),
                          find_row("LT-RR", "fourth_moment_ratio", r->params)->value, 1e-14);
        pt_check_mean(row_label(r->id, "edges"), &c.edges, r->value, 1e-5 * r->value, is_long ? 0.08 : 0.04,
                      PT_TEST_VALUES, "a path goes on with probability q after every edge");
        if (is_long) c = run_alone(r->id, rho, q);
        check_variance(row_label(r->id, "variance, every vertex"), &c.every,
                       find_row("LT-RR", "Var_every_vertex", r->params)->value, is_finite, 0.08);
        check_variance(row_label(r->id, "variance, last vertex"), &c.terminal,
                       find_row("LT-RR", "Var_terminal", r->params)->value, is_finite, 0.08);
        pt_scene_free(&scene);
    }
}

static void roulette_that_begins_late(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("LT-RRK", "Var", &at)) != NULL) {
        const double rho = parameter(r, "rho"), q = parameter(r, "q");
        const row *const edges = find_row("LT-RRK", "E_vertices", r->params);
        pt_scene scene = furnace(rho, 1);
        const walk w = roulette_walk(&scene, q, (int)parameter(r, "K0") + 1);
        const chain c = run_chain(r->id, &w, rho, q, chain_paths(rho, q));
        pt_check_mean(row_label(edges->id, "edges"), &c.edges, edges->value, 1e-5 * edges->value, 0.04,
                      PT_TEST_VALUES, "roulette_start counts the edges before the first roulette");
        check_variance(row_label(r->id, "variance"), &c.every, r->value, fourth_moment(rho, q), 0.06);
        pt_scene_free(&scene);
    }
}

/* A sphere of which the cap above 1 - 2f shines: what a dark point reflects, by a walk with roulette before
   each bounce that finds the cap, or asks at each vertex for one point of it, uniform in area. */
typedef struct cavity {
    pt_scene sphere;
    double f, rho, q;
} cavity;

typedef struct double3 {
    double x, y, z;
} double3;

/* Onto the unit sphere, with the digits of double. */
static double3 unit_d(pt_vec3 v)
{
    const double l = sqrt((double)v.x * (double)v.x + (double)v.y * (double)v.y + (double)v.z * (double)v.z);
    const double3 u = {(double)v.x / l, (double)v.y / l, (double)v.z / l};
    return u;
}

/* rho / pi cos cos' / d^2 times the area of the cap: rho f wherever both points are. In double: where the two are as near as the
   rounding of a float, one value in millions would be a hundred times as large. */
static double ask_cap(const cavity *c, const pt_bsdf *bsdf, const pt_hit *hit, pt_vec3 wo, pt_pcg32 *rng)
{
    const pt_real u = real(0.999999 * pt_pcg32_double(rng)), v = real(0.999999 * pt_pcg32_double(rng));
    const pt_vec3 p = pt_warp_cone(pt_v2(u, v), 2 * c->f);
    const double3 at = unit_d(hit->p), lamp = unit_d(p), d = {lamp.x - at.x, lamp.y - at.y, lamp.z - at.z};
    const double d2 = d.x * d.x + d.y * d.y + d.z * d.z, cosines = (d.x * at.x + d.y * at.y + d.z * at.z) * (d.x * lamp.x + d.y * lamp.y + d.z * lamp.z);
    if (!(d2 > 0)) return 0;
    return (double)pt_bsdf_eval(bsdf, wo, pt_v3_normalize(v3(d.x, d.y, d.z)), PT_RADIANCE, PT_LOBE_ALL).g * fabs(cosines) / (d2 * d2) *
           4 * PT_PI * c->f;
}

static void cavity_walk(const cavity *c, pt_pcg32 *rng, double *found, double *asked)
{
    pt_ray ray = ray_from(v3(0, 0, 0), v3(0.6, 0, -0.8));
    double weight = 1;
    pt_hit hit;
    *found = *asked = 0;
    while (pt_intersect(&c->sphere, &ray, &hit)) {
        const pt_bsdf bsdf = pt_bsdf_make(&c->sphere.materials[hit.material], &hit);
        const pt_vec3 wo = pt_v3_neg(ray.d);
        pt_bsdf_sample_result next;
        pt_vec2 u;
        if ((double)hit.p.z > 1 - 2 * c->f) *found += weight;
        *asked += weight * ask_cap(c, &bsdf, &hit, wo, rng);
        if (!(pt_pcg32_double(rng) < c->q)) return;
        u.x = pt_real_from_u32(pt_pcg32_next(rng));
        u.y = pt_real_from_u32(pt_pcg32_next(rng));
        if (!pt_bsdf_sample(&bsdf, wo, 0, u, PT_RADIANCE, &next)) return;
        weight *= (double)next.weight.g / c->q;
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, next.wi);
    }
}

/* Hits of a cap of 1 % are so rare that their squares spread ten times as wide (20 %), and so skewed that a
   verdict takes 1,200,000 of them where paths are short. */
static void one_cavity(const row *r)
{
    const double noise = find_row("LT-SPHVAR", "Var_noNEE", r->params)->value;
    const double asked_noise = find_row("LT-SPHVAR", "Var_NEE", r->params)->value;
    const char *const hint = "hits in a sphere are uniform: pt_bsdf_sample, pt_spawn_ray, weights of roulette";
    cavity c = {PT_SCENE_INIT, 0, 0, 0};
    pt_pcg32 rng = pt_pcg32_make(seed_of(r->id, 0), 7);
    pt_stats found = PT_STATS_INIT, asked = PT_STATS_INIT, found2 = PT_STATS_INIT, asked2 = PT_STATS_INIT;
    uint32_t i, n;
    c.f = parameter(r, "f");
    c.rho = parameter(r, "rho");
    c.q = parameter(r, "q");
    n = pt_test_all_samples(c.f > 0.05 ? chain_paths(c.rho, c.q) : c.q > 0.8 ? 200000 : 1200000);
    c.sphere = furnace(c.rho, 0);
    for (i = 0; i < n; i++) {
        double x, y;
        cavity_walk(&c, &rng, &x, &y);
        pt_stats_add(&found, x);
        pt_stats_add(&asked, y);
        pt_stats_add(&found2, (x - r->value) * (x - r->value));
        pt_stats_add(&asked2, (y - r->value) * (y - r->value));
    }
    pt_scene_free(&c.sphere);
    near_relative(r->id, pow(c.rho, 4) / pow(c.q, 3),
                  find_row("LT-SPHVAR", "fourth_moment_ratio", r->params)->value, 1e-14);
    check_variance(row_label(r->id, "variance, by hits"), &found2, noise, fourth_moment(c.rho, c.q),
                   c.f < 0.05 ? 0.2 : 0.06);
    check_variance(row_label(r->id, "variance, by asking"), &asked2, asked_noise, fourth_moment(c.rho, c.q),
                   0.06);
    if (!fourth_moment(c.rho, c.q)) return; /* a mean needs a finite skewness to be judged */
    pt_check_mean(row_label(r->id, "by hits"), &found, r->value, 1e-5 * r->value,
                  10 * sqrt(noise / n) / r->value, PT_TEST_VALUES, hint);
    pt_check_mean(row_label(r->id, "by asking"), &asked, r->value, 1e-5 * r->value,
                  10 * sqrt(asked_noise / n) / r->value, PT_TEST_VALUES, hint);
}

static void hits_against_asking(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("LT-SPHVAR", "mean", &at)) != NULL) one_cavity(r);
}

/* ---------------------------------------------------------------------------------------------------------
   Glass */

/* A plate under a sky of red light, above a floor that shines green. */
static pt_scene plate(const row *r)
{
    pt_scene s = PT_SCENE_INIT;
    const int glass = pt_add_material(&s, pt_material_dielectric(real(parameter(r, "n"))));
    pt_add_parallelogram(&s, v3(-99, 0, -99), v3(0, 0, 198), v3(198, 0, 0), glass);
    pt_add_parallelogram(&s, v3(-99, -0.01, -99), v3(198, 0, 0), v3(0, 0, 198), glass);
    pt_add_parallelogram(&s, v3(-1e3, -1, -1e3), v3(0, 0, 2e3), v3(2e3, 0, 0),
                         pt_add_material(&s, pt_material_emitter(pt_rgb3(0, 1, 0))));
    pt_set_environment(&s, pt_rgb3(1, 0, 0));
    commit(&s);
    return s;
}

static double reflected_by_plate(const void *user, pt_sampler *s)
{
    pt_li_info info;
    return follow((const walk *)user, s, &info).r;
}

/* Which way a path goes at a second surface is not spread well: counts are binomial. Nine standard errors are
   seen, and what is seen of a few rare events scatters by half as much again. */
static double binomial_bound(double p)
{
    return fmax(2 * BOUND, 14 * sqrt((1 - p) / (p * POINTS * RANDOMISATIONS)));
}

static void plates(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("LT-SLAB", NULL, &at)) != NULL) {
        const int reflects = r->quantity[0] == 'R';
        const double t = degrees(parameter(r, "theta_deg"));
        pt_scene scene = plate(r);
        const pt_vec3 d = v3(sin(t), -cos(t), 0);
        const walk w = walk_of(&scene, ray_from(v3(-0.1 - sin(t), cos(t), 0.2), d), PATH, 1000);
        check_bound(row_label(r->id, reflects ? "reflected" : "let through"),
                    reflects ? reflected_by_plate : radiance, &w, POINTS, r->value, 2e-7,
                    binomial_bound(r->value),
                    "the probability of reflection is F of the side that the ray comes from");
        pt_scene_free(&scene);
    }
}

/* A parameter like 1/1.5 */
static double ratio(const row *r, const char *key)
{
    const char *const text = pt_case_find(r->params, key, '=');
    char *end;
    const double a = strtod(text ? text : "", &end);
    return *end == '/' ? a / strtod(end + 1, NULL) : a;
}

static void fresnel(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("BSDF-FD", "R", &at)) != NULL) {
        const double s = find_row("BSDF-FD", "Rs", r->params)->value, eta = ratio(r, "eta");
        const double p = find_row("BSDF-FD", "Rp", r->params)->value, t = degrees(parameter(r, "theta_deg"));
        double cos_t;
        const double got = pt_fresnel_dielectric(cos(t), eta, &cos_t);
        pt_check_near(r->id, got, r->value, 1e-13, "the mean of Rs and Rp; eta is the far side's over the near's");
        pt_check_near(r->id, got, 0.5 * (s + p), 1e-13, "the mean of both polarisations");
        pt_check_near(r->id, cos_t * cos_t, fmax(0, 1 - pow(sin(t) / eta, 2)), 1e-13, "Snell's law");
    }
}

/* At Brewster's angle the refracted ray stands at right angles to the reflected one; beyond the critical angle
   all is reflected. */
static void special_angles(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("BSDF-FDX", "brewster_deg", &at)) != NULL) {
        const double eta = parameter(r, "eta"), t = degrees(r->value), up = 1 + 1e-9;
        const double critical = degrees(find_row("BSDF-FDX", "critical_deg", r->params)->value);
        double c;
        pt_check_near(r->id, pt_fresnel_dielectric(cos(t), eta, &c),
                      find_row("BSDF-FDX", "R_at_brewster", r->params)->value, 1e-14, "half of Rs");
        pt_check_near(r->id, c, sin(t), 1e-14, "the cosine of refraction");
        pt_check(pt_fresnel_dielectric(cos(critical * up), 1 / eta, &c) >= 1 && c <= 0, r->id,
                 "no total reflection above the critical angle");
        pt_check(pt_fresnel_dielectric(cos(critical / up), 1 / eta, &c) < 1 && c > 0, r->id,
                 "total reflection below the critical angle");
    }
}

/* The mean of F over cosine-weighted directions, by Simpson's rule: cos^2 = c + (1 - c) x^2 beyond total
   reflection, where F is smooth in x. */
static double diffuse_fresnel(double eta)
{
    const double c = fmax(0, 1 - eta * eta);
    const int n = 4000;
    double sum = 0, cos_t;
    int i;
    for (i = 0; i <= n; i++) {
        const double x = (double)i / n, mu = sqrt(c + (1 - c) * x * x);
        const double weight = i == 0 || i == n ? 1 : i % 2 ? 4 : 2;
        sum += weight * 2 * x * (i == 0 ? 1 : pt_fresnel_dielectric(mu, eta, &cos_t));
    }
    return c + (1 - c) * sum / (3 * n);
}

/* A glass surface in the plane z = 0, diffuse light on one of its sides. */
typedef struct glass_face {
    pt_material glass;
    int inside, count; /* count: reflections are counted, else their probability is taken */
    pt_transport mode;
} glass_face;

static double reflection_of_face(const void *user, pt_sampler *s)
{
    const glass_face *const g = (const glass_face *)user;
    const double mu2 = (double)pt_sampler_1d(s); /* cosine-weighted: the square of the cosine is uniform */
    pt_vec3 wo = v3(sqrt(1 - mu2), 0, sqrt(mu2));
    pt_bsdf_sample_result out;
    pt_bsdf bsdf;
    pt_hit hit;
    memset(&hit, 0, sizeof hit);
    hit.ng = hit.ns = v3(0, 0, 1);
    if (g->inside) wo.z = -wo.z;
    bsdf = pt_bsdf_make(&g->glass, &hit);
    if (!pt_bsdf_sample(&bsdf, wo, g->count ? (double)pt_sampler_1d(s) : 0, pt_v2(0, 0), g->mode, &out)) return 0;
    if (!((double)out.wi.z * (double)wo.z > 0)) return 0;
    return (double)out.weight.g * (g->count ? 1 : (double)out.pdf_w);
}

static void diffuse_light_on_glass(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("BSDF-FDR", NULL, &at)) != NULL) {
        const double eta = parameter(r, "eta");
        glass_face g;
        g.glass = pt_material_dielectric(real(eta));
        g.inside = strcmp(r->quantity, "R_int") == 0;
        g.mode = g.inside ? PT_IMPORTANCE : PT_RADIANCE;
        pt_check_near(row_label(r->id, "quadrature"), diffuse_fresnel(g.inside ? 1 / eta : eta), r->value, 1e-10,
                      "pt_fresnel_dielectric near grazing, or beyond the critical angle");
        g.count = 0;
        check_bound(row_label(r->id, "by probability"), reflection_of_face, &g, 2 * POINTS, r->value, 3e-7, BOUND,
                    "pdf_w of a reflection is its probability F");
        g.count = 1;
        check_count(row_label(r->id, "counted"), reflection_of_face, &g, POINTS, r->value, r->value, 3e-7,
                    "u_lobe below F reflects; inside, eta is the inverse");
    }
}

typedef struct cosines {
    int cosine_weighted, power;
} cosines;
static double power_of_cosine(const void *user, pt_sampler *s)
{
    const cosines *const c = (const cosines *)user;
    const pt_vec2 u = pt_sampler_2d(s);
    return pow((double)(c->cosine_weighted ? pt_warp_cosine(u) : pt_warp_hemisphere(u)).z, c->power);
}

static void densities(void)
{
    static const char *const quantity[3] = {"Ecos_uniform_hemi", "Ecos_cosine_hemi", "Ecos2_cosine_hemi"};
    static const cosines mean[3] = {{0, 1}, {1, 1}, {1, 2}};
    int i;
    near_relative("BSDF-PDF", (double)pt_warp_sphere_pdf_w(), find_row("BSDF-PDF", "uniform_sphere", "")->value,
                  pt_gamma(1));
    near_relative("BSDF-PDF", (double)pt_warp_hemisphere_pdf_w(v3(0, 0.6, 0.8)),
                  find_row("BSDF-PDF", "uniform_hemisphere", "")->value, pt_gamma(1));
    for (i = 0; i < 3; i++) {
        const row *const r = find_row("BSDF-PDF", quantity[i], "");
        check_bound(row_label(r->id, quantity[i]), power_of_cosine, &mean[i], POINTS / 4, r->value, 0, BOUND,
                    "directions do not follow their density");
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Pictures. A pinhole looks straight down, so that each pixel is a square of the floor; it is the right upper
   one of 3 x 2 that the row speaks of. */

typedef struct view {
    pt_scene scene;
    pt_render_desc desc;
} view;
static const view NO_VIEW;

static void look_down(view *v, double x0, double x1, double y0, double y1, double height)
{
    const double pixel = x1 - x0, x = 0.5 * (x0 + x1) - pixel, y = 0.5 * (y0 + y1) - 0.5 * pixel;
    const double angle = 2 * atan(pixel / height) * 180 / PT_PI;
    v->desc = pt_render_defaults();
    v->desc.camera = pt_camera_look_at(v3(x, y, height), v3(x, y, 0), v3(0, 1, 0), real(angle));
    v->desc.width = 3;
    v->desc.height = 2;
    v->desc.threads = 1;
    v->desc.li.max_edges = 2;
}

static void add_floor(pt_scene *s, double rho)
{
    pt_add_parallelogram(s, v3(-9, -9, 0), v3(18, 0, 0), v3(0, 18, 0), wall(s, rho));
}

/* Independent renders; each gives one value of the pixel. Frees the scene. */
static void check_pixel(const row *r, view *v, const char *method, uint32_t spp, double bound)
{
    const char *const name = row_label(r->id, method);
    pt_stats pixel = PT_STATS_INIT;
    int failed = 0;
    uint32_t k;
    v->desc.method = method;
    v->desc.spp = pt_test_samples(spp);
    for (k = 0; k < RANDOMISATIONS; k++) {
        pt_film film = PT_FILM_INIT;
        v->desc.seed = seed_of(name, k);
        failed += pt_render(&v->scene, &v->desc, &film, NULL) != PT_OK;
        pt_stats_add(&pixel, pt_film_pixel(&film, 2, 0).g);
        pt_film_free(&film);
    }
    pt_check(failed == 0, name, "%d pictures are not rendered", failed);
    pt_check_mean(name, &pixel, r->value, 1e-5 * r->value, bound, PT_TEST_MEANS,
                  "a pixel is the mean of radiance over its square of the floor: which way x and y go, aspect, "
                  "rho / pi times irradiance");
}

static void pixels_under_a_point(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("LTM-PIX", "L_mean", &at)) != NULL) {
        view v = NO_VIEW;
        add_floor(&v.scene, parameter(r, "rho"));
        pt_add_point_light(&v.scene, v3(0, 0, parameter(r, "h")), grey(parameter(r, "I")));
        commit(&v.scene);
        look_down(&v, parameter(r, "x0"), parameter(r, "x1"), parameter(r, "y0"), parameter(r, "y1"),
                  parameter(r, "x1") - parameter(r, "x0") > 0.5 ? 4 : 0.5);
        check_pixel(r, &v, "path", 128, BOUND);
        check_pixel(r, &v, "path-light", 128, BOUND);
        pt_scene_free(&v.scene);
    }
}

/* The camera is below the lamp, whose back would hide the floor. Six pixels are rendered for the one
   that counts: the bounds are wider. */
static void pixels_under_a_lamp(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("LTM-PIXAREA", "L_mean", &at)) != NULL) {
        const double c = parameter(r, "c");
        double f[4], l[4];
        view v = NO_VIEW;
        numbers(r, "footprint", f, 4);
        numbers(r, "light", l, 4);
        add_floor(&v.scene, parameter(r, "rho"));
        pt_add_parallelogram(&v.scene, v3(l[0], l[2], c), v3(0, l[3] - l[2], 0), v3(l[1] - l[0], 0, 0),
                             lamp(&v.scene, 1));
        commit(&v.scene);
        look_down(&v, f[0], f[1], f[2], f[3], 0.5 * c);
        check_pixel(r, &v, "path", r->value > 0.1 ? 2048 : 512, 2 * BOUND); /* by area in lockstep, where samples are cheap */
        check_pixel(r, &v, "path-light", r->value > 0.1 ? 512 : 128, 2 * BOUND);
        if (r->value > 0.1) check_pixel(r, &v, "path-plain", 1024, 8 * BOUND); /* the other is too small to hit */
        pt_scene_free(&v.scene);
    }
}

/* Through a pinhole onto a film, from radiance 1 all around: rays of the film's points carry 1 / we each; of
   cosine-weighted directions so many find the film. */
typedef struct pinhole {
    pt_camera camera;
    double aspect;
} pinhole;

static double flux_by_importance(const void *user, pt_sampler *s)
{
    const pinhole *const c = (const pinhole *)user;
    const pt_vec2 film = pt_sampler_2d(s);
    const pt_ray ray = pt_camera_ray(&c->camera, real(c->aspect), film.x, film.y, pt_v2(0, 0));
    pt_camera_we_result w;
    if (!pt_camera_we(&c->camera, real(c->aspect), pt_v3_add(ray.o, ray.d), pt_v2(0, 0), &w)) return 0;
    return 1 / w.we;
}
static double flux_by_directions(const void *user, pt_sampler *s)
{
    const pinhole *const c = (const pinhole *)user;
    const pt_vec3 p = pt_v3_add(c->camera.position, cosine_around(c->camera.forward, s));
    pt_camera_we_result w;
    return pt_camera_we(&c->camera, real(c->aspect), p, pt_v2(0, 0), &w) ? PT_PI : 0;
}

static void films(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("LTM-FILM", NULL, &at)) != NULL) {
        const double w = parameter(r, "w"), h = parameter(r, "h"), f = parameter(r, "f");
        const double angle = 2 * atan(0.5 * h / f) * 180 / PT_PI;
        pinhole c;
        c.aspect = w / h;
        c.camera = pt_camera_look_at(v3(0, 0, 0), v3(2, 1, -2), v3(0, 1, 0), real(angle));
        /* a ray of the film's rim may miss it by rounding: one in 1e5 */
        check_bound(row_label(r->id, "by importance"), flux_by_importance, &c, POINTS, r->value, 1e-5, BOUND,
                    "we = 1 / (area of the image at distance 1 * cos^4)");
        check_count(row_label(r->id, "by directions"), flux_by_directions, &c, 4 * POINTS, r->value,
                    r->value / PT_PI, 1e-6, "which directions the film sees: angle of view, aspect");
    }
}

/* A white wall's point sees the floor, the floor the lamp: paths of three edges less those of two. */
static double one_bounce(const void *user, pt_sampler *s)
{
    walk w = *(const walk *)user;
    pt_sampler again = *s;
    double three;
    w.options.max_edges = 3;
    three = radiance(&w, s);
    w.options.max_edges = 2;
    return PT_PI * (three - radiance(&w, &again));
}

static void corners(void)
{
    const row *r;
    int at = 0, m;
    while ((r = next_row("LTM-CORNER", "E_wall_z1", &at)) != NULL) {
        pt_scene s = PT_SCENE_INIT;
        pt_add_parallelogram(&s, v3(0, -100, 0), v3(200, 0, 0), v3(0, 200, 0), wall(&s, parameter(r, "rho")));
        pt_add_parallelogram(&s, v3(0, -100, 0), v3(0, 200, 0), v3(0, 0, 200), wall(&s, 1));
        pt_add_point_light(&s, v3(parameter(r, "a"), 0, parameter(r, "h")), grey(1));
        commit(&s);
        for (m = 0; m < 3; m += 2) {
            const walk w = walk_of(&s, ray_from(v3(0.5, 0, 1), v3(-1, 0, 0)), m, 3);
            check_bound(row_label(r->id, NAMES[m]), one_bounce, &w, 2 * POINTS, r->value, 0, BOUND,
                        "two reflections are three edges; a point light is asked for at each vertex");
        }
        pt_scene_free(&s);
    }
}

/* A beam of parallel light on a glass sphere: what leaves it after so many edges. */
typedef struct beam {
    pt_scene scene;
    int edges; /* 2: reflected outside; 3 + p: out after p reflections inside */
} beam;

static pt_ray beam_ray(pt_sampler *s)
{
    const pt_vec2 d = pt_warp_disk(pt_sampler_2d(s));
    return ray_from(pt_v3(d.x, d.y, 3), v3(0, 0, -1));
}
static double leaves_after(const void *user, pt_sampler *s)
{
    const beam *const b = (const beam *)user;
    const walk w = walk_of(&b->scene, beam_ray(s), PLAIN, b->edges + 1);
    pt_li_info info;
    const double value = follow(&w, s, &info).g;
    return info.edges == b->edges ? value : 0;
}

/* The same with both ways followed at each surface, weighed with their probabilities. */
static double share_that_leaves(const void *user, pt_sampler *s)
{
    const beam *const b = (const beam *)user;
    pt_ray ray = beam_ray(s);
    double share = 1;
    pt_hit hit;
    int edge;
    for (edge = 1; edge < b->edges && pt_intersect(&b->scene, &ray, &hit); edge++) {
        const pt_bsdf bsdf = pt_bsdf_make(&b->scene.materials[hit.material], &hit);
        const int refracts = b->edges > 2 && (edge == 1 || edge == b->edges - 1);
        pt_bsdf_sample_result next;
        if (!pt_bsdf_sample(&bsdf, pt_v3_neg(ray.d), refracts ? 1 - 1e-12 : 0, pt_v2(0, 0), PT_IMPORTANCE, &next))
            return 0;
        share *= (double)next.pdf_w * (double)next.weight.g;
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, next.wi);
    }
    return edge == b->edges ? share : 0;
}

static void glass_spheres(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("LTM-GSPH", NULL, &at)) != NULL) {
        beam b = {PT_SCENE_INIT, 2};
        if (r->quantity[0] == 'p') b.edges = 3 + atoi(r->quantity + 1);
        pt_add_sphere(&b.scene, v3(0, 0, 0), 1,
                      pt_add_material(&b.scene, pt_material_dielectric(real(parameter(r, "n")))));
        pt_set_environment(&b.scene, grey(1));
        commit(&b.scene);
        check_bound(row_label(r->id, "by shares"), share_that_leaves, &b, 2 * POINTS, r->value, 1e-6, 2 * BOUND,
                    "F outside and inside belong to one angle; importance is not scaled by eta^2");
        check_bound(row_label(r->id, "by paths"), leaves_after, &b, POINTS, r->value, 1e-6,
                    binomial_bound(r->value),
                    "specular paths and max_edges: reflection has two edges, p inner reflections 3 + p");
        pt_scene_free(&b.scene);
    }
}

int main(int argc, char **argv)
{
    pt_test_begin("test_oracles", argc, argv);
    if (!load_rows("tests/data/oracles_transport.csv") || !load_rows("tests/data/oracles_bsdf.csv") ||
        !load_rows("tests/data/oracles_methods.csv"))
        return pt_test_end();
    due_later(LATER, sizeof LATER / sizeof LATER[0]);
    PT_TEST(furnaces);
    PT_TEST(furnaces_cut_off);
    PT_TEST_EXACT(invisible);
    PT_TEST(parallel_planes);
    PT_TEST_EXACT(parallel_mirrors);
    PT_TEST(bowls);
    PT_TEST(roulette);
    PT_TEST(roulette_that_begins_late);
    PT_TEST(hits_against_asking);
    PT_TEST(plates);
    PT_TEST_EXACT(fresnel);
    PT_TEST_EXACT(special_angles);
    PT_TEST(diffuse_light_on_glass);
    PT_TEST(densities);
    PT_TEST(pixels_under_a_point);
    PT_TEST(pixels_under_a_lamp);
    PT_TEST(films);
    PT_TEST(corners);
    PT_TEST(glass_spheres);
    if (argc < 2) PT_TEST_EXACT(every_row_is_used); /* only a whole run uses them all */
    return pt_test_end();
}
