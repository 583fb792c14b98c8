/* test_geometry.c: rays meet shapes where they should, never leak, never meet the surface they start on; the
   tree finds what a linear search finds ([PT-06], [PT-07], and pt_intersect of [PT-10]). */

#include "pt_cases.h"

static const double infinity = HUGE_VAL;

static double dbl(pt_real x) { return (double)x; }
static pt_real real_max(void)
{
    return sizeof(pt_real) == sizeof(float) ? (pt_real)3.402823466e38 : (pt_real)1.79769313486231e308;
}

static pt_ray ray_of(pt_vec3 o, pt_vec3 d)
{
    pt_ray ray;
    ray.o = o;
    ray.d = d;
    ray.tmax = real_max();
    return ray;
}

/* Vectors of double, for what a test knows better than the header. */
typedef struct vec {
    double x, y, z;
} vec;

static vec vec_of(pt_vec3 a)
{
    vec v;
    v.x = dbl(a.x);
    v.y = dbl(a.y);
    v.z = dbl(a.z);
    return v;
}
static vec vec3(double x, double y, double z)
{
    vec v;
    v.x = x;
    v.y = y;
    v.z = z;
    return v;
}
static vec add(vec a, vec b) { return vec3(a.x + b.x, a.y + b.y, a.z + b.z); }
static vec sub(vec a, vec b) { return vec3(a.x - b.x, a.y - b.y, a.z - b.z); }
static vec scale(vec a, double k) { return vec3(a.x * k, a.y * k, a.z * k); }
static double dot(vec a, vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static vec cross(vec a, vec b)
{
    return vec3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static double length(vec a) { return sqrt(dot(a, a)); }
static vec unit(vec a) { return scale(a, 1 / length(a)); }
static pt_vec3 real3(vec a) { return pt_v3((pt_real)a.x, (pt_real)a.y, (pt_real)a.z); }

static double uniform(pt_pcg32 *rng, double low, double high)
{
    return low + (high - low) * pt_pcg32_double(rng);
}
static vec random_vec(pt_pcg32 *rng, double size)
{
    const double x = uniform(rng, -size, size), y = uniform(rng, -size, size);
    return vec3(x, y, uniform(rng, -size, size));
}
static vec random_direction(pt_pcg32 *rng)
{
    const double z = uniform(rng, -1, 1), phi = uniform(rng, 0, 2 * PT_PI), r = sqrt(1 - z * z);
    return vec3(r * cos(phi), r * sin(phi), z);
}

/* ---------------------------------------------------------------------------------------------------------
   Single shapes: rows decided exactly */

static int must(const pt_case *c) { return pt_case_has(c, "must") || pt_case_has(c, "must64"); }

static void one_sphere(const pt_case *c)
{
    pt_ray ray = ray_of(pt_case_vec3(c->inputs, "o"), pt_case_vec3(c->inputs, "d"));
    const pt_vec3 centre = pt_case_vec3(c->inputs, "c");
    const pt_real radius = (pt_real)pt_case_number(c->inputs, "r");
    const int want = pt_case_number(c->expected, "hit") > 0;
    double t = -1, again = -1, exact;
    const int got = pt_intersect_sphere(&ray, centre, radius, &t);
    pt_check(!got || (t > 0 && t < infinity), c->id, "%s: t = %g", c->variety, t);
    if (!must(c)) return;
    pt_check(got == want, c->id, "%s sphere: hit %d, should be %d", c->variety, got, want);
    if (!got || !want) return;
    exact = pt_case_number(c->expected, "t");
    pt_check(fabs(t - exact) <= pt_case_tolerance(c, 1, "abs"), c->id,
             "%s sphere: t = %.17g, should be %.17g +- %g", c->variety, t, exact,
             pt_case_tolerance(c, 1, "abs"));
    ray.tmax = (pt_real)(exact * (1 - 1e-6));
    pt_check(!pt_intersect_sphere(&ray, centre, radius, &again), c->id, "a sphere beyond tmax is hit");
    ray.tmax = (pt_real)(exact * (1 + 1e-6));
    pt_check(pt_intersect_sphere(&ray, centre, radius, &again) && again == t, c->id,
             "a sphere before tmax is not hit");
}

static void spheres(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0;
    for (; file && pt_case_next(file, "sphere", &c); rows++) one_sphere(&c);
    if (file) fclose(file);
    pt_check(rows == 61, "rows of spheres", "%d", rows);
}

/* A unit sphere from as far as 2^50, by rays that pass its centre at a distance just below and above 1: the
   discriminant b^2 - 4ac has no digit of that left. */
static void far_spheres(void)
{
    static const double pass[4] = {0.5, 0.99951171875, 1.00048828125, 2};
    int e, i, axis;
    for (e = 5; e <= 50; e++)
        for (i = 0; i < 4; i++)
            for (axis = 0; axis < 3; axis++) {
                const double far = ldexp(1, e), exact = far - sqrt(fmax(0, 1 - pass[i] * pass[i]));
                const vec o[3] = {{-far, pass[i], 0}, {0, -far, pass[i]}, {pass[i], 0, -far}};
                const vec d[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
                const pt_ray ray = ray_of(real3(o[axis]), real3(d[axis]));
                double t = 0;
                const int hit = pt_intersect_sphere(&ray, pt_v3(0, 0, 0), 1, &t);
                pt_check(hit == (pass[i] < 1), "far sphere", "distance 2^%d, passing at %g: hit %d", e,
                         pass[i], hit);
                pt_check(!hit || fabs(t - exact) <= 4e-16 * far, "far sphere", "distance 2^%d: t off by %g",
                         e, t - exact);
            }
}

static void one_triangle(const pt_case *c)
{
    const pt_vec3 v[3] = {pt_case_vec3(c->inputs, "v0"), pt_case_vec3(c->inputs, "v1"),
                          pt_case_vec3(c->inputs, "v2")};
    const int want = pt_case_number(c->expected, "hit") > 0;
    const int edge =
        strcmp(c->variety, "vertex") == 0 || strcmp(c->variety, "edge") == 0; /* they count as inside */
    const double exact = pt_case_number(c->expected, "t"), in_t = pt_case_tolerance(c, 1, "abs_t"),
                 in_b = pt_case_tolerance(c, 1, "abs_b");
    pt_ray ray = ray_of(pt_case_vec3(c->inputs, "o"), pt_case_vec3(c->inputs, "d"));
    double t = -1, again = -1, b[2] = {-1, -1}, other[2];
    const int got = pt_intersect_triangle(&ray, v[0], v[1], v[2], &t, b);
    pt_check(!got || (t > 0 && t < infinity && b[0] >= 0 && b[1] >= 0 && b[0] + b[1] <= 1 + 1e-15), c->id,
             "%s triangle: t = %g, weights %g, %g", c->variety, t, b[0], b[1]);
    if (!must(c) && !edge) return;
    pt_check(got == want, c->id, "%s triangle: hit %d, should be %d", c->variety, got, want);
    if (!got || !want) return;
    pt_check(fabs(t - exact) <= in_t, c->id, "%s triangle: t = %.17g, should be %.17g +- %g", c->variety, t,
             exact, in_t);
    pt_check(fabs(b[0] - pt_case_number(c->expected, "b1")) <= in_b &&
                 fabs(b[1] - pt_case_number(c->expected, "b2")) <= in_b,
             c->id, "%s triangle: weights %.17g, %.17g", c->variety, b[0], b[1]);
    ray.tmax = (pt_real)(exact * (1 - 1e-6));
    pt_check(!pt_intersect_triangle(&ray, v[0], v[1], v[2], &again, other), c->id,
             "a triangle beyond tmax is hit");
    ray.tmax = real_max();
    pt_check(pt_intersect_triangle(&ray, v[0], v[2], v[1], &again, other), c->id,
             "a triangle is hit from one side only");
}

static void triangles(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0;
    for (; file && pt_case_next(file, "triangle", &c); rows++) one_triangle(&c);
    if (file) fclose(file);
    pt_check(rows == 55, "rows of triangles", "%d", rows);
}

/* Two triangles that share the edge from a to b: one of them must be hit, whatever the order of corners. */
static void shared_edges(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0;
    for (; file && pt_case_next(file, "tri_pair", &c); rows++) {
        const pt_ray ray = ray_of(pt_case_vec3(c.inputs, "o"), pt_case_vec3(c.inputs, "d"));
        const pt_vec3 a = pt_case_vec3(c.inputs, "a"), b = pt_case_vec3(c.inputs, "b");
        const pt_vec3 p[3] = {a, b, pt_case_vec3(c.inputs, "c")}, q[3] = {b, a, pt_case_vec3(c.inputs, "e")};
        double t, w[2];
        int i, j;
        for (i = 0; i < 6; i++)
            for (j = 0; j < 6; j++) {
                const int di = i < 3 ? 1 : 2, dj = j < 3 ? 1 : 2; /* rotations, both windings */
                pt_check(
                    pt_intersect_triangle(&ray, p[i % 3], p[(i + di) % 3], p[(i + 2 * di) % 3], &t, w) ||
                        pt_intersect_triangle(&ray, q[j % 3], q[(j + dj) % 3], q[(j + 2 * dj) % 3], &t, w),
                    c.id, "the ray leaks through the shared edge");
            }
    }
    if (file) fclose(file);
    pt_check(rows == 16, "rows of shared edges", "%d", rows);
}

static void boxes(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0, wrong_yes = 0;
    for (; file && pt_case_next(file, "box", &c); rows++) {
        const pt_ray ray = ray_of(pt_case_vec3(c.inputs, "o"), pt_case_vec3(c.inputs, "d"));
        const int want = pt_case_number(c.expected, "hit") > 0;
        const int got = pt_intersect_box(&ray, pt_case_vec3(c.inputs, "lo"), pt_case_vec3(c.inputs, "hi"));
        if (want && must(&c)) pt_check(got, c.id, "%s: the box is missed", c.variety);
        if (!want && must(&c) && !pt_case_has(&c, "cons"))
            pt_check(!got, c.id, "%s: an empty box is hit", c.variety);
        wrong_yes += got && !want && must(&c);
    }
    if (file) fclose(file);
    pt_check(rows == 42, "rows of boxes", "%d", rows);
    pt_check(wrong_yes <= 2, "boxes that are hit without need",
             "%d of 8: a bound may be wide, but not so wide", wrong_yes);
}

/* Coordinates are multiples of 2^-10 below 8, so that origin + direction is exactly a point of the box, at
   t = 1: each such box must be reported, flat ones, faces, edges and corners included. */
static double grid(pt_pcg32 *rng) { return (double)((int)(pt_pcg32_next(rng) >> 18) - 8192) / 1024; }

static void random_boxes(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(1), 1);
    const int n = 300000;
    int i, k, missed = 0, beyond = 0;
    for (i = 0; i < n; i++) {
        const double size = ldexp(1, (int)(pt_pcg32_next(&rng) % 81) - 40);
        double o[3], p[3], lo[3], hi[3];
        pt_ray ray;
        for (k = 0; k < 3; k++) {
            const double a = grid(&rng), b = grid(&rng);
            const unsigned how = pt_pcg32_next(&rng) % 8;
            lo[k] = fmin(a, b);
            hi[k] = how == 0 ? lo[k] : fmax(a, b);
            p[k] = how < 3   ? lo[k]
                   : how < 5 ? hi[k]
                             : lo[k] + floor((hi[k] - lo[k]) * 1024 * pt_pcg32_double(&rng)) / 1024;
            o[k] = how == 7 ? p[k] : grid(&rng);
        }
        ray = ray_of(real3(scale(vec3(o[0], o[1], o[2]), size)),
                     real3(scale(vec3(p[0] - o[0], p[1] - o[1], p[2] - o[2]), size)));
        ray.tmax = 1;
        missed += !pt_intersect_box(&ray, real3(scale(vec3(lo[0], lo[1], lo[2]), size)),
                                    real3(scale(vec3(hi[0], hi[1], hi[2]), size)));
        ray.o = real3(
            scale(vec3(o[0] - 1000 * (p[0] - o[0]), o[1] - 1000 * (p[1] - o[1]), o[2] - 1000 * (p[2] - o[2])),
                  size));
        beyond += pt_intersect_box(&ray, real3(scale(vec3(lo[0], lo[1], lo[2]), size)),
                                   real3(scale(vec3(hi[0], hi[1], hi[2]), size))) &&
                  length(vec3(p[0] - o[0], p[1] - o[1], p[2] - o[2])) * 900 > 28;
    }
    pt_check(missed == 0, "a box that holds a point of the ray is hit", "%d of %d missed: see pti_box",
             missed, n);
    pt_check(beyond == 0, "a box beyond tmax is not hit", "%d of %d", beyond, n);
}

static void gammas(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0;
    for (; file && pt_case_next(file, "gamma", &c); rows++) {
        const double exact = pt_case_number(c.expected, sizeof(pt_real) == sizeof(float) ? "g32" : "g64");
        const double got = pt_gamma((int)pt_case_integer(c.inputs, "n"));
        pt_check(fabs(got / exact - 1) < 1e-14, c.id, "%.17g, should be %.17g", got, exact);
    }
    if (file) fclose(file);
    pt_check(rows == 7, "rows of gamma", "%d", rows);
}

static void bad_numbers(void)
{
    const pt_real nan = (pt_real)(infinity - infinity), inf = (pt_real)infinity;
    const pt_vec3 bad[4] = {pt_v3(nan, 0, 0), pt_v3(0, inf, 0), pt_v3(0, 0, -inf), pt_v3(nan, nan, nan)};
    const pt_vec3 fine = pt_v3(0, 0, 5), down = pt_v3(0, 0, -1);
    double t, b[2];
    int i;
    for (i = 0; i < 4; i++) {
        const pt_ray from = ray_of(bad[i], down), into = ray_of(fine, bad[i]), good = ray_of(fine, down);
        pt_check(!pt_intersect_sphere(&from, pt_v3(0, 0, 0), 1, &t) &&
                     !pt_intersect_triangle(&from, pt_v3(-1, -1, 0), pt_v3(1, -1, 0), pt_v3(0, 1, 0), &t, b),
                 "a ray from nowhere misses", "origin %d", i);
        if (i == 0 || i == 3)
            pt_check(
                !pt_intersect_sphere(&into, pt_v3(0, 0, 0), 1, &t) &&
                    !pt_intersect_triangle(&into, pt_v3(-1, -1, 0), pt_v3(1, -1, 0), pt_v3(0, 1, 0), &t, b),
                "a ray into nowhere misses", "direction %d", i);
        pt_check(!pt_intersect_sphere(&good, bad[i], 1, &t), "a sphere nowhere is missed", "centre %d", i);
    }
    {
        const pt_ray good = ray_of(fine, down);
        pt_check(!pt_intersect_sphere(&good, pt_v3(0, 0, 0), -1, &t) &&
                     !pt_intersect_sphere(&good, pt_v3(0, 0, 0), nan, &t),
                 "a sphere without radius is missed",
                 "with r = 0 the discriminant is rounding noise: such a sphere must never be met");
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Scenes */

/* A ball of triangles: each step splits every face of an icosahedron into four. */
typedef struct ball {
    pt_vec3 *positions;
    uint32_t *indices;
    uint32_t vertices, triangles;
} ball;

static uint32_t middle(const vec *v, vec *out, uint32_t *count, uint32_t a, uint32_t b)
{
    const vec m = unit(add(v[a], v[b]));
    uint32_t i;
    for (i = 0; i < *count; i++)
        if (length(sub(out[i], m)) < 1e-9) return i;
    out[*count] = m;
    return (*count)++;
}

static ball make_ball(int steps, vec centre, double radius)
{
    static const unsigned char face[20][3] = {{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                              {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                              {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                              {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
    const double g = 0.5 + sqrt(1.25);
    const vec corner[12] = {vec3(-1, g, 0), vec3(1, g, 0), vec3(-1, -g, 0), vec3(1, -g, 0),
                            vec3(0, -1, g), vec3(0, 1, g), vec3(0, -1, -g), vec3(0, 1, -g),
                            vec3(g, 0, -1), vec3(g, 0, 1), vec3(-g, 0, -1), vec3(-g, 0, 1)};
    static vec v[3000];
    static uint32_t now[6000][3], next[6000][3];
    uint32_t faces = 20, count = 12, i, k;
    ball b;
    for (i = 0; i < 12; i++) v[i] = unit(corner[i]);
    for (i = 0; i < 20; i++)
        for (k = 0; k < 3; k++) now[i][k] = face[i][k];
    for (; steps > 0; steps--) {
        for (i = 0; i < faces; i++) {
            const uint32_t *const f = now[i];
            const uint32_t ab = middle(v, v, &count, f[0], f[1]), bc = middle(v, v, &count, f[1], f[2]),
                           ca = middle(v, v, &count, f[2], f[0]);
            const uint32_t four[4][3] = {{f[0], ab, ca}, {ab, f[1], bc}, {ca, bc, f[2]}, {ab, bc, ca}};
            memcpy(next[4 * i], four, sizeof four);
        }
        faces *= 4;
        memcpy(now, next, faces * sizeof now[0]);
    }
    b.vertices = count;
    b.triangles = faces;
    b.positions = (pt_vec3 *)malloc(count * sizeof *b.positions);
    b.indices = (uint32_t *)malloc(3 * faces * sizeof *b.indices);
    for (i = 0; i < count && b.positions; i++) b.positions[i] = real3(add(centre, scale(v[i], radius)));
    for (i = 0; i < 3 * faces && b.indices; i++) b.indices[i] = now[i / 3][i % 3];
    return b;
}

static void free_ball(ball *b)
{
    free(b->positions);
    free(b->indices);
}

static int commit(pt_scene *scene)
{
    const pt_result r = pt_commit(scene);
    pt_check(r == PT_OK, "pt_commit", "%s", pt_scene_error(scene));
    return r == PT_OK;
}

/* From inside a closed ball every ray must meet it, aimed at corners and edges too. */
static void no_leaks(void)
{
    static const double size[5] = {1, 1e-4, 1e5, 1, 1}, offset[5] = {0, 0, 0, 100, 3000};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(2), 2);
    int c, i, n = (int)pt_test_samples(40000);
    for (c = 0; c < 5; c++) {
        const vec centre = vec3(offset[c], -offset[c], 0.5 * offset[c]);
        ball b = make_ball(3, centre, size[c]);
        pt_scene scene = PT_SCENE_INIT;
        const int material = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey((pt_real)0.5)));
        int leaks = 0, blind = 0;
        pt_add_mesh(&scene, b.positions, NULL, NULL, b.vertices, b.indices, b.triangles, material);
        if (commit(&scene))
            for (i = 0; i < n; i++) {
                const uint32_t *const f = b.indices + 3 * (pt_pcg32_next(&rng) % b.triangles);
                const vec from = add(centre, random_vec(&rng, 0.3 * size[c])), p = vec_of(b.positions[f[0]]),
                          q = vec_of(b.positions[f[1]]);
                const vec aim = i % 3 == 0   ? p
                                : i % 3 == 1 ? add(p, scale(sub(q, p), pt_pcg32_double(&rng)))
                                             : add(from, random_direction(&rng));
                const pt_vec3 o = real3(from);
                const pt_ray ray = ray_of(o, real3(sub(aim, vec_of(o))));
                pt_hit hit;
                leaks += !pt_intersect(&scene, &ray, &hit);
                blind += !pt_occluded(&scene, &ray);
            }
        pt_check(leaks == 0 && blind == 0, "a closed mesh does not leak",
                 "%d of %d rays escape, size %g, offset %g", leaks, n, size[c], offset[c]);
        pt_scene_free(&scene);
        free_ball(&b);
    }
}

/* A shape of `size` at `centre` in an otherwise empty scene. */
typedef enum kind { SPHERE, TRIANGLE, PARALLELOGRAM, RECTANGLE, QUAD, CUBE, KINDS } kind;
static const char *const kind_names[KINDS] = {
    "sphere", "triangle", "parallelogram", "rectangle along the axes", "quad along the axes", "cube"};

/* Two edges that are aslant to all axes. */
static const vec edge1 = {0.9, 0.35, -0.2}, edge2 = {-0.3, 0.8, 0.45};

static void add_cube(pt_scene *scene, vec centre, double size, int material)
{
    static const uint32_t index[36] = {0, 3, 1, 0, 2, 3, 4, 7, 6, 4, 5, 7, 0, 5, 4, 0, 1, 5, /* ng outwards */
                                       2, 7, 3, 2, 6, 7, 0, 6, 2, 0, 4, 6, 1, 7, 5, 1, 3, 7};
    const vec edge3 = cross(edge1, edge2);
    pt_vec3 v[8];
    int i;
    for (i = 0; i < 8; i++)
        v[i] = real3(add(centre, scale(add(scale(edge1, i & 1 ? 1 : -1),
                                           add(scale(edge2, i & 2 ? 1 : -1), scale(edge3, i & 4 ? 1 : -1))),
                                       size)));
    pt_add_mesh(scene, v, NULL, NULL, 8, index, 12, material);
}

static int make_shape(pt_scene *scene, kind k, vec centre, double size)
{
    const int m = pt_add_material(scene, pt_material_diffuse(pt_rgb_grey((pt_real)0.5)));
    const vec corner = sub(centre, scale(add(edge1, edge2), size));
    const vec flat = sub(centre, vec3(size, 0, size));
    if (k == SPHERE) pt_add_sphere(scene, real3(centre), (pt_real)size, m);
    if (k == TRIANGLE)
        pt_add_triangle(scene, real3(corner), real3(add(corner, scale(edge1, 3 * size))),
                        real3(add(corner, scale(edge2, 3 * size))), m);
    if (k == PARALLELOGRAM)
        pt_add_parallelogram(scene, real3(corner), real3(scale(edge1, 2 * size)),
                             real3(scale(edge2, 2 * size)), m);
    if (k == RECTANGLE)
        pt_add_parallelogram(scene, real3(flat), pt_v3((pt_real)(2 * size), 0, 0),
                             pt_v3(0, 0, (pt_real)(2 * size)), m);
    if (k == QUAD)
        pt_add_quad(scene, real3(flat), real3(add(flat, vec3(0, 0, 2 * size))),
                    real3(add(flat, vec3(2 * size, 0, 2 * size))), real3(add(flat, vec3(2 * size, 0, 0))), m);
    if (k == CUBE) add_cube(scene, centre, size, m);
    return commit(scene);
}

/* How far p is from the plane through three points. */
static double off_plane(vec p, pt_vec3 a, pt_vec3 b, pt_vec3 c)
{
    const vec o = vec_of(a);
    return fabs(dot(sub(p, o), unit(cross(sub(vec_of(b), o), sub(vec_of(c), o)))));
}

/* How far p is from the surface of the primitive, in double from its stored numbers. A parallelogram is two
   triangles whose corners are sums rounded to pt_real. */
static double off_surface(const pt_scene *scene, const pt_hit *hit, vec p)
{
    const uint32_t index = scene->primitives[hit->primitive].index;
    if (hit->shape == PT_SHAPE_SPHERE) {
        const pt_sphere *const s = &scene->spheres[index];
        return fabs(length(sub(p, vec_of(s->centre))) - dbl(s->radius));
    }
    if (hit->shape == PT_SHAPE_TRIANGLE) {
        const uint32_t *const v = scene->triangles[index].v;
        return off_plane(p, scene->positions[v[0]], scene->positions[v[1]], scene->positions[v[2]]);
    } else {
        const pt_parallelogram *const s = &scene->parallelograms[index];
        const pt_vec3 v1 = pt_v3_add(s->corner, s->edge1), v2 = pt_v3_add(v1, s->edge2),
                      v3 = pt_v3_add(s->corner, s->edge2);
        return fmin(off_plane(p, s->corner, v1, v2), off_plane(p, s->corner, v2, v3));
    }
}

static double error_along(const pt_hit *hit)
{
    return fabs(dbl(hit->ng.x)) * dbl(hit->p_error.x) + fabs(dbl(hit->ng.y)) * dbl(hit->p_error.y) +
           fabs(dbl(hit->ng.z)) * dbl(hit->p_error.z);
}

/* What went wrong around one shape. */
typedef struct tally {
    int hits, off, far_off, wrong_side, rehit, lost;
} tally;

/* Distance from the edges of a triangle in units of its size: nearer than the rounding of p, a ray inwards
   may start beyond the next face. */
static double from_edge(const pt_hit *hit)
{
    return fmin(1 - dbl(hit->u) - dbl(hit->v), fmin(dbl(hit->u), dbl(hit->v)));
}

/* One hit of the shape: is the point where it says; do rays that leave it stay away? */
static void leave(const pt_scene *scene, const pt_ray *ray, pt_pcg32 *rng, kind k, double size, tally *sum)
{
    pt_hit hit, next;
    pt_ray out;
    vec n, w;
    double cosine;
    int side, again;
    if (!pt_intersect(scene, ray, &hit)) return;
    sum->hits++;
    n = vec_of(hit.ng);
    /* ng is rounded itself: on top of the bound comes |p - corner| times its error */
    sum->off += off_surface(scene, &hit, vec_of(hit.p)) > error_along(&hit) * 1.000001 + 1e-15 * size;
    sum->far_off += error_along(&hit) > (sizeof(pt_real) == sizeof(float) ? 8 : 128) * pt_gamma(1) *
                                            (length(vec_of(hit.p)) + 4 * size);
    for (side = 1; side >= -1; side -= 2) {
        w = random_direction(rng);
        if (dot(w, n) * side < 0) w = scale(w, -1);
        if (pt_pcg32_next(rng) & 1)
            w = unit(add(scale(n, side * pow(10, -uniform(rng, 0, 4))), sub(w, scale(n, dot(w, n)))));
        cosine = dot(vec_of(real3(w)), n);
        if (cosine * side <= 0) continue; /* the rounding of w or n decided otherwise */
        out = pt_spawn_ray(hit.p, hit.p_error, hit.ng, real3(w));
        sum->wrong_side += dot(sub(vec_of(out.o), vec_of(hit.p)), n) * side < 0;
        again = pt_intersect(scene, &out, &next);
        if (k == SPHERE && side < 0) { /* across the ball: to a distance of 2 r cos */
            sum->lost += !again;
            sum->rehit += again && dbl(next.t) < -cosine * size;
        } else if (k == CUBE && side < 0) { /* out through another face */
            sum->lost += !again && from_edge(&hit) * size > 16 * pt_gamma(1) * length(vec_of(hit.p));
            sum->rehit += again && next.primitive == hit.primitive;
        } else {
            sum->rehit += again;
        }
    }
}

/* The starting table of ray tracing's oldest bug: shapes from 1e-4 to 1e6, at the origin and far from it. */
static void no_self_hits(void)
{
    static const double sizes[6] = {1e-4, 1e-2, 1, 100, 1e4, 1e6}, offsets[3] = {0, 100, 1e4};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(3), 3);
    const int n = (int)pt_test_samples(6000);
    int k, s, o, i;
    for (k = 0; k < KINDS; k++)
        for (s = 0; s < 6; s++)
            for (o = 0; o < 3; o++) {
                const double size = sizes[s];
                const vec centre = scale(vec3(1, -0.7, 0.4), offsets[o] * size);
                pt_scene scene = PT_SCENE_INIT;
                tally sum = {0, 0, 0, 0, 0, 0};
                if (make_shape(&scene, (kind)k, centre, size))
                    for (i = 0; i < n; i++) {
                        const pt_vec3 from = real3(add(centre, scale(random_direction(&rng), 3 * size)));
                        const vec aim = add(centre, random_vec(&rng, 0.6 * size));
                        const pt_ray ray = ray_of(from, real3(unit(sub(aim, vec_of(from)))));
                        leave(&scene, &ray, &rng, (kind)k, size, &sum);
                    }
                pt_check(sum.hits > n / 20, kind_names[k], "only %d of %d rays hit: the test is empty",
                         sum.hits, n);
                pt_check(sum.off == 0, kind_names[k],
                         "size %g, offset %g sizes: %d of %d points are off by more than p_error", size,
                         offsets[o], sum.off, sum.hits);
                pt_check(sum.far_off == 0, kind_names[k],
                         "size %g, offset %g sizes: p_error is larger than rounding can be", size,
                         offsets[o]);
                pt_check(sum.wrong_side == 0, kind_names[k],
                         "size %g, offset %g sizes: %d rays start on the wrong side", size, offsets[o],
                         sum.wrong_side);
                pt_check(
                    sum.rehit == 0 && sum.lost == 0, kind_names[k],
                    "size %g, offset %g sizes: of %d hits %d rays meet their own surface again, %d are lost",
                    size, offsets[o], sum.hits, sum.rehit, sum.lost);
                pt_scene_free(&scene);
            }
}

/* Everything that a hit says, where it is easy to know: a ray down onto shapes above the plane y = 0. */
static void what_a_hit_says(void)
{
    pt_scene scene = PT_SCENE_INIT;
    const int a = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey((pt_real)0.5)));
    const int b = pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(1)));
    pt_ray ray;
    pt_hit hit;
    pt_add_sphere(&scene, pt_v3(10, 1, 0), 2, b);
    pt_add_parallelogram(&scene, pt_v3(0, 1, 0), pt_v3(0, 0, 4), pt_v3(2, 0, 1), a);
    pt_add_triangle(&scene, pt_v3(20, 1, 0), pt_v3(20, 1, 4), pt_v3(24, 1, 0), b);
    pt_add_quad(&scene, pt_v3(30, 1, 0), pt_v3(30, 1, 4), pt_v3(34, 1, 4), pt_v3(34, 1, 0), a);
    if (!commit(&scene)) return;
    ray = ray_of(pt_v3(10, 9, 0), pt_v3(0, -2, 0));
    pt_check(pt_intersect(&scene, &ray, &hit) && hit.shape == PT_SHAPE_SPHERE && hit.material == b &&
                 hit.light >= 0,
             "sphere from above", "shape, material, light");
    pt_check(dbl(hit.t) == 3 && dbl(hit.p.y) == 3 && dbl(hit.ng.y) == 1 && dbl(hit.ns.y) == 1,
             "sphere from above", "t counts in units of d");
    ray = ray_of(pt_v3(10, 1, 0), pt_v3(0, -1, 0));
    pt_check(pt_intersect(&scene, &ray, &hit) && dbl(hit.ng.y) == -1 && dbl(hit.t) == 2, "sphere from inside",
             "ng points away from the centre");
    ray = ray_of(pt_v3((pt_real)0.5, -3, (pt_real)1.25), pt_v3(0, 1, 0));
    pt_check(pt_intersect(&scene, &ray, &hit) && hit.shape == PT_SHAPE_PARALLELOGRAM && hit.light < 0 &&
                 dbl(hit.ng.y) == 1,
             "parallelogram from below", "ng is edge1 x edge2, not turned to the ray");
    pt_check(fabs(dbl(hit.u) - 0.25) < 1e-6 && fabs(dbl(hit.v) - 0.25) < 1e-6 && hit.uv.x == hit.u &&
                 hit.uv.y == hit.v,
             "parallelogram from below", "u, v = %g, %g: the weights of the edges", dbl(hit.u), dbl(hit.v));
    ray = ray_of(pt_v3((pt_real)1.5, -3, (pt_real)3.75), pt_v3(0, 1, 0));
    pt_check(pt_intersect(&scene, &ray, &hit) && fabs(dbl(hit.u) - 0.75) < 1e-6 &&
                 fabs(dbl(hit.v) - 0.75) < 1e-6,
             "its other half", "u, v = %g, %g: the weights of the edges", dbl(hit.u), dbl(hit.v));
    ray = ray_of(pt_v3(22, 9, 1), pt_v3(0, -1, 0));
    pt_check(pt_intersect(&scene, &ray, &hit) && hit.shape == PT_SHAPE_TRIANGLE && dbl(hit.ng.y) == 1 &&
                 hit.material == b,
             "triangle", "ng is (v1-v0)x(v2-v0)");
    pt_check(fabs(dbl(hit.u) - 0.25) < 1e-6 && fabs(dbl(hit.v) - 0.5) < 1e-6, "triangle",
             "u, v = %g, %g: weights of corners 2 and 3", dbl(hit.u), dbl(hit.v));
    ray = ray_of(pt_v3(31, 9, 3), pt_v3(0, -1, 0));
    pt_check(pt_intersect(&scene, &ray, &hit) && pt_occluded(&scene, &ray), "first triangle of a quad",
             "missed");
    ray.o = pt_v3(33, 9, 1);
    pt_check(pt_intersect(&scene, &ray, &hit) && pt_occluded(&scene, &ray), "second triangle of a quad",
             "missed");
    ray.tmax = 8;
    pt_check(!pt_intersect(&scene, &ray, &hit) && !pt_occluded(&scene, &ray), "tmax itself is excluded",
             "a hit at t = tmax");
    pt_scene_free(&scene);
}

/* A mesh with normals and texture coordinates; the second corner's normal points the wrong way. */
static void shading_normals(void)
{
    const pt_vec3 p[3] = {pt_v3(0, 0, 0), pt_v3(0, 0, 1), pt_v3(1, 0, 0)};
    const pt_vec3 tilted[3] = {pt_v3(1, 5, 0), pt_v3(0, 2, 0), pt_v3(0, 3, 3)},
                  down[3] = {pt_v3(0, -1, 0), pt_v3(0, -1, 0), pt_v3(1, -1, 0)},
                  cancel[3] = {pt_v3(0, 1, 0), pt_v3(0, -1, 0), pt_v3(0, 1, 0)};
    const pt_vec2 uv[3] = {pt_v2(0, 0), pt_v2(0, 8), pt_v2(4, 0)};
    const uint32_t index[3] = {0, 1, 2};
    const pt_ray ray = ray_of(pt_v3((pt_real)0.5, 1, (pt_real)0.25), pt_v3(0, -1, 0));
    const pt_vec3 *const normals[3] = {tilted, down, cancel};
    int i;
    for (i = 0; i < 3; i++) {
        pt_scene scene = PT_SCENE_INIT;
        const int m = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(1)));
        pt_ray edge = ray_of(pt_v3(0, 1, (pt_real)0.5), pt_v3(0, -1, 0));
        pt_hit hit;
        vec want;
        /* another mesh first, so that offsets matter */
        pt_add_triangle(&scene, pt_v3(0, -9, 0), pt_v3(0, -9, 1), pt_v3(1, -9, 0), m);
        pt_add_mesh(&scene, p, normals[2 - i], NULL, 3, index, 0, m);
        pt_add_mesh(&scene, p, normals[i], i < 2 ? uv : NULL, 3, index, 1, m);
        if (!commit(&scene)) return;
        pt_check(pt_intersect(&scene, &ray, &hit), "mesh with normals", "missed");
        want = add(scale(vec_of(normals[i][0]), 0.25),
                   add(scale(vec_of(normals[i][1]), 0.25), scale(vec_of(normals[i][2]), 0.5)));
        if (want.y < 0) want = scale(want, -1);
        pt_check(length(sub(vec_of(hit.ns), unit(want))) < 8 * pt_gamma(1), "shading normal",
                 "case %d: (%g, %g, %g)", i, dbl(hit.ns.x), dbl(hit.ns.y), dbl(hit.ns.z));
        pt_check(dbl(pt_v3_dot(hit.ns, hit.ng)) > 0 && dbl(hit.ng.y) == 1, "shading normal",
                 "must be on the side of ng");
        pt_check(i == 2 || (fabs(dbl(hit.uv.x) - 2) < 1e-6 && fabs(dbl(hit.uv.y) - 2) < 1e-6),
                 "texture coordinates", "(%g, %g)", dbl(hit.uv.x), dbl(hit.uv.y));
        if (i == 2) {
            pt_check(pt_intersect(&scene, &edge, &hit) && dbl(hit.ns.y) == 1, "normals that cancel",
                     "leave the geometric one");
            pt_check(hit.uv.x == hit.u && hit.uv.y == hit.v, "no texture coordinates",
                     "then the weights stand in");
        }
        pt_scene_free(&scene);
    }
}

