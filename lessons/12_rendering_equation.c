/* Lesson 12: the rendering equation, term by term

   QUESTION   The light that a surface reflects was itself reflected elsewhere. How can one start to compute
              it?

   IDEA       The slides replace L_i of the reflection equation by the L_o of the point that is seen there:

                  L_o(p, omega_o) = L_e(p, omega_o) + integral of L_o(q, -omega_i) f_r cos(theta_i) d omega_i

              In short L = Le + T L. Put in for itself, again and again, this is the Neumann series

                  L = Le + T Le + T^2 Le + T^3 Le + ...

              with one term for each number of edges of a path: T^k Le is the light that was reflected k
              times, on k+1 edges. A path that goes on by p(omega) carries the product of its f cos / p and
              collects at each end of an edge what is emitted there: one value of every term at once. In a
              furnace, a closed box whose walls all emit 1 and reflect rho, every term is known, and so is the
              variance of directions that are uniform over the hemisphere, where f cos / p = 2 rho cos, with
              mean square 4/3 rho^2:

                  T^k Le = rho^k        sum of K terms = (1 - rho^K) / (1 - rho)        L = 1 / (1 - rho)
                  variance of the term of k reflections = (4/3)^k rho^(2k) - rho^(2k)

   BUILD      cc -O2 -I.. 12_rendering_equation.c -o 12_rendering_equation -lm -pthread
   RUN        ./12_rendering_equation [samples] [output]

   PRINTS     edge by edge     samples     estimate        exact  std.error  seconds
              ...
              my T^0 Le          32768            1            1          0    0.274
              my T^1 Le          32768     0.499963          0.5     0.0016    0.274
              my T^2 Le          32768      0.25099         0.25     0.0012    0.274
              my T^3 Le          32768     0.125715        0.125    0.00081    0.274
              my T^4 Le          32768     0.062736       0.0625    0.00051    0.274
              my sum             32768       2.0022            2     0.0039    0.274

   WORDS      rendering equation 渲染方程; light transport 光传输; emission 自发光; furnace test 白炉测试;
              throughput 吞吐量; bounce 弹射; incident 入射; exitant 出射

   HEADER     [PT-11] pt_li_path_plain, pt_observer, [PT-19] pt_scene_furnace, pt_scene_cornell

   SOURCES    Kajiya: The Rendering Equation, 1986; the slides on the rendering equation

   Before: lesson 11, the reflection equation. Next: lesson 13, the slides' first solver. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX == 2 || EX == 3 };
static const double RHO = EX == 1 ? 0.8 : 0.5; /* albedo of every wall; each emits 1 */
enum { EDGES = EX == 1 ? 64 : 24 };                    /* where the series is cut: RHO^EDGES is left out */

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    double error = pt_stats_standard_error(s); /* rounding alone is no error of sampling */
    if (error < 1e-6 * fabs(s->mean)) error = 0;
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact, error, seconds);
}

static pt_vec2 pair(pt_pcg32 *random)
{
    pt_real x = pt_real_from_u32(pt_pcg32_next(random));
    return pt_v2(x, pt_real_from_u32(pt_pcg32_next(random)));
}

enum { TERMS = 64 }; /* places for terms: edge k at k - 1 */

/* ---- the new piece: one path, a value of each term ---------------------------------------------------- */

/* Adds emission * throughput at the end of edge k to term[k - 1]. */
static void my_terms(const pt_scene *scene, pt_ray ray, pt_pcg32 *random, double *term)
{
    double beta = 1; /* the product of f cos / p so far */
    for (int k = 1; k <= EDGES; k++) {
        pt_hit hit;
        pt_frame frame;
        pt_vec3 w;
        double f;
        if (!pt_intersect(scene, &ray, &hit)) return;
        term[k - 1] += beta * (double)pt_hit_emission(scene, &hit, pt_v3_neg(ray.d)).r;
        if (EX == 3) return; /* "if the ray hits a light, return its light": this one reflects, too */
        f = (double)scene->materials[hit.material].albedo.r / (EX == 2 ? 1 : PT_PI);
        frame = pt_frame_from_normal(hit.ns);
        w = pt_warp_hemisphere(pair(random));
        beta *= f * (double)w.z * 2 * PT_PI;
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, pt_frame_to_world(&frame, w));
    }
}

/* ---- the header's: it tells of every contribution; directions by the cosine --------------------------- */

static void observe(void *user, const char *word, int edges, pt_rgbd value)
{
    (void)word; /* LE, LDE, LDDE, ... */
    if (edges <= TERMS) ((double *)user)[edges - 1] += value.r;
}

static void its_terms(const pt_scene *scene, pt_ray ray, pt_pcg32 *random, double *term)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_pcg32_next(random), 1);
    pt_li_options options = pt_render_defaults().li;
    pt_li_info info;
    memset(&info, 0, sizeof info);
    options.max_edges = EDGES;
    options.roulette = PT_ROULETTE_NONE;
    options.observer = observe;
    options.observer_user = term;
    pt_sampler_start(&sampler, 0, 0);
    pt_li_path_plain(scene, &ray, &sampler, &options, &info);
}

typedef void (*terms_fn)(const pt_scene *scene, pt_ray ray, pt_pcg32 *random, double *term);

/* ---- tables, the picture ------------------------------------------------------------------------------- */

static int agrees(const pt_stats *s, double exact)
{
    return fabs(s->mean - exact) <= 5 * pt_stats_standard_error(s) + 2e-5 * fabs(exact);
}

