/* stress.c: where floating-point numbers end. Every case is measured against the exact value for the rounded input,
   and has the bound that the header promises for it; `make stress` builds this file in float and in double and sets
   the two side by side (tests/stress_report.c), `make test` runs its short form (tests/test_stress.c).

       rows        tests/data/cases.csv, one by one (tests/stress_cases.h)
       shapes      decisions against whole numbers, at all scales and translations; closed meshes; hostile input
       self        closed furnaces of all sizes, far from the origin: no ray leaks or meets its own start
       tree        0 to 10^6 primitives, all the shapes that hurt: depth, time, and the hits of a linear search
       transport   albedo to 1 - 1e-6, tiny bright lamps, corners, cameras in odd places, long sums
       random      seeds, streams and dimensions: no correlation, no 1
       refused     what cannot work is refused with a sentence
       twin        pictures of all canonical scenes, for the comparison of float with double

   Arguments choose groups, by the names of the functions. */

#ifndef PT_STATIC
#define PATHTRACER_IMPLEMENTATION
#endif
#include "stress_cases.h"

/* Coordinates in these tests are whole numbers times a power of two: exact in pt_real, so that decisions can be made
   in whole numbers. */
typedef struct whole {
    int64_t x, y, z;
} whole;

static whole whole3(int64_t x, int64_t y, int64_t z)
{
    whole w;
    w.x = x;
    w.y = y;
    w.z = z;
    return w;
}
static whole plus(whole a, whole b) { return whole3(a.x + b.x, a.y + b.y, a.z + b.z); }
static whole minus(whole a, whole b) { return whole3(a.x - b.x, a.y - b.y, a.z - b.z); }
static int64_t inner(whole a, whole b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static whole outer(whole a, whole b)
{
    return whole3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static int64_t triple(whole a, whole b, whole c) { return inner(a, outer(b, c)); }
static int sign(int64_t x) { return (x > 0) - (x < 0); }
static pt_vec3 at_scale(whole a, double scale)
{
    return v3((double)a.x * scale, (double)a.y * scale, (double)a.z * scale);
}

/* A whole number in [-most, most]. */
static int64_t draw(pt_pcg32 *rng, int64_t most)
{
    return (int64_t)(pt_pcg32_next(rng) % (uint32_t)(2 * most + 1)) - most;
}
static whole draw3(pt_pcg32 *rng, int64_t most)
{
    const int64_t x = draw(rng, most), y = draw(rng, most);
    return whole3(x, y, draw(rng, most));
}
static double between(pt_pcg32 *rng, double low, double high)
{
    return low + (high - low) * pt_pcg32_double(rng);
}
static pt_vec3 direction(pt_pcg32 *rng)
{
    const double z = between(rng, -1, 1), phi = between(rng, 0, 2 * PT_PI), r = sqrt((1 - z) * (1 + z));
    return v3(r * cos(phi), r * sin(phi), z);
}

/* Scale and translation of the cases; what a scale is called in the tables is the power of ten next to it. */
typedef struct place {
    const char *name;
    int exponent; /* of two */
    int64_t away; /* translation in units of the scale */
} place;
static const place PLACES[] = {{"scale 1e-6", -20, 0},
                               {"scale 1e-3", -10, 0},
                               {"scale 1", 0, 0},
                               {"scale 1e3", 10, 0},
                               {"scale 1e6", 20, 0},
                               {"translated 1e5", 0, 100000},
                               {"translated 1e6", 0, 1000000},
                               {"translated 1e7", 0, 10000000},
                               {"scale 1e-45", -149, 0},
                               {"scale 1e30", 100, 0}};
enum { PLACE_COUNT = sizeof PLACES / sizeof PLACES[0] };

static void stand_at(const place *p)
{
    STRESS.x = ldexp(1, p->exponent);
    STRESS.y = (double)p->away;
}

/* ---- triangles -------------------------------------------------------------------------------------- */

/* Up to this whole numbers go, so that a determinant of three vectors stays below 6 (2^12)^3 < 2^39 and double, with
   its 53 bits and 129 roundings of a depth ([PT-06], pti_depth_error), must decide every one that is not 0. */
enum { WHOLE_MOST = 4095 };
enum { ANY, SLIVER, NEAR_EDGE, AXIS, ON_PLANE, ZERO_AREA, VARIETIES };
static const char *const VARIETY_NAMES[VARIETIES] = {"triangle",      "sliver",   "near an edge",
                                                     "axis-parallel", "on plane", "zero area"};

/* Corners relative to the ray's origin, and its direction. */
typedef struct trial {
    whole a, b, c, d;
} trial;

static trial make_trial(pt_pcg32 *rng, int variety)
{
    const int64_t most = variety == SLIVER || variety == NEAR_EDGE ? WHOLE_MOST / 2 : WHOLE_MOST;
    trial t;
    t.a = draw3(rng, most);
    t.b = draw3(rng, most);
    t.c = draw3(rng, most);
    t.d = draw3(rng, WHOLE_MOST);
    if (variety == SLIVER) { /* the third corner beside the middle of the edge, aimed at */
        t.a = whole3(t.a.x & ~1, t.a.y & ~1, t.a.z & ~1);
        t.b = whole3(t.b.x & ~1, t.b.y & ~1, t.b.z & ~1);
        t.c = plus(whole3((t.a.x + t.b.x) / 2, (t.a.y + t.b.y) / 2, (t.a.z + t.b.z) / 2), draw3(rng, 1));
        t.d = plus(plus(t.a, t.b), draw3(rng, 2));
    }
    if (variety == NEAR_EDGE) t.d = plus(plus(t.a, t.b), draw3(rng, 1)); /* at a + b the ray meets the edge */
    if (variety == ANY && pt_pcg32_next(rng) % 2)
        t.d = whole3((t.a.x + t.b.x + t.c.x) / 3, (t.a.y + t.b.y + t.c.y) / 3, (t.a.z + t.b.z + t.c.z) / 3);
    if (variety == AXIS) {
        const int k = (int)(pt_pcg32_next(rng) % 3);
        const int64_t along = pt_pcg32_next(rng) % 2 ? 1 : -1;
        t.d = whole3(k == 0 ? along : 0, k == 1 ? along : 0, k == 2 ? along : 0);
        t.a = whole3(t.a.x / 8, t.a.y / 8, t.a.z / 8);
        t.c = minus(minus(whole3(0, 0, 0), t.a), whole3(t.b.x, t.b.y, t.b.z / 2));
        t.c = whole3(t.c.x / 2, t.c.y / 2, t.c.z / 2);
    }
    if (variety == ON_PLANE) { /* the origin lies in the middle of the triangle */
        t.a = whole3(t.a.x / 2, t.a.y / 2, t.a.z / 2);
        t.b = whole3(t.b.x / 2, t.b.y / 2, t.b.z / 2);
        t.c = minus(whole3(0, 0, 0), plus(t.a, t.b));
    }
    if (variety == ZERO_AREA) { /* three corners in a line, aimed at */
        const whole e = draw3(rng, WHOLE_MOST / 8);
        t.a = draw3(rng, WHOLE_MOST / 4);
        t.b = plus(t.a, e);
        t.c = minus(t.a, plus(e, pt_pcg32_next(rng) % 2 ? e : whole3(0, 0, 0)));
        t.d = t.a;
    }
    return t;
}

/* 1 hit, 0 miss, -1 the ray meets an edge, where either will do for one triangle alone. *t: exact but for one
   rounding. */
static int decide(const trial *q, double *t)
{
    const int64_t u = triple(q->d, q->b, q->c), v = triple(q->d, q->c, q->a), w = triple(q->d, q->a, q->b);
    const whole n = outer(minus(q->b, q->a), minus(q->c, q->a));
    const int64_t top = inner(n, q->a), bottom = inner(n, q->d);
    const int any_plus = u > 0 || v > 0 || w > 0, any_minus = u < 0 || v < 0 || w < 0;
    if (n.x == 0 && n.y == 0 && n.z == 0) return 0;
    if (any_plus && any_minus) return 0;
    if (bottom == 0) return 0;
    *t = (double)top / (double)bottom;
    if (sign(top) * sign(bottom) <= 0) return 0;
    return u == 0 || v == 0 || w == 0 ? -1 : 1;
}

/* Error of t in units of the bound that the header has for it; a wrong decision counts in *wrong. */
static double try_triangle(const trial *q, const place *p, int *wrong)
{
    const double s = ldexp(1, p->exponent);
    const whole o = whole3(p->away, -p->away, p->away / 2);
    const pt_vec3 a = at_scale(plus(q->a, o), s), b = at_scale(plus(q->b, o), s),
                  c = at_scale(plus(q->c, o), s);
    const pt_ray ray = ray_from(at_scale(o, s), at_scale(q->d, p->exponent < -100 ? s : 1));
    double t = 0, w[2], exact = 0, bound;
    const double unit = p->exponent < -100 ? 1 : s; /* of t */
    const int want = decide(q, &exact), got = pt_intersect_triangle(&ray, a, b, c, &t, w);
    pti_ray r = pti_ray_make(&ray);
    pti_d3 x, y, z;
    double u, v, ww;
    *wrong += want >= 0 && got != want;
    if (!got || want != 1) return 0;
    seen(t + w[0] + w[1]);
    x = pti_shear(&r, &a);
    y = pti_shear(&r, &b);
    z = pti_shear(&r, &c);
    u = pti_edge(z.x, y.y, z.y, y.x);
    v = pti_edge(x.x, z.y, x.y, z.x);
    ww = pti_edge(y.x, x.y, y.y, x.x);
    bound = pti_depth_error(&r, x, y, z, u, v, ww) / fabs(u + v + ww) + 4 * PTI_2_M53 * t;
    /* det has its own error, as large as that of an edge function: it counts with t */
    bound +=
        t * 3 *
        (2 * PTI_2_M53 * fabs(u + v + ww) + 44 * PTI_2_M53 * fmax(fabs(x.x), fmax(fabs(y.x), fabs(z.x))) *
                                                fmax(fabs(x.y), fmax(fabs(y.y), fabs(z.y)))) /
        fabs(u + v + ww);
    return fabs(t - exact * unit) / bound;
}

/* Doubles have products of three coordinates in range from about 1e-100 to 1e100 only. */
static int place_is_fit(const place *p) { return is_float() || p->exponent > -200; }

static void triangles(void)
{
    int p, k, i;
    begin_group("shapes");
    for (p = 0; p < PLACE_COUNT; p++)
        for (k = 0; k < VARIETIES; k++) {
            pt_pcg32 rng = pt_pcg32_make(900, (uint64_t)k);
            const int n = many(400000, 4000);
            double worst = 0;
            int wrong = 0;
            if (!place_is_fit(&PLACES[p])) continue;
            for (i = 0; i < n; i++) {
                const trial q = make_trial(&rng, k);
                worst = fmax(worst, try_triangle(&q, &PLACES[p], &wrong));
            }
            stand_at(&PLACES[p]);
            told_count(label("%s, %s", VARIETY_NAMES[k], PLACES[p].name), "wrong decisions", wrong, n);
            stand_at(&PLACES[p]);
            if (k < ON_PLANE)
                told(label("%s, %s", VARIETY_NAMES[k], PLACES[p].name), "t", worst, 0, worst, "bounds", 1);
        }
}

/* Two triangles on both sides of an edge that the ray meets exactly: one of them is hit. */
static void shared_edges(void)
{
    int p, i;
    begin_group("shapes");
    for (p = 0; p < PLACE_COUNT; p++) {
        pt_pcg32 rng = pt_pcg32_make(901, 0);
        const int n = many(400000, 4000);
        const double s = ldexp(1, PLACES[p].exponent);
        const whole o = whole3(PLACES[p].away, -PLACES[p].away, PLACES[p].away / 2);
        int asked = 0, leaks = 0;
        for (i = 0; i < n; i++) {
            const whole a = draw3(&rng, WHOLE_MOST / 2), b = draw3(&rng, WHOLE_MOST / 2), d = plus(a, b);
            const whole c = draw3(&rng, WHOLE_MOST), e = draw3(&rng, WHOLE_MOST);
            const int64_t side = triple(d, minus(b, a), minus(c, a)),
                          other = triple(d, minus(b, a), minus(e, a));
            const pt_ray ray = ray_from(at_scale(o, s), at_scale(d, PLACES[p].exponent < -100 ? s : 1));
            double t, w[2];
            pt_vec3 v[4];
            if (sign(side) * sign(other) >= 0) continue;
            v[0] = at_scale(plus(a, o), s);
            v[1] = at_scale(plus(b, o), s);
            v[2] = at_scale(plus(c, o), s);
            v[3] = at_scale(plus(e, o), s);
            asked++;
            leaks += !pt_intersect_triangle(&ray, v[0], v[1], v[2], &t, w) &&
                     !pt_intersect_triangle(&ray, v[1], v[0], v[3], &t, w);
        }
        stand_at(&PLACES[p]);
        told_count(label("shared edge, %s", PLACES[p].name), "leaks", asked > n / 4 ? leaks : HUGE_VAL,
                   asked);
    }
}

/* ---- spheres and boxes ------------------------------------------------------------------------------- */

/* Whole numbers up to 2^10: the discriminant (f.d)^2 - d.d (f.f - r^2) is exact below 2^50, and r - l is at least
   1 / (2 r d.d) > 2^-34 where it is not 0, which double sees. */
static void spheres(void)
{
    int p, i;
    begin_group("shapes");
    for (p = 0; p < PLACE_COUNT; p++) {
        pt_pcg32 rng = pt_pcg32_make(902, 0);
        const int n = many(1000000, 20000), denormal = PLACES[p].exponent < -100;
        const double s = ldexp(1, PLACES[p].exponent), d_scale = denormal ? s : 1, unit = s / d_scale;
        const whole o = whole3(PLACES[p].away, -PLACES[p].away, PLACES[p].away / 2);
        int wrong = 0;
        double worst = 0;
        for (i = 0; i < n; i++) {
            const whole d = draw3(&rng, 1023), f = draw3(&rng, 1023); /* f: origin - centre */
            const int64_t r = 1 + (int64_t)(pt_pcg32_next(&rng) % 1023), a = inner(d, d), b = -inner(f, d);
            const int64_t c = inner(f, f) - r * r, disc = b * b - a * c;
            const pt_ray ray = ray_from(at_scale(plus(o, f), s), at_scale(d, d_scale));
            double t = 0, exact, root, bound;
            const int got = pt_intersect_sphere(&ray, at_scale(o, s), real((double)r * s), &t);
            int want;
            if (a == 0 || disc == 0 || c == 0)
                continue; /* tangents, and origins on the sphere: by convention */
            want = disc > 0 && (c < 0 || b > 0);
            wrong += got != want;
            if (!got || !want) continue;
            seen(t);
            root = sqrt((double)disc);
            exact = c < 0 ? (b < 0 ? -(double)c / (root - (double)b) : ((double)b + root) / (double)a)
                          : (double)c / ((double)b + root);
            /* 16 roundings of the distances; and those of l, 4 of |f|, as the root amplifies them */
            bound = PTI_2_M53 * (16 + 8 * sqrt((double)a) * (double)r / root) *
                    (sqrt((double)inner(f, f)) + (double)r) / sqrt((double)a);
            worst = fmax(worst, fabs(t / unit - exact) / bound);
        }
        stand_at(&PLACES[p]);
        told_count(label("sphere, %s", PLACES[p].name), "wrong decisions", wrong, n);
        stand_at(&PLACES[p]);
        told(label("sphere, %s", PLACES[p].name), "t", worst, 0, worst, "bounds", 1);
    }
}

/* Does the ray o + t d, t >= 0, meet the box, in whole numbers? */
static int meets_box(const int64_t lo[3], const int64_t hi[3], const int64_t d[3])
{
    int j, k;
    for (j = 0; j < 3;
         j++) { /* intervals [near, far] / |d|, all with far >= 0, near / |d| <= far / |d| of others */
        const int64_t far = d[j] > 0 ? hi[j] : -lo[j];
        if (d[j] == 0 && (lo[j] > 0 || hi[j] < 0)) return 0;
        if (d[j] == 0) continue;
        if (far < 0) return 0;
        for (k = 0; k < 3; k++) {
            const int64_t near = d[k] > 0 ? lo[k] : -hi[k];
            if (d[k] != 0 && near * llabs(d[j]) > far * llabs(d[k])) return 0;
        }
    }
    return 1;
}

static void boxes(void)
{
    int p, i, k;
    begin_group("shapes");
    for (p = 0; p < PLACE_COUNT; p++) {
        pt_pcg32 rng = pt_pcg32_make(903, 0);
        const int n = many(1000000, 20000);
        const double s = ldexp(1, PLACES[p].exponent);
        const whole o = whole3(PLACES[p].away, -PLACES[p].away, PLACES[p].away / 2);
        int missed = 0, extra = 0, empty = 0;
        for (i = 0; i < n; i++) {
            int64_t lo[3], hi[3], d[3];
            pt_ray ray;
            int got, want;
            for (k = 0; k < 3; k++) {
                const int64_t a = draw(&rng, 1023), b = pt_pcg32_next(&rng) % 8 ? draw(&rng, 1023) : a;
                const unsigned how =
                    pt_pcg32_next(&rng) % 8; /* flat boxes, axis-parallel rays, aims at corners */
                lo[k] = a < b ? a : b;
                hi[k] = a < b ? b : a;
                d[k] = how == 0 ? 0 : how < 4 ? lo[k] : how < 6 ? hi[k] : draw(&rng, 1023);
            }
            if (d[0] == 0 && d[1] == 0 && d[2] == 0) continue;
            ray = ray_from(at_scale(o, s),
                           at_scale(whole3(d[0], d[1], d[2]), PLACES[p].exponent < -100 ? s : 1));
            if (d[0] == 0 && i % 2) ray.d.x = -ray.d.x; /* -0 */
            want = meets_box((const int64_t *)lo, (const int64_t *)hi, (const int64_t *)d);
            got = pt_intersect_box(&ray, at_scale(plus(o, whole3(lo[0], lo[1], lo[2])), s),
                                   at_scale(plus(o, whole3(hi[0], hi[1], hi[2])), s));
            missed += want && !got;
            extra += got && !want;
            empty += !want;
        }
        stand_at(&PLACES[p]);
        told_count(label("box, %s", PLACES[p].name), "false misses", missed, n);
        stand_at(&PLACES[p]);
        if (PLACES[p].exponent < -100)
            limited("1/d overflows where abs(d) < 2^-128: the slab is unbounded, which is conservative", 1);
        told(label("box, %s", PLACES[p].name), "false hits, of 1", (double)extra / empty, 0,
             (double)extra / empty, "share", 0.001);
    }
}

/* ---- closed meshes -------------------------------------------------------------------------------------- */

/* A ball of 2 columns (rings - 1) triangles that look inwards: rings - 1 of corners, and two poles. */
typedef struct ball {
    pt_vec3 *v;
    uint32_t *index;
    uint32_t vertices, triangles;
} ball;

static void add_face(ball *b, uint32_t i, uint32_t j, uint32_t k)
{
    b->index[3 * b->triangles] = i;
    b->index[3 * b->triangles + 1] = j;
    b->index[3 * b->triangles + 2] = k;
    b->triangles++;
}

static ball make_ball(uint32_t rings, uint32_t columns, pt_vec3 centre, double radius)
{
    ball b = {NULL, NULL, 0, 0};
    uint32_t i, j;
    b.v = (pt_vec3 *)malloc(((size_t)rings * columns + 2) * sizeof *b.v);
    b.index = (uint32_t *)malloc((size_t)6 * rings * columns * sizeof *b.index);
    if (!b.v || !b.index) return b;
    for (i = 1; i < rings; i++)
        for (j = 0; j < columns; j++) {
            const double theta = PT_PI * i / rings, phi = 2 * PT_PI * j / columns;
            b.v[b.vertices++] =
                v3((double)centre.x + radius * sin(theta) * cos(phi), (double)centre.y + radius * cos(theta),
                   (double)centre.z + radius * sin(theta) * sin(phi));
        }
    b.v[b.vertices++] = v3((double)centre.x, (double)centre.y + radius, (double)centre.z);
    b.v[b.vertices++] = v3((double)centre.x, (double)centre.y - radius, (double)centre.z);
    for (j = 0; j < columns; j++) {
        const uint32_t next = (j + 1) % columns, last = (rings - 2) * columns;
        add_face(&b, b.vertices - 2, j, next);
        add_face(&b, b.vertices - 1, last + next, last + j);
        for (i = 0; i + 2 < rings; i++) {
            add_face(&b, i * columns + j, (i + 1) * columns + j, i * columns + next);
            add_face(&b, i * columns + next, (i + 1) * columns + j, (i + 1) * columns + next);
        }
    }
    return b;
}

static void free_ball(ball *b)
{
    free(b->v);
    free(b->index);
}

/* Rays from inside aimed at vertices and at points of edges, in chunks that threads share. */
typedef struct siege {
    const pt_scene *scene;
    const ball *b;
    pt_vec3 centre;
    double radius;
    int rays; /* in a chunk */
    long escaped[256];
} siege;

static void one_siege(void *context, int chunk)
{
    siege *const s = (siege *)context;
    pt_pcg32 rng = pt_pcg32_make(904, (uint64_t)chunk);
    int i;
    s->escaped[chunk] = 0;
    for (i = 0; i < s->rays; i++) {
        const uint32_t face = pt_pcg32_next(&rng) % s->b->triangles, corner = pt_pcg32_next(&rng) % 3;
        const pt_vec3 a = s->b->v[s->b->index[3 * face + corner]];
        const pt_vec3 b = s->b->v[s->b->index[3 * face + (corner + 1) % 3]];
        const double far = s->radius * 0.5 * pt_pcg32_double(&rng), w = i % 2 ? 0 : pt_pcg32_double(&rng);
        const pt_vec3 from = pt_v3_add(s->centre, pt_v3_scale(direction(&rng), real(far)));
        pt_vec3 aim;
        pt_ray ray;
        aim = v3((double)a.x + w * ((double)b.x - (double)a.x), (double)a.y + w * ((double)b.y - (double)a.y),
                 (double)a.z + w * ((double)b.z - (double)a.z));
        ray = ray_from(from, pt_v3_sub(aim, from));
        s->escaped[chunk] += !pt_occluded(s->scene, &ray);
    }
}

static void closed_mesh(void)
{
    static const double radius[3] = {1, 1e6, 1e-3}, away[3] = {0, 0, 1};
    static siege s;
    int c, k;
    begin_group("shapes");
    for (c = 0; c < 3; c++) {
        const double x = away[c];
        const pt_vec3 centre = v3(x, -x, 0.5 * x);
        const uint32_t rings = STRESS_LONG ? 225 : 48, columns = STRESS_LONG ? 224 : 50;
        ball b = make_ball(rings, columns, centre, radius[c]);
        pt_scene scene = PT_SCENE_INIT;
        long escaped = 0;
        pt_add_mesh(&scene, b.v, NULL, NULL, b.vertices, b.index, b.triangles, wall(&scene, 0.5));
        commit(&scene);
        s.scene = &scene;
        s.b = &b;
        s.centre = centre;
        s.radius = radius[c];
        s.rays = many(c == 0 ? 320000 : 40000, 1500);
        pti_parallel(STRESS_LONG ? 2 : 1, 256, one_siege, &s);
        for (k = 0; k < 256; k++) escaped += s.escaped[k];
        STRESS.x = radius[c];
        STRESS.y = away[c] / radius[c];
        told_count(
            label("%lu triangles, radius %g, %g radii away", (unsigned long)b.triangles, radius[c], STRESS.y),
            "rays that escape", (double)escaped, 256.0 * s.rays);
        free_ball(&b);
        pt_scene_free(&scene);
    }
    STRESS.x = STRESS.y = 0;
}

/* ---- hostile input ------------------------------------------------------------------------------------ */

/* NaN, infinity, zeros and denormals in every place of ray and shape: an answer, and no hit at a t that is none. */
static void hostile_numbers(void)
{
    const double bad[7] = {HUGE_VAL - HUGE_VAL,         HUGE_VAL, -HUGE_VAL, 0, -0.0,
                           is_float() ? 1e-45 : 5e-324, 3e38};
    int i, k, wrong = 0, asked = 0;
    begin_group("shapes");
    for (i = 0; i < 7; i++)
        for (k = 0; k < 19; k++) {
            pt_real n[19] = {0, 0, 5, 0, 0, -1, -1, -1, 0, 1, -1, 0, 0, 1, 0, 0, 0, 0, 1};
            double t = 1, b[2] = {0, 0};
            pt_ray ray;
            n[k] = (pt_real)bad[i];
            ray = ray_from(pt_v3(n[0], n[1], n[2]), pt_v3(n[3], n[4], n[5]));
            asked += 2;
            if (pt_intersect_triangle(&ray, pt_v3(n[6], n[7], n[8]), pt_v3(n[9], n[10], n[11]),
                                      pt_v3(n[12], n[13], n[14]), &t, b))
                wrong += !(t > 0 && t < HUGE_VAL && b[0] >= 0 && b[1] >= 0 && b[0] + b[1] <= 1 + 1e-15);
            if (pt_intersect_sphere(&ray, pt_v3(n[15], n[16], n[17]), n[18], &t))
                wrong += !(t > 0 && t < HUGE_VAL);
            (void)pt_intersect_box(&ray, pt_v3(n[6], n[7], n[8]), pt_v3(n[9], n[10], n[11]));
        }
    told_count("NaN, infinity, zero, denormal", "hits that are none", wrong, asked);
}

/* ---- self-intersection ---------------------------------------------------------------------------------- */

enum { BALL, BOX, MESH_BOX, FINE_MESH, FURNACES };
static const char *const FURNACE_NAMES[FURNACES] = {"sphere", "box", "box of triangles", "ball of triangles"};

/* A closed furnace of the given size around a centre, albedo 1/2, emission 1: radiance 2 everywhere. */
static pt_scene make_furnace(int kind, pt_vec3 c, double size)
{
    static const unsigned char face[12][3] = {{0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5},
                                              {0, 4, 5}, {0, 5, 1}, {2, 3, 7}, {2, 7, 6},
                                              {0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}};
    const double h = size / 2;
    pt_scene scene = PT_SCENE_INIT;
    const int m = glowing(&scene, 0.5, 1);
    pt_vec3 v[8];
    int k;
    for (k = 0; k < 8; k++)
        v[k] = v3((double)c.x + (k & 1 ? h : -h), (double)c.y + (k & 2 ? h : -h),
                  (double)c.z + (k & 4 ? h : -h));
    if (kind == BALL) pt_add_sphere(&scene, c, real(h), m);
    for (k = 0; kind == MESH_BOX && k < 12; k++)
        pt_add_triangle(&scene, v[face[k][0]], v[face[k][1]], v[face[k][2]], m);
    for (k = 0; kind == BOX && k < 3; k++) { /* normals look inwards */
        const pt_vec3 e[3] = {v3(size, 0, 0), v3(0, size, 0), v3(0, 0, size)};
        pt_add_parallelogram(&scene, v[0], e[(k + 1) % 3], e[(k + 2) % 3], m);
        pt_add_parallelogram(&scene, v[1 << k], e[(k + 2) % 3], e[(k + 1) % 3], m);
    }
    if (kind == FINE_MESH) {
        ball b = make_ball(24, 24, c, h);
        pt_add_mesh(&scene, b.v, NULL, NULL, b.vertices, b.index, b.triangles, m);
        free_ball(&b);
    }
    commit(&scene);
    return scene;
}

/* A path of 12 edges that never leaves has exactly the radiance 2 - 2^-11; how many have not. Triangles emit on one
   side: that which looks inwards must be theirs. */
static int broken_paths(const pt_scene *scene, pt_vec3 c, double size, int n)
{
    const double exact = 2 - 0x1p-11;
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(720), 0);
    pt_pcg32 rng = pt_pcg32_make(905, 0);
    pt_li_options options;
    int i, broken = 0;
    memset(&options, 0, sizeof options);
    options.max_edges = 12;
    options.roulette = PT_ROULETTE_NONE;
    for (i = 0; i < n; i++) {
        const pt_vec3 from =
            v3((double)c.x + size * between(&rng, -0.2, 0.2), (double)c.y + size * between(&rng, -0.2, 0.2),
               (double)c.z + size * between(&rng, -0.2, 0.2));
        const pt_ray ray = ray_from(from, direction(&rng));
        pt_li_info info = {0};
        double v;
        pt_sampler_start(&sampler, 0, (uint32_t)i);
        v = pt_li_path_plain(scene, &ray, &sampler, &options, &info).r;
        seen(v);
        broken += !(fabs(v - exact) <= 24 * pt_gamma(1) * exact); /* two roundings an edge */
    }
    return broken;
}

/* Size 2^k and offsets that are whole multiples of it: corners are exact as long as offset / size + 1/2 fits in the
   digits of pt_real. A float has 24: from 2^23 sizes away on, a box of size 1 has corners that round to others. */
static const char *const BOX_LIMIT =
    "corners half a size from a centre 2^23 sizes away need 25 digits: the box itself is not closed any more";
/* A float keeps the digits that its hit points lose in a second number; for double there is no wider one. A hit point
   is off by up to 16 u of its coordinates ([PT-06]), and one that is nearer to one of the four edges of its square than
   that may lie behind the wall next to it: of n points at most 4 * 16 u * 1.5 away n. */
static const char *const DOUBLE_LIMIT =
    "a hit point is off by 16 u of its distance from the origin, and so may lie behind the wall next to an edge";
static void limit_of_box(double away, int paths)
{
    if (is_float() && away > 0x1p22) limited(BOX_LIMIT, paths);
    if (!is_float() && away > 1e10) limited(DOUBLE_LIMIT, 12.0 * paths * 4 * 16 * 0x1p-53 * 1.5 * away);
}

static void furnaces(void)
{
    static const int exponent[6] = {-13, -7, 0, 7, 13, 20};
    static const double away[10] = {0, 1, 100, 1e4, 1e6, 1e7, 1e8, 1e10, 1e12, 1e14};
    int kind, s, o;
    begin_group("self");
    for (kind = 0; kind < FURNACES; kind++)
        for (s = 0; s < 6; s++)
            for (o = 0; o < 10; o++) {
                const double size = ldexp(1, exponent[s]), x = away[o] * size;
                const pt_vec3 c = v3(x, -x, 0.5 * x);
                const int n = many(4000, 200);
                pt_scene scene;
                int broken;
                if (x > 1e17 || (kind != BALL && away[o] > (is_float() ? 1e7 : 1e12))) continue;
                scene = make_furnace(kind, c, size);
                broken = broken_paths(&scene, c, size, n);
                STRESS.x = size;
                STRESS.y = away[o];
                if (kind != BALL) limit_of_box(away[o], n);
                told_count(label("%s, size %.0e, %.0e sizes away", FURNACE_NAMES[kind], size, away[o]),
                           "paths that leak or meet their start", broken, n);
                pt_scene_free(&scene);
            }
    STRESS.x = STRESS.y = 0;
}

/* With light sampling: shadow rays must reach, and weights fit. */
static void lit_furnaces(void)
{
    static const double size[3] = {1e-4, 1, 1e6}, away[3] = {0, 100, 1e4};
    int kind, s, o, i;
    begin_group("self");
    for (kind = 0; kind < FINE_MESH; kind++)
        for (s = 0; s < 3; s++)
            for (o = 0; o < 3; o++) {
                const double x = away[o] * size[s];
                const pt_vec3 c = v3(x, -x, 0.5 * x);
                pt_scene scene = make_furnace(kind, c, size[s]);
                pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(730), 0);
                pt_li_options options;
                pt_stats st = PT_STATS_INIT;
                memset(&options, 0, sizeof options);
                for (i = 0; i < many(80000, 400); i++) {
                    const pt_ray ray = ray_from(c, v3(0.3, 0.5, -0.8));
                    pt_li_info info = {0};
                    double v;
                    pt_sampler_start(&sampler, (uint64_t)(9 * kind + 3 * s + o), (uint32_t)i);
                    v = pt_li_path(&scene, &ray, &sampler, &options, &info).r;
                    seen(v);
                    pt_stats_add(&st, v);
                }
                STRESS.x = size[s];
                STRESS.y = away[o];
                told_mean(label("%s lit, size %.0e, %.0e away", FURNACE_NAMES[kind], size[s], away[o]), &st,
                          2, 0, 0.04);
                pt_scene_free(&scene);
            }
    STRESS.x = STRESS.y = 0;
}

