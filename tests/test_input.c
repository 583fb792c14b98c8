/* test_input.c: wrong, odd and hostile input, and a machine without memory: a result and a sentence that
   names the item, never a crash, a leak or a silently different picture.

       cc -O2 -ffp-contract=off -I. tests/test_input.c -o test_input -lm -pthread && ./test_input

   Run it in the project's top directory. Nothing here is statistical. */

#include <stddef.h>

static void *pool_alloc(size_t size, void *user);
static void *pool_realloc(void *pointer, size_t size, void *user);
static void pool_free(void *pointer, void *user);
#define PT_MALLOC(size, user) pool_alloc(size, user)
#define PT_REALLOC(pointer, size, user) pool_realloc(pointer, size, user)
#define PT_FREE(pointer, user) pool_free(pointer, user)

#define PT_STATIC /* its own memory functions need an implementation of its own */
#include "pt_test.h"
#include <limits.h>

/* ---- memory that counts and fails ------------------------------------------------------------------- */

/* Before each block: how large it is, and whose. */
typedef union block_head {
    struct {
        size_t size;
        void *user;
        unsigned magic;
    } is;
    double align[4];
} block_head;

#define MAGIC 0x5ca1ab1eu

static struct {
    long live;      /* blocks that were not freed                                                    */
    long calls;     /* requests so far                                                               */
    long fail_at;   /* the request that fails, counted from 1; 0 = none                              */
    int fail_after; /* 1: so do all later ones                                                       */
    int strange;    /* blocks freed twice, never given out, or of another user                       */
    size_t largest; /* requests above this fail: no picture of a test needs so much                  */
} pool;

/* Two renders at a time share the pool. */
#if PTI_HAS_THREADS && !defined(_WIN32)
static pthread_mutex_t pool_mutex = PTHREAD_MUTEX_INITIALIZER;
static void pool_lock(void) { pthread_mutex_lock(&pool_mutex); }
static void pool_unlock(void) { pthread_mutex_unlock(&pool_mutex); }
#else
static void pool_lock(void) {}
static void pool_unlock(void) {}
#endif

static int pool_refuses(size_t size)
{
    const long call = ++pool.calls;
    if (size > pool.largest) return 1;
    return pool.fail_at > 0 && (call == pool.fail_at || (pool.fail_after && call > pool.fail_at));
}

static void *pool_alloc(size_t size, void *user)
{
    block_head *head = NULL;
    pool_lock();
    if (!pool_refuses(size)) head = (block_head *)malloc(sizeof *head + size);
    if (head) {
        head->is.size = size;
        head->is.user = user;
        head->is.magic = MAGIC;
        memset(head + 1, 0xa5, size); /* nobody may count on zeros */
        pool.live++;
    }
    pool_unlock();
    return head ? head + 1 : NULL;
}

static void pool_free(void *pointer, void *user)
{
    block_head *const head = (block_head *)pointer - 1;
    pool_lock();
    if (!pointer || head->is.magic != MAGIC || head->is.user != user) {
        pool.strange++;
    } else {
        head->is.magic = 0;
        memset(pointer, 0x5a, head->is.size);
        pool.live--;
        free(head);
    }
    pool_unlock();
}

static void *pool_realloc(void *pointer, size_t size, void *user)
{
    void *const fresh = pool_alloc(size, user);
    if (fresh && pointer) {
        const size_t old = ((block_head *)pointer - 1)->is.size;
        memcpy(fresh, pointer, old < size ? old : size);
        pool_free(pointer, user);
    }
    return fresh;
}

static void pool_start(long fail_at, int fail_after)
{
    pool.calls = 0;
    pool.fail_at = fail_at;
    pool.fail_after = fail_after;
}

/* ---- what is added to a scene ----------------------------------------------------------------------- */

static pt_rgb grey(double v) { return pt_rgb_grey((pt_real)v); }
static pt_vec3 v3(double x, double y, double z) { return pt_v3((pt_real)x, (pt_real)y, (pt_real)z); }

static const double BAD[3] = {(double)NAN, HUGE_VAL, -HUGE_VAL};

/* Does the scene refuse? `id` is what pt_add_x returned; the sentence must hold `item` and `what`. */
static void check_refused(const char *name, pt_scene *scene, int id, pt_result expected, const char *item,
                          const char *what)
{
    const char *const text = pt_scene_error(scene);
    const pt_result result = pt_commit(scene);
    pt_check(id == -1 && result == expected && strstr(text, item) && strstr(text, what) &&
                 strcmp(pt_scene_error(scene), text) == 0,
             name, "id %d, result '%s', sentence '%s'", id, pt_result_string(result), text);
    pt_check(!scene->committed, label("%s, not committed", name), "the scene can be rendered");
    pt_scene_free(scene);
}

static void bad_materials(void)
{
    int field, i;
    for (field = 0; field < 7; field++)
        for (i = 0; i < 5; i++) {
            const double bad = i < 3 ? BAD[i] : i == 3 ? -0.25 : 1.5;
            static const char *const what[7] = {"albedo",   "albedo",   "albedo", "emission",
                                                "emission", "emission", "ior"};
            pt_material m = pt_material_diffuse(grey(0.5));
            pt_scene s = PT_SCENE_INIT;
            if (field >= 3 && i == 4) continue; /* emission and index may be above 1 */
            *(field == 0   ? &m.albedo.r
              : field == 1 ? &m.albedo.g
              : field == 2 ? &m.albedo.b
              : field == 3 ? &m.emission.r
              : field == 4 ? &m.emission.g
              : field == 5 ? &m.emission.b
                           : &m.ior) = (pt_real)bad;
            pt_add_material(&s, pt_material_diffuse(grey(0.5)));
            check_refused(label("material with %s %g", what[field], bad), &s, pt_add_material(&s, m),
                          PT_ERROR_SCENE, "material 1", what[field]);
        }
}

static void bad_material_kinds(void)
{
    pt_scene s = PT_SCENE_INIT;
    pt_material m = pt_material_mirror(grey(1));
    m.kind = (pt_material_kind)17;
    check_refused("material of an unknown kind", &s, pt_add_material(&s, m), PT_ERROR_SCENE, "material 0",
                  "kind");
    m.kind = (pt_material_kind)-1;
    check_refused("material of a negative kind", &s, pt_add_material(&s, m), PT_ERROR_SCENE, "material 0",
                  "kind");
    m = pt_material_dielectric((pt_real)1.5);
    m.medium_inside = 1;
    check_refused("material with a medium inside", &s, pt_add_material(&s, m), PT_ERROR_LEFT_OUT,
                  "material 0", "medi");
    m.medium_inside = 0;
    m.medium_outside = -3;
    check_refused("material with a medium outside", &s, pt_add_material(&s, m), PT_ERROR_LEFT_OUT,
                  "material 0", "medi");
}

/* Puts x into coordinate k of the points. */
static void put(pt_vec3 *points, int k, double x)
{
    pt_vec3 *const p = &points[k / 3];
    *(k % 3 == 0 ? &p->x : k % 3 == 1 ? &p->y : &p->z) = (pt_real)x;
}

/* Adds shape `kind` with corners p: triangle, quad, parallelogram, sphere, mesh, point light. */
static int add_shape(pt_scene *s, int kind, const pt_vec3 *p, int material)
{
    static const uint32_t indices[3] = {0, 1, 2};
    switch (kind) {
    case 0:
        return pt_add_triangle(s, p[0], p[1], p[2], material);
    case 1:
        return pt_add_quad(s, p[0], p[1], p[2], p[3], material);
    case 2:
        return pt_add_parallelogram(s, p[0], p[1], p[2], material);
    case 3:
        return pt_add_sphere(s, p[0], 1, material);
    case 4:
        return pt_add_mesh(s, p, NULL, NULL, 3, indices, 1, material);
    default:
        return pt_add_point_light(s, p[0], grey(1));
    }
}

static const char *const SHAPE[6] = {"triangle", "quad", "parallelogram", "sphere", "mesh", "point light"};

static void bad_coordinates(void)
{
    static const int coordinates[6] = {9, 12, 9, 3, 9, 3};
    int kind, k, i;
    for (kind = 0; kind < 6; kind++)
        for (k = 0; k < coordinates[kind]; k++)
            for (i = 0; i < 4; i++) {
                pt_vec3 p[4] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
                pt_scene s = PT_SCENE_INIT;
                const int m = pt_add_material(&s, pt_material_diffuse(grey(0.5)));
                put(p, k, i < 3 ? BAD[i] : 2e18);
                check_refused(label("%s with coordinate %d %g", SHAPE[kind], k, i < 3 ? BAD[i] : 2e18), &s,
                              add_shape(&s, kind, p, m), PT_ERROR_SCENE, kind == 1 ? "" : SHAPE[kind],
                              "coordinate");
            }
}

