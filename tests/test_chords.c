/* test_chords.c: geometric probability. Random lines, segments, points and walks have mean lengths and counts
   that are known exactly for any convex body, so they test pt_intersect, pt_spawn_ray and the warps
   ([PT-04, -06, -07]) without any light. The exact values stand in tests/data/oracles_geometry.csv; at the end
   every row must have been used.

   Lines that are uniform (every line as likely as every other) come in two ways, which must agree: rays from
   uniform points of the surface with cosine-weighted directions inwards; and a uniform direction with a
   uniform offset in the disk across it, as wide as a sphere around the body. */

#include "pt_means.h"

#define ROWS_PATH "tests/data/oracles_geometry.csv"
#define POINTS 2048u
#define CROSSINGS_MAX 64

/* ---------------------------------------------------------------------------------------------------------
   Bodies. The header has no cylinder: its side is a sphere met by the ray's projection along the axis. */

typedef enum body_kind { SPHERE, BOX, TETRAHEDRON, HEMISPHERE, CYLINDER } body_kind;
typedef enum part_kind { PARALLELOGRAM, TRIANGLE, CAP, DISK, TUBE } part_kind;

/* A part of the surface: corner and edges, whose cross product points inwards; a cap around +z; a disk in the
   plane z = corner.z, inwards along e1; a tube around the z axis. */
typedef struct part {
    part_kind kind;
    pt_vec3 corner, e1, e2;
    double area, radius, height;
} part;

typedef struct body {
    body_kind kind;
    pt_scene scene;
    part parts[6];
    int part_count;
    double surface, volume, bound; /* bound: radius of a sphere around the origin that holds the body */
    double radius, height;
    const pt_scene *inner; /* GP-HIT */
    double power;          /* GP-SPHMOM: of the chord */
    double sigma;          /* GP-INV: collisions per length */
} body;

static void add_part(body *b, part_kind kind, pt_vec3 corner, pt_vec3 e1, pt_vec3 e2, double area)
{
    part *const p = &b->parts[b->part_count++];
    p->kind = kind;
    p->corner = corner;
    p->e1 = e1;
    p->e2 = e2;
    p->area = area;
    p->radius = b->radius;
    p->height = b->height;
    b->surface += area;
}

static void add_face(body *b, pt_vec3 corner, pt_vec3 e1, pt_vec3 e2, int is_triangle)
{
    const double area = (double)pt_v3_length(pt_v3_cross(e1, e2));
    const int black = wall(&b->scene, 0);
    add_part(b, is_triangle ? TRIANGLE : PARALLELOGRAM, corner, e1, e2, is_triangle ? area / 2 : area);
    if (is_triangle)
        pt_add_triangle(&b->scene, corner, pt_v3_add(corner, e1), pt_v3_add(corner, e2), black);
    else
        pt_add_parallelogram(&b->scene, corner, e1, e2, black);
}

static void make_box(body *b, double x, double y, double z)
{
    const pt_vec3 ex = v3(x, 0, 0), ey = v3(0, y, 0), ez = v3(0, 0, z);
    const pt_vec3 lo = v3(-x / 2, -y / 2, -z / 2), hi = v3(x / 2, y / 2, z / 2);
    b->kind = BOX;
    b->volume = x * y * z;
    b->bound = 0.5 * sqrt(x * x + y * y + z * z);
    add_face(b, lo, ex, ey, 0);
    add_face(b, lo, ey, ez, 0);
    add_face(b, lo, ez, ex, 0);
    add_face(b, hi, pt_v3_neg(ey), pt_v3_neg(ex), 0);
    add_face(b, hi, pt_v3_neg(ez), pt_v3_neg(ey), 0);
    add_face(b, hi, pt_v3_neg(ex), pt_v3_neg(ez), 0);
}

/* Regular, from four corners of a cube around the origin. */
static void make_tetrahedron(body *b, double edge)
{
    const double a = edge / sqrt(8);
    const pt_vec3 v[4] = {v3(a, a, a), v3(a, -a, -a), v3(-a, a, -a), v3(-a, -a, a)};
    static const int face[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};
    int i;
    b->kind = TETRAHEDRON;
    b->volume = 8 * a * a * a / 3;
    b->bound = a * sqrt(3) * 1.0001; /* the corners stand on that sphere; rounding must not lose them */
    for (i = 0; i < 4; i++)
        add_face(b, v[face[i][0]], pt_v3_sub(v[face[i][1]], v[face[i][0]]),
                 pt_v3_sub(v[face[i][2]], v[face[i][0]]), 1);
}