typedef enum lamp_kind { LAMP_SPHERE, LAMP_TRIANGLE, LAMP_PARALLELOGRAM, LAMP_POINT, LAMPS } lamp_kind;
static const char *const lamp_names[LAMPS] = {"shadow rays to a sphere", "shadow rays to a triangle",
                                              "shadow rays to a parallelogram", "shadow rays to a point"};

/* An aslant floor, and a lamp above it. */
static int make_floor_and_lamp(pt_scene *scene, lamp_kind k, vec at, double size)
{
    const int white = pt_add_material(scene, pt_material_diffuse(pt_rgb_grey(1)));
    const int lamp = pt_add_material(scene, pt_material_emitter(pt_rgb_grey(1)));
    const vec corner = sub(at, scale(add(edge1, edge2), 2 * size)),
              l = add(at, scale(vec3(0.4, 1.7, -0.3), size));
    const pt_vec3 e1 = real3(scale(edge1, size)), e2 = real3(scale(edge2, size));
    pt_add_parallelogram(scene, real3(corner), real3(scale(edge2, 4 * size)), real3(scale(edge1, 4 * size)),
                         white);
    if (k == LAMP_SPHERE) pt_add_sphere(scene, real3(l), (pt_real)(0.3 * size), lamp);
    if (k == LAMP_TRIANGLE)
        pt_add_triangle(scene, real3(l), real3(add(l, scale(edge1, size))), real3(add(l, scale(edge2, size))),
                        lamp);
    if (k == LAMP_PARALLELOGRAM) pt_add_parallelogram(scene, real3(l), e1, e2, lamp);
    if (k == LAMP_POINT) pt_add_point_light(scene, real3(l), pt_rgb_grey(1));
    return commit(scene);
}

