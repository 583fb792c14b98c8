/* test_wide.c: the wide tree and the search of small scenes find what the binary tree and the linear search find, bit for
   bit, whatever the ray ([PT-07b]); lanes compute what their names say ([PT-01]); the bounds of their errors hold.
   tests/test_wide_plain.c and tests/test_wide_avx2.c are the same in other lanes. */

#define PT_STATIC /* it looks at private functions, and its memory fails when it is told to */
#define PT_ONLY_PATH
#define PT_NO_REPORT
#define PT_NO_FILES
#define PT_NO_SCENES
#define PT_NO_MICROFACET
#define PT_NO_TEXTURES
#include <stdlib.h>

static struct {
    long calls, fail_at, live;
} heap;

static void *get_memory(void *old, size_t size)
{
    void *p;
    if (++heap.calls == heap.fail_at) return NULL;
    p = realloc(old, size);
    heap.live += p && !old;
    return p;
}
static void put_memory(void *p)
{
    heap.live--;
    free(p);
}
#define PT_MALLOC(size, user) ((void)(user), get_memory(NULL, size))
#define PT_REALLOC(pointer, size, user) ((void)(user), get_memory(pointer, size))
#define PT_FREE(pointer, user) ((void)(user), put_memory(pointer))

#ifndef WIDE_PROGRAM
#define WIDE_PROGRAM "test_wide"
#define WIDE_MAIN 1
#endif
#include "pt_test.h"

#if PTI_HAS_WIDE
#include "pt_floats.h"

static double between(pt_pcg32 *rng, double low, double high) { return low + (high - low) * pt_pcg32_double(rng); }

static pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }

static pt_vec3 in_cube(pt_pcg32 *rng, double half)
{
    const double x = between(rng, -half, half), y = between(rng, -half, half);
    return v3(x, y, between(rng, -half, half));
}

/* ---- lanes ------------------------------------------------------------------------------------------------ */

static void lanes(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(1), 1);
    int wrong[16] = {0}, i, k;
    for (i = 0; i < 20000; i++) {
        pti_lanes x, y, z, r[13];
        unsigned less, at_most;
        for (k = 0; k < 8; k++) {
            x.v[k] = hostile_float(&rng);
            y.v[k] = pt_pcg32_next(&rng) % 4 ? hostile_float(&rng) : x.v[k];
            z.v[k] = hostile_float(&rng);
        }
        r[0].f = pti_f8_add(x.f, y.f);
        r[1].f = pti_f8_sub(x.f, y.f);
        r[2].f = pti_f8_mul(x.f, y.f);
        r[3].f = pti_f8_div(x.f, y.f);
        r[4].f = pti_f8_min(x.f, y.f);
        r[5].f = pti_f8_max(x.f, y.f);
        r[6].f = pti_f8_sqrt(x.f);
        r[7].f = pti_f8_abs(x.f);
        r[8].f = pti_f8_select(pti_f8_lt(x.f, y.f), x.f, z.f);
        r[9].f = pti_f8_swap(x.f);
        r[10].f = pti_f8_load(x.v);
        pti_f8_store(r[11].v, x.f);
        r[12].f = pti_f8_set(x.v[i % 8]);
        less = pti_m8_bits(pti_f8_lt(x.f, y.f));
        at_most = pti_m8_bits(pti_f8_le(x.f, y.f));
        for (k = 0; k < 8; k++) {
            const float a = x.v[k], b = y.v[k];
            wrong[0] += !same_float(r[0].v[k], a + b);
            wrong[1] += !same_float(r[1].v[k], a - b);
            wrong[2] += !same_float(r[2].v[k], a * b);
            wrong[3] += !same_float(r[3].v[k], a / b);
            wrong[4] += memcmp(&r[4].v[k], a < b ? &x.v[k] : &y.v[k], sizeof a) != 0;
            wrong[5] += memcmp(&r[5].v[k], a > b ? &x.v[k] : &y.v[k], sizeof a) != 0;
            wrong[6] += !same_float(r[6].v[k], sqrtf(a));
            wrong[7] += !same_float(r[7].v[k], fabsf(a));
            wrong[8] += memcmp(&r[8].v[k], a < b ? &x.v[k] : &z.v[k], sizeof a) != 0;
            wrong[9] += memcmp(&r[9].v[k], &x.v[(k + 4) % 8], sizeof a) != 0;
            wrong[10] += memcmp(&r[10].v[k], &x.v[k], sizeof a) != 0;
            wrong[11] += memcmp(&r[11].v[k], &x.v[k], sizeof a) != 0;
            wrong[12] += memcmp(&r[12].v[k], &x.v[i % 8], sizeof a) != 0;
            wrong[13] += (less >> k & 1) != (a < b) || less >> 8;
            wrong[14] += (at_most >> k & 1) != (a <= b) || at_most >> 8;
        }
        if (at_most) wrong[15] += pti_lowest_bit(at_most) < 0 || !(at_most >> pti_lowest_bit(at_most) & 1) || (at_most & ((1u << pti_lowest_bit(at_most)) - 1));
    }
    for (k = 0; k < 16; k++) pt_check(wrong[k] == 0, label("lanes, operation %d", k), "%d lanes differ from C", wrong[k]);
}

static void lanes_together(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(2), 2);
    int wrong = 0, i, k;
    for (i = 0; i < 4000; i++) {
        pti_lanes x, y, z, fused, negative, tagged;
        uint32_t tag[8];
        float least = HUGE_VALF;
        for (k = 0; k < 8; k++) {
            x.v[k] = (float)between(&rng, 0, 8);
            y.v[k] = (float)between(&rng, -8, 8);
            z.v[k] = (float)between(&rng, -8, 8);
            least = x.v[k] < least ? x.v[k] : least;
            tag[k] = (uint32_t)(i + k) % 64;
        }
        fused.f = pti_f8_madd(x.f, y.f, z.f);
        negative.f = pti_f8_nmadd(x.f, y.f, z.f);
        wrong += pti_f8_least(x.f) != least;
        {
            pti_lanes aligned;
            memcpy(aligned.bits, tag, sizeof tag);
            tagged.f = pti_f8_tag(x.f, aligned.f);
        }
        for (k = 0; k < 8; k++) {
            const double bound = 2e-7 * (fabs((double)x.v[k] * (double)y.v[k]) + fabs((double)z.v[k]));
            wrong += fabs((double)fused.v[k] - ((double)x.v[k] * (double)y.v[k] + (double)z.v[k])) > bound;
            wrong += fabs((double)negative.v[k] - ((double)z.v[k] - (double)x.v[k] * (double)y.v[k])) > bound;
            wrong += tagged.bits[k] != ((x.bits[k] & ~127u) | tag[k]);
        }
    }
    pt_check(wrong == 0, "lanes together", "%d are wrong: madd, nmadd, least or tag", wrong);
}