/* The whole ball, or its upper half with a square for the base: the corners of that lie outside the ball. */
static void make_ball(body *b, double r, int half)
{
    const pt_vec3 o = v3(0, 0, 0), up = v3(0, 0, 1);
    b->kind = half ? HEMISPHERE : SPHERE;
    b->radius = b->bound = r;
    b->volume = (half ? 2 : 4) * PT_PI * r * r * r / 3;
    pt_add_sphere(&b->scene, o, real(r), wall(&b->scene, 0));
    add_part(b, CAP, o, o, o, (half ? 2 : 4) * PT_PI * r * r);
    if (!half) return;
    pt_add_parallelogram(&b->scene, v3(-2 * r, -2 * r, 0), v3(4 * r, 0, 0), v3(0, 4 * r, 0), wall(&b->scene, 0));
    add_part(b, DISK, o, up, o, PT_PI * r * r);
}

static void make_cylinder(body *b, double r, double h)
{
    const pt_vec3 o = v3(0, 0, 0);
    b->kind = CYLINDER;
    b->radius = r;
    b->height = h;
    b->bound = sqrt(r * r + h * h / 4);
    b->volume = PT_PI * r * r * h;
    add_part(b, DISK, v3(0, 0, -h / 2), v3(0, 0, 1), o, PT_PI * r * r);
    add_part(b, DISK, v3(0, 0, h / 2), v3(0, 0, -1), o, PT_PI * r * r);
    add_part(b, TUBE, o, o, o, 2 * PT_PI * r * h);
}

/* From the parameters of a row, "body=box;size=1 2 3". Free its scene. */
static body make_body(const row *r, const char *name_key, const char *size_key)
{
    body b;
    double n[3] = {0, 0, 0};
    memset(&b, 0, sizeof b);
    numbers(r, size_key, n, 3);
    if (is_word(r, name_key, "cube")) make_box(&b, n[0], n[0], n[0]);
    else if (is_word(r, name_key, "box")) make_box(&b, n[0], n[1], n[2]);
    else if (is_word(r, name_key, "tetrahedron")) make_tetrahedron(&b, n[0]);
    else if (is_word(r, name_key, "cylinder")) make_cylinder(&b, n[0], n[1]);
    else make_ball(&b, n[0], is_word(r, name_key, "hemisphere"));
    commit(&b.scene);
    return b;
}

/* ---------------------------------------------------------------------------------------------------------
   Uniform lines, in both ways */

static pt_vec3 on_cap(const part *p, int half, pt_vec2 u, pt_vec3 *inwards)
{
    const pt_vec3 w = pt_warp_cone(u, half ? 1 : 2);
    *inwards = pt_v3_neg(w);
    return pt_v3_scale(w, real(p->radius));
}
static pt_vec3 on_tube(const part *p, pt_vec2 u, pt_vec3 *inwards)
{
    const double phi = 2 * PT_PI * (double)u.x;
    *inwards = v3(-cos(phi), -sin(phi), 0);
    return v3(p->radius * cos(phi), p->radius * sin(phi), p->height * ((double)u.y - 0.5));
}

static pt_vec3 on_part(const part *p, int half, pt_vec2 u, pt_vec3 *inwards)
{
    pt_vec2 w = u;
    if (p->kind == CAP) return on_cap(p, half, u, inwards);
    if (p->kind == TUBE) return on_tube(p, u, inwards);
    if (p->kind == DISK) {
        w = pt_warp_disk(u);
        *inwards = p->e1;
        return v3(p->radius * (double)w.x, p->radius * (double)w.y, (double)p->corner.z);
    }
    if (p->kind == TRIANGLE) w = pt_warp_triangle(u);
    *inwards = pt_v3_normalize(pt_v3_cross(p->e1, p->e2));
    return pt_v3_add(p->corner, pt_v3_add(pt_v3_scale(p->e1, w.x), pt_v3_scale(p->e2, w.y)));
}

/* Uniform numbers stay below 1, whatever rounding does. */
static pt_real below_one(double x) { return real(fmin(x, 1 - pt_gamma(1))); }

