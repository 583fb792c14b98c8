/* pt_lock.h: what test_lockstep.c and test_together.c share: scenes, and pictures of them with their means, for paths that walk
   together [PT-11b] and one at a time. */

#ifndef PT_LOCK_H
#define PT_LOCK_H

#include "pt_test.h"

static inline pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }
static inline pt_rgb rgb(double r, double g, double b) { return pt_rgb3((pt_real)r, (pt_real)g, (pt_real)b); }
static inline pt_rgb grey(double x) { return pt_rgb_grey((pt_real)x); }

/* ---- scenes ----------------------------------------------------------------------------------------------- */

typedef struct stage {
    pt_scene scene;
    pt_camera camera;
} stage;

/* Where a part of a scene stands: turned about two axes, scaled, shifted. */
typedef struct place {
    double turn, scale, x, y, z;
} place;
static const place HERE = {0, 1, 0, 0, 0};

static inline pt_vec3 put(const place *at, const double p[3], double w)
{
    const double c = cos(at->turn), s = sin(at->turn), x = c * p[0] - s * p[1], y = s * p[0] + c * p[1];
    const double ct = cos(1.7 * at->turn), st = sin(1.7 * at->turn);
    return v3(at->scale * x + w * at->x, at->scale * (ct * y - st * p[2]) + w * at->y, at->scale * (st * y + ct * p[2]) + w * at->z);
}

/* How a flat face is made. */
enum { PARALLELOGRAM, QUAD, FAN };

/* The face corner + s a + t b, which looks along a x b. */
static inline void add_face(pt_scene *s, int made, const place *at, const double c[3], const double a[3], const double b[3], int material)
{
    double p[5][3];
    pt_vec3 v[5];
    int k;
    for (k = 0; k < 3; k++) {
        p[0][k] = c[k];
        p[1][k] = c[k] + a[k];
        p[2][k] = c[k] + a[k] + b[k];
        p[3][k] = c[k] + b[k];
        p[4][k] = c[k] + 0.4 * a[k] + 0.7 * b[k];
    }
    for (k = 0; k < 5; k++) v[k] = put(at, p[k], 1);
    if (made == PARALLELOGRAM) pt_add_parallelogram(s, v[0], put(at, a, 0), put(at, b, 0), material);
    if (made == QUAD) pt_add_quad(s, v[0], v[1], v[2], v[3], material);
    for (k = 0; made == FAN && k < 4; k++) pt_add_triangle(s, v[k], v[(k + 1) % 4], v[4], material);
}

/* The six sides of a box; they look inwards, or, for a thing in a room, outwards. materials: of -x -y -z +x +y +z. */
static inline void add_box(pt_scene *s, int made, const place *at, const double low[3], const double high[3], int outwards, const int material[6])
{
    int k;
    for (k = 0; k < 6; k++) {
        const int axis = k % 3, swap = (k >= 3) != outwards;
        double c[3], a[3] = {0, 0, 0}, b[3] = {0, 0, 0};
        const int i = (axis + (swap ? 2 : 1)) % 3, j = (axis + (swap ? 1 : 2)) % 3;
        memcpy(c, low, sizeof c);
        if (k >= 3) c[axis] = high[axis];
        a[i] = high[i] - low[i];
        b[j] = high[j] - low[j];
        if (material[k] >= 0) add_face(s, made, at, c, a, b, material[k]);
    }
}
static inline void add_cube(pt_scene *s, int made, const place *at, double low, double high, int outwards, int m)
{
    const double a[3] = {low, low, low}, b[3] = {high, high, high};
    const int material[6] = {m, m, m, m, m, m};
    add_box(s, made, at, a, b, outwards, material);
}
static inline void add_ball(pt_scene *s, const place *at, double x, double y, double z, double r, int material)
{
    const double c[3] = {x, y, z};
    pt_add_sphere(s, put(at, c, 1), (pt_real)(at->scale * r), material);
}

/* A camera at a place of the part `at`, looking at another. */
static inline pt_camera camera_at(const place *at, double x, double y, double z, double tx, double ty, double tz, double vfov_deg)
{
    const double eye[3] = {x, y, z}, target[3] = {tx, ty, tz};
    return pt_camera_look_at(put(at, eye, 1), put(at, target, 1), v3(0.01, 1, 0), (pt_real)vfov_deg);
}

