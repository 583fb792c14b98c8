/* test_sampling.c: directions and points come with the density that is said, and everything that is sampled
   integrates to what is known exactly ([PT-04], [PT-08], [PT-09], the camera of [PT-10]). */

#include "pt_cases.h"

static double dbl(pt_real x) { return (double)x; }
static pt_real real(double x) { return (pt_real)x; }
static double dot3(pt_vec3 a, pt_vec3 b)
{
    return dbl(a.x) * dbl(b.x) + dbl(a.y) * dbl(b.y) + dbl(a.z) * dbl(b.z);
}
static double length3(pt_vec3 a) { return sqrt(dot3(a, a)); }
static double distance3(pt_vec3 a, pt_vec3 b)
{
    const double x = dbl(a.x) - dbl(b.x), y = dbl(a.y) - dbl(b.y), z = dbl(a.z) - dbl(b.z);
    return sqrt(x * x + y * y + z * z);
}
static pt_vec3 v3(double x, double y, double z) { return pt_v3(real(x), real(y), real(z)); }
static int is_float(void) { return sizeof(pt_real) == sizeof(float); }

/* How far from 1 a direction's length may be: rounded once to float, or by some twenty steps in double. */
static double unit_slack(void) { return (is_float() ? 4 : 64) * pt_gamma(1); }

static pt_real number(pt_pcg32 *rng) { return pt_real_from_u32(pt_pcg32_next(rng)); }
static pt_vec2 pair(pt_pcg32 *rng)
{
    pt_vec2 u;
    u.x = number(rng);
    u.y = number(rng);
    return u;
}
static pt_pcg32 generator(uint64_t k) { return pt_pcg32_make(pt_test_seed(k), k); }

static double uniform(pt_pcg32 *rng, double low, double high)
{
    return low + (high - low) * pt_pcg32_double(rng);
}

/* The cell of x in [0,1], one of n. */
static int cell(double x, int n)
{
    const int i = (int)(x * n);
    return i < 0 ? 0 : i < n ? i : n - 1;
}

static void expect_uniform(const char *name, const double *counts, int cells, const char *hint)
{
    double expected[1024], total = 0;
    int i;
    for (i = 0; i < cells; i++) total += counts[i];
    for (i = 0; i < cells; i++) expected[i] = total / cells;
    pt_check_chi2(name, counts, expected, cells, hint);
}

/* ---------------------------------------------------------------------------------------------------------
   Warps: cells of equal probability in coordinates in which the density is constant */

typedef enum warp { DISK, HEMISPHERE, COSINE, SPHERE, TRIANGLE, IN_BALL, ON_BALL, POLAR, WARPS } warp;
static const char *const warp_names[WARPS] = {"disk",
                                              "hemisphere",
                                              "cosine hemisphere",
                                              "sphere",
                                              "triangle",
                                              "normal + point in the ball",
                                              "normal + point on the ball",
                                              "polar disk without the root"};

static double turn(double y, double x) { return atan2(y, x) / (2 * PT_PI) + 0.5; }

/* In the cube [-1,1]^3; one statement a number, since arguments have no order. */
static pt_vec3 in_cube(pt_pcg32 *rng)
{
    const double x = uniform(rng, -1, 1), y = uniform(rng, -1, 1);
    return v3(x, y, uniform(rng, -1, 1));
}

/* The last three are a student's: the second is right, the others are not cosine weighted, not uniform. */
static pt_vec3 apply(warp k, pt_pcg32 *rng)
{
    const pt_vec2 u = pair(rng);
    pt_vec3 w = pt_v3(0, 0, 0);
    pt_vec2 p;
    switch (k) {
    case HEMISPHERE:
        return pt_warp_hemisphere(u);
    case COSINE:
        return pt_warp_cosine(u);
    case SPHERE:
        return pt_warp_sphere(u);
    case IN_BALL:
        do w = in_cube(rng);
        while (length3(w) > 1);
        return pt_v3_normalize(pt_v3_add(w, pt_v3(0, 0, 1)));
    case ON_BALL:
        return pt_v3_normalize(pt_v3_add(pt_warp_sphere(u), pt_v3(0, 0, 1)));
    case POLAR:
        return v3(dbl(u.x) * cos(2 * PT_PI * dbl(u.y)), dbl(u.x) * sin(2 * PT_PI * dbl(u.y)), 0);
    case TRIANGLE:
        p = pt_warp_triangle(u);
        break;
    default:
        p = pt_warp_disk(u);
        break;
    }
    return pt_v3(p.x, p.y, 0);
}

/* One of 256 cells of equal probability. */
static int warp_cell(warp k, pt_vec3 w)
{
    const double x = dbl(w.x), y = dbl(w.y), z = dbl(w.z), phi = turn(y, x);
    switch (k) {
    case DISK:
    case POLAR:
        return cell(x * x + y * y, 16) * 16 + cell(phi, 16);
    case HEMISPHERE:
        return z < 0 ? -1 : cell(z, 16) * 16 + cell(phi, 16);
    case SPHERE:
        return cell(0.5 + 0.5 * z, 16) * 16 + cell(phi, 16);
    case TRIANGLE: { /* sixteen by sixteen small triangles, two to a square */
        const int i = cell(x, 16), j = cell(y, 16), upper = x * 16 - i + y * 16 - j > 1;
        return i + j + upper > 15 ? -1 : i * (32 - i) + 2 * j + upper;
    }
    default:
        return z < 0 ? -1 : cell(z * z, 16) * 16 + cell(phi, 16);
    }
}

static void warps(void)
{
    pt_test_source("closed form: areas of the cells under the density of the warp");
    const uint32_t n = pt_test_samples(1u << 17);
    int k;
    for (k = 0; k < WARPS; k++) {
        pt_pcg32 rng = generator((uint64_t)(1 + k));
        double counts[256] = {0}, expected[256];
        int i, outside = 0;
        for (i = 0; i < (int)n; i++) {
            const int c = warp_cell((warp)k, apply((warp)k, &rng));
            if (c < 0)
                outside++;
            else
                counts[c]++;
        }
        for (i = 0; i < 256; i++) expected[i] = n / 256.0;
        pt_check(outside == 0, warp_names[k], "%d of %u samples are outside", outside, n);
        if (k == IN_BALL || k == POLAR)
            pt_check_rejects_chi2(warp_names[k], counts, expected, 256, "this density is not the right one");
        else
            pt_check_chi2(warp_names[k], counts, expected, 256,
                          "do equal areas of u map to equal probabilities? sqrt of u for disks and cosine, z "
                          "linear in u for spheres");
    }
}

/* 1 - cos of a direction near +z, or anywhere, without cancellation. */
static double one_minus_cos(pt_vec3 w)
{
    const double s2 = dbl(w.x) * dbl(w.x) + dbl(w.y) * dbl(w.y), z = dbl(w.z);
    return z > 0 ? s2 / (1 + sqrt(fmax(0, 1 - s2))) : 1 - z;
}

static void cones(void)
{
    pt_test_source("closed form: 1 - cos is uniform, and so is the azimuth");
    static const double omc[8] = {1e-20, 1e-12, 1e-6, 0.01, 0.5, 1, 1.7, 2};
    const uint32_t n = pt_test_all_samples(1u << 16);
    int c, i;
    for (c = 0; c < 8; c++) {
        pt_pcg32 rng = generator((uint64_t)(20 + c));
        double counts[256] = {0}, longest = 0;
        for (i = 0; i < (int)n; i++) {
            const pt_vec3 w = pt_warp_cone(pair(&rng), omc[c]);
            longest = fmax(longest, fabs(length3(w) - 1));
            counts[cell(one_minus_cos(w) / omc[c], 16) * 16 + cell(turn(dbl(w.y), dbl(w.x)), 16)]++;
        }
        pt_check(longest <= unit_slack(), "cone", "directions are not of unit length: off by %g", longest);
        expect_uniform(
            "cone", counts, 256,
            "1 - cos of the angle must be uniform up to 1 - cos of the cone, not the angle itself");
        pt_check_near("density of a cone", pt_warp_cone_pdf_w(omc[c]) * 2 * PT_PI * omc[c], 1, 1e-15,
                      "one over its solid angle");
    }
}

/* Whatever the numbers, also the first and the last ones: finite, of unit length, and possible. */
static void corners_of_the_square(void)
{
    static const pt_real u[5] = {0, (pt_real)0x1p-24, (pt_real)0.25, (pt_real)0.5, (pt_real)0xffffffp-24};
    int i, j;
    for (i = 0; i < 5; i++)
        for (j = 0; j < 5; j++) {
            const pt_vec2 p = pt_v2(u[i], u[j]), disk = pt_warp_disk(p), b = pt_warp_triangle(p);
            const pt_vec3 w[4] = {pt_warp_hemisphere(p), pt_warp_cosine(p), pt_warp_sphere(p),
                                  pt_warp_cone(p, 1e-3)};
            int k;
            for (k = 0; k < 4; k++)
                pt_check(fabs(length3(w[k]) - 1) <= unit_slack(), "unit directions",
                         "warp %d, u = (%g, %g): length %.9g", k, dbl(u[i]), dbl(u[j]), length3(w[k]));
            pt_check(dbl(w[1].z) >= (is_float() ? 0x1p-24 : 0x1p-53) && dbl(pt_warp_cosine_pdf_w(w[1])) > 0,
                     "cosine warp", "u = (%g, %g) gives a direction of density 0", dbl(u[i]), dbl(u[j]));
            pt_check(dbl(disk.x) * dbl(disk.x) + dbl(disk.y) * dbl(disk.y) <= 1 + 4 * pt_gamma(1),
                     "disk warp", "outside");
            pt_check(dbl(b.x) >= 0 && dbl(b.y) >= 0 && dbl(b.x) + dbl(b.y) <= 1 + 2 * pt_gamma(1),
                     "triangle warp", "outside");
        }
}

/* Densities integrate to 1, and 1/density over samples to the solid angle of the support. */
static void densities(void)
{
    pt_test_source("densities integrate to 1; irradiance pi under a uniform sky");
    const uint32_t n = pt_test_samples(1u << 17);
    pt_stats hemisphere = PT_STATS_INIT, cosine = PT_STATS_INIT, hit_and_miss = PT_STATS_INIT;
    pt_pcg32 rng = generator(30);
    uint32_t i;
    for (i = 0; i < n; i++) {
        const pt_vec3 w = pt_warp_sphere(pair(&rng)), c = pt_warp_cosine(pair(&rng));
        pt_stats_add(&hemisphere, dbl(pt_warp_hemisphere_pdf_w(w)) / dbl(pt_warp_sphere_pdf_w()));
        pt_stats_add(&cosine, dbl(pt_warp_cosine_pdf_w(w)) / dbl(pt_warp_sphere_pdf_w()));
        pt_stats_add(&hit_and_miss, dbl(c.z) / dbl(pt_warp_cosine_pdf_w(c)));
    }
    pt_check_near("density of the sphere", dbl(pt_warp_sphere_pdf_w()) * 4 * PT_PI, 1, 2 * pt_gamma(1),
                  "1/(4 pi)");
    pt_check_mean("density of the hemisphere", &hemisphere, 1, 1e-7, 0.05, PT_TEST_VALUES,
                  "must integrate to 1");
    pt_check_mean("density of the cosine", &cosine, 1, 1e-7, 0.05, PT_TEST_VALUES, "must integrate to 1");
    pt_check_mean("irradiance under a uniform sky", &hit_and_miss, PT_PI, 1e-6, 0.01, PT_TEST_VALUES,
                  "cos / density = pi");
}