/* From a uniform point of the surface, cosine-weighted inwards. The first number chooses the part, too. */
static pt_ray ray_inwards(const body *b, pt_sampler *s)
{
    const pt_vec2 u = pt_sampler_2d(s);
    double area = (double)u.x * b->surface;
    pt_vec3 p, n;
    int i;
    for (i = 0; i + 1 < b->part_count && area >= b->parts[i].area; i++) area -= b->parts[i].area;
    p = on_part(&b->parts[i], b->kind == HEMISPHERE, pt_v2(below_one(area / b->parts[i].area), u.y), &n);
    return leave(p, n, cosine_around(n, s));
}

/* A line that meets the sphere of radius `bound`, from outside of it. */
static pt_ray ray_across(double bound, pt_sampler *s)
{
    const pt_vec2 d = pt_warp_disk(pt_sampler_2d(s));
    const pt_vec3 w = pt_warp_sphere(pt_sampler_2d(s));
    const pt_frame frame = pt_frame_from_normal(w);
    return ray_from(pt_frame_to_world(&frame, v3(bound * (double)d.x, bound * (double)d.y, -2 * bound)), w);
}

/* Where the ray meets surfaces, one after another. */
static int crossings(const pt_scene *scene, pt_ray ray, double *t)
{
    double way = 0;
    pt_hit hit;
    int n = 0;
    while (n < CROSSINGS_MAX && pt_intersect(scene, &ray, &hit)) {
        t[n++] = way += (double)hit.t;
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, ray.d);
    }
    return n;
}

/* The ray seen along the axis meets the tube where it meets a sphere of the same radius; one from outside of
   that circle enters there. */
static double to_tube(const body *b, const pt_ray *ray, int from_outside)
{
    pt_ray flat = *ray;
    double t;
    flat.o.z = flat.d.z = 0;
    if (from_outside && dot(flat.o, flat.o) < b->radius * b->radius) return 0;
    return pt_intersect_sphere(&flat, v3(0, 0, 0), real(b->radius), &t) ? t : HUGE_VAL;
}

/* From inside to the surface. A point within rounding of an edge, or of the end of a flight, may be outside: no
   way, once in a million rays. Where rays leak more often, the mean shows it. */
static double way_out(const body *b, const pt_ray *ray)
{
    const double dz = (double)ray->d.z;
    pt_hit hit;
    if (b->kind == CYLINDER) /* one of the two is finite */
        return fmin(to_tube(b, ray, 0), (0.5 * b->height - (dz > 0 ? 1 : -1) * (double)ray->o.z) / fabs(dz));
    return pt_intersect(&b->scene, ray, &hit) ? (double)hit.t : 0;
}

/* What part of a line lies inside a cylinder: between two circles' crossings and between two planes. */
static double chord_of_cylinder(const body *b, const pt_ray *ray)
{
    const double length = 4 * b->bound, z = (double)ray->o.z, dz = (double)ray->d.z;
    const pt_ray back = ray_from(pt_v3_add(ray->o, pt_v3_scale(ray->d, real(length))), pt_v3_neg(ray->d));
    const double h = 0.5 * b->height, low = (-h - z) / dz, high = (h - z) / dz;
    const double from = fmax(to_tube(b, ray, 1), fmin(low, high));
    return fmax(0, fmin(length - to_tube(b, &back, 1), fmax(low, high)) - from);
}

static double chord_of_line(const body *b, const pt_ray *ray)
{
    double t[CROSSINGS_MAX], sum = 0;
    int i, n;
    if (b->kind == CYLINDER) return chord_of_cylinder(b, ray);
    n = crossings(&b->scene, *ray, t);
    for (i = 0; i + 1 < n; i++) { /* the base of a hemisphere goes on outside of it */
        const double middle = 0.5 * (t[i] + t[i + 1]), z = (double)ray->o.z + middle * (double)ray->d.z;
        const double d2 = dot(ray->o, ray->o) + 2 * middle * dot(ray->o, ray->d) + middle * middle;
        if (b->kind != HEMISPHERE || (z > 0 && d2 < b->radius * b->radius)) sum += t[i + 1] - t[i];
    }
    return sum;
}

/* ---------------------------------------------------------------------------------------------------------
   Chords */

