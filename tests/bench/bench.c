/* bench.c - what things cost: rays per second, building the tree, paths, leaving features out, compiling.

   build:  cc -O2 -ffp-contract=off -I. tests/bench/bench.c -o bench -lm -pthread
   run:    CC=cc ./bench [name ...]       in the project's top directory; names choose rows by their beginning

   CSV on stdout: name,value,unit,reference,ratio. A value is the median of ROUNDS rounds, in which the rows
   of a group take turns, so that a machine that slows down does so for all of them. `reference` is the row
   or limit that the value is compared with, `ratio` is value / reference: the figure to quote, since absolute
   speeds of one machine say little about another. One thread, CPU seconds.

   Instructions are counted by valgrind's callgrind, or by perf where there is no valgrind; bytes of code are told by nm.
   Where a tool is missing, a line on stderr says that its rows are skipped. */

#define _POSIX_C_SOURCE 200809L
#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"

#include <stdlib.h>
#if defined(__unix__) || defined(__APPLE__)
#include <sys/types.h>
#include <sys/wait.h>
#include <unistd.h>
#endif

enum { ROUNDS = 5, MAX_ROWS = 32, RAYS = 1 << 16, TORUS_RINGS = 512, TORUS_SECTORS = 128 };

/* One row: measure returns its value in one round, or a negative number if it cannot be had. */
typedef struct row {
    char name[64];
    const char *unit;
    double (*measure)(const struct row *self);
    const void *context;
    const char *argument;
    int flag;
    int reference;          /* index of the row to compare with, -1 = `limit`                              */
    double limit;           /* 0 = none                                                                    */
    double values[ROUNDS], median;
} row;

static int wanted_count;
static char **wanted_names;

static int is_wanted(const char *name)
{
    int i;

    for (i = 0; i < wanted_count; i++)
        if (strncmp(name, wanted_names[i], strlen(wanted_names[i])) == 0) return 1;
    return wanted_count == 0;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

/* Measures a group in turns. */
static void take_medians(row *rows, int count, int rounds)
{
    int r, i;

    for (r = 0; r < rounds; r++)
        for (i = 0; i < count; i++) rows[i].values[r] = rows[i].measure(&rows[i]);
    for (i = 0; i < count; i++) {
        qsort(rows[i].values, (size_t)rounds, sizeof(double), compare_doubles);
        rows[i].median = rows[i].values[rounds / 2];
    }
}

/* A line, if it is wanted; a value below 0 could not be had, a reference of 0 is none. */
static void print_row(const char *name, double value, const char *unit, double reference)
{
    if (!is_wanted(name)) return;
    if (!(value >= 0)) fprintf(stderr, "bench: %s: not available\n", name);
    else if (reference > 0) printf("%s,%.4g,%s,%.4g,%.3f\n", name, value, unit, reference, value / reference);
    else printf("%s,%.4g,%s,,\n", name, value, unit);
    fflush(stdout);
}

/* Runs a group in turns and prints its rows. */
static void run_group(row *rows, int count, int rounds)
{
    int i;

    take_medians(rows, count, rounds);
    for (i = 0; i < count; i++)
        print_row(rows[i].name, rows[i].median, rows[i].unit, rows[i].reference >= 0 ? rows[rows[i].reference].median : rows[i].limit);
}

typedef double (*measure_fn)(const row *self);

static row make_row(const char *prefix, const char *name, const char *unit, measure_fn measure)
{
    row r;

    memset(&r, 0, sizeof r);
    snprintf(r.name, sizeof r.name, "%s%s", prefix, name);
    r.unit = unit;
    r.measure = measure;
    r.reference = -1;
    return r;
}

/* ---- rays ---------------------------------------------------------------------------------------------- */

typedef struct ray_list {
    pt_ray ray[RAYS];
    int count;
} ray_list;
static ray_list rays, shadow_rays;

/* Rays from points inside the bounds into all directions: what bounces look like, without their order. */
static void make_rays(const pt_scene *scene)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 1, 0);
    pt_vec3 size = pt_v3_sub(scene->hi, scene->lo);
    uint32_t i;

    for (i = 0; i < RAYS; i++) {
        pt_vec2 u, v;
        pt_real w;
        pt_sampler_start(&sampler, 0, i);
        u = pt_sampler_2d(&sampler);
        v = pt_sampler_2d(&sampler);
        w = pt_sampler_1d(&sampler);
        rays.ray[i].o = pt_v3_add(scene->lo, pt_v3(u.x * size.x, u.y * size.y, w * size.z));
        rays.ray[i].d = pt_warp_sphere(v);
        rays.ray[i].tmax = (pt_real)1e30;
    }
    rays.count = RAYS;
}

/* How many of them hit; any: asked for any hit, not the nearest. */
static int trace(const pt_scene *scene, const ray_list *list, int any)
{
    int found = 0, i;
    pt_hit hit;

    for (i = 0; i < list->count; i++)
        found += any ? pt_occluded(scene, &list->ray[i]) : pt_intersect(scene, &list->ray[i], &hit);
    return found;
}

