/* pt_means.h: estimates by randomised Sobol points, one value a point, and the small things that programs of
   such estimates share. */

#ifndef PT_MEANS_H
#define PT_MEANS_H

#include "pt_rows.h"

#define BOUND 0.005        /* what all checks must be able to see but those that name their own */
#define RANDOMISATIONS 64u /* of the Sobol points of an estimate; their spread gives the error */

static inline int is_float(void) { return sizeof(pt_real) == sizeof(float); }
static inline pt_real real(double x) { return (pt_real)x; }
static inline pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }
static inline pt_rgb grey(double x) { return pt_rgb_grey((pt_real)x); }
static inline double degrees(double x) { return x * (PT_PI / 180); }
static inline double dot(pt_vec3 a, pt_vec3 b)
{
    return (double)a.x * (double)b.x + (double)a.y * (double)b.y + (double)a.z * (double)b.z;
}
/* How far the numbers of a build may carry a value away: coordinates and random numbers of 24 bits, or of
   53 and 32. */
static inline double rounding(void) { return is_float() ? 1e-6 : 1e-9; }

static inline const char *row_label(const char *id, const char *what)
{
    static char text[96];
    snprintf(text, sizeof text, "%s %s", id, what);
    return text;
}

static inline void commit(pt_scene *scene)
{
    pt_check(pt_commit(scene) == PT_OK, "scene", "%s", pt_scene_error(scene));
}

static inline int lamp(pt_scene *scene, double radiance)
{
    return pt_add_material(scene, pt_material_emitter(grey(radiance)));
}
static inline int wall(pt_scene *scene, double albedo)
{
    return pt_add_material(scene, pt_material_diffuse(grey(albedo)));
}
static inline int glowing(pt_scene *scene, double albedo, double radiance)
{
    pt_material m = pt_material_diffuse(grey(albedo));
    m.emission = grey(radiance);
    return pt_add_material(scene, m);
}

static inline pt_ray ray_from(pt_vec3 p, pt_vec3 d)
{
    pt_ray ray;
    ray.o = p;
    ray.d = d;
    ray.tmax = real(HUGE_VAL);
    return ray;
}

/* A ray from a point whose coordinates were rounded, to the side of w. */
static inline pt_ray leave(pt_vec3 p, pt_vec3 n, pt_vec3 w)
{
    const double largest = fmax(fabs((double)p.x), fmax(fabs((double)p.y), fabs((double)p.z)));
    const pt_real e = real(4 * pt_gamma(3) * fmax(1, 0.5 * largest));
    return pt_spawn_ray(p, pt_v3(e, e, e), n, w);
}
static inline pt_vec3 cosine_around(pt_vec3 n, pt_sampler *s)
{
    const pt_frame frame = pt_frame_from_normal(n);
    return pt_frame_to_world(&frame, pt_warp_cosine(pt_sampler_2d(s)));
}

/* An estimator draws its numbers in order and returns one value. */
typedef double (*estimator)(const void *user, pt_sampler *s);

static inline uint64_t seed_of(const char *name, uint32_t randomisation)
{
    uint64_t h = 0;
    for (; *name; name++) h = pt_hash64(h ^ (unsigned char)*name);
    return pt_test_seed(h + randomisation);
}

static inline pt_stats estimate(const char *name, estimator f, const void *user, uint32_t points)
{
    const uint32_t n = pt_test_samples(points);
    pt_stats s = PT_STATS_INIT;
    uint32_t r, i;
    for (r = 0; r < RANDOMISATIONS; r++) {
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, seed_of(name, r), 0);
        double sum = 0;
        for (i = 0; i < n; i++) {
            pt_sampler_start(&sampler, 0, i);
            sum += f(user, &sampler);
        }
        pt_stats_add(&s, sum / n);
    }
    return s;
}

/* error: of the exact value, relative, beyond rounding */
static inline void check_bound(const char *name, estimator f, const void *user, uint32_t points, double exact,
                               double error, double bound, const char *hint)
{
    const pt_stats s = estimate(name, f, user, points);
    pt_check_mean(name, &s, exact, (error + rounding()) * fabs(exact), bound, PT_TEST_MEANS, hint);
}

/* Counting hits of which a share p is expected. Points spread well make the error at most 3/4 of what
   binomial counts have (9 standard errors are seen). Where one coordinate decides alone, n well-spread points
   have one of two neighbouring counts, in all randomisations the same one if luck wants it: their scatter then
   says nothing. Such counts are no wilder than fair coins (W. Hoeffding, 1963), whose standard error, half a
   hit / sqrt(randomisations), is added as one of the exact value. */
static inline void check_count(const char *name, estimator f, const void *user, uint32_t points, double exact,
                               double p, double error, const char *hint)
{
    const double bound = 7 * sqrt((1 - p) / (p * points * RANDOMISATIONS));
    const double coin = 0.5 / (p * pt_test_samples(points) * sqrt(RANDOMISATIONS));
    check_bound(name, f, user, points, exact, sqrt(error * error + coin * coin), fmax(bound, 2 * BOUND), hint);
}

#endif /* PT_MEANS_H */