static double chord_from_surface(const void *user, pt_sampler *s)
{
    const body *const b = (const body *)user;
    const pt_ray ray = ray_inwards(b, s);
    return pow(way_out(b, &ray), b->power);
}
/* Lines meet the body with the probability (surface / 4) / (pi bound^2). */
static double chord_of_lines(const void *user, pt_sampler *s)
{
    const body *const b = (const body *)user;
    const pt_ray ray = ray_across(b->bound, s);
    return pow(chord_of_line(b, &ray), b->power) * 4 * PT_PI * b->bound * b->bound / b->surface;
}

/* Lines that miss the body add to the spread: their bound is 2 %. */
static void check_chords(const row *r, const body *b, uint32_t points)
{
    check_bound(row_label(r->id, "from the surface"), chord_from_surface, b, points, r->value, 0, BOUND,
                "a ray inside does not end at the surface, or directions are not cosine-weighted");
    check_bound(row_label(r->id, "by lines"), chord_of_lines, b, points / 2, r->value, 0, 4 * BOUND,
                "a line is not followed through the body: pt_spawn_ray on the far side of a hit");
}

static void mean_chords(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("GP-CHORD", NULL, &at)) != NULL) {
        body b = make_body(r, "body", "size");
        near_relative(row_label(r->id, "4 V / S"), 4 * b.volume / b.surface, r->value, 1e-6);
        b.power = 1;
        check_chords(r, &b, 2 * POINTS);
        pt_scene_free(&b.scene);
    }
}

/* Uniform in the ball: the cube of the distance from the centre is uniform. */
static double exit_distance(const void *user, pt_sampler *s)
{
    const body *const b = (const body *)user;
    const pt_vec3 where = pt_warp_sphere(pt_sampler_2d(s)), w = pt_warp_sphere(pt_sampler_2d(s));
    const double distance = b->radius * cbrt((double)pt_sampler_1d(s));
    const pt_ray ray = ray_from(pt_v3_scale(where, real(distance)), w);
    return way_out(b, &ray);
}

static void chords_of_spheres(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("GP-SPHMOM", NULL, &at)) != NULL) {
        body b = make_body(r, "body", "R");
        if (strncmp(r->quantity, "moment", 6) == 0) {
            b.power = atoi(r->quantity + 6);
            check_chords(r, &b, POINTS / 4);
        } else {
            check_bound(row_label(r->id, "from points inside"), exit_distance, &b, 2 * POINTS, r->value, 0, BOUND,
                        "the far root of the sphere, from an origin inside");
        }
        pt_scene_free(&b.scene);
    }
}

static double shadow(const void *user, pt_sampler *s)
{
    const body *const b = (const body *)user;
    const pt_ray ray = ray_across(b->bound, s);
    return pt_occluded(&b->scene, &ray) ? PT_PI * b->bound * b->bound : 0;
}

static void mean_shadows(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("GP-PROJ", NULL, &at)) != NULL) {
        body b = make_body(r, "body", "size");
        check_count(row_label(r->id, "by lines"), shadow, &b, 2 * POINTS, r->value,
                    r->value / (PT_PI * b.bound * b.bound), 0,
                    "a body's mean shadow is a quarter of its surface: lines that miss it, or pass its edges");
        pt_scene_free(&b.scene);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Bodies within bodies, and crossings */

static double inner_from_surface(const void *user, pt_sampler *s)
{
    const body *const b = (const body *)user;
    const pt_ray ray = ray_inwards(b, s);
    return pt_occluded(b->inner, &ray);
}
static double inner_by_lines(const void *user, pt_sampler *s)
{
    const body *const b = (const body *)user;
    const pt_ray ray = ray_across(b->bound, s);
    return pt_occluded(b->inner, &ray) ? 4 * PT_PI * b->bound * b->bound / b->surface : 0;
}

static void bodies_within_bodies(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("GP-HIT", NULL, &at)) != NULL) {
        body inner = make_body(r, "inner", "size_in"), outer = make_body(r, "outer", "size_out");
        const double share = outer.surface / (4 * PT_PI * outer.bound * outer.bound);
        outer.inner = &inner.scene;
        near_relative(row_label(r->id, "surfaces"), inner.surface / outer.surface, r->value, 1e-6);
        check_count(row_label(r->id, "from the surface"), inner_from_surface, &outer, 2 * POINTS, r->value,
                    r->value, 0, "rays from the outer surface do not meet the inner one often enough");
        check_count(row_label(r->id, "by lines"), inner_by_lines, &outer, 2 * POINTS, r->value,
                    r->value * share, 0, "lines do not meet the inner body often enough");
        pt_scene_free(&inner.scene);
        pt_scene_free(&outer.scene);
    }
}

