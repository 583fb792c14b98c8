/* test_lights.c: spot, sun and sky; how they are added; pixel filters; canonical scenes [PT-05, PT-09, PT-10, PT-19].

       cc -O2 -ffp-contract=off -I. tests/test_lights.c -o test_lights -lm -pthread && ./test_lights

   Exact values are closed forms worked out at the line. Arguments choose functions: ./test_lights spot sky. */

#include "pt_test.h"

/* ---- helpers ---------------------------------------------------------------------------------------- */

static double dbl(pt_real x) { return (double)x; }
static pt_rgb grey(double v) { return pt_rgb_grey((pt_real)v); }
static pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }
static double dot3(pt_vec3 a, pt_vec3 b)
{
    return dbl(a.x) * dbl(b.x) + dbl(a.y) * dbl(b.y) + dbl(a.z) * dbl(b.z);
}
static double unit_roundoff(void) { return sizeof(pt_real) == sizeof(float) ? 0x1p-24 : 0x1p-53; }
static double degrees(double x) { return x * PT_PI / 180; }

static pt_pcg32 generator(uint64_t k) { return pt_pcg32_make(pt_test_seed(k), k); }
static pt_vec2 pair(pt_pcg32 *rng)
{
    const pt_real x = pt_real_from_u32(pt_pcg32_next(rng));
    return pt_v2(x, pt_real_from_u32(pt_pcg32_next(rng)));
}

static int cell(double x, int n)
{
    const int i = (int)(x * n);
    return i < 0 ? 0 : i < n ? i : n - 1;
}

static pt_scene committed(pt_scene scene)
{
    const pt_result result = pt_commit(&scene);
    if (result != PT_OK) pt_check(0, "pt_commit", "%s", pt_scene_error(&scene));
    return scene;
}

/* A floor of 10 m x 10 m at y = 0 that looks up; albedo 1/2. */
static int add_floor(pt_scene *scene)
{
    const int m = pt_add_material(scene, pt_material_diffuse(grey(0.5)));
    pt_add_parallelogram(scene, v3(-5, 0, -5), v3(0, 0, 10), v3(10, 0, 0), m);
    return m;
}

static pt_ray ray_from(pt_vec3 o, pt_vec3 d)
{
    pt_ray r;
    r.o = o;
    r.d = pt_v3_normalize(d);
    r.tmax = (pt_real)HUGE_VAL;
    return r;
}

/* One path of two edges (direct light) that starts at o towards d. */
static pt_rgbd direct_light(const pt_scene *scene, pt_li_fn li, pt_vec3 o, pt_vec3 d, uint64_t seed,
                            uint32_t sample)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(seed), 0);
    const pt_ray ray = ray_from(o, d);
    pt_li_options options;
    pt_li_info info;
    memset(&options, 0, sizeof options);
    memset(&info, 0, sizeof info);
    options.max_edges = 2;
    pt_sampler_start(&sampler, 0, sample);
    return li(scene, &ray, &sampler, &options, &info);
}

/* What the floor shows at (x,0,z): with delta lights alone it has no noise. */
static double floor_radiance(const pt_scene *scene, double x, double z)
{
    return direct_light(scene, pt_li_path, v3(x, 0.01, z), v3(0, -1, 0), 1, 0).r;
}

/* ---- spot lights ------------------------------------------------------------------------------------ */

/* A smoothstep in the cosine: 1 within the first angle, 0 beyond the second. */
static double falloff_by_hand(double angle, double start, double end)
{
    const double t = (cos(angle) - cos(end)) / (cos(start) - cos(end));
    return t <= 0 ? 0 : t >= 1 ? 1 : t * t * (3 - 2 * t);
}

/* Intensity falloff(angle) I, and I / d^2 across the direction; what the rounding of a unit vector of pt_real does
   to the cosine, 4 u, the slope 1.5 / (cos start - cos end) passes on. */
static void spot_irradiance(void)
{
    static const double angle[9] = {0, 10, 19.99, 22, 25, 27.5, 31, 34.9, 35.5}, distance[3] = {0.5, 2, 1000};
    const double start = degrees(20), end = degrees(35), I = 40;
    const pt_vec3 at = v3(1, 3, -2), axis = pt_v3_normalize(v3(1, -2, 2));
    const pt_frame frame = pt_frame_from_normal(axis);
    const double slack = 8 * unit_roundoff() * (1 + 1.5 / (cos(start) - cos(end)));
    pt_scene scene = PT_SCENE_INIT;
    int i, k, turn;
    pt_add_spot_light(&scene, at, v3(10, -20, 20), pt_rgb3((pt_real)I, (pt_real)(I / 2), 0), 20, 35);
    scene = committed(scene);
    for (i = 0; i < 9; i++)
        for (k = 0; k < 3; k++)
            for (turn = 0; turn < 4; turn++) {
                const double a = degrees(angle[i]), phi = 1 + 1.6 * turn;
                const pt_vec3 w = pt_frame_to_world(&frame, v3(sin(a) * cos(phi), sin(a) * sin(phi), cos(a)));
                const pt_vec3 p = pt_v3_add(at, pt_v3_scale(w, (pt_real)distance[k]));
                const double exact = falloff_by_hand(a, start, end) * I / (distance[k] * distance[k]);
                pt_light_sample_result s;
                const int lit = pt_light_sample(&scene, 0, p, pt_v2(0, 0), &s);
                const double got = lit ? dbl(s.radiance.r) : 0, most = I / (distance[k] * distance[k]);
                const double far =
                    16 * unit_roundoff() * 4 / distance[k]; /* p is rounded: its angle and its distance */
                pt_check(fabs(got - exact) <= (slack + far) * most,
                         label("spot, %g degrees, %g m", angle[i], distance[k]),
                         "got %.9g, exact %.9g: intensity times falloff over d^2", got, exact);
                pt_check(lit == (exact > 0) &&
                             (!lit || (s.delta && !s.infinite && s.pdf_w == 1 && dot3(s.wi, w) < -0.999)),
                         "sample of a spot light", "is not that of a point light, or shines beyond its rim");
                pt_check(!lit ||
                             (fabs(dbl(s.radiance.g) - 0.5 * got) <= 1e-6 * got && dbl(s.radiance.b) == 0),
                         "colour of a spot light", "falloff must scale all bands");
            }
    pt_check_near("falloff half way in the cosine",
                  pt_spot_falloff(0.5 * (cos(start) + cos(end)), cos(start), cos(end)), 0.5, 1e-12,
                  "a smoothstep in the cosine is 1/2 in the middle");
    pt_check(pt_light_pdf_w(&scene, 0, v3(0, 0, 0), axis, NULL) == 0, "spot light", "a ray cannot hit it");
    pt_scene_free(&scene);
}

/* Straight down on a floor: rho / pi I falloff cos / d^2 = rho / pi I falloff h / d^3; a plate between casts a shadow. */
static void spot_on_floor(void)
{
    static const double x[6] = {0, 0.5, 1, 1.3, 2, 2.5};
    pt_scene scene = PT_SCENE_INIT;
    int i;
    add_floor(&scene);
    pt_add_spot_light(&scene, v3(0, 2, 0), v3(0, -1, 0), grey(10), 20, 50);
    scene = committed(scene);
    for (i = 0; i < 6; i++) {
        const double d = sqrt(4 + x[i] * x[i]), f = falloff_by_hand(atan2(x[i], 2), degrees(20), degrees(50));
        pt_check_near(label("floor under a spot, %g m aside", x[i]), floor_radiance(&scene, x[i], 0),
                      0.5 / PT_PI * 10 * f * 2 / (d * d * d), 64 * unit_roundoff(),
                      "path tracing must use the spot's intensity in the direction of the point");
    }
    pt_add_parallelogram(&scene, v3(-0.2, 1, -0.2), v3(0.4, 0, 0), v3(0, 0, 0.4), 0);
    scene = committed(scene);
    pt_check(floor_radiance(&scene, 0.3, 0) == 0 && floor_radiance(&scene, 0.5, 0) > 0,
             "shadow of a spot light", "the shadow of a plate half way up is twice as wide");
    pt_scene_free(&scene);
}