/* Million rays per second; flag 0 = nearest hit, 1 = any hit. Repeats until 0.1 s have passed. */
static double measure_rays(const row *self)
{
    double start = pt_cpu_seconds(), seconds, traced = 0;
    volatile int hits = 0;

    do {
        hits = hits + trace((const pt_scene *)self->context, &rays, self->flag);
        traced += rays.count;
        seconds = pt_cpu_seconds() - start;
    } while (seconds < 0.1);
    return 1e-6 * traced / seconds;
}

/* A bumpy torus: the mesh of the tree's rows. */
static int add_torus(pt_scene *scene, int material)
{
    const uint32_t points = TORUS_RINGS * TORUS_SECTORS, triangles = 2 * points;
    pt_vec3 *v = (pt_vec3 *)malloc(points * sizeof *v);
    uint32_t *t = (uint32_t *)malloc(3 * triangles * sizeof *t), i, k;
    int id = -1;

    for (i = 0; v && t && i < points; i++) {
        const uint32_t ring = i / TORUS_SECTORS, next = (ring + 1) % TORUS_RINGS * TORUS_SECTORS;
        const uint32_t sector = i % TORUS_SECTORS, beside = (sector + 1) % TORUS_SECTORS;
        const uint32_t row_beside = ring * TORUS_SECTORS + beside;
        const uint32_t quad[6] = {i, next + sector, next + beside, i, next + beside, row_beside};
        const double a = 2 * PT_PI * ring / TORUS_RINGS, b = 2 * PT_PI * sector / TORUS_SECTORS;
        const double r = 0.4 + 0.05 * sin(17 * a) * sin(9 * b), x = 1 + r * cos(b);
        v[i] = pt_v3((pt_real)(x * cos(a)), (pt_real)(r * sin(b)), (pt_real)(x * sin(a)));
        for (k = 0; k < 6; k++) t[6 * i + k] = quad[k];
    }
    if (v && t) id = pt_add_mesh(scene, v, NULL, NULL, points, t, triangles, material);
    free(v);
    free(t);
    return id;
}

static void bench_rays_of(const char *name, const pt_scene *scene)
{
    row rows[2];

    make_rays(scene);
    rows[0] = make_row("closest.", name, "Mrays/s", measure_rays);
    rows[1] = make_row("any.", name, "Mrays/s", measure_rays);
    rows[1].flag = 1;
    rows[1].reference = 0;
    rows[0].context = rows[1].context = scene;
    if (is_wanted(rows[0].name) || is_wanted(rows[1].name)) run_group(rows, 2, ROUNDS);
}

/* Thousand triangles per second through pt_commit, which is the tree but for a few percent. */
static double measure_commit(const row *self)
{
    pt_scene scene = PT_SCENE_INIT;
    double start, seconds = -1;

    (void)self;
    if (add_torus(&scene, pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(1)))) >= 0) {
        start = pt_cpu_seconds();
        if (pt_commit(&scene) == PT_OK) seconds = pt_cpu_seconds() - start;
    }
    seconds = seconds > 0 ? 1e-3 * scene.triangle_count / seconds : -1;
    pt_scene_free(&scene);
    return seconds;
}

static void bench_torus(void)
{
    pt_scene scene = PT_SCENE_INIT;
    row build = make_row("build.", "torus", "ktriangles/s", measure_commit);

    if (is_wanted(build.name)) run_group(&build, 1, ROUNDS);
    if (add_torus(&scene, pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(1)))) >= 0 &&
        pt_commit(&scene) == PT_OK)
        bench_rays_of("torus", &scene);
    pt_scene_free(&scene);
}

static void bench_scenes(void)
{
    int count, i;
    const pt_scene_entry *scenes = pt_scenes(&count);

    for (i = 0; i < count; i++) {
        pt_scene scene = PT_SCENE_INIT;
        pt_camera camera;
        if (scenes[i].make(&scene, &camera) == PT_OK) bench_rays_of(scenes[i].name, &scene);
        pt_scene_free(&scene);
    }
}

/* ---- rendering ----------------------------------------------------------------------------------------- */

enum { AS_IT_IS, ONE_AT_A_TIME, GENERAL, BODIES, SIDE = 64, SAMPLES = 32, TINY_SIDE = 16, TINY_SAMPLES = 8 };

/* What a picture of size x size pixels takes, one thread, by a body. */
static pt_render_desc body_desc(const pt_camera *camera, int body, int size, int spp)
{
    pt_render_desc desc = pt_render_defaults();

    desc.camera = *camera;
    desc.width = desc.height = size;
    desc.spp = (uint32_t)spp;
    desc.threads = 1;
    desc.no_lockstep = body == ONE_AT_A_TIME;
    desc.general_body = body == GENERAL;
    return desc;
}