/* Where the ray from the origin along w crosses the plane of three points, as weights of the last two. */
static void weights_on(const pt_vec3 v[3], pt_vec3 w, double b[2])
{
    const double e1[3] = {dbl(v[1].x) - dbl(v[0].x), dbl(v[1].y) - dbl(v[0].y), dbl(v[1].z) - dbl(v[0].z)};
    const double e2[3] = {dbl(v[2].x) - dbl(v[0].x), dbl(v[2].y) - dbl(v[0].y), dbl(v[2].z) - dbl(v[0].z)};
    const double d[3] = {dbl(w.x), dbl(w.y), dbl(w.z)}, s[3] = {-dbl(v[0].x), -dbl(v[0].y), -dbl(v[0].z)};
    const double p[3] = {d[1] * e2[2] - d[2] * e2[1], d[2] * e2[0] - d[0] * e2[2],
                         d[0] * e2[1] - d[1] * e2[0]};
    const double q[3] = {s[1] * e1[2] - s[2] * e1[1], s[2] * e1[0] - s[0] * e1[2],
                         s[0] * e1[1] - s[1] * e1[0]};
    const double det = e1[0] * p[0] + e1[1] * p[1] + e1[2] * p[2];
    b[0] = (s[0] * p[0] + s[1] * p[1] + s[2] * p[2]) / det;
    b[1] = (d[0] * q[0] + d[1] * q[1] + d[2] * q[2]) / det;
}

/* Solid angle of one of the 64 parts of a triangle, (i, j) from v0; upper: the one that is upside down. */
static double part_of(const pt_vec3 v[3], int i, int j, int upper)
{
    pt_vec3 c[3];
    int k;
    for (k = 0; k < 3; k++) {
        const double a = (i + (k == 1) + upper * (k != 1 ? 1 : 0) - upper * (k == 2)) / 8.0;
        const double b = (j + (k == 2) + upper * (k != 2 ? 1 : 0) - upper * (k == 1)) / 8.0;
        c[k] = v3(dbl(v[0].x) * (1 - a - b) + dbl(v[1].x) * a + dbl(v[2].x) * b,
                  dbl(v[0].y) * (1 - a - b) + dbl(v[1].y) * a + dbl(v[2].y) * b,
                  dbl(v[0].z) * (1 - a - b) + dbl(v[1].z) * a + dbl(v[2].z) * b);
    }
    return pt_solid_angle_triangle(pt_v3(0, 0, 0), c[0], c[1], c[2]);
}

typedef struct seen_triangle {
    const char *name;
    double v[3][3];
} seen_triangle;

/* Seen from the origin. Parts of a triangle have the solid angles of the parts: the plane is cut, not the
   sphere. */
