/* bench.c - what things cost: rays per second, building the tree, leaving features out, compiling.

   build:  cc -O2 -ffp-contract=off -I. tests/bench/bench.c -o bench -lm -pthread
   run:    CC=cc ./bench [name ...]       in the project's top directory; names choose rows by their beginning

   CSV on stdout: name,value,unit,reference,ratio. A value is the median of ROUNDS rounds, in which the rows
   of a group take turns, so that a machine that slows down does so for all of them. `reference` is the row
   or limit that the value is compared with, `ratio` is value / reference: the figure to quote, since absolute
   speeds of one machine say little about another. One thread, CPU seconds. */

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

/* Runs a group in turns and prints its rows. */
static void run_group(row *rows, int count, int rounds)
{
    int r, i;

    for (r = 0; r < rounds; r++)
        for (i = 0; i < count; i++) rows[i].values[r] = rows[i].measure(&rows[i]);
    for (i = 0; i < count; i++) {
        qsort(rows[i].values, (size_t)rounds, sizeof(double), compare_doubles);
        rows[i].median = rows[i].values[rounds / 2];
    }
    for (i = 0; i < count; i++) {
        const double reference = rows[i].reference >= 0 ? rows[rows[i].reference].median : rows[i].limit;
        if (!is_wanted(rows[i].name)) continue;
        if (!(rows[i].median >= 0)) fprintf(stderr, "bench: %s: not available\n", rows[i].name);
        else if (reference > 0)
            printf("%s,%.4g,%s,%.4g,%.3f\n", rows[i].name, rows[i].median, rows[i].unit, reference,
                   rows[i].median / reference);
        else printf("%s,%.4g,%s,,\n", rows[i].name, rows[i].median, rows[i].unit);
    }
    fflush(stdout);
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

static pt_ray rays[RAYS];

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
        rays[i].o = pt_v3_add(scene->lo, pt_v3(u.x * size.x, u.y * size.y, w * size.z));
        rays[i].d = pt_warp_sphere(v);
        rays[i].tmax = (pt_real)1e30;
    }
}

/* Million rays per second; flag 0 = nearest hit, 1 = any hit. Repeats until 0.1 s have passed. */
static double measure_rays(const row *self)
{
    const pt_scene *scene = (const pt_scene *)self->context;
    double start = pt_cpu_seconds(), seconds, traced = 0;
    volatile int hits = 0;
    int found, i;
    pt_hit hit;

    do {
        for (i = found = 0; i < RAYS; i++)
            found += self->flag ? pt_occluded(scene, &rays[i]) : pt_intersect(scene, &rays[i], &hit);
        hits = hits + found;
        traced += RAYS;
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

enum { AS_IT_IS, ONE_AT_A_TIME, GENERAL };

/* Million rays per second of rendering the scene named `argument`, one thread; flag: by which body. */
static double measure_render(const row *self)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    pt_render_desc desc = pt_render_defaults();
    double speed = -1;

    desc.width = desc.height = 64;
    desc.spp = 32;
    desc.threads = 1;
    desc.no_lockstep = self->flag == ONE_AT_A_TIME;
    desc.general_body = self->flag == GENERAL;
    if (pt_scene_find(self->argument)->make(&scene, &desc.camera) == PT_OK &&
        pt_render(&scene, &desc, &film, &report) == PT_OK)
        speed = 1e-6 * (double)report.rays / report.cpu_seconds;
    pt_report_free(&report);
    pt_film_free(&film);
    pt_scene_free(&scene);
    return speed;
}

/* Renders a scene by a body for a table of what was left out. */
static int render_body(const pt_scene *scene, const pt_camera *camera, int body, pt_film *film, pt_report *report)
{
    pt_render_desc desc = pt_render_defaults();

    desc.camera = *camera;
    desc.width = desc.height = 32;
    desc.spp = 8;
    desc.threads = 1;
    desc.no_lockstep = body == ONE_AT_A_TIME;
    desc.general_body = body == GENERAL;
    return pt_render(scene, &desc, film, report) == PT_OK;
}

/* What each scene needs, which body renders it, and whether the smallest one for one path at a time has the bits of the general
   one (value 1). */
static void bench_needs(void)
{
    int count, i;
    const pt_scene_entry *scenes = pt_scenes(&count);

    for (i = 0; i < count; i++) {
        pt_scene scene = PT_SCENE_INIT;
        pt_film film[3] = {PT_FILM_INIT, PT_FILM_INIT, PT_FILM_INIT};
        pt_report report[3] = {PT_REPORT_INIT, PT_REPORT_INIT, PT_REPORT_INIT};
        char words[512], name[96], *comma;
        pt_camera camera;
        int k, ok = scenes[i].make(&scene, &camera) == PT_OK, bits = 0;

        for (k = 0; k < 3; k++) ok = ok && render_body(&scene, &camera, k, &film[k], &report[k]);
        snprintf(name, sizeof name, "needs.%s", scenes[i].name);
        if (ok && is_wanted(name)) {
            const unsigned needs = pt_scene_needs(&scene);
            for (k = 0; k < 23; k++) bits += (int)(needs >> k & 1u);
            pt_scene_needs_string(&scene, words, sizeof words);
            for (comma = words; (comma = strchr(comma, ',')) != NULL;) *comma = ' ';
            printf("needs.%s,%d,of 23 features: %s,23,%.3f\n", scenes[i].name, bits, words, bits / 23.0);
            k = memcmp(film[1].half[0], film[2].half[0], 3 * 32 * 32 * sizeof(double)) == 0 &&
                memcmp(film[1].half[1], film[2].half[1], 3 * 32 * 32 * sizeof(double)) == 0;
            printf("same_bits.%s,%d,%s body; one at a time: %s body,1,%d\n", scenes[i].name, k, report[0].body, report[1].body, k);
        }
        for (k = 0; k < 3; k++) {
            pt_film_free(&film[k]);
            pt_report_free(&report[k]);
        }
        pt_scene_free(&scene);
    }
    fflush(stdout);
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
            *r = make_row(prefix[body], scenes[i].name, "Mrays/s", measure_render);
            r->argument = scenes[i].name;
            r->flag = body;
            if (body != GENERAL) r->reference = 0;
            wanted |= is_wanted(r->name);
        }
        if (wanted) run_group(rows, 3, ROUNDS);
    }
}

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
    wanted_count = argc - 1;
    wanted_names = argv + 1;
    printf("name,value,unit,reference,ratio\n");
    bench_scenes();
    bench_torus();
    bench_needs();
    bench_render();
    bench_threads();
    bench_compile();
    return 0;
}
