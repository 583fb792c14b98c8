/* fuzz.c: hostile calls. Every public function that takes data is called with numbers that nobody should pass: NaN,
   infinities, zeros of both signs, denormals, negatives, the largest number, indices and counts out of range. None may
   crash, read or write beyond its arrays, or run away; build with -fsanitize=address,undefined (make fuzz).

       fuzz [SECONDS] [SEED]          default 10 s, seed 1

   Prints how often each group of functions was called. What is promised beyond "no crash" is checked too: a refusal
   has a sentence, a committed scene of hostile numbers gives finite films or counts what it dropped. */

#define PATHTRACER_IMPLEMENTATION
#include "pathtracer.h"

#include <stdlib.h>

static pt_pcg32 rng;
static unsigned long wrong;

static uint32_t below(uint32_t n) { return pt_pcg32_next(&rng) % n; }
static int one_in(uint32_t n) { return below(n) == 0; }

/* A double of any kind: the worst ones often, ordinary ones half of the time. */
static double hostile(void)
{
    static const double worst[24] = {
        0,    -0.0, 1,     -1,    0.5, 2,    1e-45, 5e-324,  1.17549435e-38, 3.4028234e38, 1e300,   -1e300,
        1e18, 1e19, -1e18, 1e-18, 1e9, -1e9, 1e30,  0x1p-24, 1 + 0x1p-23,    0x1p31,       -0x1p31, 1e-9};
    const uint32_t kind = below(16);
    uint64_t bits;
    double x;
    if (kind < 8) return 4 * pt_pcg32_double(&rng) - 2;
    if (kind < 13) return worst[below(24)];
    if (kind == 13) return one_in(2) ? HUGE_VAL - HUGE_VAL : one_in(2) ? HUGE_VAL : -HUGE_VAL;
    if (kind == 14) return ldexp(2 * pt_pcg32_double(&rng) - 1, (int)below(280) - 140);
    bits = (uint64_t)pt_pcg32_next(&rng) << 32;
    bits |= pt_pcg32_next(&rng);
    memcpy(&x, &bits, sizeof x);
    return x;
}
/* Beyond the range of float a conversion gives infinity; that it does so is for the caller to know. */
static pt_real hostile_real(void)
{
    const double x = hostile();
    if (sizeof(pt_real) == sizeof(float) && fabs(x) > 3.4028234e38 && fabs(x) < HUGE_VAL)
        return (pt_real)(x > 0 ? HUGE_VAL : -HUGE_VAL);
    return (pt_real)x;
}
static int hostile_int(void)
{
    static const int worst[10] = {0, -1, 1, 2, 3, 2147483647, -2147483647 - 1, 65536, 65537, 1000};
    return one_in(2) ? (int)below(8) : worst[below(10)];
}
static pt_vec2 hostile2(void)
{
    const pt_real x = hostile_real();
    return pt_v2(x, hostile_real());
}
static pt_vec3 hostile3(void)
{
    const pt_real x = hostile_real(), y = hostile_real();
    return pt_v3(x, y, hostile_real());
}
static pt_rgb hostile_rgb(void)
{
    const pt_real r = hostile_real(), g = hostile_real();
    return pt_rgb3(r, g, hostile_real());
}
/* Mostly what is allowed, so that scenes come to be. */
static pt_vec3 mild3(void)
{
    const double x = 4 * pt_pcg32_double(&rng) - 2, y = 4 * pt_pcg32_double(&rng) - 2;
    if (one_in(40)) return hostile3();
    return pt_v3((pt_real)x, (pt_real)y, (pt_real)(4 * pt_pcg32_double(&rng) - 2));
}
static pt_rgb mild_rgb(void)
{
    return one_in(40) ? hostile_rgb()
                      : pt_rgb_grey((pt_real)(one_in(3) ? (double)below(2) : pt_pcg32_double(&rng)));
}
static pt_real mild_real(double most)
{
    return one_in(30) ? hostile_real() : (pt_real)(most * pt_pcg32_double(&rng));
}
static pt_ray hostile_ray(void)
{
    pt_ray ray;
    ray.o = hostile3();
    ray.d = hostile3();
    ray.tmax = hostile_real();
    return ray;
}