/* CPU seconds of rendering the scene named `argument`, SIDE^2 * SAMPLES paths; flag: by which body. */
static double measure_render(const row *self)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    pt_camera camera;
    double seconds = -1;

    if (pt_scene_find(self->argument)->make(&scene, &camera) == PT_OK) {
        const pt_render_desc desc = body_desc(&camera, self->flag, SIDE, SAMPLES);
        if (pt_render(&scene, &desc, &film, &report) == PT_OK) seconds = report.cpu_seconds;
    }
    pt_report_free(&report);
    pt_film_free(&film);
    pt_scene_free(&scene);
    return seconds;
}

/* Renders a scene by a body for a table of what was left out. */
static int render_body(const pt_scene *scene, const pt_camera *camera, int body, pt_film *film, pt_report *report)
{
    const pt_render_desc desc = body_desc(camera, body, 32, 8);

    return pt_render(scene, &desc, film, report) == PT_OK;
}

/* The names of a set of features, apart by blanks. */
static const char *feature_words(unsigned features, char *buffer, size_t size)
{
    pt_scene none = PT_SCENE_INIT;
    char *comma = buffer;

    none.needs = features;
    pt_scene_needs_string(&none, buffer, size);
    while ((comma = strchr(comma, ',')) != NULL) *comma = ';';
    return buffer;
}

/* A row of a set of features: how many of the 23 they are, and which. */
static void print_features(const char *prefix, const char *scene, unsigned features)
{
    char name[96], words[512];
    int bits = 0, k;

    for (k = 0; k < 23; k++) bits += (int)(features >> k & 1u);
    snprintf(name, sizeof name, "%s%s", prefix, scene);
    if (is_wanted(name)) printf("%s,%d,features: %s,23,%.3f\n", name, bits, feature_words(features, words, sizeof words), bits / 23.0);
}

/* What a scene needs, and what it does not: what of that runs all the same, code_run.SCENE says. */
static void print_needs(const char *scene, unsigned needs)
{
    print_features("needs.", scene, needs);
    print_features("not_needed.", scene, PT_NEEDS_ALL & ~needs);
}

/* Which body renders a scene, and whether the smallest one for one path at a time has the bits of the general one (1). */
static void print_same_bits(const char *name, const pt_scene *scene, const pt_camera *camera)
{
    pt_film film[BODIES] = {PT_FILM_INIT, PT_FILM_INIT, PT_FILM_INIT};
    pt_report report[BODIES] = {PT_REPORT_INIT, PT_REPORT_INIT, PT_REPORT_INIT};
    const size_t bytes = 3 * 32 * 32 * sizeof(double);
    int k, ok = 1;

    for (k = 0; k < BODIES; k++) ok = ok && render_body(scene, camera, k, &film[k], &report[k]);
    if (ok) {
        k = memcmp(film[ONE_AT_A_TIME].half[0], film[GENERAL].half[0], bytes) == 0 &&
            memcmp(film[ONE_AT_A_TIME].half[1], film[GENERAL].half[1], bytes) == 0;
        printf("%s,%d,%s body; one at a time: %s body,1,%d\n", name, k, report[AS_IT_IS].body, report[ONE_AT_A_TIME].body, k);
    }
    for (k = 0; k < BODIES; k++) {
        pt_film_free(&film[k]);
        pt_report_free(&report[k]);
    }
    fflush(stdout);
}

static void bench_needs(void)
{
    int count, i;
    const pt_scene_entry *scenes = pt_scenes(&count);

    for (i = 0; i < count; i++) {
        pt_scene scene = PT_SCENE_INIT;
        char name[96];
        pt_camera camera;

        if (scenes[i].make(&scene, &camera) == PT_OK) {
            print_needs(scenes[i].name, pt_scene_needs(&scene));
            snprintf(name, sizeof name, "same_bits.%s", scenes[i].name);
            if (is_wanted(name)) print_same_bits(name, &scene, &camera);
        }
        pt_scene_free(&scene);
    }
}

/* What bodies save: each scene by the general one, by the smallest for one path at a time, and as it is rendered. */
static void bench_render(void)
{
    static const char *const prefix[3] = {"render.", "one_at_a_time.", "general_body."};
    int count, i, body;
    const pt_scene_entry *scenes = pt_scenes(&count);

    for (i = 0; i < count; i++) {
        row rows[3];
        int wanted = 0;
        for (body = 0; body < 3; body++) {
            row *r = &rows[2 - body]; /* the general body first: it is the reference */
            *r = make_row(prefix[body], scenes[i].name, "CPU s", measure_render);
            r->argument = scenes[i].name;
            r->flag = body;
            if (body != GENERAL) r->reference = 0;
            wanted |= is_wanted(r->name);
        }
        if (wanted) run_group(rows, 3, ROUNDS);
    }
}

/* ---- the floor of a path ------------------------------------------------------------------------------- */

/* A path cannot be cheaper than its rays. How many there are is counted: the walks of path tracing with and without light
   sampling are the same, number by number, so that what the second traces are nearest hits, and the rest shadow rays. What
   one costs is measured on rays of the same kind, traced alone, without anything else that a path does: walks from the
   camera, pixel after pixel, that scatter as the materials do, with as many edges in the mean as paths have; at each vertex
   a point of a light is asked for. Paths that walk together through a small scene ask a kernel of their own, a ray in each
   lane; all others ask the tree, one ray after the other. */