/* Emitted rays: uniform in the cone, each with density 1 / (2 pi (1 - cos end)); the mean of I / pdf is the flux. */
static void spot_power(void)
{
    static const double rim[6][2] = {{20, 35}, {0, 180}, {0, 5}, {60, 120}, {0.5, 1}, {0.01, 0.02}};
    const uint32_t n = pt_test_samples(100000);
    int k;
    for (k = 0; k < 6; k++) {
        const double cs = cos(degrees(rim[k][0])), ce = cos(degrees(rim[k][1]));
        const double density = 1 / pt_solid_angle_cap(degrees(rim[k][1]));
        const pt_vec3 axis = pt_v3_normalize(v3(-1, 2, 0.5));
        const pt_frame frame = pt_frame_from_normal(axis);
        pt_scene scene = PT_SCENE_INIT;
        pt_pcg32 rng = generator((uint64_t)(10 + k));
        pt_stats flux = PT_STATS_INIT;
        double counts[64] = {0}, expected[64], pdf_a, pdf_w;
        int i, off = 0;
        pt_add_spot_light(&scene, v3(1, 2, 3), axis, grey(3), rim[k][0], rim[k][1]);
        scene = committed(scene);
        for (i = 0; i < (int)n; i++) {
            const pt_vec2 u = pair(&rng), v = pair(&rng);
            pt_light_emission_result s;
            const int made = pt_light_sample_le(&scene, 0, u, v, 0, &s);
            const double c = made ? dot3(s.w, axis) : 1, omc = (1 - c) / (1 - ce);
            const pt_vec3 local = pt_frame_to_local(&frame, made ? s.w : axis);
            pt_stats_add(&flux, made ? dbl(s.radiance.g) / (s.pdf_a * s.pdf_w) : 0);
            off += made && (s.pdf_a != 1 || fabs(s.pdf_w - density) > 1e-6 * density || dot3(s.n, s.n) > 0 ||
                            s.cos_n != 1 || dbl(s.p.y) != 2);
            if (k < 4)
                counts[cell(omc, 8) * 8 + cell(0.5 + atan2(dbl(local.y), dbl(local.x)) / (2 * PT_PI), 8)]++;
        }
        for (i = 0; i < 64; i++) expected[i] = n / 64.0;
        pt_check(off == 0, label("spot %g-%g degrees", rim[k][0], rim[k][1]),
                 "%d of %u rays: density or origin", off, n);
        if (k < 4)
            pt_check_chi2(label("directions of spot %g-%g", rim[k][0], rim[k][1]), counts, expected, 64,
                          "rays must fill the cone uniformly");
        pt_check_mean(label("power of spot %g-%g", rim[k][0], rim[k][1]), &flux, pt_flux_spot(3, cs, ce),
                      (1e-5 + 8 * pt_gamma(1) / degrees(rim[k][1])) * pt_flux_spot(3, cs, ce), 0.02, PT_TEST_VALUES,
                      "intensity over density must be the flux of the falloff");
        pt_light_pdf_le(
            &scene, 0, v3(0, 0, 0),
            pt_frame_to_world(&frame, v3(sin(degrees(0.9 * rim[k][1])), 0, cos(degrees(0.9 * rim[k][1])))),
            &pdf_a, &pdf_w);
        pt_check(pdf_a == 1 && fabs(pdf_w / density - 1) < 1e-6, "density within the cone", "%g, not %g",
                 pdf_w, density);
        if (k != 1) {
            pt_light_pdf_le(&scene, 0, v3(0, 0, 0),
                            pt_frame_to_world(
                                &frame, v3(sin(degrees(1.1 * rim[k][1])), 0, cos(degrees(1.1 * rim[k][1])))),
                            &pdf_a, &pdf_w);
            pt_check(pdf_w == 0, "density beyond the cone", "%g, not 0", pdf_w);
        }
        pt_scene_free(&scene);
    }
}

/* Chosen by power: pi r^2 E and 4 pi^2 r^2 L enter the sphere around the scene, here of radius sqrt(50) (the floor). */
static void choice_of_new_lights(void)
{
    static const float sky[6] = {0, 0, 0, 2, 2, 2};
    pt_scene scene = PT_SCENE_INIT;
    double power[3] = {0, PT_PI * 50 * 2, 4 * PT_PI * PT_PI * 50}, sum;
    uint32_t i;
    int kind;
    power[0] = pt_flux_spot(700, cos(degrees(30)), cos(degrees(60)));
    sum = power[0] + power[1] + power[2];
    add_floor(&scene);
    pt_add_spot_light(&scene, v3(0, 1, 0), v3(0, 0, 1), grey(700), 30, 60);
    pt_add_directional_light(&scene, v3(0, -1, 0), grey(2));
    pt_set_environment_image(&scene, sky, 2, 1, 1);
    scene = committed(scene);
    pt_check(scene.light_count == 3, "three lights", "%u lights", (unsigned)scene.light_count);
    for (i = 0; i < scene.light_count; i++) {
        kind = scene.lights[i].kind == PT_LIGHT_SPOT          ? 0
               : scene.lights[i].kind == PT_LIGHT_DIRECTIONAL ? 1
                                                              : 2;
        pt_check_near(label("share of light %d", kind), scene.lights[i].pmf, power[kind] / sum, 1e-5,
                      "pti_light_power: a spot's flux, pi r^2 E of a sun, 4 pi^2 r^2 mean L of a sky");
    }
    pt_scene_free(&scene);
}

/* ---- parallel light --------------------------------------------------------------------------------- */

/* E cos on a floor, the same everywhere and without noise; a ball casts the shadow of its projection along the light. */
static void sun_on_floor(void)
{
    static const double elevation[4] = {90, 60, 30, 2};
    pt_render_desc d = pt_render_defaults();
    int i, k;
    d.camera = pt_camera_look_at(v3(0, 3, 0), v3(0, 0, 0), v3(0, 0, -1), 60);
    d.width = d.height = 8;
    d.spp = 2;
    d.li.max_edges = 2;
    for (i = 0; i < 4; i++) {
        const double a = degrees(elevation[i]), exact = 0.5 / PT_PI * 7 * sin(a);
        pt_scene scene = PT_SCENE_INIT;
        pt_film film = PT_FILM_INIT;
        double worst = 0;
        add_floor(&scene);
        pt_add_directional_light(&scene, v3(3 * cos(a), -3 * sin(a), 0), grey(7));
        scene = committed(scene);
        pt_check(pt_render(&scene, &d, &film, NULL) == PT_OK, "floor in the sun", "cannot be rendered");
        for (k = 0; k < 64; k++) worst = fmax(worst, fabs(pt_film_pixel(&film, k % 8, k / 8).g - exact));
        pt_check(worst <= 16 * unit_roundoff(), label("floor in the sun, %g degrees up", elevation[i]),
                 "off by %.3g from rho / pi E sin(elevation)", worst);
        pt_film_free(&film);
        pt_scene_free(&scene);
    }
}

/* The line from (x,0,z) against the light passes the centre of a ball at some distance: shadow if below its radius.
   The ball is small and far (a shadow ray that ends early misses it), or near. */
static void sun_shadows(void)
{
    static const double height[3] = {1, 100, 1e5};
    const pt_vec3 w = pt_v3_normalize(v3(0.3, -1, 0.2)); /* where the light goes */
    int k, i;
    for (k = 0; k < 3; k++) {
        const double h = height[k], r = fmax(0.5, h / 256), s = -h / dbl(w.y);
        const pt_vec3 c = v3(-s * dbl(w.x), h, -s * dbl(w.z)); /* its shadow is around the origin */
        pt_scene scene = PT_SCENE_INIT;
        pt_pcg32 rng = pt_pcg32_make(20, (uint64_t)k);
        int wrong = 0, shaded = 0;
        pt_add_parallelogram(&scene, v3(-1e3, 0, -1e3), v3(0, 0, 2e3), v3(2e3, 0, 0),
                             pt_add_material(&scene, pt_material_diffuse(grey(0.5))));
        pt_add_sphere(&scene, c, (pt_real)r, 0);
        pt_add_directional_light(&scene, w, grey(1));
        scene = committed(scene);
        for (i = 0; i < 2000; i++) {
            const double x = (4 * pt_pcg32_double(&rng) - 2) * r, z = (4 * pt_pcg32_double(&rng) - 2) * r;
            const pt_vec3 to = pt_v3_sub(c, v3(x, 0, z));
            const double along = -dot3(to, w), aside = sqrt(fmax(0, dot3(to, to) - along * along));
            const double got = direct_light(&scene, pt_li_path, v3(x, 0.01, z), v3(0, -1, 0), 1, 0).r;
            if (fabs(aside - r) < 1e-3 * r + 64 * unit_roundoff() * h) continue; /* too close to tell */
            wrong += (got > 0) != (aside > r);
            shaded += aside < r;
        }
        pt_check(wrong == 0 && shaded > 100, label("shadow of a ball %g m up", h),
                 "%d of 2000 points are lit wrongly: a shadow ray to the sun has no end", wrong);
        pt_scene_free(&scene);
    }
}