/* ---- scenes ------------------------------------------------------------------------------------------------ */

enum { TRIANGLES, QUADS, PARALLELOGRAMS, SPHERES, HOLLOW, MIXED, BALL, SOUP, SLIVERS, FLAT, IDENTICAL, LAYERS, GIANT, CHAIN, ROOM, FURNISHED, KINDS };
static const char *const NAMES[KINDS] = {"triangles", "quads",   "parallelograms", "spheres",   "spheres around",
                                         "all shapes", "a ball", "a soup",         "slivers",   "coplanar",
                                         "identical", "layers",  "a giant among dwarfs", "a chain of 2^-i", "a room",
                                         "a room with a ball"};

static void add_ball(pt_scene *s, int rings, pt_vec3 c, double r, int m)
{
    const uint32_t n = (uint32_t)rings, points = n * n;
    pt_vec3 *v = (pt_vec3 *)malloc(points * sizeof *v);
    uint32_t *index = (uint32_t *)malloc(6 * points * sizeof *index), i, j, k = 0;
    for (i = 0; v && index && i < n; i++)
        for (j = 0; j < n; j++) {
            const double a = PT_PI * i / (n - 1), b = 2 * PT_PI * j / n, bump = r * (1 + 0.05 * sin(5 * a) * cos(7 * b));
            const uint32_t down = (i + 1 < n ? i + 1 : i) * n, right = (j + 1) % n;
            v[i * n + j] = pt_v3_add(c, v3(bump * sin(a) * cos(b), bump * cos(a), bump * sin(a) * sin(b)));
            index[k++] = i * n + j;
            index[k++] = down + j;
            index[k++] = down + right;
            index[k++] = i * n + j;
            index[k++] = down + right;
            index[k++] = i * n + right;
        }
    if (v && index) pt_add_mesh(s, v, NULL, NULL, points, index, 2 * points, m);
    free(v);
    free(index);
}

/* The k-th of `count` things at `scale` around `at`. */
static void add_thing(pt_scene *s, int kind, int k, pt_vec3 at, double scale, pt_pcg32 *rng, int m)
{
    const pt_vec3 a = pt_v3_add(at, in_cube(rng, scale)), b = in_cube(rng, 0.4 * scale), c = in_cube(rng, 0.4 * scale);
    const pt_vec3 e = pt_v3_add(a, b), f = pt_v3_add(a, c);
    const double size = between(rng, 0.01, 0.4) * scale, around = pow(10, k % 6) * scale, step = ldexp(scale, -(k % 100)), layer = ldexp(k * 7 % 9 * scale, -23);
    switch (kind == MIXED ? k % 4 : kind) {
    case TRIANGLES:
    case SOUP: pt_add_triangle(s, a, e, f, m); break;
    case QUADS: pt_add_quad(s, a, e, pt_v3_add(e, c), f, m); break;
    case PARALLELOGRAMS: pt_add_parallelogram(s, a, b, c, m); break;
    case SPHERES: pt_add_sphere(s, a, (pt_real)size, m); break;
    case HOLLOW: /* walls seen from inside, in groups so near each other that rounding in float decides which is nearer */
        pt_add_sphere(s, pt_v3_add(at, pt_v3_scale(pt_v3_normalize(v3(k / 6 % 3 - 1, k / 18 % 3 - 1, k / 6 % 2 - 0.5)), (pt_real)(2 * around - scale - layer))),
                      (pt_real)(2 * around), m);
        break;
    case SLIVERS: pt_add_triangle(s, a, e, pt_v3_add(pt_v3_add(a, pt_v3_scale(b, (pt_real)0.5)), pt_v3_scale(c, (pt_real)pow(10, -(k % 12)))), m); break;
    case FLAT: pt_add_triangle(s, pt_v3(a.x, a.y, at.z), pt_v3(e.x, e.y, at.z), pt_v3(f.x, f.y, at.z), m); break;
    case IDENTICAL:
        pt_add_triangle(s, pt_v3_add(at, v3(-scale, -scale, 0)), pt_v3_add(at, v3(scale, -scale, 0.1 * scale)), pt_v3_add(at, v3(0, scale, 0.3 * scale)), m);
        break;
    case LAYERS: /* so near each other that rounding in float may decide which is nearer */
        pt_add_triangle(s, pt_v3_add(at, v3(-scale, -scale, layer)), pt_v3_add(at, v3(scale, -scale, layer + 0.1 * scale)), pt_v3_add(at, v3(0, scale, layer + 0.3 * scale)), m);
        break;
    case GIANT:
        if (k % 100 == 7) pt_add_triangle(s, pt_v3_add(at, v3(-1e5 * scale, -1e5 * scale, 0)), pt_v3_add(at, v3(1e5 * scale, 0, 0.1 * scale)), pt_v3_add(at, v3(0, 1e5 * scale, 0)), m);
        else pt_add_triangle(s, a, pt_v3_add(a, pt_v3_scale(b, (pt_real)0.1)), pt_v3_add(a, pt_v3_scale(c, (pt_real)0.1)), m);
        break;
    default: pt_add_triangle(s, pt_v3_add(at, v3(step, 0, 0)), pt_v3_add(at, v3(step, step, 0)), pt_v3_add(at, v3(step, 0, step)), m); break;
    }
}