/* A surface in the ball of radius `bound`; `scale` is the area that it stands for over its own. */
typedef struct surface {
    body ball;
    pt_scene scene;
    double scale;
} surface;

static double crossings_from_surface(const void *user, pt_sampler *s)
{
    const surface *const f = (const surface *)user;
    double t[CROSSINGS_MAX];
    return f->scale * crossings(&f->scene, ray_inwards(&f->ball, s), t);
}
static double crossings_of_lines(const void *user, pt_sampler *s)
{
    const surface *const f = (const surface *)user;
    double t[CROSSINGS_MAX];
    return f->scale * crossings(&f->scene, ray_across(f->ball.bound, s), t);
}

static pt_vec3 torus_point(double big, double small, double u, double v)
{
    const double ring = big + small * cos(2 * PT_PI * v), phi = 2 * PT_PI * u;
    return v3(ring * cos(phi), ring * sin(phi), small * sin(2 * PT_PI * v));
}

/* Flat pieces: the mean number of crossings depends on nothing but the area, so it is that of the true torus
   once scaled by the areas. */
static double add_torus(pt_scene *scene, double big, double small)
{
    const int around = 32, across = 12, material = wall(scene, 0);
    double area = 0;
    int i, j, k;
    for (i = 0; i < around; i++)
        for (j = 0; j < across; j++) {
            pt_vec3 v[4];
            for (k = 0; k < 4; k++)
                v[k] = torus_point(big, small, (double)((i + (k == 1 || k == 2)) % around) / around,
                                   (double)((j + (k >= 2)) % across) / across);
            pt_add_quad(scene, v[0], v[1], v[2], v[3], material);
            for (k = 1; k < 3; k++)
                area += 0.5 * (double)pt_v3_length(
                                  pt_v3_cross(pt_v3_sub(v[k], v[0]), pt_v3_sub(v[k + 1], v[0])));
        }
    return area;
}

static void make_surface(surface *f, const row *r)
{
    const pt_vec3 x = v3(0.6, 0.8, 0), y = v3(-0.64, 0.48, 0.6);
    const pt_vec3 corner = pt_v3_scale(pt_v3_add(x, y), real(-0.5));
    memset(f, 0, sizeof *f);
    make_ball(&f->ball, parameter(r, "R"), 0);
    f->scale = 1;
    if (is_word(r, "surface", "torus R=0.6 r=0.2"))
        f->scale = 4 * PT_PI * PT_PI * 0.6 * 0.2 / add_torus(&f->scene, 0.6, 0.2);
    else if (is_word(r, "surface", "unit square"))
        pt_add_parallelogram(&f->scene, corner, x, y, wall(&f->scene, 0));
    else /* half of that square */
        pt_add_triangle(&f->scene, corner, pt_v3_add(corner, x), pt_v3_add(corner, y), wall(&f->scene, 0));
    commit(&f->scene);
}

static void mean_crossings(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("GP-CROSS", NULL, &at)) != NULL) {
        const char *const hint = "all hits of a line count once: one is met twice, or lost between triangles";
        surface f;
        make_surface(&f, r);
        /* the torus is crossed twice or four times at a go */
        check_count(row_label(r->id, "from the surface"), crossings_from_surface, &f, 2 * POINTS, r->value,
                    fmin(r->value, 0.3), 0, hint);
        check_count(row_label(r->id, "by lines"), crossings_of_lines, &f, 2 * POINTS, r->value,
                    fmin(r->value, 0.3), 0, hint);
        pt_scene_free(&f.scene);
        pt_scene_free(&f.ball.scene);
    }
}

/* A cubic grid of planes 1 apart (everything is divided by the spacing), wide enough for a segment that begins
   in the middle cell. */
typedef struct grid {
    pt_scene scene;
    double length;
} grid;

