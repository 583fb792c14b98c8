/* test_radiometry.c: solid angles, irradiance, photometry, black bodies and form factors ([PT-05]) against
   exact values, in two ways: the closed forms to the precision of double, and the same quantities as
   renderers estimate them - by sampling lights, by cosine-weighted and by uniform directions, by rays between
   surfaces, and by whole paths in closed cavities. The exact values stand in
   tests/data/oracles_radiometry.csv; at the end every row must have been used.

   What is not estimated, and why:
     RAD-SRGB, -SRGBTF, the units of RAD-PHOT, sigma, Wien's b and peaks of RAD-BB: conversions, no integrals.
     Hits that fewer than one direction in a hundred makes (RAD-CAP-001, RAD-SPH-003 and -004, RAD-RECT-004,
     RAD-DISK-005, RAD-ESPH-005, -008 and -009, VF-PAR-003, VF-SPHCAV-004): the other estimators serve.
     VF-CUBE6 (one radiosity a face) is not in the table: path tracing converges to VF-CUBE1 instead. */

#include "pt_means.h"

#include <float.h>

#define ROWS_PATH "tests/data/oracles_radiometry.csv"
#define POINTS 1024u /* in each randomisation of an estimate, */
#define MANY 2048u   /*   where only hits and misses are counted */
#define RARE 0.01    /* hits rarer than this are not counted */
#define SIDES 256    /* of the prism that stands for a cylinder, the polygon for a disk */
#define FAR 1e4      /* half the length of an infinite strip: what it misses is of order 1e-8 */
#define GRID 40      /* triangles along an edge of the octahedron that becomes a sphere */

static void check(const char *name, estimator f, const void *user, double exact, double error,
                  const char *hint)
{
    check_bound(name, f, user, POINTS, exact, error, BOUND, hint);
}

/* Hits of which a share p is expected; left out where they are rare. */
static void check_hits(const char *name, estimator f, const void *user, double exact, double p, double error,
                       const char *hint)
{
    if (p >= RARE) check_count(name, f, user, MANY, exact, p, error, hint);
}

/* ---------------------------------------------------------------------------------------------------------
   Irradiance, estimated in three ways at p with normal n */

typedef struct receiver {
    const pt_scene *scene;
    pt_vec3 p, n;
} receiver;

static double seen(const pt_scene *scene, const pt_ray *ray)
{
    pt_hit hit;
    if (!pt_intersect(scene, ray, &hit)) return (double)scene->environment.g;
    return (double)pt_hit_emission(scene, &hit, pt_v3_neg(ray->d)).g;
}

static double by_light(const void *user, pt_sampler *s)
{
    const receiver *const at = (const receiver *)user;
    const pt_vec2 u = pt_sampler_2d(s);
    const pt_vec3 exact = v3(0, 0, 0);
    pt_light_sample_result l;
    double pmf, cosine;
    const int light = pt_light_choose(at->scene, (double)pt_sampler_1d(s), &pmf);
    pt_ray shadow;
    if (light < 0 || !pt_light_sample(at->scene, light, at->p, u, &l)) return 0;
    cosine = dot(at->n, l.wi);
    if (!(cosine > 0)) return 0;
    shadow = light == at->scene->environment_light
                 ? ray_from(at->p, l.wi)
                 : pt_spawn_ray_to(at->p, exact, at->n, l.p, l.p_error, l.n);
    return pt_occluded(at->scene, &shadow) ? 0 : (double)l.radiance.g * cosine / (l.pdf_w * pmf);
}

static double by_cosine(const void *user, pt_sampler *s)
{
    const receiver *const at = (const receiver *)user;
    const pt_frame frame = pt_frame_from_normal(at->n);
    const pt_ray ray = ray_from(at->p, pt_frame_to_world(&frame, pt_warp_cosine(pt_sampler_2d(s))));
    return PT_PI * seen(at->scene, &ray);
}

static double by_hemisphere(const void *user, pt_sampler *s)
{
    const receiver *const at = (const receiver *)user;
    const pt_frame frame = pt_frame_from_normal(at->n);
    const pt_vec3 w = pt_warp_hemisphere(pt_sampler_2d(s));
    const pt_ray ray = ray_from(at->p, pt_frame_to_world(&frame, w));
    return seen(at->scene, &ray) * (double)w.z / (double)pt_warp_hemisphere_pdf_w(w);
}

/* All three; error: relative, of the scene's geometry. */
static void check_irradiance(const char *id, const receiver *at, uint32_t points, double exact, double error)
{
    check_bound(row_label(id, "by lights"), by_light, at, points, exact, error, BOUND,
                "irradiance by pt_light_sample");
    check_hits(row_label(id, "by cosine"), by_cosine, at, exact, exact / PT_PI, error,
               "irradiance by pt_warp_cosine");
    check_hits(row_label(id, "by hemisphere"), by_hemisphere, at, exact, 0.5 * exact / PT_PI, error,
               "irradiance by pt_warp_hemisphere");
}

/* ---------------------------------------------------------------------------------------------------------
   Solid angles. Coordinates of the table are taken a hundredfold: that changes no solid angle and makes
   them whole numbers, which float holds exactly. */

static pt_vec3 hundredfold(const double *v)
{
    return v3(floor(100 * v[0] + 0.5), floor(100 * v[1] + 0.5), floor(100 * v[2] + 0.5));
}

static double by_sphere(const void *user, pt_sampler *s)
{
    const receiver *const at = (const receiver *)user;
    const pt_ray ray = ray_from(at->p, pt_warp_sphere(pt_sampler_2d(s)));
    return (seen(at->scene, &ray) > 0) / (double)pt_warp_sphere_pdf_w();
}

/* A light seen from the origin: its density is 1 / solid angle everywhere; directions hit it so often. */
static void check_lamp(const row *r, pt_scene *scene)
{
    static const pt_real u[3] = {0, (pt_real)0.375, (pt_real)0.875};
    receiver at = {scene, {0, 0, 0}, {0, 0, 1}};
    pt_light_sample_result l;
    int i;
    commit(scene);
    for (i = 0; i < 9; i++) {
        const int found = pt_light_sample(scene, 0, at.p, pt_v2(u[i / 3], u[i % 3]), &l);
        near_relative(row_label(r->id, "1 / pdf_w"), found ? 1 / l.pdf_w : 0, r->value, 1e-13);
    }
    check_hits(row_label(r->id, "by hits"), by_sphere, &at, r->value, r->value / (4 * PT_PI), 0,
               "solid angle by pt_warp_sphere");
    pt_scene_free(scene);
}

static void solid_angles_of_spheres(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-CAP, RAD-SPH, elementary");
    const row *r;
    int at;
    for (at = 0; (r = next_row("RAD-CAP", NULL, &at)) != NULL;) {
        const double a = degrees(parameter(r, "a_deg")), s = sin(a / 2);
        near_relative(row_label(r->id, "closed"), pt_solid_angle_cap(a), r->value, 1e-15);
        near_relative(row_label(r->id, "density of the cone"), 1 / pt_warp_cone_pdf_w(2 * s * s), r->value,
                      1e-15);
    }
    for (at = 0; (r = next_row("RAD-SPH", NULL, &at)) != NULL;) {
        const double radius = parameter(r, "R"), d = parameter(r, "d");
        pt_scene scene = PT_SCENE_INIT;
        near_relative(row_label(r->id, "closed"), pt_solid_angle_cap(asin(radius / d)), r->value, 1e-15);
        pt_add_sphere(&scene, v3(0, 0, d), real(radius), lamp(&scene, 1));
        check_lamp(r, &scene);
    }
}

static double in_cap(const void *user, pt_sampler *s)
{
    return ((double)pt_warp_sphere(pt_sampler_2d(s)).z > *(const double *)user) /
           (double)pt_warp_sphere_pdf_w();
}

static void directions_in_caps(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-CAP, elementary: 2 pi (1 - cos a)");
    const row *r;
    int at = 0;
    while ((r = next_row("RAD-CAP", NULL, &at)) != NULL) {
        const double c = cos(degrees(parameter(r, "a_deg")));
        check_hits(row_label(r->id, "by directions"), in_cap, &c, r->value, r->value / (4 * PT_PI), 0,
                   "pt_warp_sphere is not uniform");
    }
}

/* Facing the origin whatever the order of the corners was. */
static void add_facing(pt_scene *scene, pt_vec3 a, pt_vec3 b, pt_vec3 c, int material)
{
    const pt_vec3 n = pt_v3_cross(pt_v3_sub(b, a), pt_v3_sub(c, a));
    if (dot(n, a) < 0)
        pt_add_triangle(scene, a, b, c, material);
    else
        pt_add_triangle(scene, a, c, b, material);
}