typedef struct floor_scene {
    const char *name;
    pt_scene scene;
    pt_camera camera;
    double nearest, shadow; /* of each kind a path                                                         */
#if PTI_HAS_LOCKSTEP
    pti_lockstep lanes;
#endif
} floor_scene;

static void add_ray(ray_list *list, pt_ray ray)
{
    if (list->count < RAYS) list->ray[list->count++] = ray;
}

/* The ray to a point of a light, if a path would trace it. */
static void add_shadow_ray(const pt_scene *scene, const pt_hit *hit, const pt_bsdf *bsdf, pt_vec3 wo, pt_pcg32 *rng)
{
    const double which = pt_pcg32_double(rng), u = pt_pcg32_double(rng), v = pt_pcg32_double(rng);
    pt_light_sample_result ls;
    double pmf;
    const int light = pt_light_choose(scene, which, &pmf);
    pt_rgb f;

    if (light < 0 || !pt_light_sample(scene, light, hit->p, pt_v2((pt_real)u, (pt_real)v), &ls)) return;
    f = pt_bsdf_eval(bsdf, wo, ls.wi, PT_RADIANCE, PT_LOBE_ALL);
    if (!(f.r > 0 || f.g > 0 || f.b > 0)) return;
    if (ls.infinite) add_ray(&shadow_rays, pt_spawn_ray(hit->p, hit->p_error, hit->ng, ls.wi));
    else add_ray(&shadow_rays, pt_spawn_ray_to(hit->p, hit->p_error, hit->ng, ls.p, ls.p_error, ls.n));
}

static void add_walk(const pt_scene *scene, pt_ray ray, int edges, pt_pcg32 *rng)
{
    int k;

    for (k = 0; k < edges; k++) {
        const double lobe = pt_pcg32_double(rng), u = pt_pcg32_double(rng), v = pt_pcg32_double(rng);
        const pt_vec3 wo = pt_v3_neg(ray.d);
        pt_bsdf_sample_result s;
        pt_bsdf bsdf;
        pt_hit hit;
        add_ray(&rays, ray);
        if (!pt_intersect(scene, &ray, &hit)) return;
        bsdf = pt_bsdf_make(&scene->materials[hit.material], &hit);
        add_shadow_ray(scene, &hit, &bsdf, wo, rng);
        if (!pt_bsdf_sample(&bsdf, wo, lobe, pt_v2((pt_real)u, (pt_real)v), PT_RADIANCE, &s)) return;
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, s.wi);
    }
}

/* Fills both lists. `edges` need not be whole: walks of two lengths have it as their mean. */
static void make_walks(const floor_scene *f)
{
    pt_pcg32 rng = pt_pcg32_make(5, 5);
    int i;

    rays.count = shadow_rays.count = 0;
    for (i = 0; rays.count < RAYS; i++) {
        const double x = (i % SIDE + pt_pcg32_double(&rng)) / SIDE, y = (i / SIDE % SIDE + pt_pcg32_double(&rng)) / SIDE;
        const double u = pt_pcg32_double(&rng), v = pt_pcg32_double(&rng);
        const pt_ray ray = pt_camera_ray(&f->camera, 1, (pt_real)x, (pt_real)y, pt_v2((pt_real)u, (pt_real)v));
        add_walk(&f->scene, ray, (int)(f->nearest + pt_pcg32_double(&rng)), &rng);
    }
}

/* Rays a path by a method; < 0: it cannot be rendered. */
static double rays_of_path(const floor_scene *f, const char *method, int body)
{
    pt_render_desc desc = body_desc(&f->camera, body, SIDE, SAMPLES);
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    double count = -1;

    desc.method = method;
    if (pt_render(&f->scene, &desc, &film, &report) == PT_OK) count = (double)report.rays / (SIDE * SIDE * SAMPLES);
    pt_report_free(&report);
    pt_film_free(&film);
    return count;
}

#if PTI_HAS_LOCKSTEP
/* A ray in each lane: both lists in the order of lanes. */
typedef struct packet {
    pti_lane_row o[3], d[3], length;
} packet;
static packet packets[2][RAYS / PTI_WIDTH];

static void fill_lane(packet *p, int lane, const pt_ray *ray)
{
    const pt_vec3 o = ray->o;
    const pt_vec3 d = pt_v3_normalize(ray->d);
    const double length = sqrt((double)pt_v3_dot(ray->d, ray->d)) * (double)ray->tmax;

    p->o[0].v[lane] = (float)o.x;
    p->o[1].v[lane] = (float)o.y;
    p->o[2].v[lane] = (float)o.z;
    p->d[0].v[lane] = (float)d.x;
    p->d[1].v[lane] = (float)d.y;
    p->d[2].v[lane] = (float)d.z;
    p->length.v[lane] = (float)fmin(length, 1e30);
}