/* ---- single functions -------------------------------------------------------------------------------------- */

static void shapes(void)
{
    const pt_ray ray = hostile_ray();
    double t = 0, b[2] = {0, 0};
    pt_ray next;
    if (pt_intersect_sphere(&ray, hostile3(), hostile_real(), &t)) wrong += !(t > 0 && t < HUGE_VAL);
    if (pt_intersect_triangle(&ray, hostile3(), hostile3(), hostile3(), &t, b))
        wrong += !(t > 0 && t < HUGE_VAL && b[0] >= 0 && b[1] >= 0);
    (void)pt_intersect_box(&ray, hostile3(), hostile3());
    next = pt_spawn_ray(hostile3(), hostile3(), hostile3(), hostile3());
    next = pt_spawn_ray_to(next.o, hostile3(), hostile3(), hostile3(), hostile3(), hostile3());
    (void)pt_intersect_sphere(&next, hostile3(), 1, &t);
}

static void vectors(void)
{
    const pt_frame f = pt_frame_from_normal(hostile3());
    (void)pt_frame_to_local(&f, hostile3());
    (void)pt_v3_length(hostile3());
    (void)pt_v3_normalize(hostile3());
    (void)pt_luminance(hostile(), hostile(), hostile());
    (void)pt_srgb_encode(hostile());
    (void)pt_srgb_decode(hostile());
    (void)pt_srgb_byte(hostile());
    (void)pt_gamma((int)below(1000));
}

static void samplers(void)
{
    double given[4];
    pt_sampler s;
    pt_vec2 u;
    int i;
    for (i = 0; i < 4; i++) given[i] = hostile();
    s = one_in(4) ? pt_sampler_make_given(given, below(5))
                  : pt_sampler_make((pt_sampler_kind)below(3), pt_pcg32_next(&rng),
                                    pt_pcg32_next(&rng) >> below(32));
    pt_sampler_start(&s, pt_pcg32_next(&rng), pt_pcg32_next(&rng));
    for (i = 0; i < 6; i++) {
        u = pt_sampler_2d(&s);
        wrong += !(u.x >= 0 && u.x < 1 && u.y >= 0 && u.y < 1);
        if (one_in(3)) pt_sampler_seek(&s, pt_pcg32_next(&rng) >> below(32));
        u.x = pt_sampler_1d(&s);
        wrong += !(u.x >= 0 && u.x < 1);
    }
}

static void statistics(void)
{
    pt_stats a = PT_STATS_INIT, b = PT_STATS_INIT;
    double o[5], e[5];
    int i;
    for (i = 0; i < 5; i++) {
        pt_stats_add(&a, hostile());
        pt_stats_add(&b, hostile());
        o[i] = hostile();
        e[i] = hostile();
    }
    pt_stats_merge(&a, &b);
    (void)pt_stats_skewness(&a);
    (void)pt_p_value_mean(&a, hostile());
    (void)pt_p_value_equal_means(&a, &b);
    (void)pt_p_value_counts(o, e, (int)below(6));
    (void)pt_stats_interval(&a, hostile());
    (void)pt_normal_sf(hostile());
#ifdef FUZZ_ALL /* degrees of freedom below 0 make ln Gamma count up from there */
    (void)pt_student_sf(hostile(), hostile());
    (void)pt_chi2_sf(hostile(), hostile());
#else
    (void)pt_student_sf(hostile(), fabs(hostile()));
    (void)pt_chi2_sf(hostile(), fabs(hostile()));
#endif
    (void)pt_normal_isf(hostile());
    (void)pt_mis_weight(hostile(), hostile(), (pt_heuristic)below(3));
}

static double hostile_integrand(const double *u, void *user)
{
    (void)user;
    return u[0] * hostile();
}
static void hostile_warp(const double *u, double *x, void *user)
{
    (void)user;
    x[0] = u[0] + hostile();
}
static double hostile_density(const double *x, void *user)
{
    (void)user;
    return x[0] + hostile();
}