/* ---- the tree --------------------------------------------------------------------------------------------- */

#if PTI_HAS_BVH
enum { NONE, ONE, TWO, IDENTICAL, DEGENERATE, GIANT, CHAIN, GEOMETRIC, SOUP, GROVES };
static const char *const GROVE_NAMES[GROVES] = {
    "no primitive",        "one primitive",     "two primitives",
    "identical triangles", "no area",           "a giant among tiny",
    "a chain of 2^-i",     "a geometric chain", "soup"};

static void add_corner(pt_scene *scene, double x, double y, double z, double size, int m)
{
    pt_add_triangle(scene, v3(x, y, z), v3(x + size, y, z), v3(x, y + size, z + size), m);
}

static int plant(pt_scene *scene, int grove, int n)
{
    const int m = wall(scene, 0.5), count = grove == NONE    ? 0
                                            : grove == ONE   ? 1
                                            : grove == TWO   ? 2
                                            : grove == CHAIN ? 120
                                                             : n;
    pt_pcg32 rng = pt_pcg32_make(906, 0);
    int i;
    for (i = 0; i < count; i++) {
        const double x = between(&rng, -1, 1), y = between(&rng, -1, 1), z = between(&rng, -1, 1);
        switch (grove) {
        case IDENTICAL:
            add_corner(scene, -0.5, -0.5, -0.5, 1, m);
            break;
        case DEGENERATE:
            pt_add_triangle(scene, v3(x, y, z), v3(x, y, z), v3(y, z, x), m);
            break;
        case GIANT:
            add_corner(scene, i ? x : -1e6, i ? y : -1e6, i ? z : -1e6, i ? 0.01 : 2e6, m);
            break;
        case CHAIN:
            add_corner(scene, ldexp(1, -i), 0, 0, ldexp(0.5, -i), m);
            break;
        case GEOMETRIC:
            add_corner(scene, pow(1.0001, -i), 0, 0, pow(1.0001, -i), m);
            break;
        default:
            add_corner(scene, x, y, z, grove == SOUP ? 0.03 : 1, m);
            break;
        }
    }
    return count;
}

