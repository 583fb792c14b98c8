/* Lesson 19: the bounding volume hierarchy (BVH): cost against triangle count

   QUESTION   A ray that asks each of a million triangles is slow. How few can it ask, and never miss one?
   IDEA       Put triangles in boxes, boxes in boxes: a tree, the usual acceleration structure. A ray that misses a box
              misses all that is in it. Of the lines that enter a convex body S, the fraction that enters a convex box
              s inside it is

                  P(s | S) = area(s) / area(S)                    (Cauchy, Crofton: all lines equally likely)

              so a line enters, on average, sum over nodes of area(node) / area(S) boxes of a tree: the exact value
              below, for S a ball around everything. The surface area heuristic (SAH), by which the header builds its
              tree, keeps this sum and the tests in leaves small: they grow as log n at most, not as n.
              A line is between two planes for t0 <= t <= t1; it enters the box if the latest entry is <= the earliest
              exit. It must be <=: a wall parallel to an axis has a box without thickness, t0 = t1.
   PICTURE    How many boxes and triangles each pixel asked in my tree of 32770; white is 100.
   BUILD      cc -O2 -I.. 19_bvh.c -o 19_bvh -lm -pthread
   RUN        ./19_bvh [samples] [output]          samples: at most 65536 rays
   PRINTS     32770 triangles      rays    boxes/ray exact, tests  std.error  seconds
              lines, mine        65536       35.743       35.922       0.19    0.209
              hits, mine         65536       23.782       1.6107       0.13    0.166
              hits, linear         511      0.49706        16289      0.022    0.439
   WORDS      bounding volume hierarchy 层次包围盒; acceleration structure 加速结构
   HEADER     [PT-06] pt_intersect_triangle, [PT-07] pt_bvh, pt_bvh_node, [PT-10] pt_intersect
   SOURCES    [Ize13] why the exit is rounded up, [Woo13] the triangle test, [PBR] 7.3 the heuristic
   Before: lesson 18, multiple importance sampling. Next: lesson 20, Snell and Fresnel. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0 /* an exercise, see the end */
#endif
enum { MISTAKE = EX >= 2 };
enum { LEAF = EX == 1 ? 16 : 1, MOST = 32770, RAYS = 65536 }; /* most triangles in a leaf, triangles, rays */

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

/* ---- the new piece: a tree of boxes, laid out as the header documents pt_bvh: one traversal walks both ---- */

static double get(pt_vec3 v, uint32_t axis) { return (double)(axis == 0 ? v.x : axis == 1 ? v.y : v.z); }

static pt_vec3 corner(const pt_scene *s, uint32_t i, uint32_t k) { return s->positions[s->triangles[i].v[k]]; }

