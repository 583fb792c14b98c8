/* test_driver.c: films, the render driver and image files [PT-10, PT-17, PT-18].

       cc -O2 -ffp-contract=off -I. tests/test_driver.c -o test_driver -lm -pthread && ./test_driver

   Run it in the project's top directory. Files are written to build/test if that is a directory, else to the
   current one, and removed. LONG=1 checks the estimated error at 64 and 256 samples too. */

#include "pt_test.h"

static pt_rgb grey(double v) { return pt_rgb_grey((pt_real)v); }

/* ---- renders ---------------------------------------------------------------------------------------- */

typedef struct stage {
    pt_scene scene;
    pt_camera camera;
} stage;

/* A canonical scene by its name. */
static stage stage_of(const char *name)
{
    const pt_scene_entry *const entry = pt_scene_find(name);
    stage s;
    memset(&s, 0, sizeof s);
    if (!entry || entry->make(&s.scene, &s.camera) != PT_OK)
        pt_check(0, "canonical scene", "%s cannot be made", name);
    return s;
}

static pt_render_desc desc_of(const stage *s, int width, int height, uint32_t spp)
{
    pt_render_desc d = pt_render_defaults();
    d.camera = s->camera;
    d.width = width;
    d.height = height;
    d.spp = spp;
    d.seed = pt_test_seed(1);
    d.threads = 2;
    return d;
}

static pt_film render(const stage *s, const pt_render_desc *d)
{
    pt_film film = PT_FILM_INIT;
    const pt_result result = pt_render(&s->scene, d, &film, NULL);
    if (result != PT_OK) pt_check(0, "pt_render", "%s", pt_result_string(result));
    return film;
}

static int same_sums(const double *a, const double *b, size_t n)
{
    if (!a || !b) return a == b;
    return memcmp(a, b, n * sizeof *a) == 0;
}

/* Bit by bit. */
static int same_film(const pt_film *a, const pt_film *b)
{
    const size_t n = (size_t)a->width * (size_t)a->height;
    uint32_t i;
    if (a->width != b->width || a->height != b->height || a->fingerprint != b->fingerprint) return 0;
    if (a->samples[0] != b->samples[0] || a->samples[1] != b->samples[1] || a->range_count != b->range_count)
        return 0;
    for (i = 0; i < a->range_count; i++)
        if (a->ranges[i].begin != b->ranges[i].begin || a->ranges[i].end != b->ranges[i].end) return 0;
    return n > 0 && same_sums(a->half[0], b->half[0], 3 * n) && same_sums(a->half[1], b->half[1], 3 * n) &&
           same_sums(a->splat[0], b->splat[0], 3 * n) && same_sums(a->splat[1], b->splat[1], 3 * n) &&
           same_sums(a->albedo, b->albedo, 3 * n) && same_sums(a->normal, b->normal, 3 * n) &&
           same_sums(a->depth, b->depth, n);
}

/* Renders and compares with `expected`. */
static void check_same(const char *name, const stage *s, const pt_render_desc *d, const pt_film *expected)
{
    pt_film film = render(s, d);
    pt_check(same_film(&film, expected), name, "the films differ");
    pt_film_free(&film);
}

/* Runs the tasks in another order: from the last one, or in a random one. */
static void backwards(void *user, int count, void (*task)(void *context, int index), void *context)
{
    (void)user;
    while (count-- > 0) task(context, count);
}

static void shuffled(void *user, int count, void (*task)(void *context, int index), void *context)
{
    int order[1024], i;
    pt_pcg32 rng = pt_pcg32_make(7, 7);
    *(int *)user += count;
    if (count > 1024) count = 1024;
    for (i = 0; i < count; i++) {
        const int k = (int)(pt_pcg32_next(&rng) % (uint32_t)(i + 1));
        order[i] = order[k];
        order[k] = i;
    }
    for (i = 0; i < count; i++) task(context, order[i]);
}

/* ---- the film is a function of the scene and the samples, not of who made them ---------------------- */

static void same_bits_threads(void)
{
    static const int threads[4] = {1, 2, 3, 7}, tile[3] = {8, 16, 64};
    stage s = stage_of("cornell");
    pt_render_desc d = desc_of(&s, 45, 34, 6);
    pt_film first;
    int i, k, tasks = 0;
    d.threads = 1;
    d.aov = 1;
    first = render(&s, &d);
    for (i = 0; i < 4; i++)
        for (k = 0; k < 3; k++) {
            d.threads = threads[i];
            d.tile = tile[k];
            check_same(label("%d threads, tiles of %d", threads[i], tile[k]), &s, &d, &first);
        }
    d.tile = 8;
    d.parallel = backwards;
    check_same("own threads, last task first", &s, &d, &first);
    d.parallel = shuffled;
    d.parallel_user = &tasks;
    check_same("own threads, tasks in random order", &s, &d, &first);
    pt_check(tasks >= 30, "own threads are used", "%d tasks", tasks);
    d.seed++;
    {
        pt_film other = render(&s, &d);
        pt_check(!same_film(&other, &first), "another seed, another film", "they are the same");
        pt_check(memcmp(other.half[0], first.half[0], sizeof(double) * 3 * 45 * 34) != 0,
                 "another seed, other sums", "equal");
        pt_film_free(&other);
    }
    pt_film_free(&first);
    pt_scene_free(&s.scene);
}

static void same_bits_samplers(void)
{
    int kind;
    stage s = stage_of("cornell-spheres");
    for (kind = PT_SAMPLER_SOBOL; kind <= PT_SAMPLER_STRATIFIED; kind++) {
        pt_render_desc d = desc_of(&s, 23, 31, 9);
        pt_film first;
        d.sampler = (pt_sampler_kind)kind;
        d.threads = 1;
        first = render(&s, &d);
        d.threads = 3;
        d.tile = 5;
        check_same(label("3 threads, %s", pt_sampler_name((pt_sampler_kind)kind)), &s, &d, &first);
        pt_film_free(&first);
    }
    pt_scene_free(&s.scene);
}

/* Budgets cut the render into other passes; at the same count the film is the same. */
static void same_bits_passes(void)
{
    stage s = stage_of("cornell");
    pt_render_desc d = desc_of(&s, 24, 24, 0);
    pt_report report = PT_REPORT_INIT;
    int i;
    for (i = 0; i < 3; i++) {
        pt_film film = PT_FILM_INIT;
        const char *const word[3] = {"seconds", "CPU seconds", "error"};
        d = desc_of(&s, 24, 24, 0);
        if (i == 0) d.seconds = 0.25;
        if (i == 1) d.cpu_seconds = 0.25;
        if (i == 2) d.target_error = 0.25;
        pt_check(pt_render(&s.scene, &d, &film, &report) == PT_OK, label("budget of %s", word[i]), "fails");
        pt_check(report.stopped_by && strcmp(report.stopped_by, word[i]) == 0,
                 label("budget of %s, stopped by", word[i]), "%s",
                 report.stopped_by ? report.stopped_by : "nothing");
        pt_check(report.spp > 0 && report.spp == pt_film_spp(&film), label("budget of %s, samples", word[i]),
                 "report %u, film %u", (unsigned)report.spp, (unsigned)pt_film_spp(&film));
        pt_check(i == 2 || report.wall_seconds < 5, label("budget of %s, time", word[i]), "%g s",
                 report.wall_seconds);
        if (i == 2) {
            pt_error e = {0, 0, 0};
            const int known = pt_film_error_estimate(&film, &e);
            pt_check(known && sqrt(e.relmse) < 0.25, "target error reached", "%g", sqrt(e.relmse));
            pt_check(film.range_count == 1 && (report.spp & (report.spp - 1)) == 0,
                     "target error, doubled samples", "%u", (unsigned)report.spp);
        }
        d = desc_of(&s, 24, 24, report.spp);
        check_same(label("budget of %s = %u samples", word[i], (unsigned)report.spp), &s, &d, &film);
        pt_film_free(&film);
    }
    pt_report_free(&report);
    pt_scene_free(&s.scene);
}

/* A sample budget together with a longer time budget ends by samples. */
static void first_budget_wins(void)
{
    stage s = stage_of("furnace");
    pt_render_desc d = desc_of(&s, 8, 8, 5);
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    d.seconds = 100;
    d.cpu_seconds = 100;
    d.target_error = 1e-9;
    pt_check(pt_render(&s.scene, &d, &film, &report) == PT_OK && report.spp == 5, "samples before seconds",
             "%u samples", (unsigned)report.spp);
    pt_check(report.stopped_by && strcmp(report.stopped_by, "samples") == 0,
             "samples before seconds, stopped by", "%s", report.stopped_by ? report.stopped_by : "nothing");
    pt_film_free(&film);
    pt_report_free(&report);
    pt_scene_free(&s.scene);
}

/* Continued in uneven steps = undisturbed. */
static void continued(void)
{
    static const uint32_t step[4] = {3, 4, 11, 18};
    int kind, i, single;
    stage s = stage_of("cornell");
    for (kind = PT_SAMPLER_SOBOL; kind <= PT_SAMPLER_INDEPENDENT; kind++)
        for (single = 0; single < 2; single++) {
            pt_render_desc d = desc_of(&s, 20, 17, 18);
            pt_film film = PT_FILM_INIT, whole;
            d.sampler = (pt_sampler_kind)kind;
            d.single_net = single;
            d.aov = 1;
            whole = render(&s, &d);
            for (i = 0; i < 4; i++) {
                d.spp = step[i];
                pt_check(pt_render(&s.scene, &d, &film, NULL) == PT_OK && pt_film_spp(&film) == step[i],
                         "continued", "to %u samples: film has %u", (unsigned)step[i],
                         (unsigned)pt_film_spp(&film));
            }
            pt_check(same_film(&film, &whole),
                     label("continued = undisturbed, %s%s", pt_sampler_name(d.sampler),
                           single ? ", single net" : ""),
                     "the films differ");
            pt_check(pt_render(&s.scene, &d, &film, NULL) == PT_OK && same_film(&film, &whole),
                     "continued to where it is", "something was added");
            pt_film_free(&film);
            pt_film_free(&whole);
        }
    pt_scene_free(&s.scene);
}