static const seen_triangle seen[7] = {
    {"octant", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
    {"nearly a hemisphere", {{-8, -6, 0.25}, {8, -6, 0.25}, {0, 10, 0.25}}},
    {"a thousandth wide", {{0, 0, 16}, {0.015625, 0, 16}, {0, 0.015625, 16}}},
    {"sliver", {{-4, 0.5, 1}, {4, 0.5, 1}, {0, 0.5625, 1}}},
    {"at grazing angle", {{1, 0, 0.03125}, {9, 0, 0.03125}, {1, 8, 0.03125}}},
    {"a corner far away", {{0.5, 0, 0.5}, {0, 0.5, 0.5}, {30, 20, 40}}},
    {"behind and around", {{-1, -1, -0.25}, {1, -1, -0.25}, {0, 1, 0.5}}}};

static void spherical_triangles(void)
{
    pt_test_source("solid angles of sub-triangles (Van Oosterom and Strackee 1983)");
    const uint32_t n = pt_test_samples(1u << 16);
    int t, i, j, k;
    for (t = 0; t < 7; t++) {
        pt_pcg32 rng = generator((uint64_t)(40 + t));
        const pt_vec3 v[3] = {v3(seen[t].v[0][0], seen[t].v[0][1], seen[t].v[0][2]),
                              v3(seen[t].v[1][0], seen[t].v[1][1], seen[t].v[1][2]),
                              v3(seen[t].v[2][0], seen[t].v[2][1], seen[t].v[2][2])};
        double counts[128] = {0}, expected[128] = {0}, longest = 0;
        pt_spherical_triangle s;
        const double whole = pt_spherical_triangle_make(&s, pt_v3(0, 0, 0), v[0], v[1], v[2]);
        for (i = 0; i < (int)n; i++) {
            const pt_vec3 w = pt_spherical_triangle_sample(&s, pair(&rng));
            double b[2];
            longest = fmax(longest, fabs(length3(w) - 1));
            weights_on(v, w, b);
            j = cell(b[0], 8);
            k = cell(b[1], 8);
            counts[(j * 8 + k) * 2 + (b[0] * 8 - j + b[1] * 8 - k > 1 && j + k < 7)]++;
        }
        for (i = 0; i < 8; i++)
            for (j = 0; i + j < 8; j++) {
                expected[(i * 8 + j) * 2] = n * part_of(v, i, j, 0) / whole;
                if (i + j < 7) expected[(i * 8 + j) * 2 + 1] = n * part_of(v, i, j, 1) / whole;
            }
        pt_check(longest <= unit_slack(), seen[t].name, "directions are not of unit length: off by %g",
                 longest);
        pt_check_chi2(
            seen[t].name, counts, expected, 128,
            "equal parts of u must be equal solid angles (Arvo): areas by Girard, then along the arc");
    }
}

/* Solid angle between the axes and (x, y) of the plane z = h. */
static double quarter(double x, double y, double h)
{
    return atan(x * y / (h * sqrt(x * x + y * y + h * h)));
}
static double rectangle(double x0, double x1, double y0, double y1, double h)
{
    return quarter(x1, y1, h) - quarter(x0, y1, h) - quarter(x1, y0, h) + quarter(x0, y0, h);
}

static void spherical_rectangles(void)
{
    pt_test_source("solid angles of parts of a rectangle (Urena et al. 2013)");
    static const double r[9][5] = {
        /* x0, x1, y0, y1, h; the last two are sampled as two triangles */
        {-0.5, 0.5, -0.5, 0.5, 0.5},   {-16, 16, -8, 8, 0.25}, {1, 3, 2, 2.5, 0.125},
        {-4, 4, 1, 1.03125, 1},        {0, 1, 0, 1, 1},        {20, 20.125, 30, 30.125, 40},
        {0, 0.015625, 0, 0.015625, 64}, {0, 0.00390625, 0, 0.001953125, 64}, {1, 3, -1, 1, 0x1p-32}};
    static const char *const names[9] = {"cube face", "nearly a hemisphere", "aside and grazing",
                                         "strip",     "above its corner",    "small and aslant",
                                         "tiny",      "tinier",              "nearly edge-on"};
    const uint32_t n = pt_test_samples(1u << 16);
    int t, i, j;
    for (t = 0; t < 9; t++) {
        const double x0 = r[t][0], y0 = r[t][2], h = r[t][4], dx = (r[t][1] - x0) / 8,
                     dy = (r[t][3] - y0) / 8;
        const double whole = rectangle(x0, r[t][1], y0, r[t][3], h);
        pt_pcg32 rng = generator((uint64_t)(50 + t));
        double counts[64] = {0}, expected[64];
        pt_spherical_rectangle s;
        const double made = pt_spherical_rectangle_make(&s, pt_v3(0, 0, 0), v3(x0, h, y0), v3(8 * dx, 0, 0),
                                                        v3(0, 0, 8 * dy));
        for (i = 0; i < (int)n; i++) {
            const pt_vec3 w = pt_spherical_rectangle_sample(&s, pair(&rng));
            counts[cell((dbl(w.x) / dbl(w.y) * h - x0) / (8 * dx), 8) * 8 +
                   cell((dbl(w.z) / dbl(w.y) * h - y0) / (8 * dy), 8)]++;
        }
        for (i = 0; i < 8; i++)
            for (j = 0; j < 8; j++)
                expected[8 * i + j] =
                    n * rectangle(x0 + i * dx, x0 + (i + 1) * dx, y0 + j * dy, y0 + (j + 1) * dy, h) / whole;
        pt_check_near(names[t], made / whole, 1, t == 8 ? 2e-6 : 1e-9 /* the sum of arcs cancels there */,
                      "solid angle of a rectangle");
        pt_check_chi2(names[t], counts, expected, 64,
                      "equal parts of u must be equal solid angles (Urena et al.)");
    }
}

static void one_alias(const char *name, const double *weights, uint32_t count, uint64_t seed)
{
    const uint32_t n = pt_test_samples(1u << 16);
    pt_pcg32 rng = generator(seed);
    double counts[64] = {0}, expected[64], sum = 0, pmf, all = 0;
    pt_alias table;
    uint32_t i;
    int wrong = 0;
    pt_check(pt_alias_make(&table, weights, count, NULL) == PT_OK && table.count == count, name, "not made");
    for (i = 0; i < count; i++) sum += weights[i];
    for (i = 0; i < n && table.count == count; i++) {
        const double u = i == 0 ? 0 : i == 1 ? 1 - 0x1p-53 : pt_pcg32_double(&rng);
        const uint32_t k = pt_alias_sample(&table, u, &pmf);
        wrong += k >= count || fabs(pmf - weights[k] / sum) > 1e-15 || !(pmf > 0);
        if (k < count) counts[k]++;
    }
    for (i = 0; i < count; i++) {
        expected[i] = n * weights[i] / sum;
        all += table.entries[i].pmf;
    }
    pt_check(wrong == 0, name, "%d of %u draws have a wrong or zero probability", wrong, n);
    pt_check_near(name, all, 1, 1e-14, "probabilities must add up to 1");
    if (count > 1)
        pt_check_chi2(
            name, counts, expected, (int)count,
            "column i keeps i with its share, else gives its alias: expected counts are n w / sum w");
    pt_alias_free(&table, NULL);
}

static void alias_tables(void)
{
    pt_test_source("expected counts n w / sum of w");
    static const double one[1] = {3}, two[2] = {1, 3}, holes[6] = {0, 1, 0, 4, 2, 0},
                        wide[3] = {1e30, 1e-30, 1e30}, bad[2] = {1, -1}, nothing[3] = {0, 0, 0};
    double many[64], infinite[2] = {1, HUGE_VAL};
    pt_alias table;
    int i;
    for (i = 0; i < 64; i++) many[i] = i % 7 == 0 ? 0 : 1 + i * i % 23;
    one_alias("alias table of one", one, 1, 60);
    one_alias("alias table of two", two, 2, 61);
    one_alias("alias table with holes", holes, 6, 62);
    one_alias("alias table over 60 decades", wide, 3, 63);
    one_alias("alias table of 64", many, 64, 64);
    pt_check(pt_alias_make(&table, nothing, 3, NULL) == PT_OK && table.count == 0, "alias table of zeros",
             "must be empty");
    pt_check(pt_alias_make(&table, nothing, 0, NULL) == PT_OK && table.count == 0, "alias table of nothing",
             "must be empty");
    pt_check(pt_alias_make(&table, bad, 2, NULL) == PT_ERROR_ARGUMENT, "negative weight", "must be refused");
    pt_check(pt_alias_make(&table, infinite, 2, NULL) == PT_ERROR_ARGUMENT, "infinite weight",
             "must be refused");
    infinite[1] = HUGE_VAL - HUGE_VAL;
    pt_check(pt_alias_make(&table, infinite, 2, NULL) == PT_ERROR_ARGUMENT, "NaN weight", "must be refused");
}

/* ---------------------------------------------------------------------------------------------------------
   Materials */

static pt_hit hit_of(pt_vec3 ng, pt_vec3 ns)
{
    pt_hit hit;
    memset(&hit, 0, sizeof hit);
    hit.ng = ng;
    hit.ns = ns;
    return hit;
}

/* Is w on the same side of both normals? Else a shading normal has no say in what is right. */
static int in_order(const pt_bsdf *b, pt_vec3 w) { return dot3(w, b->frame.n) * dot3(w, b->ng) > 0; }

/* eval, pdf and sample of one material must tell the same story for one wo. */
static void one_story(const char *name, const pt_bsdf *b, pt_vec3 wo, pt_transport mode, uint64_t seed,
                      double albedo)
{
    const uint32_t n = pt_test_samples(1u << 18);
    pt_pcg32 rng = generator(seed);
    pt_stats by_eval = PT_STATS_INIT, by_sample = PT_STATS_INIT, whole = PT_STATS_INIT;
    double weight_off = 0, pdf_off = 0, reverse_off = 0, reciprocity = 0;
    uint32_t i;
    for (i = 0; i < n; i++) {
        const pt_vec3 w = pt_warp_sphere(pair(&rng));
        const pt_rgb f = pt_bsdf_eval(b, wo, w, mode, PT_LOBE_ALL),
                     g = pt_bsdf_eval(b, w, wo, mode, PT_LOBE_ALL);
        pt_bsdf_sample_result s;
        const pt_vec2 u = pair(&rng);
        const int got = pt_bsdf_sample(b, wo, pt_pcg32_double(&rng), u, mode, &s);
        double c;
        if (in_order(b, wo) && in_order(b, w)) reciprocity = fmax(reciprocity, fabs(dbl(f.r) - dbl(g.r)));
        pt_stats_add(&by_eval, dbl(f.r) * fabs(dot3(w, b->frame.n)) * 4 * PT_PI);
        pt_stats_add(&whole, dbl(pt_bsdf_pdf_w(b, wo, w, mode)) * 4 * PT_PI);
        pt_stats_add(&by_sample, got ? dbl(s.weight.r) : 0);
        if (!got) continue;
        c = fabs(dot3(s.wi, b->frame.n));
        pdf_off = fmax(pdf_off, fabs(dbl(s.pdf_w) - dbl(pt_bsdf_pdf_w(b, wo, s.wi, mode))));
        reverse_off = fmax(reverse_off, fabs(dbl(s.pdf_rev_w) - dbl(pt_bsdf_pdf_w(b, s.wi, wo, mode))));
        weight_off = fmax(weight_off, fabs(dbl(s.weight.r) * dbl(s.pdf_w) -
                                           dbl(pt_bsdf_eval(b, wo, s.wi, mode, PT_LOBE_ALL).r) * c));
    }
    pt_check(pdf_off <= 4 * pt_gamma(1) && reverse_off <= 4 * pt_gamma(1), name,
             "sample and pdf disagree by %g and %g", pdf_off, reverse_off);
    pt_check(weight_off <= 8 * pt_gamma(1), name, "weight is not f cos / pdf: off by %g", weight_off);
    pt_check(reciprocity == 0, name, "f(wo,wi) and f(wi,wo) differ by %g", reciprocity);
    pt_check_equal_means(name, &by_sample, &by_eval, 0.025, "the mean weight is not the integral of f cos");
    if (albedo > 0) {
        pt_check_mean(name, &by_eval, albedo, 1e-6, 0.025, PT_TEST_VALUES,
                      "the integral of f cos is not the albedo");
        pt_check_mean(name, &whole, 1, 1e-6, 0.025, PT_TEST_VALUES, "the pdf does not integrate to 1");
    } else { /* a tilted shading normal: light is lost, never gained */
        pt_check(by_sample.mean <= -albedo + 1e-6 && whole.mean < 1 + 7 * pt_stats_standard_error(&whole),
                 name, "gains energy: %g of %g", by_sample.mean, -albedo);
    }
}

static void diffuse(void)
{
    pt_test_source("the mean weight of samples is the integral of f cos: the albedo");
    const pt_material m = pt_material_diffuse(pt_rgb3(real(0.8), real(0.5), real(0.1)));
    const pt_vec3 n = pt_v3_normalize(pt_v3(1, -2, 2)), tilted = pt_v3_normalize(pt_v3(1, -2, 3));
    const pt_hit flat = hit_of(n, n), smooth = hit_of(n, tilted);
    const pt_bsdf b = pt_bsdf_make(&m, &flat), t = pt_bsdf_make(&m, &smooth);
    const pt_vec3 above = pt_v3_normalize(pt_v3(1, 0, 1)), below = pt_v3_neg(above),
                  low = pt_v3_normalize(pt_v3(2, 1, real(0.01)));
    const pt_rgb f = pt_bsdf_eval(&b, above, n, PT_RADIANCE, PT_LOBE_ALL);
    pt_check(b.lobes == PT_LOBE_DIFFUSE, "diffuse", "has lobes %u", b.lobes);
    pt_check_near("diffuse", dbl(f.r), 0.8 / PT_PI, 1e-7, "albedo / pi");
    pt_check_near("diffuse", dbl(f.b), 0.1 / PT_PI, 1e-8, "albedo / pi");
    pt_check(dbl(pt_bsdf_eval(&b, above, pt_v3_neg(n), PT_RADIANCE, PT_LOBE_ALL).r) == 0, "diffuse",
             "lets light through");
    pt_check(dbl(pt_bsdf_pdf_w(&b, above, pt_v3_neg(n), PT_RADIANCE)) == 0, "diffuse",
             "density behind the surface");
    pt_check(dbl(pt_bsdf_eval(&b, above, n, PT_RADIANCE, PT_LOBE_SPECULAR | PT_LOBE_GLOSSY).r) == 0,
             "diffuse", "the mask is ignored");
    one_story("diffuse from above", &b, above, PT_RADIANCE, 70, dbl(m.albedo.r));
    one_story("diffuse from below", &b, below, PT_RADIANCE, 71, dbl(m.albedo.r));
    one_story("diffuse, importance", &b, above, PT_IMPORTANCE, 72, dbl(m.albedo.r));
    one_story("diffuse at grazing angle", &b, low, PT_RADIANCE, 73, dbl(m.albedo.r));
    one_story("diffuse with shading normal", &t, above, PT_RADIANCE, 74, -dbl(m.albedo.r));
    one_story("the same from below", &t, below, PT_RADIANCE, 75, -dbl(m.albedo.r));
}

/* Sampled directions against pdf cos/pi, with a normal that is no axis: from above and below, along the normal
   and at 89 degrees, for radiance and for importance. */
static void directions_from(const pt_bsdf *b, pt_vec3 wo, int side, pt_transport mode, uint64_t seed)
{
    pt_test_source("closed form: cos / pi");
    const uint32_t n = pt_test_samples(1u << 17);
    pt_pcg32 rng = generator(seed);
    double counts[256] = {0};
    uint32_t i, outside = 0;
    for (i = 0; i < n; i++) {
        pt_bsdf_sample_result s;
        pt_vec3 l;
        const pt_vec2 u = pair(&rng);
        const int got = pt_bsdf_sample(b, wo, pt_pcg32_double(&rng), u, mode, &s);
        l = pt_frame_to_local(&b->frame, s.wi);
        outside += !got || dbl(l.z) * side <= 0 || s.lobe != PT_LOBE_DIFFUSE || dbl(s.eta) != 1;
        counts[cell(dbl(l.z) * dbl(l.z), 16) * 16 + cell(turn(dbl(l.y), dbl(l.x)), 16)]++;
    }
    pt_check(outside == 0, "diffuse directions", "%u of %u go through the surface, or were not sampled",
             outside, n);
    expect_uniform("diffuse directions", counts, 256, "not cosine weighted");
}

static void diffuse_directions(void)
{
    const pt_material m = pt_material_diffuse(pt_rgb_grey(1));
    const pt_vec3 normal = pt_v3_normalize(pt_v3(-3, 1, real(0.5)));
    const pt_hit hit = hit_of(normal, normal);
    const pt_bsdf b = pt_bsdf_make(&m, &hit);
    int k;
    for (k = 0; k < 8; k++) {
        const int side = k & 1 ? 1 : -1;
        const double t = k & 2 ? 89 * PT_PI / 180 : 0;
        const pt_vec3 wo = pt_frame_to_world(&b.frame, v3(0.6 * sin(t), 0.8 * sin(t), side * cos(t)));
        directions_from(&b, wo, side, k & 4 ? PT_IMPORTANCE : PT_RADIANCE, (uint64_t)(700 + k));
    }
}

static void black_and_mirror(void)
{
    const pt_material black = pt_material_emitter(pt_rgb_grey(5)),
                      mirror = pt_material_mirror(pt_rgb3(real(0.9), real(0.8), real(0.7)));
    const pt_vec3 n = pt_v3_normalize(pt_v3(1, 2, -1)), wo = pt_v3_normalize(pt_v3(2, 1, 1)),
                  other = pt_v3_neg(wo);
    const pt_hit hit = hit_of(n, n);
    pt_bsdf b = pt_bsdf_make(&black, &hit);
    pt_bsdf_sample_result s;
    int side;
    pt_check(!pt_bsdf_sample(&b, wo, 0, pt_v2(0, 0), PT_RADIANCE, &s) &&
                 dbl(pt_bsdf_eval(&b, wo, n, PT_RADIANCE, PT_LOBE_ALL).r) == 0,
             "black", "scatters light");
    b = pt_bsdf_make(&mirror, &hit);
    for (side = 0; side < 2; side++) {
        const pt_vec3 o = side ? other : wo;
        const int got = pt_bsdf_sample(&b, o, 0.5, pt_v2(real(0.3), real(0.6)), PT_RADIANCE, &s);
        const pt_vec3 want = pt_v3_sub(pt_v3_scale(n, 2 * pt_v3_dot(n, o)), o);
        pt_check(got && distance3(s.wi, want) < 8 * pt_gamma(1), "mirror",
                 "side %d: not the mirror direction", side);
        pt_check(s.lobe == PT_LOBE_SPECULAR && dbl(s.eta) == 1 && s.weight.g == mirror.albedo.g, "mirror",
                 "lobe, eta or weight");
        pt_check(s.pdf_w == 1 && dbl(s.pdf_rev_w) == 1, "mirror", "the one direction has probability 1");
        pt_check(dbl(pt_bsdf_eval(&b, o, s.wi, PT_RADIANCE, PT_LOBE_ALL).r) == 0 &&
                     dbl(pt_bsdf_pdf_w(&b, o, s.wi, PT_RADIANCE)) == 0,
                 "mirror", "eval and pdf of a delta are 0");
    }
}

/* A direction in the plane of the surface itself is on neither side: nothing is reflected to it or from it. */
static void edge_on(void)
{
    const pt_material mirror = pt_material_mirror(pt_rgb_grey(1)), white = pt_material_diffuse(pt_rgb_grey(1)),
                      air = pt_material_dielectric(1);
    const pt_vec3 up = pt_v3(0, 0, 1), along = pt_v3(1, 0, 0), leaning = pt_v3_normalize(pt_v3(1, 0, 2));
    const pt_hit flat = hit_of(up, up), bent = hit_of(up, leaning);
    pt_bsdf b = pt_bsdf_make(&mirror, &flat);
    pt_bsdf_sample_result s;
    pt_check(!pt_bsdf_sample(&b, along, 0.5, pt_v2(0, 0), PT_RADIANCE, &s), "a mirror seen edge-on", "reflects");
    b = pt_bsdf_make(&white, &bent);
    pt_check(dbl(pt_bsdf_pdf_w(&b, up, leaning, PT_RADIANCE)) > 0 &&
                 dbl(pt_bsdf_eval(&b, up, along, PT_RADIANCE, PT_LOBE_ALL).r) == 0 &&
                 dbl(pt_bsdf_pdf_w(&b, up, along, PT_RADIANCE)) == 0,
             "a light in the plane of a surface", "lights it, as the shading normal leans to it");
    b = pt_bsdf_make(&air, &flat);
    pt_check(pt_bsdf_sample(&b, up, 0, pt_v2(0, 0), PT_RADIANCE, &s) && dbl(s.wi.z) < 0 && dbl(s.pdf_w) == 1,
             "ior 1", "reflects, for u_lobe 0, with probability 0");
}

/* From points that rounding has put just before the plane of a light a sampled direction may round to one that
   leads away from it: then there is no sample, and never one at a negative distance. */
static void lights_edge_on(void)
{
    pt_pcg32 rng = generator(84);
    int k, i, wrong = 0, sampled = 0;
    for (k = 0; k < 64; k++) {
        pt_scene scene = PT_SCENE_INIT;
        const int lamp = pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(1)));
        pt_vec3 v[3];
        for (i = 0; i < 3; i++) {
            const double size = i == 0 ? 100 : 1;
            v[i].x = real(size * (2 * pt_pcg32_double(&rng) - 1));
            v[i].y = real(size * (2 * pt_pcg32_double(&rng) - 1));
            v[i].z = real(size * (2 * pt_pcg32_double(&rng) - 1));
        }
        if (k & 1) pt_add_parallelogram(&scene, v[0], v[1], v[2], lamp);
        else pt_add_triangle(&scene, v[0], pt_v3_add(v[0], v[1]), pt_v3_add(v[0], v[2]), lamp);
        if (pt_commit(&scene) != PT_OK) wrong++;
        for (i = 0; i < 8192; i++) {
            const pt_vec2 at = pair(&rng), ends[2] = {{0, 0}, {real(1 - 0x1p-24), real(1 - 0x1p-24)}};
            const pt_vec3 p = pt_v3_add(v[0], pt_v3_add(pt_v3_scale(v[1], 40 * at.x - 20), pt_v3_scale(v[2], 40 * at.y - 20)));
            pt_light_sample_result s;
            memset(&s, 0, sizeof s);
            if (!pt_light_sample(&scene, 0, p, i % 3 < 2 ? ends[i % 3] : pair(&rng), &s)) continue;
            sampled++;
            wrong += !(s.distance > 0) || !(s.pdf_w > 0); /* in double, at 1e-14 of it, s.wi is off by 5 % */
            wrong += sizeof(pt_real) == sizeof(float) && !(fabs(length3(s.wi) - 1) < 1e-5);
        }
        pt_scene_free(&scene);
    }
    pt_check(wrong == 0 && sampled > 10000, "lights seen edge-on", "%d of %d samples are wrong", wrong, sampled);
}