/* Asks from a random point of the floor; 0 if the ray to it met nothing, or the lamp. */
static int ask_for_light(const pt_scene *scene, pt_pcg32 *rng, vec at, double size, pt_ray *shadow)
{
    const double a = uniform(rng, -2, 2), b = uniform(rng, -2, 2);
    const vec aim = add(at, scale(add(scale(edge1, a), scale(edge2, b)), size));
    const pt_vec3 from = real3(add(at, scale(random_direction(rng), 8 * size)));
    const pt_ray ray = ray_of(from, real3(unit(sub(aim, vec_of(from)))));
    pt_light_sample_result ls;
    pt_hit hit;
    pt_vec2 u;
    u.x = pt_real_from_u32(pt_pcg32_next(rng));
    u.y = pt_real_from_u32(pt_pcg32_next(rng));
    if (!pt_intersect(scene, &ray, &hit) || hit.light >= 0) return 0;
    if (!pt_light_sample(scene, 0, hit.p, u, &ls)) return 0;
    *shadow = pt_spawn_ray_to(hit.p, hit.p_error, hit.ng, ls.p, ls.p_error, ls.n);
    return 1;
}

/* Nothing is between a floor and lamps of all sizes, so nothing may occlude. A ray a little longer meets the
   lamp itself (unless it grazes a rim): it ended at the lamp, not before. */
