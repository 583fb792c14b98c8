/* embree.c - the rays of [PT-07b] against those of Embree 3, in one process, on the same meshes and rays.

   run:    make bench-embree                      three builds of this: -march=native, default flags, plain C lanes
   or:     cc -O2 -ffp-contract=off -I. tests/bench/embree.c -o embree -lembree3 -lm -pthread
           ./embree [mesh ...]                    cornell knot-1k knot-70k room-118k blob-870k grid-1m icosphere

   CSV on stdout: name,value,unit,reference,ratio,low,high. In each of RUNS runs the kernels take turns in chunks of rays, so
   that a machine that slows down does so for all of them. A value is a median, `ratio` the median of the ratios of the runs,
   to Embree's time for rays and for building, and low and high an interval that holds its median with 95 % probability:
   for 9 runs the second smallest and the second largest (binomial: 96 %). CPU seconds of one thread, but for
   rows that name two: those are wall seconds. Before all, much memory is allocated and freed: from then on glibc keeps what both
   sides free, as in any program that has had a picture; small meshes would measure how pages are given back and got again.

   Ray sets, 2^18 each: primary (a pinhole camera, scan-line order), diffuse (a cosine bounce from what those hit), random
   (between points in the bounding box, from before it) and shadow (from the same points to an area light above). Nearest
   hits are found as pt_intersect does before it fills in the point, its error and normals: primitive, t, u, v, which is
   what Embree tells, too; `intersect` is all of pt_intersect. shadow is pt_occluded. */

#define PT_STATIC
#define PT_ONLY_PATH
#define PT_NO_REPORT
#include "pathtracer.h"

#include <embree3/rtcore.h>
#include <pmmintrin.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { RUNS = 9, SIDE = 512, RAYS = SIDE * SIDE, CHUNK = RAYS / 16 };
enum { PRIMARY, DIFFUSE, RANDOM, SHADOW, SETS };
enum { OURS, FULL, FAST, ROBUST, KERNELS };
static const char *const SET_NAMES[SETS] = {"primary", "diffuse", "random", "shadow"};
#define VARIANT (PTI_LANES == 2 ? "avx2" : PTI_LANES == 1 ? "sse2" : "plain")

typedef struct mesh {
    pt_vec3 *v;
    uint32_t *index, vertices, triangles;
} mesh;

static pt_ray rays[SETS][RAYS];
static int hits[KERNELS];
static pt_pcg32 rng;

static float uniform(void) { return (float)pt_pcg32_double(&rng); }
static float spread(float low, float high) { return low + (high - low) * uniform(); }

/* ---- meshes ------------------------------------------------------------------------------------------------ */

static mesh new_mesh(uint32_t vertices, uint32_t triangles)
{
    mesh m;
    m.v = (pt_vec3 *)malloc((vertices + 1) * sizeof *m.v); /* Embree reads past the end */
    m.index = (uint32_t *)malloc(3 * (size_t)triangles * sizeof *m.index);
    m.vertices = vertices;
    m.triangles = triangles;
    if (!m.v || !m.index) abort();
    return m;
}

static void free_mesh(mesh *m)
{
    free(m->v);
    free(m->index);
}

/* Cell (i, j) of a grid of points: two triangles from number k on. */
static void two_triangles(mesh *m, uint32_t k, uint32_t a, uint32_t b, uint32_t c, uint32_t d)
{
    const uint32_t corner[6] = {a, b, c, a, c, d};
    memcpy(m->index + 3 * (size_t)k, corner, sizeof corner);
}

