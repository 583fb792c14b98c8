/* test_lockstep.c: paths that walk together find what paths find one at a time [PT-11b]: exact integrals, agreement with
   pti_path, the same bits whoever renders, lanes, numbers, densities, hits, and what is left to pti_path.
   tests/test_lockstep_plain.c, _avx2.c and _avx512.c are a selection of the same in other lanes. */

#define PT_STATIC /* it looks at private functions */
#ifndef LOCK_PROGRAM
#define LOCK_PROGRAM "test_lockstep"
#define LOCK_MAIN 1
#endif
#include "pt_lock.h"

#if PTI_HAS_LOCKSTEP

#ifdef LOCK_SELECTION
#define WHOLE 0
#else
#define WHOLE 1 /* all checks; else those that could differ with the lanes */
#endif

/* ---- exact integrals: furnaces ------------------------------------------------------------------------------ */

/* Closed scenes whose surfaces all emit 1 and reflect rho: radiance 1 + rho + rho^2 + ... everywhere. */
enum { BOX, BOX_OF_QUADS, TURNED, TURNED_QUADS, FANS, BALL, SHELLS, THINGS, WEDGE, FAR_OFF, LITTLE, TOUCHING, THIN_WEDGE, FURNACES };
static const char *const furnace_names[FURNACES] = {
    "box of rectangles", "box of quads", "turned box", "turned box of quads", "turned box of triangles", "ball from inside",
    "between two balls", "room with things", "wedge of 10 degrees", "turned box far off", "turned box of 1e-6", "things that touch", "wedge of 2 degrees"};

/* A prism: its sides z = 0 and 1, and three along z. */
static void add_wedge(pt_scene *s, const place *at, double height, int m)
{
    const double p[6][3] = {{0, 0, 0}, {1, 0, 0}, {1, height, 0}, {0, 0, 1}, {1, 0, 1}, {1, height, 1}};
    const double along[3] = {0, 0, 1};
    int k, i;
    for (k = 0; k < 3; k++) {
        double edge[3];
        for (i = 0; i < 3; i++) edge[i] = p[(k + 1) % 3][i] - p[k][i];
        add_face(s, PARALLELOGRAM, at, p[k], along, edge, m);
    }
    pt_add_triangle(s, put(at, p[0], 1), put(at, p[1], 1), put(at, p[2], 1), m);
    pt_add_triangle(s, put(at, p[3], 1), put(at, p[5], 1), put(at, p[4], 1), m);
}

static void add_things(pt_scene *s, double lift, int m)
{
    const place box = {0, 1, -0.4, -0.6 + lift, -0.3}, quads = {0, 0.5, 0.5, -0.7 + lift, 0.1}, fan = {0.5, 0.3, 0.1, 0.4, -0.4};
    add_cube(s, PARALLELOGRAM, &box, -0.4, 0.4, 1, m);
    add_cube(s, QUAD, &quads, -0.6, 0.3, 1, m);
    add_cube(s, FAN, &fan, -0.8, 0.8, 1, m);
    add_ball(s, &HERE, -0.4, 0.1 + 2 * lift, -0.3, 0.3, m); /* without lift they stand on the floor and on each other, */
    add_ball(s, &HERE, 0.7, 0.5, lift > 0 ? -0.5 : -0.9, 0.18, m); /* and one is half in the wall         */
}

static stage furnace(int kind, double rho)
{
    static const place places[FURNACES] = {{0, 1, 0, 0, 0},      {0, 1, 0.3, 0.2, 0.1}, {0.7, 1, 0, 0, 0},       {0.4, 1, 0, 0, 0}, {0.9, 1, 0.1, 0, -1},
                                           {0, 1, 0, 0, 0},      {0, 1, 0, 0.5, 0},     {0, 1, 0, 0, 0},         {0.3, 1, 0, 0, 0}, {0.7, 1, 70, -40, 30},
                                           {0.7, 1e-6, 1e-6, 0, 0}, {0, 1, 0, 0, 0}, {0.3, 1, 0, 0, 0}};
    static const int made[FURNACES] = {PARALLELOGRAM, QUAD, PARALLELOGRAM, QUAD, FAN, 0, 0, PARALLELOGRAM, 0, FAN, QUAD, QUAD, 0};
    const place *at = &places[kind];
    const int wedge = kind == WEDGE || kind == THIN_WEDGE;
    stage s;
    int m;
    memset(&s, 0, sizeof s);
    m = material_of(&s.scene, pt_material_diffuse(grey(rho)), 1);
    s.camera = camera_at(at, 0.1, 0, 0.8, 0, 0.05, -1, 70);
    if (kind == BALL || kind == SHELLS) add_ball(&s.scene, at, 0, 0, 0, 1, m);
    else if (wedge) add_wedge(&s.scene, at, kind == WEDGE ? 0.176 : 0.035, m);
    else add_cube(&s.scene, made[kind], at, -1, 1, 0, m);
    if (kind == SHELLS) add_ball(&s.scene, at, 0.1, 0, -0.2, 0.5, m);
    if (wedge) s.camera = camera_at(at, 0.9, 0.02, 0.5, 0, 0, 0.4, 0.1); /* it looks at the edge, on which a row of paths lands */
    if (kind == THINGS || kind == TOUCHING) add_things(&s.scene, kind == THINGS ? 0.05 : 0, m);
    commit(&s);
    return s;
}

