/* test_numbers.c: what everything else counts on - random numbers, samplers, statistics, colour, radiometry,
   image files ([PT-00] to [PT-03], [PT-05], [PT-17]). */

#include "pt_cases.h"

/* A relative difference that is 0 for equal infinities and for 0 against 0. */
static double relative(double got, double exact)
{
    if (got == exact) return 0;
    return fabs(got - exact) / fabs(exact);
}

static void near_relative(const char *name, double got, double exact, double tolerance)
{
    pt_check(relative(got, exact) <= tolerance, name, "got %.17g, exact %.17g, relative difference %.3g", got,
             exact, relative(got, exact));
}

static int is_float(void) { return sizeof(pt_real) == sizeof(float); }

/* ---------------------------------------------------------------------------------------------------------
   [PT-00], [PT-01] */

static void clocks(void)
{
    const double wall = pt_wall_seconds(), cpu = pt_cpu_seconds();
    double w = wall, c = cpu;
    while (w - wall < 0.02 || c - cpu < 0.01) {
        w = pt_wall_seconds();
        c = pt_cpu_seconds();
        if (w < wall || c < cpu || w - wall > 10) break;
    }
    pt_check(w > wall && w - wall <= 10, "wall clock runs", "%.17g then %.17g", wall, w);
    pt_check(c > cpu, "CPU clock runs", "%.17g then %.17g", cpu, c);
    pt_check(pt_wall_resolution() > 0 && pt_wall_resolution() <= 1, "resolution of the wall clock", "%g",
             pt_wall_resolution());
    pt_check(pt_hardware_threads() >= 1, "number of threads", "%d", pt_hardware_threads());
}

static void results_have_sentences(void)
{
    int i, j;
    for (i = -1; i <= (int)PT_ERROR_FILE + 1; i++) {
        const char *const s = pt_result_string((pt_result)i);
        pt_check(s != NULL && s[0] != '\0', "pt_result_string", "result %d has no sentence", i);
        for (j = 0; j < i && i <= (int)PT_ERROR_FILE; j++)
            pt_check(strcmp(s, pt_result_string((pt_result)j)) != 0, "pt_result_string",
                     "results %d and %d share one sentence", i, j);
    }
}

static void normalize(void)
{
    static const double scale[] = {1, 1e-45, 1e-38, 1e-19, 1e-10, 1e10, 1e19, 1e37};
    size_t i;
    pt_vec3 zero = pt_v3_normalize(pt_v3(0, 0, 0));
    pt_check(zero.x == 0 && zero.y == 0 && zero.z == 0, "the zero vector stays zero",
             "0 / 0 would be NaN: test the length before dividing");
    for (i = 0; i < sizeof scale / sizeof scale[0]; i++) {
        const pt_real s = (pt_real)scale[i];
        const pt_vec3 a = pt_v3(3 * s, -2 * s, 6 * s), u = pt_v3_normalize(a);
        const double length =
            sqrt((double)u.x * (double)u.x + (double)u.y * (double)u.y + (double)u.z * (double)u.z);
        /* three coordinates, each rounded once */
        pt_check(fabs(length - 1) <= 2 * pt_gamma(1), "a normalised vector has length 1",
                 "length %.17g at scale %g", length, scale[i]);
        pt_check(u.x > 0 && u.y < 0 && u.z > 0, "a normalised vector keeps its direction", "scale %g",
                 scale[i]);
    }
}

/* Columns of the frame: unit, orthogonal, right-handed, and those of the published construction. */
static void one_frame(const pt_case *c)
{
    const pt_vec3 n = pt_case_vec3(c->inputs, "n"), t = pt_case_vec3(c->expected, "t"),
                  b = pt_case_vec3(c->expected, "b");
    const pt_frame f = pt_frame_from_normal(n);
    const double tolerance = pt_case_tolerance(c, !is_float(), "abs"),
                 ortho = pt_case_tolerance(c, 0, "ortho");
    const pt_vec3 ds = pt_v3_sub(f.s, t), dt = pt_v3_sub(f.t, b),
                  handed = pt_v3_sub(pt_v3_cross(f.s, f.t), f.n);
    pt_check((double)pt_v3_length(ds) <= 2 * tolerance && (double)pt_v3_length(dt) <= 2 * tolerance, c->id,
             "not the vectors of [Duf17] listing 3: off by %g and %g", (double)pt_v3_length(ds),
             (double)pt_v3_length(dt));
    pt_check(fabs((double)pt_v3_dot(f.s, f.t)) <= ortho && fabs((double)pt_v3_dot(f.s, f.n)) <= ortho &&
                 fabs((double)pt_v3_dot(f.t, f.n)) <= ortho,
             c->id, "the frame is not orthogonal");
    pt_check(fabs((double)pt_v3_length(f.s) - 1) <= ortho && fabs((double)pt_v3_length(f.t) - 1) <= ortho,
             c->id, "the frame is not of unit length");
    pt_check((double)pt_v3_length(handed) <= 2 * ortho, c->id, "s x t is not n: the frame is left-handed");
}

static void frames(void)
{
    FILE *const file = pt_cases_open();
    const pt_vec3 v = pt_v3((pt_real)0.25, (pt_real)-0.5, 2);
    const pt_frame f = pt_frame_from_normal(pt_v3_normalize(pt_v3(1, -2, -3)));
    const pt_vec3 back = pt_frame_to_local(&f, pt_frame_to_world(&f, v));
    pt_case c;
    int rows = 0;
    for (; file && pt_case_next(file, "onb", &c); rows++) one_frame(&c);
    if (file) fclose(file);
    pt_check(rows == 18, "rows of frames", "%d", rows);
    pt_check(
        (double)pt_v3_length(pt_v3_sub(back, v)) <= 20 * pt_gamma(1), "to world and back",
        "to_world by the three axes, to_local by dot products with them: one is the inverse of the other");
}

static void one_code(const pt_case *c)
{
    const char *const text = pt_case_find(c->inputs, "x", '=');
    const double x = strtod(text, NULL), srgb = pt_case_number(c->expected, "srgb");
    const unsigned want = (unsigned)pt_case_integer(c->expected, "u8");
    pt_check(pt_srgb_byte(x) == want, c->id, "linear %g gives code %u, should be %u", x, pt_srgb_byte(x),
             want);
    if (x >= 0 && x <= 1) near_relative(c->id, pt_srgb_encode(x), srgb, 1e-13);
}

static void srgb(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0, i, last = 0, gaps = 0;
    for (; file && pt_case_next(file, "quantize", &c); rows++) one_code(&c);
    if (file) fclose(file);
    pt_check(rows == 16, "rows of codes", "%d", rows);
    /* IEC 61966-2-1 */
    near_relative("encode 0.001", pt_srgb_encode(0.001), 0.01292, 1e-14);
    near_relative("encode 0.0031308", pt_srgb_encode(0.0031308), 0.040449936, 1e-14);
    near_relative("encode 0.18", pt_srgb_encode(0.18), 0.46135612950044165, 1e-14);
    for (i = 0; i <= 100000; i++) {
        const int code = pt_srgb_byte(i * 1e-5);
        gaps += code != last && code != last + 1;
        last = code;
    }
    pt_check(gaps == 0 && last == 255, "codes rise without gaps from 0 to 255", "%d gaps", gaps);
    pt_check_near("luminance of white", pt_luminance(1, 1, 1), 1, 1e-14, "the weights must sum to 1");
    /* luminance is the Y of the inverse of the XYZ to RGB matrix */
    {
        static const double xyz[3] = {0.3, 0.4, 0.5};
        const pt_rgbd rgb = pt_xyz_to_rgb(xyz);
        pt_check_near("luminance of a colour is its Y", pt_luminance(rgb.r, rgb.g, rgb.b), 0.4, 1e-14,
                      "pt_luminance and pt_xyz_to_rgb disagree");
    }
}

/* ---------------------------------------------------------------------------------------------------------
   [PT-02] */

/* O'Neill prints six outputs of each generator. */
static void one_generator(const pt_case *c)
{
    pt_pcg32 rng =
        pt_pcg32_make(pt_case_integer(c->inputs, "initstate"), pt_case_integer(c->inputs, "initseq"));
    const char *at = pt_case_find(c->expected, "out", '=');
    int i;
    pt_check(rng.state == pt_case_integer(c->expected, "state"), c->id, "wrong state after seeding");
    for (i = 0; i < 6 && at; i++) {
        const uint32_t want = (uint32_t)strtoul(at, NULL, 0), got = pt_pcg32_next(&rng);
        pt_check(got == want, c->id, "output %d is 0x%08lx, should be 0x%08lx", i, (unsigned long)got,
                 (unsigned long)want);
        at = strchr(at, ':');
        if (at) at++;
    }
}

static void one_advance(const pt_case *c)
{
    const uint64_t seed = pt_case_integer(c->inputs, "initstate"),
                   stream = pt_case_integer(c->inputs, "initseq");
    const char *const text = pt_case_find(c->inputs, "delta", '=');
    const uint64_t delta =
        text[0] == '-' ? (uint64_t)0 - strtoull(text + 1, NULL, 0) : strtoull(text, NULL, 0);
    const pt_pcg32 start = pt_pcg32_make(seed, stream);
    pt_pcg32 rng = start;
    pt_pcg32_advance(&rng, delta);
    pt_check(rng.state == pt_case_integer(c->expected, "state"), c->id, "wrong state after %s draws", text);
    pt_check(pt_pcg32_next(&rng) == pt_case_integer(c->expected, "next"), c->id,
             "wrong output after %s draws", text);
    pt_pcg32_advance(&rng, (uint64_t)0 - delta - 1);
    pt_check(rng.state == start.state && rng.inc == start.inc, c->id, "stepping back does not lead home");
}

static void pcg32(void)
{
    FILE *file = pt_cases_open();
    pt_pcg32 step = pt_pcg32_make(7, 11), jump = step;
    pt_case c;
    int rows = 0, i;
    for (; file && pt_case_next(file, "pcg32", &c); rows++) one_generator(&c);
    if (file) rewind(file);
    for (; file && pt_case_next(file, "pcg32_advance", &c); rows++) one_advance(&c);
    if (file) fclose(file);
    pt_check(rows == 19, "rows of PCG32", "%d", rows);
    for (i = 0; i < 155; i++) pt_pcg32_next(&step);
    pt_pcg32_advance(&jump, 155);
    pt_check(step.state == jump.state, "155 draws are one advance",
             "a jump of n steps is x -> a^n x + c (a^n - 1) / (a - 1), by squaring");
}

static void one_conversion(const pt_case *c)
{
    const uint32_t bits = (uint32_t)pt_case_integer(c->inputs, "u32");
    const double got = (double)pt_real_from_u32(bits);
    const double want = is_float() ? pt_case_number(c->expected, "shift24") : bits * 0x1p-32;
    pt_check(got == want && got < 1, c->id, "0x%08lx gives %.17g, should be %.17g", (unsigned long)bits, got,
             want);
}

static void unit_interval(void)
{
    FILE *const file = pt_cases_open();
    pt_sampler s;
    pt_case c;
    double last;
    int rows = 0;
    for (; file && pt_case_next(file, "u32_to_unit", &c); rows++) one_conversion(&c);
    if (file) fclose(file);
    pt_check(rows == 10, "rows of conversions", "%d", rows);
    last = 1 - 0x1p-53; /* rounds to 1 in float */
    s = pt_sampler_make_given(&last, 1);
    pt_check((double)pt_sampler_1d(&s) < 1, "no sampler hands out 1", "the double 1 - 2^-53 was rounded up");
}