static void estimates(void)
{
    pt_integral p = {hostile_integrand, NULL, 1, 64, PT_SAMPLER_SOBOL, 1};
    const pt_technique technique[2] = {{hostile_warp, hostile_density, NULL},
                                       {hostile_warp, hostile_density, NULL}};
    int counts[2];
    double shares[2];
    pt_estimate out;
    counts[0] = one_in(4) ? hostile_int() : 1;
    counts[1] = one_in(4) ? hostile_int() : 2;
    shares[0] = hostile();
    shares[1] = one_in(2) ? 1 - shares[0] : hostile();
    p.dimensions = one_in(3) ? hostile_int() : 1 + (int)below(4);
    p.n = one_in(4) ? below(40) : 32 + below(100);
    p.sampler = (pt_sampler_kind)below(4);
    (void)pt_estimate_mean(&p, &out);
    (void)pt_estimate_antithetic(&p, &out);
    (void)pt_estimate_importance(&p, technique, &out);
    (void)pt_estimate_control(&p, hostile_integrand, hostile(), hostile(), &out);
    (void)pt_estimate_mis(&p, technique, counts, one_in(4) ? hostile_int() % 3 : 2, (pt_heuristic)below(3),
                          &out);
    (void)pt_estimate_mis_one(&p, technique, shares, 2, (pt_heuristic)below(3), &out);
    (void)pt_estimate_roulette(&p, hostile(), &out);
    (void)pt_estimate_splitting(&p, one_in(2) ? hostile_int() : 1, one_in(2) ? hostile_int() % 100 : 2, &out);
}

/* Warps are promised for u in [0,1)^2. */
static void warps(void)
{
    const pt_real x = pt_real_from_u32(one_in(4) ? 0xffffffffu : pt_pcg32_next(&rng));
    const pt_vec2 u = pt_v2(x, pt_real_from_u32(one_in(4) ? 0 : pt_pcg32_next(&rng)));
    pt_spherical_triangle triangle;
    pt_spherical_rectangle rectangle;
    pt_vec3 w;
    (void)pt_warp_disk(u);
    (void)pt_warp_hemisphere_pdf_w(pt_warp_hemisphere(u));
    w = pt_warp_cosine(u);
    wrong += !(pt_warp_cosine_pdf_w(w) > 0);
    (void)pt_warp_sphere(u);
    (void)pt_warp_cone(u, hostile());
    (void)pt_warp_cone_pdf_w(hostile());
    (void)pt_warp_triangle(u);
    (void)pt_spherical_triangle_make(&triangle, hostile3(), hostile3(), hostile3(), hostile3());
    (void)pt_spherical_triangle_sample(&triangle, u);
    (void)pt_spherical_rectangle_make(&rectangle, hostile3(), hostile3(), hostile3(), hostile3());
    (void)pt_spherical_rectangle_sample(&rectangle, u);
    (void)pt_filter_sample((pt_filter)below(3), hostile(), u);
}

static void tables(void)
{
    double weights[20];
    const uint32_t n = below(21);
    pt_alias table;
    uint32_t i;
    double pmf = 1;
    for (i = 0; i < n; i++) weights[i] = one_in(20) ? hostile() : pt_pcg32_double(&rng);
    if (pt_alias_make(&table, weights, n, NULL) != PT_OK) return;
    for (i = 0; i < 4 && table.count > 0; i++) {
        wrong += pt_alias_sample(&table, i == 3 ? 1 - 0x1p-53 : pt_pcg32_double(&rng), &pmf) >= n;
        wrong += !(pmf > 0);
    }
    pt_alias_free(&table, NULL);
}