/* What stands before the end of a shadow ray shadows, by however little, near and far; at its end it does not. */
static void before_the_end(void)
{
    int k, i;
    for (k = -6; k <= 6; k++)
        for (i = 0; i < 2; i++) {
            const double d = pow(10, k), gap = 1e-5 * d;
            pt_scene scene = PT_SCENE_INIT;
            const int white = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey((pt_real)0.5)));
            const pt_ray ray = {real3(vec3(0, 0, 0)), real3(vec3(d, 0, 0)), 1};
            if (i == 0) pt_add_sphere(&scene, real3(vec3(d - gap - 0.01 * d, 0, 0)), (pt_real)(0.01 * d), white);
            else
                pt_add_triangle(&scene, real3(vec3(d - gap, -d, -d)), real3(vec3(d - gap, 2 * d, -d)),
                                real3(vec3(d - gap, -d, 2 * d)), white);
            pt_check(pt_commit(&scene) == PT_OK && pt_occluded(&scene, &ray), "just before the end",
                     "distance 1e%d: %s does not shadow", k, i ? "a triangle" : "a sphere");
            pt_scene_free(&scene);
        }
}

static void shadow_rays(void)
{
    static const double sizes[7] = {1e-3, 0.03, 1, 30, 1e3, 1e5, 1e6}, offsets[3] = {0, 25, 100};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(4), 4);
    const int n = (int)pt_test_samples(1500);
    int k, s, o, i;
    for (k = 0; k < LAMPS; k++)
        for (s = 0; s < 7; s++)
            for (o = 0; o < 3; o++) {
                const vec at = scale(vec3(1, -0.7, 0.4), offsets[o] * sizes[s]);
                pt_scene scene = PT_SCENE_INIT;
                int blocked = 0, open = 0, asked = 0;
                pt_ray shadow;
                if (make_floor_and_lamp(&scene, (lamp_kind)k, at, sizes[s]))
                    for (i = 0; i < n; i++) {
                        if (!ask_for_light(&scene, &rng, at, sizes[s], &shadow)) continue;
                        asked++;
                        blocked += pt_occluded(&scene, &shadow);
                        shadow.tmax = (pt_real)1.001;
                        open += !pt_occluded(&scene, &shadow);
                    }
                pt_check(asked > n / 8, lamp_names[k], "only %d of %d asked: the test is empty", asked, n);
                pt_check(blocked == 0, lamp_names[k], "size %g, offset %g sizes: %d of %d blocked by nothing",
                         sizes[s], offsets[o], blocked, asked);
                pt_check(k == LAMP_POINT || open * 50 < asked, lamp_names[k],
                         "size %g, offset %g sizes: %d of %d end before the lamp", sizes[s], offsets[o], open,
                         asked);
                pt_scene_free(&scene);
            }
}

