/* Lesson 19: The bounding volume hierarchy (BVH): cost against triangle count

   QUESTION  A ray that asks each of a million triangles is slow. How few can it ask, and never miss one?
   IDEA      Put triangles in boxes, boxes in boxes. A ray that misses a box misses all that is in it. Of the
             lines that enter a convex box S, the fraction that enters a convex box s inside it is

                 P(s | S) = area(s) / area(S)                    (Cauchy, Crofton: all lines equally likely)

             so a line enters, on average, sum over nodes of area(node) / area(S) boxes of a tree. The surface
             area heuristic (SAH) keeps this sum and the tests in leaves small; they grow as log n, not as n.
             A line is between two planes for t0 <= t <= t1; it enters the box if the latest entry is <= the
             earliest exit. It must be <=: a wall parallel to an axis has a box without thickness, t0 = t1.
   EXACT     The sums of areas above, for one flat box and for whole trees, in a cube of edge 6.
   BUILD     cc -O2 -I.. 19_bvh.c -o 19_bvh -lm -pthread
   RUN       ./19_bvh [samples] [output]
   PRINTS    nearest hit    triangles    boxes/ray    tests/ray       rays   us/ray
             linear             32770      0.55382        18149        511 1025.757
             my tree            32770       16.841       2.2427      65536    2.722
             header's tree      32770       7.0078       1.3081      65536    1.295
   WORDS     bounding volume hierarchy 层次包围盒, acceleration structure 加速结构, visibility 可见性
   HEADER    [PT-06] pt_intersect_box, pt_intersect_triangle, [PT-07] pt_bvh, [PT-10] pt_intersect
   SOURCES   [Ize13] why the exit is rounded up, [Woo13] the triangle test, [PBR] 7.3 the heuristic
   Before: lesson 18. Next: lesson 20. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"
#include <stdlib.h>

#ifndef EX
#define EX 0
#endif
#define MISTAKE (EX >= 2)
#define LEAF (EX == 1 ? 16 : 2) /* most triangles in a leaf */

static int passed, failed;

static void check(int ok, const char *what)
{
    printf("%-6s %s\n", ok ? "ok" : "FAIL", what);
    if (ok) passed++;
    else failed++;
}

static void row(const char *name, const pt_stats *s, double exact, double seconds)
{
    printf("%-14s %9.0f %12.6g %12.6g %10.2g %8.3f\n", name, s->n, s->mean, exact, pt_stats_standard_error(s),
           seconds);
}

/* --- mine; nodes have the layout of the header's, so that one traversal walks both trees --- */

static double get(pt_vec3 v, int axis) { return (double)(axis == 0 ? v.x : axis == 1 ? v.y : v.z); }

static pt_vec3 least(pt_vec3 a, pt_vec3 b)
{
    return pt_v3(a.x < b.x ? a.x : b.x, a.y < b.y ? a.y : b.y, a.z < b.z ? a.z : b.z);
}

static pt_vec3 most(pt_vec3 a, pt_vec3 b) { return pt_v3_neg(least(pt_v3_neg(a), pt_v3_neg(b))); }

static pt_vec3 corner(const pt_scene *s, uint32_t i, uint32_t k)
{
    return s->positions[s->triangles[i].v[k]];
}

static pt_vec3 middle(const pt_scene *s, uint32_t i) /* three times the centre of a triangle */
{
    return pt_v3_add(pt_v3_add(corner(s, i, 0), corner(s, i, 1)), corner(s, i, 2));
}

/* Makes node k of order[first .. first + count): halves the box of the middles across its longest side. */
static void my_split(pt_bvh *tree, const pt_scene *s, uint32_t k, uint32_t first, uint32_t count)
{
    pt_bvh_node *node = &tree->nodes[k];
    uint32_t *order = tree->order + first, i, j = 0, c;
    pt_vec3 lo = middle(s, order[0]), hi = lo, size;
    int axis;
    node->lo = node->hi = corner(s, order[0], 0);
    for (i = 0; i < 3 * count; i++) {
        node->lo = least(node->lo, corner(s, order[i / 3], i % 3));
        node->hi = most(node->hi, corner(s, order[i / 3], i % 3));
        lo = least(lo, middle(s, order[i / 3]));
        hi = most(hi, middle(s, order[i / 3]));
    }
    node->first = first;
    node->count = count;
    if (count <= LEAF) return;
    size = pt_v3_sub(hi, lo);
    axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    for (i = 0; i < count; i++)
        if (get(middle(s, order[i]), axis) < 0.5 * (get(lo, axis) + get(hi, axis))) {
            c = order[j];
            order[j++] = order[i];
            order[i] = c;
        }
    if (j == 0 || j == count) j = count / 2; /* all middles on one side */
    node->count = 0;
    node->first = c = tree->node_count;
    tree->node_count += 2;
    my_split(tree, s, c, first, j);
    my_split(tree, s, c + 1, first + j, count - j);
}