/* First points of [Joe08], new-joe-kuo-6.21201, binary order, as the top byte of 32 bits. */
static void sobol_points(void)
{
    static const unsigned char first[8][4] = {{0x00, 0x00, 0x00, 0x00}, {0x80, 0x80, 0x80, 0x80},
                                              {0x40, 0xc0, 0xc0, 0xc0}, {0xc0, 0x40, 0x40, 0x40},
                                              {0x20, 0xa0, 0x60, 0x20}, {0xa0, 0x20, 0xe0, 0xa0},
                                              {0x60, 0x60, 0xa0, 0xe0}, {0xe0, 0xe0, 0x20, 0x60}};
    FILE *const file = pt_cases_open();
    uint32_t n;
    int d, rows = 0;
    pt_case c;
    for (n = 0; n < 8; n++)
        for (d = 0; d < 4; d++)
            pt_check(pt_sobol_u32(n, d) == (uint32_t)first[n][d] << 24, "Sobol points",
                     "point %d, dimension %d: 0x%08lx", (int)n, d, (unsigned long)pt_sobol_u32(n, d));
    while (file && pt_case_next(file, "sobol", &c)) {
        const uint32_t index = (uint32_t)pt_case_integer(c.inputs, "index");
        const int dim = (int)pt_case_integer(c.inputs, "dim");
        if (dim > 4) continue;
        rows++;
        pt_check(pt_sobol_u32(index, dim - 1) == pt_case_integer(c.expected, "u32"), c.id, "0x%08lx",
                 (unsigned long)pt_sobol_u32(index, dim - 1));
    }
    if (file) fclose(file);
    pt_check(rows == 16, "rows of Sobol points", "%d", rows);
}

/* How many of 2^k boxes are hit by 2^k points, when box counts bits[d] leading bits of dimension d. */
static int boxes_hit(const uint32_t (*points)[4], int k, const int *bits)
{
    unsigned char seen[4096] = {0};
    int i, d, hit = 0;
    for (i = 0; i < 1 << k; i++) {
        uint32_t box = 0;
        for (d = 0; d < 4; d++)
            if (bits[d] > 0) box = (box << bits[d]) | (points[i][d] >> (32 - bits[d]));
        hit += !seen[box];
        seen[box] = 1;
    }
    return hit;
}

/* Every dimension is a permutation of i/2^k; dimensions 0 and 1 fill every box of area 2^-k. */
static void sobol_nets(void)
{
    static uint32_t points[4096][4];
    int i, d, k, scrambled;
    for (scrambled = 0; scrambled < 2; scrambled++) {
        for (i = 0; i < 4096; i++)
            for (d = 0; d < 4; d++) {
                points[i][d] = pt_sobol_u32((uint32_t)i, d);
                if (scrambled) points[i][d] = pt_owen_scramble(points[i][d], 0x9e3779b9u * (uint32_t)(d + 1));
            }
        for (k = 1; k <= 12; k++) {
            for (d = 0; d < 4; d++) {
                int bits[4] = {0, 0, 0, 0};
                bits[d] = k;
                pt_check(boxes_hit((const uint32_t(*)[4])points, k, bits) == 1 << k,
                         "each dimension is a permutation", "dimension %d, first 2^%d points, scrambled: %d",
                         d, k, scrambled);
            }
            for (i = 0; i <= k; i++) {
                int bits[4] = {0, 0, 0, 0};
                bits[0] = i;
                bits[1] = k - i;
                pt_check(boxes_hit((const uint32_t(*)[4])points, k, bits) == 1 << k,
                         "dimensions 0 and 1 are a (0,2)-net", "boxes of 2^-%d x 2^-%d, scrambled: %d", i,
                         k - i, scrambled);
            }
        }
    }
}

static void owen_values(void)
{
    FILE *const file = pt_cases_open();
    pt_pcg32 rng = pt_pcg32_make(3, 5);
    pt_case c;
    int rows = 0, i, broken = 0;
    for (; file && pt_case_next(file, "owen_hash", &c); rows++) {
        const uint32_t v = (uint32_t)pt_case_integer(c.inputs, "v"),
                       seed = (uint32_t)pt_case_integer(c.inputs, "seed");
        pt_check(pt_owen_scramble(v, seed) == pt_case_integer(c.expected, "lk_vegdahl"), c.id, "0x%08lx",
                 (unsigned long)pt_owen_scramble(v, seed));
    }
    if (file) fclose(file);
    pt_check(rows == 11, "rows of Owen scrambling", "%d", rows);
    for (i = 0; i < 20000; i++) {
        const uint32_t x = pt_pcg32_next(&rng), y = pt_pcg32_next(&rng), seed = pt_pcg32_next(&rng);
        const int k = 1 + i % 31; /* x and z agree in the first k bits, and differ in the next */
        const uint32_t low = 0xffffffffu >> k, z = (x & ~low) | ((y & low) >> 1) | (~x & (low ^ (low >> 1)));
        const uint32_t sx = pt_owen_scramble(x, seed), sz = pt_owen_scramble(z, seed);
        broken += ((sx ^ sz) & ~low) != 0 || ((sx ^ sz) & (low ^ (low >> 1))) == 0;
    }
    pt_check(broken == 0, "Owen scrambling keeps dyadic intervals",
             "%d of 20000 pairs agree in other leading bits than before", broken);
}

static void expect_uniform(const char *name, const double *counts, int cells, const char *hint)
{
    static double expected[65536];
    double total = 0;
    int i;
    for (i = 0; i < cells; i++) total += counts[i];
    for (i = 0; i < cells; i++) expected[i] = total / cells;
    pt_check_chi2(name, counts, expected, cells, hint);
}

/* Over the seeds every scrambled value is uniform. */
static void owen_uniform(void)
{
    pt_test_source("a scrambled number is uniform over seeds (Owen 1995)");
    static const uint32_t values[3] = {0, 0x80000000u, 0xcafebabeu};
    const uint32_t n = pt_test_samples(1u << 18);
    int i;
    for (i = 0; i < 3; i++) {
        double counts[256] = {0};
        uint32_t seed;
        for (seed = 0; seed < n; seed++)
            counts[pt_owen_scramble(values[i], (uint32_t)pt_hash64(pt_test_seed(seed))) >> 24]++;
        expect_uniform("scrambled top byte over seeds", counts, 256,
                       "each bit is flipped by a hash of the bits above it and of the seed");
    }
}

/* Flip any input bit of the hash: every byte of the change is uniform. */
static void avalanche(void)
{
    pt_test_source("flipped bits of a good hash are fair coins");
    static double counts[8][256];
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(1), 1);
    const uint32_t n = pt_test_samples(1u << 17);
    uint32_t i;
    int byte;
    memset(counts, 0, sizeof counts);
    for (i = 0; i < n; i++) {
        const uint64_t high = pt_pcg32_next(&rng), x = high << 32 | pt_pcg32_next(&rng);
        const uint64_t change = pt_hash64(x) ^ pt_hash64(x ^ (uint64_t)1 << (i & 63));
        for (byte = 0; byte < 8; byte++) counts[byte][change >> (8 * byte) & 255]++;
    }
    for (byte = 0; byte < 8; byte++)
        expect_uniform("change of a byte of the hash", counts[byte], 256,
                       "each bit of the input must change each bit of the output half of the time");
}

static void pcg32_uniform(void)
{
    pt_test_source("uniform distribution");
    double counts[1024] = {0};
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(2), 2);
    const uint32_t n = pt_test_samples(1u << 19);
    uint32_t i;
    int inside = 1;
    for (i = 0; i < n; i++) {
        const double u = pt_pcg32_double(&rng);
        inside &= u >= 0 && u < 1;
        counts[(int)(u * 1024) & 1023]++;
    }
    pt_check(inside, "pt_pcg32_double is in [0,1)", "it was not");
    expect_uniform("pt_pcg32_double", counts, 1024, "top bits of the integer times 2^-k, k their number");
}

static const pt_sampler_kind kinds[3] = {PT_SAMPLER_SOBOL, PT_SAMPLER_INDEPENDENT, PT_SAMPLER_STRATIFIED};
static const char *const kind_names[3] = {"sobol", "independent", "stratified"};

static double ask(pt_sampler *s, uint64_t stream, uint32_t index, uint32_t dimension)
{
    pt_sampler_start(s, stream, index);
    pt_sampler_seek(s, dimension);
    return (double)pt_sampler_1d(s);
}

/* Dimension d of sample i of stream s is one number, in whatever order one asks. */
static void any_order(void)
{
    int k;
    for (k = 0; k < 3; k++) {
        pt_sampler s = pt_sampler_make(kinds[k], 99, 16);
        double value[4][16][12];
        uint32_t i, j, d;
        int other_number = 0;
        for (j = 0; j < 4; j++)
            for (i = 0; i < 16; i++) {
                pt_sampler_start(&s, j, i);
                for (d = 0; d < 12; d++) value[j][i][d] = (double)pt_sampler_1d(&s);
            }
        for (i = 0; i < 2000; i++) {
            const uint32_t a = i * 7 % 4, b = i * 11 % 16, c = i * 5 % 12;
            pt_sampler other = pt_sampler_make(kinds[k], 99, 16);
            other_number += ask(&s, a, b, c) != value[a][b][c] || ask(&other, a, b, c) != value[a][b][c];
        }
        pt_check(other_number == 0, kind_names[k], "%d numbers depend on what was asked before",
                 other_number);
        pt_sampler_start(&s, 3, 7);
        pt_sampler_seek(&s, 4);
        (void)pt_sampler_2d(&s);
        pt_check((double)pt_sampler_1d(&s) == value[3][7][6], kind_names[k],
                 "a pair must use up two dimensions");
    }
}

static void seeds_and_streams_differ(void)
{
    int k;
    for (k = 0; k < 3; k++) {
        pt_sampler a = pt_sampler_make(kinds[k], 1, 64), b = pt_sampler_make(kinds[k], 2, 64);
        const double here = ask(&a, 5, 3, 8);
        pt_check(here != ask(&b, 5, 3, 8), kind_names[k], "another seed gives the same number");
        pt_check(here != ask(&a, 6, 3, 8), kind_names[k], "another stream gives the same number");
        pt_check(here != ask(&a, 5, 4, 8), kind_names[k], "another sample gives the same number");
        pt_check(here != ask(&a, 5, 3, 9), kind_names[k], "another dimension gives the same number");
        pt_check(here != ask(&a, 5, 3, 12), kind_names[k], "another set of dimensions gives the same number");
    }
}

static void given_numbers(void)
{
    static const double u[3] = {0.25, 0.5, 0.75};
    pt_sampler s = pt_sampler_make_given(u, 3);
    pt_vec2 pair;
    pt_sampler_start(&s, 17, 4);
    pair = pt_sampler_2d(&s);
    pt_check((double)pair.x == 0.25 && (double)pair.y == 0.5, "given numbers", "not handed out in order");
    pt_check((double)pt_sampler_1d(&s) == 0.75 && s.given_missing == 0, "given numbers",
             "the last one is wrong");
    pt_check((double)pt_sampler_1d(&s) < 1 && s.given_missing == 1, "given numbers",
             "a draw beyond the end must be counted");
    pt_sampler_seek(&s, 1);
    pt_check((double)pt_sampler_1d(&s) == 0.5, "given numbers", "seek does not find dimension 1 again");
}