/* A box of quads with a box and a ball in it, as small scenes are; its sides share edges and corners. */
static void add_room(pt_scene *s, int count, pt_vec3 at, double scale, int m)
{
    static const int side[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
    int box, i, k;
    for (box = 0; 12 * box < count; box++) {
        const double size = scale * pow(0.7, box), turn = 0.3 * box;
        pt_vec3 v[8];
        for (i = 0; i < 8; i++) {
            const double x = i & 1 ? size : -size, y = i & 2 ? size : -size, z = i & 4 ? size : -size;
            v[i] = pt_v3_add(at, v3(x * cos(turn) - z * sin(turn), y, x * sin(turn) + z * cos(turn)));
        }
        for (k = 0; k < 6; k++) pt_add_quad(s, v[side[k][0]], v[side[k][1]], v[side[k][2]], v[side[k][3]], m);
    }
    if (count % 2) pt_add_sphere(s, at, (pt_real)(0.3 * scale), m);
}

/* Walls of all kinds: pairs of triangles, parallelograms, and a triangle across; in it other things. */
static void add_furnished(pt_scene *s, int count, pt_vec3 at, double scale, int m)
{
    const pt_vec3 x = v3(scale, 0, 0.2 * scale), y = v3(0, scale, 0), z = v3(-0.2 * scale, 0, scale);
    const pt_vec3 low = pt_v3_sub(pt_v3_sub(at, x), pt_v3_add(y, z)), high = pt_v3_add(pt_v3_add(at, x), pt_v3_add(y, z));
    const pt_vec3 across[3] = {pt_v3_add(low, x), pt_v3_add(low, pt_v3_scale(z, (pt_real)1.5)), pt_v3_add(low, y)};
    const pt_vec3 axes[3] = {pt_v3_scale(x, 2), pt_v3_scale(y, 2), pt_v3_scale(z, 2)};
    const uint32_t index[3] = {0, 1, 2};
    int k;
    for (k = 0; k < 3; k++) {
        const pt_vec3 a = axes[k], b = axes[(k + 1) % 3];
        pt_add_quad(s, low, pt_v3_add(low, a), pt_v3_add(pt_v3_add(low, a), b), pt_v3_add(low, b), m);
        pt_add_parallelogram(s, high, pt_v3_neg(a), pt_v3_neg(b), m);
    }
    pt_add_mesh(s, across, NULL, NULL, 3, index, 1, m);
    pt_add_sphere(s, low, (pt_real)(0.4 * scale), m);
    if (count > 20) add_ball(s, (int)ceil(sqrt((count - 14) / 2.0)), at, 0.3 * scale, m);
}

static void fill(pt_scene *s, int kind, int count, pt_vec3 at, double scale)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(100 + (uint64_t)kind), (uint64_t)count);
    const int m = pt_add_material(s, pt_material_diffuse(pt_rgb_grey(1)));
    int k;
    if (kind == BALL) add_ball(s, (int)ceil(sqrt(count / 2.0)), at, scale, m);
    else if (kind == ROOM) add_room(s, count, at, scale, m);
    else if (kind == FURNISHED) add_furnished(s, count, at, scale, m);
    else
        for (k = 0; k < count; k++) add_thing(s, kind, k, at, scale, &rng, m);
}

static int make(pt_scene *s, int kind, int count, pt_vec3 at, double scale, pt_tree tree)
{
    pt_result r;
    memset(s, 0, sizeof *s);
    s->tree = tree;
    fill(s, kind, count, at, scale);
    r = pt_commit(s);
    pt_check(r == PT_OK, NAMES[kind], "%s", pt_scene_error(s));
    return r == PT_OK;
}

/* ---- rays -------------------------------------------------------------------------------------------------- */

/* Something to aim at, or to start from: a corner, a point on an edge, one inside, the top of a sphere. */
static pt_vec3 landmark(const pt_scene *s, pt_pcg32 *rng)
{
    const pt_primitive *p = &s->primitives[pt_pcg32_next(rng) % s->primitive_count];
    const pt_real t = (pt_real)pt_pcg32_double(rng);
    pt_vec3 v[4];
    int n, i;
    if (p->shape == PT_SHAPE_SPHERE) {
        const pt_sphere *b = &s->spheres[p->index];
        return pt_v3_add(b->centre, pt_v3_scale(pt_v3_normalize(in_cube(rng, 1)), b->radius));
    }
    n = pti_corners(s, p, v);
    i = (int)(pt_pcg32_next(rng) % (unsigned)n);
    switch (pt_pcg32_next(rng) % 4) {
    case 0: return v[i];
    case 1: return pt_v3_add(v[i], pt_v3_scale(pt_v3_sub(v[(i + 1) % n], v[i]), t));
    case 2: return pt_v3_scale(pt_v3_add(v[0], v[2]), (pt_real)0.5);
    default: return pt_v3_add(v[0], pt_v3_scale(pt_v3_add(pt_v3_sub(v[1], v[0]), pt_v3_sub(v[n - 1], v[0])), (pt_real)(0.5 * (double)t)));
    }
}

static pt_ray draw_ray(const pt_scene *s, pt_pcg32 *rng, pt_vec3 at, double scale)
{
    static const double away[8] = {2, 2, 2, 0.5, 30, 1e4, 1e9, 1e22};
    const unsigned how = pt_pcg32_next(rng);
    const pt_vec3 to = how & 1 ? landmark(s, rng) : pt_v3_add(at, in_cube(rng, scale));
    pt_ray ray;
    ray.o = how & 6 ? pt_v3_add(at, in_cube(rng, away[how >> 3 & 7] * scale)) : landmark(s, rng);
    ray.d = pt_v3_sub(to, ray.o);
    if ((how >> 6) % 4 == 0) { /* along an axis or in a plane of two */
        const double x = (how >> 8) % 3 - 1.0, y = (how >> 10) % 3 - 1.0, z = (how >> 12) % 3 - 1.0;
        ray.d = v3((how >> 14) & 1 ? x : 0.0 * x, y, z);
        if (how >> 15 & 1) ray.o = pt_v3_sub(to, pt_v3_scale(ray.d, (pt_real)scale));
    }
    if ((how >> 16) % 8 == 0) ray.d = pt_v3_scale(ray.d, (pt_real)1e-25);
    if ((how >> 16) % 8 == 1) ray.d = pt_v3_scale(ray.d, (pt_real)1e15);
    if ((how >> 19) % 16 == 0) ray.d.x *= (pt_real)1e-22;
    ray.tmax = (how >> 23) % 8 == 0 ? (pt_real)1 : (how >> 23) % 8 == 1 ? (pt_real)0.7 : (pt_real)3.402823466e38;
    return ray;
}

/* What the three ways to search tell of a ray. */
typedef struct tally {
    int rays, hits, other, blind;
} tally;

static void compare(const pt_scene *const s[3], const pti_ray *r, tally *sum)
{
    pt_hit hit[3];
    int found[3], any[3], i;
    memset(hit, 0, sizeof hit);
    for (i = 0; i < 3; i++) {
        found[i] = pti_intersect(s[i], r, &hit[i]);
        any[i] = pti_occluded(s[i], r);
    }
    sum->rays++;
    sum->hits += found[2];
    for (i = 0; i < 2; i++) {
        sum->other += found[i] != found[2] || memcmp(&hit[i], &hit[2], sizeof hit[i]) != 0;
        sum->blind += any[i] != found[2];
    }
}

/* A ray, one that ends just before, at and after what it hits, and one that leaves that with all its digits. */
static void compare_around(const pt_scene *const s[3], const pt_ray *ray, pt_pcg32 *rng, tally *sum)
{
    pti_ray r = pti_ray_make(ray);
    pt_ray to = *ray;
    pt_hit hit;
    compare(s, &r, sum);
    if (!pti_intersect(s[2], &r, &hit)) return;
    to.tmax = hit.t;
    r = pti_ray_make(&to);
    compare(s, &r, sum);
    to.tmax = nextafterf(hit.t, pt_pcg32_next(rng) & 1 ? HUGE_VALF : 0);
    r = pti_ray_make(&to);
    compare(s, &r, sum);
    to.d = pt_v3_normalize(in_cube(rng, 1));
    r = pti_ray_from(pti_leave(&hit, to.d), pti_d_from(to.d), HUGE_VAL);
    compare(s, &r, sum);
    r = pti_shadow_ray(&hit, pt_v3_normalize(pt_v3_sub(ray->o, hit.p)), landmark(s[2], rng), v3(0, 0, 0), v3(0, 0, 0));
    compare(s, &r, sum);
}