/* A tube of `sectors` around a (2,3) torus knot. */
static mesh make_knot(uint32_t rings, uint32_t sectors)
{
    mesh m = new_mesh(rings * sectors, 2 * rings * sectors);
    uint32_t i, j;
    for (i = 0; i < rings; i++) {
        const double s = 2 * PT_PI * i / rings, r = 2 + cos(3 * s), slope = -3 * sin(3 * s);
        const pt_vec3 centre = pt_v3((float)(r * cos(2 * s)), (float)sin(3 * s), (float)(r * sin(2 * s)));
        const pt_vec3 along = pt_v3_normalize(pt_v3((float)(slope * cos(2 * s) - 2 * r * sin(2 * s)), (float)(3 * cos(3 * s)),
                                                    (float)(slope * sin(2 * s) + 2 * r * cos(2 * s))));
        const pt_vec3 x = pt_v3_normalize(pt_v3_cross(along, pt_v3(0, 1, 0))), y = pt_v3_cross(x, along);
        for (j = 0; j < sectors; j++) {
            const double a = 2 * PT_PI * j / sectors;
            const uint32_t next_i = (i + 1) % rings * sectors, next_j = (j + 1) % sectors;
            m.v[i * sectors + j] = pt_v3_add(centre, pt_v3_add(pt_v3_scale(x, (float)(0.35 * cos(a))), pt_v3_scale(y, (float)(0.35 * sin(a)))));
            two_triangles(&m, 2 * (i * sectors + j), i * sectors + j, next_i + j, next_i + next_j, i * sectors + next_j);
        }
    }
    return m;
}

/* The six sides of a cube, n x n cells each, blown up to a ball with bumps. */
static mesh make_blob(uint32_t n, double bump)
{
    mesh m = new_mesh(6 * (n + 1) * (n + 1), 12 * n * n);
    uint32_t side, i, j, k = 0;
    for (side = 0; side < 6; side++)
        for (i = 0; i <= n; i++)
            for (j = 0; j <= n; j++) {
                const float u = 2 * (float)i / (float)n - 1, v = 2 * (float)j / (float)n - 1, w = side % 2 ? 1.0f : -1.0f;
                const uint32_t at = (side * (n + 1) + i) * (n + 1) + j;
                const pt_vec3 p = pt_v3_normalize(side < 2 ? pt_v3(w, u, v) : side < 4 ? pt_v3(v, w, u) : pt_v3(u, v, w));
                const double x = (double)p.x, y = (double)p.y, z = (double)p.z;
                const double wave = sin(9 * x) * sin(8 * y + 1) * sin(7 * z + 2) + 0.4 * sin(31 * x) * sin(29 * y) * sin(33 * z);
                m.v[at] = pt_v3_scale(p, (float)(1 + bump * wave));
                if (i == n || j == n) continue;
                two_triangles(&m, k, at, at + n + 1, at + n + 2, at + 1);
                k += 2;
            }
    return m;
}

static void append(mesh *to, const mesh *from, pt_vec3 move, float scale)
{
    uint32_t i;
    for (i = 0; i < from->vertices; i++) to->v[to->vertices + i] = pt_v3_add(pt_v3_scale(from->v[i], scale), move);
    for (i = 0; i < 3 * from->triangles; i++) to->index[3 * (size_t)to->triangles + i] = from->index[i] + to->vertices;
    to->vertices += from->vertices;
    to->triangles += from->triangles;
}

static mesh make_grid(void)
{
    mesh knot = make_knot(256, 34), all = new_mesh(64 * knot.vertices, 64 * knot.triangles);
    int i;
    all.vertices = all.triangles = 0;
    for (i = 0; i < 64; i++)
        append(&all, &knot, pt_v3(7 * (float)(i % 4) + uniform(), 3 * (float)(i / 16) + uniform(), 7 * (float)(i / 4 % 4) + uniform()), 1);
    free_mesh(&knot);
    return all;
}