/* Something else than a continuation is refused, and the film stays as it was. */
static void continued_refused(void)
{
    stage s = stage_of("furnace"), other = stage_of("cornell");
    pt_render_desc d = desc_of(&s, 6, 5, 4);
    pt_film film = render(&s, &d), copy = render(&s, &d);
    int i;
    for (i = 0; i < 6; i++) {
        pt_render_desc e = d;
        pt_result result;
        e.spp = 8;
        if (i == 0) e.seed++;
        if (i == 1) e.width++;
        if (i == 2) e.method = "path-plain";
        if (i == 3) e.sampler = PT_SAMPLER_INDEPENDENT;
        if (i == 4) e.li.max_edges = 3;
        result = pt_render(i == 5 ? &other.scene : &s.scene, &e, &film, NULL);
        pt_check(result == PT_ERROR_MISMATCH && same_film(&film, &copy), label("no continuation %d", i), "%s",
                 pt_result_string(result));
    }
    pt_film_free(&film);
    pt_film_free(&copy);
    pt_scene_free(&s.scene);
    pt_scene_free(&other.scene);
}

static double relative_difference(const pt_film *a, const pt_film *b)
{
    const size_t n = 3 * (size_t)a->width * (size_t)a->height;
    double worst = 0;
    size_t i;
    int h;
    for (h = 0; h < 2; h++)
        for (i = 0; i < n; i++) {
            const double x = a->half[h][i], y = b->half[h][i];
            if (fabs(x) + fabs(y) > 0) worst = fmax(worst, fabs(x - y) / fmax(fabs(x), fabs(y)));
        }
    return worst;
}

/* Shards of uneven size, merged in another order = the whole within 1e-12. */
static void shards(void)
{
    static const uint32_t begin[3] = {5, 0, 9}, end[3] = {9, 5, 16};
    stage s = stage_of("cornell");
    pt_render_desc d = desc_of(&s, 16, 19, 16);
    pt_film whole, sum = PT_FILM_INIT;
    int i;
    d.aov = 1;
    whole = render(&s, &d);
    for (i = 0; i < 3; i++) {
        pt_film part;
        d.first_sample = begin[i];
        d.spp = end[i] - begin[i];
        part = render(&s, &d);
        pt_check(part.samples[0] == (end[i] + 1) / 2 - (begin[i] + 1) / 2 &&
                     part.samples[1] == end[i] / 2 - begin[i] / 2,
                 label("shard %d, halves", i), "%u even and %u odd samples", (unsigned)part.samples[0],
                 (unsigned)part.samples[1]);
        if (i == 0)
            sum = part;
        else {
            pt_check(pt_film_merge(&sum, &part) == PT_OK, label("merging shard %d", i), "fails");
            pt_check(pt_film_merge(&sum, &part) == PT_ERROR_MISMATCH, label("merging shard %d twice", i),
                     "is not refused");
            pt_film_free(&part);
        }
    }
    pt_check(sum.range_count == 1 && sum.ranges[0].begin == 0 && sum.ranges[0].end == 16 &&
                 sum.samples[0] == 8 && sum.samples[1] == 8,
             "merged shards, range", "%u ranges, %u + %u samples", (unsigned)sum.range_count,
             (unsigned)sum.samples[0], (unsigned)sum.samples[1]);
    pt_check_near("merged shards = whole", relative_difference(&sum, &whole), 0, 1e-12,
                  "sums of a half went to another place");
    pt_check(fabs(sum.depth[7] - whole.depth[7]) <= 1e-12 * fabs(whole.depth[7]), "merged shards, depth",
             "%g and %g", sum.depth[7], whole.depth[7]);
    pt_film_free(&sum);
    pt_film_free(&whole);
    pt_scene_free(&s.scene);
}

/* Films that do not belong together: the second one differs in one thing. */
static void merge_refused(void)
{
    static const char *const what[9] = {"seed",   "method",    "width", "overlap", "sampler",
                                        "camera", "max_edges", "aov",   "scene"};
    stage s = stage_of("furnace");
    pt_render_desc d = desc_of(&s, 6, 5, 4);
    pt_film a = render(&s, &d), before = render(&s, &d);
    int i;
    for (i = 0; i < 9; i++) {
        stage t = stage_of("furnace");
        pt_render_desc e = d;
        pt_film b;
        pt_result result;
        e.first_sample = i == 3 ? 3 : 4;
        if (i == 0) e.seed++;
        if (i == 1) e.method = "path-light";
        if (i == 2) e.width = 7;
        if (i == 4) e.sampler = PT_SAMPLER_INDEPENDENT;
        if (i == 5) e.camera.position.x += (pt_real)1e-3;
        if (i == 6) e.li.max_edges = 4;
        if (i == 7) e.aov = 1;
        if (i == 8) {
            pt_add_sphere(&t.scene, pt_v3(0, 0, 0), (pt_real)0.01, 0);
            pt_commit(&t.scene);
        }
        b = render(&t, &e);
        result = pt_film_merge(&a, &b);
        pt_check(result == PT_ERROR_MISMATCH && same_film(&a, &before),
                 label("merge refused: another %s", what[i]), "%s", pt_result_string(result));
        pt_film_free(&b);
        pt_scene_free(&t.scene);
    }
    pt_check(pt_film_merge(&a, &a) == PT_ERROR_MISMATCH, "merge refused: itself", "accepted");
    pt_film_free(&a);
    pt_film_free(&before);
    pt_scene_free(&s.scene);
}

/* Ranges that touch become one; overlaps and empty ones are refused. */
static void ranges(void)
{
    pt_film f = PT_FILM_INIT;
    pt_check(pt_film_make(&f, 2, 2, 0) == PT_OK, "pt_film_make", "fails");
    pt_check(pt_film_add_range(&f, 10, 20) == PT_OK && pt_film_add_range(&f, 30, 40) == PT_OK &&
                 pt_film_add_range(&f, 0, 5) == PT_OK && f.range_count == 3 && f.ranges[0].begin == 0 &&
                 f.ranges[2].end == 40,
             "ranges rise", "%u ranges", (unsigned)f.range_count);
    pt_check(pt_film_add_range(&f, 20, 30) == PT_OK && f.range_count == 2 && f.ranges[1].begin == 10 &&
                 f.ranges[1].end == 40,
             "ranges join", "%u ranges", (unsigned)f.range_count);
    pt_check(pt_film_add_range(&f, 4, 6) == PT_ERROR_MISMATCH &&
                 pt_film_add_range(&f, 39, 41) == PT_ERROR_MISMATCH &&
                 pt_film_add_range(&f, 0, 100) == PT_ERROR_MISMATCH &&
                 pt_film_add_range(&f, 15, 16) == PT_ERROR_MISMATCH,
             "overlapping ranges", "are accepted");
    pt_check(pt_film_add_range(&f, 7, 7) == PT_ERROR_ARGUMENT &&
                 pt_film_add_range(&f, 9, 8) == PT_ERROR_ARGUMENT,
             "empty ranges", "are accepted");
    pt_check(f.range_count == 2, "ranges unchanged", "%u ranges", (unsigned)f.range_count);
    pt_film_free(&f);
}

/* The instance for few features and the general body: the same bits (built with -ffp-contract=off). */
static void general_body(void)
{
    int count, i;
    const pt_scene_entry *const scenes = pt_scenes(&count);
    int special = 0;
    for (i = 0; i < count; i++) {
        stage s = stage_of(scenes[i].name);
        pt_render_desc d = desc_of(&s, 21, 22, 8);
        pt_report report = PT_REPORT_INIT;
        pt_film film = PT_FILM_INIT, general;
        d.aov = 1;
        d.no_lockstep = 1;
        pt_check(pt_render(&s.scene, &d, &film, &report) == PT_OK, scenes[i].name, "cannot be rendered");
        special += strcmp(report.body, "general") != 0;
        d.general_body = 1;
        general = render(&s, &d);
        general.fingerprint = film.fingerprint; /* which names the body */
        pt_check(same_film(&film, &general), label("%s: %s body = general body", scenes[i].name, report.body),
                 "the sums differ");
        pt_film_free(&general);
        pt_check(report.nonfinite == 0, label("%s: nothing that is not finite", scenes[i].name),
                 "%g contributions", (double)report.nonfinite);
        pt_film_free(&film);
        pt_report_free(&report);
        pt_scene_free(&s.scene);
    }
    pt_check(special > 0, "a special body is used at all", "all scenes took the general one");
}

/* ---- pictures stand upright ------------------------------------------------------------------------- */

/* Each pixel of a width x height picture looks at a patch of its own colour: (column, row, 1/2). With a field
   of 90 degrees and patches at distance 2 all corners are exact. */
static void check_grid(int width, int height)
{
    stage s;
    pt_render_desc d;
    pt_film film;
    const double cell = 4.0 / height;
    int x, y, wrong = 0;
    memset(&s, 0, sizeof s);
    for (y = 0; y < height; y++)
        for (x = 0; x < width; x++) {
            const int m = pt_add_material(
                &s.scene, pt_material_emitter(pt_rgb3((pt_real)(x + 1), (pt_real)(y + 1), (pt_real)0.5)));
            pt_add_parallelogram(
                &s.scene, pt_v3((pt_real)((x - 0.5 * width) * cell), (pt_real)(2 - (y + 1) * cell), -2),
                pt_v3((pt_real)cell, 0, 0), pt_v3(0, (pt_real)cell, 0), m);
        }
    pt_check(pt_commit(&s.scene) == PT_OK, "grid of patches", "%s", pt_scene_error(&s.scene));
    s.camera = pt_camera_look_at(pt_v3(0, 0, 0), pt_v3(0, 0, -1), pt_v3(0, 1, 0), 90);
    d = desc_of(&s, width, height, 4);
    d.li.max_edges = 1;
    d.tile = 3;
    film = render(&s, &d);
    for (y = 0; y < height; y++)
        for (x = 0; x < width; x++) {
            const pt_rgbd v = pt_film_pixel(&film, x, y);
            wrong += fabs(v.r - (x + 1)) > 1e-6 || fabs(v.g - (y + 1)) > 1e-6 || fabs(v.b - 0.5) > 1e-6;
        }
    pt_check(wrong == 0, label("picture of %d x %d pixels", width, height), "%d pixels show another place",
             wrong);
    pt_film_free(&film);
    pt_scene_free(&s.scene);
}

