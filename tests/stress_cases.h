/* stress_cases.h: the rows of tests/data/cases.csv, each against its exact result. The tolerance is that of the
   precision in which the header promises to work: what it decides or computes in double from pt_real input is held
   to the tolerance of double codes in both builds. Rows flagged `soft` must be finite and in range, no more. */

#ifndef STRESS_CASES_H
#define STRESS_CASES_H

#include "pt_stress.h"

static int is_must(const pt_case *c) { return pt_case_has(c, "must") || pt_case_has(c, "must64"); }

static double row_number(const pt_case *c, const char *key) { return pt_case_number(c->inputs, key); }
static double row_exact(const pt_case *c, const char *key) { return pt_case_number(c->expected, key); }

/* A value against expected[key], relative to it; soft rows must be finite. */
static void value_of_row(const pt_case *c, const char *key, double got, double bound)
{
    const double exact = row_exact(c, key);
    if (pt_case_has(c, "soft"))
        told_error(c->id, key, got, got, 0, "finite", 0);
    else
        told_relative(c->id, key, got, exact, bound);
}

/* ---- decisions ----------------------------------------------------------------------------------- */

/* A hit or miss, and its distance: a wrong decision is an infinite error. */
static void decision(const pt_case *c, int got, double t, double bound)
{
    const int want = row_exact(c, "hit") > 0;
    const double exact = want ? row_exact(c, "t") : 0;
    if (got) seen(t);
    if (!is_must(c))
        told(c->id, "hit", got, want, got && !(t > 0), "convention", 0);
    else if (got != want)
        told(c->id, "hit", got, want, HUGE_VAL, "decision", 0);
    else
        told(c->id, want ? "t" : "miss", want ? t : 0, exact, want ? fabs(t - exact) : 0, "abs", bound);
}

static void sphere_row(const pt_case *c)
{
    const pt_ray ray = ray_from(pt_case_vec3(c->inputs, "o"), pt_case_vec3(c->inputs, "d"));
    double t = 0;
    const int got = pt_intersect_sphere(&ray, pt_case_vec3(c->inputs, "c"), real(row_number(c, "r")), &t);
    decision(c, got, t, pt_case_tolerance(c, 1, "abs"));
}

static void triangle_row(const pt_case *c)
{
    const pt_ray ray = ray_from(pt_case_vec3(c->inputs, "o"), pt_case_vec3(c->inputs, "d"));
    double t = 0, b[2] = {0, 0};
    const int got = pt_intersect_triangle(&ray, pt_case_vec3(c->inputs, "v0"), pt_case_vec3(c->inputs, "v1"),
                                          pt_case_vec3(c->inputs, "v2"), &t, b);
    seen(b[0] + b[1]);
    decision(c, got, t, pt_case_tolerance(c, 1, "abs_t"));
}

static void pair_row(const pt_case *c)
{
    const pt_ray ray = ray_from(pt_case_vec3(c->inputs, "o"), pt_case_vec3(c->inputs, "d"));
    const pt_vec3 a = pt_case_vec3(c->inputs, "a"), b = pt_case_vec3(c->inputs, "b");
    double t, w[2];
    const int hit = pt_intersect_triangle(&ray, a, b, pt_case_vec3(c->inputs, "c"), &t, w) ||
                    pt_intersect_triangle(&ray, b, a, pt_case_vec3(c->inputs, "e"), &t, w);
    told(c->id, "one of two is hit", hit, 1, !hit, "decision", 0);
}

static void box_row(const pt_case *c)
{
    const pt_ray ray = ray_from(pt_case_vec3(c->inputs, "o"), pt_case_vec3(c->inputs, "d"));
    const int want = row_exact(c, "hit") > 0;
    const int got = pt_intersect_box(&ray, pt_case_vec3(c->inputs, "lo"), pt_case_vec3(c->inputs, "hi"));
    const int may = !is_must(c) || (!want && (pt_case_has(c, "cons") || pt_case_has(c, "may")));
    told(c->id, "hit", got, want, !may && got != want, "decision", 0);
}