/* Where the ray enters the box; infinity if it misses it, or enters after `best`. */
static double my_enter(const pt_ray *ray, const pt_bvh_node *box, double best)
{
    double in = 0, out = best, up = 1 + 2 * pt_gamma(3); /* more than the roundings of t0 and t1 [Ize13] */
    int k;
    for (k = 0; k < 3; k++) {
        double o = get(ray->o, k), d = get(ray->d, k);
        double t0 = (get(box->lo, k) - o) / d, t1 = (get(box->hi, k) - o) / d;
        in = fmax(in, fmin(t0, t1)); /* fmin and fmax drop the NaN of 0/0 */
        out = fmin(out, fmax(t0, t1) * (EX == 2 ? 1 : up));
    }
    if (EX == 2) return in < out ? in : HUGE_VAL; /* WRONG: flat boxes vanish */
    return in <= out ? in : HUGE_VAL;
}

/* What a ray has found and done so far. */
typedef struct my_state {
    double t, boxes, tests;
    int hit;
} my_state;

/* Of two triangles at the same distance the lower index wins, as in the header. */
static void my_test(const pt_scene *s, const pt_ray *ray, uint32_t i, my_state *r)
{
    double t, b[2];
    r->tests++;
    if (!pt_intersect_triangle(ray, corner(s, i, 0), corner(s, i, 1), corner(s, i, 2), &t, b)) return;
    if (t > r->t || (t == r->t && (int)i > r->hit)) return;
    r->t = t;
    r->hit = (int)i;
}

/* The nearest hit; without a scene it only counts the boxes that the line enters. */
static my_state my_traverse(const pt_bvh *tree, const pt_scene *s, const pt_ray *ray)
{
    uint32_t stack[256], top = 0, i, a, near;
    my_state r = {HUGE_VAL, 0, 0, -1};
    stack[top++] = 0;
    while (top > 0) {
        const pt_bvh_node *node = &tree->nodes[stack[--top]];
        if (my_enter(ray, node, r.t) == HUGE_VAL) continue; /* or it has found something nearer meanwhile */
        if (EX == 3 && r.hit >= 0) break;                   /* WRONG: the first hit need not be the nearest */
        r.boxes++;
        for (i = 0; s && i < node->count; i++) my_test(s, ray, tree->order[node->first + i], &r);
        if (node->count) continue;
        a = node->first;
        near = my_enter(ray, &tree->nodes[a], r.t) <= my_enter(ray, &tree->nodes[a + 1], r.t) ? a : a + 1;
        stack[top++] = a + (a + 1) - near;
        stack[top++] = near; /* the nearer child comes off the stack first */
    }
    return r;
}

/* --- how many boxes does a random line enter, and what does a ray cost? --- */

#define EDGE 3.0 /* all is in the cube [-3,3]^3 */

/* All lines through the cube alike: from a uniform point of its surface, cosine-weighted inwards. */
static pt_ray random_line(pt_pcg32 *rng)
{
    double u[5], o[3], d[3];
    pt_ray ray;
    pt_vec3 w;
    int k, a;
    for (k = 0; k < 5; k++) u[k] = pt_pcg32_double(rng);
    w = pt_warp_cosine(pt_v2((pt_real)u[0], (pt_real)u[1]));
    a = (int)(6 * u[2]); /* the face: axis a % 3, side a / 3 */
    for (k = 0; k < 3; k++) {
        int axis = (a + k) % 3;
        o[axis] = k ? EDGE * (2 * u[2 + k] - 1) : a < 3 ? -EDGE : EDGE;
        d[axis] = k ? get(w, k - 1) : a < 3 ? (double)w.z : -(double)w.z;
    }
    ray.o = pt_v3((pt_real)o[0], (pt_real)o[1], (pt_real)o[2]);
    ray.d = pt_v3((pt_real)d[0], (pt_real)d[1], (pt_real)d[2]);
    ray.tmax = (pt_real)HUGE_VAL;
    return ray;
}