static void fill_packets(const ray_list *list, packet *to)
{
    int i;

    for (i = 0; i < list->count / PTI_WIDTH * PTI_WIDTH; i++) fill_lane(&to[i / PTI_WIDTH], i % PTI_WIDTH, &list->ray[i]);
}

/* As trace, with as many rays at a time as there are lanes. */
static int trace_packets(const pti_lockstep *k, const packet *p, int count, int any)
{
    int found = 0, i;

    for (i = 0; i < count / PTI_WIDTH; i++) {
        const pti_w3 o = pti_row3(p[i].o), d = pti_row3(p[i].d);
        pti_lock_best best;
        pti_mw met;
        if (any) {
            best.t = p[i].length.f;
            best.i = best.margin = best.key = pti_fw_set(0);
            met = pti_lock_ask(k, o, d, k->e, &best, PTI_LOCK_ANY);
        } else {
            pti_lock_nearest(k, o, d, k->e, &best);
            met = pti_fw_lt(best.t, pti_fw_set(PTI_LOCK_FAR));
        }
        found += pti_count_bits(pti_mw_bits(met));
    }
    return found;
}
#endif

enum { ANY_HIT = 1, IN_LANES = 2 };

/* Nanoseconds a ray of either list; 0 if it is empty. */
static double measure_ray_of_path(const row *self)
{
    const floor_scene *f = (const floor_scene *)self->context;
    const int any = self->flag & ANY_HIT;
    const ray_list *list = any ? &shadow_rays : &rays;
    double start = pt_cpu_seconds(), seconds, traced = 0;
    volatile int hits = 0;

    if (list->count < 64) return 0;
    do {
#if PTI_HAS_LOCKSTEP
        if (self->flag & IN_LANES) hits = hits + trace_packets(&f->lanes, packets[any], list->count, any);
        else
#endif
            hits = hits + trace(&f->scene, list, any);
        traced += list->count;
        seconds = pt_cpu_seconds() - start;
    } while (seconds < 0.1);
    return 1e9 * seconds / traced;
}

/* Do paths of this scene walk together? Then its lanes are made ready, as for a render. */
static int is_lockstep(floor_scene *f)
{
#if PTI_HAS_LOCKSTEP
    const pt_render_desc desc = body_desc(&f->camera, AS_IT_IS, SIDE, SAMPLES);
    int technique;

    return pti_pick_lockstep(pt_method_find("path"), &f->scene, &desc, &f->lanes, &technique);
#else
    (void)f;
    return 0;
#endif
}

/* Are the rays of such a scene asked a lane each? */
static int has_kernel(const floor_scene *f)
{
#if PTI_HAS_LOCKSTEP
    return f->lanes.tree == NULL;
#else
    (void)f;
    return 0;
#endif
}

/* One row: nanoseconds a path, over those of its rays alone. */
static void print_floor(const char *prefix, floor_scene *f, int body, int lanes)
{
    row rows[3];
    char name[64], unit[128];
    double all;

    snprintf(name, sizeof name, "%s%s", prefix, f->name);
    if (!is_wanted(name)) return;
    f->nearest = rays_of_path(f, "path-plain", body);
    all = rays_of_path(f, "path", body);
    if (!(f->nearest > 0) || all < f->nearest) return;
    f->shadow = all - f->nearest;
    make_walks(f);
#if PTI_HAS_LOCKSTEP
    fill_packets(&rays, packets[0]);
    fill_packets(&shadow_rays, packets[1]);
#endif
    rows[0] = make_row("", "nearest", "ns", measure_ray_of_path);
    rows[1] = make_row("", "shadow", "ns", measure_ray_of_path);
    rows[2] = make_row("", "path", "CPU s", measure_render);
    rows[0].context = rows[1].context = f;
    rows[0].flag = lanes ? IN_LANES : 0;
    rows[1].flag = rows[0].flag | ANY_HIT;
    rows[2].argument = f->name;
    rows[2].flag = body;
    take_medians(rows, 3, ROUNDS);
    snprintf(unit, sizeof unit, "ns a path: %.2f nearest hits of %.1f ns and %.2f shadow rays of %.1f ns", f->nearest,
             rows[0].median, f->shadow, rows[1].median);
    print_row(name, 1e9 * rows[2].median / (SIDE * SIDE * SAMPLES), unit,
              f->nearest * rows[0].median + f->shadow * rows[1].median);
}

static void bench_floor(void)
{
    static floor_scene f;
    int count, i;
    const pt_scene_entry *scenes = pt_scenes(&count);

    for (i = 0; i < count; i++) {
        memset(&f, 0, sizeof f);
        f.name = scenes[i].name;
        if (scenes[i].make(&f.scene, &f.camera) == PT_OK) {
            const int together = is_lockstep(&f);
            print_floor("floor.", &f, AS_IT_IS, together && has_kernel(&f));
            if (together) print_floor("floor_one_at_a_time.", &f, ONE_AT_A_TIME, 0);
        }
        pt_scene_free(&f.scene);
    }
}

/* ---- instructions, and the code that runs --------------------------------------------------------------- */