static void radiometry(void)
{
    pt_vec3 v[33];
    double nm[4], value[4], xyz[3];
    pt_spectrum spectrum = {nm, value, (int)below(5), 0};
    int i;
    for (i = 0; i < 33; i++) v[i] = hostile3();
    for (i = 0; i < 4; i++) {
        nm[i] = 300 + 100 * i + 90 * pt_pcg32_double(&rng);
        value[i] = hostile();
    }
    spectrum.zero_outside = (int)below(2);
    (void)pt_solid_angle_triangle(v[0], v[1], v[2], v[3]);
    (void)pt_solid_angle_rectangle(v[0], v[1], v[2], v[3]);
    (void)pt_solid_angle_polygon(v[0], v, (int)below(34));
    (void)pt_irradiance_polygon(hostile(), v[0], v[1], v, one_in(4) ? hostile_int() : (int)below(34));
    (void)pt_solid_angle_disk(hostile(), hostile(), hostile());
    (void)pt_solid_angle_cap(hostile());
    (void)pt_irradiance_sphere(hostile(), hostile(), hostile(), hostile());
    (void)pt_irradiance_disk(hostile(), hostile(), hostile(), hostile());
    (void)pt_irradiance_point(hostile(), hostile(), hostile());
    (void)pt_spot_falloff(hostile(), hostile(), hostile());
    (void)pt_flux_spot(hostile(), hostile(), hostile());
    (void)pt_radiance_of_flux(hostile(), hostile());
    (void)pt_watts_from_lumens(hostile(), hostile_rgb());
    (void)pt_form_factor_parallel(hostile(), hostile(), hostile());
    (void)pt_form_factor_perpendicular(hostile(), hostile(), hostile());
    (void)pt_form_factor_disks(hostile(), hostile(), hostile());
    (void)pt_form_factor_sphere_disk(hostile(), hostile());
    (void)pt_blackbody(hostile(), hostile());
    (void)pt_spectrum_at(&spectrum, hostile());
    pt_cie_xyz(hostile(), xyz);
    (void)pt_cie_d65(hostile());
    (void)pt_xyz_to_rgb(xyz);
}

static void fresnels(void)
{
    double cos_t;
    (void)pt_fresnel_dielectric(hostile(), hostile(), &cos_t);
    (void)pt_fresnel_make(hostile(), hostile());
    (void)pt_fresnel_schlick(hostile(), hostile());
#ifdef FUZZ_ALL /* an index below 0 and its inverse call each other for ever */
    if (one_in(50)) (void)pt_fresnel_diffuse(hostile());
#else
    if (one_in(50)) (void)pt_fresnel_diffuse(fabs(hostile()));
#endif
#if PTI_HAS_MICROFACET
    (void)pt_fresnel_conductor(hostile(), hostile(), hostile());
    (void)pt_ggx_d(hostile3(), hostile());
    (void)pt_ggx_g1(hostile3(), hostile());
    (void)pt_ggx_visible_pdf_w(hostile3(), hostile3(), hostile());
    (void)pt_ggx_visible_sample(hostile3(), hostile(), hostile2());
#endif
}

#if PTI_HAS_BVH
static void trees(void)
{
    pt_vec3 lo[40], hi[40];
    const uint32_t n = below(41);
    uint32_t i;
    pt_bvh bvh;
    for (i = 0; i < n; i++) { /* finite and in order, as promised by the caller */
        const pt_vec3 p = pt_v3((pt_real)ldexp(pt_pcg32_double(&rng), (int)below(60) - 30),
                                (pt_real)(int)below(3), (pt_real)1e18);
        lo[i] = p;
        hi[i] = pt_v3_add(p, pt_v3((pt_real)below(2), 0, (pt_real)(1e18 * below(2))));
    }
    if (pt_bvh_build(&bvh, lo, hi, n, NULL) == PT_OK) wrong += bvh.depth > PT_BVH_MAX_DEPTH;
    pt_bvh_free(&bvh, NULL);
}
#endif

#if PTI_HAS_LPE
static void expressions(void)
{
    static const char alphabet[] = "LDGSVE.()|*+?[]x";
    char text[4][80];
    const char *list[4], *error = NULL;
    pt_lpe lpe;
    int i, k, n;
    for (i = 0; i < 4; i++) {
        n = (int)below(one_in(8) ? 79 : 12);
        for (k = 0; k < n; k++) text[i][k] = alphabet[below(16)];
        text[i][n] = '\0';
        list[i] = text[i];
    }
    if (pt_lpe_compile(&lpe, list, one_in(8) ? hostile_int() % 5 : 1 + (int)below(4), &error) == PT_OK)
        (void)pt_lpe_class(&lpe, text[3]);
}
#endif