static void solid_angles_of_flat_shapes(void)
{
    pt_test_source(
        "tests/data/oracles_radiometry.csv: RAD-TRI (Van Oosterom and Strackee 1983), RAD-RECT, elementary");
    const pt_vec3 o = v3(0, 0, 0);
    const row *r;
    int at;
    for (at = 0; (r = next_row("RAD-TRI", NULL, &at)) != NULL;) {
        double n[9];
        pt_scene scene = PT_SCENE_INIT;
        pt_vec3 v[3];
        int i;
        for (i = numbers(r, "a", n, 3) - 3; i < 3; i++) {
            static const char *const corner[3] = {"a", "b", "c"};
            numbers(r, corner[i], n, 3);
            v[i] = hundredfold(n);
        }
        near_relative(row_label(r->id, "closed"), pt_solid_angle_triangle(o, v[0], v[1], v[2]), r->value,
                      2e-15);
        near_relative(row_label(r->id, "turned"), pt_solid_angle_triangle(o, v[2], v[1], v[0]), r->value,
                      2e-15);
        near_relative(row_label(r->id, "polygon"), pt_solid_angle_polygon(o, v, 3), r->value, 2e-15);
        add_facing(&scene, v[0], v[1], v[2], lamp(&scene, 1));
        check_lamp(r, &scene);
    }
    for (at = 0; (r = next_row("RAD-RECT", NULL, &at)) != NULL;) {
        const double low[3] = {parameter(r, "x0"), parameter(r, "y0"), parameter(r, "h")};
        const double high[3] = {parameter(r, "x1"), parameter(r, "y1"), parameter(r, "h")};
        const pt_vec3 a = hundredfold(low), c = hundredfold(high);
        const pt_vec3 v[4] = {a, pt_v3(c.x, a.y, a.z), c, pt_v3(a.x, c.y, a.z)};
        const pt_vec3 ex = pt_v3_sub(v[1], a), ey = pt_v3_sub(v[3], a);
        pt_scene scene = PT_SCENE_INIT;
        near_relative(row_label(r->id, "closed"), pt_solid_angle_rectangle(o, a, ex, ey), r->value, 1e-14);
        near_relative(row_label(r->id, "polygon"), pt_solid_angle_polygon(o, v, 4), r->value, 1e-14);
        pt_add_parallelogram(&scene, a, ey, ex, lamp(&scene, 1));
        check_lamp(r, &scene);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Disks: integrals over pt_warp_disk, and rays to a polygon of the same area */

typedef struct disk {
    double r, h, offset;
} disk;

static double squared_distance(const disk *d, pt_sampler *s)
{
    const pt_vec2 p = pt_warp_disk(pt_sampler_2d(s));
    const double x = d->offset + d->r * (double)p.x, y = d->r * (double)p.y;
    return x * x + y * y + d->h * d->h;
}
static double disk_solid_angle(const void *user, pt_sampler *s)
{
    const disk *const d = (const disk *)user;
    return d->r * d->r * d->h / pow(squared_distance(d, s), 1.5) / (double)pt_warp_disk_pdf_a();
}
static double disk_irradiance(const void *user, pt_sampler *s)
{
    const disk *const d = (const disk *)user;
    return pow(d->r * d->h / squared_distance(d, s), 2) / (double)pt_warp_disk_pdf_a();
}

static pt_vec3 rim(double r, double y, int i)
{
    const double corner = r * sqrt(2 * PT_PI / SIDES / sin(2 * PT_PI / SIDES));
    const double phi = 2 * PT_PI * (i % SIDES) / SIDES;
    return v3(corner * cos(phi), y, corner * sin(phi));
}

/* At height y around the y axis, its normal down or up. */
static void add_disk(pt_scene *scene, double r, double y, int up, int material)
{
    int i;
    for (i = 0; i < SIDES; i++)
        pt_add_triangle(scene, v3(0, y, 0), rim(r, y, up ? i + 1 : i), rim(r, y, up ? i : i + 1), material);
}

/* One value of the irradiance under a disk, in four ways, and its squared difference from the mean. All four
   have the same mean; what differs is the variance, by which a technique is chosen. */
enum { BY_HEMISPHERE, BY_COSINE, BY_AREA, BY_CONE };

typedef struct disk_technique {
    disk d;
    int how;
    double mean;
} disk_technique;

static double one_value_under_disk(const disk_technique *t, pt_sampler *s)
{
    const double tangent = t->d.r / t->d.h, half = atan(tangent);
    const pt_vec2 u = pt_sampler_2d(s);
    pt_vec3 w;
    if (t->how == BY_AREA) {
        const pt_vec2 p = pt_warp_disk(u);
        const double q = tangent * tangent * ((double)p.x * (double)p.x + (double)p.y * (double)p.y);
        return tangent * tangent / ((1 + q) * (1 + q)) / (double)pt_warp_disk_pdf_a();
    }
    if (t->how == BY_CONE) {
        const double omc = 2 * sin(half / 2) * sin(half / 2);
        return (double)pt_warp_cone(u, omc).z / pt_warp_cone_pdf_w(omc);
    }
    w = t->how == BY_COSINE ? pt_warp_cosine(u) : pt_warp_hemisphere(u);
    if ((double)w.z < cos(half)) return 0;
    return (double)w.z / (double)(t->how == BY_COSINE ? pt_warp_cosine_pdf_w(w) : pt_warp_hemisphere_pdf_w(w));
}
static double squared_deviation(const void *user, pt_sampler *s)
{
    const disk_technique *const t = (const disk_technique *)user;
    const double x = one_value_under_disk(t, s) - t->mean;
    return x * x;
}

/* Below the centre of a disk of half angle a: E = pi sin^2 a. Second moments: 4 pi^2 (1 - cos^3 a) / 3 by
   uniform directions, pi^2 sin^2 a by cosine-weighted ones, pi^2 tan^2 a (1 - cos^6 a) / 3 by points uniform in
   area, 4 pi^2 (1 - cos a) (1 - cos^3 a) / 3 by directions uniform in the cone. */
static void disk_variances(void)
{
    static const char *const names[4] = {"uniform directions", "cosine-weighted", "uniform in area",
                                         "uniform in the cone"};
    static const double radius[2] = {1, 3};
    int i, k;
    for (i = 0; i < 2; i++) {
        const double a = atan(radius[i]), c = cos(a), s2 = sin(a) * sin(a), pi2 = PT_PI * PT_PI;
        const double second[4] = {4 * pi2 * (1 - c * c * c) / 3, pi2 * s2,
                                  pi2 * radius[i] * radius[i] * (1 - pow(c, 6)) / 3,
                                  4 * pi2 * (1 - c) * (1 - c * c * c) / 3};
        for (k = 0; k < 4; k++) {
            disk_technique t = {{0, 1, 0}, 0, 0};
            t.d.r = radius[i];
            t.how = k;
            t.mean = PT_PI * s2;
            check_bound(label("variance under a disk of radius %g, %s", radius[i], names[k]),
                        squared_deviation, &t, 8 * POINTS, second[k] - t.mean * t.mean, 0, 2 * BOUND,
                        "the density of a warp is not the one that its directions have");
        }
    }
}

static void disks(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-DISK (Paxton 1959), RAD-EDISK (Howell 2010)");
    const row *r;
    int at;
    for (at = 0; (r = next_row("RAD-DISK", NULL, &at)) != NULL;) {
        const disk d = {parameter(r, "R"), parameter(r, "h"), parameter(r, "r0")};
        receiver below = {NULL, {0, 0, 0}, {0, 1, 0}};
        pt_scene scene = PT_SCENE_INIT;
        below.p.x = real(d.offset);
        below.scene = &scene;
        near_relative(row_label(r->id, "closed"), pt_solid_angle_disk(d.r, d.h, d.offset), r->value, 2e-15);
        check(row_label(r->id, "by area"), disk_solid_angle, &d, r->value, 0, "cos / d^2 over pt_warp_disk");
        add_disk(&scene, d.r, d.h, 0, lamp(&scene, 1));
        commit(&scene);
        check_hits(row_label(r->id, "by hits"), by_sphere, &below, r->value, r->value / (4 * PT_PI), 1e-5,
                   "solid angle by pt_warp_sphere");
        pt_scene_free(&scene);
    }
    for (at = 0; (r = next_row("RAD-EDISK", NULL, &at)) != NULL;) {
        const disk d = {parameter(r, "R"), parameter(r, "h"), parameter(r, "r")};
        receiver below = {NULL, {0, 0, 0}, {0, 1, 0}};
        pt_scene scene = PT_SCENE_INIT;
        below.p.x = real(d.offset);
        below.scene = &scene;
        near_relative(row_label(r->id, "closed"), pt_irradiance_disk(1, d.r, d.h, d.offset), r->value, 3e-15);
        check_bound(row_label(r->id, "by area"), disk_irradiance, &d, d.h < 0.5 ? 16 * POINTS : POINTS,
                    r->value, 0, BOUND, "cos cos / d^2 over pt_warp_disk");
        add_disk(&scene, d.r, d.h, 0, lamp(&scene, 1));
        commit(&scene);
        check_irradiance(r->id, &below, d.h < 0.5 ? 4 * POINTS : POINTS, r->value, 1e-4);
        pt_scene_free(&scene);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Point lights, spots, spheres, polygons, skies */

static double intensity_of(const row *r)
{
    const char *const text = pt_case_find(r->params, "I", '=');
    return strtod(text, NULL) / (strncmp(text + strcspn(text, "/;"), "/4pi", 4) == 0 ? 4 * PT_PI : 1);
}

static void point_lights(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("RAD-POINT", "E", &at)) != NULL) {
        const double i = intensity_of(r), d = parameter(r, "d"), theta = degrees(parameter(r, "theta_deg"));
        const pt_vec3 n = v3(sin(theta), cos(theta), 0);
        pt_light_sample_result l;
        pt_scene scene = PT_SCENE_INIT;
        near_relative(row_label(r->id, "closed"), pt_irradiance_point(i, d, cos(theta)), r->value, 1e-15);
        pt_check(pt_irradiance_point(i, d, -cos(theta)) == 0, r->id, "light from below the horizon counts");
        pt_add_point_light(&scene, v3(0, d, 0), grey(i));
        commit(&scene);
        pt_light_sample(&scene, 0, v3(0, 0, 0), pt_v2(0, 0), &l);
        near_relative(row_label(r->id, "by lights"), (double)l.radiance.g * dot(n, l.wi) / l.pdf_w, r->value,
                      6 * pt_gamma(1));
        pt_scene_free(&scene);
    }
}

/* The flux of a spot through a sphere around it: irradiance from its point light times the falloff. */
typedef struct spot {
    const pt_scene *scene;
    double cos_start, cos_end;
} spot;

static double flux_through_sphere(const void *user, pt_sampler *s)
{
    const spot *const at = (const spot *)user;
    const double radius = 2;
    const pt_vec3 w = pt_warp_cone(pt_sampler_2d(s), 1 - at->cos_end), centre = at->scene->lights[0].position;
    pt_light_sample_result l;
    if (!pt_light_sample(at->scene, 0, pt_v3_add(centre, pt_v3_scale(w, real(radius))), pt_v2(0, 0), &l))
        return 0;
    return (double)l.radiance.g * -dot(w, l.wi) *
           pt_spot_falloff(-(double)l.wi.z, at->cos_start, at->cos_end) * radius * radius /
           pt_warp_cone_pdf_w(1 - at->cos_end);
}

static void spots(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-SPOT, smoothstep between the cosines");
    static const double falloff[7] = {0, 0, 5.0 / 32, 0.5, 27.0 / 32, 1, 1};
    const row *r;
    int at = 0, k;
    while ((r = next_row("RAD-SPOT", "Phi", &at)) != NULL) {
        const double intensity = parameter(r, "I");
        pt_scene scene = PT_SCENE_INIT;
        spot lit = {NULL, cos(degrees(parameter(r, "start_deg"))), cos(degrees(parameter(r, "end_deg")))};
        /* any falloff that is odd about its middle has the same power: 1/4 of the way up it is 5/32 */
        for (k = -1; k < 6; k++) {
            const double x = 0.25 * k, c = lit.cos_end + x * (lit.cos_start - lit.cos_end);
            pt_check_near(row_label(r->id, "falloff"), pt_spot_falloff(c, lit.cos_start, lit.cos_end),
                          falloff[k + 1], 1e-13,
                          "smooth between the two cosines: t^2 (3 - 2 t), clamped to 0 and 1");
        }
        near_relative(row_label(r->id, "closed"), pt_flux_spot(intensity, lit.cos_start, lit.cos_end),
                      r->value, 1e-14);
        pt_add_point_light(&scene, v3(0.5, -0.25, 1), grey(intensity));
        commit(&scene);
        lit.scene = &scene;
        /* 1 - cos of 12 degrees, computed from a cosine, and cosines of single precision in its falloff */
        check(row_label(r->id, "through a sphere"), flux_through_sphere, &lit, r->value,
              is_float() ? 1e-5 : 0, "pt_spot_falloff or the point light");
        pt_scene_free(&scene);
    }
}

static void sphere_lights(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-ESPH (Snyder 1996)");
    const row *r;
    int at = 0;
    while ((r = next_row("RAD-ESPH", NULL, &at)) != NULL) {
        const double radius = parameter(r, "R"), d = parameter(r, "d"),
                     beta = degrees(parameter(r, "beta_deg"));
        pt_scene scene = PT_SCENE_INIT;
        receiver below = {NULL, {0, 0, 0}, {0, 0, 1}};
        /* cos(90 degrees) is 6e-17 here, and E at a small sphere near the horizon has a slope of 1 / cos */
        near_relative(row_label(r->id, "closed"), pt_irradiance_sphere(1, radius, d, cos(beta)), r->value,
                      1e-13);
        below.scene = &scene;
        pt_add_sphere(&scene, v3(d * sin(beta), 0, d * cos(beta)), real(radius), lamp(&scene, 1));
        commit(&scene);
        check_irradiance(r->id, &below, POINTS, r->value, 1e-6);
        pt_scene_free(&scene);
    }
}

/* A fan of triangles; a parallelogram also as one. The pentagon of the table is not flat: its fan is. */
static void check_polygon(const row *r, const double (*v)[3], int count, int as_parallelogram)
{
    pt_scene scene = PT_SCENE_INIT;
    receiver below = {NULL, {0, 0, 0}, {0, 0, 1}};
    const int material = lamp(&scene, 1);
    const pt_vec3 a = v3(v[0][0], v[0][1], v[0][2]), b = v3(v[1][0], v[1][1], v[1][2]);
    char name[64];
    int i;
    if (as_parallelogram) {
        const pt_vec3 e1 = pt_v3_sub(b, a), e2 = pt_v3_sub(v3(v[3][0], v[3][1], v[3][2]), a);
        if (dot(pt_v3_cross(e1, e2), a) < 0)
            pt_add_parallelogram(&scene, a, e1, e2, material);
        else
            pt_add_parallelogram(&scene, a, e2, e1, material);
    }
    for (i = 1; i + 1 < count && !as_parallelogram; i++)
        add_facing(&scene, a, v3(v[i][0], v[i][1], v[i][2]), v3(v[i + 1][0], v[i + 1][1], v[i + 1][2]),
                   material);
    commit(&scene);
    below.scene = &scene;
    snprintf(name, sizeof name, "%s %s", r->id, as_parallelogram ? "parallelogram" : "triangles");
    check_irradiance(name, &below, 2 * POINTS, r->value, 0);
    pt_scene_free(&scene);
}

static void polygon_lights(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-EPOLY (Lambert 1760)");
    const row *r;
    int at = 0;
    while ((r = next_row("RAD-EPOLY", NULL, &at)) != NULL) {
        double v[8][3];
        const int count = numbers(r, "v", v[0], 24) / 3;
        pt_vec3 corners[8];
        int i, parallel = count == 4;
        for (i = 0; i < count; i++) corners[i] = hundredfold(v[i]);
        for (i = 0; i < 3 && count == 4; i++) parallel &= v[0][i] + v[2][i] - v[1][i] - v[3][i] == 0;
        near_relative(row_label(r->id, "closed"),
                      pt_irradiance_polygon(1, v3(0, 0, 0), v3(0, 0, 1), corners, count), r->value, 3e-15);
        check_polygon(r, (const double(*)[3])v, count, 0);
        if (parallel) check_polygon(r, (const double(*)[3])v, count, 1);
    }
}

static void regular_polygons(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-NGON (Lambert 1760)");
    const row *r;
    int at = 0;
    while ((r = next_row("RAD-NGON", NULL, &at)) != NULL) {
        const int n = (int)parameter(r, "n");
        const double radius = parameter(r, "R"), h = parameter(r, "h");
        const double tolerance = is_float() ? 2e-7 : 2e-15; /* corners are rounded */
        pt_scene scene = PT_SCENE_INIT;
        receiver below = {NULL, {0, 0, 0}, {0, 0, 1}};
        pt_vec3 v[64];
        double sum = 0;
        int i;
        const int material = lamp(&scene, 1);
        for (i = 0; i < n; i++)
            v[i] = v3(radius * cos(2 * PT_PI * i / n), radius * sin(2 * PT_PI * i / n), h);
        for (i = 0; i < n; i++) {
            const pt_vec3 triangle[3] = {v3(0, 0, h), v[i], v[(i + 1) % n]};
            sum += pt_irradiance_polygon(1, v3(0, 0, 0), v3(0, 0, 1), triangle, 3);
            add_facing(&scene, triangle[0], triangle[1], triangle[2], material);
        }
        near_relative(row_label(r->id, "triangles"), sum, r->value, tolerance);
        if (n <= 32)
            near_relative(row_label(r->id, "closed"),
                          pt_irradiance_polygon(1, v3(0, 0, 0), v3(0, 0, 1), v, n), r->value, tolerance);
        commit(&scene);
        below.scene = &scene;
        check_irradiance(r->id, &below, POINTS, r->value, 0);
        pt_scene_free(&scene);
    }
}

/* Skies of radiance cos^k, by uniform and by cosine-weighted directions, and the variance of both. */
typedef struct sky {
    double power, mean;
    int cosine, overcast;
} sky;

static double sky_value(const void *user, pt_sampler *s)
{
    const sky *const k = (const sky *)user;
    const pt_vec2 u = pt_sampler_2d(s);
    const pt_vec3 w = k->cosine ? pt_warp_cosine(u) : pt_warp_hemisphere(u);
    const double z = (double)w.z, radiance = k->overcast ? (1 + 2 * z) / 3 : pow(z, k->power);
    const double density = k->cosine ? (double)pt_warp_cosine_pdf_w(w) : (double)pt_warp_hemisphere_pdf_w(w);
    return radiance * z / density;
}
static double sky_deviation(const void *user, pt_sampler *s)
{
    return pow(sky_value(user, s) - ((const sky *)user)->mean, 2);
}

static void skies(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-SKY, elementary");
    const row *r;
    int at = 0;
    double mean = 0; /* its row stands before those of the variances */
    while ((r = next_row("RAD-SKY", NULL, &at)) != NULL) {
        const int variance = strncmp(r->quantity, "Var", 3) == 0;
        sky k = {0, 0, 0, 0};
        uint32_t points;
        if (!variance) mean = r->value;
        points = has(r, "k") && parameter(r, "k") > 10 ? 16 * POINTS : 2 * POINTS;
        k.overcast = strcmp(r->quantity, "E_CIE_overcast") == 0;
        k.power = k.overcast ? 1 : parameter(r, "k");
        k.mean = mean;
        k.cosine = strcmp(r->quantity, "Var_cosine") == 0;
        if (!variance) {
            check_bound(row_label(r->id, "uniform directions"), sky_value, &k, points, r->value, 0, BOUND,
                        "pt_warp_hemisphere");
            k.cosine = 1;
            check_bound(row_label(r->id, "cosine-weighted"), sky_value, &k, points, r->value, 0, BOUND,
                        "pt_warp_cosine");
        } else if (r->value > 0) {
            check_bound(row_label(r->id, r->quantity), sky_deviation, &k, points, r->value, 0, BOUND,
                        "the variance of one value");
        } else {
            const pt_stats s = estimate(r->id, sky_deviation, &k, POINTS);
            pt_check_near(row_label(r->id, r->quantity), s.mean, 0, pow(8 * PT_PI * pt_gamma(1), 2),
                          "a uniform sky under cosine-weighted directions has no variance");
        }
    }
}

#if PTI_HAS_ENVIRONMENT
/* A plane tilted by beta above a wide floor, under a uniform sky over black ground; and the ground lit
   instead, which adds up to pi. The floor ends a millionth below the true horizon. */
static void tilted_planes(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-TILT, elementary: pi (1 + cos t)/2");
    const double size = 1e6;
    const row *r;
    int at = 0;
    while ((r = next_row("RAD-TILT", "E_sky", &at)) != NULL) {
        const double beta = degrees(parameter(r, "beta_deg"));
        receiver plane = {NULL, {0, 1, 0}, {0, 1, 0}};
        int lit;
        plane.n = v3(sin(beta), cos(beta), 0);
        for (lit = 0; lit < 2; lit++) {
            const double exact = lit ? PT_PI - r->value : r->value;
            pt_scene scene = PT_SCENE_INIT;
            char name[32];
            if (exact < 1e-9) continue; /* a plane that lies flat does not see the ground */
            pt_add_parallelogram(&scene, v3(-size, 0, -size), v3(0, 0, 2 * size), v3(2 * size, 0, 0),
                                 lit ? lamp(&scene, 1) : wall(&scene, 0));
            if (!lit) pt_set_environment(&scene, grey(1));
            commit(&scene);
            plane.scene = &scene;
            snprintf(name, sizeof name, "%s %s", r->id, lit ? "ground" : "sky");
            check_irradiance(name, &plane, POINTS, exact, 1e-5);
            pt_scene_free(&scene);
        }
    }
}
#endif

/* ---------------------------------------------------------------------------------------------------------
   Photometry, black bodies, colour */

static void bulb(const row *r, double intensity)
{
    const double radius = 0.03, flux = parameter(r, "Phi_lm"), d = 2;
    pt_scene scene = PT_SCENE_INIT;
    receiver below = {NULL, {0, 0, 0}, {0, 1, 0}};
    near_relative(row_label(r->id, "closed"), pt_exitance(r->value) * 4 * PT_PI * radius * radius, flux,
                  1e-15);
    near_relative(row_label(r->id, "illuminance"), pt_irradiance_sphere(r->value, radius, d, 1),
                  pt_irradiance_point(intensity, d, 1), 1e-14);
    pt_add_sphere(&scene, v3(0, d, 0), real(radius), lamp(&scene, r->value));
    commit(&scene);
    below.scene = &scene;
    check(row_label(r->id, "by lights"), by_light, &below, intensity / (d * d), 1e-6,
          "lx under a bulb of so many lm");
    pt_scene_free(&scene);
}

static void photometry(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-PHOT, definition of the candela in the SI");
    /* 540 THz is 555.017 nm, where V is below its greatest value by less than 1e-5 */
    const double nm = 299792458e9 / 540e12;
    double bar[3], intensity = 0; /* its row stands before that of the bulb */
    const row *r;
    int at = 0;
    pt_cie_xyz(nm, bar);
    pt_check_near("683 lm/W at 540 THz", PT_LUMENS_PER_WATT * bar[1], 683, 683 * 1e-5,
                  "lm/W at 555 nm; a weight by ybar must follow");
    while ((r = next_row("RAD-PHOT", NULL, &at)) != NULL) {
        const double flux = parameter(r, "Phi_lm");
        if (strcmp(r->quantity, "I_cd") == 0) {
            intensity = r->value;
            near_relative(row_label(r->id, "closed"), pt_flux_point(r->value), flux, 1e-15);
        } else if (strcmp(r->quantity, "W_at_540THz") == 0) {
            near_relative(row_label(r->id, "closed"), flux / (PT_LUMENS_PER_WATT * bar[1]), r->value, 1e-5);
        } else {
            bulb(r, intensity);
        }
    }
}

#define PLANCK 14387768.775039337 /* h c / k in nm K */

/* pi int B over all wavelengths: the trapezoidal rule in log wavelength, PLANCK / (nm T) from 3e-6 to 750. */
static double integrated_exitance(double kelvin)
{
    const int n = 4000;
    const double from = log(PLANCK / (750 * kelvin)), step = log(750 / 3e-6) / n;
    double sum = 0;
    int i;
    for (i = 0; i <= n; i++) {
        const double nm = exp(from + step * i);
        sum += nm * pt_blackbody(nm, kelvin);
    }
    return PT_PI * sum * step;
}

/* Simpson's rule in steps of 1/40 nm. */
static double integrated_band(double kelvin, double from, double to)
{
    const int n = 2 * (int)(20 * (to - from) + 0.5);
    double sum = 0;
    int i;
    for (i = 0; i <= n; i++)
        sum += (i == 0 || i == n ? 1 : i % 2 ? 4 : 2) * pt_blackbody(from + (to - from) * i / n, kelvin);
    return PT_PI * sum * (to - from) / (3 * n);
}

/* Where Planck's law is greatest, by golden section: to 1e-7 or so, as maxima are. */
static double peak(double kelvin)
{
    const double golden = 0.5 * (sqrt(5.0) - 1);
    double a = 1e6 / kelvin, b = 1e7 / kelvin;
    int i;
    for (i = 0; i < 60; i++) {
        const double x = b - golden * (b - a), y = a + golden * (b - a);
        if (pt_blackbody(x, kelvin) < pt_blackbody(y, kelvin))
            a = x;
        else
            b = y;
    }
    return 0.5 * (a + b);
}

/* The visible part as a spectral renderer finds it: one wavelength at random. */
static double one_wavelength(const void *user, pt_sampler *s)
{
    const double *const kelvin = (const double *)user;
    return PT_PI * 470 * pt_blackbody(360 + 470 * (double)pt_sampler_1d(s), *kelvin);
}

static void black_bodies(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: RAD-BB, Planck's law, CODATA 2019");
    double exitance = 0;
    const row *r;
    int at = 0;
    while ((r = next_row("RAD-BB", NULL, &at)) != NULL) {
        const double t = has(r, "T") ? parameter(r, "T") : 3000;
        if (strcmp(r->quantity, "sigma") == 0) {
            near_relative(r->id, integrated_exitance(t) / (t * t * t * t), r->value, 1e-13);
        } else if (strcmp(r->quantity, "wien_b") == 0) {
            near_relative(r->id, peak(t) * t * 1e-9, r->value, 1e-6);
        } else if (strcmp(r->quantity, "exitance") == 0) {
            exitance = r->value;
            near_relative(r->id, integrated_exitance(t), r->value, 1e-13);
        } else if (strcmp(r->quantity, "lambda_peak_m") == 0) {
            near_relative(r->id, peak(t) * 1e-9, r->value, 1e-6);
        } else if (strcmp(r->quantity, "L_peak_W_m3_sr") == 0) {
            near_relative(r->id, pt_blackbody(peak(t), t) * 1e9, r->value, 2e-14);
        } else {
            near_relative(r->id, integrated_band(t, 360, 830) / exitance, r->value, 1e-12);
            check(
                row_label(r->id, "by wavelengths"), one_wavelength, &t, r->value * exitance, 0,
                "Planck: 2 h c^2 / lambda^5 / (exp(h c / (lambda k T)) - 1), times 1e-9 to be per nanometre");
        }
    }
}

/* Lumens per watt from the exact total; and what the lamps of the last century had. */
static void luminous_efficacy(void)
{
    const row *r;
    int at = 0, i;
    while ((r = next_row("RAD-BB", "exitance", &at)) != NULL) {
        const double t = parameter(r, "T");
        double sum = 0, bar[3];
        for (i = 0; i <= 47000; i++) {
            pt_cie_xyz(360 + 0.01 * i, bar);
            sum += bar[1] * pt_blackbody(360 + 0.01 * i, t) * 0.01;
        }
        near_relative(row_label(r->id, "efficacy"), pt_blackbody_efficacy(t),
                      683.002 * PT_PI * sum / r->value, 1e-4);
    }
    pt_check_near("a light bulb of 2700 K", pt_blackbody_efficacy(2700), 12.4, 0.1, "lm/W");
}

/* The white of the header is that of its D65 table, the white of the standard a chromaticity of four digits:
   half a unit in the last of them moves Z of white by 5e-4, and the matrix with it. */
static void colours(void)
{
    static const double unit = 5e-4;
    static const char *const bands = "RGB";
    double xyz[3] = {0, 0, 0};
    const row *r;
    int at = 0;
    while ((r = next_row("RAD-SRGB", NULL, &at)) != NULL) {
        const char band = pt_case_find(r->params, "primary", '=')[0];
        const int axis = r->quantity[0] - 'X';
        xyz[axis] = r->value;
        if (axis == 1)
            pt_check_near(row_label(r->id, "luminance"), pt_luminance(band == 'R', band == 'G', band == 'B'),
                          r->value, unit * r->value, "0.2126, 0.7152, 0.0722 of linear sRGB: no gamma");
        if (axis == 2) {
            const pt_rgbd c = pt_xyz_to_rgb(xyz);
            const double got[3] = {c.r, c.g, c.b};
            int k;
            for (k = 0; k < 3; k++)
                pt_check_near(row_label(r->id, "to linear sRGB"), got[k], bands[k] == band, 2 * unit,
                              "the matrix of sRGB with white D65, rows not columns");
        }
    }
    for (at = 0; (r = next_row("RAD-SRGBTF", "encoded", &at)) != NULL;)
        near_relative(r->id, pt_srgb_encode(parameter(r, "v")), r->value, 1e-15);
}

/* ---------------------------------------------------------------------------------------------------------
   Form factors: from uniform points of a parallelogram (or of a line, edge2 = 0) to another that shines with
   radiance 1: irradiance over pi, by cosine-weighted rays that arrive and by sampling the other as a light */

typedef struct patch {
    const pt_scene *scene;
    pt_vec3 corner, edge1, edge2, n;
} patch;

static receiver on_patch(const patch *from, pt_vec2 u)
{
    receiver at;
    at.scene = from->scene;
    at.p = pt_v3_add(from->corner, pt_v3_add(pt_v3_scale(from->edge1, u.x), pt_v3_scale(from->edge2, u.y)));
    at.n = from->n;
    return at;
}
static double arrive(const void *user, pt_sampler *s)
{
    const receiver at = on_patch((const patch *)user, pt_sampler_2d(s));
    return by_cosine(&at, s) / PT_PI;
}
static double arrive_by_light(const void *user, pt_sampler *s)
{
    const receiver at = on_patch((const patch *)user, pt_sampler_2d(s));
    return by_light(&at, s) / PT_PI;
}

/* The second surface must look towards the first. */
static void check_form_factor(const row *r, patch from, pt_vec3 corner, pt_vec3 edge1, pt_vec3 edge2)
{
    pt_scene scene = PT_SCENE_INIT;
    pt_add_parallelogram(&scene, corner, edge1, edge2, lamp(&scene, 1));
    commit(&scene);
    from.scene = &scene;
    check_hits(row_label(r->id, "rays"), arrive, &from, r->value, r->value, 0,
               "cosine-weighted rays that arrive");
    check_bound(row_label(r->id, "by lights"), arrive_by_light, &from, 2 * POINTS, r->value, 0, BOUND,
                "irradiance / pi by pt_light_sample");
    pt_scene_free(&scene);
}

/* On the floor y = 0, looking up. */
static patch on_floor(double x0, double x1, double z0, double z1)
{
    patch f = {NULL, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 1, 0}};
    f.corner = v3(x0, 0, z0);
    f.edge1 = v3(x1 - x0, 0, 0);
    f.edge2 = v3(0, 0, z1 - z0);
    return f;
}

static void rectangles(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-PAR, VF-PERP (Howell 2010)");
    const row *r;
    int at;
    near_relative("squares far apart", 1e12 * PT_PI * pt_form_factor_parallel(1, 1, 1e6), 1, 1e-11);
    for (at = 0; (r = next_row("VF-PAR", "F12", &at)) != NULL;) {
        const double a = parameter(r, "a"), b = parameter(r, "b"), c = parameter(r, "c");
        near_relative(row_label(r->id, "closed"), pt_form_factor_parallel(a, b, c), r->value, 2e-14);
        check_form_factor(r, on_floor(0, a, 0, b), v3(0, c, 0), v3(a, 0, 0), v3(0, 0, b));
    }
    for (at = 0; (r = next_row("VF-PERP", "F12", &at)) != NULL;) {
        const double w = parameter(r, "w"), h = parameter(r, "h"), l = parameter(r, "l");
        near_relative(row_label(r->id, "closed"), pt_form_factor_perpendicular(w, h, l), r->value, 2e-14);
        near_relative(row_label(r->id, "reciprocity"), pt_form_factor_perpendicular(h, w, l) * h / w,
                      r->value, 2e-14);
        check_form_factor(r, on_floor(0, w, 0, l), v3(0, 0, 0), v3(0, h, 0), v3(0, 0, l));
    }
}

/* Opposed rectangles in general position are sums of aligned ones over the pairs of corners. */
static double parallel_in_general(const double a[4], const double b[4], double c)
{
    double sum = 0;
    int i;
    for (i = 0; i < 16; i++) {
        const double x = fabs(a[i & 1] - b[i >> 1 & 1]), y = fabs(a[2 + (i >> 2 & 1)] - b[2 + (i >> 3 & 1)]);
        const int odd = ((i & 1) + (i >> 1 & 1) + (i >> 2 & 1) + (i >> 3 & 1)) % 2;
        if (x > 0 && y > 0) sum += (odd ? -1 : 1) * 0.25 * x * y * pt_form_factor_parallel(x, y, c);
    }
    return sum / ((a[1] - a[0]) * (a[3] - a[2]));
}

static void rectangles_in_general_position(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-PAROFF (Howell 2010)");
    const row *r;
    int at = 0;
    while ((r = next_row("VF-PAROFF", "F12", &at)) != NULL) {
        const double c = parameter(r, "c");
        double a[4], b[4];
        numbers(r, "A1", a, 4);
        numbers(r, "A2", b, 4);
        near_relative(row_label(r->id, "closed"), parallel_in_general(a, b, c), r->value, 1e-12);
        check_form_factor(r, on_floor(a[0], a[1], a[2], a[3]), v3(b[0], c, b[2]), v3(b[1] - b[0], 0, 0),
                          v3(0, 0, b[3] - b[2]));
    }
}

static void strips(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-STRIP, VF-WEDGE (Hottel's crossed strings)");
    const row *r;
    int at;
    for (at = 0; (r = next_row("VF-STRIP", "F12", &at)) != NULL;) {
        const double h = parameter(r, "h"), length = 1e8;
        near_relative(row_label(r->id, "closed"), pt_form_factor_parallel(1, length, h), r->value,
                      10 * h / length);
        check_form_factor(r, on_floor(0, 1, 0, 0), v3(0, h, -FAR), v3(1, 0, 0), v3(0, 0, 2 * FAR));
    }
    for (at = 0; (r = next_row("VF-WEDGE", "F12", &at)) != NULL;) {
        const double a = parameter(r, "a_deg"), length = 1e6;
        if (fabs(a - 90) < 1) /* a long corner lacks about w / (4 l) of its value at the ends */
            near_relative(row_label(r->id, "closed"), pt_form_factor_perpendicular(1, 1, length), r->value,
                          2 / length);
        check_form_factor(r, on_floor(0, 1, 0, 0), v3(0, 0, -FAR), v3(cos(degrees(a)), sin(degrees(a)), 0),
                          v3(0, 0, 2 * FAR));
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Form factors of round shapes */

/* From a disk of radius r around the y axis on the floor. */
typedef struct round_patch {
    const pt_scene *scene;
    double r, r2, h;
} round_patch;

static pt_vec3 on_disk(double r, pt_sampler *s)
{
    const pt_vec2 p = pt_warp_disk(pt_sampler_2d(s));
    return v3(r * (double)p.x, 0, r * (double)p.y);
}
static double arrive_from_disk(const void *user, pt_sampler *s)
{
    const round_patch *const from = (const round_patch *)user;
    receiver at = {NULL, {0, 0, 0}, {0, 1, 0}};
    at.scene = from->scene;
    at.p = on_disk(from->r, s);
    return by_cosine(&at, s) / PT_PI;
}
/* Irradiance in closed form, averaged over the disk. */
static double mean_irradiance(const void *user, pt_sampler *s)
{
    const round_patch *const from = (const round_patch *)user;
    const pt_vec3 p = on_disk(from->r, s);
    return pt_irradiance_disk(1, from->r2, from->h, sqrt(dot(p, p))) / PT_PI;
}

static void coaxial_disks(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-DISK (Howell 2010)");
    const row *r;
    int at = 0;
    while ((r = next_row("VF-DISK", "F12", &at)) != NULL) {
        pt_scene scene = PT_SCENE_INIT;
        round_patch from = {NULL, 0, 0, 0};
        from.scene = &scene;
        from.r = parameter(r, "r1");
        from.r2 = parameter(r, "r2");
        from.h = parameter(r, "h");
        near_relative(row_label(r->id, "closed"), pt_form_factor_disks(from.r, from.r2, from.h), r->value,
                      2e-15);
        check(row_label(r->id, "irradiance"), mean_irradiance, &from, r->value, 0,
              "the mean of pt_irradiance_disk");
        add_disk(&scene, from.r2, from.h, 0, lamp(&scene, 1));
        commit(&scene);
        check_hits(row_label(r->id, "rays"), arrive_from_disk, &from, r->value, r->value, 1e-4,
                   "cosine-weighted rays that arrive");
        pt_scene_free(&scene);
    }
}

/* The flux that a shining sphere sends onto a black disk, by rays that leave the light, over the flux that
   leaves it outwards. What it sends inwards stays inside. */
static double flux_onto_disk(const void *user, pt_sampler *s)
{
    const pt_scene *const scene = (const pt_scene *)user;
    const double radius = (double)scene->spheres[0].radius;
    const pt_vec2 u = pt_sampler_2d(s), v = pt_sampler_2d(s);
    pt_light_emission_result e;
    pt_ray ray;
    pt_hit hit;
    if (!pt_light_sample_le(scene, 0, u, v, pt_sampler_1d(s), &e)) return 0;
    ray = pt_spawn_ray(e.p, e.p_error, e.n, e.w);
    if (!pt_intersect(scene, &ray, &hit) || hit.shape == PT_SHAPE_SPHERE) return 0;
    return (double)e.radiance.g * e.cos_n / (e.pdf_a * e.pdf_w) /
           (pt_exitance((double)e.radiance.g) * 4 * PT_PI * radius * radius);
}

static void sphere_and_disk(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-SPHDISK (Howell 2010)");
    const row *r;
    int at = 0;
    while ((r = next_row("VF-SPHDISK", "F_sd", &at)) != NULL) {
        const double radius = parameter(r, "r"), h = parameter(r, "h");
        pt_scene scene = PT_SCENE_INIT;
        near_relative(row_label(r->id, "closed"), pt_form_factor_sphere_disk(radius, h), r->value, 1e-15);
        near_relative(row_label(r->id, "solid angle"), pt_solid_angle_disk(radius, h, 0) / (4 * PT_PI),
                      r->value, 1e-15);
        pt_add_sphere(&scene, v3(0, 0, 0), real(0.5 * h), lamp(&scene, 2));
        add_disk(&scene, radius, h, 0, wall(&scene, 0));
        commit(&scene);
        check_bound(row_label(r->id, "emitted rays"), flux_onto_disk, &scene, 2 * MANY, r->value, 1e-4,
                    14 * BOUND, "rays of pt_light_sample_le");
        pt_scene_free(&scene);
    }
}

/* From the outer of two spheres inwards: does the ray meet the inner one? One that meets none escaped. */
static double onto_inner_sphere(const void *user, pt_sampler *s)
{
    const pt_scene *const scene = (const pt_scene *)user;
    const pt_vec3 in = pt_v3_neg(pt_warp_sphere(pt_sampler_2d(s)));
    const pt_ray ray = leave(pt_v3_scale(in, -scene->spheres[1].radius), in, cosine_around(in, s));
    pt_hit hit;
    if (!pt_intersect(scene, &ray, &hit)) return HUGE_VAL;
    return hit.material == scene->spheres[0].material;
}

/* The same with cylinders around z: only the projection along the axis matters, where they are the great
   circles of spheres. */
static double onto_inner_cylinder(const void *user, pt_sampler *s)
{
    const double *const radii = (const double *)user;
    const pt_vec3 w = cosine_around(v3(-1, 0, 0), s);
    const pt_ray ray = ray_from(v3(radii[1], 0, 0), pt_v3(w.x, w.y, 0));
    double t;
    return pt_intersect_sphere(&ray, v3(0, 0, 0), real(radii[0]), &t);
}

static void concentric(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-CONC, reciprocity");
    const row *r;
    int at = 0;
    while ((r = next_row("VF-CONC", NULL, &at)) != NULL) {
        const double radii[2] = {parameter(r, "r1"), parameter(r, "r2")};
        pt_scene scene = PT_SCENE_INIT;
        pt_add_sphere(&scene, v3(0, 0, 0), real(radii[0]), wall(&scene, 0));
        pt_add_sphere(&scene, v3(0, 0, 0), real(radii[1]), wall(&scene, 0));
        commit(&scene);
        if (strcmp(r->quantity, "sphere_F21") == 0)
            check_hits(row_label(r->id, "rays"), onto_inner_sphere, &scene, r->value, r->value, 0,
                       "rays from the outer sphere");
        else
            check_hits(row_label(r->id, "rays"), onto_inner_cylinder, radii, r->value, r->value, 0,
                       "rays from the outer cylinder");
        pt_scene_free(&scene);
    }
}

/* A closed cylinder as a prism; the material tells where a ray arrives. */
typedef struct cylinder {
    pt_scene scene;
    double r, h;
    int base, top, side;
} cylinder;

static void make_cylinder(cylinder *c)
{
    int i;
    c->base = wall(&c->scene, 0);
    c->top = wall(&c->scene, 0);
    c->side = wall(&c->scene, 0);
    add_disk(&c->scene, c->r, 0, 1, c->base);
    add_disk(&c->scene, c->r, c->h, 0, c->top);
    for (i = 0; i < SIDES; i++)
        pt_add_quad(&c->scene, rim(c->r, 0, i), rim(c->r, 0, i + 1), rim(c->r, c->h, i + 1),
                    rim(c->r, c->h, i), c->side);
    commit(&c->scene);
}

static double arrives_on(const cylinder *c, pt_ray ray, int material)
{
    pt_hit hit;
    return pt_intersect(&c->scene, &ray, &hit) ? hit.material == material : HUGE_VAL;
}
static double base_to_top(const void *user, pt_sampler *s)
{
    const cylinder *const c = (const cylinder *)user;
    const pt_vec3 p = on_disk(c->r * cos(PT_PI / SIDES), s), up = v3(0, 1, 0);
    return arrives_on(c, leave(p, up, cosine_around(up, s)), c->top);
}
static double side_to_side(const void *user, pt_sampler *s)
{
    const cylinder *const c = (const cylinder *)user;
    const pt_vec2 u = pt_sampler_2d(s);
    const int i = (int)((double)u.x * SIDES);
    const double f = (double)u.x * SIDES - i, phi = 2 * PT_PI * (i + 0.5) / SIDES;
    const pt_vec3 a = rim(c->r, 0, i), b = rim(c->r, 0, i + 1), in = v3(-cos(phi), 0, -sin(phi));
    pt_vec3 p = pt_v3_add(pt_v3_scale(a, real(1 - f)), pt_v3_scale(b, real(f)));
    p.y = real(c->h * (double)u.y);
    return arrives_on(c, leave(p, in, cosine_around(in, s)), c->side);
}

static void closed_cylinders(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-CYL (Howell 2010)");
    const row *r;
    int at = 0;
    while ((r = next_row("VF-CYL", NULL, &at)) != NULL) {
        static const cylinder empty;
        cylinder c = empty;
        const int sideways = strcmp(r->quantity, "lat_lat") == 0;
        double across;
        c.r = parameter(r, "r");
        c.h = parameter(r, "h");
        across = pt_form_factor_disks(c.r, c.r, c.h);
        near_relative(row_label(r->id, "closed"), sideways ? 1 - c.r / c.h * (1 - across) : across, r->value,
                      1e-14);
        make_cylinder(&c);
        check_hits(row_label(r->id, "rays"), sideways ? side_to_side : base_to_top, &c, r->value, r->value,
                   1e-4, "rays within a closed cylinder");
        pt_scene_free(&c.scene);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Cavities, by whole paths. The first four dimensions (film and lens) choose where they start. */

/* So many edges that, with this share of the light left after each, what is cut off is below 1e-5 of all. */
static int edges_for(double share) { return 2 + (int)ceil(log(1e-5) / log(share)); }

static double path_radiance(const pt_scene *scene, const pt_ray *ray, pt_sampler *s, int max_edges)
{
    pt_li_options options;
    pt_li_info info;
    memset(&options, 0, sizeof options);
    memset(&info, 0, sizeof info);
    options.max_edges = max_edges;
    options.roulette = max_edges > 0 ? PT_ROULETTE_NONE : PT_ROULETTE_THROUGHPUT;
    return pt_li_path(scene, ray, s, &options, &info).g;
}

/* A bowl cut from a shining sphere by a black plane: what its points see of the bowl. */
typedef struct bowl {
    const pt_scene *scene;
    double omc; /* 1 - cos of the half angle */
} bowl;

static double bowl_to_itself(const void *user, pt_sampler *s)
{
    const bowl *const b = (const bowl *)user;
    const pt_vec3 p = pt_warp_cone(pt_sampler_2d(s), b->omc), in = pt_v3_neg(p);
    const pt_ray ray = leave(p, in, cosine_around(in, s));
    return path_radiance(b->scene, &ray, s, 1);
}

static void bowls(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-SPHCAV, the kernel of a sphere is constant "
                   "(Jacquez and Kuppenheim 1955)");
    const row *r;
    int at = 0;
    while ((r = next_row("VF-SPHCAV", "F_self", &at)) != NULL) {
        const double a = degrees(parameter(r, "a_deg"));
        pt_scene scene = PT_SCENE_INIT;
        bowl b = {NULL, 0};
        b.scene = &scene;
        b.omc = 2 * sin(a / 2) * sin(a / 2);
        near_relative(row_label(r->id, "share of the sphere"), pt_solid_angle_cap(a) / (4 * PT_PI), r->value,
                      1e-15);
        pt_add_sphere(&scene, v3(0, 0, 0), 1, lamp(&scene, 1));
        pt_add_parallelogram(&scene, v3(-2, -2, cos(a)), v3(4, 0, 0), v3(0, 4, 0), wall(&scene, 0));
        commit(&scene);
        check_hits(row_label(r->id, "paths"), bowl_to_itself, &b, r->value, r->value, is_float() ? 1e-5 : 0,
                   "the share of its own light that a bowl sees");
        pt_scene_free(&scene);
    }
}

/* The unit cube, its floor of exitance 1. Face 0 is the floor, 1 the lid, 2 to 5 the sides; -1: any. */
typedef struct cube {
    pt_scene scene;
    int face, from_edges, to_edges; /* light of paths of so many edges: one more than the reflections       */
} cube;

static const double CUBE[6][9] = {
    {0, 0, 0, 0, 0, 1, 1, 0, 0}, {0, 1, 0, 1, 0, 0, 0, 0, 1}, {0, 0, 0, 0, 1, 0, 0, 0, 1},
    {1, 0, 0, 0, 0, 1, 0, 1, 0}, {0, 0, 0, 1, 0, 0, 0, 1, 0}, {0, 0, 1, 0, 1, 0, 1, 0, 0},
}; /* corner and edges; edge1 x edge2 looks inwards */

static void make_cube(cube *c, double albedo)
{
    pt_material floor_material = pt_material_diffuse(grey(albedo));
    int f, white, shining;
    memset(c, 0, sizeof *c);
    floor_material.emission = grey(1 / PT_PI);
    white = wall(&c->scene, albedo);
    shining = pt_add_material(&c->scene, floor_material);
    for (f = 0; f < 6; f++) {
        const double *const v = CUBE[f];
        pt_add_parallelogram(&c->scene, v3(v[0], v[1], v[2]), v3(v[3], v[4], v[5]), v3(v[6], v[7], v[8]),
                             f == 0 ? shining : white);
    }
    commit(&c->scene);
}

/* Irradiance: pi times the mean radiance of cosine-weighted directions. The same numbers with and without the
   last edge leave its light alone. */
static double cube_irradiance(const void *user, pt_sampler *s)
{
    const cube *const c = (const cube *)user;
    const pt_vec2 u = pt_sampler_2d(s);
    const double x = 6 * (double)u.x;
    const int face = c->face >= 0 ? c->face : (int)x;
    const double *const v = CUBE[face];
    const pt_real a = c->face >= 0 ? u.x : real(x - face);
    const pt_vec3 e1 = v3(v[3], v[4], v[5]), e2 = v3(v[6], v[7], v[8]), n = pt_v3_cross(e1, e2);
    const pt_vec3 p = pt_v3_add(v3(v[0], v[1], v[2]), pt_v3_add(pt_v3_scale(e1, a), pt_v3_scale(e2, u.y)));
    const pt_ray ray = leave(p, n, cosine_around(n, s));
    double value = path_radiance(&c->scene, &ray, s, c->to_edges);
    if (c->from_edges > 1) value -= path_radiance(&c->scene, &ray, s, c->from_edges - 1);
    return PT_PI * value;
}

static int face_of(const char *quantity)
{
    if (strstr(quantity, "sum")) return -1;
    if (strcmp(quantity, "Fo") == 0 || strstr(quantity, "opposite")) return 1;
    return strcmp(quantity, "Fa") == 0 || strstr(quantity, "adjacent") ? 4 : 0;
}

static void cube_by_reflections(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-CUBE1, quadrature of products of form factors");
    const double fo = pt_form_factor_parallel(1, 1, 1), fa = pt_form_factor_perpendicular(1, 1, 1);
    const row *r;
    int at = 0;
    while ((r = next_row("VF-CUBE1", NULL, &at)) != NULL) {
        const double albedo = has(r, "rho") ? parameter(r, "rho") : 0;
        const int all = strncmp(r->quantity, "E_total", 7) == 0;
        cube c;
        if (strncmp(r->quantity, "sumrule", 7) == 0) {
            near_relative(r->id, strstr(r->quantity, "opposite") ? 1 - 4 * fa : (1 - fo) / 4, r->value,
                          1e-14);
            continue;
        }
        if (r->quantity[0] == 'F')
            near_relative(row_label(r->id, "closed"), r->quantity[1] == 'o' ? fo : fa, r->value, 1e-14);
        make_cube(&c, albedo);
        c.face = face_of(r->quantity);
        c.from_edges = albedo > 0 && !all ? 2 : 1;
        c.to_edges = all ? 0 : c.from_edges;
        if (c.to_edges == 1)
            check_hits(row_label(r->id, r->quantity), cube_irradiance, &c, r->value, r->value, 0,
                       "edges of length 1");
        else
            check_bound(row_label(r->id, r->quantity), cube_irradiance, &c, POINTS,
                        c.face < 0 ? r->value / 6 : r->value, 0, 12 * BOUND, "paths of two edges, or of all");
        pt_scene_free(&c.scene);
    }
}

/* A unit sphere of triangles, an octahedron's grid blown up; what lies above z shines with the flux of a cap
   of the share f of the area and radiance Le. Its flat triangles see their neighbours a little less than a
   sphere's parts do: by the square of their size, 1e-3 of the whole. */
static pt_vec3 grid_point(int face, int i, int j)
{
    const double x = i, y = j, z = GRID - i - j;
    return pt_v3_normalize(v3(face & 1 ? -x : x, face & 2 ? -y : y, face & 4 ? -z : z));
}

static double add_grid_triangle(pt_scene *scene, const pt_vec3 v[3], double above, int shining, int white)
{
    const pt_vec3 n = pt_v3_cross(pt_v3_sub(v[1], v[0]), pt_v3_sub(v[2], v[0]));
    const int inwards = dot(n, v[0]) < 0;
    const int lit = (double)v[0].z + (double)v[1].z + (double)v[2].z > 3 * above;
    pt_add_triangle(scene, v[0], v[inwards ? 1 : 2], v[inwards ? 2 : 1], lit ? shining : white);
    return lit ? 0.5 * sqrt(dot(n, n)) : 0;
}

/* Returns the area that shines. */
static double make_grid(pt_scene *scene, double above, double albedo, double radiance)
{
    pt_material m = pt_material_diffuse(grey(albedo));
    const int white = pt_add_material(scene, m);
    int shining, face, i, j;
    double area = 0;
    m.emission = grey(radiance);
    shining = pt_add_material(scene, m);
    for (face = 0; face < 8; face++)
        for (i = 0; i < GRID; i++)
            for (j = 0; i + j < GRID; j++) {
                const pt_vec3 a = grid_point(face, i + 1, j), b = grid_point(face, i, j + 1);
                const pt_vec3 up[3] = {grid_point(face, i, j), a, b};
                const pt_vec3 down[3] = {grid_point(face, i + 1, j + 1), b, a};
                area += add_grid_triangle(scene, up, above, shining, white);
                if (i + j + 2 <= GRID) area += add_grid_triangle(scene, down, above, shining, white);
            }
    return area;
}

typedef struct integrating_sphere {
    pt_scene scene;
    int edges;
} integrating_sphere;

/* From the centre to the dark half. */
static double wall_radiance(const void *user, pt_sampler *s)
{
    const integrating_sphere *const sphere = (const integrating_sphere *)user;
    const pt_vec3 w = pt_warp_cone(pt_sampler_2d(s), 0.9);
    const pt_ray ray = ray_from(v3(0, 0, 0), pt_v3_neg(w));
    return path_radiance(&sphere->scene, &ray, s, sphere->edges);
}

static void integrating_spheres(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-ISPH (Jacquez and Kuppenheim 1955)");
    const row *r;
    int at = 0;
    while ((r = next_row("VF-ISPH", NULL, &at)) != NULL) {
        static const integrating_sphere empty;
        integrating_sphere sphere = empty;
        const double f = parameter(r, "f"), le = parameter(r, "Le"), rho = parameter(r, "rho");
        const int k = has(r, "k") ? (int)parameter(r, "k") : 0;
        /* once for the area, once with the radiance that gives the flux of the row */
        const double area = make_grid(&sphere.scene, 1 - 2 * f, rho, 1);
        pt_scene_free(&sphere.scene);
        make_grid(&sphere.scene, 1 - 2 * f, rho, le * f * 4 * PT_PI / area);
        commit(&sphere.scene);
        sphere.edges = k > 0 ? k + 1 : edges_for(rho);
        check_bound(row_label(r->id, r->quantity), wall_radiance, &sphere,
                    k == 0    ? 16
                    : f < 0.2 ? 48
                              : 128,
                    r->value, 4e-4, f < 0.2 ? 3 * BOUND : 6 * BOUND, "k + 1 edges for k reflections");
        pt_scene_free(&sphere.scene);
    }
}

/* A sphere lit by a point light a off its centre, seen from there at the angle gamma from the light. */
typedef struct lit_sphere {
    pt_scene scene;
    pt_vec3 direction;
    int edges;
} lit_sphere;

static double lit_wall(const void *user, pt_sampler *s)
{
    const lit_sphere *const sphere = (const lit_sphere *)user;
    const pt_ray ray = ray_from(v3(0, 0, 0), sphere->direction);
    return path_radiance(&sphere->scene, &ray, s, sphere->edges);
}

static void spheres_around_point_lights(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-ISPHPT (Jacquez and Kuppenheim 1955)");
    const row *r;
    int at = 0;
    while ((r = next_row("VF-ISPHPT", "L", &at)) != NULL) {
        static const lit_sphere empty;
        lit_sphere sphere = empty;
        const double a = parameter(r, "a"), rho = parameter(r, "rho"),
                     gamma = degrees(parameter(r, "gamma_deg"));
        pt_add_sphere(&sphere.scene, v3(0, 0, 0), 1, wall(&sphere.scene, rho));
        pt_add_point_light(&sphere.scene, v3(0, 0, a), grey(1));
        commit(&sphere.scene);
        sphere.direction = v3(sin(gamma), 0, cos(gamma));
        sphere.edges = edges_for(rho);
        check_bound(row_label(r->id, "paths"), lit_wall, &sphere, 96, r->value, 1e-5,
                    a < 0.7 ? 6 * BOUND : 16 * BOUND, "indirect radiance is rho / (1 - rho) / pi");
        pt_scene_free(&sphere.scene);
    }
}

/* From between two spheres, inwards or outwards; edges 0: ended by roulette. */
typedef struct two_spheres {
    pt_scene scene;
    double middle;
    int outwards, edges;
} two_spheres;

static double between_spheres(const void *user, pt_sampler *s)
{
    const two_spheres *const pair = (const two_spheres *)user;
    const pt_vec3 w = pt_warp_sphere(pt_sampler_2d(s));
    const pt_ray ray = ray_from(pt_v3_scale(w, real(pair->middle)), pair->outwards ? w : pt_v3_neg(w));
    return path_radiance(&pair->scene, &ray, s, pair->edges);
}

static void concentric_spheres_that_shine(void)
{
    pt_test_source("tests/data/oracles_radiometry.csv: VF-CSPH, reciprocity and symmetry");
    static const char *const keys[2][3] = {{"r1", "rho1", "Le1"}, {"r2", "rho2", "Le2"}};
    const row *r;
    int at = 0, k;
    while ((r = next_row("VF-CSPH", NULL, &at)) != NULL) {
        static const two_spheres empty;
        two_spheres pair = empty;
        for (k = 0; k < 2; k++) {
            pt_material m = pt_material_diffuse(grey(parameter(r, keys[k][1])));
            m.emission = grey(parameter(r, keys[k][2]));
            pt_add_sphere(&pair.scene, v3(0, 0, 0), real(parameter(r, keys[k][0])),
                          pt_add_material(&pair.scene, m));
        }
        commit(&pair.scene);
        pair.middle = 0.5 * (parameter(r, "r1") + parameter(r, "r2"));
        pair.outwards = strcmp(r->quantity, "L_outer") == 0;
        pair.edges = edges_for(parameter(r, "rho2"));
        check_bound(row_label(r->id, "paths"), between_spheres, &pair, 128, r->value, 1e-5, 9 * BOUND,
                    "long paths");
        pair.edges = 0;
        check_bound(row_label(r->id, "roulette"), between_spheres, &pair, POINTS / 2, r->value, 0, 8 * BOUND,
                    "roulette");
        pt_scene_free(&pair.scene);
    }
}

int main(int argc, char **argv)
{
    pt_test_begin("test_radiometry", argc, argv);
    if (!load_rows(ROWS_PATH)) return pt_test_end();
    PT_TEST(solid_angles_of_spheres);
    PT_TEST(directions_in_caps);
    PT_TEST(solid_angles_of_flat_shapes);
    PT_TEST(disks);
    PT_TEST(disk_variances);
    PT_TEST_EXACT(point_lights);
    PT_TEST(spots);
    PT_TEST(sphere_lights);
    PT_TEST(polygon_lights);
    PT_TEST(regular_polygons);
    PT_TEST(skies);
#if PTI_HAS_ENVIRONMENT
    PT_TEST(tilted_planes);
#endif
    PT_TEST(photometry);
    PT_TEST(black_bodies);
    PT_TEST_EXACT(luminous_efficacy);
    PT_TEST_EXACT(colours);
    PT_TEST(rectangles);
    PT_TEST(rectangles_in_general_position);
    PT_TEST(strips);
    PT_TEST(coaxial_disks);
    PT_TEST(sphere_and_disk);
    PT_TEST(concentric);
    PT_TEST(closed_cylinders);
    PT_TEST(bowls);
    PT_TEST(cube_by_reflections);
    PT_TEST(integrating_spheres);
    PT_TEST(spheres_around_point_lights);
    PT_TEST(concentric_spheres_that_shine);
    if (argc < 2) PT_TEST_EXACT(every_row_is_used); /* only a whole run uses them all */
    return pt_test_end();
}