static void fresnel_rows(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0;
    for (; file && pt_case_next(file, "fresnel_d", &c); rows++) {
        const double r = pt_case_number(c.expected, "R"), cost = pt_case_number(c.expected, "cost");
        double got_cost, got;
        got = pt_fresnel_dielectric(pt_case_number(c.inputs, "cosi"), pt_case_number(c.inputs, "eta"),
                                    &got_cost);
        pt_check(got >= 0 && got <= 1, c.id, "R = %g", got);
        if (pt_case_has(&c, "soft")) continue;
        pt_check_near(c.id, got, r, pt_case_tolerance(&c, 1, "abs"), "reflectance");
        if (r > 0)
            pt_check_near(c.id, got / r, 1, pt_case_tolerance(&c, 0, "relstable"), "reflectance, relative");
        pt_check_near(c.id, got_cost, cost, 4 * pt_case_tolerance(&c, 1, "abs"), "cosine of refraction");
        if (pt_case_number(c.expected, "tir") > 0)
            pt_check(got == 1 && got_cost == 0, c.id, "must be total reflection");
    }
    if (file) fclose(file);
    pt_check(rows == 28, "rows of Fresnel reflectance", "%d", rows);
}

/* mu^2 uniform is mu dmu: the mean is the reflectance for diffuse light. */
static double fresnel_integrand(const double *u, void *eta)
{
    double cos_t;
    return pt_fresnel_dielectric(sqrt(u[0]), *(const double *)eta, &cos_t);
}

/* Values for 1.5 by quadrature; from inside by 1 - F = (1 - F outside) / n^2. */
static void fresnel_of_diffuse_light(void)
{
    pt_test_source("Fresnel's equations, by quadrature; inside: 1 - (1 - F)/n^2");
    static const double exact[2] = {0.091777959, 0.596345760};
    int inside, i;
    for (inside = 0; inside < 2; inside++) {
        double eta = inside ? 1 / 1.5 : 1.5;
        pt_stats s = PT_STATS_INIT;
        for (i = 0; i < 64; i++) {
            pt_estimate e;
            const pt_integral p = {fresnel_integrand,
                                   &eta,
                                   1,
                                   pt_test_samples(4096),
                                   PT_SAMPLER_STRATIFIED,
                                   pt_test_seed((uint64_t)(200 + i))};
            pt_estimate_mean(&p, &e);
            pt_stats_add(&s, e.value);
        }
        pt_check_mean("reflectance for diffuse light", &s, exact[inside], 5e-10, 0.005, PT_TEST_MEANS,
                      "mean of both polarisations, weighted with 2 cos over the hemisphere; 1 beyond the "
                      "critical angle");
    }
}

/* One side and one transport mode of glass, at many angles. */
static void one_glass(double ior, int below, pt_transport mode)
{
    const pt_material m = pt_material_dielectric(real(ior));
    const pt_vec3 n = pt_v3_normalize(pt_v3(2, -1, 3));
    const pt_hit hit = hit_of(n, n);
    const pt_bsdf b = pt_bsdf_make(&m, &hit);
    const double eta = below ? 1 / dbl(m.ior) : dbl(m.ior), slack = 20 * pt_gamma(1);
    pt_pcg32 rng = generator(80);
    int i, wrong_choice = 0, wrong_way = 0, wrong_weight = 0, wrong_way_back = 0;
    for (i = 0; i < 2000; i++) {
        const pt_vec3 up = pt_frame_to_world(&b.frame, pt_warp_hemisphere(pair(&rng)));
        const pt_vec3 wo = pt_v3_normalize(below ? pt_v3_neg(up) : up);
        const double cos_o = fabs(dot3(wo, n)), sin_o = sqrt(fmax(0, 1 - cos_o * cos_o));
        const double u_lobe = pt_pcg32_double(&rng);
        double cos_t, reflectance = pt_fresnel_dielectric(cos_o, eta, &cos_t);
        pt_bsdf_sample_result s, back;
        const int got = pt_bsdf_sample(&b, wo, u_lobe, pair(&rng), mode, &s),
                  through = dot3(s.wi, n) * dot3(wo, n) < 0;
        if (cos_o < 1e-3 || fabs(u_lobe - reflectance) < 1e-5 || fabs(sin_o / eta - 1) < 1e-5) continue;
        wrong_choice += !got || through != (u_lobe > reflectance) || s.lobe != PT_LOBE_SPECULAR;
        if (!got) continue;
        if (through) { /* the components along the surface: eta sin_t = sin_o */
            const pt_vec3 along = pt_v3_add(pt_v3_scale(s.wi, real(eta)), wo);
            wrong_way += fabs(length3(along) - fabs(dot3(along, n))) > slack * (1 + eta) ||
                         fabs(length3(s.wi) - 1) > slack;
            wrong_weight += fabs(dbl(s.weight.g) * (mode == PT_RADIANCE ? eta * eta : 1) - 1) > slack ||
                            fabs(dbl(s.eta) / eta - 1) > slack;
            wrong_weight += fabs(dbl(s.pdf_w) - (1 - reflectance)) > 1e-5;
            /* the way back through the surface leads to wo, with the same probability */
            if (!pt_bsdf_sample(&b, s.wi, 0.9999999, pt_v2(0, 0), mode, &back))
                wrong_way_back++;
            else if (dot3(back.wi, n) * dot3(s.wi, n) < 0)
                wrong_way_back += distance3(back.wi, wo) > 1e-3 ||
                                  fabs(dbl(back.pdf_w) - dbl(s.pdf_rev_w)) > 1e-3 ||
                                  fabs(dbl(back.weight.r) * dbl(s.weight.r) - 1) > slack;
        } else {
            wrong_way += distance3(s.wi, pt_v3_sub(pt_v3_scale(n, 2 * pt_v3_dot(n, wo)), wo)) > slack;
            wrong_weight +=
                dbl(s.weight.r) != 1 || dbl(s.eta) != 1 || fabs(dbl(s.pdf_w) - reflectance) > 1e-5;
        }
    }
    pt_check(wrong_choice == 0, "glass", "ior %g, below %d: %d times reflected or refracted against Fresnel",
             ior, below, wrong_choice);
    pt_check(wrong_way == 0, "glass", "ior %g, below %d: %d directions are not Snell's", ior, below,
             wrong_way);
    pt_check(wrong_weight == 0, "glass", "ior %g, below %d, mode %d: %d wrong weights, eta or pdf", ior,
             below, (int)mode, wrong_weight);
    pt_check(wrong_way_back == 0, "glass", "ior %g, below %d: %d ways back lead elsewhere", ior, below,
             wrong_way_back);
}

static void glass(void)
{
    static const double ior[6] = {1.5, 1.33, 2.4, 0.75, 1, 1.0001};
    int i, k;
    for (i = 0; i < 6; i++)
        for (k = 0; k < 4; k++) one_glass(ior[i], k & 1, k & 2 ? PT_IMPORTANCE : PT_RADIANCE);
    {
        const pt_material zero = pt_material_dielectric(0);
        const pt_vec3 n = pt_v3(0, 0, 1);
        const pt_hit hit = hit_of(n, n);
        const pt_bsdf b = pt_bsdf_make(&zero, &hit);
        pt_bsdf_sample_result s;
        pt_check(pt_bsdf_sample(&b, n, 0.9, pt_v2(0, 0), PT_RADIANCE, &s) && fabs(dbl(s.eta) - 1.5) < 1e-6,
                 "glass", "ior 0 stands for 1.5");
        pt_check(pt_bsdf_sample(&b, n, 0.0399, pt_v2(0, 0), PT_RADIANCE, &s) && dbl(s.eta) == 1, "glass",
                 "4 %% reflected at 1.5");
        pt_check(dbl(pt_bsdf_eval(&b, n, s.wi, PT_RADIANCE, PT_LOBE_ALL).r) == 0 &&
                     dbl(pt_bsdf_pdf_w(&b, n, s.wi, PT_RADIANCE)) == 0,
                 "glass", "eval and pdf of a delta are 0");
    }
}