/* Exactly one of N samples in each of N strata. */
static int strata_filled(pt_sampler *s, uint64_t stream, uint32_t first, uint32_t nx, uint32_t ny,
                         uint32_t dimension)
{
    unsigned char seen[1024] = {0};
    uint32_t i, filled = 0;
    for (i = 0; i < nx * ny; i++) {
        uint32_t cell;
        pt_vec2 u;
        pt_sampler_start(s, stream, first + i);
        pt_sampler_seek(s, dimension);
        if (ny == 1)
            u = pt_v2(pt_sampler_1d(s), 0);
        else
            u = pt_sampler_2d(s);
        cell = (uint32_t)((double)u.x * nx) + nx * (uint32_t)((double)u.y * ny);
        filled += !seen[cell];
        seen[cell] = 1;
    }
    return filled == nx * ny;
}

static void strata(void)
{
    static const uint32_t counts[5] = {1, 2, 16, 37, 1000};
    uint32_t i, stream, bits;
    pt_sampler s;
    for (i = 0; i < 5; i++)
        for (stream = 0; stream < 20; stream++) {
            s = pt_sampler_make(PT_SAMPLER_STRATIFIED, 8, counts[i]);
            pt_check(strata_filled(&s, stream, 0, counts[i], 1, stream), "stratified, 1-D",
                     "%u samples leave a stratum empty", counts[i]);
        }
    /* the largest counts, with strata of the size of their index: an order of 2^32 - 1 of them still ends */
    for (i = 0; i < 4; i++) {
        static const uint32_t most[4] = {0x40000001u, 0x80000000u, 0x80000001u, 0xffffffffu};
        double sum = 0;
        s = pt_sampler_make(PT_SAMPLER_STRATIFIED, 8, most[i]);
        for (stream = 0; stream < 1000; stream++) {
            pt_sampler_start(&s, stream / 10, most[i] - 1 - stream % 10);
            sum += (double)pt_sampler_1d(&s);
        }
        pt_check(fabs(sum / 1000 - 0.5) < 6 / sqrt(12.0 * 1000), "stratified, 1-D",
                 "%lu samples: mean %g of the last ten in 100 streams", (unsigned long)most[i], sum / 1000);
    }
    for (i = 1; i <= 20; i++)
        for (stream = 0; stream < 20; stream++) {
            s = pt_sampler_make(PT_SAMPLER_STRATIFIED, 8, i * i);
            pt_check(strata_filled(&s, stream, 0, i, i, 2 * stream), "stratified, 2-D",
                     "%u x %u samples leave a stratum empty", i, i);
        }
    /* Sobol points, also after scrambling and in any block of 2^m samples */
    for (i = 0; i < 16; i++)
        for (bits = 0; bits <= 8; bits++) {
            s = pt_sampler_make(PT_SAMPLER_SOBOL, 8, 0);
            pt_check(strata_filled(&s, i, 256 * i, 1u << bits, 1u << (8 - bits), 4 * i), "Sobol, 2-D",
                     "256 points leave a box of 2^-%u x 2^-%u empty at dimension %u", bits, 8 - bits, 4 * i);
        }
}

/* Each number alone is uniform when the seed varies: no sampler is biased. */
static void uniform_over_seeds(void)
{
    pt_test_source("uniform distribution: randomised points are each uniform");
    static const char *const names[3] = {"sobol over seeds", "independent over seeds",
                                         "stratified over seeds"};
    const uint32_t n = pt_test_samples(1u << 17);
    int k;
    for (k = 0; k < 3; k++) {
        double one[256] = {0}, two[256] = {0};
        uint32_t seed;
        for (seed = 0; seed < n; seed++) {
            pt_sampler s = pt_sampler_make(kinds[k], pt_test_seed(seed), 10);
            pt_vec2 u;
            one[(int)(ask(&s, 3, 7, 5) * 256)]++;
            pt_sampler_start(&s, 4, 1);
            pt_sampler_seek(&s, 12);
            u = pt_sampler_2d(&s);
            two[(int)((double)u.x * 16) + 16 * (int)((double)u.y * 16)]++;
        }
        expect_uniform(names[k], one, 256, "a single number is not uniform");
        expect_uniform(names[k], two, 256, "a pair is not uniform in the square");
    }
}

/* Pairs of numbers that must know nothing of each other: dimension 3 here against a dimension of the same or
   the next stream, the same or the next sample. */
static void neighbours(const char *name, pt_sampler_kind kind, unsigned next_stream, unsigned next_sample,
                       uint32_t dimension, uint64_t seed)
{
    double counts[256] = {0};
    pt_stats product = PT_STATS_INIT;
    pt_sampler s = pt_sampler_make(kind, pt_test_seed(seed), 64);
    const uint32_t n = pt_test_samples(1u << 17);
    uint32_t i;
    for (i = 0; i < n; i++) {
        const uint64_t stream = next_sample ? i / 32 : next_stream ? 2 * (uint64_t)i : i;
        const uint32_t index = next_sample ? 2 * (i % 32) : 5;
        const double u = ask(&s, stream, index, 3);
        const double v = ask(&s, stream + next_stream, index + next_sample, dimension);
        counts[(int)(u * 16) + 16 * (int)(v * 16)]++;
        pt_stats_add(&product, 12 * (u - 0.5) * (v - 0.5));
    }
    expect_uniform(name, counts, 256, "the numbers of such a pair are not independent");
    pt_check_mean(name, &product, 0, 0, 0.03, PT_TEST_VALUES, "their correlation is not zero");
}

static void independence(void)
{
    pt_test_source("uniform distribution on the square: pairs that must be independent");
    neighbours("independent, neighbouring pixels", PT_SAMPLER_INDEPENDENT, 1, 0, 3, 11);
    neighbours("independent, neighbouring samples", PT_SAMPLER_INDEPENDENT, 0, 1, 3, 12);
    neighbours("independent, neighbouring dimensions", PT_SAMPLER_INDEPENDENT, 0, 0, 4, 13);
    neighbours("independent, the next edge's dimension", PT_SAMPLER_INDEPENDENT, 0, 0, 11, 14);
    neighbours("independent, next pixel, dimension before", PT_SAMPLER_INDEPENDENT, 1, 0, 2, 20);
    neighbours("independent, next sample, dimension before", PT_SAMPLER_INDEPENDENT, 0, 1, 2, 21);
    neighbours("sobol, neighbouring pixels", PT_SAMPLER_SOBOL, 1, 0, 3, 15);
    neighbours("sobol, dimensions of different sets", PT_SAMPLER_SOBOL, 0, 0, 4, 16);
    neighbours("sobol, the next edge's dimension", PT_SAMPLER_SOBOL, 0, 0, 11, 17);
    neighbours("sobol, next pixel, other dimension", PT_SAMPLER_SOBOL, 1, 0, 5, 22);
    neighbours("stratified, neighbouring pixels", PT_SAMPLER_STRATIFIED, 1, 0, 3, 18);
    neighbours("stratified, neighbouring dimensions", PT_SAMPLER_STRATIFIED, 0, 0, 4, 19);
    neighbours("stratified, next pixel, dimension before", PT_SAMPLER_STRATIFIED, 1, 0, 2, 23);
}

/* ---------------------------------------------------------------------------------------------------------
   [PT-03] */

static void moments(void)
{
    /* {1,2,4,8,16}: deviations from 6.2, exact sums by hand */
    static const double x[5] = {1, 2, 4, 8, 16};
    pt_stats s = PT_STATS_INIT;
    int i;
    pt_check(pt_stats_variance(&s) == 0 && pt_stats_standard_error(&s) == 0 && pt_stats_skewness(&s) == 0,
             "statistics of nothing", "0 where n is too small");
    for (i = 0; i < 5; i++) pt_stats_add(&s, x[i]);
    pt_check_near("mean", s.mean, 6.2, 1e-15, "mean += (x - mean) / n, with n counted first");
    pt_check_near("variance", pt_stats_variance(&s), 148.8 / 4, 1e-13, "divide by n - 1");
    pt_check_near("standard error", pt_stats_standard_error(&s), sqrt(148.8 / 20), 1e-14,
                  "sqrt(variance / n)");
    pt_check_near("third moment", s.m3, 721.68, 1e-12, "sum of cubes of deviations, see pt_stats_add");
    pt_check_near("skewness", pt_stats_skewness(&s), (721.68 / 5) / pow(148.8 / 5, 1.5), 1e-14,
                  "m3 / n over (m2 / n)^1.5");
}

static void merging(void)
{
    static const int parts[4] = {0, 1, 17, 482};
    pt_pcg32 rng = pt_pcg32_make(4, 4);
    pt_stats whole = PT_STATS_INIT, merged = PT_STATS_INIT;
    int p, i;
    for (p = 0; p < 4; p++) {
        pt_stats part = PT_STATS_INIT;
        for (i = 0; i < parts[p]; i++) {
            const double x = 100 - log(1 - pt_pcg32_double(&rng));
            pt_stats_add(&part, x);
            pt_stats_add(&whole, x);
        }
        pt_stats_merge(&merged, &part);
    }
    pt_check(merged.n == 500, "merged count", "%g", merged.n);
    near_relative("merged mean", merged.mean, whole.mean, 1e-15);
    near_relative("merged second moment", merged.m2, whole.m2, 1e-12);
    near_relative("merged third moment", merged.m3, whole.m3, 1e-11);
}

/* E[x^2] - E[x]^2 would return nonsense here. */
static void variance_far_from_zero(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0;
    for (; file && pt_case_next(file, "variance", &c); rows++) {
        const double base = pt_case_number(c.inputs, "base");
        const uint64_t n = pt_case_integer(c.inputs, "n");
        pt_stats s = PT_STATS_INIT;
        uint64_t i;
        for (i = 0; i < n; i++) pt_stats_add(&s, base + (double)(i & 1));
        near_relative(c.id, s.mean, pt_case_number(c.expected, "mean"), 1e-12);
        near_relative(c.id, pt_stats_variance(&s), pt_case_number(c.expected, "sample_var"),
                      pt_case_tolerance(&c, 1, "rel"));
    }
    if (file) fclose(file);
    pt_check(rows == 4, "rows of variances", "%d", rows);
}

/* Quantiles: roots found with 40 digits. */
static void normal_tail(void)
{
    static const double z[5] = {3.890591886413094, 4.4171734134690221, 4.8916384756985904, 5.3267238863844963,
                                5.7307288682362897}; /* of 1e-4, 1e-5, ... 1e-8, two-sided */
    double alpha = 1e-4;
    int i;
    for (i = 0; i < 5; i++, alpha /= 10) {
        near_relative("normal tail", 2 * pt_normal_sf(z[i]), alpha, 1e-13);
        near_relative("normal quantile", pt_normal_isf(alpha / 2), z[i], 1e-14);
        near_relative("lower normal tail", 1 - pt_normal_sf(-z[i]), alpha / 2, 1e-7);
    }
    near_relative("normal tail at 1", pt_normal_sf(1), 0.15865525393145705, 1e-14);
    near_relative("far normal tail", pt_normal_sf(30), 4.906713927148187e-198, 1e-12);
    pt_check_near("median", pt_normal_isf(0.5), 0, 1e-14, "half of the normal law lies above its mean, 0");
    near_relative("lower quantile", pt_normal_isf(0.975), -1.959963984540054, 1e-14);
}