/* Numbers are drawn one after the other: the order in which arguments are evaluated is the compiler's. */
static pt_vec3 in_cube(pt_pcg32 *rng, double half)
{
    const double x = between(rng, -half, half), y = between(rng, -half, half), z = between(rng, -half, half);
    return v3(x, y, z);
}

/* A point for rays to aim at: the middle of a primitive, so that some hit, or anywhere, or near the origin. */
static pt_vec3 target(const pt_scene *scene, int i, pt_pcg32 *rng)
{
    pt_vec3 v[4];
    if (i % 3 || scene->primitive_count == 0) return in_cube(rng, i % 2 ? 1 : 0.1);
    pti_corners(scene, &scene->primitives[pt_pcg32_next(rng) % (uint32_t)scene->primitive_count], v);
    return pt_v3_scale(pt_v3_add(pt_v3_add(v[0], v[1]), v[2]), (pt_real)(1.0 / 3));
}

/* Rays that find another hit than a linear search; the scene without its tree is one. */
static int other_hits(const pt_scene *scene, int rays, int *hits)
{
    pt_scene flat = *scene;
    pt_pcg32 rng = pt_pcg32_make(907, 0);
    int i, other = 0;
    flat.bvh.node_count = 0;
#if PTI_HAS_WIDE
    flat.wide.bytes = 0;
#endif
    for (i = *hits = 0; i < rays; i++) {
        const pt_vec3 from = in_cube(&rng, 2), to = target(scene, i, &rng);
        const pt_ray ray = ray_from(from, i % 7 ? pt_v3_sub(to, from) : v3(i % 3 - 1, i / 3 % 3 - 1, 1));
        pt_hit a, b;
        const int in_tree = pt_intersect(scene, &ray, &a), in_list = pt_intersect(&flat, &ray, &b);
        *hits += in_list;
        other += in_tree != in_list || pt_occluded(scene, &ray) != in_list;
        if (!in_tree || !in_list) continue;
        seen((double)a.t + (double)a.p.x + (double)a.ng.x);
        /* at equal t of pt_real the rounding of t may choose between coplanar triangles in double */
        other += a.t - b.t != 0 || (a.primitive != b.primitive && is_float());
    }
    return other;
}