/* Ten thousand total reflections in a slab do not wear the direction down. */
static void many_reflections(void)
{
    const pt_material m = pt_material_dielectric(real(1.5));
    pt_vec3 w = pt_v3_normalize(pt_v3(3, 1, 2));
    double length = 0;
    int i, got = 1;
    for (i = 0; i < 10000 && got; i++) {
        const pt_vec3 n = i & 1 ? pt_v3(0, 0, -1) : pt_v3(0, 0, 1);
        const pt_hit hit = hit_of(n, n);
        const pt_bsdf b = pt_bsdf_make(&m, &hit);
        pt_bsdf_sample_result s;
        got = pt_bsdf_sample(&b, pt_v3_neg(w), 0.9999999, pt_v2(0, 0), PT_RADIANCE, &s);
        w = s.wi;
        length = fmax(length, fabs(length3(w) - 1));
        got = got && dbl(s.weight.r) == 1;
    }
    pt_check(got && i == 10000 && length < 4 * pt_gamma(1) && fabs(fabs(dbl(w.z)) - 2 / sqrt(14)) < 1e-3,
             "ten thousand total reflections", "ended after %d, length off by %g, z %g", i, length, dbl(w.z));
}

/* ---------------------------------------------------------------------------------------------------------
   Lights */

typedef struct light_case {
    const char *name;
    pt_shape shape;
    double a[3], e1[3], e2[3]; /* corner and edges, or corners; or centre, and the radius in e1[0] */
    double irradiance;         /* at the origin, normal +y, radiance 1; < 0: Lambert's formula      */
} light_case;

/* Spheres: Snyder's closed form for a sphere partly below the horizon, radius 1, by distance and angle from
   the normal; the rest: Lambert. All lights face the origin. */
/* clang-format off */
static const light_case lights[] = {
    {"sphere overhead", PT_SHAPE_SPHERE, {0, 2, 0}, {1, 0, 0}, {0, 0, 0}, 0.78539816339744831},
    {"sphere at 45 degrees", PT_SHAPE_SPHERE,
     {1.4142135623730951, 1.4142135623730951, 0}, {1, 0, 0}, {0, 0, 0}, 0.55536036726979578},
    {"sphere at 75 degrees", PT_SHAPE_SPHERE,
     {1.9318516525781366, 0.51763809020504152, 0}, {1, 0, 0}, {0, 0, 0}, 0.22120088005301797},
    {"sphere half set", PT_SHAPE_SPHERE, {2, 0, 0}, {1, 0, 0}, {0, 0, 0}, 0.09058607370607955},
    {"sphere mostly set", PT_SHAPE_SPHERE,
     {1.9318516525781366, -0.51763809020504152, 0}, {1, 0, 0}, {0, 0, 0}, 0.017924877377216822},
    {"sphere near by", PT_SHAPE_SPHERE,
     {0.95262794416288243, 0.55, 0}, {1, 0, 0}, {0, 0, 0}, 1.5123866777456634},
    {"sphere far away", PT_SHAPE_SPHERE, {0, 60000, 80000}, {1, 0, 0}, {0, 0, 0}, 1.8849555921538759e-10},
    {"sphere around", PT_SHAPE_SPHERE, {0.25, -0.5, 0.125}, {2, 0, 0}, {0, 0, 0}, 3.1415926535897932},
    {"square at distance 1", PT_SHAPE_PARALLELOGRAM, {-0.5, 1, -0.5}, {1, 0, 0}, {0, 0, 1}, 0.752274688},
    {"square aside", PT_SHAPE_PARALLELOGRAM, {0.5, 1, -0.5}, {1, 0, 0}, {0, 0, 1}, 0.265004852},
    {"square on the axis", PT_SHAPE_PARALLELOGRAM, {-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, 1.7408395027342064},
    {"wall on the ground", PT_SHAPE_PARALLELOGRAM, {1, 0, -1}, {0, 0, 2}, {0, 2, 0}, 0.59732949128392144},
    {"wall half below", PT_SHAPE_PARALLELOGRAM, {1, -1, -1}, {0, 0, 2}, {0, 2, 0}, 0.35018828771389671},
    {"far square", PT_SHAPE_PARALLELOGRAM, {-0.5, 10000, -0.5}, {1, 0, 0}, {0, 0, 1}, 9.99999996666666e-9},
    {"skewed parallelogram", PT_SHAPE_PARALLELOGRAM, {-0.5, 1, -0.25}, {1, 0.25, 0.5}, {0.25, 0.5, 1}, -1},
    {"flat rhombus", PT_SHAPE_PARALLELOGRAM, {-1, 0.125, -1}, {4, 0, 1}, {-3, 0, 2}, -1},
    {"triangle", PT_SHAPE_TRIANGLE, {0, 1, 0.5}, {1, 1.5, 0}, {-0.2, 2, -0.7}, 0.25972937941581595},
    {"triangle through the horizon", PT_SHAPE_TRIANGLE,
     {0, -0.5, 1}, {1, 0.5, 0}, {1, 2, 0.5}, 0.28933394429811124},
    {"triangle light 1", PT_SHAPE_TRIANGLE,
     {-0.443432, 0.596366, 0.495985}, {-0.320397, 0.0677699, -0.229359}, {0.0341197, 0.11415, -0.343049},
     0.564476709},
    {"triangle light 2", PT_SHAPE_TRIANGLE,
     {0.461963, 0.397843, 0.412747}, {-0.0381582, 0.851323, -0.156872}, {0.195443, 0.891957, -0.260672},
     0.144010861},
    {"triangle light 3", PT_SHAPE_TRIANGLE,
     {0.100871, 0.289075, -0.422609}, {-0.308386, 0.629587, 0.423966}, {-0.373132, 0.237287, 0.351592},
     0.335644870},
    {"triangle light 4", PT_SHAPE_TRIANGLE,
     {-0.17575, 0.639397, 0.151268}, {0.318604, 0.732996, 0.459771}, {0.139095, 0.294498, 0.478556},
     0.129002537},
    {"triangle light 5", PT_SHAPE_TRIANGLE,
     {-0.17487, 0.447916, 0.367201}, {-0.405259, 0.249607, -0.354079}, {0.356029, 0.0918984, -0.132271},
     1.644560036}};
/* clang-format on */
enum { LIGHTS = sizeof lights / sizeof lights[0] };

static pt_vec3 of(const double v[3]) { return v3(v[0], v[1], v[2]); }

/* Adds the light so that it faces the origin (away = 0) or shows its back. */
static int make_light(pt_scene *scene, const light_case *l, int away)
{
    const int m = pt_add_material(scene, pt_material_emitter(pt_rgb3(1, 2, real(0.5))));
    const pt_vec3 a = of(l->a), b = of(l->e1), c = of(l->e2);
    const pt_vec3 n =
        l->shape == PT_SHAPE_TRIANGLE ? pt_v3_cross(pt_v3_sub(b, a), pt_v3_sub(c, a)) : pt_v3_cross(b, c);
    const int swap = (dot3(n, a) > 0) != away;
    pt_result r;
    if (l->shape == PT_SHAPE_SPHERE) pt_add_sphere(scene, a, b.x, m);
    if (l->shape == PT_SHAPE_TRIANGLE) pt_add_triangle(scene, a, swap ? c : b, swap ? b : c, m);
    if (l->shape == PT_SHAPE_PARALLELOGRAM) pt_add_parallelogram(scene, a, swap ? c : b, swap ? b : c, m);
    r = pt_commit(scene);
    pt_check(r == PT_OK && scene->light_count == 1, l->name, "%s", pt_scene_error(scene));
    return r == PT_OK;
}

static double closed_form(const light_case *l)
{
    pt_vec3 v[4];
    if (l->irradiance >= 0) return l->irradiance;
    v[0] = of(l->a);
    v[1] = pt_v3_add(v[0], of(l->e1));
    v[2] = pt_v3_add(v[1], of(l->e2));
    v[3] = pt_v3_add(v[0], of(l->e2));
    return pt_irradiance_polygon(1, pt_v3(0, 0, 0), pt_v3(0, 1, 0), v, 4);
}

/* Sampling a light: irradiance as in closed form, and each sample consistent with tracing a ray. */
static void one_light(const light_case *l, uint64_t seed)
{
    const double exact = closed_form(l);
    const uint32_t n = pt_test_samples(exact > 1e-6 && exact < 0.03 ? 1u << 19 : 1u << 17);
    const pt_vec3 o = pt_v3(0, 0, 0);
    pt_pcg32 rng = generator(seed);
    pt_scene scene = PT_SCENE_INIT;
    pt_stats e = PT_STATS_INIT;
    int i, none = 0, missed = 0, off = 0, pdf_off = 0, behind = 0;
    if (!make_light(&scene, l, 0)) return;
    for (i = 0; i < (int)n; i++) {
        pt_light_sample_result s;
        pt_hit hit;
        pt_ray ray = pt_spawn_ray(o, o, o, o);
        if (!pt_light_sample(&scene, 0, o, pair(&rng), &s)) {
            none++;
            continue;
        }
        pt_stats_add(&e, fmax(0, dbl(s.wi.y)) * dbl(s.radiance.r) / s.pdf_w);
        off += fabs(length3(s.wi) - 1) > unit_slack() || dbl(s.radiance.g) != 2 || s.delta ||
               distance3(pt_v3_scale(s.wi, s.distance), s.p) >
                   4 * unit_slack() * dbl(s.distance) + length3(s.p_error);
        behind += l->shape != PT_SHAPE_SPHERE && dot3(s.n, s.wi) >= 0;
        ray.d = s.wi;
        if (!pt_intersect(&scene, &ray, &hit))
            missed++; /* the rim of a sphere, the edge of a polygon */
        else {
            const pt_rgb emitted = pt_hit_emission(&scene, &hit, pt_v3_neg(s.wi));
            pdf_off +=
                pt_light_pdf_w(&scene, 0, o, ray.d, &hit) != s.pdf_w || hit.light != 0 || emitted.b != s.radiance.b;
        }
    }
    pt_check(none == 0, l->name, "%d of %u not sampled", none, n);
    pt_check(missed * 200 <= (int)n, l->name, "%d of %u sampled directions miss the light", missed, n);
    pt_check(off == 0, l->name, "%d samples: direction, distance, point or radiance do not fit together",
             off);
    pt_check(pdf_off == 0, l->name, "%d samples: pt_light_pdf_w gives another density", pdf_off);
    pt_check(behind == 0, l->name, "%d samples see the back of the light", behind);
    pt_check_mean(l->name, &e, exact, exact * 1e-6, 0.03, PT_TEST_VALUES,
                  "irradiance by light sampling is not the closed form");
    pt_scene_free(&scene);
}

static void irradiance(void)
{
    pt_test_source("Lambert 1760 for polygons, Snyder 1996 for spheres");
    int i;
    for (i = 0; i < LIGHTS; i++) one_light(&lights[i], (uint64_t)(300 + i));
}

/* Random directions find the light with the density that pt_light_pdf_w says: it integrates to 1. */
static void light_densities(void)
{
    pt_test_source("densities integrate to 1");
    const uint32_t n = pt_test_all_samples(1u << 18);
    int k;
    for (k = 0; k < LIGHTS; k++) {
        const light_case *const l = &lights[k];
        pt_pcg32 rng = generator((uint64_t)(400 + k));
        pt_scene scene = PT_SCENE_INIT;
        pt_stats s = PT_STATS_INIT;
        uint32_t i;
        if (fabs(l->a[1]) > 100) continue; /* too small to be found by luck */
        if (!make_light(&scene, l, 0)) return;
        for (i = 0; i < n; i++) {
            pt_ray ray =
                pt_spawn_ray(pt_v3(0, 0, 0), pt_v3(0, 0, 0), pt_v3(0, 0, 0), pt_warp_sphere(pair(&rng)));
            pt_hit hit;
            const int found = pt_intersect(&scene, &ray, &hit);
            pt_stats_add(&s, found ? pt_light_pdf_w(&scene, 0, ray.o, ray.d, &hit) * 4 * PT_PI : 0);
        }
        pt_check_mean(l->name, &s, 1, 1e-6, 0.25, PT_TEST_VALUES,
                      "the density of light sampling does not integrate to 1");
        pt_scene_free(&scene);
    }
}

static void backs_are_dark(void)
{
    const pt_vec3 o = pt_v3(0, 0, 0);
    int k;
    for (k = 0; k < LIGHTS; k++) {
        const light_case *const l = &lights[k];
        pt_scene scene = PT_SCENE_INIT;
        pt_light_sample_result s;
        pt_ray ray = pt_spawn_ray(o, o, o, o);
        pt_hit hit;
        if (l->shape == PT_SHAPE_SPHERE) continue;
        if (!make_light(&scene, l, 1)) return;
        pt_check(!pt_light_sample(&scene, 0, o, pt_v2(real(0.3), real(0.3)), &s), l->name,
                 "its back can be sampled");
        /* inside a triangle, and inside a parallelogram */
        ray.d = l->shape == PT_SHAPE_TRIANGLE
                    ? pt_v3_add(pt_v3_add(of(l->a), of(l->e1)), of(l->e2))
                    : pt_v3_add(of(l->a), pt_v3_scale(pt_v3_add(of(l->e1), of(l->e2)), real(0.4)));
        pt_check(pt_intersect(&scene, &ray, &hit), l->name, "its back cannot be hit");
        pt_check(dbl(pt_hit_emission(&scene, &hit, pt_v3_neg(pt_v3_normalize(ray.d))).r) == 0, l->name,
                 "its back shines");
        pt_check(pt_light_pdf_w(&scene, 0, o, ray.d, &hit) == 0, l->name, "its back has a density");
        pt_scene_free(&scene);
    }
}

/* Rows: density, angle and distance of a sphere seen from outside at the given distance. */
static void one_sphere_light(const pt_case *c)
{
    const double dist = pt_case_number(c->inputs, "dist"), r = pt_case_number(c->inputs, "r"),
                 omega = pt_case_number(c->expected, "omega");
    const double rel = pt_case_tolerance(c, !is_float(), "rel"),
                 rel_sint = pt_case_tolerance(c, !is_float(), "rel_sint"),
                 abs_t = pt_case_tolerance(c, !is_float(), "abs_t");
    const pt_vec3 axis = pt_v3(0, 0, 1);
    pt_scene scene = PT_SCENE_INIT;
    pt_light_sample_result s;
    const int m = pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(1)));
    pt_add_sphere(&scene, pt_v3(0, 0, real(dist)), real(r), m);
    if (pt_commit(&scene) == PT_OK &&
        pt_light_sample(&scene, 0, pt_v3(0, 0, 0), pt_v2(real(pt_case_number(c->inputs, "u")), real(0.125)),
                        &s)) {
        const double sint = length3(pt_v3_cross(s.wi, axis));
        pt_check_near(c->id, 1 / s.pdf_w / omega, 1, rel + 2 * pt_gamma(1), "solid angle of a sphere light");
        pt_check(dbl(s.wi.z) <= 1 && fabs(length3(s.wi) - 1) <= 4 * pt_gamma(1), c->id, "direction");
        if (pt_case_find(c->expected, "sint", '=')) {
            const double want = pt_case_number(c->expected, "sint");
            pt_check_near(c->id, sint, want, rel_sint * want + 1e-38, "sine of the sampled angle");
            pt_check_near(c->id, dbl(s.distance), pt_case_number(c->expected, "t"),
                          abs_t + pt_gamma(1) * dist, "distance of the sampled point");
            pt_check_near(c->id,
                          pt_irradiance_sphere(1, dbl(real(r)), dbl(real(dist)), 1) /
                              pt_case_number(c->expected, "irradiance_L1"),
                          1, 1e-13, "irradiance of a sphere light");
        }
    } else
        pt_check(pt_case_has(c, "soft"), c->id, "not sampled");
    pt_scene_free(&scene);
}