/* Two plates close together: rays that leave the one towards the other always meet it. */
static void thin_gaps(void)
{
    static const double offsets[3] = {0, 10, 1000};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(5), 5);
    const vec n = unit(cross(edge1, edge2));
    const int rays = (int)pt_test_samples(20000);
    int o, i;
    for (o = 0; o < 3; o++) {
        const double gap = fmax(1e-3, 128 * pt_gamma(1) * offsets[o]);
        const vec at = vec3(offsets[o], -0.7 * offsets[o], 0.4 * offsets[o]),
                  corner = sub(at, add(edge1, edge2));
        pt_scene scene = PT_SCENE_INIT;
        const int m = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(1)));
        int leaks = 0, hits = 0;
        pt_add_parallelogram(&scene, real3(corner), real3(scale(edge1, 2)), real3(scale(edge2, 2)), m);
        pt_add_parallelogram(&scene, real3(sub(corner, scale(n, gap))), real3(scale(edge1, 2)),
                             real3(scale(edge2, 2)), m);
        if (commit(&scene))
            for (i = 0; i < rays; i++) {
                const double a = uniform(&rng, -0.5, 0.5), b = uniform(&rng, -0.5, 0.5);
                const vec aim = add(at, add(scale(edge1, a), scale(edge2, b)));
                const pt_vec3 from = real3(add(aim, scale(n, 2)));
                const pt_ray ray = ray_of(from, real3(sub(aim, vec_of(from))));
                pt_hit hit, second;
                pt_ray down;
                if (!pt_intersect(&scene, &ray, &hit)) continue;
                hits++;
                down = pt_spawn_ray(hit.p, hit.p_error, hit.ng,
                                    real3(unit(add(scale(n, -1), scale(random_direction(&rng), 0.5)))));
                leaks += hit.primitive != 0 || !pt_intersect(&scene, &down, &second) || second.primitive != 1;
            }
        pt_check(hits > rays / 2 && leaks == 0, "two plates close together",
                 "gap %g: %d of %d rays pass the second", gap, leaks, hits);
        pt_scene_free(&scene);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   The tree */