static void orientation_grid(void)
{
    check_grid(8, 4);
    check_grid(4, 8);
    check_grid(16, 1);
    check_grid(1, 16);
    check_grid(1, 1);
}

/* Mean of one band over pixels x0..x1, y0..y1, the ends included. */
static double block_mean(const pt_film *f, int x0, int x1, int y0, int y1, int band)
{
    double sum = 0;
    int x, y;
    for (y = y0; y <= y1; y++)
        for (x = x0; x <= x1; x++) {
            const pt_rgbd v = pt_film_pixel(f, x, y);
            sum += band == 0 ? v.r : band == 1 ? v.g : v.b;
        }
    return sum / ((x1 - x0 + 1) * (y1 - y0 + 1));
}

/* The Cornell box in a wide picture: the walls stand between 8.6 and 18 pixels from the left and right edge
   of the 64, the lamp in rows 6 and 7 of the 48, the floor at the bottom. */
static void orientation_cornell(void)
{
    stage s = stage_of("cornell");
    pt_render_desc d = desc_of(&s, 64, 48, 16);
    pt_film film = render(&s, &d);
    int x, y, bx = 0, by = 0;
    double brightest = 0;
    for (y = 0; y < 48; y++)
        for (x = 0; x < 64; x++)
            if (pt_film_pixel(&film, x, y).r > brightest) {
                brightest = pt_film_pixel(&film, x, y).r;
                bx = x;
                by = y;
            }
    pt_check(block_mean(&film, 10, 15, 16, 32, 0) > 4 * block_mean(&film, 10, 15, 16, 32, 1),
             "red wall on the left", "it is not");
    pt_check(block_mean(&film, 48, 53, 16, 32, 1) > 1.5 * block_mean(&film, 48, 53, 16, 32, 0),
             "green wall on the right", "it is not");
    pt_check(by >= 5 && by <= 8 && bx >= 27 && bx <= 36 && brightest > 10, "lamp at the top",
             "brightest at (%d, %d): %g", bx, by, brightest);
    pt_check(block_mean(&film, 0, 5, 0, 47, 0) == 0 && block_mean(&film, 58, 63, 0, 47, 0) == 0,
             "black beside the box", "it is not");
    pt_check(pt_film_spp(&film) == 16, "samples", "%u", (unsigned)pt_film_spp(&film));
    pt_film_free(&film);
    pt_scene_free(&s.scene);
}

/* Albedo, normal and depth of a wall that fills the picture, and of nothing. */
static void first_hits(void)
{
    stage s;
    pt_render_desc d;
    pt_film film;
    int wall;
    for (wall = 0; wall < 2; wall++) {
        memset(&s, 0, sizeof s);
        if (wall)
            pt_add_parallelogram(&s.scene, pt_v3(-9, -9, -2), pt_v3(18, 0, 0), pt_v3(0, 18, 0),
                                 pt_add_material(&s.scene, pt_material_diffuse(pt_rgb3(
                                                               (pt_real)0.25, (pt_real)0.5, (pt_real)0.75))));
        pt_set_environment(&s.scene, grey(1));
        pt_commit(&s.scene);
        s.camera = pt_camera_look_at(pt_v3(0, 0, 0), pt_v3(0, 0, -1), pt_v3(0, 1, 0), (pt_real)0.1);
        d = desc_of(&s, 3, 2, 8);
        d.aov = 1;
        film = render(&s, &d);
        pt_check(film.albedo && film.normal && film.depth, "first hits are stored", "they are not");
        if (film.albedo && film.normal && film.depth) {
            pt_check_near("albedo", film.albedo[3] / 8, wall ? 0.25 : 0, 1e-6,
                          "the sum over samples of the albedo at the first hit, not of the radiance");
            pt_check_near("albedo, blue", film.albedo[5] / 8, wall ? 0.75 : 0, 1e-6,
                          "are the three bands in their order?");
            pt_check_near("normal, z", film.normal[17] / 8, wall ? 1 : 0, 1e-6,
                          "the normal of the first hit, towards the camera");
            pt_check_near("normal, x", film.normal[15] / 8, 0, 1e-6,
                          "the normal of the first hit: x, y, z in their order");
            pt_check_near("depth", film.depth[5] / 8, wall ? 2 : 0, 1e-5,
                          "the distance along the ray, not along the axis of the camera");
        }
        pt_film_free(&film);
        d.aov = 0;
        film = render(&s, &d);
        pt_check(!film.albedo && !film.normal && !film.depth, "first hits only if asked for",
                 "they are stored");
        pt_film_free(&film);
        pt_scene_free(&s.scene);
    }
}

/* ---- how wrong the picture is ----------------------------------------------------------------------- */

/* A film of given means: half A has 3 samples a pixel, half B has 2. */
static pt_film film_of(int width, int height, double (*value)(int half, size_t k))
{
    pt_film f = PT_FILM_INIT;
    const size_t n = 3 * (size_t)width * (size_t)height;
    size_t k;
    int h;
    if (pt_film_make(&f, width, height, 0) != PT_OK) return f;
    f.samples[0] = 3;
    f.samples[1] = 2;
    pt_film_add_range(&f, 0, 5);
    for (h = 0; h < 2; h++)
        for (k = 0; k < n; k++) f.half[h][k] = f.samples[h] * value(h, k);
    return f;
}

static double some_values(int half, size_t k)
{
    return 0.3 + 0.1 * (double)(k % 7) + (half ? 0.02 * (double)(k % 5) : 0);
}

/* The three figures worked out by hand from the means. */
static void error_figures(void)
{
    const int w = 4, h = 3, n = 3 * w * h;
    pt_film f = film_of(w, h, some_values);
    float reference[36];
    pt_error e = {0, 0, 0}, t = {0, 0, 0};
    double se = 0, re = 0, pe = 0, st = 0, rt = 0, pt = 0, floor_image = 0, floor_reference = 0;
    int k;
    for (k = 0; k < n; k++) reference[k] = (float)(0.5 + 0.05 * (k % 4));
    for (k = 0; k < w * h; k++) {
        const pt_rgbd v = pt_film_pixel(&f, k % w, k / w);
        floor_image += 0.1 * pt_luminance(v.r, v.g, v.b) / (w * h);
        floor_reference += 0.1 *
                           pt_luminance((double)reference[3 * k], (double)reference[3 * k + 1],
                                        (double)reference[3 * k + 2]) /
                           (w * h);
    }
    for (k = 0; k < n; k++) {
        const double a = some_values(0, (size_t)k), b = some_values(1, (size_t)k),
                     image = (3 * a + 2 * b) / 5;
        const double r = (double)reference[k], own = 6.0 / 25 * (a - b) * (a - b),
                     real = (image - r) * (image - r);
        se += own / n;
        re += own / (image * image + floor_image * floor_image) / n;
        pe += own / (image * image + 0.01) / n;
        st += real / n;
        rt += real / (r * r + floor_reference * floor_reference) / n;
        pt += real / (r * r + 0.01) / n;
    }
    pt_check(pt_film_error_estimate(&f, &e) == 1, "estimated error", "is unknown");
    pt_film_error(&f, reference, &t);
    pt_check_near("estimated rmse", e.rmse, sqrt(se), 1e-12, "nA nB / (nA + nB)^2 (A - B)^2");
    pt_check_near("estimated relmse", e.relmse, re, 1e-12,
                  "relative to R^2 + (mean luminance / 10)^2, R the picture itself");
    pt_check_near("estimated relmse_001", e.relmse_001, pe, 1e-12, "relative to R^2 + 0.01");
    pt_check_near("true rmse", t.rmse, sqrt(st), 1e-12,
                  "the root of the mean over pixels and bands of (a - b)^2");
    pt_check_near("true relmse", t.relmse, rt, 1e-12,
                  "each square relative to R^2 + (mean luminance / 10)^2 of the reference, not of the film");
    pt_check_near("true relmse_001", t.relmse_001, pt, 1e-12,
                  "each square relative to R^2 + 0.01 of the reference, not of the film");
    f.samples[1] = 0;
    pt_check(pt_film_error_estimate(&f, &e) == 0, "estimate from one half", "claims to be known");
    pt_film_free(&f);
}

/* Rows after 1, 2, 4, ... samples and at the end. */
static void check_rows(const pt_report *r, uint32_t spp, int has_truth)
{
    uint32_t i, expected = 1;
    int wrong = 0;
    for (i = 0; i<r->row_count; i++, expected = 2 * expected> spp ? spp : 2 * expected) {
        const pt_report_row *const row = &r->rows[i];
        const double e = has_truth ? row->true_error.relmse : row->error.relmse;
        wrong += row->spp != expected || row->estimated != (row->spp > 1) || row->has_true_error != has_truth;
        wrong += i > 0 && (row->cpu_seconds < row[-1].cpu_seconds ||
                           row->wall_seconds < row[-1].wall_seconds || row->rays <= row[-1].rays);
        wrong +=
            row->estimated && !(row->error.rmse > 0 && row->error.relmse > 0 && row->error.relmse_001 > 0);
        if (e > 0 && row->cpu_seconds > 0) wrong += fabs(row->efficiency * e * row->cpu_seconds - 1) > 1e-9;
    }
    pt_check(wrong == 0 && r->row_count > 1 && r->rows[r->row_count - 1].spp == spp &&
                 r->rows[r->row_count - 1].rays == r->rays,
             label("rows of a report of %u samples", (unsigned)spp), "%d wrong entries in %u rows", wrong,
             (unsigned)r->row_count);
}

