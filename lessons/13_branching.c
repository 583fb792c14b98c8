/* Lesson 13: the branching solver, and why nobody uses it

   QUESTION   The slides' first program asks N directions at every surface. How long does that take?
   IDEA       The slides' first program, in short, with a pdf and a lamp that a ray finds by hitting it:

                  shade(p, wo):  for each of N directions wi of density pdf: what does the ray from p along wi meet?
                      a lamp:    Lo += L_i f_r cos / (N pdf)
                      else q:    Lo += shade(q, -wi) f_r cos / (N pdf)          (multiple recursion)

              It is an estimator of the rendering equation, but for L_e at p, which it forgets; unbiased if the depth
              is not limited, and then it never ends. With at most d edges one value takes

                  1 + N + N^2 + ... + N^(d-1) = (N^d - 1) / (N - 1)        rays: exponential explosion

              and nearly all of them are the last ones, which matter least: each reflection takes the factor rho.
              In a furnace (lesson 12) the mean is m_d = (1 - rho^d) / (1 - rho), and the variance follows edge by
              edge, with the mean square c rho^2 of f cos / p, c = 4/3 for uniform directions:

                  V_1 = 0,   V_d = ( c rho^2 (V_(d-1) + m_(d-1)^2) - rho^2 m_(d-1)^2 ) / N

              So N divides the variance by little more than N, and multiplies the work by N^(d-1).
   PICTURE    The Cornell box by equally many rays: left one tree a pixel (N = 3: 40 rays), right 10 paths of 4 edges.
   BUILD      cc -O2 -I.. 13_branching.c -o 13_branching -lm -pthread
   RUN        ./13_branching [samples] [output]          samples: rays for each row
   PRINTS     one tree               9        87381        87381      87381    0.069
              equal rays         trees     estimate        exact  std.error  seconds
              my N = 1          104857       1.9374       1.9375      0.002    0.182
              my N = 8             112      1.92702       1.9375      0.018    0.200
   WORDS      multiple recursion 多重递归; rendering equation 渲染方程; estimator 估计量; variance 方差; unbiased 无偏
   HEADER     [PT-11] pt_li_branching, pt_li_info (rays), [PT-18] pt_render, [PT-19] pt_scene_furnace
   SOURCES    the slides' "simple Monte Carlo solver"; Kajiya: The Rendering Equation, 1986, on the number of rays
   Before: lesson 12, the rendering equation. Next: lesson 14, Russian roulette. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX >= 2 };
static const double RHO = 0.5;    /* albedo of every wall of the furnace; each emits 1 */
enum { EDGES = EX == 1 ? 3 : 5 }; /* of the trees whose error is measured */

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

typedef struct setting {
    pt_scene scene;
    int n, edges; /* directions at each surface, edges at most */
    double rays;  /* how many were traced */
} setting;

typedef double (*value_fn)(setting *s, pt_sampler *random);

/* Takes n values and prints a row; 1 if the mean is exact within 5 standard errors and the rounding of float. */
static int row(const char *name, value_fn value, setting *s, double exact, uint32_t n, pt_stats *stats)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 13, n);
    double start = pt_cpu_seconds(), error;
    memset(stats, 0, sizeof *stats);
    for (uint32_t i = 0; i < n; i++) {
        pt_sampler_start(&random, n, i);
        pt_stats_add(stats, value(s, &random));
    }
    error = pt_stats_standard_error(stats);
    if (error < pt_gamma(1)) error = 0; /* rounding alone is no error of sampling */
    printf("%-14s %9u %12.6g %12.6g %10.2g %8.3f\n", name, n, stats->mean, exact, error, pt_cpu_seconds() - start);
    return fabs(stats->mean - exact) <= 5 * error + pt_gamma(300) * exact; /* 300 operations */
}

/* ---- the new piece: the slides' shade(), which calls itself N times ------------------------------------ */

static double my_shade(setting *s, pt_ray ray, int edges, pt_sampler *random)
{
    pt_hit hit;
    s->rays++;
    if (!pt_intersect(&s->scene, &ray, &hit)) return 0;
    double lo = (double)pt_hit_emission(&s->scene, &hit, pt_v3_neg(ray.d)).r; /* L_e: the slides forget it */
    if (edges == 1) return lo;
    double f = (double)s->scene.materials[hit.material].albedo.r / PT_PI;
    pt_frame frame = pt_frame_from_normal(hit.ns);
    for (int i = 0; i < s->n; i++) {
        pt_vec3 w = pt_warp_hemisphere(pt_sampler_2d(random));
        pt_ray next = pt_spawn_ray(hit.p, hit.p_error, hit.ng, pt_frame_to_world(&frame, w));
        double p = 1 / (2 * PT_PI), share = EX == 2 ? 1 : 1.0 / s->n;
        lo += share * my_shade(s, next, edges - 1, random) * f * (double)w.z / p;
    }
    return lo;
}

static const pt_ray first_ray = {{0, 0, 0.375}, {0.25, 0.5, -1}, 9};

static double my_value(setting *s, pt_sampler *random) { return my_shade(s, first_ray, s->edges, random); }

/* ---- the header's: the same tree, directions by the cosine --------------------------------------------- */