/* Every path of k edges gives 1 + rho + ... + rho^(k-1), and walks k edges: not one may get out. Along the edges of things in the
   room and where they touch, one in 10^5 edges may get in: those strips are some e = 1e-6 wide. */
static double walk_to_the_end(int kind, double rho, int k, uint32_t spp)
{
    const int width = 29, height = 23, may_refuse = kind == THIN_WEDGE, touching = kind == TOUCHING || kind == THINGS;
    const double r = (double)(pt_real)rho, exact = (1 - pow(r, k)) / (1 - r), paths = (double)spp * width * height;
    const char *name = label("%s, %d edges", furnace_names[kind], k);
    stage s = furnace(kind, rho);
    pt_render_desc d = desc_of(&s, width, height, spp);
    pt_film film;
    uint64_t rays;
    int wrong = 0, i;
    d.method = "path-plain";
    d.li.max_edges = k;
    d.li.roulette = PT_ROULETTE_NONE;
    film = render(&s, &d, may_refuse ? -1 : 1, &rays);
    for (i = 0; i < 3 * width * height; i++) wrong += film.half[0][i] != film.half[0][0] || film.half[1][i] != film.half[0][0];
    /* a path that got into a thing finds no light there, or leaves the room: it spoils the three sums of its pixel */
    pt_check((double)rays == paths * k || (touching && (double)rays >= 0.999 * paths * k), name, "%.0f of %.0f edges are missing", paths * k - (double)rays, paths * k);
    pt_check(wrong <= (touching ? 3e-5 * paths * k : 0), name, "%d of %d sums of pixels differ from the first, after %.0f edges", wrong, 6 * width * height, paths * k);
    /* k products and k sums in float */
    pt_check(fabs(film.half[0][0] / (0.5 * spp) - exact) <= 2 * k * PTI_2_M24 * exact, name, "%.9g, exactly %.9g", film.half[0][0] / (0.5 * spp), exact);
    pt_film_free(&film);
    pt_scene_free(&s.scene);
    return (double)rays;
}

static void no_way_out(void)
{
    double edges = 0;
    int kind;
    for (kind = 0; kind < FURNACES; kind++) {
        const uint32_t few = pt_test_samples(WHOLE ? 64u : 32u) / 16 * 2;
        edges += walk_to_the_end(kind, 0.999, 500, few);
        if (WHOLE || kind == WEDGE) edges += walk_to_the_end(kind, 0.9, 10, 8 * few);
    }
    printf("edges walked in closed scenes: %.4g\n", edges);
}

/* Paths that end by roulette: 1 / (1 - rho) in the mean. Light sampling alone has no variance where walls meet, so it is asked
   in balls only. */
static void furnace_mean(int kind, double rho, const char *method, int max_edges, uint32_t spp, double bound)
{
    const double r = (double)(pt_real)rho, exact = max_edges ? (1 - pow(r, max_edges)) / (1 - r) : 1 / (1 - r);
    stage s = furnace(kind, rho);
    pt_render_desc d = desc_of(&s, 8, 6, samples(spp));
    picture p;
    d.method = method;
    d.li.max_edges = max_edges;
    p = pictures(&s, d, RENDERS, 1000u + 10000u * (uint64_t)kind, 1);
    pt_check_mean(label("%s, rho %g, %s%s", furnace_names[kind], rho, method, max_edges ? ", 5 edges" : ""), &p.whole, exact, 4 * PTI_2_M24 * exact,
                  bound, PT_TEST_MEANS, "light is lost or counted twice");
    pt_scene_free(&s.scene);
}