/* ---- numbers ------------------------------------------------------------------------------------- */

static void gamma_row(const pt_case *c)
{
    value_of_row(c, is_float() ? "g32" : "g64", pt_gamma((int)pt_case_integer(c->inputs, "n")), 1e-14);
}

static double largest(pt_vec3 v)
{
    return fmax(fabs((double)v.x), fmax(fabs((double)v.y), fabs((double)v.z)));
}

static void frame_row(const pt_case *c)
{
    const pt_frame f = pt_frame_from_normal(pt_case_vec3(c->inputs, "n"));
    const double off = fmax(largest(pt_v3_sub(f.s, pt_case_vec3(c->expected, "t"))),
                            largest(pt_v3_sub(f.t, pt_case_vec3(c->expected, "b"))));
    seen(dot(f.s, f.t));
    told(c->id, "axes", off, 0, off, "abs", pt_case_tolerance(c, !is_float(), "abs"));
}

static void byte_row(const pt_case *c)
{
    const double x = strtod(pt_case_find(c->inputs, "x", '='), NULL); /* also NaN */
    told_error(c->id, "code", pt_srgb_byte(x), row_exact(c, "u8"), fabs(pt_srgb_byte(x) - row_exact(c, "u8")),
               "codes", 0);
}

static void pcg_row(const pt_case *c)
{
    pt_pcg32 rng =
        pt_pcg32_make(pt_case_integer(c->inputs, "initstate"), pt_case_integer(c->inputs, "initseq"));
    const char *at = pt_case_find(c->expected, "out", '=');
    int i, wrong = rng.state != pt_case_integer(c->expected, "state");
    for (i = 0; i < 6 && at; i++) {
        wrong += pt_pcg32_next(&rng) != (uint32_t)strtoul(at, NULL, 0);
        at = strchr(at, ':');
        if (at) at++;
    }
    told_count(c->id, "wrong outputs", wrong, 7);
}

static void advance_row(const pt_case *c)
{
    const char *const text = pt_case_find(c->inputs, "delta", '=');
    const uint64_t size = strtoull(text + (text[0] == '-'), NULL, 0),
                   delta = text[0] == '-' ? 0 - size : size;
    pt_pcg32 rng =
        pt_pcg32_make(pt_case_integer(c->inputs, "initstate"), pt_case_integer(c->inputs, "initseq"));
    int wrong;
    pt_pcg32_advance(&rng, delta);
    wrong = rng.state != pt_case_integer(c->expected, "state");
    wrong += pt_pcg32_next(&rng) != pt_case_integer(c->expected, "next");
    told_count(c->id, "wrong states", wrong, 2);
}

static void unit_row(const pt_case *c)
{
    const uint32_t bits = (uint32_t)pt_case_integer(c->inputs, "u32");
    const double got = (double)pt_real_from_u32(bits),
                 exact = is_float() ? row_exact(c, "shift24") : bits * 0x1p-32;
    told_error(c->id, "u", got, exact, got < 1 ? fabs(got - exact) : HUGE_VAL, "abs", 0);
}

static void sobol_row(const pt_case *c)
{
    const int d = (int)pt_case_integer(c->inputs, "dim");
    const double got = d > 4 ? 0 : pt_sobol_u32((uint32_t)pt_case_integer(c->inputs, "index"), d - 1);
    const double exact = row_exact(c, "u32");
    if (d > 4)
        told(c->id, "only four dimensions, padded", 0, 0, 0, "not used", 0);
    else
        told(c->id, "u32", got, exact, fabs(got - exact), "bits", 0);
}

static void owen_row(const pt_case *c)
{
    const double got = pt_owen_scramble((uint32_t)pt_case_integer(c->inputs, "v"),
                                        (uint32_t)pt_case_integer(c->inputs, "seed"));
    told(c->id, "u32", got, row_exact(c, "lk_vegdahl"), fabs(got - row_exact(c, "lk_vegdahl")), "bits", 0);
}