static void student_tail(void)
{
    static const double row[10][3] = {/* df, two-sided level, t */
                                      {5, 1e-4, 11.177710070278614},    {5, 1e-6, 28.47847346298421},
                                      {10, 1e-4, 6.211050891290663},    {10, 1e-6, 10.516489956914905},
                                      {30, 1e-4, 4.4824171754097472},   {30, 1e-6, 6.1190756203842168},
                                      {100, 1e-4, 4.0533367012015181},  {100, 1e-6, 5.2137275742300774},
                                      {1000, 1e-4, 3.9063437367013812}, {1000, 1e-6, 4.922289523429588}};
    static const double x[6] = {1e-3, 0.5, 1, 3, 40, 1e6};
    int i;
    for (i = 0; i < 10; i++)
        near_relative("Student tail", 2 * pt_student_sf(row[i][2], row[i][0]), row[i][1], 1e-11);
    for (i = 0; i < 6; i++) { /* closed forms for one and two degrees of freedom */
        const double r = sqrt(x[i] * x[i] + 2);
        near_relative("Student tail, df 1", pt_student_sf(x[i], 1), atan2(1, x[i]) / PT_PI, 1e-12);
        near_relative("Student tail, df 2", pt_student_sf(x[i], 2), 1 / (r * (r + x[i])), 1e-12);
        pt_check_near("both Student tails", pt_student_sf(x[i], 7) + pt_student_sf(-x[i], 7), 1, 1e-14,
                      "they must add up to 1");
        near_relative("Student becomes normal", pt_student_sf(x[i], 1e7), pt_normal_sf(x[i]),
                      x[i] < 4 ? 1e-5 : HUGE_VAL);
    }
    near_relative("Student tail at 0", pt_student_sf(0, 3), 0.5, 1e-15);
}

static void chi2_tail(void)
{
    static const double row[14][3] = {
        /* df, level, chi-squared */
        {1, 1e-4, 15.136705226623397},    {1, 0.01, 6.6348966010212151},   {9, 1e-4, 33.719948438964634},
        {9, 0.01, 21.665994333461926},    {31, 1e-4, 69.105692289867192},  {31, 0.01, 52.191394833191927},
        {63, 1e-4, 113.50499285105354},   {63, 0.01, 92.010023614131991},  {99, 1e-4, 160.05573829663099},
        {99, 0.01, 134.64161685578914},   {255, 1e-4, 347.65421270458889}, {255, 0.01, 310.45738821990584},
        {1023, 1e-4, 1199.8346537246859}, {1023, 0.01, 1131.158738963494}};
    static const double x[6] = {1e-6, 0.1, 1, 5, 60, 1300};
    int i;
    for (i = 0; i < 14; i++)
        near_relative("chi-squared tail", pt_chi2_sf(row[i][2], row[i][0]), row[i][1], 1e-11);
    for (i = 0; i < 6; i++) { /* closed forms for 1, 2 and 4 degrees of freedom */
        near_relative("chi-squared tail, df 1", pt_chi2_sf(x[i], 1), erfc(sqrt(x[i] / 2)), 1e-11);
        near_relative("chi-squared tail, df 2", pt_chi2_sf(x[i], 2), exp(-x[i] / 2), 1e-12);
        near_relative("chi-squared tail, df 4", pt_chi2_sf(x[i], 4), exp(-x[i] / 2) * (1 + x[i] / 2), 1e-12);
    }
    pt_check(pt_chi2_sf(0, 5) == 1 && pt_chi2_sf(-1, 5) == 1, "chi-squared tail at 0", "must be 1");
}

static double power_of(const double *u, void *user) { return pow(u[0], *(const double *)user); }
static double quarter_disk(const double *u, void *user)
{
    (void)user;
    return u[0] * u[0] + u[1] * u[1] < 1;
}
static double product_of_five(const double *u, void *user)
{
    (void)user;
    return u[0] * u[1] * u[2] * u[3] * u[4];
}

static pt_result integrate(pt_integrand f, void *user, int dimensions, uint32_t n, pt_sampler_kind kind,
                           uint64_t seed, pt_estimate *out)
{
    const pt_integral p = {f, user, dimensions, n, kind, seed};
    return pt_estimate_mean(&p, out);
}

typedef struct integral {
    const char *name;
    pt_integrand f;
    int dimensions;
    double power, exact, variance; /* of one value under independent sampling */
} integral;

static const integral integrals[6] = {
    {"x", power_of, 1, 1, 1.0 / 2, 1.0 / 12},
    {"x^2", power_of, 1, 2, 1.0 / 3, 4.0 / 45},
    {"x^5", power_of, 1, 5, 1.0 / 6, 0.063131313131313131},
    {"x^10", power_of, 1, 10, 1.0 / 11, 0.039354584809130264},
    {"quarter disk", quarter_disk, 2, 0, PT_PI / 4, 0.1685478883293634},
    {"product of five", product_of_five, 5, 0, 1.0 / 32, 0.0031386638374485597}};

/* Many estimates with different seeds: is their mean right, and is the standard error they report? */
static void one_integral(const integral *f, int kind, uint64_t seed)
{
    const uint32_t runs = 64, n = pt_test_samples(32 * 1024);
    pt_stats value = PT_STATS_INIT, square = PT_STATS_INIT, claimed = PT_STATS_INIT;
    double power = f->power;
    char name[80];
    uint32_t i;
    for (i = 0; i < runs; i++) {
        pt_estimate e;
        const pt_result r =
            integrate(f->f, &power, f->dimensions, n, kinds[kind], pt_test_seed(seed + i), &e);
        pt_check(r == PT_OK && e.evaluations == n && e.seconds >= 0, f->name, "result %d, %g evaluations",
                 (int)r, e.evaluations);
        pt_stats_add(&value, e.value);
        pt_stats_add(&square, (e.value - f->exact) * (e.value - f->exact));
        pt_stats_add(&claimed, e.standard_error * e.standard_error);
    }
    sprintf(name, "integral of %s, %s", f->name, kind_names[kind]);
    pt_check_mean(name, &value, f->exact, 0, 0.02, PT_TEST_MEANS,
                  "the sum must be divided by n; is each dimension of a point drawn from its own stream?");
    sprintf(name, "error of %s, %s", f->name, kind_names[kind]);
    pt_check_equal_means(name, &square, &claimed, 0, "the reported standard error is not the true one");
    if (kinds[kind] != PT_SAMPLER_INDEPENDENT) return;
    sprintf(name, "variance of %s", f->name);
    pt_check_mean(name, &claimed, f->variance / n, 0, 0.05, PT_TEST_MEANS,
                  "standard_error^2 n must be the variance");
}

static void estimates(void)
{
    pt_test_source("elementary integrals; the mean of reported squared errors is that of true ones");
    int i, k;
    for (i = 0; i < 6; i++)
        for (k = 0; k < 3; k++) one_integral(&integrals[i], k, (uint64_t)(1000 + 100 * (3 * i + k)));
}

/* Well-spread points: orders of magnitude below the error of independent ones for a smooth integrand. */
static void spread_points_pay(void)
{
    double power = 2;
    pt_estimate e[3];
    int k;
    for (k = 0; k < 3; k++) integrate(power_of, &power, 1, 1u << 16, kinds[k], 5, &e[k]);
    pt_check(e[0].standard_error < 0.02 * e[1].standard_error, "Sobol points beat independent ones",
             "%g against %g", e[0].standard_error, e[1].standard_error);
    pt_check(e[2].standard_error < 0.02 * e[1].standard_error, "strata beat independent points",
             "%g against %g", e[2].standard_error, e[1].standard_error);
}

static void estimates_refuse(void)
{
    pt_estimate e;
    double p = 1;
    pt_check(integrate(NULL, &p, 1, 100, PT_SAMPLER_SOBOL, 0, &e) == PT_ERROR_ARGUMENT, "no integrand",
             "accepted");
    pt_check(integrate(power_of, &p, 0, 100, PT_SAMPLER_SOBOL, 0, &e) == PT_ERROR_ARGUMENT, "0 dimensions",
             "accepted");
    pt_check(integrate(power_of, &p, 65, 100, PT_SAMPLER_SOBOL, 0, &e) == PT_ERROR_ARGUMENT, "65 dimensions",
             "accepted");
    pt_check(integrate(power_of, &p, 1, 31, PT_SAMPLER_SOBOL, 0, &e) == PT_ERROR_ARGUMENT, "31 points",
             "accepted");
    pt_check(integrate(power_of, &p, 64, 32, PT_SAMPLER_SOBOL, 0, &e) == PT_OK, "64 dimensions, 32 points",
             "refused");
}

/* The other estimators: their means, and their variances where these are known in closed form. Techniques
   draw from the density (k + 1) x^k. */
static void power_warp(const double *u, double *x, void *user)
{
    x[0] = pow(1 - u[0], 1 / (*(const double *)user + 1));
}
static double power_density(const double *x, void *user)
{
    const double k = *(const double *)user;
    return (k + 1) * pow(x[0], k);
}
static double sum_of_two(const double *u, void *user)
{
    (void)user;
    return u[0] + u[1];
}
static double first(const double *u, void *user)
{
    (void)user;
    return u[0];
}

typedef enum estimator {
    ANTITHETIC,
    ANTITHETIC_ODD,
    IMPORTANCE,
    IMPORTANCE_PERFECT,
    CONTROL,
    BALANCE,
    POWER,
    MAXIMUM,
    ONE_SAMPLE,
    ROULETTE,
    SPLITTING,
    ESTIMATORS
} estimator;

typedef struct estimator_case {
    const char *name;
    double power, exact, variance, calls; /* variance < 0: not known; calls of f for each value */
} estimator_case;

static const estimator_case estimator_cases[ESTIMATORS] = {
    {"antithetic, x^2", 2, 1.0 / 3, 1.0 / 180, 2},
    {"antithetic, x", 1, 1.0 / 2, 0, 2},
    {"importance 2x, x^2", 2, 1.0 / 3, 1.0 / 72, 1},
    {"importance 3x^2, x^2", 2, 1.0 / 3, 0, 1},
    {"control x, x^2", 2, 1.0 / 3, 1.0 / 180, 1},
    {"balance heuristic 1 and 2x, x^2", 2, 1.0 / 3, 0.018721058606716604, 2},
    {"power heuristic 1 and 2x, x^2", 2, 1.0 / 3, 0.018175986775525456, 2},
    {"maximum heuristic 1 and 2x, x^2", 2, 1.0 / 3, -1, 2},
    {"one sample of 1 or 2x, x^2", 2, 1.0 / 3, 0.040885490263979078, 1},
    {"roulette 1/2, x", 1, 1.0 / 2, 2.0 / 3 - 1.0 / 4, 0.5},
    {"splitting, x + 4 times y", 0, 1, 1.0 / 12 + 1.0 / 48, 4}};