static void reports(void)
{
    stage s = stage_of("furnace");
    pt_render_desc d = desc_of(&s, 16, 12, 20);
    float reference[16 * 12 * 3];
    pt_film film = PT_FILM_INIT;
    pt_report r = PT_REPORT_INIT;
    pt_error last;
    int i;
    for (i = 0; i < 16 * 12 * 3; i++) reference[i] = 2;
    pt_check(pt_render(&s.scene, &d, &film, &r) == PT_OK, "report", "no render");
    check_rows(&r, 20, 0);
    pt_check(r.width == 16 && r.height == 12 && r.threads == 2 && r.spp == 20 && r.nonfinite == 0 &&
                 r.rays > 16 * 12 * 20 && strcmp(r.method, "path") == 0 && strcmp(r.sampler, "sobol") == 0 &&
                 r.needs == pt_scene_needs(&s.scene),
             "report, what was rendered", "a field is wrong");
    pt_film_free(&film);
    d.reference = reference;
    d.reference_mse_001 = 1e-4;
    d.spp = 8;
    pt_check(pt_render(&s.scene, &d, &film, &r) == PT_OK, "report with a reference", "no render");
    check_rows(&r, 8, 1);
    pt_film_error(&film, reference, &last);
    pt_check_near("report, true rmse", r.rows[r.row_count - 1].true_error.rmse, last.rmse, 0,
                  "the last row must be about the finished film");
    pt_check_near("report, true relmse_001", r.rows[r.row_count - 1].true_error.relmse_001,
                  last.relmse_001 - 1e-4, 1e-15, "the reference's own error is to be subtracted");
    pt_film_free(&film);
    pt_report_free(&r);
    pt_check(r.rows == NULL && r.row_count == 0 && r.spp == 0, "pt_report_free", "leaves something");
    pt_scene_free(&s.scene);
}

static void single_net(void)
{
    stage s = stage_of("furnace");
    pt_render_desc d = desc_of(&s, 8, 8, 16);
    pt_film film = PT_FILM_INIT;
    pt_report r = PT_REPORT_INIT;
    pt_error e;
    uint32_t i;
    int known = 0;
    d.single_net = 1;
    pt_check(pt_render(&s.scene, &d, &film, &r) == PT_OK, "single net", "no render");
    for (i = 0; i < r.row_count; i++) known += r.rows[i].estimated;
    pt_check(known == 0 && r.row_count == 5, "single net: error unknown", "%d of %u rows claim to know it",
             known, (unsigned)r.row_count);
    pt_check(film.samples[0] == 16 && film.samples[1] == 0, "single net: one half", "%u and %u",
             (unsigned)film.samples[0], (unsigned)film.samples[1]);
    pt_check(!pt_film_error_estimate(&film, &e), "single net: film", "claims to know its error");
    pt_film_free(&film);
    d.target_error = 0.1;
    pt_check(pt_render(&s.scene, &d, &film, &r) == PT_ERROR_ARGUMENT && pt_film_spp(&film) == 0,
             "single net with a target error", "an error that is not known cannot end the render");
    pt_film_free(&film);
    pt_report_free(&r);
    pt_scene_free(&s.scene);
}

/* How a reference is known: `picture`, with a mean squared error of its own. */
typedef struct truth {
    const float *picture;
    double mse;
} truth;

/* Is the estimated error true? Over `seeds` renders, e is the estimated and t the true mean squared error of
   a picture, less the reference's own. Their ratio of means has the expectation 1 to first order; linearised,
   it is the mean of 1 + (e - t) / mean t. Its interval at the suite's level must contain 1 and lie within
   [0.9, 1.1]. */
static void check_estimate(const char *name, const stage *s, pt_render_desc d, uint32_t seeds,
                           const truth *reference)
{
    pt_stats difference = PT_STATS_INIT, t = PT_STATS_INIT, ratio;
    double reach;
    uint32_t i;
    for (i = 0, seeds = pt_test_samples(seeds); i < seeds; i++) {
        pt_error estimated, real;
        pt_film film;
        d.seed = pt_test_seed(5000 + 500 * (uint64_t)d.sampler + i);
        film = render(s, &d);
        pt_film_error_estimate(&film, &estimated);
        pt_film_error(&film, reference->picture, &real);
        pt_stats_add(&t, real.rmse * real.rmse - reference->mse);
        pt_stats_add(&difference, estimated.rmse * estimated.rmse - real.rmse * real.rmse + reference->mse);
        pt_film_free(&film);
    }
    ratio = difference;
    ratio.mean = 1 + difference.mean / t.mean;
    ratio.m2 = difference.m2 / (t.mean * t.mean);
    ratio.m3 = difference.m3 / pow(t.mean, 3);
    pt_check_mean(name, &ratio, 1, 0, 0.1, PT_TEST_MEANS,
                  "estimated over true squared error: are the halves independent?");
    reach = fabs(ratio.mean - 1) + pt_test_quantile(ratio.n - 1) * pt_stats_standard_error(&ratio);
    if (!pt_test.is_short)
        pt_check(reach <= 0.1, label("%s, interval", name), "reaches %.3g from 1: more seeds", reach);
}

/* The short form: a furnace, where paths of three edges make every pixel exactly 1 + 1/2 + 1/4. Estimated and
   true squared error of a picture of P pixels (grey: the bands are equal) each spread by about sqrt(2 / P),
   and are independent: 64 seeds of 24 x 24 pixels give a standard error of 2 / sqrt(64 P) = 1 %, and the
   interval is 7 to 8 of these to each side. */
static void estimated_error(void)
{
    pt_test_source("estimated over true squared error: ratio 1; truth 1 + 1/2 + 1/4, geometric series");
    static const pt_sampler_kind kind[2] = {PT_SAMPLER_INDEPENDENT, PT_SAMPLER_SOBOL};
    const uint32_t spp = pt_test_long() ? 64 : 8;
    stage s = stage_of("furnace");
    float picture[24 * 24 * 3];
    truth exact;
    int i, k;
    for (i = 0; i < 24 * 24 * 3; i++) picture[i] = 1.75f;
    exact.picture = picture;
    exact.mse = 0;
    for (k = 0; k < 2; k++) {
        pt_render_desc d = desc_of(&s, 24, 24, spp);
        d.sampler = kind[k];
        d.li.max_edges = 3;
        check_estimate(
            label("estimated error, furnace, %s, %u samples", pt_sampler_name(kind[k]), (unsigned)spp), &s, d,
            64, &exact);
    }
    pt_scene_free(&s.scene);
}

/* The Cornell box against a reference of another seed, whose own error its halves tell. The lamp is out of
   the picture: pixels that it covers in part would be nearly all of the squared error, and a few such pixels
   spread too much for any number of seeds. */
static void estimated_error_cornell(void)
{
    pt_test_source(
        "estimated over true squared error: ratio 1; truth: a render with another seed, less its own error");
    static const pt_sampler_kind kind[2] = {PT_SAMPLER_INDEPENDENT, PT_SAMPLER_SOBOL};
    static const uint32_t spp[3] = {8, 64, 256};
    enum { SIDE = 24 };
    static float picture[SIDE * SIDE * 3];
    stage s = stage_of("cornell");
    pt_render_desc d;
    pt_film film;
    pt_error own = {0, 0, 0};
    truth reference;
    int i, k;
    s.camera = pt_camera_look_at(pt_v3(278, 273, -800), pt_v3(278, 200, 280), pt_v3(0, 1, 0), 24);
    d = desc_of(&s, SIDE, SIDE, pt_test_long() ? 32768 : pt_test_samples(1024));
    d.seed = pt_test_seed(4999);
    film = render(&s, &d);
    for (i = 0; i < SIDE * SIDE; i++) {
        const pt_rgbd v = pt_film_pixel(&film, i % SIDE, i / SIDE);
        picture[3 * i] = (float)v.r;
        picture[3 * i + 1] = (float)v.g;
        picture[3 * i + 2] = (float)v.b;
    }
    pt_film_error_estimate(&film, &own);
    reference.picture = picture;
    reference.mse = own.rmse * own.rmse;
    pt_film_free(&film);
    for (k = 0; k < 2; k++)
        for (i = 0; i < (pt_test_long() ? 3 : 1); i++) {
            d = desc_of(&s, SIDE, SIDE, spp[i]);
            d.sampler = kind[k];
            check_estimate(
                label("estimated error, cornell, %s, %u samples", pt_sampler_name(kind[k]), (unsigned)spp[i]),
                &s, d, pt_test_long() ? 160 : 96, &reference);
        }
    pt_scene_free(&s.scene);
}

/* ---- budgets, progress, cancelling ------------------------------------------------------------------ */

static void refused_descs(void)
{
    stage s = stage_of("furnace");
    pt_film film = PT_FILM_INIT;
    int i;
    for (i = 0; i < 4; i++) {
        pt_render_desc d = desc_of(&s, 4, 4, 4);
        d.sampler = PT_SAMPLER_STRATIFIED;
        if (i == 1) d.seconds = 1;
        if (i == 2) d.cpu_seconds = 1;
        if (i == 3) d.target_error = 0.1;
        pt_check(pt_render(&s.scene, &d, &film, NULL) == (i == 0 ? PT_OK : PT_ERROR_ARGUMENT),
                 label("stratified with budget %d", i),
                 "strata need to know the number of samples beforehand");
    }
    pt_film_free(&film);
    pt_scene_free(&s.scene);
}

typedef struct watcher {
    int calls, strange;
    double cancel_at, last;
    uint32_t target;
} watcher;