/* Sides of a box that is turned around y; bit s of `sides`: x-, x+, y-, y+, z-, z+. */
static void append_box(mesh *m, pt_vec3 centre, pt_vec3 half, double turn, unsigned sides)
{
    static const uint32_t corner[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
    uint32_t i;
    for (i = 0; i < 8; i++) {
        const double x = (double)(i & 4 ? half.x : -half.x), z = (double)(i & 1 ? half.z : -half.z);
        m->v[m->vertices + i] = pt_v3_add(centre, pt_v3((float)(x * cos(turn) + z * sin(turn)), i & 2 ? half.y : -half.y,
                                                        (float)(z * cos(turn) - x * sin(turn))));
    }
    for (i = 0; i < 6; i++) {
        if (!(sides >> i & 1)) continue;
        two_triangles(m, m->triangles, m->vertices + corner[i][0], m->vertices + corner[i][1], m->vertices + corner[i][2], m->vertices + corner[i][3]);
        m->triangles += 2;
    }
    m->vertices += 8;
}

/* A room that is open towards the camera, with two blocks and a lamp: 36 triangles; and something in it. */
static mesh make_room(const mesh *inside)
{
    mesh m = new_mesh(32 + (inside ? inside->vertices : 0), 48 + (inside ? inside->triangles : 0));
    m.vertices = m.triangles = 0;
    append_box(&m, pt_v3(0, 0, 0), pt_v3(2.8f, 2.75f, 2.8f), 0, 47);
    append_box(&m, pt_v3(0.95f, -1.9f, -0.55f), pt_v3(0.8f, 0.8f, 0.8f), -0.3, 63);
    append_box(&m, pt_v3(-0.9f, -1.09f, 0.7f), pt_v3(0.8f, 1.65f, 0.8f), 0.29, 63);
    append_box(&m, pt_v3(0, 2.74f, 0), pt_v3(0.65f, 0, 0.52f), 0, 4);
    if (inside) append(&m, inside, pt_v3(0.9f, 0, -0.6f), 0.8f);
    return m;
}

/* The icosahedron, each triangle cut into four `levels` times; vertices are shared. */
static mesh make_icosphere(int levels)
{
    static const signed char p[12][3] = {{-1, 0, 2}, {1, 0, 2}, {-1, 0, -2}, {1, 0, -2}, {0, 2, 1}, {0, 2, -1},
                                         {0, -2, 1}, {0, -2, -1}, {2, 1, 0}, {-2, 1, 0}, {2, -1, 0}, {-2, -1, 0}};
    static const unsigned char f[60] = {0, 4, 1, 0, 9, 4, 9, 5, 4, 4, 5, 8, 4, 8, 1, 8, 10, 1, 8, 3, 10, 5, 3, 8, 5, 2, 3, 2, 7, 3,
                                        7, 10, 3, 7, 6, 10, 7, 11, 6, 11, 0, 6, 0, 1, 6, 6, 1, 10, 9, 0, 11, 9, 11, 2, 9, 2, 5, 7, 2, 11};
    const uint32_t triangles = 20u << 2 * levels;
    mesh m = new_mesh(12 + triangles, triangles); /* a cut adds three vertices a triangle */
    uint32_t i, k, n = 20;
    m.vertices = 12;
    for (i = 0; i < 12; i++) { /* coordinates 0, 1 and the golden ratio */
        float c[3];
        for (k = 0; k < 3; k++) c[k] = p[i][k] == 2 ? 1.618034f : p[i][k] == -2 ? -1.618034f : p[i][k];
        m.v[i] = pt_v3_normalize(pt_v3(c[0], c[1], c[2]));
    }
    for (i = 0; i < 60; i++) m.index[i] = f[i];
    for (; levels > 0; levels--, n *= 4)
        for (i = n; i-- > 0;) {
            uint32_t c[3], mid[3];
            memcpy(c, m.index + 3 * i, sizeof c);
            for (k = 0; k < 3; k++) { /* the sum of two floats does not depend on their order: both sides of an edge get the same point */
                mid[k] = m.vertices++;
                m.v[mid[k]] = pt_v3_normalize(pt_v3_add(m.v[c[k]], m.v[c[(k + 1) % 3]]));
            }
            {
                const uint32_t four[12] = {c[0], mid[0], mid[2], mid[0], c[1], mid[1], mid[2], mid[1], c[2], mid[0], mid[1], mid[2]};
                memcpy(m.index + 12 * (size_t)i, four, sizeof four);
            }
        }
    m.triangles = n;
    return m;
}

/* ---- kernels ----------------------------------------------------------------------------------------------- */

/* Both sides of one mesh. */
typedef struct contest {
    const char *name;
    const mesh *m;
    pt_scene ours;
    RTCScene fast, robust;
} contest;

static RTCScene embree_build(RTCDevice device, const mesh *m, int robust)
{
    RTCScene scene = rtcNewScene(device);
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    if (robust) rtcSetSceneFlags(scene, RTC_SCENE_FLAG_ROBUST);
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, m->v, 0, sizeof *m->v, m->vertices);
    rtcSetSharedGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, m->index, 0, 3 * sizeof *m->index, m->triangles);
    rtcCommitGeometry(g);
    rtcAttachGeometry(scene, g);
    rtcReleaseGeometry(g);
    rtcCommitScene(scene);
    return scene;
}