static pt_result run_estimator(estimator k, const pt_integral *p, pt_estimate *e)
{
    static const double half[2] = {0.5, 0.5};
    static const int once[2] = {1, 1};
    double none = 0, linear = 1, square = 2;
    pt_technique t[3];
    int i;
    for (i = 0; i < 3; i++) {
        t[i].warp = power_warp;
        t[i].density = power_density;
        t[i].user = i == 0 ? &none : i == 1 ? &linear : &square;
    }
    switch (k) {
    case IMPORTANCE:
        return pt_estimate_importance(p, &t[1], e);
    case IMPORTANCE_PERFECT:
        return pt_estimate_importance(p, &t[2], e);
    case CONTROL:
        return pt_estimate_control(p, first, 0.5, 1, e);
    case BALANCE:
        return pt_estimate_mis(p, t, once, 2, PT_HEURISTIC_BALANCE, e);
    case POWER:
        return pt_estimate_mis(p, t, once, 2, PT_HEURISTIC_POWER, e);
    case MAXIMUM:
        return pt_estimate_mis(p, t, once, 2, PT_HEURISTIC_MAXIMUM, e);
    case ONE_SAMPLE:
        return pt_estimate_mis_one(p, t, half, 2, PT_HEURISTIC_BALANCE, e);
    case ROULETTE:
        return pt_estimate_roulette(p, 0.5, e);
    case SPLITTING:
        return pt_estimate_splitting(p, 1, 4, e);
    default:
        return pt_estimate_antithetic(p, e);
    }
}

static void one_estimator(estimator k, pt_sampler_kind kind, uint64_t seed)
{
    const estimator_case *const c = &estimator_cases[k];
    const int runs = 64;
    double power = c->power, calls = 0;
    pt_integral p = {power_of, NULL, 1, 0, PT_SAMPLER_SOBOL, 0};
    pt_stats value = PT_STATS_INIT, variance = PT_STATS_INIT;
    int i, refused = 0;
    p.f = k == SPLITTING ? sum_of_two : power_of;
    p.user = &power;
    p.dimensions = k == SPLITTING ? 2 : 1;
    p.n = pt_test_samples(16384);
    p.sampler = kind;
    for (i = 0; i < runs; i++) {
        pt_estimate e;
        p.seed = pt_test_seed(seed + (uint64_t)i);
        refused += run_estimator(k, &p, &e) != PT_OK;
        pt_stats_add(&value, e.value);
        pt_stats_add(&variance, e.standard_error * e.standard_error * p.n);
        calls += e.evaluations / p.n / runs;
    }
    pt_check(refused == 0, c->name, "refused");
    pt_check_mean(c->name, &value, c->exact, 1e-12, 0.02, PT_TEST_MEANS, "the estimator is biased");
    pt_check_near(c->name, calls, c->calls, k == ROULETTE ? 0.01 : 0,
                  "calls of the integrand for each value");
    if (kind == PT_SAMPLER_INDEPENDENT && c->variance >= 0)
        pt_check_mean(c->name, &variance, c->variance, 1e-20, 0.05, PT_TEST_MEANS,
                      "not the variance it should have");
}

static void other_estimators(void)
{
    pt_test_source("elementary integrals");
    int k, s;
    for (k = 0; k < ESTIMATORS; k++)
        for (s = 0; s < 3; s++) one_estimator((estimator)k, kinds[s], (uint64_t)(4000 + 100 * (3 * k + s)));
}

static void other_estimators_refuse(void)
{
    static const double shares[2] = {0.5, 0.4};
    static const int none[2] = {0, 0};
    double one = 1;
    const pt_technique t = {power_warp, power_density, &one};
    const pt_technique both[2] = {{power_warp, power_density, &one}, {power_warp, power_density, &one}};
    const pt_integral p = {power_of, &one, 1, 100, PT_SAMPLER_INDEPENDENT, 0};
    const pt_result no = PT_ERROR_ARGUMENT;
    pt_estimate e;
    pt_check(pt_estimate_roulette(&p, 0, &e) == no && pt_estimate_roulette(&p, 1.5, &e) == no, "roulette",
             "q outside (0,1]");
    pt_check(pt_estimate_splitting(&p, 1, 4, &e) == no && pt_estimate_splitting(&p, 0, 4, &e) == no,
             "splitting", "nothing to split");
    pt_check(pt_estimate_importance(&p, NULL, &e) == no, "importance", "no technique");
    pt_check(pt_estimate_mis(&p, both, none, 2, PT_HEURISTIC_POWER, &e) == no, "several techniques",
             "no samples");
    pt_check(pt_estimate_mis_one(&p, both, shares, 2, PT_HEURISTIC_POWER, &e) == no,
             "one of several techniques", "shares that do not add up to 1");
    pt_check(pt_estimate_control(&p, NULL, 0, 1, &e) == no, "control variate", "no control");
    pt_check(pt_estimate_control(&p, first, HUGE_VAL, 1, &e) == no, "control variate", "infinite integral");
    pt_check(pt_estimate_importance(&p, &t, &e) == PT_OK && fabs(e.value - 0.5) < 1e-12 &&
                 e.standard_error < 1e-12,
             "perfect importance sampling", "%g +- %g", e.value, e.standard_error);
}