/* Time: n log2 n steps of a microsecond each; 7 ns was measured. */
static void one_grove(int g, pt_tree tree)
{
    const int n = g == DEGENERATE || g == GEOMETRIC ? many(100000, 3000) : many(1000000, 3000);
    const int binary = tree == PT_TREE_BINARY;
    pt_scene scene = PT_SCENE_INIT;
    int count, rays, other, hits;
    double start, seconds;
    scene.tree = tree;
    count = plant(&scene, g, n);
    start = pt_cpu_seconds();
    commit(&scene);
    seconds = pt_cpu_seconds() - start;
    STRESS.x = count;
    told(GROVE_NAMES[g], binary ? "CPU seconds to build" : "CPU seconds to build, wide tree", seconds, 0, seconds, "s",
         0.1 + 1e-6 * count * log2(count + 2));
    STRESS.x = count;
    if (binary)
        told(GROVE_NAMES[g], "depth of the tree", scene.bvh.depth, 0, scene.bvh.depth, "levels", PT_BVH_MAX_DEPTH);
    rays = (int)fmax(32, fmin(many(100000, 2000), many(100000000, 2000000) / (double)(count + 1)));
    other = other_hits(&scene, rays, &hits);
    STRESS.x = count;
    told_count(GROVE_NAMES[g],
               binary ? "rays that find another hit than a linear search" : "rays that find another hit, wide tree", other, rays);
    if (g > TWO && g != DEGENERATE && binary)
        told(GROVE_NAMES[g], "rays that hit", hits, 1, hits < 1, "at least 1", 0);
    pt_scene_free(&scene);
}