/* Every emitted ray carries E pi r^2; their starts fill a disk of radius r, that of the scene, before the scene. */
static void sun_power(void)
{
    const pt_vec3 w = pt_v3_normalize(v3(1, -2, 0.5));
    const pt_frame frame = pt_frame_from_normal(w);
    const uint32_t n = pt_test_samples(64000);
    pt_scene scene = PT_SCENE_INIT;
    pt_pcg32 rng = generator(30);
    pt_light_sample_result ls;
    double counts[64] = {0}, expected[64], r;
    int i, off = 0, lit;
    pt_add_sphere(&scene, v3(2, 1, -3), 1, pt_add_material(&scene, pt_material_diffuse(grey(0.5))));
    pt_add_directional_light(&scene, v3(10, -20, 5), grey(3));
    scene = committed(scene);
    r = sqrt(3); /* half the diagonal of the ball's box */
    for (i = 0; i < (int)n; i++) {
        const pt_vec2 u = pair(&rng), v = pair(&rng);
        pt_light_emission_result s;
        pt_vec3 q;
        double rho2, pdf_a, pdf_w;
        const int made = pt_light_sample_le(&scene, 0, u, v, 0, &s);
        pt_light_pdf_le(&scene, 0, s.n, s.w, &pdf_a, &pdf_w);
        q = pt_frame_to_local(&frame, pt_v3_sub(s.p, v3(2, 1, -3)));
        rho2 = (dbl(q.x) * dbl(q.x) + dbl(q.y) * dbl(q.y)) / (r * r);
        off += !made ||
               fabs(dbl(s.radiance.r) / (s.pdf_a * s.pdf_w) - 3 * PT_PI * r * r) > 1e-5 * 3 * PT_PI * r * r ||
               rho2 > 1 + 1e-5 || fabs(dbl(q.z) + r) > 1e-4 || pdf_a != s.pdf_a || pdf_w != s.pdf_w ||
               s.pdf_w != 1 || dot3(s.w, w) < 1 - 1e-6 || s.cos_n != 1;
        counts[cell(rho2, 8) * 8 + cell(0.5 + atan2(dbl(q.y), dbl(q.x)) / (2 * PT_PI), 8)]++;
    }
    for (i = 0; i < 64; i++) expected[i] = n / 64.0;
    pt_check(off == 0, "rays of the sun",
             "%d of %u: E over density is E pi r^2, from a disk before the scene", off, n);
    pt_check_chi2("starts of the sun's rays", counts, expected, 64, "must fill the disk uniformly");
    lit = pt_light_sample(&scene, 0, v3(9, 9, 9), pt_v2(0, 0), &ls);
    pt_check(lit && ls.delta && ls.infinite && ls.pdf_w == 1 && dbl(ls.radiance.g) == 3 &&
                 dot3(ls.wi, w) < -1 + 1e-6 && dbl(ls.distance) > 10,
             "sample of the sun", "delta, infinitely far, irradiance across the direction");
    pt_check(pt_light_pdf_w(&scene, 0, v3(0, 0, 0), pt_v3_neg(w), NULL) == 0, "sun", "a ray cannot hit it");
    pt_scene_free(&scene);
}

#if PTI_HAS_ENVIRONMENT
/* ---- the sky as an image ---------------------------------------------------------------------------- */

/* A picture and its size; with the solid angle of a pixel by its definition, 2 pi / w (cos a - cos b). */
typedef struct sky {
    int w, h;
    float *rgb;
} sky;

static double pixel_solid_angle(const sky *s, int y)
{
    return 2 * PT_PI / s->w * (cos(PT_PI * y / s->h) - cos(PT_PI * (y + 1) / s->h));
}

static double pixel_luminance(const sky *s, int x, int y)
{
    const float *const c = s->rgb + 3 * (y * s->w + x);
    return pt_luminance((double)c[0], (double)c[1], (double)c[2]);
}

/* Kinds of pictures: 0 all 1, 1 a gradient with colours, 2 one hot pixel, 3 gradient with black rows and pixels. */
static sky sky_make(int w, int h, int kind)
{
    sky s;
    int x, y, k;
    s.w = w;
    s.h = h;
    s.rgb = (float *)malloc(3 * (size_t)w * (size_t)h * sizeof *s.rgb);
    for (y = 0; s.rgb && y < h; y++)
        for (x = 0; x < w; x++)
            for (k = 0; k < 3; k++) {
                double v = 1;
                if (kind == 1 || kind == 3) v = 0.2 + (y + 0.5) / h + (k + 1) * (x + 0.5) / w;
                if (kind == 2) v = x == (2 * w) / 3 && y == h / 3 ? 100 : 0;
                if (kind == 3 && (y % 3 == 1 || (x + y) % 4 == 0)) v = 0;
                s.rgb[3 * (y * w + x) + k] = (float)v;
            }
    return s;
}

/* A scene under the sky: with a floor or without. */
static pt_scene under(const sky *s, double scale, int with_floor)
{
    pt_scene scene = PT_SCENE_INIT;
    if (with_floor) add_floor(&scene);
    pt_check(pt_set_environment_image(&scene, s->rgb, s->w, s->h, scale) == 0, "pt_set_environment_image",
             "%s", pt_scene_error(&scene));
    return committed(scene);
}

/* Direction to the point (x, y), in pixels, of a picture: rows from the zenith; the middle column is -z, the right half +x. */
static pt_vec3 sky_direction(const sky *s, double x, double y)
{
    const double phi = 2 * PT_PI * (x / s->w - 0.5), theta = PT_PI * y / s->h;
    return v3(sin(theta) * sin(phi), cos(theta), -sin(theta) * cos(phi));
}

static void sky_orientation(void)
{
    static const int size[6][2] = {{1, 1}, {2, 1}, {1, 2}, {5, 3}, {8, 4}, {64, 32}};
    int k, x, y, i;
    for (k = 0; k < 6; k++) {
        sky s = sky_make(size[k][0], size[k][1], 1);
        pt_scene scene = under(&s, 2, 0);
        int wrong = 0;
        for (y = 0; y < s.h; y++)
            for (x = 0; x < s.w; x++)
                for (i = 0; i < 4; i++) { /* four points near the corners of the pixel */
                    const pt_vec3 w = sky_direction(&s, x + (i & 1 ? 0.99 : 0.01), y + (i & 2 ? 0.99 : 0.01));
                    const pt_rgb got = pt_environment_radiance(&scene, w);
                    const float *const c = s.rgb + 3 * (y * s.w + x);
                    wrong += fabs(dbl(got.r) - 2 * (double)c[0]) > 1e-6 ||
                             fabs(dbl(got.b) - 2 * (double)c[2]) > 1e-6;
                }
        pt_check(wrong == 0, label("pixels of a sky of %d x %d", s.w, s.h),
                 "%d of %d directions see another pixel", wrong, 4 * s.w * s.h);
        pt_scene_free(&scene);
        free(s.rgb);
    }
}

/* The same in words, with an odd width: -z is in the middle column, +x a quarter to the right, +y in the top row. */
static void sky_axes(void)
{
    static const double axis[8][3] = {{0, 0, -1}, {1, 0, 0}, {-1, 0, 0},   {0, 1, 0},
                                      {0, -1, 0}, {0, 0, 1}, {-0.0, 0, 1}, {0, 1, -0.0}};
    static const int column[8] = {4, 6, 2, -1, -1, 0, 0, -1}, row[8] = {1, 1, 1, 0, 2, 1, 1, 0};
    sky s = sky_make(9, 3, 1);
    pt_scene scene = under(&s, 1, 0);
    int k, x;
    for (k = 0; k < 8; k++) {
        const pt_rgb got = pt_environment_radiance(&scene, v3(axis[k][0], axis[k][1], axis[k][2]));
        int found = 0;
        for (x = 0; x < 9; x++) {
            const float *const c = s.rgb + 3 * (row[k] * 9 + x);
            if (fabs(dbl(got.g) - (double)c[1]) < 1e-6 && fabs(dbl(got.b) - (double)c[2]) < 1e-6)
                found |= column[k] < 0 || x == column[k] ||
                         (k >= 5 && x == 8); /* +z is the seam: first or last column */
        }
        pt_check(found, label("sky along (%g, %g, %g)", axis[k][0], axis[k][1], axis[k][2]),
                 "sees the wrong pixel: %g", dbl(got.g));
    }
    pt_scene_free(&scene);
    free(s.rgb);
}

/* A picture of the sky: turned neither upside down nor left to right. */
static void sky_picture(void)
{
    sky s = sky_make(4, 2, 1);
    pt_scene scene = under(&s, 1, 0);
    pt_render_desc d = pt_render_defaults();
    pt_film film = PT_FILM_INIT;
    int x, y, wrong = 0;
    d.camera = pt_camera_look_at(v3(5, 6, 7), v3(5, 6, 0), v3(0, 1, 0), 90);
    d.width = d.height = 2;
    d.spp = 8;
    pt_check(pt_render(&scene, &d, &film, NULL) == PT_OK, "picture of a sky", "cannot be rendered");
    for (y = 0; y < 2 && film.half[0]; y++)
        for (x = 0; x < 2; x++)
            wrong += fabs(pt_film_pixel(&film, x, y).b - (double)s.rgb[3 * (y * 4 + 1 + x) + 2]) > 1e-6;
    pt_check(wrong == 0, "picture of a sky",
             "%d of 4 quadrants are wrong: the columns to the right of -z are to the right", wrong);
    pt_film_free(&film);
    pt_scene_free(&scene);
    free(s.rgb);
}