static int watch(void *user, const pt_progress *p)
{
    watcher *const w = (watcher *)user;
    w->calls++;
    w->strange += !(p->spp >= w->last) || p->seconds < 0 || p->rays_per_second < 0 || !(p->relmse >= -1) ||
                  p->seconds_left < -1;
    w->strange += (uint32_t)p->spp_target != w->target;
    w->last = p->spp;
    return w->cancel_at > 0 && p->spp >= w->cancel_at;
}

/* The callback is called, its cancelling keeps finished passes, and the film can then be continued. */
static void progress_and_cancel(void)
{
    stage s = stage_of("cornell");
    pt_render_desc d = desc_of(&s, 48, 40, 1000000);
    pt_film film = PT_FILM_INIT;
    pt_report r = PT_REPORT_INIT;
    watcher w = {0, 0, 3, 0, 1000000};
    pt_result result;
    uint32_t got;
    d.progress = watch;
    d.progress_user = &w;
    d.tile = 8;
    result = pt_render(&s.scene, &d, &film, &r);
    got = pt_film_spp(&film);
    pt_check(result == PT_ERROR_CANCELLED, "cancelled by the callback", "%s", pt_result_string(result));
    pt_check(w.calls > 0 && w.strange == 0, "progress", "%d calls, %d of them strange", w.calls, w.strange);
    pt_check(got >= 2 && got < 1000000 && r.spp == got, "cancelled render", "film %u, report %u samples",
             (unsigned)got, (unsigned)r.spp);
    pt_check(r.stopped_by && strcmp(r.stopped_by, "cancelled") == 0, "cancelled render, stopped by", "%s",
             r.stopped_by ? r.stopped_by : "nothing");
    d.progress = NULL;
    d.spp = got;
    check_same("cancelled render = finished passes", &s, &d, &film);
    d.spp = got + 3;
    pt_check(pt_render(&s.scene, &d, &film, &r) == PT_OK && pt_film_spp(&film) == got + 3,
             "cancelled, then continued", "fails");
    check_same("cancelled, then continued = undisturbed", &s, &d, &film);
    pt_film_free(&film);
    pt_report_free(&r);
    pt_scene_free(&s.scene);
}

static int poll_third(void *user) { return ++*(int *)user >= 3; }

/* In a white furnace a path has about 2^24 edges. Neither a poll nor a time budget waits for its end, and the
   pass that it was in is dropped. */
static void endless_paths(void)
{
    stage s;
    pt_render_desc d;
    pt_film film = PT_FILM_INIT;
    pt_report r = PT_REPORT_INIT;
    pt_material white = pt_material_diffuse(grey(1));
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 1, 0);
    const pt_ray ray = {{0, 0, 0}, {0, 0, -1}, 1};
    pt_li_info info;
    pt_result result;
    int polls = 0;
    memset(&s, 0, sizeof s);
    white.emission = grey(1);
    pt_add_sphere(&s.scene, pt_v3(0, 0, 0), 1, pt_add_material(&s.scene, white));
    pt_commit(&s.scene);
    s.camera = pt_camera_look_at(pt_v3(0, 0, 0), pt_v3(0, 0, -1), pt_v3(0, 1, 0), 60);
    d = desc_of(&s, 16, 16, 4);
    d.li.poll = poll_third;
    d.li.poll_user = &polls;
    d.threads = 1;
    result = pt_render(&s.scene, &d, &film, &r);
    pt_check(result == PT_ERROR_CANCELLED && polls >= 3 && pt_film_spp(&film) == 0, "polled inside a path",
             "%s after %d polls, %u samples", pt_result_string(result), polls, (unsigned)pt_film_spp(&film));
    memset(&info, 0, sizeof info);
    polls = 0;
    pt_li_path(&s.scene, &ray, &sampler, &d.li, &info);
    pt_check(info.cancelled && polls == 3 && info.edges == 3 << 16, "a path that is cancelled says so",
             "cancelled %d after %d polls and %d edges", info.cancelled, polls, info.edges);
    d.li.poll = NULL;
    d.seconds = 0.2;
    result = pt_render(&s.scene, &d, &film, &r);
    pt_check(result == PT_OK && r.wall_seconds < 10 && pt_film_spp(&film) == 0 && r.spp == 0,
             "time budget inside a path", "%s after %g s, %u samples", pt_result_string(result),
             r.wall_seconds, (unsigned)pt_film_spp(&film));
    pt_film_free(&film);
    pt_report_free(&r);
    pt_scene_free(&s.scene);
}

static void methods(void)
{
    int count, i;
    const pt_method *const m = pt_methods(&count);
    stage s = stage_of("furnace");
    pt_check(count == 7 && pt_method_find(NULL) == m && strcmp(m[0].name, "path") == 0, "table of methods",
             "%d methods, first %s", count, m[0].name);
    pt_check(pt_method_find("no such method") == NULL && pt_method_find("") == NULL, "unknown method",
             "is found");
    for (i = 0; i < count; i++) {
        pt_render_desc d = desc_of(&s, 8, 8, 4);
        pt_film film = PT_FILM_INIT;
        pt_report r = PT_REPORT_INIT;
        d.method = m[i].name;
        pt_check(pt_method_find(m[i].name) == &m[i] && m[i].summary && m[i].summary[0] && m[i].li, m[i].name,
                 "is not whole");
        pt_check(pt_render(&s.scene, &d, &film, &r) == PT_OK && r.method == m[i].name,
                 label("method %s", m[i].name), "does not render, or its report has another name");
        pt_film_free(&film);
        pt_report_free(&r);
    }
    pt_scene_free(&s.scene);
}

/* A scene without any surface: black, or the sky and nothing else, by every method, in a picture that is not
   square. */
static void empty_scenes(void)
{
    int count, i, k, sky;
    const pt_method *const m = pt_methods(&count);
    for (sky = 0; sky < 2; sky++)
        for (i = 0; i < count; i++) {
            stage s;
            pt_render_desc d;
            pt_film film;
            int off = 0;
            memset(&s, 0, sizeof s);
            s.camera = pt_camera_look_at(pt_v3(1, 2, 3), pt_v3(0, 0, 0), pt_v3(0, 1, 0), 50);
            if (sky) pt_set_environment(&s.scene, grey(0.75));
            pt_check(pt_commit(&s.scene) == PT_OK, "empty scene", "%s", pt_scene_error(&s.scene));
            d = desc_of(&s, 5, 3, 4);
            d.method = m[i].name;
            film = render(&s, &d);
            for (k = 0; k < 15; k++) {
                const pt_rgbd v = pt_film_pixel(&film, k % 5, k / 5);
                off += fabs(v.r - 0.75 * sky) + fabs(v.g - 0.75 * sky) + fabs(v.b - 0.75 * sky) > 0;
            }
            pt_check(off == 0, label("empty scene %s, %s", sky ? "with a sky" : "without", m[i].name),
                     "%d of 15 pixels are wrong: a ray that meets nothing brings the sky's radiance", off);
            pt_film_free(&film);
            pt_scene_free(&s.scene);
        }
}

/* ---- splats ----------------------------------------------------------------------------------------- */

/* List number i of a pass, as whichever thread fills it would. */
static pt_splat_list splats_of(int i)
{
    pt_splat_list list = PT_SPLAT_LIST_INIT;
    pt_pcg32 rng = pt_pcg32_make(99, (uint64_t)i);
    int k;
    for (k = 0; k < 500 + 100 * i; k++) {
        const uint32_t pixel = pt_pcg32_next(&rng) % 12, half = pt_pcg32_next(&rng) & 1u;
        pt_splat_add(&list, pixel, half,
                     pt_rgb3((pt_real)pt_pcg32_double(&rng), (pt_real)1e-6, (pt_real)(1 << (k % 20))));
    }
    return list;
}

static void splats(void)
{
    static const int order[2][4] = {{0, 1, 2, 3}, {2, 0, 3, 1}};
    pt_film film[2];
    pt_splat_list bad = PT_SPLAT_LIST_INIT;
    double total = 0, seen = 0;
    int f, i, x;
    memset(film, 0, sizeof film);
    for (f = 0; f < 2; f++) {
        pt_splat_list list[4];
        memset(list, 0, sizeof list);
        pt_film_make(&film[f], 4, 3, 0);
        film[f].samples[0] = film[f].samples[1] = 4;
        for (i = 0; i < 4; i++) list[order[f][i]] = splats_of(order[f][i]);
        for (i = 0; i < 4; i++) {
            size_t k;
            for (k = 0; f == 0 && k < list[i].count; k++) total += (double)list[i].items[k].value.r;
            pt_check(pt_film_add_splats(&film[f], &list[i]) == PT_OK, "pt_film_add_splats", "fails");
            pt_splat_list_free(&list[i]);
        }
    }
    pt_check(same_film(&film[0], &film[1]) && film[0].splat[0] && film[0].splat[1],
             "splats: the same from any thread", "films differ");
    for (x = 0; x < 12; x++) seen += 8 * pt_film_pixel(&film[0], x % 4, x / 4).r;
    pt_check_near("splats are in the picture", seen, total, 1e-9 * total,
                  "pixel = sum over both halves / samples");
    pt_splat_add(&bad, 12, 0, grey(1));
    pt_check(pt_film_add_splats(&film[0], &bad) == PT_ERROR_ARGUMENT, "splat beyond the picture",
             "is accepted");
    bad.items[0].pixel = 0;
    bad.items[0].half = 2;
    pt_check(pt_film_add_splats(&film[0], &bad) == PT_ERROR_ARGUMENT, "splat in a third half", "is accepted");
    bad.items[0].half = 0;
    bad.items[0].value.g = (pt_real)NAN;
    pt_check(pt_film_add_splats(&film[0], &bad) == PT_OK && film[0].nonfinite == 1 &&
                 same_sums(film[0].splat[0], film[1].splat[0], 36),
             "splat that is not a number", "is added, or not counted");
    film[0].nonfinite = 0;
    pt_film_add_range(&film[0], 0, 8);
    pt_film_add_range(&film[1], 8, 16);
    pt_check(pt_film_merge(&film[0], &film[1]) == PT_OK, "films with splats merge", "they do not");
    for (x = 0, seen = 0; x < 12; x++) seen += 8 * pt_film_pixel(&film[0], x % 4, x / 4).r;
    pt_check_near("merged splats", seen, total, 1e-9 * total, "mean of two equal films");
    pt_splat_list_free(&bad);
    for (f = 0; f < 2; f++) pt_film_free(&film[f]);
}