static void trees(void)
{
    int g;
    begin_group("tree");
    for (g = 0; g < GROVES; g++) {
        one_grove(g, PT_TREE_BINARY);
        one_grove(g, PT_TREE_DEFAULT);
    }
    STRESS.x = 0;
}
#endif

/* ---- transport -------------------------------------------------------------------------------------------- */

/* Paths in a furnace, in chunks that threads share. */
typedef struct brightness {
    double rho;
    int paths; /* in a chunk */
    uint64_t seed;
    pt_stats chunk[32];
} brightness;

static void one_brightness(void *context, int i)
{
    brightness *const b = (brightness *)context;
    b->chunk[i] = furnace_chunk(b->rho, 0, 0, b->paths, b->seed, (uint64_t)i);
}

/* Albedo towards 1 with roulette by throughput: 1 / (1 - rho), in time that grows as that. Behind the first edges all
   weights are 1: radiance is the number of edges, which is geometric, and the mean of n of them times 2 n (1 - rho) is
   chi-squared with 2 n degrees of freedom but for O(1 - rho). What bias would be seen: 7.7 / sqrt n. */
static void bright_furnaces(void)
{
    static const int paths[6] = {20000, 10000, 1000, 160, 32, 8}, few[6] = {600, 60, 6, 2, 0, 0};
    static brightness b;
    int i, k;
    begin_group("transport");
    for (i = 0; i < 6; i++) {
        pt_stats s = PT_STATS_INIT;
        double exact, chi2, p;
        b.rho = (double)real(1 - pow(10, -1 - i));
        b.paths = STRESS_LONG ? paths[i] : (int)((pt_test_samples(512) * (uint32_t)few[i] + 511) / 512);
        b.seed = pt_test_seed(740 + (uint64_t)i);
        if (b.paths == 0) continue;
        pti_parallel(STRESS_LONG ? 2 : 1, 32, one_brightness, &b);
        for (k = 0; k < 32; k++) pt_stats_merge(&s, &b.chunk[k]);
        exact = 1 / (1 - b.rho);
        STRESS.x = 1 - b.rho;
        if (i < 3) { /* far from exponential */
            told_mean(label("furnace, albedo 1 - %.0e", 1 - b.rho), &s, exact, 4 * pt_gamma(1) * exact, 0.05);
            continue;
        }
        chi2 = 2 * s.n * s.mean / exact;
        p = pt_chi2_sf(chi2, 2 * s.n);
        told_error(label("furnace, albedo 1 - %.0e", 1 - b.rho), "mean", s.mean, exact,
                   2 * fmin(p, 1 - p) < pt_test_level() ? HUGE_VAL : 0, "rejected", 0);
        STRESS.x = 1 - b.rho;
        if (STRESS_LONG)
            told("the same", "smallest bias that would be seen", 7.7 / sqrt(s.n), 0, 7.7 / sqrt(s.n), "rel",
                 0.5);
    }
    STRESS.x = 0;
}