/* A row for each of the first terms at the largest count, and rows of their sum for growing counts. */
static void table(const char *who, terms_fn terms, const pt_scene *scene, uint32_t samples, double spread)
{
    const pt_ray ray = {{0, 0, 0.375}, {0.25, 0.5, -1}, 9};
    double sum_exact = (1 - pow(RHO, EDGES)) / (1 - RHO);
    int good = 1, k;
    char name[32];
    for (uint32_t n = samples / 16; n <= samples; n *= 4) {
        pt_pcg32 random = pt_pcg32_make(n, 12);
        pt_stats term[TERMS], sum = PT_STATS_INIT;
        double start = pt_cpu_seconds(), value[TERMS], all;
        memset(term, 0, sizeof term);
        for (uint32_t i = 0; i < n; i++) {
            memset(value, 0, sizeof value);
            terms(scene, ray, &random, value);
            for (k = 0, all = 0; k < EDGES; all += value[k++]) pt_stats_add(&term[k], value[k]);
            pt_stats_add(&sum, all);
        }
        start = pt_cpu_seconds() - start;
        for (k = 0; k < EDGES && n == samples; k++) {
            double variance = (pow(spread, k) - 1) * pow(RHO, 2 * k), its = pt_stats_variance(&term[k]);
            snprintf(name, sizeof name, "%s T^%d Le", who, k);
            if (k < 5) row(name, &term[k], pow(RHO, k), start);
            if (k < 12) good &= agrees(&term[k], pow(RHO, k)); /* farther out too few values matter */
            if (k < 4) good &= fabs(its - variance) <= 0.1 * variance + 1e-9;
        }
        snprintf(name, sizeof name, "%s sum", who);
        row(name, &sum, sum_exact, start);
        if (n < samples) continue;
        check(good, "each term is rho^k, its variance as predicted");
        check(agrees(&sum, sum_exact), "their sum is (1 - rho^K) / (1 - rho)");
        check(agrees(&sum, 1 / (1 - RHO)), "that is 1 / (1 - rho) but for rho^K");
    }
}

/* The terms as pictures: the Cornell box (red band) by light of exactly 1, 2, 3, 4, 5 and 6 edges. */
static void picture(const char *output)
{
    enum { SIZE = 100, SPP = 20 };
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    pt_film film = PT_FILM_INIT;
    pt_pcg32 random = pt_pcg32_make(0, 12);
    pt_li_options options = pt_render_defaults().li;
    pt_li_info info;
    char path[512];
    if (pt_scene_cornell(&scene, &camera) != PT_OK) return;
    if (pt_film_make(&film, 3 * SIZE, 2 * SIZE, 0) != PT_OK) return;
    film.samples[0] = SPP;
    options.max_edges = 6;
    options.observer = observe;
    memset(&info, 0, sizeof info);
    for (int i = 0; i < SIZE * SIZE * SPP; i++) {
        int x = i / SPP % SIZE, y = i / SPP / SIZE;
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, 0, SPP);
        double term[TERMS] = {0};
        pt_vec2 u = pair(&random);
        pt_ray ray = pt_camera_ray(&camera, 1, ((pt_real)x + u.x) / SIZE, ((pt_real)y + u.y) / SIZE, u);
        options.observer_user = term;
        pt_sampler_start(&sampler, (uint64_t)(i / SPP), (uint32_t)(i % SPP));
        pt_li_path(&scene, &ray, &sampler, &options, &info); /* with light sampling (lesson 17): less noise */
        for (int k = 0; k < 6; k++)
            for (int c = 0; c < 3; c++)
                film.half[0][3 * ((y + k / 3 * SIZE) * film.width + x + k % 3 * SIZE) + c] += term[k];
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm(path, &film, 2);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png(path, &film, 2) == PT_OK, path);
    pt_film_free(&film);
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    uint32_t samples = argc > 1 ? (uint32_t)strtoul(argv[1], NULL, 10) : 32768;
    pt_scene scene = PT_SCENE_INIT;
    pt_camera camera;
    samples = (uint32_t)fmax(4096, samples / (getenv("SHORT") ? 16 : 1));
    if (pt_scene_furnace(&scene, &camera) != PT_OK) return 1;
    scene.materials[0].albedo = pt_rgb_grey((pt_real)RHO);
    if (pt_commit(&scene) != PT_OK) return 1;

    printf("%-14s %9s %12s %12s %10s %8s\n", "edge by edge", "samples", "estimate", "exact", "std.error",
           "seconds");
    table("my", my_terms, &scene, samples, 4.0 / 3);
    table("its", its_terms, &scene, samples, 1); /* f cos / p = rho always: lesson 09 */
    printf("What to see: each edge adds rho times the one before; the cosine makes no error here.\n");
    picture(argc > 2 ? argv[2] : "12_rendering_equation");
    pt_scene_free(&scene);
    printf("lesson 12: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return failed == 0;
}

/* EXERCISES
   (1) Predict: walls that reflect 0.8 (-DEX=1). How bright is the furnace, and after how many edges is less
       than 1 % missing? Answer: 5; rho^K < 0.01 from K = 21 edges on (for 0.5: 7). The picture of a bright
       room needs long paths.
   (2) Break: forget the 1/pi of the diffuse BRDF (-DEX=2): pi rho > 1, the series grows without end. Return
       at a lamp as if it reflected nothing (-DEX=3), as shade() of the slides does: 1 instead of 2.
   (3) Extend: let the walls reflect (0.2, 0.5, 0.8) in red, green, blue. Answer: L = (1.25, 2, 5), a white
       light made blue by many reflections. In pt_scene_diffuse_sphere (a point light of 1 W in a white sphere
       of radius 1, rho = 0.5) all terms but the first reflected one add up to rho^2 / (4 pi^2 (1 - rho)) =
       0.012665, everywhere. */