/* ---- scenes, films, pictures -------------------------------------------------------------------------------- */

static int hostile_material(pt_scene *scene)
{
    pt_material m;
    memset(&m, 0, sizeof m);
    m.kind = one_in(60) ? (pt_material_kind)(below(20)) : (pt_material_kind)below(PT_MATERIAL_MEASURED);
    m.albedo = mild_rgb();
    if (one_in(3)) m.emission = mild_rgb();
    m.ior = one_in(2) ? 0 : (pt_real)1 + mild_real(2);
    m.roughness = one_in(2) ? 0 : mild_real(1);
    m.eta = pt_rgb_add(mild_rgb(), pt_rgb_grey((pt_real)0.1));
    m.k = mild_rgb();
    if (m.kind == PT_MATERIAL_PHONG || m.kind == PT_MATERIAL_BLINN) {
        m.albedo = pt_rgb_scale(m.albedo, (pt_real)0.5);
        m.specular = pt_rgb_scale(mild_rgb(), (pt_real)0.5);
        m.exponent = mild_real(1000);
    }
    return pt_add_material(scene, m);
}

static void hostile_mesh(pt_scene *scene, int material)
{
    pt_vec3 v[8], n[8];
    pt_vec2 uv[8];
    uint32_t index[12];
    int i;
    for (i = 0; i < 8; i++) {
        v[i] = mild3();
        n[i] = mild3();
        uv[i] = one_in(9) ? hostile2() : pt_v2((pt_real)i, 1);
    }
    for (i = 0; i < 12; i++) index[i] = one_in(60) ? (uint32_t)hostile_int() : below(8);
    pt_add_mesh(scene, v, one_in(2) ? n : NULL, one_in(2) ? uv : NULL, 8, index, 4, material);
}

static void hostile_item(pt_scene *scene, int materials)
{
    const int m = one_in(60) ? hostile_int() : (int)below((uint32_t)materials + (materials == 0));
    switch (below(9)) {
    case 0:
        pt_add_sphere(scene, mild3(), mild_real(1), m);
        break;
    case 1:
        pt_add_parallelogram(scene, mild3(), mild3(), mild3(), m);
        break;
    case 2:
        pt_add_triangle(scene, mild3(), mild3(), mild3(), m);
        break;
    case 3:
        pt_add_quad(scene, mild3(), mild3(), mild3(), mild3(), m);
        break;
    case 4:
        hostile_mesh(scene, m);
        break;
    case 5:
        pt_add_point_light(scene, mild3(), mild_rgb());
        break;
    case 6:
        pt_add_spot_light(scene, mild3(), mild3(), mild_rgb(), one_in(9) ? hostile() : 10,
                          one_in(9) ? hostile() : 30);
        break;
    case 7:
        pt_add_directional_light(scene, mild3(), mild_rgb());
        break;
    default:
#if PTI_HAS_ENVIRONMENT
        if (one_in(2))
            pt_set_environment(scene, mild_rgb());
        else {
            float rgb[24];
            int i;
            for (i = 0; i < 24; i++) rgb[i] = one_in(200) ? (float)hostile_real() : (float)below(3);
            pt_set_environment_image(scene, rgb, one_in(20) ? hostile_int() % 3 : 4,
                                     one_in(20) ? hostile_int() % 3 : 2, one_in(9) ? hostile() : 1);
        }
#endif
        break;
    }
}