static void sphere_lights(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0;
    for (; file && pt_case_next(file, "sphere_light", &c); rows++) one_sphere_light(&c);
    if (file) fclose(file);
    pt_check(rows == 23, "rows of sphere lights", "%d", rows);
}

#if PTI_HAS_ENVIRONMENT
static void point_and_environment(void)
{
    pt_test_source("closed form: pi L under a sky; inverse square law");
    pt_scene scene = PT_SCENE_INIT;
    const pt_vec3 p = pt_v3(1, 2, 3);
    pt_light_sample_result s;
    pt_pcg32 rng = generator(90);
    pt_stats sky = PT_STATS_INIT;
    const uint32_t n = pt_test_samples(1u << 17);
    int i, wrong = 0, environment;
    pt_add_point_light(&scene, pt_v3(1, 5, -1), pt_rgb3(50, 0, 1));
    pt_set_environment(&scene, pt_rgb_grey(2));
    pt_check(pt_commit(&scene) == PT_OK && scene.light_count == 2, "point light and environment", "%s",
             pt_scene_error(&scene));
    environment = scene.environment_light;
    pt_check(pt_light_sample(&scene, 1 - environment, p, pt_v2(real(0.9), 0), &s) && s.delta == 1 &&
                 s.pdf_w == 1,
             "point light", "delta and pdf");
    pt_check(fabs(dbl(s.radiance.r) - 2) < 1e-6 && dbl(s.radiance.g) == 0 &&
                 fabs(dbl(s.distance) - 5) < 1e-6 && fabs(dbl(s.wi.y) - 0.6) < 1e-6,
             "point light", "I / d^2 from the right side: %g", dbl(s.radiance.r));
    pt_check(dbl(s.n.x) == 0 && dbl(s.n.y) == 0 && dbl(s.n.z) == 0 && distance3(s.p, pt_v3(1, 5, -1)) == 0,
             "point light", "has no normal");
    pt_check(!pt_light_sample(&scene, 1 - environment, pt_v3(1, 5, -1), pt_v2(0, 0), &s), "point light",
             "lights its own position");
    pt_check(pt_light_pdf_w(&scene, environment, p, v3(0, 1, 0), NULL) == dbl(pt_warp_sphere_pdf_w()) &&
                 pt_light_pdf_w(&scene, 1 - environment, p, v3(0, 1, 0), NULL) == 0,
             "environment", "density of a ray that leaves");
    for (i = 0; i < (int)n; i++) {
        wrong += !pt_light_sample(&scene, environment, p, pair(&rng), &s) || s.delta ||
                 dbl(s.radiance.r) != 2 || s.pdf_w != dbl(pt_warp_sphere_pdf_w()) || length3(s.n) > 0 ||
                 length3(s.p_error) > 0 || fabs(distance3(s.p, p) / dbl(s.distance) - 1) > 1e-5;
        pt_stats_add(&sky, fmax(0, dbl(s.wi.x)) * dbl(s.radiance.r) / s.pdf_w);
    }
    pt_check(wrong == 0, "environment", "%d samples are wrong", wrong);
    pt_check_mean("irradiance of an environment", &sky, 2 * PT_PI, 1e-6, 0.05, PT_TEST_VALUES, "pi L");
    pt_check(!pt_light_sample(&scene, -1, p, pt_v2(0, 0), &s) &&
                 !pt_light_sample(&scene, 2, p, pt_v2(0, 0), &s),
             "no such light", "sampled");
    pt_scene_free(&scene);
}
#endif

/* Chosen by their share of the power: pi A L, 4 pi I. */
static void choice_by_power(void)
{
    pt_test_source("shares of the power: pi A L, 4 pi I");
    pt_scene scene = PT_SCENE_INIT;
    const int dim = pt_add_material(&scene, pt_material_emitter(pt_rgb3(1, 2, 3))),
              bright = pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(8)));
    const double power[4] = {PT_PI * 4 * 2, PT_PI * 0.5 * 8, PT_PI * 4 * PT_PI * 0.25 * 2, 4 * PT_PI * 3};
    const double all = power[0] + power[1] + power[2] + power[3];
    const uint32_t n = pt_test_samples(1u << 17);
    pt_pcg32 rng = generator(91);
    double counts[4] = {0, 0, 0, 0}, expected[4], sum = 0;
    double pmf;
    int i, wrong = 0;
    pt_add_parallelogram(&scene, pt_v3(0, 5, 0), pt_v3(2, 0, 0), pt_v3(0, 0, 2), dim);
    pt_add_triangle(&scene, pt_v3(0, 0, 0), pt_v3(1, 0, 0), pt_v3(0, 0, 1), bright);
    pt_add_sphere(&scene, pt_v3(9, 0, 0), real(0.5), dim);
    pt_add_point_light(&scene, pt_v3(0, 1, 0), pt_rgb_grey(3));
    pt_check(pt_commit(&scene) == PT_OK && scene.light_count == 4, "four lights", "%s",
             pt_scene_error(&scene));
    for (i = 0; i < 4; i++) { /* lights are in the order of primitives: triangles, parallelograms, spheres */
        const pt_light *const l = &scene.lights[i];
        const int k =
            l->kind == PT_LIGHT_POINT ? 3 : (int)((unsigned)"\1\0\2"[scene.primitives[l->primitive].shape]);
        expected[i] = n * power[k] / all;
        pt_check_near("share of the power", l->pmf, power[k] / all, 1e-6,
                      "luminance times area times pi, twice for what shines on both sides");
        sum += l->pmf;
    }
    pt_check_near("shares of the power", sum, 1, 1e-14, "must add up to 1");
    for (i = 0; i < (int)n; i++) {
        const int k = pt_light_choose(&scene, dbl(number(&rng)), &pmf);
        wrong += k < 0 || k > 3 || fabs(pmf - scene.lights[k & 3].pmf) > 1e-7;
        counts[k & 3]++;
    }
    pt_check(wrong == 0, "pt_light_choose", "%d of %u choices", wrong, n);
    pt_check_chi2("pt_light_choose", counts, expected, 4, "does not follow the power");
    pt_scene_free(&scene);
    pt_check(pt_commit(&scene) == PT_OK && pt_light_choose(&scene, 0, &pmf) == -1, "pt_light_choose",
             "chooses a light where there is none");
    pt_scene_free(&scene);
}