static void bad_material_ids(void)
{
    static const int id[4] = {-1, 1, INT_MAX, INT_MIN};
    int kind, i;
    for (kind = 0; kind < 5; kind++)
        for (i = 0; i < 4; i++) {
            const pt_vec3 p[4] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
            pt_scene s = PT_SCENE_INIT;
            pt_add_material(&s, pt_material_diffuse(grey(0.5)));
            check_refused(label("%s with material %d", SHAPE[kind], id[i]), &s, add_shape(&s, kind, p, id[i]),
                          PT_ERROR_SCENE, kind == 1 ? "" : SHAPE[kind], "material");
        }
}

static void bad_spheres_and_lights(void)
{
    static const double radius[6] = {0, -1, 2e18, (double)NAN, HUGE_VAL, -HUGE_VAL};
    static const char *const said[6] = {"radius 0 ", "radius -1 ", "radius 2e", "radius nan ", "radius inf ", "radius -inf "};
    int i, band;
    for (i = 0; i < 6; i++) {
        pt_scene s = PT_SCENE_INIT;
        const int m = pt_add_material(&s, pt_material_diffuse(grey(0.5)));
        check_refused(label("sphere of radius %g", radius[i]), &s,
                      pt_add_sphere(&s, v3(0, 0, 0), (pt_real)radius[i], m), PT_ERROR_SCENE, "sphere 0",
                      said[i]);
    }
    for (band = 0; band < 3; band++)
        for (i = 0; i < 4; i++) {
            const pt_real bad = (pt_real)(i < 3 ? BAD[i] : -1);
            const pt_rgb c = pt_rgb3(band == 0 ? bad : 1, band == 1 ? bad : 1, band == 2 ? bad : 1);
            pt_scene s = PT_SCENE_INIT;
            pt_add_point_light(&s, v3(0, 0, 0), grey(1));
            check_refused(label("point light with intensity %g", (double)bad), &s,
                          pt_add_point_light(&s, v3(0, 0, 0), c), PT_ERROR_SCENE, "point light 1",
                          "intensity");
            check_refused(label("environment of radiance %g", (double)bad), &s, pt_set_environment(&s, c),
                          PT_ERROR_SCENE, "environment", "radiance");
        }
}