static double its_value(setting *s, pt_sampler *random)
{
    pt_li_options options = {0};
    pt_li_info info = {0};
    options.branching = s->n;
    options.max_edges = s->edges;
    double value = pt_li_branching(&s->scene, &first_ray, random, &options, &info).r;
    s->rays += (double)info.rays;
    return value;
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

static double tree(int n, int edges) { return n == 1 ? edges : (pow(n, edges) - 1) / (n - 1); } /* rays */

static double variance(int n, int edges)
{
    double v = 0, m = 1;
    for (int d = 2; d <= edges; d++) {
        v = RHO * RHO * (4.0 / 3 * (v + m * m) - m * m) / n;
        m = 1 + RHO * m;
    }
    return v;
}

static void count_rays(setting *s)
{
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 13, 1);
    int good = 1;
    printf("%-14s %9s %12s %12s %10s %8s\n", "N = 4", "edges", "my rays", "its rays", "exact", "seconds");
    for (s->n = 4, s->edges = 1; s->edges <= 9; s->edges += 2) {
        double mine, exact = tree(4, s->edges), start = pt_cpu_seconds();
        s->rays = 0;
        my_value(s, &random);
        mine = s->rays;
        its_value(s, &random);
        printf("%-14s %9d %12.0f %12.0f %10.0f %8.3f\n", "one tree", s->edges, mine, s->rays - mine, exact,
               pt_cpu_seconds() - start);
        good &= mine == exact && s->rays == 2 * exact;
    }
    check(good, "rays of a tree: (N^d - 1) / (N - 1)");
}

/* N = 1, 2, 4, 8 with equally many rays each. */
static void table(const char *who, value_fn value, setting *s, double rays)
{
    double exact = (1 - pow(RHO, EX == 3 ? 999 : EDGES)) / (1 - RHO); /* what is cut off is not there: EX=3 */
    int good = 1;
    for (s->n = 1, s->edges = EDGES; s->n <= 8; s->n *= 2) {
        double count = fmax(32, floor(rays / tree(s->n, EDGES)));
        double v = value == my_value ? variance(s->n, EDGES) : 0; /* its f cos / p is rho: no variance */
        pt_stats stats;
        char name[32];
        snprintf(name, sizeof name, "%s N = %d", who, s->n);
        good &= row(name, value, s, exact, (uint32_t)count, &stats);
        good &= fabs(pt_stats_variance(&stats) - v) <= 8 * sqrt(2 / count) * v + 1e-9;
    }
    check(good, "mean and variance for every N are those of the furnace");
}

static void picture(const char *output)
{
    enum { SIZE = 150 };
    pt_scene scene = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT, half = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    char path[512];
    if (pt_scene_cornell(&scene, &desc.camera) != PT_OK || pt_film_make(&film, 2 * SIZE, SIZE, 0) != PT_OK) return;
    film.samples[0] = 1;
    desc.width = desc.height = SIZE;
    desc.li.max_edges = 4;
    desc.li.branching = 3;
    desc.li.roulette = PT_ROULETTE_NONE;
    for (int k = 0; k < 2; k++) {
        desc.method = k ? "path-plain" : "branching";
        desc.spp = k ? 10 : 1;
        if (pt_render(&scene, &desc, &half, NULL) != PT_OK) return;
        for (int i = 0; i < SIZE * SIZE; i++) {
            pt_rgbd c = pt_film_pixel(&half, i % SIZE, i / SIZE);
            memcpy(film.half[0] + 3 * (i / SIZE * 2 * SIZE + i % SIZE + k * SIZE), &c, sizeof c);
        }
        pt_film_free(&half);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 1);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 1) == PT_OK, path);
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    double rays = fmax(16384, (argc > 1 ? strtod(argv[1], NULL) : 524288) / (getenv("SHORT") ? 16 : 1));
    setting s = {PT_SCENE_INIT, 0, 0, 0};
    pt_camera camera;
    if (pt_scene_furnace(&s.scene, &camera) != PT_OK) return 1;
    count_rays(&s);
    printf("%-14s %9s %12s %12s %10s %8s\n", "equal rays", "trees", "estimate", "exact", "std.error", "seconds");
    table("my", my_value, &s, rays);
    table("its", its_value, &s, rays);
    printf("What to see: for the same rays, one direction has the least error; then the tree is a path.\n");
    picture(argc > 2 ? argv[2] : "13_branching");
    pt_scene_free(&s.scene);
    printf("lesson 13: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: trees of 3 edges instead of 5 (-DEX=1). By how much is the error of N = 8 larger than that of N = 1,
       for the same number of rays? Answer: sqrt(73 V_3(8) / (3 V_3(1))) = 1.64; for 5 edges it is 9.4.
   (2) Break: forget the 1/N (-DEX=2): the sum grows as N^d. Compare with 1 / (1 - rho), as if nothing were cut off
       (-DEX=3): both tables fail, the light of more than 5 edges, rho^5 / (1 - rho) = 0.0625, is missing.
   (3) Extend: how many rays has a tree of 24 edges with N = 2? And what if only the first surface branches, into 4?
       Answer: 16777215, where a path has 24. Into 4 paths of 4 edges: 17 rays and V_5(1) / 4, 15 % better than the 5
       rays and V_5(1) of a path: the first edge has no variance here. In a picture it has: edges of things. */