/* ---------------------------------------------------------------------------------------------------------
   Light that leaves a light */

/* Each emitted ray carries L cos / (pdf_a pdf_w): the mean is the power, pi A L for each side. */
static void emitted_power(void)
{
    pt_test_source("closed form: pi A L for each side; cosine about the normal");
    const uint32_t n = pt_test_all_samples(1u << 14);
    int k;
    for (k = 0; k < LIGHTS; k++) {
        const light_case *const l = &lights[k];
        pt_pcg32 rng = generator((uint64_t)(500 + k));
        pt_scene scene = PT_SCENE_INIT;
        pt_stats power = PT_STATS_INIT;
        double counts[64] = {0}, exact;
        int i, off = 0, wrong_side = 0;
        if (!make_light(&scene, l, 0)) return;
        for (i = 0; i < (int)n; i++) {
            pt_light_emission_result s;
            double pdf_a, pdf_w, c;
            const pt_vec2 u = pair(&rng), v = pair(&rng);
            if (!pt_light_sample_le(&scene, 0, u, v, number(&rng), &s)) continue;
            pt_light_pdf_le(&scene, 0, s.n, s.w, &pdf_a, &pdf_w);
            c = dot3(s.n, s.w);
            pt_stats_add(&power, dbl(s.radiance.r) * s.cos_n / (s.pdf_a * s.pdf_w));
            off += fabs(pdf_a - s.pdf_a) > 1e-12 * pdf_a || fabs(pdf_w - s.pdf_w) > 1e-12 ||
                   fabs(fabs(c) - s.cos_n) > 8 * pt_gamma(1);
            wrong_side += l->shape != PT_SHAPE_SPHERE && c < 0;
            counts[cell(s.cos_n * s.cos_n, 16) * 4 + (c > 0) * 2 + (dbl(s.w.x) > 0)]++;
        }
        exact = PT_PI * scene.lights[0].area * (l->shape == PT_SHAPE_SPHERE ? 2 : 1);
        pt_check(off == 0, l->name, "%d of %u emitted rays: pt_light_pdf_le disagrees, or cos_n is wrong",
                 off, n);
        pt_check(wrong_side == 0, l->name, "%d of %u rays leave the back", wrong_side, n);
        pt_check_mean(l->name, &power, exact, 1e-5 * exact, 0.001, PT_TEST_VALUES,
                      "emitted power is not pi A L");
        if (l->shape == PT_SHAPE_SPHERE)
            expect_uniform(l->name, counts, 64, "emitted directions: cosine, both sides alike");
        pt_scene_free(&scene);
    }
}

/* Uniform points: a triangle in 16 equal parts, a parallelogram in 64, a sphere in 64. */
static void emitted_points(void)
{
    pt_test_source("uniform by area");
    static const int which[3] = {0, 14, 16};
    const uint32_t n = pt_test_samples(1u << 15);
    int k;
    for (k = 0; k < 3; k++) {
        const light_case *const l = &lights[which[k]];
        pt_pcg32 rng = generator((uint64_t)(600 + k));
        pt_scene scene = PT_SCENE_INIT;
        double counts[64] = {0}, b[2];
        int i, j, off = 0;
        if (!make_light(&scene, l, 0)) return;
        for (i = 0; i < (int)n; i++) {
            pt_light_emission_result s;
            const pt_vec2 u = pair(&rng), v = pair(&rng);
            pt_vec3 corners[3];
            if (!pt_light_sample_le(&scene, 0, u, v, number(&rng), &s)) continue;
            if (l->shape == PT_SHAPE_SPHERE) {
                const pt_vec3 d = pt_v3_sub(s.p, of(l->a));
                off += fabs(length3(d) - l->e1[0]) > 8 * pt_gamma(1) * 4 || distance3(d, s.n) > 1e-5;
                counts[cell(0.5 + 0.5 * dbl(d.z), 8) * 8 + cell(turn(dbl(d.y), dbl(d.x)), 8)]++;
                continue;
            }
            corners[0] = of(l->a);
            corners[1] = l->shape == PT_SHAPE_TRIANGLE ? of(l->e1) : pt_v3_add(of(l->a), of(l->e1));
            corners[2] = l->shape == PT_SHAPE_TRIANGLE ? of(l->e2) : pt_v3_add(of(l->a), of(l->e2));
            weights_on((const pt_vec3 *)corners, s.p,
                       b); /* the ray from the origin through p crosses the plane in p */
            if (l->shape == PT_SHAPE_PARALLELOGRAM)
                counts[cell(b[0], 8) * 8 + cell(b[1], 8)]++;
            else {
                const int x = cell(b[0], 4), y = cell(b[1], 4),
                          upper = b[0] * 4 - x + b[1] * 4 - y > 1 && x + y < 3;
                j = x * (8 - x) + 2 * y + upper;
                counts[j < 16 ? j : 15]++;
            }
        }
        pt_check(off == 0, l->name, "%d points are not on the sphere", off);
        expect_uniform(l->name, counts, l->shape == PT_SHAPE_TRIANGLE ? 16 : 64,
                       "points on the light are not uniform");
        pt_scene_free(&scene);
    }
}

/* The share of a square's light that falls on another: form factors of unit squares (Howell's catalogue). */
static void form_factors(void)
{
    pt_test_source("unit squares: opposite and perpendicular (Howell 2010)");
    static const double exact[2] = {0.19982489569838738, 0.20004377607540315};
    const uint32_t n = pt_test_samples(1u << 18);
    int k;
    for (k = 0; k < 2; k++) {
        pt_pcg32 rng = generator((uint64_t)(610 + k));
        pt_scene scene = PT_SCENE_INIT;
        pt_stats share = PT_STATS_INIT;
        const int lamp = pt_add_material(&scene, pt_material_emitter(pt_rgb_grey(1))),
                  dark = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(0)));
        uint32_t i;
        pt_add_parallelogram(&scene, pt_v3(0, 0, 0), pt_v3(0, 0, 1), pt_v3(1, 0, 0), lamp); /* looks up */
        if (k == 0)
            pt_add_parallelogram(&scene, pt_v3(0, 1, 0), pt_v3(1, 0, 0), pt_v3(0, 0, 1), dark);
        else
            pt_add_parallelogram(&scene, pt_v3(0, 0, 0), pt_v3(1, 0, 0), pt_v3(0, 1, 0), dark);
        pt_check(pt_commit(&scene) == PT_OK, "two squares", "%s", pt_scene_error(&scene));
        for (i = 0; i < n; i++) {
            const pt_vec2 u = pair(&rng), v = pair(&rng);
            pt_light_emission_result s;
            pt_hit hit;
            pt_ray ray;
            pt_light_sample_le(&scene, 0, u, v, 0, &s);
            ray = pt_spawn_ray(s.p, s.p_error, s.n, s.w);
            pt_stats_add(&share,
                         pt_intersect(&scene, &ray, &hit) ? s.cos_n / (s.pdf_a * s.pdf_w) / PT_PI : 0);
        }
        pt_check_mean(k == 0 ? "form factor of opposite squares" : "form factor of squares at an edge",
                      &share, exact[k], 1e-7, 0.05, PT_TEST_VALUES,
                      "emitted rays do not arrive where they should");
        pt_scene_free(&scene);
    }
}

#if PTI_HAS_ENVIRONMENT
/* A point light sends 4 pi I in all directions; a sky L sends 4 pi r^2 pi L onto a ball of radius r. */
static void emission_of_the_rest(void)
{
    pt_test_source("closed form: 4 pi I; 4 pi r^2 pi L onto a ball");
    const uint32_t n = pt_test_samples(1u << 17);
    pt_scene scene = PT_SCENE_INIT;
    pt_pcg32 rng = generator(620);
    pt_stats onto = PT_STATS_INIT, point = PT_STATS_INIT;
    double counts[64] = {0};
    const int white = pt_add_material(&scene, pt_material_diffuse(pt_rgb_grey(1)));
    int i, environment, off = 0;
    pt_add_sphere(&scene, pt_v3(3, -1, 2), real(0.75), white);
    pt_add_point_light(&scene, pt_v3(1, 2, 3), pt_rgb_grey(5));
    pt_set_environment(&scene, pt_rgb_grey(2));
    pt_check(pt_commit(&scene) == PT_OK, "a ball under a sky", "%s", pt_scene_error(&scene));
    environment = scene.environment_light;
    for (i = 0; i < (int)n; i++) {
        pt_light_emission_result s;
        pt_vec2 u = pair(&rng), v = pair(&rng);
        double pdf_a, pdf_w;
        pt_ray ray;
        pt_hit hit;
        pt_light_sample_le(&scene, environment, u, v, 0, &s);
        pt_light_pdf_le(&scene, environment, s.n, s.w, &pdf_a, &pdf_w);
        off += pdf_a != s.pdf_a || pdf_w != s.pdf_w || s.cos_n != 1;
        ray = pt_spawn_ray(s.p, s.p_error, s.n, s.w);
        pt_stats_add(&onto, pt_intersect(&scene, &ray, &hit) && dot3(hit.ng, s.w) < 0
                                ? dbl(s.radiance.g) / (s.pdf_a * s.pdf_w)
                                : 0);
        u = pair(&rng);
        v = pair(&rng);
        pt_light_sample_le(&scene, 1 - environment, u, v, 0, &s);
        pt_stats_add(&point, dbl(s.radiance.g) * s.cos_n / (s.pdf_a * s.pdf_w));
        off += distance3(s.p, pt_v3(1, 2, 3)) > 0 || s.cos_n != 1 || s.pdf_a != 1;
        counts[cell(0.5 + 0.5 * dbl(s.w.z), 8) * 8 + cell(turn(dbl(s.w.y), dbl(s.w.x)), 8)]++;
    }
    pt_check(off == 0, "point light and environment", "%d emitted rays", off);
    pt_check_mean("light of the sky on a ball", &onto, 4 * PT_PI * 0.75 * 0.75 * PT_PI * 2, 1e-5, 0.05,
                  PT_TEST_VALUES, "pi L on its surface");
    pt_check_mean("power of a point light", &point, 4 * PT_PI * 5, 1e-4, 0.001, PT_TEST_VALUES, "4 pi I");
    expect_uniform("directions of a point light", counts, 64, "not uniform");
    pt_scene_free(&scene);
}
#endif

/* ---------------------------------------------------------------------------------------------------------
   The camera */

static pt_camera test_camera(double lens)
{
    pt_camera c = pt_camera_look_at(pt_v3(1, 2, 3), pt_v3(-2, 1, -1), pt_v3(real(0.1), 1, 0), 50);
    c.lens_radius = real(lens);
    c.focus_distance = real(lens > 0 ? 4 : 0);
    return c;
}