static void variance_row(const pt_case *c)
{
    pt_stats s = PT_STATS_INIT;
    uint64_t i;
    for (i = 0; i < pt_case_integer(c->inputs, "n"); i++)
        pt_stats_add(&s, row_number(c, "base") + (double)(i & 1));
    value_of_row(c, "sample_var", pt_stats_variance(&s), pt_case_tolerance(c, 1, "rel"));
}

static void accumulate_row(const pt_case *c)
{
    const uint64_t n = pt_case_integer(c->inputs, "n") / (STRESS_LONG ? 1 : 64);
    pt_stats s = PT_STATS_INIT;
    uint64_t i;
    for (i = 0; i < n; i++) pt_stats_add(&s, row_number(c, "x"));
    value_of_row(c, "mean", s.mean, pt_case_tolerance(c, 1, "rel"));
}

static void mis_row(const pt_case *c)
{
    const double p1 = row_number(c, "p1"), p2 = row_number(c, "p2");
    value_of_row(c, "balance", pt_mis_weight(p1, p2, PT_HEURISTIC_BALANCE), pt_case_tolerance(c, 1, "rel"));
    value_of_row(c, "power2", pt_mis_weight(p1, p2, PT_HEURISTIC_POWER), pt_case_tolerance(c, 1, "rel"));
}

/* ---- solid angles and form factors, computed in double ------------------------------------------- */

static void cone_row(const pt_case *c)
{
    value_of_row(c, "omega", pt_solid_angle_cap(row_number(c, "halfangle_rad")),
                 pt_case_tolerance(c, 1, "rel"));
}

static void triangle_omega_row(const pt_case *c)
{
    value_of_row(c, "omega",
                 pt_solid_angle_triangle(pt_case_vec3(c->inputs, "p"), pt_case_vec3(c->inputs, "v0"),
                                         pt_case_vec3(c->inputs, "v1"), pt_case_vec3(c->inputs, "v2")),
                 pt_case_tolerance(c, 1, "rel"));
}

static void rectangle_omega_row(const pt_case *c)
{
    value_of_row(c, "omega",
                 pt_solid_angle_rectangle(pt_case_vec3(c->inputs, "o"), pt_case_vec3(c->inputs, "s"),
                                          pt_case_vec3(c->inputs, "ex"), pt_case_vec3(c->inputs, "ey")),
                 pt_case_tolerance(c, 1, "rel"));
}

static void rectangle_irradiance_row(const pt_case *c)
{
    const double a = row_number(c, "a"), b = row_number(c, "b"), h = row_number(c, "h");
    const pt_vec3 v[4] = {v3(0, 0, h), v3(a, 0, h), v3(a, b, h), v3(0, b, h)};
    value_of_row(c, "E_L1", pt_irradiance_polygon(1, v3(0, 0, 0), v3(0, 0, 1), v, 4),
                 pt_case_tolerance(c, 1, "rel"));
}

static void parallel_row(const pt_case *c)
{
    value_of_row(c, "F", pt_form_factor_parallel(row_number(c, "a"), row_number(c, "b"), row_number(c, "c")),
                 pt_case_tolerance(c, 1, "rel"));
}

/* The rows name the common edge a, then the two widths. */
static void perpendicular_row(const pt_case *c)
{
    value_of_row(c, "F",
                 pt_form_factor_perpendicular(row_number(c, "b"), row_number(c, "c"), row_number(c, "a")),
                 pt_case_tolerance(c, 1, "rel"));
}