/* Other scenes get the binary tree. */
static int lanes_serve(const pt_scene *s)
{
    const double x = fmax(fabs((double)s->lo.x), fabs((double)s->hi.x)), y = fmax(fabs((double)s->lo.y), fabs((double)s->hi.y));
    const double size = fmax(fmax(x, y), fmax(fabs((double)s->lo.z), fabs((double)s->hi.z)));
    return size > ldexp(1, -24) && size < ldexp(1, 39);
}

static void search_three_ways(int kind, int count, pt_vec3 at, double scale, int rays, uint64_t seed)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(seed), 3);
    pt_scene wide, binary, none;
    const pt_scene *const s[3] = {&wide, &binary, &none};
    tally sum = {0, 0, 0, 0};
    int ok = make(&wide, kind, count, at, scale, PT_TREE_DEFAULT);
    ok = make(&binary, kind, count, at, scale, PT_TREE_BINARY) && ok;
    ok = make(&none, kind, count, at, scale, PT_TREE_NONE) && ok;
    if (ok && none.primitive_count > PTI_LINEAR_MAX) {
        const char *name = label("%s, %u primitives", NAMES[kind], none.primitive_count);
        while (sum.rays < rays) {
            const pt_ray ray = draw_ray(&none, &rng, at, scale);
            compare_around(s, &ray, &rng, &sum);
        }
        pt_check(wide.wide.bytes > 0 || !lanes_serve(&wide), name, "has no lanes: the check is empty");
        pt_check(sum.hits > sum.rays / 100 || pt_test.is_short, name, "size %g: only %d of %d rays hit: the check is empty", scale, sum.hits, sum.rays);
        pt_check(sum.other == 0, name, "size %g: %d of %d rays find another hit than the linear search", scale, sum.other, sum.rays);
        pt_check(sum.blind == 0, name, "size %g: pt_occluded differs from the linear search for %d of %d rays", scale, sum.blind, sum.rays);
        pt_check(memcmp(&wide.lo, &none.lo, sizeof none.lo) == 0 && memcmp(&wide.hi, &none.hi, sizeof none.hi) == 0, name, "other bounds");
    }
    pt_scene_free(&wide);
    pt_scene_free(&binary);
    pt_scene_free(&none);
}

static void small_scenes(void)
{
    static const int sizes[9] = {5, 7, 8, 9, 16, 21, 33, 48, 64};
    int kind, i;
    for (kind = 0; kind < KINDS; kind++)
        for (i = 0; i < 9; i++) search_three_ways(kind, sizes[i], v3(0, 0, 0), 1, (int)pt_test_samples(1000), 200 + (uint64_t)i);
}

static void trees(void)
{
    int kind;
    for (kind = 0; kind < KINDS; kind++) {
        search_three_ways(kind, 100, v3(0, 0, 0), 1, (int)pt_test_samples(2000), 300);
        search_three_ways(kind, 1500, v3(0, 0, 0), 1, (int)pt_test_samples(600), 301);
    }
}

/* From the smallest numbers to the largest coordinates, at the ends of what lanes serve, and far from the origin. */
static void scales(void)
{
    static const double size[8] = {1e-30, 5e-8, 2e-7, 1e-4, 1e4, 1e6, 2e11, 5e12};
    int i, kind;
    for (kind = 0; kind < KINDS; kind += kind < MIXED ? 1 : 3)
        for (i = 0; i < 8; i++) {
            search_three_ways(kind, 40, v3(0, 0, 0), size[i], (int)pt_test_samples(500), 400 + (uint64_t)i);
            search_three_ways(kind, 150, v3(0, 0, 0), size[i], (int)pt_test_samples(500), 410 + (uint64_t)i);
        }
    for (i = 0; i < 4; i++) {
        const double away = pow(10, 1 + 1.5 * i);
        for (kind = 0; kind < KINDS; kind += kind < MIXED ? 1 : 2) {
            if (kind == CHAIN || (kind == SLIVERS && i > 2)) continue;
            search_three_ways(kind, 40, v3(away, -0.3 * away, 0.01 * away), 1, (int)pt_test_samples(500), 420 + (uint64_t)i);
            search_three_ways(kind, 150, v3(away, -0.3 * away, 0.01 * away), 1, (int)pt_test_samples(500), 430 + (uint64_t)i);
        }
    }
}

static void no_rays(void)
{
    const float nan = HUGE_VALF - HUGE_VALF, odd[4] = {nan, HUGE_VALF, -HUGE_VALF, 0};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(3), 4);
    int count, i, hits = 0, far = 0, other = 0;
    for (count = 40; count <= 400; count += 360) {
        pt_scene s, none;
        pt_hit hit;
        if (!make(&s, MIXED, count, v3(0, 0, 0), 1, PT_TREE_DEFAULT) || !make(&none, MIXED, count, v3(0, 0, 0), 1, PT_TREE_NONE)) return;
        for (i = 0; i < 4096; i++) {
            const pt_vec3 to = landmark(&s, &rng);
            pt_ray ray = {{to.x, to.y, -5}, {0, 0, 1}, 1e30f};
            float *const part[7] = {&ray.o.x, &ray.o.y, &ray.o.z, &ray.d.x, &ray.d.y, &ray.d.z, &ray.tmax};
            if (i % 4 == 3) ray.d = v3(0, 0, 0);
            else if (i / 4 % 7 < 6) *part[i / 4 % 7] = odd[i % 4];
            else ray.tmax = i % 4 ? i % 4 == 1 ? -1.0f : 0 : nan; /* nothing is nearer */
            hits += pt_intersect(&s, &ray, &hit) + pt_occluded(&s, &ray);
        }
        for (i = 0; i < 400; i++) {
            const pt_vec3 c = landmark(&s, &rng);
            const pt_ray ray = {{c.x, c.y, -ldexpf(1, 20 + i % 100)}, {0, 0, 1e-3f * (float)(i + 1)}, 3.4e38f};
            const int want = pt_intersect(&none, &ray, &hit);
            far += want;
            other += pt_intersect(&s, &ray, &hit) != want || pt_occluded(&s, &ray) != want;
        }
        pt_scene_free(&s);
        pt_scene_free(&none);
    }
    pt_check(hits == 0, "rays of no numbers", "%d hit", hits);
    pt_check(far > 200 && other == 0, "rays from 2^20 to 2^119", "%d hit; %d differ from the linear search", far, other);
}