/* bench --render SCENE BODY: what is counted; BODIES stands for making the scene and rendering nothing. */
static int render_tiny(const char *name, int body)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_camera camera;
    const pt_scene_entry *entry = pt_scene_find(name);
    int ok = entry && entry->make(&scene, &camera) == PT_OK;

    if (ok && body < BODIES) {
        const pt_render_desc desc = body_desc(&camera, body, TINY_SIDE, TINY_SAMPLES);
        ok = pt_render(&scene, &desc, &film, NULL) == PT_OK;
    }
    pt_film_free(&film);
    pt_scene_free(&scene);
    return !ok;
}

#if defined(__unix__) || defined(__APPLE__)
#define CALLS "build/bench_calls.out"

typedef struct function {
    char name[64];
    double bytes;
    int ran;
} function;

typedef struct function_list {
    function *items;
    int count;
} function_list;

/* One line of a command's output; 0 at its end. */
static int next_line(FILE *f, char *line, int size)
{
    return f && fgets(line, size, f) != NULL;
}

static void add_function(function_list *list, const char *name, double bytes)
{
    function *grown = (function *)realloc(list->items, ((size_t)list->count + 1) * sizeof *grown);

    if (!grown) return;
    list->items = grown;
    memset(&grown[list->count], 0, sizeof *grown);
    snprintf(grown[list->count].name, sizeof grown->name, "%.63s", name);
    grown[list->count++].bytes = bytes;
}

/* The functions in an object file or program as nm tells them: "address size type name". */
static int list_functions(function_list *list, const char *file)
{
    char command[512], line[512], name[256], type;
    unsigned long bytes;
    FILE *f;

    list->items = NULL;
    list->count = 0;
    snprintf(command, sizeof command, "nm -S %s 2> /dev/null", file);
    f = popen(command, "r");
    while (next_line(f, line, sizeof line))
        if (sscanf(line, "%*s %lx %c %255s", &bytes, &type, name) == 3 && strchr("tTwW", type)) add_function(list, name, (double)bytes);
    if (f) pclose(f);
    return list->count;
}

static int compare_names(const void *a, const void *b)
{
    return strcmp(((const function *)a)->name, ((const function *)b)->name);
}

/* Marks a function that callgrind names: "fn=(12) name", and cfn= of those that are called; recursion adds 'n. */
static void mark_line(function_list *list, char *line)
{
    const char *start = strncmp(line, "fn=", 3) == 0 || strncmp(line, "cfn=", 4) == 0 ? strstr(line, ") ") : NULL;
    function key, *found;

    if (!start) return;
    line[strcspn(line, "'\n")] = 0;
    snprintf(key.name, sizeof key.name, "%.63s", start + 2);
    found = (function *)bsearch(&key, list->items, (size_t)list->count, sizeof key, compare_names);
    if (found) found->ran = 1;
}

/* Instructions by callgrind, within the tasks of a render alone: camera, paths, film, without what is made once. `list`
   tells which functions ran in them. < 0: no callgrind. */
static double count_by_callgrind(const char *program, const char *scene, int body, function_list *list)
{
    char command[512], line[1024];
    double count = -1;
    FILE *f;

    snprintf(command, sizeof command,
             "valgrind --tool=callgrind --toggle-collect=pti_render_tile --callgrind-out-file=" CALLS
             " %s --render %s %d > /dev/null 2>&1", program, scene, body);
    remove(CALLS);
    if (system(command) != 0) return -1;
    f = fopen(CALLS, "r");
    while (next_line(f, line, sizeof line)) {
        if (strncmp(line, "totals: ", 8) == 0) count = strtod(line + 8, NULL);
        mark_line(list, line);
    }
    if (f) fclose(f);
    remove(CALLS);
    return count > 0 ? count : -1;
}

/* Instructions of the whole program by perf; < 0: no perf, or a machine that does not count. */
static double perf_total(const char *program, const char *scene, int body)
{
    char command[512], line[512], *end;
    double count = -1;
    FILE *f;

    snprintf(command, sizeof command, "perf stat -x, -e instructions:u %s --render %s %d 2>&1 > /dev/null", program, scene, body);
    f = popen(command, "r");
    while (next_line(f, line, sizeof line))
        if (strstr(line, "instructions")) {
            count = strtod(line, &end);
            if (end == line) count = -1;
        }
    if (f) pclose(f);
    return count;
}

/* Instructions of a render. perf counts the whole program: less what it does without rendering. */
static double count_instructions(const char *program, const char *scene, int body, function_list *list)
{
    double count = count_by_callgrind(program, scene, body, list), none;

    if (count >= 0) return count;
    none = perf_total(program, scene, BODIES);
    count = perf_total(program, scene, body);
    return none > 0 && count > none ? count - none : -1;
}

/* Bytes of all functions that ran; clears the marks. */
static double bytes_that_ran(function_list *list)
{
    double sum = 0;
    int i;

    for (i = 0; i < list->count; i++) {
        sum += list->items[i].ran ? list->items[i].bytes : 0;
        list->items[i].ran = 0;
    }
    return sum;
}