static void ask_scene(const pt_scene *scene)
{
    const pt_ray ray =
        one_in(2) ? hostile_ray() : pt_spawn_ray(mild3(), pt_v3(0, 0, 0), pt_v3(0, 1, 0), mild3());
    pt_light_sample_result ls;
    pt_light_emission_result le;
    pt_bsdf_sample_result bs;
    double a, w;
    pt_hit hit;
    if (pt_intersect(scene, &ray, &hit)) {
        const pt_bsdf b = pt_bsdf_make(&scene->materials[hit.material], &hit);
        const pt_vec3 wo = pt_v3_neg(pt_v3_normalize(ray.d)), wi = pt_v3_normalize(mild3());
        const pt_real x = pt_real_from_u32(pt_pcg32_next(&rng));
        (void)pt_bsdf_eval(&b, wo, wi, PT_RADIANCE, PT_LOBE_ALL);
        (void)pt_bsdf_pdf_w(&b, wo, wi, PT_IMPORTANCE);
        (void)pt_bsdf_sample(&b, wo, pt_pcg32_double(&rng), pt_v2(x, x), PT_RADIANCE, &bs);
        (void)pt_hit_emission(scene, &hit, wo);
    }
    (void)pt_occluded(scene, &ray);
    if (scene->light_count > 0) {
        const int light = (int)below(scene->light_count);
        const pt_real x = pt_real_from_u32(pt_pcg32_next(&rng)), y = pt_real_from_u32(pt_pcg32_next(&rng));
        (void)pt_light_choose(scene, pt_pcg32_double(&rng), &a);
        (void)pt_light_sample(scene, light, one_in(2) ? hostile3() : mild3(), pt_v2(x, y), &ls);
        if (pt_light_sample_le(scene, light, pt_v2(x, y), pt_v2(y, x), x, &le))
            pt_light_pdf_le(scene, light, le.n, le.w, &a, &w);
    }
}

static int give_up(void *user, const pt_progress *p)
{
    (void)user;
    return p->seconds > 0.2; /* a closed room of albedo 1 takes its time */
}
static int give_up_path(void *user)
{
    (void)user;
    return 1; /* after 2^16 edges */
}

static void hostile_picture(const pt_scene *scene)
{
    pt_render_desc desc = pt_render_defaults();
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    int count, x;
    const pt_method *const methods = pt_methods(&count);
    pt_result result;
    desc.camera = pt_camera_look_at(mild3(), mild3(), mild3(), one_in(9) ? hostile_real() : 50);
    if (one_in(9)) desc.camera.lens_radius = hostile_real();
    if (one_in(9)) desc.camera.near_distance = hostile_real();
    desc.width = one_in(20) ? hostile_int() % 65 : 4;
    desc.height = one_in(20) ? hostile_int() % 65 : 3;
    desc.spp = 1 + below(3);
    desc.threads = one_in(20) ? hostile_int() % 5 : 1;
    desc.tile = one_in(20) ? hostile_int() : 0;
    desc.method = one_in(20) ? "none such" : methods[below((uint32_t)count)].name;
    desc.sampler = (pt_sampler_kind)below(4);
    desc.filter = (pt_filter)below(4);
    desc.filter_radius = one_in(9) ? hostile() : 0;
    desc.li.max_edges = one_in(20) ? hostile_int() : 1 + (int)below(6);
    desc.li.roulette = (pt_roulette)below(4);
    desc.li.roulette_survival = one_in(9) ? hostile_real() : 0;
    desc.li.heuristic = (pt_heuristic)below(4);
    desc.li.branching = 1 + (int)below(3);
    desc.li.poll = give_up_path;
    desc.progress = give_up;
    desc.aov = (int)below(2);
    desc.seconds = one_in(20) ? hostile() : 0.2;
    if (one_in(20)) desc.target_error = hostile();
    result = pt_render(scene, &desc, &film, &report);
    if (result == PT_ERROR_ARGUMENT) wrong += report.error == NULL;
    if (result == PT_OK)
        for (x = 0; x < film.width; x++) {
            const pt_rgbd c = pt_film_pixel(&film, x, 0);
            wrong += !(fabs(c.r + c.g + c.b) < HUGE_VAL);
        }
    pt_film_free(&film);
    pt_report_free(&report);
}