/* Rounded corners fold a parallelogram. Where a ray meets both halves, on the diagonal, the first one decides, whatever was
   hit before. */
static void folds(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(6), 6);
    int i, both = 0, wrong = 0;
    for (i = 0; i < 40000; i++) {
        const pt_parallelogram p = {in_cube(&rng, 1e6), in_cube(&rng, 4e5), in_cube(&rng, 4e5), 0};
        const pt_vec3 d = v3(i % 3 - 1, i / 3 % 3 - 1, 1);
        double t1, t2, t, u, v;
        pt_vec3 c[4];
        pt_ray ray;
        pti_ray r;
        pti_parallelogram_corners(&p, c);
        ray.o = pt_v3_sub(pt_v3_scale(pt_v3_add(c[0], c[2]), (pt_real)0.5), pt_v3_scale(d, (pt_real)1e6));
        ray.d = d;
        ray.tmax = (pt_real)1e30;
        r = pti_ray_make(&ray);
        if (!pti_triangle(&r, &c[0], &c[1], &c[2], 1e30, &t1, &u, &v) || !pti_triangle(&r, &c[0], &c[2], &c[3], 1e30, &t2, &u, &v)) continue;
        both++;
        wrong += !pti_parallelogram(&r, c, 1e30, &t, &u, &v) || fabs(t - t1) > 0;
        wrong += pti_parallelogram(&r, c, t1, &t, &u, &v);
    }
    pt_check(both > 20, "folded parallelograms", "only %d are met twice: the check is empty", both);
    pt_check(wrong == 0, "folded parallelograms", "%d of %d are hit where the second half is", wrong, both);
}

/* ---- how good the bounds are ------------------------------------------------------------------------------- */

/* The largest error over its bound: above 1 it is no bound; far below, lanes ask for tests in vain. */
typedef struct worst {
    double edge, depth, start, plane;
    int edges, depths, planes, sure, wrong;
} worst;

static double ratio(double error, double bound, double so_far)
{
    const double r = fabs(error) / bound;
    return r > so_far ? r : so_far;
}

/* A block of eight triangles against a ray in double. */
static void bounds_of_block(const pt_scene *s, const pti_triangle8 *p, const pti_ray *r, const pti_ray8 *w, worst *sum)
{
    const double end = r->end < 3e38 ? r->end : 3e38;
    const float limit = pti_ray8_limit(w, end);
    pti_edges8 e;
    pti_lanes u, v, x, error, t, det, off;
    pti_depths8 at;
    unsigned sure = 0, may;
    pti_f8 bound, all;
    int i;
    pti_edge_lanes(p, r, w, &e);
    u.f = e.u;
    v.f = e.v;
    x.f = e.w;
    error.f = e.error;
    t.f = pti_depth_lanes(&e, r, w, &all, &bound);
    off.f = bound;
    det.f = all;
    may = pti_triangle_lanes(p, r, w, limit, &sure, &at);
    for (i = 0; i < 8; i++) {
        const pti_d3 a = pti_shear_lane(r, &p->v[0][i]), b = pti_shear_lane(r, &p->v[3][i]), c = pti_shear_lane(r, &p->v[6][i]);
        const double du = pti_edge(c.x, b.y, c.y, b.x), dv = pti_edge(a.x, c.y, a.y, c.x), dw = pti_edge(b.x, a.y, b.y, a.x);
        double depth, b1, b2;
        if (!(a.x - a.x == 0)) continue; /* an empty lane */
        sum->edge = ratio((double)u.v[i] - du, (double)error.v[i], sum->edge);
        sum->edge = ratio((double)v.v[i] - dv, (double)error.v[i], sum->edge);
        sum->edge = ratio((double)x.v[i] - dw, (double)error.v[i], sum->edge);
        sum->edges++;
        if (pti_sheared_triangle(r, a, b, c, end, &depth, &b1, &b2)) {
            sum->depth = ratio((double)t.v[i] - depth * fabs(r->d[r->kz]) * (double)det.v[i], (double)off.v[i], sum->depth);
            sum->depths++;
            sum->wrong += !(may >> i & 1);
            if (sure >> i & 1) {
                pti_later later = {NULL, 0, 0};
                float known = limit;
                pti_put_off(s, p, i, &at, r, w, &known, &later, NULL);
                sum->wrong += later.leaf != p || later.lane != i || !((double)later.from < depth * w->unit && depth * w->unit < (double)known);
            }
        } else {
            sum->wrong += (int)(sure >> i & 1);
        }
        sum->sure += (int)(sure >> i & 1);
    }
}

static void bounds_of_triangles(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(4), 5);
    worst sum = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    int kind, i;
    for (kind = 0; kind < KINDS; kind++) {
        pt_scene s;
        if (kind == SPHERES || kind == CHAIN || !make(&s, kind, 160, v3(3, -2, 1), 1, PT_TREE_DEFAULT)) continue;
        for (i = 0; i < (int)pt_test_samples(8000); i++) {
            const pt_ray ray = draw_ray(&s, &rng, v3(3, -2, 1), 1);
            const pti_ray r = pti_ray_make(&ray);
            uint32_t at = s.wide.root;
            pti_ray8 w;
            if (!pti_ray8_make(&w, &r, s.wide.extent)) continue;
            pti_ray8_for_tree(&w, &r);
            while ((at & 7) == PTI_NODE) {
                const pti_node8 *n = (const pti_node8 *)(const void *)pti_place(&s.wide, at);
                do at = n->child[pt_pcg32_next(&rng) % 8];
                while (at == 0);
            }
            if ((at & 7) == PTI_TRIANGLES) bounds_of_block(&s, (const pti_triangle8 *)(const void *)pti_place(&s.wide, at), &r, &w, &sum);
        }
        pt_scene_free(&s);
    }
    printf("bounds of triangles: largest error / bound %.3f of %d edges, %.3f of %d depths; %d hits known in float\n", sum.edge,
           3 * sum.edges, sum.depth, sum.depths, sum.sure);
    pt_check((sum.edges > 10000 && sum.depths > 500 && sum.sure > 200) || pt_test.is_short, "bounds of triangles", "the check is empty");
    pt_check(sum.edge <= 1, "error of edge functions", "%.3f times its bound", sum.edge);
    pt_check(sum.depth <= 1, "error of depths", "%.3f times its bound", sum.depth);
    pt_check((sum.edge > 0.02 && sum.depth > 0.02) || pt_test.is_short, "bounds of triangles", "far too wide");
    pt_check(sum.wrong == 0, "what lanes tell of triangles", "%d lanes deny a hit, or claim one that is none", sum.wrong);
}