static void make_grid(grid *g, double length)
{
    const int reach = (int)ceil(length) + 1;
    const double w = 2 * reach + 1, edge = -reach - 0.5;
    int k, material;
    memset(g, 0, sizeof *g);
    g->length = length;
    material = wall(&g->scene, 0);
    for (k = 0; k <= 2 * reach; k++) {
        const double at = k - reach;
        pt_add_parallelogram(&g->scene, v3(at, edge, edge), v3(0, w, 0), v3(0, 0, w), material);
        pt_add_parallelogram(&g->scene, v3(edge, at, edge), v3(0, 0, w), v3(w, 0, 0), material);
        pt_add_parallelogram(&g->scene, v3(edge, edge, at), v3(w, 0, 0), v3(0, w, 0), material);
    }
    commit(&g->scene);
}

static double planes_crossed(const void *user, pt_sampler *s)
{
    const grid *const g = (const grid *)user;
    const pt_vec2 xy = pt_sampler_2d(s);
    const pt_vec3 w = pt_warp_sphere(pt_sampler_2d(s));
    double left = g->length;
    pt_ray ray = ray_from(v3((double)xy.x, (double)xy.y, (double)pt_sampler_1d(s)), w);
    pt_hit hit;
    int n = 0;
    for (;; n++) {
        ray.tmax = real(left);
        if (!pt_intersect(&g->scene, &ray, &hit)) return n;
        left -= (double)hit.t;
        ray = pt_spawn_ray(hit.p, hit.p_error, hit.ng, w);
    }
}

static void planes_of_a_grid(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("GP-GRID", NULL, &at)) != NULL) {
        grid g;
        make_grid(&g, parameter(r, "L") / parameter(r, "a"));
        check_bound(row_label(r->id, "planes"), planes_crossed, &g, g.length > 15 ? 128 : 256, r->value, 0, BOUND,
                    "a plane is missed, or met again after pt_spawn_ray; or tmax is not kept");
        pt_scene_free(&g.scene);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Points: mean distances of two, by what the header draws them with */

typedef enum point_set { IN_BALL, IN_DISK, ON_SQUARE, IN_CUBE, ON_SPHERE, IN_SEGMENT } point_set;

typedef struct point_source {
    point_set set;
    pt_scene light; /* a sphere or a square: its points by pt_light_sample_le */
} point_source;

static pt_vec3 a_point(const point_source *from, pt_vec2 u, pt_real third)
{
    pt_light_emission_result e;
    pt_vec2 d;
    switch (from->set) {
    case IN_BALL: return pt_v3_scale(pt_warp_sphere(u), real(cbrt((double)third)));
    case IN_DISK: d = pt_warp_disk(u); return pt_v3(d.x, d.y, 0);
    case IN_CUBE: return pt_v3(u.x, u.y, third);
    case IN_SEGMENT: return pt_v3(u.x, 0, 0);
    case ON_SPHERE:
    case ON_SQUARE: break;
    }
    if (!pt_light_sample_le(&from->light, 0, u, u, 0, &e)) return v3(HUGE_VAL, 0, 0);
    return e.p;
}
static double distance_of_two(const void *user, pt_sampler *s)
{
    const point_source *const from = (const point_source *)user;
    const pt_vec2 u = pt_sampler_2d(s), v = pt_sampler_2d(s), third = pt_sampler_2d(s);
    return (double)pt_v3_length(pt_v3_sub(a_point(from, u, third.x), a_point(from, v, third.y)));
}

static void distances(void)
{
    static const char *const names[6] = {"ball", "disk", "square", "cube", "sphere_surface", "segment"};
    int k;
    for (k = 0; k < 6; k++) {
        const row *const r = find_row("GP-DIST", names[k], "");
        point_source from = {IN_BALL, PT_SCENE_INIT};
        from.set = (point_set)k;
        if (k == ON_SPHERE) pt_add_sphere(&from.light, v3(0.5, -0.25, 0), 1, lamp(&from.light, 1));
        if (k == ON_SQUARE)
            pt_add_parallelogram(&from.light, v3(0.5, -0.25, 0), v3(0.6, 0.8, 0), v3(-0.64, 0.48, 0.6),
                                 lamp(&from.light, 1));
        commit(&from.light);
        check_bound(row_label(r->id, names[k]), distance_of_two, &from, POINTS, r->value, 0, BOUND,
                    "points are not uniform, or two draws of one sample are not independent");
        pt_scene_free(&from.light);
    }
}

/* ---------------------------------------------------------------------------------------------------------
   Rays that arrive, and walks */

/* From a disk of radius 1 at z = 0 through the disk of the same radius in the plane z = h. */
static double through_the_top(const void *user, pt_sampler *s)
{
    const pt_scene *const top = (const pt_scene *)user;
    const pt_vec2 d = pt_warp_disk(pt_sampler_2d(s));
    const pt_vec3 up = v3(0, 0, 1);
    const pt_ray ray = leave(pt_v3(d.x, d.y, 0), up, cosine_around(up, s));
    pt_hit hit;
    if (!pt_intersect(top, &ray, &hit)) return 0;
    return (double)hit.p.x * (double)hit.p.x + (double)hit.p.y * (double)hit.p.y < 1;
}

static void cylinders_left_by_the_top(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("GP-ESCAPE", NULL, &at)) != NULL) {
        const double h = parameter(r, "h");
        pt_scene top = PT_SCENE_INIT;
        pt_add_parallelogram(&top, v3(-1, -1, h), v3(0, 2, 0), v3(2, 0, 0), wall(&top, 0));
        commit(&top);
        check_count(row_label(r->id, "rays"), through_the_top, &top, 2 * POINTS, r->value, r->value, 0,
                    "cosine-weighted rays from pt_warp_disk's points, or pt_hit.p");
        pt_scene_free(&top);
    }
}