static void scenes(void)
{
    pt_scene scene = PT_SCENE_INIT;
    const int materials = (int)below(4);
    int i, n = (int)below(12);
    pt_result result;
    for (i = 0; i < materials; i++) hostile_material(&scene);
    for (i = 0; i < n; i++) hostile_item(&scene, materials);
    result = pt_commit(&scene);
    wrong += result != PT_OK && strlen(pt_scene_error(&scene)) < 8;
    if (result == PT_OK) {
        for (i = 0; i < 8; i++) ask_scene(&scene);
        hostile_picture(&scene);
    } else {
        pt_render_desc desc = pt_render_defaults();
        pt_film film = PT_FILM_INIT;
        wrong += pt_render(&scene, &desc, &film, NULL) == PT_OK;
        pt_film_free(&film);
    }
    pt_scene_free(&scene);
}

static void cameras(void)
{
    pt_camera c = pt_camera_look_at(one_in(2) ? hostile3() : mild3(), mild3(), hostile3(), hostile_real());
    pt_camera_we_result we;
    double a, w;
    (void)pt_vfov_deg_of_film(hostile(), hostile());
    if (one_in(2)) c.lens_radius = hostile_real();
    if (one_in(2)) c.focus_distance = hostile_real();
    (void)pt_camera_ray(&c, hostile_real(), hostile_real(), hostile_real(), hostile2());
    (void)pt_camera_we(&c, hostile_real(), hostile3(), hostile2(), &we);
    pt_camera_pdf(&c, hostile_real(), hostile3(), &a, &w);
}

static void films(void)
{
    pt_film a = PT_FILM_INIT, b = PT_FILM_INIT;
    pt_splat_list list = PT_SPLAT_LIST_INIT;
    pt_error error;
    int i;
    const int w = one_in(3) ? hostile_int() % 100 : 3, h = one_in(3) ? hostile_int() % 100 : 2;
    if (pt_film_make(&a, w, h, (int)below(2)) != PT_OK || pt_film_make(&b, 3, 2, 0) != PT_OK) {
        pt_film_free(&a);
        return;
    }
    for (i = 0; i < 4; i++)
        (void)pt_film_add_range(&a, pt_pcg32_next(&rng) >> below(32), pt_pcg32_next(&rng) >> below(32));
    for (i = 0; i < 4; i++)
        (void)pt_splat_add(&list, below((uint32_t)(a.width * a.height)), below(2), hostile_rgb());
    (void)pt_film_add_splats(&a, &list);
    (void)pt_film_merge(&a, &b);
    (void)pt_film_make_classes(&a, hostile_int() % 20);
    (void)pt_film_class(&a, hostile_int(), &b);
    (void)pt_film_error_estimate(&a, &error);
    (void)pt_film_pixel(&a, 0, 0);
#if PTI_HAS_FILES
    if (one_in(8)) {
        const char *const path = "build/fuzz.film";
        (void)pt_write_ppm_as(path, &a, hostile(), (pt_ppm_kind)hostile_int());
        if (pt_film_write(path, &a) == PT_OK) wrong += pt_film_read(path, &b) != PT_OK || b.width != a.width;
        remove(path);
    }
#endif
    pt_splat_list_free(&list);
    pt_film_free(&a);
    pt_film_free(&b);
}

#if PTI_HAS_FILES
static void files(void)
{
    static const char *const heads[6] = {"P6\n3 2\n255\n", "PF\n3 2\n-1.0\n",
                                         "PF\n3 2\n1.0\n", "P6\n65536 65536\n255\n",
                                         "PF\n-3 2\n0\n",  "P6 # x\n99999999999 1\n65536\n"};
    const char *const path = "build/fuzz.bin";
    unsigned char bytes[160];
    size_t n = strlen(heads[0]);
    pt_image image = PT_IMAGE_INIT;
    FILE *file = fopen(path, "wb");
    uint32_t k, length = below(160);
    if (!file) return;
    for (k = 0; k < 160; k++) bytes[k] = (unsigned char)below(256);
    k = below(6);
    n = strlen(heads[k]);
    memcpy(bytes, heads[k], n);
    for (k = below(4); k > 0; k--) bytes[below(20)] = (unsigned char)below(256);
    (void)fwrite(bytes, 1, length, file);
    fclose(file);
    if (pt_read_image(path, &image) == PT_OK)
        wrong += image.rgb == NULL || image.width < 1 || image.height < 1;
    else
        wrong += image.rgb != NULL;
    pt_image_free(&image);
    remove(path);
}
#endif