/* Planes: the weights of a hit, where it begins, and what is claimed for certain. */
static void bounds_of_planes(void)
{
    static const int kinds[6] = {TRIANGLES, QUADS, PARALLELOGRAMS, SLIVERS, ROOM, GIANT};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(5), 6);
    worst sum = {0, 0, 0, 0, 0, 0, 0, 0, 0};
    unsigned lane;
    int k, i;
    for (k = 0; k < 6; k++) {
        pt_scene s;
        const pti_small *small;
        if (!make(&s, kinds[k], 32, v3(-2, 1, 3), 1, PT_TREE_DEFAULT)) continue;
        small = (const pti_small *)(const void *)s.wide.arena;
        for (i = 0; i < (int)pt_test_samples(8000); i++) {
            const pt_ray ray = draw_ray(&s, &rng, v3(-2, 1, 3), 1);
            const pti_ray r = pti_ray_make(&ray);
            const unsigned block = pt_pcg32_next(&rng) % (unsigned)s.wide.plane_blocks;
            pti_lanes start, more, error, margin;
            pti_planes8 h;
            pti_f8 sure;
            unsigned may;
            pti_ray8 w;
            double end;
            if (!pti_ray8_make(&w, &r, s.wide.extent)) continue;
            end = r.end < 3e38 ? r.end : 3e38;
            pti_plane_lanes(&small->planes[block], &w, &h);
            start.f = pti_plane_starts(&h);
            may = pti_planes_within(&h, pti_ray8_limit(&w, end), 2 * w.span / w.reach, &sure);
            more.f = h.more;
            error.f = h.error;
            margin.f = sure;
            for (lane = 0; lane < 8; lane++) {
                const pti_tested *a = &small->tested[8 * block + lane], *b = &small->tested[PTI_SMALL + 8 * block + lane];
                pti_best best = {end, 0, 0, -1};
                const int hit = pti_test_both(&s, &r, a, &best);
                sum.sure += margin.v[lane] > 0;
                sum.wrong += (!hit && margin.v[lane] > 0) || (hit && small->planes[block].steep[lane] > 0 && !(may >> lane & 1));
                if (!hit || error.v[lane] - error.v[lane] != 0 || small->planes[block].steep[lane] <= 0) continue; /* no bound, or empty */
                sum.planes++;
                sum.wrong += (double)start.v[lane] > best.t * w.unit;
                if (a->half) sum.plane = ratio((double)more.v[lane] - (best.v - best.u), 2 * (double)error.v[lane], sum.plane);
                if (a->id == b->id) continue;
                sum.wrong += fabsf(more.v[lane]) > 2 * error.v[lane] && best.primitive != (more.v[lane] > 0 ? b->id : a->id);
            }
        }
        pt_scene_free(&s);
    }
    printf("bounds of planes: largest error / bound %.3f of %d hits; %d hits known in float\n", sum.plane, sum.planes, sum.sure);
    pt_check((sum.planes > 5000 && sum.sure > 1000) || pt_test.is_short, "bounds of planes", "the check is empty");
    pt_check(sum.plane <= 1, "error of weights", "%.4f times its bound", sum.plane);
    pt_check(sum.plane > 0.0005 || pt_test.is_short, "error of weights", "%.4f times its bound, which is far too wide", sum.plane);
    pt_check(sum.wrong == 0, "what lanes tell of planes", "%d are told to begin behind the hit, to be hit, or to be the wrong half", sum.wrong);
}

/* ---- partings ------------------------------------------------------------------------------------------------ */

/* What a list of boxes costs whose `count` members are lanes `who`. */
static float list_cost(const pti_lanes *boxes, const uint32_t *who, uint32_t count, pti_joined *all)
{
    pti_lanes members[256];
    uint32_t i;
    for (i = 0; i < count; i++) members[i] = boxes[who[i]];
    pti_join(members, count, all);
    return pti_box_area(all->box.v) * (float)((count + 7) / 8);
}

/* Along an axis: short lists are cut anywhere, in the order of their centres, others between bins. The least cost of all. */
static float cheapest(const pti_lanes *boxes, uint32_t n, const float *centres, int axis, uint32_t few)
{
    const float lo = -centres[axis], extent = centres[4 + axis] - lo;
    uint32_t order[256], i, j;
    float place[256], best = HUGE_VALF;
    pti_joined all;
    if (extent == 0) return best;
    for (i = 0; i < n; i++) {
        const float centre = boxes[i].v[4 + axis] - boxes[i].v[axis];
        place[i] = n <= PTI_SHORT ? centre : floorf((centre - lo) * (PTI_WIDE_BINS * (1 - 4 * PTI_U) / extent));
        for (j = i; j > 0 && place[order[j - 1]] > place[i]; j--) order[j] = order[j - 1];
        order[j] = i;
    }
    for (i = few; i + few <= n; i++) {
        float cost;
        if (n > PTI_SHORT && place[order[i - 1]] == place[order[i]]) continue;
        cost = list_cost(boxes, order, i, &all);
        cost += list_cost(boxes, order + i, n - i, &all);
        best = cost < best ? cost : best;
    }
    return best;
}

/* kind 1: all centres in a plane; 2: at one point. Coordinates are multiples of 2^-9, so that centres differ well or not at all. */
static void fill_list(pti_lanes *boxes, uint32_t n, int kind, pt_pcg32 *rng)
{
    uint32_t i;
    int k;
    for (i = 0; i < n; i++) {
        for (k = 0; k < 3; k++) {
            const float spread = kind == 2 || (kind == 1 && k == 1) ? 0 : 1024;
            const float centre = floorf(spread * (float)pt_pcg32_double(rng)) / 512, half = floorf(64 * (float)pt_pcg32_double(rng)) / 512;
            boxes[i].v[k] = half - centre;
            boxes[i].v[4 + k] = centre + half;
        }
        boxes[i].bits[3] = i;
        boxes[i].v[7] = 0;
    }
}

static int same_box(const float *a, const float *b)
{
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2] && a[4] == b[4] && a[5] == b[5] && a[6] == b[6];
}