static struct RTCRay embree_ray(const pt_ray *r)
{
    struct RTCRay e;
    e.org_x = r->o.x;
    e.org_y = r->o.y;
    e.org_z = r->o.z;
    e.dir_x = r->d.x;
    e.dir_y = r->d.y;
    e.dir_z = r->d.z;
    e.tnear = e.time = 0;
    e.tfar = r->tmax;
    e.mask = 0xffffffffu;
    e.flags = e.id = 0;
    return e;
}

static int embree_nearest(RTCScene scene, const pt_ray *r, struct RTCRayHit *h)
{
    struct RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    h->ray = embree_ray(r);
    h->hit.geomID = h->hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, &context, h);
    return h->hit.geomID != RTC_INVALID_GEOMETRY_ID;
}

static int embree_any(RTCScene scene, const pt_ray *r)
{
    struct RTCIntersectContext context;
    struct RTCRay e = embree_ray(r);
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene, &context, &e);
    return e.tfar < 0;
}

/* Seconds for rays of a chunk; hits are counted. */
static double trace(const contest *c, int kernel, int set, int first)
{
    const double start = pt_cpu_seconds();
    const pt_ray *r = rays[set] + first, *end = r + CHUNK;
    RTCScene scene = kernel == FAST ? c->fast : c->robust;
    int n = 0;
    if (kernel >= FAST && set == SHADOW) {
        for (; r < end; r++) n += embree_any(scene, r);
    } else if (kernel >= FAST) {
        struct RTCRayHit h;
        for (; r < end; r++) n += embree_nearest(scene, r, &h);
    } else if (set == SHADOW) {
        for (; r < end; r++) n += pt_occluded(&c->ours, r);
    } else if (kernel == FULL) {
        pt_hit hit;
        for (; r < end; r++) n += pt_intersect(&c->ours, r, &hit);
    } else {
        pti_best best;
        pti_ray q;
        for (; r < end; r++) {
            pti_ray_set_real(&q, r);
            n += pti_search(&c->ours, &q, (double)r->tmax, &best, 0);
        }
    }
    hits[kernel] += n;
    return pt_cpu_seconds() - start;
}

/* ---- rays -------------------------------------------------------------------------------------------------- */

static pt_vec3 inside_box(pt_vec3 lo, pt_vec3 size) { return pt_v3_add(lo, pt_v3(size.x * uniform(), size.y * uniform(), size.z * uniform())); }