/* Makes node `index` of order[first .. first + count): cuts its box in the middle of the longest side. */
static void my_split(pt_bvh *tree, const pt_scene *s, uint32_t index, uint32_t first, uint32_t count)
{
    pt_bvh_node *node = &tree->nodes[index];
    uint32_t *order = tree->order + first, child = tree->node_count, left = 0, axis = 0;
    double lo[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, hi[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    for (uint32_t i = 0; i < 9 * count; i++) {
        double x = get(corner(s, order[i / 9], i / 3 % 3), i % 3);
        lo[i % 3] = fmin(lo[i % 3], x);
        hi[i % 3] = fmax(hi[i % 3], x);
    }
    node->lo = pt_v3((pt_real)lo[0], (pt_real)lo[1], (pt_real)lo[2]);
    node->hi = pt_v3((pt_real)hi[0], (pt_real)hi[1], (pt_real)hi[2]);
    node->count = count <= LEAF ? count : 0;
    node->first = count <= LEAF ? first : child;
    if (count <= LEAF) return;
    for (uint32_t k = 1; k < 3; k++) axis = hi[k] - lo[k] > hi[axis] - lo[axis] ? k : axis;
    for (uint32_t i = 0; i < count; i++) {
        uint32_t c = order[i];
        double sum = get(corner(s, c, 0), axis) + get(corner(s, c, 1), axis) + get(corner(s, c, 2), axis);
        if (sum / 3 >= (lo[axis] + hi[axis]) / 2) continue;
        order[i] = order[left];
        order[left++] = c;
    }
    if (left == 0 || left == count) left = count / 2; /* all on one side */
    tree->node_count += 2;
    my_split(tree, s, child, first, left);
    my_split(tree, s, child + 1, first + left, count - left);
}

/* Where the ray enters the box; infinity if it misses it, or enters after `best`. */
static double my_enter(const pt_ray *ray, const pt_bvh_node *box, double best)
{
    double in = 0, out = best, up = 1 + 2 * pt_gamma(3); /* more than the roundings of t0 and t1 [Ize13] */
    for (uint32_t k = 0; k < 3; k++) {
        double o = get(ray->o, k), d = get(ray->d, k);
        double t0 = (get(box->lo, k) - o) / d, t1 = (get(box->hi, k) - o) / d;
        in = fmax(in, fmin(t0, t1)); /* fmin and fmax drop the NaN of 0/0 */
        out = fmin(out, fmax(t0, t1) * (EX == 2 ? 1 : up));
    }
    return (EX == 2 ? in < out : in <= out) ? in : HUGE_VAL; /* 2: flat boxes vanish */
}

/* The nearest hit, -1 if none; no scene: only the boxes that the line enters are counted. work: boxes, tests. */
static int my_traverse(const pt_bvh *tree, const pt_scene *s, const pt_ray *ray, double work[2])
{
    uint32_t stack[256] = {0}, top = 1; /* the root */
    double nearest = HUGE_VAL, t, b[2];
    int hit = -1;
    while (top > 0) {
        const pt_bvh_node *node = &tree->nodes[stack[--top]];
        if (my_enter(ray, node, nearest) == HUGE_VAL) continue;
        if (EX == 3 && hit >= 0) break; /* the first hit need not be the nearest */
        work[0]++;
        for (uint32_t k = 0; k < 2 && node->count == 0; k++) stack[top++] = node->first + k;
        for (uint32_t k = node->first; s && k < node->first + node->count; k++) {
            uint32_t i = tree->order[k]; /* a primitive: here they are all triangles */
            work[1]++;
            if (!pt_intersect_triangle(ray, corner(s, i, 0), corner(s, i, 1), corner(s, i, 2), &t, b)) continue;
            if (t > nearest || (t == nearest && (int)i > hit)) continue; /* of equals the lower index, as the header */
            nearest = t;
            hit = (int)i;
        }
    }
    return hit;
}

/* ---- tables, the picture ------------------------------------------------------------------------------- */

#define BALL 4.4 /* radius of a ball around everything */

/* All lines through the ball alike: from a uniform point of its surface, cosine-weighted inwards. */
static pt_ray random_line(pt_sampler *random, uint32_t i)
{
    pt_sampler_start(random, 0, i);
    pt_vec3 n = pt_warp_sphere(pt_sampler_2d(random));
    pt_frame inwards = pt_frame_from_normal(pt_v3_neg(n));
    pt_vec3 d = pt_frame_to_world(&inwards, pt_warp_cosine(pt_sampler_2d(random)));
    pt_ray ray = {pt_v3_scale(n, (pt_real)BALL), d, (pt_real)HUGE_VAL};
    return ray;
}

/* A row of n rays; *ok stays if all is as it should be. With a scene: without a tree by pt_intersect, which does not
   count, then by a tree, which must hit the same. Without a scene: lines, and the exact number of boxes. */
static double row(const char *name, const pt_bvh *tree, const pt_scene *scene, uint32_t n, int *ok)
{
    static int hits[RAYS];
    pt_sampler random = pt_sampler_make(PT_SAMPLER_INDEPENDENT, 19, n);
    pt_stats s = PT_STATS_INIT;
    double exact = 0, tests = 0, error, start = pt_cpu_seconds();
    for (uint32_t i = 0; i < n; i++) {
        pt_ray ray = random_line(&random, i);
        double work[2] = {0, 0};
        pt_hit hit;
        if (!tree) hits[i] = pt_intersect(scene, &ray, &hit) ? hit.primitive : -1;
        else if (my_traverse(tree, scene, &ray, work) != hits[i] && scene) *ok = 0;
        pt_stats_add(&s, work[0]);
        tests += work[1] / n;
    }
    for (uint32_t k = 0; !scene && k < tree->node_count; k++) {
        pt_vec3 e = pt_v3_sub(tree->nodes[k].hi, tree->nodes[k].lo);
        exact += 2 * (double)(e.x * e.y + e.y * e.z + e.z * e.x) / (4 * PT_PI * BALL * BALL);
    }
    error = pt_stats_standard_error(&s);
    printf("%-14s %9u %12.5g %12.5g %10.2g %8.3f\n", name, n, s.mean, exact + tests, error, pt_cpu_seconds() - start);
    *ok &= scene || fabs(s.mean - exact) <= 5 * error;
    return s.mean + tests;
}

/* A bumpy torus of 2 n^2 triangles, on a floor of 2. */
static pt_vec3 torus(int i, int j, int n)
{
    double u = 2 * PT_PI * (i % n) / n, v = 2 * PT_PI * (j % n) / n;
    double r = 0.8 + 0.1 * sin(7 * u) * sin(5 * v), x = 2 + r * cos(v);
    return pt_v3((pt_real)(x * cos(u)), (pt_real)(r * sin(v)), (pt_real)(x * sin(u)));
}

static int make_scene(pt_scene *s, int n)
{
    int white = pt_add_material(s, pt_material_diffuse(pt_rgb_grey(1)));
    for (int k = 0; k < n * n; k++)
        pt_add_quad(s, torus(k / n, k % n, n), torus(k / n, k % n + 1, n), torus(k / n + 1, k % n + 1, n),
                    torus(k / n + 1, k % n, n), white);
    pt_add_quad(s, pt_v3(-3, -1, -3), pt_v3(-3, -1, 3), pt_v3(3, -1, 3), pt_v3(3, -1, -3), white);
    return pt_commit(s) == PT_OK;
}

static void picture(const char *output, const pt_bvh *tree, const pt_scene *scene)
{
    enum { W = 320, H = 240 };
    static unsigned char image[3 * W * H];
    pt_camera camera = pt_camera_look_at(pt_v3(0, 6, 6), pt_v3(0, 0, 0), pt_v3(0, 1, 0), 40);
    char path[512];
    for (int k = 0; k < W * H; k++) {
        pt_real x = ((pt_real)(k % W) + (pt_real)0.5) / W, y = ((pt_real)(k / W) + (pt_real)0.5) / H;
        pt_ray ray = pt_camera_ray(&camera, (pt_real)W / H, x, y, pt_v2(0, 0));
        double work[2] = {0, 0};
        my_traverse(tree, scene, &ray, work);
        memset(image + 3 * k, pt_srgb_byte((work[0] + work[1]) / 100), 3);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    pt_write_ppm_bytes(path, image, W, H);
    snprintf(path, sizeof path, "%s.png", output);
    check(pt_write_png_bytes(path, image, W, H) == PT_OK, path);
}

int main(int argc, char **argv)
{
    static pt_bvh_node nodes[2 * MOST];
    static uint32_t order[MOST];
    double rays = fmin(RAYS, fmax(4096, (argc > 1 ? strtod(argv[1], NULL) : RAYS) / (getenv("SHORT") ? 16 : 1)));
    double mine[3], its[3];
    int areas = 1, same = 1;
    for (int k = 0; k < 3; k++) {
        pt_scene scene = {.tree = PT_TREE_BINARY};
        if (!make_scene(&scene, 8 << 2 * k)) return 1;
        uint32_t n = (uint32_t)rays, count = scene.triangle_count, few = (uint32_t)fmin(n, 16777216.0 / count);
        pt_bvh tree = {nodes, order, 1, count, 0};
        for (uint32_t i = 0; i < count; i++) order[i] = i;
        my_split(&tree, &scene, 0, 0, count);
        pt_bvh_node all = {nodes[0].lo, nodes[0].hi, 0, count};
        pt_bvh linear = {&all, order, 1, count, 0}; /* linear search: a tree of one leaf */
        printf("%5u triangles      rays    boxes/ray exact, tests  std.error  seconds\n", count);
        row("lines, mine", &tree, NULL, n, &areas);
        row("lines, its", &scene.bvh, NULL, n, &areas);
        row("pt_intersect", NULL, &scene, n, &same);
        its[k] = row("hits, its", &scene.bvh, &scene, n, &same);
        mine[k] = row("hits, mine", &tree, &scene, n, &same);
        row("hits, linear", &linear, &scene, few, &same);
        if (k == 2) picture(argc > 2 ? argv[2] : "19_bvh", &tree, &scene);
        pt_scene_free(&scene);
    }
    printf("What to see: 256 times the triangles: 256 times the tests of linear search, 2 to 3 times the boxes.\n");
    check(areas, "random lines enter boxes as often as the areas say, within 5 standard errors");
    check(same, "linear search, my tree, its tree and pt_intersect hit the same triangles");
    check(mine[2] < 3 * mine[0] && its[2] < mine[2], "at most three times the work; SAH wins");
    printf("lesson 19: %d passed, %d failed\n", passed, failed);
    if (MISTAKE) printf("exercise %d is a mistake: %s\n", EX, failed ? "the checks noticed it" : "NOBODY NOTICED");
    return MISTAKE ? failed == 0 : failed != 0;
}

/* EXERCISES
   (1) Predict: leaves of up to 16 triangles instead of 1 (-DEX=1). Fewer boxes or fewer tests? Answer: fewer boxes,
       17.5 instead of 23.8, more tests, 16.6 instead of 1.6, at 32770 triangles: a bad exchange where tests cost more.
   (2) Break: < instead of <= (-DEX=2): the flat boxes of the floor are never entered, and it is missed. Let the first
       hit end the search (-DEX=3): only the comparison of hits can tell.
   (3) Extend: of all splits of a node's sorted middles take the one with the smallest area(left) count(left) +
       area(right) count(right). Answer: 16 boxes and tests a ray at 32770 triangles instead of 25 (its tree: 15). Then
       let the nearer child come off the stack first: its tree takes 7. */