static void sphere_light_row(const pt_case *c)
{
    const double rel = pt_case_tolerance(c, !is_float(), "rel") + 2 * pt_gamma(1);
    pt_scene scene = PT_SCENE_INIT;
    pt_light_sample_result s;
    int ok;
    pt_add_sphere(&scene, v3(0, 0, row_number(c, "dist")), real(row_number(c, "r")), lamp(&scene, 1));
    ok = pt_commit(&scene) == PT_OK &&
         pt_light_sample(&scene, 0, v3(0, 0, 0), pt_v2(real(row_number(c, "u")), real(0.125)), &s);
    if (ok)
        value_of_row(c, "omega", 1 / s.pdf_w, rel);
    else
        told(c->id, "sampled", 0, 1, !pt_case_has(c, "soft"), "decision", 0);
    pt_scene_free(&scene);
}

/* ---- materials ----------------------------------------------------------------------------------- */

static void fresnel_row(const pt_case *c)
{
    double cos_t;
    const double got = pt_fresnel_dielectric(row_number(c, "cosi"), row_number(c, "eta"), &cos_t);
    const double exact = row_exact(c, "R");
    if (pt_case_has(c, "soft"))
        told_error(c->id, "R", got, got, !(got >= 0 && got <= 1), "in [0,1]", 0);
    else
        told_error(c->id, "R", got, exact, fabs(got - exact), "abs", pt_case_tolerance(c, 1, "abs"));
}

#if PTI_HAS_MICROFACET
static void conductor_row(const pt_case *c)
{
    const double got = pt_fresnel_conductor(row_number(c, "cosi"), row_number(c, "eta"), row_number(c, "k"));
    told_error(c->id, "R", got, row_exact(c, "R"), fabs(got - row_exact(c, "R")), "abs",
               pt_case_tolerance(c, 1, "abs"));
}

/* What h = normalize(wo + wi), rounded to pt_real, does to D: tan^2 changes by 2 tan dtan with dtan <= 2 sqrt 3 u,
   so ln D by 4 tan dtan / (alpha^2 + tan^2) <= 2 dtan / alpha; and cos^4 by 4 u. */
static double ggx_bound(double alpha) { return (4 * sqrt(3.0) / alpha + 16) * pt_gamma(1); }

static void ggx_row(const pt_case *c)
{
    const double alpha = row_number(c, "ax");
    const pt_vec3 wo = pt_case_vec3(c->inputs, "wo"), wi = pt_case_vec3(c->inputs, "wi");
    const pt_vec3 h = pt_v3_normalize(pt_v3_add(wo, wi));
    if (alpha != row_number(c, "ay") || wi.z < 0) { /* which side counts is the BSDF's affair */
        told(c->id, "isotropic reflection only", 0, 0, 0, "not used", 0);
        return;
    }
    value_of_row(c, "D", pt_ggx_d(h, alpha),
                 fmax(ggx_bound(alpha), pt_case_tolerance(c, !is_float(), "rel")));
    value_of_row(c, "G1o", pt_ggx_g1(wo, alpha), 16 * pt_gamma(1));
    value_of_row(c, "G1i", pt_ggx_g1(wi, alpha), 16 * pt_gamma(1));
}

/* The mapping is the header's own affair; what it draws must be a unit normal of the upper half. */
static void visible_row(const pt_case *c)
{
    const double alpha = row_number(c, "ax");
    const pt_vec3 wo = pt_case_vec3(c->inputs, "wo");
    const pt_vec2 u = pt_v2(real(fmin(row_number(c, "u1"), 1 - pt_gamma(1))),
                            real(fmin(row_number(c, "u2"), 1 - pt_gamma(1))));
    const pt_vec3 h = pt_ggx_visible_sample(wo, alpha, u);
    const double length = fabs(sqrt(dot(h, h)) - 1);
    seen(dot(h, h));
    told(c->id, "unit, above, seen", length, 0,
         (double)h.z >= 0 && dot(h, wo) > -8 * pt_gamma(1) ? length : HUGE_VAL, "abs", 4 * pt_gamma(1));
}
#endif

/* ---- transport ----------------------------------------------------------------------------------- */

/* Emission 1 on a closed sphere, albedo rho; `edges` edges without roulette, or roulette with survival q (0: by
   throughput). Nothing here is shared, so that threads may call it. */