/* Density = share of the pixel in luminance times solid angle, over its solid angle. */
static void check_sky_density(const sky *s, const pt_scene *scene)
{
    double total = 0, integral = 0, worst = 0;
    int x, y;
    for (y = 0; y < s->h; y++)
        for (x = 0; x < s->w; x++) total += pixel_luminance(s, x, y) * pixel_solid_angle(s, y);
    for (y = 0; y < s->h; y++)
        for (x = 0; x < s->w; x++) {
            const pt_vec3 w = sky_direction(s, x + 0.5, y + 0.5);
            const double p = pt_light_pdf_w(scene, scene->environment_light, v3(1, 2, 3), w, NULL),
                         exact = pixel_luminance(s, x, y) / total;
            integral += p * pixel_solid_angle(s, y);
            worst = fmax(worst, fabs(p - exact) / fmax(exact, 1 / (4 * PT_PI)));
        }
    pt_check_near(label("density of a sky of %d x %d", s->w, s->h), integral, 1, 1e-9,
                  "must integrate to 1 over the sphere");
    pt_check(worst <= 1e-8, label("density of a sky of %d x %d by hand", s->w, s->h),
             "off by %.3g: luminance over the sum of luminance times solid angle", worst);
}

/* Samples follow the density (cells: blocks of pixels of a large picture, parts of a pixel of a small one), and carry
   the radiance and density that a lookup gives. */
static void check_sky_samples(const sky *s, const pt_scene *scene, uint64_t seed, uint32_t n)
{
    const int bx = s->w > 16 ? 16 : s->w, by = s->h > 8 ? 8 : s->h, parts = s->w * s->h <= 2 ? 4 : 1,
              cells = bx * by * parts * parts;
    pt_pcg32 rng = generator(seed);
    double counts[1024] = {0}, expected[1024] = {0}, total = 0;
    int i, x, y, off = 0;
    for (y = 0; y < s->h; y++)
        for (x = 0; x < s->w; x++) {
            const double p = pixel_luminance(s, x, y) * pixel_solid_angle(s, y);
            total += p;
            for (i = 0; i < parts * parts; i++)
                expected[((y * by / s->h) * bx + x * bx / s->w) * parts * parts + i] += p / (parts * parts);
        }
    n = pt_test_samples(n);
    for (i = 0; i < cells; i++) expected[i] *= n / total;
    for (i = 0; i < (int)n; i++) {
        pt_light_sample_result l;
        double phi, up, a, b;
        pt_rgb seen;
        if (!pt_light_sample(scene, scene->environment_light, v3(1, 2, 3), pair(&rng), &l)) continue;
        seen = pt_environment_radiance(scene, l.wi);
        off += dbl(seen.g) != dbl(l.radiance.g) ||
               l.pdf_w != pt_light_pdf_w(scene, scene->environment_light, v3(1, 2, 3), l.wi, NULL) ||
               l.delta || !l.infinite || !(l.pdf_w > 0);
        phi = s->w * (0.5 + atan2(dbl(l.wi.x), -dbl(l.wi.z)) / (2 * PT_PI));
        up = s->h * atan2(sqrt(dbl(l.wi.x) * dbl(l.wi.x) + dbl(l.wi.z) * dbl(l.wi.z)), dbl(l.wi.y)) / PT_PI;
        x = phi >= s->w ? s->w - 1 : (int)phi;
        y = up >= s->h ? s->h - 1 : (int)up;
        a = cos(PT_PI * y / s->h); /* uniform in solid angle: in azimuth and in the cosine */
        b = cos(PT_PI * (y + 1) / s->h);
        counts[((y * by / s->h) * bx + x * bx / s->w) * parts * parts + cell(phi - x, parts) * parts +
               cell((a - dbl(l.wi.y)) / (a - b), parts)]++;
    }
    pt_check(off == 0, label("samples of a sky of %d x %d", s->w, s->h),
             "%d of %u: radiance or density is not that of the direction", off, n);
    if (cells > 1)
        pt_check_chi2(label("directions of a sky of %d x %d", s->w, s->h), counts, expected, cells,
                      "do not follow the density");
}

static void sky_sampling(void)
{
    static const int size[7][3] = {{1, 1, 0},   {2, 1, 1},     {5, 3, 1},    {7, 6, 3},
                                   {64, 32, 2}, {512, 256, 1}, {512, 256, 3}};
    int k;
    for (k = 0; k < 7; k++) {
        sky s = sky_make(size[k][0], size[k][1], size[k][2]);
        pt_scene scene = under(&s, 0.5, 0);
        check_sky_density(&s, &scene);
        if (size[k][2] != 2) check_sky_samples(&s, &scene, (uint64_t)(40 + k), 60000);
        pt_scene_free(&scene);
        free(s.rgb);
    }
}

/* One hot pixel: every sample lies in it, with density 1 / its solid angle; rows of black are never drawn. */
static void sky_hot_pixel(void)
{
    sky s = sky_make(512, 256, 2);
    pt_scene scene = under(&s, 1, 0);
    const double omega = pixel_solid_angle(&s, 256 / 3);
    pt_pcg32 rng = generator(50);
    pt_stats power = PT_STATS_INIT;
    int i, outside = 0, made, count = 0;
    for (i = 0; i < 2000; i++) {
        pt_light_sample_result l;
        pt_light_emission_result e;
        made = pt_light_sample(&scene, scene.environment_light, v3(0, 0, 0), pair(&rng), &l);
        if (!made || dbl(l.radiance.r) <= 0)
            outside++; /* rounding to float may step over an edge */
        else
            count += fabs(l.pdf_w * omega - 1) > 1e-9;
        made = pt_light_sample_le(&scene, scene.environment_light, pair(&rng), pair(&rng), 0, &e);
        pt_stats_add(&power, made ? dbl(e.radiance.r) / (e.pdf_a * e.pdf_w) : 0);
    }
    pt_check(outside <= 2 && count == 0, "a hot pixel",
             "%d of 2000 samples miss it, %d have another density than 1 / %g sr", outside, count, omega);
    pt_check_mean("power of a hot pixel", &power, PT_PI * 100 * omega, 1e-3 * PT_PI * 100 * omega, 0.02,
                  PT_TEST_VALUES, "an empty scene has radius 1: pi r^2 times L times solid angle");
    pt_scene_free(&scene);
    free(s.rgb);
}

/* The mean over the sphere that pt_light holds, and that of a constant image: the constant. */
static void sky_mean(void)
{
    sky s = sky_make(64, 32, 3),
        one = sky_make(7, 5, 0); /* not a linear gradient: its plain mean is the same */
    pt_scene scene = under(&s, 2, 0), constant = under(&one, 3, 0);
    double sum = 0;
    int x, y;
    for (y = 0; y < s.h; y++)
        for (x = 0; x < s.w; x++)
            sum += 2 * (double)s.rgb[3 * (y * s.w + x)] * pixel_solid_angle(&s, y) / (4 * PT_PI);
    pt_check_near("mean radiance of a sky", dbl(scene.environment.r), sum, 8 * unit_roundoff() * sum,
                  "weigh pixels by solid angle");
    pt_check_near("mean radiance of a constant image", dbl(constant.environment.b), 3, 1e-6, "");
    pt_check(pt_scene_needs(&scene) == (PT_NEEDS_ENVIRONMENT | PT_NEEDS_ENVIRONMENT_IMAGE), "needs of a sky",
             "%x", pt_scene_needs(&scene));
    pt_set_environment(&constant, grey(4));
    constant = committed(constant);
    pt_check(dbl(pt_environment_radiance(&constant, v3(0, 1, 0)).r) == 4 &&
                 pt_scene_needs(&constant) == PT_NEEDS_ENVIRONMENT,
             "a constant after an image", "the image must be gone");
    pt_scene_free(&scene);
    pt_scene_free(&constant);
    free(s.rgb);
    free(one.rgb);
}

/* Irradiance of a sky pixel by pixel: on a floor int cos sin dtheta dphi, on a wall that faces +x, where cos is sin theta
   sin phi with phi from -z over +x: int sin^2 theta int max(0, sin phi), the width being even. */
static void sky_irradiance_by_hand(const sky *s, double *on_floor, double *on_wall)
{
    int x, y;
    *on_floor = *on_wall = 0;
    for (y = 0; y < s->h; y++)
        for (x = 0; x < s->w; x++) {
            const double a = PT_PI * y / s->h, b = PT_PI * (y + 1) / s->h,
                         c = 2 * PT_PI * ((double)x / s->w - 0.5), d = c + 2 * PT_PI / s->w;
            const double value = (double)s->rgb[3 * (y * s->w + x)];
            if (2 * (y + 1) <= s->h) *on_floor += value * (d - c) * 0.5 * (sin(b) * sin(b) - sin(a) * sin(a));
            if (2 * x >= s->w)
                *on_wall += value * (cos(c) - cos(d)) * 0.5 * (b - a - sin(b) * cos(b) + sin(a) * cos(a));
        }
}