/* The names of both rows of a scene and body; 0: nobody wants them. */
static int name_counts(char name[2][96], const char *scene, int body)
{
    static const char *const by[BODIES] = {"", "_one_at_a_time", "_general"};

    snprintf(name[0], sizeof name[0], "instructions%s.%s", by[body], scene);
    snprintf(name[1], sizeof name[1], "code_run%s.%s", by[body], scene);
    return is_wanted(name[0]) || is_wanted(name[1]);
}

/* Instructions and running code of a scene, by each body; 0: neither valgrind nor perf counts here. */
static int print_counts(const char *program, const char *scene, function_list *list)
{
    const double paths = TINY_SIDE * TINY_SIDE * TINY_SAMPLES;
    double general = 0, general_bytes = 0;
    char name[2][96];
    int body, wanted = 0;

    for (body = 0; body < BODIES; body++) wanted |= name_counts(name, scene, body);
    for (body = GENERAL; wanted && body >= 0; body--) { /* the general body first: it is the reference */
        const double count = count_instructions(program, scene, body, list) / paths, bytes = bytes_that_ran(list);
        if (count < 0) return 0;
        name_counts(name, scene, body);
        print_row(name[0], count, "instructions a path", general);
        if (bytes > 0) print_row(name[1], bytes, "bytes of the functions that run", general_bytes);
        if (body == GENERAL) {
            general = count;
            general_bytes = bytes;
        }
    }
    return 1;
}

static void bench_counts(const char *program)
{
    int count, i, can = 1;
    const pt_scene_entry *scenes = pt_scenes(&count);
    function_list list;

    if (list_functions(&list, program) > 0) qsort(list.items, (size_t)list.count, sizeof *list.items, compare_names);
    for (i = 0; i < count && can; i++) can = print_counts(program, scenes[i].name, &list);
    if (!can) fprintf(stderr, "bench: instructions: skipped, neither valgrind nor perf counts them here\n");
    free(list.items);
}
#else
static void bench_counts(const char *program) { (void)program; }
#endif

/* ---- threads ------------------------------------------------------------------------------------------- */

#if defined(__unix__) || defined(__APPLE__)
/* Wall seconds of `processes` processes that each render the Cornell box with `threads` threads. */
static double wall_seconds(int processes, int threads)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_render_desc desc = pt_render_defaults();
    double start, seconds = -1;
    int i, failed = 0, status;

    desc.width = desc.height = 256;
    desc.spp = 64 * (uint32_t)threads; /* as much for each thread */
    desc.threads = threads;
    desc.no_lockstep = 1;
    if (pt_scene_cornell(&scene, &desc.camera) != PT_OK) return -1;
    desc.spp /= 4;
    fflush(stdout);
    start = pt_wall_seconds();
    for (i = 0; i < processes; i++) {
        const pid_t child = fork();
        if (child == 0) {
            pt_film film = PT_FILM_INIT;
            _exit(pt_render(&scene, &desc, &film, NULL) != PT_OK);
        }
        failed |= child < 0;
    }
    for (i = 0; i < processes; i++) failed |= wait(&status) < 0 || status != 0;
    seconds = pt_wall_seconds() - start;
    pt_scene_free(&scene);
    return failed ? -1 : seconds;
}

/* How often the same work is done in a second by two threads of one process, or by two processes of one. */
static double measure_threads(const row *self)
{
    const double seconds = self->flag ? wall_seconds(1, 2) : wall_seconds(2, 1);

    return seconds > 0 ? 1 / seconds : -1;
}

static void bench_threads(void)
{
    row rows[2];

    rows[0] = make_row("threads.", "two_processes", "renders/s", measure_threads);
    rows[1] = make_row("threads.", "two_threads", "renders/s", measure_threads);
    rows[1].flag = 1;
    rows[1].reference = 0;
    if (is_wanted(rows[0].name) || is_wanted(rows[1].name)) run_group(rows, 2, ROUNDS);
}
#else
static void bench_threads(void) {}
#endif

/* ---- compiling ----------------------------------------------------------------------------------------- */

#define OBJECT "build/bench_object.o"

/* Compiles the header's implementation alone with the switches in `argument`; 1 if that worked. */
static int compile(const char *argument)
{
    char command[512];
    const char *cc = getenv("CC");

    snprintf(command, sizeof command,
             "echo '#include \"pathtracer.h\"' | %s -std=c99 -ffp-contract=off -O2 -I. "
             "-DPATHTRACER_IMPLEMENTATION %s -x c -c - -o " OBJECT " > /dev/null 2>&1",
             cc && cc[0] ? cc : "cc", argument);
    return system(command) == 0;
}

static double measure_compile_seconds(const row *self)
{
    double start = pt_wall_seconds();

    return compile(self->argument) ? pt_wall_seconds() - start : -1;
}

/* Size of the object file in KiB; without debugging information nearly all of it is code and tables. */
static double measure_object_size(const row *self)
{
    FILE *f;
    long size = -1;

    if (!compile(self->argument)) return -1;
    f = fopen(OBJECT, "rb");
    if (!f) return -1;
    if (fseek(f, 0, SEEK_END) == 0) size = ftell(f);
    fclose(f);
    return size < 0 ? -1 : (double)size / 1024;
}

