/* test_materials.c: every material of [PT-08] against what is known exactly. Fresnel's formulas, GGX, Phong and
   Blinn-Phong, Oren-Nayar, the coat, measured tables, textures: exact values are rows of
   tests/data/oracles_bsdf.csv (its head names the sources), closed forms, or integrals by quadrature of eval;
   eval, pdf and sample of every material must tell one story. Reading of tables and pictures, and what a scene
   refuses, stand at the end. */

#include <stdlib.h>

/* Memory that runs out on demand, or where a gigabyte is asked for, and is counted. */
static long allocations_left = -1, allocations_alive; /* -1: as many as wanted */
static void *limited_realloc(void *old, size_t size)
{
    void *p;
    if (allocations_left == 0 || size > (size_t)1 << 30) return NULL;
    if (allocations_left > 0) allocations_left--;
    p = realloc(old, size);
    if (p && !old) allocations_alive++;
    return p;
}
static void limited_free(void *p)
{
    allocations_alive -= p != NULL;
    free(p);
}
#define PT_MALLOC(size, user) limited_realloc(NULL, size)
#define PT_REALLOC(pointer, size, user) limited_realloc(pointer, size)
#define PT_FREE(pointer, user) limited_free(pointer)
#define PT_STATIC /* its own memory functions need an implementation of its own */
#include "pt_rows.h"

#define ROWS_PATH "tests/data/oracles_bsdf.csv"
#define FILE_PATH "build/test/materials_tmp"

static double dbl(pt_real x) { return (double)x; }
static pt_real real(double x) { return (pt_real)x; }
static double dot3(pt_vec3 a, pt_vec3 b)
{
    return dbl(a.x) * dbl(b.x) + dbl(a.y) * dbl(b.y) + dbl(a.z) * dbl(b.z);
}
static int is_float(void) { return sizeof(pt_real) == sizeof(float); }
static pt_vec3 v3(double x, double y, double z) { return pt_v3(real(x), real(y), real(z)); }
static pt_vec2 v2(double x, double y) /* rounding must not give 1 */
{
    const double below_one = is_float() ? 1 - 0x1p-24 : 1 - 0x1p-53;
    return pt_v2(real(fmin(x, below_one)), real(fmin(y, below_one)));
}
static pt_rgb rgb(double r, double g, double b) { return pt_rgb3(real(r), real(g), real(b)); }
static double degrees(double x) { return x * PT_PI / 180; }
static int finite_rgb(pt_rgb c) { return isfinite(dbl(c.r)) && isfinite(dbl(c.g)) && isfinite(dbl(c.b)); }
static double least(pt_rgb c) { return fmin(dbl(c.r), fmin(dbl(c.g), dbl(c.b))); }

static pt_vec2 pair(pt_pcg32 *rng)
{
    const pt_real x = pt_real_from_u32(pt_pcg32_next(rng)), y = pt_real_from_u32(pt_pcg32_next(rng));
    return pt_v2(x, y);
}
static pt_pcg32 generator(uint64_t k) { return pt_pcg32_make(pt_test_seed(k), k); }

/* The direction at an angle to z and an azimuth. */
static pt_vec3 polar(double theta, double phi)
{
    return v3(sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta));
}

static pt_hit hit_of(pt_vec3 ng, pt_vec3 ns)
{
    pt_hit hit;
    memset(&hit, 0, sizeof hit);
    hit.ng = ng;
    hit.ns = ns;
    return hit;
}
static pt_bsdf upright(const pt_material *m)
{
    const pt_hit hit = hit_of(pt_v3(0, 0, 1), pt_v3(0, 0, 1));
    return pt_bsdf_make(m, &hit);
}

/* A metal that reflects everything: 1 - F is at most 4 eta / (2 |n| + 2), |n| the modulus of its index. */
static pt_material perfect_metal(double alpha)
{
    return pt_material_conductor(pt_rgb_grey(real(1e-10)), pt_rgb_grey(real(1e10)), real(sqrt(alpha)));
}

/* ---------------------------------------------------------------------------------------------------------
   Fresnel's formulas */

/* Indices such as "1/1.5" are ratios. */
static double ratio(const row *r, const char *key)
{
    const char *const at = pt_case_find(r->params, key, '=');
    char *end;
    const double x = at ? strtod(at, &end) : 0;
    return at && *end == '/' ? x / strtod(end + 1, NULL) : x;
}

/* Exact: tables BSDF-FD and -FDX (Fresnel's equations). An angle of 90 degrees has a cosine of 6e-17. */
static void fresnel_polarised(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("BSDF-FD", NULL, &at)) != NULL) {
        const pt_fresnel f = pt_fresnel_make(cos(degrees(parameter(r, "theta_deg"))), ratio(r, "eta"));
        const double got = strcmp(r->quantity, "Rs") == 0 ? f.rs : strcmp(r->quantity, "Rp") == 0 ? f.rp : f.r;
        pt_check_near(label("%s %s %s", r->id, r->quantity, r->params), got, r->value, 1e-13,
                      "see pt_fresnel_make: s is across, p in the plane of incidence");
    }
    at = 0;
    while ((r = next_row("BSDF-FDX", "brewster_deg", &at)) != NULL) {
        const double eta = parameter(r, "eta"), b = degrees(r->value);
        const double critical = degrees(find_row("BSDF-FDX", "critical_deg", r->params)->value);
        const pt_fresnel f = pt_fresnel_make(cos(b), eta), beyond = pt_fresnel_make(cos(critical + 1e-9), 1 / eta);
        const pt_fresnel before = pt_fresnel_make(cos(critical - 1e-3), 1 / eta);
        pt_check(f.rp < 1e-28, "Brewster's angle", "eta %g: reflects %g of p", eta, f.rp);
        pt_check_near("Brewster's angle", f.r, find_row("BSDF-FDX", "R_at_brewster", r->params)->value, 1e-14,
                      "half of R_s");
        pt_check(beyond.rs >= 1 && beyond.rp >= 1 && beyond.r >= 1 && beyond.cos_t <= 0, "total reflection",
                 "eta %g: r %g, cos_t %g", eta, beyond.r, beyond.cos_t);
        pt_check(before.rs < 1 && before.rp < before.rs && before.cos_t > 0, "just below the critical angle",
                 "eta %g: R_s %g, R_p %g, cos_t %g", eta, before.rs, before.rp, before.cos_t);
    }
}

/* Exact: table BSDF-SCHLICK. From the dense side the cosine is that of refraction. */
static void schlick(void)
{
    const row *r;
    double cos_t;
    int at = 0, i;
    while ((r = next_row("BSDF-SCHLICK", NULL, &at)) != NULL) {
        const double eta = parameter(r, "eta");
        double sum = 0;
        if (strcmp(r->quantity, "deviation") == 0) {
            const double c = cos(degrees(parameter(r, "theta_deg")));
            sum = pt_fresnel_schlick(c, eta) - pt_fresnel_make(c, eta).r;
        } else { /* 2 int R mu dmu with mu = t^2, by the midpoint rule */
            for (i = 0; i < 4096; i++) {
                const double t = (i + 0.5) / 4096;
                sum += 4 * t * t * t * pt_fresnel_schlick(t * t, eta) / 4096;
            }
        }
        pt_check_near(label("%s %s %s", r->id, r->quantity, r->params), sum, r->value,
                      strcmp(r->quantity, "deviation") == 0 ? 1e-14 : 1e-6, "r0 + (1 - r0)(1 - cos)^5");
    }
    for (i = 1; i <= 90; i++) {
        const double c = cos(degrees(i)), eta = 1.5, out = pt_fresnel_schlick(c, 1 / eta);
        (void)pt_fresnel_dielectric(c, 1 / eta, &cos_t);
        pt_check_near("Schlick from inside", out, cos_t > 0 ? pt_fresnel_schlick(cos_t, eta) : 1, 1e-12,
                      "use the cosine on the thin side; 1 at total reflection");
    }
}

/* Exact: table BSDF-FDR (Walsh's closed form). Near 1 against quadrature: mu^2 uniform by Gauss's two points
   in 2^14 parts; from the thin side the integrand is steep only near grazing, where sqrt hides it. */
static void fresnel_of_diffuse_light(void)
{
    static const double near_one[] = {1.00001, 1.00009, 1.000101, 1.0003, 1.001, 1.01, 4, 100};
    const row *r;
    int at = 0, i, k;
    while ((r = next_row("BSDF-FDR", NULL, &at)) != NULL) {
        const double eta = parameter(r, "eta"), got = pt_fresnel_diffuse(r->quantity[2] == 'e' ? eta : 1 / eta);
        if (strncmp(r->quantity, "R_", 2) != 0) continue; /* the fit */
        pt_check_near(label("%s %s %s", r->id, r->quantity, r->params), got, r->value, 1e-12,
                      "see pt_fresnel_diffuse; inside 1 - (1 - R)/n^2");
    }
    for (k = 0; k < (int)(sizeof near_one / sizeof near_one[0]); k++) {
        double sum = 0;
        for (i = 0; i < 1 << 15; i++) { /* mu = t^2: R mu dmu = R t^2 2 t dt, smooth at grazing */
            const double t = ((i / 2) + 0.5 + (i % 2 ? 0.5 : -0.5) / sqrt(3)) / (1 << 14);
            sum += 4 * t * t * t * pt_fresnel_make(t * t, near_one[k]).r / (1 << 15);
        }
        pt_check_near(label("diffuse light, index %g", near_one[k]), pt_fresnel_diffuse(near_one[k]), sum, 1e-7,
                      "cancellation near 1, or the wrong switch to the first order");
    }
    pt_check(pt_fresnel_diffuse(1) <= 0, "diffuse light, index 1", "reflects %g", pt_fresnel_diffuse(1));
}