/* Jittered sampling has exact variances: 1/(12 N^3) for x in N strata, 1/(6 N^2) for x + y in N cells. */
static void jittered_variance(void)
{
    pt_test_source("1/(12 N^3) for x in N strata, 1/(6 N^2) for x + y in N cells");
    static const uint32_t counts[3] = {4, 16, 64};
    const uint32_t sets = pt_test_all_samples(1u << 15);
    int c;
    for (c = 0; c < 3; c++) {
        const uint32_t n = counts[c];
        pt_sampler s = pt_sampler_make(PT_SAMPLER_STRATIFIED, pt_test_seed(50 + (uint64_t)c), n);
        pt_stats line = PT_STATS_INIT, square = PT_STATS_INIT;
        uint32_t set, i;
        for (set = 0; set < sets; set++) {
            double x = 0, xy = 0;
            for (i = 0; i < n; i++) {
                pt_vec2 u;
                pt_sampler_start(&s, set, i);
                x += (double)pt_sampler_1d(&s) - 0.5;
                pt_sampler_seek(&s, 4);
                u = pt_sampler_2d(&s);
                xy += (double)u.x + (double)u.y - 1;
            }
            pt_stats_add(&line, x / n * (x / n));
            pt_stats_add(&square, xy / n * (xy / n));
        }
        /* numbers cut to 24 bits lie 2^-25 too low on average: in the mean of n that is a bias, not noise */
        pt_check_mean("variance of jittered x", &line, 1 / (12.0 * n * n * n), 0x1p-50, 0.15, PT_TEST_VALUES,
                      "one sample a stratum?");
        pt_check_mean("variance of jittered x + y", &square, 1 / (6.0 * n * n), 0x1p-48, 0.15, PT_TEST_VALUES,
                      "one sample a cell?");
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Multiple importance sampling: weights, and the variance of its estimator of the integral of x^p with the
   densities 1 and 2x (Veach and Guibas 1995) */

static void mis_weights(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0;
    for (; file && pt_case_next(file, "mis", &c); rows++) {
        const double p1 = pt_case_number(c.inputs, "p1"), p2 = pt_case_number(c.inputs, "p2");
        near_relative(c.id, pt_mis_weight(p1, p2, PT_HEURISTIC_BALANCE),
                      pt_case_number(c.expected, "balance"), 1e-14);
        near_relative(c.id, pt_mis_weight(p1, p2, PT_HEURISTIC_POWER), pt_case_number(c.expected, "power2"),
                      1e-14);
        if (p1 > 0 || p2 > 0)
            pt_check_near(
                c.id, pt_mis_weight(p1, p2, PT_HEURISTIC_POWER) + pt_mis_weight(p2, p1, PT_HEURISTIC_POWER),
                1, 2e-16, "the weights of both techniques must add up to 1");
    }
    if (file) fclose(file);
    pt_check(rows == 16, "rows of weights", "%d", rows);
}

static void mis_of_powers(void)
{
    pt_test_source("Veach and Guibas 1995: integral of sum of (w f)^2 / p, by quadrature");
    static const double row[3][3] = {/* p, variance with balance, with power heuristic */
                                     {1, 0.011110988148968387, 0.013250220050248314},
                                     {2, 0.018721058606716604, 0.018175986775525456},
                                     {5, 0.017390418966670153, 0.017285759114200087}};
    const uint32_t n = pt_test_samples(1u << 20);
    int i, h;
    for (i = 0; i < 3; i++)
        for (h = 0; h < 2; h++) {
            const pt_heuristic heuristic = h ? PT_HEURISTIC_POWER : PT_HEURISTIC_BALANCE;
            pt_stats value = PT_STATS_INIT, square = PT_STATS_INIT;
            pt_pcg32 rng = pt_pcg32_make(pt_test_seed((uint64_t)(60 + 2 * i + h)), 3);
            const double exact = 1 / (row[i][0] + 1);
            uint32_t k;
            for (k = 0; k < n; k++) {
                const double x = pt_pcg32_double(&rng), y = sqrt(1 - pt_pcg32_double(&rng));
                const double v = pow(x, row[i][0]) * pt_mis_weight(1, 2 * x, heuristic) +
                                 pow(y, row[i][0]) / (2 * y) * pt_mis_weight(2 * y, 1, heuristic);
                pt_stats_add(&value, v);
                pt_stats_add(&square, (v - exact) * (v - exact));
            }
            pt_check_mean("combined estimate of x^p", &value, exact, 0, 0.01, PT_TEST_VALUES,
                          "p^b over the sum of all p^b: weights at a point must sum to 1, and then every b "
                          "has the same mean");
            pt_check_mean("its variance", &square, row[i][1 + h], 0, 0.03, PT_TEST_VALUES,
                          "p^b over the sum of all p^b: weights at a point must sum to 1, and then every b "
                          "has the same mean");
        }
}

/* ---------------------------------------------------------------------------------------------------------
   [PT-05] */

static void solid_angles(void)
{
    FILE *file = pt_cases_open();
    pt_case c;
    int rows = 0;
    for (; file && pt_case_next(file, "cone", &c); rows++)
        near_relative(c.id, pt_solid_angle_cap(pt_case_number(c.inputs, "halfangle_rad")),
                      pt_case_number(c.expected, "omega"), 1e-14);
    if (file) rewind(file);
    for (; file && pt_case_next(file, "tri_omega", &c); rows++) {
        const double exact = pt_case_number(c.expected, "omega");
        const double got =
            pt_solid_angle_triangle(pt_case_vec3(c.inputs, "p"), pt_case_vec3(c.inputs, "v0"),
                                    pt_case_vec3(c.inputs, "v1"), pt_case_vec3(c.inputs, "v2"));
        if (pt_case_has(&c, "soft"))
            pt_check(got >= 0 && got < 4 * PT_PI, c.id, "solid angle %g", got);
        else
            near_relative(c.id, got, exact, pt_case_tolerance(&c, !is_float(), "rel"));
    }
    if (file) rewind(file);
    for (; file && pt_case_next(file, "rect_omega", &c); rows++) {
        pt_spherical_rectangle s;
        const double got =
            pt_spherical_rectangle_make(&s, pt_case_vec3(c.inputs, "o"), pt_case_vec3(c.inputs, "s"),
                                        pt_case_vec3(c.inputs, "ex"), pt_case_vec3(c.inputs, "ey"));
        if (pt_case_has(&c, "soft"))
            pt_check(got >= 0 && got < 2.001 * PT_PI, c.id, "solid angle %g", got);
        else
            near_relative(c.id, got, pt_case_number(c.expected, "omega"),
                          pt_case_tolerance(&c, !is_float(), "rel"));
    }
    if (file) fclose(file);
    pt_check(rows == 40, "rows of solid angles", "%d", rows);
}

/* Van Oosterom and Strackee against Girard's excess, 35 digits. */
static void more_solid_angles(void)
{
    const pt_vec3 o = pt_v3(0, 0, 0);
    near_relative("cap of 120 degrees", pt_solid_angle_cap(2 * PT_PI / 3), 9.4247779607693797, 1e-15);
    near_relative("whole sphere", pt_solid_angle_cap(PT_PI), 4 * PT_PI, 1e-15);
    near_relative("triangle (1,0,1) (0,1,1) (-1,-1,1)",
                  pt_solid_angle_triangle(o, pt_v3(1, 0, 1), pt_v3(0, 1, 1), pt_v3(-1, -1, 1)),
                  1.0471975511965977, 1e-14);
    near_relative(
        "triangle moved with its observer",
        pt_solid_angle_triangle(pt_v3(8, 16, -4), pt_v3(9, 16, -3), pt_v3(8, 17, -3), pt_v3(7, 15, -3)),
        1.0471975511965977, 1e-14);
    pt_check(pt_solid_angle_triangle(o, pt_v3(1, 0, 0), pt_v3(0, 1, 0), pt_v3(-1, -1, 0)) == 0,
             "triangle seen from its plane", "must be 0");
    pt_check(pt_solid_angle_triangle(o, pt_v3(1, 0, 1), pt_v3(2, 0, 2), pt_v3(3, 0, 3)) == 0,
             "triangle without area", "must be 0");
}

static void irradiance_of_simple_lights(void)
{
    static const double disk[3][3] = {
        {1, 1, 1.5707963267948966}, {2, 1, 2.5132741228718345}, {1, 10, 0.031104877758314782}};
    int i;
    near_relative("point light", pt_irradiance_point(100, 2, 0.5), 12.5, 1e-15);
    near_relative("815 lm lamp", pt_irradiance_point(815 / (4 * PT_PI), 1.5, sqrt(0.75)), 24.962947209375584,
                  1e-14);
    pt_check(pt_irradiance_point(100, 2, -0.5) == 0, "point light from behind", "must be 0");
    near_relative("sphere", pt_irradiance_sphere(1, 1, 2, 1), 0.78539816339744831, 1e-15);
    near_relative("sphere aslant", pt_irradiance_sphere(1, 1, 2, cos(PT_PI / 4)), 0.55536036726979578, 1e-15);
    near_relative("small far sphere", pt_irradiance_sphere(1e9, 1e-4, 1, 1), 10 * PT_PI, 1e-14);
    for (i = 0; i < 3; i++)
        near_relative("disk", pt_irradiance_disk(1, disk[i][0], disk[i][1], 0), disk[i][2], 1e-14);
}

typedef struct polygon {
    const char *name;
    double exact; /* receiver at the origin, normal +z, radiance 1 */
    int count;
    double v[5][3];
} polygon;

/* Lambert's formula against Gauss-Legendre quadrature, 17 digits. */
static const polygon polygons[10] = {
    {"square on the axis",
     1.7408395027342064,
     4,
     {{-1, -1, 1}, {1, -1, 1}, {1, 1, 1}, {-1, 1, 1}, {0, 0, 0}}},
    {"square at its corner", 0.4352098756835516, 4, {{0, 0, 1}, {1, 0, 1}, {1, 1, 1}, {0, 1, 1}, {0, 0, 0}}},
    {"triangle", 0.25972937941581595, 3, {{0.5, 0, 1}, {0, 1, 1.5}, {-0.7, -0.2, 2}, {0, 0, 0}, {0, 0, 0}}},
    {"wall on the ground", 0.59732949128392144, 4, {{1, -1, 0}, {1, 1, 0}, {1, 1, 2}, {1, -1, 2}, {0, 0, 0}}},
    {"wall half below the horizon",
     0.35018828771389671,
     4,
     {{1, -1, -1}, {1, 1, -1}, {1, 1, 1}, {1, -1, 1}, {0, 0, 0}}},
    {"triangle through the horizon",
     0.28933394429811124,
     3,
     {{1, 0, -0.5}, {0, 1, 0.5}, {0.5, 1, 2}, {0, 0, 0}, {0, 0, 0}}},
    {"pentagon through the horizon",
     0.061794701321502994,
     5,
     {{2, 0, 0.5}, {1.5, 1, 1}, {1, 1.2, -0.3}, {1, -0.5, -0.6}, {1.5, -0.8, 0.2}}},
    {"unit square at distance 1",
     0.75227468846,
     4,
     {{-0.5, -0.5, 1}, {0.5, -0.5, 1}, {0.5, 0.5, 1}, {-0.5, 0.5, 1}, {0, 0, 0}}},
    {"the same moved by 1",
     0.26500485163,
     4,
     {{0.5, -0.5, 1}, {1.5, -0.5, 1}, {1.5, 0.5, 1}, {0.5, 0.5, 1}, {0, 0, 0}}},
    {"below the horizon", 0, 3, {{1, 0, -1}, {0, 1, -1}, {-1, -1, -1}, {0, 0, 0}, {0, 0, 0}}}};

/* Turned upside down, and moved and turned so that +z becomes +x, the same comes out. */
static void irradiance_of_polygons(void)
{
    int i, k;
    for (i = 0; i < 10; i++) {
        const polygon *const g = &polygons[i];
        /* corners such as 0.7 are rounded to pt_real */
        const double tolerance = (i == 7 || i == 8 ? 2e-9 : 0) + (is_float() ? 1e-6 : 1e-13) * (g->exact + 1);
        pt_vec3 v[5], back[5], moved[5];
        for (k = 0; k < g->count; k++) {
            v[k] = pt_v3((pt_real)g->v[k][0], (pt_real)g->v[k][1], (pt_real)g->v[k][2]);
            back[g->count - 1 - k] = v[k];
            moved[k] = pt_v3(v[k].z + 8, v[k].x - 4, v[k].y + 2);
        }
        pt_check_near(g->name, pt_irradiance_polygon(1, pt_v3(0, 0, 0), pt_v3(0, 0, 1), v, g->count),
                      g->exact, tolerance,
                      "Lambert's sum over edges of angle times cosine of the edge's plane, over 2 pi; is it "
                      "clipped at the horizon?");
        pt_check_near(g->name, pt_irradiance_polygon(1, pt_v3(0, 0, 0), pt_v3(0, 0, 1), back, g->count),
                      g->exact, tolerance, "both sides emit");
        pt_check_near(g->name, pt_irradiance_polygon(2, pt_v3(8, -4, 2), pt_v3(1, 0, 0), moved, g->count),
                      2 * g->exact, 10 * tolerance, "depends on where the origin is");
    }
}

/* Five triangles (vertices from the test scenes of Nori), receiver at the origin, normal +y. */
static void irradiance_of_triangles(void)
{
    static const double light[5][10] = {{-0.443432, 0.596366, 0.495985, -0.320397, 0.0677699, -0.229359,
                                         0.0341197, 0.11415, -0.343049, 0.564476709},
                                        {0.461963, 0.397843, 0.412747, -0.0381582, 0.851323, -0.156872,
                                         0.195443, 0.891957, -0.260672, 0.144010861},
                                        {0.100871, 0.289075, -0.422609, -0.308386, 0.629587, 0.423966,
                                         -0.373132, 0.237287, 0.351592, 0.335644870},
                                        {-0.17575, 0.639397, 0.151268, 0.318604, 0.732996, 0.459771, 0.139095,
                                         0.294498, 0.478556, 0.129002537},
                                        {-0.17487, 0.447916, 0.367201, -0.405259, 0.249607, -0.354079,
                                         0.356029, 0.0918984, -0.132271, 1.644560036}};
    int i, k;
    for (i = 0; i < 5; i++) {
        pt_vec3 v[3];
        for (k = 0; k < 3; k++)
            v[k] =
                pt_v3((pt_real)light[i][3 * k], (pt_real)light[i][3 * k + 1], (pt_real)light[i][3 * k + 2]);
        near_relative("triangle light", pt_irradiance_polygon(1, pt_v3(0, 0, 0), pt_v3(0, 1, 0), v, 3),
                      light[i][9], is_float() ? 2e-6 : 1e-8);
    }
}

static void irradiance_of_rectangles(void)
{
    FILE *const file = pt_cases_open();
    pt_case c;
    int rows = 0, sides;
    for (; file && pt_case_next(file, "rect_ff", &c); rows++) {
        const pt_real a = (pt_real)pt_case_number(c.inputs, "a"), b = (pt_real)pt_case_number(c.inputs, "b"),
                      h = (pt_real)pt_case_number(c.inputs, "h");
        const pt_vec3 v[4] = {pt_v3(0, 0, h), pt_v3(a, 0, h), pt_v3(a, b, h), pt_v3(0, b, h)};
        near_relative(c.id, pt_irradiance_polygon(1, pt_v3(0, 0, 0), pt_v3(0, 0, 1), v, 4),
                      pt_case_number(c.expected, "E_L1"), pt_case_tolerance(&c, !is_float(), "rel"));
    }
    if (file) fclose(file);
    pt_check(rows == 5, "rows of rectangles", "%d", rows);
    /* regular polygons become a disk */
    for (sides = 3; sides <= 32; sides += sides < 6 ? 3 : 26) {
        static const double exact[3] = {0.88421914153520536, 1.419421884832264, 0};
        pt_vec3 v[32];
        int k;
        for (k = 0; k < sides; k++)
            v[k] = pt_v3((pt_real)cos(2 * PT_PI * k / sides), (pt_real)sin(2 * PT_PI * k / sides), 1);
        if (sides <= 6)
            near_relative("regular polygon",
                          pt_irradiance_polygon(1, pt_v3(0, 0, 0), pt_v3(0, 0, 1), v, sides),
                          exact[sides / 3 - 1], is_float() ? 1e-6 : 1e-13);
        else
            near_relative("polygon of 32 sides is nearly a disk",
                          pt_irradiance_polygon(1, pt_v3(0, 0, 0), pt_v3(0, 0, 1), v, sides),
                          pt_irradiance_disk(1, 1, 1, 0), 0.006);
    }
}

static void colour_matching(void)
{
    double sum = 0, xyz[3], white[3] = {0, 0, 0}, y = 0;
    pt_rgbd rgb;
    int nm, k;
    for (nm = 360; nm <= 830; nm++) {
        pt_cie_xyz(nm, xyz);
        sum += xyz[1];
        for (k = 0; k < 3; k++) white[k] += xyz[k] * pt_cie_d65(nm);
    }
    /* CIE 15: sum of the 1 nm table of ybar, and the chromaticity of D65 (0.3127, 0.3290) */
    near_relative("sum of ybar", sum, 106.8569, 2e-6);
    y = white[1];
    for (k = 0; k < 3; k++) white[k] /= y;
    pt_check_near("X of D65", white[0], 0.95047, 1e-5,
                  "X of the illuminant over its Y: xbar and D65 tables, summed at the same wavelengths");
    pt_check_near("Z of D65", white[2], 1.08883, 1e-5,
                  "Z of the illuminant over its Y: zbar and D65 tables, summed at the same wavelengths");
    rgb = pt_xyz_to_rgb(white);
    pt_check(fabs(rgb.r - 1) < 2e-5 && fabs(rgb.g - 1) < 2e-5 && fabs(rgb.b - 1) < 2e-5, "D65 is white",
             "%.7f %.7f %.7f", rgb.r, rgb.g, rgb.b);
    pt_cie_xyz(555, xyz);
    pt_check_near("ybar has its peak 1 at 555 nm", xyz[1], 1, 1e-12,
                  "the 1931 observer: ybar(555 nm) = 1; is the table read one entry off?");
    pt_check_near("D65 at 560 nm", pt_cie_d65(560), 100, 1e-12,
                  "D65 is normalised to 100 at 560 nm; is the table read one entry off?");
    pt_check_near("D65 halfway between two entries", pt_cie_d65(562.5), 0.5 * (100 + pt_cie_d65(565)), 1e-12,
                  "linear");
    pt_cie_xyz(359.9, xyz);
    pt_check(xyz[0] == 0 && xyz[1] == 0 && xyz[2] == 0, "nothing is seen below 360 nm",
             "outside of its table the observer is 0; do not extrapolate");
}

static void spectra(void)
{
    static const double nm[3] = {400, 500, 700}, value[3] = {1, 3, 2};
    pt_spectrum s = {nm, value, 3, 0};
    pt_rgbd one;
    pt_check_near("at a table entry", pt_spectrum_at(&s, 500), 3, 1e-15,
                  "at a wavelength of the table, interpolation must give the entry itself");
    pt_check_near("between two entries", pt_spectrum_at(&s, 650), 2.25, 1e-14, "linear");
    pt_check(pt_spectrum_at(&s, 300) == 1 && pt_spectrum_at(&s, 800) == 2, "outside", "the end values go on");
    pt_check(pt_spectrum_at(&s, 400) == 1 && pt_spectrum_at(&s, 700) == 2, "at the ends", "the end values");
    s.zero_outside = 1;
    pt_check(pt_spectrum_at(&s, 399) == 0 && pt_spectrum_at(&s, 701) == 0, "outside", "nothing");
    pt_check(pt_spectrum_at(&s, 400) == 1, "at the first entry", "its value");
    s.nm = nm;
    s.value = &nm[0];
    s.count = 1;
    s.zero_outside = 0;
    one = pt_reflectance_to_rgb(&s); /* the constant 400 */
    pt_check(fabs(one.r / 400 - 1) < 2e-5 && fabs(one.g / 400 - 1) < 2e-5 && fabs(one.b / 400 - 1) < 2e-5,
             "a grey spectrum is grey", "%.7f %.7f %.7f", one.r / 400, one.g / 400, one.b / 400);
}

static void near_rgb(const char *name, double r, double g, double b, const double exact[3],
                     double relative_tolerance)
{
    const double largest = fmax(exact[0], fmax(exact[1], exact[2])), t = relative_tolerance * largest;
    pt_check(fabs(r - exact[0]) <= t && fabs(g - exact[1]) <= t && fabs(b - exact[2]) <= t, name,
             "%.6f %.6f %.6f should be %.6f %.6f %.6f", r, g, b, exact[0], exact[1], exact[2]);
}

/* White, green, red of the box (tests/data/cornell_reflectance_4nm.csv) to RGB; expected values from the CIE
   1 nm tables and the full-precision matrix. */
static void cornell_colours(void)
{
    static const char *const names[3] = {"white", "green", "red"};
    static const double rgb[3][3] = {
        {0.738259, 0.735978, 0.738681}, {0.068418, 0.398456, 0.086567}, {0.493887, 0.048868, 0.051164}};
    static const double lamp_nm[4] = {400, 500, 600, 700}, lamp[4] = {0, 8, 15.6, 18.4};
    static const double lamp_rgb[3] = {20.711595, 10.855119, 2.770784};
    FILE *const file = fopen("tests/data/cornell_reflectance_4nm.csv", "r");
    double nm[80], value[3][80];
    char line[256];
    int count = 0, k;
    pt_spectrum s = {lamp_nm, lamp, 4, 1};
    pt_rgbd c = pt_emission_to_rgb(&s);
    near_rgb("lamp of the box", c.r, c.g, c.b, lamp_rgb, 1e-4);
    while (file && fgets(line, sizeof line, file))
        if (count < 80 && sscanf(line, "%lf,%lf,%lf,%lf", &nm[count], &value[0][count], &value[1][count],
                                 &value[2][count]) == 4)
            count++;
    if (file) fclose(file);
    pt_check(count == 76, "rows of reflectances", "%d in tests/data/cornell_reflectance_4nm.csv", count);
    for (k = 0; k < 3 && count == 76; k++) {
        const pt_spectrum wall = {nm, value[k], 76, 0};
        c = pt_reflectance_to_rgb(&wall);
        near_rgb(names[k], c.r, c.g, c.b, rgb[k], 1e-4);
#if PTI_HAS_SCENES
        {
            const pt_spectrum own = pt_cornell_spectrum(names[k]);
            const pt_rgb band = pt_cornell_rgb(names[k]);
            int i, same = own.count >= 2;
            for (i = 0; i < 76; i++) same &= fabs(pt_spectrum_at(&own, nm[i]) - value[k][i]) < 1e-12;
            pt_check(same, names[k], "pt_cornell_spectrum differs from the measured table");
            near_rgb(names[k], (double)band.r, (double)band.g, (double)band.b, rgb[k], 1e-4);
        }
#endif
    }
#if PTI_HAS_SCENES
    {
        const pt_rgb band = pt_cornell_rgb("lamp");
        near_rgb("lamp of pt_cornell_rgb", (double)band.r, (double)band.g, (double)band.b, lamp_rgb, 1e-4);
    }
#endif
}

/* ---------------------------------------------------------------------------------------------------------
   [PT-17] */

#if PTI_HAS_FILES

#define PICTURE "build/test_numbers.picture"

/* Reads a whole file; -1 if it cannot be opened. */
static long slurp(const char *path, unsigned char *bytes, long size)
{
    FILE *const file = fopen(path, "rb");
    long n;
    if (!file) return -1;
    n = (long)fread(bytes, 1, (size_t)size, file);
    fclose(file);
    return n;
}

/* The first data byte is 10, which a reader must not take for white space; bytes above 127 and 13 too. */
static const unsigned char pixels[12] = {10, 13, 32, 255, 0, 128, 26, 1, 2, 3, 4, 5};

static void ppm(void)
{
    unsigned char bytes[64];
    const pt_result r = pt_write_ppm_bytes(PICTURE, pixels, 2, 2);
    const long n = slurp(PICTURE, bytes, 64);
    pt_check(r == PT_OK && n == 11 + 12 && memcmp(bytes, "P6\n2 2\n255\n", 11) == 0, "PPM header",
             "result %d, %ld bytes (is there a directory build?)", (int)r, n);
    pt_check(n == 23 && memcmp(bytes + 11, pixels, 12) == 0, "PPM data",
             "rows from the top, three bytes a pixel");
    remove(PICTURE);
}

static void pfm(void)
{
    static const float values[12] = {0, 1, 2, 3, 4, 5, -2, 1.5f, 0.1f, 1e-45f, 3e38f, -0.0f};
    unsigned char bytes[80];
    const pt_result r = pt_write_pfm_floats(PICTURE, values, 1, 4);
    const long n = slurp(PICTURE, bytes, 80);
    int row, i, same = 1;
    pt_check(r == PT_OK && n == 12 + 48 && memcmp(bytes, "PF\n1 4\n-1.0\n", 12) == 0, "PFM header",
             "result %d, %ld bytes", (int)r, n);
    for (row = 0; row < 4 && n == 60; row++)
        for (i = 0; i < 3; i++) {
            const unsigned char *const b =
                bytes + 12 + 12 * (3 - row) + 4 * i; /* from the bottom, little-endian */
            const uint32_t got =
                (uint32_t)b[0] | (uint32_t)b[1] << 8 | (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
            uint32_t want;
            memcpy(&want, &values[3 * row + i], 4);
            same &= got == want;
        }
    pt_check(same, "PFM data", "rows from the bottom, little-endian floats");
    remove(PICTURE);
}

static uint32_t big_endian(const unsigned char *b)
{
    return (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
}

/* CRC-32 of ISO 3309, bit by bit. */
static uint32_t crc32(const unsigned char *b, uint32_t n)
{
    uint32_t crc = 0xffffffffu;
    int k;
    for (; n > 0; n--) {
        crc ^= *b++;
        for (k = 0; k < 8; k++) crc = (crc >> 1) ^ (crc & 1 ? 0xedb88320u : 0);
    }
    return ~crc;
}

/* Walks the chunks; collects IDAT; 0 if a check sum or the order is wrong. */
static uint32_t png_chunks(const unsigned char *bytes, uint32_t n, unsigned char *data, unsigned *width,
                           unsigned *height)
{
    uint32_t at = 8, size = 0, last = 0;
    while (at + 12 <= n && !last) {
        const uint32_t length = big_endian(bytes + at);
        const unsigned char *const type = bytes + at + 4;
        if (at + 12 + length > n || crc32(type, length + 4) != big_endian(type + 4 + length)) return 0;
        if (memcmp(type, "IHDR", 4) == 0) {
            *width = big_endian(type + 4);
            *height = big_endian(type + 8);
            if (at != 8 || length != 13 || memcmp(type + 12, "\10\2\0\0\0", 5) != 0) return 0;
        }
        if (memcmp(type, "IDAT", 4) == 0) {
            memcpy(data + size, type + 4, length);
            size += length;
        }
        last = memcmp(type, "IEND", 4) == 0;
        at += 12 + length;
    }
    return last && at == n ? size : 0;
}

/* A reader of zlib streams as [RFC 1950, 1951] define them, stored blocks and fixed codes only. */
typedef struct bits {
    const unsigned char *data;
    uint32_t size, at; /* at: in bits */
} bits;

static uint32_t take(bits *b, int count)
{
    uint32_t value = 0;
    int i;
    for (i = 0; i < count; i++, b->at++)
        if (b->at / 8 < b->size) value |= (uint32_t)(b->data[b->at / 8] >> (b->at % 8) & 1) << i;
    return value;
}

/* Huffman codes come with their first bit first. */
static uint32_t take_code(bits *b, int count, uint32_t code)
{
    for (; count > 0; count--) code = code << 1 | take(b, 1);
    return code;
}

/* Literals and lengths: 7 bits 0000000.. are 256 to 279, 8 bits 00110000.. 0 to 143, 8 bits 11000000.. 280 to
   287, 9 bits 110010000.. 144 to 255. */
static uint32_t take_symbol(bits *b)
{
    uint32_t code = take_code(b, 7, 0);
    if (code < 24) return 256 + code;
    code = take_code(b, 1, code);
    if (code < 192) return code - 48;
    if (code < 200) return 280 + code - 192;
    return 144 + take_code(b, 1, code) - 400;
}

/* Copies what stood `distance` bytes back; 0 if there is nothing, or no room. */
static int repeat(bits *b, uint32_t symbol, unsigned char *out, uint32_t *size, uint32_t room)
{
    static const unsigned short first[29] = {3,  4,  5,  6,  7,  8,  9,  10, 11,  13,  15,  17,  19,  23, 27,
                                             31, 35, 43, 51, 59, 67, 83, 99, 115, 131, 163, 195, 227, 258};
    static const unsigned short far[30] = {1,    2,    3,    4,    5,    7,    9,    13,    17,    25,
                                           33,   49,   65,   97,   129,  193,  257,  385,   513,   769,
                                           1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577};
    const uint32_t k = symbol - 257;
    uint32_t length, code, distance;
    if (k > 28) return 0;
    length = first[k] + (k >= 8 && k < 28 ? take(b, (int)(k - 4) / 4) : 0);
    code = take_code(b, 5, 0);
    if (code > 29) return 0;
    distance = far[code] + (code >= 4 ? take(b, (int)(code - 2) / 2) : 0);
    if (distance > *size || length > room - *size) return 0;
    for (; length > 0; length--, (*size)++) out[*size] = out[*size - distance];
    return 1;
}

static int stored_block(bits *b, unsigned char *out, uint32_t *size, uint32_t room)
{
    uint32_t length, i;
    b->at = (b->at + 7) / 8 * 8;
    length = take(b, 16);
    if ((take(b, 16) ^ length) != 0xffff || length > room - *size) return 0;
    for (i = 0; i < length; i++) out[(*size)++] = (unsigned char)take(b, 8);
    return 1;
}

static int fixed_block(bits *b, unsigned char *out, uint32_t *size, uint32_t room)
{
    while (b->at / 8 < b->size) {
        const uint32_t symbol = take_symbol(b);
        if (symbol == 256) return 1;
        if (symbol < 256 && *size < room)
            out[(*size)++] = (unsigned char)symbol;
        else if (!repeat(b, symbol, out, size, room))
            return 0;
    }
    return 0;
}

/* How many bytes a zlib stream holds; 0 if it is not whole, or its Adler sum is wrong. */
static uint32_t inflate(const unsigned char *data, uint32_t n, unsigned char *out, uint32_t room)
{
    bits b = {data, n, 16};
    uint32_t size = 0, low = 1, high = 0, last = 0, kind, i;
    if (n < 6 || (data[0] & 15) != 8 || (data[0] * 256 + data[1]) % 31 != 0) return 0;
    while (!last) {
        last = take(&b, 1);
        kind = take(&b, 2);
        if (kind > 1 || !(kind == 0 ? stored_block : fixed_block)(&b, out, &size, room)) return 0;
    }
    for (i = 0; i < size; i++) {
        low = (low + out[i]) % 65521;
        high = (high + low) % 65521;
    }
    i = (b.at + 7) / 8;
    return i + 4 == n && big_endian(data + i) == (high << 16 | low) ? size : 0;
}

/* Undoes the row filters of PNG (none, sub, up, average, Paeth) in place; 0 if there is no such filter. */
static int unfilter(unsigned char *raw, int height, int row)
{
    int y, x;
    for (y = 0; y < height; y++) {
        unsigned char *const line = raw + (long)y * row;
        for (x = 1; x < row; x++) {
            const int a = x > 3 ? line[x - 3] : 0, b = y > 0 ? line[x - row] : 0,
                      c = x > 3 && y > 0 ? line[x - 3 - row] : 0, pa = abs(b - c), pb = abs(a - c),
                      pc = abs(a + b - 2 * c);
            const int guess[5] = {0, a, b, (a + b) / 2, pa <= pb && pa <= pc ? a : pb <= pc ? b : c};
            if (line[0] > 4) return 0;
            line[x] = (unsigned char)(line[x] + guess[line[0]]);
        }
    }
    return 1;
}

static void one_png(unsigned width, unsigned height)
{
    const uint32_t row = 1 + 3 * width, raw = row * height;
    const uint32_t room = raw + raw / 8 + 4096;
    unsigned char *const rgb = (unsigned char *)malloc(3 * (size_t)width * height),
                         *const file = (unsigned char *)malloc(room),
                         *const data = (unsigned char *)malloc(room),
                         *const out = (unsigned char *)malloc(room);
    unsigned w = 0, h = 0;
    uint32_t i, size = 0, n;
    int same = rgb && file && data && out;
    if (same) {
        for (i = 0; i < 3 * width * height; i++) rgb[i] = (unsigned char)(i / 64 % 3 ? i * 7 + i / 251 : 9);
        same = pt_write_png_bytes(PICTURE, rgb, (int)width, (int)height) == PT_OK;
        n = (uint32_t)slurp(PICTURE, file, (long)room);
        same = same && n < room && memcmp(file, "\211PNG\r\n\032\n", 8) == 0;
        pt_check(same, "PNG signature", "%u x %u", width, height);
        if (same) size = png_chunks(file, n, data, &w, &h);
        pt_check(size > 0 && w == width && h == height, "PNG chunks", "%u x %u: check sums, order, size",
                 width, height);
        if (size > 0) size = inflate(data, size, out, room);
        pt_check(size == raw, "PNG data", "%u x %u: %u bytes of %u", width, height, size, raw);
        same = size == raw && unfilter(out, (int)height, (int)row);
        for (i = 0; i < height && same; i++)
            same &= memcmp(out + i * row + 1, rgb + 3 * width * i, 3 * width) == 0;
        pt_check(same, "PNG rows", "%u x %u: rows from the top, each behind its filter byte", width, height);
        remove(PICTURE);
    }
    free(rgb);
    free(file);
    free(data);
    free(out);
}

static void png(void)
{
    one_png(1, 1);
    one_png(3, 2);
    one_png(300, 100);
    one_png(1, 700); /* a long column */
}

static void films_to_files(void)
{
    pt_film film = PT_FILM_INIT;
    unsigned char bytes[64];
    pt_check(pt_film_make(&film, 2, 1, 0) == PT_OK, "a small film", "not made");
    film.samples[0] = 1;
    film.half[0][0] = 0.5;
    film.half[0][1] = -1;
    film.half[0][2] = 2;
    film.half[0][3] = 0.18 / 2;
    pt_check(pt_write_ppm(PICTURE, &film, 2) == PT_OK && slurp(PICTURE, bytes, 64) == 17, "film to PPM",
             "not written");
    pt_check(bytes[11] == 255 && bytes[12] == 0 && bytes[13] == 255 && bytes[14] == 118 && bytes[15] == 0,
             "film to PPM", "exposure 2, sRGB, clipped: %d %d %d %d", bytes[11], bytes[12], bytes[13],
             bytes[14]);
    pt_check(pt_write_pfm(PICTURE, &film) == PT_OK && slurp(PICTURE, bytes, 64) == 12 + 24, "film to PFM",
             "not written");
    pt_check(memcmp(bytes + 12, "\0\0\0\77", 4) == 0 && memcmp(bytes + 16, "\0\0\200\277", 4) == 0,
             "film to PFM", "linear values without exposure");
    pt_check(pt_write_png(PICTURE, &film, 1) == PT_OK, "film to PNG", "not written");
    remove(PICTURE);
    pt_film_free(&film);
}

static void bad_paths(void)
{
    unsigned char bytes[4];
    const char *const path = "build/no such directory/x.ppm";
    pt_check(pt_write_ppm_bytes(path, pixels, 2, 2) == PT_ERROR_FILE, "unwritable PPM",
             "must be PT_ERROR_FILE");
    pt_check(pt_write_png_bytes(path, pixels, 2, 2) == PT_ERROR_FILE, "unwritable PNG",
             "must be PT_ERROR_FILE");
    pt_check(slurp(path, bytes, 4) < 0, "nothing is left under the name", "there is a file");
    pt_check(pt_write_ppm_bytes(PICTURE, pixels, 0, 2) == PT_ERROR_ARGUMENT, "width 0", "must be refused");
    pt_check(pt_write_png_bytes(PICTURE, pixels, 2, -1) == PT_ERROR_ARGUMENT, "height -1", "must be refused");
    pt_check(slurp(PICTURE, bytes, 4) < 0, "nothing is written for a refused picture", "there is a file");
}

#endif /* PTI_HAS_FILES */

/* ---------------------------------------------------------------------------------------------------------
   The harness itself: does it find what it should? */

static void harness(void)
{
    pt_test_source("mean 1/2 of uniform numbers; a fair coin");
    pt_stats s = PT_STATS_INIT, other = PT_STATS_INIT;
    pt_pcg32 rng = pt_pcg32_make(pt_test_seed(90), 9);
    const uint32_t n = pt_test_samples(1u << 16);
    double counts[2] = {0, 0}, fair[2], unfair[2];
    uint32_t i;
    for (i = 0; i < n; i++) {
        const double u = pt_pcg32_double(&rng);
        pt_stats_add(&s, u);
        pt_stats_add(&other, pt_pcg32_double(&rng));
        counts[u < 0.5]++;
    }
    fair[0] = fair[1] = 0.5 * n;
    unfair[0] = n * 0.55;
    unfair[1] = n * 0.45;
    pt_check_mean("mean of u", &s, 0.5, 0, 0.05, PT_TEST_VALUES,
                  "(x - exact) / se of a uniform mean: pt_test_judge_mean");
    pt_check_rejects_mean("mean of u is not 0.54", &s, 0.54, 0, PT_TEST_VALUES,
                          "0.04 is dozens of standard errors: the harness must see it");
    pt_check_mean("0.6 +- 0.1 would do", &s, 0.6, 0.1, 0, PT_TEST_VALUES,
                  "the error of the exact value must enter the standard error");
    pt_check_equal_means("two means of u", &s, &other, 0.05,
                         "variances of the two means add: pt_check_equal_means");
    pt_check_chi2("fair coin", counts, fair, 2,
                  "sum of (observed - expected)^2 / expected, cells less one degrees of freedom");
    pt_check_rejects_chi2("unfair coin", counts, unfair, 2,
                          "a coin that is not fair must be noticed: pt_test_judge_chi2");
}

int main(int argc, char **argv)
{
    pt_test_begin("test_numbers", argc, argv);
    PT_TEST_EXACT(clocks);
    PT_TEST_EXACT(results_have_sentences);
    PT_TEST_EXACT(normalize);
    PT_TEST_EXACT(frames);
    PT_TEST_EXACT(srgb);
    PT_TEST_EXACT(pcg32);
    PT_TEST_EXACT(unit_interval);
    PT_TEST_EXACT(sobol_points);
    PT_TEST_EXACT(sobol_nets);
    PT_TEST_EXACT(owen_values);
    PT_TEST(owen_uniform);
    PT_TEST(avalanche);
    PT_TEST(pcg32_uniform);
    PT_TEST_EXACT(any_order);
    PT_TEST_EXACT(seeds_and_streams_differ);
    PT_TEST_EXACT(given_numbers);
    PT_TEST_EXACT(strata);
    PT_TEST(uniform_over_seeds);
    PT_TEST(independence);
    PT_TEST_EXACT(moments);
    PT_TEST_EXACT(merging);
    PT_TEST_EXACT(variance_far_from_zero);
    PT_TEST_EXACT(normal_tail);
    PT_TEST_EXACT(student_tail);
    PT_TEST_EXACT(chi2_tail);
    PT_TEST(estimates);
    PT_TEST_EXACT(spread_points_pay);
    PT_TEST_EXACT(estimates_refuse);
    PT_TEST(other_estimators);
    PT_TEST_EXACT(other_estimators_refuse);
    PT_TEST(jittered_variance);
    PT_TEST_EXACT(mis_weights);
    PT_TEST(mis_of_powers);
    PT_TEST_EXACT(solid_angles);
    PT_TEST_EXACT(more_solid_angles);
    PT_TEST_EXACT(irradiance_of_simple_lights);
    PT_TEST_EXACT(irradiance_of_polygons);
    PT_TEST_EXACT(irradiance_of_triangles);
    PT_TEST_EXACT(irradiance_of_rectangles);
    PT_TEST_EXACT(colour_matching);
    PT_TEST_EXACT(spectra);
    PT_TEST_EXACT(cornell_colours);
#if PTI_HAS_FILES
    PT_TEST_EXACT(ppm);
    PT_TEST_EXACT(pfm);
    PT_TEST_EXACT(png);
    PT_TEST_EXACT(films_to_files);
    PT_TEST_EXACT(bad_paths);
#endif
    PT_TEST(harness);
    return pt_test_end();
}