/* ---- files ------------------------------------------------------------------------------------------ */

/* Where a file of this name goes. */
static const char *out(const char *name)
{
    static const char *directory;
    if (!directory) {
        FILE *const probe = fopen("build/test/test_driver.probe", "wb");
        directory = probe ? "build/test/" : "";
        if (probe) fclose(probe);
        remove("build/test/test_driver.probe");
    }
    return label("%stest_driver_%s", directory, name);
}

typedef struct bytes {
    unsigned char *data;
    size_t size;
} bytes;

/* A whole file, with a zero behind it; data NULL if there is none. Free it. */
static bytes slurp(const char *path)
{
    bytes b = {NULL, 0};
    FILE *const file = fopen(path, "rb");
    size_t capacity = 1 << 16, got;
    if (!file) return b;
    b.data = (unsigned char *)malloc(capacity + 1);
    while (b.data && (got = fread(b.data + b.size, 1, capacity - b.size, file)) > 0) {
        b.size += got;
        if (b.size == capacity) {
            unsigned char *const larger = (unsigned char *)realloc(b.data, 2 * capacity + 1);
            if (!larger) break;
            b.data = larger;
            capacity *= 2;
        }
    }
    fclose(file);
    if (b.data) b.data[b.size] = 0;
    return b;
}

static int exists(const char *path)
{
    FILE *const file = fopen(path, "rb");
    if (file) fclose(file);
    return file != NULL;
}

/* Reads a file that was written, checks that nothing else stands beside it, and removes it. */
static bytes written(const char *path)
{
    const bytes b = slurp(path);
    pt_check(!exists(label("%s.part", path)), label("%s, temporary file", path), "is still there");
    pt_check(b.data != NULL, path, "was not written");
    remove(path);
    return b;
}

/* Values of the test films: some below 0, above 1, and not a number. */
static double picture_value(int half, size_t k)
{
    static const double odd[6] = {-1, 0, 1, 7, 0.0031308, 1e-9};
    if (k < 6) return odd[k];
    if (k == 6 && half == 0) return (double)NAN;
    return (double)((k * 7919) % 1009) / 1000;
}

/* sRGB by its definition (IEC 61966-2-1), to the nearest code. */
static int srgb_code(double v)
{
    if (!(v > 0)) return 0;
    if (v >= 1) return 255;
    return (int)(255 * (v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055) + 0.5);
}

static double pixel_value(const pt_film *f, size_t k)
{
    const pt_rgbd v = pt_film_pixel(f, (int)(k / 3) % f->width, (int)(k / 3) / f->width);
    return k % 3 == 0 ? v.r : k % 3 == 1 ? v.g : v.b;
}

static int wrong_codes(const pt_film *f, const unsigned char *rgb, double exposure)
{
    const size_t n = 3 * (size_t)f->width * (size_t)f->height;
    size_t k;
    int wrong = 0;
    for (k = 0; k < n; k++) wrong += rgb[k] != srgb_code(exposure * pixel_value(f, k));
    return wrong;
}

static void file_ppm(void)
{
    static const char head[] = "P6\n17 5\n255\n";
    pt_film f = film_of(17, 5, picture_value);
    const size_t n = 3 * 17 * 5;
    int i;
    for (i = 0; i < 2; i++) {
        const double exposure = i == 0 ? 1 : 2.5;
        bytes b;
        pt_check(pt_write_ppm(out("a.ppm"), &f, exposure) == PT_OK, "pt_write_ppm", "fails");
        b = written(out("a.ppm"));
        if (!b.data) continue;
        pt_check(b.size == sizeof head - 1 + n && memcmp(b.data, head, sizeof head - 1) == 0,
                 "PPM, head and size", "%lu bytes instead of %lu", (unsigned long)b.size,
                 (unsigned long)(sizeof head - 1 + n));
        if (b.size == sizeof head - 1 + n)
            pt_check(wrong_codes(&f, b.data + sizeof head - 1, exposure) == 0, "PPM, codes",
                     "%d of %lu differ", wrong_codes(&f, b.data + sizeof head - 1, exposure),
                     (unsigned long)n);
        free(b.data);
    }
    pt_film_free(&f);
}

/* A first byte that looks like blank space must not be lost, and the picture not be turned. */
static void file_ppm_bytes(void)
{
    static const unsigned char rgb[12] = {10, 32, 9, 13, 0, 255, 1, 2, 3, 4, 5, 6};
    bytes b;
    pt_check(pt_write_ppm_bytes(out("b.ppm"), rgb, 1, 4) == PT_OK, "pt_write_ppm_bytes", "fails");
    b = written(out("b.ppm"));
    pt_check(b.size == 11 + 12 && memcmp(b.data, "P6\n1 4\n255\n", 11) == 0 &&
                 memcmp(b.data + 11, rgb, 12) == 0,
             "PPM, bytes as given", "%lu bytes", (unsigned long)b.size);
    free(b.data);
}

/* PFM: rows from the bottom, four bytes a value, the lowest first. */
static void file_pfm(void)
{
    static const char head[] = "PF\n3 4\n-1.0\n";
    pt_film f = film_of(3, 4, some_values);
    bytes b;
    int x, y, k, wrong = 0;
    pt_check(pt_write_pfm(out("a.pfm"), &f) == PT_OK, "pt_write_pfm", "fails");
    b = written(out("a.pfm"));
    pt_check(b.size == sizeof head - 1 + 4 * 36 && memcmp(b.data, head, sizeof head - 1) == 0,
             "PFM, head and size", "%lu bytes", (unsigned long)b.size);
    for (y = 0; b.size == sizeof head - 1 + 4 * 36 && y < 4; y++)
        for (x = 0; x < 3; x++)
            for (k = 0; k < 3; k++) {
                const unsigned char *const p = b.data + sizeof head - 1 + 4 * (9 * (3 - y) + 3 * x + k);
                const uint32_t bits =
                    (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
                const float expected = (float)pixel_value(&f, (size_t)(9 * y + 3 * x + k));
                wrong += memcmp(&bits, &expected, 4) != 0;
            }
    pt_check(wrong == 0, "PFM, values", "%d of 36 differ", wrong);
    free(b.data);
    pt_film_free(&f);
}

/* The bytes that the definition gives for one pixel: 1, -2, infinity. */
static void file_pfm_bytes(void)
{
    static const unsigned char expected[12] = {0, 0, 0x80, 0x3f, 0, 0, 0, 0xc0, 0, 0, 0x80, 0x7f};
    const float rgb[3] = {1, -2, (float)HUGE_VAL};
    bytes b;
    pt_check(pt_write_pfm_floats(out("b.pfm"), rgb, 1, 1) == PT_OK, "pt_write_pfm_floats", "fails");
    b = written(out("b.pfm"));
    pt_check(b.size == 24 && memcmp(b.data, "PF\n1 1\n-1.0\n", 12) == 0 &&
                 memcmp(b.data + 12, expected, 12) == 0,
             "PFM, exact bytes", "%lu bytes", (unsigned long)b.size);
    free(b.data);
}

/* ---- a PNG reader: zlib (RFC 1950), stored and fixed blocks of deflate (RFC 1951), five filters -------- */

static uint32_t big32(const unsigned char *p)
{
    return (uint32_t)p[0] << 24 | (uint32_t)p[1] << 16 | (uint32_t)p[2] << 8 | p[3];
}

/* CRC-32 bit by bit, by polynomial division (PNG, Annex D). */
static uint32_t crc_of(const unsigned char *data, size_t size)
{
    uint32_t c = 0xffffffffu;
    size_t i;
    int k;
    for (i = 0; i < size; i++)
        for (c ^= data[i], k = 0; k < 8; k++) c = c & 1u ? 0xedb88320u ^ c >> 1 : c >> 1;
    return c ^ 0xffffffffu;
}

static uint32_t adler_of(const unsigned char *data, size_t size)
{
    uint64_t a = 1, b = 0;
    size_t i;
    for (i = 0; i < size; i++) {
        a = (a + data[i]) % 65521;
        b = (b + a) % 65521;
    }
    return (uint32_t)(b << 16 | a);
}

typedef struct bit_reader {
    const unsigned char *data;
    size_t size, at; /* at: in bits */
    int failed;
} bit_reader;

static uint32_t bits(bit_reader *r, int count)
{
    uint32_t v = 0;
    int i;
    for (i = 0; i < count; i++, r->at++) {
        if (r->at / 8 >= r->size)
            r->failed = 1;
        else
            v |= (uint32_t)(r->data[r->at / 8] >> (r->at % 8) & 1) << i;
    }
    return v;
}

/* A literal or length code of the fixed tables, its bits from the top. */
static int fixed_symbol(bit_reader *r)
{
    uint32_t c = 0;
    int length;
    for (length = 1; length <= 9 && !r->failed; length++) {
        c = c << 1 | bits(r, 1);
        if (length == 7 && c <= 23) return (int)c + 256;
        if (length == 8 && c >= 48 && c <= 191) return (int)c - 48;
        if (length == 8 && c >= 192 && c <= 199) return (int)c - 192 + 280;
        if (length == 9 && c >= 400) return (int)c - 400 + 144;
    }
    return -1;
}

/* Copies `length` bytes from `distance` back. */
static int copy_back(bytes *to, size_t capacity, size_t length, size_t distance)
{
    if (distance > to->size || to->size + length > capacity) return 0;
    for (; length > 0; length--, to->size++) to->data[to->size] = to->data[to->size - distance];
    return 1;
}

/* The symbols of one block with fixed codes; base values and extra bits of RFC 1951 3.2.5. */
static int inflate_fixed(bit_reader *r, bytes *to, size_t capacity)
{
    static const int length_base[29] = {3,  4,  5,  6,  7,  8,  9,  10, 11,  13,  15,  17,  19,  23, 27,
                                        31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258};
    static const int length_extra[29] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2,
                                         2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0};
    static const int distance_base[30] = {1,    2,    3,    4,    5,    7,    9,    13,    17,    25,
                                          33,   49,   65,   97,   129,  193,  257,  385,   513,   769,
                                          1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577};
    for (;;) {
        const int s = fixed_symbol(r);
        uint32_t length, code, k;
        if (s < 0 || r->failed || s > 285) return 0;
        if (s == 256) return 1;
        if (s < 256) {
            if (to->size == capacity) return 0;
            to->data[to->size++] = (unsigned char)s;
            continue;
        }
        length = (uint32_t)length_base[s - 257] + bits(r, length_extra[s - 257]);
        for (code = 0, k = 0; k < 5; k++) code = code << 1 | bits(r, 1);
        if (code > 29) return 0;
        if (!copy_back(to, capacity, length,
                       (uint32_t)distance_base[code] + bits(r, code < 4 ? 0 : (int)code / 2 - 1)))
            return 0;
    }
}