static void make_rays(const contest *c)
{
    const int room = strncmp(c->name, "cornell", 4) == 0 || strncmp(c->name, "room", 4) == 0;
    const pt_vec3 lo = c->ours.lo, size = pt_v3_sub(c->ours.hi, lo), centre = pt_v3_add(lo, pt_v3_scale(size, 0.5f));
    const float extent = fmaxf(size.x, fmaxf(size.y, size.z));
    const pt_vec3 eye = pt_v3_add(centre, pt_v3_scale(room ? pt_v3(0, 0, -1.9f) : pt_v3(0.3f, 0.4f, 1.2f), extent));
    const pt_frame frame = pt_frame_from_normal(pt_v3_normalize(pt_v3_sub(eye, centre)));
    int i;
    for (i = 0; i < RAYS; i++) {
        const float half = room ? 0.36f : 0.5f, x = (2 * ((float)(i % SIDE) + uniform()) / SIDE - 1) * half;
        const float y = (2 * ((float)(i / SIDE) + uniform()) / SIDE - 1) * half;
        const pt_vec3 a = inside_box(lo, size), b = inside_box(lo, size);
        pt_vec3 p = a, n = pt_v3(0, 1, 0), to;
        struct RTCRayHit h;
        pt_ray *r = &rays[PRIMARY][i];
        r->o = eye;
        r->d = pt_v3_normalize(pt_frame_to_world(&frame, pt_v3(x, y, -1)));
        r->tmax = 1e30f;
        if (embree_nearest(c->robust, r, &h)) {
            n = pt_v3_normalize(pt_v3(h.hit.Ng_x, h.hit.Ng_y, h.hit.Ng_z));
            if (pt_v3_dot(n, r->d) > 0) n = pt_v3_neg(n);
            p = pt_v3_add(pt_v3_add(eye, pt_v3_scale(r->d, h.ray.tfar)), pt_v3_scale(n, 1e-4f * extent));
        }
        rays[DIFFUSE][i].o = rays[SHADOW][i].o = p;
        rays[DIFFUSE][i].d = pt_v3_normalize(pt_v3_add(n, pt_warp_sphere(pt_v2(uniform(), uniform()))));
        rays[DIFFUSE][i].tmax = rays[RANDOM][i].tmax = 1e30f;
        rays[RANDOM][i].d = pt_v3_normalize(pt_v3_sub(b, a));
        rays[RANDOM][i].o = pt_v3_sub(a, pt_v3_scale(rays[RANDOM][i].d, 0.5f * extent));
        to = pt_v3_add(centre, pt_v3(spread(-0.2f, 0.2f) * extent, (room ? 0.499f : 1.1f) * size.y, spread(-0.2f, 0.2f) * extent));
        rays[SHADOW][i].d = pt_v3_sub(to, p);
        rays[SHADOW][i].tmax = 0.999f;
        if (i % 2) { /* both kinds that programs have: a unit direction, or one that ends at 1 */
            rays[SHADOW][i].tmax *= pt_v3_length(rays[SHADOW][i].d);
            rays[SHADOW][i].d = pt_v3_normalize(rays[SHADOW][i].d);
        }
    }
}

/* ---- rows -------------------------------------------------------------------------------------------------- */