#if PTI_HAS_OBJ
/* Small models that are in order, placed as nobody should. */
static void models(void)
{
    const char *const path = "build/fuzz.obj";
    pt_scene scene = PT_SCENE_INIT;
    pt_obj_options options = PT_OBJ_OPTIONS_INIT;
    pt_obj_info info;
    pt_result result;
    FILE *const file = fopen(path, "wb");
    uint32_t i, k;
    if (!file) return;
    fprintf(file, "v %g %g %g\nv %g %g %g\nv %g 1 0\nv 0 %g 1\nvn %g %g %g\nvt %g %g\nf 1/1/1 2/1/1 3/1/1 4/1/1\nf 1 2 3\n",
            hostile(), hostile(), hostile(), hostile(), hostile(), hostile(), hostile(), hostile(), hostile(), hostile(),
            hostile(), hostile(), hostile());
    fclose(file);
    for (i = 0; i < 3; i++)
        for (k = 0; k < 4; k++) options.transform[i][k] = one_in(3) ? hostile() : i == k;
    options.emission_scale = one_in(2) ? hostile() : 1;
    options.flags = below(8);
    options.material = hostile_int();
    result = pt_load_obj(&scene, path, &options, &info);
    wrong += result == PT_OK ? pt_commit(&scene) != PT_OK || info.triangles != scene.triangle_count : info.error[0] == 0 || scene.triangle_count > 0;
    pt_scene_free(&scene);
    remove(path);
}
#endif

typedef struct target {
    const char *name;
    void (*call)(void);
    int often;     /* calls in a turn */
    int functions; /* public functions that a call makes, about */
} target;

static const target TARGETS[] = {{"shapes and rays", shapes, 64, 6},
                                 {"vectors and colour", vectors, 64, 9},
                                 {"samplers", samplers, 32, 20},
                                 {"statistics", statistics, 16, 21},
                                 {"estimates", estimates, 1, 8},
                                 {"warps", warps, 32, 14},
                                 {"tables", tables, 32, 6},
                                 {"radiometry", radiometry, 16, 22},
                                 {"Fresnel and GGX", fresnels, 32, 9},
#if PTI_HAS_BVH
                                 {"trees", trees, 16, 2},
#endif
#if PTI_HAS_LPE
                                 {"light-path expressions", expressions, 8, 2},
#endif
                                 {"cameras", cameras, 32, 5},
                                 {"films", films, 8, 14},
#if PTI_HAS_FILES
                                 {"image files", files, 1, 2},
#endif
#if PTI_HAS_OBJ
                                 {"models", models, 4, 1},
#endif
                                 {"scenes and pictures", scenes, 4, 60}};
enum { TARGET_COUNT = sizeof TARGETS / sizeof TARGETS[0] };

int main(int argc, char **argv)
{
    const double seconds = argc > 1 ? atof(argv[1]) : 10, start = pt_wall_seconds();
    unsigned long calls[TARGET_COUNT] = {0}, all = 0;
    int k, i;
    rng = pt_pcg32_make(argc > 2 ? strtoull(argv[2], NULL, 10) : 1, 1);
    while (pt_wall_seconds() - start < seconds)
        for (k = 0; k < TARGET_COUNT; k++)
            for (i = 0; i < TARGETS[k].often; i++) {
                const unsigned long before = wrong;
                TARGETS[k].call();
                calls[k] += (unsigned long)TARGETS[k].functions;
                if (wrong != before && wrong < 20) printf("FAIL   %s broke a promise\n", TARGETS[k].name);
            }
    for (k = 0; k < TARGET_COUNT; k++) {
        printf("%12lu calls  %s\n", calls[k], TARGETS[k].name);
        all += calls[k];
    }
    printf("%lu calls in %.0f s, %lu broke a promise\n", all, pt_wall_seconds() - start, wrong);
    printf("fuzz: %d passed, %d failed\n", wrong == 0, wrong != 0);
    return wrong != 0;
}