/* One surface that sees half of the sky: rho / pi E by each of the three estimators. */
static void sky_irradiance(void)
{
    static const struct {
        const char *name;
        pt_li_fn li;
        uint32_t n;
    } method[3] = {
        {"path", pt_li_path, 60000}, {"light", pt_li_path_light, 320000}, {"plain", pt_li_path_plain, 60000}};
    sky s = sky_make(16, 8, 1);
    double exact[2];
    int wall, m;
    sky_irradiance_by_hand(&s, &exact[0], &exact[1]);
    for (wall = 0; wall < 2; wall++) {
        pt_scene scene = PT_SCENE_INIT;
        const int white = pt_add_material(&scene, pt_material_diffuse(grey(0.5)));
        if (wall)
            pt_add_parallelogram(&scene, v3(0, -5, -5), v3(0, 10, 0), v3(0, 0, 10), white); /* faces +x */
        else
            pt_add_parallelogram(&scene, v3(-5, 0, -5), v3(0, 0, 10), v3(10, 0, 0), white);
        pt_set_environment_image(&scene, s.rgb, s.w, s.h, 1);
        scene = committed(scene);
        for (m = 0; m < 3; m++) {
            const uint32_t n = pt_test_samples(method[m].n);
            const pt_vec3 o = wall ? v3(0.01, 0, 0) : v3(0, 0.01, 0), d = wall ? v3(-1, 0, 0) : v3(0, -1, 0);
            pt_stats stats = PT_STATS_INIT;
            uint32_t i;
            for (i = 0; i < n; i++)
                pt_stats_add(&stats,
                             direct_light(&scene, method[m].li, o, d, 60 + (uint64_t)(3 * wall + m), i).r);
            pt_check_mean(label("%s under a gradient sky, %s", wall ? "wall" : "floor", method[m].name),
                          &stats, 0.5 / PT_PI * exact[wall], 1e-6, 0.02, PT_TEST_VALUES,
                          "a flipped or mirrored picture, a missing sin theta, or a density per pixel");
        }
        pt_scene_free(&scene);
    }
    free(s.rgb);
}

/* A constant image is a constant environment: rho L on a floor, for each path of the plain estimator exactly. */
static void sky_constant(void)
{
    sky s = sky_make(6, 4, 0);
    pt_scene image = under(&s, 2, 1), constant = PT_SCENE_INIT;
    const uint32_t n = pt_test_samples(60000);
    pt_stats a = PT_STATS_INIT, b = PT_STATS_INIT;
    double worst = 0;
    uint32_t i;
    add_floor(&constant);
    pt_set_environment(&constant, grey(2));
    constant = committed(constant);
    for (i = 0; i < n; i++) {
        if (i < 1000)
            worst =
                fmax(worst,
                     fabs(direct_light(&image, pt_li_path_plain, v3(0, 0.01, 0), v3(0, -1, 0), 70, i).g - 1));
        pt_stats_add(&a, direct_light(&image, pt_li_path, v3(0, 0.01, 0), v3(0, -1, 0), 71, i).g);
        pt_stats_add(&b, direct_light(&constant, pt_li_path, v3(0, 0.01, 0), v3(0, -1, 0), 72, i).g);
    }
    pt_check(worst < 1e-6, "floor under a constant image, plain", "off by %.3g in a path", worst);
    pt_check_mean("floor under a constant image", &a, 1, 0, 0.02, PT_TEST_VALUES, "rho L");
    pt_check_mean("floor under a constant sky", &b, 1, 0, 0.02, PT_TEST_VALUES, "rho L");
    pt_check_equal_means("constant image = constant sky", &a, &b, 0.03, "");
    pt_scene_free(&image);
    pt_scene_free(&constant);
    free(s.rgb);
}

/* A black picture is no light, and does not divide by zero. */
static void sky_black(void)
{
    static const float black[12] = {0};
    pt_scene scene = PT_SCENE_INIT;
    add_floor(&scene);
    pt_set_environment_image(&scene, black, 2, 2, 1);
    scene = committed(scene);
    pt_check(scene.light_count == 0 && scene.environment_light == -1 &&
                 direct_light(&scene, pt_li_path, v3(0, 1, 0), v3(0, -1, 0), 73, 0).r == 0,
             "a black sky", "is a light");
    pt_scene_free(&scene);
}
#endif

/* ---- units ------------------------------------------------------------------------------------------ */

/* A lamp of 815 lm, as sold for 60 W bulbs: 815 / (4 pi) = 64.86 cd; its watts per band have 683.002 times their luminance
   as lumens. A film 25 mm high behind 35 mm (the Cornell box): 39.30765 degrees. */
static void units(void)
{
    const pt_rgb warm = pt_rgb3(1, (pt_real)0.7, (pt_real)0.3);
    const pt_rgbd w = pt_watts_from_lumens(815, warm), none = pt_watts_from_lumens(815, grey(0));
    pt_check_near("candela of a lamp of 815 lm", pt_intensity_of_flux(815), 64.86, 0.005, "flux / (4 pi)");
    pt_check_near("flux of that lamp", pt_flux_point(pt_intensity_of_flux(815)), 815, 1e-11, "the inverse");
    pt_check_near("lumens of the watts of a lamp", PT_LUMENS_PER_WATT * pt_luminance(w.r, w.g, w.b), 815,
                  1e-10, "683.002 lm/W times luminance");
    pt_check_near("colour of the watts of a lamp", w.g / w.r, dbl(warm.g) / dbl(warm.r), 1e-12,
                  "keeps the ratios of the bands");
    pt_check_near("watts of a white lamp", pt_watts_from_lumens(683.002, grey(1)).b, 1, 1e-9,
                  "1 W at luminance 1 is 683.002 lm");
    pt_check(none.r == 0 && none.g == 0 && none.b == 0, "watts of a black lamp", "are not 0");
    pt_check_near("radiance of a panel of 3000 lm, 0.36 m^2", pt_radiance_of_flux(3000, 0.36),
                  3000 / (PT_PI * 0.36), 1e-9, "Phi / (pi A)");
    pt_check_near("field of view of the Cornell box", pt_vfov_deg_of_film(0.025, 0.035), 39.30765, 5e-6,
                  "2 atan(h / 2f)");
    pt_check_near("field of view of a film as high as 2 f", pt_vfov_deg_of_film(2, 1), 90, 1e-12,
                  "2 atan(1)");
}

/* ---- bad input -------------------------------------------------------------------------------------- */

static void check_refused(const char *name, pt_scene *scene, int id, const char *item, const char *what)
{
    const char *const text = pt_scene_error(scene);
    const pt_result result = pt_commit(scene);
    pt_check(id == -1 && result != PT_OK && strstr(text, item) && strstr(text, what), name,
             "id %d, result '%s', sentence '%s'", id, pt_result_string(result), text);
    pt_scene_free(scene);
}

static void bad_spots_and_suns(void)
{
    static const double bad[3] = {(double)NAN, HUGE_VAL, -1};
    static const double angles[7][2] = {{-1, 20},          {20, 20},          {30, 20},  {20, 181},
                                        {(double)NAN, 20}, {20, (double)NAN}, {190, 200}};
    int k, i;
    for (i = 0; i < 7; i++) {
        pt_scene s = PT_SCENE_INIT;
        pt_add_point_light(&s, v3(0, 0, 0), grey(1));
        check_refused(label("spot of %g to %g degrees", angles[i][0], angles[i][1]), &s,
                      pt_add_spot_light(&s, v3(0, 0, 0), v3(0, 1, 0), grey(1), angles[i][0], angles[i][1]),
                      "spot light 1", "angles");
    }
    for (k = 0; k < 2; k++) {
        static const char *const item[2] = {"spot light 0", "directional light 0"};
        for (i = 0; i < 3; i++) {
            const pt_rgb light = pt_rgb3(1, 1, (pt_real)bad[i]);
            pt_scene s = PT_SCENE_INIT;
            check_refused(label("%s of intensity %g", item[k], bad[i]), &s,
                          k ? pt_add_directional_light(&s, v3(0, 1, 0), light)
                            : pt_add_spot_light(&s, v3(0, 0, 0), v3(0, 1, 0), light, 10, 20),
                          item[k], "intensity");
            if (i == 2) continue; /* -1 is a coordinate */
            check_refused(label("%s along %g", item[k], bad[i]), &s,
                          k ? pt_add_directional_light(&s, v3(0, bad[i], 0), grey(1))
                            : pt_add_spot_light(&s, v3(0, 0, 0), v3(0, bad[i], 0), grey(1), 10, 20),
                          item[k], "");
        }
        {
            pt_scene s = PT_SCENE_INIT;
            check_refused(label("%s along nothing", item[k]), &s,
                          k ? pt_add_directional_light(&s, v3(0, 0, 0), grey(1))
                            : pt_add_spot_light(&s, v3(0, 0, 0), v3(0, 0, 0), grey(1), 10, 20),
                          item[k], "direction is zero");
        }
    }
    {
        pt_scene s = PT_SCENE_INIT;
        check_refused("spot at infinity", &s,
                      pt_add_spot_light(&s, v3(HUGE_VAL, 0, 0), v3(0, 1, 0), grey(1), 10, 20), "spot light 0",
                      "");
    }
}