static pt_stats furnace_chunk(double rho, double q, int edges, int n, uint64_t seed, uint64_t stream)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, seed, 0);
    pt_li_options options;
    pt_stats s = PT_STATS_INIT;
    int i;
    memset(&options, 0, sizeof options);
    options.max_edges = edges;
    options.roulette = edges ? PT_ROULETTE_NONE : q > 0 ? PT_ROULETTE_CONSTANT : PT_ROULETTE_THROUGHPUT;
    options.roulette_survival = real(q);
    pt_add_sphere(&scene, v3(0, 0, 0), 1, glowing(&scene, rho, 1));
    if (pt_commit(&scene) == PT_OK)
        for (i = 0; i < n; i++) {
            const pt_ray ray = ray_from(v3(0.1, -0.2, 0.05), v3(0.3, 0.5, -0.8));
            pt_li_info info = {0};
            pt_sampler_start(&sampler, stream, (uint32_t)i);
            pt_stats_add(&s, pt_li_path_plain(&scene, &ray, &sampler, &options, &info).r);
        }
    pt_scene_free(&scene);
    return s;
}

static pt_stats furnace_paths(double rho, double q, int edges, int n, uint64_t seed)
{
    const pt_stats s = furnace_chunk(rho, q, edges, n, pt_test_seed(seed), 0);
    seen(s.mean);
    return s;
}

/* Cut off after maxdepth bounces every path has the value of the sum, up to the rounding of the weights: one of
   beta and one of the sum an edge. */
static void furnace_row(const pt_case *c)
{
    const int bounces = (int)pt_case_integer(c->inputs, "maxdepth");
    const double u = pt_gamma(bounces < 1000 ? 4 * bounces + 4 : 4000);
    const pt_stats s =
        furnace_paths(row_number(c, "rho"), 0, bounces + 1, bounces > 1000 && !STRESS_LONG ? 1 : 8, 700);
    told_relative(c->id, "Ltrunc", s.mean, row_exact(c, "Ltrunc"), u);
}

/* Finite variance needs q > rho^2; a mean that can be judged needs a skewness that is finite too, q^2 > rho^3. */
static void roulette_row(const pt_case *c)
{
    const double rho = row_number(c, "rho"), q = row_number(c, "q");
    const int n = (int)fmax(32, (STRESS_LONG ? 1e7 : 1e6) / row_exact(c, "mean_len"));
    const pt_stats s = furnace_paths(rho, q, 0, (int)fmin(n, STRESS_LONG ? 4e6 : 4e4), 710);
    if (q * q > rho * rho * rho && n >= 1024)
        told_mean(c->id, &s, row_exact(c, "mean"), 0, 0);
    else
        told_error(c->id, "finite", s.mean, s.mean, 0, "finite", 0);
}

/* ---- files ---------------------------------------------------------------------------------------- */

#if PTI_HAS_FILES
/* The rows have one value a pixel, the header writes three: each pixel of the file is its value three times, rows from
   the bottom, little-endian. */
static void pfm_row(const pt_case *c)
{
    const int w = (int)pt_case_integer(c->inputs, "w"), h = (int)pt_case_integer(c->inputs, "h");
    const char *const path = "build/stress.pfm", *at = pt_case_find(c->inputs, "pixels_top_down", '=');
    unsigned char bytes[256];
    float rgb[12] = {0}, value[4] = {0};
    size_t got = 0;
    int i, k, wrong = 0;
    FILE *file;
    for (i = 0; i < w * h; i++) {
        char *end;
        value[i] = (float)strtod(at, &end);
        at = end + 1;
        for (k = 0; k < 3; k++) rgb[3 * i + k] = value[i];
    }
    wrong += pt_write_pfm_floats(path, rgb, w, h) != PT_OK;
    file = fopen(path, "rb");
    if (file) got = fread(bytes, 1, sizeof bytes, file);
    if (file) fclose(file);
    wrong += got < (size_t)(12 * w * h);
    for (i = 0; i < w * h && wrong == 0; i++)
        for (k = 0; k < 12; k++) {
            const float v = value[(h - 1 - i / w) * w + i % w];
            uint32_t bits;
            memcpy(&bits, &v, sizeof bits);
            wrong +=
                bytes[got - (size_t)(12 * w * h) + (size_t)(12 * i + k)] != ((bits >> (8 * (k % 4))) & 255u);
        }
    remove(path);
    told_count(c->id, "wrong bytes", wrong, 12 * w * h);
}
#endif