static inline int material_of(pt_scene *s, pt_material m, double emission)
{
    m.emission = grey(emission);
    return pt_add_material(s, m);
}
static inline int diffuse(pt_scene *s, double r, double g, double b) { return pt_add_material(s, pt_material_diffuse(rgb(r, g, b))); }
static inline int lamp(pt_scene *s, double r, double g, double b) { return pt_add_material(s, pt_material_emitter(rgb(r, g, b))); }

static inline void commit(stage *s) { pt_check(pt_commit(&s->scene) == PT_OK, "scene", "%s", pt_scene_error(&s->scene)); }

/* ---- pictures --------------------------------------------------------------------------------------------- */

static inline pt_render_desc desc_of(const stage *s, int width, int height, uint32_t spp)
{
    pt_render_desc d = pt_render_defaults();
    d.camera = s->camera;
    d.width = width;
    d.height = height;
    d.spp = spp;
    d.seed = pt_test_seed(1);
    d.threads = 1;
    return d;
}

/* Renders; lockstep: must it, or must it not, be in lockstep? 2: and by the scene's tree; -1: whichever. */
static inline pt_film render(const stage *s, const pt_render_desc *d, int lockstep, uint64_t *rays)
{
    pt_film film = PT_FILM_INIT;
    pt_report report = PT_REPORT_INIT;
    const pt_result result = pt_render(&s->scene, d, &film, &report);
    pt_check(result == PT_OK, "pt_render", "%s", report.error ? report.error : pt_result_string(result));
    pt_check(report.nonfinite == 0, "nothing but numbers", "%.0f are not finite", (double)report.nonfinite);
    if (report.body && lockstep >= 0) {
        const int taken = lockstep && !(d->method && strcmp(d->method, "path-light") == 0);
        pt_check((strncmp(report.body, "lockstep", 8) == 0) == taken && (strstr(report.body, "-tree") != NULL) == (taken && lockstep == 2), "which body renders",
                 "%s", report.body);
    }
    if (rays) *rays = report.rays;
    pt_report_free(&report);
    return film;
}

/* Means over the picture and over its blocks, of many renders with seeds of their own. */
enum { ACROSS = 3, BLOCKS = ACROSS * ACROSS };
typedef struct picture {
    pt_stats whole, block[BLOCKS];
    double seconds;
} picture;

static inline void add_picture(picture *out, const pt_film *film)
{
    double sum[BLOCKS] = {0}, count[BLOCKS] = {0}, all = 0;
    int x, y, k;
    for (y = 0; y < film->height; y++)
        for (x = 0; x < film->width; x++) {
            const pt_rgbd c = pt_film_pixel(film, x, y);
            const double value = 0.5 * c.r + 0.3 * c.g + 0.2 * c.b; /* bands that are exchanged are seen */
            k = y * ACROSS / film->height * ACROSS + x * ACROSS / film->width;
            sum[k] += value;
            count[k]++;
            all += value;
        }
    pt_stats_add(&out->whole, all / ((double)film->width * film->height));
    for (k = 0; k < BLOCKS; k++) pt_stats_add(&out->block[k], sum[k] / fmax(count[k], 1));
}

static inline picture pictures(const stage *s, pt_render_desc d, uint32_t renders, uint64_t first_seed, int lockstep)
{
    const double start = pt_cpu_seconds();
    picture out;
    uint32_t k;
    memset(&out, 0, sizeof out);
    d.no_lockstep = !lockstep;
    for (k = 0; k < renders; k++) {
        pt_film film;
        d.seed = pt_test_seed(first_seed + k);
        film = render(s, &d, lockstep, NULL);
        add_picture(&out, &film);
        pt_film_free(&film);
    }
    out.seconds = pt_cpu_seconds() - start;
    return out;
}

enum { RENDERS = 32 };

/* Samples of each of that many renders; what a check of them must see. */
static inline uint32_t samples(uint32_t spp)
{
    const uint32_t n = pt_test_samples((pt_test_long() ? 8 : 1) * spp * RENDERS) / RENDERS;
    return n > 0 ? n : 1;
}
static inline double within(double bound) { return pt_test_long() ? 0.4 * bound : bound; }