#if PTI_HAS_ENVIRONMENT
static void bad_skies(void)
{
    static const struct {
        const char *name;
        int null, w, h;
        double pixel, scale;
        const char *what;
    } bad[] = {{"no image", 1, 2, 2, 1, 1, "empty"},
               {"image of no width", 0, 0, 2, 1, 1, "empty"},
               {"image of negative height", 0, 2, -2, 1, 1, "empty"},
               {"image too wide", 0, 65537, 1, 1, 1, "larger"},
               {"NaN in an image", 0, 2, 2, (double)NAN, 1, "pixel"},
               {"infinity in an image", 0, 2, 2, HUGE_VAL, 1, "pixel"},
               {"negative pixel", 0, 2, 2, -0.5, 1, "pixel"},
               {"negative scale", 0, 2, 2, 1, -1, "scale"},
               {"scale NaN", 0, 2, 2, 1, (double)NAN, "scale"},
               {"scale infinite", 0, 2, 2, 1, HUGE_VAL, "scale"}};
    size_t i;
    for (i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        float rgb[12];
        pt_scene s = PT_SCENE_INIT;
        int k;
        for (k = 0; k < 12; k++) rgb[k] = 1;
        rgb[7] = (float)bad[i].pixel;
        check_refused(
            bad[i].name, &s,
            pt_set_environment_image(&s, bad[i].null ? NULL : rgb, bad[i].w, bad[i].h, bad[i].scale),
            "environment", bad[i].what);
    }
}

/* A pixel times the scale beyond what a radiance can hold: refused, or else finite; never a picture of NaN. */
static void sky_overflow(void)
{
    static const float bright[6] = {3e38f, 3e38f, 3e38f, 1, 1, 1};
    pt_scene s = PT_SCENE_INIT;
    pt_light_sample_result l;
    int ok = pt_set_environment_image(&s, bright, 2, 1, 1e3) == -1;
    if (!ok && pt_commit(&s) == PT_OK)
        ok = pt_light_sample(&s, 0, v3(0, 0, 0), pt_v2((pt_real)0.3, (pt_real)0.3), &l) && l.pdf_w > 0 &&
             l.pdf_w < HUGE_VAL && dbl(l.radiance.r) < HUGE_VAL;
    pt_check(ok, "sky of 3e38 times 1000", "is accepted, and its radiance is not finite");
    pt_scene_free(&s);
}
#endif

/* ---- pixel filters ---------------------------------------------------------------------------------- */

static const char *const FILTER[3] = {"box", "tent", "gaussian"};

/* The part of a filter to the left of x, in units of its radius. Tent: (1+x)^2/2. Gaussian: the density along x of the
   round filter exp(-(x^2+y^2)/2), cut at 3 sigma, is proportional to exp(-x^2/2) erf(sqrt(9-x^2)/sqrt 2). */
static double filter_cdf(int filter, double x)
{
    double sum = 0, all = 0;
    int i;
    if (x <= -1) return 0;
    if (x >= 1) return 1;
    if (filter == PT_FILTER_BOX) return 0.5 + 0.5 * x;
    if (filter == PT_FILTER_TENT) return x < 0 ? 0.5 * (1 + x) * (1 + x) : 1 - 0.5 * (1 - x) * (1 - x);
    for (i = 0; i < 2000; i++) { /* with x = -cos t the integrand is smooth at both ends */
        const double t = PT_PI * (i + 0.5) / 2000, s = -3 * cos(t),
                     p = exp(-0.5 * s * s) * erf(sqrt(fmax(0, 9 - s * s)) / sqrt(2)) * sin(t);
        all += p;
        if (s < 3 * x) sum += p;
    }
    return sum / all;
}

/* Variance along an axis, for radius 1: box 1/3; tent 1/6; Gaussian sigma^2 (1 - c e^-c / (1 - e^-c)), c = 9/2, because
   r^2 / (2 sigma^2) is exponential, cut off at c. */
static double filter_variance(int filter)
{
    const double c = 4.5;
    return filter == PT_FILTER_BOX    ? 1.0 / 3
           : filter == PT_FILTER_TENT ? 1.0 / 6
                                      : (1 - c * exp(-c) / (1 - exp(-c))) / 9;
}

static void filter_moments(void)
{
    static const double usual[3] = {0.5, 1, 1.5};
    const uint32_t n = pt_test_samples(100000);
    int f, k, i;
    for (f = 0; f < 3; f++)
        for (k = 0; k < 3; k++) {
            const double radius = k == 0 ? usual[f] : k == 1 ? 2.25 : 0.4;
            pt_stats mean = PT_STATS_INIT, square[2], product = PT_STATS_INIT;
            pt_pcg32 rng = generator((uint64_t)(80 + 2 * f + k + 20 * (k == 2)));
            double counts[2][32], expected[32], most = 0;
            memset(square, 0, sizeof square);
            memset(counts, 0, sizeof counts);
            for (i = 0; i < (int)n; i++) {
                const pt_vec2 p = pt_filter_sample((pt_filter)f, k == 0 ? 0 : radius, pair(&rng));
                const double x = dbl(p.x) / radius, y = dbl(p.y) / radius;
                pt_stats_add(&mean, x + 0.5 * y);
                pt_stats_add(&square[0], x * x);
                pt_stats_add(&square[1], y * y);
                pt_stats_add(&product, x * y);
                counts[0][cell(0.5 + 0.5 * x, 32)]++;
                counts[1][cell(0.5 + 0.5 * y, 32)]++;
                most = fmax(most, f == PT_FILTER_GAUSSIAN ? sqrt(x * x + y * y) : fmax(fabs(x), fabs(y)));
            }
            for (i = 0; i < 32; i++)
                expected[i] = n * (filter_cdf(f, (i + 1) / 16.0 - 1) - filter_cdf(f, i / 16.0 - 1));
            pt_check(most <= 1 + 4 * unit_roundoff() && most > 0.97,
                     label("%s filter of radius %g", FILTER[f], radius), "reaches %g radii", most);
            pt_check_mean(label("%s filter %g, mean", FILTER[f], radius), &mean, 0, 1e-6, 0.02,
                          PT_TEST_VALUES, "symmetric");
            pt_check_mean(label("%s filter %g, x x", FILTER[f], radius), &square[0], filter_variance(f), 1e-6,
                          0.05, PT_TEST_VALUES, "variance of the filter");
            pt_check_mean(label("%s filter %g, y y", FILTER[f], radius), &square[1], filter_variance(f), 1e-6,
                          0.05, PT_TEST_VALUES, "variance of the filter");
            pt_check_mean(label("%s filter %g, x y", FILTER[f], radius), &product, 0, 1e-6, 0.02,
                          PT_TEST_VALUES, "x and y are not correlated");
            pt_check_chi2(label("%s filter %g, density in x", FILTER[f], radius), counts[0], expected, 32,
                          "not proportional to the filter");
            pt_check_chi2(label("%s filter %g, density in y", FILTER[f], radius), counts[1], expected, 32,
                          "not proportional to the filter");
        }
}

#if PTI_HAS_TEXTURES
/* What a wall shows: its albedo is a function of x, and parallel light along the view makes the radiance albedo exactly. */
static pt_rgb ramp(void *user, pt_vec2 uv, pt_vec3 p)
{
    (void)user;
    (void)uv;
    return grey(0.5 + 0.25 * dbl(p.x));
}
static pt_rgb edge(void *user, pt_vec2 uv, pt_vec3 p)
{
    (void)user;
    (void)uv;
    return grey(dbl(p.x) > 0 ? 1 : 0);
}

/* A picture of 12 x 64 pixels of the wall z = -1: column x covers the wall from (x - 6) / 6 to (x - 5) / 6. */
static void picture_of(pt_rgb (*albedo)(void *, pt_vec2, pt_vec3), int filter, double radius, uint64_t seed,
                       pt_film *film)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_material wall = pt_material_diffuse(grey(1));
    pt_render_desc d = pt_render_defaults();
    pt_texture texture;
    memset(&texture, 0, sizeof texture);
    texture.kind = PT_TEXTURE_FUNCTION;
    texture.function = albedo;
    wall.texture = &texture;
    pt_add_parallelogram(&scene, v3(-2, -20, -1), v3(4, 0, 0), v3(0, 40, 0), pt_add_material(&scene, wall));
    pt_add_directional_light(&scene, v3(0, 0, -1), grey(PT_PI));
    scene = committed(scene);
    d.camera = pt_camera_look_at(v3(0, 0, 0), v3(0, 0, -1), v3(0, 1, 0),
                                 (pt_real)(2 * atan(64.0 / 12) * 180 / PT_PI));
    d.width = 12;
    d.height = 64;
    d.spp = 64;
    d.seed = pt_test_seed(seed);
    d.filter = (pt_filter)filter;
    d.filter_radius = radius;
    d.li.max_edges = 2;
    pt_check(pt_render(&scene, &d, film, NULL) == PT_OK, "wall", "cannot be rendered");
    pt_scene_free(&scene);
}