/* The nearest primitive by asking all of them; equal distances go to the first. */
static int linear(const pt_scene *scene, const pt_ray *ray, double *t)
{
    int best = -1;
    uint32_t i;
    *t = dbl(ray->tmax);
    for (i = 0; i < scene->primitive_count; i++) {
        const pt_primitive *const p = &scene->primitives[i];
        double here, b[2];
        int hit = 0;
        if (p->shape == PT_SHAPE_SPHERE)
            hit = pt_intersect_sphere(ray, scene->spheres[p->index].centre, scene->spheres[p->index].radius,
                                      &here);
        if (p->shape == PT_SHAPE_TRIANGLE) {
            const uint32_t *const v = scene->triangles[p->index].v;
            hit = pt_intersect_triangle(ray, scene->positions[v[0]], scene->positions[v[1]],
                                        scene->positions[v[2]], &here, b);
        }
        if (hit && here < *t) {
            *t = here;
            best = (int)i;
        }
    }
    return best;
}

#if PTI_HAS_BVH
/* Depth of the tree below a node; -1 if a box does not hold what is in it, a primitive is met
   twice, or a leaf has more than eight. */
static int check_node(const pt_bvh *bvh, uint32_t node, const pt_vec3 *lo, const pt_vec3 *hi,
                      unsigned char *seen, int depth)
{
    const pt_bvh_node *const n = &bvh->nodes[node];
    uint32_t i;
    int deepest = depth, child;
    if (depth > PT_BVH_MAX_DEPTH || node >= bvh->node_count || n->count > 8) return -1;
    for (i = 0; n->count > 0 && i < n->count; i++) {
        const uint32_t p = bvh->order[n->first + i];
        if (p >= bvh->primitive_count || seen[p]++) return -1;
        if (lo[p].x < n->lo.x || lo[p].y < n->lo.y || lo[p].z < n->lo.z || hi[p].x > n->hi.x ||
            hi[p].y > n->hi.y || hi[p].z > n->hi.z)
            return -1;
    }
    for (i = 0; n->count == 0 && i < 2; i++) {
        const pt_bvh_node *const c = &bvh->nodes[n->first + i];
        child = check_node(bvh, n->first + i, lo, hi, seen, depth + 1);
        if (child < 0 || c->lo.x < n->lo.x || c->lo.y < n->lo.y || c->lo.z < n->lo.z || c->hi.x > n->hi.x ||
            c->hi.y > n->hi.y || c->hi.z > n->hi.z)
            return -1;
        if (child > deepest) deepest = child;
    }
    return deepest;
}

/* Builds over boxes and checks the structure. most: how deep it may be. */
static void one_tree(const char *name, const pt_vec3 *lo, const pt_vec3 *hi, uint32_t count, int most)
{
    unsigned char *const seen = (unsigned char *)calloc(count + 1, 1);
    pt_bvh bvh;
    const pt_result r = pt_bvh_build(&bvh, lo, hi, count, NULL);
    uint32_t i, all = 0;
    int depth = 0;
    pt_check(r == PT_OK && seen, name, "%u boxes: result %d", count, (int)r);
    if (r == PT_OK && count > 0 && seen) {
        depth = check_node(&bvh, 0, lo, hi, seen, 0);
        for (i = 0; i < count; i++) all += seen[i];
        pt_check(depth >= 0 && all == count, name,
                 "%u boxes: a box that is too small, or %u primitives in the leaves", count, all);
        pt_check(depth == bvh.depth && depth <= most, name, "%u boxes: depth %d, said to be %d, may be %d",
                 count, depth, bvh.depth, most);
    }
    if (count == 0) pt_check(bvh.node_count == 0, name, "an empty tree has no nodes");
    pt_bvh_free(&bvh, NULL);
    free(seen);
}

/* What a split of the node's boxes costs: half areas times counts, left and right of plane `bin` (of 15) of an
   axis, in units of the half area of all; HUGE_VAL if all are on one side. `left` gets their number. */
enum { SPLIT_BINS = 16, SPLIT_MOST = 600 };

typedef struct split_boxes {
    const pt_vec3 *lo, *hi;
    const uint32_t *order; /* of the node's primitives */
    uint32_t count;
} split_boxes;

static double coordinate(pt_vec3 v, int axis) { return dbl(axis == 0 ? v.x : axis == 1 ? v.y : v.z); }