/* A whole zlib stream; 0 if it is not one, or what it holds is not `capacity` bytes. */
static int inflate(const unsigned char *data, size_t size, unsigned char *to, size_t capacity)
{
    bit_reader r = {data, size, 16, 0};
    bytes result = {to, 0};
    int last = 0;
    if (size < 6 || (data[0] & 15) != 8 || (data[0] * 256 + data[1]) % 31 != 0 || (data[1] & 32)) return 0;
    while (!last && !r.failed) {
        uint32_t kind;
        last = (int)bits(&r, 1);
        kind = bits(&r, 2);
        if (kind == 1 && !inflate_fixed(&r, &result, capacity)) return 0;
        if (kind == 0) {
            uint32_t length, k;
            r.at = (r.at + 7) / 8 * 8;
            length = bits(&r, 16);
            if ((bits(&r, 16) ^ length) != 0xffffu || result.size + length > capacity) return 0;
            for (k = 0; k < length; k++) to[result.size++] = (unsigned char)bits(&r, 8);
        }
        if (kind > 1) return 0; /* the writer has no tables of its own */
    }
    r.at = (r.at + 7) / 8;
    return !r.failed && result.size == capacity && r.at + 4 == size &&
           big32(data + r.at) == adler_of(to, capacity);
}

/* Undoes the filters of all rows in place: a byte before each row, 3 * width bytes. 0: unknown filter. */
static int unfilter(unsigned char *raw, int width, int height)
{
    const size_t n = 3 * (size_t)width;
    size_t k;
    int y;
    for (y = 0; y < height; y++) {
        unsigned char *const row = raw + (size_t)y * (n + 1) + 1;
        const int filter = row[-1];
        if (filter > 4) return 0;
        for (k = 0; k < n; k++) {
            const int a = k >= 3 ? row[k - 3] : 0, b = y > 0 ? *(row + k - n - 1) : 0,
                      c = k >= 3 && y > 0 ? *(row + k - n - 4) : 0;
            const int p = a + b - c, pa = abs(p - a), pb = abs(p - b), pc = abs(p - c);
            const int paeth = pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
            const int guess = filter == 0   ? 0
                              : filter == 1 ? a
                              : filter == 2 ? b
                              : filter == 3 ? (a + b) / 2
                                            : paeth;
            row[k] = (unsigned char)(row[k] + guess);
        }
    }
    return 1;
}

/* Walks the chunks: IHDR as 8-bit RGB of this size, IDAT joined, IEND at the very end. The joined data, or
   NULL. */
static bytes png_chunks(const bytes *file, int width, int height)
{
    static const unsigned char start[16] = {137, 'P', 'N', 'G', 13,  10,  26,  10,
                                            0,   0,   0,   13,  'I', 'H', 'D', 'R'};
    static const unsigned char depth[5] = {8, 2, 0, 0, 0};
    bytes joined = {NULL, 0};
    size_t at = 8;
    int ended = 0;
    if (file->size < 57 || memcmp(file->data, start, 16) != 0) return joined;
    if (big32(file->data + 16) != (uint32_t)width || big32(file->data + 20) != (uint32_t)height ||
        memcmp(file->data + 24, depth, 5) != 0)
        return joined;
    joined.data = (unsigned char *)malloc(file->size);
    while (joined.data && !ended && at + 12 <= file->size) {
        const size_t n = big32(file->data + at);
        const unsigned char *const body = file->data + at + 8;
        if (n > file->size - at - 12 || big32(body + n) != crc_of(file->data + at + 4, n + 4)) break;
        if (memcmp(body - 4, "IDAT", 4) == 0) {
            memcpy(joined.data + joined.size, body, n);
            joined.size += n;
        }
        ended = memcmp(body - 4, "IEND", 4) == 0 && n == 0;
        at += n + 12;
    }
    if (!ended || at != file->size) joined.size = 0;
    return joined;
}

/* Does this file hold these pixels? */
static int png_holds(const bytes *file, const unsigned char *rgb, int width, int height)
{
    const size_t stride = 3 * (size_t)width, raw_size = (stride + 1) * (size_t)height;
    unsigned char *const raw = (unsigned char *)malloc(raw_size);
    bytes data = png_chunks(file, width, height);
    int y, ok = raw && data.size > 0 && inflate(data.data, data.size, raw, raw_size) &&
                unfilter(raw, width, height);
    for (y = 0; ok && y < height; y++)
        ok = memcmp(raw + (size_t)y * (stride + 1) + 1, rgb + (size_t)y * stride, stride) == 0;
    free(raw);
    free(data.data);
    return ok;
}

/* Pictures of noise, of one colour, of stripes that repeat at long and short distances, of gradients. */
static unsigned char test_byte(int kind, size_t k, size_t stride, pt_pcg32 *rng)
{
    switch (kind) {
    case 0:
        return (unsigned char)(pt_pcg32_next(rng) >> 24);
    case 1:
        return 200;
    case 2:
        return (unsigned char)((k / 3) % 16 * 15);
    case 3:
        return (unsigned char)((k % stride) / 3 + (k / stride) * 2);
    default:
        return (unsigned char)(pt_pcg32_next(rng) % 50 == 0 ? pt_pcg32_next(rng) >> 24 : (k / stride) % 7);
    }
}

static void file_png_bytes(void)
{
    static const int size[6][2] = {{1, 1}, {1, 70}, {70, 1}, {67, 45}, {300, 200}, {150, 260}};
    int i, kind;
    for (i = 0; i < 6; i++)
        for (kind = 0; kind < 5; kind++) {
            const int w = size[i][0], h = size[i][1];
            const size_t n = 3 * (size_t)w * (size_t)h;
            unsigned char *const rgb = (unsigned char *)malloc(n);
            pt_pcg32 rng = pt_pcg32_make(3, (uint64_t)kind);
            bytes b;
            size_t k;
            for (k = 0; rgb && k < n; k++) rgb[k] = test_byte(kind, k, 3 * (size_t)w, &rng);
            pt_check(rgb && pt_write_png_bytes(out("a.png"), rgb, w, h) == PT_OK, "pt_write_png_bytes",
                     "fails");
            b = written(out("a.png"));
            pt_check(rgb && b.data && png_holds(&b, rgb, w, h),
                     label("PNG of %d x %d, pattern %d", w, h, kind),
                     "a chunk, a checksum, the compressed stream or a pixel is wrong");
            if (kind == 1 && i == 4)
                pt_check(b.size < n / 50, "PNG of one colour is small", "%lu bytes", (unsigned long)b.size);
            if (rgb && b.data && b.size > 60) { /* control: the reader sees one wrong bit anywhere */
                int caught = 0;
                for (k = 8; k < 48; k++) {
                    const size_t at = k < 28 ? k : 28 + (b.size - 29) * (k - 28) / 19;
                    b.data[at] ^= 4;
                    caught += !png_holds(&b, rgb, w, h);
                    b.data[at] ^= 4;
                    if (n > 10000) k += 9;
                }
                pt_check(caught == (n > 10000 ? 4 : 40), "PNG, control", "only %d damages were seen", caught);
            }
            free(b.data);
            free(rgb);
        }
}

static void file_png(void)
{
    pt_film f = film_of(17, 5, picture_value);
    unsigned char rgb[3 * 17 * 5];
    bytes b;
    size_t k;
    for (k = 0; k < sizeof rgb; k++) rgb[k] = (unsigned char)srgb_code(0.5 * pixel_value(&f, k));
    pt_check(pt_write_png(out("b.png"), &f, 0.5) == PT_OK, "pt_write_png", "fails");
    b = written(out("b.png"));
    pt_check(b.data && png_holds(&b, rgb, 17, 5), "PNG of a film", "differs");
    free(b.data);
    pt_film_free(&f);
}