/* Finds the best parting and carries it out: 0, or what is wrong. */
static const char *part_list(uint32_t n, int kind, uint32_t few, pt_pcg32 *rng)
{
    static pti_wide_builder b;
    pti_lanes boxes[256], moved[256];
    pti_joined all, side[2], expected[2];
    pti_parting p = {-1, 0, 0, 0, HUGE_VALF, 0};
    uint32_t who[256], i, middle;
    float best = HUGE_VALF, cost;
    int k;
    fill_list(boxes, n, kind, rng);
    memcpy(moved, boxes, sizeof moved);
    pti_join(boxes, n, &all);
    for (k = 0; k < 3; k++) best = fminf(best, cheapest(boxes, n, all.centres.v, k, few));
    b.boxes = moved;
    p.middle = (n / 2 + 7) / 8 * 8;
    pti_find_parting(&b, 0, n, all.centres.v, few, &p);
    if (n <= 8 && p.cost == HUGE_VALF) return best == HUGE_VALF ? NULL : "no cut"; /* a leaf stays whole */
    middle = pti_part(&b, 0, n, &p, side);
    if (middle < 1 || middle >= n) return "a side is empty";
    for (i = 0; i < n; i++) who[i] = moved[i].bits[3];
    for (i = 0; i < n; i++)
        if (who[i] >= n || memcmp(&boxes[who[i]], &moved[i], sizeof *boxes)) return "a box has changed";
    cost = list_cost(boxes, who, middle, &expected[0]);
    cost += list_cost(boxes, who + middle, n - middle, &expected[1]);
    for (k = 0; k < 2; k++)
        if (!same_box(side[k].box.v, expected[k].box.v) || !same_box(side[k].centres.v, expected[k].centres.v)) return "the box of a side";
    for (i = 0; i < n; i++) boxes[who[i]].bits[3] = n;
    for (i = 0; i < n; i++)
        if (boxes[i].bits[3] != n) return "a box is lost";
    if (best == HUGE_VALF) return p.cost == best && middle == p.middle ? NULL : "centres at one point are halved";
    if (middle < few || n - middle < few) return "too few on a side";
    if (fabsf(p.cost - best) > 1e-6f * best) return "there is a cheaper one";
    return fabsf(p.cost - cost) > 1e-6f * best ? "its cost" : NULL;
}

/* A very long list; every period-th box has its centre at one point, as scenes that are written in turns may have. 0: none. */
static const char *part_long_list(uint32_t period, pt_pcg32 *rng)
{
    static pti_lanes boxes[PTI_LONG + 7];
    static pti_wide_builder b;
    const uint32_t n = PTI_LONG + 7;
    pti_parting p = {-1, 0, 0, 0, HUGE_VALF, 0};
    pti_joined all, side[2];
    uint32_t i, middle;
    fill_list(boxes, n, 0, rng);
    for (i = 0; i < n; i++) {
        if (period > 0 && i % period == 0) fill_list(&boxes[i], 1, 2, rng);
        boxes[i].bits[3] = i;
    }
    pti_join(boxes, n, &all);
    b.boxes = boxes;
    p.middle = (n / 2 + 7) / 8 * 8;
    pti_find_parting(&b, 0, n, all.centres.v, 4, &p);
    if (p.axis < 0) return "no plane";
    middle = pti_part(&b, 0, n, &p, side);
    return middle < 4 || n - middle < 4 ? "too few on a side" : NULL;
}

static void long_partings(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(72), 1);
    uint32_t period;
    for (period = 0; period < 9; period += period ? 1 : 2) {
        const char *wrong = part_long_list(period, &rng);
        pt_check(!wrong, label("a very long list, period %u", period), "%s", wrong ? wrong : "");
    }
}

static void partings(void)
{
    static const char *const CENTRES[3] = {"anywhere", "in a plane", "at one point"};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(71), 1);
    uint32_t n;
    int kind, k;
    for (kind = 0; kind < 3; kind++)
        for (k = 0; k < 2; k++) {
            const uint32_t few = k ? 4 : 1;
            const char *wrong = NULL;
            for (n = 1; n <= 256 && !wrong; n += n < 40 ? 1 : 13) {
                int times;
                for (times = 0; times < 20 && !wrong; times++) wrong = part_list(n, kind, few, &rng);
            }
            pt_check(!wrong, label("partings, centres %s, at least %u a side", CENTRES[kind], few), "%s, about %u boxes", wrong ? wrong : "", n);
        }
}

/* ---- the structure ------------------------------------------------------------------------------------------- */

typedef struct census {
    unsigned char *seen;    /* per primitive                                                               */
    int wrong, depth, leaves, lanes;
} census;

static int holds(const pti_node8 *n, int lane, pt_vec3 v)
{
    return v.x >= n->box[0][lane] && v.y >= n->box[1][lane] && v.z >= n->box[2][lane] && v.x <= n->box[3][lane] &&
           v.y <= n->box[4][lane] && v.z <= n->box[5][lane];
}

/* All that is below a reference lies in the box of lane `lane` of node `n`. */
static void count_below(const pt_scene *s, uint32_t at, const pti_node8 *n, int lane, int depth, census *c)
{
    const unsigned char *p = pti_place(&s->wide, at);
    int i, k;
    c->depth = depth > c->depth ? depth : c->depth;
    c->wrong += p < s->wide.arena || p >= s->wide.arena + s->wide.bytes || depth > 60;
    if (c->wrong) return;
    if ((at & 7) == PTI_NODE) {
        const pti_node8 *m = (const pti_node8 *)(const void *)p;
        for (i = 0; i < 8; i++) {
            if (m->box[0][i] <= m->box[3][i]) count_below(s, m->child[i], m, i, depth + 1, c);
            else c->wrong += m->child[i] != 0;
            for (k = 0; n && m->box[0][i] <= m->box[3][i] && k < 3; k++) c->wrong += m->box[k][i] < n->box[k][lane] || m->box[k + 3][i] > n->box[k + 3][lane];
        }
        return;
    }
    c->leaves++;
    for (i = 0; i < 8; i++) {
        const pti_triangle8 *t = (const pti_triangle8 *)(const void *)p;
        const uint32_t id = (at & 7) == PTI_TRIANGLES ? t->id[i] : ((const pti_sphere8 *)(const void *)p)->id[i];
        if (id >= s->primitive_count) c->wrong++;
        else if ((at & 7) == PTI_SPHERES) {
            c->seen[id] |= s->primitives[id].shape == PT_SHAPE_SPHERE;
        } else if (t->v[0][i] - t->v[0][i] == 0) {
            c->seen[id] = (unsigned char)(c->seen[id] + 1);
            c->lanes++;
            for (k = 0; n && k < 3; k++) c->wrong += !holds(n, lane, pt_v3(t->v[3 * k][i], t->v[3 * k + 1][i], t->v[3 * k + 2][i]));
        }
    }
}