static double half_area(const split_boxes *b, const unsigned char *side, int wanted, uint32_t *count)
{
    double low[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, high[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    uint32_t i;
    int k;
    for (*count = i = 0; i < b->count; i++) {
        if (side[i] != wanted) continue;
        ++*count;
        for (k = 0; k < 3; k++) {
            low[k] = fmin(low[k], coordinate(b->lo[b->order[i]], k));
            high[k] = fmax(high[k], coordinate(b->hi[b->order[i]], k));
        }
    }
    for (k = 0; k < 3; k++) high[k] -= low[k];
    return *count ? high[0] * high[1] + high[1] * high[2] + high[2] * high[0] : 0;
}

static double split_cost(const split_boxes *b, int axis, int plane)
{
    unsigned char side[SPLIT_MOST];
    double low = HUGE_VAL, high = -HUGE_VAL, left, right;
    uint32_t i, n_left, n_right;
    for (i = 0; i < b->count; i++) {
        const pt_vec3 c = pt_v3_add(b->lo[b->order[i]], b->hi[b->order[i]]);
        low = fmin(low, coordinate(c, axis));
        high = fmax(high, coordinate(c, axis));
    }
    if (!(high > low)) return HUGE_VAL;
    for (i = 0; i < b->count; i++) {
        const double c = coordinate(b->lo[b->order[i]], axis) + coordinate(b->hi[b->order[i]], axis);
        side[i] = (c - low) * (SPLIT_BINS / (high - low)) >= plane;
    }
    left = half_area(b, side, 0, &n_left);
    right = half_area(b, side, 1, &n_right);
    return n_left > 0 && n_right > 0 ? left * n_left + right * n_right : HUGE_VAL;
}

/* Collects what is below a node; how many. */
static uint32_t below(const pt_bvh *bvh, uint32_t node, uint32_t *order)
{
    const pt_bvh_node *const n = &bvh->nodes[node];
    uint32_t i, count;
    for (i = 0; i < n->count; i++) order[i] = bvh->order[n->first + i];
    if (n->count > 0) return n->count;
    count = below(bvh, n->first, order);
    return count + below(bvh, n->first + 1, order + count);
}

/* A node is split where the surface area heuristic is least over the planes between sixteen bins an axis, and
   is a leaf where up to eight boxes are cheaper so. Returns the number of nodes of which that is not true. */
static int wrong_splits(const pt_bvh *bvh, const pt_vec3 *lo, const pt_vec3 *hi)
{
    uint32_t order[SPLIT_MOST], node, count[2];
    unsigned char side[SPLIT_MOST];
    int wrong = 0, axis, plane;
    for (node = 0; node < bvh->node_count; node++) {
        const pt_bvh_node *const n = &bvh->nodes[node];
        const split_boxes b = {lo, hi, order, below(bvh, node, order)};
        double best = HUGE_VAL, cost, area;
        for (axis = 0; axis < 3; axis++)
            for (plane = 1; plane < SPLIT_BINS; plane++) best = fmin(best, split_cost(&b, axis, plane));
        memset(side, 0, b.count);
        area = half_area(&b, side, 0, &count[0]);
        if (n->count == 0) {
            count[0] = below(bvh, n->first, order); /* the left child's come first */
            memset(side + count[0], 1, b.count - count[0]);
            cost = half_area(&b, side, 0, &count[0]) * count[0];
            cost += half_area(&b, side, 1, &count[1]) * count[1];
            wrong += fabs(cost - best) > 1e-12 * best || (b.count <= 8 && !(best + area < area * b.count));
        } else {
            wrong += b.count > 8 || (b.count > 1 && best + area < area * b.count);
        }
    }
    return wrong;
}

static void tree_splits(void)
{
    pt_vec3 lo[SPLIT_MOST], hi[SPLIT_MOST];
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(26), 26);
    pt_bvh bvh;
    int i, flat, wrong;
    for (flat = 0; flat < 4; flat++) { /* boxes with sides, or without one along the axis flat - 1 */
        for (i = 0; i < SPLIT_MOST; i++) {
            const vec c = random_vec(&rng, flat == 1 ? 100 : 10);
            const double x = uniform(&rng, 0, 3), y = uniform(&rng, 0, 2), z = uniform(&rng, 0, 1);
            const vec d = vec3(x, y, z);
            lo[i] = real3(vec3(flat == 1 ? 0 : c.x, flat == 2 ? 0 : c.y, flat == 3 ? 0 : c.z));
            hi[i] = pt_v3_add(lo[i], real3(vec3(flat == 1 ? 0 : d.x, flat == 2 ? 0 : d.y, flat == 3 ? 0 : d.z)));
        }
        pt_check(pt_bvh_build(&bvh, lo, hi, SPLIT_MOST, NULL) == PT_OK, "tree of 600 boxes", "was not built");
        wrong = wrong_splits(&bvh, lo, hi);
        pt_check(wrong == 0 && bvh.node_count > 200, label("splits by surface area, %d", flat),
                 "%d of %u nodes are not split where the heuristic is least", wrong, (unsigned)bvh.node_count);
        pt_bvh_free(&bvh, NULL);
    }
    pt_check(pt_bvh_build(&bvh, lo, hi, 0x80000000u, NULL) == PT_ERROR_ARGUMENT, "2^31 boxes", "are not refused");
}

static void tree_shapes(void)
{
    enum { MOST = 200000 };
    pt_vec3 *const lo = (pt_vec3 *)malloc(MOST * sizeof *lo), *const hi =
                                                                  (pt_vec3 *)malloc(MOST * sizeof *hi);
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(6), 6);
    const double start = pt_cpu_seconds();
    const uint32_t many = pt_test_samples(MOST);
    const uint32_t octaves =
        sizeof(pt_real) == sizeof(float) ? 185 : 1080; /* from 2^59 down to the smallest number */
    uint32_t i;
    if (!lo || !hi) return;
    for (i = 0; i < many; i++) lo[i] = hi[i] = pt_v3(1, 2, 3);
    for (i = 0; i <= 20; i++) one_tree("identical points", lo, hi, i, 20);
    one_tree("identical points", lo, hi, many, 40);
    for (i = 0; i < many; i++) {
        lo[i] = real3(random_vec(&rng, 1000));
        hi[i] = pt_v3_add(lo[i], real3(scale(vec3(1, 1, 1), pow(10, uniform(&rng, -6, 1)))));
    }
    one_tree("random boxes", lo, hi, many, PT_BVH_MAX_DEPTH);
    lo[7] = pt_v3((pt_real)-1e6, (pt_real)-1e6, (pt_real)-1e6);
    hi[7] = pt_v3((pt_real)1e6, (pt_real)1e6, (pt_real)1e6);
    one_tree("a giant among dwarfs", lo, hi, many, PT_BVH_MAX_DEPTH);
    for (i = 0; i < octaves; i++) lo[i] = hi[i] = pt_v3((pt_real)ldexp(1, 59 - (int)i), 0, 0);
    one_tree("centres at 2^-i", lo, hi, octaves, PT_BVH_MAX_DEPTH);
    for (i = 0; i < octaves; i++) lo[i] = pt_v3(0, 0, 0);
    one_tree("boxes that end at 2^-i", lo, hi, octaves, PT_BVH_MAX_DEPTH);
    for (i = 0; i < 20000; i++) lo[i] = hi[i] = pt_v3((pt_real)pow(1.004, -(double)i), (pt_real)i, 0);
    one_tree("a long chain", lo, hi, 20000, PT_BVH_MAX_DEPTH);
    for (i = 0; i < 1000; i++)
        lo[i] = hi[i] = pt_v3((pt_real)(i % 2 ? 1e18 : -1e18), (pt_real)(i % 3 ? 1e-38 : 0), 0);
    one_tree("extents 2e18, 1e-38 and 0", lo, hi, 1000, PT_BVH_MAX_DEPTH);
    pt_check(pt_cpu_seconds() - start < 20, "building trees", "%g s: not O(n log n)?",
             pt_cpu_seconds() - start);
    free(lo);
    free(hi);
}
#endif

/* Is it the primitive that a linear search finds, at the same distance? Where pt_real is double itself, the t
   of coplanar triangles differ by their own rounding, and which is found first may decide. */
static int same_hit(const pt_scene *scene, const pt_ray *ray, const pt_hit *hit, int want, double t)
{
    const double extent = length(vec_of(scene->lo)) + length(vec_of(scene->hi)) + length(vec_of(ray->o));
    if (hit->primitive == want && hit->t == (pt_real)t) return 1;
    return sizeof(pt_real) == sizeof(double) &&
           fabs(dbl(hit->t) - t) * length(vec_of(ray->d)) < 1e-14 * extent;
}

/* What rays find through pt_intersect against what a linear search finds. */
static void same_as_linear(const char *name, const pt_scene *scene, vec centre, double size, int n,
                           uint64_t seed)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(seed), 7);
    int i, hits = 0, other = 0, blind = 0;
    for (i = 0; i < n; i++) {
        const pt_vec3 from = real3(add(centre, random_vec(&rng, 1.5 * size)));
        const vec aim = i % 4 == 0 ? vec3(dbl(from.x) + (i % 3) - 1, dbl(from.y) + (i / 3 % 3) - 1,
                                          dbl(from.z) + (i / 9 % 3) - 1)
                                   : add(centre, random_vec(&rng, size));
        pt_ray ray = ray_of(from, real3(sub(aim, vec_of(from))));
        pt_hit hit;
        double t;
        int want, got;
        if (i % 5 == 0) ray.tmax = (pt_real)0.9;
        want = linear(scene, &ray, &t);
        got = pt_intersect(scene, &ray, &hit);
        hits += want >= 0;
        other += got != (want >= 0) || (got && !same_hit(scene, &ray, &hit, want, t));
        blind += pt_occluded(scene, &ray) != (want >= 0);
    }
    pt_check(hits > n / 50, name, "only %d of %d rays hit: the test is empty", hits, n);
    pt_check(other == 0, name, "%d of %d rays find another primitive or distance than a linear search", other,
             n);
    pt_check(blind == 0, name, "pt_occluded differs from a linear search for %d of %d rays", blind, n);
}

static void soup(pt_scene *scene, pt_pcg32 *rng, int count, double size, double triangle, int material)
{
    int i;
    for (i = 0; i < count; i++) {
        const vec a = random_vec(rng, size), b = random_vec(rng, triangle), c = random_vec(rng, triangle);
        pt_add_triangle(scene, real3(a), real3(add(a, b)), real3(add(a, c)), material);
    }
}