static void bad_meshes(void)
{
    const pt_vec3 p[3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    pt_vec3 normals[3] = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
    pt_vec2 uvs[3] = {{0, 0}, {1, 0}, {0, 1}};
    static const uint32_t wrong[3] = {3, 4, UINT32_MAX};
    uint32_t indices[6] = {0, 1, 2, 2, 1, 0};
    int i;
    for (i = 0; i < 9; i++) {
        pt_scene s = PT_SCENE_INIT;
        const int m = pt_add_material(&s, pt_material_diffuse(grey(0.5)));
        int id;
        if (i < 3) {
            indices[i + 2] = wrong[i];
            id = pt_add_mesh(&s, p, NULL, NULL, 3, indices, 2, m);
            indices[i + 2] = i == 0 ? 2 : i == 1 ? 2 : 1;
            check_refused(label("mesh with index %lu", (unsigned long)wrong[i]), &s, id, PT_ERROR_SCENE,
                          "mesh 0", "index");
        } else if (i == 3) {
            check_refused("mesh without positions", &s, pt_add_mesh(&s, NULL, NULL, NULL, 3, indices, 1, m),
                          PT_ERROR_ARGUMENT, "mesh 0", "NULL");
        } else if (i == 4) {
            check_refused("mesh without indices", &s, pt_add_mesh(&s, p, NULL, NULL, 3, NULL, 1, m),
                          PT_ERROR_ARGUMENT, "mesh 0", "NULL");
        } else if (i < 7) {
            normals[1] = i == 5 ? v3(0, (double)NAN, 1) : v3(0, 0, 0);
            check_refused(i == 5 ? "mesh with a normal that is not a number"
                                 : "mesh with a normal of no direction",
                          &s, pt_add_mesh(&s, p, normals, NULL, 3, indices, 1, m), PT_ERROR_SCENE, "mesh 0",
                          i == 5 ? "coordinate" : "normal");
            normals[1] = v3(0, 0, 1);
        } else {
            uvs[2].x = (pt_real)BAD[i - 7];
            check_refused("mesh with a texture coordinate that is not finite", &s,
                          pt_add_mesh(&s, p, NULL, uvs, 3, indices, 1, m), PT_ERROR_SCENE, "mesh 0",
                          "texture coordinate");
        }
    }
}

/* A mesh of no triangles, or of no vertices at all, is allowed and adds nothing. */
static void empty_meshes(void)
{
    const pt_vec3 p[3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    pt_scene s = PT_SCENE_INIT;
    const int m = pt_add_material(&s, pt_material_diffuse(grey(0.5)));
    const int a = pt_add_mesh(&s, p, NULL, NULL, 3, NULL, 0, m),
              b = pt_add_mesh(&s, NULL, NULL, NULL, 0, NULL, 0, m);
    pt_check(a == 0 && b == 1 && pt_commit(&s) == PT_OK && s.primitive_count == 0, "empty meshes",
             "%d, %d: %s", a, b, pt_scene_error(&s));
    pt_scene_free(&s);
}

/* The box of the scene holds each of its primitives, whichever of them reaches out. */
static void bounds(void)
{
    static const double turn[3][3] = {{-4, 5, 0.5}, {7, -6, 2}, {1, 2, 9}};
    int first, i;
    for (first = 0; first < 3; first++) {
        pt_scene s = PT_SCENE_INIT;
        const int m = pt_add_material(&s, pt_material_diffuse(grey(0.5)));
        for (i = 0; i < 3; i++) {
            const double *const c = turn[(first + i) % 3];
            pt_add_sphere(&s, v3(c[0], c[1], c[2]), (pt_real)0.5, m);
        }
        pt_check(pt_commit(&s) == PT_OK, "three spheres", "%s", pt_scene_error(&s));
        pt_check(fabs((double)s.lo.x + 4.5) + fabs((double)s.lo.y + 6.5) + fabs((double)s.lo.z) < 1e-5 &&
                     fabs((double)s.hi.x - 7.5) + fabs((double)s.hi.y - 5.5) + fabs((double)s.hi.z - 9.5) < 1e-5,
                 label("box of three spheres from %d on", first), "(%g, %g, %g) to (%g, %g, %g)", (double)s.lo.x, (double)s.lo.y,
                 (double)s.lo.z, (double)s.hi.x, (double)s.hi.y, (double)s.hi.z);
        pt_scene_free(&s);
    }
}

/* The first error is kept, whatever comes later. */
static void first_error(void)
{
    pt_scene s = PT_SCENE_INIT;
    char text[160];
    pt_add_material(&s, pt_material_diffuse(grey(0.5)));
    pt_add_sphere(&s, v3(0, 0, 0), -1, 0);
    strcpy(text, pt_scene_error(&s));
    pt_add_sphere(&s, v3(0, 0, 0), 1, 99);
    pt_add_sphere(&s, v3(0, 0, 0), 1, 0);
    pt_check(strcmp(text, pt_scene_error(&s)) == 0 && strstr(text, "sphere 0") && strstr(text, "-1"),
             "first error", "'%s', then '%s'", text, pt_scene_error(&s));
    pt_check(pt_commit(&s) == PT_ERROR_SCENE, "first error, commit", "accepts the scene");
    pt_scene_free(&s);
    pt_check(strcmp(pt_scene_error(&s), pt_result_string(PT_OK)) == 0 && pt_commit(&s) == PT_OK,
             "freed scene", "keeps its error: %s", pt_scene_error(&s));
    pt_scene_free(&s);
}

static void result_strings(void)
{
    int i, same = 0;
    for (i = -2; i < 30; i++) {
        const char *const text = pt_result_string((pt_result)i);
        pt_check(text != NULL && text[0] != 0, "pt_result_string", "nothing for %d", i);
        same += i > PT_OK && i <= PT_ERROR_FILE && text &&
                strcmp(text, pt_result_string((pt_result)(i - 1))) == 0;
    }
    pt_check(same == 0, "pt_result_string, all different", "%d are not", same);
}

/* ---- scenes that are odd but allowed ---------------------------------------------------------------- */

static pt_render_desc small_desc(void)
{
    pt_render_desc d = pt_render_defaults();
    d.camera = pt_camera_look_at(v3(0, 0, 3), v3(0, 0, 0), v3(0, 1, 0), 60);
    d.width = 5;
    d.height = 3;
    d.spp = 2;
    d.threads = 1;
    return d;
}

/* Largest difference of the pixels from a grey value. */
static double off_grey(const pt_film *f, double value)
{
    double worst = 0;
    int x, y;
    for (y = 0; y < f->height; y++)
        for (x = 0; x < f->width; x++) {
            const pt_rgbd v = pt_film_pixel(f, x, y);
            worst = fmax(worst, fmax(fabs(v.r - value), fmax(fabs(v.g - value), fabs(v.b - value))));
        }
    return worst;
}

/* No primitive, no light, or both: black, or the sky. */
static void empty_scenes(void)
{
    int kind, m, count;
    const pt_method *const method = pt_methods(&count);
    for (kind = 0; kind < 4; kind++)
        for (m = 0; m < count; m++) {
            static const char *const name[4] = {"nothing", "sky only", "ball without light",
                                                "light of no radiance"};
            pt_scene s = PT_SCENE_INIT;
            pt_film film = PT_FILM_INIT;
            pt_render_desc d = small_desc();
            pt_light_sample_result sample;
            double pmf;
            pt_hit hit;
            const pt_ray ray = pt_camera_ray(&d.camera, 1, (pt_real)0.5, (pt_real)0.5, pt_v2(0, 0));
            if (kind == 1) pt_set_environment(&s, grey(0.75));
            if (kind >= 2)
                pt_add_sphere(&s, v3(0, 0, 0), 1, pt_add_material(&s, pt_material_diffuse(grey(0.5))));
            if (kind == 3) {
                pt_add_point_light(&s, v3(0, 2, 0), grey(0));
                pt_add_sphere(&s, v3(0, 3, 0), 1, pt_add_material(&s, pt_material_emitter(grey(0))));
            }
            d.method = method[m].name;
            pt_check(pt_commit(&s) == PT_OK && pt_render(&s, &d, &film, NULL) == PT_OK, name[kind], "%s",
                     pt_scene_error(&s));
            pt_check(film.half[0] && off_grey(&film, kind == 1 ? 0.75 : 0) <= 1e-6,
                     label("%s, %s", name[kind], method[m].name), "off by %g",
                     film.half[0] ? off_grey(&film, kind == 1 ? 0.75 : 0) : -1);
            pt_check(kind == 1 || (pt_light_choose(&s, 0.5, &pmf) == -1 &&
                                   !pt_light_sample(&s, 0, v3(0, 0, 0), pt_v2(0, 0), &sample)),
                     label("%s, lights", name[kind]), "there is one");
            pt_check(pt_intersect(&s, &ray, &hit) == (kind >= 2) && pt_occluded(&s, &ray) == (kind >= 2),
                     label("%s, ray", name[kind]), "another answer");
            pt_film_free(&film);
            pt_scene_free(&s);
        }
}

/* Triangles and parallelograms without area are counted, never hit, and light nothing. */
static void degenerate_shapes(void)
{
    const pt_vec3 a = v3(0, 0, 0), b = v3(1, 0, 0), tiny = v3(1e-30, 0, 0);
    pt_scene s = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_render_desc d = small_desc();
    const int m = pt_add_material(&s, pt_material_emitter(grey(5)));
    int i;
    pt_add_triangle(&s, a, a, a, m);
    pt_add_triangle(&s, a, b, b, m);
    pt_add_triangle(&s, a, b, v3(2, 0, 0), m);
    pt_add_triangle(&s, a, b, v3(0.5, 0, 0), m);
    pt_add_parallelogram(&s, v3(-1, -1, 0), v3(2, 0, 0), v3(4, 0, 0), m);
    pt_add_parallelogram(&s, v3(-1, -1, 0), v3(0, 0, 0), v3(0, 0, 0), m);
    pt_add_parallelogram(&s, v3(1e3, 0, 0), tiny, v3(0, 1e-30, 0), m);
    pt_add_quad(&s, a, b, b, a, m);
    pt_check(pt_commit(&s) == PT_OK && s.primitive_count == 0 && s.degenerate_count == 9 &&
                 s.light_count == 0,
             "shapes without area", "%u primitives, %u degenerate, %u lights", (unsigned)s.primitive_count,
             (unsigned)s.degenerate_count, (unsigned)s.light_count);
    pt_check(pt_render(&s, &d, &film, NULL) == PT_OK && off_grey(&film, 0) == 0,
             "shapes without area, picture", "is not black");
    pt_film_free(&film);
    pt_add_parallelogram(&s, v3(-9, -9, -1), v3(18, 0, 0), v3(0, 18, 0), m);
    pt_check(pt_commit(&s) == PT_OK && s.primitive_count == 1 && s.light_count == 1,
             "one with area among them", "is lost");
    pt_check(pt_render(&s, &d, &film, NULL) == PT_OK && off_grey(&film, 5) <= 1e-6,
             "one with area among them, picture", "off by %g", off_grey(&film, 5));
    pt_film_free(&film);
    for (i = 0; i < 40; i++)
        pt_add_triangle(&s, v3(i, 0, 0), v3(i, 0, 0), v3(i, 1, 0), m); /* enough for a tree */
    pt_check(pt_commit(&s) == PT_OK && s.primitive_count == 1 && s.degenerate_count == 49,
             "many without area", "%u primitives, %u degenerate", (unsigned)s.primitive_count,
             (unsigned)s.degenerate_count);
    pt_scene_free(&s);
}

/* The largest and the smallest things that are accepted: finite pixels, and no crash. */
static void extreme_sizes(void)
{
    static const double size[5] = {1e-30, 1e-9, 1, 1e9, 1e17};
    int i, kind;
    for (i = 0; i < 5; i++)
        for (kind = 0; kind < 3; kind++) {
            const double k = size[i];
            pt_scene s = PT_SCENE_INIT;
            pt_film film = PT_FILM_INIT;
            pt_render_desc d = small_desc();
            pt_report r = PT_REPORT_INIT;
            const int m = pt_add_material(&s, kind == 2 ? pt_material_dielectric((pt_real)1.5)
                                                        : pt_material_diffuse(grey(1)));
            d.camera = pt_camera_look_at(v3(0, 0, 3 * k), v3(0, 0, 0), v3(0, 1, 0), 60);
            d.width = d.height = 8;
            pt_add_sphere(&s, v3(0, 0, 0), (pt_real)k, m);
            pt_add_parallelogram(&s, v3(-2 * k, -k, -2 * k), v3(0, 0, 4 * k), v3(4 * k, 0, 0), m);
            if (kind == 0)
                pt_set_environment(&s, grey(1));
            else
                pt_add_sphere(&s, v3(2 * k, 3 * k, 0), (pt_real)k,
                              pt_add_material(&s, pt_material_emitter(grey(1e30))));
            pt_check(pt_commit(&s) == PT_OK, label("scene of size %g", k), "%s", pt_scene_error(&s));
            pt_check(pt_render(&s, &d, &film, &r) == PT_OK && r.nonfinite == 0,
                     label("scene of size %g, kind %d", k, kind), "%s, %g contributions not finite",
                     r.error ? r.error : "", (double)r.nonfinite);
            pt_film_free(&film);
            pt_report_free(&r);
            pt_scene_free(&s);
        }
}

static void tiny_pictures(void)
{
    static const int size[4][2] = {{1, 1}, {1, 9}, {9, 1}, {2, 1}};
    pt_scene s = PT_SCENE_INIT;
    int i;
    pt_set_environment(&s, grey(0.5));
    pt_commit(&s);
    for (i = 0; i < 4; i++) {
        pt_render_desc d = small_desc();
        pt_film film = PT_FILM_INIT;
        d.width = size[i][0];
        d.height = size[i][1];
        d.spp = 1;
        d.threads = 7;
        pt_check(pt_render(&s, &d, &film, NULL) == PT_OK && film.width == size[i][0] &&
                     film.height == size[i][1] && pt_film_spp(&film) == 1 && off_grey(&film, 0.5) == 0,
                 label("picture of %d x %d", size[i][0], size[i][1]), "is wrong");
        pt_film_free(&film);
    }
    pt_scene_free(&s);
}

/* ---- order of calls --------------------------------------------------------------------------------- */

static void order_of_calls(void)
{
    pt_scene s = PT_SCENE_INIT;
    pt_render_desc d = small_desc();
    pt_film film = PT_FILM_INIT, fresh = PT_FILM_INIT;
    pt_report r = PT_REPORT_INIT;
    const pt_ray ray = pt_camera_ray(&d.camera, 1, (pt_real)0.5, (pt_real)0.5, pt_v2(0, 0));
    pt_hit hit;
    char words[8] = "xxxxxxx";
    int m, i;
    pt_check(pt_render(&s, &d, &film, &r) == PT_ERROR_NOT_COMMITTED && r.error && r.error[0],
             "render before commit", "%s", r.error ? r.error : "no sentence");
    m = pt_add_material(&s, pt_material_emitter(grey(1)));
    pt_add_sphere(&s, v3(0, 0, 0), 1, m);
    pt_check(!pt_intersect(&s, &ray, &hit) && !pt_occluded(&s, &ray), "ray before commit", "hits something");
    pt_check(pt_scene_needs(&s) == 0, "needs before commit", "%x", pt_scene_needs(&s));
    for (i = 0; i < 5; i++) { /* each change asks for another commit */
        pt_check(pt_commit(&s) == PT_OK && pt_commit(&s) == PT_OK && pt_render(&s, &d, &film, &r) == PT_OK,
                 "commit twice, render", "fails");
        pt_film_free(&film);
        if (i == 0) pt_add_sphere(&s, v3(0, 2, 0), (pt_real)0.5, m);
        if (i == 1) pt_add_material(&s, pt_material_mirror(grey(1)));
        if (i == 2) pt_add_point_light(&s, v3(0, 2, 2), grey(1));
        if (i == 3) pt_set_environment(&s, grey(1));
        if (i == 4) pt_add_quad(&s, v3(-3, -1, -3), v3(-3, -1, 3), v3(3, -1, 3), v3(3, -1, -3), 1);
        pt_check(pt_render(&s, &d, &film, &r) == PT_ERROR_NOT_COMMITTED, label("render after change %d", i),
                 "renders what it was before");
    }
    pt_check(pt_commit(&s) == PT_OK && pt_render(&s, &d, &film, &r) == PT_OK, "render after all changes",
             "fails");
    pt_check(pt_scene_needs_string(&s, words, sizeof words) == words && strlen(words) < sizeof words &&
                 strcmp(pt_scene_needs_string(&s, words, 0), "") == 0 &&
                 pt_scene_needs_string(&s, words, 1)[0] == 0,
             "needs in a small buffer", "'%s'", words);
    pt_scene_free(&s);
    m = pt_add_material(&s, pt_material_emitter(grey(1))); /* the same in one go: the same bits */
    pt_add_material(&s, pt_material_mirror(grey(1)));
    pt_add_quad(&s, v3(-3, -1, -3), v3(-3, -1, 3), v3(3, -1, 3), v3(3, -1, -3), 1);
    pt_add_sphere(&s, v3(0, 0, 0), 1, m);
    pt_add_sphere(&s, v3(0, 2, 0), (pt_real)0.5, m);
    pt_set_environment(&s, grey(1));
    pt_add_point_light(&s, v3(0, 2, 2), grey(1));
    pt_check(pt_commit(&s) == PT_OK && pt_render(&s, &d, &fresh, &r) == PT_OK, "scene in one go", "fails");
    pt_check(memcmp(film.half[0], fresh.half[0], 3 * 15 * sizeof(double)) == 0 &&
                 film.fingerprint == fresh.fingerprint,
             "re-committed = made in one go", "the films differ");
    pt_film_free(&film);
    pt_film_free(&fresh);
    pt_report_free(&r);
    pt_scene_free(&s);
}

static void freeing_twice(void)
{
    pt_scene s = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT;
    pt_report r = PT_REPORT_INIT;
    pt_splat_list list = PT_SPLAT_LIST_INIT;
    pt_render_desc d = small_desc();
    pt_alias table = {NULL, 0};
    const double weights[3] = {1, 2, 3};
    int i;
    s.alloc_user = film.alloc_user = r.alloc_user = list.alloc_user = &d;
    pt_add_sphere(&s, v3(0, 0, 0), 1, pt_add_material(&s, pt_material_emitter(grey(1))));
    pt_check(pt_commit(&s) == PT_OK && pt_render(&s, &d, &film, &r) == PT_OK &&
                 pt_splat_add(&list, 0, 0, grey(1)) == PT_OK &&
                 pt_alias_make(&table, weights, 3, &d) == PT_OK,
             "things to be freed", "cannot be made");
    for (i = 0; i < 2; i++) {
        pt_scene_free(&s);
        pt_film_free(&film);
        pt_report_free(&r);
        pt_splat_list_free(&list);
        pt_alias_free(&table, &d);
    }
    pt_check(s.alloc_user == &d && film.alloc_user == &d && r.alloc_user == &d && list.alloc_user == &d,
             "alloc_user after freeing", "is lost");
    pt_check(s.material_count == 0 && s.materials == NULL && film.half[0] == NULL && r.rows == NULL &&
                 list.items == NULL,
             "after freeing", "something is left");
    pt_check(pool.strange == 0 && pool.live == 0, "freeing twice", "%d strange frees, %ld blocks left",
             pool.strange, pool.live);
}

/* ---- what is asked of the driver -------------------------------------------------------------------- */

/* A field of pt_render_desc spoiled by a value; the sentence must hold the word. */
typedef enum field_type { INT_FIELD, REAL_FIELD, DOUBLE_FIELD, UNSIGNED_FIELD } field_type;

typedef struct spoiled {
    size_t offset;
    field_type type;
    double value;
    const char *word;
} spoiled;

#define FIELD(name) offsetof(pt_render_desc, name)

static const spoiled SPOILED[] = {
    {FIELD(width), INT_FIELD, -1, "width"},
    {FIELD(width), INT_FIELD, 65537, "width"},
    {FIELD(height), INT_FIELD, -5, "height"},
    {FIELD(height), INT_FIELD, INT_MAX, "height"},
    {FIELD(tile), INT_FIELD, -1, "tile"},
    {FIELD(tile), INT_FIELD, INT_MAX, "tile"},
    {FIELD(threads), INT_FIELD, -1, "threads"},
    {FIELD(camera.tan_half), REAL_FIELD, 0, "camera"},
    {FIELD(camera.tan_half), REAL_FIELD, (double)NAN, "camera"},
    {FIELD(camera.tan_half), REAL_FIELD, -1, "camera"},
    {FIELD(camera.position.y), REAL_FIELD, (double)NAN, "camera"},
    {FIELD(camera.forward.z), REAL_FIELD, 0, "camera"},
    {FIELD(camera.up.y), REAL_FIELD, 0.5, "camera"},
    {FIELD(camera.lens_radius), REAL_FIELD, -1, "lens"},
    {FIELD(camera.lens_radius), REAL_FIELD, (double)NAN, "lens"},
    {FIELD(camera.focus_distance), REAL_FIELD, -1, "focus"},
    {FIELD(camera.focus_distance), REAL_FIELD, HUGE_VAL, "focus"},
    {FIELD(camera.near_distance), REAL_FIELD, -1, "near"},
    {FIELD(seconds), DOUBLE_FIELD, -1, "seconds"},
    {FIELD(seconds), DOUBLE_FIELD, (double)NAN, "seconds"},
    {FIELD(cpu_seconds), DOUBLE_FIELD, -1, "cpu_seconds"},
    {FIELD(target_error), DOUBLE_FIELD, -0.1, "target_error"},
    {FIELD(target_error), DOUBLE_FIELD, (double)NAN, "target_error"},
    {FIELD(sampler), INT_FIELD, 17, "sampler"},
    {FIELD(sampler), INT_FIELD, -1, "sampler"},
    {FIELD(sampler), INT_FIELD, PT_SAMPLER_GIVEN, "sampler"},
    {FIELD(li.max_edges), INT_FIELD, -1, "max_edges"},
    {FIELD(li.roulette), INT_FIELD, 5, "roulette"},
    {FIELD(li.roulette), INT_FIELD, PT_ROULETTE_NONE, "max_edges"},
    {FIELD(li.roulette_survival), REAL_FIELD, 1, "roulette_survival"},
    {FIELD(li.roulette_survival), REAL_FIELD, -0.5, "roulette_survival"},
    {FIELD(li.roulette_survival), REAL_FIELD, (double)NAN, "roulette_survival"},
    {FIELD(li.roulette_scale), REAL_FIELD, -0.5, "roulette_scale"},
    {FIELD(li.roulette_scale), REAL_FIELD, (double)INFINITY, "roulette_scale"},
    {FIELD(li.roulette_scale), REAL_FIELD, (double)NAN, "roulette_scale"},
    {FIELD(li.roulette_start), INT_FIELD, -1, "roulette_start"},
    {FIELD(li.heuristic), INT_FIELD, 3, "heuristic"},
    {FIELD(first_sample), UNSIGNED_FIELD, 4294967295.0, "first_sample"},
    {FIELD(spp), UNSIGNED_FIELD, 4294967295.0, "first_sample"},
};

/* Enumerations have the size of an int on every compiler that this is built with. */
static void spoil(pt_render_desc *d, const spoiled *s)
{
    unsigned char *const at = (unsigned char *)d + s->offset;
    const int as_int = s->type == INT_FIELD ? (int)s->value : 0;
    const uint32_t as_unsigned = s->type == UNSIGNED_FIELD ? (uint32_t)s->value : 0;
    const pt_real as_real = (pt_real)s->value;
    if (s->type == INT_FIELD) memcpy(at, &as_int, sizeof as_int);
    if (s->type == UNSIGNED_FIELD) memcpy(at, &as_unsigned, sizeof as_unsigned);
    if (s->type == REAL_FIELD) memcpy(at, &as_real, sizeof as_real);
    if (s->type == DOUBLE_FIELD) memcpy(at, &s->value, sizeof s->value);
}

/* Refused with a sentence that holds the word, and nothing made. */
static void check_desc(const char *name, const pt_scene *s, const pt_render_desc *d, const char *word)
{
    pt_film film = PT_FILM_INIT;
    pt_report r = PT_REPORT_INIT;
    FILE *const nowhere = tmpfile();
    const pt_result result = pt_render(s, d, &film, &r);
    pt_check(result == PT_ERROR_ARGUMENT && r.error && strstr(r.error, word) && film.half[0] == NULL &&
                 r.row_count == 0,
             name, "%s: %s", pt_result_string(result), r.error ? r.error : "no sentence");
    pt_check(pt_render(s, d, &film, NULL) == PT_ERROR_ARGUMENT, label("%s, without a report", name),
             "is accepted");
    if (nowhere) pt_report_print(&r, nowhere); /* a report of nothing is printed too */
    if (nowhere) fclose(nowhere);
    pt_film_free(&film);
    pt_report_free(&r);
}

static void bad_descs(void)
{
    pt_scene s = PT_SCENE_INIT;
    pt_render_desc d = small_desc();
    size_t i;
    pt_set_environment(&s, grey(1));
    pt_commit(&s);
    for (i = 0; i < sizeof SPOILED / sizeof SPOILED[0]; i++) {
        d = small_desc();
        if (SPOILED[i].offset == FIELD(spp)) d.first_sample = 7;
        spoil(&d, &SPOILED[i]);
        check_desc(label("desc %d: %s %g", (int)i, SPOILED[i].word, SPOILED[i].value), &s, &d,
                   SPOILED[i].word);
    }
    d = small_desc();
    memset(&d.camera, 0, sizeof d.camera);
    check_desc("desc without a camera", &s, &d, "camera");
    d = small_desc();
    d.method = "no such method";
    check_desc("desc with an unknown method", &s, &d, "method");
    pt_scene_free(&s);
}

/* Films of no size, and of one that no memory holds. */
static void bad_films(void)
{
    static const int size[7][2] = {{0, 1},      {1, 0}, {-1, -1}, {65537, 1}, {1, 65537}, {INT_MAX, INT_MAX},
                                   {INT_MIN, 4}};
    pt_film f = PT_FILM_INIT;
    pt_error e;
    int i;
    for (i = 0; i < 7; i++)
        pt_check(pt_film_make(&f, size[i][0], size[i][1], i & 1) == PT_ERROR_ARGUMENT && f.half[0] == NULL,
                 label("film of %d x %d", size[i][0], size[i][1]), "is made");
    for (i = 0; i < 2; i++)
        pt_check(pt_film_make(&f, 65536, 65536, i) == PT_ERROR_MEMORY && f.half[0] == NULL && f.depth == NULL,
                 "film of 65536 x 65536", "is not refused by memory");
    pt_check(pt_film_spp(&f) == 0 && pt_film_error_estimate(&f, &e) == 0, "error of an empty film",
             "is known");
    pt_film_free(&f);
    pt_check(pool.live == 0 && pool.strange == 0, "films refused", "%ld blocks left", pool.live);
}

static void bad_cameras(void)
{
    const double nan = (double)NAN, inf = HUGE_VAL;
    const struct {
        pt_vec3 eye, target, up;
        double fov;
        const char *name;
    } c[12] = {{{0, 0, 0}, {0, 0, 0}, {0, 1, 0}, 40, "eye = target"},
               {{0, 0, 0}, {0, 5, 0}, {0, 1, 0}, 40, "up along the view"},
               {{0, 0, 0}, {0, 0, -1}, {0, 0, 0}, 40, "no up"},
               {{0, 0, 0}, {0, 0, -1}, {0, 1, 0}, 0, "field 0"},
               {{0, 0, 0}, {0, 0, -1}, {0, 1, 0}, 180, "field 180"},
               {{0, 0, 0}, {0, 0, -1}, {0, 1, 0}, -40, "negative field"},
               {{0, 0, 0}, {0, 0, -1}, {0, 1, 0}, nan, "field not a number"},
               {{0, 0, 0}, {0, 0, -1}, {0, 1, 0}, inf, "infinite field"},
               {{0, (pt_real)NAN, 0}, {0, 0, -1}, {0, 1, 0}, 40, "eye not a number"},
               {{0, 0, 0}, {0, 0, (pt_real)HUGE_VAL}, {0, 1, 0}, 40, "target infinite"},
               {{0, 0, 0}, {0, 0, -1}, {0, (pt_real)NAN, 0}, 40, "up not a number"},
               {{0, 0, 0}, {0, (pt_real)5, 0}, {0, (pt_real)-1, 0}, 40, "up against the view"}};
    pt_scene s = PT_SCENE_INIT;
    int i;
    pt_commit(&s);
    for (i = 0; i < 12; i++) {
        pt_render_desc d = small_desc();
        pt_film film = PT_FILM_INIT;
        d.camera = pt_camera_look_at(c[i].eye, c[i].target, c[i].up, (pt_real)c[i].fov);
        pt_check(d.camera.tan_half == 0 && pt_render(&s, &d, &film, NULL) == PT_ERROR_ARGUMENT,
                 label("camera: %s", c[i].name), "is accepted");
        pt_film_free(&film);
    }
    for (i = 0; i < 3; i++) { /* almost parallel, and the ends of the field: finite unit rays */
        const double fov[3] = {1e-3, 179.9, 90};
        const pt_camera camera =
            pt_camera_look_at(v3(0, 0, 0), v3(0, 1, i == 2 ? 1e-4 : 1), v3(0, 1, 0), (pt_real)fov[i]);
        const pt_ray r = pt_camera_ray(&camera, 2, 1, 0, pt_v2(0, 0));
        pt_check(camera.tan_half > 0 && fabs((double)pt_v3_length(r.d) - 1) < 1e-5,
                 label("camera of %g degrees", fov[i]), "ray of length %g", (double)pt_v3_length(r.d));
    }
    pt_scene_free(&s);
}

/* ---- building blocks -------------------------------------------------------------------------------- */

/* Rays that are no rays miss, and leave no trace. */
static void bad_rays(void)
{
    static const char *const name[8] = {"no direction",        "tmax 0",
                                        "tmax negative",       "tmax not a number",
                                        "origin not a number", "direction not a number",
                                        "infinite origin",     "infinite direction"};
    const pt_real nan = (pt_real)NAN, inf = (pt_real)HUGE_VAL;
    pt_scene s = PT_SCENE_INIT;
    int i, k, m = pt_add_material(&s, pt_material_emitter(grey(1)));
    for (k = 0; k < 12; k++) pt_add_sphere(&s, v3(0, 0, -3 * k), 1, m);
    pt_add_parallelogram(&s, v3(-9, -9, -50), v3(18, 0, 0), v3(0, 18, 0), m);
    pt_add_triangle(&s, v3(-9, -9, -60), v3(9, -9, -60), v3(0, 9, -60), m);
    pt_commit(&s);
    for (i = 0; i < 8; i++) {
        pt_ray r = {{0, 0, 5}, {0, 0, -1}, (pt_real)1e30};
        pt_li_options options;
        pt_li_info info;
        pt_sampler sampler = pt_sampler_make(PT_SAMPLER_SOBOL, 1, 0);
        pt_hit hit;
        pt_rgbd v;
        double t, b[2];
        memset(&options, 0, sizeof options);
        memset(&info, 0, sizeof info);
        if (i == 0) r.d = pt_v3(0, 0, 0);
        if (i == 1) r.tmax = 0;
        if (i == 2) r.tmax = -1;
        if (i == 3) r.tmax = nan;
        if (i == 4) r.o.x = nan;
        if (i == 5) r.d.y = nan;
        if (i == 6) r.o.z = inf;
        if (i == 7) r.d.z = -inf;
        pt_check(!pt_intersect(&s, &r, &hit) && !pt_occluded(&s, &r), label("ray with %s", name[i]),
                 "hits the scene");
        pt_check(!pt_intersect_sphere(&r, pt_v3(0, 0, 0), 1, &t) &&
                     !pt_intersect_triangle(&r, v3(-9, -9, -60), v3(9, -9, -60), v3(0, 9, -60), &t, b),
                 label("ray with %s, shapes", name[i]), "hits one");
        pt_sampler_start(&sampler, 0, 0);
        v = pt_li_path(&s, &r, &sampler, &options, &info);
        /* pt_li_path looks as far as there is anything: tmax does not matter */
        pt_check(v.r == (i >= 1 && i <= 3) && v.g == v.r && v.b == v.r,
                 label("ray with %s, radiance", name[i]), "%g", v.r);
    }
    pt_scene_free(&s);
}

/* Shapes that are no shapes are missed. */
static void bad_shapes(void)
{
    const pt_ray r = {{0, 0, 5}, {0, 0, -1}, (pt_real)1e30};
    const pt_real nan = (pt_real)NAN, inf = (pt_real)HUGE_VAL;
    double t, b[2];
    pt_check(!pt_intersect_sphere(&r, v3(0, 0, 0), 0, &t) && !pt_intersect_sphere(&r, v3(0, 0, 0), -1, &t) &&
                 !pt_intersect_sphere(&r, v3(0, 0, 0), nan, &t) &&
                 !pt_intersect_sphere(&r, pt_v3(nan, 0, 0), 1, &t) &&
                 !pt_intersect_sphere(&r, pt_v3(0, inf, 0), 1, &t),
             "spheres that are none", "one is hit");
    pt_check(!pt_intersect_triangle(&r, pt_v3(nan, 0, 0), v3(1, 0, 0), v3(0, 1, 0), &t, b) &&
                 !pt_intersect_triangle(&r, v3(-1, -1, 0), v3(0, 0, 0), v3(1, 1, 0), &t, b) &&
                 !pt_intersect_triangle(&r, v3(0, 0, 0), v3(0, 0, 0), v3(0, 0, 0), &t, b) &&
                 !pt_intersect_triangle(&r, v3(-1, -1, 0), pt_v3(inf, -1, 0), v3(0, 1, 0), &t, b),
             "triangles that are none", "one is hit");
    pt_check(!pt_intersect_box(&r, v3(1, 1, 1), v3(-1, -1, -1)) &&
                 !pt_intersect_box(&r, pt_v3(nan, 0, 0), v3(1, 1, 1)),
             "boxes that are none", "one is hit");
}

static void bad_light_indices(void)
{
    static const int index[4] = {-1, 1, INT_MAX, INT_MIN};
    pt_scene s = PT_SCENE_INIT;
    pt_light_sample_result sample;
    pt_light_emission_result emission;
    int i;
    pt_add_sphere(&s, v3(0, 0, 0), 1, pt_add_material(&s, pt_material_emitter(grey(1))));
    pt_commit(&s);
    for (i = 0; i < 4; i++)
        pt_check(!pt_light_sample(&s, index[i], v3(0, 0, 5), pt_v2(0, 0), &sample) &&
                     pt_light_pdf_w(&s, index[i], v3(0, 0, 5), v3(0, 0, 1), NULL) == 0 &&
                     !pt_light_sample_le(&s, index[i], pt_v2(0, 0), pt_v2(0, 0), 0, &emission),
                 label("light %d", index[i]), "exists");
    pt_check(pt_light_pdf_w(&s, 0, v3(0, 0, 5), v3(0, 0, 1), NULL) == 0, "a lamp as environment", "has a density");
    pt_scene_free(&s);
}

static double one(const double *u, void *user)
{
    (void)u;
    (void)user;
    return 1;
}

static void warp_one(const double *u, double *x, void *user)
{
    (void)user;
    x[0] = u[0];
}

/* Each estimator refuses each field out of its range. */
static void bad_integrals(void)
{
    static const double half[2] = {0.5, 0.5}, too_much[2] = {0.7, 0.7}, negative[2] = {-0.5, 1.5};
    static const int counts[2] = {1, 1}, no_counts[2] = {0, 0}, minus[2] = {-1, 2};
    pt_technique t[2];
    pt_estimate e;
    int i;
    for (i = 0; i < 2; i++) {
        t[i].warp = warp_one;
        t[i].density = one;
        t[i].user = NULL;
    }
    for (i = 0; i < 7; i++) {
        pt_integral p = {one, NULL, 1, 64, PT_SAMPLER_SOBOL, 1};
        const pt_result expected = i == 0 ? PT_OK : PT_ERROR_ARGUMENT;
        if (i == 1) p.dimensions = 0;
        if (i == 2) p.dimensions = 65;
        if (i == 3) p.n = 31;
        if (i == 4) p.f = NULL;
        if (i == 5) p.sampler = PT_SAMPLER_GIVEN;
        if (i == 6) p.sampler = (pt_sampler_kind)99;
        pt_check(pt_estimate_mean(&p, &e) == expected && (i > 0 || e.value == 1),
                 label("integral %d, mean", i), "%g", e.value);
        pt_check(pt_estimate_antithetic(&p, &e) == expected, label("integral %d, antithetic", i),
                 "another result");
        pt_check(pt_estimate_importance(&p, t, &e) == expected, label("integral %d, importance", i),
                 "another result");
        pt_check(pt_estimate_control(&p, one, 1, 0.5, &e) == expected, label("integral %d, control", i),
                 "another result");
        pt_check(pt_estimate_mis(&p, t, counts, 2, PT_HEURISTIC_POWER, &e) == expected,
                 label("integral %d, MIS", i), "another result");
        pt_check(pt_estimate_mis_one(&p, t, half, 2, PT_HEURISTIC_POWER, &e) == expected,
                 label("integral %d, one-sample MIS", i), "another result");
        pt_check(pt_estimate_roulette(&p, 0.5, &e) == expected, label("integral %d, roulette", i),
                 "another result");
        if (i > 0) continue;
        pt_check(pt_estimate_mis(&p, t, counts, 0, PT_HEURISTIC_POWER, &e) == PT_ERROR_ARGUMENT &&
                     pt_estimate_mis(&p, t, counts, 9, PT_HEURISTIC_POWER, &e) == PT_ERROR_ARGUMENT &&
                     pt_estimate_mis(&p, t, minus, 2, PT_HEURISTIC_POWER, &e) == PT_ERROR_ARGUMENT &&
                     pt_estimate_mis(&p, t, no_counts, 2, PT_HEURISTIC_POWER, &e) == PT_ERROR_ARGUMENT,
                 "MIS of bad counts", "is made");
        pt_check(pt_estimate_mis_one(&p, t, too_much, 2, PT_HEURISTIC_POWER, &e) == PT_ERROR_ARGUMENT &&
                     pt_estimate_mis_one(&p, t, negative, 2, PT_HEURISTIC_POWER, &e) == PT_ERROR_ARGUMENT,
                 "MIS of bad shares", "is made");
        pt_check(pt_estimate_roulette(&p, 0, &e) == PT_ERROR_ARGUMENT &&
                     pt_estimate_roulette(&p, 1.5, &e) == PT_ERROR_ARGUMENT &&
                     pt_estimate_roulette(&p, (double)NAN, &e) == PT_ERROR_ARGUMENT,
                 "roulette of a bad q", "is made");
        pt_check(pt_estimate_splitting(&p, -1, 2, &e) == PT_ERROR_ARGUMENT &&
                     pt_estimate_splitting(&p, 2, 2, &e) == PT_ERROR_ARGUMENT &&
                     pt_estimate_splitting(&p, 0, 0, &e) == PT_ERROR_ARGUMENT,
                 "splitting of nothing", "is made");
    }
}

static void bad_numbers(void)
{
    const double some[3] = {1, -1, 2}, bad[2] = {1, (double)NAN}, huge[2] = {1e308, 1e308},
                 zero[3] = {0, 0, 0}, given[2] = {0.25, 0.5};
    pt_alias t = {NULL, 0};
    pt_sampler s;
    pt_stats stats = PT_STATS_INIT;
    pt_spectrum none = {NULL, NULL, 0, 0};
    const pt_vec3 v[3] = {{0, 0, 1}, {1, 0, 1}, {0, 1, 1}};
    pt_check(pt_alias_make(&t, some, 3, NULL) == PT_ERROR_ARGUMENT &&
                 pt_alias_make(&t, bad, 2, NULL) == PT_ERROR_ARGUMENT &&
                 pt_alias_make(&t, huge, 2, NULL) == PT_ERROR_ARGUMENT && t.count == 0,
             "alias table of bad weights", "is made");
    pt_check(pt_alias_make(&t, zero, 3, NULL) == PT_OK && t.count == 0 &&
                 pt_alias_make(&t, NULL, 0, NULL) == PT_OK && t.count == 0,
             "alias table of nothing", "is not empty");
    s = pt_sampler_make_given(given, 2);
    pt_sampler_start(&s, 0, 0);
    pt_check((double)pt_sampler_1d(&s) == 0.25 && (double)pt_sampler_1d(&s) == 0.5 && s.given_missing == 0,
             "given numbers", "come out changed");
    pt_check(pt_sampler_1d(&s) >= 0 && s.given_missing == 1 && pt_sampler_2d(&s).x < 1 &&
                 s.given_missing == 3,
             "given numbers used up", "%lu missing", (unsigned long)s.given_missing);
    s = pt_sampler_make_given(NULL, 0);
    pt_sampler_start(&s, 0, 0);
    pt_check(pt_sampler_1d(&s) < 1 && s.given_missing == 1, "no given numbers", "%lu missing",
             (unsigned long)s.given_missing);
    pt_check(pt_stats_variance(&stats) == 0 && pt_stats_standard_error(&stats) == 0 &&
                 pt_stats_skewness(&stats) == 0,
             "moments of nothing", "are not 0");
    pt_check(pt_irradiance_polygon(1, v3(0, 0, 0), v3(0, 0, 1), v, 2) == 0 &&
                 pt_irradiance_polygon(1, v3(0, 0, 0), v3(0, 0, 1), v, 33) == 0 &&
                 pt_irradiance_polygon(1, v3(0, 0, 0), v3(0, 0, 1), v, -1) == 0,
             "polygons of 2 and of 33 corners", "shine");
    pt_check(pt_spectrum_at(&none, 500) == 0, "spectrum without entries", "is not 0");
    pt_check(pt_srgb_byte((double)NAN) == 0 && pt_srgb_byte(-1) == 0 && pt_srgb_byte(HUGE_VAL) == 255 &&
                 pt_srgb_byte(-HUGE_VAL) == 0,
             "codes of no colour", "are not 0 and 255");
}

static void bad_names(void)
{
    static const char *const name[3] = {"", "Cornell", "no such scene"};
    int i;
    for (i = 0; i < 3; i++)
        pt_check(pt_scene_find(name[i]) == NULL, label("scene '%s'", name[i]), "is found");
    pt_check(pt_cornell_spectrum("purple").count == 0, "spectrum 'purple'", "exists");
    pt_check(pt_sampler_name((pt_sampler_kind)99) != NULL, "name of an unknown sampler", "is NULL");
}

/* ---- no memory -------------------------------------------------------------------------------------- */

static const char *file_name(void)
{
    static const char *name;
    if (!name) {
        FILE *const probe = fopen("build/test/test_input.probe", "wb");
        name = probe ? "build/test/test_input.tmp" : "test_input.tmp";
        if (probe) fclose(probe);
        remove("build/test/test_input.probe");
    }
    return name;
}

static int is_there(const char *name)
{
    FILE *const file = fopen(name, "rb");
    if (file) fclose(file);
    return file != NULL;
}

/* More items of each kind than an array holds at first, so that each grows once. */
static int fill_scene(pt_scene *s)
{
    static const uint32_t indices[3] = {0, 1, 2};
    const pt_vec3 p[3] = {{-3, -1, -3}, {3, -1, -3}, {0, -1, 3}}, n[3] = {{0, 1, 0}, {0, 1, 0}, {0, 1, 0}};
    const pt_vec2 uv[3] = {{0, 0}, {1, 0}, {0, 1}};
    int i, failed = 0;
    for (i = 0; i < 10; i++) {
        const int m =
            pt_add_material(s, i % 2 ? pt_material_emitter(grey(1)) : pt_material_diffuse(grey(0.5)));
        const int material = m < 0 ? 0 : m;
        failed += m < 0;
        failed += pt_add_sphere(s, v3(i - 5, 0, 0), (pt_real)0.4, material) < 0;
        failed += pt_add_parallelogram(s, v3(i - 5, 1, 0), v3(1, 0, 0), v3(0, 0, 1), material) < 0;
        failed += pt_add_mesh(s, p, n, uv, 3, indices, 1, material) < 0;
        failed += pt_add_triangle(s, p[0], p[1], v3(i, 1, 0), material) < 0;
        failed += pt_add_point_light(s, v3(i, 3, 0), grey(1)) < 0;
    }
    return failed;
}

/* Everything that needs memory, in one go. The first result that is not PT_OK; later steps are still
   tried. */
static pt_result everything(void *user)
{
    pt_scene s = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT, other = PT_FILM_INIT;
    pt_report r = PT_REPORT_INIT;
    pt_splat_list list = PT_SPLAT_LIST_INIT;
    const pt_report *reports[1];
    pt_render_desc d = small_desc();
    pt_result step[12];
    int i, n = 0;
    reports[0] = &r;
    s.alloc_user = film.alloc_user = other.alloc_user = r.alloc_user = list.alloc_user = user;
    d.aov = 1;
    if (fill_scene(&s) > 0) step[n++] = PT_ERROR_MEMORY;
    step[n++] = pt_commit(&s);
    if (n == 2 && step[1] != PT_ERROR_MEMORY)
        step[n++] = PT_ERROR_SCENE; /* a scene that could not be filled must say so */
    step[n++] = pt_render(&s, &d, &film, &r);
    if (step[n - 1] == PT_ERROR_NOT_COMMITTED && step[0] == PT_ERROR_MEMORY) step[n - 1] = PT_ERROR_MEMORY;
    d.first_sample = 2;
    step[n++] = pt_render(&s, &d, &other, NULL);
    if (step[n - 1] == PT_ERROR_NOT_COMMITTED && step[0] == PT_ERROR_MEMORY) step[n - 1] = PT_ERROR_MEMORY;
    if (pt_film_spp(&film) == 2 && pt_film_spp(&other) == 2) step[n++] = pt_film_merge(&film, &other);
    for (i = 0; i < 70; i++) {
        const pt_result result = pt_splat_add(&list, (uint32_t)i % 15, i & 1, grey(1));
        if (result != PT_OK && n < 8) step[n++] = result;
    }
    if (film.half[0] && list.count > 0) step[n++] = pt_film_add_splats(&film, &list);
    if (film.half[0]) {
        step[n++] = pt_write_png(file_name(), &film, 1);
        if (step[n - 1] != PT_OK) pt_check(!is_there(file_name()), "PNG without memory", "leaves a file");
        remove(file_name());
        step[n++] = pt_write_pfm(file_name(), &film);
        remove(file_name());
        step[n++] = pt_report_write_svg(reports, NULL, 1, NULL, file_name());
        remove(file_name());
    }
    pt_scene_free(&s);
    pt_film_free(&film);
    pt_film_free(&other);
    pt_report_free(&r);
    pt_splat_list_free(&list);
    for (i = 0; i < n; i++)
        if (step[i] != PT_OK) return step[i];
    return PT_OK;
}

/* Fails the k-th request (or all from it on) for k = 1, 2, ... until nothing fails any more. */
static void failing_memory(void)
{
    int mode;
    for (mode = 0; mode < 2; mode++) {
        int user, wrong = 0;
        long k = 0, leaked = 0, reached;
        pt_result result = PT_ERROR_MEMORY;
        do {
            pool_start(++k, mode);
            result = everything(&user);
            reached = pool.calls >= k;
            pool_start(0, 0);
            wrong += reached ? result != PT_ERROR_MEMORY : result != PT_OK;
            if (reached && result != PT_ERROR_MEMORY)
                printf("       request %ld failed, result: %s\n", k, pt_result_string(result));
            leaked += pool.live;
            pool.live = 0;
        } while (reached && k < 2000);
        pt_check(wrong == 0, mode ? "no memory from request k on" : "no memory for request k",
                 "%d of %ld runs did not end with PT_ERROR_MEMORY", wrong, k - 1);
        pt_check(leaked == 0 && pool.strange == 0,
                 mode ? "no memory from k on, leaks" : "no memory for k, leaks",
                 "%ld blocks, %d strange frees", leaked, pool.strange);
        pt_check(k > 40 && !reached, mode ? "requests from k on" : "requests", "only %ld were made to fail",
                 k - 1);
    }
}

/* Out of memory in pt_commit leaves the scene whole: the next pt_commit succeeds. With 200 spheres more it has a tree. */
static void committed_again(pt_tree tree, int more)
{
    pt_scene s = PT_SCENE_INIT;
    pt_film first = PT_FILM_INIT, film = PT_FILM_INIT;
    pt_render_desc d = small_desc();
    long k;
    s.tree = tree;
    pt_check(fill_scene(&s) == 0, "scene to commit again", "cannot be filled");
    for (k = 0; k < more; k++) pt_add_sphere(&s, v3((double)(k % 20) - 10, -3, (double)(k / 20)), (pt_real)0.2, 0);
    pt_check(pt_commit(&s) == PT_OK && pt_render(&s, &d, &first, NULL) == PT_OK, "scene to commit again", "fails");
    for (k = 1; k < 100; k++) {
        pt_result result;
        pool_start(k, 0);
        result = pt_commit(&s);
        pool_start(0, 0);
        if (result == PT_OK) break;
        pt_check(result == PT_ERROR_MEMORY && !s.committed && strstr(pt_scene_error(&s), "memory"),
                 label("commit without request %ld", k), "%s: %s", pt_result_string(result),
                 pt_scene_error(&s));
        pt_check(pt_render(&s, &d, &film, NULL) == PT_ERROR_NOT_COMMITTED, "render after a failed commit",
                 "is possible");
        pt_check(pt_commit(&s) == PT_OK && pt_render(&s, &d, &film, NULL) == PT_OK &&
                     memcmp(film.half[1], first.half[1], 45 * sizeof(double)) == 0,
                 label("commit after request %ld failed", k), "%s", pt_scene_error(&s));
        pt_film_free(&film);
    }
    pt_check(k > 5, "requests of pt_commit", "only %ld", k - 1);
    pt_film_free(&first);
    pt_scene_free(&s);
    pt_check(pool.live == 0 && pool.strange == 0, label("commit again with tree %d and %d spheres, leaks", (int)tree, more), "%ld blocks", pool.live);
}

static void commit_again(void)
{
    committed_again(PT_TREE_DEFAULT, 0);
    committed_again(PT_TREE_DEFAULT, 200);
    committed_again(PT_TREE_BINARY, 200);
}

/* A film keeps its finished passes when memory ends in a later render. */
static void film_survives(void)
{
    pt_scene s = PT_SCENE_INIT;
    pt_film film = PT_FILM_INIT, copy = PT_FILM_INIT;
    pt_render_desc d = small_desc();
    long k;
    int lost = 0;
    pt_set_environment(&s, grey(1));
    pt_commit(&s);
    pt_check(pt_render(&s, &d, &film, NULL) == PT_OK && pt_render(&s, &d, &copy, NULL) == PT_OK,
             "film of two samples", "fails");
    for (k = 1; k < 50; k++) {
        pt_result result;
        d.spp = 4;
        pool_start(k, 1);
        result = pt_render(&s, &d, &film, NULL);
        pool_start(0, 0);
        if (result == PT_OK) break;
        lost += result != PT_ERROR_MEMORY || film.half[0] == NULL || pt_film_spp(&film) < 2;
        if (pt_film_spp(&film) == 2) lost += memcmp(film.half[0], copy.half[0], 45 * sizeof(double)) != 0;
    }
    pt_check(lost == 0 && k > 3 && pt_film_spp(&film) == 4, "what is rendered is not lost", "%d of %ld times",
             lost, k - 1);
    pt_film_free(&film);
    pt_film_free(&copy);
    pt_scene_free(&s);
}

/* ---- two scenes at a time --------------------------------------------------------------------------- */

typedef struct pair {
    pt_scene scene[2];
    pt_render_desc desc[2];
    pt_film film[2];
    pt_result result[2];
} pair;

static void render_one(pair *p, int index)
{
    pt_report r = PT_REPORT_INIT;
    p->result[index] = pt_render(&p->scene[index], &p->desc[index], &p->film[index], &r);
    pt_report_free(&r);
}

#if PTI_HAS_THREADS && !defined(_WIN32)
static void *render_second(void *both)
{
    render_one((pair *)both, 1);
    return NULL;
}

static void render_both(pair *p)
{
    pthread_t thread;
    const int started = pthread_create(&thread, NULL, render_second, p) == 0;
    render_one(p, 0);
    if (started)
        pthread_join(thread, NULL);
    else
        render_one(p, 1);
}
#else
static void render_both(pair *p)
{
    render_one(p, 0);
    render_one(p, 1);
}
#endif

/* Two renders in two threads, each with threads of its own, give what they give alone. */
static void two_scenes(void)
{
    pair both, alone;
    int i;
    memset(&both, 0, sizeof both);
    memset(&alone, 0, sizeof alone);
    for (i = 0; i < 2; i++) {
        pt_camera camera;
        const pt_result made =
            i == 0 ? pt_scene_cornell(&both.scene[i], &camera) : pt_scene_glass_ball(&both.scene[i], &camera);
        pt_check(made == PT_OK, "two scenes", "cannot be made");
        both.desc[i] = small_desc();
        both.desc[i].camera = camera;
        both.desc[i].width = 32;
        both.desc[i].height = 24;
        both.desc[i].spp = 16;
        both.desc[i].threads = 2;
        alone.scene[i] = both.scene[i];
        alone.desc[i] = both.desc[i];
        render_one(&alone, i);
    }
    render_both(&both);
    for (i = 0; i < 2; i++) {
        pt_check(both.result[i] == PT_OK && alone.result[i] == PT_OK && both.film[i].half[0] != NULL &&
                     memcmp(both.film[i].half[0], alone.film[i].half[0], 3 * 32 * 24 * sizeof(double)) == 0 &&
                     memcmp(both.film[i].half[1], alone.film[i].half[1], 3 * 32 * 24 * sizeof(double)) == 0,
                 label("two scenes at a time, %d", i), "another film than alone");
        pt_film_free(&both.film[i]);
        pt_film_free(&alone.film[i]);
        pt_scene_free(&both.scene[i]);
    }
    /* one scene, two renders */
    memset(&both, 0, sizeof both);
    {
        pt_camera camera;
        pt_check(pt_scene_cornell_spheres(&both.scene[0], &camera) == PT_OK, "one scene twice",
                 "cannot be made");
        both.scene[1] = both.scene[0];
        for (i = 0; i < 2; i++) {
            both.desc[i] = small_desc();
            both.desc[i].camera = camera;
        }
    }
    render_both(&both);
    pt_check(both.result[0] == PT_OK && both.result[1] == PT_OK &&
                 memcmp(both.film[0].half[0], both.film[1].half[0], 45 * sizeof(double)) == 0,
             "one scene rendered twice at a time", "the films differ");
    pt_film_free(&both.film[0]);
    pt_film_free(&both.film[1]);
    pt_scene_free(&both.scene[0]);
    pt_check(pool.live == 0 && pool.strange == 0, "two scenes, leaks", "%ld blocks", pool.live);
}

static void nothing_left(void)
{
    pt_check(pool.live == 0 && pool.strange == 0, "all is freed", "%ld blocks are left, %d strange frees",
             pool.live, pool.strange);
}

int main(int argc, char **argv)
{
    pt_test_begin("test_input", argc, argv);
    pool.largest = (size_t)1 << 28;
    PT_TEST_EXACT(bad_materials);
    PT_TEST_EXACT(bad_material_kinds);
    PT_TEST_EXACT(bad_coordinates);
    PT_TEST_EXACT(bad_material_ids);
    PT_TEST_EXACT(bad_spheres_and_lights);
    PT_TEST_EXACT(bad_meshes);
    PT_TEST_EXACT(empty_meshes);
    PT_TEST_EXACT(bounds);
    PT_TEST_EXACT(first_error);
    PT_TEST_EXACT(result_strings);
    PT_TEST_EXACT(empty_scenes);
    PT_TEST_EXACT(degenerate_shapes);
    PT_TEST_EXACT(extreme_sizes);
    PT_TEST_EXACT(tiny_pictures);
    PT_TEST_EXACT(order_of_calls);
    PT_TEST_EXACT(freeing_twice);
    PT_TEST_EXACT(bad_descs);
    PT_TEST_EXACT(bad_films);
    PT_TEST_EXACT(bad_cameras);
    PT_TEST_EXACT(bad_rays);
    PT_TEST_EXACT(bad_shapes);
    PT_TEST_EXACT(bad_light_indices);
    PT_TEST_EXACT(bad_integrals);
    PT_TEST_EXACT(bad_numbers);
    PT_TEST_EXACT(bad_names);
    PT_TEST_EXACT(failing_memory);
    PT_TEST_EXACT(commit_again);
    PT_TEST_EXACT(film_survives);
    PT_TEST_EXACT(two_scenes);
    PT_TEST_EXACT(nothing_left);
    return pt_test_end();
}