static int estimate(const char *name, const pt_bvh *tree, int header, int n)
{
    pt_pcg32 rng = pt_pcg32_make(19, 0);
    pt_stats s = PT_STATS_INIT;
    double exact = 0, start = pt_cpu_seconds();
    const pt_bvh_node *node = tree->nodes;
    for (; node < tree->nodes + tree->node_count; node++) {
        pt_vec3 e = pt_v3_sub(node->hi, node->lo);
        exact += (double)(e.x * e.y + e.y * e.z + e.z * e.x) / (3 * 4 * EDGE * EDGE);
    }
    while (n-- > 0) {
        pt_ray ray = random_line(&rng);
        pt_stats_add(&s, header ? pt_intersect_box(&ray, tree->nodes->lo, tree->nodes->hi)
                                : my_traverse(tree, NULL, &ray).boxes);
    }
    row(name, &s, exact, pt_cpu_seconds() - start);
    return fabs(s.mean - exact) <= 5 * pt_stats_standard_error(&s);
}

/* n rays; tree = NULL: by the header, which does not count. */
static double shoot(const char *name, const pt_bvh *tree, const pt_scene *scene, int n, int *hits)
{
    pt_pcg32 rng = pt_pcg32_make(190, 0);
    double start = pt_cpu_seconds(), boxes = 0, tests = 0;
    int i;
    for (i = 0; i < n; i++) {
        pt_ray ray = random_line(&rng);
        pt_hit hit;
        if (tree) {
            my_state r = my_traverse(tree, scene, &ray);
            hits[i] = r.hit;
            boxes += r.boxes;
            tests += r.tests;
        } else hits[i] = pt_intersect(scene, &ray, &hit) ? hit.primitive : -1;
    }
    printf("%-14s %9u %12.5g %12.5g %10d ", name, scene->triangle_count, boxes / n, tests / n, n);
    printf("%8.3f\n", (pt_cpu_seconds() - start) * 1e6 / n);
    return boxes + tests;
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
    int white = pt_add_material(s, pt_material_diffuse(pt_rgb_grey(1))), k;
    for (k = 0; k < n * n; k++)
        pt_add_quad(s, torus(k / n, k % n, n), torus(k / n, k % n + 1, n), torus(k / n + 1, k % n + 1, n),
                    torus(k / n + 1, k % n, n), white);
    pt_add_quad(s, pt_v3(-3, -1, -3), pt_v3(-3, -1, 3), pt_v3(3, -1, 3), pt_v3(3, -1, -3), white);
    return pt_commit(s) == PT_OK;
}

/* How many boxes and triangles each pixel asked; white = 100. */
static int picture(const char *output, const pt_bvh *tree, const pt_scene *scene)
{
    enum { W = 320, H = 240 };
    static unsigned char image[3 * W * H];
    pt_camera camera = pt_camera_look_at(pt_v3(0, 6, 6), pt_v3(0, 0, 0), pt_v3(0, 1, 0), 40);
    char path[512];
    int k, ok;
    for (k = 0; k < W * H; k++) {
        pt_vec2 at = pt_v2((pt_real)((k % W + 0.5) / W), (pt_real)((k / W + 0.5) / H));
        pt_ray ray = pt_camera_ray(&camera, (pt_real)W / H, at.x, at.y, pt_v2(0, 0));
        my_state r = my_traverse(tree, scene, &ray);
        image[3 * k] = image[3 * k + 1] = image[3 * k + 2] = pt_srgb_byte((r.boxes + r.tests) / 100);
    }
    snprintf(path, sizeof path, "%s.ppm", output);
    ok = pt_write_ppm_bytes(path, image, W, H) == PT_OK;
    snprintf(path, sizeof path, "%s.png", output);
    return ok && pt_write_png_bytes(path, image, W, H) == PT_OK;
}