static void tree_is_linear_search(void)
{
    static const char *const names[8] = {"soup of triangles",   "dense soup",         "spheres and triangles",
                                         "identical triangles", "coplanar triangles", "a giant among dwarfs",
                                         "slivers and points",  "a chain of 2^-i"};
    const int n = (int)pt_test_samples(6000);
    int c, i;
    for (c = 0; c < 8; c++) {
        pt_pcg32 rng = pt_pcg32_make(pt_test_seed((uint64_t)(20 + c)), 8);
        pt_scene scene = PT_SCENE_INIT;
        const int m = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(1)));
        uint32_t degenerate = 0;
        scene.tree = PT_TREE_BINARY; /* tests/test_wide.c has the others */
        if (c < 2) soup(&scene, &rng, 600, 1, c == 0 ? 0.15 : 1, m);
        if (c == 2) soup(&scene, &rng, 300, 1, 0.3, m);
        for (i = 0; c == 2 && i < 100; i++) {
            const vec a = random_vec(&rng, 1);
            pt_add_sphere(&scene, real3(a), (pt_real)uniform(&rng, 0.01, 0.2), m);
        }
        for (i = 0; c == 3 && i < 400; i++)
            pt_add_triangle(&scene, pt_v3(-1, -1, 0), pt_v3(1, -1, (pt_real)0.1), pt_v3(0, 1, (pt_real)0.3),
                            m);
        for (i = 0; c == 4 && i < 300; i++) { /* overlapping in the plane z = 0.3 */
            const vec a = random_vec(&rng, 1), b = random_vec(&rng, 1), d = random_vec(&rng, 1);
            pt_add_triangle(&scene, pt_v3((pt_real)a.x, (pt_real)a.y, (pt_real)0.3),
                            pt_v3((pt_real)b.x, (pt_real)b.y, (pt_real)0.3),
                            pt_v3((pt_real)d.x, (pt_real)d.y, (pt_real)0.3), m);
        }
        if (c == 5) {
            soup(&scene, &rng, 500, 1, 0.1, m);
            pt_add_triangle(&scene, pt_v3((pt_real)-1e6, (pt_real)-1e6, (pt_real)0.2),
                            pt_v3((pt_real)1e6, (pt_real)-1e6, (pt_real)0.1), pt_v3(0, (pt_real)1e6, 0), m);
        }
        for (i = 0; c == 6 && i < 500; i++) {
            const vec a = random_vec(&rng, 1), d = random_vec(&rng, 2);
            const pt_vec3 p = real3(a), q = real3(add(a, d));
            if (i % 5 == 0)
                pt_add_triangle(&scene, p, p, q, m);
            else
                pt_add_triangle(&scene, p, q, real3(add(add(a, scale(d, 0.5)), random_vec(&rng, 0.01))), m);
            degenerate += i % 5 == 0;
        }
        for (i = 0; c == 7 && i < 120; i++) {
            const double s = ldexp(1, -i);
            pt_add_triangle(&scene, real3(vec3(s, 0, 0)), real3(vec3(s, s, 0)), real3(vec3(s, 0, s)), m);
        }
        if (commit(&scene)) {
            pt_check(scene.degenerate_count == degenerate, names[c],
                     "%u triangles without area, should be %u", scene.degenerate_count, degenerate);
            same_as_linear(names[c], &scene, vec3(0, 0, 0), 1, n, (uint64_t)(40 + c));
        }
        pt_scene_free(&scene);
    }
}

/* Two coincident quads: the picture may not flicker between them. */
static void ties(void)
{
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(60), 60);
    pt_scene scene = PT_SCENE_INIT;
    const int m = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(1)));
    int i, wrong = 0;
    pt_hit hit;
    scene.tree = PT_TREE_BINARY;
    for (i = 0; i < 40; i++)
        pt_add_sphere(&scene, real3(add(vec3(0, -5, 0), random_vec(&rng, 2))), (pt_real)0.5, m);
    for (i = 0; i < 3; i++)
        pt_add_parallelogram(&scene, pt_v3(-1, 0, -1), pt_v3(0, (pt_real)0.1, 2), pt_v3(2, (pt_real)0.3, 0),
                             m);
    if (!commit(&scene)) return;
    for (i = 0; i < 20000; i++) {
        const vec o = add(vec3(0, 3, 0), random_vec(&rng, 2)), r = random_vec(&rng, 0.9);
        const vec aim = vec3(r.x, 0.2, r.z);
        const pt_ray ray = ray_of(real3(o), real3(sub(aim, o)));
        if (!pt_intersect(&scene, &ray, &hit) || hit.shape != PT_SHAPE_PARALLELOGRAM) continue;
        wrong += scene.primitives[hit.primitive].index != 0;
    }
    pt_check(wrong == 0, "coincident parallelograms", "%d of 20000 rays do not see the first one", wrong);
    pt_scene_free(&scene);
}

static void few_and_none(void)
{
    int count, i;
    for (count = 0; count <= 9; count++) {
        pt_pcg32 rng = pt_pcg32_make(pt_test_seed(70), (uint64_t)count);
        pt_scene scene = PT_SCENE_INIT;
        const int m = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(1)));
        pt_hit hit;
        const pt_ray ray = ray_of(pt_v3(0, 0, 5), pt_v3(0, 0, -1));
        for (i = 0; i < count; i++)
            pt_add_triangle(&scene, pt_v3(-1, -1, (pt_real)i), pt_v3(1, -1, (pt_real)i),
                            pt_v3(0, 1, (pt_real)i), m);
        if (commit(&scene)) {
            if (count == 0)
                pt_check(!pt_intersect(&scene, &ray, &hit) && !pt_occluded(&scene, &ray), "an empty scene",
                         "something is hit");
            else
                same_as_linear("few triangles", &scene, vec3(0, 0, 0), 1, 2000, (uint64_t)(80 + count));
        }
        soup(&scene, &rng, 20, 1, 0.5, m); /* additions after a commit */
        if (commit(&scene))
            same_as_linear("after a second commit", &scene, vec3(0, 0, 0), 1, 1000, (uint64_t)(90 + count));
        pt_scene_free(&scene);
    }
}

static void all_degenerate(void)
{
    pt_scene scene = PT_SCENE_INIT;
    const int m = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(1)));
    const pt_ray ray = ray_of(pt_v3((pt_real)0.5, 0, 5), pt_v3(0, 0, -1));
    pt_hit hit;
    int i;
    for (i = 0; i < 20; i++) {
        pt_add_triangle(&scene, pt_v3(0, 0, 0), pt_v3(1, 0, 0), pt_v3(2, 0, 0), m);
        pt_add_parallelogram(&scene, pt_v3(0, 0, 0), pt_v3(1, 0, 0), pt_v3(0, 0, 0), m);
    }
    if (!commit(&scene)) return;
    pt_check(scene.primitive_count == 0 && scene.degenerate_count == 40, "shapes without area",
             "%u primitives, %u left out", scene.primitive_count, scene.degenerate_count);
    pt_check(!pt_intersect(&scene, &ray, &hit), "shapes without area", "hit");
    pt_scene_free(&scene);
}

int main(int argc, char **argv)
{
    pt_test_begin("test_geometry", argc, argv);
    PT_TEST_EXACT(spheres);
    PT_TEST_EXACT(far_spheres);
    PT_TEST_EXACT(triangles);
    PT_TEST_EXACT(shared_edges);
    PT_TEST_EXACT(boxes);
    PT_TEST_EXACT(random_boxes);
    PT_TEST_EXACT(gammas);
    PT_TEST_EXACT(bad_numbers);
    PT_TEST_EXACT(no_leaks);
    PT_TEST_EXACT(no_self_hits);
    PT_TEST_EXACT(what_a_hit_says);
    PT_TEST_EXACT(shading_normals);
    PT_TEST_EXACT(shadow_rays);
    PT_TEST_EXACT(before_the_end);
    PT_TEST_EXACT(thin_gaps);
#if PTI_HAS_BVH
    PT_TEST_EXACT(tree_shapes);
    PT_TEST_EXACT(tree_splits);
#endif
    PT_TEST_EXACT(tree_is_linear_search);
    PT_TEST_EXACT(ties);
    PT_TEST_EXACT(few_and_none);
    PT_TEST_EXACT(all_degenerate);
    return pt_test_end();
}