/* ---- all ------------------------------------------------------------------------------------------ */

/* Kinds without a function wait for the part of the header that they test. */
typedef struct row_kind {
    const char *kind;
    void (*test)(const pt_case *c);
    const char *later;
} row_kind;

static const row_kind ROW_KINDS[] = {{"sphere", sphere_row, NULL},
                                     {"triangle", triangle_row, NULL},
                                     {"tri_pair", pair_row, NULL},
                                     {"box", box_row, NULL},
                                     {"gamma", gamma_row, NULL},
                                     {"onb", frame_row, NULL},
                                     {"quantize", byte_row, NULL},
                                     {"pcg32", pcg_row, NULL},
                                     {"pcg32_advance", advance_row, NULL},
                                     {"u32_to_unit", unit_row, NULL},
                                     {"sobol", sobol_row, NULL},
                                     {"owen_hash", owen_row, NULL},
                                     {"variance", variance_row, NULL},
                                     {"accumulate", accumulate_row, NULL},
                                     {"mis", mis_row, NULL},
                                     {"cone", cone_row, NULL},
                                     {"tri_omega", triangle_omega_row, NULL},
                                     {"rect_omega", rectangle_omega_row, NULL},
                                     {"rect_ff", rectangle_irradiance_row, NULL},
                                     {"ff_parallel", parallel_row, NULL},
                                     {"ff_perp", perpendicular_row, NULL},
                                     {"sphere_light", sphere_light_row, NULL},
                                     {"fresnel_d", fresnel_row, NULL},
#if PTI_HAS_MICROFACET
                                     {"fresnel_c", conductor_row, NULL},
                                     {"ggx", ggx_row, NULL},
                                     {"ggx_vndf_cap", visible_row, NULL},
#endif
                                     {"furnace", furnace_row, NULL},
                                     {"roulette", roulette_row, NULL},
#if PTI_HAS_FILES
                                     {"pfm", pfm_row, NULL},
#endif
                                     {"ggx_ndf", NULL, "only visible normals are drawn, never all"},
                                     {"offset_wb", NULL, "rays start by an error bound, not by this rule"},
                                     {"hg_eval", NULL, "waits for media"},
                                     {"hg_sample", NULL, "waits for media"},
                                     {"transmittance", NULL, "waits for media"},
                                     {"freepath", NULL, "waits for media"},
                                     {"slab_albedo1", NULL, "waits for media"},
                                     {"radiosity_sphere", NULL, "waits for finite elements"}};

static void case_rows(void)
{
    const int kinds = (int)(sizeof ROW_KINDS / sizeof ROW_KINDS[0]);
    FILE *const file = pt_cases_open();
    int k, n;
    pt_case c;
    begin_group("rows");
    for (k = 0; file && k < kinds; k++) {
        rewind(file);
        for (n = 0; pt_case_next(file, ROW_KINDS[k].kind, &c); n++)
            if (ROW_KINDS[k].test) ROW_KINDS[k].test(&c);
        if (ROW_KINDS[k].later) printf("later|%s|%d|%s\n", ROW_KINDS[k].kind, n, ROW_KINDS[k].later);
        told(ROW_KINDS[k].kind, "rows of this kind", n, n, n < 3, "rows", 0);
    }
    if (file) fclose(file);
}

#endif /* STRESS_CASES_H */