/* A floor of albedo 1/2 in the plane y = 0, seen from above the origin; what one bounce brings. */
static pt_stats floor_radiance(pt_scene *scene, pt_vec3 p, int n, uint64_t seed)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(seed), 0);
    const pt_ray ray = ray_from(pt_v3_add(p, v3(0, 1, 0)), v3(0, -1, 0));
    pt_li_options options;
    pt_stats s = PT_STATS_INIT;
    int i;
    memset(&options, 0, sizeof options);
    options.max_edges = 2;
    options.roulette = PT_ROULETTE_NONE;
    commit(scene);
    for (i = 0; i < n; i++) {
        pt_li_info info = {0};
        double v;
        pt_sampler_start(&sampler, 0, (uint32_t)i);
        v = pt_li_path(scene, &ray, &sampler, &options, &info).r;
        seen(v);
        pt_stats_add(&s, v);
    }
    pt_scene_free(scene);
    return s;
}

static void add_floor(pt_scene *scene, double size)
{
    pt_add_parallelogram(scene, v3(-size, 0, -size), v3(0, 0, 2 * size), v3(2 * size, 0, 0),
                         wall(scene, 0.5));
}

/* A ball of radius r and radiance 1 / r^2 at distance 1/2, 30 degrees off the normal: E = pi L r^2 / d^2 cos, and
   what is seen is E / (2 pi) = 2 cos 30. */
static void tiny_lamps(void)
{
    static const double r[6] = {1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6};
    int i;
    begin_group("transport");
    for (i = 0; i < 6; i++) {
        const double x = (double)real(0.25), y = (double)real(0.5 * sqrt(0.75)), d2 = x * x + y * y;
        const double ball_r = (double)real(r[i]), radiance = (double)real(1 / (r[i] * r[i]));
        const double exact = 0.5 * radiance * ball_r * ball_r / d2 * (y / sqrt(d2));
        pt_scene scene = PT_SCENE_INIT;
        pt_stats s;
        add_floor(&scene, 10);
        pt_add_sphere(&scene, v3(x, y, 0), real(ball_r), lamp(&scene, radiance));
        s = floor_radiance(&scene, v3(0, 0, 0), many(20000, 1000), 750);
        STRESS.x = r[i];
        /* where the floor is met is rounded: by u of its size; cosine and density by a few u */
        told_mean(label("lamp of radius %.0e, radiance %.0e", r[i], radiance), &s, exact,
                  16 * pt_gamma(1) * exact, 0.005);
    }
    STRESS.x = 0;
}

/* In the corner between a floor and a lit wall of height 1 and width 2, at distance x from it, 1/r^2 grows without
   bound; light is sampled by solid angle, so nothing else does. Exact: Lambert's formula in double. */
static void corners(void)
{
    static const double x[7] = {1, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6};
    int i;
    begin_group("transport");
    for (i = 0; i < 7; i++) {
        const pt_vec3 v[4] = {v3(0, 0, -1), v3(0, 1, -1), v3(0, 1, 1), v3(0, 0, 1)};
        const pt_vec3 p = v3(x[i], 0, 0.25);
        const double exact = pt_irradiance_polygon(1, p, v3(0, 1, 0), v, 4) / (2 * PT_PI);
        pt_scene scene = PT_SCENE_INIT;
        pt_stats s;
        add_floor(&scene, 4);
        pt_add_parallelogram(&scene, v3(0, 0, -1), v3(0, 1, 0), v3(0, 0, 2), lamp(&scene, 1));
        s = floor_radiance(&scene, p, many(200000, 2000), 760);
        STRESS.x = x[i];
        told_mean(label("corner, %.0e from the wall", x[i]), &s, exact, 16 * pt_gamma(1) * exact, 0.01);
    }
    STRESS.x = 0;
}

/* Eight emitters side by side, radiance 1e-9 to 1e9 and beyond: each pixel has its own, to the last digit. */
static void dynamic_range(void)
{
    enum { STEPS = 19 };
    pt_scene scene = PT_SCENE_INIT;
    pt_render_desc desc = pt_render_defaults();
    pt_film film = PT_FILM_INIT;
    double worst = 0;
    int i;
    begin_group("transport");
    for (i = 0; i < STEPS; i++)
        pt_add_parallelogram(&scene, v3(i, 0, -1), v3(1, 0, 0), v3(0, 1, 0), lamp(&scene, pow(10, i - 9)));
    commit(&scene);
    desc.camera = pt_camera_look_at(v3(0.5 * STEPS, 0.5, 9), v3(0.5 * STEPS, 0.5, -1), v3(0, 1, 0),
                                    real(2 * atan(0.05) * 180 / PT_PI));
    desc.width = STEPS;
    desc.height = 1;
    desc.spp = 64;
    desc.threads = 1;
    if (pt_render(&scene, &desc, &film, NULL) == PT_OK)
        for (i = 0; i < STEPS; i++) {
            const double exact = (double)real(pow(10, i - 9));
            worst = fmax(worst, fabs(pt_film_pixel(&film, i, 0).r / exact - 1));
        }
    else
        worst = HUGE_VAL;
    STRESS.nan += (long)film.nonfinite;
    told_error("radiance 1e-9 to 1e9 in one picture", "worst pixel", worst, 0, worst, "rel", 64 * 0x1p-53);
    pt_film_free(&film);
    pt_scene_free(&scene);
}

/* One radiance along a fixed ray, by independent paths. */
static pt_stats radiance_along(const pt_scene *scene, pt_vec3 o, pt_vec3 d, int n, uint64_t seed)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(seed), 0);
    pt_li_options options;
    pt_stats s = PT_STATS_INIT;
    int i;
    memset(&options, 0, sizeof options);
    for (i = 0; i < n; i++) {
        const pt_ray ray = ray_from(o, d);
        pt_li_info info = {0};
        double v;
        pt_sampler_start(&sampler, 0, (uint32_t)i);
        v = pt_li_path(scene, &ray, &sampler, &options, &info).r;
        seen(v);
        pt_stats_add(&s, v);
    }
    return s;
}

#if PTI_HAS_ENVIRONMENT
/* A ball of glass under a sky of radiance 1: from outside it is invisible, from inside, along any ray that can leave,
   radiance is n^2; a ray that starts on it and looks in is inside. Each refraction and reflection rounds weights a few
   times; and roulette, which ends one path in 2^24 where nothing is lost, was not seen to end one, but has raised the
   others by 2^-24 an edge. */
static void glass_balls(void)
{
    static const double ior[5] = {1.0 / 1.5, 1, 1 + 1e-9, 1.5, 2.4};
    int i, k;
    begin_group("transport");
    for (i = 0; i < 5; i++)
        for (k = 0; k < 3; k++) {
            const pt_vec3 o = k == 0 ? v3(0, 0.4, 3) : k == 1 ? v3(0.1, 0, 0.2) : v3(0, 0, 1);
            const pt_vec3 d = k == 0 ? v3(0, 0, -1) : v3(0.2, 0.1, -1);
            const double n = (double)real(ior[i]), exact = k == 0 ? 1 : n * n;
            pt_scene scene = PT_SCENE_INIT;
            pt_stats s;
            pt_set_environment(&scene, grey(1));
            pt_add_sphere(&scene, v3(0, 0, 0), 1,
                          pt_add_material(&scene, pt_material_dielectric(real(ior[i]))));
            commit(&scene);
            s = radiance_along(&scene, o, d, many(2500000, 1000), 770 + (uint64_t)(3 * i + k));
            STRESS.x = n - 1;
            told_mean(label("glass ball, index %.10g, camera %s", ior[i],
                            k == 0   ? "outside"
                            : k == 1 ? "inside"
                                     : "on it"),
                      &s, exact, (256 * pt_gamma(1) + 8 * 0x1p-24) * exact, 0.02);
            pt_scene_free(&scene);
        }
    STRESS.x = 0;
}
#endif