static void furnaces(void)
{
    int kind;
    pt_test_source("a closed scene that emits 1 and reflects rho: 1/(1 - rho)");
    for (kind = 0; kind < TOUCHING; kind++) {
        furnace_mean(kind, 0.5, "path", 0, 120, 0.006);
        furnace_mean(kind, 0.9, "path", 5, 60, 0.006);
        if (kind == BOX || kind == SHELLS) furnace_mean(kind, 0.9, "path", 0, 60, 0.01);
        if (kind == BOX || kind == FANS || kind == SHELLS) furnace_mean(kind, 0.5, "path-plain", 0, 120, 0.006);
        if (kind == BALL || kind == SHELLS) furnace_mean(kind, 0.5, "path-light", 0, 120, 0.01);
        if (kind == BALL || kind == SHELLS) furnace_mean(kind, 0.9, "path-light", 0, 60, 0.02);
        if (kind == BOX) furnace_mean(kind, 0.999, "path", 0, 1, 0.1);
        if (kind == FANS) furnace_mean(kind, 0.999, "path-plain", 0, 1, 0.1);
        if (kind == BALL) furnace_mean(kind, 0.999, "path-light", 0, 1, 0.1);
    }
}

/* ---- exact integrals: irradiance ---------------------------------------------------------------------------- */

/* A floor of albedo 1/2 under one lamp: radiance E / (2 pi), seen by a camera that sees next to one point of it. */
static void irradiance(void)
{
    static const char *const names[6] = {"rectangle", "parallelogram", "triangle", "sphere", "sphere at the horizon", "two triangles"};
    static const char *const methods[3] = {"path", "path-light", "path-plain"};
    int lamp_kind, m;
    pt_test_source("pt_irradiance_polygon (Lambert), pt_irradiance_sphere");
    for (lamp_kind = 0; lamp_kind < 6; lamp_kind++)
        for (m = 0; m < 3; m++) {
            const double corner[3] = {-0.3, 1.1, -0.7}, e1[3] = {1.2, 0, 0}, e2[3] = {0, 0, 0.9}, slanted[3] = {0.9, 0.3, -0.2}, up[3] = {0.3, -0.4, 1};
            const int flat = lamp_kind < 3 || lamp_kind == 5;
            const double *a = lamp_kind == 0 ? e1 : slanted, *b = lamp_kind == 0 ? e2 : up;
            const pt_vec3 p = v3(0.2, 0, 0.1), n = v3(0, 1, 0);
            pt_vec3 v[4];
            stage s;
            pt_render_desc d;
            picture got;
            double e;
            int glow, k;
            memset(&s, 0, sizeof s);
            glow = lamp(&s.scene, 3, 3, 3);
            pt_add_parallelogram(&s.scene, v3(-3, 0, -3), v3(0, 0, 6), v3(6, 0, 0), diffuse(&s.scene, 0.5, 0.5, 0.5));
            for (k = 0; k < 4; k++) {
                const int i = k == 1 || k == 2, j = k >= 2;
                v[k] = v3(corner[0] + i * a[0] + j * b[0], corner[1] + i * a[1] + j * b[1], corner[2] + i * a[2] + j * b[2]);
            }
            if (lamp_kind < 2) add_face(&s.scene, PARALLELOGRAM, &HERE, corner, a, b, glow); /* they look down */
            if (lamp_kind == 2) pt_add_triangle(&s.scene, v[0], v[1], v[2], glow);
            if (lamp_kind == 5) pt_add_triangle(&s.scene, v[0], v[1], v[2], glow), pt_add_triangle(&s.scene, v[0], v[2], v3(-0.9, 1.2, 0.5), glow);
            if (lamp_kind == 5) v[3] = v3(-0.9, 1.2, 0.5);
            e = flat ? pt_irradiance_polygon(3, p, n, v, lamp_kind == 2 ? 3 : 4) : 0;
            if (lamp_kind == 5) e = pt_irradiance_polygon(3, p, n, v, 3), v[1] = v[2], v[2] = v[3], e += pt_irradiance_polygon(3, p, n, v, 3);
            if (!flat) {
                const double y = lamp_kind == 3 ? 1 : 0.1, far = sqrt(0.25 + y * y);
                pt_add_sphere(&s.scene, v3(0.6, y, 0.4), (pt_real)0.3, glow);
                e = pt_irradiance_sphere(3, 0.3, far, y / far);
            }
            s.camera = pt_camera_look_at(v3(-1, 1.5, -1.2), p, v3(0, 1, 0), (pt_real)0.001);
            commit(&s);
            d = desc_of(&s, 4, 4, samples(m == 2 ? 512 : 256));
            d.li.max_edges = 2;
            d.method = methods[m];
            got = pictures(&s, d, RENDERS, 200000u + 100u * (uint64_t)(3 * lamp_kind + m), 1);
            pt_check_mean(label("floor under a %s, %s", names[lamp_kind], methods[m]), &got.whole, 0.5 * e / PT_PI, 2e-5 * e, m == 2 ? 0.05 : 0.01,
                          PT_TEST_MEANS, "the density of a light, or a cosine");
            pt_scene_free(&s.scene);
        }
}