int main(int argc, char **argv)
{
    enum { SIZES = 3, MOST = 1 << 20 };
    static const int size[SIZES] = {8, 32, 128};
    static int hits[4][MOST];
    int n = argc > 1 && atoi(argv[1]) > 0 ? atoi(argv[1]) : 65536, k, i, agree = 1, same = 1, drawn = 0;
    const char *output = argc > 2 ? argv[2] : "19_bvh";
    double work[2][SIZES];
    n = (n < MOST ? n : MOST) / (getenv("SHORT") ? 16 : 1);
    for (k = 0; k < SIZES; k++) {
        pt_scene scene = PT_SCENE_INIT;
        pt_bvh_node wall = {{-1, 0, -1}, {1, 0, 1}, 0, 1}, all;
        pt_bvh mine = {0}, flat = {0}, linear = {0};
        int few, count;
        if (!make_scene(&scene, size[k])) return 1;
        count = (int)scene.triangle_count;
        mine.nodes = (pt_bvh_node *)malloc(2 * (size_t)count * sizeof *mine.nodes);
        linear.order = mine.order = (uint32_t *)malloc((size_t)count * sizeof *mine.order);
        if (!mine.nodes || !mine.order) return 1;
        for (i = 0; i < count; i++) mine.order[i] = (uint32_t)i;
        mine.node_count = flat.node_count = 1;
        my_split(&mine, &scene, 0, 0, scene.triangle_count);
        all = mine.nodes[0];
        all.first = 0;
        all.count = scene.triangle_count;
        linear.nodes = &all; /* linear search: a tree of one leaf */
        flat.nodes = &wall;
        if (k == 0) printf("%-14s %9s %12s %12s %10s %8s\n", "boxes entered", "samples", "estimate", "exact",
                           "std error", "seconds");
        for (i = n / 16; k == 0 && i <= n; i *= 16) {
            agree = estimate("my flat box", &flat, 0, i) && agree;
            agree = estimate("header flat", &flat, 1, i) && agree;
            agree = estimate("my tree", &mine, 0, i) && agree;
            agree = estimate("header's tree", &scene.bvh, 0, i) && agree;
        }
        if (k == 0) printf("%-14s %9s %12s %12s %10s %8s\n", "nearest hit", "triangles", "boxes/ray",
                           "tests/ray", "rays", "us/ray");
        few = (int)fmin(n, 16777216.0 / count);
        shoot("linear", &linear, &scene, few, hits[0]);
        work[0][k] = shoot("my tree", &mine, &scene, n, hits[1]);
        work[1][k] = shoot("header's tree", &scene.bvh, &scene, n, hits[2]);
        shoot("pt_intersect", NULL, &scene, n, hits[3]);
        for (i = 0; i < n; i++)
            same = same && hits[0][i < few ? i : 0] == hits[1][i < few ? i : 0] && hits[1][i] == hits[2][i] &&
                   hits[1][i] == hits[3][i];
        if (k == SIZES - 1) drawn = picture(output, &mine, &scene);
        pt_scene_free(&scene);
        free(mine.nodes);
        free(mine.order);
    }
    printf("See: 256 times the triangles, 256 times the linear search; not even twice the boxes.\n");
    check(agree, "random lines enter boxes as often as the areas say, within 5 standard errors");
    check(same, "linear search, my tree, the header's tree and pt_intersect hit the same triangles");
    check(work[0][2] < 2 * work[0][0] && work[1][2] < work[0][2], "not twice the work; SAH wins");
    check(drawn, "picture written");
    printf("lesson 19: %d passed, %d failed\n", passed, failed);
    if (!MISTAKE) return failed != 0;
    printf("the mistake of exercise %d was %s\n", EX, failed ? "noticed" : "NOT noticed");
    return !failed;
}

/* EXERCISES (cc -DEX=1 ... compiles the first one, and so on)
   1. Predict and run, -DEX=1: leaves of up to 16 triangles. (Fewer boxes, 14.7 instead of 16.8, more tests,
      9.3 instead of 2.2, at 32770 triangles: a bad exchange where a test costs more than a box.)
   2. Break it, and watch which check fails. -DEX=2: < instead of <=; the flat box is entered 0 times, and
      the floor is missed. -DEX=3: the first hit found ends the search; only the comparison of hits can
      tell.
   3. Extend it: of all splits of a node's sorted middles take the one with the smallest area(left)
      count(left) + area(right) count(right). Boxes and tests at 32770 triangles should come down from 19.1
      a ray towards the 8.3 of the header's tree. */