static double towards_all_sides(const void *user, pt_sampler *s)
{
    const pt_ray ray = ray_from(v3(0, 0, 0), pt_warp_sphere(pt_sampler_2d(s)));
    return pt_occluded((const pt_scene *)user, &ray);
}

static void spheres_met_by_chance(void)
{
    const row *r;
    int at = 0;
    while ((r = next_row("GP-PTSPH", NULL, &at)) != NULL) {
        pt_scene scene = PT_SCENE_INIT;
        pt_add_sphere(&scene, v3(0, parameter(r, "d"), 0), real(parameter(r, "R")), wall(&scene, 0));
        commit(&scene);
        check_count(row_label(r->id, "directions"), towards_all_sides, &scene, 4 * POINTS, r->value, r->value,
                    0, "pt_warp_sphere, or spheres that are met too often or too rarely");
        pt_scene_free(&scene);
    }
}

/* In at a point of the surface like a uniform line, on by flights of mean length 1 / sigma, each in a new
   direction, until the surface is met: however often it turned, the mean way is that of the lines that go
   straight through. */
static double way_through(const void *user, pt_sampler *s)
{
    const body *const b = (const body *)user;
    pt_ray ray = ray_inwards(b, s);
    double way = 0;
    for (;;) {
        const double flight = -log1p(-(double)pt_sampler_2d(s).x) / b->sigma, out = way_out(b, &ray);
        way += fmin(flight, out);
        if (flight >= out) return way;
        ray = ray_from(pt_v3_add(ray.o, pt_v3_scale(ray.d, real(flight))), pt_warp_sphere(pt_sampler_2d(s)));
    }
}

static void walks(void)
{
    static const double sigma[2] = {0.5, 3};
    const row *r;
    int at = 0, k;
    while ((r = next_row("GP-INV", NULL, &at)) != NULL)
        for (k = 0; k < 2; k++) { /* three collisions a length: the spread of the ways is four times as wide */
            body b = make_body(r, "body", "size");
            b.sigma = sigma[k];
            check_bound(row_label(r->id, k ? "many turns" : "few turns"), way_through, &b, k ? POINTS : 2 * POINTS,
                        r->value, 0, k ? 8 * BOUND : 3 * BOUND,
                        "the mean way through depends on how often a walk turns: rays inside leak, or do not "
                        "end");
            pt_scene_free(&b.scene);
        }
}

int main(int argc, char **argv)
{
    pt_test_begin("test_chords", argc, argv);
    if (!load_rows(ROWS_PATH)) return pt_test_end();
    PT_TEST(mean_chords);
    PT_TEST(chords_of_spheres);
    PT_TEST(mean_shadows);
    PT_TEST(bodies_within_bodies);
    PT_TEST(mean_crossings);
    PT_TEST(planes_of_a_grid);
    PT_TEST(distances);
    PT_TEST(cylinders_left_by_the_top);
    PT_TEST(spheres_met_by_chance);
    PT_TEST(walks);
    if (argc < 2) PT_TEST_EXACT(every_row_is_used); /* only a whole run uses them all */
    return pt_test_end();
}