/* ---- the film is a function of the scene and the samples ----------------------------------------------------- */

static int same_film(const pt_film *a, const pt_film *b)
{
    const size_t n = 3 * sizeof(double) * (size_t)a->width * (size_t)a->height;
    return a->width == b->width && a->height == b->height && a->fingerprint == b->fingerprint && a->samples[0] == b->samples[0] &&
           a->samples[1] == b->samples[1] && n > 0 && memcmp(a->half[0], b->half[0], n) == 0 && memcmp(a->half[1], b->half[1], n) == 0;
}

/* Runs the tasks from the last one. */
static void backwards(void *user, int count, void (*task)(void *context, int index), void *context)
{
    (void)user;
    while (count-- > 0) task(context, count);
}

static void same_bits(void)
{
    static const int threads[3] = {1, 2, 7}, tile[4] = {1, 5, 16, 64}, kinds[3] = {SPHERES, MANY_LAMPS, GLOWING};
    int r, i, k;
    for (r = 0; r < 3; r++) {
        stage s = room(kinds[r]);
        pt_render_desc d = desc_of(&s, 37, 19, 7);
        pt_film first, other;
        if (r == 1) d.sampler = PT_SAMPLER_INDEPENDENT;
        if (r == 2) d.single_net = 1;
        if (r == 2) d.camera.lens_radius = (pt_real)0.02;
        first = render(&s, &d, 1, NULL);
        for (i = 0; i < 3; i++)
            for (k = 0; k < 4; k++) {
                d.threads = threads[i];
                d.tile = tile[k];
                other = render(&s, &d, 1, NULL);
                pt_check(same_film(&first, &other), label("%s, %d threads, tiles of %d", room_names[kinds[r]], threads[i], tile[k]), "the films differ");
                pt_film_free(&other);
            }
        d.tile = 6;
        d.parallel = backwards;
        other = render(&s, &d, 1, NULL);
        pt_check(same_film(&first, &other), room_names[kinds[r]], "the films differ if the last tile comes first");
        pt_film_free(&other);
        d.seed++;
        other = render(&s, &d, 1, NULL);
        pt_check(memcmp(first.half[0], other.half[0], 3 * sizeof(double) * 37 * 19) != 0, room_names[kinds[r]], "another seed changes nothing");
        pt_film_free(&other);
        pt_film_free(&first);
        pt_scene_free(&s.scene);
    }
}

/* 8 samples, then 24 more, are 32 at once; so are parts of the samples merged, but for the order of sums. */
static void passes(void)
{
    int kind, single;
    for (kind = PT_SAMPLER_SOBOL; kind <= PT_SAMPLER_INDEPENDENT; kind++)
        for (single = 0; single < 2; single++) {
            stage s = room(MANY_LAMPS);
            pt_render_desc d = desc_of(&s, 20, 11, 32);
            pt_film whole, film = PT_FILM_INIT, part[3];
            double worst = 0;
            int i, h;
            d.sampler = (pt_sampler_kind)kind;
            d.single_net = single;
            whole = render(&s, &d, 1, NULL);
            d.spp = 8;
            pt_check(pt_render(&s.scene, &d, &film, NULL) == PT_OK, "8 samples", "fails");
            d.spp = 32;
            d.tile = 7;
            pt_check(pt_render(&s.scene, &d, &film, NULL) == PT_OK && same_film(&film, &whole), "8 samples, then 24 more", "are not 32 at once");
            pt_film_free(&film);
            for (i = 0; i < 3; i++) {
                static const uint32_t begin[4] = {0, 3, 12, 32};
                d.first_sample = begin[i];
                d.spp = begin[i + 1] - begin[i];
                part[i] = render(&s, &d, 1, NULL);
            }
            pt_check(pt_film_merge(&part[2], &part[0]) == PT_OK && pt_film_merge(&part[2], &part[1]) == PT_OK, "films of parts of the samples", "do not merge");
            for (h = 0; h < 2; h++)
                for (i = 0; i < 3 * 20 * 11; i++) {
                    const double a = part[2].half[h][i], b = whole.half[h][i];
                    if (a != b) worst = fmax(worst, fabs(a - b) / fmax(fabs(a), fabs(b)));
                }
            pt_check(worst <= 1e-12 && pt_film_spp(&part[2]) == 32, "films of parts of the samples", "are off by %g", worst);
            for (i = 0; i < 3; i++) pt_film_free(&part[i]);
            pt_film_free(&whole);
            pt_scene_free(&s.scene);
        }
}