/* ---- rooms ------------------------------------------------------------------------------------------------ */

/* Rooms [-1,1]^3 of coloured walls, and what is in them. */
enum { SPHERES, GLASS_BOX, MANY_LAMPS, IN_GLASS, TURNED_LAMPS, GLOWING, MESH, METALS, SMOOTH, ROUND, ROOMS };
static const char *const room_names[ROOMS] = {"mirror and glass sphere", "glass and mirror box", "many lamps", "eye in a glass sphere",
                                              "lamps from behind", "things that glow", "turned room of triangles", "metal, rough and smooth",
                                              "smooth meshes", "room of huge spheres"};

static inline void add_walls(pt_scene *s, int made, const place *at)
{
    static const double low[3] = {-1, -1, -1}, high[3] = {1, 1, 1};
    int m[6];
    m[0] = diffuse(s, 0.6, 0.2, 0.1);
    m[3] = diffuse(s, 0.1, 0.5, 0.2);
    m[1] = m[4] = m[2] = diffuse(s, 0.5, 0.5, 0.4);
    m[5] = diffuse(s, 0.3, 0.3, 0.5);
    add_box(s, made, at, low, high, 0, m);
}

/* Walls that are spheres of radius r around the room, as those of smallpt's. */
static inline void add_shells(pt_scene *s, const place *at, double r, const int material[6])
{
    int k;
    for (k = 0; k < 6; k++) {
        double c[3] = {0, 0, 0};
        c[k % 3] = k < 3 ? r - 1 : 1 - r;
        add_ball(s, at, c[0], c[1], c[2], r, material[k]);
    }
}

/* A mirror, and a floor and a wall of metal; the lamp hangs through the ceiling, and most of it is outside. */
static inline void add_round_room(pt_scene *s, const place *at)
{
    int m[6];
    m[0] = diffuse(s, 0.6, 0.2, 0.1);
    m[1] = pt_add_material(s, pt_material_conductor(rgb(0.14, 0.37, 1.44), rgb(3.98, 2.38, 1.6), (pt_real)0.5));
    m[2] = pt_add_material(s, pt_material_mirror(rgb(0.7, 0.8, 0.7)));
    m[3] = diffuse(s, 0.1, 0.5, 0.2);
    m[4] = diffuse(s, 0.5, 0.5, 0.4);
    m[5] = pt_add_material(s, pt_material_conductor(grey(1.5), grey(4), 0));
    add_shells(s, at, 1e5, m);
    add_ball(s, at, 0.1, 2.6, -0.2, 1.7, lamp(s, 4, 4, 3));
    add_ball(s, at, -0.7, 0.2, 0.3, 0.1, lamp(s, 2, 1, 1));
}

static inline void add_lamp(pt_scene *s, const place *at, double x, double y, double z, double size, int up, int material)
{
    const double c[3] = {x, y, z}, a[3] = {size, 0, 0}, b[3] = {0, 0, size};
    add_face(s, PARALLELOGRAM, at, c, up ? b : a, up ? a : b, material);
}

/* A ball of triangles with the ball's normals. */
static inline void add_smooth_ball(pt_scene *s, double x, double y, double z, double r, int material)
{
    enum { AROUND = 12, UP = 6 };
    pt_vec3 p[AROUND * (UP + 1)], n[AROUND * (UP + 1)];
    uint32_t index[AROUND * UP * 6];
    uint32_t i, j, k = 0;
    for (j = 0; j <= UP; j++)
        for (i = 0; i < AROUND; i++) {
            const double a = 2 * PT_PI * i / AROUND, b = PT_PI * j / UP;
            n[AROUND * j + i] = v3(sin(b) * cos(a), cos(b), sin(b) * sin(a));
            p[AROUND * j + i] = v3(x + r * sin(b) * cos(a), y + r * cos(b), z + r * sin(b) * sin(a));
        }
    for (j = 0; j < UP; j++)
        for (i = 0; i < AROUND; i++) {
            const uint32_t a = AROUND * j + i, b = AROUND * j + (i + 1) % AROUND, c = a + AROUND, d = b + AROUND;
            if (j > 0) index[k++] = a, index[k++] = b, index[k++] = c;
            if (j + 1 < UP) index[k++] = b, index[k++] = d, index[k++] = c;
        }
    pt_add_mesh(s, p, n, NULL, AROUND * (UP + 1), index, k / 3, material);
}