/* A path that cannot be written is an error and leaves nothing, nor does it hurt what stood there. */
static void files_refused(void)
{
    static const unsigned char rgb[3] = {1, 2, 3};
    static const float pixel[3] = {1, 2, 3};
    pt_film f = film_of(2, 2, some_values), empty = PT_FILM_INIT;
    pt_report r = PT_REPORT_INIT;
    const pt_report *const reports_of[1] = {&r};
    const char *const paths[3] = {"no/such/directory/x", "", NULL};
    int i;
    for (i = 0; i < 3; i++) {
        const char *const p = paths[i];
        pt_check(pt_write_ppm(p, &f, 1) == PT_ERROR_FILE && pt_write_pfm(p, &f) == PT_ERROR_FILE &&
                     pt_write_png(p, &f, 1) == PT_ERROR_FILE &&
                     pt_write_ppm_bytes(p, rgb, 1, 1) == PT_ERROR_FILE &&
                     pt_write_png_bytes(p, rgb, 1, 1) == PT_ERROR_FILE &&
                     pt_write_pfm_floats(p, pixel, 1, 1) == PT_ERROR_FILE &&
                     pt_report_write_csv(&r, p) == PT_ERROR_FILE &&
                     pt_report_write_svg(reports_of, NULL, 1, NULL, p) == PT_ERROR_FILE,
                 label("unwritable path %d", i), "no PT_ERROR_FILE");
    }
    pt_check(pt_write_ppm("tests", &f, 1) == PT_ERROR_FILE && !exists("tests.part"), "a directory as path",
             "accepted, or something is left");
    pt_check(pt_write_ppm(out("c"), &empty, 1) == PT_ERROR_ARGUMENT &&
                 pt_write_pfm(out("c"), &empty) == PT_ERROR_ARGUMENT &&
                 pt_write_png(out("c"), &empty, 1) == PT_ERROR_ARGUMENT &&
                 pt_write_ppm(out("c"), &f, (double)NAN) == PT_ERROR_ARGUMENT &&
                 pt_write_ppm(out("c"), &f, -1) == PT_ERROR_ARGUMENT &&
                 pt_write_png(out("c"), &f, HUGE_VAL) == PT_ERROR_ARGUMENT,
             "nothing to write", "no PT_ERROR_ARGUMENT");
    pt_check(pt_write_ppm_bytes(out("c"), rgb, 0, 1) == PT_ERROR_ARGUMENT &&
                 pt_write_png_bytes(out("c"), rgb, 1, -1) == PT_ERROR_ARGUMENT &&
                 pt_write_pfm_floats(out("c"), pixel, 65537, 1) == PT_ERROR_ARGUMENT &&
                 pt_write_png_bytes(out("c"), NULL, 1, 1) == PT_ERROR_ARGUMENT,
             "wrong sizes", "no PT_ERROR_ARGUMENT");
    pt_check(!exists(out("c")) && !exists(label("%s.part", out("c"))), "refused files",
             "something was written");
    pt_check(pt_write_ppm_bytes(out("d"), rgb, 1, 1) == PT_OK &&
                 pt_write_ppm_bytes(out("d"), rgb, 1, 1) == PT_OK,
             "writing twice", "fails");
    {
        bytes b = written(out("d"));
        pt_check(b.size == 11 + 3, "writing twice, size", "%lu bytes", (unsigned long)b.size);
        free(b.data);
    }
    pt_film_free(&f);
}

/* ---- reports ---------------------------------------------------------------------------------------- */

static int count_of(const bytes *b, const char *word)
{
    const char *at = (const char *)b->data;
    int n = 0;
    while (at && (at = strstr(at, word)) != NULL) {
        n++;
        at += strlen(word);
    }
    return n;
}

/* A line of CSV: its number of fields, and field k as text. */
static int csv_field(const char *line, int k, char *text, size_t size)
{
    int fields = 1;
    size_t used = 0;
    for (; *line && *line != '\n'; line++) {
        if (*line == ',')
            fields++;
        else if (fields - 1 == k && used + 1 < size)
            text[used++] = *line;
    }
    text[used] = 0;
    return fields;
}

/* Each row has the fields of the head; the figures are those of the report to six digits, unknown ones
   empty. */
static void check_csv(const pt_report *r, const bytes *b, int has_truth)
{
    const char *line = (const char *)b->data;
    char text[64];
    const int fields = csv_field(line, 0, text, sizeof text);
    uint32_t i;
    int wrong = 0;
    for (i = 0; i < r->row_count; i++) {
        const double expected[4] = {(double)r->rows[i].spp, (double)r->rows[i].rays, r->rows[i].error.rmse,
                                    r->rows[i].true_error.relmse_001};
        static const int column[4] = {5, 8, 9, 15};
        int k;
        line = strchr(line, '\n');
        if (!line++) break;
        for (k = 0; k < 4; k++) {
            wrong += csv_field(line, column[k], text, sizeof text) != fields;
            if ((k == 2 && !r->rows[i].estimated) || (k == 3 && !has_truth))
                wrong += text[0] != 0;
            else
                wrong += fabs(strtod(text, NULL) - expected[k]) > 1e-5 * fabs(expected[k]);
        }
    }
    pt_check(wrong == 0 && fields == 16 && count_of(b, "\n") == (int)r->row_count + 1,
             label("CSV, %u rows", (unsigned)r->row_count), "%d fields wrong, %d columns, %d lines", wrong,
             fields, count_of(b, "\n"));
}

static void report_files(void)
{
    stage s = stage_of("furnace");
    float reference[8 * 8 * 3];
    uint32_t k;
    int has_truth, i;
    for (i = 0; i < 8 * 8 * 3; i++) reference[i] = 2;
    for (has_truth = 0; has_truth < 2; has_truth++) {
        pt_render_desc d = desc_of(&s, 8, 8, 24);
        pt_film film = PT_FILM_INIT;
        pt_report r = PT_REPORT_INIT;
        const pt_report *both[2];
        const char *const labels[2] = {"a<b & \"c\"", NULL};
        bytes b;
        both[0] = both[1] = &r;
        d.reference = has_truth ? reference : NULL;
        pt_check(pt_render(&s.scene, &d, &film, &r) == PT_OK, "report to be written", "no render");
        /* where the system limits CPU seconds its clock goes by ticks, and a point at 0 s is left out */
        for (k = 0; k < r.row_count; k++) r.rows[k].cpu_seconds = 1e-3 * (k + 1);
        pt_check(pt_report_write_csv(&r, out("r.csv")) == PT_OK, "pt_report_write_csv", "fails");
        b = written(out("r.csv"));
        if (b.data) check_csv(&r, &b, has_truth);
        free(b.data);
        pt_check(pt_report_write_svg(both, labels, 2, "x > y & z", out("r.svg")) == PT_OK,
                 "pt_report_write_svg", "fails");
        b = written(out("r.svg"));
        pt_check(b.size > 6 && memcmp(b.data, "<svg ", 5) == 0 &&
                     strcmp((const char *)b.data + b.size - 7, "</svg>\n") == 0,
                 "SVG, ends", "is not a whole picture");
        pt_check(count_of(&b, "<polyline") == 2 && count_of(&b, "slope -1/2") == 1 &&
                     count_of(&b, "<text") == count_of(&b, "</text>"),
                 "SVG, parts", "%d lines", count_of(&b, "<polyline"));
        pt_check(count_of(&b, "\"") % 2 == 0 && count_of(&b, "a<b") == 0 &&
                     count_of(&b, "a&lt;b &amp; ") == 1,
                 "SVG, letters that mean something", "are not replaced");
        pt_check(count_of(&b, "nan") == 0 && count_of(&b, "inf") == 0, "SVG, numbers", "are not finite");
        free(b.data);
        pt_film_free(&film);
        pt_report_free(&r);
    }
    pt_scene_free(&s.scene);
}

/* The table as text: a line for each row, 'unknown' where one sample cannot tell. */
static void report_text(void)
{
    stage s = stage_of("furnace");
    pt_render_desc d = desc_of(&s, 8, 8, 4);
    pt_film film = PT_FILM_INIT;
    pt_report r = PT_REPORT_INIT;
    FILE *const file = fopen(out("r.txt"), "wb");
    bytes b;
    pt_check(pt_render(&s.scene, &d, &film, &r) == PT_OK && file != NULL, "report to be printed",
             "no render, or no file");
    if (file) {
        pt_report_print(&r, file);
        fclose(file);
        b = written(out("r.txt"));
        pt_check(count_of(&b, "\n") == (int)r.row_count + 3 && count_of(&b, "unknown") >= 2 &&
                     count_of(&b, "path") >= 1 && count_of(&b, "sobol") >= 1 &&
                     count_of(&b, "stopped by samples at 4") == 1,
                 "pt_report_print", "%d lines:\n%s", count_of(&b, "\n"), b.data ? (const char *)b.data : "");
        free(b.data);
    }
    pt_film_free(&film);
    pt_report_free(&r);
    pt_scene_free(&s.scene);
}

int main(int argc, char **argv)
{
    pt_test_begin("test_driver", argc, argv);
    PT_TEST_EXACT(same_bits_threads);
    PT_TEST_EXACT(same_bits_samplers);
    PT_TEST_EXACT(same_bits_passes);
    PT_TEST_EXACT(first_budget_wins);
    PT_TEST_EXACT(continued);
    PT_TEST_EXACT(continued_refused);
    PT_TEST_EXACT(shards);
    PT_TEST_EXACT(merge_refused);
    PT_TEST_EXACT(ranges);
    PT_TEST_EXACT(general_body);
    PT_TEST_EXACT(orientation_grid);
    PT_TEST_EXACT(orientation_cornell);
    PT_TEST_EXACT(first_hits);
    PT_TEST_EXACT(error_figures);
    PT_TEST_EXACT(reports);
    PT_TEST_EXACT(single_net);
    PT_TEST(estimated_error);
    PT_TEST(estimated_error_cornell);
    PT_TEST_EXACT(refused_descs);
    PT_TEST_EXACT(progress_and_cancel);
    PT_TEST_EXACT(endless_paths);
    PT_TEST_EXACT(methods);
    PT_TEST_EXACT(empty_scenes);
    PT_TEST_EXACT(splats);
    PT_TEST_EXACT(file_ppm);
    PT_TEST_EXACT(file_ppm_bytes);
    PT_TEST_EXACT(file_pfm);
    PT_TEST_EXACT(file_pfm_bytes);
    PT_TEST_EXACT(file_png_bytes);
    PT_TEST_EXACT(file_png);
    PT_TEST_EXACT(files_refused);
    PT_TEST_EXACT(report_files);
    PT_TEST_EXACT(report_text);
    return pt_test_end();
}
