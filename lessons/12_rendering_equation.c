/* Lesson 12: the rendering equation, term by term

   QUESTION   The light that a surface reflects was itself reflected elsewhere. How can one start to compute it?

   IDEA       The slides replace the incident L_i of the reflection equation by the exitant L_o of the point q that is
              seen there, and add the emission L_e:

                  L_o(p, omega_o) = L_e(p, omega_o) + integral of L_o(q, -omega_i) f_r cos(theta_i) d omega_i

              In short L = Le + T L: the operator T, light transport, is one bounce of all light. Put in for itself,
              again and again, this is the Neumann series

                  L = Le + T Le + T^2 Le + T^3 Le + ...

              with one term for each number of edges of a path: T^k Le is the light that was reflected k times, on k+1
              edges. A path that goes on by p(omega) carries the product of its f cos / p, its throughput, and collects
              at each end of an edge what is emitted there: one value of every term at once. In the furnace test, a
              closed box whose walls all emit 1 and reflect rho, every term is known, and so is the variance of
              directions that are uniform over the hemisphere, where f cos / p = 2 rho cos, with mean square 4/3 rho^2.
              Here rho = 1/2:

                  T^k Le = rho^k        sum of K terms = (1 - rho^K) / (1 - rho)        L = 1 / (1 - rho)
                  variance of the term of k reflections = (4/3)^k rho^(2k) - rho^(2k)

   PICTURE    The Cornell box by light of exactly 1, 2, 3 (above), 4, 5 and 6 edges (below), made twice as bright.

   BUILD      cc -O2 -I.. 12_rendering_equation.c -o 12_rendering_equation -lm -pthread
   RUN        ./12_rendering_equation [samples] [output]

   PRINTS     edge by edge     samples     estimate        exact  std.error  seconds
              ...
              my sum             65536      1.99788            2     0.0027    0.606
              my T^0 Le          65536            1            1          0    0.606
              my T^1 Le          65536     0.500288          0.5     0.0011    0.606
              my T^2 Le          65536     0.249302         0.25    0.00086    0.606

   WORDS      rendering equation 渲染方程; light transport 光传输; emission 自发光; furnace test 白炉测试;
              throughput 吞吐量; bounce 弹射; incident 入射; exitant 出射

   HEADER     [PT-11] pt_li_path_plain, pt_observer, pt_lpe_compile, [PT-10] pt_film_class, [PT-19] pt_scene_furnace

   SOURCES    Kajiya: The Rendering Equation, 1986; the slides on the rendering equation

   Before: lesson 11, the reflection equation. Next: lesson 13, the slides' first solver. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { SIZE = 100, SHOWN = 6, MISTAKE = EX == 2 || EX == 3 };
enum { EDGES = EX == 1 ? 64 : 24 }; /* where the series is cut: rho^EDGES is left out */

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    double error = pt_stats_standard_error(s);
    if (error < 1e-6 * fabs(s->mean)) error = 0; /* rounding alone */
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact, error, seconds);
}

/* ---- mine ---- */

static pt_scene scene = PT_SCENE_INIT;
static const double rho = EX == 1 ? 0.8 : 0.5; /* albedo of every wall; each emits 1 */

/* One path, a value of each term: adds emission * throughput at the end of edge k to term[k - 1]. */
static void my_terms(pt_ray ray, pt_sampler *random, double *term)
{
    double beta = 1; /* the product of f cos / p so far */
    for (int k = 1; k <= EDGES; k++) {
        pt_hit hit;
        pt_frame frame;
        pt_vec3 w;
        double f;
        if (!pt_intersect(&scene, &ray, &hit)) return;
        term[k - 1] += beta * (double)pt_hit_emission(&scene, &hit, pt_v3_neg(ray.d)).r;
        if (EX == 3) return; /* "if the ray hits a light, return its light": this one reflects, too */
        f = (double)scene.materials[hit.material].albedo.r / (EX == 2 ? 1 : PT_PI);
        frame = pt_frame_from_normal(hit.ns);
        w = pt_warp_hemisphere(pt_sampler_2d(random));
        beta *= f * (double)w.z * 2 * PT_PI;
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, pt_frame_to_world(&frame, w));
    }
}

/* ---- the header's: it tells of every contribution; directions by the cosine ---- */

static void observe(void *user, const char *word, int edges, pt_rgbd value)
{
    (void)word; /* LE, LDE, LDDE, ... */
    ((double *)user)[edges - 1] += value.r;
}

static void its_terms(pt_ray ray, pt_sampler *random, double *term)
{
    pt_li_options options = {.max_edges = EDGES, .roulette = PT_ROULETTE_NONE, .observer = observe};
    pt_li_info info = {0};
    options.observer_user = term;
    pt_li_path_plain(&scene, &ray, random, &options, &info);
}

/* ---- both ---- */

static int agrees(const pt_stats *s, double exact)
{
    return fabs(s->mean - exact) <= 5 * pt_stats_standard_error(s) + 2e-5 * exact; /* what rounding takes */
}

/* Rows of the sum for growing counts, then one for each of the first terms. `spread`: the mean square of a direction's
   f cos / p over rho^2. */