#if defined(__unix__) || defined(__APPLE__)
/* Bytes of the functions whose names begin so; parts that the compiler split off have a dot and a word more. */
static double bytes_of(const function_list *list, const char *beginning)
{
    double sum = 0;
    int i;

    for (i = 0; i < list->count; i++)
        if (strncmp(list->items[i].name, beginning, strlen(beginning)) == 0) sum += list->items[i].bytes;
    return sum;
}

/* Code of the bodies of the path integrator. The first two leave rays, lights and materials to functions that all methods
   share; the walk in lanes has its own of everything. What of that runs, code_run.SCENE says. */
static void bench_code(void)
{
    function_list list = {NULL, 0};
    double general;

    if (!is_wanted("code.general") && !is_wanted("code.diffuse") && !is_wanted("code.lockstep")) return;
    if (!compile("") || list_functions(&list, OBJECT) == 0 || (general = bytes_of(&list, "pti_path_general")) <= 0) {
        fprintf(stderr, "bench: code: skipped, nm does not tell the sizes of functions here\n");
    } else {
        print_row("code.general", general, "bytes without what it calls", 0);
        print_row("code.diffuse", bytes_of(&list, "pti_path_diffuse"), "bytes without what it calls", general);
        print_row("code.lockstep", bytes_of(&list, "pti_lock_"), "bytes with its own rays; lights; materials", general);
    }
    remove(OBJECT);
    free(list.items);
}
#else
static void bench_code(void) {}
#endif

#define ALL_LEFT_OUT \
    "-DPT_ONLY_PATH -DPT_NO_THREADS -DPT_NO_STDIO -DPT_NO_BVH -DPT_NO_SIMD -DPT_NO_ENVIRONMENT -DPT_NO_REPORT " \
    "-DPT_NO_MICROFACET -DPT_NO_PHONG -DPT_NO_COAT -DPT_NO_MEASURED -DPT_NO_TEXTURES"

static void bench_compile(void)
{
    static const char *const variants[][2] = {
        {"whole", ""}, {"PT_ONLY_PATH", "-DPT_ONLY_PATH"}, {"PT_NO_THREADS", "-DPT_NO_THREADS"},
        {"PT_NO_STDIO", "-DPT_NO_STDIO"}, {"PT_NO_FILES", "-DPT_NO_FILES"}, {"PT_NO_OBJ", "-DPT_NO_OBJ"}, {"PT_NO_BVH", "-DPT_NO_BVH"},
        {"PT_NO_SIMD", "-DPT_NO_SIMD"}, {"PT_NO_INTRINSICS", "-DPT_NO_INTRINSICS"},
        {"PT_NO_ENVIRONMENT", "-DPT_NO_ENVIRONMENT"}, {"PT_NO_OBSERVER", "-DPT_NO_OBSERVER"},
        {"PT_NO_MICROFACET", "-DPT_NO_MICROFACET"}, {"PT_NO_PHONG", "-DPT_NO_PHONG"}, {"PT_NO_COAT", "-DPT_NO_COAT"},
        {"PT_NO_MEASURED", "-DPT_NO_MEASURED"}, {"PT_NO_TEXTURES", "-DPT_NO_TEXTURES"}, {"PT_NO_WHITTED", "-DPT_NO_WHITTED"},
        {"PT_NO_LPE", "-DPT_NO_LPE"}, {"PT_NO_REPORT", "-DPT_NO_REPORT"}, {"PT_NO_SCENES", "-DPT_NO_SCENES"},
        {"all_left_out", ALL_LEFT_OUT}, {"PT_DOUBLE", "-DPT_DOUBLE"}};
    const int count = (int)(sizeof variants / sizeof variants[0]);
    row times[MAX_ROWS], sizes[MAX_ROWS];
    int i;

    for (i = 0; i < count; i++) {
        times[i] = make_row("compile.", variants[i][0], "s", measure_compile_seconds);
        sizes[i] = make_row("object.", variants[i][0], "KiB", measure_object_size);
        times[i].argument = sizes[i].argument = variants[i][1];
        if (i > 0) times[i].reference = sizes[i].reference = 0;
    }
    times[0].limit = 5; /* the header compiles alone in under 5 s */
    if (is_wanted("compile.")) run_group(times, count, 3);
    if (is_wanted("object.")) run_group(sizes, count, 1);
    remove(OBJECT);
}

int main(int argc, char **argv)
{
    if (argc == 4 && strcmp(argv[1], "--render") == 0) return render_tiny(argv[2], atoi(argv[3]));
    wanted_count = argc - 1;
    wanted_names = argv + 1;
    printf("name,value,unit,reference,ratio\n");
    bench_scenes();
    bench_torus();
    bench_needs();
    bench_render();
    bench_floor();
    bench_counts(argv[0]);
    bench_threads();
    bench_code();
    bench_compile();
    return 0;
}