static pt_stats column_of(const pt_film *film, int x)
{
    pt_stats s = PT_STATS_INIT;
    int y;
    for (y = 0; y < film->height; y++) pt_stats_add(&s, pt_film_pixel(film, x, y).r);
    return s;
}

/* A ramp is the same through every filter; an edge is the filter's integral; a pixel of the film knows no neighbours, so
   the sum over a row, which the filter moves to and fro, stays. */
static void filtered_pictures(void)
{
    static const double radius[5] = {0.5, 1, 1.5, 2, 3};
    static const int filter[5] = {PT_FILTER_BOX, PT_FILTER_TENT, PT_FILTER_GAUSSIAN, PT_FILTER_BOX,
                                  PT_FILTER_GAUSSIAN};
    int k, x, y;
    for (k = 0; k < 5; k++) {
        const double given = k < 3 ? 0 : radius[k];
        pt_film film = PT_FILM_INIT;
        pt_stats rows = PT_STATS_INIT;
        picture_of(ramp, filter[k], given, 100 + (uint64_t)k, &film);
        for (x = 0; x < 12; x++) {
            const pt_stats s = column_of(&film, x);
            pt_check_mean(label("ramp, %s %g, column %d", FILTER[filter[k]], radius[k], x), &s,
                          0.5 + 0.25 * (x - 5.5) / 6, 1e-6, 0.02, PT_TEST_MEANS,
                          "the filter must be symmetric about the centre of the pixel");
        }
        pt_film_free(&film);
        picture_of(edge, filter[k], given, 110 + (uint64_t)k, &film);
        for (x = 0; x < 12; x++) {
            const double exact = filter_cdf(filter[k], (x - 5.5) / radius[k]);
            const pt_stats s = column_of(&film, x);
            if (exact > 1e-9 && exact < 1 - 1e-9)
                pt_check_mean(label("edge, %s %g, column %d", FILTER[filter[k]], radius[k], x), &s, exact,
                              1e-3, 0, PT_TEST_MEANS, "profile of an edge: the filter's integral");
            else
                pt_check(fabs(s.mean - exact) < 1e-6,
                         label("edge, %s %g, column %d", FILTER[filter[k]], radius[k], x),
                         "%g beyond the filter's reach", s.mean);
        }
        for (y = 0; y < 64; y++) {
            double sum = 0;
            for (x = 0; x < 12; x++) sum += pt_film_pixel(&film, x, y).g;
            pt_stats_add(&rows, sum);
        }
        pt_check_mean(label("edge, %s %g, sum of a row", FILTER[filter[k]], radius[k]), &rows, 6, 1e-6, 0.02,
                      PT_TEST_MEANS, "half of twelve columns");
        pt_film_free(&film);
    }
}
#endif

#if PTI_HAS_SCENES && PTI_HAS_ENVIRONMENT && PTI_HAS_TEXTURES
/* ---- canonical scenes ------------------------------------------------------------------------------- */

static pt_scene scene_of(const char *name, pt_camera *camera)
{
    const pt_scene_entry *const entry = pt_scene_find(name);
    pt_scene scene = PT_SCENE_INIT;
    if (!entry || entry->make(&scene, camera) != PT_OK)
        pt_check(0, name, "cannot be made: %s", pt_scene_error(&scene));
    return scene;
}

enum {
    T = PT_NEEDS_TRIANGLES,
    P = PT_NEEDS_PARALLELOGRAMS,
    S = PT_NEEDS_SPHERES,
    D = PT_NEEDS_DIFFUSE,
    M = PT_NEEDS_MIRROR,
    G = PT_NEEDS_DIELECTRIC,
    A = PT_NEEDS_AREA_LIGHTS
};
static const struct {
    const char *name;
    unsigned needs;
} NEEDS[12] = {{"cornell", T | D | A},
               {"cornell-empty", T | D | A},
               {"cornell-spheres", T | S | D | M | G | A},
               {"furnace", P | D | A},
               {"diffuse-sphere", S | D | PT_NEEDS_POINT_LIGHTS},
               {"glass-ball", P | S | D | G | A},
               {"smallpt", S | D | M | G | A},
               {"veach-plates", P | S | D | PT_NEEDS_CONDUCTOR | PT_NEEDS_ROUGHNESS | A},
               {"glossy-box", P | S | D | M | G | PT_NEEDS_PHONG | A},
               {"caustic-ring", T | P | S | D | M | A | PT_NEEDS_SHADING_NORMALS},
               {"pool", P | D | M | G | PT_NEEDS_ENVIRONMENT},
               {"materials", P | S | D | M | G | PT_NEEDS_OREN_NAYAR | PT_NEEDS_PHONG | PT_NEEDS_BLINN |
                                 PT_NEEDS_COAT | PT_NEEDS_CONDUCTOR | PT_NEEDS_ROUGHNESS | PT_NEEDS_TEXTURES |
                                 PT_NEEDS_ENVIRONMENT | PT_NEEDS_ENVIRONMENT_IMAGE}};

/* Each scene commits and uses what it is there for; whether it has a tree is a matter of its size. */
static void scene_needs(void)
{
    int count, i;
    const pt_scene_entry *const entry = pt_scenes(&count);
    pt_check(count == 12, "pt_scenes", "%d scenes", count);
    for (i = 0; i < 12 && i < count; i++) {
        pt_camera camera;
        pt_scene s = scene_of(NEEDS[i].name, &camera);
        char words[400];
        pt_check(strcmp(entry[i].name, NEEDS[i].name) == 0 && entry[i].summary[0] && s.committed &&
                     (pt_scene_needs(&s) & ~(unsigned)PT_NEEDS_BVH) == NEEDS[i].needs &&
                     dbl(camera.tan_half) > 0,
                 label("scene %s", NEEDS[i].name), "%s: needs %s", entry[i].name,
                 pt_scene_needs_string(&s, words, sizeof words));
        pt_check(s.degenerate_count == 0, label("scene %s", NEEDS[i].name), "%u degenerate shapes",
                 (unsigned)s.degenerate_count);
        pt_scene_free(&s);
    }
    pt_check(pt_scene_find("no such scene") == NULL && pt_scene_find(NULL) == NULL, "pt_scene_find",
             "finds a scene that is not there");
}

static double mean_of(pt_rgbd c) { return (c.r + c.g + c.b) / 3; }

/* Two methods in the part [x0,x1] x [y0,y1] of a picture, with the same random numbers: what both see alike, lamps and caustics
   that are hit, does not disturb the difference. 64 means of n Sobol points each; *level is the mean of b. */
static pt_stats difference_of(const pt_scene *scene, const pt_camera *camera, pt_li_fn a, pt_li_fn b,
                              const double window[4], uint64_t seed, uint32_t n, double *level)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, pt_test_seed(seed), 0);
    pt_stats s = PT_STATS_INIT;
    pt_li_options options;
    pt_li_info info;
    uint32_t unit, i;
    memset(&options, 0, sizeof options);
    memset(&info, 0, sizeof info);
    options.max_edges = 8;
    *level = 0;
    n = pt_test_samples(n);
    for (unit = 0; unit < 64; unit++) {
        double sum = 0, of_b = 0;
        for (i = 0; i < n; i++) {
            pt_vec2 u;
            pt_ray ray;
            pt_sampler_start(&sampler, unit, i);
            u = pt_sampler_2d(&sampler);
            ray = pt_camera_ray(camera, 1, (pt_real)(window[0] + (window[1] - window[0]) * dbl(u.x)),
                                (pt_real)(window[2] + (window[3] - window[2]) * dbl(u.y)), pt_v2(0, 0));
            sum += mean_of(a(scene, &ray, &sampler, &options, &info));
            pt_sampler_start(&sampler, unit, i);
            of_b += mean_of(b(scene, &ray, &sampler, &options, &info));
        }
        pt_stats_add(&s, (sum - of_b) / n);
        *level += of_b / n / 64;
    }
    return s;
}