/* From its second root, a tree has all but walls once. */
static void things(const pt_scene *s)
{
    census c = {NULL, 0, 0, 0, 0};
    uint32_t i, k;
    int missing = 0;
    c.seen = (unsigned char *)calloc(s->primitive_count + 1, 1);
    if (!c.seen) return;
    count_below(s, s->wide.things, NULL, 0, 0, &c);
    for (i = 0; i < s->primitive_count; i++) {
        int wall = 0;
        for (k = 0; k < s->wide.wall_count; k++) wall |= s->wide.walls[k] == i;
        missing += c.seen[i] != (wall ? 0 : s->primitives[i].shape == PT_SHAPE_PARALLELOGRAM ? 2 : 1);
    }
    pt_check(s->wide.wall_count == 10, "a room with a ball", "%d walls", (int)s->wide.wall_count);
    pt_check(c.wrong == 0 && missing == 0, "a room with a ball", "%d boxes or references are wrong, %d things are not in it once, or walls are", c.wrong, missing);
    free(c.seen);
}

static void structure(void)
{
    int kind, n;
    for (kind = 0; kind < KINDS; kind++)
        for (n = 100; n <= (kind == BALL ? 120000 : 30000); n *= n < 20000 ? 17 : 4) { /* the last is longer than PTI_LONG */
            pt_scene s;
            census c = {NULL, 0, 0, 0, 0};
            uint32_t i;
            int missing = 0;
            if (!make(&s, kind, n, v3(0, 0, 0), 1, PT_TREE_DEFAULT)) return;
            c.seen = (unsigned char *)calloc(s.primitive_count + 1, 1);
            if (c.seen) count_below(&s, s.wide.root, NULL, 0, 0, &c);
            for (i = 0; c.seen && i < s.primitive_count; i++) missing += c.seen[i] != (s.primitives[i].shape == PT_SHAPE_PARALLELOGRAM ? 2 : 1);
            pt_check(c.wrong == 0 && missing == 0, label("the wide tree of %s, %d", NAMES[kind], n),
                     "%d boxes or references are wrong, %d primitives are not in it once", c.wrong, missing);
            if (kind == FURNISHED) things(&s);
            if (kind == BALL && n > 20000) {
                const double bytes = (double)s.wide.bytes / s.primitive_count;
                printf("the wide tree: %.1f bytes a triangle, %.2f of 8 lanes used, depth %d\n", bytes, (double)c.lanes / c.leaves, c.depth);
                pt_check(bytes <= 55, "bytes a triangle", "%.1f", bytes);
            }
            free(c.seen);
            pt_scene_free(&s);
        }
}

/* A pool of one that does the last task first. */
static void backwards(void *user, int count, void (*task)(void *context, int index), void *context)
{
    *(int *)user += count;
    while (count-- > 0) task(context, count);
}

static void any_threads(void)
{
    static const int kinds[3] = {BALL, SOUP, MIXED};
    int k, way;
    for (k = 0; k < 3; k++) {
        pt_scene s[4];
        int tasks = 0, same = 1;
        for (way = 0; way < 4; way++) {
            memset(&s[way], 0, sizeof s[way]);
            s[way].threads = way == 1 ? 2 : way == 2 ? 7 : 1;
            if (way == 3) {
                s[way].parallel = backwards;
                s[way].parallel_user = &tasks;
            }
            fill(&s[way], kinds[k], 30000, v3(0, 0, 0), 1);
            same = pt_commit(&s[way]) == PT_OK && same && s[way].wide.bytes == s[0].wide.bytes && s[way].wide.root == s[0].wide.root &&
                   memcmp(s[way].wide.arena, s[0].wide.arena, s[0].wide.bytes) == 0;
        }
        pt_check(tasks > 2, NAMES[kinds[k]], "the build was one task: the check is empty");
        pt_check(same, NAMES[kinds[k]], "another tree with 2 or 7 threads, or with the user's");
        for (way = 0; way < 4; way++) pt_scene_free(&s[way]);
    }
}

/* Where the heuristic finds nothing to part, or parts badly: the depth stays that of a list halved, and leaves are filled. */
static void bad_luck(void)
{
    static const int kinds[4] = {IDENTICAL, CHAIN, GIANT, FLAT};
    int k;
    for (k = 0; k < 4; k++) {
        census c = {NULL, 0, 0, 0, 0};
        pt_scene s;
        if (!make(&s, kinds[k], 40000, v3(0, 0, 0), 1, PT_TREE_DEFAULT)) return;
        c.seen = (unsigned char *)calloc(s.primitive_count, 1);
        if (c.seen) count_below(&s, s.wide.root, NULL, 0, 0, &c);
        pt_check(c.wrong == 0 && c.depth <= 40 && c.lanes > 4 * c.leaves, NAMES[kinds[k]], "%d wrong, depth %d, %d triangles in %d leaves",
                 c.wrong, c.depth, c.lanes, c.leaves);
        free(c.seen);
        pt_scene_free(&s);
    }
}

/* Every allocation of pt_commit fails once. */
static void no_memory(void)
{
    static const int sizes[2] = {40, 400};
    const long live = heap.live;
    int i;
    for (i = 0; i < 2; i++) {
        pt_scene s;
        int k, wrong = 0;
        memset(&s, 0, sizeof s);
        fill(&s, MIXED, sizes[i], v3(0, 0, 0), 1);
        for (k = 1; k < 100; k++) {
            pt_result r;
            heap.calls = 0;
            heap.fail_at = k;
            r = pt_commit(&s);
            heap.fail_at = 0;
            if (r == PT_OK) break;
            wrong += r != PT_ERROR_MEMORY || s.committed || s.wide.bytes != 0;
        }
        pt_check(k > 3 && k < 100 && wrong == 0 && s.wide.bytes > 0, label("no memory for %d primitives", sizes[i]),
                 "%d allocations, %d failures that were not told", k - 1, wrong);
        pt_scene_free(&s);
    }
    pt_check(heap.live == live, "memory", "%ld pieces are not freed", heap.live - live);
}

#endif /* PTI_HAS_WIDE */

static int wide(int argc, char **argv)
{
    pt_test_begin(WIDE_PROGRAM, argc, argv);
#if PTI_HAS_WIDE
    printf("lanes: %s\n", PTI_LANES == 2 ? "AVX2" : PTI_LANES == 1 ? "SSE2" : "C");
    PT_TEST_EXACT(lanes);
    PT_TEST_EXACT(lanes_together);
    PT_TEST_EXACT(small_scenes);
    PT_TEST_EXACT(trees);
    PT_TEST_EXACT(scales);
    PT_TEST_EXACT(no_rays);
    PT_TEST_EXACT(folds);
    PT_TEST_EXACT(bounds_of_triangles);
    PT_TEST_EXACT(bounds_of_planes);
    PT_TEST_EXACT(partings);
    PT_TEST_EXACT(long_partings);
    PT_TEST_EXACT(structure);
    PT_TEST_EXACT(any_threads);
    PT_TEST_EXACT(bad_luck);
    PT_TEST_EXACT(no_memory);
#endif
    return pt_test_end();
}

#ifdef WIDE_MAIN
int main(int argc, char **argv) { return wide(argc, argv); }
#endif