static void table(const char *who, void (*terms)(pt_ray, pt_sampler *, double *), double spread, double most)
{
    const pt_ray ray = {{0, 0, 0.375}, {0.25, 0.5, -1}, 9};
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 21, 0);
    pt_stats term[EDGES] = {PT_STATS_INIT}, sum = PT_STATS_INIT;
    double seconds = pt_cpu_seconds();
    int good = 1;
    char name[32];
    snprintf(name, sizeof name, "%s sum", who);
    for (double n = floor(most / 256); n <= most; n *= 16) {
        while (sum.n < n) {
            double value[EDGES] = {0}, all = 0;
            pt_sampler_start(&random, 0, (uint32_t)sum.n);
            terms(ray, &random, value);
            for (int k = 0; k < EDGES; k++) {
                pt_stats_add(&term[k], value[k]);
                all += value[k];
            }
            pt_stats_add(&sum, all);
        }
        row(name, &sum, (1 - pow(rho, EDGES)) / (1 - rho), pt_cpu_seconds() - seconds);
    }
    seconds = pt_cpu_seconds() - seconds;
    for (int k = 0; k < 12; k++) { /* farther out too few values matter */
        double variance = (pow(spread, k) - 1) * pow(rho, 2 * k);
        snprintf(name, sizeof name, "%s T^%d Le", who, k);
        if (k < 5) row(name, &term[k], pow(rho, k), seconds);
        good &= agrees(&term[k], pow(rho, k));
        if (k < 4) good &= fabs(pt_stats_variance(&term[k]) - variance) <= 0.1 * variance + 1e-9;
    }
    check(good, "each term is rho^k, its variance as predicted");
    check(agrees(&sum, (1 - pow(rho, EDGES)) / (1 - rho)), "their sum is (1 - rho^K) / (1 - rho)");
    check(agrees(&sum, 1 / (1 - rho)), "that is 1 / (1 - rho) but for rho^K");
}

/* The terms as pictures: the Cornell box by light of exactly 1, 2, ... edges. */
static void picture(const char *output)
{
    static unsigned char rgb[SHOWN * SIZE * SIZE * 3];
    static const char *const words[SHOWN] = {"LE", "LDE", "LDDE", "LDDDE", "LDDDDE", "LDDDDDE"};
    pt_scene box = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT, part = PT_FILM_INIT;
    pt_render_desc desc = pt_render_defaults();
    pt_lpe lpe;
    char path[1024];
    desc.width = desc.height = SIZE;
    desc.spp = getenv("SHORT") ? 4 : 32;
    desc.li.lpe = &lpe;
    check(pt_lpe_compile(&lpe, words, SHOWN, NULL) == PT_OK && pt_scene_cornell(&box, &desc.camera) == PT_OK &&
          pt_render(&box, &desc, &film, NULL) == PT_OK, "the picture is rendered, with light sampling (lesson 17)");
    for (int k = 0; k < SHOWN && pt_film_class(&film, k, &part) == PT_OK; k++)
        for (int i = 0; i < SIZE * SIZE; i++) {
            int x = i % SIZE + k % 3 * SIZE, y = i / SIZE + k / 3 * SIZE;
            pt_rgbd v = pt_film_pixel(&part, i % SIZE, i / SIZE);
            double band[3] = {v.r, v.g, v.b};
            for (int c = 0; c < 3; c++) rgb[3 * (y * 3 * SIZE + x) + c] = pt_srgb_byte(2 * band[c]);
        }
    snprintf(path, sizeof path, "%s.ppm", output);
    check(pt_write_ppm_bytes(path, rgb, 3 * SIZE, 2 * SIZE) == PT_OK, "written as PPM");
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, rgb, 3 * SIZE, 2 * SIZE) == PT_OK, "and as PNG");
    pt_film_free(&part);
    pt_film_free(&film);
    pt_scene_free(&box);
}

int main(int argc, char **argv)
{
    double most = (argc > 1 ? fmax(atof(argv[1]), 4096) : 65536) / (getenv("SHORT") ? 16 : 1);
    pt_camera camera;
    if (pt_scene_furnace(&scene, &camera) != PT_OK) return 1;
    scene.materials[0].albedo = pt_rgb_grey((pt_real)rho);
    check(pt_commit(&scene) == PT_OK, "the furnace is ready");
    printf("%-14s %9s %12s %12s %10s %8s\n", "edge by edge", "samples", "estimate", "exact", "std.error", "seconds");
    table("my", my_terms, 4.0 / 3, most);
    table("its", its_terms, 1, most); /* f cos / p = rho always: lesson 09 */
    printf("What to see: each edge adds rho times the one before; sampling by the cosine makes no error here.\n");
    picture(argc > 2 ? argv[2] : "12_rendering_equation");
    pt_scene_free(&scene);

    printf("lesson 12: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: walls that reflect 0.8 (-DEX=1). How bright is the furnace, and after how many edges is less than 1 %
       missing? Answer: 5; rho^K < 0.01 from K = 21 edges on (for 0.5: 7). A bright room needs long paths.
   (2) Break: forget the 1/pi of the diffuse BRDF (-DEX=2): pi rho > 1, the series grows without end. Return at a lamp
       as if it reflected nothing (-DEX=3), as shade() of the slides does: 1 instead of 2.
   (3) Extend: let the walls reflect (0.2, 0.5, 0.8) in red, green, blue. Answer: L = (1.25, 2, 5), a white light made
       blue by many reflections. In pt_scene_diffuse_sphere (a point light of 1 W in a white sphere of radius 1, rho =
       0.5) all terms but the first reflected one add up to rho^2 / (4 pi^2 (1 - rho)) = 0.012665, everywhere. */