/* F + (1-F)/n^2 rho (1 - Rd) / (1 - rho Rd'), at the angle of the ray: what the header's comment says. Fresnel by the textbook. */
static void pool_in_closed_form(void)
{
    static const double at[5][2] = {{0.5, 0.95}, {0.5, 0.7}, {0.4, 0.5}, {0.6, 0.4}, {0.5, 0.33}};
    const double n = 1.33, rho = 0.5;
    pt_camera camera;
    pt_scene scene = scene_of("pool", &camera);
    int k;
    for (k = 0; k < 5; k++) {
        const pt_ray ray = pt_camera_ray(&camera, 1, (pt_real)at[k][0], (pt_real)at[k][1], pt_v2(0, 0));
        const double c = -dbl(ray.d.y), t = sqrt(1 - (1 - c * c) / (n * n)), s = (c - n * t) / (c + n * t),
                     p = (n * c - t) / (n * c + t), F = 0.5 * (s * s + p * p);
        const double exact =
            F + (1 - F) / (n * n) * rho * (1 - pt_fresnel_diffuse(n)) / (1 - rho * pt_fresnel_diffuse(1 / n));
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_INDEPENDENT, pt_test_seed(200 + (uint64_t)k), 0);
        const uint32_t paths = pt_test_samples(72000);
        pt_stats stats = PT_STATS_INIT;
        pt_li_options options;
        pt_li_info info;
        pt_hit hit;
        uint32_t i;
        memset(&options, 0, sizeof options);
        memset(&info, 0, sizeof info);
        options.max_edges = 100; /* what is left after them has met the floor 20 times at least */
        options.roulette = PT_ROULETTE_NONE;
        pt_check(pt_intersect(&scene, &ray, &hit) &&
                     scene.materials[hit.material].kind == PT_MATERIAL_DIELECTRIC,
                 "a pixel of the pool", "does not see the water");
        for (i = 0; i < paths; i++) {
            pt_sampler_start(&sampler, 0, i);
            pt_stats_add(&stats, pt_li_path(&scene, &ray, &sampler, &options, &info).g);
        }
        pt_check_mean(label("pool, %.1f degrees", acos(c) * 180 / PT_PI), &stats, exact, 1e-5, 0.02,
                      PT_TEST_VALUES,
                      "the walls mirror without loss; radiance in water is that above times (1-F)/n^2");
    }
    pt_scene_free(&scene);
}

/* Six parts of Veach's picture: three estimators, one mean. In parts 2 and 3 light sampling has no mean that can be tested: the
   large lamp, 0.16 sr as its plate sees it, meets the lobe of the smoothest plate, 4 pi 0.005^2 = 3e-4 sr, in one sample of
   500, and a part has a few hundred that could; what one brings is 500 times the rest. */
static void veach_plates(void)
{
    static const pt_li_fn li[3] = {pt_li_path, pt_li_path_light, pt_li_path_plain};
    static const char *const name[3] = {"path", "light", "plain"};
    pt_camera camera;
    pt_scene scene = scene_of("veach-plates", &camera);
    int block, m;
    for (block = 0; block < 6; block++) {
        const double window[4] = {block % 2 * 0.5, block % 2 * 0.5 + 0.5, (block / 2) / 3.0,
                                  (block / 2 + 1) / 3.0};
        for (m = block == 2 || block == 3 ? 2 : 1; m < 3; m++) {
            double level;
            const pt_stats s = difference_of(&scene, &camera, li[m], li[0], window,
                                             210 + (uint64_t)(2 * block + m), 1000, &level);
            pt_check_mean(label("veach-plates, part %d of mean %.3f: %s - path", block, level, name[m]), &s,
                          0, 1e-5 * level, 0, PT_TEST_MEANS,
                          "densities of GGX, of the light choice, or the weights of MIS");
        }
    }
    pt_scene_free(&scene);
}

#if PTI_HAS_LPE
/* Radiance of class LSDE from a strip of the ring's floor around (x, 0, 0), found by hitting the lamp. */
static double ring_caustic(const pt_scene *scene, const pt_lpe *lpe, double x, uint64_t seed, uint32_t n)
{
    pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, pt_test_seed(seed), 0);
    double sum = 0;
    uint32_t i;
    for (i = 0; i < n; i++) {
        pt_rgbd classes[2] = {{0, 0, 0}, {0, 0, 0}};
        pt_li_options options;
        pt_li_info info;
        pt_vec2 u;
        pt_ray ray;
        memset(&options, 0, sizeof options);
        memset(&info, 0, sizeof info);
        options.max_edges = 3;
        options.lpe = lpe;
        info.classes = classes;
        pt_sampler_start(&sampler, 0, i);
        u = pt_sampler_2d(&sampler);
        ray = ray_from(v3(x + 0.05 * (dbl(u.x) - 0.5), 0.01, 0.04 * (dbl(u.y) - 0.5)), v3(0, -1, 0));
        (void)pt_li_path_plain(scene, &ray, &sampler, &options, &info);
        sum += classes[0].g;
    }
    return sum / n;
}

/* Seen from above light goes along +x, from 7.155 away, onto the far wall of the ring, a mirror of radius 1: 1/o + 1/i = 2 with
   o = 8.155 puts the cusp i = 0.533 before the wall, at x = 0.467 (a half for parallel light). The lamp, 1 across, blurs it by
   0.5 i/o = 0.033 to each side. Beyond the cusp the arms of the caustic z = 0.544 a^(3/2), a = 2 (x - 0.467) (from x = 1/(2 cos
   phi), z = y (a - y^2/2)), are closer than that up to a = 0.154: the light on the axis is brightest between x = 0.467 - 0.033
   and 0.467 + 0.077. Strips are 0.05 wide, which adds half a strip. */
static void ring_cusp(void)
{
    const char *const expression = "LSDE";
    const uint32_t n = pt_test_samples(30000);
    pt_camera camera;
    pt_scene scene = scene_of("caustic-ring", &camera);
    double best = 0, at = 0, left;
    pt_lpe lpe;
    int k;
    pt_check(pt_lpe_compile(&lpe, &expression, 1, NULL) == PT_OK, "LSDE", "is refused");
    for (k = 0; k < 13; k++) {
        const double x = 0.2 + 0.05 * k, value = ring_caustic(&scene, &lpe, x, 240 + (uint64_t)k, n);
        if (value > best) at = x;
        best = fmax(best, value);
    }
    left = ring_caustic(&scene, &lpe, 0.2, 255, n);
    pt_check(at > 0.467 - 0.033 - 0.025 && at < 0.467 + 0.077 + 0.025, "cusp of the nephroid",
             "the light on the axis is brightest at x = %g, not near half a radius", at);
    pt_check(best > 2 * left, "cusp of the nephroid", "is only %g times as bright as the floor before it",
             best / left);
    pt_scene_free(&scene);
}
#endif

/* Light sampling finds the lamp but through no mirror: all methods find the caustic by hitting the lamp. The plain one finds the
   rest by luck too, so its picture has no bound. */
static void ring_methods(void)
{
    static const double all[4] = {0, 1, 0, 1};
    pt_camera camera;
    pt_scene scene = scene_of("caustic-ring", &camera);
    double level;
    pt_stats s = difference_of(&scene, &camera, pt_li_path, pt_li_path_plain, all, 260, 2500, &level);
    pt_check_mean(label("caustic-ring of mean %.3f: path - plain", level), &s, 0, 1e-5 * level, 0,
                  PT_TEST_MEANS,
                  "a caustic counts once: after a mirror all of the lamp, after the floor its share");
    s = difference_of(&scene, &camera, pt_li_path, pt_li_path_light, all, 261, 600, &level);
    pt_check_mean(label("caustic-ring of mean %.3f: path - light", level), &s, 0, 1e-5 * level, 0.02 * level,
                  PT_TEST_MEANS,
                  "light sampling must count the lamp after a mirror, and not after the floor");
    pt_scene_free(&scene);
}
#endif

int main(int argc, char **argv)
{
    pt_test_begin("test_lights", argc, argv);
    PT_TEST_EXACT(spot_irradiance);
    PT_TEST_EXACT(spot_on_floor);
    PT_TEST(spot_power);
#if PTI_HAS_ENVIRONMENT
    PT_TEST_EXACT(choice_of_new_lights);
#endif
    PT_TEST_EXACT(sun_on_floor);
    PT_TEST_EXACT(sun_shadows);
    PT_TEST(sun_power);
#if PTI_HAS_ENVIRONMENT
    PT_TEST_EXACT(sky_orientation);
    PT_TEST_EXACT(sky_axes);
    PT_TEST_EXACT(sky_picture);
    PT_TEST(sky_sampling);
    PT_TEST(sky_hot_pixel);
    PT_TEST_EXACT(sky_mean);
    PT_TEST(sky_irradiance);
    PT_TEST(sky_constant);
    PT_TEST_EXACT(sky_black);
    PT_TEST_EXACT(bad_skies);
    PT_TEST_EXACT(sky_overflow);
#endif
    PT_TEST_EXACT(units);
    PT_TEST_EXACT(bad_spots_and_suns);
    PT_TEST(filter_moments);
#if PTI_HAS_TEXTURES
    PT_TEST(filtered_pictures);
#endif
#if PTI_HAS_SCENES && PTI_HAS_ENVIRONMENT && PTI_HAS_TEXTURES
    PT_TEST_EXACT(scene_needs);
    PT_TEST(pool_in_closed_form);
    PT_TEST(veach_plates);
#if PTI_HAS_LPE
    PT_TEST_EXACT(ring_cusp);
#endif
    PT_TEST(ring_methods);
#endif
    return pt_test_end();
}