static int stop_at_once(void *user) { return ++*(int *)user >= 1; }
static int stop_progress(void *user, const pt_progress *p) { return ++*(int *)user >= 1 && p->seconds >= 0; }

/* Walls that lose nothing: a path has some 2^24 edges and more. Neither a poll, a callback nor a budget waits for its end. */
static void endless(void)
{
    stage s = furnace(BALL, 1);
    pt_render_desc d = desc_of(&s, 16, 16, 4);
    int way;
    for (way = 0; way < 4; way++) {
        pt_film film = PT_FILM_INIT;
        pt_report report = PT_REPORT_INIT;
        pt_result result;
        int calls = 0;
        d = desc_of(&s, 16, 16, 4);
        d.threads = way == 0 ? 1 : 2;
        if (way == 0) d.li.poll = stop_at_once, d.li.poll_user = &calls;
        if (way == 1) d.progress = stop_progress, d.progress_user = &calls;
        if (way == 2) d.seconds = 0.1;
        if (way == 3) d.cpu_seconds = 0.1;
        result = pt_render(&s.scene, &d, &film, &report);
        pt_check(result == (way < 2 ? PT_ERROR_CANCELLED : PT_OK) && pt_film_spp(&film) == 0 && report.spp == 0,
                 label("stopped inside a path, way %d", way), "%s, %u samples", pt_result_string(result), (unsigned)pt_film_spp(&film));
        pt_check(strncmp(report.body, "lockstep", 8) == 0 && (way > 1 || calls >= 1), label("stopped inside a path, way %d", way), "%s, %d calls",
                 report.body, calls);
        pt_film_free(&film);
        pt_report_free(&report);
    }
    pt_scene_free(&s.scene);
}

/* What was rendered before a render is cancelled stays, and can be gone on with. */
typedef struct stopper {
    int calls;
    double spp;
} stopper;
static int stop_later(void *user, const pt_progress *p)
{
    stopper *t = (stopper *)user;
    t->calls++;
    t->spp = p->spp;
    return p->spp >= 4;
}
static void cancelled(void)
{
    stage s = room(SPHERES);
    pt_render_desc d = desc_of(&s, 48, 40, 1000000);
    pt_film film = PT_FILM_INIT, whole;
    pt_report report = PT_REPORT_INIT;
    stopper t = {0, 0};
    pt_result result;
    d.progress = stop_later;
    d.progress_user = &t;
    result = pt_render(&s.scene, &d, &film, &report);
    pt_check(result == PT_ERROR_CANCELLED && t.calls > 0 && report.spp >= 2 && report.spp < 1000000 && report.spp == pt_film_spp(&film), "cancelled",
             "%s, %u samples", pt_result_string(result), (unsigned)report.spp);
    d.progress = NULL;
    d.spp = report.spp + 3;
    pt_check(pt_render(&s.scene, &d, &film, NULL) == PT_OK, "cancelled, then continued", "fails");
    whole = render(&s, &d, 1, NULL);
    pt_check(same_film(&film, &whole), "cancelled, then continued", "is not the undisturbed film");
    pt_film_free(&film);
    pt_film_free(&whole);
    d.spp = 0;
    d.cpu_seconds = 0.05;
    pt_check(pt_render(&s.scene, &d, &film, &report) == PT_OK && report.spp > 0 && strcmp(report.stopped_by, "CPU seconds") == 0, "a budget of CPU seconds",
             "%u samples, stopped by %s", (unsigned)report.spp, report.stopped_by);
    pt_film_free(&film);
    pt_report_free(&report);
    pt_scene_free(&s.scene);
}

#endif /* PTI_HAS_LOCKSTEP */

static int lockstep(int argc, char **argv)
{
    pt_test_begin(LOCK_PROGRAM, argc, argv);
#if PTI_HAS_LOCKSTEP
    printf("lanes: %d, %s\n", PTI_WIDTH, PTI_WIDTH == 16 ? "AVX-512" : PTI_LANES == 2 ? "AVX2" : PTI_LANES == 1 ? "SSE2" : "C");
    PT_TEST_EXACT(no_way_out);
    PT_TEST(furnaces);
    PT_TEST(irradiance);
    PT_TEST_EXACT(same_bits);
    PT_TEST_EXACT(passes);
    PT_TEST_EXACT(endless);
    PT_TEST_EXACT(cancelled);
#endif
    return pt_test_end();
}

#ifdef LOCK_MAIN
int main(int argc, char **argv) { return lockstep(argc, argv); }
#endif