static void camera_frame(void)
{
    const pt_camera c = test_camera(0);
    const pt_vec2 middle = pt_v2(real(0.5), real(0.5));
    const double half = tan(25 * PT_PI / 180), slack = 8 * pt_gamma(1);
    const pt_ray centre = pt_camera_ray(&c, 2, real(0.5), real(0.5), middle),
                 top = pt_camera_ray(&c, 2, real(0.5), 0, middle),
                 left = pt_camera_ray(&c, 2, 0, real(0.5), middle);
    const pt_vec3 forward = pt_v3_normalize(pt_v3(-3, -1, -4));
    pt_check(fabs(dbl(c.tan_half) - half) < slack && distance3(c.forward, forward) < slack,
             "pt_camera_look_at", "forward or angle");
    pt_check(distance3(pt_v3_cross(c.forward, c.up), c.right) < slack && dbl(c.up.y) > 0, "pt_camera_look_at",
             "right is forward x up");
    pt_check(distance3(centre.d, c.forward) < slack && distance3(centre.o, c.position) == 0,
             "ray of the centre", "goes forward");
    pt_check(fabs(dot3(top.d, c.up) / dot3(top.d, c.forward) - half) < slack &&
                 fabs(dot3(top.d, c.right)) < slack,
             "ray of the top", "y = 0 is the top row, half the angle up");
    pt_check(fabs(dot3(left.d, c.right) / dot3(left.d, c.forward) + 2 * half) < slack &&
                 fabs(dot3(left.d, c.up)) < slack,
             "ray of the left", "x = 0 is the left column, aspect times half the angle");
}

static void cameras_that_cannot_be(void)
{
    const pt_vec3 o = pt_v3(0, 0, 0), z = pt_v3(0, 0, -1), y = pt_v3(0, 1, 0);
    const pt_real nan = real(HUGE_VAL - HUGE_VAL);
    pt_camera c;
    double fov;
    pt_check(dbl(pt_camera_look_at(o, y, y, 40).tan_half) == 0, "camera",
             "up parallel to the view is accepted");
    pt_check(dbl(pt_camera_look_at(o, o, y, 40).tan_half) == 0, "camera", "eye = target is accepted");
    pt_check(dbl(pt_camera_look_at(o, z, o, 40).tan_half) == 0, "camera", "up = 0 is accepted");
    pt_check(dbl(pt_camera_look_at(o, z, y, 0).tan_half) == 0 &&
                 dbl(pt_camera_look_at(o, z, y, 180).tan_half) == 0,
             "camera", "angles 0 or 180 are accepted");
    pt_check(dbl(pt_camera_look_at(pt_v3(nan, 0, 0), z, y, 40).tan_half) == 0 &&
                 dbl(pt_camera_look_at(o, z, y, nan).tan_half) == 0,
             "camera", "NaN is accepted");
    for (fov = 1e-3; fov < 180; fov = fov * 3 < 179.9 || fov > 179 ? fov * 3 : 179.9) {
        const pt_vec2 lens = pt_v2(0, real(0.999));
        pt_ray ray;
        c = pt_camera_look_at(pt_v3(1e6, 0, 0), pt_v3(1e6, 3, -4), y, real(fov));
        ray = pt_camera_ray(&c, real(1.5), 0, real(0.999), lens);
        pt_check(fabs(length3(ray.d) - 1) < 4 * pt_gamma(1), "camera", "angle %g: a ray of length %g", fov,
                 length3(ray.d));
    }
}

/* A ray through a picture point and back by pt_camera_we: the same point, and importance over density 1. */
static void camera_round_trip(void)
{
    static const double lens[2] = {0, 0.3};
    pt_pcg32 rng = generator(630);
    int k, i;
    for (k = 0; k < 2; k++) {
        const pt_camera c = test_camera(lens[k]);
        int outside = 0, off = 0, ratio = 0;
        for (i = 0; i < 5000; i++) {
            const pt_vec2 at = pair(&rng), u = pair(&rng);
            const pt_ray ray = pt_camera_ray(&c, real(1.5), at.x, at.y, u);
            const double distance = uniform(&rng, 0.5, 20);
            const pt_vec3 p = pt_v3_add(ray.o, pt_v3_scale(ray.d, real(distance)));
            pt_camera_we_result w;
            double pdf_a, pdf_w;
            if (!pt_camera_we(&c, real(1.5), p, u,
                              &w)) { /* a picture point on the rim may fall outside by rounding */
                outside +=
                    dbl(at.x) > 1e-5 && dbl(at.x) < 1 - 1e-5 && dbl(at.y) > 1e-5 && dbl(at.y) < 1 - 1e-5;
                continue;
            }
            pt_camera_pdf(&c, real(1.5), ray.d, &pdf_a, &pdf_w);
            off += fabs(dbl(w.x) - dbl(at.x)) > 1e-4 || fabs(dbl(w.y) - dbl(at.y)) > 1e-4 ||
                   fabs(w.distance - distance) > 1e-4 || distance3(w.wi, pt_v3_neg(ray.d)) > 1e-5 ||
                   distance3(w.lens, ray.o) > 1e-6 || fabs(w.cos_lens - dot3(ray.d, c.forward)) > 1e-5;
            ratio += fabs(w.we * w.cos_lens / (pdf_a * pdf_w) - 1) > 1e-5 ||
                     fabs(w.pdf_w / (distance * distance * pdf_a / w.cos_lens) - 1) > 1e-4;
        }
        pt_check(outside == 0, "camera, there and back", "lens %g: %d points are not in the picture", lens[k],
                 outside);
        pt_check(off == 0, "camera, there and back", "lens %g: %d points come back elsewhere", lens[k], off);
        pt_check(ratio == 0, "camera, there and back",
                 "lens %g: %d times we cos / (pdf_a pdf_w) is not 1, or pdf_w is not d^2 pdf_a / cos",
                 lens[k], ratio);
    }
}

/* Points of a sphere around the camera, all of radiance L towards it, measure L: the integral of importance.
   And the density of camera rays integrates to 1 over directions. */
static void measurement(void)
{
    pt_test_source("the importance of a camera integrates to 1 (Veach 1997)");
    static const double lens[2] = {0, 0.3};
    const uint32_t n = pt_test_samples(1u << 18);
    const double omc = 0.25, radius = 7; /* a cone that holds the picture */
    int k;
    for (k = 0; k < 2; k++) {
        const pt_camera c = test_camera(lens[k]);
        const pt_frame frame = pt_frame_from_normal(c.forward);
        pt_pcg32 rng = generator((uint64_t)(640 + k));
        pt_stats measured = PT_STATS_INIT, whole = PT_STATS_INIT;
        uint32_t i;
        for (i = 0; i < n; i++) {
            const pt_vec3 d = pt_frame_to_world(&frame, pt_warp_cone(pair(&rng), omc));
            const pt_vec3 p = pt_v3_add(c.position, pt_v3_scale(d, real(radius)));
            const double pdf_area = pt_warp_cone_pdf_w(omc) / (radius * radius);
            pt_camera_we_result w;
            double pdf_a, pdf_w;
            const int seen_here = pt_camera_we(&c, real(1.25), p, pair(&rng), &w);
            pt_stats_add(&measured, seen_here ? -dot3(w.wi, d) * w.we / w.pdf_w / pdf_area : 0);
            pt_camera_pdf(&c, real(1.25), d, &pdf_a, &pdf_w);
            pt_stats_add(&whole, pt_camera_we(&c, real(1.25), p, pt_v2(real(0.5), real(0.5)), &w)
                                     ? pdf_w / pt_warp_cone_pdf_w(omc)
                                     : 0);
        }
        pt_check_mean(
            k == 0 ? "a pinhole measures radiance" : "a lens measures radiance", &measured, 1, 1e-6, 0.02,
            PT_TEST_VALUES,
            "We = 1 / (A_film A_lens cos^4), cosine at the point, over the densities of point and lens");
        if (k == 0)
            pt_check_mean("density of camera rays", &whole, 1, 1e-6, 0.02, PT_TEST_VALUES,
                          "pt_camera_pdf must integrate to 1");
    }
}

/* All rays of a picture point meet in the plane in focus; elsewhere they fill the circle of confusion. */
static void thin_lens(void)
{
    pt_test_source("second moment of a uniform disk: r^2/4; similar triangles");
    const pt_camera c = test_camera(0.3);
    const uint32_t n = pt_test_samples(1u << 14);
    const double z[2] = {2, 10};
    pt_pcg32 rng = generator(650);
    pt_vec3 focus = c.position;
    pt_stats second[2];
    double spread = 0, widest[2] = {0, 0};
    uint32_t i;
    int k;
    memset(second, 0, sizeof second);
    for (i = 0; i < n; i++) {
        const pt_ray ray = pt_camera_ray(&c, real(1.5), real(0.8), real(0.3), pair(&rng));
        const double s = dot3(ray.d, c.forward);
        const pt_vec3 p = pt_v3_add(ray.o, pt_v3_scale(ray.d, real(4 / s)));
        if (i == 0) focus = p;
        spread = fmax(spread, distance3(p, focus));
        for (k = 0; k < 2; k++) { /* the ray through the centre of the lens marks the centre of the circle */
            const pt_vec3 q = pt_v3_add(ray.o, pt_v3_scale(ray.d, real(z[k] / s)));
            const pt_vec3 middle =
                pt_v3_add(c.position, pt_v3_scale(pt_v3_sub(focus, c.position), real(z[k] / 4)));
            const double r = distance3(q, middle);
            widest[k] = fmax(widest[k], r);
            pt_stats_add(&second[k], r * r);
        }
    }
    pt_check(spread < 100 * pt_gamma(1), "thin lens", "rays miss their common point by %g", spread);
    for (k = 0; k < 2; k++) {
        const double circle = 0.3 * fabs(z[k] - 4) / 4;
        pt_check(widest[k] < circle * 1.0001 && (widest[k] > circle * 0.99 || n < 4096),
                 "circle of confusion", "radius %g, should be %g", widest[k], circle);
        pt_check_mean("circle of confusion", &second[k], circle * circle / 2, 1e-6, 0.05, PT_TEST_VALUES,
                      "the lens is not uniform");
    }
}

int main(int argc, char **argv)
{
    pt_test_begin("test_sampling", argc, argv);
    PT_TEST(warps);
    PT_TEST(cones);
    PT_TEST_EXACT(corners_of_the_square);
    PT_TEST(densities);
    PT_TEST(spherical_triangles);
    PT_TEST(spherical_rectangles);
    PT_TEST(alias_tables);
    PT_TEST(diffuse);
    PT_TEST(diffuse_directions);
    PT_TEST_EXACT(black_and_mirror);
    PT_TEST_EXACT(edge_on);
    PT_TEST_EXACT(lights_edge_on);
    PT_TEST_EXACT(fresnel_rows);
    PT_TEST(fresnel_of_diffuse_light);
    PT_TEST_EXACT(glass);
    PT_TEST_EXACT(many_reflections);
    PT_TEST(irradiance);
    PT_TEST(light_densities);
    PT_TEST_EXACT(backs_are_dark);
    PT_TEST_EXACT(sphere_lights);
#if PTI_HAS_ENVIRONMENT
    PT_TEST(point_and_environment);
#endif
    PT_TEST(choice_by_power);
    PT_TEST(emitted_power);
    PT_TEST(emitted_points);
    PT_TEST(form_factors);
#if PTI_HAS_ENVIRONMENT
    PT_TEST(emission_of_the_rest);
#endif
    PT_TEST_EXACT(camera_frame);
    PT_TEST_EXACT(cameras_that_cannot_be);
    PT_TEST_EXACT(camera_round_trip);
    PT_TEST(measurement);
    PT_TEST(thin_lens);
    return pt_test_end();
}