/* What small scenes cannot have, where nobody sees it: then the scene's tree is asked. */
static inline void add_speck(pt_scene *s, const place *at) { add_ball(s, at, 1.2, 0, 0, 0.0002, diffuse(s, 0.5, 0.5, 0.5)); }

/* So many triangles, where nobody sees them, that it has a tree, and walls in it. */
static inline void add_crowd(pt_scene *s, const place *at)
{
    const place far = {at->turn, 0.02 * at->scale, at->x + 1.9 * at->scale, at->y, at->z};
    int k, m = diffuse(s, 0.5, 0.5, 0.5);
    for (k = 0; k < 6; k++) add_cube(s, QUAD, &far, -1, 1 + k, 1, m);
}

/* by_tree: 1: with a speck, 2: with a crowd. */
static inline stage room_of(int kind, int by_tree)
{
    const place turned = {0.6, 1, 0.2, 0.1, 0}, inside = {0.5, 1, 0.1, -0.3, -0.1}, *at = kind == MESH ? &turned : &HERE;
    const int white = kind == MANY_LAMPS || kind == TURNED_LAMPS ? 2 : 4;
    stage s;
    int i, glass, mirror;
    memset(&s, 0, sizeof s);
    glass = pt_add_material(&s.scene, pt_material_dielectric((pt_real)1.5));
    mirror = pt_add_material(&s.scene, pt_material_mirror(rgb(0.9, 0.8, 0.95)));
    if (kind == ROUND) add_round_room(&s.scene, at);
    else add_walls(&s.scene, kind == MESH ? FAN : kind == SPHERES ? QUAD : PARALLELOGRAM, at);
    if (kind != GLOWING && kind != ROUND) add_lamp(&s.scene, at, -0.8, 0.98, -0.9, 1.6, 0, lamp(&s.scene, white, white, 0.8 * white));
    s.camera = camera_at(at, 0.1, 0.1, 0.95, -0.05, -0.1, -1, 65);
    if (kind == SPHERES || kind == ROUND) {
        add_ball(&s.scene, at, -0.5, -0.6, -0.4, 0.4, mirror);
        add_ball(&s.scene, at, 0.5, -0.5, 0, 0.4, glass);
    }
    if (kind == GLASS_BOX || kind == MESH) {
        add_cube(&s.scene, kind == MESH ? QUAD : PARALLELOGRAM, &inside, -0.35, 0.35, 1, glass);
        add_lamp(&s.scene, at, -0.9, -0.7, -0.9, 0.5, 1, mirror);
    }
    if (kind == MANY_LAMPS) {
        pt_add_triangle(&s.scene, v3(-0.9, -0.2, -0.9), v3(-0.3, 0, -0.95), v3(-0.8, 0.5, -0.9), lamp(&s.scene, 3, 1, 1));
        add_ball(&s.scene, at, 0.5, -0.5, -0.3, 0.25, lamp(&s.scene, 1, 2, 1));
        add_ball(&s.scene, at, 0.6, 0.5, 0.2, 0.05, lamp(&s.scene, 10, 10, 20));
        add_ball(&s.scene, at, -0.6, 0.5, 0.2, 0.1, lamp(&s.scene, 0.01, 0.01, 0.01)); /* very dim */
        pt_add_quad(&s.scene, v3(-0.9, -0.95, 0), v3(-0.9, -0.95, 0.4), v3(-0.5, -0.95, 0.4), v3(-0.5, -0.95, 0), lamp(&s.scene, 2, 2, 2));
        pt_add_quad(&s.scene, v3(0.9, -0.95, 0.5), v3(0.3, -0.9, 0.4), v3(0.2, -0.9, 0.9), v3(0.8, -0.95, 0.8), lamp(&s.scene, 1, 1, 2));
    }
    if (kind == IN_GLASS) {
        add_ball(&s.scene, at, 0.1, 0.1, 0.3, 0.5, glass);
        s.camera = camera_at(at, 0.1, 0.1, 0.5, 0.1, 0, -1, 65);
    }
    if (kind == TURNED_LAMPS)
        for (i = 0; i < 3; i++) { /* they shine on ceiling and back; their dark sides are diffuse */
            pt_material m = pt_material_diffuse(rgb(0.6, 0.5, 0.4));
            m.emission = grey(4);
            add_lamp(&s.scene, at, -0.9 + 0.6 * i, -0.3 + 0.2 * i, -0.5, 0.5, 1, pt_add_material(&s.scene, m));
        }
    if (kind == METALS) {
        const pt_rgb eta = rgb(0.14, 0.37, 1.44), k = rgb(3.98, 2.38, 1.6);
        add_ball(&s.scene, at, -0.5, -0.55, -0.4, 0.4, pt_add_material(&s.scene, pt_material_conductor(eta, k, (pt_real)0.5)));
        add_ball(&s.scene, at, 0.5, -0.5, 0, 0.4, pt_add_material(&s.scene, pt_material_conductor(rgb(1.5, 0.9, 0.6), rgb(7, 6, 5), 0)));
        add_lamp(&s.scene, at, -0.9, -0.96, 0.1, 0.9, 1, pt_add_material(&s.scene, pt_material_conductor(k, eta, (pt_real)0.15)));
        add_ball(&s.scene, at, 0.1, 0.3, -0.6, 0.2, material_of(&s.scene, pt_material_conductor(grey(2), grey(3), (pt_real)0.8), 0.3));
        add_ball(&s.scene, at, -0.5, 0.2, 0.3, 0.1, lamp(&s.scene, 3, 2, 1));
    }
    if (kind == GLOWING) {
        add_ball(&s.scene, at, -0.55, -0.5, -0.3, 0.4, material_of(&s.scene, pt_material_diffuse(rgb(0.5, 0.6, 0.7)), 1));
        add_ball(&s.scene, at, 0.5, -0.5, -0.2, 0.4, material_of(&s.scene, pt_material_dielectric((pt_real)1.4), 0.5));
        add_ball(&s.scene, at, 0.1, 0.5, -0.5, 0.3, material_of(&s.scene, pt_material_mirror(grey(0.5)), 2));
        add_lamp(&s.scene, at, -0.5, 0.9, -0.5, 1, 0, material_of(&s.scene, pt_material_mirror(grey(0.8)), 3));
        add_cube(&s.scene, PARALLELOGRAM, &inside, -0.25, 0.2, 1, material_of(&s.scene, pt_material_dielectric((pt_real)1.5), 0.4));
    }
    if (kind == SMOOTH) {
        add_smooth_ball(&s.scene, -0.5, -0.55, -0.4, 0.4, diffuse(&s.scene, 0.7, 0.6, 0.5));
        add_smooth_ball(&s.scene, 0.5, -0.5, 0, 0.4, glass);
        add_smooth_ball(&s.scene, 0, 0.2, -0.6, 0.3, pt_add_material(&s.scene, pt_material_conductor(grey(1.5), grey(4), (pt_real)0.4)));
        add_smooth_ball(&s.scene, 0.1, -0.75, 0.3, 0.2, mirror);
    }
    if (by_tree == 1) add_speck(&s.scene, at);
    if (by_tree == 2) add_crowd(&s.scene, at);
    commit(&s);
    return s;
}
static inline stage room(int kind) { return room_of(kind, 0); }

/* bound: of the whole picture; blocks have none. */
static inline void compare(const char *name, const picture *a, const picture *b, double bound)
{
    int k;
    pt_check_equal_means(name, &a->whole, &b->whole, bound, "paths together and one at a time give different pictures");
    for (k = 0; k < BLOCKS; k++)
        pt_check_equal_means(label("%s, block %d", name, k), &a->block[k], &b->block[k], 0, "a part of the picture differs");
    if (pt_test.is_verbose) printf("       %.2f s and %.2f s\n", a->seconds, b->seconds);
}

#endif /* PT_LOCK_H */