/* A camera behind a one-sided lamp sees none of it; on a wall, exactly, it sees what is in front of it. */
static void odd_cameras(void)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_stats s;
    begin_group("transport");
    pt_add_parallelogram(&scene, v3(-1, -1, 0), v3(2, 0, 0), v3(0, 2, 0),
                         lamp(&scene, 3)); /* shines towards +z */
    pt_add_parallelogram(&scene, v3(-9, -9, 5), v3(0, 18, 0), v3(18, 0, 0), wall(&scene, 0));
    commit(&scene);
    s = radiance_along(&scene, v3(0, 0, -4), v3(0, 0, 1), many(1000, 100), 790);
    told_error("camera behind the lamp", "radiance", s.mean, 0, fabs(s.mean), "abs", 0);
    s = radiance_along(&scene, v3(0.1, 0.2, 0), v3(0, 0, 1), many(1000, 100), 791);
    told_error("camera on the lamp, looking away", "radiance", s.mean, 0, fabs(s.mean), "abs", 0);
    s = radiance_along(&scene, v3(0.1, 0.2, 5), v3(0, 0, -1), many(1000, 100), 792);
    told_error("camera on the wall, looking at the lamp", "radiance", s.mean, 3, fabs(s.mean - 3), "abs", 0);
    pt_scene_free(&scene);
}

/* Densities far beyond what a float holds: the ratio decides, and both weights add up to 1. */
static void far_densities(void)
{
    int i, j;
    double worst = 0, off = 0;
    begin_group("transport");
    for (i = -300; i <= 300; i += 20)
        for (j = -300; j <= 300; j += 20) {
            const double a = pow(10, i), b = pow(10, j), w = pt_mis_weight(a, b, PT_HEURISTIC_POWER);
            const double sum = w + pt_mis_weight(b, a, PT_HEURISTIC_POWER);
            const double exact = i > j ? 1 : i == j ? 0.5 : pow(10, 2 * (i - j)); /* but for 1e-40 */
            seen(w);
            worst = fmax(worst, exact > 1e-300 ? fabs(w / exact - 1) : fabs(w - exact));
            off = fmax(off, fabs(sum - 1));
        }
    told("densities 1e-300 to 1e300", "weight", worst, 0, worst, "rel", 1e-13); /* pow itself: 600 ln 10 u */
    told("densities 1e-300 to 1e300", "sum of both weights", off, 0, off, "abs", 2 * 0x1p-53);
}

/* A thousand million values: the running mean moves by (x - mean) / n, so it cannot drift away; a sum of doubles, as
   the film has them, by at most n u. */
static void long_sums(void)
{
    const double n = many(1000000000, 1000000), x = 0x1.99999ap-4;
    pt_stats s = PT_STATS_INIT;
    double i;
    begin_group("transport");
    for (i = 0; i < n; i++) pt_stats_add(&s, x);
    told_relative("values 0.1f, one after the other", "mean", s.mean, x, 1e-12);
    told_error("values 0.1f, one after the other", "variance", pt_stats_variance(&s), 0,
               pt_stats_variance(&s), "abs", 1e-24);
}

/* The sums of a film: samples one by one in double, 2 n u at the very most, whatever the passes. */
static void film_sums(void)
{
    const uint32_t n = (uint32_t)many(20000000, 20000);
    pt_scene scene = PT_SCENE_INIT;
    pt_render_desc desc = pt_render_defaults();
    pt_film film = PT_FILM_INIT;
    begin_group("transport");
    pt_add_parallelogram(&scene, v3(-1, -1, 0), v3(2, 0, 0), v3(0, 2, 0), lamp(&scene, 0.1));
    commit(&scene);
    desc.camera = pt_camera_look_at(v3(0, 0, 1), v3(0, 0, 0), v3(0, 1, 0), 10);
    desc.width = desc.height = 1;
    desc.spp = n;
    desc.threads = 1;
    desc.sampler = PT_SAMPLER_INDEPENDENT;
    if (pt_render(&scene, &desc, &film, NULL) != PT_OK) STRESS.nan++;
    STRESS.nan += (long)film.nonfinite;
    told_relative(label("film of 1 pixel, %lu samples", (unsigned long)n), "pixel",
                  pt_film_pixel(&film, 0, 0).r, (double)real(0.1), n * 0x1p-53);
    pt_film_free(&film);
    pt_scene_free(&scene);
}

/* ---- random numbers ---------------------------------------------------------------------------------------- */

enum { NEXT_STREAM, NEXT_SEED, SEED_FOR_STREAM, NEXT_SAMPLE, NEXT_DIMENSION, FAR_DIMENSION, NEIGHBOURS };
static const char *const NEIGHBOUR_NAMES[NEIGHBOURS] = {"streams t, t + 1",         "seeds s, s + 1",
                                                        "stream t + 1, seed s + 1", "samples i, i + 1",
                                                        "dimensions d, d + 1",      "dimensions d, d + 64"};

/* Number i of a family and its neighbour: sampler kind, what is next to what. */
static void neighbours(pt_sampler_kind kind, int which, uint32_t i, double u[2])
{
    const uint64_t seed = which == NEXT_SEED || which == SEED_FOR_STREAM ? i : 5;
    const uint64_t stream = which == NEXT_STREAM || which == SEED_FOR_STREAM ? i
                            : which == NEXT_SEED                             ? 3
                                                                             : i / 64;
    const uint32_t index = which == NEXT_SAMPLE ? i % 64 : 11;
    const uint32_t dimension = which >= NEXT_DIMENSION ? i % 64 : 4;
    int k;
    for (k = 0; k < 2; k++) {
        const uint64_t step = (uint64_t)k;
        pt_sampler s = pt_sampler_make(
            kind, pt_test_seed(seed + (which == NEXT_SEED || which == SEED_FOR_STREAM ? step : 0)), 128);
        pt_sampler_start(&s,
                         stream + (which == NEXT_STREAM       ? step
                                   : which == SEED_FOR_STREAM ? 1 - step
                                                              : 0),
                         index + (which == NEXT_SAMPLE ? (uint32_t)k : 0));
        pt_sampler_seek(&s, dimension + (which == NEXT_DIMENSION  ? (uint32_t)k
                                         : which == FAR_DIMENSION ? 64u * (uint32_t)k
                                                                  : 0));
        u[k] = (double)pt_sampler_1d(&s);
    }
}

/* Pairs of neighbours over a grid of 16 x 16 cells, chi-squared with 255 degrees of freedom; the largest number. The
   samples of one stream of Sobol or stratified points are meant to be spread, not independent: they are left out. */
static void no_correlation(void)
{
    static const pt_sampler_kind kinds[3] = {PT_SAMPLER_INDEPENDENT, PT_SAMPLER_SOBOL, PT_SAMPLER_STRATIFIED};
    int k, w, i;
    begin_group("random");
    for (k = 0; k < 3; k++)
        for (w = 0; w < NEIGHBOURS; w++) {
            const int n = many(4000000, 40000);
            double cells[256] = {0}, chi2 = 0, top = 0;
            if (k > 0 && w == NEXT_SAMPLE) continue;
            if (k == 1 && w == NEXT_DIMENSION) continue; /* one net: tested as such elsewhere */
            for (i = 0; i < n; i++) {
                double u[2];
                neighbours(kinds[k], w, (uint32_t)i, u);
                top = fmax(top, fmax(u[0], u[1]));
                cells[16 * (int)(16 * u[0]) + (int)(16 * u[1])]++;
            }
            for (i = 0; i < 256; i++) chi2 += (cells[i] - n / 256.0) * (cells[i] - n / 256.0) / (n / 256.0);
            told(label("%s, %s", pt_sampler_name(kinds[k]), NEIGHBOUR_NAMES[w]), "chi2, 255 df", chi2, 255,
                 pt_chi2_sf(chi2, 255) < pt_test_level() ? HUGE_VAL : 0, "rejected", 0);
            told(label("%s, %s", pt_sampler_name(kinds[k]), NEIGHBOUR_NAMES[w]), "largest number", top, 1,
                 !(top < 1), "below 1", 0);
        }
}