static int compare_doubles(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double median(double *x)
{
    qsort(x, RUNS, sizeof *x, compare_doubles);
    return x[RUNS / 2];
}

/* A rate of ours, one of Embree, and their ratio; unit per second. */
static void print_row(const contest *c, const char *what, const double *value, const double *reference, const char *unit)
{
    double v[RUNS], r[RUNS], q[RUNS];
    int i;
    for (i = 0; i < RUNS; i++) {
        v[i] = value[i];
        r[i] = reference[i];
        q[i] = value[i] / reference[i];
    }
    printf("%s/%s/%s,%.4g,%s,%.4g,", VARIANT, c->name, what, median(v), unit, median(r));
    median(q);
    printf("%.3f,%.3f,%.3f\n", q[RUNS / 2], q[1], q[RUNS - 2]);
    fflush(stdout);
}

static void contest_of_rays(contest *c)
{
    static double rate[KERNELS][SETS][RUNS];
    double mean[KERNELS][RUNS];
    char what[80];
    int run, set, k, at;
    for (set = 0; set < SETS; set++) {
        memset(hits, 0, sizeof hits);
        for (run = 0; run < RUNS; run++) {
            double seconds[KERNELS] = {0};
            for (at = 0; at < RAYS; at += CHUNK)
                for (k = 0; k < KERNELS; k++) {
                    const int kernel = (k + at / CHUNK + run) % KERNELS;
                    seconds[kernel] += trace(c, kernel, set, at);
                }
            for (k = 0; k < KERNELS; k++) rate[k][set][run] = 1e-6 * RAYS / seconds[k];
        }
        snprintf(what, sizeof what, "%s/fast", SET_NAMES[set]);
        print_row(c, what, rate[OURS][set], rate[FAST][set], "Mrays/s");
        snprintf(what, sizeof what, "%s/robust", SET_NAMES[set]);
        print_row(c, what, rate[OURS][set], rate[ROBUST][set], "Mrays/s");
        if (set != SHADOW) {
            snprintf(what, sizeof what, "%s/intersect", SET_NAMES[set]);
            print_row(c, what, rate[FULL][set], rate[FAST][set], "Mrays/s");
        }
        fprintf(stderr, "%s %s: hits %d, fast %+d, robust %+d\n", c->name, SET_NAMES[set], hits[OURS] / RUNS,
                (hits[FAST] - hits[OURS]) / RUNS, (hits[ROBUST] - hits[OURS]) / RUNS);
    }
    for (run = 0; run < RUNS; run++)
        for (k = 0; k < KERNELS; k++)
            mean[k][run] = pow(rate[k][0][run] * rate[k][1][run] * rate[k][2][run] * rate[k][3][run], 0.25);
    print_row(c, "geomean/fast", mean[OURS], mean[FAST], "Mrays/s");
    print_row(c, "geomean/robust", mean[OURS], mean[ROBUST], "Mrays/s");
    print_row(c, "geomean/intersect", mean[FULL], mean[FAST], "Mrays/s");
}

static void fill_scene(pt_scene *s, const mesh *m, int threads)
{
    memset(s, 0, sizeof *s);
    s->threads = threads;
    pt_add_mesh(s, m->v, NULL, NULL, m->vertices, m->index, m->triangles, pt_add_material(s, pt_material_diffuse(pt_rgb_grey(1))));
}

static double seconds_of(int threads) { return threads == 1 ? pt_cpu_seconds() : pt_wall_seconds(); }

/* Million triangles a second: all of pt_commit, the tree alone, and Embree. Small meshes are built many times. */
static void contest_of_builds(contest *c, int threads)
{
    char config[32];
    const int times = 1 + 200000 / (int)c->m->triangles;
    double rate[3][RUNS];
    RTCDevice device;
    int run, i;
    snprintf(config, sizeof config, "threads=%d", threads);
    device = rtcNewDevice(config);
    for (run = 0; run < RUNS; run++) {
        double seconds[3] = {0, 0, 0};
        for (i = 0; i < times; i++) {
            double start = seconds_of(threads);
            pt_scene s;
            pt_wide tree;
            rtcReleaseScene(embree_build(device, c->m, 0));
            seconds[2] += seconds_of(threads) - start;
            fill_scene(&s, c->m, threads);
            start = seconds_of(threads);
            pt_commit(&s);
            seconds[0] += seconds_of(threads) - start;
            start = seconds_of(threads);
            pti_build_wide(&s, &tree);
            pti_free(tree.memory, NULL);
            seconds[1] += seconds_of(threads) - start;
            pt_scene_free(&s);
        }
        for (i = 0; i < 3; i++) rate[i][run] = 1e-6 * times * c->m->triangles / seconds[i];
    }
    print_row(c, threads == 1 ? "build" : "build-2-threads", rate[1], rate[2], "Mtri/s");
    print_row(c, threads == 1 ? "commit" : "commit-2-threads", rate[0], rate[2], "Mtri/s");
    rtcReleaseDevice(device);
}

static void run_contest(RTCDevice device, const char *name, mesh m)
{
    contest c;
    c.name = name;
    c.m = &m;
    fill_scene(&c.ours, &m, 1);
    if (pt_commit(&c.ours) != PT_OK) abort();
    c.fast = embree_build(device, &m, 0);
    c.robust = embree_build(device, &m, 1);
    make_rays(&c);
    contest_of_rays(&c);
    printf("%s/%s/bytes,%.1f,bytes a triangle,55,%.3f,,\n", VARIANT, name, (double)c.ours.wide.bytes / m.triangles, (double)c.ours.wide.bytes / m.triangles / 55);
    contest_of_builds(&c, 1);
    if (m.triangles > 10000) contest_of_builds(&c, 2);
    rtcReleaseScene(c.fast);
    rtcReleaseScene(c.robust);
    pt_scene_free(&c.ours);
    free_mesh(&m);
}

/* Rays from within a closed mesh at its vertices and edges: what escapes? */
static void closed_mesh(RTCDevice device)
{
    static const char *const TARGETS[3] = {"vertices", "edges", "edges-from-centre"};
    mesh m = make_icosphere(6);
    RTCScene fast = embree_build(device, &m, 0);
    pt_scene ours;
    int target, i;
    fill_scene(&ours, &m, 1);
    if (pt_commit(&ours) != PT_OK) abort();
    for (target = 0; target < 3; target++) {
        int lost = 0, seen_through = 0, theirs = 0;
        for (i = 0; i < 1000000; i++) {
            const uint32_t *f = m.index + 3 * (size_t)(uint32_t)(pt_pcg32_double(&rng) * m.triangles);
            const float w = target == 0 ? 0 : uniform();
            const pt_vec3 to = pt_v3_add(pt_v3_scale(m.v[f[0]], 1 - w), pt_v3_scale(m.v[f[1]], w));
            pt_ray r;
            pt_hit hit;
            struct RTCRayHit h;
            r.o = target == 2 ? pt_v3(0, 0, 0) : pt_v3(spread(-0.2f, 0.2f), spread(-0.2f, 0.2f), spread(-0.2f, 0.2f));
            r.d = pt_v3_normalize(pt_v3_sub(to, r.o));
            r.tmax = 1e30f;
            lost += !pt_intersect(&ours, &r, &hit);
            seen_through += !pt_occluded(&ours, &r);
            theirs += !embree_nearest(fast, &r, &h);
        }
        printf("%s/icosphere/%s/escapes,%d,rays of 1000000,%d,,,\n", VARIANT, TARGETS[target], lost, theirs);
        printf("%s/icosphere/%s/unoccluded,%d,rays of 1000000,0,,,\n", VARIANT, TARGETS[target], seen_through);
    }
    rtcReleaseScene(fast);
    pt_scene_free(&ours);
    free_mesh(&m);
}

static int wanted(int argc, char **argv, const char *name)
{
    int i;
    for (i = 1; i < argc; i++)
        if (strcmp(argv[i], name) == 0) return 1;
    return argc == 1;
}

int main(int argc, char **argv)
{
    RTCDevice device = rtcNewDevice("threads=1");
    mesh blob;
    void *volatile much = malloc((size_t)16 << 20);
    free(much);
    _mm_setcsr(_mm_getcsr() | _MM_FLUSH_ZERO_ON | _MM_DENORMALS_ZERO_ON); /* as Embree asks for */
    rng = pt_pcg32_make(1, 1);
    if (wanted(argc, argv, "cornell")) run_contest(device, "cornell", make_room(NULL));
    if (wanted(argc, argv, "knot-1k")) run_contest(device, "knot-1k", make_knot(32, 16));
    if (wanted(argc, argv, "knot-70k")) run_contest(device, "knot-70k", make_knot(512, 68));
    if (wanted(argc, argv, "room-118k")) {
        blob = make_blob(99, 0.12);
        run_contest(device, "room-118k", make_room(&blob));
        free_mesh(&blob);
    }
    if (wanted(argc, argv, "blob-870k")) run_contest(device, "blob-870k", make_blob(269, 0.12));
    if (wanted(argc, argv, "grid-1m")) run_contest(device, "grid-1m", make_grid());
    if (wanted(argc, argv, "icosphere")) closed_mesh(device);
    rtcReleaseDevice(device);
    return 0;
}