/* Exact: table BSDF-FC (Fresnel's equations with a complex index). The material, smooth, carries the same. */
static void metals(void)
{
    const row *r;
    int at = 0, i;
    while ((r = next_row("BSDF-FC", NULL, &at)) != NULL) {
        const double eta = parameter(r, "eta"), k = parameter(r, "k"), t = degrees(parameter(r, "theta_deg"));
        pt_material m = pt_material_conductor(pt_rgb_grey(real(eta)), pt_rgb_grey(real(k)), 0);
        const pt_vec3 wo = polar(t, 2);
        pt_bsdf b;
        pt_bsdf_sample_result s = {{0, 0, 0}, {0, 0, 0}, 0, 0, 0, 0};
        m.albedo = rgb(0.5, 1, 0.25);
        b = upright(&m);
        pt_check_near(label("%s %s %s", r->id, r->quantity, r->params), pt_fresnel_conductor(cos(t), eta, k),
                      r->value, 1e-13, "see pt_fresnel_conductor: index eta - i k");
        pt_check(pt_bsdf_sample(&b, wo, 0.5, pt_v2(0, 0), PT_RADIANCE, &s) && s.lobe == PT_LOBE_SPECULAR &&
                     fabs(dbl(s.weight.g) - r->value) < 64 * pt_gamma(1) &&
                     fabs(dbl(s.weight.r) - 0.5 * r->value) < 64 * pt_gamma(1) && dbl(s.wi.z) == dbl(wo.z),
                 r->id, "the weight of smooth metal of albedo (0.5, 1) is (%g, %g)", dbl(s.weight.r), dbl(s.weight.g));
    }
    for (i = 0; i <= 90; i++) { /* k = 0 is glass, from outside and from inside */
        const double c = i < 90 ? cos(degrees(i)) : 0;
        pt_check_near("metal without absorption", pt_fresnel_conductor(c, 1.5, 0), pt_fresnel_make(c, 1.5).r, 1e-13,
                      "must be a dielectric");
        pt_check_near("the same from inside", pt_fresnel_conductor(c, 1 / 1.5, 0), pt_fresnel_make(c, 1 / 1.5).r, 1e-7,
                      "must be a dielectric, total reflection included");
        pt_check(pt_fresnel_conductor(c, 1e-10, 1e10) >= 1 - 1e-15, "perfect metal", "reflects less at %d", i);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Integrals over the sphere. Polar coordinates about an axis: 16 x 16 cells of s and the azimuth, where
   1 - cos of the angle to the axis is 2 s^power; a larger power serves a sharper lobe. Each cell is cut into
   m x m parts of Gauss's 2 x 2 points; the difference between m and m * 2 / 3 is the error that is assumed
   (a factor of 5 above the true one for a smooth function, and about it for one that jumps). */

enum { ACROSS = 16, CELLS = ACROSS * ACROSS };

typedef struct story {
    const char *name;
    const pt_bsdf *b;
    pt_vec3 wo, axis;
    pt_transport mode;
    double power;
    int side; /* +1: reflection only, -1: refraction only, 0: all */
    int m;    /* parts of a cell; 0 = 6 */
} story;

static int same_side(const story *s, pt_vec3 w) { return dot3(s->wo, s->b->ng) * dot3(w, s->b->ng) >= 0 ? 1 : -1; }

static pt_vec3 direction_at(const story *s, const pt_frame *f, double u, double v)
{
    const double x = 2 * pow(u, s->power), r = sqrt(x * (2 - x));
    const pt_vec3 l = v3(r * cos(2 * PT_PI * v), r * sin(2 * PT_PI * v), 1 - x);
    return pt_v3_normalize(pt_frame_to_world(f, l));
}

static int cell_at(const story *s, const pt_frame *f, pt_vec3 w)
{
    const pt_vec3 d = pt_v3_sub(w, s->axis);
    const double u = pow(fmin(1, dot3(d, d) / 4), 1 / s->power);
    const double v = atan2(dot3(w, f->t), dot3(w, f->s)) / (2 * PT_PI), turned = v < 0 ? v + 1 : v;
    const int i = (int)(u * ACROSS), j = (int)(turned * ACROSS);
    return (i < ACROSS ? i : ACROSS - 1) * ACROSS + (j < ACROSS ? j : ACROSS - 1);
}

/* Integrals of the pdf and of f cos. */
typedef struct integrals {
    double pdf, red, blue;
} integrals;

static void add_cell(const story *s, const pt_frame *f, int cell, int m, integrals *sum)
{
    const double h = 1.0 / (ACROSS * 2 * m);
    int i, j;
    for (i = 0; i < 2 * m; i++)
        for (j = 0; j < 2 * m; j++) {
            const double u = (cell / ACROSS) / (double)ACROSS + (i / 2 * 2 + 1 + (i % 2 ? 1 : -1) / sqrt(3)) * h;
            const double v = (cell % ACROSS) / (double)ACROSS + (j / 2 * 2 + 1 + (j % 2 ? 1 : -1) / sqrt(3)) * h;
            const double area = 4 * PT_PI * s->power * pow(u, s->power - 1) * h * h;
            const pt_vec3 w = direction_at(s, f, u, v);
            const double c = fabs(dot3(w, s->b->frame.n));
            const pt_rgb e = pt_bsdf_eval(s->b, s->wo, w, s->mode, PT_LOBE_ALL);
            if (s->side != 0 && same_side(s, w) != s->side) continue;
            sum->pdf += area * dbl(pt_bsdf_pdf_w(s->b, s->wo, w, s->mode));
            sum->red += area * c * dbl(e.r);
            sum->blue += area * c * dbl(e.b);
        }
}

/* The integrals, and of the pdf for each cell; *error: of the three. */
static integrals integrate(const story *s, double *pdf, integrals *error)
{
    const pt_frame f = pt_frame_from_normal(s->axis);
    integrals fine = {0, 0, 0}, coarse = {0, 0, 0};
    const int m = s->m > 0 ? s->m : 6;
    const double least_error = s->power > 1 ? 3e-4 : 1e-7; /* the horizon cuts cells about another axis than the normal */
    int i;
    for (i = 0; i < CELLS; i++) {
        const double before = fine.pdf;
        add_cell(s, &f, i, m, &fine);
        add_cell(s, &f, i, m * 2 / 3, &coarse);
        if (pdf) pdf[i] = fine.pdf - before;
    }
    error->pdf = fabs(fine.pdf - coarse.pdf) + least_error;
    error->red = fabs(fine.red - coarse.red) + least_error;
    error->blue = fabs(fine.blue - coarse.blue) + least_error;
    return fine;
}

/* ---------------------------------------------------------------------------------------------------------
   One story: directions are drawn with the density that is said, and E[weight] is the integral of f cos */

static double local_alpha(const pt_material *m)
{
    const int rough = m->kind == PT_MATERIAL_CONDUCTOR || m->kind == PT_MATERIAL_DIELECTRIC;
    return rough ? dbl(m->roughness) * dbl(m->roughness) : 0;
}

/* What the rounding of wi (g per coordinate) does to pdf and f cos, relative. The half vector (o + e i)/d moves
   by dh = g e/d. D = 1/(pi k^2) with k = alpha cos^2 + sin^2/alpha has |dD/D| <= 2 dh/alpha. Cosines c change by
   g/c, those with the half vector by dh/c, d by g e/d; Fresnel's share is evaluated at both ends. */
static double slack(const story *s, pt_vec3 wi)
{
    const double g = (is_float() ? 4 : 64) * pt_gamma(1), alpha = local_alpha(s->b->material);
    const double cos_i = fabs(dot3(wi, s->b->frame.n)), ior = dbl(s->b->material->ior);
    const double eta = dot3(s->wo, s->b->ng) > 0 ? ior : 1 / ior, e = same_side(s, wi) > 0 ? 1 : eta;
    double h[3], d, oh, ih, dh, share[3], rel;
    int i;
    if (alpha <= 0) return 8 * g + 2 * g / cos_i;
    h[0] = dbl(s->wo.x) + e * dbl(wi.x);
    h[1] = dbl(s->wo.y) + e * dbl(wi.y);
    h[2] = dbl(s->wo.z) + e * dbl(wi.z);
    d = sqrt(h[0] * h[0] + h[1] * h[1] + h[2] * h[2]);
    oh = fabs(dbl(s->wo.x) * h[0] + dbl(s->wo.y) * h[1] + dbl(s->wo.z) * h[2]) / d;
    ih = fabs(dbl(wi.x) * h[0] + dbl(wi.y) * h[1] + dbl(wi.z) * h[2]) / d;
    dh = g * e / d;
    rel = 8 * g + 2 * dh / alpha + 2 * g / cos_i + 2 * dh / oh + 2 * dh / ih + 2 * g * e / d;
    if (s->b->material->kind == PT_MATERIAL_CONDUCTOR) return rel;
    for (i = 0; i < 3; i++) share[i] = pt_fresnel_make(oh + (i - 1) * dh, eta).r;
    if (e < 1 || e > 1)
        for (i = 0; i < 3; i++) share[i] = 1 - share[i];
    return rel + fabs(share[2] - share[0]) / share[1];
}

/* Counts draws of which sample, pdf and eval disagree by more than rounding. */
static int disagree(const story *s, const pt_bsdf_sample_result *r)
{
    const double tolerance = slack(s, r->wi), p = dbl(r->pdf_w), c = fabs(dot3(r->wi, s->b->frame.n));
    const pt_transport other = s->mode == PT_RADIANCE ? PT_IMPORTANCE : PT_RADIANCE;
    const pt_rgb f = pt_bsdf_eval(s->b, s->wo, r->wi, s->mode, PT_LOBE_ALL);
    const double back = dbl(pt_bsdf_pdf_w(s->b, r->wi, s->wo, other));
    const double eta = same_side(s, r->wi) > 0 ? 1 : dot3(s->wo, s->b->ng) > 0 ? dbl(s->b->material->ior) : 1 / dbl(s->b->material->ior);
    int wrong = 0;
    if (fabs(dbl(r->eta) - eta) > 2 * pt_gamma(1) * eta) wrong |= 8;
    if (fabs(dbl(r->pdf_rev_w) - back) > 2 * pt_gamma(1) * back) wrong |= 4;
    if (!(tolerance < 0.5)) return wrong; /* rounding has left no digits */
    if (fabs(dbl(pt_bsdf_pdf_w(s->b, s->wo, r->wi, s->mode)) - p) > tolerance * p) wrong |= 1;
    if (fabs(dbl(r->weight.r) * p - dbl(f.r) * c) > 2 * tolerance * dbl(f.r) * c) wrong |= 2;
    if (fabs(dbl(r->weight.b) * p - dbl(f.b) * c) > 2 * tolerance * dbl(f.b) * c) wrong |= 2;
    return wrong;
}

typedef struct drawn {
    double counts[CELLS + 2]; /* cells, elsewhere (or nothing drawn), the delta lobe */
    pt_stats red, blue;
    int disagree, bits;
} drawn;

static void draw_all(const story *s, uint64_t seed, uint32_t n, drawn *d)
{
    const pt_frame f = pt_frame_from_normal(s->axis);
    pt_pcg32 rng = generator(seed);
    double red = 0, blue = 0;
    uint32_t i;
    memset(d, 0, sizeof *d);
    for (i = 0; i < n; i++) {
        pt_bsdf_sample_result r;
        const double u_lobe = pt_pcg32_double(&rng);
        const int got = pt_bsdf_sample(s->b, s->wo, u_lobe, pair(&rng), s->mode, &r);
        const int delta = got && r.lobe == PT_LOBE_SPECULAR;
        const int here = got && !delta && (s->side == 0 || same_side(s, r.wi) == s->side);
        d->counts[here ? cell_at(s, &f, r.wi) : delta ? CELLS + 1 : CELLS]++;
        red += here ? dbl(r.weight.r) / (n / 64) : 0;
        blue += here ? dbl(r.weight.b) / (n / 64) : 0;
        if (i % (n / 64) == n / 64 - 1) { /* 64 means of as many */
            pt_stats_add(&d->red, red);
            pt_stats_add(&d->blue, blue);
            red = blue = 0;
        }
        if (here) {
            const int wrong = disagree(s, &r);
            d->disagree += wrong != 0;
            d->bits |= wrong;
        }
    }
}

/* `seed` counts stories. Exact: the integrals of this program's own quadrature of eval and pdf. */
static void tell(const story *s, uint64_t seed)
{
    const uint32_t n = pt_test_samples(1u << 16);
    double expected[CELLS + 2], total, delta = 0;
    pt_bsdf_sample_result r;
    integrals sum, error;
    drawn d;
    int i;
    sum = integrate(s, expected, &error);
    draw_all(s, seed, n, &d);
    if (pt_bsdf_sample(s->b, s->wo, 0, pt_v2(0, 0), s->mode, &r) && r.lobe == PT_LOBE_SPECULAR) delta = dbl(r.pdf_w);
    expected[CELLS] = fmax(1 - sum.pdf - delta, 0.5 / n);
    expected[CELLS + 1] = delta;
    for (i = 0; i < CELLS; i++) expected[i] = fmax(expected[i], 1e-7); /* of a cell the horizon cuts, all points may be below */
    for (i = 0, total = 0; i < CELLS + 2; i++) total += expected[i];
    for (i = 0; i < CELLS + 2; i++) expected[i] *= n / total; /* the quadrature's own error */
    pt_check(d.disagree == 0, s->name,
             "%d of %u draws: pdf_w (1), weight (2), pdf_rev_w (4) or eta (8) is not that of pdf and eval: bits %d",
             d.disagree, n, d.bits);
    pt_check(sum.pdf + delta <= 1 + 2 * error.pdf, s->name, "the pdf integrates to %g", sum.pdf + delta);
    if (error.pdf < 2e-3)
        pt_check_chi2(s->name, d.counts, expected, CELLS + 2, "directions are not drawn with the density that pdf_w says");
    else printf("       %s: the pdf's integral is known only within %g\n", s->name, error.pdf);
    if (sum.red > 0.002) {
        pt_check_mean(s->name, &d.red, sum.red, error.red, sum.red > 0.4 ? 0.08 : 0.5, PT_TEST_MEANS, "E[weight] is not the integral of f cos (red)");
        pt_check_mean(s->name, &d.blue, sum.blue, error.blue, sum.blue > 0.4 ? 0.08 : 0.5, PT_TEST_MEANS, "E[weight] is not the integral of f cos (blue)");
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Means over what is sampled: 64 independent means over `side` x `side` jittered numbers for the direction; the
   lobe is chosen by independent ones, so that no count is the same in all of them */

typedef struct sampled {
    pt_stats red, green, blue, up, down, lost;
} sampled;

/* One of the means; [0] to [5] in the order of `sampled`. */
static void sample_once(const pt_bsdf *b, const pt_vec3 *wo, pt_transport mode, uint32_t side, pt_pcg32 *rng, double sum[6])
{
    const double n = (double)side * side;
    uint32_t i;
    for (i = 0; i < side * side; i++) {
        const pt_vec2 jitter = pair(rng);
        const pt_vec2 u = v2((i % side + dbl(jitter.x)) / side, (i / side + dbl(jitter.y)) / side);
        const double u_lobe = pt_pcg32_double(rng);
        const pt_vec3 o = wo ? *wo : pt_warp_cosine(pair(rng));
        pt_bsdf_sample_result d;
        if (!pt_bsdf_sample(b, o, u_lobe, u, mode, &d)) {
            sum[5] += 1 / n;
            continue;
        }
        sum[0] += dbl(d.weight.r) / n;
        sum[1] += dbl(d.weight.g) / n;
        sum[2] += dbl(d.weight.b) / n;
        sum[dot3(d.wi, b->ng) * dot3(o, b->ng) > 0 ? 3 : 4] += dbl(d.weight.r) / n;
    }
}

/* wo NULL: under diffuse light. up: the red weight of what is reflected, down: of what goes through. */
static void sample_many(const pt_bsdf *b, const pt_vec3 *wo, pt_transport mode, uint32_t side, uint64_t seed, sampled *out)
{
    const uint32_t short_side = pt_test.is_short ? side / 4 : side;
    pt_pcg32 rng = generator(seed);
    int i;
    memset(out, 0, sizeof *out);
    for (i = 0; i < 64; i++) {
        double sum[6] = {0, 0, 0, 0, 0, 0};
        sample_once(b, wo, mode, short_side, &rng, sum);
        pt_stats_add(&out->red, sum[0]);
        pt_stats_add(&out->green, sum[1]);
        pt_stats_add(&out->blue, sum[2]);
        pt_stats_add(&out->up, sum[3]);
        pt_stats_add(&out->down, sum[4]);
        pt_stats_add(&out->lost, sum[5]);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   GGX */

/* Exact: table BSDF-NDF (Walter et al. 2007, Heitz 2014). Integrals over the hemisphere of normals by the
   midpoint rule in u, theta = pi/2 u^2, and the azimuth: 256 x 256 points, error below 1e-5 for alpha >= 0.1. */
static double normal_integral(double alpha, double theta, int visible)
{
    const pt_vec3 o = polar(theta, 0.3);
    double sum = 0;
    int i, j;
    for (i = 0; i < 256; i++)
        for (j = 0; j < 256; j++) {
            const double u = (i + 0.5) / 256, t = PT_PI / 2 * u * u, area = sin(t) * PT_PI * u / 256 * 2 * PT_PI / 256;
            const pt_vec3 h = polar(t, 2 * PT_PI * (j + 0.5) / 256);
            sum += area * (visible ? pt_ggx_visible_pdf_w(o, h, alpha) : pt_ggx_d(h, alpha) * cos(t));
        }
    return sum;
}

static void microfacet_functions(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("BSDF-NDF", NULL, &at)) != NULL) {
        const double alpha = parameter(r, "alpha"), t = degrees(parameter(r, "theta_deg"));
        const pt_vec3 w = polar(t, 1);
        const char *const name = label("%s %s %s", r->id, r->quantity, r->params);
        if (strcmp(r->quantity, "D_ggx") == 0)
            pt_check_near(name, pt_ggx_d(w, alpha) / r->value, 1, 64 * pt_gamma(1), "alpha^2 / (pi (c^2 (alpha^2 - 1) + 1)^2)");
        if (strcmp(r->quantity, "G1_ggx") == 0)
            pt_check_near(name, pt_ggx_g1(w, alpha), r->value, 8 * pt_gamma(1), "1 / (1 + Lambda)");
        if (strcmp(r->quantity, "norm_D_ggx") == 0)
            pt_check_near(name, normal_integral(alpha, t, 0), 1, 3e-5, "D cos must integrate to 1");
        if (strcmp(r->quantity, "norm_VNDF_ggx") == 0)
            pt_check_near(name, normal_integral(alpha, t, 1), 1, 3e-5, "D G1 (o.h)/cos must integrate to 1");
    }
    pt_check(pt_ggx_d(polar(2, 0), 0.5) <= 0 && pt_ggx_g1(polar(2, 0), 0.5) <= 0 &&
                 pt_ggx_visible_pdf_w(polar(2, 0), polar(0, 0), 0.5) <= 0 &&
                 pt_ggx_visible_pdf_w(polar(0, 0), polar(2, 0), 0.5) <= 0,
             "below the surface", "D, G1 and the visible density must be 0");
}

/* Visible normals against their density, in 16 x 16 cells of s and the azimuth: with t = tan/alpha, u = t^2/(1+t^2)
   is uniform for normals of density D cos; s = 1 - sqrt(1 - u) takes the pole 1/cos out of the ratio. */
static void one_visible(double alpha, double theta, uint64_t seed)
{
    const uint32_t n = pt_test_samples(1u << 16);
    const pt_vec3 o = polar(theta, 0);
    pt_pcg32 rng = generator(seed);
    double counts[256] = {0}, expected[256];
    int i, k;
    for (i = 0; i < (int)n; i++) {
        const pt_vec3 h = pt_ggx_visible_sample(o, alpha, pair(&rng));
        const double s2 = dbl(h.x) * dbl(h.x) + dbl(h.y) * dbl(h.y), t2 = s2 / (dbl(h.z) * dbl(h.z) * alpha * alpha);
        const double v = atan2(dbl(h.y), dbl(h.x)) / (2 * PT_PI);
        counts[(int)fmin(15, 16 * (1 - 1 / sqrt(1 + t2))) * 16 + (int)fmin(15, 16 * (v < 0 ? v + 1 : v))]++;
    }
    for (k = 0; k < 256; k++) {
        for (i = 0, expected[k] = 1e-3; i < 256; i++) {
            const double s = (k / 16 + (i / 16 + 0.5) / 16) / 16, v = (k % 16 + (i % 16 + 0.5) / 16) / 16;
            const double t = atan(alpha * sqrt(s * (2 - s)) / (1 - s));
            const pt_vec3 h = polar(t, 2 * PT_PI * v);
            expected[k] += n / 65536.0 * 2 * (1 - s) * pt_ggx_visible_pdf_w(o, h, alpha) / (pt_ggx_d(h, alpha) * cos(t));
        }
    }
    pt_check_chi2(label("visible normals, alpha %g, %g rad", alpha, theta), counts, expected, 256,
                  "see pt_ggx_visible_sample and the density beside it");
}
static void visible_normals(void)
{
    static const double alpha[4] = {0.01, 0.1, 0.5, 1}, theta[4] = {0, 0.7, 1.3, 1.55};
    int i;
    for (i = 0; i < 16; i++) one_visible(alpha[i / 4], theta[i % 4], (uint64_t)(100 + i));
}

/* Exact: table BSDF-EVAL, correlated masking. */
static void metal_values(void)
{
    const row *r;
    int at = 0, swap;
    while ((r = next_row("BSDF-EVAL", NULL, &at)) != NULL) {
        const pt_material m = perfect_metal(parameter(r, "alpha"));
        const pt_bsdf b = upright(&m);
        const pt_vec3 wo = polar(degrees(parameter(r, "theta_o_deg")), 1);
        const pt_vec3 wi = polar(degrees(parameter(r, "theta_i_deg")), 1 + degrees(parameter(r, "dphi_deg")));
        const double tolerance = 200 * pt_gamma(1); /* alpha 0.1: 2 dh/alpha, and alpha = roughness^2 rounded */
        for (swap = 0; swap < 2 && strcmp(r->quantity, "f_corr") == 0; swap++)
            pt_check_near(label("%s %s", r->id, r->params),
                          dbl(pt_bsdf_eval(&b, swap ? wi : wo, swap ? wo : wi, PT_RADIANCE, PT_LOBE_ALL).g) / r->value, 1,
                          tolerance, "D G2 / (4 cos cos), alpha = roughness^2, correlated masking");
        if (strcmp(r->quantity, "pdf_vndf") == 0)
            pt_check_near(label("%s %s", r->id, r->params), dbl(pt_bsdf_pdf_w(&b, wo, wi, PT_RADIANCE)) / r->value, 1,
                          tolerance, "density of visible normals / (4 o.h)");
    }
}

/* Directional albedo and lost samples of a material at a row's angle; the quadrature's error is small beside
   the tolerance of 2e-3. */
static void one_albedo(const row *r, const pt_bsdf *b, double below, uint64_t seed)
{
    const double t = degrees(parameter(r, "theta_deg")), alpha = parameter(r, "alpha");
    const int sharp = alpha < 0.2;
    const char *const name = label("%s %s", r->id, r->params);
    sampled d;
    story s;
    integrals sum, error;
    s.name = name;
    s.b = b;
    s.wo = polar(t, 0.1);
    s.axis = sharp ? polar(t, 0.1 + PT_PI) : pt_v3(0, 0, 1);
    s.power = sharp ? 3 : 1;
    s.mode = PT_RADIANCE;
    s.side = 0;
    s.m = t > 1.2 ? 16 : 6; /* at grazing angles the lobe is narrow in azimuth */
    sum = integrate(&s, NULL, &error);
    pt_check_near(name, sum.red, r->value, 2e-3, "the integral of f cos: see pti_eval_microfacet");
    pt_check_near(name, sum.pdf, 1 - below, 4e-3, "the integral of the pdf is what is not lost below the surface");
    sample_many(b, &s.wo, PT_RADIANCE, below < 0.04 ? 64 : 48, seed, &d);
    pt_check_mean(name, &d.green, r->value, r->error, 0.01, PT_TEST_MEANS, "E[weight]: G2/G1 of visible normals");
    pt_check_mean(name, &d.lost, below, 1e-12, 0.12, PT_TEST_MEANS, "reflected below the surface: the normals are not the visible ones");
}

/* Exact: tables BSDF-GGXALB (correlated masking) and -AVG. */
static void metal_albedo(void)
{
    const row *r;
    sampled d;
    int at = 0, i = 0;
    while ((r = next_row("BSDF-GGXALB", "E_ggx_corr", &at)) != NULL) {
        const pt_material m = perfect_metal(parameter(r, "alpha"));
        const pt_bsdf b = upright(&m);
        one_albedo(r, &b, find_row("BSDF-GGXALB", "P_below_ggx", r->params)->value, (uint64_t)(200 + i++));
    }
    at = 0;
    while ((r = next_row("BSDF-AVG", "E_avg_ggx", &at)) != NULL) {
        const pt_material m = perfect_metal(parameter(r, "alpha"));
        const pt_bsdf b = upright(&m);
        sample_many(&b, NULL, PT_RADIANCE, 48, (uint64_t)(230 + i++), &d);
        pt_check_mean(label("%s %s", r->id, r->params), &d.green, r->value, r->error, 0.01, PT_TEST_MEANS,
                      "mean albedo under diffuse light");
    }
}

/* Exact: table BSDF-RDIEL, R and T of importance (of radiance T is divided by eta^2). */
static void rough_glass(void)
{
    const row *r;
    int at = 0, i = 0;
    while ((r = next_row("BSDF-RDIEL", "R", &at)) != NULL) {
        const pt_material m = pt_material_rough_dielectric(real(1.5), real(sqrt(parameter(r, "alpha"))));
        const pt_bsdf b = upright(&m);
        const double t = degrees(parameter(r, "theta_deg")), exact_t = find_row("BSDF-RDIEL", "T", r->params)->value;
        const double n2 = dbl(m.ior) * dbl(m.ior), whole = find_row("BSDF-RDIEL", "R+T", r->params)->value;
        int mode;
        for (mode = 0; mode < 2; mode++) {
            story s = {"rough glass", NULL, polar(t, 0.4), polar(t, 0.4 + PT_PI), (pt_transport)mode, 2, 1, 0};
            integrals sum, error;
            sampled d;
            const double f = mode == PT_RADIANCE ? 1 / n2 : 1;
            s.b = &b;
            sum = integrate(&s, NULL, &error);
            pt_check_near(r->id, sum.red, r->value, 1e-4, "reflection: the integral of f cos");
            s.side = -1;
            s.axis = polar(PT_PI - asin(sin(t) / 1.5), 0.4 + PT_PI);
            sum = integrate(&s, NULL, &error);
            pt_check_near(r->id, sum.red, f * exact_t, 1e-3, "refraction: the integral of f cos; eta^2 is of radiance only");
            sample_many(&b, &s.wo, s.mode, 48, (uint64_t)(240 + i++), &d);
            pt_check_mean(label("%s R %s", r->id, r->params), &d.up, r->value, 1e-9, 0.15, PT_TEST_MEANS, "rough reflection");
            pt_check_mean(label("%s T %s", r->id, r->params), &d.down, f * exact_t, 1e-9, 0.01, PT_TEST_MEANS, "rough refraction");
            if (mode == PT_IMPORTANCE)
                pt_check_mean(label("%s R+T %s", r->id, r->params), &d.red, whole, 1e-9, 0.01, PT_TEST_MEANS, "rough glass");
        }
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Phong, Oren-Nayar, coat */

/* Exact: table BSDF-PHONG, at normal incidence and exitance, where all powers are 1. */
static void phong_norms(void)
{
    const pt_vec3 n = pt_v3(0, 0, 1);
    const row *r;
    int at = 0;
    while ((r = next_row("BSDF-PHONG", NULL, &at)) != NULL) {
        const pt_rgb black = pt_rgb_grey(0), white = pt_rgb_grey(1);
        const pt_material p = pt_material_phong(black, white, real(parameter(r, "n")));
        const pt_material h = pt_material_blinn(black, white, real(parameter(r, "n")));
        const pt_bsdf b = upright(strcmp(r->quantity, "blinn_exact_norm") == 0 ? &h : &p), blinn = upright(&h);
        if (strcmp(r->quantity, "pdf_norm") == 0) {
            pt_check_near(r->id, dbl(pt_bsdf_pdf_w(&b, n, n, PT_RADIANCE)) / r->value, 1, 4 * pt_gamma(1), "(n+1)/(2 pi)");
            pt_check_near(r->id, dbl(pt_bsdf_pdf_w(&blinn, n, n, PT_RADIANCE)) / r->value, 0.25, 4 * pt_gamma(1),
                          "of the half vector: over 4 o.h");
        } else
            pt_check_near(r->id, dbl(pt_bsdf_eval(&b, n, n, PT_RADIANCE, PT_LOBE_ALL).g) / r->value, 1, 4 * pt_gamma(1),
                          "Phong (n+2)/(2 pi); Blinn (n+2)(n+4)/(8 pi (2^(-n/2) + n))");
    }
}

/* Exact: table BSDF-PHONGBELOW; a black base leaves only the lobe. */
static void phong_below(void)
{
    const row *r;
    int at = 0, k = 0;
    while ((r = next_row("BSDF-PHONGBELOW", NULL, &at)) != NULL) {
        const pt_material m = pt_material_phong(pt_rgb_grey(0), pt_rgb_grey(1), real(parameter(r, "n")));
        const pt_bsdf b = upright(&m);
        const pt_vec3 wo = polar(degrees(parameter(r, "theta_deg")), 5);
        sampled d;
        sample_many(&b, &wo, PT_RADIANCE, r->value < 0.01 ? 64 : 32, (uint64_t)(260 + k++), &d);
        pt_check_mean(label("%s %s", r->id, r->params), &d.lost, r->value, 0, 0.25, PT_TEST_MEANS,
                      "the lobe is cos^n about the mirror direction; what points below is lost, not drawn again");
    }
}

/* The albedo of a BSDF that has no lobe, at an angle, by Gauss's two points in 128 x 64 parts of mu^2 and the
   azimuth: exact to 1e-5 for what is smooth. */
static double smooth_albedo(const pt_bsdf *b, double theta)
{
    const pt_vec3 wo = polar(theta, 0);
    double sum = 0;
    int i, j;
    for (i = 0; i < 256; i++)
        for (j = 0; j < 128; j++) {
            const double mu2 = (i / 2 + 0.5 + (i % 2 ? 0.5 : -0.5) / sqrt(3)) / 128;
            const pt_vec3 wi = polar(acos(sqrt(mu2)), 2 * PT_PI * (j + 0.5) / 128);
            sum += dbl(pt_bsdf_eval(b, wo, wi, PT_RADIANCE, PT_LOBE_ALL).r) * PT_PI / (256 * 128);
        }
    return sum;
}

/* Exact: table BSDF-ON, and its closed form, whose limit at grazing angles is A + B/2: above 1 by at most
   0.0152, near sigma = 0.2. */
static void oren_nayar(void)
{
    const row *r;
    int at = 0, i, k = 0;
    double most = 0;
    while ((r = next_row("BSDF-ON", NULL, &at)) != NULL) {
        const pt_material m = pt_material_oren_nayar(rgb(1, 0.5, 0.25), real(parameter(r, "sigma")));
        const pt_bsdf b = upright(&m);
        const int mean = strcmp(r->quantity, "E_avg") == 0;
        const pt_vec3 wo = polar(mean ? 0 : degrees(parameter(r, "theta_deg")), 1);
        sampled d;
        if (!mean)
            pt_check_near(label("%s %s", r->id, r->params), smooth_albedo(&b, degrees(parameter(r, "theta_deg"))), r->value, 2e-4,
                          "see pti_eval_oren_nayar: sigma in radians, A and B of the qualitative model");
        sample_many(&b, mean ? NULL : &wo, PT_RADIANCE, 32, (uint64_t)(270 + k++), &d);
        pt_check_mean(label("%s %s", r->id, r->params), &d.red, r->value, 1e-6, 0.01, PT_TEST_MEANS, "E[weight] is not the albedo");
        pt_check_mean(label("%s %s, blue", r->id, r->params), &d.blue, r->value / 4, 1e-6, 0.01, PT_TEST_MEANS, "E[weight] is not the albedo");
    }
    for (i = 1; i <= 50; i++) {
        const pt_material m = pt_material_oren_nayar(pt_rgb_grey(1), real(i / 50.0));
        const pt_bsdf b = upright(&m);
        most = fmax(most, smooth_albedo(&b, degrees(89.9)));
    }
    pt_check(most > 1.01 && most <= 1.01519 + 2e-4, "Oren-Nayar at grazing angles", "the albedo reaches %g", most);
}

/* The whole of a coat at an angle: F + (1 - F)(1 - R) a / (1 - a R), R of diffuse light inside, from Walsh's
   closed form (tested above) and Fresnel's equations. With a = 1 it is 1. */
static double coat_albedo(double a, double n, double theta)
{
    const double f = pt_fresnel_make(cos(theta), n).r, inside = 1 - (1 - pt_fresnel_diffuse(n)) / (n * n);
    return f + (1 - f) * (1 - inside) * a / (1 - a * inside);
}

static void one_coat(double a, double n, double theta, uint64_t seed)
{
    const pt_material m = pt_material_coat(rgb(a, 0, a / 2), real(n));
    const pt_bsdf b = upright(&m);
    const double exact = coat_albedo(dbl(m.albedo.r), dbl(m.ior), theta), f = pt_fresnel_make(cos(theta), dbl(m.ior)).r;
    const pt_vec3 wo = polar(theta, 2);
    pt_bsdf_sample_result s;
    sampled d;
    pt_check_near(label("coat %g, index %g, %g rad", a, n, theta), f + smooth_albedo(&b, theta), exact, 2e-4,
                  "count all inner reflections, and 1/n^2 once");
    sample_many(&b, &wo, PT_RADIANCE, 16, seed, &d);
    pt_check_mean(label("coat %g, index %g, %g rad", a, n, theta), &d.red, exact, 1e-6, 0.02, PT_TEST_MEANS, "E[weight] of both lobes");
    pt_check(pt_bsdf_sample(&b, wo, 0, pt_v2(0, 0), PT_RADIANCE, &s) && s.lobe == PT_LOBE_SPECULAR && s.pdf_w == s.pdf_rev_w &&
                 fabs(dbl(s.weight.g) * dbl(s.pdf_w) - f) <= 16 * pt_gamma(1) && dbl(s.wi.z) == dbl(wo.z),
             "the interface of a coat", "its probability times its weight is not Fresnel's %g, or it is no mirror", f);
}

static void coats(void)
{
    static const double albedo[4] = {0.1, 0.5, 0.9, 1}, index[4] = {1.1, 1.5, 2.5, 10}, theta[3] = {0, 0.8, 1.4};
    int i;
    for (i = 0; i < 48; i++) one_coat(albedo[i % 4], index[i / 4 % 4], theta[i / 16], (uint64_t)(300 + i));
}

/* ---------------------------------------------------------------------------------------------------------
   Every material */

static pt_measured ggx_table = PT_MEASURED_INIT;

static pt_rgb brdf_of(void *user, pt_vec3 wo, pt_vec3 wi)
{
    return pt_bsdf_eval((const pt_bsdf *)user, wo, wi, PT_RADIANCE, PT_LOBE_ALL);
}
static pt_material measured_from(void) { return pt_material_conductor(rgb(0.2, 0.9, 1.4), rgb(3.9, 2.4, 1.6), real(0.55)); }
static int have_table(void)
{
    const pt_material m = measured_from();
    pt_bsdf b = upright(&m);
    return ggx_table.value || pt_measured_fill(&ggx_table, brdf_of, &b) == PT_OK;
}

#if PTI_HAS_TEXTURES
static pt_rgb half_red(void *user, pt_vec2 uv, pt_vec3 p)
{
    (void)user;
    (void)uv;
    (void)p;
    return rgb(0.5, 1, 1);
}
#endif

enum { METAL, METAL_SHARP, GLASS, GLASS_SHARP, OREN, PHONG, PHONG_SHARP, BLINN, BLINN_SHARP, COAT, TEXTURED, MEASURED, MATERIALS };
static const char *const material_names[MATERIALS] = {"rough metal", "polished metal", "rough glass", "ground glass", "Oren-Nayar",
    "Phong 7", "Phong 5000", "Blinn-Phong 12", "Blinn-Phong 5000", "coat", "textured Phong", "measured"};

static pt_material material_of(int k)
{
    static const pt_texture texture = {PT_TEXTURE_FUNCTION, NULL, 0, 0, {0, 0}, {0, 0, 0}, {0, 0, 0}, half_red, NULL};
    const pt_rgb eta = rgb(0.2, 0.9, 1.4), kappa = rgb(3.9, 2.4, 1.6), a = rgb(0.5, 0.3, 0.2), g = rgb(0.4, 0.6, 0.3);
    pt_material m = pt_material_phong(a, g, 7);
    switch (k) {
    case METAL: return pt_material_conductor(eta, kappa, real(0.7));
    case METAL_SHARP: return pt_material_conductor(eta, kappa, real(0.15));
    case GLASS: return pt_material_rough_dielectric(real(1.5), real(0.7));
    case GLASS_SHARP: return pt_material_rough_dielectric(real(1.5), real(0.25));
    case OREN: return pt_material_oren_nayar(a, real(0.6));
    case PHONG_SHARP: return pt_material_phong(a, g, 5000);
    case BLINN: return pt_material_blinn(a, g, 12);
    case BLINN_SHARP: return pt_material_blinn(a, g, 5000);
    case COAT: return pt_material_coat(rgb(0.9, 0.5, 0.1), real(1.5));
    case MEASURED: return pt_material_measured(&ggx_table);
    case TEXTURED: m.texture = &texture; return m;
    default: return m;
    }
}

/* Which of them is sharp, so that the cells must be about its peak. */
static double power_of(int k) { return k == METAL_SHARP || k == PHONG_SHARP || k == BLINN_SHARP ? 5 : k == GLASS_SHARP ? 3 : 1; }

/* A local direction on a side of the surface (frame of the BSDF). */
static pt_vec3 place(const pt_bsdf *b, pt_vec3 local) { return pt_v3_normalize(pt_frame_to_world(&b->frame, local)); }

static void one_material(int k, double theta, int below, pt_transport mode, uint64_t seed)
{
    const pt_material m = material_of(k);
    const pt_vec3 n = pt_v3_normalize(pt_v3(1, -2, 2));
    const pt_hit hit = hit_of(n, n);
    const pt_bsdf b = pt_bsdf_make(&m, &hit);
    const double up = below ? -1 : 1, eta = below ? 1 / 1.5 : 1.5, sin_t = sin(theta) / eta;
    story s;
    s.m = 0;
    s.name = label("%s, %g rad, side %d, mode %d", material_names[k], theta, below, (int)mode);
    s.b = &b;
    s.wo = place(&b, v3(sin(theta), 0, up * cos(theta)));
    s.axis = power_of(k) > 1 ? place(&b, v3(-sin(theta), 0, up * cos(theta))) : n;
    s.power = power_of(k);
    s.mode = mode;
    s.side = k == GLASS_SHARP || k == GLASS ? 1 : 0;
    tell(&s, seed);
    if (s.side == 0) return;
    s.name = label("%s through, %g rad, side %d, mode %d", material_names[k], theta, below, (int)mode);
    s.side = -1;
    s.m = sin_t < 1 ? 6 : 12;
    if (sin_t < 1) s.axis = place(&b, v3(-sin_t, 0, -up * sqrt(1 - sin_t * sin_t)));
    s.power = power_of(k) > 1 ? 4 : sin_t < 1 ? 2 : 1;
    tell(&s, seed + 1);
}

static void one_story(void)
{
    static const double theta[3] = {0.2, 0.9, 1.45};
    int k, i;
    pt_check(have_table(), "measured table", "out of memory");
    for (k = 0; k < MATERIALS; k++)
        for (i = 0; i < 6; i++) {
            if (theta[i / 2] > 1 && power_of(k) > 1) continue; /* half of the sharp lobe is below the horizon */
            one_material(k, theta[i / 2], i % 2, (i + k) % 3 == 0 ? PT_IMPORTANCE : PT_RADIANCE, (uint64_t)(400 + 20 * k + 2 * i));
        }
}

/* A shading normal 0.5 rad off the geometric one: light is lost, none is gained, nothing is negative. */
static void tilted_normals(void)
{
    const pt_vec3 ng = pt_v3_normalize(pt_v3(1, 2, 2)), ns = pt_v3_normalize(pt_v3_add(ng, v3(0.4, -0.2, 0.3)));
    const pt_hit hit = hit_of(ng, ns);
    int k, i, j;
    for (k = 0; k < MATERIALS && have_table(); k++) {
        const pt_material m = material_of(k);
        const pt_bsdf b = pt_bsdf_make(&m, &hit);
        pt_pcg32 rng = generator((uint64_t)(700 + k));
        pt_stats by_sample = PT_STATS_INIT, by_eval = PT_STATS_INIT;
        const pt_vec3 fixed = place(&b, v3(0.5, 0.1, 0.8));
        int bad = 0;
        for (i = 0; i < (int)pt_test_all_samples(1u << 16); i++) {
            const pt_vec3 w[2] = {pt_warp_sphere(pair(&rng)), pt_warp_sphere(pair(&rng))};
            const double u_lobe = pt_pcg32_double(&rng);
            const pt_vec2 u = pair(&rng);
            const pt_rgb e = pt_bsdf_eval(&b, fixed, w[0], PT_IMPORTANCE, PT_LOBE_ALL);
            pt_bsdf_sample_result d;
            for (j = 0; j < 2; j++) {
                const pt_rgb f = pt_bsdf_eval(&b, w[0], w[1], (pt_transport)j, PT_LOBE_ALL);
                const double p = dbl(pt_bsdf_pdf_w(&b, w[0], w[1], (pt_transport)j));
                bad += !(finite_rgb(f) && least(f) >= 0 && p >= 0 && isfinite(p)) || (p <= 0 && dbl(f.g) > 0 && k != COAT);
                if (!pt_bsdf_sample(&b, w[0], u_lobe, u, (pt_transport)j, &d)) continue;
                bad += !(finite_rgb(d.weight) && least(d.weight) >= 0 && d.pdf_w > 0 && d.pdf_rev_w >= 0);
                bad += (dot3(d.wi, ng) * dot3(w[0], ng) > 0) != (d.eta == 1);
            }
            pt_stats_add(&by_eval, 4 * PT_PI * dbl(e.g) * fabs(dot3(w[0], ns)));
            pt_stats_add(&by_sample, pt_bsdf_sample(&b, fixed, u_lobe, u, PT_IMPORTANCE, &d) && d.lobe != PT_LOBE_SPECULAR ? dbl(d.weight.g) : 0);
        }
        pt_check(bad == 0, material_names[k], "tilted shading normal: %d values are negative, not finite, or on the wrong side", bad);
        if (power_of(k) <= 1 && k != GLASS) /* uniform directions miss a sharp lobe */
            pt_check_equal_means(label("%s, tilted normal", material_names[k]), &by_sample, &by_eval, 0.3, "both must leave out the same directions");
    }
}

/* f(a,b) and f(b,a): equal for reflection. Through glass f(a,b) eta^2 = f(b,a), eta = index at b over that at a,
   and importance is radiance with the directions exchanged [Vea97] 5.14. Radiance from b into a. */
static void reciprocity(void)
{
    int k, i;
    for (k = 0; k < MATERIALS && have_table(); k++) {
        const pt_material m = material_of(k);
        const pt_vec3 n = pt_v3_normalize(pt_v3(-1, 2, -2));
        const pt_hit hit = hit_of(n, n);
        const pt_bsdf b = pt_bsdf_make(&m, &hit);
        pt_pcg32 rng = generator((uint64_t)(720 + k));
        int wrong = 0, seen = 0, beside = 0;
        for (i = 0; i < 20000; i++) {
            const pt_vec3 o = pt_warp_sphere(pair(&rng)), w = pt_warp_sphere(pair(&rng));
            const int through = dot3(o, n) * dot3(w, n) < 0;
            const double e = dot3(o, n) > 0 ? 1.5 : 1 / 1.5, eta2 = through ? e * e : 1;
            const story there_and_back[2] = {{NULL, &b, o, n, PT_RADIANCE, 1, 0, 0}, {NULL, &b, w, n, PT_RADIANCE, 1, 0, 0}};
            const double there = dbl(pt_bsdf_eval(&b, o, w, PT_RADIANCE, PT_LOBE_ALL).r);
            const double back = dbl(pt_bsdf_eval(&b, w, o, PT_RADIANCE, PT_LOBE_ALL).r);
            const double importance = dbl(pt_bsdf_eval(&b, o, w, PT_IMPORTANCE, PT_LOBE_ALL).r);
            const double tolerance = (slack(&there_and_back[0], w) + slack(&there_and_back[1], o)) * fmax(there * eta2, back);
            const int other_cell = k == MEASURED && fabs(there - back) > tolerance; /* on an edge rounding decides */
            seen += there > 0;
            beside += other_cell;
            wrong += !other_cell && (fabs(there * eta2 - back) > tolerance || fabs(importance - back) > tolerance);
        }
        pt_check(seen > 1000 && wrong == 0 && beside < 20, material_names[k], "%d of %d pairs are not reciprocal, %d beside an edge", wrong, seen, beside);
    }
}

/* The mask: lobes add up, a delta has no value, an empty one is black. */
static void lobe_masks(void)
{
    static const unsigned lobes[MATERIALS] = {PT_LOBE_GLOSSY, PT_LOBE_GLOSSY, PT_LOBE_GLOSSY, PT_LOBE_GLOSSY, PT_LOBE_DIFFUSE,
        PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY, PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY, PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY, PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY,
        PT_LOBE_DIFFUSE | PT_LOBE_SPECULAR, PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY, PT_LOBE_GLOSSY};
    int k, i;
    for (k = 0; k < MATERIALS && have_table(); k++) {
        const pt_material m = material_of(k);
        const pt_bsdf b = upright(&m);
        pt_pcg32 rng = generator((uint64_t)(740 + k));
        int wrong = 0, drawn_lobes = 0;
        for (i = 0; i < 2000; i++) {
            const pt_vec3 o = pt_warp_sphere(pair(&rng)), w = pt_warp_sphere(pair(&rng));
            const pt_rgb d = pt_bsdf_eval(&b, o, w, PT_RADIANCE, PT_LOBE_DIFFUSE), g = pt_bsdf_eval(&b, o, w, PT_RADIANCE, PT_LOBE_GLOSSY);
            const pt_rgb all = pt_bsdf_eval(&b, o, w, PT_RADIANCE, PT_LOBE_ALL), delta = pt_bsdf_eval(&b, o, w, PT_RADIANCE, PT_LOBE_SPECULAR);
            const pt_rgb none = pt_bsdf_eval(&b, o, w, PT_RADIANCE, 0);
            const double u = pt_pcg32_double(&rng);
            pt_bsdf_sample_result s;
            wrong += !(d.r + g.r == all.r && d.g + g.g == all.g && d.b + g.b == all.b && delta.g == 0 && none.g == 0);
            wrong += (!(lobes[k] & PT_LOBE_DIFFUSE) && d.g > 0) || (!(lobes[k] & PT_LOBE_GLOSSY) && g.g > 0);
            if (pt_bsdf_sample(&b, o, u, pair(&rng), PT_RADIANCE, &s)) drawn_lobes |= (int)s.lobe;
        }
        pt_check(wrong == 0 && b.lobes == lobes[k] && (unsigned)drawn_lobes == lobes[k], material_names[k],
                 "%d masks are wrong; has lobes %u, draws %d", wrong, b.lobes, drawn_lobes);
    }
}

/* Colours of a material, moved on by one band: red's to green, green's to blue, blue's to red. */
static pt_rgb turned(pt_rgb c) { return pt_rgb3(c.b, c.r, c.g); }
static pt_material turned_material(pt_material m)
{
    m.albedo = turned(m.albedo);
    m.specular = turned(m.specular);
    m.eta = turned(m.eta);
    m.k = turned(m.k);
    return m;
}
static int same_colour(pt_rgb a, pt_rgb b) { return a.r - b.r == 0 && a.g - b.g == 0 && a.b - b.b == 0; }

/* Bands do not mix: what is done to one is done to all. With the colours moved on, so is every value, bit for bit; for
   delta lobes the sampled weight, where it is that of one lobe. */
static void bands_are_alike(void)
{
    const pt_material more[3] = {pt_material_mirror(rgb(0.9, 0.5, 0.1)), pt_material_diffuse(rgb(0.9, 0.5, 0.1)),
                                 pt_material_conductor(rgb(0.2, 0.9, 1.4), rgb(3.9, 2.4, 1.6), 0)};
    static const char *const names[3] = {"mirror", "diffuse", "smooth metal"};
    int k, i;
    for (k = 0; k < MATERIALS + 3; k++) {
        const pt_material m = k < MATERIALS ? material_of(k) : more[k - MATERIALS], t = turned_material(m);
        const pt_bsdf a = upright(&m), b = upright(&t);
        pt_pcg32 rng = generator((uint64_t)(1760 + k));
        int wrong = 0, seen = 0;
        if (k == MEASURED || k == TEXTURED) continue; /* a table's and a texture's bands do not move with it */
        for (i = 0; i < 2000; i++) {
            const pt_vec3 o = pt_warp_sphere(pair(&rng)), w = pt_warp_sphere(pair(&rng));
            const pt_rgb f = pt_bsdf_eval(&a, o, w, PT_RADIANCE, PT_LOBE_ALL), g = pt_bsdf_eval(&b, o, w, PT_RADIANCE, PT_LOBE_ALL);
            const pt_vec2 u = pair(&rng);
            pt_bsdf_sample_result s, q;
            wrong += !same_colour(turned(f), g);
            seen += f.g > 0;
            if (pt_bsdf_sample(&a, o, 0.5, u, PT_RADIANCE, &s) && pt_bsdf_sample(&b, o, 0.5, u, PT_RADIANCE, &q) &&
                s.lobe == PT_LOBE_SPECULAR && q.lobe == PT_LOBE_SPECULAR) {
                wrong += !same_colour(turned(s.weight), q.weight);
                seen += s.weight.g > 0;
            }
        }
        pt_check(seen > 100 && wrong == 0, k < MATERIALS ? material_names[k] : names[k - MATERIALS],
                 "%d values are not the same with the bands exchanged", wrong);
    }
}

/* Nothing is infinite or NaN where a parameter or an angle is extreme. Returns how many draws were wrong. */
static int extreme_draws(const pt_material *m, pt_pcg32 *rng, double most)
{
    const pt_vec3 n = pt_v3_normalize(pt_v3(2, 1, -2));
    int i, j, bad = 0;
    for (i = 0; i < 1500; i++) {
        const pt_hit hit = hit_of(n, i % 3 ? n : pt_v3_normalize(pt_v3_add(n, v3(0.1, 0.1, 0.3))));
        const pt_hit flat = hit_of(pt_v3(0, 0, 1), pt_v3(0, 0, 1));
        const pt_bsdf b = pt_bsdf_make(m, i % 5 ? &hit : &flat);
        const double z = i % 4 == 0 ? 1e-7 : i % 4 == 1 ? 1e-4 : 1, turn = i % 2 ? 1 : -1;
        pt_vec3 l = pt_warp_hemisphere(pair(rng)), o, w = pt_warp_sphere(pair(rng));
        o = place(&b, v3(dbl(l.x), dbl(l.y), turn * z * fmax(1e-3, dbl(l.z))));
        for (j = 0; j < 4; j++) {
            const pt_transport mode = (pt_transport)(j & 1);
            pt_bsdf_sample_result s;
            const double u_lobe = j < 2 ? pt_pcg32_double(rng) : i % 7 ? 0 : 1 - 0x1p-53;
            const int got = pt_bsdf_sample(&b, o, u_lobe, i % 11 ? pair(rng) : pt_v2(0, 0), mode, &s);
            pt_rgb f = pt_bsdf_eval(&b, o, got && j < 2 ? s.wi : w, mode, PT_LOBE_ALL);
            const double p = dbl(pt_bsdf_pdf_w(&b, o, got && j < 2 ? s.wi : w, mode));
            bad += !(finite_rgb(f) && least(f) >= 0 && isfinite(p) && p >= 0);
            if (!got) continue;
            bad += !(finite_rgb(s.weight) && least(s.weight) >= 0 && dbl(s.weight.g) <= most && fabs(dot3(s.wi, s.wi) - 1) < 1e-5);
            bad += !(isfinite(dbl(s.pdf_w)) && s.pdf_w > 0 && isfinite(dbl(s.pdf_rev_w)) && s.pdf_rev_w >= 0);
        }
    }
    return bad;
}

/* One band of it is what `user` points to: negative, NaN, infinite. */
typedef struct bad_band {
    int band;
    double value;
} bad_band;
static pt_rgb one_bad_band(void *user, pt_vec3 wo, pt_vec3 wi)
{
    const bad_band *const b = (const bad_band *)user;
    (void)wo;
    (void)wi;
    return rgb(b->band == 0 ? b->value : 0.1, b->band == 1 ? b->value : 0.1, b->band == 2 ? b->value : 0.1);
}
static void refused_brdfs(void)
{
    static const double values[3] = {-0.1, HUGE_VAL - HUGE_VAL, HUGE_VAL};
    int i;
    for (i = 0; i < 9; i++) {
        bad_band b = {0, 0};
        pt_measured m = PT_MEASURED_INIT;
        b.band = i % 3;
        b.value = values[i / 3];
        pt_check(pt_measured_fill(&m, one_bad_band, &b) == PT_ERROR_ARGUMENT && !m.value, "table of a bad BRDF",
                 "band %d = %g was taken", b.band, b.value);
        pt_measured_free(&m);
    }
}

static void extremes_of_tables(void)
{
    pt_pcg32 rng = generator(762);
    const pt_material m = material_of(MEASURED);
    int bad;
    pt_check(have_table(), "measured table", "out of memory");
    bad = extreme_draws(&m, &rng, HUGE_VAL);
    pt_check(bad == 0, "extreme angles of a table", "%d values are not finite or negative", bad);
}

/* Rough by less than the distance between directions: a mirror, or at least nothing infinite. */
static void nearly_smooth(void)
{
    static const double roughness[6] = {3e-4, 1e-4, 1e-6, 1e-10, 1e-20, 1e-36};
    pt_pcg32 rng = generator(763);
    int i, bad;
    for (i = 0; i < 6; i++) {
        pt_material m = pt_material_conductor(rgb(1e-3, 1, 50), rgb(1e3, 0, 1e-6), real(roughness[i]));
        bad = extreme_draws(&m, &rng, 1.0001);
        pt_check(bad == 0, "nearly smooth metal", "roughness %g: %d values are not finite, negative, or too large", roughness[i], bad);
        m = pt_material_rough_dielectric(real(1.5), real(roughness[i]));
        bad = extreme_draws(&m, &rng, 2.26);
        pt_check(bad == 0, "nearly smooth glass", "roughness %g: %d values are not finite, negative, or too large", roughness[i], bad);
    }
}

/* Exact: at the mirror direction the lobe is (n+2)/(2 pi); rounding of the directions turns it by d <= 3 u, which
   costs n d^2 / 2. Their lengths must not count: 1 - 1e-7 to the power of 1e6 is 0.9. */
static void phong_peak(void)
{
    const pt_material m = pt_material_phong(pt_rgb_grey(0), pt_rgb_grey(1), 1e6);
    const pt_bsdf b = upright(&m);
    pt_pcg32 rng = generator(764);
    double worst = 0;
    int i;
    for (i = 0; i < 1000; i++) {
        const pt_vec3 wo = pt_warp_cosine(pair(&rng)), wi = pt_v3(-wo.x, -wo.y, wo.z);
        worst = fmax(worst, fabs(dbl(pt_bsdf_eval(&b, wo, wi, PT_RADIANCE, PT_LOBE_ALL).g) / ((1e6 + 2) / (2 * PT_PI)) - 1));
    }
    pt_check(worst < 8 * pt_gamma(1) + 1e-8, "the peak of Phong 1e6", "is off by %g: directions are not of unit length, rounded to float", worst);
}

static void extremes(void)
{
    static const double roughness[6] = {1e-3, 3e-3, 0.02, 0.3, 0.99, 1}, index[7] = {1, 1 + 1e-6, 1.0003, 2.4, 100, 0.01, 0.99};
    static const double exponent[6] = {0, 1e-3, 1, 100, 1e4, 1e6};
    pt_pcg32 rng = generator(760);
    int i, j, bad;
    for (i = 0; i < 6; i++) {
        pt_material m = pt_material_conductor(rgb(1e-3, 1, 50), rgb(1e3, 0, 1e-6), real(roughness[i]));
        bad = extreme_draws(&m, &rng, 1.0001);
        pt_check(bad == 0, "extreme metal", "roughness %g: %d values are not finite, negative, or too large", roughness[i], bad);
        m = pt_material_oren_nayar(pt_rgb_grey(1), real(roughness[i]));
        bad = extreme_draws(&m, &rng, HUGE_VAL); /* tan of the smaller angle has no bound */
        pt_check(bad == 0, "extreme Oren-Nayar", "sigma %g: %d values are wrong", roughness[i], bad);
        for (j = 0; j < 7; j++) {
            m = pt_material_rough_dielectric(real(index[j]), real(roughness[i]));
            bad = extreme_draws(&m, &rng, 1.0001 * fmax(1, fmax(index[j] * index[j], 1 / (index[j] * index[j]))));
            pt_check(bad == 0, "extreme glass", "roughness %g, index %g: %d values are wrong", roughness[i], index[j], bad);
        }
        m = pt_material_phong(pt_rgb_grey(real(0.3)), pt_rgb_grey(real(0.7)), real(exponent[i]));
        bad = extreme_draws(&m, &rng, 4);
        pt_check(bad == 0, "extreme Phong", "exponent %g: %d values are wrong", exponent[i], bad);
        m = pt_material_blinn(i % 2 ? pt_rgb_grey(0) : pt_rgb_grey(real(0.3)), pt_rgb_grey(real(0.7)), real(exponent[i]));
        bad = extreme_draws(&m, &rng, 8);
        pt_check(bad == 0, "extreme Blinn-Phong", "exponent %g: %d values are wrong", exponent[i], bad);
        if (index[i] <= 1) continue;
        m = pt_material_coat(i % 2 ? pt_rgb_grey(1) : pt_rgb_grey(0), real(index[i]));
        bad = extreme_draws(&m, &rng, 2);
        pt_check(bad == 0, "extreme coat", "index %g: %d values are wrong", index[i], bad);
    }
}

/* E[weight] is at most 1 for importance, at every angle; Oren-Nayar has its stated excess. */
static void no_gain(void)
{
    int k, i, j;
    for (k = 0; k < MATERIALS && have_table(); k++) {
        pt_material m = material_of(k);
        double most = 0, error = 0;
        m.albedo = k == PHONG || k == PHONG_SHARP || k == BLINN || k == BLINN_SHARP || k == TEXTURED ? pt_rgb_grey(0) : pt_rgb_grey(1);
        m.specular = pt_rgb_grey(1);
        for (i = 0; i < 8; i++) {
            const pt_bsdf b = upright(&m);
            pt_stats s = PT_STATS_INIT;
            pt_pcg32 rng = generator((uint64_t)(770 + k));
            for (j = 0; j < (int)pt_test_samples(1u << 12); j++) {
                pt_bsdf_sample_result d;
                const double u_lobe = pt_pcg32_double(&rng);
                const int got = pt_bsdf_sample(&b, polar(i * PT_PI / 2 / 7.05, 0), u_lobe, pair(&rng), PT_IMPORTANCE, &d);
                pt_stats_add(&s, got ? dbl(d.weight.b) : 0);
            }
            if (s.mean > most) error = pt_stats_standard_error(&s);
            most = fmax(most, s.mean);
        }
        pt_check(most - 7 * error <= (k == OREN ? 1.0152 : 1) + 1e-5, material_names[k], "reflects %g of what comes in", most);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Measured tables */

static int merl_part(int index, int what) { return what == 0 ? index / 16200 : what == 1 ? index / 180 % 90 : index % 180; }

/* Where rounding decides between two cells (margin 0 or 5e-25 in the table) a neighbour is right too: of the
   angles beside each other, or phi_d of 0 and of pi; for mirror directions (theta_h = 0) no phi_d is defined. */
static int is_near_cell(int got, int want, int any_phi)
{
    const int phi = abs(merl_part(got, 2) - merl_part(want, 2));
    return abs(merl_part(got, 0) - merl_part(want, 0)) <= 1 && abs(merl_part(got, 1) - merl_part(want, 1)) <= 1 && (phi <= 1 || phi == 179 || any_phi);
}

static pt_vec3 row_direction(const row *r, const char *theta, const char *phi)
{
    return polar(degrees(parameter(r, theta)), degrees(parameter(r, phi)));
}

/* Exact: table BSDF-MERL (Matusik et al. 2003). The angles of a row must lie in the cell that is found. */
static void table_index(void)
{
    const row *r;
    int at = 0, i;
    while ((r = next_row("BSDF-MERL", NULL, &at)) != NULL) {
        const pt_vec3 wi = row_direction(r, "theta_i", "phi_i"), wo = row_direction(r, "theta_o", "phi_o");
        const int got = pt_measured_index(wo, wi), swapped = pt_measured_index(wi, wo);
        const double slack_of_angles = is_float() ? 1e-6 : 1e-12;
        if (strcmp(r->quantity, "index") == 0) {
            const int on_edge = parameter(r, "margin") < 1e-6, want = (int)r->value, mirror = parameter(r, "theta_i") == parameter(r, "theta_o");
            pt_check(on_edge ? is_near_cell(got, want, mirror) : got == want, r->id, "%s: cell %d, exact %d", r->params, got, want);
            pt_check(on_edge ? is_near_cell(swapped, want, mirror) : swapped == want, r->id, "%s: exchanged directions are of cell %d, not %d",
                     r->params, swapped, want);
        } else if (strcmp(r->quantity, "theta_h") == 0) {
            const double u = sqrt(r->value / (PT_PI / 2)) * 90, k = merl_part(got, 0);
            pt_check(u >= k - 90 * sqrt(slack_of_angles) && u <= k + 1 + slack_of_angles * 1000, r->id, "ring %g of theta_h, exact %g", k, u);
        } else if (strcmp(r->quantity, "theta_d") == 0) {
            const double u = r->value / (PT_PI / 2) * 90, k = merl_part(got, 1);
            pt_check(u >= k - 100 * slack_of_angles && u <= k + 1 + 100 * slack_of_angles, r->id, "theta_d %g, exact %g", k, u);
        } else if (find_row("BSDF-MERL", "theta_h", r->params)->value > 0) { /* at 0 no phi_d is defined */
            const double u = (r->value < 0 ? r->value + PT_PI : r->value) / PT_PI * 180, k = merl_part(got, 2);
            pt_check(u >= k - 2e5 * slack_of_angles && u <= k + 1 + 2e5 * slack_of_angles, r->id, "phi_d %g, exact %g", k, u);
        }
    }
    for (i = 0, at = 0; i < PT_MEASURED_CELLS; i += 7) {
        pt_vec3 wo, wi;
        if (pt_measured_directions(i, &wo, &wi)) at += pt_measured_index(wo, wi) != i || pt_measured_index(wi, wo) != i;
    }
    pt_check(at == 0, "centres of cells", "%d directions of cells are not in their cell", at);
}

static pt_rgb coloured_lambert(void *user, pt_vec3 wo, pt_vec3 wi)
{
    (void)user;
    (void)wo;
    (void)wi;
    return rgb(0.5 / PT_PI, 0.25 / PT_PI, 0.125 / PT_PI);
}

/* At the centre of a cell a table has the value it was filled with; what no pair of directions above the surface
   reaches is unmeasured, and black. */
static int wrong_centres(const pt_measured *m, pt_brdf_fn f, void *user)
{
    int i, wrong = 0;
    for (i = 0; i < PT_MEASURED_CELLS; i += 11) {
        pt_vec3 wo, wi;
        const int above = pt_measured_directions(i, &wo, &wi);
        const pt_rgb got = pt_measured_eval(m, wo, wi), want = above ? f(user, wo, wi) : pt_rgb_grey(0);
        const double u = 3 * pt_gamma(1);
        wrong += fabs(dbl(got.r) - dbl(want.r)) > u * dbl(want.r) || fabs(dbl(got.g) - dbl(want.g)) > u * dbl(want.g) ||
                 fabs(dbl(got.b) - dbl(want.b)) > u * dbl(want.b) || (!above && !(m->value[i] < 0));
    }
    return wrong;
}

/* The albedo of a table at an angle, by the midpoint rule in mu^2 and the azimuth. */
static double table_albedo(const pt_measured *m, double theta)
{
    const pt_vec3 wo = polar(theta, 0);
    double sum = 0;
    int i, j;
    for (i = 0; i < 256; i++)
        for (j = 0; j < 128; j++)
            sum += dbl(pt_measured_eval(m, wo, polar(acos(sqrt((i + 0.5) / 256)), PT_PI * (j + 0.5) / 128)).r) * PT_PI / (256 * 128);
    return sum;
}

/* What tabulation costs: cells are constant (their angles about 0.5 degrees wide in phi_d, 1 in theta_d, up to 2
   in theta_h), and those whose centre has a direction below the horizon are black as a whole. Measured: a
   Lambertian loses 0.15, 0.2, 0.4 and 1.4 % at 0.1, 0.6, 1.1 and 1.4 rad; the others as much again. */
static void tabulation(const char *name, pt_measured *m, pt_brdf_fn f, void *user, pt_bsdf *b)
{
    static const double theta[4] = {0.1, 0.6, 1.1, 1.4}, loss[4] = {0.004, 0.006, 0.012, 0.04};
    int i;
    pt_check(pt_measured_fill(m, f, user) == PT_OK, name, "out of memory");
    if (!m->value) return;
    i = wrong_centres(m, f, user);
    pt_check(i == 0, name, "%d cells do not give back at their centre what they were filled with", i);
    for (i = 0; i < 4; i++) {
        const double exact = b ? smooth_albedo(b, theta[i]) : 0.5;
        pt_check_near(label("%s at %g rad", name, theta[i]), table_albedo(m, theta[i]), exact, loss[i] * exact, "the table's albedo");
    }
}

static void filled_tables(void)
{
    const pt_material ggx = measured_from(), p = pt_material_phong(rgb(0.3, 0.2, 0.1), rgb(0.4, 0.5, 0.6), 20);
    pt_bsdf b = upright(&ggx), c = upright(&p);
    pt_measured m = PT_MEASURED_INIT;
    pt_material half = pt_material_measured(&m);
    pt_bsdf d;
    tabulation("Lambertian table", &m, coloured_lambert, NULL, NULL);
    half.albedo = rgb(1, 0.5, 0.25);
    d = upright(&half);
    if (m.value) {
        pt_check(fabs(m.value[0] * PT_PI / 750 - 1) < 1e-6 && fabs(m.value[PT_MEASURED_CELLS] * PT_PI * 1.15 / 375 - 1) < 1e-6 &&
                     fabs(m.value[2 * PT_MEASURED_CELLS] * PT_PI * 1.66 / 187.5 - 1) < 1e-6,
                 "scales of the MERL format", "red is f 1500, green f 1500/1.15, blue f 1500/1.66");
        pt_check(fabs(dbl(pt_bsdf_eval(&d, polar(0.5, 0), polar(0.4, 1), PT_RADIANCE, PT_LOBE_ALL).b) * PT_PI - 0.03125) < 1e-6,
                 "albedo of a table", "multiplies it");
    }
    tabulation("GGX table", &m, brdf_of, &b, &b);
    tabulation("Phong table", &m, brdf_of, &c, &c);
    pt_measured_free(&m);
    pt_check(m.value == NULL, "free table", "keeps its pointer");
}

/* Bright and dark rings of theta_h in turns. */
static pt_rgb striped(void *user, pt_vec3 wo, pt_vec3 wi)
{
    (void)user;
    return pt_rgb_grey(merl_part(pt_measured_index(wo, wi), 0) % 2 ? real(0.3) : real(0.003));
}

/* Half of the directions are drawn by the ring of the half vector. Seen along the normal, those of theta_h below
   45 degrees, ring 63, lead up. Exact: the table's own cdf, whose steps are bright and dark too. */
static void table_rings(void)
{
    const uint32_t n = pt_test_samples(1u << 16);
    const pt_vec3 wo = pt_v3(0, 0, 1);
    pt_measured m = PT_MEASURED_INIT;
    const pt_material striped_material = pt_material_measured(&m);
    const pt_bsdf b = upright(&striped_material);
    pt_pcg32 rng = generator(790);
    double counts[64] = {0}, expected[64], step = 0;
    uint32_t i;
    if (pt_measured_fill(&m, striped, NULL) != PT_OK) return;
    for (i = 0; i < n; i++) {
        pt_bsdf_sample_result d;
        const int got = pt_bsdf_sample(&b, wo, 0.25, pair(&rng), PT_RADIANCE, &d);
        const int ring = got ? merl_part(pt_measured_index(wo, d.wi), 0) : 63;
        counts[ring < 63 ? ring : 63]++;
    }
    for (i = 0; i < 63; i++) {
        expected[i] = n * (m.cdf[i + 1] - m.cdf[i]);
        step = fmax(step, i % 2 ? 0 : expected[i] / n);
    }
    expected[63] = n * (1 - m.cdf[63]);
    pt_check(step < 0.001 && m.cdf[0] <= 0 && m.cdf[90] >= 1, "a striped table", "dark rings have a probability of %g", step);
    pt_check_chi2("a striped table", counts, expected, 64, "rings are not drawn as often as the table's cdf says");
    pt_measured_free(&m);
}

/* Replaces bytes of a file. */
static void patch(const char *path, long at, const void *bytes, size_t size)
{
    FILE *const f = fopen(path, "r+b");
    if (!f) return;
    fseek(f, at, SEEK_SET);
    fwrite(bytes, 1, size, f);
    fclose(f);
}

static void write_bytes(const char *path, const void *bytes, size_t size)
{
    FILE *const f = fopen(path, "wb");
    if (!f) return;
    fwrite(bytes, 1, size, f);
    fclose(f);
}

static void table_files(void)
{
    static const unsigned char head[12] = {90, 0, 0, 0, 90, 0, 0, 0, 180, 0, 0, 0}, wrong[12] = {90, 0, 0, 0, 90, 0, 0, 0, 0, 1, 0, 0};
    const double nan = HUGE_VAL - HUGE_VAL, infinite = HUGE_VAL, huge = 1e300, fine = 2;
    pt_measured m = PT_MEASURED_INIT;
    pt_result result;
    pt_check(have_table() && pt_measured_write(FILE_PATH, &ggx_table) == PT_OK && pt_measured_read(FILE_PATH, &m) == PT_OK, "a table as a file",
             "cannot be written and read");
    if (m.value && ggx_table.value)
        pt_check(memcmp(m.value, ggx_table.value, 3 * PT_MEASURED_CELLS * sizeof(double)) == 0 && memcmp(m.cdf, ggx_table.cdf, sizeof m.cdf) == 0,
                 "a table as a file", "changes on the way");
    allocations_left = 0;
    pt_check(pt_measured_read(FILE_PATH, &m) == PT_ERROR_MEMORY && !m.value, "a table as a file", "is read without memory");
    allocations_left = -1;
    patch(FILE_PATH, 12 + 8 * 777, &nan, 8);
    pt_check(pt_measured_read(FILE_PATH, &m) == PT_ERROR_FILE && !m.value, "a table with NaN", "is not refused");
    patch(FILE_PATH, 12 + 8 * 777, &infinite, 8);
    pt_check(pt_measured_read(FILE_PATH, &m) == PT_ERROR_FILE && !m.value, "a table with an infinite value", "is not refused");
    patch(FILE_PATH, 12 + 8 * 777, &huge, 8);
    result = pt_measured_read(FILE_PATH, &m);
    pt_check(result == PT_ERROR_FILE || (result == PT_OK && m.cdf[1] >= 0 && m.cdf[1] <= 1), "a table with 1e300",
             "is taken, and directions cannot be drawn from it: cdf %g", m.cdf[1]);
    patch(FILE_PATH, 12 + 8 * 777, &fine, 8);
    patch(FILE_PATH, 0, wrong, 12);
    pt_check(pt_measured_read(FILE_PATH, &m) == PT_ERROR_FILE && !m.value, "a table of 90 x 90 x 256", "is not refused");
    write_bytes(FILE_PATH, head, 12);
    pt_check(pt_measured_read(FILE_PATH, &m) == PT_ERROR_FILE && !m.value, "a table without values", "is not refused");
    write_bytes(FILE_PATH, head, 7);
    pt_check(pt_measured_read(FILE_PATH, &m) == PT_ERROR_FILE && !m.value, "a table cut in its head", "is not refused");
    remove(FILE_PATH);
    pt_check(pt_measured_read(FILE_PATH, &m) == PT_ERROR_FILE && pt_measured_read(NULL, &m) == PT_ERROR_FILE, "no file", "is not refused");
    pt_check(pt_measured_write(FILE_PATH, &m) == PT_ERROR_ARGUMENT && pt_measured_write("no/such/place", &ggx_table) == PT_ERROR_FILE,
             "an empty table, a place that is not there", "is written");
    pt_measured_free(&m);
}

static int nothing_scatters(void *user, pt_vec3 wo, pt_pcg32 *random, pt_vec3 *wi, pt_rgb *weight)
{
    (void)user;
    (void)wo;
    (void)random;
    (void)wi;
    (void)weight;
    return 0;
}

static void tables_without_memory(void)
{
    pt_measured m = PT_MEASURED_INIT;
    const long alive = allocations_alive;
    pt_result r[4];
    int i;
    for (i = 0; i < 4; i++) {
        allocations_left = i / 3;
        r[i] = i == 0 ? pt_measured_fill(&m, coloured_lambert, NULL) : i == 1 ? pt_measured_read(ROWS_PATH, &m)
                                                                              : pt_measured_scatter(&m, nothing_scatters, NULL, 10, 45, 0);
        allocations_left = -1;
        /* case 1 is no table: it is refused by its size before it asks for memory */
        pt_check(r[i] == (i == 1 ? PT_ERROR_FILE : PT_ERROR_MEMORY) && !m.value && allocations_alive == alive, "a table without memory",
                 "case %d: result %d, %ld blocks kept", i, (int)r[i], allocations_alive - alive);
    }
    pt_check(pt_measured_scatter(&m, nothing_scatters, NULL, 10, 7, 0) == PT_ERROR_ARGUMENT &&
                 pt_measured_scatter(&m, nothing_scatters, NULL, 10, 0, 0) == PT_ERROR_ARGUMENT,
             "a block that does not divide 90", "is taken");
}

/* ---------------------------------------------------------------------------------------------------------
   The virtual gonioreflectometer */

enum { BLOCK = 15, BLOCKS = 6 * 6 * 12 };

typedef struct scattering {
    const pt_bsdf *b;
    double n[BLOCKS], sum[BLOCKS], squares[BLOCKS]; /* of the weights that went into a block */
} scattering;

static int block_of(pt_vec3 wo, pt_vec3 wi)
{
    const int i = pt_measured_index(wo, wi);
    return (merl_part(i, 0) / BLOCK * 6 + merl_part(i, 1) / BLOCK) * 12 + merl_part(i, 2) / BLOCK;
}

static int scatter_of(void *user, pt_vec3 wo, pt_pcg32 *random, pt_vec3 *wi, pt_rgb *weight)
{
    scattering *const s = (scattering *)user;
    const double u_lobe = pt_pcg32_double(random);
    pt_bsdf_sample_result d;
    int k;
    if (!pt_bsdf_sample(s->b, wo, u_lobe, pair(random), PT_RADIANCE, &d)) return 0;
    *wi = d.wi;
    *weight = d.weight;
    k = block_of(wo, d.wi);
    s->n[k]++;
    s->sum[k] += dbl(d.weight.r);
    s->squares[k] += dbl(d.weight.r) * dbl(d.weight.r);
    return 1;
}

/* Is each block the mean of f over its pairs of directions (wo and wi by the cosine)? That mean comes from as many
   pairs of this program's own. The table's block is sum w / (pi n'), n' what the white standard scattered there; its
   relative variance is sum w^2 / (sum w)^2 + 1/n'. The sum of z^2 over the blocks is chi2, its cube root normal
   (Wilson and Hilferty 1931). */
static void one_scatter(const char *name, const pt_bsdf *b, uint64_t seed)
{
    const uint32_t n = pt_test_samples(1u << 19);
    static double mean[BLOCKS], squares[BLOCKS], count[BLOCKS], value[BLOCKS];
    static scattering s;
    pt_measured m = PT_MEASURED_INIT;
    pt_pcg32 rng = generator(seed);
    pt_judged_mean judged = {0, 0, 0, 0, 0, 0, 0};
    double chi2 = 0;
    uint32_t i;
    int k;
    memset(&s, 0, sizeof s);
    s.b = b;
    for (k = 0; k < BLOCKS; k++) mean[k] = squares[k] = count[k] = value[k] = 0;
    pt_check(pt_measured_scatter(&m, scatter_of, &s, n, BLOCK, pt_test_seed(seed + 1)) == PT_OK, name, "not measured");
    for (i = 0; i < n && m.value; i++) {
        const pt_vec3 wo = pt_warp_cosine(pair(&rng)), wi = pt_warp_cosine(pair(&rng));
        const double f = dbl(pt_bsdf_eval(b, wo, wi, PT_RADIANCE, PT_LOBE_ALL).r);
        k = block_of(wo, wi);
        value[k] = dbl(pt_measured_eval(&m, wo, wi).r);
        count[k]++;
        mean[k] += f;
        squares[k] += f * f;
    }
    for (k = 0; k < BLOCKS; k++) {
        double truth, relative;
        if (count[k] < 200 || s.n[k] < 200) continue;
        truth = mean[k] / count[k];
        relative = s.squares[k] / (s.sum[k] * s.sum[k]) + 1 / (s.sum[k] / (PT_PI * value[k]));
        relative += (squares[k] / count[k] - truth * truth) / (count[k] * truth * truth);
        chi2 += (value[k] / truth - 1) * (value[k] / truth - 1) / relative;
        judged.n++;
    }
    judged.value = cbrt(chi2 / judged.n);
    judged.exact = 1 - 2 / (9 * judged.n);
    judged.se = sqrt(2 / (9 * judged.n));
    pt_test_judge(name, &judged, 0.6, 0, "blocks differ from the BRDF: see pt_measured_scatter");
    pt_measured_free(&m);
}

static void goniometer(void)
{
    const pt_material white = pt_material_diffuse(rgb(0.5, 0.3, 0.1)), ggx = measured_from(), on = pt_material_oren_nayar(rgb(0.8, 0.2, 0.1), real(0.8));
    const pt_bsdf b = upright(&white), c = upright(&ggx), d = upright(&on);
    one_scatter("a Lambertian measured", &b, 800);
    one_scatter("GGX measured", &c, 804);
    one_scatter("Oren-Nayar measured", &d, 808);
}

/* ---------------------------------------------------------------------------------------------------------
   Textures, and where a sphere has its coordinates */

static void texture_images(void)
{
    static const float rgb_of[3 * 6] = {0, 0, 1, /**/ 0.5f, 0, 1, /**/ 1, 0, 1, /* top row, v near 1 */
                                        0, 1, 0, /**/ 0.5f, 1, 0, /**/ 1, 0.5f, 0};
    static const double at[9][5] = {/* u, v, colour */
        {1 / 6., 0.75, 0, 0, 1}, {0.5, 0.75, 0.5, 0, 1}, {5 / 6., 0.25, 1, 0.5, 0}, {1 / 3., 0.75, 0.25, 0, 1}, {0.5, 0.5, 0.5, 0.5, 0.5},
        {1, 0.75, 0.5, 0, 1}, {0, 0.25, 0.5, 0.75, 0}, {0.5, 1, 0.5, 0.5, 0.5}, {2 / 3., 0.375, 0.75, 0.5625, 0.25}};
    pt_texture t;
    int i, shift;
    memset(&t, 0, sizeof t);
    t.rgb = rgb_of;
    t.width = 3;
    t.height = 2;
    for (i = 0; i < 9; i++)
        for (shift = -2; shift <= 2; shift++) {
            const pt_rgb c = pt_texture_eval(&t, pt_v2(real(at[i][0] + shift), real(at[i][1] - 3 * shift)), pt_v3(0, 0, 0));
            const double off = fmax(fabs(dbl(c.r) - at[i][2]), fmax(fabs(dbl(c.g) - at[i][3]), fabs(dbl(c.b) - at[i][4])));
            pt_check(off < 100 * pt_gamma(1), "image texture", "at (%g, %g) shifted by %d: (%g, %g, %g); row 0 is at v = 1, values at centres",
                     at[i][0], at[i][1], shift, dbl(c.r), dbl(c.g), dbl(c.b));
        }
    t.scale = pt_v2(2, real(0.5));
    pt_check(fabs(dbl(pt_texture_eval(&t, pt_v2(real(0.25), real(1.5)), pt_v3(0, 0, 0)).r) - 0.5) < 100 * pt_gamma(1), "scale", "is of u and of v");
    for (i = 0; i < 200; i++) { /* as far away as one likes: some texel, and no crash */
        const pt_rgb c = pt_texture_eval(&t, pt_v2(real(pow(1.5, i) / 3), real(-pow(1.5, i) / 7)), pt_v3(0, 0, 0));
        pt_check(least(c) >= 0 && dbl(c.r) <= 1, "far coordinates", "1.5^%d gives %g", i, dbl(c.r));
    }
}

static pt_rgb uv_as_colour(void *user, pt_vec2 uv, pt_vec3 p)
{
    *(pt_vec3 *)user = p;
    return pt_rgb3(uv.x, uv.y, 0);
}

/* Longitude from 0 at +z over -x: 1/4, -z: 1/2, +x: 3/4; latitude 1 at +y. */
static void sphere_coordinates(void)
{
    static const double way[6][5] = {{-1, 0, 0, 0.25, 0.5}, {0, 0, -1, 0.5, 0.5}, {1, 0, 0, 0.75, 0.5},
                                     {0, 1, -1e-6, 0.5, 1}, {0.6, -0.8, 0, 0.75, 0.2048327647}, {0, -1, -1e-6, 0.5, 0}};
    pt_scene scene = PT_SCENE_INIT;
    pt_vec3 seen = pt_v3(0, 0, 0);
    pt_texture t;
    pt_material m = pt_material_diffuse(rgb(0.5, 1, 1));
    int i, ball;
    memset(&t, 0, sizeof t);
    t.kind = PT_TEXTURE_FUNCTION;
    t.function = uv_as_colour;
    t.user = &seen;
    t.scale = pt_v2(7, 7); /* not applied to a function's coordinates */
    m.texture = &t;
    ball = pt_add_material(&scene, m);
    pt_add_sphere(&scene, pt_v3(1, 2, 3), 2, ball);
    pt_check(pt_commit(&scene) == PT_OK, "textured sphere", "%s", pt_scene_error(&scene));
    for (i = 0; i < 6; i++) {
        const pt_vec3 w = pt_v3_normalize(v3(way[i][0], way[i][1], way[i][2])), p = pt_v3_add(pt_v3(1, 2, 3), pt_v3_scale(w, 5));
        const pt_ray ray = {p, pt_v3_neg(w), real(1e6)};
        pt_hit hit;
        pt_bsdf b;
        if (!pt_intersect(&scene, &ray, &hit)) {
            pt_check(0, "textured sphere", "missed");
            continue;
        }
        b = pt_bsdf_make(&m, &hit);
        pt_check(fabs(2 * dbl(b.albedo.r) - way[i][3]) < 2e-3 && fabs(dbl(b.albedo.g) - way[i][4]) < 1e-3, "sphere",
                 "direction %d has coordinates (%g, %g), not (%g, %g)", i, 2 * dbl(b.albedo.r), dbl(b.albedo.g), way[i][3], way[i][4]);
        pt_check(fabs(dot3(pt_v3_sub(seen, p), w) + 3) < 1e-4, "texture function", "gets the point of the hit");
    }
    pt_scene_free(&scene);
}

static void other_textures(void)
{
    pt_texture t;
    pt_material m = pt_material_phong(pt_rgb_grey(real(0.5)), pt_rgb_grey(real(0.5)), 10);
    pt_hit hit = hit_of(pt_v3(0, 0, 1), pt_v3(0, 0, 1));
    pt_bsdf b;
    int i, j, wrong = 0;
    memset(&t, 0, sizeof t);
    t.kind = PT_TEXTURE_CHECKER;
    t.a = rgb(1, 0.5, 0);
    t.scale = pt_v2(2, 4);
    for (i = -5; i < 5; i++)
        for (j = -5; j < 5; j++) {
            const pt_rgb c = pt_texture_eval(&t, pt_v2(real((i + 0.5) / 2), real((j + 0.25) / 4)), pt_v3(0, 0, 0));
            wrong += (dbl(c.r) > 0.5) != ((i + j) % 2 == 0);
        }
    pt_check(wrong == 0, "checker", "%d of 100 squares have the other colour", wrong);
    m.texture = &t;
    hit.uv = pt_v2(real(0.1), real(0.1));
    b = pt_bsdf_make(&m, &hit);
    pt_check(dbl(b.albedo.r) == 0.5 && dbl(b.albedo.g) == 0.25 && b.lobes == (PT_LOBE_DIFFUSE | PT_LOBE_GLOSSY), "checker", "multiplies the albedo");
    hit.uv = pt_v2(real(0.6), real(0.1));
    b = pt_bsdf_make(&m, &hit); /* the black square leaves the lobe */
    pt_check(b.lobes == PT_LOBE_GLOSSY && dbl(pt_bsdf_eval(&b, pt_v3(0, 0, 1), polar(1.5, 0), PT_RADIANCE, PT_LOBE_DIFFUSE).r) == 0, "black texture",
             "leaves lobes %u", b.lobes);
    m = pt_material_coat(pt_rgb_grey(1), real(1.5));
    m.texture = &t;
    b = pt_bsdf_make(&m, &hit);
    pt_check(b.lobes == PT_LOBE_SPECULAR, "black texture under a coat", "leaves lobes %u", b.lobes);
    m = pt_material_diffuse(pt_rgb_grey(1));
    m.texture = &t;
    b = pt_bsdf_make(&m, &hit);
    pt_check(b.lobes == 0, "black texture", "leaves lobes %u", b.lobes);
}

/* ---------------------------------------------------------------------------------------------------------
   Pictures that are read */

static void picture_round_trips(void)
{
    static const float pixels[18] = {0, 1, 2.5f, -3, 1e-30f, 1e30f, 0.1f, 0.2f, 0.3f, 4, 5, 6, 7, 8, 9, 10, 11, 12};
    unsigned char bytes[18];
    pt_image image = PT_IMAGE_INIT;
    int i, wrong = 0;
    pt_check(pt_write_pfm_floats(FILE_PATH, pixels, 2, 3) == PT_OK && pt_read_image(FILE_PATH, &image) == PT_OK, "PFM", "cannot be written and read");
    pt_check(image.width == 2 && image.height == 3 && image.rgb && memcmp(image.rgb, pixels, sizeof pixels) == 0, "PFM", "changes on the way");
    for (i = 0; i < 18; i++) bytes[i] = (unsigned char)(15 * i);
    pt_check(pt_write_ppm_bytes(FILE_PATH, bytes, 3, 2) == PT_OK && pt_read_image(FILE_PATH, &image) == PT_OK && image.width == 3 && image.height == 2,
             "PPM", "cannot be written and read");
    for (i = 0; i < 18 && image.rgb; i++)
        wrong += pt_srgb_byte((double)image.rgb[i]) != bytes[i] || fabs((double)image.rgb[i] - pt_srgb_decode(bytes[i] / 255.0)) > 1e-7;
    pt_check(wrong == 0, "PPM", "%d of 18 bytes come back changed", wrong);
    allocations_left = 0;
    pt_check(pt_read_image(FILE_PATH, &image) == PT_ERROR_MEMORY && !image.rgb && image.width == 0, "PPM", "read without memory");
    allocations_left = -1;
    pt_image_free(&image);
    remove(FILE_PATH);
    pt_check(pt_read_image(FILE_PATH, &image) == PT_ERROR_FILE && pt_read_image(NULL, &image) == PT_ERROR_FILE, "no picture", "is read");
}

/* Heads that are right or hostile; behind each stand 24 bytes: one pixel and more, or one and a half. */
static void picture_heads(void)
{
    static const struct {
        const char *head;
        int width; /* 0: must be refused */
    } heads[] = {{"P6\n2 4\n255\n", 2}, {"P6 8 1 255 ", 8}, {"P6\n# a comment\n2 4\n# another 9 9\n255\n", 2}, {"P6\n2 #\n 4\n255\n", 2},
        {"PF\n1 2\n-1.0\n", 1}, {"PF\n2 1\n1.0\n", 2}, {"PF\n1 1\n-0.5\n", 1},
        {"P6\n3 3\n255\n", 0}, {"P6\n65536 65536\n255\n", 0}, {"P6\n999999 999999\n255\n", 0}, {"P6\n4294967297 1\n255\n", 0},
        {"P6\n99999999999999999999 1\n255\n", 0}, {"P6\n-2 4\n255\n", 0}, {"P6\n+2 4\n255\n", 0}, {"P6\n0 4\n255\n", 0}, {"P6\n2 0\n255\n", 0},
        {"P6\n2 4\n65535\n", 0}, {"P6\n2 4\n0\n", 0}, {"P6\n2 4\nabc\n", 0}, {"P6\n2.5 4\n255\n", 0}, {"P3\n2 4\n255\n", 0}, {"Pf\n2 3\n-1\n", 0},
        {"PF\n2 2\n-1.0\n", 0}, {"PF\n1 1\nabc\n", 0}, {"PF\n1 1\n0\n", 0}, {"PF\n1 1\nnan\n", 0}, {"P6\n# a comment without end", 0}, {"", 0}, {"P6", 0}, {"PF\n1", 0}};
    pt_image image = PT_IMAGE_INIT;
    int i;
    for (i = 0; i < (int)(sizeof heads / sizeof heads[0]); i++) {
        unsigned char text[128];
        const size_t n = strlen(heads[i].head);
        const int whole = strncmp(heads[i].head, "P6\n# a comment w", 16) != 0 && n > 5; /* else nothing follows */
        pt_result r;
        memcpy(text, heads[i].head, n);
        memset(text + n, 0x3f, 24); /* as a float 0.747 */
        write_bytes(FILE_PATH, text, whole ? n + 24 : n);
        r = pt_read_image(FILE_PATH, &image);
        if (heads[i].width > 0)
            pt_check(r == PT_OK && image.rgb && image.width == heads[i].width && image.rgb[0] > 0.04f && image.rgb[0] < 0.75f, "head of a picture", "is refused: %d: %s", (int)r, heads[i].head);
        else pt_check((r == PT_ERROR_FILE || r == PT_ERROR_MEMORY) && !image.rgb && image.width == 0 && image.height == 0, "head of a picture", "is taken: %s", heads[i].head);
    }
    pt_image_free(&image);
    remove(FILE_PATH);
}

static void big_endian(void)
{
    static const unsigned char text[] = {'P', 'F', '\n', '1', ' ', '2', '\n', '1', '.', '0', '\n', 0x3f, 0x80, 0, 0, 0x40, 0, 0, 0, 0x40, 0x40, 0, 0,
                                         0xc0, 0x80, 0, 0, 0x40, 0xa0, 0, 0, 0x40, 0xc0, 0, 0};
    pt_image image = PT_IMAGE_INIT;
    write_bytes(FILE_PATH, text, sizeof text);
    pt_check(pt_read_image(FILE_PATH, &image) == PT_OK && image.rgb && image.rgb[3] == 1 && image.rgb[4] == 2 && image.rgb[5] == 3 && image.rgb[0] == -4 &&
                 image.rgb[2] == 6,
             "a big-endian PFM", "is not read, or its rows are not turned: they begin at the bottom");
    pt_image_free(&image);
    remove(FILE_PATH);
}

/* ---------------------------------------------------------------------------------------------------------
   What a scene refuses */

static void refused(pt_material m, const char *sentence)
{
    pt_scene scene = PT_SCENE_INIT;
    const int id = pt_add_material(&scene, m);
    if (sentence)
        pt_check(id == -1 && strstr(pt_scene_error(&scene), "material 0") && strstr(pt_scene_error(&scene), sentence), sentence, "id %d, says: %s", id,
                 pt_scene_error(&scene));
    else pt_check(id == 0, "a material in order", "kind %d is refused: %s", (int)m.kind, pt_scene_error(&scene));
    pt_scene_free(&scene);
}

static pt_material with(int k, const char *field, double value)
{
    pt_material m = material_of(k);
    if (strcmp(field, "roughness") == 0) m.roughness = real(value);
    else if (strcmp(field, "ior") == 0) m.ior = real(value);
    else if (strcmp(field, "exponent") == 0) m.exponent = real(value);
    else if (strcmp(field, "eta") == 0) m.eta.g = real(value);
    else if (strcmp(field, "k") == 0) m.k.b = real(value);
    else if (strcmp(field, "specular") == 0) m.specular.g = real(value);
    else if (strcmp(field, "albedo") == 0) m.albedo.b = real(value);
    return m;
}

static void refused_materials(void)
{
    const double nan = HUGE_VAL - HUGE_VAL;
    const pt_measured empty = PT_MEASURED_INIT;
    pt_material m = pt_material_measured(&empty);
    int k;
    for (k = 0; k < MATERIALS && have_table(); k++) refused(material_of(k), NULL);
    refused(with(PHONG, "specular", 0.7), NULL);
    refused(with(PHONG, "specular", 0.71), "albedo + specular");
    refused(with(BLINN, "specular", 0.71), "albedo + specular");
    refused(with(BLINN, "specular", -0.1), "specular");
    refused(with(PHONG, "specular", nan), "specular");
    refused(with(PHONG, "exponent", -1), "exponent -1 is outside [0, 1e6]");
    refused(with(BLINN, "exponent", 1.1e6), "exponent");
    refused(with(PHONG, "exponent", nan), "exponent");
    refused(with(METAL, "eta", 0), "eta is not positive");
    refused(with(METAL, "eta", -1), "eta");
    refused(with(METAL, "eta", nan), "eta");
    refused(with(METAL, "eta", HUGE_VAL), "eta");
    refused(with(METAL, "k", -1), "k");
    refused(with(METAL, "k", nan), "k");
    refused(with(METAL, "roughness", -0.2), "roughness -0.2 is outside [0,1]");
    refused(with(GLASS, "roughness", 1.1), "roughness 1.1 is outside [0,1]");
    refused(with(OREN, "roughness", nan), "roughness");
    refused(with(OREN, "albedo", 1.01), "albedo");
    refused(with(COAT, "ior", 1), "ior 1 of a coat is not above 1");
    refused(with(COAT, "ior", 0.9), "coat");
    refused(with(COAT, "ior", 0), NULL);
    refused(with(GLASS, "ior", -1), "ior");
    refused(with(GLASS, "ior", HUGE_VAL), "ior");
    refused(m, "has no measured table");
    m.measured = NULL;
    refused(m, "has no measured table");
    m.kind = (pt_material_kind)(PT_MATERIAL_MEASURED + 1);
    refused(m, "kind");
}

static void refused_textures(void)
{
    static float grey[12] = {0.1f, 0.2f, 0.3f, 0.4f, 0.5f, 0.6f, 0.7f, 0.8f, 0.9f, 1, 0, 0};
    pt_material m = pt_material_diffuse(pt_rgb_grey(1));
    pt_texture t;
    memset(&t, 0, sizeof t);
    m.texture = &t;
    refused(m, "texture image is empty");
    t.rgb = grey;
    t.width = 2;
    refused(m, "texture image is empty");
    t.height = 65537;
    refused(m, "larger than 65536");
    t.height = 2;
    refused(m, NULL);
    grey[11] = 1.5f;
    refused(m, "pixel value 1.5 is outside [0,1]");
    grey[11] = -0.5f;
    refused(m, "pixel value -0.5 is outside [0,1]");
    grey[11] = (float)(HUGE_VAL - HUGE_VAL);
    refused(m, "pixel value");
    grey[11] = 1;
    t.scale.x = real(HUGE_VAL);
    refused(m, "texture scale is not finite");
    t.scale.x = 0;
    t.kind = PT_TEXTURE_CHECKER;
    t.b = rgb(1, 1, 1.5);
    refused(m, "texture b");
    t.kind = PT_TEXTURE_FUNCTION;
    refused(m, "texture has no function");
    t.kind = (pt_texture_kind)(PT_TEXTURE_FUNCTION + 1);
    refused(m, "texture kind");
}

int main(int argc, char **argv)
{
    pt_test_begin("test_materials", argc, argv);
    if (!load_rows(ROWS_PATH)) return pt_test_end();
    PT_TEST_EXACT(fresnel_polarised);
    PT_TEST_EXACT(schlick);
    PT_TEST_EXACT(fresnel_of_diffuse_light);
    PT_TEST_EXACT(metals);
    PT_TEST_EXACT(microfacet_functions);
    PT_TEST(visible_normals);
    PT_TEST_EXACT(metal_values);
    PT_TEST(metal_albedo);
    PT_TEST(rough_glass);
    PT_TEST_EXACT(phong_norms);
    PT_TEST(phong_below);
    PT_TEST(oren_nayar);
    PT_TEST(coats);
    PT_TEST(one_story);
    PT_TEST(tilted_normals);
    PT_TEST_EXACT(reciprocity);
    PT_TEST_EXACT(lobe_masks);
    PT_TEST_EXACT(bands_are_alike);
    PT_TEST_EXACT(nearly_smooth);
    PT_TEST_EXACT(phong_peak);
    PT_TEST_EXACT(extremes);
    PT_TEST_EXACT(extremes_of_tables);
    PT_TEST_EXACT(refused_brdfs);
    PT_TEST_EXACT(no_gain);
    PT_TEST_EXACT(table_index);
    PT_TEST_EXACT(filled_tables);
    PT_TEST(table_rings);
    PT_TEST_EXACT(table_files);
    PT_TEST_EXACT(tables_without_memory);
    PT_TEST(goniometer);
    PT_TEST_EXACT(texture_images);
    PT_TEST_EXACT(sphere_coordinates);
    PT_TEST_EXACT(other_textures);
    PT_TEST_EXACT(picture_round_trips);
    PT_TEST_EXACT(picture_heads);
    PT_TEST_EXACT(big_endian);
    PT_TEST_EXACT(refused_materials);
    PT_TEST_EXACT(refused_textures);
    pt_measured_free(&ggx_table);
    return pt_test_end();
}