/* All 2^32 words at their top end, and every double just below 1 through each sampler. */
static void never_one(void)
{
    const int n = many(100000000, 100000);
    double top = 0;
    int i, bad = 0;
    begin_group("random");
    for (i = 0; i < n; i++) bad += !(pt_real_from_u32(0xffffffffu - (uint32_t)i) < 1);
    told_count("words from 2^32 - 1 down", "numbers that are 1", bad, n);
    for (i = 0; i < 64; i++) {
        const double u = 1 - ldexp(1, -i), given[2] = {fmin(u, 1 - 0x1p-53), fmin(u, 1 - 0x1p-53)};
        pt_sampler s = pt_sampler_make_given(given, 2);
        const pt_vec2 pair = pt_sampler_2d(&s);
        top = fmax(top, fmax((double)pair.x, (double)pair.y));
    }
    told("doubles just below 1", "largest number", top, 1, !(top < 1), "below 1", 0);
}

/* ---- what is refused ------------------------------------------------------------------------------------------ */

enum {
    BIG_RADIUS,
    NAN_CORNER,
    FAR_CORNER,
    ZERO_RADIUS,
    NO_INDEX,
    BIG_ALBEDO,
    BLACK_IOR,
    INFINITE_LAMP,
    NAN_MAP,
    NO_NORMAL,
    REFUSED
};
static const char *const REFUSED_NAMES[REFUSED] = {
    "sphere of radius 1e30",  "corner that is NaN",        "corner at 1e19",
    "sphere of radius 0",     "index beyond the vertices", "albedo 1.5",
    "index of refraction 0",  "infinite radiance",         "sky of NaN",
    "light without direction"};

static void add_refused(pt_scene *s, int which)
{
    const pt_real nan = (pt_real)(HUGE_VAL - HUGE_VAL);
    const pt_vec3 v[3] = {v3(0, 0, 0), v3(1, 0, 0), v3(0, 1, 0)};
    const uint32_t index[3] = {0, 1, 3};
    const int m = wall(s, which == BIG_ALBEDO ? 1.5 : 0.5);
    pt_material glass = pt_material_dielectric(real(-0.0));
    glass.ior = real(-1);
    switch (which) {
    case BIG_RADIUS:
        pt_add_sphere(s, v[0], real(1e30), m);
        break;
    case NAN_CORNER:
        pt_add_triangle(s, v[0], v[1], pt_v3(0, nan, 0), m);
        break;
    case FAR_CORNER:
        pt_add_triangle(s, v[0], v[1], v3(0, 1e19, 0), m);
        break;
    case ZERO_RADIUS:
        pt_add_sphere(s, v[0], 0, m);
        break;
    case NO_INDEX:
        pt_add_mesh(s, v, NULL, NULL, 3, index, 1, m);
        break;
    case BLACK_IOR:
        pt_add_material(s, glass);
        break;
    case INFINITE_LAMP:
        lamp(s, HUGE_VAL);
        break;
#if PTI_HAS_ENVIRONMENT
    case NAN_MAP:
        pt_set_environment(s, pt_rgb3(nan, 0, 0));
        break;
#else
    case NAN_MAP:
        pt_add_point_light(s, v[0], pt_rgb3(nan, 0, 0));
        break;
#endif
    case NO_NORMAL:
        pt_add_directional_light(s, v[0], grey(1));
        break;
    default:
        break;
    }
}

static void refused(void)
{
    int i;
    begin_group("refused");
    for (i = 0; i < REFUSED; i++) {
        pt_scene scene = PT_SCENE_INIT;
        int ok;
        add_refused(&scene, i);
        ok = pt_commit(&scene) == PT_ERROR_SCENE && strlen(pt_scene_error(&scene)) > 10 &&
             strchr(pt_scene_error(&scene), ' ');
        told(label("%s: \"%s\"", REFUSED_NAMES[i], pt_scene_error(&scene)), "refused with a sentence", ok, 1,
             !ok, "yes", 0);
        pt_scene_free(&scene);
    }
}

/* ---- the twin -------------------------------------------------------------------------------------------------- */

/* Every canonical scene with the same random numbers in both precisions, as 64 means over blocks of its pixels;
   tests/stress_report.c compares them. Here: no contribution is lost. */
static void twin(void)
{
#if PTI_HAS_SCENES
    enum { SIDE = 48, BLOCKS = 8 };
    int count, k, x, y;
    const pt_scene_entry *const all = pt_scenes(&count);
    begin_group("twin");
    for (k = 0; k < count; k++) {
        pt_scene scene = PT_SCENE_INIT;
        pt_render_desc desc = pt_render_defaults();
        pt_film film = PT_FILM_INIT;
        double block[BLOCKS * BLOCKS] = {0};
        int ok = all[k].make(&scene, &desc.camera) == PT_OK;
        desc.width = desc.height = SIDE;
        desc.spp = (uint32_t)many(256, 1);
        desc.sampler = PT_SAMPLER_INDEPENDENT;
        desc.threads = STRESS_LONG ? 2 : 1;
        desc.li.max_edges = 32;
        ok = ok && pt_render(&scene, &desc, &film, NULL) == PT_OK;
        for (y = 0; ok && y < SIDE; y++)
            for (x = 0; x < SIDE; x++) {
                const pt_rgbd c = pt_film_pixel(&film, x, y);
                seen(c.r + c.g + c.b);
                block[BLOCKS * (y * BLOCKS / SIDE) + x * BLOCKS / SIDE] +=
                    pt_luminance(c.r, c.g, c.b) * BLOCKS * BLOCKS / (SIDE * SIDE);
            }
        for (x = 0; STRESS_LONG && x < BLOCKS * BLOCKS; x++)
            printf("twin|%s|%d|%.17g\n", all[k].name, x, block[x]);
        STRESS.nan += (long)film.nonfinite;
        told(all[k].name, "rendered, nothing lost", ok, 1, !ok, "yes", 0);
        pt_film_free(&film);
        pt_scene_free(&scene);
    }
#endif
}

int main(int argc, char **argv)
{
    const double start = pt_wall_seconds();
    pt_test_begin(STRESS_LONG ? "stress" : "test_stress", argc, argv);
    PT_TEST_EXACT(case_rows);
    PT_TEST_EXACT(triangles);
    PT_TEST_EXACT(shared_edges);
    PT_TEST_EXACT(spheres);
    PT_TEST_EXACT(boxes);
    PT_TEST_EXACT(closed_mesh);
    PT_TEST_EXACT(hostile_numbers);
    PT_TEST_EXACT(furnaces);
    PT_TEST_EXACT(lit_furnaces);
#if PTI_HAS_BVH
    PT_TEST_EXACT(trees);
#endif
    PT_TEST_EXACT(bright_furnaces);
    PT_TEST_EXACT(tiny_lamps);
    PT_TEST_EXACT(corners);
    PT_TEST_EXACT(dynamic_range);
#if PTI_HAS_ENVIRONMENT
    PT_TEST_EXACT(glass_balls);
#endif
    PT_TEST_EXACT(odd_cameras);
    PT_TEST_EXACT(far_densities);
    PT_TEST_EXACT(long_sums);
    PT_TEST_EXACT(film_sums);
    PT_TEST_EXACT(no_correlation);
    PT_TEST_EXACT(never_one);
    PT_TEST_EXACT(refused);
    PT_TEST_EXACT(twin);
    begin_group("whole");
    STRESS.clock = start;
    if (STRESS_LONG) told("the suite", "CPU seconds", pt_cpu_seconds(), 0, pt_cpu_seconds(), "s", 1200);
    return pt_test_end();
}
